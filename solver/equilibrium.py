"""Equilibrium of the blocks under contact forces; its transpose is compatibility."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from .geometry.contacts import Contacts
from .geometry.outlines import turn
from .geometry.solids import cross
from .kinematics import Pose


def wrench_matrix(contacts: Contacts, pose: Pose, length: float = 1.0) -> sp.csc_array:
    """Make the matrix of forces and moments on every block from unit forces at the contact points.

    Parameters
    ----------
    contacts : Contacts
    pose : Pose
        Moments are taken about its positions.
    length : float [m]
        Moments are divided by it, which balances the rows of the program.

    Returns
    -------
    (n_dof n_blocks, d n_contacts) sparse array
        Rows of block 0 (in the plane fx, fy, moment), then of block 1 ...; columns normal and shear forces of
        contact 0, then of contact 1 .... Its transpose maps movements of the blocks to relative displacements
        (a minus b) of the contact points.
    """
    frames, (n, d) = contacts.frames, contacts.points.shape
    n_dof = d + pose.rotations.shape[1]
    # Column by column: the entries of block a, then of block b.
    data, index = np.empty((n, d, 2, n_dof)), np.empty((n, d, 2, n_dof), dtype=np.int64)
    for side, (blocks, sign) in enumerate(((contacts.block_a, 1.0), (contacts.block_b, -1.0))):
        # The ground, -1, has no rows.
        sense, block = np.where(blocks < 0, 0.0, sign)[:, None, None], np.maximum(blocks, 0)
        arms = (contacts.points - pose.positions[block])[:, None]
        # Coordinate by coordinate, as the rounding of small matrix products depends on the processor.
        moment = cross(arms, frames) if d == 3 else turn(arms, frames)[..., None]
        data[:, :, side, :d], data[:, :, side, d:] = sense * frames, sense * (moment / length)
        index[:, :, side] = (n_dof * block[:, None] + np.arange(n_dof))[:, None]
    pointers = np.arange(0, 2 * n_dof * d * n + 1, 2 * n_dof)
    return sp.csc_array((data.ravel(), index.ravel(), pointers), shape=(n_dof * len(pose.positions), d * n))


def friction_rays(friction: np.ndarray) -> sp.csc_array:
    """(2 n, 2 n) sparse array: the rays n - μ t and n + μ t of contact i in the plane, in columns 2i and 2i + 1."""
    n = len(friction)
    # As long for every coefficient, so that a large one does not unbalance the program.
    scale = 1.0 / np.hypot(1.0, friction)
    values = np.empty((n, 2, 2))
    values[:, :, 0] = scale[:, None]
    values[:, :, 1] = (friction * scale)[:, None] * [-1.0, 1.0]
    rows = np.broadcast_to(2 * np.arange(n)[:, None, None] + np.arange(2), values.shape)
    return sp.csc_array((values.ravel(), rows.ravel(), np.arange(0, 4 * n + 1, 2)), shape=(2 * n, 2 * n))


def block_forces(contacts: Contacts, pose: Pose, forces: np.ndarray) -> np.ndarray:
    """(n_blocks, n_dof) array [N, N·m]: resultant of the contact forces on every block, moments about its centroid.

    Of normal forces, compression positive, and shear forces on ``block_a``, (n_contacts, d) [N].
    """
    return (wrench_matrix(contacts, pose) @ forces.ravel()).reshape(len(pose.positions), -1)
