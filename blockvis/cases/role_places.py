"""Roles by place, for drawings whose blocks have no names: what lies below a height, touches a plane or is in a box."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from blockvis.layout.layout import Layout
from blockvis.layout.repair import DRAWN_GAP
from solver import mechanics

from .toml_table import Table, is_number, shortened

#: Keys of [roles] that choose blocks by their place.
PLACES = ("below", "touching", "box")

#: What is said to whoever means blocks in space, where a drawing of bodies side by side was read as one in the plane.
INTO_SPACE = "or take the blocks into space by dimension = 3 under [geometry]"


@dataclass(frozen=True)
class RolePlace:
    """A role of the blocks in some place, one of :data:`PLACES`, with limits of coordinates [m].

    The middle of a block has to lie below or in the box, or a block has to reach a plane.
    """

    kind: str
    ranges: tuple[tuple[str, float, float], ...]
    role: str
    where: str


def read_places(roles: Table) -> tuple[RolePlace, ...]:
    """Read the roles by place of ``[roles]``; ValueError for a place that is not understood."""
    return tuple(
        _place(kind, table, f"{roles.source}: [roles] {kind}")
        for kind in PLACES
        if not isinstance(roles.values.get(kind), str)
        for table in roles.tables(kind)
    )


def _place(kind: str, table: Table, where: str) -> RolePlace:
    role = table.text("role", mechanics.FIXED, among=mechanics.ROLES)
    ranges = []
    for axis in ("x", "y", "z"):
        value = table.take(axis)
        if value is None:
            continue
        if kind == "box":
            if not (isinstance(value, list) and len(value) == 2 and all(map(is_number, value)) and value[0] < value[1]):
                raise ValueError(f"{where}: {axis} is {shortened(value)}; give two numbers, the smaller first")
            ranges.append((axis, float(value[0]), float(value[1])))
        elif not is_number(value):
            raise ValueError(f"{where}: {axis} is {shortened(value)}; give a number, in m")
        else:
            ranges.append((axis, -np.inf if kind == "below" else float(value), float(value)))
    table.finish()
    if not ranges:
        example = "x = [0.0, 1.0]" if kind == "box" else "z = 0.1"
        raise ValueError(f"{where} names no coordinate; write {kind} = {{ {example} }}")
    return RolePlace(kind, tuple(ranges), role, where)


def with_roles_by_place(layout: Layout, places: Sequence[RolePlace]) -> Layout:
    """Give the blocks of a layout the roles of their places, over what the file says, a later one over an earlier.

    ValueError for a place with no block, or all of them, and for a coordinate that the layout does not have.
    """
    if not places:
        return layout
    lows = np.array([corners.min(axis=0) for corners in layout.every_corner])
    highs = np.array([corners.max(axis=0) for corners in layout.every_corner])
    near = DRAWN_GAP * float(np.median(layout.sizes))
    axes = "xy" if layout.dimension == 2 else "xyz"
    roles = list(layout.roles)
    for place in places:
        chosen = np.ones(layout.n_blocks, dtype=bool)
        for axis, least, most in place.ranges:
            if axis not in axes:
                raise ValueError(
                    f"{place.where}: a drawing in the plane has no {axis}; give its height y, {INTO_SPACE}"
                )
            low, high = lows[:, axes.index(axis)], highs[:, axes.index(axis)]
            if place.kind != "touching":
                low = high = (low + high) / 2.0
            chosen &= (low <= most + near) & (high >= least - near)
        if not chosen.any() or chosen.all():
            what = "every block" if chosen.any() else "no block"
            ends = zip(axes, lows.min(axis=0) + 0.0, highs.max(axis=0) + 0.0, strict=True)
            extent = ", ".join(f"{axis} {low:.4g} to {high:.4g}" for axis, low, high in ends)
            raise ValueError(f"{place.where} holds {what}; the drawing reaches over {extent} m")
        roles = [place.role if here else role for here, role in zip(chosen, roles, strict=True)]
    return replace(layout, roles=tuple(roles))
