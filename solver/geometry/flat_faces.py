"""Flat faces: one face of neighbouring ones in one plane."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from solver.tolerances import CORNER_TOLERANCE

from .solids import cross

#: Neighbouring faces within the flatness of one plane are one face where their normals differ by less than this cosine;
#: slivers, whose normals are rounding, are not asked.
ONE_WAY = 0.999

#: A face smaller than this fraction of its neighbour is a sliver; it belongs to the plane of the neighbour if it is no
#: farther out of it than this fraction of the diagonal of the block.
SLIVER = 1e-6


def edges_of(face: Sequence[int]) -> list[tuple[int, int]]:
    """Pairs of corners that follow each other around a face."""
    return [(face[k - 1], face[k]) for k in range(len(face))]


def renumbered(vertices: np.ndarray, faces: list[list[int]]) -> tuple[np.ndarray, list[list[int]]]:
    """Leave out the corners of no face."""
    used = sorted({corner for face in faces for corner in face})
    place = {corner: k for k, corner in enumerate(used)}
    return vertices[used], [[place[corner] for corner in face] for face in faces]


def merged_faces(surface: tuple[np.ndarray, list[list[int]]], flatness: float) -> tuple[np.ndarray, list[list[int]]]:
    """One face of neighbouring ones in one plane, up to the flatness [m], and no corner in the middle of an edge."""
    vertices, faces = surface
    arms = (vertices[face[1:]] - vertices[face[0]] for face in faces)
    areas = np.array([cross(arm[:-1], arm[1:]).sum(axis=0) / 2.0 for arm in arms])
    sizes = np.linalg.norm(areas, axis=1)
    owner = {edge: k for k, face in enumerate(faces) for edge in edges_of(face)}
    corners, starts = np.concatenate(faces), np.cumsum([0, *map(len, faces[:-1])])
    group = [-1] * len(faces)
    sliver_flatness = SLIVER * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    loops: list[list[int]] = []
    for seed in np.argsort(-sizes, kind="stable").tolist():
        if group[seed] >= 0:
            continue
        group[seed] = seed
        members, queue = [seed], [seed]
        normal, middle = areas[seed] / max(sizes[seed], 1e-300), vertices[faces[seed]].mean(axis=0)
        sliver, out = sizes <= SLIVER * sizes[seed], np.abs((vertices - middle) @ normal)
        flat = np.maximum.reduceat(out[corners], starts) <= np.where(sliver, sliver_flatness, flatness)
        same = (flat & (sliver | (areas @ normal > ONE_WAY * sizes))).tolist()
        while queue:
            for a, b in edges_of(faces[queue.pop()]):
                other = owner[b, a]
                if group[other] < 0 and same[other]:
                    group[other] = seed
                    members.append(other)
                    queue.append(other)
        outline = _outline([faces[k] for k in members])
        loops += [faces[k] for k in members] if outline is None else [outline]
    return renumbered(vertices, _without_straight_corners(vertices, loops))


def _outline(faces: list[list[int]]) -> list[int] | None:
    """Corners around faces that lie side by side; None where these do not form one simple loop."""
    edges = {edge for face in faces for edge in edges_of(face)}
    following = {a: b for a, b in edges if (b, a) not in edges}
    if not following or len(following) != sum((b, a) not in edges for a, b in edges):
        return None
    loop = [next(iter(following))]
    while following[loop[-1]] != loop[0]:
        loop.append(following[loop[-1]])
    return loop if len(loop) == len(following) else None


def _without_straight_corners(vertices: np.ndarray, faces: list[list[int]]) -> list[list[int]]:
    """Leave out corners between two faces only, in the middle of a straight edge."""
    count = np.bincount([corner for face in faces for corner in face], minlength=len(vertices))
    for corner in np.flatnonzero(count == 2).tolist():
        face = next(face for face in faces if corner in face)
        k = face.index(corner)
        before, after = vertices[face[k - 1]], vertices[face[(k + 1) % len(face)]]
        along = after - before
        length = float(np.linalg.norm(along))
        away = float(np.linalg.norm(cross(vertices[corner] - before, along)))
        if away <= CORNER_TOLERANCE * length**2:
            faces = [[c for c in face if c != corner] for face in faces]
    return [face for face in faces if len(face) > 2]
