"""The README's Python runs and prints what the README says."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def blocks():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.findall(r"```python\n(.*?)```\n+```text\n(.*?)```", text, flags=re.S)


def test_python_example_prints_what_it_says(blocks, tmp_path, capsys):
    assert blocks, "the README has an example with its output"
    for code, printed in blocks:
        code = code.replace("assets/", f"{ROOT}/assets/").replace('"out/', f'"{tmp_path}/out/')
        code = re.sub(r"^blockvis\.animate.*$", "", code, flags=re.M)  # tests/unit/test_render.py animates
        exec(compile(code, "README.md", "exec"), {})
        assert capsys.readouterr().out.strip() == printed.strip()


def test_files_and_rooms_that_contributing_names_exist():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = [name for name in re.findall(r"`([\w./]+)`", text) if "/" in name or name.endswith(".py")]
    there = {
        f"/{path.relative_to(ROOT).as_posix()}"
        for top in ("solver", "blockvis", "tests")
        for path in (ROOT / top).rglob("*")
    }
    there |= {"/solver", "/blockvis", "/.ci/run"}
    assert len(named) > 10
    assert [name for name in named if not any(path.endswith(f"/{name.strip('/')}") for path in there)] == []
