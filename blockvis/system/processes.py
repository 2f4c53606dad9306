"""Processes of our own beside the one that solves."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator

from .atomic_files import WINDOWS


def interpreter(module: str) -> subprocess.Popen[bytes]:
    """Start a fresh interpreter that calls ``main()`` of a module, with pipes for what is said to it and what it says.

    Not a fork: that would share the solver's threads, and ``multiprocessing`` would run the caller's script again.
    """
    start = f"import sys; sys.path[:] = {sys.path!r}; from {module} import main; main()"
    with _deaf():
        return subprocess.Popen([sys.executable, "-c", start], stdin=subprocess.PIPE, stdout=subprocess.PIPE)


@contextlib.contextmanager
def _deaf() -> Iterator[None]:
    """Start processes that do not hear Ctrl-C, which reaches all of a terminal: the first decides, and ends them."""
    if threading.current_thread() is not threading.main_thread():
        # Signals are set by the main thread alone.
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        # None where a program around Python has set what happens.
        signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)


def is_broken_pipe(error: OSError) -> bool:
    """Whether an error says that nobody reads what is written; Windows calls it an invalid argument of no file."""
    if isinstance(error, BrokenPipeError):
        return True
    return WINDOWS and error.errno == errno.EINVAL and error.filename is None


@contextlib.contextmanager
def unread() -> Iterator[None]:
    """Go on where the other process reads no more."""
    try:
        yield
    except OSError as error:
        if not is_broken_pipe(error):
            raise


def cores() -> int:
    """Count the cores that processes of this machine may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
