"""Units of drawings."""

import re

import ezdxf
import pytest

from blockvis import read, read_layout
from blockvis.cli import main


def square(folder, size, stated=""):
    """A file of one square block that states a unit, or none."""
    drawing = ezdxf.new("R2000")
    drawing.header["$INSUNITS"] = {"": 0, "in": 1, "ft": 2, "mm": 4, "cm": 5, "m": 6}[stated]
    drawing.modelspace().add_lwpolyline([(0, 0), (size, 0), (size, size), (0, size)], close=True)
    drawing.saveas(folder / "a.dxf")
    return folder / "a.dxf"


@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("Inches", 0.0254), (" m ", 1.0)])
def test_names_of_units(tmp_path, unit, metres):
    assert read(square(tmp_path, 1.0), unit=unit).areas == pytest.approx([metres**2])


def test_a_unit_that_is_none_is_refused(tmp_path):
    with pytest.raises(ValueError, match="unit 'ell' is not known; the units of length are m, mm"):
        read(square(tmp_path, 1.0), unit="ell")


@pytest.mark.parametrize(
    ("given", "stated", "size", "unit", "word"),
    [
        (None, "", 0.3, "m", "m was assumed"),
        (None, "mm", 250.0, "mm", ""),
        (None, "in", 0.127, "m", "unit clash"),
        # Neither makes a plausible block: the file's word stands.
        (None, "mm", 1e-3, "mm", ""),
        ("m", "in", 0.127, "m", "because that was asked for"),
        ("cm", "cm", 25.0, "cm", ""),
    ],
)
def test_choice(tmp_path, given, stated, size, unit, word):
    layout = read_layout(square(tmp_path, size, stated), unit=given)
    notes = [note for note in layout.notes if " in doubt: " not in note]
    assert layout.unit == unit
    assert word in " ".join(notes)
    assert bool(word) == bool(notes)


def test_the_note_of_a_unit_that_is_read_in_instead_names_the_other_one_that_is_as_possible(tmp_path):
    layout = read_layout(square(tmp_path, 69.3, "m"))
    assert layout.unit == "cm"
    assert "cm would make it 0.693 m, mm 0.0693 m: cm was assumed" in " ".join(layout.notes)


@pytest.mark.parametrize(("stated", "size", "metric"), [("in", 137.0, "mm"), ("ft", 25.0, "cm"), ("in", 50.0, "")])
def test_inches_of_a_template_that_make_blocks_too_large_are_doubted(tmp_path, stated, size, metric):
    layout = read_layout(square(tmp_path, size, stated))
    assert layout.unit == stated
    told = [note for note in layout.notes if f"unit {stated} in doubt" in note]
    assert len(told) == bool(metric)
    assert all(f"by --unit {metric}" in note for note in told)


def page(folder, scale=50):
    """Stones of 0.5 by 0.3 m at 1 : scale on a page of points, as of a PDF."""
    size = 72 / 25.4 * 1000 / scale
    stones = "".join(
        f'<rect x="{100 + 0.5 * k * size}" y="9" width="{0.5 * size}" height="{0.3 * size}"/>' for k in range(4)
    )
    text = f'<svg xmlns="http://www.w3.org/2000/svg" width="841.89pt" viewBox="0 0 841.89 595.28">{stones}</svg>'
    (folder / "a.svg").write_text(text, encoding="utf-8")
    return folder / "a.svg"


def test_no_unit_is_made_up_for_a_page_at_a_scale(tmp_path, capsys):
    drawing = page(tmp_path)
    layout = read_layout(drawing)
    assert layout.unit == "pt"
    (note,) = layout.notes
    assert "unit pt in doubt: it makes the median block 0.00775 m across; is it drawn at a scale, as at 1:50?" in note
    assert "50 pt would make it 0.387 m, 20 pt 0.155 m" in note
    assert 'or --unit "50 pt"' in note
    assert main(["new", str(drawing), "-o", str(tmp_path / "a.toml")], outputs=()) == 2
    assert 'or --unit "50 pt"' in capsys.readouterr().err
    case = tmp_path / "b.toml"
    case.write_text('[geometry]\nfile = "a.svg"\n[settlement]\ndirection = [0, -1]\n', encoding="utf-8")
    assert main(["run", str(case), "-o", str(tmp_path / "out")]) == 2
    assert 'as [geometry] unit = "50 pt", or unit = "pt" if it is right' in capsys.readouterr().err
    assert read(drawing, unit="50 pt").areas == pytest.approx([0.15] * 4)


@pytest.mark.parametrize("scale", [200, 500, 1000, 10000])
def test_plans_at_small_scales_are_refused_with_theirs(tmp_path, capsys, scale):
    """At 1:1000 stones were read as drawn, of 0.4 mm; at 1:200 half of their size was the most that was proposed."""
    assert main(["new", str(page(tmp_path, scale)), "-o", str(tmp_path / "a.toml")], outputs=()) == 2
    assert re.search(rf" {scale} pt (would make it )?0\.387 m", capsys.readouterr().err)


@pytest.mark.parametrize(
    ("stated", "word"), [("in", "unit clash: the file says its unit is in"), ("", "m was assumed")]
)
def test_a_new_case_is_written_with_the_notes_on_its_unit(tmp_path, capsys, stated, word):
    assert main(["new", str(square(tmp_path, 0.127, stated)), "-o", str(tmp_path / "a.toml")], outputs=()) == 0
    assert word in capsys.readouterr().err
    assert f"# Note: {word[:8]}" in (tmp_path / "a.toml").read_text(encoding="utf-8") or not stated
