"""Stationary friction from plateaus: weighted least squares of Eq. 7, the viscous part and the constant load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import nan

import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import chi2, f

from feedsim.estimation.fit import Fit, correlation, fit, inverse
from feedsim.estimation.identify.parameters import (
    CONSTANT_SPEED,
    DEFAULT_SHAPES,
    EXCESS,
    NO_EFFECT,
    PRIOR_DEVIATIONS,
    UNSEEN_SPEED_RATIO,
    check_fixed,
    curve,
    estimate,
    hidden_deviation,
    inner_to_outer,
    level,
    parameter_name,
    plateau_ranges,
    solver_name,
    torque,
)
from feedsim.estimation.identify.record import Array
from feedsim.estimation.identify.result import Correlation, Plateau, Stationary, Status
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.estimation.parameter import Parameter
from feedsim.foundation.errors import Finding, InputError

# --- What plateaus cannot determine: parameters that are held for it, and warnings with their reason ------------------


SAME_SPEED = 0.05  # relative difference up to which plateaus count as one speed
FEW_SPEEDS = 8
SLOW_ENOUGH = 50e-3 / 60  # m/s: a lowest speed above leaves the Stribeck range open at its lower end
# Relative standard deviation of v_s that asks whether there is a Stribeck effect at all, and for a warning.
V_S_WARNED = 0.3
FALL_SIGMAS = 2.0  # standard deviations that a fall of torque over speed must have
SAME_PARAMETER_CORRELATION = 0.99  # correlation above which two parameters are one
SEPARATING_LEVEL_RANGE = 0.05  # range of the level over its mean that separates an asymmetry from a constant load


@dataclass(frozen=True, eq=False)
class Points:
    """Plateaus as arrays (K,): speed [rad/s], torque [N.m], sigma [N.m], age [1] from the first one at 0 to the last
    one at 1; and their distinct speeds (S,) [rad/s]."""

    speed: Array
    torque: Array
    sigma: Array
    age: Array
    speeds: Array

    @classmethod
    def of(cls, plateaus: Sequence[Plateau]) -> Points:
        """No plateau's torque counts as known better than 2e-5 of it: rounding of the trace lies there."""
        torque = np.array([plateau.torque for plateau in plateaus])
        sigma = np.hypot([plateau.sigma for plateau in plateaus], 2e-5 * np.max(np.abs(torque)))
        speed = np.array([plateau.speed for plateau in plateaus])
        ordered = np.sort(np.abs(speed))
        starts = np.concatenate([[True], np.diff(ordered) > SAME_SPEED * ordered[1:]])
        groups = np.cumsum(starts) - 1
        elapsed = np.array([plateau.elapsed for plateau in plateaus])
        age = (elapsed - np.min(elapsed)) / (float(np.ptp(elapsed)) or 1.0)
        return cls(speed, torque, sigma, age, np.bincount(groups, weights=ordered) / np.bincount(groups))

    @property
    def both(self) -> bool:
        """Whether there are plateaus in both directions."""
        return bool(np.any(self.speed > 0) and np.any(self.speed < 0))

    def friction(self) -> tuple[Array, Array]:
        """(S,) mean |torque| per speed, and its standard deviation: free of M_0 where both directions are there."""
        nearest = np.argmin(np.abs(np.abs(self.speed)[:, None] - self.speeds[None, :]), axis=1)
        means, sigmas = [], []
        for k in range(len(self.speeds)):
            sides = [(nearest == k) & (np.sign(self.speed) == side) for side in (1.0, -1.0)]
            result = [np.mean(np.abs(self.torque[side])) for side in sides if np.any(side)]
            means.append(float(np.mean(result)))
            sigmas.append(float(np.sqrt(np.mean(self.sigma[nearest == k] ** 2) / np.sum(nearest == k))))
        return np.array(means), np.array(sigmas)


def shows_stribeck_effect(points: Points) -> bool:
    """Whether the torque falls with speed somewhere: the Stribeck effect shows."""
    torque, sigma = points.friction()
    for slow in range(len(torque)):
        drop = torque[slow] - torque[slow + 1 :]
        if np.any(drop > FALL_SIGMAS * np.hypot(sigma[slow], sigma[slow + 1 :])):
            return True
    return False


def too_few(points: Points, free: Sequence[str]) -> dict[str, str]:
    """Curve parameters among `free` that so few speeds do not determine, name -> reason: more than there are speeds."""
    count = len(points.speeds)
    result: dict[str, str] = {}
    ranks = ["F_C", EXCESS, "sigma_2", "F_log", "v_s", "v_log", "beta"]
    if not shows_stribeck_effect(points) and count < 6:
        reason = f"the torque does not fall with speed at any of {count} speed(s): no Stribeck effect shows"
        result |= {name: reason for name in (EXCESS, "v_s", "beta") if name in free}
    wanted = [name for name in ranks if name in free and name not in result]
    few = f"{count} speed(s) do not determine {len(wanted)} parameters of the curve"
    result |= {name: few for name in wanted[count:]}
    wanted = wanted[:count]
    load = [name for name in ("M_0", "asymmetry") if name in free and points.both]
    if "asymmetry" in load and (count < 2 or len(wanted) + len(load) > len(points.speed)):
        load.remove("asymmetry")
        result["asymmetry"] = (
            f"{len(points.speed)} plateau(s) at {count} speed(s) do not separate it from the constant load M_0"
        )
    room = max(len(points.speed) - len(load), 1)
    return result | {name: f"{len(points.speed)} plateaus do not determine more" for name in wanted[room:]}


def unseparated_parameters(points: Points) -> dict[str, str]:
    """M_0 and asymmetry where one direction is missing."""
    if points.both:
        return {}
    return {name: "plateaus in one direction only do not separate it from friction" for name in ("M_0", "asymmetry")}


def undetermined_parameters(points: Points, fit: Fit, values: dict[str, float]) -> dict[str, str]:
    """Free parameters that the fit shows to be untold: they are held then, name -> reason."""
    reported: dict[str, str] = {}
    free = set(fit.names)
    if "v_s" in free and points.speeds[0] > 3 * values["v_s"]:
        reason = (
            f"no plateau lies within the Stribeck range: the lowest speed is {points.speeds[0]:.3g} rad/s, "
            f"v_s is about {values['v_s']:.2g} rad/s or less"
        )
        reported |= {name: reason for name in ("v_s", EXCESS, "beta") if name in free}
    if "v_s" in free and values[EXCESS] <= 0:
        reported |= {name: "no Stribeck effect: F_S is F_C" for name in ("v_s", "beta") if name in free}
    if reported:
        return reported
    reach = level(values, points.speeds)
    if "F_log" in free and fit.sigma["F_log"] > float(np.mean(reach)):
        return {
            "F_log": f"speeds from {points.speeds[0]:.3g} to {points.speeds[-1]:.3g} rad/s do not separate it from "
            "sigma_2"
        }
    if "asymmetry" in free:
        if np.ptp(reach) < SEPARATING_LEVEL_RANGE * np.mean(reach):
            return {
                "asymmetry": f"the level of friction varies by {100 * np.ptp(reach) / np.mean(reach):.1f} % over the "
                "speeds only: that does not separate it from the constant load M_0"
            }
        if fit.sigma["asymmetry"] > 0.1:
            return {
                "asymmetry": f"it would be known to {fit.sigma['asymmetry']:.2g} only: the level of friction varies "
                "too little over the speeds to separate it from the constant load M_0"
            }
    return {name: "the torque at these speeds does not depend on it" for name in fit.silent}


def warnings(points: Points, fit: Fit, matrix: Array, names: Sequence[str], I_P: float | None) -> list[Finding]:
    """About plateaus and the fit that stands. matrix: correlation of `names` (the parameters as they are reported)."""
    said: list[Finding] = []
    slowest = float(points.speeds[0])
    if I_P is not None and slowest * I_P > SLOW_ENOUGH:
        said.append(Finding(
            "lowest-speed-high", "doubt",
            f"the lowest speed is {slowest * I_P * 60e3:.3g} mm/min, above 50 mm/min: F_S and v_s rest on what lies "
            "below; drive plateaus from 10 mm/min on",
            "F_S, v_s", "drive plateaus from 10 mm/min on",
        ))  # fmt: skip
    if len(points.speeds) < FEW_SPEEDS:
        said.append(Finding(
            "speeds-few", "doubt",
            f"{len(points.speeds)} speed(s), fewer than {FEW_SPEEDS}: the shape of the curve between them is not "
            "checked; drive 12 speeds in equal ratios",
            "", "drive 12 speeds in equal ratios",
        ))  # fmt: skip
    if not points.both:
        said.append(Finding(
            "one-direction-only", "doubt",
            "plateaus in one direction only: the constant load M_0 and an asymmetry are taken for friction; drive "
            "both directions",
            "M_0, asymmetry", "drive both directions",
        ))  # fmt: skip
    sigma = fit.sigma
    if "v_s" in sigma and sigma["v_s"] > V_S_WARNED * fit["v_s"]:
        remedy = f"add plateaus about {_speed_text(fit['v_s'], I_P)}, or make them longer"
        text = f"v_s is known to {100 * sigma['v_s'] / fit['v_s']:.0f} % only: {remedy}"
        said.append(Finding("parameter-uncertain", "doubt", text, "v_s", remedy))
    if "F_log" in sigma and sigma["F_log"] > max(0.3 * fit["F_log"], 0.02 * float(np.max(np.abs(points.torque)))):
        said.append(Finding(
            "parameter-uncertain", "doubt",
            f"F_log ({fit['F_log']:.3g} -+ {sigma['F_log']:.2g} N.m) is hardly separated from sigma_2 and F_C: add "
            "speeds from well below to well above v_log; the curve itself may be good",
            "F_log", "add speeds from well below to well above v_log",
        ))  # fmt: skip
    for name in fit.at_bound:
        shown = "F_S - F_C" if name == EXCESS else name
        text = f"{shown} sits at its bound {fit[name]:.4g}: the model's shape does not fit, or it is not there"
        said.append(Finding("parameter-at-bound", "doubt", text, shown))
    for row, first in enumerate(names):
        for column in range(row):
            pair = {first, names[column]}
            # M_0 and asymmetry go together by their definition; whether they are separated is looked at on its own.
            if abs(matrix[row, column]) > SAME_PARAMETER_CORRELATION and pair != {"M_0", "asymmetry"}:
                said.append(Finding(
                    "parameters-correlated", "doubt",
                    f"{names[column]} and {first} are correlated by {matrix[row, column]:+.3f}: the data determine "
                    "their combination, not each of them; the curve is not worse for it. Add speeds, or "
                    "hold one of them",
                    f"{names[column]}, {first}", "Add speeds, or hold one of them",
                ))  # fmt: skip
    return said


def _speed_text(value: float, I_P: float | None) -> str:
    return f"{value:.3g} rad/s" if I_P is None else f"{value:.3g} rad/s ({value * I_P * 60e3:.3g} mm/min)"


# --- Stationary friction from plateaus: weighted least squares of Eq. 7, the viscous part and the constant load -------


# --- Friction that changes while plateaus are driven: what speeds that come back show, and what they do not -----------


SAME_SPEED_SHARE = 0.02  # relative difference up to which a speed counts as repeated
DRIFT_SIGMAS, LEAST_DRIFT = 4.0, 2e-3  # standard deviations, and share of the friction, that a drift must have
# Standard deviation of the relative change of viscous friction from the first plateau to the last one: grease and oil
# lose a third and more of it while a cold axis warms up.
WARMING_DEVIATION = 0.25
WORTH_A_WORD = 0.05  # of sigma_2: standard deviation by warming that is worth a warning


def warming_covariance(age: Array) -> Array:
    """(K, K) covariance of the relative change of viscous friction since the first plateau, in WARMS^2.

    age: (K,) time of the plateaus, from the first one at 0 to the last one at 1. Nobody knows the course: a change at
    once, an even one and one at random (Brownian motion) have equal shares in it.
    """
    later = np.asarray(age > 0, dtype=np.float64)
    return np.asarray((np.outer(later, later) + np.outer(age, age) + np.minimum(age[:, None], age[None, :])) / 3)


def warn_hidden_warming(drifts: float, sigma_2: float) -> tuple[Finding, ...]:
    """A warning where warming that the speeds do not show leaves sigma_2 open.

    drifts: the part of its standard deviation [N.m.s/rad] by warming. The interval itself is that of all records
    together, which is printed with the value.
    """
    if not drifts > WORTH_A_WORD * sigma_2:
        return ()
    remedy = "drive the fastest speed first and last, or warm the axis up before"
    return (Finding(
        "warming-not-separated", "doubt",
        "no fast speed is driven both early and late: viscous friction that falls as the axis warms up is not "
        f"separated from the shape of the curve; the plateaus alone leave +-{100 * NORMAL_95 * drifts / sigma_2:.2g} "
        f"% of sigma_2 open by that; {remedy}",
        "sigma_2", remedy,
    ),)  # fmt: skip


def repeats(plateaus: Sequence[Plateau]) -> list[tuple[int, int]]:
    """The first and the last plateau of each direction and speed that came back after another speed."""
    result = []
    for k, first in enumerate(plateaus):
        like = [
            m
            for m, other in enumerate(plateaus)
            if abs(other.speed - first.speed) <= SAME_SPEED_SHARE * abs(first.speed)
        ]
        between = (abs(abs(other.speed) - abs(first.speed)) for other in plateaus[k : like[-1]])
        if like[0] == k and any(away > SAME_SPEED * abs(first.speed) for away in between):
            result.append((k, like[-1]))
    return result


def repetition_variance(
    plateaus: Sequence[Plateau], values: Mapping[str, float], names: Sequence[str]
) -> tuple[Array, tuple[Finding, ...]]:
    """(P,) variance of `names` by friction that was another when a speed came back, and a finding about it."""
    variance, worst = np.zeros(len(names)), 0.0
    said: tuple[Finding, ...] = ()
    for k, m in repeats(plateaus):
        first, last = plateaus[k], plateaus[m]
        n = np.array([first.speed, last.speed])
        before, after = np.array([first.torque, last.torque]) - torque(values, n)
        change, friction, size = float(after - before), float(curve(values, n[:1])[0]), abs(first.speed)
        if abs(change) < max(DRIFT_SIGMAS * float(np.hypot(first.sigma, last.sigma)), LEAST_DRIFT * friction):
            continue
        # What each would have to change by to make the difference alone, from the first plateau to the last one of all.
        reach = {"sigma_2": size, "F_log": float(np.log1p(size / values["v_log"])), "F_C": 1.0, "F_S": 1.0}
        whole = change * (len(plateaus) - 1) / (m - k)
        moved = np.array([whole / reach[name] if name in reach else 0.0 for name in names])
        variance = np.maximum(variance, (moved / NORMAL_95) ** 2)
        if abs(change) / friction > worst:
            worst = abs(change) / friction
            way = "fell" if change * first.speed < 0 else "rose"
            said = (Finding(
                "friction-drifts", "doubt",
                f"friction at {size:.3g} rad/s {way} by {100 * worst:.2g} % between {first.begin:.4g} s "
                f"({first.record}) and {last.begin:.4g} s ({last.record}): it drifts, as with temperature; the "
                "parameters are a mean, and their intervals hold the drift; warm the axis up and record again",
                first.record, "warm the axis up and record again",
            ),)  # fmt: skip
    return variance, said


SPEEDS = 200  # of the curve that is handed on
STARTS = 6
# Probability of a smaller chi^2 from which on plateaus count as scattering more than their noise
DOUBTFUL_PROBABILITY = 0.95
STRIBECK_PROBABILITY = 0.99  # the same, of the drop that a Stribeck effect, or a shape that is else held, must bring
HALF = 0.5  # of the sum of squares: what lies below is worth to free a parameter that is held by default
SHAPE_PARAMETERS: Mapping[str, str] = {
    "beta": "v_s",
    "v_log": "F_log",
}  # held by default -> without which it has no effect

# The fit moves F_C and F_S - F_C >= 0 in place of F_S.
MOVED_ORDER = tuple(solver_name(name) for name in CONSTANT_SPEED)


def stationary(
    plateaus: Sequence[Plateau],
    *,
    hold: Mapping[str, float] | None = None,
    free: Sequence[str] = (),
    seed: int = 0,
    I_P: float | None = None,
) -> Stationary:
    """Friction over speed from plateaus.

    Args:
        hold: name -> value of what is not estimated, on top of `DEFAULT_SHAPES`; any of the estimates' names. None:
        nothing.
        free: names of `hold` and `DEFAULT_SHAPES` that are estimated nevertheless.
        seed: of the further starts. I_P: lead [m/rad], for advice in mm/min.

    What the plateaus cannot determine is held with a reason and a warning (F_S = F_C, v_s, F_log = 0, sigma_2 = 0,
    asymmetry = 0, M_0 = 0). Plateaus that scatter about the curve by more than their own noise explains (friction that
    depends on position, temperature) get a share of their torque added to their standard deviation, as large as makes
    the residuals plausible (R. Paule, J. Mandel, J. Res. NBS 87, 1982): the confidence intervals determine it then.

    Raises InputError: no plateau; a name that is none; a value held outside its physical range, or F_S below F_C.
    """
    if not plateaus:
        raise InputError(
            "no plateau of constant speed: stationary friction needs stretches of at least 0.4 s (0.15 s settle) at "
            "constant speed, best 12 speeds from 10 to 20000 mm/min in both directions"
        )
    asked = hold or {}
    for name in (*asked, *free):
        if name not in CONSTANT_SPEED:
            raise InputError(f"{name} is no parameter of stationary friction: {', '.join(CONSTANT_SPEED)}")
    fixed = {name: value for name, value in {**DEFAULT_SHAPES, **asked}.items() if name not in free}
    check_fixed(fixed)
    points = Points.of(plateaus)
    problem = _Problem(points, fixed, seed)
    result, reasons, extra = problem.solve()
    usual = [name for name in DEFAULT_SHAPES if name in fixed and name not in asked]
    better = _describe_better_fit(problem, result, reasons, usual) if extra > 0 else ("", "")
    return _conclude(tuple(plateaus), points, problem, result, reasons, extra, better, I_P)


class _Problem:
    """The fit with what is held."""

    def __init__(self, points: Points, given: Mapping[str, float], seed: int) -> None:
        self.points, self.given, self.seed = points, dict(given), seed
        self.usual = _guess(points)

    def solve(self) -> tuple[Fit, dict[str, str], float]:
        """The fit that stands, why what is held, and the share of the torque that plateaus scatter by besides noise."""
        free = [name for name in MOVED_ORDER if parameter_name(name) not in self.given]
        reasons = unseparated_parameters(self.points) | too_few(self.points, free)
        reasons = {name: reason for name, reason in reasons.items() if name in free}
        while True:
            remaining = [name for name in free if name not in reasons]
            if not remaining:
                raise InputError("every parameter of stationary friction is held: nothing is left to estimate")
            result, extra = self.weighted(remaining, reasons)
            more = self.needless(result, reasons, extra)
            more = more or undetermined_parameters(self.points, result, self.inner(result.mapping(), reasons))
            more = {name: reason for name, reason in more.items() if name in remaining}
            if not more or len(more) == len(remaining):
                return result, reasons, extra
            reasons |= more
            for name in ("v_s", "beta"):
                if name in more:
                    self.usual[name] = result[name]

    def needless(self, result: Fit, reasons: Mapping[str, str], extra: float) -> dict[str, str]:
        """Rise, v_s and beta where the plateaus are met as well without a Stribeck effect, name -> reason.

        A fit makes one of noise alone: with none, the drop of chi^2 is that of as many random numbers.
        """
        parts = [name for name in (EXCESS, "v_s", "beta") if name in result.names]
        if not {EXCESS, "v_s"} <= set(parts) or result.sigma["v_s"] <= V_S_WARNED * result["v_s"]:
            return {}
        reason = (
            f"the torque at the speeds from {self.points.speeds[0]:.3g} rad/s on is met as well without a Stribeck "
            "effect: no plateau lies within its range"
        )
        without = {**reasons} | dict.fromkeys(parts, reason)
        remaining = [name for name in result.names if name not in parts]
        bare = self.fit(remaining, without, extra, 1, result)
        if 2 * (bare.cost - result.cost) > chi2.ppf(STRIBECK_PROBABILITY, len(parts)):
            return {}
        return dict.fromkeys(parts, reason)

    def inner(self, moved: Mapping[str, float], reasons: Mapping[str, str]) -> dict[str, float]:
        """All values, F_S and its excess both, from those that are moved."""
        neutral = {name: NO_EFFECT[name] for name in ("F_log", "sigma_2", "asymmetry", "M_0")} | {EXCESS: 0.0}
        values = {**self.usual, **{name: neutral[name] for name in reasons if name in neutral}}
        values |= {**self.given, **moved}
        if "F_S" in self.given:
            values[EXCESS] = self.given["F_S"] - values["F_C"]
        values["F_S"] = values["F_C"] + values[EXCESS]
        return values

    def weighted(self, remaining: Sequence[str], reasons: Mapping[str, str]) -> tuple[Fit, float]:
        """Fit with the plateaus' own noise; where that does not explain the scatter, with a share of torque added."""
        result = self.fit(remaining, reasons, 0.0, STARTS)
        freedom = len(self.points.speed) - len(remaining)
        if freedom < 1 or 2 * result.cost <= chi2.ppf(DOUBTFUL_PROBABILITY, freedom):
            return result, 0.0
        low, high = 0.0, 1.0
        for _ in range(12):
            # In equal ratios once a lower end is there: shares of 1e-4 and of 0.1 both occur.
            middle = high / 10 if low == 0 else float(np.sqrt(low * high))
            result = self.fit(remaining, reasons, middle, 1, result)
            if 2 * result.cost > freedom:
                low = middle
            else:
                high = middle
        return self.fit(remaining, reasons, high, STARTS, result), high

    def fit(
        self, remaining: Sequence[str], reasons: Mapping[str, str], extra: float, starts: int, near: Fit | None = None
    ) -> Fit:
        """One weighted fit."""
        points = self.points
        weight = 1.0 / np.hypot(points.sigma, extra * np.abs(points.torque))
        begin = {**self.usual, **(near.mapping() if near is not None else {})}

        def residuals(moved: Mapping[str, float]) -> Array:
            return np.asarray((points.torque - torque(self.inner(moved, reasons), points.speed)) * weight)

        return fit(residuals, [self.parameter(name, begin[name]) for name in remaining], starts=starts, seed=self.seed)

    def marginal(self, result: Fit, reasons: Mapping[str, str], extra: float) -> tuple[Array, Array]:
        """Covariance (P, P) of what was found, and its part by warming, which changes viscous friction.

        What is held because the plateaus do not determine it is not known: it adds what the rest would move by if it
        had another usual value, as far as the plateaus allow that one, and what it moves by if it has the value that
        suits them best. So does the course of viscous friction over time.
        """
        without, moved = self._hidden(result, reasons, extra, 0.0)
        within, warmed = self._hidden(result, reasons, extra, WARMING_DEVIATION)
        known = np.isfinite(within) & np.isfinite(without)
        part = np.where(known, within - np.where(known, without, 0.0), 0.0) + np.outer(warmed - moved, warmed - moved)
        # With nothing hidden what was found is the best there is, at a bound too.
        best = not any(name in PRIOR_DEVIATIONS for name in reasons)
        return without + (0.0 if best else np.outer(moved, moved)) + part, part

    def _hidden(self, result: Fit, reasons: Mapping[str, str], extra: float, warms: float) -> tuple[Array, Array]:
        """Covariance with what is hidden as nuisances, and how far what was found is from the best with them."""
        points, values = self.points, self.inner(result.mapping(), reasons)
        if "v_s" in reasons:
            values["v_s"] = float(points.speeds[0]) / UNSEEN_SPEED_RATIO
        names = [name for name in reasons if name in PRIOR_DEVIATIONS]
        weight = 1.0 / np.hypot(points.sigma, extra * np.abs(points.torque))
        columns = [result.jacobian]
        for name in names:
            size = hidden_deviation(name, float(np.mean(points.friction()[0])), float(points.speeds[-1]))
            ends = ({**values, name: values[name] + side * size} for side in (0.5, -0.5))
            up, down = (torque({**end, "F_S": end["F_C"] + end[EXCESS]}, points.speed) for end in ends)
            columns.append(((down - up) * weight)[:, None])
        count = len(result.names)
        # In units of what may be: a row of unit variance for each that is hidden.
        usual = np.eye(len(names), count + len(names), count)
        lost = warms * values["sigma_2"] * points.speed * weight
        noise = np.eye(len(lost)) + warming_covariance(points.age) * np.outer(lost, lost)
        root = np.linalg.cholesky(noise)
        whole = np.vstack([solve_triangular(root, np.hstack(columns), lower=True), usual])
        away = np.concatenate([solve_triangular(root, result.residuals, lower=True), np.zeros(len(names))])
        scale = np.maximum(np.linalg.norm(whole, axis=0), 1e-300)
        covariance, _ = inverse(whole / scale)
        covariance = covariance / np.outer(scale, scale)
        return covariance[:count, :count], np.asarray((covariance @ whole.T @ away)[:count])

    def parameter(self, name: str, start: float) -> Parameter:
        """Bounds and the range of further starts, from what the plateaus span."""
        points = self.points
        top = float(np.max(np.abs(points.torque)))
        within = dict(plateau_ranges(float(points.speeds[0]), float(points.speeds[-1]), top)[name])
        if name == "F_C" and "F_S" in self.given:
            # Held F_S is an upper bound: the excess must not be negative.
            highest = min(within["upper"], self.given["F_S"])
            within |= {"upper": highest, "scatter": (0.2 * top, min(top, highest))}
        if name == "F_C":
            start = min(start, within["upper"])
        return Parameter(name, start, **within)


def _guess(points: Points) -> dict[str, float]:
    """First values, and what stays where a parameter is held for lack of data."""
    friction, _ = points.friction()
    lowest = int(np.argmin(friction))
    slow, fast = float(points.speeds[0]), float(points.speeds[-1])
    rise = float(friction[0] - friction[lowest])
    climb = float(friction[-1] - friction[lowest])
    return {
        "F_C": float(friction[lowest]),
        EXCESS: max(rise, 0.0),
        # Down to 5 % at the speed of the lowest torque.
        "v_s": max(float(points.speeds[lowest]) / 3, slow / 2),
        "F_log": 0.3 * max(climb, 0.0),
        "sigma_2": 0.5 * max(climb, 0.0) / fast,
        "asymmetry": 0.0,
        "M_0": float(np.mean(points.torque)) if points.both else 0.0,
        **DEFAULT_SHAPES,
    }


def _describe_better_fit(
    problem: _Problem, result: Fit, reasons: Mapping[str, str], usual: Sequence[str]
) -> tuple[str, str]:
    """What estimating one of the values held by default would gain, for the warning of scatter, and the option for it;
    "": nothing clear.

    It counts where the plateaus are met to their noise then, or the sum of squares more than halves, and the drop is
    none that one more parameter brings in noise (F test: the noise's size is in doubt here).
    """
    count, moved = len(problem.points.speed), list(result.names)
    freedom = count - len(moved) - 1
    if freedom < 1:
        return "", ""
    before = 2 * problem.fit(moved, reasons, 0.0, STARTS, result).cost
    gains: list[tuple[float, str, str]] = []
    for name in usual:
        if SHAPE_PARAMETERS[name] not in moved:
            continue
        given = {key: value for key, value in problem.given.items() if key != name}
        trial = _Problem(problem.points, given, problem.seed)
        free = [key for key in MOVED_ORDER if key in (*moved, name)]
        freed = trial.fit(free, reasons, 0.0, STARTS, result)
        after = 2 * freed.cost
        fits = after <= chi2.ppf(DOUBTFUL_PROBABILITY, freedom)
        clear = before - after > f.ppf(STRIBECK_PROBABILITY, 1, freedom) * after / freedom
        if name in freed.at_bound or not clear or not (fits or after < HALF * before):
            continue
        gain = (
            "the curve fits the plateaus to their noise"
            if fits
            else f"the sum of squares falls to {100 * after / before:.2g} %"
        )
        gains.append((after, f"; with {name} free ({freed[name]:.3g}) {gain}: --free {name}", f"--free {name}"))
    return min(gains)[1:] if gains else ("", "")


def _conclude(
    plateaus: tuple[Plateau, ...],
    points: Points,
    problem: _Problem,
    result: Fit,
    reasons: Mapping[str, str],
    extra: float,
    better: tuple[str, str],
    I_P: float | None,
) -> Stationary:
    """Everything that is reported."""
    values = problem.inner(result.mapping(), reasons)
    names = tuple(map(parameter_name, result.names))
    turn = inner_to_outer(result.names, names)
    whole, warmed = problem.marginal(result, reasons, extra)
    drifted, drifts = repetition_variance(plateaus, values, names)
    covariance, warmed = turn @ whole @ turn.T + np.diag(drifted), turn @ warmed @ turn.T
    matrix = correlation(covariance)
    sigma = dict(zip(names, np.sqrt(np.diag(covariance)), strict=True))
    reported = {parameter_name(name): reason for name, reason in reasons.items()}
    estimates = {}
    for name in CONSTANT_SPEED:
        status: Status = "estimated" if name in names else "undetermined" if name in reported else "held"
        reason = reported.get(name, "" if status == "estimated" else "held at a given or usual value")
        estimates[name] = estimate(name, values[name], float(sigma.get(name, nan)), status, reason)
    said = warnings(points, result, correlation(covariance - warmed), names, I_P)
    for name, reason in reported.items():
        text = f"{name} is not estimated but held at {values[name]:.4g}: {reason}"
        said.append(Finding("parameter-held", "doubt", text, name))
    said += drifts
    if "sigma_2" in sigma:
        at = names.index("sigma_2")
        said += warn_hidden_warming(float(np.sqrt(max(warmed[at, at], 0.0))), values["sigma_2"])
    if extra > 0:
        said.append(Finding(
            "plateaus-scatter", "doubt",
            f"plateaus scatter about the curve by {100 * extra:.2g} % of their torque beyond their own noise (friction "
            "that depends on position or temperature, or a shape the model has not); the confidence intervals hold it"
            + better[0],
            "", better[1],
        ))  # fmt: skip
    speeds = np.geomspace(points.speeds[0], points.speeds[-1], SPEEDS) if len(points.speeds) > 1 else points.speeds
    away = points.torque - torque(values, points.speed)
    return Stationary(
        plateaus,
        estimates,
        Correlation(names, matrix),
        covariance,
        warmed,
        speeds,
        curve(values, speeds),
        _band(problem, result, reasons, speeds),
        (float(points.speeds[0]), float(points.speeds[-1])),
        float(np.sqrt(np.mean(away**2))),
        float(np.max(np.abs(away) / curve(values, points.speed))),
        tuple(said),
    )


def _band(problem: _Problem, result: Fit, reasons: Mapping[str, str], speeds: Array) -> Array:
    """(K,) standard deviation of the curve, linearised."""
    rows = []
    for k, name in enumerate(result.names):
        parameter = problem.parameter(name, float(result.values[k]))
        # Up to the bound and beyond: the curve is smooth there, and only its slope is asked for.
        step = 1e-5 * (float(result.values[k]) if parameter.log else parameter.step)
        ahead, behind = result.mapping(), result.mapping()
        ahead[name] += step
        behind[name] -= step
        values = (problem.inner(side, reasons) for side in (ahead, behind))
        first, second = (curve(side, speeds) for side in values)
        rows.append((first - second) / (2 * step))
    slopes = np.column_stack(rows)
    finite = np.where(np.isfinite(result.covariance), result.covariance, 0.0)
    return np.asarray(np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", slopes, finite, slopes), 0.0)))
