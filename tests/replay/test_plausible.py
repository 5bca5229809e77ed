"""Records that cannot be those of an axis that follows its setpoint: both commands say so, and why."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from drive_helpers import COLUMNS, MACHINES, logged
from feedsim.cli import main
from feedsim.estimation.identify import Record
from feedsim.estimation.replay.closed_loop import AxisRecord
from feedsim.estimation.replay.drive import implausible
from feedsim.files.trace import Trace, read_csv, write_csv
from feedsim.files.trace.trace import Array


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("log")
    (folder / "columns.yaml").write_text(COLUMNS)
    return logged(folder, "X", "M_a: 2 %, x_a: 0.1 um", machine=MACHINES / "one_axis")


def faulty(log: Path, path: Path, column: str, changed: Callable[[Array], Array]) -> None:
    own = read_csv(log)
    columns = {name: changed(np.asarray(own[name])) if name == column else own[name] for name in own}
    write_csv(path, Trace(own.time, columns, own.units))


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize(
    ("column", "changed", "said"),
    [
        ("X.x_a", lambda x: -x, "times as far as its setpoint: one of the two lacks sign: -1"),
        ("X.x_a", lambda x: x / 25.4, "a factor of 25.4 lies between inch and mm"),
        ("X.x_s", lambda x: x / 25.4, "a factor of 25.4 lies between inch and mm"),
        ("X.x_s", lambda x: 2 * x, "a factor of 2 lies between diameter and radius"),
        ("X.x_a", lambda x: x + 30e-3, "is +30 mm off its setpoint throughout"),
        ("X.x_a", lambda x: x + 0.5e-3 * (np.arange(len(x)) > 130), "jumps by +0."),
        ("X.x_a", lambda x: x + 2e-3 * (np.arange(len(x)) == 130), "to the next row and 1 more time,"),
        ("X.x_a", lambda x: np.full_like(x, x[0]), "does not follow its setpoint: it moves by 0 mm"),
        ("X.x_a", lambda x: x[::-1], "does not follow its setpoint"),
        ("X.M_a", lambda M: 0 * M, "the recorded torque is 0 N.m in all rows"),
    ],
)
def test_a_record_that_cannot_be(
    column: str, changed: Callable[[Array], Array], said: str, log: Path, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """A replay ends as WRONG, an identification with status 2 and nothing written. Neither names a file of its own."""
    faulty(log, tmp_path / "log.csv", column, changed)
    words = [str(tmp_path / "log.csv"), "--axes", "X", "--columns", str(log.parent / "columns.yaml"), "--quiet"]
    machine = ["--machine", str(MACHINES / "one_axis")]
    assert main(["replay", *words, *machine, "--out", str(tmp_path / "replay")]) == 0
    findings = json.loads((tmp_path / "replay" / "summary.json").read_text())["findings"]
    assert any(said in each["text"] for each in findings if each["severity"] == "wrong")
    capsys.readouterr()
    for more in ([], machine):
        assert main(["identify", "drive", *words, *more, "--out", str(tmp_path / "drive")]) == 2
        error = capsys.readouterr().err
        assert said in error
        assert "feedsim-" not in error
        assert "machine.yaml" not in error
        assert not (tmp_path / "drive").exists()


def test_an_axis_that_is_far_off_is_another_one(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The lag is as large as what is off: only the way of 20 mm shows it."""
    faulty(log, tmp_path / "log.csv", "X.x_a", lambda x: 2 * x[0] - x)
    words = ["--axes", "X", "--columns", str(log.parent / "columns.yaml"), "--machine", str(MACHINES / "one_axis")]
    assert main(["replay", str(tmp_path / "log.csv"), *words, "--quiet", "--out", str(tmp_path / "out")]) == 0
    assert "this is not the machine of the record" in capsys.readouterr().err


def record(setpoint: Array, position: Array) -> AxisRecord:
    time = 2e-3 * np.arange(len(setpoint))
    made = Record("made", time=time, torque=np.full_like(time, np.nan), angle=position, setpoint=setpoint)
    return AxisRecord("X", made, 1.0, np.ones(len(time), dtype=bool))


def behind(setpoint: Array, rows: int) -> Array:
    return np.concatenate([np.full(rows, setpoint[0]), setpoint])[: len(setpoint)]


TIME = 2e-3 * np.arange(1000)
S = np.clip((TIME - 0.4) / 0.5, 0, 1)
MOVE = 50e-3 * (10 * S**3 - 15 * S**4 + 6 * S**5)


@pytest.mark.parametrize(
    ("setpoint", "position"),
    [
        (MOVE, behind(MOVE, 5)),
        (MOVE, behind(MOVE, 25)),  # 50 ms
        (MOVE, 5e-6 * np.round(behind(MOVE, 5) / 5e-6)),  # an encoder of 5 um
        (MOVE, behind(MOVE, 5) + 2e-6 * np.random.default_rng(1).standard_normal(1000)),
        (MOVE, behind(MOVE, 5) + 15e-6),
        (10e-6 * MOVE / 50e-3, 1e-6 * np.round(behind(10e-6 * MOVE / 50e-3, 5) / 1e-6)),  # ten steps of an encoder
        (np.where(TIME > 0.5, 10e-6, 0.0), behind(np.where(TIME > 0.5, 10e-6, 0.0), 3)),  # a step is asked for
        (1e-3 * np.sin(2 * np.pi * 20 * TIME), 0.3e-3 * np.sin(2 * np.pi * 20 * TIME - 1.2)),  # beyond the bandwidth
        (np.zeros(1000), 1e-7 * np.random.default_rng(1).standard_normal(1000)),  # nothing moves
    ],
)  # fmt: skip
def test_records_that_can_be(setpoint: Array, position: Array) -> None:
    assert implausible(record(setpoint, position)) == []
