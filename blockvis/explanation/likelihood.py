"""How well each candidate, friction and amount agrees with the observations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import logsumexp

import solver
from blockvis.results.joints import InitialJoints, end_openings, initial_joints

from .candidates import Candidate, Twin
from .forward import Run
from .observations import Observations, block_at

#: Amounts at which the likelihood is worked out, evenly from 0 to the largest.
AMOUNTS = 480

#: The model says nothing of cracks narrower than this fraction of the widest observed one.
FLOOR = 0.03


#: Observations of one structure share the errors of its model: more than this do not count as independent.
INDEPENDENT = 12


@dataclass(frozen=True)
class Trust:
    """How far observations and model are trusted.

    Attributes
    ----------
    model : float
        Standard deviation of computed widths, as a fraction of them.
    place : float [m]
        Within which a crack at x, y may be another joint.
    outliers : float
        Probability that an observation has another cause.
    """

    model: float
    place: float
    outliers: float


class Comparison:
    """Observations laid over the joints of a model.

    A joint counts in full where it is as near to a place as the place is certain, and less up to a block farther:
    which of two neighbouring joints opens, the model cannot say. What was observed is smoothed alike, so that a closed
    joint beside a crack is not held against a model that has the crack there. Along a joint nothing is smoothed: on
    which side it gapes tells one hinge from another.

    Parameters
    ----------
    assembly : solver.Assembly
    observations : Observations
    trust : Trust
    """

    def __init__(self, assembly: solver.Assembly, observations: Observations, trust: Trust) -> None:
        self.assembly, self.observations, self.trust = assembly, observations, trust
        self.joints: InitialJoints = initial_joints(assembly)
        given = observations
        certain = np.where(given.named, 0.0, trust.place)
        away, self.along = _projected(given.places, self.joints.ends)
        # Of a joint that is only named the largest width counts, wherever along it that is.
        self.along[given.whole] = np.nan
        #: (n_widths, n_joints) array: weight of each joint at each place.
        self.nearness = _weight(away - certain[:, None], assembly.block_size)
        n = len(given.places)
        every = np.arange(n)
        #: (n_widths,) int array: the joint in which each place lies, or the nearest.
        self.own = away.argmin(axis=1) if n else np.zeros(0, dtype=int)
        self.nearness[every, self.own] = 1.0
        # Row i: the other places, as the joint of place i sees them.
        between, there = _projected(given.places, self.joints.ends[self.own])
        between, there = between.T, there.T
        sides = 1.0 - 2.0 * np.abs(there - self.along[every, self.own][:, None])
        sides[given.whole], sides[:, given.whole] = 1.0, 1.0
        alike = _weight(between - certain[:, None], assembly.block_size) * np.clip(sides, 0.0, 1.0)
        np.fill_diagonal(alike, 1.0)
        #: (n_widths,) array [m]: the observed widths, smoothed as those of the model are.
        self.smoothed = (alike * given.widths[None, :]).max(axis=1, initial=0.0)
        source = (alike * given.widths[None, :]).argmax(axis=1) if n else np.zeros(0, dtype=int)
        self.sigma = np.maximum(given.uncertainties, given.uncertainties[source] * (self.smoothed > given.widths))
        names = {name: i for i, name in enumerate(assembly.names)}
        self.blocks = np.array(
            [
                names[name] if name in names else block_at(assembly, point)
                for name, point in zip(given.blocks, given.points, strict=True)
            ],
            dtype=int,
        )

    def openings(self, moved: np.ndarray) -> np.ndarray:
        """(n, n_joints, 2) array [m]: at both ends of the joints, where blocks move by (n, n_blocks, 3)."""
        start = self.assembly.centroids
        poses = (solver.Pose(start + one[:, :2], one[:, 2:]) for one in moved)
        found = [end_openings(self.assembly, self.joints, pose) for pose in poses]
        return np.maximum(np.array(found).reshape(len(moved), -1, 2), 0.0)

    def widths(self, openings: np.ndarray) -> np.ndarray:
        """(n, n_widths) array [m]: what openings (n, n_joints, 2) show at the places."""
        first, last = openings[:, None, :, 0], openings[:, None, :, 1]
        there = np.where(np.isnan(self.along), np.maximum(first, last), first + (last - first) * self.along)
        return np.asarray((self.nearness * there).max(axis=2, initial=0.0))

    def displacements(self, moved: np.ndarray) -> np.ndarray:
        """(n, n_points, 2) array [m]: of the observed points, where blocks move by (n, n_blocks, 3)."""
        arms = self.observations.points - self.assembly.centroids[self.blocks]
        turn = moved[:, self.blocks, 2]
        cosine, sine = np.cos(turn) - 1.0, np.sin(turn)
        across = np.stack([cosine * arms[:, 0] - sine * arms[:, 1], sine * arms[:, 0] + cosine * arms[:, 1]], axis=2)
        return np.asarray(moved[:, self.blocks, :2] + across)

    def log_likelihood(self, widths: np.ndarray, displacements: np.ndarray) -> np.ndarray:
        """(n,) array: logarithm of the probability density of the observations.

        Notes
        -----
        Each observation is normally distributed about what the model shows, with the variances of the measurement and
        of the model added, or, with the probability of an outlier, evenly over twice the largest observed width.
        Observations beyond :data:`INDEPENDENT` sharpen nothing: all of them weigh less.
        """
        total = np.zeros(len(widths))
        count = len(self.observations.widths) + 2 * len(self.observations.points)
        span = 2.0 * self.observations.largest
        for gap, sigma in self._residuals(widths, displacements):
            fits = -0.5 * (gap / sigma) ** 2 - np.log(sigma * np.sqrt(2.0 * np.pi)) + np.log1p(-self.trust.outliers)
            strays = np.log(self.trust.outliers / span)
            total += np.logaddexp(fits, strays).sum(axis=1)
        return total * min(1.0, INDEPENDENT / count)

    def misfits(self, widths: np.ndarray, displacements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Differences from the observed widths and points, in standard deviations: (n, n_widths), (n, n_points)."""
        (gap, sigma), (apart, spread) = self._residuals(widths, displacements)
        over = (apart / spread).reshape(len(widths), -1, 2)
        return gap / sigma, np.hypot(over[..., 0], over[..., 1])

    def _residuals(self, widths: np.ndarray, displacements: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        given, floor = self.observations, FLOOR * self.observations.largest
        # By the observed size, not the computed one: else a smaller amount would always look more certain.
        sigma = np.sqrt(self.sigma**2 + (self.trust.model * self.smoothed) ** 2 + floor**2)
        apart = displacements - given.displacements
        size = np.abs(given.displacements)
        spread = np.sqrt(given.point_uncertainties[:, None] ** 2 + (self.trust.model * size) ** 2 + floor**2)
        n = len(widths)
        return [(widths - self.smoothed, sigma[None]), (apart.reshape(n, -1), spread.reshape(1, -1))]


def _projected(points: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances of points (n, 2) from lines (m, 2, 2) [m], and where along these, from 0 to 1: (n, m) arrays."""
    start, line = ends[:, 0], ends[:, 1] - ends[:, 0]
    squared = np.maximum((line**2).sum(axis=1), 1e-300)
    along = np.clip(((points[:, None] - start) * line).sum(axis=2) / squared, 0.0, 1.0)
    apart = points[:, None] - (start + along[..., None] * line)
    return np.hypot(apart[..., 0], apart[..., 1]), along


def _weight(beyond: np.ndarray, size: float) -> np.ndarray:
    """1 up to where a place is certain, falling to 0 a block farther."""
    return np.clip(1.0 - np.maximum(beyond, 0.0) / size, 0.0, 1.0)


@dataclass(frozen=True)
class Trial:
    """A candidate at one friction, against the observations.

    Attributes
    ----------
    candidate : Candidate
    friction : float
    run : Run
        Of the candidate itself, or of its twin.
    twin : Twin
        How the amount of the candidate follows from that of the run.
    shared : Candidate
        The candidate that was run: itself, or its twin.
    unit : str
        Of the amounts.
    amounts : (n,) array [m or rad]
        Of the candidate, evenly spaced up to the largest that is looked at.
    log_likelihood : (n,) array
        -inf where the structure has fallen, or where the run was not followed.
    widths : (n, n_widths) array [m]
        At the places that were observed.
    ends : (n_increments, n_joints, 2) array [m]
        Openings of the joints at their ends, at the increments of the run.
    """

    candidate: Candidate
    friction: float
    run: Run
    twin: Twin
    shared: Candidate
    unit: str
    amounts: np.ndarray
    log_likelihood: np.ndarray
    widths: np.ndarray
    ends: np.ndarray

    @cached_property
    def log_evidence(self) -> float:
        """Logarithm of the likelihood, averaged over the amounts."""
        return float(logsumexp(self.log_likelihood) - np.log(len(self.amounts)))

    @property
    def best(self) -> int:
        """Number of the likeliest amount."""
        return int(np.argmax(self.log_likelihood))

    def openings(self, chosen: np.ndarray) -> np.ndarray:
        """(n, n_joints, 2) array [m]: at both ends of the joints, at the amounts of these numbers (n,)."""
        return self.run.at(self.amounts[chosen] / self.twin.scale, self.ends)

    def moved(self, k: int) -> np.ndarray:
        """(n_blocks, 3) array [m, m, rad]: at amount k."""
        moved = self.run.at(self.amounts[[k]] / self.twin.scale, self.run.moved)[0].copy()
        moved[:, :2] += self.amounts[k] * self.twin.travel
        return moved


def tried(
    comparison: Comparison,
    candidate: Candidate,
    friction: float,
    run: Run,
    twin: Twin,
    shared: Candidate,
    unit: str,
    largest: float,
) -> Trial:
    """Compare a run with the observations, at every amount.

    Parameters
    ----------
    comparison : Comparison
    candidate : Candidate
    friction : float
    run : Run
    twin : Twin
    shared : Candidate
        Whose run it is.
    unit : str
        Of the amount.
    largest : float [m or rad]
        Largest amount of the candidate that is looked at.
    """
    amounts = largest * np.arange(1, AMOUNTS + 1) / AMOUNTS
    if len(run.amounts) < 2:
        widths = np.zeros((AMOUNTS, len(comparison.observations.widths)))
        ends = np.zeros((1, len(comparison.joints.ends), 2))
        return Trial(candidate, friction, run, twin, shared, unit, amounts, np.full(AMOUNTS, -np.inf), widths, ends)
    own = amounts / twin.scale
    # At the increments the pictures are exact; between them joints open evenly.
    ends = comparison.openings(run.moved)
    widths = run.at(own, comparison.widths(ends))
    displacements = run.at(own, comparison.displacements(run.moved)) + (amounts[:, None] * twin.travel)[:, None, :]
    found = comparison.log_likelihood(widths, displacements)
    found[own > run.amounts[-1] * (1.0 + 1e-9)] = -np.inf
    return Trial(candidate, friction, run, twin, shared, unit, amounts, found, widths, ends)
