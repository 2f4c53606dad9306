"""Random assemblies that nobody would draw: rubble, slivers, needles, sizes far apart, faces nearly parallel.

Every assembly is made from a kind and a seed alone. Faces that meet share their line to rounding: whatever the solver
says about equilibrium can be checked by an independent program.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.spatial import Voronoi

import solver
from blockvis import generators


@dataclass(frozen=True)
class Trial:
    """One random structure and what is done to it."""

    kind: str
    seed: int
    assembly: solver.Assembly
    friction: float
    settlement: solver.Settlement
    words: str


FRICTIONS = (0.0, 0.05, 0.2, 0.4, 0.6, 0.75, 1.0, 3.0, 10.0)


def trial(kind: str, seed: int) -> Trial:
    """The trial of a kind and a seed."""
    random = np.random.default_rng([sorted(KINDS).index(kind), seed])
    outlines, width = KINDS[kind](random)
    assembly = outlines if isinstance(outlines, solver.Assembly) else _on_footings(random, outlines, width)
    assembly, words = _disguised(random, assembly)
    return Trial(kind, seed, assembly, float(random.choice(FRICTIONS)), _settlement(random, assembly), words)


def _on_footings(random: np.random.Generator, outlines: list[np.ndarray], width: float) -> solver.Assembly:
    """Blocks that fill (0, width) from y = 0 upwards, on a fixed and a moving footing, now and then between walls."""
    split = width * random.uniform(0.15, 0.85)
    top = max(float(ring[:, 1].max()) for ring in outlines)
    depth = 0.2 * width
    supports = [
        ([[0, -depth], [split, -depth], [split, 0], [0, 0]], "fixed"),
        ([[split, -depth], [width, -depth], [width, 0], [split, 0]], "moving"),
    ]
    if random.random() < 0.4:
        supports.append(([[-depth, -depth], [0, -depth], [0, top], [-depth, top]], "fixed"))
    if random.random() < 0.4:
        end = width + depth
        supports.append(([[width, -depth], [end, -depth], [end, top], [width, top]], "fixed"))
    if random.random() < 0.2:
        supports[0], supports[1] = (supports[0][0], "moving"), (supports[1][0], "fixed")
    free = len(outlines)
    return solver.Assembly.from_outlines(
        [*outlines, *(np.array(ring, dtype=float) for ring, _ in supports)],
        roles=["free"] * free + [role for _, role in supports],
    )


def _disguised(random: np.random.Generator, assembly: solver.Assembly) -> tuple[solver.Assembly, str]:
    """The same structure in another size, place and weight."""
    words = []
    density = assembly.density
    if random.random() < 0.3:
        density = 10.0 ** random.uniform(0.0, 5.0, assembly.n_blocks)
        words.append("densities 1 to 1e5")
    scale = float(random.choice([1.0, 1.0, 1e-3, 100.0]))
    vertices = assembly.vertices * scale
    if scale != 1.0:
        words.append(f"size × {scale:g}")
    if random.random() < 0.2:
        vertices = vertices + np.array([5e5, 5e6]) * min(scale, 1.0)
        words.append("far from the origin")
    return replace(assembly, shapes=replace(assembly.polygons, vertices=vertices), density=density), ", ".join(words)


def _settlement(random: np.random.Generator, assembly: solver.Assembly) -> solver.Settlement:
    size = float(np.ptp(assembly.vertices[assembly.free[assembly.block_of_vertex]], axis=0).max())
    increment = size * 10.0 ** random.uniform(-3.5, -1.7)
    kind = random.choice(["down", "out", "in", "any", "turn"], p=[0.5, 0.15, 0.05, 0.15, 0.15])
    moving = assembly.vertices[assembly.moving[assembly.block_of_vertex]]
    if kind == "turn":
        return solver.Settlement(
            rotation_centre=moving.mean(axis=0),
            rotation=float(random.choice([-1.0, 1.0])),
            increment=increment / size,
            limit=5.0 * increment / size,
        )
    out = np.sign(moving[:, 0].mean() - assembly.vertices[:, 0].mean()) or 1.0
    angle = random.uniform(-np.pi, np.pi)
    direction = {"down": (0, -1), "out": (out, 0), "in": (-out, 0), "any": (np.cos(angle), np.sin(angle))}[kind]
    return solver.Settlement(direction=direction, increment=increment, limit=5.0 * increment)


def voronoi(random: np.random.Generator) -> tuple[list[np.ndarray], float]:
    """Rubble: Voronoi cells of random points, evenly spread or in clusters, so that some cells are tiny."""
    width, height = 1.0, random.uniform(0.4, 2.0)
    n = int(random.integers(3, 36))
    points = random.random((n, 2))
    if random.random() < 0.4:
        clustered = random.random(n) < 0.5
        points[clustered] = 0.5 + 0.5 * (points[clustered] - 0.5) * 10.0 ** random.uniform(-2.5, 0.0)
    if random.random() < 0.3:
        # Rows of points make joints that are nearly in line.
        points[:, 1] = (np.floor(points[:, 1] * 5) + 0.5) / 5 + random.normal(0, 10.0 ** random.uniform(-9, -2), n)
    points = np.clip(points, 1e-3, 1 - 1e-3) * [width, height]
    low, high = points * [1, -1], points * [1, -1] + [0, 2 * height]
    left, right = points * [-1, 1], points * [-1, 1] + [2 * width, 0]
    diagram = Voronoi(np.concatenate([points, low, high, left, right]))
    vertices = diagram.vertices
    for axis, end in ((0, width), (1, height)):
        for value in (0.0, end):
            vertices[np.abs(vertices[:, axis] - value) < 1e-9, axis] = value
    rings = []
    for k in range(n):
        ring = vertices[diagram.regions[diagram.point_region[k]]]
        around = np.arctan2(*(ring - ring.mean(axis=0)).T[::-1])
        rings.append(_cleaned(ring[np.argsort(around)]))
    return [ring for ring in rings if ring is not None], width


def cuts(random: np.random.Generator) -> tuple[list[np.ndarray], float]:
    """A panel cut again and again along random lines: slivers, needles, corners on the middle of faces."""
    width, height = 1.0, random.uniform(0.3, 2.0)
    pieces = [np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=float)]
    flat = random.random() < 0.5
    for _ in range(int(random.integers(2, 30))):
        sizes = np.array([np.sqrt(abs(_area(p))) for p in pieces])
        k = int(random.choice(len(pieces), p=sizes / sizes.sum()))
        piece = pieces[k]
        share = random.uniform(0.05, 0.95) if random.random() < 0.85 else 10.0 ** random.uniform(-3, -1)
        angle = random.choice([0.0, np.pi / 2]) + (random.normal(0, 0.15) if flat else random.uniform(0, np.pi))
        if random.random() < 0.2:
            angle = random.choice([0.0, np.pi / 2]) + 10.0 ** random.uniform(-9, -3)
        normal = np.array([-np.sin(angle), np.cos(angle)])
        along = piece @ normal
        one, other = _cut(piece, normal, along.min() + share * np.ptp(along))
        if one is not None and other is not None and min(abs(_area(one)), abs(_area(other))) > 1e-6:
            pieces[k : k + 1] = [one, other]
    return pieces, width


def courses(random: np.random.Generator) -> tuple[list[np.ndarray], float]:
    """Courses of bricks of any length on each other, from needles to plates, with stack bond among them."""
    width, y, rings = 1.0, 0.0, []
    for _ in range(int(random.integers(1, 7))):
        height = 10.0 ** random.uniform(-2.7, -0.3)
        n = int(random.integers(1, 7))
        joints = np.sort(random.random(n - 1)) if random.random() < 0.7 else np.arange(1, n) / n
        xs = [0.0, *joints[np.diff(joints, prepend=0.0) > 2e-3], 1.0]
        if len(xs) > 2 and xs[-1] - xs[-2] < 2e-3:
            del xs[-2]
        for a, b in pairwise(xs):
            rings.append(np.array([[a, y], [b, y], [b, y + height], [a, y + height]]))
        y += height
    return rings, width


def stack(random: np.random.Generator) -> tuple[list[np.ndarray], float]:
    """A tower whose bed joints are nearly, but not quite, parallel."""
    width, rings = 1.0, []
    left = right = 0.0
    for _ in range(int(random.integers(1, 14))):
        rise = 10.0 ** random.uniform(-2.0, 0.2)
        lean = rise * 0.5 * np.clip(random.normal(0, 1) * 10.0 ** random.uniform(-9, 0), -0.9, 0.9)
        new_left, new_right = max(left + rise + lean, left + 0.05 * rise), max(right + rise - lean, right + 0.05 * rise)
        rings.append(np.array([[0, left], [width, right], [width, new_right], [0, new_left]]))
        left, right = new_left, new_right
    return rings, width


def arch(random: np.random.Generator) -> tuple[solver.Assembly, float]:
    """Arches of few or many voussoirs, thin and thick, flat and tall."""
    radius = float(random.uniform(0.5, 5.0))
    built = generators.arch(
        radius=radius,
        thickness_ratio=float(random.uniform(0.05, 0.5)),
        embrace=float(random.uniform(50, 180)),
        voussoirs=int(random.integers(2, 26)),
    )
    return built, 2.0 * radius


def layout(random: np.random.Generator) -> tuple[solver.Assembly, float]:
    """Walls and portals of the catalogue."""
    name = str(random.choice(["wall", "portal", "column"]))
    if name == "wall":
        bricks, length = int(random.integers(2, 7)), 0.4
        bond = str(random.choice(["running", "stack"]))
        half = round(bricks / 2) * length
        built = generators.build(
            "wall",
            {
                "bricks": bricks,
                "courses": int(random.integers(1, 7)),
                "brick_length": length,
                "brick_height": float(random.uniform(0.02, 0.4)),
                "bond": bond,
                "settling": [half, bricks * length],
            },
        )
    elif name == "portal":
        built = generators.build(
            "portal", {"column_blocks": int(random.integers(1, 7)), "lintel_height": float(random.uniform(0.05, 1.0))}
        )
    else:
        built = generators.build(
            "column", {"blocks": int(random.integers(1, 9)), "width": float(random.uniform(0.05, 2.0))}
        )
    return built, 1.0


KINDS = {
    "voronoi": voronoi,
    "cuts": cuts,
    "courses": courses,
    "stack": stack,
    "arch": arch,
    "layout": layout,
}


def _area(ring: np.ndarray) -> float:
    x, y = ring.T
    return 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def _cleaned(ring: np.ndarray) -> np.ndarray | None:
    """The ring without corners that coincide; nothing where no area is left."""
    keep = np.hypot(*(ring - np.roll(ring, 1, axis=0)).T) > 1e-12
    ring = ring[keep]
    return ring if len(ring) >= 3 and abs(_area(ring)) > 1e-9 else None


def _cut(ring: np.ndarray, normal: np.ndarray, level: float) -> tuple[np.ndarray | None, np.ndarray | None]:
    """A convex ring on both sides of a line."""
    side = ring @ normal - level
    below, above = [], []
    for k in range(len(ring)):
        p, q, a, b = ring[k], ring[(k + 1) % len(ring)], side[k], side[(k + 1) % len(ring)]
        if a <= 0:
            below.append(p)
        if a >= 0:
            above.append(p)
        if a * b < 0:
            point = p + (q - p) * (a / (a - b))
            below.append(point)
            above.append(point)
    return tuple(_cleaned(np.array(r)) if len(r) >= 3 else None for r in (below, above))  # type: ignore[return-value]
