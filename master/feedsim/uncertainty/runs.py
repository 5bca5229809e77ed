"""A run with every draw of its machine: intervals of its figures, bands of its contours and stops."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis import CircleTask, Figure, PositioningTask, contour, evaluate, tasks
from feedsim.analysis.circularity import Contour
from feedsim.analysis.compensation import Compensation, circle_figures
from feedsim.analysis.evaluate import Result
from feedsim.cosim.feedforward import friction_feedforward
from feedsim.cosim.friction_law import FrictionLaws
from feedsim.cosim.run import run
from feedsim.scenario import Recording
from feedsim.uncertainty.draws import Cloud, Known, draw_named, drawn_friction, on_draw, torque_scale
from feedsim.uncertainty.spread import interval, share_of

Array = NDArray[np.float64]
CONTOUR_POINTS = 1440  # points of a contour
STOP_POINTS, TIME_BEHIND_STOP = 600, 0.3  # points of a stop, and the time behind it [s] that they lie in


@dataclass(frozen=True, eq=False)
class Band:
    """What a curve is, and what draws make of it.

    Attributes:
        prefix: of the figures of its circle or stop. kind: "contour", deviation of the radius [m] over the angle [rad];
            "stop", position beyond the target [m] over the time since the end of the motion [s].
        at (N,): abscissae. nominal, low, high (N,): of the machine as it is, and the ends of the interval.
    """

    prefix: str
    kind: str
    at: Array
    nominal: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, prefix: str, kind: str, at: Array, nominal: Array, curves: Array) -> Band:
        """curves: (draws, N)."""
        return cls(prefix, kind, at, nominal, *interval(curves))


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """What the intervals of identified values make of a run.

    Attributes:
        cloud: what was drawn from. count: draws. figures: name -> ends of its interval, in its unit; NaN where a draw
            has no such figure. bands: of circles and stops. sets: axis -> what is known
            of the set that compensates, where that is drawn too.
    """

    cloud: Cloud
    count: int
    figures: Mapping[str, tuple[float, float]]
    bands: tuple[Band, ...] = ()
    sets: Mapping[str, Known] = field(default_factory=dict)

    @property
    def share(self) -> float:
        """Of further draws, that intervals and bands hold on average."""
        return share_of(self.count)


def of_run(
    nominal: Result, cloud: Cloud, count: int, *, seed: int = 1, fmus: Path | None = None,
    progress: Callable[[str, int, int], None],
) -> Uncertainty:  # fmt: skip
    """Run the scenario of a run with `count` draws of its machine. Raises as :func:`feedsim.cosim.run`."""
    scenario, program = nominal.scenario, nominal.program
    shapes = curves_of(nominal)
    figures: list[Mapping[str, Figure]] = []
    curves: list[dict[tuple[str, str], Array]] = []
    for k, machine in enumerate(cloud.draws(count, seed)):
        progress("draws", k, count)
        with draw_named(k, count):
            done = run(on_draw(scenario, machine), program=program, fmus=fmus)
        figures.append(evaluate(done))
        curves.append({key: y for key, (_, y) in curves_of(done).items()})
    progress("draws", count, count)
    bands = tuple(
        Band.of(prefix, kind, at, y, np.array([curve[prefix, kind] for curve in curves]))
        for (prefix, kind), (at, y) in shapes.items()
    )
    return Uncertainty(cloud, count, intervals_of(evaluate(nominal), figures), bands)


def of_compensation(
    compensation: Compensation, known: Mapping[str, Known], cloud: Cloud | None, count: int, *, seed: int = 1,
    fmus: Path | None = None, progress: Callable[[str, int, int], None],
) -> Uncertainty:  # fmt: skip
    """Run a circle without and with compensation, with draws of the machine and of the sets that compensate.

    known: axis -> what is known of the set of its compensation, where that is not the machine's. cloud: of the machine,
    where it has identified values. Raises as :func:`feedsim.cosim.run`.
    """
    scenario, program, turn = compensation.scenario, compensation.after.program, compensation.turn
    columns = tuple(f"{axis}.x_a" for axis in turn.axes)
    tool = tuple(name for name in compensation.after.trace.columns if name.startswith("tcp."))
    recording = Recording(interval=scenario.recording.interval, variables=(*columns, *tool))
    lean = scenario.model_copy(update={"recording": recording})
    random = np.random.default_rng(seed + 1)
    machines = cloud.draws(count, seed) if cloud is not None else iter([scenario.machine] * count)
    figures: list[Mapping[str, Figure]] = []
    curves: dict[str, list[Array]] = {"without": [], "with": []}
    with FrictionLaws(fmus) as laws:
        for k, machine in enumerate(machines):
            progress("draws", k, count)
            sets = {
                axis: drawn_friction(friction, known[axis], random) if axis in known else friction
                for axis, friction in compensation.frictions.items()
            }
            torque = {
                axis: torque_scale(scenario.machine, machine, axis) * values
                for axis, values in friction_feedforward(machine, program, sets, compensation.delays, laws).items()
            }
            plan = on_draw(lean, machine)
            with draw_named(k, count):
                before = run(plan, program=program, fmus=fmus)
                after = run(plan, program=program, fmus=fmus, torque_feedforward=torque)
            figures.append(circle_figures(turn, before.trace, after.trace))
            for name, value in (("without", before), ("with", after)):
                curves[name].append(contour_of(contour(value.trace, turn)))
    progress("draws", count, count)
    bands = tuple(
        Band.of(name, "contour", _angles(), contour_of(contour(judged_run.trace, turn)), np.array(curves[name]))
        for name, judged_run in (("without", compensation.before), ("with", compensation.after))
    )
    names = {name: figure for name, figure in compensation.figures.items() if name in figures[0]}
    return Uncertainty(cloud or Cloud(scenario.machine, {}), count, intervals_of(names, figures), bands, known)


def intervals_of(names: Mapping[str, object], draws: list[Mapping[str, Figure]]) -> dict[str, tuple[float, float]]:
    """Name -> interval of figures; NaN where a draw lacks the figure or its value."""
    result = {}
    for name in names:
        values = np.array([float(draw[name]) if name in draw else math.nan for draw in draws])
        if np.isfinite(values).all():
            low, high = interval(values)
            result[name] = float(low), float(high)
        else:
            result[name] = math.nan, math.nan
    return result


def curves_of(result: Result) -> dict[tuple[str, str], tuple[Array, Array]]:
    """(prefix, kind) -> abscissae and ordinates of every circle and stop, on the same abscissae for every machine."""
    results: dict[tuple[str, str], tuple[Array, Array]] = {}
    for task in tasks(result.scenario, result.program):
        if isinstance(task, CircleTask):
            results[task.prefix, "contour"] = _angles(), contour_of(contour(result.trace, task.turn))
        elif isinstance(task, PositioningTask):
            stop = task.approach
            at = np.linspace(0.0, min(stop.until - stop.end, TIME_BEHIND_STOP), STOP_POINTS)
            sense = math.copysign(1.0, stop.target - stop.origin)
            x = np.interp(stop.end + at, result.trace.time, np.asarray(result.trace[f"{stop.axis}.x_a"]))
            results[task.prefix, "stop"] = at, sense * (x - stop.target)
    return results


def contour_of(turn: Contour) -> Array:
    """(CONTOUR_POINTS,) deviation of the radius [m] at angles that are the same for every turn."""
    order = np.argsort(turn.angle)
    return np.asarray(np.interp(_angles(), turn.angle[order], turn.deviation[order], period=2 * math.pi))


def _angles() -> Array:
    return np.linspace(-math.pi, math.pi, CONTOUR_POINTS, endpoint=False)
