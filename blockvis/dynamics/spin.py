"""Inertia of blocks about their principal axes, and how they spin in free flight."""

from __future__ import annotations

import numpy as np

import solver


def principal_inertia(assembly: solver.Assembly) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments of inertia of blocks, (n_blocks, n_rot) [kg m²], and the axes as drawn, (n_blocks, d, d)."""
    if assembly.dimension == 2:
        moments = assembly.masses * assembly.shapes.gyration
        return moments[:, None], np.tile(np.eye(2), (assembly.n_blocks, 1, 1))
    moments, axes = np.linalg.eigh(assembly.polyhedra.inertia)
    # Right-handed, for cross products.
    axes[:, :, 0] *= np.sign(np.linalg.det(axes))[:, None]
    return moments * assembly.density[:, None], axes


def free_spin(inertia: np.ndarray, spin: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) arrays: turn of bodies in a time, and spin after it, about their principal axes, which turn with them.

    Euler's equations I ω̇ = I ω × ω by the midpoint rule, and the turn by Cayley's map: together they keep energy and
    angular momentum in space exactly (Simo & Wong 1991, https://doi.org/10.1002/nme.1620310103).
    """
    middle = spin.copy()
    for _ in range(8):
        momentum = inertia * middle
        residual = 2.0 * (momentum - inertia * spin) + time * np.cross(middle, momentum)
        if np.abs(residual).max(initial=0.0) <= 1e-15 * np.abs(momentum).max(initial=0.0):
            break
        slope = 2.0 * inertia[:, :, None] * np.eye(3) + time * (_cross(middle) * inertia[:, None] - _cross(momentum))
        middle = middle - np.linalg.solve(slope, residual[:, :, None])[:, :, 0]
    half = 0.5 * time * np.linalg.norm(middle, axis=1)
    part = np.divide(np.arctan(half), half, out=np.ones_like(half), where=half > 1e-12)
    return time * middle * part[:, None], 2.0 * middle - spin


def _cross(vectors: np.ndarray) -> np.ndarray:
    """(n, 3, 3) array: matrices that make cross products with vectors."""
    return np.cross(vectors[:, None], np.eye(3)).transpose(0, 2, 1)
