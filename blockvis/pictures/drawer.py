"""Drawer: one set-up for all pictures of a response: scene, sheet, legend, caption, and the frames of the film."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

import solver
from blockvis.dynamics.fall import Fall, falling_increment
from blockvis.layout.sights import Cut, Sight
from blockvis.results.about import phases_of, settlement_in
from blockvis.results.cracks import cracks_of, main_areas
from blockvis.results.joint_faces import carried_between, initial_joints
from blockvis.text import force_text, rounded_length, width_text
from solver import mechanics

from . import palette
from .acting_loads import load_arrows
from .backfill import fill_bodies
from .captions import FAILED_BADGE, FALL_BADGE, badge_of, caption_of, fall_text, matters
from .flat_scene import FlatScene
from .frame import (
    BAR,
    CURVE,
    SEPARATOR,
    STILL_SIZE,
    ColourBar,
    Frame,
    Key,
    Sheet,
    along_lines,
    framed,
    sheet_size,
    write_labels,
)
from .marks import (
    ARROW,
    SMALLEST_RESULTANT,
    arrows_on_supports,
    evenly,
    joint_forces,
    length_per_force,
    marks_of,
    settlement_arrows,
    thrust_line,
)
from .scene import OF_STATICS
from .solid_view import View, heights_over, hiding_supports, into_sight, kept_blocks, plane_of, section_words, views_of
from .swing import FASTEST, MOST_PARTS, Swing, mechanism_colours, swing_of
from .ties import DASH, DrawnTies
from .underlay import Underlay

if TYPE_CHECKING:
    from .curves import CurvePanel
    from .paired_scenes import PairedScenes

#: Above this many blocks, resultants and hinges clutter the picture.
FEW_BLOCKS = 300

#: Entry of the legend of blocks that the structure has lost.
LOST = "lost block"

#: Empty border around free blocks in space, as a part of the larger side of the picture.
MARGIN = 0.03

#: Supports in space are shown whole where the picture is no larger for it than this many times the blocks: part of a
#: slab that ends just outside looks like a mistake.
WHOLE = 1.4


@dataclass(frozen=True)
class Look:
    """What the pictures show, as of :func:`blockvis.draw_still`; sight and cut are its view and section.

    In space the blocks are as of glass where forces are drawn, by "auto" none; in the plane "auto" draws the resultants
    of up to ``FEW_BLOCKS`` blocks.
    """

    magnification: float = 1.0
    colour_by: str = "material"
    forces: str = "auto"
    joints: bool = True
    sight: Sight | None = None
    cut: Cut | None = None

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
class _Series:
    """What must be the same in all pictures of some increments."""

    sampled: frozenset[int]  #: Numbers of the increments whose forces set the scale.
    largest: float = 0.0  #: [m] Displacement of any free block.
    widest: float = 0.0  #: [m] Opening of any crack in equilibrium.
    #: What there is anywhere of "cracks", "sliding", "hinges", "crushing", "lost" blocks, and joints with "pulls".
    marks: set[str] = field(default_factory=set)
    largest_force: float = 0.0  #: [N]
    forces: list[np.ndarray] = field(default_factory=list)  #: [N] Sizes, of the increments sampled.


class Drawer:
    """A scene and its sheet, set up for some increments of one response, which share frame, scales and legend.

    The curve stands beside the blocks where it is asked for. ``extra`` are poses that the frame has to hold, too, the
    fall comes after the last equilibrium, and the underlay is a photograph under blocks in the plane. Without a size
    the sheet follows what it shows, with as many pixels as is ``usual``; so many go ``across`` a page. ``still`` is one
    picture, worth more time than a frame of a film: in space with smooth edges, shaded corners, and of vaults and domes
    the intrados beside the extrados.

    Raises ``ValueError`` for a view or a section of blocks in the plane.
    """

    def __init__(
        self,
        response: solver.Response,
        look: Look,
        size: tuple[int, int] | None,
        increments: tuple[solver.Increment, ...],
        *,
        curve: bool = False,
        extra: tuple[solver.Pose, ...] = (),
        fall: Fall | None = None,
        underlay: Underlay | None = None,
        still: bool = False,
        usual: tuple[int, int] = STILL_SIZE,
        across: int = 1,
    ) -> None:
        assembly = self.assembly = response.assembly
        self._flat = assembly.dimension == 2
        if self._flat and (look.sight or look.cut):
            raise ValueError("view and section are of blocks in space; these lie in the plane: leave both out")
        self._underlay, self._still = underlay, still
        few = self._flat and not self.many
        self._forces_hidden = look.forces == "auto" and self._flat and not few
        if look.magnification != 1.0:
            # Between blocks that are magnified apart, points of contact have no place.
            look, self._forces_hidden = replace(look, forces="none"), False
        self.look = look = replace(look, forces="thrust" if few else "none") if look.forces == "auto" else look
        self.response, self.increments, self.fall = response, increments, fall
        self.joints = initial_joints(assembly)
        # The view of blocks in space is chosen by their mechanism.
        self._swing = swing_of(response) if look.colour_by == "mechanism" or not self._flat else None
        self._views = self._chosen_views()
        self._plane = plane_of(assembly, look.cut, self._views[0] if self._views else None)
        self.ties = DrawnTies(response, self._plane)
        numbers = np.array([k for k, i in enumerate(increments) if matters(i, response)], dtype=int)
        # A hundred states are enough for the scale of the forces.
        self._seen = _Series(sampled=frozenset(evenly(numbers, 100).tolist()))
        falling = () if fall is None else map(fall.pose, range(len(fall)))
        frame = self._framed(chain([solver.Pose.initial(assembly)], self._surveyed(), extra, falling))
        self.largest = self._seen.largest
        extent = float(frame.size.max())
        self.loads = load_arrows(response, increments, extent, self._plane)
        self._arrow = (ARROW if self._flat else 0.09) * float(frame.size.max())
        tied = self.ties.ends([increments[0].pose, increments[-1].pose])
        heads = fill_bodies(response, solver.Pose.initial(assembly)).heads.reshape(-1, assembly.dimension)
        ends = np.concatenate([heads, *self._arrow_ends(frame, extra), tied])
        tails = [loads.tails for loads in self.loads.values()]
        ends = np.concatenate([*tails, ends[heights_over(self._plane, ends) >= 0.0]])
        frame = self._with_floor(frame.holding(self._projected(ends)))
        bar = ColourBar(self.largest, fall is not None) if look.colour_by == "displacement" else None
        size = size or sheet_size(frame, usual, CURVE * curve + BAR * (bar is not None), across)
        self.sheet = Sheet(size, bar, curve, across)
        self.panel: CurvePanel | None = None
        if curve:
            # Figures and axes of matplotlib are loaded where a curve is drawn only.
            from .curves import CurvePanel

            left, top, right, bottom = self.sheet.beside
            self.panel = CurvePanel(response, (right - left, bottom - top), self.sheet.text)
        whole = frame.fitted(*self.sheet.inside_size) if self._flat else frame
        frame = frame.holding(self._projected(self._turned_out(whole)))
        # Supports in the plane are hatched, and an outline stays where those that move were.
        self.fill = palette.role_colours(assembly, not self._flat and bool(response.settlements))
        self.frame, self.scene = frame, self._scene(frame)
        self._loses = bool(response.losses)
        self.force_scale, self.force_shown = self._force_scale()
        self.tints: np.ndarray | None = None
        if look.colour_by == "mechanism" and self._swing is not None and self._swing.moves:
            self.tints = mechanism_colours(assembly, self.fill, self._swing)
        #: Where the blocks are drawn while a mechanism is shown.
        self._drawn_at: solver.Pose | None = None
        #: Ends (n, 2, d) [m] of the arrows in the picture, by layer: labels leave them free.
        self._arrows: dict[str, np.ndarray] = {}

    def _chosen_views(self) -> tuple[View, ...]:
        """Find from where blocks in space are drawn; films have one view."""
        if self._flat or self._swing is None:
            return ()
        motion = self._swing.displaced.positions - self._swing.increment.pose.positions
        views = views_of(self.response, motion, self.joints, self.look.sight, self.look.cut)
        return views if self._still else views[:1]

    @property
    def sight(self) -> Sight | None:
        """From where blocks in space are drawn, for other pictures that are to be from there; none in the plane."""
        return Sight(self._views[0].around, self._views[0].above) if self._views else None

    def _framed(self, poses: Iterable[solver.Pose]) -> Frame:
        if not self._views:
            return framed(self.assembly, poses)
        return framed(self.assembly, poses, margin=MARGIN, supports=0.3, axes=self._axes, whole=WHOLE, cut=self._plane)

    def _with_floor(self, frame: Frame) -> Frame:
        """Grow a frame downwards, not by much, to show where blocks in space stand on the ground of a fall."""
        if self._flat or self.fall is None:
            return frame
        feet = self._projected(self.assembly.vertices * [1.0, 1.0, 0.0] + [0.0, 0.0, self.fall.ground])
        lowest = frame.low - [0.0, 0.15 * float(frame.size.max())]
        return frame.holding(np.clip(feet, lowest, frame.high)[feet[:, 1] < frame.low[1]])

    @property
    def _axes(self) -> np.ndarray:
        """(2 n_views, 3) array: to the right and up in each view."""
        return np.concatenate([view.axes[:2] for view in self._views])

    def _scene(self, frame: Frame) -> FlatScene | PairedScenes:
        """Set up what draws blocks in the plane, or in space."""
        if not self._views:
            scene = FlatScene(self.assembly, frame, self.sheet.inside_size, self.fill, self._underlay)
            scene.show_start()
            if self.fall is not None:
                scene.show_ground(self.fall.ground)
            return scene
        # VTK takes seconds to import, and pictures in the plane need none.
        from .paired_scenes import PairedScenes

        # Forces are drawn inside the blocks.
        opacity = 1.0 if self.look.forces == "none" else 0.35
        pair = PairedScenes(
            self.assembly, self._views, frame, self.sheet, self.fill, opacity=opacity, fine=self._still, cut=self._plane
        )
        if self.fall is not None:
            pair.show_ground(self.fall.ground)
        return pair

    def share(self, drawers: Sequence[Drawer], usual: tuple[int, int], across: int, *, alike: bool) -> None:
        """Draw on a sheet for what any of several shows, this among them; blocks that are ``alike`` in one frame.

        Arrows of their supports are as long. The sheet is as without a size; it has no curve.
        """
        frames = [one.frame for one in drawers]
        if alike:
            self.frame = Frame(np.min([of.low for of in frames], axis=0), np.max([of.high for of in frames], axis=0))
            self._arrow = max(one._arrow for one in drawers)
        largest = np.max([of.size for of in ([self.frame] if alike else frames)], axis=0)
        size = sheet_size(Frame(np.zeros_like(largest), largest), usual, across=across)
        self.sheet = Sheet(size, self.sheet.colour_bar, across=across)
        self.scene.close()
        self.scene = self._scene(self.frame)
        self.force_scale, self.force_shown = self._force_scale()

    def _projected(self, points: np.ndarray) -> np.ndarray:
        """(n, d) array [m]: places in the picture, or in each of several, of points (n, d) [m]."""
        return points if not self._views else np.asarray(points @ self._axes.T)

    def _arrow_ends(self, frame: Frame, extra: tuple[solver.Pose, ...]) -> Iterator[np.ndarray]:
        """Yield where the arrows at supports begin and end: at first and last as shown, and at the extra poses."""
        first, last = (self.increments[k] for k in (0, -1))
        shown = [(one, magnified(self.assembly, one.pose, self.look.magnification)) for one in (first, last)]
        for increment, pose in (*shown, *((last, pose) for pose in extra)):
            yield from self._settlement_arrows(increment, pose, frame if self._flat else None)

    def _turned_out(self, frame: Frame) -> np.ndarray:
        """(n, d) array [m]: at last, the corners of moving supports that a frame holds as drawn: they stay in it."""
        pose = magnified(self.assembly, self.increments[-1].pose, self.look.magnification)
        last = mechanics.moved_vertices(self.assembly, pose)
        places = self._projected(self.assembly.vertices)
        held = ((frame.low < places) & (places < frame.high)).all(axis=1)
        left = heights_over(self._plane, last) >= 0.0
        return last[held & left & self.assembly.moving[self.assembly.block_of_vertex]]

    def _surveyed(self) -> Iterator[solver.Pose]:
        """Yield the poses as shown, and note what must be the same in all pictures.

        Increments may come from files: each is read once, and none of its arrays is kept.
        """
        seen, look = self._seen, self.look
        for number, increment in enumerate(self.increments):
            seen.largest = max(seen.largest, largest_displacement(self.assembly, increment))
            self.ties.survey(increment)
            if (increment.fallen & ~increment.removed).any():
                seen.marks.add("lost")
            if look.joints:
                found = marks_of(self.assembly, self.joints, self._shown(increment), increment.pose)
                if increment.status != solver.Status.FALLING:
                    seen.widest = max(seen.widest, float(found.openings.max(initial=0.0)))
                seen.marks |= {
                    kind for kind in ("cracks", "sliding", "hinges", "crushing") if len(getattr(found, kind))
                }
            if look.forces != "none" and matters(increment, self.response):
                sizes = np.linalg.norm(joint_forces(increment, look.forces)[1], axis=1)
                largest = float(sizes.max(initial=0.0))
                seen.largest_force = max(seen.largest_force, largest)
                if (increment.forces[:, 0] < -SMALLEST_RESULTANT * largest).any():
                    seen.marks.add("pulls")
                if number in seen.sampled:
                    seen.forces.append(sizes)
            yield magnified(self.assembly, increment.pose, look.magnification)
        if self.fall is not None and self.fall.tie_rest.size:
            for time in self.fall.times.tolist():
                self.ties.survey(falling_increment(self.response, self.fall, time))

    def picture(
        self,
        increment: solver.Increment,
        *,
        title: str = "",
        note: str = "",
        badge: str | None = None,
        blocks_only: bool = False,
        widths: bool = False,
    ) -> Image.Image:
        """Draw one increment, or a state between two.

        Title, note and badge, first and second line of the caption and the warning, stand in place of its own. Of
        ``blocks_only`` what statics knows is left out: joints, forces, what stands on what, where supports go. With
        ``widths`` the largest width of the widest crack lines is beside them [mm]; in space the legend has the largest.
        """
        increment = self._shown(increment)
        shown = self._drawn_at or magnified(self.assembly, increment.pose, self.look.magnification)
        if self._drawn_at is not None and self.response.changes:
            # A mechanism is that of what the last change has left.
            increment = without_removed(increment, self.response.increments[-1].state.fell_at)
        self.scene.hide(increment.removed)
        self.scene.pose(shown, self._block_colours(increment.pose, increment))
        if self._loses and isinstance(self.scene, FlatScene):
            self.scene.lost(increment.fallen & ~increment.removed)
        dots, falling = np.zeros((0, self.assembly.dimension)), increment.status == solver.Status.FALLING
        if blocks_only:
            self.scene.clear(*OF_STATICS)
        else:
            dots = self._draw_joints(increment, shown)
            self._draw_forces(increment, shown)
            self._draw_bearings(shown)
            # In the mechanism of a live load supports stand still.
            if phases_of(self.response) and not (increment.load_multiplier and (falling or self._drawn_at is not None)):
                seen = self.scene.frame if self._flat else None
                self._draw_arrows("arrow", *self._settlement_arrows(increment, shown, seen), palette.SETTLEMENT)
            self._draw_loads(increment, shown, dots)
            if self.response.loads.fills:
                self.scene.backfill(fill_bodies(self.response, shown, increment.fallen))
        self.scene.ties(self.ties.strands(increment, shown, DASH * self.scene.usual_height / 1080.0 * self.scene.pixel))
        failed = self.response.stop == solver.Status.SOLVER_FAILED
        head, detail = caption_of(self.response, increment, self.look.magnification)
        picture = self.scene.image()
        self._write_labels(picture, increment, shown, dots, widths and self.look.joints and not falling and self._flat)
        return self.sheet.composed(
            picture,
            title=title or head,
            detail=SEPARATOR.join([note or detail, *section_words(self._plane)]),
            badge=(badge_of(self.response) if falling else FAILED_BADGE if failed else "") if badge is None else badge,
            keys=self._keys_drawn(increment),
            pixel=self.scene.pixel,
            beside=None if self.panel is None else self.panel.image(increment),
        )

    def falling_picture(self, time: float) -> Image.Image:
        """Draw the fall at a time [s] after the last equilibrium."""
        assert self.fall is not None
        return self.picture(
            falling_increment(self.response, self.fall, time),
            title=f"Fall   ·   {time:.2f} s after the last equilibrium",
            note=f"{fall_text(self.response)}   ·   true scale",
            badge=FALL_BADGE if self._moves(time) else "",
            blocks_only=True,
        )

    def _moves(self, time: float) -> bool:
        """Whether something moves by a pixel after a time [s] of the fall, or in the last 0.12 s known of it."""
        assert self.fall is not None
        end = float(self.fall.times[-1])
        start = max(min(time, end - 0.12), 0.0)
        # Until the end: what is tall begins to fall slower than is seen in a moment.
        now, then = (mechanics.moved_vertices(self.assembly, self.fall.at(t)) for t in (start, end))
        return bool(np.linalg.norm(then - now, axis=1).max(initial=0.0) > self.scene.pixel)

    def show_motion(self, swing: Swing) -> None:
        """Show by tints, edges and arrows how the parts of a mechanism move.

        In the plane the blocks stay where they stand, and outlines are where it takes them; in space it is the other
        way round. Of more than ``MOST_PARTS`` parts the speed is tinted instead, and arrows stand on a grid.
        """
        pose, volumes = swing.increment.pose, self.assembly.shapes.volumes
        chosen = self._blocks_with_arrows(swing)
        tails, tips = np.zeros((2, len(chosen), self.assembly.dimension))
        for k, blocks in enumerate(chosen):
            weight = volumes[blocks] / volumes[blocks].sum()
            tails[k] = weight @ pose.positions[blocks]
            tips[k] = mechanics.carried(tails[[k]], blocks[:1], pose, swing.displaced)[0]
        # Arrows are as long as ever, where the blocks are drawn after a part of it.
        tips = tails + (tips - tails) / swing.share
        into = into_sight(self._plane, tails)
        tails, tips = tails + into, tips + into
        lengths = np.linalg.norm(tips - tails, axis=1)
        # Shorter ones are specks.
        shown = lengths >= min(0.01 * float(self.scene.frame.size.max()), lengths.max(initial=0.0))
        tails, tips = tails[shown], tips[shown]
        self._arrows["motion"] = np.stack([tails, tips], axis=1)
        self._swing, self.tints = swing, mechanism_colours(self.assembly, self.fill, swing)
        self._drawn_at = self.scene.show_motion(swing, tails, tips)

    def _blocks_with_arrows(self, swing: Swing) -> list[np.ndarray]:
        """List the blocks that each arrow of a mechanism stands for: a part, or one of those in a cell of a grid."""
        kept = kept_blocks(self._plane, self.assembly, swing.increment.pose)
        if swing.n_parts <= MOST_PARTS:
            parts = [np.flatnonzero(swing.parts == part) for part in range(swing.n_parts)]
            return [part for part in parts if kept[part].any()]
        positions = swing.increment.pose.positions
        moves = np.flatnonzero((swing.parts >= 0) & kept)
        width = (0.07 if self._flat else 0.09) * self.scene.frame.size.max()
        place = self._projected(positions[moves])[:, :2] / width
        cell = np.floor(place)
        # Of the blocks behind each other the first is seen; else arrows stand as evenly as blocks allow.
        off = -self._views[0].depth(positions[moves]) if self._views else np.abs(place - cell - 0.5).max(axis=1)
        order = np.argsort(np.round(off, 6), kind="stable")
        moves, cell = moves[order], cell[order]
        _, first = np.unique(cell, axis=0, return_index=True)
        return [moves[[k]] for k in first]

    @cached_property
    def keys(self) -> list[Key]:
        """Return what is marked in any of the increments, what comes and goes first."""
        keys = self._keys_of_tints()
        if self._loses and ("lost" in self._seen.marks or self._drawn_at is not None):
            keys.append(Key("area", LOST, palette.LOST, rim=palette.WARNING if self._flat else None))
        keys += [*self._keys_of_joints(), *self.ties.keys()]
        if not self._flat and self.response.settlements:
            traced = hiding_supports(self.assembly, self._views[0])[self.assembly.moving].all()
            keys.append(Key("line" if traced else "area", "moving support", palette.MOVING, layers=("moving",)))
        if self.response.loads.fills:
            kind = "area" if self._flat else "line"
            keys.append(Key(kind, "fill", palette.FILL_HATCH if self._flat else palette.FILL_RIM, 0.0, ("backfill",)))
        for kind, loads in self.loads.items():
            keys.append(Key("line", loads.words, palette.LOADS[kind], layers=(f"{kind} top",)))
        if self._drawn_at is not None:
            layers = ("motion outline", "motion top")
            what = "motion" if self._flat else "motion, blocks drawn after it"
            keys.append(Key("line", f"{what} (not to scale)", palette.SETTLEMENT, layers=layers))
            keys.append(
                Key("line", "at equilibrium" if self.response.path else "as drawn", palette.GHOST, layers=("before",))
            )
        return [*keys, *self._keys_of_forces()]

    def _keys_of_joints(self) -> list[Key]:
        marks, widest = self._seen.marks, self._seen.widest
        # Where a mechanism swings alone, nothing is open in equilibrium.
        up_to = "" if self._flat or widest == 0.0 else f", up to {width_text(widest)}"
        crack = Key(
            "area" if self._flat else "line", f"open joint{up_to}", palette.OPEN, layers=("crack", "crack edge")
        )
        cracks = [crack] * ("cracks" in marks)
        if self.look.magnification != 1.0:
            told = "are shown at true scale only" if self.look.joints and not self.many else "not shown"
            return [*cracks, Key("", f"hinges, sliding joints and forces {told}", palette.FAINT)]
        crushing = [Key("dot", "crushing", palette.CRUSHING, layers=("crushing top",))] * ("crushing" in marks)
        hinge = Key("dot" if self._flat else "line", "hinge", palette.HINGE, layers=("hinge",))
        marked = [Key("line", "sliding joint", palette.SLIDING, layers=("sliding",))] * ("sliding" in marks)
        marked += [hinge] * ("hinges" in marks)
        if not self.many:
            dashed = Key("dash", "hidden hinge", palette.HINGE, layers=("hidden hinge",))
            return [*crushing, *marked, *[dashed] * ("hinges" in marks and len(self._views) == 1), *cracks]
        # They would hide the cracks: in a wall of many blocks nearly every brick turns or slides a little.
        hidden = " and ".join(f"{key.text}s" for key in marked[::-1])
        return [*crushing, *cracks, *([Key("", f"{hidden} not shown", palette.FAINT)] if hidden else [])]

    def _keys_of_forces(self) -> list[Key]:
        if self._forces_hidden:
            return [Key("", "forces not shown", palette.FAINT)]
        if self.force_scale == 0.0:
            return []
        joint = "force of a joint" if "pulls" in self._seen.marks else "compression"
        text = joint if self.look.forces == "thrust" else "contact force"
        if not self._flat:
            # Lengths in space are foreshortened: no bar is their scale.
            words = f"{text} up to {force_text(self._seen.largest_force)}"
            return [Key("line", words, palette.FORCE, layers=("force",))]
        length = self.force_shown * self.force_scale / self.scene.pixel
        return [Key("bar", f"{text} {force_text(self.force_shown)}", palette.FORCE, length, ("force",))]

    def _keys_drawn(self, increment: solver.Increment) -> list[Key]:
        """Return the legend of the picture that the scene holds; what was left out is told where statics has it."""
        falling = increment.status == solver.Status.FALLING
        untinted = [] if self._acts(increment) else self._keys_of_tints()
        if not (increment.fallen & ~increment.removed).any():
            untinted += [key for key in self.keys if key.text == LOST]
        return [
            key
            for key in self.keys
            if key not in untinted and (self.scene.holds(*key.layers) if key.layers else bool(key.kind) or not falling)
        ]

    def _keys_of_tints(self) -> list[Key]:
        """Return what the legend says of the colours of the blocks."""
        # Where nothing that stands moves there are no parts.
        if self._swing is None or self.tints is None or self._swing.n_parts == 0:
            return []
        words, shades = "parts of", [self.tints[self._swing.parts == part][0] for part in range(self._swing.n_parts)]
        if self._swing.n_parts > MOST_PARTS:
            words, shades = "faster in", [*palette.displacement_colours(FASTEST * np.linspace(0.25, 1.0, 4))]
        shown = tuple(map(palette.rgb, shades))
        return [Key("area", f"{words} the last mechanism", shown[0], shades=shown)]

    @property
    def many(self) -> bool:
        """Whether dots and arrows at every joint would hide the blocks."""
        return self.assembly.n_blocks > FEW_BLOCKS

    def _shown(self, increment: solver.Increment) -> solver.Increment:
        """Give the state at which the mechanism begins the motion of that."""
        return self._swing.increment if self._swing is not None and increment is self._swing.begins else increment

    def _block_colours(self, pose: solver.Pose, increment: solver.Increment) -> np.ndarray | None:
        colours = self._standing_colours(pose, increment)
        if not self._loses:
            return colours
        # As in the legend, whatever colours the others.
        lost = np.asarray(palette.LOST, dtype=np.uint8)
        return np.where(increment.fallen[:, None], lost, self.fill if colours is None else colours)

    def _standing_colours(self, pose: solver.Pose, increment: solver.Increment) -> np.ndarray | None:
        if self.look.colour_by != "displacement":
            return self.tints if self.tints is None or self._acts(increment) else self.fill
        moved = np.linalg.norm(pose.positions - self.assembly.centroids, axis=1)
        colours = palette.displacement_colours(moved / (self.largest or 1.0))
        return np.where(self.assembly.free[:, None], colours, self.fill)

    def _acts(self, increment: solver.Increment) -> bool:
        """Whether the mechanism that is tinted follows an increment: it has colours from there on."""
        swing = self._swing
        if swing is None or self._drawn_at is not None or increment.status == solver.Status.FALLING:
            return True
        place = increment.phase, increment.parameter
        if not self.response.parameter.is_path and len(self.response.path) > 1 and len(self.increments) > 1:
            # Of states that stand by themselves one would flash in a film.
            return False
        return place in self._acting

    @cached_property
    def _acting(self) -> set[tuple[int, float]]:
        """Phase and parameter of the increments from which on the mechanism acts: one between others would flash."""
        assert self._swing is not None
        found = {(self._swing.increment.phase, self._swing.increment.parameter)}
        for increment in reversed(self.response.path):
            place = increment.phase, increment.parameter
            same = place in found or np.array_equal(mechanics.rigid_parts(self.assembly, increment), self._swing.parts)
            if not same:
                break
            found.add(place)
        return found

    def _draw_joints(self, increment: solver.Increment, shown: solver.Pose) -> np.ndarray:
        """Draw open and sliding joints, hinges and what crushes; returns where dots are drawn, (n, d) [m]."""
        if not self.look.joints:
            return np.zeros((0, self.assembly.dimension))
        found = marks_of(self.assembly, self.joints, increment, shown)
        self.scene.cracks(found, self.look.magnification)
        if self.look.magnification != 1.0:
            return np.zeros((0, self.assembly.dimension))
        self.scene.crushing(found)
        if self.many:
            return found.crushing
        self.scene.sliding(found)
        self.scene.hinges(found)
        return np.concatenate([found.hinges[:, 0], found.crushing])

    def _write_labels(
        self, picture: Image.Image, increment: solver.Increment, shown: solver.Pose, dots: np.ndarray, widths: bool
    ) -> None:
        """Write the forces of ties, and the widths of the widest crack lines, beside them, where there is room."""
        points, words, colours = self.ties.labels(increment, shown)
        if widths:
            # Between blocks that have parted no crack is drawn: what is air counts for none, and of a crack with other
            # joints the widest of these has the label.
            found = marks_of(self.assembly, self.joints, increment, shown)
            cracks = cracks_of(self.assembly, increment.pose, increment.fallen)
            drawn = [np.isin(crack.joints, found.joints) for crack in cracks]
            main = main_areas([float(crack.areas[own].sum()) for crack, own in zip(cracks, drawn, strict=True)])
            widest = np.searchsorted(found.joints, [cracks[k].joints[drawn[k]][0] for k in main])
            openings = found.openings[widest]
            points = np.concatenate([points, found.middles[widest, openings.argmax(axis=1)]])
            words += [width_text(width) for width in openings.max(axis=1, initial=0.0).tolist()]
            colours += [palette.OPEN] * len(main)
            across = along_lines(found.cracks[:, [0, 3]]), along_lines(found.cracks[:, [1, 2]])
            dots = np.concatenate([dots, along_lines(np.stack(across, axis=1))])
        if words:
            at, ends = self.scene.at_pixel, np.concatenate([*self._arrows.values(), self.ties.lines(increment, shown)])
            ends = at(ends.reshape(-1, points.shape[1])).reshape(-1, 2, 2)
            write_labels(picture, at(points), words, self.sheet.text, at(dots), colours, ends)

    def _draw_forces(self, increment: solver.Increment, shown: solver.Pose) -> None:
        if self.force_scale == 0.0:
            return
        if increment.status == solver.Status.FALLING:
            # Without equilibrium the forces have no meaning.
            self.scene.clear("force", "force line")
            return
        points, forces, blocks = joint_forces(increment, self.look.forces)
        size = np.linalg.norm(forces, axis=1)
        kept = size > SMALLEST_RESULTANT * size.max(initial=0.0)
        points, forces, blocks = points[kept], forces[kept], blocks[kept]
        points = carried_between(points, blocks[:, 0], blocks[:, 1], increment.pose, shown)
        half = 0.5 * self.force_scale * forces
        line = np.zeros((0, 2, self.assembly.dimension))
        if self.look.forces == "thrust":
            line = thrust_line(points, blocks, self.assembly)
        self.scene.forces(np.stack([points - half, points + half], axis=1), line)

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

    def _draw_bearings(self, shown: solver.Pose) -> None:
        """Draw where supports carry the structure in the plane."""
        if not isinstance(self.scene, FlatScene):
            return
        joints, free = self.joints, self.assembly.free
        drawn = solver.Pose.initial(self.assembly)
        lines = []
        for block, other in ((joints.block_a, joints.block_b), (joints.block_b, joints.block_a)):
            on = ~free[block] & free[other]
            ends = [mechanics.carried(joints.ends[on, k], block[on], drawn, shown) for k in (0, 1)]
            lines.append(np.stack(ends, axis=1))
        self.scene.bearings(np.concatenate(lines))

    def _draw_loads(self, increment: solver.Increment, shown: solver.Pose, dots: np.ndarray) -> None:
        """Draw loads, live ones times their multiplier, as arrows that end where they act, short of a hinge."""
        for kind, loads in self.loads.items():
            tails, tips = loads.arrows(increment, shown)
            if self._flat and len(dots) and len(tips):
                # The dot of a hinge would hide their heads.
                clear = 0.5 * self.sheet.text * self.scene.pixel
                at_dot = np.linalg.norm(tips[:, None] - dots, axis=2).min(axis=1) < clear
                along = (tips - tails) / np.maximum(np.linalg.norm(tips - tails, axis=1), 1e-300)[:, None]
                back = clear * at_dot[:, None] * along
                tails, tips = tails - back, tips - back
            self._draw_arrows(kind, tails, tips, palette.LOADS[kind])

    def _draw_arrows(self, layer: str, tails: np.ndarray, tips: np.ndarray, colour: tuple[int, int, int]) -> None:
        self._arrows[layer] = np.stack([tails, tips], axis=1)
        self.scene.arrows(layer, tails, tips, colour)

    def _settlement_arrows(
        self, increment: solver.Increment, shown: solver.Pose, seen: Frame | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Tails and tips (n, d) [m] of the arrows at supports: in the plane on them, in space out of them."""
        settlement = settlement_in(self.response, increment.phase)
        if settlement is None:
            return np.zeros((0, self.assembly.dimension)), np.zeros((0, self.assembly.dimension))
        if self._flat:
            return arrows_on_supports(self.assembly, settlement, shown, seen, self._arrow)
        blocks, places, directions = settlement_arrows(self.assembly, settlement, shown)
        kept = kept_blocks(self._plane, self.assembly, shown)[blocks]
        places, directions = places[kept], directions[kept]
        places = places + into_sight(self._plane, places)
        return places, places + self._arrow * directions


def magnified(assembly: solver.Assembly, pose: solver.Pose, magnification: float) -> solver.Pose:
    """Multiply the displacements and rotations of a pose since the layout."""
    if magnification == 1.0:
        return pose
    start = assembly.centroids
    return solver.Pose(start + magnification * (pose.positions - start), magnification * pose.rotations)


def without_removed(increment: solver.Increment, fell_at: np.ndarray) -> solver.Increment:
    """Leave out blocks that have been taken away since, by ``fell_at`` (n_blocks,) of a later increment."""
    gone = np.isneginf(fell_at) if len(fell_at) else increment.removed
    contacts = increment.contacts
    kept = ~(gone[contacts.block_a] | gone[contacts.block_b])
    crushing = increment.state.crushing
    return increment.with_arrays(
        fell_at=fell_at,
        contacts=contacts[kept],
        forces=increment.forces[kept],
        displacements=increment.displacements[kept],
        friction=increment.friction[kept],
        crushing=crushing[kept] if len(crushing) else crushing,
    )


def largest_displacement(assembly: solver.Assembly, increment: solver.Increment) -> float:
    """Largest displacement [m] of a corner of a free block since the layout."""
    moved = mechanics.moved_vertices(assembly, increment.pose) - assembly.vertices
    return float(np.linalg.norm(moved, axis=1)[assembly.free[assembly.block_of_vertex]].max(initial=0.0))
