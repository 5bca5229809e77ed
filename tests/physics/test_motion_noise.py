"""Noise of the motion in the intervals, and what records of general motion must not be believed to tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from feedsim.estimation.identify import Options, identify
from feedsim.estimation.identify.motion import RecordTorque
from feedsim.estimation.identify.output_error import dynamic
from feedsim.estimation.identify.record import Record
from feedsim.estimation.identify.result import Dynamic, Estimate
from feedsim.estimation.identify.search import Solution
from feedsim.estimation.identify.uncertainty import reversals, turnover_rows
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.simulation.cosim.friction_law import FrictionLaw
from identify_records import constant_speeds, noisy

pytestmark = pytest.mark.extensive

Floats = NDArray[np.float64]

I_P = 0.02 / (2 * np.pi)
J = 0.0164  # kg.m2
INERTIA = Estimate("J", J, "kg.m2", "inertia", status="given")
TRUE = {
    "sigma_0": 300.0, "sigma_1": 0.8, "sigma_2": 0.006, "F_C": 1.6, "F_S": 1.6, "v_s": 0.6, "beta": 1.0, "F_log": 0.0,
    "v_log": 3.0, "asymmetry": 0.0, "W": 0.04, "gamma": 0.35,
}  # fmt: skip
FINE = 16  # steps of the truth per row


def record(law: FrictionLaw, angle: Floats, interval: float, true: dict[str, float], step: float = 0.0) -> Record:
    """Log of a motion given FINE times as densely; position rounded to `step` [m], torque exact."""
    h = interval / FINE
    speed = np.gradient(angle, h)
    torque = J * np.gradient(speed, h) + law(true, speed, h)
    seen = angle[::FINE]
    if step:
        seen = np.round(seen * I_P / step) * step / I_P
    time: Floats = np.arange(len(seen)) * interval
    return Record("log", time, torque[::FINE], angle=seen)


def sines() -> Floats:
    """5, 20, 100 and 200 um [rad], faded, at 500 Hz."""
    h = 2e-3 / FINE
    pieces = [np.zeros(round(0.3 / h))]
    for amplitude, frequency, periods in ((200e-6, 1, 5), (100e-6, 2, 6), (20e-6, 5, 12), (5e-6, 10, 24)):
        t: Floats = np.arange(0, periods / frequency, h)
        fade = np.clip(np.minimum(t, t[-1] - t) * frequency, 0, 1)
        pieces += [amplitude / I_P * fade**3 * (10 - 15 * fade + 6 * fade**2) * np.sin(2 * np.pi * frequency * t)]
        pieces += [np.zeros(round(0.3 / h))]
    angle = np.concatenate(pieces)
    return angle[: (len(angle) - 1) // FINE * FINE + 1]


def strokes(interval: float, count: int) -> Floats:
    """Strokes there and back at 60 rad/s [rad]: 0.3 s of smooth acceleration, 0.3 s at speed."""
    h = interval / FINE
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0, 1, round(0.3 / h)))
    one = 60 * np.concatenate([ramp, np.ones(round(0.3 / h)), ramp[::-1]])
    speed = np.concatenate([one * (-1) ** k for k in range(count)])
    angle = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * h)])
    return angle[: (len(angle) - 1) // FINE * FINE + 1]


def asked(log: Record) -> Record:
    """With the setpoint: steps of 1 um hide where a small sine begins."""
    return replace(log, setpoint=sines()[::FINE])


def fitted(law: FrictionLaw, log: Record, delay: float | None = 0.0) -> Dynamic:
    return dynamic([log], law, J=INERTIA, delay=delay, I_P=I_P, hold={"F_log": 0.0, "sigma_2": 0.006})


def test_steps_of_the_position_widen_the_intervals(law: FrictionLaw) -> None:
    exact, rough = (fitted(law, record(law, sines(), 2e-3, TRUE, step)) for step in (0.0, 1e-7))
    for name in ("sigma_0", "gamma", "sigma_1"):
        found = rough.estimates[name]
        assert found.sigma > 2 * exact.estimates[name].sigma, name
        assert abs(found.value - TRUE[name]) < 4 * found.sigma, name  # a bias of the smoothing is left
    assert "motion-too-coarse" in [finding.code for finding in rough.warnings]
    assert "motion-too-coarse" not in [finding.code for finding in exact.warnings]


def test_half_a_row_late_is_taken_for_damping(law: FrictionLaw) -> None:
    """What a trace's speed must not be: the difference of two positions, half a row behind the motion."""
    log = record(law, sines(), 2e-3, TRUE)
    assert log.angle is not None
    behind = np.concatenate([[0.0], np.diff(log.angle)]) / log.interval
    late = Record("log", log.time, log.torque, speed=behind)
    assert abs(fitted(law, log).estimates["sigma_1"].value / 0.8 - 1) < 0.01
    assert 0.15 < fitted(law, late).estimates["sigma_1"].value / 0.8 - 1 < 0.3


def test_strokes_invent_no_refinements(law: FrictionLaw) -> None:
    """Coulomb and viscous friction with bristles that turn over in two rows: nothing else may be found."""
    true = TRUE | {"W": 0.0, "gamma": 1.0, "sigma_0": 3e5, "sigma_1": 5.0}
    log = record(law, strokes(1e-3, 10), 1e-3, true, 5e-8)
    found = dynamic([log], law, J=INERTIA, delay=0.0, I_P=I_P)
    for name in ("F_log", "asymmetry", "W", "sigma_1", "v_s"):
        assert found.estimates[name].status != "estimated", name
    assert found.estimates["F_C"].value == pytest.approx(1.6, rel=0.01)
    assert found.estimates["sigma_2"].value == pytest.approx(0.006, rel=0.02)


def test_rows_of_a_reversal_are_counted(law: FrictionLaw) -> None:
    """From a reversal, at which two cosine ramps meet at rest, until twice the deflection is travelled."""
    true = TRUE | {"W": 0.0, "gamma": 1.0, "sigma_0": 3e4}
    model = RecordTorque(record(law, strokes(1e-3, 4), 1e-3, true), law)
    solution = Solution(true, np.zeros((1, 2)), None)  # type: ignore[arg-type]
    assert reversals([model]) == 3
    way = 2 * 1.6 / 3e4
    # around the reversal, two cosine ramps meet at rest: n = 60 (pi/0.3)^2 t^2/4, travelled 60 (pi/0.3)^2 t^3/12
    expected = (12 * way / (60 * (np.pi / 0.3) ** 2)) ** (1 / 3) / 1e-3
    assert turnover_rows([model], solution) == pytest.approx(
        expected, abs=2
    )  # rows are whole, the start is one of them


@pytest.mark.parametrize("step", [1e-6, 3e-7])
def test_the_intervals_hold_what_steps_of_the_position_and_their_smoothing_do(law: FrictionLaw, step: float) -> None:
    """Damping and delay of a log of positions alone, which stand for each other in small sines."""
    found = fitted(law, asked(record(law, sines(), 2e-3, TRUE, step)), None)
    for name, true in (("sigma_0", 300.0), ("sigma_1", 0.8), ("W", 0.04), ("gamma", 0.35), ("delay", 0.0)):
        each = found.estimates[name]
        assert each.status == "undetermined" or abs(each.value - true) < NORMAL_95 * each.sigma, name
    assert "motion-too-coarse" in [finding.code for finding in found.warnings]


def test_strokes_alone_tell_the_curve_as_their_plateaus_do(law: FrictionLaw) -> None:
    """The plateaus' curve goes into the fit of the reversals between them."""
    true = {**TRUE, "F_S": 2.1, "F_log": 0.4, "M_0": 0.0}
    log = noisy(constant_speeds(true, np.geomspace(10, 10000, 9) / 60e3 / I_P, ringing=0.0, inertia=J), 0.01, 3)
    found = identify([log], law, Options(axis="Z", I_P=I_P, J=INERTIA))
    for name in ("F_C", "F_S", "v_s", "F_log", "sigma_2", "sigma_0", "sigma_1", "W", "gamma"):
        each = found.estimates[name]
        assert each.status == "estimated", name
        assert abs(each.value - true[name]) < 3 * each.sigma, name
    assert found.estimates["F_C"].value == pytest.approx(1.6, rel=0.01)
    assert abs(found.estimates["delay"].value) < 1e-4


def test_sines_alone_offer_no_curve_that_they_leave_open(law: FrictionLaw) -> None:
    true = {**TRUE, "F_S": 2.1, "F_log": 0.4}
    found = dynamic([asked(record(law, sines(), 2e-3, true, 3e-7))], law, J=INERTIA, delay=0.0, I_P=I_P)
    for name in ("F_C", "F_S", "v_s", "F_log", "sigma_2"):
        assert found.estimates[name].status == "undetermined", name
    assert "curve-extrapolated" in [finding.code for finding in found.warnings]
    assert found.estimates["sigma_0"].value == pytest.approx(300, abs=NORMAL_95 * found.estimates["sigma_0"].sigma)


def test_a_torque_rows_ahead_of_its_motion_is_no_delay(law: FrictionLaw) -> None:
    log = record(law, sines(), 2e-3, TRUE)
    early = Record("early", log.time, np.roll(log.torque, -2), angle=log.angle)
    delay = fitted(law, early, None).estimates["delay"]
    assert (delay.status, delay.value) == ("undetermined", 0.0)
    assert "no control does" in delay.reason


@pytest.mark.parametrize(("count", "told"), [(2, False), (8, True)])
def test_few_reversals_tell_no_delay(law: FrictionLaw, count: int, told: bool) -> None:
    log = record(law, strokes(2e-3, count), 2e-3, TRUE | {"W": 0.0, "gamma": 1.0})
    delay = fitted(law, log, None).estimates["delay"]
    assert (delay.status == "estimated") is told
    if told:
        assert delay.value == pytest.approx(0.0, abs=1e-4)
    else:
        assert delay.value == 0.0
        assert "1 reversal only" in delay.reason
