"""Captures of a SINUMERIK control: clock, units, and what power tells of pitch and direction."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from capture_helpers import CYCLE, ROWS, SIGNALS, axis_signals, content
from feedsim.estimation.identify import read_records
from feedsim.files.trace import convert, read_csv, read_recording
from feedsim.foundation.errors import InputError


def written(tmp_path: Path, data: object) -> Path:
    path = tmp_path / "capture.json"
    path.write_text(json.dumps(data))
    return path


@pytest.mark.parametrize(("pitch", "sign"), [(10.0, -1), (20.0, 1), (7.3, -1)])
def test_pitch_and_direction_follow_from_power(tmp_path: Path, pitch: float, sign: int) -> None:
    path = written(tmp_path, content({"X1|1": axis_signals(5.0, 1), "Y1|2": axis_signals(pitch, sign)}))
    recording = read_recording(path)
    found = recording.axes[1]
    assert (found.name, found.number, found.sign) == ("Y1", "2", sign)
    assert found.pitch == pytest.approx(pitch, rel=1e-12 if pitch != 7.3 else 1e-3)
    assert recording.units["ENC_POS|2"] == "mm"
    assert recording.units["CMD_SPEED|2"] == "mm/s"
    assert recording.marks[0].time == pytest.approx(50 * CYCLE)
    assert recording.marks[0].text == "N10 G0 Y100"
    for called in ("Y", "Y1", "2"):
        read = read_records(path, axis=called)
        (record,) = read.records
        assert read.provenance.pitch == pytest.approx(found.pitch * 1e-3)
        # Torque drives the motion in the position's own direction, whatever the recorded sign.
        assert record.torque is not None
        assert record.angle is not None
        assert record.torque @ np.gradient(record.angle) > 0
        assert "pitch-by-power" in [finding.code for finding in read.provenance.warnings]


def test_a_gap_of_the_counter_is_a_gap_of_the_time(tmp_path: Path) -> None:
    counter = np.arange(ROWS) + np.where(np.arange(ROWS) >= 600, 500, 0)
    path = written(tmp_path, content({"Y1|2": axis_signals(10.0, 1)}, counter))
    read = read_records(path, axis="Y")
    assert [len(record.time) for record in read.records] == [600, 400]
    assert read.records[1].time[0] == pytest.approx(1100 * CYCLE)
    assert "rows-missing" in [finding.code for finding in read.provenance.warnings]


def test_speeds_that_are_no_slopes_have_no_unit(tmp_path: Path) -> None:
    path = written(tmp_path, content({"Y1|2": axis_signals(10.0, 1, per_minute=True)}))
    assert read_recording(path).units["CMD_SPEED|2"] == ""


def test_a_turning_axis_counts_degrees(tmp_path: Path) -> None:
    path = written(tmp_path, content({"C1|4": axis_signals(360.0, -1)}))
    assert read_recording(path).units["ENC_POS|4"] == "deg"
    with pytest.raises(InputError, match="rotary axes are not identified"):
        read_records(path, axis="C")


def test_an_axis_that_stands_tells_no_pitch(tmp_path: Path) -> None:
    path = written(tmp_path, content({"Y1|2": axis_signals(10.0, 1, amplitude=0.0)}))
    assert read_recording(path).axes[0].pitch is None
    with pytest.raises(InputError, match="its pitch is needed"):
        read_records(path, axis="Y")


def test_all_signals_become_a_csv_file(tmp_path: Path) -> None:
    path = written(tmp_path, content({"X1|1": axis_signals(5.0, 1), "Y1|2": axis_signals(10.0, -1)}))
    convert(path, [], tmp_path / "out.csv")
    trace = read_csv(tmp_path / "out.csv")
    assert set(trace.columns) == {f"{signal}|{number}" for signal in SIGNALS for number in (1, 2)}
    assert trace.unit("POWER|2") == "W"
    assert trace.time[1] == CYCLE


def _without(*keys: str) -> dict[str, Any]:
    data = content({"Y1|2": axis_signals(10.0, 1)})
    part = data
    for key in keys[:-1]:
        part = part[key]
    del part[keys[-1]]
    return data


def _with_row(row: object) -> dict[str, Any]:
    data = content({"Y1|2": axis_signals(10.0, 1)})
    data["Payload"][0]["HFData"][3] = row
    return data


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ([1, 2], "is no capture of a control: Header is missing"),
        ({"Header": {}}, "Header.SignalListHFData has no CYCLE"),
        (_without("Payload"), "Payload is missing"),
        (_without("Header", "CycleTimeMs"), "Header.CycleTimeMs is None; a number of milliseconds"),
        ({**content({}), "Payload": [7]}, "Payload, message 1: no list of rows"),
        ({**content({}), "Payload": []}, "0 rows of HFData; at least 2"),
        (_with_row([5003, 1.0]), "row 4: 2 values; Header.SignalListHFData has 7 signals"),
        (_with_row("text"), "row 4: no list"),
        (_with_row([5003, 0, None, 0, 0, 0, 0]), "row 4: ENC_POS|2 is None, no finite number"),
        (_with_row([5003, 0, "off", 0, 0, 0, 0]), "row 4: ENC_POS|2 is 'off', no finite number"),
        (_with_row([5002, 0, 0, 0, 0, 0, 0]), "row 4: CYCLE is 5002 behind 5002; it must grow"),
    ],
)
def test_files_that_are_refused(tmp_path: Path, data: object, message: str) -> None:
    with pytest.raises(InputError) as caught:
        read_recording(written(tmp_path, data))
    assert message in str(caught.value)


def test_which_axis_is_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path, content({"X1|1": axis_signals(5.0, 1), "Y1|2": axis_signals(10.0, -1)}))
    with pytest.raises(InputError, match=r"which axis is meant\?; there is X1 \(\|1\), Y1 \(\|2\)"):
        read_records(path)
    with pytest.raises(InputError, match=r"nothing of axis 'Z'; there is X1"):
        read_records(path, axis="Z")


REMARKS = "Drive trace;Z axis\nserial;123;4\n\n"
LOG = "time [ms];x [µm];n [U/min]\n0;0,5;1\n2;1;1,5\n4;1,5;1\n"


def test_remarks_ahead_of_the_header_and_old_encodings(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes((REMARKS + LOG).encode("cp1252"))
    recording = read_recording(path)
    assert recording.names == ("time", "x", "n")
    assert recording.units["x"] == "µm"
    assert recording.read(["x"])["x"].tolist() == [0.5, 1, 1.5]
    (note,) = recording.notes
    assert (note.code, note.place) == ("header-below-remarks", f"{path}:4")
    assert recording.row(0).endswith("log.csv:5")
    path.write_text(LOG, encoding="utf-8")
    assert read_recording(path).notes == ()


@pytest.mark.skipif("FEEDSIM_CAPTURE" not in os.environ, reason="FEEDSIM_CAPTURE: a recorded capture")
def test_a_real_control() -> None:
    """Pitches 10, 10 and 5 mm; torque of X and Y against the position, that of the sixth axis along it."""
    found = {axis.number: axis for axis in read_recording(os.environ["FEEDSIM_CAPTURE"]).axes}
    assert {number: (found[number].pitch, found[number].sign) for number in "126"} == {
        "1": (10.0, -1), "2": (10.0, -1), "6": (5.0, 1)
    }  # fmt: skip
    assert found["4"].rotary


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        ("name", "TORQUE|" + "9" * 5000, "a name of 5007 characters, 'TORQUE|9"),
        ("CYCLE", 10**400, "row 2: CYCLE is 1000"),
        ("ENC_POS|1", 1e300, "row 2: ENC_POS|1 is 1e+300; allowed: up to 1e+100"),
        ("TORQUE|1", 1e101, "row 2: TORQUE|1 is 1e+101; allowed: up to 1e+100"),
    ],
    ids=["name", "counter", "position", "torque"],
)
def test_numbers_that_nothing_records(tmp_path: Path, place: str, value: Any, words: str) -> None:
    """They are refused in a short sentence before anything is calculated with them."""
    data = content({"X1|1": axis_signals(10.0, 1)})
    signals = data["Header"]["SignalListHFData"]
    if place == "name":
        next(each for each in signals if each["Address"] == "TORQUE|1")["Address"] = value
    else:
        data["Payload"][0]["HFData"][1][[each["Address"] for each in signals].index(place)] = value
    with pytest.raises(InputError) as raised:
        read_recording(written(tmp_path, data))
    assert words in str(raised.value)
    assert len(str(raised.value)) < 400


def test_what_no_sensor_resolves_is_zero(tmp_path: Path) -> None:
    data = content({"X1|1": axis_signals(10.0, 1)})
    column = [each["Address"] for each in data["Header"]["SignalListHFData"]].index("CURRENT|1")
    for row in data["Payload"][0]["HFData"]:
        row[column] = 1e-310
    recording = read_recording(written(tmp_path, data))
    assert not recording.read(["CURRENT|1"])["CURRENT|1"][:400].any()
