"""What holds at every pose: rigid motion, a mass matrix that stays, springs that change smoothly."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from feedsim.foundation.errors import InputError
from feedsim.structure.assembly import Assembly
from feedsim.structure.geometry.assemble import Assembler, assemble
from structure_helpers import GIVEN_POSE, Floats, default_structure

STRUCTURE = default_structure()
ASSEMBLER = Assembler(STRUCTURE)
TRAVEL = {name: axis.travel for name, axis in STRUCTURE.axes.items()}
CORNERS = [dict(zip(TRAVEL, ends, strict=True)) for ends in product(*TRAVEL.values())]
MOVED = {"X": {"column", "slide", "ram", "screw Y", "screw Z"}, "Y": {"slide", "ram", "screw Z"}, "Z": {"ram"}}
DIRECTIONS = dict(zip("XYZ", np.eye(3), strict=True))


def rigid_motion(assembly: Assembly, axis: str) -> Floats:
    """Everything 1 m along an axis, its screw and rotor turned to match; from the drawing, not from the code."""
    geometry = assembly.geometry
    assert geometry is not None
    u = np.zeros(len(assembly.labels))
    for body, dofs in zip(geometry.bodies, geometry.dofs, strict=True):
        if body in MOVED[axis]:
            u[dofs[:3]] += DIRECTIONS[axis]
        if body == f"screw {axis}":
            u[dofs[3:]] += DIRECTIONS[axis] * 2 * np.pi / 0.020
        if body == f"rotor {axis}":
            u[dofs.max()] = 2 * np.pi / 0.020
    return u


@pytest.mark.parametrize("pose", [GIVEN_POSE, *CORNERS, {"X": 0.123, "Y": 0.456, "Z": 0.6}], ids=str)
def test_rigid_motion_meets_no_stiffness(pose: dict[str, float]) -> None:
    assembly = ASSEMBLER.at(pose)
    largest = np.abs(assembly.stiffness).max()
    for axis in TRAVEL:
        u = rigid_motion(assembly, axis)
        # Rounding of the products that cancel.
        assert np.abs(assembly.stiffness @ u).max() <= 1e-12 * largest * np.abs(u).max()
        assert float(assembly.ports[f"n_{axis}"] @ u) == pytest.approx(2 * np.pi / 0.020, rel=1e-12)
        for other in TRAVEL:
            if other != axis:
                assert float(assembly.ports[f"n_{other}"] @ u) == 0
            assert float(assembly.ports[f"x_{other}"] @ u) == pytest.approx(float(other == axis), abs=1e-12)
            assert float(assembly.ports[f"tcp_{other}"] @ u) == pytest.approx(float(other == axis), abs=1e-12)


def test_there_is_no_other_rigid_motion() -> None:
    for pose in (CORNERS[0], CORNERS[-1]):
        assembly = ASSEMBLER.at(pose)
        lowest = np.linalg.eigvalsh(assembly.stiffness.toarray())[:4]
        # Three of rounding; the fourth is that of the mounts.
        assert np.all(np.abs(lowest[:3]) < 1e-12 * np.abs(assembly.stiffness).max())
        assert lowest[3] > 1e3


def test_mass_does_not_depend_on_the_pose() -> None:
    # Assembled afresh, so that nothing can be left over from the pose before.
    first, *others = (assemble(STRUCTURE, pose).mass.toarray() for pose in (GIVEN_POSE, CORNERS[0], CORNERS[-1]))
    for other in others:
        assert np.array_equal(first, other)


def test_one_assembler_gives_the_same_as_two() -> None:
    ASSEMBLER.at(CORNERS[3])
    again, fresh = ASSEMBLER.at(GIVEN_POSE), assemble(STRUCTURE, GIVEN_POSE)
    assert np.array_equal(again.stiffness.toarray(), fresh.stiffness.toarray())
    assert all(np.array_equal(again.ports[port], fresh.ports[port]) for port in fresh.ports)


def test_stiffness_changes_smoothly_where_a_carriage_passes_a_node() -> None:
    # The carriages on the right pass the middle of the bed, x = 0, at X = 0.885 - 0.52; other springs pass none there.
    node = 0.885 - 0.52
    entry = ASSEMBLER.at({**GIVEN_POSE, "X": node}).labels.index("bed.B0.3 uy")

    def k(X: float) -> float:
        return float(ASSEMBLER.at({**GIVEN_POSE, "X": X}).stiffness[entry, entry])

    def slope(X: float) -> float:
        return (k(X + 1e-5) - k(X - 1e-5)) / 2e-5

    carriage = STRUCTURE.bodies["column"].carriages[0].stiffness
    # B0.3 is 0.4 m before the node. Its share falls to 0 there with slope 0, and in between not at all like that.
    assert abs(slope(node)) < 1e-3 * carriage
    assert abs(slope(node - 0.2)) > carriage


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        ({"X": 1.8, "Y": 0.3, "Z": 0.1}, "X at 1.8 m is outside its travel, 0 to 1.77 m"),
        ({"X": 0.8, "Y": -0.001, "Z": 0.1}, "Y at -0.001 m is outside its travel, 0 to 0.655 m"),
        ({"X": 0.8, "Y": 0.3, "Z": float("nan")}, "Z at nan m is outside its travel, 0 to 0.685 m"),
        ({"X": 0.8, "Y": 0.3}, "the position of axis Z is missing; 0 to 0.685 m is its travel"),
        ({"X": 0.8, "Y": 0.3, "Z": 0.1, "W": 0.0}, "the machine has no axis 'W'; it has X, Y, Z"),
        ({"x": 0.8, "Y": 0.3, "Z": 0.1}, "the machine has no axis 'x'; did you mean 'X'?"),
    ],
)
def test_poses_that_are_refused(pose: dict[str, float], message: str) -> None:
    with pytest.raises(InputError) as caught:
        ASSEMBLER.at(pose)
    assert message in str(caught.value)
