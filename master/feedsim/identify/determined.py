"""Which parameters the data do not tell: judged by bound and value, with the reason in words."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from feedsim.identify.parameters import KINDS
from feedsim.identify.result import NORMAL_95
from feedsim.identify.search import EXCESS, Solution, outer

# Of the value: a standard deviation above says that even the order of magnitude is open (95 % interval down to 0).
VAGUE = 0.5
# A Stribeck peak that is this vague is an artefact of what happens within a few rows of the reversals.
VAGUE_STRIBECK = 0.25
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
    """The one parameter, or set that belongs together, that most deserves to be held; None: all are told.

    kept: what is free whatever its bound, because a prior tells it.
    """
    values = solution.values
    found: list[tuple[float, Verdict]] = []
    for name in free:
        # Those without a scale of their own are told with any bound, large or small.
        lenient = name in kept or name in ("M_0", "asymmetry", "delay")
        key = EXCESS if name == "F_S" else name
        if lenient and np.isfinite(solution.sigma(key)) and key not in solution.fit.at_bound:
            continue
        judged = _judge(solution, name)
        if judged is not None:
            found.append(judged)
    if not found:
        return None
    found.sort(key=lambda pair: -pair[0])
    # Damping and engagement first: they lean on the others.
    order = ("asymmetry", "gamma", "W", "F_log", "F_S", "v_s", "sigma_1", "sigma_2")
    for name in order:
        for _, candidate in found:
            if name in candidate.held:
                return _complete(candidate, free, values)
    return _complete(found[0][1], free, values)


def _judge(solution: Solution, name: str) -> tuple[float, Verdict] | None:
    """How vague a parameter is and the verdict on it; None: it is told well enough."""
    key = EXCESS if name == "F_S" else name
    value = solution.fit[key]
    sigma = solution.sigma(key)
    if name == "gamma" and value > 1 - SIGNIFICANT * min(sigma, 0.25):
        reason = f"no engaging zone shows, the full stiffness acts at once after reversals (gamma {value:.3g})"
        return np.inf, Verdict({"gamma": 1.0}, name, reason)
    if name in ("sigma_1", "sigma_2", "F_log", "F_S") and value <= 1e-9 * max(abs(solution.values["F_C"]), 1e-300):
        reason = "the record fits best without (0 is the least that is physical)"
        return np.inf, Verdict({name: 0.0}, name, reason)
    if not np.isfinite(sigma):
        return np.inf, Verdict({name: value}, name, "the record does not answer to it")
    if key in solution.fit.at_bound:
        reason = f"the fit ends at the end of its range ({value:.3g} {KINDS[outer(key)].unit})"
        return np.inf, Verdict({name: value}, name, reason)
    if sigma > (VAGUE_STRIBECK if name in ("F_S", "v_s") else VAGUE) * abs(value):
        vague = sigma / max(abs(value), 1e-300)
        of = "F_S - F_C " if name == "F_S" else ""
        return vague, Verdict({name: value}, name, f"{of}known to +-{100 * NORMAL_95 * vague:.0f} % only (95 %)")
    return None


def _complete(judged: Verdict, free: Collection[str], values: Mapping[str, float]) -> Verdict:
    """What goes with it: W and gamma only make sense together, so do F_S and v_s."""
    held = dict(judged.held)
    if {"W", "gamma"} & set(held):
        held = {name: value for name, value in {"W": 0.0, "gamma": 1.0}.items() if name in free}
    if {"F_S", "v_s"} & set(held):
        held = {name: values["F_C"] if name == "F_S" else values["v_s"] for name in ("F_S", "v_s") if name in free}
    for name in ("sigma_1", "sigma_2", "F_log", "asymmetry"):
        if name in held:
            held[name] = 0.0
    return Verdict(held, judged.name, judged.reason)
