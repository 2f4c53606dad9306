"""A local origin: structures drawn far from the origin, as on a national grid, are followed where they stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from solver.assembly import Assembly
from solver.kinematics import Pose
from solver.loads import Loads, Settlement
from solver.results.increment import Increment
from solver.ties import Tie

#: Distance from the origin in block sizes beyond which rounding of the coordinates, half a nanometre at five thousand
#: kilometres, would come near what the geometry is corrected to.
FAR = 1e3


def at_origin(assembly: Assembly) -> np.ndarray:
    """(d,) array [m]: what to take off the coordinates; zero where the structure is near the origin."""
    low, high = assembly.vertices.min(axis=0), assembly.vertices.max(axis=0)
    middle = (low + high) / 2.0
    if float(np.abs(middle).max()) <= FAR * assembly.block_size:
        return np.zeros(assembly.dimension)
    # Multiples of a power of two that is large against the structure: taking them off rounds nothing.
    unit = 2.0 ** np.ceil(np.log2(max(float((high - low).max()), assembly.block_size)))
    return np.asarray(np.round(middle / unit) * unit)


def without_origin(
    origin: np.ndarray, assembly: Assembly, loads: Loads, ties: Sequence[Tie]
) -> tuple[Assembly, Loads, tuple[Tie, ...]]:
    """The blocks, their loads and ties in coordinates that count from a local origin."""
    if not origin.any():
        return assembly, loads, tuple(ties)
    near_ties = tuple(replace(tie, points=(np.asarray(tie.points) - origin).tolist()) for tie in ties)
    loads = replace(loads, fills=tuple(fill.shifted(-origin) for fill in loads.fills))
    return replace(assembly, shapes=assembly.shapes.shifted(-origin)), loads, near_ties


def nearer(phase: Settlement, origin: np.ndarray) -> Settlement:
    """The settlement with the points it is given by in coordinates that count from the origin."""
    centre, axis = (
        None if point is None else (np.asarray(point) - origin[: len(point)]).tolist()
        for point in (phase.rotation_centre, phase.radial_from)
    )
    return replace(phase, rotation_centre=centre, radial_from=axis)


def in_global_coordinates(increment: Increment, origin: np.ndarray) -> Increment:
    """The increment with its places where the drawing has them; its checkpoint stays in local coordinates."""
    pose, contacts, ties = increment.pose, increment.contacts, increment.ties
    return increment.with_arrays(
        pose=Pose(pose.positions + origin, pose.rotations),
        contacts=replace(contacts, points=contacts.points + origin),
        ties=replace(ties, ends=ties.ends + origin) if len(ties.ends) else ties,
    )
