"""Parameters by the names of controls: the table, values in scenarios, sections of reports."""

from __future__ import annotations

import importlib.util
import json
import math
import shutil
from pathlib import Path

import pytest

from command_helpers import feedsim
from feedsim.files.control import CONTROLS, find_name, names_of
from feedsim.files.control.names import table
from feedsim.foundation import units
from feedsim.foundation.errors import InputError
from feedsim.jobs.parameters import CONTROL_CHOICES
from feedsim.scenario import load, load_machine

PROJECT = Path(__file__).resolve().parents[2]
CIRCLE = PROJECT / "scenarios" / "xz_circle.yaml"
MACHINE = PROJECT / "scenarios" / "machines" / "test_centre"


def test_every_row_names_a_parameter_that_we_have() -> None:
    ours = units.parameters("controller")
    for row in table():
        group, _, name = row.parameter.partition(".")
        if group == "drive":
            assert name in ours, row
            assert ours[name].unit == row.si.replace("^", ""), row
        assert row.control in CONTROLS
        assert row.factor > 0
        assert row.source


def test_numbers_are_unique() -> None:
    numbers = [row.number for row in table()]
    assert len(set(numbers)) == len(numbers)


# Each factor beside the conversion of units that a person would look up; not by the table's own numbers.
@pytest.mark.parametrize(
    ("number", "value", "text", "unit"),
    [
        ("MD32200", 4, "4 (m/min)/mm", "1/s"),
        ("MD32000", 30000, "30 m/min", "m/s"),
        ("MD32450", 0.012, "12 um", "m"),
        ("MD32520", 17.1, "17.1 mm/min", "m/s"),
        ("MD32540", 0.055, "55 ms", "s"),
        ("MD31030", 20, "20 mm", "m"),
        ("p1462", 10, "10 ms", "s"),
        ("P-AXIS-00099", 6667, "66.67 1/s", "1/s"),
        ("P-AXIS-00212", 500000, "30 m/min", "m/s"),
        ("P-AXIS-00008", 14400, "14.4 m/s^2", "m/s^2"),
        ("P-AXIS-00103", 120, "12 um", "m"),
        ("S-0-0296", 100, "100 %", "1"),
    ],
)
def test_conversion(number: str, value: float, text: str, unit: str) -> None:
    name = find_name(number)
    assert name is not None
    assert name.ours(value) == pytest.approx(units.parse(text, unit), rel=1e-14)
    assert name.shown(name.ours(value)) == pytest.approx(value, rel=1e-14)


def test_frequency_and_rms() -> None:
    frequency, torque = find_name("p1433"), find_name("p316")
    assert frequency is not None
    assert torque is not None
    assert frequency.ours(100) == pytest.approx(200 * math.pi, rel=1e-15)
    # The same torque at 1 A rms and at its amplitude of sqrt(2) A.
    assert torque.ours(1.5) * math.sqrt(2) == pytest.approx(1.5, rel=1e-15)


@pytest.mark.parametrize("key", ["Z.MD32200", "machine.axes.Z.MD32200", "machine.axes.Z.drive.MD32200"])
def test_a_value_of_the_control_is_set(key: str) -> None:
    axes = load(CIRCLE, [f"{key}=5"]).machine.axes
    assert axes["Z"].drive.K_v == pytest.approx(5000 / 60, rel=1e-15)
    assert axes["X"].drive.K_v == pytest.approx(4000 / 60, rel=1e-15)


def test_of_all_axes() -> None:
    axes = load(CIRCLE, ["MD32200=5"]).machine.axes
    assert {axis.drive.K_v for axis in axes.values()} == {axes["X"].drive.K_v}
    assert axes["X"].drive.K_v == pytest.approx(5000 / 60, rel=1e-15)


def test_the_command_line_offers_every_control() -> None:
    """Options are declared without the table of names, which takes time to load."""
    assert CONTROL_CHOICES == CONTROLS


def test_a_scenario_sets_it(tmp_path: Path) -> None:
    shutil.copytree(MACHINE, tmp_path / "machines" / "test_centre")
    text = CIRCLE.read_text() + "\nset:\n  Z.p1462: 15\n"
    (tmp_path / "circle.yaml").write_text(text)
    assert load(tmp_path / "circle.yaml").machine.axes["Z"].drive.T_n == pytest.approx(0.015, rel=1e-15)


def test_a_machine_file_has_it(tmp_path: Path) -> None:
    shutil.copytree(MACHINE, tmp_path / "m")
    file = tmp_path / "m" / "machine.yaml"
    text = file.read_text()
    file.write_text(text.replace("K_v: 4 (m/min)/mm ", "MD32200: 3"))
    machine = load_machine(tmp_path / "m")
    assert machine.axes["X"].drive.K_v == pytest.approx(50.0, rel=1e-15)
    file.write_text(text.replace("K_v: 4 (m/min)/mm ", "K_v: 4 (m/min)/mm\n      MD32200: 3"))
    with pytest.raises(InputError, match=r"machine.yaml:38: MD32200 is drive.K_v, which is given as well"):
        load_machine(tmp_path / "m")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("Z.MD32810=0.003", "MD32810 is T_sym, but its unit is not confirmed by a public source"),
        ("Z.MD32200=4 (m/min)/mm", r"MD32200 is '4 \(m/min\)/mm'; a number in the control's unit, 1000/min, is"),
        ("Z.MD32200=true", "MD32200 is true; a number in the control's unit"),
        ("Q.MD32200=4", "'Q'"),
        ("Z.MD99999=4", "MD99999|unknown key 'Z'"),
    ],
)
def test_what_cannot_be_taken(change: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load(CIRCLE, [change])


def test_no_such_control() -> None:
    with pytest.raises(InputError, match="control 'fagor' is not known; known are sinumerik"):
        names_of("fagor")


def test_reports_show_it_and_results_keep_their_bytes(fmus: Path, tmp_path: Path) -> None:
    plain = feedsim("run", CIRCLE, "--out", "plain", fmus=fmus, cwd=tmp_path)
    named = feedsim("run", CIRCLE, "--out", "named", "--control", "sinumerik", fmus=fmus, cwd=tmp_path)
    assert plain.returncode == named.returncode == 0, named.stderr
    assert (tmp_path / "plain/result.csv").read_bytes() == (tmp_path / "named/result.csv").read_bytes()
    page = (tmp_path / "named/report.html").read_text()
    assert "Names in the control sinumerik" in page
    assert "POSCTRL_GAIN" in page
    assert "Names in the control" not in (tmp_path / "plain/report.html").read_text()
    figures = [json.loads((tmp_path / each / "summary.json").read_text())["figures"] for each in ("plain", "named")]
    assert figures[0] == figures[1]


def test_differences_in_the_controls_unit(fmus: Path, tmp_path: Path) -> None:
    feedsim("run", CIRCLE, "--out", "a", fmus=fmus, cwd=tmp_path)
    feedsim("run", CIRCLE, "--set", "Z.MD32200=5", "--out", "b", fmus=fmus, cwd=tmp_path)
    done = feedsim("diff", "a", "b", "--out", "over", "--control", "sinumerik", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "over/report.html").read_text()
    assert "4 | 5" in page


def test_the_page_has_every_row() -> None:
    """Of the site; docs/controls.md leads there."""
    # By its path: tests have a folder of that name.
    described = importlib.util.spec_from_file_location("site_reference", PROJECT / "docs" / "site" / "reference.py")
    assert described is not None
    assert described.loader is not None
    reference = importlib.util.module_from_spec(described)
    described.loader.exec_module(reference)
    page = reference.control_names()
    for row in table():
        line = next(line for line in page.splitlines() if f"| `{row.number}` |" in line)
        assert f"| `{row.parameter}` |" in line
        assert f"| {'yes' if row.confirmed else 'no'} |" in line
        assert f"{row.factor:.6g} {row.si}".strip() in line
