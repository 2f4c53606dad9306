"""Arches on springers: circular, segmental, pointed and basket-handle."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

import solver
from blockvis.layout.outlines import without_collinear
from solver import mechanics

from .assembled import assembled
from .dimensions import MOST_VOUSSOIRS, above_zero, whole


def arch(
    *,
    radius: float = 1.0,
    thickness_ratio: float = 0.15,
    embrace: float = 180.0,
    voussoirs: int = 12,
    density: float = 2000.0,
    depth: float = 1.0,
) -> solver.Assembly:
    """Build a circular arch of equal voussoirs between two springers.

    Parameters
    ----------
    radius : float [m]
        Of the centreline.
    thickness_ratio : float
        Thickness over radius.
    embrace : float [degrees]
        Angle between the springing joints, at most 180.
    voussoirs : int
        Number of voussoirs, quadrilaterals with all four corners on the circles.
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
    radius, embrace = above_zero("radius", radius), above_zero("embrace", embrace, "degrees")
    if embrace > 180.0:
        raise ValueError(f"embrace is {embrace:g} degrees; give an angle above 0 and up to 180")
    voussoirs = whole("voussoirs", voussoirs, 2, MOST_VOUSSOIRS)
    thickness_ratio = above_zero("thickness_ratio", thickness_ratio, "")
    if thickness_ratio >= 2.0:
        raise ValueError(f"thickness_ratio is {thickness_ratio:g}; give thickness / radius between 0 and 2")
    half = math.radians(embrace) / 2.0
    angles = np.linspace(math.pi / 2 + half, math.pi / 2 - half, voussoirs + 1)
    thickness = thickness_ratio * radius
    joints = radial_joints(radius - thickness / 2.0, radius + thickness / 2.0, angles)
    return _on_springers(voussoir_outlines(joints), joints, angles, thickness, density, depth)


def segmental_arch(
    *,
    span: float = 2.0,
    rise: float = 0.5,
    thickness: float = 0.25,
    voussoirs: int = 11,
    density: float = 2000.0,
    depth: float = 1.0,
) -> solver.Assembly:
    """Build an arch along one arc of a circle, by span and rise.

    Parameters
    ----------
    span, rise : float [m]
        Of the intrados; a rise of half the span gives a semicircle.
    thickness : float [m]
        Radial.
    voussoirs : int
        Number of voussoirs, quadrilaterals with all four corners on the circles.
    density, depth
        As in :func:`arch`.

    Returns
    -------
    solver.Assembly
        Voussoirs from left to right, "left springer" (fixed), "right springer" (moving). The springing line
        of the intrados is y = 0, the middle of the span x = 0.

    Examples
    --------
    >>> segmental_arch(span=2.0, rise=0.5, voussoirs=9).names[4]
    'voussoir 5'
    """
    joints, angles = segmental_joints(span, rise, thickness, voussoirs)
    return _on_springers(voussoir_outlines(joints), joints, angles, thickness, density, depth)


def pointed_arch(
    *,
    span: float = 2.0,
    rise: float = 1.5,
    thickness: float = 0.25,
    voussoirs: int = 14,
    density: float = 2000.0,
    depth: float = 1.0,
) -> solver.Assembly:
    """Build a pointed (Gothic) arch: two arcs with their centres on the springing line.

    Parameters
    ----------
    span, rise : float [m]
        Of the intrados; the rise is at least half the span. A rise of 0.866 spans is the equilateral arch.
    voussoirs : int
        An even number has a joint at the apex, an odd number a keystone.
    thickness, density, depth
        As in :func:`segmental_arch`.

    Returns
    -------
    solver.Assembly
        Voussoirs from left to right, "left springer" (fixed), "right springer" (moving).

    Examples
    --------
    >>> pointed_arch(span=2.0, rise=3**0.5, voussoirs=12).n_blocks
    14
    """
    span, rise, thickness = above_zero("span", span), above_zero("rise", rise), above_zero("thickness", thickness)
    n = whole("voussoirs", voussoirs, 2, MOST_VOUSSOIRS)
    if rise < span / 2.0:
        raise ValueError(
            f"rise is {rise:g} m for a span of {span:g} m; a pointed arch rises at least {span / 2.0:g} m: "
            "take a basket-handle or segmental arch"
        )
    centre = (rise**2 - span**2 / 4.0) / span
    inner, outer = centre + span / 2.0, centre + span / 2.0 + thickness
    to_apex = math.atan2(rise, centre)
    angles = math.pi - to_apex * np.arange(n // 2 + 1) / (n / 2.0)
    left = radial_joints(inner, outer, angles) + np.array([centre, 0.0])
    apex = np.array([[0.0, rise], [0.0, math.sqrt(outer**2 - centre**2)]])
    mirror = np.array([-1.0, 1.0])
    if n % 2 == 0:
        left[-1] = apex
        joints = np.concatenate([left, left[-2::-1] * mirror])
        outlines = voussoir_outlines(joints)
    else:
        right = left[::-1] * mirror
        joints = np.concatenate([left, right])
        outlines = voussoir_outlines(joints)
        keystone = [left[-1, 0], left[-1, 1], apex[1], right[0, 1], right[0, 0], apex[0]]
        outlines[n // 2] = without_collinear(np.array(keystone), 1e-9)
    return _on_springers(outlines, joints, np.array([math.pi, 0.0]), thickness, density, depth)


def basket_handle_arch(
    *,
    span: float = 3.0,
    rise: float = 1.0,
    thickness: float = 0.3,
    voussoirs: int = 15,
    density: float = 2000.0,
    depth: float = 1.0,
) -> solver.Assembly:
    """Build a basket-handle (three-centred) arch: three arcs of 60° that join without a kink.

    Parameters
    ----------
    span, rise : float [m]
        Of the intrados; the rise is between 0.134 and 0.5 spans.
    voussoirs : int
        Number of voussoirs, equally long along the intrados.
    thickness, density, depth
        As in :func:`segmental_arch`.

    Returns
    -------
    solver.Assembly
        Voussoirs from left to right, "left springer" (fixed), "right springer" (moving).

    Notes
    -----
    Huygens' construction: with half span a and rise r, the centres are d = 2 (a - r) / (√3 - 1) apart, the radius
    of the haunches is a - d/2 and that of the crown larger by d.

    Examples
    --------
    >>> basket_handle_arch(span=3.0, rise=1.0, voussoirs=15).n_blocks
    17
    """
    span, rise, thickness = above_zero("span", span), above_zero("rise", rise), above_zero("thickness", thickness)
    n = whole("voussoirs", voussoirs, 2, MOST_VOUSSOIRS)
    apart = (span - 2.0 * rise) / (math.sqrt(3.0) - 1.0)
    haunch = span / 2.0 - apart / 2.0
    if apart < 0.0 or haunch <= 0.0:
        raise ValueError(
            f"rise is {rise:g} m for a span of {span:g} m; a basket-handle arch rises between "
            f"{(1.0 - math.sqrt(3.0) / 2.0) * span:.4g} and {span / 2.0:g} m: take a "
            f"{'pointed' if apart < 0.0 else 'segmental'} arch"
        )
    crown, sixty = haunch + apart, math.pi / 3.0
    lengths = np.array([haunch, crown, haunch]) * sixty
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    arc_length = np.linspace(0.0, ends[-1], n + 1)
    angles = math.pi - np.interp(arc_length, ends, sixty * np.arange(4))
    centres = np.array([[-apart / 2.0, 0.0], [0.0, -apart * math.sqrt(3.0) / 2.0], [apart / 2.0, 0.0]])
    arc = np.clip(np.searchsorted(ends, arc_length, side="right") - 1, 0, 2)
    radii = np.array([haunch, crown, haunch])[arc]
    direction = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    radial = np.stack([radii, radii + thickness], axis=1)
    joints = centres[arc][:, None, :] + radial[:, :, None] * direction[:, None, :]
    return _on_springers(voussoir_outlines(joints), joints, angles, thickness, density, depth)


def radial_joints(inner: float, outer: float, angles: np.ndarray) -> np.ndarray:
    """(n, 2, 2) array [m]: joints along a circle about the origin; axis 1 is the end on the intrados or the extrados.

    Radii are in m, angles (n,) in rad, counter-clockwise from the x axis.
    """
    ends = [[(r * math.cos(a), r * math.sin(a)) for r in (inner, outer)] for a in angles.tolist()]
    return np.array(ends)


def segmental_joints(span: float, rise: float, thickness: float, voussoirs: int) -> tuple[np.ndarray, np.ndarray]:
    """Lay out the joints of a segmental arch by span and rise of its intrados [m], which springs at y = 0 around x = 0.

    They are (voussoirs + 1, 2, 2) [m], from left to right, and come with their (voussoirs + 1,) angles [rad].
    """
    span, rise, thickness = above_zero("span", span), above_zero("rise", rise), above_zero("thickness", thickness)
    n = whole("voussoirs", voussoirs, 2, MOST_VOUSSOIRS)
    if rise > span / 2.0 * (1.0 + 1e-12):
        raise ValueError(
            f"rise is {rise:g} m for a span of {span:g} m; a segmental arch rises at most {span / 2.0:g} m: "
            "take a pointed arch"
        )
    radius = (span**2 / 4.0 + rise**2) / (2.0 * rise)
    # Half of the angle of a semicircle is set exactly: an arctangent would miss it by rounding.
    half = math.pi / 2.0 if rise >= span / 2.0 else math.atan2(span / 2.0, radius - rise)
    angles = np.linspace(math.pi / 2.0 + half, math.pi / 2.0 - half, n + 1)
    joints = radial_joints(radius, radius + thickness, angles) - np.array([0.0, radius - rise])
    joints[[0, -1], 0] = [[-span / 2.0, 0.0], [span / 2.0, 0.0]]
    if half == math.pi / 2.0:
        joints[[0, -1], 1, 1] = 0.0
    return joints, angles


def flat_joints(left: float, right: float, bottom: float, depth: float, skew: float, voussoirs: int) -> np.ndarray:
    """(voussoirs + 1, 2, 2) array [m]: joints of a flat arch, whose ends lean outwards by ``skew`` [degrees]."""
    spread = depth * math.tan(math.radians(skew))
    lower = np.linspace(left, right, voussoirs + 1)
    upper = np.linspace(left - spread, right + spread, voussoirs + 1)
    levels = np.broadcast_to([bottom, bottom + depth], (voussoirs + 1, 2))
    return np.stack([np.stack([lower, upper], axis=1), levels], axis=2)


def voussoir_outlines(joints: np.ndarray) -> list[np.ndarray]:
    """Outline the n voussoirs between (n + 1, 2, 2) joints [m], from left to right."""
    return [np.array([a[0], a[1], b[1], b[0]]) for a, b in pairwise(joints)]


def _on_springers(
    outlines: list[np.ndarray], joints: np.ndarray, angles: np.ndarray, thickness: float, density: float, depth: float
) -> solver.Assembly:
    """Put an arch between a fixed springer on the left and a moving one on the right, twice its thickness deep."""
    springers = []
    sides = (("left springer", mechanics.FIXED, 0, 1.0), ("right springer", mechanics.MOVING, -1, -1.0))
    for name, role, end, sense in sides:
        (inner, outer), angle = joints[end], angles[end]
        # Half of its thickness longer at either end.
        joint = np.array([inner, outer]) + np.outer([-0.5, 0.5], outer - inner)
        away = 2.0 * thickness * sense * np.array([-math.sin(angle), math.cos(angle)])
        springers.append((name, role, np.array([joint[0], joint[1], joint[1] + away, joint[0] + away])))
    free = [(f"voussoir {i}", outline) for i, outline in enumerate(outlines, start=1)]
    return assembled(free, springers, density=density, depth=depth)
