"""MAT files as people and programs save them: which columns they have, what these are called, what is in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_helpers import feedsim
from feedsim.files.trace import convert, read_recording, read_series
from feedsim.foundation.errors import InputError
from mat_helpers import hdf5, modelica, save

T = np.arange(40) * 1e-3
X, M = np.sin(50 * T), 3.0 + np.cos(50 * T)
SIGNALS = [
    {"values": X[:, None], "dimensions": 1, "label": "pos [mm]", "blockName": "a/Scope"},
    {"values": M[:, None], "dimensions": 1, "label": "torque", "blockName": "a/Scope"},
]
WITHOUT_LABELS = [{**signal, "label": ""} for signal in SIGNALS]
DESK = {
    "X": {"Name": "Time", "Data": T, "Unit": ""},
    "Y": [
        {"Name": '"Model Root"/"axis"/"pos"', "Data": X, "Unit": "mm", "XIndex": 1},
        {"Name": '"Model Root"/"axis"/"torque"', "Data": M, "Unit": "furlong", "XIndex": 1},
    ],
    "Description": {"General": {"DateTime": "2025-01-01"}},
}
TWO_RATES = {
    "X": [{"Data": T}, {"Data": T[::2]}],
    "Y": [{"Name": "pos", "Data": X, "XIndex": 1}, {"Name": "torque", "Data": M[::2], "XIndex": 2}],
}
# Content, all columns, and the spellings of time, position and torque.
LAYOUTS: dict[str, tuple[dict[str, Any], list[str], tuple[str, str, str]]] = {
    "matrix": (
        {"data": np.column_stack([T, X, M]), "Ts": 1e-3, "note": "x"},
        ["data(:,1)", "data(:,2)", "data(:,3)"],
        ("data(:, 1)", "data(:,2)", "data(:,3)"),
    ),
    "to file": ({"ans": np.stack([T, X, M])}, ["time", "ans(2,:)", "ans(3,:)"], ("ans(1,:)", "ans(2,:)", "ans(3,:)")),
    "structure with time": (
        {"simout": {"time": T, "signals": SIGNALS, "blockName": "a/Scope"}},
        ["time", "pos", "torque"],
        ("simout.time", "simout.signals(1).values", "torque"),
    ),
    "without labels": (
        {"simout": {"time": T, "signals": WITHOUT_LABELS}},
        ["time", "simout.signals(1).values", "simout.signals(2).values"],
        ("time", "simout.signals(1).values(:)", "simout.signals(2).values"),
    ),
    "one signal of two": (
        {"s": {"time": T, "signals": {"values": np.column_stack([X, M]), "dimensions": 2, "label": "y"}}},
        ["time", "y(:,1)", "y(:,2)"],
        ("time", "s.signals(1).values(:,1)", "y(:,2)"),
    ),
    "structure": (
        {"simout": {"time": np.zeros((0, 0)), "signals": SIGNALS}, "tout": T},
        ["pos", "torque", "tout"],
        ("tout", "pos", "simout.signals(2).values"),
    ),
    "two structures": (
        {"a": {"time": T, "signals": SIGNALS[0]}, "b": {"time": T, "signals": SIGNALS[1]}},
        ["time", "pos", "torque"],
        ("b.time", "a.signals.values", "b.signals.values"),
    ),
    "timeseries": (
        {"ts": {"Name": "pos", "Time": T, "Data": X, "TimeInfo": {"Units": "seconds"}, "DataInfo": {"Units": "mm"}},
         "M": M},
        ["time", "pos", "M"],
        ("ts.Time", "ts.Data", "M"),
    ),
    "ControlDesk": ({"exp": DESK}, ["time", "pos", "torque"], ("exp.X.Data", "exp.Y(1).Data", "exp.Y(2).Data")),
    "two rates": (
        {"exp": TWO_RATES},
        ["exp.X(1).Data", "exp.X(2).Data", "pos", "torque"],
        ("exp.X(1).Data", "pos", "exp.Y(2).Data"),
    ),
    "nested": (
        {"run": {"axis": {"t": T, "pos": X, "more": [{"m": M}, {"m": X}]}}},
        ["time", "run.axis.pos", "run.axis.more(1).m", "run.axis.more(2).m"],
        ("run.axis.t", "run.axis.pos", "run.axis.more(1).m"),
    ),
    "vectors": ({"t": T, "x": X[None, :], "M": M}, ["t", "x", "M"], ("t(:,1)", "x(1,:)", "M(:)")),
}  # fmt: skip


@pytest.mark.parametrize("form", ["5", "7.3"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_columns(layout: str, form: str, tmp_path: Path) -> None:
    content, names, (time, position, torque) = LAYOUTS[layout]
    recording = read_recording(save(tmp_path / "a.mat", content, form))
    # HDF5 has no order of its own.
    assert list(recording.names) == names if form == "5" else sorted(recording.names) == sorted(names)
    for spelling, values in ((time, T), (position, X), (torque, M[::2] if layout == "two rates" else M)):
        np.testing.assert_array_equal(recording.read([spelling])[spelling], values)
        assert recording.called(spelling) in names


def test_units_are_those_of_the_program(tmp_path: Path) -> None:
    for layout, units in (
        ("structure with time", {"time": "s", "pos": "mm", "torque": ""}),
        ("ControlDesk", {"time": "s", "pos": "mm", "torque": ""}),
        ("timeseries", {"time": "s", "pos": "mm", "M": ""}),
        ("nested", dict.fromkeys(LAYOUTS["nested"][1], "")),
    ):
        assert read_recording(save(tmp_path / "a.mat", LAYOUTS[layout][0], "5")).units == units


def test_first_row_that_is_no_time_is_a_row_like_others(tmp_path: Path) -> None:
    recording = read_recording(save(tmp_path / "a.mat", {"ans": np.stack([X, T])}, "5"))
    assert recording.names == ("ans(1,:)", "ans(2,:)")


def test_what_only_matlab_reads_is_reported_with_what_to_type(tmp_path: Path) -> None:
    import io

    import h5py

    buffer = io.BytesIO(hdf5({"t": T}))
    with h5py.File(buffer, "r+") as file:
        item = file.create_dataset("logs", data=np.zeros((1, 6), dtype=np.uint32))
        item.attrs["MATLAB_class"] = np.bytes_("timeseries")
        item.attrs["MATLAB_object_decode"] = np.int32(3)
    (tmp_path / "a.mat").write_bytes(buffer.getvalue())
    with pytest.raises(InputError) as caught:
        convert(tmp_path / "a.mat", [], tmp_path / "a.csv")
    assert (
        "'logs' (an object of class timeseries, which only MATLAB reads; there: t = logs.Time; x = logs.Data;"
        in str(caught.value)
    )


# --- Modelica ---

K = np.array([[0.0, 66.7], [T[-1], 66.7]])
VARIABLES = {
    "axis.x": ("position [m]", 2, 2),
    "axis.phi": ("angle [rad|deg]", 2, 3),
    "axis.minus_x": ("negated alias", 2, -2),
    "der(axis.w[3])": ("text [no unit]", 2, -3),
    "K_v": ("gain [1/s]", 1, 2),
    "slow": ("of a table of its own [N.m]", 3, 2),
}
SLOW = np.array([[0.0, 1.0], [0.02, 3.0], [0.03, 3.5]])


def result(path: Path, across: bool = True, time: np.ndarray = T, beyond: int = 0, dtype: str = "f8") -> Path:
    tables = [K, np.column_stack([time, np.sin(50 * time), 2 * time]), SLOW]
    path.write_bytes(modelica(time, VARIABLES, [table.astype(dtype) for table in tables], across, beyond))
    return path


@pytest.mark.parametrize("across", [True, False])
@pytest.mark.parametrize("dtype", ["f8", "f4"])
def test_modelica_tables(across: bool, dtype: str, tmp_path: Path) -> None:
    recording = read_recording(result(tmp_path / "a_res.mat", across, dtype=dtype))
    assert recording.units == {
        "time": "s", "axis.x": "m", "axis.phi": "rad", "axis.minus_x": "", "der(axis.w[3])": "", "K_v": "1/s",
        "slow": "N.m",
    }  # fmt: skip
    read = recording.read(recording.names)
    close = {"rtol": 1e-6 if dtype == "f4" else 1e-15, "atol": 1e-8 if dtype == "f4" else 0}
    for name, values in {
        "time": T, "axis.x": X, "axis.phi": 2 * T, "axis.minus_x": -X, "der(axis.w[3])": -2 * T, "K_v": 66.7 + 0 * T,
        "slow": np.where(T < 0.02, 1 + 100 * T, np.minimum(3 + 50 * (T - 0.02), 3.5)),
    }.items():  # fmt: skip
        np.testing.assert_allclose(read[name], values, **close)
    assert recording.scalar("K_v") == pytest.approx(66.7, rel=1e-6)


@pytest.mark.parametrize(("beyond", "last"), [(-1, np.nan), (0, 3.5), (1, 3.5 + 50 * (T[-1] - 0.03))])
def test_beyond_the_end_of_a_table(beyond: int, last: float, tmp_path: Path) -> None:
    series = read_series(result(tmp_path / "a.mat", beyond=beyond))
    np.testing.assert_allclose(series["slow"][-1], last, rtol=1e-12)


def test_rows_at_events(tmp_path: Path) -> None:
    """Series keep both rows of an instant, as those of CSV files do; records have the last one."""
    time = np.sort(np.append(T, T[[10, 10, 20]]))
    path = result(tmp_path / "a.mat", time=time)
    assert read_series(path).time.tolist() == time.tolist()
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.read(["time"])["time"], T)
    assert recording.notes[0].code == "rows-left-out"
    assert "3 of 43 rows" in recording.notes[0].text
    assert len(convert(path, [], tmp_path / "a.csv")) == len(T)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("axis.x", ("", 2, 9)), "'axis.x' is to be column 9 of data_2, which has 3"),
        (("axis.x", ("", 7, 1)), "'axis.x' is to be column 1 of data_7, which is missing"),
    ],
)
def test_modelica_tables_that_do_not_fit(
    change: tuple[str, tuple[str, int, int]], message: str, tmp_path: Path
) -> None:
    content = modelica(T, {**VARIABLES, change[0]: change[1]}, [K, np.column_stack([T, X, M]), SLOW], True)
    (tmp_path / "a.mat").write_bytes(content)
    with pytest.raises(InputError, match=f"a.mat: {message}"):
        read_recording(tmp_path / "a.mat")


# --- all commands alike ---


def test_commands_read_results_of_modelica_alike(fmus: Path, tmp_path: Path) -> None:
    time = np.arange(2000) * 1e-3
    x = 5e-3 * np.sin(2 * np.pi * time) * np.minimum(1, 2 * time)
    variables = {"Z.x_a": ("[m]", 2, 2), "Z.x_s": ("[m]", 2, 3), "Z.n_a": ("[rad/s]", 2, 4), "Z.M_a": ("[N.m]", 2, 5)}
    speed = np.gradient(x, time) * 2 * np.pi / 20e-3
    torque = 2.0 * np.sign(speed) + 0.02 * speed + 0.01 * np.gradient(speed, time)
    data = np.column_stack([time, x, x, speed, torque])
    (tmp_path / "run.mat").write_bytes(modelica(time, variables, [np.array([[0.0], [time[-1]]]), data], True))
    assert feedsim("tools", "convert", "run.mat", "--out", "run.csv", fmus=fmus, cwd=tmp_path).returncode == 0
    machine = Path(__file__).resolve().parents[2] / "scenarios" / "machines" / "test_centre"
    for words in (
        ["compare", "run.mat", "run.csv"],
        ["show", "run.mat", "run.csv", "--out", "shown"],
        ["identify", "run.mat", "--axes", "Z", "--machine", str(machine), "--out", "identified"],
        ["replay", "run.mat", "--axes", "Z", "--machine", str(machine), "--out", "replayed"],
    ):
        done = feedsim(*words, fmus=fmus, cwd=tmp_path)
        assert done.returncode == 0, (words, done.stderr, done.stdout)
