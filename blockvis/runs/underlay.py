"""The photograph that a case puts under its pictures, and where it lies."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image

from blockvis.cases.contents import Case
from blockvis.formats import FORMATS
from blockvis.formats.annotations import annotated_placement, program_of
from blockvis.formats.image_scale import Placement, opened, placement_of, written_placement
from blockvis.formats.reading import Reading
from blockvis.layout.units import metres_per
from blockvis.pictures.underlay import Underlay

from .reopen import case_of

#: A photograph whose sides are in the proportion of the drawing's image within this has its corners where that has.
SAME_SHAPE = 0.01


def underlay_of(case: Case) -> Underlay | None:
    """Read the photograph under the pictures of a case; None if it names none.

    Raises ``ValueError`` for one that is missing, and one of which nothing says where it lies.
    """
    if case.underlay is None:
        return None
    where = f"{case.source}: [output] underlay"
    file = case.source.parent / case.underlay
    if not file.is_file():
        raise ValueError(f"{where}: there is no file '{file}'")
    image, tags = opened(file)
    drawn = _drawing(case)
    own: Placement | None = None
    if drawn is None or drawn[0].source.startswith(("world", "tags")):
        own = written_placement(file, tags, {})
    if own is not None:
        return Underlay(_pixels(image), own.matrix * _metres(own, case))
    if drawn is None or drawn[1] is None:
        raise ValueError(
            f"{where}: nothing says where '{file.name}' lies; put a world file beside it, or read the blocks from an "
            "image of the same size"
        )
    (width, height), (w, h) = image.size, drawn[1]
    if abs(width * h - height * w) > SAME_SHAPE * width * h:
        raise ValueError(
            f"{where}: '{file.name}' has {width} × {height} pixels, the image of the blocks {w:g} × {h:g}; they must "
            "show the same part of the wall: cut both alike, or give both world files"
        )
    return Underlay(_pixels(image), drawn[0].matrix * _metres(drawn[0], case) * [w / width, h / height, 1.0])


def _pixels(image: Image.Image) -> np.ndarray:
    return np.asarray(image.convert("RGB"))


def stored_underlay(folder: Path) -> Underlay | None:
    """Read the photograph under the pictures of a results folder, if its case names one."""
    case = case_of(folder)
    return None if case is None else underlay_of(case)


def _drawing(case: Case) -> tuple[Placement, tuple[float, float] | None] | None:
    """Find where the image of the blocks lies, and its size; None where they come from no image."""
    if case.file is None:
        return None
    reading = Reading(unit=case.unit, image=case.image)
    known = FORMATS.get(case.file.suffix.lower())
    if known is not None and known.module == "images" and case.file.is_file():
        image, tags = opened(case.file)
        return placement_of(case.file, image.size, reading, tags=tags), image.size
    if case.file.suffix.lower() == ".json" and case.file.is_file():
        content = json.loads(Path(case.file).read_text(encoding="utf-8-sig"))
        return annotated_placement(content, case.file, reading) if program_of(content) else None
    return None


def _metres(placement: Placement, case: Case) -> float:
    return metres_per(placement.unit or case.unit or "m")
