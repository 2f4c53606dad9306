"""Figures of matplotlib, in which a name is text whatever it holds."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from blockvis.system.atomic_files import atomic_file

#: Decorates what draws a figure: between two signs "$" its text is no formula, as a name with prices is none.
plain_text = rc_context({"text.parse_math": False})


def plain_frame(axes: Axes, text: float) -> None:
    """Give a plot a grid and no frame, with numbers for a text so high [points]."""
    axes.tick_params(labelsize=0.9 * text)
    axes.grid(color="#e4e4e4", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)


def plain_plot(axes: Axes, text: float) -> None:
    """Give a plot no frame, and numbers as they are, without a power of ten or an offset in the corner."""
    plain_frame(axes, text)
    axes.ticklabel_format(useOffset=False, style="plain")


def saved(figure: Figure, path: str | os.PathLike[str], dpi: int, **options: Any) -> Path:
    """Save a figure, whole or not at all; options as of :meth:`matplotlib.figure.Figure.savefig`."""
    with atomic_file(path) as partial:
        figure.savefig(partial, dpi=dpi, **options)
    return Path(path)
