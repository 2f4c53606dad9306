"""The study file, read and checked before any run starts."""

from __future__ import annotations

import copy
import hashlib
import tomllib
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from blockvis.case_files.read import case_of, parsed_toml, read_case, utf8_text
from blockvis.cases.build import case_assembly
from blockvis.cases.distributions import Distribution, distribution_of
from blockvis.cases.imperfections import read_imperfection
from blockvis.cases.toml_table import Table, shortened
from blockvis.cases.value_paths import parse_path, put
from blockvis.formats.files import checksum_of_files
from blockvis.kinds.kinds import KINDS
from blockvis.text import beginning
from solver.mechanics import Quantity, counted

from . import study_keys as keys
from .sampling import Design, designed

#: Columns of the table besides the parameters.
RESERVED = (
    "run", "status", "collapse_displacement", "bracket_low", "bracket_high", "last_settlement", "unit",
    "mechanism_class", "mechanism", "macro_blocks", "hinges", "sliding_joints", "initial_reaction",
    "collapse_reaction", "last_reaction", "load_multiplier", "largest_opening", "total_weight", "falling_share",
    "lost_share",
    "increments", "programs", "seconds", "seed", "message",
)  # fmt: skip

#: Number of runs of which one has to be built before any run starts.
TRIED = 8

#: Number of runs that are checked as cases before any run starts, which takes a few seconds; another run of a larger
#: study that is no valid case is recorded as failed.
CHECKED = 10_000


@dataclass(frozen=True)
class Parameter:
    """A number, or other value, of the case that is varied."""

    path: str  #: Its path in the case file, as ``material.friction_coefficient``.
    name: str  #: Its column in the table; by default the path.
    also: tuple[str, ...]  #: Further paths of the same value.
    distribution: Distribution | None
    values: tuple[Any, ...]  #: The values to choose from, if there is no distribution.
    weights: np.ndarray  #: (n_values,) array: their probabilities.
    points: int  #: Number of values of the distribution in a grid.

    @property
    def numeric(self) -> bool:
        """Whether every value is a number."""
        return all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in self.values)

    @property
    def n_levels(self) -> int:
        """Number of values in a grid."""
        return self.points if self.distribution is not None else len(self.values)

    def value(self, probability: float) -> Any:
        """Find the value that the parameter does not exceed with a probability; of a list, its entry there."""
        if self.distribution is not None:
            return float(self.distribution.quantile(np.array([probability]))[0])
        return self.values[
            min(int(np.searchsorted(np.cumsum(self.weights), probability, "right")), len(self.values) - 1)
        ]


@dataclass(frozen=True)
class Study:
    """A checked study. The keys are those of the study file; see `docs/studies.md`."""

    source: Path
    case_source: Path  #: The base case; paths in it are relative to its folder.
    values: dict[str, Any]  #: The base case as parsed TOML, with the imperfections of the study behind its own.
    n_seeded: int  #: Number of the last of these imperfections, those of the study, which get a new seed in every run.
    parameters: tuple[Parameter, ...]
    method: str
    runs: int  #: Number of runs in the study file: of a "saltelli" design the size of its two independent samples.
    repeats: int  #: Runs per point of a grid, with different imperfections.
    seed: int
    seconds: float | None  #: Longest time of one run [s].
    keep: tuple[int, ...]  #: Runs whose results folder is written.

    @cached_property
    def design(self) -> Design:
        """The runs: probabilities of the parameters, and seeds."""
        levels = [p.n_levels for p in self.parameters]
        with beginning(f"{self.source}: [study]"):
            return designed(self.method, self.runs, levels, self.repeats, self.seed, scattered=self.n_seeded > 0)

    @cached_property
    def capacity(self) -> Quantity:
        """At which value of what its runs collapse."""
        return KINDS[case_of(self.values, self.case_source).analysis].capacity

    @property
    def n_runs(self) -> int:
        """Number of runs."""
        return len(self.design.seeds)

    def point(self, run: int) -> dict[str, Any]:
        """Value of every parameter in a run, by name."""
        probability = self.design.probabilities[run]
        return {p.name: p.value(float(u)) for p, u in zip(self.parameters, probability, strict=True)}

    def order(self, run: int) -> dict[str, Any]:
        """List what :func:`blockvis.studies.run_one.run_once` needs for one run besides the base case."""
        point = self.point(run)
        paths = {path: point[p.name] for p in self.parameters for path in (p.path, *p.also)}
        return {"run": run, "seed": int(self.design.seeds[run]), "paths": paths, "point": point}

    def values_of(self, run: int) -> dict[str, Any]:
        """Make the values of the case of one run, as of parsed TOML."""
        return run_values(self.values, self.order(run), self.n_seeded)

    def definition(self) -> dict[str, Any]:
        """Hashes of everything on which the rows depend, to compare with those of rows on the disk."""
        case = {k: v for k, v in self.values.items() if k not in ("output", "imperfections")}
        file = case_of(self.values, self.case_source).file
        parts = {
            "case": case,
            "imperfections": self.values.get("imperfections", []),
            "parameters": {
                p.name: [p.path, p.also, p.values, p.weights.tolist(), p.points]
                + ([p.distribution.kind, dict(p.distribution.numbers)] if p.distribution else [])
                for p in self.parameters
            },
            "method": self.method,
            "runs": self.runs,
            "repeats": self.repeats,
            "seed": self.seed,
            "layout file": "" if file is None else checksum_of_files(file),
        }
        return {what: hashlib.sha256(repr(_sorted(part)).encode()).hexdigest()[:16] for what, part in parts.items()}


def run_values(values: Mapping[str, Any], order: Mapping[str, Any], n_seeded: int) -> dict[str, Any]:
    """Put the values and the seed of a run, as of :meth:`Study.order`, into the base case as parsed TOML.

    The seed is of the last ``n_seeded`` imperfections, those of the study.
    """
    case = copy.deepcopy(dict(values))
    for path, value in order["paths"].items():
        put(case, parse_path(path), copy.deepcopy(value))
    found = case.get("imperfections", [])
    for imperfection in found[len(found) - n_seeded :]:
        imperfection["seed"] = order["seed"]
    return case


def read_study(source: str | Path | Mapping[str, Any]) -> Study:
    """Read and check a study file, or its content, whose paths are relative to the working directory, and its runs.

    Raises ``ValueError`` for an unknown path of a parameter, an impossible distribution, a run that is no valid case;
    names the file, the key and the remedy.
    """
    if isinstance(source, Mapping):
        return _study(source, Path("study"))
    path = Path(source)
    if not path.is_file():
        raise ValueError(f"there is no study file '{path}'")
    return _study(parsed_toml(utf8_text(path), path, "study file", 'case = "arch.toml"'), path)


def _study(given: Mapping[str, Any], source: Path) -> Study:
    where = f"{source}: "
    top = Table(given, "", source)
    top.finish([section.name.removesuffix(".*") for section in keys.SECTIONS])
    head = top.table("study")
    asked = keys.STUDY.read(head)
    values, case_source = _base_case(asked["case"], source)
    parameters = _parameters(top.table("parameters"))
    imperfections = _imperfections(top)
    if not parameters and not imperfections:
        raise ValueError(f"{where}nothing is varied; give [parameters] or [[imperfections]]")
    # Paths of parameters count those of the case.
    own = values.get("imperfections", [])
    scattered = [*(own if isinstance(own, list | tuple) else [own]), *imperfections]
    if scattered:
        values["imperfections"] = scattered
    method = asked["method"]
    if method == "grid" and "runs" in head.values:
        raise head.error("runs", "is given, but a grid has as many as its values make; give repeats instead")
    if method != "grid" and "repeats" in head.values:
        raise head.error("repeats", "belong to a grid; give runs")
    study = Study(
        source=source,
        case_source=case_source,
        values=values,
        n_seeded=len(imperfections),
        parameters=parameters,
        **{key: value for key, value in asked.items() if key != "case"},
    )
    _check(study, where)
    return study


def _check(study: Study, where: str) -> None:
    told = f"{where}with its [[imperfections]] behind those of the case,"
    with beginning(told) if study.n_seeded else nullcontext():
        case_of(study.values, study.case_source)
    if study.method == "grid":
        _check_grid(study, where)
    drawn = next((p for p in study.parameters if p.points and study.method != "grid"), None)
    if drawn is not None:
        raise ValueError(f'{where}[parameters] "{drawn.path}": points belong to a grid; give [study] runs')
    _check_paths(study, where, 0)
    _check_runs(study, where)


def _check_grid(study: Study, where: str) -> None:
    for p in study.parameters:
        if p.distribution is not None and not p.points:
            raise ValueError(
                f'{where}[parameters] "{p.path}": a grid needs points, the number of values to take, at least 2'
            )
        if len(p.weights) and np.ptp(p.weights) > 0.0:
            raise ValueError(f'{where}[parameters] "{p.path}": a grid takes every value once; weights are for samples')
    if study.repeats > 1 and not study.n_seeded:
        raise ValueError(f"{where}[study] repeats is {study.repeats}, but without [[imperfections]] they are all alike")


def _check_paths(study: Study, where: str, run: int) -> None:
    """Put each parameter of a run alone into the base case, so that a message names the wrong path, not the run."""
    order = study.order(run)
    for p in study.parameters:
        for path in (p.path, *p.also):
            alone = {**order, "paths": {path: order["paths"][path]}}
            try:
                case_of(run_values(study.values, alone, study.n_seeded), study.case_source)
            except ValueError as error:
                limit = "" if p.distribution is None else "lower" if order["paths"][path] < p.value(0.5) else "upper"
                remedy = f": its distribution goes beyond, limit it by {limit}" if limit else ""
                raise ValueError(f'{where}[parameters] "{path}": {error}{remedy}') from None


def _spread(study: Study, most: int) -> list[int]:
    """Choose so many runs from all over a study: the outermost value of a grid changes last."""
    runs: list[int] = np.unique(np.linspace(0, study.n_runs - 1, min(study.n_runs, most)).astype(int)).tolist()
    return runs


def _check_runs(study: Study, where: str) -> None:
    refused = []
    for run in _spread(study, TRIED):
        try:
            # Only building a parametric layout shows whether its parameters are right.
            case_assembly(case_of(study.values_of(run), study.case_source))
            break
        except ValueError as error:
            refused.append(error)
    else:
        raise ValueError(f"{where}run 0 cannot be built, nor can others of the study: {refused[0]}")
    first: dict[str, str] = {}
    for run in _spread(study, CHECKED):
        shown = f"run {run} ({', '.join(f'{name} = {shortened(value)}' for name, value in study.point(run).items())})"
        try:
            case = case_of(study.values_of(run), study.case_source)
        except ValueError as error:
            _check_paths(study, where, run)
            raise ValueError(f"{where}{shown} is no case: {error}") from None
        capacity = KINDS[case.analysis].capacity
        units = [driver.unit for driver in KINDS[case.analysis].course(case).drivers] if capacity.unit else [""]
        for number, unit in enumerate((f"in {unit}" if unit else "without unit" for unit in units), start=1):
            first.setdefault(f"{capacity.name} {unit}", f"{capacity.name} {number} of {shown} is {unit}")
    if len(first) > 1:
        told = " and ".join(place for _, place in sorted(first.items()))
        raise ValueError(
            f"{where}a study tells by one number where all its runs collapse, but {told}; leave out those of one, or "
            "make a study of each"
        )


def _base_case(given: Any, source: Path) -> tuple[dict[str, Any], Path]:
    if isinstance(given, Mapping):
        return copy.deepcopy(dict(given)), source.absolute()
    path = (source.parent / given).absolute()
    text = read_case(path).text
    return tomllib.loads(text), path


def _parameters(table: Table) -> tuple[Parameter, ...]:
    found = []
    for path, given in table.values.items():
        if not isinstance(given, list | Mapping):
            raise table.error(
                f'"{path}"', f"is {shortened(given)}; give a list of values, or a table with a distribution"
            )
        values = given if isinstance(given, Mapping) else {"values": given}
        found.append(_parameter(path, Table(values, f'parameters."{path}"', table.source)))
    names = [p.name for p in found]
    for name in names:
        if name in RESERVED:
            raise table.error("name", f"'{name}' is a column of the table already; choose another")
        if names.count(name) > 1:
            raise table.error("name", f"'{name}' is that of two parameters; choose another name for one")
    paths = [path for p in found for path in (p.path, *p.also)]
    for path in paths:
        if paths.count(path) > 1:
            raise table.error(f'"{path}"', "is varied twice")
    return tuple(found)


def _parameter(path: str, table: Table) -> Parameter:
    listed = "values" in table.values
    given = (keys.LISTED if listed else keys.DRAWN).read(table)
    for key, one in (("path", path), *(("also", one) for one in given["also"])):
        try:
            parse_path(one)
        except ValueError as error:
            raise table.error(key, str(error)) from None
    name = given["name"] or path
    if not listed:
        drawn = distribution_of(given, table)
        return Parameter(path, name, given["also"], drawn, (), np.zeros(0), given["points"] or 0)
    values = given["values"]
    weights = np.ones(len(values)) if given["weights"] is None else np.array(given["weights"])
    if len(weights) != len(values):
        raise table.error(
            "weights", f"has {counted(len(weights), 'number')}; give one for each of {counted(len(values), 'value')}"
        )
    return Parameter(path, name, given["also"], None, values, weights / weights.sum(), 0)


def _imperfections(top: Table) -> list[dict[str, Any]]:
    found = []
    for table in top.tables("imperfections"):
        if "seed" in table.values:
            raise table.error("seed", "is given, but the study gives every run its own; a fixed one is of the case")
        read_imperfection(table, keys.IMPERFECTIONS)
        found.append(dict(table.values))
    return found


def _sorted(part: Any) -> Any:
    """Sort the keys of tables, so that their order does not matter in a comparison."""
    if isinstance(part, Mapping):
        return sorted((str(k), _sorted(v)) for k, v in part.items())
    return [_sorted(v) for v in part] if isinstance(part, (list, tuple)) else part
