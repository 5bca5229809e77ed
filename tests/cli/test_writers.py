"""Any number of processes on one folder, ended at any moment: what is in it is one result, whole, or none."""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from command_helpers import PATIENCE
from feedsim.cli import main
from feedsim.design.sweep import read_table
from feedsim.files.trace import write_csv
from feedsim.simulation.cosim.friction_law import FrictionLaw
from identification_helpers import I_P, log_of, strokes
from ssp_helpers import short_scenario

ROOT = Path(__file__).resolve().parents[2]
MACHINE = ROOT / "scenarios" / "machines" / "test_centre"
pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
STUDY = """name: Friction
scenario: short.yaml
sampling: {method: sobol, runs: 16, seed: 7}
parameters:
  F_C: {key: machine.axes.Z.friction.F_C, distribution: uniform, from: 1.2 N.m, to: 2 N.m}
"""
IDENTIFY = ["identify", "log.csv", "--axes", "Z", "--machine", str(MACHINE), "--stages", "1"]
COMMANDS = {
    "run": ["run", "short.yaml"],
    "frf": ["frf", str(MACHINE), "--axes", "Z", "--no-measure"],
    "compensate": ["compensate", str(ROOT / "scenarios" / "xz_circle.yaml"), "--no-table"],
    "identify": IDENTIFY,
    "sweep": ["sweep", "study.yaml", "--workers", "0"],
    "build": ["machine", "build", str(MACHINE)],
    "show": ["machine", "show", str(MACHINE)],
}


@pytest.fixture(scope="module")
def place(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("place")
    short_scenario(folder)
    (folder / "study.yaml").write_text(STUDY)
    with FrictionLaw(fmus) as law:
        feeds = [feed / 60e3 / I_P for feed in (20, 100, 400, 2000, 8000, 20000)]
        write_csv(folder / "log.csv", log_of(law, "Z", strokes(feeds), 5e-4, noise=1e-3))
    return folder


def started(words: Sequence[str], place: Path, fmus: Path) -> subprocess.Popen[str]:
    (place / "temporary").mkdir(exist_ok=True)
    return subprocess.Popen(
        [sys.executable, "-c", "from feedsim.cli import entry; entry()", *words, "--quiet"], cwd=place, text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True,
        env={**os.environ, "FEEDSIM_FMUS": str(fmus), "PYTHONPATH": str(ROOT / "master"),
             "TMPDIR": str(place / "temporary")},
    )  # fmt: skip


def complete(out: Path, besides: Sequence[str] = ()) -> dict[str, object]:
    """The summary of a folder that holds one result and nothing else, but what patterns in `besides` name."""
    summary: dict[str, object] = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    left = {path for pattern in besides for part in out.glob(pattern) for path in (part, *part.rglob("*"))}
    found = {path.relative_to(out).as_posix() for path in {*out.rglob("*")} - left if path.is_file()}
    files = summary["files"]
    assert isinstance(files, list)
    assert found == {*files}
    return summary


@pytest.mark.parametrize("command", COMMANDS)
def test_a_second_one_is_refused_before_it_begins(
    command: str, place: Path, fmus: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code = "import sys\nfrom pathlib import Path\nfrom feedsim.foundation.outputs import claim_folder\n"
    code += "with claim_folder(Path('claimed')):\n    print('there', flush=True)\n    sys.stdin.readline()\n"
    owner = subprocess.Popen(
        [sys.executable, "-c", code], cwd=place, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT / "master")},
    )  # fmt: skip
    monkeypatch.chdir(place)
    monkeypatch.setenv("FEEDSIM_FMUS", str(fmus))
    try:
        assert owner.stdout is not None
        owner.stdout.readline()
        begun = [path.name for path in (place / "claimed").iterdir()]
        assert main([*COMMANDS[command], "--out", "claimed"]) == 4
        said = capsys.readouterr().err
        assert re.search(
            rf"^feedsim: claimed: another process .*: process {owner.pid} on .*--out|directory$", said, re.M
        )
        assert [path.name for path in (place / "claimed").iterdir()] == begun
    finally:
        owner.communicate("\n", timeout=PATIENCE)
    assert not (place / "claimed").exists()


def test_of_several_at_once_one_leaves_its_set(place: Path, fmus: Path) -> None:
    """What is told in the summary gives the very curves that are beside it."""
    processes = [
        started(["run", "short.yaml", "--out", "several", "--set", f"machine.axes.Z.friction.F_C=1.{i} N.m"],
                place, fmus)
        for i in range(3)
    ]  # fmt: skip
    codes = [process.wait(120) for process in processes]
    for process in processes:
        process.communicate()
    assert set(codes) <= {0, 4}
    assert 0 in codes
    summary = complete(place / "several")
    alone = started(["run", "short.yaml", "--out", "alone", *told(summary)], place, fmus)
    assert alone.communicate(timeout=PATIENCE)[0] is None
    assert (place / "alone" / "result.csv").read_bytes() == (place / "several" / "result.csv").read_bytes()
    assert list((place / "temporary").iterdir()) == []


def told(summary: dict[str, object]) -> list[str]:
    """The settings of a run, as options."""
    scenario = summary["scenario"]
    assert isinstance(scenario, dict)
    return [word for text in scenario["overrides"] for word in ("--set", text)]


@pytest.mark.extensive
@pytest.mark.parametrize("command", ["run", "identify"])
def test_ended_at_any_moment(command: str, place: Path, fmus: Path) -> None:
    """What was there before, or the new result, and rows of a run that was ended. No trace once the next has ended."""
    words = [*COMMANDS[command], "--out", f"ended_{command}"]
    out, other = place / f"ended_{command}", ["--set", "name=Other"] if command == "run" else ["--hold", "F_log=0 N.m"]
    begun = time.monotonic()
    first = started(words, place, fmus)
    first.communicate(timeout=PATIENCE)
    assert first.returncode == 0
    lasted = time.monotonic() - begun
    moments, killed = random.Random(command), False
    for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGKILL):
        process = started([*words, *other], place, fmus)
        time.sleep(moments.uniform(0.4, 1.0) * lasted)
        process.send_signal(number)
        process.communicate(timeout=PATIENCE)
        killed |= process.returncode == -signal.SIGKILL  # its lock stays until another has claimed the folder
        complete(out, [".feedsim*", "result.partial.csv"] if killed else ["result.partial.csv"])
    last = started([*words, *other], place, fmus)
    last.communicate(timeout=PATIENCE)
    assert last.returncode == 0
    complete(out)
    assert list((place / "temporary").iterdir()) == []


@pytest.mark.extensive
def test_a_study_goes_on_whatever_has_ended_it(place: Path, fmus: Path) -> None:
    """Its workers end with it, and what they have unpacked goes with the next."""
    assert main(["sweep", str(place / "study.yaml"), "--out", str(place / "whole"), "--workers", "0", "--quiet",
                 "--fmus", str(fmus)]) == 0  # fmt: skip
    words, parts = ["sweep", "study.yaml", "--out", "parts", "--workers"], place / "parts"
    for number, runs in ((signal.SIGKILL, 2), (signal.SIGTERM, 5)):
        process = started([*words, "2"], place, fmus)
        while process.poll() is None:
            journal = parts / "runs.jsonl"
            if journal.exists() and journal.read_bytes().count(b'"figures"') >= runs:
                break
            time.sleep(0.01)
        process.send_signal(number)
        process.wait(PATIENCE)
        # A signal before the first or after the last line of the program ends it as such; a shell says 143 of both.
        assert process.returncode in {-number, 128 + number}
        assert number == signal.SIGTERM or process.returncode == -number
        until = time.monotonic() + PATIENCE
        while alive(process.pid):
            assert time.monotonic() < until, "its workers go on"
            time.sleep(0.1)
        process.communicate()
    assert list((place / "temporary").iterdir()) == []
    last = started([*words, "0"], place, fmus)
    last.communicate(timeout=PATIENCE)
    assert last.returncode == 0
    tables = [read_table(folder) for folder in (parts, place / "whole")]
    for name in tables[0].columns:
        assert name == "seconds" or [*map(str, tables[0][name])] == [*map(str, tables[1][name])]
    assert not [path for path in parts.rglob("*") if path.name.startswith(".")]


def alive(group: int) -> bool:
    """Whether a process of the group is at work."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, _, found = stat.read_text().rpartition(")")[2].split()[:3]
            if int(found) == group and state != "Z":
                return True
    return False


def test_a_move_that_was_cut_short_is_brought_to_its_end(tmp_path: Path) -> None:
    """Killed between two files: there is no summary, and the next one puts the rest in its place."""
    from feedsim.report.results import MOVES_FILE, check_place

    scratch = tmp_path / ".feedsim-x"
    (scratch / "fresh" / "figures").mkdir(parents=True)
    (tmp_path / "result.csv").write_text("new")  # moved already
    (tmp_path / "log.csv").write_text("old")
    (tmp_path.parent / "outside").write_text("mine")
    for name in ("summary.json", "figures/a.png"):
        (scratch / "fresh" / name).write_text("new")
    moves = {name: f".feedsim-x/fresh/{name}" for name in ("result.csv", "figures/a.png", "summary.json")}
    (scratch / MOVES_FILE).write_text(json.dumps(moves | {"log.csv": None, "../outside": None}))
    check_place(tmp_path, (), kind="run")
    found = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert found == {"result.csv", "summary.json", "figures/a.png"}
    assert {(tmp_path / name).read_text() for name in found} == {"new"}
    assert (tmp_path.parent / "outside").exists()


def test_a_result_of_other_parameters_is_not_replaced_without_a_word(
    place: Path, fmus: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The default folder is that of the scenario, whatever --set says."""
    monkeypatch.chdir(place)
    said = {}
    for step, words in (
        ("base", []),
        ("other", ["--set", "name=Other"]),
        ("again", ["--set", "name=Other"]),
        ("back", []),
    ):
        assert main(["run", "short.yaml", "--quiet", "--fmus", str(fmus), *words]) == 0
        said[step] = capsys.readouterr().err
    folder = Path("results") / "short"
    replaced = "will be replaced; --out takes another folder"
    assert f"note: {folder}: its result is of other parameters and {replaced}" in said["other"]
    assert f"note: {folder}: its result is of other parameters (name=Other) and {replaced}" in said["back"]
    assert replaced not in said["base"] + said["again"]
