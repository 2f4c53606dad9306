"""A process of our own beside this one: messages go to it and come back, each a word and what it is about.

A module that works so has a function ``main`` that calls :func:`serve`; :class:`Worker` starts it.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from .processes import is_broken_pipe

#: Seconds between looks for Ctrl-C while waiting: Windows sees it between two waits only.
LOOK = 0.2

#: Says a word and what it is about.
Say = Callable[[str, Any], None]


class WorkerEnded(RuntimeError):
    """A worker ended before it gave its answer: its code, and what it wrote to its standard error if that was kept."""

    def __init__(self, code: int, errors: str) -> None:
        super().__init__(f"the process ended with code {code}")
        self.code, self.errors = code, errors


class Worker:
    """A fresh interpreter that serves a module.

    Its standard error is kept for :class:`WorkerEnded` if ``errors``; it is that of this process by default.

    Not a fork: that would share the solver's threads, and ``multiprocessing`` would run the caller's script again.
    """

    def __init__(self, module: str, *, errors: bool = False) -> None:
        start = f"import sys; sys.path[:] = {sys.path!r}; from {module} import main; main()"
        self._errors = tempfile.TemporaryFile() if errors else None  # noqa: SIM115
        with _deaf():
            self._process = subprocess.Popen(
                [sys.executable, "-c", start], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors
            )
        self._heard: queue.SimpleQueue[tuple[str, Any]] = queue.SimpleQueue()
        # What it says is read at once: it never waits for this process.
        threading.Thread(target=self._listen, daemon=True).start()

    def say(self, word: str, about: Any = None) -> None:
        """Say something to it; one that has ended says why where it is waited for."""
        assert self._process.stdin is not None
        with unread():
            if not self._process.stdin.closed:
                pickle.dump((word, about), self._process.stdin)
                self._process.stdin.flush()

    def hear(self, *words: str, seconds: float | None = None) -> tuple[str, Any]:
        """Wait for one of these words; others are of no interest. What the worker has raised is raised here.

        Raises ``WorkerEnded`` where it ends before, and ``TimeoutError`` where it takes longer than so many seconds.
        """
        until = None if seconds is None else time.monotonic() + seconds
        while True:
            wait = LOOK if until is None else min(LOOK, max(until - time.monotonic(), 1e-3))
            try:
                word, about = self._heard.get(timeout=wait)
            except queue.Empty:
                if until is not None and time.monotonic() >= until:
                    raise TimeoutError from None
                continue
            if word in words:
                return word, about
            if word == "failed":
                raise about
            if word == "ended":
                # Whoever waits next hears it, too.
                self._heard.put((word, about))
                raise WorkerEnded(self._process.wait(), self._error_output())

    def close(self, patience: float = 0.0) -> bool:
        """End it, after so many seconds in which it may tidy up; returns whether it was still at work."""
        assert self._process.stdin is not None
        at_work = self._process.poll() is None
        if at_work:
            with contextlib.suppress(subprocess.TimeoutExpired):
                if patience:
                    self._process.terminate()
                    self._process.wait(patience)
            self._process.kill()
            self._process.wait()
        with unread():
            self._process.stdin.close()
        if self._errors is not None:
            self._errors.close()
        return at_work

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as out, contextlib.suppress(Exception):
            while True:
                self._heard.put(pickle.load(out))
        self._heard.put(("ended", None))

    def _error_output(self) -> str:
        if self._errors is None:
            return ""
        self._errors.seek(0)
        return self._errors.read().decode("utf-8", errors="replace")


def serve(answer: Callable[[Say, str, Any], bool | None]) -> None:
    """Answer in a worker what comes in, until ``answer`` returns True or nobody listens any more.

    It is called with what says something to the caller, and with the word and what it is about that came in. What it
    raises is raised where the caller waits.
    """
    # Where it was not started deaf, as on Windows.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    # What libraries print is no message.
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)

    def say(word: str, about: Any = None) -> None:
        pickle.dump((word, about), out)
        out.flush()

    # The next word ends a worker whose caller has ended.
    with unread():
        while True:
            try:
                word, about = pickle.load(sys.stdin.buffer)
            except EOFError:
                return
            try:
                done = answer(say, word, about)
            except Exception as error:
                if isinstance(error, OSError) and is_broken_pipe(error):
                    raise
                say("failed", error)
                continue
            if done:
                # All is said: taking this interpreter down piece by piece would only keep the caller waiting.
                os._exit(0)


def end_with_caller() -> None:
    """End this worker, to which nothing more is said, where its caller ends, whatever it is at."""
    threading.Thread(target=lambda: (sys.stdin.buffer.read(), os._exit(0)), daemon=True).start()


@contextlib.contextmanager
def _deaf() -> Iterator[None]:
    """Start processes that do not hear Ctrl-C, which reaches all of a terminal: the first decides, and ends them."""
    if threading.current_thread() is not threading.main_thread():
        # Signals are set by the main thread alone.
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        # None where a program around Python has set what happens.
        signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)


@contextlib.contextmanager
def unread() -> Iterator[None]:
    """Go on where the other process reads no more."""
    try:
        yield
    except OSError as error:
        if not is_broken_pipe(error):
            raise
