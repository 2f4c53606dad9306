"""What equilibrium allows at a pose: whether one within friction exists, and what bounds a reaction or multiplier."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from solver.cones.problem import ConicProgram, ConicSolution
from solver.cones.solve import solve_cones
from solver.equilibrium import friction_rays, with_slack, wrench_matrix
from solver.geometry.contacts import Contacts
from solver.kinematics import Pose
from solver.lp.problem import LinearProgram, LPSolution, SolveError, Unbounded
from solver.lp.solve import solve_lp, vertex_routes
from solver.tolerances import BALANCE_TOLERANCE, COMPUTED_GAP, FALLING_FRACTION

from .increment import places_of_rows
from .macroblocks import free_blocks
from .model import Model

#: Cost of unbalanced force, against that of the reaction: above the speed of any block per speed of the supports.
UNBALANCED_COST = 1e4


@dataclass(frozen=True)
class Admissible:
    """Bounds over all forces in equilibrium within friction at a pose.

    Attributes
    ----------
    unbalanced : float
        Least sum of unbalanced forces over the total load: zero where an equilibrium exists.
    low, high : float
        Of the reaction [N or N·m], or of the live loads' multiplier; infinite where friction bounds neither; one
        whose program was not solved is not a number.
    gap : float
        Largest relative difference of the two objectives of the programs.
    programs : int
    forces : (n_contacts, d) array
        Normal and shear forces of the least reaction or largest multiplier, in units of the program; of another
        equilibrium where that has no bound or was not found.
    others : (n_contacts, d) array, optional
        Those of the other bound, where there is one.
    """

    unbalanced: float
    low: float
    high: float
    gap: float
    programs: int
    forces: np.ndarray
    others: np.ndarray | None = None

    @property
    def exists(self) -> bool:
        """Whether an equilibrium exists."""
        return self.unbalanced <= FALLING_FRACTION


def admissible(
    model: Model,
    pose: Pose,
    contacts: Contacts,
    friction: np.ndarray,
    rate: np.ndarray | None = None,
    *,
    vertex: bool = True,
    gap: float = COMPUTED_GAP,
) -> Admissible:
    """Whether an equilibrium within friction exists at a pose, and what it leaves free.

    Parameters
    ----------
    model : Model
        Where it has a live load, its multiplier is bounded.
    pose : Pose
    contacts : Contacts
        At the pose; points that are open carry nothing.
    friction : (n_contacts,) array
    rate : (n_blocks, n_dof) array, optional
        Movement of the supports along which the reaction is bounded.
    vertex : bool
        In the plane, up to 500 blocks: forces at a vertex of the program, as few as there are; otherwise those found
        fastest. Round cones have no such vertices.
    gap : float
        Of contact points that carry at most, in block sizes.

    Raises
    ------
    SolveError

    Notes
    -----
    Two linear programs over the multipliers of the friction cones' rays, in space two conic programs over the forces in
    round cones: the least and the largest reaction (or multiplier). The least is that of Portioli & Cascini (2017) at
    this geometry. What neither program can balance, at a cost above that of any mechanism, is what is out of balance.
    """
    d = model.dimension
    free = np.repeat(model.assembly.free, model.n_dof)
    closed = np.flatnonzero(contacts.gaps <= gap * model.length)
    matrix = sp.csr_array(wrench_matrix(contacts, pose, model.length))
    # In the plane the two rays of a cone are its forces; in space its three numbers are.
    forces_of = friction_rays(friction) if d == 2 else sp.eye_array(3 * len(contacts), format="csc")
    rays = forces_of[:, np.repeat(d * closed, d) + np.tile(np.arange(d), len(closed))]
    balance = sp.csc_array(matrix[free] @ rays)
    rows, n = balance.shape
    load, tolerance = model.scaled_load.ravel()[free], BALANCE_TOLERANCE * model.total_load
    live, live_size = model.scaled_live
    columns, objective = [balance], np.zeros(n)
    unit = 1.0
    if live_size > 0.0:
        column = sp.csc_array(live[model.assembly.free].reshape(-1, 1))
        columns += [column, -column]
        objective, unit = np.concatenate([objective, np.zeros(2 * rows), [1.0, -1.0]]), 1.0 / live_size
    else:
        along = np.zeros(len(free)) if rate is None else (rate / model.lengths).ravel()
        # In the speed of the supports: blocks out of balance are to cost more whatever the unit of the drawing.
        fastest = float(np.abs(along).max(initial=0.0)) or 1.0
        along = along / fastest
        objective = np.concatenate([rays.T @ (matrix.T @ np.where(free, 0.0, along)), np.zeros(2 * rows)])
        unit = model.force * model.length * fastest
    places = places_of_rows(free_blocks(model.assembly), pose)
    routes = vertex_routes(rows) if vertex else None

    def extreme(sign: float, *, slack: bool = True) -> LPSolution | ConicSolution | None:
        """Least or, by sign, largest value, or 0 for any; with or without unbalanced forces; None without a bound."""
        cost = sign * objective
        cost[n : n + 2 * rows] = UNBALANCED_COST if sign else 1.0
        matrix = with_slack(*columns)
        if not slack:
            kept = np.concatenate([np.arange(n), np.arange(n + 2 * rows, matrix.shape[1])])
            cost, matrix = cost[kept], matrix[:, kept]
        try:
            return _solution(d, cost, matrix, load, tolerance, friction[closed], places, routes)
        except Unbounded:
            return None
        except SolveError:
            # A bound may stay unknown, but for the load that a pushover is about: what exists is proved without it.
            if sign == 0.0 or (sign == with_forces and live_size > 0.0):
                raise
            unknown.add(sign)
            return None

    with_forces = 1.0 if live_size == 0.0 else -1.0
    unknown: set[float] = set()
    found = {sign: extreme(sign) for sign in (1.0, -1.0)}
    programs, values, gaps = 2, [], [0.0]
    if found[with_forces] is None and (with_forces in unknown or found[-with_forces] is None):
        # No forces yet: some that no bound asks for. Where both run away along wedged blocks, others may fall.
        any_forces, programs = extreme(0.0), programs + 1
    else:
        any_forces = None
    out = {
        k: float(s.x[n : n + 2 * rows].sum()) / model.total_load
        for k, s in {**found, 0.0: any_forces}.items()
        if s is not None
    }
    unbalanced = min(out.values())
    carried: dict[float, np.ndarray] = {}
    for sign, solution in found.items():
        balanced = objective
        if solution is not None and out[sign] > FALLING_FRACTION >= unbalanced:
            # Cheaper out of balance, though forces in balance exist: blocks would move ten thousand times as fast.
            solution, programs = extreme(sign, slack=False), programs + 1
            balanced = np.delete(objective, np.arange(n, n + 2 * rows))
        if solution is None:
            values.append(np.nan if sign in unknown else -sign * np.inf)
            continue
        values.append(float(balanced @ solution.x) * unit)
        gaps.append(solution.gap)
        carried[sign] = (rays @ solution.x[:n]).reshape(-1, d)
    if any_forces is not None:
        carried[0.0] = (rays @ any_forces.x[:n]).reshape(-1, d)
    given = [carried[sign] for sign in (with_forces, -with_forces, 0.0) if sign in carried]
    others = given[1] if len(given) > 1 else None
    return Admissible(unbalanced, values[0], values[1], max(gaps), programs, given[0], others)


def _solution(
    dimension: int,
    cost: np.ndarray,
    matrix: sp.csc_array,
    load: np.ndarray,
    tolerance: float,
    friction: np.ndarray,
    places: np.ndarray | None,
    routes: tuple[str, ...] | None,
) -> LPSolution | ConicSolution:
    """Solve for forces that balance a load: a linear program in the plane, in space one over round cones."""
    if dimension == 3:
        return solve_cones(ConicProgram(cost, matrix, -load, friction))
    lower, upper = -load - tolerance, -load + tolerance
    return solve_lp(LinearProgram(cost=cost, matrix=matrix, lower=lower, upper=upper, places=places), routes)
