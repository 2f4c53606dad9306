"""JSON schema of study files."""

from __future__ import annotations

from typing import Any

from blockvis.case_files.schema import DRAFT, case_values, one_or_several

from . import study_keys


def study_schema() -> dict[str, Any]:
    """Make the JSON schema of the study file."""
    study, parameter, imperfections = study_keys.SECTIONS
    head = study.schema
    head["properties"]["case"] = {
        "anyOf": [{"type": "string"}, case_values()],
        "description": head["properties"]["case"]["description"],
    }
    varied = parameter.schema
    varied["allOf"].append({"anyOf": [{"required": ["values"]}, {"required": ["distribution"]}]})
    return {
        "$schema": DRAFT,
        "title": "blockvis study file",
        "type": "object",
        "properties": {
            "study": head,
            "parameters": {
                "type": "object",
                "description": parameter.meaning,
                "additionalProperties": {"anyOf": [{"type": "array", "minItems": 1}, varied]},
            },
            "imperfections": one_or_several(imperfections),
        },
        "required": ["study"],
        "additionalProperties": False,
    }
