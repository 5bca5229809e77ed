"""Results and records side by side: what they hold in common, and in what their figures and parameters differ."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from feedsim import units
from feedsim.analysis.circularity import Turn
from feedsim.analysis.figures import Array
from feedsim.errors import InputError
from feedsim.files.columns import Columns
from feedsim.files.regular import json_file
from feedsim.motions.circular import SENSE_WORDS
from feedsim.sheets import read_rows
from feedsim.trace import Recording, read_recording
from feedsim.trace.recording import mapped

DIGEST_DIGITS = 12  # digits of a digest
RESULT, SUMMARY, BLOCKS_FILE = "result.csv", "summary.json", "blocks.csv"
# Of each block of an NC program what is laid side by side, as columns of blocks.csv.
OF_BLOCKS = ("largest [um]", "rms [um]", "begin [s]", "end [s]")
# Columns that are laid over each other, of every axis: name -> SI unit.
COMPARED_SIGNALS = {"x_s": "m", "x_e": "m", "x_a": "m", "n_a": "rad/s", "M_a": "N.m", "M_fr": "N.m", "i_q": "A"}


@dataclass(frozen=True, eq=False)
class Source:
    """A result's folder, or a file of curves.

    Attributes:
        name: short, and of no other one. recording: its curves. time: (N,) [s], as recorded.
        figures: name -> value and unit. parameters: dotted name -> value as text. circles: prefix -> turns.
        answer: what it says of itself. blocks: of an NC program, line and text of a block -> the largest distance from
        the path and its rms [um], the time [s]; of a block that is worked several times the worst.
        notes: what its numbers are worth.
        shift: of its first row on the first source's time [s], None where none fits. aligned: how that was found.
    """

    name: str
    path: Path
    recording: Recording
    time: Array
    figures: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    parameters: Mapping[str, str] = field(default_factory=dict)
    circles: Mapping[str, tuple[Turn, ...]] = field(default_factory=dict)
    answer: tuple[str, ...] = ()
    blocks: Mapping[tuple[str, str], tuple[float, float, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    shift: float | None = 0.0
    aligned: str = ""

    @property
    def t(self) -> Array:
        """(N,) [s] from the first row of the first source on; from its own first row on where no shift fits."""
        return np.asarray(self.time - self.time[0] + (self.shift or 0.0))

    def curve(self, name: str, unit: str) -> Array | None:
        """A column in an SI unit; None where there is none of that name and kind."""
        if name not in self.recording.names:
            return None
        try:
            factor = float(units.factor(self.recording.units[name] or "1", unit))
        except InputError:
            return None
        return np.asarray(self.recording.read([name])[name], dtype=np.float64) * factor

    @property
    def signals(self) -> list[str]:
        """Columns that can be laid over those of others."""
        return [name for name in self.recording.names if "." in name and name.partition(".")[2] in COMPARED_SIGNALS]

    @property
    def axes(self) -> list[str]:
        """Axes of which there is a signal."""
        return list(dict.fromkeys(name.partition(".")[0] for name in self.signals))


def read_sources(paths: Sequence[Path], mappings: Sequence[Columns] = ()) -> list[Source]:
    """Folders of `feedsim run`, or CSV files with a column of time. InputError lists all that is no such.

    mappings: which columns of the files, those of feedsim aside, are what.
    """
    sources, problems = [], []
    for path, name in zip(paths, named_apart(paths), strict=True):
        try:
            sources.append(_read(path, name, mappings))
        except InputError as error:
            problems += list(error.problems)
    if problems:
        raise InputError.of("nothing can be shown", problems)
    return sources


def named_apart(paths: Sequence[Path]) -> list[str]:
    """The shortest ends of the paths that differ."""
    parts = [path.absolute().parts for path in paths]
    for count in range(1, max(map(len, parts), default=0) + 1):
        names = ["/".join(part[-count:]) for part in parts]
        if len(set(names)) == len(names):
            return names
    return [f"{path} ({k})" for k, path in enumerate(paths, 1)]


def _read(path: Path, name: str, mappings: Sequence[Columns]) -> Source:
    curves = path / RESULT if path.is_dir() else path
    if path.is_dir() and not curves.is_file():
        raise InputError(
            f"{path}: has no {RESULT}; a folder of `feedsim run`, a CSV file, or a run of a study "
            "(FOLDER:17, FOLDER:max=FIGURE) is needed"
        )
    recording = read_recording(curves)
    if curves.name != RESULT:
        recording = mapped(recording, mappings)
    if (clock := recording.clock()) is None:
        raise InputError(f"{recording.header}: has no column of time; it is called time [s] or t [s]")
    column, factor = clock
    time = np.asarray(recording.read([column])[column], dtype=np.float64) * factor
    if len(time) < 2 or not np.all(np.diff(time) > 0):
        raise InputError(f"{curves}: its time does not rise from row to row; two rows or more are needed")
    summary = curves.with_name(SUMMARY)
    if curves.name != RESULT or not summary.is_file():
        return Source(name, path, recording, time)
    content = json_file(summary)
    try:
        return Source(
            name, path, recording, time,
            figures=_figures(content),
            parameters=_parameters(content),
            circles={prefix: tuple(map(_turn, turns)) for prefix, turns in content.get("circles", {}).items()},
            answer=tuple(map(str, content.get("answer", ()))),
            blocks=_blocks(summary.with_name(BLOCKS_FILE)) if content.get("contours") else {},
            notes=tuple(str(content.get(part, {}).get("note") or "") for part in ("machine", "scenario")),
        )  # fmt: skip
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{summary}: is no summary of `feedsim run`: {type(error).__name__}: {error}") from None


def _figures(summary: Mapping[str, Any]) -> dict[str, tuple[float, str]]:
    """Name -> value and unit; of a compensation those of its compensated turn, by the names that a run gives them."""
    result = {
        key: (math.nan if value["value"] is None else float(value["value"]), str(value["unit"]))
        for key, value in summary["figures"].items()
    }
    if summary.get("kind") != "compensate":
        return result
    label = "".join(map(str, summary["compensation"]["turn"]["plane"]))
    kept = {key: value for key, value in result.items() if not key.startswith("before.")}
    return {f"{label}.{key.removeprefix('after.')}" if key.startswith("after.") else key: e for key, e in kept.items()}


def _blocks(path: Path) -> dict[tuple[str, str], tuple[float, float, float]]:
    """Blocks of a table that a run of an NC program has left; none where it is not there any more."""
    if not path.is_file():
        return {}
    result: dict[tuple[str, str], tuple[float, float, float]] = {}
    with path.open(encoding="utf-8", newline="") as file:
        rows = read_rows(file)
        heads = next(rows)
        for row in rows:
            cells = dict(zip(heads, row, strict=True))
            largest, rms, begin, end = (float(cells[name] or math.nan) for name in OF_BLOCKS)
            key = f"{cells['file']}:{cells['line']}", cells["text"]
            if key not in result or largest > result[key][0]:
                result[key] = (largest, rms, end - begin)
    return result


def _turn(turn: Mapping[str, Any]) -> Turn:
    first, second = map(str, turn["axes"])
    x, y = map(float, turn["centre"]["value"])
    span = float(turn["begin"]["value"]), float(turn["end"]["value"])
    sense = {word: sense for sense, word in SENSE_WORDS.items()}[turn["direction"]]
    return Turn((first, second), (x, y), float(turn["radius"]["value"]), sense, *span)


def _parameters(summary: Mapping[str, Any]) -> dict[str, str]:
    """Everything that a person sets, dotted: of the machine, and of the scenario."""
    result = {"scenario.motions": "; ".join(entry["description"] for entry in summary["scenario"]["motions"])}
    for group in ("coupling", "recording_interval"):
        result |= _flat(f"scenario.{group}", summary["scenario"][group])
    # Results of earlier versions lack some.
    known = ("name", "pose", "cycles", "path", "modes", "structure", "plant", "errors", "axes")
    return result | _flat("machine", {key: summary["machine"][key] for key in known if key in summary["machine"]})


def _flat(name: str, value: Any) -> dict[str, str]:
    if isinstance(value, Mapping):
        if set(value) == {"value", "unit"}:
            return {name: f"{value['value']:.9g} {value['unit']}" if value["value"] is not None else "none"}
        return {key: text for part, entry in value.items() for key, text in _flat(f"{name}.{part}", entry).items()}
    return {name: str(value)[:DIGEST_DIGITS] if name.endswith(".sha256") else str(value)}


def differing(sources: Sequence[Source]) -> list[tuple[str, list[str]]]:
    """Parameters in which the results among the sources differ: name, and the value of every source, "" of records."""
    parameters = [source.parameters for source in sources]
    names = dict.fromkeys(name for entry in parameters for name in entry)
    rows = [(name, [entry.get(name, "") for entry in parameters]) for name in names]
    return [
        (name, values)
        for name, values in rows
        if len({v for v, value in zip(values, parameters, strict=True) if value}) > 1
    ]
