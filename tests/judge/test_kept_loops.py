"""Loops that were judged in an earlier process are the very ones that would be judged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from feedsim.linear.judgement import judge
from feedsim.scenario import Machine, load
from feedsim.simulation import judge as loops
from feedsim.simulation.judge import loops_of
from feedsim.structure import checked_modes

FILE = Path(__file__).resolve().parents[2] / "scenarios" / "z_positioning.yaml"


def machine(*changes: str) -> Machine:
    return load(FILE, changes).machine


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Machine]:
    """The machines whose loops were judged, not read."""
    monkeypatch.setenv("FEEDSIM_CACHE", str(tmp_path))
    found: list[Machine] = []
    monkeypatch.setattr(loops, "judge", lambda machine, modes: found.append(machine) or judge(machine, modes))
    return found


@pytest.mark.parametrize("gain", ["5 (m/min)/mm", "29 (m/min)/mm", "1e-3 (m/min)/mm"])
def test_kept_loops_are_those_that_were_judged(gain: str, asked: list[Machine]) -> None:
    subject = machine(f"machine.axes.Z.drive.K_v={gain}")
    modes = checked_modes(subject)
    first, second = loops_of(subject, modes), loops_of(subject, modes)
    assert len(asked) == 1
    assert repr(first) == repr(second) == repr(tuple(replace(each, growing=int(each.growing)) for each in first))
    assert first == judge(subject, modes)


@pytest.mark.parametrize(
    "change", ["axes.Z.drive.K_p=1 N.m.s/rad", "axes.Z.friction.sigma_0=20000 N.m/rad", "cycles.control=250 us"]
)
def test_another_machine_is_judged_anew(change: str, asked: list[Machine]) -> None:
    for subject in (machine(), machine(f"machine.{change}")):
        loops_of(subject, checked_modes(subject))
    assert len(asked) == 2


def test_other_modes_are_judged_anew(asked: list[Machine]) -> None:
    subject = machine()
    modes = checked_modes(subject)
    for frequency in (modes.frequency, 1.001 * modes.frequency):
        loops_of(subject, replace(modes, frequency=frequency))
    assert len(asked) == 2
