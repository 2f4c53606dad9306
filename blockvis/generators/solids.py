"""Assemblies of named blocks in space on their supports."""

from __future__ import annotations

from collections.abc import Sequence

import solver
from blockvis.layout.solids import Solid
from solver import mechanics

from .dimensions import above_zero


def assembled(
    free: Sequence[tuple[str, Solid]],
    supports: Sequence[tuple[str, str, Solid]],
    *,
    density: float,
    material: str = "stone",
) -> solver.Assembly:
    """Make an assembly of named blocks on their supports.

    Parameters
    ----------
    free : sequence of (name, Solid)
    supports : sequence of (name, role, Solid)
    density : float [kg/m³]
    material : str
        Of the free blocks; supports are "ground".
    """
    return solver.Assembly.from_solids(
        [solid for _, solid in free] + [solid for _, _, solid in supports],
        names=[name for name, _ in free] + [name for name, _, _ in supports],
        roles=[mechanics.FREE] * len(free) + [role for _, role, _ in supports],
        materials=[material] * len(free) + ["ground"] * len(supports),
        density=above_zero("density", density, "kg/m³"),
    )
