"""A page in a real browser: numbers of a run, knobs by keyboard, states, lessons, no complaint, nothing asked for."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest

from feedsim import cli, cosim, scenario
from feedsim.analysis import evaluate
from feedsim.cosim import fmus_directory
from feedsim.errors import InputError
from live_page.test_page_numbers import SAME, settings, states

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed (requirements-dev.lock)")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine (Debian: apt install chromium)"),
    pytest.mark.skipif(
        not (fmus_directory() / "machine.wasm").is_file(), reason="no module of the machine (make page-module)"
    ),
]
FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run"]
SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
LARGEST = 400_000  # bytes, of the default machine: what goes into any mail
WAIT = 60_000  # ms: a busy machine computes a second's work slowly


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as api:
        try:
            found = api.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        except playwright.Error as error:
            pytest.skip(f"Chromium does not start here: {str(error).splitlines()[0]}")
        yield found
        found.close()


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder, found = tmp_path_factory.mktemp("pages"), {}
    for name in ("xz_circle", "z_positioning"):
        found[name] = folder / f"{name}.html"
        assert cli.main(["page", str(SCENARIOS / f"{name}.yaml"), "--out", str(found[name])]) == 0
    return found


class Opened:
    """A page; `said` on its console, `asked` for."""

    def __init__(self, browser: Any, file: Path, width: int = 1300, address: str = "", **context: Any) -> None:
        self.context = browser.new_context(viewport={"width": width, "height": 900}, accept_downloads=True, **context)
        self.page = self.context.new_page()
        self.said: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(file.as_uri() + address)

    def __enter__(self) -> Opened:
        return self

    def __exit__(self, *_: object) -> None:
        self.context.close()

    def count(self, what: str = "shown") -> int:
        return int(self.page.locator("html").get_attribute(f"data-{what}") or 0)

    def settled(self, what: str = "loops") -> None:
        """Until pictures and frequency response are those of the newest state."""
        self.page.wait_for_selector(f"html[data-{what}]", state="attached", timeout=WAIT)
        while True:
            before = self.count(what)
            self.page.wait_for_timeout(400)
            if self.count(what) == before and self.count() <= self.count("loops"):
                return

    def figures(self) -> dict[str, str]:
        rows = self.page.locator("#figures tbody tr").all()
        return {row.locator("th").inner_text(): row.locator("td").first.inner_text() for row in rows}

    def trace(self, folder: Path) -> dict[str, np.ndarray[Any, Any]]:
        with self.page.expect_download() as waiting:
            self.page.locator("#csv").click()
        waiting.value.save_as(folder / "page.csv")
        with (folder / "page.csv").open() as file:
            head, *rows = csv.reader(file)
        return dict(zip(head, np.array(rows, dtype=float).T, strict=True))


def address_of(data: dict[str, Any], state: list[Any]) -> str:
    pairs = (f"{quote(knob['key'])}={quote(str(value))}" for knob, value in zip(data["knobs"], state, strict=True))
    return "#" + "&".join(pairs)


def data_of(file: Path) -> dict[str, Any]:
    import json
    import re

    text = file.read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="feedsim-page">(.*?)</script>', text, re.DOTALL)
    assert found
    data: dict[str, Any] = json.loads(found[1])
    return data


def shown(figure: Any) -> str:
    """As the page has it: four digits."""
    if not np.isfinite(figure.value):
        return "not determined"
    unit = figure.unit.replace("um", "µm").replace("N.m", "N·m")
    value = float(f"{figure.value:.4g}")
    return f"{value:.4g} {unit}" if abs(value) < 1e4 else f"{value:g} {unit}"


def number_of(text: str) -> float:
    return float(
        text.replace("−", "-").split()[0].replace("×10", "e").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
    )


@pytest.mark.parametrize("name", ["xz_circle", "z_positioning"])
def test_what_a_browser_computes_is_a_run(browser: Any, files: dict[str, Path], name: str, tmp_path: Path) -> None:
    file = files[name]
    assert file.stat().st_size < LARGEST
    data = data_of(file)
    for state in states(data, 3, seed=7):
        with Opened(browser, file, address=address_of(data, state)) as opened:
            opened.settled()
            try:
                run = cosim.run(scenario.load(SCENARIOS / f"{name}.yaml", settings(data, state)))
            except InputError:
                assert opened.page.locator("#problem").is_visible()
                continue
            figures = evaluate(run)
            seen = opened.figures()
            assert len(seen) >= 10
            for key, text in seen.items():
                if text == "not determined":
                    assert np.isnan(figures[key].value)
                else:
                    # the last of four digits, where a half may be rounded either way
                    assert number_of(text) == pytest.approx(figures[key].value, rel=5.01e-4), key
            trace = opened.trace(tmp_path)
            for column in (column for column in trace if column.endswith(".x_a")):
                assert np.abs(trace[column] - run.trace[column]).max() <= SAME
            assert opened.said == []
            assert [url.partition("#")[0] for url in opened.asked if not url.startswith("blob:")] == [file.as_uri()]


def test_knobs_by_keyboard_undo_keep_and_take_away(browser: Any, files: dict[str, Path]) -> None:
    with Opened(browser, files["z_positioning"]) as opened:
        page = opened.page
        opened.settled()
        first = opened.figures()
        page.locator("#keep").click()
        slider = page.get_by_role("slider", name="axis Z, F_C: Coulomb friction torque, slider")
        slider.focus()
        before = opened.count("loops")
        for _ in range(5):
            page.keyboard.press("ArrowRight")
        page.keyboard.press("Tab")
        page.wait_for_timeout(300)
        opened.settled()
        assert opened.count("loops") > before
        assert opened.figures() != first
        assert page.locator("#figures thead th").all_inner_texts() == ["figure", "now", "kept", "as written"]
        assert page.locator("#stop-Z .legend button", has_text="kept").count() == 1
        assert "F_C" in page.url
        page.locator("#set").click()
        line = page.locator("#taken").input_value()
        assert line.startswith('--set "machine.axes.Z.friction.F_C=')
        assert line.endswith(' N.m"')
        page.locator("#yaml").click()
        assert page.locator("#taken").input_value().startswith("set:\n  machine.axes.Z.friction.F_C: ")
        while page.locator("#undo").is_enabled():
            page.locator("#undo").click()
        opened.settled()
        assert opened.figures() == first
        field = page.get_by_role("spinbutton", name="axis Z, T_n: speed controller integral-action time")
        field.fill("9")
        field.press("Enter")
        opened.settled()
        assert opened.figures() != first
        page.locator("#reset").click()
        opened.settled()
        assert opened.figures() == first
        assert opened.said == []


def test_what_a_run_refuses_is_said_and_nothing_freezes(browser: Any, files: dict[str, Path]) -> None:
    with Opened(browser, files["xz_circle"]) as opened:
        opened.settled()
        field = opened.page.get_by_role("spinbutton", name="motion 0: circle, feed: programmed speed along the path")
        field.fill("31000")
        field.press("Enter")
        opened.page.wait_for_selector("#problem:not([hidden])", timeout=WAIT)
        assert "allowed at most" in opened.page.locator("#problem").inner_text()
        field.fill("3000")
        field.press("Enter")
        opened.settled()
        assert opened.page.locator("#problem").is_hidden()
        assert opened.said == []


LESSONS = {
    "xz_circle": {
        "Servo mismatch": {"machine.axes.Z.drive.K_v": 200 / 3},
        "quadrant glitch": {"machine.axes.Z.friction.F_C": 0.5, "machine.axes.Z.friction.F_S": 0.7},
        "Compensation, and too much": {"machine.axes.Z.drive.backlash_compensation.value": 0.0},
        "Margin against glitch": {"machine.axes.Z.drive.K_v": 110.0, "machine.axes.Z.drive.T_n": 0.008},
    },
    "z_positioning": {"Overshoot": {"machine.axes.Z.drive.T_sym": 0.003528}},
}


@pytest.mark.parametrize("name", LESSONS)
def test_lessons_begin_unsolved_and_can_be_solved(browser: Any, files: dict[str, Path], name: str) -> None:
    knobs = data_of(files[name])["knobs"]
    with Opened(browser, files[name]) as opened:
        page = opened.page
        opened.settled()
        assert page.locator("#lessons button").count() == len(LESSONS[name])
        for title, answer in LESSONS[name].items():
            page.locator("#lessons button", has_text=title).click()
            opened.settled()
            assert "✓" not in page.locator("#lesson-state").inner_text(), title
            assert page.locator(".knob.pointed").count() >= 1
            for key, value in answer.items():
                k = next(k for k, knob in enumerate(knobs) if knob["key"] == key)
                field = page.locator(f"#value-{k}")
                field.fill(repr(value * knobs[k]["factor"]))
                field.press("Enter")
            opened.settled()
            assert "✓" in page.locator("#lesson-state").inner_text(), (
                title,
                page.locator("#lesson-state").inner_text(),
            )
            page.locator("#lesson-end").click()
        assert opened.said == []


def test_without_scripts_the_scenario_is_shown_as_written(browser: Any, files: dict[str, Path]) -> None:
    with Opened(browser, files["xz_circle"], java_script_enabled=False) as opened:
        assert opened.page.locator("#contour-XZ svg.plot").is_visible()
        assert opened.page.locator("#figures tbody tr").count() > 10
        assert opened.page.locator("#knobs").is_hidden()
        # Nothing stands beside the picture then: it has the width of the page.
        assert opened.page.locator("#contour-XZ").bounding_box()["width"] > 700


@pytest.mark.parametrize("width", [360, 800, 1600])
def test_it_fits_at_any_width(browser: Any, files: dict[str, Path], width: int) -> None:
    with Opened(browser, files["xz_circle"], width=width) as opened:
        opened.settled("shown")
        wide = opened.page.locator("body").evaluate("body => document.documentElement.scrollWidth")
        assert wide <= width
        unnamed = "nodes => nodes.filter(node => !(node.getAttribute('aria-label') || node.textContent.trim())).length"
        assert opened.page.locator("#page button, #page input, #page select").evaluate_all(unnamed) == 0


def test_text_of_the_user_is_text(browser: Any, tmp_path: Path) -> None:
    out = tmp_path / "x.html"
    hostile = "<img src=x onerror=alert(1)></script><script>alert(2)</script>{data}"
    command = ["page", str(SCENARIOS / "one_axis.yaml"), "--set", f"name={hostile!r}", "--out", str(out)]
    assert cli.main(command) == 0
    with Opened(browser, out) as opened:
        opened.settled()
        assert opened.page.locator("h1").inner_text() == hostile
        assert opened.said == []
