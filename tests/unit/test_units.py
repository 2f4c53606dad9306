"""Units of drawings."""

import ezdxf
import pytest

from blockvis import read, read_layout


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
