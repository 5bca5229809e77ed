"""Two records of one circle, before and after a change: which causes have changed beyond doubt."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, t

from feedsim.analysis.circle.diagnosis import Diagnosis, Term
from feedsim.analysis.circle.geometry import TurnedPath
from feedsim.analysis.figures import Array

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


def changed(
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
        means[which] = {path.sense: _means(path, *rest[path.sense]) for path in paths if path.sense in rest}
    senses = [sense for sense in means["before"] if sense in means["after"]]
    if not senses:
        return 1.0, math.inf
    one, other = (np.concatenate([means[which][sense] for sense in senses]) for which in ("before", "after"))
    known = np.isfinite(one) & np.isfinite(other)
    free = int(known.sum()) - len(before.terms)
    both = float(np.var(one[known]) + np.var(other[known])) if free > 4 else 0.0
    if both <= 0:
        return 1.0, math.inf
    share = math.sqrt(float(np.var((other - one)[known])) / both)
    return min(1.0, max(LEAST_DIFFERING_SHARE, share * float(t.ppf(0.975, free) / norm.ppf(0.975)))), float(free)


def _means(path: TurnedPath, angle: Array, rest: Array) -> Array:
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


def named(changes: Sequence[Change]) -> list[Change]:
    """Causes of the machine that have changed beyond doubt."""
    return [change for change in changes if change.sure and change.before.key not in SET_UP]
