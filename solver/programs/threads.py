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

    A band is factorised in hundreds of products of small matrices. Shared among threads, each takes as long as it takes
    to wake them: four hundred times as long where other processes work on the same cores. And the last bits of a
    result depend on how many threads there were.
    """
    return linear_algebra().limit(limits=1)
