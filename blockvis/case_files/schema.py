"""JSON schemas of case files and their tables, with which editors complete and check TOML."""

from __future__ import annotations

import inspect
from typing import Any

from blockvis.case_files import case_keys
from blockvis.cases.key import Section, table_of
from blockvis.generators import LAYOUTS
from blockvis.generators.catalogue import described

#: The draft of JSON schema that editors of TOML read.
DRAFT = "http://json-schema.org/draft-07/schema#"

#: Types of the parameters of layouts as their signatures have them.
_TYPES = {"int": "integer", "float": "number", "str": "string", "bool": "boolean", "Sequence": "array"}


def case_schema() -> dict[str, Any]:
    """Make the JSON schema of the case file: its keys and the kinds of their values; the run says whether they fit."""
    return {"$schema": DRAFT, "title": "blockvis case file"} | case_values()


def case_values() -> dict[str, Any]:
    """Make the schema of the tables of a case, as a case file has them, or a study within it."""
    tables: dict[str, Any] = {}
    for section in case_keys.SECTIONS:
        name, _, rest = section.name.partition(".")
        if rest == "*":
            tables[name] = {"type": "object", "description": section.meaning, "additionalProperties": section.schema}
        elif not rest:
            # A table within a table is the value of a key of that one.
            tables[name] = one_or_several(section)
    tables["geometry"] |= {
        "oneOf": [{"required": ["file"], "not": {"required": ["parameters"]}}, {"required": ["layout"]}],
        "allOf": [_parameters(layout) for layout in LAYOUTS],
    }
    return table_of(tables, [section.name for section in case_keys.SECTIONS if section.required])


def one_or_several(section: Section) -> dict[str, Any]:
    """Let a table be there several times where its section may."""
    table = section.schema
    if not section.several:
        return table
    return {"description": section.meaning, "anyOf": [table, {"type": "array", "items": table}]}


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
