"""Which parts a model of an axis has: those with which a fit predicts motion better that it has not seen.

Parts of the friction law and elastic modes are added one after the other, as long as cross-validation supports them.
Start reading at friction_parts().
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from math import inf, log

import numpy as np

from feedsim.errors import InputError
from feedsim.identify.parameters import EXCESS
from feedsim.identify.position_loop import rms
from feedsim.replay.elastic import MOST_MODES, begin_mode, resonance
from feedsim.replay.tuning import Problem, Rows, Tuned
from feedsim.trace.trace import Array

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
FAST = 0.1  # of the top speed: what is faster is another kind of motion
BETTER = 2.0  # of the logarithm of the likelihood: what predicts hardly better is not worth having
INDEPENDENT_TIME = 0.05  # [s]: residuals further apart than that are taken to be independent


def friction_parts(
    problem: Problem, tuned: Tuned, progress: Progress
) -> tuple[tuple[str, ...], dict[str, float], Tuned, list[Tuned]]:
    """Parts of the friction law that the record asks for: chosen, the gain of each, a fit with them, and the fits with
    one part more that predict as well as that: the record decides for neither."""
    gains: dict[str, float] = {}
    undecided: list[Tuned] = []
    chosen: list[str] = []
    while len(chosen) < len(BLOCKS):
        progress("cross-validation", 1 + len(chosen), 2 + len(BLOCKS))
        # As near to its end as what it is compared with.
        tuned = problem.exact(problem.fitted(tuned.names, tuned.values, tuned))
        score = _predicted(problem, tuned)
        tried = {}
        for part, block in BLOCKS.items():
            if part in chosen:
                continue
            begin = {**tuned.values, **{name: _begin(problem, name) for name in block}}
            tried[part] = problem.fitted([*tuned.names, *block], begin, tuned)
            if _at_end(problem, tried[part], block):
                gains[part] = -inf
                continue
            tried[part] = problem.exact(tried[part])
            by = _predicted(problem, tried[part]) - score
            # Both partitions ask for it: what one gains at the other's cost is no law.
            gains[part] = float(np.sum(by) if np.all(by > 0) else np.min(by))
        asked = [part for part in tried if gains[part] >= BETTER]
        if not asked:
            undecided = [value for part, value in tried.items() if gains[part] > -BETTER]
            break
        chosen.append(asked[0])
        tuned = tried[asked[0]]
        problem.weigh(tuned)
    return tuple(chosen), gains, tuned, undecided


def with_elastic_modes(problem: Problem, result: Tuned, count: int | None) -> tuple[Tuned, Mapping[int, float]]:
    """A fit with elastic modes, and the position [m] that it predicts of quarters of the motion with how many.

    One mode after the other: where it is, regression says of what the units leave. It stays where the units, fitted to
    three quarters, predict the fourth one better with it, or where the number is given.
    """
    folds = np.array_split(np.arange(len(problem.rows)), FOLDS)
    result = problem.exact(result)
    predicted = {0: unpredicted(problem, result, folds)[0] * problem.weights["position"]}
    for k in range(1, (MOST_MODES if count is None else count) + 1):
        machine, scale = problem.tuned(result.values)
        simulated = problem.replay.follow(machine, ("x_a",), problem.per_row, scale)[problem.each.axis]["x_a"]
        K_v = (problem.start | dict(result.values))["K_v"]
        one = resonance(problem.each, simulated, problem.per_row, K_v)
        if one is None:
            break
        before, start = result, dict(problem.start)
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
        predicted[k] = unpredicted(problem, fit, folds)[0] * problem.weights["position"]
        if count is None and not gain > BETTER:
            problem.start = start
            break
        result = fit
        problem.weigh(result)
        result = problem.exact(problem.fitted(result.names, result.values, result))
    return result, predicted


def _begin(problem: Problem, name: str) -> float:
    F_C = problem.start["F_C"]
    return {"F_log": 0.1 * F_C, "gamma": 0.5, EXCESS: 0.1 * F_C, "asymmetry": 0.0}.get(name, problem.start[name])


def _at_end(problem: Problem, tuned: Tuned, block: Sequence[str]) -> bool:
    """Whether a part sits at a bound: the record does not determine it."""
    return any(problem.no_effect(name, tuned.values[name]) for name in block)


def _predicted(problem: Problem, tuned: Tuned) -> Array:
    """(2,) logarithm of the likelihood of every part of the motion, predicted from the others.

    Parts are stretches of time, and then kinds of motion: either direction, slow and fast. What predicts only motion
    that it has seen elsewhere is no law. The fit to the others is a Gauss-Newton step away from the one to all.
    """
    speed = problem.each.speed[problem.rows]
    kinds = 2 * (speed > 0) + (np.abs(speed) > FAST * np.max(np.abs(speed)))
    every = np.arange(len(speed))
    partitions = np.array_split(every, FOLDS), [every[kinds == kind] for kind in np.unique(kinds)]
    return np.array([_likelihood(problem, tuned, folds) for folds in partitions if len(folds) > 1])


def _likelihood(problem: Problem, tuned: Tuned, folds: Sequence[Rows]) -> float:
    """Of the folds, each predicted from the others."""
    count = sum(map(len, folds))
    position, torque = unpredicted(problem, tuned, folds)
    return -independent(problem, count) * (log(position) + log(torque))


def unpredicted(problem: Problem, tuned: Tuned, folds: Sequence[Rows]) -> tuple[float, float]:
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
