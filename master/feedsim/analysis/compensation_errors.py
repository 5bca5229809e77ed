"""What a friction compensation leaves on a circle: with errors in it, and on a machine that is another one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from feedsim.analysis.circularity import Contour, Turn, contour, quadrant
from feedsim.analysis.figures import Array
from feedsim.cosim.feedforward import Law, friction_feedforward
from feedsim.cosim.run import run
from feedsim.nc import Program
from feedsim.scenario import FrictionParameters, Machine, Recording, Scenario
from feedsim.trace import Trace

Progress = Callable[[str, int, int], None]

DELAY_ERRORS = (-1e-3, -0.5e-3, -0.2e-3, 0.2e-3, 0.5e-3, 1e-3)  # s
# Parameters that are wrong together: a static torque below the Coulomb torque is none.
VARIED = (("F_C", "F_S"), ("sigma_0",), ("W",), ("gamma",), ("spread",), ("C",), ("sigma_1",), ("v_s",))
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
class Changed:
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
) -> tuple[tuple[Variation, ...], tuple[Changed, ...]]:
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
    for names in VARIED:
        for share in (-FRICTION_ERROR, FRICTION_ERROR):
            varied = {axis: _varied(friction, names, 1 + share) for axis, friction in frictions.items()}
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
        changed.append(Changed(words, left(own, None), left(own, torque)))
    progress("what errors cost", total, total)
    return tuple(variations), tuple(changed)


def _varied(friction: FrictionParameters, names: Sequence[str], factor: float) -> FrictionParameters:
    """A set with some parameters multiplied; the same where its law has none of them, or they have no effect."""
    if not set(names) <= set(type(friction).model_fields) or (set(names) <= set(OF_ENGAGING) and friction.W == 0):
        return friction
    values = {name: getattr(friction, name) * factor for name in names}
    if "gamma" in values:
        values["gamma"] = min(values["gamma"], 1.0)
    return friction.model_copy(update=values)
