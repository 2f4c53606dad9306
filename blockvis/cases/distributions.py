"""Probability distributions of uncertain numbers: read, checked, and evaluated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import special

from blockvis.text import nearest, refuse_unknown

from .toml_table import is_number

#: The numbers that each distribution needs, by its name; "normal" and "lognormal" may be truncated by lower and upper.
KINDS: dict[str, tuple[str, ...]] = {
    "uniform": ("lower", "upper"),
    "loguniform": ("lower", "upper"),
    "triangular": ("lower", "mode", "upper"),
    "normal": ("mean", "deviation"),
    "lognormal": ("mean", "deviation"),
    "beta": ("alpha", "beta", "lower", "upper"),
}

#: Distributions that may be cut off by lower and upper.
CUT_OFF = ("normal", "lognormal")

#: Least probability that a truncated distribution must have between its limits; less is taken for a mistake.
LEAST_INSIDE = 1e-6


@dataclass(frozen=True)
class Distribution:
    """A distribution with its numbers; made by :func:`read_distribution`, which checks them.

    Attributes
    ----------
    kind : str
        A key of :data:`KINDS`.
    numbers : mapping of str to float
        Mean and deviation are those of the variable itself before truncation, also for "lognormal".
    """

    kind: str
    numbers: Mapping[str, float]

    def quantile(self, probability: np.ndarray) -> np.ndarray:
        """(n,) array: the values that the variable does not exceed with the given (n,) probabilities.

        Examples
        --------
        >>> Distribution("uniform", {"lower": 2.0, "upper": 4.0}).quantile([0.25, 0.5])
        array([2.5, 3. ])
        """
        p, n = np.asarray(probability, dtype=float), self.numbers
        if self.kind in CUT_OFF:
            below, inside = self._inside()
            # Rounding may carry a value beyond a limit that has a physical meaning.
            value = self._untruncated(special.ndtri(below + p * inside))
            value = np.clip(value, n.get("lower", -np.inf), n.get("upper", np.inf))
        elif self.kind == "uniform":
            value = n["lower"] + p * (n["upper"] - n["lower"])
        elif self.kind == "loguniform":
            value = n["lower"] * (n["upper"] / n["lower"]) ** p
        elif self.kind == "triangular":
            low, mode, high = n["lower"], n["mode"], n["upper"]
            rising = low + np.sqrt(p * (high - low) * (mode - low))
            falling = high - np.sqrt((1.0 - p) * (high - low) * (high - mode))
            value = np.where(p * (high - low) <= mode - low, rising, falling)
        else:
            value = n["lower"] + (n["upper"] - n["lower"]) * special.betaincinv(n["alpha"], n["beta"], p)
        return np.asarray(value)

    @property
    def lowest(self) -> float:
        """Lower bound of the variable."""
        return self.numbers.get("lower", 0.0 if self.kind == "lognormal" else -math.inf)

    def _untruncated(self, normal: np.ndarray) -> np.ndarray:
        """Turn standard normal values into values of the variable."""
        if self.kind == "normal":
            return self.numbers["mean"] + self.numbers["deviation"] * normal
        centre, spread = self._logarithm()
        return np.exp(centre + spread * normal)

    def _logarithm(self) -> tuple[float, float]:
        """Mean and deviation of the logarithm of a lognormal variable."""
        variance = math.log1p((self.numbers["deviation"] / self.numbers["mean"]) ** 2)
        return math.log(self.numbers["mean"]) - variance / 2.0, math.sqrt(variance)

    def _inside(self) -> tuple[float, float]:
        """Probability below the lower limit, and between the limits, before truncation."""

        def below(value: float) -> float:
            if self.kind == "normal":
                return float(special.ndtr((value - self.numbers["mean"]) / self.numbers["deviation"]))
            centre, spread = self._logarithm()
            return 0.0 if value <= 0.0 else float(special.ndtr((math.log(value) - centre) / spread))

        low = below(self.numbers["lower"]) if "lower" in self.numbers else 0.0
        high = below(self.numbers["upper"]) if "upper" in self.numbers else 1.0
        return low, high - low


def read_distribution(
    values: Mapping[str, Any], where: str, defaults: Mapping[str, float] | None = None
) -> Distribution:
    """Read and check the distribution of a table.

    Parameters
    ----------
    values : mapping
        ``distribution``, its name, and its numbers.
    where : str
        Beginning of the messages.
    defaults : mapping of str to float, optional
        Numbers that may be missing.

    Returns
    -------
    Distribution

    Raises
    ------
    ValueError
        For an unknown name (with the most similar one), a missing or invalid number, limits in the wrong order, and
        limits between which the variable almost never is.

    Examples
    --------
    >>> read_distribution({"distribution": "normal", "mean": 0.6, "deviation": -0.1}, "friction")
    Traceback (most recent call last):
        ...
    ValueError: friction: deviation is -0.1; give a number above 0
    """
    values = dict(values)
    kind = values.pop("distribution", None)
    if not isinstance(kind, str) or kind not in KINDS:
        hint = nearest(kind, list(KINDS)) if isinstance(kind, str) else ""
        problem = f"distribution is {kind!r}{hint}" if kind is not None else "names no distribution"
        raise ValueError(f"{where}: {problem}; choose from {', '.join(KINDS)}")
    needed = KINDS[kind]
    refuse_unknown(
        values, [*needed, *(("lower", "upper") if kind in CUT_OFF else ())], f"{where}: distribution '{kind}'"
    )
    numbers = {key: float(value) for key, value in (defaults or {}).items() if key in needed}
    for key, value in values.items():
        if not is_number(value):
            raise ValueError(f"{where}: {key} is {value!r}; give a number")
        numbers[key] = float(value)
    for key in needed:
        if key not in numbers:
            raise ValueError(f"{where}: distribution '{kind}' needs {' and '.join(needed)}; {key} is missing")
    positive = {"lognormal": ("mean", "deviation"), "normal": ("deviation",), "loguniform": ("lower",)}
    for key in (*positive.get(kind, ()), *(("alpha", "beta") if kind == "beta" else ())):
        if numbers[key] <= 0.0:
            raise ValueError(f"{where}: {key} is {numbers[key]:g}; give a number above 0")
    low, high = numbers.get("lower", -math.inf), numbers.get("upper", math.inf)
    if low >= high:
        raise ValueError(f"{where}: lower is {low:g} and upper is {high:g}; lower must be the smaller")
    if kind == "triangular" and not low <= numbers["mode"] <= high:
        raise ValueError(f"{where}: mode is {numbers['mode']:g}; it must lie between {low:g} and {high:g}")
    found = Distribution(kind, numbers)
    if kind in CUT_OFF and found._inside()[1] < LEAST_INSIDE:
        raise ValueError(
            f"{where}: of a {kind} variable with mean {numbers['mean']:g} and deviation {numbers['deviation']:g} "
            f"nothing lies between {low:g} and {high:g}; move the limits"
        )
    return found
