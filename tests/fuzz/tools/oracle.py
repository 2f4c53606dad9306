"""An independent judge of what the solver says: other contacts, the other form of the program, another interface.

Touching faces are found from the corners alone, block by block in plain loops, and the kinematic form (upper bound) goes
to ``scipy.optimize.linprog``; nothing of the solver's contact search, matrices or programs is used. Two sets of contact
points bracket the truth: *strict* has the ends of faces that lie on each other, and corners inside faces; *generous* has
every corner near every face or corner, with every normal that could act there. A reaction lies between those of the two
(the fewer the contacts, the larger it is), an equilibrium that strict contacts hold exists, and one that generous
contacts cannot hold does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_array, vstack

GRAVITY = 9.81


#: Work over the weight below which blocks stand, and the bound on their velocities, per unit of the supports', where
#: they do: blocks that stand cannot gain by moving further, but for rounding times this.
ROUNDING, FARTHEST = 1e-8, 1e3


@dataclass(frozen=True)
class Touching:
    """Contact points of an oracle: blocks a and b, point, unit normal from b into a."""

    a: np.ndarray
    b: np.ndarray
    points: np.ndarray
    normals: np.ndarray


def touching(
    rings: Sequence[np.ndarray], free: np.ndarray, near: float, *, generous: bool, apart: float | None = None
) -> Touching:
    """Contact points of convex blocks.

    Parameters
    ----------
    rings : sequence of (n, 2) arrays [m]
        Corners of each block, counter-clockwise.
    free : (n_blocks,) bool array
    near : float [m]
        Distance up to which a corner touches.
    generous : bool
        Whether corners near corners count, with the normals of both.
    apart : float, optional [m]
        Distance up to which a corner outside, or beyond the end of an edge, touches, where that is less.
    """
    found: list[tuple[int, int, np.ndarray, np.ndarray]] = []
    boxes = [(ring.min(axis=0) - near, ring.max(axis=0) + near) for ring in rings]
    for a in range(len(rings)):
        for b in range(len(rings)):
            if a == b or not (free[a] or free[b]):
                continue
            if (boxes[a][0] > boxes[b][1]).any() or (boxes[b][0] > boxes[a][1]).any():
                continue
            found += _corners_on_faces(rings[a], rings[b], a, b, (near, near if apart is None else apart), generous)
    if not found:
        return Touching(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)), np.zeros((0, 2)))
    return Touching(
        np.array([f[0] for f in found]),
        np.array([f[1] for f in found]),
        np.array([f[2] for f in found]),
        np.array([f[3] for f in found]),
    )


def _corners_on_faces(
    corners: np.ndarray, ring: np.ndarray, a: int, b: int, within: tuple[float, float], generous: bool
) -> list[tuple[int, int, np.ndarray, np.ndarray]]:
    found, (near, apart) = [], within
    inside = corners.mean(axis=0)
    for k in range(len(ring)):
        start, along = ring[k], ring[(k + 1) % len(ring)] - ring[k]
        length = float(np.hypot(*along))
        along = along / length
        normal = np.array([along[1], -along[0]])
        for m, corner in enumerate(corners):
            gap, place = float((corner - start) @ normal), float((corner - start) @ along)
            if not -near <= gap <= apart or not -apart <= place <= length + apart:
                continue
            if generous:
                if (inside - corner) @ normal > 0.0:
                    found.append((a, b, corner, normal))
                continue
            if (inside - corner) @ normal <= 0.0:
                continue
            # Inside the face, or at its end with a face that runs back along it.
            within = 10 * near < place < length - 10 * near
            back = (corner - corners[m - 1], corners[(m + 1) % len(corners)] - corner)
            lies = any(
                float(np.hypot(*way)) > 10 * near
                and abs(float(way @ normal)) <= 1e-6 * float(np.hypot(*way))
                and max(float((corner - start) @ along), float((corner - start + turn * way) @ along)) > 10 * near
                and min(float((corner - start) @ along), float((corner - start + turn * way) @ along))
                < length - 10 * near
                for way, turn in ((back[0], -1.0), (back[1], 1.0))
            )
            if within or lies:
                found.append((a, b, corner, normal))
    return found


@dataclass(frozen=True)
class Verdict:
    """What the kinematic program says.

    ``falls`` is the work that gravity can do for nothing, relative to the weight; ``motion`` (n_blocks, 3) how all
    blocks move with the supports, per unit of settlement. The reaction is -inf where no movement goes with theirs (forces
    without limit keep the balance), None where no forces balance the weights.
    """

    falls: float
    reaction: float | None
    motion: np.ndarray | None = None


def judged(
    rings: Sequence[np.ndarray],
    free: np.ndarray,
    weights: np.ndarray,
    contacts: Touching,
    friction: float | np.ndarray,
    support_velocity: np.ndarray | None = None,
) -> Verdict:
    """Whether the blocks fall with the supports at rest, and the reaction where the supports move.

    Parameters
    ----------
    rings : sequence of (n, 2) arrays [m]
    free : (n_blocks,) bool array
    weights : (n_blocks,) array [N]
    contacts : Touching
    friction : float
    support_velocity : (n_blocks, 3) array, optional
        About the mean of each support's corners.

    Notes
    -----
    Maximise Σ w · q over the velocities q of the free blocks with N(q) ≥ μ |T(q)| at every contact point: zero at an
    equilibrium, and with moving supports the reaction along their motion. Movements are bounded where nothing holds.
    """
    length = float(np.sqrt(np.mean([_area(rings[i]) for i in np.flatnonzero(free)])))
    centres = np.array([_centroid(ring) for ring in rings])
    number = np.full(len(rings), -1)
    number[free] = np.arange(free.sum())
    n = len(contacts.a)
    columns, values, fixed = [[], []], [[], []], np.zeros((2, n))
    rows = [[], []]
    for which in range(2):
        for k in range(n):
            normal = contacts.normals[k]
            direction = normal if which == 0 else np.array([-normal[1], normal[0]])
            for block, sign in ((contacts.a[k], 1.0), (contacts.b[k], -1.0)):
                arm = contacts.points[k] - centres[block]
                turn = (direction[1] * arm[0] - direction[0] * arm[1]) / length
                if free[block]:
                    rows[which] += [k] * 3
                    columns[which] += [3 * number[block] + c for c in range(3)]
                    values[which] += [sign * direction[0], sign * direction[1], sign * turn]
                elif support_velocity is not None:
                    v = support_velocity[block]
                    fixed[which, k] += sign * (direction @ v[:2] + turn * length * v[2])
    size = (n, 3 * int(free.sum()))
    normal_part, shear_part = (csr_array((values[w], (rows[w], columns[w])), shape=size) for w in range(2))
    mean = float(weights[free].mean())
    gain = np.zeros(size[1])
    gain[1::3] = weights[free] / mean
    mu = np.broadcast_to(np.asarray(friction, dtype=float), (n,))
    each = csr_array((mu, (np.arange(n), np.arange(n))), shape=(n, n)) @ shear_part
    held = vstack([each - normal_part, -each - normal_part], format="csr")
    total = float(weights[free].sum()) / mean
    found = _solved(gain, held, np.zeros(2 * n), 1.0)
    if found is None:
        raise ArithmeticError("linprog could not decide whether the blocks stand")
    falls, reaction, motion = found[0] / total, None, None
    if support_velocity is not None:
        limits = np.concatenate([fixed[0] - mu * fixed[1], fixed[0] + mu * fixed[1]])
        found = _solved(gain, held, limits, None)
        if found is None and falls <= ROUNDING:
            # Without friction, a face that is off the level by rounding lets a block slide as far as it may.
            found = _solved(gain, held, limits, FARTHEST)
        if found is not None:
            reaction = found[0] * mean
        if found is not None and found[1] is not None:
            motion = support_velocity.copy()
            motion[free] = found[1].reshape(-1, 3) / [1.0, 1.0, length]
    return Verdict(falls, reaction, motion)


def moved_on(rings: Sequence[np.ndarray], motion: np.ndarray) -> list[np.ndarray]:
    """The blocks after a motion (n_blocks, 3) about their centroids, rotations exact."""
    moved = []
    for ring, (x, y, turn) in zip(rings, motion, strict=True):
        centre, (c, s) = _centroid(ring), (np.cos(turn), np.sin(turn))
        moved.append(centre + [x, y] + (ring - centre) @ np.array([[c, s], [-s, c]]))
    return moved


def _solved(gain: np.ndarray, held, limits: np.ndarray, bound: float | None) -> tuple[float, np.ndarray | None] | None:
    """The largest downward work and its movement, within a bound; -inf where nothing can move so, None without limit."""
    # Where it finds neither an answer nor that there is none, the tolerances may be too sharp.
    for tolerance in (1e-10, 1e-7):
        result = linprog(
            gain,
            A_ub=held,
            b_ub=limits,
            bounds=(None if bound is None else -bound, bound),
            method="highs",
            options={"primal_feasibility_tolerance": tolerance, "dual_feasibility_tolerance": tolerance},
        )
        if result.status in (0, 2, 3):
            break
    else:
        raise ArithmeticError("linprog could not decide how blocks move")
    if result.status == 2:
        return -np.inf, None
    if result.status != 0:
        return None
    return float(-result.fun), np.asarray(result.x)


def support_velocities(
    rings: Sequence[np.ndarray],
    moving: np.ndarray,
    direction: Sequence[float] | None,
    centre: Sequence[float] | None,
    turn: float,
) -> np.ndarray:
    """(n_blocks, 3) array: velocity of the moving blocks about their centroids, per unit of settlement."""
    velocity = np.zeros((len(rings), 3))
    for block in np.flatnonzero(moving):
        if direction is not None:
            velocity[block, :2] += direction
        if centre is not None:
            arm = _centroid(rings[block]) - np.asarray(centre)
            velocity[block] += turn * np.array([-arm[1], arm[0], 1.0])
    return velocity


def _area(ring: np.ndarray) -> float:
    x, y = (ring - ring[0]).T
    return 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def _centroid(ring: np.ndarray) -> np.ndarray:
    local = ring - ring[0]
    x, y = local.T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    sums = np.array([((x + np.roll(x, -1)) * cross).sum(), ((y + np.roll(y, -1)) * cross).sum()])
    return ring[0] + sums / (3.0 * cross.sum())
