"""Figures of a stop, against traces whose figures are known in closed form."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.optimize import brentq

from feedsim.analysis import Approach, Figure, PositioningTask, check, positioning_figures, tasks
from feedsim.files.trace import Trace
from feedsim.foundation.errors import InputError
from feedsim.motions import Circle, Dwell, Move
from feedsim.scenario import Positioning, Recording, load
from feedsim.simulation.nc import plan
from scenario_helpers import MACHINE, scenario

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
    found = values(positioning_figures(stop(sense), approach(sense)))
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
    found = values(positioning_figures(stop(creep=0.4e-6), approach()))
    assert found["ringing_frequency"] == pytest.approx(20.75, rel=2e-3)


def test_band_is_a_setting_and_wide_bands_are_never_left() -> None:
    assert values(positioning_figures(stop(), approach(), band=5e-6))["settling_time"] == 0
    narrow = values(positioning_figures(stop(), approach(), band=0.5e-6))["settling_time"]
    assert narrow > values(positioning_figures(stop(), approach(), band=1e-6))["settling_time"] + 50


def test_what_the_trace_does_not_show_is_nan_not_a_number() -> None:
    short = stop().between(0.0, END + 0.02)
    found = values(positioning_figures(short, approach()))
    assert math.isnan(found["settling_time"])  # still outside at the last sample
    assert math.isnan(found["ringing_frequency"])  # the window begins 30 ms after the end
    assert math.isnan(found["rest_torque"])  # 1 s after the end is not recorded
    assert str(positioning_figures(short, approach())["rest_torque"]) == "not determined"


def test_no_overshoot_is_zero_not_negative() -> None:
    trace = stop()
    from_below = Trace(trace.time, {"Z.x_a": TARGET - np.abs(damped(trace.time)) - 1e-7})
    found = values(positioning_figures(from_below, approach()))
    assert found["overshoot"] == 0
    # nothing of what is not recorded: torques, the tool point
    assert not [name for name in found if "torque" in name or name.startswith("tool.")]


def test_tool_point_is_reported_beside_the_scale() -> None:
    trace = stop()
    tool = {**trace.columns, "tcp.x_Z": TARGET + 1.5 * damped(trace.time)}
    found = values(positioning_figures(Trace(trace.time, tool), approach()))
    assert found["tool.overshoot"] == pytest.approx(1.5 * found["overshoot"], rel=1e-9)
    assert found["tool.settling_time"] > found["settling_time"]
    assert found["tool.ringing_frequency"] == pytest.approx(20.75, abs=5e-3)


def test_too_little_of_a_trace_is_refused() -> None:
    with pytest.raises(InputError, match=r"positioning needs Z\.x_a, which is not recorded; recorded: Z.M_a"):
        positioning_figures(stop().select(["Z.M_a"]), approach())
    with pytest.raises(InputError, match=r"needs the trace from 0\.2 to 1\.2 s .* recorded: 0 to 1 s"):
        positioning_figures(stop().between(0.0, 1.0), approach())
    with pytest.raises(InputError, match="axis Z does not move"):
        Approach("Z", START, END, UNTIL, TARGET, TARGET, None)


MOTIONS = (
    Move(by={"Z": 0.05}, feed=0.1),
    Dwell(duration=0.06),
    Move(by={"Z": 0.05}, feed=5 / 60),
    Dwell(duration=0.5),
    Move(by={"X": 0.1}, feed=0.1),
    Dwell(duration=0.1),
)


def test_task_is_the_axis_last_move_and_lasts_until_its_next_motion() -> None:
    motions = MOTIONS
    described = scenario(
        *motions, evaluate=(Positioning(axis="Z", band=2e-6), Positioning(axis="X"), Positioning(axis="Z"))
    )
    program = plan(described)
    first, x, again = tasks(described, program)
    assert [task.prefix for task in (first, x, again)] == ["Z", "X", "Z#2"]
    assert first.band == 2e-6  # type: ignore[union-attr]
    got: Approach = first.approach  # type: ignore[union-attr]
    move, dwell = program.segments[2:4]
    assert (got.start, got.end, got.until) == (move.start, move.end, program.duration)  # the move of X does not end it
    assert (got.origin, got.target) == (pytest.approx(0.15), pytest.approx(0.2))
    assert got.steady == move.geometry.steady  # type: ignore[union-attr]
    assert dwell.start < got.until
    check(described, program)


def test_motion_of_another_axis_is_seen_as_coupling_on_the_axis_at_rest() -> None:
    """X begins 4 ms after the stop of Z and pulls it 7 um over: that is what one wants to see."""
    described = scenario(
        Move(by={"Z": 0.05}, feed=0.1), Move(by={"X": 0.1}, feed=0.1), evaluate=(Positioning(axis="Z"),)
    )
    program = plan(described)
    z, x = program.segments
    assert x.start - z.end < 0.002
    t = program.time
    pulled = 7e-6 * ((t > x.start + 0.2) & (t < x.start + 0.201 + 1e-9))
    (task,) = tasks(described, program)
    figures = values(task.figures(Trace(t, {"Z.x_a": program.x_s["Z"] + pulled})))
    assert figures["overshoot"] == pytest.approx(7.0, abs=0.02)  # the spline overshoots by 12 nm
    assert figures["settling_time"] > 200


def test_motion_can_be_chosen() -> None:
    stops = (Positioning(axis="Z"), Positioning(axis="Z", motion=0), Positioning(axis="Z", motion=2))
    described = scenario(*MOTIONS, evaluate=stops)
    program = plan(described)
    last, first, same = tasks(described, program)
    assert [task.prefix for task in (last, first, same)] == ["Z", "Z#2", "Z#3"]
    assert isinstance(first, PositioningTask)
    assert first.approach.end == program.segments[0].end
    assert first.approach.until == program.segments[2].start
    assert same.approach == last.approach  # type: ignore[union-attr]
    with pytest.raises(ValidationError, match=r"axis X, which motions\.0 \(move\) does not move"):
        scenario(*MOTIONS, evaluate=(Positioning(axis="X", motion=0),))
    with pytest.raises(ValidationError, match=r"6 is no entry of motions \(entries: 0 to 5, counted from 0\)"):
        scenario(*MOTIONS, evaluate=(Positioning(axis="X", motion=6),))
    stays = Move(to={"Z": 0.1, "X": 0.9}, feed=0.1)
    described = scenario(stays, Dwell(duration=1), evaluate=(Positioning(axis="Z", motion=0),))
    with pytest.raises(InputError, match=r"evaluate\.0: positioning of axis Z: motions\.0 does not take it to another"):
        check(described, plan(described))


@pytest.mark.parametrize(
    ("motions", "then"),
    [
        ([Move(by={"Z": 0.05}, feed=0.1)], "the end of the program"),
        ([Move(by={"Z": 0.05}, feed=0.1), Dwell(duration=0.04)], "the end of the program"),
        (
            [Move(by={"Z": 0.05}, feed=0.1), Circle(plane=("X", "Z"), radius=0.01, feed=0.1), Dwell(duration=1)],
            r"the next motion of Z, motions\.1",
        ),
    ],
)
def test_rest_too_short_to_evaluate_is_refused_before_the_run(motions: list[Any], then: str) -> None:
    described = scenario(*motions, evaluate=(Positioning(axis="Z"),))
    wanted = (
        rf"^evaluate\.0: positioning of Z: only [0-9.]+ ms between the end of motions\.0 and {then}; at least 50 ms"
    )
    with pytest.raises(InputError, match=wanted):
        check(described, plan(described))
    enough = (motions[0], Dwell(duration=0.05), *motions[1:])
    described = scenario(*enough, evaluate=(Positioning(axis="Z"),))
    check(described, plan(described))


def test_figures_of_a_rest_too_short_are_nan() -> None:
    """Cut 30 ms after the end: the first crest, 11.6 ms behind it, is there by luck."""
    for part, made in ((stop().between(0.0, END + 0.03), approach()), (stop(), replace(approach(), until=END + 0.03))):
        found = values(positioning_figures(part, made))
        assert all(math.isnan(found[name]) for name in ("overshoot", "settling_time", "ringing_frequency"))
        assert found["duration"] == pytest.approx(1.0)
        assert found["peak_torque"] == 20.0


def test_passing_through_the_band_is_not_settling() -> None:
    """Cut while the swing passes through the band for the third time: it leaves it again."""
    crossing = 3 * math.pi / OMEGA
    part = stop().between(0.0, END + crossing)
    assert abs(part["Z.x_a"][-1] - TARGET) < 1e-6
    found = values(positioning_figures(part, approach()))
    assert math.isnan(found["settling_time"])
    assert found["overshoot"] > 3  # 72 ms are enough for that
    settled = values(positioning_figures(stop(), approach()))["settling_time"]
    whole = stop().between(0.0, END + settled / 1e3 + 0.051)
    assert values(positioning_figures(whole, approach()))["settling_time"] == settled


def test_overshoot_that_still_grows_is_not_determined() -> None:
    """An axis that creeps past its target, or up to it: cut off 60 ms after the motion, its largest distance is no
    overshoot unless it is at the target."""
    for level, known in ((-30e-6, False), (30e-6, False), (-0.5e-6, True)):
        t = np.arange(0.0, END + 0.0605, 1e-3)
        x = np.where(t < END, 0.0, TARGET + level * (1 if level < 0 else t / t[-1]))
        x = np.where(t < END, x, x + 1e-8 * (t - END))
        found = values(positioning_figures(Trace(t, {"Z.x_a": x}), approach()))["overshoot"]
        assert math.isfinite(found) == known, level


def test_torque_of_a_plateau_that_has_not_settled_is_not_determined() -> None:
    for length, known in ((0.12, False), (0.13, True)):
        steady = (0.1, 0.1 + length)
        found = values(positioning_figures(stop(), replace(approach(), steady=steady)))["plateau_torque"]
        assert math.isfinite(found) == known


def test_every_evaluation_that_is_not_possible_is_named_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "s.yaml"
    lines = [
        "name: s", f"machine: {MACHINE}", "motions:",
        "  - {kind: circle, plane: [X, Z], radius: 9 mm, feed: 1 m/min, turns: 3}",
        "  - {kind: move, by: {Z: 1 mm}, feed: 1 m/min}", "evaluate:", "  - {kind: positioning, axis: X}",
        "  - {kind: circle}", "  - {kind: positioning, axis: Z, motion: 0}",
    ]  # fmt: skip
    file.write_text("\n".join(lines), encoding="utf-8")
    described = load(file)
    with pytest.raises(InputError) as caught:
        check(described, plan(described))
    first, second = caught.value.problems
    assert first == f"{file}:7: evaluate.0: positioning of axis X: no motion takes it to another position"
    assert second.startswith(f"{file}:9: evaluate.2: positioning of axis Z: motions.0 does not take it")
    described = load(file, ["evaluate=[{kind: positioning, axis: Z}]"])
    with pytest.raises(
        InputError, match=r"^--set evaluate=\[.*\]: evaluate\.0: positioning of Z: only 0?\.?[0-9.]+ ms"
    ):
        check(described, plan(described))


def test_what_cannot_be_evaluated_is_said_before_the_simulation() -> None:
    circle = Circle(plane=("X", "Z"), radius=0.015, feed=0.05, turns=1)
    described = scenario(circle, evaluate=(Positioning(axis="X"),))
    with pytest.raises(InputError, match="positioning of axis X: no motion takes it to another position"):
        check(described, plan(described))
    described = scenario(
        Move(by={"Z": 0.1}, feed=0.1),
        Dwell(duration=0.1),
        evaluate=(Positioning(axis="Z"),),
        recording=Recording(interval=125e-6, variables=("*.M_a", "X.*")),
    )
    with pytest.raises(InputError, match=r"evaluation of Z needs Z\.x_a, which recording\.variables leaves out"):
        check(described, plan(described))
