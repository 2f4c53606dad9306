"""A case file for a drawing, written with what the drawing says and a comment on every key."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from blockvis.case_files import case_keys
from blockvis.cases.bonds import BOND
from blockvis.cases.build import DENSITY
from blockvis.cases.key import Key, Section
from blockvis.layout.inspect import Inspection
from blockvis.text import as_key, as_toml, rounded_length
from solver import mechanics

#: The first increment, and the limit, as fractions of the median block: steps pass over nothing that a block's movement
#: changes, and most structures have fallen, or shown that they do not, when a support has moved by a block.
INCREMENT, LIMIT = 0.05, 1.0

#: Friction of dry masonry joints where nothing is known, and a density that most stones and bricks are near.
FRICTION = 0.6

#: Parts of the names and layers of blocks that are supports, where the drawing says nothing of roles.
SUPPORT_WORDS = ("springer", "support", "ground", "foundation", "footing", "abutment", "bearing")

#: What a new case says of walls without stones.
WALLS = "The drawing has no stones but outlines with openings: give the size of yours."

#: Keys of a drawing in the plane, which one in space does not have.
_IN_THE_PLANE = ("window", "thickness", "closing", "outline_tolerance")

#: Characters of a line of comment.
WIDTH = 100


@dataclass(frozen=True)
class Ground:
    """What stands and what settles.

    Attributes
    ----------
    says : str
        How it was found.
    roles : mapping of str to str
        To write under [roles].
    supports : tuple of mappings
        To write as [[supports]].
    settles : bool
        Whether there is a moving support.
    """

    says: str
    roles: Mapping[str, str] = field(default_factory=dict)
    supports: tuple[Mapping[str, Any], ...] = ()
    settles: bool = True


def case_text(
    found: Inspection,
    file: str,
    *,
    view: str | None = None,
    ignore: Sequence[str] = (),
    only: Sequence[str] = (),
    window: Sequence[float] = (),
    walls: Sequence[str] = (),
    **image: Any,
) -> str:
    """Write the text of a case file for a drawing.

    Parameters
    ----------
    found : Inspection
        Of the drawing.
    file : str
        The drawing, relative to the case file.
    view, ignore, only, window, **image
        With which the drawing was read.
    walls : sequence of str
        Layers or names of outlines that are filled with a bond.

    Returns
    -------
    str
        TOML. Without supports in the drawing a ground of two halves is added, of which the right one settles; where
        nothing can settle, the case asks for the horizontal capacity.
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
        "joint_thickness": "auto" if found.joint_thickness > 0.0 and not walls else None,
        **image,
    }
    hidden = (*(_IN_THE_PLANE if in_space else ()), *(() if any(image.values()) else case_keys.OF_IMAGES))
    known = found.layout.density is not None and bool(np.isfinite(found.layout.density[found.kept]).all())
    parts = [
        _comment(f"Case of {Path(file).name}, written by blockvis new. Lengths in m, forces in N, angles in rad."),
        _comment(_counted(found)),
        *(_comment(f"Note: {note}") for note in found.layout.notes),
        "",
        _table(case_keys.GEOMETRY, geometry, leaving=("layout", "parameters", *hidden)),
        *([_table(BOND, {"walls": list(walls), "bond": "running", "brick": [0.25, 0.075]}, WALLS)] if walls else ()),
        _roles(found, ground),
        *(
            _table(case_keys.SUPPORTS, support, leaving=("material",) if in_space else ("material", "levels"))
            for support in ground.supports
        ),
        _table(
            case_keys.MATERIAL,
            {"density": None if known else DENSITY, "friction_coefficient": FRICTION},
            leaving=("cohesion", "compressive_strength"),
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
    beside = () if any(image.values()) else ("underlay",)
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


def block_size(found: Inspection) -> float:
    """Find the distance across the median free block [m]."""
    across = [float(np.linalg.norm(np.ptp(found.layout.corners(i), axis=0))) for i in _with_role(found, mechanics.FREE)]
    return float(np.median(across)) if across else 1.0


def ground_of(found: Inspection) -> Ground:
    """Say what stands and what settles, of what a drawing says.

    Parameters
    ----------
    found : Inspection
    """
    fixed, moving = _with_role(found, mechanics.FIXED), _with_role(found, mechanics.MOVING)
    if moving:
        return Ground("The drawing says which blocks are supports, and which of them move.")
    if not fixed and (named := _named_supports(found)):
        last = max(named, key=lambda label: named[label])
        roles = {label: mechanics.MOVING if label == last and len(named) > 1 else mechanics.FIXED for label in named}
        says = "The drawing says nothing of supports; these were taken by their names"
        return Ground(
            f"{says}, and the rightmost settles." if len(named) > 1 else f"{says}.", roles, settles=len(named) > 1
        )
    if not fixed:
        return Ground(
            "The drawing has no supports: here the ground below it stands on the left and settles on the right.",
            supports=_two_halves(found),
        )
    names = found.layout.names
    right = max(fixed, key=lambda i: float(found.layout.corners(i)[:, 0].mean()))
    if len(fixed) > 1 and names[right] and names.count(names[right]) == 1:
        return Ground(
            f"The drawing says which blocks are supports, but of none that it moves: here '{names[right]}' does.",
            roles={names[right]: mechanics.MOVING},
        )
    return Ground("The drawing has supports that stand, and none that moves.", settles=False)


def _named_supports(found: Inspection) -> dict[str, float]:
    """Where blocks stand in the mean [m] whose layer, or else name, is that of a support; by that layer or name."""
    layout = found.layout
    places: dict[str, list[float]] = {}
    for i in found.kept.tolist():
        labels = [layout.groups[i], layout.names[i]]
        label = next((one for one in labels if any(word in one.lower() for word in SUPPORT_WORDS)), None)
        if label is not None:
            places.setdefault(label, []).append(float(layout.corners(i)[:, 0].mean()))
    # A role is no key of all blocks: something must be left that can fall.
    if sum(map(len, places.values())) == len(found.kept):
        return {}
    return {label: sum(x) / len(x) for label, x in places.items()}


def _two_halves(found: Inspection) -> tuple[Mapping[str, Any], ...]:
    """Lay a ground under the lowest blocks, split where they leave a gap nearest to the middle, or in the middle."""
    corners = [found.layout.corners(i) for i in found.kept]
    up = found.layout.dimension - 1
    low = min(float(points[:, up].min()) for points in corners)
    depth = rounded_length(0.5 * block_size(found))
    near = 1e-3 * depth
    # Mortar between two stones is no opening.
    opening = near + 1.01 * found.joint_thickness
    feet = sorted(
        (float(foot.min()), float(foot.max()))
        for foot in (points[points[:, up] < low + near, 0] for points in corners)
        if len(foot)
    )
    left, right = feet[0][0], max(end for _, end in feet)
    middle, gaps, reached = 0.5 * (left + right), [], feet[0][1]
    for start, end in feet[1:]:
        if start > reached + opening:
            gaps.append(0.5 * (reached + start))
        reached = max(reached, end)
    split = min(gaps, key=lambda x: abs(x - middle), default=middle)

    def half(name: str, role: str, start: float, end: float) -> Mapping[str, Any]:
        if up == 2:
            front, back = float(found.low[1]) - depth, float(found.high[1]) + depth
            plan = [[start, front], [end, front], [end, back], [start, back]]
            return {"name": name, "role": role, "outline": plan, "levels": [low - depth, low]}
        corners = [[start, low - depth], [end, low - depth], [end, low], [start, low]]
        return {"name": name, "role": role, "outline": corners}

    return (
        half("ground left", mechanics.FIXED, left - depth, split),
        half("ground right", mechanics.MOVING, split, right + depth),
    )


def _with_role(found: Inspection, role: str) -> list[int]:
    return [int(i) for i in found.kept if found.roles[i] == role]


def _counted(found: Inspection) -> str:
    size = (found.high - found.low).tolist()
    roles = [f"{len(_with_role(found, role))} {role}" for role in mechanics.ROLES if _with_role(found, role)]
    deep = f"{size[1]:.4g} m deep, " if len(size) == 3 else ""
    where = " in space" if deep else ""
    return f"{len(found.kept)} blocks{where}, {', '.join(roles)}; {size[0]:.4g} m wide, {deep}{size[-1]:.4g} m high."


def _roles(found: Inspection, ground: Ground) -> str:
    section = case_keys.ROLES
    lines = [_comment(f"{section.meaning}. {ground.says}")]
    as_drawn = [i for i in found.kept if found.roles[i] != mechanics.FREE and found.layout.names[i] not in ground.roles]
    drawn = dict.fromkeys((found.layout.names[i], found.roles[i]) for i in as_drawn)
    said = [f"{as_key(name)} = {as_toml(role)}" for name, role in list(drawn)[:12]]
    if not said and not ground.roles:
        groups = sorted({word for word in found.layout.groups if word})
        said = [f"{as_key(group)} = {as_toml(mechanics.FIXED)}" for group in groups[:12]]
    lines += [section.header if ground.roles else f"# {section.header}"]
    lines += [f"{as_key(name)} = {as_toml(role)}" for name, role in ground.roles.items()]
    return "\n".join([*lines, *(f"# {line}" for line in said), ""])


def _all_but(*names: str, section: Section = case_keys.ANALYSIS) -> tuple[str, ...]:
    return tuple(key.name for key in section.keys if key.name not in names)


def _table(
    section: Section,
    values: Mapping[str, Any],
    says: str = "",
    *,
    leaving: Sequence[str] = (),
    single: bool = False,
) -> str:
    """Write a table: the keys that have a value, the others as comments.

    Parameters
    ----------
    section : Section
    values : mapping
        By the names of keys; None for a key that is not given.
    says : str
        Comment beside the meaning of the table.
    leaving : sequence of str
        Keys that are not written at all.
    single : bool
        Whether the table is written as the only one of its kind.
    """
    lines = [_comment(f"{section.meaning}. {says}".strip()), f"[{section.name}]" if single else section.header]
    for key in section.keys:
        if key.name in leaving:
            continue
        given = values.get(key.name)
        lines.append(_comment(_about(key, given=given is not None)))
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
