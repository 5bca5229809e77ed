"""Simulation of machine-tool feed drives with non-linear friction: the master of three FMI 2.0 co-simulation units.

>>> from feedsim import load_scenario, run                                   # doctest: +SKIP
>>> result = run(load_scenario("scenarios/z_positioning.yaml"))             # doctest: +SKIP
>>> result.trace["Z.x_a"].max()                                             # doctest: +SKIP
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from feedsim.analysis import evaluate  # type: ignore[no-redef]
    from feedsim.cosim import Run, run  # type: ignore[no-redef]
    from feedsim.errors import FeedsimError, InputError, OutputError, SimulationError
    from feedsim.scenario import load as load_scenario  # type: ignore[no-redef]
    from feedsim.trace import Trace
    from feedsim.trace import read_csv as read_trace

__all__ = [
    "FeedsimError",
    "InputError",
    "OutputError",
    "Run",
    "SimulationError",
    "Trace",
    "evaluate",
    "load_scenario",
    "read_trace",
    "run",
]

# Loaded on first use: `feedsim --help` should not wait for numpy and fmpy.
_HOMES = {
    "FeedsimError": ("errors", "FeedsimError"),
    "InputError": ("errors", "InputError"),
    "OutputError": ("errors", "OutputError"),
    "SimulationError": ("errors", "SimulationError"),
    "Run": ("cosim", "Run"),
    "Trace": ("trace", "Trace"),
    "evaluate": ("analysis", "evaluate"),
    "load_scenario": ("scenario", "load"),
    "read_trace": ("trace", "read_csv"),
    "run": ("cosim", "run"),
}


def __getattr__(public: str) -> Any:
    if public not in _HOMES:
        raise AttributeError(f"module 'feedsim' has no attribute '{public}'")
    room, attribute = _HOMES[public]
    return getattr(import_module(f"feedsim.{room}"), attribute)
