"""Loops that were judged in an earlier process are the very ones that would be judged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from feedsim.linear import judgement
from feedsim.linear.judgement import judge
from feedsim.scenario import Drive, Machine, load
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


CHANGES = (
    ("drive.K_p=4 N.m.s/rad",),
    ("drive.T_n=6 ms", "drive.D=0.8"),
    ("drive.K_v=3 (m/min)/mm", "drive.ramp_speed_setpoint=false"),
    ("drive.reference_model=false",),
    ("drive.speed_integrator=false", "drive.speed_window=4"),
    ("drive.filter_1.type=low_pass", "drive.filter_1.f=700 Hz", "drive.filter_1.D_den=0.7"),
    ("drive.ideal_current_loop=true",),
    ("drive.R=0.9 Ohm",),
    ("drive.measuring={indirect: true}",),
    ("friction.sigma_0=20000 N.m/rad",),
)


def judged_alone(subject: Machine) -> tuple[judgement.Loop, ...]:
    """With all that its drives have, and nothing known of machines before."""
    forget()
    frictions = subject.shipped_frictions
    axes = tuple(subject.axes)
    drives = tuple(
        judgement.LinearDrive(subject.shipped_drive(name, "a test"), subject.cycles, axis.I_P)
        for name, axis in subject.axes.items()
    )
    bristles = tuple(judgement.Bristles.of(frictions[name]) for name in axes)
    plant = judgement.ModalPlant.of(checked_modes(subject), axes)
    return judgement.SampledAxes(axes, drives, bristles, plant).judged()


def forget() -> None:
    for memory in (judgement._judged_axes, judgement._plant, judgement._ports, judgement._block,
                   judgement._locked_modes):  # fmt: skip
        memory.cache_clear()


def test_what_machines_have_in_common_changes_no_bit_of_their_loops(monkeypatch: pytest.MonkeyPatch) -> None:
    """Machines of a study one after the other, and each of them alone."""
    subjects = [machine(), *(machine(*(f"machine.axes.Z.{each}" for each in change)) for change in CHANGES)]
    alone = [judged_alone(subject) for subject in subjects]
    assert len({repr(loops) for loops in alone}) == len(subjects)
    forget()
    for order in (range(len(subjects)), range(len(subjects) - 1, -1, -1)):
        judgement._judged_axes.cache_clear()
        for k in order:
            assert judge(subjects[k], checked_modes(subjects[k])) == alone[k], CHANGES[k - 1]
    forget()
    monkeypatch.setattr(judgement, "MAX_KNOWN_VALUES", 0)  # contours that are too long to be remembered
    assert judge(subjects[1], checked_modes(subjects[1])) == alone[1]
    assert judgement._ports.cache_info().currsize == judgement._block.cache_info().currsize == 0


def test_every_field_of_a_drive_is_known_to_the_loops_or_outside_of_them() -> None:
    """A new field of a drive has to be sorted in, or two machines would have the answer of one."""
    seen = {field for fields in judgement.SEEN_FIELDS.values() for field in fields}
    elsewhere = {"K_v", "speed_window", "measuring"}  # in the loops themselves, not in a block
    assert {*judgement.OUTSIDE_LOOPS, *seen, *elsewhere} == set(Drive.model_fields)
    assert not seen & set(judgement.OUTSIDE_LOOPS)
