"""Torsion of faces under a uniform pressure, a limit beside friction at their corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from solver.assembly import Assembly
from solver.geometry.broad_phase import expand_ranges
from solver.geometry.contacts import Contacts
from solver.geometry.outlines import polygon_integrals, turn
from solver.geometry.portions import alike, linked

#: Laws of torsion of the faces between blocks in space.
POINTS, UNIFORM = TORSIONS = ("points", "uniform")

#: Difference of normals, and distance in block sizes, up to which contact points of two blocks are of one face.
ONE_FACE = 1e-4

#: Part by which the polygon of a face's points may be larger than what touches there.
NOT_CONVEX = 0.01


@dataclass(frozen=True)
class Faces:
    """The faces of contact points in space, by the polygons that their points span.

    A radius is the mean distance of a polygon's points from its centroid: torsional strength over friction and normal
    force; of two points a quarter of their distance, of one zero.
    """

    face: np.ndarray  #: (n_contacts,) int
    radii: np.ndarray  #: (n_faces,) [m]
    areas: np.ndarray  #: (n_faces,) [m²]
    #: (5 n_faces, 3 n_contacts): from forces at the points to what limits a face: both components of its shear force T,
    #: its torsion over its radius, M / r, a row without entries, and friction, the sum of μ N.
    shares: sp.csr_array

    @property
    def first(self) -> np.ndarray:
        """(n_faces,) int array: first contact point of each."""
        return np.unique(self.face, return_index=True)[1]

    def beside(
        self, columns: sp.sparray, limits: sp.sparray, of_points: sp.sparray
    ) -> tuple[sp.csc_array, sp.csc_array]:
        """Columns of forces at points and limits of their coefficients, with two round cones of each face beside them.

        Five limits a face come first, equations: they are those of ``shares``, as the coefficients have them. What is
        |(T, M / r)| ≤ F is |T| ≤ P and |(P, M / r)| ≤ F, of slope 1 and with as many numbers as the cones of points:
        (P, T) and (F, P, M / r), which have the same P in the row without entries.
        """
        one, f = np.zeros((5, 6)), len(self.radii)
        one[[0, 1, 2, 3, 3, 4], [1, 2, 5, 4, 0, 3]] = [1.0, 1.0, 1.0, 1.0, -1.0, 1.0]
        cones = sp.kron(sp.eye_array(f), one)
        limits = sp.block_array([[-of_points, cones], [limits, None]], format="csc")
        return sp.csc_array(sp.hstack([columns, sp.csc_array((columns.shape[0], 6 * f))])), sp.csc_array(limits)

    @classmethod
    def of(cls, contacts: Contacts, length: float, friction: np.ndarray) -> Faces:
        """Gather contact points of the same two blocks, of a size [m], in the same plane; friction is of each, (n,)."""
        face = _faces(contacts, length)
        count = np.bincount(face)
        order, starts = np.argsort(face, kind="stable"), np.append(0, np.cumsum(count))
        centres, radii, areas = np.zeros((len(count), 3)), np.zeros(len(count)), np.zeros(len(count))
        for chosen, of_faces in alike((starts, np.arange(len(count)))):
            members = order[of_faces]
            points, frames = contacts.points[members], contacts.frames[members[:, 0]]
            centres[chosen], radii[chosen], areas[chosen] = _measured(points, frames)
        of_first = order[starts[face]]
        # On the block that is the first one of the face's first point, in the tangents of that.
        sign = np.where(contacts.block_a == contacts.block_a[of_first], 1.0, -1.0)
        along = contacts.frames[of_first][:, [1, 2, 0]]
        # Where the radius is zero all points are at the centre.
        arms = (contacts.points - centres[face]) / np.maximum(radii, 1e-300)[face, None]
        along[:, 2] = np.cross(along[:, 2], arms)
        parts = np.zeros((len(face), 5, 3))
        parts[:, :3, 1:] = sign[:, None, None] * np.einsum("kix,kjx->kij", along, contacts.frames[:, 1:])
        parts[:, 4, 0] = friction
        shape = 5 * len(count), 3 * len(face)
        return cls(face, radii, areas, sp.csr_array(sp.bsr_array((parts[order], order, starts), shape=shape)))

    def refuse_not_convex(self, contacts: Contacts, assembly: Assembly) -> None:
        """Raise ``ValueError`` where the polygon of points is larger than what touches there."""
        wide = self.first[self.areas > (1.0 + NOT_CONVEX) * np.bincount(self.face, contacts.areas)]
        if len(wide):
            one, other = (assembly.names[of[wide[0]]] for of in (contacts.block_a, contacts.block_b))
            raise ValueError(
                f"torsion is 'uniform', but '{one}' and '{other}' do not touch on all of a convex face; take torsion = "
                "'points', or cut the stone into convex ones"
            )


def _faces(contacts: Contacts, length: float) -> np.ndarray:
    """(n_contacts,) int array: number of the face of each contact point."""
    n, (_, joint) = len(contacts), contacts.joints()
    order, ends = np.argsort(joint, kind="stable"), np.cumsum(np.bincount(joint))
    # Every point with each that follows in its joint.
    first, position = expand_ranges(ends[joint[order]] - np.arange(1, n + 1))
    one, other = order[first], order[first + 1 + position]
    normal = contacts.frames[one, 0]
    distance = np.abs(((contacts.points[one] - contacts.points[other]) * normal).sum(axis=1))
    # Either block may be the first of a contact point.
    sign = np.where(contacts.block_a[one] == contacts.block_a[other], 1.0, -1.0)
    normal_difference = np.linalg.norm(normal - sign[:, None] * contacts.frames[other, 0], axis=1)
    same = (distance <= ONE_FACE * length) & (normal_difference <= ONE_FACE)
    return linked(np.stack([one[same], other[same]]), n)


def _measured(points: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centroids (n, 3), mean distances and areas (n,) of convex polygons with corners (n, k, 3) in any order."""
    middle = points.mean(axis=1)
    if points.shape[1] < 3:
        return middle, np.linalg.norm(points[:, 0] - points[:, -1], axis=1) / 4.0, np.zeros(len(points))
    flat = np.einsum("nkx,nix->nki", points - middle[:, None], frames[:, 1:])
    angular_order = np.argsort(np.arctan2(flat[..., 1], flat[..., 0]), axis=1)
    flat = np.take_along_axis(flat, angular_order[..., None], axis=1)
    area, centre = polygon_integrals(flat.reshape(-1, 2), points.shape[1] * np.arange(len(points) + 1))
    # Points on one line have no area.
    wide = area > 1e-12 * (flat**2).sum(axis=(1, 2))
    centre = np.where(wide[:, None], centre, 0.0)
    flat = flat - centre[:, None]
    start, end = flat, np.roll(flat, -1, axis=1)
    edge = end - start
    size = np.linalg.norm(edge, axis=2)
    along = edge / np.where(size > 0.0, size, 1.0)[..., None]
    # Of the triangle from the centre to an edge at a height h: ∫ |x| dA = h / 6 (t √(t² + h²) + h² asinh (t / h)).
    height = turn(start, along)
    mean = np.zeros(len(points))
    for corner, sign in ((end, 1.0), (start, -1.0)):
        t = (corner * along).sum(axis=2)
        over = np.divide(t, height, out=np.zeros_like(t), where=height > 0.0)
        mean += sign * (height / 6.0 * (t * np.hypot(t, height) + height**2 * np.arcsinh(over))).sum(axis=1)
    farthest = np.linalg.norm(flat[:, :, None] - flat[:, None], axis=3).max(axis=(1, 2))
    radii = np.where(wide, mean / np.where(wide, area, 1.0), farthest / 4.0)
    return middle + np.einsum("ni,nix->nx", centre, frames[:, 1:]), radii, area
