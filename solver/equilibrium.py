"""Equilibrium of the blocks under contact forces; its transpose is compatibility."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from .geometry.contacts import Contacts
from .kinematics import Pose


def equilibrium_matrix(contacts: Contacts, pose: Pose, length: float = 1.0) -> sp.csc_array:
    """Forces and moments on every block from unit normal and shear forces at the contact points.

    Parameters
    ----------
    contacts : Contacts
    pose : Pose
        Moments are taken about its positions.
    length : float [m]
        Moments are divided by it, which balances the rows of the program.

    Returns
    -------
    (3 n_blocks, 2 n_contacts) sparse array
        Rows fx, fy, moment of block 0, then of block 1 ...; columns normal and shear force of contact 0,
        then of contact 1 .... Its transpose maps movements of the blocks to relative displacements (a minus b)
        of the contact points.
    """
    n, n_blocks = len(contacts), len(pose.rotations)
    rows, values = [], []
    for block, sign in ((contacts.block_a, 1.0), (contacts.block_b, -1.0)):
        arm = contacts.points - pose.positions[block]
        for axis in (0, 1):
            f = contacts.frames[:, axis]
            moment = (arm[:, 0] * f[:, 1] - arm[:, 1] * f[:, 0]) / length
            values.append(sign * np.stack([f[:, 0], f[:, 1], moment], axis=1))
            rows.append(3 * block[:, None] + np.arange(3))
    # Column by column: the entries of block a, then of block b, for the normal and then for the shear force.
    values_by_column = np.stack([np.hstack([values[0], values[2]]), np.hstack([values[1], values[3]])], axis=1)
    rows_by_column = np.stack([np.hstack([rows[0], rows[2]]), np.hstack([rows[1], rows[3]])], axis=1)
    pointers = np.arange(0, 12 * n + 1, 6)
    return sp.csc_array((values_by_column.ravel(), rows_by_column.ravel(), pointers), shape=(3 * n_blocks, 2 * n))


def compatibility_matrix(contacts: Contacts, pose: Pose, length: float = 1.0) -> sp.csr_array:
    """Transpose of :func:`equilibrium_matrix`, (2 n_contacts, 3 n_blocks)."""
    return sp.csr_array(equilibrium_matrix(contacts, pose, length).T)


def cone_rays(friction: np.ndarray) -> sp.csc_array:
    """The two edges of each friction cone as combinations of normal and shear force.

    Parameters
    ----------
    friction : (n,) array
        Friction coefficients.

    Returns
    -------
    (2 n, 2 n) sparse array
        Column 2k is n - μ t, column 2k + 1 is n + μ t of contact k, divided by √(1 + μ²) so that a
        large coefficient does not unbalance the program.
    """
    n = len(friction)
    scale = 1.0 / np.hypot(1.0, friction)
    values = np.stack([scale, -friction * scale, scale, friction * scale], axis=1).ravel()
    first = 2 * np.arange(n)
    rows = np.stack([first, first + 1, first, first + 1], axis=1).ravel()
    return sp.csc_array((values, rows, np.arange(0, 4 * n + 1, 2)), shape=(2 * n, 2 * n))


def with_slack(*columns: sp.csc_array) -> sp.csc_array:
    """The columns of a program side by side, a unit column of either sign per row after the first block.

    Parameters
    ----------
    *columns : (m, n_k) sparse arrays, by columns

    Returns
    -------
    (m, n_1 + 2 m + n_2 + ...) sparse array
    """
    rows = columns[0].shape[0]
    unit, pointers = np.arange(rows), np.arange(rows + 1)
    parts = [(columns[0].data, columns[0].indices, columns[0].indptr)]
    parts += [(np.full(rows, sign), unit, pointers) for sign in (1.0, -1.0)]
    parts += [(block.data, block.indices, block.indptr) for block in columns[1:]]
    starts = np.cumsum([0] + [len(data) for data, _, _ in parts])
    indptr = np.concatenate([[0]] + [start + p[1:] for start, (_, _, p) in zip(starts, parts, strict=False)])
    data, indices = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    return sp.csc_array((data, indices, indptr), shape=(rows, len(indptr) - 1))


def block_forces(contacts: Contacts, pose: Pose, forces: np.ndarray) -> np.ndarray:
    """Resultant of the contact forces on every block, moments about its centroid.

    Parameters
    ----------
    contacts : Contacts
    pose : Pose
    forces : (n_contacts, 2) array [N]
        Normal (compression positive) and shear force at each contact point, on ``block_a``.

    Returns
    -------
    (n_blocks, 3) array [N, N, N·m]
    """
    return (equilibrium_matrix(contacts, pose) @ forces.ravel()).reshape(-1, 3)
