"""Structures on one or two feet: column, portal, arch on piers, buttressed arch."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

import solver
from blockvis.layout.outlines import rectangle, without_collinear
from solver import mechanics

from .arches import segmental_joints, voussoir_outlines
from .assembled import assembled
from .dimensions import above_zero, whole

MIRROR = np.array([-1.0, 1.0])


def column(
    *, blocks: int = 5, width: float = 0.5, block_height: float = 0.4, density: float = 2000.0, depth: float = 1.0
) -> solver.Assembly:
    """Build a column of equal blocks on a ground that moves.

    Parameters
    ----------
    blocks : int
    width, block_height : float [m]
    density : float [kg/m³]
    depth : float [m]
        Out of plane.

    Returns
    -------
    solver.Assembly
        "block 1" at the bottom to the top, then "ground" (moving), twice as wide as the column, with the middle of
        its top at (0, 0).

    Examples
    --------
    >>> column(blocks=3).names
    ('block 1', 'block 2', 'block 3', 'ground')
    """
    n = whole("blocks", blocks, 1)
    width, height = above_zero("width", width), above_zero("block_height", block_height)
    levels = height * np.arange(n + 1)
    free = [
        (f"block {i}", rectangle(-width / 2.0, low, width / 2.0, high))
        for i, (low, high) in enumerate(pairwise(levels), start=1)
    ]
    ground = ("ground", mechanics.MOVING, rectangle(-width, -height, width, 0.0))
    return assembled(free, [ground], density=density, depth=depth)


def portal(
    *,
    span: float = 2.0,
    height: float = 2.4,
    column_width: float = 0.5,
    column_blocks: int = 4,
    lintel_height: float = 0.5,
    density: float = 2000.0,
    depth: float = 1.0,
) -> solver.Assembly:
    """Build two columns of blocks that carry a lintel.

    Parameters
    ----------
    span, height : float [m]
        Clear width and height of the opening.
    column_width : float [m]
        The lintel bears on the full width.
    column_blocks : int
        In each column.
    lintel_height : float [m]
    density, depth
        As in :func:`column`.

    Returns
    -------
    solver.Assembly
        "left column 1" (at the bottom) ..., "right column 1" ..., "lintel", "ground left" (fixed), "ground right"
        (moving). The ground is y = 0, the middle of the span x = 0.

    Examples
    --------
    >>> portal(column_blocks=4).n_blocks
    11
    """
    span, height = above_zero("span", span), above_zero("height", height)
    width, lintel_height = above_zero("column_width", column_width), above_zero("lintel_height", lintel_height)
    n = whole("column_blocks", column_blocks, 1)
    inner, outer = span / 2.0, span / 2.0 + width
    levels = np.linspace(0.0, height, n + 1)
    right = [rectangle(inner, low, outer, high) for low, high in pairwise(levels)]
    lintel = rectangle(-outer, height, outer, height + lintel_height)
    return _on_two_feet({"column": right}, [("lintel", lintel)], inner, outer, density, depth)


def arch_on_piers(
    *,
    span: float = 2.0,
    rise: float = 1.0,
    thickness: float = 0.25,
    voussoirs: int = 13,
    pier_width: float = 0.8,
    pier_height: float = 2.0,
    pier_blocks: int = 4,
    density: float = 2000.0,
    depth: float = 1.0,
) -> solver.Assembly:
    """Build a segmental or semicircular arch on two piers.

    Parameters
    ----------
    span, rise : float [m]
        Of the intrados; a rise of half the span gives a semicircle.
    thickness : float [m]
        Of the arch, radial.
    voussoirs : int
    pier_width : float [m]
        At least the horizontal extent of the springing joint.
    pier_height : float [m]
        From the ground to the springing of the intrados.
    pier_blocks : int
        In each pier, 1 for a monolith; the top block has the skewback.
    density, depth
        As in :func:`column`.

    Returns
    -------
    solver.Assembly
        "voussoir 1" ..., "left pier 1" (at the bottom) ..., "right pier 1" ..., "ground left" (fixed), "ground right"
        (moving). The ground is y = 0, the middle of the span x = 0.

    Examples
    --------
    >>> arch_on_piers(voussoirs=13, pier_blocks=4).n_blocks
    23
    """
    voussoir, pier = _arch_and_pier(span, rise, thickness, voussoirs, pier_width, pier_height, pier_blocks)
    return _on_two_feet({"pier": pier}, voussoir, span / 2.0, span / 2.0 + pier_width, density, depth)


def buttressed_arch(
    *,
    span: float = 3.0,
    rise: float = 1.5,
    thickness: float = 0.3,
    voussoirs: int = 15,
    pier_width: float = 0.5,
    pier_height: float = 3.0,
    pier_blocks: int = 6,
    buttress_width: float = 1.2,
    buttress_top: float = 0.4,
    buttress_height: float = 2.5,
    buttress_blocks: int = 5,
    density: float = 2000.0,
    depth: float = 1.0,
) -> solver.Assembly:
    """Build an arch on piers too slender for its thrust, each with a battered buttress against its outer face.

    Parameters
    ----------
    span, rise, thickness, voussoirs, pier_width, pier_height, pier_blocks, density, depth
        As in :func:`arch_on_piers`.
    buttress_width, buttress_top : float [m]
        Width of a buttress at the ground and at its top.
    buttress_height : float [m]
        At most that of the pier.
    buttress_blocks : int
        Courses of a buttress.

    Returns
    -------
    solver.Assembly
        As :func:`arch_on_piers`, with "left buttress 1" (at the bottom) ... and "right buttress 1" ...; each ground
        carries a pier and its buttress.

    Examples
    --------
    >>> "right buttress 5" in buttressed_arch().names
    True
    """
    voussoir, pier = _arch_and_pier(span, rise, thickness, voussoirs, pier_width, pier_height, pier_blocks)
    width, top = above_zero("buttress_width", buttress_width), above_zero("buttress_top", buttress_top)
    height, n = above_zero("buttress_height", buttress_height), whole("buttress_blocks", buttress_blocks, 1)
    if top > width:
        raise ValueError(f"buttress_top is {top:g} m, more than the buttress_width of {width:g} m; make it narrower")
    if height > pier_height:
        raise ValueError(f"buttress_height is {height:g} m, above the pier_height of {pier_height:g} m; make it lower")
    face = span / 2.0 + pier_width
    levels, out = np.linspace(0.0, height, n + 1), face + np.linspace(width, top, n + 1)
    buttress = [
        np.array([[face, levels[i]], [out[i], levels[i]], [out[i + 1], levels[i + 1]], [face, levels[i + 1]]])
        for i in range(n)
    ]
    parts = {"pier": pier, "buttress": buttress}
    return _on_two_feet(parts, voussoir, span / 2.0, face + width, density, depth)


def _arch_and_pier(
    span: float, rise: float, thickness: float, voussoirs: int, pier_width: float, pier_height: float, pier_blocks: int
) -> tuple[list[tuple[str, np.ndarray]], list[np.ndarray]]:
    """Named voussoirs, and the blocks of the right pier from the bottom."""
    joints, _ = segmental_joints(span, rise, thickness, voussoirs)
    width, height = above_zero("pier_width", pier_width), above_zero("pier_height", pier_height)
    n = whole("pier_blocks", pier_blocks, 1)
    joints = joints + np.array([0.0, height])
    skewback = joints[-1]
    if skewback[1, 0] - skewback[0, 0] > width * (1.0 + 1e-12):
        raise ValueError(
            f"pier_width is {width:g} m, narrower than the springing joint above it; give at least "
            f"{skewback[1, 0] - skewback[0, 0]:.4g} m or a thinner arch"
        )
    inner, outer = span / 2.0, span / 2.0 + width
    levels = np.linspace(0.0, height, n + 1)
    pier = [rectangle(inner, low, outer, high) for low, high in pairwise(levels[:-1])]
    crown = [[inner, levels[-2]], [outer, levels[-2]], [outer, skewback[1, 1]], skewback[1], skewback[0]]
    ring = np.array(crown)
    kept = np.abs(ring - np.roll(ring, 1, axis=0)).max(axis=1) > 1e-12 * height
    pier.append(without_collinear(ring[kept], 1e-9))
    named = [(f"voussoir {i + 1}", outline) for i, outline in enumerate(voussoir_outlines(joints))]
    return named, pier


def _on_two_feet(
    parts: dict[str, list[np.ndarray]],
    above: list[tuple[str, np.ndarray]],
    inner: float,
    outer: float,
    density: float,
    depth: float,
) -> solver.Assembly:
    """Mirror the parts of the right foot to the left, and add the blocks above and a ground under either foot."""
    named = list(above)
    for side, mirror in (("left", MIRROR), ("right", np.ones(2))):
        for part, outlines in parts.items():
            named += [(f"{side} {part} {i + 1}", outline * mirror) for i, outline in enumerate(outlines)]
    margin = (outer - inner) / 4.0
    ground = rectangle(max(inner - margin, 0.25 * inner), -(outer - inner) / 2.0, outer + margin, 0.0)
    grounds = [("ground left", mechanics.FIXED, ground * MIRROR), ("ground right", mechanics.MOVING, ground)]
    return assembled(named, grounds, density=density, depth=depth)
