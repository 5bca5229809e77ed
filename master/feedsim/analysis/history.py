"""Values over months: what has changed beyond doubt, as a rate or as steps, and when a limit is reached; how far
machines of one kind scatter.

Every value y_k of a date t_k has the standard deviation s_k of its own result. Results scatter besides by what their
intervals do not hold, such as temperature and the way the record was made: var(y_k) = s_k^2 + tau^2. tau^2 makes the
weighted sum of squares about a model what it is expected to be, its degrees of freedom, and is not below 0 (R. Paule,
J. Mandel, J. Res. NBS 87, 1982; of models with covariates: R. DerSimonian, R. Kacker, Contemp. Clin. Trials 28, 2007).
Scatter that is independent from date to date is therefore never taken for a change, however small the intervals are.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, chdtri, fdtrc

from feedsim.estimation.least_squares import NORMAL_95, student

Array = NDArray[np.float64]

ERROR_RATE = 0.01  # chance that any quantity is said to change though none does; likewise that a model is too large
MIN_RECORDS = 3  # two dates may differ by scatter between records
LEAST_SEGMENT = 2  # records before, and between, steps: one alone is an outlier; behind the last step one will do
MAX_TWO_STEP_RECORDS = 100  # records up to which two steps are looked for: their pairs grow with the square
# Of likelihoods, from which on a rate is distinguished from a step: evidence of that strength is misleading in at most
# one of 100 cases (R. Royall, Statistical Evidence, 1997).
LIKELIHOOD_RATIO = 100.0
SINGULAR = 1e-9  # of a column: what is left of it beside the others, where it says nothing of its own
LEAST_SIGMA = 1e-9  # of the values' size: no standard deviation is taken for less
ITERATIONS, ACCURACY = 60, 1e-6  # steps of Newton's method at most, and the last one over tau^2
MAX_EXTRAPOLATION = 36525.0  # [days] beyond the last record, from which on a limit counts as not reached


@dataclass(frozen=True, eq=False)
class Series:
    """A quantity over time.

    Attributes:
        days: (K,) [d], ascending. value: (K,) in `unit`. sigma: (K,) standard deviations, nan where a result has none.
        covariates: name -> (K,), such as temperature: what explains a value is not taken for a change.
    """

    name: str
    unit: str
    days: Array
    value: Array
    sigma: Array
    covariates: Mapping[str, Array] = field(default_factory=dict)

    def known_sigma(self) -> Array:
        """(K,) with a floor. Where one is missing it is the median of the others; without any the scatter says all."""
        # A figure that is 0 at all dates, such as a peak that no circle has: the square of the floor is not 0.
        least = LEAST_SIGMA * max(float(np.max(np.abs(self.value))), 1e-100)
        there = np.isfinite(self.sigma)
        usual = float(np.median(self.sigma[there])) if np.any(there) else 0.0
        return np.asarray(np.maximum(np.where(there, self.sigma, usual), least))

    @cached_property
    def columns(self) -> dict[str, Array]:
        """Covariate -> (K,) about its mean, over its standard deviation, if it varies by itself and leaves dates for a
        change."""
        result: dict[str, Array] = {}
        for name, values in self.covariates.items():
            spread = float(np.std(values))
            if not spread > 0 or len(values) < len(result) + 1 + MIN_RECORDS:
                continue
            trial = {**result, name: (values - np.mean(values)) / spread}
            if np.linalg.matrix_rank(np.column_stack([np.ones(len(values)), *trial.values()]), 1e-6) > len(trial):
                result = trial
        return result

    def base(self) -> Array:
        """(K, B) of the model 'constant': 1, and the covariates."""
        return np.column_stack([np.ones(len(self.days)), *self.columns.values()])


@dataclass(frozen=True, eq=False)
class WeightedFit:
    """Weighted least squares of M designs of one shape.

    coefficients (M, P), covariance (M, P, P), residuals (M, K), tau2 (M,), weights (M, K). free: degrees of freedom.
    regular: (M,) whether the design determines all coefficients.
    """

    coefficients: Array
    covariance: Array
    residuals: Array
    tau2: Array
    weights: Array
    free: int
    regular: NDArray[np.bool_]

    @property
    def squares(self) -> Array:
        """(M,) weighted sums of squares."""
        return np.asarray(np.sum(self.weights * self.residuals**2, axis=-1))


def solve(designs: Array, value: Array, variance: Array) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Coefficients (M, P), covariance (M, P, P), residuals (M, K) of designs (M, K, P) with variances (M, K)."""
    root = 1.0 / np.sqrt(variance)
    scaled = designs * root[..., None]
    norms = np.maximum(np.linalg.norm(scaled, axis=1, keepdims=True), 1e-300)
    q, r = np.linalg.qr(scaled / norms)
    diagonal = np.abs(np.diagonal(r, axis1=-2, axis2=-1))
    regular = np.all(diagonal > SINGULAR, axis=-1)
    r = np.where(regular[:, None, None], r, np.eye(r.shape[-1]))
    projected = np.einsum("mkp,mk->mp", q, value * root)
    inverse = np.linalg.inv(r) / np.swapaxes(norms, 1, 2)
    coefficients = np.einsum("mpq,mq->mp", inverse, projected)
    return (
        coefficients,
        inverse @ np.swapaxes(inverse, 1, 2),
        value - np.einsum("mkp,mp->mk", designs, coefficients),
        regular,
    )


def fit_weighted(designs: Array, value: Array, sigma: Array, target: float | None = None) -> WeightedFit:
    """Least squares of designs (M, K, P), each with the tau^2 of Paule and Mandel; K > P.

    target: what the sum of squares is to be; None: the degrees of freedom.

    Newton's method on target/squares, which is a straight line where all standard deviations are alike.
    """
    count, records, columns = designs.shape
    free = records - columns
    wanted = float(free) if target is None else target
    tau2 = np.zeros(count)
    for _ in range(ITERATIONS):
        variance = sigma**2 + tau2[:, None]
        coefficients, covariance, residuals, regular = solve(designs, value, variance)
        squares = np.maximum(np.sum(residuals**2 / variance, axis=1), 1e-300)
        slope = np.maximum(np.sum((residuals / variance) ** 2, axis=1), 1e-300)
        better = np.maximum(tau2 + (squares / wanted - 1.0) * squares / slope, 0.0)
        if np.all(np.abs(better - tau2) <= ACCURACY * better):
            break
        tau2 = better
    return WeightedFit(coefficients, covariance, residuals, tau2, 1.0 / variance, free, regular)


# --- Models of a change: constant, a rate, steps, a rate with steps ---------------------------------------------------


@dataclass(frozen=True, eq=False)
class FittedChange:
    """A model of a change, fitted.

    Attributes:
        rate: whether it has one. steps: indices of the first records behind each step.
        coefficients (P,), covariance (P, P): level at the mean date, coefficients of the covariates, rate [1/d], steps.
        tau2: variance of the scatter that the intervals of the results do not hold. free: degrees of freedom.
        squares: weighted sum of squares. log_likelihood: less the logarithm of how many places the steps could have.
    """

    series: Series
    rate: bool
    steps: tuple[int, ...]
    coefficients: Array
    covariance: Array
    tau2: float
    free: int
    squares: float
    log_likelihood: float

    @property
    def elements(self) -> int:
        """How many changes there are: the rate, and every step."""
        return int(self.rate) + len(self.steps)

    def row(self, day: float, behind: int | None = None) -> Array:
        """(P,) of a date, with covariates at their means. behind: number of steps that lie behind it; None: all of the
        steps up to that date, of which each happens at the first record behind it."""
        series = self.series
        covariates = self.coefficients.size - 1 - self.elements
        if behind is None:
            behind = sum(day >= series.days[k] for k in self.steps)
        rate = [day - float(np.mean(series.days))] if self.rate else []
        return np.array([1.0, *[0.0] * covariates, *rate, *(float(k < behind) for k in range(len(self.steps)))])

    def level(self, day: float, behind: int | None = None) -> tuple[float, float]:
        """Value and half of its interval of 95 %."""
        row = self.row(day, behind)
        return float(row @ self.coefficients), student(self.free) * math.sqrt(
            max(float(row @ self.covariance @ row), 0.0)
        )

    def adjusted_values(self) -> Array:
        """(K,) values at the means of the covariates."""
        own = (
            np.stack(list(self.series.columns.values()), 1)
            if self.series.columns
            else np.zeros((len(self.series.days), 0))
        )
        return np.asarray(self.series.value - own @ self.coefficients[1 : 1 + own.shape[1]])

    def coefficient(self, k: int) -> tuple[float, float]:
        """Value and half of its interval of 95 %; k: its place, from the end where it is negative."""
        return float(self.coefficients[k]), student(self.free) * math.sqrt(float(self.covariance[k, k]))

    def rate_per_day(self) -> tuple[float, float]:
        """Rate [unit/d] and half of its interval of 95 %."""
        return self.coefficient(-self.elements)

    def step_sizes(self) -> list[tuple[float, float]]:
        """Size of every step and half of its interval of 95 %."""
        return [self.coefficient(k - len(self.steps)) for k in range(len(self.steps))]


@dataclass(frozen=True, eq=False)
class _Class:
    """All models with the same elements: with a rate or not, and so many steps."""

    rate: bool
    steps: int
    places: tuple[tuple[int, ...], ...]
    designs: Array  # (M, K, P)

    @property
    def elements(self) -> int:
        return int(self.rate) + self.steps


def _classes(series: Series) -> Iterator[_Class]:
    """Every class that the number of records allows, the smallest ones first."""
    records, base = len(series.days), series.base()
    line = (series.days - np.mean(series.days))[:, None]
    behind = np.arange(records)[:, None] >= np.arange(records)  # (K, J): record k lies behind a step at j
    for steps, rate in ((0, False), (0, True), (1, False), (1, True), (2, False), (2, True)):
        if base.shape[1] + steps + rate >= records or (steps > 1 and records > MAX_TWO_STEP_RECORDS):
            continue
        places = tuple(
            place
            for place in combinations(range(LEAST_SEGMENT, records), steps)
            if all(b - a >= LEAST_SEGMENT for a, b in pairwise(place))
        )
        if places:
            fixed = np.hstack([base, line]) if rate else base
            designs = [np.hstack([fixed, behind[:, list(place)]]) for place in places]
            yield _Class(rate, steps, places, np.stack(designs))


def _fit_class(series: Series, one: _Class) -> tuple[FittedChange, WeightedFit]:
    """The likeliest model of a class, and the fits of all."""
    sigma = series.known_sigma()
    every = fit_weighted(one.designs, series.value, sigma)
    likelihood = 0.5 * np.sum(np.log(every.weights) - every.weights * every.residuals**2, axis=1)
    likelihood = np.where(every.regular, likelihood, -np.inf)
    k = int(np.argmax(likelihood))
    best = FittedChange(
        series,
        one.rate,
        one.places[k],
        every.coefficients[k],
        every.covariance[k],
        float(every.tau2[k]),
        every.free,
        float(every.squares[k]),
        float(likelihood[k]) - math.log(len(one.places)),
    )
    return best, every


def _probability(series: Series, small: _Class, place: tuple[int, ...], large: _Class, every: WeightedFit) -> float:
    """Chance that scatter alone makes any model of a class explain as much more than a smaller one as it does.

    F test at the weights of the larger model, times the number of its places (Bonferroni). `place`: the steps of the
    smaller model.
    """
    more = large.designs.shape[2] - small.designs.shape[2]
    design = small.designs[small.places.index(place)]
    designs = np.broadcast_to(design, (len(every.weights), *design.shape))
    _, _, residuals, _ = solve(designs, series.value, 1.0 / every.weights)
    gain = np.sum(every.weights * residuals**2, axis=1) - every.squares
    gain = np.where(every.regular, gain, 0.0)
    return min(1.0, len(large.places) * float(np.min(fdtrc(more, every.free, np.maximum(gain, 0.0) / more))))


@dataclass(frozen=True, eq=False)
class Change:
    """What has become of a quantity.

    Attributes:
        model: the smallest that no larger one improves on. It has no elements where the quantity has not changed.
        probability: of so much of a change by scatter alone, of this quantity by itself.
        threshold: what that has to be below, which minds how many quantities are tested; 0 where it is not tested.
        rival: the other model of as many elements where the dates fit both about as well, a rate and a step.
        excess: chance of so much scatter about the model if the intervals of the results held all of it; nan without
            intervals.
        constant: the model without a change.
    """

    series: Series
    model: FittedChange
    probability: float
    threshold: float
    rival: FittedChange | None
    excess: float
    constant: FittedChange

    @property
    def changed(self) -> bool:
        """Beyond doubt."""
        return self.model.elements > 0

    def step_window(self, which: int) -> tuple[int, int]:
        """Indices of the last record that is surely ahead of a step, and of the first surely behind it (95 %)."""
        series, place = self.series, self.model.steps
        one = next(c for c in _classes(series) if (c.rate, c.steps) == (self.model.rate, len(place)))
        sigma2 = series.known_sigma() ** 2 + self.model.tau2
        # At the weights of the model: the others are as likely where their sum of squares is hardly more.
        kept = [
            p for p in one.places if all(a == b for k, (a, b) in enumerate(zip(p, place, strict=True)) if k != which)
        ]
        designs = np.stack([one.designs[one.places.index(p)] for p in kept])
        _, _, residuals, _ = solve(designs, series.value, np.broadcast_to(sigma2, (len(kept), len(sigma2))))
        squares = np.sum(residuals**2 / sigma2, axis=1)
        limit = float(np.min(squares)) + student(self.model.free) ** 2
        likely = [p[which] for p, size in zip(kept, squares, strict=True) if size <= limit]
        return min(likely) - 1, max(likely)


class _TestedClasses:
    """The classes of a series fitted, and the chance of 'constant'."""

    def __init__(self, series: Series) -> None:
        self.series = series
        self.classes = list(_classes(series))
        fits = [_fit_class(series, one) for one in self.classes]
        self.best = [best for best, _ in fits]
        self.every = [every for _, every in fits]
        self.probability = self.chance_of_improvement(0)

    def chance_of_improvement(self, k: int) -> float:
        """Chance that scatter alone makes any larger class explain so much more than class k."""
        larger = [n for n, one in enumerate(self.classes) if one.elements > self.classes[k].elements]
        chances = [
            _probability(self.series, self.classes[k], self.best[k].steps, self.classes[n], self.every[n])
            for n in larger
        ]
        return min([1.0, *(len(larger) * chance for chance in chances)])

    def conclude(self, threshold: float, named: bool) -> Change:
        """The smallest model that no larger one improves on, where the quantity is named."""
        levels = sorted({one.elements for one in self.classes}) if named else [0]
        chosen, rival = 0, None
        for level in levels:
            own = sorted(
                (k for k, one in enumerate(self.classes) if one.elements == level),
                key=lambda k: -self.best[k].log_likelihood,
            )
            if level == 0 and named:
                continue
            chosen = own[0]
            other = own[1] if len(own) > 1 else None
            close = other is not None and (
                self.best[chosen].log_likelihood - self.best[other].log_likelihood < math.log(LIKELIHOOD_RATIO)
            )
            rival = self.best[other] if close and other is not None else None
            if self.chance_of_improvement(chosen) >= ERROR_RATE:
                break
        model = self.best[chosen]
        return Change(self.series, model, self.probability, threshold, rival, _excess(model), self.best[0])


def changes(every: Sequence[Series]) -> list[Change]:
    """What has changed beyond doubt, of all quantities together.

    The probability that any is named though none changes is ERROR_RATE at most (S. Holm, Scand. J. Statist. 6, 1979),
    whether they are correlated or not. A quantity of fewer than MIN_RECORDS dates is not tested.
    """
    tested = {k: _TestedClasses(series) for k, series in enumerate(every) if testable(series)}
    result: dict[int, Change] = {}
    named = True
    for rank, k in enumerate(sorted(tested, key=lambda k: tested[k].probability)):
        threshold = ERROR_RATE / (len(tested) - rank)
        named = named and tested[k].probability < threshold
        result[k] = tested[k].conclude(threshold, named)
    return [result[k] if k in result else _mean_change(series) for k, series in enumerate(every)]


def testable(series: Series) -> bool:
    """Whether there are dates enough to distinguish a change from scatter between records."""
    return len(series.days) >= MIN_RECORDS


def _excess(model: FittedChange) -> float:
    """Chance of so much scatter about a model if the intervals of the results held all of it."""
    series = model.series
    if not np.all(np.isfinite(series.sigma)):
        return math.nan
    design = np.stack([model.row(float(day)) for day in series.days])
    base = series.base()
    design[:, 1 : base.shape[1]] = base[:, 1:]
    _, _, residuals, _ = solve(design[None], series.value, series.known_sigma()[None] ** 2)
    return float(chdtrc(model.free, np.sum(residuals**2 / series.known_sigma() ** 2)))


def _mean_change(series: Series) -> Change:
    """Of a series that is too short: its mean."""
    base = np.ones((1, len(series.days), 1))
    if len(series.days) < 2:
        sigma2 = float(series.known_sigma()[0]) ** 2
        model = FittedChange(series, False, (), series.value[:1], np.array([[sigma2]]), 0.0, 1, 0.0, 0.0)
        return Change(series, model, 1.0, 0.0, None, math.nan, model)
    fit = fit_weighted(base, series.value, series.known_sigma())
    model = FittedChange(
        series,
        False,
        (),
        fit.coefficients[0],
        fit.covariance[0],
        float(fit.tau2[0]),
        fit.free,
        float(fit.squares[0]),
        0.0,
    )
    return Change(series, model, 1.0, 0.0, None, _excess(model), model)


# --- When a limit is reached ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LimitCrossing:
    """When a quantity reaches a limit.

    Attributes:
        state: "ahead": it will, at its rate. "passed": it has, by its rate. "step": a step took it across. "beyond": it
            was there from the first record on. "never": it does not move towards it, or does so in over a century.
        day: [d]; nan where there is none. interval: of 95 %; its end is inf where the rate may be none.
    """

    state: str
    day: float = math.nan
    interval: tuple[float, float] = (math.nan, math.nan)


def find_limit_crossing(model: FittedChange, limit: float, side: int = 0) -> LimitCrossing:
    """The first date at which a model reaches a limit, with an interval by inverse prediction (E. Fieller, J. R. Stat.
    Soc. B 16, 1954): the dates at which the interval of the level holds the limit.

    side: 1 where the limit is passed upwards, -1 where downwards; 0: from the first record to the limit.
    """
    days = model.series.days
    begin, end = float(days[0]), float(days[-1])
    first, _ = model.level(begin, 0)
    side = side or int(np.sign(limit - first)) or 1
    if side * (first - limit) >= 0:
        return LimitCrossing("beyond", begin)
    rate = model.rate_per_day()[0] if model.rate else 0.0
    edges = [begin, *(float(days[k]) for k in model.steps), math.inf]
    for regime in range(len(model.steps) + 1):
        low, high = edges[regime], edges[regime + 1]
        if regime and side * (model.level(low, regime)[0] - limit) >= 0:
            before = float(days[model.steps[regime - 1] - 1])
            return LimitCrossing("step", low, (before, low))
        if side * rate <= 0:
            continue
        at = low + (limit - model.level(low, regime)[0]) / rate
        if at < high and at - end < MAX_EXTRAPOLATION:
            interval = _fieller(model, limit, regime, at)
            return LimitCrossing("passed" if at <= end else "ahead", at, interval)
    return LimitCrossing("never")


def _fieller(model: FittedChange, limit: float, regime: int, at: float) -> tuple[float, float]:
    """Dates about `at` at which the interval of the level holds the limit."""
    slope, half = model.rate_per_day()
    row, quantile = model.row(at, regime), student(model.free)
    k = model.coefficients.size - model.elements
    # (slope u)^2 = q^2 (v0 + 2 c u + v1 u^2) with u = date - at, where the level is the limit
    v0 = float(row @ model.covariance @ row)
    c = float(row @ model.covariance[:, k])
    a = slope**2 - half**2
    b, d = quantile**2 * c, quantile**2 * v0
    inner = b**2 + a * d
    if a <= 0:  # the rate may be none: the interval is open towards the future
        low = (b - math.sqrt(inner)) / a if inner > 0 and a < 0 else -math.inf
        return at + low if low <= 0 else -math.inf, math.inf
    root = math.sqrt(max(inner, 0.0))
    return at + (b - root) / a, at + (b + root) / a


# --- Machines of one kind ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Scatter:
    """A quantity of several machines, by a model of random effects: y = mean + machine + record, var(y) = between^2 +
    within^2 + s^2.

    Attributes:
        mean, half: and half of its interval of 95 %. machines, records: how many.
        between, within: standard deviations; nan where no machine has two records. Their intervals are of 95 % (Q
            profile: W. Viechtbauer, Stat. Med. 26, 2007).
        predicted: standard deviation of a value of a further machine, of which 1.96 on either side are the prediction
            interval of 95 % (J. Higgins et al., J. R. Stat. Soc. A 172, 2009): few machines make it wider.
    """

    name: str
    unit: str
    mean: float
    half: float
    machines: int
    records: int
    between: float
    between_interval: tuple[float, float]
    within: float
    within_interval: tuple[float, float]
    predicted: float


def scatter(name: str, unit: str, machines: Sequence[tuple[Array, Array]]) -> Scatter:
    """Between and within machines. machines: values (K,) and standard deviations (K,; nan: none) of each; two at
    least."""
    value = np.concatenate([values for values, _ in machines])
    empty = np.zeros(0)
    series = Series(name, unit, empty, value, np.concatenate([sigmas for _, sigmas in machines]))
    sigma = series.known_sigma()
    of = np.repeat(np.arange(len(machines)), [len(values) for values, _ in machines])
    own = (of[:, None] == np.arange(len(machines))).astype(float)
    within, within_interval, tau2 = math.nan, (math.nan, math.nan), 0.0
    if len(value) > len(machines):
        tau2 = float(fit_weighted(own[None], value, sigma).tau2[0])
        within, within_interval = math.sqrt(tau2), _profile(own, value, sigma)
    means, covariance, _, _ = solve(own[None], value, (sigma**2 + tau2)[None])
    ones, deviations = np.ones((len(machines), 1)), np.sqrt(np.diag(covariance[0]))
    fit = fit_weighted(ones[None], means[0], deviations)
    variance = float(fit.covariance[0, 0, 0])
    between2 = float(fit.tau2[0])
    half = student(len(machines) - 1) * math.sqrt(variance)
    return Scatter(
        name,
        unit,
        float(fit.coefficients[0, 0]),
        half,
        len(machines),
        len(value),
        math.sqrt(between2),
        _profile(ones, means[0], deviations),
        within,
        within_interval,
        math.sqrt(between2 + tau2 + variance) * student(len(machines) - 1) / NORMAL_95,
    )


def _profile(design: Array, value: Array, sigma: Array) -> tuple[float, float]:
    """Interval of 95 % of tau: the sum of squares is one of chi^2 there."""
    free = design.shape[0] - design.shape[1]
    low, high = (fit_weighted(design[None], value, sigma, float(chdtri(free, p))).tau2[0] for p in (0.025, 0.975))
    return math.sqrt(float(low)), math.sqrt(float(high))
