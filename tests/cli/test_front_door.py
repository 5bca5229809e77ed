"""What `feedsim --help` and `import feedsim` do not wait for: told by the modules loaded, not by the time taken."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HEAVY = {"numpy", "scipy", "matplotlib", "fmpy", "pydantic", "yaml", "ruckig", "distributed", "dask", "pyarrow"}
# What neither a run nor a check of a scenario needs, beyond the report's own.
NOT_FOR_A_RUN = {"scipy.optimize", "scipy.signal", "scipy.stats", "distributed", "dask", "pyarrow", "matplotlib.pyplot"}
# Nor what reads files of other kinds.
NOT_FOR_A_RUN |= {"feedsim.scenario.study", "feedsim.files.columns", "feedsim.simulation.ssp"}
# Nor what makes modes of other programs' matrices, or of a grid of poses.
NOT_FOR_A_RUN |= {"feedsim.structure.build", "feedsim.structure.matrices", "feedsim.structure.poses"}


def loaded(code: str) -> set[str]:
    """Names of the modules that are there when `code` is through, in a process of its own."""
    told = f"import sys, json\ntry:\n    {code}\nfinally:\n    print(json.dumps(sorted(sys.modules)), file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True)
    return set(json.loads(done.stderr.splitlines()[-1 if not done.stderr.startswith("[") else 0]))


@pytest.mark.parametrize(
    "code",
    [
        "import feedsim",
        "from feedsim.cli import main; main(['--help'])",
        "from feedsim.cli import main; main(['--version'])",
        "from feedsim.cli import main; main(['run', '--help'])",
        "from feedsim.cli import main; main(['no such command'])",
        "from feedsim.cli import main; main(['run', 'no_such_file.yaml'])",
    ],
)
def test_no_library_is_loaded(code: str) -> None:
    assert not loaded(code) & HEAVY


def test_a_run_loads_what_it_needs(fmus: Path, tmp_path: Path) -> None:
    scenario = ROOT / "scenarios" / "z_positioning.yaml"
    words = ["run", str(scenario), "--fmus", str(fmus), "--out", str(tmp_path / "out"), "--quiet"]
    names = loaded(f"from feedsim.cli import main; sys.exit(main({words!r}))")
    assert (tmp_path / "out" / "report.html").is_file()
    assert "jinja2" in names  # so the list is the right one
    assert "matplotlib" not in names  # curves are drawn by the page
    assert not names & NOT_FOR_A_RUN


def test_only_the_program_itself_tunes_the_garbage_collector() -> None:
    """Who calls main() from a program of their own keeps their settings."""
    code = """
import gc, sys
from feedsim import cli
usual = gc.get_threshold()
assert cli.main(["tools", "schema"]) == 0
assert gc.get_threshold() == usual
sys.argv = ["feedsim", "tools", "schema"]
try:
    cli.entry()
except SystemExit as end:
    assert end.code == 0
assert gc.get_threshold()[0] > usual[0] and gc.isenabled()
"""
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
