"""Frames to a film: mp4, gif or webp, by the suffix of the file, or to a folder of pictures."""

from __future__ import annotations

import errno
import importlib
import os
import shutil
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from subprocess import PIPE, Popen
from tempfile import TemporaryFile

from PIL import Image

from blockvis.results.folder import VIDEO_SUFFIXES
from blockvis.system.atomic_files import atomic_file, make_folder, partial_of

#: Codec, format of pixels and options of ffmpeg for each format. Quality of x264 is 0 lossless, 51 worst: line drawings
#: show ringing from about 22 on. A gif has a palette per frame: one of the first frame lacks the colours of cracks that
#: open later. One thread keeps up with what draws, costs less in all, and the film is the same bytes on any number of
#: cores.
_ENCODERS = {
    ".mp4": ("libx264", "yuv420p", "-crf 19 -preset veryfast -threads 1 -movflags +faststart -f mp4"),
    ".gif": (
        "gif",
        "pal8",
        "-vf split[a][b];[a]palettegen=stats_mode=single[palette];[b][palette]paletteuse=new=1:dither=none "
        "-loop 0 -f gif",
    ),
    ".webp": ("libwebp_anim", "bgra", "-quality 85 -compression_level 2 -loop 0 -f webp"),
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
    """Write frames as a film, whole or not at all, and draw each as it is asked for.

    The path ends in .mp4, .gif or .webp; a name without an ending is a folder of pictures, frame_00000.png and so on.
    Width and height are even; a gif has no more than ``FASTEST_GIF`` frames per second. Raises ``ValueError`` for what
    cannot be written so, and ``OSError`` if the disk is full or the encoder stops before its end.
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
        failed = _encode(frames, partial, size, fps, suffix)
        if failed is not None:
            raise _not_written(path, failed)
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
    if folder.exists() and not (folder.is_dir() and all(path.match("frame_*.png") for path in folder.iterdir())):
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


def find_encoder() -> str:
    """Find the program that encodes films, as who has nothing else to do yet may do early."""
    return str(importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe())


def _encode(frames: Iterable[Image.Image], path: Path, size: tuple[int, int], fps: float, suffix: str) -> str | None:
    """Encode frames by ffmpeg; returns what it said where it stopped before its end."""
    codec, pixels, options = _ENCODERS[suffix]
    given = f"-f rawvideo -pix_fmt rgb24 -s {size[0]}x{size[1]} -r {Fraction(fps).limit_denominator()} -i -"
    written = f"-an -vcodec {codec} -pix_fmt {pixels} -v error {options}"
    command = [find_encoder(), "-y", *given.split(), *written.split(), str(path.absolute())]
    with TemporaryFile() as said:
        encoder = Popen(command, stdin=PIPE, stderr=said)
        assert encoder.stdin is not None
        whole = False
        try:
            with encoder.stdin as entry:
                for frame in frames:
                    entry.write(frame.tobytes())
            whole = True
        except BrokenPipeError:
            # Why the encoder takes no more it says itself, some only after they have closed their entry.
            pass
        except BaseException:
            encoder.kill()
            raise
        finally:
            encoder.wait()
        said.seek(0)
        return None if whole and not encoder.returncode else said.read().decode(errors="replace")


def _not_written(path: Path, said: str) -> OSError:
    """Make the error for a film that could not be written, from what the encoder said."""
    if shutil.disk_usage(path.parent).free < FULL_DISK:
        return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
    reason = said.strip().partition("\n")[0] or "the encoder stopped before its end"
    return OSError(f"'{path}' could not be written: {reason}")
