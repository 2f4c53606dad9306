"""JSON schemas of case files and their tables, with which editors complete and check TOML."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any

from blockvis.case_files import case_keys
from blockvis.cases.distributions import CUT_OFF, KINDS
from blockvis.cases.key import Key, Section
from blockvis.generators import LAYOUTS
from blockvis.generators.catalogue import described

#: The draft of JSON schema that editors of TOML read.
DRAFT = "http://json-schema.org/draft-07/schema#"

#: Types of the parameters of layouts as their signatures have them.
_TYPES = {"int": "integer", "float": "number", "str": "string", "Sequence": "array"}


def case_schema() -> dict[str, Any]:
    """Make the JSON schema of the case file.

    Returns
    -------
    dict
        What the file's keys and the kinds of their values are; whether they fit together, the run says.
    """
    return {"$schema": DRAFT, "title": "blockvis case file"} | case_values()


def case_values() -> dict[str, Any]:
    """Make the schema of the tables of a case, as a case file has them, or a study within it."""
    tables: dict[str, Any] = {}
    for section in case_keys.SECTIONS:
        name, _, rest = section.name.partition(".")
        if rest == "*":
            tables[name] = {
                "type": "object",
                "description": section.meaning,
                "additionalProperties": table_schema(section),
            }
        elif rest:
            tables[name]["properties"][rest] = table_schema(section)
        elif section is case_keys.IMPERFECTIONS_SECTION:
            tables[name] = one_or_several(section, scattered(section))
        else:
            tables[name] = one_or_several(section, table_schema(section))
    tables["geometry"] |= {
        "oneOf": [{"required": ["file"], "not": {"required": ["parameters"]}}, {"required": ["layout"]}],
        "allOf": [_parameters(layout) for layout in LAYOUTS],
    }
    return {
        "type": "object",
        "properties": tables,
        "required": [section.name for section in case_keys.SECTIONS if section.required],
        "additionalProperties": False,
    }


def table_schema(section: Section) -> dict[str, Any]:
    """Make the schema of one table."""
    table: dict[str, Any] = {"type": "object", "description": section.meaning}
    if section.keys:
        table["properties"] = {key.name: _value(key) for key in section.keys}
    table["additionalProperties"] = False if section.names is None else dict(section.names.schema)
    required = [key.name for key in section.keys if key.required]
    return table | ({"required": required} if required else {})


def _value(key: Key) -> dict[str, Any]:
    unit = f" [{key.unit}]" if key.unit else ""
    missing = f". If missing: {key.otherwise}" if key.otherwise else ""
    value = dict(key.kind.schema) | {"description": f"{key.meaning}{unit}{missing}", "examples": [key.example]}
    if key.default is not None:
        value["default"] = list(key.default) if isinstance(key.default, tuple) else key.default
    return value


def one_or_several(section: Section, table: Mapping[str, Any]) -> dict[str, Any]:
    """Let a table be there several times where its section may."""
    if not section.several:
        return dict(table)
    return {"description": section.meaning, "anyOf": [dict(table), {"type": "array", "items": dict(table)}]}


def scattered(section: Section) -> dict[str, Any]:
    """Make the schema of a table whose values are drawn from a distribution."""
    return table_schema(section) | {"allOf": distributions(also=without_distribution(section))}


def without_distribution(section: Section) -> list[str]:
    """Names of the keys that do not belong to a distribution."""
    numbers = {key.name for key in case_keys.DISTRIBUTION_KEYS}
    return [key.name for key in section.keys if key.name not in numbers]


def distributions(also: Sequence[str]) -> list[dict[str, Any]]:
    """Say which numbers each distribution takes."""
    found = []
    for kind, numbers in KINDS.items():
        known = [*also, "distribution", *numbers, *(("lower", "upper") if kind in CUT_OFF else ())]
        found.append(
            {
                "if": {"properties": {"distribution": {"const": kind}}, "required": ["distribution"]},
                "then": {"propertyNames": {"enum": known}},
            }
        )
    return found


def _parameters(layout: str) -> dict[str, Any]:
    """Say which parameters a layout takes."""
    words, properties = described(layout), {}
    for name, parameter in inspect.signature(LAYOUTS[layout]).parameters.items():
        kind, meaning = words.get(name, ("", ""))
        properties[name] = {"description": f"{kind}. {meaning}".strip(". ")}
        first = str(parameter.annotation).split("[")[0].split(" |")[0]
        if first in _TYPES:
            properties[name]["type"] = _TYPES[first]
        if parameter.default is not None:
            properties[name]["default"] = parameter.default
    return {
        "if": {"properties": {"layout": {"const": layout}}, "required": ["layout"]},
        "then": {"properties": {"parameters": {"properties": properties, "additionalProperties": False}}},
    }
