"""summary.json: every derived figure with its unit and meaning, and where the numbers come from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from feedsim.analysis import Figure
from feedsim.cosim import Run
from feedsim.report.formatting import duration
from feedsim.report.provenance import input_files, software
from feedsim.report.run.pose import pose_part
from feedsim.report.summary import figures_part, inputs_part, machine_part, quantity
from feedsim.scenario import Level, Logging
from feedsim.trace import Trace
from feedsim.units import show

FORMAT = 1
COUPLING = {
    "residual": "interface energy residual: what the plant gave to the friction bond less what friction took from it",
    "residual_peak": "largest magnitude of the interface energy residual during the run",
    "friction_work": "work of the friction torque, to hold the residual against",
}


def summary(run: Run, figures: Mapping[str, Figure], files: Sequence[str]) -> dict[str, Any]:
    """Content of summary.json; a figure that could not be determined has the value null."""
    scenario, machine = run.scenario, run.scenario.machine
    return {
        "format": FORMAT,
        "warnings": list(run.warnings),
        "figures": figures_part(figures),
        "scenario": {
            "name": scenario.name,
            "file": scenario.file.name,
            "note": scenario.note,
            "set": list(scenario.settings),
            "overrides": list(scenario.overrides),
            "duration": quantity(run.program.duration, "s"),
            "coupling": {"scheme": scenario.coupling.scheme, "substeps": scenario.coupling.substeps},
            "recording_interval": quantity(scenario.recording.interval, "s"),
            "logging": logging_part(scenario.logging, run.log),
            "motions": [
                {
                    "description": segment.description,
                    "start": quantity(segment.start, "s"),
                    "end": quantity(segment.end, "s"),
                }
                for segment in run.program.segments
            ],
        },
        "machine": machine_part(machine),
        "pose": pose_part(run.pose),
        "inputs": inputs_part(input_files(scenario)),
        "units": {name: dict(unit) for name, unit in run.units.items()},
        "coupling": {
            name: {"value": value, "unit": "J", "meaning": COUPLING[name.partition(".")[2]]}
            for name, value in run.coupling.items()
        },
        "software": software(),
        "performance": {
            "wall_time": quantity(run.wall_time, "s"),
            "real_time_factor": quantity(real_time_factor(run), "1"),
        },
        "files": list(files),
    }


def real_time_factor(run: Run) -> float | None:
    """Simulated time over the time that it took; above 1 is faster than real time."""
    return run.program.duration / run.wall_time if run.wall_time > 0 else None


def summary_line(run: Run, figures: Mapping[str, Figure]) -> str:
    """The run in one line: its leading figures, and how fast it was."""
    leading = [f"{name} {figure}" for name, figure in figures.items() if is_leading(name, LINE)]
    factor = real_time_factor(run)
    digits = ".0f" if factor is not None and factor >= 10 else ".2g"
    speed = f" ({factor:{digits}} x real time)" if factor is not None else ""
    return ", ".join([*leading, f"{run.program.duration:.4g} s simulated in {run.wall_time:.3g} s{speed}"])


LINE = ("overshoot", "settling_time", "peak_torque", "G")
HEADER = (*LINE, "duration", "ringing_frequency", "plateau_torque", "rest_torque", "F_max", "F_min", "mean")


def is_leading(name: str, among: Sequence[str]) -> bool:
    """Whether a figure, named with its prefix, is one of ``among`` by the scales, or the quadrant glitch of an axis."""
    _, _, figure = name.partition(".")
    return figure in among or (figure.startswith("glitch_") and figure[-1] not in "+-")


def logging_part(logging: Logging | None, log: Trace | None) -> dict[str, Any] | None:
    """Settings of a log in SI; None where there is none."""
    if logging is None:
        return None
    return {
        "interval": quantity(logging.interval, "s"),
        "columns": list(log) if log is not None else [],
        "noise": {
            signal: {"value": level.value, "unit": "of the RMS" if level.relative else _unit(signal, log)}
            for signal, level in logging.noise.given().items()
        },
        "quantisation": {
            signal: {"value": step, "unit": _unit(signal, log)} for signal, step in logging.quantisation.given().items()
        },
        "delay": {signal: quantity(delay, "s") for signal, delay in logging.delay.given().items()},
        "seed": logging.seed,
    }


def log_text(logging: Logging, log: Trace | None) -> str:
    """Settings of a log in a line, for a person."""
    parts = [f"log.csv: every {duration(logging.interval)}, {', '.join(log) if log is not None else 'nothing'}"]
    for name, given in (
        ("noise", {signal: _level(level, signal, log) for signal, level in logging.noise.given().items()}),
        ("steps", {signal: show(step, _unit(signal, log)) for signal, step in logging.quantisation.given().items()}),
        ("delay", {signal: duration(delay) for signal, delay in logging.delay.given().items()}),
    ):
        if given:
            parts.append(f"{name} {', '.join(f'{signal} {text}' for signal, text in given.items())}")
    return "; ".join([*parts, *([f"seed {logging.seed}"] if logging.noise.given() else [])])


def _level(level: Level, signal: str, log: Trace | None) -> str:
    return f"{level.value * 100:.6g} % of its RMS" if level.relative else show(level.value, _unit(signal, log))


def _unit(signal: str, log: Trace | None) -> str:
    return next((log.unit(name) for name in log or () if name.partition(".")[2] == signal), "") if log else ""
