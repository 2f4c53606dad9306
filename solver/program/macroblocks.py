"""Macro-blocks: blocks that a motion leaves together, and the few freedoms they have as one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from solver.assembly import Assembly
from solver.geometry.contacts import Contacts
from solver.kinematics import Pose, moving_together, rotation_count


@dataclass(frozen=True)
class MacroBlocks:
    """Groups of blocks that move as one.

    Attributes
    ----------
    part : (n_blocks,) int array
        Number of the group each free block belongs to; -1 for supports and what moves with them.
    motions : (n_dof n_blocks, n_dof n_parts) sparse array
        From the movements of the groups to those of all blocks, in units of the program.
    """

    part: np.ndarray
    motions: sp.csr_array

    @property
    def n_parts(self) -> int:
        """Number of groups that are free to move."""
        return int(self.part.max(initial=-1)) + 1


def free_blocks(assembly: Assembly) -> MacroBlocks:
    """Every free block for itself."""
    free, d = assembly.free, assembly.centroids.shape[1]
    n_dof = d + rotation_count(d)
    freedoms = np.flatnonzero(np.repeat(free, n_dof))
    shape = (n_dof * assembly.n_blocks, len(freedoms))
    entries = (np.ones(len(freedoms)), (freedoms, np.arange(len(freedoms))))
    return MacroBlocks(np.where(free, np.cumsum(free) - 1, -1), sp.csr_array(entries, shape=shape))


def macro_blocks(
    assembly: Assembly,
    pose: Pose,
    contacts: Contacts,
    apart: np.ndarray,
    rotations: np.ndarray,
    length: float,
    together: float,
) -> MacroBlocks:
    """Groups of blocks that a motion leaves together.

    Parameters
    ----------
    assembly : Assembly
    pose : Pose
        About its positions the groups turn.
    contacts : Contacts
    apart : (n_contacts,) array [m]
        Relative movement of each contact point.
    rotations : (n_blocks, n_rot) array [rad]
    length : float [m]
        Unit of the program.
    together : float [m]
        Blocks whose contact points move apart by less than this move together.
    """
    n = assembly.n_blocks
    group = moving_together(n, contacts, apart, rotations * length, together)
    held = np.zeros(int(group.max()) + 1, dtype=bool)
    held[group[~assembly.free]] = True
    part = np.full(len(held), -1)
    part[~held] = np.arange(np.count_nonzero(~held))
    part = part[group]
    block = np.flatnonzero(part >= 0)
    mine, count = part[block], np.count_nonzero(~held)
    size = np.bincount(mine, minlength=count)
    centre = np.stack([np.bincount(mine, pose.positions[block, k], minlength=count) / size for k in (0, 1)], axis=1)
    arm = (pose.positions[block] - centre[mine]) / length
    # A group turns about its middle; the unit of its rotation is such that its farthest block moves by about one.
    radius = np.ones(count)
    np.maximum.at(radius, mine, np.abs(arm).max(axis=1))
    turn = 1.0 / radius[mine]
    rows = 3 * block[:, None] + np.array([0, 1, 2, 0, 1])
    columns = 3 * mine[:, None] + np.array([0, 1, 2, 2, 2])
    one = np.ones(len(block))
    values = np.stack([one, one, turn, -arm[:, 1] * turn, arm[:, 0] * turn], axis=1)
    entries = (values.ravel(), (rows.ravel(), columns.ravel()))
    return MacroBlocks(part, sp.csr_array(entries, shape=(3 * n, 3 * count)))
