"""Drawings, .dxf R12 to R2018: closed outlines, hatches, inserted blocks, loose lines; the layer is the group."""

from __future__ import annotations

import json
import logging
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
from ezdxf import recover, transform
from ezdxf.colors import BYBLOCK, BYLAYER, DXF_DEFAULT_COLORS, WHITE, int2rgb
from ezdxf.entities import DXFTagStorage
from ezdxf.math import BSpline, bulge_to_arc, fit_points_to_cad_cv
from ezdxf.path import Path as Drawn
from ezdxf.path import add_spline, make_path
from scipy import interpolate

from blockvis.layout.block_table import layer_of, on_layer, rows_of
from blockvis.layout.layout import Layout
from blockvis.layout.left_out import look_of, passed_over
from blockvis.layout.notes import CHANGED, Note, kind_of
from blockvis.layout.outlines import ROUNDING, chords_of, filled
from blockvis.layout.units import metres_per
from solver.mechanics import counted

from .arcs import Arc
from .bodies import Bodies
from .cells import Mesh
from .drawing import Drawing, Line, Outline, Stroke, is_chain, joined_ends
from .dxf_bodies import drawn_mesh, is_mesh, layout_of_meshes, meshes_of_faces, said_by_layer
from .loose_lines import refuse_open, with_faces
from .reading import Reading, json_object

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

#: Line types of an entity that stand for that of its layer or of the inserted block.
BY_LAYER_TYPE, BY_BLOCK_TYPE = "BYLAYER", "BYBLOCK"

_CURVES = {"LWPOLYLINE", "POLYLINE", "CIRCLE", "ELLIPSE", "SPLINE", "ARC", "LINE", "SOLID", "TRACE", "3DFACE"}


@dataclass
class _Found(Drawing):
    """What was found so far; 3DFACEs are outlines, too, unless they enclose bodies."""

    hidden: Counter[str] = field(default_factory=Counter)
    meshes: list[Mesh] = field(default_factory=list)
    faces: list[Outline] = field(default_factory=list)

    def add(self, entity: Any, handle: str, stroke: Stroke) -> None:
        """Add an outline, (n, 3) points."""
        row = self._row(entity, f"block {handle}")
        self.outlines.append(stroke.as_(Outline, row=row, looks=_looks(entity)))

    def _row(self, entity: Any, name: str) -> dict[str, Any]:
        """Row of an outline on its layer, with what our own writer put beside it."""
        layer, tags = str(entity.dxf.layer), entity.get_xdata(APPLICATION) if entity.has_xdata(APPLICATION) else ()
        own = json_object("".join(str(tag.value) for tag in tags if tag.code == 1000))
        moved = bool(own) and _layer_name(own).lower() != layer.lower()
        row = {**said_by_layer(layer), "name": name, **(on_layer(own, layer) if moved else own)}
        self.moved += [(own, row)] if moved else []
        return row


def read(path: Path, reading: Reading) -> Layout | Bodies:
    """Read a .dxf drawing; its unit is that of the header variable $INSUNITS."""
    document, audit = _document(path)
    stated, doubts = _unit(document, reading)
    in_metres = metres_per(reading.unit or stated or "m")
    tolerance = None if reading.chord_tolerance is None else reading.chord_tolerance / in_metres
    frozen = {layer.dxf.name for layer in document.layers if layer.is_frozen()}
    shut = frozen | {layer.dxf.name for layer in document.layers if layer.is_off()}
    found = _Found(notes=doubts)
    for entity, handle in _bounded(document.modelspace(), path, frozen):
        _add_shown(entity, handle, found, tolerance, shut)
    closed = meshes_of_faces([(one.row["group"], one.row["name"], one.points) for one in found.faces])
    if closed:
        found.meshes += closed
        faces = {*found.faces}
        found.outlines = [one for one in found.outlines if one not in faces]
    meshes = _chosen_meshes(found, reading)
    if meshes:
        return layout_of_meshes(meshes, reading, stated, _faults(audit) + _skipped(found))
    notes = found.turn(reading)[1]
    if found.faces:
        remedy = "; 3DFACEs of a layer are read as bodies in space where they close one"
        notes = [Note(CHANGED, f"{note}{remedy}") if kind_of(note) == CHANGED else note for note in notes]
    found.notes += notes + _faults(audit)
    with_faces(
        found,
        reading,
        called=lambda name, k: f"{name}.{k}",
        row_of=lambda layers, name: {**said_by_layer(layers[-1]), "name": name},
        tolerance=tolerance,
    )
    refuse_open(found, "closed outline in its model space", "a closed polyline", stated)
    found.notes += _skipped(found)
    return found.layout(stated, own=True)


def _document(path: Path) -> tuple[Any, Any]:
    """Read a file with ezdxf, which says beside the document what it repaired."""
    # What it would print to the terminal is counted in a note.
    logging.getLogger("ezdxf").setLevel(logging.CRITICAL + 1)
    try:
        content = path.read_bytes()
        if b"SECTION" not in content:
            raise ValueError(f"it begins with {content[:16]!r}")
        if not content.startswith(BINARY):
            return recover.readfile(path)
        # recover reads text only.
        document = ezdxf.readfile(path)
        return document, document.audit()
    except (OSError, ezdxf.DXFError, ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        raise ValueError(f"it is not a readable DXF file ({error}); save it again as DXF R2000 or later") from None


def _unit(document: Any, reading: Reading) -> tuple[str, list[str]]:
    """Find the unit that a file states, "" for none, and a note if that is not one of length."""
    code = int(document.header.get("$INSUNITS", 0) or 0)
    if not code or code in UNIT_CODES or reading.unit is not None:
        return UNIT_CODES.get(code, ""), []
    return "", [
        Note(CHANGED, f"the file states unit {code} ($INSUNITS), which is not known; give unit=... to settle it")
    ]


def _chosen_meshes(found: _Found, reading: Reading) -> list[Mesh]:
    """Take the bodies that are asked for, where no outline is; count the others, or the outlines, as skipped."""
    meshes = [mesh for mesh in found.meshes if reading.wants([mesh.row["group"], mesh.row["name"]])]
    if meshes and not any(reading.wants([one.row["group"], one.row["name"]]) for one in found.outlines):
        flat = len(found.outlines) + len(found.loose)
        found.skipped.update({"outlines and lines beside bodies in space": flat} if flat else {})
        return meshes
    found.skipped.update(Counter(mesh.curved or "body in space" for mesh in found.meshes))
    return []


def _skipped(found: _Found) -> list[str]:
    hidden = {f"on '{layer}'": n for layer, n in found.hidden.items()}
    return [*passed_over(found.skipped), *passed_over(hidden, "skipped on layers that are off or frozen")]


def _faults(audit: Any) -> list[str]:
    faults = len(audit.fixes) + len(audit.errors)
    return [Note(CHANGED, f"repaired or passed over: {counted(faults, 'fault')} of the file")] if faults else []


def _bounded(entities: Any, path: Path, frozen: Set[str]) -> Iterator[tuple[Any, str]]:
    """Yield entities and their handles; of a small file that inserts any number of copies no more than it may have."""
    size = path.stat().st_size
    most = max(size // 4, 1000)
    for number, found in enumerate(_flat(entities, frozen, _Place())):
        if number >= most:
            raise ValueError(
                f"it inserts more than {most} entities, though it has {size} bytes only; explode its block references"
            )
        yield found


@dataclass(frozen=True)
class _Place:
    """Where a block is drawn: its matrix, and what its entities take over of the reference that inserts it."""

    matrix: Any = None
    handle: str = ""
    block: str = ""
    layer: str = "0"
    colour: int = WHITE
    line_type: str = BY_LAYER_TYPE
    depth: int = 0

    def drawn(self, entity: Any) -> list[Any]:
        """Draw an entity of the block here; arcs become those of ellipses, of which one outline may have several.

        What a block draws on layer 0 lies on the layer on which it is inserted.
        """
        if self.matrix is None:
            return [entity]
        # References are followed by their matrices, which can be sheared.
        matrix = None if entity.dxftype() == "INSERT" else self.matrix
        with _resolving(self.block):
            found = list[Any](transform.copies([entity], matrix)[1])
        for one in found:
            if one.dxf.layer == "0":
                one.dxf.layer = self.layer
            if one.dxf.get("color", BYLAYER) == BYBLOCK:
                one.dxf.color = self.colour
            if str(one.dxf.get("linetype", BY_LAYER_TYPE)).upper() == BY_BLOCK_TYPE:
                one.dxf.linetype = self.line_type
        return found


@contextmanager
def _resolving(block: str) -> Iterator[None]:
    """Refuse a damaged block, for which ezdxf raises errors of any kind."""
    try:
        yield
    except (TypeError, AttributeError, ValueError, KeyError, IndexError, ArithmeticError) as error:
        raise ValueError(f"block reference '{block}' cannot be resolved ({error}); explode it") from None


def _flat(entities: Any, frozen: Set[str], where: _Place) -> Iterator[tuple[Any, str]]:
    """Yield all entities, inserted blocks resolved, each with a handle that names it; none on a frozen layer."""
    if where.depth > DEEPEST_INSERT:
        raise ValueError(f"it inserts blocks into each other more than {DEEPEST_INSERT} deep; explode them")
    for number, entity in enumerate(entities):
        handle = f"{where.handle}.{number}" if where.handle else str(entity.dxf.handle or number)
        drawn = where.drawn(entity)
        for k, one in enumerate(drawn):
            if one.dxftype() != "INSERT" or one.dxf.layer in frozen or _is_closed(one):
                yield one, f"{handle}.{k}" if len(drawn) > 1 else handle
                continue
            content = [own for own in one.block() if own.dxftype() != "ATTDEF"]
            for place in _places(one, handle, where):
                yield from _flat(content, frozen, place)


def _places(insert: Any, handle: str, where: _Place) -> Iterator[_Place]:
    """Yield the places where a reference inserts its block: one, or those in rows and columns."""
    # QCAD writes a zscale of 0 for plane drawings, with which no transformation can be made.
    insert.dxf.zscale = insert.dxf.get("zscale", 1.0) or 1.0
    block, layer, colour = str(insert.dxf.get("name", "?")), insert.dxf.layer, int(insert.dxf.get("color", BYLAYER))
    for k, copy in enumerate(insert.multi_insert() if insert.mcount > 1 else [insert]):
        with _resolving(block):
            matrix = copy.matrix44() if where.matrix is None else copy.matrix44() * where.matrix
        called = f"{handle}.{k}" if insert.mcount > 1 else handle
        yield _Place(matrix, called, block, layer, colour, _line_type(insert) or "Continuous", where.depth + 1)


def _is_closed(insert: Any) -> bool:
    """Whether nothing of an inserted block is drawn here: it is invisible, in another file, or not there."""
    block = insert.block()
    return bool(insert.dxf.get("invisible", 0)) or block is None or bool(block.block.is_xref)


def _flattened(curve: Any, tolerance: float | None) -> Stroke:
    """Replace the curves of a path by chords; (n, 3) points, both ends included."""
    box = np.array([(p.x, p.y, p.z) for p in curve.control_vertices()])
    size = float(np.ptp(box, axis=0).max()) if len(box) and np.isfinite(box).all() else 0.0
    if not curve.has_curves or size == 0.0:
        return Stroke(points=box)
    distance = max(1e-3 * size if tolerance is None else tolerance, 1e-6 * size)
    points = np.array([(p.x, p.y, p.z) for p in curve.flattening(distance, segments=2)])
    return Stroke(points=points, off_others=distance)


def _add_shown(entity: Any, handle: str, found: _Found, tolerance: float | None, shut: Set[str]) -> None:
    if isinstance(entity, DXFTagStorage):
        # Of a kind that ezdxf does not know, such as AEC_WALL: it has no layer to ask for.
        found.skipped[entity.dxftype()] += 1
    elif entity.dxf.layer in shut:
        found.hidden[entity.dxf.layer] += 1
    elif entity.dxf.get("invisible", 0):
        found.skipped[f"invisible {entity.dxftype()}"] += 1
    else:
        _add(entity, handle, found, tolerance)


def _add(entity: Any, handle: str, found: _Found, tolerance: float | None) -> None:
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


def _add_curve(entity: Any, handle: str, found: _Found, tolerance: float | None) -> None:
    kind = entity.dxftype()
    if kind in ("SOLID", "TRACE", "3DFACE"):
        found.add(entity, handle, Stroke(points=np.array([(p.x, p.y, p.z) for p in entity.wcs_vertices()])))
        found.faces += found.outlines[-1:] if kind == "3DFACE" else []
        return
    if kind == "SPLINE":
        clamped = _clamped(entity.control_points, entity.weights, entity.knots, entity.dxf.degree)
        entity.control_points, entity.weights, entity.knots = clamped
    stroke = _circular(entity, tolerance) or _flattened(make_path(entity), tolerance)
    points = stroke.points
    if len(points) < 2:
        found.skipped[f"{kind} without length"] += 1
        return
    if not np.isfinite(points).all():
        bad = points[~np.isfinite(points).all(axis=1)][0].tolist()
        raise ValueError(
            f"{kind} {handle} on layer '{entity.dxf.layer}' has a point at {bad}; coordinates must be finite numbers"
        )
    closes = bool(getattr(entity, "is_closed", False) or getattr(entity, "closed", False))
    single = kind in ("LINE", "ARC")
    joined = None if single else joined_ends(points, closes and len(points) > 3)
    if joined is not None:
        found.add(entity, handle, replace(stroke, points=joined[0]))
        found.misses.append(joined[1])
        return
    named = {"layer": str(entity.dxf.layer), "name": f"line {handle}", "handle": handle, "must_close": not single}
    dashes = {"line_type": (drawn := _line_type(entity)), "chain": _is_chain(entity, drawn)}
    found.loose.append(stroke.as_(Line, looks=_looks(entity), **named, **dashes))


def _clamped(points: Any, weights: Any, knots: Any, degree: int) -> tuple[Any, Any, Any]:
    """Give points, weights and knots of a spline that begins and ends at the ends of its knots.

    ezdxf splits others, as periodic ones, wrongly.
    """
    n, every = len(points), np.array(knots, dtype=float)
    if n <= degree or len(every) != n + degree + 1 or (np.diff(every) < 0).any():
        return points, weights, knots
    first, last = every[degree], every[n]
    inner = every[(every > first) & (every < last)]
    most = np.unique(inner, return_counts=True)[1].max(initial=0)
    if (every[0] == first and every[-1] == last) or first == last or most > degree:
        return points, weights, knots
    factors = np.array(weights if len(weights) == n else np.ones(n))[:, None]
    curve = interpolate.BSpline(every, np.column_stack([np.array([(*p,) for p in points]) * factors, factors]), degree)
    ends = np.concatenate([np.full(degree + 1, first), inner, np.full(degree + 1, last)])
    # As many values as there are control points between these knots determine them.
    at = np.array([ends[i + 1 : i + 1 + degree].mean() for i in range(len(ends) - degree - 1)])
    found = interpolate.make_interp_spline(at, curve(at), degree, ends).c
    return (found[:, :-1] / found[:, -1:]).tolist(), found[:, -1].tolist() if len(weights) else [], ends.tolist()


def _circular(entity: Any, tolerance: float | None) -> Stroke | None:
    """(n, 3) points of lines and circular arcs, and these; None for other entities.

    The chords are measured on the arcs themselves: ezdxf's paths replace an arc by a cubic first, which deviates from
    it by up to 2.7e-4 of the radius.
    """
    kind = entity.dxftype()
    if kind == "SPLINE" and entity.dxf.degree == 1 and len(entity.control_points):
        # Straight from corner to corner: ezdxf would put a smooth curve through them.
        straight = np.array([(*point,) for point in entity.control_points])
        return Stroke(points=np.concatenate([straight, straight[:1]]) if entity.closed else straight)
    if kind == "ELLIPSE":
        # It lies in the world, not in a plane of its own.
        axes = np.array([(*axis,) for axis in (entity.dxf.major_axis, entity.minor_axis)]).T
        return _ellipse((*entity.dxf.center,), axes, entity.dxf.start_param, entity.dxf.end_param, tolerance)
    if kind in ("CIRCLE", "ARC"):
        begin, end = (0.0, 360.0) if kind == "CIRCLE" else (entity.dxf.start_angle, entity.dxf.end_angle)
        start, sweep = math.radians(begin), math.radians((end - begin) % 360.0 or 360.0)
        flat = _along(_arc(0, entity.dxf.center, abs(float(entity.dxf.radius)), start, sweep, tolerance))
        level = float(entity.dxf.center.z)
    elif kind == "LWPOLYLINE":
        flat = _with_bulges([(x, y, b) for x, y, b in entity.get_points("xyb")], bool(entity.closed), tolerance)
        level = float(entity.dxf.elevation)
    elif kind == "POLYLINE" and entity.is_2d_polyline and not entity.dxf.flags & 6:
        corners = [(v.dxf.location.x, v.dxf.location.y, float(v.dxf.bulge)) for v in entity.vertices]
        flat, level = _with_bulges(corners, bool(entity.is_closed), tolerance), _level(entity)
    else:
        return None
    return _in_world(entity, flat, level)


def _level(entity: Any) -> float:
    return float(entity.dxf.elevation.z) if entity.dxf.hasattr("elevation") else 0.0


def _in_world(entity: Any, flat: Stroke, level: float) -> Stroke:
    """Put what lies in an entity's own plane into space."""
    system = entity.ocs()
    own = np.array([(*system.to_wcs(axis),) for axis in np.eye(3).tolist()]).T
    points = np.array([(*system.to_wcs((x, y, level)),) for x, y in flat.points]).reshape(-1, 3)
    return replace(flat.mapped(own[:, :2], level * own[:, 2]), points=points)


def _arc(first: int, centre: Any, radius: float, start: float, sweep: float, tolerance: float | None) -> Arc:
    n = chords_of(sweep, radius, tolerance)
    return Arc(first, n, np.array([centre.x, centre.y]), radius * np.eye(2), start, sweep)


def _ellipse(centre: Sequence[float], axes: np.ndarray, start: float, end: float, tolerance: float | None) -> Stroke:
    """Draw an arc of an ellipse with half axes (d, 2) between two parameters [rad], counter-clockwise."""
    sweep = (end - start) % (2.0 * math.pi)
    sweep = sweep if sweep > ROUNDING else 2.0 * math.pi
    n = chords_of(sweep, float(np.linalg.norm(axes, 2)), tolerance)
    return _along(Arc(0, n, np.array(centre), axes, start, sweep))


def _along(arc: Arc) -> Stroke:
    return Stroke(points=arc.at(np.linspace(0.0, 1.0, arc.chords + 1)), curves=(arc,))


def _with_bulges(corners: list[tuple[float, float, float]], closed: bool, tolerance: float | None) -> Stroke:
    """Draw a polyline, (n, 2) points; a closed one ends where it starts."""
    points, arcs = [np.array(corner[:2]) for corner in corners[:1]], list[Arc]()
    following = [*corners[1:], *(corners[:1] if closed else [])]
    for (x, y, bulge), (u, v, _) in zip(corners, following, strict=False):
        if bulge and np.isfinite(bulge) and (x, y) != (u, v):
            centre, start, end, radius = bulge_to_arc((x, y), (u, v), bulge)
            sweep = (end - start) % (2 * math.pi)
            begin, turned = (start, sweep) if bulge > 0 else (end, -sweep)
            arcs.append(_arc(len(points) - 1, centre, radius, begin, turned, tolerance))
            points += [*_along(arcs[-1]).points[1:-1]]
        points.append(np.array([u, v]))
    return Stroke(points=np.array(points).reshape(-1, 2), curves=tuple(arcs))


def _looks(entity: Any) -> tuple[str, ...]:
    """Kind of an entity and its colour: as #rrggbb and, where it has one, its number."""
    kind, number = look_of(entity.dxftype()), int(entity.dxf.get("color", BYLAYER))
    exact = entity.dxf.get("true_color")
    if exact is None and number == BYLAYER and entity.doc is not None and entity.dxf.layer in entity.doc.layers:
        drawn = entity.doc.layers.get(entity.dxf.layer)
        number, exact = abs(int(drawn.dxf.get("color", WHITE))), drawn.dxf.get("true_color")
    if exact is not None:
        return (kind, "#{:02x}{:02x}{:02x}".format(*int2rgb(int(exact))))
    number = number if 0 < number < BYLAYER else WHITE
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


def _hatch_rings(entity: Any, tolerance: float | None) -> list[Stroke]:
    """Boundaries of a hatch, (n, 3) points."""
    loops = list[Stroke]()
    for boundary in entity.paths:
        if hasattr(boundary, "vertices"):
            loops.append(_with_bulges([tuple(corner) for corner in boundary.vertices], True, tolerance))
        else:
            loops += _loops_of([_edge(edge, tolerance) for edge in boundary.edges])
    return [_in_world(entity, loop, _level(entity)) for loop in loops]


def _backwards(edge: Stroke) -> Stroke:
    arcs = (arc.backwards(len(edge.points)) for arc in edge.curves[::-1] if isinstance(arc, Arc))
    return replace(edge, points=edge.points[::-1], curves=tuple(arcs))


def _then(one: Stroke, other: Stroke, near: float) -> Stroke:
    """Put edges of a hatch behind others; they begin at their end or after a gap."""
    meets = math.dist(one.points[-1], other.points[0]) <= near
    n = len(one.points) - meets
    curves = (*one.curves, *(replace(arc, first=arc.first + n) for arc in other.curves))
    points = np.concatenate([one.points, other.points[int(meets) :]])
    return Stroke(points=points, curves=curves, off_others=max(one.off_others, other.off_others))


def _edge(edge: Any, tolerance: float | None) -> Stroke:
    """Read one edge of a hatch boundary, in the plane of the hatch."""
    kind = edge.EDGE_TYPE
    if kind == "LineEdge":
        return Stroke(points=np.array([(*edge.start,), (*edge.end,)])[:, :2])
    if kind == "SplineEdge":
        if len(edge.control_points):
            points, weights, knots = _clamped(edge.control_points, edge.weights, edge.knot_values, edge.degree)
            curve = BSpline(points, edge.degree + 1, knots, weights or None)
        elif len(edge.fit_points) > 1:
            given = edge.start_tangent and edge.end_tangent
            curve = fit_points_to_cad_cv(edge.fit_points, (edge.start_tangent, edge.end_tangent) if given else None)
        else:
            return Stroke(points=np.zeros((0, 2)))
        drawn = Drawn()
        add_spline(drawn, curve, reset=True)
        found = _flattened(drawn, tolerance)
        return replace(found, points=found.points[:, :2])
    if kind == "ArcEdge":
        axes, start, end = edge.radius * np.eye(2), math.radians(edge.start_angle), math.radians(edge.end_angle)
    else:
        x, y = edge.major_axis.x, edge.major_axis.y
        axes, start, end = np.array([[x, -edge.ratio * y], [y, edge.ratio * x]]), edge.start_param, edge.end_param
    if not axes.any():
        return Stroke(points=np.zeros((0, 2)))
    return _ellipse((edge.center.x, edge.center.y), axes, start, end, tolerance)


def _loops_of(edges: Sequence[Stroke]) -> list[Stroke]:
    """Put edges of a boundary together, which may turn either way; gaps are closed by lines, closed loops are whole."""
    edges = [edge for edge in edges if len(edge.points) > 1]
    if not edges:
        return []
    near = ROUNDING * float(np.ptp(np.concatenate([edge.points for edge in edges]), axis=0).max())
    loops = [edges[0]]
    for edge in edges[1:]:
        loop = loops[-1]
        if math.dist(loop.points[0], loop.points[-1]) <= near:
            loops.append(edge)
            continue
        ways = [(one, other) for one in (loop, _backwards(loop)) for other in (edge, _backwards(edge))]
        gaps = [math.dist(one.points[-1], other.points[0]) for one, other in ways]
        # Edges that do not meet are drawn in their sense.
        one, other = ways[int(np.argmin(gaps))] if min(gaps) <= near else ways[0]
        loops[-1] = _then(one, other, near)
    return [_shut(loop, near) for loop in loops]


def _shut(loop: Stroke, near: float) -> Stroke:
    """End a loop exactly where it begins."""
    ends = math.dist(loop.points[0], loop.points[-1]) <= near
    return replace(loop, points=np.concatenate([loop.points[:-1] if ends else loop.points, loop.points[:1]]))


def _add_hatch(entity: Any, handle: str, found: _Found, tolerance: float | None) -> None:
    bounds = [bound for bound in _hatch_rings(entity, tolerance) if len(bound.points) > 2]
    rings = [ring[:-1] if (ring[0] == ring[-1]).all() else ring for ring in (bound.points for bound in bounds)]
    if not rings:
        found.skipped["HATCH without boundary"] += 1
        return
    outlined = [(k, holes) for k, holes in filled(rings) if not _drawn_already(rings[k], found)]
    layer = str(entity.dxf.layer)
    for number, (k, inside) in enumerate(outlined):
        stroke = replace(bounds[k], points=rings[k])
        if not inside:
            found.add(entity, handle if len(rings) == 1 else f"{handle}.{number}", stroke)
            continue
        row, holes = {"name": f"hatch {handle}", "group": layer}, tuple(rings[j] for j in inside)
        holed = stroke.as_(Outline, row=row, looks=_looks(entity), holes=holes)
        found.holed.append((holed, f"HATCH {handle} on layer '{layer}'"))


def _drawn_already(ring: np.ndarray, found: _Found) -> bool:
    """Whether a hatch fills the outline just before it, as drawing programs write them."""
    if not found.outlines or len(found.outlines[-1].points) != len(ring):
        return False
    last = found.outlines[-1].points.mean(0)
    return bool(np.abs(last - ring.mean(0)).max() <= ROUNDING * float(np.ptp(ring, axis=0).max()))


def _layer_name(row: Mapping[str, Any]) -> str:
    """Name the layer on which a block is written, without the characters that no layer may have."""
    layer = layer_of(row)[0] or "0"
    return "".join("_" if c in '<>/\\":;?*|=`' or ord(c) < 32 else c for c in layer)[:255]


def write(layout: Layout, path: Path) -> None:
    """Write .dxf R2000 in m: a closed LWPOLYLINE per block on the layer of its group, role or material."""
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
