"""Summary of a study in numbers and in words."""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

import solver
from blockvis.results.about import LOCAL
from blockvis.text import rounded_text
from solver.mechanics import counted

from .fragility import fragility_of
from .sensitivity import capacity, first_order, independent_rows, outcome, swings, unit_of, without_collapse
from .study_file import Study
from .study_folder import NO_RESULT, NOT_BUILT

if TYPE_CHECKING:
    import pandas as pd

#: Most mechanisms that the summary lists, and that have their own colour in the scatter.
MOST_MECHANISMS = 6

#: Most values of a single parameter whose outcome is written.
MOST_VALUES = 12

#: Most reasons of failure that the summary lists.
MOST_REASONS = 5


def classes_of(table: pd.DataFrame) -> dict[str, int]:
    """Count the runs of each class of mechanisms, the most frequent first."""
    counts = table.loc[table["mechanism_class"] != "", "mechanism_class"].value_counts()
    return {str(k): int(v) for k, v in sorted(counts.items(), key=lambda item: (-item[1], str(item[0])))}


def is_sample(study: Study) -> bool:
    """Whether chance has a part in the runs of a study: the values of a grid are chosen by hand."""
    return any(p.distribution is not None for p in study.parameters) or study.method != "grid" or study.n_seeded > 0


def is_single(study: Study) -> bool:
    """Whether one parameter over chosen values is all that a study varies: its outcome is a line, without shares."""
    return len(study.parameters) == 1 and not is_sample(study)


def curve_name(study: Study) -> str:
    """Name the fragility curve of a study, which is no probability if the values were chosen by hand."""
    drawn = any(p.distribution is not None for p in study.parameters) or study.method != "grid"
    return "probability of collapse" if drawn else "share of the runs collapsed"


def summary_of(study: Study, table: pd.DataFrame) -> dict[str, Any]:
    """Summarise a study by its table, for its summary.json; lengths in m, angles in rad."""
    curve = fragility_of(independent_rows(study, table))
    without_result = table[table["status"].isin(NO_RESULT)]
    broken_off = outcome(without_result[without_result["status"] != NOT_BUILT])
    reached = {str(p): curve.quantile(p) for p in (0.05, 0.5, 0.95)}
    at_the_end = [float(of[-1]) if len(of) else 0.0 for of in (curve.probability, curve.at_most)]
    return {
        "n_runs": study.n_runs,
        "n_finished": len(table),
        **ends_counted(table),
        "n_stood": curve.n_stood,
        "n_without_collapse": int(without_collapse(table).sum()),
        "n_without_result": len(without_result),
        "n_not_built": len(without_result) - len(broken_off),
        "broken_off_at": [float(broken_off.min()), float(broken_off.max())] if len(broken_off) else [],
        "reasons": _reasons(without_result["message"].tolist()),
        "status": {str(k): int(v) for k, v in table["status"].value_counts().items()},
        "curve": curve_name(study),
        "parameter": study.parameters[0].name if len(study.parameters) == 1 else "",
        "capacity": study.capacity.name,
        "unit": unit_of(study, table),
        "quantiles": {p: first if first == last else None for p, (first, last) in reached.items()},
        "quantile_bounds": {p: list(ends) for p, ends in reached.items()},
        "probability_at_the_end": at_the_end[0],
        "probability_at_the_end_at_most": at_the_end[1],
        _furthest(study.capacity.name): curve.furthest,
        "first_order_indices": {} if is_single(study) else {k: list(v) for k, v in first_order(study, table).items()},
        "swings": [
            {
                "parameter": s.name,
                "at": [s.low_value, s.high_value],
                "mean": [s.low, s.high],
                "at_least": list(s.at_least),
            }
            for s in swings(study, table)
        ],
        "mechanism_classes": classes_of(table),
        "line": _line(study.parameters[0].name, table) if is_single(study) else [],
        "run_seconds": float(np.nansum(table["seconds"].to_numpy(dtype=float))),
    }


def _furthest(capacity: str) -> str:
    """Name the key of how far runs were followed, by what they collapse at."""
    return f"furthest_{capacity.replace(' ', '_')}"


def ends_counted(table: pd.DataFrame) -> dict[str, int]:
    """Count the runs that collapsed, those of them of a few blocks only, and those that never stood."""
    collapsed = table["status"] == str(solver.Status.COLLAPSED)
    return {
        "n_collapsed": int(collapsed.sum()),
        "n_local": int((collapsed & (table["falling_share"] < LOCAL)).sum()),
        "n_never_stood": int((table["status"] == str(solver.Status.NO_INITIAL_EQUILIBRIUM)).sum()),
    }


def _line(name: str, table: pd.DataFrame) -> list[list[Any]]:
    """List each value of the only parameter, where it collapsed, else None, and how the run ended."""
    rows = zip(table[name].tolist(), capacity(table).tolist(), table["status"].tolist(), strict=True)
    return [[value, at if status == solver.Status.COLLAPSED else None, status] for value, at, status in rows]


def _reasons(messages: list[str]) -> dict[str, int]:
    """Count the reasons of failure by their first message; messages that differ in numbers only are one reason."""
    kinds = [re.sub(r"\d[\d.e+-]*", "#", message) for message in messages]
    first = dict(zip(reversed(kinds), reversed(messages), strict=True))
    return {first[kind]: number for kind, number in Counter(kinds).most_common(MOST_REASONS)}


def in_words(summary: dict[str, Any]) -> str:
    """Write the summary as text."""
    lines = [
        f"{summary['n_finished']} of {summary['n_runs']} runs: "
        + ", ".join(f"{n} {status}" for status, n in summary["status"].items())
    ]
    for reason, n in summary["reasons"].items():
        lines.append(f"without result, {counted(n, 'time')}{', the first' * (n > 1)}: {reason}")
    lines += _left_out_lines(summary)
    if summary["n_local"]:
        number = summary["n_local"]
        words = "is a local loss" if number == 1 else "are local losses"
        lines.append(f"{number} of the collapses {words}: a few blocks fall, the structure stands")
    lines += _line_lines(summary) if summary["line"] else [*_curve_lines(summary), *_parameter_lines(summary)]
    return "\n".join([*lines, *_mechanism_lines(summary["mechanism_classes"])])


def _left_out_lines(summary: dict[str, Any]) -> list[str]:
    lines, number = [], summary["n_not_built"]
    if number:
        lines.append(f"not built, and left out of what follows: {counted(number, 'run')}")
    if summary["broken_off_at"]:
        least, most = summary["broken_off_at"]
        far = f"{least:.4g} to " * (f"{least:.4g}" != f"{most:.4g}") + _with_unit(most, summary)
        number = summary["n_without_result"] - number
        runs = f"{counted(number, 'run')} without result {'was' if number == 1 else 'were'}"
        lines.append(f"{runs} left at {far}, and may collapse there or never")
    return lines


def _line_lines(summary: dict[str, Any]) -> list[str]:
    ends = [
        f"{_value(value)}: "
        + (
            _with_unit(at, summary)
            if at is not None
            else f"{'not known' if status in NO_RESULT else 'none'} ({status})"
        )
        for value, at, status in summary["line"][:MOST_VALUES]
    ]
    if len(summary["line"]) > MOST_VALUES:
        ends.append(f"{len(summary['line']) - MOST_VALUES} more in table.csv")
    return [f"collapse by {summary['parameter']}, {'; '.join(ends)}"]


def _curve_lines(summary: dict[str, Any]) -> list[str]:
    if summary["n_collapsed"] or summary["n_never_stood"] or summary["broken_off_at"]:
        quantiles = [
            f"{100 * float(p):g} % {_reached(ends, summary)}" for p, ends in summary["quantile_bounds"].items()
        ]
        return [f"{summary['curve']}: {', '.join(quantiles)}"]
    if not summary["n_stood"]:
        return []
    if not summary["unit"]:
        return ["no load multiplier brings any run down: let a live load push what can move"]
    far = _with_unit(summary[_furthest(summary["capacity"])], summary)
    # [settlement] and [control] are called as what they drive begins.
    driver = summary["capacity"].split()[0]
    return [
        f"no run collapsed as far as it was followed, at most {far}; what each parameter does to a collapse is not "
        f"known: let {driver}.limit be larger; last reactions and largest openings are in table.csv"
    ]


def _reached(ends: list[float | None], summary: dict[str, Any]) -> str:
    """Write where a probability is reached at the first and at the last."""
    first, last = ends
    if first is None:
        return "not reached"
    if last is None:
        return f"not before {_with_unit(first, summary)}"
    at = _with_unit(last, summary)
    return f"at {at}" if first == last else f"between {first:.4g} and {at}"


def _with_unit(value: float, summary: dict[str, Any]) -> str:
    return f"{value:.4g} {summary['unit']}".rstrip()


def _parameter_lines(summary: dict[str, Any]) -> list[str]:
    lines = []
    shares = {
        name: f"{100 * share:.0f}{f' ± {100 * error:.0f}' if error else ''} % of the variance"
        for name, (share, error) in summary["first_order_indices"].items()
    }
    for swing in summary["swings"]:
        (low_at, high_at), (low, high), name = swing["at"], swing["mean"], swing["parameter"]
        share = f", {shares.pop(name)}" if name in shares else ""
        least = ["at least " * bool(bound) for bound in swing["at_least"]]
        lines.append(
            f"{name}: {least[0]}{_with_unit(low, summary)} on average at {_value(low_at)}, "
            f"{least[1]}{_with_unit(high, summary)} at {_value(high_at)}{share}"
        )
    lines += [f"{name}: {share}" for name, share in shares.items()]
    if lines and summary["n_without_collapse"]:
        lines.append(f"no shares of the variance: {counted(summary['n_without_collapse'], 'run')} without collapse")
    return lines


def _mechanism_lines(classes: dict[str, int]) -> list[str]:
    lines = [
        f"mechanism {number}, {counted(count, 'time')}: {name}"
        for number, (name, count) in enumerate(list(classes.items())[:MOST_MECHANISMS], 1)
    ]
    more = len(classes) - MOST_MECHANISMS
    return [*lines, f"and {counted(more, 'more mechanism')}"] if more > 0 else lines


def _value(value: float | str) -> str:
    return value if isinstance(value, str) else rounded_text(value)
