"""The recorded torque on the axis, without its drive: a log of the axis itself, other loads, faults."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from feedsim.cli import main
from feedsim.files.trace import read_csv, write_csv
from feedsim.scenario import load
from feedsim.simulation.cosim import run

ROOT = Path(__file__).resolve().parents[2]
MACHINES = ROOT / "scenarios" / "machines"
MACHINE = MACHINES / "sinumerik_840d"
SCENARIO = f"""
name: log of Y
machine: {MACHINE}
motions:
  - {{kind: dwell, duration: 0.2 s}}
  - {{kind: move, by: {{Y: 60 mm}}, feed: 6000 mm/min}}
  - {{kind: move, by: {{Y: -50 mm}}, feed: 6000 mm/min}}
  - {{kind: move, by: {{Y: 20 mm}}, feed: 3000 mm/min}}
recording: {{interval: 1 ms}}
logging: {{interval: 1 ms, axes: [Y], signals: [x_s, x_a, M_a]}}
"""


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("log")
    (folder / "y.yaml").write_text(SCENARIO)
    found = run(load(folder / "y.yaml")).log
    assert found is not None
    write_csv(folder / "log.csv", found)
    return folder / "log.csv"


def driven(log: Path, out: Path, *more: str) -> dict[str, float]:
    words = ["replay", str(log), "--machine", str(MACHINE), "--axes", "Y", "--open-loop", "--quiet", "--out", str(out)]
    assert main([*words, *more]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["settings"]["open_loop"] == "yes"
    return {name.partition(".")[2]: each["value"] for name, each in summary["figures"].items()}


def test_the_torque_of_the_axis_itself(log: Path, tmp_path: Path) -> None:
    """1.9 s on a way of 130 mm: what the torque does between its rows is all that is not known."""
    figures = driven(log, tmp_path / "out", "--window", "0.1 s..2 s")
    assert set(figures) == {"position_rms", "position_largest"}
    assert figures["position_rms"] < 150  # um
    beside = read_csv(tmp_path / "out" / "replay.csv")
    off = beside["Y.x_a_simulated"] - beside["Y.x_a_recorded"]
    assert figures["position_rms"] == pytest.approx(1e6 * float(np.sqrt(np.mean(off**2))), rel=1e-9)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "in open loop, under the recorded torque" in page


def test_another_load_takes_the_axis_away(log: Path, tmp_path: Path) -> None:
    """A load that is 1 N.m larger, in a window in which the axis moves: I_P t^2/(2 J) behind, the friction of the same
    motion but for what it rises with speed."""
    window = ("--window", "0.3 s..0.7 s")
    before = driven(log, tmp_path / "own", *window)
    after = driven(log, tmp_path / "more", *window, "--set", "axes.Y.constant_load=21.504 N.m")
    I_P, J, t = 10e-3 / (2 * np.pi), 0.0196, 0.4
    behind = 1e6 * I_P * t**2 / (2 * J)
    assert before["position_largest"] < 0.05 * behind
    assert after["position_largest"] == pytest.approx(behind, rel=0.15)


def test_no_torque_is_refused(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mapping = tmp_path / "columns.yaml"
    mapping.write_text("axis: Y\nposition: {column: Y.x_a}\nsetpoint: {column: Y.x_s}\n")
    words = ["replay", str(log), "--machine", str(MACHINE), "--axes", "Y", "--columns", str(mapping), "--open-loop"]
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    assert "axis Y: no torque, current or force is recorded; in open loop it is what drives" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif("FEEDSIM_EMPS" not in os.environ, reason="FEEDSIM_EMPS names no measured record")
def test_a_measured_axis_with_its_published_parameters(tmp_path: Path) -> None:
    """EMPS under its recorded force: 5.4 mm over 24.8 s, as the units with the drive's gains at 0 leave
    (tests/physics/emps_axis.py)."""
    machine = MACHINES / "emps"
    words = [
        "replay",
        os.environ["FEEDSIM_EMPS"],
        "--machine",
        str(machine),
        "--columns",
        str(machine / "columns.yaml"),
    ]
    assert main([*words, "--open-loop", "--quiet", "--out", str(tmp_path / "out")]) == 0
    figures = json.loads((tmp_path / "out" / "summary.json").read_text())["figures"]
    assert figures["X.position_rms"]["value"] == pytest.approx(5.4e3, rel=0.05)
