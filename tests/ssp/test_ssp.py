"""A scenario as an SSP file and back: nothing is lost on the way, and what is changed in the file counts."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import ssp_helpers
from feedsim import analysis, scenario
from feedsim.foundation.errors import Finding
from feedsim.scenario.structure_checks import load_structure
from feedsim.simulation import cosim, nc, ssp
from feedsim.simulation.judge import JudgedRun, judge_run
from feedsim.simulation.ssp.opened import OpenedSystem
from ssp_helpers import ROOT, STRUCTURE, edited, run_ssp, short_scenario


def run_scenario(file: Path, fmus: Path, *overrides: str) -> JudgedRun:
    return judge_run(cosim.run(scenario.load(file, overrides), fmus=fmus))


def assert_same(one: JudgedRun, other: JudgedRun) -> None:
    """To the last bit."""
    assert list(one.trace.columns) == list(other.trace.columns)
    assert np.array_equal(one.trace.time, other.trace.time)
    for name in one.trace.columns:
        assert np.array_equal(one.trace[name], other.trace[name]), name
    assert one.warnings == other.warnings


@pytest.mark.parametrize("overrides", [(), ("coupling.scheme=parallel",), ("recording.interval=250 us",)], ids=str)
def test_it_runs_as_the_scenario_does(short: Path, exported: Path, fmus: Path, overrides: tuple[str, ...]) -> None:
    here, there = run_scenario(short, fmus, *overrides), run_ssp(exported, *overrides)
    assert_same(here, there)
    assert analysis.evaluate(here) == analysis.evaluate(there)
    assert here.program.segments == there.program.segments
    for axis, other in zip(here.scenario.machine.axes.values(), there.scenario.machine.axes.values(), strict=True):
        assert axis.friction == other.friction
        assert axis.drive.parameters() == other.drive.parameters()  # band_stop is second_order by another name
        assert axis.model_dump(exclude={"drive", "friction"}) == other.model_dump(exclude={"drive", "friction"})
    assert here.scenario.machine.cycles == there.scenario.machine.cycles
    assert here.scenario.motions == there.scenario.motions


@pytest.mark.parametrize(
    "text",
    [
        "name: one axis\nmachine: {machine}\nmotions: [{{kind: move, by: {{X: 1 mm}}, feed: 3 m/min}}]\n"
        "set: {{machine.structure: null}}\n",
        "name: one axis\nnote: 'ä < & \"'\nmachine: {machine}\nmotions: [{{kind: dwell, duration: 20 ms}}]\n"
        "logging: {{interval: 1 ms, axes: [X]}}\nset: {{machine.structure: null}}\n",
    ],
    ids=["move", "dwell, note, log"],
)
def test_a_machine_with_one_axis(text: str, fmus: Path, tmp_path: Path) -> None:
    file = short_scenario(tmp_path, "one_axis", text)
    done = ssp.export(scenario.load(file), tmp_path / "one.ssp", fmus=fmus)
    assert set(done.instances) == {"plant", "setpoint", "controller_X", "friction_X"}
    here, there = run_scenario(file, fmus), run_ssp(done.path)
    assert_same(here, there)
    assert here.scenario.note == there.scenario.note
    if here.log is not None:
        assert there.log is not None
        assert all(np.array_equal(here.log[name], there.log[name]) for name in here.log.columns)


def test_recorded_setpoints_travel_along(fmus: Path, tmp_path: Path) -> None:
    file = ROOT / "scenarios" / "z_measured.yaml"
    loaded = scenario.load(file)
    done = ssp.export(loaded, tmp_path / "z_measured.ssp", fmus=fmus)
    with ssp.open_system(done.path) as found:
        planned = nc.plan(loaded)
        assert [s.kind for s in found.program.segments] == [s.kind for s in planned.segments]
        for axis in loaded.machine.axes:
            assert np.array_equal(found.program.x_s[axis], planned.x_s[axis])
            assert np.array_equal(found.program.n_ffw[axis], planned.n_ffw[axis])
        assert not found.warnings


def test_a_machine_with_a_plant_of_its_own(short: Path, fmus: Path, tmp_path: Path) -> None:
    """A plant archive that the machine names is taken as it is."""
    from feedsim.structure.pack import pack

    machine = scenario.load(short).machine
    pose = {axis: machine.pose[axis] for axis in machine.axes}
    pack(fmus / "plant.fmu", tmp_path / "own.fmu", modes=machine.modes, pose=pose, name="own", trial=False)
    override = f"machine.plant={tmp_path / 'own.fmu'}"
    done = ssp.export(scenario.load(short, [override]), tmp_path / "own.ssp", fmus=fmus)
    assert ssp_helpers.contents(done.path)["resources/plant.fmu"] == (tmp_path / "own.fmu").read_bytes()
    assert_same(run_scenario(short, fmus, override), run_ssp(done.path))


def test_the_structure_travels_along(exported: Path, fmus: Path, tmp_path: Path) -> None:
    """As geometry, from which the report says what other poses change; a table of modes alone has none."""
    loaded = scenario.load(ROOT / "scenarios" / "z_positioning.yaml")
    done = ssp.export(loaded, tmp_path / "z.ssp", fmus=fmus)
    with ssp.open_system(done.path) as found:
        here, there = loaded.machine.structure, found.scenario.machine.structure
        assert here is not None
        assert there is not None
        assert load_structure(here) == load_structure(there)
    assert "resources/structure.yaml" not in ssp_helpers.contents(exported)


def test_an_edited_value_counts_like_set(short: Path, exported: Path, fmus: Path, tmp_path: Path) -> None:
    """Double friction F_C, with a text editor: the same as --set, and not the same as before."""
    file = edited(
        exported, tmp_path / "edited.ssp", "resources/friction_Z.ssv",
        ('name="F_C">\n      <ssv:Real value="1.6"', 'name="F_C">\n      <ssv:Real value="3.2"'),
        ('name="F_S">\n      <ssv:Real value="2.1"', 'name="F_S">\n      <ssv:Real value="4.2"'),
    )  # fmt: skip
    changed = run_ssp(file)
    there = run_scenario(short, fmus, "machine.axes.Z.friction.F_C=3.2 N.m", "machine.axes.Z.friction.F_S=4.2 N.m")
    assert_same(changed, there)
    before = run_ssp(exported)
    assert np.abs(changed.trace["Z.M_fr"] - before.trace["Z.M_fr"]).max() > 1.0  # N.m
    assert_same(run_ssp(exported, "machine.axes.Z.friction.F_S=4.2 N.m", "machine.axes.Z.friction.F_C=3.2 N.m"), there)


@pytest.mark.parametrize(
    ("instance", "old", "new", "override"),
    [
        ("friction_Z", '"1.6" unit="N.m"', '"1600" unit="mN.m"', None),
        ("friction_Z", '"0.6" unit="rad/s"', '"0.5" unit="rad/s"', "machine.axes.Z.friction.v_s=0.5 rad/s"),
        ("controller_Z", '"602.0" unit="Hz"', '"0.61" unit="kHz"', "machine.axes.Z.drive.filter_1.f=610 Hz"),
        ("controller_Z", '"0.012" unit="s"', '"15" unit="ms"', "machine.axes.Z.drive.T_n=15 ms"),
        ("controller_Z", '"80.0" unit="N.m"', '"70.0"', "machine.axes.Z.drive.M_max=70 N.m"),
        ("controller_Z", 'Boolean value="true"', 'Boolean value="0"', "machine.axes.Z.drive.ramp_speed_setpoint=false"),
        ("plant", 'Real value="0.0" unit="N.m"', 'Real value="2" unit="N.m"', "machine.axes.X.constant_load=2 N.m"),
        ("friction_Z", '"0.04" unit="rad"', '"3" unit="furlong"', "machine.axes.Z.friction.W=0.06 rad"),
    ],
    ids=["other unit", "value", "kHz", "ms", "no unit", "Boolean", "load", "unit that the file defines"],
)
def test_values_as_other_tools_write_them(
    short: Path, exported: Path, fmus: Path, tmp_path: Path, instance: str, old: str, new: str, override: str | None
) -> None:
    name = f"resources/{instance}.ssv"
    changes = [(old, new)]
    if "furlong" in new:
        changes.append(
            ("<ssv:Units>", '<ssv:Units><ssc:Unit name="furlong"><ssc:BaseUnit rad="1" factor="0.02"/></ssc:Unit>')
        )
    file = edited(exported, tmp_path / "other.ssp", name, *changes)
    assert_same(run_ssp(file), run_scenario(short, fmus, *([override] if override else [])))


def _inline(text: str, values: str) -> str:
    binding = '<ssd:ParameterBinding source="resources/friction_Z.ssv" />'
    assert binding in text
    inline = values.partition("?>")[2]
    return text.replace(
        binding, f"<ssd:ParameterBinding><ssd:ParameterValues>{inline}</ssd:ParameterValues></ssd:ParameterBinding>"
    )


def test_parameters_inside_the_system_structure(exported: Path, tmp_path: Path) -> None:
    files = ssp_helpers.contents(exported)
    values = files.pop("resources/friction_Z.ssv").decode()
    files[STRUCTURE] = _inline(files[STRUCTURE].decode(), values.replace('"1.6"', '"2.0"')).encode()
    inside = ssp_helpers.write(tmp_path / "inline.ssp", files)
    assert_same(run_ssp(inside), run_ssp(exported, "machine.axes.Z.friction.F_C=2 N.m"))


def test_parameters_of_the_system_count_over_those_of_a_component(exported: Path, tmp_path: Path) -> None:
    values = (
        '<ssd:ParameterBindings><ssd:ParameterBinding prefix="friction_Z."><ssd:ParameterValues>'
        '<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" '
        'name="x"><ssv:Parameters><ssv:Parameter name="F_C"><ssv:Real value="2.0"/></ssv:Parameter></ssv:Parameters>'
        "</ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"
    )
    start = '<ssd:System name="system">'
    file = edited(exported, tmp_path / "system.ssp", STRUCTURE, (start, start + values))
    assert_same(run_ssp(file), run_ssp(exported, "machine.axes.Z.friction.F_C=2 N.m"))


def test_a_missing_parameter_is_the_units_start_value(exported: Path, tmp_path: Path) -> None:
    """The start values of the units are those of the default machine's Z axis."""
    files = ssp_helpers.contents(exported)
    del files["resources/friction_Z.ssv"]
    binding = '<ssd:ParameterBinding source="resources/friction_Z.ssv" />'
    text = files[STRUCTURE].decode()
    before, _, after = text.partition(binding)
    before, after = before.rpartition("<ssd:ParameterBindings>")[0], after.partition("</ssd:ParameterBindings>")[2]
    files[STRUCTURE] = (before + after).encode()
    assert_same(run_ssp(ssp_helpers.write(tmp_path / "less.ssp", files)), run_ssp(exported))


def test_names_and_order_of_instances_do_not_matter(exported: Path, tmp_path: Path) -> None:
    files = ssp_helpers.contents(exported)
    text = files[STRUCTURE].decode()
    for old, new in {
        "controller_X": "Antrieb 1",
        "friction_Z": "reib.z",
        "plant": "Maschine",
        "setpoint": "NC",
    }.items():
        for attribute in ("name", "startElement", "endElement"):
            text = text.replace(f'{attribute}="{old}"', f'{attribute}="{new}"')
    head, _, rest = text.partition("<ssd:Elements>")
    elements, _, tail = rest.partition("</ssd:Elements>")
    parts = [part + "</ssd:Component>" for part in elements.split("</ssd:Component>")[:-1]]
    turned = "".join(reversed(parts))
    text = f"{head}<ssd:Elements>{turned}</ssd:Elements>{tail}"
    swap = 'startElement="Maschine" startConnector="X.x_a" endElement="Antrieb 1" endConnector="x_a"'
    assert swap in text  # start and end of a connection say nothing about its direction
    text = text.replace(
        swap, 'startElement="Antrieb 1" startConnector="x_a" endElement="Maschine" endConnector="X.x_a"'
    )
    files[STRUCTURE] = text.encode()
    assert_same(run_ssp(ssp_helpers.write(tmp_path / "renamed.ssp", files)), run_ssp(exported))


def without_annotation(text: str) -> str:
    before, _, rest = text.partition('<ssc:Annotation type="feedsim.scenario">')
    assert rest
    return before + rest.partition("</ssc:Annotation>")[2]


def test_without_the_annotation_the_signals_are_the_same(exported: Path, tmp_path: Path) -> None:
    """A tool that drops annotations: nothing is evaluated, and the rest is as it was."""
    bare = ssp_helpers.altered(exported, tmp_path / "bare.ssp", STRUCTURE, without_annotation)
    one, other = run_ssp(exported), run_ssp(bare)
    assert_same(one, other)
    assert other.scenario.evaluate == ()
    (segment,) = other.program.segments
    assert (segment.kind, segment.axes) == ("setpoints", ("Z",))


def test_without_release_the_drives_are_enabled(exported: Path, tmp_path: Path) -> None:
    """A file whose controllers' release nothing drives, as where somebody's own control gives the setpoints."""

    def unconnected(text: str) -> str:
        kept = [line for line in text.splitlines() if 'endConnector="release"' not in line]
        assert len(text.splitlines()) - len(kept) == 3
        return "\n".join(kept)

    assert_same(
        run_ssp(ssp_helpers.altered(exported, tmp_path / "bare.ssp", STRUCTURE, unconnected)), run_ssp(exported)
    )


def with_stop(exported: Path, out: Path, stop: float, start: float = 0.0) -> Path:
    def change(text: str) -> str:
        text, changed = re.subn(
            'startTime="0.0" stopTime="[0-9.]+"', f'startTime="{start!r}" stopTime="{stop!r}"', text
        )
        assert changed == 1
        return text

    return ssp_helpers.altered(exported, out, STRUCTURE, change)


def test_a_longer_experiment(exported: Path, tmp_path: Path) -> None:
    """The axes rest behind the end of the table; the evaluation stays, and nothing is to be warned of."""
    one = run_ssp(exported)
    longer = with_stop(exported, tmp_path / "longer.ssp", one.program.duration + 0.1)
    with ssp.open_system(longer) as found:
        assert found.warnings == ()
        assert found.program.segments == one.program.segments
        assert found.scenario.evaluate == one.scenario.evaluate != ()
    other = run_ssp(longer)
    for name in one.trace.columns:
        assert np.array_equal(one.trace[name], other.trace[name][: len(one.trace.time)]), name
    overshoot = "Z.overshoot"
    assert analysis.evaluate(one)[overshoot] == analysis.evaluate(other)[overshoot]


@pytest.mark.parametrize(("stop", "left", "evaluated"), [(0.05, 1, False), (0.2, 2, True)])
def test_a_shorter_experiment(exported: Path, tmp_path: Path, stop: float, left: int, evaluated: bool) -> None:
    """The stop time counts: motions are cut there, and what is no longer driven to its end is not evaluated."""
    whole = run_ssp(exported)
    file = with_stop(exported, tmp_path / "shorter.ssp", stop)
    with ssp.open_system(file) as found:
        assert found.program.duration == pytest.approx(stop, abs=1e-12)  # a multiple of 1 ms
        assert len(found.program.segments) == left
        assert found.program.segments[:-1] == whole.program.segments[: left - 1]
        assert found.program.segments[-1].end == found.program.duration
        assert bool(found.scenario.evaluate) == evaluated
        assert [finding.code for finding in found.warnings] == ["evaluation-left-out"] * (not evaluated)
        assert evaluated or "too early for evaluate.0 (positioning of Z, to 0." in found.warnings[0].text
        analysis.check(found.scenario, found.program)
    part = run_ssp(file)
    for name in part.trace.columns:
        assert np.array_equal(part.trace[name], whole.trace[name][: len(part.trace.time)]), name


def test_every_stop_time_can_be_run(exported: Path, tmp_path: Path) -> None:
    """Also those just ahead of and behind the ends of motions and rests."""
    with ssp.open_system(exported) as found:
        move, rest = (segment.end for segment in found.program.segments)
    for stop in (0.001, move - 0.001, move, move + 0.001, move + 0.049, move + 0.051, rest - 0.001, rest, rest + 0.001):
        with ssp.open_system(with_stop(exported, tmp_path / "x.ssp", round(stop, 3))) as found:
            analysis.check(found.scenario, found.program)
            assert bool(found.scenario.evaluate) != bool(found.warnings)


def test_the_rest_that_an_evaluation_needs() -> None:
    from feedsim.analysis.positioning import MIN_REST_TIME
    from feedsim.simulation.ssp import setpoints

    assert setpoints.EVALUATED_REST == MIN_REST_TIME


def test_an_experiment_that_starts_late(exported: Path, tmp_path: Path) -> None:
    """Setpoints begin with the experiment; results count from its start, and a warning says so."""
    end = run_ssp(exported).program.duration
    late = with_stop(exported, tmp_path / "late.ssp", 1000.0 + end, 1000.0)
    assert_same(run_ssp(exported), run_ssp(late))
    with ssp.open_system(late) as found:
        (finding,) = found.warnings
        assert (finding.code, finding.place) == ("start-time-shifted", "late.ssp")
        assert "their 0 s is its 1000 s" in finding.text


def test_rows_are_those_that_the_unit_plays(exported: Path, tmp_path: Path) -> None:
    """At instants just ahead of rows, for steps of several lengths: with the unit's own slack."""
    from feedsim.simulation.cosim.archive import Archive
    from feedsim.simulation.cosim.operations import Interpreter, do_step
    from feedsim.simulation.cosim.unit import Unit
    from feedsim.simulation.ssp.setpoints import SETPOINTS_IN_ARCHIVE, read_setpoints

    file = tmp_path / "setpoint.fmu"
    file.write_bytes(ssp_helpers.contents(exported)["resources/setpoint.fmu"])
    with Archive(file) as archive:
        table = read_setpoints((archive.directory / SETPOINTS_IN_ARCHIVE).read_bytes(), "table")
        both = set()
        for step in (1.25e-4, 1e-3, 1e-6):
            for ahead in (0.0, 1e-10, 1e-9, 1.9e-9, 2.1e-9, 5e-9, 9e-9, 1.1e-8, 1e-6, 1.2e-5):
                time = table.time[[3, 57, 200]] - ahead
                rows = table.rows(time, step)
                for t, row in zip(time, rows, strict=True):
                    unit = Unit(archive, "setpoint")
                    unit.enter_initialisation(0.0, 1.0)
                    unit.exit_initialisation()
                    begin = float(t) - step
                    Interpreter([do_step(unit, 0.0, begin), do_step(unit, begin, step)], 1.0).run(0, 1)
                    assert unit.value("row") == row, (step, ahead, t)
                    unit.close()
                both |= set((rows - [3, 57, 200]).tolist())
        assert both == {0, -1}


def test_what_is_wrong_stays_so_in_an_ssp() -> None:
    file = Path("a.ssp")
    found = OpenedSystem(None, None, file, Path("there"), (), {"plant.fmu": "resources/plant.fmu"})  # type: ignore[arg-type]
    archive = str(Path("there") / "plant.fmu")
    (told,) = found.all_findings([Finding("unit-warns", "wrong", f"{archive}: bad", archive)])
    assert told == Finding("unit-warns", "wrong", "a.ssp: resources/plant.fmu: bad", "a.ssp: resources/plant.fmu")


def test_written_anew_by_another_tool(exported: Path, tmp_path: Path) -> None:
    """pyssp-standard reads every document and writes it as it writes its own: nothing is lost."""
    pytest.importorskip("pyssp_standard")
    from pyssp_standard.ssd import SSD
    from pyssp_standard.ssv import SSV

    files = ssp_helpers.contents(exported)
    for name in (STRUCTURE, *(name for name in files if name.endswith(".ssv"))):
        file = tmp_path / Path(name).name
        file.write_bytes(files[name])
        with (SSD if name == STRUCTURE else SSV)(str(file), "a"):
            pass
        assert file.read_bytes() != files[name]
        files[name] = file.read_bytes()
    one, other = run_ssp(exported), run_ssp(ssp_helpers.write(tmp_path / "anew.ssp", files))
    assert_same(one, other)
    assert one.scenario.evaluate == other.scenario.evaluate
