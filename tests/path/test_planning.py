"""How a plan is made: in pieces that can be interrupted, sampled in any order, and without a library."""

from __future__ import annotations

import _thread
from pathlib import Path

import numpy as np
import pytest

from feedsim.foundation import installation
from feedsim.foundation.errors import InputError
from feedsim.motions.part_program import Blending
from feedsim.motions.planner import plan_moves
from feedsim.motions.planner import planned as library
from path_helpers import Draft, limits_of, square


def curve(blocks: int, turn: float = 0.01) -> Draft:
    draft = Draft(("X", "Y"), np.zeros(2), 0.02, Blending.TOLERANCE, 5e-6)
    angle, position = 0.0, np.zeros(2)
    for _ in range(blocks):
        angle += turn
        position = position + 1e-4 * np.array([np.cos(angle), np.sin(angle)])
        draft.line(*position)
    return draft


LIMITS = limits_of("XY", 0.5, 3, 50)


def test_progress_and_interruption() -> None:
    moves = curve(9000, 0.05).moves
    seen: list[tuple[int, int]] = []
    plan_moves(moves, LIMITS, lambda done, total: seen.append((done, total)))
    assert len(seen) > 3
    assert seen[-1] == (9000, 9000)
    assert np.all(np.diff([done for done, _ in seen]) >= 0)

    def interrupt(done: int, total: int) -> None:
        if done > 1000:
            _thread.interrupt_main()

    with pytest.raises(KeyboardInterrupt):
        plan_moves(moves, LIMITS, interrupt)


def test_a_long_stretch_at_constant_speed_is_cut_without_a_trace() -> None:
    """Windows end where nothing but the programmed speed holds the path: it goes on at that speed."""
    moves = curve(5000, 1e-3).moves
    planned = plan_moves(moves, LIMITS)
    assert len(planned.sections.begin) > 1
    speed = np.linalg.norm(planned.derivatives(np.linspace(1, planned.duration - 1, 5000)).velocity, axis=1)
    assert speed == pytest.approx(0.02, rel=1e-3)


def test_sampled_in_any_order_it_is_the_same() -> None:
    planned = plan_moves(curve(800, 0.05).moves, LIMITS)
    t = np.linspace(-0.1, planned.duration + 0.1, 500)
    together = planned.sample(t)
    for at in (450, 3, 200, 199, 499, 0):
        alone = planned.sample(t[at : at + 1])
        assert np.array_equal(alone.position[0], together.position[at])
        assert (alone.row[0], alone.s[0]) == (together.row[at], together.s[at])
    assert np.array_equal(together.position[0], planned.moves.start)
    with pytest.raises(InputError, match="ascending"):
        planned.sample([1.0, 0.5])


def test_sections_meet_in_position_speed_and_acceleration() -> None:
    planned = plan_moves(curve(800, 0.05).moves, LIMITS)
    begins = planned.sections.begin[1:]
    h = 1e-7
    before, behind = planned.derivatives(begins - h), planned.derivatives(begins + h)
    assert np.abs(planned.sample(begins + h).position - planned.sample(begins - h).position).max() <= 0.02 * 3 * h
    assert np.abs(behind.velocity - before.velocity).max() <= 3 * 3 * h
    assert np.abs(behind.acceleration - before.acceleration).max() <= 50 * 3 * h


def test_a_program_that_moves_nothing() -> None:
    draft = Draft(("X",), np.array([0.5]))
    draft.line(0.5)
    draft.dwell(0.1)
    planned = plan_moves(draft.moves, limits_of("X", 1, 1, 10))
    assert planned.duration == pytest.approx(0.1)
    assert planned.sample([0.0, 1.0]).position.tolist() == [[0.5], [0.5]]
    nothing = plan_moves(Draft(("X",), np.array([0.5])).moves, limits_of("X", 1, 1, 10))
    assert nothing.duration == 0


def test_without_a_library_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FEEDSIM_FMUS", str(tmp_path))
    monkeypatch.setattr(library, "shipped", lambda name: tmp_path)
    library.load.cache_clear()
    try:
        with pytest.raises(InputError, match=r"a library of C, which is missing here: planner.*no such file beside"):
            plan_moves(square(), LIMITS)
        (tmp_path / installation.library_name("planner")).write_bytes(b"no library")
        installation.library.cache_clear()
        with pytest.raises(InputError, match="cannot be used"):
            plan_moves(square(), LIMITS)
    finally:
        library.load.cache_clear()
        installation.library.cache_clear()
