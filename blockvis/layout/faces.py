"""Plane faces of blocks in space: joined from the triangles around a body, and fitted where they are warped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from solver.mechanics import linked

from .linked import equal_rows
from .outlines import ROUNDING
from .solids import Solid, cross, off_planes, planes_of, sides_of, triangles_of, volume, width_of
from .surfaces import cleaned

#: In drawings in space faces lie in one plane up to this fraction of the width of a block: modellers warp those of
#: stones by a tenth of it, and those of real vaults overlap by up to 8e-4, their corners being as far off.
OFF_PLANE = 0.01

#: Neighbouring triangles whose normals differ by more than this angle (15 degrees) are different faces.
SAME_FACE = np.cos(np.radians(15.0))

#: Rounds in which planes give way to each other, and the warp, as a fraction of the width, that may be left then.
ROUNDS, STRAIGHT = 40, 2e-4

#: Directions in which the planes around a corner say less than this of where it lies are left as drawn.
UNDETERMINED = 0.05


@dataclass(frozen=True)
class PlaneSolid:
    """A block with plane faces, and how far a corner was from the plane of a face, in the unit of its corners.

    The place is that of the corner that was farthest.
    """

    solid: Solid
    warp: float
    place: np.ndarray


def with_plane_faces(points: np.ndarray, triangles: np.ndarray) -> PlaneSolid:
    """Join triangles around a body, all seen in one sense, to plane faces; fit planes to those that are warped."""
    used, index = np.unique(triangles, return_inverse=True)
    points, triangles = points[used], index.reshape(-1, 3)
    if volume(points, triangles) < 0.0:
        triangles = triangles[:, ::-1]
    near = OFF_PLANE * width_of(points, triangles)
    faces = [ring for region in _regions(points, triangles, near) for ring in _rings_of(triangles[region])]
    return fitted(*_without_straight(points, faces, near), near)


def fitted(points: np.ndarray, faces: list[list[int]], near: float) -> PlaneSolid:
    """Fit a plane to each face, or cut it if it is warped by more than ``near``; move corners to where planes meet."""
    rings = bent_in_triangles(points, faces, near)
    planes = planes_of(points, rings)
    warp = off_planes(points, rings, planes)
    worst = int(warp.argmax())
    corners = points[rings[worst]]
    place = corners[int(np.abs(corners @ planes[worst, :3] - planes[worst, 3]).argmax())]
    if warp[worst] <= ROUNDING * width_of(points, rings):
        return PlaneSolid(cleaned(points, rings), 0.0, place)
    return PlaneSolid(cleaned(*flattened(points, rings, planes)), float(warp[worst]), place)


def flattened(points: np.ndarray, faces: list[list[int]], planes: np.ndarray, first: np.ndarray | None = None) -> Solid:
    """Move the corners of a block to its planes until its faces are plane, and cut those that stay warped.

    Where more than three meet, the planes of other faces than ``first`` give way; see :func:`moved_to_planes`.
    """
    moved = moved_to_planes(points, faces, planes, first)
    near = ROUNDING * width_of(moved, faces)
    for _ in range(ROUNDS):
        now = planes_of(moved, faces)
        if off_planes(moved, faces, now).max() <= near:
            return moved, faces
        planes = now if first is None else np.where(first[:, None], planes, now)
        moved = moved_to_planes(moved, faces, planes, first)
    return moved, bent_in_triangles(moved, faces, STRAIGHT * width_of(moved, faces))


def bent_in_triangles(points: np.ndarray, faces: Sequence[list[int]], near: float) -> list[list[int]]:
    """Cut the faces of which a corner is farther than ``near`` from their plane into triangles."""
    flat = off_planes(points, faces, planes_of(points, faces)) <= near
    rings: list[list[int]] = []
    for ring, is_flat in zip(faces, flat.tolist(), strict=True):
        rings += [ring] if is_flat or len(ring) == 3 else triangles_of(points, [ring]).tolist()
    return rings


def moved_to_planes(
    points: np.ndarray, faces: Sequence[Sequence[int]], planes: np.ndarray, first: np.ndarray | None = None
) -> np.ndarray:
    """Move the corners of a block to where the planes of their faces meet, as little as that takes.

    ``planes`` are unit normals and distances from the origin, (n_faces, 4). Where more than three meet nearly in a
    point, corners go to the point nearest to them, and first to the planes of the faces that are ``first``, (n_faces,)
    bool array.
    """
    before = np.zeros(len(planes), dtype=bool) if first is None else first
    corner = np.concatenate([np.asarray(face, dtype=np.int64) for face in faces])
    number = np.repeat(np.arange(len(faces)), [len(face) for face in faces])
    # The planes around each corner, in the first columns of its row.
    order = np.argsort(corner, kind="stable")
    counts = np.bincount(corner, minlength=len(points))
    met = np.arange(max(int(counts.max()), 3)) < counts[:, None]
    around = np.zeros(met.shape, dtype=np.int64)
    around[met] = number[order]
    normals, distances, chosen = planes[around, :3], planes[around, 3], met & before[around]
    chosen = np.where(((counts > 3) & chosen.any(axis=1))[:, None], chosen, met)
    held, moved = normals * chosen[..., None], points.copy()
    _, sizes, axes = np.linalg.svd(held)
    # What planes hold a corner in is no way for the others.
    along = axes * (sizes <= UNDETERMINED * sizes[:, :1])[..., None]
    for some, ways in ((chosen, held), (met & ~chosen, normals * (met & ~chosen)[..., None] @ along.mT @ along)):
        missing = (distances - (normals @ moved[..., None])[..., 0]) * some
        moved += (np.linalg.pinv(ways, rcond=UNDETERMINED) @ missing[..., None])[..., 0]
    return moved


def _regions(points: np.ndarray, triangles: np.ndarray, near: float) -> list[np.ndarray]:
    """Group the triangles of a body by the planes in which they lie: numbers of the triangles of each face."""
    corners = points[triangles]
    normal = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.linalg.norm(normal, axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    normal = normal / np.maximum(double, 1e-300)[:, None]
    sliver = double <= near * longest
    one, other = (side // 3 for side in equal_rows(sides_of(triangles)))
    large, small = np.where(double[one] >= double[other], (one, other), (other, one))
    apart = np.abs(np.einsum("ijk,ik->ij", corners[small] - corners[large][:, :1], normal[large])).max(axis=1)
    along = np.einsum("ij,ij->i", normal[one], normal[other]) >= SAME_FACE
    # Polygons with re-entrant corners that were cut in fans have triangles that lie the other way round.
    same = (apart <= near) & (along | sliver[small] | (apart <= ROUNDING * longest[large]))
    label = linked((one[same], other[same]), len(triangles))
    found = []
    for region in np.split(np.argsort(label, kind="stable"), np.cumsum(np.bincount(label))[:-1]):
        if len(region) == 1 or _warp(points, triangles[region]) <= near:
            found.append(region)
        else:
            found += _grown(points, triangles, region, normal, double, near, (one[same], other[same]))
    return found


def _grown(
    points: np.ndarray,
    triangles: np.ndarray,
    region: np.ndarray,
    normal: np.ndarray,
    area: np.ndarray,
    near: float,
    pairs: tuple[np.ndarray, np.ndarray],
) -> list[np.ndarray]:
    """Cut a region that bends, as a curved face of many triangles does, into faces that grow from the largest on."""
    neighbours: dict[int, list[int]] = {int(k): [] for k in region}
    for a, b in zip(pairs[0].tolist(), pairs[1].tolist(), strict=True):
        if a in neighbours and b in neighbours:
            neighbours[a].append(b)
            neighbours[b].append(a)
    waiting = dict.fromkeys(region[np.argsort(-area[region], kind="stable")].tolist())
    found = []
    while waiting:
        seed = next(iter(waiting))
        del waiting[seed]
        members, front = [seed], [seed]
        level = float(points[triangles[seed]].mean(axis=0) @ normal[seed])
        while front:
            for k in neighbours[front.pop()]:
                flat = k in waiting and np.abs(points[triangles[k]] @ normal[seed] - level).max() <= near
                if flat and (normal[k] @ normal[seed] >= SAME_FACE):
                    del waiting[k]
                    members.append(k)
                    front.append(k)
        found.append(np.array(members))
    return found


def _warp(points: np.ndarray, triangles: np.ndarray) -> float:
    """How far the corners of triangles are from their mean plane."""
    corners = points[triangles]
    normal = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
    length = float(np.linalg.norm(normal))
    if length == 0.0:
        return np.inf
    level = points[np.unique(triangles)] @ (normal / length)
    return float(np.ptp(level)) / 2.0


def _rings_of(triangles: np.ndarray) -> list[list[int]]:
    """Find the ring around the triangles of a face; those around a hole, or that touch themselves, stay triangles."""
    directed = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).tolist()
    inner = {(b, a) for a, b in directed}
    border = [(a, b) for a, b in directed if (a, b) not in inner]
    following = dict(border)
    if len(following) == len(border) and border:
        ring = [border[0][0]]
        while following[ring[-1]] != ring[0] and len(ring) <= len(border):
            ring.append(following[ring[-1]])
        if len(ring) == len(border):
            return [ring]
    return [list(map(int, triangle)) for triangle in triangles]


def _without_straight(points: np.ndarray, faces: list[list[int]], near: float) -> tuple[np.ndarray, list[list[int]]]:
    """Drop the corners at which only two faces meet, which lie on the edge between them, and points of no face."""
    drop = _straight_corners(points, faces, near)
    rings = [[corner for corner in ring if corner not in drop] for ring in faces]
    rings = [ring for ring in rings if len(ring) > 2]
    used = np.unique(np.concatenate([np.array(ring) for ring in rings]))
    place = {int(old): new for new, old in enumerate(used)}
    return points[used], [[place[corner] for corner in ring] for ring in rings]


def _straight_corners(points: np.ndarray, faces: list[list[int]], near: float) -> set[int]:
    """Find the corners of two faces alone that lie on the line between the next corners of three or more."""
    met: dict[int, set[int]] = {}
    for number, ring in enumerate(faces):
        for corner in ring:
            met.setdefault(corner, set()).add(number)
    drop = {corner for corner, numbers in met.items() if len(numbers) < 3}
    for ring in faces:
        n = len(ring)
        kept = [k for k in range(n) if ring[k] not in drop]
        if len(kept) < 2:
            drop -= set(ring)
            continue
        for k in range(n):
            if ring[k] in drop:
                before = max((j for j in kept if j < k), default=kept[-1])
                after = min((j for j in kept if j > k), default=kept[0])
                if _beside(points[ring[k]], points[ring[before]], points[ring[after]]) > near:
                    drop.discard(ring[k])
    return drop


def _beside(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    """Distance of a point from the line through two others."""
    along = end - start
    length = float(np.linalg.norm(along))
    if length == 0.0:
        return float(np.linalg.norm(point - start))
    return float(np.linalg.norm(np.cross(point - start, along))) / length
