"""Numbers of a case against its blocks: two in the plane, three in space."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import solver
from solver.mechanics import counted

from .contents import Case
from .role_places import INTO_SPACE


def check_coordinates(case: Case, assembly: solver.Assembly) -> None:
    """Refuse directions, points and forces of two numbers for blocks in space, and of three in the plane.

    ValueError names the key, and how many numbers it needs.
    """
    d = assembly.dimension
    control = case.settings if isinstance(case.settings, solver.ControlDisplacement) else None
    given = [("control", key, getattr(control, key, None)) for key in ("direction", "point")]
    for tie in case.ties:
        given += [(f"ties '{tie.name}'", key, end.point) for key, end in zip(("from", "to"), tie.ends, strict=False)]
    for table, key, numbers in (*_of_settlements(case, d), *_of_loads(case, d), *given):
        if numbers is not None and len(numbers) != d:
            wanted = "three numbers [x, y, z]" if d == 3 else f"two numbers [x, y], {INTO_SPACE}"
            raise ValueError(
                f"{case.source}: [{table}] {key} has {counted(len(numbers), 'number')}, but the blocks are "
                f"{_where(d)}; give {wanted}"
            )
    if d == 3:
        _refuse_plane_keys(case)


def _where(d: int) -> str:
    return "in space" if d == 3 else "in the plane"


def _of_settlements(case: Case, d: int) -> Iterator[tuple[str, str, Any]]:
    """Table, key and numbers of the directions and points of settlements of d dimensions."""
    for k, settlement in enumerate(case.settlements, start=1):
        table = f"settlement {k}" if len(case.settlements) > 1 else "settlement"
        motions = list((settlement.profile or {}).values())
        if (d == 3 and any(case.profiles[k - 1 : k])) or (motions and len(motions[0]) != 3 * (d - 1)):
            raise ValueError(
                f"{case.source}: [{table}] profile belongs to blocks {_where(5 - d)}; "
                + (
                    "in space give a direction, or the motion of each of its supports, [dx, dy, dz, rx, ry, rz]"
                    if d == 3
                    else "in the plane the motion of a support is [dx, dy, rotation]"
                )
            )
        for key in ("rotation_axis", "radial_from"):
            if d == 2 and getattr(settlement, key) is not None:
                raise ValueError(
                    f"{case.source}: [{table}] {key} belongs to blocks in space: leave it out, {INTO_SPACE}"
                )
        yield from ((table, key, getattr(settlement, key)) for key in ("direction", "rotation_centre"))


def _of_loads(case: Case, d: int) -> Iterator[tuple[str, str, Any]]:
    """Table, key and numbers of the forces and points of loads on blocks of d dimensions."""
    for k, load in enumerate(case.loads, start=1):
        table = f"loads {k}" if len(case.loads) > 1 else "loads"
        if load.has_moment and (d == 3) != isinstance(load.moment, tuple):
            wanted = "three numbers [mx, my, mz]" if d == 3 else f"one number, {INTO_SPACE}"
            raise ValueError(f"{case.source}: [{table}] moment: the blocks are {_where(d)}; give {wanted}")
        if d == 3 and load.pressure is not None:
            raise ValueError(f"{case.source}: [{table}] pressure belongs to blocks in the plane; in space give forces")
        if d == 3 and load.positions and load.y is None:
            raise ValueError(f"{case.source}: [{table}] positions: the blocks are in space; add the line's y = ... [m]")
        if d == 2 and load.y is not None:
            raise ValueError(f"{case.source}: [{table}] y is that of positions in space: leave it out, {INTO_SPACE}")
        yield table, "weight_fraction", load.weight_fraction
        yield table, "force", load.force if load.has_force else None
        yield table, "point", load.point


def _refuse_plane_keys(case: Case) -> None:
    """Refuse keys that belong to blocks in the plane."""
    for key, is_given in (
        ("closing", case.closing != "auto"),
        ("outline_tolerance", case.outline_tolerance is not None),
        # Of a drawing that dimension = 3 sets up it is the depth.
        ("thickness", case.thickness is not None and case.dimension != 3),
    ):
        if is_given:
            raise ValueError(f"{case.source}: [geometry] {key} belongs to outlines in the plane; leave it out in space")
    if any(one.kind == "vertices" for one in case.imperfections):
        raise ValueError(
            f"{case.source}: [imperfections] kind 'vertices' belongs to blocks in the plane; in space friction and "
            "density can scatter"
        )
