"""The view of blocks in space: from where they are seen, the same in all pictures of a response."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

import solver
from blockvis.layout.sights import BELOW, Cut, Sight
from blockvis.results.joint_faces import InitialJoints
from solver import mechanics

from .sight_lines import SightLines
from .surface import left_blocks

#: Directions that are tried, from the structure to the eye: three-quarter views, in degrees around and above the level.
AROUND = (-60.0, -30.0, -120.0, -150.0, 30.0, 60.0, 120.0, 150.0)
ABOVE = 24.0

#: What it is worth to have what moves in front, beside seeing all of its motion.
IN_FRONT = 0.35

#: Directions in which a motion is seen as well as in the best one, within this part, are equal.
ALIKE = 0.02

#: Planes that cut are seen from where at least this cosine of the angle to their normal is left; level ones from above.
ACROSS = 0.6


@dataclass(frozen=True)
class View:
    """A parallel projection: the eye is so far around, counter-clockwise from x, and above the level [degrees]."""

    around: float
    above: float

    @cached_property
    def axes(self) -> np.ndarray:
        """(3, 3) array: rows to the right, up in the picture, and to the eye."""
        around, above = np.radians([self.around, self.above])
        right = np.array([-np.sin(around), np.cos(around), 0.0])
        eye = np.array([np.cos(above) * np.cos(around), np.cos(above) * np.sin(around), np.sin(above)])
        return np.stack([right, np.cross(eye, right), eye])

    def projected(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) array [m]: places in the picture of points (n, 3) [m]."""
        return np.asarray(points @ self.axes[:2].T)

    def depth(self, points: np.ndarray) -> np.ndarray:
        """(n,) array [m]: how far points (n, 3) [m] are towards the eye."""
        return np.asarray(points @ self.axes[2])


def views_of(
    response: solver.Response, motion: np.ndarray, joints: InitialJoints, sight: Sight | None, cut: Cut | None
) -> tuple[View, ...]:
    """Find from where a structure is drawn: as asked for; vaults and domes from above and, beside that, from below.

    ``motion`` (n_blocks, 3) is as of :func:`chosen_view`; the cut has to be seen.
    """
    sight = sight or Sight(both=cut is None and has_intrados(response.assembly, joints))
    level = cut is not None and abs(cut.normal[2]) > ACROSS
    above = 50.0 if level else _above(response.assembly)
    views = views_from(sight, above)
    if sight.azimuth is None and cut is not None and not level:
        facing = [abs(float(view.axes[2] @ cut.normal)) for view in views]
        views = [view for view, cosine in zip(views, facing, strict=True) if cosine >= min(ACROSS, max(facing))]
    view = views[0] if len(views) == 1 else chosen_view(response, motion, views)
    return (view, View(view.around, BELOW)) if sight.both else (view,)


def views_from(sight: Sight, above: float) -> list[View]:
    """List the views among which one is chosen: as asked for, or three-quarter ones, by default from so far above."""
    arounds = AROUND if sight.azimuth is None else (sight.azimuth,)
    return [View(around, above if sight.elevation is None else sight.elevation) for around in arounds]


def has_intrados(assembly: solver.Assembly, joints: InitialJoints) -> bool:
    """Whether free blocks hang over air as vaults do: faces that look down and rest on nothing cover their plan."""
    shapes, free = assembly.polyhedra, assembly.free
    faces = shapes.faces(shapes.vertices)
    heights = (faces.areas * faces.normals[:, 2])[free[shapes.block_of_face]]
    down, up = -float(heights[heights < 0.0].sum()), float(heights[heights > 0.0].sum())
    # The normal of a joint points into block a: where it points up, b has a face that looks up, and a one down.
    plan = joints.sizes * joints.normals[:, 2]
    upper = np.where(plan > 0.0, joints.block_a, joints.block_b)
    lower = np.where(plan > 0.0, joints.block_b, joints.block_a)
    down -= float(np.abs(plan)[free[upper]].sum())
    up -= float(np.abs(plan)[free[lower]].sum())
    return down > 0.4 * up > 0.0


def hiding_supports(assembly: solver.Assembly, view: View) -> np.ndarray:
    """(n_blocks,) bool array: supports that hide the structure from an eye below it."""
    hides = np.zeros(assembly.n_blocks, dtype=bool)
    if view.above >= 0.0 or not assembly.free.any():
        return hides
    flat, owner = view.projected(assembly.vertices), assembly.block_of_vertex
    whole = shapely.MultiPoint(flat[assembly.free[owner]]).convex_hull
    for block in np.flatnonzero(~assembly.free).tolist():
        shadow = shapely.MultiPoint(flat[owner == block]).convex_hull
        hides[block] = shadow.intersection(whole).area > 0.12 * whole.area
    return hides


def plane_of(assembly: solver.Assembly, cut: Cut | None, view: View | None = None) -> np.ndarray | None:
    """(2, 3) array: a point [m] of the plane that cuts blocks open, and its unit normal; None without one.

    Seen from a view the normal points away from the eye: what lies between the plane and the eye is left out. Raises
    ``ValueError`` for a plane that misses the blocks.
    """
    if cut is None:
        return None
    corners, normal = assembly.vertices, np.array(cut.normal)
    free = corners[assembly.free[assembly.block_of_vertex]] if assembly.free.any() else corners
    point = (free.min(axis=0) + free.max(axis=0)) / 2.0 if cut.point is None else np.array(cut.point)
    heights = (corners - point) @ normal
    if not heights.min() < 0.0 < heights.max():
        raise ValueError(
            f"section: the plane through ({', '.join(f'{x:.4g}' for x in point)}) m misses the blocks, which lie "
            f"{heights.min():.4g} to {heights.max():.4g} m from it along its normal; move its point there"
        )
    return np.stack([point, -normal if view is not None and normal @ view.axes[2] > 0.0 else normal])


def heights_over(plane: np.ndarray | None, points: np.ndarray) -> np.ndarray:
    """(n,) array [m]: heights of points (n, 3) over a plane as of :func:`plane_of`; infinite where there is none."""
    return np.full(len(points), np.inf) if plane is None else np.asarray((points - plane[0]) @ plane[1])


def section_words(plane: np.ndarray | None) -> list[str]:
    """Name the plane of a section, as of :func:`plane_of`, for a caption; empty where there is none."""
    if plane is None:
        return []
    point, normal = plane
    axis = int(np.abs(normal).argmax())
    if abs(normal[axis]) > 1.0 - 1e-9:
        # No minus before a zero.
        return [f"section {'xyz'[axis]} = {_to_millimetres(point)[axis]} m"]
    place, towards = ", ".join(_to_millimetres(point)), ", ".join(f"{x:.4g}" for x in np.round(normal, 9) + 0.0)
    return [f"section through ({place}) m across ({towards})"]


def _to_millimetres(point: np.ndarray) -> list[str]:
    """Write coordinates [m], however far from the origin a drawing lies."""
    return [f"{x:.12g}" for x in np.round(point, 3) + 0.0]


def kept_blocks(plane: np.ndarray | None, assembly: solver.Assembly, pose: solver.Pose) -> np.ndarray:
    """(n_blocks,) bool array: blocks of which a section at a plane leaves something; all where there is none."""
    return left_blocks(assembly, heights_over(plane, mechanics.moved_vertices(assembly, pose)))


def into_sight(plane: np.ndarray | None, points: np.ndarray) -> np.ndarray:
    """(n, d) array [m]: the way from points (n, d) [m] to the plane of a section, of those that it leaves out."""
    if plane is None:
        return np.zeros_like(points)
    return np.asarray(-np.minimum(heights_over(plane, points), 0.0)[:, None] * plane[1])


def _size(assembly: solver.Assembly) -> np.ndarray:
    """(3,) array [m]: extents of the free blocks, or of all where there are none."""
    corners = assembly.vertices[assembly.free[assembly.block_of_vertex]]
    return np.asarray(np.ptp(corners if len(corners) else assembly.vertices, axis=0))


def _above(assembly: solver.Assembly) -> float:
    """Degrees above the level from which a structure is seen by default."""
    size = _size(assembly)
    # Slabs and floors from higher.
    return 38.0 if size[2] < 0.35 * min(size[:2]) else ABOVE


def first_alike(views: Sequence[View], worth: Callable[[View], float]) -> View:
    """Choose the first of views that are worth as much as the best one, but for :data:`ALIKE`."""
    worths = [worth(view) for view in views]
    return next(view for view, value in zip(views, worths, strict=True) if value >= max(worths) - ALIKE)


def chosen_view(response: solver.Response, motion: np.ndarray, views: list[View] | None = None) -> View:
    """Choose from where the motion of a structure is seen best: across it, and not behind what stands.

    ``motion`` (n_blocks, 3) is that of the centroids in the mechanism, in any scale; three-quarter views are tried by
    default.
    """
    assembly, path = response.assembly, response.path
    volumes, n = assembly.shapes.volumes, assembly.n_blocks
    weights = volumes * np.linalg.norm(motion, axis=1)
    if path:
        # What supports do before counts like the mechanism.
        moved = path[-1].pose.positions - assembly.centroids
        ways = volumes * np.linalg.norm(moved, axis=1)
        motion = motion / (weights.sum() or 1.0) + moved / (ways.sum() or 1.0)
        weights = volumes * np.linalg.norm(motion, axis=1)
    views = views or [View(around, _above(assembly)) for around in AROUND]
    if not weights.any():
        return views[0]
    middle = assembly.centroids[assembly.free].mean(axis=0) if assembly.free.any() else assembly.centroids.mean(axis=0)
    centre = weights @ assembly.centroids / weights.sum()
    states = path or response.increments
    lines = SightLines(assembly, states[-1 if path else 0].pose if states else solver.Pose.initial(assembly), weights)

    def worth(view: View) -> float:
        across = np.linalg.norm(motion @ view.axes[:2].T, axis=1)
        seen = float((volumes * lines.seen(view.axes, n)) @ across / weights.sum())
        front = IN_FRONT * float(view.depth((centre - middle)[None])[0]) / float(_size(assembly).max())
        # To look from the front, along y, is worth a little.
        return seen + front - 0.04 * float(view.axes[2, 1])

    return first_alike(views, worth)


def showing_faces(shapes: mechanics.Polyhedra, eye: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the face of each block that shows most of itself to an eye, hidden or not.

    ``eye`` (3,) is the unit vector to it. Returns the middle (n_blocks, 3) [m] of each face, its number, and its area
    as seen (n_blocks,) [m²].
    """
    faces = shapes.faces(shapes.vertices)
    showing = faces.areas * (faces.normals @ eye)
    order = np.lexsort((-showing, shapes.block_of_face))
    best = order[np.searchsorted(shapes.block_of_face[order], np.arange(len(shapes)))]
    return faces.middles[best], best, showing[best]
