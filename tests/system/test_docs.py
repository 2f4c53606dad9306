"""The manual names all there is: files, columns, keys and arrays of the results, public names, exit codes."""

import ast
import csv
import json
import re
from pathlib import Path

import pytest
import pyvista as pv

import blockvis
import solver
from blockvis import cli, generators
from solver import mechanics

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
RESULTS = (DOCS / "results.md").read_text(encoding="utf-8")

#: What stands between backquotes in the tables of the page.
NAMED = {name for row in RESULTS.splitlines() if row.startswith("|") for name in re.findall(r"`([^`]+)`", row)}


def missing(names):
    return sorted(set(names) - NAMED)


def check_columns(folder):
    for table in folder.glob("*.csv"):
        header = next(csv.reader(table.read_text(encoding="utf-8").splitlines()))
        columns = [re.sub(r" \[.*\]$", "", column) for column in header]
        assert missing(column for column in columns if " at largest " not in column) == [], table.name


def test_columns_of_tables_are_named(arch_folder):
    check_columns(arch_folder)


def keys_of(summary):
    yield from summary
    yield from summary["largest_residuals"]
    for limit in summary.get("limit_loads", ()):
        yield from limit


def test_keys_of_the_summary_are_named(arch_folder):
    assert missing(keys_of(json.loads((arch_folder / "summary.json").read_text(encoding="utf-8")))) == []


@pytest.mark.thorough
@pytest.mark.parametrize(
    "kind",
    [
        "pushover",
        *(pytest.param(kind, marks=pytest.mark.thorough) for kind in ("limit load", "moving load", "capacity")),
    ],
)
def test_keys_and_columns_of_other_analyses_are_named(kind, tmp_path):
    live = """
[[loads]]
kind = "live"
"""
    block = """
[geometry]
layout = "column"
parameters = { blocks = 2 }
"""
    push = live + "weight_fraction = [1.0, 0.0]"
    (tmp_path / "case.toml").write_text(
        {
            "limit load": block + '[analysis]\nkind = "limit load"' + push,
            "pushover": block
            + '[analysis]\nkind = "pushover"\n[control]\nblock = "block 2"\nincrement = 0.1\nlimit = 0.2'
            + push,
            "moving load": '[geometry]\nlayout = "arch"\n[analysis]\nkind = "limit load"'
            + live
            + "force = [0.0, -1000.0]\npositions = [-0.5, 0.5, 2]",
            "capacity": '[geometry]\nlayout = "arch"\n[analysis]\nkind = "limit load"'
            + push
            + "\n[settlement]\ndirection = [1.0, 0.0]\nincrement = 0.01\nlimit = 0.01",
        }[kind]
    )
    blockvis.run_case(tmp_path / "case.toml", tmp_path / "out", outputs=())
    assert missing(keys_of(json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8")))) == []
    assert kind not in ("moving load", "capacity") or len(list((tmp_path / "out").glob("*.csv"))) == 4
    check_columns(tmp_path / "out")


def test_arrays_of_vtu_files_are_named(arch_folder):
    for what in ("blocks", "contacts", "joints"):
        grid = pv.read(next((arch_folder / "increments").glob(f"{what}_*.vtu")))
        assert missing([*grid.point_data, *grid.cell_data, *grid.field_data]) == [], what


def test_files_of_the_results_folder_are_named(arch_folder):
    files = {path.name for path in arch_folder.iterdir() if path.is_file()}
    assert missing(files) == []


def test_public_names_are_listed():
    pages = {"blockvis": blockvis, "solver": solver, "mechanics": mechanics, "generators": generators}
    for page, module in pages.items():
        text = (DOCS / "api" / f"{page}.rst").read_text(encoding="utf-8")
        names = [name for name in module.__all__ if name != "LAYOUTS"]
        assert [name for name in names if not re.search(rf"^\s+(\* - ``)?{name}(``)?$", text, flags=re.M)] == []


def test_exit_codes_are_listed():
    codes = {cli.BAD_INPUT, cli.SOLVER_FAILED, cli.NO_PICTURES, cli.NO_EQUILIBRIUM, cli.INTERRUPTED, 0}
    text = (DOCS / "command_line.md").read_text(encoding="utf-8")
    assert {int(code) for code in re.findall(r"^\| (\d+) \|", text, flags=re.M)} == codes


@pytest.mark.parametrize("folder", ["gallery", "tutorials"])
def test_scripts_assert_a_number_and_show_a_picture(folder):
    """The build runs them; one that asserts nothing would prove nothing."""
    scripts = sorted((DOCS / folder).glob("*.py"))
    assert len(scripts) >= {"gallery": 12, "tutorials": 4}[folder]
    for script in scripts:
        text = script.read_text(encoding="utf-8")
        asserts = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Assert)]
        numbers = [
            n for a in asserts for n in ast.walk(a) if isinstance(n, ast.Constant) and isinstance(n.value, float)
        ]
        assert numbers, f"{script.name} asserts no number"
        assert ".png" in text, f"{script.name} shows no picture"


@pytest.mark.parametrize("key", ["pressure", "edge", "profile", "kind", "closing", "outline_tolerance", "window"])
def test_keys_that_are_refused_in_space_say_so(key):
    """Of kinds that of imperfections, which has corners."""
    rows = [line for line in (DOCS / "keys" / "case_keys.md").read_text(encoding="utf-8").splitlines()
            if line.startswith(f"| `{key}` |") and (key != "kind" or "vertices" in line)]  # fmt: skip
    assert rows
    assert all("in the plane" in row.lower() for row in rows)
    assert f"`{'vertices' if key == 'kind' else key}`" in (DOCS / "space.md").read_text(encoding="utf-8")
