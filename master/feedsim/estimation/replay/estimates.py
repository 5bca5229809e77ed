"""What a fit of a drive is worth: its values with intervals, what is not determined, and what is refused.

Intervals are those of residuals that are correlated over stretches of time, as errors of a model are. Start reading at
estimates_of().
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import hypot, nan
from typing import Protocol

import numpy as np

from feedsim.estimation.identify.inertia import inertia
from feedsim.estimation.identify.parameters import EXCESS, estimate, inner_to_outer
from feedsim.estimation.identify.position_loop import Constant, rms
from feedsim.estimation.identify.result import Correlation, Estimate
from feedsim.estimation.least_squares import (
    NORMAL_95,
    Covariance,
    between_groups,
    correlated_middle,
    correlation_length,
    half_width,
)
from feedsim.estimation.replay.closed_loop import AxisRecord
from feedsim.estimation.replay.machine_files import KEYS, ElasticMode, modes_of
from feedsim.estimation.replay.tuning import DriveFit, Problem, TriedRival
from feedsim.files.trace.trace import Array
from feedsim.foundation import units
from feedsim.foundation.arguments import spell_argument
from feedsim.foundation.errors import InputError
from feedsim.scenario import Machine

MAX_RESIDUAL_SHARE = 0.3  # share of the torque, or of the lag, that a fit may leave
EXACT_TRAVEL_SHARE = 1e-5  # of the travel: a position that a fit leaves within it is met, however small the lag
ONE_WAY = 0.1  # share of the mean torque to which the constant load has to be known where the axis moves one way
SHAPE = 0.25  # standard deviation of the friction, of itself, where only its usual shape separates it from the load
STRETCHES = 8  # of the motion, each of which is left out once
PRIOR_SHARE = 0.8  # share of the usual deviation that is left: the record does not determine the value
_CONTROLLER = units.parameters("controller")
ON_THE_MODEL = "{} it rests on an axis that is taken to be rigid"
SHARED_LAG = "{} only the lag shows, T_dyn + T_sym + (1 - k_ffw)/K_v, and it may be shared otherwise"
SHARED_PARAMETERS = ("T_sym", "k_ffw")
LINE_SHARE = 0.02  # standard deviation of a line's inertia, and of its load over the friction, besides its own
BESIDE_LINE = "{} is {:.4g} +- {:.2g} {} by the torque line of rigid motion, which needs no model of the drive"
MODE_SHOWS = "the record speaks for an {}; give {} auto, which fits it"
ESTIMATE_ORDER = ("K_v", "k_ffw", "T_dyn", "T_sym", "K_p", "T_n", "omega_0", "D", "filter_1.f", "filter_1.D_den", "J",
         "M_0", "F_C", "F_S", "v_s", "F_log", "sigma_0", "sigma_1", "sigma_2", "W", "gamma", "asymmetry",
         "delay")  # fmt: skip


class _WithValues(Protocol):
    """What has values by name."""

    @property
    def values(self) -> Mapping[str, float]: ...


def refuse_poor(each: AxisRecord, found: DriveFit) -> None:
    """Raises InputError: the fit leaves so much that its parameters are those of no axis."""
    signal = {
        "torque": (rms(found.torque), rms(each.record.torque[each.moving]), 1.0, "N.m", "torque"),
        "position": (rms(found.position), rms((each.setpoint - each.position)[each.moving]), 1e6, "um",
                     "distance of the position behind its setpoint"),
    }  # fmt: skip
    exact = rms(found.position) <= EXACT_TRAVEL_SHARE * float(
        np.ptp(each.position[each.moving])
    )  # the setpoint may be the encoder
    for channel, (left, whole, scale, unit, meaning) in signal.items():
        judged = each.record.driven if channel == "torque" else not exact
        if judged and left > MAX_RESIDUAL_SHARE * whole:
            raise InputError(
                f"{each.record.name}, axis {each.axis}: the best fit leaves {scale * left:.3g} {unit} rms of a "
                f"{meaning} of {scale * whole:.3g} {unit} rms while the axis moves; at most "
                f"{100 * MAX_RESIDUAL_SHARE:.0f} % are "
                "allowed. No drive is identified: check signs, units and pitch, give a longer window with motion in "
                "both directions, or a machine to begin with (--machine)"
            )


def estimates_of(
    problem: Problem,
    found: DriveFit,
    unseen: tuple[float, float],
    delay: Constant | None,
    gain: Constant | None,
    known: bool,
) -> dict[str, Estimate]:
    """In the parameters of drive and friction, with intervals.

    delay, gain: of the position loop, by regression over the record; None: the fit has them.
    """
    values = problem.start | dict(found.values)
    covariance = _covariance(problem, found, unseen)
    spread = dict(zip(found.names, map(float, np.sqrt(np.diag(covariance))), strict=True))
    result: dict[str, Estimate] = {}

    def put(name: str, value: float, sigma: float, by: str) -> None:
        result[name] = _judge_estimate(name, value, sigma, spread.get(by, nan) / problem.deviation(by, values))

    for name in found.names:
        if name not in ("K_i", EXCESS, "K_v", "T_dyn") and not name.startswith("mode_"):
            put(name, values[name], spread[name], name)
    ratio = np.array([(n == "K_p") / values["K_p"] - (n == "K_i") / values["K_i"] for n in found.names])
    T_n = values["K_p"] / values["K_i"]
    put("T_n", T_n, T_n * float(np.sqrt(ratio @ covariance @ ratio)), "K_p")
    if gain is not None:
        result["K_v"] = _judge_estimate("K_v", values["K_v"], gain.sigma, 0.0)
    else:
        put("K_v", values["K_v"], spread["K_v"], "K_v")
        if not known:
            reason = ON_THE_MODEL.format(_missing_signal_text("speed setpoint", problem.each.record.speed_setpoint))
            result["K_v"] = replace(result["K_v"], status="undetermined", reason=reason)
    if delay is not None:
        result["T_dyn"] = _judge_estimate("T_dyn", problem.T_dyn(values), hypot(spread["T_sym"], delay.sigma), 0.0)
        # The lag that the position shows is the delay and (1 - k_ffw)/K_v.
        further = hypot(values["K_v"] * delay.sigma, (1 - values["k_ffw"]) * result["K_v"].sigma / values["K_v"])
        for name, own in (("k_ffw", further), ("T_sym", delay.sigma)):
            result[name] = replace(result[name], sigma=hypot(result[name].sigma, own))
    else:
        put("T_dyn", values["T_dyn"], spread["T_dyn"], "T_dyn")
        result = shared_lag(result, _missing_signal_text("following error", problem.each.record.deviation))
    if EXCESS in found.names:
        rise = inner_to_outer(found.names, ["F_S"])[0]
        put("F_S", values["F_C"] + values[EXCESS], float(np.sqrt(rise @ covariance @ rise)), EXCESS)
    if known:
        result["J"] = replace(estimate("J", values["J"]), status="given", reason="of the machine's modes")
    return {name: result[name] for name in ESTIMATE_ORDER if name in result}


def correlation_of(
    problem: Problem,
    found: DriveFit,
    unseen: tuple[float, float],
    delay: Constant | None,
    gain: Constant | None,
    estimates: Mapping[str, Estimate],
) -> Correlation:
    """Correlations of the estimates that have an interval, by the fit that they are from. Arguments as estimates_of().

    What a regression over the record gives is independent of the fit: K_v, and the sum of T_dyn and T_sym.
    """
    values = problem.start | dict(found.values)
    covariance = _covariance(problem, found, unseen)
    names = [name for name, each in estimates.items() if each.sigma > 0]
    rows, further = np.zeros((len(names), len(found.names))), np.zeros(len(names))
    for row, name in enumerate(names):
        if name == "T_n":
            slopes = {"K_p": 1 / values["K_i"], "K_i": -values["K_p"] / values["K_i"] ** 2}
            rows[row] = [slopes.get(each, 0.0) for each in found.names]
        elif name == "F_S":
            rows[row] = inner_to_outer(found.names, ["F_S"])[0]
        elif name == "K_v" and gain is not None:
            further[row] = 1.0
        elif name == "T_dyn" and delay is not None:
            rows[row] = [-1.0 if each == "T_sym" else 0.0 for each in found.names]
            further[row] = delay.sigma**2
        else:
            rows[row] = [float(each == name) for each in found.names]
    matrix = rows @ covariance @ rows.T + np.diag(further)
    if delay is None:  # T_sym and k_ffw share the lag: what shared_lag() adds moves both
        added = [
            estimates[name].sigma ** 2 - matrix[k, k] if name in SHARED_PARAMETERS else 0
            for k, name in enumerate(names)
        ]
        matrix += np.outer(*2 * [np.sqrt(np.maximum(added, 0.0))])
    scale = np.sqrt(np.diag(matrix))
    return Correlation(tuple(names), np.asarray(matrix / np.outer(scale, scale)))


def one_way(each: AxisRecord, estimates: Mapping[str, Estimate], only: str) -> dict[str, Estimate]:
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
    mean, half = abs(float(np.mean(torque))), half_width(estimates["M_0"].sigma)
    if mean > float(np.std(torque)) and half > ONE_WAY * mean:
        raise InputError(
            f"{each.record.name}, axis {each.axis}: {only}; M_0 by itself is known to +-{half:.2g} N.m only, and at "
            f"most +-{ONE_WAY * mean:.2g} N.m are allowed. No drive is identified: give a window with motion in both "
            "directions, or a machine whose friction and load are known (--machine)"
        )
    undetermined = {name: replace(estimates[name], status="undetermined", reason=only) for name in ("M_0", "F_C")}
    return {**estimates, **undetermined}


def shared_lag(estimates: Mapping[str, Estimate], without: str) -> dict[str, Estimate]:
    """Estimates of a record whose delay of the setpoint is not known, on a model that is not quite the axis.

    A slow motion lags by T_dyn + T_sym + (1 - k_ffw)/K_v times its speed, and so does every set of values with that
    sum. What a change of speed shows besides is of the order of (1/K_v) T_sym less half of (1/K_v)^2, along which T_sym
    and k_ffw move together: the sets are a curved valley, and its tangent where a fit ends is no interval. T_sym may be
    anything from 0 to the whole lag.

    without: what the record lacks, in words.
    """
    K_v, T_sym = estimates["K_v"].value, estimates["T_sym"].value
    lag = estimates["T_dyn"].value + T_sym + (1 - estimates["k_ffw"].value) / K_v
    open_ = max(T_sym, lag - T_sym) / NORMAL_95
    reason = SHARED_LAG.format(without)
    further = {"T_dyn": 0.0, "T_sym": open_, "k_ffw": K_v * open_}
    wider = {
        name: replace(estimates[name], sigma=hypot(estimates[name].sigma, sigma), status="undetermined", reason=reason)
        for name, sigma in further.items()
    }
    return {**estimates, **wider}


def with_undecided(
    estimates: Mapping[str, Estimate], found: _WithValues, undecided: Sequence[_WithValues]
) -> dict[str, Estimate]:
    """Estimates whose intervals include what they would be with a part of the friction law, or of the drive, that the
    record neither asks for nor excludes: it is a part of what is not known.

    found: a fit without such parts. undecided: with each of them.
    """
    wider = dict(estimates)

    def value(values: Mapping[str, float], name: str) -> float:
        if name == "T_n" and values.keys() >= {"K_p", "K_i"}:
            return values["K_p"] / values["K_i"]
        if name == "T_dyn" and name not in values:  # what T_sym leaves of a delay that is known
            return -values.get("T_sym", nan)
        return values.get(name, nan)

    for name, one in estimates.items():
        moved = np.nanmax([0.0, *(abs(value(other.values, name) - value(found.values, name)) for other in undecided)])
        if moved > 0:
            wider[name] = replace(one, sigma=hypot(one.sigma, moved / NORMAL_95)).judged()
    return wider


def widen_for_modes(estimates: Mapping[str, Estimate], modes: Sequence[TriedRival]) -> dict[str, Estimate]:
    """Estimates of a rigid axis whose record speaks for an elastic mode: the speed controller that makes up for it is
    another one."""
    shown = [one for one in modes if one.gain > one.least]
    if not shown:
        return dict(estimates)
    reason = MODE_SHOWS.format(max(shown, key=lambda one: one.gain).name, spell_argument("modes"))
    hidden = {name: replace(one, status="undetermined", reason=reason)
              for name, one in estimates.items() if name in ("K_p", "T_n")}  # fmt: skip
    return {**estimates, **hidden}


def _line_of(axis_record: AxisRecord, machine: Machine) -> dict[str, Estimate]:
    """Inertia and constant load by the torque line of rigid motion; none where the record has no such line, or has the
    torque at one phase of the position cycle alone (start.of_cycle)."""
    if machine.cycles.T_pos > 0.5 * axis_record.record.interval:
        return {}
    rows = np.flatnonzero(axis_record.rows)
    try:
        line = inertia([axis_record.record.between(int(rows[0]), int(rows[-1]) + 1)])
    except InputError:
        return {}
    # A simple friction and a rigid axis are not all that there is.
    further = {"J": LINE_SHARE * line.J.value, "M_0": LINE_SHARE * line.estimates["F_C"].value}
    return {
        name: replace(one, sigma=hypot(one.sigma, abs(share)))
        for name, share in further.items()
        if (one := line.estimates[name]).status == "estimated"
    }


def contradicts_line(axis_record: AxisRecord, machine: Machine, J: float) -> bool:
    """Whether an inertia is none that the torque line of rigid motion allows for, whatever the drive."""
    line = _line_of(axis_record, machine).get("J")
    return line is not None and not line.interval[0] <= J <= line.interval[1]


def widen_for_rigid_line(
    axis_record: AxisRecord, machine: Machine, estimates: Mapping[str, Estimate]
) -> dict[str, Estimate]:
    """Estimates held against what needs no structure of the drive: where the torque line of rigid motion says something
    else, an interval includes that. What rests on such an inertia is not determined."""
    result = dict(estimates)
    for name, line in _line_of(axis_record, machine).items():
        one = result[name]
        apart, allowed = abs(one.value - line.value), half_width(one.sigma) + half_width(line.sigma)
        if apart <= allowed:
            continue
        said = BESIDE_LINE.format(name, line.value, half_width(line.sigma), line.unit)
        result[name] = replace(one, sigma=(apart + half_width(line.sigma)) / NORMAL_95).judged()
        for other in (name, *(("K_p", "T_n") if name == "J" else ())):
            if other != name or result[name].status == "undetermined":
                result[other] = replace(result[other], status="undetermined", reason=said)
    return result


def elastic_modes(problem: Problem, found: DriveFit, unseen: tuple[float, float]) -> tuple[ElasticMode, ...]:
    """The elastic modes of a fit, with standard deviations."""
    own = modes_of(found.values)
    if not own:
        return ()
    spread = dict(zip(found.names, map(float, np.sqrt(np.diag(_covariance(problem, found, unseen)))), strict=True))
    named = [[f"{key}_{k}" for key in KEYS] for k in range(1, len(own) + 1)]
    modes = [replace(each, sigma=tuple(spread[name] for name in names)) for each, names in zip(own, named, strict=True)]
    return tuple(sorted(modes, key=lambda each: each.frequency))


def _missing_signal_text(signal: str, recorded: Array | None) -> str:
    """Begin of a reason: the record lacks a signal, or has it of other samples than its setpoint and position."""
    if recorded is None:
        return f"without the control's own {signal}"
    return f"as the recorded {signal} follows from setpoint and position too roughly,"


def _judge_estimate(name: str, value: float, sigma: float, left: float) -> Estimate:
    """An estimate that says what it is worth. left: the deviation over the usual one."""
    if name in _CONTROLLER:
        row = _CONTROLLER[name]
        found = Estimate(name, value, row.unit, row.short, sigma)
    else:
        found = estimate(name, value, sigma)
    if left > PRIOR_SHARE:
        return replace(found, status="undetermined", reason="the record hardly depends on it")
    return found.judged()


def _covariance(problem: Problem, found: DriveFit, unseen: tuple[float, float]) -> Array:
    """Covariance (P, P), of correlated residuals: every channel counts less by the rows over which they are correlated.

    unseen: rms of position and torque that the others do not predict, in their weights. Where a model is not quite that
    of the axis, a fit to little motion leaves too little. What it leaves of motion that it has not seen is the better
    measure. So is what its stretches say differently.
    """
    scale = np.array([problem.deviation(name, found.values) for name in found.names])
    J, r, count = found.jacobian, found.residuals, len(problem.rows)
    channels = np.arange(count), count + np.flatnonzero(problem.counted)
    prior = J[2 * count :].T @ J[2 * count :]
    normal = sum((J[rows].T @ J[rows] for rows in channels), prior)
    middle = sum(
        (
            correlated_middle(J[rows], r[rows], rms, correlation_length)
            for rows, rms in zip(channels, unseen, strict=True)
        ),
        prior,
    )
    covariance = np.asarray(Covariance.of(normal, hermitian=True).by(middle))
    own = np.diag(covariance)
    wider = np.sqrt(np.maximum(between_stretches(J, r, count) / np.where(own > 0, own, 1.0), 1.0))
    return np.asarray(covariance * np.outer(wider * scale, wider * scale))


def between_stretches(J: Array, r: Array, count: int) -> Array:
    """(P,) variance of the parameters by what the STRETCHES of a record say differently, in usual deviations.

    Args:
        J, r: (2 count + M, P) and (2 count + M,), of two channels over `count` rows of motion, and of what is usual.
    """
    return between_groups(J, -r, [np.append(own, own + count) for own in np.array_split(np.arange(count), STRETCHES)])
