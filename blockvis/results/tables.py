"""Table and summary of a results folder: rows of response.csv, and what summary.json holds."""

from __future__ import annotations

import csv
import io
import math
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any

import numpy as np

import solver
from blockvis.text import force_text, listed
from solver import mechanics

from .about import collapse_mechanism, collapse_phase, loss_of, mechanism_text, unit_in
from .record import Record

#: Measures of the certificate of an increment.
MEASURES = tuple(field.name for field in fields(solver.Certificate))

#: Columns of response.csv.
COLUMNS = (
    "increment", "phase", "settlement", "reaction", "reaction_over_weight", "load_multiplier", "least_admissible",
    "largest_admissible", *MEASURES, "contacts_open", "contacts_sticking", "contacts_sliding", "contacts_hinging",
    "hinges", "sliding_joints", "programs", "seconds",
)  # fmt: skip

#: Columns of supports.csv before those of the forces, and these in the plane and in space.
SUPPORT_COLUMNS = ("increment", "phase", "settlement", "support", "role")
FORCES = {2: ("force_x", "force_y", "moment"), 3: ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")}

#: Limit loads over the positions of a load that moves, and over the settlement.
LIMIT_TABLES = ("envelope.csv", "capacity.csv")


def summary_of(response: solver.Response, *, seconds: float, record: Record, own: Mapping[str, Any]) -> dict[str, Any]:
    """Make the summary that summary.json holds, with what the kind of analysis adds; in m, N, rad, solver seconds."""
    path, collapse, phase = response.path, response.collapse, collapse_phase(response)
    in_phase = phase if phase is not None else path[-1].phase if path else 0
    worst = mechanics.worst_of(i.certificate for i in path)
    # Hinges and sliding joints are those of the picture of the mechanism.
    mechanism, loss = collapse_mechanism(response), loss_of(response)
    # States that stand by themselves stand after the last of the settlements, or as drawn.
    before = None if response.parameter.is_path else next(reversed(response.settlements), None)
    last = path[-1].parameter if path and response.parameter.is_path else before.limit if before else 0.0
    return {
        "status": str(response.stop),
        "message": response.message,
        "notes": list(response.notes),
        "collapse_displacement": collapse.displacement if collapse else None,
        "collapse_phase": None if phase is None else phase + 1,
        "collapse_bracket": list(collapse.bracket) if collapse else None,
        "settlement_unit": before.unit if before else unit_in(response, in_phase),
        "initial_reaction": finite(response.initial_reaction),
        "reaction_at_rest": finite(path[0].reaction) if path else None,
        "collapse_lost": collapse.lost if collapse else None,
        "collapse_reaction": collapse.reaction if collapse else None,
        "mechanism": mechanism_text(response) if collapse else None,
        "hinges": None if mechanism is None else len(mechanism.hinges),
        "sliding_joints": None if mechanism is None else len(mechanism.sliding),
        "loss": None if loss is None else "local" if loss.local else "structure",
        "falling_weight": None if loss is None else loss.weight,
        "falling_share": None if loss is None else loss.share,
        "losses": [{**asdict(loss), "phase": loss.phase + 1} for loss in response.losses],
        "removed": removals(response),
        "analysis": response.analysis,
        "parameter": response.parameter.name,
        **own,
        "last_settlement": last if path else None,
        "last_reaction": finite(path[-1].reaction) if path else None,
        "total_weight": response.total_weight,
        "fill_weight": sum(fill.weight(response.assembly) for fill in response.loads.fills),
        "n_blocks": response.assembly.n_blocks,
        "n_contacts": len(path[-1].contacts) if path else None,
        "n_increments": len(path),
        "n_falling_frames": len(response.increments) - len(path),
        "n_programs": sum(i.programs for i in response.increments),
        "largest_residuals": {name: finite(getattr(worst, name, math.nan)) for name in MEASURES},
        "seconds": seconds,
        "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "versions": record.versions,
        "inputs": record.inputs(),
        "case": record.case,
    }


def csv_text(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Write a table as CSV."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(header)
    table.writerows(rows)
    return text.getvalue()


def finite(value: float) -> float | None:
    """Return a number for JSON, which has none for what is unbounded or not known."""
    return float(value) if math.isfinite(value) else None


def removals(response: solver.Response) -> list[dict[str, Any]]:
    """Blocks and ties that were taken away before each settlement, its number from 1, and the free blocks' weight."""
    names, weights = response.assembly.names, np.where(response.assembly.free, response.assembly.masses, 0.0)
    there, removed, ties = np.ones(len(names), dtype=bool), list[dict[str, Any]](), list(response.ties)
    made = (change for change in response.changes if change.phase <= _last_phase(response))
    for change in sorted(made, key=lambda change: change.phase):
        taken = np.flatnonzero(there & (False if change.removed is None else change.removed))
        there[taken] = False
        gone = [tie for tie in ties if tie.name in change.ties or set(tie.blocks) & set(taken.tolist())]
        ties = [tie for tie in ties if tie not in gone]
        if len(taken) or gone:
            removed.append(
                {
                    "phase": change.phase + 1,
                    "blocks": [names[k] for k in taken],
                    "ties": [tie.name for tie in gone],
                    "weight": float(weights[taken].sum()) * solver.GRAVITY,
                }
            )
    return removed


def _last_phase(response: solver.Response) -> int:
    """Find the number, from 0, of the last settlement that a path comes to."""
    return max([collapse_phase(response) or 0, *(i.phase for i in response.path[-1:])])


def change_words(response: solver.Response, phase: int) -> list[str]:
    """Say what changes before a settlement, its number from 0: blocks and ties that go, dead loads, new ties."""
    here = [one for one in removals(response) if one["phase"] == phase + 1]
    blocks, gone = ([name for one in here for name in one[what]] for what in ("blocks", "ties"))
    new = [tie.name for tie in response.ties if phase and tie.phase == phase + 1]
    many, weight = "s" * (len(blocks) > 1), force_text(sum(one["weight"] for one in here))
    words = [f"block{many} {_quoted(blocks)} taken away, {weight}"] * bool(blocks)
    words += [f"{_quoted(gone)} taken away"] * bool(gone)
    words += ["dead load changed"] * any(of.phase == phase and of.dead is not None for of in response.changes)
    return words + [f"{_quoted(new)} installed"] * bool(new)


def _quoted(names: Sequence[str]) -> str:
    return listed([f"'{name}'" for name in names], 4)


def changes_told(response: solver.Response) -> list[tuple[str, str]]:
    """Say before which settlement what changes, of those that the path comes to."""
    told = ((phase, ", ".join(change_words(response, phase))) for phase in range(_last_phase(response) + 1))
    return [(f"before settlement {phase + 1}", words) for phase, words in told if words]


def own_columns(parameter: mechanics.Quantity) -> tuple[str, ...]:
    """Name the column that response.csv has for a parameter; none for a settlement, which is in :data:`COLUMNS`."""
    name = parameter.name.replace(" ", "_")
    return () if name in COLUMNS else (name,)


def in_place(
    number: int, increment: solver.Increment, parameter: mechanics.Quantity, *rows: Sequence[Any]
) -> list[Sequence[Any]]:
    """Put number, phase and settlement of an increment before rows of a table, and behind them their own columns."""
    value = repr(float(increment.parameter))
    place = number, increment.phase, value if parameter.is_path else repr(0.0)
    return [(*place, *row, *(value for _ in own_columns(parameter))) for row in rows]


def row_of_increment(increment: solver.Increment, assembly: solver.Assembly) -> Sequence[Any]:
    """Make the row of response.csv for an increment, in the order of :data:`COLUMNS`, but for its place."""
    certificate = increment.certificate
    mechanism = mechanics.mechanism_of(assembly, increment)
    counts = np.bincount(increment.states, minlength=len(mechanics.ContactState))
    return (
        repr(float(increment.reaction)),
        repr(float(increment.reaction) / mechanics.total_weight(assembly)),
        repr(float(increment.load_multiplier)),
        repr(float(increment.least)),
        repr(float(increment.largest)),
        *(f"{getattr(certificate, name):.3e}" for name in MEASURES),
        *(int(counts[state]) for state in (0, 1, 2, 3)),
        len(mechanism.hinges),
        len(mechanism.sliding),
        increment.programs,
        f"{increment.seconds:.4f}",
    )


def rows_of_supports(increment: solver.Increment, assembly: solver.Assembly) -> list[Sequence[Any]]:
    """Make the rows of supports.csv for an increment: what acts on each support, about its centroid where it is."""
    return [
        (assembly.names[k], assembly.roles[k], *map(repr, increment.support_forces[k].tolist()))
        for k in np.flatnonzero(~assembly.free).tolist()
    ]
