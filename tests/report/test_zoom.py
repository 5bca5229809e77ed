"""Charts at any zoom: ticks that differ, curves with all digits of the result, a polar picture that stays one."""

from __future__ import annotations

import base64
import json
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim.analysis import evaluate
from feedsim.files.trace import read_csv
from feedsim.report.chart import Axis, Chart, Curve, Panel
from feedsim.report.chart.model import BLOCK_ROWS, embed_charts, steps, ticks
from feedsim.report.content import Picture, Report
from feedsim.report.page import html
from kinds_helpers import KINDS, Kinds
from report_helpers import circle_run, write_run

ZOOMS = 60
SUPER = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
POSITION = 1999.5  # [mm] where an axis of 2 m stops


def opened(browser: Any, file: Path) -> Any:
    page = browser.new_page(viewport={"width": 1200, "height": 900})
    page.said = []
    page.on("pageerror", lambda error: page.said.append(str(error)))
    page.goto(file.as_uri())
    page.wait_for_selector(".still", state="detached")
    return page


def far_off() -> tuple[np.ndarray, np.ndarray]:
    """Time [s], and position [mm] of an axis of 2 m that goes to its end and rings there by some nanometres."""
    t = np.arange(0.0, 2.0, 1e-3)
    way = np.minimum(t, 1.0) * POSITION
    return t, way + np.where(t > 1.0, 3e-6 * np.sin(2 * np.pi * 17.3 * t), 0.0)


def far_page(folder: Path) -> Path:
    t, x = far_off()
    panel = Panel("stop", Axis("time", "s"), Axis("position", "mm"), [Curve("axis Z", t, x)])
    (folder / "report.html").write_text(html(Report("t", "", [Picture("one", "t", "", Chart([panel]))], "")))
    return folder / "report.html"


def decoded(rows: int, content: bytes) -> np.ndarray:
    """A second reading of what embedded.steps writes."""
    values: list[float] = []
    count = next(n for n in range(len(content) + 1) if 16 * n + 4 * rows * n >= len(content))
    heads = np.frombuffer(content[: 16 * count], "<f8").reshape(count, 2)
    for k, whole in enumerate(np.frombuffer(content[16 * count :], "<i4")):
        middle, step = heads[k // rows]
        values.append(float("nan") if whole == -(2**31) else middle + step * float(whole))
    return np.array(values)


def test_a_nanometre_over_two_metres() -> None:
    t, x = far_off()
    panel = Panel("", Axis("time", "s"), Axis("position", "mm"), [Curve("", t, x)])
    data = json.loads(embed_charts({"one": Chart([panel])}))
    rows, text = data["arrays"][1]
    error = np.abs(decoded(rows, base64.b64decode(text)) - x)
    assert error.max() < 0.51 * rows * 2 / 2**32  # mm: half a step of a block while it moves by 2 mm a row
    assert error[t > 1.3].max() < 1e-12  # and what doubles have of it at rest


@pytest.mark.parametrize(
    "values",
    [
        [0.0, 0.0],
        [5.0],
        [],
        [*range(256)],
        [*range(257)],
        300 * [np.nan],
        [np.nan, 1.0, np.inf, 2.0],
        [-1e300, 1e300],
        [3e-320, 1e-320],
    ],
)
def test_arrays_of_every_kind(values: list[float]) -> None:
    found = decoded(BLOCK_ROWS, steps(np.array(values)))
    wanted = np.where(np.isfinite(values), values, np.nan)
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)


def test_a_logarithmic_axis_keeps_relative_digits() -> None:
    x, y = np.array([1.0, 10.0, 1000.0]), np.array([1e-12, 1.0, 1e6])
    panel = Panel("", Axis("f", "Hz", log=True), Axis("gain", log=True), [Curve("", x, y)])
    rows, text = json.loads(embed_charts({"one": Chart([panel])}))["arrays"][1]
    assert rows == 0
    np.testing.assert_allclose(np.frombuffer(base64.b64decode(text), "<f4"), y, rtol=1e-7)


def test_ticks_of_still_pictures_are_told_apart() -> None:
    for span in (
        (199.999, 200.001),
        (1999.4999999, 1999.5000001),
        (0.0, 1e-9),
        (-3e-7, 5e-7),
        (12.3456781, 12.3456789),
    ):
        texts = ticks(Axis("x", "mm"), span, 6).texts
        assert len(texts) >= 2
        assert len(set(texts)) == len(texts)


ZOOMED = """async ([figure, zooms]) => {
  const live = figure.live, found = [], usable = [...live.chart.panels.keys()].filter(
    k => live.chart.panels[k].kind === "xy" && !live.chart.panels[k].y.names.length);
  if (!usable.length) return found;
  for (const [panel, share] of zooms) {
    const k = usable[panel % usable.length];
    live.back();
    const drawn = live.drawn[k], inner = drawn.inner, at = [share[0] * inner.width, share[1] * inner.height];
    const half = share[2] * inner.width / 2, high = share[2] * inner.height / 2;
    const x = [drawn.across.back(inner.x + at[0] - half), drawn.across.back(inner.x + at[0] + half)];
    const y = [drawn.up.back(inner.y + at[1] + high), drawn.up.back(inner.y + at[1] - high)];
    live.zoom(k, x, share[3] > 0.5 ? y : null);
    live.drawn.forEach((each, j) => {
      if (each.panel.kind !== "xy") return;
      const foot = each.inner.y + each.inner.height + 16, words = [...each.part.querySelectorAll(":scope > text")];
      const place = (word, name) => Number(word.getAttribute(name));
      const along = words.filter(word => place(word, "y") === foot);
      const up = words.filter(word => word.getAttribute("text-anchor") === "end");
      const boxes = along.map(word => word.getBBox()).map(box => [box.x, box.x + box.width]);
      const text = all => all.map(word => word.textContent);
      found.push([text(along), text(up), boxes, each.span, each.height]);
    });
  }
  return found;
}"""


@pytest.mark.extensive
@pytest.mark.parametrize("name", [*(kind for kind in KINDS if kind != "machine"), "far"])
def test_no_zoom_repeats_a_tick(name: str, browser: Any, kinds: Kinds, tmp_path: Path) -> None:
    page = opened(browser, far_page(tmp_path) if name == "far" else kinds.page(name))
    random = np.random.default_rng(11)
    seen, charts = 0, 0
    for figure in page.locator("figure.chart").element_handles():
        zooms = [
            [
                int(random.integers(0, 9)),
                [*random.uniform(0.02, 0.98, 2), 10 ** random.uniform(-9, 0), random.uniform()],
            ]
            for _ in range(ZOOMS)
        ]
        drawn = page.evaluate(ZOOMED, [figure, zooms])
        charts += bool(drawn)
        for along, up, boxes, span, height in drawn:
            seen += 1
            assert len(along) == len(set(along)), (along, span)
            assert len(up) == len(set(up)), (up, height)
            assert len(along) >= 1
            assert len(up) >= 1
            for (_, end), (begin, _) in pairwise(boxes):
                assert end < begin, (along, span)
    assert page.said == []
    assert seen >= ZOOMS * charts
    assert charts or name == "study"  # which has grids alone
    page.close()


READ = """async ([figure, reads]) => {
  const live = figure.live, found = [];
  for (const [share, wide, at] of reads) {
    live.back();
    const whole = live.drawn[0].span, half = wide * (whole[1] - whole[0]) / 2;
    const middle = whole[0] + half + share * (whole[1] - whole[0] - 2 * half);
    live.zoom(0, [middle - half, middle + half], null);
    live.go(0, middle + (2 * at - 1) * half);
    found.push(figure.querySelector(".readout").innerText);
  }
  return found;
}"""


@pytest.mark.parametrize("kind", ["circle", "stop"])
def test_at_any_zoom_the_cursor_reads_the_rows_of_the_result(kind: str, browser: Any, kinds: Kinds) -> None:
    """At 60 random zooms of the overview: the sample under the cursor, of every axis, to the digits that are shown."""
    trace = read_csv(kinds[kind] / "result.csv")
    page = opened(browser, kinds.page(kind))
    page.evaluate("document.querySelectorAll('details').forEach(each => { each.open = true; })")
    random = np.random.default_rng(5)
    reads = [[random.uniform(), 10 ** random.uniform(-4, 0), random.uniform()] for _ in range(ZOOMS)]
    said = page.evaluate(READ, [page.locator("#overview").element_handle(), reads])
    page.close()
    signals = {"following error": ("x_e", 1e6), "torque": ("M_a", 1.0)}
    compared = 0
    for text in said:
        lines = text.replace("−", "-").split("\n")
        at = float(lines[0].split()[1])
        row = int(np.argmin(np.abs(trace.time - at)))
        assert trace.time[row] == pytest.approx(at, abs=0.51 * 10.0 ** -_decimals(lines[0].split()[1]) + 1e-9)
        of = ""
        for line in lines[1:]:
            found = re.fullmatch(r"\s*axis ([XYZ]): (-?[\d.]+)(?:×10(\S+))? \S+", line)
            if found is None:
                of = line.strip()
            elif of in signals:
                name, factor = signals[of]
                power = 10.0 ** int((found[3] or "0").translate(SUPER))
                value = float(found[2]) * power
                digit = 10.0 ** -_decimals(found[2]) * power
                # Half a digit for how it is written, as much for the steps that the page holds it in.
                assert value == pytest.approx(factor * trace[f"{found[1]}.{name}"][row], abs=1.02 * digit), line
                compared += 1
    assert compared >= ZOOMS


def _decimals(text: str) -> int:
    return len(text.partition(".")[2])


def test_far_off_the_cursor_reads_what_was_written(browser: Any, tmp_path: Path) -> None:
    """No stairs: neighbouring rows 1 nm apart are drawn and read apart; an offset stands at the axis."""
    t, x = far_off()
    page = opened(browser, far_page(tmp_path))
    figure = page.locator("figure.chart").element_handle()
    drawn = page.evaluate(
        """figure => { figure.live.zoom(0, [1.2, 1.24], null); figure.live.go(0, 1.2125);
        const path = figure.querySelector("svg.chart g[clip-path] path").getAttribute("d");
        return [path, [...figure.querySelectorAll("svg.chart text")].map(each => each.textContent)]; }""",
        figure,
    )
    ys = [float(point.split(" ")[1]) for point in re.findall(r"[ML]([^ML]+)", drawn[0])]
    rows = np.flatnonzero((t > 1.2) & (t < 1.24))
    assert len(set(ys)) > 0.5 * len(rows)
    assert max(ys) - min(ys) > 100
    assert any(re.fullmatch(r"position − 1999\.\d+ mm \[nm\]", text) for text in drawn[1]), drawn[1]
    said = page.locator("#one .readout").inner_text().replace("−", "-")
    at, value = (float(re.search(pattern, said)[1]) for pattern in (r"time ([\d.]+) s", r"axis Z: ([\d.]+) mm"))
    row = int(np.argmin(np.abs(t - at)))
    assert at == pytest.approx(t[row], abs=1e-8)
    assert value == pytest.approx(x[row], abs=5e-9)  # 0.005 nm: digits by what is seen
    page.close()


def test_saved_curves_have_all_digits(browser: Any, tmp_path: Path) -> None:
    t, x = far_off()
    page = opened(browser, far_page(tmp_path))
    with page.expect_download() as waited:
        page.get_by_role("button", name="CSV", exact=True).click()
    waited.value.save_as(tmp_path / "one.csv")
    table = np.genfromtxt(tmp_path / "one.csv", delimiter=",", skip_header=1)
    assert np.abs(table[:, 1] - x).max() < 1e-6
    assert np.abs(table[:, 0] - t).max() < 1e-8
    page.close()


def test_the_polar_picture_stays_one_at_its_largest_magnification(browser: Any, tmp_path: Path) -> None:
    run = circle_run()
    write_run(run, evaluate(run), tmp_path)
    page = opened(browser, tmp_path / "report.html")
    inside = page.evaluate(
        """() => { const found = [];
        for (const figure of document.querySelectorAll("figure.chart")) {
            const live = figure.live, polar = live.drawn.findIndex(each => each.panel.kind === "polar");
            if (polar < 0) continue;
            live.slider.value = live.slider.max;
            live.slider.dispatchEvent(new Event("input"));
            const { place, centre, half } = live.drawn[polar];
            for (const path of live.drawn[polar].part.querySelectorAll("g[clip-path] path")) {
                const points = [...path.getAttribute("d").matchAll(/[ML]([\\d.]+) ([\\d.]+)/g)];
                const far = points.map(each => Math.hypot(each[1] - centre[0], each[2] - centre[1]));
                found.push([far.filter(each => each <= half + 8).length / far.length, Math.min(...far) / half]);
            }
        }
        return found; }"""
    )
    page.close()
    assert len(inside) > 1
    for share, nearest in inside:
        assert share >= 0.5  # of the curve is inside of the rings
        assert nearest > 0.02  # and none of it is folded at the centre
