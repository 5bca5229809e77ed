"""Pages of the reference, each made from the source of its fact: commands, functions, keys of files, variables.

May use feedsim. Start reading at pages(): the name of a page and its text in Markdown.
"""

from __future__ import annotations

import argparse
import ast
import csv
import inspect
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from math import isinf
from pathlib import Path
from typing import Any

import feedsim
from feedsim import cli
from feedsim.estimation.identify.signals import ALIASES
from feedsim.files import control
from feedsim.foundation.units import table
from feedsim.scenario.schema import json_schema

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
FIRST = "first_circle"  # of the gallery
SHARED = "every command"  # title of the group of options that all have
ALWAYS = ("positional arguments", "options")  # argparse's own groups
CONTROLS = {
    "sinumerik": "SINUMERIK 840D sl, ONE; SINAMICS", "twincat": "Beckhoff TwinCAT CNC, AX drives",
    "heidenhain": "HEIDENHAIN", "linuxcnc": "LinuxCNC",
}  # fmt: skip
UNITS = {
    "plant": "the mechanical structure, reduced to its modes",
    "controller": "position, speed and current control of one axis, with its motor",
    "friction": "friction of one axis: LuGre with the transmission engaging model",
    "friction_gms": "friction of one axis: generalised Maxwell slip",
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

# Plots of the benchmarks: behind which table of which file.
PLOTS = {
    ("accuracy", 0): ("accuracy-cost",), ("accuracy", 1): ("accuracy-order",), ("growth", 0): ("growth-modes",),
    ("growth", 2): ("growth-axes",), ("duration", 0): ("growth-duration",), ("sweep", 1): ("sweep-memory",),
}  # fmt: skip


def pages() -> dict[str, str]:
    """Name of every page of the reference -> its text."""
    return {
        "commands": commands(),
        "python": python(),
        "files": files(),
        "variables": variables(),
        "control-names": control_names(),
        "signal-names": signal_names(),
        "findings": findings(),
        "benchmarks": benchmarks(),
        "gallery": gallery(),
    }


def findings() -> str:
    """What results may warn of or note: codes, and what they mean."""
    with (ROOT / "master" / "feedsim" / "foundation" / "findings.csv").open(encoding="utf-8", newline="") as file:
        _, *rows = csv.reader(file)
    return "\n".join([
        "# Findings", "", "Codes of all findings of results: in Python, in `summary.json` and behind `--json`. A code "
        "keeps its meaning from version to version; texts may change. What to do: "
        "[a warning, or a result that looks wrong](../how-to/warnings.md).", "", "| code | meaning |", "|---|---|",
        *(f"| `{code}` | {meaning} |" for code, meaning in rows), "",
    ])  # fmt: skip


def gallery() -> str:
    """The examples: a grid of their pictures, circles first; below, what each shows, its picture and its script."""
    cards, parts = [], []
    scripts = sorted(EXAMPLES.glob("*.py"), key=lambda script: (not _circle(script), script.stem != FIRST, script.stem))
    for script in scripts:
        text = script.read_text(encoding="utf-8")
        title, _, words = (ast.get_docstring(ast.parse(text)) or "").partition("\n")
        anchor = script.stem.replace("_", "-")
        title, code = title.rstrip("."), text.partition('\n"""\n')[2].strip()
        picture = f"{script.stem}.png"
        cards.append(
            f'<a href="#{anchor}"><img src="../_images/{picture}" alt="{title}, picture" loading="lazy">'
            f"<span>{title}</span></a>"
        )
        parts += [f"({anchor})=", f"## {title}", "", words.strip(), "", f"![{title}](../images/gallery/{picture})",
                  "", f"`examples/{script.name}`", "", f"```python\n{code}\n```", ""]  # fmt: skip
    return "\n".join([
        "# Gallery", "", "Small scripts that run as they stand, in any folder. All numbers are synthetic.", "",
        '<nav class="gallery" aria-label="Examples">', *cards, "</nav>", "", *parts,
    ])  # fmt: skip


def _circle(script: Path) -> bool:
    """Whether an example draws a circle."""
    return "xz_circle" in script.read_text(encoding="utf-8")


def commands() -> str:
    """All commands: what each is for, its arguments and options, examples."""
    os.environ["COLUMNS"] = "78"
    top = cli.parser()
    lines = ["# Commands", "", "Arguments and options of every command. `feedsim COMMAND --help` prints them in a "
             "terminal.", ""]  # fmt: skip
    found = list(_subcommands(top))
    lines += ["## Every command takes", "", *_options(_group(found[0][1], SHARED)), ""]
    for name, parser in found:
        about, _, more = (parser.description or "").strip().partition("\n\n")
        lines += [f"## feedsim {name}", "", _linked(about), "", _wrapped(_usage(parser)), ""]
        lines += [_linked(" ".join(more.split())), ""] if more else []
        lines += [*_options(_group(parser, *ALWAYS)), ""]
        for group in parser._action_groups:
            if group.title not in (SHARED, *ALWAYS):
                lines += [f"**{str(group.title).capitalize()}**", "", *_options(_actions(group)), ""]
        if parser.epilog:
            examples = parser.epilog.strip().removeprefix("examples:")
            lines += ["Examples:", "", _wrapped(inspect.cleandoc(examples)), ""]
    return "\n".join(lines)


def _wrapped(code: str) -> str:
    """A block whose lines break where a screen ends."""
    return f"```{{code-block}} text\n:class: wrapped\n\n{code}\n```"


def _usage(parser: argparse.ArgumentParser) -> str:
    """The line of usage, without what every command takes."""
    kept = argparse.ArgumentParser(prog=parser.prog, usage=parser.usage, add_help=False)
    for action in [action for group in parser._action_groups if group.title != SHARED for action in _actions(group)]:
        kept._add_action(action)
    first, *others = kept.format_usage().removeprefix("usage: ").rstrip().splitlines()
    return "\n".join([first, *(f"    {line.strip()}" for line in others)])


def _group(parser: argparse.ArgumentParser, *titles: str) -> list[argparse.Action]:
    return [action for group in parser._action_groups if group.title in titles for action in _actions(group)]


def _actions(group: argparse._ArgumentGroup) -> list[argparse.Action]:
    return [action for action in group._group_actions if not isinstance(action, argparse._HelpAction)]


def _options(actions: Sequence[argparse.Action]) -> list[str]:
    """A table of arguments; empty where there are none."""
    formatter = argparse.HelpFormatter("feedsim")
    rows = []
    for action in actions:
        value = "" if action.nargs == 0 else formatter._format_args(action, (action.dest or "").upper())
        names = [f"{name} {value}".strip() for name in action.option_strings] or [value]
        text = (action.help or "").replace("%(default)s", str(action.default)).replace("%%", "%")
        rows.append(f"| {', '.join(f'`{_cell(name)}`' for name in names)} | {_linked(_cell(text))} |")
    return ["| argument | meaning |", "|---|---|", *rows] if rows else []


def _linked(text: str) -> str:
    """Pages that a help names, as links."""
    return re.sub(r"docs/([\w/-]+)\.md", r"[\1](../\1.md)", text.replace("<", "&lt;"))


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
        given = entry.get("default")
        default = "**needed**" if name in needed else "" if given in (None, "") or given in ([], {}) else f"`{given}`"
        default = "" if isinstance(given, Mapping) and name not in needed else default
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


def control_names() -> str:
    """Every parameter that is known by a control's own name: a table for each control."""
    lines = ["# Names of parameters in controls", "", "A value in the control's unit, times the factor, is that of a "
             "machine file. [How to use it](../controls.md).", ""]  # fmt: skip
    for name in control.CONTROLS:
        lines += [f"## `{name}`: {CONTROLS[name]}", "",
                  "| ours | number | name | unit | times this is ours | confirmed | source |",
                  "|---|---|---|---|---|---|---|"]  # fmt: skip
        for row in (row for row in control.table() if row.control == name):
            factor = f"{row.factor:.6g} {row.si}".strip()
            cells = (f"`{row.parameter}`", f"`{row.number}`", row.name, row.unit, factor,
                     "yes" if row.confirmed else "no", row.source)  # fmt: skip
            lines.append(f"| {' | '.join(map(_cell, cells))} |")
        lines.append("")
    return "\n".join(lines)


def signal_names() -> str:
    """Names of columns that are known without a mapping file."""
    lines = ["# Names of signals", "", "Columns of records that are known by their names. Case, blanks, underscores, "
             "hyphens and the axis before or behind do not matter. [How records are read](../traces.md).", "",
             "| signal | where from | names |", "|---|---|---|"]  # fmt: skip
    rows: dict[tuple[str, str], list[str]] = {}
    for alias in ALIASES:
        rows.setdefault((alias.role, alias.source), []).append(f"`{_cell(alias.name)}`")
    lines += [f"| `{role}` | {_cell(source)} | {', '.join(names)} |" for (role, source), names in rows.items()]
    return "\n".join([*lines, ""])


def benchmarks() -> str:
    """All tables of docs/benchmarks, with what they were measured on, and the plots."""
    lines = ["# Benchmarks", "", "What `make bench` has measured. [Performance](../performance.md) has what matters "
             "most.", ""]  # fmt: skip
    for file in sorted((ROOT / "docs" / "benchmarks").glob("*.json")):
        found = json.loads(file.read_text(encoding="utf-8"))
        on = f"{found['machine']['processor']}, {found['machine']['cores']} cores: `{found['command']}`"
        what = f"{found['date'][:10]}, version {found['versions']['feedsim']}, {on}"
        lines += [f"## {file.stem.replace('_', ' ')}", "", what, ""]
        for number, table_ in enumerate(found["tables"]):
            lines += [table_, ""]
            for plot in PLOTS.get((file.stem, number), ()):
                lines += [f"![{plot.replace('-', ' ')}](../images/{plot}.svg)", ""]
    return "\n".join(lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
