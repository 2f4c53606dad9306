"""A process of its own, on another core: files for viewers while the first one solves, then fall, curve and film."""

from __future__ import annotations

import contextlib
import importlib
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import solver
from blockvis.dynamics.fall import Fall, fall_of
from blockvis.results.increments import StoredIncrements
from blockvis.results.reaction_range import stored_range
from blockvis.results.viewer_files import ViewerFiles, ViewerFormat
from blockvis.system.atomic_files import partial_of, remove
from blockvis.system.worker import Say, Worker, WorkerEnded, serve

from .video import find_encoder

#: Seconds that a process has to remove its half-written film.
PATIENCE = 5.0

#: What drawing needs, loaded by the process while the first one solves.
_LOADED = ("blockvis.pictures.render", "blockvis.pictures.curves")


class FilmFailed(RuntimeError):
    """The process that draws the film ended without it."""


class FilmProcess:
    """A process that loads what drawing needs, writes files for viewers meanwhile, and draws the film at the end.

    It ends where this process ends, however that happens. It is told which increments there are, and reads them from
    the results folder.
    """

    def __init__(self) -> None:
        self._path: Path | None = None
        self._worker = Worker("blockvis.pictures.film_process")

    def follow(self, folder: Path, assembly: solver.Assembly, vtu: ViewerFormat, count: int) -> None:
        """Write the files for viewers of a results folder in which those of the first ``count`` increments are."""
        self._worker.say("follow", (folder, assembly, vtu, count))

    def add(self, increment: solver.Increment) -> None:
        """Write the files for viewers of the next increment, whose state is in the folder; returns at once."""
        self._worker.say("add")

    def finish(self) -> bool:
        """Wait until the files for viewers are written; False if the process has ended before.

        Raises the ``OSError`` that kept it from writing.
        """
        self._worker.say("finish")
        try:
            self._hear("finished")
        except FilmFailed:
            return False
        return True

    def draw(self, response: solver.Response, path: Path, falls: bool, fall: Fall | None, look: dict[str, Any]) -> None:
        """Begin to draw the curve, where there is one, as ``curve.png`` beside the film, and the film; returns at once.

        Where it ``falls`` the process works out the fall, for which :meth:`fall` waits; underlay, view and section of
        the look are as of :func:`blockvis.animate`.
        """
        self._path = path
        self._worker.say("draw", (response, path, falls, fall, look))

    def fall(self, progress: Callable[[float, float], None]) -> Fall | None:
        """Wait for the fall, ``progress`` called as by :func:`fall_of`.

        Raises :class:`FilmFailed` if the process ends before.
        """
        while (heard := self._hear("falling", "fall"))[0] == "falling":
            progress(*heard[1])
        found: Fall | None = heard[1]
        return found

    def wait(self, progress: Callable[[int, int], None]) -> None:
        """Wait for curve and film, ``progress`` called with the pictures drawn and their number.

        Raises :class:`FilmFailed` if the process ends without having drawn, and what :func:`blockvis.animate` does.
        """
        try:
            while (heard := self._hear("drawing", "drawn"))[0] == "drawing":
                progress(*heard[1])
        finally:
            self.close()

    def close(self) -> None:
        """End the process, drawn or not."""
        if self._worker.close(PATIENCE) and self._path is not None:
            # Windows ends a process without asking it; it then leaves its half-written film.
            remove(partial_of(self._path))

    def _hear(self, *words: str) -> tuple[str, Any]:
        try:
            return self._worker.hear(*words)
        except WorkerEnded as ended:
            raise FilmFailed(
                f"the film was not drawn, its process ended with code {ended.code}; draw it by blockvis render"
            ) from None


def main() -> None:
    """Do what comes in; what there is to say goes out."""
    loading = threading.Thread(target=_load, daemon=True)
    loading.start()
    followed: list[_Followed] = []

    def answer(say: Say, word: str, about: Any) -> bool:
        if word == "follow":
            followed.append(_Followed(*about))
        elif word == "add":
            followed[-1].add()
        elif word == "finish":
            followed[-1].finish()
            say("finished", None)
        elif word == "draw":
            loading.join()
            find_encoder()
            _draw(say, *about)
        return word == "draw"

    serve(answer)


def _load() -> None:
    """Load what drawing needs; what fails fails again where it is used."""
    for module in _LOADED:
        with contextlib.suppress(Exception):
            importlib.import_module(module)
    with contextlib.suppress(Exception):
        find_encoder()


class _Followed:
    """A results folder whose files for viewers this process writes, from an increment on."""

    def __init__(self, folder: Path, assembly: solver.Assembly, vtu: ViewerFormat, count: int) -> None:
        self._stored, self._count = StoredIncrements(folder), count
        self._start = folder, assembly, vtu
        self._files: ViewerFiles | None = None
        self._failed: Exception | None = None

    def add(self) -> None:
        """Write the files of the next increment; what goes wrong is told at the end."""
        if self._failed is None:
            try:
                if self._files is None:
                    self._files = ViewerFiles(*self._start, [self._stored.opened(k) for k in range(self._count)])
                self._files.add(self._stored.opened(self._count))
            except Exception as error:  # noqa: BLE001 - it is the caller's, who raises it again
                self._failed = error
        self._count += 1

    def finish(self) -> None:
        """Raise what has kept it from writing, if anything has."""
        if self._failed is not None:
            raise self._failed


def _draw(
    say: Say, response: solver.Response, path: Path, falls: bool, fall: Fall | None, look: dict[str, Any]
) -> None:
    """Draw a film, its fall worked out here where it is asked for."""
    from .curves import draw_curve
    from .render import animate

    if falls:
        fall = fall_of(response, lambda *seconds: say("falling", seconds))
        say("fall", fall)
    if response.path:
        draw_curve(response, path.with_name("curve.png"), band=stored_range(path.parent))
    poster = path.with_name("poster.png")
    animate(response, path, fall=fall, poster=poster, progress=lambda *counts: say("drawing", counts), **look)
    say("drawn", None)
