"""Simulation of machine-tool feed drives with non-linear friction: the master of FMI 2.0 co-simulation units.

>>> import feedsim as fs
>>> result = fs.run("xz_circle.yaml", set={"machine.axes.Z.drive.K_v": "5 (m/min)/mm"})
>>> result.figures["XZ.G"].unit
'um'
>>> picture = result.plot()
>>> picture.save("circle.png").name
'circle.png'
"""

from __future__ import annotations

from importlib import import_module as _import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing import Any

    from feedsim.analysis.evaluate import evaluate
    from feedsim.analysis.figures import Figure
    from feedsim.cosim import Run
    from feedsim.errors import FeedsimError, InputError, OutputError, SimulationError
    from feedsim.examples import copy as example
    from feedsim.front.calls import frf, identify, load, run, sweep
    from feedsim.front.comparison import compare
    from feedsim.front.overlay import Overlay, show
    from feedsim.front.result import Result
    from feedsim.jobs.circle import circle
    from feedsim.jobs.compensate import compensate
    from feedsim.jobs.identify_drive import identify_drive
    from feedsim.jobs.replay import replay
    from feedsim.scenario import Machine, Scenario, load_machine
    from feedsim.scenario.load import load as load_scenario
    from feedsim.trace import Trace
    from feedsim.trace import read_csv as read_trace

# Loaded on first use: `feedsim --help` should not wait for numpy and fmpy.
_HOMES = {
    "FeedsimError": "errors",
    "Figure": "analysis",
    "InputError": "errors",
    "Machine": "scenario",
    "OutputError": "errors",
    "Overlay": "front.overlay",
    "Result": "front.result",
    "Run": "cosim",
    "Scenario": "scenario",
    "SimulationError": "errors",
    "Trace": "trace",
    "circle": "jobs.circle",
    "compare": "front.comparison",
    "compensate": "jobs.compensate",
    "evaluate": "analysis",
    "example": "examples:copy",
    "frf": "front.calls",
    "identify": "front.calls",
    "identify_drive": "jobs.identify_drive",
    "load": "front.calls",
    "load_machine": "scenario",
    "load_scenario": "scenario:load",
    "read_trace": "trace:read_csv",
    "replay": "jobs.replay",
    "run": "front.calls",
    "show": "front.overlay",
    "sweep": "front.calls",
}

__all__ = [
    "FeedsimError", "Figure", "InputError", "Machine", "OutputError", "Overlay", "Result", "Run", "Scenario",
    "SimulationError", "Trace", "circle", "compare", "compensate", "evaluate", "example", "frf",
    "identify", "identify_drive", "load", "load_machine", "load_scenario", "read_trace", "replay", "run",
    "show", "sweep",
]  # fmt: skip


def __getattr__(public: str) -> Any:
    if public not in _HOMES:
        raise AttributeError(f"module 'feedsim' has no attribute '{public}'")
    room, _, name = _HOMES[public].partition(":")
    try:
        return getattr(_import_module(f"feedsim.{room}"), name or public)
    except ModuleNotFoundError as error:
        from feedsim.extras import missing

        raise missing(error, f"feedsim.{public}") or error from None


def __dir__() -> list[str]:
    return [*__all__]
