"""Certificate: the measures by which an increment proves itself."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields


@dataclass(frozen=True)
class Certificate:
    """Measures by which an increment proves itself.

    Attributes
    ----------
    equilibrium_residual : float
        Largest unbalanced force on a free block (moments over the block size), relative to the total weight.
    largest_penetration : float [m]
        Deepest overlap at a contact point after the geometry has been updated.
    duality_gap : float
        Difference between the static (lower bound) and the kinematic (upper bound) objective, relative.
    complementarity : float
        Σ force · distance from sliding or opening over all contact points, relative like the gap.
    kinematic_violation : float
        Largest violation of N + g ≥ μ|T|, relative to the block size.
    energy_residual : float
        Work of the loads since the start of the phase, less the work done on the supports and that of friction,
        relative to the three: what drag, give and the steps have taken. 0 where it was not worked out: in falls, and by
        the linear program.
    """

    equilibrium_residual: float
    largest_penetration: float
    duality_gap: float
    complementarity: float
    kinematic_violation: float
    energy_residual: float = 0.0


def worst_of(certificates: Iterable[Certificate]) -> Certificate | None:
    """Largest of each measure over some increments, nan where none has it; None without an increment."""
    found = tuple(certificates)
    if not found:
        return None
    measures = ((getattr(one, field.name) for one in found) for field in fields(Certificate))
    return Certificate(
        *(max((value for value in values if not math.isnan(value)), default=math.nan) for values in measures)
    )
