"""Where the numbers come from: input files with their hashes, archives, software, parameters of the axes in SI.

And what every summary.json says of these and of figures, each value with its unit.
"""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from feedsim.files.fields import Quantity
from feedsim.files.source import content_digest
from feedsim.foundation.errors import InputError
from feedsim.foundation.installation import version
from feedsim.scenario import Axis, Drive, ForeignUnit, FrictionParameters, Machine, Scenario
from feedsim.scenario.roles import LUGRE

if TYPE_CHECKING:
    from feedsim.analysis import Figure

Parameter = float | int | bool | str


@dataclass(frozen=True)
class InputFile:
    """A file that the run depends on: what it is, its name without folder, SHA-256 of its bytes.

    The hash is taken when the results are written; None where the file cannot be read then.
    """

    role: str
    name: str
    sha256: str | None


@dataclass(frozen=True)
class ArchiveUse:
    """A distinct archive and the instances that were made of it."""

    name: str
    version: str
    guid: str
    instances: tuple[str, ...]


def input_files(scenario: Scenario) -> list[InputFile]:
    """Scenario, machine and further YAML files, table of modes, recordings, loads; each once."""
    return hash_files(_inputs(scenario))


def input_paths(scenario: Scenario) -> list[Path]:
    """Where the files of :func:`input_files` are."""
    return [path for _, path in _inputs(scenario)]


def _inputs(scenario: Scenario) -> list[tuple[str, Path]]:
    named = [(place or "scenario", path) for place, path in scenario.files]
    named.append(("modes", scenario.machine.modes.file))
    if scenario.machine.plant is not None:
        named.append(("plant archive", scenario.machine.plant))
    named += [(f"{unit.role.name} of {axis}", unit.fmu) for axis, unit in scenario.machine.foreign_units]
    named += [
        ("NC program" if motion.kind == "program" else "recorded setpoints", path)
        for motion in scenario.motions
        for path in motion.files.values()
    ]
    named += [("load", load.file) for load in scenario.loads if load.file is not None]
    return named


def hash_files(files: Sequence[tuple[str, Path]]) -> list[InputFile]:
    """Files with what they are, each once, under what it is first."""
    once = {path.absolute(): (role, path) for role, path in reversed(files)}
    return [InputFile(role, path.name, sha256(path)) for role, path in reversed(once.values())]


def software() -> dict[str, str]:
    """Versions of the package, of what it calculates with, and the platform."""
    names = ("feedsim", "numpy", "scipy", "ruckig", "fmpy")
    result = {"python": platform.python_version(), "platform": platform.platform()}
    return result | {name: version(name) or "not installed as a package" for name in names}


def archives(units: Mapping[str, Mapping[str, str]]) -> list[ArchiveUse]:
    """Distinct archives of a run's units (instance -> GUID and version), in the order of their first use."""
    result: dict[tuple[str, str, str], list[str]] = {}
    for instance, unit in units.items():
        key = (unit.get("name", instance.partition("_")[0]), unit.get("version", "?"), unit.get("guid", "?"))
        result.setdefault(key, []).append(instance)
    return [ArchiveUse(*key, tuple(instances)) for key, instances in result.items()]


def axis_parameters(axis: Axis) -> dict[str, dict[str, tuple[Parameter, str]]]:
    """Group ("axis", "drive", "friction") -> name of the FMI unit -> SI value and unit ("" for words and switches)."""
    mechanics: dict[str, tuple[Parameter, str]] = {"pitch": (axis.pitch, "m"), "M_0": (axis.M_0, "N.m")}
    drive, friction = (_with_units(group) for group in (axis.drive, axis.friction))
    return {"axis": mechanics, "drive": drive, "friction": friction}


def friction_origins(machine: Machine) -> dict[str, str]:
    """Axis -> where its friction comes from, as far as its group `identified` says; axes without one are left out.

    What the group holds is not checked when it is read: whatever stands there ends as text.
    """
    origins: dict[str, str] = {}
    for name, axis in machine.axes.items():
        reported = axis.friction.identified if isinstance(axis.friction, FrictionParameters) else None
        if not reported:
            continue
        traces = reported.get("traces")
        files = [item.get("file") for item in traces if isinstance(item, dict)] if isinstance(traces, list) else []
        parts = [f"identified {reported['date']}" if "date" in reported else "identified"]
        parts += ["from " + ", ".join(str(file) for file in files)] if files else []
        origins[name] = " ".join(parts)
    return origins


def _with_units(group: Drive | FrictionParameters | ForeignUnit) -> dict[str, tuple[Parameter, str]]:
    if isinstance(group, ForeignUnit):  # what it declares, and has not been given here, only its archive knows
        return {"fmu": (group.fmu.name, ""), **{name: (value, "") for name, value in group.parameters.items()}}
    units = dict(_units(type(group)))
    law = getattr(group, "law", LUGRE)
    named: dict[str, tuple[Parameter, str]] = {"law": (law, "")} if law != LUGRE else {}
    return named | {name: (value, units.get(name, "")) for name, value in group.parameters().items()}


def _units(model: Any) -> Iterator[tuple[str, str]]:
    """Names of a group's quantities, nested groups' as group.name, with their SI units."""
    for name, field in model.model_fields.items():
        inner = [field.annotation, *get_args(field.annotation)]
        nested = [part for part in inner if hasattr(part, "model_fields")]
        if nested:
            yield from ((f"{name}.{key}", unit) for key, unit in _units(nested[0]))
            continue
        notes: list[Any] = [*field.metadata, *(note for part in inner for note in getattr(part, "__metadata__", ()))]
        yield from ((name, note.unit) for note in notes if isinstance(note, Quantity))


def sha256(path: Path) -> str | None:
    """Of a file's bytes; None where it cannot be read."""
    try:
        return content_digest(path)
    except InputError:
        return None


def finite(value: Any) -> Any:
    """A value as JSON can hold it: null in place of a number that is not known."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def quantity(value: Any, unit: str, **more: str) -> dict[str, Any]:
    """A value, or a list of them, with its unit and what more is to be said of it; null where it is not known."""
    return {"value": finite(value), "unit": unit, **more}


def figures_part(figures: Mapping[str, Figure]) -> dict[str, Any]:
    """Figures by name, with an interval where it is known; one that could not be determined has the value null."""
    return {
        name: quantity(figure.value, figure.unit, meaning=figure.meaning)
        | ({} if figure.interval is None else {"interval": [*map(finite, figure.interval)]})
        for name, figure in figures.items()
    }


def machine_part(machine: Machine) -> dict[str, Any]:
    """A machine's pose, cycles, limits, structure and the parameters of its axes in SI."""
    cycles, path = machine.cycles, machine.path
    files = {"structure": machine.structure, "plant": machine.plant}
    return {
        "name": machine.name,
        "note": machine.note,
        "pose": {a: quantity(x, "m") for a, x in machine.pose.items()},
        "cycles": {name: quantity(getattr(cycles, name), "s") for name in ("control", "position", "interpolation")},
        "path": {"jerk": quantity(path.jerk, "m/s^3"), "acceleration": quantity(path.acceleration, "m/s^2")},
        "modes": {"name": machine.modes.file.name, "sha256": machine.modes.digest},
        **{name: {"name": file.name, "sha256": sha256(file)} for name, file in files.items() if file is not None},
        "errors": machine.errors,
        "axes": {
            name: _axis(axis_parameters(axis))
            | {
                "travel": {"low": quantity(axis.travel[0], "m"), "high": quantity(axis.travel[1], "m")},
                "max_speed": quantity(axis.max_speed, "m/s"),
                "max_acceleration": quantity(axis.max_acceleration, "m/s^2"),
            }
            for name, axis in machine.axes.items()
        },
        "friction_origins": friction_origins(machine),
    }


def inputs_part(files: Iterable[InputFile]) -> list[dict[str, str | None]]:
    """Input files with their hashes."""
    return [{"role": f.role, "name": f.name, "sha256": f.sha256} for f in files]


def to_json(content: Mapping[str, Any]) -> str:
    """JSON text with shortest round-trip numbers; no NaN or infinity, which JSON has not."""
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _axis(groups: Mapping[str, Mapping[str, tuple[Parameter, str]]]) -> dict[str, Any]:
    """pitch and M_0 of an axis, and its parameters by unit; words and switches stand alone, without a unit."""
    plain = {
        group: {name: quantity(value, unit) if unit else value for name, (value, unit) in values.items()}
        for group, values in groups.items()
    }
    return plain.pop("axis") | plain
