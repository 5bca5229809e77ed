"""Scenarios on the default machine, built in Python (SI values)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from feedsim.motions import Motion
from feedsim.scenario import Machine, Recording, Scenario
from feedsim.scenario.load import load_machine

MACHINE = Path(__file__).resolve().parent.parent / "scenarios" / "machines" / "test_centre"


def default_machine() -> Machine:
    """The default machine: X 800, Y 327, Z 100 mm; T_ipo 2 ms, T_pos 1 ms; 30 m/min, 14.4 m/s2, 150 m/s3."""
    return load_machine(MACHINE)


def scenario(*motions: Motion, evaluate: tuple[Any, ...] = (), **changes: Any) -> Scenario:
    """A scenario of these motions; ``changes`` are further fields of the scenario."""
    fields: dict[str, Any] = {
        "name": "test",
        "machine": default_machine(),
        "motions": motions,
        "recording": Recording(interval=125e-6),
        "evaluate": evaluate,
    }
    return Scenario(**(fields | changes))
