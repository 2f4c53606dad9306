"""The frame of a picture: the part of the world it shows; caption, scale bar, legend and colour bar around it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike
from PIL import Image, ImageDraw, ImageFont

import solver
from blockvis.text import bar_text, rounded_length
from solver import mechanics

from . import palette
from .surface import left_blocks

#: The smallest letters, in heights of the text.
SMALL = 0.9

#: Sheets narrower than this, in heights of the text, have one more row in the legend.
NARROW = 48.0

#: Heights of what is above and below the blocks, in those of the text, this of usual and of narrow sheets.
HEADER, FOOTER = 5.1, (3.3, 4.6)

#: Middle of a title of one and of two rows, and those of the first row below it and from each to the next.
TITLE, DETAIL = (0.72, 0.55), ((2.0, 1.2), (2.7, 1.05))

#: Widths of curve and colour bar beside the blocks, in heights of the text.
CURVE, BAR = 23.0, 7.6

#: Width and height of a still and of a film [pixels]; one in other proportions has as many, and is no wider.
STILL_SIZE, FILM_SIZE = (1920, 1080), (1280, 720)

#: Between the parts of a caption.
SEPARATOR = "   ·   "

#: How far labels lie from their places, in heights of the text: the nearest where there is room.
LABELS_AWAY = (0.6, 1.8, 3.0)

#: A label over the leader or the place of another, or its leader over an arrow or a tie, is as bad as over so many
#: dots, and a label over one of these, which hides it.
CROSSED, HIDDEN = 10, 50

#: (n, 2, 2) array: the ends of no lines.
NO_LINES = np.zeros((0, 2, 2))

#: To which side a label may lie, to the right and down, the best first.
BESIDE = ((1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (-1, -1), (1, 1), (-1, 1))

#: Supports are shown whole on sides where they end within so many times what is shown of them else.
JUST_OUTSIDE = 2.0

#: Between two entries of the legend, in heights of its letters.
LEGEND_GAP = 1.3


@dataclass(frozen=True)
class Key:
    """One entry of the legend."""

    kind: str  #: {"area", "line", "dash", "dot", "bar", ""}: what stands before the text; nothing before a note.
    text: str
    colour: tuple[int, int, int]
    length: float = 0.0  #: Pixels, of a bar drawn to scale.
    layers: tuple[str, ...] = ()  #: Of the scene that it explains; none of what is in every picture.
    rim: tuple[int, int, int] | None = None  #: Colour of the edge of an area.
    shades: tuple[tuple[int, int, int], ...] = ()  #: Of an area in several colours, from left to right.


@dataclass(frozen=True)
class ColourBar:
    """The scale of displacements up to a largest [m]; some may exceed it, as in a fall, and have the last colour."""

    largest: float
    exceeded: bool = False


class Sheet:
    """Where the picture of the blocks goes, and the words around it.

    Its size is in pixels; to the right of the blocks is room for the ``curve`` where it is asked for, and so many
    sheets stand side by side ``across`` a page.
    """

    def __init__(
        self, size: tuple[int, int], colour_bar: ColourBar | None = None, curve: bool = False, across: int = 1
    ) -> None:
        self.size = size
        width, height = size
        self.text = max(12, round(text_height(across * width, height)))
        self.pad = max(6, round(0.9 * self.text))
        self._narrow = width < NARROW * self.text
        self.header = round(HEADER * self.text)
        self.footer = round(FOOTER[self._narrow] * self.text)
        self.colour_bar = colour_bar
        beside = curve * min(round(CURVE * self.text), width // 2)
        right = beside + (round(BAR * self.text) if colour_bar else 0)
        #: Left, top, right, bottom of the blocks' picture, in pixels.
        self.inside = (0, self.header, width - right, height - self.footer)
        if min(self.inside_size) < 1:
            raise ValueError(f"size is {width} × {height} pixels, which leave the blocks none; give more")
        # A curve is no higher than 29 letters.
        aside = max((self.inside_size[1] - round(29.0 * self.text)) // 2, 0)
        #: The same of the curve.
        self.beside = (width - beside, self.header + aside, width, height - self.footer - aside)
        self._page, self._page_of = Image.new("RGB", size), tuple[object, ...]()

    @property
    def inside_size(self) -> tuple[int, int]:
        """Width and height of the blocks' picture in pixels."""
        left, top, right, bottom = self.inside
        return right - left, bottom - top

    def composed(
        self,
        picture: Image.Image,
        *,
        title: str,
        detail: str,
        badge: str = "",
        keys: Sequence[Key] = (),
        pixel: float,
        beside: Image.Image | None = None,
    ) -> Image.Image:
        """Put the picture of the blocks, of :attr:`inside_size`, on the sheet, with caption, scale bar and legend.

        Title and detail are the lines of the caption, the badge is a warning at the upper right. A pixel has a size
        [m], and the picture ``beside`` that of :attr:`beside`.
        """
        beside_title = self._room(badge) >= _font(round(1.15 * self.text), bold=True).getlength(title)
        titles, font = self._titles(title, badge if beside_title else "")
        shared = tuple(keys), pixel, detail, badge, beside_title, len(titles)
        if shared != self._page_of:
            # One at a time: joints open and slide now and then, and a page at any size is memory.
            self._page, self._page_of = self._around(*shared), shared
        page = self._page.copy()
        page.paste(picture, self.inside[:2])
        if beside is not None:
            page.paste(beside, self.beside[:2])
        draw = ImageDraw.Draw(page)
        for row, words in enumerate(titles):
            y = self.pad + (TITLE[len(titles) - 1] + 1.05 * row) * self.text
            draw.text((self.pad, y), words, palette.INK, font, anchor="lm")
        return page

    def _around(
        self, keys: Sequence[Key], pixel: float, detail: str, badge: str, beside_title: bool, titles: int
    ) -> Image.Image:
        """Draw what many pictures of a film share: scale bar, legend, colour bar, all of the caption but its title."""
        page = Image.new("RGB", self.size, palette.PAPER)
        draw = ImageDraw.Draw(page)
        end = self._scale_bar(draw, pixel)
        self._legend(draw, keys, end + 2 * self.pad)
        if self.colour_bar is not None:
            self._colour_bar(page, draw, self.colour_bar)
        # Two rows below the title.
        below = "" if beside_title else badge
        # A warning below two rows of a title stands beside both of these.
        room = [self._room(below if titles > 1 else ""), self._room(below)]
        rows, font = fitting_rows(detail, round(SMALL * self.text), room)
        top, step = DETAIL[titles - 1]
        for row, words in enumerate(rows):
            draw.text((self.pad, self.pad + (top + step * row) * self.text), words, palette.FAINT, font, anchor="lm")
        if badge:
            # Beside a long title it would make that small.
            self._badge(draw, badge, self.pad + 2.55 * self.text * (not beside_title))
        return page

    def _titles(self, title: str, badge: str) -> tuple[list[str], ImageFont.FreeTypeFont]:
        """Rows of a title and their font: several where in one its letters were smaller than those below it."""
        font = fitting_font(title, round(1.15 * self.text), self._room(badge), bold=True)
        if font.size < round(SMALL * self.text):
            return fitting_rows(title, self.text, [self._room("")] * len(TITLE), bold=True)
        return [title], font

    def _badge(self, draw: ImageDraw.ImageDraw, badge: str, top: float) -> None:
        left, half = self._room(badge) + 2 * self.pad, 0.75 * self.text
        box = left, top, self.size[0] - self.pad, top + 2 * half
        draw.rounded_rectangle(box, radius=half * 0.5, fill=palette.WARNING)
        place = left + 0.6 * self.text, top + half
        draw.text(place, badge, palette.PAPER, _font(round(SMALL * self.text), bold=True), anchor="lm")

    def _room(self, badge: str) -> float:
        """Width of a line beside a warning, or of one without, in pixels."""
        beside = _font(round(SMALL * self.text), bold=True).getlength(badge) + 1.2 * self.text + self.pad
        return self.size[0] - 2 * self.pad - beside * bool(badge)

    def _scale_bar(self, draw: ImageDraw.ImageDraw, pixel: float) -> int:
        """Draw the scale bar; returns its right end in pixels."""
        length = rounded_length(0.2 * self.inside_size[0] * pixel)
        pixels = round(length / pixel)
        thick = max(2, round(self.text / 9))
        x, y = self.pad, self.size[1] - self.pad - round(0.35 * self.text)
        tick = round(0.28 * self.text)
        draw.rectangle((x, y - thick // 2, x + pixels, y - thick // 2 + thick - 1), fill=palette.INK)
        for end in (x, x + pixels - thick + 1):
            draw.rectangle((end, y - tick, end + thick - 1, y + tick), fill=palette.INK)
        font = _font(round(SMALL * self.text))
        label = bar_text(length)
        draw.text((x + pixels / 2, y - tick - 0.15 * self.text), label, palette.INK, font, anchor="mb")
        return int(max(x + pixels, x + pixels / 2 + draw.textlength(label, font) / 2))

    def _legend(self, draw: ImageDraw.ImageDraw, keys: Sequence[Key], left: int) -> None:
        """Draw the legend, from its end on: what comes and goes in a film stands before what stays."""
        room, size = self.size[0] - self.pad - left, round(SMALL * self.text)
        rows = self._rows(keys, size, room)
        # Small letters are harder to read than a second row; only what there is no room for is written smaller.
        while len(rows) > 2 + self._narrow and size > 8:
            size -= 1
            rows = self._rows(keys, size, room)
        font, gap = _font(size), LEGEND_GAP * size
        y = self.size[1] - self.pad - 0.35 * self.text
        for row in rows:
            x = float(self.size[0] - self.pad)
            for key in row:
                x -= _width(key, size)
                wide = max(1.7 * size, key.length)
                if key.kind:
                    _swatch(draw, key, x, y, wide, self.text)
                draw.text((x + (wide + 0.5 * size) * bool(key.kind), y), key.text, palette.INK, font, anchor="lm")
                x -= gap
            y -= 1.4 * size

    def _rows(self, keys: Sequence[Key], size: int, room: float) -> list[list[Key]]:
        """Break a legend of letters of some size, from its end on, into rows no wider than the room [pixel]."""
        rows: list[list[Key]] = []
        used = np.inf
        for key in reversed(keys):
            width = _width(key, size)
            if used + LEGEND_GAP * size + width > room:
                rows.append([])
                used = -LEGEND_GAP * size
            rows[-1].append(key)
            used += LEGEND_GAP * size + width
        # The first entry has company where that fits; the others stay in place as it comes and goes in a film.
        if len(rows) > 1 and len(rows[-1]) == 1 and len(rows[-2]) > 2:
            second = rows[-2][-1]
            if used + LEGEND_GAP * size + _width(second, size) <= room:
                rows[-1].insert(0, rows[-2].pop())
        return rows

    def _colour_bar(self, page: Image.Image, draw: ImageDraw.ImageDraw, bar: ColourBar) -> None:
        left, top, bottom = self.inside[2] + self.text, self.inside[1], self.inside[3]
        height = round(0.62 * (bottom - top))
        top += round(0.2 * (bottom - top))
        ramp = palette.displacement_colours(np.linspace(1.0, 0.0, height))
        strip = np.repeat(ramp[:, None, :], round(0.9 * self.text), axis=1)
        page.paste(Image.fromarray(strip), (left, top))
        draw.rectangle((left, top, left + strip.shape[1] - 1, top + height - 1), outline=palette.OUTLINE)
        font = _font(round(SMALL * self.text))
        unit, factor = ("mm", 1e3) if bar.largest < 1.0 else ("m", 1.0)
        step = rounded_length(bar.largest * factor / 4.0)
        value, largest = 0.0, bar.largest * factor
        end = largest * (1 + 1e-9)
        while value <= end:
            x, y = left + strip.shape[1], top + height - 1 - value / (largest or 1.0) * (height - 1)
            draw.line((x, y, x + 0.3 * self.text, y), fill=palette.INK, width=max(1, self.text // 14))
            label = f"{'≥ ' * (bar.exceeded and value + step > end)}{value:g}"
            draw.text((x + 0.5 * self.text, y), label, palette.INK, font, anchor="lm")
            value += step
        draw.text((left, top - 0.6 * self.text), f"displacement\n[{unit}]", palette.INK, font, anchor="ld")


def write_labels(
    picture: Image.Image,
    places: np.ndarray,
    words: Sequence[str],
    text: int,
    dots: np.ndarray,
    colours: Sequence[tuple[int, int, int]] = (),
    lines: np.ndarray = NO_LINES,
) -> None:
    """Write labels on paper beside places (n, 2) of a picture, in their order, each where none lies yet.

    They leave dots (n, 2) and lines, such as arrows, with ends (n, 2, 2), free where there is room beside them, and
    each has a leader to its place, which crosses no line. All lengths are in pixels; the rims have the colour of open
    joints by default.
    """
    draw, font = ImageDraw.Draw(picture), _font(round(SMALL * text))
    rim, written = 0.4 * text, list[_Label]()
    # A label over the place of another would seem to be its.
    dots = np.concatenate([dots, np.repeat(places, CROSSED, axis=0)])
    away = np.repeat(np.multiply(LABELS_AWAY, text), len(BESIDE))
    beside = np.tile(BESIDE, (len(LABELS_AWAY), 1))
    for place, label, colour in zip(places, words, colours or [palette.OPEN] * len(words), strict=True):
        if not ((place >= 0.0) & (place <= picture.size)).all():
            continue
        size = np.array([font.getlength(label) + 0.5 * text, 1.2 * text])
        lows = place + beside * (size / 2.0 + away[:, None]) - size / 2.0
        nearest = np.clip(place, lows, lows + size)
        leaders = np.linspace(np.broadcast_to(place, nearest.shape), nearest, 12)[1:]
        # A rim on the edge of the picture would be cut off.
        free = (lows >= rim).all(axis=1) & (lows + size <= picture.size - np.array(rim)).all(axis=1)
        cost = _inside(dots[:, None], lows - rim, lows + size + rim).sum(axis=0) + away / text
        # What a label names may lie on a line, from which its leader goes.
        starts = place + (rim / away)[:, None] * (nearest - place)
        boxes, paths = shapely.box(*lows.T, *(lows + size).T), shapely.linestrings(np.stack([starts, nearest], axis=1))
        for shapes, each, near in ((boxes, HIDDEN, rim), (paths, CROSSED, rim / 2.0)):
            cost += each * shapely.dwithin(shapes[:, None], shapely.linestrings(lines), near).sum(axis=1)
        for other in written:
            # Boxes that touch read as one.
            free &= ~((lows < other.high + rim) & (other.low < lows + size + rim)).all(axis=1)
            over = _inside(other.leader[:, None], lows, lows + size).any(axis=0)
            cost += CROSSED * (over.astype(int) + _inside(leaders, other.low, other.high).any(axis=0))
        if free.any():
            best = int(np.where(free, cost, np.inf).argmin())
            written.append(_Label(place, lows[best], lows[best] + size, leaders[:, best], label, colour))
    # Grey and with a dot at its end: a coloured one would look like a crack. On a paper rim, over whatever colours.
    for colour, grown in ((palette.PAPER, max(1, text // 10)), (palette.FAINT, 0)):
        for one in written:
            draw.line((*one.place, *one.leader[-1]), fill=colour, width=max(1, text // 16) + 2 * grown)
            draw.circle(tuple(one.place.tolist()), text / 8.0 + grown, fill=colour)
    for one in written:
        box = (*one.low.tolist(), *one.high.tolist())
        draw.rounded_rectangle(box, 0.25 * text, fill=palette.PAPER, outline=one.colour, width=max(1, text // 15))
        draw.text(tuple(((one.low + one.high) / 2.0).tolist()), one.words, palette.INK, font, anchor="mm")


def along_lines(ends: np.ndarray) -> np.ndarray:
    """(5 n, d) array: points along lines with ends (n, 2, d), these included."""
    share = np.linspace(0.0, 1.0, 5)[:, None, None]
    return np.asarray((1.0 - share) * ends[:, 0] + share * ends[:, 1]).reshape(-1, ends.shape[-1])


class _Label(NamedTuple):
    """Words in a box beside a place of a picture, with points of the leader from there to the box [pixel]."""

    place: np.ndarray
    low: np.ndarray
    high: np.ndarray
    leader: np.ndarray
    words: str
    colour: tuple[int, int, int]


def _inside(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(...) bool array: whether points (..., 2) lie inside boxes between corners (..., 2)."""
    return np.asarray(((points > low) & (points < high)).all(axis=-1))


def write_words(picture: Image.Image, place: tuple[float, float], words: str, text: int) -> None:
    """Write faint words, their middle at a place of a picture [pixel]."""
    ImageDraw.Draw(picture).text(place, words, palette.FAINT, _font(round(SMALL * text)), anchor="mm")


def place_in(shape: shapely.Geometry) -> np.ndarray:
    """(2,) array: the centroid of an area, or another place in it where it is bent and has that outside."""
    return shapely.get_coordinates(shape.centroid if shape.contains(shape.centroid) else shape.point_on_surface())[0]


def room_in(ring: np.ndarray) -> np.ndarray:
    """(2,) array: width and height of a box in the shape of that around an outline (n, 2), as large as the outline."""
    width, height = np.ptp(ring, axis=0)
    x, y = (ring - ring[0]).T
    area = 0.5 * abs(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()))
    return np.array([width, height]) * np.sqrt(area / (width * height) if width * height else 0.0)


def _width(key: Key, size: int) -> float:
    """Pixels that an entry of the legend takes, in letters of some size."""
    return _font(size).getlength(key.text) + (max(1.7 * size, key.length) + 0.5 * size) * bool(key.kind)


def _swatch(draw: ImageDraw.ImageDraw, key: Key, x: float, y: float, wide: float, text: float) -> None:
    if key.kind == "area":
        box, width = (x, y - 0.38 * text, x + wide, y + 0.38 * text), max(1, round(text / 12))
        draw.rectangle(box, fill=key.colour, outline=key.rim, width=width if key.rim else 0)
        for k, shade in enumerate(key.shades):
            sides = (x + wide * end / len(key.shades) for end in (k, k + 1))
            draw.rectangle((next(sides), box[1], next(sides), box[3]), fill=shade)
    elif key.kind == "dash":
        for k in range(3):
            left = x + (k + 0.15) * wide / 3.0
            draw.rectangle((left, y - 0.04 * text, left + 0.7 * wide / 3.0, y + 0.04 * text), fill=key.colour)
    elif key.kind == "dot":
        r = 0.3 * text
        draw.ellipse((x + wide / 2 - r, y - r, x + wide / 2 + r, y + r), fill=key.colour)
    else:
        half = 0.13 * text if key.kind == "line" else 0.17 * text
        length = key.length or wide
        draw.rectangle((x + wide - length, y - half, x + wide, y + half), fill=key.colour)


def fitting_font(text: str, size: int, room: float, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Largest font up to ``size`` in which the text fits."""
    font = _font(size, bold)
    while size > 7 and font.getlength(text) > room:
        size -= 1
        font = _font(size, bold)
    return font


def fitting_rows(
    text: str, size: int, room: Sequence[float], *, bold: bool = False
) -> tuple[list[str], ImageFont.FreeTypeFont]:
    """Break a text between its parts into rows with so much room each, in the largest font up to ``size`` that fits."""
    while True:
        font, parts, rows = _font(size, bold), text.split(SEPARATOR), list[str]()
        for wide in room:
            count = sum(font.getlength(SEPARATOR.join(parts[:n])) <= wide for n in range(1, len(parts) + 1))
            rows.append(SEPARATOR.join(parts[:count]))
            parts = parts[count:]
        if not parts or size <= 7:
            rows[-1] = SEPARATOR.join(filter(None, [rows[-1], *parts]))
            return rows, font
        size -= 1


@cache
def _font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    # matplotlib ships the DejaVu fonts, so pictures look the same on every machine.
    import matplotlib

    folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    return ImageFont.truetype(str(folder / ("DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf")), max(size, 6))


@dataclass(frozen=True)
class Frame:
    """The part of the world that a picture shows, between opposite corners (d,) [m]."""

    low: np.ndarray
    high: np.ndarray

    @property
    def size(self) -> np.ndarray:
        """(d,) array [m]: width and height, in space depth and height."""
        return self.high - self.low

    def holding(self, points: np.ndarray) -> Frame:
        """Grow the frame where points (n, 2) [m] lie beyond it, with a margin."""
        margin = 0.02 * float(self.size.max())
        low, high = points.min(axis=0, initial=np.inf) - margin, points.max(axis=0, initial=-np.inf) + margin
        return Frame(np.minimum(self.low, low), np.maximum(self.high, high))

    def fitted(self, width: int, height: int) -> Frame:
        """Grow the frame to the proportions of a picture of ``width`` × ``height`` pixels."""
        centre = (self.low + self.high) / 2.0
        scale = max(self.size[0] / width, self.size[1] / height)
        half = np.array([width, height]) * scale / 2.0
        return Frame(centre - half, centre + half)


def text_height(width: int, height: int) -> float:
    """Height [pixels] of the text of a sheet of so many pixels.

    It is a part of the side of a square as large, or of the width: as wide as the text of an A4 page, 174 mm, the
    smallest letters then have 7 points.
    """
    return max(float(np.sqrt(width * height)) * (1.0 / 48.0), width * (1.0 / 62.0))


def sheet_size(
    frame: Frame, usual: tuple[int, int] = STILL_SIZE, beside: float = 0.0, across: int = 1
) -> tuple[int, int]:
    """Width and height [pixels], both even, of a sheet in the proportions of what it shows, in views side by side.

    It has as many pixels as the usual one, and ``beside`` the blocks goes something so wide, in heights of the text,
    which are those of so many sheets ``across`` a page.
    """
    width, height = frame.size.reshape(-1, 2).max(axis=0)
    proportion = height / (width * len(frame.size) / 2.0)
    pixels = float(np.prod(usual))
    text = text_height(across * usual[0], usual[1])
    for footer in FOOTER:
        # A strip as high as the words, and the blocks' picture.
        words = (HEADER + footer - proportion * beside) * text
        wide = (np.sqrt(words**2 + 4.0 * proportion * pixels) - words) / (2.0 * proportion)
        wide = float(np.clip(wide, usual[1], usual[0]))
        if wide >= NARROW * text:
            break
    high = float(np.clip(proportion * wide + words, usual[0] / 3.0, pixels / wide))
    return 2 * round(wide / 2.0), 2 * round(high / 2.0)


def framed(
    assembly: solver.Assembly,
    poses: Iterable[solver.Pose],
    margin: float = 0.04,
    supports: float = 0.13,
    axes: np.ndarray | None = None,
    whole: float = 0.0,
    cut: np.ndarray | None = None,
) -> Frame:
    """Frame in which every free block stays over all poses as drawn, which are gone through once.

    The margin is an empty border, as a fraction of the larger dimension. Supports are shown as far as another fraction
    of it beyond the free blocks, for layouts have supports of any extent, or whole where the picture is then no larger
    than so many times the free blocks. The axes (2, d) are to the right and up in the picture, those of the drawing by
    default. What a cut leaves out, a point [m] of a plane and its normal towards what is kept, takes no room.
    """
    inner, outer = list[np.ndarray](), list[np.ndarray]()
    for pose in poses:
        corners, owner = mechanics.moved_vertices(assembly, pose), assembly.block_of_vertex
        if cut is not None:
            corners, owner = _left_by(cut, assembly, corners)
        corners = corners if axes is None else corners @ axes.T
        for bounds, of in ((inner, assembly.free[owner]), (outer, ~assembly.free[owner])):
            if of.any():
                bounds += [corners[of].min(axis=0), corners[of].max(axis=0)]
    return frame_around(inner, outer, margin, supports, whole)


def frame_around(free: ArrayLike, supported: ArrayLike, margin: float, supports: float, whole: float = 0.0) -> Frame:
    """Frame around points (n, d) [m] of free blocks, and of supports, with borders as of :func:`framed`."""
    inner, outer = np.asarray(free), np.asarray(supported)
    # Where no free block is to be seen, or no support.
    inner, outer = inner if len(inner) else outer, outer if len(outer) else inner
    (low, high), (outer_low, outer_high) = ((of.min(axis=0), of.max(axis=0)) for of in (inner, outer))
    size = float((high - low).max())
    all_of_it = float((np.maximum(high, outer_high) - np.minimum(low, outer_low)).max())
    beyond = np.inf if all_of_it <= whole * size else supports * size
    # The corner of a sloping ground that is cut off just before its end looks like a shape of its own.
    reach = beyond if whole else JUST_OUTSIDE * beyond
    low = np.minimum(low, np.where(low - outer_low <= reach, outer_low, low - beyond))
    high = np.maximum(high, np.where(outer_high - high <= reach, outer_high, high + beyond))
    return Frame(low - margin * size, high + margin * size)


def _left_by(cut: np.ndarray, assembly: solver.Assembly, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners of what a plane leaves of blocks in space, (n, 3) [m], and the block of each; also those in the plane."""
    shapes = assembly.polyhedra
    heights = (corners - cut[0]) @ cut[1]
    start, end = shapes.corners, shapes.corners[shapes.next_corner]
    across = (heights[start] < 0.0) & (heights[end] > 0.0)
    start, end = start[across], end[across]
    share = (heights[start] / (heights[start] - heights[end]))[:, None]
    owner = assembly.block_of_vertex
    kept = (heights >= 0.0) & left_blocks(assembly, heights)[owner]
    points = np.concatenate([corners[kept], corners[start] + share * (corners[end] - corners[start])])
    return points, np.concatenate([owner[kept], owner[start]])
