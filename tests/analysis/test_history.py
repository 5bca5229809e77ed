"""Changes over months: false alarms, wear that is named, steps that are no rates, dates of limits, scatter."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize
from scipy.stats import f as fisher
from scipy.stats import t as student

from feedsim.analysis.history import (
    ERROR_RATE,
    Change,
    FittedChange,
    Series,
    changes,
    find_limit_crossing,
    fit_weighted,
    scatter,
)

Array = NDArray[np.float64]
MONTH = 30.4
# What feedsim identify friction gives of the logs of scenarios/histories: relative standard deviations of F_C, F_S,
# F_log, sigma_0 and W, and the scatter between records.
RELATIVE = (0.003, 0.001, 0.016, 0.0035, 0.003)
BETWEEN = 0.004


def months(count: int, random: np.random.Generator) -> Array:
    return MONTH * np.arange(count) + random.uniform(-3, 3, count)


def series(days: Array, level: Array, relative: float, between: float, random: np.random.Generator) -> Series:
    """A quantity with that level: sigma is its own, the scatter between records is not in it."""
    sigma = relative * random.uniform(0.8, 1.25, len(days))
    value = level + random.normal(size=len(days)) * np.hypot(sigma, between)
    return Series("F", "N.m", days, value, sigma)


def simulated(level: Array, days: Array, random: np.random.Generator, between: float = BETWEEN) -> list[Change]:
    """The quantity F_C with a level, and four others that do not change."""
    others = [series(days, np.ones(len(days)), relative, between, random) for relative in RELATIVE[1:]]
    return changes([series(days, level, RELATIVE[0], between, random), *others])


@pytest.mark.extensive
@pytest.mark.parametrize(("count", "between", "histories"), [(12, BETWEEN, 100), (12, 0.0, 50), (5, BETWEEN, 50)])
def test_false_alarms(count: int, between: float, histories: int) -> None:
    """1 % of 100 histories is 1; more than 2 have a probability of 8 % if the rate were as large as is stated."""
    random = np.random.default_rng(count)
    alarms = 0
    for _ in range(histories):
        days = months(count, random)
        alarms += any(one.changed for one in simulated(np.ones(count), days, random, between))
    assert alarms <= histories // 50


def test_wear_of_a_tenth_is_named_as_a_rate() -> None:
    random = np.random.default_rng(1)
    named, rates = 0, 0
    for _ in range(100):
        days = months(12, random)
        one = changes([series(days, 1 - 0.1 * days / days[-1], RELATIVE[0], BETWEEN, random)])[0]
        named += one.changed and one.probability < ERROR_RATE / 12  # as among the twelve quantities of an axis
        rates += one.model.rate and not one.model.steps and one.rival is None
    assert named >= 95
    assert rates >= 95


@pytest.mark.parametrize(("wear", "sizes"), [(0.0, {9: -0.38}), (0.1, {5: -0.1}), (0.0, {5: -0.2, 9: 0.1})])
def test_steps_are_found_as_steps(wear: float, sizes: dict[int, float]) -> None:
    """A preload that is lost, a lubrication while the axis wears, two events: with their dates, none as a rate."""
    random = np.random.default_rng(2)
    right, held = 0, 0
    for _ in range(50):
        days = months(12, random)
        level = 1 + wear * days / days[-1] + sum(size * (np.arange(12) >= k) for k, size in sizes.items())
        one = changes([series(days, level, RELATIVE[0], BETWEEN, random)])[0]
        right += one.model.steps == tuple(sizes) and one.model.rate == (wear > 0) and one.rival is None
        if one.model.steps == tuple(sizes):
            held += all(
                abs(size - true) <= half
                for (size, half), true in zip(one.model.step_sizes(), sizes.values(), strict=True)
            )
            windows = [one.step_window(k) for k in range(len(sizes))]
            assert all(low < k <= high for (low, high), k in zip(windows, sizes, strict=True))
    assert right >= 48
    assert held >= 0.85 * 50  # two intervals of 95 % at once: 45 of 50


def test_a_rate_and_a_step_that_cannot_be_told_apart_are_both_named() -> None:
    """Three dates at either end of a gap: what happened in between, nobody knows."""
    days = np.array([0.0, 2.0, 4.0, 200.0, 202.0, 204.0])
    value = np.array([1.0, 1.01, 0.99, 1.5, 1.51, 1.49])
    one = changes([Series("F", "N.m", days, value, np.full(6, 0.01))])[0]
    assert one.changed
    assert one.rival is not None
    assert {one.model.rate, one.rival.rate} == {True, False}


@pytest.mark.parametrize("between", [0.0, BETWEEN])
def test_the_date_of_a_limit_lies_in_its_interval(between: float) -> None:
    """Of a wear that is named: 95 % intervals hold the date in 90 of 100 cases or more."""
    random = np.random.default_rng(3)
    inside, count = 0, 0
    for _ in range(100):
        days = months(12, random)
        rate = 0.1 / (11 * MONTH)
        one = changes([series(days, 1 - rate * days, RELATIVE[0], between, random)])[0]
        at = find_limit_crossing(one.model, 0.8)
        if one.changed:
            count += 1
            assert at.state == "ahead"
            inside += at.interval[0] <= 0.2 / rate <= at.interval[1]
    assert count >= 95
    assert inside >= 0.9 * count


def test_the_interval_of_a_date_is_fiellers() -> None:
    """Its ends are where the interval of the level, by scipy's Student quantile, has the limit."""
    random = np.random.default_rng(4)
    days = months(12, random)
    model = changes([series(days, 1 - 0.002 * days, 0.01, 0.0, random)])[0].model
    at = find_limit_crossing(model, 0.1)
    design = np.column_stack([np.ones(12), days])
    weights = 1 / (model.series.sigma**2 + model.tau2)
    covariance = np.linalg.inv(design.T @ (design * weights[:, None]))
    line = covariance @ design.T @ (weights * model.series.value)

    def end(day: float, side: int) -> float:
        row = np.array([1.0, day])
        return float(row @ line + side * student.ppf(0.975, 10) * math.sqrt(row @ covariance @ row) - 0.1)

    assert at.interval[0] == pytest.approx(brentq(end, 300, at.day, (-1,)), rel=1e-6)
    assert at.interval[1] == pytest.approx(brentq(end, at.day, 2000, (1,)), rel=1e-6)


def test_the_chance_of_a_line_is_that_of_the_f_test() -> None:
    """With three dates only the line is tried: p of the F test on equal weights, where scatter is larger than sigma."""
    days, value = np.array([0.0, 10.0, 30.0]), np.array([1.0, 1.35, 1.9])
    one = changes([Series("F", "N.m", days, value, np.full(3, 1e-4))])[0]
    slope, level = np.polyfit(days, value, 1)
    rest = np.sum((value - level - slope * days) ** 2)
    gain = np.sum((value - value.mean()) ** 2) - rest
    line = float(fisher.sf(gain / rest, 1, 1))
    step = float(fisher.sf(np.sum((value - value.mean()) ** 2) / ((value[0] - value[1]) ** 2 / 2) - 1, 1, 1))
    assert one.probability == pytest.approx(2 * min(line, step), rel=1e-4)


def test_named_at_one_percent_in_all_whatever_their_number() -> None:
    """Holm: the least chance has to be below 1 % over the number of quantities."""
    random = np.random.default_rng(5)
    days = months(12, random)
    flat = [series(days, np.ones(12), 0.01, 0.0, random) for _ in range(20)]
    assert changes(flat)[0].threshold <= ERROR_RATE
    assert min(one.threshold for one in changes(flat)) == pytest.approx(ERROR_RATE / 20)


def test_a_warm_month_is_no_wear() -> None:
    """Friction that follows the temperature, which rises all year: without it a change, with it none."""
    random = np.random.default_rng(6)
    days = months(12, random)
    temperature = 20 + days / 60 + random.normal(size=12)
    value = 1 - 0.02 * (temperature - 22) + 0.003 * random.normal(size=12)
    bare = Series("F", "N.m", days, value, np.full(12, 0.003))
    known = Series("F", "N.m", days, value, np.full(12, 0.003), {"temperature [degC]": temperature})
    assert changes([bare])[0].changed
    one = changes([known])[0]
    assert not one.changed
    slope, half = (part / np.std(temperature) for part in one.model.coefficient(1))
    assert abs(slope + 0.02) < half < 0.005


def test_scatter_that_the_intervals_do_not_hold_is_no_change() -> None:
    """Intervals ten times too narrow: Cochran's test fails, the change is not named, and the scatter is."""
    random = np.random.default_rng(7)
    days = months(12, random)
    one = changes([series(days, np.ones(12), 0.001, 0.01, random)])[0]
    assert not one.changed
    assert one.excess < 1e-6
    assert math.sqrt(one.model.tau2) == pytest.approx(0.01, rel=0.5)


def test_limits_that_are_passed_and_that_are_not_reached() -> None:
    days = MONTH * np.arange(12.0)
    random = np.random.default_rng(8)

    def model(level: Array) -> FittedChange:
        return changes([series(days, level, 0.001, 0.0, random)])[0].model

    wear, lost = model(1 - 0.1 * days / days[-1]), model(1 - 0.4 * (np.arange(12) >= 9))
    assert find_limit_crossing(wear, 0.95).state == "passed"
    assert find_limit_crossing(wear, 0.95).day == pytest.approx(days[-1] / 2, rel=0.05)
    assert find_limit_crossing(wear, 1.2).state == "never"
    assert (
        find_limit_crossing(wear, 0.8, side=1).state == "beyond"
    )  # as a compensation that does not help from the first date on
    gained = model(-0.1 + 0.2 * days / days[-1])
    assert find_limit_crossing(gained, 0.0, side=1).state == "passed"
    assert find_limit_crossing(gained, 0.0, side=1).day == pytest.approx(days[-1] / 2, rel=0.05)
    assert find_limit_crossing(lost, 0.8).interval == (days[8], days[9])
    assert find_limit_crossing(lost, 0.5).state == "never"


# --- Machines of one kind ---------------------------------------------------------------------------------------------


def test_balanced_scatter_is_that_of_the_analysis_of_variance() -> None:
    """Two equal records each, no error of their own: closed form."""
    value = np.random.default_rng(9).normal(size=(6, 1)) * 0.1 + np.random.default_rng(10).normal(size=(6, 2)) * 0.03
    found = scatter("F", "N.m", [(row, np.full(2, math.nan)) for row in value])
    within = float(np.mean(np.var(value, axis=1, ddof=1)))
    between = float(np.var(value.mean(axis=1), ddof=1)) - within / 2
    assert found.within == pytest.approx(math.sqrt(within), rel=1e-6)
    assert found.between == pytest.approx(math.sqrt(between), rel=1e-6)
    assert found.mean == pytest.approx(value.mean())
    half = student.ppf(0.975, 5) * math.sqrt(np.var(value.mean(axis=1), ddof=1) / 6)
    assert found.half == pytest.approx(half, rel=1e-4)
    further = math.sqrt(between + within + np.var(value.mean(axis=1), ddof=1) / 6)
    assert 1.96 * found.predicted == pytest.approx(student.ppf(0.975, 5) * further, rel=1e-4)


def test_scatter_is_near_that_of_restricted_maximum_likelihood() -> None:
    """Unequal errors: Paule and Mandel beside REML by scipy, which weighs otherwise, within a fifth of its interval."""
    random = np.random.default_rng(11)
    sigma = random.uniform(0.01, 0.05, 12)
    value = 1 + random.normal(size=12) * np.hypot(sigma, 0.05)

    def loss(log_tau: Array) -> float:
        weights = 1 / (sigma**2 + math.exp(2 * float(log_tau[0])))
        mean = np.sum(weights * value) / np.sum(weights)
        return float(np.sum(weights * (value - mean) ** 2) - np.sum(np.log(weights)) + math.log(np.sum(weights)))

    reml = math.exp(float(minimize(loss, [-3.0], method="Nelder-Mead").x[0]))
    found = scatter("F", "N.m", [(np.array([v]), np.array([s])) for v, s in zip(value, sigma, strict=True)])
    low, high = found.between_interval
    assert low < reml < high
    assert abs(found.between - reml) < 0.2 * (high - low)
    assert math.isnan(found.within)


def test_intervals_of_the_scatter_hold_it_in_nineteen_of_twenty() -> None:
    """95 of 100; below 90 has a probability of 1 %."""
    random = np.random.default_rng(12)
    inside = 0
    for _ in range(100):
        machines = 1 + 0.1 * random.normal(size=8)
        groups = [(one + 0.02 * random.normal(size=2), np.full(2, 0.01)) for one in machines]
        low, high = scatter("F", "N.m", [(v + 0.01 * random.normal(size=2), s) for v, s in groups]).between_interval
        inside += low <= 0.1 <= high
    assert inside >= 90


def test_paule_and_mandel_make_the_sum_of_squares_the_degrees_of_freedom() -> None:
    random = np.random.default_rng(13)
    value, sigma = random.normal(size=20), random.uniform(0.01, 0.5, 20)
    found = fit_weighted(np.ones((1, 20, 1)), value, sigma)
    assert found.squares[0] == pytest.approx(19, rel=1e-8)
    assert fit_weighted(np.ones((1, 20, 1)), value, 100 * sigma).tau2[0] == 0.0
