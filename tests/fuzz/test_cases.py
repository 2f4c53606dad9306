"""Case files that nobody meant: every key with every kind of value, and text with characters changed."""

import random
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from structures import assembly_of, case_from, run_command

ROOT = Path(__file__).parents[2]

CASE = """
[geometry]
layout = "arch"
thickness = 1.0
joint_thickness = 0.0
overlap_tolerance = 1e-3
[geometry.parameters]
voussoirs = 5
[roles]
"left springer" = "fixed"
[[supports]]
name = "prop"
role = "fixed"
outline = [[5, 5], [6, 5], [6, 6]]
[material]
density = 2000.0
friction_coefficient = 0.6
[[interfaces]]
materials = ["a", "b"]
friction_coefficient = 0.3
[[settlement]]
direction = [1.0, 0.0]
rotation_centre = [0.0, 0.0]
rotation = 1.0
increment = 0.01
limit = 0.5
tolerance = 1e-4
step_tolerance = 0.01
blocks = "right springer"
[[loads]]
kind = "dead"
blocks = "*"
weight_fraction = [0.1, 0.0]
force = [0.0, -10.0]
point = [0.0, 1.0]
moment = 0.0
[analysis]
kind = "settlement"
falling_frames = 40
[output]
animation = "collapse.mp4"
"""

#: Lines that give a key a value.
KEYS = [k for k, line in enumerate(CASE.splitlines()) if " = " in line]

#: Values as TOML writes them.
VALUES = st.one_of(
    st.sampled_from(
        ["nan", "inf", "-inf", "-1", "0", "1e400", "1e-400", "true", "[]", "{}", '""', "1979-05-27", "07:32:00",
         "9" * 400, "[1]", "[1, 2, 3]", "[[1, 2], [3, 4], [5, 6]]", "[nan, 1]", "[true, 1]", '["a", "b"]', "[[]]", "{a = 1}",
         '"../../x"', '"\\u0000"', '"/etc/passwd"', '"fixed"', '"moving"', "[" * 5000, "0x7fffffffffffffff", "{a.b.c = []}"]
    ),
    st.floats().map(lambda x: repr(x)),
    st.integers(-(10**30), 10**30).map(str),
    st.text(st.characters(blacklist_categories=("Cs", "Cc"), blacklist_characters='"\\'), max_size=12).map(lambda t: f'"{t}"'),
    st.lists(st.one_of(st.floats(), st.integers()), max_size=4).map(lambda x: repr(x)),
)  # fmt: skip


def _read(text: str) -> None:
    """Reads a case as far as a run does before it solves anything; bad input is a ValueError with a text."""
    said = "read without complaint"
    try:
        assembly_of(case_from(text))
    except ValueError as error:
        said = str(error)
    assert 10 < len(said) < 2000


@pytest.mark.thorough
@settings(max_examples=250, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.tuples(st.sampled_from(KEYS), VALUES), min_size=1, max_size=2))
def test_any_value_for_any_key(changes):
    lines = CASE.splitlines()
    for number, value in changes:
        lines[number] = f"{lines[number].split(' = ')[0]} = {value}"
    _read("\n".join(lines))


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32))
def test_characters_changed(seed):
    choose = random.Random(seed)
    text = list(CASE)
    for _ in range(choose.randint(1, 8)):
        k = choose.randrange(len(text))
        what = choose.random()
        if what < 0.4:
            text[k] = chr(choose.choice([0, 9, 10, 34, 39, 45, 46, 48, 57, 61, 91, 93, 101, 123, 233, 0x10FFFF]))
        elif what < 0.7:
            del text[k : k + choose.randint(1, 20)]
        else:
            text[k:k] = text[k : k + choose.randint(1, 30)]
    _read("".join(text))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"collapse.mp4"', '"../../x.mp4"', "without a folder"),
        ('"collapse.mp4"', '"/tmp/x.mp4"', "without a folder"),
        ('"collapse.mp4"', '"..\\\\x.mp4"', "without a folder"),
        ('"collapse.mp4"', '"summary.json"', "ending in .mp4"),
        ('"collapse.mp4"', '".mp4/../../x.gif"', "without a folder"),
        ("voussoirs = 5", "voussoirs = 500000000", "voussoirs"),
        ("voussoirs = 5", "voussoirs = 100000", "at most 2000"),
        ("voussoirs = 5", "voussoirs = " + "[" * 100_000, "without end"),
        ("falling_frames = 40", "falling_frames = 99999999999", "falling_frames"),
        ("increment = 0.01", "increment = 1e-15", "increment"),
        ("density = 2000.0", "density = " + "9" * 400, "density"),
    ],
)
def test_traps_are_refused(tmp_path, capsys, old, new, words):
    assert old in CASE
    path = tmp_path / "case.toml"
    path.write_text(CASE.replace(old, new), encoding="utf-8")
    assert run_command(path, "-o", tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert words in said
    assert len(said) < 1000
    assert not (tmp_path / "out").exists()


def test_layouts_that_would_fill_the_memory_are_refused(tmp_path, capsys):
    for name, parameters in (
        ("wall", "bricks = 1000000000\ncourses = 1000000000"),
        ("facade", "bricks = 1000000\ncourses = 1000000"),
        ("column", "blocks = 1000000000"),
        ("portal", "column_blocks = 1000000000"),
        ("segmental arch", "voussoirs = 1000000000"),
        ("pointed arch", "voussoirs = 1000000000"),
        ("wall", "width = 1e12\nheight = 1e12"),
    ):
        path = tmp_path / "case.toml"
        path.write_text(
            f'[geometry]\nlayout = "{name}"\n[geometry.parameters]\n{parameters}\n[settlement]\ndirection = [0, -1]\n',
            encoding="utf-8",
        )
        assert run_command(path, "-o", tmp_path / "out") == 2, name
        assert "at most" in capsys.readouterr().err
