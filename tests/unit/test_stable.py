"""Nothing that the page ``docs/stable.md`` promises goes; more may come."""

import argparse
import csv
import json
from pathlib import Path

import pytest
import pyvista as pv

import blockvis
import solver
from blockvis import cli

PROMISED = json.loads((Path(__file__).parents[1] / "stable.json").read_text(encoding="utf-8"))

CASE = """
[geometry]
layout = "{layout}"
[settlement]
direction = {direction}
increment = 0.001
limit = 0.001
"""

#: What ties, fill and mortar add.
STRENGTHENED = """
[[ties]]
name = "iron"
from = [-0.6, 0.8]
to = [0.6, 0.8]
stiffness = 1e6
[[backfill]]
over = "voussoir *"
surface = 1.5
unit_weight = 18000.0
[material]
cohesion = 1e5
tensile_strength = 1e5
"""


def _tables(schema):
    """Tables that a value may be, alone, in a list or one of several kinds."""
    yield from (schema,) if {"properties", "additionalProperties"} & schema.keys() else ()
    for part in (*schema.get("oneOf", ()), *schema.get("anyOf", ()), schema.get("items")):
        yield from _tables(part) if isinstance(part, dict) else ()


def _keys_of(schema, name):
    """Names of a table and of its keys, and of the tables within it."""
    for table in _tables(schema):
        yield f"[{name}]"
        yield from (f"[{name}] {key}" for key in table.get("properties", ()))
        for key, value in table.get("properties", {}).items():
            yield from _keys_of(value, f"{name}.{key}")
        if isinstance(table.get("additionalProperties"), dict):
            yield from _keys_of(table["additionalProperties"], f"{name}.*")


def _keys(capsys, *what):
    assert cli.main(["schema", *what]) == 0
    tables = json.loads(capsys.readouterr().out)["properties"]
    return {key for name, table in tables.items() for key in _keys_of(table, name)}


def _options():
    actions = cli._parser()._actions
    (verbs,) = (action.choices for action in actions if isinstance(action, argparse._SubParsersAction))
    yield from (word for action in actions for word in action.option_strings)
    for verb, parser in verbs.items():
        yield verb
        yield from (f"{verb} {word}" for action in parser._actions for word in action.option_strings)


def _written(folder, layout, direction, more=""):
    """Files of a small run, their columns and arrays, and the keys of its summary."""
    (folder / "case.toml").write_text(CASE.format(layout=layout, direction=direction) + more, encoding="utf-8")
    out = folder / "out"
    blockvis.run_case(folder / "case.toml", out, outputs=())
    yield from (f"file {path.name}" for path in out.iterdir())
    yield from (f"summary.json {key}" for key in json.loads((out / "summary.json").read_text(encoding="utf-8")))
    for path in out.glob("*.csv"):
        with path.open(encoding="utf-8", newline="") as table:
            yield from (f"{path.name} {column}" for column in next(csv.reader(table)))
    for path in (out / "increments").glob("*_00000.vtu"):
        what, grid = path.name.partition("_")[0], pv.read(path)
        for place, data in (("point", grid.point_data), ("cell", grid.cell_data), ("file", grid.field_data)):
            yield from (f"{what} {place} {name}" for name in data)


def _present(what, folder, capsys):
    if what == "results in the plane":
        return set(_written(folder, "arch", [1.0, 0.0]))
    if what == "results in space":
        return set(_written(folder, "extruded arch", [1.0, 0.0, 0.0]))
    if what == "results with ties, fill and mortar":
        return set(_written(folder, "arch", [1.0, 0.0], STRENGTHENED))
    return {
        "blockvis": lambda: {name for name in blockvis.__all__ if hasattr(blockvis, name)},
        "solver": lambda: {name for name in solver.__all__ if hasattr(solver, name)},
        "case keys": lambda: _keys(capsys),
        "study keys": lambda: _keys(capsys, "study"),
        "command line": lambda: set(_options()),
    }[what]()


@pytest.mark.parametrize("what", PROMISED)
def test_nothing_that_is_promised_goes(what, tmp_path, capsys):
    assert sorted(set(PROMISED[what]) - _present(what, tmp_path, capsys)) == []
