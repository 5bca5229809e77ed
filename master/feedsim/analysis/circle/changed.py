"""Two records of one circle, before and after a change: which causes have changed beyond doubt."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scipy.stats import norm

from feedsim.analysis.circle.diagnosis import Diagnosis, Term

SET_UP = ("offset", "drift", "centres", "radii")  # they are of the measurement, and differ from record to record
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


def changed(before: Diagnosis, after: Diagnosis) -> list[Change]:
    """Every cause that both records determine, those first that have changed beyond doubt, by what they make of G.

    The interval of a difference of two records is that of two independent estimates. Of m causes each is held to
    1 - (1 - 0.95)/m (C. E. Bonferroni, 1936), so that in 95 of 100 pairs none is named that has not changed.
    """
    terms = {(term.key, term.axis, term.order): term for term in after.terms}
    pairs: list[tuple[Term, Term]] = [
        (term, terms[key])
        for term in before.terms
        if (key := (term.key, term.axis, term.order)) in terms and term.key not in ("rest", "offset")
        and term.determined and terms[key].determined
    ]  # fmt: skip
    wider = norm.ppf(1 - (1 - LEVEL) / (2 * max(len(pairs), 1))) / norm.ppf(0.5 + LEVEL / 2)
    changes = []
    for one, other in pairs:
        half = math.hypot(one.half, other.half)
        changes.append(Change(one, other, half, bool(abs(other.value - one.value) > wider * half)))
    return sorted(changes, key=lambda change: (not change.sure, -abs(change.after.size - change.before.size)))


def named(changes: Sequence[Change]) -> list[Change]:
    """Causes of the machine that have changed beyond doubt."""
    return [change for change in changes if change.sure and change.before.key not in SET_UP]
