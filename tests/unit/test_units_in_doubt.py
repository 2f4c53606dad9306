"""Numbers that are probably in another unit, and what a run changes: one note each."""

import warnings

import numpy as np
import pytest
from structures import assembly_of, case_from, drawn

import solver
from blockvis import read_layout, write_layout
from blockvis.cli import main


def bricks(path, factor, **more):
    rings = tuple(
        factor * np.array([[x, 0.0], [x + 0.24, 0.0], [x + 0.24, 0.071], [x, 0.071]]) for x in (0.0, 0.24, 0.48)
    )
    plain = drawn(path.with_suffix(".json"), rings, "abc", **more)
    if path != plain:
        write_layout(read_layout(plain, unit="m"), path)
    return path


@pytest.mark.parametrize(("factor", "unit"), [(1000.0, "mm"), (0.001, "km")])
def test_metres_are_doubted_too(tmp_path, factor, unit):
    notes = read_layout(bricks(tmp_path / "a.msh", factor)).notes
    assert [note for note in notes if note.startswith("unit m in doubt") and f'unit = "{unit}"' in note]
    # A unit that is given holds.
    assert read_layout(tmp_path / "a.msh", unit=unit).outlines[0][:, 0].max() == pytest.approx(0.24)
    assert not any("doubt" in note for note in read_layout(tmp_path / "a.msh", unit=unit).notes)


@pytest.mark.parametrize(
    ("unit", "size", "other"),
    [
        ("mm", 26.0, "cm would make it 0.26 m"),
        ("in", 26.0, ""),
        ("cm", 26.0, ""),
        # The file says so, too.
        ("m", 26.0, ""),
        ("5 cm", 1.0, ""),
    ],
)
def test_a_unit_that_is_given_is_doubted_where_another_makes_masonry(tmp_path, unit, size, other):
    square = size * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    notes = [note for note in read_layout(drawn(tmp_path / "a.json", [square]), unit=unit).notes if "doubt" in note]
    assert len(notes) == bool(other)
    assert all(f"unit {unit} in doubt, in which it is read as asked" in note and other in note for note in notes)


@pytest.mark.parametrize(
    ("size", "doubt"),
    [
        (0.05, ""),
        (0.3, ""),
        (2.0, ""),
        (9.0, ""),
        (35.0, "cm would make it 0.35 m"),
        # Stones of half a metre in cm are no chips of 5 cm in mm; bricks in mm no stones of a metre in cm.
        (
            49.9,
            'cm would make it 0.499 m, mm 0.0499 m, in 1.27 m: give the one it is drawn in, as [geometry] unit = "cm"',
        ),
        (
            105.0,
            'mm would make it 0.105 m, cm 1.05 m, in 2.67 m: give the one it is drawn in, as [geometry] unit = "mm"',
        ),
        # A stair in inches.
        (16.2, "cm would make it 0.162 m, in 0.411 m: give the one it is drawn in"),
    ],
)
def test_masonry_is_not_doubted(tmp_path, size, doubt):
    square = size * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    notes = [note for note in read_layout(drawn(tmp_path / "a.json", [square])).notes if note.startswith("unit")]
    assert bool(notes) == bool(doubt)
    assert doubt in " ".join(notes)


def assembled(tmp_path, text):
    moving = '[[supports]]\nrole = "moving"\noutline = [[-9, -9], [9, -9], [9, -8]]\n'
    motion = "" if "[settlement]" in text else "[settlement]\ndirection = [0, -1]\nincrement = 1e-4\nlimit = 1e-3\n"
    return assembly_of(case_from(f"{text}\n{moving}{motion}", tmp_path))


COLUMN = '[geometry]\nlayout = "column"\n'


def test_an_increment_of_more_than_the_whole_structure_is_refused(tmp_path):
    """After 15 s of a run a wall had sunk by 107 mm, in steps of 1 mm, of 10 m."""
    said = r"increment = 50 m is .* and the whole is 18 m: if it is in mm, give 0\.05, else at most 18$"
    with pytest.raises(ValueError, match=said):
        assembled(tmp_path, COLUMN + "[settlement]\ndirection = [0, -1]\nincrement = 50\nlimit = 100")


@pytest.mark.parametrize(("centre", "doubted"), [("[0, 900, 0]", False), ("[900, 0, 0]", True)])
def test_a_centre_far_along_its_axis_is_as_good_as_a_near_one(tmp_path, centre, doubted):
    turn = f"[settlement]\nrotation_centre = {centre}\nrotation_axis = [0, 2, 0]\nincrement = 1e-4\nlimit = 1e-3\n"
    case = case_from('[geometry]\nlayout = "column"\ndimension = 3\n' + turn, tmp_path)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        assembly_of(case)
    assert any("rotation_centre" in str(one.message) for one in said) is doubted


TIE = '[[ties]]\nname = "iron"\nfrom = { fixed = [-5, 0] }\nto = [0, 0.2]\n'
FILL = '[[backfill]]\nover = "*"\nsurface = 9\n'


@pytest.mark.parametrize(
    ("keys", "note"),
    [
        (
            "[material]\nfriction_coefficient = 35",
            "friction_coefficient = 35 is a slope of 88.4 degrees; .* tangent, 0.7",
        ),
        ("[material]\ndensity = 2.0", "density 2 kg/m³ is lighter than masonry; if it is in t/m³, give 2000 kg/m³"),
        ("[material]\ndensity = 20", "density 20 kg/m³ is lighter than masonry; if it is in kN/m³, give 2039 kg/m³"),
        ("thickness = 300", r"\[geometry\] thickness = 300 m is deeper than any wall .* is in mm, give 0.3 m"),
        (
            "[settlement]\ndirection = [0, -1]\nincrement = 5\nlimit = 100",
            "increment = 5 m is .* times the size of the median block, .* m: is it in mm\\? 0.005 m",
        ),
        (
            "[settlement]\nrotation_centre = [800, -1500]\nincrement = 1e-4\nlimit = 1e-3",
            r"rotation_centre = \[800.0, -1500.0\] m .* away from it: is it in mm\? \[0.8, -1.5\] m",
        ),
        ("[material]\ndensity = 0.5", "density 0.5 kg/m³ is lighter than masonry; if it is in t/m³, give 500 kg/m³"),
        (
            "[material]\ndensity = 18000",
            "density 18000 kg/m³ is heavier than lead; if it is in N/m³, give 1835 kg/m³",
        ),
        ("[material]\ndensity = 2.4e6", "density 2.4e[+]06 kg/m³ is .*; if it is in g/m³, give 2400 kg/m³"),
        (
            FILL + "unit_weight = 18",
            r"\[backfill\] unit_weight = 18 N/m³ is .*; if it is in kN/m³, give 1.8e[+]04 N/m³",
        ),
        (TIE + "area = 500\nmodulus = 2e11", r"\[\[ties\]\] 'iron' area = 500 m² is .* in mm², give 0.0005 m²"),
        (TIE + "area = 5e-4\nmodulus = 2.1e5", "modulus = 210000 Pa is softer .* in MPa, give 2.1e[+]11 Pa"),
        (TIE + "area = 5e-4\nmodulus = 210", "modulus = 210 Pa is softer .* in GPa, give 2.1e[+]11 Pa"),
        ("[material]\ncohesion = 0.06", r"\[material\] cohesion = 0.06 Pa .*; if it is in MPa, give 6e[+]04 Pa"),
        (
            "[material]\ncohesion = 6e4\ntensile_strength = 0.03",
            "tensile_strength = 0.03 Pa .*; if it is in MPa, give 3e[+]04 Pa",
        ),
        ("[material]\nnormal_stiffness = 5", "normal_stiffness = 5 Pa/m .* in GPa/m, which is N/mm³, give 5e[+]09"),
        (
            "[[supports]]\nname = 'soil'\nstiffness = 20\noutline = [[0, -9], [9, -9], [9, -8]]",
            r"\[\[supports\]\] 'soil' stiffness = 20 Pa/m .*MN/m³, give 2e[+]07 Pa/m",
        ),
    ],
)
def test_likely_unit_mistakes_and_numbers_a_power_of_ten_off_are_named(tmp_path, keys, note):
    with pytest.warns(UserWarning, match=note):
        assembled(tmp_path, COLUMN + keys)


def test_strengths_of_interfaces_are_doubted_too(tmp_path):
    drawn(tmp_path / "a.json", [np.array([[0, 0], [1, 0], [1, 1], [0, 1]])], material=("brick",))
    pair = '[[interfaces]]\nmaterials = ["brick", "brick"]\nfriction_coefficient = 0.6\ncohesion = 0.2'
    with pytest.warns(UserWarning, match=r"\[\[interfaces\]\] brick and brick cohesion = 0.2 Pa .* give 2e[+]05 Pa"):
        assembled(tmp_path, f'[geometry]\nfile = "a.json"\n{pair}')


@pytest.mark.parametrize(
    "keys",
    [
        "[material]\ndensity = 11340\ncohesion = 50\ntensile_strength = 20",
        "[material]\ndensity = 150\nnormal_stiffness = 1e5\nshear_stiffness = 1e5",
        TIE + "area = 1e-8\nmodulus = 1e6",
        TIE + "area = 4\nmodulus = 1.2e12",
        FILL + "unit_weight = 200",
        # Steps within an increment are chosen by their own error, however long it is.
        "[settlement]\ndirection = [0, -1]\nincrement = 0.3\nlimit = 0.6",
    ],
)
def test_models_of_lead_rubber_and_foam_and_long_increments_within_a_block_are_not_doubted(tmp_path, keys):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assembled(tmp_path, COLUMN + keys)


def test_a_unit_in_doubt_stops_a_run_until_the_case_gives_one(tmp_path, capsys):
    bricks(tmp_path / "a.msh", 1000.0)
    text = "[geometry]\nfile = 'a.msh'\n{}\n[settlement]\ndirection = [0, -1]\nincrement = 1e-4\nlimit = 1e-3\n"
    case = tmp_path / "case.toml"
    case.write_text(text.format("") + "[roles]\nblock_1 = 'moving'\n")
    assert main(["run", str(case), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "unit m in doubt: it makes the median block 131 m across; mm would make it 0.131 m" in said
    assert 'give the one it is drawn in, as [geometry] unit = "mm", or unit = "m" if it is right' in said
    for unit, width in (("mm", 0.72), ("m", 720.0)):
        assembly = assembled(tmp_path, f"[geometry]\nfile = 'a.msh'\nunit = '{unit}'\n")
        assert np.ptp(assembly.vertices[assembly.vertices[:, 1] > -1.0, 0]) == pytest.approx(width)


@pytest.mark.thorough
def test_the_unit_of_a_layout_of_our_own_holds(tmp_path):
    """A model of stones of 13 mm, which cm would make common masonry: the doubt is a note until `unit` is given."""
    bricks(tmp_path / "a.json", 100.0)
    content = (tmp_path / "a.json").read_text().replace('"unit": "m"', '"unit": "mm"')
    (tmp_path / "a.json").write_text(content)
    layout = read_layout(tmp_path / "a.json")
    assert (layout.unit, np.ptp(layout.outlines[0][:, 0])) == ("mm", pytest.approx(0.024))
    assert [note[:16] for note in layout.notes] == ["unit mm in doubt"]
    with pytest.warns(UserWarning, match="unit mm in doubt"):
        assembly = assembled(tmp_path, "[geometry]\nfile = 'a.json'\n")
    assert np.ptp(assembly.vertices[assembly.vertices[:, 1] > -1.0, 0]) == pytest.approx(0.072)
    assert not read_layout(tmp_path / "a.json", unit="mm").notes
    assert main(["new", str(tmp_path / "a.json"), "-o", str(tmp_path / "new.toml")]) == 0
    assert '\nunit = "mm"\n' in (tmp_path / "new.toml").read_text()


def test_density_of_the_file_wins_with_a_note(tmp_path):
    bricks(tmp_path / "a.json", 1.0, density=(2400.0, 2500.0, None))
    text = '[geometry]\nfile = "a.json"\n[material]\ndensity = 1800'
    with pytest.warns(UserWarning, match=r"density = 1800 is that of 1 block; 2 of 3 keep .* 2400 to 2500 kg/m³"):
        assembly = assembled(tmp_path, text)
    assert assembly.density[:3].tolist() == [2400.0, 2500.0, 1800.0]


def test_overlaps_cut_away_are_noted(tmp_path):
    rings = tuple(np.array([[x, 0.0], [x + 0.3, 0.0], [x + 0.3, 0.3], [x, 0.3]]) for x in (0.0, 0.298, 0.597))
    drawn(tmp_path / "a.json", rings, ("left", "middle", "right"))
    with pytest.warns(UserWarning, match=r"2 overlaps of up to 0.002 m were cut away, the deepest between 'left' and"):
        assembled(tmp_path, '[geometry]\nfile = "a.json"')


def test_the_first_line_of_a_run_says_the_largest_block(capsys):
    from pathlib import Path

    from blockvis.cli import _in_words

    rings = [np.array([[0, 0], [3, 0], [3, 1], [0, 1]]), np.array([[0, 1], [0.3, 1], [0.3, 1.4], [0, 1.4]])]
    wall = solver.Assembly.from_outlines(rings, roles=["moving", "free"])
    response = solver.settle(wall, solver.Settlement(direction=(0, -1), increment=0.01, limit=0.01))
    assert _in_words(response, Path("out")).startswith(
        "2 blocks (1 free), 0.3 m wide, 0.4 m high, weight 2354.4 N, largest block 0.5 m across\n"
    )


@pytest.mark.slow
def test_a_speck_among_large_blocks_is_named_where_it_is_read_and_run(tmp_path, capsys):
    stones = [[[0, 0], [1, 0], [1, 0.5], [0, 0.5]], [[0, 0.5], [1, 0.5], [1, 1], [0, 1]]]
    speck = [[0.5, 1], [0.501, 1], [0.501, 1.001], [0.5, 1.001]]
    path = drawn(tmp_path / "a.json", [np.array(ring) for ring in (*stones, speck)], ("low", "high", "speck"))
    assert any("block 'speck' is 0.001 m across, 1/707 of the median" in note for note in read_layout(path).notes)
    assert not any("governs the steps" in note for note in read_layout(path, ignore=("speck",)).notes)
    case = tmp_path / "case.toml"
    text = '[geometry]\nfile = "a.json"\n[roles]\nlow = "moving"\n[settlement]\ndirection = [0, -1]\nincrement = 0.01\n'
    case.write_text(text + "limit = 0.01\n[output]\nanimation = false\n", encoding="utf-8")
    assert main(["run", str(case), "--out", str(tmp_path / "out")]) == 0
    assert "block 'speck' is 0.001 m across" in capsys.readouterr().err
