"""Controls of an increment loop, and its ending."""

from __future__ import annotations

import math
from dataclasses import dataclass

from solver.results.increment import Status
from solver.results.response import Collapse
from solver.words import make_plain

#: Methods to find increments: the path of Coulomb friction, or the linear programs of the paper.
COULOMB, LINEAR_PROGRAM = "coulomb", "linear program"


@dataclass(frozen=True)
class Controls:
    """Controls of the increment loop; the defaults suit all structures that we have tried.

    Attributes
    ----------
    increments : {"coulomb", "linear program"}, optional
        The path of Coulomb friction, by default, or the method of Portioli & Cascini (2017) with a linear program per
        increment, of settlements in the plane only, which gives the least reaction.
    overlap_tolerance : float, optional [m]
        Overlap of two blocks in the drawing that is accepted; a thousandth of the width of the thinnest block.
    falling_frames : int
        Frames of the fall after collapse: enough for the mechanism.
    step_tolerance : float
        Relative error of the reaction that the steps of the path are chosen for.
    local_loss : float
        Share of the weight of fallen blocks up to which the path goes on without them.
    compliance_factor : float
        Times the compliance of the joints across and along, of the path of Coulomb friction.
    imperfection_factor : float
        Times the load along the movement of the supports by which symmetric structures leave their symmetric path.

    Raises
    ------
    ValueError
        For an unknown method to find increments, or a number out of its range.
    """

    increments: str | None = None
    overlap_tolerance: float | None = None
    falling_frames: int = 10
    step_tolerance: float = 0.005
    local_loss: float = 0.05
    compliance_factor: float = 1.0
    imperfection_factor: float = 1.0

    def __post_init__(self) -> None:
        """Refuse an unknown method, and numbers out of their range."""
        make_plain(self)
        if self.increments not in (None, COULOMB, LINEAR_PROGRAM):
            raise ValueError(f"increments is '{self.increments}'; it is 'coulomb' or 'linear program'")
        for name, fits, wanted in (
            ("falling_frames", self.falling_frames >= 0, "of at least 0, by default 10"),
            ("step_tolerance", 0.0 < self.step_tolerance < 1.0, "between 0 and 1, by default 0.005"),
            ("local_loss", 0.0 <= self.local_loss <= 1.0, "from 0 to 1, a share of the weight, by default 0.05"),
            ("compliance_factor", 0.0 < self.compliance_factor < math.inf, "above 0, by default 1"),
            ("imperfection_factor", 0.0 <= self.imperfection_factor < math.inf, "of at least 0, by default 1"),
        ):
            if not fits:
                raise ValueError(f"{name} is {getattr(self, name):g}; it is a number {wanted}")


@dataclass(frozen=True)
class Ending:
    """The ending of an increment loop: the value that its generator returns."""

    stop: Status
    message: str = ""
    collapse: Collapse | None = None
