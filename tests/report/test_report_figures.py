"""Figures of a report: what they show, and that labels and legends keep clear of the curves."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from feedsim.analysis import Figure, PositioningTask, evaluate, tasks
from feedsim.motions import Circle, Dwell, Move
from feedsim.report import chart
from feedsim.report.chart import Band, Chart, Curve, Grid, Level, Mark, Panel, Polar
from feedsim.report.chart.embedded import embedded
from feedsim.report.chart.placing import Ground
from feedsim.report.chart.scales import bent, ranges, ticks, unbent
from feedsim.report.chart.still import still
from feedsim.report.picture import Picture
from feedsim.report.run.axis_plots import overview_picture, positioning_picture
from feedsim.report.run.circle_plots import ring_step
from feedsim.report.run.report import draw
from feedsim.report.style import LARGEST_SVG, SIMULATED, drawing
from feedsim.scenario import Axis, CircleTest, Positioning
from report_helpers import FakeRun, circle_run, positioning_run, run_of, small_run
from scenario_helpers import default_machine, scenario

TIME, HEIGHT = chart.Axis("time", "s"), chart.Axis("height", "m")
X = np.linspace(0.0, 1.0, 400)


def placed(figure: Any, axes: Any) -> list[Any]:
    """Boxes of the words in a panel [pixels]."""
    return [text.get_window_extent() for text in axes.texts if text.get_text()]


def test_display_sign_turns_torques_over_and_says_so() -> None:
    machine = default_machine()
    turned = machine.axes["Z"].model_copy(update={"display_sign": -1})
    run = positioning_run()
    other = positioning_run(machine=machine.model_copy(update={"axes": {**machine.axes, "Z": turned}}))
    figures = evaluate(run)
    assert figures == evaluate(other)  # a display sign is no result
    (plain, _), (reversed_, _) = draw(run, figures), draw(other, figures)
    assert "reversed" not in plain.caption
    assert "drawn with reversed sign" in reversed_.caption
    assert plain.png != reversed_.png


def test_torques_are_drawn_as_they_are_by_default() -> None:
    assert Axis.model_fields["display_sign"].default == 1
    run = positioning_run()
    (task,) = tasks(run.scenario, run.program)
    assert isinstance(task, PositioningTask)
    figures = task.figures(run.trace)
    plain = positioning_picture(run.trace, task.approach, figures, "s")
    assert plain.png == positioning_picture(run.trace, task.approach, figures, "s", torque_sign=1).png
    assert plain.png != positioning_picture(run.trace, task.approach, figures, "s", torque_sign=-1).png
    one, other = (overview_picture(run.trace, ["Z"], signs, "s") for signs in ({}, {"Z": 1}))
    assert one is not None
    assert other is not None
    assert one.png == other.png


# -- words within panels ----------------------------------------------------------------------------------------------


@contextmanager
def ground(*curves: Any) -> Iterator[tuple[Any, Ground]]:
    """A panel from 0 to 1 with curves, and where words may stand in it."""
    with drawing(5.0, 3.0) as figure:
        axes = figure.add_subplot()
        for x, y in curves:
            axes.plot(x, y)
        axes.set(xlim=(0, 1), ylim=(0, 1))
        yield axes, Ground(axes)


@pytest.mark.parametrize(("instant", "side"), [(0.2, "left"), (0.97, "right")])
def test_label_of_an_instant_stays_inside_and_off_the_curve(instant: float, side: str) -> None:
    with ground(([0.0, 1.0], [0.92, 0.98])) as (axes, place):
        place.upright(instant, "end of NC motion", "#000000")
        (box,) = placed(axes.figure, axes)
        (left, low), (right, high) = axes.transAxes.inverted().transform([(box.x0, box.y0), (box.x1, box.y1)])
        assert 0 < left < right < 1
        assert 0.5 < low < high < 0.92 + 0.06 * left
        assert (left > instant) == (side == "left")
        assert not axes.texts[0].get_in_layout(), "the label takes room from the axes"


def test_label_of_a_level_moves_sideways_where_curves_are_in_the_way() -> None:
    for until, moved in ((0.0, False), (0.5, True)):
        wave = np.where(until < X, 0.5, 0.5 + 0.45 * np.sin(400 * X))
        with ground((X, wave)) as (axes, place):
            place.along(0.5, "mean 0.50 N·m", "#000000", (0.0, 0.6))
            (box,) = placed(axes.figure, axes)
            left, low = axes.transAxes.inverted().transform((box.x0, box.y0))
            assert (left >= 0.5) == moved
            assert 0.5 < low < 0.6


def test_labels_of_points_cover_neither_curves_nor_each_other() -> None:
    wave = 0.5 + 0.3 * np.sin(12 * X)
    with ground((X, wave)) as (axes, place):
        for x in np.linspace(0.1, 0.9, 9):
            place.beside(x, 0.5 + 0.3 * math.sin(12 * x), f"{x:.1f} s", "#000000")
        boxes = placed(axes.figure, axes)
        points = axes.transData.transform(np.column_stack([X, wave]))
        for box in boxes:
            assert not np.any(
                (points[:, 0] > box.x0) & (points[:, 0] < box.x1) & (points[:, 1] > box.y0) & (points[:, 1] < box.y1)
            )
        assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


def test_a_label_far_from_its_point_has_a_line_to_it() -> None:
    dense = np.linspace(0, 1, 4000)
    with ground((dense, 0.35 + 0.3 * np.sin(4000 * dense))) as (axes, place):
        place.beside(0.5, 0.35, "in the thick of it", "#000000")
        assert len(axes.lines) == 2
    with ground() as (axes, place):
        place.beside(0.5, 0.35, "free", "#000000")
        assert not axes.lines


def test_a_note_takes_the_corner_that_is_free() -> None:
    dense = np.linspace(0, 1, 4000)
    for middle, low in ((0.75, True), (0.25, False)):
        with ground((dense, middle + 0.24 * np.sin(4000 * dense))) as (axes, place):
            place.corner("phase margin 60°\ngain margin 12 dB", "#000000")
            (box,) = placed(axes.figure, axes)
            assert (axes.transAxes.inverted().transform((box.x0, box.y0))[1] < 0.5) == low


# -- axes -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("axis", "span", "most", "expected"),
    [
        (HEIGHT, (-1.3, 1.3), 6, ["−1", "−0.5", "0", "0.5", "1"]),
        (HEIGHT, (0.0, 3e-5), 4, ["0", "1×10⁻⁵", "2×10⁻⁵", "3×10⁻⁵"]),
        (HEIGHT, (-15.7, 15.7), 2, ["−10", "0", "10"]),  # a single tick would be no scale
        (HEIGHT, (3.21, 3.79), 2, ["3.4", "3.6"]),
        (HEIGHT, (2000.0, 19990.0), 2, ["5000", "10000", "15000"]),
        (chart.Axis("phase", "°"), (-200.0, 10.0), 2, ["−180", "−90", "0"]),
        (chart.Axis("f", "Hz", log=True), (1.0, 2000.0), 3, ["1", "10", "100", "1000"]),
        (chart.Axis("phase", "°"), (-400.0, 10.0), 5, ["−360", "−270", "−180", "−90", "0"]),
        (chart.Axis("phase", "°"), (-100.0, 90.0), 5, ["−90", "−45", "0", "45", "90"]),
        (chart.Axis("f", "Hz", log=True), (0.8, 2000.0), 9, ["1", "10", "100", "1000"]),
        (chart.Axis("f", "Hz", log=True), (0.8, 60.0), 9, ["1", "2", "5", "10", "20", "50"]),
        (chart.Axis("d", "dB", log=True), (1e-4, 100.0), 4, ["0.0001", "0.01", "1", "100"]),
        (chart.Axis("v", "mm/min", symlog=9.0), (-1200.0, 150.0), 9, ["−1000", "−100", "0", "100"]),
        (chart.Axis("", names=["a", "b", "c"]), (-0.6, 2.6), 9, ["a", "b", "c"]),
    ],
)
def test_axes_are_marked_by_round_values(
    axis: chart.Axis, span: tuple[float, float], most: float, expected: list[str]
) -> None:
    assert [text for _, text in ticks(axis, span, most)] == expected


def test_axis_that_is_logarithmic_both_ways() -> None:
    values = np.array([-1e4, -10.0, -1e-9, 0.0, 3.0, 1e4])
    seen = bent(10.0, values)
    assert np.all(np.diff(seen) > 0)
    assert unbent(10.0, seen) == pytest.approx(values, rel=1e-12)
    assert seen[-1] - bent(10.0, 1e3) == pytest.approx(1.0, abs=0.01)  # a decade far from zero
    panel = Panel("", TIME, chart.Axis("v", symlog=10.0), [Curve("", X, 1e3 * np.sin(X))])
    assert ranges(panel)[1][1] > 1e3 * math.sin(1.0)


# -- charts for print -------------------------------------------------------------------------------------------------


def sine(name: str, **look: Any) -> Curve:
    return Curve(name, X, np.sin(20 * X), **look)


def test_a_chart_has_one_legend_above_all_panels(figures: list[Any]) -> None:
    band = Band("tolerance", -0.1, 0.1)
    panels = [
        Panel("One", TIME, HEIGHT, [sine("a"), sine("b_x")], bands=[band]),
        Panel("Two", TIME, HEIGHT, [sine("a")]),
    ]
    assert Picture("s", "t", "", Chart(panels)).png
    (figure,) = figures
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["a", "$b_{x}$", "tolerance"]
    box = legend.get_window_extent()
    assert all(axes.get_tightbbox().y1 <= box.y0 + 1 for axes in figure.axes)
    assert box.y1 <= figure.bbox.y1
    assert Picture("s", "t", "", Chart([Panel("", TIME, HEIGHT, [sine("alone")])])).png
    assert not figures[1].legends


def test_panels_over_the_same_abscissa_name_it_once(figures: list[Any]) -> None:
    def panel(linked: str) -> Panel:
        return Panel("", TIME, HEIGHT, [sine("")], linked=linked)

    assert Picture("s", "t", "", Chart([panel("t"), panel("t"), panel("")])).png
    assert [axes.get_xlabel() for axes in figures[0].axes] == ["", "time [s]", "time [s]"]
    assert Picture("s", "t", "", Chart([panel("t"), panel("t")], (1.0, 1.0))).png
    assert [axes.get_xlabel() for axes in figures[1].axes] == ["time [s]", "time [s]"]
    assert [axes.get_ylabel() for axes in figures[1].axes] == ["height [m]", ""]


def test_what_a_panel_holds_is_drawn(figures: list[Any]) -> None:
    panel = Panel(
        "Panel", chart.Axis("v", "rad/s", log=True, also=("feed", "mm/min", 60.0)), chart.Axis("M", "N·m"),
        [Curve("", X + 1, X, dash="dashed"), Curve("", X + 1, X, dots=True)],
        [Level(0.5, "half", colour="#1b1f24"), Level(1.5, "here", upright=True)],
        [Band("", -1e9, 1e9, np.array([1.2, 1.3]))],
        [Mark(1.5, 0.5, "a point", hollow=True)], note="a note",
    )  # fmt: skip
    assert Picture("s", "t", "", Chart([panel])).png
    (axes,) = figures[0].axes
    assert {text.get_text() for text in axes.texts} == {"half", "here", "a point", "a note"}
    assert axes.get_xscale() == "log"
    assert axes.get_ylim() == pytest.approx((-0.07, 1.07))  # a band across all of it takes no room
    dashed, dots, point = axes.lines[:3]
    assert dashed.get_linestyle() == "--"
    assert (dots.get_linestyle(), dots.get_marker()) == ("None", "o")
    assert point.get_markerfacecolor() == "none"
    (above,) = axes.child_axes
    assert above.get_xlabel() == "feed [mm/min]"
    assert above.get_xlim() == pytest.approx([60 * x for x in axes.get_xlim()])
    boxes = placed(figures[0], axes)
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


def test_a_loop_is_closed_and_a_turn_is(figures: list[Any]) -> None:
    angle = np.linspace(0, 2 * np.pi, 300, endpoint=False)
    loop = Panel("", TIME, HEIGHT, [Curve("", np.cos(angle), np.sin(angle)), Curve("", np.cos(angle[:150]), X[:150])])
    turn = Polar("", ("X", "Y"), 15.0, 10.0, 1, [Curve("", angle, 3 * np.cos(angle))], sense=1, note="a note")
    assert Picture("s", "t", "", Chart([turn, loop], (1.0, 1.0))).png
    polar, panel = figures[0].axes
    assert [len(line.get_xdata()) for line in panel.lines] == [301, 150]
    drawn = next(line for line in polar.lines if len(line.get_xdata()) == 301)
    r = np.hypot(drawn.get_xdata(), drawn.get_ydata())
    assert r[:-1] == pytest.approx(1 + 0.36 * 3 * np.cos(angle) / 10)
    assert {"X+", "X−", "Y+", "Y−", "+10 µm", "−10 µm", "0", "a note"} <= {text.get_text() for text in polar.texts}


def test_cells_hold_their_numbers(figures: list[Any]) -> None:
    values = np.array([[0.5, -1.0], [np.nan, 0.25]])
    grid = Grid("", ["F_C", "sigma_0"], ["one", "two"], values, (-1.0, 1.0), 2, np.abs(values) > 0.9)
    assert Picture("s", "t", "", Chart([grid])).png
    (axes,) = figures[0].axes
    assert [(text.get_text(), text.get_fontweight()) for text in axes.texts] == [
        ("0.50", "normal"), ("−1.00", "bold"), ("0.25", "normal"),
    ]  # fmt: skip
    assert [label.get_text() for label in axes.get_xticklabels()] == ["$F_{C}$", r"$\sigma_{0}$"]
    many = Grid("", [f"{k}" for k in range(40)], ["one"], np.arange(40.0)[None], (0.0, 39.0))
    assert Picture("s", "t", "", Chart([many])).png
    cells, scale = figures[1].axes
    assert not cells.texts
    assert scale.get_ylim() == (0.0, 39.0)


def test_names_of_people_are_no_formulas(figures: list[Any]) -> None:
    curve = sine("a$b$_c")
    assert Picture("s", "$x", "", Chart([Panel("cost $5 and $6", TIME, HEIGHT, [curve, sine("other")])])).png
    assert figures[0].axes[0].get_title(loc="left") == r"cost \$5 and \$6"
    assert figures[0].legends[0].get_texts()[0].get_text() == r"a\$b\$_c"


@pytest.mark.parametrize("settled", [math.nan, 20.0, 390.0, 700.0])
def test_positioning_labels_stay_inside(settled: float, figures: list[Any]) -> None:
    run = positioning_run()
    (task,) = tasks(run.scenario, run.program)
    assert isinstance(task, PositioningTask)
    of_run = task.figures(run.trace) | {"settling_time": Figure(settled, "ms", "")}
    picture = positioning_picture(run.trace, task.approach, of_run, "s")
    assert picture.png
    words = []
    for axes in figures[0].axes:
        room = axes.get_window_extent()
        for text in axes.texts:
            words.append(text.get_text())
            box = text.get_window_extent()
            assert room.x0 <= box.x0 < box.x1 <= room.x1, text.get_text()
            assert room.y0 <= box.y0 < box.y1 <= room.y1, text.get_text()
    wanted = "not determined" if math.isnan(settled) else "still outside" if settled > 400 else "last outside"
    assert wanted in " ".join(words)


def test_contour_says_what_its_labels_are() -> None:
    run = circle_run()
    picture = next(picture for picture in draw(run, evaluate(run)) if picture.stem == "contour-XZ")
    assert "(less the median)" in picture.svg
    assert "median (scales)" in picture.svg


def test_a_circle_driven_both_ways_is_drawn_both_ways() -> None:
    circle = Circle(plane=("X", "Z"), radius=0.015, feed=0.1, turns=3, direction="both")
    run = run_of(scenario(circle, Dwell(duration=0.25), evaluate=(CircleTest(),)))
    picture = next(picture for picture in draw(run, evaluate(run)) if picture.stem == "contour-XZ")
    assert "Dashed: clockwise, from" in picture.caption
    polar = picture.chart.panels[0] if picture.chart else None
    assert isinstance(polar, Polar)
    there, back = sorted((c for c in polar.curves if c.name.startswith("linear")), key=lambda each: len(each.name))
    assert [(each.colour, each.dash) for each in (there, back)] == [(SIMULATED, ""), (SIMULATED, "dashed")]
    turned = {curve.name: np.diff(np.unwrap(curve.x)) for curve in polar.curves}
    assert np.all(turned["linear scales"] > 0)
    assert np.all(turned["linear scales, clockwise"] < 0)
    for steps in turned.values():
        assert abs(steps.sum()) == pytest.approx(2 * math.pi, abs=3 * np.abs(steps).max())


def test_all_axes_are_shown_over_the_whole_run() -> None:
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
    assert [picture.stem for picture in draw(few, evaluate(few))] == ["positioning-Z", "overview"]
    run = circle_run()
    few = FakeRun(run.scenario, run.program, run.trace.select(["*.x_a"]))
    assert [picture.stem for picture in draw(few, evaluate(few))] == ["contour-XZ", "overview"]


def test_rings_are_10_um_where_that_is_readable() -> None:
    assert [ring_step(e) for e in (2.0, 8.2, 19.9)] == [10, 10, 10]
    assert ring_step(1.5) == 1
    assert ring_step(0.3) == 0.2
    assert ring_step(66.0) == 50
    assert ring_step(3e4) == 20_000
    assert ring_step(0.0) == 0.1


def test_long_recordings_stay_small_enough_for_a_page() -> None:
    machine = default_machine()
    run = run_of(scenario(*[Move(by={"Z": 0.02 * (-1) ** k}, feed=0.05) for k in range(120)], machine=machine))
    assert len(run.trace) > 40_000
    (picture,) = draw(run, {})
    assert len(picture.svg) < 3 * LARGEST_SVG
    assert len(picture.png) < 1_000_000


def test_the_cell_that_is_looked_for_has_a_frame_and_a_map_its_room() -> None:
    grid = Grid("a map", ["1", "2"], ["b", "a"], np.array([[1.0, 2.0], [0.5, 3.0]]), (0.5, 3.0), best=(1, 0))
    plain = replace(grid, best=None)
    for each, frames in ((grid, 1), (plain, 0)):
        svg = still(Chart([each]), "m", "t")
        assert svg.count('stroke="var(--ink)" stroke-width="2.2"') == frames
        (panel,) = json.loads(embedded({"m": Chart([each])}))["charts"]["m"]["panels"]
        assert panel.get("best") == (None if each.best is None else [1, 0])
    svg = still(Chart([grid]), "m", "t")
    whole = float(re.search(r'viewBox="0 0 ([\d.]+)', svg)[1])
    cells = [float(width) for width in re.findall(r'<rect x="[^"]+" y="[^"]+" width="([\d.]+)"', svg)]
    assert 2 * cells[0] > 0.9 * whole
    assert Picture("m", "t", "", Chart([grid])).png != Picture("m", "t", "", Chart([plain])).png
