"""Annotations of an image in pixels, .json: COCO, LabelMe and VIA; what they outline is a block, its label a group."""

from __future__ import annotations

import base64
import binascii
import io
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from blockvis.layout.layout import Layout
from blockvis.layout.notes import LEFT_OUT, Note
from blockvis.layout.outlines import LARGEST_CHORD, rectangle
from blockvis.layout.refusal import Refused
from solver.mechanics import counted

from .image_scale import Placement, opened, placement_of
from .pixels import STAIRS, outlined, regions_of
from .reading import Reading, naming


@dataclass(frozen=True)
class _Mask:
    """Pixels of a shape: a (height, width) bool array, and column and row of its first."""

    pixels: np.ndarray
    corner: tuple[int, int] = (0, 0)


@dataclass
class _Annotated:
    """What a file annotates.

    ``size`` is width and height of the image in pixels; ``shapes`` a label and outlines or masks for each thing;
    ``dropped`` counts by its kind what is no outline.
    """

    program: str
    image: str = ""
    size: tuple[float, float] | None = None
    shapes: list[tuple[str, list[np.ndarray | _Mask]]] = field(default_factory=list)
    dropped: Counter[str] = field(default_factory=Counter)


def program_of(content: Any) -> str:
    """Name the program whose annotations a parsed file holds: "COCO", "LabelMe" or "VIA"; "" for none.

    Examples
    --------
    >>> program_of({"images": [], "annotations": [], "categories": []})
    'COCO'
    """
    if not isinstance(content, dict):
        return ""
    if isinstance(content.get("annotations"), list) and isinstance(content.get("images"), list):
        return "COCO"
    if isinstance(content.get("shapes"), list) and ("imagePath" in content or "imageHeight" in content):
        return "LabelMe"
    files = _via_files(content)
    return "VIA" if files and all(isinstance(one, dict) and "regions" in one for one in files.values()) else ""


def read_content(content: Any, path: Path, reading: Reading) -> Layout | None:
    """Read the blocks of parsed annotations; None for what is none."""
    program = program_of(content)
    if not program:
        return None
    reading.refuse_view()
    try:
        found = _READERS[program](content)
    except Refused:
        raise
    except (LookupError, TypeError, AttributeError, ValueError, OverflowError) as error:
        raise ValueError(
            f"it has annotations of {program} that cannot be read ({type(error).__name__} {error}); export again"
        ) from None
    if not found.shapes:
        kinds = ", ".join(f"{n} {kind}" for kind, n in found.dropped.items()) or "nothing"
        raise ValueError(f"it outlines no stone, it has {kinds}; annotate each stone by a polygon or a mask")
    return _layout_of(found, placement_in(path, found, reading), reading)


def _layout_of(found: _Annotated, placement: Placement, reading: Reading) -> Layout:
    """Make a block of each piece of what is annotated."""
    from .images import maybe_openings

    smallest, tolerance = (reading.image.get(key) for key in ("smallest", "outline_tolerance"))
    stairs = STAIRS if tolerance is None else tolerance / placement.pixel
    speck = None if smallest is None else smallest / placement.pixel
    of_label = Counter[str]()
    rings, names, groups, several = [], [], [], 0
    for label, outlines in found.shapes:
        of_label[label] += 1
        name = f"{label or 'stone'} {of_label[label]}"
        pieces = [ring for outline in outlines for ring in _rings(outline, stairs, speck)]
        if not pieces:
            found.dropped["masks of a few pixels"] += 1
        several += len(pieces) > 1
        for k, ring in enumerate(pieces):
            rings.append(placement.placed(ring))
            names.append(name if len(pieces) == 1 else f"{name}-{k + 1}")
            groups.append(label)
    flat = [np.asarray(ring)[::-1] for ring in rings]
    return Layout(tuple(flat), tuple(names), tuple(groups), unit=placement.unit,
                  notes=(*_notes(found, placement, several), *maybe_openings(flat, names, ())))  # fmt: skip


def placement_in(path: Path, found: _Annotated, reading: Reading) -> Placement:
    """Find where the pixels of the annotated image lie; the image beside the file is looked at for its size."""
    image = path.parent / Path(found.image.replace("\\", "/")).name if found.image else path
    if found.size is None and image.is_file() and image != path:
        found.size = opened(image)[0].size
    if found.size is None:
        # Without a size the lowest of the shapes is at zero.
        ends = [np.max(ring, axis=0) for _, rings in found.shapes for ring in rings if isinstance(ring, np.ndarray)]
        height = float(np.max(ends, axis=0)[1]) if ends else 0.0
        placement = placement_of(path, None, reading, image)
        if reading.image.get("pixel") is None:
            # A world file says itself where the first row lies.
            return placement
        return replace(placement, matrix=placement.matrix - np.outer(height * placement.matrix[:, 1], [0.0, 0.0, 1.0]))
    return placement_of(path, found.size, reading, image)


def annotated_placement(content: Any, path: Path, reading: Reading) -> tuple[Placement, tuple[float, float] | None]:
    """Find where the image of annotations lies, and its size."""
    with naming(f"'{path}'"):
        found = _READERS[program_of(content)](content)
    return placement_in(path, found, reading), found.size


def _notes(found: _Annotated, placement: Placement, several: int) -> tuple[str, ...]:
    size = f"{found.size[0]:g} × {found.size[1]:g}" if found.size else "an unknown number of"
    notes: list[str] = [
        f"annotations of {found.program} on an image of {size} pixels of {1e3 * placement.pixel:.4g} mm "
        f"({placement.source})"
    ]
    if several:
        notes.append(f"{counted(several, 'annotation is', 'annotations are')} in several pieces; each piece is a block")
    if found.dropped:
        listed = ", ".join(f"{n} {kind}" for kind, n in found.dropped.items())
        notes.append(Note(LEFT_OUT, f"left out: {listed}, which outline nothing"))
    return tuple(notes)


def _rings(outline: np.ndarray | _Mask, stairs: float, speck: float | None) -> Iterator[np.ndarray]:
    """Yield the outlines of a shape, (n, 2) arrays in columns and rows counted down."""
    if isinstance(outline, np.ndarray):
        yield outline
        return
    regions = regions_of(outline.pixels.astype(int), speck)
    if len(regions.labels):
        for ring in outlined(regions, stairs).rings:
            yield ring * [1.0, -1.0] + outline.corner


def _corners(points: Any) -> np.ndarray:
    """(n, 2) array: corners of a polygon, the first not repeated."""
    ring = np.array(points, dtype=float).reshape(-1, 2)
    return ring[:-1] if len(ring) > 3 and (ring[0] == ring[-1]).all() else ring


def _ellipse(x: float, y: float, rx: float, ry: float, turn: float = 0.0) -> np.ndarray:
    n = max(round(2.0 * np.pi / LARGEST_CHORD), round(np.pi * np.sqrt(max(rx, ry))))
    angle = 2.0 * np.pi * np.arange(n) / n
    c, s = np.cos(turn), np.sin(turn)
    return np.array([x, y]) + np.stack([rx * np.cos(angle), ry * np.sin(angle)], axis=1) @ [[c, s], [-s, c]]


def _one_image(names: list[str]) -> None:
    if len(names) > 1:
        listed = ", ".join(names[:4]) + (" ..." if len(names) > 4 else "")
        raise Refused(f"it annotates {len(names)} images ({listed}); export one of them alone")


def _coco(content: Mapping[str, Any]) -> _Annotated:
    found = _Annotated("COCO")
    used = {one.get("image_id") for one in content["annotations"]}
    images = [image for image in content["images"] if image.get("id") in used] or content["images"][:1]
    _one_image([str(image.get("file_name", image.get("id"))) for image in images])
    if images:
        found.image = str(images[0].get("file_name", ""))
        found.size = _size(images[0].get("width"), images[0].get("height"))
    label = {one.get("id"): str(one.get("name", "")) for one in content.get("categories", [])}
    for one in content["annotations"]:
        shape = one.get("segmentation")
        name = label.get(one.get("category_id"), "")
        if isinstance(shape, dict):
            found.shapes.append((name, [_Mask(_run_lengths(shape))]))
            continue
        rings = [_corners(ring) for ring in shape or [] if len(ring) >= 6]
        if rings:
            found.shapes.append((name, list(rings)))
        else:
            found.dropped["boxes without an outline" if one.get("bbox") else "annotations without an outline"] += 1
    return found


def _run_lengths(shape: Mapping[str, Any]) -> np.ndarray:
    """(height, width) bool array: a mask of COCO, written as the lengths of its runs, column by column."""
    height, width = (int(n) for n in shape["size"])
    counts = shape["counts"]
    if isinstance(counts, str):
        counts = _unpacked(counts)
    runs = np.array(counts, dtype=np.int64)
    if height * width > 10**8 or (runs < 0).any() or runs.sum() != height * width:
        raise Refused(f"it has a mask whose runs make {runs.sum()} pixels, not {height} × {width}; export it again")
    filled = np.repeat(np.arange(len(runs)) % 2 == 1, runs)
    return filled.reshape(width, height).T


def _unpacked(text: str) -> list[int]:
    """Unpack run lengths: five bits a character, and from the third on the difference to the last but one."""
    counts: list[int] = []
    value = shift = 0
    for code in text.encode("ascii", "replace"):
        bits = code - 48
        value |= (bits & 31) << shift
        shift += 5
        if bits & 32:
            continue
        if bits & 16:
            value -= 1 << shift
        counts.append(value + (counts[-2] if len(counts) > 2 else 0))
        value = shift = 0
    return counts


def _size(width: Any, height: Any) -> tuple[float, float] | None:
    try:
        size = float(width), float(height)
    except (TypeError, ValueError):
        return None
    return size if min(size) > 0.0 else None


def _labelme(content: Mapping[str, Any]) -> _Annotated:
    found = _Annotated("LabelMe", str(content.get("imagePath") or ""))
    found.size = _size(content.get("imageWidth"), content.get("imageHeight"))
    for one in content["shapes"]:
        label, kind = str(one.get("label") or ""), str(one.get("shape_type") or "polygon")
        points = np.array(one["points"], dtype=float).reshape(-1, 2)
        outline: np.ndarray | _Mask
        if kind == "polygon" and len(points) > 2:
            outline = _corners(points)
        elif kind == "rectangle" and len(points) > 1:
            outline = rectangle(*points.min(axis=0), *points.max(axis=0))
        elif kind == "circle" and len(points) == 2:
            radius = float(np.hypot(*(points[1] - points[0])))
            outline = _ellipse(float(points[0, 0]), float(points[0, 1]), radius, radius)
        elif kind == "mask" and one.get("mask"):
            outline = _Mask(_picture_of(str(one["mask"])), (int(points[:, 0].min()), int(points[:, 1].min())))
        else:
            found.dropped[f"shapes of kind {kind}"] += 1
            continue
        found.shapes.append((label, [outline]))
    return found


def _picture_of(text: str) -> np.ndarray:
    """(height, width) bool array: a mask of LabelMe, written as a picture."""
    try:
        return np.asarray(Image.open(io.BytesIO(base64.b64decode(text))).convert("L")) > 0
    except (OSError, binascii.Error) as error:
        raise Refused(f"it has a mask that is no picture ({error}); export it again") from None


def _via_files(content: Mapping[str, Any]) -> Mapping[str, Any]:
    held = content.get("_via_img_metadata", content)
    return held if isinstance(held, dict) else {}


def _via(content: Mapping[str, Any]) -> _Annotated:
    files = [one for one in _via_files(content).values() if one["regions"]]
    _one_image([str(one.get("filename")) for one in files])
    found = _Annotated("VIA", str(files[0].get("filename") or "") if files else "")
    for one in files:
        regions = one["regions"]
        for region in regions.values() if isinstance(regions, dict) else regions:
            shape = region["shape_attributes"]
            outline = _via_outline(shape)
            if outline is None:
                found.dropped[f"shapes of kind {shape.get('name')}"] += 1
            else:
                found.shapes.append((_via_label(region.get("region_attributes") or {}), [outline]))
    return found


def _via_outline(shape: Mapping[str, Any]) -> np.ndarray | None:
    kind = shape.get("name")
    if kind == "polygon" and len(shape["all_points_x"]) > 2:
        return _corners(np.stack([shape["all_points_x"], shape["all_points_y"]], axis=1))
    if kind == "rect":
        x, y, width, height = (float(shape[key]) for key in ("x", "y", "width", "height"))
        return rectangle(x, y, x + width, y + height)
    if kind in ("circle", "ellipse"):
        rx = float(shape.get("r", shape.get("rx", 0.0)))
        turn = float(shape.get("theta", 0.0))
        return _ellipse(float(shape["cx"]), float(shape["cy"]), rx, float(shape.get("ry", rx)), turn)
    return None


def _via_label(attributes: Mapping[str, Any]) -> str:
    """Take the label among the attributes of a region: that of a usual name, or the first that is a text."""
    texts = {key: value for key, value in attributes.items() if isinstance(value, str) and value}
    usual = [key for key in texts if key.lower() in ("label", "class", "type", "category", "group", "name")]
    return texts[(usual or list(texts))[0]] if texts else ""


_READERS = {"COCO": _coco, "LabelMe": _labelme, "VIA": _via}
