"""Pushovers: live loads follow a growing control displacement from the limit load until none is carried."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

import solver
from blockvis.cases.block_at import block_at, blocks_called
from blockvis.cases.contents import Case
from blockvis.cases.key import FRACTION, POSITIVE, TEXT, VECTOR, Key, Section
from blockvis.cases.toml_table import Table
from blockvis.formats.reading import naming
from blockvis.results.about import EXACT, mechanism_text
from blockvis.results.mechanism_arrays import corner_speeds
from blockvis.text import beginning, nearest
from solver import mechanics

from .kind import (
    AnalysisKind,
    AnalysisRun,
    Course,
    RunInput,
    Steps,
    needs_live_load,
    needs_no_crushing,
    without_increments,
)
from .settlement import left_by, not_reached, settlement_steps

CONTROL = Section(
    "control",
    "The displacement that grows in a pushover",
    (
        Key("block", TEXT, "Name of the free block whose displacement grows", "brick 6-4", required=True,
            remedy="name the block whose displacement grows"),
        Key("direction", VECTOR, "Direction in which the displacement counts; its length does not count", [1.0, 0.0],
            otherwise="along x"),
        Key("point", VECTOR, "Point of the block, in the drawing", [1.0, 2.0], "m", otherwise="its centroid"),
        Key("increment", POSITIVE, "Largest step", 0.01, "m", 0.01),
        Key("limit", POSITIVE, "Displacement at which to stop if capacity is left", 0.5, "m", 1.0),
        Key("tolerance", POSITIVE, "Width of the bracket of the displacement at which it is lost", 1e-4, "m",
            otherwise="a hundredth of the increment"),
        Key("step_tolerance", FRACTION, "Relative error of the multiplier that steps aim for; a smaller one of "
            "[settlement] holds over it", 0.002, default=solver.Controls.step_tolerance, elsewhere=True),
    ),
)  # fmt: skip


#: A block that moves so many times as fast as the control point is told: of one body on a hinge, the top does not.
MOST_TIMES_AS_FAST = 10.0


class PushoverKind(AnalysisKind):
    """The load multiplier over a control displacement, after settlements where there are any."""

    name = "pushover"
    parameter = mechanics.CONTROL_DISPLACEMENT
    measured = mechanics.LOAD_MULTIPLIER
    checkpoint = mechanics.PathState
    sections = (CONTROL,)

    def read(self, top: Table, analysis: Table) -> solver.ControlDisplacement | None:
        """Read the control displacement, of [control]."""
        table = top.table("control")
        if not table.values:
            return None
        values = CONTROL.read(table)
        # It belongs to the controls.
        del values["step_tolerance"]
        with beginning(f"{table.source}: [{table.where}]"):
            return solver.ControlDisplacement(**values)

    def refuse(self, settings: Any, case: Case) -> None:
        """Refuse a [control] that controls nothing."""
        if settings is not None:
            raise ValueError(
                f'{case.source}: [control] belongs to [analysis] kind = "{self.name}", not "{case.analysis}"'
            )

    def checked(self, case: Case) -> Case:
        """Check that the keys of a case fit together."""
        needs_live_load(case)
        needs_no_crushing(case)
        if case.settings is None:
            raise ValueError(
                f'{case.source}: [control] is missing; a pushover needs the displacement that grows, block = "..." and '
                "direction = [1, 0], in space [1, 0, 0]"
            )
        for number, load in enumerate(case.loads, start=1):
            if load.positions:
                raise ValueError(f'{case.source}: [loads {number}] positions belong to [analysis] kind = "limit load"')
        return case

    def course(self, case: Case) -> Course:
        """Run over the control displacement of a case."""
        return Course(self.parameter, self.measured, control=case.settings)

    def start(self, given: RunInput, resume: Any, found: Sequence[solver.Increment]) -> AnalysisRun:
        """Prepare the settlements of a case, of which only a fall is reported, and the pushover."""
        control = _checked_control(given.case, given.assembly)
        course = replace(self.course(given.case), control=control)
        return AnalysisRun(self.name, given, course, mechanics.Increments(_steps(given, control, resume)).begin())

    def summary(self, response: solver.Response) -> dict[str, Any]:
        """Give the control displacement, and the multiplier at the start and where it is largest."""
        values, control, largest = response.values, response.control, _largest(response)
        return {
            "control": asdict(control) if isinstance(control, solver.ControlDisplacement) else None,
            "limit_load_multiplier": float(values[0]) if len(values) and math.isfinite(values[0]) else None,
            "largest_load_multiplier": None if largest is None else largest.load_multiplier,
            "largest_load_multiplier_at": None if largest is None else largest.parameter,
        }

    def restored(self, response: solver.Response, summary: Mapping[str, Any]) -> solver.Response:
        """Complete the response by the control displacement of the summary."""
        control = solver.ControlDisplacement(**summary["control"]) if summary.get("control") else None
        return replace(super().restored(response, summary), control=control)

    def lines(self, response: solver.Response) -> list[str]:
        """Describe the first, the largest and the last multiplier, and where the capacity is lost."""
        path, weight = response.path, response.total_weight
        lines = []
        if path:
            words = {
                "first": ", were joints and ground rigid" if response.interfaces.elastic else "",
                "largest": ", the largest of the told increments",
            }
            for name, i in (("first", path[0]), ("largest", _largest(response) or path[0]), ("last", path[-1])):
                # Moments have no resultant.
                load = f", live load {i.reaction:.6g} N = {i.reaction / weight:.6f} W" if i.reaction else ""
                load += words.get(name, "")
                name = f"{name} multiplier"
                lines.append(f"{name:<21}{i.load_multiplier:12.6g}     at {i.parameter:.6g} m{load}")
        if response.collapse is not None:
            low, high = response.collapse.bracket
            at = response.collapse.displacement
            lines += [
                f"{_lost(response):<21}{at:12.6g} m   between {low:.6g} and {high:.6g}",
                f"mechanism: {mechanism_text(response)}",
            ]
        return lines

    def title(self, response: solver.Response) -> str:
        """Say how it ended."""
        if response.collapse is not None:
            what = _lost(response)
            return f"{what[0].upper()}{what[1:]} a control displacement of {response.collapse.displacement:.5g} m"
        return f"Pushover: {response.stop}"

    def rows(self, response: solver.Response) -> list[tuple[str, str]]:
        """Say where the capacity is lost, and the multipliers."""
        rows, c = [], response.collapse
        if c is not None:
            place = f"{c.displacement:.6g} {c.unit}, between {c.bracket[0]:.6g} and {c.bracket[1]:.6g}"
            rows.append((_lost(response), place))
        if response.path:
            values = response.values
            rigid = ", were joints and ground rigid" if response.interfaces.elastic else ""
            rows.append((f"load multiplier α at the start{rigid}", f"{values[0]:.6g}"))
            largest = (_largest(response) or response.path[0]).load_multiplier
            rows.append(("largest of the told increments, last", f"{largest:.6g}, {values[-1]:.6g}"))
        return rows


def _largest(response: solver.Response) -> solver.Increment | None:
    """Find the told increment of the largest multiplier, of a plateau the first; where joints give the first not."""
    path = response.path[1:] if response.interfaces.elastic else response.path
    found = [increment for increment in path if math.isfinite(increment.load_multiplier)]
    most = max((increment.load_multiplier for increment in found), default=0.0)
    return next((i for i in found if i.load_multiplier >= most - EXACT * abs(most)), None)


def _lost(response: solver.Response) -> str:
    """Say what a pushover has lost where it ends."""
    if response.collapse is not None and response.collapse.lost == "capacity":
        return "zero capacity at"
    return f"equilibrium lost along the control at α = {response.path[-1].load_multiplier:.6g}, at"


def _checked_control(case: Case, assembly: solver.Assembly) -> solver.ControlDisplacement:
    """Find the one free block that a [control] names, of several with its name the one that holds the point."""
    control: solver.ControlDisplacement = case.settings
    where, free = f"{case.source}: [control]", np.flatnonzero(assembly.free)
    meant = np.intersect1d(blocks_called(control.block, assembly), free)
    if not len(meant):
        names = [assembly.names[i] for i in free]
        what = "is a support" if control.block in assembly.names else "is no block of the layout"
        raise ValueError(
            f"{where} block '{control.block}' {what}{nearest(control.block, names)}; name a free block, for instance "
            f"{', '.join(names[:6])}"
        )
    block = int(meant[0])
    if len(meant) > 1:
        if control.point is None:
            raise ValueError(f"{where} block: {len(meant)} blocks are called '{control.block}'; give a point of one")
        towards = np.eye(assembly.dimension)[0] if control.direction is None else control.direction
        block = block_at(assembly, control.point, meant, towards, f"{where} point", ~assembly.free)
    return replace(control, block=assembly.names[block])


def _left_behind(
    assembly: solver.Assembly, control: solver.ControlDisplacement, increment: solver.Increment
) -> list[str]:
    """Say that what the live load moves hardly moves the control point, for which nothing can be told of its path."""
    block, pose, d = [assembly.index(control.block)], increment.pose, assembly.dimension
    point = np.atleast_2d(assembly.centroids[block] if control.point is None else control.point)
    point = mechanics.carried(point, np.array(block), solver.Pose.initial(assembly), pose)
    towards = np.eye(d)[0] if control.direction is None else np.asarray(control.direction)
    own = float(mechanics.point_velocities(point, np.array(block), pose, increment.velocity)[0] @ towards)
    speeds = corner_speeds(assembly, pose, increment.velocity)
    fastest = int(speeds.argmax())
    if speeds[fastest] <= MOST_TIMES_AS_FAST * abs(own):
        return []
    name, times = assembly.names[fastest], f"{speeds[fastest] / abs(own):.2g} times as fast as" if own else "and not"
    return [
        f"[control] block = '{control.block}' is not what the live load moves: '{name}' moves {times} its control "
        f"point, whose displacement says little of the path; name '{name}' as the block"
    ]


def _steps(given: RunInput, control: solver.ControlDisplacement, resume: mechanics.PathState | None) -> Steps:
    case = given.case
    pose, ties_at, bonds_at = None, None, None
    # A pushover that has begun has its settlement behind it.
    steps = settlement_steps(given, whole=True) if resume is None else without_increments()
    for increment in steps:
        if increment.status == solver.Status.FALLING:
            yield replace(increment, parameter=0.0, measured=increment.load_multiplier, phase=0)
        pose, ties_at, bonds_at = increment.pose, increment.ties, increment.bonds
    if steps.ending.stop is not solver.Status.LIMIT_REACHED:
        return not_reached(steps.ending, "nothing is left to push over")
    with naming(str(case.source)):
        pushed = mechanics.pushover_increments(
            given.assembly,
            control,
            loads=given.loads,
            interfaces=given.interfaces,
            controls=case.controls,
            pose=pose,
            ties=given.ties,
            ties_at=ties_at,
            bonds_at=bonds_at,
            resume=resume,
            on_step=given.step,
        )
        for number, increment in enumerate(pushed):
            words = left_by(case.settlements) if number == 0 and resume is None else []
            words += _left_behind(given.assembly, control, increment) if number == 0 else []
            yield replace(increment, notes=(*increment.notes, *words))
    return pushed.ending
