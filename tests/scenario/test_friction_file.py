"""Files with friction of an axis: written whole, read as machine files read them, kept apart from what they tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from feedsim.estimation.identify.friction_file import Line, friction_text
from feedsim.foundation.errors import InputError, OutputError
from feedsim.scenario import Friction, load, load_machine
from feedsim.scenario.load import read_friction
from feedsim.scenario.schema import json_schema

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = ROOT / "scenarios" / "xz_circle.yaml"
MACHINE = ROOT / "scenarios" / "machines" / "test_centre"
VALUES = {"sigma_0": 301.23456789, "sigma_1": 0.79, "sigma_2": 5.9e-3, "F_C": 1.61, "F_S": 2.09, "v_s": 0.61,
          "W": 0.0401, "gamma": 0.352, "asymmetry": -0.02}  # fmt: skip
LINES = {name: Line(value, f"95 %: remark on {name}") for name, value in VALUES.items()}
TOLD: dict[str, Any] = {
    "axis": "Z",
    "date": "2026-01-31",
    "constant_load": {"value": "0.25 N.m", "status": "estimated"},
    "traces": [{"file": "a, b.csv", "sha256": "0123e45"}],
    "matrix": [[1.0, 0.5], [0.5, 1.0]],
    "note": "on: off # no comment",
}


def text_of(lines: Mapping[str, Line], told: Mapping[str, Any] = TOLD, head: Sequence[str] = ()) -> str:
    return friction_text(lines, told, head, name="friction.yaml")


def test_what_is_written_is_read(tmp_path: Path) -> None:
    file = tmp_path / "friction.yaml"
    file.write_text(text_of(LINES, head=["Friction of axis Z", "", "two\nlines"]), encoding="utf-8")
    friction = read_friction(file)
    for name, value in VALUES.items():
        assert getattr(friction, name) == pytest.approx(value, rel=1e-7)
    assert friction.F_log == 0.0  # not given: the unit's start value
    assert friction.identified == TOLD


def test_a_person_reads_one_line_per_parameter() -> None:
    lines = text_of(LINES, head=["Friction of axis Z", "", "two\nlines"]).splitlines()
    assert lines[:4] == ["# Friction of axis Z", "#", "# two", "# lines"]
    assert lines[4] == "sigma_0: 301.23457 N.m/rad   # 95 %: remark on sigma_0"
    assert f"{'gamma: 0.352':<29}# 95 %: remark on gamma" in lines
    assert "sigma_2: 0.0059 N.m.s/rad" in [line.split("#")[0].rstrip() for line in lines]
    assert len({line.index("#") for line in lines[4:13]}) == 1


def test_findings_are_written_as_text() -> None:
    """1.5 stays a text."""
    written = text_of(LINES, {"warnings": ["'i_q' is not used", "1.5"], "one": "line"})
    assert yaml.safe_load(written)["identified"] == {"warnings": ["'i_q' is not used", "1.5"], "one": "line"}


@settings(max_examples=60)
@given(st.floats(1e-6, 1e9), st.floats(0, 1e4), st.floats(1e-9, 1e3), st.floats(0, 1), st.floats(0, 1))
def test_values_keep_eight_digits(sigma_0: float, sigma_1: float, F_C: float, rise: float, gamma: float) -> None:
    values = VALUES | {"sigma_0": sigma_0, "sigma_1": sigma_1, "F_C": F_C, "F_S": F_C * (1 + rise), "gamma": gamma}
    data = yaml.safe_load(text_of({name: Line(value) for name, value in values.items()}, {}))
    for name, value in values.items():
        # 8 significant digits: half a unit of the last one
        assert float(str(data[name]).split()[0]) == pytest.approx(value, rel=5.1e-8, abs=1e-300)


@pytest.mark.parametrize("where", ["--set", "scenario", "machine"])
def test_scenarios_take_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str) -> None:
    """--set counts from the working folder, a file from its own folder."""
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "friction.yaml").write_text(text_of(LINES), encoding="utf-8")
    if where == "--set":
        monkeypatch.chdir(tmp_path)
        scenario = load(SCENARIO, ["machine.axes.Z.friction=results/friction.yaml"])
    else:
        (tmp_path / "elsewhere").mkdir()
        monkeypatch.chdir(tmp_path / "elsewhere")
        machine = yaml.safe_load((MACHINE / "machine.yaml").read_text(encoding="utf-8"))
        machine |= {key: str(MACHINE / machine[key]) for key in ("modes", "structure")}
        data: dict[str, Any] = yaml.safe_load(SCENARIO.read_text(encoding="utf-8")) | {"machine": "machine.yaml"}
        if where == "machine":
            machine["axes"]["Z"]["friction"] = "results/friction.yaml"
        else:
            data["set"] = {"machine.axes.Z.friction": "results/friction.yaml"}
        (tmp_path / "machine.yaml").write_text(yaml.safe_dump(machine), encoding="utf-8")
        (tmp_path / "s.yaml").write_text(yaml.safe_dump(data), encoding="utf-8")
        scenario = load(tmp_path / "s.yaml")
    friction = scenario.machine.axes["Z"].friction
    assert friction.parameters()["gamma"] == 0.352
    assert friction.identified["date"] == "2026-01-31"
    assert any(path.name == "friction.yaml" for _, path in scenario.files)
    assert scenario.machine.axes["X"].friction.identified == {}


def test_what_is_told_is_no_parameter_of_the_unit() -> None:
    friction = Friction.model_validate({**VALUES, "identified": TOLD})
    assert "identified" not in friction.parameters()
    assert set(VALUES) <= set(friction.parameters())


def test_a_parameter_indented_too_far_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "friction.yaml"
    file.write_text(text_of(LINES) + "  F_log: 0.4 N.m\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"friction\.yaml:\d+: identified: 'F_log' has no effect inside 'identified'"):
        read_friction(file)


def test_faults_have_their_line(tmp_path: Path) -> None:
    file = tmp_path / "friction.yaml"
    file.write_text(text_of(LINES).replace("F_C: 1.61 N.m", "F_C: 1.61 N"), encoding="utf-8")
    with pytest.raises(InputError, match=r"friction\.yaml:4: F_C: .*torque is expected"):
        read_friction(file)
    with pytest.raises(InputError, match="no such file"):
        read_friction(tmp_path / "none.yaml")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"F_C": Line(3.0)}, "F_S 2.09 N.m is smaller than F_C 3 N.m"),
        ({"gamma": Line(1.5)}, "gamma: .*outside the allowed range"),
        ({"v_s": Line(np.nan)}, "v_s"),
        ({"sigma_3": Line(1.0)}, "'sigma_3' is no friction parameter"),
    ],
)
def test_what_could_not_be_read_is_not_composed(changes: dict[str, Line], words: str) -> None:
    with pytest.raises(OutputError, match=f"friction.yaml is not written: .*{words}"):
        text_of(LINES | changes)


def test_missing_parameters() -> None:
    with pytest.raises(OutputError, match="sigma_0: "):
        text_of({name: line for name, line in LINES.items() if name != "sigma_0"}, {})


def test_editors_know_the_group() -> None:
    friction = json_schema("machine")["$defs"]["Friction"]
    assert friction["properties"]["identified"]["type"] == "object"
    assert "identified" not in friction["required"]
    jsonschema = pytest.importorskip("jsonschema")
    machine = yaml.safe_load((MACHINE / "machine.yaml").read_text(encoding="utf-8"))
    machine["axes"]["Z"]["friction"] |= {"identified": TOLD}
    assert list(jsonschema.Draft202012Validator(json_schema("machine")).iter_errors(machine)) == []
    assert load_machine(MACHINE).axes["Z"].friction.identified == {}
