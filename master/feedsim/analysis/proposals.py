"""Which parameter to change, from what to what: from the causes of a circle, and from what the machine file holds.

A proposal belongs to a cause. Of the parameters that make the cause the one is proposed that makes most of it by the
closed forms. Nothing is changed here: whoever asks may try a proposal in a second run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from feedsim.analysis import Diagnosis, Figure, PositioningTask, tasks
from feedsim.analysis.circle import Term
from feedsim.analysis.circle import term_name as name_of_term
from feedsim.analysis.circle.words import actionable_causes
from feedsim.foundation.errors import FeedsimError, InputError
from feedsim.foundation.units import convert, parameters
from feedsim.linear.judgement import Loop, judge
from feedsim.scenario import Cycles, Drive, Machine
from feedsim.simulation.cosim import Run
from feedsim.simulation.judge import JudgedRun, wrong_findings
from feedsim.structure import Modes, checked_modes

# --- Closed forms of a drive that proposals rest on: lags of slow motions, neutral T_sym, gain of the reference model -
# With H(s) from the position setpoint to the position, the slope of its phase at 0 Hz is the lag of slow motions
# (derived
# in simulation/cosim/feedforward.py, exact for the sampled drive):
#     T = T_dyn + T_sym + (1 - k_ffw)/K_v


def check_controlled(machine: Machine, axis: str) -> None:
    """InputError: the drive of an axis is another maker's, or does not hold the axis at its setpoint."""
    drive = machine.shipped_drive(axis, "tuning")
    for name, value in (("K_v", drive.K_v), ("K_p", drive.K_p)):
        if value <= 0:
            raise InputError(
                f"axis {axis}: {name} is 0; tuning needs a drive that holds its axis: give it a value above 0"
            )


def axis_lag(drive: Drive) -> float:
    """Lag [s] of an axis behind its position setpoint, of slow motions; infinite without position control."""
    return drive.T_dyn + drive.T_sym + feedforward_lag(drive)


def feedforward_lag(drive: Drive) -> float:
    """The part of it [s] that missing speed feedforward makes, (1 - k_ffw)/K_v."""
    missing = 1 - drive.k_ffw
    return missing / drive.K_v if drive.K_v > 0 else (float("inf") if missing else 0.0)


def loop_lag(drive: Drive, cycles: Cycles, J: float) -> float:
    """Lag [s] of the speed loop, from the position controller's output to the speed.

    J: inertia that a slow torque accelerates [kg.m2]. The integral part makes the speed follow the reference model,
    whose lag is 2 D/omega_0 + T_ref; without a model it follows the setpoint itself; a P controller alone lags by
    J/K_p. The setpoint ramp adds T_pos - T_c, the held setpoint half of that. A speed from differences of the position
    is late by half its window, so that the axis is early by that.
    """
    if not drive.speed_integrator:
        own = J / drive.K_p if drive.K_p > 0 else float("inf")
    elif drive.reference_model and drive.omega_0 and drive.D is not None:
        own = 2 * drive.D / drive.omega_0 + drive.T_ref
    else:
        own = 0.0
    ramp = cycles.T_pos - cycles.T_c
    return own + (ramp if drive.ramp_speed_setpoint else ramp / 2) - drive.speed_window * cycles.T_c / 2


def model_gain(drive: Drive, J: float) -> float | None:
    """The K_p [N.m.s/rad] that the reference model stands for; None where the drive has no such model.

    The model is to be what the speed loop does with its P part alone, whose lag is J/K_p; the model's is 2 D/omega_0.
    """
    if not (drive.speed_integrator and drive.reference_model and drive.omega_0 and drive.D):
        return None
    return J * drive.omega_0 / (2 * drive.D)


def torque_response(drive: Drive) -> float:
    """Angle per torque [rad/(N.m)] by which an axis gives way to friction that turns round; infinite without control.

    Behind a step M of the torque the speed loop gives way by the integral of its speed, M T_n/K_p, as s goes to 0 in
    1/(J s^2 + K_p s + K_p/T_n). The position controller draws it back meanwhile: its integral over T_n at the rate K_v
    makes that M/(K_p (1/T_n + K_v)). Without integral part it is the stiffness of the loops, M/(K_p K_v).
    """
    rate = drive.K_v + (1 / drive.T_n if drive.speed_integrator and drive.T_n else 0.0)
    return 1 / (drive.K_p * rate) if drive.K_p > 0 and rate > 0 else float("inf")


# Off the neutral value by less than this share of it, or this time, a T_sym is neutral: rounding of what was typed.
NEUTRAL_SHARE, NEUTRAL = 0.02, 20e-6
# Off the value of the reference model by less than this share, a K_p fits it: an inertia is not known better.
FIT_TOLERANCE = 0.1
# Margins that a proposed gain keeps.
GAIN_MARGIN, PHASE_MARGIN = 8.0, 40.0  # [dB], [deg]
SHORTEST_REASON, SHORT_REASON = "shortest with", "as short as"  # how reasons begin that hold for any drive
OUT_OF_LINE = 1.25  # a value that differs more from those of the other axes is taken for one that is off
MIN_RESET_TIME = 1e-3  # T_n [s] below which none is proposed
USUAL_RESET_RATIO = 2.0  # T_n over J/K_p that usual margins allow: the integral part takes 27 degrees at the crossover
RESET_HALVINGS = 6  # of halving the range of T_n on a logarithmic scale: 3 % of its value


COMPENSATION = "drive.friction_pulse"  # stands for a friction compensation of any kind
PARAMETER_WORDS = {
    COMPENSATION: "friction compensation", "path.jerk": "jerk of the path",
    "drive.backlash_compensation.value": "backlash compensation",
}  # fmt: skip
WRITTEN_UNITS = {"m": "um"}  # SI unit -> the unit that a value without a row in the table of the drive is written in


@dataclass(frozen=True)
class Proposal:
    """A parameter to change.

    Attributes:
        cause: what it takes away, in words. axis, parameter: such as "Z", "drive.K_v".
        present, proposed: SI; None: only the direction is known. unit: SI unit.
        reason: why this value. direction: "higher" or "lower".
        margins: before and after, of the axis: least gain margin [dB] and phase margin [deg]; None where not asked.
        step: by how much, where the present value is not known [SI]. of: key and axis of the cause of a circle.
    """

    cause: str
    axis: str
    parameter: str
    present: float | None
    proposed: float | None
    unit: str
    reason: str
    direction: str = ""
    margins: tuple[tuple[float, float], tuple[float, float]] | None = None
    step: float | None = None
    of: tuple[str, str] = ("", "")

    @property
    def key(self) -> str:
        """Of a scenario."""
        return f"machine.axes.{self.axis}.{self.parameter}" if self.axis else f"machine.{self.parameter}"

    @property
    def what(self) -> str:
        """Parameter and axis in words: "T_sym of Z"."""
        name = PARAMETER_WORDS.get(self.parameter, self.parameter.removeprefix("drive."))
        return f"{name} of {self.axis}" if self.axis else name

    @property
    def setting(self) -> str:
        """KEY=VALUE, as behind --set, with the digits that are shown; "" where there is no value."""
        return "" if self.proposed is None else f"{self.key}={self.shown(self.proposed)}"

    def shown(self, value: float, digits: int = 3, *, kept: bool = False) -> str:
        """A value of the parameter with its unit, as it is typed. kept: with zeros at its end."""
        own = parameters("controller").get(self.parameter.removeprefix("drive."))
        unit = own.display_unit if own is not None else WRITTEN_UNITS.get(self.unit, self.unit)
        number = f"{convert(value, self.unit, unit):{'#' * kept}.{digits}g}".rstrip(".")
        return f"{number}{'' if unit == '1' else f' {unit}'}"


def of_circle(
    diagnosis: Diagnosis, machine: Machine | None, modes: Modes | None, *, searched: bool = False
) -> list[Proposal]:
    """Proposals for the causes of a circle, in the order of the causes; each parameter once.

    machine, modes: None where nothing is known of the machine, so that directions are all there is. searched: values
    that take a search within margins are found, which takes seconds.
    """
    result: dict[str, Proposal] = {}
    terms = list(actionable_causes(diagnosis))
    if terms and machine is not None and modes is not None:
        for axis in diagnosis.circle.axes:  # a model that is off makes more than one cause, and is named for the first
            for proposal in _propose_reference_model(machine, modes, axis, name_of_term(terms[0])):
                result[proposal.key] = replace(proposal, of=(terms[0].key, terms[0].axis))
        terms = _by_gain(terms, machine, modes)
    for term in terms:
        proposals = (
            _propose_without_machine(diagnosis, term)
            if machine is None or modes is None
            else _propose_for_term(diagnosis, term, machine, modes, searched)
        )
        for proposal in proposals:
            result.setdefault(proposal.key, replace(proposal, of=(term.key, term.axis)))
    # Of all peaks a value of the file that is off comes first, then compensations, then what any drive could do.
    places = [key for key, proposal in result.items() if proposal.of[0] == "peaks"]
    ordered = iter(sorted(places, key=lambda key: _rank(result[key])))  # in the order of causes within a rank
    return [result[next(ordered) if key in places else key] for key in result]


def _propose_reference_model(machine: Machine, modes: Modes, axis: str, cause: str) -> Iterator[Proposal]:
    """The parameter of an axis's reference model that is off, if one is."""
    drive = machine.axes[axis].drive if axis in machine.axes else None
    if isinstance(drive, Drive):
        J = modes.J_tot(axis)
        K_p = model_gain(drive, J)
        proposal = (
            None
            if K_p is None or abs(drive.K_p / K_p - 1) <= FIT_TOLERANCE
            else _fit_reference_model(machine, axis, drive, J, cause)
        )
        yield from [] if proposal is None else [proposal]


def _rank(proposal: Proposal) -> int:
    if proposal.parameter == COMPENSATION:
        return 1
    return 2 if proposal.reason.startswith((SHORTEST_REASON, SHORT_REASON)) else 0


def of_drives(machine: Machine, modes: Modes, axes: Sequence[str], cause: str) -> list[Proposal]:
    """What does not fit together within the drives of some axes: T_sym beside neutral, K_p beside its model."""
    proposals = []
    for axis in axes:
        drive = machine.axes[axis].drive
        if own := [*_propose_reference_model(machine, modes, axis, cause)]:
            proposals += own
        elif isinstance(drive, Drive):
            proposals += [
                *_propose_neutral_lag(machine, modes, axis, drive, cause),
                *_propose_fitting_gain(machine, modes, axis, drive, cause),
            ]
    return proposals


def of_run(
    run: JudgedRun,
    causes: Mapping[str, Diagnosis],
    figures: Mapping[str, Figure],
    *,
    searched: bool = False,
) -> list[Proposal]:
    """Proposals of a run: for the causes of its circles, and for the axes of its stops.

    causes: prefix of a circle's figures -> why it is not round. figures: of the run, by which stops that ring are
    known. searched: as of :func:`of_circle`. A run that is wrong has none, nor have drives of other makers and machines
    whose modes cannot be read any more.
    """
    machine = run.scenario.machine
    if machine.foreign_units or wrong_findings(run):
        return []
    try:
        modes = checked_modes(machine)
    except FeedsimError:
        return []
    proposals: dict[str, Proposal] = {}
    for diagnosis in causes.values():
        for proposal in of_circle(diagnosis, machine, modes, searched=searched):
            proposals.setdefault(proposal.key, proposal)
    for task in tasks(run.scenario, run.program):
        if isinstance(task, PositioningTask):
            axis = task.approach.axis
            own = of_drives(machine, modes, [axis], f"stops of {axis}")
            for proposal in own or _propose_jerk(run, task, figures):
                proposals.setdefault(proposal.key, proposal)
    return list(proposals.values())


def waits_for_ringing(settling_time: float, frequency: float) -> bool:
    """Whether ringing [Hz] is what an axis waits for until it has settled [s]: it lasts a period of it or more."""
    return math.isfinite(settling_time * frequency) and settling_time * frequency >= 1


def _propose_jerk(run: Run, task: PositioningTask, figures: Mapping[str, Figure]) -> Iterator[Proposal]:
    """A jerk whose phases last a period of the ringing, of a stop that waits for it.

    A phase of constant jerk acts on a mode as its mean over that time, which is nothing over whole periods: the zeros
    of sin(pi f T)/(pi f T).
    """
    path, axis = run.scenario.machine.path, task.approach.axis
    settling, ringing = (figures.get(f"{task.prefix}.{name}") for name in ("settling_time", "ringing_frequency"))
    if settling is None or ringing is None or not waits_for_ringing(settling.value * 1e-3, ringing.value):
        return
    f = ringing.value
    own = run.scenario.machine.axes[axis]
    begin, end = np.searchsorted(run.program.time, (task.approach.start, task.approach.end))
    speed = float(np.abs(run.program.n_ffw[axis][begin : end + 1]).max()) * own.I_P
    acceleration = min(speed * f, path.acceleration, own.max_acceleration)
    if (jerk := acceleration * f) < path.jerk:
        reason = f"a phase of constant jerk then lasts a period of the {f:.3g} Hz that ring"
        yield Proposal(f"stops of {axis}", "", "path.jerk", path.jerk, jerk, "m/s^3", reason, "lower")


def change_drive(machine: Machine, axis: str, values: Mapping[str, float]) -> Machine:
    """A machine with other values of an axis's drive, name -> SI."""
    own = machine.axes[axis]
    return machine.model_copy(
        update={
            "axes": {
                **machine.axes,
                axis: own.model_copy(update={"drive": own.drive.model_copy(update=dict(values))}),
            }
        }
    )


def least_margins(loops: Sequence[Loop], axis: str) -> tuple[float, float]:
    """Least gain margin [dB] and phase margin [deg] of an axis's loops; minus infinity where one is unstable."""
    own = [loop for loop in loops if loop.axis == axis]
    if not own:
        return math.inf, math.inf
    if any(loop.unstable or loop.growing for loop in own):
        return -math.inf, -math.inf
    return min(20 * math.log10(loop.gain_margin) for loop in own), min(loop.phase_margin for loop in own)


def _propose_for_term(
    diagnosis: Diagnosis, term: Term, machine: Machine, modes: Modes, searched: bool
) -> Iterator[Proposal]:
    axes = diagnosis.circle.axes
    drives = {axis: machine.axes[axis].drive for axis in axes if axis in machine.axes}
    if len(drives) < 2 or not all(isinstance(drive, Drive) for drive in drives.values()):
        return
    match term.key:
        case "servo":
            yield from _propose_for_servo_mismatch(axes, term.value, machine, modes)
        case "radius" | "scale":
            cause = "mean radius" if term.key == "radius" else "unlike amplitudes"
            yield from of_drives(machine, modes, axes, cause)
            yield from _without_feedforward(machine, axes, cause)
        case "peaks":
            drive = machine.axes[term.axis].drive
            assert isinstance(drive, Drive)
            cause = f"reversal peaks of {term.axis}"
            for proposal in _propose_fitting_gain(machine, modes, term.axis, drive, cause):
                # A lower gain answers friction later: it makes a peak larger, though the model would fit.
                if term.value < 0 or proposal.direction == "higher":
                    yield proposal
            if term.value > 0:
                yield from _out_of_line(machine, modes, term.axis, drive, cause)
                reason = "feedsim tune compensation finds its values"
                yield Proposal(cause, term.axis, COMPENSATION, None, None, "1", reason, "on")
                yield from _propose_shorter_T_n(machine, modes, term.axis, drive, cause, searched)
        case "lost_motion":
            yield from _propose_backlash(machine, term)


def _by_gain(terms: Sequence[Term], machine: Machine, modes: Modes) -> list[Term]:
    """The terms with the peaks among them by what their drives can take off, not by their sizes.

    A small peak of a slow drive may be worth more than a large one of a drive that can do no better.
    """

    def gain(term: Term) -> float:
        axis = machine.axes.get(term.axis)
        if axis is None or not isinstance(axis.drive, Drive) or term.value <= 0:
            return 0.0
        drive, J = axis.drive, modes.J_tot(term.axis)
        present = torque_response(drive)
        if not 0 < present < math.inf:
            return 0.0
        fitting = model_gain(drive, J)
        K_p = drive.K_p if fitting is None or 1 - drive.K_p / fitting <= FIT_TOLERANCE else fitting
        T_n = drive.T_n
        if drive.speed_integrator and T_n is not None:
            T_n = min(T_n, max(USUAL_RESET_RATIO * J / K_p, MIN_RESET_TIME))
        return term.value * (1 - torque_response(drive.model_copy(update={"K_p": K_p, "T_n": T_n})) / present)

    ordered = iter(sorted((term for term in terms if term.key == "peaks"), key=gain, reverse=True))
    return [next(ordered) if term.key == "peaks" else term for term in terms]


def _propose_for_servo_mismatch(
    axes: tuple[str, str], value: float, machine: Machine, modes: Modes
) -> Iterator[Proposal]:
    """Of a servo mismatch: the parameter that makes most of it, and T_dyn of the early axis, which hides all of it."""
    late, early = axes if value > 0 else axes[::-1]
    cause = f"servo mismatch: {late} is {abs(value) * 1e3:.3g} ms later than {early}"
    L, E = machine.axes[late].drive, machine.axes[early].drive
    assert isinstance(L, Drive)
    assert isinstance(E, Drive)
    neutral = {axis: loop_lag(machine.axes[axis].drive, machine.cycles, modes.J_tot(axis)) for axis in axes}  # type: ignore[arg-type]
    parts: list[tuple[float, Proposal]] = []
    missing = feedforward_lag(L) - feedforward_lag(E)
    if missing > 0:
        parts.append((missing, _propose_feedforward(machine, modes, late, early, L, E, cause)))
    off = {axis: drive.T_sym - neutral[axis] for axis, drive in ((late, L), (early, E))}
    worst = max(off, key=lambda axis: abs(off[axis]))
    if off[late] - off[early] > NEUTRAL:
        parts.append((off[late] - off[early], _propose_T_sym(worst, machine.axes[worst].drive, neutral[worst], cause)))  # type: ignore[arg-type]
    loops = L.T_dyn + neutral[late] - E.T_dyn - neutral[early]
    if loops > NEUTRAL and L.T_dyn >= loops - NEUTRAL:
        reason = f"{early} then waits as long as {late}"
        less = Proposal(cause, late, "drive.T_dyn", L.T_dyn, max(L.T_dyn - loops, 0.0), "s", reason, "lower")
        parts.append((loops, less))
    elif loops > NEUTRAL:
        parts.append((loops, _propose_T_dyn(early, E, E.T_dyn + loops, late, cause)))
    yield from (proposal for _, proposal in sorted(parts, key=lambda part: -part[0]))
    if axis_lag(L) - axis_lag(E) < 0.5 * abs(value):  # the drives as the file has them do not explain it
        yield _propose_T_dyn(early, E, E.T_dyn + abs(value), late, cause)


def _propose_feedforward(
    machine: Machine, modes: Modes, late: str, early: str, L: Drive, E: Drive, cause: str
) -> Proposal:
    if L.k_ffw != E.k_ffw or E.k_ffw >= 1:
        k = max(E.k_ffw, L.k_ffw) if L.k_ffw != E.k_ffw else 1.0
        return Proposal(
            cause, late, "drive.k_ffw", L.k_ffw, k, "1", f"as {early} has it; missing feedforward delays by "
            "(1 - k_ffw)/K_v", "higher" if k > L.k_ffw else "lower",
        )  # fmt: skip
    K_v = (1 - L.k_ffw) / feedforward_lag(E)
    before, after = (
        least_margins(judge(entry, modes), late) for entry in (machine, change_drive(machine, late, {"K_v": K_v}))
    )
    reason = f"without feedforward an axis is 1/K_v late: as much as {early} is"
    if after[0] < GAIN_MARGIN or after[1] < PHASE_MARGIN:
        K_v = (1 - E.k_ffw) / feedforward_lag(L)
        before, after = (
            least_margins(judge(entry, modes), early) for entry in (machine, change_drive(machine, early, {"K_v": K_v}))
        )
        reason = f"{late} has no margin for a higher K_v, so {early} is made as slow"
        return Proposal(cause, early, "drive.K_v", E.K_v, K_v, "1/s", reason, "lower", (before, after))
    return Proposal(cause, late, "drive.K_v", L.K_v, K_v, "1/s", reason, "higher", (before, after))


def _propose_T_sym(axis: str, drive: Drive, neutral: float, cause: str) -> Proposal:
    return Proposal(
        cause, axis, "drive.T_sym", drive.T_sym, neutral, "s", "the lag of its speed loop: with it the following error "
        "of slow motions is 0", "higher" if neutral > drive.T_sym else "lower",
    )  # fmt: skip


def _propose_T_dyn(axis: str, drive: Drive | None, proposed: float, late: str, cause: str) -> Proposal:
    present = drive.T_dyn if drive is not None else None
    return Proposal(
        cause, axis, "drive.T_dyn", present, proposed, "s", f"dynamic matching: {axis} then waits for {late}", "higher"
    )


def _propose_neutral_lag(machine: Machine, modes: Modes, axis: str, drive: Drive, cause: str) -> Iterator[Proposal]:
    neutral = loop_lag(drive, machine.cycles, modes.J_tot(axis))
    if (
        drive.k_ffw > 0
        and 0 < neutral < math.inf
        and abs(drive.T_sym - neutral) > max(NEUTRAL, NEUTRAL_SHARE * neutral)
    ):
        yield _propose_T_sym(axis, drive, neutral, cause)


def _propose_fitting_gain(machine: Machine, modes: Modes, axis: str, drive: Drive, cause: str) -> Iterator[Proposal]:
    K_p = model_gain(drive, modes.J_tot(axis))
    if (
        K_p is None
        or abs(drive.K_p / K_p - 1) <= FIT_TOLERANCE
        or [*_propose_reference_model(machine, modes, axis, cause)]
    ):
        return
    before, after = (
        least_margins(judge(entry, modes), axis) for entry in (machine, change_drive(machine, axis, {"K_p": K_p}))
    )
    reason = "J omega_0/(2 D), which the reference model stands for"
    direction = "higher" if K_p > drive.K_p else "lower"
    yield Proposal(cause, axis, "drive.K_p", drive.K_p, K_p, "N.m.s/rad", reason, direction, (before, after))


def _fit_reference_model(machine: Machine, axis: str, drive: Drive, J: float, cause: str) -> Proposal | None:
    """The parameter of the reference model with which both K_p and T_sym fit it; None where none is."""
    assert drive.omega_0 is not None
    assert drive.D is not None
    factor = drive.K_p / (model_gain(drive, J) or math.inf)
    fitting = drive.model_copy(update={"omega_0": drive.omega_0 * factor})
    neutral = loop_lag(fitting, machine.cycles, J)
    if drive.k_ffw <= 0 or abs(drive.T_sym - neutral) > max(NEUTRAL, NEUTRAL_SHARE * neutral):
        return None
    others = [entry.drive.D for name, entry in machine.axes.items() if name != axis and isinstance(entry.drive, Drive)]
    usual = [D for D in others if D is not None]
    reason = "with it both K_p and T_sym fit the reference model"
    # D/omega_0 alone counts: damping that the other axes do not have is what is off.
    if (
        usual
        and not any(abs(drive.D / D - 1) <= FIT_TOLERANCE for D in usual)
        and abs(drive.D / factor / usual[0] - 1) <= 2 * FIT_TOLERANCE
    ):
        direction = "lower" if factor > 1 else "higher"
        return Proposal(cause, axis, "drive.D", drive.D, drive.D / factor, "1", reason, direction)
    direction = "higher" if factor > 1 else "lower"
    return Proposal(cause, axis, "drive.omega_0", drive.omega_0, drive.omega_0 * factor, "rad/s", reason, direction)


def _out_of_line(machine: Machine, modes: Modes, axis: str, drive: Drive, cause: str) -> Iterator[Proposal]:
    """A K_v below all of the other axes, and a T_n that is long beside theirs, as times of J/K_p; largest gain first.

    J/K_p is that of the reference model where there is one, so that a K_p that is off does not count twice.
    """

    def ratio(name: str, own: Drive) -> float:
        J = modes.J_tot(name)
        K_p = None if [*_propose_reference_model(machine, modes, name, "")] else model_gain(own, J)
        return own.T_n * (K_p or own.K_p) / J if own.speed_integrator and own.T_n else math.inf

    others = [
        (name, entry.drive) for name, entry in machine.axes.items()
        if name != axis and isinstance(entry.drive, Drive) and entry.drive.K_v > 0 and entry.drive.K_p > 0
    ]  # fmt: skip
    if not others or drive.K_v <= 0 or drive.K_p <= 0:
        return
    proposals = []
    usual = max(ratio(name, own) for name, own in others)
    if drive.T_n is not None and ratio(axis, drive) > OUT_OF_LINE * usual:
        T_n = drive.T_n * usual / ratio(axis, drive)
        reason = "as long beside J/K_p as those of the other axes"
        proposals.append(Proposal(cause, axis, "drive.T_n", drive.T_n, T_n, "s", reason, "lower"))
    K_v = min(own.K_v for _, own in others)
    if K_v > OUT_OF_LINE * drive.K_v:
        proposals.append(
            Proposal(cause, axis, "drive.K_v", drive.K_v, K_v, "1/s", "as the other axes have it", "higher")
        )
    before = least_margins(judge(machine, modes), axis) if proposals else (math.inf, math.inf)

    def response(proposal: Proposal) -> float:
        name = proposal.parameter.removeprefix("drive.")
        return torque_response(drive.model_copy(update={name: proposal.proposed}))

    for proposal in sorted(proposals, key=response):
        value = {proposal.parameter.removeprefix("drive."): proposal.proposed}
        after = least_margins(judge(change_drive(machine, axis, value), modes), axis)  # type: ignore[arg-type]
        if after[0] >= GAIN_MARGIN and after[1] >= PHASE_MARGIN:
            yield replace(proposal, margins=(before, after))


def _without_feedforward(machine: Machine, axes: Sequence[str], cause: str) -> Iterator[Proposal]:
    for axis in axes:
        drive = machine.axes[axis].drive
        if isinstance(drive, Drive) and drive.k_ffw < 1:
            reason = "path lag makes circles smaller, by r omega^2/(2 K_v^2) without feedforward"
            yield Proposal(cause, axis, "drive.k_ffw", drive.k_ffw, 1.0, "1", reason, "higher")


def _propose_shorter_T_n(
    machine: Machine, modes: Modes, axis: str, drive: Drive, cause: str, searched: bool
) -> Iterator[Proposal]:
    """A shorter T_n: the integral part answers friction sooner, as far as margins allow."""
    if not drive.speed_integrator or drive.T_n is None or drive.T_n <= MIN_RESET_TIME:
        return
    reason = f"{SHORTEST_REASON} {GAIN_MARGIN:g} dB and {PHASE_MARGIN:g} deg left in every loop of {axis}"
    if not searched:
        margins = f"{GAIN_MARGIN:g} dB and {PHASE_MARGIN:g} deg"
        reason = f"{SHORT_REASON} margins of {margins} allow; feedsim tune proposals finds the value"
        yield Proposal(cause, axis, "drive.T_n", drive.T_n, None, "s", reason, "lower")
        return
    before = least_margins(judge(machine, modes), axis)
    low, high, after = math.log(MIN_RESET_TIME), math.log(drive.T_n), before
    for _ in range(RESET_HALVINGS):
        middle = 0.5 * (low + high)
        there = least_margins(judge(change_drive(machine, axis, {"T_n": math.exp(middle)}), modes), axis)
        if there[0] >= GAIN_MARGIN and there[1] >= PHASE_MARGIN:
            high, after = middle, there
        else:
            low = middle
    T_n = math.exp(high)
    if T_n < 0.95 * drive.T_n:
        yield Proposal(cause, axis, "drive.T_n", drive.T_n, T_n, "s", reason, "lower", (before, after))


def _propose_backlash(machine: Machine, term: Term) -> Iterator[Proposal]:
    drive = machine.axes[term.axis].drive
    if not isinstance(drive, Drive):
        return
    present = getattr(drive, "backlash_compensation", None)
    value = present.value if present is not None else 0.0
    cause = f"lost motion of {term.axis}"
    yield Proposal(
        cause, term.axis, "drive.backlash_compensation.value", value, value + term.value, "m",
        "the step at the reversals", "higher" if term.value > 0 else "lower",
    )  # fmt: skip


def _propose_without_machine(diagnosis: Diagnosis, term: Term) -> Iterator[Proposal]:
    """What a circle alone shows: directions, and amounts that need no machine."""
    first, second = diagnosis.circle.axes
    if term.key == "servo":
        late, early = (first, second) if term.value > 0 else (second, first)
        cause = f"servo mismatch: {late} is {abs(term.value) * 1e3:.3g} ms later than {early}"
        yield Proposal(
            cause, early, "drive.T_dyn", None, None, "s",
            f"{early} then waits for {late}", "higher", step=abs(term.value),
        )  # fmt: skip
        reason = f"or a higher K_v or more feedforward: {late} is sooner"
        yield Proposal(cause, late, "drive.K_v", None, None, "1/s", reason, "higher")
    elif term.key == "peaks" and term.value > 0:
        cause = f"reversal peaks of {term.axis}"
        yield Proposal(cause, term.axis, COMPENSATION, None, None, "1", "takes the peak away", "on")
        reason = "as short as margins allow: the integral part answers friction sooner"
        yield Proposal(cause, term.axis, "drive.T_n", None, None, "s", reason, "lower")
    elif term.key == "lost_motion":
        yield Proposal(
            f"lost motion of {term.axis}", term.axis, "drive.backlash_compensation.value", None, None, "m",
            f"{abs(term.value) * 1e6:.3g} um {'more' if term.value > 0 else 'less'}",
            "higher" if term.value > 0 else "lower", step=term.value,
        )  # fmt: skip
