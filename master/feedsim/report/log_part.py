"""How a log was made: for the summary and for the report."""

from __future__ import annotations

from typing import Any

from feedsim.report.words import duration
from feedsim.scenario import Level, Logging
from feedsim.trace import Trace
from feedsim.units import show


def logging_part(logging: Logging | None, log: Trace | None) -> dict[str, Any] | None:
    """Settings of a log in SI; None where there is none."""
    if logging is None:
        return None
    return {
        "interval": {"value": logging.interval, "unit": "s"},
        "columns": list(log) if log is not None else [],
        "noise": {
            signal: {"value": level.value, "unit": "of the RMS" if level.relative else _unit(signal, log)}
            for signal, level in logging.noise.given().items()
        },
        "quantisation": {
            signal: {"value": step, "unit": _unit(signal, log)} for signal, step in logging.quantisation.given().items()
        },
        "delay": {signal: {"value": delay, "unit": "s"} for signal, delay in logging.delay.given().items()},
        "seed": logging.seed,
    }


def log_text(logging: Logging, log: Trace | None) -> str:
    """The same in a line."""
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
