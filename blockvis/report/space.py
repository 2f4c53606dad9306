"""What the page has of blocks in space: polyhedra, joints as faces, and what lies on them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import solver
from blockvis.pictures import palette
from blockvis.pictures.frame import Frame, framed
from blockvis.pictures.marks import (
    SMALLEST_RESULTANT,
    hinge_ends,
    length_per_force,
    resultants,
    settlement_arrows,
)
from blockvis.pictures.solid_view import chosen_view
from blockvis.pictures.surface import sharp_edges, triangles_of
from blockvis.pictures.swing import Swing
from blockvis.results.joint_faces import InitialJoints, initial_joints
from blockvis.results.joints import carried_faces
from blockvis.text import force_text, rounded_length

from .packing import FINENESS, FORCE_FINENESS, TURN_UNIT, deflated, hexadecimals, rounded

#: Directions are stored in this unit.
DIRECTION_UNIT = 1e-6


def model_in_space(response: solver.Response, swing: Swing, shown: list[solver.Increment]) -> dict[str, Any]:
    """Pack what only blocks in space have.

    Parameters
    ----------
    response : solver.Response
    swing : Swing
        Its mechanism decides where the page looks from.
    shown : list of solver.Increment
        What the page shows, frame after frame.
    """
    assembly, shapes = response.assembly, response.assembly.polyhedra
    view = chosen_view(response, swing.displaced.positions - swing.increment.pose.positions)
    joints = initial_joints(assembly)
    frame, largest, widest = _surveyed(assembly, joints, shown)
    # Coordinates far from the origin (UTM) would waste the digits.
    origin = np.round(frame.low, 3)
    unit = FINENESS * float(frame.size.max())
    triangles, _ = triangles_of(shapes)
    edges = sharp_edges(shapes)
    rings = joints.rings
    tables = _Tables(assembly, joints, shown, origin, unit, largest)
    extent = float(frame.size.max())
    shown_force = rounded_length(largest)
    sizes = np.concatenate(tables.sizes)
    return {
        "unit": unit,
        "origin": origin.tolist(),
        "bounds": [*(frame.low - origin).tolist(), *(frame.high - origin).tolist()],
        "view": np.radians([view.around, view.above]).tolist(),
        "cracks": hexadecimals(palette.CRACKS.astype(int)),
        "widest_crack": widest,
        "largest_displacement": tables.largest_displacement,
        "arrows": _arrows(response, origin),
        "has_forces": bool(len(sizes)),
        "live_words": "",
        "ground": None,
        "force_unit": FORCE_FINENESS * largest,
        "force_length": length_per_force(sizes, largest, 1.5 * assembly.block_size, extent),
        "force_scale": [shown_force, force_text(shown_force)],
        "packed": {
            "vertices": deflated(rounded(assembly.vertices - origin, unit), len(assembly.vertices)),
            "offsets": deflated(shapes.offsets, len(shapes.offsets)),
            "centroids": deflated(rounded(assembly.centroids - origin, unit), assembly.n_blocks),
            "triangles": deflated(triangles, len(triangles)),
            "edges": deflated(edges, len(edges)),
            "joint_blocks": deflated(np.stack([joints.block_a, joints.block_b], axis=1), len(joints)),
            "ring_first": deflated(rings.offsets, len(rings.offsets)),
            "ring_points": deflated(rounded(rings.points - origin, unit), len(rings.points)),
            "ring_normals": deflated(rounded(joints.normals, DIRECTION_UNIT), len(joints)),
        }
        | tables.packed(),
    }


def _surveyed(
    assembly: solver.Assembly, joints: InitialJoints, shown: list[solver.Increment]
) -> tuple[Frame, float, float]:
    """Box that holds all poses, the largest resultant of a joint in equilibrium [N] or 1, and the widest crack [m]."""
    largest = widest = 0.0

    def poses() -> Iterator[solver.Pose]:
        nonlocal largest, widest
        yield solver.Pose.initial(assembly)
        for increment in shown:
            yield increment.pose
            if increment.status != solver.Status.FALLING:
                sizes = np.linalg.norm(resultants(increment)[1], axis=1)
                largest = max(largest, float(sizes.max(initial=0.0)))
                widest = max(widest, float(carried_faces(assembly, joints, increment.pose).gaps.max(initial=0.0)))

    frame = framed(assembly, poses(), margin=0.0, supports=0.25)
    return frame, largest or 1.0, widest


def _arrows(response: solver.Response, origin: np.ndarray) -> list[list[list[float]]]:
    """Arrows of each phase of the settlement: support, place [m] and direction."""
    initial = solver.Pose.initial(response.assembly)
    return [
        [
            [int(block), *np.round(place - origin, 5).tolist(), *np.round(direction, 5).tolist()]
            for block, place, direction in zip(*settlement_arrows(response.assembly, settlement, initial), strict=True)
        ]
        for settlement in response.settlements
    ]


class _Tables:
    """What changes from frame to frame, as integers: motion, resultants of the joints, hinges (1), sliding joints (2).

    A hinge has the ends of its line, a sliding joint its number. Each resultant names its two blocks.

    Parameters
    ----------
    assembly : solver.Assembly
    joints : InitialJoints
    shown : list of solver.Increment
        Gone through once.
    origin : (3,) array [m]
    unit : float [m]
    largest : float [N]
        Resultant; a part of it is the unit of force.
    """

    def __init__(
        self,
        assembly: solver.Assembly,
        joints: InitialJoints,
        shown: list[solver.Increment],
        origin: np.ndarray,
        unit: float,
        largest: float,
    ) -> None:
        # The place of a force need not be finer than a pixel; more digits would only fill the file.
        coarse = round(FORCE_FINENESS / FINENESS / 4.0)
        self.n = len(shown)
        self.travel, self.turn = [], []
        self.places, self.vectors, self.pairs = ([np.zeros((0, n), dtype=np.int32)] for n in (3, 3, 2))
        self.sizes = [np.zeros(0)]
        self.mark_places, self.marks = ([np.zeros((0, n), dtype=np.int32)] for n in (6, 2))
        self.largest_displacement = 0.0
        for increment in shown:
            moved = increment.pose.displacements(assembly)
            falling = increment.status == solver.Status.FALLING
            if not falling:
                far = float(np.linalg.norm(moved[assembly.free, :3], axis=1).max(initial=0.0))
                self.largest_displacement = max(self.largest_displacement, far)
            self.travel.append(rounded(moved[:, :3], unit))
            self.turn.append(rounded(moved[:, 3:], TURN_UNIT))
            points, forces, pairs = resultants(increment)
            size = np.linalg.norm(forces, axis=1) * (not falling)
            kept = size > SMALLEST_RESULTANT * largest
            self.places.append(rounded(points[kept] - origin, unit * coarse) * coarse)
            self.vectors.append(rounded(forces[kept], FORCE_FINENESS * largest))
            self.sizes.append(size[kept])
            self.pairs.append(pairs[kept].astype(np.int32))
            places, marks = _marks(assembly, joints, increment)
            self.mark_places.append(rounded(places - origin, unit).reshape(-1, 6))
            self.marks.append(marks)

    def packed(self) -> dict[str, Any]:
        """As the page unpacks them."""
        forces, found = (np.cumsum([len(k) for k in rows]).tolist() for rows in (self.sizes, self.marks))
        marks = np.concatenate(self.marks)
        return {
            "travel": deflated(np.stack(self.travel), self.n),
            "turn": deflated(np.stack(self.turn), self.n),
            "force_first": deflated(forces, len(forces)),
            "force_place": deflated(np.concatenate(self.places), forces[-1]),
            "force_vector": deflated(np.concatenate(self.vectors), forces[-1]),
            "force_blocks": deflated(np.concatenate(self.pairs), forces[-1]),
            "mark_first": deflated(found, len(found)),
            "mark_place": deflated(np.concatenate(self.mark_places), found[-1]),
            "mark_kind": deflated(marks[:, 0], found[-1]),
            "mark_joint": deflated(marks[:, 1], found[-1]),
        }


def _marks(
    assembly: solver.Assembly, joints: InitialJoints, increment: solver.Increment
) -> tuple[np.ndarray, np.ndarray]:
    """List ends (n, 2, 3) [m] of hinges and sliding joints, and (n, 2): 1 and -1, or 2 and the number of the joint."""
    mechanism, points = solver.mechanism_of(assembly, increment), increment.contacts.points
    lines = points[hinge_ends(assembly, increment, mechanism)]
    pairs = {pair: k for k, pair in enumerate(zip(joints.block_a.tolist(), joints.block_b.tolist(), strict=True))}
    numbers = [pairs.get((a, b), -1) for a, b in mechanism.sliding.tolist()]
    nowhere = np.broadcast_to(points[:1], (len(numbers), 2, 3)) if numbers else np.zeros((0, 2, 3))
    marks = [*((1, -1) for _ in range(len(lines))), *((2, number) for number in numbers)]
    return np.concatenate([lines, nowhere]), np.array(marks, dtype=np.int32).reshape(-1, 2)
