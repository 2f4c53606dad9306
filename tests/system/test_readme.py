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
