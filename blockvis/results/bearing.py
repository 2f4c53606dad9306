"""What the ground that gives carries: reaction, contact pressure, and tilt of what stands on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import solver


@dataclass(frozen=True)
class Bearing:
    """A support with a stiffness, at an increment.

    Attributes
    ----------
    name : str
    force : float [N]
        Normal to its face.
    pressures : (float, float) [Pa]
        The mean, and that of the part of the face with the largest.
    tilt : float [rad]
        By which a block on it has turned, the largest of them.
    """

    name: str
    force: float
    pressures: tuple[float, float]
    tilt: float

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
        area, force = contacts.areas[at], normal[at]
        other = (contacts.block_a + contacts.block_b - support)[at & (normal > 0.0)]
        turned = np.linalg.norm(increment.pose.rotations[other][:, -1:] if assembly.dimension == 2 else
                                increment.pose.rotations[other][:, :2], axis=1)  # fmt: skip
        pressures = float(force.sum() / max(area.sum(), 1e-300)), float((force / area).max(initial=0.0))
        found.append(Bearing(assembly.names[support], float(force.sum()), pressures, float(turned.max(initial=0.0))))
    return found
