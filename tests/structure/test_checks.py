"""Checks of a model: each fault with its own message, and none about a model that is right."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fe_models import assembly, chain, geometry
from scipy import sparse

from feedsim.foundation.errors import Finding, InputError
from feedsim.scenario.structure import SI, UnitSystem
from feedsim.structure.assembly import Assembly
from feedsim.structure.build import check, frequency_warnings

MASS, STIFFNESS = chain([100.0, 200.0, 300.0], [4e6, 9e6])
ZEROS = np.zeros(3)


def fault(model: Assembly) -> str:
    with pytest.raises(InputError) as caught:
        check(model)
    return str(caught.value)


def test_a_sound_model_has_neither_faults_nor_warnings() -> None:
    assert check(assembly(MASS, STIFFNESS)) == []


def test_shapes() -> None:
    message = fault(assembly(MASS, STIFFNESS[:2, :2], ports={"n_X": np.ones(2), "x_X": np.ones(3)}))
    assert "the stiffness matrix is 2 by 2; 3 degrees of freedom need 3 by 3" in message
    assert "port n_X: a vector of shape (2,); 3 degrees of freedom need 3 coefficients" in message
    assert "the mass matrix" not in message


def test_nothing_at_all() -> None:
    empty = np.zeros((0, 0))
    model = assembly(MASS, STIFFNESS)
    nothing = sparse.csc_array(empty)
    model = Assembly("model", nothing, nothing, {}, (), (), model.geometry, {})
    assert "there is no degree of freedom in it" in fault(model)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_none(value: float) -> None:
    stiffness = STIFFNESS.copy()
    stiffness[2, 1] = value
    message = fault(assembly(MASS, stiffness))
    assert f"1 entry of the stiffness matrix not finite, the first {value} at (body[2] ux, body[1] ux)" in (message)
    port = np.array([1.0, value, 0.0])
    model = assembly(MASS, STIFFNESS)
    message = fault(assembly(MASS, STIFFNESS, ports={**model.ports, "x_X": port}))
    assert f"port x_X: the coefficient at body[1] ux is {value}" in message


def test_asymmetry_names_the_worst_entry() -> None:
    stiffness = STIFFNESS.copy()
    stiffness[0, 1] *= 1.001
    stiffness[1, 2] *= 1.1
    message = fault(assembly(MASS, stiffness))
    assert "the stiffness matrix is not symmetric" in message
    assert "(body[1] ux, body[2] ux) is -9900000, (body[2] ux, body[1] ux) is -9000000" in message
    assert "triangle" not in message
    # what a sum in another order leaves is no fault
    stiffness = STIFFNESS.copy()
    stiffness[0, 1] *= 1 + 1e-12
    assert check(assembly(MASS, stiffness)) == []


def test_a_single_triangle_is_recognised() -> None:
    message = fault(assembly(MASS, np.triu(STIFFNESS)))
    assert "the stiffness matrix is not symmetric" in message
    assert "only one triangle is filled: a Matrix Market file then says 'symmetric' in its first line" in message


def test_negative_mass_and_stiffness_on_the_diagonal() -> None:
    mass, stiffness = MASS.copy(), STIFFNESS.copy()
    mass[1, 1] = -5.0
    stiffness[2, 2] = -7.0
    message = fault(assembly(mass, stiffness))
    assert "1 degree of freedom has negative mass on the diagonal, down to -5 at body[1] ux" in message
    assert "1 degree of freedom has negative stiffness on the diagonal, down to -7 at body[2] ux" in message


def test_a_pair_coupled_more_than_possible() -> None:
    mass = MASS.copy()
    mass[0, 1] = mass[1, 0] = 150.0  # more than sqrt(100 * 200)
    message = fault(assembly(mass, STIFFNESS))
    assert "the mass matrix is not positive semidefinite: body[0] ux and body[1] ux are coupled by 150" in message
    assert "the stiffness" not in message


def test_coupling_to_something_without_mass() -> None:
    mass = MASS.copy()
    mass[1, 1] = 0.0
    mass[0, 1] = mass[1, 0] = 1.0
    assert "the mass matrix is not positive semidefinite: body[0] ux and body[1] ux are coupled by 1" in fault(
        assembly(mass, STIFFNESS)
    )


def test_negative_stiffness_that_no_pair_shows() -> None:
    """Three springs in a ring, one negative: every 2 by 2 minor is positive, the whole is not."""
    stiffness = 1e6 * np.array([[2.0, -1.5, -1.5], [-1.5, 2.0, -1.5], [-1.5, -1.5, 2.0]])
    wide = np.zeros((40, 40))
    mass, wide[:] = chain([50.0] * 40, [1e6] * 39)
    wide[20:23, 20:23] += 2 * stiffness
    lowest, vectors = np.linalg.eigh(wide)
    assert lowest[0] < 0  # otherwise the model is none
    message = fault(assembly(mass, wide))
    assert "the stiffness matrix is not positive semidefinite: a motion mainly of body[2" in message
    assert "has negative stiffness" in message
    named = message.split("mainly of ")[1].split(" has")[0]
    assert {"body[20] ux", "body[21] ux", "body[22] ux"} <= set(named.replace(" and", ",").split(", "))
    assert np.argmax(np.abs(vectors[:, 0])) in (20, 21, 22)


def test_degrees_of_freedom_with_nothing() -> None:
    mass, stiffness = np.pad(MASS, (0, 2)), np.pad(STIFFNESS, (0, 2))
    ports = {port: np.pad(vector, (0, 2)) for port, vector in assembly(MASS, STIFFNESS).ports.items()}
    message = fault(assembly(mass, stiffness, ports=ports))
    assert "2 degrees of freedom have neither mass nor stiffness: body[3] ux, body[4] ux; constrain them" in message


def test_massless_is_fine_where_stiffness_holds_it() -> None:
    mass = MASS.copy()
    mass[1, 1] = 0.0
    (finding,) = check(assembly(mass, STIFFNESS))
    assert finding.code == "freedom-massless"
    assert "body[1] ux" in finding.text


def test_a_massless_mechanism_is_named() -> None:
    """Two massless joints tied to one another alone by a spring: nothing says where the pair is."""
    mass, stiffness = chain([100.0, 200.0, 0.0, 0.0, 300.0], [1e6, 0.0, 3e6, 0.0])
    message = fault(assembly(mass, stiffness))
    assert "body[2] ux, body[3] ux: no mass, and no stiffness against moving on their own" in message
    assert "body[1]" not in message


def test_no_mass_at_all() -> None:
    assert "the mass matrix is zero" in fault(assembly(0 * MASS, STIFFNESS))


def test_a_part_that_flies_freely() -> None:
    mass, stiffness = chain([100.0, 200.0, 300.0, 7.0, 8.0], [4e6, 9e6, 0.0, 5e6])
    ports = {port: np.pad(vector, (0, 2)) for port, vector in assembly(MASS, STIFFNESS).ports.items()}
    message = fault(assembly(mass, stiffness, ports=ports))
    assert (
        "a part flies freely: 2 degrees of freedom (body[3] ux, body[4] ux) that nothing connects to the 3 of the "
        "largest part, with 1 rigid mode; connect it, hold it or leave it out"
    ) in message


def test_many_loose_degrees_of_freedom_are_not_all_listed() -> None:
    mass, stiffness = chain([100.0] * 12, [4e6, 4e6, *[0.0] * 9])
    message = fault(assembly(mass, stiffness, ports={"n_X": np.eye(12)[0], "x_X": np.eye(12)[2]}))
    assert message.count("a part flies freely: 1 degree of freedom") == 5
    assert "4 more of the 10 parts fly freely" in message


def test_a_part_that_is_held_on_its_own_is_a_warning() -> None:
    mass, stiffness = chain([100.0, 200.0, 300.0, 7.0, 8.0], [4e6, 9e6, 0.0, 5e6])
    stiffness[4, 4] += 1e5
    ports = {port: np.pad(vector, (0, 2)) for port, vector in assembly(MASS, STIFFNESS).ports.items()}
    (finding,) = check(assembly(mass, stiffness, ports=ports))
    assert finding.code == "part-on-ground"
    assert "a part of 2 degrees of freedom (body[3] ux, body[4] ux)" in finding.text


def test_a_rotor_that_drives_by_its_ports_alone_may_fly() -> None:
    """An axis whose slide is one degree of freedom: its rigid mode is what the axis is for."""
    mass = np.diag([100.0, 200.0, 300.0])
    stiffness = np.diag([0.0, 4e6, 9e6])
    stiffness[1, 2] = stiffness[2, 1] = -1e6
    port = np.array([1.0, 0.0, 0.0])
    model = assembly(mass, stiffness, ports={"n_X": port, "x_X": port, "tcp_X": port})
    assert check(model) == []
    message = fault(assembly(mass, stiffness, axes=(), ports={"tcp_X": port}))
    assert "a part flies freely: 1 degree of freedom (body[0] ux)" in message


@pytest.mark.parametrize("size", [12, 900])
def test_a_free_body_has_six_rigid_modes(size: int) -> None:
    """A chain that is cut five times has six; mass couples its pieces, so that it is one part nevertheless."""
    mass, stiffness = chain([10.0] * size, [1e7] * (size - 1))
    for cut in range(1, 6):
        i = cut * (size // 6)
        stiffness[i - 1 : i + 1, i - 1 : i + 1] -= 1e7 * np.array([[1, -1], [-1, 1]])
        mass[i - 1, i] = mass[i, i - 1] = 0.5  # still one part: coupled by mass
    main_mass, main_stiffness = chain([100.0] * (size + 50), [1e8] * (size + 49))
    model = assembly(
        np.block([[main_mass, np.zeros((size + 50, size))], [np.zeros((size, size + 50)), mass]]),
        np.block([[main_stiffness, np.zeros((size + 50, size))], [np.zeros((size, size + 50)), stiffness]]),
    )
    first = np.eye(2 * size + 50)[0]
    model = Assembly(
        model.name, model.mass, model.stiffness, {"n_X": first, "x_X": first}, ("X",), model.labels, None, {}
    )
    message = fault(model)
    assert f"{size} degrees of freedom (body[{size + 50}] ux," in message
    assert "with 6 rigid modes;" in message


def test_ports_that_excite_nothing() -> None:
    ports = dict(assembly(MASS, STIFFNESS).ports)
    assert "port n_X excites nothing: all its coefficients are 0" in fault(
        assembly(MASS, STIFFNESS, ports={**ports, "n_X": ZEROS})
    )
    assert "port x_X excites nothing" in fault(assembly(MASS, STIFFNESS, ports={**ports, "x_X": ZEROS}))
    (finding,) = check(assembly(MASS, STIFFNESS, ports={**ports, "tcp_Y": ZEROS, "tcp_Z": ZEROS}))
    assert (finding.code, finding.place) == ("port-idle", "tcp_Y, tcp_Z")
    assert "axis Y has no port n_Y" in fault(assembly(MASS, STIFFNESS, axes=("X", "Y")))


def units(factor: float, spacing: float, system: UnitSystem | None = SI) -> list[Finding]:
    mass, stiffness = chain([3000.0 * factor] * 3, [4e6, 9e6])
    return check(replace(assembly(mass, stiffness, geometry=geometry(3, spacing)), units=system))


@pytest.mark.parametrize(
    ("factor", "spacing", "code", "size", "hint"),
    [
        (1e-3, 1.0, "model-mass-unusual", "9 kg", "9 looks like tonnes, units: {mass: t}"),
        (1e3, 1.0, "model-mass-unusual", "9e+06 kg", "9e+06 looks like grams, units: {mass: g}"),
        (1.0, 1000.0, "model-size-unusual", "2000 m", "2000 looks like millimetres, units: {length: mm}"),
        (1.0, 1e-3, "model-size-unusual", "0.002 m", "was it converted from millimetres twice?"),
    ],
)
def test_units_that_look_like_others(factor: float, spacing: float, code: str, size: str, hint: str) -> None:
    (finding,) = units(factor, spacing)
    assert finding.code == code
    assert size in finding.text
    assert finding.text.endswith(hint)


def test_usual_mass_and_size_are_not_doubted() -> None:
    assert units(1.0, 1.0) == []


@pytest.mark.parametrize(
    ("factor", "spacing", "system", "hint"),
    [
        (1e-3, 1.0, UnitSystem(length="mm", mass="t"), "9 kg; a machine has 20 kg to 1e+06 kg"),
        (1e-3, 1.0, UnitSystem(length="m", mass="g"), "; 9000 looks like kilograms, units: {mass: kg}"),
        (1e-6, 1.0, UnitSystem(length="m", mass="g"), "; 9 looks like tonnes, units: {mass: t}"),
        (1e3, 1.0, UnitSystem(length="m", mass="t"), "; 9000 looks like kilograms, units: {mass: kg}"),
        (1e-3, 1.0, None, "9 kg; a machine has 20 kg to 1e+06 kg"),
        (1.0, 1e3, UnitSystem(length="mm", mass="t"), "measures 2000 m; a machine measures 0.05 m to 100 m"),
        (1.0, 1e-3, UnitSystem(length="mm", mass="t"), "; 2 looks like metres, units: {length: m}"),
        (1.0, 1e3, None, "measures 2000 m; a machine measures 0.05 m to 100 m"),
    ],
)
def test_no_hint_of_a_unit_that_is_set(factor: float, spacing: float, system: UnitSystem | None, hint: str) -> None:
    """What is proposed is what the file's own number is in another unit than the stated one."""
    (warning,) = units(factor, spacing, system)
    assert warning.code in ("model-mass-unusual", "model-size-unusual")
    assert warning.text.endswith(hint)


def test_mass_by_labels_counts_translations_alone() -> None:
    labels = ("a ux", "b ux", "b rx")
    mass = np.diag([5.0, 5.0, 1e9])
    (finding,) = check(assembly(mass, STIFFNESS, labels=labels))
    assert finding.code == "model-mass-unusual"
    assert "the model's mass is 10 kg" in finding.text
    # Where nothing says which way a degree of freedom goes, nothing is said of the mass.
    assert check(assembly(mass, STIFFNESS, labels=("dof 0", "dof 1", "dof 2"))) == []


def test_the_lowest_elastic_frequency() -> None:
    assert frequency_warnings(2 * np.pi * 21.0) == []
    (slow,) = frequency_warnings(2 * np.pi * 0.66)
    assert slow.code == "mode-frequency-unusual"
    assert "is at 0.66 Hz" in slow.text
    assert "N/mm beside a mass in kg" in slow.text
    (fast,) = frequency_warnings(2 * np.pi * 2.1e4)
    assert "2.1e+04 Hz" in fast.text
    assert "mass in tonnes beside a stiffness in N/m" in fast.text


def grid(n: int) -> Assembly:
    """A block of n^3 points with three degrees of freedom each, joined to its neighbours, as filled as bricks are."""
    line = sparse.diags_array([np.full(n - 1, 1.0), np.full(n, 4.0), np.full(n - 1, 1.0)], offsets=[-1, 0, 1]) / 6
    slope = sparse.diags_array([np.full(n - 1, -1.0), np.full(n, 2.0), np.full(n - 1, -1.0)], offsets=[-1, 0, 1])

    def cube(a: Any, b: Any, c: Any) -> Any:
        return sparse.kron(sparse.kron(a, b), c)

    laplace = cube(slope, line, line) + cube(line, slope, line) + cube(line, line, slope)
    mass = sparse.csc_array(sparse.kron(cube(line, line, line), sparse.eye_array(3)))
    stiffness = sparse.csc_array(sparse.kron(laplace, np.eye(3) + 0.1))
    size = 3 * n**3
    rotor, slide = np.zeros(size), np.zeros(size)
    rotor[0], slide[-1] = 1, 1
    labels = tuple(f"node {i // 3} u{'xyz'[i % 3]}" for i in range(size))
    return Assembly("grid", mass, 1e8 * stiffness, {"n_X": rotor, "x_X": slide}, ("X",), labels, None, {})


def test_a_large_model_is_checked() -> None:
    """98,304 degrees of freedom, 8 million entries of stiffness: without a factorisation, which would take minutes."""
    model = grid(32)
    assert len(model.labels) == 98304
    assert check(model) == []
