"""How far what was found can be relied on: what the scatter of the torque does not determine of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from feedsim.estimation.fit import Fit
from feedsim.estimation.parameter import Prior
from feedsim.identify.motion import RecordTorque
from feedsim.identify.parameters import PRE_SLIDING, inner
from feedsim.identify.record import Array
from feedsim.identify.search import Search, Solution

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
    wanted = (*left_open, _least(search.models, solution.values))
    most = [max(float(v), *(values.get(n, 0.0) for values in wanted)) for n, v in zip(fit.names, variance, strict=True)]
    usable = np.isfinite(variance) & (variance > 0)
    wider = np.sqrt(np.where(usable, most, 1.0) / np.where(usable, variance, 1.0))
    covariance = np.where(np.isfinite(covariance), covariance * np.outer(wider, wider), covariance)
    by_name = [dict(zip(fit.names, map(float, values), strict=True)) for values in (np.sqrt(np.diag(motion)), factor)]
    return Uncertainty(replace(solution, fit=replace(fit, covariance=covariance)), fit.sigma, *by_name)


def _least(models: Sequence[RecordTorque], values: Mapping[str, float]) -> dict[str, float]:
    """Variances that no records determine a parameter better than, by inner name."""
    apart = INSTANT * max(model.record.interval for model in models)
    least = {"delay": apart, "sigma_1": apart * values["sigma_0"]}
    return {name: sigma**2 for name, sigma in least.items()}


def drift_covariance(prior: Prior, fit: Fit, drift: Prior | None) -> Array:
    """(P, P) covariance of the fit's parameters by what stage 1 may be off by, besides the prior that the fit had: as
    far as the fit followed that prior."""
    own = prior.restricted(fit.names)
    names = () if drift is None else drift.restricted(own.names).names
    if drift is None or not names:
        return np.zeros_like(fit.covariance)
    moved = np.where(np.isfinite(fit.covariance), fit.covariance, 0.0)[:, [fit.names.index(n) for n in own.names]]
    rows = own.rows()
    follows = (moved @ rows.T @ rows)[:, [own.names.index(name) for name in names]]
    return np.asarray(follows @ drift.restricted(own.names).covariance @ follows.T, dtype=np.float64)


def _matters(honest: Uncertainty, name: str) -> bool:
    """Whether a parameter's deviation is worth a word."""
    value = LEAST_DELAY if name == "delay" else WORTH_A_WORD * abs(honest.solution.values[name])
    return honest.solution.sigma(inner(name)) > value


def limits(honest: Uncertainty, names: Sequence[str], fine: Sequence[RecordTorque]) -> tuple[str, ...]:
    """What of the records, other than the noise of the torque, limits what is determined: a warning each."""
    return (*_rough(honest, names, fine), *_at_odds(honest, names))


def _rough(honest: Uncertainty, names: Sequence[str], fine: Sequence[RecordTorque]) -> tuple[str, ...]:
    """A warning where the recorded motion, not the torque, limits what is determined."""
    reported = [name for name in names if name in (*PRE_SLIDING, "delay") and _matters(honest, name)]
    rough = [name for name in reported if np.hypot(1, honest.motion[name] / honest.torque[name]) > MOTION_NOISE_RATIO]
    if not rough:
        return ()
    sources = sorted({"position" if model.motion.source == "angle" else "speed" for model in fine})
    return (
        f"noise or steps of the recorded {' and '.join(sources)} limit {', '.join(rough)}, more than the torque's; "
        "the intervals include that as far as repeated noise and more smoothing show it, and may be too narrow: a "
        "recorded motor speed, or a position in finer steps, determines them better",
    )


def _at_odds(honest: Uncertainty, names: Sequence[str]) -> tuple[str, ...]:
    """A warning where parts of the records ask for different values."""
    odd = [name for name in names if honest.at_odds[inner(name)] > AT_ODDS and _matters(honest, name)]
    if not odd:
        return ()
    return (
        f"stretches of the records contradict each other, or stage 1, about {', '.join(odd)} by more than noise "
        "explains: friction that drifts with temperature or depends on the position, a torque that is clipped, or a "
        "motion that is too coarse; the intervals hold it",
    )


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
