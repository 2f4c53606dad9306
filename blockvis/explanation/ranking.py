"""Causes in the order of their probability: their amounts, what none explains, what to measure next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from .likelihood import EXPLAINED, MADE, Comparison, Trial
from .observations import LEAST_UNCERTAINTY

#: Causes less probable than the best by more than this factor are told apart from it.
TOLD_APART = 10.0

#: Shares of the probability below and above the range of an amount.
TAILS = (0.05, 0.5, 0.95)

#: Causes less probable than this are not worth a measurement, but for the second.
WORTH_A_WORD = 0.01

#: Causes among which a measurement is to decide, at most.
MOST_COMPARED = 6

#: Points at which a width that a cause lets expect is sampled, and joints that tell as much but for this part.
SAMPLES, AS_MUCH = 24, 1e-3


@dataclass(frozen=True)
class Cause:
    """A cause, with what it leaves open weighed by the observations."""

    name: str  #: In words.
    also: tuple[str, ...]  #: Other movements that open the same cracks: the same but for a translation of everything.
    probability: float  #: Among the causes that were looked at.
    #: [m or rad] 5 %, median and 95 % of its amount: the largest displacement of a support.
    amount: tuple[float, float, float]
    unit: str  #: "m" or "rad".
    friction: tuple[float, float]  #: Range of the coefficients that agree.
    detail: str  #: What the best of its candidates adds in words.
    best: Trial  #: The likeliest candidate and friction.
    at: int  #: Number of the likeliest amount.
    trials: tuple[Trial, ...]
    weights: tuple[float, ...]  #: Of the trials within the cause.

    @property
    def falls_at(self) -> float:
        """Amount [m or rad] by which the model has fallen in all runs that agree; inf where one of them goes on."""
        agree = [t for t, w in zip(self.trials, self.weights, strict=True) if w * TOLD_APART >= max(self.weights)]
        return max(float(t.run.amounts[-1]) * t.twin.scale if t.run.fell else np.inf for t in agree)


@dataclass(frozen=True)
class Measurement:
    """A joint at which the next measurement tells causes apart best."""

    joint: int  #: Number of the joint of the layout.
    name: str  #: Its two blocks.
    place: tuple[float, ...]  #: [m]
    widths: tuple[tuple[str, float], ...]  #: [m] What the causes have there.
    deviations: float  #: By how many standard deviations the two that differ most do.


def ranked(trials: Sequence[Trial], *, apart: bool) -> list[Cause]:
    """Order causes by their probability, from the trials of all candidates, some with several frictions.

    Movements that differ by a translation of everything are told apart by displaced points, not by cracks.

    The prior weighs causes as their candidates say, usually alike; within a cause its candidates alike (a candidate
    that refines another shares the weight of that one), coefficients of friction alike, and amounts evenly up to the
    largest that is looked at. The probability of a cause is its prior times the mean likelihood over all it leaves
    open, by Bayes.
    """
    groups: dict[str, list[Trial]] = {}
    also: dict[str, list[str]] = {}
    for trial in trials:
        name = trial.candidate.cause
        owner = trial.shared.cause
        if owner != name and not apart:
            if name not in also.setdefault(owner, []):
                also[owner].append(name)
            continue
        groups.setdefault(name, []).append(trial)
    found = []
    for name, own in groups.items():
        weights = _weights(own)
        log_terms = np.log(weights) + np.array([trial.log_evidence for trial in own])
        evidence = float(logsumexp(log_terms)) + float(np.log(max(t.candidate.prior for t in own)))
        found.append((evidence, name, own, log_terms))
    if not any(np.isfinite(evidence) for evidence, *_ in found):
        return []
    total = float(logsumexp([evidence for evidence, *_ in found]))
    causes = []
    for evidence, name, own, log_terms in found:
        if not np.isfinite(evidence):
            continue
        share = np.exp(log_terms - logsumexp(log_terms))
        best = max(own, key=lambda trial: float(trial.log_likelihood.max()))
        causes.append(
            Cause(
                name=name,
                also=tuple(also.get(name, ())),
                probability=float(np.exp(evidence - total)),
                amount=_range_of(own, share),
                unit=best.unit,
                friction=_frictions(own, share),
                detail=best.candidate.detail,
                best=best,
                at=best.best,
                trials=tuple(own),
                weights=tuple(share.tolist()),
            )
        )
    return sorted(causes, key=lambda cause: -cause.probability)


def _weights(own: Sequence[Trial]) -> np.ndarray:
    """(n,) array: prior weights of the trials of a cause, with sum 1."""
    parents = [trial.candidate.refines or trial.candidate.detail for trial in own]
    _, parent, members = np.unique(parents, return_inverse=True, return_counts=True)
    return np.asarray(1.0 / (len(members) * members[parent]))


def _range_of(own: Sequence[Trial], share: np.ndarray) -> tuple[float, float, float]:
    """Quantiles of the amount over the trials of a cause."""
    likely = [(s, trial) for s, trial in zip(share, own, strict=True) if s > 0.0]
    amounts = np.concatenate([trial.amounts for _, trial in likely])
    mass = np.concatenate([s * np.exp(trial.log_mass - logsumexp(trial.log_mass)) for s, trial in likely])
    low, middle, high = np.quantile(amounts, TAILS, weights=mass, method="inverted_cdf").tolist()
    return low, middle, high


def _frictions(own: Sequence[Trial], share: np.ndarray) -> tuple[float, float]:
    """Range of the coefficients of friction that are not ten times less likely than the best."""
    by: dict[float, float] = {}
    for trial, s in zip(own, share, strict=True):
        by[trial.variant.friction] = max(by.get(trial.variant.friction, 0.0), float(s))
    likely = [friction for friction, s in by.items() if s * TOLD_APART >= max(by.values())]
    return min(likely), max(likely)


def alike(causes: Sequence[Cause]) -> list[Cause]:
    """List the causes that the observations cannot tell from the best, the best included."""
    return [cause for cause in causes if cause.probability * TOLD_APART >= causes[0].probability]


def unexplained(comparison: Comparison, causes: Sequence[Cause], trials: Sequence[Trial]) -> tuple[np.ndarray, ...]:
    """Find what the best cause does not make, and what no candidate makes at any amount.

    Of widths, (n_widths,) bool arrays, then of points, (n_points,).
    """
    widths = comparison.observations.widths
    best, at = causes[0].best, causes[0].at
    misfit, far = comparison.misfits(best.widths[[at]], best.displacements[[at]])
    by_best, points_by_best = np.abs(misfit[0]) > EXPLAINED, far[0] > EXPLAINED
    # A crack of middling width is within three standard deviations of none at all, which include those of the model.
    missed = widths - best.widths[at] > EXPLAINED * comparison.observations.uncertainties
    by_best |= missed & (best.widths[at] < MADE * widths)
    reached, nearest = np.zeros(len(widths)), np.full(len(points_by_best), np.inf)
    for trial in trials:
        possible = np.isfinite(trial.log_likelihood)
        if possible.any():
            reached = np.maximum(reached, trial.widths[possible].max(axis=0, initial=0.0))
            _, far = comparison.misfits(trial.widths[possible], trial.displacements[possible])
            nearest = np.minimum(nearest, far.min(axis=0, initial=np.inf))
    slack = EXPLAINED * comparison.deviations[0]
    # What is within what is left of the model's own width is no sign of another cause.
    by_none = (widths > 0.0) & (reached < np.maximum(widths - slack, MADE * widths))
    return by_best | by_none, by_none, points_by_best, nearest > EXPLAINED


def next_measurement(comparison: Comparison, causes: Sequence[Cause]) -> Measurement | None:
    """Find the joint whose width tells most about which cause it is; None where no other than those measured does.

    It is to decide among the causes, the most probable first, that the observations cannot tell apart, whatever it
    would tell about the others; where the first is told apart, between that and the next ones.
    """
    if len(causes) < 2:
        return None
    chosen = alike(causes)[:MOST_COMPARED]
    if len(chosen) < 2:
        chosen = [cause for k, cause in enumerate(causes[:4]) if k < 2 or cause.probability > WORTH_A_WORD]
    table = np.array([_expected(comparison, cause) for cause in chosen])
    mean, spread = table[:, 0], table[:, 1]
    sigma = np.sqrt(spread**2 + (comparison.trust.model * mean) ** 2 + LEAST_UNCERTAINTY**2)
    weights = np.array([max(cause.probability, WORTH_A_WORD) for cause in chosen])
    apart = (np.abs(mean[:, None] - mean) / np.hypot(sigma[:, None], sigma)).max(axis=(0, 1))
    # Where somebody has measured already nothing new is to be found.
    apart[comparison.own] = 0.0
    # A difference within a standard deviation tells nothing.
    gain = np.where(apart < 1.0, 0.0, _information(mean, sigma, weights / weights.sum()))
    if not gain.max(initial=0.0) > 0.0:
        return None
    # Where several joints tell all there is to tell, rounding would choose.
    best = int(np.argmax(np.where(gain < (1.0 - AS_MUCH) * gain.max(), 0.0, apart)))
    assembly, joints = comparison.assembly, comparison.joints
    return Measurement(
        joint=best,
        name=f"{assembly.names[joints.block_a[best]]} | {assembly.names[joints.block_b[best]]}",
        place=tuple(joints.rings.middles()[best].tolist()),
        widths=tuple((cause.name, float(mean[k, best])) for k, cause in enumerate(chosen)),
        deviations=float(apart[best]),
    )


def _information(mean: np.ndarray, sigma: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(n_joints,) array: what a width is expected to tell about which of the causes it is, in nats.

    It is normally distributed under each cause, (n_causes, n_joints) [m]; weights (n_causes,) have the sum 1.
    """
    nodes, shares = np.polynomial.hermite_e.hermegauss(SAMPLES)
    told = np.zeros(mean.shape[1])
    for weight, middle, deviation in zip(weights, mean, sigma, strict=True):
        for node, share in zip(nodes, shares / shares.sum(), strict=True):
            away = (middle + node * deviation - mean) / sigma
            any_cause = logsumexp(-0.5 * away**2 - np.log(sigma), axis=0, b=weights[:, None])
            told += weight * share * (-0.5 * node**2 - np.log(deviation) - any_cause)
    return told


def _expected(comparison: Comparison, cause: Cause) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation (n_joints,) [m] of the openings under a cause, over all it leaves open."""
    mean = square = np.zeros(0)
    for trial, share in zip(cause.trials, cause.weights, strict=True):
        if share < 1e-3:
            continue
        mass = share * np.exp(trial.log_mass - logsumexp(trial.log_mass))
        heavy = np.flatnonzero(mass > 1e-3 * mass.max())
        openings = comparison.largest_openings(trial.openings(heavy))
        first, second = mass[heavy] @ openings, mass[heavy] @ openings**2
        mean, square = (first, second) if len(mean) == 0 else (mean + first, square + second)
    return mean, np.sqrt(np.maximum(square - mean**2, 0.0))
