"""summary.json: every derived figure with its unit and meaning, and where the numbers come from."""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Protocol

from feedsim.analysis import Figure, Result
from feedsim.report.provenance import Parameter, axis_parameters, input_files

FORMAT = 1
COUPLING = {
    "residual": "interface energy residual: what the plant gave to the friction bond less what friction took from it",
    "residual_peak": "largest magnitude of the interface energy residual during the run",
    "friction_work": "work of the friction torque, to hold the residual against",
}


class Run(Result, Protocol):
    """What a report needs of a run (feedsim.cosim.Run is one)."""

    @property
    def coupling(self) -> Mapping[str, float]: ...
    @property
    def wall_time(self) -> float: ...
    @property
    def units(self) -> Mapping[str, Mapping[str, str]]: ...
    @property
    def warnings(self) -> tuple[str, ...]: ...


def software() -> dict[str, str]:
    """Versions of the package, of what it calculates with, and the platform."""
    names = ("feedsim", "numpy", "scipy", "ruckig", "fmpy")
    found = {"python": platform.python_version(), "platform": platform.platform()}
    for name in names:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed as a package"
    return found


def summary(run: Run, figures: Mapping[str, Figure], files: Sequence[str]) -> dict[str, Any]:
    """Content of summary.json; a figure that could not be determined has the value null."""
    scenario, machine = run.scenario, run.scenario.machine
    return {
        "format": FORMAT,
        "warnings": list(run.warnings),
        "figures": {
            name: {
                "value": figure.value if math.isfinite(figure.value) else None,
                "unit": figure.unit,
                "meaning": figure.meaning,
            }
            for name, figure in figures.items()
        },
        "scenario": {
            "name": scenario.name,
            "file": scenario.file.name,
            "note": scenario.note,
            "set": list(scenario.settings),
            "overrides": list(scenario.overrides),
            "duration": {"value": run.program.duration, "unit": "s"},
            "coupling": {"scheme": scenario.coupling.scheme, "substeps": scenario.coupling.substeps},
            "recording_interval": {"value": scenario.recording.interval, "unit": "s"},
            "motions": [
                {
                    "description": segment.description,
                    "start": {"value": segment.start, "unit": "s"},
                    "end": {"value": segment.end, "unit": "s"},
                }
                for segment in run.program.segments
            ],
        },
        "machine": {
            "name": machine.name,
            "note": machine.note,
            "pose": {a: {"value": x, "unit": "m"} for a, x in machine.pose.items()},
            "axes": {name: _axis(axis_parameters(axis)) for name, axis in machine.axes.items()},
        },
        "inputs": [{"role": f.role, "name": f.name, "sha256": f.sha256} for f in input_files(scenario)],
        "units": {name: dict(unit) for name, unit in run.units.items()},
        "coupling": {
            name: {"value": value, "unit": "J", "meaning": COUPLING[name.partition(".")[2]]}
            for name, value in run.coupling.items()
        },
        "software": software(),
        "performance": {
            "wall_time": {"value": run.wall_time, "unit": "s"},
            "real_time_factor": {"value": real_time_factor(run), "unit": "1"},
        },
        "files": list(files),
    }


def _axis(groups: Mapping[str, Mapping[str, tuple[Parameter, str]]]) -> dict[str, Any]:
    """pitch and M_0 of an axis, and its parameters by unit; words and switches stand alone, without a unit."""
    plain = {
        group: {name: {"value": value, "unit": unit} if unit else value for name, (value, unit) in values.items()}
        for group, values in groups.items()
    }
    return plain.pop("axis") | plain


def to_json(content: Mapping[str, Any]) -> str:
    """JSON text with shortest round-trip numbers; no NaN or infinity, which JSON has not."""
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def real_time_factor(run: Run) -> float | None:
    """Simulated time over the time that it took; above 1 is faster than real time."""
    return run.program.duration / run.wall_time if run.wall_time > 0 else None


def summary_line(run: Run, figures: Mapping[str, Figure]) -> str:
    """The run in one line: its leading figures, and how fast it was."""
    leading = [f"{name} {figure}" for name, figure in figures.items() if is_leading(name, LINE)]
    factor = real_time_factor(run)
    speed = f" ({factor:.2g} x real time)" if factor is not None else ""
    return ", ".join([*leading, f"{run.program.duration:.4g} s simulated in {run.wall_time:.3g} s{speed}"])


LINE = ("overshoot", "settling_time", "peak_torque", "G")
HEADER = (*LINE, "duration", "ringing_frequency", "plateau_torque", "rest_torque", "F_max", "F_min", "mean")


def is_leading(name: str, among: Sequence[str]) -> bool:
    """Whether a figure, named with its prefix, is one of ``among`` by the scales, or the quadrant glitch of an axis."""
    _, _, figure = name.partition(".")
    return figure in among or (figure.startswith("glitch_") and figure[-1] not in "+-")
