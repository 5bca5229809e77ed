"""A scenario as an SSP file of one component, the machine as one unit, and back."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import fmpy
import pytest

from feedsim import analysis, scenario
from feedsim.cli import main
from feedsim.foundation.errors import InputError
from feedsim.simulation import cosim, ssp
from feedsim.simulation.judge import judge_run
from ssp_helpers import STRUCTURE, altered, contents, edited, short_scenario

MACHINE = "resources/machine.fmu"


@pytest.fixture(scope="module")
def one(short: Path, fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("one") / "one.ssp"
    assert main(["export", str(short), "--one", "--out", str(path), "--fmus", str(fmus)]) == 0
    return path


@pytest.mark.parametrize("overrides", [(), ("machine.axes.Z.drive.K_v=50 1/s", "recording.interval=250 us")], ids=str)
def test_it_runs_as_the_scenario_does(short: Path, one: Path, fmus: Path, overrides: tuple[str, ...]) -> None:
    here = judge_run(cosim.run(scenario.load(short, overrides), fmus=fmus))
    with ssp.open_system(one, overrides) as found:
        there = judge_run(cosim.run(found.scenario, program=found.program, fmus=found.fmus))
        assert found.all_findings(there.warnings) == here.warnings
    assert [*there.units] == ["machine"]
    assert [*there.trace.columns] == [*here.trace.columns]
    for name in here.trace.columns:
        assert list(there.trace[name]) == list(here.trace[name]), name
    assert analysis.evaluate(there) == analysis.evaluate(here)
    for axis, other in zip(here.scenario.machine.axes.values(), there.scenario.machine.axes.values(), strict=True):
        assert axis.friction == other.friction
        assert axis.drive.parameters() == other.drive.parameters()
        assert axis.model_dump(exclude={"drive", "friction"}) == other.model_dump(exclude={"drive", "friction"})


def test_what_is_inside(one: Path, short: Path) -> None:
    files = contents(one)
    assert set(files) == {STRUCTURE, MACHINE}
    structure = files[STRUCTURE].decode()
    assert structure.count("<ssd:Component ") == 1
    assert "<ssd:Connection " not in structure
    assert 'kind="input"' not in structure
    assert 'baseStepSize="0.001"' in structure
    packed = one.with_name("machine.fmu")
    packed.write_bytes(files[MACHINE])
    assert fmpy.read_model_description(str(packed)).modelName == scenario.load(short).name


def test_it_is_what_the_standard_wants(one: Path) -> None:
    """By the schemas of the standard, as FMPy carries them."""
    read: Any = pytest.importorskip("fmpy.ssp.ssd").read_ssd
    (component,) = read(str(one), validate=True).system.elements
    assert {"Z.x_a", "Z.M_fr", "tool.x_X", "Z.x_e_max"} <= {each.name for each in component.connectors}


def test_another_machine(tmp_path: Path, fmus: Path) -> None:
    """Its axes, and an exchange of its own, are in the archive; nothing but the annotation knows the motion."""
    text = (
        "name: one axis\nmachine: {machine}\nmotions: [{{kind: move, by: {{X: 1 mm}}, feed: 3 m/min}}]\n"
        "set: {{machine.structure: null}}\ncoupling: {{units: one, scheme: gauss_seidel}}\n"
    )
    file, out = short_scenario(tmp_path, "one_axis", text), tmp_path / "axis.ssp"
    ssp.export(scenario.load(file), out, fmus=fmus)
    annotation = re.compile(r"(?s)<ssc:Annotation type=.feedsim.*?</ssc:Annotation>")
    bare = altered(out, tmp_path / "bare.ssp", STRUCTURE, lambda text: annotation.sub("", text))
    here = judge_run(cosim.run(scenario.load(file, ["coupling.units=separate"]), fmus=fmus))
    for path in (out, bare):
        with ssp.open_system(path) as found:
            assert found.scenario.coupling.model_dump() == {
                "scheme": "gauss_seidel", "substeps": 1, "call_limit": 60.0, "units": "one",
            }  # fmt: skip
            there = judge_run(cosim.run(found.scenario, program=found.program, fmus=found.fmus))
        for name in here.trace.columns:
            assert list(there.trace[name]) == list(here.trace[name]), name


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            ("</ssd:Elements>", '</ssd:Elements><ssd:Connections><ssd:Connection startElement="machine" '
             'startConnector="Z.x_a" endElement="machine" endConnector="Z.x_s"/></ssd:Connections>'),
            "connection machine.Z.x_a - machine.Z.x_s: nothing is connected to a whole machine here",
        ),
        (
            ("</ssd:Elements>", '<ssd:Component name="again" type="application/x-fmu-sharedlibrary" '
             'source="resources/machine.fmu"/></ssd:Elements>'),
            "machine is a whole machine and stands alone here; there is again, too",
        ),
        (('name="Z.x_a" kind="output"', 'name="Z.x_b" kind="output"'), "machine.Z.x_b: machine.fmu has no such"),
    ],
    ids=["connected", "two", "connector"],
)  # fmt: skip
def test_what_is_refused(one: Path, tmp_path: Path, change: tuple[str, str], told: str) -> None:
    broken = edited(one, tmp_path / "broken.ssp", STRUCTURE, change)
    with pytest.raises(InputError, match=re.escape(told)), ssp.open_system(broken):
        pass


PARAMETERS = """<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>
<ssv:ParameterSet version="1.0" name="given" xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues">
<ssv:Parameters>{}</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding>
</ssd:ParameterBindings></ssd:Component>"""


def given(one: Path, out: Path, name: str, value: str) -> Path:
    parameter = f'<ssv:Parameter name="{name}">{value}</ssv:Parameter>'
    return edited(one, out, STRUCTURE, ("</ssd:Component>", PARAMETERS.format(parameter)))


def test_parameters_of_the_file_count_over_the_archives(one: Path, short: Path, fmus: Path, tmp_path: Path) -> None:
    changed = given(one, tmp_path / "changed.ssp", "Z.drive.K_v", '<ssv:Real value="50" unit="1/s"/>')
    here = judge_run(cosim.run(scenario.load(short, ["machine.axes.Z.drive.K_v=50 1/s"]), fmus=fmus))
    with ssp.open_system(changed) as found:
        there = judge_run(cosim.run(found.scenario, program=found.program, fmus=found.fmus))
    assert list(there.trace["Z.x_a"]) == list(here.trace["Z.x_a"])


@pytest.mark.parametrize("name", ["motion.built_in", "coupling.friction"])
def test_what_feedsim_cannot_run_of_it(one: Path, tmp_path: Path, name: str) -> None:
    broken = given(one, tmp_path / "broken.ssp", name, '<ssv:Boolean value="false"/>')
    with pytest.raises(InputError, match=rf"machine\.{name} is false; true is needed"), ssp.open_system(broken):
        pass
