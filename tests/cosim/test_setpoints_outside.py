"""Setpoints that an importer gives the machine as one unit: what the drives read of them between two samples."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from numpy.polynomial import Polynomial

from cosim.test_one_unit import Packed, Unit, outside, packed

T_C = 125e-6
DELAY = 8e-3
# Setpoints that one cubic holds altogether, slow enough for the drive; and their start.
CUBIC = Polynomial([0.1, 0.02, 0.03, -0.04])


@pytest.fixture(scope="module")
def z_move(tmp_path_factory: pytest.TempPathFactory, fmus: Path) -> Packed:
    return packed(tmp_path_factory.mktemp("z"), fmus, "z_positioning")


@contextmanager
def driven(case: Packed, folder: Path, *, delay: float = 0.0, inside: bool = False, **start: float) -> Iterator[Unit]:
    """The unit with setpoints from outside, initialised with those of `start` (axis -> x_s)."""
    unit = Unit(case, folder)
    outside(unit, {f"{axis}.x_s": x for axis, x in start.items()}, delay=delay, inside=inside)
    yield unit
    unit.close()


def random_steps(seed: int, longest: float, stop: float) -> Iterator[float]:
    """Ends of steps of any size up to the longest."""
    random, time = np.random.default_rng(seed), 0.0
    while (time := time + float(random.uniform(0.05, 1.0)) * longest) < stop:
        yield time


def last_instant(time: float) -> float:
    """The control instant that the last cycle begun ahead of `time` began with."""
    return float(np.ceil(time / T_C - 1e-2) - 1) * T_C  # one this near to the end belongs to the next step


def read(unit: Unit, path: Callable[[float], float], times: Iterator[float]) -> Iterator[tuple[float, float, float]]:
    """Step over the setpoints of Z; at each step's end the instant of what the drive has read last, x_s and n_ffw."""
    for time in times:
        unit.set({"Z.x_s": float(path(unit.time))})
        unit.step_to(time)
        yield (last_instant(time), *unit.get(["Z.drive.x_s", "Z.drive.n_ffw"]))


@pytest.mark.parametrize("seed", range(3))
def test_the_path_is_the_cubic_that_the_samples_lie_on(z_move: Packed, tmp_path: Path, seed: int) -> None:
    """At steps of any size up to the delay, position and feedforward; before the start the axis stood."""
    lead = z_move.scenario.machine.axes["Z"].I_P
    begun = 3 * DELAY  # by then the samples ahead of the start, which lie on no cubic, are out of use
    with driven(z_move, tmp_path, delay=DELAY, inside=True, Z=CUBIC(0.0)) as unit:
        met = 0
        for t_k, x_s, n_ffw in read(unit, CUBIC, random_steps(seed, DELAY, 0.3)):
            late = t_k - DELAY
            if late < -2 * DELAY / 8:
                assert (x_s, n_ffw) == (CUBIC(0.0), 0.0)
            if late > begun:
                met += 1
                # rounding of positions of 0.1 m, in weights up to 10 where steps are uneven; over 1 ms in the slope
                assert x_s == pytest.approx(CUBIC(late), abs=1e-15)
                assert n_ffw * lead == pytest.approx(CUBIC.deriv()(late), abs=1e-11)
        assert met > 20


@pytest.mark.parametrize("late", [1.5, 2.5])
def test_the_path_is_of_fourth_order(z_move: Packed, tmp_path: Path, late: float) -> None:
    """Half-way between two samples: the newest ones, and those with two samples on either side."""

    def path(time: float) -> float:
        return float(0.1 + 1e-3 * (1 - np.cos(2 * np.pi * 5 * time)))

    def error(h: float) -> float:
        with driven(z_move, tmp_path / f"{h}", delay=late * h, Z=path(0.0)) as unit:
            rows = list(read(unit, path, iter(np.arange(1, round(0.4 / h)) * h)))
        return max(abs(x_s - path(t_k - late * h)) for t_k, x_s, _ in rows if t_k > 0.1)

    assert np.log2(error(8e-3) / error(4e-3)) == pytest.approx(4, abs=0.2)


def test_held_setpoints_have_the_feedforward_of_their_cubic(z_move: Packed, tmp_path: Path) -> None:
    lead = z_move.scenario.machine.axes["Z"].I_P
    with driven(z_move, tmp_path, inside=True, Z=CUBIC(0.0)) as unit:
        for i, (_, x_s, n_ffw) in enumerate(read(unit, CUBIC, iter(np.arange(1, 100) * 2e-3))):
            assert x_s == CUBIC(i * 2e-3)
            if i > 3:
                assert n_ffw * lead == pytest.approx(CUBIC.deriv()(i * 2e-3), abs=1e-12)


def test_samples_between_position_cycles_make_no_spikes(z_move: Packed, tmp_path: Path) -> None:
    """A control that sets a new position every 1 ms, stepped at the control cycle: differences are those over 1 ms."""
    lead = z_move.scenario.machine.axes["Z"].I_P

    def stairs(time: float) -> float:
        return float(CUBIC(np.floor(time / 1e-3 + 1e-6) * 1e-3))

    with driven(z_move, tmp_path, inside=True, Z=CUBIC(0.0)) as unit:
        rows = list(read(unit, stairs, iter(np.arange(1, 400) * T_C)))
    taken = [(t_k, n) for t_k, _, n in rows[::8] if t_k > 4e-3]  # the instants at which the drive takes them over
    for t_k, n_ffw in taken:
        assert n_ffw * lead == pytest.approx(CUBIC.deriv()(t_k), abs=1e-11)


def test_a_saved_state_has_the_samples(z_move: Packed, tmp_path: Path) -> None:
    with driven(z_move, tmp_path, delay=DELAY, inside=True, Z=CUBIC(0.0)) as unit:
        list(read(unit, CUBIC, iter(np.arange(1, 30) * 3e-3)))
        state, at = unit.slave.getFMUstate(), unit.time
        ahead = list(read(unit, CUBIC, iter(at + np.arange(1, 10) * 3e-3)))
        unit.slave.setFMUstate(state)
        unit.slave.freeFMUstate(state)
        unit.time = at
        assert list(read(unit, CUBIC, iter(at + np.arange(1, 10) * 3e-3))) == ahead


def test_a_step_beyond_the_delay_is_refused(z_move: Packed, tmp_path: Path) -> None:
    said: list[str] = []
    unit = Unit(z_move, tmp_path, said)
    outside(unit, {}, delay=DELAY)
    unit.step_to(DELAY)
    assert not said  # longer than the position cycle, but nothing is held
    with pytest.raises(FMICallException):
        unit.step_to(2.5 * DELAY)
    unit.slave.freeInstance()
    assert "the step is 0.012 s long, setpoints.delay is 0.008 s" in said[0]
