"""Which outlines of a drawing are blocks: those asked for, in a window, without debris, frames, titles and mortar."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
import shapely

from blockvis.text import as_toml, by_similarity, listed, place_text
from solver.mechanics import counted, linked

from .crossings import uncrossed
from .layout import Layout
from .left_out import ENTITIES, Choice, LeftOut, in_words, look_of, matches
from .notes import CHANGED, LEFT_OUT, SPECK, UNIT, Note
from .outlines import ROUNDING, ring_area, ring_width
from .unfilled import walls_to_fill
from .units import doubt

#: An outline with less area than this times its perimeter squared is a line: the solver takes no block of less.
LINE = 1e-9

#: Blocks smaller than this fraction of the median one govern the steps of a path.
SPECK_SIZE = 0.01

#: A sliver is narrower than this fraction of the width of the median block ...
SLIVER_WIDTH = 2e-3

#: ... and longer than this many times its own width: a chip is none.
SLIVER_SHAPE = 20.0

#: Blocks thinner or thicker than these times the root of their area, and of the median one, were drawn in another unit
#: than they are thick.
THINNEST, THICKEST = 0.02, 1000.0

#: In a drawing an opening may be what has so many times the median area ...
OPENING_AREA = 2.5

#: ... and height, and stones to both sides and above: a lintel and a plinth are as high as a course or two.
OPENING_HEIGHT = 2.5

#: So many of what may be openings are named, to be copied.
MOST_NAMED = 12

#: A frame or background holds at least this share of all other outlines.
BACKGROUND = 0.5

#: Kinds of what was drawn as outlines, but cannot be blocks as it is.
UNREAD = ("hole", "pieces", "no outline", "crossing", "across")

#: Inner lines of blocks are left out from this many on; a single outline within another is refused by name.
INNER = 3

#: Layers that by their name hold what explains a drawing.
ANNOTATIONS = re.compile(
    r"(dims?|dimensions?|bema[sß]+ung|cotes?|titles?|title[ _-]?block|schriftfeld|guides?|rulers?|guide[ _-]?rulers?"
    r"|backgrounds?|hintergrund|annotations?|viewports?|defpoints|north([ _-]?arrows?)?|nordpfeil)",
    re.IGNORECASE,
)

#: Labels of what is no stone, but a place without any; architects' layers begin with a letter of their own, A-GLAZ.
VOIDS = re.compile(
    r"([a-z]-)?(openings?|win|windows?|glaz|glazing|doors?|voids?|holes?|fenster|t(ü|ue)r(en)?|öffnung(en)?|fen[eê]tres?"
    r"|portes?|finestr[ae]|port[ae]|ventanas?|puertas?)",
    re.IGNORECASE,
)

#: Names of mortar.
MORTAR = re.compile(r"\b(mortar|mörtel|moertel|malta|mortier|mortero|argamassa)\b", re.IGNORECASE)


def labels_of(layout: Layout, block: int) -> tuple[str, ...]:
    """Group, material and name of a block, and layers around it, by which it can be asked for."""
    return layout.groups[block], layout.materials[block], layout.names[block], *layout.within[block]


def _words(layout: Layout, block: int) -> tuple[str, ...]:
    return (*labels_of(layout, block), *layout.looks[block])


def sorted_out(
    layout: Layout, ignore: Sequence[str] = (), only: Sequence[str] = (), window: Sequence[float] = ()
) -> Layout:
    """Leave out what is no block of a drawing in m, with a note per kind and layer, and doubt the unit.

    ``ignore`` and ``only`` are layers, groups, materials and names of blocks, or patterns of them; kinds of entities
    and colours. The window is x0, y0, x1, y1 [m], or empty. ValueError if a pattern of ``only`` matches nothing, no
    block is left, or something cannot be left out unasked.
    """
    where = f"'{layout.source}'" if layout.source else "the drawing"
    layout = within_window(without_ignored(layout, ignore, only), window)
    layout = without_surroundings(without_debris(uncrossed(layout)), only)
    for item in layout.left_out:
        if item.serious:
            raise ValueError(f"{where}: {item.message}; or leave it out (ignore)")
    if layout.n_blocks == 0:
        first = next((item for item in layout.left_out if item.message), None)
        asked = "all that it draws is left out as asked (ignore, only)"
        more = len(layout.left_out) - 1
        counted = f"; {more} more {'is' if more == 1 else 'are'} left out" if first and more > 0 else ""
        ground = next((item for item in layout.left_out if item.kind == "background"), None)
        if ground is not None and any(item.kind in UNREAD for item in layout.left_out):
            why = f"{first.message if first else asked}{counted}"
            raise ValueError(f"{where}: nothing but a background is left, '{ground.name}': {why}")
        wall = next((f"; {words}" for words in walls_to_fill(layout).values()), "")
        raise ValueError(f"{where} draws no block: {first.message if first else asked}{counted}{wall}")
    return noted(layout)


def noted(layout: Layout) -> Layout:
    """Note what is left out, and the doubts that the sizes of the blocks cast on the unit and on their thickness."""
    size = float(np.median(layout.sizes))
    doubted = "" if layout.unit_by == "user" else doubt(layout.unit, size, page=layout.unit_by == "page")
    found = [Note(UNIT, words) for words in (doubted, _thickness_doubt(layout, size)) if words]
    found += [Note(SPECK, words) for words in (_specks(layout, size),) if words]
    walls = [Note(LEFT_OUT, words) for words in walls_to_fill(layout).values()]
    # Those of walls that a bond is to fill are told with these.
    labels = () if walls else sorted({*layout.groups, *layout.materials})
    found += [] if walls else [Note(CHANGED, words) for words in (_maybe_openings(layout),) if words]
    found += [
        Note(CHANGED, f"what is called '{label}' counts as a stone; of an opening leave it out: ignore = [\"{label}\"]")
        for label in labels
        if VOIDS.fullmatch(label)
    ]
    return replace(layout, notes=(*layout.notes, *walls, *in_words(layout.left_out), *found))


def _specks(layout: Layout, median: float) -> str:
    """Tell of blocks far smaller than the median one [m]; "" where there are none."""
    small = np.flatnonzero(layout.sizes < SPECK_SIZE * median)
    if not len(small):
        return ""
    i = int(small[layout.sizes[small].argmin()])
    others = f" (and {counted(len(small) - 1, 'other')})" if len(small) > 1 else ""
    return (
        f"block '{layout.names[i]}' is {layout.sizes[i]:.3g} m across, 1/{median / layout.sizes[i]:.3g} of the median "
        f"block{others}: it governs the steps of a path, which may be slow; leave it out (ignore) if it is debris"
    )


def _maybe_openings(layout: Layout) -> str:
    """Tell of outlines of a drawing that may be windows and doors; "" where there are none."""
    times = np.round(layout.sizes**2 / np.median(layout.sizes) ** 2, 9)
    found = sorted(_enclosed(layout, times), key=lambda i: -times[i])
    if not found:
        return ""
    ring = layout.outlines[found[0]]
    where = f"around {place_text((ring.min(axis=0) + ring.max(axis=0)) / 2.0)}"
    said = f"'{layout.names[found[0]]}' {where} of {times[found[0]]:.2g} times the median area "
    said += f"and {counted(len(found) - 1, 'other')} count as stones" if len(found) > 1 else "counts as a stone"
    names = listed([as_toml(layout.names[i]) for i in found[:MOST_NAMED]], MOST_NAMED)
    more = f" and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else ""
    return f"{said}; leave out what is an opening: ignore = [{names}]{more}"


def _enclosed(layout: Layout, times: np.ndarray) -> list[int]:
    """Find outlines as large, ``times`` the median area, and as high as openings, with others beside and above."""
    if layout.dimension == 3:
        return []
    low, high = (np.array([by(ring, axis=0) for ring in layout.outlines]) for by in (np.min, np.max))
    heights = high[:, 1] - low[:, 1]
    near = ROUNDING * float((high.max(axis=0) - low.min(axis=0)).max())
    # Only outlines of a drawing have a look; what is known to be a support, or called an opening, is told elsewhere.
    known = [
        not looks or role or VOIDS.fullmatch(group)
        for looks, role, group in zip(layout.looks, layout.roles, layout.groups, strict=True)
    ]
    doubted = ~np.array(known, bool) & (times > OPENING_AREA) & (heights > OPENING_HEIGHT * np.median(heights))
    found = []
    for i in np.flatnonzero(doubted).tolist():
        over, beside = ((low < high[i] - near) & (high > low[i] + near)).T
        left, right, above = high[:, 0] < low[i, 0] + near, low[:, 0] > high[i, 0] - near, low[:, 1] > high[i, 1] - near
        if (beside & left).any() and (beside & right).any() and (over & above).any():
            found.append(i)
    return found


def _thickness_doubt(layout: Layout, median: float) -> str:
    """Doubt thicknesses said in another unit than outlines: far from the size of their block and the median [m]."""
    if layout.thickness is None:
        return ""
    # Ground may be far larger than it is thick, and a chip far smaller: stones of a usual size tell.
    thin = layout.thickness < THINNEST * np.minimum(layout.sizes, median)
    thick = layout.thickness > THICKEST * np.maximum(layout.sizes, median)
    doubted = np.flatnonzero(thin | thick)
    if not len(doubted):
        return ""
    first, said = doubted[0], np.isfinite(layout.thickness).sum()
    many = f" ({len(doubted)} of {said} thicknesses are as doubtful)" if said > 1 else ""
    return (
        f"thickness in doubt: {layout.thickness[first]:.3g} m of block '{layout.names[first]}', "
        f"{layout.sizes[first]:.3g} m across{many}; the file has it in {layout.thickness_unit or layout.unit}: correct "
        "it there"
    )


def checked_window(window: Sequence[float] | None) -> tuple[float, ...]:
    """Return the corners x0, y0, x1, y1 of a window [m], () for none.

    ValueError for anything but two corners, the lower left one first.
    """
    if window is None or len(window) == 0:
        return ()
    corners = tuple(float(x) for x in window)
    if len(corners) != 4 or not np.isfinite(corners).all() or not (corners[0] < corners[2] and corners[1] < corners[3]):
        raise ValueError(f"window is {list(window)}; give [x0, y0, x1, y1] in m, with x0 < x1 and y0 < y1")
    return corners


def within_window(layout: Layout, window: Sequence[float]) -> Layout:
    """Keep what lies within a window; what crosses its edge is left out, and what lies beyond is counted in a note.

    The window is x0, y0, x1, y1 [m], or empty. ValueError, with from where to where the drawing goes, if no block lies
    within it.
    """
    if len(window) == 0:
        return layout
    low, high = np.array(window[:2]), np.array(window[2:])
    near = ROUNDING * float((high - low).max())

    def place(points: np.ndarray) -> str:
        if len(points) == 0 or (points.max(axis=0) <= low + near).any() or (points.min(axis=0) >= high - near).any():
            return "beyond"
        return "within" if (points >= low - near).all() and (points <= high + near).all() else "edge"

    of_blocks = [*map(place, layout.outlines)]
    if "within" not in of_blocks:
        every = np.concatenate([*layout.outlines, np.zeros((0, 2))])
        extent, remedy = "draws no block at all", "correct the window"
        if len(every):
            (x0, y0), (x1, y1) = every.min(axis=0), every.max(axis=0)
            extent = f"goes from ({x0:.6g}, {y0:.6g}) to ({x1:.6g}, {y1:.6g}) m"
            if layout.unit_by != "user":
                remedy = doubt(layout.unit, float(np.median(layout.sizes)), page=layout.unit_by == "page") or remedy
        asked = ", ".join(f"{x:.6g}" for x in window)
        raise ValueError(
            f"'{layout.source}': no block lies within the window [{asked}] m; the drawing {extent}: {remedy}"
        )
    # Mortar that is drawn as one surface reaches beyond: it says nothing of the joints within.
    beside = [(item, place(item.points)) for item in layout.left_out]
    left_out = tuple(
        item if where == "within" else LeftOut("edge", item.points, "", item.layer, item.name)
        for item, where in beside
        if where == "within" or (where == "edge" and item.closed and item.kind != "asked")
    )
    crossing = {i: LeftOut("edge", layout.outlines[i], "") for i, where in enumerate(of_blocks) if where == "edge"}
    n = of_blocks.count("beyond")
    said = f"window: {counted(n, 'outline')} beyond it {'was' if n == 1 else 'were'} left out"
    layout = replace(layout, left_out=left_out, notes=(*layout.notes, *([Note(LEFT_OUT, said)] if n else [])))
    cut = layout.leaving_out(crossing)
    kept = [k for k, where in enumerate(w for w in of_blocks if w != "edge") if where == "within"]
    return cut.chosen(kept)


def without_ignored(layout: Layout, ignore: Sequence[str], only: Sequence[str]) -> Layout:
    """Leave out what patterns of layers, groups, materials and names of blocks ask to leave out.

    ValueError if a pattern of ``only`` matches nothing.
    """
    if not ignore and not only:
        return layout
    known = [labels_of(layout, i) for i in range(layout.n_blocks)]
    every = list(filter(None, chain(*known, *((item.layer, item.name) for item in layout.left_out))))
    looks = set(chain(*layout.looks, *(item.looks for item in layout.left_out)))
    if only and (unmatched := _unmatched(only, every, looks)):
        raise ValueError(f"{layout.source or 'the drawing'}: only: {unmatched[0]}; correct it")
    unmatched = _unmatched([pattern for pattern in ignore if look_of(pattern) not in ENTITIES], every, looks)
    unwanted, wanted = Choice(ignore, (*every, "")), Choice(only, (*every, ""))

    def dropped(labels: tuple[str, ...], own: tuple[str, ...]) -> bool:
        return unwanted.takes(labels, own) or (bool(only) and not wanted.takes(labels, own))

    reasons = {
        i: LeftOut("asked", layout.outlines[i], "")
        for i, labels in enumerate(known)
        if dropped(labels, layout.looks[i])
    }
    asked = tuple(
        replace(item, kind="asked" if item.closed else "asked line", serious=False)
        if dropped((item.layer, item.name), item.looks)
        else item
        for item in layout.left_out
    )
    notes = (*layout.notes, *(Note(LEFT_OUT, f"ignore: {message}") for message in unmatched))
    return replace(layout, left_out=asked, notes=notes).leaving_out(reasons)


def _unmatched(patterns: Sequence[str], labels: Sequence[str], looks: set[str]) -> list[str]:
    """Say which patterns match nothing, and what the drawing has."""
    found = []
    for pattern in patterns:
        if not matches(labels, [pattern]) and look_of(pattern) not in looks:
            parts = list(filter(None, map(str.strip, pattern.split(","))))
            if len(parts) > 1 and matches(labels, parts):
                found.append(f"'{pattern}' is one pattern, and matches nothing; give each of its parts by itself")
                continue
            listed = ", ".join(f"'{one}'" for one in by_similarity(pattern, list(dict.fromkeys(labels))[:2000])[:12])
            kinds = f"; its kinds and colours are {', '.join(sorted(looks)[:12])}" if looks else ""
            found.append(f"'{pattern}' matches no layer, group or name; the drawing has {listed or 'none'}{kinds}")
    return found


def without_debris(layout: Layout) -> Layout:
    """Leave out outlines without area, and slivers."""
    reasons = {}
    perimeters = [float(np.hypot(*(np.roll(ring, -1, axis=0) - ring).T).sum()) for ring in layout.outlines]
    for i, ring in enumerate(layout.outlines):
        area = abs(ring_area(ring)) if len(ring) > 2 else 0.0
        if area <= LINE * perimeters[i] ** 2:
            message = (
                f"block '{layout.names[i]}' has an area of {area:.3g} m² for a perimeter of {perimeters[i]:.3g} m; it "
                "is a line, not a block: remove it or redraw it"
            )
            reasons[i] = LeftOut("no area", ring, message)
    widths = {i: ring_width(ring) for i, ring in enumerate(layout.outlines) if i not in reasons}
    thin = SLIVER_WIDTH * float(np.median(list(widths.values()))) if widths else 0.0
    for i, width in widths.items():
        if width < thin and perimeters[i] > 2.0 * SLIVER_SHAPE * width:
            reasons[i] = LeftOut("sliver", layout.outlines[i], f"block '{layout.names[i]}' is {width:.3g} m wide")
    return layout.leaving_out(reasons)


def without_surroundings(layout: Layout, only: Sequence[str] = ()) -> Layout:
    """Leave out what by its name or place is no block, and not asked for: annotations, frames, title blocks, mortar.

    An outline around others cannot be a block beside them, so nothing is left out that could be analysed. Mortar is
    left out where it is one surface around the stones or in pieces; mortar drawn as blocks of its own stays.
    """
    by_name = {
        i: LeftOut("annotation", layout.outlines[i], f"block '{layout.names[i]}' is on layer '{layout.groups[i]}'")
        for i in range(layout.n_blocks)
        if ANNOTATIONS.fullmatch(layout.groups[i].strip()) and not matches(_words(layout, i), only)
    }
    if len(by_name) < layout.n_blocks:
        layout = layout.leaving_out(by_name)
    mortar = tuple(
        replace(item, kind="mortar", serious=False)
        if item.closed and item.kind != "asked" and MORTAR.search(f"{item.layer} {item.name}") and layout.n_blocks
        else item
        for item in layout.left_out
    )
    layout = replace(layout, left_out=mortar)
    reasons = _around_others(layout)
    reasons = {i: item for i, item in reasons.items() if not matches(_words(layout, i), only)}
    return layout.leaving_out(reasons)


def drawn_mortar(layout: Layout) -> list[LeftOut]:
    """Find the surfaces of mortar around stones among what was left out, by itself or as asked."""
    return [item for item in layout.left_out if item.holes and MORTAR.search(f"{item.layer} {item.name}")]


def _around_others(layout: Layout) -> dict[int, LeftOut]:
    """Frames and backgrounds around other blocks, title blocks on a frame, inner lines of blocks."""
    n, (beside, of_outlines) = layout.n_blocks, _unread(layout)
    if n + len(beside) < 2 or n == 0:
        return {}
    shapes = np.array([shapely.Polygon(ring) for ring in layout.outlines])
    shapes[~shapely.is_valid(shapes)] = shapely.Polygon()
    areas = shapely.area(shapes)
    inner, outer = shapely.STRtree(shapes).query(shapes, "covered_by")
    # Of two outlines drawn twice neither lies within the other.
    nested = (inner != outer) & (areas[inner] < (1.0 - 1e-6) * areas[outer]) & (areas[inner] > 0)
    inner, outer = inner[nested], outer[nested]
    held = np.bincount(outer, minlength=n)
    # What was left out counts, too: a background stays one where the drawing upon it cannot be read.
    within, around = shapely.STRtree(shapes).query(beside, "covered_by")
    smaller = shapely.area(beside)[within] < 0.99 * areas[around]
    held += np.bincount(around[smaller], of_outlines[within[smaller]], n).astype(int)
    others = n - 1 + of_outlines.sum()
    frames = [int(i) for i in np.flatnonzero((held >= 2) & (held >= BACKGROUND * others))]
    if len(inner) == 0 and not frames:
        return {}
    reasons = {}
    for i in frames:
        kind = "mortar" if MORTAR.search(" ".join(labels_of(layout, i))) else "background"
        message = f"block '{layout.names[i]}' lies around {held[i]} others"
        reasons[i] = LeftOut(kind, layout.outlines[i], message)
    reasons |= _title_cells(layout, shapes, frames)
    left = [k for k in range(len(inner)) if int(outer[k]) not in reasons and int(inner[k]) not in reasons]
    lines = sorted({int(inner[k]) for k in left})
    blocks = {int(outer[k]) for k in left} - set(lines)
    if len(blocks) >= INNER and len(blocks) >= 0.25 * (n - len(reasons) - len(lines)):
        for i in lines:
            reasons[i] = LeftOut("inner", layout.outlines[i], f"block '{layout.names[i]}' lies within another")
    return reasons


def _unread(layout: Layout) -> tuple[Any, np.ndarray]:
    """Shapes that could not be read as blocks, and (n,) int array: of how many outlines each was drawn."""
    items = [item for item in layout.left_out if item.kind in UNREAD and len(item.points) > 2]
    shapes = np.array([shapely.Polygon(item.points).convex_hull for item in items], dtype=object)
    return shapes, np.array([1 + len(item.holes) for item in items], dtype=int)


def _title_cells(layout: Layout, shapes: Any, frames: list[int]) -> dict[int, LeftOut]:
    """Upright rectangles that hang together, reach the frame of a sheet and are not the main part of the drawing."""
    others = np.array([i for i in range(len(shapes)) if i not in frames])
    if not frames or len(others) == 0:
        return {}
    frame = shapes[min(frames, key=lambda i: shapes[i].area)].exterior
    near = 2e-3 * frame.length / 4.0
    apart = max(near, 0.5 * float(np.sqrt(np.median(shapely.area(shapes[others])))))
    a, b = shapely.STRtree(shapes[others]).query(shapes[others], "dwithin", apart)
    piece = linked((a, b), len(others))
    area = np.bincount(piece, shapely.area(shapes[others]))
    main = int(np.argmax(area))
    if (piece == main).sum() < 0.5 * len(others):
        # The blocks stand apart, as bricks on a background do: those at its border are no title block.
        return {}
    found = {}
    for k in range(piece.max() + 1):
        members = others[piece == k]
        boxes = shapely.box(*shapely.bounds(shapes[members]).T)
        upright = (shapely.area(shapes[members]) > 0.99 * shapely.area(boxes)).all()
        if k != main and upright and shapely.dwithin(shapes[members], frame, near).any():
            for i in members:
                message = f"block '{layout.names[i]}' hangs on the frame of the sheet"
                found[int(i)] = LeftOut("title", layout.outlines[i], message)
    return found
