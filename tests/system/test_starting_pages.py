"""The pages on what people start from: their commands run in an empty folder and print what the pages show."""

import re
import shlex
import shutil
from pathlib import Path

import pytest

from blockvis.cli import main

ROOT = Path(__file__).parents[2]
PAGES = sorted(path for path in (ROOT / "docs" / "starting").glob("*.md") if path.stem != "index")
MODELS = ROOT / "docs" / "starting" / "models.md"

#: Blocks of commands and of what they print. Seconds differ between machines.
BLOCKS = re.compile(r"^```(sh|text)\n(.*?)^```", re.DOTALL | re.MULTILINE)
SECONDS = re.compile(r"\d+\.\d s$", re.MULTILINE)


def ran(line, capsys):
    """What a command of a page prints."""
    words = shlex.split(line)
    if words[0] == "cp":
        shutil.copy(ROOT / words[1], words[2])
        return ""
    assert words[0] == "blockvis"
    assert main([word.replace("examples/", f"{ROOT}/examples/") for word in words[1:]]) in (0, 4), line
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("page", "runs"),
    [(MODELS, False), *(pytest.param(page, True, marks=pytest.mark.slow) for page in PAGES)],
    ids=lambda value: value.stem if isinstance(value, Path) else "run" if value else "read",
)
def test_a_page_is_followed_literally(page, runs, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    printed = ""
    for kind, block in BLOCKS.findall(page.read_text(encoding="utf-8")):
        if kind == "sh":
            lines = block.splitlines()
            printed = "".join(ran(line, capsys) for line in lines if runs or not line.startswith("blockvis run"))
        elif block.startswith("poly "):
            Path("main.dat").write_text(block, encoding="utf-8")
        else:
            said = SECONDS.sub("", printed).splitlines()
            shown = [line for line in SECONDS.sub("", block).splitlines() if line != "..."]
            assert [line for line in said if line in shown] == shown
