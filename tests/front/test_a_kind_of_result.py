"""A kind of result that nobody knows: a function from its value, and terminal, page, summary.json, notebook follow."""

from __future__ import annotations

import json
from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from feedsim.analysis import Figure, FigureTable
from feedsim.cli.commands import finish
from feedsim.files.trace import Array, Trace
from feedsim.foundation.arguments import Call, call_context
from feedsim.foundation.errors import Finding, InputError, OutputError
from feedsim.jobs.parameters import command_line
from feedsim.jobs.result import Kind, Result
from feedsim.report.chart import Axis, Chart, Curve, Panel
from feedsim.report.content import FOLDER, Picture, Report, Step
from feedsim.report.formatting import SIMULATED_COLOUR

KIND = Kind("spectrum", ("lines.csv",), keeps=("*.yaml",))


@dataclass(frozen=True)
class Spectrum:
    """frequency (F,) [Hz], amplitude (F,) [um]."""

    frequency: Array
    amplitude: Array
    trace: Trace

    @property
    def highest(self) -> float:
        """Frequency of the highest line [Hz]."""
        return float(self.frequency[np.argmax(self.amplitude)])

    def __getitem__(self, hertz: float) -> float:
        return float(np.interp(hertz, self.frequency, self.amplitude))

    def __len__(self) -> int:
        return len(self.frequency)


def result_of(spectrum: Spectrum, begun: list[str]) -> Result[Spectrum]:
    """begun: what was computed is appended to it."""

    def report() -> Report:
        begun.append("report")
        panel = Panel(
            "", Axis("f", "Hz"), Axis("x", "µm"), [Curve("x", spectrum.frequency, spectrum.amplitude, SIMULATED_COLOUR)]
        )
        return Report(
            "Spectrum of Z", "1 axis", answer=["The highest line is at 20 Hz.", "It is the table's."],
            warnings=[
                Finding("columns-mapped", "note", "2 s were recorded"),
                Finding("rows-missing", "doubt", "the record is short"),
                Finding("torque-clipped", "wrong", "the axis is clipped", "Z", "axes.Z.drive.M_max=9 N.m"),
            ],
            action="Type 20 Hz.", next_step=Step("Look again", "diff", {"results": [FOLDER]}),
            main=[Picture("spectrum", "Spectrum", "Amplitude.", Chart([panel]))], footer="",
        )  # fmt: skip

    def figures() -> FigureTable:
        begun.append("figures")
        return FigureTable({"Z.highest": Figure(spectrum.highest, "Hz", "highest line")})

    return Result(
        KIND, spectrum, report, figures=figures, details={"lines": len(spectrum)},
        files=lambda: {"lines.csv": "f,x\n", "axis.yaml": "Z: 1\n"}, rows=["  2 lines"],
    )  # fmt: skip


@pytest.fixture
def begun() -> list[str]:
    return []


@pytest.fixture
def result(begun: list[str]) -> Result[Spectrum]:
    trace = Trace(np.arange(3.0), {"Z.x_a": np.zeros(3)}, {"Z.x_a": "m"})
    with call_context(Call({"figures": ()}, command_line)):
        return result_of(Spectrum(np.array([10.0, 20.0]), np.array([1.0, 3.0]), trace), begun)


def test_nothing_is_computed_before_it_is_asked_for_and_then_once(result: Result[Spectrum], begun: list[str]) -> None:
    assert result.highest == 20.0
    assert begun == []
    assert [*result.answers] == ["The highest line is at 20 Hz.", "It is the table's."]
    assert result.report() is result.report()
    assert result.figures["Z.highest"].unit == result.figures["Z.highest"].unit
    assert begun == ["report", "figures"]


def test_the_value_is_reached_through_the_result(result: Result[Spectrum]) -> None:
    assert (result[15.0], len(result), result.kind) == (2.0, 2, "spectrum")
    assert {"highest", "frequency", "figures", "save", "plot"} <= set(dir(result))
    assert repr(result) == "Result of spectrum: The highest line is at 20 Hz.; 2 warnings, see .findings"
    assert result.plot().stem == "spectrum"
    assert "Z.x_a" in result.plot("Z.x_a").caption
    with pytest.raises(InputError, match=r"no figure 'Z\.hihgest'; did you mean 'Z\.highest'"):
        result.figures["Z.hihgest"]


def test_terminal_page_json_and_notebook_say_the_same(
    result: Result[Spectrum], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result.save(tmp_path)
    options = Namespace(quiet=False, json=False, verbose=True, strict=True)
    assert finish(result, tmp_path, options) == 1  # --strict: it is wrong
    said = capsys.readouterr()
    assert said.out.splitlines() == [
        "WRONG: the axis is clipped", "The highest line is at 20 Hz.", "Type 20 Hz.", "It is the table's.", "  2 lines",
        "  Z.highest = 20 Hz: highest line", "Next: Look again:", f"  feedsim diff {tmp_path.as_posix()}",
        f"-> {tmp_path / 'report.html'}",
    ]  # fmt: skip
    assert said.err.splitlines() == [
        "feedsim: WRONG: the axis is clipped", "feedsim: warning: the record is short",
        "feedsim: note: 2 s were recorded",
    ]  # fmt: skip
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert (summary["kind"], summary["lines"], summary["keeps"]) == ("spectrum", 2, ["axis.yaml"])
    assert summary["answer"] == [*result.answers]
    assert summary["figures"] == {"Z.highest": {"value": 20.0, "unit": "Hz", "meaning": "highest line"}}
    assert summary["findings"][0] == {
        "code": "torque-clipped", "severity": "wrong", "text": "the axis is clipped", "place": "Z",
        "remedy": "axes.Z.drive.M_max=9 N.m",
    }  # fmt: skip
    assert set(summary["files"]) == {"report.html", "summary.json", "lines.csv", "axis.yaml"}
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for sentence in (*result.answers, "the axis is clipped", "Type 20 Hz."):
        assert sentence.replace("'", "’") in page or sentence in page.replace("&#39;", "'")
        assert sentence.split("'")[0] in result._repr_html_()
    finish(result, tmp_path, Namespace(quiet=False, json=True, verbose=False, strict=False))
    assert json.loads(capsys.readouterr().out) == summary


def test_a_file_of_somebody_else_stays(result: Result[Spectrum], tmp_path: Path) -> None:
    (tmp_path / "lines.csv").write_text("mine")
    with pytest.raises(OutputError, match=r"lines\.csv: exists already"):
        KIND.check_place(tmp_path)
    with pytest.raises(OutputError, match=r"lines\.csv: exists already"):
        result.save(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["lines.csv"]
