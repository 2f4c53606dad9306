"""Images opened, and where their pixels lie: by keys of the case, a world file beside it, or tags of a GeoTIFF."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from numbers import Real
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from PIL import Image, ImageOps, TiffTags, UnidentifiedImageError

from .reading import Reading


class ImageKeys(TypedDict, total=False):
    """What may be said of an image, or of annotations of one; each may be None.

    Attributes
    ----------
    width, height : float [m]
        Of the whole image; one of them.
    pixel : float [m]
        Size of a pixel, instead.
    background : int or str
        Value, or colour such as "white" or "#ff8000", of what is no stone.
    smallest : float [m]
        Regions less than this across are specks.
    outline_tolerance : float [m]
        Within which staircases of pixels are simplified.
    """

    width: float | None
    height: float | None
    pixel: float | None
    background: int | str | None
    smallest: float | None
    outline_tolerance: float | None


#: More pixels than this are refused before they fill the memory.
MOST_PIXELS = 60_000_000

#: Keys of GeoTIFF: kind of model (2 is in degrees), where a pixel is named (2: its middle), unit of length.
_MODEL, _RASTER, _LENGTH = 1024, 1025, 3076

#: Units of length of GeoTIFF, in m.
_LENGTHS = {9001: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0}

#: Height and width agree within this: both may be given where they say the same.
SAME_SCALE = 0.01


@dataclass(frozen=True)
class Placement:
    """Where the pixels of an image lie.

    ``matrix`` (2, 3) takes column and row, (0, 0) the upper left corner of the image, and 1 to x and y, of which
    ``unit`` is "" where the file does not say it; ``source`` says in words what says so.
    """

    matrix: np.ndarray
    unit: str
    source: str

    @property
    def pixel(self) -> float:
        """Size of a pixel."""
        return float(np.sqrt(abs(np.linalg.det(self.matrix[:, :2]))))

    def placed(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) array: x and y of points in columns and rows, the rows counted down."""
        return points @ self.matrix[:, :2].T + self.matrix[:, 2]


def opened(path: Path) -> tuple[Image.Image, Mapping[str, Any]]:
    """Open an image, upright, and read its tags by their names, if it is a TIFF."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            # Of files by name Pillow maps TIFFs into memory, and shears those that lie on their side.
            content = path.read_bytes()
            image = Image.open(BytesIO(content))
        width, height = image.size
        if width * height > MOST_PIXELS:
            raise ValueError(
                f"'{path}' has {width} × {height} pixels, more than {MOST_PIXELS}; scale it down, or cut it"
            )
        tags = {TiffTags.lookup(number).name: value for number, value in getattr(image, "tag_v2", {}).items()}
        # A lossy WebP blurs colours as a JPEG does.
        form = "JPEG" if image.format == "WEBP" and b"VP8L" not in content else image.format
        image.load()
        upright = ImageOps.exif_transpose(image)
    except (UnidentifiedImageError, Image.DecompressionBombError):
        raise ValueError(f"'{path}' is no image that can be read, or too large a one; write it as PNG") from None
    except (OSError, SyntaxError, EOFError, IndexError, TypeError) as error:
        raise ValueError(f"'{path}' is a damaged image ({error}); write it again as PNG") from None
    upright.format = form
    return upright, tags


def placement_of(
    path: Path,
    size: tuple[float, float] | None,
    reading: Reading,
    image: Path | None = None,
    tags: Mapping[str, Any] | None = None,
) -> Placement:
    """Find where the pixels of an image lie, or of the image of annotations; the path is named in messages.

    ``size`` is width and height in pixels, if they are known; ``tags`` are those of a TIFF.
    """
    given = reading.image
    said = {}
    for key in ("width", "height", "pixel"):
        if (value := given.get(key)) is not None:
            if not isinstance(value, Real):
                raise ValueError(f"'{path}': {key} is {value!r}; give a length in m above 0")
            said[key] = float(value)
    drawn = written_placement(image or path, tags or {}, said)
    if said:
        return _of_keys(path, size, said, reading.unit, drawn)
    if drawn is not None:
        return drawn
    wide = f" of the {size[0]:g} pixels" if size else ""
    raise ValueError(
        f"'{path}' has no scale; give the width{wide} in m, --width 1.2 or [geometry] width = 1.2, or height, or the "
        f"size of a pixel, pixel = 0.002; or a world file {_world_files(image or path)[0].name} beside it"
    )


def written_placement(path: Path, tags: Mapping[str, Any], said: Mapping[str, float]) -> Placement | None:
    """Read where an image lies from the world file beside it or its tags; None where neither says it."""
    return _of_world_file(path) or _of_tags(path, tags, said)


def _of_keys(
    path: Path, size: tuple[float, float] | None, said: dict[str, float], unit: str | None, drawn: Placement | None
) -> Placement:
    """Place an image by its width, its height or the size of a pixel, its lower left corner at (0, 0)."""
    if unit not in (None, "m"):
        raise ValueError(f"'{path}': unit is {unit}, but {' and '.join(said)} are in m; leave out the unit")
    for key, value in said.items():
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"'{path}': {key} is {value:g}; give a length in m above 0")
    if size is None and "pixel" not in said:
        raise ValueError(
            f"'{path}' does not say how many pixels its image has; give pixel = ... in m, or put the image beside it"
        )
    width, height = size or (1.0, 0.0)
    pixels = {"width": width, "height": height, "pixel": 1.0}
    sizes = {key: value / pixels[key] for key, value in said.items()}
    if max(sizes.values()) > (1.0 + SAME_SCALE) * min(sizes.values()):
        listed = ", ".join(f"{key} = {said[key]:g} makes it {1e3 * value:.4g} mm" for key, value in sizes.items())
        raise ValueError(f"'{path}': the size of a pixel is given twice: {listed}; give one of them")
    first = next(iter(said))
    pixel = sizes[first]
    words = f"{first} = {said[first]:g} m" + (f" instead of {drawn.source}" if drawn else "")
    return Placement(np.array([[pixel, 0.0, 0.0], [0.0, -pixel, pixel * height]]), "m", words)


def _world_files(image: Path) -> list[Path]:
    """List the names of world files: first and last letter of the image's suffix and w, all of it and w, or wld."""
    # Annotations may not name their image.
    letters = "png" if image.suffix.lower() in ("", ".json") else image.suffix[1:].lower()
    suffixes = (f".{letters[0]}{letters[-1]}w", f".{letters}w", ".wld")
    return [image.with_suffix(end) for suffix in suffixes for end in (suffix, suffix.upper())]


def _of_world_file(image: Path) -> Placement | None:
    """Read the world file beside an image; None if there is none."""
    file = next((name for name in _world_files(image) if name.is_file()), None)
    if file is None:
        return None
    try:
        a, d, b, e, c, f = (float(word.replace(",", ".")) for word in file.read_text(encoding="utf-8").split())
    except (ValueError, UnicodeDecodeError):
        raise ValueError(f"'{file}' is no world file; it has six numbers, one a line: A, D, B, E, C, F") from None
    matrix = np.array([[a, b, c], [d, e, f]])
    if not np.isfinite(matrix).all() or a * e - b * d == 0.0:
        raise ValueError(f"'{file}' gives pixels no size (A = {a:g}, D = {d:g}, B = {b:g}, E = {e:g}); repair it")
    # It names the middle of the first pixel.
    matrix[:, 2] -= 0.5 * (matrix[:, 0] + matrix[:, 1])
    return Placement(matrix, "", f"world file {file.name}")


def _of_tags(path: Path, tags: Mapping[str, Any], said: Mapping[str, float]) -> Placement | None:
    """Read the tags of a GeoTIFF; None if it has none."""
    if "ModelTransformationTag" in tags:
        matrix = np.array(tags["ModelTransformationTag"], dtype=float).reshape(4, 4)[:2, [0, 1, 3]]
    elif {"ModelPixelScaleTag", "ModelTiepointTag"} <= {*tags}:
        sx, sy = map(float, tags["ModelPixelScaleTag"][:2])
        column, row, _, x, y, *_ = map(float, tags["ModelTiepointTag"][:6])
        matrix = np.array([[sx, 0.0, x - column * sx], [0.0, -sy, y + row * sy]])
    else:
        return None
    directory = np.array(tags.get("GeoKeyDirectoryTag", (1, 1, 0, 0)), dtype=int)[4:]
    keys = {int(key): int(value) for key, where, _, value in directory[: len(directory) // 4 * 4].reshape(-1, 4)
            if where == 0}  # fmt: skip
    if keys.get(_MODEL) == 2:
        if said:
            return None
        raise ValueError(f"'{path}' is georeferenced in degrees; write it in metres, or give pixel = ... in m")
    if keys.get(_RASTER) == 2:
        matrix[:, 2] -= 0.5 * (matrix[:, 0] + matrix[:, 1])
    factor = _LENGTHS.get(keys.get(_LENGTH, 0), 0.0)
    return Placement(matrix * (factor or 1.0), "m" if factor else "", "tags of the GeoTIFF")
