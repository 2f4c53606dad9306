"""Cross vaults and pavilion vaults: barrels that meet along diagonals, bonded by the stones there."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

import solver
from blockvis.layout.solids import Solid, between, box, outward
from solver import mechanics

from .arches import segmental_joints
from .assembled import assembled
from .dimensions import above_zero, true_or_false, whole

#: An arm of a stone on a diagonal is at least this fraction of a stone long.
SHORTEST_ARM = 0.3


def cross_vault(
    *,
    span: float = 4.0,
    rise: float = 1.5,
    thickness: float = 0.3,
    voussoirs: int = 11,
    width: float = 5.2,
    stone: float = 0.8,
    bonded: bool = True,
    density: float = 2000.0,
) -> solver.Assembly:
    """Build a cross (groin) vault over a square bay: two barrels that cross, open on all four sides.

    Parameters
    ----------
    span, rise : float [m]
        Of the intrados of both barrels between opposite supports; the rise is at most half the span.
    thickness : float [m]
        Radial.
    voussoirs : int
        Number of courses of each barrel from springing to springing; an odd number has a keystone.
    width : float [m]
        Of the bay from free edge to free edge; wider than the vault between its supports.
    stone : float [m]
        Length of a stone along its course; the joints of neighbouring courses are half a stone apart.
    bonded : bool
        Whether stones on the groins reach into both barrels, or are cut along the groin.
    density : float [kg/m³]

    Returns
    -------
    solver.Assembly
        Stones on the groins "groin 1-1" (groin, course from the springing), those of the webs "web 1-1-1" (web, course,
        stone), "keystone", and "springer 1" (moving) to "springer 4" (fixed) in the corners, counter-clockwise from
        that at positive x and y. The middle of the bay is x = y = 0.

    Examples
    --------
    >>> int(cross_vault(bonded=False).moving.sum())
    1
    """
    arc = _Arc.of(span, rise, thickness, voussoirs)
    stones = _crossing(arc, width, stone, bonded)
    return assembled(stones, _supports("springer", _corner(arc.bearing, width / 2.0)), density=density)


def church_bay(
    *,
    span: float = 4.0,
    rise: float = 1.5,
    thickness: float = 0.3,
    voussoirs: int = 9,
    width: float = 5.2,
    stone: float = 1.0,
    pier: float = 1.5,
    pier_height: float = 2.0,
    pier_stones: int = 3,
    density: float = 2000.0,
) -> solver.Assembly:
    """Build a bay of a church: a cross vault on four square piers, stout enough to bear its thrust.

    Parameters
    ----------
    span, rise, thickness, voussoirs, width, stone, density
        As in :func:`cross_vault`.
    pier : float [m]
        Side of a pier in plan, outwards from the inner corner of the vault's support.
    pier_height : float [m]
    pier_stones : int
        Number of stones of a pier.

    Returns
    -------
    solver.Assembly
        The stones of :func:`cross_vault`, its supports as stones "springer 1" to "springer 4", piers of "pier 1-1"
        (pier, stone from below), and under them "ground 1" (moving) to "ground 4" (fixed).

    Examples
    --------
    >>> church_bay(pier_stones=2).names[-6:-4]
    ('pier 4-1', 'pier 4-2')
    """
    arc = _Arc.of(span, rise, thickness, voussoirs)
    stones = _crossing(arc, width, stone, True)
    side, height = above_zero("pier", pier), above_zero("pier_height", pier_height)
    n = whole("pier_stones", pier_stones, 1)
    inner, top = float(arc.bearing[:, 0].min()), float(arc.bearing[:, 1].min())
    if inner + side < width / 2.0:
        raise ValueError(
            f"pier is {side:g} m; the vault's supports need {width / 2.0 - inner:.4g} m: give a wider pier"
        )
    corner = _corner(arc.bearing, width / 2.0)
    stones += [(f"springer {quarter + 1}", _turned(corner, quarter)) for quarter in range(4)]
    levels = top - height + height * np.arange(n + 1) / n
    for quarter in range(4):
        for k, (low, high) in enumerate(pairwise(levels.tolist())):
            drum = box((inner, inner, low), (inner + side, inner + side, high))
            stones.append((f"pier {quarter + 1}-{k + 1}", _turned(drum, quarter)))
    wide = 0.2 * side
    foot = box((inner - wide, inner - wide, levels[0] - wide), (*[inner + side + wide] * 2, float(levels[0])))
    return assembled(stones, _supports("ground", foot), density=density)


def _crossing(arc: _Arc, width: float, stone: float, bonded: bool) -> list[tuple[str, Solid]]:
    """Lay the stones of a cross vault."""
    edge, length = above_zero("width", width) / 2.0, above_zero("stone", stone)
    widest = float(arc.bearing[:, 0].max())
    if edge <= widest + 0.01 * length:
        raise ValueError(
            f"width is {width:g} m, but the supports of the vault reach {2.0 * widest:.4g} m; give a wider bay"
        )
    stones: list[tuple[str, Solid]] = []
    for course, section in enumerate(arc.sections, start=1):
        reach = float(section[:, 0].max())
        cuts = _cuts(edge, length, course, reach + SHORTEST_ARM * length)
        for quarter in range(4):
            stones += _on_diagonal(f"groin {quarter + 1}-{course}", section, cuts[0], quarter, bonded)
            for k, (start, end) in enumerate(pairwise(cuts), start=1):
                # On either side of the web, between the diagonals and the free edge.
                for number, side in ((course, 1.0), (arc.courses + 1 - course, -1.0)):
                    solid = _along_y(section * [side, 1.0], start, end)
                    stones.append((f"web {quarter + 1}-{number}-{k}", _turned(solid, quarter)))
    if arc.crown is not None:
        course = len(arc.sections) + 1
        stones.append(("keystone", _square(arc.crown)))
        cuts = _cuts(edge, length, course, float(arc.crown[:, 0].max()) + SHORTEST_ARM * length)
        for quarter in range(4):
            # The first stone begins at the keystone.
            for k, (first, end) in enumerate(zip([np.abs(arc.crown[:, 0]), *cuts[:-1]], cuts, strict=True)):
                solid = _along_y(arc.crown, first, end)
                stones.append((f"web {quarter + 1}-{course}-{k + 1}", _turned(solid, quarter)))
    return stones


def pavilion_vault(
    *,
    span: float = 4.0,
    rise: float = 1.5,
    thickness: float = 0.3,
    voussoirs: int = 11,
    stone: float = 0.8,
    bonded: bool = True,
    density: float = 2000.0,
) -> solver.Assembly:
    """Build a pavilion (cloister) vault over a square room: courses in rings from four walls to a keystone.

    Parameters
    ----------
    span, rise : float [m]
        Of the intrados between opposite walls; the rise is at most half the span.
    voussoirs : int
        Number of courses from wall to wall over the keystone, an odd number.
    bonded : bool
        Whether stones on the diagonals reach into both sides, or are cut along the diagonal.
    thickness, stone, density
        As in :func:`cross_vault`.

    Returns
    -------
    solver.Assembly
        Stones on the diagonals "corner 1-1" (corner, course from the springing), those between "side 1-1-1" (side,
        course, stone), "keystone", and a support under each side: "springer 1" (moving) at positive x, the others
        (fixed) counter-clockwise.

    Examples
    --------
    >>> pavilion_vault(voussoirs=5, bonded=False).names[-5:-3]
    ('keystone', 'springer 1')
    """
    arc = _Arc.of(span, rise, thickness, voussoirs)
    if arc.crown is None:
        raise ValueError(f"voussoirs is {int(voussoirs)}; a pavilion vault needs an odd number, with a keystone")
    length = above_zero("stone", stone)
    stones: list[tuple[str, Solid]] = []
    for course, section in enumerate(arc.sections, start=1):
        most = float(section[:, 0].min()) - SHORTEST_ARM * length
        offset = 0.5 if course % 2 else 0.0
        inner = [y for y in length * (np.arange(int(most / length) + 2) + offset) if y <= most]
        # Rings near the keystone are too short for a joint elsewhere than in the middle of their sides.
        cuts = [float(y) for y in inner] or [0.0]
        joints = sorted({-y for y in cuts} | set(cuts))
        for quarter in range(4):
            stones += _on_diagonal(f"corner {quarter + 1}-{course}", section, cuts[-1], quarter, bonded)
            for k, (start, end) in enumerate(pairwise(joints)):
                solid = _along_y(section, start, end)
                stones.append((f"side {quarter + 1}-{course}-{k + 1}", _turned(solid, quarter)))
    stones.append(("keystone", _square(arc.crown)))
    springer = _along_y(arc.bearing, -arc.bearing[:, 0], arc.bearing[:, 0])
    return assembled(stones, _supports("springer", springer), density=density)


def _supports(name: str, solid: Solid) -> list[tuple[str, str, Solid]]:
    """Put a support at each of four corners or sides, of which the first moves."""
    roles = [mechanics.MOVING, *[mechanics.FIXED] * 3]
    return [(f"{name} {k + 1}", role, _turned(solid, k)) for k, role in enumerate(roles)]


@dataclass(frozen=True)
class _Arc:
    """Half of the section of a barrel, at positive x: (4, 2) arrays [m] of corners x, z.

    Its sections are those of each course from the springing to the crown, which is the course in the middle, None for
    an even number of them. The bearing is that of the support, half a thickness wider to each side.
    """

    sections: list[np.ndarray]
    crown: np.ndarray | None
    bearing: np.ndarray

    @property
    def courses(self) -> int:
        """Number of courses from springing to springing."""
        return 2 * len(self.sections) + (self.crown is not None)

    @classmethod
    def of(cls, span: float, rise: float, thickness: float, voussoirs: int) -> _Arc:
        joints, _ = segmental_joints(span, rise, thickness, voussoirs)
        # From right to left: the springing at positive x comes first.
        joints = joints[::-1]
        n = len(joints) - 1
        sections = [np.array([a[0], a[1], b[1], b[0]]) for a, b in pairwise(joints[: n // 2 + 1])]
        if n % 2 == 0:
            # The joint in the crown is upright.
            sections[-1][2:, 0] = 0.0
        crown = np.array([*joints[n // 2], *joints[n // 2 + 1][::-1]]) if n % 2 else None
        inner, outer = joints[0]
        half = (outer - inner) / 2.0
        low = float(min(inner[1], outer[1]) - 2.0 * thickness)
        top = np.array([inner - half, outer + half])
        return cls(sections, crown, np.array([top[0], top[1], [top[1, 0], low], [top[0, 0], low]]))


def _cuts(edge: float, length: float, course: int, least: float) -> list[float]:
    """Lay out the joints along a course from the diagonal to the free edge, at which the last stone ends."""
    offset = 1.0 if course % 2 else 0.5
    inner = edge - length * (np.arange(int(edge / length) + 1) + offset)
    return [*sorted(float(y) for y in inner if y >= least), edge]


def _along_y(section: np.ndarray, start: float | np.ndarray, end: float | np.ndarray) -> Solid:
    """Close the stone between two places along y [m], each that of the section or (4,) those of its corners."""
    return between(*(np.insert(section, 1, y, axis=1) for y in (start, end)))


def _square(crown: np.ndarray) -> Solid:
    """Make the keystone: a pyramid's frustum between the crowns of both barrels."""

    def ring(corner: np.ndarray) -> np.ndarray:
        x, z = abs(float(corner[0])), float(corner[1])
        return np.array([[x, x, z], [-x, x, z], [-x, -x, z], [x, -x, z]])

    return between(ring(crown[0]), ring(crown[1]))


def _on_diagonal(name: str, section: np.ndarray, arm: float, quarter: int, bonded: bool) -> list[tuple[str, Solid]]:
    """Make the stone of a course on a diagonal, whole or cut along it."""
    if true_or_false("bonded", bonded):
        return [(name, _turned(_corner(section, arm), quarter))]
    one = _along_y(section, section[:, 0], arm)
    swapped = one[0][:, [1, 0, 2]], one[1]
    return [(f"{name} {side}", _turned(outward(*solid), quarter)) for side, solid in (("a", one), ("b", swapped))]


def _corner(section: np.ndarray, arm: float) -> Solid:
    """Join the two arms of a stone on the diagonal x = y: along y up to ``arm``, and along x."""
    n = len(section)
    middle, first = (np.insert(section, 1, y, axis=1) for y in (section[:, 0], arm))
    points = np.vstack([middle, first, first[:, [1, 0, 2]]])
    faces = [list(range(n, 2 * n)), list(range(2 * n, 3 * n))[::-1]]
    for k in range(n):
        following = (k + 1) % n
        faces += [[k, following, following + n, k + n], [k, k + 2 * n, following + 2 * n, following]]
    return outward(points, [[int(corner) for corner in face] for face in faces])


def _turned(solid: Solid, quarter: int) -> Solid:
    """Turn a stone about the vertical axis by a number of right angles."""
    points, faces = solid
    for _ in range(quarter):
        points = points[:, [1, 0, 2]] * [-1.0, 1.0, 1.0]
    return points, faces
