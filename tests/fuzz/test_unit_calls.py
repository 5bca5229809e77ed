"""A minute of the units' fuzzer, always the same one: the kept inputs, then changed ones (units.py)."""

import platform
from pathlib import Path

import pytest

from fuzz import units

SECONDS = 9  # of each of the six units; the rest of the minute compiles them


@pytest.mark.extensive
@pytest.mark.skipif(platform.system() == "Windows", reason="the driver maps files as POSIX has it")
@pytest.mark.parametrize("unit", units.UNITS)
def test_units_withstand_what_a_fuzzer_makes_up(unit: str, fmus: Path, tmp_path: Path) -> None:
    program = units.build(unit, fmus, tmp_path)
    outcome = units.fuzz(program, units.kept_inputs(unit, tmp_path), SECONDS, seed=1)
    assert outcome.finding is None, f"{outcome.report}\nthe input: {outcome.finding}"
    assert outcome.calls > 10_000  # of the kept inputs alone


def test_the_sum_has_all_units() -> None:
    outcomes = [units.Outcome(1200, 7, None, ""), units.Outcome(34, 1, None, "")]
    assert units.total(outcomes) == "all 2 units: 1,234 calls, 8 instances"
    assert "machine" in units.UNITS
