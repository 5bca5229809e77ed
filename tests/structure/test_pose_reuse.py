"""Solutions at other poses are found once for all runs that need the same ones; no run can tell whether they were."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from feedsim.scenario import Machine
from feedsim.structure import pose_change, solve
from feedsim.structure.geometry import assemble
from feedsim.structure.pose_change import MIN_POSE_DISTANCE, PoseChange
from scenario_helpers import MACHINE, default_machine

MICROMETRE = 1e-6


def forget() -> None:
    """As in a process that has just started."""
    for cached in (
        pose_change._changes_between,
        pose_change._end,
        pose_change._solve_pose,
        pose_change._modes_of_table,
        assemble.structure_of,
        assemble.assembler_of,
    ):
        cached.cache_clear()


@pytest.fixture
def poses(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[dict[str, float]]]:
    """Poses that modes are calculated of, as they come."""
    solved: list[dict[str, float]] = []
    real = solve.solve

    def spy(assembly: Any, **options: Any) -> Any:
        solved.append(dict(assembly.pose))
        return real(assembly, **options)

    forget()
    monkeypatch.setattr(solve, "solve", spy)
    yield solved
    forget()


def changed(machine: Machine | None = None, **ranges: tuple[float, float]) -> PoseChange:
    return pose_change.pose_change(machine or default_machine(), ranges)


def test_positions_that_differ_by_micrometres_are_solved_once(poses: list[dict[str, float]]) -> None:
    first = changed(X=(0.785, 0.815), Z=(0.085, 0.115))
    assert len(poses) == 5  # the pose and four ends
    again = changed(X=(0.785 - MICROMETRE, 0.815 + MICROMETRE), Z=(0.085 + MICROMETRE, 0.115))
    assert len(poses) == 5
    assert [axis.modes for axis in again.axes] == [axis.modes for axis in first.axes]
    assert [axis.compliances for axis in again.axes] == [axis.compliances for axis in first.axes]
    # What the axes have reached is told as it is.
    assert (again.axes[0].low, again.axes[0].high) == (0.785 - MICROMETRE, 0.815 + MICROMETRE)
    # One end further on, with the other axis as it was.
    changed(X=(0.785, 0.816), Z=(0.085, 0.115))
    assert len(poses) == 6
    assert poses[-1]["X"] == 0.816


def test_each_axis_is_solved_for_by_itself(poses: list[dict[str, float]]) -> None:
    changed(X=(0.785, 0.8))
    assert len(poses) == 2
    changed(Z=(0.085, 0.1), X=(0.785, 0.8))
    assert len(poses) == 3  # one more end; the pose is there


@pytest.mark.parametrize("shift", [0.0, 3e-5, -4e-5])
def test_a_run_alone_says_what_a_run_among_others_does(poses: list[dict[str, float]], shift: float) -> None:
    alone = changed(Z=(0.1, 0.3 + shift))
    forget()
    changed(X=(0.785, 0.815), Z=(0.05, 0.3))  # others before it, whose end is 0.3 m to the rounding
    solved = len(poses)
    assert changed(Z=(0.1, 0.3 + shift)) == alone
    assert len(poses) == solved
    forget()
    assert changed(Z=(0.1, 0.3 + shift)) == alone


def test_rounding_changes_frequencies_by_less_than_is_said() -> None:
    (exact,) = changed(Z=(0.1, 0.3)).axes
    (beyond,) = changed(Z=(0.1, 0.3 + 1e-4)).axes  # the next position: twice what rounding can do
    assert exact.modes != beyond.modes
    for one, other in zip(exact.modes, beyond.modes, strict=True):
        assert other.ends[1] == pytest.approx(one.ends[1], rel=2 * 5e-5)


def test_whether_an_axis_is_near_the_pose_is_decided_by_where_it_goes(poses: list[dict[str, float]]) -> None:
    assert not changed(Z=(0.1, 0.1 + 0.99 * MIN_POSE_DISTANCE)).axes[0].modes
    assert not poses
    assert changed(Z=(0.1, 0.1 + 1.01 * MIN_POSE_DISTANCE)).axes[0].modes


def test_another_pose_and_another_structure_are_noticed(poses: list[dict[str, float]], tmp_path: Path) -> None:
    machine = default_machine()
    (first,) = changed(machine, Z=(0.1, 0.3)).axes
    moved = machine.model_copy(update={"pose": {**machine.pose, "X": 0.4}})
    (other,) = changed(moved, Z=(0.1, 0.3)).axes
    assert len(poses) == 4
    assert [pose["X"] for pose in poses] == [machine.pose["X"]] * 2 + [0.4] * 2
    assert other.modes != first.modes

    file = Path(shutil.copy(MACHINE / "structure.yaml", tmp_path))
    copied = machine.model_copy(update={"structure": file})
    assert changed(copied, Z=(0.1, 0.3)).axes == (first,)
    text = file.read_text(encoding="utf-8")
    heavier = text.replace("rho: 7850 kg/m^3", "rho: 8850 kg/m^3")
    assert heavier != text
    file.write_text(heavier, encoding="utf-8")
    (after,) = changed(copied, Z=(0.1, 0.3)).axes
    assert len(poses) == 8
    assert after.modes != first.modes


def test_many_runs_keep_little(poses: list[dict[str, float]]) -> None:
    for cached in (
        pose_change._changes_between,
        pose_change._end,
        pose_change._solve_pose,
        pose_change._modes_of_table,
    ):
        assert cached.cache_parameters()["maxsize"] in range(1, 257)


def test_the_table_of_modes_is_doubted_once(poses: list[dict[str, float]]) -> None:
    machine = default_machine()
    assert pose_change.table_mismatch(machine) is None
    assert pose_change.table_mismatch(machine) is None
    assert poses == [dict(machine.pose)]
    wrong = machine.model_copy(update={"pose": {**machine.pose, "Z": 0.4}})
    said = pose_change.table_mismatch(wrong)
    assert said is not None
    assert said.code == "modes-stale"
    assert "Z 0.4 m" in said.text
    assert len(poses) == 2
