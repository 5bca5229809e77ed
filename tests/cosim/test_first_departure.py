"""A run that fails names the axis that left its setpoint first, not the one whose unit happens to fail."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from feedsim import scenario
from feedsim.files.trace import Trace
from feedsim.foundation.errors import SimulationError
from feedsim.simulation import cosim
from feedsim.simulation.cosim.run import first_departure
from scenario_helpers import default_machine

ROOT = Path(__file__).resolve().parents[2]
TIME = np.arange(0, 0.1, 1e-3)


def said(**off: Any) -> str:
    """Of axes that are off their setpoints by these lengths [m] over time."""
    machine: Any = default_machine()
    program: Any = SimpleNamespace(time=np.array([0.0, 0.1]), x_s={axis: np.array([0.1, 0.2]) for axis in "XYZ"})
    columns = {f"{axis}.x_a": 0.1 + TIME + off.get(axis, 0 * TIME) for axis in "XYZ"}
    return first_departure(Trace(TIME, columns, dict.fromkeys(columns, "m")), program, machine)


def test_the_first_to_leave_is_named() -> None:
    grown = 1e-6 * np.exp(TIME / 5e-3)
    assert said() == ""
    assert said(X=0 * TIME + 6e-3) == ""  # what a fast axis is off without feedforward
    assert said(Z=grown) == "; axis Z left its setpoint first: 14.8 mm off at 0.048 s"  # 2 % of 685 mm are 13.7 mm
    assert said(Z=grown, X=1e-5 * np.exp((TIME - 0.02) / 5e-3)).startswith("; axis Z left")
    both = np.where(TIME > 0.05, 1.0, 0.0)
    assert said(X=both, Y=2 * both).startswith("; axis Y left its setpoint first: 2e+03 mm off at 0.051 s")


def test_a_run_that_fails_says_it(fmus: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Z's speed loop is unstable without any limit, and drags X along; the unit that fails may be any."""
    changes = [f"machine.axes.{axis}.drive.M_max=1e300 N.m" for axis in "XYZ"]
    changes += ["machine.axes.Z.drive.K_p=5e3 N.m.s/rad", "machine.axes.*.drive.u_max=1e300 V", "motions.0.turns=40"]
    with pytest.raises(SimulationError) as raised:
        cosim.run(scenario.load(ROOT / "scenarios" / "xz_circle.yaml", changes), fmus=fmus)
    assert "axis Z left its setpoint first" in str(raised.value)
