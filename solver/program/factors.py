"""Factorisation of the matrix of a step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from .step import NotSolved


def factorised(matrix: np.ndarray | sp.csc_array) -> Callable[[np.ndarray], np.ndarray]:
    """What solves with a matrix; a sparse one's pattern is symmetric, its values are not."""
    if isinstance(matrix, np.ndarray):
        factors, pivots, _ = sla.lapack.dgetrf(matrix, overwrite_a=True)
        return lambda right: np.asarray(sla.lapack.dgetrs(factors, pivots, right)[0])
    try:
        # Minimum degree of the pattern, pivots near the diagonal.
        solve: Callable[[np.ndarray], np.ndarray] = spl.splu(
            matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options={"SymmetricMode": True}
        ).solve
    except RuntimeError as error:
        raise NotSolved(str(error)) from None
    return solve
