"""Friction compensation judged by a circle: the contour without and with it, and what an error in it costs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from feedsim.analysis.circularity import Contour, Turn, circularity, contour, quadrant
from feedsim.analysis.evaluate import CircleTask, tasks
from feedsim.analysis.figures import Array, Figure
from feedsim.files.trace import Trace
from feedsim.foundation.errors import Finding, InputError
from feedsim.scenario import CircleTest, FrictionParameters, Machine, Recording, Scenario
from feedsim.simulation.cosim.feedforward import Lag, Law, friction_feedforward, lag_of
from feedsim.simulation.cosim.friction_law import FrictionLaws
from feedsim.simulation.cosim.run import run
from feedsim.simulation.judge import JudgedRun, judge_run
from feedsim.simulation.nc import Program

# --- What a friction compensation leaves on a circle: with errors in it, and on a machine that is another one ---------


DELAY_ERRORS = (-1e-3, -0.5e-3, -0.2e-3, 0.2e-3, 0.5e-3, 1e-3)  # s
# Parameters that are wrong together: a static torque below the Coulomb torque is none.
VARIED_PARAMETERS = (("F_C", "F_S"), ("sigma_0",), ("W",), ("gamma",), ("spread",), ("C",), ("sigma_1",), ("v_s",))
FRICTION_ERROR = 0.1
OF_ENGAGING = ("W", "gamma")  # of no effect where W is 0


@dataclass(frozen=True)
class Quality:
    """What is left on the evaluated turn, by the scales.

    G: range of the radius deviation [m]. peak, dip: axis that reverses -> largest and smallest radius deviation within
    +-45 deg of its reversals, less the turn's median [m]. Too little compensation leaves peaks, too much leaves dips.
    """

    G: float
    peak: Mapping[str, float]
    dip: Mapping[str, float]


@dataclass(frozen=True)
class Variation:
    """A compensation with an error. what: "delay" or names of parameters; change in unit ("ms", "%"), of all axes."""

    what: str
    change: float
    unit: str
    quality: Quality


@dataclass(frozen=True)
class ChangedMachine:
    """A compensation on a changed machine. words: behind "with". before, after: without and with it."""

    words: str
    before: Quality
    after: Quality


def quality(trace: Trace, turn: Turn) -> Quality:
    """What is left on a turn."""
    measured = contour(trace, turn)
    return Quality(
        G=float(np.ptp(measured.deviation)),
        peak={axis: max(g.height for g in measured.glitches if g.axis == axis) for axis in turn.axes},
        dip={axis: _dip(measured, axis) for axis in turn.axes},
    )


def _dip(measured: Contour, axis: str) -> float:
    return min(
        float(measured.deviation[quadrant(measured.angle, glitch.crossing)].min()) - measured.median
        for glitch in measured.glitches
        if glitch.axis == axis
    )


def errors_and_changes(
    scenario: Scenario,
    program: Program,
    turn: Turn,
    frictions: Mapping[str, FrictionParameters],
    delays: Mapping[str, float],
    laws: Callable[[FrictionParameters], Law],
    machines: Mapping[str, Machine],
    *,
    fmus: Path | None,
    progress: Progress,
) -> tuple[tuple[Variation, ...], tuple[ChangedMachine, ...]]:
    """One run up to the end of the turn for every error, and two for every changed machine.

    machines: words -> machine. Raises InputError, SimulationError, as a run.
    """
    machine = scenario.machine
    columns = tuple(f"{axis}.x_a" for axis in turn.axes)
    lean = scenario.model_copy(
        update={"recording": Recording(interval=scenario.recording.interval, variables=columns), "logging": None}
    )
    last = min(int(np.searchsorted(program.time, turn.end)) + 1, len(program.time) - 1)
    cut = replace(
        program,
        time=program.time[: last + 1],
        x_s={axis: x[: last + 1] for axis, x in program.x_s.items()},
        n_ffw={axis: n[: last + 1] for axis, n in program.n_ffw.items()},
    )
    instants = last * round(machine.cycles.T_pos / machine.cycles.T_c) + 1
    wanted: list[tuple[str, float, str, Mapping[str, FrictionParameters], Mapping[str, float]]] = [
        ("delay", error * 1e3, "ms", frictions, {axis: delay + error for axis, delay in delays.items()})
        for error in DELAY_ERRORS
    ]
    for names in VARIED_PARAMETERS:
        for share in (-FRICTION_ERROR, FRICTION_ERROR):
            varied = {axis: _scale_parameters(friction, names, 1 + share) for axis, friction in frictions.items()}
            if varied != frictions:
                wanted.append((", ".join(names), share * 100, "%", varied, delays))
    total = len(wanted) + len(machines)

    def feedforward(set_: Mapping[str, FrictionParameters], delay: Mapping[str, float]) -> dict[str, Array]:
        # Of the whole program, then cut: a delay below 0 looks ahead.
        torque = friction_feedforward(machine, program, set_, delay, laws)
        return {axis: values[:instants] for axis, values in torque.items()}

    def left(own: Machine, torque: Mapping[str, Array] | None) -> Quality:
        plan = lean.model_copy(update={"machine": own})
        return quality(run(plan, program=cut, fmus=fmus, torque_feedforward=torque).trace, turn)

    variations = []
    for done, (what, change, unit, set_, delay) in enumerate(wanted):
        progress("what errors cost", done, total)
        variations.append(Variation(what, change, unit, left(machine, feedforward(set_, delay))))
    changed = []
    torque = feedforward(frictions, delays) if machines else {}
    for done, (words, own) in enumerate(machines.items(), start=len(wanted)):
        progress("what errors cost", done, total)
        changed.append(ChangedMachine(words, left(own, None), left(own, torque)))
    progress("what errors cost", total, total)
    return tuple(variations), tuple(changed)


def _scale_parameters(friction: FrictionParameters, names: Sequence[str], factor: float) -> FrictionParameters:
    """A set with some parameters multiplied; the same where its law has none of them, or they have no effect."""
    if not set(names) <= set(type(friction).model_fields) or (set(names) <= set(OF_ENGAGING) and friction.W == 0):
        return friction
    values = {name: getattr(friction, name) * factor for name in names}
    if "gamma" in values:
        values["gamma"] = min(values["gamma"], 1.0)
    return friction.model_copy(update=values)


Progress = Callable[[str, int, int], None]

REST_ROUNDING = 1e-9  # m; what an axis that is held may move by, from rounding
# A figure has become worse from this share of G without compensation on, and by this [m] at least.
WORSE, LEAST_WORSE = 0.01, 1e-9
REVERSAL = "reversal "


@dataclass(frozen=True, eq=False)
class Compensation:
    """A circle without and with friction compensation.

    Attributes:
        task: the evaluated turn.
        frictions: axis -> parameters that the compensation uses; the axes are those that move.
        lags: axis -> lags of the drive; without an entry where a delay was given.
        delays: axis -> delay of the feedforward behind the speed setpoint n_ffw [s].
        feedforward: A.M_ff [N.m] per axis at the control cycle.
        before, after: the runs without and with compensation.
        left_before, left_after: what is left on the turn of either.
        figures: "before.G", "after.glitch_X" ... as of a circle test, "before.dip_X" ..., "X.delay" ...
        table: what errors cost; empty where it was not asked for.
        changed: what the compensation does on changed machines; empty without a table.
        warnings: what a user should know before believing the result.
    """

    task: CircleTask
    frictions: Mapping[str, FrictionParameters]
    lags: Mapping[str, Lag]
    delays: Mapping[str, float]
    feedforward: Trace
    before: JudgedRun
    after: JudgedRun
    left_before: Quality
    left_after: Quality
    figures: Mapping[str, Figure]
    table: tuple[Variation, ...]
    changed: tuple[ChangedMachine, ...]
    warnings: tuple[Finding, ...]

    @property
    def scenario(self) -> Scenario:
        return self.after.scenario

    @property
    def turn(self) -> Turn:
        return self.task.turn


def circle_task(scenario: Scenario, program: Program) -> CircleTask:
    """The first circle test that the scenario asks for, or else that of its last circle.

    Raises InputError where there is no circle.
    """
    asked = [task for task in tasks(scenario, program) if isinstance(task, CircleTask)]
    if asked:
        return asked[0]
    try:
        (task,) = tasks(scenario.model_copy(update={"evaluate": (CircleTest(),)}), program)
    except InputError:
        raise InputError(
            f"{scenario.file}: there is no circle; friction compensation is judged by the reversals of a circle test: "
            "a motion of kind circle is needed, or recorded setpoints of one with a circle test under evaluate"
        ) from None
    assert isinstance(task, CircleTask)
    return task


def moving_axes(program: Program) -> tuple[str, ...]:
    """Axes that the program moves."""
    return tuple(axis for axis, x in program.x_s.items() if np.ptp(x) > REST_ROUNDING)


def check_moves(axis: str, program: Program, what: str = "") -> None:
    """Raise InputError, which begins with `what`, unless the program moves `axis`."""
    axes = moving_axes(program)
    if axis not in axes:
        known = f"no axis {axis!r}" if axis not in program.n_ffw else f"axis {axis} rests"
        raise InputError(f"{what}{known}; the axes that move are {', '.join(axes)}")


def compensate(
    scenario: Scenario,
    program: Program,
    *,
    frictions: Mapping[str, FrictionParameters] | None = None,
    delays: Mapping[str, float] | None = None,
    table: bool = True,
    machines: Mapping[str, Machine] | None = None,
    fmus: Path | None = None,
    progress: Progress | None = None,
) -> Compensation:
    """Run `scenario` without and with friction compensation of every axis that moves.

    Args:
        frictions: axis -> parameters for the compensation; the machine's own for the other axes. The machine keeps its
            friction.
        delays: axis -> delay [s] of the feedforward; by :func:`feedsim.simulation.cosim.feedforward.lag_of` for the
        other axes. table: with the runs that show what errors cost, and what the compensation does on `machines`.
        machines: words, behind "with" -> changed machines of the same axes.
        fmus: folder of the archives.
        progress: called with (what is done, cycles done, cycles in all).

    Raises:
        InputError: no circle, an unknown or resting axis, a drive whose lag is not known.
        SimulationError: a unit failed.
    """
    task = circle_task(scenario, program)
    turn = task.turn
    axes = moving_axes(program)
    for what, named in (("friction", frictions), ("delay", delays)):
        for axis in named or ():
            check_moves(axis, program, f"{what} of axis {axis}: ")
    machine = scenario.machine
    used = {
        axis: (frictions or {}).get(axis) or machine.friction_of(axis, "compensation without friction of its own")
        for axis in axes
    }
    lags = lags_of(scenario, [axis for axis in axes if axis not in (delays or {})])
    applied = {axis: (delays or {})[axis] if axis not in lags else lags[axis].delay for axis in axes}
    plain = _fully_recorded(scenario, turn)
    tell = progress or (lambda what, done, total: None)

    def report_run(what: str) -> Callable[[int, int], None]:
        return lambda done, total: tell(what, done, total)

    with FrictionLaws(fmus) as laws:
        torque = friction_feedforward(machine, program, used, applied, laws)
        before = judge_run(run(plain, program=program, fmus=fmus, progress=report_run("without compensation")))
        after = judge_run(
            run(plain, program=program, fmus=fmus, progress=report_run("with compensation"), torque_feedforward=torque)
        )
        variations, changed = errors_and_changes(
            scenario, program, turn, used, applied, laws, machines or {}, fmus=fmus, progress=tell
        ) if table else ((), ())  # fmt: skip
    left_before, left_after = (quality(result.trace, turn) for result in (before, after))
    figures = circle_figures(turn, before.trace, after.trace)
    T_c = machine.cycles.T_c
    feedforward = Trace(
        np.arange(len(next(iter(torque.values()))), dtype=np.float64) * T_c,
        {f"{axis}.M_ff": values for axis, values in torque.items()},
        {f"{axis}.M_ff": "N.m" for axis in torque},
    )
    return Compensation(
        task=task,
        frictions=used,
        lags=lags,
        delays=applied,
        feedforward=feedforward,
        before=before,
        after=after,
        left_before=left_before,
        left_after=left_after,
        figures=figures | _feedforward_figures(lags, applied, torque),
        table=variations,
        changed=changed,
        warnings=(
            *_warn_worse_figures(figures, _reversals(before.trace, turn), _reversals(after.trace, turn)),
            *dict.fromkeys((*before.warnings, *after.warnings)),
            *_warn_negative_delays(applied),
            *_not_judged(axes, turn),
            *_same_model(machine, used, lags, variations),
        ),
    )


def _reversals(trace: Trace, turn: Turn) -> dict[str, float]:
    """Reversal, such as Z+ -> largest radius deviation to either side within +-45 deg of it, less the median [m]."""
    measured = contour(trace, turn)
    return {
        glitch.name: float(
            np.abs(measured.deviation[quadrant(measured.angle, glitch.crossing)] - measured.median).max()
        )
        for glitch in measured.glitches
    }


def _warn_worse_figures(
    figures: Mapping[str, Figure], before: Mapping[str, float], after: Mapping[str, float]
) -> list[Finding]:
    """What the compensation has made worse: wrong is more of G or of a reversal, of other figures it is a doubt.

    before, after: as from `_reversals`.
    """
    pairs = {
        name.removeprefix("before."): (figure.value, figures[f"after.{name.removeprefix('before.')}"].value)
        for name, figure in figures.items()
        if name.startswith("before.") and figure.unit == "um"
    }
    pairs |= {REVERSAL + name: (1e6 * value, 1e6 * after[name]) for name, value in before.items()}
    least = max(WORSE * abs(pairs["G"][0]), LEAST_WORSE * 1e6)
    # One that is no number with compensation is worse.
    worse = {
        name: (without, with_it)
        for name, (without, with_it) in pairs.items()
        if np.isfinite(without) and not _size(name, with_it) - _size(name, without) <= least
    }
    grave = {
        name: both
        for name, both in worse.items()
        if name.rpartition(".")[2] in ("G", "G_ls") or name.startswith(REVERSAL)
    }
    rest = {name: both for name, both in worse.items() if name not in grave}
    result = []
    if grave:
        text = f"worse with compensation than without: {_list_changes(grave)}"
        result.append(Finding("compensation-worse", "wrong", text, ", ".join(grave)))
    if rest:
        text = f"larger with compensation than without: {_list_changes(rest)}"
        result.append(Finding("compensation-larger", "doubt", text, ", ".join(rest)))
    return result


def _size(name: str, value: float) -> float:
    """How bad a figure is: outward extremes count outwards, inward ones inwards, all others either way; NaN stays."""
    key = name.rpartition(".")[2]
    if key == "F_min" or key.startswith("dip"):
        return float(np.maximum(-value, 0.0))
    if key == "F_max" or key.startswith("glitch"):
        return float(np.maximum(value, 0.0))
    return abs(value)


def _list_changes(pairs: Mapping[str, tuple[float, float]]) -> str:
    return ", ".join(
        f"{name} {before:.3g} -> {f'{after:.3g} um' if np.isfinite(after) else 'not determined'}"
        for name, (before, after) in pairs.items()
    )


def _not_judged(axes: Sequence[str], turn: Turn) -> list[Finding]:
    others = ", ".join(axis for axis in axes if axis not in turn.axes)
    text = f"axis {others}: compensated, but no figure of the circle judges it"
    return [Finding("compensation-not-judged", "doubt", text, others)] if others else []


def _same_model(
    machine: Machine, used: Mapping[str, FrictionParameters], lags: Mapping[str, Lag], table: Sequence[Variation]
) -> list[Finding]:
    """That the compensation knows the machine exactly, as it never does a real one, and what errors would leave."""
    same = [axis for axis, friction in used.items() if friction == machine.axes[axis].friction and axis in lags]
    if not same:
        return []
    worst = max(table, key=lambda variation: variation.quality.G, default=None)
    errors = "errors of it are not tried here (--no-table)"
    if worst is not None:
        errors = (
            f"an error as in the table leaves G up to {1e6 * worst.quality.G:.3g} um "
            f"({worst.what} {worst.change:+.3g} {worst.unit})"
        )
    return [Finding(
        "friction-known-exactly", "note",
        f"axis {', '.join(same)}: model and machine have the same friction and delay, so what is left is the least "
        f"that can be reached, not what a real machine will show; {errors}",
        ", ".join(same),
    )]  # fmt: skip


def lags_of(scenario: Scenario, axes: Sequence[str]) -> dict[str, Lag]:
    """Axis -> lags of its drive. Raises InputError where the parameters of a drive do not determine them."""
    lags: dict[str, Lag] = {}
    problems = []
    for axis in axes:
        try:
            lags[axis] = lag_of(scenario.machine.shipped_drive(axis, "its lag"), scenario.machine.cycles)
        except InputError as error:
            problems.append(
                f"axis {axis}: {str(error).removeprefix(f'axis {axis}: ')}; give the delay of its compensation"
            )
    if problems:
        raise InputError.of(f"{scenario.file}: the delay of the compensation is not known", problems)
    return lags


def _fully_recorded(scenario: Scenario, turn: Turn) -> Scenario:
    """The scenario with everything recorded that is looked at, and without a log, which is of a run."""
    recording = scenario.recording
    if recording.variables is not None:
        needed = [f"{axis}.{signal}" for axis in turn.axes for signal in ("x_a", "n_a", "M_fr")]
        recording = Recording(interval=recording.interval, variables=(*recording.variables, *needed))
    return scenario.model_copy(update={"recording": recording, "logging": None})


def circle_figures(turn: Turn, before: Trace, after: Trace) -> dict[str, Figure]:
    """Figures of the turn without and with compensation, "before.G", "after.dip_X"."""
    return _figures_of(turn, "before", "without", before) | _figures_of(turn, "after", "with", after)


def _figures_of(turn: Turn, name: str, words: str, trace: Trace) -> dict[str, Figure]:
    """Figures of the turn of a run. name: ahead of the keys; words: "without" or "with", for the meanings."""
    figures = circularity(trace, turn)
    for axis, dip in quality(trace, turn).dip.items():
        figures[f"dip_{axis}"] = Figure(
            dip * 1e6,
            "um",
            f"lowest radius deviation within +-45 deg of where {axis} reverses, less the median, by the linear "
            "scales: too much compensation leaves a dip",
        )
    return {
        f"{name}.{key}": replace(figure, meaning=f"{words} compensation: {figure.meaning}")
        for key, figure in figures.items()
    }


def _feedforward_figures(
    lags: Mapping[str, Lag], delays: Mapping[str, float], torque: Mapping[str, Array]
) -> dict[str, Figure]:
    figures: dict[str, Figure] = {}
    for axis, delay in delays.items():
        if axis in lags:
            lag = lags[axis]
            figures[f"{axis}.axis_lag"] = Figure(lag.axis * 1e3, "ms", f"lag of {axis} behind its speed setpoint n_ffw")
            figures[f"{axis}.torque_lag"] = Figure(
                lag.torque * 1e3, "ms", f"lag of the torque of {axis} behind its setpoint: current loop and filters"
            )
        figures[f"{axis}.delay"] = Figure(
            delay * 1e3, "ms", f"delay of the torque feedforward of {axis} behind the speed setpoint n_ffw"
        )
        figures[f"{axis}.peak_feedforward"] = Figure(
            float(np.abs(torque[axis]).max()), "N.m", f"largest torque feedforward of {axis}"
        )
    return figures


def _warn_negative_delays(delays: Mapping[str, float]) -> list[Finding]:
    return [
        Finding(
            "feedforward-looks-ahead", "doubt",
            f"axis {axis}: the feedforward looks {-delay * 1e3:.3g} ms ahead of the speed setpoint; a control can do "
            "that only where it knows its setpoints in advance",
            axis,
        )
        for axis, delay in delays.items()
        if delay < 0
    ]  # fmt: skip
