"""Figures of the machines: masses, inertias, leads, coupling limits; the tables of modes that come along."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from feedsim.scenario import load_machine
from feedsim.scenario.load import load_described
from feedsim.scenario.structure_checks import load_structure
from feedsim.structure import read_modes
from feedsim.structure.build import Built, build
from feedsim.structure.info import MachineInfo, info_of_model, info_of_table
from feedsim.structure.pose_change import describe_stale_table
from structure_helpers import GIVEN_POSE, MACHINES

STEP = 125e-6
AXES = ("X", "Y", "Z")


@cache
def built(name: str) -> Built:
    machine = load_machine(MACHINES / name)
    assert machine.structure is not None
    return build(load_structure(machine.structure), machine.pose)


@cache
def info() -> MachineInfo:
    machine = load_machine(MACHINES / "test_centre")
    friction = {name: axis.friction for name, axis in machine.axes.items()}
    return info_of_model(machine.name, machine.note, built("test_centre"), STEP, friction)


def test_masses_of_the_default_machine() -> None:
    # Given to as many digits as are compared: half of the last one.
    assert info().total_mass == pytest.approx(9061.64, abs=0.005)
    assert [axis.moving_mass for axis in info().axes] == pytest.approx([2799, 907, 435], abs=0.5)


def test_inertias_of_the_default_machine() -> None:
    axes = info().axes
    assert tuple(axis.name for axis in axes) == AXES
    assert [axis.J_tot for axis in axes] == pytest.approx([0.08592, 0.02645, 0.01639], abs=5e-6)
    assert [axis.J_inf for axis in axes] == pytest.approx([0.01514, 0.01118, 0.00754], abs=5e-6)
    lead = 0.020 / (2 * math.pi)
    # Rigid modes carry the eigensolver's error, 1e-8 at most.
    assert [axis.lead for axis in axes] == pytest.approx([lead] * 3, rel=1e-7)
    assert [axis.J_moving for axis in axes] == pytest.approx([axis.moving_mass * lead**2 for axis in axes], rel=1e-6)


def test_coupling_limit_and_friction() -> None:
    for axis, sigma in zip(info().axes, (1.2 + 0.010, 1.0 + 0.008, 0.8 + 0.006), strict=True):
        assert axis.coupling_limit == pytest.approx(2 * axis.J_inf / STEP)
        assert axis.friction_slope == pytest.approx(sigma)
    without = info_of_model("", "", built("test_centre"), STEP)
    assert all(math.isnan(axis.friction_slope) for axis in without.axes)


def test_a_table_of_modes_gives_what_it_can() -> None:
    modes = read_modes(MACHINES / "test_centre" / "modes.csv", AXES)
    table = info_of_table("table", "", modes, GIVEN_POSE, STEP)
    for axis, of_model in zip(table.axes, info().axes, strict=True):
        # Table and model are two programs' eigensolutions: 1e-6 is what their frequencies are held to.
        assert axis.J_inf == pytest.approx(of_model.J_inf, rel=1e-6)
        assert axis.J_tot == pytest.approx(of_model.J_tot, rel=1e-6)
        assert math.isnan(axis.moving_mass)
    assert math.isnan(table.total_mass)
    assert table.solution is None


@pytest.mark.parametrize("name", ["test_centre", "one_axis"])
def test_shipped_tables_are_what_the_structures_give(name: str) -> None:
    machine = load_machine(MACHINES / name)
    shipped, found = read_modes(machine.modes.file, list(machine.axes)), built(name).solution.modes
    assert found.frequency == pytest.approx(shipped.frequency, rel=1e-6)
    assert np.array_equal(found.damping, shipped.damping)
    assert describe_stale_table(shipped, found) == ""
    given = np.column_stack([shipped.ports[port] for port in shipped.ports])
    ours = np.column_stack([found.ports[port] for port in shipped.ports])
    size = np.abs(given).max(axis=0)
    size[size == 0] = 1.0  # a tool direction that no mode moves
    given, ours = given / size, ours / size
    rigid = shipped.rigid
    for k in np.flatnonzero(~rigid):
        # Signs are free in no product; 1e-6 is what the frequencies are held to.
        expected = np.outer(given[k], given[k])
        assert np.abs(np.outer(ours[k], ours[k]) - expected).max() <= 1e-6 * np.abs(expected).max(), f"mode {k}"
    expected = given[rigid].T @ given[rigid]
    assert np.abs(ours[rigid].T @ ours[rigid] - expected).max() <= 1e-6 * np.abs(expected).max()


def test_a_table_of_another_structure_is_told() -> None:
    machine = load_machine(MACHINES / "one_axis")
    shipped = read_modes(machine.modes.file, ["X"])
    assert machine.structure is not None
    elsewhere = build(load_structure(machine.structure), {"X": 0.45}).solution.modes
    assert "the structure gives" in describe_stale_table(shipped, elsewhere)
    fewer = build(load_structure(machine.structure), machine.pose, cutoff=2 * math.pi * 300).solution.modes
    assert len(fewer.frequency) < len(shipped.frequency)
    assert describe_stale_table(shipped, fewer) == describe_stale_table(fewer, shipped) == ""  # another cut-off
    corrected = build(
        load_structure(machine.structure), machine.pose, cutoff=2 * math.pi * 300, static_correction=True
    ).solution
    assert corrected.corrections > 0
    assert describe_stale_table(corrected.modes, shipped) == ""
    assert "the structure gives" in describe_stale_table(corrected.modes, elsewhere)
    assert "the structure gives" in describe_stale_table(fewer, elsewhere)


def test_synthetic_drive_of_the_one_axis_machine() -> None:
    """Parameters follow the rules that the file states, from the inertia that the structure gives."""
    axis = load_machine(MACHINES / "one_axis").axes["X"]
    (own,) = info_of_model("", "", built("one_axis"), STEP).axes
    omega = 2 * math.pi * 40
    assert axis.drive.K_p == pytest.approx(own.J_tot * omega, rel=1e-3)  # written with four digits
    assert axis.drive.omega_0 is not None
    assert axis.drive.D is not None
    assert 2 * axis.drive.D / axis.drive.omega_0 == pytest.approx(1 / omega, rel=1e-3)
    assert axis.drive.T_sym == pytest.approx(1 / omega + 1e-3 - 125e-6, abs=1e-6)
    # Left out in the file: no matching, no dead time.
    assert (axis.drive.T_dyn, axis.drive.T_ref) == (0.0, 0.0)


def test_described_machine_names_its_structure() -> None:
    described = load_described(MACHINES / "one_axis")
    assert described.structure is not None
    assert described.machine is not None
    assert described.pose == {"X": 0.3}
    assert [role for role, _ in described.files] == ["machine", "structure"]
    alone = load_described(MACHINES / "one_axis" / "structure.yaml")
    assert (alone.machine, alone.modes, alone.pose) == (None, None, {})
    assert Path(alone.files[0][1]).name == "structure.yaml"
