"""The loads of an increment as a picture shows them: where they act and how much."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

import solver
from blockvis.results.ties import ties_at
from blockvis.text import force_text
from solver import mechanics

from . import palette
from .marks import leaving
from .solid_view import into_sight, kept_blocks

#: Loads below this fraction of the largest are rounding.
ROUNDING = 1e-5

#: Arrows of at most so many loads, in space of the largest. In the plane those of more are resultants, each of a cell
#: of a grid; in space these would lie inside the structure.
MOST_ARROWS = 100


@dataclass(frozen=True)
class ActingLoad:
    """Dead loads, or live ones times their multiplier, in its sign: forces (n, d) [N] at points (n, d) [m].

    Each acts on one of the blocks (n,), or on several, of which it is the resultant and one is given. In space they may
    be the largest of all that act, ``n_acting``.
    """

    points: np.ndarray
    forces: np.ndarray
    blocks: np.ndarray
    pose: solver.Pose
    n_acting: int = 0

    def carried(self, pose: solver.Pose) -> np.ndarray:
        """(n, d) array [m]: where the points are when all blocks are at another pose."""
        return mechanics.carried(self.points, self.blocks, self.pose, pose)

    @property
    def largest(self) -> float:
        """Size of the largest force [N]."""
        return float(np.linalg.norm(self.forces, axis=1).max(initial=0.0))


def live_load_of(response: solver.Response, increment: solver.Increment, extent: float) -> ActingLoad:
    """Live load of an increment; none in a settlement, in a fall, or where it is unbounded.

    It is found as what contacts and ties balance beyond the dead load: the increment does not store the position of a
    load that moves. ``extent`` [m] is that of the picture.
    """
    standing = increment.status == solver.Status.EQUILIBRIUM
    finite = np.isfinite(increment.load_multiplier) and increment.load_multiplier != 0.0
    assembly, pose = response.assembly, increment.pose
    if not (standing and finite):
        nowhere = np.zeros((0, assembly.dimension))
        return ActingLoad(nowhere, nowhere, np.zeros(0, dtype=int), pose)
    dead = response.dead_at(increment)
    live = -(mechanics.block_forces(increment.contacts, pose, increment.forces) + dead + _of_ties(response, increment))
    # What is out of balance would be a load, too, where a pushover ends with hardly any.
    unbalanced = increment.certificate.equilibrium_residual * np.abs(dead[assembly.free, : assembly.dimension]).sum()
    given = response.loads_at(increment)
    return _acting(response, increment, live, (given.live, given.live_arms), 2.0 * unbalanced, extent)


def dead_load_of(response: solver.Response, increment: solver.Increment, extent: float) -> ActingLoad:
    """Dead load of an increment beside weight and fill; ``extent`` [m] is that of the picture."""
    weight, given = solver.self_weight(response.assembly).dead, replace(response.loads_at(increment), fills=())
    dead = given.dead_at(response.assembly, increment.pose) - weight
    return _acting(
        response, increment, dead, (given.dead - weight, given.dead_arms), ROUNDING * np.abs(weight).max(), extent
    )


def _acting(
    response: solver.Response,
    increment: solver.Increment,
    loads: np.ndarray,
    given: tuple[np.ndarray, np.ndarray | None],
    least: float,
    extent: float,
) -> ActingLoad:
    """Find where loads (n_blocks, n_dof) [N, N·m] above the least [N] act; given are they as drawn, and their arms."""
    assembly, pose = response.assembly, increment.pose
    loads[~assembly.free | increment.fallen] = 0.0
    forces = loads[:, : assembly.dimension]
    size = np.linalg.norm(forces, axis=1)
    blocks = acting = np.flatnonzero(size > max(ROUNDING * np.abs(loads).max(initial=0.0), least))
    if assembly.dimension == 3:
        blocks = _largest(acting, size[acting])
        # The moment about the centroid tells the line on which a load acts, all but its place along that.
        units = forces[blocks] / size[blocks, None]
        arms = np.cross(units, loads[blocks, 3:] / size[blocks, None])
        points = leaving(assembly, pose, blocks, pose.positions[blocks] + arms, -units)
    else:
        drawn, turning = given[0], np.zeros(len(loads)) if given[1] is None else given[1]
        # A load without an arm that is known acts on the mass of its block, or at its centroid.
        inside = [bool(drawn[b, :2].any()) and not turning[b].any() for b in blocks.tolist()]
        entries = zip(blocks.tolist(), inside, strict=True)
        points = np.reshape([_entry(assembly, pose, b, loads[b], inside=within) for b, within in entries], (-1, 2))
    load = ActingLoad(points, forces[blocks], blocks, pose, len(acting))
    return load if len(blocks) <= MOST_ARROWS else _gathered(load, 0.12 * extent)


def _largest(numbers: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Numbers (m,) of the largest of sizes (n,), in their order; of those alike within a tenth evenly chosen ones."""
    part = sizes / sizes.max(initial=0.0)
    # Of numbers that go round a circle by the golden section the first few lie evenly among all.
    first = np.lexsort((np.arange(len(part)) * 0.618034 % 1.0, -part.round(1), part < 0.99))
    return np.asarray(numbers[np.sort(first[:MOST_ARROWS])])


def _of_ties(response: solver.Response, increment: solver.Increment) -> np.ndarray:
    """(n_blocks, n_dof) array [N, N·m]: what ties, props and bars do to the blocks."""
    ties, assembly = response.ties, response.assembly
    forces = ties_at(ties, assembly, increment).forces
    lengths = np.where(forces == 0.0, np.nan, 1.0)
    members = mechanics.member_contacts(
        ties, assembly, increment.pose, lengths, mechanics.present_members(ties, lengths)
    )
    pushes = np.zeros(members.points.shape)
    pushes[:, 0] = forces[members.features[:, 1]] * np.where(members.features[:, 2] == 1, -1.0, 1.0)
    # Of the two senses of a bar one carries, as do a tie and a prop.
    return mechanics.block_forces(members, increment.pose, np.maximum(pushes, 0.0))


class LoadArrows:
    """The live, or dead, loads of some increments as arrows to one scale, which end where the loads act.

    The increments are gone through once; ``extent`` [m] is that of the picture, and a plane (2, 3), a point [m] and a
    normal, cuts its blocks open.
    """

    def __init__(
        self,
        response: solver.Response,
        increments: Iterable[solver.Increment],
        extent: float,
        plane: np.ndarray | None = None,
        *,
        dead: bool = False,
    ) -> None:
        self._dead, self._dimension = dead, response.assembly.dimension
        self._swinging = bool(response.limits) and response.collapse is None
        self._loads: dict[tuple[int, float], ActingLoad] = {}
        self._multipliers: dict[tuple[int, float], float] = {}
        if dead or response.measured == mechanics.LOAD_MULTIPLIER:
            # Frames of a swinging mechanism have the load of their limit state.
            states = {_place(state): state for state in response.path}
            for increment in increments:
                place = _place(increment)
                if place not in self._loads:
                    state = states.get(place, increment)
                    load = (dead_load_of if dead else live_load_of)(response, state, extent)
                    self._loads[place] = _in_section(load, response.assembly, plane)
                    self._multipliers[place] = 0.0 if dead else state.load_multiplier
        self._places = not dead and not response.parameter.is_path and len(self._loads) > 1
        if self._places:
            # The limit varies a hundredfold from place to place: all arrows get one length and show the place alone.
            for place, load in self._loads.items():
                self._loads[place] = replace(load, forces=load.forces / (load.largest or 1.0))
        self.largest = max((load.largest for load in self._loads.values()), default=0.0)
        together = max((float(np.linalg.norm(load.forces)) for load in self._loads.values()), default=0.0)
        # Of more than 24 equal loads long arrows are too close.
        self._scale = 0.11 * extent / (max(self.largest, together / 24**0.5) or 1.0)

    @property
    def words(self) -> str:
        """Entry of the legend; lengths in space are foreshortened and have no scale."""
        acting, drawn = max(((load.n_acting, len(load.blocks)) for load in self._loads.values()), default=(0, 0))
        what = "dead load" if self._dead else "live load · α"
        if self._dimension == 3:
            return what + (f", {drawn} of {acting} loads" if drawn < acting else "")
        scale = " (not to scale)" if self._places else f", longest arrow {force_text(self.largest)}"
        return f"{what}{', resultants of neighbours' if drawn < acting else ''}{scale}"

    @property
    def tails(self) -> np.ndarray:
        """(n, d) array [m]: where the arrows of all increments begin, at their poses."""
        tails = [load.points - self._drawn(load) for load in self._loads.values()]
        return np.concatenate([np.zeros((0, self._dimension)), *tails])

    def arrows(self, increment: solver.Increment, pose: solver.Pose) -> tuple[np.ndarray, np.ndarray]:
        """Tails and tips (n, d) [m] of one of the increments, or of a state between two; none in a fall.

        Its blocks are drawn at ``pose``.
        """
        nothing = np.zeros((0, self._dimension))
        if self.largest == 0.0 or (increment.status == solver.Status.FALLING and not self._swinging):
            return nothing, nothing
        load, grown = self._load_at(increment)
        tips = load.carried(pose)
        return tips - grown * self._drawn(load), tips

    def _drawn(self, load: ActingLoad) -> np.ndarray:
        """(n, d) array [m]: arrows to scale, but for those that would be too short."""
        sizes, largest = np.linalg.norm(load.forces, axis=1), load.largest or 1.0
        longer = np.maximum(sizes, 0.125 * largest) / np.maximum(sizes, ROUNDING * largest)
        return np.asarray(self._scale * longer[:, None] * load.forces)

    def _load_at(self, increment: solver.Increment) -> tuple[ActingLoad, float]:
        """Find the load of an increment and by what it has grown: between two of a path it is the one before's."""
        if _place(increment) in self._loads:
            return self._loads[_place(increment)], 1.0
        before = max(place for place in self._loads if place <= _place(increment))
        multiplier = self._multipliers[before]
        return self._loads[before], increment.load_multiplier / multiplier if multiplier else 1.0


def load_arrows(
    response: solver.Response, increments: Sequence[solver.Increment], extent: float, plane: np.ndarray | None = None
) -> dict[str, LoadArrows]:
    """Give the arrows of each kind of load, as the palette names them, of which there are any."""
    found = {kind: LoadArrows(response, increments, extent, plane, dead=kind == "dead") for kind in palette.LOADS}
    return {kind: loads for kind, loads in found.items() if loads.largest > 0.0}


def _in_section(load: ActingLoad, assembly: solver.Assembly, plane: np.ndarray | None) -> ActingLoad:
    """Leave out the loads of blocks that a section leaves out; those on cut-off parts of others act on its plane."""
    kept = kept_blocks(plane, assembly, load.pose)[load.blocks]
    points = load.points[kept]
    points = points + into_sight(plane, points)
    return replace(load, points=points, forces=load.forces[kept], blocks=load.blocks[kept])


def _place(increment: solver.Increment) -> tuple[int, float]:
    return increment.phase, increment.parameter


def _entry(assembly: solver.Assembly, pose: solver.Pose, block: int, load: np.ndarray, *, inside: bool) -> np.ndarray:
    """Where the line of a load enters its block; the centroid, where it acts inside and has no moment about that."""
    centre, force, moment = pose.positions[block], load[:2], float(load[2])
    size = float(np.hypot(*force))
    if inside and abs(moment) < 1e-3 * size * assembly.block_size:
        return centre
    through = centre + moment / size**2 * np.array([force[1], -force[0]])
    corners = mechanics.moved_vertices(assembly, pose)[assembly.offsets[block] : assembly.offsets[block + 1]]
    unit = force / size
    reach = float(np.linalg.norm(corners - through, axis=1).max()) * unit
    line = shapely.LineString([through - reach, through + reach])
    crossed = shapely.get_coordinates(shapely.intersection(shapely.Polygon(corners), line))
    # A moment too large for its force: its line passes beside the block.
    return np.asarray(through + ((crossed - through) @ unit).min() * unit) if len(crossed) else centre


def _gathered(load: ActingLoad, cell: float) -> ActingLoad:
    """Resultants of the loads in each cell of a grid, at the load nearest to where their weights meet.

    Where they meet itself may lie in an opening.
    """
    points, forces = load.points, load.forces
    place = np.floor((points - points.min(axis=0)) / cell).astype(np.int64)
    cells, which = np.unique(place, axis=0, return_inverse=True)
    which, n = which.ravel(), len(cells)
    size = np.hypot(*forces.T)
    weight = np.bincount(which, weights=size, minlength=n)
    sums = [np.bincount(which, weights=forces[:, k], minlength=n) for k in (0, 1)]
    middles = [np.bincount(which, weights=size * points[:, k], minlength=n) / weight for k in (0, 1)]
    away = np.linalg.norm(points - np.stack(middles, axis=1)[which], axis=1)
    order = np.lexsort((away, which))
    nearest = order[np.searchsorted(which[order], np.arange(n))]
    return replace(load, points=points[nearest], forces=np.stack(sums, axis=1), blocks=load.blocks[nearest])
