"""Deflected lines in pictures are the beams' own: closed forms of bending, in any direction."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from feedsim.structure.assembly import Geometry
from feedsim.structure.geometry.outline import deflection, node_motion

Floats = NDArray[np.float64]
L = 1.7
N = 8
# Rounding of numbers of the order of 1.
ROUNDING = 1e-14


def one_line(direction: Floats, turns: bool = True) -> Geometry:
    start = np.array([0.3, -0.2, 0.9])
    dofs = np.arange(12).reshape(2, 6)
    if not turns:
        dofs[:, 3:] = -1
    return Geometry(
        nodes=np.array([start, start + L * direction]),
        names=("a", "b"),
        bodies=("body", "body"),
        dofs=dofs,
        lines=np.array([[0, 1]]),
    )


def directions() -> list[Floats]:
    rng = np.random.default_rng(7)
    random = rng.normal(size=(4, 3))
    return [*np.eye(3), *(-np.eye(3)), *(random / np.linalg.norm(random, axis=1)[:, None])]


def frame(e: Floats) -> tuple[Floats, Floats]:
    """Two directions across e; (e, a, b) is right-handed."""
    a = np.cross(e, np.eye(3)[np.argmin(np.abs(e))])
    a /= np.linalg.norm(a)
    return a, np.cross(e, a)


@pytest.mark.parametrize("e", directions(), ids=lambda e: ",".join(f"{c:.2f}" for c in e))
def test_cantilever_under_a_force_and_a_moment_at_its_end(e: Floats) -> None:
    """w = F s^2 (3 L - s)/6 in one plane, w = M s^2/2 in the other (EI = 1), stretch and twist linear: exact."""
    a, b = frame(e)
    F, M, stretch, twist = 0.7, -0.4, 0.3, 0.5
    s = np.linspace(0, L, N + 1)[:, None]
    # A rotation phi carries a tangent: u' = phi x e, so u' along a is phi about b, and u' along b is -phi about a.
    u = F * s**2 * (3 * L - s) / 6 * a + M * s**2 / 2 * b + stretch * s * e
    phi = F * s * (2 * L - s) / 2 * b - M * s * a + twist * s * e
    shape = np.concatenate([u[0], phi[0], u[-1], phi[-1]])
    found = deflection(one_line(e), shape, N)
    assert found.displacements[0] == pytest.approx(u, abs=ROUNDING)
    assert found.rotations[0] == pytest.approx(phi, abs=ROUNDING)


@pytest.mark.parametrize("e", directions()[:7])
def test_rigid_motion_bends_nothing(e: Floats) -> None:
    translation, spin = np.array([0.1, -0.4, 0.2]), np.array([0.3, 0.8, -0.5])
    geometry = one_line(e)
    t, w = np.tile(translation, (2, 1)), np.tile(spin, (2, 1))
    shape = np.hstack([t + np.cross(w, geometry.nodes), w]).ravel()
    found = deflection(geometry, shape, N)
    assert found.displacements[0] == pytest.approx(translation + np.cross(spin, found.points[0]), abs=ROUNDING)
    assert found.rotations[0] == pytest.approx(np.tile(spin, (N + 1, 1)), abs=ROUNDING)


def test_edges_of_solids_stay_straight() -> None:
    geometry = one_line(np.array([0.0, 0.0, 1.0]), turns=False)
    shape = np.arange(12.0)
    found = deflection(geometry, shape, 4)
    u, phi = node_motion(geometry, shape)
    assert np.array_equal(phi, np.zeros((2, 3)))
    assert found.displacements[0][2] == pytest.approx((u[0] + u[1]) / 2)
    assert not found.rotations.any()


def test_lines_meet_at_their_nodes() -> None:
    """A bent beam goes through its nodes with their slopes: neighbours join without a kink."""
    rng = np.random.default_rng(3)
    geometry = Geometry(
        nodes=np.array([[0.0, 0, 0], [1.0, 0, 0], [2.5, 0, 0]]),
        names=("a", "b", "c"),
        bodies=("body",) * 3,
        dofs=np.arange(18).reshape(3, 6),
        lines=np.array([[0, 1], [1, 2]]),
    )
    shape = rng.normal(size=18)
    found = deflection(geometry, shape, 5)
    assert found.displacements[0][-1] == pytest.approx(shape[6:9])
    assert found.displacements[1][0] == pytest.approx(shape[6:9])
    assert found.rotations[0][-1] == pytest.approx(shape[9:12])
    assert found.rotations[1][0] == pytest.approx(shape[9:12])
