"""What a diagnosis says, in words that somebody at the machine acts on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feedsim.analysis.circle.diagnosis import Diagnosis, Term
from feedsim.analysis.circle.geometry import TurnedPath
from feedsim.analysis.figures import Array

# Of a cause that makes less of G, and of the largest deviation, there is no sentence.
SHARE_NAMED = 0.05
# Noise that is this share of G leaves little to diagnose.
NOISE_SHARE = 0.3
# An angle of the written angles [rad], and what they make uncertain [m], of which there is a word.
ANGLE, UNCERTAIN = math.radians(0.5), 0.2e-6
# Rate of a turn [rad/s] at which peaks of friction die away well within a quarter turn.
SLOW_TURN_RATE = 2.0
# Of a cause that lies elsewhere than where G is measured there is, if it alone makes so much of it.
BESIDES = 0.25
# A cause without which G does not fall is named from so many of its intervals on: terms that cancel look like causes.
MIN_CERTAINTY = 2.0
# Turns of one direction that differ by more than this share of G are not turns of one circle.
CONTRADICT = 0.5


def explain_circle(diagnosis: Diagnosis, remedy: str = "") -> str:
    """Why the circle is not round: quantity and value, the main cause with its size, the remedy.

    remedy: of the main cause, where more is known of the machine than the circle shows.
    """
    terms = actionable_causes(diagnosis)
    G = f"G = {_um(diagnosis.G)}"
    if diagnosis.arc is not None:
        G = f"on {_arc(diagnosis)} the radial deviation ranges over {_um(diagnosis.G)}"
    if diagnosis.apart > CONTRADICT * diagnosis.G:
        return (
            f"{G}: turns that were read as one direction contradict each other by {_um(diagnosis.apart)}, so no cause "
            "is named. One may have been driven the other way: angles that rise from row to row are read as "
            "counterclockwise, angles that fall as clockwise. Reverse the rows of that turn, or give each by itself."
        )
    if not terms:
        return f"{G}. No single cause stands out; {_um(_rest_term(diagnosis).size)} remain unexplained."
    what, own_remedy = describe_term(diagnosis, terms[0])
    remedy = remedy or own_remedy
    said = [
        f"{'Main' if terms[0].share > 0.5 else 'Largest'} cause: {what}",
        *([f"Remedy: {remedy}"] if remedy else []),
    ]
    others = [describe_term(diagnosis, term)[0] for term in terms[1:3]]
    return ". ".join([G, *said, *(f"Also: {what}" for what in others)]) + "." + _trust(diagnosis)


def describe_causes(diagnosis: Diagnosis) -> list[tuple[Term, str]]:
    """Every term with its sentence, those that are separated from zero first, by how much G falls without them."""
    return [(term, cause_sentence(diagnosis, term)) for term in diagnosis.terms]


def actionable_causes(diagnosis: Diagnosis) -> list[Term]:
    """Causes that somebody can act on, the largest first."""
    able = [
        term for term in diagnosis.terms
        if term.shows and term.key not in ("rest", "radius")
        and (term.gain > 0 or not abs(term.value) < MIN_CERTAINTY * term.half)
    ]  # fmt: skip
    result = [term for term in able if term.share >= SHARE_NAMED and term.size >= SHARE_NAMED * diagnosis.G]
    besides = [
        term for term in able if term not in result and term.key != "offset" and term.size >= BESIDES * diagnosis.G
    ]
    return [*sorted(result, key=lambda term: (-term.gain, -term.share)), *sorted(besides, key=lambda term: -term.size)]


def cause_sentence(diagnosis: Diagnosis, term: Term) -> str:
    """A cause in words, with its amount and where to look."""
    what, remedy = describe_term(diagnosis, term)
    return f"{what}; remedy: {remedy}" if remedy else what


def describe_term(diagnosis: Diagnosis, term: Term) -> tuple[str, str]:
    """A cause with its amount, and the remedy; "" where the cause says it, or none is known."""
    first, second = diagnosis.circle.axes
    value, axis = term.value, term.axis
    amount = abs(value)
    if not term.determined:
        reverses = term.key == "peaks" or (term.key == "lost_motion" and not diagnosis.reverses(axis))
        return f"{term_name(term)}: not determined{f', as {axis} does not reverse on the arc' if reverses else ''}", ""
    if not term.shows and term.key not in ("rest", "peaks"):
        return f"{term_name(term)}: cannot be distinguished from zero", ""
    match term.key:
        case "offset":
            return f"the centre lies {_um(amount)} off", "set up the measurement again, or look for drift"
        case "radius":
            return (
                f"the radius is {_um(amount)} too {'large' if value > 0 else 'small'}: "
                f"{_explain_lag(diagnosis, value)}",
                "",
            )
        case "scale":
            more, less = (first, second) if value > 0 else (second, first)
            return (
                f"{more} travels {_digits(amount * 1e6)} um/m more than {less}: "
                f"{_explain_gain_difference(diagnosis, value)}",
                "",
            )
        case "squareness":
            return (
                f"squareness: the angle between {first}+ and {second}+ is {_two_digits(amount * 1e6)} um/m "
                f"{'less' if value > 0 else 'more'} than 90 deg"
            ), "align the guideways, or change their squareness compensation"
        case "servo":
            late, early = (first, second) if value > 0 else (second, first)
            time = f"{_two_digits(amount * 1e3)} ms"
            return (
                f"servo mismatch: {late} lags {early} by {time}",
                f"raise K_v or feedforward of {late}, or delay {early} by {time} (T_dyn)",
            )
        case "squareness_or_servo":
            sense = diagnosis.senses[0]
            delay = 2 * amount / diagnosis.circle.speed * 1e3
            late, early = (first, second) if sense * value > 0 else (second, first)
            return (
                f"an ellipse along {'+' if value > 0 else '-'}45 deg of {_um(amount)} amplitude: servo mismatch "
                f"({late} lags {early} by {_two_digits(delay)} ms) or squareness "
                f"({_digits(2 * amount / diagnosis.circle.radius * 1e6)} um/m)"
            ), "record the other direction; it separates the two"
        case "lost_motion" if value > 0:
            return f"lost motion of {axis} ({_um(amount)}), caused by backlash or wind-up", "backlash compensation"
        case "lost_motion":
            return (
                f"{axis} gains {_um(amount)} where it reverses, caused by too much backlash compensation, or friction "
                "at rest"
            ), "less backlash compensation"
        case "peaks":
            return _peaks(diagnosis, term)
        case "pitch":
            return (
                f"pitch error of {axis} ({_um(amount)} amplitude)",
                "check screw and motor encoder, or compensate the pitch",
            )
        case "cogging":
            return (
                f"cogging of {axis} ({_two_digits(amount)} N.m amplitude, {term.order} times in a turn of the "
                f"motor), or "
                "torque that repeats with the screw"
            ), "cogging compensation"
        case "straightness":
            other = second if axis == first else first
            return (
                f"the guide of {axis} is bent by {_um(amount)} towards {other}{'+' if value > 0 else '-'} at the edges "
                f"of the circle: straightness, or an error of {other}'s position that grows with its square"
            ), ""
        case "third":
            return (
                f"guides are bent in third order by {_um(amount)} at the edges of the circle, {first}'s less "
                f"{second}'s: straightness"
            ), ""
        case "drift":
            return f"the centre moves by {_um(amount)} in a turn: temperature, or a set-up that is not firm", ""
        case "centres":
            return (
                f"the centres of {'both directions' if diagnosis.both else 'two turns'} lie {_um(amount)} apart: an "
                "eccentric pivot or probe, or drift between the turns"
            ), ""
        case "radii" if diagnosis.both:
            return (
                f"the mean radius of counterclockwise turns is {_um(amount)} {'larger' if value > 0 else 'smaller'} "
                "than that of clockwise ones: feeds that differ, or an instrument that drifts or gives way between "
                "the turns"
            ), ""
        case "radii":
            return f"the mean radii of two turns differ by {_um(amount)}: temperature, of machine or instrument", ""
    form = ", ".join(f"order {n}: {_um(a)}" for n, a in diagnosis.form.items())
    return f"what no cause explains: {_um(term.size)} from peak to valley{f' ({form})' if form else ''}", ""


def suggest_circles(diagnosis: Diagnosis) -> list[str]:
    """What one cannot determine from these turns, and which circle would: radius, feed or direction."""
    circle = diagnosis.circle
    if diagnosis.angles is None:
        return []
    of = {term.key: term for term in diagnosis.terms if not term.axis}
    result = []
    if diagnosis.arc is not None:
        result += _of_arc(diagnosis)
    if abs(diagnosis.angles.angle) > ANGLE:
        result.append(
            f"the angles of the record are {math.degrees(diagnosis.angles.angle):.1f} deg off, as the places of the "
            "reversals show; that is taken out"
        )
    if not diagnosis.both:
        result.append("squareness and servo mismatch are one: a circle in the other direction separates them")
    if of["third"].shows:
        result.append(
            "squareness and guides that are bent in third order are not fully separated: a circle of half the radius "
            f"does it ({circle.radius * 500:.3g} mm)"
        )
    turned = math.hypot(of["scale"].size, max(of[key].size for key in of if key.startswith("squareness"))) / 2
    if not diagnosis.angles.seen and 4 * diagnosis.angles.deviation * turned > UNCERTAIN:
        result.append(
            "no reversal shows, so the angles of the record may be off, and scale mismatch and squareness are not "
            f"fully separated: a slower circle of a smaller radius shows reversals ({circle.radius * 500:.3g} mm, "
            f"{circle.speed * 3e4:.3g} mm/min)"
        )
    slow = SLOW_TURN_RATE * circle.radius
    if circle.speed > 2 * slow:
        result.append(
            "the circle is fast: peaks of friction may take a quarter turn, and are then not separated from lost "
            f"motion, scale and servo mismatch: a feed of {slow * 6e4:.2g} mm/min separates them"
        )
    if "centres" in of and of["centres"].shows and of["centres"].size > UNCERTAIN:
        result.append(
            "an eccentric pivot and a drift between the turns are one: a second turn in the same direction separates "
            "them"
        )
    return [f"{text[0].upper()}{text[1:]}." for text in result]


def _arc(diagnosis: Diagnosis) -> str:
    return f"an arc of {math.degrees(diagnosis.arc or 0.0):.0f} deg"


def _of_arc(diagnosis: Diagnosis) -> list[str]:
    """What arcs do not determine, and what they do not separate."""
    result = [f"{_arc(diagnosis)} is no full turn: figures of ISO 230-4 are not determined"]
    if unknown := [term_name(term) for term in diagnosis.terms if not term.determined]:
        result.append(f"not determined on this arc: {', '.join(unknown)}")
    if len(trading := [term_name(term) for term in diagnosis.terms if term.key in diagnosis.unseparated]) > 0:
        result.append(
            f"this arc does not fully separate from other causes: {', '.join(trading)}; the intervals hold that, and a "
            "longer arc makes them smaller"
        )
    return result


def _explain_lag(diagnosis: Diagnosis, change: float) -> str:
    """What the mean radius is made of, as far as it can be known."""
    if diagnosis.lag is None:
        return (
            "path lag without speed feedforward, symmetry filter T_sym, or a scale of both axes; one feed cannot tell "
            "which: path lag grows with the square of the feed, a scale does not"
        )
    rest = change - diagnosis.lag
    return (
        f"path lag makes {_digits(diagnosis.lag * 1e6)} um by the response of the position loops (K_v, speed "
        f"feedforward, T_sym), friction or a scale {_digits(rest * 1e6)} um"
    )


def _explain_gain_difference(diagnosis: Diagnosis, value: float) -> str:
    """What unlike amplitudes are made of, as far as it can be known."""
    if diagnosis.unlike is None:
        return "scale, temperature or pitch compensation, or an unlike decrease of the amplitude by path lag"
    response = math.copysign(1.0, value) * diagnosis.unlike
    return (
        f"the response of the axes makes {_digits(response * 1e6)} um/m (K_v, speed feedforward, compliance behind a "
        f"motor encoder), scale, temperature or pitch compensation {_digits((abs(value) - response) * 1e6)} um/m"
    )


def _peaks(diagnosis: Diagnosis, term: Term) -> tuple[str, str]:
    own = [peak for peak in diagnosis.peaks if peak.axis == term.axis]
    largest = max(own, key=lambda peak: abs(peak.height))
    if largest.height == 0:
        limit = max((peak.half for peak in own if math.isfinite(peak.half)), default=math.nan)
        above = f" (above {_um(limit)})" if limit > 1e-8 else ""
        return f"where {term.axis} reverses nothing stands out{above}", ""
    wide = f", {_two_digits(largest.width * 1e3)} ms wide" if math.isfinite(largest.width) else ""
    if largest.height > 0:
        size = f"{_um(largest.height)} high{wide}"
        return f"reversal peaks of {term.axis} ({size}), caused by friction", "friction compensation"
    size = f"{_um(-largest.height)} ahead{wide}"
    return f"reversal peaks of {term.axis} ({size}), caused by too much friction compensation", "less of it"


def describe_vibrations(diagnosis: Diagnosis) -> str:
    """What vibrates between the reversals, in a sentence; "" where nothing stands out."""
    if not diagnosis.vibrations:
        return ""
    reported = [
        f"{vibration.axis or 'the radius'} {_um(vibration.amplitude)} (amplitude) at {vibration.frequency:.3g} Hz"
        for vibration in diagnosis.vibrations
    ]
    alone = "; a file of angle and radius does not name the axis" if not diagnosis.vibrations[0].axis else ""
    return f"Between the reversals swings {', '.join(reported)}{alone}."


def _trust(diagnosis: Diagnosis) -> str:
    if diagnosis.noise > NOISE_SHARE * diagnosis.G:
        return f" Noise of {_um(diagnosis.noise)} hides much: measure again, or more slowly."
    rest = _rest_term(diagnosis)
    if max(abs(rest.share), rest.size / diagnosis.G) > 0.5:
        return " The model explains less than half of G: look at the picture before acting on it."
    return ""


def _rest_term(diagnosis: Diagnosis) -> Term:
    return diagnosis["rest"]


def term_name(term: Term) -> str:
    """What a term is called."""
    names = {
        "offset": "centre offset", "radius": "mean radius", "scale": "scale mismatch", "squareness": "squareness",
        "servo": "servo mismatch", "squareness_or_servo": "squareness or servo mismatch",
        "lost_motion": f"lost motion of {term.axis}", "pitch": f"pitch error of {term.axis}",
        "peaks": f"reversal peaks of {term.axis}", "rest": "rest",
        "straightness": f"straightness of {term.axis}", "third": "straightness of third order",
        "cogging": f"cogging of {term.axis}, {term.order} per turn",
        "drift": "drift of the centre", "centres": "distance of the centres",
        "radii": "difference of the mean radii",
    }  # fmt: skip
    return names[term.key]


def _um(value: float) -> str:
    return f"{_two_digits(value * 1e6)} um"


def _two_digits(value: float) -> str:
    """Two digits that matter, no place before the point left out, and none after the third place behind it."""
    exponent = int(f"{value:.1e}".partition("e")[2])
    return f"{value:.{min(max(0, 1 - exponent), 3)}f}"


def _digits(value: float) -> str:
    """Three digits that matter, and none after the third place behind the point."""
    exponent = int(f"{value:.2e}".partition("e")[2])
    return f"{value:.{min(max(0, 2 - exponent), 3)}f}"


# --- Two records of one circle, before and after a change: which causes have changed beyond doubt ---------------------


SET_UP = ("offset", "drift", "centres", "radii")  # they are of the measurement, and differ from record to record
# A peak that stands out of one record and not of the other moves what else is fitted, which means do not show.
LEAST_DIFFERING_SHARE = 0.5
BIN_WIDTH, PEAK_REACH = 10.0, 20.0  # [deg] of a mean; from an axis, within which peaks stand
LEVEL = 0.95  # at which no cause of the circle is named that has not changed


@dataclass(frozen=True)
class Change:
    """A cause before and after.

    Attributes:
        before, after: the cause. half: half of the interval of 95 % of its difference, in its unit.
        sure: whether it has changed beyond doubt, seen that all causes are asked.
    """

    before: Term
    after: Term
    half: float
    sure: bool

    @property
    def difference(self) -> float:
        """After less before, in the unit of the cause."""
        return self.after.value - self.before.value


def compare_terms(
    before: Diagnosis, after: Diagnosis, turns: Sequence[TurnedPath] = (), later: Sequence[TurnedPath] = ()
) -> list[Change]:
    """Every cause that both records determine, those first that have changed beyond doubt, by what they make of G.

    turns, later: the turns of both records. What the fits leave of both alike, errors of the machine that no cause
    makes, is no doubt about a difference: intervals are those of two estimates, times the share of what is left that
    differs (:func:`differing_share`). Of m causes each is held to 1 - (1 - 0.95)/m (C. E. Bonferroni, 1936), so that in
    95 of 100 pairs none is named that has not changed.
    """
    share, free = differing_share(before, after, turns, later)
    terms = {(term.key, term.axis, term.order): term for term in after.terms}
    pairs: list[tuple[Term, Term]] = [
        (term, terms[key])
        for term in before.terms
        if (key := (term.key, term.axis, term.order)) in terms and term.key not in ("rest", "offset")
        and term.determined and terms[key].determined
    ]  # fmt: skip
    from scipy.stats import t  # a run, which says why a circle is not round, does without

    wider = t.ppf(1 - (1 - LEVEL) / (2 * max(len(pairs), 1)), free) / t.ppf(0.5 + LEVEL / 2, free)
    changes = []
    for one, other in pairs:
        half = share * math.hypot(one.half, other.half)
        changes.append(Change(one, other, half, bool(abs(other.value - one.value) > wider * half)))
    return sorted(changes, key=lambda change: (not change.sure, -abs(change.after.size - change.before.size)))


def differing_share(
    before: Diagnosis, after: Diagnosis, turns: Sequence[TurnedPath], later: Sequence[TurnedPath]
) -> tuple[float, float]:
    """What is left of the difference of two records over what is left of both, from 0 to 1, and its degrees of freedom.

    1 and infinity where it is not known. Means over BIN_WIDTH stand for what acts on causes, which are slow; those
    about the reversals, where peaks stand over the rest, are left out. Student's quantile stands in for how well so few
    means, of which the causes have been fitted, know it.
    """
    means = {}
    for which, diagnosis, paths in (("before", before, turns), ("after", after, later)):
        rest = dict(zip(diagnosis.senses, diagnosis.rest, strict=True))
        means[which] = {path.sense: _binned_means(path, *rest[path.sense]) for path in paths if path.sense in rest}
    senses = [sense for sense in means["before"] if sense in means["after"]]
    if not senses:
        return 1.0, math.inf
    one, other = (np.concatenate([means[which][sense] for sense in senses]) for which in ("before", "after"))
    known = np.isfinite(one) & np.isfinite(other)
    free = int(known.sum()) - len(before.terms)
    both = float(np.var(one[known]) + np.var(other[known])) if free > 4 else 0.0
    if both <= 0:
        return 1.0, math.inf
    from scipy.stats import norm, t

    share = math.sqrt(float(np.var((other - one)[known])) / both)
    return min(1.0, max(LEAST_DIFFERING_SHARE, share * float(t.ppf(0.975, free) / norm.ppf(0.975)))), float(free)


def _binned_means(path: TurnedPath, angle: Array, rest: Array) -> Array:
    """Means over BIN_WIDTH of what the fit leaves of a turn [m]; NaN near the axes, and where nothing is recorded."""
    about = np.argsort(angle % (2 * math.pi))
    own = path.angle % (2 * math.pi)
    remainder = path.deviation - np.interp(own, (angle % (2 * math.pi))[about], rest[about], period=2 * math.pi)
    degrees = np.degrees(own)
    far = np.abs((degrees + 45) % 90 - 45) > PEAK_REACH
    bins = (degrees / BIN_WIDTH).astype(int) % round(360 / BIN_WIDTH)
    count = np.bincount(bins[far], minlength=round(360 / BIN_WIDTH))
    with np.errstate(invalid="ignore", divide="ignore"):
        means = np.bincount(bins[far], remainder[far], minlength=round(360 / BIN_WIDTH)) / count
        return np.asarray(np.where(count > 0, means, math.nan), dtype=np.float64)


def sure_changes(changes: Sequence[Change]) -> list[Change]:
    """Causes of the machine that have changed beyond doubt."""
    return [change for change in changes if change.sure and change.before.key not in SET_UP]
