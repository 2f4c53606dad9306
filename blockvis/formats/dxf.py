"""Drawings, .dxf R12 to R2018: closed outlines, hatches, inserted blocks, loose lines; the layer is the group."""

from __future__ import annotations

import json
import logging
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from blockvis.layout.block_table import layer_of, moved_notes, on_layer, rows_of, with_rows
from blockvis.layout.choice import Choice, look_of
from blockvis.layout.layout import Layout
from blockvis.layout.left_out import LeftOut, passed_over
from blockvis.layout.notes import CHANGED, Note, kind_of
from blockvis.layout.outlines import chords_of, drawing_plane, filled
from blockvis.layout.refusal import Refused
from blockvis.layout.units import metres_per
from solver.mechanics import counted

from .arcs import Arc, with_shared_corners
from .bodies import Bodies
from .dxf_bodies import DrawnMesh, drawn_mesh, is_mesh, layout_of_meshes, meshes_of_faces
from .loose_lines import Faces, Line, faces_of_lines, is_chain, joined_ends, joined_note, nothing_closed
from .reading import Reading

#: How a binary file begins.
BINARY = b"AutoCAD Binary DXF"

#: Units by the header variable $INSUNITS.
UNIT_CODES = {
    1: "in", 2: "ft", 3: "1609.344 m", 4: "mm", 5: "cm", 6: "m", 7: "km", 8: "1e-6 in", 9: "0.001 in", 10: "yd",
    11: "1e-10 m", 12: "1e-9 m", 13: "0.001 mm", 14: "dm", 15: "10 m", 16: "100 m", 17: "1e9 m",
    # The feet of American surveyors, 2 millionths longer.
    21: "ft", 22: "in", 23: "yd", 24: "1609.347219 m",
}  # fmt: skip

#: Application name of the extended data of an outline that hold the block's row of the block table.
APPLICATION = "BLOCKVIS"

#: Inserted blocks that are nested deeper than this insert themselves.
DEEPEST_INSERT = 16

#: Layer of AutoCAD that holds the points of dimensions and is never printed.
NEVER_DRAWN = "Defpoints"

#: Outlines closer than this fraction of their size are the same.
CLOSES = 1e-6

#: An arc of a smaller opening [rad] is a whole ellipse.
WHOLE_TURN = 1e-9

#: Colours of an entity that stand for that of its layer or of the inserted block, and what nobody gave a colour.
BY_LAYER, BY_BLOCK, WHITE = 256, 0, 7

#: The same of line types.
BY_LAYER_TYPE, BY_BLOCK_TYPE = "BYLAYER", "BYBLOCK"

_CURVES = {"LWPOLYLINE", "POLYLINE", "CIRCLE", "ELLIPSE", "SPLINE", "ARC", "LINE", "SOLID", "TRACE", "3DFACE"}


@dataclass
class _Outlines:
    """Outlines and loose lines found so far, and what was skipped."""

    rings: list[np.ndarray] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    layers: list[str] = field(default_factory=list)
    rows: list[dict[str, Any]] = field(default_factory=list)
    looks: list[tuple[str, ...]] = field(default_factory=list)
    within: list[tuple[str, ...]] = field(default_factory=list)
    offs: list[float] = field(default_factory=list)
    arcs: list[tuple[Arc, ...]] = field(default_factory=list)
    loose: list[Line] = field(default_factory=list)
    skipped: Counter[str] = field(default_factory=Counter)
    hidden: Counter[str] = field(default_factory=Counter)
    misses: list[float] = field(default_factory=list)
    left_out: list[LeftOut] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    meshes: list[DrawnMesh] = field(default_factory=list)
    faces: list[int] = field(default_factory=list)

    def add(self, ring: np.ndarray, entity: Any, handle: str, off: float = 0.0, arcs: tuple[Arc, ...] = ()) -> None:
        """Add an outline (n, 3) whose chords are up to ``off`` from its curves, of which some are arcs."""
        self.rings.append(ring)
        self.offs.append(off)
        self.arcs.append(arcs)
        self.layers.append(str(entity.dxf.layer))
        self.names.append(f"block {handle}")
        self.rows.append(_own_data(entity))
        self.within.append(())
        self.looks.append(_looks(entity))

    @property
    def of_outlines(self) -> tuple[list[Any], ...]:
        """Lists with an item for each outline."""
        return self.rings, self.names, self.layers, self.rows, self.looks, self.offs, self.arcs, self.within

    def append(
        self,
        ring: np.ndarray,
        level: float,
        layer: str,
        name: str,
        looks: tuple[str, ...],
        within: tuple[str, ...] = (),
    ) -> None:
        """Add an outline (n, 2) that lines make, at a level."""
        self.within.append(within)
        self.rings.append(np.column_stack([ring, np.full(len(ring), level)]))
        self.offs.append(0.0)
        self.arcs.append(())
        self.layers.append(layer)
        self.names.append(name)
        self.rows.append({})
        self.looks.append(looks)


def read(path: Path, reading: Reading) -> Layout | Bodies:
    """Read a .dxf drawing; its unit is that of the header variable $INSUNITS."""
    log = logging.getLogger("ezdxf")
    level = log.level
    # What ezdxf would print to the terminal is counted in a note.
    log.setLevel(logging.CRITICAL + 1)
    try:
        return _read(path, reading)
    finally:
        log.setLevel(level)


def _read(path: Path, reading: Reading) -> Layout | Bodies:
    import ezdxf
    from ezdxf import recover

    try:
        content = path.read_bytes()
        if b"SECTION" not in content:
            raise ValueError(f"it begins with {content[:16]!r}")
        if content.startswith(BINARY):
            # recover reads text only.
            document = ezdxf.readfile(path)
            audit = document.audit()
        else:
            document, audit = recover.readfile(path)
    except (OSError, ezdxf.DXFError, ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        raise ValueError(
            f"'{path}' is not a readable DXF file ({error}); save it again as DXF R2000 or later"
        ) from None
    stated, doubts = _unit(document, reading)
    in_metres = metres_per(reading.unit or stated or "m")
    tolerance = None if reading.chord_tolerance is None else reading.chord_tolerance / in_metres
    frozen = {layer.dxf.name for layer in document.layers if layer.is_frozen()}
    shut = frozen | {layer.dxf.name for layer in document.layers if layer.is_off()}
    found = _Outlines(notes=doubts)
    for entity, handle in _bounded(document.modelspace(), path, frozen):
        if entity.dxf.layer in shut:
            found.hidden[entity.dxf.layer] += 1
        elif entity.dxf.get("invisible", 0):
            found.skipped[f"invisible {entity.dxftype()}"] += 1
        else:
            _add(entity, handle, found, tolerance)
    closed = meshes_of_faces([(found.layers[k], found.names[k], found.rings[k]) for k in found.faces], path)
    if closed:
        found.meshes += closed
        for k in reversed(found.faces):
            for each in found.of_outlines:
                del each[k]
    meshes = _chosen_meshes(found, reading)
    if meshes:
        return layout_of_meshes(meshes, path, reading, stated, _faults(audit) + _skipped(found))
    found.notes += _turned(found, reading, path)
    faces = _with_loose(found, reading, tolerance)
    if not found.rings and all(item.kind == "open" for item in found.left_out):
        seen = ", ".join(f"{n} {kind}" for kind, n in found.skipped.items())
        listed = "; ".join(words for words in (nothing_closed(faces), seen) if words) or "nothing"
        raise Refused(
            f"'{path}' has no closed outline in its model space (found: {listed}); draw each block as a closed "
            "polyline",
            Layout((), (), unit=stated, left_out=tuple(found.left_out)),
        )
    found.notes += _faults(audit)
    return _layout(found, faces, stated)


def _unit(document: Any, reading: Reading) -> tuple[str, list[str]]:
    """Find the unit that a file states, "" for none, and a note if that is not one of length."""
    code = int(document.header.get("$INSUNITS", 0) or 0)
    if not code or code in UNIT_CODES or reading.unit is not None:
        return UNIT_CODES.get(code, ""), []
    return "", [
        Note(CHANGED, f"the file states unit {code} ($INSUNITS), which is not known; give unit=... to settle it")
    ]


def _layout(found: _Outlines, faces: Faces, stated: str) -> Layout:
    """Make a layout of what was found; ``stated`` is the unit that the file states."""
    notes = found.notes + faces.notes + joined_note(found.misses, _size(found))
    notes += _skipped(found)
    layout = Layout(
        blocks=tuple(ring[:, :2] for ring in found.rings),
        names=tuple(found.names),
        unit=stated,
        notes=tuple(notes),
        left_out=tuple(item.turned(np.eye(item.points.shape[1])[:2]) for item in found.left_out),
        looks=tuple(found.looks),
        within=tuple(found.within),
    )
    moved = [
        row and _layer_name(row).lower() != layer.lower() for row, layer in zip(found.rows, found.layers, strict=True)
    ]
    own = [
        on_layer(row, layer) if was else row for row, layer, was in zip(found.rows, found.layers, moved, strict=True)
    ]
    rows = [
        {"group": layer, **({"material": layer} if layer != "0" else {}), "name": name, **row}
        for layer, name, row in zip(found.layers, found.names, own, strict=True)
    ]
    notes = moved_notes([pair for pair, was in zip(zip(found.rows, rows, strict=True), moved, strict=True) if was])
    return with_rows(replace(layout, notes=(*layout.notes, *notes)), rows, own=True)


def _chosen_meshes(found: _Outlines, reading: Reading) -> list[DrawnMesh]:
    """Take the bodies that are asked for, where no outline is; count the others, or the outlines, as skipped."""
    meshes = [mesh for mesh in found.meshes if reading.wants([mesh.layer, mesh.name])]
    outlines = [layer for layer, name in zip(found.layers, found.names, strict=True) if reading.wants([layer, name])]
    if meshes and not outlines:
        flat = len(found.rings) + len(found.loose)
        found.skipped.update({"outlines and lines beside bodies in space": flat} if flat else {})
        return meshes
    found.skipped.update(Counter(mesh.curved or "body in space" for mesh in found.meshes))
    return []


def _skipped(found: _Outlines) -> list[str]:
    """Count what was skipped in notes."""
    hidden = {f"on '{layer}'": n for layer, n in found.hidden.items()}
    return [*passed_over(found.skipped), *passed_over(hidden, "skipped on layers that are off or frozen")]


def _faults(audit: Any) -> list[str]:
    """Count the faults that ezdxf found in a note."""
    faults = len(audit.fixes) + len(audit.errors)
    return [Note(CHANGED, f"repaired or passed over: {counted(faults, 'fault')} of the file")] if faults else []


def _turned(found: _Outlines, reading: Reading, path: Path) -> list[str]:
    """Turn a drawing, of which what is wanted stands upright, into the plane of x and y; say what that changes."""
    every = [*found.rings, *(line.points for line in found.loose)]
    if not every or not all(np.isfinite(points).all() for points in every):
        return []
    unwanted, asked = _choices(found, reading)
    labels = zip(_labels(found), found.looks, strict=True)
    wanted = [not unwanted.takes(*own) and (not reading.only or asked.takes(*own)) for own in labels]
    # Where outlines are asked for by name, other lines are in the plane of something else, as a plan.
    named = [not unwanted.takes(*own) and (not reading.only or asked.takes(*own)) for own in _of_lines(found)]
    wanted += named if any(wanted) or any(named) else _wanted_lines(found, unwanted, asked)
    chosen = [points for points, is_wanted in zip(every, wanted, strict=True) if is_wanted]
    turn, notes = drawing_plane(chosen or every, f"'{path}'", reading.view)
    still = np.zeros(3)
    found.rings = [ring @ turn.T for ring in found.rings]
    found.arcs = [tuple(arc.mapped(turn, still) for arc in arcs) for arcs in found.arcs]
    found.loose = [
        replace(line, points=line.points @ turn.T, curves=tuple(arc.mapped(turn, still) for arc in line.curves))
        for line in found.loose
    ]
    found.left_out = [item.turned(turn) for item in found.left_out]
    if found.faces:
        remedy = "; 3DFACEs of a layer are read as bodies in space where they close one"
        notes = [Note(CHANGED, f"{note}{remedy}") if kind_of(note) == CHANGED else note for note in notes]
    return notes


def _bounded(entities: Any, path: Path, frozen: Set[str]) -> Iterator[tuple[Any, str]]:
    """Yield entities and their handles; of a small file that inserts any number of copies no more than it may have."""
    size = path.stat().st_size
    most = max(size // 4, 1000)
    for number, found in enumerate(_flat(entities, 0, path, frozen)):
        if number >= most:
            raise ValueError(
                f"'{path}' inserts more than {most} entities, though it has {size} bytes only; "
                "explode its block references"
            )
        yield found


def _flat(
    entities: Any,
    depth: int,
    path: Path,
    frozen: Set[str],
    parent: str = "",
    layer: str = "0",
    colour: int = WHITE,
    line_type: str = BY_LAYER_TYPE,
) -> Iterator[tuple[Any, str]]:
    """Yield all entities, inserted blocks resolved, each with a handle that names it.

    What a block draws on layer 0 lies on the layer on which it is inserted; on a frozen one none of it is seen.
    """
    if depth > DEEPEST_INSERT:
        raise ValueError(f"'{path}' inserts blocks into each other more than {DEEPEST_INSERT} deep; explode them")
    for number, entity in enumerate(entities):
        handle = f"{parent}.{number}" if parent else str(entity.dxf.handle or number)
        if parent and entity.dxf.layer == "0":
            entity.dxf.layer = layer
        if parent and entity.dxf.get("color", BY_LAYER) == BY_BLOCK:
            entity.dxf.color = colour
        if parent and str(entity.dxf.get("linetype", BY_LAYER_TYPE)).upper() == BY_BLOCK_TYPE:
            entity.dxf.linetype = line_type
        if entity.dxftype() != "INSERT" or entity.dxf.layer in frozen or _is_closed(entity):
            yield entity, handle
            continue
        copies = entity.multi_insert() if entity.mcount > 1 else [entity]
        for k, copy in enumerate(copies):
            plain, stretch = _stretched(copy)
            number_of = f"{handle}.{k}" if entity.mcount > 1 else handle
            own = entity.dxf.layer, int(entity.dxf.get("color", BY_LAYER)), _line_type(entity) or "Continuous"
            inner = _flat(_inserted(plain, path), depth + 1, path, frozen, number_of, *own)
            yield from inner if stretch is None else _transformed(inner, stretch, frozen)


def _is_closed(insert: Any) -> bool:
    """Whether nothing of an inserted block is drawn here: it is invisible, in another file, or not there."""
    block = insert.block()
    return bool(insert.dxf.get("invisible", 0)) or block is None or bool(block.block.is_xref)


def _stretched(insert: Any) -> tuple[Any, Any]:
    """Split a stretched reference to a block that inserts others into one that only places it, and a matrix.

    Inserted blocks that are turned are sheared by it, which ezdxf cannot say of a reference: it draws them turned.
    """
    # QCAD writes a zscale of 0 for plane drawings, with which no transformation can be made.
    insert.dxf.zscale = insert.dxf.get("zscale", 1.0) or 1.0
    scales = {abs(insert.dxf.get(f"{axis}scale", 1.0)) for axis in "xyz"}
    block = insert.block()
    if len(scales) == 1 or block is None or not block.query("INSERT"):
        return insert, None
    plain = insert.copy()
    for key, value in (("insert", (0, 0, 0)), ("rotation", 0), ("extrusion", (0, 0, 1))):
        plain.dxf.set(key, value)
    for axis in "xyz":
        plain.dxf.set(f"{axis}scale", 1.0)
    placed = plain.matrix44()
    placed.inverse()
    return plain, placed * insert.matrix44()


def _transformed(entities: Iterator[tuple[Any, str]], matrix: Any, frozen: Set[str]) -> Iterator[tuple[Any, str]]:
    """Transform the entities of a block; arcs become those of ellipses, of which one outline may have several."""
    from ezdxf import transform

    for entity, handle in entities:
        if entity.dxftype() == "INSERT":
            yield entity, handle
            continue
        _, found = transform.copies([entity], matrix)
        for k, one in enumerate(found):
            yield one, f"{handle}.{k}" if len(found) > 1 else handle


def _inserted(insert: Any, path: Path) -> Iterator[Any]:
    """Yield the entities of an inserted block at its place; ezdxf raises errors of any kind for a damaged one."""
    try:
        yield from insert.virtual_entities()
    except (TypeError, AttributeError, ValueError, KeyError, IndexError, ArithmeticError) as error:
        raise ValueError(
            f"'{path}': block reference '{insert.dxf.get('name', '?')}' cannot be resolved ({error}); explode it"
        ) from None


def _points(curve: Any, tolerance: float | None) -> tuple[np.ndarray, float]:
    """(n, 3) array: points of a path, its arcs replaced by chords, both ends included; how far these are off it."""
    box = np.array([(p.x, p.y, p.z) for p in curve.control_vertices()])
    size = float(np.ptp(box, axis=0).max()) if len(box) and np.isfinite(box).all() else 0.0
    if not curve.has_curves or size == 0.0:
        return box, 0.0
    distance = max(1e-3 * size if tolerance is None else tolerance, 1e-6 * size)
    return np.array([(p.x, p.y, p.z) for p in curve.flattening(distance, segments=2)]), distance


def _add(entity: Any, handle: str, found: _Outlines, tolerance: float | None) -> None:
    kind = entity.dxftype()
    if entity.dxf.layer == NEVER_DRAWN:
        found.skipped[f"{kind} on {NEVER_DRAWN}"] += 1
    elif kind in ("HATCH", "MPOLYGON"):
        _add_hatch(entity, handle, found, tolerance)
    elif is_mesh(entity):
        found.meshes.append(drawn_mesh(entity, handle))
    elif kind in _CURVES:
        _add_curve(entity, handle, found, tolerance)
    else:
        found.skipped[f"reference to another file ('{entity.dxf.name}')" if kind == "INSERT" else kind] += 1


def _add_curve(entity: Any, handle: str, found: _Outlines, tolerance: float | None) -> None:
    from ezdxf.path import make_path

    kind = entity.dxftype()
    if kind in ("SOLID", "TRACE", "3DFACE"):
        ring = np.array([(p.x, p.y, p.z) for p in entity.wcs_vertices()])
        found.faces += [len(found.rings)] if kind == "3DFACE" else []
        found.add(ring, entity, handle)
        return
    if kind == "SPLINE":
        clamped = _clamped(entity.control_points, entity.weights, entity.knots, entity.dxf.degree)
        entity.control_points, entity.weights, entity.knots = clamped
    points, off, arcs = _circular(entity, tolerance) or (*_points(make_path(entity), tolerance), ())
    if len(points) < 2:
        found.skipped[f"{kind} without length"] += 1
        return
    if not np.isfinite(points).all():
        bad = points[~np.isfinite(points).all(axis=1)][0].tolist()
        raise ValueError(
            f"{kind} {handle} on layer '{entity.dxf.layer}' has a point at {bad}; coordinates must be finite numbers"
        )
    closes = bool(getattr(entity, "is_closed", False) or getattr(entity, "closed", False))
    joined = joined_ends(points) if kind not in ("LINE", "ARC") else None
    if joined is not None:
        ring, miss = joined
        # A closed polyline may have a short last edge: it stays.
        short = closes and miss > CLOSES * float(np.ptp(points, axis=0).max())
        found.add(points if short else ring, entity, handle, off, arcs)
        found.misses += [] if closes else [miss]
        return
    if closes and kind not in ("LINE", "ARC") and len(points) > 3:
        found.add(points, entity, handle, off, arcs)
        return
    layer, must_close = str(entity.dxf.layer), kind not in ("LINE", "ARC")
    drawn = _line_type(entity)
    found.loose.append(
        Line(points, layer, handle, must_close, _looks(entity), off, arcs, drawn, _is_chain(entity, drawn))
    )


def _clamped(points: Any, weights: Any, knots: Any, degree: int) -> tuple[Any, Any, Any]:
    """Write a spline with knots at whose ends it begins and ends: ezdxf splits others, as periodic ones, wrongly.

    Returns
    -------
    points : sequence of vectors
    weights, knots : sequences of float
    """
    from scipy.interpolate import BSpline, make_interp_spline

    n, every = len(points), np.array(knots, dtype=float)
    if n <= degree or len(every) != n + degree + 1 or (np.diff(every) < 0).any():
        return points, weights, knots
    first, last = every[degree], every[n]
    inner = every[(every > first) & (every < last)]
    most = np.unique(inner, return_counts=True)[1].max(initial=0)
    if (every[0] == first and every[-1] == last) or first == last or most > degree:
        return points, weights, knots
    factors = np.array(weights if len(weights) == n else np.ones(n))[:, None]
    curve = BSpline(every, np.column_stack([np.array([(*p,) for p in points]) * factors, factors]), degree)
    ends = np.concatenate([np.full(degree + 1, first), inner, np.full(degree + 1, last)])
    # As many values as there are control points between these knots determine them.
    at = np.array([ends[i + 1 : i + 1 + degree].mean() for i in range(len(ends) - degree - 1)])
    found = make_interp_spline(at, curve(at), degree, ends).c
    return (found[:, :-1] / found[:, -1:]).tolist(), found[:, -1].tolist() if len(weights) else [], ends.tolist()


def _circular(entity: Any, tolerance: float | None) -> tuple[np.ndarray, float, tuple[Arc, ...]] | None:
    """(n, 3) array: points of lines and circular arcs, how far chords are off, and the arcs; None for other entities.

    The chords are measured on the arcs themselves: ezdxf's paths replace an arc by a cubic first, which deviates from
    it by up to 2.7e-4 of the radius.
    """
    kind = entity.dxftype()
    if kind == "SPLINE" and entity.dxf.degree == 1 and len(entity.control_points):
        # Straight from corner to corner: ezdxf would put a smooth curve through them.
        straight = np.array([(*point,) for point in entity.control_points])
        return (np.concatenate([straight, straight[:1]]) if entity.closed else straight), 0.0, ()
    if kind == "ELLIPSE":
        # It lies in the world, not in a plane of its own.
        axes = np.array([(*axis,) for axis in (entity.dxf.major_axis, entity.minor_axis)]).T
        arc = _ellipse(np.array((*entity.dxf.center,)), axes, entity.dxf.start_param, entity.dxf.end_param, tolerance)
        return _on(arc), arc.off, (arc,)
    if kind in ("CIRCLE", "ARC"):
        begin, end = (0.0, 360.0) if kind == "CIRCLE" else (entity.dxf.start_angle, entity.dxf.end_angle)
        start, sweep = math.radians(begin), math.radians((end - begin) % 360.0 or 360.0)
        arc = _arc(0, entity.dxf.center, abs(float(entity.dxf.radius)), start, sweep, tolerance)
        flat, arcs = _on(arc), [arc]
        level = float(entity.dxf.center.z)
    elif kind == "LWPOLYLINE":
        flat, arcs = _with_bulges([(x, y, b) for x, y, b in entity.get_points("xyb")], bool(entity.closed), tolerance)
        level = float(entity.dxf.elevation)
    elif kind == "POLYLINE" and entity.is_2d_polyline and not entity.dxf.flags & 6:
        corners = [(v.dxf.location.x, v.dxf.location.y, float(v.dxf.bulge)) for v in entity.vertices]
        flat, arcs = _with_bulges(corners, bool(entity.is_closed), tolerance)
        level = float(entity.dxf.elevation.z) if entity.dxf.hasattr("elevation") else 0.0
    else:
        return None
    return _in_world(entity, flat, arcs, level)


def _in_world(
    entity: Any, flat: np.ndarray, arcs: list[Arc], level: float
) -> tuple[np.ndarray, float, tuple[Arc, ...]]:
    """Put points and arcs of an entity's own plane into space, and say how far chords are off."""
    system = entity.ocs()
    own = np.array([(*system.to_wcs(axis),) for axis in np.eye(3).tolist()]).T
    points = np.array([(*system.to_wcs((x, y, level)),) for x, y in flat]).reshape(-1, 3)
    placed = tuple(arc.mapped(own[:, :2], level * own[:, 2]) for arc in arcs)
    return points, max((arc.off for arc in arcs), default=0.0), placed


def _arc(first: int, centre: Any, radius: float, start: float, sweep: float, tolerance: float | None) -> Arc:
    """Make an arc of a circle."""
    n = chords_of(sweep, radius, tolerance)
    return Arc(first, n, np.array([centre.x, centre.y]), radius * np.eye(2), start, sweep)


def _ellipse(centre: np.ndarray, axes: np.ndarray, start: float, end: float, tolerance: float | None) -> Arc:
    """Make an arc of an ellipse with half axes (d, 2) between two parameters [rad], counter-clockwise."""
    sweep = (end - start) % (2.0 * math.pi)
    sweep = sweep if sweep > WHOLE_TURN else 2.0 * math.pi
    return Arc(0, chords_of(sweep, float(np.linalg.norm(axes, 2)), tolerance), centre, axes, start, sweep)


def _on(arc: Arc) -> np.ndarray:
    """(n, d) array: the ends of its chords."""
    return arc.at(np.linspace(0.0, 1.0, arc.chords + 1))


def _with_bulges(
    corners: list[tuple[float, float, float]], closed: bool, tolerance: float | None
) -> tuple[np.ndarray, list[Arc]]:
    """(n, 2) array: points of a polyline, a closed one ends where it starts; and its arcs."""
    from ezdxf.math import bulge_to_arc

    points, arcs = [np.array(corner[:2]) for corner in corners[:1]], list[Arc]()
    following = [*corners[1:], *(corners[:1] if closed else [])]
    for (x, y, bulge), (u, v, _) in zip(corners, following, strict=False):
        if bulge and np.isfinite(bulge) and (x, y) != (u, v):
            centre, start, end, radius = bulge_to_arc((x, y), (u, v), bulge)
            sweep = (end - start) % (2 * math.pi)
            begin, turned = (start, sweep) if bulge > 0 else (end, -sweep)
            arcs.append(_arc(len(points) - 1, centre, radius, begin, turned, tolerance))
            points += [*_on(arcs[-1])[1:-1]]
        points.append(np.array([u, v]))
    return np.array(points).reshape(-1, 2), arcs


def _looks(entity: Any) -> tuple[str, ...]:
    """Kind of an entity and its colour: as #rrggbb and, where it has one, its number."""
    from ezdxf.colors import DXF_DEFAULT_COLORS, int2rgb

    kind, number = look_of(entity.dxftype()), int(entity.dxf.get("color", BY_LAYER))
    exact = entity.dxf.get("true_color")
    if exact is None and number == BY_LAYER and entity.doc is not None and entity.dxf.layer in entity.doc.layers:
        drawn = entity.doc.layers.get(entity.dxf.layer)
        number, exact = abs(int(drawn.dxf.get("color", WHITE))), drawn.dxf.get("true_color")
    if exact is not None:
        return (kind, "#{:02x}{:02x}{:02x}".format(*int2rgb(int(exact))))
    number = number if 0 < number < BY_LAYER else WHITE
    return (kind, "#{:02x}{:02x}{:02x}".format(*int2rgb(DXF_DEFAULT_COLORS[number])), str(number))


def _line_type(entity: Any) -> str:
    """Name of the line type of an entity, or else of its layer; "" of a whole line."""
    name = str(entity.dxf.get("linetype", BY_LAYER_TYPE))
    if name.upper() == BY_LAYER_TYPE and entity.doc is not None and entity.dxf.layer in entity.doc.layers:
        name = str(entity.doc.layers.get(entity.dxf.layer).dxf.linetype)
    return "" if name.upper() in (BY_LAYER_TYPE, BY_BLOCK_TYPE, "CONTINUOUS") else name


def _is_chain(entity: Any, line_type: str) -> bool:
    """Whether the pattern of a line type is of dashes and dots."""
    if not line_type or entity.doc is None or line_type not in entity.doc.linetypes:
        return False
    lengths = [tag.value for tag in entity.doc.linetypes.get(line_type).pattern_tags.tags if tag.code == 49]
    return is_chain([length for length in lengths if length >= 0.0])


def _hatch_rings(entity: Any, tolerance: float | None) -> list[tuple[np.ndarray, float, tuple[Arc, ...]]]:
    """(n, 3) arrays: boundaries of a hatch, how far their chords are off its curves, and their arcs."""
    rings = []
    for boundary in entity.paths:
        if hasattr(boundary, "vertices"):
            loops = [_Loop(*_with_bulges([tuple(corner) for corner in boundary.vertices], True, tolerance))]
        else:
            loops = _loops_of([_edge(edge, tolerance) for edge in boundary.edges])
        level = float(entity.dxf.elevation.z) if entity.dxf.hasattr("elevation") else 0.0
        for loop in loops:
            points, off, arcs = _in_world(entity, loop.points, loop.arcs, level)
            rings.append((points, max(off, loop.off), arcs))
    return rings


@dataclass(frozen=True)
class _Loop:
    """Points (n, 2) of edges of a hatch that follow each other, their arcs, and how far chords are off other curves."""

    points: np.ndarray
    arcs: list[Arc]
    off: float = 0.0

    def backwards(self) -> _Loop:
        """Turn round."""
        return replace(
            self, points=self.points[::-1], arcs=[arc.backwards(len(self.points)) for arc in self.arcs[::-1]]
        )

    def then(self, other: _Loop, near: float) -> _Loop:
        """Put edges behind it, which begin at its end or after a gap."""
        meets = math.dist(self.points[-1], other.points[0]) <= near
        n = len(self.points) - meets
        arcs = [*self.arcs, *(replace(arc, first=arc.first + n) for arc in other.arcs)]
        return _Loop(np.concatenate([self.points, other.points[int(meets) :]]), arcs, max(self.off, other.off))


def _edge(edge: Any, tolerance: float | None) -> _Loop:
    """Read one edge of a hatch boundary, in the plane of the hatch."""
    from ezdxf.math import BSpline, fit_points_to_cad_cv
    from ezdxf.path import Path as Drawn
    from ezdxf.path import add_spline

    kind = edge.EDGE_TYPE
    if kind == "LineEdge":
        return _Loop(np.array([(*edge.start,), (*edge.end,)])[:, :2], [])
    if kind == "SplineEdge":
        if len(edge.control_points):
            points, weights, knots = _clamped(edge.control_points, edge.weights, edge.knot_values, edge.degree)
            curve = BSpline(points, edge.degree + 1, knots, weights or None)
        elif len(edge.fit_points) > 1:
            given = edge.start_tangent and edge.end_tangent
            curve = fit_points_to_cad_cv(edge.fit_points, (edge.start_tangent, edge.end_tangent) if given else None)
        else:
            return _Loop(np.zeros((0, 2)), [])
        drawn = Drawn()
        add_spline(drawn, curve, reset=True)
        flat, off = _points(drawn, tolerance)
        return _Loop(flat[:, :2], [], off)
    if kind == "ArcEdge":
        axes, start, end = edge.radius * np.eye(2), math.radians(edge.start_angle), math.radians(edge.end_angle)
    else:
        x, y = edge.major_axis.x, edge.major_axis.y
        axes, start, end = np.array([[x, -edge.ratio * y], [y, edge.ratio * x]]), edge.start_param, edge.end_param
    if not axes.any():
        return _Loop(np.zeros((0, 2)), [])
    arc = _ellipse(np.array([edge.center.x, edge.center.y]), axes, start, end, tolerance)
    return _Loop(_on(arc), [arc])


def _loops_of(edges: Sequence[_Loop]) -> list[_Loop]:
    """Put edges of a boundary together, which may turn either way; gaps are closed by lines, closed loops are whole."""
    edges = [edge for edge in edges if len(edge.points) > 1]
    if not edges:
        return []
    near = CLOSES * float(np.ptp(np.concatenate([edge.points for edge in edges]), axis=0).max())
    loops = [edges[0]]
    for edge in edges[1:]:
        loop = loops[-1]
        if math.dist(loop.points[0], loop.points[-1]) <= near:
            loops.append(edge)
            continue
        ways = [(one, other) for one in (loop, loop.backwards()) for other in (edge, edge.backwards())]
        gaps = [math.dist(one.points[-1], other.points[0]) for one, other in ways]
        # Edges that do not meet are drawn in their sense.
        one, other = ways[int(np.argmin(gaps))] if min(gaps) <= near else ways[0]
        loops[-1] = one.then(other, near)
    return [_shut(loop, near) for loop in loops]


def _shut(loop: _Loop, near: float) -> _Loop:
    """End a loop exactly where it begins."""
    ends = math.dist(loop.points[0], loop.points[-1]) <= near
    return replace(loop, points=np.concatenate([loop.points[:-1] if ends else loop.points, loop.points[:1]]))


def _add_hatch(entity: Any, handle: str, found: _Outlines, tolerance: float | None) -> None:
    bounds = [bound for bound in _hatch_rings(entity, tolerance) if len(bound[0]) > 2]
    rings = [ring[:-1] if (ring[0] == ring[-1]).all() else ring for ring, *_ in bounds]
    if not rings:
        found.skipped["HATCH without boundary"] += 1
        return
    outlined = [(k, holes) for k, holes in filled(rings) if not _drawn_already(rings[k], found)]
    for number, (k, inside) in enumerate(outlined):
        if not inside:
            found.add(rings[k], entity, handle if len(rings) == 1 else f"{handle}.{number}", *bounds[k][1:])
            continue
        x, y = rings[inside[0]][:, :2].mean(axis=0)
        message = (
            f"HATCH {handle} on layer '{entity.dxf.layer}' has a hole around ({x:.6g}, {y:.6g}); "
            "cut the block in two, or fill the hole with a block"
        )
        layer, name = str(entity.dxf.layer), f"hatch {handle}"
        holes = tuple(rings[j] for j in inside)
        found.left_out.append(LeftOut("hole", rings[k], message, layer, name, holes=holes, looks=_looks(entity)))


def _drawn_already(ring: np.ndarray, found: _Outlines) -> bool:
    """Whether a hatch fills the outline just before it, as drawing programs write them."""
    if not found.rings or len(found.rings[-1]) != len(ring):
        return False
    return bool(np.abs(found.rings[-1].mean(0) - ring.mean(0)).max() <= CLOSES * float(np.ptp(ring, axis=0).max()))


def _with_loose(found: _Outlines, reading: Reading, tolerance: float | None) -> Faces:
    """Let arcs share their corners, add the faces between loose lines, and cut outlines along the lines within them."""
    unwanted, wanted = _chosen_lines(found, reading)
    curves, n = [*found.rings, *(line.points for line in wanted)], len(found.rings)
    curves = with_shared_corners(curves, [*found.arcs, *(line.curves for line in wanted)], tolerance)
    found.rings = curves[:n]
    wanted = [replace(line, points=points) for line, points in zip(wanted, curves[n:], strict=True)]
    ignored = {i for i, layer in enumerate(found.layers) if unwanted.takes([layer], found.looks[i])}
    faces = faces_of_lines(wanted, [ring[:, :2] for ring in found.rings], found.offs, ignored, reading.only)
    found.left_out += faces.left_out
    for i, pieces in sorted(faces.pieces.items(), reverse=True):
        level = float(found.rings[i][0, 2])
        for number, piece in enumerate(pieces):
            found.append(piece, level, found.layers[i], f"{found.names[i]}.{number}", found.looks[i])
        for values in found.of_outlines:
            del values[i]
    for number, (ring, layer, around) in enumerate(zip(faces.rings, faces.layers, faces.around, strict=True)):
        found.append(ring, 0.0, layer, f"face {number}", ("face",), around)
    return faces


def _chosen_lines(found: _Outlines, reading: Reading) -> tuple[Choice, list[Line]]:
    """Leave out loose lines that are not wanted; give what is unwanted, and the others."""
    unwanted, asked = _choices(found, reading)
    wanted = []
    for line, is_wanted in zip(found.loose, _wanted_lines(found, unwanted, asked), strict=True):
        if is_wanted:
            wanted.append(line)
        else:
            name = f"line {line.handle}"
            left = LeftOut("asked line", line.points[:, :2], "", line.layer, name, closed=False, looks=line.looks)
            found.left_out.append(left)
    return unwanted, wanted


def _choices(found: _Outlines, reading: Reading) -> tuple[Choice, Choice]:
    """Tell apart what is unwanted and what is asked for."""
    names = set[str]().union(*_labels(found), *(labels for labels, _ in _of_lines(found)))
    return Choice(reading.ignore, names), Choice(reading.only, names)


def _labels(found: _Outlines) -> list[tuple[str, ...]]:
    """Layer and names of each outline, by which it can be asked for."""
    rows = [[str(row.get(key, "")) for key in ("name", "group", "material")] for row in found.rows]
    return [tuple(filter(None, own)) for own in zip(found.layers, found.names, *zip(*rows, strict=True), strict=True)]


def _wanted_lines(found: _Outlines, unwanted: Choice, asked: Choice) -> list[bool]:
    """Which loose lines are wanted: all, unless layers or looks are asked for."""
    layers = {*found.layers, *(line.layer for line in found.loose)}
    looks = {look for own in (*found.looks, *(line.looks for line in found.loose)) for look in own}
    chosen = any(asked.takes([layer]) for layer in layers) or asked.takes((), looks)
    return [not unwanted.takes(*own) and (not chosen or asked.takes(*own)) for own in _of_lines(found)]


def _of_lines(found: _Outlines) -> list[tuple[list[str], tuple[str, ...]]]:
    """Layer and name of each loose line, by which it can be asked for, and its looks."""
    return [([line.layer, f"line {line.handle}"], line.looks) for line in found.loose]


def _size(found: _Outlines) -> float:
    drawn = [points[:, :2] for points in (*found.rings, *(line.points for line in found.loose))]
    return float(np.ptp(np.concatenate(drawn), axis=0).max()) if drawn else 0.0


def _own_data(entity: Any) -> dict[str, Any]:
    if not entity.has_xdata(APPLICATION):
        return {}
    try:
        row = json.loads("".join(str(tag.value) for tag in entity.get_xdata(APPLICATION) if tag.code == 1000))
    except ValueError:
        return {}
    return row if isinstance(row, dict) else {}


def _layer_name(row: Mapping[str, Any]) -> str:
    """Name the layer on which a block is written, without the characters that no layer may have."""
    layer = layer_of(row)[0] or "0"
    return "".join("_" if c in '<>/\\":;?*|=`' or ord(c) < 32 else c for c in layer)[:255]


def write(layout: Layout, path: Path) -> None:
    """Write .dxf R2000 in m: a closed LWPOLYLINE per block on the layer of its group, role or material."""
    import ezdxf

    document = ezdxf.new("R2000")
    document.header["$INSUNITS"] = 6
    document.appids.add(APPLICATION)
    space = document.modelspace()
    for row, ring in zip(rows_of(layout), layout.outlines, strict=True):
        layer = _layer_name(row)
        if layer not in document.layers:
            document.layers.add(layer)
        outline = space.add_lwpolyline(ring.tolist(), close=True, dxfattribs={"layer": layer})
        text = json.dumps(row)
        outline.set_xdata(APPLICATION, [(1000, text[k : k + 200]) for k in range(0, len(text), 200)])
    document.saveas(path)
