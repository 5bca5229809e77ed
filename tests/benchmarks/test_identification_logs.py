"""The logs that judge identification: their axis against an independent solution of friction."""

from __future__ import annotations

import sys
from math import pi
from pathlib import Path

import identification_logs as logs
import numpy as np
import pytest
from scipy.integrate import cumulative_simpson
from scipy.interpolate import CubicSpline

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "physics"))
from friction_reference import Motion, solved


@pytest.mark.parametrize(
    "setpoint",
    [
        pytest.param(logs.sines([(200.0, 5.0, 2)])[280:700], id="sine"),
        pytest.param(logs.strokes([(0.04, 0.04)], 2.0, 0.06, 1e-3)[280:700], id="stroke"),
    ],
)
def test_axis_obeys_momentum_under_the_independent_friction(setpoint: logs.Floats) -> None:
    """Its speed is what motor torque, weight and scipy's friction under that motion integrate to."""
    axis = logs.drawn_axis(np.random.default_rng(3), weight=True)
    angle, speed, torque = logs.driven(axis, (setpoint - setpoint[0]) * (2e3 * pi / axis.pitch))
    t = np.arange(len(angle)) * logs.FINE
    course, way = CubicSpline(t, speed), CubicSpline(t, angle)
    size = np.max(np.abs(speed))
    # What of rest is no more than rounding has no reversals.
    turns = tuple(float(at) for at in course.roots(extrapolate=False) if abs(course(at, 1)) * logs.FINE > 1e-6 * size)
    p = vars(axis) | {"beta": 1.0, "asymmetry": 0.0}
    every = 8  # rows; between them the friction is smooth enough
    friction = CubicSpline(t[::every], solved(p, Motion(course, way, turns), t[::every]))(t)
    gained = cumulative_simpson(torque - axis.M_0 - friction, x=t, initial=0) / axis.J
    assert np.max(np.abs(gained - speed)) < 1e-3 * size  # the kinks of friction between every 8th row


def test_log_is_the_same_wherever_it_is_made(tmp_path: Path) -> None:
    one, other = (logs.made("clipped-0", ("clipped",), tmp_path / name) for name in ("one", "other"))
    assert [file.read_bytes() for file in one.files] == [file.read_bytes() for file in other.files]
    assert (one.words, one.truth) == (other.words, other.truth)
