"""Domes of courses and lunes."""

from __future__ import annotations

import math

import numpy as np

import solver
from blockvis.layout.solids import Solid, between
from solver import mechanics

from .assembled import assembled
from .dimensions import above_zero, true_or_false, whole

#: Most stones around a dome.
MOST_LUNES = 720


def dome(
    *,
    radius: float = 1.0,
    thickness_ratio: float = 0.12,
    lunes: int = 8,
    courses: int = 6,
    cap: float = 10.0,
    springing: float = 90.0,
    oculus: bool = False,
    density: float = 2000.0,
) -> solver.Assembly:
    """Build a spherical dome of equal lunes, each of one stone a course, under a cap.

    Parameters
    ----------
    radius : float [m]
        Of the middle of the shell.
    thickness_ratio : float
        Thickness over radius.
    lunes : int
        Number of stones around the dome, whose corners lie on the spheres.
    courses : int
        Number of stones from the springing to the cap.
    cap : float [degrees]
        Angle at the centre between the axis and the edge of the cap.
    springing : float [degrees]
        Angle at the centre between the axis and the springing; 90 is a hemisphere.
    oculus : bool
        Whether the cap is left out.
    density : float [kg/m³]

    Returns
    -------
    solver.Assembly
        Stones "stone 1-1" (course from the springing, lune), "cap", and a support "springer 1" ... under each lune,
        all moving: ``radial_from = [0, 0]`` spreads them. The axis is x = y = 0, the centre of the spheres z = 0.

    Examples
    --------
    >>> dome(lunes=8, courses=6).n_blocks
    57
    """
    radius, thickness = above_zero("radius", radius), above_zero("thickness_ratio", thickness_ratio, "") * radius
    if thickness > radius:
        raise ValueError(
            f"thickness_ratio is {thickness_ratio:g}; give at most 1: the springers, twice as thick as the dome, end "
            "at its axis"
        )
    cap, springing = above_zero("cap", cap, "degrees"), above_zero("springing", springing, "degrees")
    n, rings = whole("lunes", lunes, 3, MOST_LUNES), whole("courses", courses, 1)
    if not cap < springing <= 90.0:
        raise ValueError(
            f"cap is {cap:g} and springing {springing:g} degrees; give 0 < cap < springing, and at most 90"
        )
    inner, outer = radius - thickness / 2.0, radius + thickness / 2.0
    beds = np.radians(np.linspace(springing, cap, rings + 1))
    around = 2.0 * math.pi * np.arange(n) / n

    def ring(r: float, bed: int) -> np.ndarray:
        # The cosine of 90 degrees is not quite 0.
        height = 0.0 if springing == 90.0 and bed == 0 else math.cos(beds[bed])
        away = math.sin(beds[bed])
        return r * np.column_stack([away * np.cos(around), away * np.sin(around), np.full(n, height)])

    def joint(first: float, last: float, bed: int, lune: int) -> np.ndarray:
        """(4, 3) array [m]: the bed joint of a stone between two radii."""
        low, high = ring(first, bed), ring(last, bed)
        following = (lune + 1) % n
        return np.array([low[lune], low[following], high[following], high[lune]])

    stones: list[tuple[str, Solid]] = [
        (f"stone {k + 1}-{j + 1}", between(joint(inner, outer, k, j), joint(inner, outer, k + 1, j)))
        for k in range(rings)
        for j in range(n)
    ]
    if not true_or_false("oculus", oculus):
        stones.append(("cap", between(ring(inner, rings), ring(outer, rings))))
    down = np.array([0.0, 0.0, -2.0 * thickness])
    bearings = [joint(inner - thickness / 2.0, outer + thickness / 2.0, 0, j) for j in range(n)]
    springers = [(f"springer {j + 1}", mechanics.MOVING, between(q + down, q)) for j, q in enumerate(bearings)]
    return assembled(stones, springers, density=density)
