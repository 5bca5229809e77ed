"""Models from CalculiX: the shipped example, and, where the solver is installed, its own frequencies as the oracle."""

from __future__ import annotations

import math
import shutil
import subprocess
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from fe_models import STRUCTURES, dense_modes

from feedsim.foundation.errors import InputError
from feedsim.scenario.structure_checks import load_structure
from feedsim.structure.build import check
from feedsim.structure.matrices.build import ImportedModel, import_model

SHIPPED = STRUCTURES / "calculix"
CCX = shutil.which("ccx")
needs_ccx = pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed; Debian: calculix-ccx")
# CalculiX prints frequencies with seven digits, 0.1234567E+03: half of the last one is at most 5e-7 of the value.
DIGITS = 5e-7
# 14 digits of stiffness leave 3e-14 of it in rigid motion, where the first bending mode at 106 Hz has 8e-7: 0.02 Hz.
RIGID = 0.1


def run(folder: Path, job: str) -> None:
    """Have CalculiX calculate job.inp in the folder."""
    assert CCX is not None
    done = subprocess.run([CCX, job], cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout[-2000:]
    assert "*ERROR" not in done.stdout, done.stdout[-2000:]


def printed_frequencies(file: Path) -> list[float]:
    """Frequencies [1/time] from the table of eigenvalues in a .dat file."""
    found = []
    for line in file.read_text().splitlines():
        cells = line.split()
        if len(cells) == 5 and cells[0].isdecimal():
            found.append(float(cells[3]))
        elif found and "P A R T I C I P A T I O N" in line:
            break
    return found


def structure(folder: Path, **changes: Any) -> ImportedModel:
    """The model of the matrices that CalculiX left in a folder."""
    keys: dict[str, Any] = {
        "kind": "calculix",
        "damping": {"ratio": "2 %"},
        "units": {"length": "mm", "mass": "t"},
        "stiffness": "matrices.sti",
        "mass": "matrices.mas",
        "dofs": "matrices.dof",
        "mesh": "mesh.inc",
    }
    keys = {key: value for key, value in (keys | changes).items() if value is not None}
    (folder / "structure.yaml").write_text(yaml.safe_dump(keys))
    return import_model(load_structure(folder))


def beam(folder: Path, *, extra: str = "", clamped: bool = True, kind: str = "C3D20", across: int = 1) -> None:
    """A steel beam of 20-node bricks, six along and some across, 400 x 20 x 30 mm, clamped at x = 0, and two jobs."""
    count, length, width, height = 6, 400.0, 20.0, 30.0
    ids: dict[tuple[int, int, int], int] = {}

    def node(*at: int) -> int:
        return ids.setdefault((at[0], at[1], at[2]), len(ids) + 1)

    elements = []
    for e, j, k in product(range(count), range(across), range(across)):
        low = [(2 * e, 2 * j), (2 * e + 2, 2 * j), (2 * e + 2, 2 * j + 2), (2 * e, 2 * j + 2)]
        corners = [(x, y, 2 * k + end) for end in (0, 2) for x, y in low]
        pairs = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
        middles = [tuple((p + q) // 2 for p, q in zip(corners[a], corners[b], strict=True)) for a, b in pairs]
        elements.append([node(*corner) for corner in corners] + [node(*middle) for middle in middles])
    lines = ["** A beam.", "*NODE, NSET=all"]
    lines += [
        f"{n}, {x * length / count / 2!r}, {y * width / across / 2!r}, {z * height / across / 2!r}"
        for (x, y, z), n in ids.items()
    ]
    lines.append(f"*Element, type={kind}, elset=beam")
    for e, members in enumerate(elements, start=1):
        lines += [f"{e}, " + ", ".join(map(str, members[:12])) + ",", ", ".join(map(str, members[12:]))]
    lines += ["*MATERIAL, NAME=steel", "*ELASTIC", "210000., 0.3", "*DENSITY", "7.85e-9"]
    lines += ["*SOLID SECTION, ELSET=beam, MATERIAL=steel"]
    if clamped:
        lines += ["*BOUNDARY", *(f"{n}, 1, 3" for (x, _, _), n in ids.items() if x == 0)]
    (folder / "mesh.inc").write_text("\n".join(lines) + "\n" + extra)
    for job, option in (("matrices", ", SOLVER=MATRIXSTORAGE\n"), ("frequencies", "\n12\n")):
        (folder / f"{job}.inp").write_text(f"*INCLUDE, INPUT=mesh.inc\n*STEP\n*FREQUENCY{option}*END STEP\n")


@needs_ccx
@pytest.mark.parametrize(("kind", "across"), [("C3D20", 1), ("C3D20R", 2)])
def test_a_beam_has_the_frequencies_that_calculix_finds(tmp_path: Path, kind: str, across: int) -> None:
    """C3D20R, CalculiX's usual brick, has a singular mass matrix: 8 integration points for 20 nodes."""
    beam(tmp_path, kind=kind, across=across)
    run(tmp_path, "matrices")
    run(tmp_path, "frequencies")
    expected = printed_frequencies(tmp_path / "frequencies.dat")
    assert len(expected) == 12
    # Weak axis first, 0.5596 sqrt(E I / (m l^4)) by Euler and Bernoulli; shear lowers it by less than a per cent,
    # and the clamped section, which cannot contract across, raises it: at most as if no section could, E / (1 - nu2).
    slender = 3.51602 / (2 * math.pi) * math.sqrt(210e9 * 20e-3**2 / 12 / 7850 / 0.4**4)
    assert 0.99 * slender < expected[0] < slender / math.sqrt(1 - 0.3**2)
    read = structure(tmp_path).assembly
    frequency, _ = dense_modes(read)
    np.testing.assert_allclose(frequency[:12], expected, rtol=DIGITS)
    # A beam of 1.9 kg, less what its clamped nodes carry.
    assert "model-mass-unusual" in [finding.code for finding in check(read)]


@needs_ccx
def test_a_free_beam_keeps_six_rigid_modes_and_its_mass(tmp_path: Path) -> None:
    beam(tmp_path, clamped=False)
    run(tmp_path, "matrices")
    run(tmp_path, "frequencies")
    expected = np.array(printed_frequencies(tmp_path / "frequencies.dat"))
    read = structure(tmp_path).assembly
    frequency, _ = dense_modes(read)
    assert np.all(expected[:6] < RIGID)
    assert np.all(frequency[:6] < RIGID)
    np.testing.assert_allclose(frequency[6:12], expected[6:12], rtol=DIGITS)
    geometry = read.geometry
    assert geometry is not None
    along = np.zeros(len(read.labels))
    along[geometry.dofs[:, 0]] = 1
    assert along @ (read.mass @ along) == pytest.approx(7850 * 0.4 * 0.02 * 0.03, rel=1e-9)
    assert np.ptp(geometry.nodes, axis=0).tolist() == pytest.approx([0.4, 0.02, 0.03])
    assert set(geometry.bodies) == {"beam"}
    assert len(geometry.lines) == 6 * 8 + 4  # four along each brick, four around each of seven sections


@needs_ccx
def test_an_eliminated_degree_of_freedom_is_no_port(tmp_path: Path) -> None:
    """Tied nodes move, but are in no matrix: dropping such a row without a word would be wrong."""
    beam(tmp_path, extra="*EQUATION\n2\n64, 2, 1., 70, 2, -1.\n")
    run(tmp_path, "matrices")
    (tmp_path / "ports.csv").write_text("port,node,direction,coefficient\ntcp_Y,64,uy,1\n")
    with pytest.raises(InputError) as caught:
        structure(tmp_path, ports="ports.csv")
    assert "ports.csv:2: node 64 has no degree of freedom uy; it has ux, uz; CalculiX has eliminated it" in str(
        caught.value
    )
    assert "name the node it depends on if it is tied" in str(caught.value)
    (tmp_path / "ports.csv").write_text("port,node,direction,coefficient\ntcp_Y,70,uy,1\n")
    assert structure(tmp_path, ports="ports.csv").assembly.ports["tcp_Y"].any()


@needs_ccx
def test_the_shipped_matrices_are_what_calculix_writes(tmp_path: Path) -> None:
    for file in SHIPPED.iterdir():
        if file.suffix in (".inp", ".inc"):
            shutil.copy(file, tmp_path)
    run(tmp_path, "matrices")
    run(tmp_path, "frequencies")
    for suffix in ("sti", "mas"):
        ours, theirs = (np.loadtxt(folder / f"matrices.{suffix}") for folder in (SHIPPED, tmp_path))
        np.testing.assert_array_equal(ours[:, :2], theirs[:, :2])
        # Written with 14 digits; another version of CalculiX or its compiler adds up in another order.
        np.testing.assert_allclose(ours[:, 2], theirs[:, 2], rtol=0, atol=1e-12 * np.max(np.abs(ours[:, 2])))
    assert (SHIPPED / "matrices.dof").read_text() == (tmp_path / "matrices.dof").read_text()
    frequency, _ = dense_modes(import_model(load_structure(SHIPPED)).assembly)
    expected = printed_frequencies(tmp_path / "frequencies.dat")
    np.testing.assert_allclose(frequency[1:8], expected[1:8], rtol=DIGITS)


def test_the_shipped_table_is_a_machine_of_one_axis() -> None:
    """Its rigid mode has the inertia J + m h^2 and the lead h; the numbers are those of mesh.inc."""
    read = import_model(load_structure(SHIPPED))
    assert check(read.assembly) == []
    assert read.notes == ()
    frequency, shapes = dense_modes(read.assembly)
    assert frequency[0] < RIGID
    assert frequency[1] == pytest.approx(219.5218, rel=DIGITS)  # CalculiX's own
    h = 0.020 / (2 * math.pi)
    n, x = (read.assembly.ports[port] @ shapes[:, 0] for port in ("n_X", "x_X"))
    assert x / n == pytest.approx(h, rel=1e-9)
    table = 7850 * 0.4 * 0.3 * 0.1
    # The rotor's 0.394784 t are 4 t.mm2 to six digits.
    assert 1 / n**2 == pytest.approx(0.004 + table * h**2, rel=1e-6)
    # A tool port is the mean of four nodes, which all travel with the table in rigid motion.
    assert read.assembly.ports["tcp_X"] @ shapes[:, 0] == pytest.approx(x, rel=1e-9)
    assert read.assembly.labels[-1] == "rotor node 100 ux"
    geometry = read.assembly.geometry
    assert geometry is not None
    assert geometry.bodies[-1] == "rotor"
    assert geometry.nodes[-1].tolist() == pytest.approx([-0.1, 0.15, 0.05])
    assert geometry.dofs[-1].tolist() == [90, -1, -1, -1, -1, -1]


def copy(folder: Path, **texts: str) -> None:
    """The shipped example, some of its files replaced."""
    for file in SHIPPED.iterdir():
        shutil.copyfile(file, folder / file.name)
    for name, text in texts.items():
        (folder / name.replace("_", ".")).write_text(text)


FAULTS = {
    "row beyond": ({"matrices_mas": "1 1 1.0\n92 92 1.0\n"}, "matrices.mas: row or column 92, but", "not of one job"),
    "two cells": ({"matrices_sti": "1 1\n"}, "matrices.sti: lines of row, column and value are expected"),
    "text": ({"matrices_sti": "1 1 stiff\n"}, "matrices.sti: lines of row, column and value are expected"),
    "from nought": ({"matrices_sti": "0 0 1.0\n"}, "matrices.sti: rows and columns are whole numbers from 1"),
    "both triangles": (
        {"matrices_sti": "1 1 9.0\n2 2 9.0\n1 2 1.0\n2 1 1.0\n"},
        "matrices.sti: the entry in row 1, column 2 (from 1) occurs twice",
    ),
    "no dofs": ({"matrices_dof": "\n"}, "matrices.dof: empty"),
    "dof": ({"matrices_dof": "1.1\n1.7\n"}, "matrices.dof:2: '1.7'; node.direction is expected, such as 12.3"),
    "dof twice": (
        {"matrices_dof": "1.1\n1.1\n"},
        "matrices.dof:2: node 1 ux occurs twice",
        "expands beams, shells and other flat elements into solids, whose",
        "or kind: matrices",
    ),
    "beams": (
        {
            "matrices_dof": "1.1\n1.1\n",
            "mesh_inc": "*ELEMENT, TYPE=B31, ELSET=a\n*ELEMENT, TYPE=C3D8\n*element,type=S8R\n",
        },
        "into solids (",
        "mesh.inc has B31, S8R), whose nodes share a number. Use solid elements",
    ),
    "no nodes": ({"mesh_inc": "*ELEMENT, TYPE=MASS\n"}, "mesh.inc: no nodes (*NODE) in it"),
    "position": ({"mesh_inc": "*NODE\n1, 0, up, 0\n"}, "mesh.inc:2: '1, 0, up, 0'; node, x, y, z are expected"),
    "unknown node": (
        {"mesh_inc": "*NODE\n1, 0, 0, 0\n*ELEMENT, TYPE=B31\n1, 1, 2\n"},
        "mesh.inc:4: an element on node 2, which no *NODE line defines before",
    ),
    "short element": (
        {"mesh_inc": "*NODE\n1, 0, 0, 0\n*ELEMENT, TYPE=C3D8\n1, 1, 1, 1\n"},
        "mesh.inc:4: an element of type C3D8 has 8 nodes",
    ),
    "no include": ({"mesh_inc": "*INCLUDE, INPUT=lost.inc\n"}, "lost.inc: cannot be read"),
    "endless": ({"mesh_inc": "*INCLUDE, INPUT=mesh.inc\n"}, "files include one another more than 8 deep"),
}


def test_a_result_where_a_matrix_is_needed(tmp_path: Path) -> None:
    copy(tmp_path)
    (tmp_path / "matrices.sti").rename(tmp_path / "matrices.frd")
    with pytest.raises(InputError, match=r"matrices\.frd is a result of CalculiX; store the matrices with \*FREQUENCY"):
        structure(tmp_path, stiffness="matrices.frd")


@pytest.mark.parametrize("case", FAULTS.values(), ids=FAULTS)
def test_faulty_files(tmp_path: Path, case: tuple[Any, ...]) -> None:
    texts, *words = case
    copy(tmp_path, **texts)
    with pytest.raises(InputError) as caught:
        structure(tmp_path)
    for word in words:
        assert word in str(caught.value)


def test_units_must_be_said(tmp_path: Path) -> None:
    copy(tmp_path)
    with pytest.raises(InputError, match="units: missing"):
        structure(tmp_path, units=None)


def test_nodes_come_from_one_source(tmp_path: Path) -> None:
    copy(tmp_path)
    (tmp_path / "nodes.csv").write_text("node,x,y,z\n1,0,0,0\n")
    with pytest.raises(InputError, match="nodes come from the mesh or from the table under 'nodes', not from both"):
        structure(tmp_path, nodes="nodes.csv")
    read = structure(tmp_path, nodes="nodes.csv", mesh=None).assembly
    assert read.geometry is not None
    assert len(read.geometry.nodes) == 1
    assert read.labels[0] == "node 1 ux"
