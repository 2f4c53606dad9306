"""Report on paper: an A4 document with the pictures, the curve, and the tables of the numbers and the cracks."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib
import numpy as np
from fpdf import FPDF, FontFace
from fpdf.enums import TableBordersLayout
from PIL import Image

import solver
from blockvis.dynamics.fall import Fall
from blockvis.pictures import palette
from blockvis.pictures.captions import failure_text, in_one_unit, losses_along, parameter_text
from blockvis.pictures.crack_drawing import draw_cracks
from blockvis.pictures.curves import draw_curve
from blockvis.pictures.marks import evenly
from blockvis.pictures.render import draw_mechanism, draw_still, to_show
from blockvis.pictures.underlay import Underlay
from blockvis.results.about import about, phases_of
from blockvis.results.cracks import Crack, last_cracks
from blockvis.results.reaction_range import ReactionRange
from blockvis.system.atomic_files import write_atomic
from blockvis.text import force_text, width_text
from solver.mechanics import counted

from .page import certificate_rows, headline_of, range_rows, summary_rows, tie_rows

#: Width of the text, margin and height of a line [mm]; size of the text [points].
WIDTH, MARGIN, LINE, TEXT = 174.0, 18.0, 5.2, 9.5

#: Largest height of a picture, in which its smallest letters have 7 points [mm].
HIGHEST = 175.0

#: Cracks and states that the tables list.
MOST_CRACKS, MOST_STATES = 20, 16

#: Longest case that is printed [lines].
MOST_LINES = 120


def write_pdf(
    response: solver.Response,
    path: str | os.PathLike[str],
    case_text: str = "",
    *,
    fall: Fall | None = None,
    error: str = "",
    band: ReactionRange | None = None,
    underlay: Underlay | None = None,
    view: Any = None,
    section: Any = None,
) -> Path:
    """Write the report as a document of A4 pages.

    Underlay, view and section are as of :func:`blockvis.draw_still`, all else as of :func:`blockvis.write_report`.
    Raises ``ValueError`` if there is no increment to show.
    """
    response = to_show(response)
    eye = {"view": view, "section": section}
    origin = about(response)
    paper = _Paper(f"{origin.name} · {origin.version}".strip(" ·"))
    # A number and its unit stay on one line.
    title = re.sub(r"(?<=\d) (?=\S)", "\N{NO-BREAK SPACE}", headline_of(response))
    paper.heading(" · ".join(filter(None, (origin.name, title))), 15.0)
    paper.words(" · ".join(filter(None, (origin.file, origin.finished, origin.version))), 8.0, palette.FAINT)
    if response.stop is solver.Status.SOLVER_FAILED:
        paper.words(failure_text(response), TEXT, palette.WARNING, bold=True)
    with TemporaryDirectory() as folder:
        paper.picture(draw_mechanism(response, Path(folder) / "mechanism.png", underlay=underlay, **eye))
        rows = [*summary_rows(response, fall), *([error.partition(": ")[::2]] if error else []), *range_rows(band)]
        paper.tabulate("Numbers", ("", ""), rows, (62.0, 112.0))
        if response.path:
            last = response.path[-1]
            state = "Last equilibrium" if response.parameter.is_path else "Last state"
            paper.picture(draw_still(response, last, Path(folder) / "last.png", underlay=underlay, **eye), state)
            paper.picture(draw_curve(response, Path(folder) / "curve.png", band=band), "Curve", 150.0)
            paper.tabulate(*_states(response))
            cracks = last_cracks(response)
            if cracks:
                paper.picture(draw_cracks(response, -1, Path(folder) / "cracks.png", **eye), "Cracks")
                paper.tabulate("Cracks at the last equilibrium", *_crack_table(cracks))
    ties = tie_rows(response)
    if ties:
        paper.tabulate("Ties and props", ("", "largest force", "what became of it"), ties, (44.0, 58.0, 72.0))
    certificate = certificate_rows(response)
    if certificate:
        paper.tabulate("Certificate", ("", ""), certificate, (112.0, 62.0))
    for note in dict.fromkeys(response.notes):
        paper.ln(1.0)
        paper.words(f"Note: {note}", TEXT, palette.INK, after=0.0)
    if case_text:
        paper.listing("Case: keys in use; its whole text is in summary.json", _keys_in_use(case_text))
    return write_atomic(path, paper.output())


def _keys_in_use(case_text: str) -> str:
    """Leave out lines of comments, which list every key that is not given, and the gaps that they leave."""
    lines = [line for line in case_text.splitlines() if not line.lstrip().startswith("#")]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)).strip()


def _states(response: solver.Response) -> tuple[str, Sequence[str], list[tuple[str, ...]], Sequence[float]]:
    """Give title, head, rows and widths [mm] of the table of the path, evenly thinned but for what matters."""
    path, weight = response.path, response.total_weight
    # Of states that stand by themselves the lowest decides; a loss ends what the row before it carries.
    extreme, sign = ("largest", 1.0) if response.parameter.is_path else ("lowest", -1.0)
    phases = {phase: in_one_unit(response, phase) for phase in {increment.phase for increment in path}}
    units = np.array([phases[increment.phase].measured.unit for increment in path])
    sizes = np.nan_to_num(sign * response.values, nan=-np.inf)
    kept = [
        # Forces and moments are not compared.
        *(int(np.where(units == unit, sizes, -np.inf).argmax()) for unit in np.unique(units)),
        *(row - 1 for row, _, _ in losses_along(response)),
    ]
    chosen = sorted({*evenly(np.arange(len(path)), MOST_STATES).tolist(), *kept})
    title = "States"
    if len(chosen) < len(path):
        loss = ", the last before blocks are lost" * bool(response.losses)
        each = " of each unit" * (len(np.unique(units)) > 1)
        title += f": {len(chosen)} of {len(path)}, evenly chosen, with the {extreme}{each}{loss} and the last"
    head = [response.parameter.name, response.measured.name, "of the weight W"]
    rows: list[tuple[str, ...]] = []
    for k in chosen:
        increment, here = path[k], phases[path[k].phase]
        measured, moment = here.measured, here.measured.unit == "N·m"
        value = force_text(increment.measured, moment) if measured.is_force else f"{increment.measured:.5g}"
        share = f"{increment.measured / weight:.4f}" if measured.is_force and not moment else ""
        place = parameter_text(increment.parameter, here)
        several = len(phases_of(response)) > 1
        rows.append((f"{place}, phase {increment.phase + 1}" if several else place, value, share))
    # Moments and multipliers are no parts of the weight.
    columns = 3 if any(share for _, _, share in rows) else 2
    return title, head[:columns], [row[:columns] for row in rows], (WIDTH / columns,) * columns


def _crack_table(cracks: Sequence[Crack]) -> tuple[Sequence[str], list[tuple[str, ...]], Sequence[float]]:
    """Give head, rows and widths [mm] of the table of cracks, the widest first."""
    plane = len(cracks[0].at) == 2
    head = ("", "widest", "between", "length" if plane else "area", "inclined", "from [m]", "to [m]")
    rows = []
    for number, crack in enumerate(cracks[:MOST_CRACKS], start=1):
        ends = [", ".join(f"{x:.2f}" for x in np.round(end, 2) + 0.0) for end in crack.ends]
        if set(crack.places) - {"", "inside"}:
            ends = [f"{place}, at {end}" for place, end in zip(crack.places, ends, strict=True)]
        size = f"{crack.size:.3g} {'m' if plane else 'm²'}"
        rows.append((str(number), width_text(crack.width), crack.widest, size, f"{crack.inclination:.0f}°", *ends))
    if len(cracks) > MOST_CRACKS:
        rows.append(("", "", f"and {counted(len(cracks) - MOST_CRACKS, 'narrower one')}", "", "", "", ""))
    return head, rows, (7.0, 17.0, 40.0, 16.0, 16.0, 39.0, 39.0)


class _Paper(FPDF):
    """A4 pages with the words of a document at their foot."""

    def __init__(self, foot: str) -> None:
        super().__init__(format="A4")
        self._foot = foot
        # matplotlib ships the DejaVu fonts, so pages look the same on every machine.
        fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        self.add_font("text", "", fonts / "DejaVuSans.ttf")
        self.add_font("text", "B", fonts / "DejaVuSans-Bold.ttf")
        self.add_font("code", "", fonts / "DejaVuSansMono.ttf")
        self.set_margins(MARGIN, MARGIN, MARGIN)
        self.set_auto_page_break(True, MARGIN)
        self.add_page()

    def footer(self) -> None:
        """Write the number of the page and what the document is of."""
        self.set_font("text", "", 7.5)
        self.set_text_color(*palette.FAINT)
        for text, align in ((self._foot, "L"), (f"{self.page_no()} of {{nb}}", "R")):
            self.set_y(-12.0)
            self.cell(WIDTH, LINE, text, align=align)

    def words(
        self, text: str, size: float, colour: tuple[int, int, int], *, bold: bool = False, after: float = 2.0
    ) -> None:
        """Write a paragraph in letters of a size [points], with so much room below it [mm]."""
        self.set_font("text", "B" if bold else "", size)
        self.set_text_color(*colour)
        self.multi_cell(WIDTH, size * 0.5, text, align="L", new_x="LMARGIN", new_y="NEXT")
        self.ln(after)

    def heading(self, text: str, size: float, follows: float = 30.0) -> None:
        """Write a heading, on the next page where what follows, so high [mm], does not fit below it."""
        if self.get_y() > self.h - MARGIN - follows:
            self.add_page()
        self.ln(2.0)
        self.words(text, size, palette.INK, bold=True, after=1.0)

    def picture(self, path: Path, title: str = "", width: float = WIDTH) -> None:
        """Place a picture of a width [mm] at most under its title, on the next page where both do not fit."""
        with Image.open(path) as image:
            proportion = image.height / image.width
        width = min(width, HIGHEST / proportion)
        if title:
            # Ten of it for the heading.
            self.heading(title, 12.0, 10.0 + proportion * width)
        self.image(path, x=MARGIN + (WIDTH - width) / 2.0, w=width)
        self.ln(2.0)

    def tabulate(self, title: str, head: Sequence[str], rows: Sequence[Sequence[str]], widths: Sequence[float]) -> None:
        """Write a table, whose head is repeated on each page."""
        self.heading(title, 12.0)
        self.set_font("text", "", 8.0)
        self.set_text_color(*palette.INK)
        self.set_draw_color(*palette.GHOST)
        with self.table(
            col_widths=tuple(widths), width=WIDTH, line_height=LINE, text_align="LEFT", align="LEFT",
            borders_layout=TableBordersLayout.HORIZONTAL_LINES, first_row_as_headings=any(head),
            headings_style=FontFace(emphasis="BOLD"),
        ) as table:  # fmt: skip
            for cells in ([head] if any(head) else []) + list(rows):
                table.row(cells)
        self.ln(2.0)

    def listing(self, title: str, text: str) -> None:
        """Write lines as they are, in letters of one width."""
        self.heading(title, 12.0)
        lines = text.splitlines()
        self.set_font("code", "", 7.5)
        self.set_text_color(*palette.INK)
        more = len(lines) - MOST_LINES
        shown = lines[:MOST_LINES] + ([f"... {counted(more, 'more line')}"] if more > 0 else [])
        self.multi_cell(WIDTH, 3.6, "\n".join(shown), align="L", new_x="LMARGIN", new_y="NEXT")
