"""Identified values beside those of a machine file: which differ, and how the control calls them."""

from __future__ import annotations

from pathlib import Path

import pytest

from feedsim.estimation.identify.result import Estimate
from feedsim.report.changes import control_names
from feedsim.report.identified_drive import compare_parameters, comparison_lines, comparison_part, comparison_section
from feedsim.scenario import load_machine

MACHINE = Path(__file__).resolve().parents[2] / "scenarios" / "machines" / "test_centre"  # K_v 66.7 1/s, T_n 12 ms


def found(name: str, value: float, sigma: float, status: str = "estimated", unit: str = "1/s") -> Estimate:
    return Estimate(name, value, unit, "", sigma, status)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("value", "sigma", "status", "differs"),
    [
        (58.3, 1.0, "estimated", True),  # 4.2 times its half-width away
        (58.3, 5.0, "estimated", False),  # within the interval
        (66.5, 0.01, "estimated", False),  # less than a per cent
        (58.3, 0.1, "held", False),
    ],
)
def test_which_values_differ(value: float, sigma: float, status: str, differs: bool) -> None:
    (each,) = compare_parameters(load_machine(MACHINE), {"Z": {"K_v": found("K_v", value, sigma, status)}})
    assert (each.parameter, each.present, each.differs) == ("drive.K_v", pytest.approx(200 / 3), differs)


def test_in_the_words_of_the_control() -> None:
    machine = load_machine(MACHINE)
    own = {"K_v": found("K_v", 175 / 3, 0.1), "F_C": found("F_C", 1.6, 0.01, unit="N.m"),
           "M_0": found("M_0", 2.0, 0.1, unit="N.m"), "J": found("J", 0.02, 0.001, unit="kg.m2")}  # fmt: skip
    rows = compare_parameters(machine, {"Z": own})
    assert [each.parameter for each in rows] == ["drive.K_v", "friction.F_C", "constant_load"]
    with control_names("sinumerik"):
        first, load = comparison_lines(machine, rows)
        assert "MD32200 4 -> MD32200 POSCTRL_GAIN 3.5 1000/min" in first
        section = comparison_section(machine, rows)
    assert "Z.constant_load is 0 N.m in the machine file" in load
    assert section is not None
    assert "MD32200 POSCTRL_GAIN: 4 | 3.5 1000/min" in str(section.parts[0].rows[0])  # type: ignore[union-attr]
    assert "MD32200" not in comparison_lines(machine, rows)[0]  # no control was asked for
    assert comparison_lines(machine.model_copy(update={"control": "sinumerik"}), rows)[0] == first  # the file names one
    assert [each["differs"] for each in comparison_part(rows)] == [True, False, True]
    assert comparison_section(machine, []) is None
