"""The film of a response: which pictures it has, for how many frames each stands, and the order they are drawn in."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain
from typing import TypeAlias

import numpy as np
from PIL import Image

import solver
from solver import mechanics

from .captions import matters
from .drawer import Drawer

#: Seconds for which the last equilibrium and the end of the film are held.
PAUSE, END = 0.6, 0.8

#: Nothing moves from one frame to the next where no corner moves by more than this [pixels].
STILL = 0.3

Draw: TypeAlias = Callable[[], Image.Image]


def film_of(
    drawer: Drawer, fps: float, seconds: float, progress: Callable[[int, int], None] | None = None
) -> tuple[list[int], Iterator[Image.Image]]:
    """Plan a film: even motion along the path, a pause, then the fall.

    A picture is drawn where something has moved since the last, and stands till then.

    Parameters
    ----------
    drawer : Drawer
    fps : float
        Frames per second.
    seconds : float [s]
        Of the path.
    progress : callable, optional
        Called with the pictures drawn and their number.

    Returns
    -------
    holds : list of int
        For how many frames each picture stands.
    pictures : iterator of PIL.Image.Image
        Drawn as they are asked for.
    """
    path = [increment for increment in drawer.increments if matters(increment, drawer.response)]
    lasting = max(2, round(fps * seconds))
    distinct = _distinct(drawer, path, lasting) if path else 0
    falling = _falling(drawer, fps)
    holds = [int(n) for n in np.diff(np.linspace(0, lasting, distinct + 1).round())]
    if holds:
        holds[-1] += round(PAUSE * fps)
    holds += [hold for _, hold in falling]
    holds[-1] += round(END * fps)

    def pictures() -> Iterator[Image.Image]:
        along: Iterator[Draw] = (partial(drawer.picture, *place) for place in _places(drawer.response, path, distinct))
        for number, draw in enumerate(chain(along, (draw for draw, _ in falling)), start=1):
            picture = draw()
            if progress is not None:
                progress(number, len(holds))
            yield picture

    return holds, pictures()


def _distinct(drawer: Drawer, path: list[solver.Increment], most: int) -> int:
    """How many pictures of the path differ: one for each pixel of the way of the block that goes farthest."""
    if len(path) == 1 or mechanics.path_parameters(path)[-1] <= mechanics.path_parameters(path)[0]:
        return 1
    way, before = 0.0, None
    for increment in path:
        corners = mechanics.moved_vertices(drawer.assembly, increment.pose)
        if before is not None:
            way += float(np.linalg.norm(corners - before, axis=1).max())
        before = corners
    pixels = way * drawer.look.magnification / drawer.scene.pixel
    return int(np.clip(np.ceil(pixels), min(len(path), most), most))


def _falling(drawer: Drawer, fps: float) -> list[tuple[Draw, int]]:
    """List what draws each picture of the fall, and for how many frames it stands: till something moves again."""
    draws: list[Draw] = []
    poses: Iterator[solver.Pose]
    fall = drawer.fall
    if fall is not None:
        times = [float(k / fps) for k in range(1, int(np.ceil(fall.times[-1] * fps)) + 1)]
        draws += [partial(drawer.falling_picture, time) for time in times]
        poses = (fall.at(time) for time in times)
    else:
        pseudo = [increment for increment in drawer.increments if increment.status == solver.Status.FALLING]
        draws += [partial(drawer.picture, increment) for increment in pseudo]
        poses = (increment.pose for increment in pseudo)
    shown: list[tuple[Draw, int]] = []
    drawn = None
    for draw, pose in zip(draws, poses, strict=True):
        corners = mechanics.moved_vertices(drawer.assembly, pose)
        if drawn is not None and np.abs(corners - drawn).max() <= STILL * drawer.scene.pixel:
            shown[-1] = shown[-1][0], shown[-1][1] + 1
            continue
        shown.append((draw, 1))
        drawn = corners
    if shown:
        # Rest at the end is held as long as any end.
        shown[-1] = shown[-1][0], 1
    return shown


def _places(
    response: solver.Response, path: list[solver.Increment], n: int
) -> Iterator[tuple[solver.Increment, solver.Pose | None, float | None]]:
    """``n`` frames along the path; of states that stand by themselves, some of them: between two there is nothing."""
    if response.parameter.is_path:
        return _even_motion(path, n)
    return ((path[k], None, None) for k in np.linspace(0, len(path) - 1, n).round().astype(int))


def _even_motion(
    path: list[solver.Increment], n: int
) -> Iterator[tuple[solver.Increment, solver.Pose | None, float | None]]:
    """``n`` frames at even steps of the parameter: the increment before each, its pose, and its parameter."""
    if not path:
        return
    total = mechanics.path_parameters(path)
    if total[-1] <= total[0]:
        yield path[-1], None, None
        return
    for at in np.linspace(total[0], total[-1], n) if n > 1 else total[-1:]:
        k = int(np.clip(np.searchsorted(total, at, side="right") - 1, 0, len(path) - 1))
        if k == len(path) - 1 or at <= total[k]:
            yield path[k], None, None
            continue
        t = (at - total[k]) / (total[k + 1] - total[k])
        a, b = path[k].pose, path[k + 1].pose
        pose = solver.Pose(a.positions + t * (b.positions - a.positions), a.rotations + t * (b.rotations - a.rotations))
        start = path[k].parameter if path[k].phase == path[k + 1].phase else 0.0
        yield path[k], pose, start + t * (path[k + 1].parameter - start)
