"""Films: their frames, their memory, and what is said and left where one cannot be written."""

import re
import subprocess
import weakref

import imageio.v2 as imageio
import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from blockvis.pictures import video
from blockvis.pictures.video import write_film
from blockvis.results.folder import VIDEO_SUFFIXES

SIZE = (128, 72)

#: The colours of the frames, one after another.
COLOURS = [(250, 250, 250), (200, 30, 30), (30, 160, 60), (40, 60, 200), (10, 10, 10)]


def frames(seen=None):
    for colour in COLOURS:
        picture = Image.new("RGB", SIZE, colour)
        if seen is not None:
            seen.append(weakref.ref(picture))
        yield picture


@pytest.mark.parametrize("suffix", VIDEO_SUFFIXES)
def test_a_film_holds_its_frames_in_order(tmp_path, suffix):
    path = write_film(frames(), tmp_path / f"film{suffix}", size=SIZE, fps=10.0)
    with imageio.get_reader(path) as film:
        found = [np.asarray(frame)[..., :3] for frame in film]
    assert len(found) == len(COLOURS)
    for frame, colour in zip(found, COLOURS, strict=True):
        assert frame.shape == (SIZE[1], SIZE[0], 3)
        # mp4 and webp keep brightness and colour apart, rounded each.
        assert np.abs(frame.astype(int) - colour).max() <= 6, colour
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", VIDEO_SUFFIXES)
def test_frames_are_forgotten_when_they_are_written(tmp_path, suffix):
    seen, alive = [], []

    def watched():
        for picture in frames(seen):
            alive.append(sum(ref() is not None for ref in seen))
            yield picture

    write_film(watched(), tmp_path / f"film{suffix}", size=SIZE, fps=10.0)
    assert len(alive) == len(COLOURS)
    assert max(alive) <= 2, alive


@pytest.mark.parametrize("suffix", VIDEO_SUFFIXES)
def test_a_film_without_its_end_is_not_kept(tmp_path, monkeypatch, suffix):
    """An encoder that the system ends, or that finds the disk full at the end, does not say so to imageio."""
    encode = video._encode

    def cut_off(given, path, fps):
        encode(given, path, fps)
        path.write_bytes(path.read_bytes()[:-5])

    (tmp_path / f"film{suffix}").write_bytes(b"the film before")
    monkeypatch.setattr(video, "_encode", cut_off)
    with pytest.raises(OSError, match=r"could not be written: the encoder stopped before its end"):
        write_film(frames(), tmp_path / f"film{suffix}", size=SIZE, fps=10.0)
    monkeypatch.setattr(video, "FULL_DISK", float("inf"))
    with pytest.raises(OSError, match=r"No space left on device"):
        write_film(frames(), tmp_path / f"film{suffix}", size=SIZE, fps=10.0)
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [b"the film before"]


@pytest.mark.parametrize("suffix", VIDEO_SUFFIXES)
def test_what_fails_while_drawing_leaves_no_half_film(tmp_path, suffix):
    def failing():
        yield from frames()
        raise ValueError("this frame cannot be drawn")

    with pytest.raises(ValueError, match="this frame cannot be drawn"):
        write_film(failing(), tmp_path / f"film{suffix}", size=SIZE, fps=10.0)
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written_is_told_before_anything_is_drawn(tmp_path):
    (tmp_path / "file").write_text("kept", encoding="utf-8")
    drawn = []
    with pytest.raises(OSError, match=r"film\.mp4' cannot be written \(.+\); choose another place for the film"):
        write_film(map(drawn.append, frames()), tmp_path / "file" / "film.mp4", size=SIZE, fps=10.0)
    assert not drawn
    assert [path.read_text(encoding="utf-8") for path in tmp_path.iterdir()] == ["kept"]


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_the_rate_is_constant(tmp_path, suffix):
    path = write_film(frames(), tmp_path / f"film{suffix}", size=SIZE, fps=10.0)
    told = subprocess.run(
        [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(path), "-vf", "showinfo", "-f", "null", "-"],
        capture_output=True, text=True, check=True,
    ).stderr  # fmt: skip
    times = [float(time) for time in re.findall(r"pts_time:([0-9.]+)", told)]
    np.testing.assert_allclose(times, np.arange(len(list(frames()))) / 10.0)
    assert "10 fps" in told


def test_frames_are_written_as_pictures_into_a_folder(tmp_path):
    folder = write_film(frames(), tmp_path / "frames", size=SIZE, fps=10.0)
    names = [f"frame_{k:05d}.png" for k in range(len(list(frames())))]
    assert sorted(path.name for path in folder.iterdir()) == names
    assert [path.name for path in tmp_path.iterdir()] == ["frames"]
    write_film(list(frames())[:2], folder, size=SIZE, fps=10.0)
    assert sorted(path.name for path in folder.iterdir()) == names[:2]
    with Image.open(folder / names[0]) as first:
        np.testing.assert_array_equal(np.asarray(first), np.asarray(next(iter(frames()))))
    (folder / "notes.txt").write_text("kept", encoding="utf-8")
    with pytest.raises(ValueError, match="holds what is no frame of a film"):
        write_film(frames(), folder, size=SIZE, fps=10.0)
    assert (folder / "notes.txt").read_text(encoding="utf-8") == "kept"
