"""Quantities: parameters and measured values of analyses."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Quantity:
    """A parameter or a measured value of an analysis."""

    name: str  #: in words, for captions and tables
    symbol: str  #: for formulas
    unit: str  #: of its numbers; empty for a number without unit
    #: Of a parameter: whether its increments follow one another. Otherwise they are independent, and the one with the
    #: smallest measured value governs.
    is_path: bool = True

    @property
    def is_force(self) -> bool:
        """Whether it is a force or a moment."""
        return self.unit in ("N", "N·m")


SETTLEMENT, REACTION = Quantity("settlement", "s", "m"), Quantity("reaction", "R", "N")
CONTROL_DISPLACEMENT = Quantity("control displacement", "d", "m")
LOAD_POSITION = Quantity("load position", "x", "m", is_path=False)
LOAD_MULTIPLIER = Quantity("load multiplier", "α", "")


def settlement_in(unit: str) -> Quantity:
    """Make the parameter of supports that move [m], or rotate [rad]."""
    return replace(SETTLEMENT, unit=unit)


def reaction_to(unit: str) -> Quantity:
    """Make the reaction to a settlement in a unit: a force for a distance [m], a moment for a rotation [rad]."""
    return replace(REACTION, unit="N·m" if unit == "rad" else "N")
