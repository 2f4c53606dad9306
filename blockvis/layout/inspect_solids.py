"""Inspection of a layout in space before any analysis: sizes, weights, joints, duplicates."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from functools import cached_property

import numpy as np

import solver

from .assemble_solids import solid_duplicates
from .faces import width_of
from .facing import DEFAULT_FACING, Facing, faced
from .roles import dropped_twins, roles_of
from .solid_layout import SolidLayout
from .solids import size_of

#: Gaps between faces that cover each other are joints drawn open between these parts of the width of a typical block.
SMALLEST_JOINT, WIDEST_JOINT = 1e-3, 0.2

#: Density of blocks for which the layout has none [kg/m³], as of a run.
DENSITY = 2000.0


@dataclass(frozen=True)
class SolidInspection:
    """Measurements of a layout in space.

    Attributes
    ----------
    layout : SolidLayout
        As read, duplicates included.
    kept : (n_kept,) int array
        Numbers of the blocks that are no duplicates.
    twins : tuple of (int, int)
        Blocks drawn twice: the first and the later copy.
    roles : tuple of str
        Role of each block, as a run takes it from roles, groups and names.
    facing : Facing
        Joints whose faces do not lie in one plane, as a run closes them; block numbers count the kept blocks.
    overlapping : tuple of (int, int, float)
        Pairs of blocks that overlap nevertheless, and the depth [m], deepest first.
    open_joints : tuple of (int, int, float)
        Pairs of blocks of which faces cover each other across a gap, and the gap [m], widest first.
    refused : str
        Why a run would refuse the blocks, or "".
    """

    layout: SolidLayout
    kept: np.ndarray
    twins: tuple[tuple[int, int], ...]
    roles: tuple[str, ...]
    facing: Facing
    overlapping: tuple[tuple[int, int, float], ...]
    open_joints: tuple[tuple[int, int, float], ...]
    refused: str

    @cached_property
    def volumes(self) -> np.ndarray:
        """(n_kept,) array [m³]."""
        return self.layout.volumes[self.kept]

    @cached_property
    def weights(self) -> np.ndarray:
        """(n_kept,) array [N]: with the density of the file, else 2000 kg/m³."""
        density = np.full(self.layout.n_blocks, np.nan) if self.layout.density is None else self.layout.density
        return self.volumes * np.where(np.isnan(density), DENSITY, density)[self.kept] * solver.GRAVITY

    @property
    def joint_thickness(self) -> float:
        """Joint thickness that closes the open joints [m], rounded up to two digits; 0 without any."""
        if not self.open_joints:
            return 0.0
        widest = 1.01 * self.open_joints[0][2]
        unit = 10.0 ** (math.floor(math.log10(widest)) - 1)
        return float(f"{math.ceil(widest / unit) * unit:.2g}")

    @property
    def low(self) -> np.ndarray:
        """(3,) array [m]: the corner of the box around all blocks with the smallest coordinates."""
        return np.asarray(self.layout.points.min(axis=0))

    @property
    def high(self) -> np.ndarray:
        """(3,) array [m]: the opposite corner."""
        return np.asarray(self.layout.points.max(axis=0))

    @property
    def unit_clash(self) -> str:
        """The note on a unit that cannot be right, or ""."""
        return next((note for note in self.layout.notes if note.startswith("unit clash")), "")

    def __str__(self) -> str:
        """Write the measurements as lines of a table."""
        layout, kept = self.layout, self.kept
        size = " × ".join(f"{length:.4g}" for length in self.high - self.low)
        largest = int(kept[self.volumes.argmax()])
        free = np.array([self.roles[i] == "free" for i in kept])
        known = layout.density is not None and bool(np.isfinite(layout.density[kept]).all())
        supports = f", supports {self.weights[~free].sum():.6g} N" if (~free).any() else ""
        lines = [
            f"{layout.source}",
            f"blocks in space {layout.n_blocks}"
            + (f", {len(self.twins)} of them duplicates: {len(kept)} blocks" if self.twins else ""),
            f"size            {size} m, from ({', '.join(f'{x:.6g}' for x in self.low)}) m; z is up",
            f"unit            {layout.unit}",
            f"volumes         {self.volumes.min():.4g} to {self.volumes.max():.4g} m³, median "
            f"{np.median(self.volumes):.4g}, sum {self.volumes.sum():.6g} m³",
            f"weight          {self.weights[free].sum():.6g} N{supports}"
            + ("" if known else f", at {DENSITY:g} kg/m³ where the file has no density"),
            f"largest block   '{layout.names[largest]}', {size_of(layout.solids[largest][0]):.4g} m across",
            f"corners, faces  {sum(len(layout.solids[i][0]) for i in kept)}, "
            f"{sum(len(layout.solids[i][1]) for i in kept)}",
        ]
        for title, words in (("groups", layout.groups), ("materials", layout.materials), ("roles", self.roles)):
            counted = Counter(words[i] for i in kept)
            listed = [f"'{word}' {n}" if word else f"none {n}" for word, n in counted.most_common(12)]
            more = f", {len(counted) - 12} more" if len(counted) > 12 else ""
            lines.append(f"{title:15} {', '.join(listed)}{more}")
        names = [layout.names[i] for i in kept]
        lines.append(f"{'names':15} {', '.join(names[:4])}{' ...' if len(names) > 4 else ''}")
        lines.append(f"joints          {self.facing.note or 'faces in contact lie in one plane'}")
        for title, pairs, remedy in (
            ("open joints", self.open_joints, f"; joint_thickness = {self.joint_thickness:g} closes them"),
            ("overlaps", self.overlapping, "; a run refuses them: move the blocks apart or raise overlap_tolerance"),
        ):
            if pairs:
                worst = [f"{layout.names[i]} | {layout.names[j]} {by:.3g} m" for i, j, by in pairs[:4]]
                more = f" and {len(pairs) - 4} more" if len(pairs) > 4 else ""
                lines.append(f"{title:15} {len(pairs)}: {', '.join(worst)}{more}{remedy}")
        if self.refused:
            lines.append(f"refused         {self.refused}")
        if self.twins:
            shown = ", ".join(f"{layout.names[b]} = {layout.names[a]}" for a, b in self.twins[:8])
            lines.append(f"duplicates      {shown}{' ...' if len(self.twins) > 8 else ''}")
        lines += [f"note            {note}" for note in layout.notes]
        return "\n".join(lines)


def inspected_solids(layout: SolidLayout) -> SolidInspection:
    """Measure a layout in space.

    Parameters
    ----------
    layout : SolidLayout
        As read, duplicates included.
    """
    twins = solid_duplicates(layout.solids)
    dropped = dropped_twins(layout, twins, {})
    kept = np.array([i for i in range(layout.n_blocks) if i not in dropped])
    some = layout.chosen(kept)
    facing = faced(some.solids, some.names)
    overlapping: list[tuple[int, int, float]] = []
    gaps: list[tuple[int, int, float]] = []
    refused = ""
    try:
        assembly = solver.Assembly.from_solids(facing.solids, names=some.names)
        width = float(np.median([width_of(*solid) for solid in some.solids]))
        one, other, depth = assembly.shapes.overlaps(assembly.vertices, DEFAULT_FACING * width)
        overlapping = [(int(kept[i]), int(kept[j]), float(d)) for i, j, d in zip(one, other, depth, strict=True)]
        gaps = [(int(kept[i]), int(kept[j]), gap) for i, j, gap in _open_joints(assembly, width)]
    except ValueError as error:
        refused = str(error)
    return SolidInspection(
        layout=layout,
        kept=kept,
        twins=tuple(twins),
        roles=tuple(roles_of(layout, {})),
        facing=facing,
        overlapping=tuple(sorted(overlapping, key=lambda pair: -pair[2])),
        open_joints=tuple(sorted(gaps, key=lambda pair: -pair[2])),
        refused=refused,
    )


def _open_joints(assembly: solver.Assembly, width: float) -> list[tuple[int, int, float]]:
    """Pairs of blocks of which faces cover each other across a gap, and its mean width [m]."""
    contacts = solver.find_contacts(assembly, assembly.vertices, WIDEST_JOINT * width)
    pairs, joint = contacts.joints()
    n = len(pairs)
    low, high = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(low, joint, contacts.gaps)
    np.maximum.at(high, joint, contacts.gaps)
    area = np.bincount(joint, contacts.areas, minlength=n)
    # What touches somewhere, or opens like a wedge, is no joint that was drawn open.
    found = (low > SMALLEST_JOINT * width) & (high < 2.0 * low) & (area > (0.3 * width) ** 2)
    return [(int(i), int(j), float(gap)) for (i, j), gap in zip(pairs[found], high[found], strict=True)]
