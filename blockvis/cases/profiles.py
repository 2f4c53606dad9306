"""Profiles of settlement: a trough along x, or points of a table, as the motion of each support."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely

import solver
from blockvis.layout.outlines import TOUCHING, pieces_of
from blockvis.text import listed, nearest
from solver import mechanics
from solver.mechanics import counted

from .block_at import blocks_called
from .key import NUMBER, PAIR, POSITIVE, Forms, Key, Section, ValueKind, list_of, one_of, read_by
from .toml_table import Table, is_number, shortened

#: Pieces of a support narrower than this fraction of the block size are not cut off.
NARROWEST = 0.02

#: Upright part of the normal of a joint from which on a block stands on a support.
UPRIGHT = 1e-3

#: A profile that leaves the chord over a support by less than this fraction of its largest value tilts it as it is; so
#: straight, in its length, is the line of a tie, and a trough that moves all feet so much alike is none.
STRAIGHT = 1e-3


@dataclass(frozen=True)
class Profile:
    """How far the ground goes at each x [m], in proportion, by a kind of profile, "gaussian" or "points".

    A Gaussian trough has a depth, negative for a heave, at its centre, and is steepest at its inflection from there.
    Points, (x, value), have straight lines between them and level ones beyond.
    """

    kind: str
    centre: float = 0.0
    inflection: float = 1.0
    depth: float = 1.0
    points: tuple[tuple[float, float], ...] = ()

    def value(self, x: np.ndarray) -> np.ndarray:
        """(n,) array: how far the ground goes at places x, (n,) [m]."""
        x = np.asarray(x, dtype=float)
        if self.kind == "gaussian":
            return np.asarray(self.depth * np.exp(-(((x - self.centre) / self.inflection) ** 2) / 2.0))
        places, values = np.array(self.points).T
        return np.interp(x, places, values)

    @property
    def largest(self) -> float:
        """How far the ground goes where it goes farthest."""
        return float(np.abs(self.value(np.array([self.centre, *(x for x, _ in self.points)]))).max())

    def bends(self, low: float, high: float, direction: Sequence[float] = (0.0, -1.0)) -> bool:
        """Whether ground between two places x [m] that goes along a unit vector is no rigid body.

        Its upright part is that of one where the profile is straight, the part along x where it is level.
        """
        values = self.value(np.linspace(low, high, 101))
        along = np.stack([np.full(101, values[0]), np.linspace(values[0], values[-1], 101)])
        return bool((np.abs(np.asarray(direction)[:, None] * (values - along)) > STRAIGHT * self.largest).any())

    def motions(self, bearings: np.ndarray, direction: Sequence[float]) -> np.ndarray:
        """(n, 3) array: the motion of ground in its middle along a unit vector, and its tilt.

        Both ends, (n, 2) [m], of what bears go by the profile, so that pieces of ground side by side stay together.
        """
        low, high = bearings.T
        start, end = self.value(low), self.value(high)
        value, slope = (start + end) / 2.0, (end - start) / (high - low)
        return np.stack([value * direction[0], value * direction[1], slope * direction[1]], axis=1) + 0.0


def bearings(assembly: solver.Assembly, supports: Sequence[int | Sequence[int]]) -> np.ndarray:
    """(n, 2, d) array [m]: corners of the box on each support, or group, that bears free blocks, or of its top."""
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 2.0 * TOUCHING * assembly.block_size)
    found = []
    for one in supports:
        on_a, on_b = np.isin(contacts.block_a, one), np.isin(contacts.block_b, one)
        # What touches a support from the side does not stand on it.
        upright = contacts.frames[:, 0, -1] * np.where(on_a, -1.0, 1.0) > UPRIGHT
        carrying = upright & (on_a & assembly.free[contacts.block_b] | on_b & assembly.free[contacts.block_a])
        points, corners = contacts.points[carrying], assembly.vertices[np.isin(assembly.block_of_vertex, one)]
        if not len(points) or np.ptp(points[:, 0]) < NARROWEST * assembly.block_size:
            points = np.stack([corners.min(axis=0), corners.max(axis=0)])
            points[:, -1] = corners[:, -1].max()
        found.append([points.min(axis=0), points.max(axis=0)])
    return np.array(found).reshape(-1, 2, assembly.dimension)


def bearing_points(assembly: solver.Assembly, supports: Sequence[int | Sequence[int]]) -> np.ndarray:
    """(n, d) array [m]: the middle of where free blocks stand on each support, or group, or of its top if none does."""
    return np.asarray(bearings(assembly, supports).mean(axis=1))


def by_bearing(assembly: solver.Assembly, motions: Mapping[str, Sequence[float]]) -> dict[str, Any]:
    """Make the keywords of a :class:`solver.Settlement` whose supports move at :func:`bearing_points`, not centroids.

    How deep a support is drawn then counts for nothing.
    """
    blocks = [assembly.index(name) for name in motions]
    arms = bearing_points(assembly, blocks) - assembly.centroids[blocks]
    return {"profile": motions, "profile_arms": dict(zip(motions, arms.tolist(), strict=True))}


def _depth(depth: float) -> float:
    if abs(depth) != 1.0:
        raise ValueError(f"is {depth:g}; give 1, or -1 for a heave: the limit says how deep it gets")
    return depth


def _points(given: Any) -> tuple[tuple[float, float], ...]:
    right = isinstance(given, list) and len(given) > 1
    if not right or not all(isinstance(p, list) and len(p) == 2 and all(map(is_number, p)) for p in given):
        raise ValueError(f"is {shortened(given)}; give at least two pairs [[x, s], ...]")
    points = tuple(sorted((float(x), float(s)) for x, s in given))
    for (x, _), (following, _) in pairwise(points):
        if x == following:
            raise ValueError(f"has two values at x = {x:g}; give one for each x")
    if not any(s for _, s in points):
        raise ValueError("are all 0; give a value other than 0")
    return points


def _motions(table: Table, key: Key) -> dict[str, tuple[float, ...]] | None:
    given = table.take(key.name)
    if given is None:
        return None
    if not isinstance(given, dict) or not given:
        raise table.error(key.name, f'is {shortened(given)}; give {{ "name" = [dx, dy, rotation], ... }}')
    supports = table.table(key.name)
    words = "[dx, dy] or [dx, dy, rotation], or in space [dx, dy, dz, rx, ry, rz]"
    motions = {str(name): supports.vector(name, (2, 3, 6), words) for name in given}
    return {name: motion if len(motion) > 2 else (*motion, 0.0) for name, motion in motions.items()}


_DEPTH = ValueKind("1 or -1", {"enum": [1, -1]}, read_by(_depth, Table.number))
_POINTS = ValueKind("list of at least two pairs", list_of(PAIR.schema, 2), read_by(_points))
_MOTIONS = ValueKind(
    "table of two or three numbers, in space six, by the name of a support",
    {"type": "object", "additionalProperties": list_of({"type": "number"}, 2, 6), "minProperties": 1},
    _motions,
)

PROFILE = Section(
    "settlement.profile",
    "How far each support goes, in proportion, by one of three kinds of profile; in space by the motion of each",
    (
        Key("kind", one_of(("gaussian", "points", "supports")), "A Gaussian trough or heave along x, points of a "
            "table, or the motion of each support", "gaussian", otherwise="the kind whose keys are there"),
        Key("centre", NUMBER, "Of a Gaussian trough, the x where it is deepest", 1.5, "m",
            otherwise="required for gaussian", remedy="give the x where it is deepest, in m"),
        Key("inflection", POSITIVE, "Of a Gaussian trough, how far from its centre it is steepest", 0.8, "m",
            otherwise="required for gaussian",
            remedy="give the distance from the centre to where it is steepest, in m"),
        Key("depth", _DEPTH, "Of a Gaussian trough, 1, or -1 for a heave: the settlement scales it", -1.0, default=1.0),
        Key("points", _POINTS, "Places x [m] and how far the ground goes there, straight between them and level beyond",
            [[0.0, 0.0], [2.0, 1.0]], otherwise="required for points"),
        Key("supports", _MOTIONS, "Displacement [m] of each support and its rotation [rad], in proportion; in "
            "space six numbers [dx, dy, dz, rx, ry, rz]", {"pier": [0.2, -0.5, 0.01]},
            otherwise="required for supports"),
    ),
    forms=Forms(
        "kind",
        {"gaussian": ("centre", "inflection"), "points": ("points",), "supports": ("supports",)},
        {"gaussian": ("depth",)},
    ),
)  # fmt: skip


def read_profile(table: Table, key: Key) -> Profile | dict[str, tuple[float, ...]] | None:
    """Read the profile of a settlement; the motions of supports where it gives these."""
    given = table.take(key.name)
    if given is None:
        return None
    if not isinstance(given, dict):
        raise table.error(
            key.name,
            f'is {shortened(given)}; give {{ kind = "gaussian", centre = x, inflection = i }}, '
            '{ points = [[x, s], ...] } or { supports = { "name" = [dx, dy, rotation] } }',
        )
    values = PROFILE.read(table.table(key.name))
    motions: dict[str, tuple[float, ...]] | None = values.pop("supports", None)
    if motions is not None:
        return motions
    return Profile(**values | {"kind": "points" if "points" in values else "gaussian"})


#: Profiles as values of a key.
PROFILES = ValueKind("table, see [settlement.profile]", PROFILE.schema, read_profile)


def with_profiles(
    settlements: Sequence[solver.Settlement],
    profiles: Sequence[Profile | None],
    assembly: solver.Assembly,
    source: Path,
) -> tuple[solver.Settlement, ...]:
    """Give each support its own motion, where a settlement has a profile, and the ground is cut for it.

    ValueError for a support that a profile names and that is no moving support.
    """
    found = []
    for k, given in enumerate(settlements):
        settlement = replace(given, blocks=given.blocks and pieces_named(given.blocks, assembly))
        profile = profiles[k] if k < len(profiles) else None
        where = f"{source}: [settlement{f' {k + 1}' if len(settlements) > 1 else ''}] profile"
        if profile is None:
            found.append(_on_every_support(settlement, assembly, where))
            continue
        blocks = np.flatnonzero(settlement.taking_part(assembly)).tolist()
        motions = profile.motions(bearings(assembly, blocks)[:, :, 0], settlement.direction or ())
        if not motions.any():
            raise ValueError(f"{where} moves none of the {counted(len(blocks), 'support')}; look at its places x")
        by_name = dict(zip([assembly.names[b] for b in blocks], motions.tolist(), strict=True))
        keys = by_bearing(assembly, by_name) | {"profile_depth": profile.largest}
        found.append(replace(settlement, direction=None, blocks=None, **keys))
    return tuple(found)


def _on_every_support(settlement: solver.Settlement, assembly: solver.Assembly, where: str) -> solver.Settlement:
    """Give all supports drawn with a name of a profile its motion, but for those with a motion of their own."""
    if settlement.profile is None:
        return settlement
    given, names = dict(settlement.profile), assembly.names
    called = {name: [i for i in blocks_called(name, assembly) if not assembly.free[i]] for name in given}
    motions = {names[i]: motion for name, motion in given.items() for i in called[name]}
    motions |= {name: motion for name, motion in given.items() if name in names or not called[name]}
    for name in motions:
        _check_support(name, assembly, where)
    # Pieces of what was drawn as one turn about its centroid.
    wholes, arms = uncut_names(assembly), {}
    for name in motions:
        pieces = [i for i, whole in enumerate(wholes) if whole == wholes[assembly.index(name)] != name]
        if pieces:
            centre = np.average(assembly.centroids[pieces], axis=0, weights=assembly.areas[pieces])
            arms[name] = (centre - assembly.centroids[assembly.index(name)]).tolist()
    return replace(settlement, profile=motions, profile_arms=arms or None)


def _check_support(name: str, assembly: solver.Assembly, where: str) -> None:
    supports = [assembly.names[i] for i in np.flatnonzero(~assembly.free)]
    if name not in supports:
        kind = "a free block" if name in assembly.names else "no block"
        raise ValueError(
            f"{where}: '{name}' is {kind}{nearest(name, supports)}; supports are {listed(supports, 12) or 'none'}"
        )
    if not assembly.moving[assembly.index(name)]:
        raise ValueError(f"{where}: '{name}' is fixed; give it the role \"moving\" under [roles]")


def cut_ground(
    assembly: solver.Assembly,
    profiles: Sequence[Profile | None] = (),
    settlements: Sequence[solver.Settlement] = (),
    *,
    chosen: Sequence[int] | None = None,
) -> solver.Assembly:
    """Cut supports under the joints between blocks they carry: those chosen, or over which a profile bends.

    Profiles are those of the settlements. The pieces of a support "ground" are named "ground 1", "ground 2" ... from
    left to right; raises ``ValueError`` where a block has such a name.
    """
    if assembly.dimension != 2:
        return assembly
    chosen = _bent_supports(assembly, profiles, settlements) if chosen is None else chosen
    pieces = {i: cut for i in chosen if len(cut := _cut(assembly, i)) > 1}
    if not pieces:
        return assembly
    listed = ", ".join(f"'{assembly.names[i]}' into {len(cut)} pieces" for i, cut in pieces.items())
    warnings.warn(f"the ground follows the profile: cut under the joints of the first course, {listed}", stacklevel=3)
    return _with_pieces(assembly, pieces)


def _bent_supports(
    assembly: solver.Assembly, profiles: Sequence[Profile | None], settlements: Sequence[solver.Settlement]
) -> list[int]:
    """Choose the moving supports over which a profile bends, or strains the ground."""
    found = []
    for i in np.flatnonzero(assembly.moving).tolist() if any(profiles) else []:
        x = assembly.outline(i)[:, 0]
        extent = float(x.min()), float(x.max())
        pairs = zip(profiles, settlements, strict=False)
        if any(p is not None and p.bends(*extent, one.direction or (0.0, -1.0)) for p, one in pairs):
            found.append(i)
    return found


def pieces_named(names: Sequence[str], assembly: solver.Assembly) -> tuple[str, ...]:
    """Put the names of all blocks drawn with a name in its place, those of the pieces that :func:`cut_ground` cut."""
    uncut = uncut_names(assembly)
    found: dict[str, None] = {}
    for name in names:
        hits = sorted({*blocks_called(name, assembly), *(i for i, whole in enumerate(uncut) if whole == name)})
        # Free blocks may be drawn with the name of a support.
        hits = [i for i in hits if not assembly.free[i]] or hits
        found |= dict.fromkeys([assembly.names[i] for i in hits] or [name])
    return tuple(found)


def uncut_names(assembly: solver.Assembly) -> list[str]:
    """Name each block as it was called before :func:`cut_ground` cut it."""
    parts = [name.rpartition(" ") for name in assembly.names]
    return [
        first if number.isdigit() and name != drawn else name
        for name, drawn, (first, _, number) in zip(assembly.names, assembly.drawn_names, parts, strict=True)
    ]


def _with_pieces(assembly: solver.Assembly, pieces: Mapping[int, Sequence[np.ndarray]]) -> solver.Assembly:
    """Put pieces, from left to right, in the place of blocks, by their numbers."""
    rows: list[tuple[Any, int, str]] = []
    for i in range(assembly.n_blocks):
        parts = pieces.get(i, [assembly.outline(i)])
        names = [f"{assembly.names[i]} {k}" for k in range(1, len(parts) + 1)] if i in pieces else [assembly.names[i]]
        if i in pieces and (taken := set(names) & {*assembly.names, *assembly.drawn_names}):
            raise ValueError(
                f"the ground '{assembly.names[i]}' is cut for a profile, and its piece '{min(taken)}' has the name of "
                "another block; rename one of them"
            )
        rows += [(outline, i, name) for outline, name in zip(parts, names, strict=True)]
    owner = [i for _, i, _ in rows]
    cut = solver.Assembly.from_outlines(
        [outline for outline, _, _ in rows],
        names=[name for _, _, name in rows],
        roles=assembly.roles[owner].tolist(),
        density=assembly.density[owner],
        thickness=assembly.thickness[owner],
        materials=[assembly.materials[i] for i in owner],
    )
    return replace(cut, drawn_names=tuple(assembly.drawn_names[i] for i in owner))


def _cut(assembly: solver.Assembly, support: int) -> list[np.ndarray]:
    """Outlines of the pieces of a support, cut upright where a block on it begins or ends, from left to right."""
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 2.0 * TOUCHING * assembly.block_size)
    pair = np.stack([contacts.block_a, contacts.block_b], axis=1)
    near = (pair == support).any(axis=1) & (np.abs(contacts.gaps) <= TOUCHING * assembly.block_size)
    other, x = pair[near].sum(axis=1) - support, contacts.points[near, 0]
    feet = np.array(sorted((x[other == k].min(), x[other == k].max()) for k in np.unique(other))).reshape(-1, 2)
    outline = assembly.outline(support)
    least = NARROWEST * assembly.block_size
    cuts: list[float] = []
    # Where nothing stands, under a door or beside the wall, the ground is a piece of its own.
    for x in np.sort(feet.ravel()).tolist():
        inside = outline[:, 0].min() + least < x < outline[:, 0].max() - least
        if inside and (not cuts or x > cuts[-1] + least):
            cuts.append(x)
    low, high = outline.min(axis=0) - 1.0, outline.max(axis=0) + 1.0
    edges = [float(low[0]), *cuts, float(high[0])]
    polygon, found = shapely.Polygon(outline), []
    for left, right in pairwise(edges):
        parts = pieces_of(shapely.intersection(polygon, shapely.box(left, low[1], right, high[1])))
        found += [shapely.get_coordinates(part)[:-1] for part in parts]
    return found
