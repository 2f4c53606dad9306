"""Crack lines: joints that meet and have parted or slid, with their largest width, their inclination and ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import shapely
from scipy.sparse.csgraph import connected_components

import solver

from .joints import InitialJoints, initial_joints, opening_and_slip

#: A joint is open from this fraction of the block size on; on an ordinary brick it is a tenth of a millimetre.
SMALLEST_OPENING = 1e-3

#: Joints meet where they come this near to each other, in block sizes.
MEETING = 0.02

#: Most crack lines that a summary lists, the widest first.
MOST_LISTED = 100


@dataclass(frozen=True)
class Crack:
    """Joints of the layout that meet and have parted or slid, at least one of them open.

    Attributes
    ----------
    joints : (n,) int array
        Numbers of its joints, the widest first.
    width : float [m]
        Largest opening.
    slip : float [m]
        Of the widest joint.
    widest : str
        Names of the two blocks that part most.
    at : (2,) array [m]
        Middle of that joint in the layout.
    ends : (2, 2) array [m]
        The two ends that are farthest apart in the layout, the lower first.
    length : float [m]
        Of all its joints together.
    """

    joints: np.ndarray
    width: float
    slip: float
    widest: str
    at: np.ndarray
    ends: np.ndarray
    length: float

    @property
    def inclination(self) -> float:
        """Of the line between its ends, counter-clockwise from the horizontal, from 0 up to 180 [degrees]."""
        along = self.ends[1] - self.ends[0]
        return float(np.degrees(np.arctan2(along[1], along[0])) % 180.0)

    def values(self) -> dict[str, Any]:
        """Its numbers as ``summary.json`` has them: widths in mm, places and lengths in m."""
        return {
            "width_mm": round(1e3 * self.width, 4),
            "slip_mm": round(1e3 * self.slip, 4),
            "widest_joint": self.widest,
            "at": np.round(self.at, 6).tolist(),
            "from": np.round(self.ends[0], 6).tolist(),
            "to": np.round(self.ends[1], 6).tolist(),
            "inclination_degrees": round(self.inclination, 2),
            "length": round(self.length, 6),
            "n_joints": len(self.joints),
        }


def cracks_of(assembly: solver.Assembly, pose: solver.Pose, joints: InitialJoints | None = None) -> list[Crack]:
    """Group the joints of the layout that have parted or slid at a pose into crack lines, the widest first.

    Parameters
    ----------
    assembly : solver.Assembly
    pose : solver.Pose
    joints : InitialJoints, optional
        Of the assembly, where they are known already.
    """
    joints = initial_joints(assembly) if joints is None else joints
    moved = opening_and_slip(assembly, joints, pose)
    least = SMALLEST_OPENING * assembly.block_size
    # A stepped crack runs through bed joints that slide but stay shut.
    chosen = np.flatnonzero((moved[:, 0] > least) | (np.abs(moved[:, 1]) > least))
    lines = shapely.linestrings(joints.ends[chosen])
    meeting = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=MEETING * assembly.block_size)
    graph = sp.coo_array((np.ones(meeting.shape[1]), (meeting[0], meeting[1])), shape=(len(chosen), len(chosen)))
    count, group = connected_components(graph, directed=False)
    found = [_crack(assembly, joints, moved, chosen[group == k]) for k in range(count)]
    return sorted((crack for crack in found if crack.width > least), key=lambda crack: -crack.width)


def crack_rows(cracks: Sequence[Crack], most: int) -> list[tuple[str, str]]:
    """Name and say in words the widest crack lines, for a table."""
    rows = []
    for number, crack in enumerate(cracks[:most], start=1):
        # To a thousandth of the crack: the last digits of a zero are no place.
        (x, y), (to_x, to_y) = np.round(crack.ends, 3 - int(np.floor(np.log10(crack.length)))) + 0.0
        words = f"{1e3 * crack.width:.3g} mm at {crack.widest}; {crack.length:.3g} m, {crack.inclination:.0f}°, "
        words += f"from ({x:.3g}, {y:.3g}) to ({to_x:.3g}, {to_y:.3g}) m"
        rows.append((f"crack {number}", words))
    if len(cracks) > most:
        rows.append(("and", f"{len(cracks) - most} narrower ones"))
    return rows


def _crack(assembly: solver.Assembly, joints: InitialJoints, moved: np.ndarray, chosen: np.ndarray) -> Crack:
    chosen = chosen[np.argsort(-moved[chosen, 0], kind="stable")]
    widest = chosen[0]
    points = joints.ends[chosen].reshape(-1, 2)
    a, b = (assembly.names[int(of[widest])] for of in (joints.block_a, joints.block_b))
    return Crack(
        joints=chosen,
        width=float(moved[widest, 0]),
        slip=float(abs(moved[widest, 1])),
        widest=f"{a} | {b}",
        at=joints.ends[widest].mean(axis=0),
        ends=_farthest(points),
        length=float(np.hypot(*(joints.ends[chosen, 1] - joints.ends[chosen, 0]).T).sum()),
    )


def _farthest(points: np.ndarray) -> np.ndarray:
    """(2, 2) array: the two points that are farthest apart, the lower one first, or the left one of a level line."""
    if len(points) > 2:
        # Only corners of the hull can be; a line has none.
        hull = shapely.convex_hull(shapely.multipoints(points))
        points = shapely.get_coordinates(hull)
    apart = np.hypot(*np.moveaxis(points[:, None] - points[None], 2, 0))
    pair = points[list(np.unravel_index(int(apart.argmax()), apart.shape))]
    rise, run = pair[1, 1] - pair[0, 1], pair[1, 0] - pair[0, 0]
    level = abs(rise) < 1e-9 * max(abs(run), 1e-300)
    return pair[::-1] if (run < 0.0 if level else rise < 0.0) else pair
