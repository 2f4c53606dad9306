"""The scene in space: blocks and marks as meshes, drawn by VTK without a window, frame after frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np
import pyvista as pv
from matplotlib.path import Path
from matplotlib.transforms import Affine2D
from PIL import Image
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkFloatArray
from vtkmodules.vtkCommonDataModel import vtkPlane

import solver
from solver import mechanics

from . import palette
from .backfill import FillBodies
from .frame import Frame, along_lines, framed, room_in
from .marks import SHORTEST_ARROW, Marks, arrow_shapes
from .painting import painted
from .scene import Scene
from .solid_view import ABOVE, AROUND, View, heights_over, kept_blocks, showing_faces
from .surface import section_of, sharp_edges, triangles_of
from .swing import MOST_PARTS, Swing
from .ties import DASH, Strands, dashed

#: What is seen lies nearer than this part of the picture's size to the point that is looked for.
SAME_DEPTH = 0.005

#: Layers by how far in front of what lies at the same place they are drawn; what is in front of all hides nothing.
IN_FRONT_OF_ALL = 1_000_000.0

#: Layers that are drawn in front of all, as ties are by their dashes.
OVER_BLOCKS = ("force", "crushing", "tie")

#: Points of a triangle that are looked for, as parts (n, 3) of its corners: of what is nearly hidden a corner is seen.
_INSIDE = np.array([(i, j, 8 - i - j) for i in range(9) for j in range(9 - i)]) / 8.0 * 0.94 + 0.02


@dataclass(frozen=True)
class _Arrows:
    """Arrows from tails (n, 3) [m] to tips (n, 3) [m], all of them or those that hide no deeper than ``within`` [m]."""

    tails: np.ndarray
    tips: np.ndarray
    colour: tuple[int, int, int]
    within: float | None = None


class SolidScene(Scene):
    """Blocks in space and their marks, in colours (n_blocks, 3) uint8.

    A ``fine`` scene has smooth edges and the shade of corners, which stills are worth. A cut (2, 3) is a point [m] of a
    plane and its unit normal towards what is kept. Of ``outlined`` blocks, (n_blocks,) bool, the edges alone are drawn,
    in their colours. Hidden hinges are dashed over the blocks; ``outline`` is the colour of the edges.
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
        fine: bool = False,
        cut: np.ndarray | None = None,
        outlined: np.ndarray | None = None,
        hidden_hinges: bool = True,
        outline: tuple[int, int, int] = palette.OUTLINE,
    ) -> None:
        super().__init__(assembly, frame, size)
        self.view = view
        # A still is drawn twice as large, to be made smaller.
        self._over = 2 if fine else 1
        self._plotter = _plotter((self._over * size[0], self._over * size[1]))
        if fine and opacity == 1.0:
            extent = float(framed(assembly, [solver.Pose.initial(assembly)], axes=view.axes[:2]).size.max())
            # Depths are rounded by the whole, which wide supports make larger than what is shown.
            whole = max(extent, float(np.ptp(assembly.vertices, axis=0).max()))
            # A hair of it keeps plane faces free of grain.
            self._plotter.enable_ssao(radius=0.1 * extent, bias=0.008 * whole, kernel_size=16)
        self._hidden_hinges = hidden_hinges
        #: Diagonal of the largest support [m].
        self._support = _largest_support(assembly)
        self._layers: dict[str, Any] = {}
        self._overlays: dict[str, _Arrows] = {}
        self._look_at()
        self._cut = cut
        #: Cut faces (n, 3) [m], and the block of each.
        self._sections: list[tuple[np.ndarray, int]] = []
        self._outlined = np.zeros(assembly.n_blocks, dtype=bool) if outlined is None else outlined
        self._triangles, self._block = triangles_of(assembly.polyhedra)
        solid = ~self._outlined[self._block]
        self._faced, self._fill = self._block[solid], block_fill
        self._surface = pv.PolyData.from_regular_faces(np.array(assembly.vertices), self._triangles[solid])
        self._surface.cell_data["colour"] = block_fill[self._faced]
        surface = self._plotter.add_mesh(
            self._surface, scalars="colour", rgb=True, ambient=0.58, diffuse=0.5, specular=0.0,
            interpolation="flat", opacity=opacity, reset_camera=False, render=False, show_scalar_bar=False,
        )  # fmt: skip
        self._clip(surface)
        #: (n, 2) int array: vertices at both ends of the edges that are drawn.
        self.edges = sharp_edges(assembly.polyhedra)
        traced = self._outlined[assembly.block_of_vertex[self.edges[:, 0]]]
        self._edges, self._traces = (
            pv.PolyData(np.array(assembly.vertices), lines=pv.CellArray.from_regular_cells(self.edges[of]))
            for of in (~traced, traced)
        )
        self._shadow: pv.PolyData | None = None
        # Height of the ground of a fall, vertices of supports, and those under what stands on it.
        self._floor, self._held, self._feet = -np.inf, np.zeros(0, dtype=int), np.zeros(0, dtype=int)
        width = float(np.clip(assembly.block_size / self.pixel / 40.0, 0.6, self.usual_height / 700.0))
        self._add("edges", self._edges, outline, width=width, forward=1.0)
        if traced.any():
            # What is seen of a block by its edges alone has its colour there.
            self._add("traces", self._traces, block_fill[assembly.block_of_vertex], width=2.0 * width, forward=1.0)

    def pose(self, shown: solver.Pose, block_fill: np.ndarray | None = None) -> None:
        """Put the blocks where they are drawn, in new colours (n_blocks, 3) uint8 where these are given."""
        corners = mechanics.moved_vertices(self.assembly, shown)
        # What lies in the ground is not seen: where the ground ends it would be.
        corners[self._held, 2] = np.maximum(corners[self._held, 2], self._floor)
        corners[self._feet, 2] = self._floor
        # Of what ends in the plane of a section its faces there would stay, as sheets.
        gone, owner = self._gone | ~kept_blocks(self._cut, self.assembly, shown), self.assembly.block_of_vertex
        if gone.any():
            # What is a point has no faces to draw.
            corners = np.where(gone[owner][:, None], shown.positions[owner], corners)
        self._surface.points = corners
        self._edges.points = self._traces.points = corners
        if self._shadow is not None:
            left = self._surface
            if self._cut is not None:
                # What the section leaves out throws none: the halves that are left would seem to float.
                left = left.clip(normal=-self._cut[1], origin=self._cut[0]).triangulate()
            self._shadow.copy_from(pv.PolyData(left.points * (1.0, 1.0, 0.0) + (0.0, 0.0, self._floor), left.faces))
        if block_fill is not None:
            self._fill = block_fill
            self._surface.cell_data["colour"] = block_fill[self._faced]
        if self._cut is not None:
            outlines, owners = section_of(corners, self._triangles, self._block, *self._cut)
            edges = [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in outlines]
            ends = np.concatenate([np.zeros((0, 2, 3)), *edges])
            self.lines("section edge", ends, palette.INK, max(2.0 * self._thin, 1.2), forward=2.0)
            faces = [ring for ring, owner in zip(outlines, owners.tolist(), strict=True) if not self._outlined[owner]]
            owners = owners[~self._outlined[owners]]
            # Cut faces are darker than the faces of their blocks.
            shades = (0.82 * self._fill[owners]).astype(np.uint8)
            colours = np.repeat(shades, [len(face) for face in faces], axis=0)
            self.polygons("section", faces, colours, forward=1.0)
            self._sections = list(zip(faces, owners.tolist(), strict=True))

    def backfill(self, bodies: FillBodies) -> None:
        """Draw the edges of the bodies of fill."""
        self.lines("backfill", bodies.rims(), palette.FILL_RIM, max(2.0 * self._thin, 1.2))

    def show_ground(self, height: float) -> None:
        """Draw the ground of a fall, ``height`` [m], with the shadows of the blocks under a light from above.

        It is under the middle of what stands, has no end but fades, and lies behind all, as nothing is below it:
        supports end in it, and those below the structure reach down to it, which are ground as well.
        """
        corners, radius = self.assembly.vertices[:, :2], 0.75 * float(self.frame.size.max())
        stands = corners[self.assembly.free[self.assembly.block_of_vertex]]
        middle = (stands.min(axis=0) + stands.max(axis=0)) / 2.0
        plane = pv.Disc(center=(*middle, height), inner=0.0, outer=radius, normal=(0, 0, 1), r_res=48, c_res=96)
        away = np.linalg.norm(plane.points[:, :2] - middle, axis=1) / radius
        # It fades from 0.45 of its radius on.
        left = np.clip((1.0 - away) / 0.55, 0.0, 1.0)[:, None] ** 2
        colours = np.rint(left * palette.GROUND + (1.0 - left) * palette.PAPER)
        self._add("earth", plane, colours, forward=-IN_FRONT_OF_ALL)
        shadow = self._surface.copy()
        shadow.clear_data()
        shadow.points = self.assembly.vertices * (1.0, 1.0, 0.0) + (0.0, 0.0, height)
        self._add("earth/shadow", shadow, palette.SHADOW, forward=10.0 - IN_FRONT_OF_ALL)
        self._shadow, self._floor, self._feet = shadow, height, _feet(self.assembly, self._ground)
        self._held = np.flatnonzero(~self.assembly.free[self.assembly.block_of_vertex])

    def lines(
        self,
        layer: str,
        ends: np.ndarray,
        colour: tuple[int, int, int] | np.ndarray,
        width: float,
        forward: float = 2.0,
    ) -> None:
        """Draw lines, ends (n, 2, 3) [m], ``width`` pixels wide, in one layer, instead of those before.

        They have one colour, or one at each end, (n, 2, 3) uint8, and are so far in front of what lies at the same
        place.
        """
        points = np.asarray(ends, dtype=float).reshape(-1, 3)
        self.clear(layer)
        if len(points):
            mesh = pv.PolyData(points, lines=pv.CellArray.from_regular_cells(np.arange(len(points)).reshape(-1, 2)))
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

        They have one colour, or one at each corner, (n_points, 3) uint8.
        """
        self.clear(layer)
        if len(polygons):
            counts = np.array([len(polygon) for polygon in polygons])
            points = np.concatenate(list(polygons))
            faces = np.insert(np.arange(len(points)), np.cumsum(counts) - counts, counts)
            self._add(layer, pv.PolyData(points, faces=faces), colour, forward=forward)

    def cracks(self, found: Marks, magnification: float) -> None:
        """Draw the rims of what is open, all alike: of a hairline they fall into one line, a gap shows between them."""
        rims = np.concatenate([found.cracks[:, [0, 1]], found.cracks[:, [3, 2]]])
        self.lines("crack", rims, palette.OPEN, max(3.0 * self._thin, 1.4), forward=2.0)

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
        if not self._hidden_hinges:
            return
        dashes = dashed(found.hinges, 24.0 * max(self._thin, 0.6) * self.pixel)
        self.lines("hidden hinge", dashes, palette.HINGE, 0.22 * width, forward=IN_FRONT_OF_ALL)

    def crushing(self, found: Marks) -> None:
        """Draw discs with a dark rim in front of all: they are few, and say where it fails."""
        radius = 9.0 * self._thin * self.pixel
        for layer, grown, colour in (("crushing", 1.35, palette.HINGE), ("crushing top", 1.0, palette.CRUSHING)):
            rims = found.crushing[:, None] + grown * radius * self._circle
            self.polygons(layer, rims, colour, forward=IN_FRONT_OF_ALL + grown - 1.35)

    def forces(self, ends: np.ndarray, line: np.ndarray) -> None:
        """Draw bars and the line of thrust in front of all: they lie inside the blocks."""
        width = max(2.5, self.usual_height / 240.0)
        self.lines("force", ends, palette.FORCE, width, forward=IN_FRONT_OF_ALL)
        self.lines("force line", line, palette.FORCE, 0.6 * width, forward=IN_FRONT_OF_ALL)

    @property
    def _circle(self) -> np.ndarray:
        """(16, 3) array: a unit circle that faces the eye."""
        angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
        return np.asarray(np.stack([np.cos(angles), np.sin(angles)], axis=1) @ self.view.axes[:2])

    def ties(self, strands: Sequence[Strands]) -> None:
        """Draw lines and discs where they are held, thin and dashed in front of the blocks that hide them."""
        for strand in strands:
            width = max(strand.width * self._thin, 1.6)
            radius = (0.9 * width + 2.0 * self._thin) * self.pixel
            self.lines(strand.layer, strand.ends, strand.colour, width, forward=6.0)
            self.polygons(
                f"tie end/{strand.layer}", strand.anchors[:, None] + radius * self._circle, strand.colour, forward=6.0
            )
            hidden = dashed(strand.ends, DASH * max(self._thin, 0.6) * self.pixel)
            self.lines(f"hidden {strand.layer}", hidden, strand.colour, 0.35 * width, forward=IN_FRONT_OF_ALL)

    def arrows(self, layer: str, tails: np.ndarray, tips: np.ndarray, colour: tuple[int, int, int]) -> None:
        """Draw arrows from tails (n, 3) [m] to tips (n, 3) [m] over all: none is hidden behind its own support."""
        # Of many supports those behind the structure would seem to push what is in front of them.
        self._overlays[f"{layer} top"] = _Arrows(tails, tips, colour, self._support if layer == "arrow" else None)

    def show_motion(self, swing: Swing, tails: np.ndarray, tips: np.ndarray) -> solver.Pose:
        """Draw the edges of where few parts of a mechanism were; the blocks go where it takes them."""
        if swing.n_parts <= MOST_PARTS:
            edges = mechanics.moved_vertices(self.assembly, swing.increment.pose)[self.edges]
            moving = (swing.parts >= 0)[self.assembly.block_of_vertex[self.edges[:, 0]]]
            self.lines("before", edges[moving], palette.GHOST, self.usual_height / 900.0)
        # Longer than the way that is drawn, to be seen on the blocks.
        self.arrows("motion", tails, tips + 0.6 * (tips - tails), palette.SETTLEMENT)
        if swing.n_parts > MOST_PARTS:
            # Of many blocks those behind others would seem to be the ways of what is in front of them.
            self._overlays["motion top"] = replace(self._overlays["motion top"], within=self.assembly.block_size)
        return swing.displaced

    def clear(self, *layers: str) -> None:
        """Remove layers."""
        for name in layers:
            self._overlays.pop(name, None)
            if name in self._layers:
                self._plotter.remove_actor(self._layers.pop(name), reset_camera=False, render=False)

    def holds(self, *layers: str) -> bool:
        """Whether the last picture shows anything of one of the layers; of hidden lines, whether blocks hide any.

        Supports that move are the layer "moving".
        """
        if any(next(self._shapes(self._overlays[layer]), None) for layer in layers if layer in self._overlays):
            return True
        if "moving" in layers and self._shows_blocks(self.assembly.moving & ~self._gone):
            return True
        return any(self._shows(name) for name in self._layers if name.split("/")[0] in layers)

    def _shows_blocks(self, blocks: np.ndarray) -> bool:
        """Whether the last picture shows anything of blocks, (n_blocks,) bool array."""
        corners, traced = np.asarray(self._surface.points), blocks & self._outlined
        lines = along_lines(corners[self.edges[traced[self.assembly.block_of_vertex[self.edges[:, 0]]]]])
        faces = corners[self._triangles[(blocks & ~self._outlined)[self._block]]]
        sections = [0.98 * face + 0.02 * face.mean(axis=0) for face, block in self._sections if blocks[block]]
        points, lines = map(self._in_picture, (np.concatenate([(_INSIDE @ faces).reshape(-1, 3), *sections]), lines))
        # Not all that is seen: blocks of glass have no depth.
        in_front = self._hidden_by(points) >= SAME_DEPTH * self.frame.size.max()
        return not (in_front.all() and self.hides(lines, 1.0).all())

    def _in_picture(self, points: np.ndarray) -> np.ndarray:
        """Choose those of points (n, 3) [m] that the section leaves and that lie in the picture, hidden or not."""
        places = self.at_pixel(points)
        inside = ((places >= 0.0) & (places < self.size)).all(axis=1)
        return points[inside & (heights_over(self._cut, points) >= -SAME_DEPTH * self.frame.size.max())]

    def _shows(self, layer: str) -> bool:
        actor = self._layers[layer]
        points = along_lines(np.asarray(actor.mapper.dataset.points).reshape(-1, 2, 3))
        points = points[heights_over(self._cut, points) >= 0.0]
        if layer.startswith(OVER_BLOCKS):
            return len(points) > 0
        hidden = self.hides(points, actor.prop.line_width / self._over)
        return bool(hidden.any() if layer.startswith("hidden") else not hidden.all())

    def image(self) -> Image.Image:
        """Draw the picture."""
        with pv.vtk_verbosity("error"):
            self._plotter.render()
            pixels = self._plotter.screenshot(return_img=True)
        picture = Image.fromarray(np.ascontiguousarray(pixels[..., :3]))
        if self._over > 1:
            picture = picture.reduce(self._over)
        shapes = [shape for arrows in self._overlays.values() for shape in self._shapes(arrows)]
        upright = Affine2D().scale(1.0, -1.0).translate(0.0, picture.size[1])
        # Free blocks end before the strip that fades.
        return painted(_fading(picture, round(0.028 * min(picture.size))), shapes, upright)

    def _shapes(self, arrows: _Arrows) -> Iterator[tuple[tuple[int, int, int], float, float, Path]]:
        """Yield arrows in the last picture [pixels] with a white rim, as :func:`painted` takes them."""
        tails, tips = arrows.tails, arrows.tips
        if arrows.within is not None and len(tails):
            seen = self._hidden_by(tails) < arrows.within
            # One that is hidden still says where a single support goes.
            tails, tips = (tails[seen], tips[seen]) if seen.any() else (tails, tips)
        thick = self.usual_height / 130.0
        start, end = self.at_pixel(tails), self.at_pixel(tips)
        for grown, colour in ((0.35 * thick, palette.PAPER), (0.0, arrows.colour)):
            for polygon in chain(*arrow_shapes(start, end, thick, grown)):
                yield colour, 0.0, 1.0, Path(polygon)
        long = np.linalg.norm(tips - tails, axis=1) > SHORTEST_ARROW * thick * self.pixel
        for k in np.flatnonzero(long & (np.hypot(*(end - start).T) <= SHORTEST_ARROW * thick)):
            # Seen from its end, the point of an arrow is a dot and its tail a cross.
            yield palette.PAPER, 0.0, 1.0, Path.circle(end[k], 1.8 * thick)
            yield arrows.colour, 0.5 * thick, 1.0, Path.circle(end[k], 1.3 * thick)
            if self.view.depth(tips[[k]])[0] > self.view.depth(tails[[k]])[0]:
                yield arrows.colour, 0.0, 1.0, Path.circle(end[k], 0.5 * thick)
            else:
                corners = 0.9 * thick * np.array([[-1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [1.0, -1.0]])
                yield arrows.colour, 0.5 * thick, 1.0, Path(end[k] + corners, [Path.MOVETO, Path.LINETO] * 2)

    def at_pixel(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) array: pixel (column, row) of points (n, 3) [m]."""
        return super().at_pixel(self.view.projected(points))

    def sees(self, points: np.ndarray) -> np.ndarray:
        """(n,) bool array: which points (n, 3) [m] on the blocks nothing hides in the last picture."""
        return np.asarray(np.abs(self._hidden_by(points)) < SAME_DEPTH * self.frame.size.max())

    def hides(self, points: np.ndarray, thick: float) -> np.ndarray:
        """(n,) bool array: which points (n, 3) [m] of lines ``thick`` pixels wide the last picture hides altogether.

        Of lines along a silhouette half is seen.
        """
        aside = self.pixel * max(0.5 * thick, 1.0) * self.view.axes[:2]
        beside = np.concatenate([np.zeros((1, 3)), aside, -aside])
        hidden = self._hidden_by((points + beside[:, None]).reshape(-1, 3)).reshape(len(beside), -1)
        return np.asarray((hidden >= SAME_DEPTH * self.frame.size.max()).all(axis=0))

    def _hidden_by(self, points: np.ndarray) -> np.ndarray:
        """(n,) array [m]: how far before points (n, 3) [m] what is seen at their pixels lies; nothing lies at -inf."""
        buffer, window = vtkFloatArray(), self._plotter.render_window
        width, height = window.GetSize()
        # PyVista's own depth image draws everything once more.
        window.GetZbufferData(0, 0, width - 1, height - 1, buffer)
        part = vtk_to_numpy(buffer).reshape(height, width)[::-1]
        near, far = self._plotter.camera.clipping_range
        depth = np.where(part < 1.0, -near - part * (far - near), -np.inf)
        column, row = np.floor(self._over * self.at_pixel(points)).astype(int).T
        inside = (column >= 0) & (row >= 0) & (column < depth.shape[1]) & (row < depth.shape[0])
        found = np.full(len(points), -np.inf)
        found[inside] = depth[row[inside], column[inside]]
        # VTK counts the depth from the eye backwards.
        eye = self.view.depth(np.array(self._plotter.camera.position)[None])[0]
        return np.asarray(found - (self.view.depth(points) - eye))

    def close(self) -> None:
        """Give the memory of the graphics card back."""
        self._plotter.close()

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
    ) -> None:
        look: dict[str, Any] = {"color": tuple(c / 255.0 for c in colour)} if isinstance(colour, tuple) else {}
        if not look:
            mesh.point_data["colour"] = np.asarray(colour, dtype=np.uint8).reshape(-1, 3)
            look = {"scalars": "colour", "rgb": True, "show_scalar_bar": False}
        actor = self._plotter.add_mesh(
            mesh, **look, line_width=self._over * width, lighting=False, reset_camera=False, render=False,
        )  # fmt: skip
        drawn_forward(actor, forward)
        # The cut faces lie in the plane, and their edges; the ground goes on.
        if not layer.startswith(("section", "earth")):
            self._clip(actor)
        self._layers[layer] = actor

    def _clip(self, actor: Any) -> None:
        """Leave out what the section leaves out."""
        if self._cut is not None:
            actor.mapper.AddClippingPlane(vtkPlane(origin=tuple(self._cut[0]), normal=tuple(self._cut[1])))


def blocks_picture(assembly: solver.Assembly, size: tuple[int, int], fill: np.ndarray) -> Image.Image:
    """Draw blocks in space where the layout has them, ``size`` pixels wide and high, in colours (n_blocks, 3) uint8."""
    view = View(AROUND[0], ABOVE)
    frame = framed(assembly, [solver.Pose.initial(assembly)], supports=1.0, axes=view.axes[:2])
    scene = SolidScene(assembly, view, frame, size, fill)
    picture = scene.image()
    scene.close()
    return picture


def seen_faces(scene: SolidScene) -> tuple[np.ndarray, np.ndarray]:
    """Find where the name of each block can stand: on the face that shows most of itself in the last picture.

    Gives the middle of that face, (n_blocks, 3) [m], and its width and height in the picture, (n_blocks, 2) [m]: 0
    where something hides it.
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
    """Draw lines and polygons in front of what lies at their place, by so many hairs."""
    mapper = actor.mapper
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    # In units of the smallest difference of depth, which is some 1e-5 of the distance to the structure.
    mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, -6.0 * by)
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(0.0, -6.0 * by)


def _largest_support(assembly: solver.Assembly) -> float:
    corners, owner = assembly.vertices, assembly.block_of_vertex
    spans = [np.ptp(corners[owner == block], axis=0) for block in np.flatnonzero(~assembly.free)]
    return max((float(np.linalg.norm(span)) for span in spans), default=0.0)


def _feet(assembly: solver.Assembly, ground: np.ndarray) -> np.ndarray:
    """(n,) int array: vertices under the supports that are ground, (n_blocks,) bool."""
    shapes, owner = assembly.polyhedra, assembly.block_of_vertex
    upwards = shapes.faces(shapes.vertices).normals[shapes.face_of_corner, 2]
    # Faces that are rather level than upright.
    down, up = (np.unique(shapes.corners[way * upwards > 0.5]) for way in (-1.0, 1.0))
    return np.setdiff1d(down[ground[owner[down]]], up)


def _plotter(size: tuple[int, int]) -> pv.Plotter:
    """Make a plotter without a window: white, one lamp, several samples a pixel."""
    # VTK draws without a display, and need not say on stderr that there is none.
    with pv.vtk_verbosity("error"):
        plotter = pv.Plotter(off_screen=True, window_size=list(size), lighting="none")
        plotter.background_color = "white"
        plotter.enable_anti_aliasing("msaa", multi_samples=4)
        # Above the left shoulder: to the right, up and to the eye.
        plotter.add_light(pv.Light(position=(-0.45, 0.85, 1.2), light_type="camera light", intensity=1.0))
    return plotter


def _fading(picture: Image.Image, wide: int) -> Image.Image:
    """Let what is cut off at the edges of a picture fade over a strip so many pixels ``wide``."""
    pixels = np.array(picture)
    left = np.arange(wide)[:, None, None] / wide
    for strip in (pixels[:wide], pixels[::-1][:wide], pixels.swapaxes(0, 1)[:wide], pixels.swapaxes(0, 1)[::-1][:wide]):
        strip[...] = np.rint(left * strip + (1.0 - left) * np.array(palette.PAPER))
    return Image.fromarray(pixels)
