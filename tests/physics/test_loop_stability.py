"""What is said of the loops' stability, against runs in the time domain and against the closed form of all axes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from feedsim import scenario
from feedsim.analysis.linear import LinearSystem, unstable_poles
from feedsim.foundation.errors import InputError
from feedsim.linear.judgement import GAIN_MARGIN, PHASE_MARGIN, Loop, judge
from feedsim.scenario import Friction, Scenario, load_subject
from feedsim.simulation import cosim, nc
from feedsim.simulation.judge import check, judge_run
from feedsim.structure import Modes, checked_modes

MACHINES = Path(__file__).resolve().parents[2] / "scenarios" / "machines"
NEAR = 0.02  # share of a gain within which its limit is found
T_C, PULSE, KICK = 125e-6, 0.25, 0.02  # s; when the axis is kicked [s], and by how much [N.m]


def loop_of(loops: tuple[Loop, ...], axis: str, kind: str, state: str) -> Loop:
    return next(loop for loop in loops if (loop.axis, loop.kind, loop.state) == (axis, kind, state))


def planned(folder: Path, axis: str, state: str, *settings: str) -> Scenario:
    """An axis that goes 120 mm at constant speed, or that rests."""
    move = f"  - {{kind: move, by: {{{axis}: 120 mm}}, feed: 5000 mm/min}}\n" if state == "moving" else ""
    file = folder / "kicked.yaml"
    file.write_text(
        f"name: kicked\nmachine: {MACHINES / 'test_centre'}\nmotions:\n{move}"
        f"  - {{kind: dwell, duration: {0.1 if move else 1.3} s}}\n"
        f"recording: {{interval: 125 us, variables: [{axis}.n_a]}}\n"
    )
    return scenario.load(file, settings)


def growth(plan: Scenario, axis: str) -> float:
    """By which factor the speed that a kick leaves grows from one half of the steady motion to the other."""
    program, found = nc.plan(plan), []
    for kick in (0.0, KICK):
        torque = np.zeros((len(program.time) - 1) * 8 + 1)
        torque[round(PULSE / T_C) :][:16] = kick
        result = cosim.run(plan, program=program, torque_feedforward={axis: torque})
        found.append(np.array(result.trace[f"{axis}.n_a"]))
    time, left = result.trace.time, found[1] - found[0]
    early, late = (np.abs(left[(time > at) & (time < at + 0.1)]).max() for at in (0.35, 1.1))
    return float(late / early)


@pytest.mark.parametrize(
    ("axis", "kind", "state"),
    [
        ("Z", "position", "moving"),
        ("Z", "position", "at rest"),
        ("Y", "position", "moving"),
        ("X", "position", "at rest"),
        ("X", "speed", "at rest"),
    ],
)
def test_runs_grow_beyond_the_limit_and_decay_below(axis: str, kind: str, state: str, tmp_path: Path) -> None:
    machine = planned(tmp_path, axis, state).machine
    limit = loop_of(judge(machine, checked_modes(machine)), axis, kind, state).limit
    assert limit is not None
    key, unit = {"speed": ("K_p", "N.m.s/rad"), "position": ("K_v", "1/s")}[kind]
    for factor, grows in ((1 - NEAR, False), (1 + NEAR, True)):
        plan = planned(tmp_path, axis, state, f"machine.axes.{axis}.drive.{key}={factor * limit:.9g} {unit}")
        assert (growth(plan, axis) > 1) == grows, (factor, limit)
        loop = loop_of(judge(plan.machine, checked_modes(plan.machine)), axis, kind, state)
        assert loop.unstable == grows
        assert loop.limit == pytest.approx(limit, rel=1e-2)


def damped(modes: Modes, factor: float) -> Modes:
    return replace(modes, damping=modes.damping * factor)


@pytest.mark.extensive
@pytest.mark.parametrize(
    ("machine", "damping", "settings"),
    [
        ("test_centre", 1.0, ()),
        ("test_centre", 0.05, ()),
        (
            "test_centre",
            1.0,
            (
                "machine.axes.X.drive.filter_1={type: off}",
                "machine.axes.Z.drive.speed_window=8",
                "machine.axes.Z.drive.K_p=1 N.m.s/rad",
            ),
        ),
        ("test_centre", 1.0, ("machine.cycles.position=2 ms", "machine.axes.Y.drive.ideal_current_loop=true")),
        ("one_axis", 1.0, ()),
    ],
)
def test_limits_are_those_of_the_whole_system(machine: str, damping: float, settings: tuple[str, ...]) -> None:
    """Growing solutions of the closed form of all axes, counted at all components, begin at the limit."""
    subject = load_subject(MACHINES / machine, settings).machine
    modes = damped(checked_modes(subject), damping)
    for loop in judge(subject, modes):
        if loop.state != "moving":
            continue
        assert not loop.unstable
        if loop.limit is None:  # a speed loop with the ideal current loop
            assert subject.axes[loop.axis].drive.ideal_current_loop
            continue
        name = "K_p" if loop.kind == "speed" else "K_v"
        for factor, grows in ((1 - NEAR / 2, False), (1 + NEAR / 2, True)):
            factor = factor if loop.limit > loop.gain else 1 / factor
            axis = subject.axes[loop.axis]
            drive = axis.drive.model_copy(update={name: loop.limit * factor})
            axes = {**subject.axes, loop.axis: axis.model_copy(update={"drive": drive})}
            other = subject.model_copy(update={"axes": axes})
            closed = "speed" if loop.kind == "speed" else "position"
            assert (unstable_poles(LinearSystem(other, modes, closed)) > 0) == grows, (loop, factor)


def test_advice_has_the_usual_margins(tmp_path: Path) -> None:
    plan = planned(tmp_path, "Z", "moving", "machine.axes.Z.drive.K_v=30 (m/min)/mm")
    modes = checked_modes(plan.machine)
    loop = loop_of(judge(plan.machine, modes), "Z", "position", "moving")
    assert loop.unstable
    assert loop.advised is not None
    plan = planned(tmp_path, "Z", "moving", f"machine.axes.Z.drive.K_v={loop.advised} 1/s")
    loop = loop_of(judge(plan.machine, modes), "Z", "position", "moving")
    assert not loop.unstable
    assert not loop.thin
    assert GAIN_MARGIN <= loop.gain_margin < 1.02 * GAIN_MARGIN or loop.phase_margin < PHASE_MARGIN + 1


@pytest.mark.parametrize("gain", [0.0, 1e-300, 1e4, 1e9, 1e20, 1e300])
def test_gains_far_from_any_other(gain: float, tmp_path: Path) -> None:
    """A speed loop with a unit left out is told as unstable, and not the position loop over it."""
    plan = planned(tmp_path, "Z", "moving", f"machine.axes.Z.drive.K_p={gain} N.m.s/rad")
    modes = checked_modes(plan.machine)
    if gain > 1e200:
        with pytest.raises(InputError, match=r"beyond all numbers.*axis Z: 1e\+300"):
            judge(plan.machine, modes)
        return
    loops = judge(plan.machine, modes)
    assert {loop.kind for loop in loops if loop.unstable} == ({"speed"} if gain > 1 else set())
    if gain == 1e4:
        usual = planned(tmp_path, "Z", "moving", "machine.axes.Z.drive.K_p=100 N.m.s/rad")
        near = loop_of(judge(usual.machine, modes), "Z", "speed", "moving")
        assert loop_of(loops, "Z", "speed", "moving").limit == pytest.approx(near.limit, rel=1e-3)


# Gain -> code and severity of the finding, and a part of its text.
SAID = {
    "30 (m/min)/mm": ("loop-unstable", "wrong", "stable below K_v = 27.5 (m/min)/mm; stable at rest"),
    "20 (m/min)/mm": ("loop-margins-thin", "doubt", "K_v = 20 (m/min)/mm: gain 2.8 dB"),
    "4 (m/min)/mm": None,
}


@pytest.mark.parametrize("gain", SAID)
def test_runs_say_so_and_blame_no_coupling(gain: str, tmp_path: Path) -> None:
    plan = scenario.load(MACHINES.parent / "z_positioning.yaml", [f"machine.axes.Z.drive.K_v={gain}"])
    ahead = check(plan, nc.plan(plan))
    told = judge_run(cosim.run(plan)).warnings
    expected = SAID[gain]
    if expected is None:
        assert told == ahead == ()
        return
    assert told[0] == ahead[0]
    code, severity, part = expected
    assert (told[0].code, told[0].severity, told[0].place) == (code, severity, "Z")
    assert part in told[0].text
    assert told[0].remedy.startswith("machine.axes.Z.drive.K_v=")
    assert not judge_run(cosim.run(scenario.load(plan.file, [told[0].remedy]))).warnings
    assert not any("coupling.substeps" in finding.remedy for finding in told)


def test_axes_that_rest_are_judged_at_rest(tmp_path: Path) -> None:
    """Between the limit of a sliding axis and that of one that is held, only a motion makes it wrong."""
    gain = "machine.axes.Z.drive.K_v=29 (m/min)/mm"
    for state, severity in (("moving", "wrong"), ("at rest", "doubt")):
        plan = planned(tmp_path, "Z", state, gain)
        assert check(plan, nc.plan(plan))[0].severity == severity


def test_loops_that_are_kept_know_all_that_they_depend_on() -> None:
    """With another value of any parameter of friction they are judged as where nothing is kept."""
    machine = scenario.load_subject(MACHINES / "one_axis").machine
    axis, modes = machine.axes["X"], checked_modes(machine)
    friction, kept = axis.friction, judge(machine, modes)
    assert isinstance(friction, Friction)
    others = set()
    for name, value in friction.parameters().items():
        changed = friction.model_copy(update={name: float(value) * 1.5 + 1e-3})
        other = machine.model_copy(update={"axes": {"X": axis.model_copy(update={"friction": changed})}})
        found = judge(other, modes)
        assert found == judge(other, replace(modes))  # modes of the same numbers, of which nothing is kept
        others |= {name} if found != kept else set()
    assert others == {"sigma_0", "sigma_1", "sigma_2", "gamma"}
