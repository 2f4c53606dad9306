"""Ties, props and bars: straight members between two points of a structure, or a point and the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from solver.words import counted, make_plain, numbers_of

from .assembly import Assembly
from .geometry.contacts import Contacts, frames_of
from .kinematics import Pose, carried
from .tolerances import SMALLEST_FORCE

#: Members that carry tension only, compression only, and both.
TIE, PROP, BAR = KINDS = ("tie", "prop", "bar")

#: Kind of the contact points that stand for members, in their features: then the member, and its sense.
MEMBER = 9

#: Part of its strength from which on a member is told to yield: forces of an equilibrium may be a little below it.
TOLD_YIELDING = 1.0 - 1e-3

#: What a member does at an increment, by number: not yet or no longer there, without force, elastic, yielding, broken.
ABSENT, SLACK, ELASTIC, YIELDING, BROKEN = range(5)


@dataclass(frozen=True)
class Tie:
    """A straight member between two points, each held by a block or by the ground.

    Attributes
    ----------
    name : str
    blocks : (int or None, int or None)
        Number of the block that holds each end; None for the ground.
    points : ((d,) tuple of float, (d,) tuple of float) [m]
        The ends, in the drawing.
    stiffness : float [N/m]
        Of the whole member: modulus times area over length.
    kind : str
        ``"tie"`` carries tension, ``"prop"`` compression, ``"bar"`` both.
    strength : float [N]
        Force at which it yields; infinite by default.
    brittle : bool
        Whether it breaks at its strength instead.
    prestress : float [N]
        Force with which it is installed: of a prop compression, otherwise tension.
    phase : int
        Settlement, from 1, before which it is installed, at the geometry then.

    Raises
    ------
    ValueError
        For an unknown kind, ends at one place or in one block, or a number outside its range.
    """

    name: str
    blocks: tuple[int | None, int | None]
    points: tuple[tuple[float, ...], tuple[float, ...]]
    stiffness: float
    kind: str = TIE
    strength: float = np.inf
    brittle: bool = False
    prestress: float = 0.0
    phase: int = 1

    def __post_init__(self) -> None:
        """Check the values."""
        make_plain(self)
        who = f"tie '{self.name}'"
        if self.kind not in KINDS:
            raise ValueError(f"{who} is of kind '{self.kind}'; kinds are {', '.join(KINDS)}")
        points = numbers_of(self.points, f"{who}: points")
        if points.ndim != 2 or points.shape[0] != 2 or not np.isfinite(points).all():
            raise ValueError(f"{who} needs two points with finite coordinates; it has {self.points}")
        if not np.linalg.norm(points[1] - points[0]) > 0.0:
            raise ValueError(f"{who} has no length: both ends are at {tuple(points[0].tolist())}; give two places")
        if len(self.blocks) != 2 or any(not isinstance(of, int | np.integer) for of in self.blocks if of is not None):
            raise TypeError(f"{who} has blocks {self.blocks}; give two numbers, assembly.index finds them, or None")
        # As the annotations have it: the caller may fill arrays again, and files take only these.
        object.__setattr__(self, "blocks", tuple(None if block is None else int(block) for block in self.blocks))
        object.__setattr__(self, "points", tuple(map(tuple, points.tolist())))
        if self.blocks[0] == self.blocks[1]:
            held = "the ground" if self.blocks[0] is None else f"block {self.blocks[0]}"
            raise ValueError(f"{who} has both ends in {held}, where it carries nothing; join two blocks")
        if not (np.isfinite(self.stiffness) and self.stiffness > 0.0):
            raise ValueError(f"{who} has a stiffness of {self.stiffness:g} N/m; it must be positive and finite")
        if not self.strength > 0.0:
            raise ValueError(f"{who} has a strength of {self.strength:g} N; it must be positive")
        if not 0.0 <= self.prestress < self.strength:
            raise ValueError(
                f"{who} has a prestress of {self.prestress:g} N; it must be at least 0 and below its strength"
            )
        if self.phase < 1:
            raise ValueError(f"{who} has phase {self.phase}; settlements count from 1")


@dataclass(frozen=True, eq=False)
class TieForces:
    """What the members do at an increment."""

    forces: np.ndarray = field(default_factory=lambda: np.zeros(0))  #: (n_ties,) [N]: tension positive
    elongations: np.ndarray = field(default_factory=lambda: np.zeros(0))  #: (n_ties,) [m], since they were installed
    #: (n_ties,) [m]: lengths without force; nan where a member is absent or broken.
    rest: np.ndarray = field(default_factory=lambda: np.zeros(0))
    #: (n_ties,) int, from ``ABSENT`` to ``BROKEN``.
    states: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    ends: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 2)))  #: (n_ties, 2, d) [m]

    def held(self, ties: Sequence[Tie], gone: np.ndarray) -> TieForces:
        """Return what those do whose blocks are all there; some, (n_blocks,) bool array, are gone."""
        states = np.where(held_ties(ties, gone), self.states, ABSENT)
        return replace(self, rest=np.where(np.isin(states, (ABSENT, BROKEN)), np.nan, self.rest), states=states)


def held_ties(ties: Sequence[Tie], gone: np.ndarray) -> np.ndarray:
    """(n_ties,) bool array: ties whose blocks are all there; some, (n_blocks,) bool array, are gone."""
    return np.array([not any(b is not None and gone[b] for b in tie.blocks) for tie in ties], dtype=bool)


def check_ties(ties: Sequence[Tie], assembly: Assembly, n_phases: float) -> None:
    """Raise ``ValueError`` for blocks or phases that are not there, names used twice, or points of other dimensions.

    Those of the drawing, with 0 phases, are the ones of phase 1; an increment, with infinitely many, tells of all.
    """
    names = [tie.name for tie in ties]
    for tie in ties:
        for block in tie.blocks:
            if block is not None and not 0 <= block < assembly.n_blocks:
                raise ValueError(
                    f"tie '{tie.name}' ends in block {block}; the assembly has {counted(assembly.n_blocks, 'block')}"
                )
        if any(len(point) != assembly.dimension for point in tie.points):
            raise ValueError(
                f"tie '{tie.name}' has points {tie.points}; give {assembly.dimension} coordinates, as the blocks have"
            )
        if tie.phase > max(n_phases, 1):
            remedy = "leave it out, or give ties_at, the ties of an increment" if n_phases == 0 else "give one of these"
            raise ValueError(f"tie '{tie.name}' has phase {tie.phase}, and there are {n_phases} settlements; {remedy}")
        if names.count(tie.name) > 1:
            raise ValueError(f"two ties are named '{tie.name}'; give each its own name")


def tie_ends(ties: Sequence[Tie], assembly: Assembly, pose: Pose) -> np.ndarray:
    """(n_ties, 2, d) array [m]: where the ends of members are at a pose."""
    drawn = np.array([tie.points for tie in ties], dtype=float).reshape(len(ties), 2, assembly.dimension)
    blocks = _blocks(ties)
    moved = carried(drawn.reshape(-1, assembly.dimension), blocks.ravel(), Pose.initial(assembly), pose)
    return np.where((blocks < 0)[:, :, None], drawn, moved.reshape(drawn.shape))


def tie_lengths(ends: np.ndarray) -> np.ndarray:
    """(n_ties,) array [m]: lengths between ends (n_ties, 2, d)."""
    return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))


def is_member(contacts: Contacts) -> np.ndarray:
    """(n,) bool array: which contact points stand for members."""
    return np.asarray(contacts.features[:, 0] == MEMBER)


def present_members(ties: Sequence[Tie], rest: np.ndarray) -> np.ndarray:
    """(n, 4) int array: features of the contact points of the members that are there.

    A contact point pushes only: one that pulls the ends together for tension, one that pushes them apart for
    compression, a bar has both. Of lengths without force, (n_ties,) [m], nan where a member is absent or broken.
    """
    senses = {TIE: (0,), PROP: (1,), BAR: (0, 1)}
    rows = [(MEMBER, i, k, -1) for i in np.flatnonzero(~np.isnan(rest)).tolist() for k in senses[ties[i].kind]]
    return np.array(rows, dtype=np.int64).reshape(-1, 4)


def member_contacts(
    ties: Sequence[Tie], assembly: Assembly, pose: Pose, rest: np.ndarray, features: np.ndarray
) -> Contacts:
    """Return the contact points of members; their gap is how far they are from carrying, negative where they carry.

    Of lengths without force, (n_ties,) [m], and the features of :func:`present_members`, (n, 4) int.
    """
    number, sense = features[:, 1], np.where(features[:, 2] == 1, -1.0, 1.0)
    ends, blocks = tie_ends(ties, assembly, pose)[number], _blocks(ties)[number]
    length = tie_lengths(ends)
    # Of block a: towards block b in tension.
    along = (ends[:, 1] - ends[:, 0]) / length[:, None] * sense[:, None]
    return Contacts(
        features=features,
        block_a=blocks[:, 0],
        block_b=blocks[:, 1],
        points=ends[:, 0],
        frames=frames_of(along),
        gaps=-sense * (length - rest[number]),
        slip=np.zeros((len(features), assembly.dimension - 1)),
        areas=np.zeros(len(features)),
    )


def ties_as_drawn(ties: Sequence[Tie], assembly: Assembly, pose: Pose) -> TieForces:
    """Return members at a pose without a history: each is as long as it is, so that all carry."""
    ends, none = tie_ends(ties, assembly, pose), np.zeros(len(ties))
    return TieForces(none, none, tie_lengths(ends), np.full(len(ties), ELASTIC), ends)


def slack(members: Contacts, n_ties: int) -> np.ndarray:
    """(n,) array [m]: how far contact points of members are from carrying; those of a bar are not, in either sense."""
    number, least = members.features[:, 1], np.full(n_ties, np.inf)
    np.minimum.at(least, number, members.gaps)
    return np.asarray(np.maximum(least[number], 0.0))


def plastic_forces(contacts: Contacts, forces: np.ndarray, ties: Sequence[Tie], before: TieForces) -> TieForces:
    """Return what members do under forces (n_contacts, d) [N] at a limit load, at the geometry of ``before``."""
    force, strength = member_forces(contacts, forces, len(ties)), np.array([tie.strength for tie in ties])
    states = member_states(np.abs(force), strength, float(np.abs(forces).max(initial=0.0)))
    return replace(before, forces=force, states=np.where(np.isnan(before.rest), before.states, states))


def member_forces(contacts: Contacts, forces: np.ndarray, n_ties: int) -> np.ndarray:
    """(n_ties,) array: tension of members, from the forces (n_contacts, d) of all contact points."""
    members = is_member(contacts)
    tension = np.where(contacts.features[members, 2] == 1, -1.0, 1.0) * forces[members, 0]
    return np.bincount(contacts.features[members, 1], tension, n_ties)


def member_states(size: np.ndarray, strength: np.ndarray, largest: float) -> np.ndarray:
    """(n_ties,) int array: slack, elastic or yielding, from sizes of forces, strengths and the largest force."""
    carried = np.where(size >= TOLD_YIELDING * strength, YIELDING, ELASTIC)
    return np.where(size > SMALLEST_FORCE * largest, carried, SLACK)


def _blocks(ties: Sequence[Tie]) -> np.ndarray:
    """(n_ties, 2) int array: blocks of the ends, -1 for the ground."""
    return np.array([[-1 if b is None else b for b in tie.blocks] for tie in ties], dtype=np.int64).reshape(-1, 2)
