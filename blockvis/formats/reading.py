"""What readers have in common: their options, and rows of our own in JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from blockvis.layout.left_out import matches

#: What a file nests deeper than this, groups or nodes, is damaged, or places itself; no program nests as deep.
DEEPEST = 200


@dataclass(frozen=True)
class Reading:
    """Options of a reader.

    They are those of :func:`blockvis.read_layout`, None where the caller says nothing; ``chord_tolerance`` is in m, and
    ``image`` has what :class:`blockvis.formats.image_scale.ImageKeys` lists. Readers ask ``ignore`` and ``only`` for
    bodies that are not closed, for lines, and for the plane of a drawing; outlines are left out when all are read.
    """

    unit: str | None = None
    chord_tolerance: float | None = None
    view: str | None = None
    ignore: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    dimension: int | None = None
    image: Mapping[str, Any] = field(default_factory=dict)

    def wants(self, labels: Iterable[str]) -> bool:
        """Whether what has these labels is wanted."""
        labels = [label for label in labels if label]
        return not matches(labels, self.ignore) and (not self.only or matches(labels, self.only))

    def refuse_view(self) -> None:
        """Refuse a view of what is drawn in the plane."""
        if self.view not in (None, "xy"):
            raise ValueError(f"it is drawn in the plane xy; it has no view {self.view}")

    def refuse_image_keys(self) -> None:
        """Refuse what is said of an image where a file is none; ``outline_tolerance`` is of every drawing."""
        given = [key for key, value in self.image.items() if value is not None and key != "outline_tolerance"]
        if given:
            raise ValueError(
                f"it is no image: {given[0]} is of images and annotations of them; leave it out, or give the unit"
            )


@contextmanager
def naming(called: str) -> Iterator[None]:
    """Say where something is refused, in which file or line, which readers leave to their callers: "it" is that."""
    try:
        yield
    except ValueError as error:
        if not (words := str(error)).startswith(called.rstrip("'")):
            named = f"{called} {words[3:]}" if words.startswith("it ") else f"{called}: {words}"
            error.args = (named, *error.args[1:])
        raise


@contextmanager
def parsing(kind: str) -> Iterator[None]:
    """Refuse a file that a library cannot read, which passes on whatever its parsing runs into."""
    try:
        yield
    except Exception as error:  # noqa: BLE001
        name = "" if isinstance(error, ValueError) else type(error).__name__
        reason = " ".join(f"{name} {error}".split())[:200]
        raise ValueError(f"it cannot be read as {kind} ({reason}); export it again") from None


def json_object(text: str | bytes) -> dict[str, Any]:
    """Parse what one of our writers put beside a block, or a program beside its blocks; empty where it is no object."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}
