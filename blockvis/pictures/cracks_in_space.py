"""Cracks of blocks in space for their drawing: edges of joints as lines, the wider and darker the more they open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image

import solver
from blockvis.layout.sights import Cut, Sight
from blockvis.results.cracks import SMALLEST_OPENING, Crack, main_cracks, slid_joints
from blockvis.results.joint_faces import InitialJoints
from blockvis.results.joints import carried_faces, opening_and_slip
from blockvis.text import width_text

from . import palette
from .drawer import MARGIN, WHOLE
from .frame import Frame, Key, Sheet, framed, sheet_size, write_labels
from .paired_scenes import PairedScenes
from .sight_lines import SightLines
from .solid_view import AROUND, View, heights_over, hiding_supports, plane_of, section_words, views_of
from .surface import IN_PLANE
from .swing import swing_of

#: Thinnest and thickest line, in heights of the picture.
THIN, THICK = 1.0 / 360.0, 1.0 / 100.0

#: An edge is drawn in so many pieces: its opening changes from end to end.
PIECES = 6


class CracksInSpace:
    """The layout of blocks in space, pale, with lines where joints have opened at an increment.

    The blocks stand where the layout has them: in the moved shape a gap between stones would look like one of them.
    The main ones of the cracks are to be seen, from where and cut open as asked for.
    """

    def __init__(
        self,
        response: solver.Response,
        increment: solver.Increment,
        joints: InitialJoints,
        size: tuple[int, int] | None,
        cracks: Sequence[Crack],
        sight: Sight | None = None,
        cut: Cut | None = None,
    ) -> None:
        assembly, swing = response.assembly, swing_of(response)
        motion = swing.displaced.positions - swing.increment.pose.positions
        self._views = views_of(response, motion, joints, sight, cut)
        edges = _Edges.of(assembly, joints, increment)
        opened = edges.chosen(edges.openings > SMALLEST_OPENING * assembly.block_size)
        if cut is None and (sight is None or sight.azimuth is None):
            self._views = _showing(assembly, self._views, opened, main_cracks(cracks), increment.fallen)
        plane = plane_of(assembly, cut, self._views[0])
        #: The section in words; none without one.
        self.section = section_words(plane)
        near = IN_PLANE * float(np.ptp(assembly.vertices, axis=0).max())
        self._opened = opened.over(plane, near)
        moved = opening_and_slip(assembly, joints, increment.pose, increment.fallen)
        slides = np.isin(edges.joints, slid_joints(assembly, moved))
        self._slid = edges.chosen(slides).over(plane, near)
        self._slips = np.abs(moved[self._slid.joints, 1])
        self.slip = float(self._slips.max(initial=0.0))
        #: The cracks of which the section leaves something, and how many of them no view of the last image shows.
        self.shown = [crack for crack in cracks if np.isin(crack.joints, self._opened.joints).any()]
        self.hidden = 0
        # The numbers are those of the report.
        self._main = [(1 + cracks.index(crack), crack) for crack in main_cracks(self.shown)]
        self._tells_moving = bool(response.settlements)
        roles = palette.role_colours(assembly, self._tells_moving)
        initial = solver.Pose.initial(assembly)
        frames = [framed(assembly, [initial], MARGIN, 0.3, view.axes[:2], WHOLE, plane) for view in self._views]
        frame = Frame(*(np.concatenate([getattr(one, end) for one in frames]) for end in ("low", "high")))
        self.sheet = Sheet(size or sheet_size(frame))
        self._pair = PairedScenes(
            assembly, self._views, frame, self.sheet, roles, fine=True, cut=plane, outline=palette.PALE_OUTLINE
        )
        self._pair.hide(increment.fallen)
        self._pair.pose(initial, palette.pale(roles, True, palette.SURVEY))
        self.pixel, self.keys = self._pair.pixel, self._drawn()

    def _drawn(self) -> list[Key]:
        """Draw lines where joints have opened, in their classes, and where they slide; returns the legend."""
        limits = class_limits(float(self._opened.openings.max(initial=0.0)))
        texts = [width_text(limit) for limit in limits]
        words = [*(f"to {text}" for text in texts), f"above {texts[-1]}" if texts else "open joint"]
        height, which = self._pair.usual_height, np.searchsorted(limits, self._opened.openings)
        keys = [
            Key("line", text, palette.rgb(colour))
            for text, colour in zip(words, palette.crack_colours(len(words)), strict=True)
        ]
        for k, key in enumerate(keys):
            thick = height * (THIN + k / max(len(keys) - 1, 1) * (THICK - THIN))
            self._pair.lines(f"crack/{k}", self._opened.ends[which == k], key.colour, thick, 2.0 + k)
        self._pair.lines("sliding", self._slid.ends, palette.SLIDING, height * (THIN + THICK) / 2.0, 1.5)
        sliding = [Key("line", "sliding joint", palette.SLIDING)] * bool(len(self._slid.joints))
        return keys * bool(len(self._opened.joints)) + sliding

    def image(self) -> Image.Image:
        """Draw the views, with number and largest width of each main crack in the view that shows its widest place.

        Of a crack whose widest place is hidden that is the widest one that some view shows.
        """
        page, opened, labels, places = self._pair.image(), self._opened, list[str](), list[np.ndarray]()
        seen, pixels = self._in_views(opened.middles)
        slides, along = self._in_views(self._slid.middles)
        joints, openings, slips = (
            np.tile(of, len(self._views)) for of in (opened.joints, opened.openings, self._slips)
        )
        self.hidden = sum(not np.isin(crack.joints, joints[seen]).any() for crack in self.shown)
        for number, crack in self._main:
            own = np.where(seen & np.isin(joints, crack.joints), openings, 0.0)
            if own.any():
                labels.append(f"{number}: {width_text(crack.width)}")
                places.append(pixels[own.argmax()])
        colours = [palette.OPEN] * len(labels)
        slips = np.where(slides, slips, 0.0)
        if slips.any():
            labels.append(f"slip {width_text(float(slips.max()))}")
            places.append(along[slips.argmax()])
            colours.append(palette.SLIDING)
        if self._tells_moving and self._pair.holds("moving"):
            pale = palette.pale(np.array([palette.MOVING]), True, palette.SURVEY)
            self.keys.append(Key("area", "moving support", palette.rgb(pale[0])))
        self._pair.close()
        dots = np.concatenate([pixels[seen], along[slides]])
        write_labels(page, np.array(places).reshape(-1, 2), labels, self.sheet.text, dots, colours)
        return page

    def _in_views(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whether the last image shows points (n, 3) [m] of lines, and at which pixels; one view after another."""
        seen, pixels, left = [], [], 0
        for scene in self._pair.scenes:
            seen.append(~scene.hides(points, THIN * scene.usual_height))
            pixels.append(np.add(scene.at_pixel(points), (left, 0)))
            left += scene.size[0]
        return np.concatenate(seen), np.concatenate(pixels)


@dataclass(frozen=True)
class _Edges:
    """Pieces of the edges of joints in the layout: ends [m], openings [m], numbers and unit normals of the joints."""

    ends: np.ndarray
    openings: np.ndarray
    joints: np.ndarray
    across: np.ndarray

    @property
    def middles(self) -> np.ndarray:
        """(n, 3) array [m]."""
        return np.asarray(self.ends.mean(axis=1))

    @classmethod
    def of(cls, assembly: solver.Assembly, joints: InitialJoints, increment: solver.Increment) -> _Edges:
        """Divide the edges of all joints, with their openings at an increment."""
        rings = joints.rings
        gaps = carried_faces(assembly, joints, increment.pose, increment.fallen).gaps
        start, end = rings.points, rings.points[rings.following]
        at = np.linspace(0.0, 1.0, PIECES + 1)[:, None, None]
        points = start + at * (end - start)
        middle = (at[:-1, :, 0] + at[1:, :, 0]) / 2.0
        owner = np.tile(rings.ring, PIECES)
        return cls(
            ends=np.stack([points[:-1], points[1:]], axis=2).reshape(-1, 2, 3),
            openings=(gaps + middle * (gaps[rings.following] - gaps)).ravel(),
            joints=owner,
            across=joints.normals[owner],
        )

    def chosen(self, which: np.ndarray) -> _Edges:
        """Choose pieces by numbers, or by (n,) bool."""
        return _Edges(self.ends[which], self.openings[which], self.joints[which], self.across[which])

    def over(self, plane: np.ndarray | None, near: float) -> _Edges:
        """Choose those of joints that a section leaves: of one in its plane, within so much [m], it shows one side."""
        heights = heights_over(plane, self.middles)
        return self.chosen((heights >= -near) & np.isin(self.joints, self.joints[heights > near]))


def _showing(
    assembly: solver.Assembly,
    views: tuple[View, ...],
    opened: _Edges,
    cracks: Sequence[Crack],
    gone: np.ndarray,
) -> tuple[View, ...]:
    """Turn views around where they leave a crack unseen that others show: to what shows most cracks, and most of them.

    Blocks that are ``gone`` (n_blocks,) hide nothing.
    """
    lines = SightLines(assembly, solver.Pose.initial(assembly), np.ones(assembly.n_blocks))
    order = np.argsort(-opened.openings, kind="stable")
    most = lines.most // max(len(cracks), 1)
    # The widest pieces of each; where there are too many the others are not looked for.
    own = [opened.chosen(order[np.isin(opened.joints[order], crack.joints)][:most]) for crack in cracks]

    def shown(tried: tuple[View, ...]) -> tuple[int, float]:
        hide = [gone | hiding_supports(assembly, view) for view in tried]
        parts = []
        for one in own:
            seen = [
                lines.sees(one.middles, one.across, view.axes, without)
                for view, without in zip(tried, hide, strict=True)
            ]
            parts.append(float(np.any(seen, axis=0).mean()))
        return sum(part > 0.0 for part in parts), sum(parts)

    if shown(views)[0] == len(own):
        return views
    turned = [tuple(View(around, view.above) for view in views) for around in AROUND]
    return max([views, *turned], key=shown)


def class_limits(widest: float) -> list[float]:
    """List the widths [m] that part the four classes of cracks up to a widest [m]: round numbers, the last below it.

    Examples
    --------
    >>> class_limits(0.132)
    [0.02, 0.05, 0.1]
    """
    power = 10.0 ** np.floor(np.log10(widest)) if widest > 0.0 else 1.0
    every = [step * factor * power for factor in (0.01, 0.1, 1.0) for step in (1.0, 2.0, 5.0)]
    return [float(f"{limit:.3g}") for limit in every if limit < 0.999 * widest][-3:] if widest else []
