"""The first screen of reports in a real browser: answer, picture, figures and next step without scrolling.

What is folded opens by keyboard, by links and on paper; numbers that a page shows twice agree.
"""

from __future__ import annotations

import html as markup
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim.analysis import diagnoses, evaluate
from feedsim.foundation.errors import Finding
from feedsim.report import run as report
from feedsim.report.content import Report, split_finding
from feedsim.report.page import html
from kinds_helpers import KINDS, Kinds
from page_browsers import drawn
from report_helpers import circle_run

ROOT = Path(__file__).resolve().parents[2]
MOST_WORDS = 120  # of two letters and more: numbers and units are none
# Words within the window but those of charts, their buttons and titles of what is folded; where the parts end.
SEEN = """() => {
  const words = [], walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walk.nextNode(); node; node = walk.nextNode()) {
    const own = node.parentElement, range = document.createRange();
    if (own.closest("svg, script, style, .bar, .spoken, details.fold > summary") || !own.checkVisibility()) continue;
    range.selectNodeContents(node);
    const box = range.getBoundingClientRect();
    if (box.width && box.top < innerHeight) {
      words.push(...node.textContent.trim().split(/\\s+/).filter(word => /\\p{L}{2}/u.test(word)));
    }
  }
  const foot = name => { const all = document.querySelector(name); return all && all.getBoundingClientRect().bottom; };
  const top = name => { const all = document.querySelector(name); return all && all.getBoundingClientRect().top; };
  return { words, answer: foot(".answer"), top: top(".lead svg, .lead img"), picture: foot(".lead svg, .lead img"),
           keys: foot(".screen .keys"), next: foot(".next"), wide: document.documentElement.scrollWidth };
}"""


def opened(browser: Any, file: Path, width: int, height: int) -> Any:
    page = browser.new_page(viewport={"width": width, "height": height})
    page.goto(file.as_uri())
    page.wait_for_selector(".still", state="detached") if page.locator(".still").count() else None
    return page


@pytest.mark.parametrize("name", KINDS)
def test_answer_picture_figures_and_next_step_without_scrolling(name: str, browser: Any, kinds: Kinds) -> None:
    page = opened(browser, kinds.page(name), 1400, 900)
    seen = page.evaluate(SEEN)
    page.close()
    assert len(seen["words"]) <= MOST_WORDS, " ".join(seen["words"])
    assert 0 < seen["answer"] < seen["top"] < seen["picture"] <= 900
    for part in ("keys", "next"):
        assert seen[part] is None or seen[part] <= 900
    assert seen["keys"] or seen["next"]


@pytest.mark.parametrize("name", KINDS)
def test_answer_and_picture_on_a_phone(name: str, browser: Any, kinds: Kinds) -> None:
    page = opened(browser, kinds.page(name), 390, 844)
    seen = page.evaluate(SEEN)
    page.close()
    assert seen["wide"] <= 390
    assert seen["answer"] < 844
    assert seen["top"] < 0.75 * 844


@pytest.mark.parametrize("name", ["circle", "frf"])
def test_what_is_folded_opens_by_keyboard_and_is_drawn(name: str, browser: Any, kinds: Kinds) -> None:
    page = opened(browser, kinds.page(name), 1200, 900)
    folds = page.locator("details.fold")
    assert folds.count() > 3
    for fold in folds.all():
        if fold.locator("h2").first.inner_text() == "What to change":
            assert fold.evaluate("each => each.open")  # what to do is not folded
            continue
        assert fold.evaluate("each => !each.open")
        fold.locator("summary").first.focus()
        page.keyboard.press("Enter")
        assert fold.evaluate("each => each.open")
    drawn(page)
    for chart in page.locator("details.fold svg.chart").all():
        assert chart.evaluate("each => each.viewBox.baseVal.width") == pytest.approx(
            chart.evaluate("each => each.parentNode.clientWidth"), abs=1
        )
    page.close()


def test_a_link_opens_what_it_leads_to(browser: Any, kinds: Kinds) -> None:
    page = opened(browser, kinds.page("circle"), 1200, 900)
    page.locator("footer a").first.click()
    drawn(page)
    assert page.locator("details.fold:has(#figures)").evaluate("each => each.open")
    page.close()


def test_paper_has_the_first_screen_and_what_is_unfolded(browser: Any, kinds: Kinds) -> None:
    page = opened(browser, kinds.page("circle"), 1200, 900)
    unfolded = page.locator("details.fold[open] h2").all_inner_texts()
    assert unfolded == ["What to change"]
    folded = page.locator("details.fold:not([open])")
    assert folded.count() > 4
    page.emulate_media(media="print")
    assert not any(folded.nth(k).is_visible() for k in range(folded.count()))
    assert page.locator("p.answer").first.is_visible()
    folded.first.evaluate("each => { each.open = true; }")
    assert page.locator("details.fold[open]").count() == 2
    assert len(re.findall(rb"/Type\s*/Page\b", page.pdf(format="A4"))) <= 3
    page.close()


def test_what_is_wrong_stands_ahead_of_the_answer() -> None:
    wrong = Finding("loop-unstable", "wrong", "speed loop of X: UNSTABLE, it swings at 204 Hz")
    doubt = Finding("not-settled", "doubt", "something doubtful")
    run = replace(circle_run(), warnings=(doubt, wrong))
    text = html(report.report.report_of(run, {}, [], {}, []))
    first = html(Report("t", "", [], "", answer=["the answer"], warnings=[doubt, wrong]))
    assert first.index("UNSTABLE") < first.index("the answer") < first.index("something doubtful")
    assert text.index("UNSTABLE") < text.index("<main>")


def test_long_findings_are_parted_and_lose_nothing() -> None:
    text = " ".join(f"word{k}" + ("." if k % 9 == 8 else "") for k in range(80))
    head, rest = split_finding(text)
    assert f"{head} {rest}" == text
    assert head.endswith(".")
    assert len(head.split()) <= 30
    assert split_finding("short") == ("short", "")


NUMBER = re.compile(r"−?\d+(?:\.\d+)?(?:×10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?")


def agree(one: str, other: str) -> bool:
    """Whether two numbers as printed may be one value: equal to the digits of the coarser one."""
    values, places = [], []
    for text in (one, other):
        plain = text.replace("−", "-")
        values.append(float(plain))
        places.append(len(plain.partition(".")[2]))
    return abs(values[0] - values[1]) <= 0.51 * 10.0 ** -min(places)


def facts(text: str) -> dict[str, list[str]]:
    """Fact -> its values as they stand on the page of a circle: tiles, answer, marks of the picture, the two tables."""
    said = markup.unescape(re.sub(r"<[^>]+>", " ", text.partition("<main>")[0]))
    found: dict[str, list[str]] = {}

    def add(fact: str, value: str) -> None:
        found.setdefault(fact, []).append(value)

    for value, label in re.findall(r"<b>([^<]+) <small>µm</small></b><span>([^<]+)</span>", text):
        if peak := re.search(r"peak, (\w) reverses", label):
            add(f"peak {peak[1]}", value)
        elif "circular deviation G" in label:
            add("G", value)
    for value in re.findall(r"G = (\S+) µm", said):
        add("G", value)
    for axis, value in re.findall(r"reversal peaks of (\w) \((\S+) µm", said):
        add(f"peak {axis}", value)
    for axis, value in re.findall(r'"text":"([XYZ])[+−]: (\S+) µm"', text):
        add(f"peak {axis}", value)
    for axis, value in re.findall(r"<td>Reversal peaks of (\w)</td><td[^>]*>(−?[\d.]+)", text):
        add(f"peak {axis}", value)
    for name, value in re.findall(r"<code>XZ\.(G|peak_\w)</code></td><td[^>]*>(−?[\d.]+)</td>", text):
        add(name.replace("peak_", "peak "), value)
    return found


@pytest.mark.parametrize("name", ["circle", "recorded"])
def test_a_fact_has_one_value(name: str, kinds: Kinds) -> None:
    found = facts(kinds.page(name).read_text(encoding="utf-8"))
    assert {"G", "peak X", "peak Z"} <= set(found)
    for fact, values in found.items():
        assert len(values) >= 2, fact
        for value in values[1:]:
            assert agree(values[0], value.rstrip(",")), (fact, values)


def test_the_diagnosis_names_the_same_peaks_as_the_figures() -> None:
    run = circle_run()
    figures, causes = evaluate(run), diagnoses(run)
    for axis in "XZ":
        largest = max(abs(peak.height) for peak in causes["XZ"].peaks if peak.axis == axis)
        assert abs(figures[f"XZ.peak_{axis}"].value) == pytest.approx(1e6 * largest)
    assert np.isfinite(figures["XZ.G"].value)


@pytest.mark.extensive
@pytest.mark.skipif("FEEDSIM_AXE" not in os.environ, reason="FEEDSIM_AXE names axe.min.js of axe-core (make axe)")
@pytest.mark.parametrize("name", KINDS)
def test_axe_core_finds_nothing(name: str, browser: Any, kinds: Kinds) -> None:
    """Folded and unfolded, on light and dark screens; the page's policy is set aside for the tester's script."""
    context = browser.new_context(bypass_csp=True, viewport={"width": 1400, "height": 900})
    page = context.new_page()
    page.goto(kinds.page(name).as_uri())
    drawn(page)
    page.evaluate(Path(os.environ["FEEDSIM_AXE"]).read_text(encoding="utf-8"))
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        for unfolded in (False, True):
            page.evaluate("all => document.querySelectorAll('details').forEach(each => { each.open = all; })", unfolded)
            drawn(page)
            found = page.evaluate("axe.run(document)")["violations"]
            assert not found, [(each["id"], each["nodes"][0]["html"][:120]) for each in found]
    context.close()
