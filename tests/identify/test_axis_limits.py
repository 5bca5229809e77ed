"""Limits of an axis from the setpoints of its moves: made by ruckig, and of a real control."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from feedsim.estimation.identify import identify_axis_limits
from feedsim.estimation.identify.axis_limits import profile_of_rest_to_rest
from feedsim.foundation.errors import InputError
from feedsim.motions.profile import rest_to_rest

CYCLE = 2e-3


def record(lengths: list[float], v: float, a: float, j: float, digits: float = 1e-9) -> tuple[np.ndarray, np.ndarray]:
    """Moves with rests between them, which begin between two cycles, to the digits of a record."""
    x, parts = 0.0, [np.zeros(50)]
    for k, length in enumerate(lengths):
        profile = rest_to_rest(abs(length), v, a, j)
        t = np.arange(0, profile.duration + 0.05, CYCLE) - 0.3e-3 * k
        parts.append(x + np.sign(length) * profile.at(np.clip(t, 0, profile.duration))[0])
        x += length
    position = np.round(np.concatenate(parts) / digits) * digits
    return np.arange(len(position)) * CYCLE, position


@pytest.mark.parametrize("seed", range(6))
def test_limits_come_back(seed: int) -> None:
    random = np.random.default_rng(seed)
    v, a, j = random.uniform(0.1, 1), random.uniform(0.5, 5), random.uniform(10, 60)
    T, way = a / j, v**2 / a
    short = 0.5 * 2 * j * min(T, np.sqrt(v / j)) ** 3  # reaches neither speed nor acceleration
    found = identify_axis_limits(*record([2 * (way + v * T), -(way + v * T) / 2, short], v, a, j))
    assert len(found.moves) == 3
    assert found.jerk == pytest.approx(j, rel=1e-4)
    if v > 1.1 * a * T:
        assert found.acceleration == pytest.approx(a, rel=1e-4)
        assert found.speed == pytest.approx(v, rel=1e-5)
    assert found.moves[2].acceleration is None, "too short to reach it"
    assert found.moves[2].speed is None
    assert max(move.largest for move in found.moves) <= 2e-9


def test_the_profile_is_that_of_ruckig() -> None:
    for length, v, a, j in ((0.1, 0.3, 2, 30), (0.01, 0.3, 2, 30), (1e-4, 0.3, 2, 30), (0.2, 0.05, 2, 30)):
        profile = rest_to_rest(length, v, a, j)
        t = np.linspace(0, profile.duration, 500)
        assert np.abs(profile_of_rest_to_rest(t, length, v, a, j)[0] - profile.at(t)[0]).max() <= 1e-12


def test_what_is_no_such_move_is_left_out() -> None:
    t = np.arange(2000) * CYCLE
    with pytest.raises(InputError, match="no move from rest to rest with phases of constant jerk"):
        identify_axis_limits(t, np.where((t > 1) & (t < 2), 0.01 * np.sin(2 * np.pi * t), 0.0))
    with pytest.raises(InputError, match="ascending instants and a finite position"):
        identify_axis_limits(t, np.full(2000, np.nan))
    with pytest.raises(InputError, match="no move"):
        identify_axis_limits(t, np.zeros(2000))


@pytest.mark.skipif("FEEDSIM_CAPTURE" not in os.environ, reason="FEEDSIM_CAPTURE names no capture")
@pytest.mark.parametrize(
    ("axis", "acceleration", "jerk", "speed"), [(1, 1.5, 20, None), (2, 1.2, 20, 0.4)], ids=["X", "Y"]
)
def test_limits_of_a_real_control(axis: int, acceleration: float, jerk: float, speed: float | None) -> None:
    capture = json.loads(Path(os.environ["FEEDSIM_CAPTURE"]).read_text())
    column = [signal["Address"] for signal in capture["Header"]["SignalListHFData"]].index(f"DES_POS|{axis}")
    x = np.array([row[column] for part in capture["Payload"] if "HFData" in part for row in part["HFData"]]) * 1e-3
    found = identify_axis_limits(np.arange(len(x)) * CYCLE, x)
    assert found.acceleration == pytest.approx(acceleration, rel=1e-3)
    assert found.jerk == pytest.approx(jerk, rel=2e-3)
    assert found.speed == (None if speed is None else pytest.approx(speed, rel=1e-5))
    assert max(move.largest for move in found.moves) <= 1e-6
