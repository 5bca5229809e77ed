"""The monolithic reference itself: known figures, closed forms, convergence, and a second integrator and controller.

What "right" looks like was measured on two implementations of the same synthetic machine that agreed within 1 %; the
figures were printed with three or four digits, so 2 % is the tolerance where no other reason is given.
"""

from __future__ import annotations

import math

import monolithic
import numpy as np
import pytest
from monolithic import figures
from monolithic.machine import Axis, Machine
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from solve_controller import Cascade
from solve_friction import engagement, steady_deflection

RADIUS, FEED = 0.015, 3.0 / 60
COARSE = 5e-6  # integration step for figures: costs them 1e-4 nm
MOVE = {
    "ramped": {
        "duration s": 1.2471,
        "peak torque N.m": 19.8,
        "plateau torque N.m": 2.667,
        "overshoot um": 3.17,
        "settling ms": 99.0,
        "ringing Hz": 20.75,
        "M_fr 1 s after N.m": 0.81,
        "tool overshoot um": 3.58,
    },
    "held": {
        "duration s": 1.2471,
        "peak torque N.m": 21.3,
        "plateau torque N.m": 2.667,
        "overshoot um": 3.03,
        "settling ms": 98.5,
        "ringing Hz": 20.75,
        "M_fr 1 s after N.m": 0.83,
    },
}
# by the axis that reverses: the softer Z has the higher glitch
CIRCLE = {
    ("ramped", "engaging"): {"glitch Z um": 7.88, "glitch X um": 4.84, "G um": 8.19, "mean um": 0.77},
    ("ramped", "lugre"): {"glitch Z um": 9.54, "glitch X um": 5.83},
    ("held", "engaging"): {"glitch Z um": 7.74, "glitch X um": 4.77, "G um": 8.04},
    ("held", "lugre"): {"glitch Z um": 9.38, "glitch X um": 5.73},
}


def machine(setpoint: str) -> Machine:
    default = monolithic.machine()
    return default if setpoint == "ramped" else monolithic.held(default)


def circle_figures(machine: Machine, tool: bool = False) -> dict[str, float]:
    setpoints = monolithic.circle(machine, RADIUS, FEED, turns=3)
    result = monolithic.simulate(machine, setpoints, step=COARSE)
    return figures.circle(result, machine, RADIUS, (setpoints.turns[1], setpoints.turns[2]), tool)


def with_drives(machine: Machine, **values: float) -> Machine:
    changed = machine.copy()
    for axis in changed.axes.values():
        axis.drive.update(values)
    return changed


@pytest.mark.parametrize("setpoint", ["ramped", "held"])
def test_positioning(setpoint: str) -> None:
    m = machine(setpoint)
    setpoints = monolithic.move(m, "Z", 0.100, 5.0 / 60)
    found = figures.positioning(monolithic.simulate(m, setpoints, step=COARSE), setpoints)
    for name, expected in MOVE[setpoint].items():
        assert found[name] == pytest.approx(expected, rel=0.02), name


@pytest.mark.parametrize(("setpoint", "friction"), CIRCLE)
def test_circle(setpoint: str, friction: str) -> None:
    m = machine(setpoint)
    found = circle_figures(m if friction == "engaging" else monolithic.pure_lugre(m))
    for name, expected in CIRCLE[setpoint, friction].items():
        assert found[name] == pytest.approx(expected, rel=0.02), name


def test_circle_by_tool_point() -> None:
    assert circle_figures(machine("ramped"), tool=True)["glitch X um"] == pytest.approx(5.10, rel=0.02)


@pytest.mark.parametrize(
    ("changes", "overshoot"),
    [
        ({"emf_feedforward": 0.0}, 1.58 * 3.17),
        ({"f": 0.0}, 4.6),
        ({"ideal_current_loop": 1.0}, 1.29 * 3.17),
    ],
)
def test_overshoot_of_other_drives(changes: dict[str, float], overshoot: float) -> None:
    m = with_drives(machine("ramped"), **changes)
    setpoints = monolithic.move(m, "Z", 0.100, 5.0 / 60)
    found = figures.positioning(monolithic.simulate(m, setpoints, step=COARSE), setpoints)
    assert found["overshoot um"] == pytest.approx(overshoot, rel=0.02)


@pytest.mark.parametrize("setpoint", ["ramped", "held"])
def test_neutral_symmetry_leaves_the_radius(setpoint: str) -> None:
    # closed form to first order in omega T; what is left is a thousandth of a micrometre
    assert abs(circle_figures(monolithic.frictionless(machine(setpoint)))["mean um"]) < 0.02


@pytest.mark.parametrize("K_v", [3, 4, 5])
def test_radius_change(K_v: float) -> None:
    neutral = with_drives(monolithic.machine(), K_v=K_v * 1000 / 60)
    before = circle_figures(neutral)["mean um"]
    for delta in (-0.6e-3, 0.3e-3, 0.6e-3):
        changed = neutral.copy()
        for axis in changed.axes.values():
            axis.drive["T_sym"] -= delta
        found = circle_figures(changed)["mean um"] - before
        # first order in omega / K_v as well: (3.3 / 50)^2 = 0.4 % at K_v 3
        expected = RADIUS * (FEED / RADIUS) ** 2 * delta / neutral.axes["X"].drive["K_v"] * 1e6
        assert found == pytest.approx(expected, rel=0.005)


@pytest.mark.parametrize(("setpoint", "expected"), [("ramped", -1.5), ("held", -1.2)])
def test_lag_instead_of_dead_time(setpoint: str, expected: float) -> None:
    m = machine(setpoint)
    found = circle_figures(with_drives(m, symmetry_lag=1.0))["mean um"] - circle_figures(m)["mean um"]
    assert found == pytest.approx(expected, rel=0.02)


def test_integration_error() -> None:
    m = monolithic.machine()
    setpoints = monolithic.circle(m, RADIUS, FEED, turns=0.6, rest=0.0)
    coarse, fine = (monolithic.simulate(m, setpoints, step=step) for step in (2.5e-6, 1e-6))
    for axis in m.axes:
        # budget of the reference: 0.05 nm and 1 uN.m; where k jumps the method falls to order 2, which costs some nN.m
        assert np.max(np.abs(coarse[f"{axis}.x_a"] - fine[f"{axis}.x_a"])) < 0.05e-9
        assert np.max(np.abs(coarse[f"{axis}.M_fr"] - fine[f"{axis}.M_fr"])) < 1e-6


# --- a second implementation of everything but the setpoints --------------------------------------------------------


class Second:
    """Plant and frictions by DOP853 at tight tolerance, with the controllers of solve_controller."""

    def __init__(self, m: Machine, x_start: dict[str, float]) -> None:
        self.m = m
        self.names = list(m.axes)
        self.omega = 2 * np.pi * m.frequency
        self.state = np.zeros(2 * len(self.omega) + 2 * len(self.names))
        self.M_a = np.zeros(len(self.names))
        self.controllers = [Cascade(self._parameters(axis), x_start[name]) for name, axis in m.axes.items()]

    def _parameters(self, axis: Axis) -> dict[str, float]:
        renamed = {"ramp": "ramp_speed_setpoint", "K_p_current": "current.K_p", "T_n_current": "current.T_n"}
        renamed |= {name: f"filter_1.{name}" for name in ("f", "D_num", "D_den")}
        values = {renamed.get(name, name): value for name, value in axis.drive.items()}
        return values | {"T_c": self.m.T_c, "T_pos": self.m.T_pos, "filter_1.type": 1.0}

    def positions(self) -> NDArray[np.float64]:
        start = np.array([axis.x_0 for axis in self.m.axes.values()])
        return np.asarray(start + self.state[: len(self.omega)] @ self.m.x)

    def speeds(self) -> NDArray[np.float64]:
        modes = len(self.omega)
        return np.asarray(self.state[modes : 2 * modes] @ self.m.n)

    def cycle(self, x_s: list[float], n_ffw: list[float]) -> None:
        M_next = np.array(
            [
                controller.sample(x, n, x_a, n_a)
                for controller, x, n, x_a, n_a in zip(
                    self.controllers, x_s, n_ffw, self.positions(), self.speeds(), strict=True
                )
            ]
        )
        modes, T_c = len(self.omega), self.m.T_c
        frictions = [axis.friction for axis in self.m.axes.values()]

        def rate(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
            q, v, z, c = y[:modes], y[modes : 2 * modes], y[2 * modes : -3], y[-3:]
            n = v @ self.m.n
            M_fr, dz, dc = np.zeros(3), np.zeros(3), n.copy()
            for i, p in enumerate(frictions):
                dz[i] = n[i] - abs(n[i]) / steady_deflection(p, n[i], math.copysign(1, n[i])) * z[i]
                if abs(c[i]) >= p["W"] / 2 and c[i] * n[i] > 0:
                    dc[i] = 0
                k = engagement(p, z[i], c[i])[1]
                M_fr[i] = k * p["sigma_0"] * z[i] + p["sigma_1"] * dz[i] + p["sigma_2"] * n[i]
            torque = self.M_a + (M_next - self.M_a) * t / T_c - M_fr
            acceleration = self.m.n @ torque - self.omega**2 * q - 2 * self.m.damping * self.omega * v
            return np.concatenate([v, acceleration, dz, dc])

        solution = solve_ivp(rate, (0, T_c), self.state, method="DOP853", rtol=1e-11, atol=1e-15, first_step=T_c / 8)
        self.state = solution.y[:, -1]
        half = np.array([p["W"] / 2 for p in frictions])
        self.state[-3:] = np.clip(self.state[-3:], -half, half)
        self.M_a = M_next


def test_against_second_implementation() -> None:
    # a circle so small that start, both reversals of Z and X and stop fall into half a second
    m = monolithic.machine()
    setpoints = monolithic.circle(m, 0.0012, 0.018, turns=1, rest=0.05)
    first = monolithic.simulate(m, setpoints, step=1e-6)
    names = list(m.axes)
    second = Second(m, {name: float(setpoints.x_s[name][0]) for name in names})
    ratio = round(m.T_pos / m.T_c)
    cycles = len(first["time"]) - 1
    worst = np.zeros(3)
    for k in range(cycles):
        j = k // ratio
        second.cycle([setpoints.x_s[name][j] for name in names], [setpoints.n_ffw[name][j] for name in names])
        worst = np.maximum(worst, np.abs(second.positions() - [first[f"{name}.x_a"][k + 1] for name in names]))
    assert np.all(np.ptp(np.sign([first[f"{name}.n_a"] for name in ("X", "Z")]), axis=1) == 2)
    # 2e-5 nm measured: what DOP853 loses at the kinks. A fiftieth of the reference's budget still shows any difference
    # in what the equations are taken to mean
    assert np.max(worst) < 1e-12
