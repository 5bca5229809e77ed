"""Pages of the reference, each made from the source of its fact: commands, functions, keys of files, variables.

May use feedsim. Start reading at pages(): the name of a page and its text in Markdown.
"""

from __future__ import annotations

import argparse
import ast
import inspect
import os
from collections.abc import Iterator, Mapping
from math import isinf
from pathlib import Path
from typing import Any

import feedsim
from feedsim import cli
from feedsim.scenario.schema import json_schema
from feedsim.variables import table

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
UNITS = {
    "plant": "the mechanical structure, reduced to its modes",
    "controller": "position, speed and current control of one axis, with its motor",
    "friction": "friction of one axis: LuGre with the transmission engaging model",
    "setpoint": "setpoints of all axes out of a table",
    "machine": "all of them in one unit",
}
FILES = {
    "scenario": "what is simulated: machine, motions, loads, recording, figures",
    "machine": "a machine: axes, drives, friction, limits",
    "structure": "a machine as geometry or matrices",
    "study": "many runs of one scenario",
    "columns": "which column of a record is what",
    "tolerances": "what a comparison allows",
}


def pages() -> dict[str, str]:
    """Name of every page of the reference -> its text."""
    return {
        "commands": commands(),
        "python": python(),
        "files": files(),
        "variables": variables(),
        "gallery": gallery(),
    }


def gallery() -> str:
    """The examples: what each shows, its picture and its script."""
    lines = ["# Gallery", "", "Small scripts that run as they stand, in any folder. All numbers of the "
             "machines are synthetic.", ""]  # fmt: skip
    for script in sorted(EXAMPLES.glob("*.py")):
        text = script.read_text(encoding="utf-8")
        title, _, words = (ast.get_docstring(ast.parse(text)) or "").partition("\n")
        code = text.partition('\n"""\n')[2].strip()
        lines += [
            f"## {title.rstrip('.')}",
            "",
            words.strip(),
            "",
            f"![{title}](../images/gallery/{script.stem}.png)",
            "",
        ]
        lines += [f"`examples/{script.name}`", "", f"```python\n{code}\n```", ""]
    return "\n".join(lines)


def commands() -> str:
    """All commands with their help, as the terminal shows it."""
    os.environ["COLUMNS"] = "100"
    top = cli.parser()
    lines = ["# Commands", "", "Every command, as `feedsim COMMAND --help` prints it.", ""]
    codes = (top.epilog or "").partition("examples:")[0].strip()
    lines += ["## Exit codes", "", f"```text\n{codes}\n```", ""]
    for name, parser in _subcommands(top):
        lines += [f"## feedsim {name}", "", f"```text\n{parser.format_help().strip()}\n```", ""]
    return "\n".join(lines)


def _subcommands(parser: argparse.ArgumentParser, above: str = "") -> Iterator[tuple[str, argparse.ArgumentParser]]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, below in action.choices.items():
                inner = list(_subcommands(below, f"{above}{name} "))
                yield from inner or [(above + name, below)]


def python() -> str:
    """Everything that `import feedsim` offers, with its documentation."""
    lines = ["# Python functions", "", "What `import feedsim` offers. Every command has its function here.", ""]
    for name in sorted(feedsim.__all__, key=str.lower):
        thing = getattr(feedsim, name)
        if name.startswith("_") or not (inspect.isclass(thing) or callable(thing)):
            continue
        lines += [f"## {name}", "", *_documented(name, thing), ""]
    return "\n".join(lines)


def _documented(name: str, thing: Any) -> list[str]:
    """Sphinx's own directive: it sets signature, sections and examples of the docstring."""
    if not inspect.isclass(thing):
        directive = [f".. autofunction:: feedsim.{name}"]
    else:
        directive = [f".. autoclass:: feedsim.{name}", "   :no-index:"]
        members = ", ".join(_own_members(thing))
        directive += [f"   :members: {members}"] if members else []
    return ["```{eval-rst}", *directive, "```"]


def _own_members(thing: type) -> list[str]:
    """What feedsim itself declares of a class: a model's base has forty methods more, which are not for its users."""
    return [
        name
        for base in reversed(thing.__mro__)
        if base.__module__.startswith("feedsim")
        for name, value in vars(base).items()
        if not name.startswith("_") and (callable(value) or isinstance(value, property)) and inspect.getdoc(value)
    ]


def files() -> str:
    """Keys of every kind of file, from its JSON Schema."""
    lines = ["# Keys of files", "", "Every key that a file may have. An editor checks files by the same schemas: "
             "`feedsim tools schema KIND` prints them.", ""]  # fmt: skip
    for kind, meaning in FILES.items():
        schema = json_schema(kind)
        lines += [f"## {kind} file", "", f"{meaning[0].upper()}{meaning[1:]}.", "", *_keys(schema)]
        for name, below in sorted(schema.get("$defs", {}).items()):
            if below.get("properties"):
                lines += [f"### {kind}: {name}", "", str(below.get("description", "")), "", *_keys(below)]
    return "\n".join(lines)


def _keys(schema: Mapping[str, Any]) -> list[str]:
    needed = set(schema.get("required", ()))
    rows = ["| key | what it is | value | default |", "|---|---|---|---|"]
    for name, entry in schema.get("properties", {}).items():
        example = entry.get("examples", [""])[0]
        value = _kind(entry) + (f", e.g. `{example}`" if example != "" else "")
        default = "**needed**" if name in needed else f"`{entry['default']}`" if "default" in entry else ""
        rows.append(f"| `{name}` | {_cell(str(entry.get('description', '')))} | {_cell(value)} | {_cell(default)} |")
    return [*rows, ""]


def _kind(entry: Mapping[str, Any]) -> str:
    if "$ref" in entry:
        return str(entry["$ref"]).rpartition("/")[2]
    if "const" in entry:
        return f"`{entry['const']}`"
    if "enum" in entry:
        return ", ".join(f"`{value}`" for value in entry["enum"])
    for several in ("anyOf", "oneOf"):
        if several in entry:
            return " or ".join(dict.fromkeys(_kind(one) for one in entry[several]))
    if entry.get("type") == "array":
        return f"list of {_kind(entry.get('items', {}))}"
    if entry.get("type") == "string" and "pattern" in entry:
        return "quantity with unit" if "examples" in entry else "text"
    return {"string": "text", "object": "mapping"}.get(str(entry.get("type", "")), str(entry.get("type", "")))


def variables() -> str:
    """Variables of every unit: unit of measurement, start value, range and meaning."""
    lines = ["# Variables of the units", "", "From the units' own tables. `fmi2GetReal` and `fmi2SetReal` take SI "
             "units. Start values are those of the synthetic default machine.", ""]  # fmt: skip
    for unit, meaning in UNITS.items():
        lines += [f"## {unit}.fmu", "", f"{meaning[0].upper()}{meaning[1:]}.", ""]
        rows = ["| variable | causality | unit | start | range | meaning |", "|---|---|---|---|---|---|"]
        for name, row in table(unit).items():
            ends = ["" if isinf(end) else f"{end:g}" for end in (row.minimum, row.maximum)]
            limits = " … ".join(ends) if any(ends) else ""
            rows.append(f"| `{name}` | {row.causality} | {row.unit} | {row.start} | {limits} | {_cell(row.text)} |")
        lines += [*rows, ""]
    return "\n".join(lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
