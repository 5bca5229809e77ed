"""Results laid over records: shifts that are known, stops of profiles in closed form, turns found by the angle."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from feedsim.analysis.circularity import Turn, amplitude_spectrum
from feedsim.analysis.side_by_side import Source, align_sources, approaches, read_sources, stops
from feedsim.foundation.errors import InputError

Array = NDArray[np.float64]
STEP = 1e-3
LATER = 0.4321  # s by which the records begin ahead of the motion


def way(t: Array) -> Array:
    """A move by 50 mm from rest to rest, in 0.5 s from 0.2 s on, and back from 1.2 s on."""

    def up(s: Array) -> Array:
        s = s.clip(0, 1)
        return np.asarray(s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3))

    return np.asarray(0.05 * (up((t - 0.2) / 0.5) - up((t - 1.2) / 0.5)))


def written(path: Path, **columns: Array) -> Path:
    header = ",".join(name.replace("__", ".") for name in columns)
    heads = ",".join(f"{name} [{'s' if name == 't' else 'm'}]" for name in header.split(","))
    np.savetxt(path, np.column_stack([*columns.values()]), "%.12g", ",", header=heads, comments="")
    return path


def sources(*paths: Path) -> list[Source]:
    return align_sources(read_sources(paths))


@pytest.fixture
def simulated(tmp_path: Path) -> Path:
    t = np.arange(0, 2.5, STEP)
    return written(tmp_path / "simulated.csv", t=t, Z__x_s=way(t), Z__x_a=way(t - 0.004))


def test_a_record_is_shifted_by_its_setpoints_and_lags_stay(simulated: Path, tmp_path: Path) -> None:
    """Its axis lags by 6 ms more, which a shift by positions would take out."""
    t = np.arange(0, 3.2, 0.7 * STEP)
    noise = 2e-7 * np.random.default_rng(1).standard_normal(len(t))
    told = way(t - LATER)
    record = written(tmp_path / "record.csv", t=t + 77.0, Z__x_s=told, Z__x_a=way(t - LATER - 0.01) + noise)
    first, second = sources(simulated, record)
    assert first.shift == 0.0
    assert second.shift == pytest.approx(-LATER, abs=1e-5)
    assert "setpoints x_s" in second.aligned
    assert second.t[0] == pytest.approx(-LATER, abs=1e-5)


def test_without_setpoints_positions_tell_and_it_is_said(simulated: Path, tmp_path: Path) -> None:
    t = np.arange(0, 3.2, STEP)
    record = written(tmp_path / "record.csv", t=t, Z__x_a=way(t - LATER - 0.01))
    second = sources(simulated, record)[1]
    assert second.shift == pytest.approx(-LATER - 0.006, abs=1e-5)
    assert "takes out what all axes lag" in second.aligned
    # Where the axis comes to rest is told by the setpoints of the other one.
    own, borrowed = stops(sources(simulated, record))
    assert own == borrowed


def test_another_motion_is_not_aligned(simulated: Path, tmp_path: Path) -> None:
    t = np.arange(0, 2.5, STEP)
    record = written(tmp_path / "record.csv", t=t, Z__x_a=0.01 * np.sin(30 * t))
    second = sources(simulated, record)[1]
    assert second.shift is None
    assert second.t[0] == 0.0
    assert second.aligned.startswith("not: ")
    assert stops(sources(simulated, record))[1] == ()


def test_what_shares_nothing_is_refused(simulated: Path, tmp_path: Path) -> None:
    other = written(tmp_path / "other.csv", t=np.arange(3.0), B__x_a=np.arange(3.0))
    with pytest.raises(InputError, match=r"other\.csv: has nothing .* it has B\.x_a; the others have Z\.x_s, Z\.x_a"):
        sources(simulated, other)


def test_stops_are_where_the_setpoint_comes_to_rest() -> None:
    t = np.arange(0, 2.5, STEP)
    there, back = approaches("Z", t, way(t))
    # The profile is flat to the fourth order: below 10 um/s for the last 6 ms.
    assert there.start == pytest.approx(0.2, abs=0.01)
    assert there.end == pytest.approx(0.7, abs=0.01)
    assert (there.origin, there.target) == (pytest.approx(0.0, abs=1e-12), pytest.approx(0.05, abs=1e-12))
    assert there.until == pytest.approx(back.start)
    assert back.end == pytest.approx(1.7, abs=0.01)
    assert back.sense == -1
    assert approaches("Z", t, np.zeros_like(t)) == []
    # Nothing lies beyond the end of a motion that ends where it began; nor is one a stop that has no rest behind it.
    assert approaches("Z", t, 0.01 * np.where(t < 1, 1 - np.cos(2 * math.pi * t), 0.0)) == []
    assert approaches("Z", t[:701], way(t)[:701]) == []


@pytest.mark.parametrize("off", [0.0, 0.3])
def test_turns_of_a_record_are_found_by_the_angle(tmp_path: Path, off: float) -> None:
    """About the programmed centre, or about their own where the record counts from another zero."""
    t = np.arange(0, 3.0, STEP)
    phase = 2 * math.pi * (t - 0.1)
    radius = 0.02 + 3e-6 * np.cos(2 * phase)
    x, y = 0.1 + radius * np.cos(phase), 0.2 + radius * np.sin(phase)
    simulated, record = (
        written(tmp_path / f"{name}.csv", t=t, X__x_a=x + shift, Z__x_a=y) for name, shift in (("a", 0.0), ("b", off))
    )
    first, second = read_sources([simulated, record])
    turn = Turn(("X", "Z"), (0.1, 0.2), 0.02, 1, 0.5, 1.5)
    found = align_sources([replace(first, circles={"XZ": (turn,)}), second])[1]
    (own,) = found.circles["XZ"]
    assert own.centre == pytest.approx((0.1 + off, 0.2), abs=1e-8)
    assert own.end - own.begin == pytest.approx(1.0, rel=1e-3)
    assert ("the programmed centre" in found.aligned) == (off == 0)


def test_an_amplitude_stands_in_the_spectrum_as_it_is() -> None:
    t = np.arange(0, 4, STEP)
    f, a = amplitude_spectrum(3.0 + 0.7 * np.sin(2 * math.pi * 85 * t + 1), STEP, rows=1000)
    assert f[a.argmax()] == pytest.approx(85.0, abs=1e-9)
    assert a.max() == pytest.approx(0.7, rel=1e-3)
    assert a[f > 100].max() < 1e-3
