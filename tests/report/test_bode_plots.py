"""Bode plots: scales, phases, what is marked, and that every label can be read."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim.analysis.linear import Bandwidth, Extreme, GainCrossing, Margins, Pair, PhaseCrossing, grid
from feedsim.analysis.responses import Overlay
from feedsim.analysis.truncation import deviations, structure_responses
from feedsim.files.trace.response import FrequencyResponse
from feedsim.report import chart
from feedsim.report.chart import Panel
from feedsim.report.chart.model import ranges, ticks
from feedsim.report.frf.bode import Column, Curve, Ordinate, bode_chart, curve_value, phases
from feedsim.report.frf.bode_plots import (
    curves_of,
    loop_pictures,
    most_marked,
    pictures_of,
    scale_pictures,
    speed_reference_pictures,
)
from feedsim.report.frf.report import truncation_pictures
from feedsim.structure import Modes, checked_modes
from frf_helpers import responses
from scenario_helpers import default_machine
from svg_helpers import assert_legible, drawn_panels

F = np.geomspace(1.0, 1000.0, 400)
DELAYED = np.exp(-2j * np.pi * F * 4e-3)  # phase to -1440 deg


def closed(values: Any, frequency: Any = F) -> Curve:
    return Curve("closed form", "closed form", frequency, np.asarray(values, dtype=complex))


def panels(curves: list[Curve], ordinate: Ordinate | None = None, **options: Any) -> list[Panel]:
    return panels_of(bode_chart([Column("Axis Z", curves)], ordinate or Ordinate("gain"), {}, **options))


def panels_of(shown: chart.Chart | None) -> list[Panel]:
    assert shown is not None
    return [panel for panel in shown.panels if isinstance(panel, Panel)]


# -- curves ------------------------------------------------------------------------------------------------------------


def test_magnitude_is_in_decibel_or_in_a_unit_of_its_own() -> None:
    assert Ordinate("x").of(np.array([1.0, 10.0, 1j])) == pytest.approx([0, 20, 0])
    assert Ordinate("x", decibel=False, scale=1e6).of(np.array([2e-6j])) == pytest.approx([2.0])
    assert Ordinate("x").of(np.array([0.0])) == pytest.approx([-400.0])


def test_phase_of_points_follows_the_branch_of_the_line() -> None:
    line = closed(DELAYED)
    rows = slice(3, None, 40)
    points = Curve("measured", "measured", F[rows], DELAYED[rows])
    assert phases(line, None)[-1] == pytest.approx(-1440, abs=1e-6)
    assert phases(points, line) == pytest.approx(-360 * F[rows] * 4e-3, abs=1e-6)


@pytest.mark.parametrize(("start", "shown"), [(-180.0, 180.0), (-170.0, -170.0), (190.0, -170.0), (180.0, 180.0)])
def test_phase_begins_between_plus_and_minus_180(start: float, shown: float) -> None:
    values = np.exp(1j * np.radians([start, start - 1.0]))
    assert phases(closed(values, np.array([1.0, 2.0])), None)[0] == pytest.approx(shown, abs=1e-9)


def test_values_between_samples() -> None:
    curve = closed((2j * np.pi * F) ** -1.0)
    assert curve_value(curve, 33.3) == pytest.approx(1 / (2j * np.pi * 33.3), rel=1e-9)


def test_points_of_low_coherence_are_faded_and_do_not_set_the_scale() -> None:
    coherence = np.where(F < 10, 0.5, 0.999)
    values = np.where(F < 10, 1e6, 1.0)
    magnitude, _, below = panels([Curve("measured", "measured", F, values + 0j, coherence)])
    sure, faded = magnitude.curves
    assert (sure.faint, len(sure.x)) == (False, int((F >= 10).sum()))
    assert (faded.faint, len(faded.x)) == (True, int((F < 10).sum()))
    assert ranges(magnitude)[1][1] < 20
    assert ranges(below)[1][1] > 1


def test_each_kind_has_its_own_look() -> None:
    kinds = [closed(DELAYED), Curve("measured", "m", F, DELAYED), *(Curve("overlaid", n, F, DELAYED) for n in "ab")]
    curves = panels(kinds)[0].curves
    assert len({(curve.colour, curve.dash, curve.dots) for curve in curves}) == 4
    assert [curve.dots for curve in curves] == [False, True, False, False]


def test_phase_ends_where_the_magnitude_falls_below_the_floor_for_good() -> None:
    values = 1 / (1 + (F / 10) ** 4) + 0j
    magnitude, phase = panels([closed(values)], floor=-40.0)
    assert np.array_equal(np.isfinite(phase.curves[0].y), 20 * np.log10(np.abs(values)) >= -40)
    assert ranges(magnitude)[1][0] > -50


def test_only_what_is_asked_for_is_shown() -> None:
    magnitude, phase = panels([closed(DELAYED), Curve("overlaid", "far", F + 5000, DELAYED)], span=(2.0, 50.0))
    (curve,) = magnitude.curves
    assert curve.x.min() >= 2.0
    assert curve.x.max() <= 50.0
    assert ranges(magnitude)[0] == (2.0, 50.0)
    # ticks of the phase that is seen, not of the 1440 degrees that are not
    low, high = ranges(phase)[1]
    assert -80 < low < high < 10


@pytest.mark.parametrize("delay", [0.0, 1e-4, 1e-3, 1e-2, 5e-2])
def test_phase_ticks_are_round_angles_and_few(delay: float) -> None:
    _, phase = panels([closed(np.exp(-2j * np.pi * F * delay) * np.exp(1j * F / 1000))])
    low, high = ranges(phase)[1]
    marked = [at for at, _ in ticks(phase.y, (low, high), 6).marks]
    assert 1 <= len(marked) <= 10
    assert high - low <= 60 or all(at % 15 == 0 for at in marked)


# -- marks -------------------------------------------------------------------------------------------------------------


def test_first_and_last_crossing_are_marked_and_told() -> None:
    curve = closed(1 / (1 + 1j * F / 20))
    told = []
    for found in (Bandwidth(21.0, 427.0), Bandwidth(21.0, 21.0), Bandwidth(math.nan, math.nan)):
        (picture,) = speed_reference_pictures({"Z": [curve]}, {"Z": found}, None)
        told.append(panels_of(picture.chart)[0])
    assert [(mark.x, mark.y, mark.hollow) for mark in told[0].marks] == [(21.0, -3.0, False), (427.0, -3.0, True)]
    assert [panel.note for panel in told] == [
        "−3 dB, first 21 Hz\n−3 dB, last 427 Hz", "−3 dB at 21 Hz", "stays above −3 dB",
    ]  # fmt: skip


def test_margins_are_drawn_from_the_curve_to_the_limit() -> None:
    """An integrator with a delay T: crosses 1 at 10 Hz, -180 deg at 1/(4 T)."""
    T = 2e-3
    gain = (10 / (1j * F)) * np.exp(-2j * np.pi * F * T)
    margin = 90 - 360 * 10 * T
    margins = Margins((GainCrossing(125.0, 12.5),), (PhaseCrossing(10.0, margin),))
    (picture,) = loop_pictures({"Z": [closed(gain)]}, {"Z": margins}, "speed", None)
    magnitude, phase = panels_of(picture.chart)
    assert magnitude.note == f"phase margin {margin:.0f}° at 10 Hz\ngain margin 21.9 dB at 125 Hz"
    (stretch,) = [level for level in magnitude.levels if level.upright]
    assert (stretch.at, stretch.ends) == (125.0, pytest.approx((-21.94, 0.0), abs=0.01))
    (stretch,) = [level for level in phase.levels if level.upright]
    # interpolated between samples
    assert (stretch.at, stretch.ends) == (10.0, pytest.approx((-180.0, -180 + margin), abs=0.05))


def test_pairs_annotated_are_the_first_and_the_most_marked_within_the_band() -> None:
    def pair(low: float, high: float, rise: float) -> Pair:
        return Pair(Extreme(low, 0.0), Extreme(high, rise))

    pairs = [
        pair(5, 6, 50),
        pair(20, 22, 1),
        pair(40, 41, 2),
        pair(119, 132, 25),
        pair(135, 140, 20),
        pair(175, 188, 18),
    ]
    chosen = most_marked([*pairs, pair(400, 500, 30), pair(800, 1100, 40)], (10.0, 1000.0))
    assert [p.resonance.frequency for p in chosen] == [22, 500, 132, 188]


# -- pictures ----------------------------------------------------------------------------------------------------------


def test_all_pictures_of_a_report() -> None:
    pictures = pictures_of(responses(("X", "Z"), tool=True))
    assert [p.stem for p in pictures] == [
        "speed-controlled-system", "inertia-view", "speed-reference", "speed-loop", "position-reference",
        "position-loop", "scale-response", "tool-compliance",
    ]  # fmt: skip
    for picture in pictures:
        assert picture.caption
        assert_legible(picture.svg)
    panels, _, _ = drawn_panels(pictures[-1].svg)
    assert "|x_tool/F| [µm/N]" in panels[0].texts


def test_a_machine_of_five_axes_gets_two_pictures_per_quantity() -> None:
    columns = {axis: [closed(1e-6 / F)] for axis in "XYZBC"}
    assert [p.stem for p in scale_pictures(columns, None)] == ["scale-response-X-Y-Z", "scale-response-B-C"]


def test_closed_form_alone_has_no_panel_of_coherence() -> None:
    both, alone = (pictures_of(responses(measured=m))[0] for m in (True, False))
    assert "Points: measured" in both.caption
    assert "Points" not in alone.caption
    assert len(curves_of(responses(), "Z.n_a/Z.M_a")) == 2
    assert len(curves_of(responses(measured=False), "Z.n_a/Z.M_a")) == 1


def test_a_curve_laid_over_belongs_to_its_response() -> None:
    own = FrequencyResponse(F, {"Z.n_a/Z.n_s": DELAYED}, {"Z.n_a/Z.n_s": "1"})
    with_overlay = responses(overlays=(Overlay("Z.n_a/Z.n_s", Path("folder") / "bench.csv", own),))
    kinds = [(curve.kind, curve.label) for curve in curves_of(with_overlay, "Z.n_a/Z.n_s")]
    assert kinds == [("closed form", "closed form"), ("measured", "measured"), ("overlaid", "bench.csv")]
    assert all(curve.kind != "overlaid" for curve in curves_of(with_overlay, "Z.n_a/Z.M_a"))


# -- full and reduced models -------------------------------------------------------------------------------------------


def reduced(modes: Modes, cutoff: float) -> Modes:
    kept = modes.frequency < cutoff
    ports = {name: values[kept] for name, values in modes.ports.items()}
    return Modes(modes.file, modes.frequency[kept], modes.damping[kept], ports)


def test_structure_responses_are_the_modal_sum() -> None:
    modes = checked_modes(default_machine())
    f = np.array([3.0, 120.0, 700.0])
    found = structure_responses(modes, ("X", "Y", "Z"), f)
    s = 2j * np.pi * f[:, None]
    omega, zeta = 2 * np.pi * modes.frequency, modes.damping
    modal = 1 / (s**2 + 2 * zeta * omega * s + omega**2)
    n, x, tcp = (modes.ports[port] for port in ("n_Z", "x_Z", "tcp_X"))
    assert found["Z.n_a/Z.M_a"] == pytest.approx((s * modal) @ (n * n), rel=1e-9)
    # at 700 Hz large terms cancel to a small sum
    assert found["Z.x_a/Z.M_a"] == pytest.approx(modal @ (n * x), rel=1e-9)
    assert found["tool.x_X/tool.F_X"] == pytest.approx(modal @ (tcp * tcp), rel=1e-9)


def test_deviations_tell_what_was_dropped() -> None:
    modes = checked_modes(default_machine())
    f = grid(modes, 1.0, 600.0)
    full, part = (structure_responses(m, ("X", "Y", "Z"), f) for m in (modes, reduced(modes, 600.0)))
    figures = deviations({"reduced": part, "the same": full}, full, 600.0)
    assert figures["Z.n_M.truncation_the_same"].value == 0
    below, whole = (figures[f"X.x_M.{key}"].value for key in ("truncation_below", "truncation"))
    assert 0 < below < whole
    ratio = np.abs(20 * np.log10(np.abs(part["X.x_a/X.M_a"] / full["X.x_a/X.M_a"])))
    assert whole == pytest.approx(ratio.max(), rel=1e-12)
    assert below == pytest.approx(ratio[f <= 540].max(), rel=1e-12)


def test_pictures_of_full_and_reduced_models() -> None:
    modes = checked_modes(default_machine())
    tables = {"full": modes, "reduced": reduced(modes, 600.0), "with static correction": modes}
    pictures = truncation_pictures(tables, ("X", "Y", "Z"), np.geomspace(1, 900, 300), 600.0)
    assert [p.stem for p in pictures] == ["truncation-n_M", "truncation-x_M", "truncation-tool"]
    for picture in pictures:
        assert_legible(picture.svg)
        panels, legend, _ = drawn_panels(picture.svg)
        assert legend == ["full", "reduced", "with static correction"]
        assert {"1", "10", "100"} <= set(panels[3].texts)
