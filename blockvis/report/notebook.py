"""What notebooks show: a player, and pictures with a few numbers in place of arrays."""

from __future__ import annotations

import base64
import html
import io
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

import solver
from blockvis.pictures import palette
from blockvis.pictures.curves import draw_curve
from blockvis.pictures.frame import FILM_SIZE
from blockvis.pictures.render import mechanism_picture, save_picture
from blockvis.results.about import Result, response_of
from blockvis.results.fall_files import known_fall
from blockvis.text import force_text
from solver import mechanics

from .page import html_rows, report_html, summary_rows

#: Pixels of the width and largest height of the picture of an assembly.
WIDE, HIGH = 560, 420


@dataclass(frozen=True)
class Player:
    """What a notebook shows as the page that plays a response, ``height`` pixels high."""

    response: solver.Response
    height: int = 760

    def _repr_html_(self) -> str:
        # A frame of its own keeps the page's names and styles apart from the notebook's.
        page = html.escape(report_html(self.response, fall=known_fall(self.response)), quote=True)
        style = f"width:100%;height:{self.height}px;border:0"
        return f'<iframe srcdoc="{page}" style="{style}" sandbox="allow-scripts allow-downloads"></iframe>'


def show(response: Result, *, height: int = 760) -> Player:
    """Show a response in a player, for the last line of a notebook cell.

    Parameters
    ----------
    response : solver.Response, solver.LimitLoad or solver.Envelope
    height : int
        Pixels.
    """
    return Player(response_of(response), height)


def response_html(response: solver.Response) -> str:
    """Show a response: its mechanism or last increment, its curve and its numbers."""
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        if response.increments:
            picture = mechanism_picture(response, usual=FILM_SIZE)
            pictures.append(save_picture(picture, Path(folder) / "mechanism.png"))
        if response.path:
            pictures.append(draw_curve(response, Path(folder) / "curve.png", size=(6.4, 3.6)))
        images = [_image(path.stem, path.read_bytes()) for path in pictures]
    return f"<div>{''.join(images)}{_table(summary_rows(response))}</div>"


def limit_load_html(limit: solver.LimitLoad) -> str:
    """Show a limit load by its mechanism, where it knows its structure, and its numbers."""
    if limit.analysed is None:
        return f"<p>{html.escape(str(limit))}</p>"
    return response_html(limit.response)


def collapse_html(collapse: solver.Collapse) -> str:
    """Show a collapse by its numbers and its mechanism in words."""
    low, high = collapse.bracket
    unit = collapse.unit
    return _table(
        [
            ("collapse at", f"{collapse.displacement:.6g} {unit}"),
            (f"{collapse.lost} at", f"{low:.6g} {unit}"),
            (f"no {collapse.lost} at", f"{high:.6g} {unit}"),
            *(
                []
                if collapse.reaction is None
                else [("reaction at the last", force_text(collapse.reaction, moment=unit == "rad"))]
            ),
            ("mechanism", collapse.words),
        ]
    )


def assembly_html(assembly: solver.Assembly) -> str:
    """Show an assembly: its blocks by material, supports grey, those that move outlined, and its numbers."""
    size = " × ".join(f"{length:.4g} m" for length in np.ptp(assembly.vertices, axis=0))
    counts = Counter(map(str, assembly.roles))
    weight = float((assembly.masses * solver.GRAVITY)[assembly.free].sum())
    materials = [f"{name} {n}" for name, n in sorted(Counter(assembly.materials).items()) if name]
    rows = [
        ("blocks", f"{assembly.n_blocks}: " + ", ".join(f"{counts[r]} {r}" for r in mechanics.ROLES if counts[r])),
        ("size", size),
        ("weight", force_text(weight)),
        *([("materials", ", ".join(materials))] if materials else []),
    ]
    picture = _drawn(assembly) if assembly.dimension == 2 else _drawn_in_space(assembly)
    return f"<div>{picture}{_table(rows)}</div>"


def _drawn_in_space(assembly: solver.Assembly) -> str:
    """Draw blocks in space as PNG, at twice the pixels that it is shown with."""
    from blockvis.pictures.solid_scene import blocks_picture

    buffer = io.BytesIO()
    blocks_picture(assembly, (2 * WIDE, 2 * HIGH), palette.role_colours(assembly)).save(buffer, "PNG")
    return _image("blocks", buffer.getvalue())


def _image(alt: str, png: bytes) -> str:
    """Show a picture at half its width."""
    width = Image.open(io.BytesIO(png)).width // 2
    return f'<img alt="{alt}" width="{width}" src="data:image/png;base64,{base64.b64encode(png).decode("ascii")}">'


def _drawn(assembly: solver.Assembly) -> str:
    """Draw an assembly as SVG; in whole pixels' hundredths, which keeps it small."""
    low, high = assembly.vertices.min(axis=0), assembly.vertices.max(axis=0)
    scale = min(WIDE / (high[0] - low[0]), HIGH / (high[1] - low[1]))
    points = (assembly.vertices - (low[0], high[1])) * (scale, -scale)
    size = (high - low) * scale
    fills = palette.block_colours(assembly.materials, assembly.free)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size[0] + 4:.0f}" height="{size[1] + 4:.0f}" '
        f'viewBox="-2 -2 {size[0] + 4:.2f} {size[1] + 4:.2f}" stroke="{palette.hexadecimal(palette.OUTLINE)}" '
        f'stroke-width="0.5">'
    ]
    for i, ring in enumerate(np.split(points, assembly.offsets[1:-1])):
        corners = " ".join(f"{x:.2f},{y:.2f}" for x, y in ring.tolist())
        edge = f' stroke="{palette.hexadecimal(palette.SETTLEMENT)}" stroke-width="2"' if assembly.moving[i] else ""
        name = html.escape(assembly.names[i])
        fill = palette.hexadecimal(fills[i])
        lines.append(f'<polygon points="{corners}" fill="{fill}"{edge}><title>{name}</title></polygon>')
    return "\n".join([*lines, "</svg>"])


def _table(rows: list[tuple[str, str]]) -> str:
    return f"<table>{html_rows(rows)}</table>"
