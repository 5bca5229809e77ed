"""Units that are wrong by a factor of 1000 or so: refused, before anything takes its time, and with the cause named."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest

from feedsim.estimation.identify.parameters import estimate
from feedsim.estimation.identify.read import (
    check_estimates,
    check_inertia,
    check_time,
    read_records,
)
from feedsim.estimation.identify.record import Record
from feedsim.foundation.errors import InputError
from record_helpers import LEAD, mapped, refusal, table

# A stroke of an axis with a pitch of 20 mm, there and back: 0.2 m/s, 2 m/s2.
STEP = 2e-3
T = np.arange(800) * STEP
V = np.interp(T, [0.2, 0.3, 0.5, 0.6, 0.8, 0.9, 1.1, 1.2], [0, 0.2, 0.2, 0, 0, -0.2, -0.2, 0])
X = np.cumsum(V) * STEP
M = 0.016 * np.gradient(V, STEP) / LEAD + 1.6 * np.tanh(V / 1e-3)
COLUMNS = "position: {column: x}\ntorque: {column: M}\npitch: 20 mm\n"


@pytest.mark.parametrize(
    ("time", "position", "said"),
    [
        (("s", 1e3), ("mm", 1e3), "the rows are 2 s apart; allowed: 10 us to 0.1 s"),
        (("s", 1e6), ("mm", 1e3), "the rows are 2000 s apart"),
        (("ms", 1.0), ("mm", 1e3), "the rows are 2e-06 s apart"),
        (("s", 500), ("mm", 1e3), "it counts cycles (factor: 2 ms)"),
        (("s", 1.0), ("m", 1e3), "the slide moves at 200 m/s; allowed: up to 20 m/s"),
        (("s", 0.02), ("mm", 1e3), "the slide accelerates with 1200 m/s2; allowed: up to 200 m/s2"),
    ],
)
def test_wrong_unit_of_a_trace(tmp_path: Path, time: tuple[str, float], position: tuple[str, float], said: str) -> None:
    """(unit that the header says, what the SI values are multiplied with)"""
    names = {f"t [{time[0]}]": T * time[1], f"x [{position[0]}]": X * position[1], "M [N.m]": M}
    path = table(tmp_path / "a.csv", names)
    assert said in refusal(path, mapped(tmp_path, COLUMNS))


def test_right_units_are_no_matter(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", {"t [s]": T, "x [mm]": 1e3 * X, "M [N.m]": M})
    assert read_records(path, mapped(tmp_path, COLUMNS)).provenance.warnings == ()


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("sigma_0", 265096.0, "the bristles would give way after 1.92e-08 m at the slide; plausible: 1e-07 to"),
        ("sigma_0", 0.3, "the bristles would give way after 0.017 m"),
        ("v_s", 0.6e-3, "v_s comes out as 0.0006 rad/s: 1.91e-06 m/s at the slide; plausible: 1e-05 to 1 m/s"),
        ("v_s", 600.0, "1.91 m/s"),
        ("F_C", 1600.0, "F_C comes out as 1600 N.m: 5.03e+05 N at the slide"),
        ("J", 16.4, "J comes out as 16.4 kg.m2: 1.62e+06 kg"),
        ("J", 16.4e-6, "friction alone would brake with 311 m/s2"),
    ],
)  # fmt: skip
def test_what_no_feed_axis_has(name: str, value: float, said: str) -> None:
    """The default machine's Z axis; one of its parameters is off by 1000 as with mm for m."""
    true = {"sigma_0": 300.0, "F_C": 1.6, "v_s": 0.6, "J": 0.0164}
    found = {each: estimate(each, size, 0.01 * size) for each, size in true.items()}
    check_estimates(found, LEAD)
    with pytest.raises(InputError, match="nothing is written") as error:
        check_estimates(found | {name: estimate(name, value, 0.01 * value)}, LEAD)
    assert said in str(error.value)
    # What is not known tells nothing.
    check_estimates(found | {name: estimate(name, value, status="undetermined", reason="-")}, LEAD)
    check_estimates(found | {name: estimate(name, value, 0.5 * value)}, LEAD)


def test_an_inertia_of_another_magnitude() -> None:
    given = estimate("J", 0.0164, status="given", reason="as given")
    check_inertia(given, estimate("J", 0.03, 0.001))
    with pytest.raises(InputError, match=r"say 16\.4, 1e\+03 times as much; allowed: 0\.1 to 10 times"):
        check_inertia(given, estimate("J", 16.4, 0.1))


def test_usual_rows_are_accepted() -> None:
    check_time(Path("a.csv"), [Record("x", T, M, X / LEAD)])
    assert 2 * pi * LEAD == pytest.approx(0.02)
