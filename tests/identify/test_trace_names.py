"""Columns of recorded traces that are found by their names."""

from __future__ import annotations

import importlib.util
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim.estimation.identify.read import read_records
from feedsim.estimation.identify.signals import _BY_KEY, ALIASES, alias_of
from feedsim.scenario import Machine, load_machine
from record_helpers import ANGLE, DIGITS, K_T, LEAD, PITCH, SPEED, TIME, TORQUE, mapped, only, refusal, simple, table

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def machine() -> Machine:
    return load_machine(ROOT / "scenarios" / "machines" / "test_centre")


# --- columns found by their names -----------------------------------------------------------------------------------


def own(axis: str, *names: str) -> dict[str, Any]:
    every = {
        "x_s [m]": LEAD * ANGLE, "x_a [m]": LEAD * ANGLE, "n_a [rad/s]": SPEED, "i_q [A]": TORQUE / K_T,
        "M_a [N.m]": TORQUE, "u_q [V]": ANGLE,
    }  # fmt: skip
    return {f"{axis}.{name}": values for name, values in every.items() if name.split()[0] in names}


def test_a_log_of_feedsim(tmp_path: Path, machine: Machine) -> None:
    path = table(
        tmp_path / "log.csv",
        {"time [s]": TIME, **own("X", "x_a", "i_q"), **own("Z", "x_s", "x_a", "n_a", "i_q", "u_q")},
    )
    found = read_records(path, axis="Z", machine=machine)
    record = only(found)
    K_t, pitch = machine.axes["Z"].drive.K_t, machine.axes["Z"].pitch
    np.testing.assert_allclose(record.torque, K_t * TORQUE / K_T, **DIGITS)
    np.testing.assert_allclose(record.angle, ANGLE * PITCH / pitch, **DIGITS)
    np.testing.assert_allclose(record.speed, SPEED, **DIGITS)
    assert record.setpoint is not None
    assert (found.provenance.axis, found.provenance.torque_constant) == ("Z", K_t)
    message = refusal(path, machine=machine)
    assert message == f"{path}:1: the axes X, Z are in the file; which one is meant?"
    assert f"{path}:1: nothing of axis 'Y'; there is X, Z" in refusal(path, axis="Y", machine=machine)
    assert "the machine has no axis 'z'; did you mean 'Z'?" in refusal(path, axis="z", machine=machine)


def test_the_torque_is_taken_before_the_current(tmp_path: Path) -> None:
    path = table(tmp_path / "result.csv", {"time [s]": TIME, **own("Z", "n_a", "i_q", "M_a")})
    found = read_records(path)
    np.testing.assert_allclose(only(found).torque, TORQUE, **DIGITS)
    assert found.provenance.axis == "Z"
    (finding,) = found.provenance.warnings
    assert (finding.code, finding.severity, finding.place) == ("column-not-used", "note", str(path))
    assert "'Z.i_q' is not used; the torque 'Z.M_a' is" in finding.text


def test_a_log_without_what_is_needed(tmp_path: Path) -> None:
    path = table(tmp_path / "log.csv", {"time [s]": TIME, **own("Z", "x_s", "u_q")})
    assert (
        f"{path}:1: no column is called like a torque or current nor a position or speed of axis Z; known are Z.x_s; "
        "there is time, Z.x_s, Z.u_q; name the columns in a mapping file: torque: {column: ..., unit: N.m}; "
        "position: {column: ..., unit: mm}"
    ) == refusal(path)


@pytest.mark.parametrize(
    ("position", "speed", "torque"),
    [
        ("Lageistwert_Z [mm]", "Drehzahlistwert_Z [U/min]", "Momentenbildender Stromistwert Z [A]"),
        ("Z ENC1_POS [mm]", "R0063 [1/min]", "r0078[0]"),
        ("Axis 1.ActPos [mm]", "Axis 1.ActVelo [rad/s]", "Axis 1.ActTorque [Nm]"),
        ("joint.2.motor-pos-fb [mm]", "actual velocity [rpm]", "torque actual value [N.m]"),
        ("Actual pos [mm]", "V (act rpm) [mm/min]", "I nominal [A]"),
        ("S-0-0051 [mm]", "S-0-0040 [rpm]", "M_actual [Nm]"),
        ("0x6064 [mm]", "velocity actual value [rpm]", "CURRENT|3 [A]"),
        ("ACTUAL POSITION (Z) [mm]", "Actual Speed Motor Z [rpm]", "torque-generating_current [A]"),
    ],
)
def test_names_of_drives(tmp_path: Path, machine: Machine, position: str, speed: str, torque: str) -> None:
    scale = 1e3 * machine.axes["Z"].pitch * 60 / (2 * pi) if "mm/min" in speed else 30 / pi
    scale = 1.0 if "rad/s" in speed else scale
    place = 1e3 * machine.axes["Z"].I_P * ANGLE
    path = table(
        tmp_path / "a.csv",
        {"Time [ms]": 1e3 * TIME, "X ActPos [mm]": TIME, position: place, speed: SPEED * scale, torque: TORQUE},
    )
    if "r0078" in torque:  # a bracket with an index is no unit
        assert "column 'r0078' has no unit; give it: unit: A; mapping: current: {column: r0078, unit: A}" in refusal(
            path, axis="Z", machine=machine
        )
        return
    record = only(read_records(path, axis="Z", machine=machine))
    np.testing.assert_allclose(record.angle, ANGLE, **DIGITS)
    np.testing.assert_allclose(record.speed, SPEED, **DIGITS)
    is_current = torque.endswith("[A]")
    np.testing.assert_allclose(record.torque, TORQUE * (machine.axes["Z"].drive.K_t if is_current else 1), **DIGITS)


def test_aliases_are_told_apart_and_documented() -> None:
    assert len(_BY_KEY) == len(ALIASES)  # none equals another once case and signs are gone
    # By its path: tests have a folder of that name.
    described = importlib.util.spec_from_file_location("site_reference", ROOT / "docs" / "site" / "reference.py")
    assert described is not None
    assert described.loader is not None
    reference = importlib.util.module_from_spec(described)
    described.loader.exec_module(reference)
    page = reference.signal_names()  # docs/traces.md leads there
    for alias in ALIASES:
        assert f"`{alias.name}`" in page, alias.name
        found = alias_of(alias.name, "Z")
        assert found is not None
        assert found.role == alias.role


@pytest.mark.parametrize(
    "name", ["ActPosX", "foo", "X.ActPos", "ActPos_Y", "Lageistwert_S", "r0079", "Z", "1", "Z.x_a"]
)
def test_no_alias(name: str) -> None:
    assert alias_of(name, "Z") is None


def test_names_that_are_not_clear(tmp_path: Path, machine: Machine) -> None:
    path = table(
        tmp_path / "a.csv", {"t [s]": TIME, "ENC1_POS|3 [mm]": ANGLE, "ENC2_POS|3 [mm]": ANGLE, "TORQUE|3 [Nm]": TORQUE}
    )
    assert refusal(path, axis="Z", machine=machine) == (
        f"{path}:1: 2 columns may be the position: ENC1_POS|3, ENC2_POS|3; say which in a mapping file: "
        'position: {column: "ENC1_POS|3"}'
    )
    # Of no named axis both may be it; of a named one the other axis's is none.
    path = simple(tmp_path / "b.csv", **{"X.ActPos [mm]": ANGLE})
    assert "2 columns may be the position: ActPos, X.ActPos" in refusal(path)
    np.testing.assert_allclose(
        only(read_records(path, axis="Z", machine=machine)).angle, ANGLE * PITCH / machine.axes["Z"].pitch, **DIGITS
    )
    path = table(tmp_path / "c.csv", {"TIME [s]": TIME, "T [s]": TIME, "ActPos [mm]": ANGLE, "ActTorque [Nm]": TORQUE})
    assert "2 columns may be the time: TIME, T; say which in a mapping file: time: {column: TIME}" in refusal(path)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("ActPos", "column 'ActPos' has no unit; give it: unit: mm; mapping: position: {column: ActPos, unit: mm}"),
        ("ActPos [digits/s]", "'digits/s', the unit of column 'ActPos', is not known here; give it: unit: mm"),
        ("ActPos [kg]", "column 'ActPos' in kg: the values are a mass; a length or an angle is expected here"),
        ("ActPos [%]", "column 'ActPos' in %: the values are a plain number; a length or an angle is expected here"),
    ],
)
def test_units_of_found_columns(tmp_path: Path, header: str, message: str) -> None:
    path = table(tmp_path / "a.csv", {"t [s]": TIME, header: ANGLE, "ActTorque [Nm]": TORQUE})
    found = refusal(path)
    assert f"{path}:1: {message}" in found


def test_no_time(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", {"ActPos [mm]": ANGLE, "ActTorque [Nm]": TORQUE})
    assert "a.csv:1: no column of time; there is ActPos, ActTorque; name it in a mapping file: time: {column: ..." in (
        refusal(path)
    )
    path = table(tmp_path / "b.csv", {"stamp [ms]": 1e3 * TIME, "n [rad/s]": SPEED, "M [Nm]": TORQUE})
    record = only(read_records(path, mapped(tmp_path, "speed: {column: n}\ntorque: {column: M}\n")))
    assert record.interval == pytest.approx(0.002)
