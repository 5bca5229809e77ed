"""What moves in a mode, in words and shares of kinetic energy."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array

from eigen_models import DEFAULT_DAMPING, TOOL, Floats, given
from feedsim.structure.assembly import Assembly, Geometry
from feedsim.structure.geometry.assemble import assemble
from feedsim.structure.solve import Motion, Share, Solution, solve, what_moves
from structure_helpers import GIVEN_POSE, default_structure


@cache
def default() -> Solution:
    model = assemble(default_structure(), GIVEN_POSE)
    return solve(model, cutoff=2e3 * math.pi, damping=DEFAULT_DAMPING, dense_limit=0)


def at(hertz: float) -> Motion:
    found = default()
    return found.moving[int(np.argmin(abs(found.modes.frequency - hertz)))]


def test_the_bed_rocks_at_21_hz() -> None:
    assert str(at(21.1)) == "bed 50 % (moving along Z and rocking about X), column 32 % (moving along Z)"
    assert str(at(46.9)).startswith("bed 77 % (rocking about X and moving along Z)")
    assert str(at(41.7)) == "bed 90 % (rocking about Y)"


def test_a_screw_between_its_bearings_deforms() -> None:
    assert str(at(107.06)) == "screw X 97 % (deforming along Y)"


def test_rigid_modes_turn_the_rotors() -> None:
    for axis, motion in zip("XYZ", default().moving, strict=False):
        shares = {share.body: share for share in motion.shares}
        assert shares[f"rotor {axis}"].words == shares[f"screw {axis}"].words == f"turning about {axis}"
        # Reflected inertia: rotor 0.0150, 0.0110, 0.0075 kg.m2 of J_tot.
        inertia, total = {"X": (0.0150, 0.08592), "Y": (0.0110, 0.02645), "Z": (0.0075, 0.01639)}[axis]
        assert shares[f"rotor {axis}"].energy == pytest.approx(inertia / total, abs=1e-3)
    assert {s.body: s.words for s in default().moving[2].shares}["ram"] == "moving along Z"


def test_shares_add_up_and_fall() -> None:
    for motion in default().moving:
        energies = [share.energy for share in motion.shares]
        assert sum(energies) == pytest.approx(1.0, abs=1e-9)
        assert energies == sorted(energies, reverse=True)


def test_without_geometry_the_labels_speak() -> None:
    model = given()
    labels = tuple(f"bed B1[{i}] ux" if i < 100 else f"node {i // 6} uy" for i in range(615))
    model = Assembly("given", model.mass, model.stiffness, model.ports, model.axes, labels, None, {})
    shape = np.zeros((615, 2))
    shape[3, 0] = shape[204, 1] = 1.0
    first, second = what_moves(model, shape)
    assert str(first) == "bed B1 100 %"
    assert str(second).startswith("node 34 ")


CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def moved(displacement: Floats) -> str:
    """Words for the motion (8, 3) of eight equal masses at the corners of a cube about (5, 6, 7) m."""
    dofs = np.full((8, 6), -1)
    dofs[:, :3] = np.arange(24).reshape(8, 3)
    names = tuple(f"block[{i}]" for i in range(8))
    geometry = Geometry(CUBE + np.array([5.0, 6.0, 7.0]), names, ("block",) * 8, dofs, np.empty((0, 2), dtype=np.int64))
    labels = tuple(f"{name} {d}" for name in names for d in ("ux", "uy", "uz"))
    nothing = {port: np.zeros(24) for port in ("n_X", "x_X", *TOOL)}
    mass = csc_array(diags_array(np.ones(24)))
    model = Assembly("block", mass, csc_array((24, 24)), nothing, ("X",), labels, geometry, {})
    return what_moves(model, displacement.reshape(24, 1))[0].shares[0].words


def test_words_of_plain_motions() -> None:
    for d, name in enumerate("XYZ"):
        assert moved(np.tile(np.eye(3)[d], (8, 1))) == f"moving along {name}"
        spin = np.cross(np.eye(3)[d], CUBE)
        assert moved(spin) == f"rocking about {name}"
        assert moved(spin * np.sign(CUBE[:, [d]])).startswith("deforming along ")
    # About an axis through the lower edge: more than half of the energy is the rotation's and the rest is named too.
    assert moved(np.cross([0.0, 0.0, 1.0], CUBE + np.array([0.0, 1.0, 0.0]))) == "rocking about Z and moving along X"
    assert moved(np.cross([0.0, 0.0, 1.0], CUBE + np.array([0.0, 4.0, 0.0]))) == "moving along X and rocking about Z"


def test_short_names_for_many_bodies() -> None:
    shares = tuple(Share(f"part {i}", energy, "") for i, energy in enumerate((0.4, 0.3, 0.15, 0.12, 0.03)))
    assert str(Motion(shares)) == "part 0 40 %, part 1 30 %, part 2 15 %"
    assert str(Motion(tuple(Share(f"node {i}", 0.05, "") for i in range(20)))) == "node 0 5 %"
