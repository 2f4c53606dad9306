"""What equilibrium within friction says of a place of the path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.equilibrium import block_forces, wrench_matrix
from solver.geometry.contacts import Contacts
from solver.kinematics import Pose
from solver.program.admissible import Admissible, admissible
from solver.program.coulomb import solve_step
from solver.program.model import Model
from solver.program.step import NotSolved, Step
from solver.tolerances import BALANCE_TOLERANCE, CLOSING_GAP, COMPUTED_GAP, USED_UP

from .place import Place, Proved
from .stepping import Steps


def on_supports(model: Model, contacts: Contacts, pose: Pose, forces: np.ndarray) -> np.ndarray:
    """(n_blocks, n_dof) array [N, N, N·m]: what the structure does to each support; zero for free blocks."""
    resultant = block_forces(contacts, pose, forces) * model.force
    return np.where(model.assembly.free[:, None], 0.0, resultant)


class Proofs:
    """Proofs of the places that steps lead to.

    Parameters
    ----------
    steps : Steps
    """

    def __init__(self, steps: Steps) -> None:
        self.steps, self.model, self.driver = steps, steps.model, steps.driver
        self.seen: tuple[Proved, float] | None = None

    def stands(self, place: Place) -> Proved:
        """Whether a place is in equilibrium within friction, and balanced forces near those of the path.

        Forces that balance are proof enough; bounds are worked out only where none are found near those of the path.
        """
        seen = self._seen(place)
        if seen is not None:
            return seen
        if place.s > 0.0:
            contacts, friction, remembered = self._at(place)
            near = self._balanced(place, contacts, friction, remembered, at_once=True)
            if near is not None:
                return self._standing(place, contacts, friction, None, *near)
        return self.proved(place)

    def proved(self, place: Place) -> Proved:
        """What equilibrium within friction says of a place, and balanced forces near those of the path."""
        seen = self._seen(place)
        if seen is not None:
            return seen if seen.bounds is not None else self._see(replace(seen, bounds=self.bounds(seen)))
        contacts, friction, remembered = self._at(place)
        bounds = self._bounds(place, contacts, friction)
        if not bounds.exists:
            return self._see(Proved(place, contacts, friction, bounds, remembered, place.multiplier))
        if place.s == 0.0 and np.isfinite(bounds.low if self.model.live is None else bounds.high):
            # Nothing has moved: what the first movement has to overcome, least reaction or largest multiplier.
            found = bounds.forces, bounds.high
        else:
            near = self._balanced(place, contacts, friction, remembered)
            found = near or self._between_bounds(place, contacts, bounds, remembered)
        return self._standing(place, contacts, friction, bounds, *found)

    def _standing(
        self,
        place: Place,
        contacts: Contacts,
        friction: np.ndarray,
        bounds: Admissible | None,
        forces: np.ndarray,
        multiplier: float,
    ) -> Proved:
        measured = self._reaction(place, contacts, forces) if self.model.live is None else multiplier
        return self._see(Proved(place, contacts, friction, bounds, forces, measured))

    def bounds(self, proved: Proved) -> Admissible:
        """The bounds that equilibrium sets at a place."""
        return proved.bounds or self._bounds(proved.place, proved.contacts, proved.friction)

    def _bounds(self, place: Place, contacts: Contacts, friction: np.ndarray) -> Admissible:
        model = self.model
        rate = None if model.live is not None else self.driver.rate(place.s)
        bounds = admissible(
            model, place.pose, contacts, friction, rate, vertex=place.s == 0.0, gap=self._closed_gap(place)
        )
        self.steps.programs += bounds.programs
        return bounds

    def _at(self, place: Place) -> tuple[Contacts, np.ndarray, np.ndarray]:
        """The contact points at a place, their friction, and the forces that the place remembers there."""
        contacts = self.steps.around(place.pose)
        friction = self.model.interfaces.friction(self.model.assembly, contacts.block_a, contacts.block_b)
        return contacts, friction, self.steps.remembered(place, contacts)

    def _seen(self, place: Place) -> Proved | None:
        """What was said of this place, where it was the last one asked for."""
        if self.seen is None or self.seen[0].place is not place or self.seen[1] != self._closed_gap(place):
            return None
        return self.seen[0]

    def _see(self, proved: Proved) -> Proved:
        self.seen = proved, self._closed_gap(proved.place)
        return proved

    def _reaction(self, place: Place, contacts: Contacts, forces: np.ndarray) -> float:
        return float((on_supports(self.model, contacts, place.pose, forces) * self.driver.rate(place.s)).sum())

    def _between_bounds(
        self, place: Place, contacts: Contacts, bounds: Admissible, remembered: np.ndarray
    ) -> tuple[np.ndarray, float]:
        """Forces in equilibrium with the reaction, or the multiplier, of the path: a mean of those of the two bounds.

        What lies between two equilibria within friction is one, too.
        """
        if bounds.others is None:
            return bounds.forces, bounds.high
        if self.model.live is None:
            wanted, one, other = (
                self._reaction(place, contacts, f) for f in (remembered, bounds.forces, bounds.others)
            )
        else:
            wanted, one, other = place.multiplier, bounds.high, bounds.low
        part = 0.0 if one == other else float(np.clip((wanted - one) / (other - one), 0.0, 1.0))
        return (1.0 - part) * bounds.forces + part * bounds.others, (1.0 - part) * one + part * other

    def holds(self, proved: Proved | None) -> bool:
        """Whether equilibrium is possible there, under a live load with some of it."""
        return proved is not None and proved.exists and (self.model.live is None or proved.measured > 0.0)

    def _closed_gap(self, place: Place) -> float:
        """Largest gap of contact points that may carry in an equilibrium at a place, in block sizes."""
        if place.s == 0.0 or place.s < self.steps.careful_until:
            return COMPUTED_GAP
        # Not wider than how closely a collapse is to be enclosed.
        return max(COMPUTED_GAP, min(CLOSING_GAP, self.driver.tolerance * self.steps.lever / self.model.length))

    def _balanced(
        self,
        place: Place,
        contacts: Contacts,
        friction: np.ndarray,
        remembered: np.ndarray,
        *,
        at_once: bool = False,
    ) -> tuple[np.ndarray, float] | None:
        """Forces in equilibrium without the drag, near those remembered, or none; open points carry nothing.

        ``at_once``: only where Newton's method finds them.
        """
        model, free = self.model, self.model.assembly.free
        closed = np.flatnonzero(contacts.gaps <= self._closed_gap(place) * model.length)
        d = model.dimension
        columns = (d * closed[:, None] + np.arange(d)).ravel()
        live, live_size = model.scaled_live
        load = model.scaled_load[free].ravel()
        none = np.zeros(len(closed))
        # What has used up its friction goes on doing so: where it slides, forces are no matter of choice.
        mu, normal, shear = friction[closed], remembered[closed, 0], remembered[closed, 1:]
        size = np.linalg.norm(shear, axis=1)
        used_up = (normal > 0.0) & (size >= mu * normal * (1.0 - USED_UP))
        far = np.where(used_up, -1e2 * (1.0 + normal), 0.0)
        on = far[:, None] * np.divide(shear, size[:, None], out=np.zeros_like(shear), where=size[:, None] > 0.0)
        still = Step(
            matrix=wrench_matrix(contacts, place.pose, model.length)[:, columns],
            free=np.repeat(free, len(model.lengths)),
            load=load,
            drag=np.full(len(load), 1e-12),
            gap=none,
            slip=on,
            normal=normal,
            shear=shear,
            friction=mu,
            give=(1.0, 1.0),
            size=1.0,
            live=live[free].ravel() if model.live is not None else None,
            control=live[free].ravel() if model.live is not None else None,
        )
        forces = np.zeros_like(remembered)
        for step in (still,) if at_once else (still, replace(still, slip=np.zeros_like(on))):
            try:
                found = solve_step(
                    step, np.zeros(len(load)), place.multiplier * live_size, by_way=False, at_once=at_once
                )
            except NotSolved:
                continue
            # Where no forces near are in equilibrium, what is left of the drag holds blocks that fly away.
            if np.abs(step.drag * found.motion).max(initial=0.0) < BALANCE_TOLERANCE * model.total_load:
                break
        else:
            return None
        forces[closed] = np.column_stack([found.normal, found.shear])
        return forces, found.multiplier / (live_size or 1.0)
