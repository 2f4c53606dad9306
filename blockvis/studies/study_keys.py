"""Every key of the study file; :mod:`blockvis.studies.study_file` refuses all others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from blockvis.case_files.schema import DRAFT, case_values, one_or_several
from blockvis.cases import imperfections
from blockvis.cases.distributions import DISTRIBUTION_KEYS, FORMS, KINDS
from blockvis.cases.key import NUMBERS, POSITIVE, TEXT, TEXTS, Key, Section, ValueKind, one_of, read_by, whole
from blockvis.cases.toml_table import Table, shortened

from .sampling import METHODS

_NAME_CASE = "name a case file, relative to the study file"


def _case(given: Any) -> str | Path | Mapping[str, Any]:
    if not isinstance(given, str | Path | Mapping):
        raise ValueError(f"is {shortened(given)}; {_NAME_CASE}")
    return given


def _runs(given: Any) -> tuple[int, ...]:
    runs = tuple(given) if isinstance(given, list | tuple) else (given,)
    for run in runs:
        if isinstance(run, bool) or not isinstance(run, int) or run < 0:
            raise ValueError(f"names run {shortened(run)}; runs are whole numbers from 0")
    return runs


def _values(given: Any) -> tuple[Any, ...]:
    if not isinstance(given, list | tuple) or len(given) == 0:
        raise ValueError(f"is {shortened(given)}; give a list of at least one")
    return tuple(given)


def _name(given: str) -> str:
    if not given:
        raise ValueError("is empty; give a text in quotes")
    return given


def _weights(given: tuple[float, ...]) -> tuple[float, ...]:
    if min(given) < 0.0 or not np.any(given):
        raise ValueError(f"is {list(given)}; give numbers of at least 0, not all 0")
    return given


STUDY = Section(
    "study",
    "The case and its runs",
    (
        Key("case", ValueKind("name of a case file, or a table with its keys", {"type": ["string", "object"]},
            read_by(_case)), "Base case, relative to the study file", "../semicircular_arch.toml", required=True,
            remedy=_NAME_CASE),
        Key("method", one_of(METHODS), 'How values are chosen; "saltelli" is for Sobol\' indices', "sobol",
            default="latin hypercube"),
        Key("runs", whole(1), "Number of runs; of saltelli the size of its two samples; a grid has as many as its "
            "values make", 256, default=64),
        Key("repeats", whole(1), "Runs per point of a grid, with different imperfections", 4, default=1),
        Key("seed", whole(0), "Of all random numbers", 1, default=1),
        Key("seconds", POSITIVE, "Longest time of one run", 600, "s", otherwise="no limit"),
        Key("keep", ValueKind("whole number, or list of them",
            {"anyOf": [{"type": "integer", "minimum": 0},
                       {"type": "array", "items": {"type": "integer", "minimum": 0}}]}, read_by(_runs)),
            "Numbers of the runs, from 0, whose whole results folder is written", [3, 17], default=()),
    ),
    required=True,
)  # fmt: skip

_COMMON_KEYS = (
    Key("name", replace(TEXT, read=read_by(_name, Table.text)), "Column of the table and label of the pictures",
        "friction", otherwise="the path"),
    Key("also", TEXTS, "Further paths that take the same value", ["supports[1].outline"], default=()),
)  # fmt: skip

#: What a parameter has that chooses from a list of values.
LISTED = Section(
    "parameters.*",
    "A value of the case that takes those of a list",
    (
        *_COMMON_KEYS,
        Key("values", ValueKind("list", {"type": "array", "minItems": 1}, read_by(_values)), "Values to choose from",
            [0.3, 0.5, 0.7], otherwise="a distribution is given"),
        Key("weights", replace(NUMBERS, read=read_by(_weights, Table.numbers)),
            "Their probabilities, up to a common factor", [1, 2, 1], otherwise="all alike"),
    ),
)  # fmt: skip

#: What a parameter has that is drawn from a distribution.
DRAWN = Section(
    "parameters.*",
    "A value of the case that has a distribution",
    (
        *_COMMON_KEYS,
        replace(DISTRIBUTION_KEYS[0], remedy=f"choose from {', '.join(KINDS)}, or give values"),
        *DISTRIBUTION_KEYS[1:],
        Key(
            "points",
            whole(2),
            "Number of values of the distribution that a grid takes",
            5,
            otherwise="the study is no grid",
        ),
    ),
    forms=FORMS,
)

PARAMETER = Section(
    "parameters.*",
    "A value of the case that varies, by its path as material.friction_coefficient or supports[0].outline: a list of "
    "values, or a table with values or a distribution",
    (
        *LISTED.keys,
        *(
            replace(key, required=False, otherwise="values is given" if key.required else key.otherwise)
            for key in DRAWN.keys
            if key not in LISTED.keys
        ),
    ),
    forms=FORMS,
)

IMPERFECTIONS = replace(
    imperfections.IMPERFECTIONS,
    meaning="Random scatter that every run draws for itself, one table of each kind",
    keys=tuple(key for key in imperfections.IMPERFECTIONS.keys if key.name != "seed"),
)

#: Every table of the study file with its keys.
SECTIONS = (STUDY, PARAMETER, IMPERFECTIONS)


def study_schema() -> dict[str, Any]:
    """Make the JSON schema of the study file."""
    study, parameter, imperfections = SECTIONS
    head = study.schema
    head["properties"]["case"] = {
        "anyOf": [{"type": "string"}, case_values()],
        "description": head["properties"]["case"]["description"],
    }
    varied = parameter.schema
    varied["allOf"].append({"anyOf": [{"required": ["values"]}, {"required": ["distribution"]}]})
    return {
        "$schema": DRAFT,
        "title": "blockvis study file",
        "type": "object",
        "properties": {
            "study": head,
            "parameters": {
                "type": "object",
                "description": parameter.meaning,
                "additionalProperties": {"anyOf": [{"type": "array", "minItems": 1}, varied]},
            },
            "imperfections": one_or_several(imperfections),
        },
        "required": ["study"],
        "additionalProperties": False,
    }
