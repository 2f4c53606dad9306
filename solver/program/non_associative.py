"""Limit loads of friction without dilatancy: a sequence of programs over the forces of contact points at a pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from solver.programs.problem import LinearProgram, SolveError
from solver.programs.solve import solve_between
from solver.tolerances import ACCEPTED_ERROR, CARRYING_FRACTION, FALLING_FRACTION

from .static_program import ProgramState, StaticProgram

#: Part of the new normal forces in the next program where they hardly depend on the last ones,
#: and where they do, as in vaults, whose programs go in circles with more; programs at most.
CONFIDENT, RELAXATION, PROGRAMS = 0.9, 0.5, 300

#: Programs after which the next one follows of so many changes.
PLAIN_PROGRAMS, REMEMBERED = 40, 15

#: It has converged when the multiplier changes by less than programs are solved to, and shear forces
#: exceed friction by less than this part of the largest normal force; the second in space, where the multiplier is off
#: by as much. There rounding may stop it short: then after so many programs that have come no nearer.
FRICTION_EXCESS, FRICTION_EXCESS_IN_SPACE, NO_NEARER = 1e-6, 1e-8, 5

#: Cost of a change of a normal force in multipliers, which only decides between equals. The second in space, where
#: rounding of interior solutions hides smaller ones; it is seen in the motion, which a last program without it gives.
CHANGE_COST, CHANGE_COST_IN_SPACE = 1e-8, 1e-5

#: In the plane: parts of that cost in which points differ, at most, by place along the resultants
#: of the live and the dead load and by normal force at rest: between equals the order of the rows would decide.
UNLIKE = np.array([0.1, 0.037, 0.071])

#: Cost of unbalanced force, in multipliers, above that of any mechanism.
UNBALANCED_COST = 1e3


def non_associative_limit(
    program: StaticProgram, normal: np.ndarray, balanced: ProgramState, bounded: bool = False
) -> tuple[ProgramState, bool]:
    """Run the sequence: its last program or the nearest one, and whether it has converged.

    It begins with normal forces (n,), and with a state in equilibrium. Raises ``Unbounded`` where friction with
    dilatancy has no limit, unless that is known to be ``bounded``; ``SolveError`` where no program is solved.
    """
    forces, multiplier, plane = balanced.forces, balanced.multiplier, program.size == 2
    unbalanced = np.abs(program.matrix @ forces.ravel() + program.dead + multiplier * program.live)
    most_excess = FRICTION_EXCESS if plane else FRICTION_EXCESS_IN_SPACE
    # Of equal ways to carry, those that press where nothing pressed come last.
    idle = normal <= CARRYING_FRACTION * normal.max(initial=0.0)
    change_cost = (CHANGE_COST * _unlike(program, normal) if plane else CHANGE_COST_IN_SPACE) * (1.0 + idle)
    tried: list[tuple[np.ndarray, np.ndarray]] = []
    nearest: ProgramState | None = None
    least, used, best_at, locked = np.inf, normal, 0, False
    for number in range(1, PROGRAMS + 1):
        try:
            state = _sliding(program, normal, unbalanced, change_cost)
        except SolveError:
            if nearest is None:
                raise
            break
        largest = float(state.forces[:, 0].max(initial=0.0)) or 1.0
        excess = program.friction_excess(state.forces, program.limits.cohesion) / largest
        change = abs(_gained(program, state, normal))
        error = np.inf if state.falls else max(excess, change)
        settled = excess <= most_excess and change <= ACCEPTED_ERROR and not state.falls
        if nearest is None or settled or error < least:
            nearest, least, used, best_at = state, error, normal, number
        if settled or (least <= FRICTION_EXCESS and number - best_at == NO_NEARER):
            break
        added, error = state.forces - forces, FRICTION_EXCESS_IN_SPACE * largest
        within = program.friction_excess(added) <= error + FRICTION_EXCESS * float(np.abs(added).max())
        locks = within and state.multiplier > multiplier
        locked |= locks
        if not bounded and ((locks and number >= PLAIN_PROGRAMS) or (locked and largest * FRICTION_EXCESS > 1.0)):
            # What a program adds may be added without end, unless crushing ends it (raises).
            program.bound(-1.0, balanced)
            bounded = True
        forces, multiplier = state.forces, state.multiplier
        tried = [*tried[-REMEMBERED:], (normal, forces[:, 0])]
        normal = _next_normal(tried, number >= PLAIN_PROGRAMS and not locks)
    converged = least <= FRICTION_EXCESS
    if locked and not converged and not bounded:
        program.bound(-1.0, balanced)
    assert nearest is not None
    if converged and not plane:
        free = _sliding(program, used, unbalanced, 0.0 * change_cost)
        nearest = replace(nearest, velocity=free.velocity, face_rates=free.face_rates, gap=free.gap)
    return nearest, converged


def _gained(program: StaticProgram, state: ProgramState, normal: np.ndarray) -> float:
    """Tell what the multiplier gains, to first order, once friction follows from its forces, not ``normal``.

    As a part of the multiplier and of what friction takes.
    """
    _, slip = program.rates(state)
    gain = float((program.friction * (state.forces[:, 0] - normal)) @ slip)
    taken = float((program.limits.cohesion + program.friction * normal) @ slip)
    return gain / max(abs(state.multiplier) + taken, 1e-300)


def _unlike(program: StaticProgram, normal: np.ndarray) -> np.ndarray:
    """(n,) array: factors in which points differ whatever their order, by forces (n,) at rest and places."""
    points, blocks = program.contacts.points, (program.contacts.block_a, program.contacts.block_b)
    # Corners of two blocks on a third are at one place: what they belong to tells them apart.
    places = points + sum(np.where(block[:, None] < 0, points, program.pose.positions[block]) for block in blocks)
    places -= places.mean(axis=0)
    resultants = [load.reshape(-1, 3)[:, :2].sum(axis=0) for load in (program.live, program.dead)]
    unlike = np.column_stack([places @ np.transpose(resultants), normal])
    return 1.0 + unlike @ (UNLIKE / np.maximum(np.abs(unlike).max(axis=0, initial=0.0), 1e-300))


def _sliding(
    program: StaticProgram, normal: np.ndarray, unbalanced: np.ndarray, change_cost: np.ndarray
) -> ProgramState:
    """One program of the sequence: maximise α with |T| ≤ B; of equal α the normal forces nearest to N⁰, ``normal``.

    Columns: the shear forces, N, p, m, α and unbalanced forces, with N - N⁰ = p - m, and a row N for each point
    that may crush. In the plane T = (u - v) / 2 of columns u + v = 2 B; in space the disc |T| ≤ B is the cone
    |T| ≤ B s with s = 1, and faces that resist torsion are limited by the sum of B over their points.
    """
    program.programs += 1
    n, rows, size, plane = len(normal), len(program.dead), program.size, program.size == 2
    bound = program.limits.cohesion + program.friction * normal
    brittle = np.flatnonzero(np.isfinite(program.limits.beyond_least))
    identity, eye = sp.identity(rows, format="csr"), sp.identity(n, format="csr")
    if plane:
        half = sp.diags_array(np.full(n, 0.5))
        shears = sp.hstack([half, -half])
        to_shear = program.matrix[:, 1::2] @ shears
        level, level_is, slopes, slack = sp.hstack([eye, eye]), 2.0 * bound, np.zeros(0), unbalanced
    else:
        disc = np.ones((n, size)) * bound[:, None]
        disc[:, 0] = 0.0
        shears = sp.diags_array(disc.ravel())
        to_shear = program.matrix @ shears
        level = sp.csr_array((np.ones(n), (np.arange(n), size * np.arange(n))), shape=(n, size * n))
        level_is, slopes, slack = np.ones(n), np.ones(n), np.zeros(rows)
    part: np.ndarray | float = 0.0
    if program.faces is not None:
        # What faces carry is in parts of what they may carry, as that of points is.
        most, faces = np.bincount(program.faces.face, bound), program.faces
        part = np.divide(1.0, most, out=np.zeros_like(most), where=most > CARRYING_FRACTION * most.max())[:, None]
        shears, level = faces.beside(shears, level, sp.diags_array(np.repeat(part, 5)) @ faces.shares @ shears)
        to_shear = program.matrix @ shears
        level_is = np.append(np.tile([0.0, 0.0, 0.0, 0.0, 1.0], len(most)), level_is)
        slopes = np.append(slopes, np.ones(2 * len(most)))
    first = shears.shape[1]
    blocks = [
        [to_shear, program.matrix[:, 0::size], None, None, sp.csr_array(program.live[:, None]), identity, -identity],
        [level, None, None, None, None, None, None],
        [None, eye, -eye, eye, None, None, None],
        [None, sp.csr_array(eye)[brittle], None, None, None, None, None],
    ]
    # Joints that may pull press sooner: pulling takes friction away, until nothing is left that could carry.
    released = change_cost * (1.0 + (program.limits.least < 0.0))
    of_forces = [np.zeros(first), program.price, change_cost, released]
    stated = LinearProgram(
        cost=np.concatenate([*of_forces, [-1.0], np.full(2 * rows, UNBALANCED_COST)]),
        matrix=sp.csc_array(sp.block_array(blocks, format="csc")),
        lower=np.concatenate([-program.dead - slack, level_is, normal, np.zeros(len(brittle))]),
        upper=np.concatenate([-program.dead + slack, level_is, normal, program.limits.beyond_least[brittle]]),
    )
    solution = solve_between(stated, slopes, size)
    shear, x = (shears @ solution.x[:first]).reshape(n, -1), solution.x[first:]
    forces = np.column_stack([x[:n], shear[:, int(not plane) :]])
    multiplier, left = float(x[3 * n]), x[3 * n + 1 :][: 2 * rows].max(initial=0.0)
    falls = bool(left > FALLING_FRACTION * program.model.total_load)
    velocity, face_rates = -solution.row_dual[:rows], program.face_rates(solution) * part
    return ProgramState(forces, multiplier, velocity, solution.gap, falls=falls, drag=bound, face_rates=face_rates)


def _next_normal(tried: list[tuple[np.ndarray, np.ndarray]], extrapolated: bool) -> np.ndarray:
    """(n,) array: normal forces to try after those (n,) of the last programs, each with what it answered.

    Anderson (1965), https://doi.org/10.1145/321296.321305, once a constant relaxation has not converged, as in vaults:
    what changes of the forces did to their error says which would take it away.
    """
    normals, answers = np.swapaxes(tried, 0, 1)
    errors = answers - normals
    asked, answered = (float(np.abs(of[-1] - of[-2 % len(of)]).max(initial=0.0)) for of in (normals, answers))
    moved = normals[-1] + (CONFIDENT if answered < 0.2 * asked else RELAXATION) * errors[-1]
    if extrapolated:
        changes, of_errors = np.diff(normals, axis=0).T, np.diff(errors, axis=0).T
        moved -= (changes + RELAXATION * of_errors) @ np.linalg.lstsq(of_errors, errors[-1], rcond=1e-10)[0]
    return np.asarray(np.maximum(moved, 0.0))
