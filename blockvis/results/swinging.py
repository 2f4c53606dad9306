"""Pseudo-motion: blocks that swing out of a state with the motion that follows it, to first order, out of scale."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import solver
from solver import mechanics

#: How far the fastest block of a mechanism is swung to be shown, in extents of the structure.
SWING = 0.05


def corner_speeds(assembly: solver.Assembly, pose: solver.Pose, motion: np.ndarray) -> np.ndarray:
    """(n_blocks,) array: speed of the fastest corner of each block in a motion (n_blocks, n_dof), zero for supports."""
    block = assembly.block_of_vertex
    velocity = mechanics.point_velocities(mechanics.moved_vertices(assembly, pose), block, pose, motion)
    speeds = np.zeros(assembly.n_blocks)
    np.maximum.at(speeds, block, np.hypot.reduce(velocity, axis=1))
    return np.where(assembly.free, speeds, 0.0)


def swing_factors(
    assembly: solver.Assembly, increment: solver.Increment, reach: float, shares: np.ndarray
) -> np.ndarray:
    """(n,) array: factors on the motion that follows with which the fastest corner goes shares (n,) of a reach.

    The reach is in extents of the free blocks. Zero where nothing moves.
    """
    fastest = float(corner_speeds(assembly, increment.pose, increment.velocity).max(initial=0.0))
    if fastest == 0.0:
        return np.zeros(len(shares))
    corners = mechanics.moved_vertices(assembly, increment.pose)[assembly.free[assembly.block_of_vertex]]
    return np.asarray(shares * (reach * float(np.ptp(corners, axis=0).max())) / fastest)


def swung_increment(increment: solver.Increment, motion: np.ndarray) -> solver.Increment:
    """Give the blocks of a state after a motion (n_blocks, n_dof), with its contact points carried along."""
    contacts, pose = increment.contacts, mechanics.swung(increment.pose, motion)
    points = mechanics.carried_between(contacts.points, contacts.block_a, contacts.block_b, increment.pose, pose)
    moved = increment.with_arrays(pose=pose, contacts=replace(contacts, points=points))
    return replace(moved, status=solver.Status.FALLING, programs=0, seconds=0.0, checkpoint=None)
