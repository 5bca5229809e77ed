"""Mapping files: what is accepted, and every refusal with file, line and key."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from feedsim.files.columns import Columns, Signal, load_columns
from feedsim.foundation.errors import InputError
from feedsim.foundation.units import is_rms, spell_unit
from feedsim.scenario.schema import json_schema

ROOT = Path(__file__).resolve().parents[2]
# Six lines that are right; what a test adds begins in line 7.
GOOD = """\
name: recording
axis: Z
time: {column: t, unit: s}
position: {column: x, unit: mm}
speed: {column: n, unit: rpm, sign: -1}
current: {column: i, unit: A}
"""

Refused = Callable[[str], str]


@pytest.fixture
def refused(tmp_path: Path) -> Refused:
    def message(text: str) -> str:
        path = tmp_path / "m.yaml"
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError) as caught:
            load_columns(path)
        return str(caught.value)

    return message


def test_quantities_are_si(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(
        GOOD + "pitch: 20 mm\ntorque_constant: 2 Nm/A\nmass: 95 kg\ndelay: {torque: 0.5 ms}\n"
        "load: {column: p, unit: N, factor: 3}\nsetpoint: {column: q, unit: increments, factor: 0.001 mm}\n",
        encoding="utf-8",
    )
    columns = load_columns(path)
    assert (columns.pitch, columns.torque_constant, columns.mass, columns.delay.torque) == (0.02, 2.0, 95.0, 0.0005)
    assert columns.speed is not None
    assert columns.speed.sign == -1
    assert columns.setpoint is not None
    assert columns.setpoint.factor is not None
    assert (columns.setpoint.factor.value, columns.setpoint.factor.unit) == (0.001, "mm")
    assert columns.load is not None
    assert columns.load.factor is not None
    assert columns.load.factor.unit == "1"
    assert columns.file == path
    assert columns.where("position", "unit") == f"{path}:4: position.unit"


def test_a_factor_may_be_a_variable_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(
        "position: {column: q, unit: m}\nforce: {column: u, unit: V, factor: {variable: g, unit: N/V}}\n", "utf-8"
    )
    force = load_columns(path).force
    assert force is not None
    assert force.factor is not None
    assert (force.factor.variable, force.factor.value, force.factor.unit) == ("g", None, "N/V")


def test_made_in_python() -> None:
    columns = Columns(position={"column": "x", "unit": "m"}, force={"column": "u", "unit": "V", "factor": "35 N/V"})
    assert isinstance(columns.force, Signal)
    assert columns.force.factor is not None
    assert columns.force.factor.value == 35
    assert columns.file is None
    assert columns.where("pitch") == "mapping: pitch"


@pytest.mark.parametrize(
    ("unit", "meant"),
    [
        ("U/min", "rpm"), ("1/min", "rpm"), ("min-1", "rpm"), ("turns", "rev"), ("Increments", "1"), ("Arms", "A"),
        ("A rms", "A"), ("mm/min", "mm/min"), ("mA", "mA"),
    ],
)  # fmt: skip
def test_spellings_of_drives(unit: str, meant: str) -> None:
    assert spell_unit(unit) == meant
    assert is_rms(unit) == ("rms" in unit)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD + "torqe: {column: m, unit: Nm}", "m.yaml:7: torqe: unknown key; did you mean 'torque'?"),
        (GOOD + "pitch: 20", "m.yaml:7: pitch: 20 has no unit; a length is expected, for example 20 mm"),
        (GOOD + "pitch: 0 mm", "m.yaml:7: pitch: 0 mm is outside the allowed range: at least 1e-08 m"),
        (GOOD + "torque_constant: 2 N.m", "m.yaml:7: torque_constant: '2 N.m' is a torque; a torque constant is"),
        (GOOD + "delay: {torqe: 1 ms}", "m.yaml:7: delay.torqe: unknown key; did you mean 'torque'?"),
        (GOOD + "delay: {torque: -2 s}", "m.yaml:7: delay.torque: -2 s is outside the allowed range: from -1 s to 1 s"),
        (GOOD + "setpoint: q", "m.yaml:7: setpoint: 'q'; a group of keys is expected"),
        (GOOD + "setpoint: {unit: mm}", "m.yaml:7: setpoint.column: missing; Name in the header"),
        (GOOD + "setpoint: {column: ''}", "m.yaml:7: setpoint.column: the text is empty"),
        (GOOD + "setpoint: {column: q, unit: mmm}", "m.yaml:7: setpoint.unit: unknown unit 'mmm'; did you mean 'mm'?"),
        (GOOD + "setpoint: {column: q, unit: N}",
         "m.yaml:7: setpoint.unit: N: the values are a force; a length or an a"),
        (
            GOOD + "setpoint: {column: q, unit: increments}",
            "a plain number; a length or an angle is expected here, in m or rad for example; give the factor of one "
            "unit, for example factor: 0.001 m",
        ),
        (GOOD + "setpoint: {column: q, unit: deg, at: scale}",
         "m.yaml:7: setpoint.at: the values are angles, which are"),
        (GOOD + "setpoint: {column: q, at: moter}",
         "m.yaml:7: setpoint.at: 'moter' is not allowed here; did you mean 'm"),
        (GOOD + "setpoint: {column: q, sign: 2}", "m.yaml:7: setpoint.sign: 2 is not allowed here; allowed: 1, -1"),
        (GOOD + "setpoint: {column: q, factor: much}",
         "m.yaml:7: setpoint.factor: 'much' is no factor; a number with a"),
        (GOOD + "setpoint: {column: q, factor: 0 mm}", "m.yaml:7: setpoint.factor.value: 0.0 is outside the allowed"),
        (GOOD + "setpoint: {column: q, factor: 3 mq}", "m.yaml:7: setpoint.factor.unit: unknown unit 'mq'"),
        (GOOD + "setpoint: {column: q, factor: {unit: mm}}",
         "m.yaml:7: setpoint.factor.variable: a factor needs either 'value' or 'variable'"),
        (GOOD + "setpoint: {column: q, factor: {unit: mm, value: 1, variable: g}}",
         "m.yaml:7: setpoint.factor.variable: a factor needs either 'value' or 'variable'"),
        (GOOD + "load: {column: p, unit: V, factor: 3 A}", "m.yaml:7: load.unit: V times A: the values are a"),
        (GOOD + "torque: {column: m, unit: Nm}", "m.yaml:6: current: stands beside torque; one of the two is enough"),
        (GOOD + "mass: 95 kg\ninertia: 0.01 kg.m^2", "m.yaml:7: mass: stands beside inertia; give one of the two"),
        ("position: {column: x}\ntorque: {column: m}\ntorque_constant: 2 Nm/A",
         "m.yaml:3: torque_constant: is of no use: the trace's torque is taken, not a current"),
        ("torque: {column: m}", "m.yaml:1: missing: position or speed, for example position: {column: x, unit: mm}"),
        ("time: {column: t, interval: 2 ms}\nposition: {column: x}\ntorque: {column: m}",
         "m.yaml:1: time: 'interval' is for traces without a column of time; give either the interval or the column"),
        ("time: {factor: 2 ms}\nposition: {column: x}\ntorque: {column: m}",
         "m.yaml:1: time: 'factor' needs the 'column' that it belongs to"),
        ("time: {column: t, unit: mm}\nposition: {column: x}\ntorque: {column: m}",
         "m.yaml:1: time.unit: mm: the values are a length; a time is expected here, in s for example"),
        ("time: {interval: 0 s}\nposition: {column: x}\ntorque: {column: m}",
         "time.interval: 0 s is outside the allow"),
        ("axis: time\nposition: {column: x}\ntorque: {column: m}", "m.yaml:1: axis: 'time' is no axis name"),
        ("- 1", "m.yaml:1: a file of 'key: value' lines is expected, not a list"),
    ],
)  # fmt: skip
def test_refusals(refused: Refused, text: str, message: str) -> None:
    assert message in refused(text)


def test_every_problem_is_told_at_once(refused: Refused) -> None:
    text = refused("axes: Z\nposition: {column: x, unit: kg}\ncurrent: {column: i, unit: A}\npitch: 20\n")
    assert "m.yaml:1: axes: unknown key" in text
    assert "m.yaml:4: pitch: 20 has no unit" in text
    text = refused("position: {column: x, unit: kg}\ncurrent: {column: i, unit: mm}\nmass: 1 kg\ninertia: 1 kg.m^2")
    assert [line.split(": ")[0].strip().rpartition(":")[2] for line in text.splitlines()[1:]] == ["1", "2", "3"]


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no such file: .*none\.yaml"):
        load_columns(tmp_path / "none.yaml")


SHIPPED = sorted((ROOT / "scenarios" / "machines").rglob("columns.yaml"))


def schema_errors(data: Any) -> list[str]:
    jsonschema = pytest.importorskip("jsonschema")
    schema = json_schema("columns")
    jsonschema.Draft202012Validator.check_schema(schema)
    found = jsonschema.Draft202012Validator(schema).iter_errors(data)
    return [".".join(map(str, error.absolute_path)) for error in found]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_shipped_mappings(path: Path) -> None:
    assert load_columns(path).name
    assert schema_errors(yaml.safe_load(path.read_text(encoding="utf-8"))) == []


def test_schema() -> None:
    good = yaml.safe_load(GOOD)
    assert schema_errors(good) == []
    for factor in ("35.15 N/V", 3, {"variable": "g", "unit": "N/V"}):
        assert schema_errors(good | {"load": {"column": "p", "factor": factor}}) == []
    for key, wrong in (
        ("pitch", 20), ("pitch", "20 s"), ("axes", "Z"), ("position", "x"), ("position", {"unit": "mm"}),
        ("position", {"column": "x", "sign": 2}), ("load", {"column": "p", "factor": "much"}), ("delay", "1 ms"),
    ):  # fmt: skip
        assert schema_errors(good | {key: wrong}), (key, wrong)


def test_every_key_is_described() -> None:
    schema = json_schema("columns")
    for name, group in {"": schema, **schema["$defs"]}.items():
        for key, part in group.get("properties", {}).items():
            assert "description" in part, f"{name}.{key}"


BLOCKS = re.findall(r"^```yaml\n(.*?)^```", (ROOT / "docs" / "traces.md").read_text(encoding="utf-8"), re.M | re.S)


@pytest.mark.parametrize("block", BLOCKS)
def test_examples_of_the_page(tmp_path: Path, block: str) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(block, encoding="utf-8")
    load_columns(path)
    assert schema_errors(yaml.safe_load(block)) == []


def test_the_page_has_examples() -> None:
    assert len(BLOCKS) == 3
