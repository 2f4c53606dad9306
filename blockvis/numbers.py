"""Lengths and forces as text: rounded, in a suitable unit."""

from __future__ import annotations

import numpy as np


def length_text(length: float) -> str:
    """Write a round length [m] with its unit.

    Examples
    --------
    >>> length_text(0.2), length_text(5.0), length_text(0.002)
    ('0.2 m', '5 m', '0.002 m')
    """
    return f"{length:g} m"


def force_text(force: float, moment: bool = False) -> str:
    """Write a force [N], or a moment [N·m], with four digits and the unit that suits it.

    Examples
    --------
    >>> force_text(2211.97), force_text(152.3), force_text(3.21e6, moment=True)
    ('2.212 kN', '152.3 N', '3.21 MN·m')
    """
    size = abs(force)
    factor, unit = next((f, u) for f, u in ((1e6, "MN"), (1e3, "kN"), (1.0, "N")) if size >= f or f == 1.0)
    return f"{force / factor:.4g} {unit}" + ("·m" if moment else "")


def rounded_length(largest: float) -> float:
    """Round down to 1, 2 or 5 times a power of ten; 1 unless the length is positive and finite.

    Examples
    --------
    >>> rounded_length(0.34)
    0.2
    """
    if not (np.isfinite(largest) and largest > 0.0):
        return 1.0
    power = 10.0 ** np.floor(np.log10(largest))
    return float(f"{max(m for m in (1.0, 2.0, 5.0) if m * power <= largest * (1 + 1e-9)) * power:.6g}")
