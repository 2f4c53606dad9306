"""The film of a response: a constant rate, each frame a state of its own while anything moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeAlias

import numpy as np
from PIL import Image

import solver
from blockvis.results.joint_faces import carried_between
from solver import mechanics

from .captions import matters
from .drawer import Drawer

#: Seconds for which the last equilibrium and the end of the film are held, and those for which a loss is told, or a
#: phase at least takes; seconds of a path where nobody says how long it is played.
PAUSE, END, TOLD, PATH_SECONDS = 0.5, 0.8, 1.0, 6.0

#: Nothing moves from one frame of a fall to the next where no corner moves by more than this [pixels].
STILL = 0.3

Draw: TypeAlias = Callable[[], Image.Image]


def film_of(
    drawer: Drawer, fps: float, seconds: float, progress: Callable[[int, int], None] | None = None
) -> Iterator[Image.Image]:
    """Plan a film: even motion along each phase of the path, in so many seconds, a pause, then the fall.

    Gives its frames, drawn as they are asked for; what stands still is drawn once. ``progress`` is called with the
    frames drawn and their number.
    """
    for name, value in (("fps", fps), ("seconds", seconds)):
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} is {value:g}; it must be a positive number")
    path = [increment for increment in drawer.increments if matters(increment, drawer.response)]
    pause = max(1, round(PAUSE * fps))
    along = _along(drawer, path, max(2, round(fps * seconds)), pause, round(TOLD * fps))
    falling = _falling(drawer, fps)
    draws = [*along, *along[-1:] * (pause if falling else 0), *falling]
    draws += draws[-1:] * round(END * fps)

    def frames() -> Iterator[Image.Image]:
        before, picture = None, None
        for number, draw in enumerate(draws, start=1):
            if picture is None or draw is not before:
                picture, before = draw(), draw
            if progress is not None:
                progress(number, len(draws))
            yield picture

    return frames()


def poster_of(drawer: Drawer) -> Image.Image:
    """Draw the one frame that stands for a film: where the fall is fastest, or a mechanism farthest out, or the end."""
    fall, last = drawer.fall, drawer.increments[-1]
    if fall is not None and len(fall) > 1:
        speeds = np.linalg.norm(np.diff(fall.positions, axis=0), axis=2) / np.diff(fall.times)[:, None]
        fastest = int((speeds**2 @ drawer.assembly.masses).argmax())
        return drawer.falling_picture(float(fall.times[fastest + 1]))
    governing = drawer.response.governing
    # Of states that stand by themselves the lowest is the answer.
    return drawer.picture(last if last.status == solver.Status.FALLING or governing is None else governing)


def state_at(path: Sequence[solver.Increment], total: np.ndarray, at: float) -> solver.Increment:
    """Find what is shown at a parameter over all phases [m or rad]: between two increments all changes evenly.

    The parameters (n,) over all phases of the path are ``total``.
    """
    k = int(np.clip(np.searchsorted(total, at, side="right") - 1, 0, len(path) - 1))
    if k == len(path) - 1 or at <= total[k]:
        return path[k]
    return _between(path[k], path[k + 1], float((at - total[k]) / (total[k + 1] - total[k])))


def _between(before: solver.Increment, after: solver.Increment, part: float) -> solver.Increment:
    """Make the state at a part of the way from one increment to the next: numbers, blocks and forces go evenly.

    Which joints slide and hinge is that of the one before.
    """
    a, b = before.pose, after.pose
    pose = solver.Pose(
        a.positions + part * (b.positions - a.positions), a.rotations + part * (b.rotations - a.rotations)
    )
    start = before.parameter if before.phase == after.phase else 0.0
    numbers = {
        name: getattr(before, name) + part * (getattr(after, name) - getattr(before, name))
        for name in ("measured", "reaction", "load_multiplier")
    }
    parameter = start + part * (after.parameter - start)
    state = replace(before, parameter=parameter, phase=after.phase, checkpoint=None, **numbers)
    return _with_forces_between(state, before, after, part, pose)


def _with_forces_between(
    state: solver.Increment, before: solver.Increment, after: solver.Increment, part: float, pose: solver.Pose
) -> solver.Increment:
    """Put blocks to a pose between two increments, and the forces of both on them, each by its part."""
    early, late = (
        replace(c, points=carried_between(c.points, c.block_a, c.block_b, one.pose, pose))
        for c, one in ((before.contacts, before), (after.contacts, after))
    )
    number, known = mechanics.matched_contacts(late, early)
    forces, new = (1.0 - part) * before.forces, part * after.forces
    np.add.at(forces, number[known], new[known])
    more = np.flatnonzero(~known & (after.forces[:, 0] > 0.0))
    # Points that touch later carry their part of the force, and no joint hinges or slides by them.
    added = replace(late[more], gaps=np.full(len(more), np.inf))
    friction = np.concatenate([before.friction, after.friction[more]])
    state = state.with_arrays(
        pose=pose,
        contacts=mechanics.joined_contacts([early, added]),
        forces=np.concatenate([forces, new[more]]),
        friction=friction,
        ties=_ties_between(before.ties, after.ties, part),
        **{
            name: np.append(of, np.zeros(len(more), dtype=of.dtype))
            for name, of in vars(before.state).items()
            if name in ("intact", "bonded", "unloaded", "crushing") and len(of)
        },
    )
    rates = mechanics.with_motion(state, before.velocity).displacements[len(early) :]
    return state.with_arrays(displacements=np.concatenate([before.displacements, rates]))


def _ties_between(before: mechanics.TieForces, after: mechanics.TieForces, part: float) -> mechanics.TieForces:
    """Make what members do between two increments; those that break or are put in are what they were before."""
    if len(before.states) != len(after.states):
        return before
    gone = (mechanics.ABSENT, mechanics.BROKEN)
    stay = ~(np.isin(before.states, gone) | np.isin(after.states, gone))
    forces, elongations = (
        np.where(stay, a + part * (b - a), a)
        for a, b in ((before.forces, after.forces), (before.elongations, after.elongations))
    )
    states = np.where(stay & (before.states != after.states), mechanics.ELASTIC, before.states)
    return replace(before, forces=forces, elongations=elongations, states=states)


def _along(drawer: Drawer, path: list[solver.Increment], n: int, pause: int, told: int) -> list[Draw]:
    """List what draws ``n`` states at even steps of the parameter; losses and phases are ``told`` for so many.

    States that stand by themselves stand equally long, for no more than a pause.
    """
    if not path:
        return []
    total = mechanics.path_parameters(path)
    if not drawer.response.parameter.is_path or total[-1] <= total[0]:
        draws: list[Draw] = [partial(drawer.picture, increment) for increment in path]
        each = int(np.clip(round(n / len(path)), 1, pause))
        return [draw for draw in draws for _ in range(each)]
    places = _places(path, total, n, min(max(2, told), n))
    return [
        partial(_drawn_at, drawer, path, total, float(at), words)
        for at, words in zip(places, _losses_told(drawer.response, path, total, places, told), strict=True)
    ]


def _places(path: Sequence[solver.Increment], total: np.ndarray, n: int, least: int) -> np.ndarray:
    """(m,) array: parameters over all phases [m or rad] of ``n`` frames, more where a phase has fewer than ``least``.

    Those of a path (n_increments,) are ``total``. A phase that is short beside the others would flash by.
    """
    ends = total[[k for k, one in enumerate(path) if one is path[-1] or path[k + 1].phase != one.phase]]
    lengths = np.diff(ends, prepend=total[0])
    spare = max(n - len(ends) * least, 0)
    frames = np.cumsum(least + spare * lengths / lengths.sum()).round()
    return np.interp(np.arange(frames[-1]), [0.0, *(frames - 1.0)], [total[0], *ends])


def _drawn_at(
    drawer: Drawer, path: Sequence[solver.Increment], total: np.ndarray, at: float, badge: str | None
) -> Image.Image:
    # Worked out when it is drawn: increments may read their arrays from files, and a film holds none of them.
    return drawer.picture(state_at(path, total, at), badge=badge)


def _losses_told(
    response: solver.Response, path: Sequence[solver.Increment], total: np.ndarray, places: np.ndarray, lasting: int
) -> list[str | None]:
    """Say for each place of a film which blocks were lost or taken away just before it, if any were."""
    words: list[str | None] = [None] * len(places)
    if not (response.losses or response.changes):
        return words
    before = path[0].fallen
    for increment, at in zip(path[1:], total[1:], strict=True):
        gone = np.flatnonzero(increment.fallen & ~before)
        before = increment.fallen
        if len(gone):
            removed = increment.removed[gone]
            fates = (("TAKEN AWAY", gone[removed]), ("LOST", gone[~removed]))
            told = "; ".join(f"{fate} · {_named(response, blocks)}" for fate, blocks in fates if len(blocks))
            first = int(np.searchsorted(places, at))
            words[first : first + lasting] = [told] * len(words[first : first + lasting])
    return words


def _named(response: solver.Response, blocks: np.ndarray) -> str:
    return response.assembly.names[blocks[0]] if len(blocks) == 1 else f"{len(blocks)} blocks"


def _falling(drawer: Drawer, fps: float) -> list[Draw]:
    """List what draws each frame of the fall; the same again while nothing moves."""
    fall = drawer.fall
    found: list[tuple[Draw, solver.Pose]]
    if fall is not None:
        times = [float(k / fps) for k in range(1, int(np.ceil(fall.times[-1] * fps)) + 1)]
        found = [(partial(drawer.falling_picture, time), fall.at(time)) for time in times]
    else:
        pseudo = [increment for increment in drawer.increments if increment.status == solver.Status.FALLING]
        found = [(partial(drawer.picture, increment), increment.pose) for increment in pseudo]
    shown: list[Draw] = []
    drawn, rests = None, False
    for draw, pose in found:
        corners = mechanics.moved_vertices(drawer.assembly, pose)
        still = drawn is not None and np.abs(corners - drawn).max() <= STILL * drawer.scene.pixel
        # What has come to rest in a fall is drawn once more, without the badge of what moves.
        shown.append(shown[-1] if still and (rests or fall is None) else draw)
        rests, drawn = still, drawn if still else corners
    if drawer.response.swings:
        # Out, back and out again: a mechanism to first order goes either way.
        return [*shown, *shown[-2::-1], *shown[1:]]
    # Rest at the end is held as long as any end.
    return shown[: shown.index(shown[-1]) + 1] if shown else []
