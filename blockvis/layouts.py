"""Parametric layouts in masonry terms; each comes with its ground."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

import solver

__all__ = ["arch"]


def arch(
    *,
    radius: float = 1.0,
    thickness_ratio: float = 0.15,
    embrace: float = 180.0,
    voussoirs: int = 12,
    density: float = 2000.0,
    depth: float = 1.0,
) -> solver.Assembly:
    """A circular arch of equal voussoirs between two springers.

    Parameters
    ----------
    radius : float [m]
        Of the centreline.
    thickness_ratio : float
        Thickness over radius.
    embrace : float [degrees]
        Angle between the springing joints, at most 180.
    voussoirs : int
        Quadrilaterals with all four corners on the circles.
    density : float [kg/m³]
    depth : float [m]
        Out of plane.

    Returns
    -------
    solver.Assembly
        Voussoirs from left to right, then "left springer" (fixed) and "right springer" (moving), whose
        joints are twice as wide as the arch is thick.

    Examples
    --------
    >>> arch(voussoirs=12).n_blocks
    14
    """
    if not 0.0 < embrace <= 180.0:
        raise ValueError(f"embrace is {embrace:g} degrees; give an angle above 0 and up to 180")
    if voussoirs < 2:
        raise ValueError(f"an arch needs at least 2 voussoirs, not {voussoirs}")
    if not 0.0 < thickness_ratio < 2.0:
        raise ValueError(f"thickness_ratio is {thickness_ratio:g}; give thickness / radius between 0 and 2")
    half = math.radians(embrace) / 2.0
    angles = np.linspace(math.pi / 2 + half, math.pi / 2 - half, voussoirs + 1)
    thickness = thickness_ratio * radius
    inner, outer = radius - thickness / 2.0, radius + thickness / 2.0

    def at(r: float, angle: float) -> tuple[float, float]:
        return r * math.cos(angle), r * math.sin(angle)

    outlines = [np.array([at(inner, a), at(outer, a), at(outer, b), at(inner, b)]) for a, b in pairwise(angles)]
    names = [f"voussoir {i + 1}" for i in range(voussoirs)]
    for angle, sense in ((angles[0], 1.0), (angles[-1], -1.0)):
        away = 2.0 * thickness * sense * np.array([-math.sin(angle), math.cos(angle)])
        joint = np.array([at(inner - thickness / 2.0, angle), at(outer + thickness / 2.0, angle)])
        outlines.append(np.array([joint[0], joint[1], joint[1] + away, joint[0] + away]))
    return solver.Assembly.from_outlines(
        outlines,
        names=[*names, "left springer", "right springer"],
        roles=[solver.FREE] * voussoirs + [solver.FIXED, solver.MOVING],
        materials=["stone"] * voussoirs + ["ground"] * 2,
        density=density,
        thickness=depth,
    )
