"""Results are written whole or not at all, and whether they can be is checked before the simulation."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from feedsim.analysis import evaluate
from feedsim.files.trace import Trace
from feedsim.foundation.errors import OutputError
from feedsim.foundation.outputs import allow_replacement
from feedsim.jobs.run import KIND
from feedsim.report.content import Report
from feedsim.report.results import write_report
from report_helpers import FakeRun, circle_run, contents, positioning_run, small_run, write_run

# -- whole or not at all ----------------------------------------------------------------------------------------------


def test_nothing_is_left_when_a_value_cannot_be_written(tmp_path: Path) -> None:
    run = small_run()
    write_run(run, {}, tmp_path / "kept")
    before = contents(tmp_path / "kept")
    spoilt = dict(run.trace.columns) | {"Z.M_a": np.full(len(run.trace), math.inf)}
    broken = FakeRun(run.scenario, run.program, Trace(run.trace.time, spoilt))
    with pytest.raises(OutputError, match=r"Z\.M_a is inf"):
        write_run(broken, {}, tmp_path / "kept")
    assert contents(tmp_path / "kept") == before
    with pytest.raises(OutputError):
        write_run(broken, {}, tmp_path / "fresh")
    assert not (tmp_path / "fresh").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["kept"]


@pytest.mark.parametrize("stuck", ["report.html", "figures/overview.png", "summary.json"])
def test_earlier_results_are_put_back_when_moving_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stuck: str
) -> None:
    run = small_run()
    write_run(run, {}, tmp_path, drawn=("png",))
    (tmp_path / "notes.txt").write_text("mine")
    before = contents(tmp_path)
    replace = Path.replace

    def failing(self: Path, target: Path) -> Path:
        if Path(target) == tmp_path / stuck and self.parent != tmp_path and "fresh" in self.parts:
            raise OSError(28, "No space left on device")
        return replace(self, target)

    other = FakeRun(run.scenario, run.program, run.trace, wall_time=1.0)
    monkeypatch.setattr(Path, "replace", failing)
    with pytest.raises(OutputError, match="No space left on device"):
        write_run(other, {}, tmp_path, drawn=("png",))
    assert contents(tmp_path) == before
    monkeypatch.undo()
    write_run(other, {}, tmp_path)
    assert contents(tmp_path)["report.html"] != before["report.html"]


def test_folders_made_for_results_go_when_moving_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(self: Path, target: Path) -> Path:
        if self.name == "summary.json":
            raise KeyboardInterrupt
        return replace(self, target)

    replace = Path.replace
    monkeypatch.setattr(Path, "replace", failing)
    with pytest.raises(KeyboardInterrupt):
        write_run(small_run(), {}, tmp_path / "new" / "folder")
    assert list(tmp_path.iterdir()) == []


def test_figures_of_an_earlier_run_go_and_other_files_stay(tmp_path: Path) -> None:
    circle, stop = circle_run(), positioning_run()
    write_run(circle, evaluate(circle), tmp_path, drawn=("png",))
    (tmp_path / "figures" / "mine.png").write_bytes(b"x")
    write_run(stop, evaluate(stop), tmp_path, drawn=("png",))
    assert set(contents(tmp_path)) == {
        *(f"figures/{stem}.png" for stem in ("positioning-Z", "overview", "mine")),
        *("result.csv", "report.html", "summary.json"),
    }  # fmt: skip


def test_foreign_summary_removes_nothing(tmp_path: Path) -> None:
    victim = tmp_path / "victim.png"
    victim.write_bytes(b"x")
    out = tmp_path / "out"
    out.mkdir()
    (out / "summary.json").write_text(json.dumps({"files": ["../victim.png", "figures/../../victim.png", 3, None]}))
    write_run(small_run(), {}, out)
    assert victim.exists()


def test_a_result_of_a_kind_nobody_knows_goes_but_for_what_it_keeps(tmp_path: Path) -> None:
    """Ownership asks the summary alone: a new kind of result needs no entry elsewhere."""
    content = Report("Odd", "", main=[], footer="", answer=["It is odd."])
    written = write_report(tmp_path, content, {}, {"odd.csv": "x", "odd.yaml": "y"}, kind="odd", keeps=("odd.yaml",))
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert {"kind", "version", "answer", "figures", "warnings", "findings", "files", "keeps"} <= set(summary)
    assert (summary["kind"], summary["answer"], summary["keeps"]) == ("odd", ["It is odd."], ["odd.yaml"])
    assert set(summary["files"]) == {str(path.relative_to(tmp_path)) for path in written}
    (tmp_path / "mine.csv").write_text("mine")
    with allow_replacement():
        write_run(small_run(), {}, tmp_path)
    assert not (tmp_path / "odd.csv").exists()
    assert (tmp_path / "odd.yaml").read_text() == "y"
    assert (tmp_path / "mine.csv").read_text() == "mine"


def test_friction_outlives_the_results_that_it_came_with(tmp_path: Path) -> None:
    """Curves of an identification go with it; friction.yaml may be named by a scenario by now."""
    curves = ["plateaus.csv", "residuals.csv", "open_loop.csv", "figures/stribeck.png"]
    (tmp_path / "figures").mkdir()
    for name in ("friction.yaml", *curves):
        (tmp_path / name).write_text("x")
    (tmp_path / "summary.json").write_text(json.dumps({"files": ["friction.yaml", *curves]}))
    write_run(small_run(), {}, tmp_path)
    assert not [name for name in curves if (tmp_path / name).exists()]
    assert (tmp_path / "friction.yaml").read_text() == "x"
    assert "friction.yaml" not in json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["files"]


# -- check before the simulation --------------------------------------------------------------------------------------


def test_writable_directories_pass_and_nothing_is_left(tmp_path: Path) -> None:
    KIND.check_place(tmp_path)
    KIND.check_place(tmp_path / "not" / "yet")
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written_to_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file is a file; allowed: a directory"):
        KIND.check_place(tmp_path / "file")
    with pytest.raises(OutputError, match="file is a file; allowed: a directory"):
        KIND.check_place(tmp_path / "file" / "below")
    (tmp_path / "out" / "report.html").mkdir(parents=True)
    with pytest.raises(OutputError, match=r"report\.html: is in the way of a result file"):
        KIND.check_place(tmp_path / "out")
    if Path("/proc/self").is_dir():  # where even an administrator cannot write
        with pytest.raises(OutputError, match="/proc/self/out: cannot be written"):
            KIND.check_place(Path("/proc/self/out"))
