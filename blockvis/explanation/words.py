"""An explanation in words: for the command line, the page, and explain.json."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from blockvis.text import place_text
from solver.mechanics import counted

from .observations import LEAST_WIDTH

if TYPE_CHECKING:
    from .ranking import Cause, Measurement
    from .result import Explanation

#: An amount is left open where the end of its range is so many times the beginning.
OPEN = 4.0

#: Causes that the command line lists.
LISTED = 6

#: Causes beside the first that one sentence names.
NAMED = 3


def amount_text(value: float, unit: str) -> str:
    """Write an amount: a length in mm, an angle in mrad.

    Examples
    --------
    >>> amount_text(0.0123, "m"), amount_text(0.0021, "rad")
    ('12.3 mm', '2.1 mrad')
    """
    return f"{1e3 * value:.3g} {'mm' if unit == 'm' else 'mrad'}"


def width_text(width: float) -> str:
    """Write a width [m] in mm; what nobody can measure is 0.

    Examples
    --------
    >>> width_text(0.00412), width_text(0.0123), width_text(1e-12)
    ('4.1', '12.3', '0')
    """
    return "0" if width < LEAST_WIDTH else f"{1e3 * width:.1f}"


def range_text(cause: Cause) -> str:
    """Write the range of the amount of a cause."""
    low, middle, high = cause.amount
    ends = f"{1e3 * low:.3g} to {1e3 * high:.3g}"
    return f"{amount_text(middle, cause.unit)} ({ends})"


def cause_with_range(cause: Cause) -> str:
    """Name a cause with its amount, or say that the observations leave this open."""
    low, middle, high = cause.amount
    words = f"{cause_text(cause)}{',' if cause.detail else ''} by"
    if high > OPEN * low:
        range_of = f"{1e3 * low:.3g} to {amount_text(high, cause.unit)}"
        return f"{words} {range_of} (the observations leave the amount open)"
    return f"{words} {amount_text(middle, cause.unit)}"


def percent(probability: float) -> str:
    """Write a probability; none is certain.

    Examples
    --------
    >>> percent(0.123), percent(0.997), percent(0.99999), percent(0.00001)
    ('12 %', '99.7 %', '> 99.9 %', '< 0.1 %')
    """
    if probability > 0.999:
        return "> 99.9 %"
    return "< 0.1 %" if probability < 0.001 else f"{100.0 * probability:.{2 if probability < 0.99 else 3}g} %"


def cause_text(cause: Cause) -> str:
    """Name a cause, with what its best candidate adds."""
    return f"{cause.name}{f', {cause.detail}' if cause.detail else ''}"


def measurement_text(found: Explanation) -> str:
    """Say which joint to measure next, and what each cause has there, or why there is none."""
    measurement = found.next_measurement
    if measurement is None and len(found.alike) < 2:
        return "nothing; no two causes are left to tell apart"
    if measurement is None:
        return "no joint is left that tells the first causes apart; measure how the supports themselves have moved"
    there = "; ".join(f"{width_text(width)} mm if {name}" for name, width in measurement.widths)
    return f"the joint {measurement.name} at {place_text(measurement.place, 3)} m: {there}"


def verdict(found: Explanation) -> str:
    """Say what the observations point at, in one sentence, which begins with names of supports as they are."""
    if not found.causes and not found.stands:
        return "No candidate stands at any amount: the structure does not stand as drawn"
    n_made = int((found.observations.widths > 0.0).sum()) - len(found.made_by_none)
    if not found.causes or (found.made_by_none and not n_made and not len(found.observations.points)):
        return "No candidate makes any of the observed cracks"
    best, others = found.causes[0], found.alike[1:]
    if others:
        named = [cause_text(cause) for cause in others[:NAMED]]
        rest = len(others) - len(named)
        more = " or ".join([*named, *([counted(rest, "other")] if rest else [])])
        return f"{cause_with_range(best)}, or else {more}: the observations cannot tell these apart"
    return cause_with_range(best)


def in_words(found: Explanation) -> str:
    """Sum up an explanation for the command line."""
    n_open, n = int((found.observations.widths > 0.0).sum()), len(found.observations.widths)
    about = [f"{n_open} open and {counted(n - n_open, 'closed joint')}"] if n else []
    points = len(found.observations.points)
    about += [counted(points, "displaced point")] if points else []
    lines = [
        f"{' and '.join(about)}, {counted(len(found.causes), 'cause')}, {counted(len(found.runs), 'run')}",
        verdict(found),
    ]
    for number, cause in enumerate(found.causes[:LISTED], start=1):
        lines.append(f"{number}  {percent(cause.probability):>8}  {range_text(cause):<26}  {cause_text(cause)}")
        if cause.also:
            lines.append(f"{'':41}or, with the same cracks: {', '.join(cause.also)}")
    if len(found.causes) > LISTED:
        lines.append(f"and {counted(len(found.causes) - LISTED, 'less probable cause')}")
    lines += [*fall_texts(found), *unexplained_texts(found)]
    if len(found.causes) > 1:
        lines.append(f"measure next: {measurement_text(found)}")
    return "\n".join(lines)


def fall_texts(found: Explanation) -> list[str]:
    """Say where the first cause brings the model down: larger amounts are not weighed, and the structure may differ."""
    return [
        f"the first cause brings the model down at {amount_text(cause.falls_at, cause.unit)}; larger amounts have no "
        "probability, though the structure may stand farther"
        for cause in found.causes[:1]
        if math.isfinite(cause.falls_at)
    ]


@dataclass(frozen=True)
class Reading:
    """A width or displacement that was observed, beside what the first two causes make there, in mm."""

    place: str
    about: Mapping[str, Any]  #: Where it is, as explain.json has it.
    key: str  #: Of explain.json: "width_mm" or "displacement_mm".
    observed: Any  #: A number, of a displacement a list of them.
    computed: list[Any]
    uncertainty: float
    unexplained: bool  #: Whether the first cause does not make it,
    by_none: bool  #: and no candidate does.


def readings(found: Explanation) -> tuple[list[Reading], list[Reading]]:
    """List the widths and the displacements that were observed."""
    given, causes = found.observations, found.causes[:2]
    widths = [
        Reading(
            label,
            {"place": label} | dict(zip("xyz", given.places[k].tolist(), strict=False)),
            "width_mm",
            _mm(given.widths[k]),
            [_mm(cause.best.widths[cause.at][k]) for cause in causes],
            _mm(given.uncertainties[k]),
            k in found.unexplained,
            k in found.made_by_none,
        )
        for k, label in enumerate(given.labels)
    ]
    points = [
        Reading(
            f"{block} at {place_text(given.points[k], 3)} m",
            {"block": block} | dict(zip("xyz", given.points[k].tolist(), strict=False)),
            "displacement_mm",
            _mm(given.displacements[k]),
            [_mm(cause.best.displacements[cause.at][k]) for cause in causes],
            _mm(given.point_uncertainties[k]),
            k in found.unexplained_points,
            k in found.points_made_by_none,
        )
        for k, block in enumerate(given.blocks)
    ]
    return widths, points


def unexplained_texts(found: Explanation) -> list[str]:
    """Say which observations the best cause, or every candidate, leaves unexplained."""
    lines = []
    for one in (one for several in readings(found) for one in several if one.unexplained):
        told, why = f"{mm_text(one.observed)} mm at {one.place}", "the first cause does not make it"
        if isinstance(one.observed, list):
            told = f"{mm_text(one.observed)} mm of {one.place}"
        elif not one.observed:
            told, why = f"closed at {one.place}", "the first cause opens it"
        lines.append(f"unexplained: {told}; {'no candidate makes it' if one.by_none else why}")
    return lines


def mm_text(value: float | list[float]) -> str:
    """Write a width, or a displacement, in mm."""
    return place_text(value, 3) if isinstance(value, list) else width_text(1e-3 * value)


def values_of(found: Explanation) -> dict[str, Any]:
    """Make what explain.json holds: lengths in m, angles in rad, widths in mm where the key says so."""
    settings, (widths, points) = found.case.explain, readings(found)
    return {
        "verdict": verdict(found),
        "causes": [_cause_values(cause) for cause in found.causes],
        "cannot_tell_apart": [cause.name for cause in found.alike] if len(found.alike) > 1 else [],
        "unexplained": [
            {"place": one.place, one.key: one.observed, "made_by_no_candidate": one.by_none}
            for one in (*widths, *points)
            if one.unexplained
        ],
        "next_measurement": _measurement_values(found.next_measurement),
        "observations": {
            "source": found.observations.source,
            "widths": [
                {
                    **one.about,
                    one.key: one.observed,
                    "uncertainty_mm": one.uncertainty,
                    "computed_mm": one.computed,
                }
                for one in widths
            ],
            "points": [{**one.about, one.key: one.observed, "computed_mm": one.computed} for one in points],
        },
        "assumed": {
            "prior": "causes alike, amounts evenly up to the largest looked at, frictions and places of troughs alike, "
            "stones heavier towards the left or right alike",
            "model_uncertainty": settings.model_uncertainty,
            "place_uncertainty": found.comparison.trust.place,
            "outliers": settings.outliers,
            "frictions": sorted({trial.variant.friction for cause in found.causes for trial in cause.trials}),
        },
        "runs": len(found.runs),
        "notes": list(found.notes),
        "case": found.case.text,
    }


def _cause_values(cause: Cause) -> dict[str, Any]:
    low, middle, high = cause.amount
    candidate = cause.best.candidate
    values: dict[str, Any] = {
        "cause": cause.name,
        "detail": cause.detail,
        "same_cracks": list(cause.also),
        "probability": cause.probability,
        "unit": cause.unit,
        "amount": middle,
        "amount_low": low,
        "amount_high": high,
        "best_amount": float(cause.best.amounts[cause.at]),
        "falls_at": cause.falls_at if math.isfinite(cause.falls_at) else None,
        "friction": list(cause.friction),
        "log_likelihood": float(cause.best.log_likelihood[cause.at]),
        "motions": {name: list(motion) for name, motion in candidate.motions.items()},
    }
    if candidate.is_trough:
        values |= {"centre": candidate.centre, "inflection": candidate.inflection}
    return values


def _measurement_values(measurement: Measurement | None) -> dict[str, Any] | None:
    if measurement is None:
        return None
    return {
        "joint": measurement.name,
        **dict(zip("xyz", measurement.place, strict=False)),
        "expected_mm": {name: _mm(width) for name, width in measurement.widths},
        "deviations": round(measurement.deviations, 3),
    }


def _mm(length: Any) -> Any:
    """Write a length, or a list of them, in mm, with four decimals where it is finite."""
    return (np.round(1e3 * np.asarray(length, dtype=float), 4) + 0.0).tolist()
