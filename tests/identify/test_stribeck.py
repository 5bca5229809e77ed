"""Stationary friction from plateaus: values, confidence, what is held for lack of data, warnings with their reason."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from feedsim.estimation.identify import stribeck
from feedsim.estimation.identify import stribeck as drift
from feedsim.estimation.identify.parameters import curve, torque
from feedsim.estimation.identify.result import Plateau, Stationary
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.foundation.errors import InputError
from identify_records import I_P, SPEEDS, TRUE, stationary


def made(
    speeds: Sequence[float] = tuple(SPEEDS),
    p: Mapping[str, float] = TRUE,
    *,
    noise: float = 1e-5,
    seed: int | None = None,
    sides: Sequence[float] = (1.0, -1.0),
) -> list[Plateau]:
    """Plateaus whose standard deviation is a share of their torque; with a seed they are disturbed by it."""
    random = np.random.default_rng(seed)
    found = []
    for speed in speeds:
        for side in sides:
            exact = stationary(p, side * speed)
            sigma = noise * abs(exact)
            off = 0.0 if seed is None else sigma * float(random.standard_normal())
            found.append(Plateau("made", 0.0, 1.0, side * speed, exact + off, sigma, 500))
    return found


def check_curve(found: Stationary, p: Mapping[str, float], error: float) -> None:
    np.testing.assert_allclose(found.torque, curve(p, found.speeds), rtol=error)


@pytest.mark.parametrize(
    "change",
    [{}, {"M_0": -0.8}, {"asymmetry": 0.04}, {"M_0": 0.5, "asymmetry": -0.1}, {"F_log": 0.0}, {"sigma_2": 0.0}],
    ids=str,
)
def test_undisturbed_plateaus_give_the_truth(change: dict[str, float]) -> None:
    p = {**TRUE, **change}
    found = stribeck.stationary(made(p=p), I_P=I_P)
    for name in ("F_C", "F_S", "v_s", "F_log", "sigma_2", "asymmetry", "M_0"):
        estimate = found.estimates[name]
        assert estimate.status == "estimated", estimate.reason
        assert estimate.value == pytest.approx(p[name], rel=1e-6, abs=1e-7), name
    check_curve(found, p, 1e-7)
    assert found.range == pytest.approx((SPEEDS[0], SPEEDS[-1]))
    assert found.covariance.shape == (7, 7)
    assert {finding.code for finding in found.warnings} <= {"parameter-at-bound"}  # of what is 0 alone
    assert bool(found.warnings) == (0.0 in [change.get("F_log"), change.get("sigma_2")])


def test_held_values_are_freed_on_request() -> None:
    p = {**TRUE, "beta": 1.4, "v_log": 5.0}
    speeds = np.geomspace(SPEEDS[0], SPEEDS[-1], 24)
    found = stribeck.stationary(made(speeds, p), free=("beta", "v_log"))
    for name in ("beta", "v_log", "F_S", "v_s"):
        assert found.estimates[name].status == "estimated"
        assert found.estimates[name].value == pytest.approx(p[name], rel=1e-4)
    held = stribeck.stationary(made(speeds, p), hold={"beta": 1.4, "v_log": 5.0, "F_S": 2.1, "asymmetry": 0.0})
    assert held.estimates["F_S"].status == "held"
    assert held.estimates["F_S"].value == 2.1
    assert np.isnan(held.estimates["F_S"].sigma)
    assert held.estimates["F_C"].value == pytest.approx(1.6, rel=1e-6)


@pytest.mark.statistics
def test_confidence_and_band_are_the_scatter() -> None:
    names = ("F_C", "F_S", "v_s", "F_log", "sigma_2", "asymmetry", "M_0")
    values, curves, scores = [], [], []
    for seed in range(60):
        found = stribeck.stationary(made(noise=3e-3, seed=seed))
        values.append([found.estimates[name].value for name in names])
        scores.append([(found.estimates[name].value - TRUE[name]) / found.estimates[name].sigma for name in names])
        curves.append(found.torque)
    # A standard deviation of 60 draws is known to 9 %: three of it.
    assert np.all(np.abs(np.sqrt(np.mean(np.square(scores), axis=0)) - 1) < 0.3)
    np.testing.assert_allclose(np.std(curves, axis=0)[::20], found.sigma[::20], rtol=0.35)
    matrix = np.corrcoef(np.array(values).T)
    assert np.max(np.abs(matrix - found.correlation.matrix)) < 0.4  # of uncorrelated ones: 0.13 each


def test_scatter_beyond_the_noise_widens_the_confidence() -> None:
    random = np.random.default_rng(7)
    rough = [
        Plateau("x", 0, 1, p.speed, p.torque * (1 + 0.02 * float(random.standard_normal())), 1e-5, 500) for p in made()
    ]
    found = stribeck.stationary(rough)
    assert "plateaus-scatter" in [finding.code for finding in found.warnings]
    for name in ("F_C", "F_S", "M_0"):
        estimate = found.estimates[name]
        assert abs(estimate.value - TRUE[name]) < 4 * estimate.sigma
    assert found.estimates["F_S"].sigma > 0.005


def said(found: Stationary, code: str, place: str = "") -> bool:
    return any(finding.code == code and place in finding.place for finding in found.warnings)


def freeing(found: Stationary) -> list[str]:
    """Options that would let the curve fit better."""
    return [finding.remedy for finding in found.warnings if finding.remedy.startswith("--free")]


def test_warnings_name_their_reason() -> None:
    found = stribeck.stationary(made(SPEEDS[3:]), I_P=I_P)
    assert said(found, "lowest-speed-high")
    assert not said(found, "speeds-few")
    assert said(stribeck.stationary(made(SPEEDS[::2])), "speeds-few")
    found = stribeck.stationary(made(sides=(1.0,)))
    assert said(found, "one-direction-only")
    for name in ("M_0", "asymmetry"):
        assert found.estimates[name].status == "undetermined"
        assert found.estimates[name].value == 0.0
    assert found.estimates["F_C"].value == pytest.approx(1.6, rel=1e-6)
    # All speeds far below v_log: F_log / v_log and sigma_2 are one slope.
    slow = np.geomspace(0.01, 0.3, 10)
    p = {**TRUE, "v_s": 0.03}
    found = stribeck.stationary(made(slow, p, noise=1e-4))
    assert any("F_log" in finding.place for finding in found.warnings)
    check_curve(found, p, 1e-3)


def test_no_plateau_within_the_stribeck_range() -> None:
    fast = SPEEDS[SPEEDS > 5.0]
    found = stribeck.stationary(made(np.geomspace(fast[0], fast[-1], 10), noise=2e-3, seed=3), I_P=I_P)
    for name in ("v_s", "F_S"):
        assert found.estimates[name].status == "undetermined"
        assert found.estimates[name].reason
        assert said(found, "parameter-held", name)
    check_curve(found, TRUE, 0.02)


def test_a_level_that_does_not_vary_leaves_the_asymmetry_at_zero() -> None:
    p = {**TRUE, "F_S": 1.6, "F_log": 0.0, "M_0": 0.3}
    found = stribeck.stationary(made(p=p, noise=1e-4, seed=1))
    assert found.estimates["asymmetry"].status == "undetermined"
    assert "does not separate it from the constant load" in found.estimates["asymmetry"].reason
    assert found.estimates["M_0"].value == pytest.approx(0.3, abs=1e-3)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("start", [0, 6])
@pytest.mark.parametrize("sides", [(1.0, -1.0), (-1.0,)], ids=["both", "one"])
def test_few_speeds_never_fail_and_always_pass_through_the_data(
    count: int, start: int, sides: tuple[float, ...]
) -> None:
    speeds = SPEEDS[start : start + count]
    plateaus = made(speeds, noise=1e-3, seed=5, sides=sides)
    found = stribeck.stationary(plateaus, I_P=I_P)
    values = {name: estimate.value for name, estimate in found.estimates.items()}
    assert said(found, "speeds-few")
    for plateau in plateaus:
        # What is held cannot bend the curve by more than this over neighbouring speeds.
        assert torque(values, np.array([plateau.speed]))[0] == pytest.approx(plateau.torque, rel=0.03)
    assert sum(estimate.status == "estimated" for estimate in found.estimates.values()) <= len(plateaus)
    for estimate in found.estimates.values():
        assert estimate.status == "estimated" or estimate.reason


def test_refusals() -> None:
    with pytest.raises(InputError, match="no plateau of constant speed"):
        stribeck.stationary([])
    with pytest.raises(InputError, match=r"F_c is no parameter .* F_C, F_S"):
        stribeck.stationary(made(), hold={"F_c": 1.0})
    with pytest.raises(InputError, match="below F_C"):
        stribeck.stationary(made(), hold={"F_C": 2.0, "F_S": 1.0})


def test_the_same_seed_gives_the_same_result() -> None:
    first, second = (stribeck.stationary(made(noise=1e-2, seed=9), seed=4) for _ in range(2))
    assert [e.value for e in first.estimates.values()] == [e.value for e in second.estimates.values()]


@pytest.mark.parametrize(("name", "value"), [("beta", 1.5), ("v_log", 0.5)])
@pytest.mark.parametrize("noise", [1e-4, 1e-3])
def test_a_shape_that_is_held_wrongly_is_told(name: str, value: float, noise: float) -> None:
    plateaus = made(p={**TRUE, name: value}, noise=noise, seed=2)
    told = [finding.text for finding in stribeck.stationary(plateaus).warnings if finding.code == "plateaus-scatter"]
    assert len(told) == 1
    assert told[0].endswith(f"the curve fits the plateaus to their noise: --free {name}")
    freed = stribeck.stationary(plateaus, free=(name,))
    # No other start finds another value; three digits are written.
    assert f"with {name} free ({freed.estimates[name].value:.3g})" in told[0]
    assert abs(freed.estimates[name].value - value) < 4 * freed.estimates[name].sigma
    assert not freeing(freed)
    # What is held by request is not put into question.
    assert not freeing(stribeck.stationary(plateaus, hold={"beta": 1.0, "v_log": 3.0}))


@pytest.mark.statistics
@pytest.mark.parametrize("scatter", [1.0, 5.0], ids=["noise", "beyond"])
def test_scatter_is_no_shape(scatter: float) -> None:
    for seed in range(20):
        plateaus = made(noise=scatter * 1e-3, seed=seed)
        plateaus = [replace(plateau, sigma=plateau.sigma / scatter) for plateau in plateaus]
        found = stribeck.stationary(plateaus)
        assert said(found, "plateaus-scatter") or scatter == 1.0
        assert not freeing(found), seed


def test_a_shape_that_leaves_scatter_is_told_by_the_sum_of_squares() -> None:
    plateaus = made(p={**TRUE, "beta": 1.5}, noise=1e-3, seed=3)
    found = stribeck.stationary([replace(plateau, sigma=plateau.sigma / 3) for plateau in plateaus])
    assert freeing(found) == ["--free beta"]
    assert any("the sum of squares falls to" in finding.text for finding in found.warnings)


@pytest.mark.parametrize("noise", [1e-5, 1e-3])
@pytest.mark.parametrize("lowest", [350.0, 500.0, 1000.0])
def test_what_no_plateau_tells_widens_what_hangs_on_it(lowest: float, noise: float) -> None:
    speeds = np.geomspace(lowest, 20000.0, 10) / 60e3 / I_P
    away = []
    for seed in range(3):
        found = stribeck.stationary(made(speeds, noise=noise, seed=seed))
        told = [found.estimates[name] for name in ("F_C", "F_log", "sigma_2", "M_0")]
        assert all(each.status == "estimated" for each in told)
        away += [abs(each.value - TRUE[each.name]) / each.sigma for each in told]
    assert np.mean(np.array(away) < 2.0) >= 0.9, away


def test_a_direction_that_lacks_leaves_friction_and_load_open() -> None:
    found = stribeck.stationary(made(p={**TRUE, "M_0": 3.0}, sides=(1.0,)))
    F_C = found.estimates["F_C"]
    assert F_C.interval[0] < TRUE["F_C"] < F_C.interval[1]


@pytest.mark.parametrize(("warm", "noise"), [(0.0, 1e-4), (0.0, 1e-3), (0.05, 1e-4), (0.3, 1e-4), (0.3, 1e-3)])
def test_friction_that_drifts_between_repeated_speeds_is_told(warm: float, noise: float) -> None:
    """Viscous friction falls evenly from stroke to stroke; the four fastest speeds are driven once more at the end."""
    speeds = [*SPEEDS, *SPEEDS[8:]]
    found = []
    for k, speed in enumerate(speeds):
        p = {**TRUE, "sigma_2": TRUE["sigma_2"] * (1 - warm * k / (len(speeds) - 1))}
        found += [replace(each, begin=2.0 * k) for each in made([speed], p, noise=noise, seed=k)]
    told = stribeck.stationary(found)
    assert said(told, "friction-drifts") == (warm > 0)
    for name in ("F_C", "F_S", "v_s", "F_log", "sigma_2"):
        each = told.estimates[name]
        assert abs(each.value - TRUE[name]) < (4 if warm == 0 else 2.5) * each.sigma, name


def warming(speeds: Sequence[float], course: Callable[[float], float], noise: float, seed: int) -> list[Plateau]:
    """Strokes one after the other, ten seconds each; course: relative change of viscous friction by age, 0 to 1."""
    found: list[Plateau] = []
    last = 2 * len(speeds) - 1
    for k, speed in enumerate(speeds):
        for side, ahead in ((1.0, 0), (-1.0, 1)):
            p = {**TRUE, "sigma_2": TRUE["sigma_2"] * (1 + course((2 * k + ahead) / last))}
            stroke = made([speed], p, noise=noise, seed=100 * seed + 2 * k + ahead, sides=(side,))
            found += [replace(each, elapsed=5.0 * (2 * k + ahead)) for each in stroke]
    return found


@pytest.mark.parametrize("course", ["soon", "evenly", "suddenly"])
@pytest.mark.parametrize("share", [-0.05, -0.3])
def test_warming_that_no_speed_shows_is_in_the_intervals(share: float, course: str) -> None:
    """sigma_2 is that of the begin, when the axis is cold."""
    courses: dict[str, Callable[[float], float]] = {
        "soon": lambda age: share * (1 - np.exp(-5 * age)) / (1 - np.exp(-5)),
        "evenly": lambda age: share * age,
        "suddenly": lambda age: share * (age > 0.6),
    }
    found = stribeck.stationary(warming(SPEEDS, courses[course], 1e-5, 1))
    for name in ("F_C", "F_S", "v_s", "F_log", "sigma_2", "asymmetry", "M_0"):
        each = found.estimates[name]
        # A change at once of 30 % is 2.1 standard deviations of what is expected of one.
        assert abs(each.value - TRUE[name]) < 2.5 * each.sigma, name
    assert said(found, "warming-not-separated")
    assert found.estimates["sigma_2"].sigma > 0.15 * TRUE["sigma_2"]


def random_course(seed: int) -> Callable[[float], float]:
    """A course as warming is expected to take."""
    random = np.random.default_rng([7, seed])
    once, even = random.standard_normal(2)
    ages = np.linspace(0.0, 1.0, 1001)
    walk = np.concatenate([[0.0], np.cumsum(random.standard_normal(1000)) / np.sqrt(1000)])
    return lambda age: (
        drift.WARMING_DEVIATION / np.sqrt(3) * (once * (age > 0) + even * age + float(np.interp(age, ages, walk)))
    )


@pytest.mark.statistics
@pytest.mark.parametrize("order", ["slow to fast", "fastest first and last"])
def test_intervals_are_the_scatter_by_warming(order: str) -> None:
    speeds = [*SPEEDS] if order == "slow to fast" else [SPEEDS[-1], *SPEEDS]
    names = ("F_C", "F_log", "sigma_2")
    scores = []
    for seed in range(24):
        found = stribeck.stationary(warming(speeds, random_course(seed), 1e-4, seed))
        scores.append([(found.estimates[name].value - TRUE[name]) / found.estimates[name].sigma for name in names])
    within = np.mean(np.abs(scores) < NORMAL_95, axis=0)
    # 95 % of 24: 13 % are three standard deviations of that share.
    assert np.all(within > 0.82), within
    # An interval that is too wide would hold it all. Where a drift shows, it may be Coulomb friction's.
    size = np.sqrt(np.mean(np.square(scores), axis=0))
    assert np.all(size[1:] > 0.3), size


def test_a_fast_speed_that_comes_back_narrows_the_interval() -> None:
    def still(age: float) -> float:
        return 0.0

    once = stribeck.stationary(warming(SPEEDS, still, 1e-4, 0)).estimates["sigma_2"].sigma
    found = stribeck.stationary(warming([SPEEDS[-1], *SPEEDS], still, 1e-4, 0))
    assert found.estimates["sigma_2"].sigma < once / 8
    assert not said(found, "warming-not-separated")
    slow = stribeck.stationary(warming([SPEEDS[0], *SPEEDS], still, 1e-4, 0))
    assert slow.estimates["sigma_2"].sigma > once / 1.2  # a slow one shows no viscous friction
    assert said(slow, "warming-not-separated")


def test_the_part_by_warming_is_told_apart() -> None:
    """What stage 2 weighs by is the covariance of plateaus all driven at once."""
    plateaus = warming(SPEEDS, lambda age: 0.0, 1e-3, 0)
    found = stribeck.stationary(plateaus)
    at_once = stribeck.stationary([replace(each, elapsed=0.0) for each in plateaus])
    np.testing.assert_array_equal(at_once.drift, 0.0)
    # Values are the same to the solver's tolerance.
    np.testing.assert_allclose(found.covariance - found.drift, at_once.covariance, rtol=1e-6, atol=1e-12)
    scale = np.sqrt(np.diag(found.covariance))
    assert np.min(np.linalg.eigvalsh(found.drift / np.outer(scale, scale))) > -1e-9
