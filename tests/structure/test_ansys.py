"""Models from ANSYS .full files: the file that comes with the reader, and messages that need no file at all."""

from __future__ import annotations

import importlib.util
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from fe_models import dense_modes
from scipy import sparse

from feedsim.cli import main
from feedsim.foundation.errors import InputError
from feedsim.scenario.structure_checks import load_structure
from feedsim.structure.build import check
from feedsim.structure.matrices import ansys
from feedsim.structure.matrices.build import ImportedModel, import_model


def bundled() -> Path | None:
    """The .full file in the reader's package, found without importing it."""
    try:
        found = importlib.util.find_spec("ansys.mapdl.reader")
    except ImportError:
        return None
    if found is None or found.origin is None:
        return None
    return Path(found.origin).parent / "examples" / "file.full"


needs_reader = pytest.mark.skipif(bundled() is None, reason="the package ansys-mapdl-reader is not installed")


def structure(folder: Path, **changes: Any) -> ImportedModel:
    keys: dict[str, Any] = {
        "kind": "ansys",
        "damping": {"ratio": "2 %"},
        "units": {"length": "m", "mass": "kg"},
        "full": "file.full",
    }
    (folder / "structure.yaml").write_text(yaml.safe_dump(keys | changes))
    return import_model(load_structure(folder))


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A folder with the bundled file."""
    source = bundled()
    assert source is not None
    shutil.copyfile(source, tmp_path / "file.full")
    return tmp_path


@needs_reader
def test_the_bundled_file_has_its_known_modes(model: Path) -> None:
    """A square beam, hence the pair; 1283.200, 1283.200 and 5781.975 Hz are what ANSYS finds."""
    read = structure(model)
    (note,) = read.notes
    assert note.code == "freedom-constrained"
    assert note.text.startswith("63 degrees")
    assert len(read.assembly.labels) == 963 - 63
    assert (read.assembly.stiffness - read.assembly.stiffness.T).nnz == 0
    assert np.all(read.assembly.stiffness.diagonal() > 0)
    frequency, _ = dense_modes(read.assembly)
    # Known to a thousandth of a hertz.
    np.testing.assert_allclose(frequency[:3], [1283.200, 1283.200, 5781.975], rtol=0, atol=5e-4)
    # 2 g, which the unit check finds little for a machine.
    warnings = check(read.assembly)
    assert "model-mass-unusual" in [finding.code for finding in warnings]


@needs_reader
def test_ports_and_nodes_by_number(model: Path) -> None:
    (model / "ports.csv").write_text(
        "port,node,direction,coefficient\ntcp_X,22,UX,0.5\ntcp_X,1,UX,0.5\ntcp_Z,22,uz,1\n"
    )
    (model / "nodes.csv").write_text("node,x,y,z,body\n1,0,0,0,beam\n22,0.001,0,0,beam\n")
    read = structure(model, ports="ports.csv", nodes="nodes.csv", units={"length": "mm", "mass": "t"})
    assert ("port-on-constrained", "tcp_X") in [(note.code, note.place) for note in read.notes]
    place = {label: i for i, label in enumerate(read.assembly.labels)}
    assert "node 1 ux" not in place
    assert np.flatnonzero(read.assembly.ports["tcp_X"]).tolist() == [place["node 22 ux"]]
    assert read.assembly.ports["tcp_X"][place["node 22 ux"]] == 0.5
    geometry = read.assembly.geometry
    assert geometry is not None
    assert geometry.dofs.tolist()[0] == [-1] * 6
    assert geometry.dofs.tolist()[1] == [place[f"node 22 {d}"] for d in ("ux", "uy", "uz")] + [-1] * 3
    assert geometry.nodes[1, 0] == pytest.approx(1e-6)
    (model / "ports.csv").write_text("port,node,direction,coefficient\ntcp_X,1,UX,1\n")
    with pytest.raises(InputError, match=r"port 'tcp_X' acts on constrained degrees of freedom alone \(node 1 ux\)"):
        structure(model, ports="ports.csv")
    (model / "ports.csv").write_text("port,node,direction,coefficient\ntcp_X,22,ROTX,1\n")
    with pytest.raises(InputError, match=r"ports\.csv:2: node 22 has no degree of freedom rx; it has ux, uy, uz"):
        structure(model, ports="ports.csv")


@needs_reader
def test_the_reader_is_loaded_without_its_pictures(model: Path) -> None:
    structure(model)
    assert "pyvista" not in sys.modules
    assert "ansys.mapdl.reader" not in sys.modules  # nor is a stand-in left for those who want the package itself
    structure(model)


@needs_reader
@pytest.mark.parametrize("content", [b"", b"no such thing", bytes(5000)], ids=["empty", "text", "zeros"])
def test_no_full_file(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "file.full").write_bytes(content)
    with pytest.raises(InputError, match=r"file\.full: cannot be read as an ANSYS \.full file"):
        structure(tmp_path)


def test_without_the_reader_the_message_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file.full").write_bytes(b"anything")
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    for name in [name for name in sys.modules if name.startswith("ansys")]:
        monkeypatch.delitem(sys.modules, name)
    with pytest.raises(InputError, match=r"ansys-mapdl-reader, which is not installed: make ansys"):
        structure(tmp_path)


class Reader:
    """Stands in for the reader: two nodes with three degrees of freedom, of which node 1's are constrained."""

    def __init__(self, file: Path, **header: Any) -> None:
        self._header = {"ncefull": 0} | header
        self.const = np.array([[1, 0], [1, 1], [1, 2]])
        self.reference = np.array([[node, d] for node in (1, 2) for d in range(3)])
        self.mass: Any = sparse.csc_matrix(np.triu(np.diag([0.0, 0, 0, 2, 2, 2])))
        self.stiffness: Any = sparse.csc_matrix(
            np.triu(np.pad(np.array([[5.0, 1, 0], [1, 6, 1], [0, 1, 7]]), ((3, 0), (3, 0))))
        )

    def load_km(self, as_sparse: bool, sort: bool) -> tuple[Any, Any, Any]:
        assert as_sparse
        assert not sort
        return self.reference, self.stiffness, self.mass


def with_reader(folder: Path, monkeypatch: pytest.MonkeyPatch, kinds: list[int], **changes: Any) -> ImportedModel:
    """Import through the stand-in; ``changes`` replace what it holds."""

    def opened(file: Path) -> Reader:
        header = changes.pop("header", {})
        reader = Reader(file, **header)
        for name, value in changes.items():
            setattr(reader, name, value)
        return reader

    (folder / "file.full").write_bytes(b"anything")
    monkeypatch.setattr(ansys, "_reader", lambda: SimpleNamespace(FullFile=opened))
    monkeypatch.setattr(ansys, "_kinds", lambda file: kinds)
    return structure(folder)


def test_the_upper_triangle_becomes_the_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read = with_reader(tmp_path, monkeypatch, [1, 2, 3]).assembly
    assert read.labels == ("node 2 ux", "node 2 uy", "node 2 uz")
    assert read.stiffness.toarray().tolist() == [[5, 1, 0], [1, 6, 1], [0, 1, 7]]


def test_which_degrees_of_freedom_there_are_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A plane frame has UX, UY and ROTZ: the third is no displacement."""
    assert with_reader(tmp_path, monkeypatch, [1, 2, 6]).assembly.labels[2] == "node 2 rz"


def test_a_solid_in_a_model_with_rotations(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert with_reader(tmp_path, monkeypatch, [1, 2, 3, 4, 5, 6]).assembly.labels[2] == "node 2 uz"


def test_what_cannot_be_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fault(kinds: list[int], **changes: Any) -> str:
        with pytest.raises(InputError) as caught:
            with_reader(tmp_path, monkeypatch, kinds, **changes)
        return str(caught.value)

    assert "file.full: 4 constraint equations (CE, CP, RBE3, bonded contact by MPC)" in fault(
        [1, 2, 3], header={"ncefull": 4}
    )
    assert "file.full: no mass matrix in it; the file of a modal analysis (ANTYPE,MODAL)" in fault([1, 2, 3], mass=None)
    assert "file.full: no stiffness matrix in it" in fault([1, 2, 3], stiffness=None)
    assert "degrees of freedom other than displacements and rotations (ANSYS numbers [20])" in fault([1, 2, 20])
    assert "file.full: nodes with [3] of 4 degrees of freedom; which ones is not known" in fault([1, 2, 6, 5])

    def lumped(*_: Any, **__: Any) -> Any:
        raise NotImplementedError("Unable to read a lumped mass matrix")

    assert "Unable to read a lumped mass matrix; LUMPM,OFF" in fault([1, 2, 3], load_km=lumped)


@needs_reader
def test_the_bundled_file_as_the_documentation_uses_it(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A structure without axes goes through the command."""
    (model / "structure.yaml").write_text(
        "kind: ansys\ndamping: {ratio: 2 %}\ncutoff: 6000 Hz\nunits: {length: mm, mass: t}\nfull: file.full\n"
    )
    assert main(["machine", "build", str(model), "--out", str(model / "out")]) == 0
    rows = (model / "out" / "modes.csv").read_text().splitlines()[1:]
    # the known frequencies have three decimals
    assert [float(row.split(",")[1]) for row in rows] == pytest.approx([1283.200, 1283.200, 5781.975], abs=1e-3)
    assert "0 rigid and 3 elastic modes" in capsys.readouterr().out
