"""Assembly: shapes, names, roles, densities and materials of all blocks."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from solver.words import Kept, counted, kept, numbers_of, plain

from .geometry.contacts import Contacts
from .geometry.outlines import self_crossings
from .geometry.polygons import Polygons
from .geometry.polyhedra import Polyhedra
from .geometry.surfaces import SMALLEST_SHAPE_FACTOR, polyhedra_of, refuse_infinite
from .tolerances import DRAWN_GAP, PENETRATION_FRACTION
from .views import Shown

#: The shapes of all blocks, in the plane or in space: their sizes, and their contact points.
Shapes = Polygons | Polyhedra

FREE, FIXED, MOVING = ROLES = ("free", "fixed", "moving")


@dataclass(frozen=True, eq=False)
class Assembly(Kept, Shown):
    """Rigid blocks of a masonry structure, supports included.

    :meth:`from_outlines` and :meth:`from_solids` make one. Arrays are only read: for another density take
    ``dataclasses.replace``, which checks it.

    Attributes
    ----------
    shapes : Shapes
        Of the blocks as drawn: :class:`Polygons` in the plane, :class:`Polyhedra` in space.
    names : tuple of str
        One name per block, all different.
    drawn_names : tuple of str
        As given; blocks drawn with one name are ``"pier"``, ``"pier #2"`` in ``names``.
    roles : (n_blocks,) str array
        ``"free"``, ``"fixed"`` or ``"moving"``.
    density : (n_blocks,) array [kg/m³]
    materials : tuple of str
        One material per block; pairs of materials choose the law of an interface.
    """

    shapes: Shapes
    names: tuple[str, ...]
    drawn_names: tuple[str, ...]
    roles: np.ndarray
    density: np.ndarray
    materials: tuple[str, ...]

    def __post_init__(self) -> None:
        """Check that each block has a name of its own, a role, a material and a density."""
        n = len(self.shapes.offsets) - 1
        labels = _labels(n, "blocks", self.names, list(self.roles), self.materials)
        labels["drawn_names"] = self.drawn_names
        vars(self).update(labels, density=_positive(self.density, "density", "kg/m³", labels["names"]))
        super().__post_init__()

    @classmethod
    def from_outlines(
        cls,
        outlines: Sequence[ArrayLike],
        *,
        names: Sequence[str] | None = None,
        roles: Sequence[str] | None = None,
        density: ArrayLike = 2000.0,
        thickness: ArrayLike = 1.0,
        materials: Sequence[str] | None = None,
    ) -> Assembly:
        """Build an assembly from one closed outline per block.

        Parameters
        ----------
        outlines : sequence of (n, 2) arrays [m]
            Corners of each block in order, either sense of rotation, first corner not repeated.
        names : sequence of str, optional
            Defaults to ``"block 0"``, ``"block 1"`` ...; a name used twice gets a number.
        roles : sequence of {"free", "fixed", "moving"}, optional
        density : float or (n_blocks,) array [kg/m³]
        thickness : float or (n_blocks,) array [m]
        materials : sequence of str, optional

        Raises
        ------
        ValueError
            For an outline with fewer than three corners, with coordinates that are not finite, without
            area, crossing or touching itself, an unknown role, a density or thickness that is not positive.

        Examples
        --------
        >>> import solver
        >>> block = [[0, 0], [2, 0], [2, 1], [0, 1]]
        >>> float(solver.Assembly.from_outlines([block]).areas[0])
        2.0
        """
        labels = _labels(len(outlines), "outlines", names, roles, materials) | {"density": density}
        names = labels["names"]
        rings = [_checked_ring(outline, name) for outline, name in zip(outlines, names, strict=True)]
        offsets = np.concatenate([[0], np.cumsum([len(ring) for ring in rings])])
        drawn = Polygons(np.concatenate(rings), offsets, np.ones(len(rings)))
        areas, perimeter = drawn.areas, np.add.reduceat(drawn.edge_lengths, offsets[:-1])
        for i in np.flatnonzero(np.abs(areas) <= SMALLEST_SHAPE_FACTOR * perimeter**2).tolist():
            raise ValueError(
                f"block {i} ('{names[i]}') has an area of {abs(areas[i]):.3g} m² for a perimeter of "
                f"{perimeter[i]:.3g} m; it is a line, not a block: remove it or redraw it"
            )
        # The first corner stays the first, from which edges are counted.
        rings = [ring if area > 0 else np.roll(ring[::-1], 1, axis=0) for ring, area in zip(rings, areas, strict=True)]
        vertices = np.concatenate(rings)
        for i, (j, k) in self_crossings(vertices, offsets).items():
            a, b = vertices[offsets[i] + j], vertices[offsets[i] + k]
            raise ValueError(
                f"block {i} ('{names[i]}') crosses itself or doubles back: the edges that start at ({a[0]:.6g}, "
                f"{a[1]:.6g}) and ({b[0]:.6g}, {b[1]:.6g}) meet; order its corners around the outline"
            )
        return cls(shapes=Polygons(vertices, offsets, _positive(thickness, "thickness", "m", names)), **labels)

    @classmethod
    def from_solids(
        cls,
        solids: Sequence[tuple[ArrayLike, Sequence[Sequence[int]]]],
        *,
        names: Sequence[str] | None = None,
        roles: Sequence[str] | None = None,
        density: ArrayLike = 2000.0,
        materials: Sequence[str] | None = None,
    ) -> Assembly:
        """Build an assembly in space from one closed surface per block.

        Parameters
        ----------
        solids : sequence of (vertices, faces)
            Corners (n, 3) [m] of each block, no two at one place, and around each of its faces the numbers of the
            corners there, in the same sense seen from outside. Neighbouring faces in one plane, triangles for example,
            become one face.
        names : sequence of str, optional
            Defaults to ``"block 0"``, ``"block 1"`` ...; a name used twice gets a number.
        roles : sequence of {"free", "fixed", "moving"}, optional
        density : float or (n_blocks,) array [kg/m³]
        materials : sequence of str, optional

        Raises
        ------
        ValueError
            For a surface that is not closed, in several pieces, without volume or crossing itself, faces that run in
            different senses, a face that is not plane to a thousandth of the width of its block, coordinates that are
            not finite, an unknown role, or a density that is not positive.

        Examples
        --------
        >>> import solver
        >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 6]]
        >>> tetrahedron = corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
        >>> float(solver.Assembly.from_solids([tetrahedron]).shapes.volumes[0])
        1.0
        """
        labels = _labels(len(solids), "solids", names, roles, materials) | {"density": density}
        return cls(shapes=polyhedra_of(solids, labels["names"]), **labels)

    def __repr__(self) -> str:
        """One line with the number of blocks by role."""
        kinds = ", ".join(f"{int((self.roles == role).sum())} {role}" for role in ROLES)
        return f"<Assembly of {counted(self.n_blocks, 'block')}: {kinds}>"

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return int(self.vertices.shape[1])

    @property
    def n_blocks(self) -> int:
        """Number of blocks, supports included."""
        return len(self.names)

    @kept
    def free(self) -> np.ndarray:
        """(n_blocks,) bool array: true where the block is not a support."""
        return self.roles == FREE

    @kept
    def moving(self) -> np.ndarray:
        """(n_blocks,) bool array: true where the block is a moving support."""
        return self.roles == MOVING

    @property
    def vertices(self) -> np.ndarray:
        """(n_vertices, d) array [m]: corners of all blocks, block after block; in the plane counter-clockwise."""
        return self.shapes.vertices

    @property
    def block_of_vertex(self) -> np.ndarray:
        """(n_vertices,) int array: the block each vertex belongs to."""
        return self.shapes.block_of_vertex

    @property
    def centroids(self) -> np.ndarray:
        """(n_blocks, d) array [m], before any movement."""
        return self.shapes.centroids

    @property
    def widths(self) -> np.ndarray:
        """(n_blocks,) array [m]: thickness of each block where it is thin, near b for a long a × b."""
        return self.shapes.widths

    @kept
    def masses(self) -> np.ndarray:
        """(n_blocks,) array [kg]."""
        return self.shapes.volumes * self.density

    @kept
    def block_size(self) -> float:
        """Edge of the square or cube as large as the mean free block [m]: the length the program is scaled by."""
        return self.shapes.size(self.free if self.free.any() else ~self.free)

    @property
    def polygons(self) -> Polygons:
        """The shapes of blocks in the plane; raises ``TypeError`` for others."""
        if not isinstance(self.shapes, Polygons):
            raise TypeError(f"blocks in the plane are needed; these have {self.vertices.shape[1]} coordinates")
        return self.shapes

    @property
    def polyhedra(self) -> Polyhedra:
        """The shapes of blocks in space; raises ``TypeError`` for others."""
        if not isinstance(self.shapes, Polyhedra):
            raise TypeError(f"blocks in space are needed; these have {self.vertices.shape[1]} coordinates")
        return self.shapes

    @property
    def offsets(self) -> np.ndarray:
        """(n_blocks + 1,) int array: in the plane, block ``i`` owns ``vertices[offsets[i]:offsets[i + 1]]``."""
        return self.polygons.offsets

    @property
    def thickness(self) -> np.ndarray:
        """(n_blocks,) array [m]: in the plane, thickness of the blocks out of it."""
        return self.polygons.thickness

    @property
    def areas(self) -> np.ndarray:
        """(n_blocks,) array [m²]: in the plane."""
        return self.polygons.areas

    def outline(self, block: int) -> np.ndarray:
        """(n, 2) array [m]: in the plane, corners of one block, counter-clockwise, before any movement."""
        block = range(self.n_blocks)[block]
        return self.vertices[self.offsets[block] : self.offsets[block + 1]]

    def index(self, name: str) -> int:
        """Find the number of the block with this name; raises ``ValueError`` where there is none."""
        if name not in self._numbers:
            near = "".join(f" (did you mean '{one}'?)" for one in get_close_matches(str(name), self.names, 1))
            raise ValueError(f"no block is named '{name}'{near}; the assembly has {counted(self.n_blocks, 'block')}")
        return self._numbers[name]

    @kept
    def _numbers(self) -> dict[str, int]:
        return {name: k for k, name in enumerate(self.names)}

    def flags(self, given: ArrayLike, what: str) -> np.ndarray:
        """(n_blocks,) bool array: as given; raises ``ValueError`` for numbers of blocks, or other ones."""
        flags = np.asarray(given)
        if flags.shape != (self.n_blocks,) or flags.dtype != bool:
            raise ValueError(f"{what} is {given!r}; give a bool for each of the {counted(self.n_blocks, 'block')}")
        return flags

    def listed(self, blocks: np.ndarray, most: int) -> str:
        """Names of the first ``most`` blocks, by their numbers, and how many others there are."""
        more = f" and {len(blocks) - most} more" if len(blocks) > most else ""
        return ", ".join(f"'{self.names[i]}'" for i in blocks[:most]) + more

    def with_roles(self, roles: Sequence[str] | np.ndarray) -> Assembly:
        """Give the blocks other roles, (n_blocks,) of "free", "fixed" and "moving"."""
        return replace(self, roles=np.array(list(roles)))


def check_blocks(assembly: Assembly, overlap_tolerance: float | None = None) -> None:
    """Raise ``ValueError`` where no block is free or two overlap, by their names and the depth, before all is solved.

    An overlap up to the tolerance [m] is accepted, a thousandth of the width of the thinnest block by default, where it
    is less than contact points know: a tenth of the width of the thinner of the two blocks.
    """
    if not assembly.free.any():
        raise ValueError(f"{counted(assembly.n_blocks, 'block')}, all supports; at least one must be free")
    tolerance = DRAWN_GAP * assembly.widths.min() if overlap_tolerance is None else overlap_tolerance
    if not (tolerance := plain(tolerance, "float", "overlap_tolerance")) >= 0.0:
        raise ValueError(f"overlap_tolerance is {tolerance:g} m; it must be at least 0")
    deepest = PENETRATION_FRACTION * assembly.widths
    i, j, depth = assembly.shapes.overlaps(assembly.vertices, min(tolerance, deepest.min()))
    known = np.minimum(deepest[i], deepest[j])
    real = np.flatnonzero((assembly.free[i] | assembly.free[j]) & (depth > np.minimum(tolerance, known)))
    if len(real):
        k = int(real[np.argmax(depth[real])])
        a, b = int(i[k]), int(j[k])
        more = f" ({counted(len(real) - 1, 'more pair overlaps', 'more pairs overlap')})" if len(real) > 1 else ""
        raising = f" or raise overlap_tolerance ({tolerance:.3g} m)"
        raise ValueError(
            f"block {a} ('{assembly.names[a]}') overlaps block {b} ('{assembly.names[b]}') by {depth[k]:.3g} m{more}; "
            f"move them apart{raising if depth[k] <= known[k] else f': they touch no deeper than {known[k]:.3g} m'}"
        )


def find_contacts(assembly: Assembly, vertices: np.ndarray, reach: float) -> Contacts:
    """Find the contact points of the blocks, closed or with a gap up to a reach [m].

    Of the current corners of all blocks, (n_vertices, d) [m]. Pairs of supports have none; sorted, so that the same
    geometry gives the same order.
    """
    return assembly.shapes.find(vertices, reach, assembly.free)


def _labels(
    n: int, what: str, names: Sequence[str] | None, roles: Sequence[str] | None, materials: Sequence[str] | None
) -> dict[str, Any]:
    """Names, roles and materials of n blocks, checked, with their defaults."""
    if n == 0:
        raise ValueError("an assembly needs at least one block; none was given")
    drawn_names = tuple(f"block {i}" for i in range(n)) if names is None else tuple(map(str, names))
    names = unique_names(drawn_names)
    roles = [FREE] * n if roles is None else list(roles)
    materials = ("",) * n if materials is None else tuple(map(str, materials))
    for kind, given in (("names", len(names)), ("roles", len(roles)), ("materials", len(materials))):
        if given != n:
            raise ValueError(f"{n} {what} but {given} {kind}; give one per block")
    _refuse_half_characters(names, "name")
    _refuse_half_characters(materials, "material")
    for name, role in zip(names, roles, strict=True):
        if role not in ROLES:
            raise ValueError(f"block '{name}' has role '{role}'; roles are {', '.join(ROLES)}")
    return {"names": names, "drawn_names": drawn_names, "roles": np.array(roles, dtype="<U6"), "materials": materials}


def _checked_ring(outline: ArrayLike, name: str) -> np.ndarray:
    ring = numbers_of(outline, f"the outline of block '{name}'")
    if ring.ndim != 2 or ring.shape[1] != 2 or len(ring) < 3:
        raise ValueError(f"block '{name}' needs an outline of at least three (x, y) corners; its shape is {ring.shape}")
    refuse_infinite(ring, name)
    repeated = np.flatnonzero((ring == np.roll(ring, -1, axis=0)).all(axis=1))
    return np.delete(ring, repeated, axis=0) if len(ring) - len(repeated) >= 3 else ring


def _refuse_half_characters(words: Sequence[str], what: str) -> None:
    for i, word in enumerate(words):
        if found := re.search(r"[\0\ud800-\udfff]", word):
            half = "a NUL" if found[0] == "\0" else "half of a character"
            raise ValueError(
                f"block {i}: its {what} {word!r} holds {half} at place {found.start()}, which no file can "
                "hold; give whole characters"
            )


def unique_names(names: Sequence[str]) -> tuple[str, ...]:
    """Make names different: the second block drawn as "pier" is "pier #2"."""
    taken, unique = set(names), []
    following: dict[str, int] = {}
    for name in names:
        candidate = name
        while name in following and candidate in taken:
            candidate = f"{name} #{following[name]}"
            following[name] += 1
        following.setdefault(name, 2)
        taken.add(candidate)
        unique.append(candidate)
    return tuple(unique)


def _positive(value: ArrayLike, what: str, unit: str, names: Sequence[str]) -> np.ndarray:
    array, n = numbers_of(value, what), len(names)
    if array.ndim and array.shape != (n,):
        raise ValueError(f"{what} has shape {array.shape}; give one number or {n}, one per block")
    array = np.broadcast_to(array, (n,)).copy()
    for i in np.flatnonzero(~(np.isfinite(array) & (array > 0))).tolist():
        raise ValueError(f"block {i} ('{names[i]}') has {what} {array[i]:g} {unit}; it must be a positive number")
    return array
