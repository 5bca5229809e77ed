"""Against closed forms: seven phases, parabolas, permitted jumps, stops on the grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from feedsim.foundation.errors import InputError
from feedsim.motions.part_program import Blending
from feedsim.motions.planner import Acts, plan_moves
from path_helpers import Draft, limits_of, square

Floats = NDArray[np.float64]


def seven_phases(L: float, v: float, a: float, j: float, t: Floats) -> tuple[float, Floats]:
    """Duration and positions of the fastest motion from rest to rest over L, by integrating its phases of jerk."""
    T = min(a / j, np.sqrt(v / j), (L / (2 * j)) ** (1 / 3))
    a = j * T
    if v * (v / a + T) > L:  # the speed is not reached: v (v / a + T) = L
        v = (-T + np.sqrt(T**2 + 4 * L / a)) * a / 2
    steady, cruise = v / a - T, (L - v * (v / a + T)) / v
    durations = np.array([T, steady, T, cruise, T, steady, T])
    jerks = np.array([j, 0, -j, 0, -j, 0, j])
    x, state, begin = np.zeros_like(t), np.zeros(3), 0.0
    for duration, each in zip(durations, jerks, strict=True):
        within = t >= begin
        d = t[within] - begin
        x[within] = state[0] + d * (state[1] + d * (state[2] / 2 + d * each / 6))
        d = max(duration, 0.0)
        state = np.array([
            state[0] + d * (state[1] + d * (state[2] / 2 + d * each / 6)), state[1] + d * (state[2] + d * each / 2),
            state[2] + d * each,
        ])  # fmt: skip
        begin += d
    x[t >= begin] = L
    return begin, x


@pytest.mark.parametrize("seed", range(12))
def test_a_block_from_rest_to_rest_has_seven_phases(seed: int) -> None:
    random = np.random.default_rng(seed)
    L, v, a, j = 10 ** random.uniform([-5, -2, -1, 0], [0, 0, 1, 3])
    direction = random.normal(size=3)
    direction /= np.linalg.norm(direction)
    draft = Draft(("X", "Y", "Z"), np.zeros(3), feed=v)
    draft.line(*(L * direction))
    # one axis has the limits a and j along the path, the others more
    least = int(np.argmax(np.abs(direction)))
    more = np.where(np.arange(3) == least, 1, 1.5) * np.abs(direction)
    planned = plan_moves(draft.moves, limits_of("XYZ", 10, more * a, more * j))
    t = np.linspace(0, planned.duration, 1001)
    duration, x = seven_phases(L, v, a, j, t)
    assert planned.duration == pytest.approx(duration, rel=1e-12)
    assert np.abs(planned.sample(t).position @ direction - x).max() <= 1e-12


def test_corners_with_legs_are_parabolas() -> None:
    """Quadratic Bezier curves from a leg before the vertex to a leg behind it."""
    leg = 0.25e-3
    draft = Draft(("X", "Y"), np.zeros(2), 350e-3 / 60, Blending.DISTANCE, leg)
    draft.line(10e-3, 0)
    draft.line(17e-3, 8e-3)
    planned = plan_moves(draft.moves, limits_of("XY", 0.4, [1.5, 1.2], 20, step_time=4e-3))
    before = np.array([1.0, 0.0])
    behind = np.array([7e-3, 8e-3]) / np.hypot(7e-3, 8e-3)
    vertex = np.array([10e-3, 0])
    t = np.linspace(0, planned.duration, 20001)
    x, a = planned.sample(t).position, planned.derivatives(t).acceleration
    n = np.array([-behind[1], behind[0]])  # across the second leg: L (1 - u)^2 of the first one
    across = ((x - vertex) @ n) / (-before @ n)
    inside = (across > 0) & (across < leg) & (x[:, 1] > 0) & (np.linalg.norm(x - vertex, axis=1) < leg)
    u = 1 - np.sqrt(across[inside] / leg)
    curve = vertex - leg * before * (1 - u[:, None]) ** 2 + leg * behind * u[:, None] ** 2
    assert inside.sum() > 100
    assert np.abs(x[inside] - curve).max() <= 1e-9
    # At constant speed of the parameter the acceleration is constant, v^2 over twice the leg.
    assert np.abs(a[inside] - draft.feed**2 / (2 * leg) * (behind - before)).max() <= 1e-9


def test_rapids_enter_parabolas_at_the_permitted_step() -> None:
    draft = Draft(("X", "Y"), np.zeros(2), blending=Blending.DISTANCE, tolerance=0.25e-3)
    draft.rapid(0.1, 0)
    draft.rapid(0.1, 0.1)
    limits = limits_of("XY", 0.4, 10, 20)
    planned = plan_moves(draft.moves, limits)
    middle = planned.derivatives([planned.end_time[0]])
    step = np.abs(middle.acceleration[0])
    assert step == pytest.approx([20 * 2e-3] * 2, rel=1e-9)
    assert planned.sections.duration.size == 2
    faster = plan_moves(draft.moves, replace(limits, step_time=4e-3))
    assert faster.duration < planned.duration


def test_continuous_path_mode_jumps_as_permitted() -> None:
    """G64: no axis's speed jumps by more than 1.2 times its acceleration over a cycle; the vertex is met."""
    draft = Draft(("X", "Y"), np.zeros(2), 0.1, Blending.CONTINUOUS)
    draft.line(50e-3, 0)
    draft.line(50e-3, 50e-3)
    planned = plan_moves(draft.moves, limits_of("XY", 0.4, [1.5, 1.2], 20))
    passed = planned.end_time[0]
    assert planned.sample([passed]).position[0] == pytest.approx([50e-3, 0], abs=1e-12)
    jump = np.diff(planned.derivatives([passed - 1e-6, passed + 1e-6]).velocity, axis=0)[0]
    assert np.abs(jump) == pytest.approx([1.2 * 1.2 * 2e-3] * 2, rel=1e-6)


def test_without_jerk_limit_the_acceleration_steps() -> None:
    draft = Draft(("X",), np.zeros(1), 0.1, jerk_limited=False)
    draft.line(50e-3)
    planned = plan_moves(draft.moves, limits_of("X", 0.4, 1, 20))
    assert planned.duration == pytest.approx(0.05 / 0.1 + 0.1 / 1, rel=1e-12)
    assert planned.derivatives([1e-9, planned.duration - 1e-9]).acceleration[:, 0] == pytest.approx([1, -1])


def test_a_change_of_brisk_and_soft_is_a_stop() -> None:
    draft = Draft(("X",), np.zeros(1), 0.1, Blending.CONTINUOUS)
    draft.line(10e-3)
    draft.jerk_limited = False
    draft.line(20e-3)
    planned = plan_moves(draft.moves, limits_of("X", 0.4, 1, 20))
    assert planned.derivatives([planned.end_time[0]]).velocity[0, 0] == 0


def test_motions_begin_on_the_grid_and_dwells_last() -> None:
    draft = Draft(("X",), np.zeros(1), 0.1)
    draft.line(10e-3)
    draft.dwell(0.0101)
    draft.line(10e-3)  # does not move
    draft.line(0.0)
    planned = plan_moves(draft.moves, limits_of("X", 0.4, 1.2, 20, T_ipo=2e-3))
    first = planned.end_time[0]
    assert planned.start_time[1] == pytest.approx(np.ceil(first / 2e-3) * 2e-3, abs=1e-12)
    assert planned.end_time[1] - planned.start_time[1] == pytest.approx(0.0101, abs=1e-12)
    assert planned.start_time[3] == pytest.approx(np.ceil(planned.end_time[1] / 2e-3) * 2e-3, abs=1e-12)
    assert np.diff(planned.sample([planned.start_time[1], planned.end_time[1]]).position, axis=0) == 0
    assert planned.start_time[2] == planned.end_time[2] == planned.end_time[1]


def test_what_holds_a_row_back() -> None:
    draft = Draft(("X", "Y"), np.zeros(2), 0.05)
    draft.line(0.2, 0)
    draft.rapid(0.2, 1.2)
    draft.line(0.2005, 1.2)
    planned = plan_moves(draft.moves, limits_of("XY", [0.4, 0.3], [0.5, 1], [5000, 20]))
    assert planned.acts.tolist() == [Acts.FEED, Acts.SPEED, Acts.ACCELERATION]
    assert planned.axis.tolist() == [-1, 1, 0]


def test_limits_along_the_path_hold_beside_those_of_the_axes() -> None:
    draft = Draft(("X", "Y"), np.zeros(2), 1.0)
    draft.line(0.3, 0.4)
    planned = plan_moves(draft.moves, limits_of("XY", 1, 10, 100, path_acceleration=2.0, path_jerk=40.0))
    found = planned.derivatives(np.linspace(0, planned.duration, 3001))
    along = np.array([0.6, 0.8])
    assert np.abs(found.acceleration @ along).max() == pytest.approx(2)
    assert np.abs(found.jerk @ along).max() == pytest.approx(40)


def test_roundings_that_take_longer_than_stops_are_noted() -> None:
    limits = limits_of("XY", 1, 1, 20)
    with_stops, rounded = plan_moves(square(tolerance=0.0), limits), plan_moves(square(tolerance=5e-6), limits)
    assert with_stops.duration == pytest.approx(2.6, abs=1e-9)
    assert not with_stops.notes
    (note,) = rounded.notes
    assert (note.code, note.severity) == ("corners-slower-than-stops", "note")
    assert "3 rounded corners take longer than exact stops: 2.654 s in place of 2.6 s" in note.text
    wide = plan_moves(square(tolerance=1e-3), limits)
    assert wide.duration < 2.6
    assert not wide.notes


def test_a_feed_above_the_limits_is_noted() -> None:
    draft = Draft(("X", "Y"), np.zeros(2), 2.0)
    draft.line(0.5, 0)
    (note,) = plan_moves(draft.moves, limits_of("XY", 1, 1, 20)).notes
    assert (note.code, note.place) == ("feed-out-of-reach", "made.mpf:1")
    assert note.text.startswith("made.mpf:1: F 120000 mm/min is above what the axes reach together, 84852.8 mm/min")


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        (limits_of("X", 1, 1, 1), "the program moves Y; the machine's axes are X"),
        (limits_of("XY", 1, [1, 0], 1), "max_acceleration of Y is 0; it must be above 0"),
        (limits_of("XY", [np.inf, 1], 1, 1), "max_speed of X is inf; it must be above 0 and finite"),
        (limits_of("XY", 1, 1, [np.nan, 1]), "max_jerk of X is nan"),
        (limits_of("XY", 1, 1, 1, T_ipo=0.0), "the cycle of the interpolator is 0 s"),
    ],
)
def test_limits_that_are_none_are_refused(limits: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        plan_moves(square(), limits)  # type: ignore[arg-type]
