"""Ties, props and bars in pictures: lines from end to end, coloured by what they do, named with their force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import solver
from blockvis.results.ties import STATE_WORDS
from blockvis.text import force_text
from solver import mechanics

from . import palette
from .frame import Key
from .surface import IN_PLANE

#: Elastic and in compression, which pictures tell from tension.
PRESSED = len(STATE_WORDS)

#: States that are drawn, back to front, and their words.
DRAWN = (mechanics.SLACK, mechanics.ELASTIC, PRESSED, mechanics.YIELDING, mechanics.BROKEN)
WORDS = (*STATE_WORDS, "pressed")

#: Colours by state.
COLOURS = {
    mechanics.SLACK: palette.FAINT,
    mechanics.ELASTIC: palette.TIE,
    PRESSED: palette.FORCE,
    mechanics.YIELDING: palette.YIELDING,
    mechanics.BROKEN: palette.WARNING,
}

#: Widths of lines by state, and how much wider those of props are, in pixels of a picture 1080 high.
WIDTHS, PROPS = {mechanics.SLACK: 2.5, mechanics.ELASTIC: 6.0, mechanics.YIELDING: 8.0, mechanics.BROKEN: 5.0}, 1.8
WIDTHS[PRESSED] = WIDTHS[mechanics.ELASTIC]

#: A slack line has a dash in so many pixels of a picture 1080 high.
DASH = 22.0

#: What a tie carries at rest is, below this part of the largest force, how the joints give and no number to tell.
SMALLEST_TOLD = 1e-4

#: Most ties that are named in a picture: those with the largest forces.
MOST_NAMED = 6


@dataclass(frozen=True)
class Strands:
    """Lines of one state and width, back to front in a layer "tie" and the state in words.

    The ends (n, 2, d) [m] are of lines, dashes or stubs, the anchors (m, d) [m] of the members; the width is in pixels
    of a picture 1080 high.
    """

    layer: str
    ends: np.ndarray
    anchors: np.ndarray
    colour: tuple[int, int, int]
    width: float


class DrawnTies:
    """The ties of a response as its pictures show them; a section leaves some of them out."""

    def __init__(self, response: solver.Response, cut: np.ndarray | None = None) -> None:
        self._assembly, self._ties, self._cut = response.assembly, response.ties, cut
        self._props = np.array([tie.kind == mechanics.PROP for tie in self._ties], dtype=bool)
        self._grounded = np.array([[b is None for b in tie.blocks] for tie in self._ties], dtype=bool).reshape(-1, 2)
        self.seen: set[tuple[int, str]] = set()

    def survey(self, increment: solver.Increment) -> None:
        """Take note of what ties do at an increment, for the legend."""
        kinds = [tie.kind for tie in self._ties]
        self.seen |= set(zip(self._states(increment).tolist(), kinds, strict=True))

    def ends(self, poses: Sequence[solver.Pose]) -> np.ndarray:
        """(n, d) array [m]: where the ends are at poses."""
        found = [
            mechanics.tie_ends(self._ties, self._assembly, pose).reshape(-1, self._assembly.dimension) for pose in poses
        ]
        return np.concatenate([np.zeros((0, self._assembly.dimension)), *found])

    def lines(self, increment: solver.Increment, shown: solver.Pose) -> np.ndarray:
        """(n, 2, d) array [m]: ends of what is drawn of an increment, which labels leave free."""
        ends, left = self._left(shown)
        return np.asarray(ends[left & (self._states(increment) != mechanics.ABSENT)])

    def strands(self, increment: solver.Increment, shown: solver.Pose, dash: float) -> list[Strands]:
        """List what is drawn of an increment, back to front; in a fall no stubs of what has broken.

        The blocks are drawn at ``shown``; a dash and a gap are ``dash`` [m] long.
        """
        states, ends = self._states(increment), mechanics.tie_ends(self._ties, self._assembly, shown)
        there = self._grounded & (states != mechanics.ABSENT)[:, None]
        earth = earth_lines(ends[there], ends[:, ::-1][there], dash)
        found = [Strands("tie ground", earth, np.zeros((0, self._assembly.dimension)), palette.INK, 3.0)]
        for state in DRAWN:
            for wide in (False, True):
                here = ends[(states == state) & (self._props == wide)]
                lines = here
                if state == mechanics.SLACK:
                    lines = dashed(here, dash)
                elif state == mechanics.BROKEN:
                    lines = _stubs(here)
                width = WIDTHS[state] * (PROPS if wide else 1.0)
                layer = f"tie {WORDS[state]}{'/wide' * wide}"
                anchors = here.reshape(-1, self._assembly.dimension)
                found.append(Strands(layer, lines, anchors, COLOURS[state], width))
        return found

    def labels(
        self, increment: solver.Increment, shown: solver.Pose
    ) -> tuple[np.ndarray, list[str], list[tuple[int, int, int]]]:
        """Give middles (n, d) [m], words and colours of the labels of an increment, the largest force first."""
        states, (ends, left) = self._states(increment), self._left(shown)
        sizes = _told_forces(increment) if len(increment.ties.forces) else np.zeros(len(states))
        there = left & (states != mechanics.ABSENT)
        order = [k for k in np.argsort(-sizes, kind="stable").tolist() if there[k]][:MOST_NAMED]
        # In a fall forces change from frame to frame.
        told = increment.status != solver.Status.FALLING
        words = [self._words(k, float(sizes[k]) if told else None, int(states[k])) for k in order]
        return ends.mean(axis=1)[order], words, [COLOURS[int(states[k])] for k in order]

    def _left(self, shown: solver.Pose) -> tuple[np.ndarray, np.ndarray]:
        """(n, 2, d) array [m]: ends of what a section leaves of each; and whether it leaves anything, (n,) bool."""
        ends = mechanics.tie_ends(self._ties, self._assembly, shown)
        if self._cut is None:
            return ends, np.ones(len(ends), dtype=bool)
        heights = (ends - self._cut[0]) @ self._cut[1]
        # One that lies in the plane is left.
        left = heights.max(axis=1) >= -IN_PLANE * float(np.ptp(self._assembly.vertices, axis=0).max())
        across = heights.min(axis=1) * heights.max(axis=1) < 0.0
        shares = np.divide(heights, heights - heights[:, ::-1], out=np.zeros_like(heights), where=across[:, None])
        return ends + np.where(heights < 0.0, shares, 0.0)[:, :, None] * (ends[:, ::-1] - ends), left

    def told(self, increment: solver.Increment) -> list[dict[str, Any]]:
        """List what a page draws of an increment, as JSON has it.

        Ends, lines and ends that the ground holds [m]; words beside it and in the legend, colour, width [pixel], dash.
        """
        states, ends = self._states(increment), mechanics.tie_ends(self._ties, self._assembly, increment.pose)
        told: list[dict[str, Any]] = []
        sizes, falling = _told_forces(increment), increment.status == solver.Status.FALLING
        for k in np.flatnonzero(states != mechanics.ABSENT).tolist():
            state = int(states[k])
            lines = _stubs(ends[[k]]) if state == mechanics.BROKEN else ends[[k]]
            told.append(
                {
                    "ends": np.round(ends[k], 5).tolist(),
                    "lines": np.round(lines, 5).tolist(),
                    "ground": self._grounded[k].astype(int).tolist(),
                    "words": self._words(k, None if falling else float(sizes[k]), state),
                    "key": _legend_words(state, [self._ties[k].kind]),
                    "colour": palette.hexadecimal(COLOURS[state]),
                    "width": 0.6 * WIDTHS[state] * (PROPS if self._props[k] else 1.0),
                    "dash": [7, 6] if state == mechanics.SLACK else [],
                }
            )
        return told

    def keys(self) -> list[Key]:
        """Return the legend."""
        found: list[Key] = []
        for state in DRAWN:
            kinds = [kind for kind in mechanics.TIE_KINDS if (state, kind) in self.seen]
            if kinds:
                shape = "dash" if state == mechanics.SLACK else "line"
                found.append(Key(shape, _legend_words(state, kinds), COLOURS[state], layers=(f"tie {WORDS[state]}",)))
        return found

    def _words(self, k: int, size: float | None, state: int) -> str:
        tie = self._ties[k]
        if state in (mechanics.SLACK, mechanics.BROKEN):
            return f"{tie.name} {WORDS[state]}"
        # A colour that changes in a fall without a number says why: a slack tie comes taut.
        sense = "compression" if state == PRESSED else "tension"
        sense = f" in {sense}" if size is None else f" {sense}" if tie.kind == mechanics.BAR else ""
        force = "" if size is None else f" {force_text(size)}"
        return f"{tie.name}{force}{', yielding' if state == mechanics.YIELDING else sense}"

    def _states(self, increment: solver.Increment) -> np.ndarray:
        states = increment.ties.states
        if len(states) != len(self._ties):
            return np.full(len(self._ties), mechanics.ABSENT)
        if increment.status == solver.Status.FALLING:
            # Their ends go far apart.
            states = np.where(states == mechanics.BROKEN, mechanics.ABSENT, states)
        return np.where((states == mechanics.ELASTIC) & (increment.ties.forces < 0.0), PRESSED, states)


def _told_forces(increment: solver.Increment) -> np.ndarray:
    """(n_ties,) array [N]: what ties carry, and 0 where resultants so small are not drawn."""
    sizes = np.abs(increment.ties.forces)
    largest = max(float(np.abs(increment.forces).max(initial=0.0)), float(sizes.max(initial=0.0)))
    return np.asarray(np.where(sizes > SMALLEST_TOLD * largest, sizes, 0.0))


def _legend_words(state: int, kinds: Sequence[str]) -> str:
    """Say in the legend what members of some kinds do."""
    if state in (mechanics.ELASTIC, PRESSED):
        sense = "compression" if state == PRESSED else "tension"
        return " or ".join(f"{kind} in {sense}" if kind == mechanics.BAR else kind for kind in kinds)
    return f"{WORDS[state]} {' or '.join(kinds)}"


def earth_lines(places: np.ndarray, others: np.ndarray, size: float) -> np.ndarray:
    """(5 n, 2, d) array [m]: hatched plates, 2 ``size`` [m] wide, at ends (n, d) of members with other ends (n, d)."""
    away = places - others
    away = away / np.linalg.norm(away, axis=1, keepdims=True)
    if places.shape[1] == 2:
        across = np.stack([-away[:, 1], away[:, 0]], axis=1)
    else:
        # Level, and of an upright member to the right in the drawing.
        across = np.cross(away, [0.0, 0.0, 1.0])
        across[np.linalg.norm(across, axis=1) < 1e-6] = [1.0, 0.0, 0.0]
        across /= np.linalg.norm(across, axis=1, keepdims=True)
    plates = [np.stack([places - size * across, places + size * across], axis=1)]
    for share in (-0.4, 0.1, 0.6, 1.0):
        foot = places + share * size * across
        plates.append(np.stack([foot, foot + 0.5 * size * (away - across)], axis=1))
    return np.concatenate(plates)


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
    along = 0.42 * (ends[:, 1] - ends[:, 0])
    first = np.stack([ends[:, 0], ends[:, 0] + along], axis=1)
    return np.concatenate([first, np.stack([ends[:, 1] - along, ends[:, 1]], axis=1)])
