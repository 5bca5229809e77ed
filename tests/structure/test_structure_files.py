"""Structure files: what the shipped ones say, files within files, the JSON Schema for editors."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from feedsim.foundation.errors import InputError
from feedsim.scenario.schema import json_schema
from feedsim.scenario.structure_checks import load_structure
from feedsim.structure.geometry.assemble import Assembler
from structure_helpers import MACHINES, default_structure, geometry, one_axis_data, one_axis_text

ROOT = Path(__file__).resolve().parents[2]


def test_a_structure_built_in_python_is_checked_too() -> None:
    structure = default_structure()
    broken = structure.model_copy(update={"sections": {}})
    with pytest.raises(InputError, match="there is no section 'bed_long'"):
        Assembler(broken)


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        load_structure(tmp_path / "nowhere.yaml")
    with pytest.raises(InputError, match=r"structure\.yaml"):
        load_structure(tmp_path)


def test_a_body_may_have_a_file_of_its_own(tmp_path: Path) -> None:
    data = one_axis_data()
    (tmp_path / "table.yaml").write_text(yaml.safe_dump(data["bodies"]["table"]), encoding="utf-8")
    data["bodies"]["table"] = "table.yaml"
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(data), encoding="utf-8")
    assert geometry(tmp_path / "s.yaml").bodies == geometry(MACHINES / "one_axis").bodies


def test_what_the_default_machine_says_of_itself() -> None:
    structure = default_structure()
    assert structure.name == "Test centre"
    assert "Synthetic" in structure.note
    assert structure.damping.ratio == 0.02
    (step,) = structure.damping.steps
    assert (step.below, step.ratio) == pytest.approx((2 * np.pi * 30, 0.06))
    assert {name: axis.travel for name, axis in structure.axes.items()} == {
        "X": (0, 1.77),
        "Y": (0, 0.655),
        "Z": (0, 0.685),
    }


def test_documented_example_is_the_shipped_machine() -> None:
    text = (ROOT / "docs" / "structure.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```yaml\n(.*?)^```", text, re.M | re.S)
    assert yaml.safe_load(blocks[0]) == one_axis_data()


class TestSchema:
    jsonschema = pytest.importorskip("jsonschema")
    validator = jsonschema.Draft202012Validator(json_schema("structure"))

    def errors(self, data: Any) -> bool:
        return any(True for _ in self.validator.iter_errors(data))

    @pytest.mark.parametrize("name", ["test_centre", "one_axis"])
    def test_shipped_structures_are_valid(self, name: str) -> None:
        self.jsonschema.Draft202012Validator.check_schema(json_schema("structure"))
        text = (MACHINES / name / "structure.yaml").read_text(encoding="utf-8")
        assert not self.errors(yaml.safe_load(text))

    @pytest.mark.parametrize(
        ("old", "new"),
        [
            ("kind: geometry", "kind: geometri"),
            ("kind: geometry\n", ""),
            ("E: 60 GPa", "E: 60 mm"),
            ("nodes: plate", "nodes: plate-0"),
            ("rail: base.block", "rail: block"),
            ("direction: X", "direction: x"),
            ("against: base.block.4", "against: base"),
            ("kind: rectangle", "kind: box"),
            ("count: 9", "count: nine"),
            ("pitch: 10 mm", "pitsch: 10 mm"),
        ],
    )
    def test_usual_mistakes_are_refused(self, old: str, new: str) -> None:
        assert old in one_axis_text()
        assert self.errors(yaml.safe_load(one_axis_text().replace(old, new)))

    def test_every_key_is_described(self) -> None:
        schema = json_schema("structure")
        silent = [
            f"{name}.{key}"
            for name, group in schema["$defs"].items()
            for key, part in group.get("properties", {}).items()
            if key != "kind" and "description" not in part and "$ref" not in str(part)
        ]
        assert silent == []
