"""Report: what is written, that it is self-contained, deterministic, and whole or not at all."""

from __future__ import annotations

import json
import math
import re
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim import report
from feedsim.analysis import Figure, evaluate
from feedsim.errors import OutputError
from feedsim.nc import Program, plan
from feedsim.report.circle_plots import ring_step
from feedsim.report.style import LARGEST_SVG, MOST_POINTS, PALETTE, thinned
from feedsim.report.write import draw
from feedsim.scenario import Circle, CircleTest, Dwell, Move, Positioning, Scenario
from feedsim.trace import Trace, read_csv
from scenario_helpers import default_machine, scenario

LEAD = 0.020 / (2 * math.pi)


@dataclass(frozen=True)
class FakeRun:
    """A run as the report sees it; its trace is the plan with a delay, a ring-down and a friction step."""

    scenario: Scenario
    program: Program
    trace: Trace
    coupling: Mapping[str, float] = field(default_factory=lambda: {"Z.residual": 1.4e-5})
    wall_time: float = 0.5
    units: Mapping[str, Mapping[str, str]] = field(
        default_factory=lambda: {"plant": {"guid": "0011223344556677-8899aabbccddeeff", "version": "0.1.0"}}
    )
    warnings: tuple[str, ...] = ()


def run_of(described: Scenario, **changes: Any) -> FakeRun:
    program = plan(described)
    t = program.time
    columns: dict[str, Any] = {}
    for axis, x_s in program.x_s.items():
        n = program.n_ffw[axis]
        friction = 2.0 * np.tanh(n)
        ringing = 3e-6 * np.exp(-8 * t) * np.sin(130 * t)
        columns |= {
            f"{axis}.x_s": x_s,
            f"{axis}.x_a": x_s + ringing,
            f"{axis}.n_a": n,
            f"{axis}.M_fr": friction,
            f"{axis}.M_a": friction + 0.01 * np.gradient(n, t),
            f"{axis}.x_e": -ringing,
            f"tcp.x_{axis}": x_s + 1.2 * ringing,
        }
    return FakeRun(described, program, Trace(t, columns, dict.fromkeys(columns, "m")), **changes)


def positioning_run(**changes: Any) -> FakeRun:
    motions = (Move(by={"Z": 0.05}, feed=5 / 60), Dwell(duration=1.2))
    return run_of(scenario(*motions, evaluate=(Positioning(axis="Z"),), **changes))


def circle_run(**changes: Any) -> FakeRun:
    motions = (Circle(plane=("X", "Z"), radius=0.015, feed=0.1, turns=3), Dwell(duration=0.25))
    return run_of(scenario(*motions, evaluate=(CircleTest(),), **changes))


def small_run(**changes: Any) -> FakeRun:
    return run_of(scenario(Move(by={"X": 0.01}, feed=0.1)), **changes)


def contents(directory: Path) -> dict[str, bytes]:
    return {p.relative_to(directory).as_posix(): p.read_bytes() for p in sorted(directory.rglob("*")) if p.is_file()}


class Page(HTMLParser):
    """Ids, references and text of a page; fails on tags that are not closed."""

    VOID = ("meta", "img", "br", "link")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.references: list[str] = []
        self.tags: list[str] = []
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attributes:
            if name == "id":
                self.ids.append(str(value))
            if name in ("src", "href", "xlink:href", "data", "action"):
                self.references.append(str(value))

    def handle_startendtag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attributes)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


# -- what is written --------------------------------------------------------------------------------------------------


def test_files_of_a_positioning_run(tmp_path: Path) -> None:
    run = positioning_run()
    figures = evaluate(run)
    written = report.write(run, figures, tmp_path / "new" / "folder")
    directory = tmp_path / "new" / "folder"
    names = {"figures/positioning-Z.png", "result.csv", "report.html", "summary.json"}
    assert set(contents(directory)) == names
    assert {path.relative_to(directory).as_posix() for path in written} == names
    assert (directory / "figures/positioning-Z.png").read_bytes().startswith(b"\x89PNG")
    back = read_csv(directory / "result.csv")
    assert np.array_equal(back["Z.x_a"], run.trace["Z.x_a"])
    for path in written:
        assert stat.S_IMODE(path.stat().st_mode) & 0o444 == 0o444, f"{path} is not readable for others"


def test_summary_holds_every_figure_and_where_it_comes_from(tmp_path: Path) -> None:
    run = circle_run()
    figures = dict(evaluate(run)) | {"XZ.none": Figure(math.nan, "ms", "not in this trace")}
    report.write(run, figures, tmp_path)
    text = (tmp_path / "summary.json").read_text(encoding="utf-8")
    summary = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert set(summary["figures"]) == set(figures)
    assert summary["figures"]["XZ.G"] == {
        "value": figures["XZ.G"].value, "unit": "um", "meaning": figures["XZ.G"].meaning,
    }  # fmt: skip
    assert summary["figures"]["XZ.none"]["value"] is None
    assert summary["units"]["plant"]["guid"] == "0011223344556677-8899aabbccddeeff"
    assert "ynthetic" in summary["machine"]["note"]
    assert summary["scenario"]["duration"] == {"value": run.program.duration, "unit": "s"}
    assert summary["performance"]["wall_time"] == {"value": 0.5, "unit": "s"}
    assert {"python", "numpy", "ruckig"} <= set(summary["software"])
    assert set(summary["files"]) == {path for path in contents(tmp_path)}


@pytest.mark.parametrize("make", [positioning_run, circle_run])
def test_page_is_self_contained_and_well_formed(tmp_path: Path, make: Any) -> None:
    run = make()
    report.write(run, evaluate(run), tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert "script" not in page.tags
    assert "link" not in page.tags
    assert all(r.startswith(("#", "data:image/png;base64,")) for r in page.references)
    assert not re.search(r"url\((?!#)|@import", text)
    without_names = re.sub(r'xmlns(:\w+)?="[^"]*"', "", text)
    assert "://" not in without_names
    assert len(page.ids) == len(set(page.ids))
    local = {r[1:] for r in page.references if r.startswith("#")} | set(re.findall(r"url\(#([^)]+)\)", text))
    assert local <= set(page.ids)
    # every drawn colour follows the reader's light or dark setting
    drawings = re.findall(r"<svg.*?</svg>", text, re.DOTALL)
    assert drawings
    assert not re.search(r"#[0-9a-fA-F]{6}\b", "".join(drawings))
    assert set(re.findall(r"var\(--([a-z]+)\)", "".join(drawings))) <= {name for name, _, _ in PALETTE}
    words = " ".join(page.words)
    assert "synthetic" in words
    assert "0011223344556677-8899aabbccddeeff" in words
    for figure in evaluate(run):
        assert figure in words


def test_same_run_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        run = circle_run()
        report.write(run, evaluate(run), tmp_path / name)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_names_from_files_cannot_break_the_page(tmp_path: Path) -> None:
    run = positioning_run(name='<script>"&', note="a < b & c")
    report.write(run, evaluate(run), tmp_path)
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "script" not in page.tags
    assert "a < b & c" in page.words


def test_warnings_stand_at_the_top(tmp_path: Path) -> None:
    report.write(small_run(warnings=("Z: the torque was limited",)), {}, tmp_path)
    assert "Warning: Z: the torque was limited" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_one_line_for_the_terminal() -> None:
    run = circle_run()
    line = report.summary_line(
        run, {"XZ.G": Figure(8.19, "um", ""), "XZ.glitch_X": Figure(4.84, "um", ""), "XZ.mean": Figure(1, "um", "")}
    )
    assert line.startswith("XZ.G 8.19 um, XZ.glitch_X 4.84 um, ")
    assert "simulated in 0.5 s" in line
    assert "\n" not in line


# -- figures ----------------------------------------------------------------------------------------------------------


def test_display_sign_turns_torques_over_and_says_so() -> None:
    machine = default_machine()
    turned = machine.axes["Z"].model_copy(update={"display_sign": -1})
    run = positioning_run()
    other = positioning_run(machine=machine.model_copy(update={"axes": {**machine.axes, "Z": turned}}))
    figures = evaluate(run)
    assert figures == evaluate(other)  # a display sign is no result
    (plain,), (reversed_,) = draw(run, figures), draw(other, figures)
    assert "reversed" not in plain.caption
    assert "drawn with reversed sign" in reversed_.caption
    assert plain.png != reversed_.png


def test_axes_that_no_evaluation_shows_get_an_overview() -> None:
    run = run_of(
        scenario(Move(by={"X": 0.01, "Z": 0.02}, feed=0.1), Dwell(duration=0.5), evaluate=(Positioning(axis="Z"),))
    )
    stems = [picture.stem for picture in draw(run, evaluate(run))]
    assert stems == ["positioning-Z", "overview"]
    assert [picture.stem for picture in draw(small_run(), {})] == ["overview"]


def test_figures_do_with_what_is_recorded() -> None:
    """Positions alone: no torque, no tool point, no setpoint."""
    run = positioning_run()
    few = FakeRun(run.scenario, run.program, run.trace.select(["Z.x_a"]))
    assert [picture.stem for picture in draw(few, evaluate(few))] == ["positioning-Z"]
    run = circle_run()
    few = FakeRun(run.scenario, run.program, run.trace.select(["*.x_a"]))
    assert [picture.stem for picture in draw(few, evaluate(few))] == ["contour-XZ"]


def test_rings_are_10_um_where_that_is_readable() -> None:
    assert [ring_step(e) for e in (2.0, 8.2, 19.9)] == [10, 10, 10]
    assert ring_step(1.5) == 1
    assert ring_step(0.3) == 0.2
    assert ring_step(66.0) == 50
    assert ring_step(3e4) == 20_000
    assert ring_step(0.0) == 0.1


def test_long_curves_are_thinned_but_keep_their_extremes() -> None:
    x = np.arange(1_000_000.0)
    y = np.sin(x / 1000)
    y[[123_456, 654_321]] = 5.0, -7.0
    t, thin = thinned(x, y)
    assert len(t) <= MOST_POINTS + 2
    assert np.all(np.diff(t) > 0)
    assert (thin.max(), thin.min()) == (5.0, -7.0)
    assert thinned(x[:100], y[:100])[0] is not None


def test_long_recordings_stay_small_enough_for_a_page() -> None:
    machine = default_machine()
    run = run_of(scenario(*[Move(by={"Z": 0.02 * (-1) ** k}, feed=0.05) for k in range(120)], machine=machine))
    assert len(run.trace) > 40_000
    (picture,) = draw(run, {})
    assert len(picture.svg) < 3 * LARGEST_SVG
    assert len(picture.png) < 1_000_000


# -- whole or not at all ----------------------------------------------------------------------------------------------


def test_nothing_is_left_when_a_value_cannot_be_written(tmp_path: Path) -> None:
    run = small_run()
    report.write(run, {}, tmp_path / "kept")
    before = contents(tmp_path / "kept")
    spoilt = dict(run.trace.columns) | {"Z.M_a": np.full(len(run.trace), math.inf)}
    broken = FakeRun(run.scenario, run.program, Trace(run.trace.time, spoilt))
    with pytest.raises(OutputError, match=r"Z\.M_a is inf"):
        report.write(broken, {}, tmp_path / "kept")
    assert contents(tmp_path / "kept") == before
    with pytest.raises(OutputError):
        report.write(broken, {}, tmp_path / "fresh")
    assert not (tmp_path / "fresh").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["kept"]


@pytest.mark.parametrize("stuck", ["report.html", "figures/overview.png", "summary.json"])
def test_earlier_results_are_put_back_when_moving_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stuck: str
) -> None:
    run = small_run()
    report.write(run, {}, tmp_path)
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
        report.write(other, {}, tmp_path)
    assert contents(tmp_path) == before
    monkeypatch.undo()
    report.write(other, {}, tmp_path)
    assert contents(tmp_path)["report.html"] != before["report.html"]


def test_folders_made_for_results_go_when_moving_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(self: Path, target: Path) -> Path:
        if self.name == "summary.json":
            raise KeyboardInterrupt
        return replace(self, target)

    replace = Path.replace
    monkeypatch.setattr(Path, "replace", failing)
    with pytest.raises(KeyboardInterrupt):
        report.write(small_run(), {}, tmp_path / "new" / "folder")
    assert list(tmp_path.iterdir()) == []


def test_figures_of_an_earlier_run_go_and_other_files_stay(tmp_path: Path) -> None:
    circle, stop = circle_run(), positioning_run()
    report.write(circle, evaluate(circle), tmp_path)
    (tmp_path / "figures" / "mine.png").write_bytes(b"x")
    report.write(stop, evaluate(stop), tmp_path)
    assert set(contents(tmp_path)) == {
        "figures/positioning-Z.png", "figures/mine.png", "result.csv", "report.html", "summary.json",
    }  # fmt: skip


def test_foreign_summary_removes_nothing(tmp_path: Path) -> None:
    victim = tmp_path / "victim.png"
    victim.write_bytes(b"x")
    out = tmp_path / "out"
    out.mkdir()
    (out / "summary.json").write_text(json.dumps({"files": ["../victim.png", "figures/../../victim.png", 3, None]}))
    report.write(small_run(), {}, out)
    assert victim.exists()


# -- check before the simulation --------------------------------------------------------------------------------------


def test_writable_directories_pass_and_nothing_is_left(tmp_path: Path) -> None:
    report.check_writable(tmp_path)
    report.check_writable(tmp_path / "not" / "yet")
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written_to_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file is a file; allowed: a directory"):
        report.check_writable(tmp_path / "file")
    with pytest.raises(OutputError, match="file is a file; allowed: a directory"):
        report.check_writable(tmp_path / "file" / "below")
    (tmp_path / "out" / "report.html").mkdir(parents=True)
    with pytest.raises(OutputError, match=r"report\.html: is in the way of a result file"):
        report.check_writable(tmp_path / "out")
    if Path("/proc/self").is_dir():  # where even an administrator cannot write
        with pytest.raises(OutputError, match="/proc/self/out: cannot be written"):
            report.check_writable("/proc/self/out")
