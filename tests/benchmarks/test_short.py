"""Every benchmark program runs: it links, measures, finds the same bits where it compares, and leaves its files.

The cases are a fraction as long as those of `make bench`, and nothing is asserted about time.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
PROGRAMS = sorted(path.stem for path in BENCHMARKS.glob("*.py") if "bench = arguments(" in path.read_text("utf-8"))


def test_they_are_all_here() -> None:
    assert {"accuracy", "cycle", "duration", "eigen", "floor", "foreign_units", "growth", "one_unit", "setpoints",
            "stability", "startup", "sweep", "worst_case"} <= set(PROGRAMS)  # fmt: skip


@pytest.mark.parametrize("name", PROGRAMS)
def test_it_runs(name: str, fmus: Path, tmp_path: Path) -> None:
    command = [sys.executable, str(BENCHMARKS / f"{name}.py"), "--short", "--json", str(tmp_path)]
    if "images=True" in (BENCHMARKS / f"{name}.py").read_text("utf-8"):
        command += ["--images", str(tmp_path)]
    environment = os.environ | {"FEEDSIM_FMUS": str(fmus)}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=600)
    assert done.returncode == 0, done.stderr
    left = json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8"))
    assert left["short"] is True
    assert left["results"] or name == "one_unit"  # which needs other simulators
    assert left["tables"]
    assert all(table in done.stdout for table in left["tables"])
