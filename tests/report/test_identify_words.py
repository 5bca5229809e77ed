"""What report and terminal claim of an identification: of which stage, from how many speeds, in which digits."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from feedsim.estimation.identify import Options, stages
from feedsim.estimation.identify.result import Estimate, Identification, Stationary
from feedsim.report.chart import Curve, Panel
from feedsim.report.content import Picture, Report, Tile
from feedsim.report.formatting import count_things
from feedsim.report.identify import headline
from feedsim.report.identify.report import report_of
from feedsim.report.identify.stribeck_plots import speeds_of, stribeck_picture, stribeck_title
from feedsim.report.identify.summary import details
from feedsim.report.page import html
from identification_helpers import I_P, TRUE, J, curve, identification, identified, records
from report_helpers import Page


def few(count: int) -> Identification:
    """Plateaus of the `count` slowest speeds, both directions."""
    stage = identification().stationary
    assert stage is not None
    return identification(stationary=replace(stage, plateaus=stage.plateaus[: 2 * count]))


def stage_of(found: Identification) -> Stationary:
    assert found.stationary is not None
    return found.stationary


def tiles(found: Identification) -> str:
    text = html(report_of(identified(found=found), []))
    return " ".join(Page(text[text.index('<div class="screen') : text.index("</header>")]).words)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_speeds_make_no_curve(count: int) -> None:
    found = few(count)
    stage = stage_of(found)
    assert speeds_of(stage) == count
    texts = {
        "title": stribeck_title(found, stage),
        "headline": headline(identified(found=found)),
        "tiles": tiles(found),
        "caption": stribeck_picture(found, stage).caption,
    }
    known = ("known to ±", "curve within", "error of the curve", "95 % band of the curve")
    for (where, text), words in zip(texts.items(), known, strict=True):
        assert (words in text) == (count == 3), where
    said = details(identified(found=found))["curve"]
    assert (said["error"]["value"] is None, said["distinct_speeds"]) == (count < 3, count)
    if count < 3:
        speeds = "1 speed" if count == 1 else "2 speeds"
        assert texts["title"].endswith(f"no curve: {speeds}")
        assert texts["headline"].startswith(f"no curve: {speeds}, {2 * count} plateaus; ")
        assert f"{speeds}, three make a curve" in texts["tiles"]


def test_one_is_not_many() -> None:
    found = identification()
    stage, dynamic = found.stationary, found.dynamic
    assert stage is not None
    assert dynamic is not None
    one = replace(
        found,
        stationary=replace(stage, plateaus=stage.plateaus[:1]),
        dynamic=replace(dynamic, stretches=dynamic.stretches[:1]),
    )
    line = headline(identified(found=one))
    assert "no curve: 1 speed, 1 plateau; pre-sliding from 1 stretch, " in line
    assert [count_things(n, "speed") for n in (0, 1, 2)] == ["0 speeds", "1 speed", "2 speeds"]


def test_whose_curve_it_is() -> None:
    """Where stage 1 did not enter the set, the figure has both: its curve, and that of the set in both directions."""
    found = identification()
    other = {**found.estimates, "F_C": replace(found.estimates["F_C"], value=1.5)}
    stage = stage_of(found)
    assert not delivered(stribeck_picture(found, stage))
    assert "stage 1 alone" not in stribeck_title(found, stage) + tiles(found)
    apart = replace(found, prior=False, estimates=other)
    picture = stribeck_picture(apart, stage)
    assert "Identified set" in picture.caption
    assert "of stage 1 alone" in picture.caption
    assert "stage 1 alone, known to" in stribeck_title(apart, stage)
    assert "error of the curve (95\u00a0%), stage 1 alone" in tiles(apart)
    drawn = delivered(picture)
    assert [each.name for each in drawn] == ["identified set, +", "identified set, −"]
    lean, viscous = TRUE["asymmetry"][0], TRUE["sigma_2"][0]
    for each, sign in zip(drawn, (1, -1), strict=True):
        # a smaller F_C counts in full where F_S - F_C has decayed, and not at rest
        static = curve(each.x) - viscous * each.x - 0.1 * (1 - np.exp(-each.x / TRUE["v_s"][0]))
        np.testing.assert_allclose(each.y, (1 + sign * lean) * static + viscous * each.x, rtol=1e-12)


def delivered(picture: Picture) -> list[Curve]:
    """The curves of the set that is delivered."""
    assert picture.chart is not None
    above = picture.chart.panels[0]
    assert isinstance(above, Panel)
    return [each for each in above.curves if each.name.startswith("identified set")]


def test_small_values_in_tiles_and_table() -> None:
    found = identification()
    small = replace(found.estimates["sigma_2"], value=1.47e-5, sigma=2e-7)
    light = replace(found.estimates["J"], value=1.5057e-5)
    text = html(
        report_of(identified(found=replace(found, estimates={**found.estimates, "sigma_2": small, "J": light})), [])
    )
    assert "<b>1.470×10⁻⁵ <small>N·m·s/rad</small></b>" in text
    assert "<b>1.5057×10⁻⁵ <small>kg·m²</small></b>" in text
    assert '<td class="number">1.431×10⁻⁵ to 1.509×10⁻⁵</td>' in text
    assert not re.search(r"\b0\.0000\d*[1-9]|\de[-−]\d", re.sub(r"<style.*?</style>", "", text, flags=re.S))


def test_tiles_hold_what_is_in_them() -> None:
    """Nothing that may not be broken, and units in small print."""
    shown = [
        Tile(text, "", "") for text in ("8.19 → 0.80 µm", "±0.5 %", "0.35", "no curve", "not determined", "5 m < 6")
    ]
    text = html(Report("", "", [], "", tiles=shown))
    (rule,) = re.findall(r"\n\.key \{[^}]*\}", text)
    assert "overflow-wrap: anywhere" in rule
    (number,) = re.findall(r"\n\.key b \{[^}]*\}", text)
    assert "nowrap" not in number
    assert re.findall(r"<b[^>]*>(.*?)</b>", text) == [
        "8.19 → 0.80 <small>µm</small>", "±0.5 <small>%</small>", "0.35", "no curve", "not determined", "5 m &lt; 6",
    ]  # fmt: skip


@pytest.mark.parametrize(("chosen", "warned"), [(slice(1, 2), False), (slice(0, 1), True), (slice(0, 2), True)])
def test_sines_alone_say_nothing_of_the_given_inertia(chosen: slice, warned: bool) -> None:
    given = Estimate("J", J, "kg.m2", "inertia", status="given")
    law: Any = None
    run = stages._Run(records()[chosen], law, Options("Z", I_P, J=given), lambda *_: None)
    run._compare(SimpleNamespace(J=replace(given, value=0.0132, sigma=1e-5, status="estimated")))
    assert [finding.code for finding in run.warnings] == ["inertia-contradicted"] * warned
    assert not warned or "the inertia is given as 0.0164 kg.m2" in run.warnings[0].text
