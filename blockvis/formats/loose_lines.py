"""From loose lines of a drawing to outlines: the faces between the lines, and outlines that lines cut into blocks."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from itertools import chain, compress
from typing import Any

import numpy as np
import shapely
from scipy.spatial import cKDTree

from blockvis.layout.left_out import LeftOut, matches
from blockvis.layout.notes import CHANGED, LEFT_OUT, Note, kind_of
from blockvis.layout.outlines import ends_of, ring_of, ring_width
from blockvis.layout.refusal import Refused
from blockvis.text import as_toml, listed, place_text
from solver.mechanics import counted

from .arcs import MEETS, with_shared_corners
from .drawing import GRID, Drawing, Line, Outline, joined_note
from .reading import Reading

#: An end moves at most by this fraction of the length of its line.
SHORTENED = 0.05

#: A face is a strip of mortar if it is narrower than this fraction of the typical stone, by area, and has stones along
#: this share of its border: along both long sides.
STRIP, BETWEEN = 0.25, 0.7

#: From this number and share of the faces on, strips are joints drawn as pairs of lines.
LEAST_STRIPS, MOSTLY = 3, 1.0 / 3.0


@dataclass(frozen=True, eq=False)
class Face:
    """A face between lines, (n, 2), the layers of most of its border, innermost last, and those around all."""

    ring: np.ndarray
    layers: tuple[str, ...]
    within: tuple[str, ...]


@dataclass
class Faces:
    """What lines enclose: faces between them, and the pieces into which they cut an outline, by its number."""

    faces: list[Face] = field(default_factory=list)
    pieces: dict[int, list[np.ndarray]] = field(default_factory=dict)
    left_out: list[LeftOut] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def with_faces(
    drawing: Drawing,
    reading: Reading,
    *,
    row_of: Callable[[tuple[str, ...], str], dict[str, Any]],
    called: Callable[[str, int], str] = lambda name, k: f"{name} {k + 1}",
    tolerance: float | None = None,
    in_place: bool = False,
) -> None:
    """Let curves share corners, add the faces between lines to a drawing, and cut its outlines along lines in them.

    The drawing is in the plane. Lines that are not wanted are left out, and outlines that are not wanted are not cut.
    ``row_of`` writes the row of a face by the layers of most of its border, and its name; ``called`` names a piece
    by its outline's name and its number, from 0. Pieces come ``in_place`` of their outline, or behind the others. The
    tolerance is as of :func:`blockvis.formats.arcs.with_shared_corners`.
    """
    if not drawing.strokes:
        return
    wants = drawing.wants(reading)
    drawing.left_out += [outline.left_out(name) for outline, name in drawing.holed]
    drawing.left_out += [line.left_out("asked line") for line in drawing.loose if not wants(line)]
    lines = [*filter(wants, drawing.loose)]
    ignored = {k for k, one in enumerate(drawing.outlines) if not wants(one)}
    size = float(np.ptp(np.concatenate([stroke.points for stroke in drawing.strokes]), axis=0).max())
    drawn: list[Any] = [*drawing.outlines, *lines]
    shared = with_shared_corners([one.points for one in drawn], [one.curves for one in drawn], tolerance)
    drawn, n = [replace(one, points=points) for one, points in zip(drawn, shared, strict=True)], len(drawing.outlines)
    drawing.outlines, lines = drawn[:n], drawn[n:]
    faces = faces_of_lines(lines, drawing.outlines, ignored, reading.only)
    for i, pieces in sorted(faces.pieces.items(), reverse=True):
        whole = drawing.outlines.pop(i)
        at = i if in_place else len(drawing.outlines)
        drawing.outlines[at:at] = [
            replace(whole, points=ring, row={**whole.row, "name": called(whole.row.get("name", "block"), k)}, curves=())
            for k, ring in enumerate(pieces)
        ]
    for k, face in enumerate(faces.faces):
        row = row_of(face.layers, f"face {k}")
        drawing.outlines.append(Outline(points=face.ring, row=row, within=face.within, looks=("face",)))
    drawing.left_out += faces.left_out
    drawing.notes += faces.notes + joined_note(drawing.misses, size)


def faces_of_lines(lines: Sequence[Line], outlines: Sequence[Outline], ignored: Set[int], only: Sequence[str]) -> Faces:
    """Find the faces between lines, and the pieces into which they cut outlines.

    ``ignored`` are numbers of outlines that will be left out: lines may end on them within another, as at openings;
    those that lines cross are as if they were not there. Chain lines are no joints, unless their layers are asked for
    (``only``); where faces are, strips of mortar stay.

    Lines cut an outline if they lie within it and it has two or more pieces along its border then; a line that reaches
    beyond, as an axis or a dimension does, cuts nothing. An outline around lines that do not reach it stays whole.
    Joints may be drawn as pairs of lines: the strips between them are left out as mortar.
    """
    found = Faces()
    axes = dict.fromkeys(one for one in lines if one.chain and not matches([one.layer, *one.looks], only))
    found.left_out += map(_axis, axes)
    lines = [line for line in lines if line not in axes]
    flat, rings = [line.points for line in lines], [outline.points for outline in outlines]
    if not flat:
        return found
    every = cKDTree(np.concatenate([*flat, *rings]))
    kept = [ring for i, ring in enumerate(rings) if i not in ignored]
    size = float(np.ptp(np.concatenate([*flat, *kept]), axis=0).max())
    usable = {i: one for i, one in enumerate(outlines) if float(np.ptp(one.points, axis=0).max()) > GRID * size}
    flat += [np.concatenate([one.points, one.points[:1]]) for one in usable.values()]
    flat = _joined(flat, len(lines), [one.off for one in (*lines, *usable.values())], size, found)
    segments = shapely.set_precision(_lines(flat[: len(lines)]), GRID * size)
    outlined = dict(zip(usable, flat[len(lines) :], strict=True))
    cutting, openings = _cut_outlines(outlined, ignored, segments, every, size, found)
    rest = np.setdiff1d(np.arange(len(lines)), [*cutting])
    n_closed = _add_faces([lines[k] for k in rest], segments[rest], outlined, ignored, every, size, found)
    mortar = [] if matches(["face"], only) else _without_mortar(found, 4 * GRID * size)
    found.notes += [*_cut_notes(found, lines, cutting, openings), *mortar]
    if found.faces:
        found.notes.append(_openings_note(found.faces, len(lines), n_closed))
    return found


def _openings_note(faces: Sequence[Face], n_lines: int, n_closed: int) -> Note:
    """Tell of the faces between lines, some of them closed by outlines."""
    said = f"{counted(len(faces), 'block is a face', 'blocks are faces')} between {counted(n_lines, 'loose line')}"
    said += f", {n_closed} of them beside outlines" if n_closed else ""
    remedy = "an opening enclosed by lines counts as a block too: erase it or draw closed outlines"
    return Note(CHANGED, f"{said}; {remedy}")


def _lines(drawn: Iterable[np.ndarray]) -> np.ndarray:
    """(n,) array: lines of shapely of these points."""
    return np.array([shapely.LineString(points) for points in drawn], dtype=object)


def _axis(line: Line) -> LeftOut:
    name = f"line {line.handle}"
    message = (
        f"{name} on layer '{line.layer}' is drawn in {line.line_type}, dashes and dots as of an axis; if it is a "
        "joint, draw it whole or ask for its layer (only)"
    )
    return line.left_out("axis", message, name)


def _cut_outlines(
    outlines: dict[int, np.ndarray], ignored: Set[int], segments: Any, every: Any, size: float, found: Faces
) -> tuple[set[int], set[int]]:
    """Cut outlines, by their numbers, along the lines within them; numbers of these lines, and of outlines cut out."""
    cutting, openings = set[int](), set[int]()
    tree = shapely.STRtree(segments)
    areas = shapely.STRtree([shapely.Polygon(ring) for ring in outlines.values()])
    numbers = [*outlines]
    for i, area in zip(outlines, areas.geometries, strict=True):
        if i in ignored or area.is_empty or not area.is_valid:
            continue
        inside = tree.query(area.buffer(2 * MEETS * size), "contains").tolist()
        if not inside:
            continue
        cuts = [segments[k] for k in inside]
        # Lines may end on an outline within this one, as between two circles.
        within = areas.query(area, "contains_properly")
        border, line = tree.query(shapely.get_exterior_ring(areas.geometries[within]), "dwithin", GRID * size)
        reached = within[np.unique(border[np.isin(line, inside)])].tolist()
        reached = [
            k for k in reached if numbers[k] not in ignored or not _crossed(areas.geometries[k], cuts, 2 * MEETS * size)
        ]
        pieces = _cut(area, cuts, areas.geometries[reached].tolist(), GRID * size) if reached else []
        openings |= {numbers[k] for k in reached} - ignored if pieces else set()
        pieces = pieces or _cut(area, cuts, [], GRID * size)
        if pieces:
            found.pieces[i] = [_sharpened(piece, every, GRID * size) for piece in pieces]
            cutting |= set(inside)
    return cutting, openings


def _cut_notes(found: Faces, lines: Sequence[Line], cutting: Set[int], openings: Set[int]) -> list[Note]:
    """Say how many lines, of which layers, cut outlines, into how many blocks, and around which possible openings."""
    if not found.pieces:
        return []
    n = sum(map(len, found.pieces.values()))
    around = "an outline cut it" if len(found.pieces) == 1 else f"{len(found.pieces)} outlines cut them"
    said = f"cut: {counted(len(cutting), 'line')} within {around} into {counted(n, 'block')}"
    if openings:
        around = counted(len(openings), "outline")
        said += f" around {around}, a block too: ignore it by its name if it is an opening"
    named = listed([as_toml(layer) for layer in sorted({lines[k].layer for k in cutting} - {""})])
    beside = f" or their layers, [{named}]" if named else ""
    return [Note(CHANGED, f'{said}; if they are no joints, leave them out: ignore = ["line"]{beside}')]


def _without_mortar(found: Faces, reach: float) -> list[Note]:
    """Leave out the strips between pairs of lines, if they are as many as joints are, and say so; else doubt them."""
    every = [*(face.ring for face in found.faces), *chain(*found.pieces.values())]
    strip, across, are_joints = _strips(every, reach)
    if not strip.any():
        return []
    at = place_text(every[int(strip.argmax())].mean(axis=0), 6)
    words = f"mortar: {counted(int(strip.sum()), 'strip')} {across:.3g} units wide between larger faces"
    if not are_joints:
        said = "count as blocks; if they are mortar, draw each joint as one line or leave them out (ignore)"
        return [Note(CHANGED, f"{words}, the first around {at}, {said}")]
    why = "the faces between pairs of lines are mortar"
    found.left_out += [LeftOut("mortar", ring, why) for ring in compress(every, strip)]
    # Faces take the first of these, the pieces of each outline the next.
    is_stone = iter(~strip)
    found.faces = [*compress(found.faces, is_stone)]
    found.pieces = {i: [*compress(own, is_stone)] for i, own in found.pieces.items()}
    said = 'are taken for joints drawn as pairs of lines; joint_thickness = "auto" closes them, only = "*" keeps them'
    return [Note(CHANGED, f"{words} {said} as blocks")]


def _strips(rings: Sequence[np.ndarray], reach: float) -> tuple[np.ndarray, float, bool]:
    """(n,) bool array: which faces are strips between others; their width, and whether they are as many as joints."""
    none = np.zeros(len(rings), dtype=bool), 0.0, False
    if not rings:
        return none
    shapes = np.array([shapely.Polygon(ring) for ring in rings], dtype=object)
    widths, areas = np.array([*map(ring_width, rings)]), shapely.area(shapes)
    order = np.argsort(widths)
    thin = widths < STRIP * widths[order][np.searchsorted(np.cumsum(areas[order]), 0.5 * areas.sum())]
    if not thin.any():
        return none
    i, j = shapely.STRtree(shapes).query(shapes, "dwithin", reach)
    beside, borders = shapely.buffer(shapes, reach), shapely.get_exterior_ring(shapes)
    along = shapely.length(shapely.intersection(borders[i], beside[j])) * (i != j)
    length, strip = shapely.length(borders), none[0]
    # Where strips cross, what they share lies between strips.
    for _ in range(2):
        strip = thin & (np.bincount(i, along * (~thin | strip)[j], len(rings)) > BETWEEN * length)
    if not strip.any():
        return none
    half = length[strip] / 2.0
    across = float(np.median(half - np.sqrt(np.maximum(half**2 - 4.0 * areas[strip], 0.0)))) / 2.0
    # Mortar parts the stones; between thin courses of tiles or slabs they touch each other.
    beside_stones = np.bincount(i, along * ~strip[j], len(rings))[~strip]
    many = strip.sum() >= max(LEAST_STRIPS, MOSTLY * len(rings))
    return strip, across, bool(many and not np.median(beside_stones) > 8.0 * reach)


def _crossing_notes(
    lines: Sequence[Line], segments: np.ndarray, borders: Sequence[set[int]], meets: float
) -> list[Note]:
    """Say which layers have lines that run across those of others, as axes, ground lines and leaders, around faces."""
    layers = np.array([line.layer for line in lines])
    main = Counter(layers[k] for border in borders for k in border).most_common(1)
    i, j = shapely.STRtree(segments).query(segments, "crosses")
    i, j = np.array([i, j])[:, (layers[i] != layers[j]) & (layers[i] != (main[0][0] if main else ""))]
    one, other = segments[i], segments[j]
    # A joint that ends at another may pass it by a little.
    ends = np.array([shapely.get_point(line, k) for line in (one, other) for k in (0, -1)])
    through = (shapely.distance(ends, shapely.intersection(one, other)) > meets).all(axis=0)
    said = []
    for layer in dict.fromkeys(layers[i[through]].tolist()):
        across = {k for k in i[through].tolist() if layers[k] == layer}
        types = ", ".join(dict.fromkeys(lines[k].line_type for k in sorted(across) if lines[k].line_type))
        n = sum(not across.isdisjoint(border) for border in borders)
        if n:
            many = counted(len(across), "line")
            said.append(f"{many} on layer '{layer}'{f' ({types})' if types else ''} around {counted(n, 'face')}")
    words = f"lines run across those of other layers: {', '.join(said)}; leave them out (ignore) if they are no joints"
    return [Note(CHANGED, f"{words}, or name their layer in [geometry] ties if they are ties")] if said else []


def refuse_open(found: Drawing, what: str, remedy: str, unit: str, factors: Sequence[float] = (1, 1)) -> None:
    """Refuse a drawing that has nothing but lines that close nothing, and say what it has."""
    if not found.outlines and all(item.kind == "open" for item in found.left_out):
        skipped = ", ".join(f"{n} {kind}" for kind, n in found.skipped.items() if n)
        notes = [note for note in found.notes if kind_of(note) == LEFT_OUT]
        seen = "; ".join(words for words in (_nothing_closed(found.left_out), skipped, *notes) if words) or "nothing"
        drawn = found.layout(unit, factors=factors)
        raise Refused(f"it has no {what} (found: {seen}); draw each block as {remedy}", drawn)


def _nothing_closed(left_out: Sequence[LeftOut]) -> str:
    """Say what lines there are where nothing closed is, for an error message."""
    lines = [item for item in left_out if item.kind == "open"]
    if not lines:
        return ""
    layers = Counter(item.layer for item in lines)
    listed = ", ".join(f"{n} on layer '{layer}'" if layer else f"{n}" for layer, n in layers.most_common(6))
    ends = ends_of(item.points for item in lines)
    words = f"{counted(len(lines), 'line closes', 'lines close')} nothing ({listed})"
    if len(lines) > 1:
        # The ends of one line are neighbours in this list; the nearest end of another line is the second or third.
        distance, near = cKDTree(ends).query(ends, k=min(4, len(ends)))
        other = near // 2 != np.arange(len(ends))[:, None] // 2
        apart = np.where(other, distance, np.inf).min(axis=1)
        words += f"; their ends are {np.min(apart):.3g} to {np.max(apart):.3g} from the nearest end of another line"
    if lines[0].miss:
        words += f"; {lines[0].message}"
    return words


def _joined(flat: Sequence[np.ndarray], n: int, offs: Sequence[float], size: float, found: Faces) -> list[np.ndarray]:
    """Let the ends of the first n lines meet what they miss by little, and be corners of every line that they meet."""
    # An end on a curve hangs between it and its chord: the curve gets a corner there.
    curves = {j: off for j, off in enumerate(offs) if off > 0.0}
    flat = _with_corners(flat, n, curves, MEETS * size, MEETS * size)
    # What meets a line stays on it where an end of that moves.
    every = dict.fromkeys(range(len(flat)), 0.0)
    flat = _with_corners(flat, n, every, GRID * size, 0.0)
    others = _lines(flat)
    tree = shapely.STRtree(others)
    which, other = tree.query(shapely.points(ends_of(flat[:n])), "intersects")
    meeting = which[other != which // 2]
    moved = []
    for number in np.setdiff1d(np.arange(2 * n), meeting).tolist():
        k, e = number // 2, -(number % 2)
        end = flat[k][e]
        reach = min(MEETS * size, SHORTENED * float(shapely.length(others[k])))
        # A line that has moved is taken where it is now.
        near = tree.query(shapely.Point(end), "dwithin", MEETS * size).tolist()
        best, distance, j = _nearest({j: shapely.LineString(flat[j]) for j in near if j != k}, end, reach)
        if distance < reach and distance > 0.0:
            flat[k][e] = best
            # An end of that line may move, too.
            flat[j] = _with_corner(flat[j], best, 0.0)
            moved.append(distance)
    far = [distance for distance in moved if distance > GRID * size]
    if far:
        missed = counted(len(far), "end of a line", "ends of lines")
        said = f"joined: {missed} that missed another by up to {max(far):.3g} units"
        found.notes.append(Note(CHANGED, said))
    # On the grid an end and a slanted line that it meets would be rounded apart.
    return _with_corners(flat, n, every, GRID * size, 0.0)


def _with_corners(
    drawn: Sequence[np.ndarray], n: int, offs: dict[int, float], meets: float, apart: float
) -> list[np.ndarray]:
    """Make the ends of the first n lines corners of the others that they meet, but for those near a corner."""
    lines = [points.copy() for points in drawn]
    ends, near = ends_of(lines[:n]), _lines(lines[j] for j in offs)
    reach = np.array([*offs.values()]) + meets
    which, number = shapely.STRtree(shapely.points(ends)).query(near, "dwithin", reach)
    for j, i in zip(np.array([*offs], dtype=int)[which].tolist(), number.tolist(), strict=True):
        if i // 2 != j and (offs[j] == 0.0 or _is_on_curve(drawn[j], ends[i], offs[j], meets)):
            lines[j] = _with_corner(lines[j], ends[i], apart)
    return lines


def _is_on_curve(points: np.ndarray, end: np.ndarray, off: float, meets: float) -> bool:
    """Whether an end near the chords of a curve, which are up to ``off`` from it, meets the curve itself."""
    steps = np.diff(points, axis=0)
    squared = np.maximum((steps**2).sum(axis=1), np.finfo(float).tiny)
    places = np.clip(((end - points[:-1]) * steps).sum(axis=1) / squared, 0.0, 1.0)
    distances = np.hypot(*(points[:-1] + places[:, None] * steps - end).T)
    k = int(distances.argmin())
    across = np.array([-steps[k, 1], steps[k, 0]])
    side = float(across @ (end - points[k]))
    towards = [side * float(across @ (points[i] - points[k])) > 0.0 for i in (k - 1, k + 2) if 0 <= i < len(points)]
    # A curve bends away from where it comes from and goes to; where these lie on both sides of a chord, it is no arc.
    if any(towards):
        return bool(distances[k] <= (0.0 if all(towards) else off) + meets)
    half = math.sqrt(squared[k]) / 2.0
    radius = (half**2 + off**2) / (2.0 * off)
    height = math.sqrt(max(radius**2 - (half * (2.0 * places[k] - 1.0)) ** 2, 0.0)) - radius + off
    return bool(distances[k] <= height + meets)


def _with_corner(points: np.ndarray, end: np.ndarray, apart: float) -> np.ndarray:
    """Make an end a corner of a line between its own ends, but for one near a corner."""
    if np.hypot(*(points - end).T).min() <= apart:
        return points
    along = np.cumsum(np.hypot(*np.diff(points, axis=0).T))
    place = shapely.LineString(points).project(shapely.Point(end))
    within = 0.0 < place < along[-1]
    return np.insert(points, 1 + np.searchsorted(along, place), end, axis=0) if within else points


def _nearest(lines: dict[int, Any], end: np.ndarray, reach: float) -> tuple[np.ndarray, float, int]:
    """Find the place on lines to which an end belongs, its distance and the line; corners of a line come first."""
    best, distance, found = end, reach, -1
    for j, line in lines.items():
        corners = np.array(line.coords)
        apart = np.hypot(*(corners - end).T)
        point = line.interpolate(line.project(shapely.Point(end)))
        for candidate, d in (
            (corners[apart.argmin()], apart.min()),
            ((point.x, point.y), point.distance(shapely.Point(end))),
        ):
            if d <= distance:
                best, distance, found = np.array(candidate), float(d), j
                break
    return best, distance, found


def _cut(area: Any, segments: list[Any], inner: list[Any], grid: float) -> list[np.ndarray]:
    """Pieces of an outline around inner ones along its border, two or more; empty where the lines do not cut it."""
    border = shapely.set_precision(area.exterior, grid)
    noded = shapely.union_all([border, *segments, *(one.exterior for one in inner)], grid_size=grid)
    faces = list(shapely.polygonize([*shapely.get_parts(noded)]).geoms)
    faces = [face for face in faces if area.buffer(2 * grid).contains(face)]
    faces = [face for face in faces if not any(one.contains(face.representative_point()) for one in inner)]
    at_border = [face for face in faces if face.exterior.intersection(border.buffer(2 * grid)).length > 10 * grid]
    if len(at_border) < 2 or any(len(face.interiors) for face in faces):
        return []
    return [ring_of(face) for face in faces]


def _crossed(area: Any, lines: list[Any], reach: float) -> bool:
    """Whether a line goes into an outline and out of it by more than a distance."""
    into = shapely.intersects(lines, area.buffer(-reach))
    return bool((into & ~shapely.covers(area.buffer(reach), lines)).any())


def _words_of(layers: Collection[str], paths: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Give the layers with those that hold them, each once and in order."""
    return tuple(word for layer in sorted({*layers}) for word in paths[layer] if word)


def _open_lines(lines: Sequence[Line], segments: np.ndarray, loose: Any) -> list[LeftOut]:
    """Leave out the lines that lie in what encloses nothing."""
    shapely.prepare(loose)
    alone = [lines[k] for k in np.flatnonzero(shapely.covers(loose, segments)).tolist()]
    return [line.left_out("open", _open_message(line), f"line {line.handle}") for line in alone]


def _add_faces(
    lines: list[Line],
    segments: np.ndarray,
    outlines: dict[int, np.ndarray],
    ignored: Set[int],
    every: Any,
    size: float,
    found: Faces,
) -> int:
    """Add the faces between lines that cut no outline, and the lines that enclose nothing; how many outlines close."""
    if not lines:
        return 0
    grid, paths = GRID * size, {line.layer: line.within or (line.layer,) for line in lines}
    faces, cuts, dangles, _ = shapely.polygonize_full([shapely.union_all(segments, grid_size=grid)])
    found.left_out += _open_lines(lines, segments, shapely.union_all([dangles, cuts]).buffer(2 * grid))
    tree, areas = shapely.STRtree(segments), {i: shapely.Polygon(ring).buffer(0) for i, ring in outlines.items()}
    drawn = shapely.STRtree([areas[i] for i in areas if i not in ignored])
    whole, borders = list[Any](), list[set[int]]()

    def add(face: Any) -> None:
        ring = ring_of(face)
        border, lengths = _border(ring, tree, 2 * grid)
        nearest = np.array([lines[k].layer for k in border])
        # By length: an arc of many chords beside a stone, as the extrados beside a spandrel, would outvote its joints.
        layer = max(np.unique(nearest).tolist(), key=lambda one: lengths[nearest == one].sum())
        ring = _sharpened(ring, every, grid)
        if len(face.interiors):
            found.left_out.append(_with_a_hole(face, ring, layer))
            return
        inner = face.buffer(-10 * grid)
        over = drawn.geometries[drawn.query(inner, "intersects")]
        # Within an outline it may be a block in a frame: that is judged when all outlines are there.
        if not shapely.covers(over, inner).all():
            message = "loose lines enclose a face across closed outlines; leave their layer out (ignore)"
            found.left_out.append(LeftOut("across", ring, message, layer, "face"))
            return
        found.faces.append(Face(ring, paths[layer], _words_of(nearest.tolist(), paths)))
        whole.append(face)
        borders.append({*border})

    for face in faces.geoms:
        add(face)
    closed = _closed_by_outlines(lines, tree, whole, borders, areas, ignored, size)
    for face in closed:
        add(face)
    if closed:
        found.left_out = _still_left_out(found.left_out, closed, drawn.geometries, grid)
    found.notes += _crossing_notes(lines, segments, borders, MEETS * size)
    return len(closed)


def _border(ring: np.ndarray, tree: Any, reach: float) -> tuple[list[int], np.ndarray]:
    """Numbers of the lines (an STRtree) along the edges of a face that lie on one, and the lengths of these edges."""
    ends = np.roll(ring, -1, axis=0)
    on, line = tree.query_nearest(shapely.points((ring + ends) / 2.0), max_distance=reach, all_matches=False)
    order = np.argsort(on, kind="stable")
    return line[order].tolist(), np.linalg.norm(ends - ring, axis=1)[on[order]]


def _closed_by_outlines(
    lines: Sequence[Line],
    tree: Any,
    faces: Sequence[Any],
    borders: Sequence[Set[int]],
    areas: dict[int, Any],
    ignored: Set[int],
    size: float,
) -> list[Any]:
    """Stones of which outlines beside them are a part of the border, as beside quoins, in a wall drawn by lines.

    Only lines of layers that enclose faces by themselves are joints for certain, and one alone, as the ground line
    below a door or a dimension, closes nothing.
    """
    grid, joints = GRID * size, {lines[k].layer for border in borders for k in border}
    segments = tree.geometries[[line.layer in joints for line in lines]]
    if not joints or not areas:
        return []
    # Frames and backgrounds are around faces; an ignored outline that lines cross is as if it were not there.
    frames = {*shapely.STRtree(faces).query([*areas.values()], "contains_properly")[0].tolist()}
    beside = [
        area
        for n, (i, area) in enumerate(areas.items())
        if n not in frames and not (i in ignored and _crossed(area, [*segments], 2 * MEETS * size))
    ]
    taken = shapely.STRtree([*faces, *beside])
    noded = shapely.union_all([*segments, *map(shapely.get_exterior_ring, beside)], grid_size=grid)
    return [
        face
        for face in shapely.polygonize([*shapely.get_parts(noded)]).geoms
        if not len(face.interiors)
        and not len(taken.query(face.buffer(-10 * grid), "intersects"))
        and len({*_border(np.array(face.exterior.coords)[:-1], tree, 2 * grid)[0]}) > 1
    ]


def _still_left_out(left_out: Sequence[LeftOut], closed: Sequence[Any], outlines: Any, grid: float) -> list[LeftOut]:
    """Leave out no longer the lines around faces that outlines close, nor what these are pieces of."""
    around = shapely.union_all(shapely.get_exterior_ring(closed)).buffer(2 * grid)
    filled = shapely.union_all([*closed, *outlines]).buffer(10 * grid)

    def is_left_out(item: LeftOut) -> bool:
        if item.kind == "across":
            return not filled.covers(shapely.Polygon(item.points))
        line = shapely.LineString(item.points)
        return item.kind != "open" or bool(line.intersection(around).length < 0.5 * line.length)

    return [*filter(is_left_out, left_out)]


def _with_a_hole(face: Any, ring: np.ndarray, layer: str) -> LeftOut:
    at = place_text(np.array(face.interiors[0].coords).mean(axis=0), 6)
    message = (
        f"the lines around {at} leave a face with a hole; cut the block in two, or draw the blocks as closed outlines"
    )
    holes = tuple(np.array(inner.coords)[:-1] for inner in face.interiors)
    return LeftOut("hole", ring, message, layer, "face", holes=holes)


def _open_message(line: Line) -> str:
    first, last = line.points[0], line.points[-1]
    gap = float(np.hypot(*(first - last)[:2]))
    kind = "polyline" if line.must_close else "line"
    return (
        f"the {kind} {line.handle} on layer '{line.layer}' is open: it starts at ({first[0]:.6g}, "
        f"{first[1]:.6g}) and ends at ({last[0]:.6g}, {last[1]:.6g}), {gap:.4g} apart; close it"
    )


def _sharpened(ring: np.ndarray, points: Any, reach: float) -> np.ndarray:
    """Move the corners from the grid on which lines were intersected back to the points beside them (a cKDTree)."""
    distance, nearest = points.query(ring)
    return np.where((distance <= 2 * reach)[:, None], points.data[nearest], ring)
