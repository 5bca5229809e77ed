"""JSON Schema of scenario, machine, structure, mapping, tolerance and study files, for editors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from feedsim.foundation import units

if TYPE_CHECKING:
    from pydantic import BaseModel

Kind = Literal["scenario", "machine", "structure", "columns", "tolerances", "study"]
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def json_schema(kind: Kind = "scenario") -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a scenario, machine or structure file, of a mapping of a trace's columns, of
    tolerances, or of a study.

    It knows keys, words and the spelling of quantities; it cannot know limits of quantities nor what needs two places
    to be seen together. What it refuses, load() refuses too.
    """
    from feedsim.files.columns import Columns, ToleranceFile
    from feedsim.scenario.machine import Machine
    from feedsim.scenario.model import Scenario
    from feedsim.scenario.study.file import StudyFile

    if kind == "structure":
        schema = _structure_schema()
    else:
        models: dict[str, type[BaseModel]] = {
            "scenario": Scenario, "machine": Machine, "columns": Columns, "tolerances": ToleranceFile,
            "study": StudyFile,
        }  # fmt: skip
        schema = models[kind].model_json_schema()
    definitions: dict[str, Any] = schema.pop("$defs")
    for group in (*definitions.values(), schema):
        _open_to_files(group, definitions)
    if kind == "scenario":
        schema["properties"]["set"] = {
            "type": "object",
            "description": "Changes of single values by dotted key, of the machine too, as --set on the command line",
            "examples": [{"machine.axes.Z.friction.W": "0 rad"}],
        }
        schema["required"].remove("recording")
        definitions["Recording"].pop("required")
        definitions["Column"] = {"anyOf": [{"type": "string", "minLength": 1}, definitions["Column"]]}
    if kind == "columns":
        short = [{"type": "string", "pattern": rf"^\s*{units.NUMBER}"}, {"type": "number"}]
        definitions["Factor"] = {"anyOf": [*short, definitions["Factor"]]}
    if kind == "tolerances":
        amount = definitions["VariableTolerance"]["properties"]["value"]["anyOf"][:2]
        definitions["VariableTolerance"] = {"anyOf": [*amount, {"const": "ignore"}, definitions["VariableTolerance"]]}
    return {
        "$schema": DIALECT,
        "title": f"feedsim {kind} file",
        **_without_titles(schema),
        "$defs": _without_titles(definitions),
    }


def _structure_schema() -> dict[str, Any]:
    """One of the kinds; which is for `kind` to say."""
    from pydantic.json_schema import models_json_schema

    from feedsim.scenario.structure_checks import STRUCTURE_KINDS

    references, schema = models_json_schema([(model, "validation") for model in STRUCTURE_KINDS.values()])
    options = [references[model, "validation"] for model in STRUCTURE_KINDS.values()]
    for option in options:
        model = schema["$defs"][option["$ref"].rpartition("/")[2]]
        model["required"] = ["kind", *model.get("required", [])]
    return schema | {"type": "object", "oneOf": options}


def _open_to_files(group: dict[str, Any], definitions: dict[str, Any]) -> None:
    """Where a group of keys is expected the name of a YAML file may stand."""
    for name, part in group.get("properties", {}).items():
        file = {"type": "string", "pattern": "." if name == "machine" else r"\.ya?ml$"}
        inner = part.get("additionalProperties", part)
        options: Any = inner.get("anyOf", inner.get("oneOf", [inner])) if isinstance(inner, dict) else []
        references = [option["$ref"] for option in options if "$ref" in option]
        if references and definitions[references[0].rpartition("/")[2]].get("type") == "object":
            groups, others = ([o for o in options if ("$ref" in o) is group] for group in (True, False))
            alternatives = [{"$ref": group["$ref"]} for group in groups]
            for word in ("$ref", "oneOf"):
                inner.pop(word, None)
            inner["anyOf"] = [*alternatives, file, *others]


def _without_titles(schema: Any) -> Any:
    """pydantic titles every key by its own name; editors show that name already."""
    if isinstance(schema, dict):
        return {
            key: _without_titles(value)
            if key != "properties" or not isinstance(value, dict)
            else {name: _without_titles(part) for name, part in value.items()}
            for key, value in schema.items()
            if not (key == "title" and isinstance(value, str))
        }
    return [_without_titles(item) for item in schema] if isinstance(schema, list) else schema
