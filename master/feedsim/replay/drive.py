"""The drive of an axis out of a record: its position loop by regression, the rest by output error in closed loop.

What the control shows of its position loop is regression, exact to the last digits of the record
(identify/position_loop.py).
What the torque tells, speed controller, inertia, friction, and how far the feedforward lies beside neutral, is fitted
so that the units, on the record's setpoints, give its position and its torque:

    residuals = ((x_a - x_a,recorded)/s_x, (M_a(t - delay) - M_a,recorded)/s_M)     rows in which the axis moves

s_x and s_M are what is left, so that both channels have their weight of themselves. Parts of the friction law that an
axis may do without are added only where the record itself asks for them: fitted to three quarters of its motion, they
must predict the fourth one better, and so with kinds of motion (cross-validation). Intervals are those of residuals
that hang together over stretches of time, as errors of a model do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import hypot, inf, log, nan
from pathlib import Path
from typing import TypeVar

import numpy as np

from feedsim import variables
from feedsim.errors import InputError
from feedsim.identify.parameters import estimate
from feedsim.identify.position_loop import SpeedSetpoint, Taps, rms, setpoint_delay, speed_setpoint
from feedsim.identify.record import Record
from feedsim.identify.result import NORMAL_95, Estimate
from feedsim.replay.closed_loop import AxisRecord, Replay
from feedsim.replay.elastic import KEYS, MOST_MODES, ElasticMode, begin_mode, modes_of, resonance
from feedsim.replay.start import Begin
from feedsim.replay.tuning import BOUNDS, FINAL, ROUGH, Problem, Rows, Tuned, together
from feedsim.scenario import Machine
from feedsim.structure import checked_modes
from feedsim.trace.trace import Array

_CONTROLLER = variables.parameters("controller")
Told = TypeVar("Told")
Progress = Callable[[str, int, int], None]

# Parts of the friction law that an axis may do without, in the order in which they are tried.
BLOCKS: Mapping[str, tuple[str, ...]] = {
    "logarithmic rise": ("F_log",),
    "engaging zone": ("W", "gamma"),
    "Stribeck effect": ("excess", "v_s"),
    "asymmetry": ("asymmetry",),
}
# Of the way per row, of the top speed: a regression that leaves more is a start, not an answer.
EXACT_DELAY, EXACT_GAIN = 1e-5, 1e-6
LEAST_ROWS = 50  # in which the axis moves
MOST_TURNS = 8  # of fits and weights in turns; two or three do where the start is near
SETTLED = 0.01  # change of a weight that moves no value by what its interval shows
FOLDS = 4
FAST = 0.1  # of the top speed: what is faster is another kind of motion
BETTER = 2.0  # of the logarithm of the likelihood: what predicts hardly better is not worth having
BLOCK = 0.05  # [s]: residuals further apart than that are taken to be independent
VAGUE = 0.5  # relative half width of an interval beyond which a value is not determined
APART = 2.0  # of the logarithm of the likelihood: below it two cycles are as likely as one another
POOR = 0.3  # share of the torque, or of the lag, that a fit may leave
EXACT = 1e-5  # of the travel: a position that a fit leaves within it is met, however small the lag
ONE_WAY = 0.15  # share of the mean torque to which the constant load has to be known where the axis moves one way
SHAPE = 0.25  # standard deviation of the friction, of itself, where only its usual shape separates it from the load
HIDDEN = 0.8  # share of the usual deviation that is left: the record has not told it


@dataclass(frozen=True, eq=False)
class DriveFound:
    """The drive of an axis, and what is left.

    Attributes:
        estimates: name -> value with interval: K_v, k_ffw, T_dyn, T_sym, K_p, T_n, J, M_0, friction, delay.
        taps, speed: the position loop by regression; None where the record does not hold it.
        machine: with these values. parts: what the friction has besides LuGre and viscous friction, and what
            cross-validation says of every part: name -> gain of the logarithm of the likelihood; where it predicts
            times or kinds of motion worse, that loss.
        position, torque: rms of what is left [m], [N.m]; without a recorded torque nan.
        predicted: the same, of every quarter of the motion by a fit to the other three.
        other_cycles: cycle of the position loop [s] -> by how much the record is likelier with it than with the
            machine's (logarithm of the likelihood).
        runs: of the units.
        modes: elastic ones. modes_predicted: number of modes -> rms of the position [m] of every quarter of the motion,
            by a fit to the other three.
    """

    axis: str
    estimates: Mapping[str, Estimate]
    taps: Taps | None
    speed: SpeedSetpoint | None
    machine: Machine
    parts: Mapping[str, float]
    chosen: tuple[str, ...]
    position: float
    torque: float
    predicted: tuple[float, float]
    other_cycles: Mapping[float, float]
    runs: int
    modes: tuple[ElasticMode, ...] = ()
    modes_predicted: Mapping[int, float] = field(default_factory=dict)


def identify_drive(
    machine: Machine,
    each: AxisRecord,
    records: Sequence[Record],
    *,
    structure_known: bool,
    begin: Begin | None = None,
    other_cycle: float | None = None,
    modes: int | None = 0,
    progress: Progress = lambda what, done, total: None,
    fmus: Path | None = None,
) -> DriveFound:
    """Identify the drive of `each.axis`, with inertia (unless the structure is known) and friction.

    Args:
        machine: begins with its values; its cycles, structure and what is not identified stay.
        each: the stretch that is fitted. records: all stretches, for the regression.
        structure_known: the inertia is that of the machine's modes, and the friction has the parts that it has there.
        begin: what the record alone says, in place of the machine's values: a fit begins at each of its starts, and
            the best goes on.
        other_cycle: of the position loop [s], in place of the machine's, that what was found is held against.
        modes: elastic ones of a rigid axis; None: as many as the record asks for.

    Raises:
        InputError: a record without motion; no start that the units can run; a result that leaves a large part of the
            record.
    """
    taps = _told(setpoint_delay, records)
    speed = _told(speed_setpoint, records)
    # Of all records, as the regressions are.
    top = max(float(np.max(np.abs(np.diff(one.angle)))) / one.interval for one in records if one.angle is not None)
    exact_delay = taps is not None and taps.rms <= EXACT_DELAY * top * each.record.interval
    exact_gain = speed is not None and speed.rms <= EXACT_GAIN * top
    J = checked_modes(machine).J_tot(each.axis)
    total = taps.delay if taps is not None and exact_delay else None
    candidates = [start_of(machine, each.axis) | dict(start) for start in (begin.starts if begin is not None else [{}])]
    for values in candidates:
        if speed is not None and speed.K_v > 0:
            values["K_v"] = speed.K_v
        if (weight := feedforward_of(records)) is not None:
            values["k_ffw"] = weight
        if taps is not None:
            values["T_sym"] = min(values["T_sym"], taps.delay)
            values["T_dyn"] = taps.delay - values["T_sym"]
    rows = np.flatnonzero(each.moving)
    if len(rows) < LEAST_ROWS:
        raise InputError(
            f"{each.record.name}: {len(rows)} rows in which axis {each.axis} moves; at least {LEAST_ROWS} are needed"
        )
    problem = Problem(
        machine, each, Replay(machine, {each.axis: each}, fmus=fmus), candidates[0], total, J,
        {"position": 1e-6, "torque": 0.05 * rms(each.record.torque) + 1e-9 if each.record.driven else 1.0}, rows,
    )  # fmt: skip
    driven = each.record.driven
    free = ["K_p", "K_i", "T_sym", "k_ffw"]
    # Without a torque friction and load are the machine's: what they do to the position, the speed controller may, too.
    free += ["M_0", "delay", "F_C", "sigma_0", "sigma_1", "sigma_2"] if driven else []
    free += [] if structure_known else ["J"]
    free += [] if exact_gain else ["K_v"]
    free += [] if total is not None else ["T_dyn"]
    drive = machine.shipped_drive(each.axis, "the identification of a drive")
    free += ["omega_0", "D"] if drive.reference_model else []
    progress("first fit", 0, 2 + len(BLOCKS))
    parts: dict[str, float] = {}
    chosen: tuple[str, ...] = ()
    if structure_known:
        own = {name for name, block in BLOCKS.items() if driven and _has(problem.start, block)}
        chosen = tuple(name for name in BLOCKS if name in own)
        free += [name for part in chosen for name in BLOCKS[part]]
        found = _first(problem, free)
    else:
        found = _best_start(problem, free, candidates)
        chosen, parts, found = _parts(problem, found, progress)
    elastic: Mapping[int, float] = {}
    if modes != 0 and not structure_known:
        progress("elastic modes", 1 + len(BLOCKS), 2 + len(BLOCKS))
        found, elastic = _elastic(problem, found, modes)
    progress("last fit", 1 + len(BLOCKS), 2 + len(BLOCKS))
    for _ in range(MOST_TURNS):
        before = problem.weights
        problem.weigh(found)
        found = problem.fitted(found.names, found.values, found, FINAL)
        if all(abs(problem.weights[channel] / weight - 1) < SETTLED for channel, weight in before.items()):
            break
    _refuse_poor(each, found)
    found = problem.exact(found, central=True)
    unseen = _left_out(problem, found, np.array_split(np.arange(len(rows)), FOLDS))
    predicted = unseen[0] * problem.weights["position"], unseen[1] * problem.weights["torque"]
    if not each.record.driven:
        predicted = predicted[0], nan
    estimates = _estimates(
        problem, found, unseen, taps if exact_delay else None, speed if exact_gain else None, structure_known
    )
    if begin is not None and begin.one_way:
        estimates = _one_way(each, estimates, begin.one_way)
    likelier = {} if other_cycle is None else {other_cycle: _likelier(problem, found, other_cycle)}
    return DriveFound(
        each.axis, estimates, taps, speed, problem.machine_of(found.values), parts, chosen,
        rms(found.position), rms(found.torque) if each.record.driven else nan, predicted, likelier, problem.runs,
        _modes(problem, found, unseen), elastic,
    )  # fmt: skip


def _told(of: Callable[[Sequence[Record]], Told], records: Sequence[Record]) -> Told | None:
    try:
        return of(records)
    except InputError:
        return None


def feedforward_of(records: Sequence[Record]) -> float | None:
    """Weight of the speed feedforward to begin with: n_s = K_v x_e + k_ffw n_ffw + n_0 by least squares, where the
    record has all of these. Samples of the setpoint in place of x_e would be a feedforward of their own."""
    whole = [
        (each.speed_setpoint, each.deviation, each.feedforward)
        for each in records
        if each.speed_setpoint is not None and each.deviation is not None and each.feedforward is not None
    ]
    if not whole:
        return None
    n_s, x_e, n_ffw = (np.concatenate(signals) for signals in zip(*whole, strict=True))
    columns = np.column_stack([x_e, n_ffw, np.ones_like(n_s)])
    scale = np.linalg.norm(columns, axis=0) + 1e-300
    found, _, rank, _ = np.linalg.lstsq(columns / scale, n_s, rcond=1e-9)
    weight = float(found[1] / scale[1])
    low, high = BOUNDS["k_ffw"]
    return min(max(weight, low), high) if rank == columns.shape[1] else None


def start_of(machine: Machine, axis: str) -> dict[str, float]:
    """What the machine's axis has, as the parameters of a fit."""
    drive = machine.shipped_drive(axis, "the identification of a drive")
    friction = machine.shipped_friction(axis, "the identification of a drive")
    values = {name: float(getattr(friction, name)) for name in
              ("F_C", "sigma_0", "sigma_1", "sigma_2", "v_s", "F_log", "W", "gamma", "asymmetry")}  # fmt: skip
    T_n = drive.T_n if drive.T_n is not None else 1.0
    return values | {
        "excess": float(friction.F_S) / values["F_C"] - 1.0, "M_0": machine.axes[axis].M_0,
        "K_v": drive.K_v, "k_ffw": drive.k_ffw, "T_sym": drive.T_sym, "T_dyn": drive.T_dyn, "delay": 0.0,
        "K_p": drive.K_p, "K_i": drive.K_p / T_n, "J": checked_modes(machine).J_tot(axis),
        "omega_0": drive.omega_0 or 1.0, "D": drive.D or 1.0,
    }  # fmt: skip


def _has(values: Mapping[str, float], block: Sequence[str]) -> bool:
    """Whether the friction has the part that a block is of."""
    return values[block[0]] != 0


def _likelier(problem: Problem, found: Tuned, T_pos: float) -> float:
    """By how much the whole motion is likelier (logarithm) with another cycle of the position loop."""

    def likely(found: Tuned) -> float:
        return -_independent(problem, len(problem.rows)) * (log(rms(found.position)) + log(rms(found.torque)))

    machine = problem.machine
    cycles = machine.cycles.model_copy(update={"position": T_pos})
    problem.machine = machine.model_copy(update={"cycles": cycles})
    try:
        # Cycles are told apart by more than such a fit is off its least.
        return likely(problem.fitted(found.names, found.values, found, ROUGH)) - likely(found)
    finally:
        problem.machine = machine


def _independent(problem: Problem, count: int) -> float:
    """How many of `count` rows say something of their own: neighbouring ones say the same."""
    return count * problem.each.record.interval / BLOCK


def _first(problem: Problem, free: Sequence[str]) -> Tuned:
    """A first fit, whose weights are those of what is left."""
    found = problem.fitted(free, {}, promises=ROUGH)
    problem.weigh(found)
    found = problem.fitted(free, found.values, found)
    problem.weigh(found)
    return found


def _best_start(problem: Problem, free: Sequence[str], candidates: Sequence[dict[str, float]]) -> Tuned:
    """The likeliest of first fits from several starts; the problem has that start, and its weights, then.

    Raises InputError: the units can run none of them.
    """
    weights = problem.weights
    best: tuple[float, dict[str, float], dict[str, float], Tuned] | None = None
    failed: InputError | None = None
    for start in candidates:
        problem.start, problem.weights = start, dict(weights)
        try:
            found = _first(problem, free)
        except InputError as error:
            failed = error
            continue
        # Weights are of each fit's own residuals: fits are compared by those, and by how far the start is away.
        left = _independent(problem, len(problem.rows)) * (log(rms(found.position)) + log(rms(found.torque)))
        left += 0.5 * float(np.sum(found.residuals[2 * len(problem.rows) :] ** 2))
        if best is None or left < best[0]:
            best = left, start, problem.weights, found
    if best is None:
        assert failed is not None
        raise failed
    _, problem.start, problem.weights, found = best
    return found


def _refuse_poor(each: AxisRecord, found: Tuned) -> None:
    """Raises InputError: the fit leaves so much that its parameters are those of no axis."""
    signal = {
        "torque": (rms(found.torque), rms(each.record.torque[each.moving]), 1.0, "N.m", "torque"),
        "position": (rms(found.position), rms((each.setpoint - each.position)[each.moving]), 1e6, "um",
                     "distance of the position behind its setpoint"),
    }  # fmt: skip
    exact = rms(found.position) <= EXACT * float(np.ptp(each.position[each.moving]))  # the setpoint may be the encoder
    for channel, (left, whole, scale, unit, meaning) in signal.items():
        judged = each.record.driven if channel == "torque" else not exact
        if judged and left > POOR * whole:
            raise InputError(
                f"{each.record.name}, axis {each.axis}: the best fit leaves {scale * left:.3g} {unit} rms of a "
                f"{meaning} of {scale * whole:.3g} {unit} rms while the axis moves; at most {100 * POOR:.0f} % are "
                "allowed. No drive is identified: check signs, units and pitch, give a longer window with motion in "
                "both directions, or a machine to begin with (--machine)"
            )


def _elastic(problem: Problem, found: Tuned, count: int | None) -> tuple[Tuned, Mapping[int, float]]:
    """A fit with elastic modes, and the position [m] that it predicts of quarters of the motion with how many.

    One mode after the other: where it is, regression says of what the units leave. It stays where the units, fitted to
    three quarters, predict the fourth one better with it, or where the number is given.
    """
    folds = np.array_split(np.arange(len(problem.rows)), FOLDS)
    found = problem.exact(found)
    predicted = {0: _left_out(problem, found, folds)[0] * problem.weights["position"]}
    for k in range(1, (MOST_MODES if count is None else count) + 1):
        machine, scale = problem.tuned(found.values)
        simulated = problem.replay.follow(machine, ("x_a",), problem.per_row, scale)[problem.each.axis]["x_a"]
        K_v = (problem.start | dict(found.values))["K_v"]
        one = resonance(problem.each, simulated, problem.per_row, K_v)
        if one is None:
            break
        before, start = found, dict(problem.start)
        best: tuple[float, Tuned, dict[str, float]] | None = None
        for sign in (1.0, -1.0):
            first = begin_mode(k, one, sign)
            problem.start = start | first
            with suppress(InputError):  # the units cannot run it
                fit = problem.fitted([*before.names, *first], {**before.values, **first}, before)
                cost = float(np.sum(fit.residuals**2))
                if best is None or cost < best[0]:
                    best = cost, fit, problem.start
        problem.start = start
        if best is None:
            break
        problem.start = best[2]
        fit = problem.exact(best[1])
        gain = _likelihood(problem, fit, folds) - _likelihood(problem, before, folds)
        predicted[k] = _left_out(problem, fit, folds)[0] * problem.weights["position"]
        if count is None and not gain > BETTER:
            problem.start = start
            break
        found = fit
        problem.weigh(found)
        found = problem.exact(problem.fitted(found.names, found.values, found))
    return found, predicted


def _modes(problem: Problem, found: Tuned, unseen: tuple[float, float]) -> tuple[ElasticMode, ...]:
    """The elastic modes of a fit, with standard deviations."""
    own = modes_of(found.values)
    if not own:
        return ()
    spread = dict(zip(found.names, map(float, np.sqrt(np.diag(_covariance(problem, found, unseen)))), strict=True))
    named = [[f"{key}_{k}" for key in KEYS] for k in range(1, len(own) + 1)]
    told = [replace(each, sigma=tuple(spread[name] for name in names)) for each, names in zip(own, named, strict=True)]
    return tuple(sorted(told, key=lambda each: each.frequency))


def _one_way(each: AxisRecord, estimates: Mapping[str, Estimate], told: str) -> dict[str, Estimate]:
    """Estimates of which constant load and Coulomb friction are known as their sum.

    What separates them then is the usual shape of friction, no measurement. Where the torque is mostly that sum and
    they are hardly separated, no machine follows from the record.

    Raises InputError: so it is.
    """
    further = SHAPE * estimates["F_C"].value
    estimates = {
        name: replace(one, sigma=hypot(one.sigma, further)) if name in ("M_0", "F_C") else one
        for name, one in estimates.items()
    }
    torque = each.record.torque[each.moving]
    mean, half = abs(float(np.mean(torque))), NORMAL_95 * estimates["M_0"].sigma
    if mean > float(np.std(torque)) and half > ONE_WAY * mean:
        raise InputError(
            f"{each.record.name}, axis {each.axis}: {told}; M_0 by itself is known to +-{half:.2g} N.m only, and at "
            f"most +-{ONE_WAY * mean:.2g} N.m are allowed. No drive is identified: give a window with motion in both "
            "directions, or a machine whose friction and load are known (--machine)"
        )
    undetermined = {name: replace(estimates[name], status="undetermined", reason=told) for name in ("M_0", "F_C")}
    return {**estimates, **undetermined}


def _parts(problem: Problem, found: Tuned, progress: Progress) -> tuple[tuple[str, ...], dict[str, float], Tuned]:
    """Parts of the friction law that the record asks for: chosen, the gain of each, and a fit with them."""
    gains: dict[str, float] = {}
    chosen: list[str] = []
    while len(chosen) < len(BLOCKS):
        progress("cross-validation", 1 + len(chosen), 2 + len(BLOCKS))
        # As near to its end as what it is compared with.
        found = problem.exact(problem.fitted(found.names, found.values, found))
        score = _predicted(problem, found)
        tried = {}
        for part, block in BLOCKS.items():
            if part in chosen:
                continue
            begin = {**found.values, **{name: _begin(problem, name) for name in block}}
            tried[part] = problem.fitted([*found.names, *block], begin, found)
            if _at_end(problem, tried[part], block):
                gains[part] = -inf
                continue
            tried[part] = problem.exact(tried[part])
            by = _predicted(problem, tried[part]) - score
            # Both partitions ask for it: what one gains at the other's cost is no law.
            gains[part] = float(np.sum(by) if np.all(by > 0) else np.min(by))
        gain, part = max((gains[part], part) for part in tried)
        if not gain >= BETTER:
            break
        chosen.append(part)
        found = tried[part]
        problem.weigh(found)
    return tuple(chosen), gains, found


def _begin(problem: Problem, name: str) -> float:
    F_C = problem.start["F_C"]
    return {"F_log": 0.1 * F_C, "gamma": 0.5, "excess": 0.1, "asymmetry": 0.0}.get(name, problem.start[name])


def _at_end(problem: Problem, found: Tuned, block: Sequence[str]) -> bool:
    """Whether a part sits at a bound: what has no end there is not told."""
    return any(problem.at_end(name, found.values[name]) for name in block)


def _predicted(problem: Problem, found: Tuned) -> Array:
    """(2,) logarithm of the likelihood of every part of the motion, predicted from the others.

    Parts are stretches of time, and then kinds of motion: either direction, slow and fast. What predicts only motion
    that it has seen elsewhere is no law. The fit to the others is a Gauss-Newton step away from the one to all.
    """
    speed = problem.each.speed[problem.rows]
    kinds = 2 * (speed > 0) + (np.abs(speed) > FAST * np.max(np.abs(speed)))
    every = np.arange(len(speed))
    partitions = np.array_split(every, FOLDS), [every[kinds == kind] for kind in np.unique(kinds)]
    return np.array([_likelihood(problem, found, folds) for folds in partitions if len(folds) > 1])


def _likelihood(problem: Problem, found: Tuned, folds: Sequence[Rows]) -> float:
    """Of the folds, each predicted from the others."""
    count = sum(map(len, folds))
    position, torque = _left_out(problem, found, folds)
    return -_independent(problem, count) * (log(position) + log(torque))


def _left_out(problem: Problem, found: Tuned, folds: Sequence[Rows]) -> tuple[float, float]:
    """Rms of position and torque, in their weights, where each fold is predicted from the others."""
    count = sum(map(len, folds))
    J, r = found.jacobian, found.residuals
    prior = np.arange(2 * count, len(r))
    left = np.empty(2 * count)
    for fold in folds:
        out = np.concatenate([fold, fold + count])
        others = np.concatenate([np.setdiff1d(np.arange(2 * count), out), prior])
        step = np.linalg.lstsq(J[others], -r[others], rcond=None)[0]
        left[out] = r[out] + J[out] @ step
    return rms(left[:count]), rms(left[count:])


def _estimates(
    problem: Problem,
    found: Tuned,
    unseen: tuple[float, float],
    taps: Taps | None,
    speed: SpeedSetpoint | None,
    known: bool,
) -> dict[str, Estimate]:
    """In the parameters of drive and friction, with intervals."""
    values = problem.start | dict(found.values)
    covariance = _covariance(problem, found, unseen)
    spread = dict(zip(found.names, map(float, np.sqrt(np.diag(covariance))), strict=True))
    told: dict[str, Estimate] = {}

    def put(name: str, value: float, sigma: float, by: str) -> None:
        told[name] = _judged(name, value, sigma, spread.get(by, nan) / problem.spread(by, values))

    for name in found.names:
        if name not in ("K_i", "excess", "K_v", "T_dyn") and not name.startswith("mode_"):
            put(name, values[name], spread[name], name)
    ratio = np.array([(n == "K_p") / values["K_p"] - (n == "K_i") / values["K_i"] for n in found.names])
    T_n = values["K_p"] / values["K_i"]
    put("T_n", T_n, T_n * float(np.sqrt(ratio @ covariance @ ratio)), "K_p")
    if speed is not None:
        told["K_v"] = _judged("K_v", values["K_v"], speed.sigma[0], 0.0)
    else:
        put("K_v", values["K_v"], spread["K_v"], "K_v")
        if not known:
            told["K_v"] = replace(told["K_v"], status="undetermined", reason=ON_THE_MODEL)
    if taps is not None:
        told["T_dyn"] = _judged("T_dyn", problem.T_dyn(values), hypot(spread["T_sym"], taps.sigma), 0.0)
    else:
        put("T_dyn", values["T_dyn"], spread["T_dyn"], "T_dyn")
        if not known:
            told["T_dyn"] = replace(told["T_dyn"], status="undetermined", reason=ON_THE_MODEL)
    if "excess" in found.names:
        rise = np.array([(n == "F_C") * (1 + values["excess"]) + (n == "excess") * values["F_C"] for n in found.names])
        put("F_S", values["F_C"] * (1 + values["excess"]), float(np.sqrt(rise @ covariance @ rise)), "excess")
    if known:
        told["J"] = replace(estimate("J", values["J"]), status="given", reason="of the machine's modes")
    return {name: told[name] for name in ORDER if name in told}


ON_THE_MODEL = (
    "without the control's own speed setpoint or following error it rests on an axis that is taken to be rigid"
)
ORDER = ("K_v", "k_ffw", "T_dyn", "T_sym", "K_p", "T_n", "omega_0", "D", "J", "M_0", "F_C", "F_S", "v_s", "F_log",
         "sigma_0", "sigma_1", "sigma_2", "W", "gamma", "asymmetry", "delay")  # fmt: skip


def _judged(name: str, value: float, sigma: float, left: float) -> Estimate:
    """An estimate that says what it is worth. left: the deviation over the usual one."""
    if name in _CONTROLLER:
        row = _CONTROLLER[name]
        found = Estimate(name, value, row.unit, row.short, sigma)
    else:
        found = estimate(name, value, sigma)
    if left > HIDDEN:
        return replace(found, status="undetermined", reason="the record hardly depends on it")
    relative = name not in ("k_ffw", "T_sym", "T_dyn", "M_0", "asymmetry", "delay")
    if relative and NORMAL_95 * sigma > VAGUE * abs(value):
        return replace(
            found, status="undetermined", reason=f"told to {100 * NORMAL_95 * sigma / abs(value):.0f} % only"
        )
    return found


def _covariance(problem: Problem, found: Tuned, unseen: tuple[float, float]) -> Array:
    """Covariance (P, P), where residuals hang together as long as they do: every channel counts as many times less.

    unseen: rms of position and torque that the others do not predict, in their weights. Where a model is not quite that
    of the axis, a fit to little motion leaves too little, and what it leaves of motion it has not seen tells the truth.
    """
    scale = np.array([problem.spread(name, found.values) for name in found.names])
    J, r, count = found.jacobian, found.residuals, len(problem.rows)
    channels = slice(0, count), slice(count, 2 * count)
    prior = J[2 * count :].T @ J[2 * count :]
    parts = [
        (J[rows].T @ J[rows], together(r[rows]), max(float(np.mean(r[rows] ** 2)), left**2))
        for rows, left in zip(channels, unseen, strict=True)
    ]
    whole = np.linalg.pinv(sum((part for part, _, _ in parts), prior), hermitian=True)
    middle = sum((part * longer * variance for part, longer, variance in parts), prior)
    return np.asarray(whole @ middle @ whole * np.outer(scale, scale))
