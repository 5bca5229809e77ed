"""The beam element against closed forms of Euler and Bernoulli, with its order of convergence; sections."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import dblquad
from scipy.linalg import eigh

from feedsim.scenario.structure import Box, Material, Properties, Rectangle, Rod, Tube
from feedsim.structure.geometry.mesh import BeamProperties, area_moments, beam_axes, beam_matrices, beam_properties, rod

Floats = NDArray[np.float64]

STEEL = Material(E=2.1e11, nu=0.3, rho=7850.0)
BEAM = beam_properties(Box(width=0.1, height=0.2, wall=0.01), STEEL)
LENGTH = 2.0
# A direction that no axis of the frame shares: what holds there holds for the turning of the element too.
OBLIQUE = np.array([2.0, -1.0, 2.0]) / 3


def chain(beam: BeamProperties, count: int, along: Floats = OBLIQUE) -> tuple[Floats, Floats]:
    """Stiffness and mass of a straight beam of `count` elements, in its own axes at every node."""
    size = 6 * (count + 1)
    K, M = np.zeros((size, size)), np.zeros((size, size))
    points = np.linspace(0, LENGTH, count + 1)[:, None] * along
    for i in range(count):
        dofs = slice(6 * i, 6 * i + 12)
        k, m = beam_matrices(beam, points[i], points[i + 1])
        K[dofs, dofs] += k
        M[dofs, dofs] += m
    T = np.kron(np.eye(2 * (count + 1)), beam_axes(along))
    return T @ K @ T.T, T @ M @ T.T


def frequencies(count: int, fixed: list[int], along: Floats = OBLIQUE) -> Floats:
    """Angular frequencies [rad/s] with degrees of freedom fixed (negative: counted from the end)."""
    K, M = chain(BEAM, count, along)
    free = np.delete(np.arange(len(K)), fixed)
    squared: Floats = eigh(K[np.ix_(free, free)], M[np.ix_(free, free)], eigvals_only=True)
    return np.sqrt(np.abs(squared))


def bending(beta_L: float, EI: float) -> float:
    """Angular frequency of a bending mode [rad/s]."""
    return float(beta_L**2 * np.sqrt(EI / (BEAM.m * LENGTH**4)))


# Degrees of freedom that leave one plane of bending, or one of axial and torsion, of every node.
PLANES = {"xy": (1, 5), "xz": (2, 4), "axial": (0,), "torsion": (3,)}
START, END = range(6), range(-6, 0)


def only(plane: str, count: int, fixed: list[int]) -> list[int]:
    """Everything fixed but one plane, and in it `fixed`."""
    others = [6 * i + dof for i in range(count + 1) for dof in range(6) if dof not in PLANES[plane]]
    return sorted({*others, *(dof % (6 * (count + 1)) for dof in fixed)})


# Roots of cos x cosh x = -1 (clamped-free) and = 1 (free-free; two rigid modes come first); n pi (simply supported).
CLAMPED_FREE = (1.8751040687119611, 4.694091132974175, 7.854757438237613)
FREE_FREE = (4.730040744862704, 7.853204624095838, 10.995607838001671)
SUPPORTED = (pi, 2 * pi, 3 * pi)


@pytest.mark.parametrize("plane", ["xy", "xz"])
@pytest.mark.parametrize(
    ("roots", "case"), [(CLAMPED_FREE, "clamped-free"), (FREE_FREE, "free-free"), (SUPPORTED, "supported")]
)
def test_bending_frequencies_converge_with_the_fourth_order(plane: str, roots: tuple[float, ...], case: str) -> None:
    EI = BEAM.EIz if plane == "xy" else BEAM.EIy
    deflection = PLANES[plane][0]
    fixed = {"clamped-free": [*START], "free-free": [], "supported": [deflection, deflection - 6]}[case]
    rigid = 2 if case == "free-free" else 0
    exact = np.array([bending(root, EI) for root in roots])
    errors = []
    for count in (12, 24):
        found = frequencies(count, only(plane, count, fixed))[rigid : rigid + 3]
        errors.append(found / exact - 1)
    # Leading term of the interpolation by cubics: half of (beta h)^4 / 720, which is the eigenvalue's; from above since
    # the mass is consistent. The next term is about (beta h)^2 / 10 of it, beta h < 0.46 at the finest mesh.
    assert errors[1] == pytest.approx((np.array(roots) / 24) ** 4 / 1440, rel=0.02)
    # By the same term, beta h < 0.92 at 12 elements, the order seen from 12 to 24 is within 0.1 of 4.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.1)


@pytest.mark.parametrize("kind", ["axial", "torsion"])
def test_axial_and_torsional_frequencies_converge_with_the_second_order(kind: str) -> None:
    wave = np.sqrt(BEAM.EA / BEAM.m) if kind == "axial" else np.sqrt(BEAM.GJ / BEAM.j)
    exact = np.array([0.5, 1.5, 2.5]) * pi * wave / LENGTH
    errors = [frequencies(count, only(kind, count, [*START]))[:3] / exact - 1 for count in (12, 24, 48)]
    # Leading term (k h)^2 / 24, k h at most 2.5 pi / 48.
    assert errors[2] == pytest.approx((np.array([0.5, 1.5, 2.5]) * pi / 48) ** 2 / 24, rel=0.01)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.02)


def test_free_beam_has_six_rigid_modes() -> None:
    found = frequencies(4, [])
    # Rounding of 1e-16 in the square of a frequency is 1e-8 in the frequency.
    assert np.all(found[:6] < 1e-6 * found[-1])
    assert found[6] > 0.5 * bending(FREE_FREE[0], min(BEAM.EIy, BEAM.EIz))


def test_loads_at_the_end_of_a_cantilever_give_the_textbook_deflections() -> None:
    K, _ = chain(BEAM, 3)
    compliance = np.linalg.inv(K[6:, 6:])[-6:, -6:]
    L, EIz, EIy = LENGTH, BEAM.EIz, BEAM.EIy
    exact = np.diag([L / BEAM.EA, L**3 / (3 * EIz), L**3 / (3 * EIy), L / BEAM.GJ, L / EIy, L / EIz])
    exact[1, 5] = exact[5, 1] = L**2 / (2 * EIz)
    exact[2, 4] = exact[4, 2] = -(L**2) / (2 * EIy)
    # Exact for loads at nodes: rounding only (condition number of K about 1e6).
    assert compliance == pytest.approx(exact, rel=1e-8, abs=1e-8 * exact.max())


def test_mass_is_that_of_the_bar() -> None:
    _, M = chain(BEAM, 3)
    for direction in range(3):
        translation = np.zeros(len(M))
        translation[direction::6] = 1
        assert translation @ M @ translation == pytest.approx(BEAM.m * LENGTH, rel=1e-12)
    turn = np.zeros(len(M))  # about local y, at the first node: m L^3 / 3
    points = np.linspace(0, LENGTH, 4)
    turn[2::6], turn[4::6] = -points, 1
    assert turn @ M @ turn == pytest.approx(BEAM.m * LENGTH**3 / 3, rel=1e-12)


@pytest.mark.parametrize(
    ("along", "up", "y"),
    [
        ((1, 0, 0), None, (0, 1, 0)),
        ((-1, 0, 0), None, (0, 1, 0)),
        ((0, 0, 2), None, (0, 1, 0)),
        ((0, 1, 0), None, (0, 0, 1)),
        ((0, -3, 0), None, (0, 0, 1)),
        ((1, 1, 0), None, (-1, 1, 0)),
        ((0.5, 0.84, 0), None, (-0.84, 0.5, 0)),  # steep, but not upright
        ((1, 0, 0), (0, 0, 1), (0, 0, 1)),
    ],
)
def test_orientation(along: tuple[float, ...], up: tuple[float, ...] | None, y: tuple[float, ...]) -> None:
    axes = beam_axes(along, up)
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1)
    assert axes[0] == pytest.approx(np.array(along) / np.linalg.norm(along))
    assert axes[1] == pytest.approx(np.array(y) / np.linalg.norm(y), abs=1e-14)


def integrals(half_width: float, half_height: float) -> tuple[float, float, float]:
    """A, Iy, Iz of a rectangle by quadrature: y along the height, z along the width."""
    sides = (-half_height, half_height, -half_width, half_width)
    area = dblquad(lambda z, y: 1.0, *sides)[0]
    return area, dblquad(lambda z, y: z * z, *sides)[0], dblquad(lambda z, y: y * y, *sides)[0]


def test_box_is_a_rectangle_less_a_rectangle() -> None:
    A, Iy, Iz, torsion = area_moments(Box(width=0.32, height=0.62, wall=0.018))
    outer, inner = integrals(0.16, 0.31), integrals(0.142, 0.292)
    assert (A, Iy, Iz) == pytest.approx([a - b for a, b in zip(outer, inner, strict=True)], rel=1e-12)
    # Bredt: 4 A_m^2 t / U along the centre line of the wall
    assert torsion == pytest.approx(4 * (0.302 * 0.602) ** 2 * 0.018 / (2 * (0.302 + 0.602)), rel=1e-12)


def test_solid_rectangle() -> None:
    A, Iy, Iz, torsion = area_moments(Rectangle(width=0.6, height=0.25))
    assert (A, Iy, Iz) == pytest.approx(integrals(0.3, 0.125), rel=1e-12)
    # Saint-Venant's series; the formula is within 0.4 %.
    a, b = 0.3, 0.125
    series = sum(np.tanh(n * pi * a / (2 * b)) / n**5 for n in range(1, 200, 2))
    assert torsion == pytest.approx(16 * a * b**3 * (1 / 3 - 64 * b / (pi**5 * a) * series), rel=4e-3)
    assert area_moments(Rectangle(width=0.25, height=0.6))[3] == torsion


def test_round_sections() -> None:
    d, t = 0.07, 0.01
    assert area_moments(Rod(diameter=d)) == pytest.approx((pi * d**2 / 4, *2 * [pi * d**4 / 64], pi * d**4 / 32))
    hollow = [a - b for a, b in zip(area_moments(Rod(diameter=d)), area_moments(Rod(diameter=d - 2 * t)), strict=True)]
    assert area_moments(Tube(diameter=d, wall=t)) == pytest.approx(hollow, rel=1e-12)
    assert beam_properties(Rod(diameter=d), STEEL) == rod(d, STEEL)


def test_properties_of_a_beam() -> None:
    section = Properties(A=1e-2, Iy=2e-5, Iz=3e-5, J=4e-5, mass_factor=1.1)
    beam = beam_properties(section, STEEL)
    assert (beam.EA, beam.EIy, beam.EIz) == pytest.approx((2.1e9, 4.2e6, 6.3e6))
    assert (beam.GJ, beam.m, beam.j) == pytest.approx((2.1e11 / 2.6 * 4e-5, 1.1 * 78.5, 1.1 * 7850 * 5e-5))
