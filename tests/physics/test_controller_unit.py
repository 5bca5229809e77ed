"""controller.fmu from outside: against an independent sampled model, against closed forms, and as an FMI unit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from controller_reference import DEFAULTS
from controller_unit import COLUMNS, FLAGS, INPUTS, Archive, Instance, compare, random_signals
from fmpy.fmi1 import FMICallException

T_C = DEFAULTS["T_c"]
NO_LIMITS = {"M_max": 1e6, "u_max": 1e6}
NEUTRAL_SPEED = {"speed_integrator": 0, "reference_model": 0}
FOUR_FILTERS = {
    "filter_1.type": 1, "filter_1.f": 455, "filter_1.D_num": 0.1, "filter_1.D_den": 1.0,
    "filter_2.type": 2, "filter_2.f": 1500, "filter_2.D_den": 0.7,
    "filter_3.type": 1, "filter_3.f": 800, "filter_3.D_num": 0.0, "filter_3.D_den": 0.5,
    "filter_4.type": 2, "filter_4.f": 3900, "filter_4.D_den": 1.3,
}  # fmt: skip
SALIENT = {"L_d": 0.003, "L_q": 0.008, "R": 0.9, "p": 4, "K_t": 1.6}

OPTIONS: dict[str, Mapping[str, float]] = {
    "default": {},
    "held": {"ramp_speed_setpoint": 0},
    "symmetry lag": {"symmetry_lag": 1},
    "symmetry lag, held": {"symmetry_lag": 1, "ramp_speed_setpoint": 0},
    "symmetry lag without matching": {"symmetry_lag": 1, "T_dyn": 0},
    "symmetry lag of 0": {"symmetry_lag": 1, "T_sym": 0},
    "no delays": {"T_dyn": 0, "T_sym": 0},
    "delay below a cycle": {"T_dyn": 0.0003, "T_sym": 0.0004},
    "whole delays": {"T_dyn": 0.001, "T_sym": 0.003},
    "delay of exactly a cycle by both": {"T_dyn": 0.0006, "T_sym": 0.0004},
    "long delays": {"T_dyn": 0.0123, "T_sym": 0.0217},
    "half feedforward": {"k_ffw": 0.5},
    "no integrator": {"speed_integrator": 0},
    "no reference model": {"reference_model": 0},
    "P speed controller": NEUTRAL_SPEED,
    "reference model with dead time": {"T_ref": 0.00041},
    "reference model with whole dead time": {"T_ref": 0.0005},
    "no reference model, dead time ignored": {"reference_model": 0, "T_ref": 0.00041},
    "undamped reference model": {"D": 0},
    "no filter": {"filter_1.type": 0},
    "low-pass alone": {"filter_1.type": 0, "filter_3.type": 2},
    "four filters": FOUR_FILTERS,
    "ideal current loop": {"ideal_current_loop": 1},
    "ideal current loop, no filter": {"ideal_current_loop": 1, "filter_1.type": 0},
    "salient motor": SALIENT,
    "salient motor, four filters, lag, held": {**SALIENT, **FOUR_FILTERS, "symmetry_lag": 1, "ramp_speed_setpoint": 0},
    "no resistance": {"R": 0},
    "one cycle for all": {"T_c": 1e-3, "T_pos": 1e-3, "filter_1.type": 0, "current.K_p": 2.0},
    "speed from the position": {"speed_window": 2},
    "speed from the position over more than a position cycle": {"speed_window": 11},
    "other cycles": {"T_c": 62.5e-6, "T_pos": 2e-3},
    "torque limit": {"M_max": 15},
    "voltage limit": {"M_max": 1e6, "u_max": 50},
    "both limits, salient motor": {**SALIENT, "M_max": 15, "u_max": 40},
    "limit without integrator": {"M_max": 15, "speed_integrator": 0},
    "limit, ideal current loop": {"M_max": 15, "ideal_current_loop": 1},
    "limits with fast integrators": {"M_max": 15, "T_n": 5e-5, "u_max": 40, "current.T_n": 1e-4},
    "no torque at all": {"M_max": 0},
}


@pytest.fixture(scope="module")
def archive(fmus: Path) -> Iterator[Archive]:
    opened = Archive(fmus / "controller.fmu")
    yield opened
    opened.close()


def assert_same(seen: np.ndarray, expected: np.ndarray, tolerance: float) -> None:
    """Every column within `tolerance` of its own largest value."""
    assert np.all(np.isfinite(expected))
    for column, name in enumerate(COLUMNS):
        size = np.max(np.abs(expected[:, column]))
        worst = np.max(np.abs(seen[:, column] - expected[:, column]))
        assert worst <= tolerance * size, f"{name}: off by {worst:g} at a size of {size:g}"


@pytest.mark.parametrize("name", OPTIONS)
def test_agrees_with_the_reference(archive: Archive, name: str) -> None:
    parameters = {**(NO_LIMITS if "limit" not in name and "torque" not in name else {}), **OPTIONS[name]}
    seed = 100 + list(OPTIONS).index(name)
    seen, expected = compare(archive, parameters, random_signals(seed), [Fraction(1)] * 500)
    # Both are sums of some hundred terms good to 1e-16 each; x_e, a difference of positions of 0.1 m that is 1e-5 m
    # large, is good to 1e-12, and dM_a/dt to 1e-13 times M_a/(M_a(t_k+1) - M_a(t_k)). 1e-10 leaves room for that alone.
    assert_same(seen, expected, 1e-10)
    for flag, limit in zip(FLAGS, ("M_max", "u_max"), strict=True):
        active = expected[:, COLUMNS.index(flag)].mean()
        is_on = parameters.get(limit, 1e6) < 1e3 and not (limit == "u_max" and parameters.get("ideal_current_loop"))
        assert active > 0.05 if is_on else active == 0, f"the limit {limit} is active for {active:.0%} of the run"


STEPS = {
    "T_c": [Fraction(1)] * 240,
    "3 T_c": [Fraction(3)] * 80,
    "0.7 T_c": [Fraction(7, 10)] * 342,
    "10 ms": [Fraction(80)] * 3,
    "1/16 T_c": [Fraction(1, 16)] * 1600,
    "mixed": [Fraction(n, 9) for n in (1, 30, 5, 9, 9, 7, 100, 2, 3, 4, 81)] * 6,
}


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("start_time", [0.0, 1000.0])
def test_any_step_size(archive: Archive, steps: str, start_time: float) -> None:
    """Wherever the communication points lie, the same drive works at the same instants."""
    seen, expected = compare(archive, NO_LIMITS, random_signals(7), STEPS[steps], start_time=start_time)
    # At 1000 s the clock itself has steps of 1.1e-13 s: 1e-9 of a cycle, so that much of a cycle's change of M_a.
    assert_same(seen, expected, 1e-10 if start_time == 0 else 1e-8)


@pytest.mark.parametrize("steps", STEPS)
def test_linear_inputs_make_the_step_size_irrelevant(archive: Archive, steps: str) -> None:
    """Inputs that are linear in time, given by value and slope: M_a is one function of time, whatever the steps."""
    signals = random_signals(8, waves=False)
    fine, _ = compare(archive, NO_LIMITS, signals, [Fraction(1)] * 240)
    seen, _ = compare(archive, NO_LIMITS, signals, STEPS[steps])
    at = np.cumsum([float(step) for step in STEPS[steps]])
    inside = at <= 240
    M_a = np.interp(at[inside], np.arange(241), np.concatenate(([0.0], fine[:, 0])))
    # rounding of t_k - t, 1e-12 of a cycle, and of the sums
    np.testing.assert_allclose(seen[inside, 0], M_a, rtol=0, atol=1e-10 * np.max(np.abs(M_a)))


def test_held_inputs(archive: Archive) -> None:
    """Without slopes the value of the communication point holds over the step."""
    seen, expected = compare(archive, NO_LIMITS, random_signals(9), [Fraction(5, 2)] * 100, with_slopes=False)
    assert_same(seen, expected, 1e-10)


def test_a_clock_that_drifts_does_not_shift_the_instants(archive: Archive) -> None:
    """Ten million sums of 125 us end 1.6e-3 cycles late. M_a then is what it was on the grid, not a cycle older."""
    rng = np.random.default_rng(10)
    rows = [[0.1, 20.0, 0.1 + x, 20.0 + n, 0.0, 0.0] for x, n in rng.uniform(-1, 1, (60, 2)) * [1e-5, 3.0]]
    torque: list[list[float]] = []
    for late in (0.0, 5e-3 * T_C, -5e-3 * T_C):
        unit = archive.instance()
        unit.start(NO_LIMITS)
        t, series = 0.0, []
        for k, row in enumerate(rows):
            h = T_C + (late if k == 0 else 0.0)
            unit.step(t, h, row)
            t += h
            series.append(unit.get("M_a"))
        unit.close()
        torque.append(series)
    assert torque[1] == torque[0]
    # Early points see M_a half a percent of a cycle before its end.
    step = np.max(np.abs(np.diff(torque[0])))
    assert np.max(np.abs(np.subtract(torque[2], torque[0]))) <= 5e-3 * step * (1 + 1e-6)


# K_v = k_ffw = 0 and an excitation n_add = RATE t make n_s tell the time of the instant that was worked last.
RATE = 1000.0
CLOCK = {"K_v": 0, "k_ffw": 0, "filter_1.type": 0, "M_max": 1e9, "u_max": 1e9}


@pytest.mark.parametrize("T_c", [T_C, 2e-3, 1.0])
@pytest.mark.parametrize("h", [1.25e-6, 1e-6, 1e-7, 1e-5])
def test_an_instant_at_the_start_of_a_short_step_is_worked_in_it(archive: Archive, T_c: float, h: float) -> None:
    unit = archive.instance()
    unit.start({**CLOCK, "T_c": T_c, "T_pos": T_c})
    for k in range(5):  # held inputs: the value of t = 0 is that of the first step
        unit.step(k * h, h, [0.0, 0.0, 0.0, 0.0, 7.0 + k, 0.0])
        assert unit.get("n_s") == 7.0
    unit.close()


@pytest.mark.parametrize("start_time", [0.0, 1000.0])
@pytest.mark.parametrize("drift", [0.0, 1e-5, 1e-3, -1e-3])
@pytest.mark.parametrize("parts", [1, 4, 16, 100, 0.3, 0.7])
def test_no_instant_is_skipped_or_worked_twice(archive: Archive, parts: float, drift: float, start_time: float) -> None:
    """Steps of T_c/parts that drift off the grid: each instant is worked once, at its own t_k, in the step it lies in
    or, where it lies less than a hundredth of the step ahead of its end, in the next."""
    h = T_C / parts * (1 + drift)
    unit = archive.instance()
    unit.start({**CLOCK, "T_pos": T_C}, time=start_time)
    t, last = start_time, -1
    # Rounding of the clock, in cycles; 1000 s are known to 1e-13 s, 1e-9 cycles, and summed 2000 times.
    rounding = 1e-9 if start_time == 0 else 1e-6
    for _ in range(2000):
        since = t - start_time
        unit.step(t, h, [0.0, 0.0, 0.0, 0.0, RATE * since, 0.0], [0.0, 0.0, 0.0, 0.0, RATE, 0.0])
        t += h
        shown = unit.get("n_s") / (RATE * T_C)
        instant = round(shown)
        assert shown == pytest.approx(instant, abs=rounding)  # worked with its own time, wherever the step began
        end = (t - start_time) / T_C
        step = min(h / T_C, 1.0)
        assert end - 1 - rounding <= instant + 0.01 * step
        assert instant + 0.01 * step <= end + rounding
        assert instant - last <= math.ceil(h / T_C) + 1
        if h <= T_C:
            assert instant - last in (0, 1)
        last = instant
    unit.close()


def test_torque_moves_over_a_short_step_at_the_start_of_a_cycle(archive: Archive) -> None:
    """It is linear from the cycle's first moment on; and the rest of the cycle ends where it would have ended."""
    signals = random_signals(21)
    ends = []
    for h in (T_C, 1e-7):
        unit = archive.instance()
        unit.start(NO_LIMITS)
        for k in range(50):
            unit.step(k * T_C, T_C, signals.value(k * T_C))
        before = unit.get("M_a")
        unit.step(50 * T_C, h, signals.value(50 * T_C))
        (slope,) = unit.fmu.getRealOutputDerivatives(unit.references(["M_a"]), [1])
        assert slope != 0
        # 50 T_c and h are rounded to 1e-18 s: 1e-11 of the short step
        assert unit.get("M_a") - before == pytest.approx(slope * h, rel=1e-9)
        if h < T_C:
            unit.step(50 * T_C + h, T_C - h, signals.value(0.123))  # too late for these
        ends.append(unit.get("M_a"))
        unit.close()
    assert ends[0] == ends[1]


@pytest.mark.parametrize("h", [2e5, 1e300])
def test_an_enormous_step_is_refused(archive: Archive, h: float) -> None:
    unit = archive.instance()
    unit.start({})
    with pytest.raises(FMICallException):
        unit.step(0.0, h, [0.0] * 6)
    (text,) = unit.messages
    assert "sample instants, T_c = 0.000125 s apart; allowed are at most 1e+09, which is a step of 125000 s" in text
    unit.close()


def test_at_the_start(archive: Archive) -> None:
    unit = archive.instance()
    unit.start({}, {"x_s": 0.3, "x_a": 0.25, "n_a": 5.0, "n_add": 3.0})
    # x_e is the difference as rounded; everything else is at rest until the first instant has been worked.
    assert dict(zip(COLUMNS, unit.outputs(), strict=True)) == {**dict.fromkeys(COLUMNS, 0.0), "x_e": 0.3 - 0.25}
    unit.close()


def test_the_past_is_that_of_the_first_instant(archive: Archive) -> None:
    """A drive that stands at its setpoint stays at rest, even where inputs are set as late as before the first step."""
    unit = archive.instance()
    unit.start({"T_dyn": 0.0123, "T_sym": 0.0217})
    for k in range(400):
        unit.step(k * T_C, T_C, [0.625, 0.0, 0.625, 0.0, 0.0, 0.0])
        # 0.625 and the weights' sum are good to an ulp or two: K_v/I_P K_p 2e-16 m is 3e-11 N.m
        assert abs(unit.get("M_a")) < 1e-10
    unit.close()


@pytest.mark.parametrize("start_time", [0.0, 1000.0])
def test_state_replays_bit_identically(archive: Archive, start_time: float) -> None:
    signals = random_signals(11)
    parameters = {**FOUR_FILTERS, "symmetry_lag": 1, "T_ref": 0.00041, "M_max": 15, "u_max": 40}
    h = 0.7 * T_C

    def run(unit: Instance, first: int, count: int) -> list[list[float]]:
        rows = []
        for k in range(first, first + count):
            unit.step(start_time + k * h, h, signals.value(k * h), signals.derivative(k * h))
            rows.append(unit.outputs())
        return rows

    unit, other = archive.instance(), archive.instance()
    unit.start(parameters, time=start_time)
    other.start(parameters, time=start_time)
    run(unit, 0, 101)
    state = unit.fmu.getFMUState()
    data = unit.fmu.serializeFMUState(state)
    first = run(unit, 101, 150)
    unit.fmu.setFMUState(state)
    assert run(unit, 101, 150) == first
    copied = other.fmu.deserializeFMUState(data)
    other.fmu.setFMUState(copied)
    assert run(other, 101, 150) == first
    unit.fmu.freeFMUState(state)
    other.fmu.freeFMUState(copied)
    unit.fmu.reset()
    unit.start(parameters, time=start_time)
    run(unit, 0, 101)
    assert run(unit, 101, 150) == first
    unit.close()
    other.close()


def test_one_millisecond_p_drive_with_ideal_torque_source(archive: Archive) -> None:
    """All blocks neutral: M_a is the two P laws of the values at t_k, at once and over the whole cycle."""
    h = 1e-3
    neutral = {
        "T_c": h, "T_pos": h, "T_dyn": 0, "T_sym": 0, "k_ffw": 0, **NEUTRAL_SPEED, "filter_1.type": 0,
        "ideal_current_loop": 1, "M_max": 1e9, "K_v": 25.0, "K_p": 3.0, "I_P": 0.002, "K_t": 1.0,
    }  # fmt: skip
    rng = np.random.default_rng(12)
    unit = archive.instance()
    unit.start(neutral)
    for k in range(100):
        x_s, x_a = rng.uniform(0.0, 1e-3, 2)
        n_a = rng.uniform(-50.0, 50.0)
        held = 3.0 * (25.0 * (x_s - x_a) / 0.002 - n_a)
        values = [x_s, 0.0, x_a, n_a, 0.0, 0.0]
        unit.step(k * h, 0.25 * h, values)
        # rounding of a handful of operations at 150 N.m
        assert unit.get("M_a") == pytest.approx(held, rel=0, abs=1e-12)
        unit.step((k + 0.25) * h, 0.75 * h, values)
        assert unit.get("M_a") == pytest.approx(held, rel=0, abs=1e-12)
        assert unit.get("i_q") == pytest.approx(held, rel=0, abs=1e-12)
    unit.close()


J_TOT = 0.01639  # kg.m2, Z axis of the synthetic default machine
X_AXIS = {
    "K_p": 21.59, "T_n": 0.020, "omega_0": 747.3, "D": 1.487, "K_t": 2.4, "R": 0.25, "L_d": 0.003, "L_q": 0.003,
    "current.K_p": 10.367, "current.T_n": 0.012, "filter_1.f": 455, "filter_1.D_num": 0.1, "filter_1.D_den": 1.0,
}  # fmt: skip


@pytest.mark.parametrize(
    ("J", "parameters"),
    [(J_TOT, {}), (0.08592, X_AXIS), (J_TOT, {"ideal_current_loop": 1, "filter_1.type": 0})],
    ids=["Z", "X", "ideal current loop"],
)
def test_equivalent_time_of_the_speed_loop(archive: Archive, J: float, parameters: Mapping[str, float]) -> None:
    """A rigid inertia behind a speed ramp: the integrator makes n_a follow n_ref, which lags by 2 D/omega_0."""
    unit = archive.instance()
    unit.start({"K_v": 0, "k_ffw": 0, **parameters})
    alpha, n_a, M_a = 100.0, 0.0, 0.0
    for k in range(4000):
        unit.step(k * T_C, T_C, [0.0, 0.0, 0.0, n_a, alpha * k * T_C, 0.0], [0.0, 0.0, 0.0, 0.0, alpha, 0.0])
        M_next = unit.get("M_a")
        n_a += (M_a + M_next) / 2 * T_C / J
        M_a = M_next
    lag = 4000 * T_C - n_a / alpha
    p = {**DEFAULTS, **parameters}
    assert lag == pytest.approx(2 * p["D"] / p["omega_0"], rel=5e-3)
    # The fact is exact; 0.5 s is 25 T_n and more, exp(-25) = 1e-11 of the first lag.
    assert lag == pytest.approx(2 * p["D"] / p["omega_0"], rel=1e-6)
    unit.close()


@pytest.mark.parametrize("ramped", [True, False])
@pytest.mark.parametrize("delta", [0.0, -0.6e-3])
def test_neutral_symmetry_delay(archive: Archive, ramped: bool, delta: float) -> None:
    """At constant acceleration a the following error settles at a (T_neutral - T_sym)/K_v: 0 where T_sym is neutral,
    2 D/omega_0 + T_pos - T_c with the ramped and 2 D/omega_0 + (T_pos - T_c)/2 with the held speed setpoint."""
    p = DEFAULTS
    between = (p["T_pos"] - p["T_c"]) * (1.0 if ramped else 0.5)
    neutral = 2 * p["D"] / p["omega_0"] + between
    unit = archive.instance()
    unit.start({"T_sym": neutral + delta, "ramp_speed_setpoint": ramped})
    a, n_a, x_a, M_a = 1.0, 0.0, 0.0, 0.0  # to 126 rad/s: 168 V of 350 V
    errors = []
    for k in range(3200):
        t = k * T_C
        unit.step(t, T_C, [a * t * t / 2, a * t / p["I_P"], x_a, n_a, 0.0, 0.0])
        M_next = unit.get("M_a")
        x_a += p["I_P"] * (n_a * T_C + (2 * M_a + M_next) / 6 * T_C**2 / J_TOT)
        n_a += (M_a + M_next) / 2 * T_C / J_TOT
        M_a = M_next
        errors.append(unit.get("x_e"))
    # Ramped, the law is exact (rounding of positions of 0.1 m); held, the steps' ripple leaves 6 pm.
    assert np.mean(errors[-8:]) == pytest.approx(-a * delta / p["K_v"], rel=0, abs=1e-15 if ramped else 1e-11)
    unit.close()


def test_no_input_acts_on_an_output_at_once(archive: Archive) -> None:
    unit = archive.instance()
    unit.start({})
    unit.step(0.0, T_C, [0.1, 1.0, 0.1, 0.0, 0.0, 0.0])
    for name in INPUTS:
        assert unit.fmu.getDirectionalDerivative(unit.references(["M_a"]), unit.references([name]), [1.0]) == [0.0]
    unit.close()


@pytest.mark.parametrize(
    ("parameters", "parts"),
    [
        ({"T_pos": 1.05e-3}, ["T_pos = 0.00105 s", "T_c = 0.000125 s", "8.4"]),
        ({"T_pos": 5e-5}, ["T_pos = 5e-05 s", "T_c = 0.000125 s", "0.4"]),
        ({"filter_3.type": 1, "filter_3.f": 4000}, ["filter_3.f = 4000 Hz", "1/(2 T_c) = 4000 Hz"]),
        ({"filter_1.f": 1e9}, ["filter_1.f"]),
    ],
)
def test_what_does_not_fit_is_refused(archive: Archive, parameters: Mapping[str, float], parts: list[str]) -> None:
    unit = archive.instance()
    with pytest.raises(FMICallException):
        unit.start(parameters)
    text = " ".join(unit.messages)
    for part in parts:
        assert part in text
    unit.close()


def test_filters_that_are_off_are_not_judged(archive: Archive) -> None:
    unit = archive.instance()
    unit.start({"filter_2.type": 0, "filter_2.f": 1e6})
    unit.close()


def test_start_values_are_the_default_machine(archive: Archive) -> None:
    """The table's numbers are those that the reference computes from their origin."""
    for name, value in DEFAULTS.items():
        start = archive.by_name[name].start
        number = {"true": 1.0, "false": 0.0}.get(start) if start in ("true", "false") else float(start)
        assert number is not None
        assert math.isclose(number, value, rel_tol=1e-14), name
