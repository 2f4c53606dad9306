"""An order of rows in which the factors of a sparse symmetric matrix fill in little."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl


def least_fill(rows: np.ndarray, columns: np.ndarray, n: int) -> np.ndarray:
    """(n,) array: an order by minimum degree.

    Parameters
    ----------
    rows, columns : int arrays
        Where the matrix is filled, in any order, once or several times, in one triangle at least.
    n : int
    """
    near = sp.coo_array((np.ones(len(rows)), (rows, columns)), shape=(n, n))
    graph = sp.csc_array(near + near.T)
    graph.data[:] = -1.0
    # Any matrix of this pattern that needs no pivots tells the order.
    matrix = sp.csc_array(graph + sp.diags_array(1.0 - graph.sum(axis=0)))
    found = spl.splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return np.argsort(found.perm_c)
