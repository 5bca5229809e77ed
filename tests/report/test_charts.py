"""Charts as SVG: axes, what panels hold, and that words keep clear of curves and of one another."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from itertools import combinations
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from feedsim.report.chart import Axis, Band, Chart, Curve, Grid, Level, Mark, Panel, Polar
from feedsim.report.chart.model import axis_measure, embed_charts, ranges, ticks
from feedsim.report.chart.svg import svg
from feedsim.report.content import Picture
from svg_helpers import Drawn, drawn_panels, overlap

TIME, HEIGHT = Axis("time", "s"), Axis("height", "m")
UNIT = Axis("height", "m", span=(0.0, 1.0))
X = np.linspace(0.0, 1.0, 400)
DENSE = np.linspace(0.0, 1.0, 4000)


def sine(name: str, **look: Any) -> Curve:
    return Curve(name, X, np.sin(20 * X), **look)


def drawn(*parts: Any, widths: tuple[float, ...] = (1.0,)) -> list[Drawn]:
    return drawn_panels(svg(Chart(parts, widths), "s", "t"))[0]


def share(panel: Drawn, x: float, y: float) -> tuple[float, float]:
    """A point as shares of a panel's room, from the lower left."""
    assert panel.room is not None
    left, top, right, bottom = panel.room
    return (x - left) / (right - left), (bottom - y) / (bottom - top)


# -- words within panels ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("instant", "right"), [(0.2, True), (0.97, False)])
def test_label_of_an_instant_stays_inside_and_off_the_curve(instant: float, right: bool) -> None:
    curve = Curve("", np.array([0.0, 1.0]), np.array([0.92, 0.98]))
    (panel,) = drawn(Panel("", TIME, UNIT, [curve], [Level(instant, "end of NC motion", upright=True)]))
    (word,) = panel.over
    (left, low), (end, high) = share(panel, word.box[0], word.box[3]), share(panel, word.box[2], word.box[1])
    assert 0 < left < end <= 1
    assert 0.5 < low < high < 0.92 + 0.06 * left
    assert (left > instant) == right


@pytest.mark.parametrize(("until", "moved"), [(0.0, False), (0.5, True)])
def test_label_of_a_level_moves_sideways_where_curves_are_in_the_way(until: float, moved: bool) -> None:
    wave = np.where((until < DENSE) & moved, 0.5 + 0.45 * np.sin(400 * DENSE), 0.5)
    level = Level(0.5, "mean 0.50 N·m", ends=(0.0, 0.9))
    (panel,) = drawn(Panel("", TIME, UNIT, [Curve("", DENSE, wave)], [level]))
    (word,) = panel.over
    left, low = share(panel, word.box[0], word.box[3])
    assert (left < 0.5) == moved
    assert 0.4 < low < 0.6


def test_labels_of_points_cover_neither_curves_nor_each_other() -> None:
    wave = 0.5 + 0.3 * np.sin(12 * X)
    marks = [Mark(x, 0.5 + 0.3 * math.sin(12 * x), f"{x:.1f} s") for x in np.linspace(0.1, 0.9, 9).tolist()]
    (panel,) = drawn(Panel("", TIME, UNIT, [Curve("", X, wave)], marks=marks))
    boxes = [word.box for word in panel.over]
    assert len(boxes) == 9
    (curve, _), *_ = panel.curves
    for x0, y0, x1, y1 in boxes:
        assert not np.any((curve[:, 0] > x0) & (curve[:, 0] < x1) & (curve[:, 1] > y0) & (curve[:, 1] < y1))
    assert not any(overlap(one, other) for one, other in combinations(boxes, 2))


def test_a_label_far_from_its_point_has_a_line_to_it() -> None:
    wave = Curve("", DENSE, 0.35 + 0.3 * np.sin(4000 * DENSE))
    for curves, lines in (([wave], 1), ([], 0)):
        panel = Panel("", replace(TIME, span=(0.0, 1.0)), UNIT, curves, marks=[Mark(0.5, 0.35, "in the thick of it")])
        assert len(drawn(panel)[0].lines) == lines


@pytest.mark.parametrize(("middle", "low"), [(0.75, True), (0.25, False)])
def test_a_note_takes_the_corner_that_is_free(middle: float, low: bool) -> None:
    curve = Curve("", DENSE, middle + 0.24 * np.sin(4000 * DENSE))
    (panel,) = drawn(Panel("", TIME, UNIT, [curve], note="phase margin 60°\ngain margin 12 dB"))
    assert [word.text for word in panel.over] == ["phase margin 60°", "gain margin 12 dB"]
    assert (share(panel, *panel.over[0].box[:2])[1] < 0.5) == low


# -- axes -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("axis", "span", "most", "expected"),
    [
        (HEIGHT, (-1.3, 1.3), 6, ["−1", "−0.5", "0", "0.5", "1"]),
        (HEIGHT, (0.0, 3e-5), 4, ["0", "10", "20", "30"]),
        (HEIGHT, (-15.7, 15.7), 2, ["−10", "0", "10"]),  # a single tick would be no scale
        (HEIGHT, (3.21, 3.79), 2, ["3.4", "3.6"]),
        (HEIGHT, (2000.0, 19990.0), 2, ["5000", "10000", "15000"]),
        (Axis("phase", "°"), (-200.0, 10.0), 2, ["−180", "−90", "0"]),
        (Axis("f", "Hz", log=True), (1.0, 2000.0), 3, ["1", "10", "100", "1000"]),
        (Axis("phase", "°"), (-400.0, 10.0), 5, ["−360", "−270", "−180", "−90", "0"]),
        (Axis("phase", "°"), (-100.0, 90.0), 5, ["−90", "−45", "0", "45", "90"]),
        (Axis("f", "Hz", log=True), (0.8, 2000.0), 9, ["1", "10", "100", "1000"]),
        (Axis("f", "Hz", log=True), (0.8, 60.0), 9, ["1", "2", "5", "10", "20", "50"]),
        (Axis("d", "dB", log=True), (1e-4, 100.0), 4, ["0.0001", "0.01", "1", "100"]),
        (Axis("v", "mm/min", symlog=9.0), (-1200.0, 150.0), 9, ["−1000", "−100", "0", "100"]),
        (Axis("", names=["a", "b", "c"]), (-0.6, 2.6), 9, ["a", "b", "c"]),
    ],
)
def test_axes_are_marked_by_round_values(
    axis: Axis, span: tuple[float, float], most: float, expected: list[str]
) -> None:
    assert ticks(axis, span, most).texts == expected


def test_axis_that_is_logarithmic_both_ways() -> None:
    values = np.array([-1e4, -10.0, -1e-9, 0.0, 3.0, 1e4])
    seen = axis_measure(Axis("v", symlog=10.0), values)
    assert np.all(np.diff(seen) > 0)
    assert seen[-1] - axis_measure(Axis("v", symlog=10.0), 1e3) == pytest.approx(
        1.0, abs=0.01
    )  # a decade far from zero
    panel = Panel("", TIME, Axis("v", symlog=10.0), [Curve("", X, 1e3 * np.sin(X))])
    assert ranges(panel)[1][1] > 1e3 * math.sin(1.0)


# -- panels -----------------------------------------------------------------------------------------------------------


def test_a_chart_has_one_legend_above_all_panels() -> None:
    band = Band("tolerance", -0.1, 0.1)
    chart = Chart([
        Panel("One", TIME, HEIGHT, [sine("a"), sine("b_x", filled=True)], bands=[band]),
        Panel("Two", TIME, HEIGHT, [sine("a"), sine("", dots=True)]),
    ])  # fmt: skip
    panels, legend, top = drawn_panels(svg(chart, "s", "t"))
    assert legend == ["a", "b_x", "tolerance"]
    assert top > 10
    assert all(word.y > top for panel in panels for word in panel.words)
    many = [sine(f"a rather long name {k}") for k in range(20)]
    panels, legend, more = drawn_panels(svg(Chart([Panel("", TIME, HEIGHT, many)]), "s", "t"))
    assert len(legend) == 20
    assert more > 3 * top


def test_what_a_panel_holds_is_drawn() -> None:
    (panel,) = drawn(Panel(
        "Panel", Axis("v", "rad/s", log=True, also=("feed", "mm/min", 60.0)), Axis("M", "N·m"),
        [Curve("", X + 1, X, dash="dashed"), Curve("", X + 1, X, dots=True, faint=True)],
        [Level(0.5, "half"), Level(1.5, "here", upright=True)],
        [Band("", -1e9, 1e9, np.array([1.2, 1.3]))],
        [Mark(1.5, 0.5, "a point", hollow=True)], note="a note",
    ))  # fmt: skip
    assert {word.text for word in panel.over} == {"half", "here", "a point", "a note"}
    assert {"Panel", "v [rad/s]", "M [N·m]", "feed [mm/min]", "60", "120", "1", "2"} <= set(panel.texts)
    # the range upwards is that of the curves: a band across all of it takes no room
    assert {"0", "0.2", "1"} <= set(panel.texts)
    looks = [look for _, look in panel.curves]
    assert [look.get("stroke-dasharray") for look in looks if "stroke" in look] == [None, "6 3"]
    assert [look.get("stroke-opacity") for look in looks if "stroke-linecap" in look] == ["0.4"]
    assert panel.circles[0]["fill"] == "none"
    boxes = [word.box for word in panel.over]
    assert not any(overlap(one, other) for one, other in combinations(boxes, 2))
    second = {word.text: word.x for word in panel.words}
    assert second["120"] == pytest.approx(second["2"], abs=0.1)  # 2 rad/s are 120 mm/min


def test_a_curve_stands_where_its_numbers_are() -> None:
    panel = Panel("", replace(TIME, span=(0.0, 2.0)), replace(HEIGHT, span=(-1.0, 3.0)), [Curve("", X, 2 * X)])
    (found,) = drawn(panel)
    ((points, _),) = found.curves
    shares = np.array([share(found, *point) for point in points])
    np.testing.assert_allclose(shares[[0, -1]], [(0.0, 0.25), (0.5, 0.75)], atol=1e-3)


def test_numbers_that_are_none_break_a_curve() -> None:
    y = np.where((X > 0.4) & (X < 0.6), np.nan, 1.0)
    text = svg(Chart([Panel("", TIME, HEIGHT, [Curve("", X, y), Curve("", X, np.full(len(X), np.nan))])]), "s", "t")
    assert "nan" not in text
    assert [d.count("M") for d in re.findall(r'<path d="([^"]+L[^"]+)" stroke="[^"]+" stroke-width="1.4"', text)] == [2]
    assert svg(Chart([Panel("", TIME, HEIGHT)]), "s", "t")  # and there may be none


def test_a_turn_is_closed_and_lies_on_its_radius() -> None:
    angle = np.linspace(0, 2 * np.pi, 300, endpoint=False)
    turn = Polar("", ("X", "Y"), 15.0, 10.0, 1, [Curve("", angle, 3 * np.cos(angle))], sense=1, note="a note")
    (panel,) = drawn(turn)
    ((points, look), *_) = panel.curves
    assert look["d"].endswith("Z")
    centre = points.mean(axis=0)
    rings = {circle["r"]: circle for circle in panel.circles}
    (programmed,) = (float(r) for r, circle in rings.items() if "stroke-dasharray" in circle)
    middle = np.array([float(panel.circles[0]["cx"]), float(panel.circles[0]["cy"]) + 4])  # 4: of the chart
    r = np.hypot(*(points - middle).T) / programmed
    np.testing.assert_allclose(r, 1 + 0.36 * 3 * np.cos(angle) / 10, atol=2e-3)
    assert np.linalg.norm(centre - middle) < 0.2 * programmed
    assert {"X+", "X−", "Y+", "Y−", "+10 µm", "−10 µm", "0", "a note"} <= set(panel.texts)
    half = replace(turn, curves=[Curve("", angle[:150], 3 * np.cos(angle[:150]))])
    assert not drawn(half)[0].curves[0][1]["d"].endswith("Z")


def test_cells_hold_their_numbers() -> None:
    values = np.array([[0.5, -1.0], [np.nan, 0.25]])
    grid = Grid("", ["F_C", "sigma_0"], ["one", "two"], values, (-1.0, 1.0), 2, np.abs(values) > 0.9)
    (panel,) = drawn(grid)
    numbers = {word.text: word.bold for word in panel.words if not word.upright and word.text not in ("one", "two")}
    assert numbers == {"0.50": False, "−1.00": True, "0.25": False}
    assert [word.text for word in panel.words if word.upright] == ["F_C", "sigma_0"]
    many = Grid("map", [f"{k}" for k in range(90)], ["one"], np.arange(90.0)[None], (0.0, 89.0))
    (panel,) = drawn(many)
    assert [word.text for word in panel.words if not word.upright] == ["map", "one", "0", "89"]  # a scale of colours
    names = [word.x for word in panel.words if word.upright]
    assert np.diff(names).min() >= 11


def test_names_of_people_are_no_markup() -> None:
    chart = Chart([Panel("cost $5 & <b>", TIME, HEIGHT, [sine("a$b$_c"), sine("<other>")])])
    picture = Picture("s", "$x & <y>", "", chart)
    (panel,), legend, _ = drawn_panels(picture.svg)
    assert "cost $5 & <b>" in panel.texts
    assert legend == ["a$b$_c", "<other>"]
    assert ElementTree.fromstring(picture.content("svg")).attrib["aria-label"] == "$x & <y>"


def test_the_cell_that_is_looked_for_has_a_frame_and_a_map_its_room() -> None:
    grid = Grid("a map", ["1", "2"], ["b", "a"], np.array([[1.0, 2.0], [0.5, 3.0]]), (0.5, 3.0), best=(1, 0))
    plain = replace(grid, best=None)
    for each, frames in ((grid, 1), (plain, 0)):
        text = svg(Chart([each]), "m", "t")
        assert text.count('stroke="var(--ink)" stroke-width="2.2"') == frames
        (panel,) = json.loads(embed_charts({"m": Chart([each])}))["charts"]["m"]["panels"]
        assert panel.get("best") == (None if each.best is None else [1, 0])
    text = svg(Chart([grid]), "m", "t")
    whole = float(re.search(r'viewBox="0 0 ([\d.]+)', text)[1])
    cells = [float(width) for width in re.findall(r'<rect x="[^"]+" y="[^"]+" width="([\d.]+)"', text)]
    assert 2 * cells[0] > 0.9 * whole
    assert Picture("m", "t", "", Chart([grid])).png != Picture("m", "t", "", Chart([plain])).png


def test_a_file_of_its_own_needs_no_style_sheet() -> None:
    picture = Picture("s", "A title", "What it shows.", Chart([Panel("", TIME, HEIGHT, [sine("a")])]), True, "a remark")
    text = picture.content("svg").decode()
    assert "var(--" not in text
    words = {element.text for element in ElementTree.fromstring(text).iter() if element.tag.endswith("text")}
    assert {"A title", "What it shows.", "a remark", "time [s]"} <= words
    assert picture.content("png") == picture.content("png")


def test_points_in_no_order_are_thinned_to_a_sample_of_them() -> None:
    """A study of many runs: as dense in the middle as its runs are, the extremes among them, in picture and page."""
    rng = np.random.default_rng(4)
    x = rng.uniform(0.0, 1.0, 50_000)
    y = np.where(rng.uniform(size=50_000) < 0.01, np.nan, x**2 + rng.normal(0.0, 0.1, 50_000))
    curve = Curve("a run", x, y, dots=True, most=3000)
    shown = curve.thinned()
    assert 2900 < len(shown.x) <= 3004
    for few, all_of_them in ((shown.x, x), (shown.y, y)):
        few, all_of_them = few[np.isfinite(few)], all_of_them[np.isfinite(all_of_them)]
        assert (few.min(), few.max()) == (all_of_them.min(), all_of_them.max())
        parts = np.linspace(0.05, 0.95, 10)
        np.testing.assert_allclose(np.quantile(few, parts), np.quantile(all_of_them, parts), atol=0.03)
    picture = svg(Chart([Panel("runs", Axis("x"), Axis("y"), [curve])]), "s", "runs")
    drawn = re.findall(r"M(-?[\d.]+) (-?[\d.]+)h0", picture)
    assert len(drawn) == int(np.isfinite(shown.y).sum())
    few = Curve("a run", x[:3000], y[:3000], dots=True, most=3000)
    assert few.thinned() is few
