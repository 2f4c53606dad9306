"""The reaction curve."""

import re
from dataclasses import replace

import numpy as np
import pytest
from structures import arch_response, dropped_brick, parted, partly_unbounded, pixels, rectangle, report_of, wall

import blockvis
import solver
from blockvis import draw_curve
from solver import mechanics


def test_png_has_a_curve_and_the_collapse(tmp_path):
    path = draw_curve(arch_response(), tmp_path / "new" / "curve.png")
    picture = pixels(path)
    assert picture.shape == (1000, 1600, 3)
    red, _, blue = np.moveaxis(picture, 2, 0)
    assert (blue > red + 100).sum() > 300, "the curve"
    assert (red > blue + 100).sum() > 300, "the collapse"
    assert [p.name for p in path.parent.iterdir()] == ["curve.png"]


def test_svg_says_what_it_shows(tmp_path):
    text = draw_curve(arch_response(), tmp_path / "curve.svg").read_text(encoding="utf-8")
    said = re.findall(r"<!-- (.*?) -->", text)
    assert "settlement [m]" in said
    assert "reaction [kN]" in said
    assert "reaction / weight W" in said
    assert any(line.startswith("collapse at 0.141") for line in said)
    assert "4 moving parts, 5 hinges" in said


def test_other_files_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"curve\.bmp.*\.png, \.svg, \.pdf"):
        draw_curve(arch_response(), tmp_path / "curve.bmp")


def test_a_structure_without_any_equilibrium_has_an_empty_curve(tmp_path):
    response = arch_response()
    falling = tuple(i for i in response.increments if i not in response.path)
    nothing = replace(response, increments=falling, collapse=None)
    assert draw_curve(nothing, tmp_path / "curve.png").stat().st_size > 1000


def height_of(words, text):
    """Where a text that begins so stands in an SVG, downwards."""
    return float(re.search(rf"<!-- {words}.*?translate\([\d.]+ ([\d.]+)\)", text, re.DOTALL)[1])


def on_a_base(role):
    """A block of 0.5 m × 1 m on a support of this role."""
    return solver.Assembly.from_outlines([rectangle(-2, -1, 2, 0), rectangle(-0.25, 0, 0.25, 1)], roles=[role, "free"])


def said(response, path):
    return re.findall(r"<!-- (.*?) -->", draw_curve(response, path).read_text(encoding="utf-8"))


@pytest.mark.thorough
def test_names_of_case_and_ties_are_text_whatever_they_hold_and_long_ones_are_broken(tmp_path):
    """No formula between two "$", also in the legend where it begins with "_"; a long one hid where the lines are."""
    name = "tie in the middle of the northern arcade, 24 mm across, installed in 1897"
    (tmp_path / "$\\foo$ 5.toml").write_text(
        '[geometry]\nlayout = "arch"\n[settlement]\ndirection = [1, 0]\nincrement = 0.001\nlimit = 0.001\n'
        + "".join(
            f'[[ties]]\nname = "{tie}"\nfrom = [-1.0, {y}]\nto = [1.0, {y}]\nstiffness = 1e5\n'
            for tie, y in (("_1 $x_1$", 0.2), (name, 0.25))
        ),
        encoding="utf-8",
    )
    run = blockvis.run_case(tmp_path / "$\\foo$ 5.toml", tmp_path / "out", outputs=())
    told = said(run.response, tmp_path / "named.svg")
    assert "$\\foo$ 5" in told
    assert " _1 $x_1$" in told
    assert [line.strip() for line in told if line.strip() and line.strip() in name] == [
        "tie in the middle of the",
        "northern arcade, 24 mm",
        "across, installed in 1897",
    ]


def test_a_collapse_is_counted_once(tmp_path):
    """Not as a change to no hinges as well, where the supports alone move at the last equilibrium."""
    response = arch_response()
    last = response.path[-1]
    still = last.with_arrays(velocity=np.zeros_like(last.velocity), displacements=np.zeros_like(last.displacements))
    increments = tuple(still if increment is last else increment for increment in response.increments)
    told = said(replace(response, increments=increments), tmp_path / "curve.svg")
    assert "4 moving parts, 5 hinges" in told
    assert not any("no hinges" in line for line in told)


def test_ticks_are_plain_numbers(tmp_path):
    response = parted(wall(4, 3), 4, 0, settlement=2e-7)
    large = tuple(replace(i, measured=3.1e9 + k, reaction=3.1e9 + k) for k, i in enumerate(response.increments))
    told = said(replace(response, increments=large, collapse=None), tmp_path / "curve.svg")
    assert not [line for line in told if re.search(r"\de[+−-]?\d|10\^|×|mathdefault", line)], told


@pytest.mark.thorough
def test_a_curve_of_many_increments_is_a_line_without_dots(tmp_path):
    """Dots stand at few increments; no list of hinges over the plot, however often they change."""
    few, many = (parted(wall(4, 3), n, 0) for n in (10, 60))
    path = tmp_path / "curve.svg"
    uses = [draw_curve(response, path).read_text(encoding="utf-8").count("#145ca8") for response in (few, many)]
    assert uses[0] >= 10
    assert uses[1] <= 4
    assert not any("hinge" in line for line in said(few, tmp_path / "few.svg"))


def test_a_single_limit_load_has_numbers_on_both_axes(tmp_path):
    assembly = on_a_base("fixed")
    limit = solver.Structure(assembly, friction_coefficient=0.8).limit_load(acceleration=(1, 0))
    told = said(limit.response, tmp_path / "curve.svg")
    assert "displacement of the fastest block, first order [m]" in told
    assert sum(bool(re.fullmatch(r"0\.\d+", line)) for line in told) >= 6


@pytest.mark.thorough
def test_an_envelope_is_drawn_and_written_as_a_response(tmp_path):
    """It had no increments, and a picture of it ended in an AttributeError."""
    assembly = on_a_base("fixed")
    structure = solver.Structure(assembly, friction_coefficient=0.8)
    envelope = structure.envelope([0.4, 0.9, 0.6], lambda y: solver.PointForces.at(1, (1000.0, 0.0), (0.0, y)))
    assert "lowest" in " ".join(said(envelope, tmp_path / "curve.svg"))
    assert draw_curve(envelope.limits[0], tmp_path / "one.svg").exists()
    rows = (blockvis.write(envelope.response, tmp_path / "out") / "envelope.csv").read_text().splitlines()[1:]
    assert [float(row.split(",")[0]) for row in rows] == [0.4, 0.9, 0.6]
    np.testing.assert_allclose([float(row.split(",")[1]) for row in rows], envelope.multipliers)
    assert np.array_equal(envelope.response.loads.live, envelope.limits[1].response.loads.live)
    assert envelope.response.governing.parameter == 0.9


@pytest.mark.thorough
def test_a_reaction_that_leaves_that_at_rest_at_once_has_no_line_from_there(tmp_path):
    response = parted(wall(4, 3), 4, 0)
    rest, *others = response.path
    assert "at rest" not in said(response, tmp_path / "curve.svg")
    rest = replace(rest, measured=3500.0, reaction=3500.0, least=1000.0, largest=4000.0)
    response = replace(response, increments=(rest, *others))
    assert "at rest" in said(response, tmp_path / "curve.svg")
    # In a large increment the reaction has risen again.
    risen = replace(response, increments=(rest, *(replace(one, measured=3500.0) for one in others)))
    assert "at rest" in said(risen, tmp_path / "curve.svg")
    # A linear program gives the least reaction from the first increment on.
    by_program = replace(response, increments=(replace(rest, largest=np.nan), *others))
    assert "at rest" not in said(by_program, tmp_path / "curve.svg")


@pytest.mark.parametrize(
    ("largest", "told"),
    [
        (2.5e-7, "0.000250 mm"),
        (2.28753e-4, "0.229 mm"),
        pytest.param(0.005, "5.00 mm", marks=pytest.mark.thorough),
        pytest.param(0.0123, "12.30 mm", marks=pytest.mark.thorough),
    ],
)
def test_small_settlements_are_in_millimetres_with_digits_however_small_they_are(largest, told, tmp_path):
    response = arch_response()
    small = tuple(replace(i, parameter=largest * k) for k, i in enumerate(response.path[:2]))
    failed = replace(response, stop=solver.Status.SOLVER_FAILED, collapse=None, increments=small)
    assert f"solver failed at {told}: the curve is not complete" in said(failed, tmp_path / "curve.svg")


@pytest.mark.slow
def test_phases_in_other_units_share_no_axis(tmp_path):
    """A block on a support that sinks, then tilts until the block falls over its edge."""
    assembly = on_a_base("moving")
    sinks = solver.Settlement(direction=(0.0, -1.0), increment=0.05, limit=0.1)
    tilts = solver.Settlement(rotation_centre=(0.0, 0.0), rotation=-1.0, increment=0.1, limit=1.0)
    response = solver.settle(assembly, (sinks, tilts), friction_coefficient=0.8)
    assert response.collapse.displacement == pytest.approx(np.arctan(0.5), rel=1e-3)
    told = said(response, tmp_path / "curve.svg")
    assert {"settlement [rad]", "reaction [kN·m]"} <= set(told) or {"settlement [rad]", "reaction [N·m]"} <= set(told)
    assert any(line.endswith("phase 2 of 2") for line in told)
    assert "reaction / weight W" not in told


@pytest.mark.slow
def test_reactions_along_different_motions_are_not_joined(tmp_path):
    assembly = on_a_base("moving")
    down, aside = (solver.Settlement(direction=way, increment=0.1, limit=0.2) for way in ((0, -1), (1, 0)))
    for then, joined in ((replace(down, increment=0.05), True), (aside, False)):
        response = solver.settle(assembly, [down, then], friction_coefficient=0.6)
        text = draw_curve(response, tmp_path / "curve.svg").read_text(encoding="utf-8")
        assert "<!-- phase 2 from 0.2 m" in text
        assert ("reaction along another motion" in text) is not joined
        assert len(re.findall("stroke-width: 2; stroke-linecap", text)) == (1 if joined else 2)
        assert f'"breaks":{"[]" if joined else "[3]"}' in report_of(response).replace(" ", "")


@pytest.mark.slow
def test_phases_and_collapse_are_told_apart_and_ties_in_kilonewtons(tmp_path):
    """What begins is told above the plot, the collapse in it; a tie that comes later has no force before."""
    assembly = on_a_base("moving")
    post = solver.Tie("post", (1, None), ((0.0, 0.9), (0.0, 3.0)), stiffness=1e7, phase=2)
    sinks, tilts = (
        solver.Settlement(direction=(0, -1), increment=0.002, limit=0.002),
        solver.Settlement(direction=(1, -0.1), increment=0.002, limit=0.004),
    )
    response = solver.Structure(assembly, friction_coefficient=0.6, ties=[post]).settle([sinks, tilts])
    assert np.isnan(response.path[0].ties.elongations[0])
    largest = max(float(np.nanmax(np.abs(i.ties.forces))) for i in response.path)
    assert largest > 1e3
    assert "force of ties, tension + [kN]" in said(response, tmp_path / "ties.svg")
    response = arch_response()
    half = len(response.path) // 2
    increments = [replace(one, phase=int(k >= half)) for k, one in enumerate(response.increments)]
    phased = replace(response, increments=tuple(increments), settlements=response.settlements * 2)
    text = draw_curve(phased, tmp_path / "curve.svg").read_text(encoding="utf-8")
    assert height_of("collapse at ", text) > height_of("phase 2 from ", text) + 5.0


@pytest.mark.thorough
def test_words_of_short_phases_stand_apart_and_above_the_plot(tmp_path):
    response = parted(wall(4, 3), 9, 0)
    phases = [solver.Settlement((1, 0) if k % 2 else (0, -1)) for k in range(3)]
    increments = [replace(one, phase=max(k - 6, 0)) for k, one in enumerate(response.increments)]
    told = replace(response, increments=tuple(increments), settlements=tuple(phases))
    text = draw_curve(told, tmp_path / "curve.svg").read_text(encoding="utf-8")
    top = float(re.search(r'id="patch_2">\s*<path d="M [\d.]+ [\d.]+ \nL [\d.]+ [\d.]+ \nL [\d.]+ ([\d.]+)', text)[1])
    second, third = height_of("phase 2 from ", text), height_of("phase 3 from ", text)
    assert second + 8.0 < third < top


@pytest.mark.parametrize(("positions", "upright"), [(17, True), pytest.param(5, False, marks=pytest.mark.thorough)])
def test_what_is_unbounded_is_said_inside_its_band(positions, upright, tmp_path):
    text = draw_curve(partly_unbounded(positions), tmp_path / "curve.svg").read_text(encoding="utf-8")
    found = re.search(r"<!-- unbounded -->\s*<g [^>]*translate\(([\d.]+) [\d.]+\)( rotate\(-90\))?", text)
    assert bool(found[2]) is upright
    # Baseline of what is upright; of what lies, its left end.
    (band,) = re.findall(r'd="M ([\d.]+) [\d.]+ \nL [\d.]+ [\d.]+ \nL ([\d.]+) .*?opacity: 0.15', text, re.DOTALL)
    assert float(band[0]) < float(found[1]) < float(band[1])


def test_a_capacity_that_is_unbounded_before_a_settlement_is_on_its_curve(tmp_path):
    response = replace(partly_unbounded(5, without=0), parameter=mechanics.SETTLEMENT)
    text = draw_curve(response, tmp_path / "curve.svg").read_text(encoding="utf-8")
    assert "<!-- unbounded -->" in text
    assert "<!-- 0 -->" in text[text.index('id="xtick_1"') : text.index('id="xtick_2"')]


def test_a_settlement_along_any_direction_is_one_motion():
    """A direction that is divided by its length once more has another last digit: each step was a motion of its own."""
    askew = solver.Settlement(direction=(0.6, -1.0), increment=0.02, limit=0.5)
    longer = solver.Settlement(direction=(0.6, -1.0), increment=0.02, limit=1.0)
    response = replace(arch_response(), settlements=(askew, askew))
    assert '"breaks":[]' in report_of(response)
    halves = tuple(replace(one, phase=k % 2) for k, one in enumerate(response.path))
    turned = replace(longer, direction=(1.0, 0.0))
    for second, told in ((longer, ""), (turned, ",".join(map(str, range(1, len(halves)))))):
        assert f'"breaks":[{told}]' in report_of(
            replace(response, increments=halves, settlements=(askew, second), collapse=None)
        )


@pytest.mark.slow
def test_words_of_losses_stand_clear_of_those_of_the_collapse(tmp_path, monkeypatch):
    """They were covered by them, but for their ends."""
    stands, falls = dropped_brick(0.05), arch_response().collapse
    level = tuple(replace(increment, measured=1.0) for increment in stands.increments)
    stands = replace(stands, increments=level)
    end = stands.path[-1].parameter
    falls = replace(
        falls, displacement=end, bracket=(end, end + 1e-4), mechanism=np.zeros_like(stands.path[-1].velocity)
    )
    offsets = []
    for response in (stands, replace(stands, collapse=falls)):
        said = {}
        monkeypatch.setattr(
            "blockvis.pictures.curves._word",
            lambda _, words, place, offset, *__, said=said, **___: said.update({words: (place, offset)}),
        )
        draw_curve(response, tmp_path / "curve.png")
        offsets.append(said["1 block lost"])
    (place, (_, alone)), (same, (_, beside)) = offsets
    told = next(where for words, where in said.items() if words.startswith("collapse at"))
    assert place[1] == same[1] == told[0][1], "all stand below the curve"
    assert (alone, beside > 40.0) == (0.0, True)


@pytest.mark.slow
def test_words_of_a_loss_leave_the_curve_free_that_leads_there(tmp_path, monkeypatch):
    """Half-way down from there to nothing they covered the last dot before it."""
    stands, said = dropped_brick(0.05), {}
    monkeypatch.setattr(
        "blockvis.pictures.curves._word", lambda _, words, place, *__, **___: said.update({words: place})
    )
    lost = [increment.fallen.any() for increment in stands.increments]
    measured = [0.0 if gone else 1.0 for gone in lost]
    falling = tuple(replace(of, measured=size) for of, size in zip(stands.increments, measured, strict=True))
    draw_curve(replace(stands, increments=falling), tmp_path / "curve.png")
    assert lost[-1]
    assert said["1 block lost"][1] < 0.5
