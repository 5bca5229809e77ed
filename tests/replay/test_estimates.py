"""What a fit of a drive is worth: intervals that include what the record does not decide."""

from __future__ import annotations

from math import hypot
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from feedsim.estimation.identify.parameters import estimate
from feedsim.estimation.identify.result import Estimate
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.estimation.replay.closed_loop import of_cycle
from feedsim.estimation.replay.estimates import STRETCHES, between_stretches, shared_lag, with_undecided
from feedsim.estimation.replay.tuning import parameter


def fits(*values: dict[str, float]) -> Any:
    return [SimpleNamespace(values=each, names=tuple(each)) for each in values]


def test_an_interval_includes_what_an_undecided_part_makes_of_a_value() -> None:
    """A constant load that is 0.6 N.m lower with the logarithmic rise, which the record neither asks for nor excludes.
    sigma_2 halves with it: it is not determined then. What both fits agree on keeps its interval."""
    own = {
        "M_0": estimate("M_0", 21.1, 0.1),
        "sigma_2": estimate("sigma_2", 0.01, 0.001),
        "J": estimate("J", 0.02, 1e-4),
    }
    found, other = fits(
        {"M_0": 21.1, "sigma_2": 0.010, "J": 0.02}, {"M_0": 20.5, "sigma_2": 0.004, "J": 0.02, "F_log": 0.5}
    )
    wider = with_undecided(own, found, [other])
    assert wider["M_0"].sigma == pytest.approx(hypot(0.1, 0.6 / NORMAL_95))
    assert wider["M_0"].interval[0] < 20.5
    assert wider["M_0"].status == "estimated"
    assert wider["sigma_2"].status == "undetermined"
    assert wider["sigma_2"].reason.startswith("its 95 % interval is +-6")
    assert wider["J"] == own["J"]
    assert with_undecided(own, found, [found]) == own


def test_a_torque_at_one_phase_of_the_cycle_frees_the_inertia() -> None:
    """The rigid line of such a record is up to a half off: the prior of the inertia must let the fit leave it."""
    known = {"J": 0.01, "J_sigma": 0.02, "F_C": 1.0}
    start = of_cycle(known, 2e-3, 2e-3)
    assert parameter("J", start).scale == 1.0
    assert start["J"] == 0.01
    assert of_cycle(known, 125e-6, 2e-3) == known


def test_intervals_include_every_share_of_a_lag() -> None:
    """A fit to a position alone, whose lag of 8.185 ms is shared otherwise than in the axis, which had k_ffw = 1.0001
    and 0.636 ms of T_sym. The record was met to its noise by both."""
    values = {"K_v": 33.518, "k_ffw": 1.0685, "T_dyn": 7.6559e-3, "T_sym": 2.5728e-3}
    found = {name: Estimate(name, value, "1", "", 1e-3 * value) for name, value in values.items()}
    wider = shared_lag(found, "without it")
    assert wider["K_v"] == found["K_v"]
    for name, value in (("k_ffw", 1.0001), ("T_sym", 0.63607e-3), ("T_sym", 0.0), ("T_sym", 8.185e-3)):
        assert wider[name].interval[0] <= value <= wider[name].interval[1], name
        assert wider[name].reason.startswith("without it only the lag shows")
    assert {name for name, each in wider.items() if each.status == "undetermined"} == {"k_ffw", "T_sym", "T_dyn"}


@pytest.mark.parametrize("between", [0.0, 0.5])
def test_the_interval_is_that_of_what_stretches_say(between: float) -> None:
    """A mean of two channels whose stretches are off by an error of their own each, as a model's are. By the scatter of
    rows alone the interval is ten times too narrow then. It holds the truth in 95 of 100 records, give or take 4; and
    with errors of rows alone it is no wider than Student's distribution asks for."""
    rng, rows = np.random.default_rng(1), 25 * STRETCHES
    J = np.vstack([-np.ones((2 * rows, 1)), 1e-6 * np.ones((1, 1))])
    held, sizes = 0, []
    for _ in range(300):
        error = np.repeat(between * rng.standard_normal(STRETCHES), rows // STRETCHES)
        r = np.concatenate([error + 0.1 * rng.standard_normal(rows), error + 0.1 * rng.standard_normal(rows), [0.0]])
        sizes.append(float(np.sqrt(between_stretches(J, r, rows)[0])))
        held += abs(float(np.mean(r[:-1]))) <= NORMAL_95 * sizes[-1]
    assert 0.91 <= held / 300 <= 0.99
    true = np.hypot(between / np.sqrt(STRETCHES), 0.1 / np.sqrt(2 * rows))
    assert np.mean(np.square(sizes)) == pytest.approx((2.365 / NORMAL_95 * true) ** 2, rel=0.15)


def test_stretches_that_say_little_of_a_value_do_not_count() -> None:
    """A value that two of the stretches determine, as an inertia by two accelerations. With Student's distribution of
    all stretches its interval held 84 of 100 records."""
    rng, rows = np.random.default_rng(1), 25 * STRETCHES
    weight = np.repeat(np.where(np.arange(STRETCHES) < 2, 1.0, 0.1), rows // STRETCHES)
    J = np.concatenate([-weight, -weight, [1e-6]])[:, None]
    held = 0
    for _ in range(600):
        error = np.repeat(0.5 * rng.standard_normal(STRETCHES), rows // STRETCHES)
        r = np.concatenate([error + 0.1 * rng.standard_normal(rows), error + 0.1 * rng.standard_normal(rows), [0.0]])
        off = float(np.linalg.lstsq(J, -r, rcond=None)[0][0])
        r = r + J[:, 0] * off
        held += abs(off) <= NORMAL_95 * float(np.sqrt(between_stretches(J, r, rows)[0]))
    assert 0.91 <= held / 600 <= 0.995, held
