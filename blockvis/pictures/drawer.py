"""Drawer: one set-up for all pictures of a response: scene, sheet, legend, caption, and the frames of the film."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

import solver
from blockvis.dynamics.fall import CAPTION, Fall, falling_increment
from blockvis.results.cracks import cracks_of
from blockvis.results.joints import faces_at, initial_joints
from blockvis.text import force_text, rounded_length

from . import palette
from .annotations import (
    SMALLEST_RESULTANT,
    length_per_force,
    marks_of,
    part_outlines,
    resultants,
    settlement_arrows,
)
from .captions import FAILED_BADGE, FALL_BADGE, badge_of, caption_of, matters
from .flat_scene import Scene, magnified
from .frame import ColourBar, Key, Sheet, framed, write_labels
from .live_load import LiveLoads
from .swing import MOST_PARTS, Swing, mechanism_colours, swing_of

if TYPE_CHECKING:
    from .curves import CurvePanel

#: Above this many blocks, resultants and hinges clutter the picture.
FEW_BLOCKS = 300

#: Joints open by less than this fraction of the block size are drawn half as wide.
FINE_CRACK = 0.01

#: Joints open by more than this fraction need no line: the middle of a wide crack may lie on a third block.
WIDE_CRACK = 0.2

#: Layers that a fall in time has not.
OF_STATICS = (
    *("crack", "crack edge", "sliding", "hinge", "hinge top", "force", "force line", "ground"),
    *("arrow rim", "arrow top", "live rim", "live top"),
)

#: Most crack lines whose width is written, and the least part of the widest that is worth a word.
MOST_WIDTHS, LEAST_WIDTH = 6, 0.05

#: The scale of the forces is taken from this many increments.
FORCES_OF = 100


@dataclass(frozen=True)
class Look:
    """What the pictures show.

    Attributes
    ----------
    magnification : float
        Of displacements and rotations; 1 is true scale.
    colour_by : {"material", "mechanism", "displacement"}
        By "mechanism" the parts that move as one after the last equilibrium are tinted.
    forces : {"auto", "thrust", "points", "none"}
        Resultant of each joint, forces at the contact points, or neither; "auto" draws the resultants of structures
        with up to ``FEW_BLOCKS`` blocks.
    joints : bool
        Mark open and sliding joints and hinges.
    """

    magnification: float = 1.0
    colour_by: str = "material"
    forces: str = "auto"
    joints: bool = True

    def __post_init__(self) -> None:
        """Check the values."""
        if not (np.isfinite(self.magnification) and self.magnification > 0.0):
            raise ValueError(f"magnification is {self.magnification:g}; it must be a positive number, 1 is true scale")
        for name, allowed in (
            ("colour_by", ("material", "mechanism", "displacement")),
            ("forces", ("auto", "thrust", "points", "none")),
        ):
            if getattr(self, name) not in allowed:
                raise ValueError(f"{name} is '{getattr(self, name)}'; choose from {', '.join(allowed)}")


@dataclass
class _Seen:
    """What must be the same in all pictures of some increments.

    Attributes
    ----------
    sampled : frozenset of int
        Numbers of the increments whose forces set the scale.
    largest : float [m]
        Displacement of any free block.
    cracks, sliding, hinges : bool
        Whether there are any anywhere.
    largest_force : float [N]
    forces : list of arrays [N]
        Sizes, of the increments sampled.
    """

    sampled: frozenset[int]
    largest: float = 0.0
    cracks: bool = False
    sliding: bool = False
    hinges: bool = False
    largest_force: float = 0.0
    forces: list[np.ndarray] = field(default_factory=list)


class Drawer:
    """A scene and its sheet, set up for some increments of one response.

    Parameters
    ----------
    response : solver.Response
    look : Look
    size : (int, int)
        Width and height of the pictures in pixels.
    increments : tuple of solver.Increment
        All that will be drawn: they share frame, scales and legend.
    curve : bool
        Whether the curve stands beside the blocks.
    extra : tuple of solver.Pose
        Poses that the frame has to hold, too.
    fall : Fall, optional
        What comes after the last equilibrium; its frames are drawn beside those of the increments.
    """

    def __init__(
        self,
        response: solver.Response,
        look: Look,
        size: tuple[int, int],
        increments: tuple[solver.Increment, ...],
        *,
        curve: bool = False,
        extra: tuple[solver.Pose, ...] = (),
        fall: Fall | None = None,
    ) -> None:
        automatic = look.forces == "auto"
        if automatic:
            few = response.assembly.n_blocks <= FEW_BLOCKS
            look = replace(look, forces="thrust" if few else "none")
        self._forces_hidden = automatic and look.forces == "none"
        self.response, self.look, self.increments, self.fall = response, look, increments, fall
        assembly = self.assembly = response.assembly
        self.joints = initial_joints(assembly)
        self._swing = swing_of(response) if look.colour_by == "mechanism" else None
        self._seen = _Seen(sampled=sampled([k for k, i in enumerate(increments) if matters(i, response)]))
        falling = () if fall is None else map(fall.pose, range(len(fall)))
        frame = framed(assembly, chain([solver.Pose.initial(assembly)], self._surveyed(), extra, falling))
        self.largest = self._seen.largest
        bar = ColourBar(self.largest) if look.colour_by == "displacement" else None
        beside = round(0.36 * size[0]) if curve else 0
        self.sheet = Sheet(size, bar, beside)
        self.panel: CurvePanel | None = None
        if curve:
            # Figures and axes of matplotlib are loaded where a curve is drawn only.
            from .curves import CurvePanel

            self.panel = CurvePanel(response, size_of(self.sheet.beside), self.sheet.text)
        self.live = LiveLoads(response, increments, float(frame.size.max()))
        frame = frame.holding(self.live.tails)
        fill = palette.block_colours(assembly.materials, assembly.free)
        self.fill = fill
        self._loses = bool(response.losses)
        self.tints: np.ndarray | None = None
        self.scene = Scene(assembly, frame, self.sheet.inside_size, fill)
        self.force_scale, self.force_shown = self._force_scale()
        self._show_start()
        if fall is not None:
            self._show_ground(fall.ground)
        if self._swing is not None and self._swing.moves:
            self.tints = mechanism_colours(self.assembly, self.fill, self._swing)
        self._keys: list[Key] | None = None

    def _surveyed(self) -> Iterator[solver.Pose]:
        """Yield the poses as shown, and note what must be the same in all pictures.

        Increments may come from files: each is read once, and none of its arrays is kept.
        """
        seen, look = self._seen, self.look
        for number, increment in enumerate(self.increments):
            seen.largest = max(seen.largest, largest_displacement(self.assembly, increment))
            if look.joints:
                found = marks_of(self.assembly, self.joints, self._shown(increment), increment.pose)
                seen.cracks |= len(found.cracks) + len(found.faces) > 0
                seen.sliding |= len(found.sliding) > 0
                seen.hinges |= len(found.hinges) > 0
            if look.forces != "none" and matters(increment, self.response):
                sizes = np.hypot(*joint_forces(increment, look.forces)[1].T)
                seen.largest_force = max(seen.largest_force, float(sizes.max(initial=0.0)))
                if number in seen.sampled:
                    seen.forces.append(sizes)
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
        blocks_only: bool = False,
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
        blocks_only : bool
            Leave out what statics knows: joints, forces, what stands on what, and where supports go.
        widths : bool
            Write the largest width of the widest crack lines beside them [mm].
        """
        increment = increment if pose is not None else self._shown(increment)
        true = increment.pose if pose is None else pose
        shown = magnified(self.assembly, true, self.look.magnification)
        at = increment.with_arrays(pose=true, contacts=contacts_at(increment, true)) if pose is not None else increment
        self.scene.pose(shown, self._block_colours(true, increment.fallen))
        hinges = np.zeros((0, 2))
        if blocks_only:
            self.scene.clear(*OF_STATICS)
        else:
            hinges = self._draw_joints(at, shown)
            self._draw_forces(at, shown)
            self._draw_ground(shown)
            self._draw_settlement_arrow(at, shown)
            self._draw_live_load(increment, shown)
        falling = increment.status == solver.Status.FALLING
        failed = self.response.stop == solver.Status.SOLVER_FAILED
        head, detail = caption_of(self.response, increment, self.look.magnification)
        picture = self.scene.image()
        if widths and self.look.joints and not falling:
            self._write_widths(picture, at, shown, hinges)
        return self.sheet.composed(
            picture,
            title=title or head,
            detail=note or detail,
            badge=badge or (badge_of(self.response) if falling else FAILED_BADGE if failed else ""),
            keys=self._keys_drawn(increment),
            places=self.keys(),
            pixel=self.scene.pixel,
            beside=None if self.panel is None else self.panel.image(at if s is None else replace(at, parameter=s)),
        )

    def falling_picture(self, time: float) -> Image.Image:
        """Draw the fall at a time [s] after the last equilibrium."""
        assert self.fall is not None
        return self.picture(
            falling_increment(self.response, self.fall.at(time)),
            title=f"Fall   ·   {time:.2f} s after the last equilibrium",
            note=f"{CAPTION}   ·   true scale",
            badge=FALL_BADGE,
            blocks_only=True,
        )

    def show_motion(self, swing: Swing) -> None:
        """Show by tints, outlines and arrows where a mechanism takes the parts that move as one.

        Of more than ``MOST_PARTS`` parts the speed is tinted instead, and arrows stand on a grid.

        Parameters
        ----------
        swing : Swing
        """
        assembly, scene, pose, displaced, parts = (
            self.assembly, self.scene, swing.increment.pose, swing.displaced, swing.parts,
        )  # fmt: skip
        n = int(parts.max(initial=-1)) + 1
        if n <= MOST_PARTS:
            outlines = part_outlines(assembly, solver.moved_vertices(assembly, displaced), parts)
            scene.lines("motion outline", outlines, palette.SETTLEMENT, self.scene.size[1] / 600.0)
            chosen = [np.flatnonzero(parts == part) for part in range(n)]
        else:
            cell = np.floor(pose.positions / (0.07 * scene.frame.size.max())).astype(np.int64)
            moves = np.flatnonzero(parts >= 0)
            _, first = np.unique(cell[moves], axis=0, return_index=True)
            chosen = [moves[[k]] for k in first]
        self.tints = mechanism_colours(self.assembly, self.fill, swing)
        scene.pose(pose, self.tints)
        tails, tips = np.zeros((len(chosen), 2)), np.zeros((len(chosen), 2))
        for k, blocks in enumerate(chosen):
            weight = assembly.areas[blocks] / assembly.areas[blocks].sum()
            tails[k] = weight @ pose.positions[blocks]
            tips[k] = solver.carried(tails[[k]], blocks[:1], pose, displaced)[0]
        self._arrows("motion", tails, tips, 0.6)

    def keys(self) -> list[Key]:
        """Return what is marked in any of the increments, each with its place in the legends of all pictures."""
        if self._keys is None:
            keys = self._keys_of_tints()
            if self.look.joints:
                seen = self._seen
                keys += [Key("area", "open joint", palette.OPEN, layers=("crack", "crack edge"))] if seen.cracks else []
                marked = [
                    *([Key("line", "sliding joint", palette.SLIDING, layers=("sliding",))] if seen.sliding else []),
                    *([Key("dot", "hinge", palette.HINGE, layers=("hinge",))] if seen.hinges else []),
                ]
                # They would hide the cracks: in a wall of many blocks nearly every brick turns or slides a little.
                hidden = " and ".join(f"{key.text}s" for key in marked[::-1])
                keys += marked if not self.many else [Key("", f"{hidden} not shown", palette.FAINT)] if hidden else []
            if self.force_shown > 0:
                text = ("compression " if self.look.forces == "thrust" else "contact force ") + force_text(
                    self.force_shown
                )
                length = self.force_shown * self.force_scale / self.scene.pixel
                keys.append(Key("bar", text, palette.FORCE, length, ("force",)))
            if self._forces_hidden:
                keys.append(Key("", "forces not shown", palette.FAINT))
            if self.live.largest > 0.0:
                keys.append(Key("line", self.live.words, palette.LIVE, layers=("live top",)))
            motion = "motion outline", "motion top"
            if self.scene.holds(*motion):
                keys.append(Key("line", "motion (not to scale)", palette.SETTLEMENT, layers=motion))
            self._keys = keys
        return self._keys

    def _keys_drawn(self, increment: solver.Increment) -> list[Key]:
        """Return the legend of the picture that the scene holds; what was left out is told where statics has it."""
        falling = increment.status == solver.Status.FALLING
        return [
            key
            for key in self.keys()
            if (self.scene.holds(*key.layers) if key.layers else bool(key.kind) or not falling)
        ]

    def _keys_of_tints(self) -> list[Key]:
        """Return what the legend says of the colours of the blocks."""
        if self._swing is None or not self._swing.moves:
            return []
        together = int(self._swing.parts.max(initial=-1)) + 1 <= MOST_PARTS
        red, green, blue = palette.PARTS[0] if together else palette.RAMP[5]
        words = "parts of the last mechanism" if together else "faster in the last mechanism"
        return [Key("area", words, (int(red), int(green), int(blue)))]

    @property
    def many(self) -> bool:
        """Whether dots and arrows at every joint would hide the blocks."""
        return self.assembly.n_blocks > FEW_BLOCKS

    def _shown(self, increment: solver.Increment) -> solver.Increment:
        """Give the state that governs the motion of the mechanism that follows it."""
        governs = self._swing is not None and increment is self.response.governing
        return self._swing.increment if self._swing is not None and governs else increment

    def _block_colours(self, pose: solver.Pose, fallen: np.ndarray) -> np.ndarray | None:
        colours = self._standing_colours(pose)
        if not self._loses:
            return colours
        return palette.pale(self.fill if colours is None else colours, fallen)

    def _standing_colours(self, pose: solver.Pose) -> np.ndarray | None:
        if self.look.colour_by != "displacement":
            return self.tints
        moved = pose.displacements(self.assembly)[:, :2]
        colours = palette.displacement_colours(np.hypot(*moved.T) / (self.largest or 1.0))
        return np.where(self.assembly.free[:, None], colours, self.fill)

    def _draw_joints(self, increment: solver.Increment, shown: solver.Pose) -> np.ndarray:
        """Draw open and sliding joints and hinges; returns where the dots of the hinges are, (n, 2) [m]."""
        if not self.look.joints:
            return np.zeros((0, 2))
        scene, thin = self.scene, self.scene.size[1] / 1080.0
        found = marks_of(self.assembly, self.joints, increment, shown)
        scene.polygons("crack", found.cracks, palette.OPEN)
        middle = (found.cracks[:, [0, 1]] + found.cracks[:, [3, 2]]) / 2.0 if len(found.cracks) else found.cracks
        width = found.openings / self.assembly.block_size
        fine, wide = width < FINE_CRACK, width * self.look.magnification > WIDE_CRACK
        scene.lines("crack edge", middle[~fine & ~wide], palette.OPEN, self._line(2.2 * thin))
        scene.lines("crack edge/faces", found.faces, palette.OPEN, self._line(3.0 * thin))
        scene.lines("crack edge/fine", middle[fine], palette.OPEN, self._line(1.1 * thin))
        if self.many:
            return np.zeros((0, 2))
        scene.lines("sliding", found.sliding, palette.SLIDING, self._line(5.0 * thin))
        radius = float(np.clip(0.09 * self.assembly.block_size / scene.pixel, 3.0 * thin, 11.0 * thin))
        scene.discs("hinge/rim", found.hinges, radius * 1.35, palette.PAPER)
        scene.discs("hinge top", found.hinges, radius, palette.HINGE)
        return found.hinges

    def _write_widths(
        self, picture: Image.Image, increment: solver.Increment, shown: solver.Pose, hinges: np.ndarray
    ) -> None:
        """Write the widths of the widest crack lines of an increment beside them, where there is room."""
        cracks = cracks_of(self.assembly, increment.pose, self.joints, increment.fallen)[: 2 * MOST_WIDTHS]
        cracks = [crack for crack in cracks if crack.width >= LEAST_WIDTH * cracks[0].width]
        on_a, on_b, _ = faces_at(self.assembly, self.joints, shown)
        widest = [int(crack.joints[0]) for crack in cracks]
        places = self.scene.at_pixel((on_a + on_b)[widest].mean(axis=1) / 2.0)
        words = [f"{1e3 * crack.width:.3g} mm" for crack in cracks]
        write_labels(picture, places, words, self.sheet.text, MOST_WIDTHS, self.scene.at_pixel(hinges))

    def _line(self, pixels: float) -> float:
        return max(pixels, 1.2)

    def _draw_forces(self, increment: solver.Increment, shown: solver.Pose) -> None:
        if self.look.forces == "none" or self.force_shown == 0:
            return
        scene = self.scene
        if increment.status == solver.Status.FALLING:
            # Without equilibrium the forces have no meaning.
            scene.clear("force", "force line")
            return
        points, forces, blocks = joint_forces(increment, self.look.forces)
        size = np.hypot(*forces.T)
        kept = size > SMALLEST_RESULTANT * size.max(initial=0.0)
        points, forces, blocks, size = points[kept], forces[kept], blocks[kept], size[kept]
        points = solver.carried_between(points, blocks[:, 0], blocks[:, 1], increment.pose, shown)
        unit = forces / size[:, None]
        half = unit * (0.5 * self.force_scale * size)[:, None]
        thick = 0.5 * max(2.0, scene.size[1] / 320.0) * scene.pixel
        side = np.stack([-unit[:, 1], unit[:, 0]], axis=1) * thick
        bars = [points - half - side, points + half - side, points + half + side, points - half + side]
        scene.polygons("force", np.stack(bars, axis=1), palette.FORCE)
        if self.look.forces == "thrust":
            scene.lines("force line", thrust_line(points, blocks, self.assembly), palette.FORCE, scene.size[1] / 500.0)

    def _force_scale(self) -> tuple[float, float]:
        """Length per force [m/N] and the force of the legend [N]; 0 where none is drawn."""
        largest = self._seen.largest_force
        if largest == 0.0:
            return 0.0, 0.0
        every = np.concatenate(self._seen.forces)
        every = every if every.max(initial=0.0) > 0.0 else np.full(1, largest)
        drawn, extent = every[every > SMALLEST_RESULTANT * largest], float(self.scene.frame.size.max())
        scale = length_per_force(drawn, largest, 1.3 * self.assembly.block_size, extent)
        return scale, rounded_length(min(largest, 0.12 * extent / scale))

    def _show_start(self) -> None:
        """Draw the first position of the moving supports, behind everything."""
        moving = self.assembly.moving[self.assembly.block_of_vertex]
        start = _edges(self.assembly, self.assembly.vertices)[moving]
        self.scene.lines("ghost", start, palette.GHOST, self.scene.size[1] / 800.0)

    def _show_ground(self, height: float) -> None:
        """Draw the ground line over the whole width, hatched below, behind everything."""
        frame, tick = self.scene.frame, self.scene.size[1] / 60.0 * self.scene.pixel
        (left, _), (right, _) = frame.low, frame.high
        self.scene.lines(
            "earth", np.array([[[left, height], [right, height]]]), palette.HATCH, max(1.2, self.scene.size[1] / 400.0)
        )
        x = np.arange(left, right + tick, tick)
        ticks = np.stack(
            [np.stack([x, x - tick], axis=1), np.broadcast_to([height, height - tick], (len(x), 2))], axis=2
        )
        self.scene.lines("earth/hatch", ticks, palette.HATCH, max(0.7, self.scene.size[1] / 1000.0))

    def _draw_ground(self, shown: solver.Pose) -> None:
        """Draw a heavy line where supports carry the structure."""
        joints, free = self.joints, self.assembly.free
        drawn = solver.Pose.initial(self.assembly)
        lines = []
        for block, other in ((joints.block_a, joints.block_b), (joints.block_b, joints.block_a)):
            on = ~free[block] & free[other]
            ends = [solver.carried(joints.ends[on, k], block[on], drawn, shown) for k in (0, 1)]
            lines.append(np.stack(ends, axis=1))
        self.scene.lines("ground", np.concatenate(lines), palette.INK, max(1.2, self.scene.size[1] / 320.0))

    def _draw_live_load(self, increment: solver.Increment, shown: solver.Pose) -> None:
        """Draw the live load times its multiplier as arrows to scale that end where it acts."""
        if self.live.largest > 0.0:
            self._arrows("live", *self.live.arrows(increment, shown), 0.55, palette.LIVE)

    def _draw_settlement_arrow(self, increment: solver.Increment, shown: solver.Pose) -> None:
        assembly, scene = self.assembly, self.scene
        if not self.response.settlements:
            return
        phase = self.response.settlements[min(increment.phase, len(self.response.settlements) - 1)]
        _, places, directions = settlement_arrows(assembly, phase, shown, scene.frame.low, scene.frame.high)
        half = 0.0275 * float(scene.frame.size.max()) * directions[directions.any(axis=1)]
        places = places[directions.any(axis=1)]
        self._arrows("arrow", places - half, places + half, 1.0)

    def _arrows(
        self,
        layer: str,
        tails: np.ndarray,
        tips: np.ndarray,
        weight: float,
        fill: tuple[int, int, int] = palette.SETTLEMENT,
    ) -> None:
        scene = self.scene
        thick = weight * scene.size[1] / 110.0 * scene.pixel
        for name, grown, colour in (("rim", 1.0, palette.PAPER), ("top", 0.0, fill)):
            shafts, heads = arrow_shapes(tails, tips, thick, grown * weight * scene.size[1] / 360.0 * scene.pixel)
            scene.polygons(f"{layer} {name}/shaft", shafts, colour)
            scene.polygons(f"{layer} {name}/head", heads, colour)


def sampled(numbers: list[int]) -> frozenset[int]:
    """Up to ``FORCES_OF`` of the numbers, evenly chosen."""
    chosen = np.linspace(0, len(numbers) - 1, min(len(numbers), FORCES_OF)).round().astype(int)
    return frozenset(numbers[k] for k in chosen)


def arrow_shapes(tails: np.ndarray, tips: np.ndarray, thick: float, grown: float) -> tuple[np.ndarray, np.ndarray]:
    """Shafts (n, 4, 2) and heads (n, 3, 2) of arrows, a margin ``grown`` larger all around [m]."""
    along = tips - tails
    length = np.hypot(*along.T)
    kept = length > 1.2 * thick
    tails, tips, along, length = tails[kept], tips[kept], along[kept], length[kept]
    unit = along / length[:, None]
    side = np.stack([-unit[:, 1], unit[:, 0]], axis=1)
    head = np.minimum(2.6 * thick, 0.6 * length)[:, None]
    neck = tips - head * unit
    half = thick / 2.0 + grown
    start = tails - grown * unit
    shafts = np.stack([start - half * side, neck - half * side, neck + half * side, start + half * side], axis=1)
    wing = 0.55 * head + 1.6 * grown
    back, tip = neck - grown * unit, tips + 2.0 * grown * unit
    heads = np.stack([back - wing * side, tip, back + wing * side], axis=1)
    return shafts, heads


def joint_forces(increment: solver.Increment, kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find points (n, d) [m], forces (n, d) [N] and blocks (n, 2) of the resultants, or by "points" of all contacts."""
    if kind == "thrust":
        return resultants(increment)
    contacts = increment.contacts
    carrying = increment.forces[:, 0] > 0.0
    force = np.einsum("ki,kij->kj", increment.forces, contacts.frames)
    blocks = np.stack([contacts.block_a, contacts.block_b], axis=1)
    return contacts.points[carrying], force[carrying], blocks[carrying]


def thrust_line(points: np.ndarray, blocks: np.ndarray, assembly: solver.Assembly) -> np.ndarray:
    """(n, 2, d) array [m]: the line from joint to joint, where every block has two at most: an arch, a column."""
    owner = np.concatenate([blocks[:, 0], blocks[:, 1]])
    which = np.concatenate([np.arange(len(blocks))] * 2)
    counts = np.bincount(owner, minlength=assembly.n_blocks)
    if counts[assembly.free].max(initial=0) > 2:
        return np.zeros((0, 2, points.shape[1]))
    order = np.argsort(owner, kind="stable")
    owner, which = owner[order], which[order]
    pairs = (owner[1:] == owner[:-1]) & assembly.free[owner[1:]]
    return np.stack([points[which[:-1][pairs]], points[which[1:][pairs]]], axis=1)


def contacts_at(increment: solver.Increment, pose: solver.Pose) -> solver.Contacts:
    """Contact points of an increment, carried to a pose nearby."""
    contacts = increment.contacts
    points = solver.carried_between(contacts.points, contacts.block_a, contacts.block_b, increment.pose, pose)
    return replace(contacts, points=points)


def largest_displacement(assembly: solver.Assembly, increment: solver.Increment) -> float:
    """Largest displacement [m] of a corner of a free block since the layout."""
    moved = solver.moved_vertices(assembly, increment.pose) - assembly.vertices
    return float(np.linalg.norm(moved, axis=1)[assembly.free[assembly.block_of_vertex]].max(initial=0.0))


def _edges(assembly: solver.Assembly, corners: np.ndarray) -> np.ndarray:
    return np.stack([corners, corners[assembly.next_vertex]], axis=1)


def size_of(box: tuple[int, int, int, int]) -> tuple[int, int]:
    """Width and height of a box of left, top, right and bottom."""
    return box[2] - box[0], box[3] - box[1]
