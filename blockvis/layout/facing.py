"""Joints in space whose faces do not quite meet: one plane per joint, corners moved to where their planes meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

import solver
from solver.mechanics import counted, linked

from .faces import OFF_PLANE, flattened
from .outlines import ROUNDING
from .solids import Solid, area_vectors, planes_of, volume, width_of
from .surfaces import cleaned, is_closed

#: Faces whose normals are this far from opposite (cosine of 10 degrees) are no joint.
OPPOSITE = -np.cos(np.radians(10.0))

#: Joints that go on beside each other are in one plane if they are within this many times the largest gap found.
NOISE = 2.0

#: Overlaps up to this fraction of what is faced may grow, where facing makes others smaller.
WORSE = 0.5

#: A block whose volume faces in one plane with those of others change by more than this part of it stays as drawn.
SAME_BLOCK = 0.5

#: Faces that cover each other by less than this fraction of the smaller one touch at an edge.
COVERS = 1e-3


@dataclass(frozen=True)
class Facing:
    """Blocks in space with one plane per joint, and a note on what was done; "" where every joint was plane."""

    solids: tuple[Solid, ...]
    note: str = ""


@dataclass(frozen=True)
class _Faces:
    """All faces of all blocks: planes (n, 4), block of each, corners of each (n, 3), areas."""

    block: np.ndarray
    planes: np.ndarray
    rings: list[np.ndarray]
    areas: np.ndarray

    def off(self, face: int, plane: np.ndarray) -> float:
        """How far the corner of a face that is farthest from a plane, (4,) array, is from it."""
        return float(np.abs(self.rings[face] @ plane[:3] - plane[3]).max())


def facing_tolerance(
    solids: Sequence[Solid], joint_thickness: float = 0.0, overlap_tolerance: float | None = None
) -> float:
    """Find the gap and overlap [m] up to which joints are faced: at least 0.01 of the width of a typical block.

    A tolerance below that does not face less: it refuses what is left.
    """
    default = OFF_PLANE * float(np.median([width_of(*solid) for solid in solids]))
    return max(joint_thickness, overlap_tolerance or 0.0, default)


def faced(
    solids: Sequence[Solid], names: Sequence[str], tolerance: float | None = None, anchored: np.ndarray | None = None
) -> Facing:
    """Give the faces on both sides of each joint one plane; a joint in one plane already stays as it is, bit for bit.

    Gaps and overlaps up to a tolerance [m] are faced, by default 0.01 of the width of a typical block. ``anchored``,
    (n_blocks,) bool array, are blocks that keep their faces.
    """
    widths = np.array([width_of(*solid) for solid in solids])
    width = float(np.median(widths))
    near = facing_tolerance(solids) if tolerance is None else tolerance
    anchored = np.zeros(len(solids), dtype=bool) if anchored is None else anchored
    faces = _faces_of(solids)
    one, other, apart = _joints(faces, near, ROUNDING * width)
    kept = ~(anchored[faces.block[one]] & anchored[faces.block[other]])
    one, other, apart = one[kept], other[kept], apart[kept]
    rough = np.abs(apart) > ROUNDING * width
    if not rough.any():
        return Facing(tuple(solids))
    planes, changed = faces.planes.copy(), np.zeros(len(faces.planes), dtype=bool)
    in_line = _in_line(faces, np.unique([one, other]), min(near, NOISE * float(np.abs(apart).max())))
    for members, sides in _groups(faces, np.append(one, in_line[0]), np.append(other, in_line[1]), near):
        if not (rough & np.isin(one, members)).any():
            continue
        held = [n for n, k in enumerate(members) if anchored[faces.block[k]]]
        plane = sides[held[0]] * faces.planes[members[held[0]]] if held else _common_plane(faces, members, sides)
        for k, side in zip(members, sides, strict=True):
            if not anchored[faces.block[k]]:
                planes[k], changed[k] = side * plane, True
    joint = np.zeros(len(planes), dtype=bool)
    joint[np.concatenate([one, other])] = True
    moved, kept = _unless_worse(
        solids, _moved(solids, faces, planes, changed, joint), names, WORSE * facing_tolerance(solids)
    )
    worst = int(np.abs(apart).argmax())
    n = int(rough.sum())
    a, b = names[faces.block[one[worst]]], names[faces.block[other[worst]]]
    what = "overlapping" if apart[worst] < 0 else "open"
    rough_joints = counted(n, "joint between faces was", "joints between faces were")
    note = f"{rough_joints} not plane, {what} by up to {abs(apart[worst]):.3g} m ('{a}' and '{b}')"
    if any(solid is not drawn for solid, drawn in zip(moved, solids, strict=True)):
        note += "; their faces were moved into one plane each"
    if kept:
        note += (
            f"; {counted(len(kept), 'block stays', 'blocks stay')} as drawn, which overlap less so ('{names[kept[0]]}')"
        )
    return Facing(moved, note)


def _unless_worse(
    drawn: Sequence[Solid], moved: Sequence[Solid], names: Sequence[str], near: float
) -> tuple[tuple[Solid, ...], list[int]]:
    """Leave blocks as drawn that overlap more, and by more than ``near``, when they are faced, and tell which."""
    found, kept = tuple(moved), set[int]()
    # Of a thin stone the same overlap would be all of it.
    allowed = np.minimum(near, [WORSE * width_of(*solid) for solid in drawn])
    try:
        after = _depths(found, names, allowed)
    except ValueError:
        # Moved so far that a block is none any more.
        return tuple(drawn), list(range(len(drawn)))
    before = _depths(drawn, names, allowed) if after else {}
    while True:
        # What has been moved of two blocks that now overlap more goes back, until nothing does.
        worse = {i for pair, depth in after.items() if depth > (1.0 + ROUNDING) * before.get(pair, 0.0) for i in pair}
        worse = {i for i in worse - kept if moved[i] is not drawn[i]}
        if not worse:
            return found, sorted(kept)
        kept |= worse
        found = tuple(drawn[i] if i in kept else solid for i, solid in enumerate(moved))
        after = _depths(found, names, allowed)


def _depths(solids: Sequence[Solid], names: Sequence[str], allowed: np.ndarray) -> dict[tuple[int, int], float]:
    """How deep [m] pairs of blocks overlap, by more than is allowed (n_blocks,) of either."""
    assembly = solver.Assembly.from_solids(solids, names=names)
    i, j, depth = assembly.shapes.overlaps(assembly.vertices, float(allowed.min()))
    deep = depth > np.minimum(allowed[i], allowed[j])
    return {(int(a), int(b)): float(d) for a, b, d in zip(i[deep], j[deep], depth[deep], strict=True)}


def _faces_of(solids: Sequence[Solid]) -> _Faces:
    rings = [points[face] for points, faces in solids for face in faces]
    block = np.repeat(np.arange(len(solids)), [len(faces) for _, faces in solids])
    planes = np.concatenate([planes_of(*solid) for solid in solids])
    areas = np.concatenate([np.linalg.norm(area_vectors(*solid), axis=1) for solid in solids])
    return _Faces(block, planes, rings, areas)


def _joints(faces: _Faces, near: float, exact: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find pairs of faces that face each other across at most ``near``: both, and the gap where it is largest.

    None where all of them are in one plane within ``exact``.
    """
    one, other = _near_boxes(faces, near)
    pair = np.einsum("ij,ij->i", faces.planes[one, :3], faces.planes[other, :3]) < OPPOSITE
    one, other = _near_planes(faces, one[pair], other[pair], near, exact)
    gaps = np.array([_gap(faces, a, b) for a, b in zip(one.tolist(), other.tolist(), strict=True)], dtype=float)
    found = np.abs(gaps) <= near
    one, other, gaps = one[found], other[found], gaps[found]
    found = ~_apart_for_good(faces, one, other, gaps, exact)
    return one[found], other[found], gaps[found]


def _apart_for_good(faces: _Faces, one: np.ndarray, other: np.ndarray, gaps: np.ndarray, exact: float) -> np.ndarray:
    """(n,) bool array: pairs of faces that are no joint, as a thin stone lies between them or is one of the two."""
    pairs = list(zip(one.tolist(), other.tolist(), gaps.tolist(), strict=True))
    across: dict[int, dict[tuple[int, int], float]] = {}
    for a, b, gap in pairs:
        for k, far in ((a, b), (b, a)):
            across.setdefault(k, {})[int(faces.block[far]), far] = abs(gap)
    for_good = np.zeros(len(pairs), dtype=bool)
    for n, (a, b, gap) in enumerate(pairs):
        if gap > exact:
            # Of a sheet both faces are nearer to these two than they are to each other.
            beside = ({block: k for (block, k), off in across[end].items() if off < gap} for end in (a, b))
            below, above = beside
            for_good[n] = any(k != above.get(block, k) for block, k in below.items())
        elif gap < -exact:
            # Faces that look away from each other on both sides of a sheet seem to overlap by its thickness.
            for_good[n] = -gap >= (1.0 - ROUNDING) * min(_thickness(faces, a), _thickness(faces, b))
    return for_good


def _thickness(faces: _Faces, face: int) -> float:
    """How far [m] the block of a face reaches behind its plane."""
    rings = (faces.rings[k] for k in np.flatnonzero(faces.block == faces.block[face]))
    return float(max((faces.planes[face, 3] - ring @ faces.planes[face, :3]).max() for ring in rings))


def _near_boxes(faces: _Faces, near: float) -> tuple[np.ndarray, np.ndarray]:
    """Find pairs of faces of different blocks whose boxes are no farther apart than ``near``."""
    low = np.array([ring.min(axis=0) for ring in faces.rings]) - near
    high = np.array([ring.max(axis=0) for ring in faces.rings]) + near
    boxes = shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1])
    one, other = shapely.STRtree(boxes).query(boxes)
    pair = (one < other) & (faces.block[one] != faces.block[other])
    one, other = one[pair], other[pair]
    pair = (low[one, 2] <= high[other, 2]) & (low[other, 2] <= high[one, 2])
    return one[pair], other[pair]


def _near_planes(
    faces: _Faces, one: np.ndarray, other: np.ndarray, near: float, exact: float
) -> tuple[np.ndarray, np.ndarray]:
    """Keep the pairs of which a corner is near the other face's plane; none if all of these are as near as can be."""
    counts = np.array([len(ring) for ring in faces.rings])
    starts = np.cumsum(counts) - counts
    corners = np.concatenate(faces.rings)
    smaller = np.where(faces.areas[one] <= faces.areas[other], one, other)
    larger = np.where(smaller == one, other, one)
    # The corners of the smaller face of each pair, all pairs one after another.
    n = counts[smaller]
    begin = np.cumsum(n) - n
    index = np.repeat(starts[smaller] - begin, n) + np.arange(int(n.sum()))
    plane = np.repeat(larger, n)
    away = np.abs((corners[index] * faces.planes[plane, :3]).sum(axis=1) - faces.planes[plane, 3])
    if not len(away):
        return one, other
    close = np.minimum.reduceat(away, begin) <= near
    if np.maximum.reduceat(away, begin)[close].max(initial=0.0) <= exact:
        close[:] = False
    return one[close], other[close]


def _in_line(faces: _Faces, chosen: np.ndarray, near: float) -> tuple[np.ndarray, np.ndarray]:
    """Find pairs of faces of joints that go on in one plane beside each other: a straight joint of several stones.

    Stones that meet at an edge would overlap at it if every joint found a plane of its own.
    """
    one, other = _near_boxes(faces, near)
    pair = np.isin(one, chosen) & np.isin(other, chosen)
    one, other = one[pair], other[pair]
    along = np.abs(np.einsum("ij,ij->i", faces.planes[one, :3], faces.planes[other, :3])) > -OPPOSITE
    one, other = one[along], other[along]
    pairs = zip(one.tolist(), other.tolist(), strict=True)
    off = [max(faces.off(b, faces.planes[a]), faces.off(a, faces.planes[b])) for a, b in pairs]
    flat = np.array(off, dtype=float) <= 2.0 * near
    return one[flat], other[flat]


def _gap(faces: _Faces, a: int, b: int) -> float:
    """Measure the gap of two faces where they cover each other, the largest by amount; NaN where they do not."""
    normal = faces.planes[a, :3] - faces.planes[b, :3]
    normal /= np.linalg.norm(normal)
    first = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
    first /= np.linalg.norm(first)
    frame = np.stack([first, np.cross(normal, first)], axis=1)
    middle = faces.rings[a].mean(axis=0)
    flat = [shapely.Polygon((faces.rings[k] - middle) @ frame) for k in (a, b)]
    flat = [shape if shape.is_valid else shape.buffer(0.0) for shape in flat]
    common = flat[0].intersection(flat[1])
    if common.area <= COVERS * min(faces.areas[a], faces.areas[b]):
        return np.nan
    corners = middle + shapely.get_coordinates(common) @ frame.T
    # The height of each plane above the corners of what both cover, along the common normal.
    heights = [(faces.planes[k, 3] - corners @ faces.planes[k, :3]) / (faces.planes[k, :3] @ normal) for k in (a, b)]
    gap = heights[1] - heights[0]
    return float(gap[np.abs(gap).argmax()])


def _groups(faces: _Faces, one: np.ndarray, other: np.ndarray, near: float) -> list[tuple[list[int], np.ndarray]]:
    """Group the faces that share a plane, and the side of it on which the block of each lies: 1 or -1."""
    label = linked((one, other), len(faces.planes))
    groups = []
    for members in np.split(np.argsort(label, kind="stable"), np.cumsum(np.bincount(label))[:-1]):
        if len(members) > 1:
            inside = np.isin(one, members)
            groups += _flat_groups(faces, members.tolist(), list(zip(one[inside], other[inside], strict=True)), near)
    return groups


def _flat_groups(
    faces: _Faces, members: list[int], pairs: list[tuple[int, int]], near: float
) -> list[tuple[list[int], np.ndarray]]:
    """Keep a group whose faces lie near one plane; cut another up, by the pairs that cover each other most."""

    def is_flat(group: list[int]) -> bool:
        if len(group) == 2:
            return True
        sides = _sides(faces, group)
        if holds_both_sides(group, sides):
            return False
        plane = _common_plane(faces, group, sides)
        return all(faces.off(k, plane) <= near for k in group)

    def holds_both_sides(group: list[int], sides: np.ndarray) -> bool:
        # A thin stone whose faces lay in one plane would be none any more.
        blocks = faces.block[group]
        return bool(np.intersect1d(blocks[sides > 0.0], blocks[sides < 0.0]).size)

    if is_flat(members):
        return [(members, _sides(faces, members))]
    groups: dict[int, list[int]] = {k: [k] for k in members}
    if holds_both_sides(members, _sides(faces, members)):
        # The joints above and below a thin stone are told apart by the faces that are nearest.
        pairs = sorted(pairs, key=lambda pair: faces.off(pair[1], faces.planes[pair[0]]))
    else:
        pairs = sorted(pairs, key=lambda pair: -min(faces.areas[pair[0]], faces.areas[pair[1]]))
    for a, b in pairs:
        joined = groups[a] if groups[a] is groups[b] else groups[a] + groups[b]
        if is_flat(joined):
            groups |= dict.fromkeys(joined, joined)
    once = {id(group): group for group in groups.values() if len(group) > 1}
    return [(group, _sides(faces, group)) for group in once.values()]


def _sides(faces: _Faces, members: list[int]) -> np.ndarray:
    """(n,) array: 1 for faces that are seen as the first of them, -1 for those seen from the other side."""
    return np.where(faces.planes[members, :3] @ faces.planes[members[0], :3] > 0.0, 1.0, -1.0)


def _common_plane(faces: _Faces, members: list[int], sides: np.ndarray) -> np.ndarray:
    """(4,) array: the plane nearest to faces, as the first of them is seen."""
    rings, planes, areas = [faces.rings[k] for k in members], faces.planes[members], faces.areas[members]
    if len(rings) <= 2:
        normal = (sides[:, None] * planes[:, :3] * areas.min()).sum(axis=0)
    else:
        # The normal of a long joint of many small faces follows from their places more than from each of them.
        points = np.concatenate(rings)
        weight = np.repeat(areas / np.array([len(ring) for ring in rings]), [len(ring) for ring in rings])
        middle = weight @ points / weight.sum()
        _, _, axes = np.linalg.svd((points - middle) * np.sqrt(weight)[:, None], full_matrices=False)
        normal = axes[2] * np.sign(axes[2] @ planes[0, :3]) * sides[0]
    normal = normal / np.linalg.norm(normal)
    middles = np.array([ring.mean(axis=0) for ring in rings])
    if len(rings) == 2:
        # Half-way between both planes in the middle of the smaller face.
        middle = middles[int(areas.argmin())]
        heights = (planes[:, 3] - planes[:, :3] @ middle) / (planes[:, :3] @ normal)
        return np.append(normal, middle @ normal + float(heights.mean()))
    return np.append(normal, float(areas / areas.sum() @ (middles @ normal)))


def _moved(
    solids: Sequence[Solid], faces: _Faces, planes: np.ndarray, changed: np.ndarray, joint: np.ndarray
) -> tuple[Solid, ...]:
    """Move the corners of the blocks with changed planes, to those of joints before those of free faces."""
    moved = list(solids)
    start = np.searchsorted(faces.block, np.arange(len(solids) + 1))
    for i in np.unique(faces.block[changed]).tolist():
        points, rings = solids[i]
        mine = slice(start[i], start[i + 1])
        found = flattened(points, rings, planes[mine], joint[mine])
        solid, drawn = cleaned(*found), volume(points, rings)
        if is_closed(solid[1]) and abs(volume(*solid) - drawn) <= SAME_BLOCK * drawn:
            moved[i] = solid
    return tuple(moved)
