"""Torsion of faces under a uniform pressure, in place of friction at their corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from solver.assembly import Assembly
from solver.equilibrium import wrench_matrix
from solver.geometry.contacts import Contacts
from solver.geometry.outlines import polygon_integrals
from solver.kinematics import Pose

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
    centres: np.ndarray  #: (n_faces, 3) [m]
    radii: np.ndarray  #: (n_faces,) [m]
    areas: np.ndarray  #: (n_faces,) [m²]

    @property
    def first(self) -> np.ndarray:
        """(n_faces,) int array: first contact point of each."""
        return np.unique(self.face, return_index=True)[1]

    @classmethod
    def of(cls, contacts: Contacts, length: float) -> Faces:
        """Gather contact points of the same two blocks, of a size [m], in the same plane."""
        face = _faces(contacts, length)
        count = np.bincount(face)
        order, first = np.argsort(face, kind="stable"), np.cumsum(count) - count
        centres, radii, areas = np.zeros((len(count), 3)), np.zeros(len(count)), np.zeros(len(count))
        for corners in np.unique(count):
            chosen = np.flatnonzero(count == corners)
            members = order[first[chosen][:, None] + np.arange(corners)]
            points, frames = contacts.points[members], contacts.frames[members[:, 0]]
            centres[chosen], radii[chosen], areas[chosen] = _measured(points, frames)
        return cls(face, centres, radii, areas)

    def refuse_not_convex(self, contacts: Contacts, assembly: Assembly) -> None:
        """Raise ``ValueError`` where the polygon of points is larger than what touches there."""
        wide = self.first[self.areas > (1.0 + NOT_CONVEX) * np.bincount(self.face, contacts.areas)]
        if len(wide):
            one, other = (assembly.names[of[wide[0]]] for of in (contacts.block_a, contacts.block_b))
            raise ValueError(
                f"torsion is 'uniform', but '{one}' and '{other}' do not touch on all of a convex face; take torsion = "
                "'points', or cut the stone into convex ones"
            )


def face_wrench_matrix(contacts: Contacts, faces: Faces, pose: Pose, length: float) -> sp.csc_array:
    """Make the matrix of :func:`solver.equilibrium.wrench_matrix` with shear and torsion at the centre of each face.

    Of the 4 n_contacts columns each contact point has: normal force, there; both shear forces, at the centre of its
    face; torsion over the radius of the face.

    A face limited by |(T, M / r)| ≤ μ N, with N the sum over its points, is the sum of as many cones of four numbers,
    one for each of its points.
    """
    n = len(contacts)
    # The tangents of a face are those of its first point.
    frames, centres = contacts.frames[faces.first][faces.face], faces.centres[faces.face]
    at_points = wrench_matrix(contacts, pose, length)[:, 3 * np.arange(n)]
    at_centre = wrench_matrix(Contacts(**{**vars(contacts), "points": centres, "frames": frames}), pose, length)
    shear = at_centre[:, np.setdiff1d(np.arange(3 * n), 3 * np.arange(n))]
    moment = (faces.radii[faces.face] / length)[:, None] * frames[:, 0]
    spins = [6 * block[:, None] + np.arange(3, 6) for block in (contacts.block_a, contacts.block_b)]
    rows = np.concatenate(spins, axis=1)
    columns = np.broadcast_to(np.arange(n)[:, None], rows.shape)
    values = np.concatenate([moment, -moment], axis=1)
    twist = sp.coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=(at_points.shape[0], n))
    order = np.stack([np.arange(n), n + 2 * np.arange(n), n + 2 * np.arange(n) + 1, 3 * n + np.arange(n)], axis=1)
    return sp.csc_array(sp.hstack([at_points, shear, twist], format="csc")[:, order.ravel()])


def point_forces(contacts: Contacts, faces: Faces, forces: np.ndarray) -> np.ndarray:
    """(n_contacts, 3) array: forces at the points with the same resultants as those (n_contacts, 4) of their faces."""
    face, count = faces.face, np.bincount(faces.face)
    frames = contacts.frames[faces.first]
    # On the block that is the first one of the face's first point.
    sign = np.where(contacts.block_a == contacts.block_a[faces.first][face], 1.0, -1.0)
    totals = np.stack([np.bincount(face, sign * part) for part in forces.T], axis=1)
    shear = np.einsum("fi,fix->fx", totals[:, 1:3], frames[:, 1:])
    middle = np.stack([np.bincount(face, part) / count for part in contacts.points.T], axis=1)
    arms = contacts.points - middle[face]
    # Equal shares move it from the centre of the face to the middle of its points.
    moved = np.einsum("fx,fx->f", np.cross(middle - faces.centres, shear), frames[:, 0])
    spread = np.bincount(face, (arms**2).sum(axis=1))
    torsion = np.divide(totals[:, 3] * faces.radii - moved, spread, out=np.zeros(len(count)), where=spread > 0.0)
    shared = (shear / count[:, None])[face] + torsion[face, None] * np.cross(frames[face, 0], arms)
    shared *= sign[:, None]
    return np.concatenate([forces[:, :1], np.einsum("kix,kx->ki", contacts.frames[:, 1:], shared)], axis=1)


def _faces(contacts: Contacts, length: float) -> np.ndarray:
    """(n_contacts,) int array: number of the face of each contact point."""
    n = len(contacts)
    _, joint = contacts.joints()
    order, count = np.argsort(joint, kind="stable"), np.bincount(joint)
    first = np.cumsum(count) - count
    links = []
    for points in np.unique(count):
        members = order[first[count == points][:, None] + np.arange(points)]
        i, j = np.triu_indices(points, 1)
        one, other = members[:, i].ravel(), members[:, j].ravel()
        normal = contacts.frames[one, 0]
        distance = np.abs(((contacts.points[one] - contacts.points[other]) * normal).sum(axis=1))
        # Either block may be the first of a contact point.
        sign = np.where(contacts.block_a[one] == contacts.block_a[other], 1.0, -1.0)
        normal_difference = np.linalg.norm(normal - sign[:, None] * contacts.frames[other, 0], axis=1)
        alike = (distance <= ONE_FACE * length) & (normal_difference <= ONE_FACE)
        links.append(np.stack([one[alike], other[alike]]))
    pairs = np.concatenate(links, axis=1)
    graph = sp.coo_array((np.ones(pairs.shape[1]), (pairs[0], pairs[1])), shape=(n, n))
    return connected_components(graph, directed=False)[1]


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
    height = start[..., 0] * along[..., 1] - start[..., 1] * along[..., 0]
    mean = np.zeros(len(points))
    for corner, sign in ((end, 1.0), (start, -1.0)):
        t = (corner * along).sum(axis=2)
        over = np.divide(t, height, out=np.zeros_like(t), where=height > 0.0)
        mean += sign * (height / 6.0 * (t * np.hypot(t, height) + height**2 * np.arcsinh(over))).sum(axis=1)
    farthest = np.linalg.norm(flat[:, :, None] - flat[:, None], axis=3).max(axis=(1, 2))
    radii = np.where(wide, mean / np.where(wide, area, 1.0), farthest / 4.0)
    return middle + np.einsum("ni,nix->nx", centre, frames[:, 1:]), radii, area
