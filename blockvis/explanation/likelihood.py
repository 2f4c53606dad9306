"""How well each candidate, friction and amount agrees with the observations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import logsumexp

import solver
from blockvis.cases.block_at import distances_to
from blockvis.results.joint_faces import corners_of, on_faces
from blockvis.results.joints import InitialJoints, carried_faces, initial_joints
from solver import mechanics

from .candidates import Candidate, Twin
from .forward import COLLAPSE, Run, Variant, pose_of
from .observations import Observations

#: Amounts at which the likelihood is worked out, each larger than the one before by the same factor: from the fraction
#: of the largest on within which a collapse is found.
AMOUNTS = 320

#: An observation may be of a joint that lies about so many blocks farther than its place is certain.
NEIGHBOURHOOD = 0.5

#: Joints with a smaller chance than this, against that of the nearest, are not compared.
LEAST_CHANCE = 0.02

#: What the model may show where nothing was observed, as a fraction of the root mean square of what was.
ELSEWHERE = 0.7

#: A crack is made where the model opens by more than this fraction of its width.
MADE = 0.25

#: What was observed is explained where it is within so many standard deviations of what a cause makes.
EXPLAINED = 3.0

#: Observations of one structure share the errors of its model: more than this do not count as independent.
INDEPENDENT = 20


@dataclass(frozen=True)
class Trust:
    """How far observations and model are trusted."""

    model: float  #: Standard deviation of computed widths, as a fraction of the observed ones.
    place: float  #: [m] Within which a crack at x, y may be another joint.
    outliers: float  #: Probability that an observation has another cause.


class Comparison:
    """Observations laid over the joints of a model, whose supports go so far [m] at most.

    An observation at x, y may be of any joint near its place: which of two neighbouring joints opens, the model cannot
    say, and where the drawing has other blocks than the structure its joints lie elsewhere. Each of these is compared
    with every joint near it, and what these comparisons say is averaged, the nearer ones counting more; one that names
    its joint is of that. Along a joint nothing is left open: on which side it gapes tells one hinge from another.
    """

    def __init__(
        self, assembly: solver.Assembly, observations: Observations, trust: Trust, farthest: float = 0.0
    ) -> None:
        self.assembly, self.observations, self.trust = assembly, observations, trust
        self.joints: InitialJoints = initial_joints(assembly)
        given = observations
        away, weights = on_faces(given.places, self.joints)
        beyond = np.maximum(away - trust.place, 0.0) / (NEIGHBOURHOOD * assembly.block_size)
        chance = np.where(given.named[:, None], 0.0, np.exp(-0.5 * beyond**2))
        n = len(given.places)
        #: (n_widths,) int array: the joint in which each place lies, or the nearest.
        self.own = away.argmin(axis=1) if n else np.zeros(0, dtype=int)
        chance[np.arange(n), self.own] = 1.0
        chance[chance < LEAST_CHANCE] = 0.0
        chance /= chance.sum(axis=1, keepdims=True)
        #: (n_widths, n_joints) array: probability that an observation is of a joint, before its width is known.
        self.chance = chance
        #: (n_pairs,) int arrays: observation and joint of the pairs that are compared, observation by observation.
        self.seen, self.joint = np.nonzero(chance)
        self.first = np.searchsorted(self.seen, np.arange(n))
        self.log_chance = np.log(chance[self.seen, self.joint])
        #: (n_joints, k) int array: corners of each face.
        self.corners = corners_of(self.joints)
        #: (n_pairs, k) array: of these, where on the face of the joint the place lies.
        self.weights = weights[self.seen, self.joint]
        #: (n_pairs,) bool array: whether the largest width of the joint counts, wherever on its face that is.
        self.whole = given.whole[self.seen]
        names = {name: i for i, name in enumerate(assembly.names)}
        self.blocks = np.array(
            [
                names[name] if name in names else int(np.argmin(distances_to(assembly, point)))
                for name, point in zip(given.blocks, given.points, strict=True)
            ],
            dtype=int,
        )
        #: (n_widths,) and (m, 2) arrays [m]: sizes of which the model's errors are fractions.
        self.scales = _error_scales(given.widths), _error_scales(given.displacements)
        # How supports move is what a cause says, not what the model makes of it.
        on_supports = ~assembly.free[self.blocks]
        self.scales[1][on_supports] = 0.0
        #: (2,) array [m]: width of what observed widths and displacements may be where they have another cause.
        # The part of strays would grow with the amounts that are looked at, were those of displacements not as wide.
        self.spans = 2.0 * given.largest, 2.0 * max(farthest, given.largest)
        far = np.linalg.norm(given.displacements, axis=1) > EXPLAINED * given.point_uncertainties
        measured = self.blocks[on_supports]
        #: (d,) array [m], or None: what displacements have in common, where they tell of supports against each other
        #: alone: of those that were surveyed, two or more, none stands still.
        self.common: np.ndarray | None = None
        if len(np.unique(measured)) > 1 and far[on_supports].all():
            self.common = np.median(given.displacements[on_supports], axis=0)
        self.on_supports = on_supports

    def openings(self, moved: np.ndarray) -> np.ndarray:
        """(n, n_corners) array [m]: at the corners of the faces, where blocks move by (n, n_blocks, n_dof)."""
        poses = (pose_of(self.assembly, one) for one in moved)
        found = [carried_faces(self.assembly, self.joints, pose).gaps for pose in poses]
        return np.maximum(np.array(found).reshape(len(moved), -1), 0.0)

    def widths(self, openings: np.ndarray) -> np.ndarray:
        """(n, n_pairs) array [m]: what openings (n, n_corners) show at the places, in each joint near these."""
        around = openings[:, self.corners[self.joint]]
        first = around[..., 0]
        there = first + ((around - first[..., None]) * self.weights).sum(axis=2)
        return np.where(self.whole, around.max(axis=2, initial=0.0), np.maximum(there, 0.0))

    def largest_openings(self, openings: np.ndarray) -> np.ndarray:
        """(n, n_joints) array [m]: the largest of openings (n, n_corners) of each joint."""
        return np.asarray(openings[:, self.corners].max(axis=2, initial=0.0))

    def displacements(self, moved: np.ndarray) -> np.ndarray:
        """(n, n_points, d) array [m]: of the observed points, where blocks move by (n, n_blocks, n_dof)."""
        points, drawn = self.observations.points, solver.Pose.initial(self.assembly)
        found = [mechanics.carried(points, self.blocks, drawn, pose_of(self.assembly, one)) for one in moved]
        return np.array(found).reshape(len(moved), *points.shape) - points

    def in_frame(self, displacements: np.ndarray) -> np.ndarray:
        """Give displacements (n, n_points, d) [m] what those observed have in common, where that opens nothing."""
        if self.common is None:
            return displacements
        own = np.median(displacements[:, self.on_supports], axis=1, keepdims=True)
        return np.asarray(displacements - own + self.common)

    def log_likelihood(self, widths: np.ndarray, displacements: np.ndarray) -> np.ndarray:
        """(n,) array: logarithm of the probability density of the observations.

        Widths are (n, n_pairs), displacements (n, n_points, d) [m]. Each observation is normally distributed about what
        the model shows, with the variances of the measurement and of the model added, or, with the probability of an
        outlier, evenly over twice the largest observed width, or as far both ways as supports may have gone.
        Observations beyond :data:`INDEPENDENT` sharpen nothing: all of them weigh less.
        """
        given = self.observations
        count = len(given.widths) + given.points.size
        weight = min(1.0, INDEPENDENT / count)
        stray_widths, stray_points = np.log(self.trust.outliers / np.array(self.spans))
        total = np.zeros(len(widths))
        sigma, spread = self.deviations
        if len(self.seen):
            terms = _log_normal(widths - given.widths[self.seen], sigma[self.seen]) + self.log_chance
            fits = np.logaddexp.reduceat(terms, self.first, axis=1) + np.log1p(-self.trust.outliers)
            total += np.logaddexp(fits, stray_widths).sum(axis=1)
        if len(given.points):
            fits = _log_normal(displacements - given.displacements, spread) + np.log1p(-self.trust.outliers)
            total += np.logaddexp(fits, stray_points).sum(axis=(1, 2))
        return weight * total

    @property
    def deviations(self) -> tuple[np.ndarray, np.ndarray]:
        """Standard deviations of observed minus computed widths (n_widths,) and displacements (n_points, d) [m]."""
        given, model = self.observations, self.trust.model
        # By the observed sizes, not the computed ones: else a smaller amount would always look more certain.
        sigma = np.hypot(given.uncertainties, model * self.scales[0])
        return sigma, np.hypot(given.point_uncertainties[:, None], model * self.scales[1])

    def likeliest(self, widths: np.ndarray) -> np.ndarray:
        """(n, n_widths) int array: the pair of each observation that fits best, of pairs with widths (n, n_pairs)."""
        sigma, _ = self.deviations
        terms = _log_normal(widths - self.observations.widths[self.seen], sigma[self.seen]) + self.log_chance
        last = np.append(self.first, len(self.seen))[1:]
        best = [start + terms[:, start:end].argmax(axis=1) for start, end in zip(self.first, last, strict=True)]
        return np.array(best, dtype=int).reshape(-1, len(widths)).T

    def made(self, widths: np.ndarray, displacements: np.ndarray) -> np.ndarray:
        """(n,) bool array: whether any crack (n, n_widths), or displacement (n, n_points, d), observed is made at all.

        Else a movement that moves nothing would be the likeliest cause of what no movement makes, at any amount.
        """
        given = self.observations
        opened = given.widths > 0.0
        makes = (widths[:, opened] > MADE * given.widths[opened]).any(axis=1)
        common = 0.0 if self.common is None else self.common
        observed = given.displacements - common
        along = ((displacements - common) * observed).sum(axis=2)
        return np.asarray(makes | (along > MADE * (observed**2).sum(axis=1)).any(axis=1))

    def misfits(self, widths: np.ndarray, displacements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Differences of widths (n, n_widths) and points (n, n_points, d) from the observed, in standard deviations."""
        sigma, spread = self.deviations
        over = (displacements - self.observations.displacements) / spread
        return (widths - self.observations.widths) / sigma, np.linalg.norm(over, axis=-1)


def _error_scales(observed: np.ndarray) -> np.ndarray:
    """Sizes of which the model's errors are fractions: those observed, and everywhere a part of their mean square.

    A joint that is closed beside wide cracks may be open in a model of other blocks.
    """
    return np.hypot(observed, ELSEWHERE * np.sqrt((observed**2).mean())) if observed.size else np.zeros(observed.shape)


def _log_normal(gap: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Logarithm of the normal density [1/m] at gaps [m]."""
    return np.asarray(-0.5 * (gap / sigma) ** 2 - np.log(sigma * np.sqrt(2.0 * np.pi)))


@dataclass(frozen=True)
class Trial:
    """A candidate at one friction, against the observations."""

    candidate: Candidate
    variant: Variant
    run: Run  #: Of the candidate itself, or of its twin.
    twin: Twin  #: How the amount of the candidate follows from that of the run.
    shared: Candidate  #: The candidate that was run: itself, or its twin.
    unit: str  #: Of the amounts.
    #: (n,) array [m or rad]: of the candidate, in a geometric series up to the largest that is looked at.
    amounts: np.ndarray
    #: (n,) array: -inf where the structure has fallen, the run was not followed, or nothing observed is made.
    log_likelihood: np.ndarray
    #: (n, n_widths) array [m]: what it shows of the observations: in the joint near each of them that fits best.
    widths: np.ndarray
    pairs: np.ndarray  #: (n, n_widths) int array: which joint that is, as a pair of the comparison.
    #: (n_increments, n_corners) array [m]: openings at the corners of the faces, at the increments of the run.
    gaps: np.ndarray
    displacements: np.ndarray  #: (n, n_points, d) array [m]: of the observed points.

    @cached_property
    def log_evidence(self) -> float:
        """Logarithm of the likelihood, averaged over the amounts."""
        return float(logsumexp(self.log_mass))

    @property
    def log_mass(self) -> np.ndarray:
        """(n,) array: logarithm of the likelihood of each amount times its prior, evenly spread up to the largest."""
        # Each stands for those around it, which are as many as it is large.
        return np.asarray(self.log_likelihood + np.log(self.amounts / self.amounts.sum()))

    @property
    def best(self) -> int:
        """Number of the likeliest amount."""
        return int(np.argmax(self.log_likelihood))

    def openings(self, chosen: np.ndarray) -> np.ndarray:
        """(n, n_corners) array [m]: at the corners of the faces, at the amounts of these numbers (n,)."""
        return self.run.at(self.amounts[chosen] / self.twin.scale, self.gaps)

    def moved(self, k: int) -> np.ndarray:
        """(n_blocks, n_dof) array [m and rad]: at amount k."""
        moved = self.run.at(self.amounts[[k]] / self.twin.scale, self.run.moved)[0].copy()
        moved[:, : len(self.twin.travel)] += self.amounts[k] * self.twin.travel
        return moved


def tried(
    comparison: Comparison,
    candidate: Candidate,
    variant: Variant,
    run: Run,
    twin: Twin,
    shared: Candidate,
    unit: str,
    largest: float,
) -> Trial:
    """Compare the run of the candidate ``shared`` with the observations, at every amount up to a largest [m or rad]."""
    amounts = largest * np.geomspace(COLLAPSE, 1.0, AMOUNTS)
    own = amounts / twin.scale
    # At the increments the pictures are exact; between them joints open evenly.
    gaps = comparison.openings(run.moved)
    pairs = run.at(own, comparison.widths(gaps))
    displacements = run.at(own, comparison.displacements(run.moved)) + (amounts[:, None] * twin.travel)[:, None, :]
    displacements = comparison.in_frame(displacements)
    found = comparison.log_likelihood(pairs, displacements)
    found[own > run.amounts[-1] * (1.0 + 1e-9)] = -np.inf
    chosen = comparison.likeliest(pairs)
    widths = np.take_along_axis(pairs, chosen, axis=1)
    found[~comparison.made(widths, displacements)] = -np.inf
    return Trial(candidate, variant, run, twin, shared, unit, amounts, found, widths, chosen, gaps, displacements)
