"""The torque at rest that a record begins with, and the run-in that leaves friction with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drive_helpers import MACHINES
from feedsim.estimation.identify import Record
from feedsim.estimation.replay.closed_loop import AxisRecord, Replay, run_in
from feedsim.scenario import load_machine
from feedsim.simulation.cosim.friction_law import FrictionLaw

FRICTION = load_machine(MACHINES / "sinumerik_840d").axes["X"].friction


@pytest.mark.parametrize("share", [-0.9, -0.4, 0.0, 0.3, 0.8])
@pytest.mark.parametrize(("W", "gamma"), [(0.0, 1.0), (0.04, 0.5), (0.4, 0.3)])
def test_the_run_in_leaves_friction_with_a_torque(share: float, W: float, gamma: float) -> None:
    """By the friction unit itself, along that motion: within 5 % of the static friction, which its damping is."""
    friction = FRICTION.model_copy(update={"W": W, "gamma": gamma})
    static = float(friction.F_S)
    time = np.linspace(0.0, 1.0, 20001)
    angle = run_in(friction, share * static, time)
    assert (angle[0], angle[-1]) == (0.0, pytest.approx(0.0, abs=1e-12))
    with FrictionLaw() as law:
        values = {name: float(getattr(friction, name)) for name in law.names}
        slowly = 100.0  # [s] for the whole run-in
        torque = law(values, np.gradient(angle, time) / slowly, time[1] * slowly, substeps=4)
    assert torque[-1] == pytest.approx(share * static, abs=0.05 * static)


@pytest.mark.parametrize("torque", [-1.0, 0.9])
def test_a_record_at_rest_is_met(torque: float) -> None:
    """An axis that rests with a torque of an earlier motion, and does not move: the simulation holds it."""
    machine = load_machine(MACHINES / "sinumerik_840d")
    I_P = machine.axes["X"].I_P
    time, still = 2e-3 * np.arange(100), np.zeros(100)
    made = Record("made", time=time, torque=still + torque, angle=still, setpoint=still)
    each = AxisRecord("X", made, I_P, np.ones(100, dtype=bool))
    with Replay(machine, {"X": each}) as replay:
        assert replay.preload(machine)
        simulated = replay.follow(machine, ("M_a", "x_a"))["X"]
    assert simulated["M_a"] == pytest.approx(made.torque, abs=0.3)
    assert np.max(np.abs(simulated["x_a"])) < 1e-6
    own = replace(each, record=replace(made, torque=still + machine.axes["X"].M_0))
    with Replay(machine, {"X": own}) as replay:  # which it comes to by itself
        assert not replay.preload(machine)
