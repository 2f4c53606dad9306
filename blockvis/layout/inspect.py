"""Inspection of a layout before any analysis: sizes, weights, joints, overlaps, duplicates."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import solver
from blockvis.text import listed
from solver import mechanics
from solver.mechanics import counted

from .facing import Facing as FacedJoints
from .facing import faced, facing_tolerance
from .joints.close import Proposal, proposed
from .joints.facing_edges import WIDEST_JOINT, Facing, is_mortar, open_shares, rounded_up
from .layout import Layout
from .outlines import ROUNDING
from .refusal import carrying
from .repair import DEFAULT_OVERLAP, DRAWN_GAP, overlaps
from .roles import roles_of, told_apart
from .simplify import default_tolerance, simplified
from .solids import size_of, width_of

#: Classes of joint thickness in the report.
CLASSES = 8

#: Density of blocks for which the layout has none [kg/m³], as of a run.
DENSITY = 2000.0

#: Title and text of a line of the report.
Row = tuple[str, str]


@dataclass(frozen=True)
class Inspection:
    """Measurements of a layout, as read, duplicates included."""

    layout: Layout
    kept: np.ndarray  #: (n_kept,) int array: blocks that are no duplicates.
    twins: tuple[tuple[int, int], ...]  #: Duplicates, the first and the later copy of each.
    roles: tuple[str, ...]
    sizes: np.ndarray  #: (n_kept,) array [m²], in space [m³].
    #: (d,) arrays [m]: corners of the box around all blocks.
    low: np.ndarray
    high: np.ndarray
    #: Pairs of blocks that overlap and the depth [m], deepest first; in space those that a run does not face.
    overlapping: tuple[tuple[int, int, float], ...]
    overlap_tolerance: float  #: [m] Deepest overlap that is resolved by default.
    joint_thickness: float  #: [m] That closes the joints; 0 if there are none, and if most of their length touches.
    rows: tuple[Row, ...]  #: Report on weights and corners.
    joint_rows: tuple[Row, ...]  #: Report on joints.
    #: In the plane, stretches where edges face each other across a gap; block numbers count the kept blocks.
    joints: Facing = field(default_factory=Facing.none)
    #: In space, joints whose faces do not lie in one plane, as a run closes them; block numbers count the kept blocks.
    facing: FacedJoints = field(default_factory=lambda: FacedJoints(()))
    #: In space, pairs of blocks of which faces cover each other across a gap, and the gap [m], widest first.
    open_joints: tuple[tuple[int, int, float], ...] = ()
    refused: str = ""  #: Why a run would refuse the blocks, or "".
    remedy: str = ""  #: What to leave out where they overlap, or "".

    @property
    def deep(self) -> list[tuple[int, int]]:
        """Pairs of blocks of which a run refuses the overlap."""
        return [(i, j) for i, j, depth in self.overlapping if depth > self.overlap_tolerance]

    def __str__(self) -> str:
        """Write the measurements as lines of a table."""
        layout, in_space = self.layout, self.layout.dimension == 3
        size = " × ".join(f"{length:.4g} m" for length in self.high - self.low)
        corner = ", ".join(f"{x:.6g}" for x in self.low)
        unit = "m³" if in_space else "m²"
        copies = f", {len(self.twins)} of them duplicates: {counted(len(self.kept), 'block')}" if self.twins else ""
        names = [layout.names[i] for i in self.kept]
        rows = [
            ("blocks in space" if in_space else "outlines", f"{layout.n_blocks}{copies}"),
            ("size", f"{size}, from ({corner}) m" + ("; z is up" if in_space else "")),
            ("unit", layout.unit),
            (
                "volumes" if in_space else "areas",
                f"{self.sizes.min():.4g} to {self.sizes.max():.4g} {unit}, median {np.median(self.sizes):.4g}, sum "
                f"{self.sizes.sum():.6g} {unit}",
            ),
            *self._number_rows(),
            *self.rows,
            *((what, self._counted(of)) for what, of in (("groups", layout.groups), ("materials", layout.materials))),
            *self._look_rows(),
            ("roles", self._counted(self.roles)),
            ("names", f"{', '.join(names[:4])}{' ...' if len(names) > 4 else ''}"),
            *self.joint_rows,
            *self._overlap_rows(),
        ]
        if self.refused:
            rows.append(("refused", self.refused))
        if self.twins:
            shown = ", ".join(f"{layout.names[b]} = {layout.names[a]}" for a, b in self.twins[:8])
            rows.append(("duplicates", f"{shown}{' ...' if len(self.twins) > 8 else ''}"))
        rows += [("note", note) for note in layout.notes]
        return "\n".join([layout.source, *(f"{title:15} {text}" for title, text in rows)])

    def _counted(self, words: Sequence[str]) -> str:
        counts = Counter(words[i] for i in self.kept).most_common()
        return listed([f"'{word}' {n}" if word else f"none {n}" for word, n in counts], 12)

    def _number_rows(self) -> list[Row]:
        """Thickness and density of the blocks, where the file says them."""
        said = (("thickness", self.layout.thickness, "m"), ("density", self.layout.density, "kg/m³"))
        own = [(title, values[self.kept], unit) for title, values, unit in said if values is not None]
        ends = [
            (title, f"{np.nanmin(values):.4g}", f"{np.nanmax(values):.4g}", unit)
            for title, values, unit in own
            if np.isfinite(values).any()
        ]
        return [(title, f"{low}{f' to {high}' * (high != low)} {unit}") for title, low, high, unit in ends]

    def _look_rows(self) -> list[Row]:
        """Kinds and colours of the outlines of a drawing that has several, by which some can be left out."""
        kinds = Counter(own[0] for own in (self.layout.looks[i] for i in self.kept) if own)
        colours = Counter(" = ".join(own[1:]) for own in (self.layout.looks[i] for i in self.kept) if own[1:])
        titled = (("drawn as", kinds), ("colours", colours))
        return [
            (title, ", ".join(f"{word} {n}" for word, n in counted.most_common(12)))
            for title, counted in titled
            if len(counted) > 1
        ]

    def _overlap_rows(self) -> list[Row]:
        if not self.overlapping:
            return [] if self.refused else [("overlaps", "none")]
        rows = [("overlaps", f"{counted(len(self.overlapping), 'pair')}, up to {self.overlapping[0][2]:.3g} m deep")]
        for i, j, depth in self.overlapping[:8]:
            resolved = depth <= self.overlap_tolerance
            verdict = (
                "resolved to the midline" if resolved else "refused: move the blocks apart or raise overlap_tolerance"
            )
            rows.append(("", f"{self.layout.names[i]} and {self.layout.names[j]}: {depth:.3g} m, {verdict}"))
        return [*rows, ("remedy", self.remedy)] if self.remedy else rows


def inspected(layout: Layout) -> Inspection:
    """Measure a layout as read, duplicates included; Refused for outlines in the plane that are no blocks."""
    twins, kept = told_apart(layout, {})
    drawn = layout.chosen(kept)
    roles = tuple(roles_of(layout, {}))
    free = np.array([roles[i] == mechanics.FREE for i in kept])
    with carrying(lambda: drawn):
        found = _in_space(drawn, free) if layout.dimension == 3 else _in_the_plane(drawn)
    for key in ("overlapping", "open_joints"):
        found[key] = tuple((int(kept[i]), int(kept[j]), by) for i, j, by in found.get(key, ()))
    return Inspection(
        layout=layout,
        kept=kept,
        twins=tuple(twins),
        roles=roles,
        low=drawn.points.min(axis=0),
        high=drawn.points.max(axis=0),
        **found,
    )


def _in_the_plane(layout: Layout) -> dict[str, Any]:
    """Measure what is told of outlines only, and areas, overlaps and joints; blocks by their place in the layout."""
    assembly = solver.Assembly.from_outlines(layout.outlines, names=layout.names)
    width = float(np.median(assembly.widths))
    outlines = [assembly.outline(i) for i in range(assembly.n_blocks)]
    # Joints are measured as a run closes them.
    simple, finer = simplified(outlines, default_tolerance(outlines))
    proposal = proposed(simple, laid=np.array(layout.laid))
    smallest = DRAWN_GAP * width
    shares = open_shares(simple, proposal.stretches, smallest)
    thickness = proposal.thickness if proposal.thickness >= smallest and is_mortar(shares) else 0.0
    return {
        "sizes": assembly.areas,
        "overlapping": overlaps(assembly, ROUNDING * width),
        "overlap_tolerance": DEFAULT_OVERLAP * width,
        "joint_thickness": thickness,
        "joints": proposal.stretches.chosen(proposal.stretches.gaps.max(axis=1) >= smallest),
        "rows": (("corners", f"{sum(map(len, layout.outlines))}" + (f"; in a run {finer}" if finer else "")),),
        "joint_rows": _mortar_rows(proposal, smallest, shares[0], is_mortar=thickness > 0.0),
    }


def _mortar_rows(proposal: Proposal, rounding: float, share: float, *, is_mortar: bool) -> tuple[Row, ...]:
    """Report mortar joints by their thickness, and how they can be closed; thinner ones than rounding [m] are none.

    Where gaps are a small share of the length of joints, and on one side of blocks, nothing is proposed.
    """
    joints = proposal.stretches
    if not len(joints):
        return (("mortar joints", "none: no gaps between facing edges"),)
    if 0.0 < proposal.thickness < rounding:
        n = int((joints.gaps.max(axis=1) <= 1.0001 * proposal.thickness).sum())
        gaps = f"{counted(n, 'gap')} of up to {proposal.thickness:.1g} m {'is' if n == 1 else 'are'}"
        said = f"none: {gaps} the rounding of coordinates"
        rows = [("mortar joints", f'{said}; joint_thickness = "auto" closes them')]
        return (*rows, ("", proposal.note)) if proposal.note else tuple(rows)
    widest = joints.gaps.max(axis=1) * 1e3
    edges = np.linspace(0.0, max(proposal.thickness * 1e3, widest.max()), CLASSES + 1)
    edges[-1] *= 1.0 + 1e-6
    metres = np.histogram(widest, edges, weights=joints.lengths)[0]
    counts = np.histogram(widest, edges)[0]
    rows = [
        (
            "mortar joints",
            f"{counted(len(widest), 'stretch', 'stretches')}, {joints.lengths.sum():.4g} m, gaps of "
            f"{widest.min():.3g} to {widest.max():.3g} mm, median {np.median(widest):.3g} mm",
        )
    ]
    for k in np.flatnonzero(counts):
        stretches = f"{counts[k]:6d} {'stretch  ' if counts[k] == 1 else 'stretches'}"
        rows.append(("", f"{edges[k]:6.1f} to {edges[k + 1]:6.1f} mm  {stretches}  {metres[k]:9.3f} m"))
    if not is_mortar:
        said = f"nothing: gaps are {100.0 * share:.2g} % of the length of joints"
        said += ", most on one side of blocks only, as cracks and openings are"
        return (*rows, ("proposed", f"{said}; joint_thickness = {rounded_up(widest.max() / 1e3):g} closes them"))
    rows.append(("proposed", f'joint_thickness = {proposal.thickness:g}   (m, or "auto")'))
    if proposal.method == "voronoi":
        rows.append(("", 'closing = "voronoi": faces are not straight, mortar goes to the nearest stone'))
    return (*rows, ("", proposal.note)) if proposal.note else tuple(rows)


def _in_space(layout: Layout, free: np.ndarray) -> dict[str, Any]:
    """Measure what is told of blocks in space only, and volumes, overlaps and joints."""
    facing = faced(layout.solids, layout.names)
    overlapping: list[tuple[int, int, float]] = []
    gaps: list[tuple[int, int, float]] = []
    refused = ""
    tolerance = facing_tolerance(layout.solids)
    try:
        assembly = solver.Assembly.from_solids(facing.solids, names=layout.names)
        overlapping = overlaps(assembly, tolerance)
        gaps = _open_joints(assembly, float(np.median([width_of(*solid) for solid in layout.solids])))
        gaps = [(i, j, gap) for i, j, gap in gaps if not (layout.laid[i] and layout.laid[j])]
    except ValueError as error:
        refused = str(error)
    # Widest first.
    thickness = rounded_up(1.01 * gaps[0][2]) if gaps else 0.0
    joint_rows = [("joints", facing.note or "faces in contact lie in one plane")]
    if gaps:
        worst = listed([f"{layout.names[i]} | {layout.names[j]} {by:.3g} m" for i, j, by in gaps], 4)
        joint_rows.append(("open joints", f"{len(gaps)}: {worst}; joint_thickness = {thickness:g} closes them"))
    return {
        "sizes": layout.volumes,
        "overlapping": overlapping,
        "overlap_tolerance": tolerance,
        "joint_thickness": thickness,
        "facing": facing,
        "open_joints": gaps,
        "refused": refused,
        "rows": _solid_rows(layout, free),
        "joint_rows": tuple(joint_rows),
    }


def _solid_rows(layout: Layout, free: np.ndarray) -> tuple[Row, ...]:
    """Report weights, the largest block, and the number of corners and faces."""
    density = np.full(layout.n_blocks, np.nan) if layout.density is None else layout.density
    known = bool(np.isfinite(density).all())
    weights = layout.volumes * np.where(np.isnan(density), DENSITY, density) * solver.GRAVITY
    supports = f", supports {weights[~free].sum():.6g} N" if (~free).any() else ""
    largest = int(layout.volumes.argmax())
    return (
        (
            "weight",
            f"{weights[free].sum():.6g} N{supports}"
            + ("" if known else f", at {DENSITY:g} kg/m³ where the file has no density"),
        ),
        ("largest block", f"'{layout.names[largest]}', {size_of(layout.corners(largest)):.4g} m across"),
        (
            "corners, faces",
            f"{sum(len(points) for points, _ in layout.solids)}, {sum(len(faces) for _, faces in layout.solids)}",
        ),
    )


def _open_joints(assembly: solver.Assembly, width: float) -> list[tuple[int, int, float]]:
    """Pairs of blocks of which faces cover each other across a gap, and its width [m], widest first."""
    contacts = mechanics.find_contacts(assembly, assembly.vertices, WIDEST_JOINT * width)
    pairs, joint = contacts.joints()
    n = len(pairs)
    low, high = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(low, joint, contacts.gaps)
    np.maximum.at(high, joint, contacts.gaps)
    area = np.bincount(joint, contacts.areas, minlength=n)
    # What touches somewhere, or opens like a wedge, is no joint that was drawn open.
    found = (low > DRAWN_GAP * width) & (high < 2.0 * low) & (area > (0.3 * width) ** 2)
    gaps = [(int(i), int(j), float(gap)) for (i, j), gap in zip(pairs[found], high[found], strict=True)]
    beside: dict[int, set[int]] = {}
    for i, j in pairs.tolist():
        beside.setdefault(i, set()).add(j)
        beside.setdefault(j, set()).add(i)
    # Stones that a sheet keeps apart have no joint with each other.
    open_ones = (
        (i, j, gap)
        for i, j, gap in gaps
        if not any(assembly.widths[k] <= (1.0 + 1e-6) * gap for k in beside[i] & beside[j])
    )
    return sorted(open_ones, key=lambda pair: -pair[2])
