"""Ties, props and bars in pictures: lines from end to end, coloured by what they do, named with their force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import solver
from blockvis.results.ties import STATE_WORDS, known_ties
from blockvis.text import force_text
from solver import mechanics

from . import palette
from .frame import Key

#: States that are drawn, back to front.
DRAWN = (mechanics.SLACK, mechanics.ELASTIC, mechanics.YIELDING, mechanics.BROKEN)

#: Colours by state.
COLOURS = {
    mechanics.SLACK: palette.FAINT,
    mechanics.ELASTIC: palette.TIE,
    mechanics.YIELDING: palette.YIELDING,
    mechanics.BROKEN: palette.WARNING,
}

#: Widths of lines by state, and how much wider those of props are, in pixels of a picture 1080 high.
WIDTHS, PROPS = {mechanics.SLACK: 2.5, mechanics.ELASTIC: 6.0, mechanics.YIELDING: 8.0, mechanics.BROKEN: 5.0}, 1.8

#: A slack line has a dash in so many pixels of a picture 1080 high; of a broken one this part is left at either end.
DASH, STUB = 22.0, 0.42

#: Most ties that are named in a picture: those with the largest forces.
MOST_NAMED = 6


@dataclass(frozen=True)
class Strands:
    """Lines of one state and width.

    Attributes
    ----------
    layer : str
        "tie" and the state in words.
    ends : (n, 2, d) array [m]
        Of lines, dashes or stubs.
    anchors : (m, d) array [m]
        Ends of the members.
    colour : (int, int, int)
    width : float
        In pixels of a picture 1080 high.
    """

    layer: str
    ends: np.ndarray
    anchors: np.ndarray
    colour: tuple[int, int, int]
    width: float


class DrawnTies:
    """The ties of a response as its pictures show them.

    Parameters
    ----------
    response : solver.Response

    Attributes
    ----------
    seen : set of int
        States that were found so far by :meth:`survey`.
    """

    def __init__(self, response: solver.Response) -> None:
        self._assembly, self._ties = response.assembly, known_ties(response)
        self._props = np.array([tie.kind == mechanics.PROP for tie in self._ties], dtype=bool)
        self.seen: set[int] = set()

    def survey(self, increment: solver.Increment) -> None:
        """Take note of what ties do at an increment, for the legend."""
        if self._ties:
            self.seen |= set(self._states(increment).tolist()) - {mechanics.ABSENT}

    def ends(self, poses: Sequence[solver.Pose]) -> np.ndarray:
        """(n, d) array [m]: where the ends are at poses."""
        found = [
            mechanics.tie_ends(self._ties, self._assembly, pose).reshape(-1, self._assembly.dimension) for pose in poses
        ]
        return np.concatenate([np.zeros((0, self._assembly.dimension)), *found])

    def strands(self, increment: solver.Increment, shown: solver.Pose, dash: float) -> list[Strands]:
        """List what is drawn of an increment, back to front; nothing in a fall, where they are not followed.

        Parameters
        ----------
        increment : solver.Increment
        shown : solver.Pose
            Where the blocks are drawn.
        dash : float [m]
            Length of a dash and a gap.
        """
        states, ends = self._states(increment), mechanics.tie_ends(self._ties, self._assembly, shown)
        found = []
        for state in DRAWN:
            for wide in (False, True):
                here = ends[(states == state) & (self._props == wide)]
                lines = here
                if state == mechanics.SLACK:
                    lines = dashed(here, dash)
                elif state == mechanics.BROKEN:
                    lines = _stubs(here)
                width = WIDTHS[state] * (PROPS if wide else 1.0)
                layer = f"tie {STATE_WORDS[state]}{'/wide' * wide}"
                anchors = here.reshape(-1, self._assembly.dimension)
                found.append(Strands(layer, lines, anchors, COLOURS[state], width))
        return found

    def labels(
        self, increment: solver.Increment, shown: solver.Pose
    ) -> tuple[np.ndarray, list[str], list[tuple[int, int, int]]]:
        """Give middles (n, d) [m], words and colours of the labels of an increment, the largest force first."""
        states = self._states(increment)
        middles = mechanics.tie_ends(self._ties, self._assembly, shown).mean(axis=1)
        sizes = np.abs(increment.ties.forces) if len(increment.ties.forces) else np.zeros(len(states))
        order = [k for k in np.argsort(-sizes, kind="stable").tolist() if states[k] != mechanics.ABSENT][:MOST_NAMED]
        words = [self._words(k, float(sizes[k]), int(states[k])) for k in order]
        return middles[order], words, [COLOURS[int(states[k])] for k in order]

    def told(self, increment: solver.Increment) -> list[dict[str, Any]]:
        """List what a page draws of an increment, as JSON has it: ends [m], words, colour, width [pixel], dashes."""
        states, ends = self._states(increment), mechanics.tie_ends(self._ties, self._assembly, increment.pose)
        told = []
        for k in np.flatnonzero(states != mechanics.ABSENT).tolist():
            state = int(states[k])
            told.append(
                {
                    "ends": np.round(ends[k], 5).tolist(),
                    "words": self._words(k, abs(float(increment.ties.forces[k])), state),
                    "state": "" if state == mechanics.ELASTIC else STATE_WORDS[state],
                    "kind": self._ties[k].kind,
                    "colour": palette.hexadecimal(COLOURS[state]),
                    "width": 0.6 * WIDTHS[state] * (PROPS if self._props[k] else 1.0),
                    "dash": [7, 6] if state == mechanics.SLACK else [18, 6] if state == mechanics.BROKEN else [],
                }
            )
        return told

    def keys(self) -> list[Key]:
        """Return the legend."""
        kinds = list(dict.fromkeys(tie.kind for tie in self._ties))
        what = " or ".join(kinds)
        return [
            Key(
                "dash" if state == mechanics.SLACK else "line",
                what if state == mechanics.ELASTIC else f"{STATE_WORDS[state]} {what}",
                COLOURS[state],
                layers=(f"tie {STATE_WORDS[state]}",),
            )
            for state in DRAWN
            if state in self.seen
        ]

    def _words(self, k: int, size: float, state: int) -> str:
        name = self._ties[k].name
        carries = state in (mechanics.ELASTIC, mechanics.YIELDING)
        return f"{name} {force_text(size) if carries else STATE_WORDS[state]}"

    def _states(self, increment: solver.Increment) -> np.ndarray:
        states = increment.ties.states
        if increment.status == solver.Status.FALLING or len(states) != len(self._ties):
            return np.full(len(self._ties), mechanics.ABSENT)
        return states


def dashed(ends: np.ndarray, length: float) -> np.ndarray:
    """(m, 2, d) array [m]: dashes, with gaps as long, along lines (n, 2, d); a dash and a gap are ``length`` [m]."""
    along = ends[:, 1] - ends[:, 0]
    counts = np.maximum(1, np.round(np.linalg.norm(along, axis=1) / length)).astype(int)
    line = np.repeat(np.arange(len(ends)), counts)
    place = np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)
    # Half a gap at either end.
    shares = (place[:, None] + np.array([0.25, 0.75])) / counts[line][:, None]
    return np.asarray(ends[line, :1] + shares[:, :, None] * along[line][:, None])


def _stubs(ends: np.ndarray) -> np.ndarray:
    """(2 n, 2, d) array [m]: what is left of broken lines (n, 2, d)."""
    along = STUB * (ends[:, 1] - ends[:, 0])
    first = np.stack([ends[:, 0], ends[:, 0] + along], axis=1)
    return np.concatenate([first, np.stack([ends[:, 1] - along, ends[:, 1]], axis=1)])
