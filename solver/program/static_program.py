"""The static program at a pose: balance of the free blocks, and the forces that contact points can carry."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from solver.contact_step.interior import ACCEPTED, BALANCED, interior_point
from solver.contact_step.problem import ContactProblem, NotSolved
from solver.contact_step.stiffness import ContactRows
from solver.equilibrium import wrench_matrix
from solver.geometry.contacts import Contacts
from solver.kinematics import Pose
from solver.programs.problem import LinearProgram, Solution, SolveError, Unbounded
from solver.programs.solve import solve_between
from solver.results.certificate import friction_excess
from solver.tolerances import ACCEPTED_ERROR, BALANCE_TOLERANCE, FALLING_FRACTION

from .model import Model
from .strength import Admissible, ForceLimits
from .torsion import Faces


@dataclass(frozen=True)
class EquilibriumBounds:
    """Bounds of the reaction [N or N·m], or of the live loads' multiplier, over all equilibria within friction."""

    unbalanced: float  #: least sum of unbalanced forces over the total load: zero where an equilibrium exists
    #: Infinite where friction does not bound it, nan where its program was not solved; without an equilibrium the value
    #: of the forces.
    low: float
    high: float
    gap: float  #: largest relative difference of the two objectives of the programs
    #: (k, n_contacts, d), in units of the program: of the bounds that were found, the least one first; of another
    #: equilibrium where none was; nearest to one where none exists.
    forces: np.ndarray

    @property
    def in_equilibrium(self) -> bool:
        """Whether an equilibrium within friction exists."""
        return self.unbalanced <= FALLING_FRACTION


@dataclass(frozen=True)
class ProgramState:
    """Forces (n_contacts, size), multiplier and velocity (n_rows,) of a solution, in units of the program."""

    forces: np.ndarray  #: beyond the least ones
    multiplier: float
    velocity: np.ndarray
    gap: float
    unbalanced: np.ndarray | float = 0.0  #: (n_rows,): what is missing to balance
    falls: bool = False
    #: (n_contacts,): friction force that slip works against without being in the normal forces' power.
    drag: np.ndarray | None = None
    #: (n_faces, 3): slips and turn times radius of faces that resist torsion, beside those of their points.
    face_rates: np.ndarray | float = 0.0


class StaticProgram:
    """Rows of the free blocks with a dead and a live load, and n contact points with limits, in units of the program.

    Normal forces are those beyond the least ones, which are loads of the blocks, in ``dead``; they have a price, (n,),
    in multipliers. The value that is bounded is the multiplier of a live load in the given senses, or the reaction
    along a rate of the supports, (n_blocks, n_dof). Where a mechanism is sought solutions are ``exact``: in the plane
    they are vertices, then, and balanced to the last digit. Methods raise ``SolveError`` where a program is not solved.
    """

    def __init__(
        self,
        model: Model,
        pose: Pose,
        contacts: Contacts,
        friction: np.ndarray,
        limits: ForceLimits,
        price: np.ndarray,
        *,
        senses: tuple[float, ...] = (),
        rate: np.ndarray | None = None,
        faces: Faces | None = None,
        exact: bool = False,
    ) -> None:
        self.model, self.pose, self.contacts, self.faces = model, pose, contacts, faces
        self.friction, self.limits, self.price, self.senses, self.exact = friction, limits, price, senses, exact
        self.size, self.programs = model.dimension, 0
        free, self.wrench = np.repeat(model.assembly.free, model.n_dof), wrench_matrix(contacts, pose, model.length)
        self.matrix = sp.csr_array(self.wrench)[free]  # (n_rows, size n)
        self.least = limits.least[:, None] * np.eye(model.dimension)[0]
        self.dead = model.scaled_load_at(pose).ravel()[free] + self.matrix[:, :: self.size] @ limits.least
        live, live_size = model.scaled_live(pose)
        along = np.zeros(len(free)) if rate is None else np.where(free, 0.0, (rate / model.lengths).ravel())
        # Relative to the speed of the supports, as the check of a solution is absolute.
        speed = float(np.abs(along).max(initial=0.0)) or 1.0
        self.live, self.work = live.ravel()[free], self.wrench.T @ along / speed
        self.unit = 1.0 / live_size if senses else model.force * model.length * speed
        self.carried = Admissible.of(friction, limits.cohesion, limits.beyond_least, self.size, faces)

    def bounds(self) -> EquilibriumBounds:
        """Bound the reaction or the multiplier of all equilibria within friction.

        In space the forces of the least one prove that there is an equilibrium; where they do not, and in the plane,
        where programs without a solution take long, first the least sum of unbalanced forces. The least reaction is
        that of Portioli & Cascini (2017) at this geometry.
        """
        least = self._least_in_balance() if self.size > 2 else None
        balanced, unbalanced = self.most_balanced() if least is None else (least, 0.0)
        if unbalanced > FALLING_FRACTION:
            value = self.value(balanced)
            return EquilibriumBounds(unbalanced, value, value, balanced.gap, np.array([balanced.forces + self.least]))
        values, found = {1.0: np.nan, -1.0: np.nan}, []
        for sense in values:
            try:
                found.append(self.bound(sense, balanced) if least is None or sense < 0.0 else least)
                values[sense] = self.value(found[-1])
            except Unbounded:
                values[sense] = -sense * np.inf
            except SolveError:
                # A bound may stay unknown, except that of a pushover.
                if self.senses and sense < 0.0:
                    raise
        # Where blocks are wedged neither bound is finite.
        forces = np.array([state.forces + self.least for state in found or [balanced]])
        gap = max(state.gap for state in (balanced, *found))
        return EquilibriumBounds(unbalanced, values[1.0], values[-1.0], gap, forces)

    def _least_in_balance(self) -> ProgramState | None:
        """Find the state of the least value; None where its forces are out of balance by more than rounding."""
        try:
            least = self.bound(1.0)
        except (Unbounded, SolveError):
            return None
        left = self.matrix @ least.forces.ravel() + self.dead + least.multiplier * self.live
        return least if np.abs(left).sum() <= FALLING_FRACTION * self.model.total_load else None

    def value(self, state: ProgramState) -> float:
        """Reaction [N or N·m] or multiplier of a state."""
        if self.senses:
            return state.multiplier * self.unit
        return float(self.work @ (state.forces + self.least).ravel()) * self.unit

    def bound(self, sense: float, balanced: ProgramState | None = None) -> ProgramState:
        """Least, by sense 1, or largest value in equilibrium, by -1, less what open points cost.

        The rounding that leaves a balanced state out of balance may do so here. Raises ``Unbounded``.
        """
        of_forces = sense * self.work
        of_forces[:: self.size] += self.price
        left = 0.0 if balanced is None else balanced.unbalanced
        return self._state(self._solved(of_forces, sense * np.array(self.senses), [], left))

    def most_balanced(self, *, with_live: bool = True) -> tuple[ProgramState, float]:
        """Find forces of least imbalance, and their unbalanced forces over the total load, 0 where that is rounding."""
        rows, k = len(self.dead), len(self.senses)
        unit, cost = sp.eye_array(rows), np.append(np.zeros(k), np.ones(2 * rows))
        first, is_rounding = self.carried.columns.shape[1] + k, False
        try:
            solution = self._solved(np.zeros_like(self.work), cost, [unit, -unit], with_live=with_live)
        except SolveError as error:
            best = error.best
            if best is None:
                raise
            left = float(best.x[first:][: 2 * rows].sum()) / self.model.total_load
            is_rounding = best.violation <= ACCEPTED_ERROR and left <= ACCEPTED_ERROR
            # The dual objective bounds the forces out of balance from below, but for its violation along the forces.
            doubt = best.dual_violation * (1.0 + float(np.abs(best.row_dual).max())) * float(np.abs(best.x).sum())
            if not is_rounding and best.dual_objective <= 2.0 * best.gap + doubt:
                raise
            solution = best
        missing, beyond = unbalanced = solution.x[first:][: 2 * rows].reshape(2, -1)
        left = 0.0 if is_rounding else float(unbalanced.sum()) / (self.model.total_load or 1.0)
        state = self._state(solution)
        return replace(state, multiplier=state.multiplier * with_live, unbalanced=missing - beyond), left

    def kinematic(self, state: ProgramState) -> tuple[float, float]:
        """Multiplier by the power of a mechanism, infinite without live power; how far it leaves the duals of cones."""
        velocity = state.velocity
        (relative, slip), live_power = self.rates(state), float(self.live @ velocity)
        # Points that are open may close by their gap in a motion whose live power is 1.
        relative[:, 0] += self.price * max(live_power, 0.0)
        drag, slope = (self.limits.cohesion, self.friction) if state.drag is None else (state.drag, 0.0)
        strength = self.limits.beyond_least
        # What crushes may come closer than what is rigid, at the price of its strength.
        brittle = np.isfinite(strength)
        closer = np.where(brittle, np.maximum(slope * slip - relative[:, 0], 0.0), 0.0)
        taken = float(drag @ slip + np.where(brittle, strength, 0.0) @ closer)
        value = (taken - float(self.dead @ velocity)) / live_power if live_power > 0.0 else np.inf
        missing = np.maximum(slope * slip - closer - relative[:, 0], 0.0)
        return value + float(self.price @ state.forces[:, 0]), float(missing.max(initial=0.0))

    def rates(self, state: ProgramState) -> tuple[np.ndarray, np.ndarray]:
        """(n, size) and (n,) arrays: at which points open and slip in a mechanism, and what friction works against."""
        relative = (self.matrix.T @ state.velocity).reshape(-1, self.size)
        if self.faces is None:
            return relative, np.linalg.norm(relative[:, 1:], axis=1)
        of_faces = np.zeros((len(self.faces.radii), 5))
        of_faces[:, :3] = state.face_rates
        relative -= (self.faces.shares.T @ of_faces.ravel()).reshape(relative.shape)
        # What a face does by itself is taken from the friction of all of its points.
        return relative, np.linalg.norm(relative[:, 1:], axis=1) + np.linalg.norm(of_faces, axis=1)[self.faces.face]

    def friction_excess(self, forces: np.ndarray, cohesion: np.ndarray | float = 0.0) -> float:
        """Largest shear force of a point, or shear and torsion of a face, beyond friction and cohesion."""
        excess = friction_excess(forces, self.friction, cohesion)
        if self.faces is None:
            return excess
        of_faces = (self.faces.shares @ forces.ravel()).reshape(-1, 5)
        added = np.bincount(self.faces.face, np.broadcast_to(cohesion, len(forces)))
        beyond = np.linalg.norm(of_faces[:, :3], axis=1) - of_faces[:, 4] - added
        return max(excess, float(beyond.max(initial=0.0)))

    def face_rates(self, solution: Solution) -> np.ndarray | float:
        """(n_faces, 3) array: what faces do by themselves, of rows of theirs that follow those of balance."""
        if self.faces is None:
            return 0.0
        rows = len(self.dead) + np.arange(5 * len(self.faces.radii)).reshape(-1, 5)[:, :3]
        return np.asarray(-solution.row_dual[rows])

    def nearest(
        self, reference: np.ndarray, compliance: np.ndarray, multiplier: float = 0.0, reaction: float | None = None
    ) -> np.ndarray:
        """(n, d) array: forces in equilibrium nearest to the reference, by the compliance, (n, d) arrays each.

        Under a multiplier of the live load, and with a reaction [N or N·m] where one is given. Raises ``NotSolved``.
        """
        least, load = self.least, self.dead + multiplier * self.live
        # Those that can carry nothing would leave the program without an interior.
        able = self.limits.beyond_least > BALANCED
        if not able.any():
            if np.abs(load).max(initial=0.0) > ACCEPTED:
                raise NotSolved("nothing touches the free blocks")
            return least
        rows = ContactRows(self.wrench, self.model.assembly.free, self.model.assembly.centroids)
        # Only ratios of the compliance matter.
        rigid = np.isinf(self.limits.beyond_least)
        none, unit_reaction = np.zeros_like(least[able]), None if reaction is None else self.work.reshape(least.shape)
        problem = ContactProblem(
            rows=rows[able],
            gap=none[:, 0],
            slip=none[:, 1:],
            forces=(reference - least)[able],
            bound=self.limits.cohesion[able],
            friction=self.friction[able],
            compliance=(compliance / compliance[rigid if rigid.any() else able, 0].mean())[able],
            most=self.limits.beyond_least[able],
            load=load,
            viscosity=np.zeros_like(load),
            motion_so_far=np.zeros_like(load),
            size=1.0,
            unit_reaction=None if unit_reaction is None else unit_reaction[able],
            reaction=0.0 if reaction is None else reaction / self.unit - float((unit_reaction * least).sum()),
        )
        found = interior_point(problem)
        if not found.imbalance <= ACCEPTED:
            raise NotSolved(
                f"forces nearest to an equilibrium leave {found.imbalance:.1e} block weights out of balance"
            )
        forces = least.copy()
        forces[able] += found.forces
        return forces

    def _solved(
        self,
        of_forces: np.ndarray,
        cost: np.ndarray,
        unbalanced: list[sp.sparray],
        left: np.ndarray | float = 0.0,
        with_live: bool = True,
    ) -> Solution:
        """Minimise the cost of forces, (size n,), and of the columns beside them, with what rows are left with."""
        self.programs += 1
        carried, right = self.carried, -self.dead - left
        beside = [*(sp.csc_array(with_live * sense * self.live[:, None]) for sense in self.senses), *unbalanced]
        blocks = [[self.matrix @ carried.columns, *beside], [carried.limits, *[None] * len(beside)]]
        tolerance = 0.0 if self.exact or self.size > 2 else BALANCE_TOLERANCE * self.model.total_load
        places = np.repeat(self.pose.positions[self.model.assembly.free], self.model.n_dof, axis=0)
        program = LinearProgram(
            cost=np.append(carried.columns.T @ of_forces, cost),
            matrix=sp.csc_array(sp.block_array(blocks, format="csc")),
            lower=np.append(right - tolerance, np.zeros_like(carried.most)),
            upper=np.append(right + tolerance, carried.most),
            places=np.vstack([places, self.contacts.points[carried.limited]]),
        )
        return solve_between(program, carried.friction, self.size, vertex=self.exact)

    def _state(self, solution: Solution) -> ProgramState:
        columns, rows, k = self.carried.columns, len(self.dead), len(self.senses)
        x, beside = np.split(solution.x, [columns.shape[1]])
        forces, multiplier = (columns @ x).reshape(-1, self.size), float(np.dot(self.senses, beside[:k]))
        velocity, face_rates = -solution.row_dual[:rows], self.face_rates(solution)
        return ProgramState(forces, multiplier, velocity, solution.gap, face_rates=face_rates)
