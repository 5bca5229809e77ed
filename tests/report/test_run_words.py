"""What a report of a stop and of a positioning cycle says first."""

from __future__ import annotations

import math

import pytest

from feedsim.analysis import Figure
from feedsim.report.run.report import accuracy_words, stop_words


def figures(**values: float) -> dict[str, Figure]:
    return {name: Figure(value, "", "") for name, value in values.items()}


def test_a_stop_is_told_with_what_it_waits_for() -> None:
    told = stop_words(figures(overshoot=3.131, settling_time=99.02, ringing_frequency=20.75), 1e-6)
    assert told == ("overshoots by 3.1 um and settles within +-1 um in 99 ms. It rings at 20.8 Hz; lower the jerk.")
    off = stop_words(figures(overshoot=19.04, settling_time=97.96, ringing_frequency=20.9), 1e-6, "T_sym of Z")
    assert off.endswith("It rings at 20.9 Hz. Remedy: T_sym of Z.")
    short = stop_words(figures(overshoot=0.82, settling_time=1.6, ringing_frequency=20.9), 1e-6)
    assert short == "overshoots by 0.82 um and settles within +-1 um in 1.6 ms."
    at_once = stop_words(figures(overshoot=0.2, settling_time=0.0, ringing_frequency=20.75), 1e-6)
    assert at_once == "overshoots by 0.20 um and is settled within +-1 um at the end of the motion."
    never = stop_words(figures(overshoot=107.26, settling_time=math.nan, ringing_frequency=72.41), 1e-6)
    assert (
        never == "is not yet at rest within +-1 um at the end: it oscillates at 72.4 Hz, up to 107 um past its target."
    )
    assert "Add a dwell" in stop_words(figures(overshoot=math.nan, settling_time=math.nan), 1e-6)


@pytest.mark.parametrize(
    ("E", "B", "words"), [(0.25, 0.2, "scatters"), (3.0, 2.9, "backlash"), (3.0, 0.3, "compensation of the pitch")]
)
def test_accuracy_is_told_with_what_most_of_it_is(E: float, B: float, words: str) -> None:
    told = accuracy_words(figures(A=4.0 if E > 1 else 1.31, R=1.31, E=E, B=B))
    assert words in told
    assert f"systematic deviation E {E:.2f} um" in told
