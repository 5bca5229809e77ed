"""feedsim sweep from the study file to the table: resumed, killed, failed, and each row made again by itself."""

from __future__ import annotations

import json
import os
import re
import shlex
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from random import Random

import pytest

from command_helpers import rows_of
from feedsim import analysis
from feedsim.cli import main
from feedsim.design.sweep import read_table
from feedsim.design.sweep.study import Progress, run
from feedsim.foundation import units
from feedsim.foundation.errors import InputError, OutputError, SimulationError
from feedsim.scenario import load
from feedsim.scenario.study import load_study
from feedsim.simulation import cosim

Write = Callable[..., Path]


def test_table_and_record(study: Write, fmus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["sweep", str(study()), "--out", str(out), "--workers", "0", "--fmus", str(fmus)]) == 0
    assert "16 runs" in capsys.readouterr().out
    found = read_table(out)
    assert len(found) == 16
    assert found.ok.all()
    assert "Z.overshoot" in found.figures
    assert len(set(found["Z.overshoot"])) > 8
    record = json.loads((out / "study.json").read_text())
    assert (record["done"], record["failed"], record["partial"]) == (16, 0, False)
    assert re.fullmatch("[0-9a-f]{64}", record["parts"]["plant.fmu"])
    assert (out / "report.html").is_file()
    unchanged = analysis.evaluate(cosim.run(load_study(study()).base.scenario, fmus=fmus))["Z.overshoot"]
    assert record["nominal"]["Z.overshoot"] == units.convert(unchanged.value, unchanged.unit, found.unit("Z.overshoot"))
    assert json.loads((out / "summary.json").read_text())["figures"]["Z.overshoot"]["nominal"] == pytest.approx(
        record["nominal"]["Z.overshoot"], rel=1e-12
    )

    # Again: nothing is run, the same table is written.
    before = (out / "table.csv").read_bytes()
    assert main(["sweep", str(study()), "--out", str(out), "--workers", "0", "--fmus", str(fmus)]) == 0
    assert "16 of them before" in capsys.readouterr().out
    assert (out / "table.csv").read_bytes() == before
    assert json.loads((out / "study.json").read_text())["nominal"] == record["nominal"]


def test_a_row_made_by_itself_is_the_same(
    study: Write, fmus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`feedsim run` with the settings of the row: the same figures, bit for bit."""
    monkeypatch.chdir(tmp_path)
    file = study(study().read_text() + "set: {machine.axes.Z.friction.sigma_2: 0.005 N.m.s/rad}\n")
    assert main(["sweep", str(file), "--out", "out", "--workers", "0", "--fmus", str(fmus), "--quiet"]) == 0
    found = read_table(tmp_path / "out")
    for row in (0, 11):
        capsys.readouterr()
        assert main(["sweep", str(file), "--row", str(row), "--fmus", str(fmus)]) == 0
        command = shlex.split(capsys.readouterr().out)
        assert command[:2] == ["feedsim", "run"]
        assert main(command[1:]) == 0
        assert (tmp_path / command[-1] / "result.csv").is_file()
        settings = [value for option, value in pairwise(command) if option == "--set"]
        figures = analysis.evaluate(cosim.run(load(command[2], settings), fmus=fmus))
        for name in found.figures:
            value = units.convert(figures[name].value, figures[name].unit, found.unit(name))
            assert struct.pack("d", value) == struct.pack("d", found[name][row])
    assert main(["sweep", str(file), "--row", "16"]) == 2


def test_failed_runs_are_rows(study: Write, fmus: Path, tmp_path: Path) -> None:
    text = study().read_text().replace("to: 2 N.m", "to: 3 N.m")  # F_C above F_S is refused
    found = run(load_study(study(text)), tmp_path / "out", workers=0, fmus=fmus)
    failed = ~found.ok
    assert 0 < failed.sum() < 16
    assert all("static friction is at least Coulomb friction" in text for text in found["message"][failed])
    assert all(found["F_C"][failed] > found["F_C"][~failed].max())
    assert all(value != value for value in found["Z.overshoot"][failed])


def test_all_failed(study: Write, fmus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = study(study().read_text().replace("from: 1.2 N.m, to: 2 N.m", "from: 20 N.m, to: 30 N.m"))
    assert main(["sweep", str(file), "--out", str(tmp_path / "out"), "--workers", "0", "--fmus", str(fmus)]) == 3
    assert "all 16 runs failed; run 0: " in capsys.readouterr().err
    assert len(read_table(tmp_path / "out")) == 16


def test_a_figure_that_there_is_not_ends_the_study_at_once(study: Write, fmus: Path, tmp_path: Path) -> None:
    told: list[Progress] = []
    with pytest.raises(InputError, match=r"'Z\.overshot' is none of the figures; did you mean 'Z\.overshoot'"):
        run(load_study(study(study().read_text() + "figures: [Z.overshot]\n")), tmp_path / "out", workers=0, fmus=fmus,
            progress=told.append)  # fmt: skip
    assert told[-1].done <= 1
    # Which figures are wanted decides no run: with the right name it goes on.
    found = run(load_study(study(study().read_text() + "figures: [Z.overshoot]\n")), tmp_path / "out", workers=0,
                fmus=fmus, progress=told.append)  # fmt: skip
    assert found.figures == ("Z.overshoot",)
    assert told[-1].resumed == 1


def test_interrupted_and_continued(study: Write, fmus: Path, tmp_path: Path) -> None:
    loaded = load_study(study())
    run(loaded, tmp_path / "whole", workers=0, fmus=fmus)

    def stop(now: Progress) -> None:
        if now.done == now.resumed + 5:
            raise KeyboardInterrupt

    for _ in range(3):
        with pytest.raises(KeyboardInterrupt):
            run(loaded, tmp_path / "parts", workers=0, fmus=fmus, progress=stop)
        assert read_table(tmp_path / "parts").partial
    assert json.loads((tmp_path / "parts" / "study.json").read_text())["done"] == 15
    run(loaded, tmp_path / "parts", workers=0, fmus=fmus)
    assert rows_of(tmp_path / "parts") == rows_of(tmp_path / "whole")


@pytest.mark.parametrize("end", [SystemExit(143), SimulationError("the scheduler is lost")], ids=["SIGTERM", "lost"])
def test_other_ends_leave_a_table_too(study: Write, fmus: Path, tmp_path: Path, end: BaseException) -> None:
    def stop(now: Progress) -> None:
        if now.done == 3:
            raise end

    with pytest.raises(type(end)) as raised:
        run(load_study(study()), tmp_path / "out", workers=0, fmus=fmus, progress=stop)
    assert raised.value is end
    assert len(read_table(tmp_path / "out")) == 3
    assert json.loads((tmp_path / "out" / "study.json").read_text())["partial"]


def test_a_table_that_cannot_be_written_leaves_the_end_as_it_is(
    study: Write, fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def stop(now: Progress) -> None:
        if now.done == 3:
            raise SystemExit(143)

    def full(*_: object) -> None:
        raise OutputError("no space left")

    monkeypatch.setattr("feedsim.design.sweep.study.write_table", full)
    with pytest.raises(SystemExit):
        run(load_study(study()), tmp_path / "out", workers=0, fmus=fmus, progress=stop)
    assert "no table of the runs that are done: no space left" in caplog.text


def test_another_state_of_the_study_is_refused(study: Write, fmus: Path, tmp_path: Path) -> None:
    run(load_study(study(), runs=2), tmp_path / "out", workers=0, fmus=fmus)
    for text, overrides, differs in (
        (study().read_text().replace("1.2 N.m", "1.25 N.m"), [], "parameters and sampling"),
        (study().read_text(), ["motions.0.feed=2 m/min"], "scenario and machine"),
    ):
        with pytest.raises(InputError, match=f"what differs: .*{differs}"):
            run(load_study(study(text), overrides, runs=2), tmp_path / "out", workers=0, fmus=fmus)
    run(load_study(study(), runs=2), tmp_path / "out", workers=0, fmus=fmus)


@pytest.mark.extensive
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
def test_killed_and_continued(study: Write, fmus: Path, tmp_path: Path) -> None:
    """The whole command killed at random moments; the table in the end is that of a study nobody has disturbed."""
    file = study(study().read_text().replace("runs: 16", "runs: 64"))
    run(load_study(file), tmp_path / "whole", workers=0, fmus=fmus)
    command = [sys.executable, "-c", "from feedsim.cli import entry; entry()", "sweep", str(file)]
    command += ["--out", str(tmp_path / "killed"), "--workers", "0", "--fmus", str(fmus)]
    random, journal, killed = Random(11), tmp_path / "killed" / "runs.jsonl", 0
    for _ in range(3):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        before = journal.stat().st_size if journal.exists() else 0
        while process.poll() is None and not (journal.exists() and journal.stat().st_size > before + 2000):
            time.sleep(0.005)
        time.sleep(random.uniform(0, 0.05))
        if process.poll() is None:
            os.kill(process.pid, signal.SIGKILL)
            killed += 1
        process.wait()
    assert killed
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    assert rows_of(tmp_path / "killed") == rows_of(tmp_path / "whole")
    lines = journal.read_bytes().splitlines()
    assert sorted(json.loads(line)["run"] for line in lines[2:]) == [*range(64)]
