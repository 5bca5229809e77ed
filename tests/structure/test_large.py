"""The way of large models: nothing is missed, multiple frequencies included, and what is missed is found out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csc_array, diags_array

from eigen_models import TWO_PERCENT, Floats, error_bounds, given, lattice
from feedsim.foundation.errors import FeedsimError
from feedsim.structure import eigenpairs
from feedsim.structure.eigenpairs import SparseFactor
from feedsim.structure.solve import solve

SIDE, SPRING, GROUND, MASS = 14, 2e8, 3e6, 5.0


def test_multiple_frequencies_of_a_lattice() -> None:
    model, values = lattice(SIDE, SPRING, GROUND, MASS)
    assert len(values) == SIDE**3 + 7
    cutoff = math.sqrt(0.5 * SPRING / MASS)
    expected = np.sqrt(np.maximum(values[values < cutoff**2], 0))
    # A test of multiplicities: some frequencies occur six times.
    assert np.max(np.unique(expected.round(3), return_counts=True)[1][1:]) == 6
    found = solve(model, cutoff=cutoff, damping=TWO_PERCENT, dense_limit=100)
    assert found.method == "Lanczos"
    omega = 2 * np.pi * found.modes.frequency
    assert omega[3:] == pytest.approx(expected[3:], rel=1e-9)
    gram = found.shapes.T @ (model.mass @ found.shapes)
    # Copies of a multiple mode are orthogonal like all others.
    assert np.abs(gram - np.eye(len(omega))).max() <= 1e-9
    assert error_bounds(model, found).max() <= 1e-9


def test_a_lattice_of_uneven_springs_against_full_matrices() -> None:
    model, _ = lattice(9, SPRING, GROUND, MASS)
    rng = np.random.default_rng(3)
    # The drives stay as they are: three rigid modes.
    scale = diags_array(np.concatenate([np.ones(7), rng.uniform(0.5, 1.5, 9**3)]))
    model = type(model)(**{**vars(model), "stiffness": csc_array(scale @ model.stiffness @ scale)})
    cutoff = math.sqrt(SPRING / MASS)
    values = eigh(model.stiffness.toarray(), model.mass.toarray(), eigvals_only=True)
    found = solve(model, cutoff=cutoff, damping=TWO_PERCENT, dense_limit=100)
    expected = np.sqrt(values[3:][values[3:] < cutoff**2])
    assert 2 * np.pi * found.modes.frequency[3:] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("hertz", [10, 21.0, 21.2, 100, 500, 999, 3000])
def test_sturm_count_of_the_default_machine(hertz: float) -> None:
    model = given()
    values = eigh(model.stiffness.toarray(), model.mass.toarray(), eigvals_only=True)
    sigma = (2 * math.pi * hertz) ** 2
    assert SparseFactor(model, sigma).eigenvalues_below() == np.count_nonzero(values < sigma)


def forgetful(times: float, calls: list[int]) -> Any:
    """An eigsh that keeps the mode next to 50.58 Hz to itself, so many times."""
    exact = eigenpairs.eigsh

    def eigsh(*arguments: Any, **options: Any) -> tuple[Floats, Floats]:
        values, shapes = exact(*arguments, **options)
        calls.append(len(values))
        hertz = np.sqrt(np.maximum(values, 0)) / (2 * np.pi)
        hidden = abs(hertz - 50.583460) < 1e-3
        if len(calls) > times:
            hidden[:] = False
        return values[~hidden], shapes[:, ~hidden]

    return eigsh


def test_a_missed_mode_is_looked_for_again(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []
    monkeypatch.setattr(eigenpairs, "eigsh", forgetful(1, calls))
    told: list[str] = []
    found = solve(given(), cutoff=2e3 * math.pi, damping=TWO_PERCENT, dense_limit=0, progress=told.append)
    assert len(calls) == 2
    assert any("1 of 93 modes are missing" in line for line in told)
    assert len(found.modes.frequency) == 93
    assert found.modes.frequency[8] == pytest.approx(50.583460006, rel=1e-9)
    assert error_bounds(given(), found).max() <= 1e-9


def test_a_mode_that_stays_missing_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(eigenpairs, "eigsh", forgetful(math.inf, []))
    with pytest.raises(FeedsimError, match="given: 92 modes found below 1000 Hz, where a Sturm sequence counts 93"):
        solve(given(), cutoff=2e3 * math.pi, damping=TWO_PERCENT, dense_limit=0)


def test_without_a_count_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SparseFactor, "eigenvalues_below", lambda self: None)
    found = solve(given(), cutoff=2e3 * math.pi, damping=TWO_PERCENT, dense_limit=0)
    assert found.verification.startswith("NOT verified")
    assert len(found.modes.frequency) == 93


def test_a_cutoff_on_a_frequency() -> None:
    # The matrix shifted to the cut-off is then singular. Three masses in a row, omega^2 = 0, k/m, 3 k/m, beside others.
    model, values = lattice(6, SPRING, GROUND, MASS)
    cutoff = math.sqrt(values[60])
    found = solve(model, cutoff=cutoff, damping=TWO_PERCENT, dense_limit=0)
    assert found.verification.startswith(("5", "6"))
    count = len(found.modes.frequency)
    # On which side of the cut-off a frequency lies that equals it is up to rounding; all others are there.
    assert np.count_nonzero(values < 0.999999 * cutoff**2) <= count <= np.count_nonzero(values < 1.000001 * cutoff**2)


def test_the_same_figures_on_every_run() -> None:
    first, second = (solve(given(), cutoff=2e3 * math.pi, damping=TWO_PERCENT, dense_limit=0) for _ in range(2))
    assert np.array_equal(first.shapes, second.shapes)
