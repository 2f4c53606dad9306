"""compare.html, curves.png, side_by_side.png and compare.mp4 of two runs in a folder."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path
from string import Template

from blockvis.report.page import html_rows
from blockvis.results.about import about
from blockvis.results.folder import RUN_FILES, VIDEO_SUFFIXES, refuse_files
from blockvis.system.atomic_files import make_folder, write_atomic
from blockvis.text import width_text

from .compared import Comparison, compared
from .pictures import draw_curves, draw_stations, film_in_step

#: What a comparison leaves in its folder, beside the film.
PAGE, CURVES, STATIONS = "compare.html", "curves.png", "side_by_side.png"


def compare(
    one: str | Path,
    other: str | Path,
    folder: str | Path,
    *,
    film: str | None = "compare.mp4",
    overwrite: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> list[str]:
    """Set two runs side by side: a page with their numbers, curves, cracks and pictures, and a film of both in step.

    Parameters
    ----------
    one, other : str or Path
        Results folders of two runs of the same kind of analysis.
    folder : str or Path
        Where it is written.
    film : str, optional
        Name of the film in the folder, in .mp4, .gif or .webp, or of a folder of its frames; none without a name.
        Limit loads have none.
    overwrite : bool
        Whether a comparison that is there already may be replaced.
    progress : callable, optional
        Called with the frames drawn and their number.

    Returns
    -------
    list of str
        Names of the files written.

    Raises
    ------
    ValueError
        If a folder holds no results, if the two cannot be compared, or if the folder holds something already.
    """
    folder = Path(folder)
    if film is not None and Path(film).suffix.lower() not in ("", *VIDEO_SUFFIXES):
        raise ValueError(
            f"'{film}' is no film that blockvis writes; end its name in {', '.join(VIDEO_SUFFIXES)}, "
            "or in / for a folder of pictures"
        )
    # A comparison is no run, whose results --force may replace.
    refuse_files(folder, RUN_FILES, "results", False, "choose another folder with -o")
    refuse_files(folder, (PAGE, CURVES, STATIONS, *([film] if film else [])), "a comparison", overwrite)
    found = compared(one, other)
    make_folder(folder)
    curves = draw_curves(found, folder / CURVES)
    stations = draw_stations(found, folder / STATIONS)
    written = [PAGE, CURVES, STATIONS]
    if film is not None and found.is_path:
        film_in_step(found, folder / film, progress=progress)
        written.append(film)
    played = film if film in written and Path(film).suffix else None
    page = comparison_html(found, curves.read_bytes(), stations.read_bytes(), played)
    write_atomic(folder / PAGE, page)
    return written


def comparison_html(found: Comparison, curves: bytes, stations: bytes, film: str | None) -> str:
    """Make the page as HTML text, with pictures in PNG; it asks for nothing but the film that lies beside it."""
    report = files("blockvis") / "report"
    heads = ("", *(side.label for side in found.sides))
    cracks = [
        (place, *("–" if math.isnan(opening) else width_text(opening) for opening in openings.tolist()))
        for place, openings in found.cracks(found.common_end)
    ]
    where = found.place_text(found.common_end) if found.is_path else "the limit load"
    keys, unknown = found.changed_keys(), " and ".join(side.label for side in found.sides if not side.case)
    table = '<div class="wide"><table id="{}">{}</table></div>'
    differ = "<h2>What the cases differ in</h2>" + table.format("keys", _rows(heads, keys)) if keys else ""
    if unknown:
        differ = f"<p>No case in {html.escape(unknown)}, written from Python: what differs from it is not known.</p>"
    return Template((files("blockvis") / "comparison" / PAGE).read_text(encoding="utf-8")).substitute(
        title=html.escape(" and ".join(side.label for side in found.sides)),
        about=" · ".join(html.escape(f"{s.label}: {about(s.response).finished}") for s in found.sides),
        style=(report / "player.css").read_text(encoding="utf-8"),
        curves=base64.b64encode(curves).decode(),
        stations=base64.b64encode(stations).decode(),
        differ=differ,
        numbers=_rows(heads, found.rows()),
        cracks=f"<h2>Cracks at {html.escape(where)}</h2>" + table.format("cracks", _rows(heads, cracks))
        if cracks
        else "",
        side_by_side="At the same places of the path" if found.is_path else "At the limit load",
        film=f"<h2>Film</h2>{_film(html.escape(film))}" if film else "",
    )


def _film(name: str) -> str:
    """Write what plays a film: browsers take .gif and .webp for pictures."""
    moving_picture = Path(name).suffix.lower() in (".gif", ".webp")
    return f'<img src="{name}" alt="film">' if moving_picture else f'<video controls src="{name}"></video>'


def _rows(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return f"<tr>{''.join(f'<th>{html.escape(head)}</th>' for head in heads)}</tr>{html_rows(rows)}"
