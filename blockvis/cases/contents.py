"""Case: what a case file says, read and checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import solver
from blockvis.formats.image_scale import ImageKeys
from blockvis.layout.sights import Cut, Sight

from .bonds import Bonding
from .explain_settings import ExplainSettings
from .imperfections import Imperfection
from .loads import LoadCase
from .profiles import Profile
from .removals import Removal
from .role_places import RolePlace
from .ties import TieCase


@dataclass(frozen=True)
class Case:
    """A checked case file. The keys are those of the file; see `docs/cases.md`.

    Attributes
    ----------
    source : Path
        The case file; paths in it, as that of the underlay, are relative to its folder.
    text : str
        The case file as it was read.
    role_places : tuple of RolePlace
        Roles by place, under those by name.
    tie_layers : tuple of str
        Layers of the drawing whose lines are ties.
    settings : optional
        What the kind of analysis has read from its own keys; see :meth:`blockvis.kinds.kind.AnalysisKind.read`.
    profiles : tuple of Profile or None
        Of the settlements along x; :func:`blockvis.cases.profiles.with_profiles` makes motions of supports of them.
    increment_seconds : float or None [s]
        What an increment of a path may take.
    explain : ExplainSettings
        What ``blockvis explain`` looks for; other analyses leave it alone.
    sight, cut : Sight or None, Cut or None
        From where blocks in space are drawn, and the plane that cuts them open.
    """

    source: Path
    text: str
    file: Path | None = None
    layout: str | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    unit: str | None = None
    view: str | None = None
    dimension: int | str = "auto"
    ignore: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    tie_layers: tuple[str, ...] = ()
    window: tuple[float, ...] | None = None
    image: ImageKeys = field(default_factory=ImageKeys)
    thickness: float | None = None
    bonds: tuple[Bonding, ...] = ()
    joint_thickness: float | str = 0.0
    closing: str = "auto"
    outline_tolerance: float | None = None
    overlap_tolerance: float | None = None
    roles: Mapping[str, str] = field(default_factory=dict)
    role_places: tuple[RolePlace, ...] = ()
    supports: tuple[Mapping[str, Any], ...] = ()
    density: float | None = None
    densities: Mapping[str, float] = field(default_factory=dict)
    friction_coefficient: float = solver.InterfaceLaw.friction_coefficient
    cohesion: float = 0.0
    compressive_strength: float = math.inf
    tensile_strength: float = 0.0
    normal_stiffness: float = math.inf
    shear_stiffness: float = math.inf
    fracture_opening: float = 0.0
    fracture_slip: float = 0.0
    interfaces: Mapping[tuple[str, str], solver.InterfaceLaw] = field(default_factory=dict)
    imperfections: tuple[Imperfection, ...] = ()
    settlements: tuple[solver.Settlement, ...] = ()
    profiles: tuple[Profile | None, ...] = ()
    loads: tuple[LoadCase, ...] = ()
    backfills: tuple[Mapping[str, Any], ...] = ()
    removals: tuple[Removal, ...] = ()
    ties: tuple[TieCase, ...] = ()
    analysis: str = "settlement"
    settings: Any = None
    controls: solver.Controls = field(default_factory=solver.Controls)
    increment_seconds: float | None = None
    explain: ExplainSettings = field(default_factory=ExplainSettings)
    animation: str | None = "collapse.mp4"
    vtu: str = "moved"
    vtu_strings: bool = True
    underlay: str | None = None
    sight: Sight | None = None
    cut: Cut | None = None

    @property
    def law(self) -> solver.InterfaceLaw:
        """The law of joints for which nothing else is said."""
        return solver.InterfaceLaw(**{one.name: getattr(self, one.name) for one in fields(solver.InterfaceLaw)})

    @property
    def ground(self) -> dict[str, float]:
        """Stiffness [Pa/m] of the ground under supports, by their names."""
        return {str(s["name"]): float(s["stiffness"]) for s in self.supports if s.get("stiffness") is not None}
