"""Every key of the study file; :mod:`blockvis.studies.study_file` refuses all others."""

from __future__ import annotations

from dataclasses import replace

from blockvis.case_files.case_keys import DISTRIBUTION_KEYS, IMPERFECTION_KEYS
from blockvis.cases.key import NUMBERS, POSITIVE, TEXT, TEXTS, Key, Section, ValueKind, one_of, whole

from .sampling import METHODS

STUDY = Section(
    "study",
    "The case and its runs",
    (
        Key("case", ValueKind("name of a case file, or a table with its keys", {"type": ["string", "object"]}),
            "Base case, relative to the study file", "../semicircular_arch.toml", required=True,
            remedy="name a case file, relative to the study file"),
        Key("method", one_of(METHODS), 'How values are chosen; "saltelli" is for Sobol\' indices', "sobol",
            default="latin hypercube"),
        Key("runs", whole(1), "Number of runs; of saltelli the size of its two samples; a grid has as many as its "
            "values make", 256, default=64),
        Key("repeats", whole(1), "Runs per point of a grid, with different imperfections", 4, default=1),
        Key("seed", whole(0), "Of all random numbers", 1, default=1),
        Key("seconds", POSITIVE, "Longest time of one run", 600, "s", otherwise="no limit"),
        Key("keep", ValueKind("whole number, or list of them",
            {"anyOf": [{"type": "integer", "minimum": 0},
                       {"type": "array", "items": {"type": "integer", "minimum": 0}}]}),
            "Numbers of the runs, from 0, whose whole results folder is written", [3, 17], default=()),
    ),
    required=True,
)  # fmt: skip

#: Keys of a parameter that chooses from a list of values.
LIST_KEYS = (
    Key("values", ValueKind("list", {"type": "array", "minItems": 1}), "Values to choose from", [0.3, 0.5, 0.7],
        otherwise="a distribution is given"),
    Key("weights", NUMBERS, "Their probabilities, up to a common factor", [1, 2, 1], otherwise="all alike"),
)  # fmt: skip

#: Keys of every parameter.
COMMON_KEYS = (
    Key("name", TEXT, "Column of the table and label of the pictures", "friction", otherwise="the path"),
    Key("also", TEXTS, "Further paths that take the same value", ["supports[1].outline"], default=()),
)

PARAMETER = Section(
    "parameters.*",
    "A value of the case that varies, by its path as material.friction_coefficient or supports[0].outline: a list of "
    "values, or a table with values or a distribution",
    (
        *COMMON_KEYS,
        *LIST_KEYS,
        *(
            replace(key, required=False, otherwise="values is given" if key.required else key.otherwise)
            for key in DISTRIBUTION_KEYS
        ),
        Key("points", whole(0), "Number of values of the distribution that a grid takes", 5, default=0),
    ),
)

IMPERFECTIONS = Section(
    "imperfections",
    "Random scatter that every run draws for itself, one table of each kind",
    IMPERFECTION_KEYS,
    several=True,
)

#: Every table of the study file with its keys.
SECTIONS = (STUDY, PARAMETER, IMPERFECTIONS)
