"""What a case or study file may hold, and the page that says it."""

import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from key_reference import case_page, observation_page, study_page

import solver
from blockvis.case_files import case_keys
from blockvis.case_files.read import case_of
from blockvis.cases.toml_table import is_number
from blockvis.generators import LAYOUTS, parameters_of
from blockvis.generators.catalogue import described
from blockvis.kinds.kinds import KINDS
from blockvis.studies import study_keys
from blockvis.studies.study_file import read_study
from solver import mechanics

ROOT = Path(__file__).parents[2]

#: A case with every table: what is read of it is what can be read.
EVERY_TABLE: dict[str, Any] = {
    "geometry": {"file": "wall.dxf"},
    "roles": {"ground": "fixed"},
    "supports": [{"outline": [[0, 0], [1, 0], [1, 1]]}],
    "material": {},
    "materials": {"brick": {"density": 1800.0}},
    "interfaces": [{"materials": ["brick", "brick"], "friction_coefficient": 0.5}],
    "imperfections": [{"kind": "friction", "distribution": "lognormal", "deviation": 0.1}],
    "settlement": [{"direction": [0, -1]}],
    "loads": [{"kind": "live", "force": [1.0, 0.0]}],
    "ties": [{"name": "tie", "from": [0.0, 1.0], "to": [2.0, 1.0], "stiffness": 1e7}],
    "analysis": {"kind": "pushover"},
    "control": {"block": "brick 1-1"},
    "bond": [{"walls": ["A-WALL*"]}],
    "remove": [{"phase": 1, "blocks": "brick 1-2"}],
    "backfill": [{"over": "brick *", "surface": 3.0, "unit_weight": 18000.0}],
    "explain": {},
    "output": {},
}

SECTIONS = {section.name: section for section in case_keys.SECTIONS}


def test_every_table_is_read():
    assert {name.partition(".")[0] for name in SECTIONS} == set(EVERY_TABLE)
    case_of(EVERY_TABLE, Path("case.toml"))


KEYS = [(name, key) for name, section in SECTIONS.items() for key in section.keys]


def _of_its_form(section, name):
    """Other keys of a table, as far as one with this key needs them."""
    forms = section.forms
    if forms is None:
        return {}
    form = next((form for form in forms.needed if name in forms.keys(form)), next(iter(forms.needed)))
    needed = {key.name: key.example for key in section.keys if key.required or key.name in forms.needed[form]}
    return needed | {forms.by: form}


@pytest.mark.parametrize(("name", "key"), KEYS, ids=[f"{name}.{key.name}" for name, key in KEYS])
def test_every_key_is_read_and_checked(name, key):
    top, _, inner = name.partition(".")
    table = EVERY_TABLE[top][0] if isinstance(EVERY_TABLE[top], list) else EVERY_TABLE[top]
    wrong = _of_its_form(SECTIONS[name], key.name) | {key.name: [[]]}
    if inner:
        wrong = {"brick" if inner == "*" else inner: wrong}
    if inner != "*" and top != "imperfections":
        wrong = table | wrong
    with pytest.raises(ValueError, match=rf"\b{key.name}\]? (is|has|must)"):
        case_of(EVERY_TABLE | {top: wrong}, Path("case.toml"))
    assert key.required or key.default is not None or key.otherwise, f"{key.name}: say what holds without it"


def test_the_other_choices_are_those_of_the_code():
    assert SECTIONS["roles"].names.schema["enum"] == list(mechanics.ROLES)
    assert SECTIONS["analysis"].key("kind").choices == tuple(KINDS)


@pytest.mark.parametrize("path", sorted((ROOT / "examples").glob("*.toml")), ids=lambda path: path.name)
def test_every_key_of_the_examples_is_in_the_tables(path):
    for name, table in tomllib.loads(path.read_text(encoding="utf-8")).items():
        for one in table if isinstance(table, list) else [table]:
            if SECTIONS[name].names is None:
                assert set(one) <= {key.name for key in SECTIONS[name].keys}


def test_the_keys_of_a_study_are_those_that_are_read(tmp_path):
    """The reader refuses by the lists of the table; each key of it must then be read, not only let through."""
    (tmp_path / "case.toml").write_text(
        '[geometry]\nlayout = "arch"\n[settlement]\ndirection = [1, 0]\n', encoding="utf-8"
    )

    def refused(**head: Any) -> str:
        with pytest.raises(ValueError) as error:
            read_study(
                {
                    "study": {"case": str(tmp_path / "case.toml")} | head,
                    "parameters": {"material.friction_coefficient": [0.5]},
                }
            )
        return str(error.value)

    for key in study_keys.STUDY.keys:
        head = {"method": "grid"} if key.name == "repeats" else {}
        assert key.name in refused(**head | {key.name: [[]]}), key.name
    assert "cases is not a key here" in refused(cases=1)


def test_every_example_is_a_value_of_its_kind():
    import jsonschema

    for section in (*case_keys.SECTIONS, *study_keys.SECTIONS):
        for key in section.keys:
            jsonschema.validate(key.example, dict(key.kind.schema))
            if key.default is not None:
                default = list(key.default) if isinstance(key.default, tuple) else key.default
                jsonschema.validate(default, dict(key.kind.schema))


@pytest.mark.parametrize(
    ("settlements", "control", "holds"),
    [
        ([{}], {}, solver.Controls.step_tolerance),
        ([{"step_tolerance": 0.02}], {}, 0.02),
        ([{"step_tolerance": 0.02}, {}, {"step_tolerance": 0.001}], {}, 0.001),
        ([{"step_tolerance": 0.02}], {"step_tolerance": 0.01}, 0.01),
        ([{}], {"step_tolerance": 0.03}, 0.03),
    ],
)
def test_the_smallest_step_tolerance_holds(settlements, control, holds):
    phases = [{"direction": [0, -1]} | one for one in settlements]
    values = EVERY_TABLE | {"settlement": phases, "control": {"block": "brick 1-1"} | control}
    assert case_of(values, Path("case.toml")).controls.step_tolerance == holds


@pytest.mark.parametrize(("number", "words"), [(0, "is 0;"), (1.0, "is 1;"), (-0.1, "is -0.1;"), (2, "is 2;")])
@pytest.mark.parametrize("table", ["settlement", "control"])
def test_a_step_tolerance_that_is_none_is_refused(table, number, words):
    values = EVERY_TABLE | {table: {"direction": [0, -1], "block": "brick 1-1", "step_tolerance": number}}
    if table == "settlement":
        del values[table]["block"]
    with pytest.raises(ValueError) as error:
        case_of(values, Path("case.toml"))
    assert str(error.value) == f"case.toml: [{table}] step_tolerance {words} give a number above 0 and below 1"


ROOT = Path(__file__).parents[2]
PAGES = [(case_page(), case_keys.SECTIONS), (study_page(), study_keys.SECTIONS)]


def _part(page, header):
    """What a page says of a table, up to the next one."""
    return page.split(f"## `{header.replace('*', 'NAME')}`\n", 1)[1].split("\n## ", 1)[0]


@pytest.mark.parametrize(("page", "sections"), PAGES, ids=["case", "study"])
def test_every_key_has_a_row_with_unit_default_and_meaning(page, sections):
    for section in sections:
        part = _part(page, section.header)
        assert f"\n{section.meaning}.\n" in part
        for key in section.keys:
            table = part.split("\n### ", 1)[0]
            (row,) = (line for line in table.splitlines() if line.startswith(f"| `{key.name}` |"))
            _, _, unit, default, meaning, example = (cell.strip() for cell in row.strip("| ").split(" | "))
            assert (unit, meaning) == (key.unit, f"{key.meaning}.")
            assert default, f"{key.name}: say what holds without it"
            assert tomllib.loads(example.strip("`")) == {key.name: key.example}


def test_tables_whose_keys_the_user_names_have_an_example():
    for section in (section for section in case_keys.SECTIONS if section.names is not None):
        found = tomllib.loads(_part(case_page(), section.header).split("```toml\n", 1)[1].split("```", 1)[0])
        for step in section.name.split("."):
            found = found[step]
        assert found == dict(section.example)


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_parameter_of_a_layout_is_described(name):
    words = described(name)
    assert set(words) == set(parameters_of(name))
    part = case_page().split(f"### `{name}`\n", 1)[1].split("\n#", 1)[0]
    for key, default in parameters_of(name).items():
        (row,) = (line for line in part.splitlines() if line.startswith(f"| `{key}` |"))
        if is_number(default):
            assert f"`{default}`" in row


@pytest.mark.slow
def test_the_tool_writes_the_pages(tmp_path):
    tool = ROOT / "tools" / "key_reference.py"
    done = subprocess.run([sys.executable, tool, tmp_path / "new" / "reference"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "new" / "reference" / "case_keys.md").read_text(encoding="utf-8") == case_page()
    assert (tmp_path / "new" / "reference" / "observation_keys.md").read_text(encoding="utf-8") == observation_page()
    assert (tmp_path / "new" / "reference" / "study_keys.md").read_text(encoding="utf-8") == study_page()
