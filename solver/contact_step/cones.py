"""The algebra of round cones |a| ≤ a₀, for interior methods: (d, n) arrays, one column for each contact point.

In the plane a cone of two numbers is its two rays. Scaling of Nesterov & Todd
(1997), https://doi.org/10.1287/moor.22.1.1, for what Andersen, Roos & Terlaky (2003),
https://doi.org/10.1007/s10107-002-0349-3, call the quadratic cone.
"""

from __future__ import annotations

import numpy as np


def inner(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n,) array: inner products of columns; row by row, as numpy's sum along the first axis is four times as slow."""
    out = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        out += x * y
    return np.asarray(out)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(d, n) array: the product of the algebra, (a·b, a₀ b + b₀ a)."""
    return np.concatenate([inner(a, b)[None], a[0] * b[1:] + b[0] * a[1:]])


def quotient(c: np.ndarray, a: np.ndarray) -> np.ndarray:
    """(d, n) array: what a has to be multiplied by to give c."""
    first = (a[0] * c[0] - inner(a[1:], c[1:])) / determinant(a)
    return np.concatenate([first[None], (c[1:] - first * a[1:]) / a[0]])


def determinant(a: np.ndarray) -> np.ndarray:
    """(n,) array: a₀² - |a|², written so that little cancels, and not zero, so that the scaling stays finite."""
    size = np.sqrt(inner(a[1:], a[1:]))
    return np.maximum((a[0] - size) * (a[0] + size), 1e-26 * a[0] ** 2)


def longest_step(a: np.ndarray, change: np.ndarray) -> float:
    """Largest part of a change that stays inside the cones, infinite where none leaves them."""
    if len(a) == 2:
        sides, moving = (np.concatenate([of[0] + of[1], of[0] - of[1]]) for of in (a, change))
        steepest = float((-moving / sides).max(initial=0.0))
    else:
        # What maps a to (1, 0) maps the cone to itself.
        size = np.sqrt(determinant(a))
        point, change = a / size, change / size
        first = point[0] * change[0] - inner(point[1:], change[1:])
        rest = change[1:] - (first + change[0]) / (1.0 + point[0]) * point[1:]
        steepest = float((np.sqrt(inner(rest, rest)) - first).max(initial=0.0))
    return 1.0 / steepest if steepest > 0.0 else np.inf


class Scaling:
    """The scaling W in which forces u and distances z, (d, n) arrays, inside their cones are alike: W u = W⁻¹ z."""

    def __init__(self, u: np.ndarray, z: np.ndarray) -> None:
        size_u, size_z = np.sqrt(determinant(u)), np.sqrt(determinant(z))
        a, b = u / size_u, z / size_z
        half_slope = np.sqrt(0.5 * (1.0 + inner(a, b)))
        self.w = np.concatenate([(b[0] + a[0])[None], b[1:] - a[1:]]) / (2.0 * half_slope)
        self.square = size_z / size_u
        self.size = np.sqrt(self.square)
        self.scaled_point = self.scaled(u)

    def scaled(self, u: np.ndarray) -> np.ndarray:
        """(d, n) array: W u, of forces."""
        return self._transformed(u, 1.0) * self.size

    def unscaled(self, z: np.ndarray) -> np.ndarray:
        """(d, n) array: W⁻¹ z, of distances."""
        return self._transformed(z, -1.0) / self.size

    def _transformed(self, a: np.ndarray, sign: float) -> np.ndarray:
        along = inner(self.w[1:], a[1:])
        rest = a[1:] + (sign * a[0] + along / (1.0 + self.w[0])) * self.w[1:]
        return np.concatenate([(self.w[0] * a[0] + sign * along)[None], rest])
