"""The scene in space: blocks and marks as meshes, drawn by VTK without a window, frame after frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import pyvista as pv
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.path import Path
from matplotlib.transforms import Affine2D
from PIL import Image
from vtkmodules.vtkCommonCore import vtkLogger

import solver
from solver import mechanics

from . import palette
from .frame import Frame, framed, room_in
from .marks import FINE_CRACK, WIDE_CRACK, Marks, arrow_shapes
from .solid_view import ABOVE, AROUND, View, showing_faces
from .surface import sharp_edges, triangles_of
from .swing import Swing

#: How much of the light comes from all sides, and from the lamp above the left shoulder.
AMBIENT, DIFFUSE = 0.58, 0.50

#: Where the lamp stands, to the right, up and to the eye.
LAMP = (-0.45, 0.85, 1.2)

#: Samples of a pixel.
SAMPLES = 4

#: What is seen lies nearer than this part of the picture's size to the point that is looked for.
SAME_DEPTH = 0.005

#: Layers by how far in front of what lies at the same place they are drawn; what is in front of all hides nothing.
IN_FRONT_OF_ALL = 1_000_000.0

#: Radius of the ground of a fall, in extents of the structure.
GROUND = 1.6

#: The arrows of a mechanism are longer than the way it is drawn by, to be seen on the blocks.
LONGER = 1.6


def _unit_arrow() -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) and triangles (m, 3) of an arrow from the origin along x, of length 1."""
    arrow = pv.Arrow(tip_length=0.42, tip_radius=0.17, shaft_radius=0.065, tip_resolution=24, shaft_resolution=24)
    arrow = arrow.triangulate()
    return np.asarray(arrow.points, dtype=float), np.asarray(arrow.regular_faces)


_ARROW = _unit_arrow()


class SolidScene:
    """Blocks in space and their marks, drawn frame after frame; see :class:`blockvis.pictures.scene.Scene`.

    Parameters
    ----------
    assembly : solver.Assembly
    view : View
    frame : Frame
        What is shown, in the axes of the view, the same in all frames.
    size : (int, int)
        Width and height of the pictures in pixels.
    block_fill : (n_blocks, 3) uint8 array
        Colours of the blocks.
    opacity : float
        Of the blocks.
    """

    def __init__(
        self,
        assembly: solver.Assembly,
        view: View,
        frame: Frame,
        size: tuple[int, int],
        block_fill: np.ndarray,
        *,
        opacity: float = 1.0,
    ) -> None:
        self.assembly, self.view, self.size = assembly, view, size
        self.frame = frame.fitted(*size)
        #: Size of a pixel in the world [m].
        self.pixel = float(self.frame.size[0]) / size[0]
        self._plotter = _plotter(size)
        self._layers: dict[str, Any] = {}
        self._overlay: list[tuple[tuple[int, int, int], np.ndarray]] = []
        self._look_at()
        triangles, self._block = triangles_of(assembly.polyhedra)
        self._surface = pv.PolyData.from_regular_faces(np.array(assembly.vertices), triangles)
        self._surface.cell_data["colour"] = block_fill[self._block]
        self._plotter.add_mesh(
            self._surface, scalars="colour", rgb=True, ambient=AMBIENT, diffuse=DIFFUSE, specular=0.0,
            interpolation="flat", opacity=opacity, reset_camera=False, render=False, show_scalar_bar=False,
        )  # fmt: skip
        #: (n, 2) int array: vertices at both ends of the edges that are drawn.
        self.edges = sharp_edges(assembly.polyhedra)
        self._edges = pv.PolyData(np.array(assembly.vertices), lines=_line_cells(self.edges))
        self._shadow: tuple[pv.PolyData, float] | None = None
        width = float(np.clip(assembly.block_size / self.pixel / 40.0, 0.6, size[1] / 700.0))
        self._add("edges", self._edges, palette.OUTLINE, width=width, forward=1.0)

    def pose(self, shown: solver.Pose, block_fill: np.ndarray | None = None) -> None:
        """Put the blocks where they are drawn.

        Parameters
        ----------
        shown : solver.Pose
        block_fill : (n_blocks, 3) uint8 array, optional
            New colours.
        """
        corners = mechanics.moved_vertices(self.assembly, shown)
        self._surface.points = corners
        self._edges.points = corners
        if self._shadow is not None:
            mesh, height = self._shadow
            # Supports that reach below the ground throw theirs into it.
            flat = np.array(corners)
            flat[:, 2] = np.minimum(corners[:, 2], height)
            mesh.points = flat
        if block_fill is not None:
            self._surface.cell_data["colour"] = block_fill[self._block]

    def show_ground(self, height: float) -> None:
        """Draw the ground of a fall, with the shadows of the blocks under a light from above.

        Parameters
        ----------
        height : float [m]
        """
        corners = np.array(self.assembly.vertices)
        middle, size = corners.mean(axis=0), float(np.ptp(corners, axis=0).max())
        plane = pv.Disc(
            center=(middle[0], middle[1], height), inner=0.0, outer=GROUND * size, normal=(0, 0, 1), c_res=96
        )
        shadow = self._surface.copy()
        shadow.clear_data()
        shadow.points = corners * (1.0, 1.0, 0.0) + (0.0, 0.0, height)
        self._shadow = shadow, height
        for mesh, colour, forward in ((plane, palette.GROUND, -2.0), (shadow, palette.SHADOW, -1.0)):
            actor = self._plotter.add_mesh(
                mesh, color=palette.hexadecimal(colour), lighting=False, reset_camera=False, render=False
            )
            mapper = actor.GetMapper()
            mapper.SetResolveCoincidentTopologyToPolygonOffset()
            mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(0.0, -forward * 10.0)

    def lines(
        self,
        layer: str,
        ends: np.ndarray,
        colour: tuple[int, int, int] | np.ndarray,
        width: float,
        *,
        forward: float = 2.0,
    ) -> None:
        """Draw lines, ends (n, 2, 3) [m], ``width`` pixels wide, in one layer, instead of those before.

        Parameters
        ----------
        layer : str
        ends : (n, 2, 3) array [m]
        colour : (int, int, int), or (n, 2, 3) uint8 array
            Of all, or of each end.
        width : float
            Pixels.
        forward : float
            How far they are in front of what lies at the same place.
        """
        points = np.asarray(ends, dtype=float).reshape(-1, 3)
        self.clear(layer)
        if len(points):
            mesh = pv.PolyData(points, lines=_line_cells(np.arange(len(points)).reshape(-1, 2)))
            self._add(layer, mesh, colour, width=width, forward=forward)

    def polygons(
        self,
        layer: str,
        polygons: Sequence[np.ndarray] | np.ndarray,
        colour: tuple[int, int, int] | np.ndarray,
        *,
        forward: float = 0.0,
    ) -> None:
        """Fill polygons, each (k, 3) [m], in one layer, instead of those before.

        Parameters
        ----------
        layer : str
        polygons : sequence of (k, 3) arrays [m]
        colour : (int, int, int), or (n_points, 3) uint8 array
            Of all, or of each corner.
        forward : float
            As of :meth:`lines`.
        """
        self.clear(layer)
        if len(polygons):
            counts = np.array([len(polygon) for polygon in polygons])
            points = np.concatenate(list(polygons))
            faces = np.insert(np.arange(len(points)), np.cumsum(counts) - counts, counts)
            self._add(layer, pv.PolyData(points, faces=faces), colour, forward=forward)

    def cracks(self, found: Marks, magnification: float, widest: float) -> None:
        """Fill what lies between faces, and draw a line where that would be too thin to see."""
        size, thin = self.assembly.block_size, self._thin
        colours = palette.crack_colours(found.openings / (widest or 1.0))
        narrow = ~found.gapes
        self.polygons("crack", found.cracks[narrow], colours[:, [0, 1, 1, 0]][narrow].reshape(-1, 3))
        width = found.openings.max(axis=1, initial=0.0) / size
        fine, wide = width < FINE_CRACK, width * magnification > WIDE_CRACK
        line, middle = narrow & ~wide, found.middles
        self.lines("crack line", middle[line & ~fine], colours[line & ~fine], max(2.2 * thin, 1.2), forward=2.0)
        self.lines("crack line/fine", middle[line & fine], colours[line & fine], max(1.4 * thin, 1.0), forward=2.0)
        both = np.tile(colours[found.gapes], (2, 1, 1))
        self.lines("crack line/faces", found.gaping_faces, both, max(2.4 * thin, 1.2), forward=2.0)

    def sliding(self, found: Marks) -> None:
        """Draw lines around the faces that slide, and what of them is seen."""
        self.lines("sliding", found.sliding, palette.SLIDING, max(4.0 * self._thin, 1.6), forward=3.0)
        pale = palette.rgb(0.6 * np.asarray(palette.SLIDING) + 102.0)
        self.polygons("exposed", found.exposed, pale, forward=0.5)

    def hinges(self, found: Marks) -> None:
        """Draw the lines about which hinges turn, dashed where blocks hide them."""
        width = max(7.0 * self._thin, 2.4)
        self.lines("hinge rim", found.hinges, palette.PAPER, 1.8 * width, forward=4.0)
        self.lines("hinge", found.hinges, palette.HINGE, width, forward=5.0)
        dashes = _dashed(found.hinges, 12.0 * max(self._thin, 0.6) * self.pixel)
        self.lines("hidden hinge", dashes, palette.HINGE, 0.22 * width, forward=IN_FRONT_OF_ALL)

    def forces(self, ends: np.ndarray, line: np.ndarray) -> None:
        """Draw bars and the line of thrust in front of all: they lie inside the blocks."""
        width = max(2.5, self.size[1] / 240.0)
        self.lines("force", ends, palette.FORCE, width, forward=IN_FRONT_OF_ALL)
        self.lines("force line", line, palette.FORCE, 0.6 * width, forward=IN_FRONT_OF_ALL)

    def bearings(self, ends: np.ndarray) -> None:
        """Draw nothing: the blocks show it."""

    def arrows(self, layer: str, tails: np.ndarray, tips: np.ndarray, colour: tuple[int, int, int]) -> None:
        """Draw solid arrows from tails (n, 3) [m] to tips (n, 3) [m]."""
        self.clear(layer)
        if len(tails):
            points, faces = _ARROW
            long = np.linalg.norm(tips - tails, axis=1)[:, None]
            directions = (tips - tails) / long
            across = np.cross(directions, np.where(np.abs(directions[:, 2:]) < 0.9, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
            across /= np.linalg.norm(across, axis=1)[:, None]
            turns = np.stack([directions, across, np.cross(directions, across)], axis=1)
            placed = tails[:, None] + long[:, None] * np.einsum("pi,nij->npj", points, turns)
            every = faces[None] + len(points) * np.arange(len(tails))[:, None, None]
            mesh = pv.PolyData.from_regular_faces(placed.reshape(-1, 3), every.reshape(-1, 3))
            self._add(layer, mesh, colour, lit=True)

    def show_motion(self, swing: Swing, tails: np.ndarray, tips: np.ndarray) -> solver.Pose:
        """Draw the edges of where the parts of a mechanism were; the blocks go where it takes them."""
        edges = mechanics.moved_vertices(self.assembly, swing.increment.pose)[self.edges]
        moving = (swing.parts >= 0)[self.assembly.block_of_vertex[self.edges[:, 0]]]
        self.lines("before", edges[moving], palette.GHOST, self.size[1] / 900.0)
        tips = tips + (LONGER - 1.0) * (tips - tails)
        self._overlay = _rimmed_arrows(self.at_pixel(tails), self.at_pixel(tips), self.size[1] / 130.0)
        return swing.displaced

    def clear(self, *layers: str) -> None:
        """Remove layers."""
        for name in layers:
            if name in self._layers:
                self._plotter.remove_actor(self._layers.pop(name), reset_camera=False, render=False)

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the layers."""
        return tuple(self._layers)

    def holds(self, *layers: str) -> bool:
        """Whether anything is drawn in one of the layers."""
        return any(layer in self._layers for layer in layers)

    def image(self) -> Image.Image:
        """Draw the picture."""
        with _quiet():
            self._plotter.render()
            pixels = self._plotter.screenshot(return_img=True)
        return _painted(Image.fromarray(np.ascontiguousarray(pixels[..., :3])), self._overlay)

    def at_pixel(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) array: pixel (column, row) of points (n, 3) [m]."""
        place = (self.view.projected(np.asarray(points)) - self.frame.low) / self.pixel
        return np.column_stack([place[:, 0], self.size[1] - place[:, 1]])

    def sees(self, points: np.ndarray) -> np.ndarray:
        """(n,) bool array: which points (n, 3) [m] on the blocks nothing hides in the last picture."""
        depth = np.nan_to_num(np.asarray(self._plotter.get_image_depth(reset_camera_clipping_range=False)), nan=-np.inf)
        column, row = np.floor(self.at_pixel(points)).astype(int).T
        inside = (column >= 0) & (row >= 0) & (column < depth.shape[1]) & (row < depth.shape[0])
        found = np.full(len(points), -np.inf)
        found[inside] = depth[row[inside], column[inside]]
        # VTK counts the depth from the eye backwards.
        eye = self.view.depth(np.array(self._plotter.camera.position)[None])[0]
        return np.asarray(np.abs(found - (self.view.depth(points) - eye)) < SAME_DEPTH * self.frame.size.max())

    def close(self) -> None:
        """Give the memory of the graphics card back."""
        self._plotter.close()

    @property
    def _thin(self) -> float:
        """Pixels; one where the picture is 1080 high."""
        return self.size[1] / 1080.0

    def _look_at(self) -> None:
        axes, camera = self.view.axes, self._plotter.camera
        middle = (self.frame.low + self.frame.high) / 2.0
        away = 4.0 * float(max(np.ptp(self.assembly.vertices, axis=0).max(), self.frame.size.max()))
        depth = float(self.view.depth(self.assembly.vertices).mean())
        target = middle @ axes[:2] + depth * axes[2]
        camera.focal_point = tuple(target)
        camera.position = tuple(target + away * axes[2])
        camera.up = tuple(axes[1])
        camera.parallel_projection = True
        camera.parallel_scale = float(self.frame.size[1]) / 2.0
        camera.clipping_range = (0.1 * away, 1.9 * away)

    def _add(
        self,
        layer: str,
        mesh: pv.PolyData,
        colour: tuple[int, int, int] | np.ndarray,
        *,
        width: float = 1.0,
        forward: float = 0.0,
        lit: bool = False,
    ) -> None:
        look: dict[str, Any] = {"color": tuple(c / 255.0 for c in colour)} if isinstance(colour, tuple) else {}
        if not look:
            mesh.point_data["colour"] = np.asarray(colour, dtype=np.uint8).reshape(-1, 3)
            look = {"scalars": "colour", "rgb": True, "show_scalar_bar": False}
        actor = self._plotter.add_mesh(
            mesh, **look, line_width=width, lighting=lit, ambient=AMBIENT,
            diffuse=DIFFUSE, reset_camera=False, render=False,
        )  # fmt: skip
        drawn_forward(actor, forward)
        self._layers[layer] = actor


def blocks_picture(assembly: solver.Assembly, size: tuple[int, int], fill: np.ndarray) -> Image.Image:
    """Draw blocks in space where the layout has them, ``size`` pixels wide and high, in colours (n_blocks, 3) uint8."""
    view = View(AROUND[0], ABOVE)
    frame = framed(assembly, [solver.Pose.initial(assembly)], margin=0.04, supports=1.0, axes=view.axes[:2])
    scene = SolidScene(assembly, view, frame, size, fill)
    picture = scene.image()
    scene.close()
    return picture


def seen_faces(scene: SolidScene) -> tuple[np.ndarray, np.ndarray]:
    """Find where the name of each block can stand: on the face that shows most of itself in the last picture.

    Parameters
    ----------
    scene : SolidScene

    Returns
    -------
    places : (n_blocks, 3) array [m]
        Middle of that face.
    room : (n_blocks, 2) array [m]
        Its width and height in the picture; 0 where something hides it.
    """
    shapes = scene.assembly.polyhedra
    places, best, showing = showing_faces(shapes, scene.view.axes[2])
    flat = scene.view.projected(shapes.vertices)
    room = np.zeros((len(shapes), 2))
    for block, face in enumerate(best.tolist()):
        ring = flat[shapes.corners[shapes.face_offsets[face] : shapes.face_offsets[face + 1]]]
        room[block] = room_in(ring)
    room[(showing <= 0.0) | ~scene.sees(places)] = 0.0
    return places, room


def drawn_forward(actor: Any, by: float) -> None:
    """Draw lines and polygons in front of what lies at their place, by so many hairs.

    Parameters
    ----------
    actor : pyvista.Actor
    by : float
    """
    mapper = actor.mapper
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    # In units of the smallest difference of depth, which is some 1e-5 of the distance to the structure.
    mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, -6.0 * by)
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(0.0, -6.0 * by)


def _line_cells(ends: np.ndarray) -> np.ndarray:
    return np.column_stack([np.full(len(ends), 2), ends]).ravel()


def _plotter(size: tuple[int, int]) -> pv.Plotter:
    """Make a plotter without a window: white, one lamp, several samples a pixel."""
    with _quiet():
        plotter = pv.Plotter(off_screen=True, window_size=list(size), lighting="none")
        plotter.background_color = "white"
        plotter.enable_anti_aliasing("msaa", multi_samples=SAMPLES)
        plotter.add_light(pv.Light(position=LAMP, light_type="camera light", intensity=1.0))
    return plotter


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep VTK from saying on stderr that there is no display: it draws without one."""
    before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    try:
        yield
    finally:
        vtkLogger.SetStderrVerbosity(before)


def _dashed(ends: np.ndarray, length: float) -> np.ndarray:
    """(m, 2, 3) array [m]: dashes of a length [m], with gaps as long, along lines (n, 2, 3)."""
    along = ends[:, 1] - ends[:, 0]
    counts = np.maximum(1, np.round(np.linalg.norm(along, axis=1) / (2.0 * length))).astype(int)
    line = np.repeat(np.arange(len(ends)), counts)
    place = np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)
    # Half a gap at either end.
    shares = (place[:, None] + np.array([0.25, 0.75])) / counts[line][:, None]
    return ends[line, :1] + shares[:, :, None] * along[line][:, None]


def _rimmed_arrows(tails: np.ndarray, tips: np.ndarray, thick: float) -> list[tuple[tuple[int, int, int], np.ndarray]]:
    """Polygons of arrows from tails (n, 2) to tips (n, 2) [pixels] with a white rim, back to front."""
    shapes: list[tuple[tuple[int, int, int], np.ndarray]] = []
    for grown, colour in ((0.35 * thick, palette.PAPER), (0.0, palette.SETTLEMENT)):
        shapes += [(colour, polygon) for kind in arrow_shapes(tails, tips, thick, grown) for polygon in kind]
    return shapes


def _painted(picture: Image.Image, shapes: list[tuple[tuple[int, int, int], np.ndarray]]) -> Image.Image:
    """Paint polygons, (k, 2) pixels each, over a picture, with exact edges."""
    if not shapes:
        return picture
    renderer = RendererAgg(*picture.size, 72.0)
    pixels = np.asarray(renderer.buffer_rgba())
    pixels[...] = np.asarray(picture.convert("RGBA"))
    upright = Affine2D().scale(1.0, -1.0).translate(0.0, picture.size[1])
    for colour, polygon in shapes:
        pen = renderer.new_gc()
        pen.set_linewidth(0.0)
        pen.set_snap(False)
        renderer.draw_path(pen, Path(polygon), upright, tuple(c / 255.0 for c in colour))
    return Image.fromarray(pixels[..., :3].copy())
