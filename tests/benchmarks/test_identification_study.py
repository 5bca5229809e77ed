"""A log of each kind, judged as `make identification-study` judges 320: an interval is a promise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import identification_logs as logs
import pytest
from identification_study import BY_CHANCE, Outcome, judged, summary, told

from feedsim.foundation.errors import Finding

# Of the kinds that cost least; the study has them all.
KINDS = (
    "good", "position_only_1um", "no_slow_speeds", "strokes_only", "sines_only", "clipped", "warms_5", "warms_30",
    "one_way", "wrong_time", "wrong_length",
)  # fmt: skip


@pytest.mark.extensive
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_called_estimated_holds_the_truth_or_a_warning_names_the_cause(kind: str, tmp_path: Path) -> None:
    flaws = () if kind == "good" else (kind,)
    found = judged(logs.made(f"{kind}-0", flaws, tmp_path))
    if flaws and logs.FLAWS[kind].wrong:
        assert "InputError" in found.refused
        assert "unit" in found.refused
        return
    assert not found.refused
    assert found.seconds < 60
    # Beyond chance; the share within 95 % is the study's.
    far = {name: off for name, off in found.missed.items() if abs(off) > BY_CHANCE}
    assert not far or found.named, told(found)
    if not flaws:
        assert not far
        # Its strokes go from slow to fast once.
        assert {finding.code for finding in found.warnings} <= {"warming-not-separated"}


def test_a_wrong_valley_of_the_first_fits_is_left(tmp_path: Path) -> None:
    """The three starts that look best all lead to an engaging zone 40 % too wide, with sigma_0 18 deviations off."""
    found = judged(logs.made("good-31", (), tmp_path))
    assert {"sigma_0", "W", "gamma"} <= set(found.off)
    assert not {name: off for name, off in found.missed.items() if abs(off) > BY_CHANCE}, told(found)


def test_the_study_counts() -> None:
    right = Outcome("good-0", (), "", "", {"F_C": 0.5}, {"F_C": 0.01}, {"F_C": 0.02}, {"F_C": "estimated"}, (), (), 2.0)
    chance = replace(right, off={"F_C": -2.5})
    silent = replace(right, flaws=("clipped",), off={"F_C": 9.0})
    named = replace(silent, warnings=(Finding("record-clipped", "doubt", "the torque is cut off at 3 N.m"),))
    refused = replace(right, refused="InputError: unit", off={}, states={})
    lines = summary([right, chance, silent, named, refused])
    assert "| F_C | 4 | 25.0 % | 2 | 1 |" in lines
    assert "| good | 3 | 1 | 1 | 0 | 1 | 0 |" in lines
    assert "| clipped | 2 | 0 | 0 | 1 | 0 | 1 |" in lines
    assert "| rms | 1 |" in lines
    assert "MISSED F_C: +1 %, says +- 2 % (sigma), +9.0 sigmas" in told(silent)


def test_every_flaw_and_every_pair_that_goes_together_has_logs() -> None:
    every = logs.names(320)
    assert len(every) == 320 == len({name for name, _ in every})
    kinds = {flaws for _, flaws in every}
    assert kinds >= {(), *((flaw,) for flaw in logs.FLAWS), ("clipped", "one_way"), ("position_only_1um", "warms_30")}
    assert not kinds & {("strokes_only", "sines_only"), ("warms_5", "warms_30")}
