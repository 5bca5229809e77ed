"""The kinds of resource files that units have: which files, where those of built archives come from, who reads them.

A unit says which kind it has by UNIT_RESOURCES in its identity.h; nothing here knows a unit's name.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from . import machine_tables, setpoints, whole_machine
from .checkout import DEFAULT_MODES, SOURCES
from .errors import InputError
from .resources import File, Resources

# What the units whose parts a machine has are built with.
_DEFAULT_AXES = SOURCES / "plant_fmu" / "resources" / "axes.csv"
_DEFAULT_SETPOINTS = SOURCES / "setpoint_fmu" / "resources" / "setpoints.csv"


@dataclass(frozen=True)
class Option:
    """A file that can be given. `required`: there is no such archive without it. `default`: the file that a unit in the
    folder given is built with; None where it is built without one."""

    help: str
    required: bool
    default: Callable[[Path], Path | None]


@dataclass(frozen=True)
class Kind:
    """Files by the names of their options, and how they become resources."""

    options: Mapping[str, Option]
    read: Callable[[Mapping[str, Path]], Resources]  # InputError with all problems of the file at fault


def _read_machine(files: Mapping[str, Path]) -> Resources:
    return machine_tables.read(files["axes"], files["modes"], files.get("poses"), files.get("mounts"))


def _read_setpoints(files: Mapping[str, Path]) -> Resources:
    return setpoints.check(File.at(files["setpoints"]))


def _read_whole_machine(files: Mapping[str, Path]) -> Resources:
    motion = setpoints.check(File.at(files["setpoints"])) if "setpoints" in files else None
    tables = machine_tables.read(files["axes"], files["modes"], files.get("poses"), files.get("mounts"))
    return whole_machine.check(tables, File.at(files["settings"]), motion)


KINDS: Mapping[str, Kind] = {
    "machine": Kind(
        {
            "axes": Option("axes.csv of the machine", True, lambda unit: unit / "resources" / "axes.csv"),
            "modes": Option("modes.csv of the machine", True, lambda unit: DEFAULT_MODES),
            "poses": Option("poses.bin of the machine: modes of a grid of poses", False, lambda unit: None),
            "mounts": Option("mounts.csv of the machine: mounts that are not linear", False, lambda unit: None),
        },
        _read_machine,
    ),
    "setpoints": Kind(
        {
            "setpoints": Option("setpoints.csv of the motion", True, lambda unit: unit / "resources" / "setpoints.csv"),
        },
        _read_setpoints,
    ),
    "whole_machine": Kind(
        {
            "axes": Option("axes.csv of the machine", True, lambda unit: _DEFAULT_AXES),
            "modes": Option("modes.csv of the machine", True, lambda unit: DEFAULT_MODES),
            "poses": Option("poses.bin of the machine: modes of a grid of poses", False, lambda unit: None),
            "mounts": Option("mounts.csv of the machine: mounts that are not linear", False, lambda unit: None),
            "settings": Option(
                "settings.csv of the machine: start values of its parameters",
                True,
                lambda unit: unit / "resources" / "settings.csv",
            ),
            "setpoints": Option("setpoints.csv of the motion inside", False, lambda unit: _DEFAULT_SETPOINTS),
        },
        _read_whole_machine,
    ),
}


def of_unit(unit: str, kind: str, directory: Path, given: Mapping[str, Path]) -> Resources | None:
    """Resources of the unit in `directory`: its own files, or those of `given` in their place."""
    known = _options(unit, kind)
    if foreign := [name for name in given if name not in known]:
        raise InputError(f"{unit}: takes no {' and no '.join(foreign)} (it takes {', '.join(known) or 'no files'})")
    if not kind:
        return None
    files = {name: given.get(name) or option.default(directory) for name, option in known.items()}
    return KINDS[kind].read({name: path for name, path in files.items() if path is not None})


def from_files(given: Mapping[str, Path]) -> Resources:
    """Resources of the kind that the names of these files tell; every required one must be there."""
    for kind in KINDS.values():
        if given and given.keys() <= kind.options.keys():
            required = [name for name, option in kind.options.items() if option.required]
            if missing := [name for name in required if name not in given]:
                raise InputError(f"with {', '.join(given)} goes {', '.join(missing)}, which is not given")
            return kind.read(given)
    what = "; or ".join(", ".join(kind.options) for kind in KINDS.values())
    raise InputError(f"files of one kind are needed ({what}), given are {', '.join(given) or 'none'}")


def _options(unit: str, kind: str) -> Mapping[str, Option]:
    if kind and kind not in KINDS:
        raise InputError(f"{unit}: UNIT_RESOURCES is {kind}, known are {', '.join(KINDS)}")
    return KINDS[kind].options if kind else {}
