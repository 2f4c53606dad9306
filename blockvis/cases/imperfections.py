"""Imperfections: random scatter of corners, friction and density, from a seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
import shapely
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

import solver
from blockvis.layout.linked import middles, within_reach
from blockvis.layout.repair import DRAWN_GAP

from .distributions import DISTRIBUTION_KEYS, FORMS, Distribution, distribution_of
from .key import Key, Section, one_of, whole
from .toml_table import Table

#: The kinds of imperfections, and the means of their distributions where none is given.
MEANS: dict[str, float] = {"vertices": 0.0, "friction": 1.0, "density": 1.0}

IMPERFECTIONS = Section(
    "imperfections",
    "Random scatter, one table of each kind; joints stay closed and faces plane",
    (
        Key("kind", one_of(tuple(MEANS)), "What scatters: in the plane corners (each coordinate, m), friction of each "
            "joint, density of each block (both as factors)", "vertices", required=True),
        Key("seed", whole(0, 2**63 - 1), "Of the random numbers; the same seed gives the same blocks", 1, default=0),
        *(replace(key, otherwise="0 for vertices, 1 for friction and density") if key.name == "mean" else key
          for key in DISTRIBUTION_KEYS),
    ),
    several=True,
    forms=FORMS.with_default("mean"),
)  # fmt: skip

#: A corner moves by at most this fraction of the distance to the next corner, and of the width of its blocks, so that
#: no block turns inside out.
LARGEST_SHARE = 0.25

#: An edge changes by at most this fraction of its length; otherwise the random displacements of the corners of its
#: block are halved, at most so many times.
LARGEST_CHANGE, HALVINGS = 0.5, 12

#: If the displacements of more than this fraction of the corners are too large, the imperfections are refused.
MOST_HELD_BACK = 0.1


@dataclass(frozen=True)
class Imperfection:
    """One entry of ``[[imperfections]]``, by its keys."""

    kind: str
    distribution: Distribution
    seed: int = 0


def read_imperfection(table: Table, section: Section = IMPERFECTIONS) -> Imperfection:
    """Read and check the imperfection of a table, of a case or, without a seed, of a study.

    ValueError for a value that is not as the table says, and a factor that may become negative or 0.
    """
    values = section.read(table)
    kind = values["kind"]
    if values.get("mean", 0.0) is None:
        values["mean"] = MEANS[kind]
    distribution = distribution_of(values, table)
    if kind != "vertices" and distribution.lowest < 0.0:
        raise table.error(
            "kind",
            f"is '{kind}': a factor may become negative; give lower, for instance lower = 0.2, or take 'lognormal'",
        )
    if kind == "density" and distribution.lowest == 0.0 and distribution.kind != "lognormal":
        raise table.error("kind", "is 'density': a factor may become 0, but blocks have a weight; give a larger lower")
    return Imperfection(kind, distribution, values.get("seed", 0))


def joint_scatter(imperfections: Sequence[Imperfection]) -> solver.JointScatter | None:
    """Find the scatter of friction from joint to joint; None without one."""
    for one in imperfections:
        if one.kind == "friction":
            return solver.JointScatter(one.seed, one.distribution.quantile)
    return None


def imperfect(assembly: solver.Assembly, imperfections: Sequence[Imperfection]) -> solver.Assembly:
    """Scatter the corners and densities of an assembly; friction scatters by :func:`joint_scatter`.

    ValueError for displacements of corners that are too large for the blocks.
    """
    for one in imperfections:
        if one.kind == "density":
            factor = one.distribution.quantile(_uniform(one, assembly.n_blocks))
            assembly = replace(assembly, density=np.where(assembly.free, assembly.density * factor, assembly.density))
        elif one.kind == "vertices":
            assembly = moved_corners(assembly, one)
    return assembly


def _uniform(imperfection: Imperfection, *shape: int) -> np.ndarray:
    # Each kind has its own stream of random numbers: two kinds with the same seed must not be correlated.
    stream = list(MEANS).index(imperfection.kind)
    return np.random.default_rng([imperfection.seed, stream]).uniform(2.0**-54, 1.0 - 2.0**-53, size=shape)


def moved_corners(assembly: solver.Assembly, imperfection: Imperfection) -> solver.Assembly:
    """Move the corners of an assembly at random, by an imperfection of kind "vertices".

    Faces stay plane and joints closed. ValueError for displacements that are too large for the blocks.

    Corners at one place move together. A corner on the edge of another block slides along this edge and moves with it:
    bed joints of a wall stay straight from end to end, head joints move and tilt. Corners of supports stay.
    """
    vertices, owner, following = assembly.vertices, assembly.block_of_vertex, assembly.polygons.next_vertex
    near = DRAWN_GAP * float(assembly.widths.min())
    place = within_reach(vertices, near)
    n = int(place.max()) + 1
    positions = middles(vertices, place)
    rails = _rails(assembly, positions, place, near)

    share = np.full(n, np.inf)
    np.minimum.at(share, place, assembly.widths[owner])
    if n > 1:
        share = np.minimum(share, cKDTree(positions).query(positions, k=2)[0][:, 1])
    drawn = imperfection.distribution.quantile(_uniform(imperfection, n, 2))
    held = np.zeros(n, dtype=bool)
    held[place[~assembly.free[owner]]] = True
    drawn[held] = 0.0
    size = np.hypot(*drawn.T)
    too_far = size > LARGEST_SHARE * share
    if too_far.sum() > MOST_HELD_BACK * max((~held).sum(), 1):
        raise ValueError(
            f"imperfections of kind 'vertices' move {int(too_far.sum())} of {int((~held).sum())} corners by more than "
            "a quarter of the distance to the next corner or the width of their blocks, typically "
            f"{np.median(LARGEST_SHARE * share):.3g} m; make them smaller"
        )
    drawn *= np.where(too_far, LARGEST_SHARE * share / np.maximum(size, 1e-300), 1.0)[:, None]
    new = _on_rails(positions, drawn, rails, place, following)
    for _ in range(HALVINGS):
        # A cut brick has edges much shorter than those along which its corners slide, and moves with them.
        before = positions[place[following]] - positions[place]
        change = new[place[following]] - new[place] - before
        too_much = np.hypot(*change.T) > LARGEST_CHANGE * np.hypot(*before.T)
        if not too_much.any():
            break
        near_by = set(place[np.isin(owner, owner[too_much])].tolist())
        rail_ends = [(place[rails[p]], place[following[rails[p]]]) for p in near_by if p in rails]
        drawn[sorted(near_by.union(*rail_ends))] /= 2.0
        new = _on_rails(positions, drawn, rails, place, following)

    try:
        moved = solver.Assembly.from_outlines(
            np.split(new[place], assembly.offsets[1:-1]), names=assembly.names, thickness=assembly.thickness
        )
        return replace(assembly, shapes=moved.shapes)
    except ValueError as error:
        raise ValueError(f"with imperfections of kind 'vertices' {error}; give smaller ones") from None


def _rails(assembly: solver.Assembly, positions: np.ndarray, place: np.ndarray, near: float) -> dict[int, int]:
    """Find the edge, its rail, along which each place inside an edge slides; an edge is numbered by its first vertex.

    A place inside the edges of two blocks slides along the longer one.
    """
    start, end = positions[place], positions[place[assembly.polygons.next_vertex]]
    edges = shapely.linestrings(np.stack([start, end], axis=1))
    point, edge = shapely.STRtree(edges).query(shapely.points(positions), predicate="dwithin", distance=near)
    length = np.hypot(*(end - start).T)
    tangent = (end - start)[edge] / length[edge, None]
    distance = ((positions[point] - start[edge]) * tangent).sum(axis=1)
    # A block's own corner that touches another of its edges is no joint.
    owned = np.unique(place.astype(np.int64) * assembly.n_blocks + assembly.block_of_vertex)
    own = np.isin(point.astype(np.int64) * assembly.n_blocks + assembly.block_of_vertex[edge], owned)
    inside = (distance > near) & (distance < length[edge] - near) & ~own
    point, edge = point[inside], edge[inside]
    shortest_first = np.lexsort((-edge, length[edge], point))
    return dict(zip(point[shortest_first].tolist(), edge[shortest_first].tolist(), strict=True))


def _on_rails(
    positions: np.ndarray, drawn: np.ndarray, rails: Mapping[int, int], place: np.ndarray, following: np.ndarray
) -> np.ndarray:
    """(n, 2) array [m]: new positions of the places, those on rails on the line between the rail's new ends.

    A place on a rail moves by its random displacement along the rail's old direction, and lies on the line through the
    rail's new ends: two equations for each, solved together by Newton's method because the end of one rail may itself
    lie on another, as along a course of running bond.
    """
    new = positions + drawn
    if not rails:
        return new
    on = np.array(sorted(rails))
    edge = np.array([rails[point] for point in on.tolist()])
    start, end = place[edge], place[following[edge]]
    direction = positions[end] - positions[start]
    length = np.hypot(*direction.T)
    direction /= length[:, None]
    target = (new[on] * direction).sum(axis=1)
    unknown = np.full(len(positions), -1)
    unknown[on] = np.arange(len(on))
    row = np.arange(len(on))
    # Displacements are small compared with the edges: four iterations reach rounding error, one more is in reserve.
    for _ in range(5):
        along, beside = (new[end] - new[start]) / length[:, None], (new[on] - new[start]) / length[:, None]
        off = along[:, 0] * beside[:, 1] - along[:, 1] * beside[:, 0]
        slid = (new[on] * direction).sum(axis=1) - target
        # Derivatives of off with respect to the place, the end and the start of its rail, times the length.
        of_place = np.stack([-along[:, 1], along[:, 0]], axis=1)
        of_end = np.stack([beside[:, 1], -beside[:, 0]], axis=1)
        entries = [(2 * row, on, direction), (2 * row + 1, on, of_place)]
        entries += [(2 * row + 1, end, of_end), (2 * row + 1, start, -of_place - of_end)]
        rows, columns, values = [], [], []
        for equation, point, derivative in entries:
            moves = unknown[point] >= 0
            for axis in (0, 1):
                rows.append(equation[moves])
                columns.append(2 * unknown[point[moves]] + axis)
                values.append(derivative[moves, axis])
        matrix = sp.csc_array(
            (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(2 * len(on),) * 2
        )
        residual = np.stack([slid, off * length], axis=1).ravel()
        new[on] -= spsolve(matrix, residual).reshape(-1, 2)
    return new
