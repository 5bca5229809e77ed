"""Units of another maker in SSP files: written with what is exchanged and their parameters, found again by the wiring
around the plant, whatever they and their variables are called."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from feedsim import scenario
from feedsim.foundation.errors import InputError
from feedsim.simulation import cosim, ssp
from feedsim.simulation.judge import JudgedRun, judge_run
from foreign import acme
from foreign.conftest import Libraries
from foreign.test_foreign_units import MOTION, mapped, other_name, renamed, settings_of
from ssp_helpers import ROOT, STRUCTURE, altered, contents, edited, export_short, run_ssp, short_scenario, write


@pytest.fixture(scope="module")
def acme_ssp(libraries: Libraries, fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The EMPS axis with both of the other maker's units, as an SSP; the scenario is beside it."""
    folder = tmp_path_factory.mktemp("acme")
    acme.archive(folder / "acme_drive.fmu", "drive", libraries.drive, acme.DRIVE)
    acme.archive(folder / "acme_friction.fmu", "friction", libraries.friction, acme.FRICTION)
    settings = "".join(f"  {text.replace('=', ': ', 1)}\n" for text in mapped(folder))
    text = MOTION.format(machine=ROOT / "scenarios" / "machines" / "emps") + f"set:\n{settings}"
    (folder / "s.yaml").write_text(text, encoding="utf-8")
    ssp.export(scenario.load(folder / "s.yaml"), folder / "s.ssp", fmus=fmus)
    return folder / "s.ssp"


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory, fmus: Path) -> Path:
    return export_short(tmp_path_factory.mktemp("scenario"), fmus)


def warnings_of(file: Path) -> str:
    with ssp.open_system(file) as found:
        return "\n".join(map(str, found.warnings))


def same(one: JudgedRun, other: JudgedRun) -> bool:
    assert list(one.trace) == list(other.trace)
    return all(np.array_equal(one.trace[name], other.trace[name]) for name in one.trace)


def without_annotation(text: str) -> str:
    before, _, rest = text.partition('<ssc:Annotation type="feedsim.scenario">')
    return before + rest.partition("</ssc:Annotation>")[2]


def test_another_makers_units_travel_along(acme_ssp: Path, fmus: Path) -> None:
    """With connectors and parameters by their own names and units; the run is that of the scenario, to the last bit."""
    files = contents(acme_ssp)
    assert {"resources/acme_drive.fmu", "resources/acme_friction.fmu"} <= set(files)
    assert not {"resources/controller.fmu", "resources/friction.fmu"} & set(files)
    text = files[STRUCTURE].decode()
    assert '<ssd:Connection startElement="plant" startConnector="X.x_a" endElement="controller_X" ' in text
    assert 'endConnector="PosActual"' in text
    assert '<ssd:Connector name="PosActual" kind="input">' in text
    assert 'name="Coulomb"' in files["resources/friction_X.ssv"].decode()
    assert same(run_ssp(acme_ssp), judge_run(cosim.run(scenario.load(acme_ssp.with_name("s.yaml")), fmus=fmus)))


def test_a_plain_file_whose_drive_is_not_ours(acme_ssp: Path, tmp_path: Path) -> None:
    """Without our annotation: the control cycle is the step that the file advises; what no wire tells is no column."""
    plain = altered(acme_ssp, tmp_path / "plain.ssp", STRUCTURE, without_annotation)
    one, other = run_ssp(acme_ssp), run_ssp(plain)
    names = [name for name in other.trace if name in one.trace]
    assert {"X.x_a", "X.M_a", "X.M_fr"} <= set(names)
    assert "X.n_s" not in other.trace
    assert all(np.array_equal(one.trace[name], other.trace[name]) for name in names)
    assert "no drive gives its control cycle; it is 0.001 s, the step size that the file advises" in warnings_of(plain)


def test_parameters_count_as_the_file_has_them(acme_ssp: Path, tmp_path: Path) -> None:
    """Another value, in another unit; and an input that nothing drives is held."""
    changed = edited(acme_ssp, tmp_path / "a.ssp", "resources/friction_X.ssv", ('value="8.5" unit="N.mm"', 'value="9"'))
    assert not same(run_ssp(changed), run_ssp(acme_ssp))
    start = "<ssv:Parameters>"
    held = '<ssv:Parameter name="Override"><ssv:Real value="50" unit="%"/></ssv:Parameter>'
    halved = edited(acme_ssp, tmp_path / "b.ssp", "resources/controller_X.ssv", (start, start + held))
    wanted = run_ssp(acme_ssp, "machine.axes.X.drive.parameters.Override=50")
    assert same(run_ssp(halved), wanted)


@pytest.mark.parametrize("kind", ["controller", "friction"])
def test_a_shipped_unit_under_other_names_in_a_scenario(fmus: Path, tmp_path: Path, exported: Path, kind: str) -> None:
    file = short_scenario(tmp_path)
    copy = renamed(fmus, tmp_path, kind)
    drive, friction = (copy, None) if kind == "controller" else (None, copy)
    loaded = scenario.load(file, settings_of(scenario.load(file), "Z", drive, friction))
    out = tmp_path / "renamed.ssp"
    ssp.export(loaded, out, fmus=fmus)
    assert same(run_ssp(out), run_ssp(exported))


@pytest.mark.parametrize("kind", ["controller", "friction"])
def test_a_component_under_other_names_in_the_place_of_ours(
    exported: Path, fmus: Path, tmp_path: Path, kind: str
) -> None:
    """As somebody else's tool would write it: another component, other connectors, other names in its parameters."""
    files = contents(exported)
    files["resources/other.fmu"] = renamed(fmus, tmp_path, kind).read_bytes()
    text = files[STRUCTURE].decode()
    head, _, rest = text.partition(f'<ssd:Component name="{kind}_Z"')
    component, end, tail = rest.partition("</ssd:Component>")
    component = component.replace(f"resources/{kind}.fmu", "resources/other.fmu")
    text = f'{head}<ssd:Component name="{kind}_Z"' + _names(component, "name") + end + tail
    for side in ("start", "end"):
        marks = [f'{side}Element="{kind}_Z" {side}Connector="']
        for mark in marks:
            parts = text.split(mark)
            text = parts[0] + "".join(f'{mark}{other_name(part.partition(chr(34))[0])}"{part.partition(chr(34))[2]}'
                                      for part in parts[1:])  # fmt: skip
    for attribute in ("name", "startElement", "endElement"):
        text = text.replace(f'{attribute}="{kind}_Z"', f'{attribute}="Somebody Else"')
    files[STRUCTURE] = text.encode()
    place = f"resources/{kind}_Z.ssv"
    before, mark, after = files[place].decode().partition("<ssv:Parameters>")
    inside, close, behind = after.partition("</ssv:Parameters>")
    files[place] = (before + mark + _names(inside, "ssv:Parameter name") + close + behind).encode()
    one, other = run_ssp(write(tmp_path / "other.ssp", files)), run_ssp(exported)
    names = [name for name in other.trace if name in one.trace]
    assert {"Z.x_a", "Z.M_a", "Z.M_fr", "X.i_q"} <= set(names)
    assert all(np.array_equal(one.trace[name], other.trace[name]) for name in names)


def _names(text: str, attribute: str) -> str:
    """Names of variables renamed as the archive's are."""
    mark = f'{attribute}="'
    parts = text.split(mark)
    return parts[0] + "".join(
        mark + other_name(part.partition('"')[0]) + '"' + part.partition('"')[2] for part in parts[1:]
    )


def test_a_unit_with_our_variables_and_another_model_name(exported: Path, tmp_path: Path) -> None:
    files = contents(exported)
    inner = tmp_path / "friction.fmu"
    inner.write_bytes(files["resources/friction.fmu"])
    altered(inner, inner, "modelDescription.xml", lambda t: t.replace('modelName="friction"', 'modelName="Coulomb"', 1))
    files["resources/friction.fmu"] = inner.read_bytes()
    one, other = run_ssp(write(tmp_path / "foreign.ssp", files)), run_ssp(exported)
    assert all(np.array_equal(one.trace[name], other.trace[name]) for name in one.trace)


def connection(source: str, target: str) -> str:
    ends = [end.partition(".") for end in (source, target)]
    return (f'startElement="{ends[0][0]}" startConnector="{ends[0][2]}" '
            f'endElement="{ends[1][0]}" endConnector="{ends[1][2]}"')  # fmt: skip


X_A, N_A = (connection(f"plant.X.{s}", f"controller_X.{v}") for s, v in (("x_a", "PosActual"), ("n_a", "SpeedActual")))
N_FR = connection("plant.X.n_fr", "friction_X.Speed")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.replace(X_A, connection("plant.X.x_a", "controller_X.Override")),
         "controller_X.Override is in %, but plant.X.x_a is in m"),
        (lambda t: t.replace(f"<ssd:Connection {X_A} />", ""),
         "nothing of controller_X is connected to plant.X.x_a; the drive of an axis needs it"),
        (lambda t: t.replace(N_FR, connection("plant.X.n_a", "friction_X.Speed")),
         "friction_X.Speed is connected to plant.X.n_a; a friction of its axis can be given plant.X.n_fr"),
        (lambda t: t.replace(N_A, connection("plant.X.n_a", "controller_X.SpeedForward")).replace(
            'startConnector="X.n_ffw" endElement="controller_X" endConnector="SpeedForward"',
            'startConnector="X.n_ffw" endElement="controller_X" endConnector="SpeedActual"'), ""),
        (lambda t: t.replace(f"<ssd:Connection {X_A} />",
                             f'<ssd:Connection suppressUnitConversion="true" {X_A} />'),
         "controller_X.PosActual is in mm, but plant.X.x_a is in m, and the connection forbids to convert"),
        (lambda t: t.replace('startElement="friction_X" startConnector="Torque"',
                             'startElement="controller_X" startConnector="Torque"'),
         "controller_X is connected as drive and as friction"),
    ],
)  # fmt: skip
def test_wirings_that_are_none(acme_ssp: Path, tmp_path: Path, change: Callable[[str], str], words: str) -> None:
    file = altered(acme_ssp, tmp_path / "other.ssp", STRUCTURE, change)
    assert contents(file)[STRUCTURE] != contents(acme_ssp)[STRUCTURE]
    if not words:  # crossed wires of one dimension are somebody's own
        run_ssp(file)
        return
    with pytest.raises(InputError) as caught:
        run_ssp(file)
    assert words in str(caught.value)


def test_an_annotation_cannot_point_outside(acme_ssp: Path, tmp_path: Path) -> None:
    """What is executed is what the file holds; of a unit the annotation tells what is recorded, and nothing else."""

    def evil(text: str) -> str:
        assert '"drive": {' in text
        return text.replace('"drive": {', '"drive": {"fmu": "../../evil.fmu",', 1)

    assert same(run_ssp(altered(acme_ssp, tmp_path / "evil.ssp", STRUCTURE, evil)), run_ssp(acme_ssp))


def test_units_that_declare_no_units_of_measurement(libraries: Libraries, fmus: Path, tmp_path: Path) -> None:
    """As those of pythonfmu: the file names none either, and the run is that of the scenario, to the last bit."""
    bare = {what: tuple(replace(each, unit=None) for each in rows) for what, rows in acme.ROWS.items()}
    acme.archive(tmp_path / "acme_drive.fmu", "drive", libraries.drive, bare["drive"])
    acme.archive(tmp_path / "acme_friction.fmu", "friction", libraries.friction, bare["friction"])
    drive = {
        "fmu": "acme_drive.fmu",
        **acme.MAPPED_DRIVE,
        "parameters": {"Kv": 38, "Kp": 1e-3, "Lead": 0.5, "Limit": 20},
    }
    friction = {"fmu": "acme_friction.fmu", **acme.MAPPED_FRICTION, "parameters": {"Coulomb": 0.01, "Viscous": 1e-5}}
    text = MOTION.format(machine=ROOT / "scenarios" / "machines" / "emps")
    text += f"set:\n  machine.axes.X.drive: {json.dumps(drive)}\n  machine.axes.X.friction: {json.dumps(friction)}\n"
    (tmp_path / "s.yaml").write_text(text, encoding="utf-8")
    plan = scenario.load(tmp_path / "s.yaml")
    ssp.export(plan, tmp_path / "s.ssp", fmus=fmus)
    written = b"".join(
        content for name, content in contents(tmp_path / "s.ssp").items() if name.endswith((".ssd", ".ssv"))
    )
    assert b'unit="1"' not in written
    assert same(run_ssp(tmp_path / "s.ssp"), judge_run(cosim.run(plan, fmus=fmus)))
