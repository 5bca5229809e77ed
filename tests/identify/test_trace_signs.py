"""Signs and units of recorded traces: what is refused, and what is worth a warning."""

from __future__ import annotations

import re
from math import pi
from pathlib import Path

import numpy as np
import pytest

from feedsim.estimation.identify.read import read_records
from record_helpers import ANGLE, SPEED, TIME, TORQUE, mapped, refusal, simple, table

REST = "torque: {column: ActTorque}\n"
SPEED_ONLY = "speed: {column: n}\ntorque: {column: M}\n"


@pytest.mark.parametrize(("factor", "said"), [(1.0, None), (1.03, None), (1.08, "1.08 times"), (0.7, "0.7 times")])
def test_a_speed_that_is_not_the_position_s(tmp_path: Path, factor: float, said: str | None) -> None:
    noise = 1e-4 * np.random.default_rng(1).standard_normal(500)  # of an encoder
    path = table(
        tmp_path / "a.csv", {"t": TIME, "a [rad]": ANGLE + noise, "n [rad/s]": factor * SPEED, "M [Nm]": TORQUE}
    )
    columns = mapped(tmp_path, "position: {column: a}\nspeed: {column: n}\ntorque: {column: M}\n")
    warnings = read_records(path, columns).provenance.warnings
    assert [finding.code for finding in warnings] == ["speed-contradicts-position"] * (said is not None)
    assert said is None or f"the recorded speed is {said} the slope" in warnings[0].text


def test_a_torque_that_brakes(tmp_path: Path) -> None:
    path = simple(tmp_path / "a.csv", **{"ActTorque [Nm]": -TORQUE})
    rest = "position: {column: ActPos}\npitch: 20 mm\n"
    message = refusal(path, mapped(tmp_path, rest + REST))
    assert message.startswith(f"{path}: the torque brakes the axis in both directions (mean power -")
    assert "turn the sign: in the mapping, torque: {column: ActTorque, sign: -1}" in message
    named = refusal(path, mapped(tmp_path, "axis: Y\n" + rest + REST))
    assert named.startswith(f"{path}, axis Y: the torque brakes the axis in both directions")
    turned = mapped(tmp_path, rest + "torque: {column: ActTorque, sign: -1}\n")
    assert read_records(path, turned).provenance.warnings == ()


def test_a_stop_that_was_cut_out_is_no_fault(tmp_path: Path) -> None:
    speed = np.linspace(100, 0, 500)
    path = table(tmp_path / "a.csv", {"t": TIME, "n [rad/s]": speed, "M [Nm]": -5 + 0.01 * (100 - speed)})
    assert read_records(path, mapped(tmp_path, "speed: {column: n}\ntorque: {column: M}\n")).provenance.warnings == ()


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (1000, r"1000 times.*\(1000: mm taken for m in the speed, or m for mm in the position\)"),
        (1e-3, r"0\.001 times.*\(0\.001: m taken for mm in the speed, or mm for m in the position\)"),
        (30 / pi, r"9\.549 times.*\(9\.549: rpm taken for rad/s in the speed\)"),
        (pi / 30, r"0\.1047 times.*\(0\.1047: rad/s taken for rpm in the speed\)"),
        (2 * pi, r"\(6\.283: radians taken for turns in the speed, or turns for radians in the position\)"),
        (60, r"\(60: per minute taken for per second in the speed\)"),
        (1 / 60, r"\(0\.01667: per second taken for per minute in the speed\)"),
        (-1, r"-1 times.*likely the sign of one of the two is wrong: sign: -1"),
        (-1000, r"likely the sign of one of the two and a unit \(1000: mm"),
        (2, r"2 times.*\(allowed: 0\.67 to 1\.5\); check units, pitch and gear of both"),
    ],
)
def test_a_speed_that_is_off_by_a_factor_is_refused(tmp_path: Path, factor: float, said: str) -> None:
    noise = 1e-4 * np.random.default_rng(1).standard_normal(500)
    path = table(
        tmp_path / "a.csv", {"t": TIME, "a [rad]": ANGLE + noise, "n [rad/s]": factor * SPEED, "M [Nm]": TORQUE}
    )
    message = refusal(path, mapped(tmp_path, "position: {column: a}\nspeed: {column: n}\ntorque: {column: M}\n"))
    assert re.search(said, message), message


def test_noise_is_no_factor(tmp_path: Path) -> None:
    """An axis at rest, whose encoder is noise: no slope to hold the speed against."""
    noise = np.random.default_rng(1).standard_normal((2, 300)) * [[1e-3], [1e-2]]
    path = table(tmp_path / "a.csv", {"t": TIME[:300], "a [rad]": noise[0], "n [rad/s]": noise[1], "M": TORQUE[:300]})
    columns = mapped(tmp_path, "position: {column: a}\nspeed: {column: n}\ntorque: {column: M, unit: N.m}\n")
    assert read_records(path, columns).provenance.warnings[0].code == "speed-contradicts-position"


@pytest.mark.parametrize(("way", "power"), [(1, 1), (-1, 1), (1, -1), (-1, -1)])
def test_one_constant_speed_in_one_direction(tmp_path: Path, way: int, power: int) -> None:
    """What varies of speed and torque is noise, which may go either way; the power tells. A weight may drive, though:
    a warning, no refusal."""
    rng = np.random.default_rng(2)
    ripple = rng.standard_normal(500)
    speed = way * (20 + 0.1 * ripple)
    torque = power * way * 1.8 - way * 0.05 * ripple
    path = table(tmp_path / "a.csv", {"t": TIME, "n [rad/s]": speed, "M [Nm]": torque})
    warnings = read_records(path, mapped(tmp_path, SPEED_ONLY)).provenance.warnings
    assert [finding.code for finding in warnings] == ["torque-against-motion"] * (power < 0)
    assert power > 0 or "(mean power -35.9 W)" in warnings[0].text


def test_a_weight_drives_in_one_direction(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", {"t": TIME, "n [rad/s]": SPEED, "M [Nm]": np.sign(SPEED) + 3.0})
    assert read_records(path, mapped(tmp_path, SPEED_ONLY)).provenance.warnings == ()


def test_a_known_load_is_taken_off(tmp_path: Path) -> None:
    """A load that pushes the axis along in both directions: the motor brakes, friction does not."""
    load = -4 * np.sign(SPEED)
    path = table(tmp_path / "a.csv", {"t": TIME, "n [rad/s]": SPEED, "M [Nm]": TORQUE + load, "L [Nm]": load})
    with_load = mapped(tmp_path, SPEED_ONLY + "load: {column: L}\n")
    assert read_records(path, with_load).provenance.warnings == ()
    assert "brakes the axis in both directions" in refusal(path, mapped(tmp_path, SPEED_ONLY))
