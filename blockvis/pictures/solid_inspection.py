"""Pictures of blocks in space as laid out: names on what is seen, roles by colour."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

import solver
from blockvis.system.atomic_files import whole_file
from solver import mechanics

from . import palette
from .frame import Key, Sheet, framed, write_names
from .solid_scene import SolidScene
from .solid_view import ABOVE, AROUND, View, showing_faces

if TYPE_CHECKING:
    from blockvis.layout.inspect import Inspection

#: Pixels of the picture of an inspection, of which 0.8 are to hold names.
SIZE = (1600, 1100)

#: Fill of blocks that are drawn a second time.
TWICE = (91, 143, 214)


def draw_solid_inspection(inspection: Inspection, path: str | Path) -> Path:
    """Draw what a layout in space holds: blocks by their role, with their names where they can be read.

    Parameters
    ----------
    inspection : Inspection
    path : str or Path
        .png, .pdf or any format that Pillow writes.

    Returns
    -------
    pathlib.Path
    """
    layout, kept = inspection.layout, inspection.kept.tolist()
    assembly = solver.Assembly.from_solids(
        [layout.solids[i] for i in kept],
        names=[layout.names[i] for i in kept],
        roles=[inspection.roles[i] for i in kept],
        materials=[layout.materials[i] for i in kept],
    )
    fill = palette.role_colours(assembly)
    later = {first for first, _ in inspection.twins}
    twice = np.array([i in later for i in kept])
    fill[twice] = TWICE
    keys = [
        Key("area", f"{role}: {int(some.sum())}", colour)
        for role, some, colour in (
            ("free", assembly.free & ~twice, palette.rgb(palette.STONES[0])),
            ("fixed", (assembly.roles == mechanics.FIXED) & ~twice, palette.SUPPORT),
            ("moving", assembly.moving & ~twice, palette.MOVING),
            ("drawn twice", twice, TWICE),
        )
        if some.any()
    ]
    size = " × ".join(f"{length:.4g}" for length in inspection.high - inspection.low)
    picture = blocks_picture(
        assembly,
        SIZE,
        fill,
        names=True,
        title=f"{Path(layout.source).name or 'layout'}: {len(kept)} blocks in space, read in {layout.unit}",
        detail=f"{size} m   ·   {inspection.facing.note or 'faces in contact lie in one plane'}",
        keys=keys,
    )
    with whole_file(path) as partial:
        picture.save(partial)
    return Path(path)


def blocks_picture(
    assembly: solver.Assembly,
    size: tuple[int, int],
    fill: np.ndarray,
    *,
    names: bool = False,
    title: str = "",
    detail: str = "",
    keys: list[Key] | None = None,
) -> Image.Image:
    """Draw blocks in space where the layout has them.

    Parameters
    ----------
    assembly : solver.Assembly
    size : (int, int)
        Width and height in pixels.
    fill : (n_blocks, 3) uint8 array
    names : bool
        Write the name of each block on a face of it that is seen and large enough.
    title, detail : str
        Lines above; without them there is no sheet around the blocks.
    keys : list of Key, optional
        Of the legend.
    """
    view = View(AROUND[0], ABOVE)
    frame = framed(assembly, [solver.Pose.initial(assembly)], margin=0.04, supports=1.0, axes=view.axes[:2])
    sheet = Sheet(size) if title else None
    scene = SolidScene(assembly, view, frame, size if sheet is None else sheet.inside_size, fill)
    picture = scene.image()
    if names:
        places, room = seen_faces(scene)
        shown = np.flatnonzero(room > 0.0)
        write_names(picture, [assembly.names[k] for k in shown], scene.at_pixel(places[shown]), room[shown])
    scene.close()
    if sheet is None:
        return picture
    return sheet.composed(picture, title=title, detail=detail, keys=keys or [], pixel=scene.pixel)


def seen_faces(scene: SolidScene) -> tuple[np.ndarray, np.ndarray]:
    """Find where the name of each block can stand: on the face that shows most of itself.

    Returns
    -------
    places : (n_blocks, 3) array [m]
        Middle of that face.
    room : (n_blocks,) array [pixels]
        Across the face there; 0 where something hides it.
    """
    shapes = scene.assembly.polyhedra
    places, best, showing = showing_faces(shapes, scene.view.axes[2])
    pixels = scene.view.projected(shapes.vertices) / scene.pixel
    room = np.zeros(len(shapes))
    for block, face in enumerate(best.tolist()):
        ring = pixels[shapes.corners[shapes.face_offsets[face] : shapes.face_offsets[face + 1]]]
        room[block] = np.ptp(ring, axis=0)[0]
    room[(showing <= 0.0) | ~scene.sees(places)] = 0.0
    return places, room
