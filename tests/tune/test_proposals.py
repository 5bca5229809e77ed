"""Proposals: what was changed is named first and its value comes back; closed forms against responses."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from command_helpers import feedsim
from feedsim import analysis
from feedsim.analysis.proposals import (
    COMPENSATION,
    GAIN_MARGIN,
    PHASE_MARGIN,
    Proposal,
    axis_lag,
    change_drive,
    least_margins,
    loop_lag,
    model_gain,
    of_circle,
    of_run,
    torque_response,
)
from feedsim.cli import main
from feedsim.files.fields import FileContent
from feedsim.linear.judgement import judge
from feedsim.linear.system import LinearSystem
from feedsim.report.changes import changes_part, changes_section
from feedsim.scenario import Machine, Scenario, load
from feedsim.simulation import cosim
from feedsim.simulation.judge import judge_run
from feedsim.structure import checked_modes

PROJECT = Path(__file__).resolve().parents[2]
CIRCLE = PROJECT / "scenarios" / "xz_circle.yaml"
DRIVE = "machine.axes.{}.drive.{}"


def proposals(settings: Sequence[str], fmus: Path, *, searched: bool = False) -> list[Proposal]:
    result = judge_run(cosim.run(load(CIRCLE, settings), fmus=fmus))
    return of_run(result, analysis.diagnoses(result), {}, searched=searched)


def slow_phase_lag(machine: Machine, output: str, name: str) -> float:
    """Lag [s] of the sampled linear system at 0.05 Hz, where the next term of the phase is some 1e-6 of it."""
    system = LinearSystem(machine, checked_modes(machine))
    f = np.array([0.05])
    gain = system.transfer(f, output, name)
    if name.endswith("x_s"):  # the feedforward belongs to the setpoint: n_ffw = s x_s/I_P
        axis = name.partition(".")[0]
        gain = gain + system.transfer(f, output, f"{axis}.n_ffw") * 2j * np.pi * f / machine.axes[axis].I_P
    return float(-np.angle(gain)[0] / (2 * np.pi * f[0]))


@pytest.mark.parametrize("k_ffw", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("ramped", [True, False])
def test_the_lag_of_an_axis(k_ffw: float, ramped: bool) -> None:
    machine = change_drive(load(CIRCLE).machine, "Z", {"k_ffw": k_ffw, "ramp_speed_setpoint": ramped, "T_dyn": 0.002})
    assert slow_phase_lag(machine, "Z.x_a", "Z.x_s") == pytest.approx(axis_lag(machine.axes["Z"].drive), rel=1e-5)


@pytest.mark.parametrize(
    "values",
    [{}, {"ramp_speed_setpoint": False}, {"T_ref": 0.0004}, {"reference_model": False}, {"speed_integrator": False}],
)
def test_the_lag_of_the_speed_loop(values: dict[str, float]) -> None:
    """Without position control and feedback, n_ffw is the speed setpoint: its lag to n_a is that of the loop."""
    machine = change_drive(load(CIRCLE).machine, "Z", {"K_v": 0.0, "T_dyn": 0.0, **values})
    J = checked_modes(machine).J_tot("Z")
    expected = loop_lag(machine.axes["Z"].drive, machine.cycles, J)
    # A PI loop without model has terms of third order; the mount of the machine bends the rest by some parts in 1e4.
    assert slow_phase_lag(machine, "Z.n_a", "Z.n_ffw") == pytest.approx(expected, rel=2e-3, abs=2e-6)


def test_the_gain_of_the_reference_model() -> None:
    machine = load(CIRCLE).machine
    modes = checked_modes(machine)
    for axis in machine.axes:
        assert model_gain(machine.axes[axis].drive, modes.J_tot(axis)) == pytest.approx(
            machine.axes[axis].drive.K_p, rel=1e-3
        )


def test_unlike_gains_without_feedforward(fmus: Path) -> None:
    first = proposals(
        [DRIVE.format("*", "k_ffw=0"), DRIVE.format("X", "K_v=5 (m/min)/mm"), DRIVE.format("Z", "K_v=4 (m/min)/mm")],
        fmus,
    )[0]
    assert (first.axis, first.parameter, first.direction) == ("Z", "drive.K_v", "higher")
    assert first.proposed == pytest.approx(5000 / 60, rel=0.02)
    assert first.margins is not None
    assert first.margins[1][0] >= GAIN_MARGIN


@pytest.mark.parametrize("off", [0.63e-3, -0.63e-3])
def test_a_symmetry_filter_that_is_off(off: float, fmus: Path) -> None:
    first = proposals([DRIVE.format("Z", f"T_sym={3.528e-3 + off} s")], fmus)[0]
    assert (first.axis, first.parameter) == ("Z", "drive.T_sym")
    assert first.direction == ("lower" if off > 0 else "higher")
    assert first.proposed == pytest.approx(3.528e-3, rel=0.05)


def test_a_weak_speed_controller(fmus: Path) -> None:
    first = proposals([DRIVE.format("Z", "K_p=2.06 N.m.s/rad")], fmus)[0]
    assert (first.axis, first.parameter, first.direction) == ("Z", "drive.K_p", "higher")
    assert first.proposed == pytest.approx(6.18, rel=0.15)


def test_a_speed_controller_above_its_model_is_not_weakened_for_a_peak(fmus: Path) -> None:
    """Less gain would fit the model of the loop, and would answer friction later: the peak would grow."""
    off = [DRIVE.format("Z", "K_p=8 N.m.s/rad")]
    machine = load(CIRCLE, off).machine
    fitting = model_gain(machine.axes["Z"].drive, checked_modes(machine).J_tot("Z"))
    assert fitting is not None
    assert fitting < 0.8 * machine.axes["Z"].drive.K_p
    of_peak = [one.parameter for one in proposals(off, fmus) if one.cause == "reversal peaks of Z"]
    assert of_peak == [COMPENSATION, "drive.T_n"]


def test_a_slow_integral_part(fmus: Path) -> None:
    found = proposals([DRIVE.format("*", "T_n=20 ms")], fmus, searched=True)
    first = next(proposal for proposal in found if (proposal.axis, proposal.parameter) == ("Z", "drive.T_n"))
    assert first.direction == "lower"
    assert first.proposed is not None
    assert first.proposed < 0.012
    assert first.margins is not None
    assert first.margins[1][0] >= GAIN_MARGIN
    assert first.margins[1][1] >= PHASE_MARGIN
    # It is the shortest one but for 15 %: a shorter one lacks a margin.
    machine = load(CIRCLE).machine
    shorter = change_drive(machine, "Z", {"T_n": 0.85 * first.proposed})
    gain, phase = least_margins(judge(shorter, checked_modes(machine)), "Z")
    assert gain < GAIN_MARGIN or phase < PHASE_MARGIN


@pytest.mark.parametrize("values", [{"K_v": 0.0}, {"speed_integrator": False}])
def test_the_response_to_a_torque(values: dict[str, float]) -> None:
    """At its ends: without position control by the integral part alone, without integral part by both gains."""
    machine = change_drive(load(CIRCLE).machine, "Z", {"T_dyn": 0.0, **values})
    system = LinearSystem(machine, checked_modes(machine))
    gain = abs(system.transfer(np.array([0.05]), "Z.x_a", "Z.M_add")[0]) / machine.axes["Z"].I_P
    assert gain == pytest.approx(torque_response(machine.axes["Z"].drive), rel=5e-3)


def test_the_peak_that_can_fall_most_comes_first(fmus: Path) -> None:
    """X has the slow integral part and, by its large inertia, still the smaller peak than Y."""
    settings = [
        "motions=[{kind: circle, plane: [X, Y], radius: 30 mm, feed: 2 m/min, direction: both, turns: 3}]",
        DRIVE.format("X", "T_n=80 ms"),
    ]
    scenario = load(CIRCLE, settings)
    result = judge_run(cosim.run(scenario, fmus=fmus))
    causes = analysis.diagnoses(result)
    peaks = {term.axis: term.value for diagnosis in causes.values() for term in diagnosis.terms if term.key == "peaks"}
    assert 0 < peaks["X"] < peaks["Y"]
    found = of_run(result, causes, {})
    assert [(each.axis, each.parameter) for each in found] == [
        ("X", "drive.T_n"),
        ("X", COMPENSATION),
        ("Y", COMPENSATION),
        ("Y", "drive.T_n"),
    ]
    assert found[0].proposed == pytest.approx(0.02, rel=0.02)

    def fallen(axis: str) -> float:
        """What a T_n of 5 ms takes off."""
        shorter = load(CIRCLE, [*settings, DRIVE.format(axis, "T_n=5 ms")])
        (diagnosis,) = analysis.diagnoses(judge_run(cosim.run(shorter, fmus=fmus))).values()
        now = [term.value for term in diagnosis.terms if term.key == "peaks" and term.axis == axis]
        return peaks[axis] - (now[0] if now else 0.0)

    assert fallen("X") > fallen("Y")


def test_a_circle_alone_gives_directions(fmus: Path) -> None:
    result = judge_run(cosim.run(load(CIRCLE, [DRIVE.format("Z", "T_sym=4.158 ms")]), fmus=fmus))
    (diagnosis,) = analysis.diagnoses(result).values()
    found = of_circle(diagnosis, None, None)
    assert [(each.axis, each.parameter, each.direction) for each in found[:2]] == [
        ("X", "drive.T_dyn", "higher"),
        ("Z", "drive.K_v", "higher"),
    ]
    assert all(each.proposed is None and each.setting == "" for each in found)
    assert found[0].step == pytest.approx(0.629e-3, rel=1e-2)


def test_nothing_is_proposed_for_what_another_maker_drives(fmus: Path) -> None:
    scenario: Scenario = load(CIRCLE)
    result = judge_run(cosim.run(scenario, fmus=fmus))
    causes = analysis.diagnoses(result)
    gone = scenario.machine.model_copy(update={"modes": FileContent.read(Path("gone.csv"))})
    assert of_run(replace(result, scenario=scenario.model_copy(update={"machine": gone})), causes, {}) == []


@pytest.mark.extensive
def test_try_runs_and_overlays(fmus: Path, tmp_path: Path) -> None:
    settings = ["--set", DRIVE.format("Z", "T_sym=4.158 ms")]
    plain = feedsim("run", CIRCLE, *settings, "--out", "plain", fmus=fmus, cwd=tmp_path)
    done = feedsim(
        "tune", "proposals", CIRCLE, *settings, "--out", "r", "--control", "sinumerik", fmus=fmus, cwd=tmp_path
    )
    assert plain.returncode == done.returncode == 0, done.stderr
    assert (tmp_path / "plain/result.csv").read_bytes() == (tmp_path / "r/result.csv").read_bytes()
    assert "change: Z.drive.T_sym 4.158 ms -> 3.53 ms" in done.stdout
    before, after = (
        json.loads((tmp_path / name / "summary.json").read_text())["figures"]["XZ.G"]["value"]
        for name in ("r", "r_tried")
    )
    assert after < 0.3 * before
    assert (tmp_path / "r_overlay/report.html").is_file()
    page = (tmp_path / "r/report.html").read_text()
    assert "What to change" in page
    assert "MD32810 EQUIV_SPEEDCTRL_TIME" in page
    changes = json.loads((tmp_path / "r/summary.json").read_text())["changes"]
    assert changes[0]["parameter"] == "drive.T_sym"
    assert changes[0]["proposed"] == pytest.approx(3.528e-3, rel=1e-3)


def test_the_section_names_the_commands_that_go_on() -> None:
    """All values of a drive, and those of a compensation, are found by commands that take the scenario."""
    proposals = [Proposal("reversal peaks of Z", "Z", "drive.T_n", 0.02, 0.005, "s", "", "lower")]
    page = str(changes_section(proposals, None, Path.cwd() / "parts" / "my circle.yaml"))
    assert "feedsim tune drive 'parts/my circle.yaml' --axes Z" in page
    assert "feedsim tune compensation 'parts/my circle.yaml'" in page
    page = str(changes_section(proposals, None, Path("my circle.ssp")))
    assert not any(f"feedsim tune {command}" in page for command in ("drive", "compensation"))


def test_a_margin_without_limit_is_no_number_in_the_summary() -> None:
    """A loop that no gain makes unstable has an infinite gain margin, which JSON has not."""
    margins = ((math.inf, 63.0), (15.9, 41.0))
    (part,) = changes_part(
        [Proposal("reversal peaks of Z", "Z", "drive.K_p", 0.0, 1.0, "N.m.s/rad", "", margins=margins)]
    )
    assert part["margins"] == [[None, 63.0], [15.9, 41.0]]
    json.dumps(part, allow_nan=False)


@pytest.mark.parametrize("name", ["K_v=0 1/s", "K_p=0 N.m.s/rad"])
def test_a_drive_that_does_not_hold_its_axis_is_not_tuned(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for command, scenario, own in (("drive", "z_positioning", ["--axes", "Z"]), ("compensation", "xz_circle", [])):
        words = [str(CIRCLE.with_name(f"{scenario}.yaml")), *own, "--set", f"machine.axes.Z.drive.{name}"]
        assert main(["tune", command, *words, "--out", str(tmp_path / "out")]) == 2
        assert f"axis Z: {name[:3]} is 0; tuning needs a drive that holds its axis" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
