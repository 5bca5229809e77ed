"""Parts of every summary.json: figures with unit and meaning, the machine, input files."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from typing import Any

from feedsim.analysis import Figure
from feedsim.report.provenance import InputFile, Parameter, axis_parameters, friction_origins
from feedsim.scenario import Machine


def finite(value: Any) -> Any:
    """A value as JSON can hold it: null in place of a number that is not known."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def quantity(value: Any, unit: str, **more: str) -> dict[str, Any]:
    """A value, or a list of them, with its unit and what more is to be said of it; null where it is not known."""
    return {"value": finite(value), "unit": unit, **more}


def figures_part(figures: Mapping[str, Figure]) -> dict[str, Any]:
    """Figures by name; one that could not be determined has the value null."""
    return {name: quantity(each.value, each.unit, meaning=each.meaning) for name, each in figures.items()}


def machine_part(machine: Machine) -> dict[str, Any]:
    """A machine's pose and the parameters of its axes in SI."""
    return {
        "name": machine.name,
        "note": machine.note,
        "pose": {a: quantity(x, "m") for a, x in machine.pose.items()},
        "axes": {name: _axis(axis_parameters(axis)) for name, axis in machine.axes.items()},
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
