"""From the colours of an image to labels: masks, label images, also antialiased or of a lossy format; photographs not.

A label has a value that lies flat somewhere: a square of three pixels of nothing else. Values in between, at the
borders of an antialiased image, have none, and their pixels go to the nearest label.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageColor

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

#: The background is on the rim: at least this share of it, and on three of its four sides.
RIM = 0.5


@dataclass(frozen=True)
class Labels:
    """Labels of the pixels of an image.

    Attributes
    ----------
    numbers : (height, width) int array
        From 1; 0 for the background.
    names : tuple of str
        Of the labels from 1 on; empty where each region is a stone of its own, as in a mask.
    background : str
        What it is, in words; "" for none.
    moved : int
        Pixels of no label's value, which went to the nearest label.
    is_mask : bool
        Whether all stones have one value.
    """

    numbers: np.ndarray
    names: tuple[str, ...]
    background: str
    moved: int
    is_mask: bool


class Photograph(ValueError):
    """The image has no labels."""


def labels_of(image: Image.Image, background: int | str | None = None) -> Labels:
    """Find the labels of an image.

    Parameters
    ----------
    image : PIL.Image.Image
    background : int or str, optional
        Value, or colour, of what is no stone.

    Raises
    ------
    Photograph
    ValueError
        For values that are no labels, and a background that the image does not have.
    """
    opaque, image = _opaque(image)
    values, words = _values(image)
    wanted = None if background is None else _value(background, image, words)
    if _alike(values) >= EXACT and image.format != "JPEG":
        numbers, known, moved = _of_values(values, image)
        pieces = None
    else:
        numbers, colours, moved, pieces = _of_noise(image)
        known = np.arange(len(colours))
        words = {k: _colour(rgb) for k, rgb in enumerate(colours)}
        wanted = None if wanted is None else _nearest_colour(wanted, colours, str(background))
    if not opaque.all():
        numbers = np.where(opaque, numbers, len(known))
        known = np.append(known, -1)
        words = {**words, -1: "transparent"}
        wanted = -1 if wanted is None else wanted
    called = [words.get(int(value), str(value)) for value in known]
    if wanted is not None and wanted not in known:
        raise ValueError(f"has no background {background!r}; its values are {', '.join(called[:8])}")
    mask = len(known) == 2
    if wanted is not None:
        found: int | None = int(np.flatnonzero(known == wanted)[0])
    else:
        found = _background_of_mask(numbers) if mask else _background(numbers, known, words)
    said = "" if found is None else called[found]
    if pieces is not None and not mask:
        # Of what is noisy, what hangs together is a stone: of two in one colour the line between may be lost.
        return Labels(pieces if found is None else np.where(numbers == found, 0, pieces), (), said, moved, False)
    order = np.arange(1, len(known) + 1)
    if found is not None:
        order[found:] -= 1
        order[found] = 0
    names = () if mask else tuple(word for k, word in enumerate(called) if k != found)
    return Labels(order[numbers], names, said, moved, mask)


def _opaque(image: Image.Image) -> tuple[np.ndarray, Image.Image]:
    """(height, width) bool array: where an image is to be seen; and the image without its transparency."""
    form = image.format
    if image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info:
        seen = np.asarray(image.convert("RGBA"))[..., 3] >= 128
        image = image.convert("RGB")
    else:
        seen = np.ones((image.height, image.width), dtype=bool)
    image.format = form
    return seen, image


def _values(image: Image.Image) -> tuple[np.ndarray, dict[int, str]]:
    """(height, width) int array: the value of each pixel; and the words for those that are colours."""
    if image.mode == "F":
        real = np.asarray(image)
        if not np.isfinite(real).all() or (real != np.round(real)).any():
            bad = real[~(np.isfinite(real) & (real == np.round(real)))][0]
            raise ValueError(f"has the value {bad:g}; labels are whole numbers: joints 0, stones 1, 2, ...")
        return real.astype(np.int64), {}
    if image.mode in ("1", "L", "P", "I") or image.mode.startswith("I;16"):
        return np.asarray(image).astype(np.int64), {}
    rgb = np.asarray(image.convert("RGB")).astype(np.int64)
    if (rgb == rgb[..., :1]).all():
        return rgb[..., 0], {}
    packed = rgb @ [65536, 256, 1]
    return packed, {int(v): f"#{v:06x}" for v in np.unique(packed)[:100_000]}


def _value(background: int | str, image: Image.Image, words: dict[int, str]) -> int:
    """Find the value of a background: a number, or a colour."""
    if isinstance(background, int) or background.strip().isdecimal():
        return int(background)
    try:
        r, g, b = ImageColor.getrgb(background)[:3]
    except ValueError:
        raise ValueError(
            f'has no background {background!r}; give a value, or a colour such as "white" or "#ff8000"'
        ) from None
    if words or image.format == "JPEG":
        return (r << 16) + (g << 8) + b
    if image.mode == "P":
        near = np.abs(np.array(image.getpalette("RGB")).reshape(-1, 3) - [r, g, b]).sum(axis=1)
        return int(near.argmin())
    return r


def _nearest_colour(wanted: int, known: np.ndarray, word: str) -> int:
    rgb = np.array([wanted >> 16, wanted >> 8 & 255, wanted & 255] if wanted > 255 else [wanted] * 3)
    apart = np.abs(known - rgb).max(axis=1)
    if apart.min() > 2 * FLAT:
        raise ValueError(f"has no background {word!r}; its colours are {', '.join(map(_colour, known[:8]))}")
    return int(apart.argmin())


def _colour(rgb: np.ndarray) -> str:
    return "#" + "".join(f"{round(float(c)):02x}" for c in np.clip(rgb, 0, 255))


def _alike(values: np.ndarray) -> float:
    """Share of the pixels that are like those right of them and below."""
    if min(values.shape) < 2:
        return 1.0
    first = values[:-1, :-1]
    return float(((first == values[1:, :-1]) & (first == values[:-1, 1:])).mean())


def _of_values(values: np.ndarray, image: Image.Image) -> tuple[np.ndarray, np.ndarray, int]:
    """Find the labels of an exact image: the number of each pixel, their values, and how many pixels were moved."""
    from scipy import ndimage

    known, place = np.unique(values, return_inverse=True)
    place = place.reshape(values.shape).astype(np.int32)
    if len(known) <= 2:
        return place, known, 0
    core = ndimage.minimum_filter(place, 3) == ndimage.maximum_filter(place, 3)
    label = np.bincount(place[core], minlength=len(known)) > 0
    share = np.bincount(place.ravel(), minlength=len(known)) / place.size
    thin = ~label & (share >= THIN)
    # Many values of some share each are a blur, not lines between stones.
    label |= thin & (thin.sum() <= max(2, label.sum()))
    if not label.any():
        raise ValueError("has no region of one value three pixels wide; give an image of more pixels")
    order = np.cumsum(label) - 1
    if label.all():
        return place, known, 0
    between = ~label[place]
    if label.sum() == 2:
        rgb = np.asarray(image.convert("RGB")).astype(float) if image.mode not in ("I", "F") else values[..., None]
        middle = [np.median(rgb[place == k], axis=0) for k in np.flatnonzero(label)]
        away = [np.abs(rgb - colour).sum(axis=2) for colour in middle]
        numbers = np.where(between, (away[1] < away[0]).astype(np.int32), order[place])
    else:
        row, column = ndimage.distance_transform_edt(between, return_distances=False, return_indices=True)
        numbers = order[place[row, column]]
    return numbers, known[label], int(between.sum())


def _of_noise(image: Image.Image) -> tuple[np.ndarray, np.ndarray, int, np.ndarray]:
    """Find the colours of a noisy image.

    Returns
    -------
    numbers : (height, width) int array
        The colour of each pixel.
    colours : (n, 3) array
    moved : int
        Pixels of none of them.
    pieces : (height, width) int array
        What hangs together, from 1.
    """
    from scipy import ndimage

    rgb = np.asarray(image.convert("RGB")).astype(np.int16)
    spread = (ndimage.maximum_filter(rgb, (3, 3, 1)) - ndimage.minimum_filter(rgb, (3, 3, 1))).max(axis=2)
    flat = spread <= FLAT
    pieces, n = ndimage.label(flat)
    count = np.bincount(pieces.ravel(), minlength=n + 1)
    large = np.flatnonzero(count[1:] >= 9) + 1
    if n == 0 or len(large) == 0 or flat.mean() < LEAST_FLAT:
        raise Photograph
    deviation = np.sqrt(sum(ndimage.variance(rgb[..., c], pieces, large) for c in range(3)))
    if float(np.average(deviation, weights=count[large])) > NOISE:
        raise Photograph
    colour = np.stack([ndimage.mean(rgb[..., c], pieces, large) for c in range(3)], axis=1)
    two = _two_colours(rgb, colour, count[large])
    if two is not None:
        away = [np.abs(rgb - one).sum(axis=2) for one in two]
        numbers = (away[1] < away[0]).astype(np.int32)
        return numbers, two, int((np.minimum(*away) > 3 * FLAT).sum()), numbers + 1
    alike = _alike_colours(colour, count[large])
    order, piece = np.full((2, n + 1), -1, dtype=np.int32)
    order[large], piece[large] = alike, np.arange(1, len(large) + 1)
    weight = count[large]
    known = np.stack(
        [np.average(colour[alike == k], axis=0, weights=weight[alike == k]) for k in range(alike.max() + 1)]
    )
    numbers, own = order[pieces], piece[pieces]
    # Joints too thin to be flat have the colour of the background.
    outer = _outer(numbers)
    thin = (numbers < 0) & (np.abs(rgb - known[outer]).max(axis=2) <= FLAT)
    numbers[thin], own[thin] = outer, len(large) + 1
    row, column = ndimage.distance_transform_edt(numbers < 0, return_distances=False, return_indices=True)
    return numbers[row, column], known, int((numbers < 0).sum()), own[row, column]


def _outer(numbers: np.ndarray) -> int:
    """Find the commonest number on the rim."""
    rim = np.concatenate([numbers[0], numbers[-1], numbers[:, 0], numbers[:, -1]])
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
        return None
    far = np.minimum(*(np.abs(rgb - one).max(axis=2) for one in (first, second))) > 2 * FLAT
    stray = np.minimum(*(np.abs(colour - one).max(axis=1) for one in (first, second))) > 2 * FLAT
    return None if far.mean() > MOST_BETWEEN or weight[stray].sum() > 0.01 * weight.sum() else np.stack([first, second])


def _background_of_mask(numbers: np.ndarray) -> int:
    """Choose which of two values is that of joints: that between more stones; of both alike, that on the rim."""
    from scipy import ndimage

    pieces = []
    for k in (0, 1):
        found, n = ndimage.label(numbers != k)
        pieces.append(int((np.bincount(found.ravel(), minlength=n + 1)[1:] >= 9).sum()))
    return _outer(numbers) if pieces[0] == pieces[1] else int(pieces[1] > pieces[0])


def _background(numbers: np.ndarray, known: np.ndarray, words: dict[int, str]) -> int | None:
    """Find the background of a label image: the value 0, or what is on most of the rim; None if there is none."""
    zero = np.flatnonzero(known == 0)
    if len(zero) and not words:
        return int(zero[0])
    outer = _outer(numbers)
    sides = [numbers[0], numbers[-1], numbers[:, 0], numbers[:, -1]]
    share = np.concatenate([side == outer for side in sides]).mean()
    if share >= RIM and sum((side == outer).any() for side in sides) >= 3:
        return outer
    return int(zero[0]) if len(zero) else None
