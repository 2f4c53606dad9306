"""Numbers of a page as text: integers that pack well, and the fineness they have."""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

#: Lengths are stored in this fraction of the extent of the structure, rotations and directions in this unit; forces
#: that are told are 0 below this fraction of the largest: equilibria are that exact.
FINENESS = 1e-6

#: Forces that are drawn are stored in this fraction of the largest.
FORCE_FINENESS = 1e-3

#: Forces that are told are stored to this fraction of themselves.
TOLD_FINENESS = 2e-4


def deflated(values: ArrayLike) -> dict[str, Any]:
    """Pack integers: differences along the first axis, split in planes of bytes, deflated, in base 64."""
    whole = np.asarray(values).astype("<i4")
    table = whole.reshape(len(whole), -1 if len(whole) else 1)
    steps = np.diff(table, axis=0, prepend=np.zeros((1, table.shape[1]), dtype="<i4"))
    planes = steps.reshape(-1, 1).view(np.uint8).T
    data = base64.b64encode(zlib.compress(planes.tobytes(), 9)).decode("ascii")
    return {"rows": len(table), "columns": table.shape[1], "data": data}


def rounded(values: np.ndarray, unit: float) -> np.ndarray:
    """Count the units in values, as 32-bit integers."""
    return np.rint(np.asarray(values, dtype=float) / unit).astype(np.int64).astype(np.int32)


def counted_steps(values: np.ndarray, smallest: float) -> np.ndarray:
    """Count, from ``smallest``, the steps by TOLD_FINENESS of itself up to each value, with its sign; 0 below that."""
    sizes = np.maximum(np.abs(values) / smallest, 1.0)
    return (np.sign(values) * rounded(np.log(sizes), TOLD_FINENESS)).astype(np.int32)
