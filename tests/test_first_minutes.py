"""What docs/importing.md asks an integrator to do first. The other tools' recipes: tests/importers/test_snippets.py."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from feedsim import cli

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "importing.md").read_text(encoding="utf-8")
SECTION = PAGE.partition("## First minutes\n")[2].partition("\n## ")[0]


@pytest.fixture(scope="module")
def folder(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with fmus/ and scenarios/, as the page has it."""
    found = tmp_path_factory.mktemp("integrator")
    for name, target in (("fmus", fmus), ("scenarios", ROOT / "scenarios")):
        (found / name).symlink_to(target, target_is_directory=True)
    return found


def test_one_unit_in_fmpy(folder: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", SECTION, re.DOTALL)
    done = subprocess.run(
        [sys.executable, "-c", code + "print(result['M_fr'].max())"],
        cwd=folder,
        env=os.environ | {"MPLBACKEND": "agg"},  # no window
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    # Above Coulomb friction (1.6 N.m), below static friction (2.1 N.m) with the rise with speed, 0.4 ln(1 + 5/3).
    assert 1.6 < float(done.stdout.split()[-1]) < 2.1 + 0.4


def test_the_machine_as_one_file(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (command,) = re.findall(r"```\nfeedsim (export .*\.ssp)\n```", SECTION)
    monkeypatch.chdir(folder)
    assert cli.main(command.split()) == 0
    with zipfile.ZipFile(folder / command.split()[-1]) as written:
        assert "SystemStructure.ssd" in written.namelist()


def test_links_within_the_page_lead_somewhere() -> None:
    headings = {re.sub(r"[^\w -]", "", each).lower().replace(" ", "-") for each in re.findall(r"(?m)^##+ (.*)$", PAGE)}
    assert set(re.findall(r"\]\(#([^)]*)\)", PAGE)) <= headings
