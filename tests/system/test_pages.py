"""Every block of the README and of the manual does what its page says.

Blocks of a page run one after another in a folder that has ``examples`` and ``assets`` of a clone: commands, Python,
and TOML that is read as a case. A block of text is what the commands or the Python before it print. A comment on the
line before a block says otherwise:

- ``<!-- file: NAME -->``: the block is that file; one that comes with blockvis holds the same, another is written.
- ``<!-- ci: NAME -->``: ``.ci/run`` runs the block, in a new environment; here what follows ``pip install`` is run.
- ``<!-- to N % -->``: numbers that kernels of the linear algebra change by so much.
- ``<!-- not run: REASON -->``.
"""

import argparse
import re
import shlex
import shutil
import tomllib
from functools import cache
from pathlib import Path

import pytest

import blockvis
from blockvis import cli

ROOT = Path(__file__).parents[2]

#: Pages that are written by hand; Sphinx runs the scripts of the gallery and the tutorials.
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs" / "starting").glob("*.md"))]

BLOCK = re.compile(r"^(?:<!-- ([^\n]*) -->\n)?```(sh|text|toml|python)\n(.*?)^```$", re.DOTALL | re.MULTILINE)

#: Seconds, and how many programs were solved: of the machine.
MACHINE = re.compile(r"\d[\d.,]* (?=s\b|programs)")
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")

#: What kernels share of a number; below the second, numbers are rounding.
SHARED, ROUNDING = 1e-3, 1e-6

#: What a table of keys lacks to be a case.
GEOMETRY = '[geometry]\nlayout = "arch"\n'
MOTION = "[[settlement]]\ndirection = [1.0, 0.0]\nincrement = 0.01\nlimit = 0.1\n"


def blocks_of(page):
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def alike(shown, said, share):
    """Whether two lines have the same words, and the same numbers up to a share."""
    shown, said = (MACHINE.sub("", line).rstrip() for line in (shown, said))
    if NUMBER.split(shown) != NUMBER.split(said):
        return False
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(said), strict=True)
    return all(
        a == b or max(abs(float(a)), abs(float(b))) < ROUNDING or float(a) == pytest.approx(float(b), rel=share)
        for a, b in pairs
    )


def first_that_differs(shown, said, share):
    """The first line of a block that was not printed in its place; '...' stands for any number of lines."""
    rest, skipping = iter(said), False
    for line in shown:
        if line == "...":
            skipping = True
        elif not any(alike(line, other, share) for other in (rest if skipping else [next(rest, "")])):
            return line
        else:
            skipping = False
    return None if skipping else next(rest, None)


def test_lines_are_compared_by_words_and_shared_digits():
    said = ["run in 3.1 s", "falls at 0.14107 m", "residual 3e-16", "by 12|13", "done"]
    assert (
        first_that_differs(["run in 9 s", "falls at 0.1411 m", "residual 1.5e-15", "...", "done"], said, SHARED) is None
    )
    assert first_that_differs(["run in 9 s", "falls at 0.1421 m", "..."], said, SHARED) == "falls at 0.1421 m"
    assert first_that_differs(["run in 9 s", "falls at 0.1421 m", "..."], said, 0.02) is None
    assert first_that_differs(["...", "by 12|14", "done"], said, SHARED) == "by 12|14"
    assert first_that_differs(["...", "by 12|13"], said, SHARED) == "done"
    assert first_that_differs(["...", "done", "and more"], said, SHARED) == "and more"


def ran(command, capsys):
    """What a command of a page prints."""
    words = shlex.split(command)
    if words[0] == "cp":
        shutil.copy(*words[1:])
        return ""
    assert words[0] == "blockvis", f"{command}: say why it is not run"
    # No page says a word of its film, which takes a third of the time; `.ci/run` has the README's drawn.
    assert cli.main([*words[1:], *["--no-film"] * (words[1] == "run")]) in (0, 4), command
    return capsys.readouterr().out


def read_case(text, folder):
    """Keys of a page, read as a case, with an arch and as many settlements as it counts where they have none."""
    tables = tomllib.loads(text)
    if not {"file", "layout"} & tables.get("geometry", {}).keys():
        text = GEOMETRY + text.replace("[geometry]\n", "")
    if not {"settlement", "analysis", "control"} & tables.keys():
        text += MOTION * max(int(phase) for phase in ["1", *re.findall(r"^phase = (\d+)", text, re.MULTILINE)])
    (folder / "keys-of-the-page.toml").write_text(text, encoding="utf-8")
    blockvis.read_case(folder / "keys-of-the-page.toml")


def keep(name, text):
    """Write a file of a page, or find what comes with blockvis as the page says."""
    if not Path(name).exists():
        Path(name).write_text(text, encoding="utf-8")
    elif name.endswith(".toml"):
        assert tomllib.loads(text) == tomllib.loads(Path(name).read_text(encoding="utf-8")), name
    else:
        assert text == Path(name).read_text(encoding="utf-8"), name


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if blocks_of(page)], ids=lambda page: page.stem)
def test_a_page_is_followed_literally(page, tmp_path, monkeypatch, capsys):
    for folder in ("examples", "assets"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    monkeypatch.chdir(tmp_path)
    printed, names = "", {}
    for mark, kind, block in blocks_of(page):
        word, _, value = mark.partition(": ")
        if word == "not run":
            assert len(value) > 10, f"say why: {block}"
        elif word == "file":
            keep(value, block)
        elif kind == "sh":
            commands = [re.sub(r"^pip install \S+ && ", "", line) for line in block.splitlines()]
            if word == "ci":
                assert f"readme_command {value}" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
            printed = "".join(ran(line, capsys) for line in commands if not line.startswith("python -m pytest"))
        elif kind == "python":
            exec(compile(block, str(page), "exec"), names)
            printed = capsys.readouterr().out
        elif kind == "toml":
            read_case(block, tmp_path)
        else:
            share = float(mark.split()[1]) / 100.0 if mark.startswith("to ") else SHARED
            wrong = first_that_differs(block.splitlines(), printed.splitlines(), share)
            assert wrong is None, f"{wrong}\n--- printed:\n{printed}"


@cache
def parsers():
    """The parser of each verb; of '' that of blockvis alone."""
    alone = cli._parser()
    (verbs,) = (each.choices for each in alone._actions if isinstance(each, argparse._SubParsersAction))
    return {"": alone, **verbs}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: f"{page.parent.name}-{page.stem}")
def test_commands_within_sentences_have_verbs_and_options_that_exist(page):
    text = BLOCK.sub("", page.read_text(encoding="utf-8"))
    for command in re.findall(r"`blockvis ([^`]+)`", text):
        verb, *words = command.replace("[", " ").replace("]", " ").split()
        assert verb.startswith("-") or verb in parsers(), command
        known = parsers().get(verb, parsers()[""])._option_string_actions
        used = {word.partition("=")[0] for word in [verb, *words] if re.match(r"--?[a-z]", word)}
        assert used <= known.keys(), command
