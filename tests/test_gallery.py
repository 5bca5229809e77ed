"""The examples run as they stand, and each has its words and its picture."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs" / "site"))
import prose  # noqa: E402  (a tool of the documentation, in no package)

SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
EACH_TIME = 2  # scripts: another pair every day, all with FEEDSIM_DOCS_ALL=1
FIRST = datetime.now(UTC).toordinal() * EACH_TIME
TODAY = SCRIPTS if os.environ.get("FEEDSIM_DOCS_ALL") == "1" else [
    SCRIPTS[(FIRST + number) % len(SCRIPTS)] for number in range(EACH_TIME)
]  # fmt: skip


@pytest.mark.parametrize("script", TODAY, ids=lambda path: path.stem)
def test_it_runs_prints_and_draws(script: Path, fmus: Path, tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, script], cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    assert (tmp_path / f"{script.stem}.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_it_has_words_and_a_picture(script: Path) -> None:
    title, _, words = (ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or "").partition("\n\n")
    assert title.endswith(".")
    assert len(words.split()) > 15
    assert prose.faults(words) == []
    picture = ROOT / "docs" / "images" / "gallery" / f"{script.stem}.png"
    assert picture.read_bytes().startswith(b"\x89PNG"), "make pictures"
    assert picture.stat().st_size < 120_000
    assert f"[{script.name}]({script.name})" in (ROOT / "examples" / "README.md").read_text(encoding="utf-8")
