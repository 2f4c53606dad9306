"""Certificate: measures of the error of a result, each computed from forces, geometry and loads."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import astuple, dataclass

import numpy as np

from solver.geometry.contacts import Contacts
from solver.tolerances import CARRYING_FRACTION


@dataclass(frozen=True)
class Certificate:
    """Measures of the error of a result: with W the total load on the free blocks, n and t contact forces.

    Attributes
    ----------
    equilibrium_residual : float
        max |A f + loads| / W over the free blocks, moments over the block size: largest force out of balance.
    friction_excess : float
        max (|T| - μ N - c) / W over the contact points, at least 0: shear force beyond friction and cohesion; also of
        shear and torsion of a face where this is that of a uniform pressure.
    carrying_gap : float [m]
        Largest gap of a contact point that carries more than a millionth of the largest normal force.
    largest_penetration : float [m]
        max (-gap, 0): deepest overlap at a contact point after the geometry has been updated.
    duality_gap : float
        Relative difference of the static and the kinematic value of the programs that bound the result.
    energy_residual : float
        |works of dead and live loads - on the supports - of friction| / the sum of their sizes in each step, since the
        phase began: the energy that viscosity, compliance and steps dissipate. Not a number where no path led there.
    kinematic_violation : float
        max (μ |T(q)| - N(q), 0) / max |q| of the mechanism q of a limit load. Not a number where there is none.
    """

    equilibrium_residual: float = math.nan
    friction_excess: float = math.nan
    carrying_gap: float = math.nan
    largest_penetration: float = math.nan
    duality_gap: float = math.nan
    energy_residual: float = math.nan
    kinematic_violation: float = math.nan


def carrying_gap(contacts: Contacts, forces: np.ndarray) -> float:
    """Largest gap [m] of the contact points that carry, from their (n, d) forces in any unit."""
    normal = forces[:, 0]
    return float(contacts.gaps[normal > CARRYING_FRACTION * normal.max(initial=0.0)].max(initial=0.0))


def friction_excess(forces: np.ndarray, friction: np.ndarray, cohesion: np.ndarray | float = 0.0) -> float:
    """Largest shear force beyond friction and cohesion, from (n, d) forces, in their unit."""
    shear = np.linalg.norm(forces[:, 1:], axis=1)
    return float((shear - friction * forces[:, 0] - cohesion).max(initial=0.0))


def largest_penetration(contacts: Contacts) -> float:
    """Deepest overlap at a contact point [m]."""
    return float(np.maximum(-contacts.gaps, 0.0).max(initial=0.0))


def worst_of(certificates: Iterable[Certificate]) -> Certificate | None:
    """Largest of each measure over some results, nan where none has it; None without a result."""
    measures = [astuple(one) for one in certificates]
    return Certificate(*np.fmax.reduce(measures).tolist()) if measures else None
