"""Walls whose supports settle, for ``convergence.py``: sixteen layouts, and random ones from seeds.

    python benchmarks/convergence_walls.py [--random 20]

lists them: blocks, friction, settlement, and whether there is an equilibrium in the drawing.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial import Voronoi
from sliding_walls import outlines_of, redrawn, shuffled

import solver
from blockvis.generators import build
from solver import mechanics

#: Where reactions and positions are told, parts of the whole settlement, and the largest step of it.
TOLD = (0.125, 0.25, 0.5, 0.75, 1.0)
INCREMENT = 0.25

#: Width of the bracket of a collapse, a part of the whole settlement.
BRACKET = 1e-3

DOWN, OUT, OBLIQUE = (0.0, -1.0), (1.0, 0.0), (0.5, -1.0)
HEADS = ("lintel", "flat arch", "segmental arch", "round arch")

#: Draws of a random wall, until there is room for its opening and it stands.
DRAWS = 50


@dataclass(frozen=True)
class Wall:
    """A wall and its settlement; lengths in metres.

    Attributes
    ----------
    assembly : solver.Assembly
    friction : float
    settlement : solver.Settlement
    loads : solver.Loads
        Dead only.
    mirrored : bool
        Left and right are exchanged.
    """

    assembly: solver.Assembly
    friction: float
    settlement: solver.Settlement
    loads: solver.Loads
    mirrored: bool = False

    @property
    def told(self) -> tuple[float, ...]:
        return self.settlement.stops

    def parted(self, parts: int) -> Wall:
        """With an increment so many times as short."""
        return replace(self, settlement=replace(self.settlement, increment=self.settlement.increment / parts))

    def __str__(self) -> str:
        given = self.settlement
        if given.profile is not None:
            way = "profile with rotation"
        elif given.direction is None:
            way = "turns"
        else:
            way = f"direction ({given.direction[0]:.2f}, {given.direction[1]:.2f})"
        return f"{int(self.assembly.free.sum())} blocks, μ {self.friction:g}, {way}, to {given.limit:.3g} {given.unit}"


def settling(assembly: solver.Assembly, friction: float, limit: float, *, floors: Any = None, **motion: Any) -> Wall:
    """A wall under its weight, and under floors where there are any, with what is told of its settlement."""
    settlement = solver.Settlement(
        increment=INCREMENT * limit,
        limit=limit,
        tolerance=BRACKET * limit,
        stops=tuple(part * limit for part in TOLD),
        **motion,
    )
    loads = solver.self_weight(assembly)
    return Wall(assembly, friction, settlement, loads if floors is None else replace(loads, dead=loads.dead + floors))


def mirrored(wall: Wall) -> Wall:
    """Left and right exchanged; loads and settlement go along."""
    given, flip = wall.settlement, np.array([-1.0, 1.0, -1.0])
    changes: dict[str, Any] = {"stops": given.stops}
    if given.profile is not None:
        changes |= {"profile": {name: tuple(flip * motion) for name, motion in given.profile.items()}}
    if given.direction is not None:
        changes |= {"direction": tuple(flip[:2] * given.direction)}
    if given.rotation_centre is not None:
        changes |= {"rotation_centre": tuple(flip[:2] * given.rotation_centre), "rotation": -given.rotation}
    return redrawn(  # type: ignore[return-value]
        wall,  # type: ignore[arg-type]
        [ring * flip[:2] for ring in outlines_of(wall)],  # type: ignore[arg-type]
        loads=solver.Loads(wall.loads.dead * flip, wall.loads.live * flip),
        settlement=replace(given, **changes),
        mirrored=not wall.mirrored,
    )


#: The same wall in other words.
DESCRIPTIONS: dict[str, Callable[[Wall], Wall]] = {
    "mirrored": mirrored,
    "shuffled": lambda wall: shuffled(wall, 1),  # type: ignore[arg-type, return-value]
}


# Layouts that are not in the catalogue ------------------------------------------------------------------------------


def box(left: float, low: float, right: float, high: float) -> np.ndarray:
    return np.array([[left, low], [right, low], [right, high], [left, high]])


def stones_on(outlines: Sequence[np.ndarray], footings: Sequence[np.ndarray], moving: int) -> solver.Assembly:
    """Free stones on footings, one of which moves: "footing 1" from the left."""
    roles = [mechanics.MOVING if i == moving else mechanics.FIXED for i in range(len(footings))]
    return solver.Assembly.from_outlines(
        [*outlines, *footings],
        names=[*(f"stone {i + 1}" for i in range(len(outlines))), *(f"footing {i + 1}" for i in range(len(footings)))],
        roles=[mechanics.FREE] * len(outlines) + roles,
    )


def arcade(
    arches: int,
    *,
    moving: int,
    voussoirs: int = 7,
    blocks: int = 4,
    radius: float = 1.0,
    thickness: float = 0.25,
    height: float = 2.0,
    pier: float = 1.2,
) -> solver.Assembly:
    """Semicircular arches on columns twice as wide as the arches are thick, and on a wider pier at either end."""
    spacing = 2.0 * (radius + thickness)
    angles = np.linspace(math.pi, 0.0, voussoirs + 1)
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    outlines, footings = [], []
    for i in range(arches):
        middle = np.array([i * spacing, height])
        inner, outer = middle + radius * rays, middle + (radius + thickness) * rays
        outlines += [np.array([inner[k], inner[k + 1], outer[k + 1], outer[k]]) for k in range(voussoirs)]
    for i in range(arches + 1):
        left, right = (i - 0.5) * spacing - thickness, (i - 0.5) * spacing + thickness
        left = right - pier if i == 0 else left
        right = left + pier if i == arches else right
        levels = np.linspace(0.0, height, blocks + 1)
        outlines += [box(left, low, right, high) for low, high in pairwise(levels)]
        footings.append(box(left - 0.2, -0.5, right + 0.2, 0.0))
    return stones_on(outlines, footings, moving)


def rubble(
    columns: int,
    rows: int,
    *,
    seed: int,
    moves_from: float = 0.55,
    stone: tuple[float, float] = (0.3, 0.2),
    disorder: float = 0.25,
) -> solver.Assembly:
    """Stones around points of a disordered bond, cells of a Voronoi diagram; the ground moves from a part of the width.

    Cells are made where stones are square, so that bed joints are flatter than they would be.
    """
    random = np.random.default_rng(seed)
    points = np.array([[i + 0.25 + 0.5 * (j % 2), j + 0.5] for j in range(rows) for i in range(columns)])
    points += disorder * random.uniform(-1.0, 1.0, points.shape)
    ends = np.array([columns, rows], dtype=float)
    points = np.clip(points, 0.2, ends - 0.2)
    mirror_images = [points * flip + shift for flip, shift in _reflections(ends)]
    cells = Voronoi(np.concatenate([points, *mirror_images]))
    outlines = []
    for region in cells.point_region[: len(points)]:
        ring = np.clip(cells.vertices[cells.regions[region]], 0.0, ends)
        outlines.append(_without_short_edges(ring * stone))
    width, depth = ends[0] * stone[0], stone[0]
    split = moves_from * width
    footings = [box(-depth, -depth, split, 0.0), box(split, -depth, width + depth, 0.0)]
    return stones_on(outlines, footings, 1)


def _reflections(ends: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Reflections in the four sides of a rectangle from the origin, factors and shifts: cells end at the sides."""
    found = []
    for axis in range(2):
        for side in (0.0, float(ends[axis])):
            flip, shift = np.ones(2), np.zeros(2)
            flip[axis], shift[axis] = -1.0, 2.0 * side
            found.append((flip, shift))
    return found


def _without_short_edges(ring: np.ndarray, shortest: float = 1e-9) -> np.ndarray:
    return ring[np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1) > shortest]


def floor_on(assembly: solver.Assembly, level: float, per_metre: float) -> np.ndarray:
    """(n_blocks, 3) array [N, N, N·m]: a floor on the bricks whose tops are at a level, a force per length."""
    load = np.zeros((assembly.n_blocks, 3))
    for i in np.flatnonzero(assembly.free):
        low, high = assembly.outline(i).min(axis=0), assembly.outline(i).max(axis=0)
        if abs(high[1] - level) < 1e-6:
            load[i, 1] = -per_metre * (high[0] - low[0])
    return load


# Sixteen walls ------------------------------------------------------------------------------------------------------


def storeys(number: int, *, bricks: int, courses: int, friction: float, limit: float, heads: Sequence[str]) -> Wall:
    """Storeys with a window each, another head in each, a floor on top of each; the right half of the ground sinks."""
    length, high, per_metre = 0.25, 0.1, 4000.0
    span = length * round(0.4 * bricks)
    left = length * round((bricks * length - span) / 2.0 / length)
    openings = [
        {"x": left, "y": high * (k * courses + 3), "width": span, "height": 5 * high, "head": heads[k % len(heads)]}
        for k in range(number)
    ]
    parameters = {"bricks": bricks, "courses": number * courses, "openings": openings}
    assembly = build("wall", {**parameters, "settling": [0.55 * bricks * length, bricks * length]})
    floors = np.sum([floor_on(assembly, high * courses * (k + 1), per_metre) for k in range(number)], axis=0)
    return settling(assembly, friction, limit, floors=floors, direction=DOWN)


def bricks(number: int, courses: int, friction: float, limit: float, part: float = 0.6, **given: Any) -> Wall:
    """A brick wall whose ground moves from a part of its width to the right."""
    motion = {key: given.pop(key) for key in ("direction", "profile") if key in given}
    width = 0.25 * number
    assembly = build("wall", {"bricks": number, "courses": courses, "settling": [part * width, width], **given})
    return settling(assembly, friction, limit, **(motion or {"direction": DOWN}))


def window(x: float, y: float, width: float, height: float, head: str, **given: Any) -> dict[str, Any]:
    return {"x": x, "y": y, "width": width, "height": height, "head": head, **given}


def turning_arcade() -> Wall:
    """Three arches; the footing of the right pier leans outwards about its inner upper corner."""
    assembly = arcade(3, moving=3)
    corner = assembly.outline(assembly.index("footing 4"))[3]
    return settling(assembly, 0.6, 0.03, rotation_centre=tuple(corner), rotation=-1.0)


def turning_rubble() -> Wall:
    """Rubble the right part of whose ground tilts about its left end."""
    assembly = rubble(10, 9, seed=12)
    corner = assembly.outline(assembly.index("footing 2"))[3]
    return settling(assembly, 0.65, 0.03, rotation_centre=tuple(corner), rotation=-1.0)


WALLS: dict[str, Callable[[], Wall]] = {
    "portal": lambda: settling(build("portal", {"column_blocks": 8}), 0.6, 1.2, direction=OUT),
    "panel": lambda: settling(build("panel", {"nb": 4, "nc": 5, "block_height": 0.2}), 0.45, 0.08, direction=DOWN),
    "buttressed arch": lambda: settling(
        build("buttressed arch", {"voussoirs": 15, "pier_blocks": 4, "buttress_blocks": 4}), 0.6, 1.0, direction=OUT
    ),
    "arcade 2": lambda: settling(arcade(2, moving=2), 0.6, 0.5, direction=OUT),
    "arcade 3 turns": turning_arcade,
    "rubble 40": lambda: settling(rubble(8, 5, seed=11), 0.65, 0.06, direction=OUT),
    "rubble 90 turns": turning_rubble,
    "rubble 160": lambda: settling(rubble(16, 10, seed=13), 0.65, 0.06, direction=DOWN),
    "flat arch": lambda: bricks(
        10, 12, 0.6, 0.06, direction=OBLIQUE, openings=[window(0.875, 0.4, 0.75, 0.4, "flat arch")]
    ),
    "English bond": lambda: bricks(7, 10, 0.55, 0.04, direction=OBLIQUE, bond="english"),
    "two storeys": lambda: storeys(
        2, bricks=6, courses=12, friction=0.6, limit=0.04, heads=("lintel", "segmental arch")
    ),
    "lintel and arch": lambda: bricks(
        12,
        14,
        0.6,
        0.05,
        openings=[window(0.5, 0.4, 0.75, 0.5, "lintel"), window(1.75, 0.4, 0.75, 0.5, "segmental arch")],
    ),
    "bricks profile": lambda: bricks(10, 14, 0.6, 0.06, profile={"ground right": (0.3, -1.0, -0.2)}),
    "round arch": lambda: bricks(
        14, 16, 0.6, 0.3, part=0.5, direction=OUT, openings=[window(1.25, 0.0, 1.0, 0.6, "round arch")]
    ),
    "bricks 330": lambda: bricks(16, 20, 0.6, 0.04, part=0.55),
    "three storeys": lambda: storeys(
        3, bricks=11, courses=14, friction=0.6, limit=0.04, heads=("segmental arch", "lintel", "flat arch")
    ),
}


# Random walls -------------------------------------------------------------------------------------------------------


def random_bricks(random: np.random.Generator) -> Wall:
    """Bricks, most with an opening; more of the smaller walls than of the larger ones."""
    number, courses = int(random.integers(4, 13)), int(random.integers(5, 19))
    given: dict[str, Any] = {"bond": str(random.choice(["running", "running", "english"]))}
    if random.random() < 0.6:
        x, y = 0.125 * int(random.integers(2, 2 * number - 4)), 0.1 * int(random.integers(0, max(1, courses // 2)))
        size = 0.125 * int(random.integers(3, number)), 0.1 * int(random.integers(2, max(3, courses // 2)))
        given["openings"] = [window(x, y, *size, str(random.choice(HEADS)))]
    direction = (DOWN, OUT, OBLIQUE)[int(random.choice(3, p=[0.5, 0.25, 0.25]))]
    friction, part = round(random.uniform(0.4, 0.75), 2), 0.05 * int(random.integers(6, 17))
    return bricks(number, courses, friction, random_way(random, 0.25), part, direction=direction, **given)


def random_rubble(random: np.random.Generator) -> Wall:
    columns, rows = int(random.integers(5, 14)), int(random.integers(4, 10))
    seed, part, disorder = int(random.integers(1000)), random.uniform(0.3, 0.8), random.uniform(0.1, 0.3)
    assembly = rubble(columns, rows, seed=seed, moves_from=part, disorder=disorder)
    friction, way = round(random.uniform(0.55, 0.8), 2), random_way(random, 0.3)
    if random.random() < 0.25:
        corner = assembly.outline(assembly.index("footing 2"))[3]
        return settling(assembly, friction, way / (0.3 * columns), rotation_centre=tuple(corner), rotation=-1.0)
    return settling(assembly, friction, way, direction=(DOWN, OUT, OBLIQUE)[int(random.integers(3))])


def random_arch(random: np.random.Generator) -> Wall:
    kind = str(random.choice(["segmental arch", "pointed arch", "arch on piers", "buttressed arch", "arcade"]))
    stones = int(random.integers(7, 22))
    friction, span = round(random.uniform(0.5, 0.9), 2), random.uniform(2.0, 4.0)
    shape = {"span": span, "thickness": span * random.uniform(0.09, 0.15), "voussoirs": stones}
    if kind == "arcade":
        number = int(random.integers(2, 5))
        assembly = arcade(number, moving=int(random.integers(1, number + 1)), voussoirs=stones // 2 + 2)
    elif kind == "pointed arch":
        assembly = build(kind, {**shape, "rise": span * random.uniform(0.7, 1.0)})
    elif kind == "segmental arch":
        assembly = build(kind, {**shape, "rise": span * random.uniform(0.15, 0.45)})
    elif kind == "arch on piers":
        tall = span * random.uniform(0.3, 0.8)
        piers = {"pier_width": span * random.uniform(0.35, 0.6), "pier_height": tall, "pier_blocks": 4}
        assembly = build(kind, {**shape, **piers, "rise": span * random.uniform(0.35, 0.5)})
    else:
        piers = {"pier_width": 0.2 * span, "pier_height": 0.8 * span, "pier_blocks": 4}
        buttresses = {"buttress_width": 0.4 * span, "buttress_height": 0.7 * span, "buttress_blocks": 4}
        assembly = build(kind, {**shape, **piers, **buttresses, "rise": span * random.uniform(0.35, 0.5)})
    direction = (OUT, OUT, OBLIQUE, DOWN)[int(random.integers(4))]
    return settling(assembly, friction, random_way(random, 0.6 * span), direction=direction)


def random_way(random: np.random.Generator, size: float) -> float:
    """A settlement from a twentieth of a size to the whole of it [m]."""
    return float(f"{size * 10.0 ** random.uniform(-1.3, 0.0):.2g}")


KINDS: dict[str, Callable[[np.random.Generator], Wall]] = {
    "bricks": random_bricks,
    "rubble": random_rubble,
    "arch": random_arch,
}


def stands(wall: Wall) -> bool:
    """Whether its drawing can be analysed and carries its weight and a thousandth more, by the static program."""
    assembly = wall.assembly
    mechanics.check_settlement(assembly, [wall.settlement], solver.Controls())
    live = solver.weight_fraction(assembly, DOWN, assembly.free)
    limit = solver.limit_load(
        assembly, loads=solver.Loads(wall.loads.dead, 1e-3 * live), friction_coefficient=wall.friction
    )
    return limit.status in (solver.LimitStatus.FOUND, solver.LimitStatus.UNBOUNDED)


def random_wall(seed: int) -> Wall:
    """The wall of a seed, always the same; one without room for its opening, or that falls, is drawn again."""
    random = np.random.default_rng(seed)
    kind = list(KINDS)[seed % len(KINDS)]
    for _ in range(DRAWS):
        try:
            wall = KINDS[kind](random)
            if stands(wall):
                return wall
        except ValueError:
            continue
    raise ValueError(f"seed {seed} gives no wall that stands in {DRAWS} draws")


def random_walls(number: int) -> dict[str, Callable[[], Wall]]:
    """So many random walls by their names, which tell kind and seed."""
    return {f"{list(KINDS)[seed % len(KINDS)]} seed {seed}": partial(random_wall, seed) for seed in range(number)}


def main() -> None:
    """List the walls."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--random", type=int, default=20, help="how many of the random walls")
    for name, make in {**WALLS, **random_walls(parser.parse_args().random)}.items():
        wall = make()
        print(f"{name:16s} {wall}{'' if stands(wall) else ': does not stand'}", flush=True)


if __name__ == "__main__":
    main()
