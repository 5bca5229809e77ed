"""Steps of any size and from any start, on the built libraries: what each model says of itself, held against a run at
the control cycle or against arithmetic of the test's own."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fmu.binary import ERROR, Slave, of
from fmu.unpacked import Archive, unpack

T_C = 125e-6
# The control cycle, parts and multiples of it, and what has no common measure with it.
SIZES = (1e-6, 1e-5, T_C / 3, T_C, 130.7e-6, math.pi * 1e-4, 1e-3, 1e-2)
END = 0.02

Values = NDArray[np.float64]


def grid(h: float, end: float = END) -> list[float]:
    """Communication points k h and the end, the last step being what remains."""
    points = [k * h for k in range(math.ceil(end / h - 1e-9))]
    return [*points, end]


def run(
    archive: Archive, h: float, start: float = 0.0, outputs: Sequence[str] | None = None
) -> Iterator[tuple[float, Values]]:
    """Time since the start and outputs behind each step; inputs are linear in time, each in its own way."""
    inputs = list(of(archive, "input").values())
    shown = of(archive, "output")
    known = [shown[name] for name in outputs] if outputs else list(shown.values())
    # Below every limit of the controller: a run into a limit hides what came ahead of it.
    value = 1e-4 * (1.0 + np.arange(len(inputs)))
    slope = 1e-2 * np.cos(np.arange(len(inputs)))
    slave = Slave(archive)
    slave.set_up(start)
    slave.set(inputs, value)
    slave.must("fmi2ExitInitializationMode")
    points = grid(h)
    for t, after in pairwise(points):
        slave.set(inputs, value + slope * t)
        slave.slope(inputs, slope)
        slave.step(start + t, after - t)
        yield after, np.array(slave.get(known))
    slave.free()


def last(archive: Archive, h: float, start: float = 0.0) -> Values:
    *_, (_, values) = run(archive, h, start)
    return values


@pytest.mark.parametrize("h", SIZES)
def test_every_size_gives_finite_results(archive: Archive, h: float) -> None:
    for t, values in run(archive, h):
        assert np.isfinite(values).all(), t


def test_a_slope_serves_one_step(archive: Archive) -> None:
    """The next one holds its inputs, as one that is told slopes of 0."""
    inputs = list(of(archive, "input").values())
    states = []
    for told in (False, True):
        slave = Slave(archive).initialized()
        slave.slope(inputs, [0.3] * len(inputs))
        slave.step(0.0, T_C)
        if told:
            slave.slope(inputs, [0.0] * len(inputs))
        slave.step(T_C, T_C)
        states.append(slave.get(list(of(archive, "output").values())))
        slave.free()
    assert states[0] == states[1]


# --- plant: exact for inputs that are linear over a step


@pytest.mark.parametrize("h", [h for h in SIZES if h != T_C])
def test_the_plant_does_not_know_its_step(plant: Archive, h: float) -> None:
    """The difference is rounding, of positions of about 1 m and their differences, gathered over up to 20,000 steps."""
    expected, found = last(plant, T_C), last(plant, h)
    names = list(of(plant, "output"))
    for name, one, other in zip(names, expected, found, strict=True):
        # x: a few units in the last place of 1 m a step, random; n_a = x'/I_P: the same over I_P and the fastest mode
        assert abs(one - other) < (1e-12 if "x_" in name else 1e-9), name


# --- controller: its own instants, whatever the communication points


@pytest.fixture(scope="session")
def controller(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return unpack("controller", fmus, tmp_path_factory.mktemp("controller_alone"))


@pytest.fixture(scope="session")
def friction(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return unpack("friction", fmus, tmp_path_factory.mktemp("friction_alone"))


@pytest.fixture(scope="session")
def setpoint(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return unpack("setpoint", fmus, tmp_path_factory.mktemp("setpoint_alone"))


CONTINUOUS = ("M_a", "i_d", "i_q")
SAMPLED = ("x_e", "n_s", "n_ref", "M_s", "u_d", "u_q")


@pytest.mark.parametrize("h", SIZES)
def test_the_controller_keeps_its_instants(controller: Archive, h: float) -> None:
    """At t in (t_k-1, t_k] it shows what instant k - 1 sampled, and torque and currents linearly between the values at
    both: those of a run whose steps are the cycles."""
    names = (*CONTINUOUS, *SAMPLED)
    at_instants = np.array([np.zeros(len(names)), *(values for _, values in run(controller, T_C, outputs=names))])
    largest = np.abs(at_instants).max(axis=0)
    assert (largest[[0, 3, 4, 5, 6]] > 0).all()  # M_a, x_e, n_s, n_ref, M_s move
    checked = 0
    for t, found in run(controller, h, outputs=names):
        cycles = t / T_C
        near = round(cycles)
        k = near if abs(cycles - near) < 1e-6 else math.ceil(cycles)
        if 0 < cycles - (k - 1) < 1.01e-2 and k > 1:
            continue  # an instant so little ahead of the end of a step may be left to the next one
        share = min(cycles - (k - 1), 1.0)
        expected = at_instants[k].copy()
        count = len(CONTINUOUS)
        expected[:count] = at_instants[k - 1][:count] + share * (at_instants[k] - at_instants[k - 1])[:count]
        # Inputs at an instant are value + slope (t_k - t), rounded otherwise for each h. Measured: 5e-15.
        assert (np.abs(found - expected) <= 1e-13 * np.maximum(largest, 1e-3)).all(), (t, names, found, expected)
        checked += 1
    assert checked > 0.9 * END / h - 1


# --- friction: second order


def _torque(friction: Archive, h: float) -> float:
    """M_fr behind a smooth stretch of motion: pre-sliding into sliding, one direction, the speed linear in time."""
    slave = Slave(friction)
    speed = [of(friction, "input")["n_fr"]]
    slave.initialized()
    points = grid(h, 0.02)
    for t, after in pairwise(points):
        slave.set(speed, [0.2 + 50.0 * t])
        slave.slope(speed, [50.0])
        slave.step(t, after - t)
    (torque,) = slave.get([of(friction, "output")["M_fr"]])
    slave.free()
    return torque


def test_friction_is_of_second_order(friction: Archive) -> None:
    exact = _torque(friction, 1e-6)
    sizes = np.array([500e-6, 250e-6, 125e-6, 62.5e-6])
    errors = np.array([abs(_torque(friction, h) - exact) for h in sizes])
    orders = np.log2(errors[:-1] / errors[1:])
    assert (np.abs(orders - 2.0) < 0.3).all(), (errors, orders)
    # A size between two of these is no exception.
    odd = abs(_torque(friction, 130.7e-6) - exact)
    assert errors[3] < odd < errors[1]


@pytest.mark.parametrize("h", [1e-3, 1e-2])
def test_friction_stays_within_its_law_in_long_steps(friction: Archive, h: float) -> None:
    """Reversals in every step: the torque never exceeds the static one by more than damping and rise can add."""
    slave = Slave(friction).initialized()
    speed = [of(friction, "input")["n_fr"]]
    for k in range(200):
        value = 2.0 * (-1) ** k
        slave.set(speed, [value])
        slave.slope(speed, [-2.0 * value / h])
        slave.step(k * h, h)
        (torque,) = slave.get([of(friction, "output")["M_fr"]])
        assert abs(torque) <= 2.1 + 0.8 * 2.0 + 0.006 * 2.0 + 0.4 * math.log1p(2.0 / 3.0)
    slave.free()


# --- setpoint: its rows, whatever the communication points


@pytest.mark.parametrize("start", [0.0, 1000.0, 1e6])
@pytest.mark.parametrize("h", SIZES)
def test_the_setpoint_plays_its_rows(setpoint: Archive, h: float, start: float) -> None:
    """The table itself, read here, row floor(t/T_pos); where t comes within rounding of a row's time, that row."""
    text = (setpoint.folder / "resources/setpoints.csv").read_text(encoding="utf-8").splitlines()
    names = [name.partition(" ")[0] for name in text[0].split(",")[1:]]
    rows = np.array([[float(field) for field in line.split(",")] for line in text[1:]])
    T_pos = rows[1, 0] - rows[0, 0]
    assert len(rows) * T_pos > 0.01
    for t, found in run(setpoint, h, start, names):
        row = min(math.floor((t - rows[0, 0]) / T_pos + 1e-6), len(rows) - 1)
        assert np.array_equal(found, rows[max(row, 0), 1:]), t


# --- start times


@pytest.mark.parametrize("start", [1000.0, 1e6, -7.25])
@pytest.mark.parametrize("h", [T_C, 130.7e-6])
def test_a_start_elsewhere_gives_the_same_results(archive: Archive, start: float, h: float) -> None:
    """To the last bit; but where a drive's instants lie within steps, it reads and shows what is linear in t,
    and t is rounded to 2^-53 of itself."""
    here, there = (np.array([values for _, values in run(archive, h, each)]) for each in (0.0, start))
    if archive.unit not in ("controller", "machine") or h == T_C:
        assert np.array_equal(here, there)
        return
    rounding = 2 * np.spacing(abs(start) + END)  # of t_k and of t + h, by which inputs are read and outputs shown
    steepest = np.abs(np.diff(here, axis=0)).max(axis=0) / T_C  # a step holds one cycle or two
    assert (np.abs(there - here) <= rounding * steepest + 1e-13 * np.abs(here).max(axis=0)).all()


def test_the_stop_time_ends_the_run(archive: Archive) -> None:
    for start, stop in ((0.0, 0.01), (1000.0, 1000.01), (1e6, 1e6 + 0.01)):
        slave = Slave(archive).initialized(start, stop)
        steps = round((stop - start) / T_C)
        for k in range(steps):
            slave.step(start + k * T_C, T_C)
        before = slave.state()
        assert slave.call("fmi2DoStep", start + steps * T_C, T_C, 1) == ERROR
        assert f"past the stop time of {stop!r} s".replace(".0 s", " s") in slave.last
        assert slave.state() == before  # refused, and the results remain
        slave.must("fmi2Terminate")
        slave.free()


@pytest.mark.parametrize("ulps", [-3, 3, 100])
def test_the_last_step_may_overshoot_by_rounding(archive: Archive, ulps: int) -> None:
    stop = 0.01
    slave = Slave(archive).initialized(0.0, stop)
    t = stop - T_C
    for k in range(79):
        slave.step(k * T_C, T_C)
    slave.step(t, stop - t + ulps * float(np.spacing(stop)))
    slave.free()


def test_a_step_into_the_stop_time_is_not_cut(archive: Archive) -> None:
    slave = Slave(archive).initialized(0.0, 0.01)
    slave.step(0.0, 0.009)
    assert slave.call("fmi2DoStep", 0.009, 0.002, 1) == ERROR
    assert slave.last.endswith("the step would end at 0.011 s, past the stop time of 0.01 s")
    slave.step(0.009, 0.001)
    slave.free()
