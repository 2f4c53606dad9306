"""Regions of labelled pixels as outlines: specks go to what is around them, borders that regions share stay shared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from blockvis.layout.outlines import ring_area

#: Regions less than this fraction of the typical one across (root of the area) are specks, unless the caller says else.
SPECK = 0.05

#: The same of a noisy image, of which borders break into pieces.
SPECK_OF_NOISE = 0.1

#: A region of fewer pixels across says nothing of its shape.
FEWEST = 3.0

#: Corners of the staircase of pixels go within this distance of a simpler outline [pixels].
STAIRS = 1.0

#: ... and of a stone alone within this fraction of its size across.
OF_SIZE = 0.02

#: A corner of the staircase between edges of so many pixels is one of the stone; others are cut at half a pixel.
LONG_EDGE = 4.0


@dataclass(frozen=True)
class Regions:
    """Regions of an image.

    ``numbers`` (height, width) say the region of each pixel, counted from 1, 0 for the background; ``labels`` and
    ``areas`` [pixels] are those of regions. ``specks`` are their number and that of their pixels; what is no speck is
    at least ``smallest`` [pixels] across.
    """

    numbers: np.ndarray
    labels: np.ndarray
    areas: np.ndarray
    specks: tuple[int, int]
    smallest: float


@dataclass(frozen=True)
class Outlined:
    """Outlines of regions in pixels, counter-clockwise with y up: row r is at -r.

    ``holes`` are by the region; ``corners`` is the number of those of the staircases of pixels.
    """

    rings: list[np.ndarray]
    holes: dict[int, tuple[np.ndarray, ...]]
    corners: int


def regions_of(labels: np.ndarray, smallest: float | None = None, speck: float = SPECK) -> Regions:
    """Find the regions of labels (height, width), 0 for the background, that hang together along edges of pixels.

    Regions less than ``smallest`` [pixels] across (root of the area) are specks, by default those less than a fraction
    of the typical region across. A speck becomes part of the neighbour with which it has most edges; one of the
    background does so within one region only: between two it is a joint. The background hangs together across corners,
    too, as joints one pixel wide do.
    """
    numbers, of_region = _numbered(labels)
    areas = np.bincount(numbers.ravel(), minlength=len(of_region))
    stones = np.flatnonzero(of_region > 0)
    if smallest is None:
        smallest = max(FEWEST, speck * _typical(areas[stones]))
    small = areas < smallest**2
    small[0] = False
    specks = stones[small[stones]]
    target = _targets(numbers, of_region, small)
    numbers = target[numbers]
    kept = np.flatnonzero((of_region > 0) & ~small)
    order = np.zeros(len(of_region), dtype=np.int32)
    order[kept] = np.arange(1, len(kept) + 1)
    numbers = order[numbers]
    if small.any():
        numbers = _in_one_piece(numbers)
    after = np.bincount(numbers.ravel(), minlength=len(kept) + 1)[1:]
    return Regions(numbers, of_region[kept], after, (len(specks), int(areas[specks].sum())), float(smallest))


def _in_one_piece(numbers: np.ndarray) -> np.ndarray:
    """Leave the largest piece of each region: specks may have added some that meet it in corners only."""
    pieces, of_piece = _numbered(numbers)
    areas = np.bincount(pieces.ravel(), minlength=len(of_piece))
    order = np.lexsort([areas, of_piece])
    largest = order[np.append(of_piece[order][1:] != of_piece[order][:-1], True)]
    kept = np.zeros(len(of_piece), dtype=np.int32)
    kept[largest] = of_piece[largest]
    return kept[pieces]


def _typical(areas: np.ndarray) -> float:
    """Find the size across [pixels] that half of the area exceeds: thousands of specks do not change it."""
    if len(areas) == 0:
        return 0.0
    ordered = np.sort(areas)
    return float(np.sqrt(ordered[np.searchsorted(np.cumsum(ordered), 0.5 * ordered.sum())]))


def _numbered(labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Count the pieces of each label, those of the background included, from 1; gives the label of each number, too."""
    from scipy import ndimage

    values, inverse = np.unique(labels, return_inverse=True)
    place = inverse.reshape(labels.shape).astype(np.int32) + 1
    numbers = np.zeros(labels.shape, dtype=np.int32)
    of_region = [0]
    for k, box in enumerate(ndimage.find_objects(place)):
        own = place[box] == k + 1
        pieces, n = ndimage.label(own, np.ones((3, 3)) if values[k] == 0 else None)
        numbers[box][own] = pieces[own] + (len(of_region) - 1)
        of_region += [int(values[k])] * n
    return numbers, np.array(of_region)


def _targets(numbers: np.ndarray, of_region: np.ndarray, small: np.ndarray) -> np.ndarray:
    """(n,) array: the region that each becomes part of; itself where it is no speck, 0 where nothing is around it."""
    n = len(of_region)
    target = np.where(small, -1, np.arange(n)).astype(np.int32)
    sides = [(numbers[:, :-1], numbers[:, 1:]), (numbers[:-1], numbers[1:])]
    across = [np.stack([a[a != b], b[a != b]]) for a, b in sides]
    one, other = np.concatenate([*across, *(pair[::-1] for pair in across)], axis=1).astype(np.int64)
    pairs, edges = np.unique(one[small[one]] * n + other[small[one]], return_counts=True)
    speck, neighbour = np.divmod(pairs[np.argsort(edges, kind="stable")], n)
    # Specks lie in specks: from the outermost inwards each becomes what those around it have become.
    while (ready := (target[speck] < 0) & (target[neighbour] >= 0)).any():
        inner, outer = speck[ready], target[neighbour[ready]]
        target[inner] = outer
        joined, region = np.divmod(np.unique(inner * n + outer), n)
        several = np.bincount(joined, of_region[region] > 0, minlength=n) > 1
        target[(of_region == 0) & several] = 0
    return np.maximum(target, 0)


def outlined(regions: Regions, tolerance: float = STAIRS) -> Outlined:
    """Trace the outlines of regions, without corners within a tolerance [pixels]; 0 keeps those of every pixel.

    Lines between two regions are traced once, so that both have the same corners.
    """
    cracks = shapely.linestrings(_cracks(regions.numbers).astype(float))
    chains = shapely.get_parts(shapely.line_merge(shapely.multilinestrings(cracks)))
    drawn = _faces(chains, regions)
    assert drawn is not None
    faces = drawn
    for finer in (tolerance, 0.5 * tolerance) if tolerance > 0.0 else ():
        simple = _faces(_without_stairs(chains, finer), regions)
        if simple is not None:
            faces = simple
            break
    holes = {
        k: tuple(shapely.get_coordinates(hole)[:-1] for hole in faces[k].interiors)
        for k in np.flatnonzero(shapely.get_num_interior_rings(faces)).tolist()
    }
    rings = [shapely.get_coordinates(face.exterior)[:-1] for face in faces]
    corners = int(shapely.get_num_coordinates(drawn).sum()) - len(rings)
    return Outlined(rings, holes, corners)


def _faces(chains: Any, regions: Regions) -> Any | None:
    """(n,) array of polygons: the face of each region between lines; None if lines of another course miss one."""
    faces = shapely.orient_polygons(shapely.get_parts(shapely.polygonize(chains)))
    inside = shapely.get_coordinates(shapely.point_on_surface(faces))
    height, width = regions.numbers.shape
    row = np.clip(np.floor(-inside[:, 1]).astype(int), 0, height - 1)
    owner = regions.numbers[row, np.clip(np.floor(inside[:, 0]).astype(int), 0, width - 1)]
    order = np.argsort(owner, kind="stable")[np.count_nonzero(owner == 0) :]
    return faces[order] if np.array_equal(owner[order], np.arange(1, len(regions.labels) + 1)) else None


def _cracks(numbers: np.ndarray) -> np.ndarray:
    """(n, 2, 2) int array: the straight lines between pixels of two regions, in columns and -rows."""
    padded = np.pad(numbers, 1)
    found = []
    for turned in (False, True):
        rows = padded.T if turned else padded
        above, below = (np.pad(part, ((0, 0), (1, 1)), constant_values=0) for part in (rows[:-1], rows[1:]))
        apart = above != below
        # A line ends where another pair of regions begins: there a third one meets it.
        changes = (above[:, 1:] != above[:, :-1]) | (below[:, 1:] != below[:, :-1])
        row, start = np.nonzero(changes & apart[:, 1:])
        _, end = np.nonzero(changes & apart[:, :-1])
        ends = [np.stack([column - 1, row], axis=1) for column in (start, end)]
        line = np.stack(ends, axis=1)
        found.append(line[:, :, ::-1] if turned else line)
    return np.concatenate(found) * [1, -1]


def _without_stairs(chains: Any, tolerance: float) -> Any:
    """Simplify staircases to the lines they stand for; those that would then cross another keep their corners."""
    lines = [_cut(shapely.get_coordinates(chain)) for chain in chains]
    cut = shapely.linestrings(np.concatenate(lines), indices=np.repeat(np.arange(len(lines)), [*map(len, lines)]))
    # Chords cut some off round stones: of small ones it would be felt.
    across = np.sqrt([abs(ring_area(line)) if (line[0] == line[-1]).all() else np.inf for line in lines])
    simple = shapely.simplify(cut, np.minimum(tolerance, OF_SIZE * across), preserve_topology=False)
    for _ in range(8):
        one, other = shapely.STRtree(simple).query(simple, "intersects")
        pair = one < other
        one, other = one[pair], other[pair]
        crossing = ~shapely.touches(simple[one], simple[other])
        bad = np.zeros(len(simple), dtype=bool)
        bad[one[crossing]] = bad[other[crossing]] = True
        bad |= ~shapely.is_simple(simple) | (shapely.is_closed(simple) & (shapely.get_num_coordinates(simple) < 4))
        if not bad.any():
            break
        simple = np.where(bad, cut, simple)
    return simple


def _cut(chain: np.ndarray) -> np.ndarray:
    """Cut the corners of a staircase at half a pixel, but for those between long edges and both ends of a line."""
    closed = bool((chain[0] == chain[-1]).all())
    if closed:
        # Whatever begins a ring stays: a corner does, the one farthest from its middle.
        ring = chain[:-1]
        first = int(np.argmax(((ring - ring.mean(axis=0)) ** 2).sum(axis=1)))
        chain = np.vstack([np.roll(ring, -first, axis=0), ring[first]])
    ahead = np.diff(chain, axis=0)
    length = np.abs(ahead).max(axis=1)
    ahead = ahead / length[:, None]
    corners = chain[1:-1]
    long = (length[:-1] >= LONG_EDGE) & (length[1:] >= LONG_EDGE)
    half = np.where(long, 0.0, 0.5)[:, None]
    points = np.stack([corners - half * ahead[:-1], corners + half * ahead[1:]], axis=1).reshape(-1, 2)
    points = np.vstack([chain[:1], points, chain[-1:]])
    return points[np.append(True, (np.diff(points, axis=0) != 0.0).any(axis=1))]
