"""The player inside a notebook."""

from __future__ import annotations

import html
from dataclasses import dataclass

import solver
from blockvis.fall import fall_of

from .page import report_html


@dataclass(frozen=True)
class Player:
    """What a notebook shows as the page that plays a response.

    Attributes
    ----------
    response : solver.Response
    height : int
        Pixels.
    """

    response: solver.Response
    height: int = 760

    def _repr_html_(self) -> str:
        # A frame of its own keeps the page's names and styles apart from the notebook's.
        page = html.escape(report_html(self.response, fall=fall_of(self.response)), quote=True)
        style = f"width:100%;height:{self.height}px;border:0"
        return f'<iframe srcdoc="{page}" style="{style}" sandbox="allow-scripts allow-downloads"></iframe>'


def show(response: solver.Response, *, height: int = 760) -> Player:
    """Show a response in a player, for the last line of a notebook cell.

    Parameters
    ----------
    response : solver.Response
    height : int
        Pixels.

    Returns
    -------
    Player
    """
    return Player(response, height)
