"""Whether a limit load has other mechanisms than the one that was found, at the same multiplier."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

import solver
from solver import mechanics

from .about import EXACT

#: Points with less than this part of the largest force have none, and what is within it of its bound has reached it.
CARRIES, USED_UP = 1e-7, 1e-5

#: Of movements up to 1, those that are another mechanism; less is the tolerance of the program.
ANOTHER = 1e-3

#: Directions in which slip is free to begin at a point in space that has no force.
DIRECTIONS = 8


def has_others(
    assembly: solver.Assembly,
    interfaces: solver.Interfaces,
    ties: Sequence[solver.Tie],
    state: solver.Increment,
    live: np.ndarray,
    along: np.ndarray,
    *,
    associative: bool,
) -> bool:
    """Whether joints let blocks move otherwise along a direction (d,), with the same forces and live power.

    By complementarity every mechanism goes with every limit state of the forces: what presses and is not sheared to its
    bound sticks, what is slides against the shear, what does not press, or hangs on all of its strength, may open, what
    has reached its compressive strength may close. Mechanisms make a convex set, so that another one lies next to the
    one found: a movement that may be added to it, without power of the live load, (n_blocks, n_dof) [N, N·m]. Of random
    weights on the blocks one is seen by its sum, or by minus it. Joints with strength are those of the drawing.
    """
    from scipy.optimize import linprog

    free, d = assembly.free & ~state.fallen, assembly.dimension
    n_dof, length = state.velocity.shape[1], assembly.block_size
    equal, least = _rows(assembly, interfaces, ties, state, associative)
    moving = np.repeat(free, n_dof)
    power = (live / _units(n_dof, d, length))[free].ravel()
    equal = sp.vstack([equal[:, moving], sp.csr_array((power / (np.abs(power).max() or 1.0))[None])])
    weights = np.zeros((int(free.sum()), n_dof))
    weights[:, :d] = np.random.default_rng(0).uniform(0.5, 1.5, len(weights))[:, None] * along / np.linalg.norm(along)
    for sign in (-1.0, 1.0):
        found = linprog(
            sign * weights.ravel(),
            A_ub=-least[:, moving] if least.shape[0] else None,
            b_ub=np.zeros(least.shape[0]) if least.shape[0] else None,
            A_eq=equal,
            b_eq=np.zeros(equal.shape[0]),
            bounds=(-1.0, 1.0),
        )
        if found.status == 0 and -found.fun > ANOTHER:
            return True
    return False


def _units(n_dof: int, d: int, length: float) -> np.ndarray:
    """(n_dof,) array: by which loads are divided so that movements are those of rotations times a length [m]."""
    return np.where(np.arange(n_dof) < d, 1.0, length)


def _rows(
    assembly: solver.Assembly,
    interfaces: solver.Interfaces,
    ties: Sequence[solver.Tie],
    state: solver.Increment,
    associative: bool,
) -> tuple[sp.csr_array, sp.csr_array]:
    """Make the rows over movements, rotations times the block size, that are zero, and those that are at least that."""
    contacts, forces, friction, least, most, cohesion = _carried(assembly, interfaces, ties, state)
    n, d = forces.shape
    relative = sp.csr_array(mechanics.wrench_matrix(contacts, state.pose, assembly.block_size).T)
    scale = _units(state.velocity.shape[1], d, 1.0 / assembly.block_size)
    velocity = (state.velocity / scale).ravel()
    velocity = velocity / (np.abs(velocity).max() or 1.0)
    moved = (relative @ velocity).reshape(n, d)
    lift = friction if associative else np.zeros(n)
    beyond, shear = forces[:, 0] - least, np.linalg.norm(forces[:, 1:], axis=1)
    none = CARRIES * np.abs(forces[:, 0]).max(initial=0.0)
    bound = friction * beyond + cohesion
    presses, full, holds = beyond > none, beyond >= (most - least) * (1.0 - USED_UP), bound > friction * none
    used = holds & (shear >= bound * (1.0 - USED_UP))
    ways = np.where(used[:, None], -forces[:, 1:] / np.where(used, shear, 1.0)[:, None], 0.0)
    point = np.arange(n)
    opening, slips = relative[d * point], [relative[d * point + k] for k in range(1, d)]

    def along(which: np.ndarray, ways: np.ndarray) -> sp.csr_array:
        return sum(sp.diags_array(ways[:, k]) @ slips[k][which] for k in range(d - 1))

    slip = sp.csr_array(along(point, ways))
    lifts = sp.csr_array(opening - sp.diags_array(lift) @ slip)
    slipped, lifted = slip @ velocity, lifts @ velocity
    equal = [lifts[presses & ~full], *(rows[holds & ~used] for rows in slips)]
    if d == 3:
        equal.append(along(used, np.stack([-ways[used, 1], ways[used, 0]], axis=1)))
    at_least = [
        slip[used & (slipped <= EXACT)],
        lifts[holds & ~presses & ~full & (lifted <= EXACT)],
        -lifts[presses & full & (lifted >= -EXACT)],
    ]
    size = np.linalg.norm(moved[:, 1:], axis=1)
    closed = ~(presses | holds | full) & (moved[:, 0] - lift * size <= EXACT)
    slides = closed & (size > EXACT)
    directions = moved[slides, 1:] / size[slides, None]
    at_least.append(opening[slides] - sp.diags_array(lift[slides]) @ along(slides, directions))
    rests = closed & ~slides
    angles = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    turns = np.array([[-1.0], [1.0]]) if d == 2 else np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for one in turns:
        every = np.broadcast_to(one, (int(rests.sum()), d - 1))
        at_least.append(opening[rests] - sp.diags_array(lift[rests]) @ along(rests, every))
    return sp.csr_array(sp.vstack(equal)), sp.csr_array(sp.vstack(at_least))


def _carried(
    assembly: solver.Assembly, interfaces: solver.Interfaces, ties: Sequence[solver.Tie], state: solver.Increment
) -> tuple[mechanics.Contacts, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Give the contact points of blocks, and of the ties that are not slack, as they carry.

    With their forces (n, d) [N], coefficients of friction, least and largest normal forces and cohesion (n,) [N].
    """
    contacts = state.contacts
    names = ("cohesion", "tensile_strength", "compressive_strength")
    values = interfaces.values(assembly, contacts.block_a, contacts.block_b, *names)
    cohesion, tension, crushing = (of * np.where(np.isfinite(of), contacts.areas, 1.0) for of in values)
    adhesion = np.maximum(cohesion - state.friction * tension, 0.0)
    if not ties:
        return contacts, state.forces, state.friction, -tension, crushing, adhesion
    features = mechanics.present_members(ties, state.ties.rest)
    members = mechanics.member_contacts(ties, assembly, state.pose, state.ties.rest, features)
    carried = np.where(features[:, 2] == 1, -1.0, 1.0) * state.ties.forces[features[:, 1]]
    taut = (members.gaps <= EXACT * assembly.block_size) | (carried > 0.0)
    members, carried, number = members[taut], np.maximum(carried[taut], 0.0), features[taut, 1]
    forces, none = np.zeros((len(carried), assembly.dimension)), np.zeros(len(carried))
    forces[:, 0] = carried
    strength = np.array([tie.strength for tie in ties])[number]
    return (
        mechanics.joined_contacts([contacts, members]),
        np.concatenate([state.forces, forces]),
        np.append(state.friction, none),
        np.append(-tension, none),
        np.append(crushing, strength),
        np.append(adhesion, none),
    )
