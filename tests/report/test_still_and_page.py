"""The still picture of a chart and the page show the same: words, places, ranges, ticks and curves."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from feedsim.report.chart import Axis, Band, Chart, Curve, Grid, Level, Mark, Panel, Polar
from feedsim.report.chart.model import MIN_RELATIVE_SPAN, UNITS_WITH_PREFIX, ticks
from feedsim.report.chart.svg import WIDTH, svg
from feedsim.report.content import Picture, Report
from feedsim.report.page import drawing_script, html
from feedsim_packager.units import parse
from svg_helpers import drawn_panels

SAME_PLACE = 1.0  # pixels
TIME, HEIGHT = Axis("time", "s"), Axis("height", "mm")
T = np.linspace(0.0, 2.0, 300)
ANGLE = np.linspace(0.0, 2 * np.pi, 360)


def panel(x: Axis, y: Axis, curve: Curve, **more: Any) -> Panel:
    return Panel("a panel", x, y, [curve], **more)


MAP = Grid("map", [f"{k}" for k in range(60)], ["one", "two"], np.linspace(-1, 2, 120).reshape(2, 60), (-1.0, 2.0))
CHARTS = {
    "plain": Chart([panel(TIME, HEIGHT, Curve("sine", T, np.sin(9 * T)), note="a note\nin two lines"),
                    panel(TIME, HEIGHT, Curve("sine", T, 1e3 * T, dash="dashed"), linked="t")]),
    "columns": Chart([panel(TIME, Axis("v", "mm/min"), Curve("a", T, T * k)) for k in (1e-5, 1.0, 2e8)],
                     (1.0, 2.0, 1.0)),
    "log": Chart([panel(Axis("f", "Hz", log=True), Axis("gain", "µm/N", log=True),
                        Curve("G", T + 1e-3, (T + 1e-3) ** -2)),
                  panel(Axis("f", "Hz", log=True), Axis("phase", "°"), Curve("G", T + 0.5, -400 * T))]),
    "both ways": Chart([panel(TIME, Axis("speed", "mm/min", symlog=10.0), Curve("v", T, 4e3 * np.sin(5 * T)))]),
    "narrow": Chart([panel(TIME, HEIGHT, Curve("far", T, 1999.5 + 1e-6 * np.sin(9 * T)))]),
    "prefixes": Chart([panel(Axis("time", "s"), Axis("error", "mm"), Curve("e", 1e-5 * T, 3e-5 * np.sin(9 * T))),
                       panel(Axis("f", "Hz", log=True), Axis("compliance", "µm/N", log=True),
                             Curve("G", T + 1e-3, 1e-5 * (T + 1e-3) ** -2)),
                       panel(TIME, Axis("stiffness", "N/m", also=("the same", "N·m/rad", 1e2)),
                             Curve("c", T, 3e8 * T))]),
    "names": Chart([panel(Axis("share", "%"), Axis("", names=["first", "a longer name"]),
                          Curve("bar", np.array([0.0, 40.0]), np.array([1.0, 1.0]), width=14.0))]),
    "second scales": Chart([panel(Axis("n", "rad/s", also=("feed", "m/min", 0.06)),
                                  Axis("M", "N·m", also=("i_q", "A", 1.7)), Curve("M", 50 * T, T**2))]),
    "marks": Chart([panel(TIME, HEIGHT, Curve("sine", T, np.sin(9 * T)),
                          levels=[Level(0.5, "half", dash="dotted"), Level(1.0, "here", upright=True),
                                  Level(-0.2, ends=(0.5, 1.5))],
                          bands=[Band("allowed", -0.1, 0.1), Band("between", T - 1, T, T)],
                          marks=[Mark(0.3, 0.4, "a point"), Mark(1.2, -0.9, "another", hollow=True)])]),
    "dots and steps": Chart([Panel("p", TIME, HEIGHT, [Curve("dots", T, np.cos(T), dots=True),
                                                       Curve("steps", T, T**2, filled=True)])]),
    "circle": Chart([Polar("circle", ("X", "Z"), 15.0, 5.0, 2, [Curve("scales", ANGLE, 3 * np.cos(3 * ANGLE))],
                           [Mark(0.1, 6.0, "X+: 6 µm")], 1, "a note"),
                     panel(Axis("angle", "°"), Axis("deviation", "µm"), Curve("scales", np.degrees(ANGLE),
                                                                              3 * np.cos(3 * ANGLE)))], (3.0, 2.0)),
    "one scale": Chart([panel(Axis("X", "mm", span=(-15.0, 15.0)), Axis("Y", "mm", span=(-15.0, 15.0)),
                              Curve("circle", 15 * np.cos(ANGLE), 15 * np.sin(ANGLE)), height=1.5, equal=True)]),
    "cells": Chart([Grid("cells", ["F_C", "sigma_0"], ["one", "two"], np.array([[0.5, -1.0], [np.nan, 0.25]]),
                         (-1.0, 1.0), 2, np.array([[True, False], [False, False]]), (1, 1))]),
    "a map": Chart([MAP]),
}  # fmt: skip

# Of a chart that is drawn as wide as the still picture: its words and where they stand, and what each curve spans.
DRAWN = """figure => {
  const live = figure.live;
  live.draw(WIDTH, 1);
  const svg = live.svg, seen = svg.getBoundingClientRect(), per = WIDTH / seen.width;
  const own = each => { const box = each.getBoundingClientRect(); return [(box.x - seen.x) * per,
    (box.y - seen.y) * per, box.width * per, box.height * per]; };
  const shift = each => { let x = 0, y = 0; for (let g = each; g !== svg; g = g.parentNode)
    for (const t of g.transform.baseVal) { x += t.matrix.e; y += t.matrix.f; } return [x, y]; };
  return {
    words: [...svg.querySelectorAll("text")].map(each => { const [x, y] = shift(each);
      return [each.textContent, x + Number(each.getAttribute("x") || 0), y + Number(each.getAttribute("y") || 0)]; }),
    curves: [...svg.querySelectorAll("g[clip-path] path")].map(own), height: svg.viewBox.baseVal.height };
}""".replace("WIDTH", f"{WIDTH:g}")
# The same of the still picture, whose legend stands above it.
STILL = """([text, top]) => {
  const room = document.createElement("div");
  room.style = "width: WIDTHpx; position: absolute; left: 0; top: 0";
  room.innerHTML = text;
  document.body.append(room);
  const svg = room.firstChild, seen = svg.getBoundingClientRect(), per = WIDTH / seen.width;
  const own = each => { const box = each.getBoundingClientRect(); return [(box.x - seen.x) * per,
    (box.y - seen.y) * per - top, box.width * per, box.height * per]; };
  const found = [...svg.querySelectorAll("g[clip-path] path")].map(own);
  room.remove();
  return found;
}""".replace("WIDTH", f"{WIDTH:g}")


def words_of(drawn: str) -> tuple[list[tuple[str, float, float]], float]:
    """Words of the panels of a still picture, and how much room its legend takes above them."""
    panels, _, top = drawn_panels(drawn)
    return [(word.text, word.x, word.y - top) for panel in panels for word in panel.words], top


@pytest.fixture(scope="module")
def page(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    file: Path = tmp_path_factory.mktemp("still") / "report.html"
    pictures = [Picture(name.replace(" ", "-"), name, "", chart) for name, chart in CHARTS.items()]
    file.write_text(html(Report("t", "", pictures, "")), encoding="utf-8")
    opened = browser.new_page(viewport={"width": 1200, "height": 900})
    opened.goto(file.as_uri())
    opened.evaluate("document.querySelectorAll('details').forEach(each => { each.open = true; })")
    opened.wait_for_selector(".still", state="detached")
    yield opened
    opened.close()


@pytest.mark.parametrize("name", CHARTS)
def test_still_picture_and_page_show_the_same(page: Any, name: str) -> None:
    drawn = svg(CHARTS[name], name.replace(" ", "-"), name)
    words, top = words_of(drawn)
    on_page = page.eval_on_selector(f"figure[id='{name.replace(' ', '-')}']", DRAWN)
    assert sorted(text for text, _, _ in words) == sorted(text for text, _, _ in on_page["words"])
    for (text, x, y), (_, a, b) in zip(sorted(words), sorted(map(tuple, on_page["words"])), strict=True):
        assert (x, y) == pytest.approx((a, b), abs=SAME_PLACE), text
    height = float(ElementTree.fromstring(drawn).attrib["viewBox"].split()[3])
    assert height - top == pytest.approx(on_page["height"], abs=SAME_PLACE)
    still = page.evaluate(STILL, [drawn, top])
    assert len(still) == len(on_page["curves"])
    np.testing.assert_allclose(sorted(still), sorted(on_page["curves"]), atol=SAME_PLACE)


TICKS = """asked => asked.map(([axis, low, high, most]) => {
  const found = ticks(axis, low, high, most);
  return [found.map(each => [each.at, each.text || ""]), found.common || "", found.unit || ""];
})"""


def test_ticks_are_the_same_at_any_span(browser: Any) -> None:
    random = np.random.default_rng(5)
    axes = [Axis("x", "mm"), Axis("x", "°"), Axis("t", "s"), Axis("x"), Axis("f", "Hz", log=True),
            Axis("v", "mm/min", symlog=9.0), Axis("c", "N/m"), Axis("G", "µm/N", log=True),
            Axis("", names=["a", "b", "c", "d"])]  # fmt: skip
    asked, expected = [], []
    for _ in range(600):
        axis = axes[random.integers(len(axes))]
        middle, wide = random.uniform(-1, 1) * 10 ** random.uniform(-6, 6), 10 ** random.uniform(-7, 6)
        low, high = middle - wide, middle + wide
        if high - low < MIN_RELATIVE_SPAN * max(abs(low), abs(high)):
            continue
        if axis.log:
            low, high = abs(middle), abs(middle) * (1 + wide)
        most = int(random.integers(2, 12))
        known = {"label": axis.label, "unit": axis.unit, "log": axis.log, "names": list(axis.names),
                 **({"symlog": axis.symlog} if axis.symlog else {})}  # fmt: skip
        asked.append([known, low, high, most])
        expected.append(ticks(axis, (low, high), most))
    page = browser.new_page()
    script = drawing_script().partition("// What a reader does with the charts")[0]
    found = page.evaluate(f"asked => {{ {script}; return ({TICKS})(asked); }}", asked)
    page.close()
    assert len(found) > 400
    for (axis, low, high, most), (marks, common, unit), own in zip(asked, found, expected, strict=True):
        said = f"{axis['unit']} {low} to {high}, {most}"
        assert [text for _, text in marks] == [text for _, text in own.marks], said
        assert [at for at, _ in marks] == pytest.approx([at for at, _ in own.marks], rel=1e-9, abs=1e-12), said
        assert (common, unit) == (own.common, own.unit), said


@pytest.mark.parametrize(
    ("axis", "span", "title"),
    [
        (Axis("error", "m"), (-2e-6, 3e-6), "error [µm]"),
        (Axis("error", "mm"), (0.0, 4e-5), "error [nm]"),
        (Axis("torque", "N·m"), (-5e-5, 1e-5), "torque [µN·m]"),
        (Axis("stiffness", "N/m"), (1e8, 3e8), "stiffness [MN/m]"),
        (Axis("compliance", "µm/N", log=True), (2e-6, 0.9), "compliance [nm/N]"),
        (Axis("speed", "mm/min", symlog=1e-6), (-0.5, 0.5), "speed [µm/min]"),
        (Axis("error", "mm"), (0.0, 0.4), "error [mm]"),
        (Axis("ratio"), (0.0, 3e-6), "ratio"),
    ],
)
def test_units_have_prefixes_in_place_of_powers_of_ten(axis: Axis, span: tuple[float, float], title: str) -> None:
    found = ticks(axis, span, 6)
    assert found.title(axis) == title
    assert found.has_powers == (axis.unit == "")
    if axis.unit:
        per = size_of(title.partition("[")[2].rstrip("]")) / size_of(axis.unit)
        for at, text in found.marks:
            assert span[0] <= at <= span[1]
            assert not text or float(text.replace("−", "-")) * per == pytest.approx(at, rel=1e-6, abs=1e-15)


def test_units_with_prefixes_are_what_they_say() -> None:
    for unit, known in UNITS_WITH_PREFIX.items():
        assert (1, unit) in known
        assert sorted(factor for factor, _ in known) == [factor for factor, _ in known]
        for factor, other in known:
            assert factor == pytest.approx(size_of(unit) / size_of(other), rel=1e-12), (unit, other)


def size_of(unit: str) -> float:
    """In SI, by the algebra of units."""
    return float(parse(unit.replace("µ", "u").replace("·", "*").replace("²", "^2")).exact)


def test_one_scale_keeps_circles_round() -> None:
    """Whatever the frame: as wide as high, to the tenth of a pixel that is drawn."""
    (drawn,) = drawn_panels(svg(CHARTS["one scale"], "circle", "A circle"))[0]
    x, y = drawn.curves[0][0].T
    assert np.ptp(x) == pytest.approx(np.ptp(y), abs=0.2)
    assert np.ptp(y) > 100
