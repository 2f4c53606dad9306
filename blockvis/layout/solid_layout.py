"""SolidLayout: blocks in space before they become an assembly, whatever file they come from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .labels import check_labels
from .left_out import LeftOut
from .solids import Solid, volume


@dataclass(frozen=True)
class SolidLayout:
    """Blocks in space, with their names, groups, roles, materials and density; gravity acts along -z.

    Attributes
    ----------
    solids : tuple of (points, faces) [m]
        (n, 3) corners of each block, and the corners around each of its faces, counter-clockwise seen from outside.
    names : tuple of str
        One per block; may repeat.
    groups : tuple of str
        Layer, object group or part of each block, "" for none.
    roles : tuple of str
        "free", "fixed", "moving", or "" where the file says nothing.
    materials : tuple of str
    density : (n_blocks,) array [kg/m³] or None
        NaN for a block of which the file says nothing.
    unit : str
        Unit of length in which the file was read; inside a format's reader the unit that the file states, "" for none.
    notes : tuple of str
        What the reader assumed or dropped.
    source : str
        The file, "" for a layout that was not read from a file.
    left_out : tuple of LeftOut
        What the file draws beside its blocks.
    """

    solids: tuple[Solid, ...]
    names: tuple[str, ...]
    groups: tuple[str, ...] = ()
    roles: tuple[str, ...] = ()
    materials: tuple[str, ...] = ()
    density: np.ndarray | None = None
    unit: str = "m"
    notes: tuple[str, ...] = ()
    source: str = ""
    left_out: tuple[LeftOut, ...] = ()

    def __post_init__(self) -> None:
        """Check that there is one entry per block, and replace broken characters."""
        check_labels(self, len(self.solids), "solids")

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return len(self.solids)

    @property
    def dimension(self) -> int:
        """Number of coordinates: 3."""
        return 3

    @property
    def thickness(self) -> None:
        """Blocks in space have no thickness out of a plane."""
        return None

    @property
    def volumes(self) -> np.ndarray:
        """(n_blocks,) array [m³]."""
        return np.array([volume(*solid) for solid in self.solids])

    @property
    def points(self) -> np.ndarray:
        """(n_points, 3) array [m]: the corners of all blocks."""
        return np.concatenate([points for points, _ in self.solids]) if self.solids else np.zeros((0, 3))

    def corners(self, block: int) -> np.ndarray:
        """(n, 3) array [m]: the corners of a block."""
        return self.solids[block][0]

    def chosen(self, blocks: Sequence[int] | np.ndarray) -> SolidLayout:
        """Take only these blocks, in this order."""
        keep = [int(i) for i in blocks]
        return replace(
            self,
            solids=tuple(self.solids[i] for i in keep),
            names=tuple(self.names[i] for i in keep),
            groups=tuple(self.groups[i] for i in keep),
            roles=tuple(self.roles[i] for i in keep),
            materials=tuple(self.materials[i] for i in keep),
            density=None if self.density is None else self.density[keep],
        )
