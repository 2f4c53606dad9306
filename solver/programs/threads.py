"""One thread for the linear algebra of many small pieces."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import Lock
from typing import Any

import scipy.linalg  # noqa: F401  # what is not loaded when libraries are looked for is not found
from threadpoolctl import ThreadpoolController

#: The one limit of all threads, once for each that is within it, and what only one of them changes it with at a time.
_limits: list[Any] = []
_lock = Lock()


@cache
def linear_algebra() -> ThreadpoolController:
    """Find the libraries of linear algebra that numpy and scipy use."""
    return ThreadpoolController().select(user_api="blas")


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep the linear algebra to one thread; the last of several analyses at once gives it back what it had.

    A band is factorised in hundreds of products of small matrices, each of which takes as long as threads take to wake:
    four hundred times as long where other processes work on the same cores. And last bits depend on their number.
    """
    with _lock:
        _limits.append(_limits[0] if _limits else linear_algebra().limit(limits=1))
    try:
        yield
    finally:
        with _lock:
            limit = _limits.pop()
            if not _limits:
                limit.restore_original_limits()
