"""Words, pictures, curve, report, table and summary count the same hinges and sliding joints."""

import base64
import csv
import json
import re
import zlib
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from structures import arch_response, portal_response, report_of

import blockvis
import solver
from blockvis import generators
from blockvis.kinds.kinds import KINDS
from blockvis.pictures import marks
from blockvis.pictures.swing import swing_of
from blockvis.report.page import summary_rows
from blockvis.results.joints import initial_joints
from solver import mechanics

SINKS = (0.0, -1.0)


@cache
def facade():
    bricks = {"bricks": 14, "courses": 24, "storeys": 1, "windows": 1, "window_bricks": 3, "voussoirs": 3}
    sinks = solver.Settlement(direction=SINKS, increment=0.01, limit=0.04)
    return solver.settle(generators.build("facade", bricks), sinks, friction_coefficient=0.6)


RESPONSES = {"portal frame": portal_response, "semicircular arch": arch_response, "small façade": facade}

#: The façade takes as long as all others together.
MARKS = {"portal frame": pytest.mark.thorough, "small façade": pytest.mark.slow}
EACH = pytest.mark.parametrize("name", [pytest.param(name, marks=MARKS.get(name, ())) for name in RESPONSES])


def counted(response, increment):
    mechanism = mechanics.mechanism_of(response.assembly, increment)
    return len(mechanism.hinges), len(mechanism.sliding)


def in_words(text):
    """Hinges and sliding joints of a sentence: "hinges at a | b, c | d and 3 more; sliding at e | f"."""
    counts = []
    for what in ("hinges?", "sliding"):
        found = re.search(rf"(?:^|; ){what} at (.*?)(?: and (\d+) more)?(?=;|$)", text)
        counts.append(0 if found is None else found[1].count(" | ") + int(found[2] or 0))
    return tuple(counts)


def unpacked(table):
    planes = np.frombuffer(zlib.decompress(base64.b64decode(table["data"])), dtype=np.uint8)
    steps = planes.reshape(4, -1).T.copy().view("<i4").reshape(table["rows"], table["columns"])
    return np.cumsum(steps, axis=0)


@EACH
def test_every_increment_has_one_count(name, tmp_path):
    response = RESPONSES[name]()
    expected = [counted(response, increment) for increment in response.increments]
    assert max(hinges for hinges, _ in expected) > 0
    joints = initial_joints(response.assembly)
    for increment, (hinges, sliding) in zip(response.increments, expected, strict=True):
        words = str(mechanics.mechanism_of(response.assembly, increment))
        assert in_words(words) == (hinges, sliding)
        marked = marks.marks_of(response.assembly, joints, increment, increment.pose)
        assert (len(marked.hinges), len(marked.sliding)) == (hinges, sliding)

    path = expected[: len(response.path)]
    with (blockvis.write(response, tmp_path / "out") / "response.csv").open(encoding="utf-8") as file:
        rows = [(int(row["hinges"]), int(row["sliding_joints"])) for row in csv.DictReader(file)]
    assert rows == path

    page = report_of(response)
    model = json.loads(re.search(r'<script id="model" type="application/json">(.*?)</script>', page, re.S)[1])
    packed = model["packed"]
    ends, kinds = unpacked(packed["mark_first"]).ravel(), unpacked(packed["mark_kind"]).ravel()
    frames = np.split(kinds, ends[1:-1])
    # The last equilibrium shows the mechanism that follows it, as the picture of it and the film do.
    shown = [*path, *expected[len(path) :]]
    shown[len(path) - 1] = counted(response, swing_of(response).increment)
    assert [((k == 1).sum(), (k == 2).sum()) for k in frames] == shown


@pytest.mark.parametrize("name", [pytest.param("portal frame", marks=pytest.mark.thorough), "semicircular arch"])
def test_collapse_has_one_count(name, tmp_path):
    """Of the fall, of the last equilibrium in the motion of the fall, which the picture shows, and in the summary."""
    response = RESPONSES[name]()
    falling = mechanics.with_motion(response.path[-1], response.collapse.mechanism)
    expected = counted(response, falling)
    assert in_words(response.collapse.words) == expected
    assert counted(response, response.increments[len(response.path)]) == expected
    summary = json.loads((blockvis.write(response, tmp_path / "out") / "summary.json").read_text(encoding="utf-8"))
    assert (summary["hinges"], summary["sliding_joints"]) == expected
    parts = len(mechanics.mechanism_of(response.assembly, falling).motions)
    counts = dict(summary_rows(response))["mechanism"]
    assert summary["mechanism"].startswith(f"{parts} macro-blocks; ")
    assert counts.startswith(f"{parts} moving parts, {expected[0]} hinges")


@pytest.mark.thorough
def test_console_and_summary_count_what_the_picture_shows(tmp_path):
    """Not the first frame of the fall, whose contact points and forces are others."""
    response = portal_response()
    shown = swing_of(response).increment
    collapse = replace(response.collapse, words="9 macro-blocks; hinge at a | b")
    response = replace(response, collapse=collapse)
    said = next(line for line in KINDS["settlement"].lines(response) if line.startswith("mechanism: "))
    assert said == f"mechanism: {mechanics.mechanism_of(response.assembly, shown)}"
    summary = json.loads((blockvis.write(response, tmp_path / "out") / "summary.json").read_text(encoding="utf-8"))
    assert f"mechanism: {summary['mechanism']}" == said


def test_creeping_counts_for_nothing():
    """A joint that slides at a five hundredth of the speed of the fastest block does not slide."""
    response = arch_response()
    last = response.path[-1]
    fastest = np.abs(last.velocity[:, :2]).max()
    for part, slides in ((0.002, False), (0.5, True)):
        motion = np.zeros_like(last.velocity)
        motion[response.assembly.free] = [0.0, fastest, 0.0]
        along = np.tile([0.0, part * fastest], (len(last.contacts), 1))
        creeping = last.with_arrays(velocity=motion, displacements=along)
        assert bool(counted(response, creeping)[1]) is slides
