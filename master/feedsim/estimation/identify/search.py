"""The least-squares problem of the output-error fit: its first values, which parameters move, their bounds."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from feedsim.estimation.fit import Fit, fit
from feedsim.estimation.identify.inertia import REST_SPEED_SHARE
from feedsim.estimation.identify.motion import START_PRIOR, STARTS, RecordTorque
from feedsim.estimation.identify.parameters import EXCESS, inner_to_outer, reversal_ranges, solver_name
from feedsim.estimation.identify.record import Array
from feedsim.estimation.least_squares import correlation_length
from feedsim.estimation.parameter import Parameter, Prior
from feedsim.foundation.errors import InputError, SimulationError
from feedsim.foundation.parallel import cores, in_threads

REACH = {"z": 1.0, "c": 0.5}
VALLEYS, REACHED = 6, 1.5  # tried beside a solution, drawn within so many standard deviations of it
MAX_LOG_DEVIATION = 3.0  # of the logarithm, where a standard deviation is larger
VALLEY_TOLERANCE = 1e-6  # of cost and step there
START_TOLERANCE = 1e-3  # tolerance of cost and step to compare starts
FOLLOWED_STARTS = 3  # of the starts; as many again where none of them explains the torque
# Mean square of the residuals over the weights up to which they are noise: wrong valleys leave 5 to 50
MAX_NOISE_RESIDUAL = 2.0


def with_excess(prior: Prior) -> Prior:
    """The prior of F_C, F_S as one of F_C, F_S - F_C."""
    if not {"F_C", "F_S"} <= set(prior.names):
        return prior
    turn = np.eye(len(prior.names))
    turn[prior.names.index("F_S"), prior.names.index("F_C")] = -1
    names = tuple(solver_name(name) for name in prior.names)
    return Prior(names, turn @ prior.values, turn @ prior.covariance @ turn.T)


@dataclass(frozen=True, eq=False)
class Solution:
    """values: every parameter's, by name. states: (records, 2) z, c at the begin, as shares. fit: of inner names."""

    values: dict[str, float]
    states: Array
    fit: Fit

    def covariance(self, names: Sequence[str]) -> Array:
        """Of parameters by their own names, all of them free."""
        turn = inner_to_outer(self.fit.names, names)
        used = np.any(turn != 0, axis=0)
        return np.asarray(turn[:, used] @ self.fit.covariance[np.ix_(used, used)] @ turn[:, used].T, dtype=np.float64)

    def sigma(self, name: str) -> float:
        """Standard deviation of a parameter by its inner name (`excess` for F_S)."""
        return self.fit.sigma[name]


class Search:
    """Fits of the same models with the same priors, with ever other parameters free.

    Attributes:
        models, priors: what is fitted and what is known before.
        weights: per model, standard deviation of the residuals of each of its stretches [N.m].
        jumps: whether the law's torque jumps with its parameters, as that of elements that slip or hardly do not.
    """

    def __init__(self, models: Sequence[RecordTorque], prior: Prior, weights: Sequence[Array]) -> None:
        self.models, self.prior, self.weights = tuple(models), with_excess(prior), tuple(weights)
        self.jumps = "spread" in self.models[0].law.names

    def residuals(self, values: Mapping[str, float], states: Array) -> list[Array]:
        """Per model, (rows,) over their weights."""
        return [
            model.residual(values, float(state[0]), float(state[1])) / weight[model.stretch]
            for model, weight, state in zip(self.models, self.weights, states, strict=True)
        ]

    def cost(self, solution: Solution) -> float:
        """Sum of squares of the residuals at a solution, without the prior's."""
        return float(sum(np.sum(part**2) for part in self.residuals(solution.values, solution.states)))

    def best(self, starts: Sequence[Mapping[str, float]], states: Array, free: Sequence[str]) -> Solution:
        """Where the best of the starts arrives, the likeliest of which come first."""
        solutions: list[Solution] = []
        for first in range(0, min(len(starts), 2 * FOLLOWED_STARTS), FOLLOWED_STARTS):
            followed = starts[first : first + FOLLOWED_STARTS]
            solutions += [self.solve(start, states, free, tolerance=START_TOLERANCE, limit=12) for start in followed]
            best = min(solutions, key=lambda one: one.fit.cost)
            if 2 * best.fit.cost <= MAX_NOISE_RESIDUAL * len(best.fit.residuals):
                break
        return best

    def search_around(self, solution: Solution, free: Sequence[str]) -> Solution:
        """The best of the valleys beside a solution; what is about as likely as it is in its covariance.

        Where an element hardly begins to slip, or hardly does not, its torque jumps with the parameters: the sum of
        squares has valleys side by side, nearer to each other than a standard deviation. A model that does not jump
        keeps its solution.
        """
        if not self.jumps:
            return solution
        random = np.random.default_rng(0)
        logarithmic = {name for name, one in reversal_ranges(solution.values).items() if one.get("log")}
        best, found = solution, [solution]
        for _ in range(VALLEYS):
            moves = dict(
                zip(
                    best.fit.names,
                    REACHED * _root(best.fit.covariance) @ random.standard_normal(len(best.fit.names)),
                    strict=True,
                )
            )
            point = {**best.values, EXCESS: best.values["F_S"] - best.values["F_C"]}
            for name in map(solver_name, free):
                if name in logarithmic:
                    point[name] *= float(
                        np.exp(np.clip(moves[name] / point[name], -MAX_LOG_DEVIATION, MAX_LOG_DEVIATION))
                    )
                else:
                    point[name] += moves[name]
            point["F_S"] = point["F_C"] + max(point.pop(EXCESS), 0.0)
            found.append(self.solve(point, best.states, free, tolerance=VALLEY_TOLERANCE, limit=30))
            best = min(best, found[-1], key=lambda one: one.fit.cost)
        likely = np.exp([best.fit.cost - one.fit.cost for one in found])
        apart = np.stack([one.fit.values - best.fit.values for one in found])
        scatter = (apart * likely[:, None]).T @ apart / np.sum(likely)
        return replace(best, fit=replace(best.fit, covariance=best.fit.covariance + scatter))

    def solve(
        self, values: Mapping[str, float], states: Array, free: Sequence[str], *, tolerance: float, limit: int
    ) -> Solution:
        """Best values of `free` from `values` on."""
        begin = {**values, EXCESS: max(values["F_S"] - values["F_C"], 0.0)}
        ranges = reversal_ranges(begin)
        parameters = [
            Parameter(solver_name(name), begin[solver_name(name)], **ranges[solver_name(name)]) for name in free
        ]
        starts = [(k, name) for k in range(len(self.models)) for name in STARTS]
        parameters += [
            Parameter(f"{name}_{k}", float(states[k, STARTS.index(name)]), -REACH[name], REACH[name], scale=REACH[name])
            for k, name in starts
        ]
        loose = Prior(
            tuple(f"{name}_{k}" for k, name in starts),
            np.zeros(len(starts)),
            np.diag([START_PRIOR[name] ** 2 for _, name in starts]),
        )

        def full(moved: Mapping[str, float]) -> tuple[dict[str, float], Array]:
            point = dict(values)
            point |= {name: moved[name] for name in free if name in moved}
            if EXCESS in moved:
                point["F_S"] = point["F_C"] + moved[EXCESS]
            elif "F_C" in moved:
                point["F_S"] = point["F_C"] + begin[EXCESS]
            shares = np.array([[moved[f"{name}_{k}"] for name in STARTS] for k in range(len(self.models))])
            return point, shares

        def residuals(moved: Mapping[str, float]) -> Array:
            return np.concatenate(self.residuals(*full(moved)))

        def prepare(sets: Sequence[Mapping[str, float]]) -> None:
            self._work_ahead([full(moved) for moved in sets])

        result = fit(
            residuals,
            parameters,
            prepare=prepare,
            prior=Prior.join([self.prior, loose]),
            difference=1e-3 if self.jumps else 1e-5,
            jumps=self.jumps,
            tolerance=tolerance,
            limit=limit,
        )
        point, shares = full(result.mapping())
        return Solution(point, shares, result)

    def _work_ahead(self, points: Sequence[tuple[Mapping[str, float], Array]]) -> None:
        """Let the models know the friction at parameters and states that are asked for next: side by side, as many as
        there are cores at once."""
        work = [
            (model, *one)
            for k, model in enumerate(self.models)
            for one in model.work_ahead(
                [(values, float(states[k, 0]), float(states[k, 1])) for values, states in points], cores()
            )
        ]
        try:
            done = in_threads(lambda task: task[0].respond(*task[1:]), work)
        except (InputError, SimulationError):
            return  # the one that has none says so when it is asked for
        for (model, _, asked), responses in zip(work, done, strict=True):
            model.remember(asked, responses)


def _root(covariance: Array) -> Array:
    """(P, P) that makes white numbers those of a covariance; 0 for what has no finite variance."""
    usable = np.isfinite(np.diag(covariance))
    strength, directions = np.linalg.eigh(np.where(np.outer(usable, usable), covariance, 0.0))
    return np.asarray(directions * np.sqrt(np.maximum(strength, 0.0)))


def spread(residual: Array) -> float:
    """Standard deviation of residuals (N,) of a stretch as if every row were independent, single outliers cut.

    Residuals that are correlated over time, which is the model's error and not noise, determine less than their number
    says: their variance counts as often as rows count as one.
    """
    scale = 1.4826 * float(np.median(np.abs(residual)))
    cut = np.clip(residual, -4 * scale, 4 * scale) if scale > 0 else residual
    return float(np.sqrt(np.mean(cut**2) * correlation_length(cut)))


SLIDING_SPEED_SHARE = 0.1  # of the highest speed: above, the friction is taken as Coulomb plus viscous
AFTER_REVERSAL = 3  # rows: what the stiffest bristle that a record can show deflects in
PER_DECADE = 3  # starts of the stiffness
MOST_STIFFNESSES = 10
ZONES = (3.0, 7.0, 14.0)  # width of the engaging zone over the largest deflection F_C/sigma_0
GAMMA_STARTS = (0.25, 0.6)  # gamma
PURE = (0.0, 1.0)  # W and gamma of pure LuGre
SPREADS, SKEWS = (5.0, 10.0, 20.0, 40.0, 80.0), (-0.4, 0.0, 0.4, 0.8)  # of the elements of Maxwell slip


def fit_sliding_friction(
    models: Sequence[RecordTorque], values: Mapping[str, float], unknown: Collection[str]
) -> dict[str, float]:
    """J, sigma_2, F_C and M_0, as far as they are `unknown`, by linear least squares where the axis slides.

    Moves that hardly slide leave F_C: the largest friction torques (95 % of them lie below) stand for it.
    """
    rows = [model.moved(values["delay"]) for model in models]
    speed = np.concatenate([row[1] for row in rows])
    acceleration = np.concatenate([row[2] for row in rows])
    torque = np.concatenate([model.measured - row[3] for model, row in zip(models, rows, strict=True)])
    fast = np.abs(speed) > SLIDING_SPEED_SHARE * np.max(np.abs(speed))
    # fast in one direction only: what is slow in the other one determines the load
    if np.ptp(np.sign(speed[fast])) == 0:
        fast = np.abs(speed) > REST_SPEED_SHARE * np.max(np.abs(speed))
    shapes = {"J": acceleration, "sigma_2": speed, "F_C": np.sign(speed), "M_0": np.ones_like(speed)}
    names = [name for name in shapes if name in unknown]
    if not names:
        return {}
    known = sum((values[name] * shapes[name] for name in shapes if name not in unknown), np.zeros_like(speed))
    matrix = np.column_stack([shapes[name] for name in names])[fast]
    scale = np.linalg.norm(matrix, axis=0)
    weights = np.linalg.lstsq(matrix / scale, (torque - known)[fast], rcond=None)[0] / scale
    result = dict(zip(names, map(float, weights), strict=True))
    if "J" in result and result["J"] <= 0:
        result["J"] = 1e-3 * float(np.std(torque) / max(np.std(acceleration), 1e-300))
    if "sigma_2" in result:
        result["sigma_2"] = max(result["sigma_2"], 0.0)
    if "F_C" in result and not result["F_C"] > 0:
        inertia = result.get("J", values["J"]) * acceleration
        result["F_C"] = float(np.quantile(np.abs(torque - inertia - result.get("M_0", values["M_0"])), 0.95))
    return result


def stiffnesses(models: Sequence[RecordTorque], values: Mapping[str, float]) -> Array:
    """Starts of sigma_0 [N.m/rad], in equal ratios.

    The least: the range of the friction torque over that of the angle, where that is largest (no spring of a bristle is
    softer than what the smallest move shows). The most: the friction turns round within a few rows of a reversal.
    """
    least, steps = 0.0, []
    for model in models:
        friction = model.friction_measured(values)
        speed = model.moved(values["delay"])[1]
        travelled_to = np.asarray(model.motion.speed.antiderivative()(model.motion.time))[model.rows]
        for k in range(len(model.parts)):
            own = np.flatnonzero(model.stretch == k)
            angle = travelled_to[own]
            reach = float(np.quantile(friction[own], 0.98) - np.quantile(friction[own], 0.02))
            least = max(least, reach / max(float(np.ptp(angle)), 1e-300))
            turns = np.flatnonzero(speed[own][1:] * speed[own][:-1] < 0) + 1
            turns = turns[turns + AFTER_REVERSAL < len(own)]
            steps.append(np.abs(angle[turns + AFTER_REVERSAL] - angle[turns]))
    travelled = np.concatenate(steps) if steps else np.zeros(0)
    most = 4 * least
    if len(travelled) and np.median(travelled) > 0:
        most = max(most, 2 * values["F_C"] / float(np.median(travelled)))
    count = int(np.clip(round(PER_DECADE * np.log10(most / least)) + 1, 4, MOST_STIFFNESSES))
    return np.geomspace(least, most, count)


def grid(models: Sequence[RecordTorque], values: Mapping[str, float], free: Collection[str]) -> list[dict[str, float]]:
    """The best sets of sigma_0, sigma_1, W, gamma (spread, skew) of a grid, each of another shape; the best one first.

    The law is linear in sigma_1: its best value comes with every point of the grid. Parameters that are not free keep
    their values.
    """
    zones = [PURE, *((zone, share) for zone in ZONES for share in GAMMA_STARTS)]
    shapes: Sequence[tuple[float, float] | None] = [None]
    engaging = {"W", "gamma"} <= set(free)
    if engaging:
        shapes = zones
    elif {"spread", "skew"} <= set(free):
        shapes = [(spread, skew) for spread in SPREADS for skew in SKEWS]
    levels = stiffnesses(models, values) if "sigma_0" in free else np.array([values["sigma_0"]])
    result: list[tuple[float, dict[str, float]]] = []
    for shape in shapes:
        best: tuple[float, dict[str, float]] | None = None
        for sigma_0 in levels:
            trial = {**values, "sigma_0": float(sigma_0)}
            if shape is not None and engaging:
                trial |= {"W": shape[0] * values["F_C"] / float(sigma_0), "gamma": shape[1]}
            elif shape is not None:
                trial |= {"spread": shape[0], "skew": shape[1]}
            cost = _fit_damping(models, trial, "sigma_1" in free)
            if best is None or cost < best[0]:
                best = cost, trial
        assert best is not None
        result.append(best)
    result.sort(key=lambda pair: pair[0])
    return [trial for _, trial in result]


def _fit_damping(models: Sequence[RecordTorque], trial: dict[str, float], free: bool) -> float:
    """Sum of squares over the stretches' torque power, with the best sigma_1 put into the trial."""
    ends = []
    for sigma_1 in (0.0, 1.0) if free else (trial["sigma_1"],):
        trial["sigma_1"] = sigma_1
        ends.append(
            np.concatenate([model.residual(trial, 0.0, 0.0) / model.recorded_rms()[model.stretch] for model in models])
        )
    if not free:
        return float(np.sum(ends[0] ** 2))
    slope = ends[1] - ends[0]
    trial["sigma_1"] = max(0.0, -float(slope @ ends[0]) / max(float(slope @ slope), 1e-300))
    return float(np.sum((ends[0] + trial["sigma_1"] * slope) ** 2))
