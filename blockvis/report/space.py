"""What the page has of blocks in space: polyhedra, joints as faces, and what lies on them."""

from __future__ import annotations

from typing import Any

import numpy as np

import solver
from blockvis.pictures import palette
from blockvis.pictures.backfill import FillBodies, fill_bodies
from blockvis.pictures.solid_view import chosen_view
from blockvis.pictures.surface import sharp_edges, triangles_of
from blockvis.pictures.swing import Swing
from blockvis.results.joint_faces import initial_joints

from .frames import model_of_frames
from .packing import FINENESS, deflated, rounded


def model_in_space(response: solver.Response, swing: Swing, shown: list[solver.Increment]) -> dict[str, Any]:
    """Pack what only blocks in space have; the mechanism decides where the page looks from."""
    assembly, shapes = response.assembly, response.assembly.polyhedra
    view = chosen_view(response, swing.displaced.positions - swing.increment.pose.positions)
    joints = initial_joints(assembly)
    bodies = [fill_bodies(response, increment.pose, increment.fallen) for increment in shown]
    heads = np.concatenate([fill.heads.reshape(-1, 3) for fill in bodies])
    model = model_of_frames(response, joints, shown, heads)
    triangles, _ = triangles_of(shapes)
    edges, rings = sharp_edges(shapes), joints.rings
    corners = rounded(rings.points - np.array(model["origin"]), model["unit"])
    return model | {
        "view": np.radians([view.around, view.above]).tolist(),
        "cracks": list(map(palette.hexadecimal, palette.CRACKS)),
        "fill": _fill(bodies, np.array(model["origin"])) if response.loads.fills else None,
        "packed": model["packed"]
        | {
            "offsets": deflated(shapes.offsets),
            "triangles": deflated(triangles),
            "edges": deflated(edges),
            "ring_first": deflated(rings.offsets),
            "ring_points": deflated(corners),
            "ring_normals": deflated(rounded(joints.normals, FINENESS)),
        },
    }


def _fill(bodies: list[FillBodies], origin: np.ndarray) -> dict[str, Any]:
    """Give the edges of the bodies of fill, frame after frame: both ends of each [m]."""
    return {
        "edges": [np.round(fill.rims() - origin, 4).reshape(-1, 6).tolist() for fill in bodies],
        "words": "",
        "colours": [palette.hexadecimal(c) for c in (palette.FILL, palette.FILL_RIM, palette.FILL_RIM)],
    }
