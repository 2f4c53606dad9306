"""Layouts by name, as in case files and on the command line."""

from __future__ import annotations

import inspect
import json
import re
import textwrap
from collections.abc import Callable, Mapping
from typing import Any

import solver
from blockvis.text import nearest, refuse_unknown

from .arches import arch, basket_handle_arch, pointed_arch, segmental_arch
from .corners import l_corner, t_corner, two_leaf_wall
from .domes import dome
from .frames import arch_on_piers, buttressed_arch, column, portal
from .groins import church_bay, cross_vault, pavilion_vault
from .vaults import barrel_vault, extruded_arch
from .walls import facade, panel, wall

#: A link of a docstring, and the last part of what it names.
_LINK = re.compile(r":\w+:`~?(?:\w+\.)*(\w+)`")

#: Layouts of blocks in the plane, and in space, by their names.
IN_PLANE: dict[str, Callable[..., solver.Assembly]] = {
    "arch": arch,
    "segmental arch": segmental_arch,
    "pointed arch": pointed_arch,
    "basket-handle arch": basket_handle_arch,
    "arch on piers": arch_on_piers,
    "buttressed arch": buttressed_arch,
    "column": column,
    "portal": portal,
    "panel": panel,
    "wall": wall,
    "facade": facade,
}
IN_SPACE: dict[str, Callable[..., solver.Assembly]] = {
    "extruded arch": extruded_arch,
    "barrel vault": barrel_vault,
    "dome": dome,
    "cross vault": cross_vault,
    "pavilion vault": pavilion_vault,
    "church bay": church_bay,
    "L corner": l_corner,
    "T corner": t_corner,
    "two-leaf wall": two_leaf_wall,
}
LAYOUTS = IN_PLANE | IN_SPACE

#: Kinds of parameters without a unit, in plain words.
_KINDS = {"float": "", "int": "whole number", "int, optional": "whole number, optional", "bool": "true or false"}


def dimension_of(name: str) -> int:
    """Say whether a layout lies in the plane, 2, or in space, 3.

    Examples
    --------
    >>> dimension_of("dome")
    3
    """
    return 3 if _plain(name) in map(_plain, IN_SPACE) else 2


def parameters_of(name: str) -> dict[str, Any]:
    """List the parameters of a layout with their defaults.

    Examples
    --------
    >>> parameters_of("column")["blocks"]
    5
    """
    return {key: value.default for key, value in inspect.signature(_layout(name)).parameters.items()}


def described(name: str) -> dict[str, tuple[str, str]]:
    """List the kind of value and the meaning of the parameters of a layout, of its docstring.

    Examples
    --------
    >>> described("segmental arch")["span"]
    ('float [m]', 'Of the intrados; a rise of half the span gives a semicircle.')
    """
    text = inspect.cleandoc(_layout(name).__doc__ or "")
    block = re.search(r"Parameters\n-+\n(.*?)(?=\n\n\w+\n-+\n|\Z)", text, re.DOTALL)
    found: dict[str, tuple[str, str]] = {}
    for names, kind, lines in re.findall(
        r"^(\w[\w, ]*?)(?: : (.*))?((?:\n +.*)+|$)", block[1] if block else "", re.MULTILINE
    ):
        meaning = " ".join(lines.split())
        same = re.match(r"As in :func:`(\w+)`", meaning)
        for one in names.split(", "):
            found[one] = described(same[1])[one] if same else (kind, _LINK.sub(r"\1", meaning).replace("``", "`"))
    return found


def help_text(name: str) -> str:
    """Describe a layout and its parameters, with units and defaults, as its docstring has them.

    Examples
    --------
    >>> print(help_text("column").splitlines()[4])
      width = 0.5  [m]
    """
    layout = _layout(name)
    purpose = (inspect.getdoc(layout) or "").partition("\n\nParameters\n----------\n")[0]
    words, lines = described(name), [purpose, "", "parameters:"]
    for one, value in parameters_of(name).items():
        kind, meaning = words[one]
        kind = _KINDS.get(kind, kind[kind.index("[") :] if "[" in kind else kind)
        default = "" if value is None else f" = {json.dumps(value, ensure_ascii=False)}"
        lines.append(f"  {one}{default}  {kind}".rstrip())
        lines += textwrap.wrap(meaning, 120, initial_indent=6 * " ", subsequent_indent=6 * " ")
    return _LINK.sub(r"\1", "\n".join(lines)).replace("``", "").replace("`", "")


def build(name: str, parameters: Mapping[str, Any] | None = None) -> solver.Assembly:
    """Build a layout by name with the given parameters, the others at their defaults.

    Parameters
    ----------
    name : str
        A key of :data:`LAYOUTS`; "-" and "_" count as spaces.
    parameters : mapping, optional
        Numbers, texts, lists and tables, as in TOML and JSON. A whole number may be written 12.0.

    Raises
    ------
    ValueError
        For a name or parameter that does not exist, naming the most similar one, and for impossible values.

    Examples
    --------
    >>> build("portal", {"column_blocks": 3}).n_blocks
    9
    """
    parameters = dict(parameters or {})
    refuse_unknown(parameters, list(parameters_of(name)), f"layout '{name}'")
    return _layout(name)(**parameters)


def _layout(name: str) -> Callable[..., solver.Assembly]:
    plain = {_plain(known): layout for known, layout in LAYOUTS.items()}
    if _plain(str(name)) not in plain:
        raise ValueError(
            f"there is no layout '{name}'{nearest(str(name), list(LAYOUTS))}; choose from {', '.join(LAYOUTS)}"
        )
    return plain[_plain(str(name))]


def _plain(name: str) -> str:
    return name.lower().replace("-", " ").replace("_", " ").replace("ç", "c")
