"""What the page has of blocks of the plane and of space alike: how they move, frame after frame, and what is marked."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import solver
from blockvis.pictures import palette
from blockvis.pictures.acting_loads import LoadArrows, load_arrows
from blockvis.pictures.frame import Frame, framed
from blockvis.pictures.marks import (
    SMALLEST_RESULTANT,
    hinge_ends,
    length_per_force,
    resultants,
    settlement_arrows,
    sliding_lines,
)
from blockvis.results.about import phases_of
from blockvis.results.joint_faces import InitialJoints
from blockvis.results.joints import carried_faces, joint_states
from blockvis.text import force_text, rounded_length
from solver import mechanics

from .packing import FINENESS, FORCE_FINENESS, TOLD_FINENESS, counted_steps, deflated, rounded


def model_of_frames(
    response: solver.Response, joints: InitialJoints, shown: list[solver.Increment], held: np.ndarray
) -> dict[str, Any]:
    """Pack what moves, frame after frame, and the scales of all; points ``held`` (n, d) [m] are in the page, too."""
    assembly = response.assembly
    frame, largest, widest, farthest = _surveyed(assembly, joints, shown)
    loads = load_arrows(response, shown, float(frame.size.max()))
    frame = frame.holding(np.concatenate([*(load.tails for load in loads.values()), held]))
    # Coordinates far from the origin (UTM) would waste the digits.
    origin, extent = np.round(frame.low, 3), float(frame.size.max())
    unit = FINENESS * extent
    packed, sizes = _tables(assembly, joints, shown, origin, unit, largest)
    shown_force = rounded_length(largest)
    return {
        "unit": unit,
        "origin": origin.tolist(),
        "bounds": [*(frame.low - origin).tolist(), *(frame.high - origin).tolist()],
        "widest_crack": widest,
        "largest_displacement": farthest,
        "arrows": _arrows(response, frame, origin),
        "has_forces": bool(len(sizes)),
        "loads": [[kind, load.words, palette.hexadecimal(palette.LOADS[kind])] for kind, load in loads.items()],
        "ground": None,
        "fill": None,
        "force_unit": FORCE_FINENESS * largest,
        "force_length": length_per_force(sizes, largest, 1.5 * assembly.block_size, extent),
        "told_forces": [FINENESS * largest, TOLD_FINENESS],
        "force_scale": [shown_force, force_text(shown_force)],
        "packed": {
            "vertices": deflated(rounded(assembly.vertices - origin, unit)),
            "centroids": deflated(rounded(assembly.centroids - origin, unit)),
            "joint_blocks": deflated(np.stack([joints.block_a, joints.block_b], axis=1)),
            **packed,
            **_packed_loads(loads, shown, origin, unit),
        },
    }


def _surveyed(
    assembly: solver.Assembly, joints: InitialJoints, shown: list[solver.Increment]
) -> tuple[Frame, float, float, float]:
    """Frame of all poses; the largest resultant of a joint in equilibrium [N] or 1, the widest crack and way [m]."""
    largest = widest = farthest = 0.0

    def poses() -> Iterator[solver.Pose]:
        nonlocal largest, widest, farthest
        yield solver.Pose.initial(assembly)
        for increment in shown:
            yield increment.pose
            if increment.status != solver.Status.FALLING:
                sizes = np.linalg.norm(resultants(increment)[1], axis=1)
                largest = max(largest, float(sizes.max(initial=0.0)))
                gaps = carried_faces(assembly, joints, increment.pose, increment.fallen).gaps
                widest = max(widest, float(gaps.max(initial=0.0)))
                moved = increment.pose.positions[assembly.free] - assembly.centroids[assembly.free]
                farthest = max(farthest, float(np.linalg.norm(moved, axis=1).max(initial=0.0)))

    frame = framed(assembly, poses()) if assembly.dimension == 2 else framed(assembly, poses(), 0.0, 0.25)
    return frame, largest or 1.0, widest, farthest


def _packed_loads(
    loads: dict[str, LoadArrows], shown: list[solver.Increment], origin: np.ndarray, unit: float
) -> dict[str, Any]:
    """Arrows of each kind of load, frame after frame."""
    packed: dict[str, Any] = {}
    for kind, load in loads.items():
        found = [load.arrows(increment, increment.pose) for increment in shown]
        packed[f"{kind}_first"] = deflated(np.cumsum([0, *(len(tips) for _, tips in found)]))
        for end, places in zip(("tail", "tip"), zip(*found, strict=True), strict=True):
            packed[f"{kind}_{end}"] = deflated(rounded(np.concatenate(places) - origin, unit))
    return packed


def _arrows(response: solver.Response, frame: Frame, origin: np.ndarray) -> list[list[list[float]]]:
    """Arrows of each phase of the settlement: support, place [m] and direction."""
    assembly = response.assembly
    seen = frame if assembly.dimension == 2 else None
    initial = solver.Pose.initial(assembly)
    return [
        [
            [int(block), *np.round(place - origin, 5).tolist(), *np.round(direction, 5).tolist()]
            for block, place, direction in zip(*settlement_arrows(assembly, settlement, initial, seen), strict=True)
        ]
        for settlement in phases_of(response)
    ]


def _tables(
    assembly: solver.Assembly,
    joints: InitialJoints,
    shown: list[solver.Increment],
    origin: np.ndarray,
    unit: float,
    largest: float,
) -> tuple[dict[str, Any], np.ndarray]:
    """Pack what changes from frame to frame, as integers; gives the sizes of the resultants [N], too.

    That is motion, forces of the joints, resultants of blocks, and marks: hinges (1), sliding joints (2) and points
    that crush (3). A hinge has the ends of its line, in the plane its place twice, as what crushes has; a sliding joint
    has its ends in the plane, and in space its number. Each resultant names its two blocks, for which it is drawn; what
    is told is the normal and the shear force of each joint, of which two blocks may have several. A part of the largest
    resultant [N] is the unit of force.
    """
    # The place of a force need not be finer than a pixel; more digits would only fill the file.
    coarse = round(FORCE_FINENESS / FINENESS / 4.0)
    d, frames, every = assembly.dimension, list[dict[str, np.ndarray]](), list[np.ndarray]()
    for increment in shown:
        moved = increment.pose.displacements(assembly)
        # What was taken away goes out of the picture.
        moved[increment.removed, d - 1] -= 4.0 * unit / FINENESS
        states, told = joint_states(assembly, joints, increment), slice(len(joints))
        carried = np.stack([states.normal_force[told], states.shear_force[told]], axis=1)
        points, forces, pairs = resultants(increment)
        size = np.linalg.norm(forces, axis=1) * (increment.status != solver.Status.FALLING)
        kept = size > SMALLEST_RESULTANT * largest
        every.append(size[kept])
        places, marks = _marks(assembly, joints, increment)
        frames.append(
            {
                "travel": rounded(moved[:, :d], unit),
                "turn": rounded(moved[:, d:], FINENESS),
                "joint_forces": counted_steps(carried, FINENESS * largest),
                "force_place": rounded(points[kept] - origin, unit * coarse) * coarse,
                "force_vector": rounded(forces[kept], FORCE_FINENESS * largest),
                "force_blocks": pairs[kept],
                "mark_place": rounded(places - origin, unit).reshape(-1, 2 * d),
                "mark_kind": marks[:, 0],
                "mark_joint": marks[:, 1],
            }
        )

    def listed(first: str, *names: str) -> dict[str, Any]:
        counts = np.cumsum([0, *(len(frame[names[0]]) for frame in frames)])
        return {first: deflated(counts)} | {
            name: deflated(np.concatenate([frame[name] for frame in frames])) for name in names
        }

    packed = {
        **{name: deflated(np.stack([of[name] for of in frames])) for name in ("travel", "turn", "joint_forces")},
        **listed("force_first", "force_place", "force_vector", "force_blocks"),
        **listed("mark_first", "mark_place", "mark_kind", *["mark_joint"] * (d == 3)),
    }
    return packed, np.concatenate(every)


def _marks(
    assembly: solver.Assembly, joints: InitialJoints, increment: solver.Increment
) -> tuple[np.ndarray, np.ndarray]:
    """List ends (n, 2, d) [m] of marks, and (n, 2): 1 or 3 and -1 of hinges or crushing, 2 and in space the joint."""
    mechanism, contacts = mechanics.mechanism_of(assembly, increment), increment.contacts
    points = contacts.points
    hinges = points[hinge_ends(assembly, increment, mechanism)]
    if assembly.dimension == 2:
        sliding = sliding_lines(assembly, contacts, mechanism.sliding_points, points)
        numbers = [-1] * len(sliding)
    else:
        pairs = {pair: k for k, pair in enumerate(zip(joints.block_a.tolist(), joints.block_b.tolist(), strict=True))}
        numbers = [pairs.get((a, b), -1) for a, b in mechanism.sliding.tolist()]
        sliding = np.broadcast_to(points[:1], (len(numbers), 2, 3)) if numbers else np.zeros((0, 2, 3))
    crushing = points[mechanism.crushing_points][:, None].repeat(2, axis=1)
    marks = [*[(1, -1)] * len(hinges), *[(2, number) for number in numbers], *[(3, -1)] * len(crushing)]
    return np.concatenate([hinges, sliding, crushing]), np.array(marks, dtype=np.int32).reshape(-1, 2)
