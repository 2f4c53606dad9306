"""The JSON schemas accept what the readers accept, and name a misspelt key."""

import contextlib
import io
import json
import tomllib
from pathlib import Path

import jsonschema
import pytest

from blockvis.cli import main

ROOT = Path(__file__).parents[2]
CASES = [*sorted((ROOT / "examples").glob("*.toml")), *sorted((ROOT / "tests" / "regression").glob("*.toml"))]
STUDIES = sorted((ROOT / "examples" / "studies").glob("*.toml"))


def schema(file):
    """What the command prints."""
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        assert main(["schema", file]) == 0
    found = json.loads(printed.getvalue())
    jsonschema.Draft7Validator.check_schema(found)
    return found


CASE = jsonschema.Draft7Validator(schema("case"))
STUDY = jsonschema.Draft7Validator(schema("study"))


def _with(**changes):
    return tomllib.loads('[geometry]\nlayout = "arch"\n[settlement]\ndirection = [1, 0]\n') | changes


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.name)
def test_every_case_of_the_project_is_valid(path):
    CASE.validate(tomllib.loads(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.name)
def test_every_study_of_the_project_is_valid(path):
    STUDY.validate(tomllib.loads(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.name)
def test_a_misspelt_key_of_any_table_is_not_valid(path):
    values = tomllib.loads(path.read_text(encoding="utf-8"))
    for table in [values, *(v[0] if isinstance(v, list) else v for k, v in values.items() if k != "roles")]:
        key = next(iter(table))
        table[key + "x"] = table.pop(key)
        assert not CASE.is_valid(values), f"{path.name}: {key}x"
        table[key] = table.pop(key + "x")
    CASE.validate(values)


def test_a_misspelt_parameter_of_a_layout_is_not_valid():
    assert CASE.is_valid(_with(geometry={"layout": "segmental arch", "parameters": {"rise": 1.0}}))
    assert not CASE.is_valid(_with(geometry={"layout": "segmental arch", "parameters": {"rize": 1.0}}))
    assert not CASE.is_valid(_with(geometry={"layout": "dome", "parameters": {"oculus": "no"}}))


@pytest.mark.parametrize(
    "right",
    [
        {"geometry": {"layout": "Segmental-Arch"}},
        {"geometry": {"file": "a.dxf", "joint_thickness": "auto", "ignore": "axes"}},
        {"settlement": [{"direction": [1, 0]}, {"rotation_centre": [0, 0], "blocks": "ground"}]},
        {"imperfections": {"kind": "friction", "distribution": "normal", "deviation": 0.1, "lower": 0.2}},
        {"materials": {"brick": {"density": 1800}}},
        {"output": {"animation": "Fall.MP4"}},
    ],
)
def test_what_the_reader_accepts_is_valid(right):
    CASE.validate(_with(**right))


@pytest.mark.parametrize(
    "wrong",
    [
        {"geometry": {"layout": "segmental arc"}},
        {"geometry": {"file": "a.dxf", "layout": "arch"}},
        {"geometry": {}},
        {"geometry": {"file": "a.dxf", "joint_thickness": "automatic"}},
        {"roles": {"ground": "fix"}},
        {"material": {"density": 0}},
        {"settlement": {"direction": [1, 0, 0, 0]}},
        {"imperfections": {"kind": "friction", "distribution": "uniform", "lower": 0.5, "upper": 1, "mean": 1}},
        {"output": {"animation": True}},
        {"loads": [{"kind": "alive"}]},
    ],
)
def test_what_the_reader_refuses_is_not_valid(wrong):
    assert not CASE.is_valid(_with(**wrong))


def test_a_misspelt_key_of_a_study_is_not_valid():
    values = tomllib.loads(STUDIES[0].read_text(encoding="utf-8"))
    assert not STUDY.is_valid(values | {"study": values["study"] | {"sead": 1}})
    parameter = {"distribution": "normal", "mean": 0.6, "deviation": 0.1}
    assert STUDY.is_valid(values | {"parameters": {"material.friction_coefficient": parameter}})
    assert not STUDY.is_valid(values | {"parameters": {"material.friction_coefficient": parameter | {"mode": 1}}})
    assert not STUDY.is_valid(values | {"parameters": {"material.friction_coefficient": {"name": "friction"}}})


def test_descriptions_have_meaning_and_unit():
    density = CASE.schema["properties"]["material"]["properties"]["density"]
    assert density["default"] == 2000.0
    assert "[kg/m³]" in density["description"]
