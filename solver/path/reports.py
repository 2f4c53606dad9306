"""The increments of a path, and its messages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.assembly import Assembly
from solver.equilibrium import wrench_matrix
from solver.geometry.contacts import Contacts
from solver.kinematics import Pose, moved_vertices, relative_velocities
from solver.loads import GRAVITY
from solver.results.certificate import Certificate, carrying_gap, friction_excess, largest_penetration
from solver.results.increment import Increment, State, Status
from solver.ties import held_ties, is_member
from solver.tolerances import OVERLAP
from solver.words import REMEDY, counted

from .controls import Ending
from .equilibrium_check import on_supports
from .state import EquilibriumCheck, Place
from .stepping import Stepper


class Reports:
    """Increments of a phase, by its number, and messages; blocks have fallen as :class:`PathState` tells."""

    def __init__(self, stepper: Stepper, number: int, fell_at: np.ndarray) -> None:
        self.stepper, self.model, self.driver, self.number = stepper, stepper.model, stepper.driver, number
        # Events on the path: parameter [m or rad], and words.
        self.notes: list[tuple[float, str]] = []
        self.fell_at = fell_at
        self.overlapping: set[tuple[int, int]] = set()

    def increment(self, check: EquilibriumCheck, velocity: np.ndarray, works: tuple[float, ...]) -> Increment:
        """The increment of an equilibrium and the movement that follows, with the notes since the last one."""
        model, place, contacts, bounds = self.model, check.place, check.contacts, check.bounds
        support_forces = on_supports(model, contacts, place.pose, check.forces)
        state = self._state(place, contacts, check.forces, self.stepper.friction(contacts), velocity, support_forces)
        gaps, least, cohesion = self.stepper.joint_limits(place, contacts, check.forces)
        between, beyond = ~is_member(contacts), check.forces.copy()
        beyond[:, 0] -= least
        # Give of elastic joints is neither a gap nor a penetration.
        in_place = replace(state.contacts, gaps=gaps[between])
        excess = friction_excess(beyond[between], state.friction, cohesion[between])
        certificate = Certificate(
            equilibrium_residual=float(np.abs(self.unbalanced(check)).max(initial=0.0)) / model.total_load,
            friction_excess=excess / model.total_load,
            carrying_gap=carrying_gap(in_place, check.forces[between]),
            largest_penetration=max(largest_penetration(in_place), self._overlap(place, contacts)),
            duality_gap=bounds.gap,
            energy_residual=abs(works[0] + works[1] - works[2] - works[3]) / max(works[4], 1e-12),
        )
        where = f"{self.driver.unit}{f' in phase {self.number + 1}' if self.number else ''}"
        notes, self.notes = tuple(f"at {s:.6g} {where}: {words}" for s, words in self.notes), []
        state = self.stepper.mortar.told(state, place)
        found = self._increment(place.s, state, check.measured, certificate, Status.EQUILIBRIUM)
        return replace(found, least=bounds.low, largest=bounds.high, notes=notes)

    def unbalanced(self, check: EquilibriumCheck) -> np.ndarray:
        """(n_free, n_dof) array: what is out of balance on free blocks, in units of the program."""
        model, pose = self.model, check.place.pose
        resultant = (wrench_matrix(check.contacts, pose, model.length) @ check.forces.ravel()).reshape(model.load.shape)
        live, live_size = model.scaled_live(pose)
        return (resultant + model.scaled_load_at(pose) + check.measured * live_size * live)[model.assembly.free]

    def _overlap(self, place: Place, contacts: Contacts) -> float:
        """Deepest overlap [m] of which contact points do not know, as of drawn ones and elastic joints; told once."""
        assembly, deepest = self.model.assembly, 0.0
        least = OVERLAP * float(assembly.widths.min())
        for a, b, depth in zip(*assembly.shapes.overlaps(moved_vertices(assembly, place.pose), least), strict=True):
            known = np.isin(contacts.block_a, (a, b)) & np.isin(contacts.block_b, (a, b))
            deeper = depth + contacts.gaps[known].min(initial=0.0) > least
            if deeper and assembly.free[[a, b]].any() and not self.model.fallen[[a, b]].any():
                deepest = max(deepest, float(depth))
                if (a, b) not in self.overlapping:
                    words = f"'{assembly.names[a]}' and '{assembly.names[b]}' are {depth:.3g} m in each other"
                    self.notes.append((place.s, f"{words}: no contact was found that keeps them apart"))
                    self.overlapping.add((a, b))
        return deepest

    def falling_increment(self, place: Place, velocity: np.ndarray) -> Increment:
        """The increment of a place that is not in equilibrium."""
        contacts = self.stepper.contacts_at(place)
        forces, friction = self.stepper.transferred(place, contacts)[0], self.stepper.friction(contacts)
        state = self._state(place, contacts, forces, friction, velocity, np.zeros_like(self.model.load))
        certificate = Certificate(largest_penetration=largest_penetration(state.contacts))
        return self._increment(place.s, state, 0.0, certificate, Status.FALLING)

    def _state(
        self,
        place: Place,
        contacts: Contacts,
        forces: np.ndarray,
        friction: np.ndarray,
        velocity: np.ndarray,
        support_forces: np.ndarray,
    ) -> State:
        """The arrays of an increment, from forces in units of the program at contact points of blocks and members."""
        ties, pose = self.stepper.members.told(contacts, forces, place.pose, place.tie_lengths), place.pose
        between = ~is_member(contacts)
        contacts, newtons, friction = contacts[between], forces[between] * self.model.force, friction[between]
        rates = relative_velocities(contacts, pose, velocity)
        return State(pose, contacts, newtons, rates, friction, velocity, support_forces, self.fell_at, ties)

    def _increment(
        self, s: float, state: State, measured: float, certificate: Certificate, status: Status
    ) -> Increment:
        """An increment, with the programs since the last one."""
        pushed, programs, self.stepper.programs = self.model.has_live, self.stepper.programs, 0
        return Increment(
            parameter=s,
            measured=measured,
            phase=self.number,
            load_multiplier=measured if pushed else 0.0,
            reaction=measured * self.model.live_force if pushed else measured,
            certificate=certificate,
            status=status,
            programs=programs,
            seconds=0.0,
            held=state,
        )

    def reached(self) -> Ending:
        """The ending at the limit."""
        driver = self.driver
        return Ending(Status.LIMIT_REACHED, f"the {driver.what} reached its limit of {driver.limit:g} {driver.unit}")

    def locked(self, place: Place, remedy: str = "") -> Ending:
        """The ending that names the wedged blocks."""
        normal = place.forces[:, 0]
        assert place.contacts is not None
        words = wedged(self.model.assembly, place.contacts[normal > 0.1 * normal.max()])
        return Ending(Status.LOCKED, f"{words} at {place.s:.6g} {self.driver.unit}{remedy}")

    def no_step(self, s: float, reason: str) -> Ending:
        """The ending at a step that was not solved, from a parameter s [m or rad]."""
        live = self.model.has_live
        turns = "it may have its largest value there: control another point or direction, or " if live else ""
        return Ending(
            Status.SOLVER_FAILED,
            f"steps of the {self.driver.what}, however small, lead no further at {s:.6g} {self.driver.unit}: {reason}; "
            f"{turns}repeat the analysis with another increment, and send the case to the developers if it stays",
        )

    def settled(self, start: Pose, end: Pose) -> str:
        """Message of blocks that do not stand as drawn and came to rest nearby."""
        pull = ", ".join(f"'{t.name}' {t.prestress:g} N" for t in self.model.ties if t.prestress and t.phase == 1)
        prestress = f"at the prestress ({pull}), " if pull else ""
        look = f"look {prestress}for gaps between them (joint_thickness) or a missing support"
        return f"{self.jump(start, end)}: as drawn the blocks do not stand; {look}"

    def nothing_carried(self, place: Place, as_drawn: bool) -> str:
        """Message of a pushover without a start, with what members carry there: as drawn their prestress alone."""
        nothing, ties, contacts = "no live load of this pattern is carried", self.model.ties, place.contacts
        if not ties or contacts is None:
            return nothing
        told = self.stepper.members.told(contacts, place.forces, place.pose, place.tie_lengths)
        forces = [tie.prestress for tie in ties] if as_drawn else np.abs(told.forces)
        carry = ", ".join(f"{tie.kind} '{tie.name}' {force:g} N" for tie, force in zip(ties, forces, strict=True))
        if not as_drawn:
            return f"{nothing} with what ties and props carry there ({carry})"
        how = "where they carry more before the live load acts, put a settlement before it, of 1e-6 m, in which they do"
        return f"{nothing} as drawn, with the prestress alone ({carry}): {how}"

    def jump(self, start: Pose, end: Pose) -> str:
        """Message that names the blocks of a jump, and how far they moved."""
        assembly = self.model.assembly
        far = np.linalg.norm(moved_vertices(assembly, end) - moved_vertices(assembly, start), axis=1)
        distance = np.where(assembly.free, np.maximum.reduceat(far, assembly.shapes.offsets[:-1]), 0.0)
        far_blocks = np.flatnonzero(distance > 0.1 * distance.max())
        return f"{self._named(far_blocks)} moved by up to {distance.max():.2g} m at once to the next equilibrium"

    def loss(self, fallen: np.ndarray, weight: float, share: float) -> str:
        """Message that names the blocks that have fallen."""
        fall = f"{self._named(np.flatnonzero(fallen))} {'falls' if fallen.sum() == 1 else 'fall'}"
        return f"{fall}, {weight:.4g} N, {100.0 * share:.2g} % of the weight; the path goes on without"

    def taken_away(self, removed: np.ndarray, absent: np.ndarray) -> str:
        """Message that names the blocks that are taken away, and the ties that go with them; these are not there."""
        assembly = self.model.assembly
        weight = float(assembly.masses[removed & assembly.free].sum()) * GRAVITY
        gone = [self.model.ties[k].name for k in np.flatnonzero(~held_ties(self.model.ties, removed) & ~absent)]
        with_it = f", and with it {', '.join(map(repr, gone))}" if gone else ""
        before = f"taken away before settlement {self.number + 1}"
        return f"{self._named(np.flatnonzero(removed))} {before}, {weight:.4g} N{with_it}"

    def _named(self, blocks: np.ndarray) -> str:
        return f"block{'' if len(blocks) == 1 else 's'} {self.model.assembly.listed(blocks, 4)}"


def falling_blocks(assembly: Assembly, motion: np.ndarray) -> np.ndarray:
    """Numbers of the free blocks that move a tenth as fast as the fastest, or more, (n_blocks, n_dof) array."""
    size = np.abs(motion[:, : assembly.dimension]).max(axis=1)
    return np.flatnonzero(assembly.free & (size >= 0.1 * size.max()))


def wedged(assembly: Assembly, pressed: Contacts) -> str:
    """Message that names the blocks that are wedged, from the contact points between which they are."""
    blocks = np.unique(np.concatenate([pressed.block_a, pressed.block_b]))
    # The ground at an end of a member is -1.
    blocks = blocks[(blocks >= 0) & assembly.free[blocks]]
    are = counted(len(blocks), "block is", "blocks are")
    return f"the supports cannot move on: {are} wedged ({assembly.listed(blocks, 4)})"


def no_equilibrium(assembly: Assembly, motion: np.ndarray, held: str = "") -> str:
    """Message that names the blocks that fall before any settlement, by their motion, (n_blocks, n_dof) array."""
    falling = falling_blocks(assembly, motion)
    return (
        f"no equilibrium before any settlement: {len(falling)} of {int(assembly.free.sum())} blocks fall "
        f"({assembly.listed(falling, 8)}){held}; {REMEDY}"
    )
