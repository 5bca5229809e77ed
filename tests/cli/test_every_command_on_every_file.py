"""Every command on everything that another command writes or that a user may hand it: a known exit status, a sentence
and no traceback where it refuses, and every input as it was.

The commands come from the command line's own list: a new one is here by itself.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from capture_helpers import CYCLE, ROWS, axis_signals, content
from command_helpers import feedsim
from feedsim.cli.commands import commands
from feedsim.jobs.parameters import Argument
from ssp_helpers import short_scenario

ROOT = Path(__file__).resolve().parents[2]
CIRCLE = """
name: short circle
machine: {machine}
motions:
  - {{kind: circle, plane: [X, Z], radius: 2 mm, feed: 3000 mm/min, turns: 3}}
  - {{kind: dwell, duration: 250 ms}}
recording: {{interval: 1 ms}}
evaluate: [{{kind: circle}}]
set: {{machine.structure: null}}
"""
STUDY = """
name: short study
scenario: short.yaml
sampling: {method: grid}
parameters: {feed: {key: motions.0.feed, values: [2000 mm/min, 3000 mm/min]}}
figures: [Z.overshoot]
"""
LOGGED = """
name: short strokes
machine: {machine}
motions:
  - {{kind: sine, axis: Z, moves: [{{amplitude: 1 mm, frequency: 4 Hz, periods: 4}}]}}
  - {{kind: dwell, duration: 200 ms}}
recording: {{interval: 1 ms}}
logging: {{axes: [Z], interval: 2 ms}}
set: {{machine.structure: null}}
"""
# Axis Z by another friction law than all else here.
GMS = """
name: short move by Maxwell slip
machine: {machine}
motions:
  - {{kind: move, by: {{Z: 0.8 mm}}, feed: 3000 mm/min}}
  - {{kind: dwell, duration: 60 ms}}
recording: {{interval: 1 ms}}
evaluate: [{{kind: positioning, axis: Z}}]
set: {{machine.structure: null}}
"""
BALLBAR = "X [mm],Y [mm]\n{}"
# What a command cannot do without, besides what is handed to it and --out.
NEEDED = {
    "identify friction": ["--axes", "Z"],
    "identify drive": ["--axes", "Z", "--window", "0s..0.5s"],
    "replay": ["--machine", "machines/test_centre"],
    "identify modes": ["--machine", "machines/test_centre"],
    "frf": ["--no-measure", "--no-full-model"],
    "circle": ["--feed", "1000 mm/min"],
    "sweep": ["--workers", "1"],
    "machine import": ["--axes", "Z"],
    "tune compensation": ["--kind", "model"],
    "tune drive": ["--axes", "Z", "--evaluations", "10"],
    "machine export": ["--like", "mill.tea", "--axes", "Z"],
}
# One file serves for both sides of what takes two.
TWICE = ("compare",)
CODES = (0, 2, 3, 4)  # 1 is an error of feedsim itself, but of compare, where it means different
AXES = {"capture.json": "X1"}  # of the records that are of another axis than Z


COMMANDS = {
    command.name: command
    for command in commands()
    if any(isinstance(parameter.option, Argument) for parameter in command.options)
    and command.name not in ("example", "tools schema", "tools completion")
}


def words(name: str, subject: str, out: Path) -> list[str]:
    """The command on the subject, with its results beside everything else."""
    places = [parameter.option for parameter in COMMANDS[name].options if parameter.name == "out"]
    ending = {"export": ".ssp", "tools convert": ".csv"}.get(name, "")
    target = out / f"{name.replace(' ', '_')}{ending}"
    given = [subject, subject] if name in TWICE else [subject]
    needed = [AXES.get(subject, "Z") if word == "Z" else word for word in NEEDED.get(name, [])]
    return [*name.split(), *given, *needed, *(["--out", str(target)] if places else [])]


@pytest.fixture(scope="module")
def place(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of everything, made by the commands themselves where they can."""
    folder = tmp_path_factory.mktemp("everything")
    shutil.copytree(ROOT / "scenarios" / "machines", folder / "machines")
    centre = folder / "machines" / "test_centre"
    for file, text in (("short.yaml", None), ("circle.yaml", CIRCLE), ("logged.yaml", LOGGED)):
        if text is None:
            short_scenario(folder)
        else:
            (folder / file).write_text(text.format(machine=centre), encoding="utf-8")
    gms = folder / "machines" / "gms"
    shutil.copytree(centre, gms)
    text, _, group = (gms / "machine.yaml").read_text(encoding="utf-8").rpartition("    friction:")
    assert "axes:" in text  # Z is the last axis, and its friction the last group
    assert "drive:" not in group
    (gms / "machine.yaml").write_text(f"{text}    friction: {folder / 'maxwell' / 'friction.yaml'}\n", encoding="utf-8")
    (folder / "gms.yaml").write_text(GMS.format(machine=gms), encoding="utf-8")
    (folder / "study.yaml").write_text(STUDY, encoding="utf-8")
    points = "".join(f"{50 - k % 2 * 1e-3},{k * 1e-2}\n" for k in range(40))
    (folder / "line.csv").write_text(BALLBAR.format(points), encoding="utf-8")
    (folder / "empty.csv").write_text("")
    (folder / "text.csv").write_text("a,b\nc,d\n")
    (folder / "header.csv").write_text("time [s],Z.x_a [m]\n")
    (folder / "noise.bin").write_bytes(bytes(range(256)) * 40)
    (folder / "nothing").mkdir()
    (folder / "mill.tea").write_bytes(b"N32200 $MA_POSCTRL_GAIN[0,Z]=5\r\n\x00N32300 $MA_MAX_AX_ACCEL[0,Z]=2\r\n")
    (folder / "list.yaml").write_text("- 1\n- 2\n")
    (folder / "open.json").write_text('{"Header": {')
    signals = axis_signals(10.0, -1)
    signals["DES_POS"] = 100.0 * np.sin(2 * np.pi * (CYCLE * np.arange(ROWS) + 0.02))  # the axis lags by 20 ms
    capture = content({"X1|1": signals})
    (folder / "capture.json").write_text(json.dumps(capture), encoding="utf-8")
    for line in (
        "identify friction capture.json --axes X1 --out identified",
        "identify drive capture.json --axes X1 --window 0s..0.5s --out driven",
        "replay capture.json --machine driven --out replayed", "tools convert capture.json --out capture.csv",
        "run short.yaml --out run", "run logged.yaml --out logged", "run circle.yaml --out circle",
        "export short.yaml --out wired.ssp", "export short.yaml --one --out one.ssp",
        "export short.yaml --out machine.fmu",
        "export --plant machines/test_centre --out plant.fmu", "machine build machines/one_axis --out built",
        "identify friction logged/log.csv --axes Z --machine machines/test_centre --law gms --out maxwell",
        "run gms.yaml --out slip",
        "frf machines/one_axis --no-measure --out frf", "tune feedforward circle.yaml --out compensated",
        "sweep study.yaml --workers 1 --out swept", "diff run circle --out shown",
        "compare run/result.csv run/result.csv --report compared.html --junit compared.xml",
    ):  # fmt: skip
        done = feedsim(*line.split(), fmus=fmus, cwd=folder)
        assert done.returncode == 0, f"{line}: {done.stderr}"
    shutil.copytree(folder / "run", folder / "partial")
    for name in ("summary.json", "report.html"):
        (folder / "partial" / name).unlink()
    (folder / "partial" / "result.csv").rename(folder / "partial" / "result.partial.csv")
    shutil.copytree(folder / "run", folder / "cut")
    text = (folder / "cut" / "result.csv").read_text()
    (folder / "cut" / "result.csv").write_text(text[: len(text) // 2])
    (folder / "cut" / "summary.json").write_text("{")
    return folder


SUBJECTS = (
    "capture.json", "capture.csv", "identified", "identified/friction.yaml", "driven", "driven/machine.yaml",
    "replayed", "replayed/replay.csv", "maxwell", "maxwell/friction.yaml", "machines/gms", "gms.yaml", "slip",
    "slip/result.csv",
    "short.yaml", "circle.yaml", "study.yaml", "list.yaml", "open.json", "machines/test_centre", "machines/one_axis",
    "machines/sinumerik_840d", "machines/emps", "machines/test_centre/machine.yaml",
    "machines/test_centre/structure.yaml", "machines/test_centre/modes.csv", "run", "run/result.csv",
    "run/summary.json", "run/report.html", "logged", "logged/log.csv", "circle", "circle/result.csv", "wired.ssp",
    "one.ssp", "machine.fmu", "plant.fmu", "built", "built/modes.csv", "frf", "frf/frf.csv", "compensated",
    "compensated/feedforward.csv", "swept", "swept/table.csv", "swept/study.json", "shown", "compared.html",
    "compared.xml", "partial", "partial/result.partial.csv", "cut", "cut/result.csv", "line.csv",
    "empty.csv", "text.csv", "header.csv", "noise.bin", "mill.tea", "nothing",
    "missing.yaml", "missing/folder",
)  # fmt: skip
# They take most commands the longest way. A change of one command shows with the others.
LONG = (
    "capture.json", "gms.yaml", "short.yaml", "circle.yaml", "machines/gms", "machines/test_centre",
    "machines/test_centre/machine.yaml", "circle/result.csv",
)  # fmt: skip


def state(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize(
    "subject", [pytest.param(name, marks=pytest.mark.extensive) if name in LONG else name for name in SUBJECTS]
)
def test_every_command(subject: str, place: Path, fmus: Path, tmp_path: Path) -> None:
    before, faults = state(place), []
    for name in COMMANDS:
        done = feedsim(*words(name, subject, tmp_path), fmus=fmus, cwd=place)  # raises what would be a traceback
        allowed = (*CODES, 1) if name == "compare" else CODES
        said = done.stderr.strip() or (done.stdout.strip() if name == "compare" else "")  # its verdict is its output
        if done.returncode not in allowed:
            faults.append(f"{name}: exit status {done.returncode}: {said[-300:]}")
        elif done.returncode > 1 and not said.rpartition("\nfeedsim: ")[2].removeprefix("feedsim: "):
            faults.append(f"{name}: refused without a word")
        elif "Warning: " in said or "Traceback" in said:
            faults.append(f"{name}: {said[-300:]}")
        elif str(tmp_path) in said and done.returncode == 2 and name != "compare":
            faults.append(f"{name}: names its results where it speaks of its input: {said[-300:]}")
    assert not faults, "\n".join(faults)
    assert state(place) == before


UNREAD = {"scope.svdx": "a project of TwinCAT Scope", "a.rst": "a file of ANSYS", "a.emat": "a file of ANSYS",
          "a.db": "a file of ANSYS", "a.OP2": "a file of Nastran", "a.odb": "a file of Abaqus",
          "a.frd": "a result of CalculiX", "a.tdms": "a recorder's file"}  # fmt: skip
READERS = (
    "identify friction", "compare", "tools convert", "diff", "circle", "replay", "identify drive", "identify modes",
    "machine build", "machine info",
)  # fmt: skip


@pytest.mark.parametrize("name", UNREAD)
def test_files_that_nothing_reads(name: str, place: Path, fmus: Path, tmp_path: Path) -> None:
    """Every command that takes files of records or structures says what it is, and what to do."""
    (tmp_path / name).write_bytes(b"abc\0def")
    for command in READERS:
        done = feedsim(*words(command, str(tmp_path / name), tmp_path), fmus=fmus, cwd=place)
        assert done.returncode == 2, command
        assert f"{name} is {UNREAD[name]}" in done.stderr + done.stdout, command


def test_the_list_is_that_of_the_command_line() -> None:
    assert {"run", "frf", "identify friction", "identify drive", "replay", "tune feedforward", "circle", "diff",
            "sweep", "compare", "tools convert", "export"} <= set(COMMANDS)  # fmt: skip
    assert set(NEEDED) <= set(COMMANDS)
