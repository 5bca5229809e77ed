"""Reports in a real browser: what is drawn, what the cursor reads, zoom, palettes, phones; nothing is asked for."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim.analysis import evaluate
from feedsim.foundation.errors import Finding
from feedsim.report.chart import Axis, Chart, Curve, Level, Mark, Panel
from feedsim.report.content import Picture, Report
from feedsim.report.formatting import PALETTE
from feedsim.report.page import html
from page_browsers import drawn
from report_helpers import FakeRun, circle_run, positioning_run, write_run

OPEN_WITHIN = 0.5  # s of a processor, so that a reader does not wait
# Rows of the table that floats beside the cursor: first what stands at the top, then a curve each.
TOLD = "#{} .readout"


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[FakeRun, Path]]:
    found = {}
    for name, run in (("circle", circle_run()), ("stop", positioning_run())):
        place = tmp_path_factory.mktemp(name)
        write_run(run, evaluate(run), place)
        found[name] = (run, place / "report.html")
    return found


@pytest.fixture(scope="module")
def pages(browser: Any, runs: dict[str, tuple[FakeRun, Path]]) -> Iterator[dict[str, Any]]:
    """The reports, each opened once; what their consoles say and what they ask for is kept."""
    found = {}
    for name, (_, file) in runs.items():
        page = browser.new_page(viewport={"width": 1200, "height": 900})
        page.said, page.asked = [], []
        page.on("console", lambda message, page=page: page.said.append(message.text))
        page.on("pageerror", lambda error, page=page: page.said.append(str(error)))
        page.on("request", lambda request, page=page: page.asked.append(request.url))
        session = page.context.new_cdp_session(page)
        session.send("Performance.enable", {"timeDomain": "threadTicks"})  # of the page alone, not of a busy machine
        page.goto(file.as_uri())
        metrics = {each["name"]: each["value"] for each in session.send("Performance.getMetrics")["metrics"]}
        page.taken = metrics["TaskDuration"]
        page.wait_for_selector(".still", state="detached")
        page.evaluate("document.querySelectorAll('details').forEach(each => { each.open = true; })")
        drawn(page)
        found[name] = page
    yield found
    for page in found.values():
        page.close()


def inner(page: Any, stem: str, panel: int) -> dict[str, float]:
    """The room of a panel's curves, in pixels of the window, once it is in sight."""
    page.locator(f"#{stem} svg.chart").scroll_into_view_if_needed()
    frame: dict[str, float] = (
        page.locator(f"#{stem} svg.chart > g > clipPath rect")
        .nth(panel)
        .evaluate(
            """rect => {
            const svg = rect.ownerSVGElement, box = rect.parentNode.parentNode.transform.baseVal[0].matrix;
            const seen = svg.getBoundingClientRect(), per = seen.width / svg.viewBox.baseVal.width;
            const [x, y, width, height] = ["x", "y", "width", "height"].map(name => Number(rect.getAttribute(name)));
            return {x: seen.left + (box.e + x) * per, y: seen.top + (box.f + y) * per,
                    width: width * per, height: height * per};
        }"""
        )
    )
    if frame["y"] < 0 or frame["y"] + frame["height"] > page.viewport_size["height"]:
        page.mouse.wheel(0, frame["y"] - 100)
        drawn(page)
        return inner(page, stem, panel)
    return frame


def told(page: Any, stem: str) -> list[str]:
    return [
        text.replace("−", "-") for text in page.locator(TOLD.format(stem)).inner_text().splitlines() if text.strip()
    ]


def value(text: str) -> float:
    """ "axis Z: 12.5 mm" -> 12.5; "1.2×10⁻⁵ mm" -> 1.2e-5."""
    mantissa, _, power = text.rpartition(": ")[2].split()[0].partition("×10")
    return float(mantissa) * 10.0 ** int(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or "0")


def test_pages_open_at_once_and_complain_of_nothing(
    pages: dict[str, Any], runs: dict[str, tuple[FakeRun, Path]]
) -> None:
    for name, page in pages.items():
        assert page.taken < OPEN_WITHIN
        assert page.said == []
        assert page.asked == [runs[name][1].as_uri()]
        assert page.locator("figure.chart svg.chart").count() == page.locator("figure.chart").count() > 0
        assert page.locator(".still").count() == 0


def test_cursor_reads_the_data(pages: dict[str, Any], runs: dict[str, tuple[FakeRun, Path]]) -> None:
    page, run = pages["stop"], runs["stop"][0]
    room = inner(page, "overview", 1)  # following error
    page.mouse.move(room["x"] + 0.37 * room["width"], room["y"] + 0.5 * room["height"])
    lines = told(page, "overview")
    at = float(lines[0].removeprefix("time ").removesuffix(" s"))
    row = int(np.argmin(np.abs(run.trace.time - at)))
    assert run.trace.time[row] == pytest.approx(at, rel=1e-6)
    assert at == pytest.approx(0.37 * run.trace.time[-1], rel=0.01)
    heads = [k for k, line in enumerate(lines) if line == "following error"]
    shown = {line.strip().partition(":")[0]: value(line) for line in lines[heads[0] + 1 : heads[0] + 4]}
    for axis in "XYZ":
        assert shown[f"axis {axis}"] == pytest.approx(1e6 * run.trace[f"{axis}.x_e"][row], rel=2e-6, abs=1e-12)
    assert {"position", "speed", "torque"} <= set(lines), "linked panels are read, too"


def test_drag_zooms_all_linked_panels_and_a_double_click_goes_back(pages: dict[str, Any]) -> None:
    page = pages["stop"]
    page.mouse.move(0, 0)
    ends = "#overview svg.chart > g:nth-of-type({}) text"

    def ticks(panel: int) -> list[str]:
        found: list[str] = page.locator(ends.format(panel)).all_inner_texts()
        return found

    whole = ticks(1), ticks(3)
    room = inner(page, "overview", 2)
    y = room["y"] + 0.5 * room["height"]
    page.mouse.move(room["x"] + 0.2 * room["width"], y)
    page.mouse.down()
    page.mouse.move(room["x"] + 0.4 * room["width"], y)
    page.mouse.up()
    assert ticks(1) != whole[0]
    assert ticks(3) != whole[1]
    page.mouse.move(room["x"] + 2, y)
    begin = float(told(page, "overview")[0].removeprefix("time ").removesuffix(" s"))
    page.mouse.move(room["x"] + room["width"] - 2, y)
    end = float(told(page, "overview")[0].removeprefix("time ").removesuffix(" s"))
    last = 5 * (end - begin)
    assert begin == pytest.approx(0.2 * last, rel=0.05)
    page.mouse.dblclick(room["x"] + 0.5 * room["width"], y)
    assert (ticks(1), ticks(3)) == whole


def test_curves_go_and_come_back(pages: dict[str, Any]) -> None:
    page = pages["stop"]
    curves = page.locator("#overview svg.chart > g:nth-of-type(1) g[clip-path] path")
    count = curves.count()
    button = page.get_by_role("button", name="axis X").first
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    assert curves.count() == count - 1
    button.click()
    assert curves.count() == count


def test_polar_plot_is_magnified_and_read(pages: dict[str, Any], runs: dict[str, tuple[FakeRun, Path]]) -> None:
    page = pages["circle"]
    output = page.locator("#contour-XZ output")
    before = float(output.inner_text().rstrip("×").replace(",", ""))
    slider = page.locator("#contour-XZ input[type=range]")
    slider.fill("1")
    assert float(output.inner_text().rstrip("×").replace(",", "")) == pytest.approx(2 * before, rel=0.01)
    slider.fill("0")
    chart = page.locator("#contour-XZ svg.chart")
    chart.focus()
    page.keyboard.press("ArrowRight")
    lines = told(page, "contour-XZ")
    assert lines[0] == "angle 3°"
    spoken = page.locator("#contour-XZ .spoken").inner_text()
    assert spoken.startswith("angle 3°; ")
    assert "linear scales: " in spoken
    page.keyboard.press("Escape")


def test_what_is_saved_is_what_is_shown(
    pages: dict[str, Any], runs: dict[str, tuple[FakeRun, Path]], tmp_path: Path
) -> None:
    page, run = pages["stop"], runs["stop"][0]
    saved = {}
    for kind in ("PNG", "SVG", "CSV"):
        with page.expect_download() as waited:
            page.locator("#overview").get_by_role("button", name=kind, exact=True).click()
        saved[kind] = tmp_path / waited.value.suggested_filename
        waited.value.save_as(saved[kind])
    assert [path.name for path in saved.values()] == ["overview.png", "overview.svg", "overview.csv"]
    assert saved["PNG"].read_bytes().startswith(b"\x89PNG")
    svg = saved["SVG"].read_text(encoding="utf-8")
    assert "var(--" not in svg
    assert "axis Z" in svg
    if shutil.which("rsvg-convert"):  # another reader of SVG
        subprocess.run(["rsvg-convert", str(saved["SVG"]), "-o", str(tmp_path / "drawn.png")], check=True)
    heads, *rows = (
        line.split(",") for line in saved["CSV"].read_text(encoding="utf-8").replace('", "', "; ").splitlines()
    )
    table = np.genfromtxt(saved["CSV"], delimiter=",", skip_header=1)
    assert heads
    assert rows
    assert table[:, 0] == pytest.approx(run.trace.time, rel=1e-6)
    assert table[:, 3] == pytest.approx(1e3 * (run.trace["Z.x_a"] - run.trace["Z.x_a"][0]), rel=1e-5, abs=1e-6)


def test_a_long_path_in_a_warning_does_not_widen_a_phone(browser: Any) -> None:
    long = "/home/" + 20 * "somebody_"
    page = browser.new_page(viewport={"width": 360, "height": 800})
    page.set_content(
        html(Report(long, long, [], "", warnings=[Finding("not-settled", "doubt", long)], notes=[long], answer=[long]))
    )
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    page.close()


@pytest.mark.parametrize("width", [360, 768])
def test_nothing_has_to_be_scrolled_sideways(pages: dict[str, Any], width: int) -> None:
    for page in pages.values():
        page.set_viewport_size({"width": width, "height": 800})
        drawn(page)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        for chart in page.locator("svg.chart").all():
            assert chart.evaluate("each => each.viewBox.baseVal.width") == pytest.approx(
                chart.evaluate("each => each.parentNode.clientWidth"), abs=1
            )
        page.set_viewport_size({"width": 1200, "height": 900})


@pytest.mark.parametrize("width", [390, 820, 1400])
def test_no_axis_has_a_single_tick(pages: dict[str, Any], width: int) -> None:
    """One value makes no scale; ticks are told from other words by where they stand."""
    for page in pages.values():
        page.set_viewport_size({"width": width, "height": 900})
        drawn(page)
        counts = page.evaluate(
            """() => {
            const number = (each, name) => Number(each.getAttribute(name)), counts = [];
            for (const panel of document.querySelectorAll("svg.chart > g")) {
                const room = panel.querySelector("clipPath rect");
                if (!room) continue;
                const foot = number(room, "y") + number(room, "height") + 16;
                const words = [...panel.querySelectorAll(":scope > text")];
                const ticks = words.filter(each => /^[−0-9]/.test(each.textContent));
                counts.push([ticks.filter(each => number(each, "y") === foot).length,
                             ticks.filter(each => each.getAttribute("text-anchor") === "end").length]);
            }
            return counts;
        }"""
        )
        assert len(counts) > 3
        assert min(min(each) for each in counts) >= 2
    for page in pages.values():
        page.set_viewport_size({"width": 1200, "height": 900})


def test_every_picture_has_its_heading_above_it(pages: dict[str, Any]) -> None:
    for page in pages.values():
        for figure in page.locator("figure").all():
            order = figure.evaluate("each => [...each.children].map(child => child.tagName)")
            folded = figure.evaluate("each => each.previousElementSibling && each.previousElementSibling.tagName")
            assert order[0] in ("H2", "H3", "H4") or folded == "SUMMARY"
            assert order[-1] == "FIGCAPTION"


def test_words_cover_neither_curves_nor_each_other(browser: Any, tmp_path: Path) -> None:
    x = np.linspace(0.0, 10.0, 800)
    y = 1.0 / (1.0 + 40.0 * (x - 5.0) ** 2)  # a narrow peak: the right of its top is taken by nothing else
    marks = [Mark(5.0, 1.0, "the top of it"), Mark(5.06, 0.87, "a little below"), Mark(10.0, float(y[-1]), "the end")]
    levels = [Level(4.0, "5 %", upright=True), Level(4.2, "50 %", upright=True), Level(0.02, "median of the curve")]
    note = "two lines\nof a note"
    panel = Panel("", Axis("t", "s"), Axis("d", "µm"), [Curve("", x, y)], levels, marks=marks, note=note)
    (tmp_path / "report.html").write_text(
        html(Report("t", "", [Picture("one", "t", "", Chart([panel]))], "")), encoding="utf-8"
    )
    page = browser.new_page(viewport={"width": 390, "height": 900})
    page.goto((tmp_path / "report.html").as_uri())
    page.wait_for_selector(".still", state="detached")
    boxes, points = page.evaluate(
        """() => {
        const svg = document.querySelector("#one svg.chart"), curve = svg.querySelector("g[clip-path] path");
        const own = curve.getScreenCTM(), long = curve.getTotalLength();
        const points = [...Array(2000).keys()].map(k => curve.getPointAtLength(k / 1999 * long).matrixTransform(own));
        const boxes = [...svg.querySelectorAll("text[paint-order]")].map(each => each.getBoundingClientRect());
        return [boxes.map(each => [each.left, each.top, each.right, each.bottom]),
                points.map(each => [each.x, each.y])];
    }"""
    )
    page.close()
    assert len(boxes) == 8
    a, b = np.array(points).T
    for k, (left, top, right, bottom) in enumerate(boxes):
        assert not np.any((a > left + 1) & (a < right - 1) & (b > top + 3) & (b < bottom - 3)), k
        for other in boxes[:k]:
            apart = left >= other[2] - 2 or right <= other[0] + 2 or top >= other[3] - 4 or bottom <= other[1] + 4
            assert apart, (k, other)


def test_palettes_of_dark_screens_and_of_paper(pages: dict[str, Any]) -> None:
    page = pages["circle"]
    curve = page.locator("#overview svg.chart g[clip-path] path").first
    names = {name: (light, dark) for name, light, dark in PALETTE}

    def stroke() -> str:
        red, green, blue = curve.evaluate("each => getComputedStyle(each).stroke").strip("rgb()").split(", ")
        return f"#{int(red):02x}{int(green):02x}{int(blue):02x}"

    for media, scheme, which in (("screen", "light", 0), ("screen", "dark", 1), ("print", "dark", 0)):
        page.emulate_media(media=media, color_scheme=scheme)
        assert stroke() == names["blue"][which], f"{media}, {scheme}"
    page.emulate_media(media="screen", color_scheme="light")


def test_on_paper_panels_stand_side_by_side(pages: dict[str, Any]) -> None:
    """A sheet is narrow; three columns that are stacked would be printed at half the width."""
    page = pages["circle"]
    size = page.viewport_size
    page.set_viewport_size({"width": 680, "height": 900})
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    across = page.evaluate(
        "() => [...document.querySelectorAll('figure.chart')].map(each => "
        "each.querySelector('svg.chart').viewBox.baseVal.width)"
    )
    assert min(across) == 720
    assert max(across) > 720  # of the one with three columns
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    page.set_viewport_size(size)


def test_on_grey_paper_lines_of_different_colours_are_told_apart(pages: dict[str, Any]) -> None:
    page = pages["stop"]

    def dashes() -> list[str]:
        found: list[str] = page.locator("#overview svg.chart > g:nth-of-type(1) g[clip-path] path").evaluate_all(
            "all => all.map(each => getComputedStyle(each).strokeDasharray)"
        )
        return found

    assert dashes() == ["none", "none", "none"]
    page.emulate_media(media="print")
    assert len(set(dashes())) == 3
    legend = page.locator("#overview .legend line")
    assert legend.evaluate_all("all => all.map(each => getComputedStyle(each).strokeDasharray)") == dashes()
    page.emulate_media(media="screen")


def test_other_units_at_the_other_side_and_axes_that_are_logarithmic_both_ways(browser: Any, tmp_path: Path) -> None:
    x = np.linspace(0.0, 10.0, 200)
    across = Axis("v", "rad/s", span=(0.0, 10.0), also=("feed", "mm/min", 60.0))
    up = Axis("M", "N·m", span=(0.0, 4.0), also=("force", "N", 500.0))
    both_ways = Panel("", Axis("t", "s"), Axis("n", symlog=1.0), [Curve("", x, 4000 * np.sin(x))])
    chart = Chart([Panel("", across, up, [Curve("", x, x)]), both_ways])
    (tmp_path / "report.html").write_text(html(Report("t", "", [Picture("one", "t", "", chart)], "")), encoding="utf-8")
    page = browser.new_page(viewport={"width": 1200, "height": 900})
    said: list[str] = []
    page.on("pageerror", lambda error: said.append(str(error)))
    page.goto((tmp_path / "report.html").as_uri())
    page.wait_for_selector(".still", state="detached")
    panels = [
        dict(
            page.locator(f"#one svg.chart > g:nth-of-type({k}) > text").evaluate_all(
                "all => all.map(each => [`${each.textContent} ${each.getAttribute('y') < 60}`, "
                "[Number(each.getAttribute('x')), Number(each.getAttribute('y'))]])"
            )
        )
        for k in (1, 2)
    ]
    page.close()
    assert said == []
    first, second = panels
    assert {"v [rad/s]", "M [N·m]", "feed [mm/min]", "force [N]"} <= {text.rpartition(" ")[0] for text in first}
    assert first["300 true"][0] == pytest.approx(first["5 false"][0], abs=0.2)
    assert first["1000 false"][1] == pytest.approx(first["2 false"][1], abs=0.2)
    place = {text.rpartition(" ")[0]: y for text, (_, y) in second.items()}
    assert place["100"] - place["1000"] == pytest.approx(place["10"] - place["100"], rel=0.06)  # far from zero
    assert place["0"] == pytest.approx((place["1000"] + place["−1000"]) / 2, abs=0.2)


def test_without_script_there_is_a_still_picture(browser: Any, runs: dict[str, tuple[FakeRun, Path]]) -> None:
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(runs["circle"][1].as_uri())
    for figure in page.locator("figure.chart").all():
        assert figure.locator(".still svg path").count() > 3
        assert figure.locator("figcaption").text_content()
    context.close()
