"""Friction compensations of the drive on the whole machine: off they leave every bit, on they take peaks off."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from feedsim import analysis
from feedsim.foundation.errors import InputError
from feedsim.scenario import load
from feedsim.simulation import cosim

CIRCLE = Path(__file__).resolve().parents[2] / "scenarios" / "xz_circle.yaml"
PULSE = [
    "machine.axes.X.drive.friction_pulse={amplitude: 17.1 mm/min, time: 55 ms}",
    "machine.axes.Z.drive.friction_pulse={amplitude: 34 mm/min, time: 40 ms}",
]
TABLE = [
    "machine.axes.*.drive.friction_table={points: 2, torque_0: 1 N.m, speed_1: 3 m/min, torque_1: 1.4 N.m}",
]


def test_off_keeps_every_bit(fmus: Path) -> None:
    plain = cosim.run(load(CIRCLE), fmus=fmus)
    off = ["machine.axes.*.drive.friction_pulse.time=10 ms", "machine.axes.*.drive.friction_table.distance=1 um"]
    other = cosim.run(load(CIRCLE, off), fmus=fmus)
    for name in plain.trace.names:
        assert np.array_equal(plain.trace[name], other.trace[name]), name


def test_a_pulse_takes_peaks_off(fmus: Path) -> None:
    before, after = (analysis.evaluate(cosim.run(load(CIRCLE, each), fmus=fmus)) for each in ([], PULSE))
    for axis in "XZ":
        assert after[f"XZ.glitch_{axis}"].value < 0.6 * before[f"XZ.glitch_{axis}"].value


@pytest.mark.parametrize("settings", [PULSE, TABLE])
def test_the_one_unit_has_the_same_bits(settings: list[str], fmus: Path) -> None:
    short = ["motions.0.direction=counterclockwise", "motions.0.turns=1", "evaluate=[]"]
    parts = cosim.run(load(CIRCLE, [*short, *settings]), fmus=fmus)
    whole = cosim.run(load(CIRCLE, [*short, *settings, "coupling.units=one"]), fmus=fmus)
    for axis in "XZ":
        assert np.array_equal(parts.trace[f"{axis}.x_a"], whole.trace[f"{axis}.x_a"])


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("friction_table={points: 2, speed_0: 1 mm/min}", "friction_table.speed_1 = 0 m/s is not above speed_0"),
        (
            "friction_pulse={amplitude: 1 mm/min, adaptation: true, acceleration_1: 2 m/s^2}",
            "friction_pulse.acceleration_1 = 2 m/s2 is above acceleration_2",
        ),
    ],
)
def test_tables_that_do_not_rise_are_refused(setting: str, message: str, fmus: Path) -> None:
    with pytest.raises(InputError, match=message):
        cosim.run(load(CIRCLE, [f"machine.axes.Z.drive.{setting}"]), fmus=fmus)
