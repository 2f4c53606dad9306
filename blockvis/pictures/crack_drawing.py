"""The drawing of the cracks: those of one increment on the pale layout, as a survey has them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import solver
from blockvis.layout.sights import Cut, Sight
from blockvis.results.about import settlement_in
from blockvis.results.cracks import Crack, cracks_of, main_cracks, slid_joints
from blockvis.results.joint_faces import InitialJoints, initial_joints
from blockvis.results.joints import carried_faces, opening_and_slip
from blockvis.text import width_text
from solver import mechanics

from . import palette
from .captions import loss_words, phase_words, state_text
from .flat_scene import FlatScene
from .frame import Key, Sheet, along_lines, framed, sheet_size, write_labels
from .marks import ARROW, arrows_on_supports
from .render import numbered, save_picture, seen_from

#: Thickness of a crack that only slides and of the widest one, in heights of the picture; the latter in block sizes at
#: most, or the steps of a fine bond would run into each other.
THIN, THICK, OF_BLOCK = 1.0 / 540.0, 1.0 / 60.0, 0.35


def draw_cracks(
    response: solver.Response,
    number: int,
    path: str | os.PathLike[str],
    *,
    size: tuple[int, int] | None = None,
    view: str | Mapping[str, float] | Sight | None = None,
    section: str | Mapping[str, Any] | Cut | None = None,
) -> Path:
    """Draw the cracks of an increment in equilibrium, by its number, alone, on the layout.

    In the plane each main crack has a colour of its own, its number and its largest width where it is; the others are
    grey. In space lines are the darker and the thicker the more joints are open there, in classes of width; main cracks
    have their numbers and widths. Size, view and section are as of :func:`blockvis.draw_still`; cracks that the section
    cuts away are counted, no more.

    Raises ``ValueError`` for a number that no increment in equilibrium has, and for a view of blocks in the plane.
    """
    assembly = response.assembly
    increments = response.path or response.increments
    increment = numbered(increments, number)
    joints = initial_joints(assembly)
    cracks = cracks_of(assembly, increment.pose, increment.fallen)
    shown, hidden, cut_at = cracks, 0, list[str]()
    if assembly.dimension == 2:
        if view is not None or section is not None:
            raise ValueError("view and section are of blocks in space; these lie in the plane: leave both out")
        thickness = "lines as thick as they are open, the thickest "
        sheet, picture, keys, pixel = _drawn_in_plane(response, increment, joints, cracks, size)
        moved = opening_and_slip(assembly, joints, increment.pose, increment.fallen)
        slid = slid_joints(assembly, moved)[:1]
        slip = float(np.abs(moved[slid, 1]).max(initial=0.0))
        # Stepped cracks run through joints that slide.
        drawn = "" if any(np.isin(slid, crack.joints).any() for crack in cracks) else ", not drawn"
    else:
        # VTK takes seconds to import, and pictures in the plane need none.
        from .cracks_in_space import CracksInSpace

        thickness = "the widest "
        drawing = CracksInSpace(response, increment, joints, size, cracks, *seen_from(view, section))
        # What it hides is known when it is drawn.
        picture = drawing.image()
        sheet, shown, hidden = drawing.sheet, drawing.shown, drawing.hidden
        keys, pixel, slip, drawn, cut_at = drawing.keys, drawing.pixel, drawing.slip, "", drawing.section
    lost = loss_words(increment)
    none = f"no joint {'of what stands ' * bool(lost)}is open" + (
        "" if response.parameter.is_path else ": a limit load is of the layout as it stands"
    )
    of_them = "" if len(shown) == len(cracks) else f", of which the section shows {len(shown) or 'none'}"
    of_them += f", {'' if hidden == len(cracks) else f'{hidden} '}in no view" if hidden else ""
    counts = [mechanics.counted(len(cracks), "crack") + of_them if cracks else none]
    counts += phase_words(response, increment) if cracks else []
    counts += [f"{words}, not drawn" for words in lost]
    counts += [thickness + width_text(shown[0].width)] if shown else []
    counts += [f"joints slide by up to {width_text(slip)}{drawn}"] if slip else []
    counts += ["drawn on the layout"] if cracks or slip else []
    counts += cut_at
    page = sheet.composed(
        picture,
        title=f"Cracks   ·   {state_text(increment, response)}",
        detail="   ·   ".join(counts),
        keys=keys,
        pixel=pixel,
    )
    return save_picture(page, path)


def _drawn_in_plane(
    response: solver.Response,
    increment: solver.Increment,
    joints: InitialJoints,
    cracks: list[Crack],
    size: tuple[int, int] | None,
) -> tuple[Sheet, Image.Image, list[Key], float]:
    """Draw the cracks of blocks in the plane, and how supports move; returns sheet, picture, legend and pixel [m]."""
    assembly, main, start = response.assembly, main_cracks(cracks), solver.Pose.initial(response.assembly)
    openings = np.maximum(carried_faces(assembly, joints, increment.pose).gaps.reshape(-1, 2), 0.0)
    widest = cracks[0].width if cracks else 1.0
    fill = palette.pale(palette.block_colours(assembly.materials, assembly.free), True, palette.SURVEY)
    frame = framed(assembly, [start])
    sheet = Sheet(size or sheet_size(frame))
    scene = FlatScene(assembly, frame, sheet.inside_size, fill, outline=palette.PALE_OUTLINE)
    scene.hide(increment.fallen)
    scene.pose(start)
    # The numbers are those of the report.
    named = [(1 + cracks.index(crack), crack, shade) for crack, shade in zip(main, palette.SURVEYED, strict=False)]
    others = [(crack, palette.GHOST) for crack in cracks if crack not in main]
    layers = [*((crack, shade) for _, crack, shade in named), *others]
    height = scene.usual_height * scene.pixel
    thin, thick = THIN * height, max(min(THICK * height, OF_BLOCK * assembly.block_size), 2.0 * THIN * height)
    # The main ones are drawn last, on top.
    for k, (crack, colour) in list(enumerate(layers))[::-1]:
        half = (thin + (thick - thin) * openings[crack.joints] / widest) / 2.0
        scene.polygons(f"crack edge/{k}", _bars(joints.ends[crack.joints], half), colour)
    (tails, tips), settlement = np.zeros((2, 0, 2)), settlement_in(response, increment.phase)
    if settlement is not None:
        tails, tips = arrows_on_supports(assembly, settlement, start, frame, ARROW * float(frame.size.max()))
        scene.arrows("arrow", tails, tips, palette.SETTLEMENT)
    picture = scene.image()
    if main:
        dots = along_lines(np.concatenate([joints.ends[crack.joints] for crack in cracks]))
        arrows = np.stack([scene.at_pixel(tails), scene.at_pixel(tips)], axis=1)
        places = scene.at_pixel(np.array([_widest_point(crack, joints, openings) for crack in main]))
        words = [f"{n}: {width_text(crack.width)}" for n, crack, _ in named]
        write_labels(picture, places, words, sheet.text, scene.at_pixel(dots), palette.SURVEYED[: len(main)], arrows)
    keys = [Key("line", f"crack {n}", shade) for n, _, shade in named]
    keys += [Key("line", mechanics.counted(len(others), "other"), palette.GHOST)] * bool(others)
    return sheet, picture, keys, scene.pixel


def _bars(ends: np.ndarray, half: np.ndarray) -> np.ndarray:
    """(n, 4, 2) array [m]: lines with ends (n, 2, 2), at each so far (n, 2) to both sides, a little longer to meet."""
    along = ends[:, 1] - ends[:, 0]
    unit = along / np.maximum(np.hypot(*along.T), 1e-300)[:, None]
    side = np.stack([-unit[:, 1], unit[:, 0]], axis=1)[:, None] * half[:, :, None]
    longer = unit[:, None] * half.min(axis=1)[:, None, None] * np.array([[-1.0], [1.0]])
    left, right = ends + longer + side, ends + longer - side
    return np.stack([left[:, 0], left[:, 1], right[:, 1], right[:, 0]], axis=1)


def _widest_point(crack: Crack, joints: InitialJoints, openings: np.ndarray) -> np.ndarray:
    """(2,) array [m]: the end of its widest joint that is open most, in the layout."""
    widest = crack.joints[0]
    return np.asarray(joints.ends[widest, openings[widest].argmax()])
