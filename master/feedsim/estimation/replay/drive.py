"""The drive of an axis out of a record: its position loop by regression, the rest by output error in closed loop.

The position loop is regression, exact to the last digits of the record (estimation/identify/position_loop.py). Speed
controller, inertia, friction, and how far the feedforward lies beside neutral, follow from the torque. They are fitted
so that the units, on the record's setpoints, give its position and its torque:

    residuals = ((x_a - x_a,recorded)/s_x, (M_a(t - delay) - M_a,recorded)/s_M)     rows in which the axis moves

s_x and s_M are what is left, so that both channels have their weight of themselves. Parts of the friction law that an
axis may do without are added only where the record itself asks for them: fitted to three quarters of its motion, they
must predict the fourth one better, and so with kinds of motion (cross-validation). Intervals are those of residuals
that are correlated over stretches of time, as errors of a model do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from math import inf, log, nan, pi
from typing import TypeVar

import numpy as np

from feedsim.estimation.identify.parameters import EXCESS
from feedsim.estimation.identify.plateaus import white
from feedsim.estimation.identify.position_loop import (
    Constant,
    SpeedSetpoint,
    Taps,
    gain_by_deviation,
    noisy_delay,
    rms,
    setpoint_delay,
    speed_setpoint,
)
from feedsim.estimation.identify.record import Record
from feedsim.estimation.identify.result import Correlation, Estimate
from feedsim.estimation.replay.closed_loop import AxisRecord, FitStart, Replay
from feedsim.estimation.replay.estimates import (
    contradicts_line,
    correlation_of,
    elastic_modes,
    estimates_of,
    one_way,
    refuse_poor,
    widen_for_modes,
    widen_for_rigid_line,
    with_undecided,
)
from feedsim.estimation.replay.machine_files import MOST_MODES, ElasticMode, begin_mode, resonance
from feedsim.estimation.replay.tuning import (
    FINAL_TOLERANCE,
    TABLE,
    DriveFit,
    OtherCycle,
    Problem,
    Rows,
    TriedRival,
    first_weights,
    other_cycle,
    possible_modes,
    with_rivals,
)
from feedsim.files.trace.trace import Array
from feedsim.foundation.arguments import spell_argument
from feedsim.foundation.errors import InputError
from feedsim.scenario import Machine
from feedsim.structure import checked_modes

# --- Which parts a model of an axis has: those with which a fit predicts motion better that it has not seen -----------
# Parts of the friction law and elastic modes are added one after the other, as long as cross-validation supports
# them.


Progress = Callable[[str, int, int], None]

# Parts of the friction law that an axis may do without, in the order in which they are taken: what acts at speed
# carries over to other motion, what acts behind a reversal explains that one alone.
BLOCKS: Mapping[str, tuple[str, ...]] = {
    "logarithmic rise": ("F_log",),
    "engaging zone": ("W", "gamma"),
    "Stribeck effect": (EXCESS, "v_s"),
    "asymmetry": ("asymmetry",),
}
FOLDS = 4
FAST_SPEED_SHARE = 0.1  # of the top speed: what is faster is another kind of motion
MIN_LIKELIHOOD_GAIN = 2.0  # of the logarithm of the likelihood: what predicts hardly better is not worth having
INDEPENDENT_TIME = 0.05  # [s]: residuals further apart than that are taken to be independent


def friction_parts(
    problem: Problem, tuned: DriveFit, progress: Progress
) -> tuple[tuple[str, ...], dict[str, float], DriveFit, list[DriveFit]]:
    """Parts of the friction law that the record asks for: chosen, the gain of each, a fit with them, and the fits with
    one part more that predict as well as that: the record decides for neither."""
    gains: dict[str, float] = {}
    undecided: list[DriveFit] = []
    chosen: list[str] = []
    while len(chosen) < len(BLOCKS):
        progress("cross-validation", 1 + len(chosen), 2 + len(BLOCKS))
        # As near to its end as what it is compared with.
        tuned = problem.near(problem.continued(tuned))
        score = _predict_parts(problem, tuned)
        parts = [part for part in BLOCKS if part not in chosen]
        done = problem.branch(partial(_try_part, tuned=tuned, score=score), parts)
        tried = {part: fit for part, ((fit, _), _) in zip(parts, done, strict=True)}
        gains |= {part: gain for part, ((_, gain), _) in zip(parts, done, strict=True)}
        asked = [part for part in tried if gains[part] >= MIN_LIKELIHOOD_GAIN]
        if not asked:
            undecided = [value for part, value in tried.items() if gains[part] > -MIN_LIKELIHOOD_GAIN]
            break
        chosen.append(asked[0])
        tuned = tried[asked[0]]
        problem.weigh(tuned)
    return tuple(chosen), gains, tuned, undecided


def _try_part(problem: Problem, part: str, tuned: DriveFit, score: Array) -> tuple[DriveFit, float]:
    """A fit with one part more than `tuned`, and the gain over its score."""
    block = BLOCKS[part]
    begin = {**tuned.values, **{name: _start_value(problem, name) for name in block}}
    fit = problem.fitted([*tuned.names, *block], begin, tuned)
    if any(problem.no_effect(name, fit.values[name]) for name in block):  # the record does not determine it
        return fit, -inf
    fit = problem.near(fit)
    by = _predict_parts(problem, fit) - score
    # Both partitions ask for it: what one gains at the other's cost is no law.
    return fit, float(np.sum(by) if np.all(by > 0) else np.min(by))


def with_elastic_modes(problem: Problem, result: DriveFit, count: int | None) -> tuple[DriveFit, Mapping[int, float]]:
    """A fit with elastic modes, and the position [m] that it predicts of quarters of the motion with how many.

    One mode after the other: where it is, regression says of what the units leave. It stays where the units, fitted to
    three quarters, predict the fourth one better with it, or where the number is given.
    """
    folds = np.array_split(np.arange(len(problem.rows)), FOLDS)
    result = problem.near(result)
    predicted = {0: prediction_errors(problem, result, folds)[0] * problem.weights["position"]}
    for k in range(1, (MOST_MODES if count is None else count) + 1):
        machine, scale = problem.tuned(result.values)
        simulated = problem.replay.follow(machine, ("x_a",), problem.per_row, scale)[problem.each.axis]["x_a"]
        K_v = (problem.start | dict(result.values))["K_v"]
        one = resonance(problem.each, simulated, problem.per_row, K_v)
        if one is None:
            break
        before, start = result, problem.start
        fits = [
            (fit, beside.start)
            for fit, beside in problem.branch(
                partial(_fit_mode, before=before), [begin_mode(k, one, sign) for sign in (1.0, -1.0)]
            )
            if fit is not None
        ]
        if not fits:
            break
        fit, problem.start = min(fits, key=lambda one: float(np.sum(one[0].residuals ** 2)))
        fit = problem.near(fit)
        gain = _likelihood(problem, fit, folds) - _likelihood(problem, before, folds)
        predicted[k] = prediction_errors(problem, fit, folds)[0] * problem.weights["position"]
        if count is None and not gain > MIN_LIKELIHOOD_GAIN:
            problem.start = start
            break
        result = fit
        problem.weigh(result)
        result = problem.near(problem.continued(result))
    return result, predicted


def _fit_mode(problem: Problem, begin: dict[str, float], before: DriveFit) -> DriveFit | None:
    """A fit with one elastic mode more; None: the units cannot run it."""
    problem.start = problem.start | begin
    try:
        return problem.fitted([*before.names, *begin], {**before.values, **begin}, before)
    except InputError:
        return None


def _start_value(problem: Problem, name: str) -> float:
    F_C = problem.start["F_C"]
    return {"F_log": 0.1 * F_C, "gamma": 0.5, EXCESS: 0.1 * F_C, "asymmetry": 0.0}.get(name, problem.start[name])


def _predict_parts(problem: Problem, tuned: DriveFit) -> Array:
    """(2,) logarithm of the likelihood of every part of the motion, predicted from the others.

    Parts are stretches of time, and then kinds of motion: either direction, slow and fast. What predicts only motion
    that it has seen elsewhere is no law. The fit to the others is a Gauss-Newton step away from the one to all.
    """
    speed = problem.each.speed[problem.rows]
    kinds = 2 * (speed > 0) + (np.abs(speed) > FAST_SPEED_SHARE * np.max(np.abs(speed)))
    every = np.arange(len(speed))
    partitions = np.array_split(every, FOLDS), [every[kinds == kind] for kind in np.unique(kinds)]
    return np.array([_likelihood(problem, tuned, folds) for folds in partitions if len(folds) > 1])


def _likelihood(problem: Problem, tuned: DriveFit, folds: Sequence[Rows]) -> float:
    """Of the folds, each predicted from the others."""
    count = sum(map(len, folds))
    position, torque = prediction_errors(problem, tuned, folds)
    return -independent(problem, count) * (log(position) + log(torque))


def prediction_errors(problem: Problem, tuned: DriveFit, folds: Sequence[Rows]) -> tuple[float, float]:
    """Rms of position and torque, in their weights, where each fold is predicted from the others."""
    count = sum(map(len, folds))
    J, r = tuned.jacobian, tuned.residuals
    prior = np.arange(2 * count, len(r))
    remaining = np.empty(2 * count)
    for fold in folds:
        out = np.concatenate([fold, fold + count])
        others = np.concatenate([np.setdiff1d(np.arange(2 * count), out), prior])
        step = np.linalg.lstsq(J[others], -r[others], rcond=None)[0]
        remaining[out] = r[out] + J[out] @ step
    return rms(remaining[:count]), rms(remaining[count:][problem.counted])


def independent(problem: Problem, count: int) -> float:
    """How many of `count` rows say something of their own: neighbouring ones say the same."""
    return count * problem.each.record.interval / INDEPENDENT_TIME


Known = TypeVar("Known")

# Of the way per row, of the top speed: a regression that leaves more is a start, not an answer.
EXACT_DELAY, EXACT_GAIN = 1e-5, 1e-6
# Standard deviations of a delay [s], and of K_v over itself, below which a regression is better than a fit of the axis.
DELAY_SIGMA, GAIN_SIGMA = 10e-6, 0.01
MIN_MOVING_ROWS = 50  # in which the axis moves
MOST_FILTERED = 0.49  # of the sampling rate: highest frequency of a filter, which is below half of it
MISSED, MIN_POSITION_NOISE = (
    3.0,
    0.1e-6,
)  # of the noise of a position, [m] at least: a fit that leaves more lacks something
MOST_TURNS = 8  # of fits and weights in turns; two or three do where the start is near
WEIGHT_TOLERANCE = 0.01  # change of a weight that moves no value by what its interval shows


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
        other: a fit with another cycle of the position loop; None where the machine's is known.
        runs: of the units.
        rivals: structures of the drive that were tried besides.
        modes: elastic ones. modes_predicted: number of modes -> rms of the position [m] of every quarter of the motion,
            by a fit to the other three. correlation: of the estimates that have an interval.
        simulated: first and last instant of the record that the units were run over [s]: without its rests at both
            ends.
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
    other: OtherCycle | None
    runs: int
    modes: tuple[ElasticMode, ...] = ()
    modes_predicted: Mapping[int, float] = field(default_factory=dict)
    correlation: Correlation | None = None
    rivals: Sequence[TriedRival] = ()
    simulated: tuple[float, float] = (nan, nan)


def identify_drive(
    machine: Machine,
    each: AxisRecord,
    records: Sequence[Record],
    replay: Replay,
    *,
    structure_known: bool,
    begin: FitStart | None = None,
    beside_cycle: float | None = None,
    modes: int | None = 0,
    progress: Progress = lambda what, done, total: None,
) -> DriveFound:
    """Identify the drive of `each.axis`, with inertia (unless the structure is known) and friction.

    Args:
        machine: begins with its values; its cycles, structure and what is not identified stay.
        each: the stretch that is fitted. records: all stretches, for the regression. replay: of that stretch.
        structure_known: the inertia is that of the machine's modes, and the friction has the parts that it has there.
        begin: what the record alone says, in place of the machine's values: a fit begins at each of its starts, and
            the best goes on.
        beside_cycle: of the position loop [s], in place of the machine's, that what was found is compared with.
        modes: elastic ones of a rigid axis; None: as many as the record asks for.

    Raises:
        InputError: a record without motion; no start that the units can run; a result that leaves a large part of the
            record.
    """
    taps = _where_recorded(setpoint_delay, records)
    speed = _where_recorded(speed_setpoint, records)
    delay, gain = _known_loop(records, taps, speed)
    J = checked_modes(machine).J_tot(each.axis)
    total = delay.value if delay is not None else None
    candidates = [start_of(machine, each.axis) | dict(start) for start in (begin.starts if begin is not None else [{}])]
    for values in candidates:
        if gain is not None:
            values["K_v"] = gain.value
        elif speed is not None and speed.K_v > 0:
            values["K_v"] = speed.K_v
        if (weight := feedforward_of(records)) is not None:
            values["k_ffw"] = weight
        if taps is not None:
            whole = total if total is not None else taps.delay
            values["T_sym"] = min(values["T_sym"], whole)
            values["T_dyn"] = whole - values["T_sym"]
    rows = np.flatnonzero(each.moving)
    if len(rows) < MIN_MOVING_ROWS:
        raise InputError(
            f"{each.record.name}: {len(rows)} rows in which axis {each.axis} moves; at least {MIN_MOVING_ROWS} are "
            "needed"
        )
    problem = Problem(machine, each, replay, candidates[0], total, J, first_weights(each), rows)
    driven = each.record.driven
    # The delay is the first of the differences: the run that they are about is one of the last ones then.
    free = ["delay"] if driven else []
    free += ["K_p", "K_i", "T_sym", "k_ffw"]
    # Without a torque friction and load are the machine's: what they do to the position, the speed controller may, too.
    free += ["M_0", "F_C", "sigma_0", "sigma_1", "sigma_2"] if driven else []
    free += [] if structure_known else ["J"]
    free += [] if gain is not None else ["K_v"]
    free += [] if total is not None else ["T_dyn"]
    drive = machine.shipped_drive(each.axis, "the identification of a drive")
    free += ["omega_0", "D"] if drive.reference_model else []
    progress("first fit", 0, 2 + len(BLOCKS))
    parts: dict[str, float] = {}
    may_be: Sequence[DriveFit | TriedRival] = ()
    rivals: Sequence[TriedRival] = ()
    elastic_rivals: Sequence[TriedRival] = ()
    chosen: tuple[str, ...] = ()
    if structure_known:
        own = {name for name, block in BLOCKS.items() if driven and _has_friction_part(problem.start, block)}
        chosen = tuple(name for name in BLOCKS if name in own)
        free += [name for part in chosen for name in BLOCKS[part]]
        found = _fit_preloaded(problem, problem.first(free))
    else:
        found = _best_start(problem, free, candidates)
        if not (begin is not None and begin.one_way):  # then what friction holds at rest is all that shows the load
            found = _fit_preloaded(problem, found)
        chosen, parts, found, undecided = friction_parts(problem, found, progress)
        progress("rival structures", 1 + len(BLOCKS), 2 + len(BLOCKS))
        found, rivals = with_rivals(problem, found, partial(_misses, problem))
        if any(one.taken for one in rivals):  # parts of the friction law may have made up for the structure
            of_parts = [name for part in chosen for name in BLOCKS[part]]
            found = problem.fitted([name for name in found.names if name not in of_parts], problem.start)
            problem.weigh(found)
            chosen, parts, found, undecided = friction_parts(problem, found, progress)
            found, further = with_rivals(problem, found, lambda fit: False)
            rivals = [*(one for one in rivals if one.taken), *further]
        elastic_rivals = possible_modes(problem, found) if modes == 0 else []
        rivals = [*rivals, *elastic_rivals]
        without = found
        may_be = [*undecided, *(one for one in rivals if not one.taken)]
    elastic: Mapping[int, float] = {}
    if modes != 0 and not structure_known:
        progress("elastic modes", 1 + len(BLOCKS), 2 + len(BLOCKS))
        found, elastic = with_elastic_modes(problem, found, modes)
    progress("last fit", 1 + len(BLOCKS), 2 + len(BLOCKS))
    for _ in range(MOST_TURNS):
        before = problem.weights
        problem.weigh(found)
        found = problem.continued(found, FINAL_TOLERANCE)
        if all(abs(problem.weights[channel] / weight - 1) < WEIGHT_TOLERANCE for channel, weight in before.items()):
            break
    refuse_poor(each, found)
    found = problem.exact(found, central=True)
    quarters = np.array_split(np.arange(len(rows)), FOLDS)
    unseen = prediction_errors(problem, found, quarters)
    predicted = unseen[0] * problem.weights["position"], unseen[1] * problem.weights["torque"]
    if not each.record.driven:
        predicted = predicted[0], nan
    estimates = estimates_of(problem, found, unseen, delay, gain, structure_known)
    if may_be:
        estimates = widen_for_modes(with_undecided(estimates, without, may_be), elastic_rivals)
    if not structure_known:
        estimates = widen_for_rigid_line(each, problem.machine, estimates)
    if begin is not None and begin.one_way:
        estimates = one_way(each, estimates, begin.one_way)

    def judged(fit: DriveFit) -> Mapping[str, Estimate]:
        return estimates_of(problem, fit, prediction_errors(problem, fit, quarters), delay, gain, structure_known)

    other = None if beside_cycle is None else other_cycle(problem, found, beside_cycle, judged)
    return DriveFound(
        each.axis, estimates, taps, speed, problem.machine_of(found.values), parts, chosen,
        rms(found.position), rms(found.torque) if each.record.driven else nan, predicted, other, problem.runs,
        elastic_modes(problem, found, unseen), elastic,
        correlation_of(problem, found, unseen, delay, gain, estimates), rivals,
        (float(replay.time[replay.run[0]]), float(replay.time[replay.run[1]])),
    )  # fmt: skip


def _where_recorded(of: Callable[[Sequence[Record]], Known], records: Sequence[Record]) -> Known | None:
    try:
        return of(records)
    except InputError:
        return None


def _known_loop(
    records: Sequence[Record], taps: Taps | None, speed: SpeedSetpoint | None
) -> tuple[Constant | None, Constant | None]:
    """Delay of the setpoint, and K_v, where the record holds them: exactly, or with little enough noise.

    What noise leaves open is a part of the intervals. A signal that does not follow from setpoint and position is not
    what it is called: its stretches contradict one another, or what is left is large.
    """
    top = max(float(np.max(np.abs(np.diff(one.angle)))) / one.interval for one in records if one.angle is not None)
    delay = gain = None
    if speed is not None and speed.rms <= EXACT_GAIN * top:
        gain = Constant(speed.K_v, speed.sigma[0])
    if taps is not None:
        noisy = noisy_delay(records, taps)
        if gain is None and noisy.sigma <= DELAY_SIGMA:
            with suppress(InputError):
                by_deviation = gain_by_deviation(records, noisy.value)
                gain = by_deviation if 0 < by_deviation.sigma <= GAIN_SIGMA * by_deviation.value else None
        if taps.rms <= EXACT_DELAY * top * taps.interval:
            delay = Constant(taps.delay, taps.sigma)
        elif gain is not None and noisy.sigma <= DELAY_SIGMA:  # without K_v the lag is shared with an axis that bends
            delay = noisy
    return delay, gain


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
    own = TABLE["k_ffw"]
    return min(max(weight, own.lower), own.upper) if rank == columns.shape[1] else None


def start_of(machine: Machine, axis: str) -> dict[str, float]:
    """What the machine's axis has, as the parameters of a fit."""
    drive = machine.shipped_drive(axis, "the identification of a drive")
    friction = machine.shipped_friction(axis, "the identification of a drive")
    values = {name: float(getattr(friction, name)) for name in
              ("F_C", "sigma_0", "sigma_1", "sigma_2", "v_s", "F_log", "W", "gamma", "asymmetry")}  # fmt: skip
    T_n = drive.T_n if drive.T_n is not None else 1.0
    return values | {
        EXCESS: float(friction.F_S) - values["F_C"], "M_0": machine.axes[axis].M_0,
        "K_v": drive.K_v, "k_ffw": drive.k_ffw, "T_sym": drive.T_sym, "T_dyn": drive.T_dyn, "delay": 0.0,
        "K_p": drive.K_p, "K_i": drive.K_p / T_n, "J": checked_modes(machine).J_tot(axis),
        "omega_0": drive.omega_0 or 1.0, "D": drive.D or 1.0, "filter_1.f_most": MOST_FILTERED / machine.cycles.T_c,
    }  # fmt: skip


def _has_friction_part(values: Mapping[str, float], block: Sequence[str]) -> bool:
    """Whether the friction has the part that a block is of."""
    return values[block[0]] != 0


def _misses(problem: Problem, fit: DriveFit) -> bool:
    """Whether a fit leaves more than noise of the position, or has an inertia that the torque line contradicts."""
    noise = max(white(problem.each.position), MIN_POSITION_NOISE)
    return rms(fit.position) > MISSED * noise or contradicts_line(problem.each, problem.machine, fit.values["J"])


def _fit_preloaded(problem: Problem, fit: DriveFit) -> DriveFit:
    """The fit from the torque at rest of the record, where what was found does not come to rest with it by itself."""
    if problem.replay.preload(*problem.tuned(fit.values)):
        fit = problem.fitted(fit.names, fit.values, fit)
        problem.weigh(fit)
    return fit


def _best_start(problem: Problem, free: Sequence[str], candidates: Sequence[dict[str, float]]) -> DriveFit:
    """The likeliest of first fits from several starts; the problem has that start, and its weights, then.

    Raises InputError: the units can run none of them.
    """

    def first(beside: Problem, start: dict[str, float]) -> tuple[float, DriveFit | InputError]:
        """How much a first fit leaves, and the fit; or why there is none."""
        beside.start = start
        try:
            fit = beside.first(free)
        except InputError as error:
            return inf, error
        # Weights are of each fit's own residuals: fits are compared by those, and by how far the start is away.
        remaining = independent(beside, len(beside.rows)) * (log(rms(fit.position)) + log(rms(fit.torque)))
        return remaining + 0.5 * float(np.sum(fit.residuals[2 * len(beside.rows) :] ** 2)), fit

    (_, best), beside = min(problem.branch(first, candidates), key=lambda one: one[0][0])
    if isinstance(best, InputError):
        raise best
    problem.start, problem.weights = beside.start, beside.weights
    return best


# --- Whether the position of a record can be that of an axis that follows its setpoint, by the record alone -----------
#     position = gain (setpoint - delay * speed of the setpoint) + offset
#
# Gain, delay and offset are least squares over the rows that count. A wrong sign or unit shows in the gain, another
# zero in the offset, and a column of something else in what remains. Rows at which the position jumps are looked for
# ahead.


SETPOINT_ROUNDING = 1e-7  # of the way: a setpoint and a position that differ by rounding alone
# Of a jump, which gain and delay do not explain: over the usual large steps, over the encoder's step, over the way per
# row at top speed, and over what the setpoint's speed changes by from row to row. The usual large ones are what a share
# of the rows exceeds, but some rows at least.
JUMP_RATIO, JUMP_STEPS, JUMP_WAY, JUMP_ASKED = 10.0, 10.0, 0.1, 1.5
LARGE_SHARE, LARGE_ROWS = 0.01, 8
MAX_LAG = 0.25  # of the way: an axis that lags by more has a gain of its own, as a fast oscillation has
MAX_REMAINING = 0.05  # share of the position's way that setpoint and delay may leave
GAIN_TOLERANCE = 0.05
MAX_OFFSET, MIN_OFFSET = 0.05, 20e-6  # of the way; [m], thermal growth and compensation are no other zero
UNIT_FACTORS = (
    (25.4, "inch and mm"),
    (1000.0, "m and mm"),
    (1000 / 25.4, "inch and m"),
    (10.0, "cm and mm"),
    (2.0, "diameter and radius"),
    (2 * pi, "turns and radians"),
    (180 / pi, "degrees and radians"),
    (360.0, "degrees and turns"),
)


def implausible(axis_record: AxisRecord) -> list[str]:
    """Why the position, or the torque, of a record cannot be that of its axis: a sentence for each reason."""
    where = f"{axis_record.record.name}, axis {axis_record.axis}"
    return [f"{where}: {text}" for text in (*_of_position(axis_record), *_of_torque(axis_record))]


def _of_position(axis_record: AxisRecord) -> Iterator[str]:
    x_s, x_a = axis_record.setpoint[axis_record.rows], axis_record.position[axis_record.rows]
    way = float(np.ptp(x_s))
    if not way > 0:
        return
    largest = float(np.max(np.abs(x_s - x_a)))
    if largest <= SETPOINT_ROUNDING * way:
        yield (
            f"the position setpoint is the recorded position (largest difference {1e9 * largest:.3g} nm of a way of "
            f"{1e3 * way:.4g} mm). The distance between them shows the drive; name the column of the setpoint"
        )
        return
    speed = np.gradient(axis_record.setpoint, axis_record.record.interval)[axis_record.rows]
    middle = float(np.mean(x_s))
    columns = np.column_stack([x_s - middle, speed, np.ones_like(x_s)])
    gain, lag, mean = (float(value) for value in np.linalg.lstsq(columns, x_a, rcond=None)[0])
    off = x_a - columns @ np.array([gain, lag, mean])
    yield from _jumps(x_s, x_a, off, axis_record.record.time[axis_record.rows])
    remaining, own_way = rms(off), float(np.ptp(x_a))
    if remaining >= MAX_REMAINING * own_way:
        yield (
            f"the recorded position does not follow its setpoint: it moves by {1e3 * own_way:.4g} mm, the setpoint by "
            f"{1e3 * way:.4g} mm, and gain, delay and offset leave {1e3 * remaining:.3g} mm rms; check that both "
            "columns are of this axis"
        )
    elif abs(lag) * float(np.max(np.abs(speed))) > MAX_LAG * abs(gain) * way:
        return
    elif abs(gain - 1) > GAIN_TOLERANCE:
        yield f"the recorded position moves {gain:.4g} times as far as its setpoint: {_cause(gain)}"
    elif abs(mean - middle) > max(MAX_OFFSET * way, MIN_OFFSET):
        yield (
            f"the recorded position is {1e3 * (mean - middle):+.4g} mm off its setpoint throughout, on a way of "
            f"{1e3 * way:.4g} mm; both columns must count from the same zero"
        )


def _jumps(x_s: Array, x_a: Array, off: Array, time: Array) -> Iterator[str]:
    """Steps of the position from row to row. off: what gain and delay leave of it."""
    steps, unexplained = np.diff(x_a), np.abs(np.diff(off))
    if not np.any(steps):
        return
    usual = np.sort(unexplained)[-min(max(LARGE_ROWS, round(LARGE_SHARE * len(off))), len(steps))]
    least = max(
        JUMP_RATIO * float(usual),
        JUMP_STEPS * float(np.min(np.abs(steps[steps != 0]))),
        JUMP_WAY * float(np.max(np.abs(np.diff(x_s)))),
        JUMP_ASKED * float(np.max(np.abs(np.diff(x_s, 2)))),
    )
    rows = np.flatnonzero(unexplained > least)
    if len(rows):
        k = int(rows[0])
        more = f" and {len(rows) - 1} more time{'s'[: len(rows) > 2]}" if len(rows) > 1 else ""
        yield (
            f"the recorded position jumps by {1e3 * steps[k]:+.4g} mm from {time[k]:.6g} s to the next row{more}, "
            f"which no axis does and its setpoint does not ask for; give a window without that "
            f"({spell_argument('window')})"
        )


def _cause(gain: float) -> str:
    """The likely error of sign and unit."""
    size, causes = abs(gain), ["one of the two lacks sign: -1"] if gain < 0 else []
    if abs(size - 1) > GAIN_TOLERANCE:
        pairs = [
            f"a factor of {factor:.4g} lies between {pair}"
            for factor, pair in UNIT_FACTORS
            if min(abs(size / factor - 1), abs(size * factor - 1)) <= GAIN_TOLERANCE
        ]
        causes += pairs or ["check units, pitch and gear of both"]
    return "; ".join(causes)


def _of_torque(axis_record: AxisRecord) -> Iterator[str]:
    torque = axis_record.record.torque[axis_record.rows]
    if axis_record.record.driven and np.any(axis_record.moving) and not np.ptp(torque):
        yield (
            f"the recorded torque is {torque[0]:.4g} N.m in all rows, also while the axis moves: it was not measured; "
            "name the column of the torque or current"
        )
