"""Candidates: the movements of supports that may have caused what was observed."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import solver
from blockvis.cases.explain_settings import ExplainSettings
from blockvis.cases.profiles import Profile, cut_ground
from blockvis.text import nearest
from solver import mechanics

#: Unit vectors of directions of the case file.
VECTORS = {"down": (0.0, -1.0), "up": (0.0, 1.0), "left": (-1.0, 0.0), "right": (1.0, 0.0)}

#: More supports than this in the drawing are a ground of several stones, not footings of their own.
MOST_SUPPORTS = 6

#: Ground on which at least so many blocks stand can form a trough.
FEWEST_FEET = 3

#: Slopes of the ground begin at these fractions of the width of the structure, from the side that goes down.
SLOPES = (0.25, 0.375, 0.5, 0.625, 0.75)

#: A trough that moves all feet alike within this fraction of its depth is none.
LEAST_DIFFERENCE = 1e-3

#: Blocks touch within this fraction of the block size.
TOUCHING = 2e-3

#: Blocks stand on faces longer than this, in block sizes.
SHORTEST_FOOT = 0.05

#: Movements whose difference from a translation of everything is as alike as this open the same cracks.
ALIKE = 1e-9

#: Weight of a movement between two directions, and of causes that were added where the first ones fitted best.
OBLIQUE = 0.5


@dataclass(frozen=True)
class Candidate:
    """A movement of supports, of which one parameter says how far it goes.

    Attributes
    ----------
    cause : str
        In words; candidates of one cause differ in parameters that the cause leaves open.
    motions : mapping of str to (float, float, float)
        Motion of each support that takes part, as of :class:`solver.Settlement`.
    prior : float
        Weight before anything was observed, relative to other causes; shared by the candidates of the cause.
    detail : str
        What the cause leaves open, in words.
    centre, inflection : float [m]
        Of a trough; nan for others.
    refines : str
        The detail of the candidate that this one was added to look at more closely; empty for those of the start.
    turns : bool
        Whether supports turn as one body: its amount is the angle.
    bends : bool
        Whether the ground bends, in a trough or at the beginning of a slope: its amount is the differential settlement.
    """

    cause: str
    motions: Mapping[str, tuple[float, float, float]]
    prior: float = 1.0
    detail: str = ""
    centre: float = float("nan")
    inflection: float = float("nan")
    refines: str = ""
    turns: bool = False
    bends: bool = False

    @property
    def is_trough(self) -> bool:
        """Whether it is a trough of the ground."""
        return bool(np.isfinite(self.centre))


@dataclass(frozen=True)
class Ground:
    """The supports of a structure, as drawn and as cut for troughs.

    Attributes
    ----------
    assembly : solver.Assembly
        Every support fixed; cut where troughs are looked at.
    pieces : mapping of str to tuple of str
        What became of each support of the drawing.
    notes : tuple of str
        What was cut.
    """

    assembly: solver.Assembly
    pieces: Mapping[str, tuple[str, ...]]
    troughs: bool
    notes: tuple[str, ...] = field(default=())


def ground_of(assembly: solver.Assembly, settings: ExplainSettings, source: Path) -> Ground:
    """Cut the supports of an assembly for troughs, where these are candidates.

    Parameters
    ----------
    assembly : solver.Assembly
        As drawn.
    settings : ExplainSettings
    source : Path
        The case file, for messages.

    Raises
    ------
    ValueError
        For an assembly without supports, and troughs under one that stands on less than two places.
    """
    supports = np.flatnonzero(~assembly.free).tolist()
    if not supports:
        raise ValueError(f'{source}: no block is a support; give some the role "fixed" under [roles] or [[supports]]')
    fixed = assembly.with_roles(np.where(assembly.free, mechanics.FREE, mechanics.FIXED))
    whole = {assembly.names[i]: (assembly.names[i],) for i in supports}
    if settings.trough is False:
        return Ground(fixed, whole, troughs=False)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        cut = cut_ground(fixed, (), chosen=supports)
    new = [name for name in cut.names if name not in assembly.names]
    pieces = {
        name: own if (own := tuple(p for p in new if p.rpartition(" ")[0] == name)) else (name,) for name in whole
    }
    feet = sum(len(_bearing(cut, names)) for names in pieces.values())
    if feet < FEWEST_FEET and settings.trough is None:
        return Ground(fixed, whole, troughs=False)
    if feet < 2:
        raise ValueError(
            f"{source}: [explain] trough: the structure stands on one place, which cannot bend; leave it out"
        )
    return Ground(cut, pieces, troughs=True, notes=tuple(str(warning.message) for warning in caught))


def _touching(assembly: solver.Assembly) -> mechanics.Contacts:
    """Find the contact points of the layout."""
    return mechanics.find_contacts(assembly, assembly.vertices, TOUCHING * assembly.block_size)


def _bearing(assembly: solver.Assembly, names: Sequence[str]) -> list[int]:
    """Find the supports of these names on which free blocks stand, with a face, not a corner alone."""
    contacts = _touching(assembly)
    found = []
    for name in names:
        block = assembly.index(name)
        points = contacts.points[(contacts.block_a == block) | (contacts.block_b == block)]
        if len(points) and np.ptp(points, axis=0).max() > SHORTEST_FOOT * assembly.block_size:
            found.append(block)
    return found


def candidates_of(ground: Ground, settings: ExplainSettings, source: Path) -> list[Candidate]:
    """List the causes that are looked at first.

    Parameters
    ----------
    ground : Ground
    settings : ExplainSettings
    source : Path
        The case file, for messages.

    Raises
    ------
    ValueError
        For a support of [explain] that there is not, and where no cause is left.
    """
    names = list(ground.pieces)
    for group in settings.supports:
        for name in group:
            if name not in names:
                kind = "a free block" if name in ground.assembly.names else "no block"
                raise ValueError(
                    f"{source}: [explain] supports: '{name}' is {kind}{nearest(name, names)}; supports are "
                    f"{', '.join(names[:12])}"
                )
    groups = settings.supports
    if not groups and 1 < len(names) <= MOST_SUPPORTS:
        groups = tuple((name,) for name in names)
    found = []
    for group in groups:
        pieces = [piece for name in group for piece in ground.pieces[name]]
        if not _bearing(ground.assembly, pieces):
            continue
        words = " and ".join(group)
        move, turn = ("moves", "turns") if len(group) == 1 else ("move", "turn")
        for direction in settings.directions:
            if direction in VECTORS:
                found.append(Candidate(f"{words} {move} {direction}", _translation(pieces, VECTORS[direction])))
                continue
            for sense, way in ((1.0, "counter-clockwise"), (-1.0, "clockwise")):
                motions = rotation_of(ground.assembly, pieces, sense)
                found.append(Candidate(f"{words} {turn} {way}", motions, turns=True))
    if ground.troughs:
        found += _troughs(ground, settings)
    if not found:
        raise ValueError(
            f"{source}: there is one support, and nothing else can move; give [[supports]] as they may have moved, or "
            "[explain] trough = true"
        )
    return found


def _translation(pieces: Sequence[str], vector: tuple[float, float]) -> dict[str, tuple[float, float, float]]:
    return {piece: (*vector, 0.0) for piece in pieces}


def rotation_of(
    assembly: solver.Assembly, pieces: Sequence[str], sense: float
) -> dict[str, tuple[float, float, float]]:
    """Turn supports as one body about the middle of where they carry something."""
    blocks = [assembly.index(piece) for piece in pieces]
    contacts = _touching(assembly)
    here = np.isin(contacts.block_a, blocks) | np.isin(contacts.block_b, blocks)
    low, high = contacts.points[here].min(axis=0), contacts.points[here].max(axis=0)
    arms = assembly.centroids[blocks] - (low + high) / 2.0
    return {
        assembly.names[i]: (-sense * float(y), sense * float(x), sense)
        for i, (x, y) in zip(blocks, arms.tolist(), strict=True)
    }


def _troughs(ground: Ground, settings: ExplainSettings) -> list[Candidate]:
    """Troughs over the width of the structure, and slopes of its left and right part."""
    low, high = _extent(ground)
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
    return [one for one in found if differential(ground.assembly, scaled_motions(one)) > LEAST_DIFFERENCE]


def _extent(ground: Ground) -> tuple[float, float]:
    """Find the x between which the structure stands on its supports [m]."""
    bearing = _bearing(ground.assembly, [piece for pieces in ground.pieces.values() for piece in pieces])
    x = np.concatenate([ground.assembly.outline(i)[:, 0] for i in bearing])
    return float(x.min()), float(x.max())


def trough(ground: Ground, centre: float, inflection: float, refines: str = "") -> Candidate:
    """Make the candidate of a Gaussian trough."""
    motions = _by_profile(ground, Profile("gaussian", centre, inflection))
    detail = f"deepest at x = {centre:.3g} m, steepest {inflection:.3g} m from there"
    return Candidate("a trough of the ground", motions, 1.0, detail, centre, inflection, refines, bends=True)


def _by_profile(ground: Ground, profile: Profile) -> dict[str, tuple[float, float, float]]:
    blocks = [ground.assembly.index(piece) for pieces in ground.pieces.values() for piece in pieces]
    return profile.motions(ground.assembly, blocks, (0.0, -1.0))


def refined(ground: Ground, best: Sequence[Candidate], known: Sequence[Candidate]) -> list[Candidate]:
    """List candidates around the best ones: movements between two directions, and troughs beside the best trough.

    Parameters
    ----------
    ground : Ground
    best : sequence of Candidate
        The best of each cause that is worth it.
    known : sequence of Candidate
        Looked at already.
    """
    found: list[Candidate] = []
    troughs = [one for one in known if one.is_trough]
    for one in best:
        if one.is_trough:
            others = sorted({other.centre for other in troughs})
            step = min(np.diff(others), default=one.inflection) / 2.0
            for centre in (one.centre - step, one.centre, one.centre + step):
                for inflection in (one.inflection / 2.0**0.5, one.inflection, one.inflection * 2.0**0.5):
                    if (centre, inflection) != (one.centre, one.inflection):
                        found.append(trough(ground, float(centre), float(inflection), one.detail))
            continue
        vectors = {motion for motion in one.motions.values()}
        if (
            len(vectors) != 1
            or (only := next(iter(vectors)))[2] != 0.0
            or " and " in one.cause.rpartition(" moves ")[2]
        ):
            continue
        head, _, way = one.cause.rpartition(" ")
        for other, vector in VECTORS.items():
            across = abs(vector[0] * only[0] + vector[1] * only[1]) < 0.5
            if across and other != "up" and way in VECTORS:
                both = (only[0] + vector[0], only[1] + vector[1])
                words = sorted((way, other), key=list(VECTORS).index)
                motions = _translation(list(one.motions), both)
                found.append(Candidate(f"{head} {words[0]} and {words[1]}", motions, OBLIQUE))
    taken = {one.cause + one.detail for one in known}
    return [
        one
        for k, one in enumerate(found)
        if one.cause + one.detail not in taken | {o.cause + o.detail for o in found[:k]}
    ]


@dataclass(frozen=True)
class Twin:
    """How a candidate differs from one that opens the same cracks: by a translation of everything.

    Attributes
    ----------
    of : int
        Number of the candidate whose run it shares.
    scale : float
        Amount of this one per amount of the other.
    travel : (2,) array
        Translation of everything, per amount of this one.
    """

    of: int
    scale: float
    travel: np.ndarray


def twins_of(assembly: solver.Assembly, candidates: Sequence[Candidate]) -> list[Twin]:
    """Find candidates that differ by a translation of the whole structure, which opens no crack.

    Parameters
    ----------
    assembly : solver.Assembly
    candidates : sequence of Candidate

    Returns
    -------
    list of Twin
        One per candidate; of itself where it has its own run.
    """
    supports = np.flatnonzero(~assembly.free)
    bearing = _bearing(assembly, [assembly.names[i] for i in supports])
    size = float(np.ptp(assembly.vertices, axis=0).max())
    shapes: list[tuple[np.ndarray, float, np.ndarray]] = []
    found: list[Twin] = []
    for number, one in enumerate(candidates):
        full = scaled_motions(one)
        motion = np.array([full.get(assembly.names[i], (0.0, 0.0, 0.0)) for i in bearing])
        mean = motion[:, :2].mean(axis=0)
        relative = np.concatenate([(motion[:, :2] - mean).ravel(), size * motion[:, 2]])
        length = float(np.linalg.norm(relative))
        shape = relative / length if length > 1e-9 else relative
        twin = Twin(number, 1.0, np.zeros(2))
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
    bearing = _bearing(assembly, [assembly.names[i] for i in np.flatnonzero(~assembly.free)])
    motion = np.array([candidate.motions.get(assembly.names[i], (0.0, 0.0, 0.0)) for i in bearing])
    return bool(np.ptp(motion[:, :2], axis=0).max() > 1e-12 or np.abs(motion[:, 2]).max() > 1e-12)


def per_amount(assembly: solver.Assembly, candidate: Candidate) -> tuple[float, str]:
    """Amount of a candidate per unit of its settlement, and its unit.

    The amount is the displacement of a support that moves, the angle of supports that turn as one, and of a ground that
    bends the difference between where it goes down most and least: what is common to all feet opens no crack.
    """
    motions = scaled_motions(candidate)
    if candidate.turns:
        return abs(next(iter(motions.values()))[2]), "rad"
    unit = solver.Settlement(profile=candidate.motions).unit
    return (differential(assembly, motions) if candidate.bends else 1.0), unit


def differential(assembly: solver.Assembly, motions: Mapping[str, tuple[float, float, float]]) -> float:
    """Difference [m] between the lowest and the highest of the supports on which something stands, moved by these."""
    bearing = _bearing(assembly, [assembly.names[i] for i in np.flatnonzero(~assembly.free)])
    return float(np.ptp([motions.get(assembly.names[i], (0.0, 0.0, 0.0))[1] for i in bearing]))


def scaled_motions(candidate: Candidate) -> Mapping[str, tuple[float, float, float]]:
    """Scale the motions of a candidate as its settlement does."""
    profile = solver.Settlement(profile=candidate.motions).profile
    assert profile is not None
    return {name: (float(dx), float(dy), float(turn)) for name, (dx, dy, turn) in profile.items()}
