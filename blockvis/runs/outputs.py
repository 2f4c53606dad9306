"""What a run makes beside its numbers: fall, pictures, report and film."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import solver
from blockvis.cases.contents import Case
from blockvis.dynamics.fall import NEVER_STOOD, STANDS, Fall, fall_of, may_fall, still_moving
from blockvis.kinds.kinds import KINDS
from blockvis.results.about import quantities_of
from blockvis.results.fall_files import stored_fall, write_fall
from blockvis.results.reaction_range import stored_range
from blockvis.results.record import case_text
from blockvis.results.viewer_files import ViewerFormat
from solver import mechanics

from .progress import DrawingProgress
from .step_check import stored_check

if TYPE_CHECKING:
    from blockvis.pictures.film_process import FilmProcess
    from blockvis.pictures.underlay import Underlay


class Clock:
    """Wall-clock seconds of each part of a run."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def counting(self, part: str) -> Iterator[None]:
        """Count the seconds of a block to a part."""
        started = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[part] = self.seconds.get(part, 0.0) + time.perf_counter() - started

    def each(self, part: str, increments: mechanics.Increments) -> Iterator[solver.Increment]:
        """Give each of the increments, and count the seconds it takes to find it to a part."""
        while True:
            with self.counting(part):
                increment = next(increments, None)
            if increment is None:
                return
            yield increment


class Drawing:
    """What a run makes beside its numbers: fall, pictures, report and film, which a process of its own draws.

    It is told of the run by :meth:`begin`, :meth:`finish` and :meth:`close`, in this order. The process has time until
    the case is solved: it loads what it needs meanwhile.
    """

    def __init__(self, *, film: bool = True, pictures: bool = True) -> None:
        self._film, self._pictures = film, pictures
        self._process: FilmProcess | None = None
        self._underlay: Underlay | None = None

    def _animation(self, case: Case) -> str | None:
        return case.animation if self._film and self._pictures else None

    def begin(self, case: Case) -> None:
        """Before the assembly is built, read the photograph under the pictures and start the process of the film."""
        self._underlay = _underlay(case) if self._pictures else None
        if self._animation(case) is not None:
            from blockvis.pictures.film_process import FilmProcess

            self._process = FilmProcess()

    def is_written(self, case: Case, folder: Path) -> bool:
        """Whether all that is drawn is there."""
        if not self._pictures:
            return True
        animation = self._animation(case)
        names = ["report.html", "mechanism.png", "curve.png", *([animation, "poster.png"] if animation else [])]
        # A limit load is of the layout, in which nothing is open.
        if KINDS[case.analysis].course(case).parameter.is_path:
            names.append("cracks.png")
        return all((folder / name).exists() for name in names)

    def _shown_underlay(self, case: Case, response: solver.Response) -> Underlay | None:
        """Find the photograph of a run; where there is none to be had, its pictures are drawn all the same."""
        try:
            underlay = self._underlay or _underlay(case)
        except ValueError as error:
            warnings.warn(f"{error}; drawn without", stacklevel=2)
            return None
        if underlay is not None and response.assembly.dimension == 3:
            warnings.warn(f"{case.source}: [output] underlay: blocks in space are drawn without", stacklevel=2)
        return underlay

    def close(self) -> None:
        """End the process, whatever has ended the run."""
        if self._process is not None:
            self._process.close()

    def finish(self, case: Case, response: solver.Response, folder: Path, clock: Clock) -> tuple[str, ...]:
        """Write fall, pictures, report and film of a results folder; returns what could not be made, and why."""
        if not response.increments:
            return ()
        underlay = self._shown_underlay(case, response) if self._pictures else None
        eye = seen_from(case, response) if self._pictures else {}
        with clock.counting("fall"):
            fall = stored_fall(folder)
            if fall is None and (fall := _fall(response)) is not None:
                write_fall(fall, response, folder, viewer_format(case))
        if not self._pictures:
            return ()
        animation, apart = self._animation(case), self._process
        if apart is not None:
            # What needs no film is drawn here meanwhile.
            apart.draw(response, folder / str(animation), fall, {"underlay": underlay, **eye})
        with clock.counting("mechanism"):
            from blockvis.pictures.render import draw_mechanism

            draw_mechanism(response, folder / "mechanism.png", underlay=underlay, **eye)
            if response.parameter.is_path:
                from blockvis.pictures.crack_drawing import draw_cracks

                draw_cracks(response, -1, folder / "cracks.png", **eye)
        with clock.counting("report"):
            write_report_of(response, folder, fall)
        if response.path:
            with clock.counting("curve"):
                draw_curves(response, folder, ["curve.png"])
        if apart is not None:
            return _awaited(apart, clock)
        if animation is not None:
            with clock.counting("film"), DrawingProgress() as progress:
                from blockvis.pictures.render import animate

                look: dict[str, Any] = {"underlay": underlay, "poster": folder / "poster.png", **eye}
                animate(response, folder / animation, fall=fall, progress=progress.frame, **look)
        return ()


def draw_curves(response: solver.Response, folder: Path, names: Sequence[str]) -> None:
    """Draw the curve of a results folder, with what is known of its range."""
    from blockvis.pictures.curves import draw_curve

    for name in names:
        draw_curve(response, folder / name, band=stored_range(folder))


def write_report_of(response: solver.Response, folder: Path, fall: Fall | None) -> None:
    """Write the report of a results folder, with what is known of its error and range."""
    from blockvis.report.page import write_report

    error, band = str(stored_check(folder) or ""), stored_range(folder)
    write_report(response, folder / "report.html", case_text(folder), fall=fall, error=error, band=band)


def viewer_format(case: Case) -> ViewerFormat:
    """Say how a case has its VTU files written."""
    return ViewerFormat(case.vtu, case.vtu_strings, quantities_of(KINDS[case.analysis].course(case)))


def _underlay(case: Case) -> Underlay | None:
    """Read the photograph under the pictures of a case, if it names one."""
    if case.underlay is None:
        return None
    from .underlay import underlay_of

    return underlay_of(case)


def seen_from(case: Case, response: solver.Response) -> dict[str, Any]:
    """Say from where the pictures of a case are drawn, as :func:`blockvis.draw_still` takes view and section.

    They are drawn all the same where that makes no sense.
    """
    from blockvis.pictures.solid_view import plane_of

    asked = {"view": case.sight, "section": case.cut}
    if response.assembly.dimension == 2:
        for key in (key for key, value in asked.items() if value is not None):
            warnings.warn(f"{case.source}: [output] {key}: blocks in the plane are drawn as they lie", stacklevel=2)
        return {}
    try:
        plane_of(response.assembly, case.cut)
    except ValueError as error:
        warnings.warn(f"{case.source}: [output] {error}; drawn whole", stacklevel=2)
        asked["section"] = None
    return asked


def _awaited(film: FilmProcess, clock: Clock) -> tuple[str, ...]:
    """Wait for the process that draws the film; returns why it has ended without it, or nothing."""
    from blockvis.pictures.film_process import FilmFailed

    try:
        with clock.counting("film"), DrawingProgress() as progress:
            film.wait(progress.frame)
    except FilmFailed as error:
        return (str(error),)
    return ()


def _fall(response: solver.Response) -> Fall | None:
    """Work out a fall; say so where a collapse has none, where it is cut off, or leaves out what holds together."""
    with DrawingProgress() as progress:
        fall = fall_of(response, progress.fall)
    if fall is None and may_fall(response):
        warnings.warn(f"{STANDS}: no fall is shown", stacklevel=2)
    if response.collapse is not None and not response.path:
        warnings.warn(NEVER_STOOD, stacklevel=2)
    if fall is not None and len(moving := still_moving(response.assembly, fall)):
        end = f"{response.assembly.listed(moving, 4)} still move{'s' if len(moving) == 1 else ''}"
        warnings.warn(f"the fall is followed for {fall.times[-1]:g} s, at whose end {end}", stacklevel=2)
    if fall is not None and (response.path[-1].state.intact > 0.0).any():
        said = "the fall leaves mortar out: blocks whose joints are whole at the last equilibrium come apart in it"
        warnings.warn(said, stacklevel=2)
    return fall
