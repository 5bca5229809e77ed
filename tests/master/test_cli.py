"""The command line as a user meets it: messages, exit codes, and nothing half-written."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

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


def feedsim(*words: str | Path, fmus: Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from feedsim.cli import entry; entry()", *map(str, words)]
    environment = {**os.environ, "FEEDSIM_FMUS": str(fmus), "PYTHONPATH": str(ROOT / "master"), "PYTHONUTF8": "1"}
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, encoding="utf-8", check=False)


def test_run_writes_results_and_one_line(scenario_file: Path, fmus: Path, tmp_path: Path) -> None:
    done = feedsim("run", scenario_file, "--out", tmp_path / "out", fmus=fmus, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert len(done.stdout.splitlines()) == 1
    assert done.stdout.startswith("short move: ")
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
    [
        ("mode,frequency [Hz],n_X\n0,0,1\n", ["damping ratio"]),
        ("", ["empty"]),
        (None, ["modes"]),
    ],
)
def test_broken_modes_file(
    content: str | None, words: list[str], scenario_file: Path, fmus: Path, tmp_path: Path
) -> None:
    modes = tmp_path / "my modes.csv"
    if content is not None:
        modes.write_text(content)
    done = feedsim("run", scenario_file, "--set", f"machine.modes={modes}", fmus=fmus, cwd=tmp_path)
    assert done.returncode in (2, 3), done.stderr
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


def test_validate_and_schema(scenario_file: Path, fmus: Path, tmp_path: Path) -> None:
    done = feedsim("validate", scenario_file, fmus=fmus, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "valid" in done.stdout
    for kind in ("scenario", "machine"):
        done = feedsim("schema", kind, fmus=fmus, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["$schema"].startswith("https://json-schema.org/")


def test_missing_scenario(fmus: Path, tmp_path: Path) -> None:
    done = feedsim("run", "no.yaml", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2
    assert "no.yaml" in done.stderr


def test_usage_and_help(fmus: Path, tmp_path: Path) -> None:
    assert feedsim(fmus=fmus, cwd=tmp_path).returncode == 2
    done = feedsim("--help", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 0
    for command in ("run", "validate", "schema", "convert", "exit codes"):
        assert command in done.stdout


def test_convert_wants_a_name_and_a_unit(fmus: Path, tmp_path: Path) -> None:
    done = feedsim("convert", "x.mat", "--column", "qg", "--out", "x.csv", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2
    assert "VARIABLE=NAME:UNIT" in done.stderr
