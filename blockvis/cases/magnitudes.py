"""Numbers of a case that no masonry has, and the unit in which it would have them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import solver

from .contents import Case


@dataclass(frozen=True)
class Plausible:
    """What a key may be in its unit, models of plaster, lead or rubber included, and what its value is else.

    ``others`` are units in which it is given by mistake, the likeliest first, with the number of its own in each and
    the largest number that is likely in it; a number is doubted only where one of them makes it plausible.
    """

    unit: str
    lowest: float
    highest: float
    below: str
    above: str
    others: tuple[tuple[str, float, float], ...]

    def doubt(self, value: float) -> str:
        """Doubt a value, and say what to give for it; empty where it is plausible."""
        if self.lowest <= value <= self.highest or value <= 0.0:
            return ""
        for unit, factor, most in self.others:
            if value <= most and self.lowest <= factor * value <= self.highest:
                what = self.below if value < self.lowest else self.above
                return f"{value:g} {self.unit} is {what}; if it is in {unit}, give {factor * value:.4g} {self.unit}"
        return ""


_STRESS = (("MPa", 1e6, math.inf),)
_STIFFNESS = Plausible("Pa/m", 1e3, math.inf, "softer than foam", "", (("GPa/m, which is N/mm³", 1e9, math.inf),))

#: Of each key what is plausible; a joint that holds 10 Pa bears half a millimetre of stone.
PLAUSIBLE = {
    "density": Plausible("kg/m³", 100.0, 12000.0, "lighter than masonry", "heavier than lead", (("t/m³", 1e3, 8.0),
        ("kN/m³", 1e3 / solver.GRAVITY, math.inf), ("N/m³", 1.0 / solver.GRAVITY, math.inf), ("g/m³", 1e-3, math.inf))),
    "thickness": Plausible("m", 0.0, 75.0, "", "deeper than any wall or vault", (("mm", 1e-3, math.inf),)),
    "unit_weight": Plausible("N/m³", 100.0, math.inf, "lighter than any fill", "", (("kN/m³", 1e3, math.inf),)),
    "cohesion": Plausible("Pa", 10.0, math.inf, "next to nothing", "", _STRESS),
    "tensile_strength": Plausible("Pa", 10.0, math.inf, "next to nothing", "", _STRESS),
    "compressive_strength": Plausible("Pa", 1e3, math.inf, "weaker than any mortar", "", _STRESS),
    "normal_stiffness": _STIFFNESS,
    "shear_stiffness": _STIFFNESS,
    "stiffness": Plausible("Pa/m", 1e3, math.inf, "softer than any ground", "",
        (("MPa/m, which is MN/m³", 1e6, math.inf),)),
    "modulus": Plausible("Pa", 3e5, 1.5e12, "softer than rubber", "",
        (("GPa", 1e9, math.inf), ("MPa", 1e6, math.inf))),
    "area": Plausible("m²", 0.0, 10.0, "", "wider than any tie", (("mm²", 1e-6, math.inf),)),
}  # fmt: skip


def doubted_numbers(case: Case, assembly: solver.Assembly) -> list[str]:
    """Doubt densities of an assembly, and numbers of its case, that are probably in another unit."""
    notes = []
    for where, key, value in _numbers(case, assembly):
        if note := PLAUSIBLE[key].doubt(value):
            notes.append(f"{where} {key} = {note}" if where else f"{key} {note}")
    return list(dict.fromkeys(notes))


def _numbers(case: Case, assembly: solver.Assembly) -> Iterator[tuple[str, str, float]]:
    """Give the numbers of a case: where each is, if not in the file of the blocks, its key, and its value."""
    densities = assembly.density[assembly.free]
    if len(densities):
        yield "", "density", float(np.min(densities))
        yield "", "density", float(np.max(densities))
    if case.thickness is not None:
        yield "[geometry]", "thickness", case.thickness
    laws = {"[material]": case.law}
    laws |= {f"[[interfaces]] {' and '.join(pair)}": law for pair, law in case.interfaces.items()}
    for where, law in laws.items():
        for key in ("cohesion", "tensile_strength", "compressive_strength", "normal_stiffness", "shear_stiffness"):
            yield where, key, getattr(law, key)
    for name, stiffness in case.ground.items():
        yield f"[[supports]] '{name}'", "stiffness", stiffness
    for tie in case.ties:
        for key, value in (("area", tie.area), ("modulus", tie.modulus)):
            if value is not None:
                yield f"[[ties]] '{tie.name}'", key, value
    for fill in case.backfills:
        yield fill["where"].rpartition(": ")[2], "unit_weight", fill["unit_weight"]
