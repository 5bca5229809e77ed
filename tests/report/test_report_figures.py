"""Figures of a report: what they show, and that labels and legends keep clear of the curves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from feedsim.analysis import Figure, PositioningTask, evaluate, tasks
from feedsim.motions import Dwell, Move
from feedsim.report.labels import clearest, mark_instant, place_beside_level
from feedsim.report.run import axis_plots, circle_plots
from feedsim.report.run.axis_plots import overview_picture, positioning_picture
from feedsim.report.run.circle_plots import ring_step
from feedsim.report.run.report import draw
from feedsim.report.style import LARGEST_SVG, MOST_POINTS, drawing, finish, thinned
from feedsim.scenario import Axis, Positioning
from report_helpers import FakeRun, circle_run, positioning_run, run_of, small_run
from scenario_helpers import default_machine, scenario


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


@pytest.mark.parametrize(("instant", "side"), [(0.2, "left"), (0.97, "right")])
def test_label_of_an_instant_stays_inside_and_off_the_curve(instant: float, side: str) -> None:
    with drawing(5.0, 3.0) as figure:
        axes = figure.add_subplot()
        axes.plot([0.0, 1.0], [0.02, 0.08])
        axes.set(xlim=(0, 1), ylim=(0, 1))
        mark_instant(axes, instant, "end of NC motion")
        (label,) = axes.texts
        assert label.get_horizontalalignment() == side
        assert label.get_clip_on()
        assert not label.get_in_layout()
        figure.draw_without_rendering()
        room, text = axes.get_window_extent(), label.get_window_extent()
        assert room.x0 < text.x0
        assert text.x1 < room.x1
        assert text.y0 > room.y0 + 0.08 * room.height
        assert axes.get_position().x1 > 0.95, "the label takes room from the axes"


def test_labels_go_where_no_curve_is() -> None:
    with drawing(5.0, 3.0) as figure:
        axes = figure.add_subplot()
        axes.plot([0.0, 0.5, 1.0], [0.9, 0.9, 0.1])
        axes.set(xlim=(0, 1), ylim=(0, 1))
        axes.axhline(0.3)  # a line for reference is no curve
        assert clearest(axes, 0.0, 0.4, (0.9, 0.5, 0.3)) == 0.5
        assert clearest(axes, 0.0, 0.4, (0.3, 0.5)) == 0.3
        assert clearest(axes, 0.9, 1.0, (0.12, 0.9)) == 0.9
        assert clearest(axes, 0.0, 0.4, (0.9, 0.91)) == 0.91  # the farthest where none is clear


def test_label_of_a_level_moves_sideways_where_curves_are_in_the_way() -> None:
    x = np.linspace(0, 1, 400)
    with drawing(9.0, 3.0) as figure:
        axes = figure.add_subplot()
        axes.plot(x, np.where(x > 0.5, np.sin(60 * x), 0.0))
        axes.set(xlim=(0, 1), ylim=(-1, 1))
        free, crossed = (axes.text(0, 0, "0.00 N·m", ha="center", va="center") for _ in range(2))
        place_beside_level(axes, free, 0.3, 0.0)
        place_beside_level(axes, crossed, 0.6, 0.0)
        assert free.get_position() == pytest.approx((0.3, 0.59))
        assert crossed.get_position() == pytest.approx((0.4, 0.59))


@pytest.mark.parametrize("make", [positioning_run, circle_run, small_run])
def test_legends_stand_above_the_axes(make: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """No legend of a panel over time or angle can cross a curve."""
    seen = 0

    def looked_at(figure: Any, *rest: str) -> Any:
        nonlocal seen
        figure.draw_without_rendering()
        for axes in figure.axes:
            if axes.axison and axes.get_legend() is not None:
                seen += 1
                assert axes.get_legend().get_window_extent().y0 >= axes.get_window_extent().y1 - 1
                assert axes.get_legend().get_window_extent().x1 <= figure.bbox.x1
        return finish(figure, *rest)

    for module in (axis_plots, circle_plots):
        monkeypatch.setattr(module, "finish", looked_at)
    run = make()
    for picture in draw(run, evaluate(run)):
        assert picture.png
    assert seen >= 2


@pytest.mark.parametrize("settled", [math.nan, 20.0, 390.0, 700.0])
def test_positioning_labels_stay_inside(settled: float, monkeypatch: pytest.MonkeyPatch) -> None:
    def looked_at(figure: Any, *rest: str) -> Any:
        figure.draw_without_rendering()
        for axes in figure.axes:
            for text in axes.texts:
                assert not text.get_in_layout()
                extent, room = text.get_window_extent(), axes.get_window_extent()
                assert extent.x0 >= room.x0 - 1, text.get_text()
                if "last outside" not in text.get_text():  # its extent includes the arrow
                    assert extent.x1 <= room.x1 + 1, text.get_text()
        return finish(figure, *rest)

    monkeypatch.setattr(axis_plots, "finish", looked_at)
    run = positioning_run()
    (task,) = tasks(run.scenario, run.program)
    assert isinstance(task, PositioningTask)
    figures = task.figures(run.trace) | {"settling_time": Figure(settled, "ms", "")}
    picture = positioning_picture(run.trace, task.approach, figures, "s")
    wanted = "not determined" if math.isnan(settled) else "still outside" if settled > 400 else "last outside"
    assert wanted in picture.svg


def test_contour_says_what_its_labels_are() -> None:
    run = circle_run()
    svg = next(picture.svg for picture in draw(run, evaluate(run)) if picture.stem == "contour-XZ")
    assert "(less the median)" in svg
    assert "median (scales)" in svg


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


def test_long_curves_are_thinned_but_keep_their_extremes() -> None:
    x = np.arange(1_000_000.0)
    y = np.sin(x / 1000)
    y[[123_456, 654_321]] = 5.0, -7.0
    t, thin = thinned(x, y)
    assert len(t) <= MOST_POINTS + 2
    assert np.all(np.diff(t) > 0)
    assert (thin.max(), thin.min()) == (5.0, -7.0)
    assert thinned(x[:100], y[:100])[0] is not None


def test_long_recordings_stay_small_enough_for_a_page() -> None:
    machine = default_machine()
    run = run_of(scenario(*[Move(by={"Z": 0.02 * (-1) ** k}, feed=0.05) for k in range(120)], machine=machine))
    assert len(run.trace) > 40_000
    (picture,) = draw(run, {})
    assert len(picture.svg) < 3 * LARGEST_SVG
    assert len(picture.png) < 1_000_000
