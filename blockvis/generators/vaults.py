"""Barrel vaults and arches in space."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

import solver
from blockvis.layout.solids import Solid, extruded

from .arches import arch
from .assembled import assembled
from .dimensions import above_zero, whole


def extruded_arch(
    *,
    radius: float = 1.0,
    thickness_ratio: float = 0.15,
    embrace: float = 180.0,
    voussoirs: int = 12,
    depth: float = 0.5,
    density: float = 2000.0,
) -> solver.Assembly:
    """Build a circular arch of equal voussoirs between two springers, in space.

    Parameters
    ----------
    radius, thickness_ratio, embrace, voussoirs
        As in :func:`arch`.
    depth : float [m]
        Along y, half to each side of y = 0.
    density : float [kg/m³]

    Returns
    -------
    solver.Assembly
        The blocks of :func:`arch`, its plane upright: x to the right, z up.

    Examples
    --------
    >>> extruded_arch(voussoirs=12).dimension
    3
    """
    depth = above_zero("depth", depth)
    plane = arch(radius=radius, thickness_ratio=thickness_ratio, embrace=embrace, voussoirs=voussoirs, density=density)
    return _extruded(plane, depth, density, "voussoir {0}")


def barrel_vault(
    *,
    radius: float = 1.0,
    thickness_ratio: float = 0.15,
    embrace: float = 180.0,
    voussoirs: int = 12,
    length: float = 1.5,
    stones: int = 3,
    springers: int = 1,
    density: float = 2000.0,
) -> solver.Assembly:
    """Build a barrel vault along y, the joints of each course half a stone from those of the next.

    Parameters
    ----------
    radius : float [m]
        Of the middle of the shell.
    thickness_ratio : float
        Thickness over radius.
    embrace : float [degrees]
        Angle between the springing joints, at most 180.
    voussoirs : int
        Number of courses from springer to springer.
    length : float [m]
        Along y, half to each side of y = 0.
    stones : int
        Number of stones along a course; every second course begins and ends with half a stone.
    springers : int
        Number of supports along each side: more than one can settle by halves.
    density : float [kg/m³]

    Returns
    -------
    solver.Assembly
        Stones "stone 1-1" (course from the left, stone along y), then "left springer" (fixed) and "right springer"
        (moving), with numbers along y where there are several.

    Examples
    --------
    >>> barrel_vault(voussoirs=12, stones=3).n_blocks
    44
    """
    along, length = whole("stones", stones, 1), above_zero("length", length)
    n = whole("springers", springers, 1)
    plane = arch(radius=radius, thickness_ratio=thickness_ratio, embrace=embrace, voussoirs=voussoirs, density=density)
    return _extruded(plane, length, density, "stone {0}-{1}", along, n)


def _extruded(
    plane: solver.Assembly, length: float, density: float, name: str, stones: int = 1, springers: int = 1
) -> solver.Assembly:
    """Extrude an arch along y, cut there in stones and springers."""
    straight = length * np.linspace(-0.5, 0.5, stones + 1)
    broken = np.unique(np.concatenate([straight[[0, -1]], (straight[1:] + straight[:-1]) / 2.0]))
    halves = length * np.linspace(-0.5, 0.5, springers + 1)
    free: list[tuple[str, Solid]] = []
    supports: list[tuple[str, str, Solid]] = []
    for block, role in enumerate(plane.roles.tolist()):
        cuts = halves if not plane.free[block] else straight if block % 2 == 0 or stones == 1 else broken
        for k, (start, end) in enumerate(pairwise(cuts.tolist()), start=1):
            solid = extruded(plane.outline(block), start, end)
            if plane.free[block]:
                free.append((name.format(block + 1, k), solid))
            else:
                supports.append((plane.names[block] + f" {k}" * (springers > 1), role, solid))
    return assembled(free, supports, density=density)
