"""The pages of reference have every key, and examples that are TOML."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from key_reference import case_page, observation_page, study_page

from blockvis.case_files import case_keys
from blockvis.cases.toml_table import is_number
from blockvis.generators import LAYOUTS, parameters_of
from blockvis.generators.catalogue import described
from blockvis.studies import study_keys

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


def test_the_tool_writes_the_pages(tmp_path):
    tool = ROOT / "tools" / "key_reference.py"
    done = subprocess.run([sys.executable, tool, tmp_path / "new" / "reference"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "new" / "reference" / "case_keys.md").read_text(encoding="utf-8") == case_page()
    assert (tmp_path / "new" / "reference" / "observation_keys.md").read_text(encoding="utf-8") == observation_page()
    assert (tmp_path / "new" / "reference" / "study_keys.md").read_text(encoding="utf-8") == study_page()
