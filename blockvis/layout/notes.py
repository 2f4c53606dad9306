"""Notes on a layout: what its reader assumed, changed or dropped, each with what it is about."""

from __future__ import annotations

#: The drawing was left out in part, or its shapes are not those of the file: a run repeats these notes.
LEFT_OUT, CHANGED = "left out", "changed"

#: The unit is in doubt, or clashes with the one that the file states.
UNIT, UNIT_CLASH = "unit", "unit clash"

#: Which unit was taken, where nothing speaks against it.
UNIT_TAKEN = "unit taken"

#: Kinds of what is said of the unit.
OF_UNITS = (UNIT, UNIT_CLASH, UNIT_TAKEN)

#: A drawing that stands upright was turned into the plane of x and y.
UPRIGHT = "upright"

#: A block is so much smaller than the others that it makes a run slow.
SPECK = "speck"

#: Kinds that change what is analysed, or how long that takes.
REPORTED = (LEFT_OUT, CHANGED, UNIT, UNIT_CLASH, SPECK)


class Note(str):
    """A sentence with its kind, a constant of this module; one without, a plain ``str``, is a remark."""

    kind: str

    def __new__(cls, kind: str, text: str) -> Note:
        """Make a note of what it is about and what it says."""
        note = super().__new__(cls, text)
        note.kind = kind
        return note

    def __reduce__(self) -> tuple[type[Note], tuple[str, str]]:
        """Copy and pickle both."""
        return Note, (self.kind, str(self))


def kind_of(note: str) -> str:
    """Return what a note is about; "" for a remark."""
    return note.kind if isinstance(note, Note) else ""
