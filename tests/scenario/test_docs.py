"""The YAML examples of docs/scenarios.md are accepted as they stand."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from feedsim.scenario import load

ROOT = Path(__file__).resolve().parents[2]
BLOCKS = re.findall(r"^```yaml\n(.*?)^```", (ROOT / "docs" / "scenarios.md").read_text(encoding="utf-8"), re.M | re.S)
MACHINE_KEYS = {"modes", "pose", "cycles", "path"}


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.split("\n")[0][:30])
def test_example_loads(tmp_path: Path, block: str) -> None:
    data: dict[str, Any] = yaml.safe_load(block)
    folder = ROOT / "scenarios" / "machines" / "test_centre"
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "z_setpoint.csv").write_text("")
    for name in ("acme_drive.fmu", "acme_friction.fmu"):
        (tmp_path / name).write_text("")
    whole: dict[str, Any] = {"name": "s", "motions": [{"kind": "dwell", "duration": "1 s"}]}
    if data.keys() & (MACHINE_KEYS | {"axes"}):
        machine = yaml.safe_load((folder / "machine.yaml").read_text(encoding="utf-8"))
        axes = {name: axis | data.get("axes", {}).get(name, {}) for name, axis in machine["axes"].items()}
        machine |= data | {"axes": axes}
        whole["machine"] = machine | {key: str(folder / machine[key]) for key in ("modes", "structure")}
    else:
        whole |= data | {"machine": str(folder)}
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(whole), encoding="utf-8")
    assert load(tmp_path / "s.yaml").name == whole["name"]


def test_there_are_examples() -> None:
    assert len(BLOCKS) >= 8
