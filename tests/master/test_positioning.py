"""Figures of a stop, against traces whose figures are known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from feedsim.analysis import Approach, Figure, check, positioning, tasks
from feedsim.errors import InputError
from feedsim.nc import plan
from feedsim.scenario import Circle, Dwell, Move, Positioning, Recording
from feedsim.trace import Trace
from scenario_helpers import scenario

START, END, UNTIL = 0.2, 1.2, 3.0
ORIGIN, TARGET = 0.1, 0.2
AMPLITUDE, DECAY, OMEGA = 4e-6, 8.0, 2 * math.pi * 20.75
STEP = 250e-6


def damped(time: NDArray[np.float64], creep: float = 0.0) -> NDArray[np.float64]:
    """Deviation from the target [m]: approach from below until END, then A exp(-d t) sin(w t), and a slow creep."""
    after = time - END
    swing = AMPLITUDE * np.exp(-DECAY * after) * np.sin(OMEGA * after) + creep * np.exp(-after)
    before = (TARGET - ORIGIN) * np.clip(after / (END - START), -1, 0) + creep
    return np.where(after >= 0, swing, before)


def approach(sense: int = 1) -> Approach:
    ends = (ORIGIN, TARGET) if sense > 0 else (TARGET, ORIGIN)
    return Approach("Z", START, END, UNTIL, *ends, steady=(0.3, 1.1))


def stop(sense: int = 1, creep: float = 0.0) -> Trace:
    time = np.asarray(np.arange(round(UNTIL / STEP) + 1) * STEP, dtype=np.float64)
    deviation = damped(time, creep)
    end = TARGET if sense > 0 else ORIGIN
    speed = np.where(time >= END, np.gradient(deviation, time), 0.0) / 0.00318
    torque = sense * np.select(
        [time < START, time < 0.25, time < 0.619, time < 1.021, time < END], [0.0, 20.0, 3.0, 2.5, -15.0], 0.8
    )
    friction = sense * (0.5 + 0.25 * (time - END))
    return Trace(
        time,
        {"Z.x_a": end + sense * deviation, "Z.n_a": sense * speed, "Z.M_a": torque, "Z.M_fr": friction},
        {"Z.x_a": "m", "Z.n_a": "rad/s", "Z.M_a": "N.m", "Z.M_fr": "N.m"},
    )


def values(figures: dict[str, Figure]) -> dict[str, float]:
    return {name: figure.value for name, figure in figures.items()}


@pytest.mark.parametrize("sense", [1, -1])
def test_damped_sine(sense: int) -> None:
    found = values(positioning(stop(sense), approach(sense)))
    peak = math.atan(OMEGA / DECAY) / OMEGA
    # sampled every 250 us, the peak is missed by up to A (w h/2)^2/2 = 5e-10 m
    expected = AMPLITUDE * math.exp(-DECAY * peak) * math.sin(OMEGA * peak)
    assert found["overshoot"] == pytest.approx(expected * 1e6, abs=6e-4)

    def outside(t: float) -> float:
        return AMPLITUDE * math.exp(-DECAY * t) * abs(math.sin(OMEGA * t)) - 1e-6

    # the last half wave whose crest is above 1 um: find it on its falling side
    crests = [(k * math.pi + math.atan(OMEGA / DECAY)) / OMEGA for k in range(40)]
    last = max(t for t in crests if outside(t) > 0)
    settled = brentq(outside, last, math.ceil(last * OMEGA / math.pi) * math.pi / OMEGA)
    # linear interpolation over 250 us: x'' h^2/8 over x' is some microseconds at most
    assert found["settling_time"] == pytest.approx(settled * 1e3, abs=5e-3)
    assert found["duration"] == pytest.approx(1.0)
    # the speed of a damped sine crosses zero once per period exactly
    assert found["ringing_frequency"] == pytest.approx(20.75, abs=2e-3)
    assert found["peak_torque"] == 20.0
    assert found["rest_torque"] == pytest.approx(sense * 0.75, abs=1e-12)
    # 40 to 90 % of 0.3 to 1.1 s is 0.62 to 1.02 s
    assert found["plateau_torque"] == pytest.approx(sense * 2.5, abs=1e-12)


def test_ringing_does_not_mind_a_slow_creep() -> None:
    """Crossings of the position would: with 0.4 um of creep the first ones come late."""
    found = values(positioning(stop(creep=0.4e-6), approach()))
    assert found["ringing_frequency"] == pytest.approx(20.75, rel=2e-3)


def test_band_is_a_setting_and_wide_bands_are_never_left() -> None:
    assert values(positioning(stop(), approach(), band=5e-6))["settling_time"] == 0
    narrow = values(positioning(stop(), approach(), band=0.5e-6))["settling_time"]
    assert narrow > values(positioning(stop(), approach(), band=1e-6))["settling_time"] + 50


def test_what_the_trace_does_not_show_is_nan_not_a_number() -> None:
    short = stop().between(0.0, END + 0.02)
    found = values(positioning(short, approach()))
    assert math.isnan(found["settling_time"])  # still outside at the last sample
    assert math.isnan(found["ringing_frequency"])  # the window begins 30 ms after the end
    assert math.isnan(found["rest_torque"])  # 1 s after the end is not recorded
    assert str(positioning(short, approach())["rest_torque"]) == "not determined"


def test_no_overshoot_is_zero_not_negative() -> None:
    trace = stop()
    from_below = Trace(trace.time, {"Z.x_a": TARGET - np.abs(damped(trace.time)) - 1e-7})
    found = values(positioning(from_below, approach()))
    assert found["overshoot"] == 0
    assert set(found) == {"duration", "overshoot", "settling_time"} | {"ringing_frequency"}


def test_tool_point_is_reported_beside_the_scale() -> None:
    trace = stop()
    tool = {**trace.columns, "tcp.x_Z": TARGET + 1.5 * damped(trace.time)}
    found = values(positioning(Trace(trace.time, tool), approach()))
    assert found["tool.overshoot"] == pytest.approx(1.5 * found["overshoot"], rel=1e-9)
    assert found["tool.settling_time"] > found["settling_time"]
    assert found["tool.ringing_frequency"] == pytest.approx(20.75, abs=5e-3)


def test_too_little_of_a_trace_is_refused() -> None:
    with pytest.raises(InputError, match=r"positioning needs Z\.x_a, which is not recorded; recorded: Z.M_a"):
        positioning(stop().select(["Z.M_a"]), approach())
    with pytest.raises(InputError, match=r"needs the trace from 0\.2 to 1\.2 s .* recorded: 0 to 1 s"):
        positioning(stop().between(0.0, 1.0), approach())
    with pytest.raises(InputError, match="axis Z does not move"):
        Approach("Z", START, END, UNTIL, TARGET, TARGET, None)


def test_task_is_the_axis_last_move_and_lasts_until_another_motion() -> None:
    motions = [
        Move(by={"Z": 0.05}, feed=0.1),
        Move(by={"Z": 0.05}, feed=5 / 60),
        Dwell(duration=0.5),
        Move(by={"X": 0.1}, feed=0.1),
    ]
    described = scenario(
        *motions, evaluate=(Positioning(axis="Z", band=2e-6), Positioning(axis="X"), Positioning(axis="Z"))
    )
    program = plan(described)
    first, x, again = tasks(described, program)
    assert [task.prefix for task in (first, x, again)] == ["Z", "X", "Z#2"]
    assert first.band == 2e-6  # type: ignore[union-attr]
    got: Approach = first.approach  # type: ignore[union-attr]
    move, dwell, after = program.segments[1:]
    assert (got.start, got.end, got.until) == (move.start, move.end, after.start)
    assert (got.origin, got.target) == (pytest.approx(0.15), pytest.approx(0.2))
    assert got.steady == move.geometry.steady  # type: ignore[union-attr]
    assert dwell.start < got.until


def test_what_cannot_be_evaluated_is_said_before_the_simulation() -> None:
    circle = Circle(plane=("X", "Z"), radius=0.015, feed=0.05, turns=1)
    described = scenario(circle, evaluate=(Positioning(axis="X"),))
    with pytest.raises(InputError, match="positioning of axis X: no motion takes it to another position"):
        check(described, plan(described))
    described = scenario(
        Move(by={"Z": 0.1}, feed=0.1),
        evaluate=(Positioning(axis="Z"),),
        recording=Recording(interval=125e-6, variables=("*.M_a", "X.*")),
    )
    with pytest.raises(InputError, match=r"evaluation of Z needs Z\.x_a, which recording\.variables leaves out"):
        check(described, plan(described))
