"""Units of drawings."""

import numpy as np
import pytest

from blockvis.layout.units import chosen_unit, metres_per


def test_names_of_units():
    assert metres_per("mm") == 1e-3
    assert metres_per("Inches") == 0.0254
    assert metres_per(" m ") == 1.0
    with pytest.raises(ValueError, match="unit 'ell' is not known; the units of length are m, mm"):
        metres_per("ell")


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
def test_choice(given, stated, size, unit, word):
    chosen, note = chosen_unit(given, stated, np.array([size]))
    assert chosen == unit
    assert word in note
    assert bool(word) == bool(note)
