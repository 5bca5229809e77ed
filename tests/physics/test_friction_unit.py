"""friction.fmu from outside: against the equations, closed forms and scipy's integrators, and as an FMI unit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from friction_reference import X_AXIS, Z_AXIS, Motion, level, line, sine, solved, torque
from hypothesis import given, settings
from hypothesis import strategies as st

from fmi_helpers import Archive, Floats, Instance

H = 125e-6


@pytest.fixture(scope="module")
def archive(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return Archive.unpack(fmus / "friction.fmu", tmp_path_factory.mktemp("friction"))


@pytest.fixture
def unit(archive: Archive) -> Iterator[Instance]:
    with archive.instance() as instance:
        yield instance


def instants(h: float, stop: float) -> Floats:
    """h, 2 h, .. stop."""
    return np.asarray(np.arange(1, round(stop / h) + 1) * h, dtype=np.float64)


def path_error(
    archive: Archive, p: Mapping[str, float], motion: Motion, h: float, stop: float
) -> tuple[Floats, Floats]:
    """Instants and M_fr less the solution, for steps of h through chords of the speed."""
    times = instants(h, stop)
    speeds = [motion.speed(t) for t in np.append(0.0, times)]
    with archive.instance(p, inputs={"n_fr": speeds[0]}) as instance:
        seen = instance.run(h, ["n_fr"], speeds, ["M_fr"])[:, 0]
    return times, seen - solved(p, motion, times)


def test_defaults_are_those_of_the_z_axis(unit: Instance) -> None:
    assert {name: unit.get(name) for name in Z_AXIS} == Z_AXIS


@pytest.mark.parametrize("asymmetry", [0.0, 0.2])
@pytest.mark.parametrize("n", [1e-3, 0.3, -0.6, 5.0, -26.2, 150.0])
def test_constant_speed_is_equation_7(archive: Archive, n: float, asymmetry: float) -> None:
    p = Z_AXIS | {"asymmetry": asymmetry}
    with archive.instance(p) as unit:
        # 60 bristle lengths: z has reached g(n) to exp(-60), c the end of its zone
        unit.step(max(60 * level(p, n), p["W"]) / abs(n), {"n_fr": n})
        unit.step(H, {"n_fr": n})
        expected = math.copysign(p["sigma_0"] * level(p, n), n) + p["sigma_2"] * n
        assert unit.get("M_fr") == pytest.approx(expected, rel=1e-12)
        assert unit.get("z") == pytest.approx(math.copysign(level(p, n), n), rel=1e-12)
        assert unit.get("c") == math.copysign(p["W"] / 2, n)
        assert (unit.get("k"), unit.get("lambda")) == (1.0, 1.0)
        assert unit.derivative("M_fr") == pytest.approx(0.0, abs=1e-12 * abs(expected) / H)


def test_asymmetry_is_between_the_directions(archive: Archive) -> None:
    torques = []
    for n in (2.0, -2.0):
        with archive.instance({"asymmetry": 0.25, "sigma_2": 0.0}) as unit:
            unit.step(1.0, {"n_fr": n})
            torques.append(unit.get("M_fr"))
    assert torques[0] / -torques[1] == pytest.approx(1.25 / 0.75, rel=1e-12)


def test_starts_at_rest_with_a_half_engaged_transmission(archive: Archive) -> None:
    with archive.instance(inputs={"n_fr": 0.7}) as unit:
        assert [unit.get(name) for name in ("z", "c")] == [0.0, 0.0]
        assert unit.get("lambda") == 0.5
        assert unit.get("k") == 0.35 + 0.5 * (1.0 - 0.35)
        assert unit.get("M_fr") == pytest.approx((0.8 + 0.006) * 0.7, rel=1e-15)
        assert unit.derivative("M_fr") == 0.0


STEPS = (1e-3, 5e-4, 2.5e-4, 1.25e-4)


@pytest.mark.parametrize(
    ("motion", "parameters"),
    [
        pytest.param(sine(0.5, 2.3, 0.4, 0.6), {}, id="slow sine"),
        pytest.param(sine(3.0, 4.0, -1.0, 0.6), {}, id="sine through the Stribeck range"),
        pytest.param(sine(0.5, 2.3, 0.4, 0.6), {"W": 0.0}, id="sine, pure LuGre"),
        pytest.param(sine(0.5, 2.3, 0.4, 0.6), {"beta": 2.0, "asymmetry": 0.3}, id="sine, asymmetric"),
        pytest.param(line(-1.0, 3.7, 0.6), {}, id="line through standstill"),
        pytest.param(line(2.0, -3.0, 0.6), {"F_log": 0.0}, id="line, decelerating"),
    ],
)
def test_second_order(archive: Archive, motion: Motion, parameters: Mapping[str, float]) -> None:
    # |n| h/g is 0.4 at most: there the error falls with h^2. The band leaves room for terms of order 3 at the largest
    # step and for where the reversal lies within a step.
    p = {**Z_AXIS, **parameters}
    errors = [float(np.abs(path_error(archive, p, motion, h, 0.6)[1]).max()) for h in STEPS]
    order = float(np.polyfit(np.log(STEPS), np.log(errors), 1)[0])
    assert 1.9 < order < 2.1, errors


@pytest.mark.parametrize("p", [pytest.param(Z_AXIS, id="Z"), pytest.param(X_AXIS, id="X")])
def test_circle_at_the_control_cycle(archive: Archive, p: Mapping[str, float]) -> None:
    radius, feed, lead = 0.015, 3.0 / 60, 0.020 / (2 * math.pi)
    frequency = feed / radius / (2 * math.pi)
    stop = 2.25 / frequency
    motion = sine(feed / lead, frequency, 0.3, stop)
    times, error = path_error(archive, p, motion, H, stop)
    turn = np.abs(error[times > 1.0 / frequency])  # the first turn starts from z = 0 at speed, as no circle does
    after = times[times > 1.0 / frequency]
    near = np.zeros(len(after), dtype=bool)
    for reversal in motion.reversals:
        near |= np.abs(after - reversal) <= 0.060
    assert near.any()
    assert not near.all()
    # At rapid traverse the step is many bristle lengths and only follows g: 6 to 9 uN.m; near a reversal 1.4 to 2 uN.m.
    assert float(turn[near].max()) < 5e-6
    assert float(turn.max()) < 15e-6


def test_held_speeds_are_of_first_order_only(archive: Archive) -> None:
    # What the slope is for: the speed at the step's start as a held value costs four orders of magnitude here.
    motion = sine(3.0, 4.0, -1.0, 0.3)
    times = instants(H, 0.3)
    speeds = [motion.speed(t) for t in np.append(0.0, times)]
    with archive.instance(inputs={"n_fr": speeds[0]}) as unit:
        held = unit.run(H, ["n_fr"], speeds, ["M_fr"], slopes=False)[:, 0]
    sloped = np.abs(path_error(archive, Z_AXIS, motion, H, 0.3)[1]).max()
    assert np.abs(held - solved(Z_AXIS, motion, times)).max() > 1000 * sloped


@pytest.mark.parametrize(
    ("n", "slope"), [(1.0, 150.0), (-0.3, 200.0), (0.2, -100.0), (8.0, -3000.0), (0.0, 50.0), (0.3, 0.0)]
)
def test_split_step(archive: Archive, n: float, slope: float) -> None:
    def end(h: float, parts: int) -> tuple[float, float]:
        with archive.instance(inputs={"n_fr": n}) as unit:
            unit.step(2e-3, {"n_fr": 0.8}, {"n_fr": -200.0})  # some history
            for part in range(parts):
                unit.step(h / parts, {"n_fr": n + slope * h * part / parts}, {"n_fr": slope})
            return unit.get("z"), unit.get("c")

    steps = (2e-4, 1e-4, 5e-5)
    differences = []
    for h in steps:
        whole, halves = end(h, 1), end(h, 2)
        assert halves[1] == pytest.approx(whole[1], rel=1e-12, abs=1e-17)
        differences.append(abs(halves[0] - whole[0]))
    if slope == 0.0:  # the part's mean speed is the speed: exact
        assert max(differences) < 1e-17
        return
    # A single step of a second-order scheme is wrong by h^3; |n| h/g is 0.2 at most, so higher terms show a little.
    order = float(np.polyfit(np.log(steps), np.log(differences), 1)[0])
    assert 2.85 < order < 3.15, differences


def test_without_engaging_zone_it_is_pure_lugre(archive: Archive) -> None:
    motion = sine(1.0, 3.0, 0.2, 0.5)
    p = Z_AXIS | {"W": 0.0, "gamma": 0.1}
    times = instants(H, 0.5)
    speeds = [motion.speed(t) for t in np.append(0.0, times)]
    with archive.instance(p, inputs={"n_fr": speeds[0]}) as unit:
        seen = unit.run(H, ["n_fr"], speeds, ["M_fr", "c", "k", "lambda"])
    assert (seen[:, 1] == 0.0).all()
    assert (seen[:, 2:] == 1.0).all()
    assert np.abs(seen[:, 0] - solved(p, motion, times)).max() < 5e-6  # the bound of a circle's reversal


def test_reversal_runs_through_the_engaging_zone(archive: Archive) -> None:
    with archive.instance() as unit:
        unit.step(1.0, {"n_fr": 1.0})
        unit.step(0.01, {"n_fr": -1.0})  # 10 mrad back: c from +20 to +10 mrad, z already negative
        assert unit.get("c") == pytest.approx(0.01, rel=1e-12)
        assert unit.get("z") < 0
        assert unit.get("lambda") == pytest.approx(0.25, rel=1e-12)
        assert unit.get("k") == pytest.approx(0.35 + 0.25 * 0.65, rel=1e-12)


def test_output_derivative_is_the_last_difference(unit: Instance) -> None:
    before = unit.get("M_fr")
    for n, slope, h in ((0.5, 300.0, 1e-4), (0.53, -20.0, 2e-4), (0.526, -9000.0, 1e-4)):
        unit.step(h, {"n_fr": n}, {"n_fr": slope})
        after = unit.get("M_fr")
        assert unit.derivative("M_fr") == (after - before) / h
        before = after


def test_partial_derivative(archive: Archive) -> None:
    for p in (Z_AXIS, Z_AXIS | {"beta": 0.5, "asymmetry": 0.2}):
        with archive.instance(p) as unit:
            assert unit.partial("M_fr", "n_fr") == pytest.approx(p["sigma_1"] + p["sigma_2"], rel=1e-15)  # z = 0
            for n, slope in ((0.4, 0.0), (-0.2, 900.0), (5.0, -2000.0), (-0.7, 100.0)):
                unit.step(1e-3, {"n_fr": n}, {"n_fr": slope})
                end, z, c = n + slope * 1e-3, unit.get("z"), unit.get("c")
                d = 1e-5 * end
                expected = (torque(p, z, c, end + d) - torque(p, z, c, end - d)) / (2 * d)
                assert unit.partial("M_fr", "n_fr") == pytest.approx(expected, rel=1e-8)  # difference quotient


# --- properties -------------------------------------------------------------------------------------------------------

levels = st.fixed_dictionaries(
    {
        "sigma_0": st.floats(50.0, 2000.0),
        "sigma_1": st.floats(0.0, 3.0),
        "sigma_2": st.floats(0.0, 0.1),
        "F_C": st.floats(0.1, 5.0),
        "F_S": st.floats(5.0, 9.0),
        "v_s": st.floats(0.05, 3.0),
        "beta": st.floats(0.3, 3.0),
        "F_log": st.floats(0.0, 2.0),
        "v_log": st.floats(0.1, 10.0),
        "asymmetry": st.floats(-0.8, 0.8),
        "W": st.one_of(st.just(0.0), st.floats(1e-3, 0.2)),
        "gamma": st.floats(0.0, 1.0),
    }
)
paths = st.lists(st.floats(-200.0, 200.0), min_size=2, max_size=40)


@settings(max_examples=80, derandomize=True)
@given(p=levels, speeds=paths, h=st.sampled_from([1e-5, 1.25e-4, 1e-3, 0.1]))
def test_bounds_hold_for_any_motion(archive: Archive, p: dict[str, float], speeds: list[float], h: float) -> None:
    with archive.instance(p, inputs={"n_fr": speeds[0]}) as unit:
        z, c, k, engaged = unit.run(h, ["n_fr"], speeds, ["z", "c", "k", "lambda"]).T
    peak = (1 + abs(p["asymmetry"])) * (p["F_S"] + p["F_log"] * math.log1p(200.0 / p["v_log"])) / p["sigma_0"]
    assert np.abs(z).max() <= peak * (1 + 1e-15)  # z moves towards g and never past it, whatever the step
    assert np.abs(c).max() <= p["W"] / 2
    assert engaged.min() >= 0.0
    assert engaged.max() <= 1.0
    assert k.min() >= p["gamma"]
    assert k.max() <= 1.0


@settings(max_examples=60, derandomize=True)
@given(p=levels, speeds=paths)
def test_pure_lugre_is_passive(archive: Archive, p: dict[str, float], speeds: list[float]) -> None:
    """From rest, friction never gives back more than its bristles store: integral of M_fr n dt >= sigma_0 z^2/2.

    LuGre is passive where sigma_1^2 |n|/g <= 4 sigma_0 (sigma_1 + sigma_2): the power less the storage rate is the form
    sigma_0 |n|/g z^2 - sigma_1 |n|/g n z + (sigma_1 + sigma_2) n^2 in (z, n), here kept below half that bound.
    """
    p = p | {"W": 0.0, "asymmetry": 0.0}
    lowest = p["F_C"] / p["sigma_0"]
    limit = 2 * p["sigma_0"] * lowest * (p["sigma_1"] + p["sigma_2"]) / max(p["sigma_1"], 1e-9) ** 2
    size = min(1.0, limit / 200.0)
    h, fine = 1e-4, 10
    coarse = [0.0, *(n * size for n in speeds)]
    grid = np.interp(np.arange((len(coarse) - 1) * fine + 1) / fine, np.arange(len(coarse)), coarse)
    with archive.instance(p) as unit:
        torques, z = unit.run(h, ["n_fr"], grid, ["M_fr", "z"]).T
    ends = np.append(0.0, torques)
    power = ends * grid
    energy = np.cumsum((power[1:] + power[:-1]) / 2 * h)
    scale = np.cumsum((np.abs(power[1:]) + np.abs(power[:-1])) / 2 * h)
    # The trapezoidal sum of a power that bends within a step: a few per cent of what has flowed.
    assert (energy >= p["sigma_0"] * z**2 / 2 - 0.03 * scale - 1e-15).all()


# --- as an FMI unit ---------------------------------------------------------------------------------------------------


def test_static_below_coulomb_is_refused(archive: Archive) -> None:
    with Instance(archive) as unit:
        with pytest.raises(FMICallException):
            unit.start({"F_S": 1.25, "F_C": 1.5})
        text = unit.texts(3)
    assert "'F_S' is 1.25 N.m" in text
    assert "'F_C' is 1.5 N.m" in text
    assert "must not be below" in text


def test_equal_static_and_coulomb_is_allowed(archive: Archive) -> None:
    with archive.instance({"F_S": 1.5, "F_C": 1.5, "F_log": 0.0}) as unit:
        unit.step(1.0, {"n_fr": 1.0})
        assert unit.get("M_fr") == pytest.approx(1.5 + 0.006, rel=1e-12)


def test_narrow_engaging_zone_warns(archive: Archive) -> None:
    narrow = 2 * Z_AXIS["F_S"] / Z_AXIS["sigma_0"]
    with archive.instance({"W": narrow}) as unit:
        assert "'W' is 0.014 rad; keep it well above" in unit.texts(1)
    with archive.instance({"W": narrow * 1.01}) as unit:
        assert unit.texts(1) == ""
    with archive.instance({"W": 0.0}) as unit:
        assert unit.texts(1) == ""


def test_negative_width_is_refused(archive: Archive) -> None:
    with Instance(archive) as unit:
        with pytest.raises(FMICallException):
            unit.start({"W": -0.01})
        assert "W" in unit.texts(3)
        assert "-0.01" in unit.texts(3)


def test_overflow_is_an_error_that_keeps_the_state(archive: Archive) -> None:
    with archive.instance({"sigma_2": 1e9}) as unit:
        unit.step(H, {"n_fr": 1.0})
        state, torque_before = unit.state(), unit.get("M_fr")
        with pytest.raises(FMICallException):
            unit.step(H, {"n_fr": 1e300}, {"n_fr": 1e303})
        assert "M_fr would be no finite number" in unit.texts(3)
        unit.restore(state)
        assert unit.get("M_fr") == torque_before


def test_state_replays_bit_for_bit(archive: Archive) -> None:
    motion = sine(2.0, 5.0, 0.1, 1.0)
    grid = np.array([motion.speed(k * H) for k in range(401)])
    outputs = ["M_fr", "z", "c", "k", "lambda"]
    with archive.instance(inputs={"n_fr": grid[0]}) as unit:
        unit.run(H, ["n_fr"], grid[:201], outputs)
        state, content, time = unit.state(), unit.serialized(), unit.time
        slope = unit.derivative("M_fr")
        first = unit.run(H, ["n_fr"], grid[200:], outputs)
        unit.restore(state)
        assert unit.derivative("M_fr") == slope
        again = unit.run(H, ["n_fr"], grid[200:], outputs)
        with archive.instance() as other:
            other.restore_serialized(content, time)
            assert other.derivative("M_fr") == slope
            elsewhere = other.run(H, ["n_fr"], grid[200:], outputs)
    assert (again == first).all()
    assert (elsewhere == first).all()


def test_state_brings_its_parameters(archive: Archive) -> None:
    with archive.instance({"F_C": 1.0, "W": 0.02}) as unit, archive.instance() as other:
        unit.step(1e-3, {"n_fr": 0.5})
        other.restore_serialized(unit.serialized(), unit.time)
        for instance in (unit, other):
            instance.step(1e-3, {"n_fr": -0.5})
        assert other.get("F_C") == 1.0
        assert other.get("M_fr") == unit.get("M_fr")
