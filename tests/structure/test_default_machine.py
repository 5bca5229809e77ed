"""The default machine's structure file gives the matrices, modes and masses that another program gave."""

from __future__ import annotations

import csv
import hashlib
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import mmread

from feedsim.structure import read_modes
from feedsim.structure.assembly import Assembly
from feedsim.structure.geometry.assemble import assemble
from structure_helpers import GIVEN_POSE, MACHINES, default_structure, dense_modes

Floats = NDArray[np.float64]
DATA = Path(__file__).resolve().parent / "data" / "test_centre"
MATRICES = MACHINES.parent / "structures" / "matrix_market"
# What the given data is must not change with what is computed from it.
GIVEN = {
    MATRICES / "mass.mtx": "4506ccbc7ec22ad4ba90f8199a45806bf5ba910d796797d2a3f7d0fd3248db12",
    MATRICES / "stiffness.mtx": "1e47b8a5c54058edfc6f51f35ab72edfae762dd5eb7b155b001673ffb6574a2a",
    MACHINES / "test_centre" / "modes.csv": "c556bba2bcbc2a8976c6bb1b51db9412ee3a55b0f37bfbaa824717361aab928e",
}
AXES = ("X", "Y", "Z")


@cache
def machine() -> Assembly:
    return assemble(default_structure(), GIVEN_POSE)


@cache
def modes() -> tuple[Floats, Floats]:
    return dense_modes(machine())


@pytest.mark.parametrize("name", ["mass", "stiffness"])
def test_matrices_entry_by_entry(name: str) -> None:
    given = mmread(MATRICES / f"{name}.mtx").toarray()
    found = getattr(machine(), name)
    assert found.shape == (615, 615)
    assert abs(found - found.T).max() == 0
    # The same sums in another order: rounding of the largest entry.
    assert np.abs(found.toarray() - given).max() <= 1e-14 * np.abs(given).max()


def test_the_given_data_is_what_it_was() -> None:
    for file, digest in GIVEN.items():
        assert hashlib.sha256(file.read_bytes()).hexdigest() == digest, file


def test_port_vectors() -> None:
    given: dict[str, Floats] = {}
    with (DATA / "port_vectors.csv").open(encoding="utf-8", newline="") as stream:
        for row in csv.DictReader(stream):
            given.setdefault(row["port"], np.zeros(615))[int(row["dof"])] += float(row["coefficient"])
    assert list(machine().ports) == [*(f"n_{axis}" for axis in AXES), *(f"x_{axis}" for axis in AXES), *TOOL]
    for port, vector in given.items():
        # Coefficients are of the order of 1 (shares, lever arms in m): rounding.
        assert machine().ports[port] == pytest.approx(vector, abs=1e-14)


TOOL = ("tcp_X", "tcp_Y", "tcp_Z")


def test_frequencies() -> None:
    table = read_modes(MACHINES / "test_centre" / "modes.csv", AXES)
    found, _ = modes()
    assert np.count_nonzero(found < 1000) == len(table.frequency) == 93
    # Rigid modes come out of rounding: 1e-16 of the largest squared frequency (about 1e5 Hz) is 1e-3 Hz.
    assert np.all(found[:3] < 0.01)
    assert found[3:93] == pytest.approx(table.frequency[3:], rel=1e-6)


def test_products_of_mode_shapes() -> None:
    table = read_modes(MACHINES / "test_centre" / "modes.csv", AXES)
    ports = list(table.ports)
    given = np.column_stack([table.ports[port] for port in ports])
    found = (modes()[1].T @ np.column_stack([machine().ports[port] for port in ports]))[:93]
    # Rotations and displacements made comparable: each port by its largest share in a mode.
    size = np.abs(given).max(axis=0)
    given, found = given / size, found / size
    for k in range(3, 93):
        products, expected = np.outer(found[k], found[k]), np.outer(given[k], given[k])
        # Sign and length of a shape are free in no product; 1e-6 is what the frequencies are held to.
        assert np.abs(products - expected).max() <= 1e-6 * np.abs(expected).max(), f"mode {k}"
    # The basis of the rigid modes is arbitrary, their sum is not.
    products, expected = found[:3].T @ found[:3], given[:3].T @ given[:3]
    assert np.abs(products - expected).max() <= 1e-6 * np.abs(expected).max()


def test_who_is_where() -> None:
    geometry = machine().geometry
    assert geometry is not None
    count = len(geometry.names)
    assert geometry.nodes.shape == (count, 3)
    assert geometry.dofs.shape == (count, 6)
    assert len(geometry.bodies) == count
    assert geometry.lines.max() < count
    assert list(dict.fromkeys(geometry.bodies)) == [
        *("bed", "column", "slide", "ram", "screw X", "rotor X", "screw Y", "rotor Y", "screw Z", "rotor Z")
    ]
    # Every degree of freedom belongs to one node; rotors have one, at 456, 535 and 614.
    assert sorted(geometry.dofs[geometry.dofs >= 0]) == list(range(615))
    rotors = [int(geometry.dofs[geometry.names.index(f"rotor {axis}")].max()) for axis in AXES]
    assert rotors == [456, 535, 614]
    assert [machine().labels[rotor] for rotor in rotors] == [f"rotor {axis} angle" for axis in AXES]
    assert len(machine().labels) == len(set(machine().labels)) == 615
    where = {name: position for name, position in zip(geometry.names, geometry.nodes, strict=True)}
    assert where["bed.B1.3"] == pytest.approx([-0.4, 0.55, 0.45])
    assert where["slide.ruf"] == pytest.approx([-0.885 + 0.8 + 0.22, 1.32 + 0.327 + 0.24, 0.35])
    assert where["ram.R.7"] == pytest.approx([-0.085, 1.647, 0.75])
    assert machine().labels[6 * geometry.names.index("bed.B1.3")] == "bed.B1.3 ux"


def test_lead_and_inertia_of_the_rigid_modes() -> None:
    b = modes()[1].T[:3] @ np.column_stack([machine().ports[f"n_{axis}"] for axis in AXES])
    x = modes()[1].T[:3] @ np.column_stack([machine().ports[f"x_{axis}"] for axis in AXES])
    # Rigid shapes carry the eigensolver's error, 1e-8 at most.
    assert np.linalg.solve(b, x) == pytest.approx(np.eye(3) * 0.020 / (2 * np.pi), abs=1e-9)
    assert 1 / np.sum(b**2, axis=0) == pytest.approx([0.08592, 0.02645, 0.01639], abs=5e-6)  # as many digits are given
