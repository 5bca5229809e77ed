"""The command line as a user meets it: messages, exit codes, and nothing half-written."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from command_helpers import feedsim, feedsim_process
from feedsim.files.trace import read_csv
from feedsim.foundation.outputs import LOCK

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = """
name: short move
machine: {machine}
motions:
  - {{kind: move, by: {{Z: 1 mm}}, feed: 3000 mm/min}}
  - {{kind: dwell, duration: 100 ms}}
recording: {{interval: 1 ms}}
"""


@pytest.fixture
def scenario_file(tmp_path: Path) -> Path:
    file = tmp_path / "short move ä.yaml"
    file.write_text(SCENARIO.format(machine=ROOT / "scenarios" / "machines" / "test_centre"), encoding="utf-8")
    return file


def test_run_writes_results_and_says_what_has_moved(scenario_file: Path, fmus: Path, tmp_path: Path) -> None:
    done = feedsim_process("run", scenario_file, "--out", tmp_path / "out", fmus=fmus, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    moved, nothing, line, _, command, last = done.stdout.splitlines()
    assert moved.startswith("Z moves within ")
    assert "nothing that is evaluated" in nothing
    assert line.startswith("short move: ")
    assert command.startswith("  feedsim ")
    assert last == f"-> {tmp_path / 'out' / 'report.html'}"
    assert {"result.csv", "summary.json", "report.html"} <= {path.name for path in (tmp_path / "out").iterdir()}
    header = (tmp_path / "out" / "result.csv").read_text(encoding="utf-8").splitlines()[0]
    assert header.startswith("time [s],")
    assert "Z.M_fr [N.m]" in header
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["scenario"]["name"] == "short move"


def test_default_output_folder_is_named_after_the_scenario(scenario_file: Path, fmus: Path, tmp_path: Path) -> None:
    done = feedsim("run", scenario_file, "--quiet", fmus=fmus, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    assert (tmp_path / "results" / scenario_file.stem / "result.csv").is_file()


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("motions.0.feed=5000 mm", ["feed", "5000 mm", "mm/min"]),
        ("motions.0.feeed=5000 mm/min", ["feeed", "feed"]),
        ("machine.axes.Z.friction.F_S=1 N.m", ["F_S", "F_C"]),
        ("machine.axes.Z.friction.W=-0.1 rad", ["W", "-0.1"]),
        ("machine.cycles.position=1.1 ms", ["position", "1.1"]),
        ("motions.0={kind: move, by: {Z: 100 mm}, feed: 40 m/min}", ["Z", "40 m/min", "30 m/min"]),
        ("motions.0.by.Z=700 mm", ["Z", "685"]),
    ],
)
def test_wrong_input_ends_with_2_and_nothing_written(
    override: str, words: list[str], scenario_file: Path, fmus: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    done = feedsim("run", scenario_file, "--out", out, "--set", override, fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    for word in words:
        assert word in done.stderr
    assert not list(tmp_path.rglob("*.csv"))
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("content", "words"),
    [("mode,frequency [Hz],n_X\n0,0,1\n", ["damping ratio", "my modes.csv:1"]), ("", ["empty"]), (None, ["modes"])],
)
def test_broken_modes_file(
    content: str | None, words: list[str], scenario_file: Path, fmus: Path, tmp_path: Path
) -> None:
    modes = tmp_path / "my modes.csv"
    if content is not None:
        modes.write_text(content)
    done = feedsim("run", scenario_file, "--set", f"machine.modes={modes}", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    for word in words:
        assert word in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "results").exists()


def test_output_folder_that_cannot_be_made(scenario_file: Path, fmus: Path, tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("keep me")
    done = feedsim("run", scenario_file, "--out", blocker / "out", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 4, done.stderr
    assert str(blocker) in done.stderr
    assert blocker.read_text() == "keep me"


@pytest.mark.parametrize(("name", "fate"), [("result.csv", "replaced"), ("frf.csv", "removed"), ("mine.csv", "")])
def test_inputs_in_the_output_folder_are_not_lost(
    name: str, fate: str, scenario_file: Path, fmus: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    modes = (ROOT / "scenarios" / "machines" / "test_centre" / "modes.csv").read_bytes()
    (out / name).write_bytes(modes)
    (out / "summary.json").write_text(json.dumps({"files": ["frf.csv", "mine.csv"]}))
    done = feedsim("run", scenario_file, "--out", out, "--set", f"machine.modes={out / name}", fmus=fmus, cwd=tmp_path)
    assert done.returncode == (4 if fate else 0), done.stderr
    assert not fate or f"{out / name}: is an input and would be {fate}; take another directory" in done.stderr
    assert (out / name).read_bytes() == modes
    assert (out / "report.html").exists() == (not fate)


def test_validate_and_schema(scenario_file: Path, fmus: Path, tmp_path: Path) -> None:
    done = feedsim("check", scenario_file, fmus=fmus, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "valid" in done.stdout
    for kind in ("scenario", "machine", "columns"):
        done = feedsim("tools", "schema", kind, fmus=fmus, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["$schema"].startswith("https://json-schema.org/")


def test_failed_step_ends_with_3_and_no_result(scenario_file: Path, fmus: Path, tmp_path: Path) -> None:
    entries = ("K_p=1e300 N.m.s/rad", "M_max=1e308 N.m", "ideal_current_loop=true")
    changes = [word for entry in entries for word in ("--set", f"machine.axes.Z.drive.{entry}")]
    done = feedsim_process("run", scenario_file, *changes, fmus=fmus, cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    assert " s: step of 0.000125 s failed: " in done.stderr
    assert {path.name for path in tmp_path.rglob("*.csv")} <= {"result.partial.csv"}
    assert not list(tmp_path.rglob("report.html"))


def test_warnings_reach_console_and_report(scenario_file: Path, fmus: Path, tmp_path: Path) -> None:
    override = "machine.axes.Z.friction.W=0.001 rad"
    done = feedsim("run", scenario_file, "--set", override, "--out", "out", "--quiet", fmus=fmus, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    assert "warning: friction_Z: parameter 'W' is 0.001 rad" in done.stderr
    assert "is 0.001 rad" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_recorded_setpoints_from_a_mat_file(scenario_file: Path, fmus: Path, tmp_path: Path) -> None:
    """The documented way from a record to a run, on a record made here: 2 mm there and back, begun in motion."""
    t = np.arange(0.0, 0.4, 1e-3)
    savemat(tmp_path / "record.mat", {"t": t, "qg": 0.25 - 1e-3 * np.cos(2 * np.pi * 2.5 * t + 0.3)})
    columns = ["--column", "t=time:s", "--column", "qg=Z.x_s:m"]
    done = feedsim("tools", "convert", "record.mat", *columns, "--out", "reference.csv", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    measured = ROOT / "scenarios" / "z_measured.yaml"
    done = feedsim("run", measured, "--set", "motions.0.file=reference.csv", "--out", "out", fmus=fmus, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    trace = read_csv(tmp_path / "out" / "result.csv")
    assert np.ptp(trace["Z.x_a"]) == pytest.approx(2e-3, rel=0.02)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT"])
def test_signals_leave_no_result(name: str, fmus: Path, tmp_path: Path) -> None:
    number = getattr(signal, name, None)
    if number is None or os.name == "nt":
        pytest.skip("POSIX signals")
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    environment = {**os.environ, "FEEDSIM_FMUS": str(fmus), "PYTHONPATH": str(ROOT / "master"), "TMPDIR": str(scratch)}
    words = [
        sys.executable,
        "-c",
        "from feedsim.cli import entry; entry()",
        "run",
        ROOT / "scenarios" / "xz_circle.yaml",
    ]
    with subprocess.Popen(
        [*map(str, words), "--out", "out"],
        cwd=tmp_path,
        env=environment,
    ) as process:
        while process.poll() is None and not any(path.name != LOCK for path in scratch.glob("*/*")):
            time.sleep(0.01)  # until archives are being unpacked
        process.send_signal(number)
        assert process.wait(60) == {"SIGTERM": 143, "SIGINT": 130}[name]
    assert not list(scratch.iterdir())
    assert {path.name for path in tmp_path.rglob("*.csv")} <= {"result.partial.csv"}


def test_missing_scenario(fmus: Path, tmp_path: Path) -> None:
    done = feedsim("run", "no.yaml", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2
    assert "no.yaml" in done.stderr


def test_usage_and_help(fmus: Path, tmp_path: Path) -> None:
    assert feedsim_process(fmus=fmus, cwd=tmp_path).returncode == 0
    done = feedsim("--help", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 0
    for command in ("run", "check", "export", "tools", "exit codes"):
        assert command in done.stdout


def test_convert_wants_a_name_and_a_unit(fmus: Path, tmp_path: Path) -> None:
    (tmp_path / "x.mat").write_bytes(b"")
    done = feedsim("tools", "convert", "x.mat", "--column", "qg", "--out", "x.csv", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2
    assert "VARIABLE=NAME:UNIT" in done.stderr
