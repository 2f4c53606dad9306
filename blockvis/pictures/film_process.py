"""A process of its own, on another core, that loads while the first one solves, then draws the film."""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import solver
from blockvis.dynamics.fall import Fall
from blockvis.system.atomic_files import partial_of, remove
from blockvis.system.worker import Say, Worker, WorkerEnded, serve

from .video import find_encoder

#: Seconds that a process has to remove its half-written film.
PATIENCE = 5.0


class FilmFailed(RuntimeError):
    """The process that draws the film ended without it."""


class FilmProcess:
    """A process that loads what drawing needs meanwhile, and draws the film at the end.

    It ends where this process ends, however that happens.
    """

    def __init__(self) -> None:
        self._path: Path | None = None
        self._worker = Worker("blockvis.pictures.film_process")

    def draw(self, response: solver.Response, path: Path, fall: Fall | None, look: dict[str, Any]) -> None:
        """Begin to draw the film, its poster beside it, with a look as of :func:`blockvis.animate`; returns at once."""
        self._path = path
        self._worker.say("draw", (response, path, fall, look))

    def wait(self, progress: Callable[[int, int], None]) -> None:
        """Wait for the film, ``progress`` called with the pictures drawn and their number.

        Raises :class:`FilmFailed` if the process ends without having drawn, and what :func:`blockvis.animate` does.
        """
        try:
            while (heard := self._worker.hear("drawing", "drawn"))[0] == "drawing":
                progress(*heard[1])
        except WorkerEnded as ended:
            raise FilmFailed(
                f"the film was not drawn, its process ended with code {ended.code}; draw it by blockvis render"
            ) from None
        finally:
            self.close()

    def close(self) -> None:
        """End the process, drawn or not."""
        if self._worker.close(PATIENCE) and self._path is not None:
            # Windows ends a process without asking it; it then leaves its half-written film.
            remove(partial_of(self._path))


def main() -> None:
    """Load what drawing needs while the first process solves, then draw the film that comes in."""
    # What fails fails again where it is used.
    with contextlib.suppress(Exception):
        importlib.import_module("blockvis.pictures.render")
        find_encoder()
    serve(_draw)


def _draw(say: Say, word: str, about: Any) -> bool:
    from .render import animate

    response, path, fall, look = about
    poster = path.with_name("poster.png")
    animate(response, path, fall=fall, poster=poster, progress=lambda *counts: say("drawing", counts), **look)
    say("drawn", None)
    return True
