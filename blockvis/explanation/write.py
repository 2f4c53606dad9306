"""explain.html, explain.json and explain.png in a folder."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING

from blockvis.results.record import versions, write_json
from blockvis.system.atomic_files import make_folder, write_atomic
from solver.mechanics import counted

from .forward import LEANING
from .likelihood import ELSEWHERE, INDEPENDENT
from .picture import draw_explanation
from .words import (
    amount_text,
    cause_text,
    fall_texts,
    measurement_text,
    mm_text,
    percent,
    range_text,
    readings,
    unexplained_texts,
    values_of,
    verdict,
)

if TYPE_CHECKING:
    from .result import Explanation

#: What an explanation leaves in its folder.
FILES = ("explain.html", "explain.json", "explain.png")

#: Causes and observations that the page lists.
MOST_CAUSES, MOST_OBSERVATIONS = 12, 200


def write_explanation(found: Explanation, folder: Path) -> None:
    """Write the page, its numbers and its picture."""
    make_folder(folder)
    write_json(folder / "explain.json", values_of(found))
    picture = draw_explanation(found, folder / "explain.png")
    write_atomic(folder / "explain.html", explanation_html(found, picture.read_bytes()))


def explanation_html(found: Explanation, picture: bytes) -> str:
    """Make the page as HTML text, with its picture as a PNG; it needs no network and makes no request."""
    room = files("blockvis")
    name = found.case.source.stem
    problems = [*unexplained_texts(found), *found.notes]
    return Template((room / "explanation" / "explain.html").read_text(encoding="utf-8")).substitute(
        title=html.escape(f"{name} · likely causes of its cracks"),
        about=html.escape(f"{found.case.source} · {found.observations.source} · blockvis {versions()['blockvis']}"),
        style=(room / "report" / "player.css").read_text(encoding="utf-8"),
        verdict=html.escape(verdict(found)),
        picture=base64.b64encode(picture).decode("ascii"),
        words=html.escape(_picture_text(found)),
        causes=_causes(found),
        alike=" ".join([_alike(found), *(f"{html.escape(text.capitalize())}." for text in fall_texts(found))]),
        problems="".join(f"<li>{html.escape(text)}</li>" for text in problems)
        or "<li>The first cause makes all open joints and points, within what observations and model leave open.</li>",
        measurement=html.escape(measurement_text(found)),
        observations=_observations(found),
        assumed="".join(f"<li>{html.escape(text)}</li>" for text in _assumed(found)),
        case=html.escape(found.case.text or "no case file: explained from Python"),
    )


def _picture_text(found: Explanation) -> str:
    """Say in words what the picture shows, for those who do not see it."""
    causes = "; ".join(cause_text(cause) for cause in found.causes[:2])
    return f"Observed cracks beside those computed for: {causes}" if causes else "Observed cracks"


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f'<th scope="col">{html.escape(cell)}</th>' for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _causes(found: Explanation) -> str:
    rows = []
    for number, cause in enumerate(found.causes[:MOST_CAUSES], start=1):
        also = f" (the same cracks: {', '.join(cause.also)})" if cause.also else ""
        low, high = cause.friction
        friction = f"{low:.2g}" if low == high else f"{low:.2g} to {high:.2g}"
        rows.append((str(number), cause_text(cause) + also, percent(cause.probability), range_text(cause), friction))
    return _table(("", "cause", "probability", "amount, median (5 % to 95 %)", "friction"), rows)


def _alike(found: Explanation) -> str:
    if len(found.alike) < 2:
        return "The first cause is more than ten times as probable as any other that was looked at."
    names = ", ".join(cause_text(cause) for cause in found.alike)
    return html.escape(f"The observations cannot tell these apart (less than a factor of ten between them): {names}.")


def _observations(found: Explanation) -> str:
    """Write tables of what was observed beside what the first causes make, the widest first, and what is strange."""
    widths, points = readings(found)
    tables = []
    for title, place, some in (
        ("Widths", "joint or place", sorted(widths, key=lambda one: -one.observed)),
        ("Displaced points", "point", points),
    ):
        rows = [
            (
                one.place,
                mm_text(one.observed) if one.observed else "closed",
                f"{one.uncertainty:.2g}",
                *map(mm_text, one.computed),
                "no candidate" if one.by_none else "unexplained" if one.unexplained else "",
            )
            for one in some[:MOST_OBSERVATIONS]
        ]
        computed = (f"cause {n}, mm" for n in range(1, len(found.causes[:2]) + 1))
        if rows:
            tables.append(f"<h2>{title}</h2>" + _table((place, "observed, mm", "± mm", *computed, ""), rows))
    return "".join(tables)


def _assumed(found: Explanation) -> list[str]:
    trust, runs = found.comparison.trust, found.runs
    frictions = sorted({trial.variant.friction for cause in found.causes for trial in cause.trials})
    largest = float(found.causes[0].best.amounts[-1]) if found.causes else 0.0
    return [
        "Blocks are rigid, joints dry: cracks in stones, mortar that hardened later and loads that changed are not in "
        "the model.",
        "Before anything was observed the causes are taken as equally probable (movements between two directions half "
        "as much), their amounts as evenly spread"
        + (f" up to {amount_text(largest, found.causes[0].unit)} (first cause)" if found.causes else "")
        + ", frictions and places of troughs as equally probable. The amount of a trough or slope is how much more the "
        "ground goes down at one foot of the structure than at another.",
        "A structure that is alike on both sides has taken one of several paths: every movement of a support is "
        f"followed with stones heavier by up to {100.0 * LEANING:g} % towards the left, and towards the right.",
        f"Computed widths are trusted to {100.0 * trust.model:.3g} % of what was observed there, and of "
        f"{100.0 * ELSEWHERE:.2g} % of the root mean square of all, besides the uncertainty of each observation; a "
        f"crack at x, y may be in another joint within {1e3 * trust.place:.3g} mm and, less probably, beyond; an "
        f"observation has another cause with a probability of {100.0 * trust.outliers:.3g} %.",
        f"Observations share the errors of the model: more than {INDEPENDENT} do not count as independent.",
        f"Coefficients of friction: {', '.join(f'{value:.3g}' for value in frictions) or 'none'}; "
        f"{counted(len(runs), 'run')}.",
        "Probabilities are among the causes that were looked at: a cause that is not in the list has none.",
    ]
