"""Step 3, for records of general motion: load with its drift, and Coulomb friction, from the position in open loop.

Stage 2 compares torques. To it 1 % of the friction that is wrong all through the record weighs no more than 1 % that
changes its sign with every turn of the screw; where its model lacks something (ripple, a load that drifts) it gives
F_C and M_0 what suits the rest. A position is the second integral of the torque: driven by the recorded torque, the
model drifts away by millimetres from an error that is lost in the torque's residual. All of that drift is at the lowest
frequencies, where M_0 and F_C act (in both directions, and against each) and the other parameters hardly do: those are
left to the inverse dynamics, these two to the position.

Therefore M_0 and F_C are estimated once more by least squares on the position in open loop: recorded angle less the
angle that a rigid axis with this friction reaches under the recorded torque, from the recorded speed at the start.
F_S moves by as much as F_C, and all else is held. The step refuses itself where the drift is no such evidence.

A load is never quite constant: an amplifier's offset moves as it warms, grease leaves the rail. A change by 1 % of the
friction over the record takes the position as far away as all else. With M_0, which is that in the middle of the
record, goes its rate dM_0/dt, one for each record. The residual of the torque determines the rate, too, by a regression
on time; as the two criteria weigh the record differently, the interval holds both. Where the intervals of all rates
include 0, the records determine no drift: F_C and M_0 are then estimated with a constant load.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from math import ceil, inf, isfinite, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from feedsim.estimation.fit import Fit, fit
from feedsim.estimation.identify.motion import RecordTorque, deflection
from feedsim.estimation.identify.parameters import level
from feedsim.estimation.identify.record import Array, Record
from feedsim.estimation.identify.result import Balance, Drift, Estimate
from feedsim.estimation.least_squares import NORMAL_95, Model
from feedsim.estimation.parameter import Parameter
from feedsim.foundation.errors import InputError, SimulationError

if TYPE_CHECKING:
    from feedsim.simulation.cosim.friction_law import FrictionLaw


# --- A rigid axis with friction that moves under a recorded torque, and what the record lacks of that motion ----------
# The recorded motion gives its first angle and speed only. Start reading at simulate_angle().


# of the quickest time of bristles and inertia: the longest step of the free axis, which goes explicitly
EXPLICIT_STEP_SHARE = 0.25
MOST_STEPS = 32  # per interval: beyond that the bristles are too stiff for this record
START_FIT = 0.01, 9  # [s], rows, whichever is more: what the cubic for the first speed goes through
OUTLIER = 5.0  # standard deviations from that cubic that no sample of it may lie off
BLOCKS = 10  # stretches of a record whose torque residual may be turned


def simulate_angle(record: Record, law: FrictionLaw, values: Mapping[str, float]) -> Array:
    """(N,) angle [rad] that a rigid axis reaches under the record's torque, from the recorded angle and speed on.

    J dn/dt = M_a(t + delay) - M_0 - M_fr - load; the axis goes on by itself, whatever was recorded.

    Args:
        values: every friction parameter, J, M_0, and the delay of the torque [s].

    Raises:
        InputError: a record without a position, parameters that the law refuses, friction that is too stiff for it.
        SimulationError: the motion would be no finite number.
    """
    if record.angle is None:
        raise InputError(f"{record.name}: no position; in open loop it is what is compared")
    steps = substeps(values, record.interval)
    if steps > MOST_STEPS:
        raise InputError(
            f"{record.name}: {steps} steps between rows are needed for this friction in open loop; allowed: up to "
            f"{MOST_STEPS}. sigma_0 or sigma_1 is too large for rows {1e3 * record.interval:.3g} ms apart"
        )
    first, n = first_speed(record.angle, record.interval)
    torque = middle_torque(record, values["delay"])
    z = first_deflection(values, n, float(torque[0]) - values["M_0"])
    parameters = {name: values[name] for name in law.names}
    angle, _ = law.free_axis(parameters, values["J"], values["M_0"], torque, record.interval, n=n, z=z, substeps=steps)
    return np.asarray(first + angle, dtype=np.float64)


def middle_torque(record: Record, delay: float) -> Array:
    """(N - 1,) motor torque less known load [N.m] in the middle of every interval."""
    middle = record.time[:-1] + record.interval / 2
    torque = np.interp(middle + delay, record.time, record.torque)
    if record.load is not None:
        torque = torque - np.interp(middle, record.time, record.load)
    return np.asarray(torque, dtype=np.float64)


class OpenLoop:
    """One record: where the model goes under its torque."""

    def __init__(self, record: Record, model: RecordTorque, change: str) -> None:
        """change: name of the load's change over this record among the values [N.m]."""
        assert record.angle is not None
        self.record, self.model, self.change = record, model, change
        self.duration = record.interval * (len(record) - 1)
        self.angle = record.angle
        first, self.n = first_speed(self.angle, record.interval)
        self.origin = float(first)
        self._torque: tuple[float, Array] | None = None

    def residual(self, values: Mapping[str, float], push: Array | float = 0.0) -> Array:
        """(N,) recorded less reached angle [rad]. push: (N - 1,) added to the torque [N.m]."""
        h = self.record.interval
        drifts = values[self.change] * self._elapsed_share(self.record.time[:-1] + h / 2)
        torque = self.torque(values["delay"]) - drifts + push
        parameters = {name: values[name] for name in self.model.law.names}
        z = first_deflection(values, self.n, float(torque[0]) - values["M_0"])
        steps = substeps(values, h)
        free_axis = self.model.law.free_axis
        angle, _ = free_axis(parameters, values["J"], values["M_0"], torque, h, n=self.n, z=z, substeps=steps)
        return np.asarray(self.angle - self.origin - angle, dtype=np.float64)

    def torque_residual(self, values: Mapping[str, float]) -> Array:
        """(rows,) model less record at the rows of stage 2 [N.m]."""
        # The state at the begin as shares of what is possible, in the words of the model.
        load = values["M_0"] - values[self.change] / 2
        z = first_deflection(values, self.n, float(self.torque(values["delay"])[0]) - load)
        share = min(max(z / deflection(values), -1.0), 1.0)
        return self.model.residual(values, share, 0.0) + values[self.change] * self._elapsed_share(
            self.record.time[self.model.rows]
        )

    def _elapsed_share(self, time: Array) -> Array:
        """Time since the middle of the record, as a share of its duration."""
        return np.asarray((time - self.record.time[0]) / self.duration - 0.5, dtype=np.float64)

    def slope(self, values: Mapping[str, float]) -> float:
        """Change of the load over the record by a regression of the torque residual [N.m]."""
        known = {**values, self.change: 0.0}
        elapsed, speed = self._elapsed_share(self.record.time[self.model.rows]), self.model.moved(values["delay"])[1]
        columns = np.column_stack([elapsed, np.ones_like(elapsed), np.sign(speed), speed])
        return -float(np.linalg.lstsq(columns, self.torque_residual(known), rcond=None)[0][0])

    def disturbed(self, values: Mapping[str, float], rng: np.random.Generator) -> Array:
        """(N,) residual of the position [rad] had the torque been off in another way: by the torque residual that it
        has, with the sign of each of BLOCKS stretches drawn anew."""
        off = np.zeros(len(self.record))
        off[self.model.rows] = self.torque_residual(values)
        turned = np.repeat(rng.choice([-1.0, 1.0], BLOCKS), ceil(len(off) / BLOCKS))[: len(off)]
        return self.residual(values, (turned * off)[:-1])

    def drift(self, before: Array, after: Array) -> Drift:
        return Drift(self.record.name, self.record.time, self.angle - self.origin, before, after)

    def torque(self, delay: float) -> Array:
        """(N - 1,) motor torque less known load [N.m] in the middle of every interval."""
        if self._torque is None or self._torque[0] != delay:
            self._torque = delay, middle_torque(self.record, delay)
        return self._torque[1]


def first_speed(angle: Array, h: float) -> tuple[float, float]:
    """Angle and speed at the first of the instants h apart, by a cubic through the first ones; samples far off it are
    left out."""
    count = min(max(ceil(START_FIT[0] / h), START_FIT[1]), len(angle))
    t = np.arange(count) / max(count - 1, 1)
    columns, first = np.vander(t, 4, increasing=True), angle[:count]

    def through(weights: Array) -> tuple[Array, Array]:
        root = np.sqrt(weights)
        shape = np.linalg.lstsq(columns * root[:, None], first * root, rcond=None)[0]
        return np.asarray(shape, dtype=np.float64), np.asarray(np.abs(first - columns @ shape), dtype=np.float64)

    # Smallest sum of distances, by least squares over and over, so that a sample far off does not bend the cubic.
    weights = np.ones(count)
    least = 1e-9 * max(float(np.ptp(first)), 1e-30)
    for _ in range(30):
        _, off = through(weights)
        weights = least / np.maximum(off, least)
    scatter = float(np.median(off)) / 0.6745
    kept = off <= max(OUTLIER * scatter, 10 * least)
    shape, _ = through(kept.astype(np.float64) if np.count_nonzero(kept) >= 6 else np.ones(count))
    return float(shape[0]), float(shape[1]) / (h * max(count - 1, 1))


def first_deflection(values: Mapping[str, float], n: float, torque: float) -> float:
    """z [rad] at the start. Where the axis moves that far within `START_FIT`, it is that of sliding; else what
    holds the torque [N.m] on it, the transmission half engaged (c = 0), as far as bristles can."""

    def most(side: float) -> float:
        return (1 + values["asymmetry"] * side) * float(level(values, np.array([n]))[0]) / values["sigma_0"]

    if abs(n) * START_FIT[0] > most(float(np.sign(n))):
        return float(np.sign(n)) * most(float(np.sign(n)))
    share = 1.0 if values.get("W", 0.0) == 0 else values["gamma"] + (1 - values["gamma"]) / 2
    return float(np.clip(torque / (share * values["sigma_0"]), -most(-1.0), most(1.0)))


def substeps(values: Mapping[str, float], h: float) -> int:
    """Steps of the free axis per interval: what friction and inertia exchange has to be slow against them."""
    damping = (values["sigma_1"] + values["sigma_2"]) / values["J"]
    stiffness = sqrt(values["sigma_0"] / values["J"])
    return max(1, ceil(h * max(damping, stiffness) / EXPLICIT_STEP_SHARE))


MIN_RECORD_TIME = 3.0  # [s]: in less the drift of a wrong torque hardly shows beside the error of the first speed
SLIDING_TRAVEL_FACTOR = 20.0  # times the way of pre-sliding (bristles and engaging zone) that a move must be long
LEAST_GAIN = 0.02  # of the position's rms that must be won
FRICTION_MOVES = 0.2  # of F_C, and
LOAD_MOVES = 1.0  # of F_C: changes of F_C and M_0 beyond which something else is wrong
ROW, ROW_STEP = 12, 0.025  # values of F_C to either side that are tried, and their distance, of F_C
TORQUE_GROWS = 0.1  # of the torque residual's rms: what the position may cost
DRAWS = 24  # how often the torque residuals of stretches are turned
LOAD_CHANGE = "change of M_0 over record"  # with its number, among the values
SINES = "sines; the open loop needs general motion"
NO_DRIFT = "its interval includes 0: the load is taken as constant"


def balance_loads(
    records: Sequence[Record], law: FrictionLaw, estimates: Mapping[str, Estimate], *, hold: Collection[str] = ()
) -> Balance:
    """F_C and M_0 from the position in open loop.

    Args:
        records: of general motion, motor side. Those with sines, of small moves, without a position or shorter than
            `MIN_RECORD_TIME` are left out.
        law: the friction model as it moves an axis, and as a torque (for the residual of the torque).
        estimates: every friction parameter, M_0, J, and the delay of the torque (0 where it is missing). The recorded
            torque is that of `delay` earlier; one that is held over the coming interval h has the delay -h/2.
        hold: names that keep their value: the user's word. An estimate that is not `estimated` keeps its own, except
            for F_S, which goes with F_C.

    Raises InputError: an estimate is missing, or a parameter that the law refuses.
    """
    missing = [name for name in (*law.names, "M_0", "J") if name not in estimates]
    if missing:
        raise InputError(f"open loop: no value of {', '.join(missing)}")
    values = {name: estimate.value for name, estimate in estimates.items()}
    values.setdefault("delay", 0.0)

    def refused(reason: str, **seen: Any) -> Balance:
        return Balance(estimates, False, reason, tuple(axis.record.name for axis in axes), **seen)

    axes: list[OpenLoop] = []
    free = [name for name in ("M_0", "F_C") if name not in hold and estimates[name].status == "estimated"]
    whys = []
    directions: set[float] = set()
    for record in records:
        model = None if record.angle is None else _model(record, law)
        why = _explain_unfit_record(record, model, values)
        if why:
            whys.append((record.name, why))
        elif model is not None:
            axes.append(OpenLoop(record, model, f"{LOAD_CHANGE} {len(axes)}"))
            directions |= _directions(model)
    if not axes:
        sines = bool(whys) and all(why == SINES for _, why in whys)
        return refused("; ".join(f"{name}: {why}" for name, why in whys) or "no records", applies=not sines)
    if not free:
        return refused("neither F_C nor M_0 is free")
    if len(free) > 1 and len(directions) < 2:
        return refused("motion in one direction only does not separate load from friction")

    drifting = [axis.change for axis in axes] if "M_0" in free else []
    values |= dict.fromkeys((axis.change for axis in axes), 0.0)

    def moved(result: Mapping[str, float]) -> dict[str, float]:
        new = values | dict(result)
        if "F_S" not in hold:
            # max: where both are one, their sums with a difference need not be.
            new["F_S"] = max(new["F_S"] + (new["F_C"] - values["F_C"]), new["F_C"])
        return new

    def residuals(values: Mapping[str, float]) -> Array:
        return np.concatenate([axis.residual(moved(values)) for axis in axes])

    if any(substeps(values, axis.record.interval) > MOST_STEPS for axis in axes):
        return refused("sigma_0 or sigma_1 is so large that the axis cannot be moved by the recorded torque")
    try:
        for axis in axes:
            axis.residual(values)  # here the law refuses what it does
    except SimulationError as error:
        return refused(f"the axis cannot be moved by the recorded torque: {error}")
    try:
        # Before and after differ by F_C and M_0 alone: the drift of the load is nothing that was known before.
        if drifting:
            values |= _Solver(residuals, values).best(drifting, tolerance=1e-4).mapping()
        start = [axis.residual(values) for axis in axes]
        results = _Solver(residuals, values, "F_S" in hold).solve([*free, *drifting])
        loads = _load_rates(residuals, axes, values, moved(results), [*free, *drifting]) if drifting else {}
        if drifting and not any(map(_is_significant, loads.values())):
            # What a record does not determine predicts nothing: the load is constant then.
            values |= dict.fromkeys(drifting, 0.0)
            start = [axis.residual(values) for axis in axes]
            results = _Solver(residuals, values, "F_S" in hold).solve(free)
            loads = {name: replace(rate, status="undetermined", reason=NO_DRIFT) for name, rate in loads.items()}
    except (SimulationError, InputError) as error:
        return refused(f"no least squares in open loop: {error}")
    new = moved(results)
    end = [axis.residual(new) for axis in axes]
    position = _rms(np.concatenate(start)), _rms(np.concatenate(end))
    torque = _torque_rms(axes, values), _torque_rms(axes, new)
    changes = {name: (values[name], new[name]) for name in ("F_C", "F_S", "M_0")}
    drifts = tuple(axis.drift(*both) for axis, *both in zip(axes, start, end, strict=True))
    why = _explain_rejection(values, new, position, torque)
    if why:
        return refused(why, position=position, torque=torque, changes=changes, drifts=drifts, load_rates=loads)
    changed = {
        name: _replace_value(estimates[name], after) for name, (before, after) in changes.items() if after != before
    }
    names = tuple(axis.record.name for axis in axes)
    return Balance({**estimates, **changed}, True, "", names, position, torque, changes, drifts, loads)


def _is_significant(rate: Estimate) -> bool:
    """Whether the interval of a drift leaves out 0."""
    low, high = rate.interval
    return low > 0 or high < 0


def _load_rates(
    residuals: Model,
    axes: Sequence[OpenLoop],
    old: Mapping[str, float],
    new: Mapping[str, float],
    free: Sequence[str],
) -> dict[str, Estimate]:
    """Record -> dM_0/dt [N.m/s], as the position has it. residuals: over `free`, of the position of all axes.

    The interval is that of the least squares, linearised, under a torque that is off as much as it is, and for as long
    at a time. By as much as the torque's residual says another rate it is wider: two criteria disagree by that.
    """
    step = 1e-4 * new["F_C"]
    values = {name: new[name] for name in free}
    undisturbed = residuals(values)
    slopes = np.column_stack([(residuals({**values, n: values[n] + step}) - undisturbed) / step for n in free])
    rng = np.random.default_rng(0)
    disturbed = [np.concatenate([axis.disturbed(new, rng) for axis in axes]) for _ in range(DRAWS)]
    moved = np.linalg.lstsq(slopes, np.column_stack(disturbed) - undisturbed[:, None], rcond=None)[0]
    scatter = dict(zip(free, np.sqrt(np.mean(moved**2, axis=1)).tolist(), strict=True))

    def rate(axis: OpenLoop) -> Estimate:
        change = new[axis.change]
        sigma = float(np.hypot(scatter[axis.change], change - axis.slope(old))) / axis.duration
        return Estimate("dM_0/dt", change / axis.duration, "N.m/s", "rate at which the constant load drifts", sigma)

    return {axis.record.name: rate(axis) for axis in axes}


def _model(record: Record, law: FrictionLaw) -> RecordTorque | None:
    try:
        return RecordTorque(record, law)
    except InputError:  # too short for a motion
        return None


def _explain_unfit_record(record: Record, model: RecordTorque | None, values: Mapping[str, float]) -> str:
    """Why a record determines nothing in open loop."""
    duration = record.interval * (len(record) - 1)
    if record.angle is None:
        return "no position"
    if record.clipped is not None and np.any(record.clipped):
        return "its torque is cut off at a limit"
    if duration < MIN_RECORD_TIME or model is None:
        return f"{duration:.3g} s are too short; at least {MIN_RECORD_TIME:g} s are needed"
    if not model.parts:
        return "nothing moves"
    if any(part.kind == "sine" for part in model.parts):
        return SINES
    way = SLIDING_TRAVEL_FACTOR * max(deflection(values), values.get("W", 0.0))
    if max(2 * part.amplitude for part in model.parts) < way:
        return f"no move is longer than {SLIDING_TRAVEL_FACTOR:g} times the way of pre-sliding"
    return ""


def _directions(model: RecordTorque) -> set[float]:
    """Signs of the speeds that count."""
    speed = model.motion.coarse()
    return {float(side) for side in np.unique(np.sign(speed[np.abs(speed) > 0.1 * float(np.max(np.abs(speed)))]))}


class _Solver:
    """The least squares from `values`; below: F_C stays below F_S, which is held."""

    def __init__(self, residuals: Model, values: Mapping[str, float], below: bool = False) -> None:
        self._residuals, self._values, self._below = residuals, dict(values), below

    def best(
        self,
        names: Sequence[str],
        started: Mapping[str, float] | None = None,
        kept: Mapping[str, float] | None = None,
        *,
        tolerance: float,
    ) -> Fit:
        """Over `names`, from `started` (default: the values); `kept` replaces values that are not free."""
        values, fixed = self._values, kept or {}
        begin = started or values
        return fit(
            lambda values: self._residuals({**fixed, **values}),
            [Parameter(n, begin[n], *_parameter_bounds(n, values, self._below), scale=values["F_C"]) for n in names],
            normalised=False,
            difference=1e-4,  # small against what a change is worth, large against rounding over the record
            tolerance=tolerance,
            limit=30,
        )

    def solve(self, free: Sequence[str]) -> dict[str, float]:
        """Whether the model still sticks or already slips where the record all but stops changes the drift from there
        on: there are several minima over F_C. Therefore the load is fitted along a row of F_C first."""
        values = self._values
        begin = {name: values[name] for name in free}
        load = [name for name in free if name != "F_C"]
        if "F_C" in free:
            result: list[tuple[float, dict[str, float]]] = []
            low, high = _parameter_bounds("F_C", values, self._below)
            for side in (1, -1):
                now = dict(begin)
                for k in range(ROW + 1):
                    now["F_C"] = min(max((1 + side * k * ROW_STEP) * values["F_C"], low), high)
                    if load:
                        now |= self.best(load, now, {"F_C": now["F_C"]}, tolerance=1e-4).mapping()
                    result.append((_rms(self._residuals(now)), dict(now)))
            begin = min(result, key=lambda entry: entry[0])[1]
        return self.best(free, begin, tolerance=1e-8).mapping()


def _parameter_bounds(name: str, values: Mapping[str, float], below_static: bool) -> tuple[float, float]:
    """Bounds: enough to see a change that is too large."""
    F_C = values["F_C"]
    if name != "F_C":  # M_0, and what it changes by
        return values[name] - 2 * LOAD_MOVES * F_C, values[name] + 2 * LOAD_MOVES * F_C
    upper = (1 + 2 * FRICTION_MOVES) * F_C
    return (1 - 2 * FRICTION_MOVES) * F_C, max(min(upper, values["F_S"]), F_C * (1 + 1e-9)) if below_static else upper


def _torque_rms(axes: Sequence[OpenLoop], values: Mapping[str, float]) -> float:
    """Of the torque residual over all records [N.m]."""
    return _rms(np.concatenate([axis.torque_residual(values) for axis in axes]))


def _explain_rejection(
    old: Mapping[str, float], new: Mapping[str, float], position: tuple[float, float], torque: tuple[float, float]
) -> str:
    """Why a result is not taken; empty where it is."""
    friction, load = new["F_C"] / old["F_C"] - 1, (new["M_0"] - old["M_0"]) / old["F_C"]
    if not all(isfinite(value) for value in (*position, *torque)):
        return "the position in open loop is no number"
    if not position[1] < (1 - LEAST_GAIN) * position[0]:
        return f"the position in open loop does not improve ({position[0]:.4g} rad to {position[1]:.4g} rad rms)"
    if abs(friction) > FRICTION_MOVES:
        return f"F_C would change by {100 * friction:+.0f} %; more than {100 * FRICTION_MOVES:.0f} % is not believed"
    if abs(load) > LOAD_MOVES:
        return f"M_0 would change by {load:+.2g} times F_C; more than {LOAD_MOVES:g} is not believed"
    growth = torque[1] / torque[0] - 1 if torque[0] > 0 else inf
    if growth > TORQUE_GROWS:
        return f"the torque's residual would grow by {100 * growth:.0f} %; allowed are {100 * TORQUE_GROWS:.0f} %"
    return ""


def _replace_value(before: Estimate, value: float) -> Estimate:
    least = abs(value - before.value) / NORMAL_95
    return replace(before, value=value, sigma=max(before.sigma, least) if isfinite(before.sigma) else before.sigma)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
