"""A machine to be looked at: from its own file, or from a scenario that names it, with the scenario's settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from feedsim.files.source import read
from feedsim.scenario.load import load, load_machine
from feedsim.scenario.machine import Machine


@dataclass(frozen=True, eq=False)
class Subject:
    """A machine, and where it comes from.

    Attributes:
        kind: "scenario" or "machine".
        name: of the scenario or the machine.
        file: that was named.
        notes: remarks to be shown wherever the numbers are.
        settings: what the scenario itself sets, as KEY=VALUE.
        overrides: what was set from outside, as KEY=VALUE.
        files: what was read, each with what it is.
    """

    machine: Machine
    kind: str
    name: str
    file: Path
    notes: tuple[str, ...]
    settings: tuple[str, ...]
    overrides: tuple[str, ...]
    files: tuple[tuple[str, Path], ...]


def load_subject(path: str | Path, overrides: Sequence[str] = ()) -> Subject:
    """Read a scenario file, a machine file, or a folder with a machine.yaml; which of them is told by its keys.

    `overrides` as for load(); for a machine, with or without "machine." ahead. Raises InputError like load().
    """
    path = Path(path)
    settings: tuple[str, ...]
    if path.is_dir() or _is_machine(path):
        machine = load_machine(path, overrides)
        file = path / Machine.IN_FOLDER if path.is_dir() else path
        files = tuple((place or "machine", named) for place, named in machine.files)
        name, kind, notes, settings = machine.name, "machine", [machine.note], ()
    else:
        scenario = load(path, overrides)
        machine, file = scenario.machine, scenario.file
        files = tuple((place or "scenario", named) for place, named in scenario.files)
        name, kind, notes, settings = scenario.name, "scenario", [machine.note, scenario.note], scenario.settings
    kept = tuple(note for note in notes if note)
    return Subject(machine, kind, name, file, kept, settings, tuple(overrides), (*files, ("modes", machine.modes)))


def _is_machine(path: Path) -> bool:
    data = read(path).data
    return isinstance(data, dict) and "axes" in data and "machine" not in data
