"""Twenty synthetic cases for ``blockvis explain``: how often the cause comes first, and its amount within 25 %.

Each case is made by the solver from blocks of another size and with another friction than the inverse assumes; what
is observed are the widths near both ends of its open joints, and some closed ones, by x and y, with 20 % of noise. The
inverse never sees the structure that cracked. ``python benchmarks/explain_cases.py [numbers]`` prints the table; it
takes minutes.
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import blockvis
import solver
from blockvis import generators
from blockvis.cases.profiles import Profile, cut_ground
from blockvis.results.joints import end_openings, initial_joints
from blockvis.toml_text import as_toml

#: Relative standard deviation of the observed widths.
NOISE = 0.2

#: Cracks narrower than this [m] are not seen, and every so manieth closed joint is noted as closed.
SEEN, EVERY_CLOSED = 3e-4, 3

#: Widths are measured near both ends of a joint: fractions of its length.
AT = (0.1, 0.9)

#: Increments of the path to the amount that is looked for.
INCREMENTS = 6

DOOR = {"y": 0.0, "head": "lintel", "bearing": 0.2, "depth": 0.2}


@dataclass(frozen=True)
class Structure:
    """A layout as the inverse assumes it, and as it is.

    Attributes
    ----------
    layout : str
    assumed, real : mapping
        Parameters.
    friction : (float, float)
        Assumed, real.
    """

    layout: str
    assumed: Mapping[str, Any]
    real: Mapping[str, Any]
    friction: tuple[float, float]


@dataclass(frozen=True)
class Case:
    """A cause, to be found again.

    Attributes
    ----------
    structure : str
    cause : str
        As ``explain`` names it.
    motion : mapping or Profile
        Motions of the supports by name, or how the ground goes.
    amount : float [m or rad]
    """

    structure: str
    cause: str
    motion: Any
    amount: float


STRUCTURES = {
    "arch": Structure("arch", {"voussoirs": 12}, {"voussoirs": 15}, (0.7, 0.6)),
    "segmental arch": Structure(
        "segmental arch",
        {"span": 3.0, "rise": 0.75, "thickness": 0.3, "voussoirs": 11},
        {"span": 3.0, "rise": 0.75, "thickness": 0.3, "voussoirs": 14},
        (0.6, 0.75),
    ),
    "portal": Structure("portal", {"column_blocks": 4}, {"column_blocks": 6}, (0.6, 0.5)),
    "wall with a door": Structure(
        "wall",
        {
            "bricks": 4, "courses": 5, "brick_length": 0.4, "brick_height": 0.2, "depth": 0.4, "settling": [0.8, 1.6],
            "openings": [DOOR | {"x": 0.6, "width": 0.4, "height": 0.6}],
        },
        {
            "bricks": 6, "courses": 7, "brick_length": 1.6 / 6, "brick_height": 1.0 / 7, "depth": 0.4,
            "settling": [0.8, 1.6], "openings": [DOOR | {"x": 0.6, "width": 0.4, "height": 4.0 / 7}],
        },
        (0.6, 0.7),
    ),
    "wall": Structure(
        "wall",
        {"bricks": 5, "courses": 4, "brick_length": 0.48, "brick_height": 0.24, "depth": 0.4, "settling": [0.0, 2.4]},
        {"bricks": 6, "courses": 5, "brick_length": 0.4, "brick_height": 0.2, "depth": 0.4, "settling": [0.0, 2.4]},
        (0.6, 0.7),
    ),
}  # fmt: skip

RIGHT, LEFT, DOWN = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0)


def _cases() -> list[Case]:
    found = []
    for name, left, right in (
        ("arch", "left springer", "right springer"),
        ("segmental arch", "left springer", "right springer"),
        ("portal", "ground left", "ground right"),
        ("wall with a door", "ground left", "ground right"),
    ):
        found += [
            Case(name, f"{right} moves right", {right: RIGHT}, 0.012),
            Case(name, f"{right} moves down", {right: DOWN}, 0.02),
            Case(name, f"{left} moves down", {left: DOWN}, 0.008),
        ]
    found += [
        Case("arch", "left springer moves right", {"left springer": RIGHT}, 0.015),
        Case("segmental arch", "left springer moves right", {"left springer": RIGHT}, 0.01),
        Case("portal", "ground right moves left", {"ground right": LEFT}, 0.015),
        Case("wall", "a trough of the ground", Profile("gaussian", 1.1, 0.45), 0.012),
        Case("wall", "a trough of the ground", Profile("gaussian", 0.35, 0.5), 0.015),
        Case("wall", "a trough of the ground", Profile("gaussian", 2.2, 0.6), 0.02),
        Case("wall", "the ground slopes down to the right", Profile("points", points=((1.3, 0.0), (2.4, 1.0))), 0.015),
        Case("wall", "the ground slopes down to the left", Profile("points", points=((0.0, 1.0), (0.9, 0.0))), 0.01),
    ]
    return found


def observed(structure: Structure, case: Case, seed: int) -> list[dict[str, Any]]:
    """Make the rows of a table of observations: widths with noise, at the middles of joints of the real blocks."""
    assembly = generators.build(structure.layout, dict(structure.real))
    assembly = assembly.with_roles(np.where(assembly.free, solver.FREE, solver.MOVING))
    supports = np.flatnonzero(~assembly.free).tolist()
    motions = case.motion
    if isinstance(motions, Profile):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            assembly = cut_ground(assembly, (), chosen=supports)
        pieces = np.flatnonzero(~assembly.free).tolist()
        motions = motions.motions(assembly, pieces, (0.0, -1.0))
    else:
        roles = assembly.roles.copy()
        roles[[i for i in supports if assembly.names[i] not in motions]] = solver.FIXED
        assembly = assembly.with_roles(roles)
    settlement = solver.Settlement(profile=motions, increment=case.amount / INCREMENTS, limit=case.amount)
    controls = solver.Controls(falling_frames=0)
    response = solver.settle(assembly, settlement, friction_coefficient=structure.friction[1], controls=controls)
    if response.stop is not solver.Status.LIMIT_REACHED:
        raise RuntimeError(f"{case} is no case: {response.message}")
    joints = initial_joints(assembly)
    ends = end_openings(assembly, joints, response.path[-1].pose)
    random = np.random.default_rng(seed)
    rows, closed = [], 0
    for line, both in zip(joints.ends, ends, strict=True):
        for share in AT:
            x, y = (line[0] + share * (line[1] - line[0])).tolist()
            opening = float(both[0] + share * (both[1] - both[0]))
            width = opening * (1.0 + NOISE * float(random.standard_normal()))
            if opening < SEEN:
                closed += 1
                if closed % EVERY_CLOSED:
                    continue
            said = "closed" if opening < SEEN else round(1e3 * max(width, 0.0), 2)
            rows.append({"x": x, "y": y, "width [mm]": said})
    return rows


def case_text(structure: Structure) -> str:
    """Write the case file that the inverse assumes."""
    return "\n".join(
        [
            "[geometry]",
            f'layout = "{structure.layout}"',
            f"parameters = {as_toml(dict(structure.assumed))}",
            "[material]",
            f"friction_coefficient = {structure.friction[0]}",
        ]
    )


CASES = _cases()


def tried(number: int, runs: dict[str, Any], seed: int = 2026) -> dict[str, Any]:
    """Explain one of the cases; the runs of a structure serve all of its cases."""
    case = CASES[number]
    structure = STRUCTURES[case.structure]
    rows = observed(structure, case, seed + number)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        file = Path(folder) / "case.toml"
        file.write_text(case_text(structure), encoding="utf-8")
        found = blockvis.explain(file, rows, runs=runs.setdefault(case.structure, {}))
    best = found.causes[0]
    names = [cause.name for cause in found.causes]
    rank = next((k for k, c in enumerate(found.causes, start=1) if case.cause in (c.name, *c.also)), 0)
    return {
        "case": case,
        "rows": rows,
        "found": found,
        "first": best.name,
        "names": names,
        "rank": rank,
        "probability": best.probability,
        "amount": best.amount,
        "off": best.amount[1] / case.amount - 1.0,
    }


def main() -> None:
    """Print the table."""
    chosen = [int(word) for word in sys.argv[1:]] or list(range(len(CASES)))
    runs: dict[str, Any] = {}
    first = close = 0
    print("| # | structure | cause | mm | seen | found first | its probability | amount, mm (5 % to 95 %) | off |")
    print("|---|---|---|---|---|---|---|---|---|")
    for number in chosen:
        started = time.perf_counter()
        result = tried(number, runs)
        case, (low, middle, high) = result["case"], (1e3 * value for value in result["amount"])
        right = result["rank"] == 1
        first += right
        close += right and abs(result["off"]) <= 0.25
        seen = sum(row["width [mm]"] != "closed" for row in result["rows"])
        said = "yes" if right else f"{result['first']} (rank {result['rank']})"
        print(
            f"| {number} | {case.structure} | {case.cause} | {1e3 * case.amount:.3g} | {seen} | {said} | "
            f"{result['probability']:.3f} | {middle:.3g} ({low:.3g} to {high:.3g}) | {100.0 * result['off']:+.0f} % |",
            flush=True,
        )
        print(f"{number}: {time.perf_counter() - started:.0f} s", file=sys.stderr, flush=True)
    print(f"\ncause first in {first} of {len(chosen)}, and its amount within 25 % in {close}")


if __name__ == "__main__":
    main()
