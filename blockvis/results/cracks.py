"""Cracks: courses of joints that meet and have parted or slid, with their width, their inclination and their ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import shapely
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from scipy.spatial import ConvexHull

import solver
from blockvis.text import width_text
from solver.mechanics import counted, linked

from .about import EXACT
from .joint_faces import InitialJoints, initial_joints
from .joints import Faces, carried_faces, opening_and_slip
from .places import Places

#: A joint is open from this fraction of the block size on; on an ordinary brick it is a tenth of a millimetre.
SMALLEST_OPENING = 1e-3

#: Joints meet where they come this near to each other, in block sizes.
MEETING = 0.02

#: A course stays within this of a straight line, in block sizes: the steps of a bond do, a turn does not.
STRIP = 0.65

#: Directions, and lines beside each other to both sides of the widest joint, that a course is tried along.
DIRECTIONS, BESIDE = 36, 2

#: What has slid and not opened counts against a course by this part: less than the steps of a bond add, more than
#: joints along it do.
SLIDING = 0.4

#: Joints have slid by far where their slip is more than this part of the largest opening, and are not open where their
#: opening is less than this part of it.
SLID = 0.1

#: A course ends where the sides part by less than this part of what they do at its widest joint.
HAIRLINE = 0.01

#: Joints whose blocks have moved apart by less than the first part of that count by the second in the choice of a
#: strip: many hairlines are no crack.
CORE, BESIDES = 0.25, 0.1

#: Most crack lines that a summary lists, the widest first.
MOST_LISTED = 100

#: Most main cracks.
MOST_MAIN = 6

#: Joints in space belong to one crack where their blocks part by the same, up to this part of it.
ALIKE = 0.5


@dataclass(frozen=True, eq=False)
class Crack:
    """A course of joints of the layout that have parted or slid one after another, at least one of them open.

    In space joints that meet and part alike are one crack.
    """

    joints: np.ndarray  #: (n,) int array: numbers of its joints, the widest first.
    width: float  #: [m] Largest opening.
    slip: float  #: [m] Of the widest joint.
    widest: str  #: Names of the two blocks that part most.
    at: np.ndarray  #: (d,) array [m]: middle of that joint in the layout.
    #: (2, d) array [m]: where it begins and ends in the layout, the lower first; in space its two corners that are
    #: farthest apart.
    ends: np.ndarray
    along: np.ndarray  #: (d,) array: from end to end; in space the steepest way up the crack as a whole.
    size: float  #: Length [m] of all its joints together, in space their area [m²].
    #: (n,) array: opening [m] of each of its joints times its length [m], in space its area [m²].
    areas: np.ndarray
    #: What its two ends are at, as "the top" and "the upper left corner of opening 2"; empty in space.
    places: tuple[str, str] = ("", "")

    @property
    def mean_width(self) -> float:
        """Opening [m] of its joints, by their sizes."""
        return float(self.areas.sum() / self.size)

    @property
    def inclination(self) -> float:
        """From the horizontal [degrees]: counter-clockwise to 180, in space to 90."""
        *level, rise = self.along
        angle = np.arctan2(rise, level[0] if len(level) == 1 else np.hypot(*level))
        return float(np.degrees(angle) % 180.0)

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
            "length" if len(self.at) == 2 else "area": round(self.size, 6),
            "n_joints": len(self.joints),
            "mean_width_mm": round(1e3 * self.mean_width, 4),
            **({"starts_at": self.places[0], "ends_at": self.places[1]} if any(self.places) else {}),
        }


def cracks_of(assembly: solver.Assembly, pose: solver.Pose, fallen: np.ndarray | None = None) -> list[Crack]:
    """Trace the cracks of a layout at a pose, the widest first; joints of fallen blocks (n_blocks,) are none.

    In the plane joints that have parted or slid are followed as far as they stay near a straight line; where cracks
    fork, the one along which less has parted begins anew, and where one turns, another begins.
    """
    joints = initial_joints(assembly)
    moved = opening_and_slip(assembly, joints, pose, fallen)
    least = SMALLEST_OPENING * assembly.block_size
    # A stepped crack runs through bed joints that slide but stay shut.
    chosen = np.flatnonzero((moved[:, 0] > least) | (np.abs(moved[:, 1]) > least))
    meeting = _meetings(joints, chosen, MEETING * assembly.block_size)
    if assembly.dimension == 3:
        apart = _apart(carried_faces(assembly, joints, pose), joints)
        groups = _groups(meeting[:, _part_alike(*apart[chosen[meeting]])], np.arange(len(chosen)))
        found = [_crack(assembly, joints, moved, chosen[group], apart=apart) for group in groups]
    else:
        courses = _courses(joints, moved[chosen], chosen, meeting, assembly.block_size)
        open_ones = [course for course in courses if moved[course, 0].max() > least]
        places = Places(assembly) if open_ones else None
        found = [_crack(assembly, joints, moved, course, places) for course in open_ones]
    return sorted((crack for crack in found if crack.width > least), key=lambda crack: -crack.width)


def last_cracks(response: solver.Response) -> list[Crack]:
    """Trace the cracks of the last equilibrium of a response, the widest first; none where there is none."""
    return [crack for end in response.path[-1:] for crack in cracks_of(response.assembly, end.pose, end.fallen)]


def slid_joints(assembly: solver.Assembly, moved: np.ndarray) -> np.ndarray:
    """(n,) int array: joints that by their opening and slip (n_joints, 2) [m] have slid by far and are not open.

    The farthest come first. They are a step in what a survey draws, whether a stepped crack runs through them or none.
    """
    opening, slip = np.maximum(moved[:, 0], 0.0), np.abs(moved[:, 1])
    least = max(SMALLEST_OPENING * assembly.block_size, SLID * float(opening.max(initial=0.0)))
    far = np.flatnonzero((slip > least) & (opening < SLID * slip))
    return far[np.argsort(-slip[far], kind="stable")]


def main_cracks(cracks: Sequence[Crack]) -> list[Crack]:
    """Choose the cracks that pictures tell apart, those with the largest areas of opening, in the given order."""
    return [cracks[k] for k in main_areas([float(crack.areas.sum()) for crack in cracks])]


def main_areas(areas: Sequence[float]) -> list[int]:
    """Choose the largest of the areas of opening of cracks, by their numbers in the given order; none that is 0."""
    largest = sorted(range(len(areas)), key=lambda k: -areas[k])[:MOST_MAIN]
    return sorted(k for k in largest if areas[k] > 0.0)


def crack_rows(cracks: Sequence[Crack], most: int) -> list[tuple[str, str]]:
    """Name and say in words the widest crack lines, for a table."""
    rows = []
    for number, crack in enumerate(cracks[:most], start=1):
        # To a thousandth of the crack: the last digits of a zero are no place.
        longest = float(np.linalg.norm(crack.ends[1] - crack.ends[0]))
        ends = np.round(crack.ends, 3 - int(np.floor(np.log10(longest)))) + 0.0
        first, last = (f"({', '.join(f'{x:.3g}' for x in end)})" for end in ends)
        size = f"{crack.size:.3g} {'m' if len(crack.at) == 2 else 'm²'}"
        words = f"{width_text(crack.width)} at {crack.widest}; {size}, {crack.inclination:.0f}°, "
        words += f"from {first} to {last} m"
        if set(crack.places) - {"", "inside"}:
            first, last = crack.places
            words += f": {first} to {last}" if first != last else f": at {first}"
        rows.append((f"crack {number}", words))
    if len(cracks) > most:
        rows.append(("and", counted(len(cracks) - most, "narrower one")))
    return rows


def _groups(meeting: np.ndarray, members: np.ndarray) -> list[np.ndarray]:
    """List the joints among some that meet directly or through others of them; ``meeting`` as of :func:`_meetings`."""
    place = np.full(max(int(meeting.max(initial=-1)), int(members.max(initial=-1))) + 1, -1)
    place[members] = np.arange(len(members))
    one, other = place[meeting]
    both = (one >= 0) & (other >= 0)
    group = linked((one[both], other[both]), len(members))
    return [members[group == k] for k in range(int(group.max(initial=-1)) + 1)]


def _courses(
    joints: InitialJoints, moved: np.ndarray, chosen: np.ndarray, meeting: np.ndarray, block_size: float
) -> list[np.ndarray]:
    """Part the chosen joints into courses: numbers of joints, one after another from end to end.

    Of joints that meet the one with the largest area of opening comes first, with the course through it, within a
    straight strip, along which the two sides have parted most; what it leaves is parted again.
    """
    middles, sizes, normals = joints.ends[chosen].mean(axis=1), joints.sizes[chosen], joints.normals[chosen]
    opening, slip = np.maximum(moved[:, 0], 0.0), moved[:, 1]
    parted = opening[:, None] * normals + slip[:, None] * np.stack([-normals[:, 1], normals[:, 0]], axis=1)
    # Along each joint with block a on the left.
    runs = joints.ends[chosen, 1] - joints.ends[chosen, 0]
    runs *= np.where(runs[:, 0] * normals[:, 1] < runs[:, 1] * normals[:, 0], -1.0, 1.0)[:, None]
    angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    across = np.stack([-np.sin(angles), np.cos(angles)])
    # What opens across the line, times the length along it; a joint along the line that only slides parts nothing.
    shut = np.maximum(np.abs(slip) - opening, 0.0)[:, None]
    gains = sizes[:, None] * ((normals @ across) * (parted @ across) - SLIDING * shut)
    apart, half = np.linalg.norm(parted, axis=1), (1.0 + EXACT) * STRIP * block_size
    beside = half * np.arange(-BESIDE, BESIDE + 1) / (BESIDE + 0.5)
    found, left = [], _groups(meeting, np.arange(len(chosen)))
    while left:
        members = left.pop()
        widest = members[(opening * sizes)[members].argmax()]
        away = (middles[members] - middles[widest]) @ across
        inside = np.abs(away[:, :, None] - beside) <= half
        # No course has more than all that adds to one in its strip: the others need not be followed.
        gained = gains - HAIRLINE * apart[widest] * sizes[:, None]
        gained = np.where((apart < CORE * apart[widest])[:, None] & (gained > 0.0), BESIDES * gained, gained)
        most = np.einsum("nd,ndb->db", np.maximum(gained[members], 0.0), inside)
        course, largest = np.array([widest]), float(gained[widest].max())
        for direction, line in zip(*np.unravel_index(np.argsort(-most, axis=None), most.shape), strict=True):
            margin = EXACT * abs(largest)
            if most[direction, line] < largest - margin:
                break
            strip = members[inside[:, direction, line]]
            tried, gain = _course_through(widest, strip, meeting, parted, gained[:, direction], middles, runs)
            shorter = sizes[tried].sum() < (1.0 - EXACT) * sizes[course].sum()
            if gain > largest + margin or (gain >= largest - margin and shorter):
                course, largest = tried, gain
        found.append(chosen[course])
        rest = np.setdiff1d(members, course)
        if len(rest):
            left += _groups(meeting, rest)
    return found


def _course_through(
    start: int,
    members: np.ndarray,
    meeting: np.ndarray,
    parted: np.ndarray,
    gains: np.ndarray,
    middles: np.ndarray,
    runs: np.ndarray,
) -> tuple[np.ndarray, float]:
    """Order the joints of the course through a start that gains most, and sum its gains.

    It is a path of the tree that joins the members by those whose blocks have moved most apart. What is to its left
    moves from what is to its right as it does at the start; ``parted`` (n, 2) [m] is that along the ``runs`` (n, 2).
    """
    n = len(members)
    # minimum_spanning_tree of scipy 1.15 takes no longer integers.
    place = np.full(len(parted), -1, dtype=np.int32)
    place[members] = np.arange(n, dtype=np.int32)
    one, other = place[meeting]
    pairs = (one >= 0) & (other >= 0) & (one < other)
    one, other = one[pairs], other[pairs]
    own, gained = np.linalg.norm(parted[members], axis=1), gains[members]
    # Of three joints that meet the widest lies between the others.
    joined = np.minimum(own[one], own[other]) + EXACT * np.maximum(own[one], own[other])
    narrow = 2.0 * own.max() - joined
    tree = minimum_spanning_tree(sp.coo_array((narrow, (one, other)), shape=(n, n)))
    order, before = breadth_first_order(tree, place[start], directed=False)
    root, total, arm = int(order[0]), np.full(n, -np.inf), np.arange(n)
    own_middles, own_runs = middles[members], runs[members]
    on = ((own_middles - own_middles[np.maximum(before, 0)]) * own_runs).sum(axis=1) > 0.0
    ahead = (own_middles - own_middles[root]) @ runs[start] > 0.0
    # Beyond the start, and with the other sign behind it.
    alike = np.where(on, 1.0, -1.0) * (parted[members] @ parted[start])
    margin = EXACT * own * own[root]
    total[root] = gained[root]
    for k in order[1:]:
        arm[k] = k if before[k] == root else arm[before[k]]
        # Two cracks with a row of blocks between them are none that turns back.
        goes_on = (alike[k] if ahead[arm[k]] else -alike[k]) >= -margin[k]
        total[k] = total[before[k]] + gained[k] if goes_on else -np.inf

    def back(k: int) -> list[int]:
        found = []
        while k != root:
            found.append(k)
            k = int(before[k])
        return found

    first = back(int(total.argmax()))
    if first:
        total[(ahead[arm] == ahead[arm[first[0]]]) & (arm != root)] = -np.inf
    course = [*first, root, *back(int(total.argmax()))[::-1]]
    return members[course], float(gained[course].sum())


def _crack(
    assembly: solver.Assembly,
    joints: InitialJoints,
    moved: np.ndarray,
    chosen: np.ndarray,
    places: Places | None = None,
    apart: np.ndarray | None = None,
) -> Crack:
    rings = joints.rings
    # A course in the plane is in order; a joint beside its way, where three meet, is not where it ends.
    outer = chosen[[0, -1]] if assembly.dimension == 2 else chosen
    ends = _farthest(rings.points[np.isin(rings.ring, outer)])
    chosen = chosen[np.argsort(-moved[chosen, 0], kind="stable")]
    widest = chosen[0]
    a, b = (assembly.names[int(of[widest])] for of in (joints.block_a, joints.block_b))
    sizes, along = joints.sizes[chosen], ends[1] - ends[0]
    if apart is not None:
        # Across the crack as a whole, from one of its sides to the other: of stairs the steps cancel.
        sense = np.sign(apart[chosen] @ apart[widest])
        x, y, z = (sense * sizes) @ joints.normals[chosen]
        along = np.array([-x * z, -y * z, x**2 + y**2])
    return Crack(
        joints=chosen,
        width=float(moved[widest, 0]),
        slip=float(abs(moved[widest, 1])),
        widest=f"{a} | {b}",
        at=rings.middles()[widest],
        ends=ends,
        along=along,
        size=float(sizes.sum()),
        areas=np.maximum(moved[chosen, 0], 0.0) * sizes,
        places=("", "") if places is None else (places.name(ends[0]), places.name(ends[1])),
    )


def _meetings(joints: InitialJoints, chosen: np.ndarray, near: float) -> np.ndarray:
    """(2, n) int array: places among the chosen joints of those that come within a distance [m] of each other."""
    rings = joints.rings
    if rings.points.shape[1] == 2:
        lines = shapely.linestrings(joints.ends[chosen])
        return np.asarray(shapely.STRtree(lines).query(lines, predicate="dwithin", distance=near))
    counts = np.diff(rings.offsets)[chosen]
    # As many corners for all: the last of a face again and again.
    corner = np.minimum(np.arange(int(counts.max(initial=1))), counts[:, None] - 1)
    faces = rings.points[rings.offsets[chosen][:, None] + corner]
    low, high = faces.min(axis=1) - near / 2.0, faces.max(axis=1) + near / 2.0
    boxes = shapely.box(*low[:, :2].T, *high[:, :2].T)
    one, other = shapely.STRtree(boxes).query(boxes, predicate="intersects")
    level = (low[one, 2] <= high[other, 2]) & (low[other, 2] <= high[one, 2]) & (one != other)
    one, other = one[level], other[level]
    meets = _distance(faces[one], faces[other], joints.normals[chosen[other]]) <= near
    return np.stack([one[meets], other[meets]])


def _apart(faces: Faces, joints: InitialJoints) -> np.ndarray:
    """(n_joints, 3) array [m]: by how much the two sides of each joint have parted, at its corners in the mean."""
    offsets = joints.rings.offsets
    return np.asarray(np.add.reduceat(faces.on_a - faces.on_b, offsets[:-1]) / np.diff(offsets)[:, None])


def _part_alike(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(n,) bool array: whether joints that part by these, (n, 3) arrays, part alike: the two sides of one crack do.

    Joints of a dome all meet; its meridians and the hinges between its courses are cracks of their own.
    """
    difference = np.minimum(np.linalg.norm(one - other, axis=1), np.linalg.norm(one + other, axis=1))
    largest = np.maximum(np.linalg.norm(one, axis=1), np.linalg.norm(other, axis=1))
    return np.asarray(difference <= ALIKE * largest)


def _distance(points: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(n,) array [m]: of the nearest of points (n, k, 3) to convex faces (n, m, 3) with normals (n, 3)."""
    along = (np.roll(faces, -1, axis=1) - faces)[:, None]
    arms = points[:, :, None] - faces[:, None]
    place = (arms * along).sum(axis=3) / np.maximum((along**2).sum(axis=3), 1e-300)
    at_edges = np.linalg.norm(arms - np.clip(place, 0.0, 1.0)[..., None] * along, axis=3).min(axis=2)
    above = ((arms * np.cross(normals[:, None, None], along)).sum(axis=3) >= 0.0).all(axis=2)
    level = np.abs((arms[:, :, 0] * normals[:, None]).sum(axis=2))
    return np.asarray(np.where(above, level, at_edges).min(axis=1))


def _farthest(points: np.ndarray) -> np.ndarray:
    """(2, d) array: the two points that are farthest apart, the lower one first, or the left one of a level line."""
    # Only corners of the hull can be; a line has none. Of few points it takes longer than to compare all.
    if points.shape[1] == 3 and len(points) > 100:
        points = points[ConvexHull(points, qhull_options="QJ").vertices]
    elif points.shape[1] == 2 and len(points) > 2:
        points = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(points)))
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    pair = points[list(np.unravel_index(int(apart.argmax()), apart.shape))]
    rise, run = pair[1, -1] - pair[0, -1], pair[1, 0] - pair[0, 0]
    level = abs(rise) < 1e-9 * max(abs(run), 1e-300)
    return pair[::-1] if (run < 0.0 if level else rise < 0.0) else pair
