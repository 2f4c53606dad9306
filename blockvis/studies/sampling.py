"""Sampling: the runs of a study; all random numbers follow from its seed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from blockvis.case_files.case_keys import MOST_STEPS

#: Methods of sampling; "saltelli" is for Sobol' indices of first order.
METHODS = ("grid", "latin hypercube", "sobol", "random", "saltelli")


@dataclass(frozen=True)
class Design:
    """The runs of a study."""

    #: (n_runs, n_parameters) array: between 0 and 1, exclusive; values are the quantiles of distributions there.
    probabilities: np.ndarray
    seeds: np.ndarray  #: (n_runs,) int array: of the imperfections.
    #: Number of factors that a "saltelli" design exchanges one by one: the parameters and, if there are any, all
    #: imperfections together; 0 for other designs.
    factors: int = 0

    @property
    def independent(self) -> np.ndarray:
        """(n_runs,) bool array: runs that form a random sample; the others of a "saltelli" design combine these."""
        if self.factors == 0:
            return np.ones(len(self.seeds), dtype=bool)
        place = np.arange(len(self.seeds)) % (self.factors + 2)
        return (place == 0) | (place == self.factors + 1)


def designed(method: str, runs: int, levels: Sequence[int], repeats: int, seed: int, *, scattered: bool) -> Design:
    """Choose the runs of a study by one of :data:`METHODS`, with so many levels of each parameter in a grid.

    A grid has ``repeats`` runs per point. For "saltelli" ``runs`` is the size N of its two independent samples: the
    study has N (factors + 2) runs, and where it is ``scattered``, by imperfections, their seed is a column: A. Saltelli
    et al., Variance based sensitivity analysis of model output, Computer Physics Communications 181 (2010) 259-270,
    https://doi.org/10.1016/j.cpc.2009.09.018: for each point of two independent samples A and B the rows A, A with one
    column from B for each factor, B. Raises ``ValueError`` for a Sobol' sequence of runs that are no power of 2, and
    for more than :data:`MOST_STEPS`.

    Examples
    --------
    >>> designed("grid", 1, [2, 3], 1, 0, scattered=False).probabilities.shape
    (6, 2)
    """
    n, grid = len(levels), method == "grid"
    total = repeats * math.prod(levels) if grid else runs * (n + scattered + 2 if method == "saltelli" else 1)
    if total > MOST_STEPS:
        raise ValueError(f"makes {total:,} runs; at most {MOST_STEPS:,} make one study")
    if grid:
        axes = [(np.arange(k) + 0.5) / k for k in levels]
        points = np.stack([x.ravel() for x in np.meshgrid(*axes, indexing="ij")], axis=1) if n else np.zeros((1, 0))
        points = np.repeat(points, repeats, axis=0)
        return Design(points, _seeds(seed, len(points)))
    if method in ("sobol", "saltelli") and runs & (runs - 1):
        near = 1 << (runs.bit_length() - 1)
        raise ValueError(f"runs is {runs}; a Sobol' sequence is balanced for powers of 2: give {near} or {2 * near}")
    random = np.random.default_rng([seed, 0])
    if method == "saltelli":
        return _saltelli(runs, n, random, seed, scattered)
    if n == 0 or method == "random":
        return Design(_inside(random.random((runs, n))), _seeds(seed, runs))
    # Loaded where it is used: it takes longer than all else that a study needs.
    from scipy.stats import qmc

    sampler = qmc.LatinHypercube(n, rng=random) if method == "latin hypercube" else qmc.Sobol(n, rng=random)
    return Design(_inside(sampler.random(runs)), _seeds(seed, runs))


def _saltelli(runs: int, n: int, random: np.random.Generator, seed: int, scattered: bool) -> Design:
    from scipy.stats import qmc

    both = _inside(qmc.Sobol(2 * n, rng=random).random(runs)) if n else np.zeros((runs, 0))
    first, second = both[:, :n], both[:, n:]
    first_seed, second_seed = _seeds(seed, runs), _seeds(seed, runs, stream=1)
    factors = n + int(scattered)
    points, seeds = np.repeat(first, factors + 2, axis=0), np.repeat(first_seed, factors + 2)
    for j in range(n):
        points[j + 1 :: factors + 2, j] = second[:, j]
    if scattered:
        seeds[n + 1 :: factors + 2] = second_seed
    points[factors + 1 :: factors + 2] = second
    seeds[factors + 1 :: factors + 2] = second_seed
    return Design(points, seeds, factors)


def _inside(probabilities: np.ndarray) -> np.ndarray:
    """Exclude 0 and 1, for which many distributions have no value."""
    return np.clip(probabilities, 1e-12, 1.0 - 1e-12)


def _seeds(seed: int, runs: int, stream: int = 0) -> np.ndarray:
    return np.random.default_rng([seed, 1, stream]).integers(0, 2**32, size=runs)
