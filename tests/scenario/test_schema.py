"""JSON Schema for editors: accepts what load() accepts, refuses the usual mistakes."""

import json
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_args

import pytest
import yaml

from feedsim.cli import main
from feedsim.scenario.schema import Kind, json_schema

jsonschema = pytest.importorskip("jsonschema")

FILE_KINDS = get_args(Kind)
SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


@cache
def validator(kind: Literal["scenario", "machine"]) -> Any:
    schema = json_schema(kind)
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def content(path: Path) -> Any:
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def errors(kind: Literal["scenario", "machine"], data: Any) -> list[str]:
    return [".".join(map(str, error.absolute_path)) for error in validator(kind).iter_errors(data)]


@pytest.mark.parametrize("kind", FILE_KINDS)
def test_files_are_what_the_command_prints(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tools", "schema", kind]) == 0
    pinned = (SCENARIOS / "schemas" / f"{kind}.schema.json").read_text(encoding="utf-8")
    assert pinned == capsys.readouterr().out, "`make schemas` writes the files anew"


def test_there_is_a_file_for_every_kind_and_no_other() -> None:
    assert {path.name for path in (SCENARIOS / "schemas").iterdir()} == {f"{kind}.schema.json" for kind in FILE_KINDS}


# Fragments that other files name have no schema of their own.
@pytest.mark.parametrize(
    "path",
    [path for path in sorted(SCENARIOS.rglob("*.yaml")) if not path.name.startswith(("drive_", "friction_"))],
    ids=lambda path: path.relative_to(SCENARIOS).as_posix(),
)
def test_shipped_files_name_the_schema_that_they_satisfy(path: Path) -> None:
    """By the first line of each, which editors read; relative to the file, as the YAML language server takes it."""
    first, _, _ = path.read_text(encoding="utf-8").partition("\n")
    words, _, named = first.partition("$schema=")
    assert words == "# yaml-language-server: "
    schema = json.loads((path.parent / named).read_text(encoding="utf-8"))
    assert [error.message for error in jsonschema.Draft202012Validator(schema).iter_errors(content(path))] == []


def test_shipped_machine_is_valid_alone_and_inside_a_scenario() -> None:
    machine = content(SCENARIOS / "machines" / "test_centre" / "machine.yaml")
    assert errors("machine", machine) == []
    assert (
        errors("scenario", {"name": "s", "machine": machine, "motions": [{"kind": "dwell", "duration": "1 s"}]}) == []
    )


SCENARIO: dict[str, Any] = {
    "name": "s",
    "machine": "m",
    "motions": [{"kind": "move", "by": {"Z": "100 mm"}, "feed": "5000 mm/min"}],
    "recording": {"interval": "1 ms"},
}


def changed(key: str, value: Any) -> dict[str, Any]:
    data: Any = yaml.safe_load(yaml.safe_dump(SCENARIO))
    *path, last = key.split(".")
    place: Any = data
    for part in path:
        place = place[int(part)] if isinstance(place, list) else place[part]
    place[last] = value
    return dict(data)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("motions.0.feed", "5000 mm"),  # a symbol alone of the wrong dimension
        ("motions.0.feed", 5000),
        ("motions.0.feed", "5000"),
        ("motions.0.feed", "fast"),
        ("motions.0.feed", "5,5 m/min"),
        ("motions.0.feed", "5 inch/min"),
        ("motions.0.fed", "5 m/min"),
        ("motions.0.by", {"Z": 100}),
        ("motions.0.by", {"Z": "100 s"}),
        ("motions.0.kind", "mov"),
        ("recording.interval", "1 mm"),
        ("coupling", {"scheme": "jacoby"}),
        ("coupling", {"substeps": 0}),
        ("coupling", "scheme"),
        ("loads", [{"kind": "motor"}]),
        ("loads", [{"kind": "tool", "direction": "A", "file": "f.csv", "column": "F"}]),
        ("loads", [{"kind": "tool", "direction": "X", "table": {"time": ["0 s", "1 s"], "values": ["1 V", "1 N"]}}]),
        ("loads", [{"kind": "motor", "axis": "Z", "table": {"time": ["0 s"], "values": ["1 N.m"]}}]),
        ("evaluate", [{"kind": "positioning"}]),
        ("evaluate", [{"kind": "positioning", "axis": "Z", "motion": -1}]),
        ("evaluate", [{"kind": "circle", "motion": "last"}]),
        ("motions", []),
        ("motions", [{"kind": "constant_speed", "axis": "Z", "speeds": ["1 mm"]}]),
        ("motions", [{"kind": "constant_speed", "axis": "Z", "speeds": {"from": "1 m/s"}}]),
        ("motions", [{"kind": "constant_speed", "axis": "Z", "speeds": {"first": "1 m/s", "last": "2 m/s"}}]),
        ("motions", [{"kind": "sine", "axis": "Z", "moves": [{"amplitude": "1 um", "frequency": "1 Hz"}]}]),
        ("logging", {"interval": "2 mm"}),
        ("logging", {"signals": ["iq"]}),
        ("logging", {"noise": {"i_q": "1 V"}}),
        ("logging", {"noise": {"x_a": "5 %"}}),
        ("logging", {"delay": {"i_q": 1}}),
        ("extra", 1),
        ("set", [1]),
    ],
)
def test_usual_mistakes_are_refused(key: str, value: Any) -> None:
    assert errors("scenario", SCENARIO) == []
    assert errors("scenario", changed(key, value))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("motions.0.feed", "5 m/min"),
        ("motions.0.feed", "5e3 mm.min^-1"),
        ("motions.0.feed", "83.3 mm/s"),
        ("motions.0.by", {"Z": "100µm", "X": "-1 m"}),
        ("machine", "other/machine.yaml"),
        ("coupling", "coupling.yaml"),
        ("set", {"machine.axes.Z.friction.W": "0 rad"}),
        ("motions.0.acceleration", "2 m/s²"),
        ("motions.0.jerk", None),
        ("motions", [{"kind": "constant_speed", "axis": "Z", "speeds": ["1 mm/min", "2 m/min"], "jerk": None}]),
        ("motions", [{"kind": "constant_speed", "axis": "Z", "speeds": {"from": "1 m/s", "to": "2 m/s", "count": 3}}]),
        (
            "motions",
            [{"kind": "sine", "axis": "Z", "moves": [{"amplitude": "1 um", "frequency": "1 Hz", "periods": 2}]}],
        ),
        ("logging", {"noise": {"i_q": "5 %", "n_a": "1 rpm"}, "delay": {"i_q": "0.5 ms"}, "seed": 3}),
        ("logging", "logging.yaml"),
        ("loads", [{"kind": "tool", "direction": "X", "file": "f.csv", "column": "F", "factor": -1, "motion": 0}]),
        ("loads", [{"kind": "motor", "axis": "Z", "table": {"time": ["0 s", "1 s"], "values": ["1 N.m", "2 N.m"]}}]),
        ("evaluate", [{"kind": "positioning", "axis": "Z", "motion": 0}, {"kind": "circle", "motion": 3}]),
    ],
)
def test_other_spellings_are_accepted(key: str, value: Any) -> None:
    assert errors("scenario", changed(key, value)) == []


def test_machine_mistakes() -> None:
    machine = content(SCENARIOS / "machines" / "test_centre" / "machine.yaml")
    del machine["axes"]["Z"]["friction"]["F_C"]
    machine["axes"]["X"]["drive"]["K_v"] = "66 Hz"
    machine["axes"]["X"]["drive"]["ramp_speed_setpoint"] = "on"
    machine["axes"]["Y"]["friction"]["gamma"] = 1.5
    machine["axes"]["Y"]["travel"] = ["0 mm"]
    found = {path.partition("axes.")[2].split(".drive")[0].split(".friction")[0] for path in errors("machine", machine)}
    assert found >= {"Z", "X", "Y", "Y.travel"}


def test_every_key_is_described() -> None:
    for kind in ("scenario", "machine"):
        schema = json_schema(kind)
        groups = {"": schema, **schema["$defs"]}
        silent = [
            f"{name}.{key}"
            for name, group in groups.items()
            for key, part in group.get("properties", {}).items()
            if key != "kind" and "description" not in part and "$ref" not in str(part)
        ]
        assert silent == []
