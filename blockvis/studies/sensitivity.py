"""Sensitivity of where structures collapse to the parameters of a study."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .study_file import Parameter, Study
from .study_folder import NOT_BUILT

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
    #: [m or rad] Half the 95 % interval of these means; 0 of one run, and of a grid, which has all its values.
    low_error: float
    high_error: float
    #: Whether some runs of the one and of the other did not collapse: their means may be larger.
    at_least: tuple[bool, bool] = (False, False)


def capacity(table: pd.DataFrame) -> pd.Series:
    """(n_rows,) [m, rad or a number]: where a run collapsed, not a number where that is not known.

    It is the load multiplier of limit loads, which alone have no unit, infinite where none brings a run down; else the
    displacement.
    """
    return table["collapse_displacement"].where(table["unit"] != "", table["load_multiplier"])


def outcome(table: pd.DataFrame) -> np.ndarray:
    """(n_rows,) array [m, rad or a number]: where a run collapsed, or how far one that did not was followed.

    The latter is a lower bound: 0 where nothing is known, as of load multipliers, the largest of all where none brings
    it down. It is nan of what was not built.
    """
    found = capacity(table).to_numpy(dtype=float)
    most = float(found[np.isfinite(found)].max(initial=0.0))
    followed = table["last_settlement"].where(table["unit"] != "", 0.0).fillna(0.0)
    least = followed.where(table["status"] != NOT_BUILT).to_numpy(dtype=float)
    return np.where(np.isnan(found), least, np.minimum(found, most))


def unit_of(study: Study, table: pd.DataFrame) -> str:
    """Give the unit of where runs collapse: empty for load multipliers, rad where supports turn, else m."""
    return next((unit for unit in table["unit"].unique().tolist() if unit), study.capacity.unit)


def without_collapse(table: pd.DataFrame) -> np.ndarray:
    """(n_rows,) bool array: runs that did not collapse as far as they were followed."""
    return np.asarray(~np.isfinite(capacity(table)) & (table["status"] != NOT_BUILT), dtype=bool)


def independent_rows(study: Study, table: pd.DataFrame) -> pd.DataFrame:
    """Take the rows that form a random sample, without those in which a "saltelli" design combines two."""
    return table[study.design.independent[table["run"].to_numpy(dtype=int)]]


def swings(study: Study, table: pd.DataFrame) -> list[Swing]:
    """Compute the swing of every parameter, by the independent rows of the table of a study, the largest first.

    There is none where no run collapsed: outcomes are no more than how far runs were followed.
    """
    table = independent_rows(study, table[table["status"] != NOT_BUILT])
    y, stood, found = outcome(table), without_collapse(table), []
    if stood.all():
        return []
    for parameter in study.parameters:
        x = table[parameter.name].to_numpy(dtype=float if parameter.numeric else object)
        # A grid has each value with all of the others.
        grouped = parameter.distribution is None or study.method == "grid"
        if grouped:
            groups = [np.flatnonzero(x == value) for value in dict.fromkeys(x.tolist())]
            # Texts have no order but that of their outcomes.
            groups.sort(key=lambda rows: float((x if parameter.numeric else y)[rows].mean()))
        else:
            order, n = np.argsort(x, kind="stable"), max(1, round(FIFTH * len(x)))
            groups = [order[:n], order[-n:]] if len(x) > 1 else []
        if len(groups) < 2:
            continue
        lowest, highest = groups[0], groups[-1]
        values = [x[k[0]] if grouped else x[k].mean() for k in (lowest, highest)]
        low_value, high_value = (float(value) if parameter.numeric else str(value) for value in values)
        low, high = y[lowest], y[highest]
        means = float(low.mean()), float(high.mean())
        errors = (0.0, 0.0) if study.method == "grid" else (_error(low), _error(high))
        at_least = bool(stood[lowest].any()), bool(stood[highest].any())
        found.append(Swing(parameter.name, low_value, high_value, *means, *errors, at_least))
    return sorted(found, key=lambda swing: -abs(swing.high - swing.low))


def first_order(study: Study, table: pd.DataFrame) -> dict[str, tuple[float, float]]:
    """Estimate Sobol' indices of first order: the share of each parameter alone in the variance of the outcome.

    Gives the index and half its 95 % interval, 0 of a grid without repeats, by name of the parameter, for a "saltelli"
    study also of all imperfections together; nothing if there are too few runs, some did not collapse, whose variance
    would be that of how far they were followed, or the outcome is the same in nearly all.

    For a "saltelli" study: Saltelli et al., Computer Physics Communications 181 (2010) 259-270; for other samples
    RBD-FAST with the correction of its bias: J.-Y. Tissot and C. Prieur, Reliability Engineering and System Safety 107
    (2012) 205-213, https://doi.org/10.1016/j.ress.2012.06.010; both by SALib. For a grid that has a run for all of its
    values with each other: the variance of the means over the variance, its error by the jackknife of the repeats.
    """
    y = np.full(study.n_runs, np.nan)
    y[table["run"].to_numpy(dtype=int)] = outcome(table)
    known = np.isfinite(y)
    u, grid = study.design.probabilities[known], study.method == "grid"
    fewest = study.repeats * math.prod(len(np.unique(values)) for values in u.T) if grid else FEWEST_RUNS
    if without_collapse(table).any() or not known.any() or known.sum() < fewest:
        return {}
    if np.std(y[known]) <= 1e-9 * max(abs(float(np.mean(y[known]))), 1e-300):
        return {}
    if study.design.factors:
        found = _exchanged(study, y)
    elif grid:
        parameters = enumerate(study.parameters)
        found = {p.name: _of_groups(u[:, k], y[known], study.repeats) for k, p in parameters if p.n_levels > 1}
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
    return _indices(names, sobol.analyze, groups.ravel(), calc_second_order=False, seed=study.seed)


def _of_sample(
    parameters: tuple[Parameter, ...], u: np.ndarray, y: np.ndarray, seed: int
) -> dict[str, tuple[float, float]]:
    from SALib.analyze import rbd_fast

    if not parameters:
        return {}
    # The number of harmonics must be small compared with the number of runs.
    harmonics = max(4, min(10, len(y) // 25))
    return _indices([p.name for p in parameters], rbd_fast.analyze, u, y, M=harmonics, seed=seed)


def _indices(names: list[str], analyse: Callable[..., Any], *data: Any, **given: Any) -> dict[str, tuple[float, float]]:
    """Have SALib estimate an index and half its interval for each of some factors between 0 and 1."""
    problem = {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}
    found = analyse(problem, *data, num_resamples=200, **given)
    return {name: (float(s), float(e)) for name, s, e in zip(names, found["S1"], found["S1_conf"], strict=True)}


def _of_groups(x: np.ndarray, y: np.ndarray, repeats: int) -> tuple[float, float]:
    _, group = np.unique(x, return_inverse=True)
    repeat = np.arange(len(y)) % repeats

    def share(kept: np.ndarray) -> float:
        means = np.bincount(group[kept], weights=y[kept]) / np.bincount(group[kept])
        # What rounding leaves of a variance is none.
        return float(means.var() / max(y[kept].var(), 1e-14 * (y[kept] ** 2).mean() + 1e-300))

    without = np.array([share(repeat != k) for k in range(repeats)]) if repeats > 1 else np.zeros(1)
    return share(repeat >= 0), float(1.96 * np.sqrt((repeats - 1.0) * without.var()))


def _error(values: np.ndarray) -> float:
    return float(1.96 * values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else 0.0
