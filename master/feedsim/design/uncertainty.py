"""Draws of a machine from the intervals and correlations that its identified values have.

A friction file of feedsim identify friction holds, in its group `identified`, an interval of 95 % of every estimated
 parameter and their correlation matrix. Together they are the covariance of a normal distribution. A draw
outside the range of a parameter, or with less static than Coulomb friction, is drawn anew: the normal distribution,
truncated to what is possible.

A value that the machine file has otherwise than its identification was set by somebody: it does not vary.

Where the inertia was identified together with the drive, all torques of a draw are divided by its inertia over that of
the machine. The equation of motion of an axis, its elastic modes included, has torques over inertia only. So the motion
is the one of the drawn inertia, and the table of modes stays as it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis import CircleTask, Figure, PositioningTask, contour, evaluate, tasks
from feedsim.analysis.circularity import Contour
from feedsim.analysis.compensation import Compensation, circle_figures
from feedsim.analysis.evaluate import Result
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.files.fields import Quantity
from feedsim.foundation import units
from feedsim.foundation.arguments import spell_argument
from feedsim.foundation.errors import InputError, SimulationError
from feedsim.scenario import Drive, Friction, FrictionParameters, GmsFriction, Machine, Recording, Scenario
from feedsim.scenario.axis_units import SHARED_WITH_GUIDE, ParameterGroup
from feedsim.simulation.cosim.feedforward import friction_feedforward
from feedsim.simulation.cosim.friction_law import FrictionLaws
from feedsim.simulation.cosim.run import run

Array = NDArray[np.float64]
Law = TypeVar("Law", bound=FrictionParameters)
SAME_VALUE_SHARE = 1e-3  # of the standard deviation: a value that is nearer to that of its identification is that value
ATTEMPTS = 10_000  # draws until one is possible
SEARCH_DRAWS = 4  # draws that values are found on besides the machine as it is
SEARCH_SEED, JUDGE_SEED = 1, 2  # of draws that values are found on, and of others that they are judged on
LOAD, INERTIA = "constant_load", "inertia"
ATTRACTION = "C"  # of Maxwell slip, a torque per time
# Symbol of the correlation matrix -> key of the group `identified`, of what is no parameter of the friction.
SYMBOL_KEYS = {"M_0": LOAD, "J": INERTIA}
DRAWN_UNITS = {LOAD: "N.m", INERTIA: "kg.m2"}


@dataclass(frozen=True, eq=False)
class KnownValues:
    """How well the values of an axis are known.

    names: keys of friction, "drive.K_p" and the like of the drive, "constant_load", "inertia". mean (P,), covariance
    (P, P): SI. fixed: names that have an interval and were set otherwise.
    """

    axis: str
    names: tuple[str, ...]
    mean: Array
    covariance: Array
    fixed: tuple[str, ...] = ()

    @property
    def sigma(self) -> Array:
        """(P,) standard deviations."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def draw(self, random: np.random.Generator) -> dict[str, float]:
        """A draw of all values, whether possible or not."""
        values, vectors = np.linalg.eigh(self.covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        return dict(zip(self.names, map(float, self.mean + root @ random.normal(size=len(self.names))), strict=True))


@dataclass(frozen=True, eq=False)
class Cloud:
    """A machine and what is known of its values, by axis."""

    machine: Machine
    known: Mapping[str, KnownValues]

    def draws(self, count: int, seed: int = 1) -> Iterator[Machine]:
        """Machines, the same ones for the same seed. InputError: the intervals of an axis exclude what is possible."""
        random = np.random.default_rng(seed)
        for _ in range(count):
            axes = dict(self.machine.axes)
            for axis, known in self.known.items():
                axes[axis] = _draw_possible_axis(axes[axis], known, random)
            yield self.machine.model_copy(update={"axes": axes})


def cloud_of(machine: Machine, axes: Sequence[str] | None = None) -> Cloud:
    """What the files of a machine say of its values. axes: that may vary; None: all.

    Raises InputError: no axis has identified values with intervals; as :func:`known_of`.
    """
    result = known_values(machine, axes)
    if not result:
        raise InputError(
            f"{machine.name}: no axis has identified values with intervals, which draws could be made from; give an "
            "axis the friction file of feedsim identify friction or identify-drive"
        )
    return Cloud(machine, result)


def known_values(machine: Machine, axes: Sequence[str] | None = None) -> dict[str, KnownValues]:
    """Axis -> what its files say of its values, of axes that have identified values with intervals. Raises InputError
    as :func:`known_of`."""
    result = {}
    for name in axes or machine.axes:
        axis = machine.axes[name]
        if not isinstance(axis.friction, FrictionParameters):
            continue
        present: dict[str, float] = {LOAD: axis.constant_load, INERTIA: math.nan}  # that of the modes
        present |= {key: float(value) for key, value in axis.friction.parameters().items()}
        if isinstance(axis.drive, Drive):
            present |= {
                f"drive.{key}": float(value)
                for key, value in axis.drive.parameters().items()
                if isinstance(value, int | float) and not isinstance(value, bool)
            }
        known = known_of(axis.friction, name, present)
        if known.names:
            result[name] = known
    return result


def known_of(friction: FrictionParameters, axis: str, present: Mapping[str, Any]) -> KnownValues:
    """What a friction file says of its values. present: key -> value [SI] that is in use; others do not count.

    Raises InputError: the group `identified` is not as feedsim writes it.
    """
    identified = friction.identified
    try:
        return _known_values(identified, axis, present)
    except (KeyError, TypeError, ValueError, AttributeError, InputError) as error:
        raise InputError(
            f"axis {axis}: the group identified of its friction is not as feedsim identify friction writes it: {error}"
        ) from None


def _known_values(identified: Mapping[str, Any], axis: str, present: Mapping[str, Any]) -> KnownValues:
    ends: dict[str, tuple[float, float]] = {}
    for name, one in (
        *identified.get("parameters", {}).items(),
        *((key, identified.get(key, {})) for key in DRAWN_UNITS),
    ):
        if "interval" in one:
            low, high = (_si(end, name) for end in one["interval"])
            ends[name] = low, high
    names: list[str] = []
    fixed: list[str] = []
    for name, (low, high) in ends.items():
        spread = (high - low) / (2 * NORMAL_95)
        if name not in present or not spread > 0:
            continue
        same = name == INERTIA or abs(present[name] - (low + high) / 2) <= SAME_VALUE_SHARE * spread
        (names if same else fixed).append(name)
    sigma = np.array([(ends[name][1] - ends[name][0]) / (2 * NORMAL_95) for name in names])
    mean = np.array([sum(ends[name]) / 2 if name == INERTIA else present[name] for name in names], dtype=np.float64)
    correlation = np.eye(len(names))
    known = identified.get("correlation", {})
    of = [SYMBOL_KEYS.get(name, name) for name in known.get("names", ())]
    matrix = np.array(known.get("matrix", ()), dtype=np.float64).reshape(len(of), len(of))
    shared = [(i, of.index(name)) for i, name in enumerate(names) if name in of]
    for i, k in shared:
        for j, m in shared:
            correlation[i, j] = 1.0 if i == j else (matrix[k, m] + matrix[m, k]) / 2
    return KnownValues(axis, tuple(names), mean, correlation * np.outer(sigma, sigma), tuple(fixed))


def _si(end: str | float, name: str) -> float:
    """An end of an interval, as it was written: a number, or one with a unit."""
    if not isinstance(end, str):
        return float(end)
    return units.parse(end, unit_of(name))


def unit_of(name: str) -> str:
    """SI unit of a value by its name. KeyError: no such value."""
    if name in DRAWN_UNITS:
        return DRAWN_UNITS[name]
    if name.startswith("drive."):
        field = Drive.model_fields[name.removeprefix("drive.")]
    else:
        field = {**GmsFriction.model_fields, **Friction.model_fields}[name]
    quantity = Quantity.of(field)
    return quantity.unit if quantity is not None else units.DIMENSIONLESS


@contextmanager
def draw_named(k: int, count: int, use: str = "") -> Iterator[None]:
    """Name the draw that is refused or fails, the k-th of `count` from 0: the machine as it is has run. use: what for.

    Raises InputError or SimulationError, as what it is about.
    """
    try:
        yield
    except (InputError, SimulationError) as error:
        raise type(error)(f"draw {k + 1} of {count} of the machine{use and f', {use}'}: {error}") from error


def torque_scale(machine: Machine, drawn: Machine, axis: str) -> float:
    """Inertia of an axis of a machine over that of a draw of it: what multiplies all torques of that axis.

    A torque that reaches the axis from outside the machine, a feedforward or a load, has to be multiplied as well.
    """
    before, after = machine.axes[axis].drive, drawn.axes[axis].drive
    if not (isinstance(before, Drive) and isinstance(after, Drive) and before.M_max):
        return 1.0
    return after.M_max / before.M_max  # the limit is never drawn itself


def typed_drive(draw: Machine, machine: Machine, axis: str, drive: Drive) -> Drive:
    """The drive of a draw of a machine where somebody has typed the values of `drive` that differ from the machine's.

    What is typed does not vary; like all torques of a draw, a gain is multiplied by :func:`torque_scale`.
    """
    own, before = draw.shipped_drive(axis, "a draw"), machine.shipped_drive(axis, "a draw")
    values = {name: value for name in Drive.model_fields if (value := getattr(drive, name)) != getattr(before, name)}
    if "K_p" in values:
        values["K_p"] *= torque_scale(machine, draw, axis)
    return own.model_copy(update=values)


def typed_on(draw: Machine, machine: Machine, changed: Machine) -> Machine:
    """A draw of a machine with the drives of `changed`, as :func:`typed_drive`."""
    axes = dict(draw.axes)
    for name, axis in axes.items():
        if isinstance(drive := changed.axes[name].drive, Drive):
            axes[name] = axis.model_copy(update={"drive": typed_drive(draw, machine, name, drive)})
    return draw.model_copy(update={"axes": axes})


def on_draw(scenario: Scenario, drawn: Machine) -> Scenario:
    """The scenario on a draw of its machine, without a log: loads are torques and forces from outside as well."""
    loads = []
    for load in scenario.loads:
        axis = load.axis_name
        scale = torque_scale(scenario.machine, drawn, axis) if axis in drawn.axes else 1.0
        loads.append(load.model_copy(update={"factor": scale * load.factor}) if scale != 1 else load)
    return scenario.model_copy(update={"machine": drawn, "loads": tuple(loads), "logging": None})


def drawn_friction(friction: Law, known: KnownValues, random: np.random.Generator) -> Law:
    """A draw of a friction alone, as compensations use it. Raises InputError as :meth:`Cloud.draws`."""
    for _ in range(ATTEMPTS):
        drawn = known.draw(random)
        if (made := _friction(friction, drawn, 1.0)) is not None:
            return made
    raise _impossible_draws_error(known)


def _draw_possible_axis(axis: Any, known: KnownValues, random: np.random.Generator) -> Any:
    """The axis with a draw that is possible."""
    for _ in range(ATTEMPTS):
        drawn = known.draw(random)
        inertia = float(known.mean[known.names.index(INERTIA)]) if INERTIA in known.names else 0.0
        if inertia and drawn[INERTIA] <= 0:
            continue
        factor = inertia / drawn[INERTIA] if inertia else 1.0
        friction, drive = _friction(axis.friction, drawn, factor), _drive(axis.drive, drawn, factor)
        if friction is not None and drive is not None:
            load = factor * drawn.get(LOAD, axis.constant_load)
            parts = {} if factor == 1 else _scale_further_friction(axis, factor)
            return axis.model_copy(update={"friction": friction, "drive": drive, "constant_load": load, **parts})
    raise _impossible_draws_error(known)


def _impossible_draws_error(known: KnownValues) -> InputError:
    return InputError(
        f"axis {known.axis}: of {ATTEMPTS} draws from the intervals of its identified values none is possible; their "
        "values lie outside of the ranges of the parameters"
    )


def _friction(friction: Law, drawn: Mapping[str, float], factor: float) -> Law | None:
    """With the values drawn, its torques times `factor`; None where that is no friction."""
    values = {name: value for name, value in drawn.items() if name in type(friction).model_fields}
    torques = [name for name in (*SHARED_WITH_GUIDE, ATTRACTION) if name in type(friction).model_fields]
    for name in torques if factor != 1 else ():
        values[name] = factor * values.get(name, float(getattr(friction, name)))
    if not _are_in_range(type(friction), values):
        return None
    made = friction.model_copy(update=values)
    # Where the identification found no difference of both, F_S is no value of its own and follows F_C.
    if "F_S" not in values and friction.F_S == friction.F_C:
        made = made.model_copy(update={"F_S": made.F_C})
    return made if made.F_S >= made.F_C else None


def _drive(drive: Any, drawn: Mapping[str, float], factor: float) -> Any:
    """With the values drawn, its torques times `factor`; None where that is no drive."""
    if not isinstance(drive, Drive):
        return drive
    values = {name.removeprefix("drive."): value for name, value in drawn.items() if name.startswith("drive.")}
    if factor != 1:
        values["K_p"] = factor * values.get("K_p", drive.K_p)
        values["M_max"] = factor * drive.M_max
    if not _are_in_range(Drive, values):
        return None
    torques = {} if factor == 1 else _group_torques(drive, factor)
    return drive.model_copy(update={**values, **torques})


def _group_torques(drive: Drive, factor: float) -> dict[str, ParameterGroup]:
    """Groups of a drive that have torques, cogging and a friction table, with these times `factor`."""
    parameter_groups = {}
    for name in Drive.model_fields:
        if isinstance(parameter_group := getattr(drive, name), ParameterGroup):
            quantities = {key: Quantity.of(info) for key, info in type(parameter_group).model_fields.items()}
            torques = [key for key, quantity in quantities.items() if quantity is not None and quantity.unit == "N.m"]
            if torques:
                parameter_groups[name] = _times(parameter_group, torques, factor)
    return parameter_groups


def _scale_further_friction(axis: Any, factor: float) -> dict[str, ParameterGroup]:
    """Contact of the motor, and a guide with a law of its own, with their forces times `factor`."""
    parameter_groups: dict[str, ParameterGroup] = {}
    if axis.transmission is not None:
        parameter_groups["transmission"] = _times(axis.transmission, ("stiffness", "damping"), factor)
    if axis.guide is not None and axis.guide.share is None:
        parameter_groups["guide"] = _times(axis.guide, SHARED_WITH_GUIDE, factor)
    return parameter_groups


def _times(group: ParameterGroup, names: Iterable[str], factor: float) -> ParameterGroup:
    return group.model_copy(update={name: factor * getattr(group, name) for name in names})


def _are_in_range(model: type[FrictionParameters | Drive], values: Mapping[str, float]) -> bool:
    """Whether all values are in the ranges of their parameters."""
    for name, value in values.items():
        quantity = Quantity.of(model.model_fields[name])
        if quantity is None:
            continue
        if not quantity.minimum <= value <= quantity.maximum or value <= quantity.above:
            return False
    return True


# --- Intervals of what draws give: without a distribution, by their order ---------------------------------------------
# A further draw lies with a probability of (N + 1 - 2 k)/(N + 1) between the k-th smallest and the k-th largest of N
# draws, whatever the distribution (S. S. Wilks, Ann. Math. Stat. 12 (1941) 91-96). N = 39 hold 95 % between the least
# and
# the largest; more draws hold the same share more evenly.


BAND_PROBABILITY = 0.95
MIN_DRAWS = 19  # draws: they hold 90 %


def check_count(count: int) -> None:
    """InputError: too few draws for an interval."""
    if count < MIN_DRAWS:
        raise InputError(
            f"{spell_argument('uncertain')} {count}: at least {MIN_DRAWS} draws are needed; {MIN_DRAWS} hold 90 "
            f"% of what may "
            "be, 39 and more hold 95 %"
        )


def share_of(count: int) -> float:
    """Share of further draws that an interval of `count` draws holds, on average.

    >>> share_of(19), share_of(200)
    (0.9, 0.95)
    """
    return min(BAND_PROBABILITY, (count - 1) / (count + 1))


def interval(values: Array) -> tuple[Array, Array]:
    """(...,) ends of the interval of draws (N, ...)."""
    tail = (1 - share_of(len(values))) / 2
    low, high = np.quantile(values, [tail, 1 - tail], axis=0, method="weibull")
    return np.asarray(low), np.asarray(high)


# --- A run with every draw of its machine: intervals of its figures, bands of its contours and stops ------------------


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
    sets: Mapping[str, KnownValues] = field(default_factory=dict)

    @property
    def share(self) -> float:
        """Of further draws, that intervals and bands hold on average."""
        return share_of(self.count)


def of_run(
    nominal: Result, cloud: Cloud, count: int, *, seed: int = 1, fmus: Path | None = None,
    progress: Callable[[str, int, int], None],
) -> Uncertainty:  # fmt: skip
    """Run the scenario of a run with `count` draws of its machine. Raises as :func:`feedsim.simulation.cosim.run`."""
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
    compensation: Compensation, known: Mapping[str, KnownValues], cloud: Cloud | None, count: int, *, seed: int = 1,
    fmus: Path | None = None, progress: Callable[[str, int, int], None],
) -> Uncertainty:  # fmt: skip
    """Run a circle without and with compensation, with draws of the machine and of the sets that compensate.

    known: axis -> what is known of the set of its compensation, where that is not the machine's. cloud: of the machine,
    where it has identified values. Raises as :func:`feedsim.simulation.cosim.run`.
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
