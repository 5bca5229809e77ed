"""Friction compensation on the default machine: its delay in closed form, what is left of the circle, errors, rest."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from feedsim import scenario
from feedsim.analysis import compensation as module
from feedsim.analysis.compensation import Compensation, Quality, circle_task, compensate, quality
from feedsim.foundation.errors import InputError
from feedsim.jobs.tune_feedforward import CompensatedCircle, result_of
from feedsim.linear.plant import LinearDrive
from feedsim.report.compensate import rows_of
from feedsim.scenario import Axis, Machine, Scenario
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim.feedforward import friction_feedforward, lag_of
from feedsim.simulation.cosim.friction_law import FrictionLaw
from scenario_helpers import default_machine

CIRCLE = Path(__file__).resolve().parents[2] / "scenarios" / "xz_circle.yaml"
# m; what the compensated circle may be off. Without friction the loop's own circle is off by 0.02 um at the neutral
# T_sym (test_closed_forms.py); the reversals add what one control cycle of the torque is worth.
LEFT = 0.05e-6
REACH = 0.25e-6  # m; every quadrant, with the true parameters


@pytest.fixture(scope="module")
def done(fmus: Path) -> Iterator[Compensation]:
    """The circle of the scenario, with three lines of the table."""
    described = scenario.load(CIRCLE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "DELAY_ERRORS", (1e-3,))
        patch.setattr(module, "VARIED_PARAMETERS", (("F_C", "F_S"),))
        yield compensate(
            described, nc.plan(described), machines={"less friction": less_friction(described.machine)}, fmus=fmus
        )


def settings(*changes: str) -> Scenario:
    """The circle with changes of its drives: of all, or of one where the change names its axis."""
    return scenario.load(CIRCLE, [f"machine.axes.{'' if '.' in each else '*.drive.'}{each}" for each in changes])


def less_friction(machine: Machine) -> Machine:
    """Z with 30 % less friction."""
    own = machine.axes["Z"]
    friction = own.friction.model_copy(update={name: 0.7 * getattr(own.friction, name) for name in ("F_C", "F_S")})
    return machine.model_copy(update={"axes": {**machine.axes, "Z": own.model_copy(update={"friction": friction})}})


def cells_of(line: str) -> list[str]:
    return [cell.strip() for cell in line.split("|")[1:-1]]


def left_with(described: Scenario, error: float, fmus: Path) -> Quality:
    """What is left of the circle when the delay in closed form is wrong by `error` [s]."""
    program = nc.plan(described)
    machine = described.machine
    axes = ("X", "Z")
    delays = {axis: lag_of(machine.axes[axis].drive, machine.cycles).delay + error for axis in axes}
    with FrictionLaw(fmus) as law:
        frictions = {axis: machine.axes[axis].friction for axis in axes}
        torque = friction_feedforward(machine, program, frictions, delays, lambda _: law)
    result = cosim.run(described, program=program, fmus=fmus, torque_feedforward=torque)
    return quality(result.trace, circle_task(described, program).turn)


# --- the delay in closed form -----------------------------------------------------------------------------------------


def test_axis_lag_is_that_of_the_speed_loop() -> None:
    """T_dyn + 2 D/omega_0 and the ramp's share. The machine's T_sym is neutral, rounded to 1 us."""
    machine = default_machine()
    cycles = machine.cycles
    for axis in machine.axes.values():
        drive = axis.drive
        assert drive.D is not None
        assert drive.omega_0 is not None
        expected = drive.T_dyn + 2 * drive.D / drive.omega_0 + cycles.T_pos - cycles.T_c
        assert lag_of(axis.drive, cycles).axis == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("changes", [{}, {"ideal_current_loop": True}, {"filter_2": ("low_pass", 900.0)}])
def test_torque_lag_is_the_slope_of_the_phase(changes: dict[str, object]) -> None:
    """Against the sampled drive's response from M_s to M_a, which is held against the unit elsewhere."""
    machine = default_machine()
    s = np.array([1j])  # rad/s: the phase is linear up to some 100
    for axis in machine.axes.values():
        axis = changed(axis, changes)
        response = LinearDrive(axis.drive, machine.cycles, axis.I_P).torque(s)[0][0]
        held = machine.cycles.T_c / 2 if axis.drive.ideal_current_loop else 0.0
        assert lag_of(axis.drive, machine.cycles).torque == pytest.approx(-np.angle(response) + held, abs=1e-9)


def changed(axis: Axis, changes: dict[str, object]) -> Axis:
    drive = axis.drive
    for name, value in changes.items():
        if isinstance(value, tuple):
            value = drive.filter_2.model_copy(update={"type": value[0], "f": value[1], "D_den": 0.7})
        drive = drive.model_copy(update={name: value})
    return axis.model_copy(update={"drive": drive})


def test_closed_form_is_the_optimum(fmus: Path) -> None:
    """G over the delay is a V; its tip is where its arms meet, and no more than 0.1 ms from the closed form."""
    described = settings()
    step = 0.5e-3
    early, late = (left_with(described, error, fmus).G for error in (-step, step))
    slope = (early + late) / (2 * step)
    tip = (early - late) / (2 * slope)
    assert abs(tip) < 0.02e-3  # found to be 2 us; a sixth of a control cycle says that no share of one is forgotten
    assert min(early, late) > 0.3e-6  # or else the delay did not matter, and nothing was tested


@pytest.mark.parametrize(
    "changes",
    [
        # T_sym stays as it is, 0.4375 ms above neutral then, alike on both axes: a smaller circle, still round
        ("ramp_speed_setpoint=false",),
        ("ideal_current_loop=true",),
        # 0.6 ms below neutral: larger, and round
        ("X.drive.T_sym=4254 us", "Z.drive.T_sym=2928 us"),
    ],
    ids=lambda changes: changes[0],
)
def test_closed_form_holds_for_other_drives(changes: tuple[str, ...], fmus: Path) -> None:
    left = left_with(settings(*changes), 0.0, fmus)
    assert max(left.peak.values()) < LEFT
    assert min(left.dip.values()) > -LEFT


def test_without_position_control_there_is_no_lag(fmus: Path) -> None:
    described = settings("K_v=0 1/s")
    program = nc.plan(described)
    with pytest.raises(InputError, match=r"axis X: K_v is 0.*give the delay of its compensation"):
        compensate(described, program, fmus=fmus)
    with pytest.raises(InputError, match=r"axis Z: K_v is 0"):
        compensate(described, program, delays={"X": 4e-3}, fmus=fmus)


# --- the circle -------------------------------------------------------------------------------------------------------


def test_every_quadrant_within_reach(done: Compensation) -> None:
    figures = done.figures
    assert figures["before.glitch_Z"].value > 7
    assert figures["before.glitch_X"].value > 4
    for crossing in ("X+", "Z+", "X-", "Z-"):
        assert figures[f"after.glitch_{crossing}"].value < REACH * 1e6
        assert figures[f"after.glitch_{crossing}"].value < LEFT * 1e6
    assert figures["after.G"].value < LEFT * 1e6
    (note,) = done.warnings
    assert (note.code, note.severity, note.place) == ("friction-known-exactly", "note", "X, Z")
    assert "leaves G up to 0.807 um (F_C, F_S -10 %)" in note.text


def test_feedforward_is_ahead_by_the_lag_of_the_torque(done: Compensation) -> None:
    """At the compensated reversals M_ff(t) is M_fr(t + T_torque): the axis moves as its setpoint says."""
    begin, end = done.turn.begin, done.turn.end
    real = done.after.trace.between(begin, end)
    for axis in done.turn.axes:
        ahead = done.lags[axis].torque
        expected = np.interp(real.time - ahead, done.feedforward.time, done.feedforward[f"{axis}.M_ff"])
        difference = real[f"{axis}.M_fr"] - expected
        # 1 % of the friction: the bristles feel the few nm by which the axis is off
        assert np.max(np.abs(difference)) < 0.01 * np.max(np.abs(real[f"{axis}.M_fr"]))


def test_table_tells_errors_apart(done: Compensation) -> None:
    by = {(each.what, round(each.change, 6)): each.quality for each in done.table}
    assert list(by) == [("delay", 1.0), ("F_C, F_S", -10.0), ("F_C, F_S", 10.0)]
    late, little, much = by.values()
    # a prototype, written apart from this, found 0.4 um for 1 ms: between the axes of this one
    assert late.peak["X"] < 0.4e-6 < late.peak["Z"]
    assert late.peak["Z"] < 0.6e-6
    # 10 % of the friction missing is 10 % of the peak without compensation
    for axis in ("X", "Z"):
        without = done.figures[f"before.glitch_{axis}"].value * 1e-6
        assert little.peak[axis] == pytest.approx(0.1 * without, rel=0.05)
        assert much.dip[axis] == pytest.approx(-0.1 * without, rel=0.05)
        assert max(-little.dip[axis], much.peak[axis]) < 0.1 * little.peak[axis]


def test_table_runs_are_those_of_the_whole_program(done: Compensation, fmus: Path) -> None:
    """They end with the turn; what was before it cannot know of that."""
    whole, cut = left_with(settings(), 1e-3, fmus), done.table[0].quality
    assert abs(cut.G - whole.G) < 1e-9 * whole.G


def test_results_have_the_table(done: Compensation, tmp_path: Path) -> None:
    result_of(CompensatedCircle(done, {})).save(tmp_path / "out")
    with (tmp_path / "out" / "compensation.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["compensation"], row["error"], row["unit of the error"]) for row in rows] == [
        ("none", "0", ""),
        ("as computed", "0", ""),
        ("delay", "1", "ms"),
        ("F_C, F_S", "-10", "%"),
        ("F_C, F_S", "10", "%"),
    ]
    for row, each in zip(rows[2:], done.table, strict=True):
        assert float(row["G [um]"]) == pytest.approx(each.quality.G * 1e6, rel=1e-5)
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert 'id="compensation-errors"' in text
    assert "−10 %" in text


def test_a_changed_machine_has_the_same_compensation(done: Compensation, tmp_path: Path, fmus: Path) -> None:
    """Its runs beside whole ones: the control keeps the torque of the friction that it knows."""
    (found,) = done.changed
    scenario_ = done.scenario.model_copy(update={"machine": less_friction(done.scenario.machine)})
    torque = {axis: done.feedforward[f"{axis}.M_ff"] for axis in done.frictions}
    for left, applied in ((found.before, None), (found.after, torque)):
        result = cosim.run(scenario_, program=nc.plan(scenario_), fmus=fmus, torque_feedforward=applied)
        expected = quality(result.trace, done.turn)
        assert pytest.approx(expected.G, rel=1e-6) == left.G
        assert left.dip["Z"] == pytest.approx(expected.dip["Z"], rel=1e-6, abs=1e-12)
    assert found.after.dip["Z"] < 3 * done.left_after.dip["Z"] < 0  # too much now: a dip
    result_of(CompensatedCircle(done, {})).save(tmp_path / "out")
    assert "With other effects of the machine" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_table_of_the_document(done: Compensation) -> None:
    """The rows of docs/tuning.md that are at hand, to the digits they are written with."""
    text = (CIRCLE.parents[1] / "docs" / "tuning.md").read_text(encoding="utf-8")
    lines = text[text.index("| compensation | error |") :].split("\n\n")[0].splitlines()[2:]
    written = {tuple(cells[:2]): cells[2:] for cells in map(cells_of, lines)}
    for what, change, unit, left in rows_of(done):
        numbers = [*left.peak.values(), *left.dip.values(), left.G]
        key = (what, f"{change:+.3g} {unit}" if unit else "")
        assert written[key] == [f"{1e6 * number:.2f}" for number in numbers]


def test_another_set_is_used_and_the_machine_keeps_its_own(fmus: Path) -> None:
    described = scenario.load(CIRCLE)
    friction = described.machine.axes["Z"].friction
    weaker = friction.model_copy(update={"F_C": 0.9 * friction.F_C, "F_S": 0.9 * friction.F_S})
    found = compensate(described, nc.plan(described), frictions={"Z": weaker}, table=False, fmus=fmus)
    assert found.figures["after.glitch_Z"].value == pytest.approx(
        0.1 * found.figures["before.glitch_Z"].value, rel=0.05
    )
    assert found.figures["after.glitch_X"].value < LEFT * 1e6
    assert found.figures["before.glitch_Z"].value > 7
    assert found.table == ()


# --- at rest ----------------------------------------------------------------------------------------------------------


def test_start_does_not_kick(done: Compensation) -> None:
    """z = 0 and M_ff = 0: what stands still is told nothing; then the axes follow better than without."""
    for axis in done.turn.axes:
        assert abs(done.feedforward[f"{axis}.M_ff"][0]) < 1e-6  # N.m
    starting = done.after.trace.time < 0.05
    errors = [np.abs(run.trace["Z.x_e"][starting]).max() for run in (done.before, done.after)]
    assert errors[1] < 0.3 * errors[0]


def test_rest_does_not_creep(done: Compensation) -> None:
    """M_ff stays where the motion left it; the integrator takes what the bristles lose, as it does without."""
    duration = done.after.program.time[-1]
    for axis in done.turn.axes:
        at_rest = done.feedforward.between(duration - 0.25, duration)[f"{axis}.M_ff"]
        assert np.ptp(at_rest) < 1e-12
        assert abs(at_rest[-1]) > 1  # it does stay
        before, after = (
            run.trace.between(duration - 0.1, duration)[f"{axis}.x_a"] - run.program.x_s[axis][-1]
            for run in (done.before, done.after)
        )
        # the machine's ring-down moves both, alike
        assert np.max(np.abs(after - before)) < LEFT


# --- what is refused --------------------------------------------------------------------------------------------------


def test_no_circle_is_told(fmus: Path) -> None:
    described = scenario.load(CIRCLE.parent / "z_positioning.yaml")
    with pytest.raises(InputError, match=r"z_positioning\.yaml: there is no circle"):
        compensate(described, nc.plan(described), fmus=fmus)


def test_circle_without_an_evaluation_is_found(fmus: Path) -> None:
    described = scenario.load(CIRCLE).model_copy(update={"evaluate": ()})
    task = circle_task(described, nc.plan(described))
    assert task.turn == circle_task(scenario.load(CIRCLE), nc.plan(described)).turn


@pytest.mark.parametrize("axis", ["Y", "Q"])
def test_axes_that_do_not_move_are_refused(axis: str, fmus: Path) -> None:
    described = scenario.load(CIRCLE)
    with pytest.raises(InputError, match=rf"delay of axis {axis}: .*the axes that move are X, Z"):
        compensate(described, nc.plan(described), delays={axis: 0.0}, fmus=fmus)


@pytest.mark.parametrize(
    ("torques", "message"),
    [
        ({"Q": np.zeros(9)}, "no axis 'Q'"),
        ({"Z": np.zeros(8)}, "axis Z: 9 finite values are needed"),
        ({"Z": np.array([0.0] * 8 + [np.nan])}, "8 of them finite"),
    ],
)
def test_torques_that_do_not_fit_are_refused(torques: dict[str, np.ndarray], message: str, fmus: Path) -> None:
    described = scenario.load(CIRCLE)
    program = nc.plan(described)
    short = replace(
        program,
        time=program.time[:2],
        x_s={axis: x[:2] for axis, x in program.x_s.items()},
        n_ffw={axis: n[:2] for axis, n in program.n_ffw.items()},
    )
    with pytest.raises(InputError, match=message):
        cosim.run(described, program=short, fmus=fmus, torque_feedforward=torques)


def test_parameters_without_effect_are_left_out(fmus: Path) -> None:
    """Pure LuGre has no engaging zone."""
    machine: Machine = default_machine()
    friction = machine.axes["Z"].friction.model_copy(update={"W": 0.0})
    assert module._scale_parameters(friction, ("W",), 1.1) == friction
    assert module._scale_parameters(friction, ("gamma",), 1.1) == friction
    assert module._scale_parameters(friction, ("sigma_0",), 1.1).sigma_0 == pytest.approx(1.1 * friction.sigma_0)
    engaged = machine.axes["Z"].friction.model_copy(update={"gamma": 0.95})
    assert module._scale_parameters(engaged, ("gamma",), 1.1).gamma == 1.0
