"""Units that are ready without pint are what pint makes of them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from feedsim import units

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("expression", units.READY)
def test_ready_units_are_those_of_pint(expression: str) -> None:
    found = units.unit(expression)
    assert (found.factor, found.dimension) == units.by_pint(expression, expression)


def test_shipped_files_need_no_pint() -> None:
    """A quarter of a second; whoever adds a unit to a shipped file adds it to the table."""
    code = (
        "import sys; from feedsim import scenario, units; "
        "[scenario.load(f) for f in sys.argv[1:]]; "
        "[scenario.load_structure(scenario.load(f).machine.structure) for f in sys.argv[1:]]; "
        "units.unit('m').kind; "
        "assert 'pint' not in sys.modules"
    )
    files = [ROOT / "scenarios" / f"{name}.yaml" for name in ("xz_circle", "z_positioning", "one_axis")]
    subprocess.run([sys.executable, "-c", code, *map(str, files)], check=True)
