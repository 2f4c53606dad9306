"""A case file for a drawing, written with what the drawing says and a comment on every key."""

from __future__ import annotations

import math
import os
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis.case_files import case_keys
from blockvis.cases.bonds import BOND
from blockvis.cases.build import DENSITY
from blockvis.cases.key import Key, Section
from blockvis.layout.ground import COURSE, Ground, block_size, ground_of, with_role
from blockvis.layout.inspect import Inspection
from blockvis.layout.notes import OF_UNITS, UNIT, kind_of
from blockvis.layout.units import units_instead
from blockvis.text import as_key, as_toml, rounded_length
from solver import mechanics
from solver.mechanics import counted

#: The first increment, and the limit, as fractions of the median block: steps pass over nothing that a block's movement
#: changes, and most structures have fallen, or shown that they do not, when a support has moved by a block.
INCREMENT, LIMIT = 0.05, 1.0

#: What a new case says of walls without stones.
WALLS = "The drawing has no stones but outlines with openings: give the size of yours."

#: Keys of a drawing in the plane, which one in space does not have.
_IN_THE_PLANE = ("window", "thickness", "closing", "outline_tolerance")

#: Middles of blocks are told apart from this part of the median block on.
APART = 0.05

#: Characters of a line of comment.
WIDTH = 100


def case_text(
    found: Inspection,
    file: str,
    *,
    view: str | None = None,
    ignore: Sequence[str] = (),
    only: Sequence[str] = (),
    window: Sequence[float] = (),
    walls: Sequence[str] = (),
    unit_says: str = "",
    **image: Any,
) -> str:
    """Write the text of a case file, TOML, for a drawing that is inspected; ``file`` is relative to the case file.

    Without supports in the drawing a ground of two halves is added, of which the right one settles; where nothing can
    settle, the case asks for the horizontal capacity.

    Parameters
    ----------
    view, ignore, only, window, **image
        With which the drawing was read.
    walls : sequence of str
        Layers or names of outlines that are filled with a bond.
    unit_says : str
        What is said of its unit; see :func:`unit_instead`.
    """
    block = block_size(found)
    ground = ground_of(found)
    in_space = found.layout.dimension == 3
    down = [*[0.0] * (found.layout.dimension - 1), -1.0]
    geometry = {
        "file": file,
        "unit": found.layout.unit,
        "view": view,
        "ignore": list(ignore) or None,
        "only": list(only) or None,
        "window": list(window or ()) or None,
        "dimension": 3 if in_space else None,
        "joint_thickness": "auto" if found.joint_thickness > 0.0 else None,
        **image,
    }
    hidden = (*(_IN_THE_PLANE if in_space else ()), *(() if any(image.values()) else case_keys.OF_IMAGES))
    known = found.layout.density is not None and bool(np.isfinite(found.layout.density[found.kept]).all())
    parts = [
        _comment(f"Case of {Path(file).name}, written by blockvis new. Lengths in m, forces in N, angles in rad."),
        _comment(_counted(found)),
        *(_comment(f"Note: {note}") for note in found.layout.notes if kind_of(note) not in OF_UNITS),
        "",
        _table(
            case_keys.GEOMETRY,
            geometry,
            leaving=("layout", "parameters", *hidden),
            beside={"unit": unit_says or _notes(found, *OF_UNITS)},
        ),
        *([_table(BOND, {"walls": list(walls), "bond": "running", "brick": [0.25, 0.075]}, WALLS)] if walls else ()),
        _roles(found, ground),
        *(
            _table(case_keys.SUPPORTS, support, leaving=("material", "stiffness", *(() if in_space else ("levels",))))
            for support in ground.supports
        ),
        _table(
            case_keys.MATERIAL,
            {"density": None if known else DENSITY, "friction_coefficient": solver.InterfaceLaw.friction_coefficient},
            leaving=case_keys.OF_MORTAR,
        ),
    ]
    if ground.settles:
        increment = rounded_length(INCREMENT * block)
        motion = {"direction": down, "increment": increment, "limit": rounded_length(LIMIT * block)}
        says = f"The blocks are {block:.3g} m across in the middle; the increment and the limit suit that."
        # Another motion than a translation has keys that exclude its direction.
        leaving = ("rotation", "rotation_axis", "radial_from", *(("rotation_centre",) if in_space else ()))
        parts.append(_table(case_keys.SETTLEMENT, motion, says, leaving=leaving, single=True))
    else:
        says = "Nothing can settle; this asks for the horizontal acceleration, as a fraction of gravity, at failure."
        parts.append(_table(case_keys.ANALYSIS, {"kind": "limit load"}, says, leaving=_all_but("kind", "flow")))
        leaving = _all_but("kind", "blocks", "weight_fraction", section=case_keys.LOADS)
        push = [1.0, *[0.0] * (found.layout.dimension - 1)]
        parts.append(_table(case_keys.LOADS, {"kind": "live", "weight_fraction": push}, leaving=leaving))
    beside = (*(() if any(image.values()) else ("underlay",)), *(() if in_space else ("view", "section")))
    parts.append(_table(case_keys.OUTPUT, {"animation": "collapse.mp4"}, leaving=beside))
    parts.append(_comment("There are more tables and keys: blockvis schema lists them."))
    return "\n".join(parts) + "\n"


def relative_to(folder: Path, drawing: str | Path) -> str:
    """Write the path of a drawing as a case file in a folder names it: with "/" on every system.

    A drawing on another drive has no relative path, and is named in full.
    """
    try:
        path = os.path.relpath(drawing, folder)
    except ValueError:
        path = os.path.abspath(drawing)
    return Path(path).as_posix()


def unit_instead(found: Inspection) -> tuple[str, str]:
    """Find the unit in which a drawing is masonry, "" where its own is not in doubt, and what is said of the unit.

    ValueError for a page whose blocks are too small for masonry: its scale cannot be told.
    """
    by, page = found.layout.unit_by, found.layout.unit_by == "page"
    unit = next(iter(units_instead(found.layout.unit, float(np.median(found.layout.sizes)), page=page)), "")
    if not unit or by in ("layout", "user"):
        return "", _notes(found, *OF_UNITS)
    if page:
        raise ValueError(f"'{found.layout.source}': {_notes(found, UNIT)}")
    doubted = _notes(found, UNIT).partition(": say so")[0]
    return unit, f"{doubted}; the file is read in {unit} here"


def _notes(found: Inspection, *kinds: str) -> str:
    return "; ".join(str(note) for note in found.layout.notes if kind_of(note) in kinds)


def _counted(found: Inspection) -> str:
    size = (found.high - found.low).tolist()
    roles = [f"{len(with_role(found, role))} {role}" for role in mechanics.ROLES if with_role(found, role)]
    deep = f"{size[1]:.4g} m deep, " if len(size) == 3 else ""
    where = " in space" if deep else ""
    return (
        f"{counted(len(found.kept), 'block')}{where}, {', '.join(roles)}; "
        f"{size[0]:.4g} m wide, {deep}{size[-1]:.4g} m high."
    )


def _roles(found: Inspection, ground: Ground) -> str:
    section = case_keys.ROLES
    lines = [_comment(f"{section.meaning}. {ground.says}")]
    as_drawn = [i for i in found.kept if found.roles[i] != mechanics.FREE and found.layout.names[i] not in ground.roles]
    drawn = dict.fromkeys((found.layout.names[i], found.roles[i]) for i in as_drawn)
    said = [f"{as_key(name)} = {as_toml(role)}" for name, role in list(drawn)[:12]]
    if not said and not ground.roles:
        groups = sorted({word for word in found.layout.groups if word})
        said = [f"{as_key(group)} = {as_toml(mechanics.FIXED)}" for group in groups[:12]]
    said += _places(found, ground)
    lines += [section.header]
    lines += [f"{as_key(name)} = {as_toml(role)}" for name, role in ground.roles.items()]
    return "\n".join([*lines, *(f"# {line}" for line in said), ""])


def _places(found: Inspection, ground: Ground) -> list[str]:
    """Write the key that chooses the supports, or else the lowest course, by the place of their middles, if it can.

    Those to the right of a gap, near the middle of them, move; they are chosen first, as a later place holds.
    """
    boxes = [(corners.min(axis=0), corners.max(axis=0)) for corners in map(found.layout.corners, found.kept)]
    low, high = (np.array(ends) for ends in zip(*boxes, strict=True))
    middle, height = (low + high) / 2.0, high[:, -1] - low[:, -1]
    own = [found.roles[i] != mechanics.FREE or found.layout.names[i] in ground.roles for i in found.kept]
    chosen = np.array(own) if any(own) else low[:, -1] <= low[:, -1].min() + COURSE * np.median(height)
    least = APART * float(np.median(found.layout.sizes[found.kept]))
    top, others = float(middle[chosen, -1].max()), middle[~chosen, -1]
    if not len(others) or others.min() - top < least:
        return []
    place = {"xyz"[found.layout.dimension - 1]: _between(top, float(others.min()))}
    across = np.sort(middle[chosen, 0])
    gaps = np.diff(across)
    if gaps.max(initial=0.0) < least:
        return [f"below = {as_toml(place)}"]
    wide = np.flatnonzero(gaps >= 0.5 * gaps.max())
    k = wide[np.abs(across[wide] + across[wide + 1] - across[0] - across[-1]).argmin()]
    left = {"x": _between(float(across[k]), float(across[k + 1]))} | place
    return [f"below = [{as_toml(place | {'role': mechanics.MOVING})}, {as_toml(left)}]"]


def _between(first: float, last: float) -> float:
    """Give a number half-way between two, with few digits."""
    return round((first + last) / 2.0, 1 - math.floor(math.log10(last - first))) + 0.0


def _all_but(*names: str, section: Section = case_keys.ANALYSIS) -> tuple[str, ...]:
    return tuple(key.name for key in section.keys if key.name not in names)


def _table(
    section: Section,
    values: Mapping[str, Any],
    says: str = "",
    *,
    leaving: Sequence[str] = (),
    single: bool = False,
    beside: Mapping[str, str] | None = None,
) -> str:
    """Write a table: the keys that have a value, the others, but for those left out, as comments.

    It may be written as the ``single`` one of its kind, with what it ``says`` and, of keys, ``beside`` their meaning.
    """
    lines = [_comment(f"{section.meaning}. {says}".strip()), f"[{section.name}]" if single else section.header]
    for key in section.keys:
        if key.name in leaving:
            continue
        given = values.get(key.name)
        lines.append(_comment(_about(key, given=given is not None)))
        if beside and beside.get(key.name):
            lines.append(_comment(f"Note: {beside[key.name]}"))
        shown = _other(key, values) if given is None else given
        lines.append(f"{'# ' if given is None else ''}{key.name} = {as_toml(shown)}")
    return "\n".join([*lines, ""])


def _other(key: Key, values: Mapping[str, Any]) -> Any:
    """Find a value for a key that is shown in a comment: what holds without it, or one that suits the others."""
    if key.name == "tolerance" and "increment" in values:
        return float(f"{values['increment'] / 100.0:.6g}")
    return key.example if key.default in (None, ()) else key.default


def _about(key: Key, *, given: bool) -> str:
    unit = f" [{key.unit}]" if key.unit else ""
    missing = f"; without it {key.otherwise}" if key.otherwise and not given else ""
    choices = f": {', '.join(key.choices)}" if key.choices and not all(c in key.meaning for c in key.choices) else ""
    return f"{key.meaning}{choices}{unit}{missing}"


def _comment(text: str) -> str:
    # Layers may have names that TOML refuses even in a comment.
    text = "".join(c if c.isprintable() or c.isspace() else "\ufffd" for c in text)
    return "\n".join(f"# {line}" for line in textwrap.wrap(text, WIDTH, break_long_words=False))
