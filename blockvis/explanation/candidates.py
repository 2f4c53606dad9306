"""Candidates: the movements of supports that may have caused what was observed."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import solver
from blockvis.cases.explain_settings import DIRECTIONS, ExplainSettings
from blockvis.cases.profiles import STRAIGHT, Profile, bearing_points, bearings, cut_ground, uncut_names
from blockvis.layout.outlines import TOUCHING
from blockvis.text import nearest
from solver import mechanics

#: Directions of the case file: their axis, the last one upright, and whether they go along or against it.
WAYS = {"down": (-1, -1.0), "up": (-1, 1.0), "left": (0, -1.0), "right": (0, 1.0), "front": (1, -1.0), "back": (1, 1.0)}

#: Level directions to and from the middle between the supports, in space: each support has its own.
RADIAL = {"outward": 1.0, "inward": -1.0}

#: In which ways supports may have moved where the case does not say: in the plane, in space, and where these are many,
#: as under a dome.
IN_PLANE = ("down", "left", "right", "rotation")
IN_SPACE = ("down", "outward", "left", "right", "front", "back", "rotation")
OF_MANY = ("down", "outward")

#: More supports than this in the drawing are a ground of several stones, not footings of their own.
MOST_SUPPORTS = 6

#: Supports in space that are looked at in all ways, as those of a cross vault: of more the ways cost much time.
FEW_IN_SPACE = 4

#: Ground on which at least so many blocks stand can form a trough.
FEWEST_FEET = 3

#: Slopes of the ground begin at these fractions of the width of the structure, from the side that goes down.
SLOPES = (0.25, 0.375, 0.5, 0.625, 0.75)

#: Blocks stand on faces longer than this, in block sizes.
SHORTEST_FOOT = 0.05

#: Movements whose difference from a translation of everything is as alike as this open the same cracks.
ALIKE = 1e-9

#: Weight of a movement between two directions, and of causes that were added where the first ones fitted best.
OBLIQUE = 0.5


#: Displacement and rotation of supports by their names, [dx, dy, rotation] or [dx, dy, dz, rx, ry, rz].
Motions = Mapping[str, tuple[float, ...]]


@dataclass(frozen=True)
class Candidate:
    """A movement of supports, of which one parameter says how far it goes."""

    cause: str  #: In words; candidates of one cause differ in parameters that the cause leaves open.
    #: (n_dof,) tuples [m and rad]: of each support that takes part, at the middle of where it carries something.
    motions: Motions
    #: Weight before anything was observed, relative to other causes; shared by the candidates of the cause.
    prior: float = 1.0
    detail: str = ""  #: What the cause leaves open, in words.
    #: [m] Both of a trough; nan for others.
    centre: float = float("nan")
    inflection: float = float("nan")
    #: The detail of the candidate that this one was added to look at more closely; empty for those of the start.
    refines: str = ""
    ways: tuple[str, ...] = ()  #: Directions in which supports move.
    turns: bool = False  #: Whether supports turn as one body: its amount is the angle.
    #: Whether the ground bends, in a trough or at the beginning of a slope: its amount is the differential settlement.
    bends: bool = False

    @property
    def is_trough(self) -> bool:
        """Whether it is a trough of the ground."""
        return bool(np.isfinite(self.centre))


@dataclass(frozen=True)
class Ground:
    """The supports of a structure, as drawn and as cut for troughs."""

    assembly: solver.Assembly  #: Every support fixed; cut where troughs are looked at.
    pieces: Mapping[str, tuple[str, ...]]  #: What became of each support of the drawing.
    troughs: bool  #: Whether troughs are looked at.
    notes: tuple[str, ...] = field(default=())  #: What was cut.


def ground_of(assembly: solver.Assembly, settings: ExplainSettings, source: Path) -> Ground:
    """Cut the supports of an assembly, as drawn, for troughs, where these are candidates.

    Raises ``ValueError`` for one without supports, and for troughs under one that stands on less than two places.
    """
    supports = np.flatnonzero(~assembly.free).tolist()
    if not supports:
        raise ValueError(f'{source}: no block is a support; give some the role "fixed" under [roles] or [[supports]]')
    fixed = assembly.with_roles(np.where(assembly.free, mechanics.FREE, mechanics.FIXED))
    whole = {assembly.names[i]: (assembly.names[i],) for i in supports}
    given = [key for key in ("trough", "centres", "inflections") if getattr(settings, key)]
    if assembly.dimension == 3 and given:
        raise ValueError(
            f"{source}: [explain] {given[0]} is of structures in the plane, this one is in space; leave it out"
        )
    if settings.trough is False or assembly.dimension == 3:
        return Ground(fixed, whole, troughs=False)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        cut = cut_ground(fixed, chosen=supports)
    called = list(zip(cut.names, uncut_names(cut), strict=True))
    pieces = {name: tuple(one for one, uncut in called if uncut == name) for name in whole}
    feet = sum(len(_bearing(cut, names)) for names in pieces.values())
    if feet < FEWEST_FEET and settings.trough is None:
        return Ground(fixed, whole, troughs=False)
    if feet < 2:
        raise ValueError(
            f"{source}: [explain] trough: the structure stands on one place, which cannot bend; leave it out"
        )
    return Ground(cut, pieces, troughs=True, notes=tuple(str(warning.message) for warning in caught))


def _bearing(assembly: solver.Assembly, names: Sequence[str] | None = None) -> list[int]:
    """Find the supports, of these names or all, on which free blocks stand, with a face, not a corner alone."""
    contacts = mechanics.find_contacts(assembly, assembly.vertices, TOUCHING * assembly.block_size)
    found = []
    for block in np.flatnonzero(~assembly.free).tolist() if names is None else map(assembly.index, names):
        points = contacts.points[(contacts.block_a == block) | (contacts.block_b == block)]
        if len(points) and np.ptp(points, axis=0).max() > SHORTEST_FOOT * assembly.block_size:
            found.append(block)
    return found


def candidates_of(ground: Ground, settings: ExplainSettings, source: Path) -> list[Candidate]:
    """List the causes that are looked at first.

    Raises ``ValueError`` for a support of [explain] that there is not, and where no cause is left.
    """
    found: list[Candidate] = []
    directions = _directions(ground, settings, source)
    for group in _asked(ground, settings, source) or _groups(ground):
        pieces = [piece for name in group for piece in ground.pieces[name]]
        if _bearing(ground.assembly, pieces):
            found += _movements(ground, group, pieces, directions)
    if ground.troughs:
        found += _troughs(ground, settings)
    if not found:
        raise ValueError(
            f"{source}: there is one support, and nothing else can move; give [[supports]] as they may have moved"
            + (", or [explain] trough = true" if ground.assembly.dimension == 2 else "")
        )
    return found


def _asked(ground: Ground, settings: ExplainSettings, source: Path) -> list[tuple[str, ...]]:
    """List the groups of supports that the case names, each as it was drawn or by the name it got."""
    names = list(ground.pieces)
    drawn = {one: ground.assembly.drawn_names[ground.assembly.index(ground.pieces[one][0])] for one in names}
    for name in (name for group in settings.supports for name in group):
        if name not in names:
            kind = "a free block" if name in ground.assembly.names else "no block"
            raise ValueError(
                f"{source}: [explain] supports: '{name}' is {kind}{nearest(name, names)}; supports are "
                f"{', '.join(names[:12])}"
            )
    return [
        tuple(dict.fromkeys(one for name in group for one in names if name in (one, drawn[one])))
        for group in settings.supports
    ]


def _directions(ground: Ground, settings: ExplainSettings, source: Path) -> tuple[str, ...]:
    """List the ways in which supports may have moved."""
    d, few = ground.assembly.dimension, len(ground.pieces) <= FEW_IN_SPACE
    found = settings.directions or (IN_PLANE if d == 2 else IN_SPACE if few else OF_MANY)
    strange = [direction for direction in found if direction in ("front", "back", *RADIAL)]
    if d == 2 and strange:
        raise ValueError(
            f"{source}: [explain] directions: '{strange[0]}' is of structures in space, this one is in the plane; "
            f"choose from {', '.join(DIRECTIONS[:5])}"
        )
    return found


def _groups(ground: Ground) -> tuple[tuple[str, ...], ...]:
    """List the supports that may have moved: each, and in space all of them, which may spread."""
    names, d = tuple(ground.pieces), ground.assembly.dimension
    if len(names) < 2 or (d == 2 and len(names) > MOST_SUPPORTS):
        return ()
    return (*((name,) for name in names), *((names,) if d == 3 and len(names) > 2 else ()))


def _movements(
    ground: Ground, group: Sequence[str], pieces: Sequence[str], directions: Sequence[str]
) -> Iterator[Candidate]:
    """Move and turn a group of supports as one."""
    d = ground.assembly.dimension
    whole = d == 3 and len(group) == len(ground.pieces) > 2
    words = "all supports" if whole else " and ".join(group)
    move, turn, tilt = ("moves", "turns", "tilts") if len(group) == 1 else ("move", "turn", "tilt")
    for direction in directions:
        if direction != "rotation":
            # All supports that go the same way open no crack.
            if (not whole or direction in RADIAL) and (motions := translation(ground, pieces, direction)):
                yield Candidate(f"{words} {move} {said(direction)}", motions, ways=(direction,))
        elif d == 2:
            for sense, way in ((1.0, "counter-clockwise"), (-1.0, "clockwise")):
                yield Candidate(f"{words} {turn} {way}", rotation_of(ground.assembly, pieces, (sense,)), turns=True)
        elif not whole:
            for way in ("left", "right", "front", "back"):
                # The top goes there: the axis is upright × that way.
                x, y = unit_vector(way, 3)[:2]
                motions = rotation_of(ground.assembly, pieces, (-y + 0.0, x, 0.0))
                yield Candidate(f"{words} {tilt} to the {way}", motions, turns=True)


def said(way: str) -> str:
    """Say a direction as it follows "moves"."""
    return f"to the {way}" if way in ("front", "back") else way


def unit_vector(way: str, d: int) -> tuple[float, ...]:
    """Turn a direction of :data:`WAYS` into a vector of d numbers."""
    axis, sign = WAYS[way]
    return tuple(sign if k == axis % d else 0.0 for k in range(d))


def translation(ground: Ground, pieces: Sequence[str], direction: str) -> dict[str, tuple[float, ...]]:
    """Move supports in a direction of :data:`WAYS` or :data:`RADIAL`; nothing where one of them has none."""
    assembly = ground.assembly
    turn = (0.0,) * (1 if assembly.dimension == 2 else 3)
    if direction in WAYS:
        return {piece: (*unit_vector(direction, assembly.dimension), *turn) for piece in pieces}
    supports = assembly.centroids[~assembly.free, :2]
    away = assembly.centroids[[assembly.index(piece) for piece in pieces], :2]
    away = away - (supports.min(axis=0) + supports.max(axis=0)) / 2.0
    far = np.linalg.norm(away, axis=1)
    if far.min() < 1e-6 * assembly.block_size:
        return {}
    rows = (RADIAL[direction] * away / far[:, None]).tolist()
    return {piece: (*row, 0.0, *turn) for piece, row in zip(pieces, rows, strict=True)}


def rotation_of(
    assembly: solver.Assembly, pieces: Sequence[str], spin: tuple[float, ...]
) -> dict[str, tuple[float, ...]]:
    """Turn supports as one body about the middle of where they carry something, by a rotation (n_rot,)."""
    blocks = [assembly.index(piece) for piece in pieces]
    points, centre = bearing_points(assembly, blocks), bearing_points(assembly, [blocks])
    middle = solver.Pose(np.repeat(centre, len(blocks), axis=0), np.zeros((len(blocks), len(spin))))
    rate = np.concatenate([np.zeros_like(points), np.tile(spin, (len(blocks), 1))], axis=1)
    speeds = mechanics.point_velocities(points, np.arange(len(blocks)), middle, rate) + 0.0
    return {piece: (*row, *spin) for piece, row in zip(pieces, speeds.tolist(), strict=True)}


def _troughs(ground: Ground, settings: ExplainSettings) -> list[Candidate]:
    """Troughs over the width of the structure, and slopes of its left and right part."""
    # Between these x the structure stands on its supports.
    x = np.concatenate([ground.assembly.outline(i)[:, 0] for i in _bearing(ground.assembly)])
    low, high = float(x.min()), float(x.max())
    width = high - low
    centres = settings.centres or tuple(np.linspace(low, high, 5).tolist())
    inflections = settings.inflections or (width / 6.0, width / 3.0)
    found = [trough(ground, centre, inflection) for centre in centres for inflection in inflections]
    if not settings.centres:
        for side, start, end in (("left", low, high), ("right", high, low)):
            for share in SLOPES:
                hinge = start + share * (end - start)
                points = sorted([(start, 1.0), (hinge, 0.0)])
                motions = _by_profile(ground, Profile("points", points=tuple(points)))
                words = f"the ground slopes down to the {side}"
                if any(any(motion) for motion in motions.values()):
                    found.append(Candidate(words, motions, detail=f"from x = {hinge:.3g} m on", bends=True))
    return [one for one in found if differential(ground.assembly, scaled_motions(one)) > STRAIGHT]


def trough(ground: Ground, centre: float, inflection: float, refines: str = "") -> Candidate:
    """Make the candidate of a Gaussian trough."""
    motions = _by_profile(ground, Profile("gaussian", centre, inflection))
    detail = f"deepest at x = {centre:.3g} m, steepest {inflection:.3g} m from there"
    return Candidate("a trough of the ground", motions, 1.0, detail, centre, inflection, refines, bends=True)


def _by_profile(ground: Ground, profile: Profile) -> Motions:
    names = [piece for pieces in ground.pieces.values() for piece in pieces]
    x = bearings(ground.assembly, [ground.assembly.index(name) for name in names])[:, :, 0]
    return dict(zip(names, map(tuple, profile.motions(x, (0.0, -1.0)).tolist()), strict=True))


def refined(ground: Ground, best: Sequence[Candidate], known: Sequence[Candidate]) -> list[Candidate]:
    """List candidates around the best of causes that are worth it, but for those that are known.

    They are movements between two directions, and troughs beside the best trough.
    """
    found: list[Candidate] = []
    troughs = [one for one in known if one.is_trough]
    names = [*WAYS][:4]
    if ground.assembly.dimension == 3:
        # Each way costs runs: those that the case leaves out are left out between two, as well.
        names = [way for way in (*WAYS, "outward") if any(way in one.ways for one in known)]
    for one in best:
        if one.is_trough:
            found += _other_troughs(ground, one, troughs)
        # Of supports that turn, or that go two ways already, there are no others between.
        elif len(one.ways) == len(set(one.motions.values())) == 1 and one.ways[0] in names:
            found += _oblique(ground, one, names)
    new = {one.cause + one.detail: one for one in reversed(found)}
    taken = {one.cause + one.detail for one in known}
    return [one for one in found if new[one.cause + one.detail] is one and one.cause + one.detail not in taken]


def _other_troughs(ground: Ground, one: Candidate, troughs: Sequence[Candidate]) -> Iterator[Candidate]:
    """Yield the troughs beside one: half way to the next, and wider and narrower."""
    step = min(np.diff(sorted({other.centre for other in troughs})), default=one.inflection) / 2.0
    for centre in (one.centre - step, one.centre, one.centre + step):
        for inflection in (one.inflection / 2.0**0.5, one.inflection, one.inflection * 2.0**0.5):
            if (centre, inflection) != (one.centre, one.inflection):
                yield trough(ground, float(centre), float(inflection), one.detail)


def _oblique(ground: Ground, one: Candidate, names: Sequence[str]) -> Iterator[Candidate]:
    """Yield the movements between the one direction of a candidate and those across it."""
    d, (way,) = ground.assembly.dimension, one.ways
    head = one.cause.removesuffix(f" {said(way)}")
    for other in names:
        motions = translation(ground, list(one.motions), other)
        across = all(abs(np.dot(own[:d], motions[piece][:d])) < 0.5 for piece, own in one.motions.items())
        # A support goes outward from where it stands: across that there is nothing but down.
        radial = bool({way, other} & set(RADIAL)) and "down" not in (way, other)
        if motions and across and other != "up" and not radial:
            words = sorted((way, other), key=names.index)
            both = {k: tuple(a + b for a, b in zip(own, motions[k], strict=True)) for k, own in one.motions.items()}
            yield Candidate(f"{head} {said(words[0])} and {said(words[1])}", both, OBLIQUE, ways=tuple(words))


@dataclass(frozen=True)
class Twin:
    """How a candidate differs from one that opens the same cracks: by a translation of everything."""

    of: int  #: Number of the candidate whose run it shares.
    scale: float  #: Amount of this one per amount of the other.
    travel: np.ndarray  #: (d,) array: translation of everything, per amount of this one.


def twins_of(assembly: solver.Assembly, candidates: Sequence[Candidate]) -> list[Twin]:
    """Find candidates that differ by a translation of the whole structure, which opens no crack.

    Each has a twin: itself where it has its own run.
    """
    bearing = _bearing(assembly)
    size, d = float(np.ptp(assembly.vertices, axis=0).max()), assembly.dimension
    shapes: list[tuple[np.ndarray, float, np.ndarray]] = []
    found: list[Twin] = []
    for number, one in enumerate(candidates):
        motion = _table(assembly, bearing, scaled_motions(one))
        mean = motion[:, :d].mean(axis=0)
        relative = np.concatenate([(motion[:, :d] - mean).ravel(), size * motion[:, d:].ravel()])
        length = float(np.linalg.norm(relative))
        shape = relative / length if length > 1e-9 else relative
        twin = Twin(number, 1.0, np.zeros(d))
        for other, (known, norm, travel) in enumerate(shapes):
            if norm > 1e-9 and length > 1e-9 and shape @ known > 1.0 - ALIKE and found[other].of == other:
                scale = norm / length
                # Of amount a of this one, the other has gone a / scale.
                twin = Twin(other, scale, mean - travel / scale)
                break
        shapes.append((shape, length, mean))
        found.append(twin)
    return found


def opens_cracks(assembly: solver.Assembly, candidate: Candidate) -> bool:
    """Whether supports move against each other or turn."""
    motion, d = _table(assembly, _bearing(assembly), candidate.motions), assembly.dimension
    return bool(np.ptp(motion[:, :d], axis=0).max() > 1e-12 or np.abs(motion[:, d:]).max() > 1e-12)


def _table(assembly: solver.Assembly, blocks: Sequence[int], motions: Motions) -> np.ndarray:
    """(n, n_dof) array [m and rad]: motions of blocks, 0 of those that stand still."""
    at_rest = (0.0,) * (3 if assembly.dimension == 2 else 6)
    return np.array([motions.get(assembly.names[i], at_rest) for i in blocks])


def per_amount(assembly: solver.Assembly, candidate: Candidate) -> tuple[float, str]:
    """Amount of a candidate per unit of its settlement, and its unit.

    The amount is the displacement of a support that moves, the angle of supports that turn as one, and of a ground that
    bends the difference between where it goes down most and least: what is common to all feet opens no crack.
    """
    motions = scaled_motions(candidate)
    if candidate.turns:
        return float(np.linalg.norm(next(iter(motions.values()))[assembly.dimension :])), "rad"
    unit = solver.Settlement(profile=candidate.motions).unit
    return (differential(assembly, motions) if candidate.bends else 1.0), unit


def differential(assembly: solver.Assembly, motions: Motions) -> float:
    """Difference [m] between the lowest and the highest of the supports on which something stands, moved by these."""
    return float(np.ptp(_table(assembly, _bearing(assembly), motions)[:, assembly.dimension - 1]))


def scaled_motions(candidate: Candidate) -> Motions:
    """Scale the motions of a candidate as its settlement does."""
    profile = solver.Settlement(profile=candidate.motions).profile
    assert profile is not None
    return {name: tuple(map(float, motion)) for name, motion in profile.items()}
