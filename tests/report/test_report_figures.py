"""Figures of a report: what they show, and that labels and legends keep clear of the curves."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from feedsim.analysis import Figure, PositioningTask, evaluate, tasks
from feedsim.motions import Circle, Dwell, Move
from feedsim.report import chart
from feedsim.report.chart import Panel, Polar
from feedsim.report.content import LARGEST_SVG
from feedsim.report.formatting import CLOCKWISE, SIMULATED_COLOUR
from feedsim.report.run.axis_plots import overview_picture, positioning_picture, ring_step
from feedsim.report.run.report import draw
from feedsim.scenario import Axis, CircleTest, Positioning
from report_helpers import FakeRun, circle_run, positioning_run, run_of, small_run
from scenario_helpers import default_machine, scenario
from svg_helpers import assert_legible, drawn_panels

TIME, HEIGHT = chart.Axis("time", "s"), chart.Axis("height", "m")
X = np.linspace(0.0, 1.0, 400)


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
    assert plain.svg != reversed_.svg


@pytest.mark.parametrize("run", [positioning_run, circle_run])
def test_files_of_pictures_say_that_the_machine_is_synthetic(run: Callable[[], FakeRun]) -> None:
    """A picture travels without its page (test_charts.py draws a remark)."""
    pictures = draw(run(), evaluate(run()))
    assert len(pictures) > 1
    for picture in pictures:
        assert "Synthetic machine" in picture.remark, picture.stem


def test_torques_are_drawn_as_they_are_by_default() -> None:
    assert Axis.model_fields["display_sign"].default == 1
    run = positioning_run()
    (task,) = tasks(run.scenario, run.program)
    assert isinstance(task, PositioningTask)
    figures = task.figures(run.trace)
    plain = positioning_picture(run.trace, task.approach, figures, "s")
    assert plain.svg == positioning_picture(run.trace, task.approach, figures, "s", torque_sign=1).svg
    assert plain.svg != positioning_picture(run.trace, task.approach, figures, "s", torque_sign=-1).svg
    one, other = (overview_picture(run.trace, ["Z"], signs, "s") for signs in ({}, {"Z": 1}))
    assert one is not None
    assert other is not None
    assert one.svg == other.svg


@pytest.mark.parametrize("settled", [math.nan, 20.0, 390.0, 700.0])
def test_positioning_labels_stay_inside(settled: float) -> None:
    run = positioning_run()
    (task,) = tasks(run.scenario, run.program)
    assert isinstance(task, PositioningTask)
    of_run = task.figures(run.trace) | {"settling_time": Figure(settled, "ms", "")}
    drawn = positioning_picture(run.trace, task.approach, of_run, "s").svg
    assert_legible(drawn)
    words = [word.text for panel in drawn_panels(drawn)[0] for word in panel.over]
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
    for panel in picture.chart.panels if picture.chart else ():
        assert isinstance(panel, (Panel, Polar))
        looks = {each.name: (each.colour, each.dash) for each in panel.curves if each.name.startswith("linear")}
        assert looks == {
            "linear scales, counterclockwise": (SIMULATED_COLOUR, ""),
            "linear scales, clockwise": (CLOCKWISE, "dashed"),
        }
    turned = {curve.name: np.diff(np.unwrap(curve.x)) for curve in polar.curves}
    assert np.all(turned["linear scales, counterclockwise"] > 0)
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
