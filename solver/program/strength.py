"""Strength of the contact points of joints that are not dry: the area each stands for, cohesion, crushing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from solver.assembly import Assembly
from solver.equilibrium import cone_rays
from solver.geometry.contacts import Contacts, matched_contacts
from solver.interfaces import Interfaces

#: Contact points of two blocks belong to one face while their normals differ by less than this sine.
ONE_FACE = 0.5


def contact_areas(assembly: Assembly, contacts: Contacts) -> np.ndarray:
    """Area that each contact point stands for: its part of the face between two blocks, ends and middles.

    Parameters
    ----------
    assembly : Assembly
    contacts : Contacts
        Open ones too: a face has its whole length however it has turned.

    Returns
    -------
    (n_contacts,) array [m²]
        Half the distance to the neighbours along the face times the smaller thickness; zero for a corner alone.
    """
    low = np.minimum(contacts.block_a, contacts.block_b).astype(np.int64)
    high = np.maximum(contacts.block_a, contacts.block_b).astype(np.int64)
    pair = low * assembly.n_blocks + high
    _, first, which = np.unique(pair, return_index=True, return_inverse=True)
    normal, reference = contacts.frames[:, 0], contacts.frames[first[which.ravel()], 0]
    across = np.abs(normal[:, 0] * reference[:, 1] - normal[:, 1] * reference[:, 0]) > ONE_FACE
    face = 2 * which.ravel() + across
    _, first, face = np.unique(face, return_index=True, return_inverse=True)
    face = face.ravel()
    along = np.einsum("ki,ki->k", contacts.points, contacts.frames[first[face], 1])
    order = np.lexsort((along, face))
    step = np.where(np.diff(face[order]) == 0, np.diff(along[order]), 0.0)
    length = np.zeros(len(contacts))
    length[order] = (np.append(step, 0.0) + np.append(0.0, step)) / 2.0 if len(contacts) else 0.0
    return length * np.minimum(assembly.thickness[contacts.block_a], assembly.thickness[contacts.block_b])


def point_strength(
    assembly: Assembly, interfaces: Interfaces, contacts: Contacts, around: Contacts
) -> tuple[np.ndarray, np.ndarray]:
    """Cohesive shear force and largest normal force of each contact point.

    Parameters
    ----------
    assembly : Assembly
    interfaces : Interfaces
    contacts : Contacts
    around : Contacts
        At the same geometry, with those that are open, to measure the faces by.

    Returns
    -------
    cohesion, crushing : (n_contacts,) arrays [N]
    """
    if interfaces.dry:
        return np.zeros(len(contacts)), np.full(len(contacts), np.inf)
    place, same = matched_contacts(assembly, contacts, around)
    area = np.where(same, contact_areas(assembly, around)[place], contact_areas(assembly, contacts))
    cohesion, strength = interfaces.strength(assembly, contacts.block_a, contacts.block_b)
    crushing = np.full(len(contacts), np.inf)
    finite = np.isfinite(strength)
    crushing[finite] = strength[finite] * area[finite]
    return cohesion * area, crushing


@dataclass(frozen=True)
class Admissible:
    """The forces that contact points can carry: a combination of columns with coefficients of at least 0, and limits.

    Attributes
    ----------
    columns : (2 n, m) sparse array
        Normal and shear forces of all contact points from the coefficients.
    limits : (k, m) sparse array
    most : (k,) array
        The limits on the coefficients: 0 ≤ limits · coefficients ≤ most.
    """

    columns: sp.csc_array
    limits: sp.csc_array
    most: np.ndarray

    @classmethod
    def of(cls, friction: np.ndarray, cohesion: np.ndarray, crushing: np.ndarray) -> Admissible:
        """All (N, T) with 0 ≤ N ≤ crushing and |T| ≤ friction · N + cohesion, (n,) arrays each.

        The cone of dry friction is spanned by its two rays; cohesion adds a shear force of either sign.
        """
        n = len(friction)
        rays = cone_rays(friction)
        sticky, brittle = np.flatnonzero(cohesion > 0.0), np.flatnonzero(np.isfinite(crushing))
        p, q = len(sticky), len(brittle)
        values = np.tile([1.0, -1.0], p)
        shear = sp.csc_array((values, (np.repeat(2 * sticky + 1, 2), np.arange(2 * p))), shape=(2 * n, 2 * p))
        columns = sp.csc_array(sp.hstack([rays, shear], format="csc"))
        both = sp.csc_array((np.ones(2 * p), (np.repeat(np.arange(p), 2), np.arange(2 * p))), shape=(p, 2 * p))
        ahead = sp.csc_array((p, 2 * n))
        normal = sp.csc_array(sp.csr_array(columns)[2 * brittle]) if q else sp.csc_array((0, columns.shape[1]))
        limits = sp.csc_array(sp.vstack([sp.hstack([ahead, both]), normal], format="csc"))
        return cls(columns, limits, np.concatenate([cohesion[sticky], crushing[brittle]]))
