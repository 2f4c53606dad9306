"""Forces in exact equilibrium within exact Coulomb friction that are nearest to given ones: one convex program.

Over the forces f = (N, T) of the closed contact points, with their compliance as metric::

    minimise  1/2 Σ c (f - f⁰)²   subject to   A f + load = 0,   |T| ≤ μ N,   and, where asked for,   r · f = R

From f⁰ = 0 these are the forces of least elastic energy, which are unique: those of a structure at rest. Primal-dual
interior method in the scaling of Nesterov & Todd, see :mod:`.cones`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .cones import Scaling, longest_step, product, quotient
from .problem import NotSolved
from .stiffness import ContactRows, Singular

#: Iterations at most; part of the way to the nearest bound that is gone.
ITERATIONS, FRACTION = 60, 0.995

#: Force out of balance, and mean product of forces and multipliers, in block weights, at which it has converged.
BALANCED, CONVERGED = 1e-11, 1e-12

#: Force out of balance that is accepted where it comes no nearer, in block weights, and part of the way that is none.
ACCEPTED, STUCK = 1e-9, 1e-6

#: Start: least normal force, part of the friction cone, least multiplier.
FIRST_FORCE, FIRST_SHEAR, FIRST_MULTIPLIER = 0.1, 0.9, 1e-2

#: Least friction coefficient: a cone without width has no inside.
LEAST_FRICTION = 1e-9

#: Corrections of second order are cut off at so many times the mean product.
CORRECTION = 10.0


@dataclass(frozen=True)
class _Change:
    """A change of the forces, of their multipliers z, and of the movement and multiplier of the equations."""

    forces: np.ndarray
    z: np.ndarray
    motion: np.ndarray
    rho: float


class _Iterate:
    """Forces f inside their friction cones, (μ N, T) = u, with multipliers z inside theirs."""

    def __init__(
        self,
        rows: ContactRows,
        near: np.ndarray,
        compliance: np.ndarray,
        friction: np.ndarray,
        load: np.ndarray,
        along: np.ndarray | None,
        reaction: float,
    ) -> None:
        self.rows, self.near, self.load, self.along, self.reaction = rows, near, load, along, reaction
        n, self.d = near.shape
        self.slope = np.ones((n, self.d))
        self.slope[:, 0] = np.maximum(friction, LEAST_FRICTION)
        self.weight = compliance / float(compliance[:, 0].mean())
        self.forces = near.copy()
        self.forces[:, 0] = np.maximum(near[:, 0], FIRST_FORCE)
        length = np.sqrt((near[:, 1:] ** 2).sum(axis=1))
        most = FIRST_SHEAR * self.slope[:, 0] * self.forces[:, 0]
        self.forces[:, 1:] *= np.minimum(1.0, most / np.maximum(length, 1e-300))[:, None]
        self.z = np.zeros((self.d, n))
        self.z[0] = np.maximum(FIRST_MULTIPLIER, FIRST_MULTIPLIER / (self.slope * self.forces)[:, 0])
        self.motion, self.rho = np.zeros_like(load), 0.0
        self.measure()

    def measure(self) -> None:
        """Work out what is out of balance, and the mean product."""
        self.u = (self.slope * self.forces).T
        self.out = self.load + self.rows.resultant(self.forces)
        self.missing = 0.0 if self.along is None else self.reaction - float((self.along * self.forces).sum())
        self.mean = float((self.u * self.z).sum()) / (2 * len(self.forces))
        self.worst = max(float(np.abs(self.out).max()), abs(self.missing))

    def factorise(self) -> None:
        """Factorise Newton's equations at this iterate.

        Raises
        ------
        Singular, LinAlgError
            Where rounding is all that is left.
        """
        self.scaling = Scaling(self.u, self.z)
        self.hessian = self.scaling.hessian()
        local = self.slope[:, :, None] * self.hessian * self.slope[:, None, :]
        self.answer = np.linalg.inv(self.weight[:, :, None] * np.eye(self.d) + local)
        self.solve = self.rows.factorised(self.answer, np.zeros_like(self.load))
        self.error = self.weight * (self.forces - self.near) + self.rows.relative(self.motion) - self.slope * self.z.T
        if self.along is not None:
            self.error = self.error + self.rho * self.along
            self.by_along = self._answered(self.along)
            self.lifted = self.rows.resultant(self.by_along)
            self.turned = self.solve(self.lifted)
            self.room = float((self.along * self.by_along).sum() - self.lifted @ self.turned)

    def _answered(self, distances: np.ndarray) -> np.ndarray:
        return np.einsum("nij,nj->ni", self.answer, distances)

    def direction(self, aim: np.ndarray) -> _Change:
        """Newton's direction with what the products in the scaling are to change by."""
        wanted = self.scaling.scaled(quotient(aim, self.scaling.middle))
        forces = self._answered(self.slope * wanted.T - self.error)
        motion, rho = self.solve(self.out + self.rows.resultant(forces)), 0.0
        if self.along is not None:
            rho = (float((self.along * forces).sum()) - self.missing - float(self.lifted @ motion)) / self.room
            motion = motion - rho * self.turned
            forces = forces - rho * self.by_along
        forces = forces - self._answered(self.rows.relative(motion))
        z = wanted - np.einsum("nij,jn->in", self.hessian, (self.slope * forces).T)
        return _Change(forces, z, motion, rho)

    def longest(self, change: _Change) -> float:
        """Largest part of a change, at most 1, that keeps everything inside."""
        return min(1.0, longest_step(self.u, (self.slope * change.forces).T), longest_step(self.z, change.z))

    def mean_after(self, change: _Change, part: float) -> float:
        """Mean product after a part of a change."""
        u = self.u + part * (self.slope * change.forces).T
        return float((u * (self.z + part * change.z)).sum()) / (2 * len(self.forces))

    def take(self, change: _Change, part: float) -> None:
        """Go a part of a change."""
        self.forces, self.z = self.forces + part * change.forces, self.z + part * change.z
        self.motion, self.rho = self.motion + part * change.motion, self.rho + part * change.rho
        self.measure()


@np.errstate(all="ignore")  # A step that leaves the numbers is seen by what it gives.
def nearest_equilibrium(
    rows: ContactRows,
    near: np.ndarray,
    compliance: np.ndarray,
    friction: np.ndarray,
    load: np.ndarray,
    along: np.ndarray | None = None,
    reaction: float = 0.0,
) -> np.ndarray:
    """Find the forces in equilibrium within friction that are nearest to given ones.

    Parameters
    ----------
    rows : ContactRows
        Of the closed contact points.
    near : (n, d) array
        f⁰, in block weights.
    compliance : (n, d) array
        The metric; only ratios matter.
    friction : (n,) array
    load : (n_dof,) array
        On the free blocks.
    along : (n, d) array, optional
        r: the reaction of unit forces.
    reaction : float
        R.

    Returns
    -------
    (n, d) array

    Raises
    ------
    NotSolved
        Where there are none, or none were found.
    """
    if len(near) == 0:
        if np.abs(load).max(initial=0.0) > ACCEPTED:
            raise NotSolved("nothing touches the free blocks")
        return near
    now = _Iterate(rows, near, compliance, friction, load, along, reaction)
    best, part = (now.worst, now.forces), 1.0
    for _ in range(ITERATIONS):
        converged = now.worst < BALANCED and now.mean < CONVERGED * max(1.0, float(now.forces[:, 0].max()))
        if converged or part < STUCK:
            break
        try:
            now.factorise()
        except (Singular, np.linalg.LinAlgError):
            break
        middle = now.scaling.middle
        slid = product(middle, middle)
        change = now.direction(-slid)
        part = now.longest(change)
        centring = min(max((now.mean_after(change, part) / now.mean) ** 3, 1e-4), 0.5)
        second = product(now.scaling.scaled((now.slope * change.forces).T), now.scaling.unscaled(change.z))
        second *= np.minimum(1.0, CORRECTION * now.mean / np.maximum(np.abs(second).sum(axis=0), 1e-300))
        aim = -slid - second
        aim[0] += 2.0 * centring * now.mean
        change = now.direction(aim)
        part = FRACTION * now.longest(change)
        now.take(change, part)
        if not np.isfinite(now.worst):
            break
        best = min(best, (now.worst, now.forces), key=lambda found: found[0])
    if best[0] > ACCEPTED:
        raise NotSolved(f"forces nearest to an equilibrium leave {best[0]:.1e} block weights out of balance")
    return best[1]
