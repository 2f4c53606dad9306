"""Ties, props and bars along a path: contact points whose give stays, with a largest force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.geometry.contacts import Contacts, joined_contacts
from solver.kinematics import Pose
from solver.program.model import Model
from solver.ties import (
    ABSENT,
    BROKEN,
    PROP,
    TieForces,
    held_ties,
    is_member,
    member_contacts,
    member_forces,
    member_states,
    present_members,
    tie_ends,
    tie_lengths,
)

from .state import Place

#: Error of the length of a member, as a part of the gap of contact points that carry: that of the geometry.
GIVE = 1e-2

#: Part of its strength by which a member is stretched beyond it in the step in which it first reaches it, at most.
STRETCHED = 1e-2


class Members:
    """The ties, props and bars of a model."""

    def __init__(self, model: Model) -> None:
        self.model, self.ties = model, model.ties
        self.strength = np.array([tie.strength for tie in self.ties]) / model.force
        self.brittle = np.array([tie.brittle for tie in self.ties], dtype=bool)
        self.give = np.array([tie.prestress / tie.stiffness * (-1.0 if tie.kind == PROP else 1.0) for tie in self.ties])
        # In units of the program.
        self.compliance = model.force / (np.array([tie.stiffness for tie in self.ties]) * model.length)
        self.held = held_ties(self.ties, model.fallen)

    def installed(self, place: Place, phase: int, told: TieForces | None = None) -> Place:
        """Install the members of a phase, from 0, at the geometry of a place, or all as an increment tells of them."""
        if told is not None:
            before = np.where(told.states == ABSENT, np.nan, tie_lengths(told.ends) - told.elongations)
            return replace(place, tie_lengths=np.stack([before, told.rest], axis=1))
        lengths = place.tie_lengths if len(place.tie_lengths) else np.full((len(self.ties), 2), np.nan)
        new = np.array([tie.phase == phase + 1 for tie in self.ties])
        length = tie_lengths(tie_ends(self.ties, self.model.assembly, place.pose))
        both = np.column_stack([length, length - self.give])
        return replace(place, tie_lengths=np.where(new[:, None], both, lengths))

    def beside(self, contacts: Contacts, pose: Pose, lengths: np.ndarray) -> Contacts:
        """The contact points of blocks, then those of the members that are there."""
        if not len(lengths):
            return contacts
        rest = np.where(self.held, lengths[:, 1], np.nan)
        features = present_members(self.ties, rest)
        return joined_contacts([contacts, member_contacts(self.ties, self.model.assembly, pose, rest, features)])

    def measured(self, contacts: Contacts, pose: Pose, lengths: np.ndarray) -> Contacts:
        """The same contact points at another pose."""
        return member_contacts(self.ties, self.model.assembly, pose, lengths[:, 1], contacts.features)

    def largest_forces(self, contacts: Contacts) -> np.ndarray:
        """(n,) array: largest normal forces of contact points; infinite between blocks."""
        members = is_member(contacts)
        largest = np.full(len(contacts), np.inf)
        largest[members] = self.strength[contacts.features[members, 1]]
        return largest

    def force_range(self, contacts: Contacts, gap: float) -> np.ndarray:
        """(2, n) array: least and largest forces of contact points of members at a pose.

        A member may carry what it carries anywhere within a part of the gap of contact points, in block sizes.
        """
        number, give = contacts.features[:, 1], GIVE * gap * np.array([[-1.0], [1.0]])
        forces = (give - contacts.gaps / self.model.length) / self.compliance[number]
        return np.clip(forces, 0.0, self.strength[number])

    def across(
        self, contacts: Contacts, lengths: np.ndarray, forces: np.ndarray, bound: np.ndarray, compliance: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Bounds and compliances with those across members under tension: their forces turn with them, by F / l."""
        bound, compliance = bound.copy(), compliance.copy()
        pulls = np.flatnonzero(is_member(contacts) & (contacts.features[:, 2] == 0) & (forces[:, 0] > 0.0))
        length = (lengths[contacts.features[pulls, 1], 1] - contacts.gaps[pulls]) / self.model.length
        bound[pulls] = forces[pulls, 0]
        compliance[pulls, 1:] = (length / forces[pulls, 0])[:, None]
        return bound, compliance

    def after(self, contacts: Contacts, trial: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """(n_ties, 2) array: lengths after a step to contact points with these trial forces: give stays."""
        full = self._at_strength(contacts, trial)
        number, sense = contacts.features[full, 1], np.where(contacts.features[full, 2] == 1, -1.0, 1.0)
        give = -contacts.gaps[full] - self.strength[number] * self.compliance[number] * self.model.length
        lengths = lengths.copy()
        lengths[number, 1] += sense * np.maximum(give, 0.0)
        return lengths

    def part_to_strength(self, place: Place, new: Place) -> float:
        """Part of a step, from place to place, in which a member first comes to its strength; 1 where none does."""
        assert new.contacts is not None
        full = self._at_strength(new.contacts, new.trial)
        if not len(full):
            return 1.0
        started = self.measured(new.contacts[full], place.pose, place.tie_lengths)
        number, after = started.features[:, 1], new.trial[full, 0]
        before, strength = -started.gaps / self.model.length / self.compliance[number], self.strength[number]
        # Those that have yielded are at their strength, or a little below it as joints give.
        whole = np.isclose(place.tie_lengths[:, 1], place.tie_lengths[:, 0] - self.give, rtol=1e-12, atol=0.0)[number]
        far = whole & (after > (1.0 + STRETCHED) * strength)
        return float((((1.0 + 0.5 * STRETCHED) * strength - before) / (after - before))[far].min(initial=1.0))

    def without_broken(self, place: Place) -> Place:
        """The place without brittle members at their strength: they carry it there, and break as they go on."""
        if place.contacts is None or not self.brittle.any():
            return place
        number, lengths = place.contacts.features[self._at_strength(place.contacts, place.trial), 1], place.tie_lengths
        broken = self.brittle & np.isin(np.arange(len(self.ties)), number)
        return replace(place, tie_lengths=np.where(broken[:, None] & [False, True], np.nan, lengths))

    def _at_strength(self, contacts: Contacts, trial: np.ndarray) -> np.ndarray:
        """Numbers of the contact points of members that have come to their strength, by their trial forces."""
        members = np.flatnonzero(is_member(contacts))
        return members[trial[members, 0] >= self.strength[contacts.features[members, 1]]]

    def told(self, contacts: Contacts, forces: np.ndarray, pose: Pose, lengths: np.ndarray) -> TieForces:
        """What the members do at a place, from forces in units of the program."""
        if not self.ties:
            return TieForces()
        force, ends = member_forces(contacts, forces, len(self.ties)), tie_ends(self.ties, self.model.assembly, pose)
        # Those that break do not yield before.
        strength, lengths = np.where(self.brittle, np.inf, self.strength), np.where(self.held[:, None], lengths, np.nan)
        state = member_states(np.abs(force), strength, float(np.abs(forces).max(initial=0.0)))
        state = np.select(list(np.isnan(lengths.T)), [ABSENT, BROKEN], state)
        return TieForces(force * self.model.force, tie_lengths(ends) - lengths[:, 0], lengths[:, 1], state, ends)
