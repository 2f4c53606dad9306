"""The view of blocks in space: from where they are seen, the same in all pictures of a response."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

import solver
from solver import mechanics

#: Directions that are tried, from the structure to the eye: three-quarter views, in degrees around and above the level.
AROUND = (-60.0, -30.0, -120.0, -150.0, 30.0, 60.0, 120.0, 150.0)
ABOVE = 24.0

#: Degrees above the level for what is lower than this part of its smaller side in plan: slabs and floors.
LOW, ABOVE_LOW = 0.35, 38.0

#: What it is worth to have what moves in front, beside seeing all of its motion; and to look from the front, along y.
IN_FRONT, FROM_THE_FRONT = 0.35, 0.04

#: Directions in which a motion is seen as well as in the best one, within this part, are equal.
ALIKE = 0.02


@dataclass(frozen=True)
class View:
    """A parallel projection.

    Attributes
    ----------
    around, above : float [degrees]
        Of the direction to the eye: counter-clockwise from x, and above the level.
    """

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


def chosen_view(response: solver.Response, motion: np.ndarray) -> View:
    """Choose from where the motion of a structure is seen best: across it, with what moves in front.

    Parameters
    ----------
    response : solver.Response
    motion : (n_blocks, 3) array [m]
        Of the centroids, in any scale: of the mechanism.
    """
    assembly = response.assembly
    corners = assembly.vertices[assembly.free[assembly.block_of_vertex]]
    size = np.ptp(corners if len(corners) else assembly.vertices, axis=0)
    above = ABOVE_LOW if size[2] < LOW * min(size[:2]) else ABOVE
    weights = assembly.shapes.volumes * np.linalg.norm(motion, axis=1)
    path = response.path
    if path:
        # What supports do before counts like the mechanism.
        moved = path[-1].pose.positions - assembly.centroids
        own = assembly.shapes.volumes * np.linalg.norm(moved, axis=1)
        motion = _scaled(motion, weights) + _scaled(moved, own)
        weights = assembly.shapes.volumes * np.linalg.norm(motion, axis=1)
    views = [View(around, above) for around in AROUND]
    if not weights.any():
        return views[0]
    middle = assembly.centroids[assembly.free].mean(axis=0) if assembly.free.any() else assembly.centroids.mean(axis=0)
    centre = weights @ assembly.centroids / weights.sum()
    seen = [
        float((assembly.shapes.volumes * np.linalg.norm(motion @ view.axes[:2].T, axis=1)).sum() / weights.sum())
        + IN_FRONT * float(view.depth((centre - middle)[None])[0]) / float(size.max())
        - FROM_THE_FRONT * float(view.axes[2, 1])
        for view in views
    ]
    best = max(seen)
    return next(view for view, value in zip(views, seen, strict=True) if value >= best - ALIKE)


def _scaled(motion: np.ndarray, weights: np.ndarray) -> np.ndarray:
    return motion / weights.sum() if weights.any() else np.zeros_like(motion)


def showing_faces(shapes: mechanics.Polyhedra, eye: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the face of each block that shows most of itself, hidden or not.

    Parameters
    ----------
    shapes : solver.mechanics.Polyhedra
    eye : (3,) array
        Unit vector to the eye.

    Returns
    -------
    places : (n_blocks, 3) array [m]
        Its middle.
    faces : (n_blocks,) int array
    showing : (n_blocks,) array [m²]
        Its area as seen.
    """
    faces = shapes.faces(shapes.vertices)
    showing = shapes.face_areas * (faces.normals @ eye)
    order = np.lexsort((-showing, shapes.block_of_face))
    best = order[np.searchsorted(shapes.block_of_face[order], np.arange(len(shapes)))]
    return faces.middles[best], best, showing[best]
