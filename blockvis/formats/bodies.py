"""From closed bodies to a layout: prisms side by side become outlines with a thickness, others blocks in space."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import shapely

from blockvis.layout.block_table import with_rows
from blockvis.layout.faces import with_plane_faces
from blockvis.layout.layout import Layout
from blockvis.layout.left_out import LeftOut, matches
from blockvis.layout.notes import CHANGED, Note
from blockvis.layout.outlines import outlines_of_cells, rectangle, spread_of
from blockvis.layout.refusal import Refused
from blockvis.layout.selection import MORTAR
from blockvis.layout.solids import fans, volume
from blockvis.layout.views import VIEWS, axis_across, view_along
from blockvis.text import LARGEST, listed, place_text
from solver import mechanics
from solver.mechanics import counted

from .reading import Reading

#: In a prism the sine of the angle between a face's normal and the axis, or the plane across it, is at most this.
SQUARE = 1e-3

#: Points this close to each other along an axis, as a fraction of the size of the drawing, lie in one plane across it.
LEVEL = 1e-5

#: A body lies behind another if it covers more than this fraction of the smaller outline of the two: less is how
#: inexactly neighbours are drawn.
COVERS = 0.01

#: Roles by the word with which the name or group of a body may begin.
ROLE_WORDS = {
    "fixed": mechanics.FIXED,
    "support": mechanics.FIXED,
    "supports": mechanics.FIXED,
    "moving": mechanics.MOVING,
}

#: More faces are no stone, but a scan or a curved surface in small triangles.
MOST_FACES = 400

#: Bodies compared with all others at a time.
AT_A_TIME = 20

#: Change of a block's volume, as a part of it, that is told, far above what planes fitted to drawn faces change; so are
#: middle planes further apart than this fraction of the size of the drawing.
NOTED = 1e-3

#: A body of less than this fraction of the cube around the drawing has no volume.
NO_VOLUME = 1e-15


@dataclass(frozen=True)
class Body:
    """A closed surface of triangles: (n, 3) points, and (m, 3) numbers of those around each face.

    What the file says of it, ``said``, are values of the block table. ``n_hole_edges`` are those of holes that were
    closed, ``piece_of`` names the object of which it is one of several bodies, and ``volume`` is that with its curved
    faces, where the file knows it; else 0.
    """

    name: str
    points: np.ndarray
    faces: np.ndarray
    said: dict[str, Any] = field(default_factory=dict)
    n_hole_edges: int = 0
    piece_of: str = ""
    volume: float = 0.0

    @property
    def row(self) -> dict[str, Any]:
        """Its row of the block table."""
        return {"name": self.name, **self.said}

    @property
    def labels(self) -> list[str]:
        """Names by which it can be asked for: its own, its group and its material."""
        return [str(self.row.get(key, "")) for key in ("name", "group", "material")]

    def piece(self, number: int) -> Body:
        """One of several bodies of it, by its number from 1; points and faces are still those of all."""
        said = {key: value for key, value in self.said.items() if key != "name"}
        return replace(self, name=f"{self.name} {number}", said=said)


def body_of_polygons(name: str, points: np.ndarray, faces: Sequence[Sequence[int]], said: dict[str, Any]) -> Body:
    """Make a body of the plane polygons around it: the points around each."""
    used, triangles = np.unique(fans(faces), return_inverse=True)
    return Body(name, points[used], triangles.reshape(-1, 3), said)


@dataclass(frozen=True)
class Bodies:
    """Blocks of a file that draws them in space.

    ``unit`` is that of length which the file states, "" for none; ``up`` the coordinate that points up, z or y, ""
    where it differs between files, and ``up_says`` why, for a note; ``grouped`` says whether they may be parts of
    stones.
    """

    bodies: Sequence[Body]
    unit: str = ""
    notes: Sequence[str] = ()
    up: str = "z"
    up_says: str = ""
    grouped: bool = False


@dataclass(frozen=True)
class _Projection:
    """The bodies as seen along one axis: their outlines and the planes between which they lie, or why it cannot be."""

    axis: int
    outlines: tuple[np.ndarray, ...] = ()
    low: np.ndarray = field(default_factory=lambda: np.zeros(0))
    high: np.ndarray = field(default_factory=lambda: np.zeros(0))
    refused: str = ""

    @property
    def scatter(self) -> float:
        """How far the bodies are from lying between the same two planes."""
        return float(np.ptp(self.low) + np.ptp(self.high - self.low))


def as_drawn(found: Layout | Bodies) -> Layout:
    """Make a layout of bodies of whatever shape, triangle by triangle, for a picture of what is refused."""
    if isinstance(found, Layout):
        return found
    blocks = []
    for body in _drawable(found):
        own, number = np.unique(body.faces, return_inverse=True)
        points = body.points[own]
        turned = with_z_up(points) if found.up == "y" else points
        blocks.append((turned, number.reshape(-1, 3).tolist()))
    return Layout(blocks=tuple(blocks), names=tuple(body.name for body in _drawable(found)), unit=found.unit)


def _drawable(found: Bodies) -> list[Body]:
    # Half of an .obj file has points of one coordinate.
    whole = [body for body in found.bodies if len(body.faces) and body.points.shape[1] == 3]
    return [body for body in whole if np.isfinite(body.points[body.faces]).all()]


def _refused(message: str, found: Bodies, wrong: Body) -> Refused:
    return Refused(message, as_drawn(found), [k for k, body in enumerate(_drawable(found)) if body is wrong])


def layout_of_bodies(found: Bodies, reading: Reading) -> Layout:
    """Make a layout of prismatic bodies: outlines across the axis of their extrusion, thicknesses along it.

    Without a view one is taken in which no body lies behind another, of several that in which the bodies come closest
    to lying between the same two planes.
    """
    asked, view = _selected(found, reading), reading.view
    bodies, size = asked.bodies, asked.size
    axes = (2, 1, 0) if view is None else (axis_across(view),)
    seen = [_projected(axis, bodies, size) for axis in axes]
    fitting = [one for one in seen if not one.refused]
    if not fitting:
        raise _not_flat(seen, asked, view)
    best = fitting[0]
    for one in fitting[1:]:
        if one.scatter < best.scatter - 1e-4 * size:
            best = one
    name, along = view_along(best.axis), "xyz"[best.axis]
    notes: list[str] = [
        f"{counted(len(bodies), 'body was read as an outline', 'bodies were read as outlines')} in {name}; "
        f"{'their' if len(bodies) > 1 else 'its'} depth along {along} is the thickness "
        "(dimension = 3 takes them into space)"
    ]
    middle = (best.low + best.high) / 2.0
    if np.ptp(middle) > NOTED * size:
        first, last = bodies[int(middle.argmin())].name, bodies[int(middle.argmax())].name
        differ = (
            f"the middle planes of the bodies along {along} differ by up to {np.ptp(middle):.3g} in the file's unit "
            f"('{first}' and '{last}'): an analysis in the plane knows nothing of that eccentricity, one in "
            "space does: dimension = 3"
        )
        notes.append(Note(CHANGED, differ))
    layout = Layout(
        blocks=best.outlines,
        names=tuple(body.name for body in bodies),
        unit=found.unit,
        notes=(*notes, *_accepted(bodies), *found.notes),
    )
    layout = replace(with_rows(layout, asked.rows), thickness=best.high - best.low)
    return replace(layout, left_out=asked.left_out(found, name, reading.ignore))


def with_z_up(points: np.ndarray) -> np.ndarray:
    """(n, 3) array: points of a drawing in which y is up, turned about x."""
    return points[:, [0, 2, 1]] * [1.0, -1.0, 1.0]


def _in_space_too(reading: Reading) -> str:
    """Add to a remedy what a view needs: alone it asks for the plane."""
    return "" if reading.dimension == 3 else " and dimension = 3"


def solids_of_bodies(found: Bodies, reading: Reading) -> Layout:
    """Make a layout in space of bodies of any shape.

    The last coordinate of a view is up: y of "xy", else z; without a view what the format has as up.
    """
    if not found.up and reading.view is None:
        raise ValueError(
            'y is up in some of its files and z in others; export them alike, or give view = "xy"'
            f'{_in_space_too(reading)} if y is up in all of them, "xz" if z is'
        )
    asked, view = _selected(found, reading), reading.view
    lying = found.up == "y" if view is None else view == "xy"
    solids, warped, changed = [], [], []
    for body in asked.bodies:
        plane = with_plane_faces(body.points, body.faces)
        points, faces = plane.solid
        if len(faces) > MOST_FACES:
            raise _refused(
                f"body '{body.name}' has {len(faces)} faces, more than {MOST_FACES}; simplify it to the "
                "plane faces of a stone",
                found,
                body,
            )
        if not volume(points, faces) > NO_VOLUME * asked.size**3:
            at = place_text(points.mean(axis=0), 6)
            raise _refused(f"body '{body.name}' around {at} has no volume; remove or redraw it", found, body)
        if plane.warp:
            warped.append((plane.warp, body.name, plane.place))
        drawn = body.volume or abs(volume(body.points, body.faces))
        changed.append((volume(points, faces) / drawn - 1.0, body.name))
        solids.append((with_z_up(points) if lying else points, faces))
    said = _plane_faces_said(warped, changed)
    if found.up_says and view is None:
        taken = "its (x, y, z) were read as (x, -z, y)" if lying else "z was taken as up"
        said.append(
            f'{found.up_says}: {taken}; give view = "{"xz" if lying else "xy"}"{_in_space_too(reading)} if '
            f"{'z' if lying else 'y'} is up"
        )
    layout = Layout(
        blocks=tuple(solids),
        names=tuple(body.name for body in asked.bodies),
        unit=found.unit,
        notes=(*(Note(CHANGED, text) for text in said), *_accepted(asked.bodies), *found.notes),
    )
    return replace(with_rows(layout, asked.rows), left_out=asked.left_out(found, "xz", reading.ignore))


def _plane_faces_said(
    warped: Sequence[tuple[float, str, np.ndarray]], changed: Sequence[tuple[float, str]]
) -> list[str]:
    """Say how far warped faces were moved, and how volumes changed: of every body, as a part of it."""
    said = []
    if warped:
        most, name, place = max(warped, key=lambda one: one[0])
        said.append(
            f"planes were fitted to warped faces of {len(warped)} of {counted(len(changed), 'block')}: up to "
            f"{most:.3g} in the file's unit, of '{name}' at ({', '.join(f'{x:.6g}' for x in place)})"
        )
    coarser = [one for one in changed if abs(one[0]) > NOTED]
    if coarser:
        most, name = max(coarser, key=lambda one: abs(one[0]))
        said.append(
            f"faces were joined to fewer plane ones, or are curved: the volume of {len(coarser)} of {len(changed)} "
            f"blocks is off by up to {100.0 * most:+.2g} %, of '{name}'; draw round stones with fewer sides"
        )
    return said


def in_dimension(found: Bodies, reading: Reading) -> Layout:
    """Make a layout in the plane, 2, or in space, 3; by default in space where bodies are not prisms side by side."""
    if reading.dimension == 3:
        return solids_of_bodies(found, reading)
    try:
        return layout_of_bodies(found, reading)
    except NotFlat as error:
        if reading.dimension == 2 or reading.view is not None:
            raise
        layout = solids_of_bodies(found, reading)
        return replace(layout, notes=(Note(CHANGED, f"blocks in space: {error.reason}"), *layout.notes))


@dataclass(frozen=True)
class _Selection:
    """The bodies that are asked for, the size of the drawing, and the others: number and kind."""

    bodies: list[Body]
    size: float
    dropped: dict[int, str]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Rows of the block table of those that are asked for."""
        return [with_role(body.row) for body in self.bodies]

    def left_out(self, found: Bodies, view: str, ignore: Sequence[str]) -> tuple[LeftOut, ...]:
        """Say what is left out, by its box in a view."""
        items = []
        for k, kind in self.dropped.items():
            points = found.bodies[k].points[:, VIEWS[view]]
            name, group, material = found.bodies[k].labels
            layer = next((word for word in (group, material) if matches([word], ignore)), group)
            box = rectangle(*points.min(axis=0), *points.max(axis=0))
            items.append(LeftOut(kind, box, "", layer, name))
        return tuple(items)


def _accepted(bodies: Sequence[Body]) -> tuple[Note, ...]:
    """Say which bodies had holes that were closed, and which objects became several blocks."""
    said = []
    holed = [f"'{body.name}' ({counted(body.n_hole_edges, 'edge')})" for body in bodies if body.n_hole_edges]
    if holed:
        said.append(f"small holes in the surface of {listed(holed)} were closed")
    pieces = Counter(body.piece_of for body in bodies if body.piece_of)
    # A file of a single object holds all blocks by intention.
    if len(pieces) > 1 or 0 < pieces.total() < len(bodies):
        shown = listed([f"'{name}' ({counted(n, 'block')})" for name, n in pieces.items()])
        said.append(
            f"objects of several closed bodies that do not share a face became as many blocks: {shown}; join "
            "them in the drawing if each is one stone"
        )
    return tuple(Note(CHANGED, text) for text in said)


def _selected(found: Bodies, reading: Reading) -> _Selection:
    """Choose the bodies that are asked for, and check their coordinates."""
    if not found.bodies:
        raise ValueError("it has no bodies; export the blocks as closed bodies")
    labels = [body.labels for body in found.bodies]
    dropped = {k: "asked" for k, words in enumerate(labels) if not reading.wants(words)}
    dropped |= {k: "mortar" for k in _mortar(found, labels, reading.only) if k not in dropped}
    kept = [k for k in range(len(labels)) if k not in dropped]
    if not kept:
        raise ValueError("it draws no block: all that it draws is left out as asked (ignore, only)")
    bodies = [found.bodies[k] for k in kept]
    bare = next((body.name for body in bodies if not len(body.faces)), None)
    if bare is not None:
        raise ValueError(f"body '{bare}' has no surface, as of cells that are there twice; export it once")
    every = np.concatenate([body.points[np.unique(body.faces)] for body in bodies])
    size = float(spread_of(every).max())
    if not 0.0 < size < LARGEST:
        raise ValueError(f"it spreads over {size:.3g} units of length; repair the file")
    return _Selection(bodies, size, dropped)


def _mortar(found: Bodies, labels: Sequence[Sequence[str]], only: Sequence[str]) -> list[int]:
    """Find bodies that by name and place are the mortar around stones, not mortar drawn as blocks of its own."""
    named = [bool(MORTAR.search(" ".join(words))) for words in labels]
    if not any(named) or all(named):
        return []
    low, high = (np.array([pick(body.points[np.unique(body.faces)], axis=0) for body in found.bodies])
                 for pick in (np.min, np.max))  # fmt: skip
    stones = ~np.array(named)
    around = []
    for k in np.flatnonzero(named).tolist():
        # A bed may end with its stones.
        near = LEVEL * float((high[k] - low[k]).max())
        held = ((low >= low[k] - near) & (high <= high[k] + near)).all(axis=1) & stones
        if held.sum() >= 2 and not (only and matches(labels[k], only)):
            around.append(k)
    return around


def drawn_row(name: str, around: Sequence[str] = (), materials: Iterable[str] = ()) -> dict[str, Any]:
    """Write what a file says of a body beside its name: ``group``, ``material`` and ``role`` where there is one.

    Around it are layers, groups or nodes, the innermost last, of which the innermost word says the role; of several
    materials of its faces it has none.
    """
    one = {*materials}
    row = {"group": around[-1] if around else "", "material": one.pop() if len(one) == 1 else ""}
    said = (with_role({"name": word}).get("role", "") for word in (name, *reversed(around), row["material"]))
    row["role"] = next(filter(None, said), "")
    return {key: word for key, word in row.items() if word}


def with_role(row: dict[str, Any]) -> dict[str, Any]:
    """Take the role of a body from the beginning of its group or name: modellers number objects, "fixed.001"."""
    if row.get("role"):
        return row
    for label in (str(row.get("group", "")), str(row.get("name", ""))):
        word = re.match(r"[a-z]*", label.strip().lower())
        begin = ROLE_WORDS.get(word[0] if word else "")
        if begin:
            return {**row, "role": begin}
    return row


def _projected(axis: int, bodies: Sequence[Body], size: float) -> _Projection:
    """See bodies along an axis, or find the reason why they cannot be outlines in that view."""
    along = "xyz"[axis]
    wrong = next((body for body in bodies if not _is_prism(body, axis, size)), None)
    if wrong is not None:
        return _Projection(axis, refused=f"body '{wrong.name}' is no extrusion along {along}")
    levels = [body.points[np.unique(body.faces), axis] for body in bodies]
    low, high = (np.array([float(pick(level)) for level in levels]) for pick in (np.min, np.max))
    outlines = []
    for body, top in zip(bodies, high, strict=True):
        cap = (np.abs(body.points[body.faces][:, :, axis] - top) <= LEVEL * size).all(axis=1)
        owner = np.zeros(int(cap.sum()), dtype=np.int64)
        flat = body.points[:, VIEWS[view_along(axis)]]
        try:
            outlines += outlines_of_cells(flat, list(body.faces[cap]), owner, [body.name])
        except ValueError as error:
            return _Projection(axis, refused=f"seen along {along}, {error}")
    return _Projection(axis, tuple(outlines), low, high, _hidden(axis, bodies, outlines, low, high, size))


def _hidden(
    axis: int, bodies: Sequence[Body], outlines: Sequence[np.ndarray], low: np.ndarray, high: np.ndarray, size: float
) -> str:
    """Say which body lies behind which, or that no plane cuts them all; "" if they are side by side in one leaf."""
    along = "xyz"[axis]
    shapes = shapely.make_valid(shapely.polygons([shapely.linearrings(ring) for ring in outlines]))
    area = shapely.area(shapes)
    tree = shapely.STRtree(shapes)
    # A few at a time: in a wrong view every body may cover every other, and the first such pair is enough.
    for start in range(0, len(shapes), AT_A_TIME):
        one, other = tree.query(shapes[start : start + AT_A_TIME], predicate="intersects")
        one = one + start
        apart = (one < other) & (np.maximum(low[one], low[other]) >= np.minimum(high[one], high[other]) - LEVEL * size)
        one, other = one[apart], other[apart]
        common = shapely.area(shapely.intersection(shapes[one], shapes[other]))
        behind = np.flatnonzero(common > COVERS * np.minimum(area[one], area[other]))
        if len(behind):
            i, j = int(one[behind[0]]), int(other[behind[0]])
            front, back = (i, j) if (low[i] < low[j]) == (axis == 1) else (j, i)
            return f"seen along {along}, '{bodies[back].name}' lies behind '{bodies[front].name}'"
    first, last = int(high.argmin()), int(low.argmax())
    if low[last] >= high[first] - LEVEL * size:
        return (
            f"no plane across {along} cuts all bodies: '{bodies[first].name}' ends at {high[first]:.6g}, "
            f"'{bodies[last].name}' begins at {low[last]:.6g}"
        )
    return ""


class NotFlat(ValueError):
    """Bodies that are not prisms side by side; ``reason`` says why in a clause."""

    def __init__(self, message: str, reason: str) -> None:
        super().__init__(message)
        self.reason = reason


def _not_flat(seen: Sequence[_Projection], asked: _Selection, view: str | None) -> NotFlat:
    """Make the error for bodies that are not prisms side by side, with the reason in every view that was tried."""
    bodies, size = asked.bodies, asked.size
    remedy = "dimension = 3 reads them in space; in the plane leave out all but one leaf (ignore), or draw its outlines"
    if view is None and not any(len(one.outlines) for one in seen):
        holed = [one.refused for one in seen if "no extrusion" not in one.refused]
        if holed:
            return NotFlat(f"{holed[0]}; dimension = 3 reads the blocks in space", holed[0])
        alone = next((body.name for body in bodies if not any(_is_prism(body, axis, size) for axis in range(3))), None)
        reason = f"body '{alone}' is no extrusion along x, y or z" if alone else "; ".join(one.refused for one in seen)
        return NotFlat(
            f"it is not prismatic: {reason}; dimension = 3 reads the blocks in space, in the plane export "
            "extrusions of their outlines along an axis",
            reason,
        )
    if view is None:
        # Views in which every body is a prism come first: they are what the model may have been meant for.
        ordered = sorted(seen, key=lambda one: not len(one.outlines))
        reasons = "; ".join(one.refused for one in ordered)
        return NotFlat(f"it is three-dimensional: {reasons}; {remedy}", ordered[0].refused)
    other = next((v for v in VIEWS if v != view and not _projected(axis_across(v), bodies, size).refused), "")
    remedy = f'view = "{other}" shows them side by side' if other else remedy
    return NotFlat(f"it cannot be seen as {view}: {seen[0].refused}; {remedy}", seen[0].refused)


def _is_prism(body: Body, axis: int, size: float) -> bool:
    corners = body.points[body.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.hypot(np.hypot(normal[:, 0], normal[:, 1]), normal[:, 2])
    wide = area > 1e-9 * size**2
    along = np.abs(normal[wide, axis]) / area[wide]
    square = (along > 1 - SQUARE) | (along < SQUARE)
    levels = corners[:, :, axis]
    caps = levels[wide][along > 1 - SQUARE]
    on_caps = (np.abs(caps - levels.min()) <= LEVEL * size) | (np.abs(caps - levels.max()) <= LEVEL * size)
    return bool(square.all() and on_caps.all())
