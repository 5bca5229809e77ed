"""feedsim sweep once more in the same folder: with more runs, after --restart, in several sessions."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from command_helpers import rows_of
from feedsim.cli import main
from feedsim.design.sweep import design, read_table
from feedsim.design.sweep.study import Progress, run
from feedsim.foundation.errors import InputError
from feedsim.scenario.study import load_study

Write = Callable[..., Path]
SENSITIVITY = ("sobol, runs: 16", "sensitivity, runs: 4")


def stop_after(number: int) -> Callable[[Progress], None]:
    def tell(now: Progress) -> None:
        if now.done == now.resumed + number:
            raise KeyboardInterrupt

    return tell


@pytest.mark.parametrize(("method", "few", "many"), [("sobol", 6, 16), ("sensitivity", 2, 4)])
def test_more_runs_begin_with_the_same_ones(study: Write, method: str, few: int, many: int) -> None:
    file = study(study().read_text().replace("method: sobol", f"method: {method}"))
    short, long = (design(load_study(file, runs=runs)) for runs in (few, many))
    assert short.runs < long.runs
    assert np.array_equal(long.values[: short.runs], short.values)


@pytest.mark.parametrize("text", [("", ""), SENSITIVITY], ids=["sobol", "sensitivity"])
def test_a_longer_study_goes_on_with_the_runs_of_a_shorter_one(
    study: Write, fmus: Path, tmp_path: Path, text: tuple[str, str]
) -> None:
    file = study(study().read_text().replace(*text) if text[0] else study().read_text())
    few, many = (2, 4) if text[0] else (5, 12)
    whole = run(load_study(file, runs=many), tmp_path / "whole", workers=0, fmus=fmus)
    short = run(load_study(file, runs=few), tmp_path / "out", workers=0, fmus=fmus)
    told: list[Progress] = []
    run(load_study(file, runs=many), tmp_path / "out", workers=0, fmus=fmus, progress=told.append)
    assert told[0] == Progress(len(short), 0, len(whole), len(short))
    assert rows_of(tmp_path / "out") == rows_of(tmp_path / "whole")
    # Once more: the journal knows that the runs have become more.
    run(load_study(file, runs=many), tmp_path / "out", workers=0, fmus=fmus, progress=told.append)
    assert told[-1].resumed == len(whole)


def test_fewer_runs_than_the_folder_has_are_refused(study: Write, fmus: Path, tmp_path: Path) -> None:
    run(load_study(study(), runs=4), tmp_path / "out", workers=0, fmus=fmus)
    before = (tmp_path / "out" / "runs.jsonl").read_bytes()
    with pytest.raises(InputError, match="the study with 4 runs, the first 2 of which are asked for; take 4 runs or"):
        run(load_study(study(), runs=2), tmp_path / "out", workers=0, fmus=fmus)
    assert (tmp_path / "out" / "runs.jsonl").read_bytes() == before


@pytest.mark.parametrize("change", [("seed: 7", "seed: 8"), ("method: sobol", "method: latin_hypercube")])
def test_other_points_are_refused(study: Write, fmus: Path, tmp_path: Path, change: tuple[str, str]) -> None:
    run(load_study(study(), runs=2), tmp_path / "out", workers=0, fmus=fmus)
    other = study(study().read_text().replace(*change))
    with pytest.raises(InputError, match="what differs: parameters and sampling"):
        run(load_study(other, runs=4), tmp_path / "out", workers=0, fmus=fmus)


def test_points_that_only_begin_alike_are_refused(study: Write, fmus: Path, tmp_path: Path) -> None:
    """A library that draws other points from the same seed: the journal holds what tells them."""
    run(load_study(study(), runs=2), tmp_path / "out", workers=0, fmus=fmus)
    journal = tmp_path / "out" / "runs.jsonl"
    lines = journal.read_text().splitlines(keepends=True)
    extent = json.loads(lines[1])
    assert extent["runs"] == 2
    journal.write_text("".join([lines[0], json.dumps({**extent, "first": "0" * 64}) + "\n", *lines[2:]]))
    with pytest.raises(InputError, match="what differs: parameters and sampling"):
        run(load_study(study(), runs=4), tmp_path / "out", workers=0, fmus=fmus)


def test_a_latin_hypercube_of_more_runs_is_another(study: Write, fmus: Path, tmp_path: Path) -> None:
    file = study(study().read_text().replace("method: sobol", "method: latin_hypercube"))
    run(load_study(file, runs=2), tmp_path / "out", workers=0, fmus=fmus)
    with pytest.raises(InputError, match="what differs: parameters and sampling"):
        run(load_study(file, runs=4), tmp_path / "out", workers=0, fmus=fmus)


def test_sessions(study: Write, fmus: Path, tmp_path: Path) -> None:
    """Each time that runs were made is on record, also one that was killed."""
    out, loaded = tmp_path / "out", load_study(study(), runs=8)
    with pytest.raises(KeyboardInterrupt):
        run(loaded, out, workers=0, fmus=fmus, progress=stop_after(3), command=["first"])
    with pytest.raises(KeyboardInterrupt):
        run(loaded, out, workers=0, fmus=fmus, progress=stop_after(2), command=["killed"])
    record = json.loads((out / "study.json").read_text())
    assert [each["runs"] for each in record["sessions"]] == [3, 2]
    record["sessions"][1] |= {"ended": None, "runs": None}  # as the record stands while a session is at work
    (out / "study.json").write_text(json.dumps(record))
    for _ in range(2):  # the second time nothing is left to do, which is no session
        run(loaded, out, workers=0, fmus=fmus, command=["last"])
    sessions = json.loads((out / "study.json").read_text())["sessions"]
    assert [(each["command"], each["runs"]) for each in sessions] == [(["first"], 3), (["killed"], 2), (["last"], 3)]
    assert sessions[0]["began"] <= sessions[0]["ended"] <= sessions[2]["began"] <= sessions[2]["ended"]
    assert sessions[1]["ended"] is None


def test_restart_leaves_nothing_of_what_was_there(
    study: Write, fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Interrupted after --restart: no report of the other study beside the new table; what is not ours stays."""
    out = tmp_path / "out"
    arguments = ["--out", str(out), "--workers", "0", "--fmus", str(fmus), "--quiet"]
    assert main(["sweep", str(study()), *arguments, "--figures", "png"]) == 0
    drawn = [*(out / "figures").iterdir()]
    assert drawn
    (out / "notes.txt").write_text("mine")
    (out / "figures" / "own.png").write_text("mine")

    def interrupted(*given: object, **named: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("feedsim.design.sweep.study.open_engine", interrupted)
    other = study(study().read_text().replace("seed: 7", "seed: 8"))
    assert main(["sweep", str(other), *arguments, "--restart"]) == 130
    left = sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
    assert left == ["figures/own.png", "notes.txt", "runs.jsonl"]


def test_a_report_where_all_runs_failed(study: Write, fmus: Path, tmp_path: Path) -> None:
    file = study(study().read_text().replace("from: 1.2 N.m, to: 2 N.m", "from: 20 N.m, to: 30 N.m"))
    assert main(["sweep", str(file), "--out", str(tmp_path / "out"), "--workers", "0", "--fmus", str(fmus)]) == 3
    page = (tmp_path / "out" / "report.html").read_text()
    assert "static friction is at least Coulomb friction" in page
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert sum(each["count"] for each in summary["failures"]) == 16
    assert not read_table(tmp_path / "out").ok.any()
