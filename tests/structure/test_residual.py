"""Static correction: exact compliance at rest, frequency responses with and without it against the full model."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve as solve_dense

from eigen_models import DEFAULT_DAMPING, TWO_PERCENT, Floats, chain, given
from feedsim.structure.modes import Modes
from feedsim.structure.solve import Solution, solve

KHZ = 2 * math.pi * 1000
METHODS = {"dense": 2500, "Lanczos": 0}
AXES = ("X", "Y", "Z")
INPUTS = (*(f"n_{axis}" for axis in AXES), *(f"tcp_{axis}" for axis in AXES))
OUTPUTS = (*INPUTS, *(f"x_{axis}" for axis in AXES))


@cache
def reduced(correction: bool, method: str = "dense") -> Solution:
    return solve(
        given(), cutoff=KHZ, damping=DEFAULT_DAMPING, static_correction=correction, dense_limit=METHODS[method]
    )


@cache
def full() -> Modes:
    return solve(given(), cutoff=math.inf, damping=DEFAULT_DAMPING).modes


@cache
def displacements() -> Floats:
    """(N, 6) what each input does at rest beside the rigid motion: K u = b - M R R^T b, R^T M u = 0 (bordered)."""
    model = given()
    rigid = reduced(False).shapes[:, :3]
    mass_rigid = model.mass @ rigid
    loads = np.column_stack([model.ports[port] for port in INPUTS])
    # The border in the size of the stiffness keeps the system well scaled.
    border = 1e9 * mass_rigid
    system = np.block([[model.stiffness.toarray(), border], [border.T, np.zeros((3, 3))]])
    right = np.vstack([loads - mass_rigid @ (rigid.T @ loads), np.zeros((3, 6))])
    return np.asarray(solve_dense(system, right)[:615])


def static(modes: Modes) -> Floats:
    """(outputs, inputs) compliance at rest of the elastic modes."""
    elastic = modes.frequency > 0
    omega = 2 * np.pi * modes.frequency[elastic]
    out, into = (np.array([modes.ports[port][elastic] for port in ports]) for ports in (OUTPUTS, INPUTS))
    return np.asarray((out / omega**2) @ into.T)


@pytest.mark.parametrize("method", METHODS)
def test_compliance_at_rest_is_exact(method: str) -> None:
    exact = np.array([given().ports[port] for port in OUTPUTS]) @ displacements()
    # Relative to the root of the two direct compliances, the most that one across can have; compliances across may be
    # small or nothing. A scale has no direct one here: its own response to its drive stands for it.
    direct = np.diag(exact)
    own = np.concatenate([direct, np.diag(exact[6:]) ** 2 / direct[:3]])
    size = np.sqrt(np.outer(own, direct))
    assert np.abs((static(reduced(True, method).modes) - exact) / size).max() <= 1e-9
    # Without the correction it is off by much more than that.
    assert np.abs((static(reduced(False, method).modes) - exact) / size).max() > 1e-3


def test_every_degree_of_freedom_is_where_it_should_be_at_rest() -> None:
    found = reduced(True)
    elastic = found.shapes[:, 3:]
    loads = np.column_stack([given().ports[port] for port in INPUTS])
    moved = (elastic / (2 * np.pi * found.modes.frequency[3:]) ** 2) @ (elastic.T @ loads)
    size = np.abs(displacements()).max(axis=0)
    assert np.abs((moved - displacements()) / size).max() <= 1e-9


@pytest.mark.parametrize("method", METHODS)
def test_pseudo_modes_are_a_table_s_last_rows(method: str) -> None:
    with_it, without = reduced(True, method), reduced(False, method)
    assert with_it.corrections == 6
    assert without.corrections == 0
    assert np.array_equal(with_it.modes.frequency[:93], without.modes.frequency)
    assert len(with_it.modes.frequency) == len(with_it.moving) == with_it.shapes.shape[1] == 99
    # Not below what the first dropped mode has.
    assert np.all(with_it.modes.frequency[93:] > with_it.above[0])
    assert np.all(np.diff(with_it.modes.frequency) >= 0)
    assert set(with_it.modes.damping[93:]) == {0.02}
    assert with_it.dropped == 615 - 93
    gram = with_it.shapes.T @ (given().mass @ with_it.shapes)
    assert np.abs(gram - np.eye(99)).max() <= 1e-10


@pytest.mark.parametrize("axis", AXES)
def test_inertia_met_by_a_sudden_torque_comes_nearer_to_the_full_model(axis: str) -> None:
    without, with_it, all_of_it = (
        reduced(False).modes.J_inf(axis),
        reduced(True).modes.J_inf(axis),
        full().J_inf(axis),
    )
    assert all_of_it < with_it < without


def test_directions_that_depend_on_one_another_are_dropped() -> None:
    # All three tool ports and the scale's mass are one point: two directions at most, rotor and tool.
    model = chain(np.full(30, 2.0), np.full(29, 3e6))
    found = solve(model, cutoff=300.0, damping=TWO_PERCENT, static_correction=True)
    assert 1 <= found.corrections <= 2
    elastic = found.modes.frequency > 0
    shapes, omega = found.shapes[:, elastic], 2 * np.pi * found.modes.frequency[elastic]
    # Tool force on the last of a free chain, less what accelerates the whole: the springs' forces rise from 0 to F.
    rise = np.arange(1, 30) / 30 / 3e6
    shape = np.concatenate([[0.0], np.cumsum(rise)])
    shape -= shape.mean()
    assert (shapes / omega**2) @ shapes[-1] == pytest.approx(shape, abs=1e-9 * shape[-1])


def test_nothing_to_correct_where_no_mode_is_dropped() -> None:
    model = chain(np.full(10, 2.0), np.full(9, 3e6))
    found = solve(model, cutoff=math.inf, damping=TWO_PERCENT, static_correction=True)
    assert found.corrections == 0
    assert found.shapes.shape == (10, 10)


HERTZ = np.arange(5.0, 1000.01, 0.25)


def response(modes: Modes, output: str, source: str) -> NDArray[np.complex128]:
    """Displacement at a port per force at another, HERTZ: sum of c b / (omega_i^2 - omega^2 + 2 j D omega_i omega)."""
    omega_i = 2 * np.pi * modes.frequency[:, None]
    omega = 2 * np.pi * HERTZ
    denominator = omega_i**2 - omega**2 + 2j * modes.damping[:, None] * omega_i * omega
    return np.asarray(((modes.ports[output] * modes.ports[source])[:, None] / denominator).sum(axis=0))


def off(output: str, source: str, correction: bool) -> Floats:
    """How far the reduced model's magnitude is off the full one's [dB]."""
    ratio = response(reduced(correction).modes, output, source) / response(full(), output, source)
    return np.asarray(np.abs(20 * np.log10(np.abs(ratio))))


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("correction", [False, True])
def test_speed_response_of_the_reduced_model(axis: str, correction: bool) -> None:
    # n/M is the displacement response at the same port times j omega. 0.1 dB: what the truncation is allowed to cost.
    below = HERTZ <= 900
    assert off(f"n_{axis}", f"n_{axis}", correction)[below].max() < (0.005 if correction else 0.1)


def test_scale_and_tool_need_the_correction() -> None:
    """Figures of the default machine; they are quoted in docs/performance.md."""
    scale = {correction: max(off(f"x_{a}", f"n_{a}", correction).max() for a in AXES) for correction in (False, True)}
    tool = {
        correction: max(off(f"tcp_{a}", f"tcp_{a}", correction).max() for a in AXES) for correction in (False, True)
    }
    assert scale[False] == pytest.approx(31, abs=0.5)  # Y, next to a zero at 920 Hz
    assert tool[False] == pytest.approx(10.8, abs=0.05)  # X, next to a zero at 846 Hz
    assert tool[True] == pytest.approx(1.3, abs=0.05)
    assert off("tcp_Z", "tcp_X", False).max() == pytest.approx(12.8, abs=0.05)
    assert off("tcp_Z", "tcp_X", True).max() == pytest.approx(3.7, abs=0.05)
    below = HERTZ <= 900
    scales = {c: max(off(f"x_{a}", f"n_{a}", c)[below].max() for a in AXES) for c in (False, True)}
    # A zero of x_Y/M at 996 Hz stays misplaced: the modes just above the cut-off are dynamic there.
    assert scales[True] == pytest.approx(2.0, abs=0.05)
    assert scales[False] == pytest.approx(5.9, abs=0.05)
