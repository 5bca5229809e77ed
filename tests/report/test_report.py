"""Report: what is written, that it is self-contained and deterministic, and what the terminal says."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
import stat
import subprocess
import sys
from argparse import Namespace
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from feedsim.analysis import Figure, evaluate
from feedsim.cli.commands import finish, warn
from feedsim.files.trace import read_csv
from feedsim.foundation.errors import Finding
from feedsim.jobs.check import CheckReport
from feedsim.motions import Arc, Dwell, Move
from feedsim.report import run as report
from feedsim.report.chart import Axis, Chart, Curve, Panel
from feedsim.report.chart.model import embed_charts
from feedsim.report.content import Tile
from feedsim.report.formatting import PAGE_COLOURS
from feedsim.report.page import script
from feedsim.report.run.files import details
from feedsim.report.run.report import HEADER, moved_words, real_time_factor, tile
from report_helpers import Page, circle_run, contents, positioning_run, run_of, write_run
from scenario_helpers import scenario

# -- what is written --------------------------------------------------------------------------------------------------


def test_files_of_a_positioning_run(tmp_path: Path) -> None:
    run = positioning_run()
    figures = evaluate(run)
    written = write_run(run, figures, tmp_path / "new" / "folder")
    directory = tmp_path / "new" / "folder"
    names = {"result.csv", "report.html", "summary.json"}
    assert set(contents(directory)) == names
    assert {path.relative_to(directory).as_posix() for path in written} == names
    back = read_csv(directory / "result.csv")
    assert np.array_equal(back["Z.x_a"], run.trace["Z.x_a"])
    for file in written:
        assert stat.S_IMODE(file.stat().st_mode) & 0o444 == 0o444, f"{file} is not readable for others"


def test_figures_are_drawn_where_they_are_asked_for(tmp_path: Path) -> None:
    run = positioning_run()
    write_run(run, evaluate(run), tmp_path, drawn=("png", "svg"))
    drawn = {f"figures/{stem}.{kind}" for stem in ("positioning-Z", "overview") for kind in ("png", "svg")}
    assert set(contents(tmp_path)) == drawn | {"result.csv", "report.html", "summary.json"}
    assert (tmp_path / "figures/positioning-Z.png").read_bytes().startswith(b"\x89PNG")
    svg = (tmp_path / "figures/positioning-Z.svg").read_text(encoding="utf-8")
    assert ElementTree.fromstring(svg.replace("xlink:href", "href")).tag.endswith("svg")
    assert "var(--" not in svg, "a file of its own has no style sheet beside it"
    write_run(run, evaluate(run), tmp_path)
    assert set(contents(tmp_path)) == {"result.csv", "report.html", "summary.json"}


def test_charts_as_files_need_no_matplotlib(tmp_path: Path) -> None:
    """It takes longer to load than a run."""
    script = (
        "import sys; from pathlib import Path; sys.path.insert(0, 'tests');"
        "from feedsim.analysis import evaluate; from report_helpers import circle_run, write_run;"
        "run = circle_run(); write_run(run, evaluate(run), Path(sys.argv[1]), drawn=('png',));"
        "print('matplotlib' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path)], cwd=Path(__file__).parents[2], capture_output=True, text=True
    )
    assert done.stdout == "False\n", done.stderr


def test_summary_holds_every_figure_and_where_it_comes_from(tmp_path: Path) -> None:
    run = circle_run()
    figures = dict(evaluate(run)) | {"XZ.none": Figure(math.nan, "ms", "not in this trace")}
    write_run(run, figures, tmp_path)
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
    write_run(run, evaluate(run), tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    own = re.findall(r"<script[^>]*>(.*?)</script>", text, re.DOTALL)
    assert page.tags.count("script") == len(own) == 2
    assert set(json.loads(own[0])) == {"charts", "palette", "arrays"}
    assert own[1] == script()
    digest = base64.b64encode(hashlib.sha256(own[1].encode()).digest()).decode()
    policy = f"default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    assert f'content="{policy}"' in unescape(text)
    text = text.replace(own[1], "")  # it draws into the name space of SVG
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
    assert set(re.findall(r"var\(--([a-z]+)\)", "".join(drawings))) <= PAGE_COLOURS.keys()
    words = " ".join(page.words)
    assert "Synthetic machine" in words
    assert "0011223344556677-8899aabbccddeeff" in words
    for figure in evaluate(run):
        assert figure in words


def test_same_run_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        run = circle_run()
        write_run(run, evaluate(run), tmp_path / name)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_names_from_files_cannot_break_the_page(tmp_path: Path) -> None:
    run = positioning_run(name='<script>"&', note="a < b & c")
    write_run(run, evaluate(run), tmp_path)
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert page.tags.count("script") == 2
    curves = [Curve("<b>", np.arange(2.0), np.ones(2))]
    foreign = Chart([Panel("</script><script>alert(1)", Axis("&"), Axis("y"), curves)])
    data = embed_charts({"a": foreign})
    assert not set("<>&") & set(data)
    assert json.loads(data)["charts"]["a"]["panels"][0]["title"] == "</script><script>alert(1)"
    assert "a < b & c" in page.words


def test_warnings_stand_at_the_top(tmp_path: Path) -> None:
    limited = Finding("torque-clipped", "doubt", "Z: the torque was < limited", "Z")
    run = replace(positioning_run(), warnings=(limited,))
    write_run(run, evaluate(run), tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    warning = text.index("<strong>Warning:</strong> Z: the torque was &lt; limited")
    assert text.index("<h1>") < warning < text.index('class="note"') < text.index('class="keys"')
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["warnings"] == [limited.text]
    assert summary["findings"] == [
        {"code": "torque-clipped", "severity": "doubt", "text": limited.text, "place": "Z", "remedy": ""}
    ]
    write_run(positioning_run(), {}, tmp_path)
    assert 'role="alert"' not in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_what_is_wrong_is_said_first_and_in_red(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    doubt = Finding("not-settled", "doubt", "doubtful")
    wrong, note = (
        Finding("compensation-worse", "wrong", "worse than < before"), Finding("values-to-check", "note", "as built"),
    )  # fmt: skip
    found = (note, doubt, wrong, doubt)
    write_run(replace(positioning_run(), warnings=found), {}, tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    first = page.index('<p class="wrong"><strong>Wrong:</strong> worse than &lt; before</p>')
    assert first < page.index("<strong>Warning:</strong> doubtful") < page.index('<p class="note">as built</p>')
    told = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert told["warnings"] == ["worse than < before", "doubtful"]
    assert [each["severity"] for each in told["findings"]] == ["wrong", "doubt", "note"]
    warn(found)
    assert capsys.readouterr().err.splitlines() == [
        "feedsim: WRONG: worse than < before", "feedsim: warning: doubtful", "feedsim: note: as built",
    ]  # fmt: skip
    options = Namespace(quiet=False, json=False, verbose=False, strict=False)
    assert finish(CheckReport(["done"], found), None, options) == 0
    assert finish(CheckReport([], found), None, Namespace(quiet=True, json=False, verbose=False, strict=True)) == 1
    assert capsys.readouterr().out.splitlines() == ["WRONG: worse than < before", "done"]


def test_real_time_factor_is_simulated_over_elapsed_time() -> None:
    run = replace(positioning_run(), wall_time=0.25)
    assert real_time_factor(run) == pytest.approx(4 * run.program.duration, rel=1e-15)
    assert details(run, {}, {}, [])["performance"]["real_time_factor"]["value"] == real_time_factor(run)
    assert f"({4 * run.program.duration:.2g} times real time)" in report.summary_line(run, {})
    fast = replace(run, wall_time=run.program.duration / 104.2)
    assert "(100 times real time)" in report.summary_line(fast, {})
    assert real_time_factor(replace(positioning_run(), wall_time=0.0)) is None


def test_tiles_speak_in_words_and_in_few_digits() -> None:
    assert tile("Z.settling_time", Figure(math.nan, "ms", "")) == Tile("not determined", "Z: settling time", "")
    assert tile("XZ.G", Figure(8.191, "um", "")) == Tile("8.19 µm", "XZ: circular deviation G", "")
    assert tile("XZ.mean", Figure(-0.7733, "um", "")) == Tile("−0.77 µm", "XZ: mean radius deviation", "")
    assert tile("ZX#2.glitch_X", Figure(1.0, "um", "")).label == "ZX no. 2: quadrant glitch, X reverses"
    assert tile("XZ.peak_X", Figure(1.0, "um", "")).label == "XZ: reversal peak, X reverses"
    assert tile("Z.peak_torque", Figure(1.0, "N.m", "")).label == "Z: largest motor torque"
    values = {1.24712: "1.25 s", 12.34567: "12.3 s", 999.96: "1000 s", 123456.7: "123457 s", 0.01234: "0.0123 s"}
    for value, text in values.items():
        assert tile("Z.duration", Figure(value, "s", "")).value == text
    labels = [tile(f"Z.{name}", Figure(1.0, "s", "")).label for name in HEADER]
    assert not any("_" in label for label in labels)


def test_page_fits_on_paper(tmp_path: Path) -> None:
    write_run(positioning_run(), {}, tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    paper = text[text.index("@media print") : text.index("</style>")]
    assert "max-height: 150mm" in paper
    assert "repeat(4, minmax(0, 1fr))" in paper


def test_motions_have_their_path_and_a_note_on_their_start(tmp_path: Path) -> None:
    arc = Arc(plane=("X", "Z"), centre_by={"X": 0.015, "Z": 0.0}, angle=math.pi / 2, feed=0.05)
    run = run_of(scenario(arc, Dwell(duration=0.1), Move(by={"X": 0.003, "Y": 0.004}, feed=0.05)))
    assert [segment.way for segment in run.program.segments] == ["R 15 mm, 90°", "", "length 5 mm"]
    write_run(run, {}, tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "R 15 mm, 90°" in text
    assert "next instant of the interpolator (T_ipo 2 ms)" in text
    circle = circle_run().program.segments[0].way
    assert circle == "R 15 mm, 1080° (3 full turns)"


def test_one_line_for_the_terminal() -> None:
    run = circle_run()
    line = report.summary_line(
        run, {"XZ.G": Figure(8.19, "um", ""), "XZ.glitch_X": Figure(4.84, "um", ""), "XZ.mean": Figure(1, "um", "")}
    )
    assert line.startswith("XZ.G 8.19 um, XZ.glitch_X 4.84 um, ")
    assert "simulated in 0.5 s" in line
    assert "\n" not in line


def test_a_run_without_figures_says_so_and_how_it_moved() -> None:
    run = positioning_run()
    *moved, last = moved_words(run.trace)
    travel, lag = 1e3 * np.ptp(run.trace["Z.x_a"]), 1e6 * np.abs(run.trace["Z.x_e"]).max()
    assert f"Z moves within {travel:.4g} mm, following error up to {lag:.3g} um." in moved
    assert "nothing that is evaluated" in last
