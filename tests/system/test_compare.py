"""Two runs side by side, by ``blockvis compare`` and its files."""

import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from structures import arch_response, box, case_from, film_frames, moved_and_turned, pixels

import blockvis
import solver
from blockvis import generators
from blockvis.cli import main

CASE = Path(__file__).parents[2] / "examples" / "semicircular_arch.toml"
SCATTER = 'kind = "density", distribution = "lognormal", deviation = 0.01'


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    """Results of the same arch whose springer sinks as well."""
    arch = generators.arch()
    settlement = solver.Settlement((1, -0.5), increment=0.02, limit=0.06)
    response = solver.Structure(arch, friction_coefficient=2.0).settle(settlement)
    return blockvis.write(response, tmp_path_factory.mktemp("other") / "sinking-results")


def table(page, name):
    rows = re.search(rf'<table id="{name}">(.*?)</table>', page, re.S).group(1).split("</tr>")
    return {
        unescape(cells[0]): cells[1:] for cells in (re.findall(r"<t[hd]>(.*?)</t[hd]>", row) for row in rows) if cells
    }


def compared(tmp_path, *folders):
    """The page of two runs beside each other, without a film."""
    assert main(["compare", *map(str, folders), "-o", str(tmp_path / "both"), "--animation", "none"]) == 0
    return (tmp_path / "both" / "compare.html").read_text(encoding="utf-8")


@pytest.fixture
def picture_of(monkeypatch):
    """Takes what is to look at each picture instead of drawing it."""

    def taken(look):
        blank = Image.new("RGB", (800, 620))
        monkeypatch.setattr("blockvis.pictures.drawer.Drawer.picture", lambda *of, **told: look(*of, **told) or blank)

    return taken


@pytest.mark.slow
def test_numbers_curves_and_cracks_stand_side_by_side(arch_folder, other, tmp_path, capsys):
    out = tmp_path / "both"
    page = compared(tmp_path, arch_folder, other)
    assert f"compared in {out}/: compare.html, curves.png, side_by_side.png" in capsys.readouterr().out
    assert "No case in out and sinking, written from Python" in page
    numbers = table(page, "numbers")
    assert numbers[""] == ["out", "sinking"]
    assert numbers["status"] == ["collapsed", "limit reached"]
    one, two = arch_response(), blockvis.open_results(other)
    # At the last settlement that both reach, on the line between two increments.
    expected = [np.interp(0.06, r.parameters, r.values) for r in (one, two)]
    told = next(cells for name, cells in numbers.items() if name.endswith("0.0600 m"))
    assert [float(cell.removesuffix(" kN")) * 1e3 for cell in told] == pytest.approx(expected, rel=5e-4)
    cracks = table(page, "cracks")
    assert all(cell.endswith(" mm") for cell in cracks["voussoir 6 | voussoir 7"])
    curves = pixels(out / "curves.png")
    for colour in ((20, 92, 168), (226, 78, 27)):
        assert (np.abs(curves - np.array(colour)).sum(axis=2) == 0).sum() > 1000


@pytest.mark.slow
def test_curves_are_not_joined_where_the_supports_move_otherwise(tmp_path):
    """From out to in the reaction changes its sign."""
    there = solver.Settlement((1, 0), increment=0.01, limit=0.02)
    structure = solver.Structure(generators.arch(), friction_coefficient=2.0)
    response = structure.settle([there, replace(there, direction=(-1, 0))])
    assert response.values[2] * response.values[3] < 0.0
    both = {"one": response, "two": structure.settle(there)}
    folders = [str(blockvis.write(one, tmp_path / name)) for name, one in both.items()]
    assert main(["compare", *folders, "-o", str(tmp_path / "both"), "--no-film"]) == 0
    curve = (np.abs(pixels(tmp_path / "both" / "curves.png") - np.array((20, 92, 168))).sum(axis=2) == 0)[150:]
    assert 0 < curve.any(axis=1).sum() < 0.2 * len(curve)


@pytest.mark.slow
def test_a_multiplier_is_one_curve_however_supports_move(tmp_path):
    """It is that of the same live load: of limit loads at the end of each motion no curve was drawn."""
    motions = [f"[[settlement]]\ndirection = {way}\nincrement = 0.01\nlimit = 0.01\n" for way in ("[1, 0]", "[0, -1]")]
    text = '[geometry]\nlayout = "arch"\n[analysis]\nkind = "limit load"\ncapacity_at = [0.01]\n'
    live = '[[loads]]\nkind = "live"\nweight_fraction = [0.1, 0.0]\n'
    (tmp_path / "case.toml").write_text(text + live + "".join(motions), encoding="utf-8")
    folders = [str(tmp_path / name) for name in ("one", "two")]
    for folder in folders:
        assert main(["run", str(tmp_path / "case.toml"), "-o", folder, "--no-pictures"]) == 0
    compared(tmp_path, *folders)
    curve = (np.abs(pixels(tmp_path / "both" / "curves.png") - np.array((20, 92, 168))).sum(axis=2) == 0)[150:]
    assert curve.any(axis=0).sum() > 0.1 * curve.shape[1], "between the dashes of the other"


@pytest.mark.slow
def test_a_crack_of_one_run_has_the_opening_of_its_joint_in_the_other(other, tmp_path):
    settlement = solver.Settlement((0, -1), increment=0.02, limit=0.06)
    sinking = solver.Structure(generators.arch(), friction_coefficient=2.0).settle(settlement)
    folder = blockvis.write(sinking, tmp_path / "down-results")
    cracks = table(compared(tmp_path, folder, other), "cracks")
    assert cracks.pop("") == ["down", "sinking"]
    names, known = sinking.assembly.names, [blockvis.open_results(at).joints(3) for at in (folder, other)]
    rows = list(zip(known[0]["block_a"], known[0]["block_b"], *(one["opening"] for one in known), strict=False))
    truth = {f"{names[a]} | {names[b]}": (1e3 * one, 1e3 * two) for a, b, one, two in rows}
    found = {place: tuple(float(cell.removesuffix(" mm")) for cell in cells) for place, cells in cracks.items()}
    assert found == {place: pytest.approx(truth[place], rel=0.05, abs=2e-3) for place in found}
    assert any(min(openings) < 0.01 for openings in found.values()), "closed in one of them"


@pytest.mark.parametrize(("opening", "told"), [(1.1846e-3, "1.18 mm"), (3e-13, "0 mm")])
@pytest.mark.slow
def test_widths_of_cracks_are_rounded_once(arch_folder, other, tmp_path, monkeypatch, picture_of, opening, told):
    """As the report of each run has them; what rounding leaves of a closed joint is no width."""
    openings = "blockvis.comparison.compared.opening_and_slip"
    monkeypatch.setattr(openings, lambda assembly, joints, pose: np.tile([opening, 0.0], (len(joints), 1)))
    picture_of(lambda *of, **look: None)
    cracks = table(compared(tmp_path, arch_folder, other), "cracks")
    assert cracks.pop("") == ["out", "sinking"]
    assert {cell for cells in cracks.values() for cell in cells} == {told}


def test_both_pictures_of_a_settlement_have_one_unit(arch_folder, other, tmp_path, picture_of):
    """That of the run that goes further."""
    titles = []
    picture_of(lambda *of, title="", **look: titles.append(title.split("   ")[0]))
    compared(tmp_path, arch_folder, other)
    assert titles == [f"Settlement {at} m" for at in ("0.0200", "0.0400", "0.0600") for _ in range(2)]


@pytest.mark.parametrize("name", ["both.gif", "both.webp"])
@pytest.mark.slow
def test_one_layout_has_one_scale_and_moving_pictures_are_no_videos(
    name, arch_folder, other, tmp_path, monkeypatch, picture_of
):
    """Openings are to be compared by eye, and no browser plays a .gif as a video."""
    scales = []
    picture_of(lambda drawer, *of, **look: scales.append(drawer.scene.pixel))
    film = "blockvis.comparison.write.film_in_step"
    monkeypatch.setattr(film, lambda found, path, progress: path.write_bytes(b""))
    further = blockvis.write(arch_response(), tmp_path / "falls")
    assert main(["compare", str(further), str(other), "-o", str(tmp_path / "both"), "--animation", name]) == 0
    assert len(set(scales)) == 1
    page = (tmp_path / "both" / "compare.html").read_text(encoding="utf-8")
    assert f'<img src="{name}"' in page
    assert "<video controls" not in page


@pytest.mark.slow
def test_between_rest_and_the_first_increment_no_reaction_is_told(tmp_path, picture_of):
    """The reaction leaves that at rest at once: a line from there gave one path two reactions, by its increments."""
    titles, folders = [], []
    picture_of(lambda *of, title="", **look: titles.append(title))
    structure = solver.Structure(generators.arch(voussoirs=5), friction_coefficient=2.0)
    for step in (0.01, 0.02):
        response = structure.settle(solver.Settlement((1, 0), increment=step, limit=0.04))
        folders.append(blockvis.write(response, tmp_path / f"{step}"))
    numbers = table(compared(tmp_path, *folders), "numbers")
    first, second, last = (cells for name, cells in numbers.items() if name.startswith("reaction at settlement"))
    assert first[1] == "–" != first[0]
    assert "–" not in (*second, *last)
    assert [title.endswith("Reaction –") for title in titles] == [False, True, False, False, False, False]


@pytest.mark.slow
def test_blocks_in_space_are_seen_from_one_side(tmp_path, picture_of):
    sights, folders = [], []
    picture_of(lambda drawer, *of, **look: sights.append(drawer.sight))
    pads = [box((x, y, -0.2), (x + 0.3, y + 0.3, 0.0)) for x in (0.0, 0.7) for y in (0.0, 0.7)]
    columns = [box((x + 0.05, y + 0.05, 0.0), (x + 0.25, y + 0.25, 1.0)) for x in (0.0, 0.7) for y in (0.0, 0.7)]
    for sinks in (0, 3):
        roles = ["moving" if k == sinks else "fixed" for k in range(4)] + ["free"] * 4
        structure = solver.Structure(
            solver.Assembly.from_solids([*pads, *columns], roles=roles), friction_coefficient=0.6
        )
        response = structure.settle(solver.Settlement((0, 0, -1), increment=0.01, limit=0.01))
        folders.append(blockvis.write(response, tmp_path / f"{sinks}"))
    compared(tmp_path, *folders)
    assert len(sights) == 6
    assert len(set(sights)) == 1


@pytest.mark.slow
def test_places_of_several_settlements_are_told_as_their_sum(tmp_path):
    structure, folders = solver.Structure(generators.arch(voussoirs=5), friction_coefficient=2.0), []
    for step in (1e-3, 2e-3):
        response = structure.settle([solver.Settlement((1, 0), increment=step, limit=step)] * 2)
        folders.append(blockvis.write(response, tmp_path / f"{step}"))
    numbers = table(compared(tmp_path, *folders), "numbers")
    assert any(name.endswith(" at settlement 2.00 mm, all phases added") for name in numbers), list(numbers)


@pytest.mark.slow
def test_where_one_run_ends_the_next_settlement_of_the_other_has_not_begun(tmp_path):
    structure = solver.Structure(generators.arch(voussoirs=5), friction_coefficient=2.0)
    first, second = (solver.Settlement(way, increment=1e-3, limit=1e-3) for way in ((1, 0), (0, -1)))
    folders = [tmp_path / "one", tmp_path / "two"]
    for folder, settlements in zip(folders, ([first], [first, second]), strict=True):
        blockvis.write(structure.settle(settlements), folder)
    numbers = table(compared(tmp_path, *folders), "numbers")
    (told,) = [cells for name, cells in numbers.items() if name.endswith("1.00 mm, all phases added")]
    assert told[0] == told[1]


@pytest.mark.slow
def test_what_the_cases_differ_in_is_told(tmp_path):
    folders = []
    for friction, density in (("1.5", "1850.5"), ("2.0", "2000.0")):
        folders.append(tmp_path / friction)
        changes = [f"material.friction_coefficient={friction}", "settlement.limit=0.02", "output.animation=false"]
        # Of numbers as of dates the seventh digit tells.
        changes += [f"material.density={density}", f"imperfections=[{{{SCATTER}, seed={20260100 + int(friction[0])}}}]"]
        blockvis.run_case(blockvis.read_case(CASE, changes=changes), folders[-1], outputs=())
    page = compared(tmp_path, *folders)
    assert table(page, "keys") == {
        "": ["1.5", "2.0"],
        "material.friction_coefficient": ["1.5", "2"],
        "material.density": ["1850.5 kg/m³", "2000 kg/m³"],
        "imperfections 1.seed": ["20260101", "20260102"],
    }
    # Of a case that was changed in Python no key is known, and none of the other is a difference.
    changed = replace(blockvis.read_case(CASE, changes=changes), friction_coefficient=1.0)
    blockvis.run_case(changed, tmp_path / "changed", outputs=())
    page = compared(tmp_path / "one", folders[0], tmp_path / "changed")
    assert "No case in changed, written from Python" in page
    assert 'id="keys"' not in page


@pytest.mark.slow
def test_the_film_goes_in_step(arch_folder, other, tmp_path):
    out = tmp_path / "both"
    assert main(["compare", str(arch_folder), str(other), "-o", str(out)]) == 0
    frames = [frame.astype(int) for frame in film_frames(out / "compare.mp4")]
    # The sinking arch stops at less than half of the way of the other, which moves to its end.
    half = frames[0].shape[1] // 2
    change = [np.abs(frames[k] - frames[k + 1]).max(axis=(0, 2)) for k in (20, 100)]
    assert [int(row[half:].max()) > 40 for row in change] == [True, False], change
    assert [int(row[:half].max()) > 40 for row in change] == [True, True]


@pytest.mark.slow
def test_what_cannot_be_compared_is_refused_in_one_line(arch_folder, tmp_path, capsys):
    limit = solver.Structure(generators.arch(), friction_coefficient=2.0).limit_load(acceleration=(1, 0))
    standing = blockvis.write(limit.response, tmp_path / "limit")
    empty = tmp_path / "empty"
    empty.mkdir()
    turn = solver.Settlement(rotation=1.0, rotation_centre=(1, 0), increment=1e-3, limit=1e-3)
    turned = solver.Structure(generators.arch(voussoirs=5), friction_coefficient=2.0).settle(turn)
    for other, words in (
        (arch_folder, "are the same folder; give the results of two runs"),
        (standing, "share no axis"),
        (blockvis.write(turned, tmp_path / "turned"), "the parameter is settlement [m] in one and settlement [rad] in"),
        (
            blockvis.write(moved_and_turned(), tmp_path / "mixed"),
            "mixed' has settlements in m and in rad",
        ),
        (empty, "holds no results"),
    ):
        assert main(["compare", str(arch_folder), str(other), "-o", str(tmp_path / "both")]) == 2
        message = capsys.readouterr().err
        assert words in message
        assert message.count("\n") == 1
    assert not (tmp_path / "both").exists()
    assert main(["compare", str(arch_folder), str(standing), "-o", str(arch_folder), "--force"]) == 2
    assert capsys.readouterr().err.endswith("holds results already (increments); choose another folder with -o\n")


LIMIT_LOADS = """
[geometry]
layout = "arch"
[geometry.parameters]
voussoirs = 6
[material]
friction_coefficient = 0.8
[analysis]
kind = "limit load"
[[loads]]
kind = "live"
"""


@pytest.mark.slow
def test_loads_that_move_are_compared_where_they_are_lowest(tmp_path, picture_of):
    """Between two positions, on the line between their limit loads, nothing is a limit state."""
    folders, seen, lowest = [], [], []
    for places in ([-0.9, 0.9, 4], [-0.9, -0.1, 3]):
        folders.append(tmp_path / f"{places[-1]}")
        case = case_from(f"{LIMIT_LOADS}force = [0, -1000]\npositions = {places}\n", tmp_path)
        lowest.append(blockvis.run_case(case, folders[-1], outputs=()).response.governing.parameter)
    picture_of(lambda _, increment, **look: seen.append(increment.parameter))
    assert main(["compare", *map(str, folders), "-o", str(tmp_path / "both")]) == 0
    assert seen == lowest


def test_unbounded_limit_loads_are_compared_without_words_of_numpy(tmp_path, capsys):
    case = case_from(f"{LIMIT_LOADS}weight_fraction = [0, -1]\n", tmp_path)
    folders = [blockvis.run_case(case, tmp_path / name, outputs=()).folder for name in ("one", "two")]
    capsys.readouterr()
    assert main(["compare", *map(str, folders), "-o", str(tmp_path / "both")]) == 0
    assert capsys.readouterr().err == ""
