"""A process of its own, on another core: files for viewers while the first one solves, then fall, curve and film."""

from __future__ import annotations

import contextlib
import importlib
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import solver
from blockvis.dynamics.fall import Fall, fall_of
from blockvis.results.increments import StoredIncrements
from blockvis.results.viewer_files import ViewerFiles
from blockvis.system.atomic_files import partial_of, remove
from blockvis.system.processes import interpreter, is_broken_pipe, unread

from .video import find_encoder

#: Seconds that a process has to remove its half-written film.
PATIENCE = 5.0

#: Seconds between looks for Ctrl-C while waiting: Windows sees it between two waits only.
LOOK = 0.2

#: What drawing needs, loaded by the process while the first one solves.
_LOADED = ("blockvis.pictures.render", "blockvis.pictures.curves", "pymunk")


class FilmFailed(RuntimeError):
    """The process that draws the film ended without it."""


class FilmProcess:
    """A process that loads what drawing needs, writes files for viewers meanwhile, and draws the film at the end.

    Notes
    -----
    It ends where this process ends, however that happens. It is told which increments there
    are, and reads them from the results folder.
    """

    def __init__(self) -> None:
        self._path: Path | None = None
        self._process = interpreter("blockvis.pictures.film_process")
        self._said: queue.SimpleQueue[tuple[str, Any]] = queue.SimpleQueue()
        # What it says is read at once: it never waits for this process.
        threading.Thread(target=self._listen, daemon=True).start()

    def follow(self, folder: Path, assembly: solver.Assembly, shape: str, count: int) -> None:
        """Write the files for viewers of a results folder, from an increment on.

        Parameters
        ----------
        folder : Path
        assembly : solver.Assembly
        shape : {"moved", "undeformed"}
            As of :class:`blockvis.results.viewer_files.ViewerFiles`.
        count : int
            Increments whose files are there already.
        """
        self._say("follow", (folder, assembly, shape, count))

    def add(self, increment: solver.Increment) -> None:
        """Write the files for viewers of the next increment, whose state is in the folder; returns at once.

        Parameters
        ----------
        increment : solver.Increment
        """
        self._say("add", None)

    def finish(self) -> bool:
        """Wait until the files for viewers are written; False if the process has ended before.

        Raises
        ------
        OSError
            That kept it from writing.
        """
        self._say("finish", None)
        try:
            self._hear("finished", {})
        except FilmFailed:
            return False
        return True

    def draw(self, response: solver.Response, path: Path, fall: Fall | None = None, *, falls: bool = False) -> None:
        """Begin to draw the curve, where there is one, as ``curve.png`` beside the film, and the film; returns at once.

        Parameters
        ----------
        response : solver.Response
        path : Path
        fall : Fall, optional
        falls : bool
            Whether the process works out the fall; :meth:`fall` waits for it.
        """
        self._path = path
        self._say("draw", (response, path, fall, falls))

    def fall(self, progress: Callable[[float], None]) -> Fall | None:
        """Wait for the fall.

        Parameters
        ----------
        progress : callable
            Called with the seconds of the fall that are worked out.

        Raises
        ------
        FilmFailed
            If the process ends before.
        """
        found: Fall | None = self._hear("fall", {"falling": progress})
        return found

    def wait(self, progress: Callable[[int, int], None]) -> None:
        """Wait for curve and film.

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
        try:
            self._hear("drawn", {"drawing": lambda counts: progress(*counts)})
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
        assert self._process.stdin is not None
        with unread():
            self._process.stdin.close()

    def _say(self, what: str, about: Any) -> None:
        assert self._process.stdin is not None
        # A process that has ended says why where it is waited for.
        with unread():
            if not self._process.stdin.closed:
                pickle.dump((what, about), self._process.stdin)
                self._process.stdin.flush()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as out, contextlib.suppress(EOFError, OSError, pickle.UnpicklingError):
            while True:
                self._said.put(pickle.load(out))
        self._said.put(("ended", None))

    def _hear(self, wanted: str, others: dict[str, Callable[[Any], None]]) -> Any:
        """Wait for an answer; what comes before it is handed to those who asked for it, or is of no interest."""
        while True:
            try:
                what, about = self._said.get(timeout=LOOK)
            except queue.Empty:
                continue
            if what == wanted:
                return about
            if what == "failed":
                raise about
            if what == "ended":
                # Whoever waits next hears it, too.
                self._said.put((what, about))
                code = self._process.wait()
                raise FilmFailed(
                    f"the film was not drawn, its process ended with code {code}; draw it by blockvis render"
                )
            if what in others:
                others[what](about)


def main() -> None:
    """Do what comes in; what there is to say goes out."""
    # Where it was not started deaf, as on Windows.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    out, sys.stdout = sys.stdout.buffer, sys.stderr

    def say(what: str, about: Any = None) -> None:
        pickle.dump((what, about), out)
        out.flush()

    loading = threading.Thread(target=_load, daemon=True)
    loading.start()
    # Nobody listens where the first process has ended: the next word ends this one, and no half film stays.
    with unread():
        while True:
            try:
                what, about = pickle.load(sys.stdin.buffer)
            except EOFError:
                return
            if what == "follow":
                viewer = _Followed(*about)
            elif what == "add":
                viewer.add()
            elif what == "finish":
                say(*viewer.finished())
            elif what == "draw":
                loading.join()
                find_encoder()
                say(*_drawn(say, *about))
                # The film is whole: taking this interpreter down piece by piece would only keep the first one waiting.
                os._exit(0)


def _load() -> None:
    """Load what drawing needs; what fails fails again where it is used."""
    for module in _LOADED:
        with contextlib.suppress(Exception):
            importlib.import_module(module)
    with contextlib.suppress(Exception):
        find_encoder()


class _Followed:
    """A results folder whose files for viewers this process writes.

    Parameters
    ----------
    folder, assembly, shape, count
        As of :meth:`FilmProcess.follow`.
    """

    def __init__(self, folder: Path, assembly: solver.Assembly, shape: str, count: int) -> None:
        self._stored, self._count = StoredIncrements(folder), count
        self._start = folder, assembly, shape
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

    def finished(self) -> tuple[str, Exception | None]:
        """Tell that all is written, or why not."""
        return ("finished", None) if self._failed is None else ("failed", self._failed)


def _drawn(
    say: Callable[[str, Any], None], response: solver.Response, path: Path, fall: Fall | None, falls: bool
) -> tuple[str, Exception | None]:
    """Draw a film, its fall worked out here where it is asked for; tells what came of it."""
    from .curves import draw_curve
    from .render import animate

    try:
        if falls:
            fall = fall_of(response, lambda seconds: say("falling", seconds))
            say("fall", fall)
        if response.path:
            draw_curve(response, path.with_name("curve.png"))
        animate(response, path, fall=fall, progress=lambda done, total: say("drawing", (done, total)))
    except Exception as error:
        if isinstance(error, OSError) and is_broken_pipe(error):
            raise
        return "failed", error
    return "drawn", None
