"""Every Next can be typed: the command that a result of each kind ends with, made with unusual options, is executed."""

from __future__ import annotations

import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

import feedsim as fs
from command_helpers import feedsim, summary_of
from feedsim.cli import parser
from feedsim.files.trace.response import FrequencyResponse
from feedsim.files.trace.response_files import write_response

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
ONE_AXIS, CENTRE = SCENARIOS / "machines" / "one_axis", SCENARIOS / "machines" / "test_centre"
Z = "machine.axes.Z.drive"
LOGGED = f"""
name: log of Z
machine: {CENTRE}
motions:
  - {{kind: dwell, duration: 0.1 s}}
  - {{kind: move, by: {{Z: 12 mm}}, feed: 6000 mm/min}}
  - {{kind: move, by: {{Z: -5 mm}}, feed: 600 mm/min}}
  - {{kind: dwell, duration: 0.1 s}}
recording: {{interval: 1 ms}}
logging: {{interval: 2 ms, axes: [Z], signals: [x_s, x_a, x_e, n_s, n_ffw, M_a]}}
"""
STUDY = """
name: feed
scenario: stop.yaml
sampling: {method: latin_hypercube, runs: 40, seed: 2}
parameters:
  feed: {key: motions.0.feed, distribution: uniform, from: 1000 mm/min, to: 3000 mm/min}
"""
SHORT = "motions.0.by.Z=5 mm"
# Kind of result -> the command that makes it, in a folder of its own, and words that its Next must hold.
MADE = {
    "a stop that is not neutral": (
        f"run stop.yaml --set '{Z}.T_sym=2.9 ms' --set '{SHORT}' --control sinumerik --out 'my results'",
        ("tune proposals", "T_sym=2.9 ms", SHORT, "--control sinumerik", "'my results'"),
    ),
    "a circle": (f"run circle.yaml --set '{Z}.K_v=4.1 (m/min)/mm' --out r", ("tune feedforward", "K_v=4.1")),
    "an unstable run": (f"run stop.yaml --set '{Z}.K_v=30 (m/min)/mm' --set '{SHORT}' --out r", ("K_v=13.7", SHORT)),
    "a log": ("run logged.yaml --out r", ("identify friction r/log.csv", "--axes Z")),
    "a positioning cycle": (
        "run iso.yaml --set motions.0.runs=2 --set 'motions.0.rest=0.2 s' --out r",
        ("sheet={}", "motions.0.runs=2"),
    ),
    "a recorded circle": (
        "circle ccw.csv cw.csv --axes X,Y --radius '150 mm' --feed '1 m/min' --columns ballbar.yaml --out r",
        ("--after ccw_after.csv cw_after.csv", "--radius '150 mm'", "--columns ballbar.yaml"),
    ),
    "records before and after": (
        "circle ccw.csv cw.csv --feed '1 m/min' --after a_ccw.csv a_cw.csv --out r",
        ("circle a_ccw.csv a_cw.csv", "--after a_ccw_after.csv"),
    ),
    "responses": (
        f"frf {ONE_AXIS} --no-measure --band 2Hz..300Hz --set structure=null --out r",
        ("--no-measure", "--band 2Hz..300Hz", "structure=null", "K_v="),
    ),
    "friction": (
        "identify friction log.csv --axes Z --columns log.yaml --machine stop.yaml --stages 2 "
        "--inertia '0.0164 kg.m^2' --out r",
        ("run stop.yaml", "machine.axes.Z.friction=r/friction.yaml"),
    ),
    "friction without a scenario": (
        "identify friction log.csv --columns log.yaml --stages 2 --inertia '0.0164 kg.m^2' --out r",
        ("feedsim example z_positioning &&", "r/friction.yaml"),
    ),
    "a replay": (
        f"replay log.csv --machine {CENTRE} --axes Z --columns log.yaml --window '0.05 s..1 s' --out r",
        ("identify drive log.csv", "--axes Z", "--columns log.yaml", "--window '0.05 s..1 s'", f"--machine {CENTRE}"),
    ),
    "a replay of an identified drive": (
        f"replay log.csv --machine {CENTRE} --axes Z --columns log.yaml --window '0.05 s..1 s' "
        "--set 'machine.axes.Z.friction.identified={parameters: {drive.K_v: {status: estimated}}}' --out r",
        (f"frf {CENTRE}", "--axes Z", "drive.K_v"),
    ),
    "a drive": (
        f"identify drive log.csv --machine {CENTRE} --axes Z --columns log.yaml --window '0.05 s..0.3 s' "
        f"--set {Z}.K_v='3 (m/min)/mm' --out r",
        (
            f"replay log.csv --machine {CENTRE}",
            "--axes Z",
            "--columns log.yaml",
            "--window '0.05 s..0.3 s'",
            "K_v=3",
            f"{Z}=r/drive_Z.yaml",
            "machine.axes.Z.friction=r/friction_Z.yaml",
        ),
    ),
    "a history": (
        "history histories/z_wear.csv --quantities Z.F_C,Z.F_S --limit 'F_C_Z=1.4 N.m' --out r",
        ("history r/history.csv", "--quantities Z.F_C,Z.F_S", "F_C_Z=1.4 N.m", "--out r_next"),
    ),
    "a study": (f"sweep study.yaml --runs 3 --workers 0 --set '{Z}.K_v=3 (m/min)/mm' --out r", ("r:min=", "r:max=")),
    "two runs": ("diff one two --out r", ("compare two/result.csv one/result.csv",)),
    "a compensation": ("tune feedforward circle.yaml --no-table --out r", ("tune compensation circle.yaml",)),
    "a tuned drive": (
        f"tune drive stop.yaml --axes Z --evaluations 10 --set '{SHORT}' --set '{Z}.K_v=3 (m/min)/mm' --out r",
        ("r/settings.yaml", SHORT, "K_v=3"),
    ),
    "files of a control": (
        f"machine import nc.tea --axes X=AX1 --machine {CENTRE} --checked all --out r",
        ("machine info r",),
    ),
    "files for a control": (
        f"machine export {CENTRE} --like nc.tea --axes X=AX1 --out r",
        ("machine import r/nc.tea", "--axes X=AX1"),
    ),
    "modes": (f"identify modes response.csv --machine {ONE_AXIS} --motor n/M --modes 1 --out r", ("r/modes.csv",)),
    "mounts": (
        f"identify mounts {SCENARIOS}/records/elastomer_mounts/stop_500.csv --machine "
        f"{SCENARIOS}/z_elastomer_mounts.yaml --set machine.mounts.c=90% --out r",
        ("run ", "c=90%", "machine.mounts=r/mounts.yaml"),
    ),
    "a machine": (f"machine view {ONE_AXIS} --at X=100mm --out r", ("--at X=100mm", "--animate")),
}
# Taking a minute each, these are parsed alone; they are executed by tests of their own.
LONG = ("a compensation", "a replay", "a replay of an identified drive")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, fmus: Path) -> Path:
    place = tmp_path_factory.mktemp("next")
    fs.example(["ballbar", "log", "z_wear"], to=place)
    for name, target in (("before_ccw", "ccw"), ("before_cw", "cw"), ("after_ccw", "a_ccw"), ("after_cw", "a_cw")):
        for copy in (target, f"{target}_after"):
            shutil.copy(place / "records/ballbar" / f"{name}.csv", place / f"{copy}.csv")
    shutil.copy(place / "records/ballbar/columns.yaml", place / "ballbar.yaml")
    shutil.copy(place / "records/log/columns.yaml", place / "log.yaml")
    shutil.copy(place / "records/log/log.csv", place / "log.csv")
    for name, text in (("stop", "z_positioning"), ("circle", "xz_circle"), ("iso", "z_iso230_2")):
        source = (SCENARIOS / f"{text}.yaml").read_text(encoding="utf-8")
        (place / f"{name}.yaml").write_text(source.replace("machines/test_centre", str(CENTRE)), encoding="utf-8")
    (place / "logged.yaml").write_text(LOGGED, encoding="utf-8")
    (place / "study.yaml").write_text(STUDY, encoding="utf-8")
    (place / "nc.tea").write_text("N32200 $MA_POSCTRL_GAIN[0,AX1]=5\nN32610 $MA_VELO_FFW_WEIGHT[0,AX1]=0.9\n")
    frequency = np.arange(5.0, 220.0)
    s = 2j * np.pi * frequency
    mode = 1 + 0.8 * s**2 / (s**2 + 2 * 0.02 * 390 * s + 390**2)
    response = FrequencyResponse(frequency, {"n/M": mode / (0.01 * s)}, {"n/M": "(rad/s)/(N.m)"})
    write_response(place / "response.csv", response)
    for name, feed in (("one", 1), ("two", 2)):
        change = f"motions.0.feed={feed} m/min"
        assert (
            feedsim("run", "stop.yaml", "--set", change, "--set", SHORT, "-o", name, fmus=fmus, cwd=place).returncode
            == 0
        )
    return place


@pytest.mark.parametrize("kind", MADE)
def test_the_next_command_works_as_it_is_printed(kind: str, folder: Path, fmus: Path) -> None:
    words, expected = MADE[kind]
    out = folder / shlex.split(words)[shlex.split(words).index("--out") + 1]
    shutil.rmtree(out, ignore_errors=True)
    done = feedsim(*shlex.split(words), fmus=fmus, cwd=folder)
    assert done.returncode == 0, done.stderr
    command = summary_of(out)["next"]["command"]
    assert f"  {command}" in done.stdout.splitlines()
    for text in (*expected, "feedsim "):
        assert text in command, command
    assert "SCENARIO" not in command
    assert "THIS_FOLDER" not in command
    for part in command.split(" && "):
        program, *typed = shlex.split(part)
        assert program == "feedsim"
        if kind in LONG:
            parser(typed[0]).parse_args(typed)
            continue
        done = feedsim(*typed, fmus=fmus, cwd=folder)
        assert done.returncode == int(typed[0] == "compare"), (command, done.stderr)
