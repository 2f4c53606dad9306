"""Limits of the forces of contact points, with friction, cohesion, tension and crushing, as programs state them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from solver.equilibrium import friction_rays

from .torsion import Faces


@dataclass(frozen=True)
class ForceLimits:
    """Limits, (n,) in units of the program, of contact forces: least ≤ N ≤ most, |T| ≤ μ (N - least) + cohesion."""

    least: np.ndarray
    most: np.ndarray
    cohesion: np.ndarray

    @property
    def beyond_least(self) -> np.ndarray:
        """(n,) array: largest normal forces beyond the least ones."""
        return np.asarray(self.most - self.least)

    def __getitem__(self, chosen: np.ndarray) -> ForceLimits:
        """Choose some of the contact points, by a mask or their numbers."""
        return ForceLimits(self.least[chosen], self.most[chosen], self.cohesion[chosen])


@dataclass(frozen=True)
class Admissible:
    """The forces that n contact points can carry: columns with coefficients of at least 0, and limits on these.

    The limits are 0 ≤ limits · coefficients ≤ most; those of faces come first. Friction has the slopes of the round
    cones, of as many numbers as a force, that the first coefficients are in; none in the plane.
    """

    columns: sp.csc_array  #: (size n, m)
    limits: sp.csc_array  #: (k, m)
    most: np.ndarray  #: (k,)
    limited: np.ndarray  #: (k,) int: contact point of each
    friction: np.ndarray  #: (j,)

    @classmethod
    def of(
        cls, friction: np.ndarray, cohesion: np.ndarray, crushing: np.ndarray, size: int, faces: Faces | None = None
    ) -> Admissible:
        """All (N, T) with 0 ≤ N ≤ crushing and |T| ≤ friction · N + cohesion, (n,) arrays each.

        In the plane the cone of dry friction is spanned by its two rays; cohesion adds a shear force of either sign. In
        space forces of ``size`` numbers are in a round cone; cohesion adds one of slope 1 whose first number has no
        effect but to be limited. Faces that resist torsion add two cones each.
        """
        n = len(friction)
        sticky, brittle = np.flatnonzero(cohesion > 0.0), np.flatnonzero(np.isfinite(crushing))
        p, q = len(sticky), len(brittle)
        if size == 2:
            rays, values = friction_rays(friction), np.tile([1.0, -1.0], p)
            shear = sp.csc_array((values, (np.repeat(2 * sticky + 1, 2), np.arange(2 * p))), shape=(2 * n, 2 * p))
            columns = sp.csc_array(sp.hstack([rays, shear], format="csc"))
            # A limit of one coefficient costs nothing, one of both would widen the band of the program.
            each, normal = sp.eye_array(2 * (n + p), format="csr")[2 * n :], sp.csr_array(columns)[2 * brittle]
            limits, slopes = sp.csc_array(sp.vstack([each, normal], format="csc")), np.zeros(0)
            sticky = np.repeat(sticky, 2)
        else:
            shear, of_added = ((size * which[:, None] + np.arange(1, size)).ravel() for which in (sticky, np.arange(p)))
            added = sp.csc_array((np.ones(len(shear)), (shear, of_added)), shape=(size * n, size * p))
            columns = sp.csc_array(sp.hstack([sp.eye_array(size * n, format="csc"), added], format="csc"))
            limited = np.concatenate([size * (n + np.arange(p)), size * brittle])
            limits = sp.csc_array((np.ones(p + q), (np.arange(p + q), limited)), shape=(p + q, columns.shape[1]))
            slopes = np.append(friction, np.ones(p))
        most, of = np.append(cohesion[sticky], crushing[brittle]), np.append(sticky, brittle)
        if faces is not None:
            # Cohesion adds to the friction of its face.
            adds = (np.ones(p), (5 * faces.face[sticky] + 4, size * (n + np.arange(p))))
            shares = faces.shares @ columns
            columns, limits = faces.beside(columns, limits, shares + sp.coo_array(adds, shape=shares.shape))
            most, of = np.append(np.zeros(shares.shape[0]), most), np.append(np.repeat(faces.first, 5), of)
            slopes = np.append(slopes, np.ones(2 * len(faces.radii)))
        return cls(columns, limits, most, of, slopes)
