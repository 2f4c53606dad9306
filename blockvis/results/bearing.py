"""What the ground that gives carries: reaction, contact pressure, and tilt of what stands on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import solver
from blockvis.layout.linked import within_reach
from solver.mechanics import Contacts

#: Contact points of a block within this of each other along the face, in block sizes, share the area of one end.
ONE_END = 0.02


@dataclass(frozen=True)
class Bearing:
    """A support with a stiffness, at an increment."""

    name: str
    force: float  #: [N] Normal to its face.
    #: [Pa] The mean, and that of the end of a block with the largest, N/A + 2M/(Ab): of a continuous bed it is 6M/(Ab).
    pressures: tuple[float, float]
    tilt: float  #: [rad] By which a block on it has turned, the largest of them.

    def __str__(self) -> str:
        """One line."""
        mean, most = self.pressures
        return (
            f"ground '{self.name}': {self.force:.6g} N, pressure {mean:.4g} Pa in the mean and {most:.4g} Pa at most, "
            f"what stands on it has turned by {self.tilt:.3g} rad"
        )


def bearings(response: solver.Response, increment: solver.Increment) -> list[Bearing]:
    """List what each support with a stiffness carries at an increment, in the order of the blocks."""
    assembly, contacts, normal = response.assembly, increment.contacts, increment.forces[:, 0]
    found = []
    for support in np.flatnonzero(~np.isnan(response.interfaces.ground_stiffness(assembly))).tolist():
        at = ((contacts.block_a == support) | (contacts.block_b == support)) & (contacts.areas > 0.0)
        area, force, ends = contacts.areas[at], normal[at], _ends(assembly, contacts[at], support)
        other = (contacts.block_a + contacts.block_b - support)[at & (normal > 0.0)]
        turned = np.linalg.norm(increment.pose.rotations[other][:, -1:] if assembly.dimension == 2 else
                                increment.pose.rotations[other][:, :2], axis=1)  # fmt: skip
        most = (np.bincount(ends, force) / np.bincount(ends, area)).max(initial=0.0)
        pressures = float(force.sum() / max(area.sum(), 1e-300)), float(most)
        found.append(Bearing(assembly.names[support], float(force.sum()), pressures, float(turned.max(initial=0.0))))
    return found


def _ends(assembly: solver.Assembly, contacts: Contacts, support: int) -> np.ndarray:
    """(n,) int array: number of the end of a block, on a support, to which each contact point belongs.

    A corner that lies on a corner has two points, which share its force alike whatever the area of each.
    """
    if not len(contacts):
        return np.zeros(0, dtype=int)
    upright = np.where(contacts.block_b == support, 1.0, -1.0) @ contacts.frames[:, 0]
    upright = upright / max(float(np.linalg.norm(upright)), 1e-300)
    places = contacts.points - contacts.points.mean(axis=0)
    along = (places - np.outer(places @ upright, upright)) / (ONE_END * assembly.block_size)
    # Points of different blocks are never near each other.
    other = 10.0 * (contacts.block_a + contacts.block_b - support)
    return within_reach(np.column_stack([along, other]), 1.0)
