"""``blockvis explain``: from a case and a table of cracks to ranked causes, its page, numbers and picture."""

import importlib
import json
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from PIL import Image
from structures import box, posed

import blockvis
import solver
from blockvis import cli, generators, save_layout
from solver import mechanics

#: The structure as the inverse assumes it; the real one has other friction, and twelve voussoirs.
CASE = """
[geometry]
layout = "segmental arch"
parameters = { voussoirs = 10 }
[material]
friction_coefficient = 0.7
[explain]
directions = ["down", "right"]
friction = [0.7, 0.7]
"""

SPREAD = 0.01


def moved(assembly, direction, amount=SPREAD):
    """The pose of an arch whose right springer has moved."""
    settlement = solver.Settlement(direction=direction, increment=amount / 2.0, limit=amount)
    controls = solver.Controls(falling_frames=0)
    return solver.settle(assembly, settlement, friction_coefficient=0.8, controls=controls).path[-1].pose


def rows_of(assembly, pose, noise=0.1):
    """Widths near both ends of the joints."""
    joints = posed(assembly, solver.Pose.initial(assembly)).joints(0)
    ends = np.asarray(joints.point_data["reference"])[:, :2]
    blocks = (np.repeat(joints.cell_data[side], 2) for side in ("block_a", "block_b"))
    on_a, on_b = (mechanics.carried(ends, side, solver.Pose.initial(assembly), pose) for side in blocks)
    random = np.random.default_rng(3)
    rows = []
    for line, both in zip(ends.reshape(-1, 2, 2), np.linalg.norm(on_a - on_b, axis=1).reshape(-1, 2), strict=True):
        for share in (0.1, 0.9):
            (x, y), w = line[0] + share * (line[1] - line[0]), both[0] + share * (both[1] - both[0])
            width = f"{1e3 * w * (1.0 + noise * random.standard_normal()):.2f}" if w > 3e-4 else "closed"
            rows.append(f"{x:.4f},{y:.4f},{width}")
    # Nobody notes every joint that is closed.
    return [row for k, row in enumerate(rows) if not row.endswith("closed") or k % 3 == 0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A case, and what was seen on the real arch."""
    folder = tmp_path_factory.mktemp("explain")
    (folder / "arch.toml").write_text(CASE, encoding="utf-8")
    real = generators.segmental_arch(voussoirs=12)
    rows = rows_of(real, moved(real, (1.0, 0.0)))
    (folder / "cracks.csv").write_text("\n".join(["x,y,width [mm]", *rows]) + "\n", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def said(folder):
    """What the command says, and the folder that it writes."""
    with pytest.MonkeyPatch.context() as patched:
        import contextlib
        import io

        patched.chdir(folder)
        words = io.StringIO()
        with contextlib.redirect_stdout(words):
            code = cli.main(["explain", "arch.toml", "--observed", "cracks.csv", "-o", "out", "--workers", "1"])
    assert code == 0
    return words.getvalue()


@pytest.mark.slow
def test_the_cause_comes_first_with_its_amount(folder, said):
    causes = json.loads((folder / "out" / "explain.json").read_text(encoding="utf-8"))["causes"]
    best = causes[0]
    assert best["cause"] == "right springer moves right"
    assert best["amount"] == pytest.approx(SPREAD, rel=0.25)
    assert best["amount_low"] < best["amount"] < best["amount_high"]
    assert sum(cause["probability"] for cause in causes) == pytest.approx(1.0)
    assert "right springer moves right" in said.splitlines()[1]


@pytest.mark.slow
def test_the_page_needs_no_network_and_has_the_same_causes(folder, said):
    page = (folder / "out" / "explain.html").read_text(encoding="utf-8")
    assert not re.findall(r"(?:src|href)=\"(?!data:)", page)
    assert "http:" not in page
    assert "https:" not in page
    stored = json.loads((folder / "out" / "explain.json").read_text(encoding="utf-8"))
    for words in (stored["causes"][0]["cause"], "directions = [&quot;down"):
        assert words in page
    for one in stored["observations"]["widths"]:
        assert one["place"] in page


@pytest.mark.slow
def test_the_picture_has_three_panels_of_blocks_with_cracks(folder, said):
    with Image.open(folder / "out" / "explain.png") as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    orange = np.abs(pixels - [226, 78, 27]).sum(axis=2) < 40
    thirds = np.array_split(orange, 3, axis=1)
    assert all(third.sum() > 100 for third in thirds)


@pytest.mark.slow
def test_no_label_of_the_picture_covers_another(folder, tmp_path, monkeypatch):
    boxes = []
    savefig = Figure.savefig

    def noted(figure, *given, **options):
        figure.draw_without_rendering()
        for panel in figure.axes:
            written = [text for text in panel.texts if text.get_text() and text.get_bbox_patch()]
            boxes.append([text.get_window_extent() for text in written])
        return savefig(figure, *given, **options)

    monkeypatch.setattr(Figure, "savefig", noted)
    rows = [{"x": x, "y": 0.56, "width [mm]": width} for x, width in ((-0.1, 3.0), (0.0, 3.1), (0.1, 2.9), (1.0, 2.0))]
    blockvis.explain(folder / "arch.toml", rows, tmp_path / "labels")
    assert len(boxes[0]) >= 2
    for own in boxes:
        assert not any(box.count_overlaps(own[:k]) for k, box in enumerate(own))


@pytest.mark.slow
def test_a_joint_that_gapes_where_nothing_was_seen_has_its_largest_width(folder, tmp_path, monkeypatch):
    written = []
    annotate = Axes.annotate

    def noted(panel, text, *at, **options):
        written.append((panel, text))
        return annotate(panel, text, *at, **options)

    monkeypatch.setattr(Axes, "annotate", noted)
    rows = [{"block": "right springer", "dx [mm]": 10.0, "dy [mm]": 0.0}]
    found = blockvis.explain(folder / "arch.toml", rows, tmp_path / "points")
    first = written[-1][0].figure.axes[1]
    numbers = [float(text) for panel, text in written if panel is first and re.fullmatch(r"[\d.]+", text)]
    best = found.causes[0]
    largest = found.comparison.largest_openings(best.best.openings(np.array([best.at])))[0]
    assert max(numbers) == pytest.approx(1e3 * largest.max(), abs=0.051)


@pytest.mark.slow
def test_a_support_that_moves_down_has_its_arrow_in_the_picture(folder, monkeypatch):
    tips = []
    annotate = Axes.annotate

    def noted(panel, text, xy, *given, **options):
        if text == "" and "xytext" in options:
            tips.append((panel, np.asarray(xy)))
        return annotate(panel, text, xy, *given, **options)

    monkeypatch.setattr(Axes, "annotate", noted)
    rows = [{"block": "right springer", "dx [mm]": 0.0, "dy [mm]": -9.0}]
    found = blockvis.explain(folder / "arch.toml", rows, folder / "arrow")
    # How it was seen to move is what has happened.
    assert found.causes[0].name == "right springer moves down"
    assert found.causes[0].amount[1] == pytest.approx(0.009, rel=0.1)
    assert found.causes[0].probability > 0.5
    assert tips
    for panel, tip in tips[1:]:
        low, high = np.transpose([panel.get_xlim(), panel.get_ylim()])
        assert (tip >= low).all()
        assert (tip <= high).all()


@pytest.mark.slow
def test_the_same_input_gives_the_same_answer(folder, said):
    before = {name: (folder / "out" / name).read_bytes() for name in ("explain.json", "explain.png")}
    again = folder / "again"
    with pytest.MonkeyPatch.context() as patched:
        patched.chdir(folder)
        assert cli.main(["explain", "arch.toml", "--observed", "cracks.csv", "-o", "again", "--workers", "1"]) == 0
    assert {name: (again / name).read_bytes() for name in before} == before


@pytest.mark.slow
def test_runs_that_take_long_are_counted_by_their_causes(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("blockvis.runs.progress.LINES", 0.0)
    (tmp_path / "crack.csv").write_text("x,y,width [mm]\n0.0,0.56,3.0\n", encoding="utf-8")
    command = ["explain", str(folder / "arch.toml"), "--observed", str(tmp_path / "crack.csv"), "--workers", "1"]
    assert cli.main([*command, "-o", str(tmp_path / "out")]) == 0
    lines = capsys.readouterr().err
    assert re.search(r"^blockvis: run \d+ of \d+: left springer moves down, friction 0\.7, ", lines, re.M)
    told = re.findall(
        r"^blockvis: run (\d+) of \d+: .*?(?:, about (\d+ s) left(?: in round (\d) of 3)?)?, [\d.]+ s$", lines, re.M
    )
    # Before a run is done nothing is known; after the first rounds more runs follow, beside the likeliest.
    assert {bool(left) for run, left, _ in told if run == "1"} == {False}
    assert {bool(left) for run, left, _ in told if run != "1"} == {True}
    rounds = [int(number or 3) for run, _, number in told if run != "1"]
    assert (rounds[0], rounds) == (1, sorted(rounds))


@pytest.mark.slow
def test_what_is_there_is_not_replaced_unless_asked(folder, said, capsys):
    command = ["explain", str(folder / "arch.toml"), "--observed", str(folder / "cracks.csv"), "-o"]
    assert cli.main([*command, str(folder / "out")]) == cli.BAD_INPUT
    assert "holds an explanation already (explain.html)" in capsys.readouterr().err


@pytest.mark.slow
def test_one_crack_leaves_causes_open_and_a_joint_to_measure(folder, tmp_path):
    rows = [{"x": 0.0, "y": 0.56, "width [mm]": 3.0}]
    found = blockvis.explain(folder / "arch.toml", rows, tmp_path / "out")
    assert len(found.alike) > 1
    assert "the observations cannot tell these apart" in str(found)
    measurement = found.next_measurement
    assert measurement is not None
    assert f"measure next: the joint {measurement.name}" in str(found)
    widths = [width for _, width in measurement.widths]
    assert max(widths) - min(widths) > 1e-3
    assert measurement.name in (tmp_path / "out" / "explain.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_crack_that_no_candidate_makes_is_unexplained(folder):
    case, runs = folder / "arch.toml", {}
    seen = [
        dict(zip(("x", "y", "width [mm]"), row.split(","), strict=True))
        for row in (folder / "cracks.csv").read_text(encoding="utf-8").splitlines()[1:]
    ]
    plain = blockvis.explain(case, seen, runs=runs)
    assert plain.made_by_none == ()
    # A wide crack at a quarter of the span, halfway between two hinges, where all candidates keep the arch together.
    closed = [k for k, row in enumerate(seen) if row["width [mm]"] == "closed"]
    made = np.max([trial.widths.max(axis=0) for cause in plain.causes for trial in cause.trials], axis=0)
    still = min(closed, key=lambda k: float(made[k]))
    seen[still] = {**seen[still], "width [mm]": "4.0"}
    strange = blockvis.explain(case, seen, runs=runs)
    assert still in strange.unexplained
    assert f"unexplained: 4.0 mm at {strange.observations.labels[still]}" in str(strange)
    assert strange.causes[0].name == "right springer moves right", "one strange crack does not change the cause"


SINKING = CASE.replace('directions = ["down", "right"]', 'supports = ["right springer"]\ndirections = ["down"]')


@pytest.mark.slow
def test_runs_of_another_case_are_not_taken_for_its_own(tmp_path):
    load = '[[loads]]\nblocks = "voussoir 3"\nforce = [0, -40000]\n'
    (tmp_path / "bare.toml").write_text(SINKING, encoding="utf-8")
    (tmp_path / "loaded.toml").write_text(SINKING + load, encoding="utf-8")
    rows = [{"joint": "voussoir 1 | left springer", "width [mm]": 3.0}]
    bare = blockvis.explain(tmp_path / "bare.toml", rows)
    fresh = blockvis.explain(tmp_path / "loaded.toml", rows)
    assert str(fresh) != str(bare)
    runs = dict(bare.runs)
    assert str(blockvis.explain(tmp_path / "loaded.toml", rows, runs=runs)) == str(fresh)
    assert set(runs) == {*bare.runs, *fresh.runs}
    # What [explain] trusts changes no run.
    (tmp_path / "bare.toml").write_text(SINKING + "outliers = 0.1\n", encoding="utf-8")
    again = blockvis.explain(tmp_path / "bare.toml", rows, runs=runs)
    assert set(again.runs) <= set(runs) == {*bare.runs, *fresh.runs}


@pytest.mark.slow
def test_a_point_that_no_candidate_moves_so_is_unexplained(tmp_path):
    (tmp_path / "case.toml").write_text(SINKING, encoding="utf-8")
    rows = [{"block": f"{side} springer", "dx": 0, "dy": dy} for side, dy in (("right", -0.02), ("left", 0.02))]
    # A corner of the springer whose middle is said to have risen.
    arch = generators.segmental_arch(voussoirs=10)
    x, y = arch.outline(arch.index("left springer"))[0].tolist()
    rows.append({"block": "left springer", "x": x, "y": y, "dx": 0, "dy": 0})
    found = blockvis.explain(tmp_path / "case.toml", rows, tmp_path / "out")
    assert (found.unexplained_points, found.points_made_by_none) == ((1,), (1,))
    words = "(0, 20) mm of left springer at "
    assert re.search(rf"unexplained: {re.escape(words)}\(.*\) m; no candidate makes it", str(found))
    assert f"unexplained: {words}" in (tmp_path / "out" / "explain.html").read_text(encoding="utf-8")
    (told,) = json.loads((tmp_path / "out" / "explain.json").read_text(encoding="utf-8"))["unexplained"]
    assert (told["displacement_mm"], told["made_by_no_candidate"]) == ([0.0, 20.0], True)


@pytest.mark.slow
def test_where_the_model_falls_is_told_for_larger_amounts_are_not_weighed(tmp_path):
    thin = SINKING.replace("voussoirs = 10", "voussoirs = 6, thickness = 0.12").replace('["down"]', '["right"]')
    (tmp_path / "case.toml").write_text(thin, encoding="utf-8")
    found = blockvis.explain(tmp_path / "case.toml", [{"joint": "voussoir 3 | voussoir 4", "width [mm]": 30}], tmp_path)
    best = found.causes[0]
    assert best.amount[2] <= best.falls_at < best.best.amounts[-1]
    assert f"the first cause brings the model down at {1e3 * best.falls_at:.3g} mm; larger" in str(found)
    assert "The first cause brings the model down" in (tmp_path / "explain.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_benchmark_of_causes_runs(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    cases = importlib.import_module("explain_cases")
    structure, (case, *_), (rows, *_) = cases.cases_on("arch", None)
    result = cases.tried(structure, case, rows, {})
    assert result["rank"] == 1
    assert abs(result["off"]) < 0.25
    _, drawn, _ = cases.cases_on("arch", 4)
    assert any("turns" in one.cause for one in drawn)


@pytest.mark.slow
def test_displaced_points_tell_which_springer_has_moved(folder):
    arch = generators.segmental_arch(voussoirs=10)
    pose = moved(arch, (1.0, 0.0))
    rows = [
        {"block": arch.names[i], "dx": pose.positions[i, 0] - arch.centroids[i, 0],
         "dy": pose.positions[i, 1] - arch.centroids[i, 1]}
        for i in range(arch.n_blocks)
    ]  # fmt: skip
    (folder / "both.toml").write_text(CASE.replace('["down", "right"]', '["left", "right"]'), encoding="utf-8")
    found = blockvis.explain(folder / "both.toml", rows)
    assert len(found.runs) == 6, "movements that differ by a translation share their runs"
    assert found.causes[0].name == "right springer moves right"
    assert found.causes[0].also == ()
    assert found.causes[0].amount[1] == pytest.approx(SPREAD, rel=0.1)
    other = next(cause for cause in found.causes if cause.name == "left springer moves left")
    assert other.probability < 0.01
    np.testing.assert_allclose(
        found.comparison.displacements(other.best.moved(other.at)[None])[0, :, 0].max(), 0.0, atol=2e-3
    )


@pytest.mark.slow
def test_mirror_images_have_one_answer(tmp_path):
    """The right springer has gone down and right: what opens the same cracks as a likely cause comes under its name."""
    (tmp_path / "arch.toml").write_text(CASE.replace('"down", "right"', '"left", "right"'), encoding="utf-8")
    real = generators.segmental_arch(voussoirs=10)
    pose = moved(real, (1.0, -0.4))
    joints = posed(real, pose).joints(0)
    sides = (np.asarray(joints.cell_data[side]) for side in ("block_a", "block_b", "opening"))
    known = [(real.names[int(a)], real.names[int(b)], max(float(w), 0.0)) for a, b, w in zip(*sides, strict=True)]
    other = {"left springer": "right springer", "right springer": "left springer"}
    other |= {f"voussoir {k}": f"voussoir {11 - k}" for k in range(1, 11)}
    turned = {"left": "right", "right": "left"}
    found, runs = [], {}
    for mirrored in (False, True):
        rows = [
            {"joint": " | ".join(other[n] if mirrored else n for n in names), "width": w if w > 3e-4 else 0.0}
            for *names, w in known
        ]
        said = blockvis.explain(tmp_path / "arch.toml", rows, runs=runs)
        found.append(
            {
                " ".join(turned.get(w, w) if mirrored else w for w in cause.name.split()): cause.probability
                for cause in said.causes
            }
        )
    oblique = "right springer moves down and right"
    assert found[0][oblique] == pytest.approx(found[1][oblique], rel=0.05)


@pytest.mark.slow
def test_a_drawing_of_the_damaged_arch_is_explained(folder, tmp_path):
    arch = generators.segmental_arch(voussoirs=10)
    save_layout(arch, tmp_path / "damaged.svg", pose=moved(arch, (0.0, -1.0)))
    found = blockvis.explain(folder / "arch.toml", tmp_path / "damaged.svg", tmp_path / "out")
    assert found.causes[0].name == "right springer moves down"
    assert found.causes[0].amount[1] == pytest.approx(SPREAD, rel=0.1)
    # All joints are in the drawing, and tell the first cause from the others.
    assert "measure next: nothing; no two causes are left to tell apart" in str(found)
    assert "nothing; no two causes" in (tmp_path / "out" / "explain.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("joint,width [mm]\nvoussoir 1 | voussoir 2,3,5\n", "line 2: has 3 cells, and the first line 2; where numbers"),
        (
            "block,dx [mm],dy [mm],uncertainty [mm]\nvoussoir 1,3,2,-1\n",
            "line 2: uncertainty [mm] is -1; give a number above 0",
        ),
        ("block,dx,dy\nvoussoir 1,3,2\n", "line 2: dx puts 'voussoir 1' 3.61 m from where it is drawn"),
        ("x,y,width\n0,0.5,2\n", "line 2: width is 2 m, more than a block is wide"),
    ],
)
def test_observations_that_cannot_be_used_end_with_bad_input(folder, tmp_path, capsys, table, words):
    (tmp_path / "cracks.csv").write_text(table, encoding="utf-8")
    command = ["explain", str(folder / "arch.toml"), "--observed", str(tmp_path / "cracks.csv")]
    assert cli.main([*command, "-o", str(tmp_path / "out")]) == cli.BAD_INPUT
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            'directions = ["down", "right"]',
            'directions = ["under"]',
        ),
        ("friction = [0.7, 0.7]", "friction = [0.8, 0.7]"),
        ("friction = [0.7, 0.7]", "outliers = 1"),
        ("friction = [0.7, 0.7]", "inflections = [-1]"),
        ("friction = [0.7, 0.7]", "trough = 3"),
        ("friction = [0.7, 0.7]", "supports = [3]"),
        ("friction = [0.7, 0.7]", "frictions = 3"),
    ],
)
def test_keys_of_the_case_are_checked(folder, tmp_path, capsys, change, words):
    (tmp_path / "case.toml").write_text(CASE.replace(change, words), encoding="utf-8")
    command = ["explain", str(tmp_path / "case.toml"), "--observed", str(folder / "cracks.csv")]
    assert cli.main([*command, "-o", str(tmp_path / "out")]) == cli.BAD_INPUT
    assert f"[explain] {words.split(' ')[0]}" in capsys.readouterr().err


@pytest.mark.thorough
def test_a_structure_that_does_not_stand_has_no_cause(folder, tmp_path, capsys):
    slippery = CASE.replace("friction = [0.7, 0.7]", "friction = [0.01, 0.01]").replace("= 0.7\n", "= 0.01\n")
    (tmp_path / "case.toml").write_text(slippery, encoding="utf-8")
    command = ["explain", str(tmp_path / "case.toml"), "--observed", str(folder / "cracks.csv"), "--workers", "1"]
    assert cli.main([*command, "-o", str(tmp_path / "out")]) == cli.NO_EQUILIBRIUM
    assert "does not stand as drawn" in capsys.readouterr().out
    assert "does not stand as drawn" in (tmp_path / "out" / "explain.html").read_text(encoding="utf-8")


def test_a_folder_is_no_table(folder, capsys):
    command = ["explain", str(folder / "arch.toml"), "--observed", str(folder), "-o", str(folder / "never")]
    assert cli.main(command) == cli.BAD_INPUT
    assert "is a folder, no table" in capsys.readouterr().err


def test_what_is_of_the_plane_is_refused_in_space(folder, tmp_path, capsys):
    case = '[geometry]\nlayout = "dome"\n[geometry.parameters]\ncourses = 3\n'
    (tmp_path / "dome.toml").write_text(case, encoding="utf-8")
    command = ["explain", str(tmp_path / "dome.toml"), "--observed", str(folder / "cracks.csv")]
    assert cli.main([*command, "-o", str(tmp_path / "out")]) == cli.BAD_INPUT
    assert "cracks.csv: has no column 'z'; its columns are" in capsys.readouterr().err
    (tmp_path / "dome.toml").write_text(case + "[explain]\ntrough = true\n", encoding="utf-8")
    (tmp_path / "cracks.csv").write_text("joint,width [mm]\nstone 1-1 | springer 1,3\n", encoding="utf-8")
    command = ["explain", str(tmp_path / "dome.toml"), "--observed", str(tmp_path / "cracks.csv")]
    assert cli.main([*command, "-o", str(tmp_path / "out")]) == cli.BAD_INPUT
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert "dome.toml: [explain] trough is of structures in the plane, this one is in space; leave it out" in said


@pytest.mark.slow
def test_cracks_in_space_are_looked_at_from_where_they_are_seen(tmp_path):
    """A lintel behind a screen, with low walls far behind that draw the middle of all to the back."""
    boxes = {
        "left": ((0.0, 0.0, -1.0), (0.4, 0.5, 0.0)),
        "right": ((1.6, 0.0, -1.0), (2.0, 0.5, 0.0)),
        "lintel": ((0.0, 0.0, 0.0), (2.0, 0.5, 0.4)),
        "screen": ((-2.0, -1.2, -1.0), (4.0, -1.0, 1.5)),
        **{f"wall {k}": ((0.0, 4.0 + k, -1.0), (1.0, 4.5 + k, -0.9)) for k in range(4)},
    }
    roles = ["free" if name == "lintel" else "fixed" for name in boxes]
    solids = [box(*corners) for corners in boxes.values()]
    save_layout(solver.Assembly.from_solids(solids, names=list(boxes), roles=roles), tmp_path / "lintel.json")
    case = (
        "[geometry]\nfile = 'lintel.json'\n[material]\nfriction_coefficient = 0.6\n"
        "[explain]\nsupports = ['right']\ndirections = ['down']\n"
    )
    rows = [{"joint": "lintel | left", "width [mm]": 4.0}, {"joint": "lintel | right", "width [mm]": 4.0}]

    def cracks(name, view=""):
        (tmp_path / f"{name}.toml").write_text(f"{case}[output]\n{view}\n", encoding="utf-8")
        blockvis.explain(tmp_path / f"{name}.toml", rows, tmp_path / name)
        with Image.open(tmp_path / name / "explain.png") as picture:
            pixels = np.asarray(picture.convert("RGB")).astype(int)
        return int((np.abs(pixels - [226, 78, 27]).sum(axis=2) < 60).sum())

    seen, hidden, behind = (
        cracks("seen"),
        cracks("hidden", "view = { azimuth = -60, elevation = 24 }"),
        cracks("behind", "view = 'back'"),
    )
    # Of cracks behind the screen nothing is drawn but the dashed frames of their widths.
    assert min(seen, behind) > 2 * hidden > 0


@pytest.mark.slow
def test_a_width_beside_a_wider_one_is_written_elsewhere_on_its_joint(tmp_path, monkeypatch):
    """Two widths at an edge of a bearing, 5 mm apart: the second has room elsewhere on what is seen of it."""
    boxes = [((0, 0, -1), (0.4, 2, 0)), ((1.6, 0, -1), (2, 2, 0)), ((0, 0, 0), (2, 2, 0.4))]
    names, roles = ["left", "right", "lintel"], ["fixed", "fixed", "free"]
    save_layout(
        solver.Assembly.from_solids([box(*corners) for corners in boxes], names=names, roles=roles),
        tmp_path / "lintel.json",
    )
    (tmp_path / "lintel.toml").write_text(
        "[geometry]\nfile = 'lintel.json'\n[material]\nfriction_coefficient = 0.6\n"
        "[explain]\nsupports = ['right']\ndirections = ['down']\n[output]\nview = { azimuth = -150, elevation = 20 }\n"
    )
    rows = [
        {"joint": "lintel | left", "x": 0.2 + x, "y": 0.0, "z": 0.0, "width [mm]": width}
        for x, width in ((0.0, 4.0), (0.005, 3.7))
    ]
    removed = []
    monkeypatch.setattr(
        Annotation, "remove", lambda label: (removed.append(label.get_text()), label.set_visible(False))
    )
    blockvis.explain(tmp_path / "lintel.toml", rows, tmp_path / "out")
    assert "3.7" not in removed


@pytest.mark.slow
def test_the_springer_of_a_vault_that_has_sunk_comes_first(tmp_path, capsys):
    examples = Path(__file__).parents[2] / "examples" / "explain"
    command = ["explain", str(examples / "vault.toml"), "--observed", str(examples / "vault_cracks.csv")]
    assert cli.main([*command, "-o", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().out.splitlines()[1].startswith("springer 1 moves down by")
    found = json.loads((tmp_path / "out" / "explain.json").read_text(encoding="utf-8"))
    best = found["causes"][0]
    assert best["amount_low"] < 0.02 < best["amount_high"]
    assert {"x", "y", "z"} <= set(found["observations"]["widths"][0])
    with Image.open(tmp_path / "out" / "explain.png") as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    orange = np.abs(pixels - [226, 78, 27]).sum(axis=2) < 60
    assert all(third.sum() > 100 for third in np.array_split(orange, 3, axis=1))


def test_an_analysis_of_another_kind_is_refused(folder, tmp_path, capsys):
    (tmp_path / "case.toml").write_text(CASE + '[analysis]\nkind = "limit load"\n', encoding="utf-8")
    command = ["explain", str(tmp_path / "case.toml"), "--observed", str(folder / "cracks.csv")]
    assert cli.main([*command, "-o", str(tmp_path / "out")]) == cli.BAD_INPUT
    assert "explain follows settlements" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("whose", ["processes", "a scheduler's"])
def test_workers_give_the_same_answer(folder, said, scheduler, tmp_path, whose):
    workers = ["--workers", "2"] if whose == "processes" else ["--scheduler", scheduler]
    command = ["explain", str(folder / "arch.toml"), "--observed", str(folder / "cracks.csv"), *workers]
    assert cli.main([*command, "-o", str(tmp_path / "out")]) == 0
    mine, theirs = (
        json.loads((Path(path) / "explain.json").read_text(encoding="utf-8"))
        for path in (folder / "out", tmp_path / "out")
    )
    assert mine["causes"] == theirs["causes"]
