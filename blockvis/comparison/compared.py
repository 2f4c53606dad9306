"""What two runs have in common and what parts them: keys of their cases, numbers, and cracks at the same settlement."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis.case_files.case_keys import SECTIONS
from blockvis.dynamics.fall import Fall
from blockvis.pictures.captions import in_one_unit, left_rest, parameter_text
from blockvis.pictures.film import state_at
from blockvis.report.page import summary_rows, tie_rows
from blockvis.results.cracks import Crack, cracks_of
from blockvis.results.fall_files import stored_fall
from blockvis.results.folder import RESULTS
from blockvis.results.joints import initial_joints, opening_and_slip
from blockvis.results.record import case_text
from blockvis.runs.once_more import SAME
from blockvis.runs.reopen import open_results
from blockvis.text import force_text, quantity_text

#: Cracks that the table lists, the widest first.
MOST_CRACKS = 10

#: How many settlements have pictures side by side: the last that both reach, and even parts of it.
STATIONS = 3


@dataclass(frozen=True)
class Side:
    """One of the two runs."""

    label: str  #: What tables and pictures call it.
    response: solver.Response  #: With an increment in equilibrium at least.
    fall: Fall | None
    case: dict[str, Any]  #: Values by key, as "material.friction_coefficient"; empty where it was written from Python.

    @property
    def end(self) -> float:
        """Parameter of the last equilibrium, over all phases [m or rad]."""
        return float(self.response.parameters[-1])

    def measured_at(self, at: float) -> str:
        """Write what is measured at a parameter over all phases [m or rad], a dash where no line leads there."""
        value, measured = float(self.state(at).measured), self.response.measured
        if np.isnan(value):
            return "–"
        return force_text(value, measured.unit == "N·m") if measured.is_force else f"{value:.5g}"

    def state(self, at: float) -> solver.Increment:
        """Give the state at a parameter over all phases [m or rad], the last beyond the end; the lowest limit load.

        Between two increments all is on the line between theirs, but for what is measured between rest and the first
        one: it has left that at rest at once, and is nan.
        """
        governing = self.response.governing
        if not self.response.parameter.is_path and governing is not None:
            return governing
        at, path = min(at, self.end), self.response.path
        here = np.flatnonzero(np.isclose(self.response.parameters, at, atol=0.0)).tolist()
        # Where one settlement ends and the next begins, the end is meant: the next may go another way.
        ends = [k for k in here if path[k].phase == path[here[0]].phase]
        if ends:
            return path[ends[-1]]
        state = state_at(path, self.response.parameters, at)
        before = max(int(np.searchsorted(self.response.parameters, at)) - 1, 0)
        on_line = np.isclose(left_rest(self.response, before), path[before].measured, atol=0.0)
        return state if on_line else replace(state, measured=np.nan)


@dataclass(frozen=True)
class Comparison:
    """Two runs of the same kind of analysis."""

    sides: tuple[Side, Side]

    @property
    def is_path(self) -> bool:
        """Whether there are states one after another; limit loads stand by themselves."""
        return self.sides[0].response.parameter.is_path

    @property
    def common_end(self) -> float:
        """The last parameter, over all phases, at which both are in equilibrium [m or rad]."""
        return min(side.end for side in self.sides)

    @property
    def stations(self) -> np.ndarray:
        """(n,) array [m or rad]: parameters at which pictures stand side by side."""
        if self.common_end <= 0.0 or not self.is_path:
            return np.zeros(1)
        return self.common_end * np.arange(1, STATIONS + 1) / STATIONS

    @property
    def longest(self) -> solver.Response:
        """The response that goes further: its parameter's unit is that of both."""
        return max(self.sides, key=lambda side: side.end).response

    def place_text(self, at: float) -> str:
        """Write a parameter [m or rad] with its name and unit."""
        response = self.longest
        several = any(increment.phase for side in self.sides for increment in side.response.path)
        return f"{response.parameter.name} {parameter_text(at, response)}{', all phases added' if several else ''}"

    def changed_keys(self) -> list[tuple[str, str, str]]:
        """List the keys of the cases whose values differ, with both; none where a case is not known."""
        one, other = (side.case for side in self.sides)
        if not (one and other):
            return []
        found = []
        for key in dict.fromkeys([*one, *other]):
            values = one.get(key), other.get(key)
            if values[0] != values[1]:
                first, second = (_value_text(value, _unit_of(key)) for value in values)
                # Beyond the digits of people.
                first, second = map(str, values) if first == second else (first, second)
                found.append((key, first, second))
        return found

    def rows(self) -> list[tuple[str, str, str]]:
        """List the numbers of both runs under one name, as the report of each has them."""
        tables = [
            dict(summary_rows(side.response, side.fall))
            | {name: f"{largest}; {fate}" for name, largest, fate in tie_rows(side.response)}
            for side in self.sides
        ]
        one, other = tables
        rows = [(name, one.get(name, "–"), other.get(name, "–")) for name in dict.fromkeys([*one, *other])]
        if self.is_path:
            name = self.sides[0].response.measured.name
            for at in self.stations.tolist():
                first, second = (side.measured_at(at) for side in self.sides)
                rows.append((f"{name} at {self.place_text(at)}", first, second))
        return rows

    def same_layout(self) -> bool:
        """Whether both have the same blocks in the same places."""
        one, other = (side.response.assembly for side in self.sides)
        if one.names != other.names or one.vertices.shape != other.vertices.shape:
            return False
        return bool(np.abs(one.vertices - other.vertices).max() <= SAME * one.block_size)

    def cracks(self, at: float) -> list[tuple[str, np.ndarray]]:
        """Compare the joints at which crack lines of either run are widest at a parameter over all phases [m or rad].

        Of each joint its two blocks and its opening in both runs, (2,) array [m], the widest first; nan where the run
        has no such joint, or a block of it has fallen.
        """
        (lines, one), (more_lines, other) = (_cracks_at(side, at) for side in self.sides)
        crack_at = {frozenset(line.widest.split(" | ")): line.widest for line in [*more_lines, *lines]}
        joints = [(crack_at[pair], np.array([of.get(pair, np.nan) for of in (one, other)])) for pair in crack_at]
        return sorted(joints, key=lambda joint: -np.round(np.nanmax(joint[1]), 6))[:MOST_CRACKS]


def compared(one: str | Path, other: str | Path) -> Comparison:
    """Open two results folders for a comparison.

    ValueError if a folder holds no results or no equilibrium, if both are the same, or if what they run over differs.
    """
    folders = Path(one), Path(other)
    if folders[0].resolve() == folders[1].resolve():
        raise ValueError(f"'{one}' and '{other}' are the same folder; give the results of two runs")
    first, second = (_opened(folder, label) for folder, label in zip(folders, _labels(*folders), strict=True))
    for what in ("parameter", "measured"):
        quantities = [getattr(side.response, what) for side in (first, second)]
        names = [f"{q.name} [{q.unit}]" if q.unit else q.name for q in quantities]
        if names[0] != names[1]:
            raise ValueError(
                f"'{one}' and '{other}' share no axis: the {what} is {names[0]} in one and {names[1]} in the other; "
                "compare two runs of the same kind of analysis"
            )
    return Comparison((first, second))


def _opened(folder: Path, label: str) -> Side:
    found = open_results(folder)
    if not found.path:
        raise ValueError(f"'{folder}' has no equilibrium to compare: {found.message or found.stop}")
    response = in_one_unit(found, found.path[-1].phase)
    if len(response.path) < len(found.path):
        raise ValueError(
            f"'{folder}' has settlements in m and in rad, which share no axis; compare runs of which all settlements "
            "are movements along a direction, or all are rotations"
        )
    text = case_text(folder)
    return Side(label, response, stored_fall(folder), dict(_flat(tomllib.loads(text))) if text else {})


def _labels(one: Path, other: Path) -> tuple[str, str]:
    """Name two folders apart as shortly as can be."""
    parts = [folder.resolve().parts for folder in (one, other)]
    depth = next(n for n in range(1, max(map(len, parts)) + 1) if parts[0][-n:] != parts[1][-n:])
    first, second = ("/".join(part[-depth:]) for part in parts)
    short = first.removesuffix(RESULTS), second.removesuffix(RESULTS)
    return short if all(short) and short[0] != short[1] else (first, second)


def _flat(values: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of a table of TOML with the keys that lead to them."""
    if isinstance(values, Mapping):
        for key, value in values.items():
            yield from _flat(value, f"{name}.{key}" if name else str(key))
    elif isinstance(values, list) and values and all(isinstance(value, Mapping) for value in values):
        for number, value in enumerate(values, start=1):
            yield from _flat(value, f"{name} {number}")
    else:
        yield name, values


def _unit_of(name: str) -> str:
    """Find the unit of a key by its name as :func:`_flat` has it; of lengths, which may be angles, none."""
    *table, key = re.sub(r" [0-9]+(?=\.)", "", name).split(".")
    sections = (section for section in SECTIONS if fnmatch(".".join(table), section.name))
    units = (known.unit for section in sections for known in section.keys if known.name == key)
    unit = next(units, "")
    return "" if unit == "m" else unit


def _value_text(value: Any, unit: str) -> str:
    """Write a value of a case as people do, of one that is not there a dash."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) or (isinstance(value, int) and unit):
        return quantity_text(value, unit)
    if isinstance(value, list):
        return ", ".join(_value_text(one, unit) for one in value)
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_value_text(one, '')}" for key, one in value.items())
    return str(value)


def _cracks_at(side: Side, at: float) -> tuple[list[Crack], dict[frozenset[str], float]]:
    """Trace the crack lines of a run, and find the openings [m] of its joints by the names of their blocks."""
    state, assembly = side.state(at), side.response.assembly
    joints = initial_joints(assembly)
    opening = opening_and_slip(assembly, joints, state.pose)[:, 0]
    # Below a micrometre none is open.
    opening[opening < 1e-6] = 0.0
    opening[state.fallen[joints.block_a] | state.fallen[joints.block_b]] = np.nan
    found: dict[frozenset[str], float] = {}
    for a, b, width in zip(joints.block_a.tolist(), joints.block_b.tolist(), opening.tolist(), strict=True):
        pair = frozenset((assembly.names[a], assembly.names[b]))
        found[pair] = max(width, found.get(pair, 0.0))
    return cracks_of(assembly, state.pose, state.fallen), found
