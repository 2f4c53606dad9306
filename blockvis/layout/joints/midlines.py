"""Lines that facing edges share, fitted to the midlines of their joints, and outlines with their edges on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .facing_edges import Edges, Facing

#: One line fits several stretches of a joint if it stays within this fraction of the gap of their midlines: well below
#: a half, at which an edge would have to move backwards or across the whole gap.
SHARED_LINE = 0.3


@dataclass(frozen=True)
class Line:
    """The line normal·x = level [m] that edges of some stretches share; anchored, that of an edge that stays."""

    stretches: list[int]
    normal: np.ndarray
    level: float
    anchored: bool = False

    def distances(self, points: np.ndarray) -> np.ndarray:
        """(...) array [m]: distances of (..., 2) points from the line."""
        return np.abs(points @ self.normal - self.level)


def common_lines(found: Facing, edges: Edges, anchored: np.ndarray, closed: float) -> tuple[dict[int, Line], list[int]]:
    """Find a line for every edge that moves, by the edge, and the stretches whose two edges have different lines.

    A gap up to ``closed`` [m] is a rounding error.

    Stretches are taken longest first; each joins the lines of its two edges into one if a straight fit through all
    their midlines stays within the fraction SHARED_LINE of every gap.
    """
    fixed = np.stack([anchored[edges.block[found.edge_a]], anchored[edges.block[found.edge_b]]], axis=1)
    middle = _midlines_on_anchors(found, edges, fixed)
    gaps = np.abs(found.gaps)
    allowed = SHARED_LINE * gaps + 0.05 * gaps.max(axis=1, keepdims=True) + closed
    allowed[fixed.any(axis=1)] = closed
    line_of: dict[int, Line] = {}
    uncommon = []
    for k in np.argsort(-found.lengths, kind="stable"):
        pair = int(found.edge_a[k]), int(found.edge_b[k])
        held = [line_of[edge] for edge in pair if edge in line_of]
        if len(held) == 2 and held[0] is held[1]:
            continue
        held += [
            Line([], *normal_form(edges, {}, edge), True)
            for edge, stays in zip(pair, fixed[k], strict=True)
            if stays and edge not in line_of
        ]
        held.sort(key=lambda line: not line.anchored)
        line = _fitted(found, middle, [*(s for line in held for s in line.stretches), int(k)], held, closed)
        if (line.distances(middle[line.stretches]) <= allowed[line.stretches]).all():
            for s in line.stretches:
                line_of[int(found.edge_a[s])] = line_of[int(found.edge_b[s])] = line
        else:
            uncommon.append(int(k))
    # Edges that share no line have one fitted to their own midlines alone.
    sides, stretches = np.concatenate([found.edge_a[uncommon], found.edge_b[uncommon]]), np.tile(uncommon, 2)
    line_of |= {
        edge: _fitted(found, middle, stretches[sides == edge].tolist(), [], closed)
        for edge in np.unique(sides).tolist()
        if edge not in line_of and not anchored[edges.block[edge]]
    }
    lines = {
        edge: line
        for edge, line in line_of.items()
        if (gaps[line.stretches] > closed).any() and not anchored[edges.block[edge]]
    }
    return lines, uncommon


def _midlines_on_anchors(found: Facing, edges: Edges, fixed: np.ndarray) -> np.ndarray:
    """(n, 2, 2) array [m]: midlines, those beside an edge that stays moved onto this edge."""
    middle = found.midline.copy()
    for edge_of, chosen in ((found.edge_a, fixed[:, 0]), (found.edge_b, fixed[:, 1])):
        edge = edge_of[chosen]
        t, p = edges.directions[edge][:, None, :], edges.start[edge][:, None, :]
        middle[chosen] = p + ((middle[chosen] - p) * t).sum(axis=2, keepdims=True) * t
    return middle


def _fitted(found: Facing, middle: np.ndarray, stretches: list[int], held: list[Line], closed: float) -> Line:
    """One line for stretches: a line that the edges have already if it fits, else the best fit to the midlines."""
    for line in held:
        # A line that fits already is kept to the last digit.
        if line.anchored or (line.distances(middle[stretches]) <= closed).all():
            return Line(stretches, line.normal, line.level, line.anchored)
    points, weights = middle[stretches].reshape(-1, 2), np.repeat(found.lengths[stretches], 2)
    centre = weights @ points / weights.sum()
    normal = np.linalg.svd((points - centre) * np.sqrt(weights)[:, None], full_matrices=False)[2][-1]
    return Line(stretches, normal, float(normal @ centre))


def moved_outlines(edges: Edges, lines: dict[int, Line], longest: float) -> list[np.ndarray]:
    """Move edges onto lines, those without a line not; the corners are where consecutive edges then meet.

    A corner moves by at most ``longest`` [m]; beyond it the mitre is cut off.
    """
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
            # An edge that turns around, because its neighbours move farther than it is long, is dropped.
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
    """Give the normal and the level [m] of an edge's line, or of the edge itself if it has none."""
    if edge in lines:
        return lines[edge].normal, lines[edge].level
    along = edges.end[edge] - edges.start[edge]
    normal = np.array([along[1], -along[0]]) / np.hypot(*along)
    return normal, float(normal @ edges.start[edge])
