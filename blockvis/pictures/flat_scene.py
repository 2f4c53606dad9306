"""The scene: blocks and marks as layers of outlines, drawn by Agg with exact edges, frame after frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np
import shapely
from matplotlib.path import Path
from matplotlib.transforms import Affine2D
from PIL import Image

import solver
from solver import mechanics

from . import palette
from .backfill import FillBodies
from .frame import Frame
from .hatching import hatched
from .marks import FINE_CRACK, WIDE_CRACK, Marks, arrow_shapes, part_outlines
from .painting import painted
from .scene import Scene
from .swing import MOST_PARTS, Swing
from .ties import Strands
from .underlay import COVER, CarriedPhotograph, Underlay

#: The layers, back to front.
ORDER = (
    "earth", "backfill", "ghost", "crack", "fill", "hatch", "outline", "lost", "ground", "crack edge", "sliding",
    "motion outline", "force line", "force",
    "tie rim", "tie ground", "tie slack", "tie elastic", "tie pressed", "tie yielding", "tie broken", "tie end",
    "arrow rim", "arrow top", "hinge", "hinge top", "crushing", "crushing top",
    "motion rim", "motion top", "dead rim", "dead top", "live rim", "live top",
)  # fmt: skip

#: Thickness of arrows by their layer, and the least width of a line [pixels].
WEIGHTS = {"arrow": 1.0, "motion": 0.6, "live": 0.55, "dead": 0.55}
THINNEST = 1.2

Colour = tuple[int, int, int]


class FlatScene(Scene):
    """Blocks of the plane and their marks.

    The blocks have colours (n_blocks, 3) uint8, and carry their part of a photograph where there is one.
    """

    def __init__(
        self,
        assembly: solver.Assembly,
        frame: Frame,
        size: tuple[int, int],
        block_fill: np.ndarray,
        underlay: Underlay | None = None,
        outline: Colour = palette.OUTLINE,
    ) -> None:
        super().__init__(assembly, frame, size)
        self._photograph = (
            None if underlay is None else CarriedPhotograph(underlay, assembly, self.frame.low, self.pixel, size)
        )
        self._layers: dict[str, _Layer] = {}
        self._fills: list[_Layer] = []
        self._outlines = _rings(np.diff(assembly.offsets))
        self._paint(block_fill)
        self._layers["outline"] = _Layer(outline, *self._outlines, width=self._outline_width())
        self._hatch()
        self._floor = np.inf
        self.pose(solver.Pose.initial(assembly))

    def holds(self, *layers: str) -> bool:
        """Whether anything is drawn in one of the layers, parts of them (after a "/") included."""
        return any(len(layer.corners) for name, layer in self._layers.items() if name.split("/")[0] in layers)

    def pose(self, shown: solver.Pose, block_fill: np.ndarray | None = None) -> None:
        """Put the blocks where they are drawn, in new colours (n_blocks, 3) uint8 where these are given."""
        if block_fill is not None:
            self._paint(block_fill)
        self._shown = shown
        corners = mechanics.moved_vertices(self.assembly, shown)
        # Out of the picture.
        corners[self._gone[self.assembly.block_of_vertex]] = self.frame.low - self.frame.size
        for layer in (*self._fills, self._layers["outline"]):
            layer.move(corners)
        if "hatch" in self._layers:
            points, blocks = self._hatched
            moved = mechanics.carried(points, blocks, solver.Pose.initial(self.assembly), shown)
            moved[self._gone[blocks]] = self.frame.low - self.frame.size
            self._layers["hatch"].move(moved)
        if np.isfinite(self._floor):
            self._show_earth(corners)

    def lost(self, blocks: np.ndarray) -> None:
        """Edge blocks that have fallen, (n_blocks,) bool array, where they are drawn."""
        corners = mechanics.moved_vertices(self.assembly, self._shown)
        edges = np.stack([corners, corners[self.assembly.polygons.next_vertex]], axis=1)
        width = max(2.0 * self._outline_width(), THINNEST)
        self.lines("lost", edges[blocks[self.assembly.block_of_vertex]], palette.WARNING, width)

    def backfill(self, bodies: FillBodies) -> None:
        """Fill and hatch what lies between extrados and surface, behind the blocks."""
        self.polygons("backfill", bodies.columns, palette.FILL)
        self.lines("backfill/hatch", bodies.hatch(), palette.FILL_HATCH, max(0.8, self.usual_height / 1000.0))
        self.lines("backfill/rim", bodies.rims(), palette.FILL_RIM, max(1.2, self.usual_height / 500.0))

    def polygons(self, layer: str, corners: np.ndarray, colour: Colour) -> None:
        """Fill polygons, (n, k, 2) [m], in one layer, instead of those before."""
        n, k = corners.shape[:2] if corners.size else (0, 4)
        # Where polygons of both senses overlap, they would cut holes into each other.
        x, y = np.moveaxis(corners.reshape(n, k, 2), 2, 0)
        backwards = (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1) < 0.0
        turned = np.where(backwards[:, None, None], corners.reshape(n, k, 2)[:, ::-1], corners.reshape(n, k, 2))
        self._layers[layer] = _Layer(colour, *_rings(np.full(n, k)))
        self._layers[layer].move(turned.reshape(-1, 2))

    def lines(self, layer: str, points: np.ndarray, colour: Colour, width: float) -> None:
        """Draw polylines, (n, k, 2) [m], ``width`` pixels wide, in one layer, instead of those before."""
        n, k = points.shape[:2] if points.size else (0, 2)
        codes = np.full((n, k), Path.LINETO, dtype=Path.code_type)
        codes[:, :1] = Path.MOVETO
        self._layers[layer] = _Layer(colour, np.arange(n * k), codes.ravel(), width=width)
        self._layers[layer].move(points.reshape(-1, 2))

    def discs(self, layer: str, centres: np.ndarray, radius: float, colour: Colour) -> None:
        """Draw discs, centres (n, 2) [m], ``radius`` in pixels, in one layer, instead of those before."""
        angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        rim = radius * self.pixel * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        self.polygons(layer, centres[:, None, :] + rim[None, :, :], colour)

    def cracks(self, found: Marks, magnification: float) -> None:
        """Fill what lies between faces, and draw a line where that would be too thin to see."""
        narrow, thin = ~found.gapes, self._thin
        self.polygons("crack", found.cracks[narrow], palette.OPEN)
        middle = found.middles[narrow]
        width = found.openings[narrow].max(axis=1, initial=0.0) / self.assembly.block_size
        fine, wide = width < FINE_CRACK, width * magnification > WIDE_CRACK
        self.lines("crack edge", middle[~fine & ~wide], palette.OPEN, max(2.2 * thin, THINNEST))
        self.lines("crack edge/faces", found.gaping_faces, palette.OPEN, max(3.0 * thin, THINNEST))
        self.lines("crack edge/fine", middle[fine], palette.OPEN, max(1.1 * thin, THINNEST))

    def sliding(self, found: Marks) -> None:
        """Draw lines along sliding joints."""
        self.lines("sliding", found.sliding, palette.SLIDING, max(5.0 * self._thin, THINNEST))

    def hinges(self, found: Marks) -> None:
        """Draw dots with a rim of paper."""
        self.discs("hinge/rim", found.hinges[:, 0], self._dot * 1.35, palette.PAPER)
        self.discs("hinge top", found.hinges[:, 0], self._dot, palette.HINGE)

    def crushing(self, found: Marks) -> None:
        """Draw dots with a dark rim."""
        self.discs("crushing/rim", found.crushing, self._dot * 1.35, palette.HINGE)
        self.discs("crushing top", found.crushing, self._dot, palette.CRUSHING)

    @property
    def _dot(self) -> float:
        """Radius of the dots of hinges [pixels]."""
        return float(np.clip(0.09 * self.assembly.block_size / self.pixel, 3.0 * self._thin, 11.0 * self._thin))

    def forces(self, ends: np.ndarray, line: np.ndarray) -> None:
        """Draw bars, and the line of thrust."""
        along = ends[:, 1] - ends[:, 0]
        unit = along / np.hypot(*along.T)[:, None]
        thick = 0.5 * max(2.0, self.usual_height / 320.0) * self.pixel
        side = np.stack([-unit[:, 1], unit[:, 0]], axis=1) * thick
        bars = [ends[:, 0] - side, ends[:, 1] - side, ends[:, 1] + side, ends[:, 0] + side]
        self.polygons("force", np.stack(bars, axis=1), palette.FORCE)
        self.lines("force line", line, palette.FORCE, self.usual_height / 500.0)

    def ties(self, strands: Sequence[Strands]) -> None:
        """Draw lines with a rim of paper, and dots where they are held."""
        for strand in strands:
            width, part = max(strand.width * self._thin, THINNEST), strand.layer.removeprefix("tie ")
            self.lines(f"tie rim/{part}", strand.ends, palette.PAPER, width + max(3.0 * self._thin, 1.0))
            self.lines(strand.layer, strand.ends, strand.colour, width)
            self.discs(f"tie end/{part}", strand.anchors, 0.9 * width + 2.0 * self._thin, strand.colour)

    def bearings(self, ends: np.ndarray) -> None:
        """Draw a heavy line where supports carry the structure."""
        self.lines("ground", ends, palette.INK, max(1.2, self.usual_height / 320.0))

    def arrows(self, layer: str, tails: np.ndarray, tips: np.ndarray, colour: Colour) -> None:
        """Draw arrows with a rim of paper from tails (n, 2) [m] to tips (n, 2) [m]."""
        weight = WEIGHTS[layer]
        thick = weight * self.usual_height / 110.0 * self.pixel
        for name, grown, fill in (("rim", 1.0, palette.PAPER), ("top", 0.0, colour)):
            shafts, heads = arrow_shapes(tails, tips, thick, grown * weight * self.usual_height / 360.0 * self.pixel)
            self.polygons(f"{layer} {name}/shaft", shafts, fill)
            self.polygons(f"{layer} {name}/head", heads, fill)

    def show_motion(self, swing: Swing, tails: np.ndarray, tips: np.ndarray) -> solver.Pose:
        """Draw the parts of a mechanism, where they are few, as outlines where it takes them; the blocks stay."""
        if swing.n_parts <= MOST_PARTS:
            corners = mechanics.moved_vertices(self.assembly, swing.displaced)
            outlines = part_outlines(self.assembly, corners, swing.parts)
            self.lines("motion outline", outlines, palette.SETTLEMENT, self.usual_height / 600.0)
        self.arrows("motion", tails, tips, palette.SETTLEMENT)
        return swing.increment.pose

    def show_start(self) -> None:
        """Draw the first position of the moving supports, behind everything."""
        assembly = self.assembly
        edges = np.stack([assembly.vertices, assembly.vertices[assembly.polygons.next_vertex]], axis=1)
        moving = assembly.moving[assembly.block_of_vertex]
        self.lines("ghost", edges[moving], palette.GHOST, self.usual_height / 800.0)

    def show_ground(self, height: float) -> None:
        """Draw the ground of a fall over the whole width, hatched below and up to supports, behind everything."""
        self._floor = height
        tick, thin = self._hatching
        (left, _), (right, _) = self.frame.low, self.frame.high
        ends = np.array([[[left, height], [right, height]]])
        self.lines("earth", ends, palette.HATCH, max(1.2, self.usual_height / 400.0))
        x = np.arange(left, right + tick, tick)
        level = np.broadcast_to([height, height - tick], (len(x), 2))
        ticks = np.stack([np.stack([x, x - tick], axis=1), level], axis=2)
        self.lines("earth/hatch", ticks, palette.HATCH, thin)

    def _show_earth(self, corners: np.ndarray) -> None:
        """Hatch what lies below supports that are ground, as they reach below all free blocks: they would hang in air.

        ``corners`` are those of the blocks, (n_vertices, 2) [m].
        """
        assembly, following = self.assembly, corners[self.assembly.polygons.next_vertex]
        below = (
            self._ground[assembly.block_of_vertex] & (following[:, 0] > corners[:, 0]) & (corners[:, 1] > self._floor)
        )
        top = np.stack([corners[below], following[below]], axis=1)
        foot = np.stack([top[..., 0], np.full(top.shape[:2], self._floor)], axis=2)
        spacing, thin = self._hatching
        found = [hatched(of, spacing, 1.0) for of in shapely.polygons(np.hstack([top, foot[:, ::-1]]))]
        sides = np.stack([top, foot], axis=2).reshape(-1, 2, 2)
        self.lines("earth/under", np.concatenate([sides, *found]), palette.HATCH, thin)

    def clear(self, *layers: str) -> None:
        """Remove layers, parts of them (after a "/") included."""
        for name in tuple(self._layers):
            if name.split("/")[0] in layers:
                del self._layers[name]

    def image(self) -> Image.Image:
        """Draw the picture."""
        if self._photograph is None:
            under = Image.new("RGB", self.size, palette.PAPER)
        else:
            under = self._photograph.picture(self._shown, self._gone)
        return painted(under, self._paths(), Affine2D().translate(*-self.frame.low).scale(1.0 / self.pixel))

    def _paths(self) -> Iterator[tuple[Colour, float, float, Path]]:
        """Colour, width of the line (0 where it is filled), opacity and outlines, back to front.

        What is filled alike, layer upon layer, is one path: between two that share an edge the background would shine
        through.
        """
        # Parts of one layer come in the order in which they were first drawn: a set's order would change with the run.
        names = sorted([*self._layers, "fill"], key=lambda name: ORDER.index(name.split("/")[0]))
        layers = [layer for name in names for layer in (self._fills if name == "fill" else [self._layers[name]])]
        for (colour, width, cover), alike in groupby(layers, key=lambda one: (one.colour, one.width, one.cover)):
            drawn = [layer.path for layer in alike if len(layer.corners)]
            if drawn:
                yield colour, width, cover, drawn[0] if len(drawn) == 1 else Path.make_compound_path(*drawn)

    def _paint(self, block_fill: np.ndarray) -> None:
        """Set the colours of the blocks: one layer for each colour."""
        colours, which = np.unique(block_fill, axis=0, return_inverse=True)
        corners, codes = self._outlines
        owner = np.repeat(which.ravel(), np.diff(self.assembly.offsets) + 1)
        cover = 1.0 if self._photograph is None else COVER
        self._fills = [
            _Layer((int(r), int(g), int(b)), corners[owner == k], codes[owner == k], cover=cover)
            for k, (r, g, b) in enumerate(colours)
        ]

    def _outline_width(self) -> float:
        """Pixels; thinner where the blocks are small, so that a façade does not turn dark."""
        return float(np.clip(self.assembly.block_size / self.pixel / 25.0, 0.6, self.usual_height / 540.0))

    @property
    def _hatching(self) -> tuple[float, float]:
        """Distance [m] and thickness [pixels] of the lines that hatch ground and supports."""
        return self.usual_height / 60.0 * self.pixel, max(0.7, self.usual_height / 1000.0)

    def _hatch(self) -> None:
        """Hatch supports as laid out, in the picture and around it."""
        supports = np.flatnonzero(~self.assembly.free)
        outlines = [shapely.Polygon(self.assembly.outline(block)) for block in supports.tolist()]
        around = shapely.box(*(self.frame.low - self.frame.size), *(self.frame.high + self.frame.size))
        spacing, thin = self._hatching
        found = [hatched(shapely.intersection(outline, around), spacing, 1.0) for outline in outlines]
        lines = np.concatenate([np.zeros((0, 2, 2)), *found])
        self._hatched = lines.reshape(-1, 2), np.repeat(supports, [2 * len(of) for of in found])
        if len(lines):
            self.lines("hatch", lines, palette.HATCH, thin)


class _Layer:
    """Outlines or lines of one colour and opacity, by the number of the point at each corner of matplotlib's path.

    Lines have a width in pixels, outlines that are filled have 0.
    """

    def __init__(
        self, colour: Colour, corners: np.ndarray, codes: np.ndarray, width: float = 0.0, cover: float = 1.0
    ) -> None:
        self.colour, self.width, self.corners, self.cover = colour, width, corners, cover
        self.points = np.zeros((len(corners), 2))
        # The path looks at the points, which move.
        self.path = Path(self.points, codes)
        self.path.should_simplify = False

    def move(self, points: np.ndarray) -> None:
        """Put the points, (m, 2) [m], somewhere."""
        self.points[:] = points[self.corners]


def _rings(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners and codes of closed rings of so many points each, one after another."""
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    corners = np.insert(np.arange(starts[-1]), starts[1:], starts[:-1])
    codes = np.full(len(corners), Path.LINETO, dtype=Path.code_type)
    ends = starts[1:] + np.arange(len(counts))
    codes[ends] = Path.CLOSEPOLY
    codes[starts[:-1] + np.arange(len(counts))] = Path.MOVETO
    return corners, codes
