"""Loads of a case: self-weight, dead and live loads, and a live load that moves."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

import solver
from blockvis.formats.reading import naming
from blockvis.layout.outlines import ROUNDING
from blockvis.text import force_text

from .block_at import block_at, blocks_matching, note_outside


@dataclass(frozen=True)
class LoadCase:
    """One entry of ``[[loads]]``, by its keys [N, N·m, Pa, m].

    Directions, forces and points have two coordinates, in space three, and so has a moment there. ``edge`` counts from
    1, counter-clockwise from the first corner; ``positions`` are the places x of a load that moves, none of others.
    """

    kind: str = "dead"
    blocks: str = "*"
    weight_fraction: tuple[float, ...] | None = None
    force: tuple[float, ...] = (0.0, 0.0)
    point: tuple[float, ...] | None = None
    moment: float | tuple[float, float, float] = 0.0
    pressure: float | None = None
    direction: tuple[float, float] = (0.0, -1.0)
    edge: int | None = None
    positions: tuple[float, ...] = ()
    y: float | None = None
    phase: int = 1

    @property
    def has_force(self) -> bool:
        """Whether the force is not zero."""
        return any(self.force)

    @property
    def has_moment(self) -> bool:
        """Whether the moment is not zero."""
        return bool(np.any(self.moment))


def loads_of(
    entries: Sequence[LoadCase], assembly: solver.Assembly, source: Path, gone: np.ndarray, phase: int | None = None
) -> solver.Loads:
    """Sum self-weight and the loads [N, N·m] that do not move and act from the start, or with a settlement.

    Of a ``phase``, counted from 1, all loads that begin to act with it, without self-weight. Blocks that are ``gone``
    by then, (n_blocks,) bool array, neither carry loads nor shield others. ValueError for a pattern that matches no
    free block that is left, a point in none of those it matches, a pressure that meets none of them first, and for an
    edge that a block does not have.
    """
    loads = solver.self_weight(assembly)
    # Loads of the drawing act on it before anything is taken away, but for a pressure, which meets what is left.
    taken = gone if phase is not None else np.zeros_like(gone)
    if phase is not None:
        loads = replace(loads, dead=np.zeros_like(loads.dead))
    for number, load in enumerate(entries):
        if load.positions or load.phase != (phase or 1):
            continue
        named = _named(load, assembly, taken, f"{source}: [loads {number + 1}] blocks")
        chosen = named[~taken[named]]
        if load.weight_fraction is not None:
            loads = loads.with_acceleration(assembly, load.weight_fraction, load.kind, chosen)
        for block in _loaded(load, named, taken, assembly, f"{source}: [loads {number + 1}]"):
            moment = solver.point_load(assembly, block, moment=load.moment)
            loads = replace(loads, **{load.kind: getattr(loads, load.kind) + moment})
            if load.has_force:
                point = assembly.centroids[block] if load.point is None else load.point
                loads = loads.with_forces(assembly, solver.PointForces.at(block, load.force, point), load.kind)
        if load.pressure is not None and load.edge is None:
            forces = solver.surface_forces(assembly, load.pressure, load.direction, blocks=chosen, removed=gone)
            if len(forces.block) == 0:
                raise ValueError(
                    f"{source}: [loads {number + 1}] pressure along {list(load.direction)} meets none of "
                    f"'{load.blocks}': other blocks are before them; name those that it meets first, or give force"
                )
            loads = loads.with_forces(assembly, forces, load.kind)
        if load.pressure is not None and load.edge is not None:
            for block in chosen:
                has = len(assembly.outline(block))
                if load.edge > has:
                    raise ValueError(
                        f"{source}: [loads {number + 1}] edge is {load.edge}; block '{assembly.names[block]}' has "
                        f"edges 1 to {has}"
                    )
                forces = solver.edge_force(assembly, block, load.edge - 1, load.pressure)
                loads = loads.with_forces(assembly, forces, load.kind)
    return loads


def moving_loads(
    entries: Sequence[LoadCase], assembly: solver.Assembly, source: Path
) -> tuple[np.ndarray, Callable[[int], solver.PointForces]]:
    """Find the loads that move together: (n,) positions [m] of the first, none where none does, and all there.

    ValueError for a position above no block, or above a support.
    """
    moving = [(number, load) for number, load in enumerate(entries, start=1) if load.positions]

    def on_top(load: LoadCase, x: float) -> solver.PointForces:
        if assembly.dimension == 2:
            return solver.force_on_top(assembly, x, load.force)
        return _force_on_top_in_space(assembly, x, load.y or 0.0, load.force)

    def at(k: int) -> solver.PointForces:
        each = [on_top(load, load.positions[k]) for _, load in moving]
        return solver.PointForces(*(np.concatenate([getattr(one, f.name) for one in each]) for f in fields(each[0])))

    for number, load in moving:
        with naming(f"{source}: [loads {number}] positions"):
            for x in load.positions:
                on_top(load, x)
    return np.array(moving[0][1].positions if moving else ()), at


def _force_on_top_in_space(assembly: solver.Assembly, x: float, y: float, force: Sequence[float]) -> solver.PointForces:
    """Put a force, (3,) [N], on the topmost surface at a place in plan [m].

    Of blocks that meet there at one height the one with the smallest x carries it. ValueError where nothing is
    below, or a support.
    """
    parts = assembly.polyhedra.parts
    faces, starts = parts.solids.faces(parts.solids.vertices), parts.solids.faces_of_block[:-1]
    near = ROUNDING * assembly.block_size
    normals, rise = faces.normals, faces.normals[:, 2]
    beyond = ((np.array([x, y]) - faces.middles[:, :2]) * normals[:, :2]).sum(axis=1)
    # A convex part is where the vertical line is behind all of its faces.
    steep = np.abs(rise) <= 1e-9
    level = faces.middles[:, 2] - beyond / np.where(steep, 1.0, rise)
    top = np.minimum.reduceat(np.where(~steep & (rise > 0.0), level, np.inf), starts)
    bottom = np.maximum.reduceat(np.where(~steep & (rise < 0.0), level, -np.inf), starts)
    outside = np.maximum.reduceat(np.where(steep, beyond, -np.inf), starts)
    height = np.where((outside <= near) & (bottom <= top + near), top, -np.inf)
    highest = float(height.max())
    if not np.isfinite(highest):
        low, high = assembly.vertices.min(axis=0), assembly.vertices.max(axis=0)
        raise ValueError(
            f"nothing is below a load at x = {x:g}, y = {y:g} m; the structure reaches from x = {low[0]:g} to "
            f"{high[0]:g} m and from y = {low[1]:g} to {high[1]:g} m"
        )
    meeting = np.unique(parts.block_of_part[height >= highest - near])
    owner = int(meeting[np.lexsort(assembly.centroids[meeting].T[::-1])[0]])
    if not assembly.free[owner]:
        raise ValueError(f"the load at x = {x:g}, y = {y:g} m stands on the support '{assembly.names[owner]}'")
    return solver.PointForces.at(owner, force, (x, y, highest))


def with_moving_load(
    loads: solver.Loads, entries: Sequence[LoadCase], assembly: solver.Assembly, source: Path, x: float | None
) -> solver.Loads:
    """Add the load that moves, at its place nearest to x [m]; without x or such a load return the loads unchanged."""
    places, live = moving_loads(entries, assembly, source)
    if x is None or len(places) == 0:
        return loads
    return loads.with_forces(assembly, live(int(np.argmin(np.abs(places - x)))), "live")


def _loaded(load: LoadCase, named: np.ndarray, gone: np.ndarray, assembly: solver.Assembly, where: str) -> list[int]:
    """List the blocks on which a force or moment acts: with a point, the one that holds it."""
    if not (load.has_force or load.has_moment):
        return []
    if load.point is not None and len(named) > 1:
        towards = load.force if load.has_force else (0.0,) * assembly.dimension
        return [block_at(assembly, load.point, named, towards, f"{where} point", gone)]
    chosen = named[~gone[named]]
    if load.point is not None:
        note_outside(assembly, load.point, int(chosen[0]), f"{where} point", "on which the force acts")
    if load.has_force and len(chosen) > 1:
        total = len(chosen) * float(np.linalg.norm(load.force))
        warnings.warn(
            f"{where} acts on each of {len(chosen)} blocks that blocks = '{load.blocks}' names, {force_text(total)} in "
            "all; give a point for one force",
            stacklevel=2,
        )
    return chosen.tolist()


def _named(load: LoadCase, assembly: solver.Assembly, gone: np.ndarray, where: str) -> np.ndarray:
    named = blocks_matching(load.blocks, assembly, where)
    chosen = [i for i in named if assembly.free[i]]
    if not chosen:
        raise ValueError(f"{where} '{load.blocks}' matches supports only; loads act on free blocks: name one")
    if gone[chosen].all():
        raise ValueError(
            f"{where} '{load.blocks}' matches only what [[remove]] has taken away before settlement {load.phase}, from "
            "which on the load acts; name a block that is left, or leave the load out"
        )
    return np.array(chosen)
