"""Pipes that nobody reads any more."""

from __future__ import annotations

import errno

from blockvis.atomic_files import WINDOWS


def is_broken_pipe(error: OSError) -> bool:
    """Whether an error says that nobody reads what is written; Windows calls it an invalid argument of no file."""
    if isinstance(error, BrokenPipeError):
        return True
    return WINDOWS and error.errno == errno.EINVAL and error.filename is None
