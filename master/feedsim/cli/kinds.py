"""Which kind of file a command takes, said where it was given another one.

May use: errors, files. Start with explain_kind(), which the command line asks about a command that has refused its
input.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feedsim.files.source import json_file
from feedsim.foundation.errors import InputError

NO_RECORD = "a folder of results without a record (result.csv)"
# Kind of a summary -> the command that makes it, where they differ.
COMMAND_NAMES = {
    "compensate": "tune feedforward",
    "identify": "identify friction",
    "identify-drive": "identify drive",
    "identify-modes": "identify modes",
    "identify-mounts": "identify mounts",
    "machine": "machine view",
    "show": "diff",
    "tune": "tune compensation",
}
MAX_SUMMARY_BYTES = 50_000_000
KIND_BYTES = 4096  # bytes of a file that are read to see what it is


@dataclass(frozen=True)
class Kind:
    """A kind of file or folder: what it is called, the commands that take it, the likeliest first, what shows it."""

    name: str
    commands: tuple[str, ...]
    is_one: Callable[[Path], bool]


def _keys(path: Path) -> set[str]:
    """Keys of the first level of a YAML file; none of a file that is none."""
    if path.suffix.lower() not in (".yaml", ".yml") or not path.is_file():
        return set()
    from feedsim.files.source import read_yaml

    try:
        data = read_yaml(path).data
    except InputError:
        return set()
    return {str(key) for key in data} if isinstance(data, dict) else set()


def _has_keys(some: set[str], *, none: set[str]) -> Callable[[Path], bool]:
    def is_one(path: Path) -> bool:
        keys = _keys(path)
        return bool(keys & some) and not keys & none

    return is_one


def _has_ending(*endings: str) -> Callable[[Path], bool]:
    return lambda path: path.is_file() and path.suffix.lower() in endings


def _contains_file(*names: str) -> Callable[[Path], bool]:
    return lambda path: path.is_dir() and any((path / name).is_file() for name in names)


def _modes(path: Path) -> bool:
    return _table(path) and _first_line(path).startswith("mode,frequency")


def _table(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() in (".csv", ".txt") and not _first_line(path).startswith("{")


def _first_line(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return file.read(KIND_BYTES).decode("utf-8-sig", "replace").partition("\n")[0]
    except OSError:
        return ""


def _capture(path: Path) -> bool:
    if path.suffix.lower() != ".json" or not path.is_file():
        return False
    return _first_line(path).lstrip().startswith("{") and not _summary(path)


def _summary(path: Path) -> bool:
    if path.suffix.lower() != ".json" or not path.is_file():
        return False
    try:
        content = json_file(path, MAX_SUMMARY_BYTES)
    except InputError:
        return False
    return isinstance(content, dict) and bool({"scenario", "files", "feedsim"} & {*content})


_RUN = ("run", "check", "frf", "tune feedforward", "export", "machine info", "machine view", "machine build",
        "tune compensation", "tune drive")  # fmt: skip
_MACHINES = ("machine info", "machine view", "machine build", "frf", "export", "machine export",
             "machine import --machine")  # fmt: skip
_RECORDS = ("identify friction", "circle", "diff", "compare", "tools convert", "identify drive", "replay",
            "identify modes", "identify mounts")  # fmt: skip
INPUT_KINDS = (
    Kind("a study", ("sweep", "check"), _has_keys({"sampling", "parameters"}, none={"motions", "machine"})),
    Kind("a scenario", _RUN, _has_keys({"motions"}, none={"sampling", "parameters"})),
    Kind(
        "a structure file",
        ("machine info", "machine build", "machine view"),
        _has_keys({"damping", "bodies", "matrices"}, none={"cycles", "motions"}),
    ),
    Kind(
        "a machine file",
        _MACHINES,
        _has_keys({"axes"}, none={"motions", "bodies", "sampling"}),
    ),
    Kind(
        "the folder of a machine",
        _MACHINES,
        _contains_file("machine.yaml", "structure.yaml"),
    ),
    Kind("results of a study", ("diff",), _contains_file("study.json")),
    Kind("a folder of results", ("diff", "compare"), _contains_file("result.csv")),
    Kind(NO_RECORD, (), _contains_file("summary.json")),
    Kind("a file of values for the option --set", (), lambda path: _keys(path) == {"set"}),
    Kind("an SSP file", ("run", "check"), _has_ending(".ssp")),
    Kind("a unit for simulators (FMU)", (), _has_ending(".fmu")),
    Kind("a table of modes, which a machine file names", (), _modes),
    Kind("a record", _RECORDS, lambda path: _table(path) or _has_ending(".mat")(path)),
    Kind(
        "a capture of a control",
        ("identify drive", "replay", "identify friction", "tools convert", "diff", "compare"),
        _capture,
    ),
)


def kind(path: Path) -> Kind | None:
    """What a file or folder is, as far as its names and its beginning show; None: nothing that is known here."""
    try:
        return next((entry for entry in INPUT_KINDS if entry.is_one(path)), None)
    except OSError:
        return None


def accepted_kinds(command: str) -> list[str]:
    """Names of the kinds that a command takes."""
    return [*dict.fromkeys(entry.name for entry in INPUT_KINDS if command in entry.commands)]


def explain_kind(command: str, values: Iterable[Any]) -> str:
    """A sentence for a command that was given a file of a kind that it does not take; "" where none was.

    command: its name, such as "machine info"; with an option whose value is a file, "machine import --machine". values:
    of its arguments, single ones and lists.
    """
    own = accepted_kinds(command)
    for path in _paths(values) if own else ():
        result = kind(path)
        if result is not None and command not in result.commands:
            other = f", which feedsim {result.commands[0]} takes" if result.commands else ""
            what = _result(path) if result.name == NO_RECORD else ""
            return f"{path} {what or f'is {result.name}{other}'}; feedsim {command} takes {_either(own)}"
    return ""


def _result(folder: Path) -> str:
    """What a folder without a record holds, as its summary has it: the command, and the page; "" where it has none."""
    try:
        content = json_file(folder / "summary.json", MAX_SUMMARY_BYTES)
    except InputError:
        return ""
    of = content.get("kind") if isinstance(content, dict) else None
    if not isinstance(of, str) or not re.fullmatch("[a-z]+([ -][a-z]+)?", of):
        return ""
    page = folder / "report.html"
    shown = f", its page is {page}" if page.is_file() else ""
    return f"has results of feedsim {COMMAND_NAMES.get(of) or _command(of)}, without a record (result.csv){shown}"


def _command(of: str) -> str:
    """The command that makes results of a kind: "tune-drive" is of tune drive, "identify-modes" has its own name."""
    first, dash, second = of.partition("-")
    return f"{first} {second}" if dash and first in ("machine", "tune") else of


def _paths(values: Iterable[Any]) -> Iterator[Path]:
    for value in values:
        for one in value if isinstance(value, list | tuple) else (value,):
            if isinstance(one, str | Path) and str(one):
                yield Path(one)


def _either(names: list[str]) -> str:
    return " or ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
