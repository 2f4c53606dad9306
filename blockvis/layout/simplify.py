"""Outlines finer than needed, simplified within a tolerance, neighbours along the same edges."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence

import numpy as np
import shapely
from scipy.spatial import cKDTree

from solver.mechanics import counted

from .joints.trimming import overlapping, with_corners_on_edges
from .linked import within_reach
from .outlines import folded

#: Outlines of more corners than this in the mean are finer than needed: every corner at a joint is a contact.
FINE = 24

#: Where too many corners are left, so many times the tolerance is proposed.
LARGER = 3.0

#: Corners go within this fraction of the size of the median block (the root of its area).
TOLERANCE = 0.01


def default_tolerance(outlines: Sequence[np.ndarray]) -> float:
    """Find the tolerance [m] within which outlines are simplified by default; 0 where they are not fine."""
    if sum(map(len, outlines)) <= FINE * len(outlines):
        return 0.0
    return TOLERANCE * float(np.sqrt(np.median(shapely.area(np.array([shapely.Polygon(ring) for ring in outlines])))))


def simplified(outlines: Sequence[np.ndarray], tolerance: float) -> tuple[list[np.ndarray], str]:
    """Drop corners of outlines, (n, 2) arrays [m], within a tolerance [m]; edges that blocks share stay shared.

    And say what was dropped, and which blocks could not be simplified; "" for nothing.

    Outlines are divided into the chains that two blocks share, and every chain is simplified once (Douglas and Peucker
    1973, doi:10.3138/FM57-6770-U75U-7727). Blocks that this would fold, or push into another, keep their corners.
    """
    before = sum(map(len, outlines))
    if tolerance <= 0.0:
        return list(outlines), ""
    points, around = _shared_corners(outlines)
    ends = np.concatenate([np.stack([ids, np.roll(ids, -1)], axis=1) for ids in around])
    # Three or more edges meet at a node.
    nodes = np.bincount(np.unique(np.sort(ends, axis=1), axis=0).ravel(), minlength=len(points)) > 2
    chains = [_chains(ids, points, nodes) for ids in around]
    kept = set[int]()
    found = _shortened(chains, kept, points, tolerance)
    # Blocks that keep their corners may now overlap others, which then keep theirs, too.
    while bad := _spoilt(found, outlines, tolerance) - kept:
        kept |= bad
        found = _shortened(chains, kept, points, tolerance)
    after = sum(map(len, found))
    spoilt, of = counted(len(kept), "block"), counted(len(outlines), "block")
    if after >= before:
        fine = f"outlines are finer than needed, {before} corners of {of}, and stay so: simplified "
        said = f"{fine}within {tolerance:.2g} m (outline_tolerance) {spoilt} would fold or overlap others"
        return list(outlines), said if kept and before > FINE * len(outlines) else ""
    rest = f"; {spoilt} that would fold or overlap others kept all of them" if kept else ""
    if after > FINE * len(outlines):
        rest += f"; {after / len(outlines):.0f} a block are many still, as along grain of a scan, with which a run is "
        rest += f"slow or fails: a larger outline_tolerance, {LARGER * tolerance:.1g}, leaves fewer"
    return found, (
        f"outlines were finer than needed: {before} corners of {of} were simplified to {after} "
        f"within {tolerance:.2g} m (outline_tolerance; 0 keeps every corner){rest}"
    )


def _shortened(
    chains: Sequence[Sequence[tuple[int, ...]]], kept: Collection[int], points: np.ndarray, tolerance: float
) -> list[np.ndarray]:
    """Put outlines together again of their chains, those of kept blocks as they are, the others simplified."""
    whole = {_key(chain) for block in kept for chain in chains[block]}
    keys = list({_key(chain) for parts in chains for chain in parts})
    lines = [shapely.LineString(points[list(key)]) for key in keys]
    simple = shapely.simplify(lines, tolerance, preserve_topology=False)
    short = {
        key: shapely.get_coordinates(line if key in whole else shorter)
        for key, line, shorter in zip(keys, lines, simple, strict=True)
    }

    def along(chain: tuple[int, ...]) -> np.ndarray:
        found = short[_key(chain)]
        return found if _key(chain) == chain else found[::-1]

    return [np.concatenate([along(chain)[:-1] for chain in parts]) for parts in chains]


def _shared_corners(outlines: Sequence[np.ndarray]) -> tuple[np.ndarray, list[np.ndarray]]:
    """(n, 2) array [m] of all corners, each once, and for each outline the numbers of its corners.

    Neighbours share an edge only between corners that both have.
    """
    every = np.concatenate(outlines)
    same = 1e-9 * float(np.ptp(every, axis=0).max())
    index = cKDTree(every)
    rings = [with_corners_on_edges(ring, every, index, same) for ring in outlines]
    corners = np.concatenate(rings)
    group = within_reach(corners, 2.0 * same)
    first = np.unique(group, return_index=True)[1]
    around = []
    for ids in np.split(group, np.cumsum([len(ring) for ring in rings])[:-1]):
        around.append(ids[ids != np.roll(ids, 1)])
    return corners[first], around


def _chains(ids: np.ndarray, points: np.ndarray, nodes: np.ndarray) -> list[tuple[int, ...]]:
    """Divide an outline at its nodes, or at two corners far apart."""
    cuts = np.flatnonzero(nodes[ids])
    if len(cuts) < 2:
        # Without a node it begins at a far corner, wherever it was drawn from.
        corner = points[ids[cuts[0]]] if len(cuts) else points[ids].mean(axis=0)
        start = int(cuts[0]) if len(cuts) else int(np.argmax(np.hypot(*(points[ids] - corner).T)))
        far = int(np.argmax(np.hypot(*(points[ids] - points[ids[start]]).T)))
        cuts = np.unique([start, far])
    ids = np.roll(ids, -cuts[0])
    ends = [*(cuts - cuts[0]), len(ids)]
    closed = [*ids.tolist(), int(ids[0])]
    return [tuple(closed[i : j + 1]) for i, j in itertools.pairwise(ends)]


def _key(chain: tuple[int, ...]) -> tuple[int, ...]:
    """Write a chain in the direction in which both its blocks simplify it."""
    return min(chain, chain[::-1])


def _spoilt(found: list[np.ndarray], drawn: Sequence[np.ndarray], tolerance: float) -> set[int]:
    """Find the blocks that simplifying folds, or pushes into another."""
    bad = set(folded(drawn, found).tolist())
    if bad:
        return bad
    after, already = (
        set(zip(*(pair.tolist() for pair in overlapping(rings, 1e-3 * tolerance)[:2]), strict=True))
        for rings in (found, drawn)
    )
    new = after - already
    return {block for pair in new for block in pair}
