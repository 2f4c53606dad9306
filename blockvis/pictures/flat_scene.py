"""The off-screen scene: blocks and marks as VTK layers whose arrays change in place from frame to frame."""

from __future__ import annotations

import numpy as np
from PIL import Image

import solver

from . import palette
from .frame import Frame
from .hatching import hatch_lines, triangles
from .opengl import RenderingUnavailable, rendering_available

#: Depths of the layers, back to front.
DEPTHS = {
    name: k / 170.0
    for k, name in enumerate(
        (
            "ghost", "crack", "fill", "hatch", "outline", "ground", "crack edge", "sliding", "motion outline",
            "force line", "force", "hinge", "hinge top", "motion rim", "motion top", "live rim", "live top",
            "arrow rim", "arrow top",
        )
    )
}  # fmt: skip


def magnified(assembly: solver.Assembly, pose: solver.Pose, magnification: float) -> solver.Pose:
    """Multiply the displacements and rotations of a pose since the layout."""
    if magnification == 1.0:
        return pose
    start = assembly.centroids
    return solver.Pose(start + magnification * (pose.positions - start), magnification * pose.rotations)


class Scene:
    """Blocks and their marks, drawn off-screen frame after frame.

    Parameters
    ----------
    assembly : solver.Assembly
    frame : Frame
        What is shown, the same in all frames.
    size : (int, int)
        Width and height of the pictures in pixels.
    block_fill : (n_blocks, 3) uint8 array
        Colours of the blocks.
    supersampling : int
        Factor by which the picture is rendered larger and averaged down: cheaper in software OpenGL than its own
        anti-aliasing.

    Raises
    ------
    RenderingUnavailable
        Where there is no usable OpenGL.
    """

    def __init__(
        self,
        assembly: solver.Assembly,
        frame: Frame,
        size: tuple[int, int],
        block_fill: np.ndarray,
        supersampling: int = 2,
    ) -> None:
        missing = rendering_available()
        if missing:
            raise RenderingUnavailable(missing)
        import pyvista as pv

        self.assembly, self.size, self._fine = assembly, size, supersampling
        self.frame = frame.fitted(*size)
        #: Size of a pixel in the world [m].
        self.pixel = float(self.frame.size[0]) / size[0]
        self._pv = pv
        window = [self._fine * size[0], self._fine * size[1]]
        self._plotter = pv.Plotter(off_screen=True, window_size=window, lighting="none")
        self._plotter.ren_win.SetMultiSamples(0)
        self._plotter.set_background([c / 255.0 for c in palette.PAPER])
        self._layers: dict[str, _Layer] = {}
        self._block = assembly.block_of_vertex
        self._shown = solver.Pose.initial(assembly)
        self._add_blocks(block_fill)
        self._add_hatch()
        self._fix_camera()

    def __enter__(self) -> Scene:
        """Open the scene."""
        return self

    def __exit__(self, *_: object) -> None:
        """Free the window."""
        self.close()

    def close(self) -> None:
        """Free the window."""
        self._plotter.close()

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the layers drawn so far."""
        return tuple(self._layers)

    def pose(self, shown: solver.Pose, vertex_colours: np.ndarray | None = None) -> None:
        """Put the blocks where they are drawn.

        Parameters
        ----------
        shown : solver.Pose
        vertex_colours : (n_vertices, 3) uint8 array, optional
            New fills.
        """
        self._shown = shown
        corners = solver.moved_vertices(self.assembly, shown)
        for name in ("fill", "outline"):
            self._layers[name].move(corners)
        if vertex_colours is not None:
            self._layers["fill"].colour(vertex_colours)
        if "hatch" in self._layers:
            points, blocks = self._hatch
            self._layers["hatch"].move(solver.carried(points, blocks, solver.Pose.initial(self.assembly), shown))

    def polygons(self, layer: str, corners: np.ndarray, colour: tuple[int, int, int]) -> None:
        """Fill convex polygons, (n, k, 2) [m], in one layer, instead of those before."""
        n, k = corners.shape[:2] if corners.size else (0, 4)
        faces = np.column_stack([np.full(n, k), np.arange(n * k).reshape(n, k)]) if n else None
        self._layer(layer, colour).replace(corners.reshape(-1, 2), faces=faces)

    def lines(self, layer: str, points: np.ndarray, colour: tuple[int, int, int], width: float) -> None:
        """Draw polylines, (n, k, 2) [m], ``width`` pixels wide, in one layer, instead of those before."""
        n, k = points.shape[:2] if points.size else (0, 2)
        cells = np.column_stack([np.full(n, k), np.arange(n * k).reshape(n, k)]) if n else None
        target = self._layer(layer, colour)
        target.width(width * self._fine)
        target.replace(points.reshape(-1, 2), lines=cells)

    def discs(self, layer: str, centres: np.ndarray, radius: float, colour: tuple[int, int, int]) -> None:
        """Draw discs, centres (n, 2) [m], ``radius`` in pixels, in one layer, instead of those before."""
        angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        rim = radius * self.pixel * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        self.polygons(layer, centres[:, None, :] + rim[None, :, :], colour)

    def image(self) -> Image.Image:
        """Render the picture."""
        self._plotter.render()
        pixels = self._plotter.screenshot(return_img=True)
        return Image.fromarray(np.ascontiguousarray(pixels[..., :3])).reduce(self._fine)

    def at_pixel(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) array: pixel (column, row) of points (n, 2) [m]."""
        place = (np.asarray(points) - self.frame.low) / self.pixel
        return np.column_stack([place[:, 0], self.size[1] - place[:, 1]])

    def _add_blocks(self, block_fill: np.ndarray) -> None:
        corners = self.assembly.vertices
        fill = self._layer("fill", None)
        fill.replace(corners, faces=triangles(self.assembly))
        fill.colour(block_fill[self._block])
        offsets, counts = self.assembly.offsets, np.diff(self.assembly.offsets)
        closed = np.insert(np.arange(offsets[-1]), offsets[1:], offsets[:-1])
        cells = np.insert(closed, np.concatenate([[0], np.cumsum(counts + 1)[:-1]]), counts + 1)
        outline = self._layer("outline", palette.OUTLINE)
        outline.width(self._fine * self._outline_width())
        outline.replace(corners, lines=cells)

    def _outline_width(self) -> float:
        """Pixels; thinner where the blocks are small, so that a façade does not turn dark."""
        return float(np.clip(self.assembly.block_size / self.pixel / 25.0, 0.6, self.size[1] / 540.0))

    def _add_hatch(self) -> None:
        supports = np.flatnonzero(~self.assembly.free)
        spacing = self.size[1] / 60.0 * self.pixel
        low, high = self.frame.low - self.frame.size, self.frame.high + self.frame.size
        points, blocks = hatch_lines(self.assembly, supports, low, high, spacing)
        self._hatch = points, blocks
        if len(points):
            layer = self._layer("hatch", palette.HATCH)
            layer.width(self._fine * max(0.7, self.size[1] / 1000.0))
            cells = np.column_stack([np.full(len(points) // 2, 2), np.arange(len(points)).reshape(-1, 2)])
            layer.replace(points, lines=cells)

    def _fix_camera(self) -> None:
        plotter, (x, y) = self._plotter, (self.frame.low + self.frame.high) / 2.0
        depth = float(self.frame.size.max())
        plotter.enable_parallel_projection()
        plotter.camera.position = (x, y, depth)
        plotter.camera.focal_point = (x, y, 0.0)
        plotter.camera.up = (0.0, 1.0, 0.0)
        plotter.camera.parallel_scale = float(self.frame.size[1]) / 2.0
        plotter.camera.clipping_range = (depth * 0.5, depth * 1.5)

    def _layer(self, name: str, colour: tuple[int, int, int] | None) -> _Layer:
        if name not in self._layers:
            depth = DEPTHS[name.split("/")[0]] * float(self.frame.size.max())
            self._layers[name] = _Layer(self._pv, depth)
            self._plotter.renderer.AddActor(self._layers[name].actor)
        if colour is not None:
            self._layers[name].actor.prop.color = [c / 255.0 for c in colour]
        return self._layers[name]


class _Layer:
    """One mesh at one depth."""

    def __init__(self, pv: object, depth: float) -> None:
        self._pv, self._depth = pv, depth
        self.mesh = pv.PolyData()  # type: ignore[attr-defined]
        self.actor = pv.Actor(mapper=pv.DataSetMapper(self.mesh))  # type: ignore[attr-defined]
        self.actor.prop.lighting = False
        self.actor.mapper.scalar_visibility = False

    def width(self, pixels: float) -> None:
        self.actor.prop.line_width = pixels

    def replace(self, points: np.ndarray, faces: np.ndarray | None = None, lines: np.ndarray | None = None) -> None:
        self.actor.visibility = len(points) > 0
        if len(points) == 0:
            return
        cells = {"faces": None if faces is None else faces.ravel(), "lines": None if lines is None else lines.ravel()}
        self.mesh = self._pv.PolyData(self._lifted(points), **cells)  # type: ignore[attr-defined]
        self.actor.mapper.dataset = self.mesh

    def move(self, points: np.ndarray) -> None:
        self.mesh.points[:, :2] = points
        self.mesh.GetPoints().Modified()
        self.mesh.Modified()

    def colour(self, colours: np.ndarray) -> None:
        self.mesh.point_data["colour"] = colours
        self.mesh.point_data.active_scalars_name = "colour"
        self.actor.mapper.scalar_visibility = True
        self.actor.mapper.SetColorModeToDirectScalars()

    def _lifted(self, points: np.ndarray) -> np.ndarray:
        return np.column_stack([points, np.full(len(points), self._depth)])
