"""Fragility: probability of collapse against settlement, from runs that collapsed and runs that did not."""

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

#: Status of runs that did not collapse within their limit.
STOOD = (str(solver.Status.LIMIT_REACHED), str(solver.Status.LOCKED))

#: Probability that a value lies in its band.
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Fragility:
    """A fragility curve: a step at every settlement at which a run collapsed."""

    settlement: np.ndarray  #: (n_steps,) array [m or rad].
    probability: np.ndarray  #: (n_steps,) array: of a collapse at this settlement or before.
    #: (n_steps,) arrays: pointwise confidence band.
    lower: np.ndarray
    upper: np.ndarray
    furthest: float  #: [m or rad] The curve is known up to the largest settlement of any run.
    #: Runs with a result, and those that did not collapse within their limit.
    n_runs: int
    n_stood: int

    def quantile(self, probability: float) -> float | None:
        """Find the settlement [m or rad] at which a probability of collapse is reached; None if it is not reached."""
        reached = np.flatnonzero(self.probability >= probability - 1e-12)
        return float(self.settlement[reached[0]]) if len(reached) else None


def fragility_of(table: pd.DataFrame) -> Fragility:
    """Estimate the fragility curve from the table of a study; runs without result are excluded: report their number.

    The settlement of a run is that at collapse, 0 without an initial equilibrium, or its last one.
    """
    known = table[~table["status"].isin(NO_RESULT)]
    collapsed = ~known["status"].isin(STOOD).to_numpy(dtype=bool)
    settlement = np.where(collapsed, known["collapse_displacement"], known["last_settlement"])
    return fragility(settlement.astype(float), collapsed)


def fragility(settlement: ArrayLike, collapsed: ArrayLike) -> Fragility:
    """Estimate the fragility curve from runs that collapsed and runs that did not collapse within their limit.

    The settlement (n,) [m or rad] is that at collapse, or the last one of a run that did not collapse.

    E. L. Kaplan and P. Meier, Nonparametric estimation from incomplete observations, Journal of the American
    Statistical Association 53 (1958) 457-481, https://doi.org/10.1080/01621459.1958.10501452.

    The band is Wilson's interval with the effective number of runs p (1 - p) / V from Greenwood's variance V: K. J.
    Rothman, Estimation of confidence limits for the cumulative probability of survival in life table analysis, Journal
    of Chronic Diseases 31 (1978) 557-560. If every run collapsed or was followed further, this is Wilson's interval of
    the share of runs. It assumes independent runs; those of a latin hypercube or Sobol' sequence scatter less.
    """
    end, event = np.asarray(settlement, dtype=float), np.asarray(collapsed, dtype=bool)
    steps, dead = np.unique(end[event], return_counts=True)
    # A run that did not collapse up to a settlement was at risk there.
    at_risk = len(end) - np.searchsorted(np.sort(end), steps, side="left")
    standing = np.cumprod(1.0 - dead / at_risk)
    last = dead == at_risk
    greenwood = np.cumsum(np.where(last, 0.0, dead / np.where(last, 1.0, at_risk * (at_risk - dead).astype(float))))
    with np.errstate(divide="ignore", invalid="ignore"):
        runs = (1.0 - standing) / (standing * greenwood)
    for k in np.flatnonzero(last):
        # The variance is undefined when no run is left standing: take the number of runs of the step before.
        runs[k] = runs[k - 1] if k else at_risk[k]
    lower, upper = wilson(1.0 - standing, runs)
    return Fragility(
        settlement=steps,
        probability=1.0 - standing,
        lower=lower,
        upper=upper,
        furthest=float(end.max(initial=0.0)),
        n_runs=len(end),
        n_stood=int((~event).sum()),
    )


def wilson(share: ArrayLike, number: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Compute Wilson's interval, lower and upper (n,), of a probability.

    It is that of the share (n,) of a number (n,) of observations, which need not be whole, in which the event happened:
    E. B. Wilson, Probable inference, the law of succession, and statistical inference, Journal of the American
    Statistical Association 22 (1927) 209-212, https://doi.org/10.1080/01621459.1927.10502953.

    Examples
    --------
    >>> low, high = wilson(0.5, 10)
    >>> print(f"{low:.4f} {high:.4f}")
    0.2366 0.7634
    """
    p, n = np.asarray(share, dtype=float), np.asarray(number, dtype=float)
    z = float(ndtri(0.5 + CONFIDENCE / 2.0))
    centre = (p + z**2 / (2.0 * n)) / (1.0 + z**2 / n)
    half = z / (1.0 + z**2 / n) * np.sqrt(p * (1.0 - p) / n + z**2 / (4.0 * n**2))
    return np.clip(centre - half, 0.0, 1.0), np.clip(centre + half, 0.0, 1.0)
