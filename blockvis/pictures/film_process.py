"""A film drawn and encoded by a process of its own, on another core, while the first solves and writes."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import solver
from blockvis.atomic_files import partial_of, remove
from blockvis.broken_pipes import is_broken_pipe
from blockvis.fall import Fall

#: Seconds that a process has to remove its half-written film.
PATIENCE = 5.0


class FilmFailed(RuntimeError):
    """The process that draws the film ended without it."""


class FilmProcess:
    """A process that loads what drawing needs, waits for a response, and draws its film.

    Notes
    -----
    It is a fresh interpreter, not a fork: a fork would share the solver's threads, and ``multiprocessing`` would run
    the caller's script again. It ends where this process ends, however that happens.
    """

    def __init__(self) -> None:
        start = f"import sys; sys.path[:] = {sys.path!r}; from blockvis.pictures.film_process import main; main()"
        self._path: Path | None = None
        self._process = subprocess.Popen([sys.executable, "-c", start], stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def draw(self, response: solver.Response, path: Path, fall: Fall | None) -> None:
        """Begin to draw; returns at once.

        Parameters
        ----------
        response : solver.Response
        path : Path
        fall : Fall, optional
        """
        assert self._process.stdin is not None
        # A process that has ended says why in :meth:`wait`.
        self._path = path
        with _unread():
            pickle.dump((response, path, fall), self._process.stdin)
            self._process.stdin.flush()

    def wait(self, progress: Callable[[int, int], None]) -> None:
        """Wait for the film.

        Parameters
        ----------
        progress : callable
            Called with the pictures drawn and their number.

        Raises
        ------
        FilmFailed
            If the process ends without having drawn.
        Exception
            As in :func:`blockvis.animate`.
        """
        assert self._process.stdout is not None
        try:
            while True:
                told = pickle.load(self._process.stdout)
                if told is None:
                    self._process.wait()
                    return
                if isinstance(told, BaseException):
                    raise told
                progress(*told)
        except EOFError:
            code = self._process.wait()
            raise FilmFailed(
                f"the film was not drawn, its process ended with code {code}; draw it by blockvis render"
            ) from None
        finally:
            self.close()

    def close(self) -> None:
        """End the process, drawn or not."""
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            if self._path is not None:
                # Windows ends a process without asking it; it then leaves its half-written film.
                remove(partial_of(self._path))
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with _unread():
                    pipe.close()


@contextlib.contextmanager
def _unread() -> Iterator[None]:
    """Go on where the other process reads no more."""
    try:
        yield
    except OSError as error:
        if not is_broken_pipe(error):
            raise


def main() -> None:
    """Draw the film of the response that comes in; what there is to say goes out."""
    # Ctrl-C reaches all processes of a terminal: the first decides, and ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    out, sys.stdout = sys.stdout.buffer, sys.stderr
    from . import render
    from .video import find_encoder

    find_encoder()
    try:
        response, path, fall = pickle.load(sys.stdin.buffer)
    except EOFError:
        return

    def say(what: Any) -> None:
        pickle.dump(what, out)
        out.flush()

    # Nobody listens where the first process has ended: the next word ends this one, and no half film stays.
    try:
        render.animate(response, path, fall=fall, progress=lambda done, total: say((done, total)))
    except Exception as error:  # noqa: BLE001 - it is the caller's, who raises it again
        if isinstance(error, OSError) and is_broken_pipe(error):
            return
        say(error)
        return
    say(None)
    # The film is whole: taking this interpreter down piece by piece would only keep the first one waiting.
    os._exit(0)
