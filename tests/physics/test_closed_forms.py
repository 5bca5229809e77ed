"""Facts of the coupled system that follow in closed form, shown on the units through the master.

Friction is made negligible (1 nN.m): these facts are about the control and the structure. It cannot be left out
altogether, since a LuGre model needs a positive level.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from feedsim import analysis, scenario
from feedsim.simulation import cosim

CIRCLE = Path(__file__).resolve().parents[2] / "scenarios" / "xz_circle.yaml"
FRICTION_OFF = tuple(
    f"machine.axes.*.friction.{entry}"
    for entry in (
        "F_C=1e-9 N.m",
        "F_S=1e-9 N.m",
        "F_log=0 N.m",
        "sigma_1=0 N.m.s/rad",
        "sigma_2=0 N.m.s/rad",
        "W=0 rad",
    )
)
T_POS, T_C = 1e-3, 125e-6
RADIUS, FEED = 15e-3, 0.05
AXES = ("X", "Z")

MeanRadius = Callable[..., float]


def neutral(drive: scenario.Drive, ramped: bool = True) -> float:
    """T_sym that leaves the radius unchanged [s]."""
    return 2 * drive.D / drive.omega_0 + (T_POS - T_C) * (1 if ramped else 0.5)


@pytest.fixture(scope="module")
def mean_radius(fmus: Path) -> MeanRadius:
    """Mean radius deviation [um] of the friction-free circle with T_sym `delta` [s] below neutral."""
    drives = {axis: scenario.load(CIRCLE).machine.axes[axis].drive for axis in AXES}

    def run(K_v: float, delta: float, ramped: bool = True) -> float:
        overrides = [*FRICTION_OFF, f"machine.axes.*.drive.K_v={K_v} (m/min)/mm"]
        overrides.append(f"machine.axes.*.drive.ramp_speed_setpoint={str(ramped).lower()}")
        for axis, drive in drives.items():
            overrides.append(f"machine.axes.{axis}.drive.T_sym={neutral(drive, ramped) - delta!r} s")
        result = cosim.run(scenario.load(CIRCLE, overrides), fmus=fmus)
        return analysis.evaluate(result)["XZ.mean"].value

    return run


@pytest.mark.parametrize("ramped", [True, False])
def test_neutral_symmetry_filter_leaves_the_radius(mean_radius: MeanRadius, ramped: bool) -> None:
    assert abs(mean_radius(4.0, 0.0, ramped)) < 0.02


@pytest.mark.parametrize("K_v", [3.0, 4.0, 5.0])
def test_radius_change_of_a_wrong_symmetry_filter(mean_radius: MeanRadius, K_v: float) -> None:
    """dr = R omega^2 delta / K_v, to first order in omega T: 1 % covers the higher orders (0.3 % at K_v 3)."""
    base = mean_radius(K_v, 0.0)
    for delta in (-0.6e-3, 0.3e-3, 0.6e-3):
        expected = RADIUS * (FEED / RADIUS) ** 2 * delta / (K_v * 1000 / 60) * 1e6
        assert mean_radius(K_v, delta) - base == pytest.approx(expected, rel=0.01), f"delta {delta * 1e3} ms"


def test_equivalent_time_of_the_speed_loop(fmus: Path, tmp_path: Path) -> None:
    """On a constant acceleration n_a lags the speed setpoint by 2 D/omega_0; the structure does not enter.

    A recorded setpoint of constant acceleration, the position controller off, feedforward alone: n_s is a ramp. The
    modes ring, so the lag is averaged over several periods of the lowest one (0.25 s).
    """
    acceleration, duration = 1.0, 0.6
    t = np.arange(0.0, duration + 5e-4, 1e-3)
    recording = tmp_path / "ramp.csv"
    recording.write_text(
        "time [s]," + ",".join(f"{a} [m]" for a in "XYZ") + "\n"
        + "".join(f"{x:.3f}" + f",{acceleration * x * x / 2!r}" * 3 + "\n" for x in t.tolist())
    )  # fmt: skip
    file = tmp_path / "ramp.yaml"
    file.write_text(
        f"name: ramp\nmachine: {CIRCLE.parent / 'machines' / 'test_centre'}\nmotions:\n"
        f"  - {{kind: setpoints, file: {recording}, columns: {{X: X, Y: Y, Z: Z}}, relative: true}}\n"
    )
    overrides = [*FRICTION_OFF, "machine.axes.*.drive.K_v=0 1/s", "machine.axes.*.travel=[-10 m, 10 m]"]
    overrides.append("machine.axes.*.max_speed=100 m/min")
    result = cosim.run(scenario.load(file, overrides), fmus=fmus)
    trace = result.trace.between(0.3, 0.55)
    for axis, described in result.scenario.machine.axes.items():
        drive = described.drive
        rate = acceleration / described.I_P
        lag = float(np.mean(trace[f"{axis}.n_s"] - trace[f"{axis}.n_a"])) / rate
        # n_s shown at t is that of the instant before, and n_a that of now.
        assert lag + T_C == pytest.approx(2 * drive.D / drive.omega_0, rel=5e-3), axis


def test_circle_setpoint_has_the_programmed_radius(fmus: Path) -> None:
    """The oracle of the radius itself: the setpoints lie on the circle to far below what is measured on it."""
    program = cosim.run(scenario.load(CIRCLE, ["motions.0.direction=counterclockwise"]), fmus=fmus).program
    x, z = program.x_s["X"] - program.x_s["X"][0] + RADIUS, program.x_s["Z"] - program.x_s["Z"][0]
    # A cubic spline through points 2 ms apart on a circle errs by 5/384 h^4 R omega^4 = 4e-14 m.
    np.testing.assert_allclose(np.hypot(x, z), RADIUS, atol=1e-11)
    turns = np.unwrap(np.arctan2(z, x))[-1] / (2 * math.pi)
    assert turns == pytest.approx(3.0, abs=1e-9)
