"""Solids as flat arrays: their faces, edges, volumes, centroids and inertia; every loop runs in numpy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from solver.words import kept

from .broad_phase import expand_ranges
from .outlines import Bodies, next_vertices

#: Part of lengths, volumes and directions up to which two are equal: corners of hulls are welded at a tenth of it.
ROUNDING = 1e-6


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(..., 3) array: cross products, a coordinate at a time, which is faster than ``np.cross``."""
    return stacked([a[..., i] * b[..., j] - a[..., j] * b[..., i] for i, j in ((1, 2), (2, 0), (0, 1))])


def dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(...) array: dot products along the last axis, coordinate by coordinate: its sum takes ten times as long."""
    total = first[..., 0] * second[..., 0]
    for k in range(1, first.shape[-1]):
        total += first[..., k] * second[..., k]
    return total


def stacked(coordinates: Sequence[np.ndarray]) -> np.ndarray:
    """(..., d) array: vectors by their coordinates, each of which stays together in memory: numpy is fast along it."""
    together = np.concatenate([coordinate[None] for coordinate in coordinates])
    return together.transpose(*range(1, together.ndim), 0)


def taken(vectors: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """(..., d) array: vectors, (n, d), of these numbers, with each coordinate together in memory."""
    return vectors.T.take(numbers.T, axis=-1).T


def unit(vectors: np.ndarray) -> np.ndarray:
    """(..., 3) array: vectors of length one; those of length zero stay so."""
    return vectors / np.maximum(np.sqrt(dot(vectors, vectors)), 1e-300)[..., None]


@dataclass(frozen=True)
class Faces:
    """Planes of faces, with a direction along each."""

    normals: np.ndarray  #: (n_faces, 3): unit vectors that point out of the solid
    tangents: np.ndarray  #: (n_faces, 3): unit vectors along the longest edge of each face
    middles: np.ndarray  #: (n_faces, 3) [m]: means of the corners
    areas: np.ndarray  #: (n_faces,) [m²]


@dataclass(frozen=True)
class Solids(Bodies):
    """Closed surfaces of plane faces as flat arrays, and what follows from their drawing.

    Corners are the vertices around all faces, face after face, counter-clockwise seen from outside: those of a face run
    from its offset to the next. A corner also names the edge that starts there.
    """

    corners: np.ndarray  #: (n_corners,) int
    face_offsets: np.ndarray  #: (n_faces + 1,) int
    block_of_face: np.ndarray  #: (n_faces,) int, ascending: the solid each face belongs to

    @classmethod
    def of_surfaces(cls, surfaces: Sequence[tuple[np.ndarray, list[list[int]]]]) -> Self:
        """Put surfaces, corners (n, 3) [m] and their numbers around each face, into flat arrays one after another."""
        offsets = np.concatenate([[0], np.cumsum([len(vertices) for vertices, _ in surfaces])])
        sizes = [len(face) for _, faces in surfaces for face in faces]
        counts = [sum(map(len, faces)) for _, faces in surfaces]
        corners = np.array([corner for _, faces in surfaces for face in faces for corner in face], dtype=np.int64)
        return cls(
            vertices=np.concatenate([vertices for vertices, _ in surfaces]),
            offsets=offsets,
            corners=corners + np.repeat(offsets[:-1], counts),
            face_offsets=np.concatenate([[0], np.cumsum(sizes)]),
            block_of_face=np.repeat(np.arange(len(surfaces)), [len(faces) for _, faces in surfaces]),
        )

    def surface(self, block: int) -> tuple[np.ndarray, list[list[int]]]:
        """Corners (n, 3) [m] of one solid, and their numbers around each of its faces."""
        start, stop = self.offsets[block : block + 2]
        ends = self.face_offsets[self.faces_of_block[block] : self.faces_of_block[block + 1] + 1]
        loops = np.split(self.corners[ends[0] : ends[-1]] - start, ends[1:-1] - ends[0])
        return self.vertices[start:stop], [loop.tolist() for loop in loops]

    @kept
    def faces_of_block(self) -> np.ndarray:
        """(n + 1,) int array: solid ``i`` owns the faces from entry ``i`` to entry ``i + 1``."""
        return np.searchsorted(self.block_of_face, np.arange(len(self) + 1))

    @kept
    def face_of_corner(self) -> np.ndarray:
        """(n_corners,) int array: the face each corner belongs to."""
        return np.repeat(np.arange(len(self.face_offsets) - 1), np.diff(self.face_offsets))

    @kept
    def next_corner(self) -> np.ndarray:
        """(n_corners,) int array: the corner that follows around the face; edge k runs from corner k to it."""
        return next_vertices(self.face_offsets)

    @kept
    def previous_corner(self) -> np.ndarray:
        """(n_corners,) int array: the corner before."""
        return np.argsort(self.next_corner)

    @kept
    def twins(self) -> np.ndarray:
        """(n_corners,) int array: the same edge, run through the other way around the face beyond it."""
        n = np.int64(len(self.vertices))
        start, end = self.corners.astype(np.int64), self.corners[self.next_corner].astype(np.int64)
        order = np.argsort(start * n + end)
        return order[np.searchsorted((start * n + end)[order], end * n + start)]

    @kept
    def whole_edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Every edge once, by its corner, and (n + 1,) where those of each solid begin."""
        once = np.flatnonzero(np.arange(len(self.corners)) < self.twins)
        return once, np.searchsorted(once, self.face_offsets[self.faces_of_block])

    @kept
    def edge_lengths(self) -> np.ndarray:
        """(n_corners,) array [m]: length of the edge that starts at each corner."""
        along = self.vertices[self.corners[self.next_corner]] - self.vertices[self.corners]
        return np.sqrt(dot(along, along))

    @kept
    def shortest_edges(self) -> np.ndarray:
        """(n_faces,) array [m]: length of the shortest edge of each face."""
        return np.minimum.reduceat(self.edge_lengths, self.face_offsets[:-1])

    @kept
    def longest_edges(self) -> np.ndarray:
        """(n_faces,) int array: the longest edge of each face, the first of equal ones."""
        order = np.lexsort((-np.arange(len(self.corners)), self.edge_lengths, self.face_of_corner))
        return order[self.face_offsets[1:] - 1]

    def faces(self, vertices: np.ndarray) -> Faces:
        """Planes of the faces where the corners now are, (n_vertices, 3) [m]."""
        starts, counts = self.face_offsets[:-1], np.diff(self.face_offsets)
        points = taken(vertices, self.corners)
        arms = points - taken(points, starts[self.face_of_corner])
        areas = np.add.reduceat(cross(arms, taken(arms, self.next_corner)), starts) / 2.0
        normals = unit(areas)
        along = points[self.next_corner[self.longest_edges]] - points[self.longest_edges]
        along = along - dot(along, normals)[:, None] * normals
        middles = points[starts] + np.add.reduceat(arms, starts) / counts[:, None]
        normals, along, middles = map(np.asfortranarray, (normals, unit(along), middles))
        return Faces(normals, along, middles, np.sqrt(dot(areas, areas)))

    @kept
    def face_widths(self) -> np.ndarray:
        """(n_faces,) array [m]: area over longest extent of each face, near b for a long a × b."""
        faces = self.faces(self.vertices)
        arms = self.vertices[self.corners] - faces.middles[self.face_of_corner]
        far = np.maximum.reduceat(np.sqrt(dot(arms, arms)), self.face_offsets[:-1])
        return faces.areas / (2.0 * far)

    @kept
    def surfaces(self) -> np.ndarray:
        """(n,) array [m²]: area of all faces of each solid."""
        return np.add.reduceat(self.faces(self.vertices).areas, self.faces_of_block[:-1])

    @kept
    def _integrals(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Volumes, centroids, and the second moments about them."""
        face, position = expand_ranges(np.diff(self.face_offsets) - 2)
        solid, corner = self.block_of_face[face], self.face_offsets[face]
        triangles = self.corners[np.stack([corner, corner + position + 1, corner + position + 2], axis=1)]
        first = np.searchsorted(solid, np.arange(len(self)))
        # From the first vertex of each solid, so that coordinates far from the origin (UTM) lose no digits.
        origin = self.vertices[self.offsets[:-1]]
        a, b, c = np.moveaxis(self.vertices[triangles] - origin[solid][:, None], 1, 0)
        six = dot(a, cross(b, c))
        volumes = np.add.reduceat(six, first) / 6.0
        total = a + b + c
        with np.errstate(divide="ignore", invalid="ignore"):
            centroids = np.add.reduceat(total * six[:, None], first) / (24.0 * volumes[:, None])
        # Of a tetrahedron with one corner at the origin: V/20 (sum of corners ⊗ itself + sum of each corner ⊗ itself).
        squares = total[:, :, None] * total[:, None, :]
        for corner in (a, b, c):
            squares = squares + corner[:, :, None] * corner[:, None, :]
        moments = np.add.reduceat(squares * (six / 120.0)[:, None, None], first)
        moments = moments - volumes[:, None, None] * centroids[:, :, None] * centroids[:, None, :]
        return volumes, origin + centroids, moments

    @property
    def volumes(self) -> np.ndarray:
        """(n,) array [m³]: positive where the faces run counter-clockwise seen from outside."""
        return self._integrals[0]

    @property
    def centroids(self) -> np.ndarray:
        """(n, 3) array [m], before any movement."""
        return self._integrals[1]

    @property
    def inertia(self) -> np.ndarray:
        """(n, 3, 3) array [m⁵]: moments of inertia of unit density about the centroids, axes of the drawing."""
        moments = self._integrals[2]
        return np.trace(moments, axis1=1, axis2=2)[:, None, None] * np.eye(3) - moments

    @kept
    def widths(self) -> np.ndarray:
        """(n,) array [m]: twice the volume over the surface of each solid, near c for a flat a × b × c."""
        return 2.0 * self.volumes / self.surfaces
