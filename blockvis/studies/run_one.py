"""One run of a study: from the values of a case to a row of the table, even if the run fails."""

from __future__ import annotations

import io
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis.case_files.read import case_of
from blockvis.cases.build import case_assembly
from blockvis.dynamics.fall import falls_from, with_mechanism
from blockvis.kinds.kind import AnalysisRun
from blockvis.kinds.kinds import KINDS
from blockvis.pictures.backfill import fill_bodies
from blockvis.pictures.frame import Frame
from blockvis.pictures.marks import settlement_arrows
from blockvis.pictures.solid_view import ABOVE, AROUND, View
from blockvis.results.about import collapse_phase, governing_limit, loss_in, phases_of
from blockvis.results.joints import initial_joints, opening_and_slip
from blockvis.results.mechanism_arrays import SWING, swing_factors, swung
from blockvis.results.tables import finite
from blockvis.runs.plan import planned
from solver import mechanics

from .study_file import run_values

#: Status of a run that raised an error, and of one whose values make no structure.
FAILED, NOT_BUILT = "failed", "not built"

#: Most joints that a class names; of more joints it gives the number.
NAMED_JOINTS = 8

#: From where blocks in space are seen: the same in all runs, so that their mechanisms compare.
VIEW = View(AROUND[0], ABOVE)


def run_once(
    values: Mapping[str, Any], source: str, order: Mapping[str, Any], n_seeded: int, seconds: float | None = None
) -> tuple[dict[str, Any], bytes]:
    """Carry out one run.

    ``values`` are the base case as TOML has it, read from a file ``source`` to whose folder its paths are relative. The
    order is as of :meth:`blockvis.studies.study_file.Study.order`; its seed is of the last ``n_seeded`` imperfections.
    A run is interrupted after so many seconds.

    Gives the row of the table, with the status "not built" or "failed" and the error as ``message`` where one is
    raised, and the mechanism for its picture, as an npz file; empty without a mechanism.
    """
    started, run = time.perf_counter(), None
    try:
        # Warnings about the layout would appear once per run; a run outside a study shows them.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            case = case_of(run_values(values, order, n_seeded), Path(source))
            # Where nothing stands at all the first frame of the fall shows the mechanism; the others are not needed.
            case = replace(case, controls=replace(case.controls, falling_frames=1))
            run = planned(case, case_assembly(case))
            found, shape = _outcome(run, order["run"], seconds)
    except Exception as error:  # noqa: BLE001 - any error is this run's result and must not end the study
        status = NOT_BUILT if run is None and isinstance(error, ValueError) else FAILED
        return _row(order, status=status, message=_reason(error), seconds=time.perf_counter() - started), b""
    return _row(order, **found, seconds=time.perf_counter() - started), shape


def failed_row(order: Mapping[str, Any], message: str) -> dict[str, Any]:
    """Make the row of a run of which nothing came back."""
    return _row(order, status=FAILED, message=message, seconds=0.0)


def _row(order: Mapping[str, Any], **found: Any) -> dict[str, Any]:
    return {"run": order["run"], "seed": order["seed"], "parameters": dict(order["point"]), **found}


def _reason(error: Exception) -> str:
    kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
    return f"{kind}{error}".strip() or type(error).__name__


def _outcome(run: AnalysisRun, number: int, seconds: float | None) -> tuple[dict[str, Any], bytes]:
    """Follow a run for so many seconds; give what the table says of it, and the shape of its mechanism."""
    started, ending = time.perf_counter(), None
    # Only the ends of the path are kept.
    kept: list[solver.Increment] = []
    n_path = n_programs = 0
    try:
        for increment in run.steps:
            falling = increment.status is solver.Status.FALLING
            if not falling:
                # Each limit load belongs to an increment.
                kept = kept if run.limits else kept[:1]
                n_path, n_programs = n_path + 1, n_programs + increment.programs
            kept.append(increment)
            # Of what falls the collapse is found already.
            if seconds is not None and not falling and time.perf_counter() - started > seconds:
                told = f"took longer than {seconds:g} s: let [study] seconds be longer, with --retry-failed"
                ending = mechanics.Ending(solver.Status.INTERRUPTED, told)
                break
    except Exception as error:
        # What raises half-way has come as far as its last increment.
        if not n_path:
            raise
        ending = mechanics.Ending(solver.Status.SOLVER_FAILED, _reason(error))
    response = run.response(kept, ending or run.steps.ending)
    found = _numbers(response) | {"increments": n_path, "programs": n_programs}
    state = with_mechanism(response) or (response.governing if response.limits else None)
    state = state if state is not None and state.velocity.any() else falls_from(response)
    if state is None or "bracket_low" not in found:
        return found, b""
    assembly = response.assembly
    mechanism = mechanics.mechanism_of(assembly, state)
    found |= {
        "falling_share": loss_in(assembly, state).share,
        "mechanism": str(mechanism),
        "mechanism_class": mechanism_class(mechanism),
        "macro_blocks": len(mechanism.motions),
        "hinges": len(mechanism.hinges),
        "sliding_joints": len(mechanism.sliding),
    }
    settlement = response.settlements[collapse_phase(response) or 0] if response.settlements else None
    return found, _shape(number, response, state, mechanism, settlement)


def _numbers(response: solver.Response) -> dict[str, Any]:
    """Give what the table says of how a run ended; settlements count from the start of the first phase."""
    before = [0.0, *np.cumsum([s.limit for s in phases_of(response)])]
    path, collapse, assembly, governing = response.path, response.collapse, response.assembly, response.governing
    told = KINDS[response.analysis].capacity
    by_load, never_stood = told == response.measured, response.stop is solver.Status.NO_INITIAL_EQUILIBRIUM
    # A settlement that ends before the load acts says nothing of what the structure carries.
    unknown = by_load and response.stop is solver.Status.LOCKED
    found: dict[str, Any] = {
        "status": FAILED if unknown else str(response.stop),
        "message": response.message if collapse is None else "",
        "unit": told.unit and response.parameter.unit,
        "last_settlement": float(path[-1].settlement + before[path[-1].phase])
        if path and response.parameter.is_path
        else 0.0,
        "initial_reaction": finite(response.initial_reaction),
        "collapse_reaction": None,
        "load_multiplier": None,
        "total_weight": response.total_weight,
    }
    if governing is not None:
        joints = initial_joints(assembly)
        opening = opening_and_slip(assembly, joints, path[-1].pose)[:, 0]
        left = path[-1].fallen[joints.block_a] | path[-1].fallen[joints.block_b]
        found |= {"last_reaction": float(governing.reaction), "largest_opening": float(opening[~left].max(initial=0.0))}
        weights = assembly.masses * assembly.free
        found["lost_share"] = float(weights[path[-1].fallen & ~path[-1].removed].sum() / weights.sum())
    if collapse is not None and path:
        low, high = (float(before[collapse_phase(response) or 0] + s) for s in collapse.bracket)
        found |= {"collapse_displacement": (low + high) / 2.0, "bracket_low": low, "bracket_high": high}
        found["last_settlement"] = low
        found["collapse_reaction"] = float(path[-1].reaction if collapse.reaction is None else collapse.reaction)
    elif never_stood and not by_load:
        # It collapses before any settlement.
        found |= {"collapse_displacement": 0.0, "bracket_low": 0.0, "bracket_high": 0.0}
    if by_load:
        # What a settlement or its own weight brings down carries no live load, what has no result who knows which.
        limit = governing_limit(response) if collapse is None and not never_stood else None
        low, high = (0.0, 0.0) if limit is None else limit.bounds
        if never_stood or response.stop in (solver.Status.COLLAPSED, solver.Status.LIMIT_REACHED):
            found["load_multiplier"] = 0.0 if limit is None else limit.multiplier
            found |= {"bracket_low": low, "bracket_high": high} if np.isfinite(high) else {}
    elif response.control is not None and path:
        found["load_multiplier"] = float(path[0].load_multiplier)
    return found


def mechanism_class(mechanism: mechanics.Mechanism) -> str:
    """Name the class of a mechanism by its hinges and sliding joints, or by their numbers if there are many.

    It is the same for the same joints, whatever the displacements of the blocks.
    """
    hinges, sliding = mechanism.hinges, mechanism.sliding
    parts = mechanics.counted(len(mechanism.motions), "part")
    if len(hinges) + len(sliding) > NAMED_JOINTS:
        joints = ((len(hinges), "hinge"), (len(sliding), "sliding joint"))
        return ", ".join([parts, *(mechanics.counted(k, what) for k, what in joints if k)])
    words = [parts] if len(hinges) + len(sliding) == 0 else []
    words += [
        f"{what} {_joints(mechanism.names, pairs.tolist())}"
        for what, pairs in (("hinges", hinges), ("sliding", sliding))
        if len(pairs)
    ]
    return "; ".join(words)


def _joints(names: Sequence[str], pairs: Sequence[Sequence[int]]) -> str:
    """Write pairs of blocks, the common part of their names once: "voussoir 3|4, 6|7"."""
    words, before = [], None
    for pair in pairs:
        first, second = (names[i] for i in sorted(pair, key=lambda i: (len(names[i]), names[i])))
        kind, _, number = first.rpartition(" ")
        other, _, last = second.rpartition(" ")
        alike = bool(kind) and kind == other
        words.append(f"{'' if kind == before else f'{kind} '}{number}|{last}" if alike else f"{first}|{second}")
        before = kind if alike else None
    return ", ".join(words)


def _shape(
    number: int,
    response: solver.Response,
    falling: solver.Increment,
    mechanism: mechanics.Mechanism,
    settlement: solver.Settlement | None,
) -> bytes:
    """Pack blocks, ties and fill as the mechanism of the run with a number displaces them, for a small picture.

    Of blocks in space these are the faces that are seen, as they are seen. The arrows are where supports settle, and
    which way, where there is a settlement.
    """
    assembly = response.assembly
    free = assembly.free[assembly.block_of_vertex]
    at_rest = mechanics.moved_vertices(assembly, falling.pose)
    size = float(np.ptp(at_rest[free], axis=0).max())
    (factor,) = swing_factors(assembly, falling, SWING, np.ones(1))
    moved = swung(falling.pose, falling.velocity * factor)
    vertices, tied = mechanics.moved_vertices(assembly, moved), mechanics.tie_ends(response.ties, assembly, moved)
    bodies = fill_bodies(response, moved, falling.fallen)
    rims = bodies.rims()
    if assembly.dimension == 2:
        low, high = at_rest[free].min(axis=0) - 0.15 * size, at_rest[free].max(axis=0) + 0.15 * size
        seen: Frame | None = Frame(low, high)
        offsets, block = assembly.offsets, np.arange(assembly.n_blocks)
    else:
        seen = None
        tied, rims = (VIEW.projected(ends.reshape(-1, 3)).reshape(-1, 2, 2) for ends in (tied, rims))
        corners, offsets, block = _seen_faces(assembly, vertices)
        vertices, at_rest = (VIEW.projected(points[corners]) for points in (vertices, at_rest))
    arrows = [np.zeros((0, assembly.dimension))] * 2
    if settlement is not None:
        _, *arrows = settlement_arrows(assembly, settlement, falling.pose, seen)
    places, directions = arrows if assembly.dimension == 2 else (VIEW.projected(ends) for ends in arrows)
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        run=number,
        vertices=vertices,
        at_rest=at_rest,
        offsets=offsets.astype(np.int32),
        parts=mechanism.parts[block].astype(np.int16),
        free=assembly.free[block],
        arrows=np.stack([places, directions], axis=1),
        ties=tied,
        tie_states=falling.ties.states.astype(np.int8),
        fill=bodies.columns if assembly.dimension == 2 else np.zeros((0, 4, 2)),
        fill_rims=rims,
    )
    return buffer.getvalue()


def _seen_faces(assembly: solver.Assembly, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the faces that are turned to the eye: supports first, then those at the back.

    Gives the vertices around them, face after face, where each face begins, (n_faces + 1,), and its block.
    """
    solids = assembly.polyhedra
    faces, rings = solids.faces(vertices), np.split(solids.corners, solids.face_offsets[1:-1])
    order = np.lexsort((VIEW.depth(faces.middles), assembly.free[solids.block_of_face]))
    order = order[VIEW.depth(faces.normals)[order] > 0.0]
    offsets = np.cumsum([0, *(len(rings[face]) for face in order)])
    return np.concatenate([rings[face] for face in order]), offsets, solids.block_of_face[order]
