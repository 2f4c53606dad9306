"""Frames to a film: mp4, gif or webp, by the suffix of the file."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from PIL import Image

from blockvis.atomic_files import whole_file
from blockvis.video_suffixes import VIDEO_SUFFIXES

#: Quality of x264 (0 lossless, 51 worst): line drawings show ringing from about 22 on.
CRF = "19"


def write_film(
    frames: Iterable[Image.Image], path: str | os.PathLike[str], *, size: tuple[int, int], fps: float
) -> Path:
    """Writes frames as a film, whole or not at all.

    Parameters
    ----------
    frames : iterable of PIL.Image.Image
        Drawn one at a time, as they are asked for.
    path : path
        Ending in .mp4, .gif or .webp.
    size : (int, int)
        Width and height in pixels, both even.
    fps : float
        Frames per second; a gif counts in hundredths of a second.

    Returns
    -------
    pathlib.Path
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in VIDEO_SUFFIXES:
        raise ValueError(
            f"'{path.name}' is no animation that blockvis writes; end its name in {', '.join(VIDEO_SUFFIXES)}"
        )
    if size[0] % 2 or size[1] % 2:
        raise ValueError(f"an animation of {size[0]} × {size[1]} pixels cannot be encoded; both must be even")
    with whole_file(path) as partial:
        if suffix == ".mp4":
            _write_mp4(frames, partial, size, fps)
        else:
            _write_pillow(frames, partial, fps)
    return path


def _write_mp4(frames: Iterable[Image.Image], path: Path, size: tuple[int, int], fps: float) -> None:
    import imageio_ffmpeg

    stream = imageio_ffmpeg.write_frames(
        str(path),
        size,
        fps=fps,
        codec="libx264",
        pix_fmt_out="yuv420p",
        quality=None,
        macro_block_size=2,
        output_params=["-crf", CRF, "-preset", "veryfast", "-movflags", "+faststart"],
    )
    stream.send(None)
    try:
        for frame in frames:
            stream.send(frame.tobytes())
    finally:
        stream.close()


def _write_pillow(frames: Iterable[Image.Image], path: Path, fps: float) -> None:
    duration = max(20, round(100.0 / fps) * 10)
    pictures: Iterator[Image.Image] = iter(frames)
    options: dict[str, object] = {"save_all": True, "duration": duration, "loop": 0}
    if path.suffix.lower() == ".gif":
        # One palette per frame: a shared one of the first frame lacks the colours of cracks that open later.
        pictures = (
            picture.quantize(method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE) for picture in pictures
        )
        options["optimize"] = False
    else:
        options |= {"quality": 80, "method": 2}
    first = next(pictures)
    first.save(path, append_images=pictures, **options)
