"""The default machine's plant with a grid of poses, against the machine with all modes whose springs change.

A short move in Z (40 mm from rest to rest) with cells that are crossed under acceleration. The reference and what
drives the plant are those of benchmarks/pose_grid.py, which does the same over the whole travel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pose_grid as study
import pose_reference
import pytest
from numpy.typing import NDArray

from feedsim.scenario import Machine
from feedsim.scenario.structure import GeometryStructure
from feedsim.scenario.structure_checks import load_structure
from feedsim.simulation import judge
from feedsim.structure.poses import grid_axis, pose_grid
from fmi_helpers import Archive, Instance

pytestmark = pytest.mark.extensive

Floats = NDArray[np.float64]

START, END = 0.3, 0.34
COUNTS = (1, 2, 4)
H = 125e-6


@dataclass(frozen=True, eq=False)
class Case:
    machine: Machine
    plants: Mapping[int, Path]
    recorded: study.Recorded
    run: judge.JudgedRun
    errors: Mapping[int, Mapping[str, float]]
    driven: Mapping[int, study.Driven]
    check: Mapping[str, float]


@pytest.fixture(scope="module")
def case(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Case:
    folder = tmp_path_factory.mktemp("poses")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FEEDSIM_FMUS", str(fmus))
        plan = study.load(folder, START, END, 30.0, 0.1)
        structure = load_structure(study.MACHINE / "structure.yaml")
        assert isinstance(structure, GeometryStructure)
        pose = dict(plan.machine.pose)
        plants = {
            count: study.packed(
                plan.machine, pose_grid(structure, pose, [grid_axis("Z", START, END, (END - START) / count)]), folder
            )
            for count in COUNTS
        }
        recorded, simulated = study.record(plan, plants[COUNTS[-1]])
        run = judge.judge_run(simulated)
        expected, check = (
            pose_reference.run(
                structure, pose, "Z", recorded.position, recorded.torque, H, np.linspace(START, END, count + 1)
            )
            for count in (48, 24)
        )
        driven = {count: study.drive(plant, plan.machine, recorded) for count, plant in plants.items()}
        errors = {count: study.errors(each.outputs, expected, recorded) for count, each in driven.items()}
        return Case(plan.machine, plants, recorded, run, errors, driven, study.errors(check, expected, recorded))


def test_the_error_falls_as_the_grid_is_refined(case: Case) -> None:
    # Cells of 40, 20 and 10 mm. K is wrong by what it changes over half a cell at most, so that the error halves.
    errors = [case.errors[count]["x_a rms"] for count in COUNTS]
    assert errors[1] < 0.7 * errors[0]
    assert errors[2] < 0.7 * errors[1]
    # The tool hears the crossings themselves, which come oftener with finer cells: it gains more slowly in the end.
    assert case.errors[2]["tool rms"] < 0.7 * case.errors[1]["tool rms"]
    assert case.errors[4]["tool rms"] < case.errors[2]["tool rms"]
    # The reference, of first order too, is in error by about what it differs from one with half as many cells.
    for key in ("x_a rms", "tool rms"):
        assert case.check[key] < 0.5 * case.errors[4][key]
    assert case.errors[1]["x_a max"] > 30.0  # [nm]: there is something to be seen


def test_what_a_crossing_costs(case: Case) -> None:
    for count in COUNTS[1:]:
        driven = case.driven[count]
        assert len(driven.lost) == count - 1
        # x_a would jump by nanometres, and goes on to rounding of 0.4 m.
        assert 1e-11 < driven.monitors["pose.held"] < 1e-8
        assert driven.monitors["pose.jump_x_a"] < 1e-15
        assert driven.monitors["pose.jump_n_a"] < 1e-5
        assert driven.monitors["pose.jump_tool"] < 1e-7
        # A moving mass of 435 kg at some 0.3 m/s has 20 J; under 50 N.m some 0.02 J are in the springs, which change by
        # a per cent from cell to cell.
        assert 0 < driven.lost[:, 0].max() < 1e-9 * 20
        assert np.abs(driven.lost[:, 1]).max() < 1e-2 * 0.02
    assert not len(case.driven[1].lost)


def test_the_run_tells_how_the_plant_followed(case: Case) -> None:
    pose = case.run.pose
    assert [(axis.axis, len(axis.centres)) for axis in pose.grid] == [("Z", 4)]
    assert pose.crossings is not None
    assert pose.crossings.count == 3
    assert pose.crossings.jump_x_a < 1e-15
    assert pose.crossings.held > 0
    assert "Z" not in [axis.axis for axis in pose.change.axes]
    assert not [warning for warning in case.run.warnings if "pose" in warning]


def _drive(unit: Instance, values: Floats) -> bytes:
    names = ["X.x_a", "Y.x_a", "Z.x_a", "Z.n_a", "tool.x_Y", "pose.E_kin_lost", "pose.E_el_lost", "pose.held"]
    return unit.run(H, ["X.M_a", "Y.M_a", "Z.M_a"], values, names).tobytes()


def test_a_state_saved_before_a_crossing_replays_bit_for_bit(case: Case, tmp_path: Path) -> None:
    archive = Archive.unpack(case.plants[4], tmp_path / "plant")
    values = np.ascontiguousarray(case.recorded.torque.T)
    start = {f"{axis}.x_0": x for axis, x in case.machine.pose.items()}
    boundary = START + (END - START) / 4
    before = int(np.argmax(case.recorded.position > boundary)) - 20
    with archive.instance(start) as unit, archive.instance(start) as other:
        _drive(unit, values[: before + 1])
        assert unit.get("pose.held") == 0
        state, content, time = unit.state(), unit.serialized(), unit.time
        first = _drive(unit, values[before : before + 200])
        assert unit.get("pose.held") > 0
        after = unit.serialized()
        unit.restore(state)
        assert _drive(unit, values[before : before + 200]) == first
        assert unit.serialized() == after
        other.restore_serialized(content, time)
        assert _drive(other, values[before : before + 200]) == first


def test_an_axis_at_rest_on_a_boundary_crosses_once_at_most(
    case: Case, fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In closed loop: it overshoots, rings and creeps by micrometres about the boundary, well within 0.1 mm."""
    monkeypatch.setenv("FEEDSIM_FMUS", str(fmus))
    boundary = START + (END - START) / 4
    plan = study.load(tmp_path, START, boundary, 20.0, 0.2)
    _, simulated = study.record(plan, case.plants[4])
    run = judge.judge_run(simulated)
    assert run.pose.crossings is not None
    assert run.pose.crossings.count <= 1
    rest = run.trace["Z.x_a"][run.trace.time > run.program.segments[0].end]
    assert rest.min() < boundary < rest.max()
