"""Pictures of stones: masks of stones against joints, and label images with a value per stone."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from blockvis.layout.layout import Layout
from blockvis.layout.left_out import LeftOut
from blockvis.layout.notes import CHANGED, LEFT_OUT, Note
from blockvis.layout.outlines import ring_area
from blockvis.text import listed, numbered
from solver.mechanics import counted

from .image_labels import Labels, Photograph, labels_of, rim_of
from .image_scale import Placement, opened, placement_of
from .pixels import SPECK, SPECK_OF_NOISE, STAIRS, Outlined, Regions, outlined, regions_of
from .reading import Reading

#: More of the pixels than this without a label's value, or of the regions with holes, are those of another picture.
MOST_MOVED, MOST_HOLED = 0.25, 0.5

#: In pictures of stones the smaller half of so many regions holds more of the area than this (0.12 and more in 23
#: published masks, 0.03 and less in charts, screens and drawings of results, of which letters and strokes are regions).
FEWEST_OF_CHART, LEAST_OF_SMALL = 20, 0.05

#: More specks than this, and than so many for each region, are those of shading and of hatching.
MOST_SPECKS, SPECKS_OF_ONE = 200, 4

#: Holes of no more than this fraction of a stone are filled, and those that are specks.
PINHOLES = 0.01

#: A region of so many times the median area may be an opening, and of half as many in a drawing of lines, whose
#: openings are all regions, a door of four to six ashlars; so many are named.
MAYBE_OPENING, NAMED = 8.0, 3

#: A rim that runs into more stones than this, and has joints along no more of its length, is none of paper.
FEWEST_AT_RIM, MOST_JOINTS = 4, 0.25

#: What makes masks of photographs.
MASK_MAKERS = "by hand GIMP, labelme or CVAT, by a model SAM"


def read(path: Path, reading: Reading) -> Layout:
    """Read the stones of an image."""
    reading.refuse_view()
    image, tags = opened(path)
    placement = placement_of(path, image.size, reading, tags=tags)
    try:
        labels = labels_of(image, reading.image.get("background"))
    except Photograph:
        raise ValueError(
            f"it is a photograph: its colours are no labels, and blockvis does not find stones in one; make a "
            f"mask of it ({MASK_MAKERS}), and put the photograph under the pictures: [output] underlay"
        ) from None
    return layout_of_labels(labels, placement, reading)


def layout_of_labels(labels: Labels, placement: Placement, reading: Reading) -> Layout:
    """Make a layout of the regions of labels."""
    smallest, tolerance = reading.image.get("smallest"), reading.image.get("outline_tolerance")
    noisy = not labels.is_mask and not labels.names
    labels, rims = _without_rim(labels, placement.pixel) if labels.is_mask else (labels, [])
    speck = SPECK_OF_NOISE if noisy else SPECK
    regions = regions_of(labels.numbers, None if smallest is None else smallest / placement.pixel, speck)
    _check_stones(labels, regions, placement)
    paper = _paper_at_rim(regions) if labels.is_of_lines else []
    if smallest is None:
        _check_sizes(np.delete(regions.areas, paper), regions.specks[0], placement)
    found = outlined(regions, STAIRS if tolerance is None else tolerance / placement.pixel)
    holes = {k: inner for k, inner in found.holes.items() if _is_open(found.rings[k], inner, regions.smallest)}
    filled = [k for k in found.holes if k not in holes]
    names, groups = _named(labels, regions)
    rings = tuple(_turned(placement.placed(ring * [1.0, -1.0])) for ring in found.rings)
    notes = (*_notes(labels, regions, found, placement), *rims)
    if filled:
        size = regions.smallest * placement.pixel
        text = f"pinholes were filled, less than {100 * PINHOLES:g} % of their stone or {size:.3g} m across (smallest)"
        notes = (*notes, Note(CHANGED, f"{text}, of {len(filled)}, the first '{names[filled[0]]}'"))
    if labels.is_mask and not (reading.ignore or reading.only):
        notes = (*notes, *maybe_openings(rings, names, {*holes, *paper}))
    layout = Layout(blocks=rings, names=names, groups=groups, unit=placement.unit, notes=notes)
    if not labels.is_of_lines:
        _check_holes(labels, regions, holes)
    message = "reaches the rim of the image, and is as large as paper; if it is a stone, close its lines there"
    around = {k: LeftOut("paper", rings[k], f"'{names[k]}' {message}") for k in paper}
    for k, inner in holes.items():
        placed = tuple(placement.placed(hole * [1.0, -1.0]) for hole in inner)
        message = f"'{names[k]}' has {counted(len(placed), 'hole')}; fill them, or give what lies around the stones as "
        message += "background"
        around[k] = LeftOut("hole", rings[k], message, holes=placed)
    return layout.leaving_out(around)


def _without_rim(labels: Labels, pixel: float) -> tuple[Labels, list[str]]:
    """Take a closed rim of a mask off that its outer stones run into, as of a canvas; and say so.

    Paper around a drawing has long lines along it, and is large beside the stones.
    """
    from scipy import ndimage

    rows, columns = (np.flatnonzero((labels.numbers == 0).any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return labels, []
    inside = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    pieces, n = ndimage.label(labels.numbers[inside])
    rim, areas = rim_of(pieces), np.bincount(pieces.ravel(), minlength=n + 1)
    outer = np.unique(rim[rim > 0])
    large = outer[areas[outer] >= MAYBE_OPENING * np.median(areas[1:])] if n else outer
    closed = (rim_of(labels.numbers) > 0).all()
    if not closed or len(outer) <= FEWEST_AT_RIM or np.mean(rim == 0) > MOST_JOINTS or 2 * len(large) > len(outer):
        return labels, []
    numbers = np.zeros_like(labels.numbers)
    numbers[inside] = labels.numbers[inside]
    widths = [rows[0], columns[0], *np.subtract(labels.numbers.shape, 1) - [rows[-1], columns[-1]]]
    text = (
        f"a rim along the border of the image, {max(widths)} pixels = {max(widths) * pixel:.3g} m wide, was taken off: "
    )
    return replace(labels, numbers=numbers), [
        Note(CHANGED, f"{text}it has the value of the stones, and made one of {len(outer)} of them")
    ]


def _check_stones(labels: Labels, regions: Regions, placement: Placement) -> None:
    """Refuse pictures without stones, masks of one region, and what is neither a mask nor a label image."""
    n = len(regions.labels)
    if n == 0:
        what = f"all of it is background ({labels.background})" if labels.background else "it is of one value"
        raise ValueError(
            f"it shows no stone: {what}, or smaller than {regions.smallest:.3g} pixels across (smallest); stones "
            "need another value than joints, see background"
        )
    if labels.is_mask and n == 1:
        why = "in a mask stones that touch are one; leave a joint of at least a pixel between them, or give each stone "
        why += "a value of its own"
        if labels.is_of_lines:
            size = regions.smallest * placement.pixel
            why = f"lines on paper enclose no stone of {size:.3g} m across or more (smallest); close them, or, if they "
            why += "are the stones, give the value of what is around them as background"
        raise ValueError(f"it shows one region of {regions.areas[0] * placement.pixel**2:.4g} m²: {why}")
    if labels.moved > MOST_MOVED * labels.numbers.size:
        share = f"{100.0 * labels.moved / labels.numbers.size:.2g} %"
        raise ValueError(
            f"it is no mask or label image: {share} of its pixels have no label's value; write it without "
            "shading and antialiasing, as PNG"
        )


def _check_holes(labels: Labels, regions: Regions, holed: Collection[int]) -> None:
    """Refuse pictures of which too much are regions with holes: there the background is taken for stones."""
    area = sum(int(regions.areas[k]) for k in holed)
    if area > MOST_HOLED * regions.areas.sum():
        largest = max(holed, key=lambda k: int(regions.areas[k]))
        that = f"that ({labels.names[regions.labels[largest] - 1]})" if labels.names else "its other value"
        raise ValueError(
            f"it is no picture of stones: {100.0 * area / regions.areas.sum():.0f} % of what is not background "
            f"({labels.background or 'none'}) has holes; if {that} lies around the stones, give it as background; "
            "if it is that of the stones, close the joints, through whose gaps they are one"
        )


def _paper_at_rim(regions: Regions) -> list[int]:
    """Regions of a drawing of lines that the rim of the image closes, such as the sky and the opening of an arch."""
    rim = np.unique(rim_of(regions.numbers)) - 1
    least = MAYBE_OPENING * float(np.median(regions.areas))
    return [k for k in rim.tolist() if k >= 0 and regions.areas[k] >= least]


def _check_sizes(areas: np.ndarray, specks: int, placement: Placement) -> None:
    """Refuse charts, screens and drawings of results: their regions are mostly letters, strokes and specks."""
    n = len(areas)
    small = np.sort(areas)[: n // 2].sum() / areas.sum()
    if specks > max(MOST_SPECKS, SPECKS_OF_ONE * n):
        why = f"it has {counted(specks, 'speck')} beside {counted(n, 'region')}"
    elif n >= FEWEST_OF_CHART and small < LEAST_OF_SMALL:
        why = f"{n // 2} of its {n} regions hold {100.0 * small:.2g} % of the area, as letters and strokes do"
    else:
        return
    size = 0.2 * placement.pixel * float(np.sqrt(np.median(areas[areas >= np.mean(areas)])))
    raise ValueError(
        f"it is no picture of stones but a chart, a screen or a shaded drawing: {why}; make a mask of its stones "
        f"({MASK_MAKERS}), or, if they are stones and specks, say from what size across they are stones: smallest = "
        f"{size:.2g} (m)"
    )


def _is_open(ring: np.ndarray, holes: tuple[np.ndarray, ...], smallest: float) -> bool:
    """Whether holes are openings, and neither small beside their outline nor specks, which touch at corners."""
    areas = [abs(ring_area(hole)) for hole in holes]
    return sum(areas) > PINHOLES * abs(ring_area(ring)) and max(areas) >= smallest**2


def maybe_openings(rings: Sequence[np.ndarray], names: Sequence[str], holed: Collection[int]) -> list[str]:
    """Doubt the largest regions of a mask: of a drawing of lines, on its paper, openings are regions as stones are."""
    areas = np.array([abs(ring_area(ring)) for ring in rings])
    stones = np.array([k for k in range(len(rings)) if k not in holed])
    if not len(stones):
        return []
    paper, median = int(areas.argmax()), float(np.median(areas[stones]))
    order = stones[np.argsort(-areas[stones])]
    large = order[areas[order] >= (0.5 if paper in holed else 1.0) * MAYBE_OPENING * median]
    if paper in holed and len(large):
        why = f"paper around lines, '{names[paper]}', was left out, and blocks are what lines enclose, openings, too"
    elif len(large):
        why = "regions far larger than others count as blocks"
    else:
        return []
    largest = [
        f"'{names[k]}' around ({x:.4g}, {y:.4g}) of {areas[k] / median:.2g} times the median area"
        for k in large.tolist()
        for x, y in [(rings[k].min(axis=0) + rings[k].max(axis=0)) / 2.0]
    ]
    remedy = f'leave out what is an opening: ignore = ["{names[large[0]]}"]'
    text = f"{why}; the largest: {listed(largest, NAMED)}; {remedy}"
    return [Note(CHANGED, text) if paper in holed else text]


def _turned(ring: np.ndarray) -> np.ndarray:
    """Turn an outline counter-clockwise: a world file may mirror the image."""
    return ring if ring_area(ring) > 0.0 else ring[::-1]


def _named(labels: Labels, regions: Regions) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Name each region after its label, numbered where there are several; these are a group."""
    if not labels.names:
        return tuple(f"stone {k + 1}" for k in range(len(regions.labels))), ()
    words = [labels.names[label - 1] for label in regions.labels.tolist()]
    words = [word if word.startswith("#") else f"label {word}" for word in words]
    names = numbered(words, "-")
    return tuple(names), tuple("" if name == word else word for name, word in zip(names, words, strict=True))


def _notes(labels: Labels, regions: Regions, found: Outlined, placement: Placement) -> tuple[str, ...]:
    height, width = labels.numbers.shape
    of = counted(len(set(regions.labels.tolist())), "label") if labels.names else "labels of a noisy image"
    what = "a drawing of lines" if labels.is_of_lines else "a mask of stones" if labels.is_mask else of
    share = f"{100.0 * np.mean(labels.numbers == 0):.3g} % ({labels.background})" if labels.background else "none"
    notes: list[str] = [
        f"{what} in {width} × {height} pixels of {1e3 * placement.pixel:.4g} mm ({placement.source}); background: "
        f"{share}; {found.corners} corners of pixels were simplified to {sum(map(len, found.rings))}"
    ]
    if labels.is_of_lines:
        notes[0] += "; what lines do not enclose is paper: where stones are missing, close them"
    if labels.moved:
        share = f"{100.0 * labels.moved / labels.numbers.size:.2g} %"
        text = (
            f"{counted(labels.moved, 'pixel')} ({share}) without a label's value, as at antialiased or lossy borders, "
        )
        notes.append(Note(LEFT_OUT, text + "went to the nearest label"))
    count, area = regions.specks
    if count:
        size = regions.smallest * placement.pixel
        text = f"{counted(count, 'speck')} of {counted(area, 'pixel')} in all, each less than {size:.3g} m across "
        notes.append(Note(LEFT_OUT, text + "(smallest), went to what is around them"))
    return tuple(notes)
