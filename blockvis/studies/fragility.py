"""Fragility: probability of collapse against settlement or load, from runs that collapsed and runs that did not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri

from .sensitivity import outcome, without_collapse
from .study_folder import NO_RESULT, NOT_BUILT

if TYPE_CHECKING:
    import pandas as pd

#: Probability that a value lies in its band.
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Fragility:
    """A fragility curve: a step at every settlement at which a run collapsed or was broken off."""

    settlement: np.ndarray  #: (n_steps,) array [m or rad].
    #: (n_steps,) arrays: of a collapse at this settlement or before, if the runs that were broken off never collapse,
    #: and if they collapse where they were broken off.
    probability: np.ndarray
    at_most: np.ndarray
    #: (n_steps,) arrays: pointwise confidence band, of the one below and of the other above.
    lower: np.ndarray
    upper: np.ndarray
    furthest: float  #: [m or rad] The curve is known up to the largest settlement of any run.
    #: Runs, those that did not collapse within their limit, and those that were broken off.
    n_runs: int
    n_stood: int
    n_broken_off: int

    def quantile(self, probability: float) -> tuple[float | None, float | None]:
        """Find the first and the last settlement [m or rad] at which a probability of collapse may be reached.

        They differ where runs were broken off; None if it is not reached.
        """
        reached = [np.flatnonzero(of >= probability - 1e-12) for of in (self.at_most, self.probability)]
        first, last = (float(self.settlement[at[0]]) if len(at) else None for at in reached)
        return first, last


def fragility_of(table: pd.DataFrame) -> Fragility:
    """Estimate the fragility curve from the table of a study; runs that were not built are left out.

    The settlement of a run is that at collapse, 0 without an initial equilibrium, or its last one. A run without result
    is broken off there, one of which nothing is known at 0.
    """
    built = table[table["status"] != NOT_BUILT]
    return fragility(outcome(built), ~without_collapse(built), built["status"].isin(NO_RESULT))


def fragility(settlement: ArrayLike, collapsed: ArrayLike, broken_off: ArrayLike = False) -> Fragility:
    """Estimate the fragility curve from runs that collapsed, that did not within their limit, and that were broken off.

    The settlement (n,) [m or rad] is that at collapse, or the last one of a run that did not collapse. Limits have
    nothing to do with a collapse; runs are broken off as they collapse, for all that is known, or would never.

    E. L. Kaplan and P. Meier, Nonparametric estimation from incomplete observations, Journal of the American
    Statistical Association 53 (1958) 457-481, https://doi.org/10.1080/01621459.1958.10501452.

    The band is Wilson's interval with the effective number of runs p (1 - p) / V from Greenwood's variance V: K. J.
    Rothman, Estimation of confidence limits for the cumulative probability of survival in life table analysis, Journal
    of Chronic Diseases 31 (1978) 557-560. If every run collapsed or was followed further, this is Wilson's interval of
    the share of runs. It assumes independent runs; those of a latin hypercube or Sobol' sequence scatter less.
    """
    end, event = np.asarray(settlement, dtype=float), np.asarray(collapsed, dtype=bool)
    open_ended = np.broadcast_to(np.asarray(broken_off, dtype=bool), event.shape)
    steps = np.unique(end[event | open_ended])
    so_far, left = (np.searchsorted(np.sort(end[of]), steps, side="right") for of in (event, open_ended))
    dead = np.diff(so_far, prepend=0)
    # A run that did not collapse up to a settlement was at risk there, one that was broken off is anywhere.
    at_risk = len(end) - np.searchsorted(np.sort(end[~open_ended]), steps, side="left")
    standing = np.cumprod(1.0 - dead / at_risk)
    least, most = 1.0 - standing, 1.0 - standing * (1.0 - left / np.maximum(at_risk - dead, 1))
    # At the most all that were broken off so far collapse here.
    (lower, _), (_, upper) = (_band(share, dead, here, at_risk) for share, here in ((least, dead), (most, dead + left)))
    return Fragility(
        settlement=steps,
        probability=least,
        at_most=most,
        lower=lower,
        upper=upper,
        furthest=float(end.max(initial=0.0)),
        n_runs=len(end),
        n_stood=int((~event & ~open_ended).sum()),
        n_broken_off=int(open_ended.sum()),
    )


def _band(share: np.ndarray, dead: np.ndarray, here: np.ndarray, at_risk: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the band of a share collapsed by the numbers that are dead at the steps before, and at each one here."""
    with np.errstate(divide="ignore", invalid="ignore"):
        before, now = (number / (at_risk * (at_risk - number)) for number in (dead, here))
        runs = share / ((1.0 - share) * (np.cumsum(np.append(0.0, before))[:-1] + now))
    runs = np.where(share > 0.0, runs, at_risk)
    if (share == 1.0).any():
        # The variance is undefined when no run is left standing: take the number of runs of the step before.
        runs[-1] = runs[-2] if len(runs) > 1 else at_risk[-1]
    return wilson(share, runs)


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
