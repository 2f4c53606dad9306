"""Fragility: the probability of collapse against the settlement, from runs that collapsed and runs that did not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri

import solver

from .study_folder import NO_RESULT

if TYPE_CHECKING:
    import pandas as pd

#: Status of runs that stood as far as they were followed.
STOOD = (str(solver.Status.LIMIT_REACHED), str(solver.Status.LOCKED))


@dataclass(frozen=True)
class Fragility:
    """A fragility curve: a step at every settlement at which a run collapsed.

    Attributes
    ----------
    settlement : (n_steps,) array [m or rad]
    probability : (n_steps,) array
        Of a collapse at this settlement or before.
    lower, upper : (n_steps,) arrays
        Confidence band, point by point.
    furthest : float [m or rad]
        Up to here the curve is known: the largest settlement that any run was followed to.
    n_runs, n_collapsed, n_stood : int
        Runs the curve is made of, those that collapsed, and those that stood as far as they were followed.
    confidence : float
    """

    settlement: np.ndarray
    probability: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    furthest: float
    n_runs: int
    n_collapsed: int
    n_stood: int
    confidence: float

    def quantile(self, probability: float) -> float | None:
        """The settlement [m or rad] at which the probability of collapse is reached; None where it is not."""
        reached = np.flatnonzero(self.probability >= probability - 1e-12)
        return float(self.settlement[reached[0]]) if len(reached) else None


def observations(table: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """How far each run with a result went, and whether it collapsed there.

    Parameters
    ----------
    table : pandas.DataFrame
        Of a study.

    Returns
    -------
    settlement : (n,) array [m or rad]
        Of the collapse, 0 where there was no equilibrium from the start; of a run that stood, the last one.
    collapsed : (n,) bool array
    """
    known = table[~table["status"].isin(NO_RESULT)]
    collapsed = ~known["status"].isin(STOOD).to_numpy(dtype=bool)
    settlement = np.where(collapsed, known["collapse_displacement"], known["last_settlement"])
    return settlement.astype(float), collapsed


def fragility_of(table: pd.DataFrame, confidence: float = 0.95) -> Fragility:
    """The fragility curve of the table of a study; runs without result are left out, and have to be told beside it."""
    return fragility(*observations(table), confidence)


def fragility(settlement: ArrayLike, collapsed: ArrayLike, confidence: float = 0.95) -> Fragility:
    """The fragility curve of runs that collapsed, and of runs that stood as far as they were followed.

    Parameters
    ----------
    settlement : (n,) array [m or rad]
        Of the collapse, or the last one of a run that stood.
    collapsed : (n,) bool array
    confidence : float

    Notes
    -----
    E. L. Kaplan and P. Meier, Nonparametric estimation from incomplete observations, Journal of the American
    Statistical Association 53 (1958) 457-481, https://doi.org/10.1080/01621459.1958.10501452.

    The band is Wilson's interval with the effective number of runs p (1 - p) / V from Greenwood's variance V: K. J.
    Rothman, Estimation of confidence limits for the cumulative probability of survival in life table analysis, Journal
    of Chronic Diseases 31 (1978) 557-560. Where every run collapsed or was followed further this is Wilson's
    interval of the share of runs. It takes runs as independent; those of a latin hypercube or Sobol' sequence
    scatter less.
    """
    end, event = np.asarray(settlement, dtype=float), np.asarray(collapsed, dtype=bool)
    steps, dead = np.unique(end[event], return_counts=True)
    # A run that stood up to a settlement was at risk there.
    at_risk = len(end) - np.searchsorted(np.sort(end), steps, side="left")
    standing = np.cumprod(1.0 - dead / np.maximum(at_risk, 1))
    last = dead == at_risk
    greenwood = np.cumsum(np.where(last, 0.0, dead / np.where(last, 1.0, at_risk * (at_risk - dead).astype(float))))
    with np.errstate(divide="ignore", invalid="ignore"):
        runs = (1.0 - standing) / (standing * greenwood)
    for k in np.flatnonzero(last):
        # The variance says nothing where nothing stands: as many runs as at the step before.
        runs[k] = runs[k - 1] if k else at_risk[k]
    lower, upper = wilson(1.0 - standing, runs, confidence)
    return Fragility(
        settlement=steps,
        probability=1.0 - standing,
        lower=lower,
        upper=upper,
        furthest=float(end.max(initial=0.0)),
        n_runs=len(end),
        n_collapsed=int(event.sum()),
        n_stood=int((~event).sum()),
        confidence=confidence,
    )


def wilson(share: ArrayLike, number: ArrayLike, confidence: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
    """Wilson's interval of a probability.

    Parameters
    ----------
    share : (n,) array
        Of the observations in which the event happened.
    number : (n,) array
        Of observations; need not be whole.
    confidence : float

    Notes
    -----
    E. B. Wilson, Probable inference, the law of succession, and statistical inference, Journal of the American
    Statistical Association 22 (1927) 209-212, https://doi.org/10.1080/01621459.1927.10502953.

    Examples
    --------
    >>> low, high = wilson(0.5, 10)
    >>> print(f"{low:.4f} {high:.4f}")
    0.2366 0.7634
    """
    p, n = np.asarray(share, dtype=float), np.asarray(number, dtype=float)
    z = float(ndtri(0.5 + confidence / 2.0))
    centre = (p + z**2 / (2.0 * n)) / (1.0 + z**2 / n)
    half = z / (1.0 + z**2 / n) * np.sqrt(p * (1.0 - p) / n + z**2 / (4.0 * n**2))
    return np.clip(centre - half, 0.0, 1.0), np.clip(centre + half, 0.0, 1.0)
