"""Cracks of blocks in space for their drawing: edges of joints as lines, the wider and darker the more they open."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image

import solver
from blockvis.layout.sights import Cut, Sight
from blockvis.results.cracks import SMALLEST_OPENING, Crack
from blockvis.results.joint_faces import InitialJoints
from blockvis.results.joints import carried_faces
from blockvis.text import width_text

from . import palette
from .drawer import MARGIN, WHOLE, alike
from .frame import Key, Sheet, framed, write_labels, write_words
from .paired_scenes import WORDS
from .solid_scene import SolidScene
from .solid_view import hiding_supports, plane_of, views_of
from .swing import swing_of

#: Widths between the classes are of these, times a power of ten [mm]; most classes; thinnest and thickest line in
#: heights of the picture.
STEPS, MOST_CLASSES, THIN, THICK = (1.0, 2.0, 5.0), 4, 1.0 / 360.0, 1.0 / 100.0

#: An edge is drawn in so many pieces: its opening changes from end to end.
PIECES = 6


class CracksInSpace:
    """The layout of blocks in space, pale, with lines where joints have opened at an increment.

    The blocks stand where the layout has them: in the moved shape a gap between stones would look like one of them.

    Parameters
    ----------
    response : solver.Response
    increment : solver.Increment
    joints : InitialJoints
    sheet : Sheet
    sight, cut
        From where the blocks are seen and what cuts them open, as of :func:`blockvis.draw_still`.

    Attributes
    ----------
    pixel : float [m]
        Size of a pixel.
    keys : list of Key
        The classes of width.
    """

    def __init__(
        self,
        response: solver.Response,
        increment: solver.Increment,
        joints: InitialJoints,
        sheet: Sheet,
        sight: Sight | None = None,
        cut: Cut | None = None,
    ) -> None:
        assembly, swing = response.assembly, swing_of(response)
        self._roles = palette.role_colours(assembly, bool(response.settlements))
        motion = swing.displaced.positions - swing.increment.pose.positions
        self._views = views_of(response, motion, joints, sight, cut)
        self._sheet = sheet
        plane = plane_of(assembly, cut, self._views[0])
        opened = _opened(assembly, joints, increment)
        kept = _kept(opened[0].mean(axis=1), plane)
        self._pieces, self._openings, self._owner = (of_pieces[kept] for of_pieces in opened)
        self._joints_kept = joints.rings.ring[_kept(joints.rings.points, plane)]
        limits = class_limits(float(self._openings.max(initial=0.0)))
        colours = [palette.rgb(colour) for colour in palette.crack_colours(len(limits) + 1)]
        self._scenes = self._drawn(assembly, limits, colours, plane, increment.fallen)
        self.pixel = self._scenes[0].pixel
        texts = [width_text(limit) for limit in limits]
        words = [*(f"to {text}" for text in texts), f"above {texts[-1]}" if texts else "open joint"]
        self.keys = [Key("line", text, colour) for text, colour in zip(words, colours, strict=True)]

    def left_by_section(self, cracks: Sequence[Crack]) -> list[Crack]:
        """Choose the cracks of which the section leaves something."""
        return [crack for crack in cracks if np.isin(crack.joints, self._joints_kept).any()]

    def _drawn(
        self,
        assembly: solver.Assembly,
        limits: Sequence[float],
        colours: Sequence[tuple[int, int, int]],
        plane: np.ndarray | None,
        gone: np.ndarray,
    ) -> list[SolidScene]:
        width, height = self._sheet.inside_size
        below = round(WORDS * self._sheet.text) if len(self._views) > 1 else 0
        size = width // len(self._views), height - below
        fill = palette.pale(self._roles, np.ones(assembly.n_blocks, dtype=bool), palette.SURVEY)
        frames = [
            framed(assembly, [solver.Pose.initial(assembly)], MARGIN, 0.3, view.axes[:2], WHOLE, plane)
            for view in self._views
        ]
        which = np.searchsorted(limits, self._openings)
        scenes = []
        for view, frame in zip(self._views, alike(frames), strict=True):
            outlined = hiding_supports(assembly, view)
            scene = SolidScene(
                assembly, view, frame, size, self._roles, fine=True, cut=plane, outlined=outlined,
                outline=palette.PALE_OUTLINE,
            )  # fmt: skip
            scene.hide(gone)
            scene.pose(solver.Pose.initial(assembly), fill)
            for k, colour in enumerate(colours):
                part = k / max(len(colours) - 1, 1)
                thick = height * (THIN + part * (THICK - THIN))
                scene.lines(f"crack/{k}", self._pieces[which == k], colour, thick, forward=2.0 + k)
            scenes.append(scene)
        return scenes

    def image(self, cracks: Sequence[Crack], numbers: Sequence[int]) -> Image.Image:
        """Draw the views, with number and largest width of each crack in the view that shows its widest place.

        Of a crack whose widest place is hidden that is the widest one that some view shows.

        Parameters
        ----------
        cracks : sequence of Crack
        numbers : sequence of int
            As the report counts them.
        """
        text = self._sheet.text
        page, left = Image.new("RGB", self._sheet.inside_size, palette.PAPER), 0
        found: dict[int, tuple[float, np.ndarray]] = {}
        dots = []
        for scene, words in zip(self._scenes, ("from above", "from below"), strict=False):
            page.paste(scene.image(), (left, 0))
            if len(self._scenes) > 1:
                place = left + scene.size[0] / 2.0, page.height - 0.7 * text
                write_words(page, place, words, text)
            middles = self._pieces.mean(axis=1)
            seen, pixels = scene.sees(middles), scene.at_pixel(middles) + np.array([left, 0])
            dots.append(pixels[seen])
            for crack, number in zip(cracks, numbers, strict=True):
                here = seen & np.isin(self._owner, crack.joints)
                widest = int(np.where(here, self._openings, -1.0).argmax())
                if here.any() and (number not in found or self._openings[widest] > found[number][0]):
                    found[number] = self._openings[widest], pixels[widest]
            left += scene.size[0]
            scene.close()
        if found:
            labelled = [(crack, n) for crack, n in zip(cracks, numbers, strict=True) if n in found]
            labels = [f"{n}: {width_text(crack.width)}" for crack, n in labelled]
            write_labels(page, np.array([found[n][1] for _, n in labelled]), labels, text, np.concatenate(dots))
        return page


def class_limits(widest: float) -> list[float]:
    """List the widths [m] that part the classes of cracks up to a widest [m]: round numbers, the last below it.

    Examples
    --------
    >>> class_limits(0.132)
    [0.02, 0.05, 0.1]
    """
    power = 10.0 ** np.floor(np.log10(widest)) if widest > 0.0 else 1.0
    every = [step * factor * power for factor in (0.01, 0.1, 1.0) for step in STEPS]
    return [float(f"{limit:.3g}") for limit in every if limit < 0.999 * widest][-(MOST_CLASSES - 1) :] if widest else []


def _kept(points: np.ndarray, plane: np.ndarray | None) -> np.ndarray:
    """(n,) bool array: points, (n, 3) [m], on the side of a plane that is kept, as of :func:`plane_of`."""
    return np.ones(len(points), dtype=bool) if plane is None else (points - plane[0]) @ plane[1] >= 0.0


def _opened(
    assembly: solver.Assembly, joints: InitialJoints, increment: solver.Increment
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pieces of the edges of open joints in the layout, (n, 2, 3) [m], their openings (n,) [m] and joints (n,)."""
    rings = joints.rings
    gaps = carried_faces(assembly, joints, increment.pose, increment.fallen).gaps
    start, end = rings.points, rings.points[rings.following]
    at = np.linspace(0.0, 1.0, PIECES + 1)[:, None, None]
    points = start + at * (end - start)
    pieces = np.stack([points[:-1], points[1:]], axis=2).reshape(-1, 2, 3)
    middle = (at[:-1, :, 0] + at[1:, :, 0]) / 2.0
    openings = (gaps + middle * (gaps[rings.following] - gaps)).ravel()
    owner = np.tile(rings.ring, PIECES)
    kept = openings > SMALLEST_OPENING * assembly.block_size
    return pieces[kept], openings[kept], owner[kept]
