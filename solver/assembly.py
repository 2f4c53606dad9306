"""Assembly: the outlines of all blocks as flat arrays, with what belongs to each block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from .geometry.polygons import overlap_depths, polygon_integrals, self_crossings

FREE, FIXED, MOVING = ROLES = ("free", "fixed", "moving")

#: A block thinner than this fraction of its own perimeter squared is a line, not a block: double
#: precision leaves about six digits of its centroid.
SMALLEST_SHAPE_FACTOR = 1e-9


@dataclass(frozen=True)
class Assembly:
    """Rigid blocks of a masonry structure, supports included.

    Use :meth:`from_outlines` unless the flat arrays are at hand: it checks its input.

    Attributes
    ----------
    vertices : (n_vertices, 2) array [m]
        Corners of all blocks, block after block, counter-clockwise in each.
    offsets : (n_blocks + 1,) int array
        Block ``i`` owns ``vertices[offsets[i]:offsets[i + 1]]``.
    names : tuple of str
        One name per block, all different.
    roles : (n_blocks,) str array
        ``"free"``, ``"fixed"`` or ``"moving"``.
    density : (n_blocks,) array [kg/m³]
    thickness : (n_blocks,) array [m]
        Out of plane.
    materials : tuple of str
        One material per block; pairs of materials choose the law of an interface.
    """

    vertices: np.ndarray
    offsets: np.ndarray
    names: tuple[str, ...]
    roles: np.ndarray
    density: np.ndarray
    thickness: np.ndarray
    materials: tuple[str, ...]

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
            area or crossing itself, an unknown role, a density or thickness that is not positive.

        Examples
        --------
        >>> import solver
        >>> block = [[0, 0], [2, 0], [2, 1], [0, 1]]
        >>> float(solver.Assembly.from_outlines([block]).areas[0])
        2.0
        """
        n = len(outlines)
        if n == 0:
            raise ValueError("an assembly needs at least one block; none was given")
        names = _unique_names([f"block {i}" for i in range(n)] if names is None else list(map(str, names)))
        roles_array = np.array([FREE] * n if roles is None else list(roles), dtype="<U6")
        materials = ("",) * n if materials is None else tuple(map(str, materials))
        for what, given in (("names", len(names)), ("roles", len(roles_array)), ("materials", len(materials))):
            if given != n:
                raise ValueError(f"{n} outlines but {given} {what}; give one per block")
        _refuse_half_characters(names, "name")
        _refuse_half_characters(materials, "material")
        if roles is not None:
            for name, role in zip(names, roles, strict=True):
                if role not in ROLES:
                    raise ValueError(f"block '{name}' has role '{role}'; roles are {', '.join(ROLES)}")
        rings = [_checked_ring(outline, name) for outline, name in zip(outlines, names, strict=True)]
        offsets = np.concatenate([[0], np.cumsum([len(ring) for ring in rings])])
        vertices = np.concatenate(rings)
        areas, _, _ = polygon_integrals(vertices, offsets)
        lengths = np.hypot(*(vertices[_next(offsets)] - vertices).T)
        perimeter = np.add.reduceat(lengths, offsets[:-1])
        for i in np.flatnonzero(np.abs(areas) <= SMALLEST_SHAPE_FACTOR * perimeter**2).tolist():
            raise ValueError(
                f"block {i} ('{names[i]}') has an area of {abs(areas[i]):.3g} m² for a perimeter of "
                f"{perimeter[i]:.3g} m; it is a line, not a block: remove it or redraw it"
            )
        rings = [ring if area > 0 else ring[::-1] for ring, area in zip(rings, areas, strict=True)]
        vertices = np.concatenate(rings)
        for i, (j, k) in self_crossings(vertices, offsets).items():
            a, b = vertices[offsets[i] + j], vertices[offsets[i] + k]
            raise ValueError(
                f"block {i} ('{names[i]}') crosses itself: the edges that start at ({a[0]:.6g}, {a[1]:.6g}) and "
                f"({b[0]:.6g}, {b[1]:.6g}) meet; order its corners around the outline"
            )
        return cls(
            vertices=vertices,
            offsets=offsets,
            names=names,
            roles=roles_array,
            density=_positive(density, n, "density", "kg/m³", names),
            thickness=_positive(thickness, n, "thickness", "m", names),
            materials=materials,
        )

    def __repr__(self) -> str:
        """One line: how many blocks, and what they are."""
        kinds = ", ".join(f"{int((self.roles == role).sum())} {role}" for role in ROLES)
        return f"<Assembly of {self.n_blocks} blocks: {kinds}>"

    @property
    def n_blocks(self) -> int:
        """Number of blocks, supports included."""
        return len(self.offsets) - 1

    @cached_property
    def free(self) -> np.ndarray:
        """(n_blocks,) bool array: true where the block is not a support."""
        return self.roles == FREE

    @cached_property
    def moving(self) -> np.ndarray:
        """(n_blocks,) bool array: true where the block is a moving support."""
        return self.roles == MOVING

    @cached_property
    def areas(self) -> np.ndarray:
        """(n_blocks,) array [m²]."""
        return self._integrals[0]

    @cached_property
    def centroids(self) -> np.ndarray:
        """(n_blocks, 2) array [m], before any movement."""
        return self._integrals[1]

    @cached_property
    def masses(self) -> np.ndarray:
        """(n_blocks,) array [kg]."""
        return self.areas * self.thickness * self.density

    @cached_property
    def _integrals(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return polygon_integrals(self.vertices, self.offsets)

    @cached_property
    def block_of_vertex(self) -> np.ndarray:
        """(n_vertices,) int array: the block each vertex belongs to."""
        return np.repeat(np.arange(self.n_blocks), np.diff(self.offsets))

    @cached_property
    def next_vertex(self) -> np.ndarray:
        """(n_vertices,) int array: the vertex that follows counter-clockwise; edge i runs from i to it."""
        return _next(self.offsets)

    @cached_property
    def previous_vertex(self) -> np.ndarray:
        """(n_vertices,) int array: the vertex before."""
        previous = np.empty_like(self.next_vertex)
        previous[self.next_vertex] = np.arange(len(self.next_vertex))
        return previous

    @cached_property
    def edge_lengths(self) -> np.ndarray:
        """(n_vertices,) array [m]: length of the edge that starts at each vertex."""
        return np.hypot(*(self.vertices[self.next_vertex] - self.vertices).T)

    @cached_property
    def convex_vertex(self) -> np.ndarray:
        """(n_vertices,) bool array: false at re-entrant corners, which touch nothing first."""
        to_next = self.vertices[self.next_vertex] - self.vertices
        from_previous = self.vertices - self.vertices[self.previous_vertex]
        cross = from_previous[:, 0] * to_next[:, 1] - from_previous[:, 1] * to_next[:, 0]
        return cross > 0.0

    @cached_property
    def widths(self) -> np.ndarray:
        """(n_blocks,) array [m]: twice the area over the perimeter of each block, near b for a long a × b."""
        return 2.0 * self.areas / np.add.reduceat(self.edge_lengths, self.offsets[:-1])

    @cached_property
    def block_size(self) -> float:
        """Square root of the mean area of the free blocks [m]: the length the program is scaled by."""
        chosen = self.areas[self.free] if self.free.any() else self.areas
        return float(np.sqrt(chosen.mean()))

    def outline(self, block: int) -> np.ndarray:
        """(n, 2) array [m]: corners of one block, counter-clockwise, before any movement."""
        return self.vertices[self.offsets[block] : self.offsets[block + 1]]

    def index(self, name: str) -> int:
        """Number of the block with this name; raises ``ValueError`` where there is none."""
        try:
            return self.names.index(name)
        except ValueError:
            raise ValueError(f"no block is named '{name}'; the assembly has {self.n_blocks} blocks") from None

    def with_roles(self, roles: Sequence[str] | np.ndarray) -> Assembly:
        """The same blocks with other roles, (n_blocks,) of "free", "fixed" and "moving"."""
        unknown = set(map(str, roles)) - set(ROLES)
        if unknown or len(roles) != self.n_blocks:
            raise ValueError(
                f"give {self.n_blocks} roles out of {', '.join(ROLES)}; found {len(roles)}, {unknown or ''}"
            )
        return replace(self, roles=np.array(list(map(str, roles)), dtype="<U6"))


def check_blocks(assembly: Assembly, overlap_tolerance: float | None = None) -> None:
    """Refuses an assembly without free blocks, or with blocks that overlap, before anything is solved.

    Parameters
    ----------
    assembly : Assembly
    overlap_tolerance : float, optional [m]
        Overlap that is accepted; a thousandth of the width of the thinnest block by default.

    Raises
    ------
    ValueError
        Names both blocks and the depth.
    """
    if not assembly.free.any():
        raise ValueError(f"all {assembly.n_blocks} blocks are supports; at least one must be free")
    tolerance = 1e-3 * float(assembly.widths.min()) if overlap_tolerance is None else overlap_tolerance
    i, j, depth = overlap_depths(assembly.vertices, assembly.offsets, tolerance)
    real = np.flatnonzero(assembly.free[i] | assembly.free[j])
    if len(real):
        k = int(real[np.argmax(depth[real])])
        a, b = int(i[k]), int(j[k])
        more = f" ({len(real) - 1} more pairs overlap)" if len(real) > 1 else ""
        raise ValueError(
            f"block {a} ('{assembly.names[a]}') overlaps block {b} ('{assembly.names[b]}') by {depth[k]:.3g} m{more}; "
            f"move them apart or raise overlap_tolerance ({tolerance:.3g} m)"
        )


def _next(offsets: np.ndarray) -> np.ndarray:
    following = np.arange(1, offsets[-1] + 1)
    following[offsets[1:] - 1] = offsets[:-1]
    return following


def _checked_ring(outline: ArrayLike, name: str) -> np.ndarray:
    ring = np.asarray(outline, dtype=float)
    if ring.ndim != 2 or ring.shape[1] != 2 or len(ring) < 3:
        raise ValueError(f"block '{name}' needs an outline of at least three (x, y) corners; its shape is {ring.shape}")
    if not np.isfinite(ring).all():
        corner = int(np.flatnonzero(~np.isfinite(ring).all(axis=1))[0])
        raise ValueError(
            f"block '{name}': corner {corner} is {ring[corner].tolist()}; coordinates must be finite numbers"
        )
    repeated = np.flatnonzero((ring == np.roll(ring, -1, axis=0)).all(axis=1))
    return np.delete(ring, repeated, axis=0) if len(ring) - len(repeated) >= 3 else ring


def _refuse_half_characters(words: Sequence[str], what: str) -> None:
    for i, word in enumerate(words):
        try:
            word.encode()
        except UnicodeEncodeError as error:
            raise ValueError(
                f"block {i}: its {what} {word!r} holds half of a character at place {error.start}, which no file can "
                "hold; give whole characters"
            ) from None


def _unique_names(names: list[str]) -> tuple[str, ...]:
    if len(set(names)) == len(names):
        return tuple(names)
    taken, unique = set(names), []
    seen: dict[str, int] = {}
    for name in names:
        count = seen[name] = seen.get(name, 0) + 1
        candidate = name if count == 1 else f"{name} #{count}"
        while count > 1 and candidate in taken:
            count += 1
            candidate = f"{name} #{count}"
        seen[name] = count
        taken.add(candidate)
        unique.append(candidate)
    return tuple(unique)


def _positive(value: ArrayLike, n: int, what: str, unit: str, names: Sequence[str]) -> np.ndarray:
    array = np.asarray(value, dtype=float)
    if array.ndim and array.shape != (n,):
        raise ValueError(f"{what} has shape {array.shape}; give one number or {n}, one per block")
    array = np.broadcast_to(array, (n,)).copy()
    for i in np.flatnonzero(~(np.isfinite(array) & (array > 0))).tolist():
        raise ValueError(f"block {i} ('{names[i]}') has {what} {array[i]:g} {unit}; it must be a positive number")
    return array
