"""Every key of the case file, in the order of its tables; :mod:`blockvis.case_files.read` reads by them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis.cases.backfill import BACKFILL
from blockvis.cases.bonds import BOND
from blockvis.cases.build import THICKNESS
from blockvis.cases.explain_settings import EXPLAIN
from blockvis.cases.imperfections import IMPERFECTIONS
from blockvis.cases.key import (
    FRACTION,
    NOT_NEGATIVE,
    NUMBER,
    OUTLINE,
    PAIR,
    POSITIVE,
    SHARE,
    TEXT,
    TEXTS,
    TRIPLE,
    TRUE_OR_FALSE,
    VECTOR,
    Key,
    Section,
    ValueKind,
    list_of,
    one_of,
    pair_of,
    read_by,
    table_of,
    whole,
)
from blockvis.cases.profiles import PROFILE, PROFILES
from blockvis.cases.removals import REMOVE
from blockvis.cases.ties import TIES
from blockvis.cases.toml_table import Table, shortened
from blockvis.generators import LAYOUTS
from blockvis.kinds.kinds import KINDS
from blockvis.layout.inspect import DENSITY
from blockvis.layout.joints.close import WAYS
from blockvis.layout.selection import checked_window
from blockvis.layout.sights import SIGHTS, read_cut, read_sight
from blockvis.layout.units import UNITS
from blockvis.layout.views import VIEWS, checked_dimension
from blockvis.results.folder import FOLDERS, VIDEO_SUFFIXES
from solver import mechanics

_FRICTION = solver.InterfaceLaw.friction_coefficient
_CONTROLS = solver.Controls()

#: More increments, frames or runs than this are taken for a typing error.
MOST_STEPS = 1_000_000


def _in_any_letters(words: tuple[str, ...]) -> str:
    """Write a pattern of these words in capital or small letters, "-" and "_" for a space as layouts accept them."""

    def accepted(letter: str) -> str:
        if letter in " -":
            return "[ _-]"
        return "[cCçÇ]" if letter == "c" else f"[{letter}{letter.upper()}]"

    return "|".join("".join(map(accepted, word)) for word in words)


def _thickness_or_auto(table: Table, key: Key) -> float | str | None:
    if table.take(key.name) == "auto":
        return "auto"
    value: float | None = table.number(key.name)
    if value is not None and value < 0.0:
        raise table.error(key.name, f'is {value:g}; give a thickness in m of at least 0, or "auto"')
    return value


def _film(table: Table, key: Key) -> str | bool | None:
    value = table.take(key.name)
    if value is False or value is None:
        return value
    name: str = table.text(key.name)
    bare = name.removesuffix("/")
    pictures = bare != name and not Path(bare).suffix and bare not in FOLDERS
    if Path(bare).name != bare or "\\" in name or not (pictures or name.lower().endswith(VIDEO_SUFFIXES)):
        raise table.error(
            key.name,
            f"is {shortened(name)}; give a name ending in {', '.join(VIDEO_SUFFIXES)}, without a folder: "
            'it is written into the results folder; or one such as "frames/" for a folder of pictures; false for none',
        )
    return name


def _background(value: Any) -> int | str:
    if isinstance(value, bool) or not isinstance(value, int | str):
        raise ValueError(f'is {shortened(value)}; give a whole number, or a colour such as "white"')
    return value


def _moment(table: Table, key: Key) -> float | tuple[float, float, float] | None:
    kind = TRIPLE if isinstance(table.take(key.name), list | tuple) else NUMBER
    found: float | tuple[float, float, float] | None = kind.read(table, key)
    return found


def _two_names(table: Table, key: Key) -> tuple[str, str]:
    pair = table.texts(key.name) or ()
    if len(pair) != 2:
        raise table.error(key.name, f'is {list(pair)}; name two materials ["stone", "brick"]')
    return pair[0], pair[1]


def _places(given: tuple[float, ...]) -> tuple[float, ...]:
    if len(given) != 3 or given[2] != int(given[2]) or not 2 <= given[2] <= MOST_STEPS or given[0] >= given[1]:
        says = f"[first x, last x, number of places], from 2 to {MOST_STEPS} places"
        raise ValueError(f"is {list(given)}; give {says}")
    # Tables have -2.2, and not -2.1999999999999997.
    return tuple(np.linspace(given[0], given[1], int(given[2])).round(12).tolist())


_LAYOUT = ValueKind(
    "text",
    {"anyOf": [{"enum": list(LAYOUTS)}, {"type": "string", "pattern": f"^({_in_any_letters(tuple(LAYOUTS))})$"}]},
    TEXT.read,
)
_UNIT = ValueKind("text", {"anyOf": [{"enum": list(UNITS)}, {"type": "string"}]}, TEXT.read)
_THICKNESS_OR_AUTO = ValueKind(
    'number of at least 0, or "auto"', {"anyOf": [NOT_NEGATIVE.schema, {"const": "auto"}]}, _thickness_or_auto
)
_endings = "|".join("".join(f"[{c}{c.upper()}]" if c.isalpha() else re.escape(c) for c in s) for s in VIDEO_SUFFIXES)
_FILM = ValueKind(
    f"name of a file ending in {', '.join(VIDEO_SUFFIXES)}, name of a folder ending in /, or false",
    {"anyOf": [{"type": "string", "pattern": rf"^[^/\\]*({_endings})$|^[^/\\.]+/$"}, {"const": False}]},
    _film,
)
_DIMENSION = ValueKind('2, 3 or "auto"', {"anyOf": [{"enum": [2, 3]}, {"const": "auto"}]}, read_by(checked_dimension))
_BACKGROUND = ValueKind("whole number or colour", {"type": ["integer", "string"]}, read_by(_background))
_MOMENT = ValueKind("number, in space three", {"anyOf": [NUMBER.schema, TRIPLE.schema]}, _moment)
_TWO_NAMES = ValueKind("two texts", list_of(TEXT.schema, 2, 2), _two_names)
_PLACES = replace(TRIPLE, words="three numbers: from, to, number of places", read=read_by(_places, Table.numbers))
_LEVELS = pair_of("[bottom, top]")
# Of the kinds that there are when a case is read.
_KIND = replace(one_of(tuple(KINDS)), read=lambda table, key: table.text(key.name, among=tuple(KINDS)))
_PUSHES = pair_of("[x, y]: pressure is of blocks in the plane, in space give force")
_WINDOW = ValueKind("four numbers", list_of(NUMBER.schema, 4, 4), read_by(checked_window, Table.numbers))
_SIGHT = ValueKind(
    "a word, or table: azimuth, elevation",
    {
        "anyOf": [
            {"enum": list(SIGHTS)},
            table_of(
                {
                    "azimuth": {"type": "number", "minimum": -360, "maximum": 360},
                    "elevation": {"type": "number", "minimum": -90, "maximum": 90},
                }
            )
            | {"minProperties": 1},
        ]
    },
    read_by(read_sight),
)
_CUT = ValueKind(
    'text as "y = 1.2", or table: normal, point',
    {
        "anyOf": [
            {"type": "string", "pattern": "^ *[xyz] *(= *[-+0-9.eE]+ *)?$"},
            table_of({"point": TRIPLE.schema, "normal": TRIPLE.schema}, ("normal",)),
        ]
    },
    read_by(read_cut),
)


_STRENGTH = (
    Key("cohesion", NOT_NEGATIVE, "Cohesion of the joints; a point that has slipped or opened has lost it",
        1e5, "Pa", solver.InterfaceLaw.cohesion),
    Key("tensile_strength", NOT_NEGATIVE, "Tensile strength of the joints, at most cohesion over friction; "
        "lost with the cohesion", 5e4, "Pa", solver.InterfaceLaw.tensile_strength),
    Key("compressive_strength", POSITIVE, "Compressive strength of the joints, in limit loads without a settlement",
        5e6, "Pa", otherwise="infinite"),
    Key("normal_stiffness", POSITIVE, "Stiffness of the joints across, along a path", 5e9, "Pa/m",
        otherwise="rigid"),
    Key("shear_stiffness", POSITIVE, "Stiffness of the joints along, along a path", 2e9, "Pa/m",
        otherwise="rigid"),
    Key("fracture_opening", NOT_NEGATIVE, "Opening over which a point loses its strength", 1e-4, "m",
        solver.InterfaceLaw.fracture_opening),
    Key("fracture_slip", NOT_NEGATIVE, "Slip over which a point loses its strength", 5e-4, "m",
        solver.InterfaceLaw.fracture_slip),
)  # fmt: skip

#: Keys of the strength and the stiffness of joints.
OF_MORTAR = tuple(key.name for key in _STRENGTH)

PARAMETERS = Section(
    "geometry.parameters",
    "Parameters of the layout; blockvis layout takes the same",
    names=ValueKind("number, text, list or table", {}),
    example={"span": 4.0, "rise": 1.0, "voussoirs": 15},
)

_PARAMETERS = ValueKind("table", PARAMETERS.schema, lambda table, key: table.table(key.name).values)

GEOMETRY = Section(
    "geometry",
    "Where the blocks are: a file, or a layout by its parameters",
    (
        Key(
            "file",
            TEXT,
            "Layout file, relative to the case file; or a folder, or a pattern of files, one per stone",
            "facade.dxf",
            otherwise="layout is given instead",
        ),
        Key("layout", _LAYOUT, "Name of a parametric layout", "segmental arch", otherwise="file is given instead"),
        Key(
            "parameters",
            _PARAMETERS,
            "Parameters of the layout, see [geometry.parameters]",
            {"span": 4.0},
            otherwise="each parameter at its default",
        ),
        Key("unit", _UNIT, "Unit of the file's lengths, or a number of it, 20 mm, if the file does not say or is wrong",
            "mm", otherwise="what the file states, else m"),
        Key("view", one_of(tuple(VIEWS)), "Coordinates to take as x and y, of a drawing in space", "xz",
            otherwise="those in which the bodies lie side by side"),
        Key("dimension", _DIMENSION, "Whether blocks are in the plane or in space, where gravity acts along -z", 3,
            otherwise="in space where bodies are not prisms side by side", default="auto"),
        Key("ignore", TEXTS, "Layers, groups, materials and names, or patterns of them, to leave out; of drawings also "
            "kinds of entities, as circle or hatch, and colours, #rrggbb or a number of AutoCAD's",
            ["axes", "dim*"], default=()),
        Key("only", TEXTS, "Layers, groups, materials and names, or patterns of them, beside which all is left out",
            ["stones"], default=()),
        Key("ties", TEXTS, "Layers of a .dxf or .svg, or patterns of them, whose lines are ties, see [[ties]] "
            "layer; they are no joints and no outlines", ["TIES"], default=()),
        Key("window", _WINDOW, "What is read of a drawing in the plane: [x0, y0, x1, y1], as blockvis info prints them",
            [0.0, 0.0, 6.0, 3.5], "m", otherwise="all of it"),
        Key("width", POSITIVE, "Width of an image, or of that of annotations", 1.2, "m",
            otherwise="height, pixel or a world file says its scale"),
        Key("height", POSITIVE, "Height of the image, instead", 0.9, "m", otherwise="width, pixel or a world file"),
        Key("pixel", POSITIVE, "Size of a pixel of the image, instead", 0.002, "m",
            otherwise="width, height or a world file"),
        Key("background", _BACKGROUND, "Value of an image, or colour, of what is no stone", 0,
            otherwise="0, or what is on most of the rim; of a mask that between more stones"),
        Key("smallest", POSITIVE, "Regions of an image less than this across (root of the area) are specks", 0.01, "m",
            otherwise="a twentieth of the typical stone"),
        Key("thickness", POSITIVE, "Thickness out of plane of blocks for which the file has none; bodies have "
            "their own", 0.25, "m", THICKNESS, elsewhere=True),
        Key("joint_thickness", _THICKNESS_OR_AUTO,
            'Gaps between facing edges up to this width are closed; "auto" measures them', "auto", "m", 0.0),
        Key("closing", one_of(WAYS),
            'In the plane, how joints are closed: "faces" moves edges to their midline, "voronoi" gives mortar to the '
            "nearest stone", "faces", default="auto"),
        Key("outline_tolerance", NOT_NEGATIVE,
            "In the plane, corners within this distance of a simpler outline are dropped; 0 keeps every corner",
            0.002, "m",
            otherwise="a hundredth of a block where outlines have more than 24 corners in the mean, else 0"),
        Key("overlap_tolerance", POSITIVE, "Overlap of two blocks that is resolved to its midline", 0.001, "m",
            otherwise="0.04 of the width of a typical block, of a file in space 0.01, of a parametric layout a "
            "thousandth of the thinnest one"),
    ),
    required=True,
)  # fmt: skip

#: Keys of [geometry] of an image.
OF_IMAGES = ("width", "height", "pixel", "background", "smallest")


def _by_place(coordinate: Mapping[str, Any], words: str) -> ValueKind:
    """Make the kind of tables that choose blocks by coordinates and give them a role."""
    role = {"enum": list(mechanics.ROLES)}
    table = table_of(dict.fromkeys("xyz", coordinate) | {"role": role})
    words = f'table of {words} for x, y or z, and role ("fixed" if missing), or a list of such'
    return ValueKind(words, {"anyOf": [table, {"type": "array", "items": table}, role]})


ROLES = Section(
    "roles",
    "Role of blocks by their name, group (layer) or material, or a pattern of them, which holds over what the file "
    "says; or by their place, for files without names: touching holds over below, box over both, of one key the later "
    "table over the earlier, and a name over all",
    (Key("below", _by_place(NUMBER.schema, "a number"), "Blocks whose middle lies below", {"z": 0.1}, "m",
         otherwise="none"),
     Key("touching", _by_place(NUMBER.schema, "a number"), "Blocks that reach a plane", {"x": 3.0, "role": "moving"},
         "m", otherwise="none"),
     Key("box", _by_place(PAIR.schema, "two numbers"), "Blocks whose middle lies between",
         {"x": [0.0, 1.0], "z": [0.0, 0.2]}, "m", otherwise="none")),
    names=one_of(mechanics.ROLES),
    example={"left springer": "fixed", "right springer": "moving"},
)  # fmt: skip

SUPPORTS = Section(
    "supports",
    "A support that the drawing does not contain",
    (
        Key("name", TEXT, "Name of the support, which nothing else has", "ground left", default="support"),
        Key("role", one_of((mechanics.FIXED, mechanics.MOVING)), "Whether the support stands or settles", "moving",
            default=mechanics.FIXED),
        Key("outline", OUTLINE, "Corners in order; in space those of its plan",
            [[-0.5, -0.3], [4.0, -0.3], [4.0, 0.0], [-0.5, 0.0]], "m", required=True),
        Key("levels", _LEVELS, "In space, z of its bottom and top", [-0.3, 0.0], "m", otherwise="required in space"),
        Key("material", TEXT, "Material, for [[interfaces]]", "rock", otherwise="none"),
        Key("stiffness", POSITIVE, "Subgrade modulus of the ground, which along a path gives under the blocks on it "
            "and does not pull; a settlement is that of the ground below", 5e7, "Pa/m", otherwise="rigid"),
    ),
    several=True,
)  # fmt: skip

MATERIAL = Section(
    "material",
    "Blocks and joints for which nothing else is said",
    (
        Key("density", POSITIVE, "Density of blocks for which the file has none; of every block of a parametric layout",
            2000.0, "kg/m³", DENSITY, elsewhere=True),
        Key("friction_coefficient", NOT_NEGATIVE, "Coefficient of friction, the tangent of the angle of friction",
            0.6, default=_FRICTION),
        *_STRENGTH,
    ),
)  # fmt: skip

MATERIALS = Section(
    "materials.*",
    "Blocks of one material, by its name in the layout file",
    (Key("density", POSITIVE, "Density of its blocks, whatever the file says", 2400.0, "kg/m³",
         otherwise="the file's, else that of [material]"),),
)  # fmt: skip

INTERFACES = Section(
    "interfaces",
    "Joints between two materials",
    (
        Key("materials", _TWO_NAMES, "The two materials; the same one twice for joints within it", ["stone", "brick"],
            required=True),
        Key("friction_coefficient", NOT_NEGATIVE, "Coefficient of friction of these joints", 0.4, required=True),
        *_STRENGTH,
    ),
    several=True,
)  # fmt: skip

SETTLEMENT = Section(
    "settlement",
    "How moving supports move; several tables [[settlement]] are phases, one after another",
    (
        Key("direction", VECTOR, "Direction of the translation; its length does not count", [0.0, -1.0],
            otherwise="no translation"),
        Key("rotation_centre", VECTOR, "Point about which the supports turn", [2.0, 0.0], "m",
            otherwise="no rotation"),
        Key("rotation_axis", TRIPLE, "In space, the axis about which the supports turn, counter-clockwise seen from "
            "its tip", [0.0, 1.0, 0.0], otherwise="no rotation; required in space with a rotation_centre"),
        Key("rotation", NUMBER,
            "Without a direction 1 for counter-clockwise or -1 for clockwise; with one the angle per distance", 1.0,
            "rad/m", otherwise="1 with a rotation_centre, else 0"),
        Key("radial_from", PAIR, "In space, instead of a direction: x and y of a vertical axis from which each support "
            "moves away, level", [0.0, 0.0], "m", otherwise="no radial motion"),
        Key("increment", POSITIVE, "Largest step of the settlement; of a rotation alone in rad", 0.01, "m", 0.01),
        Key("limit", POSITIVE, "Settlement at which to stop if nothing has collapsed; of a rotation alone in rad", 0.5,
            "m", 1.0),
        Key("tolerance", POSITIVE, "Width of the bracket of the collapse; of a rotation alone in rad", 1e-4, "m",
            otherwise="a hundredth of the increment"),
        Key("step_tolerance", FRACTION, "Relative error of the reaction that steps aim for; the smallest that a "
            "settlement gives holds for all", 0.002, default=_CONTROLS.step_tolerance, elsewhere=True),
        Key("local_loss", SHARE, "Share of the weight up to which blocks that leave for good are let go and the path "
            "goes on without them; 0 ends it at the first, and the smallest that a settlement gives holds for all", 0.0,
            default=_CONTROLS.local_loss, elsewhere=True),
        Key("profile", PROFILES, "In the plane, how far each support goes, in proportion: a Gaussian trough or heave "
            "along x, points of a table, or one vector and rotation per support; s is the largest displacement of a "
            "support where it turns: in the middle of its bearing face, else at its centroid",
            {"kind": "gaussian", "centre": 1.5, "inflection": 0.8}, "m", otherwise="all go as far"),
        Key("blocks", TEXTS, "Names of the moving supports that take part; the others stand still. A name is "
            "of all supports that are drawn with it",
            ["ground right"], otherwise="all moving supports"),
    ),
    several=True,
)  # fmt: skip

LOADS = Section(
    "loads",
    "A load beside self-weight",
    (
        Key("kind", one_of(("dead", "live")), "Dead loads act from the start; live loads are scaled by the multiplier",
            "live", default="dead"),
        Key("blocks", TEXT, "Name of the free blocks on which it acts, or a pattern, or material, of drawings a layer",
            "brick 10-*", default="*"),
        Key("weight_fraction", VECTOR, "Force as a fraction of the weight of each block and of the fill over it: a "
            "horizontal acceleration",
            [1.0, 0.0], otherwise="none"),
        Key("force", VECTOR, "Force on each of the blocks", [0.0, -500.0], "N", (0.0, 0.0)),
        Key("point", VECTOR, "Point in the drawing at which the force acts, and which goes with its block; of several "
            "blocks the one that holds it is loaded",
            [1.0, 2.0], "m", otherwise="the centroid of each block"),
        Key("moment", _MOMENT, "Moment on each of the blocks, counter-clockwise; in space about x, y and z", 100.0,
            "N·m", 0.0),
        Key("pressure", NUMBER, "In the plane, pressure on the first faces in the way of direction, or on an edge: a "
            "force that goes with its block and keeps its direction", 1000.0, "Pa", otherwise="none"),
        Key("direction", _PUSHES, "In the plane, direction in which the pressure pushes", [1.0, 0.0],
            default=(0.0, -1.0)),
        Key("edge", whole(1), "In the plane, number of the edge into which the pressure pushes, counter-clockwise "
            "from the first corner, in whichever sense it is drawn", 2, otherwise="the faces in the way of direction"),
        Key("positions", _PLACES,
            "Places x of a live force that moves over what is topmost there; several such forces, as axles, move "
            "together, over as many places each", [-1.9, 1.9, 77], "m", otherwise="none"),
        Key("y", NUMBER, "The y of all positions, of blocks in space", 0.5, "m", otherwise="none"),
        Key("phase", whole(1), "Number of the [[settlement]] from which on a dead load acts", 2, default=1),
    ),
    several=True,
)  # fmt: skip

#: Keys of [analysis] that are those of no kind of analysis.
ANALYSIS_KEYS = (
    Key("kind", _KIND,
        "Settlement: until equilibrium is lost; limit load: the multiplier of the live loads at failure; pushover: "
        "the multiplier over a control displacement", "limit load", default=next(iter(KINDS))),
    Key("increments", one_of((mechanics.COULOMB, mechanics.LINEAR_PROGRAM)),
        'How increments are found: "coulomb", the path that friction without lift leaves, or "linear program", one '
        "per increment (Portioli and Cascini, 2017), of settlements only", "coulomb",
        default="coulomb"),
    Key("falling_frames", whole(0, MOST_STEPS), "Frames of the mechanism after collapse", 20,
        default=_CONTROLS.falling_frames),
    Key("increment_seconds", POSITIVE, "Time that an increment of a path may take: a run that needs more says what it "
        "was doing and ends, and blockvis run --resume goes on with it", 60.0, "s", otherwise="as long as it takes"),
)  # fmt: skip

ANALYSIS = Section(
    "analysis",
    "What is asked for, and how increments are found",
    (ANALYSIS_KEYS[0], *(key for kind in KINDS.values() for key in kind.keys), *ANALYSIS_KEYS[1:]),
)

OUTPUT = Section(
    "output",
    "What is written beside the results",
    (Key("animation", _FILM, "Name of the film in the results folder, or of a folder of its frames as pictures; "
         "false for none", "collapse.gif", default="collapse.mp4"),
     Key("vtu", one_of(("moved", "undeformed")), "Where the points of the VTU files are: where the blocks have moved "
         "to, or in the drawing, for a filter such as Warp By Vector to move", "undeformed", default="moved"),
     Key("vtu_strings", TRUE_OR_FALSE, "Whether names in the VTU files are arrays of strings, which meshio does not "
         "read; false makes them bytes, field arrays of the same names", False, default=True),
     Key("underlay", TEXT, "Photograph under pictures and film in the plane, relative to the case file, of what the "
         "image of the blocks shows, or with a world file", "photo.jpg", otherwise="none"),
     Key("view", _SIGHT, f"From where blocks in space are drawn: {', '.join(SIGHTS)}, or azimuth from x and elevation "
         "in degrees", {"azimuth": 30.0, "elevation": 20.0},
         otherwise="where their motion is seen best; of vaults and domes from below beside it"),
     Key("section", _CUT, "Plane that cuts blocks in space open in pictures: an axis, a place on it in m, or normal "
         "and point", "y = 1.2", otherwise="none; without a place or a point through the middle of the structure")),
)  # fmt: skip

#: Every table of the case file with its keys.
SECTIONS = (
    GEOMETRY, PARAMETERS, BOND, ROLES, SUPPORTS, MATERIAL, MATERIALS, INTERFACES, IMPERFECTIONS, SETTLEMENT, PROFILE,
    LOADS, BACKFILL, REMOVE, TIES, ANALYSIS, *(section for kind in KINDS.values() for section in kind.sections),
    EXPLAIN, OUTPUT,
)  # fmt: skip
