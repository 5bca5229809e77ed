"""friction.yaml of an identification: a friction that is read again, with intervals and where it comes from."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from feedsim.estimation.identify.friction_file import (
    constant_load_hint,
    friction_yaml,
    interval_text,
    relative_text,
    value_text,
)
from feedsim.estimation.identify.result import Estimate
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.scenario.load import read_friction
from identification_helpers import estimates, identified

VERSIONS = {"feedsim": "1.2", "python": "3.4", "numpy": "5.6", "scipy": "7.8"}


def test_friction_file_is_a_friction(tmp_path: Path) -> None:
    text = friction_yaml(identified(), VERSIONS)
    (tmp_path / "friction.yaml").write_text(text, encoding="utf-8")
    friction = read_friction(tmp_path / "friction.yaml")
    for name, value in friction.parameters().items():
        assert value == pytest.approx(estimates()[name].value, rel=1e-7)
    group = friction.identified
    assert group["axis"] == "Z"
    assert group["constant_load"]["value"] == "0.25 N.m"
    assert group["inertia"] == {"value": "0.0164 kg.m^2", "status": "given", "reason": "of the machine's modes"}
    assert group["parameters"]["beta"] == {"status": "held", "reason": "usual value"}
    low, high = (float(text.split()[0]) for text in group["parameters"]["F_C"]["interval"])
    assert (low + high) / 2 == pytest.approx(1.6, rel=1e-7)
    assert high - low == pytest.approx(2 * NORMAL_95 * 0.0014 * 1.6, rel=1e-4)
    assert [trace["file"] for trace in group["traces"]] == ["constant.csv", "sine.csv"]
    assert len(group["correlation"]["names"]) == len(group["correlation"]["matrix"])
    assert "Synthetic" in group["machine"]["note"]
    head = [line for line in text.splitlines() if line.startswith("#")]
    assert "identified by feedsim 1.2 on 2026-01-31" in head[0]
    assert group["software"] == VERSIONS
    assert any("Synthetic machine" in line for line in head)
    assert any('machine.axes.Z.constant_load="0.25 N.m"' in line for line in head)


@pytest.mark.parametrize(
    ("value", "sigma", "texts"),
    [
        (1.6, 0.0022, ("1.6000", "1.5957 to 1.6043", "0.27 %")),
        (-0.25, 0.04, ("-0.250", "-0.328 to -0.172", "31 %")),
        (300.0, 100.0, ("300", "104 to 496", "65 %")),
        (0.04, math.nan, ("0.04", "", "")),
        (1e-9, 1.0, ("0.0", "-2.0 to 2.0", "over 100 %")),
        (3.0, 0.0, ("3", "", "")),
    ],
)
def test_numbers_in_words(value: float, sigma: float, texts: tuple[str, str, str]) -> None:
    estimate = Estimate("F_C", value, "N.m", "", sigma)
    assert (value_text(estimate), interval_text(estimate), relative_text(estimate)) == texts


def test_constant_load_is_told_where_there_is_one() -> None:
    whole = identified()
    assert 'machine.axes.Z.constant_load="0.25 N.m"' in constant_load_hint(whole.found)
    none = {name: each for name, each in whole.found.estimates.items() if name != "M_0"}
    assert constant_load_hint(replace(whole.found, estimates=none)) == ""
    assert "0.245" in constant_load_hint(whole.found)
