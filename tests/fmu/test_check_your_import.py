"""docs/importing.md, "Check your import": its script and its command, run as they stand."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def check(archive: Path, folder: Path, script: str) -> subprocess.CompletedProcess[str]:
    """Pairs by the document's script, then the command."""
    (folder / "check_import.py").write_text(script, encoding="utf-8")
    command = [sys.executable, "check_import.py", str(archive), "checked"]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    pairs = run.stdout.split()
    assert len(pairs) >= 4
    feedsim = [sys.executable, "-c", "from feedsim.cli import entry; entry()"]
    return subprocess.run([*feedsim, "compare", *pairs], cwd=folder, capture_output=True, text=True)


@pytest.fixture(scope="module")
def script() -> str:
    text = (ROOT / "docs" / "importing.md").read_text(encoding="utf-8")
    section = text[text.index("## Check your import") :]
    match = re.search(r"```python\n(.*?)```", section, re.DOTALL)
    assert match
    return match[1]


@pytest.mark.extensive
@pytest.mark.parametrize("unit", ["friction", "friction_gms", "plant", "controller", "setpoint"])
def test_all_the_same(unit: str, script: str, fmus: Path, tmp_path: Path) -> None:
    found = check(fmus / f"{unit}.fmu", tmp_path, script)
    assert found.returncode == 0, found.stdout + found.stderr


def test_other_numbers_are_different(script: str, fmus: Path, tmp_path: Path) -> None:
    assert "for each in parameters}" in script
    off = script.replace("for each in parameters}", 'for each in parameters} | {"sigma_0": 300.3}')
    found = check(fmus / "friction.fmu", tmp_path, off)
    assert found.returncode == 1, found.stdout + found.stderr
    assert "M_fr" in found.stdout
