"""Stills, the picture of the mechanism, and the animation: a Response in, a file out, off-screen."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from PIL import Image

import solver
from blockvis.dynamics.fall import Fall, fall_of
from blockvis.layout.sights import Cut, Sight, read_cut, read_sight
from blockvis.results.about import Result, collapse_phase, loss_of, response_of
from blockvis.results.increments import numbered
from blockvis.results.tables import change_words
from blockvis.system.atomic_files import atomic_file
from blockvis.text import beginning
from solver import mechanics

from .captions import MECHANISM_BADGE, in_one_unit, loss_words, parameter_unit, phase_words
from .drawer import Drawer, Look
from .film import film_of, poster_of
from .frame import FILM_SIZE, STILL_SIZE
from .swing import MOST_PARTS, shown_increments, swing_of
from .underlay import Underlay
from .video import FASTEST_GIF, write_film


def draw_still(
    response: Result,
    increment: int | solver.Increment,
    path: str | os.PathLike[str],
    *,
    size: tuple[int, int] | None = None,
    magnification: float = 1.0,
    colour_by: str = "material",
    forces: str = "auto",
    joints: bool = True,
    curve: bool = False,
    underlay: Underlay | None = None,
    view: str | Mapping[str, float] | Sight | None = None,
    section: str | Mapping[str, Any] | Cut | None = None,
) -> Path:
    """Draw one increment.

    Parameters
    ----------
    response : solver.Response, solver.LimitLoad or solver.Envelope
    increment : int or solver.Increment
        An increment of the response, or its number; -1 is the last, of what collapses a frame of its fall.
    path : path
        Any format Pillow writes; PNG is meant.
    size : (int, int), optional
        Width and height in pixels; by default as many as of 1920 × 1080, in the proportions of what is shown.
    magnification : float
        Of displacements and rotations; 1 is true scale.
    colour_by : {"material", "mechanism", "displacement"}
        By "mechanism" the parts of the collapse mechanism have the tints of :func:`draw_mechanism`.
    forces : {"auto", "thrust", "points", "none"}
        Resultant of each joint, forces at the contact points, or neither; "auto" draws resultants where the blocks
        are few enough to see them.
    joints : bool
        Mark open and sliding joints and hinges, and write the widths of the widest cracks [mm].
    curve : bool
        Put the reaction curve beside the blocks.
    underlay : Underlay, optional
        A photograph under blocks in the plane.
    view : str or mapping, optional
        From where blocks in space are seen: "above", "below", "both", "front", "back", "left", "right", "top",
        "bottom", or ``{"azimuth": 30, "elevation": 20}`` in degrees. By default where their motion is seen best, and of
        vaults and domes from below beside it.
    section : str or mapping, optional
        A plane that cuts blocks in space open: "x", "y = 1.2" [m], or ``{"point": (x, y, z), "normal": (x, y, z)}``.

    Raises
    ------
    ValueError
        For a number that no increment has, a view or a section of blocks in the plane, and a plane that misses the
        blocks.
    """
    response = to_show(response)
    chosen = increment if isinstance(increment, solver.Increment) else numbered(response.increments, increment)
    look = Look(magnification, colour_by, forces, joints, *seen_from(view, section))
    drawer = Drawer(response, look, size, (chosen,), curve=curve, underlay=underlay, still=True)
    return save_picture(drawer.picture(chosen, widths=True), path)


def seen_from(view: Any, section: Any) -> tuple[Sight | None, Cut | None]:
    """Read from where blocks in space are seen, and what cuts them open, both as of :func:`draw_still`."""
    found: list[Any] = []
    for name, value, read in (("view", view, read_sight), ("section", section, read_cut)):
        with beginning(name):
            found.append(None if value is None else read(value))
    return found[0], found[1]


def draw_mechanism(
    response: Result,
    path: str | os.PathLike[str],
    *,
    size: tuple[int, int] | None = None,
    underlay: Underlay | None = None,
    view: str | Mapping[str, float] | Sight | None = None,
    section: str | Mapping[str, Any] | Cut | None = None,
) -> Path:
    """Draw the last equilibrium, its hinges and sliding joints, and the motion that follows.

    Blocks are filled where they stand, those that move together alike; outlines and arrows show, out of scale,
    where the mechanism takes them. In space the blocks are drawn where it takes them, and lines where they stand.

    Parameters
    ----------
    response : solver.Response, solver.LimitLoad or solver.Envelope
    path, size, underlay, view, section
        As in :func:`draw_still`.
    """
    return save_picture(mechanism_picture(response, size, underlay=underlay, view=view, section=section), path)


def mechanism_picture(
    response: Result,
    size: tuple[int, int] | None = None,
    *,
    usual: tuple[int, int] = STILL_SIZE,
    underlay: Underlay | None = None,
    view: str | Mapping[str, float] | Sight | None = None,
    section: str | Mapping[str, Any] | Cut | None = None,
) -> Image.Image:
    """Make the picture of :func:`draw_mechanism`; without a size it has as many pixels as is ``usual``."""
    response = to_show(response)
    swing = swing_of(response)
    sight, cut = seen_from(view, section)
    look, extra = Look(forces="none", sight=sight, cut=cut), (swing.displaced,)
    drawer = Drawer(response, look, size, (swing.increment,), extra=extra, underlay=underlay, still=True, usual=usual)
    if swing.moves:
        drawer.show_motion(swing)
    note = "   ·   ".join([_mechanism_note(response, swing.n_parts), *phase_words(response, swing.increment)])
    moved_on = swing.moves and response.assembly.dimension == 3 and response.stop != solver.Status.SOLVER_FAILED
    badge = MECHANISM_BADGE if moved_on else None
    return drawer.picture(swing.increment, note=note, badge=badge, widths=True)


def animate(
    response: Result,
    path: str | os.PathLike[str],
    *,
    size: tuple[int, int] | None = None,
    fps: float = 25.0,
    seconds: float = 5.0,
    magnification: float = 1.0,
    colour_by: str = "mechanism",
    forces: str = "auto",
    joints: bool = True,
    curve: bool = False,
    fall: Fall | None = None,
    underlay: Underlay | None = None,
    progress: Callable[[int, int], None] | None = None,
    view: str | Mapping[str, float] | Sight | None = None,
    section: str | Mapping[str, Any] | Cut | None = None,
    poster: str | os.PathLike[str] | None = None,
) -> Path:
    """Write the settlement and the fall as a film.

    The settlement grows evenly over ``seconds``, each phase for one at least; the last equilibrium holds for a moment,
    then the fall follows in real time: rigid-body dynamics without restitution. With a magnification the mechanism is
    followed step by step instead, marked as pseudo-time.

    Parameters
    ----------
    response : solver.Response, solver.LimitLoad or solver.Envelope
    path : path
        Ending in .mp4, .gif or .webp; a name without an ending is a folder of pictures.
    size : (int, int), optional
        Width and height in pixels, both even; by default as many as of 1280 × 720, in the proportions of what is shown.
    fps : float
        Frames per second; a .gif has 50 at most.
    seconds : float [s]
        Length of the part in equilibrium; of more phases than that as many.
    magnification, colour_by, forces, joints, curve, underlay
        As in :func:`draw_still`.
    fall : Fall, optional
        Worked out already.
    progress : callable, optional
        Called with the frames drawn and their number.
    view, section
        As of :func:`draw_still`; a film has one view.
    poster : path, optional
        Of a picture that stands for the film where it does not play: the frame in which the fall is fastest.
    """
    response = to_show(response)
    look = Look(magnification, colour_by, forces, joints, *seen_from(view, section))
    if magnification != 1.0:
        fall = None
    elif fall is None:
        fall = fall_of(response)
    shown = shown_increments(response) if fall is None else response.path
    drawer = Drawer(response, look, size, shown, curve=curve, fall=fall, underlay=underlay, usual=FILM_SIZE)
    fps = min(fps, FASTEST_GIF) if Path(path).suffix.lower() == ".gif" else fps
    film = write_film(film_of(drawer, fps, seconds, progress), path, size=drawer.sheet.size, fps=fps)
    if poster is not None:
        save_picture(poster_of(drawer), poster)
    return film


def _mechanism_note(response: solver.Response, n: int) -> str:
    bodies = f"{mechanics.counted(n, 'moving part')}{', darker where faster' if n > MOST_PARTS else ''}"
    if response.collapse is None:
        if response.stop == solver.Status.NO_INITIAL_EQUILIBRIUM or (response.limits and not response.path):
            when = f"before any {response.parameter.name}" if response.measured.is_force else "under the dead load"
            return f"no equilibrium {when}   ·   {bodies}"
        if response.limits:
            friction = f"{response.limits[-1].flow} friction"
            acts = f"mechanism at the limit load   ·   {friction}   ·   {bodies}"
            return acts if n else f"no mechanism   ·   {friction}"
        gone = loss_words(response.path[-1]) if response.path else []
        follows = "in which blocks wedge" if response.stop == solver.Status.LOCKED else "that would follow"
        return "   ·   ".join([f"{response.stop}: the motion {follows}", bodies, *gone])
    loss = loss_of(response)
    what = "collapse mechanism" if loss is None or not loss.local else "local loss"
    falls = "" if loss is None else f"   ·   {100.0 * loss.share:.3g} % of the weight fall"
    return f"{what}   ·   {_collapse_place(response, response.collapse)}   ·   {bodies}{falls}"


def _collapse_place(response: solver.Response, collapse: solver.Collapse) -> str:
    """Say between which parameters a structure collapses; of what falls as a phase begins what changes there."""
    if collapse.reaction is None:
        return "   ·   ".join([*change_words(response, collapse_phase(response) or 0), "falls before anything moves"])
    factor, unit = parameter_unit(in_one_unit(response))
    low, high = (f"{factor * end:.{_digits(collapse.bracket)}g} {unit}" for end in collapse.bracket)
    return f"{collapse.lost} at {low}, none at {high}"


def _digits(bracket: tuple[float, float]) -> int:
    """So many digits tell the ends of a bracket apart."""
    return next((n for n in range(5, 9) if f"{bracket[0]:.{n}g}" != f"{bracket[1]:.{n}g}"), 9)


def to_show(result: Result) -> solver.Response:
    """Take a result as a response; raises ``ValueError`` for one without an increment, which nothing can show."""
    response = response_of(result)
    if not response.increments:
        raise ValueError(f"there is no increment to show: {response.message or response.stop}")
    return response


def save_picture(picture: Image.Image, path: str | os.PathLike[str]) -> Path:
    """Save a picture, whole or not at all; raises ``ValueError`` for an ending that Pillow does not write."""
    path = Path(path)
    if Image.registered_extensions().get(path.suffix.lower()) not in Image.SAVE:
        raise ValueError(f"'{path}' is no picture that blockvis draws; end its name in .png, or as Pillow writes")
    with atomic_file(path) as partial:
        picture.save(partial)
    return path
