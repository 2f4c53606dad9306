"""Tables and summary of a results folder: rows of response.csv, limit loads, summary.json, and back."""

from __future__ import annotations

import csv
import io
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis.atomic_files import write_whole

from .increments import StoredLimit
from .quantities import POSITION, governing, parameter_word, path_values
from .record import Record

#: Columns of response.csv.
COLUMNS = (
    "increment",
    "phase",
    "settlement",
    "reaction",
    "reaction_over_weight",
    "load_multiplier",
    "equilibrium_residual",
    "largest_penetration",
    "duality_gap",
    "complementarity",
    "kinematic_violation",
    "contacts_open",
    "contacts_sticking",
    "contacts_sliding",
    "contacts_hinging",
    "hinges",
    "sliding_joints",
    "programs",
    "seconds",
)

#: Limit loads over the positions of a load that moves, and over the settlement.
CAPACITY_TABLES = ("envelope.csv", "capacity.csv")


def summary_of(response: solver.Response, *, seconds: float, record: Record) -> dict[str, Any]:
    """What summary.json holds; every length in m, force in N, angle in rad.

    Parameters
    ----------
    response : solver.Response
    seconds : float
        Solver time.
    record : Record
        What the run was made from.
    """
    path, collapse = response.path, response.collapse
    worst = {
        name: max((getattr(i.certificate, name) for i in path), default=None)
        for name in (
            "equilibrium_residual",
            "largest_penetration",
            "duality_gap",
            "complementarity",
            "kinematic_violation",
        )
    }
    return {
        "status": str(response.stop),
        "message": response.message,
        "notes": list(response.notes),
        "collapse_displacement": collapse.displacement if collapse else None,
        "collapse_bracket": list(collapse.bracket) if collapse else None,
        "settlement_unit": response.settlements[-1].unit if response.settlements else "m",
        "initial_reaction": path[0].reaction if path else None,
        "collapse_reaction": collapse.reaction if collapse else None,
        "mechanism": collapse.words if collapse else None,
        **_joint_counts(response),
        **capacity_summary(response),
        "last_settlement": path[-1].settlement if path else None,
        "last_reaction": path[-1].reaction if path else None,
        "total_weight": response.total_weight,
        "n_blocks": response.assembly.n_blocks,
        "n_contacts": len(path[-1].contacts) if path else None,
        "n_increments": len(path),
        "n_falling_frames": len(response.increments) - len(path),
        "n_programs": sum(i.programs for i in response.increments),
        "largest_residuals": worst,
        "seconds": seconds,
        "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "versions": record.versions,
        "inputs": record.inputs(),
        "case": record.case,
    }


def _joint_counts(response: solver.Response) -> dict[str, int | None]:
    """How many hinges and sliding joints the collapse mechanism has, as the picture of it shows them."""
    if response.collapse is None or not response.path:
        return {"hinges": None, "sliding_joints": None}
    falling = solver.with_motion(response.path[-1], response.collapse.mechanism)
    mechanism = solver.mechanism_of(response.assembly, falling)
    return {"hinges": len(mechanism.hinges), "sliding_joints": len(mechanism.sliding)}


def row_of_increment(
    number: int, increment: solver.Increment, assembly: solver.Assembly, parameter: str
) -> Sequence[Any]:
    """The row of response.csv for an increment, in the order of :data:`COLUMNS`."""
    certificate = increment.certificate
    settlement = 0.0 if parameter == POSITION else float(increment.settlement)
    own = () if parameter == "settlement" else (repr(float(increment.settlement)),)
    mechanism = solver.mechanism_of(assembly, increment)
    counts = np.bincount(increment.states, minlength=len(solver.ContactState))
    return (
        number,
        increment.phase,
        repr(settlement),
        repr(float(increment.reaction)),
        repr(float(increment.reaction) / solver.total_weight(assembly)),
        repr(float(increment.load_multiplier)),
        f"{certificate.equilibrium_residual:.3e}",
        f"{certificate.largest_penetration:.3e}",
        f"{certificate.duality_gap:.3e}",
        f"{certificate.complementarity:.3e}",
        f"{certificate.kinematic_violation:.3e}",
        *(int(counts[state]) for state in (0, 1, 2, 3)),
        len(mechanism.hinges),
        len(mechanism.sliding),
        increment.programs,
        f"{increment.seconds:.4f}",
        *own,
    )


def write_capacity(response: solver.Response, folder: Path) -> None:
    """Writes envelope.csv, a row per position, or capacity.csv, a row per settlement, where there are limit loads.

    Parameters
    ----------
    response : solver.Response
    folder : Path
    """
    if response.analysis != "limit load":
        return
    word = parameter_word(response)
    rows = io.StringIO()
    table = csv.writer(rows, lineterminator="\n")
    first = ["position"] if word == POSITION else ["phase", "settlement"]
    table.writerow([*first, "load_multiplier", "static", "kinematic", "status", "flow", "mechanism"])
    for limit, state in limit_states(response):
        place = [repr(float(state.settlement))]
        numbers = [repr(float(v)) for v in (limit.multiplier, *limit.bounds)]
        words = str(solver.mechanism_of(response.assembly, state)) if limit.mechanism.any() else ""
        where = place if word == POSITION else [str(state.phase), *place]
        table.writerow([*where, *numbers, str(limit.status), limit.flow, words])
    name = CAPACITY_TABLES[0] if word == POSITION else CAPACITY_TABLES[1]
    if word == POSITION and len(response.limits) < 2:
        return
    write_whole(folder / name, rows.getvalue())


def capacity_summary(response: solver.Response) -> dict[str, Any]:
    """What the summary says of the analysis, its parameter and its multipliers; None where nothing finite is known.

    Parameters
    ----------
    response : solver.Response
    """
    summary: dict[str, Any] = {"analysis": response.analysis, "parameter": parameter_word(response)}
    motions = [asdict(motion) for motion in response.settlements]
    if response.analysis == "pushover":
        values = path_values(response)
        largest = int(np.nanargmax(values)) if np.isfinite(values).any() else None
        return summary | {
            "control": motions[0],
            "limit_load_multiplier": _finite(values[0]) if len(values) else None,
            "largest_load_multiplier": None if largest is None else _finite(values[largest]),
            "largest_load_multiplier_at": None if largest is None else float(response.settlement[largest]),
        }
    summary["settlements"] = motions
    if response.analysis != "limit load":
        return summary
    chosen = governing(response)
    states = limit_states(response)
    limit = next((limit for limit, state in states if state is chosen), states[0][0] if states else None)
    summary |= {
        "limit_load_multiplier": None if limit is None else _finite(limit.multiplier),
        "limit_load_bounds": None if limit is None else [_finite(bound) for bound in limit.bounds],
        "limit_load_flow": None if limit is None else limit.flow,
        "limit_load_status": None if limit is None else str(limit.status),
        "live_load": None if limit is None else limit.live_force,
        "limit_loads": [
            {
                "increment": number,
                "multiplier": _finite(limit.multiplier),
                "bounds": [_finite(bound) for bound in limit.bounds],
                "status": str(limit.status),
                "flow": limit.flow,
                "live_load": limit.live_force,
                "programs": limit.programs,
            }
            for number, (limit, _) in enumerate(states)
        ],
    }
    if chosen is not None and response.collapse is None:
        summary["mechanism"] = str(solver.mechanism_of(response.assembly, chosen)) if chosen.velocity.any() else None
    if parameter_word(response) == POSITION and len(response.limits) > 1:
        summary["governing_position"] = None if chosen is None else chosen.settlement
    return summary


def stored_parameters(summary: Mapping[str, Any]) -> tuple[solver.Settlement, ...]:
    """What the parameter of a stored response runs over, from :func:`capacity_summary`."""
    if summary.get("control"):
        return (solver.ControlDisplacement(**summary["control"]),)  # type: ignore[return-value]
    motions = [dict(motion) for motion in summary.get("settlements", [])]
    for motion in motions:
        motion["blocks"] = None if motion["blocks"] is None else tuple(motion["blocks"])
    return tuple(solver.Settlement(**motion) for motion in motions)


def stored_limits(summary: Mapping[str, Any], increments: Sequence[solver.Increment]) -> tuple[solver.LimitLoad, ...]:
    """The limit loads of a stored response."""
    limits = []
    for stored in summary.get("limit_loads", []):
        state = increments[stored["increment"]]
        status = solver.LimitStatus(stored["status"])
        nothing = math.inf if status is solver.LimitStatus.UNBOUNDED else math.nan
        low, high = (nothing if bound is None else bound for bound in stored["bounds"])
        limits.append(
            StoredLimit.of(
                state,
                multiplier=nothing if stored["multiplier"] is None else stored["multiplier"],
                bounds=(low, high),
                status=status,
                flow=stored["flow"],
                live_force=stored["live_load"],
                programs=stored["programs"],
            )
        )
    return tuple(limits)


def limit_states(response: solver.Response) -> list[tuple[solver.LimitLoad, solver.Increment]]:
    """Each limit load with the increment that tells it; one found in an interruption has none yet.

    Parameters
    ----------
    response : solver.Response
        Whose limit states come first, in the order of the limit loads, frames of a fall or a mechanism behind them.
    """
    return list(zip(response.limits, response.increments, strict=False))


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
