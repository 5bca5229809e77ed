"""The examples of docs/fe-import.md are accepted as they stand, and are the ones that are shipped."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from fe_models import ROOT, STRUCTURES, dense_modes

from feedsim.scenario.structure_checks import load_structure
from feedsim.structure.matrices.build import import_model
from feedsim.structure.matrices.tables import BY_NODE, FREEDOM_NAMES, NODE_COLUMNS, read_table

TEXT = (ROOT / "docs" / "fe-import.md").read_text(encoding="utf-8")
BLOCKS = {kind: re.findall(rf"^```{kind}\n(.*?)^```", TEXT, re.M | re.S) for kind in ("yaml", "csv")}
FILES = ("mass", "stiffness", "dofs", "mesh", "full", "ports", "nodes", "lines")


@pytest.mark.parametrize("block", BLOCKS["yaml"], ids=lambda block: block.split("\n")[0])
def test_structure_files_load(tmp_path: Path, block: str) -> None:
    data: dict[str, Any] = yaml.safe_load(block)
    for key in FILES:
        if key in data:
            (tmp_path / data[key]).write_text("")
    (tmp_path / "structure.yaml").write_text(block)
    assert load_structure(tmp_path).kind == data["kind"]  # type: ignore[attr-defined]


def test_there_is_an_example_of_each_kind() -> None:
    assert [yaml.safe_load(block)["kind"] for block in BLOCKS["yaml"]] == ["matrices", "ansys", "calculix"]


@pytest.mark.parametrize("folder", ["matrix_market", "calculix"])
def test_examples_are_those_shipped(folder: str) -> None:
    shipped = yaml.safe_load((STRUCTURES / folder / "structure.yaml").read_text())
    assert shipped in [yaml.safe_load(block) for block in BLOCKS["yaml"]]


def test_tables_are_read(tmp_path: Path) -> None:
    ports, nodes = BLOCKS["csv"]
    (tmp_path / "ports.csv").write_text(ports)
    (tmp_path / "nodes.csv").write_text(nodes)
    assert len(read_table(tmp_path / "ports.csv", "ports", [BY_NODE])) == 5
    rows = read_table(tmp_path / "nodes.csv", "nodes", [NODE_COLUMNS], ("name", "body", *FREEDOM_NAMES))
    assert rows[-1]["rx"] == "12"


def test_the_figures_it_quotes() -> None:
    frequency, _ = dense_modes(import_model(load_structure(STRUCTURES / "matrix_market")).assembly)
    kept = frequency[frequency <= 1000.0]
    assert (len(kept), f"{kept[3]:.2f}") == (93, "21.09")
    assert "3 rigid modes and 90 up to 1000 Hz, the first at 21.09 Hz" in TEXT
    frequency, _ = dense_modes(import_model(load_structure(STRUCTURES / "calculix")).assembly)
    quoted = ", ".join(f"{f:.2f}" for f in frequency[1:3]) + f" and {frequency[3]:.2f} Hz after the rigid mode"
    assert quoted in TEXT
