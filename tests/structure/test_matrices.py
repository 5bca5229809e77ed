"""Models from Matrix Market files: the same modes as the reference, in any units, and a message for each fault."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from fe_models import STRUCTURES, chain, dense_modes, write_market

from feedsim.foundation.errors import InputError
from feedsim.scenario.structure_checks import load_structure
from feedsim.structure.assembly import Assembly
from feedsim.structure.build import check
from feedsim.structure.matrices.build import ImportedModel, import_model

REFERENCE = Path(__file__).resolve().parents[2] / "scenarios" / "machines" / "test_centre" / "modes.csv"
SHIPPED = STRUCTURES / "matrix_market"
PORTS = [f"{quantity}_{axis}" for quantity in ("n", "x", "tcp") for axis in "XYZ"]


def structure(folder: Path, **changes: Any) -> ImportedModel:
    """The model of the files in a folder."""
    keys: dict[str, Any] = {
        "kind": "matrices",
        "damping": {"ratio": "2 %"},
        "mass": "mass.mtx",
        "stiffness": "stiffness.mtx",
        "axes": ["X"],
        "ports": "ports.csv",
    }
    keys = {key: value for key, value in (keys | changes).items() if value is not None}
    (folder / "structure.yaml").write_text(yaml.safe_dump(keys))
    return import_model(load_structure(folder))


def small(folder: Path, ports: str = "port,dof,coefficient\nn_X,0,1\nx_X,2,1\n") -> None:
    """Three masses on two springs."""
    mass, stiffness = chain([10.0, 20.0, 30.0], [4e6, 9e6])
    write_market(folder / "mass.mtx", mass)
    write_market(folder / "stiffness.mtx", stiffness)
    (folder / "ports.csv").write_text(ports)


def fault(folder: Path, *words: str, **changes: Any) -> str:
    """The message of a model that is refused; it holds these words."""
    with pytest.raises(InputError) as caught:
        structure(folder, **changes)
    for word in words:
        assert word in str(caught.value)
    return str(caught.value)


def reference() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Frequencies [Hz] and shapes at the ports that the matrices were solved to once, by another program."""
    with REFERENCE.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return (
        np.array([float(row["frequency [Hz]"]) for row in rows]),
        {port: np.array([float(row[port]) for row in rows]) for port in PORTS},
    )


def assert_reference(assembly: Assembly) -> None:
    """Frequencies to 1e-8; products b_i c_j to 1e-8 of the largest of their pair of ports: a product that is a
    millionth of that (a scale where the mode hardly moves) carries the round-off of the large ones."""
    frequency, ports = reference()
    elastic = frequency > 0
    found, shapes = dense_modes(assembly)
    found, shapes = found[: len(frequency)], shapes[:, : len(frequency)]
    assert np.all(found[~elastic] < 1e-3)
    np.testing.assert_allclose(found[elastic], frequency[elastic], rtol=1e-8)
    values = {port: shapes.T @ assembly.ports[port] for port in PORTS}
    for i in PORTS:
        for j in PORTS:
            expected, computed = ports[i] * ports[j], values[i] * values[j]
            np.testing.assert_allclose(
                computed[elastic], expected[elastic], rtol=0, atol=1e-8 * np.max(np.abs(expected[elastic]))
            )
            # Rigid modes are a space: only the sum over them says something.
            scale = np.sum(ports[i][~elastic] ** 2) ** 0.5 * np.sum(ports[j][~elastic] ** 2) ** 0.5
            assert abs(computed[~elastic].sum() - expected[~elastic].sum()) <= 1e-8 * scale


def test_the_shipped_matrices_have_the_reference_modes() -> None:
    read = import_model(load_structure(SHIPPED))
    assert read.notes == ()
    assert read.assembly.axes == ("X", "Y", "Z")
    assert read.assembly.pose == {"X": 0.8, "Y": 0.327, "Z": 0.1}
    assert read.assembly.labels[456] == "dof 456"
    assert check(read.assembly) == []
    assert_reference(read.assembly)


def nodes_of_the_test_centre() -> list[tuple[str, str, list[int]]]:
    """Name, body and degrees of freedom of each node; rotors have their angle alone, as rz here."""
    nodes = [(f"S{i}", "structure", list(range(6 * i, 6 * i + 6))) for i in range(63)]
    for d, axis in enumerate("XYZ"):
        first = 378 + 79 * d
        nodes += [(f"{axis}{i}", f"screw {axis}", list(range(first + 6 * i, first + 6 * i + 6))) for i in range(13)]
        nodes.append((f"rotor{axis}", f"rotor {axis}", [-1] * 5 + [first + 78]))
    return nodes


def test_millimetres_and_tonnes_by_nodes_give_the_same_modes(tmp_path: Path) -> None:
    """The shipped model as a program in mm, t, s would write it, ports by node and direction."""
    source = import_model(load_structure(SHIPPED)).assembly
    nodes = nodes_of_the_test_centre()
    direction = np.empty(615, dtype=int)
    owner = [""] * 615
    for name, _, dofs in nodes:
        for d, dof in enumerate(dofs):
            if dof >= 0:
                direction[dof], owner[dof] = d, name
    turns = direction >= 3
    # Entry by entry: N/m = 1e-3 N/mm, N.m/m = 1 N.mm/mm, N.m = 1e3 N.mm; kg = 1e-3 t, kg.m = t.mm, kg.m2 = 1e3 t.mm2.
    powers = np.add.outer(turns.astype(int), turns.astype(int)) - 1
    write_market(tmp_path / "mass.mtx", source.mass.toarray() * 10.0 ** (3 * powers))
    write_market(tmp_path / "stiffness.mtx", source.stiffness.toarray() * 10.0 ** (3 * powers))
    with (tmp_path / "nodes.csv").open("w") as stream:
        stream.write("node,name,body,x,y,z,ux,uy,uz,rx,ry,rz\n")
        for k, (name, body, dofs) in enumerate(nodes):
            numbers = ",".join(str(dof) if dof >= 0 else "" for dof in dofs)
            stream.write(f"{name},{body} {name},{body},{10 * k},0,-5,{numbers}\n")
    (tmp_path / "lines.csv").write_text("from,to\nS0,S1\nX0,rotorX\n")
    words = ["UX", "uy", "3", "ROTX", "ry", "6"]
    with (tmp_path / "ports.csv").open("w") as stream:
        stream.write("port,node,direction,coefficient\n")
        for port, vector in source.ports.items():
            for dof in np.flatnonzero(vector):
                # mm of travel per rad of rotation; a motor's angle is seen at rotations and stays a number
                factor = 1000.0 if turns[dof] and not port.startswith("n_") else 1.0
                stream.write(f"{port},{owner[dof]},{words[direction[dof]]},{float(vector[dof] * factor)!r}\n")
    read = structure(
        tmp_path, axes=["X", "Y", "Z"], nodes="nodes.csv", lines="lines.csv", units={"length": "mm", "mass": "t"}
    )
    assert_reference(read.assembly)
    np.testing.assert_allclose(read.assembly.mass.toarray(), source.mass.toarray(), rtol=1e-14)
    assert read.assembly.labels[456] == "rotor X rotorX rz"
    geometry = read.assembly.geometry
    assert geometry is not None
    assert geometry.bodies[0] == "structure"
    assert geometry.nodes[3].tolist() == pytest.approx([0.03, 0, -0.005])
    assert geometry.dofs[-1].tolist() == [-1, -1, -1, -1, -1, 614]
    assert geometry.lines.tolist() == [[0, 1], [63, 76]]


def test_an_angle_seen_at_a_displacement_is_per_length(tmp_path: Path) -> None:
    """A rotor modelled as a mass J / h2 that travels h per radian: 1/h in 1/mm becomes 1/m."""
    small(tmp_path, "port,node,direction,coefficient\nn_X,1,ux,0.5\nx_X,3,ux,1\n")
    (tmp_path / "nodes.csv").write_text("node,x,y,z,ux\n1,0,0,0,0\n2,1,0,0,1\n3,2,0,0,2\n")
    read = structure(tmp_path, nodes="nodes.csv", units={"length": "mm", "mass": "kg", "time": "ms"})
    assert read.assembly.ports["n_X"].tolist() == [500.0, 0.0, 0.0]
    assert read.assembly.ports["x_X"].tolist() == [0.0, 0.0, 1.0]
    # kg/ms2 = 1e6 kg/s2; the mass stays.
    assert read.assembly.stiffness[0, 0] == pytest.approx(4e12, rel=1e-15)
    assert read.assembly.mass[0, 0] == 10.0


def test_a_general_file_is_read_and_rounding_is_levelled(tmp_path: Path) -> None:
    small(tmp_path)
    mass, stiffness = chain([10.0, 20.0, 30.0], [4e6, 9e6])
    stiffness[0, 1] *= 1 + 1e-13
    write_market(tmp_path / "stiffness.mtx", stiffness, "general")
    read = structure(tmp_path).assembly
    assert (read.stiffness - read.stiffness.T).nnz == 0
    assert read.stiffness[0, 1] == pytest.approx(-4e6, rel=1e-12)
    np.testing.assert_array_equal(read.mass.toarray(), mass)


def test_a_dense_file_is_read(tmp_path: Path) -> None:
    small(tmp_path)
    mass, _ = chain([10.0, 20.0, 30.0], [1, 1])
    numbers = "\n".join(f"{value:.17g}" for value in mass.T.ravel())
    (tmp_path / "mass.mtx").write_text(f"%%MatrixMarket matrix array real general\n3 3\n{numbers}\n")
    assert structure(tmp_path).assembly.mass.nnz == 3


def test_degrees_of_freedom_with_nothing_are_constraints(tmp_path: Path) -> None:
    """Many programs leave rows of constrained degrees of freedom in place, empty."""
    mass, stiffness = chain([10.0, 20.0, 30.0], [4e6, 9e6])
    wide = [np.pad(matrix, ((1, 0), (1, 0))) for matrix in (mass, stiffness)]
    write_market(tmp_path / "mass.mtx", wide[0])
    write_market(tmp_path / "stiffness.mtx", wide[1])
    (tmp_path / "ports.csv").write_text("port,dof,coefficient\nn_X,1,1\nn_X,0,-1\nx_X,3,1\n")
    read = structure(tmp_path)
    assert read.assembly.labels == ("dof 1", "dof 2", "dof 3")
    np.testing.assert_array_equal(read.assembly.stiffness.toarray(), stiffness)
    assert read.assembly.ports["n_X"].tolist() == [1.0, 0.0, 0.0]
    assert [(note.code, note.place) for note in read.notes] == [
        ("freedom-constrained", ""), ("port-on-constrained", "n_X"),
    ]  # fmt: skip
    (tmp_path / "ports.csv").write_text("port,dof,coefficient\nn_X,0,1\nx_X,3,1\n")
    fault(tmp_path, "port 'n_X' acts on constrained degrees of freedom alone (dof 0): nothing moves")


def test_without_axes_a_model_can_be_looked_at(tmp_path: Path) -> None:
    small(tmp_path)
    read = structure(tmp_path, axes=None, ports=None).assembly
    assert read.axes == ()
    assert sorted(read.ports) == ["tcp_X", "tcp_Y", "tcp_Z"]
    assert not any(vector.any() for vector in read.ports.values())


PORT_FAULTS = {
    "unknown port": ("n_X,0,1\nx_X,2,1\ntpc_X,1,1\n", "ports.csv:4: unknown port 'tpc_X'; did you mean 'tcp_X'?"),
    "of another axis": ("n_X,0,1\nx_X,2,1\nn_Y,1,1\n", "ports.csv:4: unknown port 'n_Y'"),
    "missing": ("n_X,0,1\n", "no row of port 'x_X' (linear scale: travel out; axes: names X)"),
    "no such degree": ("n_X,0,1\nx_X,3,1\n", "ports.csv:3: column 'dof': there is no degree of freedom 3; they count"),
    "negative": ("n_X,-1,1\nx_X,2,1\n", "ports.csv:2: column 'dof': '-1' is no whole number from 0 to 2"),
    "text": ("n_X,0,one\nx_X,2,1\n", "ports.csv:2: column 'coefficient': 'one' is no finite number"),
    "infinite": ("n_X,0,1e999\nx_X,2,1\n", "ports.csv:2: column 'coefficient': '1e999' is no finite number"),
    "twice": ("n_X,0,1\nn_X,0,1\nx_X,2,1\n", "ports.csv:3: port 'n_X' names dof 0 twice"),
    "cells": ("n_X,0\nx_X,2,1\n", "ports.csv:2: 2 cells; the header has 3"),
}


@pytest.mark.parametrize(("rows", "message"), PORT_FAULTS.values(), ids=PORT_FAULTS)
def test_faulty_ports(tmp_path: Path, rows: str, message: str) -> None:
    small(tmp_path, f"port,dof,coefficient\n{rows}")
    fault(tmp_path, message)


def test_all_faults_of_ports_come_at_once(tmp_path: Path) -> None:
    small(tmp_path, "port,dof,coefficient\nn_X,7,1\nx_X,2,much\n")
    message = fault(tmp_path, "not a usable table of ports: 2 problems", "ports.csv:2:", "ports.csv:3:")
    assert len(message.splitlines()) == 3


def test_ports_by_node_need_nodes(tmp_path: Path) -> None:
    small(tmp_path, "port,node,direction,coefficient\nn_X,1,ux,1\nx_X,3,ux,1\n")
    fault(tmp_path, "ports.csv:2: the table names nodes; without a table of nodes (nodes: ...) only dof counts")
    (tmp_path / "nodes.csv").write_text("node,x,y,z,ux\n1,0,0,0,0\n2,1,0,0,1\n3,2,0,0,2\n")
    assert structure(tmp_path, nodes="nodes.csv").assembly.labels == ("node 1 ux", "node 2 ux", "node 3 ux")
    for row, message in {
        "n_X,9,ux,1": "ports.csv:2: there is no node '9' with degrees of freedom",
        "n_X,1,rz,1": "ports.csv:2: node 1 has no degree of freedom rz; it has ux; no column of",
        "n_X,1,along,1": "ports.csv:2: column 'direction': 'along' is none of ux, uy, uz, rx, ry, rz",
    }.items():
        (tmp_path / "ports.csv").write_text(f"port,node,direction,coefficient\n{row}\nx_X,3,ux,1\n")
        fault(tmp_path, message, nodes="nodes.csv")


NODE_FAULTS = {
    "header": ("node,x,y,ux\n1,0,0,0\n", "nodes.csv:1: a table of nodes begins with a header: node, x, y, z"),
    "empty": ("", "nodes.csv:1: a table of nodes begins with a header: node, x, y, z; the file is empty"),
    "no degrees": ("node,x,y,z\n1,0,0,0\n", "needs columns ux, uy, uz, rx, ry, rz"),
    "column": ("node,x,y,z,bdy,ux\n1,0,0,0,0,0\n", "nodes.csv:1: unknown column 'bdy'; did you mean 'body'?"),
    "node twice": ("node,x,y,z,ux\n1,0,0,0,0\n1,0,0,0,1\n", "nodes.csv:3: node 1 is in line 2 already"),
    "degree twice": ("node,x,y,z,ux\n1,0,0,0,0\n2,0,0,0,0\n", "nodes.csv:3: degree of freedom 0 belongs to node 1 ux"),
    "position": ("node,x,y,z,ux\n1,0,here,0,0\n", "nodes.csv:2: column 'y': 'here' is no finite number"),
}


@pytest.mark.parametrize(("text", "message"), NODE_FAULTS.values(), ids=NODE_FAULTS)
def test_faulty_nodes(tmp_path: Path, text: str, message: str) -> None:
    small(tmp_path)
    (tmp_path / "nodes.csv").write_text(text)
    fault(tmp_path, message, nodes="nodes.csv")


def test_a_line_to_nowhere(tmp_path: Path) -> None:
    small(tmp_path)
    (tmp_path / "nodes.csv").write_text("node,x,y,z,ux\n1,0,0,0,0\n2,1,0,0,1\n3,2,0,0,2\n")
    (tmp_path / "lines.csv").write_text("from,to\n1,2\n2,8\n")
    fault(tmp_path, "lines.csv:3: there is no node 8 in", nodes="nodes.csv", lines="lines.csv")


def test_millimetres_without_nodes_are_refused(tmp_path: Path) -> None:
    small(tmp_path)
    fault(
        tmp_path,
        "units.length is mm, and whether dof 0 is a displacement or a rotation is not known",
        units={"length": "mm", "mass": "t"},
    )
    # Masses alone scale all entries alike.
    assert structure(tmp_path, units={"length": "m", "mass": "t"}).assembly.mass[0, 0] == 1e4


HEADER = "%%MatrixMarket matrix coordinate real symmetric\n"
FILE_FAULTS = {
    "no such format": ("mass\n", "mass.mtx: cannot be read as a Matrix Market file"),
    "not square": (
        "%%MatrixMarket matrix coordinate real general\n3 2 1\n1 1 1\n",
        "mass.mtx: the mass matrix has 3 rows and 2 columns; it must be square",
    ),
    "complex": (
        "%%MatrixMarket matrix coordinate complex symmetric\n3 3 1\n1 1 1 0\n",
        "mass.mtx: the mass matrix is complex symmetric by its first line",
    ),
    "skew": (
        "%%MatrixMarket matrix coordinate real skew-symmetric\n3 3 1\n2 1 1\n",
        "is real skew-symmetric by its first line; 'real symmetric' or 'real general' is expected",
    ),
    "cut off": (HEADER + "3 3 3\n1 1 1\n2 2 1\n", "mass.mtx: cannot be read as a Matrix Market file"),
    "outside": (HEADER + "3 3 1\n4 1 1\n", "mass.mtx: cannot be read as a Matrix Market file"),
    "text": (HEADER + "3 3 1\n1 1 heavy\n", "mass.mtx: cannot be read as a Matrix Market file"),
    "another size": (HEADER + "2 2 2\n1 1 1\n2 2 1\n", "the mass matrix has 2 degrees of freedom; the"),
    "both triangles": (
        HEADER + "3 3 5\n1 1 9\n2 2 9\n3 3 9\n2 1 1\n1 2 1\n",
        "mass.mtx: the entry in row 1, column 2 (from 1) occurs twice",
    ),
}


@pytest.mark.parametrize(("text", "message"), FILE_FAULTS.values(), ids=FILE_FAULTS)
def test_faulty_files(tmp_path: Path, text: str, message: str) -> None:
    small(tmp_path)
    (tmp_path / "mass.mtx").write_text(text)
    fault(tmp_path, message)


def test_everything_constrained(tmp_path: Path) -> None:
    small(tmp_path)
    for name in ("mass", "stiffness"):
        (tmp_path / f"{name}.mtx").write_text(HEADER + "3 3 0\n")
    fault(tmp_path, "all 3 degrees of freedom are constrained; nothing can move", axes=None, ports=None)


def test_the_structure_file_is_checked_with_its_lines(tmp_path: Path) -> None:
    small(tmp_path)
    fault(tmp_path, "missing key 'ports'; the axes X need ports n_X, x_X and so on", ports=None)
    fault(tmp_path, "no such file", "heavy.mtx", mass="heavy.mtx")
    fault(tmp_path, "the pose names Y; the axes are X", pose={"Y": "1 mm"})
    fault(tmp_path, "axis 'X' occurs twice", axes=["X", "X"])
    message = fault(tmp_path, "'inch' is not allowed here", units={"length": "inch", "mass": "kg"})
    assert re.search(r"structure\.yaml:\d+", message)
