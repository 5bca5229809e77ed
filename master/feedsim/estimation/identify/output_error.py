"""Stage 2: the friction law itself on the recorded motion, fitted to the recorded torque (output error)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite, nan
from typing import TYPE_CHECKING

import numpy as np

from feedsim.estimation.fit import correlation
from feedsim.estimation.identify.inertia import REST_SPEED_SHARE
from feedsim.estimation.identify.motion import RecordTorque, deflection, models, noise_of
from feedsim.estimation.identify.parameters import (
    DEFAULT_SHAPES,
    FIXED_PARAMETERS,
    NO_EFFECT,
    PARAMETER_KINDS,
    PRE_SLIDING,
    STATIONARY,
    estimate,
    names_of,
)
from feedsim.estimation.identify.record import Array, Record
from feedsim.estimation.identify.result import Correlation, Dynamic, Estimate, Stationary, Status, Stretch
from feedsim.estimation.identify.search import (
    FOLLOWED_STARTS,
    Search,
    Solution,
    fit_sliding_friction,
    grid,
    spread,
    with_excess,
)
from feedsim.estimation.identify.uncertainty import (
    GOES_WITH,
    LEAST_EXPLAINED,
    LEAST_REVERSALS,
    MIN_TURNOVER_ROWS,
    MODEL_ACCURACY,
    Uncertainty,
    Verdict,
    explained_share,
    has_sines,
    limits,
    no_delay,
    reversals,
    turnover_rows,
    uncertainty,
    verdict,
    warn_extrapolation,
    warn_undetermined,
)
from feedsim.estimation.parameter import Prior
from feedsim.foundation.errors import InputError

if TYPE_CHECKING:
    from feedsim.simulation.cosim.friction_law import FrictionLaw


# --- Which moves are missing for which parameter, in words ------------------------------------------------------------
# Which moves determine what (the reasoning behind the recommended sets):
# - sigma_0 acts right after every reversal; any move of a few micrometres shows it.
# - W and gamma act while the drive train engages anew after a reversal: the travel must cover a good part of W for W,
#   nearly all of it for gamma, which else looks like a smaller sigma_0.
# - sigma_1 acts on the rate of deflection, sigma_1 dz/dt: it needs speed while the bristles still stick, which is a
# high
#   frequency at a small amplitude.
# - A torque channel that is late by tau shifts the torque by -tau dM/dt. In pre-sliding M = k sigma_0 z, so it looks
# like
#   a damping of -tau k sigma_0: for small moves the delay and sigma_1 are one and the same. They part in what makes
#   the
#   torque change without deflecting bristles: the inertia of a move that slides. J dn/dt of amplitude J A omega^2 /
#   I_P
#   shows the delay as a torque of tau J A omega^3 / I_P, so the frequency counts in the third power. Two things limit
#   it:
#   noise is a share of the torque, so that a loud move in the record of the quiet ones drowns those (a record of its
#   own
#   does not); and the first mode of the structure, below whose frequency omega_1 alone the axis is an inertia. The
#   mode
#   adds a share (omega/omega_1)^2 to J and, by its damping D, a lag of about 2 D (omega/omega_1)^3 of that share,
#   which
#   passes for a delay of 2 D omega^2/omega_1^3 times the share of mass that it carries.


# Amplitudes at the slide [m] from which on a parameter shows, and the frequency [Hz] for the damping.
LEAST_W = 20e-6
LEAST_GAMMA = 50e-6
LEAST_FREQUENCY = 5.0
# The same without a lead: over the deflection F_S/sigma_0 at which the bristles give way (20 um of some 22 um).
DEFLECTIONS_W = 0.9
DEFLECTIONS_GAMMA = 2.25
# Standard deviations, of the value, up to which nothing needs to be said.
GOOD_RELATIVE_SIGMA = {"sigma_0": 0.02, "W": 0.03, "gamma": 0.03, "sigma_1": 0.06}
EXCELLENT = 1 / 3  # of those: better than that, nothing is said at all
TOLERANCE = 0.75  # the axis follows small sines only in part: 20 um that are commanded are some 19, 5 um are 4


def advice(
    stretches: Sequence[Stretch],
    estimates: Mapping[str, Estimate],
    without_delay: Mapping[str, float],
    deflection: float,
    I_P: float | None = None,
) -> tuple[str, ...]:
    """A sentence for each parameter that the moves do not show well.

    Args:
        deflection: F_S/sigma_0 [rad].
        I_P: lead [m/rad]; without it amplitudes are given at the motor.
    """
    reversing = [s for s in stretches if s.kind == "sine"]
    sentences = []
    for name, least, share in (("W", LEAST_W, DEFLECTIONS_W), ("gamma", LEAST_GAMMA, DEFLECTIONS_GAMMA)):
        needed = least / I_P if I_P else share * deflection
        estimate = estimates.get(name)
        if estimate is None or not (verb := _wanted_moves(estimate)):
            continue
        largest = max((s.amplitude for s in reversing), default=0.0)
        if largest < TOLERANCE * needed:
            sentences.append(
                f"{name} {verb} a sine with an amplitude of at least {_length(needed, I_P)}; "
                + (f"the largest has {_length(largest, I_P)}" if reversing else "there is none")
                + _bound(estimate)
            )
    sigma_1 = estimates.get("sigma_1")
    if sigma_1 is not None and (verb := _wanted_moves(sigma_1)):
        small = [s.frequency for s in reversing if s.amplitude < 4 * deflection]
        highest = max(small, default=0.0)
        if highest < TOLERANCE * LEAST_FREQUENCY:
            sentences.append(
                f"sigma_1 {verb} a small sine (up to some {_length(deflection, I_P)}) of at least {LEAST_FREQUENCY:g} "
                "Hz; " + (f"the fastest has {highest:.3g} Hz" if small else "there is none") + _bound(sigma_1)
            )
    for name, good in GOOD_RELATIVE_SIGMA.items():
        estimate = estimates.get(name)
        if estimate is None or estimate.status != "estimated" or any(s.startswith(name + " ") for s in sentences):
            continue
        relative = estimate.sigma / abs(estimate.value)
        known = without_delay.get(name, estimate.sigma) / abs(estimate.value)
        if relative <= good:
            continue
        if known <= good and relative > 1.5 * known:
            sentences.append(
                f"{name} is known within {100 * relative:.1f} %, with a known delay within {100 * known:.1f} %: give "
                "the delay, or add a sliding sine whose inertia marks it (500 um at 5 Hz)"
            )
        else:
            sentences.append(
                f"{name} is known within {100 * relative:.1f} % only: more periods, or less noise (the deviation falls "
                "with the square root of the number of periods)"
            )
    return tuple(sentences)


def _wanted_moves(estimate: Estimate) -> str:
    """How much a parameter asks for moves that show it; empty: not at all, it is determined well or not sought."""
    if estimate.status in ("held", "given"):
        return ""
    if estimate.status == "undetermined" or not np.isfinite(estimate.sigma):
        return "needs"
    good = GOOD_RELATIVE_SIGMA[estimate.name] * abs(estimate.value)
    return "needs" if estimate.sigma > good else "is best determined by" if estimate.sigma > EXCELLENT * good else ""


def _length(angle: float, I_P: float | None) -> str:
    return f"{1e6 * angle * I_P:.3g} um" if I_P else f"{1e3 * angle:.3g} mrad at the motor"


def _bound(estimate: Estimate) -> str:
    if estimate.status == "undetermined":
        return " (these records do not determine it)"
    return f" (known within {100 * estimate.sigma / abs(estimate.value):.0f} %)"


Progress = Callable[[str, float], None]

FINAL = 1e-9  # tolerance of cost and step for the result
# least fall of the sum of squares (of unit variance) per parameter more: significant beyond 99.9 %
MIN_GAIN_PER_PARAMETER = 12.0
# Of Maxwell slip: no value of them is without effect, so that a fit without them is none with less in it. They are free
# where the records determine them, also where the usual value happens to be the best one.
WITHOUT_NEUTRAL = frozenset({"spread", "skew", "C"})
# Free from the start it follows small sines of an axis of another law, and leaves three times as much of a circle.
LATE_PARAMETERS = frozenset({"C"})
# In the order in which they are tried where no stage 1 determines them: what friction is first, refinements last.
# Asymmetry comes after what makes friction depend on speed: with a friction that does not, it is a constant load.
REFINEMENTS = (
    ("sigma_1",),
    ("F_log", "asymmetry"),
    ("F_log",),
    ("F_S", "v_s"),
    ("asymmetry",),
    ("W", "gamma"),
    ("spread", "skew"),
    ("spread",),
    ("C",),
    ("F_S", "v_s"),  # once more: what engages passed for it, or hid it
    ("F_log",),
)
# Where all speeds are far above the usual v_log the logarithm is a constant to them, and what friction gains with speed
# falls to sigma_2 alone. It then bends at a BEND-th of the typical speed.
FAR_ABOVE, BEND = 10.0, 3.0
OPEN_RISE = 1.2  # F_S over F_C to begin with, where stage 1 does not determine it
CURVE = ("F_C", "F_S", "v_s", "F_log", "sigma_2")  # friction over speed, of which each stands for a missing other
LEAST_SHARE = 0.1  # of the time in either direction, for direction and constant load to be separated


@dataclass(frozen=True, eq=False)
class _KnownValues:
    """What is known before the fit: start values, which parameters the prior determines, which are held or given.

    drift: the part of stage 1's covariance that the prior has not; None: no stage 1.
    open: names that are held though the records do not rule out other values -> the variance that the rest (inner
        names) has about its values then, from the fit with them free.
    """

    values: dict[str, float]
    prior: Prior
    determined_names: tuple[str, ...]
    held: dict[str, tuple[Status, str]]
    drift: Prior | None = None
    open: dict[tuple[str, ...], dict[str, float]] = field(default_factory=dict)

    def leave_open(self, names: Collection[str], free: Solution, solution: Solution) -> None:
        """free: the fit with `names`. solution: the one without."""
        self.open[tuple(sorted(names))] = {
            name: free.sigma(name) ** 2 + (free.fit[name] - solution.fit[name]) ** 2
            for name in solution.fit.names
            if name in free.fit.names and isfinite(free.sigma(name))
        }


def dynamic(
    records: Sequence[Record],
    law: FrictionLaw,
    *,
    prior: Stationary | None = None,
    J: Estimate | None = None,
    delay: float | None = None,
    hold: Mapping[str, float] | None = None,
    free: Collection[str] = (),
    fleet: Prior | None = None,
    I_P: float | None = None,
    progress: Progress | None = None,
) -> Dynamic:
    """Pre-sliding and transition from records of sines, or of any motion with reversals.

    All parameters are estimated together; what stage 1 found enters with its covariance, so that its uncertainty
    carries over. The noise level is taken from the residuals of each stretch and the fit repeated with it.

    Args:
        records: of one axis. The plateaus that `prior` was made of are left out of them: they would count twice.
        law: the friction law.
        prior: result of stage 1; None: everything from these records, as far as they determine it.
        J: inertia [kg.m2]; with a standard deviation it is refined, without it is held; None: estimated.
        delay: of the torque channel [s]; None: estimated.
        hold: name -> value that is not touched. free: what is usually held but is to be estimated (beta, v_log).
        fleet: what machines of the same kind have; it counts for what stage 1 has not estimated with it already.
        I_P: lead [m/rad], for advice in micrometres.
        progress: is called with what is done and the share of the work that lies behind.

    Raises InputError: nothing moves in the records.
    """
    tell = progress or (lambda what, share: None)
    tell("motion", 0.0)
    without = prior.plateaus if prior is not None else ()
    fine = models(records, law, without=without)
    if not fine:
        raise InputError("stage 2: nothing moves in " + ", ".join(record.name for record in records))
    known = _known_values(fine, prior, J, delay, hold or {}, free, fleet)
    weights = [_first_weights(model) for model in fine]
    base = _base(known, law.names, prior is not None or fleet is not None, delay is None)
    tell("start values", 0.1)
    search = Search(fine, known.prior, weights)
    states = np.zeros((len(fine), 2))
    coarse = models(records, law, coarse=True, without=without)
    starts = [start for start in grid(coarse, known.values, base) if "W" not in base or start["W"] > 0]
    tell("first fits", 0.2)
    results = search.best(starts, states, base)
    search = Search(fine, known.prior, _weights(fine, results, weights))
    fixed = dict(known.held)
    results, base = _drop_undetermined(search, results, base, known, fixed)
    groups = [group for group in REFINEMENTS if set(group) <= set(law.names)]
    if WITHOUT_NEUTRAL & set(law.names):
        groups.append(("sigma_1",))  # once more: beside the usual spread it may not have shown
    if prior is not None or fleet is not None:
        groups = [group for group in groups if LATE_PARAMETERS & set(group)]
    for k, group in enumerate(groups):
        tell("refinements", 0.4 + 0.48 * k / len(groups))
        results, base = _add_group(search, coarse, results, base, group, known, fixed)
        search = Search(fine, known.prior, _weights(fine, results, weights))
    tell("final fit", 0.9)
    results = search.solve(results.values, results.states, base, tolerance=FINAL, limit=40)
    results, base = _drop_undetermined(search, results, base, known, fixed)
    results = search.search_around(results, base)
    honest = uncertainty(search, results, known.open.values(), known.drift)
    # The delay first: without it damping is determined that both together leave open.
    while (
        judged := no_delay(fine, honest.solution, base) or verdict(honest.solution, base, known.determined_names)
    ) is not None:
        results, base = _drop_parameters(search, results, base, judged, known, fixed)
        results = search.search_around(results, base)
        honest = uncertainty(search, results, known.open.values(), known.drift)
    if prior is None and has_sines(fine):
        fixed |= _mark_open_curve(known, base)
    result = _result(fine, search, honest, base, fixed, I_P, prior)
    tell("done", 1.0)
    return result


def _known_values(
    fine: Sequence[RecordTorque],
    prior: Stationary | None,
    J: Estimate | None,
    delay: float | None,
    hold: Mapping[str, float],
    free: Collection[str],
    fleet: Prior | None,
) -> _KnownValues:
    values = {**NO_EFFECT, "J": 0.0, "delay": delay if delay is not None else 0.0}
    fixed: dict[str, tuple[Status, str]] = {
        name: ("held", "usual value, records of friction hardly determine it")
        for name in DEFAULT_SHAPES
        if name not in free
    }
    priors: list[Prior] = []
    drift: Prior | None = None
    unknown = {"J", "sigma_2", "F_C", "M_0"}
    if prior is not None:
        values |= {name: estimate.value for name, estimate in prior.estimates.items() if name in PARAMETER_KINDS}
        unknown = {"J"}
        for name, estimate in prior.estimates.items():
            # What stage 1 cannot determine is free here: held, it would bend what hangs on it.
            if estimate.status not in ("estimated", "undetermined") and name in PARAMETER_KINDS and name not in free:
                fixed[name] = estimate.status, estimate.reason or "as in stage 1"
            elif estimate.status == "undetermined" and name == "F_S" and name not in hold:
                values["F_S"] = OPEN_RISE * values["F_C"]
        names = tuple(name for name in prior.correlation.names if name not in fixed and name not in hold)
        places = [prior.correlation.names.index(name) for name in names]
        if names:
            at = np.array([values[name] for name in names])
            # Drift would leave the sines to bend what plateaus determine: it is in the intervals, not in the weights.
            weighed, drifts = prior.covariance - prior.drift, prior.drift
            priors.append(Prior(names, at, np.asarray(weighed[np.ix_(places, places)])))
            drift = with_excess(Prior(names, np.zeros(len(names)), np.asarray(drifts[np.ix_(places, places)])))
    if J is not None:
        values["J"] = J.value
        unknown.discard("J")
        if isfinite(J.sigma) and J.sigma > 0:
            priors.append(Prior(("J",), np.array([J.value]), np.array([[J.sigma**2]])))
        else:
            fixed["J"] = (
                (J.status if J.status != "estimated" else "given"),
                J.reason or "no standard deviation is known",
            )
    if prior is None and not _both_directions(fine):
        reason = "the axis moves in one direction only: friction, constant load and asymmetry cannot be separated"
        fixed |= {name: ("undetermined", reason) for name in ("M_0", "asymmetry")}
        unknown.discard("M_0")
    if delay is not None:
        fixed["delay"] = "given", ""
    elif (turns := reversals(fine)) < LEAST_REVERSALS:
        fixed["delay"] = "undetermined", f"{turns} reversal{'s'[: turns != 1]} only, {LEAST_REVERSALS} determine it"
    values |= hold
    fixed |= {name: ("held", "no stage determines it") if name in FIXED_PARAMETERS else ("given", "") for name in hold}
    values |= fit_sliding_friction(fine, values, unknown - set(hold))
    if prior is None:
        values["F_S"] = max(hold.get("F_S", values["F_C"]), values["F_C"])
        sliding_speed = np.abs(_sliding_speeds(fine))
        values["v_s"] = hold.get("v_s", 0.02 * float(np.max(sliding_speed)))
        typical = float(np.median(sliding_speed))
        if "v_log" not in hold and "v_log" not in free and typical > FAR_ABOVE * DEFAULT_SHAPES["v_log"]:
            values["v_log"] = typical / BEND
            fixed["v_log"] = "held", "a third of the typical speed, so that the logarithm bends where the axis moves"
    if fleet is not None:
        known = prior.correlation.names if prior is not None else ()
        fleet = fleet.restrict([name for name in fleet.names if name not in known and name not in fixed])
        starts = dict(zip(fleet.names, map(float, fleet.values), strict=True))
        values |= {name: value for name, value in starts.items() if name not in ("F_C", "sigma_2")}
        values["F_S"] = max(values["F_S"], values["F_C"])
        priors.append(fleet)
    values.setdefault("sigma_0", 0.0)
    reported = tuple(name for one in priors for name in one.names)
    return _KnownValues(values, Prior.join(priors), reported, fixed, drift)


def _both_directions(fine: Sequence[RecordTorque]) -> bool:
    # A slow way back counts as well as a fast one there: it is friction that both separate from the load.
    fast = _sliding_speeds(fine, REST_SPEED_SHARE)
    return LEAST_SHARE < float(np.mean(fast > 0)) < 1 - LEAST_SHARE


def _sliding_speeds(fine: Sequence[RecordTorque], share: float = 0.05) -> Array:
    """Speeds [rad/s] at the rows that are not near a reversal: above a share of the highest."""
    speed = np.concatenate([model.moved(0.0)[1] for model in fine])
    return np.asarray(speed[np.abs(speed) > share * np.max(np.abs(speed))])


def _base(known: _KnownValues, names: Collection[str], with_prior: bool, with_delay: bool) -> list[str]:
    """What is free at first."""
    wanted = ["sigma_0", "J", *(["delay"] if with_delay else [])]
    if with_prior:
        own = (name for name in PRE_SLIDING if name not in wanted and name in names and name not in LATE_PARAMETERS)
        wanted += [*own, *STATIONARY]
        wanted += [name for name in DEFAULT_SHAPES if name in known.determined_names]
    else:
        wanted += ["F_C", "sigma_2", "M_0", *(name for name in DEFAULT_SHAPES if name not in known.held)]
    return [name for name in wanted if name not in known.held]


def _first_weights(model: RecordTorque) -> Array:
    """Noise of the recorded torque per stretch [N.m], from its differences."""
    levels = [noise_of(model.record.torque[part.rows]) for part in model.parts]
    return np.asarray(np.maximum(levels, 1e-2 * model.recorded_rms()), dtype=np.float64)


def _weights(fine: Sequence[RecordTorque], solution: Solution, before: Sequence[Array]) -> list[Array]:
    """Of the residuals per stretch [N.m]."""
    made = []
    for model, state, weight in zip(fine, solution.states, before, strict=True):
        residual = model.residual(solution.values, float(state[0]), float(state[1]))
        levels = np.array([spread(residual[model.stretch == k]) for k in range(len(weight))])
        made.append(np.hypot(levels, MODEL_ACCURACY * float(np.sqrt(np.mean(model.measured**2)))))
    return made


def _drop_undetermined(
    search: Search, solution: Solution, base: list[str], known: _KnownValues, fixed: dict[str, tuple[Status, str]]
) -> tuple[Solution, list[str]]:
    """Without what the data do not determine, one after the other."""
    while (judged := verdict(solution, base, known.determined_names)) is not None:
        solution, base = _drop_parameters(search, solution, base, judged, known, fixed)
    return solution, base


def _drop_parameters(
    search: Search,
    solution: Solution,
    base: list[str],
    judged: Verdict,
    known: _KnownValues,
    fixed: dict[str, tuple[Status, str]],
) -> tuple[Solution, list[str]]:
    fixed |= {name: ("undetermined", reason) for name, reason in judged.reasons.items()}
    values = {**solution.values, **judged.held}
    remaining = [name for name in base if name not in judged.held]
    if not remaining:
        raise InputError(f"stage 2: these records determine no parameter at all; last {judged.name}: {judged.reason}")
    without = search.solve(values, solution.states, remaining, tolerance=FINAL, limit=40)
    known.leave_open(judged.held, solution, without)
    return without, remaining


def _add_group(
    search: Search,
    coarse: Sequence[RecordTorque],
    solution: Solution,
    base: list[str],
    group: tuple[str, ...],
    known: _KnownValues,
    fixed: dict[str, tuple[Status, str]],
) -> tuple[Solution, list[str]]:
    """With a group of parameters more, if the data ask for them and determine them."""
    added = [name for name in group if name not in known.held and name not in base]
    if not added or len(added) < len(group):
        return solution, base
    if group == ("asymmetry",) and not {"F_log", "v_s"} & set(base):
        fixed["asymmetry"] = "undetermined", "friction that hardly depends on speed leaves it a constant load"
        return solution, base
    general = not has_sines(search.models)
    if (
        general
        and {"sigma_1", "W", "spread", "skew", "C"} & set(added)
        and (rows := turnover_rows(search.models, solution)) < MIN_TURNOVER_ROWS
    ):
        reason = f"bristles turn over within {rows:.0f} rows of the log"
        fixed |= dict.fromkeys(added, ("undetermined", reason))
        return solution, base
    values = dict(solution.values)
    if "sigma_1" in added:
        values["sigma_1"] = 1e-2 * values["sigma_0"] * deflection(values)
    if "F_S" in added:
        values["F_S"] = 1.2 * values["F_C"]
    if "F_log" in added:
        values["F_log"] = 0.05 * values["F_C"]
    starts = [values]
    if {"W", "gamma"} <= set(added):
        starts = [
            start for start in grid(coarse, values, ["W", "gamma", "sigma_0"])[:FOLLOWED_STARTS] if start["W"] > 0
        ][:2]
    elif {"spread", "skew"} <= set(added):
        own = [name for name in ("sigma_0", "sigma_1") if name in base]
        starts = [values, *grid(coarse, values, [*added, *own])[: FOLLOWED_STARTS - 1]]
    elif "C" in added:
        starts = [{**values, "C": values["C"] * factor} for factor in (1.0, 0.2, 5.0)]
    tried = search.best(starts, solution.states, [*base, *added])
    # Weighted by what the richer model leaves: what it explains must not pass for noise that hides it.
    search = Search(search.models, known.prior, _weights(search.models, tried, search.weights))
    tried = search.solve(tried.values, tried.states, [*base, *added], tolerance=1e-6, limit=30)
    judged = verdict(tried, added)
    gain = search.cost(solution) - search.cost(tried)
    share = explained_share(search.models, solution, tried) if general else 1.0
    needed = -inf if not general and set(added) <= WITHOUT_NEUTRAL else MIN_GAIN_PER_PARAMETER * len(added)
    if judged is None and gain >= needed and share >= LEAST_EXPLAINED:
        for name in added:
            fixed.pop(name, None)
        known.open.pop(tuple(sorted(added)), None)
        return tried, [*base, *added]
    if judged is not None:
        rest = f"{GOES_WITH} {judged.name}"
        reasons = dict.fromkeys(added, rest) | judged.reasons
        known.leave_open(added, tried, solution)
    else:
        with_it = f"with {' and '.join(added)}" if len(added) > 1 else "with it"
        little = (
            f"sum of squares by {gain:.1f}" if share >= LEAST_EXPLAINED else f"by {100 * share:.2g} % of the torque"
        )
        reasons = dict.fromkeys(added, f"the residual hardly falls {with_it} ({little})")
    fixed |= {name: ("undetermined", reasons[name]) for name in added}
    return solution, base


def _mark_open_curve(known: _KnownValues, base: list[str]) -> dict[str, tuple[Status, str]]:
    """Friction over speed where sines alone leave a part of it open: that part is in all others, which are taken out of
    what is determined. Their values stay, as together they are what the sines show."""
    missing = [name for name in CURVE if any(name in names for names in known.open)]
    if not missing:
        return {}
    reason = f"sines alone leave {', '.join(missing)} open, for which it stands; strokes at constant speed determine it"
    remaining = [name for name in CURVE if name in base]
    base[:] = [name for name in base if name not in remaining]
    return {name: ("undetermined", reason) for name in remaining}


def _result(
    fine: Sequence[RecordTorque],
    search: Search,
    honest: Uncertainty,
    base: list[str],
    fixed: Mapping[str, tuple[Status, str]],
    I_P: float | None,
    prior: Stationary | None,
) -> Dynamic:
    names = tuple(name for name in names_of(fine[0].law) if name in base)
    result = honest.solution
    covariance = result.covariance(names)
    sigma = dict(zip(names, map(float, np.sqrt(np.diag(covariance))), strict=True))
    estimates = {}
    for name in names_of(fine[0].law):
        status, reason = fixed.get(name, ("estimated" if name in names else "held", ""))
        estimates[name] = estimate(name, result.values[name], sigma.get(name, nan), status, reason)
    without = dict(sigma)
    if "delay" in names:
        at = names.index("delay")
        given = covariance - np.outer(covariance[:, at], covariance[at]) / covariance[at, at]
        without = {name: float(np.sqrt(max(given[k, k], 0.0))) for k, name in enumerate(names) if name != "delay"}
    pieces = tuple(
        piece
        for model, weight, state in zip(fine, search.weights, result.states, strict=True)
        for piece in _stretches(model, weight, result.values, float(state[0]), float(state[1]))
    )
    rows = sum(len(piece.time) for piece in pieces)
    rms = float(np.sqrt(sum(len(piece.time) * piece.rms**2 for piece in pieces) / rows))
    return Dynamic(
        pieces,
        estimates,
        Correlation(names, correlation(covariance)),
        covariance,
        rms,
        without,
        advice(pieces, estimates, without, deflection(result.values), I_P),
        (*warn_undetermined(fixed, prior), *limits(honest, names, fine), *warn_extrapolation(fine, prior, I_P)),
    )


def _stretches(model: RecordTorque, weight: Array, values: Mapping[str, float], z: float, c: float) -> list[Stretch]:
    measured, friction = model.friction_measured(values), model.friction_model(values, z, c)
    speed = model.moved(values["delay"])[1]
    angle = np.asarray(model.motion.speed.antiderivative()(model.motion.time - values["delay"]))[model.rows]
    made = []
    for k, part in enumerate(model.parts):
        on = model.stretch == k
        time = model.record.time[model.rows[on]]
        size, level = part.amplitude, float(weight[k])
        signals = angle[on], speed[on], measured[on], friction[on]
        made.append(Stretch(model.record.name, part.kind, time, *signals, size, part.frequency, level))
    return made
