"""Assemblies of named blocks on their supports."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import solver
from blockvis.layout.layout import assembly_of
from solver import mechanics

from .dimensions import above_zero


def assembled(
    free: Sequence[tuple[str, Any]],
    supports: Sequence[tuple[str, str, Any]],
    *,
    density: float,
    depth: float | None = None,
    material: str | Sequence[str] = "stone",
) -> solver.Assembly:
    """Make an assembly of named blocks, of one material or one for each, on their supports, which are "ground".

    In the plane shapes are (n, 2) arrays [m] and have a depth [m], in space they are Solids. The density is in kg/m³.
    """
    shapes = [shape for _, shape in free] + [shape for _, _, shape in supports]
    materials = [material] * len(free) if isinstance(material, str) else list(material)
    of_blocks: dict[str, Any] = {
        "names": [name for name, _ in free] + [name for name, _, _ in supports],
        "roles": [mechanics.FREE] * len(free) + [role for _, role, _ in supports],
        "materials": materials + ["ground"] * len(supports),
        "density": above_zero("density", density, "kg/m³"),
    }
    return assembly_of(shapes, None if depth is None else above_zero("depth", depth), **of_blocks)
