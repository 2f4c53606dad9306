"""Frames to a film: mp4, gif or webp, by the suffix of the file, or to a folder of pictures."""

from __future__ import annotations

import errno
import importlib
import os
import shutil
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from blockvis.results.folder import VIDEO_SUFFIXES
from blockvis.system.atomic_files import atomic_file, make_folder, partial_of

#: What imageio's writer is given for each format. Quality of x264 is 0 lossless, 51 worst: line drawings show ringing
#: from about 22 on. A gif has a palette per frame: one of the first frame lacks the colours of cracks that open later.
#: One thread keeps up with what draws, costs less in all, and the film is the same bytes on any number of cores.
_ENCODERS: dict[str, dict[str, Any]] = {
    ".mp4": {
        "codec": "libx264",
        "pixelformat": "yuv420p",
        "output_params": [
            "-crf",
            "19",
            "-preset",
            "veryfast",
            "-threads",
            "1",
            "-movflags",
            "+faststart",
            "-f",
            "mp4",
        ],
    },
    ".gif": {
        "codec": "gif",
        "pixelformat": "pal8",
        "output_params": [
            "-vf",
            "split[a][b];[a]palettegen=stats_mode=single[palette];[b][palette]paletteuse=new=1:dither=none",
            *("-loop", "0", "-f", "gif"),
        ],
    },
    ".webp": {
        "codec": "libwebp_anim",
        "pixelformat": "bgra",
        "output_params": ["-quality", "85", "-compression_level", "2", "-loop", "0", "-f", "webp"],
    },
}

#: Frames per second of a gif at most: browsers play one of shorter frames at ten per second.
FASTEST_GIF = 50.0

#: Free bytes below which a disk counts as full: the encoder writes in pieces of less.
FULL_DISK = 2**20


def write_film(
    frames: Iterable[Image.Image],
    path: str | os.PathLike[str],
    *,
    size: tuple[int, int],
    fps: float,
) -> Path:
    """Write frames as a film, whole or not at all.

    Parameters
    ----------
    frames : iterable of PIL.Image.Image
        RGB; drawn one at a time, as they are asked for.
    path : path
        Ending in .mp4, .gif or .webp; a name without an ending is a folder of pictures, frame_00000.png and so on.
    size : (int, int)
        Width and height in pixels, both even.
    fps : float
        Frames per second, as they were planned; of a gif no more than ``FASTEST_GIF``.

    Raises
    ------
    ValueError
        For a suffix or a size that cannot be written.
    OSError
        If the disk is full, or the encoder stops before its end.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if not suffix:
        return _write_pictures(frames, path)
    if suffix not in VIDEO_SUFFIXES:
        raise ValueError(
            f"'{path.name}' is no animation that blockvis writes; end its name in {', '.join(VIDEO_SUFFIXES)}, "
            "or in / for a folder of pictures"
        )
    if size[0] % 2 or size[1] % 2:
        raise ValueError(f"an animation of {size[0]} × {size[1]} pixels cannot be encoded; both must be even")
    _open_for_writing(path)
    with atomic_file(path) as partial:
        try:
            _encode(frames, partial, fps)
        except OSError as error:
            raise _not_written(path, error) from None
        if partial.is_file() and not _reaches_its_end(partial):
            raise _not_written(path, None)
    return path


def _open_for_writing(path: Path) -> None:
    """Refuse a place that cannot be written before the first frame is drawn: the encoder would not say why."""
    try:
        make_folder(path.parent)
        if path.is_file() or not path.exists():
            partial_of(path).open("wb").close()
    except OSError as error:
        raise OSError(f"'{path}' cannot be written ({error.strerror}); choose another place for the film") from None


def _write_pictures(frames: Iterable[Image.Image], folder: Path) -> Path:
    """Write frames as pictures into a folder of their own, all or none; those of a film before go."""
    if folder.exists() and not (folder.is_dir() and all(map(_is_frame, folder.iterdir()))):
        raise ValueError(f"'{folder}' holds what is no frame of a film; choose another name for the folder of pictures")
    partial = partial_of(folder)
    shutil.rmtree(partial, ignore_errors=True)
    make_folder(partial)
    try:
        for number, frame in enumerate(frames):
            frame.save(partial / f"frame_{number:05d}.png")
        shutil.rmtree(folder, ignore_errors=True)
        partial.rename(folder)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return folder


def _is_frame(path: Path) -> bool:
    return path.name.startswith("frame_") and path.suffix == ".png"


def find_encoder() -> None:
    """Load what writes films and find its program, for who has nothing else to do yet."""
    importlib.import_module("imageio.v2")
    importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe()


def _encode(frames: Iterable[Image.Image], path: Path, fps: float) -> None:
    import imageio.v2 as imageio

    writer = imageio.get_writer(
        str(path.absolute()),
        # imageio writes a gif or webp by a writer that holds all frames in memory; its writer of videos holds one.
        format=".mp4",
        mode="I",
        fps=fps,
        macro_block_size=2,
        ffmpeg_log_level="error",
        **_ENCODERS[path.suffix.lower()],
    )
    with closing(writer):
        for frame in frames:
            writer.append_data(np.asarray(frame))


def _reaches_its_end(path: Path) -> bool:
    """Whether a film ends where its format says it does: imageio gets no error of an encoder that stops at the end."""
    size = path.stat().st_size
    with path.open("rb") as film:
        if path.suffix.lower() == ".gif":
            film.seek(max(size - 1, 0))
            return film.read() == b";"
        if path.suffix.lower() == ".webp":
            return int.from_bytes(film.read(8)[4:], "little") + 8 == size
        # The boxes of an mp4, of which "moov" says where the frames are.
        at, boxes = 0, set()
        while at < size:
            film.seek(at)
            length, name = int.from_bytes(film.read(4), "big"), film.read(4)
            at += int.from_bytes(film.read(8), "big") if length == 1 else max(length, 8)
            boxes.add(name)
    return at == size and b"moov" in boxes


def _not_written(path: Path, error: OSError | None) -> OSError:
    """Make the error for a film that could not be written; the encoder itself only says that it stopped."""
    if shutil.disk_usage(path.parent).free < FULL_DISK:
        return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
    reason = str(error).strip().partition("\n")[0] if error else "the encoder stopped before its end"
    return OSError(f"'{path}' could not be written: {reason}")
