"""From the colours of an image to labels: masks, label images, also antialiased or of a lossy format; photographs not.

A label has a value that lies flat somewhere: a square of three pixels of nothing else. Values in between, at the
borders of an antialiased image, have none, and their pixels go to the nearest label.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image, ImageColor
from scipy import ndimage

#: An image is exact where at least this share of pixels is like those right of it and below: less is noise or blur.
EXACT = 0.6

#: Pixels that differ by no more from those around them, of 255, lie flat in a noisy image ...
FLAT = 30

#: ... which is of labels where at least this share is flat, and what hangs together there deviates by no more.
LEAST_FLAT, NOISE = 0.5, 12.0

#: A value without a flat place is a label, such as a line between stones, from this share of the image on.
THIN = 0.005

#: Two values are those of a mask where the others hold no more than this share.
MOST_BETWEEN = 0.15

#: Labels of which every channel is more, of 255, are the white of a page to the eye.
WHITE = 240

#: Channels of grey differ by no more, of 255.
GREY = 8

#: So many pixels from another label a codec, which works on squares of 16 pixels, leaves what was one value exact ...
CODEC = 16

#: ... where this share of pixels, or more, is like those right of it and below, and less than EXACT of what varies.
PAINTED = 0.95

#: Pixels so near to the background may be of its border, and a flat place of a noisy image is so far from its own
#: [pixels].
BORDER = 3.0

#: Lines are nowhere wider than this fraction of the image's smaller side ...
WIDEST_LINE = 0.02

#: ... and so many times as long as wide where they enclose little: stones may be as narrow, and are not so long.
LONG_LINE = 8.0

#: Value that stands for what is transparent.
TRANSPARENT = -1

#: The background is on the rim: at least this share of it, and on three of its four sides.
RIM = 0.5


@dataclass(frozen=True)
class Labels:
    """Labels of the pixels of an image.

    ``numbers`` (height, width) are from 1, 0 for the background, which is called ``background``, "" for none. ``names``
    of the labels from 1 on are empty where each region is a stone of its own, as in a mask, of which all stones have
    one value. ``moved`` counts pixels of no label's value, which went to the nearest label.
    ``is_of_lines``: the stones are the paper of a drawing of lines, and so is what is around them.
    """

    numbers: np.ndarray
    names: tuple[str, ...]
    background: str
    moved: int
    is_mask: bool
    is_of_lines: bool = False


class Photograph(ValueError):
    """The image has no labels."""


def labels_of(image: Image.Image, background: int | str | None = None) -> Labels:
    """Find the labels of an image, of which a background may be given by its value or colour.

    ``Photograph`` is raised for what has none, ``ValueError`` for values that are no labels.
    """
    opaque, image = _opaque(image)
    values, coloured = _values(image)
    wanted = None if background is None else _value(background, image, coloured)
    exact = _alike(values) >= EXACT and image.format != "JPEG"
    found = _of_values(values, image, wanted) if exact else _of_noise(image)
    known = list(found.values)
    called = [f"#{value:06x}" if coloured else str(value) for value in known]
    if not exact:
        called = [_colour(rgb) for rgb in found.colours]
        wanted = None if wanted is None else _nearest_colour(wanted, found.colours, str(background))
    numbers = found.numbers
    if not opaque.all():
        numbers = np.where(opaque, numbers, len(known))
        known, called = [*known, TRANSPARENT], [*called, "transparent"]
        wanted = TRANSPARENT if wanted is None else wanted
    if wanted is not None and wanted not in known:
        raise ValueError(f"it has no background {background!r}; its values are {', '.join(called[:8])}")
    mask = len(known) == 2
    lines = _lines_of_mask(numbers) if mask else None
    outer = lines if wanted is None else known.index(wanted)
    if outer is None and mask:
        outer = _background_of_mask(_filled(numbers, found, 0, np.inf)[0])
    elif outer is None:
        outer = _background(numbers, known, coloured=coloured or not exact)
    if not exact and _is_painted(found, outer):
        raise Photograph
    numbers, nearest = _filled(numbers, found, outer, np.inf if mask else BORDER)
    moved, said = int((found.numbers < 0).sum()), "" if outer is None else called[outer]
    if not exact and not mask:
        # Of what is noisy, what hangs together is a stone: of two in one colour the line between may be lost.
        return Labels(np.where(numbers == outer, 0, found.pieces[nearest]), (), said, moved, False)
    order = np.arange(1, len(known) + 1)
    if outer is not None:
        order[outer:] -= 1
        order[outer] = 0
    names = () if mask else tuple(word for k, word in enumerate(called) if k != outer)
    return Labels(order[numbers], names, said, moved, mask, outer is not None and outer == lines)


@dataclass(frozen=True)
class _Found:
    """Values that are labels, before the pixels between them go to one.

    ``numbers`` (height, width) are those of each pixel's value, from 0, -1 for none; ``colours`` those of the values,
    and ``shown`` those of the pixels. In a noisy image ``pieces`` number what hangs together, from 1.
    """

    numbers: np.ndarray
    values: tuple[int, ...]
    colours: np.ndarray
    shown: np.ndarray
    pieces: np.ndarray


def _filled(numbers: np.ndarray, found: _Found, outer: int | None, reach: float) -> tuple[np.ndarray, Any]:
    """Give the pixels between labels to the nearest one, or to the background if that is near and more alike.

    Beside the numbers (height, width) it gives rows and columns of the nearest pixel that is of a stone.
    """
    between, ground = numbers < 0, numbers == (-1 if outer is None else outer)
    nearest = tuple(ndimage.distance_transform_edt(between | ground, return_distances=False, return_indices=True))
    stone = numbers[nearest]
    if outer is None or outer >= len(found.colours) or not between.any():
        return np.where(between, stone, numbers), nearest
    near = between & (ndimage.distance_transform_edt(~ground) <= reach)
    shown = found.shown[near]
    away = [np.abs(shown - colour).sum(axis=1) for colour in (found.colours[outer], found.colours[stone[near]])]
    result = np.where(between, stone, numbers)
    result[near] = np.where(away[0] < away[1], outer, stone[near])
    return result, nearest


def _opaque(image: Image.Image) -> tuple[np.ndarray, Image.Image]:
    """(height, width) bool array: where an image is to be seen; and the image without its transparency.

    What is transparent around lines is their paper.
    """
    form = image.format
    if image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info:
        drawn = image.convert("RGBA")
        seen, image = np.asarray(drawn)[..., 3] >= 128, image.convert("RGB")
        if seen.any() and _are_lines(seen, ~seen):
            is_dark = np.median(np.asarray(image)[seen]) < 128
            paper = Image.new("RGBA", drawn.size, "white" if is_dark else "black")
            seen, image = np.ones_like(seen), Image.alpha_composite(paper, drawn).convert("RGB")
    else:
        seen = np.ones((image.height, image.width), dtype=bool)
    image.format = form
    return seen, image


def _values(image: Image.Image) -> tuple[np.ndarray, bool]:
    """(height, width) int array: the value of each pixel; and whether they are colours."""
    if image.mode == "F":
        real = np.asarray(image)
        if not np.isfinite(real).all() or (real != np.round(real)).any():
            bad = real[~(np.isfinite(real) & (real == np.round(real)))][0]
            raise ValueError(f"it has the value {bad:g}; labels are whole numbers: joints 0, stones 1, 2, ...")
        return real.astype(np.int64), False
    if image.mode in ("1", "L", "P", "I") or image.mode.startswith("I;16"):
        return np.asarray(image).astype(np.int64), False
    rgb = np.asarray(image.convert("RGB")).astype(np.int64)
    apart = np.ptp(rgb, axis=2).max()
    # Small numbers in one channel, as panoptic labels have, differ by no more than the channels of a noisy grey.
    if apart == 0 or (apart <= GREY < np.ptp(rgb[..., 1])):
        return rgb[..., 1], False
    return rgb @ [65536, 256, 1], True


def _value(background: int | str, image: Image.Image, coloured: bool) -> int:
    """Find the value of a background: a number, or a colour."""
    if isinstance(background, int) or background.strip().isdecimal():
        return int(background)
    try:
        r, g, b = ImageColor.getrgb(background)[:3]
    except ValueError:
        raise ValueError(
            f'it has no background {background!r}; give a value, or a colour such as "white" or "#ff8000"'
        ) from None
    if coloured or image.format == "JPEG":
        return (r << 16) + (g << 8) + b
    if image.mode == "P":
        near = np.abs(np.array(image.getpalette("RGB")).reshape(-1, 3) - [r, g, b]).sum(axis=1)
        return int(near.argmin())
    return r


def _nearest_colour(wanted: int, known: np.ndarray, word: str) -> int:
    rgb = np.array([wanted >> 16, wanted >> 8 & 255, wanted & 255] if wanted > 255 else [wanted] * 3)
    apart = np.abs(known - rgb).max(axis=1)
    if apart.min() > 2 * FLAT:
        raise ValueError(f"it has no background {word!r}; its colours are {', '.join(map(_colour, known[:8]))}")
    return int(apart.argmin())


def _colour(rgb: np.ndarray) -> str:
    return "#" + "".join(f"{round(float(c)):02x}" for c in np.clip(rgb, 0, 255))


def _alike(values: np.ndarray) -> float:
    """Share of the pixels that are like those right of them and below."""
    return float(_same(values[..., None]).mean()) if min(values.shape) > 1 else 1.0


def _same(shown: np.ndarray) -> np.ndarray:
    """(height - 1, width - 1) bool array: which pixels are like those right of them and below."""
    first = shown[:-1, :-1]
    same: np.ndarray = ((first == shown[1:, :-1]) & (first == shown[:-1, 1:])).all(axis=2)
    return same


def _is_painted(found: _Found, outer: int | None) -> bool:
    """Whether stones are exact and something else is not, as of a photograph whose openings are painted over.

    The noise of a codec, or of a scan, is everywhere.
    """
    same, shares = _same(found.shown), dict[int, float]()
    for k in range(len(found.values)):
        other = (found.numbers >= 0) & (found.numbers != k)
        deep = (found.numbers == k) & (ndimage.distance_transform_edt(~other) > CODEC)
        own = same[deep[:-1, :-1]]
        shares |= {k: float(own.mean())} if len(own) else {}
    stones = [share for k, share in shares.items() if k != outer]
    return max(stones, default=0.0) >= PAINTED and min(shares.values()) < EXACT


def _of_values(values: np.ndarray, image: Image.Image, wanted: int | None) -> _Found:
    """Find the labels of an exact image; the value of a background that is asked for is one."""
    known, inverse = np.unique(values, return_inverse=True)
    place = inverse.reshape(values.shape).astype(np.int32)
    share = np.bincount(place.ravel(), minlength=len(known)) / place.size
    several = image.mode in ("P", "RGB") and (image.mode == "P" or known[-1] > 255)
    shown = np.asarray(image.convert("RGB")).astype(float) if several else values[..., None].astype(float)
    core = ndimage.minimum_filter(place, 3) == ndimage.maximum_filter(place, 3)
    label = np.bincount(place[core], minlength=len(known)) > 0
    if wanted is None and (label.sum() == 1 or (label.any() and shown[label[place]].min() > WHITE)):
        drawn = _lines_on_paper(shown, label[place])
        if drawn is not None:
            return drawn
    if len(known) <= 2:
        label[:] = True
    else:
        thin = ~label & (share >= THIN)
        if label.sum() == 2 and thin.any():
            thin &= ~_half_covered(place, label, shown) | (known == wanted)
        # Many values of some share each are a blur, not lines between stones.
        label |= thin & (thin.sum() <= max(2, label.sum()))
    if not label.any():
        raise ValueError("it has no region of one value three pixels wide; give an image of more pixels")
    numbers = np.where(label[place], (np.cumsum(label) - 1)[place], -1).astype(np.int32)
    first = np.unique(numbers.ravel(), return_index=True)[1][-int(label.sum()) :]
    colours = shown.reshape(-1, shown.shape[2])[first]
    return _Found(numbers, tuple(map(int, known[label])), colours, shown, np.zeros((0, 0), dtype=int))


def _lines_on_paper(shown: np.ndarray, flat: np.ndarray) -> _Found | None:
    """Find lines, none of them flat, on what is flat, which is paper; None where what differs from it is no lines."""
    paper = np.median(shown[flat], axis=0)
    ink = np.abs(shown - paper).max(axis=2) > FLAT
    if not _are_lines(ink, ~ink):
        return None
    colours = np.stack([paper, np.median(shown[ink], axis=0)])
    values = [int(np.round(colour) @ [65536, 256, 1][-len(colour) :]) for colour in colours]
    return _Found(ink.astype(np.int32), (values[0], values[1]), colours, shown, np.zeros((0, 0), dtype=int))


def _half_covered(place: np.ndarray, label: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """(n,) bool array: which values are mixed of two labels, and lie beside both, as at an antialiased border.

    ``place`` (height, width) numbers the values of pixels, of which two are labels.
    """
    colours = shown.reshape(-1, shown.shape[2])[np.unique(place.ravel(), return_index=True)[1]]
    one, other = colours[label]
    if np.abs(one - other).max() <= 2 * FLAT:
        # Numbers of stones, as 1 and 3, not colours.
        return np.zeros(len(label), dtype=bool)
    mixed = np.abs(colours - one).sum(axis=1) + np.abs(colours - other).sum(axis=1) <= np.abs(one - other).sum()
    beside = [ndimage.maximum_filter(place == k, 5) for k in np.flatnonzero(label)]
    both = np.bincount(place[beside[0] & beside[1]], minlength=len(label))
    result: np.ndarray = mixed & (both > 0.5 * np.bincount(place.ravel(), minlength=len(label)))
    return result


def _of_noise(image: Image.Image) -> _Found:
    if image.mode in ("I", "F") or image.mode.startswith("I;16"):
        # As 8 bits Pillow takes what is above 255 for white.
        deep = np.asarray(image).astype(float)
        image = Image.fromarray(np.round(255.0 * (deep - deep.min()) / max(np.ptp(deep), 1.0)).astype(np.uint8))
    rgb = np.asarray(image.convert("RGB")).astype(np.int16)
    flat = (ndimage.maximum_filter(rgb, (3, 3, 1)) - ndimage.minimum_filter(rgb, (3, 3, 1))).max(axis=2) <= FLAT
    pieces, n = ndimage.label(flat)
    # What is flat along a border, where the noise is, is narrow.
    wide = ndimage.maximum(ndimage.distance_transform_edt(flat), pieces, np.arange(1, n + 1)) if n else np.zeros(0)
    large = np.flatnonzero(np.asarray(wide) >= BORDER) + 1
    if len(large) == 0 or flat.mean() < LEAST_FLAT:
        raise Photograph
    weight = np.bincount(pieces.ravel(), minlength=n + 1)[large]
    shown, of_pixel = rgb.reshape(-1, 3).astype(float), pieces.ravel()
    colour = np.stack([np.bincount(of_pixel, c, n + 1)[large] for c in shown.T], axis=1) / weight[:, None]
    squares = np.stack([np.bincount(of_pixel, c, n + 1)[large] for c in shown.T**2], axis=1) / weight[:, None]
    deviation = np.sqrt(np.maximum(squares - colour**2, 0.0).sum(axis=1))
    if float(np.average(deviation, weights=weight)) > NOISE:
        raise Photograph
    two = _two_colours(rgb, colour, weight)
    if two is not None:
        away = np.stack([np.abs(rgb - one).max(axis=2) for one in two])
        numbers = np.where(away.min(axis=0) <= 3 * FLAT, away.argmin(axis=0), -1)
        return _Found(numbers, (0, 1), two, rgb, np.zeros((0, 0), dtype=int))
    alike = _alike_colours(colour, weight)
    order, piece = np.full((2, n + 1), -1, dtype=np.int32)
    order[large], piece[large] = alike, np.arange(1, len(large) + 1)
    share = [np.where(alike == k, weight, 0) for k in range(alike.max() + 1)]
    colours = np.stack([np.average(colour, axis=0, weights=own) for own in share])
    if _shades_of_paper(rgb, colours):
        raise Photograph
    numbers, own = order[pieces], piece[pieces]
    # Joints too thin to be flat have the colour of the background.
    outer = _outer(numbers)
    thin = (numbers < 0) & (np.abs(rgb - colours[outer]).max(axis=2) <= FLAT)
    numbers[thin], own[thin] = outer, len(large) + 1
    return _Found(numbers, tuple(range(len(colours))), colours, rgb, own)


def rim_of(numbers: np.ndarray) -> np.ndarray:
    """Give what is along the border of an image (height, width)."""
    return np.concatenate([numbers[0], numbers[-1], numbers[:, 0], numbers[:, -1]])


def _outer(numbers: np.ndarray) -> int:
    """Find the commonest number on the rim."""
    rim = rim_of(numbers)
    return int(np.bincount(rim[rim >= 0], minlength=1).argmax())


def _alike_colours(colour: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(n,) int array: the number of each colour, near ones alike, the most frequent first."""
    numbers = np.full(len(colour), -1)
    n = 0
    for k in np.argsort(-weight):
        if numbers[k] < 0:
            near = (np.abs(colour - colour[k]).max(axis=1) <= FLAT / 2) & (numbers < 0)
            numbers[near] = n
            n += 1
    return numbers


def _two_colours(rgb: np.ndarray, colour: np.ndarray, weight: np.ndarray) -> np.ndarray | None:
    """Find the two colours of a noisy mask; None if it has more."""
    first = colour[weight.argmax()]
    second = colour[(np.abs(colour - first).sum(axis=1) * np.sqrt(weight)).argmax()]
    if np.abs(first - second).max() < 3 * FLAT:
        # Joints may be too narrow to lie flat.
        unlike = np.abs(rgb - first).max(axis=2) > 3 * FLAT
        if unlike.mean() <= THIN:
            return None
        second = np.median(rgb[unlike], axis=0)
    far = np.minimum(*(np.abs(rgb - one).max(axis=2) for one in (first, second))) > 2 * FLAT
    stray = np.minimum(*(np.abs(colour - one).max(axis=1) for one in (first, second))) > 2 * FLAT
    return None if far.mean() > MOST_BETWEEN or weight[stray].sum() > 0.01 * weight.sum() else np.stack([first, second])


def _shades_of_paper(rgb: np.ndarray, colours: np.ndarray) -> bool:
    """Whether colours are nearer to each other than to the ink between them, which is none of them."""
    if np.ptp(colours, axis=0).max() >= 3 * FLAT:
        return False
    inked = np.min([np.abs(rgb - own).max(axis=2) for own in colours], axis=0) > 3 * FLAT
    return bool(inked.mean() > THIN)


def _lines_of_mask(numbers: np.ndarray) -> int | None:
    """Choose which of two values is that of lines; None where neither is so, or both are."""
    lines = [_are_lines(numbers == k, numbers == 1 - k) for k in (0, 1)]
    return lines.index(True) if sum(lines) == 1 else None


def _are_lines(mask: np.ndarray, paper: np.ndarray) -> bool:
    """Whether what a mask holds is lines: narrow, and more of the paper is enclosed than covered, or mostly long.

    Small stones are as narrow as lines are. Both arrays are (height, width), of bools; some pixels may be in neither.
    """
    # Nothing lies beyond the rim.
    size = max(3, round(WIDEST_LINE * min(mask.shape)))
    if not mask.any() or ndimage.minimum_filter(mask, size, mode="constant").any():
        return False
    sheets = np.bincount(ndimage.label(paper)[0].ravel())[1:]
    if sheets.sum() - sheets.max(initial=0) > mask.sum():
        return True
    pieces, n = ndimage.label(mask)
    areas = np.bincount(pieces.ravel())[1:]
    widths = 2.0 * ndimage.maximum(ndimage.distance_transform_edt(mask), pieces, np.arange(1, n + 1)) - 1.0
    return bool(areas[areas > LONG_LINE * widths**2].sum() > 0.5 * areas.sum())


def _background_of_mask(numbers: np.ndarray) -> int:
    """Choose which of two values is that of joints: that between more stones; of both alike, that on the rim."""
    pieces = []
    for k in (0, 1):
        found, n = ndimage.label(numbers != k)
        pieces.append(int((np.bincount(found.ravel(), minlength=n + 1)[1:] >= 9).sum()))
    return _outer(numbers) if pieces[0] == pieces[1] else int(pieces[1] > pieces[0])


def _background(numbers: np.ndarray, known: list[int], *, coloured: bool) -> int | None:
    """Find the background of a label image: the value 0, or what is on most of the rim; None if there is none."""
    zero = known.index(0) if 0 in known else None
    if zero is not None and not coloured:
        return zero
    outer = _outer(numbers)
    sides = [numbers[0], numbers[-1], numbers[:, 0], numbers[:, -1]]
    share = np.concatenate([side == outer for side in sides]).mean()
    if share >= RIM and sum((side == outer).any() for side in sides) >= 3:
        return outer
    return zero
