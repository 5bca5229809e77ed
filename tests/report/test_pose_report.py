"""How far a motion leaves the pose of the plant, what that changes, and what run, report and summary say of it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from feedsim.cli import main
from feedsim.foundation.errors import InputError
from feedsim.motions import Dwell, Move
from feedsim.report.page import html
from feedsim.report.run.files import details
from feedsim.report.run.report import report_of
from feedsim.scenario import Machine
from feedsim.scenario.structure_checks import load_structure
from feedsim.simulation import cosim, judge
from feedsim.simulation.judge import judge_run
from feedsim.structure.geometry.assemble import assemble
from feedsim.structure.pose_change import LARGE_SHIFT, MAX_MODE_FREQUENCY, PoseChange, pose_change, warnings
from report_helpers import positioning_run, write_run
from scenario_helpers import MACHINE, default_machine, scenario
from structure_helpers import default_structure, dense_modes

TRAVEL = (0.0, 0.685)


@pytest.fixture
def units(fmus: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("FEEDSIM_FMUS", str(fmus))
    return fmus


def changed(**ranges: tuple[float, float]) -> PoseChange:
    return pose_change(default_machine(), ranges)


# --- what changes -----------------------------------------------------------------------------------------------------


def test_whole_travel_against_a_dense_solver() -> None:
    change = changed(Z=TRAVEL)
    (axis,) = change.axes
    assert (axis.pose, axis.low, axis.high, axis.distance) == (0.1, *TRAVEL, pytest.approx(0.585))
    structure = default_structure()
    pose = default_machine().pose
    here, at_low, at_high = (dense_modes(assemble(structure, {**pose, "Z": z}))[0] for z in (0.1, *TRAVEL))
    for mode in axis.modes:
        assert 0 < mode.frequency <= MAX_MODE_FREQUENCY
        for found, frequencies in ((mode.frequency, here), (mode.ends[0], at_low), (mode.ends[1], at_high)):
            assert np.min(np.abs(frequencies / found - 1)) < 1e-6
        assert abs(mode.change) == pytest.approx(max(abs(end / mode.frequency - 1) for end in mode.ends))
        assert 0 < mode.mac <= 1 + 1e-9
    # No mode is matched twice.
    for end in (0, 1):
        assert len({mode.ends[end] for mode in axis.modes}) == len(axis.modes)
    assert axis.largest is not None
    assert axis.largest.frequency == pytest.approx(98.3, abs=0.1)
    assert axis.largest.change == pytest.approx(-0.36, abs=0.01)
    assert change.large == (axis,)
    (left,) = warnings(change)
    assert (left.code, left.place) == ("pose-left", "Z")
    assert "moves 585 mm away" in left.text
    assert "98.3 Hz" in left.text
    assert left.remedy.endswith("--poses Z=20mm")


def test_static_compliances_against_the_full_matrices() -> None:
    (axis,) = changed(Z=(0.1, 0.3)).axes
    structure = default_structure()
    for column, z in ((0, 0.1), (1, 0.1), (2, 0.3)):
        assembly = assemble(structure, {**default_machine().pose, "Z": z})
        frequency, shapes = dense_modes(assembly)
        elastic, omega = shapes[:, 3:], 2 * np.pi * frequency[3:]
        n, x = assembly.ports["n_Z"], assembly.ports["x_Z"]
        lead = 0.02 / (2 * np.pi)
        pairs = [(x - lead * n, n), *((assembly.ports[f"tcp_{d}"],) * 2 for d in "XYZ")]
        expected = [float(np.sum((c @ elastic) * (b @ elastic) / omega**2)) for c, b in pairs]
        found = [item.values[column] for item in axis.compliances]
        assert found == pytest.approx(expected, rel=1e-5)  # dense modes of 615 degrees of freedom: rigid part 1e-6


def test_small_motions() -> None:
    circle = changed(X=(0.785, 0.815), Z=(0.085, 0.115))
    assert [axis.distance for axis in circle.axes] == pytest.approx([0.015, 0.015])
    for axis in circle.axes:
        assert axis.modes
        assert axis.largest is not None
        assert abs(axis.largest.change) < 0.01 < LARGE_SHIFT
    assert not circle.large
    assert not warnings(circle)
    near = changed(Z=(0.0995, 0.1005))
    assert near.axes[0].distance == pytest.approx(5e-4)
    assert not near.axes[0].modes
    assert not near.unknown


def test_identical_shapes_where_one_end_is_the_pose() -> None:
    (axis,) = changed(Z=(0.1, 0.2)).axes
    assert all(mode.ends[0] == mode.frequency for mode in axis.modes)
    assert axis.low == 0.1


def without_structure() -> Machine:
    return default_machine().model_copy(update={"structure": None})


@pytest.mark.parametrize(
    ("structure", "reason"),
    [
        (None, "names no structure file"),
        (MACHINE / "nowhere.yaml", "nowhere.yaml"),
        (MACHINE / "machine.yaml", "machine.yaml"),
    ],
)
def test_poses_that_are_not_known_are_said_to_be_so(structure: Path | None, reason: str) -> None:
    machine = default_machine().model_copy(update={"structure": structure})
    change = pose_change(machine, {"Z": TRAVEL})
    assert reason in change.unknown
    assert change.axes[0].distance == pytest.approx(0.585)
    assert not change.axes[0].modes
    assert not warnings(change)
    text = html(report_of(replace(positioning_run(), pose=judge.PoseUse(change)), {}, [], {}, []))
    assert "How much the modes change is not known" in text
    assert "key structure of the machine file" in text


# --- what is said -----------------------------------------------------------------------------------------------------


def part_of(run: judge.JudgedRun) -> Mapping[str, object]:
    part = json.loads(json.dumps(details(run, {}, {}, [])))["pose"]
    assert isinstance(part, dict)
    return part


def test_a_run_with_one_pose(units: Path, tmp_path: Path) -> None:
    plan = scenario(Move(to={"Z": 0.3}, feed=0.5), Dwell(duration=0.05))
    run = judge_run(cosim.run(plan))
    assert run.pose.crossings is None
    (left,) = (finding for finding in run.warnings if finding.code == "pose-left")
    assert (left.place, left.remedy) == ("Z", "feedsim export --plant ... --poses Z=20mm")
    assert "moves 200 mm away" in left.text
    assert judge.check(plan, run.program)[-1] in run.warnings
    write_run(run, {}, tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert 'id="pose"' in text
    assert "Modes over the positions of Z" in text
    assert "Modes over the positions of X" not in text
    part = part_of(run)
    assert part["follows"] == []
    assert part["crossings"] is None
    one_pose = part["one_pose"]
    assert isinstance(one_pose, dict)
    assert one_pose["Z"]["distance"]["value"] == pytest.approx(0.2, abs=1e-6)
    assert one_pose["Z"]["modes"][0]["at_pose"]["unit"] == "Hz"


def test_a_run_that_follows_the_pose(units: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plant = tmp_path / "plant.fmu"
    arguments = ["machine", "pack", str(MACHINE), "--poses", "Z=60mm..240mm/60mm", "--out", str(plant)]
    assert main(arguments) == 0
    assert "follows the pose, 3 cells (3 in Z)" in capsys.readouterr().out
    machine = default_machine().model_copy(update={"plant": plant})
    run = judge_run(cosim.run(scenario(Move(to={"Z": 0.23}, feed=0.5), Dwell(duration=0.05), machine=machine)))
    crossings = run.pose.crossings
    assert crossings is not None
    assert crossings.count == 2
    assert crossings.jump_x_a < 1e-9
    assert crossings.held > crossings.jump_x_a
    assert not run.pose.warnings
    text = html(report_of(run, {}, [], {}, []))
    assert "The plant follows the pose (Z: 3 cells, centres 90 to 210 mm)" in text
    assert "No axis that the plant does not follow moves more than 1 mm" in text
    part = part_of(run)
    assert part["follows"] == [
        {
            "axis": "Z",
            "cells": 3,
            "first": {"value": pytest.approx(0.09), "unit": "m"},
            "last": {"value": pytest.approx(0.21), "unit": "m"},
            "hysteresis": {"value": pytest.approx(6e-4), "unit": "m"},
        }
    ]
    assert isinstance(part["crossings"], dict)
    assert part["crossings"]["count"] == 2
    far = judge_run(cosim.run(scenario(Move(to={"Z": 0.4}, feed=0.5), machine=machine)))
    (left,) = (finding for finding in far.warnings if finding.code == "pose-grid-left")
    assert "(60 mm to 240 mm) by 160 mm" in left.text


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (["Z"], "--poses Z: Z=20mm or Z=0mm..400mm/20mm is the form"),
        (["Z=20"], "20 has no unit"),
        (["A=20mm"], "no axis 'A'; axes are X, Y, Z"),
        (["Z=20mm", "Z=30mm"], "--poses Z=30mm: Z is given twice"),
        (["Z=0mm..900mm/20mm"], "outside of the travel of Z, 0 m to 0.685 m"),
        (["Z=0mm..300mm"], "the size of the cells is missing"),
        (["Z=300mm..200mm/20mm"], "the first must be less"),
        (["Z=0mm"], "more than 0 m is needed"),
        (["Z=1nm"], "at most 20000 are allowed"),
    ],
)
def test_cells_that_are_refused(texts: list[str], message: str) -> None:
    from feedsim.foundation.arguments import as_options, pairs
    from feedsim.jobs.export import POSITIONS_EXAMPLE, grid_axes

    with pytest.raises(InputError) as caught, as_options():
        grid_axes(default_machine(), pairs("poses", texts, f"{POSITIONS_EXAMPLE} is the form"))
    assert message in str(caught.value)


def test_packing_poses_needs_a_structure_that_moves(
    units: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "machine"
    folder.mkdir()
    lines = (MACHINE / "machine.yaml").read_text(encoding="utf-8").splitlines()
    (folder / "machine.yaml").write_text(
        "\n".join(line for line in lines if not line.startswith("structure:")), encoding="utf-8"
    )
    (folder / "modes.csv").write_bytes((MACHINE / "modes.csv").read_bytes())
    out = tmp_path / "plant.fmu"
    assert main(["export", "--plant", str(folder), "--poses", "Z=20mm", "--out", str(out)]) == 2
    assert "has no structure to compute the modes of other poses from" in capsys.readouterr().err
    assert not out.exists()
    assert load_structure(MACHINE / "structure.yaml").kind == "geometry"
