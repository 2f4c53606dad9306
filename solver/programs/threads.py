"""One thread for the linear algebra of many small pieces."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache

import scipy.linalg  # noqa: F401  # what is not loaded when libraries are looked for is not found
from threadpoolctl import ThreadpoolController


@cache
def linear_algebra() -> ThreadpoolController:
    """Find the libraries of linear algebra that numpy and scipy use."""
    return ThreadpoolController().select(user_api="blas")


def one_thread() -> AbstractContextManager[object]:
    """Keep the linear algebra to one thread, and give it back what it had.

    A band is factorised in hundreds of products of small matrices, each of which takes as long as threads take to wake:
    four hundred times as long where other processes work on the same cores. And last bits depend on their number.
    """
    return linear_algebra().limit(limits=1)
