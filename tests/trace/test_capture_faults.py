"""Captures with something the matter: the cause is named, and where the rest of the record tells the pitch, it does."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from capture_helpers import CYCLE, ROWS, SIGNALS, axis_signals, content
from feedsim.estimation.identify import read_records
from feedsim.files.columns import Columns
from feedsim.files.trace import capture, read_recording
from feedsim.files.trace import capture as json_stream
from feedsim.files.trace.recording import Recording
from feedsim.foundation.errors import InputError

Signals = dict[str, Any]


def written(tmp_path: Path, *axes: Signals) -> Path:
    path = tmp_path / "capture.json"
    names = ("X1|1", "Y1|2", "Z1|3")
    path.write_text(json.dumps(content(dict(zip(names, axes, strict=False)))))
    return path


def noisy(pitch: float = 10.0, sign: int = -1, turned: float = 1.0) -> Signals:
    """Not the same sine for all axes: `turned` is the frequency of a second motion in it."""
    signals = axis_signals(pitch, sign)
    t = CYCLE * np.arange(ROWS)
    x = signals["ENC_POS"] + 20 * np.sin(2 * np.pi * (1.7 + turned) * t)
    v = np.gradient(x, t)
    turning = 2 * np.pi * v / pitch
    torque = 0.02 * np.gradient(turning, t) + 3.0 * np.sign(turning)
    return {"DES_POS": x, "ENC_POS": x, "CMD_SPEED": v, "TORQUE": sign * torque, "CURRENT": sign * torque / 1.4,
            "POWER": torque * turning}  # fmt: skip


def refused(path: Path, axis: str = "X") -> str:
    with pytest.raises(InputError) as caught:
        read_records(path, axis=axis)
    return str(caught.value)


def changed(signals: Signals, **new: Any) -> Signals:
    return signals | new


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (lambda s: {"TORQUE": np.zeros(ROWS)}, "TORQUE is 0 throughout"),
        (lambda s: {"POWER": np.zeros(ROWS)}, "POWER is 0 throughout"),
        (lambda s: {"ENC_POS": np.full(ROWS, 3.0)}, "it does not move"),
        (
            lambda s: {"POWER": np.random.default_rng(1).normal(size=ROWS)},
            "POWER is not TORQUE times the motor's speed",
        ),
    ],
)
def test_the_cause_stands_where_the_pitch_is_asked_for(
    tmp_path: Path, change: Callable[[Signals], Signals], cause: str
) -> None:
    signals = noisy()
    said = refused(written(tmp_path, signals | change(signals)))
    assert "its pitch is needed" in said
    assert f"The record itself does not give it: {cause}" in said


def test_a_signal_that_is_not_there(tmp_path: Path) -> None:
    signals = noisy()
    del signals["POWER"]
    assert "does not give it: the file has no POWER of it" in refused(written(tmp_path, signals))


@pytest.mark.parametrize("signal", ["TORQUE", "POWER", "ENC_POS"])
def test_swapped_axes(tmp_path: Path, signal: str) -> None:
    one, other = noisy(10.0, -1, 1.0), noisy(20.0, 1, 2.3)
    one[signal], other[signal] = other[signal], one[signal]
    said = refused(written(tmp_path, one, other))
    assert f"with {signal}|2 of Y1 POWER is TORQUE times the motor's speed, with {signal}|1 it is not" in said
    assert "likely swapped" in said


def axis(path: Path) -> tuple[Recording, Any]:
    recording = read_recording(path)
    return recording, recording.axes[0]


@pytest.mark.parametrize("signal", ["TORQUE", "POWER", "ENC_POS"])
def test_spikes_are_told_and_the_pitch_is_that_of_the_rest(tmp_path: Path, signal: str) -> None:
    signals = noisy()
    signals[signal] = signals[signal].copy()
    signals[signal][[333, 700]] += 60 * np.ptp(signals[signal])
    _, found = axis(written(tmp_path, signals))
    assert (found.pitch, found.sign) == (10.0, -1)
    assert found.doubts == (f"{signal} has spikes in 2 rows, the first at {333 * CYCLE:.6g} s",)


@pytest.mark.parametrize(("signal", "limit"), [("TORQUE", 0.6), ("POWER", 0.25)])
def test_a_signal_that_is_cut_off(tmp_path: Path, signal: str, limit: float) -> None:
    signals = noisy()
    end = limit * float(np.abs(signals[signal]).max())
    signals[signal] = np.clip(signals[signal], -end, end)
    _, found = axis(written(tmp_path, signals))
    assert (found.pitch, found.sign) == (10.0, -1)
    assert len(found.doubts) == 1
    assert found.doubts[0].startswith(f"{signal} is cut off at {end:.6g} in ")
    read = read_records(written(tmp_path, signals), axis="X")
    (faulty,) = (finding for finding in read.provenance.warnings if finding.code == "capture-faulty")
    assert faulty.text.endswith("X1 (|1): " + found.doubts[0])


def test_a_limit_of_the_drive_is_no_fault_of_the_record(tmp_path: Path) -> None:
    signals = noisy()
    end = 0.6 * float(np.abs(signals["TORQUE"]).max())
    signals["TORQUE"] = np.clip(signals["TORQUE"], -end, end)
    signals["POWER"] = -signals["TORQUE"] * 2 * np.pi * np.gradient(signals["ENC_POS"], CYCLE) / 10.0
    _, found = axis(written(tmp_path, signals))
    assert (found.pitch, found.doubts) == (10.0, ())


@pytest.mark.parametrize(("unit", "size"), [("in", 25.4), ("m", 1000.0)])
def test_positions_in_another_unit(tmp_path: Path, unit: str, size: float) -> None:
    signals = noisy()
    signals |= {name: signals[name] / size for name in ("DES_POS", "ENC_POS", "CMD_SPEED")}
    path = written(tmp_path, signals)
    recording, found = axis(path)
    assert found.pitch == pytest.approx(10.0)
    assert (recording.units["ENC_POS|1"], recording.units["CMD_SPEED|1"]) == (unit, f"{unit}/s")
    assert f"positions are taken as {unit}, which makes it 10 mm" in found.doubts[0]
    (sound,) = read_records(written(tmp_path, noisy()), axis="X").records
    (read,) = read_records(written(tmp_path, signals), axis="X").records
    assert read.angle is not None
    assert sound.angle is not None
    np.testing.assert_allclose(read.angle, sound.angle, rtol=1e-9, atol=1e-9)


def test_torque_in_per_cent_contradicts_the_current(tmp_path: Path) -> None:
    """Of 12 N.m: the pitch would come out 8.3 times as large."""
    signals = noisy()
    signals["TORQUE"] = 100 * signals["TORQUE"] / 12
    path = written(tmp_path, signals)
    recording, found = axis(path)
    assert (found.pitch, recording.units["TORQUE|1"]) == (None, "")
    said = refused(path)
    assert "TORQUE is 11.7 for an A of CURRENT; motors of feed axes have 0.05 to 5 N.m/A" in said
    assert "likely in per cent of a torque" in said
    assert "unit: N.m}" not in said
    mapping = tmp_path / "columns.yaml"
    mapping.write_text(
        "pitch: 10 mm\ntorque: {column: TORQUE|1, factor: 0.12 N.m, sign: -1}\nposition: {column: ENC_POS|1}\n"
    )
    from feedsim.files.columns import load_columns

    columns: Columns = load_columns(mapping)
    (read,) = read_records(path, columns).records
    (sound,) = read_records(written(tmp_path, noisy()), axis="X").records
    np.testing.assert_allclose(read.torque, sound.torque, rtol=1e-9)


def test_sound_axes_have_no_doubts(tmp_path: Path) -> None:
    for signals in (noisy(), axis_signals(10.0, 1), axis_signals(360.0, -1), axis_signals(7.3, 1)):
        _, found = axis(written(tmp_path, signals))
        assert found.doubts == ()
        assert found.why == ""


# --- large files, and how they are written ---


def test_a_file_is_read_row_by_row(tmp_path: Path) -> None:
    """Whatever its parts' order and blanks are; cut at any character; names in Windows' or Unicode's characters."""
    signals = noisy()
    whole = content({"X1|1": signals})
    sound = read_recording(written(tmp_path, signals))
    behind = {"Payload": whole["Payload"], "More": [{"a": [1, {"b": None}]}, "x", -1.5e3], "Header": whole["Header"]}
    texts = [json.dumps(behind), json.dumps(whole, indent=3), json.dumps(whole, separators=(",", ":"))]
    for text in texts:
        for encoding in ("utf-8", "utf-8-sig", "utf-16"):
            path = tmp_path / "other.json"
            path.write_text(text, encoding=encoding)
            recording = read_recording(path)
            assert recording.names == sound.names
            for name in sound.names:
                np.testing.assert_array_equal(recording.read([name])[name], sound.read([name])[name])


@pytest.mark.parametrize("chunk", [1, 2, 7, 64, 1000])
def test_a_file_is_cut_anywhere(tmp_path: Path, chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    from feedsim.files.trace import capture as json_stream

    sound = read_recording(written(tmp_path, noisy()))
    expected = {name: sound.read([name])[name] for name in sound.names}
    monkeypatch.setattr(json_stream, "CHUNK", chunk)
    found = read_recording(written(tmp_path, noisy()))
    for name, values in expected.items():
        np.testing.assert_array_equal(found.read([name])[name], values)


def test_names_in_windows_characters(tmp_path: Path) -> None:
    data = content({"Xµ|1": noisy()})
    path = tmp_path / "capture.json"
    path.write_bytes(json.dumps(data, ensure_ascii=False).encode("cp1252"))
    assert read_recording(path).axes[0].name == "Xµ"


@pytest.mark.parametrize("cut", [1, 30, -1, -2, -40, -3000])
def test_a_file_that_ends_early_is_refused(tmp_path: Path, cut: int) -> None:
    path = written(tmp_path, noisy())
    text = path.read_text()
    path.write_text(text[:cut])
    with pytest.raises(InputError, match=r"is no JSON file that can be read: .* is expected at character"):
        read_recording(path)
    path.write_text(text + "x")
    with pytest.raises(InputError, match="the end is expected at character"):
        read_recording(path)


def test_a_file_takes_the_memory_of_its_numbers(tmp_path: Path) -> None:
    """Objects of Python take 9 times the file; numbers 8 bytes for about 12 characters, twice while the array grows."""
    import tracemalloc

    signals = {name: np.tile(values, 12) for name, values in noisy().items()}
    count = 12 * ROWS
    signals["ENC_POS"] = signals["ENC_POS"] + 0.123456789 * np.arange(count)
    path = tmp_path / "capture.json"
    data = content({"X1|1": {name: values for name, values in signals.items()}}, 5000 + np.arange(count))
    path.write_text(json.dumps(data))
    numbers = 8 * count * (len(SIGNALS) + 1)
    read_recording(path)  # what is imported and kept once
    tracemalloc.start()
    read_recording(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # Numbers, up to as much again of columns by themselves while pitch is looked for, and the text of a piece in hand.
    assert peak < 4 * numbers + 12e6
    assert numbers > 0.6e6


def test_more_numbers_than_are_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file of a gigabyte and a half, in small."""
    path = written(tmp_path, noisy())
    width = len(SIGNALS) + 1
    monkeypatch.setattr(capture, "MOST_NUMBERS", ROWS * width)
    read_recording(path)
    monkeypatch.setattr(capture, "MOST_NUMBERS", ROWS * width - 1)
    with pytest.raises(InputError, match=rf"row {ROWS}: more than [\d,]+ numbers, rows of {width} signals; allowed: "):
        read_recording(path)


def test_more_blocks_than_are_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = content({"X1|1": noisy()})
    data["Payload"] = [message for message in data["Payload"] if "HFData" in message]
    data["Payload"] += [{"HFBlockEvent": {"HFProbeCounter": k, "GCode": "G1 X1"}} for k in range(3)]
    path = tmp_path / "capture.json"
    path.write_text(json.dumps(data))
    monkeypatch.setattr(capture, "MOST_BLOCKS", 3)
    assert len(capture.read_capture(path).marks) == 3
    monkeypatch.setattr(capture, "MOST_BLOCKS", 2)
    with pytest.raises(InputError, match="more than 2 NC blocks"):
        read_recording(path)


@pytest.mark.parametrize("counter", [10**400, -(10**400), float("nan"), float("inf"), "7", None])
def test_a_block_without_a_place_is_left_out(tmp_path: Path, counter: object) -> None:
    data = content({"X1|1": noisy()})
    data["Payload"] = [message for message in data["Payload"] if "HFData" in message]
    data["Payload"] += [{"HFBlockEvent": {"HFProbeCounter": at, "GCode": "G1 X1"}} for at in (counter, 12)]
    path = tmp_path / "capture.json"
    path.write_text(json.dumps(data))
    assert len(capture.read_capture(path).marks) == 1


@pytest.mark.parametrize("key", ["Header", "Notes"])
def test_a_value_that_does_not_end_is_not_taken_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, key: str
) -> None:
    """What is no row is read as a whole, up to a length: a list of numbers outside Payload fills no memory."""
    path = tmp_path / "capture.json"
    path.write_text(json.dumps(content({"X1|1": noisy()}) | {key: [0.125] * 100_000}))
    monkeypatch.setattr(json_stream, "CHUNK", 1 << 10)
    monkeypatch.setattr(json_stream, "MAX_VALUE_LENGTH", 1 << 14)
    with pytest.raises(InputError, match=r"the value at character \d+ does not end within 16,384 characters"):
        read_recording(path)


@pytest.mark.parametrize("cycle", [1e-300, 0.0009, 1001, 10**400, True])
def test_a_cycle_that_no_control_has(tmp_path: Path, cycle: object) -> None:
    data = content({"X1|1": noisy()})
    data["Header"]["CycleTimeMs"] = cycle
    path = tmp_path / "capture.json"
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"CycleTimeMs is .{1,70}; a number of milliseconds, 0\.001 to 1000, is"):
        read_recording(path)


def test_a_position_that_jumps(tmp_path: Path) -> None:
    """A counter that was set anew, or two records in one file."""
    signals = noisy()
    signals["ENC_POS"] = signals["ENC_POS"] + np.where(np.arange(ROWS) < 600, 0.0, 5000.0)
    _, found = axis(written(tmp_path, signals))
    assert (found.pitch, found.doubts) == (10.0, (f"ENC_POS jumps in 1 rows, the first at {600 * CYCLE:.6g} s",))
