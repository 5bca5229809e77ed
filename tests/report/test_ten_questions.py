"""What a drive engineer asks of a page is answered on its first screen, in what is seen without a click.

And what once contradicted, misled or was missing there, finding by finding.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from feedsim.analysis import evaluate
from feedsim.foundation.arguments import Call, call_context
from feedsim.foundation.errors import Finding
from feedsim.jobs.parameters import command_line
from feedsim.report.content import FOLDER, Report, Step, command_path
from feedsim.report.page import html
from kinds_helpers import Kinds
from page_browsers import drawn
from report_helpers import positioning_run, write_run

SHOWN = """() => {
  const words = [], walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walk.nextNode(); node; node = walk.nextNode()) {
    const range = document.createRange();
    if (node.parentElement.closest("script, style, .spoken") || !node.parentElement.checkVisibility()) continue;
    range.selectNodeContents(node);
    const box = range.getBoundingClientRect();
    if (box.width && box.top < innerHeight) words.push(node.textContent.trim());
  }
  return words.join(" ").replace(/\\s+/g, " ");
}"""


def first_screen(browser: Any, file: Path) -> str:
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.goto(file.as_uri())
    if page.locator(".still").count():
        page.wait_for_selector(".still", state="detached")
    text: str = page.evaluate(SHOWN)
    page.close()
    return text


@pytest.fixture(scope="module")
def unstable(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stop whose position loop is unstable, as the judgement of a run words it."""
    said = Finding(
        "loop-unstable",
        "wrong",
        "axis Z: the position loop is unstable with K_v = 30 (m/min)/mm: unstable while the axis slides, stable below "
        "K_v = 27.5 (m/min)/mm",
    )
    run, folder = replace(positioning_run(), warnings=(said,)), tmp_path_factory.mktemp("unstable")
    write_run(run, evaluate(run), folder)
    return folder / "report.html"


@pytest.mark.parametrize(
    ("question", "kind", "answers"),
    [
        ("how far is it from round", "recorded", (r"G = [\d.]+ µm",)),
        ("which axis is it", "circle", (r"reversal peaks of [XZ]|[XZ] lags [XZ]",)),
        ("can I trust it", "identify", (r"known to ±[\d.]+ %",)),
        ("what has changed", "circles", (r"G [\d.]+ → [\d.]+ µm|unchanged: ",)),
        ("what do I type", "stop", (r"feedsim tune drive \S+ --axes Z",)),
        ("how near is the model", "replay", (r"position (off by|the same to)", r"rms")),
        ("what are my margins", "frf", (r"least gain margin [\d.]+ dB", r"least phase margin \d+°")),
        ("which parameter moves it", "study", (r"(feed|K_v) \([\d.]+\) moves it most",)),
        ("are they the same", "compare", (r"Comparison: (same|different)",)),
        ("where does it move first", "machine", (r"lowest elastic mode is at [\d.]+ Hz",)),
        ("what does compensation gain", "compensate", (r"G from [\d.]+ to [\d.]+ µm",)),
    ],
)
def test_the_first_screen_answers(
    question: str, kind: str, answers: tuple[str, ...], browser: Any, kinds: Kinds
) -> None:
    seen = first_screen(browser, kinds.page(kind))
    for answer in answers:
        assert re.search(answer, seen), (question, seen)


def test_an_unstable_run_says_that_alone(browser: Any, unstable: Path) -> None:
    seen = first_screen(browser, unstable)
    assert "unstable" in seen
    assert "K_v = 30" in seen
    for text in ("past its target", "overshoots", "G =", "0.00"):
        assert text not in seen


def test_where_the_data_are_and_how_one_prints(browser: Any, kinds: Kinds) -> None:
    """Buttons of the picture save its data; paper has what is unfolded, and a line below says where all rows are."""
    seen = first_screen(browser, kinds.page("stop"))
    assert {"PNG", "SVG", "CSV"} <= set(seen.split())
    page = kinds.page("stop").read_text(encoding="utf-8")
    assert "time series: result.csv" in page
    assert "details:not([open]) { display: none; }" in page


def test_commands_of_the_next_step_can_be_typed(kinds: Kinds, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    step = Step("Then", "diff", {"results": [FOLDER, "other folder"]})
    with call_context(Call({"figures": ("png",), "control": "sinumerik"}, command_line)):
        assert step.line(Path("my results")) == "feedsim diff 'my results' 'other folder' --control sinumerik"
        assert step.line(None) == ""  # a result that is in no folder
    assert step.line(Path("my results")) == ""  # outside of jobs
    monkeypatch.chdir(tmp_path)
    assert command_path(tmp_path / "a" / "b c.yaml") == "'a/b c.yaml'"
    assert command_path(Path("a.yaml")) == "a.yaml"
    assert command_path(Path("/elsewhere/a.yaml")) == "/elsewhere/a.yaml"
    assert "friction=identify/friction.yaml" in kinds.page("identify").read_text(encoding="utf-8").replace(
        f"{kinds.folder}/", ""
    )


def test_findings_name_files_without_their_folders() -> None:
    said = [
        "/home/me/logs/capture.json: axis X1 has gaps",
        r"C:\logs\capture.json: axis Y1 has gaps",
        "logs/capture.json: 3 of 4 rows, 10 mm/min, N.m/rad, and/or",
    ]
    page = html(
        Report(
            "t",
            "",
            [],
            "",
            warnings=[Finding("rows-missing", "doubt", text) for text in said],
            notes=["see /home/me/a.yaml"],
        )
    )
    assert "/home" not in page
    assert "C:\\" not in page
    for text in ("capture.json: axis X1", "capture.json: axis Y1", "logs/capture.json: 3 of 4", "see a.yaml"):
        assert text in page


def test_panels_below_one_another_begin_alike(browser: Any, kinds: Kinds) -> None:
    """Ticks of unlike lengths: the frames of a column have one left and one right edge; no label leaves its panel."""
    page = browser.new_page(viewport={"width": 390, "height": 844})
    for kind in ("stop", "identify", "frf", "replay"):
        page.goto(kinds.page(kind).as_uri())
        page.wait_for_selector(".still", state="detached")
        page.evaluate("document.querySelectorAll('details').forEach(each => { each.open = true; })")
        drawn(page)
        found = page.evaluate(
            """() => [...document.querySelectorAll("svg.chart")].map(svg => {
              const box = svg.getBoundingClientRect();
              const frames = [...svg.querySelectorAll("clipPath rect")].map(each => each.getAttribute("x"));
              const upright = [...svg.querySelectorAll("text[transform*='rotate(-90)']")].map(each => {
                const own = each.getBoundingClientRect();
                return [own.top - box.top, box.bottom - own.bottom, own.left - box.left];
              });
              return [frames, upright];
            })"""
        )
        assert found
        for frames, upright in found:
            assert len(set(frames)) <= 1, (kind, frames)
            assert all(min(each) > -2 for each in upright), (kind, upright)
    page.close()


def test_the_loop_nearest_to_its_limit_comes_first(kinds: Kinds) -> None:
    """Of three axes the first screen has the one whose margin the answer names, gain above phase."""
    page = kinds.page("axes").read_text(encoding="utf-8")
    axis = re.search(r"least gain margin [\d.]+ dB \(position loop of ([XYZ])", page)
    assert axis
    assert (
        f'data-title="Open-loop gain of the position loop of axis {axis[1]}, which has the least gain margin"' in page
    )


def test_the_digits_of_a_tile_are_three(kinds: Kinds) -> None:
    for kind in ("circle", "stop", "frf", "replay", "compensate"):
        for text in re.findall(r'<div class="key" [^>]*><b>(−?[\d.]+) <small>', kinds.page(kind).read_text()):
            whole, _, part = text.lstrip("−").partition(".")
            digits = len((whole.lstrip("0") + part).lstrip("0"))
            assert digits <= 3 or not part, (kind, text)
