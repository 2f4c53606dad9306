"""A script for ParaView that opens the results folder and colours it as the pictures do."""

from __future__ import annotations

import os
from pathlib import Path
from string import Template

from blockvis.system.atomic_files import write_atomic

from . import palette
from .solid_view import ABOVE, AROUND, View

_SCRIPT = Template('''\
"""Opens these results in ParaView: View > Python Shell > Run Script, or paraview --script=paraview_colours.py

It opens at the last equilibrium. Blocks are coloured by macro-block, the parts that move together in the motion that
follows; joints that open by more than 2 % of the widest are lines, the wider and the redder the more they open [m];
hinges and sliding points by state, with arrows of the contact forces [N]; ties that are whole are green. Cells are
triangulated first: ParaView fills bent polygons wrongly otherwise. Blocks in space are as of glass, so that the faces
of open joints are seen.
"""

import os

from paraview.simple import *

here = os.path.dirname(os.path.abspath(__file__)) if "__file__" in globals() else os.getcwd()
view = GetActiveViewOrCreate("RenderView")
view.Background = [1.0, 1.0, 1.0]
view.UseColorPaletteForBackground = 0
view.OrientationAxesVisibility = 0


def legend(colours, title, corner, length):
    bar = GetScalarBar(colours, view)
    bar.Title, bar.ComponentTitle = title, ""
    bar.TitleColor = bar.LabelColor = [0.1, 0.1, 0.1]
    bar.TitleFontSize = bar.LabelFontSize = 12
    bar.WindowLocation, bar.ScalarBarLength = corner, length
    return bar


blocks = OpenDataFile(os.path.join(here, "blocks.pvd"))
contacts = OpenDataFile(os.path.join(here, "contacts.pvd"))
joints = OpenDataFile(os.path.join(here, "joints.pvd"))
RenameSource("blocks", blocks)
RenameSource("joints", joints)
RenameSource("contact points", contacts)
scene = GetAnimationScene()
scene.UpdateAnimationUsingDataTimeSteps()
times = list(blocks.TimestepValues) if hasattr(blocks.TimestepValues, "__len__") else [blocks.TimestepValues]
last = times[-1] if times else 0.0
scene.AnimationTime = last
UpdatePipeline(last, blocks)
UpdatePipeline(last, contacts)
UpdatePipeline(last, joints)
x0, x1, y0, y1, z0, z1 = blocks.GetDataInformation().GetBounds()
in_space = z1 - z0 > 0.0
view.InteractionMode = "3D" if in_space else "2D"

surface = ExtractSurface(Input=blocks)
RenameSource("blocks, surface", surface)
filled = Triangulate(Input=surface)
RenameSource("blocks, filled", filled)
faces = Show(filled, view)
faces.Representation = "Surface"
faces.Ambient, faces.Diffuse, faces.Specular = (0.5, 0.6, 0.0) if in_space else (1.0, 0.0, 0.0)
faces.Opacity = 0.45 if in_space else 1.0
ColorBy(faces, ("CELLS", "macro_block"))
UpdatePipeline(last, filled)
parts = int(filled.CellData["macro_block"].GetRange()[1]) + 1
tints = [$tints]
bodies = GetColorTransferFunction("macro_block")
bodies.InterpretValuesAsCategories = 1
bodies.AnnotationsInitialized = 1
bodies.Annotations = ["-1", "at rest"] + [word for k in range(parts) for word in (str(k), "part " + str(k + 1))]
bodies.IndexedColors = [$rest] + [c for k in range(parts) for c in tints[3 * (k % (len(tints) // 3)):][:3]]
faces.SetScalarBarVisibility(view, 0 < parts <= 8)
if 0 < parts <= 8:
    legend(bodies, "macro-block", "Lower Right Corner", 0.25)

edges = ExtractEdges(Input=blocks)
RenameSource("outlines", edges)
outlines = Show(edges, view)
ColorBy(outlines, None)
outlines.AmbientColor = outlines.DiffuseColor = [$outline]
outlines.LineWidth = 1.0

widest = joints.CellData["opening"].GetRange()[1] if joints.CellData.GetNumberOfArrays() else 0.0
openings = GetColorTransferFunction("opening")
openings.RGBPoints = [$cracks]
openings.ColorSpace = "RGB"
for share, above, width in ((0.02, 0.1, 1.5), (0.1, 0.3, 3.0), (0.3, 0.6, 5.0), (0.6, 1.0, 8.0)):
    cracks = Threshold(Input=joints, Scalars=["CELLS", "opening"])
    cracks.LowerThreshold, cracks.UpperThreshold = max(share * widest, 1e-9), max(above * widest, 1e-9)
    RenameSource("joints open by more than %.3g mm" % (1000.0 * share * widest), cracks)
    lines = Show(cracks, view)
    lines.LineWidth = width
    ColorBy(lines, ("CELLS", "opening"))
lines.SetScalarBarVisibility(view, True)
openings.RescaleTransferFunction(0.0, max(widest, 1e-9))
crack_bar = legend(openings, "opening [m]", "Lower Left Corner", 0.35)
crack_bar.AutomaticLabelFormat, crack_bar.LabelFormat, crack_bar.RangeLabelFormat = 0, "%.3g", "%.3g"

carrying = Threshold(Input=contacts, Scalars=["POINTS", "state"])
carrying.LowerThreshold, carrying.UpperThreshold = 1.0, 3.0
RenameSource("contact points that carry force", carrying)
moving = Threshold(Input=contacts, Scalars=["POINTS", "state"])
moving.LowerThreshold, moving.UpperThreshold = 2.0, 3.0
RenameSource("hinges and sliding points", moving)
points = Show(moving, view)
points.Representation = "Points"
points.PointSize = 5.0
ColorBy(points, ("POINTS", "state"))
states = GetColorTransferFunction("state")
states.InterpretValuesAsCategories = 1
states.Annotations = ["0", "open", "1", "sticking", "2", "sliding", "3", "hinging"]
states.IndexedColors = [$open, $sticking, $sliding, $hinge]
points.SetScalarBarVisibility(view, True)
legend(states, "contact", "Upper Right Corner", 0.25)

forces = Glyph(Input=carrying, GlyphType="Arrow")
forces.OrientationArray, forces.ScaleArray = ["POINTS", "force"], ["POINTS", "force"]
UpdatePipeline(last, carrying)
normal = carrying.PointData["normal_force"].GetRange() if carrying.PointData.GetNumberOfArrays() else (0.0, 0.0)
largest = max(abs(force) for force in normal)
forces.ScaleFactor = 0.1 * (x1 - x0) / largest if largest > 0 else 1.0
forces.GlyphMode = "All Points"
RenameSource("contact forces", forces)
arrows = Show(forces, view)
arrows.ColorArrayName = ["POINTS", ""]
arrows.AmbientColor = arrows.DiffuseColor = [$force]
arrows.Ambient, arrows.Diffuse = 1.0, 0.0

if os.path.exists(os.path.join(here, "ties.pvd")):
    present = Threshold(Input=OpenDataFile(os.path.join(here, "ties.pvd")), Scalars=["CELLS", "state"])
    present.LowerThreshold, present.UpperThreshold = 1.0, 3.0
    RenameSource("ties that are there and whole", present)
    members = Show(present, view)
    members.LineWidth = 5.0
    ColorBy(members, None)
    members.AmbientColor = members.DiffuseColor = [$tie]

if in_space:
    view.CameraParallelProjection = 1
    view.CameraFocalPoint = [(x0 + x1) / 2.0, (y0 + y1) / 2.0, (z0 + z1) / 2.0]
    view.CameraPosition = [at + far for at, far in zip(view.CameraFocalPoint, [$eye])]
    view.CameraViewUp = [0.0, 0.0, 1.0]
ResetCamera(view)
Render(view)
''')


def write_paraview_macro(folder: str | os.PathLike[str]) -> Path:
    """Write ``paraview_colours.py`` into a results folder, beside the files that it opens."""
    path = Path(folder) / "paraview_colours.py"
    text = _SCRIPT.substitute(
        tints=", ".join(f"{v / 255.0:.4f}" for v in palette.PARTS.ravel()),
        rest=_fractions(palette.DRAWN),
        outline=_fractions(palette.OUTLINE),
        open=_fractions(palette.OPEN),
        cracks=", ".join(f"{k / 2.0}, {_fractions(palette.rgb(colour))}" for k, colour in enumerate(palette.CRACKS)),
        sticking=_fractions(palette.FAINT),
        sliding=_fractions(palette.SLIDING),
        hinge=_fractions(palette.HINGE),
        force=_fractions(palette.FORCE),
        tie=_fractions(palette.TIE),
        eye=", ".join(f"{component:.4f}" for component in View(AROUND[0], ABOVE).axes[2]),
    )
    return write_atomic(path, text)


def _fractions(colour: tuple[int, int, int]) -> str:
    return ", ".join(f"{c / 255.0:.4f}" for c in colour)
