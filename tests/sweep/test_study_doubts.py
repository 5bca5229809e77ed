"""Study files: what is said before any run of distributions, keys and figures that lead nowhere."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from feedsim.design.sweep.design import quantile
from feedsim.foundation.errors import InputError
from feedsim.scenario import load
from feedsim.scenario.study import load_study
from feedsim.scenario.study.parameter import probability_outside
from feedsim.scenario.study.study import Distribution

Write = Callable[..., Path]
HEAD = "name: S\nscenario: short.yaml\nsampling: {method: sobol, runs: 8}\nparameters:\n"
SHARES = 100_000


@pytest.mark.parametrize(
    "found",
    [
        Distribution("normal", None, None, 1.0, 0.5),
        Distribution("normal", 0.2, None, 1.0, 0.5),
        Distribution("normal", -1.0, 1.4, 1.0, 0.5),
        Distribution("lognormal", None, None, 1.0, 0.5),
        Distribution("lognormal", 0.5, 3.0, 1.0, 0.5),
        Distribution("uniform", 0.0, 2.0),
    ],
)
@pytest.mark.parametrize(("low", "high"), [(0.0, 2.0), (0.3, float("inf")), (-float("inf"), 1.2)])
def test_share_outside(found: Distribution, low: float, high: float) -> None:
    """Against a count of the values that runs are drawn from, at even shares of the distribution."""
    if found.kind == "uniform":
        assert probability_outside(found, low, high) == 0.0
        return
    values = quantile(found, (np.arange(SHARES) + 0.5) / SHARES)
    counted = np.count_nonzero((values < low) | (values > high)) / SHARES
    assert probability_outside(found, low, high) == pytest.approx(counted, abs=2 / SHARES)  # a count at either end


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ("distribution: normal, mean: 0.01 rad, deviation: 0.01 rad", "16 % of the distribution are outside"),
        ("factor: true, distribution: normal, mean: 1, deviation: 0.5", "2.3 % of the distribution are outside"),
        ("distribution: normal, mean: 0.01 rad, deviation: 0.01 rad, from: 0 rad", ""),
        ("distribution: normal, mean: 0.03 rad, deviation: 0.001 rad", ""),
        ("distribution: lognormal, mean: 0.03 rad, deviation: 0.03 rad", ""),
    ],
)
def test_a_distribution_that_leads_out_of_the_allowed_range(study: Write, entry: str, told: str) -> None:
    found = load_study(study(HEAD + f"  W: {{key: machine.axes.Z.friction.W, {entry}}}\n")).warnings
    if told:
        (warning,) = found
        assert (warning.code, warning.place) == ("distribution-out-of-range", "W")
        assert warning.text.partition(": ")[0].endswith("study.yaml:5")
        assert told in warning.text
        assert "at least 0 rad" in warning.text
    else:
        assert found == ()


@pytest.mark.parametrize("key", ["name", "note", "machine.name"])
def test_a_key_that_changes_no_run(study: Write, key: str) -> None:
    with pytest.raises(InputError, match=rf":5: parameters\.p\.key: {key} is only shown; it changes no run"):
        load_study(study(HEAD + f"  p: {{key: {key}, values: [a, b]}}\n"))


@pytest.mark.parametrize(
    ("pattern", "known"),
    [("Z.*", True), ("*.overshoot", True), ("Z#2.*", True), ("Z", False), ("X.*", False), ("XZ.G", False),
     ("ZZ*", False), ("Z*", True)],
)  # fmt: skip
def test_figures_that_cannot_be_there(study: Write, pattern: str, known: bool) -> None:
    file = study(HEAD + f"  F_C: {{key: machine.axes.Z.friction.F_C, values: [1 N.m]}}\nfigures: ['{pattern}']\n")
    if known:
        load_study(file)
        return
    with pytest.raises(InputError, match=r":6: figures\.0: .* is none of the figures") as error:
        load_study(file)
    assert pattern in str(error.value)


def test_figures_of_choices(study: Write) -> None:
    """What is evaluated may itself be varied: of a choice that is wrong no wrong word is said of figures."""
    by = "  by: {key: motions.0.by.X, values: [1 mm]}\n"
    axis = "  axis: {key: evaluate.0.axis, values: [Z, %s]}\nfigures: [%s.overshoot]\n"
    two = "set: {motions.0.by: {X: 1 mm, Z: 1 mm}}\n" + HEAD
    load_study(study(two + axis % ("X", "X")))
    with pytest.raises(InputError, match=r"'Y\.overshoot' is none of the figures"):
        load_study(study(two + axis % ("X", "Y")))
    with pytest.raises(InputError) as error:
        load_study(study(HEAD + by + axis % ("Q", "X")))
    assert "'Q'" in str(error.value)
    assert ": figures" not in str(error.value)


def test_everything_at_once(study: Write) -> None:
    text = HEAD + (
        "  a: {key: name, values: [a, b]}\n"
        "  b: {key: motions.0.feed, from: 1 mm, to: 2 m/s}\n"
        "figures: [nothing_*]\n"
    )  # fmt: skip
    with pytest.raises(InputError) as error:
        load_study(study(text))
    assert all(told in str(error.value) for told in ("changes no run", "is a length", "'nothing_*' is none of"))


def test_a_star_skips_motions_that_have_no_such_key(study: Write, short: Path) -> None:
    found = load_study(study(HEAD + "  v: {key: motions.*.feed, from: 1 m/min, to: 3 m/min}\n"))
    assert found.base.scenario.motions[1].kind == "dwell"
    assert load(short, ["motions.*.feed=2 m/min"]).motions[0].feed == pytest.approx(2 / 60)
    with pytest.raises(InputError, match=r"unknown key 'fed' in all entries of motions; did you mean 'feed'"):
        load_study(study(HEAD + "  v: {key: motions.*.fed, from: 1 m/min, to: 3 m/min}\n"))
    with pytest.raises(InputError, match=r"unknown key 'feed' in motions\.1"):
        load(short, ["motions.1.feed=2 m/min"])
    factor = HEAD + "  v: {key: motions.*.feed, factor: true, from: 0.5, to: 1}\n"
    assert [key for key, _, _ in load_study(study(factor)).parameters[0].origins] == ["motions.0.feed"]
