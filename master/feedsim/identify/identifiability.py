"""Which parameters the records of stage 2 do not determine: judged by what they hold, by bound and by value."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from feedsim.estimation.interval import ANY_VALUE, determined, half_width, reason, shows
from feedsim.identify.motion import RecordTorque, deflection
from feedsim.identify.parameters import NO_EFFECT, PARAMETER_KINDS, inner, outer
from feedsim.identify.result import Stationary, Status
from feedsim.identify.search import Solution

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
        key = inner(name)
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
    key = inner(name)
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
        why = f"the fit ends at the end of its range ({value:.3g} {PARAMETER_KINDS[outer(key)].unit})"
        return np.inf, Verdict({name: value}, name, why)
    half = half_width(sigma)
    # A Stribeck peak that is not determined is an artefact of what happens within a few rows of the reversals.
    if not (determined(value, half) if name in ("F_S", "v_s") else shows(value, half)):
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
FAST = 0.05  # of the top speed: what a direction of motion must reach to count


def has_sines(models: Sequence[RecordTorque]) -> bool:
    """Whether any of the stretches is a sine."""
    return any(part.kind == "sine" for model in models for part in model.parts)


def explained(models: Sequence[RecordTorque], solution: Solution, tried: Solution) -> float:
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
    fast = np.flatnonzero(np.abs(n) > FAST * np.max(np.abs(n)))
    sides = np.sign(n[fast])
    turns = np.flatnonzero(sides[1:] != sides[:-1])
    indexes = []
    for k in turns:
        between = n[fast[k] : fast[k + 1] + 1] * sides[k]
        indexes.append(int(fast[k] + np.argmax(between <= 0)))
    return indexes


def extrapolated(fine: Sequence[RecordTorque], prior: Stationary | None, I_P: float | None) -> tuple[str, ...]:
    """A warning where sines alone determine the friction over speed."""
    if prior is not None or not has_sines(fine):
        return ()
    top = max(float(np.max(np.abs(model.moved(0.0)[1]))) for model in fine)
    shown = f"{top:.3g} rad/s" if I_P is None else f"{60e3 * top * I_P:.3g} mm/min"
    return (
        f"the records of sines determine the friction up to {shown}, their highest speed: above it is extrapolated and "
        "not to be relied on; strokes at constant speed determine the curve",
    )


def doubts(fixed: Mapping[str, tuple[Status, str]], prior: Stationary | None) -> tuple[str, ...]:
    """What is undetermined and why, a sentence per reason; what stage 1 hands on it has said itself."""
    names: dict[str, list[str]] = {}
    for name, (status, why) in fixed.items():
        before = prior.estimates.get(name) if prior is not None else None
        handed_on = before is not None and (before.status, before.reason) == (status, why)
        if status == "undetermined" and why and not handed_on and not why.startswith(GOES_WITH):
            names.setdefault(why, []).append(name)
    return tuple(f"{' and '.join(name)}: {why}" for why, name in names.items())
