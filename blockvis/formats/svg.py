"""Vector drawings, .svg: closed shapes are blocks; layers, ids and titles are kept; y is turned to point up.

The parser is that of the standard library. Document types with entities are refused before parsing: no drawing needs
them, and they can fill any memory.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from PIL import ImageColor

from blockvis.layout.block_table import layer_of, layers_of, on_layer, rows_of
from blockvis.layout.layout import Layout
from blockvis.layout.left_out import passed_over
from blockvis.layout.notes import CHANGED, LEFT_OUT, UNIT_TAKEN, Note
from blockvis.layout.outlines import chords_of, filled, rectangle
from blockvis.layout.units import UNITS, metres_per, unit_of
from solver import mechanics

from .arcs import MOST_CHORDS, Arc, Bezier, Curve, bezier_chords
from .drawing import Drawing, Line, Outline, Stroke, is_chain, joined_ends
from .loose_lines import refuse_open, with_faces
from .reading import DEEPEST, Reading, json_object

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_COMMAND = re.compile(r"([MmZzLlHhVvCcSsQqTtAa])([^MmZzLlHhVvCcSsQqTtAa]*)")
#: Nothing need separate the two flags of an arc from each other and from the next number.
_ARC = re.compile(
    rf"({_NUMBER})[\s,]*({_NUMBER})[\s,]*({_NUMBER})[\s,]*([01])[\s,]*([01])[\s,]*({_NUMBER})[\s,]*({_NUMBER})"
)
_TRANSFORM = re.compile(r"(matrix|translate|scale|rotate|skewX|skewY)\s*\(([-+.\deE,\s]*)\)")
#: Lengths in px and angles in degrees are what a transform attribute means without a unit.
_CSS_UNIT = re.compile(rf"({_NUMBER})(?:px|deg)\b")
#: Comments, the signs of an XML comment that old sheets stand in, and rules of a condition or of no element.
_COMMENT = re.compile(r"/\*.*?\*/|<!--|-->", re.DOTALL)
_AT_RULE = re.compile(r"@[^@{};]*(?:;|\{(?:[^{}]|\{[^{}]*\})*\})")
_SELECTOR = re.compile(r"(\*|[a-zA-Z][\w-]*)?((?:[.#][\w-]+)*)")
#: Properties by which shapes are read, chosen or left out.
_READ = re.compile(
    r"(?:^|[;{])\s*(?:display|visibility|(?:fill-|stroke-)?opacity|fill|stroke(?:-dasharray)?|transform)\s*:",
    re.IGNORECASE,
)
_INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
_XLINK = "{http://www.w3.org/1999/xlink}"

#: Elements that draw nothing where they stand.
_UNDRAWN = ("defs", "symbol", "clipPath", "mask", "pattern", "marker", "metadata")

#: Properties by which shapes are painted, where nothing is said.
_PAINTING = {
    "fill": "black", "stroke": "none", "visibility": "visible", "fill-opacity": "1", "stroke-opacity": "1",
    "stroke-dasharray": "none",
}  # fmt: skip

#: What paints nothing, and opacities of what nobody sees.
_NO_PAINT = ("none", "transparent")
_CLEAR = re.compile(r"0*\.?0+\s*(?:%|[a-z]*)")

#: More clones than this are refused.
MOST_CLONES = 10_000

#: Layer on which blocks are written that have no group, role as a support or material.
_LAYER = "blocks"

#: Numbers that follow each path command.
_TAKES = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}


class _Part(NamedTuple):
    """A part of a shape: points, whether it is closed, and its curves."""

    points: np.ndarray
    closed: bool
    curves: tuple[Curve, ...] = ()


@dataclass
class _Found(Drawing):
    """What was found so far, in user units, y down, and what clones show: the elements by their id."""

    originals: Mapping[str, ElementTree.Element] = field(default_factory=dict)
    clones: int = 0
    clipped: Counter[str] = field(default_factory=Counter)
    sheets_missed: bool = False


@dataclass(frozen=True)
class _Context:
    """Context of an element: transform of its parents, layers, largest distance of chords from a curve, and painting.

    Layers are groups with a label, the innermost last; where none around has one, those with an id: programs without
    labels write the name of a layer so, and others give every group one. An id that is a role counts in any case.
    ``named`` says whether one has a label.
    Painting are values of the properties by which shapes are painted, which elements have from those around them.
    ``sheet`` is what percentages are parts of: width and height of the innermost <svg>, in its units.
    """

    matrix: np.ndarray
    layers: tuple[str, ...]
    tolerance: float | None
    depth: int = 0
    named: bool = False
    painting: Mapping[str, str] = field(default_factory=_PAINTING.copy)
    sheet: tuple[float, float] = (math.nan, math.nan)

    @property
    def fills(self) -> bool:
        """Whether shapes are filled."""
        return self.painting["fill"] not in _NO_PAINT and not _CLEAR.fullmatch(self.painting["fill-opacity"])

    @property
    def strokes(self) -> bool:
        """Whether shapes have a line around them."""
        # A width of 0 is the thinnest line to many who draw.
        return self.painting["stroke"] not in _NO_PAINT and not _CLEAR.fullmatch(self.painting["stroke-opacity"])

    @property
    def dashes(self) -> tuple[str, bool]:
        """What lines are called by their dashes, and whether these are those of axes."""
        numbers = re.findall(_NUMBER, self.painting["stroke-dasharray"])
        # Of an odd number of lengths the gaps become dashes when they are repeated.
        chain = is_chain([float(number) for number in (numbers * 2 if len(numbers) % 2 else numbers)[::2]])
        return "dashes and dots" if chain else "dashes" if numbers else "", chain

    def within(self, element: ElementTree.Element, matrix: np.ndarray) -> _Context:
        """Context of what an element holds, painted as that says or else as what is around it."""
        painting = {key: _style(element, key) or value for key, value in self.painting.items()}
        sheet = _sheet(element, self) if _tag(element) == "svg" else self.sheet
        return replace(self, matrix=matrix, depth=self.depth + 1, painting=painting, sheet=sheet)

    @property
    def layer(self) -> str:
        """The innermost layer, "" for none."""
        return self.layers[-1] if self.layers else ""


def read(path: Path, reading: Reading) -> Layout:
    """Read a .svg drawing; its unit follows from its width and its viewBox."""
    reading.refuse_view()
    root = _root(path)
    own = root.get("data-blockvis-unit", "")
    stated, doubts = (own, []) if own else _unit(root)
    tolerance = None
    if reading.chord_tolerance is not None:
        tolerance = reading.chord_tolerance / metres_per(reading.unit or stated or "m")
    styled = _styled(root)
    # Of an id that is there twice, against the rules, programs show the first.
    originals = {element.get("id", ""): element for element in reversed(list(root.iter()))}
    found = _Found(notes=[*doubts, *styled, *_pattern_fills(root)], originals=originals)
    if stated and stated not in UNITS and reading.unit is None:
        scale = f"1 unit of the drawing is {stated}, by its width and its viewBox"
        found.notes.append(Note(UNIT_TAKEN, scale))
    # What sheets that are not read say may paint a shape.
    found.sheets_missed = len(styled) > 0
    _walk(root, _Context(np.eye(3), (), tolerance), found)
    with_faces(found, reading, row_of=_row, tolerance=tolerance)
    refuse_open(found, "closed shape", "a closed path or polygon", stated, factors=(1.0, -1.0))
    found.notes += passed_over(found.skipped)
    found.notes += passed_over(found.clipped, "read whole, not clipped")
    return found.layout(stated, unit_by="layout" if own else "page" if stated else "", own=True, factors=(1.0, -1.0))


def _root(path: Path) -> ElementTree.Element:
    text = path.read_bytes()
    if text[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise ValueError("it is not in UTF-8; save it as plain SVG")
    if re.search(rb"<!\s*(DOCTYPE|ENTITY)[^>]*(\[|ENTITY)", text, re.IGNORECASE):
        raise ValueError("it defines XML entities; save it as plain SVG without a document type")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError, RecursionError) as error:
        raise ValueError(f"it is not an SVG file: {error}; save it as plain SVG") from None
    if _tag(root) != "svg":
        raise ValueError(f"it is XML with the root <{_tag(root)}>, not <svg>; save it as plain SVG")
    return root


def _unit(root: ElementTree.Element) -> tuple[str, list[str]]:
    """Find the unit of length that one user unit is; "" if the file does not state it, with a note if it states two."""
    sides = (re.fullmatch(rf"\s*({_NUMBER})\s*([a-z]+)\s*", root.get(side, "")) for side in ("width", "height"))
    width, height = (side if side and side[2] in UNITS and side[2] != "px" else None for side in sides)
    if width is None:
        return "", []
    box = _view_box(root)
    if box is None:
        return "px", []
    number = float(width[1]) / max(box[2], 1e-300)
    upright = float(height[1]) * UNITS[height[2]] / UNITS[width[2]] / max(box[3], 1e-300) if height else number
    if not math.isclose(number, upright, rel_tol=1e-3):
        ratio = root.get("preserveAspectRatio", "")
        if "none" in ratio or "slice" in ratio:
            remedy = "give a page of the shape of the viewBox, or the unit"
            no_scale = f'the page has another shape than the viewBox, and preserveAspectRatio="{ratio}": no scale'
            return "", [Note(CHANGED, f"{no_scale}; {remedy}")]
        # The drawing is shown as large as fits into the page.
        number = min(number, upright)
    scaled = f"{number:.9g} {width[2]}" if 0.0 < number < math.inf else ""
    return unit_of(number * UNITS[width[2]]) or scaled, []


def _view_box(element: ElementTree.Element) -> list[float] | None:
    """Return the four numbers of the viewBox; None where there are not four."""
    numbers = [float(word) for word in element.get("viewBox", "").replace(",", " ").split()]
    return numbers if len(numbers) == 4 else None


def _sheet(element: ElementTree.Element, where: _Context) -> tuple[float, float]:
    """Width and height of what an <svg> shows, in its units; not a number where it does not say."""
    box = _view_box(element)
    if box is not None:
        return box[2], box[3]
    width, height = (_in_user_units(element.get(side, ""), side, where.sheet) for side in ("width", "height"))
    return width, height


def _viewport(element: ElementTree.Element, where: _Context) -> np.ndarray:
    """(3, 3) array: where an inner <svg> shows what it holds, its viewBox in its rectangle; SVG 1.1, 7.8."""
    corner, box = [_length(element, "x", where), _length(element, "y", where)], _view_box(element)
    matrix = np.eye(3)
    matrix[:2, 2] = corner
    if box is not None:
        start, span = np.array(box[:2]), np.array(box[2:])
        size = np.array([_length(element, "width", where), _length(element, "height", where)])
        if not (size > 0.0).all() or not (span > 0.0).all():
            raise ValueError("has no width, height or viewBox above 0; give them")
        scale, ratio = size / span, element.get("preserveAspectRatio", "xMidYMid")
        if "none" not in ratio:
            scale = np.full(2, scale.max() if "slice" in ratio else scale.min())
        free = [0.0 if f"{axis}Min" in ratio else 1.0 if f"{axis}Max" in ratio else 0.5 for axis in "xY"]
        matrix[:2, :2] = np.diag(scale)
        matrix[:2, 2] += free * (size - scale * span) - scale * start
    return matrix


def _styled(root: ElementTree.Element) -> list[str]:
    """Put what style sheets say before the own style of each element, which holds; say what was not understood."""
    sheets = "\n".join(element.text or "" for element in root.iter() if _tag(element) == "style")
    sheets = _COMMENT.sub("", sheets)
    missed = [rule.split("{")[0].strip() for rule in _AT_RULE.findall(sheets) if _READ.search(rule)]
    rules = []
    for rule in _AT_RULE.sub("", sheets).split("}"):
        selectors, _, said = rule.rpartition("{")
        for selector in map(str.strip, selectors.split(",")):
            match = _SELECTOR.fullmatch(selector)
            if match is not None and selector:
                # Ids and classes are kept with their signs.
                marks, ids, tag = re.findall(r"[.#][\w-]+", match[2]), match[2].count("#"), match[1] or "*"
                rules.append(((ids, len(marks) - ids, tag != "*"), tag, {*marks}, said))
            elif _READ.search(said):
                missed.append(selector)
    rules.sort(key=lambda rule: rule[0])
    for element in root.iter() if rules else ():
        own = {f".{word}" for word in element.get("class", "").split()} | {f"#{element.get('id', '')}"}
        applied = [text for _, tag, marks, text in rules if tag in ("*", _tag(element)) and marks <= own]
        if applied:
            element.set("style", ";".join([*applied, element.get("style", "")]))
    return [
        Note(
            LEFT_OUT,
            f"not read: what the style sheet says of '{selector}'; give the shapes a class, or export with "
            "presentation attributes",
        )
        for selector in dict.fromkeys(missed)
    ]


def _pattern_fills(root: ElementTree.Element) -> list[str]:
    """Say which patterns fill shapes: what they draw is not read."""
    patterns = {element.get("id", "") for element in root.iter() if _tag(element) == "pattern"} - {""}
    fills = Counter[str]()
    for element in root.iter():
        said = f"{element.get('fill', '')} {element.get('style', '')}"
        named = dict.fromkeys(re.findall(r"url\(\s*['\"]?#([^'\")\s]+)", said))
        fills.update(name for name in named if name in patterns)
    return [
        Note(
            LEFT_OUT,
            f"not read: the lines of the pattern '{name}', which fills {n} shape{'s' * (n > 1)}; turn it into shapes "
            "(Inkscape: Object, Pattern, Pattern to Objects)",
        )
        for name, n in fills.items()
    ]


def _tag(element: ElementTree.Element) -> str:
    return str(element.tag).rsplit("}", 1)[-1]


def _walk(element: ElementTree.Element, where: _Context, found: _Found) -> None:
    if where.depth > DEEPEST:
        raise ValueError(f"it nests groups more than {DEEPEST} deep; ungroup it")
    tag = _tag(element)
    if tag in _UNDRAWN:
        return
    if _style(element, "display") == "none" or _CLEAR.fullmatch(_style(element, "opacity")):
        found.skipped[f"hidden <{tag}>"] += 1
        return
    matrix, shown = where.matrix @ _matrix(_transform(element)), list(element)
    if tag == "use":
        matrix[:2, 2] += matrix[:2, :2] @ [_length(element, "x", where), _length(element, "y", where)]
        shown = _originals(element, found)
    if tag == "svg" and where.depth:
        try:
            matrix = matrix @ _viewport(element, where)
        except ValueError as error:
            found.notes.append(Note(LEFT_OUT, f"an inner {_called(element)} was skipped: it {error}"))
            return
    where = where.within(element, matrix)
    if tag == "g":
        where = _in_group(element, where)
    found.clipped.update(f"<{tag}> with a {key}" for key in ("clip-path", "mask") if "url(" in _style(element, key))
    if tag in _SHAPES:
        unpainted = not (where.fills or where.strokes or found.sheets_missed)
        if where.painting["visibility"] != "visible" or unpainted:
            found.skipped[f"hidden <{tag}>"] += 1
        else:
            _add(element, where, found)
    for child in shown:
        _walk(child, where, found)


def _originals(element: ElementTree.Element, found: _Found) -> list[ElementTree.Element]:
    """Find what a clone shows, a symbol as an inner <svg> of the clone's size; none of it where that is elsewhere."""
    called = element.get("href", element.get(f"{_XLINK}href", ""))
    original = found.originals.get(called.removeprefix("#"))
    symbol = original is not None and _tag(original) == "symbol"
    if not called.strip("#") or original is None or (_tag(original) in _UNDRAWN and not symbol):
        found.skipped["<use> (clones; unlink them to have them read)"] += 1
        return []
    # Clones within clones, ten of each ten, can fill any memory.
    found.clones += 1
    if found.clones > MOST_CLONES:
        raise ValueError(f"it shows more than {MOST_CLONES} clones (<use>); unlink those that are blocks")
    if symbol:
        size = {side: element.attrib[side] for side in ("width", "height") if side in element.attrib}
        shown = ElementTree.Element("svg", original.attrib | size)
        shown.extend(original)
        return [shown]
    return [original]


def _in_group(element: ElementTree.Element, where: _Context) -> _Context:
    """Add a group to the layers, if it is one; an id that is a role was not made up by a program."""
    label, called = element.get(f"{_INKSCAPE}label", ""), element.get("id", "")
    named = bool(label) or element.get(f"{_INKSCAPE}groupmode") == "layer"
    counts = named or not where.named or called.strip().lower() in mechanics.ROLES
    label = label or (called if counts else "")
    return replace(where, layers=(*where.layers, label), named=named or where.named) if label else where


def _called(element: ElementTree.Element) -> str:
    return f"<{_tag(element)}> '{element.get('id', 'without id')}'"


def _add(element: ElementTree.Element, where: _Context, found: _Found) -> None:
    try:
        parts = _SHAPES[_tag(element)](element, where)
    except (ValueError, OverflowError) as error:
        raise ValueError(f"{_called(element)} {error}") from None
    title = next((child.text or "" for child in element if _tag(child) == "title"), "")
    name = title.strip() or element.get(f"{_INKSCAPE}label") or element.get("id") or ""
    kept = _kept(element, title, where, found)
    looks = (_tag(element), *_colour(where))
    drawn: list[Outline] = []
    for points, closed, of_part in parts:
        if len(points) < 2:
            continue
        if not np.isfinite(points).all():
            raise ValueError(f"{_called(element)} has a point that is not a finite number; repair it")
        stroke = Stroke(points=points, looks=looks, within=where.layers, curves=of_part)
        stroke = stroke.mapped(where.matrix[:2, :2], where.matrix[:2, 2])
        joined = joined_ends(stroke.points, closed)
        if joined is None:
            handle, must_close, (line_type, chain) = name or f"<{_tag(element)}>", len(points) > 2, where.dashes
            named = {"layer": where.layer, "name": handle, "handle": handle, "must_close": must_close}
            found.loose.append(stroke.as_(Line, **named, line_type=line_type, chain=chain))
        else:
            drawn.append(stroke.as_(Outline, points=joined[0], row={}))
            found.misses.append(joined[1])
    for k, inside in filled([one.points for one in drawn]):
        called = name if len(drawn) == 1 or not name else f"{name} {k + 1}"
        one = replace(drawn[k], row=_row(where.layers, called), holes=tuple(drawn[j].points for j in inside))
        if inside:
            found.holed.append((one, _called(element)))
        else:
            found.outlines.append(replace(one, row=kept) if kept else one)


def _kept(element: ElementTree.Element, title: str, where: _Context, found: _Found) -> dict[str, Any]:
    """Row of the block table that our own writer put on a shape, with the layer and name that the shape has now."""
    row = kept = json_object(element.get("data-blockvis", "{}"))
    if not kept:
        return {}
    # A program that drops the labels of layers leaves ids that it made up.
    if where.named and where.layer not in ("", _in_xml(layer_of(kept)[0] or _LAYER)):
        row = {**_row([where.layer], ""), **on_layer(kept, where.layer)}
        found.moved.append((kept, row))
    names = (element.get(f"{_INKSCAPE}label", ""), title)
    written = _in_xml(str(kept.get("name", ""))).split()
    renamed = next((name for name in names if name.strip() and name.split() != written), None)
    return row if renamed is None else {**row, "name": renamed.strip()}


def _style(element: ElementTree.Element, key: str) -> str:
    """Value of a property of an element, of its style or an attribute; "" where it is that of its parent."""
    styled = re.findall(rf"(?:^|;)\s*{key}\s*:\s*([^;!]+)", element.get("style", ""), re.IGNORECASE)
    word = (styled[-1] if styled else element.get(key, "")).strip()
    return "" if word == "inherit" else word


def _transform(element: ElementTree.Element) -> str:
    """Transform of an element; about an origin of its own, which is not read, it is none."""
    said, origin = _style(element, "transform"), _style(element, "transform-origin")
    return f"{said} about {origin}" if said and origin.strip(" 0px") else said


def _colour(where: _Context) -> tuple[str, ...]:
    """Give the colour of a shape as #rrggbb, that of its fill or else of its stroke; none where it has none."""
    word = where.painting["fill" if where.fills else "stroke"]
    try:
        return ("#{:02x}{:02x}{:02x}".format(*ImageColor.getrgb(word)[:3]),)
    except ValueError:
        return ()


def _row(layers: Sequence[str], name: str) -> dict[str, Any]:
    """Write the row of the block table of an outline that has none of its own: a layer within fixed is fixed, too."""
    *around, layer = layers or [""]
    roles = [word for word in (word.strip().lower() for word in around) if word in mechanics.ROLES]
    row = {"group": layer, "material": layer, **({"role": roles[-1]} if roles else {})}
    row = {"group": layer} if layer.strip().lower() in mechanics.ROLES else row
    return row | ({"name": name} if name else {})


def _matrix(text: str) -> np.ndarray:
    result = np.eye(3)
    text = _CSS_UNIT.sub(r"\1", text)
    for name, arguments in _TRANSFORM.findall(text):
        step = np.eye(3)
        try:
            step[:2] = _STEPS[name](*(float(x) for x in re.findall(_NUMBER, arguments)))
        except (TypeError, ValueError):
            raise ValueError(
                f"it has a transform {name}({arguments:.60}) that cannot be read; apply it to the shapes"
            ) from None
        result = result @ step
    unread = _TRANSFORM.sub("", text).strip(" ,\t\r\n")
    if unread not in ("", "none"):
        raise ValueError(f"it has a transform {unread:.60} that cannot be read; apply it to the shapes")
    return result


def _rotated(angle: float, *centre: float) -> list[list[float]]:
    x, y = centre or (0.0, 0.0)
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return [[c, -s, x - (c * x - s * y)], [s, c, y - (s * x + c * y)]]


#: Rows of the matrices of transforms.
_STEPS: dict[str, Callable[..., list[list[float]]]] = {
    "matrix": lambda a, b, c, d, e, f: [[a, c, e], [b, d, f]],
    "translate": lambda x, y=0.0: [[1.0, 0.0, x], [0.0, 1.0, y]],
    "scale": lambda x, y=None: [[x, 0.0, 0.0], [0.0, x if y is None else y, 0.0]],
    "rotate": _rotated,
    "skewX": lambda angle: [[1.0, math.tan(math.radians(angle)), 0.0], [0.0, 1.0, 0.0]],
    "skewY": lambda angle: [[1.0, 0.0, 0.0], [math.tan(math.radians(angle)), 1.0, 0.0]],
}


def _length(element: ElementTree.Element, key: str, where: _Context) -> float:
    text = element.get(key, "0")
    length = _in_user_units(text, key, where.sheet)
    if math.isnan(length):
        raise ValueError(f"has {key}='{text}'; give a number in user units")
    return length


def _in_user_units(text: str, key: str, sheet: tuple[float, float]) -> float:
    """Length of an attribute on a sheet of this width and height, in user units; not a number where it is none."""
    # Of a radius percentages are parts of the diagonal over the root of two; SVG 1.1, 7.10.
    sides = dict(zip(("x", "y", "width", "height"), 2 * sheet, strict=True))
    whole = sides.get(key.strip("cr12"), math.hypot(*sheet) / math.sqrt(2.0))
    units = {"": 1.0, "%": whole / 100.0} | {unit: size / UNITS["px"] for unit, size in UNITS.items()}
    match = re.fullmatch(rf"\s*({_NUMBER})\s*([a-z%]*)\s*", text)
    return float(match[1]) * units.get(match[2], math.nan) if match else math.nan


def _rectangle(element: ElementTree.Element, where: _Context) -> list[_Part]:
    x, y, w, h = (_length(element, key, where) for key in ("x", "y", "width", "height"))
    if not (w > 0 and h > 0):
        return []
    corners = rectangle(x, y, x + w, y + h)
    # A radius that is not given is the other one.
    given = [_length(element, key, where) for key in ("rx", "ry") if element.get(key, "auto").strip() != "auto"] or [
        0.0
    ]
    radii = np.minimum([given[0], given[-1]], [w / 2.0, h / 2.0])
    if not (radii > 0).all():
        return [_Part(corners, True)]
    points, curves = list[np.ndarray](), list[Curve]()
    for before, corner, after in zip(np.roll(corners, 1, axis=0), corners, np.roll(corners, -1, axis=0), strict=True):
        start, end = (corner + np.sign(other - corner) * radii for other in (before, after))
        points.append(start)
        _add_arc(points, curves, end, [*radii, 0.0, 0.0, 1.0], where)
    return [_Part(np.array(points), True, tuple(curves))]


def _ellipse(element: ElementTree.Element, where: _Context) -> list[_Part]:
    centre = np.array([_length(element, "cx", where), _length(element, "cy", where)])
    if _tag(element) == "circle":
        radii = np.full(2, _length(element, "r", where))
    else:
        radii = np.array([_length(element, "rx", where), _length(element, "ry", where)])
    if not (radii > 0).all():
        return []
    n = _chords(2 * math.pi, float(radii.max()), where)
    arc = Arc(0, n, centre, np.diag(radii), 0.0, 2 * math.pi)
    return [_Part(arc.at(np.arange(n) / n), True, (arc,))]


def _chords(sweep: float, radius: float, where: _Context) -> int:
    """Count the chords of an arc where it is drawn: transforms scale it."""
    radius *= float(np.linalg.norm(where.matrix[:2, :2], 2))
    return min(chords_of(sweep, radius, where.tolerance), MOST_CHORDS)


def _polygon(element: ElementTree.Element, where: _Context) -> list[_Part]:
    numbers = [float(x) for x in re.findall(_NUMBER, element.get("points", ""))]
    if len(numbers) % 2:
        raise ValueError(f"has {len(numbers)} coordinates, an odd number; repair it")
    return [_Part(np.array(numbers).reshape(-1, 2), _tag(element) == "polygon")]


def _segment(element: ElementTree.Element, where: _Context) -> list[_Part]:
    ends = np.array([[_length(element, f"{axis}{end}", where) for axis in "xy"] for end in (1, 2)])
    return [_Part(ends, False)]


def _steps(d: str) -> Iterator[tuple[str, list[float]]]:
    """Yield the commands of a path, each as often as it is repeated, with the numbers that it takes."""
    for command, arguments in _COMMAND.findall(d):
        # Only of arcs: the pattern of one takes long for a long number.
        groups = _ARC.findall(arguments) if command in "Aa" else [re.findall(_NUMBER, arguments)]
        numbers, takes = [float(number) for group in groups for number in group], _TAKES[command.upper()]
        if takes == 0 and numbers:
            raise ValueError("has numbers without a command in its path; repair it")
        if takes and (not numbers or len(numbers) % takes):
            raise ValueError(f"has a path command '{command}' with too few numbers; repair it")
        # What follows a move is a line.
        following = {"M": "L", "m": "l"}.get(command, command)
        for k in range(0, max(len(numbers), 1), max(takes, 1)):
            yield following if k else command, numbers[k : k + takes]


def _path(element: ElementTree.Element, where: _Context) -> list[_Part]:
    """Points of each subpath, and whether Z closes it."""
    parts: list[_Part] = []
    points: list[np.ndarray] = []
    curves: list[Curve] = []
    at = start = control = np.zeros(2)
    before = ""
    for command, v in _steps(element.get("d", "")):
        kind, relative = command.upper(), command.islower()
        if kind == "Z":
            parts.append(_Part(np.array(points).reshape(-1, 2), True, tuple(curves)))
            at, points, curves = start, [start], []
            before = kind
            continue
        base = at if relative else np.zeros(2)
        if kind == "M":
            if len(points) > 1:
                parts.append(_Part(np.array(points), False, tuple(curves)))
            at = start = base + v
            points, curves = [at], []
        elif kind in "LHV":
            if kind == "L":
                at = base + v
            else:
                at = np.array([base[0] + v[0], at[1]]) if kind == "H" else np.array([at[0], base[1] + v[0]])
            points.append(at)
        elif kind == "A":
            end = base + v[5:]
            _add_arc(points, curves, end, v[:5], where)
            at = end
        else:
            pairs = [base + pair for pair in np.array(v).reshape(-1, 2)]
            smooth = 2 * at - control if before in ("CS" if kind in "CS" else "QT") and before else at
            pairs = [smooth, *pairs] if kind in "ST" else pairs
            controls = np.array([at, *pairs])
            chords = bezier_chords(controls @ where.matrix[:2, :2].T, where.tolerance)
            curve = Bezier(len(points) - 1, chords, controls)
            curves.append(curve)
            points += [*curve.at(np.linspace(0.0, 1.0, curve.chords + 1)[1:-1]), pairs[-1]]
            control, at = pairs[-2], pairs[-1]
        before = kind
    if len(points) > 1:
        parts.append(_Part(np.array(points), False, tuple(curves)))
    return parts


def _add_arc(
    points: list[np.ndarray], curves: list[Curve], end: np.ndarray, v: Sequence[float], where: _Context
) -> None:
    """Add an elliptical arc to points and curves, and its end; SVG 1.1, appendix F.6.5 and F.6.6."""
    rx, ry, turn, start = abs(v[0]), abs(v[1]), math.radians(v[2]), points[-1]
    if rx == 0 or ry == 0 or (start == end).all():
        points.append(end)
        return
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    half = rotation.T @ (start - end) / 2.0 / [rx, ry]
    grow = float(half @ half)
    if not (math.isfinite(grow) and grow > 1e-24):
        # The ends coincide compared with the radii, or numbers overflow: a straight line.
        points.append(end)
        return
    if grow > 1:
        rx, ry, half = rx * math.sqrt(grow), ry * math.sqrt(grow), half / math.sqrt(grow)
    factor = math.sqrt(max(0.0, 1.0 / float(half @ half) - 1.0)) * (-1.0 if bool(v[3]) == bool(v[4]) else 1.0)
    centre = factor * np.array([half[1], -half[0]])
    first, last = half - centre, -half - centre
    begin = math.atan2(first[1], first[0])
    sweep = math.atan2(last[1], last[0]) - begin
    if v[4] and sweep < 0:
        sweep += 2 * math.pi
    elif not v[4] and sweep > 0:
        sweep -= 2 * math.pi
    n = _chords(sweep, max(rx, ry), where)
    middle = (start + end) / 2.0 + rotation @ (centre * [rx, ry])
    curves.append(Arc(len(points) - 1, n, middle, rotation * [rx, ry], begin, sweep))
    points += [*curves[-1].at(np.linspace(0.0, 1.0, n + 1)[1:-1]), end]


_SHAPES: dict[str, Callable[[ElementTree.Element, _Context], list[_Part]]] = {
    "rect": _rectangle,
    "circle": _ellipse,
    "ellipse": _ellipse,
    "polygon": _polygon,
    "polyline": _polygon,
    "line": _segment,
    "path": _path,
}


def _in_xml(text: str) -> str:
    """Text without control characters, for which XML has no place; the row of a block has its words as they are."""
    return re.sub(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]", "", text)


def write(layout: Layout, path: Path) -> None:
    """Write .svg in m: a layer per group, role or material, a path per block with its name as title."""
    every = np.concatenate(layout.outlines)
    low, high = every.min(axis=0), every.max(axis=0)
    size = np.maximum(high - low, 1e-9)
    margin = 0.02 * float(size.max())
    box = f"{low[0] - margin:.9g} {-high[1] - margin:.9g} {size[0] + 2 * margin:.9g} {size[1] + 2 * margin:.9g}"
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="{_INKSCAPE[1:-1]}" viewBox="{box}" '
        'data-blockvis-unit="m">',
    ]
    rows = rows_of(layout)
    layers = [_in_xml(layer) for layer in layers_of(layout, _LAYER)]
    # Blocks keep their order: a new group begins whenever the layer changes.
    for i, row in enumerate(rows):
        if i == 0 or layers[i] != layers[i - 1]:
            lines += ["</g>"] if i else []
            lines.append(
                f'<g inkscape:groupmode="layer" inkscape:label={quoteattr(layers[i])} fill="#e0cfae" stroke="#333" '
                f'stroke-width="{0.1 * margin:.4g}">'
            )
        points = " L ".join(f"{float(x)!r},{-float(y)!r}" for x, y in layout.outlines[i])
        title = escape(_in_xml(row["name"]))
        lines.append(f'<path d="M {points} Z" data-blockvis={quoteattr(json.dumps(row))}><title>{title}</title></path>')
    path.write_text("\n".join([*lines, "</g>", "</svg>", ""]), encoding="utf-8")
