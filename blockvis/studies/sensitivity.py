"""Sensitivity of the collapse displacement to the parameters of a study."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .study_file import Parameter, Study
from .study_folder import NO_RESULT

if TYPE_CHECKING:
    import pandas as pd

#: Name of the factor of all imperfections together.
IMPERFECTIONS = "imperfections"

#: A swing compares the runs with the lowest and the highest values of a parameter: this fraction of the runs each.
FIFTH = 0.2

#: Fewest runs for an index: with fewer its error is a tenth or more even for a linear function.
FEWEST_RUNS = 64


@dataclass(frozen=True)
class Swing:
    """Difference of the mean outcome between low and high values of a parameter, the others at random."""

    name: str
    #: Mean of the parameter in the compared runs, or the value itself if it has few.
    low_value: float | str
    high_value: float | str
    #: [m or rad] Mean outcome of the runs with the lowest and with the highest values.
    low: float
    high: float
    #: [m or rad] Half the 95 % interval of these means.
    low_error: float
    high_error: float
    #: Whether runs of the one and of the other stood as far as they were followed: their means may be larger.
    at_least: tuple[bool, bool] = (False, False)

    @property
    def size(self) -> float:
        """Difference of the two means [m or rad]."""
        return abs(self.high - self.low)


def outcome(table: pd.DataFrame) -> np.ndarray:
    """(n_rows,) array [m or rad]: collapse displacement, or the last settlement of a run that did not collapse.

    The latter is a lower bound of the collapse displacement. The outcome of a run without result is nan.
    """
    stood = table["collapse_displacement"].isna()
    value = np.where(stood, table["last_settlement"], table["collapse_displacement"]).astype(float)
    value[table["status"].isin(NO_RESULT).to_numpy(dtype=bool)] = np.nan
    return value


def stood_as_far(table: pd.DataFrame) -> np.ndarray:
    """(n_rows,) bool array: runs with a result that stood as far as they were followed."""
    return np.asarray(table["collapse_displacement"].isna() & ~table["status"].isin(NO_RESULT), dtype=bool)


def swings(study: Study, table: pd.DataFrame) -> list[Swing]:
    """Compute the swing of every parameter, by the table of a study, the largest first.

    There is none where no run collapsed: outcomes are no more than how far runs were followed.
    """
    y = outcome(table)
    table, y = table[np.isfinite(y)], y[np.isfinite(y)]
    stood, found = stood_as_far(table), []
    if stood.all():
        return []
    for parameter in study.parameters:
        x = table[parameter.name].to_numpy()
        few = parameter.distribution is None
        pairs: list[tuple[float | str, np.ndarray]] = []
        if few and not parameter.numeric:
            groups = {str(value): np.flatnonzero(x == value) for value in dict.fromkeys(x.tolist())}
            ends = sorted(groups, key=lambda value: float(y[groups[value]].mean()))
            if len(ends) > 1:
                pairs = [(ends[0], groups[ends[0]]), (ends[-1], groups[ends[-1]])]
        elif few:
            x = x.astype(float)
            if len(x) and np.ptp(x) > 0:
                pairs = [(float(v), np.flatnonzero(x == v)) for v in (x.min(), x.max())]
        else:
            x = x.astype(float)
            order = np.argsort(x, kind="stable")
            n = max(1, round(FIFTH * len(x)))
            if len(x) > 1:
                pairs = [(float(x[k].mean()), k) for k in (order[:n], order[-n:])]
        if not pairs:
            continue
        (low_value, lowest), (high_value, highest) = pairs
        low, high = y[lowest], y[highest]
        means, errors = (float(low.mean()), float(high.mean())), (_error(low), _error(high))
        at_least = bool(stood[lowest].any()), bool(stood[highest].any())
        found.append(Swing(parameter.name, low_value, high_value, *means, *errors, at_least))
    return sorted(found, key=lambda swing: -swing.size)


def first_order(study: Study, table: pd.DataFrame) -> dict[str, tuple[float, float]]:
    """Estimate Sobol' indices of first order: the share of each parameter alone in the variance of the outcome.

    Gives the index and half its 95 % interval by name of the parameter, for a "saltelli" study also of all
    imperfections together; nothing if there are too few runs, none collapsed, or the outcome is the same in nearly all.

    For a "saltelli" study: Saltelli et al., Computer Physics Communications 181 (2010) 259-270; for other samples
    RBD-FAST with the correction of its bias: J.-Y. Tissot and C. Prieur, Reliability Engineering and System Safety 107
    (2012) 205-213, https://doi.org/10.1016/j.ress.2012.06.010; both by SALib. For a grid, with equal numbers of runs
    per value: the variance of the means over the variance, its error by the jackknife.
    """
    y = np.full(study.n_runs, np.nan)
    y[table["run"].to_numpy(dtype=int)] = outcome(table)
    if stood_as_far(table).sum() == np.isfinite(y).sum():
        return {}
    few = np.isfinite(y).sum() < FEWEST_RUNS and study.method != "grid"
    if few or not np.isfinite(y).any() or np.nanstd(y) <= 1e-9 * max(abs(float(np.nanmean(y))), 1e-300):
        return {}
    known = np.isfinite(y)
    u = study.design.probabilities[known]
    if study.design.factors:
        found = _exchanged(study, y)
    elif study.method == "grid":
        found = {p.name: _of_groups(u[:, k], y[known]) for k, p in enumerate(study.parameters) if p.n_levels > 1}
    else:
        # Where a single run differs, resamples without it have no variance.
        with np.errstate(invalid="ignore"):
            found = _of_sample(study.parameters, u, y[known], study.seed)
    return {name: pair for name, pair in found.items() if np.isfinite(pair).all()}


def _exchanged(study: Study, y: np.ndarray) -> dict[str, tuple[float, float]]:
    from SALib.analyze import sobol

    groups = y.reshape(-1, study.design.factors + 2)
    # A point is excluded if one of its runs has no result.
    groups = groups[np.isfinite(groups).all(axis=1)]
    names = [*(p.name for p in study.parameters), IMPERFECTIONS][: study.design.factors]
    if len(groups) < 4:
        return {}
    problem = {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}
    found = sobol.analyze(problem, groups.ravel(), calc_second_order=False, num_resamples=200, seed=study.seed)
    return {name: (float(s), float(e)) for name, s, e in zip(names, found["S1"], found["S1_conf"], strict=True)}


def _of_sample(
    parameters: tuple[Parameter, ...], u: np.ndarray, y: np.ndarray, seed: int
) -> dict[str, tuple[float, float]]:
    from SALib.analyze import rbd_fast

    if not parameters:
        return {}
    names = [p.name for p in parameters]
    problem = {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}
    # The number of harmonics must be small compared with the number of runs.
    found = rbd_fast.analyze(problem, u, y, M=max(4, min(10, len(y) // 25)), num_resamples=200, seed=seed)
    return {name: (float(s), float(e)) for name, s, e in zip(names, found["S1"], found["S1_conf"], strict=True)}


def _of_groups(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    levels, group = np.unique(x, return_inverse=True)
    count, total = np.bincount(group).astype(float), np.bincount(group, weights=y)

    def index(count: np.ndarray, total: np.ndarray, n: np.ndarray, s: np.ndarray, squares: np.ndarray) -> np.ndarray:
        mean = s / n
        between = (total**2 / np.maximum(count, 1.0)).sum(axis=-1) / n - mean**2
        # Without one run the others may be the same: what rounding leaves of their variance is none.
        return np.asarray(between / np.maximum(squares / n - mean**2, 1e-14 * squares / n + 1e-300))

    n, s, squares = float(len(y)), y.sum(), (y**2).sum()
    whole = float(index(count, total, np.array(n), s, squares))
    own = np.eye(len(levels))[group]
    without = index(count - own, total - own * y[:, None], np.array(n - 1.0), s - y, squares - y**2)
    return whole, float(1.96 * np.sqrt((n - 1.0) / n * ((without - without.mean()) ** 2).sum()))


def _error(values: np.ndarray) -> float:
    return float(1.96 * values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else float("nan")
