"""Stills, the picture of the mechanism, and the animation: a Response in, a file out, off-screen."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from PIL import Image

import solver
from blockvis.atomic_files import whole_file

from .drawer import MOST_PARTS, Drawer, Look
from .frame import framed
from .video import write_film

STILL_SIZE = (1920, 1080)
FILM_SIZE = (1280, 720)


def draw_still(
    response: solver.Response,
    increment: int | solver.Increment,
    path: str | os.PathLike[str],
    *,
    size: tuple[int, int] = STILL_SIZE,
    magnification: float = 1.0,
    colour_by: str = "material",
    forces: str = "auto",
    joints: bool = True,
    curve: bool = False,
) -> Path:
    """Draw one increment.

    Parameters
    ----------
    response : solver.Response
    increment : int or solver.Increment
        An increment of the response, or its number; -1 is the last.
    path : path
        Any format Pillow writes; PNG is meant.
    size : (int, int)
        Width and height in pixels.
    magnification : float
        Of displacements and rotations; 1 is true scale.
    colour_by : {"material", "displacement"}
    forces : {"auto", "thrust", "points", "none"}
        Resultant of each joint, forces at the contact points, or neither; "auto" draws resultants where the blocks
        are few enough to see them.
    joints : bool
        Mark open and sliding joints and hinges.
    curve : bool
        Put the reaction curve beside the blocks.

    Returns
    -------
    pathlib.Path
    """
    _check_response(response)
    chosen = response.increments[increment] if isinstance(increment, int) else increment
    look = Look(magnification, colour_by, forces, joints)
    return _save(Drawer(response, look, size, (chosen,), curve=curve).picture(chosen), path)


def draw_mechanism(
    response: solver.Response, path: str | os.PathLike[str], *, size: tuple[int, int] = STILL_SIZE
) -> Path:
    """Draw the last equilibrium, its hinges and sliding joints, and the motion that follows.

    Blocks are filled where they stand, those that move together alike; outlines and arrows show, out of scale,
    where the mechanism takes them.

    Parameters
    ----------
    response : solver.Response
    path : path
    size : (int, int)
        Width and height in pixels.

    Returns
    -------
    pathlib.Path
    """
    _check_response(response)
    last = response.governing or response.increments[0]
    motion = last.velocity if response.collapse is None else response.collapse.mechanism
    last = solver.with_motion(last, motion)
    assembly = response.assembly
    speeds = _speeds(assembly, last.pose, motion)
    fastest = float(speeds.max(initial=0.0))
    if response.collapse is None and fastest > 0.0:
        # Without collapse a single loose brick may be the fastest: it would make the motion of the whole invisible.
        fastest = _exceeded_by(0.01, speeds, assembly.areas) or fastest
        motion = motion * np.minimum(1.0, fastest / np.maximum(speeds, fastest))[:, None]
    reach = 0.05 * float(framed(assembly, [last.pose]).size.max())
    displaced = solver.swung(last.pose, motion * (reach / fastest if fastest > 0 else 0.0))
    parts = solver.rigid_parts(assembly, last)
    drawer = Drawer(response, Look(forces="none"), size, (last,), extra=(displaced,))
    if fastest > 0:
        drawer.show_motion(last.pose, displaced, parts)
    return _save(drawer.picture(last, note=_mechanism_note(response, parts)), path)


def _speeds(assembly: solver.Assembly, pose: solver.Pose, motion: np.ndarray) -> np.ndarray:
    """(n_blocks,) array: speed of the fastest corner of each free block, zero for supports."""
    block = assembly.block_of_vertex
    velocity = solver.point_velocities(solver.moved_vertices(assembly, pose), block, pose, motion)
    speeds = np.maximum.reduceat(np.hypot(*velocity.T), assembly.offsets[:-1])
    return np.where(assembly.free, speeds, 0.0)


def _exceeded_by(share: float, speeds: np.ndarray, areas: np.ndarray) -> float:
    """Speed that blocks of this share of the moving area reach or exceed."""
    order = np.argsort(speeds)[::-1]
    moving = np.where(speeds[order] > 0.0, areas[order], 0.0).cumsum()
    return float(speeds[order[np.searchsorted(moving, share * moving[-1])]])


def animate(
    response: solver.Response,
    path: str | os.PathLike[str],
    *,
    size: tuple[int, int] = FILM_SIZE,
    fps: float = 25.0,
    seconds: float = 5.0,
    magnification: float = 1.0,
    colour_by: str = "material",
    forces: str = "auto",
    joints: bool = True,
    curve: bool = False,
) -> Path:
    """Write the settlement and the fall as a film.

    The settlement grows evenly over ``seconds``, the last equilibrium holds for a moment, then the frames of the
    fall follow, marked as pseudo-time.

    Parameters
    ----------
    response : solver.Response
    path : path
        Ending in .mp4, .gif or .webp.
    size : (int, int)
        Width and height in pixels, both even.
    fps : float
        Frames per second.
    seconds : float [s]
        Length of the part in equilibrium.
    magnification, colour_by, forces, joints, curve
        As in :func:`draw_still`.

    Returns
    -------
    pathlib.Path
    """
    _check_response(response)
    look = Look(magnification, colour_by, forces, joints)
    drawer = Drawer(response, look, size, response.increments, curve=curve)
    return write_film(drawer.frames(fps, seconds), path, size=size, fps=fps)


def _mechanism_note(response: solver.Response, parts: np.ndarray) -> str:
    n = int(parts.max(initial=-1)) + 1
    bodies = f"{n} moving part{'s' if n != 1 else ''}{', darker where faster' if n > MOST_PARTS else ''}"
    if response.collapse is None and response.limits:
        return f"mechanism at the limit load   ·   {response.limits[-1].flow} friction   ·   {bodies}"
    if response.collapse is None:
        if response.stop == solver.Status.NO_INITIAL_EQUILIBRIUM:
            when = f"before any {response.parameter.name}" if response.measured.is_force else "under the dead load"
            return f"no equilibrium {when}   ·   {bodies}"
        return f"{response.stop}: the motion that would follow   ·   {bodies}"
    collapse = response.collapse
    low, high = (f"{end:.5g} {collapse.unit}" for end in collapse.bracket)
    return f"collapse mechanism   ·   {collapse.lost} at {low}, none at {high}   ·   {bodies}"


def _check_response(response: solver.Response) -> None:
    if not response.increments:
        raise ValueError(f"there is no increment to draw: {response.message or response.stop}")


def _save(picture: Image.Image, path: str | os.PathLike[str]) -> Path:
    with whole_file(path) as partial:
        picture.save(partial)
    return Path(path)
