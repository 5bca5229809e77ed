"""The controller's enable: no torque without it, and a drive that begins anew when it comes back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from controller_reference import DEFAULTS
from controller_unit import COLUMNS, Archive, Instance, compare, random_signals

T_C = DEFAULTS["T_c"]
NO_LIMITS = {"M_max": 1e6, "u_max": 1e6}
J = 0.01639  # kg.m2, Z axis of the synthetic default machine

OPTIONS: dict[str, Mapping[str, float]] = {
    "default": {},
    "symmetry lag, held": {"symmetry_lag": 1, "ramp_speed_setpoint": 0},
    "reference model with dead time": {"T_ref": 0.00041},
    "speed from the position": {"speed_window": 11},
    "four filters": {
        "filter_1.type": 2, "filter_2.type": 1, "filter_3.type": 1, "filter_4.type": 2, "filter_4.f": 3900,
    },
    "ideal current loop": {"ideal_current_loop": 1},
    "salient motor": {"L_d": 0.003, "L_q": 0.008, "R": 0.9, "p": 4, "K_t": 1.6},
    "limits": {"M_max": 15, "u_max": 40},
}  # fmt: skip


@pytest.fixture(scope="module")
def archive(fmus: Path) -> Iterator[Archive]:
    opened = Archive(fmus / "controller.fmu")
    yield opened
    opened.close()


def assert_same(seen: np.ndarray, expected: np.ndarray, tolerance: float) -> None:
    """Every column within `tolerance` of its own largest value."""
    for column, name in enumerate(COLUMNS):
        worst = np.max(np.abs(seen[:, column] - expected[:, column]))
        assert worst <= tolerance * np.max(np.abs(expected[:, column])), f"{name}: off by {worst:g}"


# Numbers of steps: within a position cycle and at its edges, for a step and for longer than any delay, from the start.
WITHOUT = {
    "from the start": [(0, 1), (40, 41), (163, 200)],
    "later": [(16, 24), (100, 207), (300, 301), (302, 303)],
    "all the time": [(0, 500)],
}


@pytest.mark.extensive
@pytest.mark.parametrize("without", WITHOUT)
@pytest.mark.parametrize("name", OPTIONS)
def test_agrees_with_the_reference(archive: Archive, name: str, without: str) -> None:
    def released(step: int) -> bool:
        return not any(first <= step < end for first, end in WITHOUT[without])

    parameters = {**(NO_LIMITS if name != "limits" else {}), **OPTIONS[name]}
    signals = random_signals(300 + list(OPTIONS).index(name))
    seen, expected = compare(archive, parameters, signals, [Fraction(1)] * 500, released=released)
    # as in test_controller_unit.py: sums of some hundred terms, in x_e and dM_a/dt differences of large numbers
    assert_same(seen, expected, 1e-10)
    at_rest = [not released(k) for k in range(500)]
    assert np.all(seen[at_rest, COLUMNS.index("M_a")] == 0.0)
    assert np.all(seen[at_rest, COLUMNS.index("n_s")] == 0.0)
    assert not np.any(seen[at_rest][:, COLUMNS.index("torque_limited") :])


@pytest.mark.parametrize("step", [Fraction(3), Fraction(7, 10), Fraction(1, 16)], ids=str)
def test_any_step_size(archive: Archive, step: Fraction) -> None:
    """The release of a step holds for every instant in it."""
    count = int(240 / step)
    gaps = (0.0, 0.05), (0.3, 0.5)  # of the run

    def released(number: int) -> bool:
        return not any(first * count <= number < end * count for first, end in gaps)

    seen, expected = compare(archive, NO_LIMITS, random_signals(17), [step] * count, released=released)
    assert_same(seen, expected, 1e-10)


class Axis:
    """A rigid inertia without friction behind the unit, driven by its torque, which is linear over a cycle."""

    def __init__(self, archive: Archive, parameters: Mapping[str, float], n_a: float = 0.0) -> None:
        self.unit: Instance = archive.instance()
        self.unit.start(parameters)
        self.k, self.n_a, self.x_a, self.M_a = 0, n_a, 0.1, 0.0

    def cycle(self, x_s: float, n_ffw: float, release: bool) -> None:
        self.unit.enable(release)
        self.unit.step(self.k * T_C, T_C, [x_s, n_ffw, self.x_a, self.n_a, 0.0, 0.0])
        M_next = self.unit.get("M_a")
        self.x_a += DEFAULTS["I_P"] * (self.n_a * T_C + (2 * self.M_a + M_next) / 6 * T_C**2 / J)
        self.n_a += (self.M_a + M_next) / 2 * T_C / J
        self.M_a = M_next
        self.k += 1


def test_the_axis_coasts_at_the_speed_it_has(archive: Archive) -> None:
    """Released during an acceleration, where there is torque. It runs out over one cycle, and with it ends what changes
    the speed: n = n(t_k) + M_a(t_k) T_c/(2 J) from t_k+1 on, to the last bit."""
    axis = Axis(archive, {})
    acceleration = 1.0  # m/s2
    for k in range(800):
        t = k * T_C
        axis.cycle(0.1 + acceleration * t**2 / 2, acceleration * t / DEFAULTS["I_P"], True)
    assert axis.M_a > 4.0
    coasting = axis.n_a + axis.M_a / 2 * T_C / J
    for _ in range(4000):
        axis.cycle(0.5, 0.0, False)
        assert axis.n_a == coasting
        assert axis.M_a == 0.0
    assert axis.unit.get("u_q") == pytest.approx(DEFAULTS["K_t"] / 1.5 * coasting, rel=1e-15)  # what the motor induces
    axis.unit.close()


def test_a_drive_that_is_released_again_has_no_past(archive: Archive) -> None:
    """An axis that coasts, and a control that follows it up: x_s = x_a. At the release nothing jumps that the speed
    setpoint, which begins at 0, does not ask for: the torque is that of the speed controller alone."""
    axis = Axis(archive, {"speed_integrator": 0, "filter_1.type": 0, "K_v": 30.0}, n_a=5.0)
    for _ in range(160):
        axis.cycle(axis.x_a, 0.0, True)  # brakes: K_p 5 rad/s = 30.9 N.m at first
    axis.n_a = 10.0
    for _ in range(803):  # ends within a position cycle
        axis.cycle(axis.x_a, 0.0, False)
    before = axis.n_a
    axis.cycle(axis.x_a, 0.0, True)
    assert axis.M_a == 0.0  # the first cycle's voltage balances what the motor induces, and no current flows
    assert axis.n_a == before
    assert axis.unit.get("x_e") == pytest.approx(0.0, abs=1e-16)  # weights of the delay: an ulp of 0.1 m
    assert axis.unit.get("M_s") == pytest.approx(-DEFAULTS["K_p"] * before, rel=1e-12)
    axis.unit.close()


def test_a_motor_that_turns_gets_no_torque_from_the_release(archive: Archive) -> None:
    """No controller gain, so no torque at all; without the induced voltage the first cycle would give 10 N.m."""
    axis = Axis(archive, {"K_p": 0.0, "speed_window": 0}, n_a=150.0)
    for k in range(40):
        axis.cycle(axis.x_a, 0.0, not 5 <= k < 20)
        if k >= 20:
            assert axis.M_a == pytest.approx(0.0, abs=1e-11)  # 200 V balanced to an ulp; an ampere is 2 N.m
    axis.unit.close()


@pytest.mark.parametrize("cycles", range(1, 8))
def test_a_first_step_that_knows_nothing(archive: Archive, cycles: int) -> None:
    """An importer that makes its first steps with 0 on every input, the release included, ends up where one does that
    knows its inputs: the setpoints of the first position cycle still stand, and the axis has not moved."""
    speed = 3.0  # rad/s that the feedforward begins with, so that the first position instant matters
    torques = []
    for late in (0, cycles):
        axis = Axis(archive, {"T_dyn": 0.0})
        for k in range(400):
            row = k // 8
            given = 0.1 + row * 1e-3 * speed * DEFAULTS["I_P"], speed
            if k < late:
                axis.unit.enable(False)
                axis.unit.step(k * T_C, T_C, [0.0] * 6)
                assert axis.unit.get("M_a") == 0.0
                axis.k += 1
            else:
                axis.cycle(*given, True)
        torques.append((axis.n_a, axis.x_a))
        axis.unit.close()
    # What is left is the torque of those cycles, (j + 1)/8 of the speed each; it fades with the loop's slowest pole.
    assert torques[0][0] == pytest.approx(torques[1][0], rel=2e-2)
    assert torques[0][1] == pytest.approx(torques[1][1], abs=2e-6)
