"""Modes of a model: the default machine's as another program gave them, closed forms, damping, what is reported."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csc_array

from eigen_models import DEFAULT_DAMPING, TWO_PERCENT, chain, error_bounds, given
from feedsim.foundation.errors import InputError, OutputError
from feedsim.structure.modes import Modes, read_modes, write_modes
from feedsim.structure.solve import Solution, damping_ratio, solve
from structure_helpers import MACHINES

Floats = NDArray[np.float64]
AXES = ("X", "Y", "Z")
KHZ = 2 * math.pi * 1000
METHODS = {"dense": 2500, "Lanczos": 0}


@cache
def default(method: str) -> Solution:
    return solve(given(), cutoff=KHZ, damping=DEFAULT_DAMPING, dense_limit=METHODS[method])


@cache
def all_modes() -> Solution:
    return solve(given(), cutoff=math.inf, damping=DEFAULT_DAMPING)


@cache
def table() -> Modes:
    return read_modes(MACHINES / "test_centre" / "modes.csv", AXES)


@pytest.mark.parametrize("method", METHODS)
def test_frequencies_and_damping_of_the_default_machine(method: str) -> None:
    found = default(method)
    assert found.method == method
    assert len(found.modes.frequency) == 93
    # The given table's own eigensolver has errors of 1e-10.
    assert found.modes.frequency[3:] == pytest.approx(table().frequency[3:], rel=1e-9)
    assert list(found.modes.damping) == list(table().damping)
    assert not found.modes.frequency[:3].any()


@pytest.mark.parametrize("method", METHODS)
def test_products_of_mode_shapes(method: str) -> None:
    # Signs of shapes and the basis of the rigid ones are free; what the physics sees are products of ports. Against the
    # largest product of a mode: closest frequencies are 1e-3 apart, which makes 1e-10 in eigenvalues 1e-7 in shapes.
    ports = list(table().ports)
    found, known = (np.array([modes.ports[port] for port in ports]) for modes in (default(method).modes, table()))
    for mode in range(3, 93):
        a, b = np.outer(found[:, mode], found[:, mode]), np.outer(known[:, mode], known[:, mode])
        assert np.abs(a - b).max() <= 1e-7 * np.abs(b).max(), f"mode {mode}"
    a, b = found[:, :3] @ found[:, :3].T, known[:, :3] @ known[:, :3].T
    size = np.sqrt(np.diag(b))
    # 1/J_tot and lead are sums over the three rigid modes.
    assert np.abs((a - b) / np.outer(size, size)).max() <= 1e-9


def test_dense_and_lanczos_agree_in_shapes_too() -> None:
    # Same signs, same basis of the rigid modes, although the algorithms have nothing in common.
    a, b = default("dense"), default("Lanczos")
    assert a.modes.frequency == pytest.approx(b.modes.frequency, rel=1e-9)
    for i, (one, other) in enumerate(zip(a.shapes.T, b.shapes.T, strict=True)):
        assert np.abs(one - other).max() <= 1e-6 * np.abs(one).max(), f"mode {i}"


@pytest.mark.parametrize("method", METHODS)
def test_shapes_are_mass_normalised_eigenvectors(method: str) -> None:
    found, model = default(method), given()
    gram = found.shapes.T @ (model.mass @ found.shapes)
    assert np.abs(gram - np.eye(93)).max() <= 1e-10
    # Strain energy couples modes by rounding of K, whose largest entries are 1e10 times a low mode's lambda.
    omega = 2 * np.pi * found.modes.frequency
    energy = found.shapes.T @ (model.stiffness @ found.shapes)
    assert np.abs(energy - np.diag(omega**2)).max() <= 1e-10 * omega[-1] ** 2
    assert error_bounds(model, found).max() <= 1e-9
    for port, values in found.modes.ports.items():
        assert values == pytest.approx(model.ports[port] @ found.shapes, abs=1e-12)


def test_what_lies_above_the_cutoff_is_reported() -> None:
    whole, part = default("dense"), default("Lanczos")
    assert whole.dropped == part.dropped == 615 - 93
    assert len(whole.above) == 522
    assert len(part.above) >= 4  # the next few
    assert part.above == pytest.approx(whole.above[: len(part.above)], rel=1e-6)
    assert np.all(whole.above > 1000)
    assert "93 modes" in part.verification


@pytest.mark.parametrize("axis", AXES)
def test_inertia_met_by_a_sudden_torque(axis: str) -> None:
    everything = all_modes()
    assert everything.dropped == 0
    # 1/(b^T M^-1 b) by the mass matrix alone against the sum over all 615 modes.
    assert everything.J_inf_full[axis] == pytest.approx(everything.modes.J_inf(axis), rel=1e-7)
    assert default("Lanczos").J_inf_full[axis] == pytest.approx(everything.J_inf_full[axis], rel=1e-9)
    assert default("dense").modes.J_inf(axis) > everything.J_inf_full[axis]


@pytest.mark.parametrize("method", METHODS)
def test_chain_of_masses(method: str) -> None:
    n, m, k = 60, 2.0, 3e6
    found = solve(
        chain(np.full(n, m), np.full(n - 1, k)),
        cutoff=0.9 * math.sqrt(k / m),
        damping=TWO_PERCENT,
        dense_limit=METHODS[method],
    )
    omega = 2 * math.sqrt(k / m) * np.sin(np.arange(n) * np.pi / (2 * n))
    below = omega[omega <= 0.9 * math.sqrt(k / m)]
    assert 2 * np.pi * found.modes.frequency == pytest.approx(below, rel=1e-10)
    # Total mass 120 kg moves as one: mass-normalised 1/sqrt(120) everywhere, rounding aside.
    assert found.shapes[:, 0] == pytest.approx(np.full(n, 1 / math.sqrt(n * m)), rel=1e-10)


def rod(elements: int) -> tuple[Solution, Floats, Floats]:
    """A free-free steel rod in tension: solution, frequencies of the mesh in closed form, of the rod [rad/s]."""
    length, area, modulus, density = 2.0, 1e-3, 2.1e11, 7850.0
    h, speed = length / elements, math.sqrt(modulus / density)
    model = chain(
        np.zeros(elements + 1), np.full(elements, modulus * area / h), consistent=density * area * h, name="rod"
    )
    found = solve(model, cutoff=5.5 * np.pi * speed / length, damping=TWO_PERCENT)
    order = np.arange(6)
    angle = order * np.pi / elements
    mesh = np.sqrt(6 * (speed / h) ** 2 * (1 - np.cos(angle)) / (2 + np.cos(angle)))
    return found, mesh, order * np.pi * speed / length


def test_free_rod() -> None:
    errors = []
    for elements in (40, 80):
        found, mesh, exact = rod(elements)
        omega = 2 * np.pi * found.modes.frequency
        assert omega == pytest.approx(mesh, rel=1e-9)
        errors.append(omega[1:] / exact[1:] - 1)
    # Linear elements: from above, second order. 4.00 to the next term, (5 pi/40)^2/20 at most.
    assert np.all(errors[1] > 0)
    assert errors[0] / errors[1] == pytest.approx(np.full(5, 4.0), rel=1e-2)


@pytest.mark.parametrize("method", METHODS)
def test_degrees_of_freedom_without_mass_are_condensed(method: str) -> None:
    # Every second mass of the chain is taken away: springs in series, half as stiff.
    n, m, k = 40, 2.0, 3e6
    masses = np.zeros(2 * n - 1)
    masses[::2] = m
    model = chain(masses, np.full(2 * n - 2, k))
    found = solve(model, cutoff=0.9 * math.sqrt(k / m), damping=TWO_PERCENT, dense_limit=METHODS[method])
    omega = 2 * math.sqrt(k / 2 / m) * np.sin(np.arange(n) * np.pi / (2 * n))
    assert 2 * np.pi * found.modes.frequency == pytest.approx(omega[omega <= 0.9 * math.sqrt(k / m)], rel=1e-10)
    # In between, where no mass is, the displacement is the mean of the neighbours'.
    between = (found.shapes[:-2:2] + found.shapes[2::2]) / 2
    assert found.shapes[1::2] == pytest.approx(between, abs=1e-9)
    assert found.dropped == n - len(found.modes.frequency)


def test_a_rotor_without_mass_has_no_sudden_inertia() -> None:
    masses = np.array([0.0, 1.0, 2.0])
    found = solve(chain(masses, np.array([1e6, 1e6])), cutoff=math.inf, damping=TWO_PERCENT)
    # The torque goes through the spring to the first mass at once.
    assert found.J_inf_full["X"] == pytest.approx(1.0, rel=1e-9)
    assert found.modes.J_inf("X") == pytest.approx(1.0, rel=1e-9)


def test_damping_steps() -> None:
    hz = 2 * math.pi
    steps = [{"below": "100 Hz", "ratio": 0.04}, {"below": "30 Hz", "ratio": 0.06}]
    damping = type(TWO_PERCENT).model_validate({"ratio": 0.02, "steps": steps})
    given_ratios = [damping_ratio(damping, f * hz) for f in (10, 29.9, 30.1, 99, 101)]
    assert given_ratios == [0.06, 0.06, 0.04, 0.04, 0.02]


def test_progress_is_told() -> None:
    told: list[str] = []
    solve(given(), cutoff=KHZ, damping=DEFAULT_DAMPING, dense_limit=0, progress=told.append)
    assert any("93 modes" in line for line in told)
    assert any("Lanczos" in line for line in told)


def test_table_round_trip(tmp_path: Path) -> None:
    found = default("Lanczos").modes
    path = tmp_path / "modes.csv"
    write_modes(path, found)
    again = read_modes(path, AXES)
    assert list(again.frequency) == list(found.frequency)
    assert list(again.damping) == list(found.damping)
    assert all(list(again.ports[port]) == list(found.ports[port]) for port in found.ports)
    lines = path.read_bytes().decode().split("\n")
    assert lines[0] == "mode,frequency [Hz],damping ratio [1],n_X,n_Y,n_Z,x_X,x_Y,x_Z,tcp_X,tcp_Y,tcp_Z"
    assert [line.split(",")[0] for line in lines[1:]] == [*map(str, range(93)), ""]
    assert "\r" not in path.read_text(encoding="utf-8")


def test_table_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        write_modes(tmp_path / "no" / "modes.csv", default("Lanczos").modes)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("method", METHODS)
def test_negative_stiffness(method: str) -> None:
    model = given()
    wrong = replace(model, stiffness=csc_array(-model.stiffness))
    with pytest.raises(InputError, match="neither mass nor stiffness \\(or negative"):
        solve(wrong, cutoff=KHZ, damping=TWO_PERCENT, dense_limit=METHODS[method])
    bent = chain(np.ones(20), np.array([1e6] * 10 + [-1e3] + [1e6] * 8))
    with pytest.raises(InputError, match="chain: the stiffness matrix has negative eigenvalues"):
        solve(bent, cutoff=1000.0, damping=TWO_PERCENT, dense_limit=METHODS[method])


def test_neither_mass_nor_stiffness() -> None:
    model = chain(np.array([1.0, 1.0, 0.0]), np.array([1e6, 0.0]))
    with pytest.raises(InputError, match=r"1 degrees of freedom have neither mass .*: slide\[2\] ux$"):
        solve(model, cutoff=1000.0, damping=TWO_PERCENT)


def test_a_missing_port() -> None:
    model = given()
    ports = {port: vector for port, vector in model.ports.items() if port != "x_Y"}
    with pytest.raises(InputError, match=r"given: no port vector for x_Y$"):
        solve(replace(model, ports=ports), cutoff=KHZ, damping=TWO_PERCENT)


def test_all_modes_of_a_large_model_are_too_many() -> None:
    model = chain(np.ones(5001), np.full(5000, 1e6))
    with pytest.raises(InputError, match=r"all modes of 5001 degrees of freedom .* at most 5000"):
        solve(model, cutoff=math.inf, damping=TWO_PERCENT)
