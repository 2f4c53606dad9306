"""Probability distributions of uncertain numbers: read, checked, and evaluated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import special

from .key import NUMBER, POSITIVE, Forms, Key, one_of
from .toml_table import Table

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

#: Which numbers a table with a distribution has.
FORMS = Forms("distribution", KINDS, dict.fromkeys(CUT_OFF, ("lower", "upper")))

_NEEDED, _UNLIMITED = "required where the distribution has it", "; normal and lognormal have none"

#: Keys of a table with a distribution.
DISTRIBUTION_KEYS = (
    Key("distribution", one_of(tuple(KINDS)),
        "Probability distribution; normal and lognormal may be cut off by lower and upper", "normal", required=True),
    Key("mean", NUMBER, "Mean of normal and lognormal, before they are cut off", 0.6, otherwise=_NEEDED),
    Key("deviation", POSITIVE, "Standard deviation of normal and lognormal, before they are cut off", 0.1,
        otherwise=_NEEDED),
    Key("lower", NUMBER, "Lower limit", 0.2, otherwise=_NEEDED + _UNLIMITED),
    Key("upper", NUMBER, "Upper limit", 1.0, otherwise=_NEEDED + _UNLIMITED),
    Key("mode", NUMBER, "Most probable value of triangular", 0.6, otherwise=_NEEDED),
    Key("alpha", POSITIVE, "First shape parameter of beta", 2.0, otherwise=_NEEDED),
    Key("beta", POSITIVE, "Second shape parameter of beta", 3.0, otherwise=_NEEDED),
)  # fmt: skip

#: Least probability that a truncated distribution must have between its limits; less is taken for a mistake.
LEAST_INSIDE = 1e-6


@dataclass(frozen=True)
class Distribution:
    """A distribution of one of :data:`KINDS` with its numbers; made by :func:`distribution_of`, which checks them.

    Mean and deviation are those of the variable itself before truncation, also for "lognormal".
    """

    kind: str
    numbers: Mapping[str, float]

    def quantile(self, probability: np.ndarray) -> np.ndarray:
        """(n,) array: the values that the variable does not exceed with the given (n,) probabilities."""
        p, n = np.asarray(probability, dtype=float), self.numbers
        if self.kind in CUT_OFF:
            below, inside = self._inside()
            normal = special.ndtri(below + p * inside)
            if self.kind == "normal":
                value = n["mean"] + n["deviation"] * normal
            else:
                centre, spread = self._logarithm()
                value = np.exp(centre + spread * normal)
            # Rounding may carry a value beyond a limit that has a physical meaning.
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


def distribution_of(values: Mapping[str, Any], table: Table) -> Distribution:
    """Make the distribution of a table, read with :data:`DISTRIBUTION_KEYS`, and check that its numbers go together.

    ValueError for a number that must be above 0, limits in the wrong order, and limits between which the variable
    almost never is.
    """
    kind = values["distribution"]
    numbers = {key: float(values[key]) for key in FORMS.keys(kind) if values[key] is not None}
    for key in {"lognormal": ("mean",), "loguniform": ("lower",)}.get(kind, ()):
        if numbers[key] <= 0.0:
            raise table.error(key, f"is {numbers[key]:g}; give a number above 0: it is one of a {kind} variable")
    low, high = numbers.get("lower", -math.inf), numbers.get("upper", math.inf)
    if low >= high:
        raise table.error("lower", f"is {low:g} and upper is {high:g}; lower must be the smaller")
    if kind == "triangular" and not low <= numbers["mode"] <= high:
        raise table.error("mode", f"is {numbers['mode']:g}; it must lie between {low:g} and {high:g}")
    found = Distribution(kind, numbers)
    if kind in CUT_OFF and found._inside()[1] < LEAST_INSIDE:
        raise table.error(
            "distribution",
            f"is {kind} with mean {numbers['mean']:g} and deviation {numbers['deviation']:g}: nothing lies between "
            f"{low:g} and {high:g}; move the limits",
        )
    return found
