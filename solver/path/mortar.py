"""Mortar and elastic joints along a path: strength that is lost point by point, and give that stays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.assembly import find_contacts
from solver.geometry.contacts import Contacts, matched_contacts, successors
from solver.kinematics import Pose, moved_vertices
from solver.program.model import Model
from solver.results.increment import Bonds, State
from solver.tolerances import COMPUTED_GAP, DRAWN_GAP

from .state import Place

#: Opening and slip, in block sizes, over which a brittle point loses its strength: small, but no rounding.
BRITTLE = 1e-6


@dataclass(frozen=True)
class JointPoints:
    """What the joints add to each of n contact points, in units of the program."""

    strength: np.ndarray  #: (n, 2): largest tension and cohesive shear force of a point that has lost nothing
    left: np.ndarray  #: (n,): part of them that is left
    fracture: np.ndarray  #: (n, 2): opening and slip, in block sizes, over which they fall to nothing
    give: np.ndarray  #: (n, d): elastic compliance, which stays
    rest: np.ndarray  #: (n,) [m]: gap without force
    length: float  #: [m], unit of the program

    @property
    def tension(self) -> np.ndarray:
        """(n,) array: largest tension that is left."""
        return np.asarray(self.strength[:, 0] * self.left)

    @property
    def cohesion(self) -> np.ndarray:
        """(n,) array: cohesive shear force that is left."""
        return np.asarray(self.strength[:, 1] * self.left)

    def beyond_give(self, gaps: np.ndarray, normal: np.ndarray | float = 0.0) -> np.ndarray:
        """(n,) array [m]: gaps, (n,) array [m], beyond the give of joints under these normal forces."""
        return np.asarray(gaps - self.rest + self.length * (self.give[:, 0] * normal))

    def after(self, moved: np.ndarray, before: JointPoints) -> JointPoints:
        """The points once they have opened beyond their give and slipped, (n, 2) in block sizes, from those before."""
        opened, slipped = (moved / self.fracture).T
        left = np.minimum(before.left - slipped, 1.0 - opened)
        return replace(self, left=np.clip(left, 0.0, self.left))


class Mortar:
    """The mortar of a model, and the elastic joints."""

    def __init__(self, model: Model) -> None:
        self.model, self.present = model, model.interfaces.mortar

    def cast(self, place: Place, contacts: Contacts, closed_gap: float | None = None) -> Place:
        """The place with all of its closed joints whole: with gaps up to this one [m], or what drawings may have."""
        assembly = self.model.assembly
        if not self.present and self.model.interfaces.dry:
            return place
        # What is accepted of a drawing as a joint is filled.
        accepted = max(COMPUTED_GAP * self.model.length, DRAWN_GAP * float(assembly.widths.min()))
        gap = accepted if closed_gap is None else closed_gap
        closed = contacts[contacts.gaps <= gap]
        areas, left = closed.areas.copy(), np.zeros(len(closed))
        # Of faces between closed points; a hinge keeps its part of the drawn one. A corner that touches alone gives as
        # the face does that opens there, and has nothing of its strength.
        for pose, reach in ((Pose.initial(assembly), accepted), (place.pose, gap)):
            found = find_contacts(assembly, moved_vertices(assembly, pose), reach)
            number, same = matched_contacts(closed, wide := found[found.areas > 0.0])
            areas[same], left[same] = wide.areas[number[same]], 1.0
        whole = Bonds(closed.features[:, :3], areas, left, np.zeros(len(closed)))
        joints = self.points(replace(place, bonds=whole), closed)
        filled = (joints.strength > 0.0).any(axis=1) | (joints.give > 0.0).any(axis=1)
        return replace(place, bonds=replace(whole, rest=np.where(filled, closed.gaps, 0.0)))

    def at_rest(self, place: Place, contacts: Contacts, forces: np.ndarray) -> Place:
        """The place with elastic joints compressed by forces in units of the program, as they are drawn."""
        number, same = matched_contacts(contacts, place.bonds)
        rest, give = place.bonds.rest.copy(), self.points(place, contacts).give[:, 0]
        rest[number[same]] += (give * forces[:, 0])[same] * self.model.length
        return replace(place, bonds=replace(place.bonds, rest=rest))

    def kept(self, place: Place, contacts: Contacts, bonds: Bonds) -> Place:
        """The place with what a path has left of its joints, elastic ones under the force of their gap."""
        place = replace(place, bonds=bonds)
        joints = self.points(place, contacts)
        gives, forces = joints.give[:, 0] > 0.0, np.zeros_like(contacts.points)
        if not gives.any():
            return place
        pressed = -joints.beyond_give(contacts.gaps)[gives] / (joints.length * joints.give[gives, 0])
        forces[gives, 0] = np.maximum(pressed, -joints.tension[gives])
        return replace(place, contacts=contacts, forces=forces, trial=forces, followed=forces[:, 0])

    def points(self, place: Place, contacts: Contacts) -> JointPoints:
        """What the joints add to contact points at a place."""
        model, (n, d) = self.model, contacts.points.shape
        if not self.present:
            none = np.zeros(n)
            return JointPoints(np.zeros((n, 2)), none, np.ones((n, 2)), np.zeros((n, d)), none, model.length)
        place = self.renamed(place, contacts)
        interfaces, blocks = model.interfaces, (model.assembly, contacts.block_a, contacts.block_b)
        names = ("normal_stiffness", "shear_stiffness", "fracture_opening", "fracture_slip")
        cohesion, tension, *of_joints = interfaces.values(*blocks, "cohesion", "tensile_strength", *names)
        bonds = place.bonds.of(contacts)
        friction = interfaces.friction(*blocks)
        # Corners alone, and points of members, have no area.
        across, along = (
            np.divide(model.force, k * bonds.areas * model.length, out=np.zeros(n), where=k * bonds.areas > 0.0)
            for k in (np.where(np.isfinite(k), k, 0.0) for k in of_joints[:2])
        )
        # Where friction is scattered tension ends where shear strength does.
        strength = np.column_stack([np.minimum(tension, cohesion / np.maximum(friction, 1e-300)), cohesion])
        return JointPoints(
            strength=strength * (bonds.areas / model.force)[:, None],
            left=bonds.left,
            fracture=np.maximum(np.column_stack(of_joints[2:]) / model.length, BRITTLE),
            give=np.column_stack([across] + [along] * (d - 1)),
            rest=bonds.rest,
            length=model.length,
        )

    def told(self, state: State, place: Place) -> State:
        """The arrays of an increment with those that tell of its joints; dry rigid ones have none."""
        interfaces, contacts = self.model.interfaces, state.contacts
        if not self.present:
            return state
        joints, bonds = self.points(place, contacts), self.renamed(place, contacts).bonds
        left = np.where(joints.cohesion > 0.0, joints.left, 0.0)
        return replace(
            state,
            bonded=bonds.of(contacts).areas,
            intact=left if any(law.bonds for law in interfaces.laws) else state.intact,
            unloaded=joints.rest if interfaces.elastic or joints.rest.any() else state.unloaded,
        )

    def renamed(self, place: Place, contacts: Contacts) -> Place:
        """The place with its bonds at these contact points: one that vanishes passes its bond to the nearest ones."""
        bonds, before = place.bonds, place.contacts
        if not len(bonds) or before is None or not len(contacts) or not len(before):
            return place
        number, same = matched_contacts(before, bonds)
        _, kept = matched_contacts(before, contacts)
        vanished = np.flatnonzero(same & ~kept)
        if not len(vanished):
            return place
        vanished, successor, part = successors(before, vanished, contacts, self.model.length)
        # Several that pass to one add up.
        old = number[vanished]
        stays = np.setdiff1d(np.arange(len(bonds)), old)
        part, old = np.concatenate([np.ones(len(stays)), part]), np.concatenate([stays, old])
        names = np.concatenate([bonds.features[stays], contacts.features[successor, :3]])
        features, which = np.unique(names, axis=0, return_inverse=True)
        which, left = which.ravel(), np.ones(len(features))
        np.minimum.at(left, which, bonds.left[old])
        rest = np.bincount(which, part * bonds.rest[old]) / np.bincount(which, part)
        return replace(place, bonds=Bonds(features, np.bincount(which, part * bonds.areas[old]), left, rest))

    def bonds(self, place: Place, contacts: Contacts, left: np.ndarray) -> Bonds:
        """The bonds of a place of whose strength contact points have this part left, (n,) array."""
        number, bonded = matched_contacts(contacts, place.bonds)
        of_bonds = place.bonds.left.copy()
        of_bonds[number[bonded]] = left[bonded]
        return replace(place.bonds, left=of_bonds)
