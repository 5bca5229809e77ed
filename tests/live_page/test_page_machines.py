"""Pages of other machines: one axis, five, measured ones; and what no page is made of."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim import cli, scenario
from feedsim.foundation.errors import InputError
from feedsim.report.live_page import content as module
from feedsim.report.live_page import write
from feedsim.report.live_page.content import content
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim import fmus_directory
from feedsim.simulation.judge import judge_run
from live_page.test_page_numbers import SAME, settings
from machine_helpers import write_machine, write_scenario
from page_helpers import NODE, answers, without_loops

MODULE = fmus_directory() / "machine.wasm"
pytestmark = pytest.mark.skipif(not MODULE.is_file(), reason="no module of the machine (make page-module)")
SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
REST = {"kind": "dwell", "duration": "0.2 s"}


def move(feed: str, **by: str) -> dict[str, Any]:
    return {"kind": "move", "by": by, "feed": feed}


def written(name: str, folder: Path) -> Path:
    """A short move on a machine."""
    recorded = {"recording": {"interval": "1 ms"}}
    if name == "five axes":
        machine = write_machine(folder, dict.fromkeys("XYZBC", 0.1))
        return write_scenario(folder, machine, [move("3000 mm/min", X="5 mm", C="3 mm"), REST], **recorded)
    motions = [REST, move("1000 mm/min", X="4 mm"), REST]
    return write_scenario(folder, SCENARIOS / "machines" / name / "machine.yaml", motions, **recorded)


@pytest.mark.skipif(NODE is None, reason="no node on this machine (Debian: apt install nodejs)")
@pytest.mark.parametrize("name", ["one_axis", "five axes", "emps", "sinumerik_840d"])
def test_machines_of_other_axes_compute_a_run(name: str, tmp_path: Path) -> None:
    given = scenario.load(written(name, tmp_path))
    program = nc.plan(given)
    data = content(given, program).data
    keep = [f"{axis}.x_a" for axis in given.machine.axes]
    state = [knob["value"] for knob in data["knobs"]]
    page = answers(data, [{"state": state, "keep": keep}], tmp_path)[0]
    assert "problem" not in page
    run = judge_run(cosim.run(given, program=program))
    for column in keep:
        assert np.abs(np.array(page["trace"][column]) - run.trace[column]).max() <= SAME
        assert np.ptp(run.trace[column]) >= 0


@pytest.mark.skipif(NODE is None, reason="no node on this machine (Debian: apt install nodejs)")
def test_motions_that_a_page_does_not_plan_are_carried_along(tmp_path: Path) -> None:
    sine = {"kind": "sine", "axis": "X", "moves": [{"amplitude": "1 mm", "frequency": "4 Hz", "periods": 3}]}
    machine = SCENARIOS / "machines" / "one_axis" / "machine.yaml"
    given = scenario.load(write_scenario(tmp_path, machine, [sine, REST], recording={"interval": "1 ms"}))
    held = content(given, nc.plan(given))
    assert not [knob for knob in held.data["knobs"] if knob["motion"]]
    assert "sine" in " ".join(held.left_out)
    page = answers(held.data, [{"state": [k["value"] for k in held.data["knobs"]], "keep": ["X.x_a"]}], tmp_path)[0]
    assert np.abs(np.array(page["trace"]["X.x_a"]) - cosim.run(given).trace["X.x_a"]).max() <= SAME


@pytest.mark.skipif(NODE is None, reason="no node on this machine (Debian: apt install nodejs)")
def test_a_plant_that_follows_its_pose_is_computed_and_its_end_is_said(tmp_path: Path) -> None:
    plant = tmp_path / "plant.fmu"
    machine = SCENARIOS / "machines" / "test_centre"
    packed = ["machine", "pack", str(machine), "--poses", "Z=0mm..150mm/50mm", "--out", str(plant)]
    assert cli.main(packed) == 0
    changes = [f"machine.plant={plant}", "motions.1.duration=0.1 s"]
    given = scenario.load(SCENARIOS / "z_positioning.yaml", changes)
    program = nc.plan(given)
    data = content(given, program).data
    state = [knob["value"] for knob in data["knobs"]]
    page = answers(data, [{"state": state, "keep": ["Z.x_a"]}], tmp_path)[0]
    run = judge_run(cosim.run(given, program=program))
    assert np.abs(np.array(page["trace"]["Z.x_a"]) - run.trace["Z.x_a"]).max() <= SAME
    assert "pose-grid-left" in [finding.code for finding in run.warnings]
    assert sorted(page["warnings"]) == without_loops(run.warnings)


def test_a_page_that_is_too_large_is_refused_with_its_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("feedsim.report.live_page.html.MAX_PAGE_BYTES", 200_000)
    out = tmp_path / "page.html"
    given = scenario.load(SCENARIOS / "one_axis.yaml")
    with pytest.raises(InputError, match=r"its page takes 0\.\d+ MB; allowed are 0\.2 MB"):
        write(judge_run(cosim.run(given)), out)
    assert not out.exists()


@pytest.mark.skipif(NODE is None, reason="no node on this machine (Debian: apt install nodejs)")
def test_effects_are_knobs_whether_the_machine_has_them_or_not(tmp_path: Path) -> None:
    """One of each kind, turned on in the page, against a run with the page's own settings."""
    file = SCENARIOS / "one_axis.yaml"
    indirect = ["machine.axes.X.drive.measuring={indirect: true}", "machine.axes.X.guide={share: 30 %}"]
    wanted = {
        "cogging_1.amplitude": 0.4, "ripple_2.amplitude": 0.03, "measuring.linear": 2e-5, "encoder.eccentricity": 1e-3,
        "periodic_error_1.amplitude": 1e-6, "backlash_compensation.value": 7e-6, "X.play": 9e-6,
        "measuring.indirect": "true", "leadscrew_compensation.e_1": 3e-6, "leadscrew_compensation.spacing": 0.1,
        "geometry.E_XX": 4e-5, "hysteresis.value": 2e-6, "friction.F_C": 0.13, "friction.sigma_0": 400.0,
    }  # fmt: skip
    given = scenario.load(file, indirect)
    data = content(given, nc.plan(given), list(wanted)).data
    state = [next(v for end, v in wanted.items() if knob["key"].endswith(end)) for knob in data["knobs"]]
    assert len(state) == len(wanted)
    keep = ["X.x_a", "tcp.x_X"]
    page = answers(data, [{"state": state, "keep": keep}], tmp_path)[0]
    run = judge_run(cosim.run(scenario.load(file, [*indirect, *settings(data, state)])))
    for column in keep:
        assert np.abs(np.array(page["trace"][column]) - run.trace[column]).max() <= SAME
    assert sorted(page["warnings"]) == without_loops(run.warnings)
    assert np.abs(run.trace["X.x_a"] - cosim.run(given).trace["X.x_a"]).max() > 1e-6
    usual = [knob["key"].partition("X.")[2] for knob in content(given, nc.plan(given)).data["knobs"]]
    drive, friction = ("K_v", "k_ffw", "T_sym", "K_p", "T_n"), ("sigma_0", "F_C", "F_S", "W", "gamma")
    effects = ("drive.measuring.indirect", "drive.backlash_compensation.value")
    axis = {*(f"drive.{name}" for name in drive), *(f"friction.{name}" for name in friction), *effects}
    assert axis == {key for key in usual if key}, "the usual knobs, and the effect that the machine has"


@pytest.mark.skipif(NODE is None, reason="no node on this machine (Debian: apt install nodejs)")
def test_the_play_of_a_transmission_is_a_knob(tmp_path: Path) -> None:
    """Turned in the page, against a run."""
    values = ("stiffness=100 N/um", "damping=3e4 N.s/m", "inertia=0.0005 kg.m^2", "play=2 um")
    machine = [f"machine.axes.X.transmission.{each}" for each in values]
    given = scenario.load(SCENARIOS / "one_axis.yaml", machine)
    data = content(given, nc.plan(given)).data
    keys = [knob["key"] for knob in data["knobs"]]
    assert "machine.axes.X.transmission.play" in keys, "the machine has it, so that it is a usual one"
    assert not [key for key in keys if key.endswith(("transmission.stiffness", "transmission.inertia"))]
    play = [9e-6 if key.endswith("transmission.play") else knob["value"]
            for key, knob in zip(keys, data["knobs"], strict=True)]  # fmt: skip
    keep = ["X.x_a", "X.n_a"]
    page = answers(data, [{"state": play, "keep": keep}], tmp_path)[0]
    run = judge_run(cosim.run(scenario.load(SCENARIOS / "one_axis.yaml", [*machine, *settings(data, play)])))
    for column in keep:  # impacts make more of the last bit than SAME
        assert np.abs(np.array(page["trace"][column]) - run.trace[column]).max() <= 1e-9
    assert sorted(page["warnings"]) == without_loops(run.warnings)
    assert np.abs(run.trace["X.x_a"] - cosim.run(given).trace["X.x_a"]).max() > 1e-7


@pytest.mark.parametrize(
    ("changes", "wanted", "said"),
    [
        (["motions.1.duration=80 s"], [], "allowed are 60 s"),
        ([], ["Q.drive.*"], "fits none of"),
    ],
)
def test_what_no_page_is_made_of(changes: list[str], wanted: list[str], said: str) -> None:
    given = scenario.load(SCENARIOS / "one_axis.yaml", changes)
    with pytest.raises(InputError, match=said):
        content(given, nc.plan(given), wanted)


def test_a_module_of_other_sources_is_refused(tmp_path: Path) -> None:
    guid = "0123456789abcdef-0123456789abcdef"
    with pytest.raises(InputError, match="there is no module"):
        module.read_page_module(tmp_path, guid)
    (tmp_path / "machine.wasm").write_bytes(MODULE.read_bytes())
    with pytest.raises(InputError, match="is of other sources"):
        module.read_page_module(tmp_path, guid)
    (tmp_path / "machine.wasm").write_bytes(b"\0asm\1\0\0\0")
    with pytest.raises(InputError, match="no WebAssembly module that feedsim made"):
        module.read_page_module(tmp_path, guid)
