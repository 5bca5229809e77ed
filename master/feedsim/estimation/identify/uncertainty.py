"""How far what was found can be relied on: what the scatter of the torque does not determine of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from feedsim.estimation.fit import Fit
from feedsim.estimation.identify.motion import RecordTorque, deflection
from feedsim.estimation.identify.parameters import NO_EFFECT, PARAMETER_KINDS, PRE_SLIDING, parameter_name, solver_name
from feedsim.estimation.identify.record import Array
from feedsim.estimation.identify.result import Stationary, Status
from feedsim.estimation.identify.search import Search, Solution
from feedsim.estimation.least_squares import ANY_VALUE, half_width, is_determined, is_significant, reason
from feedsim.estimation.parameter import Prior
from feedsim.foundation.errors import Finding

# Of the record's RMS torque, and of the inertia: what the model itself is not better than (interpolation between the
# samples, modes of the structure). Without it the quietest move of a record without noise would count for all.
MODEL_ACCURACY = 1e-3
DRAWS = 8  # their mean square is known to within a half, their root to a quarter: an order of magnitude is wanted
# variances that one stretch pulls by chance, 95 % (chi^2): a few stretches that agree determine no more
BY_CHANCE = 3.84
# Of a row's interval: to better than that no cubic between rows determines when something happened. A delay that is too
# short by it passes for damping, sigma_0 times as large.
INSTANT = 0.01
SMOOTHER = 1.5  # times lower a cut-off: what it takes off more is about what the first one did
AT_ODDS = 3.0  # times the deviation by noise that stretches which contradict each other make of it: worth a warning
WORTH_A_WORD, LEAST_DELAY = 0.01, 2e-5  # of the value, and [s]: deviations that are worth it
MOTION_NOISE_RATIO = 2.0  # times the deviation by the torque's noise that the motion's makes of it: worth a warning


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """A solution with all in its covariance that the scatter of the torque does not determine.

    torque: its standard deviations by that scatter alone; motion: by errors of the recorded motion; at_odds: factors by
    which stretches and prior contradict each other; all by inner name.
    """

    solution: Solution
    torque: Mapping[str, float]
    motion: Mapping[str, float]
    at_odds: Mapping[str, float]


def uncertainty(
    search: Search, solution: Solution, left_open: Collection[Mapping[str, float]], drift: Prior | None = None
) -> Uncertainty:
    """Stretches that contradict each other or stage 1; errors of the recorded motion; what may have drifted in stage 1;
    what the rest would be with a parameter free that the records leave open, which is held here; and what rows
    determine at best.

    left_open: per such parameter, inner name -> variance with it free. drift: the part of stage 1's covariance that is
    not in the search's prior.
    """
    fit = solution.fit
    factor = disagreement(search.models, fit)
    motion = motion_covariance(search.models, fit, solution.values, solution.states, search.weights)
    covariance = np.where(np.isfinite(fit.covariance), fit.covariance * np.outer(factor, factor), fit.covariance)
    covariance = covariance + motion + drift_covariance(search.prior, fit, drift)
    if "J" in fit.names:
        covariance[fit.names.index("J"), fit.names.index("J")] += (MODEL_ACCURACY * solution.values["J"]) ** 2
    variance = np.diag(covariance)
    wanted = (*left_open, _least_variances(search.models, solution.values))
    most = [max(float(v), *(values.get(n, 0.0) for values in wanted)) for n, v in zip(fit.names, variance, strict=True)]
    usable = np.isfinite(variance) & (variance > 0)
    wider = np.sqrt(np.where(usable, most, 1.0) / np.where(usable, variance, 1.0))
    covariance = np.where(np.isfinite(covariance), covariance * np.outer(wider, wider), covariance)
    by_name = [dict(zip(fit.names, map(float, values), strict=True)) for values in (np.sqrt(np.diag(motion)), factor)]
    return Uncertainty(replace(solution, fit=replace(fit, covariance=covariance)), fit.sigma, *by_name)


def _least_variances(models: Sequence[RecordTorque], values: Mapping[str, float]) -> dict[str, float]:
    """Variances that no records determine a parameter better than, by inner name."""
    apart = INSTANT * max(model.record.interval for model in models)
    least = {"delay": apart, "sigma_1": apart * values["sigma_0"]}
    return {name: sigma**2 for name, sigma in least.items()}


def drift_covariance(prior: Prior, fit: Fit, drift: Prior | None) -> Array:
    """(P, P) covariance of the fit's parameters by what stage 1 may be off by, besides the prior that the fit had: as
    far as the fit followed that prior."""
    own = prior.restrict(fit.names)
    names = () if drift is None else drift.restrict(own.names).names
    if drift is None or not names:
        return np.zeros_like(fit.covariance)
    moved = np.where(np.isfinite(fit.covariance), fit.covariance, 0.0)[:, [fit.names.index(n) for n in own.names]]
    rows = own.rows()
    follows = (moved @ rows.T @ rows)[:, [own.names.index(name) for name in names]]
    return np.asarray(follows @ drift.restrict(own.names).covariance @ follows.T, dtype=np.float64)


def _is_noteworthy(honest: Uncertainty, name: str) -> bool:
    """Whether a parameter's deviation is worth a word."""
    value = LEAST_DELAY if name == "delay" else WORTH_A_WORD * abs(honest.solution.values[name])
    return honest.solution.sigma(solver_name(name)) > value


def limits(honest: Uncertainty, names: Sequence[str], fine: Sequence[RecordTorque]) -> tuple[Finding, ...]:
    """What of the records, other than the noise of the torque, limits what is determined: a warning each."""
    return (*_warn_rough_motion(honest, names, fine), *_at_odds(honest, names))


def _warn_rough_motion(honest: Uncertainty, names: Sequence[str], fine: Sequence[RecordTorque]) -> tuple[Finding, ...]:
    """A warning where the recorded motion, not the torque, limits what is determined."""
    reported = [name for name in names if name in (*PRE_SLIDING, "delay") and _is_noteworthy(honest, name)]
    rough = [name for name in reported if np.hypot(1, honest.motion[name] / honest.torque[name]) > MOTION_NOISE_RATIO]
    if not rough:
        return ()
    sources = sorted({"position" if model.motion.source == "angle" else "speed" for model in fine})
    return (Finding(
        "motion-too-coarse", "doubt",
        f"noise or steps of the recorded {' and '.join(sources)} limit {', '.join(rough)}, more than the torque's; "
        "the intervals include that as far as repeated noise and more smoothing show it, and may be too narrow: a "
        "recorded motor speed, or a position in finer steps, determines them better",
        ", ".join(rough), "a recorded motor speed, or a position in finer steps, determines them better",
    ),)  # fmt: skip


def _at_odds(honest: Uncertainty, names: Sequence[str]) -> tuple[Finding, ...]:
    """A warning where parts of the records ask for different values."""
    odd = [name for name in names if honest.at_odds[solver_name(name)] > AT_ODDS and _is_noteworthy(honest, name)]
    if not odd:
        return ()
    return (Finding(
        "records-contradict", "doubt",
        f"stretches of the records contradict each other, or stage 1, about {', '.join(odd)} by more than noise "
        "explains: friction that drifts with temperature or depends on the position, a torque that is clipped, or a "
        "motion that is too coarse; the intervals hold it",
        ", ".join(odd),
    ),)  # fmt: skip


def motion_covariance(
    models: Sequence[RecordTorque], fit: Fit, values: dict[str, float], states: Array, weights: Sequence[Array]
) -> Array:
    """(P, P) covariance of the fit's parameters by errors of the recorded motion: mean squares, bias included.

    The fit takes the motion for exact and all scatter for the torque's. A position in steps of 1 um is not exact: the
    law answers to motion that was not there, the same way in every fit of the record, so that the residuals do not show
    it. The smoothed motion is therefore recorded once more, with the noise and in the steps that its samples have, and
    the linearised fit determines how far the parameters move with that (parametric bootstrap). What smoothing takes off
    the reversals, or the samples lack, is not in it: a motion smoothed by as much more determines how far that goes.

    weights: those that the fit was made with.
    """
    reach = fit.covariance @ fit.jacobian.T
    known = np.all(np.isfinite(reach), axis=1)
    total, smoothed = np.zeros_like(fit.covariance), np.zeros(len(fit.names))
    first = 0
    for k, (model, weight) in enumerate(zip(models, weights, strict=True)):
        rows = slice(first, first + len(model.rows))
        first = rows.stop
        z, c = (float(share) for share in states[k])
        before = model.residual(values, z, c)
        others = [model.disturbed(np.random.default_rng([k, draw])) for draw in range(DRAWS)]
        moved = [
            record_torque.residual(values, z, c)
            for record_torque in (*others, model.smoother(SMOOTHER))
            if record_torque is not None
        ]
        changes = (np.stack(moved) - before) / weight[model.stretch]
        shifts = np.where(known, changes @ reach[:, rows].T, 0.0)
        total += shifts[:-1].T @ shifts[:-1] / DRAWS
        smoothed += shifts[-1]
    return np.asarray(total + np.outer(smoothed, smoothed), dtype=np.float64)


def disagreement(models: Sequence[RecordTorque], fit: Fit) -> Array:
    """(P,) factors by which stretches and prior pull parameters more than noise explains; 1 where it may be chance.

    At the optimum the pulls of all stretches and of the prior balance. Where the model is right each is noise, and the
    sum of their squares is the variance; where they contradict each other, it is larger (sandwich covariance by
    clusters; H. White, Econometrica 48, 1980).
    """
    reach = fit.covariance @ fit.jacobian.T
    known = np.all(np.isfinite(reach), axis=1)
    reach = np.where(known[:, None], reach, 0.0)
    stretches = []
    first = 0
    for model in models:
        stretches.append(first + model.stretch)
        first += len(model.parts)
    of = np.concatenate(stretches)
    pulls = np.stack([reach[:, of == k] @ fit.residuals[of == k] for k in range(first)])
    squares = np.sum(pulls**2, axis=0) + np.sum(pulls, axis=0) ** 2
    ratio = squares / np.where(known, np.diag(fit.covariance), 1.0)
    return np.asarray(np.where(known & (ratio > BY_CHANCE), np.sqrt(ratio), 1.0), dtype=np.float64)


# --- Which parameters the records of stage 2 do not determine: judged by what they hold, by bound and by value --------


GOES_WITH = "goes with"  # begins the reason of a parameter that is only held because another is
SIGNIFICANT = 2.0  # standard deviations that something must differ from what it would be without


@dataclass(frozen=True)
class Verdict:
    """Parameters that are held from here on, at which values, and why.

    name: the one that was judged; what else is held goes with it. reason: about it, without its name.
    """

    held: Mapping[str, float]
    name: str
    reason: str

    @property
    def reasons(self) -> dict[str, str]:
        """For each of those held."""
        return {name: self.reason if name == self.name else f"{GOES_WITH} {self.name}" for name in self.held}


def verdict(solution: Solution, free: Collection[str], kept: Collection[str] = ()) -> Verdict | None:
    """The one parameter, or set that belongs together, that most deserves to be held; None: all are determined.

    kept: what is free whatever its bound, because a prior determines it.
    """
    values = solution.values
    result: list[tuple[float, Verdict]] = []
    for name in free:
        # Those without a scale of their own are determined with any bound, large or small.
        lenient = name in kept or name in ANY_VALUE
        key = solver_name(name)
        if lenient and np.isfinite(solution.sigma(key)) and key not in solution.fit.at_bound:
            continue
        judged = _judge(solution, name)
        if judged is not None:
            result.append(judged)
    if not result:
        return None
    result.sort(key=lambda pair: -pair[0])
    # Damping and engagement first: they lean on the others.
    order = ("asymmetry", "gamma", "W", "C", "skew", "spread", "F_log", "F_S", "v_s", "sigma_1", "sigma_2")
    for name in order:
        for _, candidate in result:
            if name in candidate.held:
                return _complete(candidate, free, values)
    return _complete(result[0][1], free, values)


def _judge(solution: Solution, name: str) -> tuple[float, Verdict] | None:
    """How vague a parameter is and the verdict on it; None: it is determined well enough."""
    key = solver_name(name)
    value = solution.fit[key]
    sigma = solution.sigma(key)
    if name == "gamma" and value > 1 - SIGNIFICANT * min(sigma, 0.25):
        why = f"no engaging zone shows, the full stiffness acts at once after reversals (gamma {value:.3g})"
        return np.inf, Verdict({"gamma": 1.0}, name, why)
    if name in ("sigma_1", "sigma_2", "F_log", "F_S") and value <= 1e-9 * max(abs(solution.values["F_C"]), 1e-300):
        why = "the record fits best without (0 is the least that is physical)"
        return np.inf, Verdict({name: 0.0}, name, why)
    if not np.isfinite(sigma):
        return np.inf, Verdict({name: value}, name, "the record does not answer to it")
    if key in solution.fit.at_bound:
        why = f"the fit ends at the end of its range ({value:.3g} {PARAMETER_KINDS[parameter_name(key)].unit})"
        return np.inf, Verdict({name: value}, name, why)
    half = half_width(sigma)
    # A Stribeck peak that is not determined is an artefact of what happens within a few rows of the reversals.
    if not (is_determined(value, half) if name in ("F_S", "v_s") else is_significant(value, half)):
        why = reason(value, half, "F_S - F_C" if name == "F_S" else "")
        return half / max(abs(value), 1e-300), Verdict({name: value}, name, why)
    return None


def _complete(judged: Verdict, free: Collection[str], values: Mapping[str, float]) -> Verdict:
    """What goes with it: W and gamma only make sense together, so do F_S and v_s."""
    fixed = dict(judged.held)
    if {"W", "gamma"} & set(fixed):
        fixed = {name: NO_EFFECT[name] for name in ("W", "gamma") if name in free}
    if {"F_S", "v_s"} & set(fixed):
        fixed = {name: values["F_C"] if name == "F_S" else values["v_s"] for name in ("F_S", "v_s") if name in free}
    if "spread" in fixed:  # what the shares lean on
        fixed |= {"skew": NO_EFFECT["skew"]} if "skew" in free else {}
    for name in ("sigma_1", "sigma_2", "F_log", "asymmetry", "skew"):
        if name in fixed:
            fixed[name] = NO_EFFECT[name]
    return Verdict(fixed, judged.name, judged.reason)


def no_delay(models: Sequence[RecordTorque], solution: Solution, free: Collection[str]) -> Verdict | None:
    """On a delay that the records leave open by more than a row, or that makes the torque earlier than a control can: a
    command that is held from its instant on leads by half of that, and no row stands for more than its interval."""
    if "delay" not in free:
        return None
    interval = max(model.record.interval for model in models)
    delay, reach = solution.values["delay"], half_width(solution.sigma("delay"))
    if delay + reach < -interval:
        why = f"the fit makes the torque {-1e3 * delay:.2g} ms earlier than the motion, which no control does"
    elif reach > interval:
        why = f"its 95 % interval is +-{1e3 * reach:.2g} ms, which is more than a row"
    else:
        return None
    return Verdict({"delay": 0.0}, "delay", f"{why}: give it by --delay")


LEAST_EXPLAINED = 0.01  # of the torque's rms: interpolation, ripple and held commands are not modelled to better
# of the log from a reversal until the bristles have turned over, to determine damping or engaging zone
MIN_TURNOVER_ROWS = 5.0
LEAST_REVERSALS = 4  # to determine the delay of the torque: at each it could also be the bristles'
FAST_SPEED_SHARE = 0.05  # of the top speed: what a direction of motion must reach to count


def has_sines(models: Sequence[RecordTorque]) -> bool:
    """Whether any of the stretches is a sine."""
    return any(part.kind == "sine" for model in models for part in model.parts)


def explained_share(models: Sequence[RecordTorque], solution: Solution, tried: Solution) -> float:
    """How much the residual falls from one solution to the other, in squares, as a share of the torque's rms [1]."""
    squares = torque = 0.0
    for k, model in enumerate(models):
        ends = [
            model.residual(one.values, float(one.states[k, 0]), float(one.states[k, 1])) for one in (solution, tried)
        ]
        squares += float(np.sum(ends[0] ** 2) - np.sum(ends[1] ** 2))
        torque += float(np.sum(model.measured**2))
    return float(np.sqrt(max(squares, 0.0) / max(torque, 1e-300)))


def turnover_rows(models: Sequence[RecordTorque], solution: Solution) -> float:
    """Median number of rows from a reversal until the axis has travelled twice the bristles' deflection."""
    way = 2 * deflection(solution.values)
    counts = []
    for model in models:
        n, h = model.motion.coarse(), model.record.interval
        travelled = np.concatenate([[0.0], np.cumsum(np.abs(n[1:] + n[:-1]) / 2) * h])
        for first in _reversals(model):
            last = int(np.searchsorted(travelled, travelled[first] + way))
            counts.append(last - first)
    return float(np.median(counts)) if counts else 0.0


def reversals(models: Sequence[RecordTorque]) -> int:
    """How often the axes turn round, from one direction at speed to the other."""
    return sum(len(_reversals(model)) for model in models)


def _reversals(model: RecordTorque) -> list[int]:
    """Rows at which the speed changes its sign between two directions that are both driven at speed."""
    n = model.motion.coarse()
    fast = np.flatnonzero(np.abs(n) > FAST_SPEED_SHARE * np.max(np.abs(n)))
    sides = np.sign(n[fast])
    turns = np.flatnonzero(sides[1:] != sides[:-1])
    indexes = []
    for k in turns:
        between = n[fast[k] : fast[k + 1] + 1] * sides[k]
        indexes.append(int(fast[k] + np.argmax(between <= 0)))
    return indexes


def warn_extrapolation(
    fine: Sequence[RecordTorque], prior: Stationary | None, I_P: float | None
) -> tuple[Finding, ...]:
    """A warning where sines alone determine the friction over speed."""
    if prior is not None or not has_sines(fine):
        return ()
    top = max(float(np.max(np.abs(model.moved(0.0)[1]))) for model in fine)
    shown = f"{top:.3g} rad/s" if I_P is None else f"{60e3 * top * I_P:.3g} mm/min"
    return (Finding(
        "curve-extrapolated", "doubt",
        f"the records of sines determine the friction up to {shown}, their highest speed: above it is extrapolated and "
        "not to be relied on; strokes at constant speed determine the curve",
        "", "strokes at constant speed determine the curve",
    ),)  # fmt: skip


def warn_undetermined(fixed: Mapping[str, tuple[Status, str]], prior: Stationary | None) -> tuple[Finding, ...]:
    """What is undetermined and why, a finding per reason; what stage 1 hands on it has said itself."""
    names: dict[str, list[str]] = {}
    for name, (status, why) in fixed.items():
        before = prior.estimates.get(name) if prior is not None else None
        handed_on = before is not None and (before.status, before.reason) == (status, why)
        if status == "undetermined" and why and not handed_on and not why.startswith(GOES_WITH):
            names.setdefault(why, []).append(name)
    return tuple(
        Finding("parameter-undetermined", "doubt", f"{' and '.join(name)}: {why}", ", ".join(name))
        for why, name in names.items()
    )
