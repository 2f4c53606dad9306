"""The lines that moved edges share: fitted to the midlines of their joints; outlines with their edges on such lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .facing_edges import Edges, Facing

#: One line serves several stretches of a joint where it leaves their midlines by no more than this fraction of the
#: gap: far enough from a half, at which an edge would have to move backwards or all the way.
SHARED_LINE = 0.3


@dataclass(frozen=True)
class Line:
    """The line n·x = level that the edges of these stretches share."""

    stretches: list[int]
    normal: np.ndarray
    level: float
    anchored: bool = False

    def distances(self, points: np.ndarray) -> np.ndarray:
        return np.abs(points @ self.normal - self.level)


def common_lines(found: Facing, edges: Edges, still: np.ndarray, closed: float) -> tuple[dict[int, Line], list[int]]:
    """A line for every edge that moves, shared by as many facing edges as one line serves.

    Returns
    -------
    lines : {edge: line}
    uncommon : list of int
        Stretches whose two edges got different lines.

    Notes
    -----
    Stretches are taken longest first; each joins the lines of its two edges into one where a straight fit through
    all their midlines stays within the fraction SHARED_LINE of every gap.
    """
    fixed = {side: still[edges.block[getattr(found, side)]] for side in ("edge_a", "edge_b")}
    middle = found.midline.copy()
    along = edges.along
    for side, chosen in fixed.items():
        edge = getattr(found, side)[chosen]
        t, p = along[edge][:, None, :], edges.start[edge][:, None, :]
        middle[chosen] = p + ((middle[chosen] - p) * t).sum(axis=2, keepdims=True) * t
    gaps = np.abs(found.gaps)
    allowed = SHARED_LINE * gaps + 0.05 * gaps.max(axis=1, keepdims=True) + closed
    allowed[fixed["edge_a"] | fixed["edge_b"]] = closed

    def fit(stretches: list[int], held: list[Line]) -> Line:
        for line in held:
            # A line that serves already stays what it is, to the last digit.
            if line.anchored or (line.distances(middle[stretches]) <= closed).all():
                return Line(stretches, line.normal, line.level, line.anchored)
        points, weights = middle[stretches].reshape(-1, 2), np.repeat(found.lengths[stretches], 2)
        centre = weights @ points / weights.sum()
        normal = np.linalg.svd((points - centre) * np.sqrt(weights)[:, None], full_matrices=False)[2][-1]
        return Line(stretches, normal, float(normal @ centre))

    owner: dict[int, Line] = {}
    uncommon = []
    for k in np.argsort(-found.lengths, kind="stable"):
        pair = int(found.edge_a[k]), int(found.edge_b[k])
        held = [owner[edge] for edge in pair if edge in owner]
        if len(held) == 2 and held[0] is held[1]:
            continue
        for side, edge in zip(("edge_a", "edge_b"), pair, strict=True):
            if fixed[side][k] and edge not in owner:
                normal = np.array([along[edge][1], -along[edge][0]])
                held.append(Line([], normal, float(normal @ edges.start[edge]), True))
        held.sort(key=lambda line: not line.anchored)
        line = fit([*(s for line in held for s in line.stretches), int(k)], held)
        if (line.distances(middle[line.stretches]) <= allowed[line.stretches]).all():
            for s in line.stretches:
                owner[int(found.edge_a[s])] = owner[int(found.edge_b[s])] = line
        else:
            uncommon.append(int(k))
    lonely: dict[int, list[int]] = {}
    for k in uncommon:
        for edge in (int(found.edge_a[k]), int(found.edge_b[k])):
            if edge not in owner and not still[edges.block[edge]]:
                lonely.setdefault(edge, []).append(k)
    owner.update({edge: fit(stretches, []) for edge, stretches in lonely.items()})
    lines = {
        edge: line
        for edge, line in owner.items()
        if (gaps[line.stretches] > closed).any() and not still[edges.block[edge]]
    }
    return lines, uncommon


def moved_outlines(edges: Edges, lines: dict[int, Line], longest: float) -> list[np.ndarray]:
    """Outlines whose edges lie on the given lines; corners where consecutive edges meet."""
    rings = []
    for first, last in zip(edges.offsets[:-1], edges.offsets[1:], strict=True):
        members = list(range(first, last))
        if not any(edge in lines for edge in members):
            rings.append(edges.start[first:last])
            continue
        while True:
            ring, turned = _moved_ring(edges, lines, members, longest)
            if not turned or len(members) - len(turned) < 3:
                break
            # An edge shorter than what its neighbours move vanishes between them.
            members = [edge for edge in members if edge not in turned]
        rings.append(ring)
    return rings


def _moved_ring(
    edges: Edges, lines: dict[int, Line], members: list[int], longest: float
) -> tuple[np.ndarray, list[int]]:
    corners: list[list[np.ndarray]] = []
    for k, edge in enumerate(members):
        before = members[k - 1]
        drawn = (edges.end[before] + edges.start[edge]) / 2.0
        if before not in lines and edge not in lines and (edges.end[before] == edges.start[edge]).all():
            corners.append([drawn])
            continue
        (n0, c0), (n1, c1) = (normal_form(edges, lines, one) for one in (before, edge))
        determinant = n0[0] * n1[1] - n0[1] * n1[0]
        if abs(determinant) > 0.05:
            meeting = np.array([c0 * n1[1] - c1 * n0[1], n0[0] * c1 - n1[0] * c0]) / determinant
            if np.hypot(*(meeting - drawn)) <= longest:
                corners.append([meeting])
                continue
        corners.append([drawn + (c0 - n0 @ drawn) * n0, drawn + (c1 - n1 @ drawn) * n1])
    turned = []
    for k, edge in enumerate(members):
        along = edges.end[edge] - edges.start[edge]
        if (corners[(k + 1) % len(members)][0] - corners[k][-1]) @ along <= 0:
            turned.append(edge)
    return np.array([corner for group in corners for corner in group]), turned


def normal_form(edges: Edges, lines: dict[int, Line], edge: int) -> tuple[np.ndarray, float]:
    if edge in lines:
        return lines[edge].normal, lines[edge].level
    along = edges.end[edge] - edges.start[edge]
    normal = np.array([along[1], -along[0]]) / np.hypot(*along)
    return normal, float(normal @ edges.start[edge])
