"""What a caller asks for of a drawing: by layer, group, material and name, or by kind of entity and colour."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from .left_out import matches

#: Kinds of entities of drawings, as they can be asked for.
KINDS = (
    "arc", "circle", "ellipse", "face", "hatch", "line", "path", "polygon", "polyline", "rect", "solid", "spline",
    "text",
)  # fmt: skip

#: What formats call them, where it is something else.
_ALSO = {"lwpolyline": "polyline", "mpolygon": "hatch", "mtext": "text", "trace": "solid", "3dface": "solid"}


def look_of(word: str) -> str:
    """Write a kind of entity or a colour as drawings are compared by it.

    Examples
    --------
    >>> look_of("LWPOLYLINE"), look_of("#F00")
    ('polyline', '#ff0000')
    """
    word = word.strip().lower()
    if re.fullmatch(r"#[0-9a-f]{3}", word):
        return "#" + "".join(2 * digit for digit in word[1:])
    return _ALSO.get(word, word)


class Choice:
    """Patterns, as a caller gives them: of names, and kinds and colours where no name is meant.

    A pattern that fits one of the names, those of all layers, groups, materials and blocks, means names only.
    """

    def __init__(self, patterns: Sequence[str], names: Iterable[str]) -> None:
        names = set(names)
        self.patterns = tuple(pattern for pattern in patterns if matches(names, [pattern]))
        self.looks = frozenset(look_of(pattern) for pattern in patterns if pattern not in self.patterns)

    def takes(self, labels: Iterable[str], looks: Iterable[str] = ()) -> bool:
        """Whether what has these names, and this kind and colour, is meant."""
        return matches(labels, self.patterns) or not self.looks.isdisjoint(looks)
