"""Drawer of blocks in space: one set-up for all pictures of a response, as :class:`Drawer` is in the plane."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.path import Path
from matplotlib.transforms import Affine2D
from PIL import Image

import solver
from blockvis.dynamics.fall import Fall
from blockvis.results.joint_faces import initial_joints
from blockvis.text import force_text

from . import palette
from .annotations import SMALLEST_RESULTANT, length_per_force
from .captions import FAILED_BADGE, badge_of, caption_of, matters
from .curves import CurvePanel
from .drawer import (
    FEW_BLOCKS,
    FINE_CRACK,
    WIDE_CRACK,
    Look,
    arrow_shapes,
    contacts_at,
    joint_forces,
    largest_displacement,
    size_of,
    thrust_line,
)
from .flat_scene import magnified
from .frame import ColourBar, Key, Sheet, framed
from .solid_inspection import role_colours
from .solid_marks import SolidMarks, live_arrows, settlement_arrows_in_space, solid_marks
from .solid_scene import IN_FRONT_OF_ALL, SolidScene
from .solid_view import chosen_view
from .swing import MOST_PARTS, Swing, mechanism_colours, swing_of

#: Blocks are so transparent where forces are drawn inside them.
GLASS = 0.35

#: Length of the arrows at the supports, as a part of the larger side of the picture.
ARROW = 0.09

#: Supports are shown whole where the picture is no larger for it than this many times the blocks: part of a slab that
#: ends just outside looks like a mistake.
WHOLE = 1.75

#: The arrows of a mechanism are longer than the way it is drawn by, to be seen on the blocks.
LONGER = 1.6


class SolidDrawer:
    """A scene in space and its sheet, set up for some increments of one response.

    Parameters
    ----------
    response : solver.Response
    look : Look
        Forces are drawn where they are asked for, with the blocks as of glass; "auto" draws none.
    size : (int, int)
        Width and height of the pictures in pixels.
    increments : tuple of solver.Increment
        All that will be drawn: they share frame, scales and legend.
    curve : bool
        Whether the curve stands beside the blocks.
    extra : tuple of solver.Pose
        Poses that the frame has to hold, too.
    finer : int
        As of :class:`SolidScene`: 2 for stills, whose lines are then as even as those in the plane.
    """

    fall: Fall | None = None

    def __init__(
        self,
        response: solver.Response,
        look: Look,
        size: tuple[int, int],
        increments: tuple[solver.Increment, ...],
        *,
        curve: bool = False,
        extra: tuple[solver.Pose, ...] = (),
        finer: int = 1,
    ) -> None:
        look = replace(look, forces="none") if look.forces == "auto" else look
        self.response, self.look, self.increments = response, look, increments
        assembly = self.assembly = response.assembly
        self.joints = initial_joints(assembly)
        self._swing = swing_of(response)
        self.view = chosen_view(response, self._swing.displaced.positions - self._swing.increment.pose.positions)
        self._largest = self._widest = self._strongest = 0.0
        self._marked: set[str] = set()
        live = float(np.linalg.norm(response.loads.live[assembly.free, :3], axis=1).max(initial=0.0))
        self._strongest_live = live * max((abs(_multiplier(i)) for i in increments), default=0.0)
        self._sizes: list[np.ndarray] = []
        poses = chain([solver.Pose.initial(assembly)], self._surveyed(), extra)
        frame = framed(assembly, poses, margin=0.05, supports=0.3, axes=self.view.axes[:2], whole=WHOLE)
        self._arrow = ARROW * float(frame.size.max())
        frame = frame.holding(self._arrow_tips(extra))
        self.largest = self._largest
        bar = ColourBar(self.largest) if look.colour_by == "displacement" else None
        beside = round(0.36 * size[0]) if curve else 0
        self.sheet = Sheet(size, bar, beside)
        self.panel = CurvePanel(response, size_of(self.sheet.beside), self.sheet.text) if curve else None
        fill = self.fill = role_colours(assembly)
        self.tints = None
        if look.colour_by == "mechanism" and self._swing.moves:
            self.tints = mechanism_colours(assembly, fill, self._swing)
        self.scene = SolidScene(
            assembly, self.view, frame, self.sheet.inside_size, fill, finer=finer,
            opacity=1.0 if look.forces == "none" else GLASS,
        )  # fmt: skip
        self._force_length = self._length_per_force()
        self._overlay: list[tuple[tuple[int, int, int], np.ndarray]] = []
        #: Where a mechanism takes the blocks that are shown.
        self._motion: solver.Pose | None = None
        self._keys: list[Key] | None = None

    @property
    def many(self) -> bool:
        """Whether marks at every joint would hide the blocks."""
        return self.assembly.n_blocks > FEW_BLOCKS

    def _surveyed(self) -> Iterator[solver.Pose]:
        """Yield the poses as shown, and note what must be the same in all pictures."""
        look = self.look
        for increment in self.increments:
            shown = self._shown(increment)
            self._largest = max(self._largest, largest_displacement(self.assembly, increment))
            if look.joints:
                found = solid_marks(self.assembly, self.joints, shown, increment.pose)
                self._widest = max(self._widest, float(found.openings[~found.gapes].max(initial=0.0)))
                for what, some in (("open", found.cracks), ("sliding", found.sliding), ("hinge", found.hinges)):
                    self._marked |= {what} if len(some) else set()
            if look.forces != "none" and matters(increment, self.response):
                sizes = np.linalg.norm(joint_forces(increment, look.forces)[1], axis=1)
                self._strongest = max(self._strongest, float(sizes.max(initial=0.0)))
                self._sizes.append(sizes)
            yield magnified(self.assembly, increment.pose, look.magnification)

    def picture(
        self,
        increment: solver.Increment,
        pose: solver.Pose | None = None,
        s: float | None = None,
        *,
        title: str = "",
        note: str = "",
        badge: str = "",
        widths: bool = False,
    ) -> Image.Image:
        """Draw one increment; for frames in between, with its blocks at another pose.

        Parameters
        ----------
        increment : solver.Increment
        pose : solver.Pose, optional
            Where the blocks are in a frame between two increments.
        s : float, optional [m or rad]
            The parameter there.
        title, note, badge : str
            First and second line of the caption, and the warning, instead of those of the increment.
        widths : bool
            In the plane they are written at the widest cracks; here the legend has the scale of the colours.
        """
        increment = increment if pose is not None else self._shown(increment)
        true = increment.pose if pose is None else pose
        at = increment.with_arrays(pose=true, contacts=contacts_at(increment, true)) if pose is not None else increment
        where = magnified(self.assembly, true, self.look.magnification)
        if self._motion is not None:
            where = self._motion
        falling = increment.status == solver.Status.FALLING
        self.scene.pose(where, self._block_colours(true))
        self._draw_joints(at, where)
        self._draw_forces(at, where)
        self._draw_settlement(at, where)
        self._draw_live_load(increment, where)
        failed = self.response.stop == solver.Status.SOLVER_FAILED
        head, detail = caption_of(self.response, increment, self.look.magnification)
        return self.sheet.composed(
            _painted(self.scene.image(), self._overlay),
            title=title or head,
            detail=note or detail,
            badge=badge or (badge_of(self.response) if falling else FAILED_BADGE if failed else ""),
            keys=self.keys(),
            pixel=self.scene.pixel,
            beside=None if self.panel is None else self.panel.image(at if s is None else replace(at, parameter=s)),
        )

    def falling_picture(self, time: float) -> Image.Image:
        """Falls in time are those of the plane."""
        raise NotImplementedError

    def show_motion(self, swing: Swing) -> None:
        """Show by tints, arrows and the edges of where they were how the parts of a mechanism move.

        Of more than ``MOST_PARTS`` parts the speed is tinted instead, and arrows stand on a grid.

        Parameters
        ----------
        swing : Swing
        """
        assembly, scene, parts = self.assembly, self.scene, swing.parts
        n = int(parts.max(initial=-1)) + 1
        if n <= MOST_PARTS:
            chosen = [np.flatnonzero(parts == part) for part in range(n)]
        else:
            places = self.view.projected(swing.increment.pose.positions)
            cell = np.floor(places / (0.09 * scene.frame.size.max())).astype(np.int64)
            moves = np.flatnonzero(parts >= 0)
            # Of the blocks behind each other the first is seen.
            moves = moves[np.argsort(-self.view.depth(swing.increment.pose.positions[moves]), kind="stable")]
            _, first = np.unique(cell[moves], axis=0, return_index=True)
            chosen = [moves[[k]] for k in first]
        self.tints = mechanism_colours(assembly, self.fill, swing)
        self._motion = swing.displaced
        edges = solver.moved_vertices(assembly, swing.increment.pose)[self.scene.edges]
        moving = (parts >= 0)[assembly.block_of_vertex[self.scene.edges[:, 0]]]
        scene.lines("before", edges[moving], palette.GHOST, scene.size[1] / 900.0)
        tails, tips = np.zeros((2, len(chosen), 3))
        for k, blocks in enumerate(chosen):
            weight = assembly.shapes.volumes[blocks] / assembly.shapes.volumes[blocks].sum()
            tails[k] = weight @ swing.increment.pose.positions[blocks]
            tips[k] = solver.carried(tails[[k]], blocks[:1], swing.increment.pose, swing.displaced)[0]
        tips += (LONGER - 1.0) * (tips - tails)
        self._overlay = _arrows(scene.at_pixel(tails), scene.at_pixel(tips), scene.size[1] / 130.0)

    def keys(self) -> list[Key]:
        """Return the legend: what is marked in any of the increments, so that it is the same in all pictures."""
        if self._keys is None:
            keys = []
            if self.tints is not None:
                together = int(self._swing.parts.max(initial=-1)) + 1 <= MOST_PARTS
                colour = palette.PARTS[0] if together else palette.RAMP[5]
                words = "parts of the last mechanism" if together else "faster in the last mechanism"
                keys.append(Key("area", words, (int(colour[0]), int(colour[1]), int(colour[2]))))
            if "open" in self._marked:
                widest = f", darkest at {_opening_text(self._widest)}" if self._widest > 0.0 else ""
                keys.append(Key("area", f"open joint{widest}", palette.OPEN))
            if not self.many:
                keys += [Key("line", "sliding joint", palette.SLIDING)] if "sliding" in self._marked else []
                keys += [Key("line", "hinge", palette.HINGE)] if "hinge" in self._marked else []
            if self._force_length > 0.0:
                text = "compression " if self.look.forces == "thrust" else "contact force "
                keys.append(Key("line", f"{text}up to {force_text(self._strongest)}", palette.FORCE))
            if self.assembly.moving.any():
                keys.append(Key("area", "moving support", palette.MOVING))
            if self._strongest_live > 0.0:
                keys.append(Key("line", "live load × α", palette.LIVE))
            if self._motion is not None:
                keys.append(Key("line", "motion (not to scale)", palette.SETTLEMENT))
            self._keys = keys
        return self._keys

    def _shown(self, increment: solver.Increment) -> solver.Increment:
        """Give the state that governs the motion of the mechanism that follows it."""
        return self._swing.increment if increment is self.response.governing else increment

    def _block_colours(self, pose: solver.Pose) -> np.ndarray | None:
        if self.look.colour_by != "displacement":
            return self.tints
        moved = np.linalg.norm(pose.positions - self.assembly.centroids, axis=1)
        colours = palette.displacement_colours(moved / (self.largest or 1.0))
        return np.where(self.assembly.free[:, None], colours, self.fill)

    def _draw_joints(self, increment: solver.Increment, shown: solver.Pose) -> None:
        if not self.look.joints:
            return
        scene, thin = self.scene, self.scene.size[1] / 1080.0
        found = solid_marks(self.assembly, self.joints, increment, shown)
        self._draw_cracks(found, thin)
        if self.many:
            return
        scene.lines("sliding", found.sliding, palette.SLIDING, max(4.0 * thin, 1.6), forward=3.0)
        scene.polygons("exposed", found.exposed, _tuple(0.6 * np.asarray(palette.SLIDING) + 102.0), forward=0.5)
        width = max(7.0 * thin, 2.4)
        scene.lines("hinge rim", found.hinges, palette.PAPER, 1.8 * width, forward=4.0)
        scene.lines("hinge", found.hinges, palette.HINGE, width, forward=5.0)
        dashes = _dashed(found.hinges, 12.0 * max(thin, 0.6) * scene.pixel)
        scene.lines("hidden hinge", dashes, palette.HINGE, 0.22 * width, forward=IN_FRONT_OF_ALL)

    def _draw_cracks(self, found: SolidMarks, thin: float) -> None:
        """Fill what lies between faces, and draw a line where that would be too thin to see."""
        scene, size = self.scene, self.assembly.block_size
        colours = palette.crack_colours(found.openings / (self._widest or 1.0))
        narrow = ~found.gapes
        corners = colours[:, [0, 1, 1, 0]][narrow]
        scene.polygons("crack", found.cracks[narrow], corners.reshape(-1, 3))
        middle = (found.cracks[:, [0, 1]] + found.cracks[:, [3, 2]]) / 2.0
        faces = np.concatenate([found.cracks[found.gapes][:, [0, 1]], found.cracks[found.gapes][:, [3, 2]]])
        width = found.openings.max(axis=1, initial=0.0) / size
        fine, wide = width < FINE_CRACK, width * self.look.magnification > WIDE_CRACK
        line = narrow & ~wide
        scene.lines("crack line", middle[line & ~fine], colours[line & ~fine], max(2.2 * thin, 1.2), forward=2.0)
        scene.lines("crack line/fine", middle[line & fine], colours[line & fine], max(1.4 * thin, 1.0), forward=2.0)
        several = np.tile(colours[found.gapes], (2, 1, 1))
        scene.lines("crack line/faces", faces, several, max(2.4 * thin, 1.2), forward=2.0)

    def _draw_forces(self, increment: solver.Increment, shown: solver.Pose) -> None:
        if self._force_length == 0.0:
            return
        if increment.status == solver.Status.FALLING:
            # Without equilibrium the forces have no meaning.
            self.scene.clear("force", "force line")
            return
        points, forces, blocks = joint_forces(increment, self.look.forces)
        size = np.linalg.norm(forces, axis=1)
        kept = size > SMALLEST_RESULTANT * size.max(initial=0.0)
        points, forces, blocks = points[kept], forces[kept], blocks[kept]
        points = solver.carried_between(points, blocks[:, 0], blocks[:, 1], increment.pose, shown)
        half = 0.5 * self._force_length * forces
        ends = np.stack([points - half, points + half], axis=1)
        # They lie inside the blocks.
        width = max(2.5, self.scene.size[1] / 240.0)
        self.scene.lines("force", ends, palette.FORCE, width, forward=IN_FRONT_OF_ALL)
        if self.look.forces == "thrust":
            line = thrust_line(points, blocks, self.assembly)
            self.scene.lines("force line", line, palette.FORCE, 0.6 * width, forward=IN_FRONT_OF_ALL)

    def _length_per_force(self) -> float:
        """Length per force [m/N]; 0 where none is drawn."""
        if self._strongest == 0.0:
            return 0.0
        every = np.concatenate(self._sizes)
        drawn = every[every > SMALLEST_RESULTANT * self._strongest]
        extent = float(self.scene.frame.size.max())
        return length_per_force(drawn, self._strongest, 1.3 * self.assembly.block_size, extent)

    def _settlement(self, increment: solver.Increment) -> solver.Settlement | None:
        phases = self.response.settlements
        return phases[min(increment.phase, len(phases) - 1)] if phases else None

    def _arrow_tips(self, extra: tuple[solver.Pose, ...]) -> np.ndarray:
        """(n, 2) array [m]: where the arrows end in the picture: first, last, and at the extra poses."""
        tips = [np.zeros((0, 3))]
        first, last = (self.increments[k] for k in (0, -1))
        for increment, pose in ((first, first.pose), (last, last.pose), *((last, pose) for pose in extra)):
            settlement = self._settlement(increment)
            if settlement is not None:
                _, places, directions = settlement_arrows_in_space(self.assembly, settlement, pose)
                tips.append(places + self._arrow * directions)
            if self._strongest_live > 0.0:
                ends, along, _ = live_arrows(self.assembly, self.response.loads, _multiplier(increment), pose)
                tips.append(ends - self._arrow * along)
        return self.view.projected(np.concatenate(tips))

    def _draw_settlement(self, increment: solver.Increment, shown: solver.Pose) -> None:
        settlement = self._settlement(increment)
        if settlement is not None:
            _, places, directions = settlement_arrows_in_space(self.assembly, settlement, shown)
            self.scene.arrows("settlement", places, directions, self._arrow)

    def _draw_live_load(self, increment: solver.Increment, shown: solver.Pose) -> None:
        """Draw the live load times its multiplier as arrows to scale that end where it meets the blocks."""
        if self._strongest_live == 0.0:
            return
        tips, directions, sizes = live_arrows(self.assembly, self.response.loads, _multiplier(increment), shown)
        long = self._arrow * sizes / self._strongest_live
        self.scene.arrows("live load", tips - long[:, None] * directions, directions, long, palette.LIVE)


def _dashed(ends: np.ndarray, length: float) -> np.ndarray:
    """(m, 2, 3) array [m]: dashes of a length [m], with gaps as long, along lines (n, 2, 3)."""
    along = ends[:, 1] - ends[:, 0]
    counts = np.maximum(1, np.round(np.linalg.norm(along, axis=1) / (2.0 * length))).astype(int)
    line = np.repeat(np.arange(len(ends)), counts)
    place = np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)
    # Half a gap at either end.
    shares = (place[:, None] + np.array([0.25, 0.75])) / counts[line][:, None]
    return ends[line, :1] + shares[:, :, None] * along[line][:, None]


def _multiplier(increment: solver.Increment) -> float:
    """Load multiplier of an increment; 0 in a fall and where it is not bounded."""
    known = increment.status == solver.Status.EQUILIBRIUM and np.isfinite(increment.load_multiplier)
    return float(increment.load_multiplier) if known else 0.0


def _opening_text(length: float) -> str:
    return f"{1e3 * length:.2g} mm" if length < 0.0995 else f"{length:.2g} m"


def _tuple(colour: Any) -> tuple[int, int, int]:
    return int(colour[0]), int(colour[1]), int(colour[2])


def _arrows(tails: np.ndarray, tips: np.ndarray, thick: float) -> list[tuple[tuple[int, int, int], np.ndarray]]:
    """Polygons of arrows from tails (n, 2) to tips (n, 2) [pixels] with a white rim, back to front."""
    shapes: list[tuple[tuple[int, int, int], np.ndarray]] = []
    for grown, colour in ((0.35 * thick, palette.PAPER), (0.0, palette.SETTLEMENT)):
        shapes += [(colour, polygon) for kind in arrow_shapes(tails, tips, thick, grown) for polygon in kind]
    return shapes


def _painted(picture: Image.Image, shapes: list[tuple[tuple[int, int, int], np.ndarray]]) -> Image.Image:
    """Paint polygons, (k, 2) pixels each, over a picture, with exact edges."""
    if not shapes:
        return picture
    renderer = RendererAgg(*picture.size, 72.0)
    pixels = np.asarray(renderer.buffer_rgba())
    pixels[...] = np.asarray(picture.convert("RGBA"))
    upright = Affine2D().scale(1.0, -1.0).translate(0.0, picture.size[1])
    for colour, polygon in shapes:
        pen = renderer.new_gc()
        pen.set_linewidth(0.0)
        pen.set_snap(False)
        renderer.draw_path(pen, Path(polygon), upright, tuple(c / 255.0 for c in colour))
    return Image.fromarray(pixels[..., :3].copy())
