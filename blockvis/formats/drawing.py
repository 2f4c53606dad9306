"""Outlines and loose lines of a drawing, whatever its format."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self, TypeVar

import numpy as np

from blockvis.layout.block_table import moved_notes, with_rows
from blockvis.layout.layout import Layout
from blockvis.layout.left_out import Choice, LeftOut
from blockvis.layout.notes import CHANGED, Note
from blockvis.layout.outlines import around_hole, drawing_plane, spread_of
from solver.mechanics import counted

from .arcs import MEETS, Curve
from .reading import Reading

#: Lines are intersected on a grid of this fraction of the size of the drawing.
GRID = 1e-6


S = TypeVar("S", bound="Stroke")


@dataclass(frozen=True, eq=False, kw_only=True)
class Stroke:
    """Something drawn: (n, 2) or (n, 3) points, with kind of entity and colour, layers around it, and its curves.

    ``off_others`` is the largest distance of its chords from curves that are none of these.
    """

    points: np.ndarray
    looks: tuple[str, ...] = ()
    within: tuple[str, ...] = ()
    curves: tuple[Curve, ...] = ()
    off_others: float = 0.0

    @property
    def off(self) -> float:
        """Largest distance of its chords from the curves for which they stand."""
        return max([self.off_others, *(curve.off for curve in self.curves)])

    @property
    def labels(self) -> tuple[str, ...]:
        """Names by which it can be asked for."""
        return self.within

    def as_(self, kind: type[S], **more: Any) -> S:
        """Make it a line or an outline, with what that has beside."""
        return kind(**vars(self) | more)

    def mapped(self, matrix: np.ndarray, origin: np.ndarray | None = None) -> Self:
        """Map it linearly: ``matrix`` is (d, d) or (2, 3), ``origin`` where the origin goes."""
        to = np.zeros(len(matrix)) if origin is None else origin
        curves = tuple(curve.mapped(matrix, to) for curve in self.curves)
        return replace(self, points=self.points @ matrix.T + to, curves=curves)


@dataclass(frozen=True, eq=False, kw_only=True)
class Line(Stroke):
    """An open line, which messages call by its handle.

    ``must_close`` says whether it is a polyline, and so part of an outline; a single line may also be a dimension or an
    axis. ``line_type`` is "" where nothing says it, and ``chain`` whether it is of dashes and dots, as of axes, section
    planes and neighbouring parts: see :func:`is_chain`.
    """

    layer: str
    name: str
    handle: str
    must_close: bool
    line_type: str = ""
    chain: bool = False

    @property
    def labels(self) -> tuple[str, ...]:  # noqa: D102
        return *self.within, self.layer, self.name

    def left_out(self, kind: str, message: str = "", name: str = "") -> LeftOut:
        """Leave it out as some kind."""
        points = self.points[:, :2]
        return LeftOut(kind, points, message, self.layer, name or self.name, closed=False, looks=self.looks)


@dataclass(frozen=True, eq=False, kw_only=True)
class Outline(Stroke):
    """A closed outline with its row of the block table, and what lies within it as holes."""

    row: dict[str, Any]
    holes: tuple[np.ndarray, ...] = ()

    @property
    def labels(self) -> tuple[str, ...]:  # noqa: D102
        return *self.within, *(str(self.row.get(key, "")) for key in ("name", "group", "material"))

    def mapped(self, matrix: np.ndarray, origin: np.ndarray | None = None) -> Self:  # noqa: D102
        to = 0.0 if origin is None else origin
        return replace(super().mapped(matrix, origin), holes=tuple(ring @ matrix.T + to for ring in self.holes))

    def left_out(self, called: str) -> LeftOut:
        """Leave it out for its holes."""
        said = {"name": self.row.get("name", ""), "layer": self.row.get("group", ""), "looks": self.looks}
        return replace(around_hole(called, self.points, self.holes), **said)


@dataclass
class Drawing:
    """What a reader finds: outlines, those with holes and what messages call them, lines that are open, and the rest.

    ``misses`` are distances between ends that were joined; ``skipped`` counts by kind what is neither. ``moved`` are
    rows that our own writer put beside outlines which lie on other layers now, with those that hold.
    """

    outlines: list[Outline] = field(default_factory=list)
    holed: list[tuple[Outline, str]] = field(default_factory=list)
    loose: list[Line] = field(default_factory=list)
    misses: list[float] = field(default_factory=list)
    skipped: Counter[str] = field(default_factory=Counter)
    moved: list[tuple[Mapping[str, Any], Mapping[str, Any]]] = field(default_factory=list)
    left_out: list[LeftOut] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def strokes(self) -> list[Stroke]:
        """All that is drawn."""
        return [*self.outlines, *self.loose, *(outline for outline, _ in self.holed)]

    def turn(self, reading: Reading) -> tuple[np.ndarray, list[str]]:
        """Turn a drawing, of which what is wanted stands upright, into the plane of x and y.

        Gives the directions of x, y and across in the rows of a matrix (3, 3), and notes on what that changes.
        """
        if not self.strokes:
            return np.eye(3), []
        every = [one.points for one in self.strokes]
        spread_of(np.concatenate(every))
        wanted = [one.points for one in filter(self.wants(reading), self.strokes)]
        turn, notes = drawing_plane(wanted or every, reading.view)
        self.outlines = [outline.mapped(turn[:2]) for outline in self.outlines]
        self.holed = [(outline.mapped(turn[:2]), called) for outline, called in self.holed]
        self.loose = [line.mapped(turn[:2]) for line in self.loose]
        return turn, notes

    def choice(self, patterns: Sequence[str]) -> Choice:
        """Take patterns for names of what is drawn, or else for kinds and colours."""
        return Choice(patterns, {label for one in self.strokes for label in one.labels if label})

    def wants(self, reading: Reading) -> Callable[[Stroke], bool]:
        """Say of what is drawn whether it is wanted: where something is asked for, nothing else is.

        What nothing is called that is drawn may be a face or a piece of an outline: of these all lines are wanted.
        """
        unwanted, asked = self.choice(reading.ignore), [self.choice([pattern]) for pattern in reading.only]
        drawn = all(any(one.takes(stroke.labels, stroke.looks) for stroke in self.strokes) for one in asked)

        def wanted(one: Stroke) -> bool:
            chosen = not asked or not drawn or any(choice.takes(one.labels, one.looks) for choice in asked)
            return chosen and not unwanted.takes(one.labels, one.looks)

        return wanted

    def layout(self, unit: str, *, unit_by: str = "", own: bool = False, factors: Sequence[float] = (1, 1)) -> Layout:
        """Make a layout of its outlines in the plane, coordinates times factors, with their rows."""
        rows = [one.row for one in self.outlines]
        layout = Layout(
            blocks=tuple(one.points * np.array(factors) for one in self.outlines),
            names=tuple(f"block {k}" for k in range(len(rows))),
            unit=unit,
            unit_by=unit_by,
            notes=tuple(dict.fromkeys([*self.notes, *moved_notes(self.moved)])),
            left_out=tuple(item.mapped(factors) for item in self.left_out),
            looks=tuple(one.looks for one in self.outlines),
            within=tuple(one.within for one in self.outlines),
        )
        return with_rows(layout, rows, own=own) if rows else layout


def is_chain(dashes: Sequence[float]) -> bool:
    """Whether dashes are of several lengths, as in line types of axes, in which no joint is drawn.

    Examples
    --------
    >>> is_chain([12.0, 0.0]), is_chain([6.0, 6.0])
    (True, False)
    """
    return len({*dashes}) > 1


def joined_ends(points: np.ndarray, closes: bool = False) -> tuple[np.ndarray, float] | None:
    """Close a line whose ends meet, or miss each other by little, or whose file says that it is closed.

    Gives its points as of a ring, and the distance between ends that the file leaves open; None where it is open.
    """
    gap, size = float(np.abs(points[0] - points[-1]).max()), float(np.ptp(points, axis=0).max())
    # One that is closed may have a short last edge: it stays.
    if len(points) > 3 and gap <= (GRID if closes else MEETS) * size:
        return points[:-1], 0.0 if closes else gap
    return (points, 0.0) if closes and len(points) > 2 else None


def joined_note(misses: Sequence[float], size: float) -> list[str]:
    """Say how many outlines did not quite close, where that was more than rounding; ``size`` is that of the drawing."""
    far = [miss for miss in misses if miss > GRID * size]
    words = f"joined: the ends of {counted(len(far), 'outline')}, up to {max(far, default=0):.3g} units apart"
    return [Note(CHANGED, words)] if far else []
