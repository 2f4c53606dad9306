"""One thread for the linear algebra of many small pieces."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache

from scipy.linalg import lapack

Function = Callable[..., int]


class NotLimited(RuntimeError):
    """The library below scipy or numpy has no function that limits its threads."""


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep OpenBLAS to one thread, and give it back what it had.

    A band is factorised in hundreds of products of small matrices. Shared among threads, each takes as long as it takes
    to wake them: four hundred times as long where other processes work on the same cores. And the last bits of a
    result depend on how many threads there were.

    Raises ``NotLimited`` if scipy or numpy use another library, or one that hides these functions. The environment
    variable OPENBLAS_NUM_THREADS=1, set before Python starts, makes up for it.
    """
    if os.environ.get("OPENBLAS_NUM_THREADS") == "1":
        yield
        return
    libraries = _libraries()
    previous = [get_threads() for get_threads, _ in libraries]
    for _, set_threads in libraries:
        set_threads(1)
    try:
        yield
    finally:
        for (_, set_threads), threads in zip(libraries, previous, strict=True):
            set_threads(threads)


@cache
def _libraries() -> list[tuple[Function, Function]]:
    """Functions that get and set the number of threads of scipy's library and of numpy's."""
    extensions = lapack._flapack.__name__, "numpy._core._multiarray_umath"
    return [_functions(sys.modules[name].__file__) for name in extensions]


def _functions(extension: str | None) -> tuple[Function, Function]:
    # Those of a library are found through the extension module that is linked to it.
    library = ctypes.CDLL(extension)
    # In the builds of OpenBLAS that the wheels of scipy and numpy come with, and in others.
    for name in ("scipy_openblas_{}_num_threads", "scipy_openblas_{}_num_threads64_", "openblas_{}_num_threads"):
        try:
            return library[name.format("get")], library[name.format("set")]
        except AttributeError:
            continue
    raise NotLimited(f"the threads of the linear algebra in {extension} cannot be limited")
