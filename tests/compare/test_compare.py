"""Comparing a result with a reference: the tube against brute force and pyfunnel, and what counts as the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compare_helpers import brute_bounds, changed, wave
from feedsim.comparison import Options, Tolerances, Variable, bounds, compare
from feedsim.files.trace import Array, Series, Trace
from feedsim.foundation.errors import InputError

EXACT = Tolerances.parse(["0"])


def only(result: Series, reference: Series, tolerance: str = "0", **options: object) -> Variable:
    """The one variable of a comparison."""
    found = compare(result, reference, Tolerances.parse([tolerance]), Options(**options))  # type: ignore[arg-type]
    assert len(found.variables) == 1, found.line
    return found.variables[0]


def series(time: object, values: object, unit: str = "") -> Series:
    return Series(np.asarray(time, dtype=float), {"x": np.asarray(values, dtype=float)}, {"x": unit})


# --- the tube -------------------------------------------------------------------------------------------------------

steps = st.lists(st.sampled_from([0.0, 0.25, 0.5, 1.0, 3.0]), min_size=2, max_size=25)


@given(
    steps=steps,
    seed=st.integers(0, 2**32 - 1),
    reach=st.sampled_from([0.0, 0.1, 0.5, 1.0, 2.75, 50.0]),
    start=st.sampled_from([0.0, -7.0, 1000.0]),
)
@settings(max_examples=300)
def test_tube_is_that_of_brute_force(steps: list[float], seed: int, reach: float, start: float) -> None:
    """Rows at one instant included; times are binary fractions, so that both see the same instants."""
    rng = np.random.default_rng(seed)
    time = start + np.cumsum(steps)
    values = rng.normal(size=len(time))
    at = np.unique(np.concatenate([time, rng.choice(np.arange(time[0], time[-1] + 0.125, 0.125), size=12)]))
    at = at[at <= time[-1]]
    low, high = bounds(time, values, at, reach)
    expected = np.array([brute_bounds(time.tolist(), values.tolist(), t, reach) for t in at.tolist()])
    # one rounding of a product and a sum of numbers of about 1
    np.testing.assert_allclose(low, expected[:, 0], rtol=0, atol=4e-15)
    np.testing.assert_allclose(high, expected[:, 1], rtol=0, atol=4e-15)


@given(seed=st.integers(0, 2**32 - 1), reach=st.sampled_from([1e-3, 0.03, 0.4]), amount=st.sampled_from([1e-3, 0.1]))
@settings(max_examples=40)
def test_deviations_are_those_of_pyfunnel(
    seed: int, reach: float, amount: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    pyfunnel = pytest.importorskip("pyfunnel")
    folder = tmp_path_factory.mktemp("funnel")
    rng = np.random.default_rng(seed)
    time = np.concatenate([[0.0], np.cumsum(rng.uniform(0.01, 0.1, size=60))])
    x = np.cumsum(rng.normal(size=61)) * 0.1
    at = np.concatenate([[0.0], np.sort(rng.uniform(0, time[-1], 80)), [time[-1]]])
    y = np.interp(at, time, x) + rng.normal(scale=0.1, size=len(at))
    assert pyfunnel.compareAndReport(time, x, at, y, str(folder), atolx=reach, atoly=amount) == 0
    errors = np.loadtxt(folder / "errors.csv", delimiter=",", skiprows=1)
    low, high = bounds(time, x, at, reach)
    off = np.maximum(np.maximum(y - high, low - y) - amount, 0.0)
    # pyfunnel cuts the corners of its polygon by interpolation and writes 16 digits
    np.testing.assert_allclose(errors[:, 1], off, rtol=0, atol=1e-9)


def test_tube_at_a_step_in_time() -> None:
    """Rows at one instant are a vertical edge: within the tolerance in time either value is right, beyond it is not."""
    reference = series([0, 1, 1, 2], [0, 0, 1, 1])
    for at, value, good in ((0.91, 1, True), (0.89, 1, False), (1.09, 0, True), (1.11, 0, False), (1.0, 0.5, True)):
        result = series([0, at, 2], [0, value, 1])
        found = only(result, reference, "0,0.1 s", hold=(), max_gap=None)
        assert (found.verdict == "same") is good, (at, value)


def test_late_times_and_rounding_of_time() -> None:
    """t = 1000 s + k h, added up by the result: an importer's clock. The reference has a step at an instant."""
    h = 125e-6
    k = np.arange(20_001)
    exact = 1000 + k * h
    added = 1000 + np.cumsum(np.r_[0.0, np.full(20_000, h)]) + 3e-12
    values = np.where(k < 8000, 0.0, 1.0)
    reference = Series(exact, {"flag": values, "ramp": 1e-3 * k}, {})
    assert compare(Series(added, {"flag": values, "ramp": 1e-3 * k}), reference, Tolerances.parse(["flag=0"])).same
    late = Series(added, {"flag": np.where(k < 8001, 0.0, 1.0), "ramp": 1e-3 * k})
    found = compare(late, reference, Tolerances.parse(["flag=0"]))
    assert found.verdict == "different"
    assert found.worst is not None
    assert found.worst.name == "flag"
    assert found.worst.time == pytest.approx(1001.0, abs=1e-9)
    assert compare(late, reference, Tolerances.parse(["flag=0,125 us"])).same


@pytest.mark.parametrize("late", [3e-12, -3e-12])
def test_a_step_at_an_instant_that_is_rounded(late: float) -> None:
    """Real values that jump: before the step one is right, after it the other, at it both, up to rounding of time."""
    reference = series([10, 10.5, 10.5, 11], [0.25, 0.25, 0.75, 0.75])
    result = series([10, 10.5 + late, 10.5 + late, 11], [0.25, 0.25, 0.75, 0.75])
    assert only(result, reference, at="result").verdict == "same"
    early = series([10, 10.499, 10.501, 11], [0.25, 0.75, 0.25, 0.75])
    assert only(early, reference, at="result").outside == 2


def test_eighty_thousand_rows_of_forty_variables() -> None:
    time = np.arange(80_000) * 125e-6
    whole = Series(time, {f"c{k}": np.sin(k * time) for k in range(40)})
    assert compare(whole, whole, Tolerances.parse(["1e-6,1 ms"])).same


# --- verdicts -------------------------------------------------------------------------------------------------------


@given(
    amount=st.floats(1e-9, 1e-2), share=st.floats(0.0, 3.0), row=st.integers(0, 400), unit=st.sampled_from(["m", "mm"])
)
@settings(max_examples=100)
def test_a_change_is_found_where_it_is(amount: float, share: float, row: int, unit: str) -> None:
    reference = wave().time, wave()["Z.x_a"]
    y = reference[1].copy()
    y[row] += share * amount
    scale = 1e3 if unit == "mm" else 1.0
    found = only(series(reference[0], y * scale, unit), series(*reference, "m"), f"{amount!r} m")
    off = abs(y[row] - reference[1][row])
    assert (found.verdict == "different") == (off > amount * (1 + 1e-9) + 1e-15) or abs(off - amount) < 1e-15
    if off > 1e-14:  # what conversion and back leaves
        assert found.time == reference[0][row]
        assert found.deviation == pytest.approx(off, abs=1e-15)
    assert found.allowed == pytest.approx(amount, rel=1e-12)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=50)
def test_wider_tolerances_never_make_it_worse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.sort(rng.uniform(0, 1, 30))
    reference, result = (series(time, rng.normal(size=30)) for _ in range(2))
    off = [
        [only(result, reference, f"{value},{reach} s").outside for value in (0.0, 0.1, 1.0)]
        for reach in (0.0, 0.01, 0.3)
    ]
    assert np.all(np.diff(off, axis=0) <= 0)
    assert np.all(np.diff(off, axis=1) <= 0)
    assert only(reference, reference).verdict == "same"


def test_exactness() -> None:
    """A tolerance of 0 is bit for bit; one unit in the last place is a difference."""
    reference = wave()
    assert compare(reference, reference, EXACT).same
    x = reference["Z.x_a"].copy()
    x[123] = np.nextafter(x[123], 1)
    found = compare(changed(reference, Z__x_a=x), reference, EXACT)
    assert found.verdict == "different"
    assert found.worst is not None
    assert (found.worst.name, found.worst.outside, found.worst.time) == ("Z.x_a", 1, reference.time[123])


def test_relative_tolerance_is_of_the_range_that_is_compared() -> None:
    reference = wave()
    shifted = changed(reference, Z__x_a=reference["Z.x_a"] + 0.99e-4, Z__M_a=reference["Z.M_a"] + 0.0061)
    found = compare(shifted, reference)  # 1e-3 of 0.1 m and of 6 N.m
    assert [each.verdict for each in found.variables] == ["same", "different", "same"]
    assert found.variables[0].allowed == pytest.approx(1e-4, rel=1e-3)
    assert found.variables[1].ratio == pytest.approx(0.0061 / 0.006, rel=1e-3)
    part = compare(shifted, reference, None, Options(start=0.0, end=0.05))
    assert part.variables[0].allowed == pytest.approx(1e-3 * 0.05 * np.sin(0.1 * np.pi), rel=1e-9)


def test_an_axis_at_rest_may_tremble() -> None:
    """Rounding noise of a column that does not move: against others of its unit it is none; alone it is."""
    time = np.linspace(0, 1, 101)
    noise = 1e-11 * np.random.default_rng(0).normal(size=101)
    reference = Series(time, {"Z.x": time, "X.x": 0 * time}, {"Z.x": "m", "X.x": "m"})
    result = Series(time, {"Z.x": time, "X.x": noise}, {"Z.x": "m", "X.x": "m"})
    assert compare(result, reference).same
    assert not compare(result, reference, Tolerances.parse(["X.x=0"])).same


def test_units() -> None:
    k = np.arange(3.0)
    reference = Series(k, {"n": k, "x": k, "f": k}, {"n": "rad/s", "x": "m", "f": "N"})
    result = Series(k, {"n": k * 60 / (2 * np.pi), "x": k * 1e3, "f": k}, {"n": "U/min", "x": "mm"})
    found = compare(result, reference, EXACT)
    assert found.same, found.line
    assert any("f: the result gives no unit; taken as SI" in note for note in found.notes)
    wrong = Series(result.time, result.columns, {"n": "mm", "x": "mm"})
    found = compare(wrong, reference, EXACT)
    assert (found.verdict, found.exit_code) == ("unusable", 2)
    assert "units differ" in found.those("unusable")[0].reason
    in_mm, in_si = Series(k, {"x": 1000 * k}, {"x": "mm"}), Series(k, {"x": k})
    assert compare(in_si, in_mm, EXACT).same
    assert compare(in_mm, in_si, EXACT).same
    bare = Series(k, {"x": 1000 * k})
    assert not compare(bare, reference, EXACT, Options(only=["x"])).same
    assert compare(bare, reference, EXACT, Options(only=["x"], units={"x": "mm"})).same
    found = compare(bare, Series(k, {"x": 1000.2 * k}), Tolerances.parse(["600 mm"]))
    assert found.variables[0].allowed == 0.6
    assert any("neither side gives a unit" in note for note in found.notes)


def test_flags_hold_their_values() -> None:
    """Between rows of whole numbers either value is right; a ramp from 0 to 1 would be neither."""
    reference = series([0, 1, 2, 3], [0, 0, 1, 1])
    result = series([0, 0.5, 1.0, 1.4, 1.6, 2.0, 3.0], [0, 0, 0, 0, 1, 1, 1])
    assert only(result, reference, at="result").verdict == "same"
    assert only(series([0, 1, 1.5, 2, 3], [0, 1, 1, 1, 1]), reference, at="result").time == 1.0
    real = series([0, 1, 2, 3], [0.5, 0.5, 1.5, 1.5])
    staircase = series([0, 1, 1.5, 2, 3], [0.5, 0.5, 0.5, 1.5, 1.5])
    assert only(staircase, real, at="result").verdict == "different"
    assert only(staircase, real, at="result", hold=["x"]).verdict == "same"


def test_other_sampling() -> None:
    reference = wave(4001)
    found = compare(wave(401), reference, Tolerances.parse(["1e-9"]))
    assert found.same, found.line
    assert any("one row per 10 of the reference" in note for note in found.notes)
    # the chord of 10 ms is off by (2 pi)^2 A dt^2 / 8 between its ends, which is not looked at
    found = compare(reference, wave(201), Tolerances.parse(["1e-9"]))
    assert found.same, found.line
    assert any("compared at its instants" in note for note in found.notes)
    found = compare(reference, wave(201), Tolerances.parse(["1e-9"]), Options(at="result", only=["Z.x_a"]))
    assert found.worst is not None
    assert found.worst.deviation == pytest.approx((2 * np.pi) ** 2 * 0.05 * 0.01**2 / 8, rel=1e-3)
    uneven = np.sort(np.random.default_rng(1).uniform(0, 2, 800))
    uneven[[0, -1]] = 0, 2
    columns = {n: np.interp(uneven, reference.time, v) for n, v in reference.columns.items()}
    thinned = Series(uneven, columns, reference.units)
    assert compare(thinned, reference, Tolerances.parse(["1e-9", "Z.limited=ignore"])).same


def test_missing_numbers() -> None:
    reference = wave()
    x = reference["Z.x_a"].copy()
    x[[100, 101]] = np.nan, np.inf
    found = compare(changed(reference, Z__x_a=x), reference)
    worst = found.worst
    assert worst is not None
    assert (worst.name, worst.verdict, worst.outside) == ("Z.x_a", "different", 2)
    assert "no number (nan) in 2 of 401 rows" in worst.reason
    found = compare(reference, changed(reference, Z__x_a=x), EXACT)
    assert found.same, found.line
    assert found.variables[0].rows == 399
    assert any("the reference holds no number in 2 rows, the first at 0.5 s" in note for note in found.notes)
    # from one row before the hole to one row behind it nothing is known
    denser = series(np.linspace(0, 2, 801), np.zeros(801))
    hole = series(reference.time, np.where((reference.time > 0.49) & (reference.time < 0.51), np.nan, 0))
    assert only(denser, hole, at="result").rows == 801 - 7
    nothing = changed(reference, Z__x_a=np.full(401, np.nan))
    assert compare(reference, nothing).verdict == "unusable"
    assert compare(reference, nothing, None, Options(ignore=["Z.x_a"])).same


def test_time_that_is_not_covered() -> None:
    reference = wave()
    rows = slice(0, 300)
    short = Series(reference.time[rows], {n: v[rows] for n, v in reference.columns.items()}, reference.units)
    found = compare(short, reference)
    assert found.verdict == "different"
    assert "the result ends at 1.495 s, the reference at 2 s" in found.line
    assert compare(short, reference, None, Options(end=1.4)).same
    one_less = Series(reference.time[1:-1], {n: v[1:-1] for n, v in reference.columns.items()}, reference.units)
    assert compare(one_less, reference).same  # tools begin or end a step apart
    assert compare(reference, short).same
    apart = Series(reference.time + 10, reference.columns, reference.units)
    found = compare(apart, reference)
    assert found.verdict == "unusable"
    assert "do not overlap: the result's is 10 to 12 s, the reference's 0 to 2 s" in found.problem
    assert compare(apart, reference, None, Options(shift=-10)).same


def test_rows_that_are_missing() -> None:
    reference = wave()
    keep = np.r_[0:100, 150:401]
    holed = Series(reference.time[keep], {n: v[keep] for n, v in reference.columns.items()}, reference.units)
    found = compare(holed, reference)
    assert found.same
    assert any("1 gap in the result, the longest from 0.495 to 0.75 s" in note for note in found.notes)
    found = compare(holed, reference, None, Options(max_gap=0.02))
    assert found.verdict == "different"
    assert "no row of the result from 0.495 to 0.75 s, allowed gap 20 ms" in found.line


# --- columns --------------------------------------------------------------------------------------------------------


def test_columns_missing_extra_and_renamed() -> None:
    reference = wave()
    prefixed = Series(reference.time, {f"plant.{n}": v for n, v in reference.columns.items()})
    found = compare(prefixed, reference)
    assert found.verdict == "unusable"
    assert "--column 'plant.*=*'" in found.problem
    assert compare(prefixed, reference, EXACT, Options(columns=[("plant.*", "*")])).same
    lacking = Series(reference.time, {"Z.x_a": reference["Z.x_a"], "more": reference["Z.M_a"]}, {"Z.x_a": "m"})
    found = compare(lacking, reference)
    assert (found.verdict, [each.name for each in found.those("missing")]) == ("different", ["Z.M_a", "Z.limited"])
    assert compare(lacking, reference, None, Options(common=True)).same
    assert compare(lacking, reference, None, Options(columns=[("more", "Z.M_a")], only=["*_a"])).same
    two = Options(columns=[("plant.Z.x_a", "Z.x_a"), ("plant.Z.M_a", "Z.x_a")])
    for options, message in (
        (two, "both 'plant.Z.x_a' and 'plant.Z.M_a'"),
        (Options(columns=[("plnt.*", "*")]), "the result has no column"),
        (Options(columns=[("plant.*", "Z")]), r"as many \*"),
        (Options(columns=[("plant.Z.x_a", "Z.x_b")]), "did you mean 'Z.x_a'"),
        (Options(only=["Y.*"]), "the reference has no column 'Y"),
        (Options(units={"nix": "mm"}), "matches no column"),
    ):
        with pytest.raises(InputError, match=message):
            compare(prefixed, reference, None, options)


def test_worst_of_all() -> None:
    """By what is allowed, not by numbers that happen to be large."""
    reference = wave()
    found = compare(
        changed(reference, Z__x_a=reference["Z.x_a"] + 3e-9, Z__M_a=reference["Z.M_a"] + 0.02),
        reference,
        Tolerances.parse(["*.x_a=1 nm", "*.M_a=0.01 N.m"]),
    )
    assert found.worst is not None
    assert found.worst.name == "Z.x_a"
    assert found.worst.ratio == pytest.approx(3, rel=1e-6)
    assert "2 of 3 variables outside" in found.line
    assert "worst Z.x_a: off by 3e-09 m" in found.line


def test_traces_are_series() -> None:
    t = Trace(np.arange(3.0), {"x": np.arange(3.0)}, {"x": "m"})
    assert compare(t, t, EXACT).same


# --- tolerances -----------------------------------------------------------------------------------------------------


def test_later_rules_count_value_and_time_apart() -> None:
    tolerances = Tolerances.parse(["1e-6", "*.M_a=1e-3 N.m,1 ms", "Z.M_a=2 ms", "Y.*=ignore", "X.x_a=0.1 %"])
    found = tolerances.of("Z.M_a")
    assert (found.value, found.unit, found.relative, found.time) == (1e-3, "N.m", False, 2e-3)
    assert (tolerances.of("other").value, tolerances.of("other").relative) == (1e-6, True)
    assert tolerances.of("X.x_a").value == 1e-3
    assert tolerances.of("Y.M_a").ignore
    for text in ("", "x", "x=", "=1", "1 furlong", "-1", "1 nm,2 nm", "1 ms,1 s", "nan", "1e400"):
        with pytest.raises(InputError):
            Tolerances.parse([text])


def test_pictures_keep_their_curves(tmp_path: Path) -> None:
    """Only the worst variables keep what is drawn."""
    time = np.linspace(0, 1, 50)
    reference = Series(time, {f"c{k}": np.sin(k * time) for k in range(1, 40)})
    result = Series(time, {n: v + 0.1 * k for k, (n, v) in enumerate(reference.columns.items())})
    found = compare(result, reference)
    assert sum(each.curves is not None for each in found.variables) == 12
    assert sum(each.curves is not None for each in compare(reference, reference).variables) == 1
    kept: Array = next(each.curves.lower for each in found.variables if each.curves)
    assert len(kept) == 50
