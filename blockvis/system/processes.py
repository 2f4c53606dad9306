"""What other processes have to do with this one: cores that they share, pipes that they read."""

from __future__ import annotations

import errno
import os

from .atomic_files import WINDOWS


def is_broken_pipe(error: OSError) -> bool:
    """Whether an error says that nobody reads what is written; Windows calls it an invalid argument of no file."""
    if isinstance(error, BrokenPipeError):
        return True
    return WINDOWS and error.errno == errno.EINVAL and error.filename is None


def cores() -> int:
    """Count the cores that processes of this machine may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
