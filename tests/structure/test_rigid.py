"""Rigid modes: exact, one for each axis, in a definite basis; a count that does not fit is explained."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import qr
from scipy.sparse import block_diag, csc_array

from eigen_models import DEFAULT_DAMPING, LEAD, TWO_PERCENT, Floats, chain, drives, given, stiffened
from feedsim.foundation.errors import InputError
from feedsim.structure.assembly import Assembly
from feedsim.structure.eigenpairs import dense
from feedsim.structure.geometry.assemble import assemble
from feedsim.structure.solve import Solution, definite_basis, definite_signs, remove_strain, solve
from structure_helpers import GIVEN_POSE, default_structure

KHZ = 2 * math.pi * 1000
METHODS = {"dense": 2500, "Lanczos": 0}
NUTS = {"X": 1e8, "Y": 1.3e8, "Z": 1.7e8}


def solved(model: Assembly, method: str = "dense") -> Solution:
    return solve(model, cutoff=KHZ, damping=DEFAULT_DAMPING, dense_limit=METHODS[method])


@pytest.mark.parametrize("method", METHODS)
def test_no_strain_but_rounding(method: str) -> None:
    model = given()
    rigid = solved(model, method).shapes[:, :3]
    strain = np.abs(model.stiffness @ rigid).max(axis=0)
    # Each force is a sum of terms that cancel; a few units in the last place of the largest of them.
    assert np.all(strain <= 1e-15 * (abs(model.stiffness) @ np.abs(rigid)).max(axis=0))
    assert np.abs(rigid.T @ (model.mass @ rigid) - np.eye(3)).max() <= 1e-13


def test_cleaning_takes_the_strain_out() -> None:
    # Elastic modes are mixed into the rigid ones on purpose, far above rounding.
    model = given()
    pairs = dense(model, (KHZ / 10) ** 2)
    rigid, elastic = pairs.shapes[:, :3], pairs.shapes[:, 3:]
    spoiled = rigid + 1e-6 * elastic[:, [0, 40, 400]]
    # With the modes up to 1000 Hz known, as Lanczos leaves it: the last one mixed in is none of those.
    found = remove_strain(model, pairs, spoiled, elastic[:, :90], pairs.values[3:93])
    forces = [np.abs(model.stiffness @ shapes).max() for shapes in (spoiled, found)]
    assert forces[1] < 1e-6 * forces[0]


def test_rotors_turn_in_a_triangle() -> None:
    found = solved(given()).modes
    turn = np.array([found.ports[f"n_{axis}"][:3] for axis in "XYZ"])
    assert np.abs(np.triu(turn, 1)).max() <= 1e-9 * turn.max()
    assert np.all(np.diag(turn) > 0)


def test_frequency_and_damping_are_exactly_zero() -> None:
    found = solved(given()).modes
    assert list(found.frequency[:3]) == [0.0] * 3 == list(found.damping[:3])
    assert found.frequency[3] > 20
    # The leads are those of the pitch, 20 mm.
    assert np.diag(found.leads("XYZ")) == pytest.approx([LEAD] * 3, rel=1e-9)


def test_a_basis_that_the_starting_basis_does_not_change() -> None:
    rng = np.random.default_rng(5)
    shapes, rows = rng.standard_normal((40, 3)), rng.standard_normal((5, 40))
    rotation = qr(rng.standard_normal((3, 3)))[0]
    one, other = definite_basis(shapes, rows), definite_basis(shapes @ rotation, rows)
    assert one == pytest.approx(other, abs=1e-12)
    assert one @ one.T == pytest.approx(shapes @ shapes.T, abs=1e-12)
    # Rows that see nothing, or nothing new, are passed over.
    blind = np.vstack([np.zeros(40), rows[0], 2 * rows[0], rows[1:]])
    assert definite_basis(shapes, blind) == pytest.approx(one, abs=1e-12)
    assert definite_basis(shapes, np.zeros((2, 40))) == pytest.approx(shapes, abs=0)
    assert definite_basis(shapes, rows[:1]).shape == (40, 3)


def test_signs_do_not_hang_on_rounding() -> None:
    shape = np.array([[0.1], [-1.0], [1.0 + 1e-12], [0.3]])
    assert definite_signs(shape, np.ones(4))[1, 0] == 1.0
    assert definite_signs(-shape, np.ones(4))[1, 0] == 1.0
    # By kinetic energy: the third is heavy.
    assert definite_signs(shape, np.array([1.0, 1.0, 4.0, 1.0]))[2, 0] > 0


@pytest.mark.parametrize("method", METHODS)
def test_a_slide_without_nut(method: str) -> None:
    model = drives(nut=NUTS, held=1e7)
    free = stiffened(model, -NUTS["Y"], stretch(3, 2))
    with pytest.raises(InputError) as error:
        solved(free, method)
    assert str(error.value).startswith("drives: 4 rigid modes; one for each of the axes X, Y, Z is needed\n")
    (problem,) = error.value.problems
    assert problem.startswith("a surplus mode at ")
    assert problem.endswith("Hz, in which no rotor turns; what moves: slide Y 100 %; nothing holds it")
    assert float(problem.split()[4]) < 1e-3


def stretch(slide: int, rotor: int) -> Floats:
    """Stretch of a nut's spring of `drives`."""
    vector = np.zeros(7)
    vector[slide], vector[rotor] = 1.0, -LEAD
    return vector


def test_a_blocked_axis() -> None:
    model = drives(nut=NUTS, held=1e7)
    held = np.zeros(7)
    held[5] = 1.0  # slide Z
    with pytest.raises(InputError) as error:
        solved(stiffened(model, 1e6, held))
    (problem,) = error.value.problems
    # 300 kg and the rotor, reflected by the lead, on 1e6 N/m.
    hertz = math.sqrt(1e6 / (300 + 0.01 / LEAD**2)) / (2 * math.pi)
    assert problem.startswith("axis Z cannot move freely: the lowest mode that turns its rotor is at ")
    # The nut's stiffness against the spring's, 1/170 at most, is left out of the estimate.
    assert float(problem.split(" is at ")[1].split()[0]) == pytest.approx(hertz, rel=0.006)
    assert "slide Z" in problem
    assert "2 rigid modes" in str(error.value)


def test_a_blocked_axis_of_the_default_machine_names_bodies() -> None:
    model = assemble(default_structure(), GIVEN_POSE)
    with pytest.raises(InputError) as error:
        solved(stiffened(model, 1e3, model.ports["n_Z"]), "Lanczos")
    (problem,) = error.value.problems
    assert problem.startswith("axis Z cannot move freely")
    assert "rotor Z" in problem
    assert "ram" in problem


def test_a_machine_that_stands_on_nothing() -> None:
    model = drives(nut=NUTS, held=0.0)
    with pytest.raises(InputError) as error:
        solved(model)
    assert "4 rigid modes" in str(error.value)
    assert "what moves: bed 100 %; nothing holds it" in str(error.value)


@pytest.mark.parametrize("bed", [1e7, 0.0])
def test_no_axis_is_free(bed: float) -> None:
    model = drives(nut=NUTS, held=bed)
    for rotor in (0, 2, 4):
        model = stiffened(model, 1e3, np.eye(7)[rotor])
    with pytest.raises(InputError) as error:
        solved(model)
    assert f"{0 if bed else 1} rigid modes" in str(error.value)
    assert [problem[:27] for problem in error.value.problems[:3]] == [f"axis {a} cannot move freely: " for a in "XYZ"]
    assert len(error.value.problems) == (3 if bed else 4)


def test_axes_that_move_only_together() -> None:
    model = drives(nut=NUTS, held=1e7)
    tie = np.zeros(7)
    tie[1], tie[3] = 1.0, -1.0
    with pytest.raises(InputError) as error:
        solved(stiffened(model, 1e8, tie))
    assert error.value.problems == ("axes X, Y, Z do not move independently of one another: 2 of 3 do",)


def test_surplus_and_blocked_at_once_is_not_mistaken_for_right() -> None:
    # Three rigid modes for three axes, but not theirs.
    model = drives(nut=NUTS, held=0.0)
    held = np.zeros(7)
    held[4] = 1.0  # rotor Z
    with pytest.raises(InputError) as error:
        solved(stiffened(model, 1e3, held))
    assert "3 rigid modes; one for each" in str(error.value)
    assert len(error.value.problems) == 2
    assert error.value.problems[0].startswith("axis Z cannot move freely")
    assert "bed 100 %" in error.value.problems[1]


@pytest.mark.parametrize("hertz", [0.02, 0.5])
def test_a_soft_spring_is_no_rigid_mode(hertz: float) -> None:
    # A machine on soft air springs: low, but elastic.
    model = drives(nut=NUTS, held=2000 * (2 * math.pi * hertz) ** 2)
    found = solved(model).modes
    assert np.count_nonzero(found.frequency == 0) == 3
    assert found.frequency[3] == pytest.approx(hertz, rel=1e-6)


def test_the_first_elastic_mode_of_a_fine_mesh_is_not_rigid() -> None:
    # A rod in tension: the strain of the first of 3000 modes cancels to (pi/3000)^2/4 = 3e-7 of its parts.
    n = 3000
    found = solve(chain(np.full(n, 1e-3), np.full(n - 1, 1e9)), cutoff=1e4, damping=TWO_PERCENT).modes
    assert np.count_nonzero(found.frequency == 0) == 1
    assert 2 * np.pi * found.frequency[1] == pytest.approx(2e6 * math.sin(math.pi / (2 * n)), rel=1e-8)


def test_rounded_matrices_are_still_rigid() -> None:
    # 13 digits, as solvers write them: the rigid modes' strain is then 1e-13 of its parts.
    model = given()
    stiffness = model.stiffness.copy()
    stiffness.data = np.array([float(f"{value:.12e}") for value in stiffness.data])
    found = solved(replace(model, stiffness=csc_array((stiffness + stiffness.T) / 2))).modes
    assert np.count_nonzero(found.frequency == 0) == 3
    assert found.frequency[3] == pytest.approx(21.085351173, rel=1e-6)


def test_a_part_that_hangs_loose() -> None:
    model = drives(nut=NUTS, held=1e7)
    loose = csc_array(np.diag([5.0]))
    nothing = csc_array((1, 1))
    ports = {port: np.append(vector, 0.0) for port, vector in model.ports.items()}
    wrong = replace(
        model,
        mass=csc_array(block_diag([model.mass, loose])),
        stiffness=csc_array(block_diag([model.stiffness, nothing])),
        ports=ports,
        labels=(*model.labels, "cover ux"),
    )
    with pytest.raises(InputError, match=r"in which no rotor turns; what moves: cover 100 %"):
        solved(wrong)


@pytest.mark.parametrize("method", METHODS)
def test_a_structure_without_axes_has_no_rigid_modes(method: str) -> None:
    model = given()
    for axis in model.axes:
        model = stiffened(model, 1e4, model.ports[f"n_{axis}"])
    without = replace(model, axes=(), ports={port: b for port, b in model.ports.items() if port.startswith("tcp")})
    frequency = solved(without, method).modes.frequency
    assert frequency.min() > 0
    values = np.linalg.eigvals(np.linalg.solve(model.mass.toarray(), model.stiffness.toarray())).real
    lowest = np.sqrt(np.sort(values)[:20]) / (2 * math.pi)
    # the general eigensolver's error: rounding of the largest eigenvalue, 1e15, seen at the smallest, 1e4
    assert frequency[:20] == pytest.approx(lowest, rel=1e-4)
