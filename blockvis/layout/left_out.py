"""What a drawing holds beside its blocks: what it was, where, and why it is left out; and what a caller asks for.

That is by layer, group, material and name, or by kind of entity and colour.
"""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from blockvis.text import place_text

from .notes import LEFT_OUT, Note

#: Kinds of what is left out, for one and for many.
KINDS = {
    "open": ("line that closes no outline", "lines that close no outline"),
    "axis": ("line in the line type of an axis", "lines in line types of axes"),
    "across": ("face of loose lines across outlines", "faces of loose lines across outlines"),
    "hole": ("face with a hole", "faces with a hole"),
    "paper": ("sheet of paper up to the rim of the image", "sheets of paper up to the rim of the image"),
    "pieces": ("face in several pieces", "faces in several pieces"),
    "no outline": ("face without outline", "faces without outline"),
    "no area": ("outline without area", "outlines without area"),
    "sliver": ("sliver", "slivers"),
    "crossing": ("outline that crosses itself", "outlines that cross themselves"),
    "edge": ("outline across the edge of the window", "outlines across the edge of the window"),
    "background": ("frame or background around other blocks", "frames or backgrounds around other blocks"),
    "inner": ("inner line of a block", "inner lines of blocks"),
    "title": ("cell of a title block", "cells of a title block"),
    "annotation": ("outline on a layer of annotations", "outlines on a layer of annotations"),
    "mortar": ("mortar surface", "mortar surfaces"),
    "asked": ("outline, as asked for", "outlines, as asked for"),
    "asked line": ("line, as asked for", "lines, as asked for"),
}

#: Kinds of entities of drawings, as they can be asked for.
ENTITIES = (
    "arc", "circle", "ellipse", "face", "hatch", "line", "path", "polygon", "polyline", "rect", "solid", "spline",
    "text",
)  # fmt: skip

#: What formats call them, where it is something else.
_ALSO = {"lwpolyline": "polyline", "mpolygon": "hatch", "mtext": "text", "trace": "solid", "3dface": "solid"}

#: Layers of ties, whose lines are members where a case says so.
TIES = re.compile(r"\b(ties?|tie.?(rod|bar)s?|tirant[eis]*|caten[ae]|tensores|zug(anker|stangen?))\b", re.IGNORECASE)

#: Ends of a line this part of its size apart were meant to meet.
NEARLY = 0.01


@dataclass(frozen=True)
class LeftOut:
    """Something drawn that is no block, of a kind in :data:`KINDS`.

    ``points`` (n, 2) [m] are its outline if it is closed, else line; inside a format's reader in the unit of the file,
    as its holes. Its message refuses the file where no block is left, and if ``serious`` unless the caller asks to
    leave it out. ``looks`` are kind of entity and colour; see :func:`look_of`.
    """

    kind: str
    points: np.ndarray
    message: str
    layer: str = ""
    name: str = ""
    closed: bool = True
    serious: bool = False
    holes: tuple[np.ndarray, ...] = ()
    looks: tuple[str, ...] = ()

    def mapped(self, factors: float | Sequence[float]) -> LeftOut:
        """Multiply its coordinates."""
        holes = tuple(ring * np.asarray(factors) for ring in self.holes)
        return replace(self, points=self.points * np.asarray(factors), holes=holes)

    @property
    def place(self) -> np.ndarray:
        """(2,) array [m]: a point of it, for messages."""
        if len(self.points) == 0:
            return np.full(2, np.nan)
        middle: np.ndarray = (self.points.min(axis=0) + self.points.max(axis=0)) / 2.0
        return middle if self.closed else self.points[0]

    @property
    def miss(self) -> float:
        """Distance between both ends of a line [m]; 0 of an outline."""
        return 0.0 if self.closed or len(self.points) < 3 else float(np.hypot(*(self.points[0] - self.points[-1])))


def in_words(left_out: Sequence[LeftOut]) -> list[Note]:
    """Say what is left out: one line per kind and layer, with the number and the place of the first.

    Examples
    --------
    >>> stroke = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.5]])
    >>> in_words([LeftOut("open", stroke, "", "axes", "line 2F", closed=False)])
    ["left out: 1 line that closes no outline on layer 'axes', 'line 2F' at (0, 0), its ends 1.12 apart"]
    """
    lines = []
    for kind, layer in dict.fromkeys((item.kind, item.layer) for item in left_out):
        members = [item for item in left_out if (item.kind, item.layer) == (kind, layer)]
        first = members[0]
        words = KINDS[kind][len(members) > 1]
        where = f" on layer '{layer}'" if layer else ""
        called = f"'{first.name}' " if first.name and first.name != layer else ""
        misses = [item.miss for item in members if item.miss]
        apart = f"{min(misses):.3g} to {max(misses):.3g}" if len(misses) > 1 else "".join(f"{m:.3g}" for m in misses)
        ends = f", {'their' if len(members) > 1 else 'its'} ends {apart} apart" if misses else ""
        at = (
            f", {'the first ' if len(members) > 1 else ''}{called}at {place_text(first.place, 6)}"
            if len(first.points)
            else ""
        )
        nearly = any(item.miss and item.miss < NEARLY * float(np.ptp(item.points, axis=0).max()) for item in members)
        are_ties = kind == "open" and TIES.search(layer)
        tied = f'; to take them for ties: [geometry] ties = ["{layer}"]' if are_ties else ""
        text = f"left out: {len(members)} {words}{where}{at}{ends}{', nearly an outline: close it' * nearly}{tied}"
        lines.append(Note(LEFT_OUT, text))
    return lines


def passed_over(counts: Mapping[str, int], words: str = "skipped") -> list[Note]:
    """Say what a reader passes over, by its kind: one note for all, none where there is nothing."""
    listed = ", ".join(f"{n} {kind}" for kind, n in counts.items() if n)
    return [Note(LEFT_OUT, f"{words}: {listed}")] if listed else []


def matches(labels: Iterable[str], patterns: Sequence[str]) -> bool:
    """Whether a label is one of the patterns, or fits one."""
    return any(label == pattern or fnmatch.fnmatchcase(label, pattern) for label in labels for pattern in patterns)


def look_of(word: str) -> str:
    """Write a kind of entity or a colour as drawings are compared by it.

    Examples
    --------
    >>> look_of("LWPOLYLINE"), look_of("#F00")
    ('polyline', '#ff0000')
    """
    word = word.strip().lower()
    if re.fullmatch(r"#[0-9a-f]{3}", word):
        return "#" + "".join(2 * digit for digit in word[1:])
    return _ALSO.get(word, word)


class Choice:
    """Patterns, as a caller gives them: of names, and kinds and colours where no name is meant.

    A pattern that fits one of the names, those of all layers, groups, materials and blocks, means names only.
    """

    def __init__(self, patterns: Sequence[str], names: Iterable[str]) -> None:
        names = set(names)
        self.patterns = tuple(pattern for pattern in patterns if matches(names, [pattern]))
        self.looks = frozenset(look_of(pattern) for pattern in patterns if pattern not in self.patterns)

    def takes(self, labels: Iterable[str], looks: Iterable[str] = ()) -> bool:
        """Whether what has these names, and this kind and colour, is meant."""
        return matches(labels, self.patterns) or not self.looks.isdisjoint(looks)
