"""A compressor joins short blocks in a spline within the tolerance, split at sharp corners."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from feedsim.motions.part_program import Blending, Moves
from feedsim.motions.planner import PlannedPath, plan_moves
from path_helpers import Draft, limits_of

Floats = NDArray[np.float64]


def polygon(points: Floats, tolerance: float, feed: float, compressed: bool = True) -> Moves:
    axes = ("X", "Y", "Z")[: points.shape[1]]
    draft = Draft(axes, points[0], feed, Blending.TOLERANCE, tolerance, compressed=compressed)
    for point in points[1:]:
        draft.line(*point)
    return draft.moves


def contour(length: float = 154e-3, side: float = 0.1e-3) -> Floats:
    """A closed curve in blocks of 0.1 mm, rounded to 1 um as programs are."""
    phi = np.linspace(0, 2 * np.pi, 100001)
    r = 1 + 0.12 * np.cos(3 * phi) + 0.05 * np.sin(5 * phi)
    x = np.stack([r * np.cos(phi), r * np.sin(phi)], axis=1)
    s = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(x, axis=0), axis=1))])
    at = np.linspace(0, s[-1], round(length / side) + 1)
    return np.round(np.stack([np.interp(at, s, x[:, k]) for k in (0, 1)], axis=1) * length / s[-1], 6)


def distance_from_program(planned: PlannedPath, step: float = 2e-4) -> float:
    """Largest distance of the motion from the sides of the program around where it says that it is."""
    sampled = planned.sample(np.arange(0, planned.duration, step))
    points = np.concatenate([planned.moves.start[None], planned.moves.end])
    nearest = np.full(len(sampled.row), np.inf)
    for beside in range(-3, 4):
        row = np.clip(sampled.row + beside, 0, len(points) - 2)
        a, d = points[row], points[row + 1] - points[row]
        along = np.clip(((sampled.position - a) * d).sum(axis=1) / np.maximum((d**2).sum(axis=1), 1e-30), 0, 1)
        nearest = np.minimum(nearest, np.linalg.norm(sampled.position - a - along[:, None] * d, axis=1))
    return float(nearest.max())


@pytest.mark.parametrize("jerk", [(20, 20), (20, 30), (30, 30)])
def test_a_contour_of_short_blocks_runs_at_its_feed(jerk: tuple[float, float]) -> None:
    limits = limits_of("XY", 0.5, 1.5, jerk)
    planned = plan_moves(polygon(contour(), 5e-6, 0.05), limits)
    assert distance_from_program(planned) <= 5e-6
    assert planned.duration <= 3.4
    found = planned.derivatives(np.arange(0, planned.duration, 1e-4))
    assert (np.abs(found.jerk) / jerk)[found.to_end > 1e-9].max() <= 1 + 1e-9
    assert np.abs(found.acceleration).max() <= 1.5 * (1 + 1e-9)
    assert plan_moves(polygon(contour(), 5e-6, 0.05, compressed=False), limits).duration > 2 * planned.duration


@pytest.mark.parametrize("seed", range(6))
def test_splines_stay_within_the_tolerance(seed: int) -> None:
    """Curves of uneven blocks with sharp corners, straight stretches and crossings, in the plane and in space."""
    random = np.random.default_rng(seed)
    n = 400
    turn = random.normal(0, 0.08, n)
    turn[random.integers(0, n, 6)] += random.uniform(0.6, 3, 6)
    side = 1e-4 * 10 ** random.uniform(-0.5, 0.5, n)
    side[random.integers(0, n, 8)] *= 30
    angle = np.cumsum(turn)
    step = side[:, None] * np.stack([np.cos(angle), np.sin(angle), random.normal(0, 0.05, n)], axis=1)
    points = np.round(np.concatenate([np.zeros((1, 3)), np.cumsum(step, axis=0)]), 6)[:, : 2 + seed % 2]
    tolerance = 10 ** random.uniform(-5.5, -4)
    planned = plan_moves(polygon(points, tolerance, 0.05), limits_of("XYZ"[: points.shape[1]], 0.5, 3, 50))
    assert distance_from_program(planned) <= tolerance
    found = planned.derivatives(np.linspace(0, planned.duration, 20000))
    assert np.abs(found.jerk)[found.to_end > 1e-9].max() <= 50 * (1 + 1e-9)
    sampled = planned.sample(planned.end_time)
    assert np.abs(sampled.position - planned.moves.end).max() <= tolerance * 1.5
    length = np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))
    assert sampled.s == pytest.approx(length, abs=1e-9)


def test_long_blocks_and_stops_are_left_as_they_are() -> None:
    draft = Draft(("X", "Y"), np.zeros(2), 0.1, Blending.TOLERANCE, 1e-3, compressed=True)
    for corner in ((30e-3, 0), (60e-3, 5e-3), (60.1e-3, 5.0e-3)):
        draft.line(*corner)
    draft.blending = Blending.EXACT_STOP
    draft.line(60.2e-3, 5.01e-3)
    draft.line(60.3e-3, 5.03e-3)
    plain = draft.moves
    limits = limits_of("XY", 0.5, 3, 50)
    planned = plan_moves(plain, limits)
    assert planned.sample([planned.end_time[3]]).position[0] == pytest.approx([60.2e-3, 5.01e-3], abs=1e-12)
    assert planned.derivatives([planned.end_time[3]]).velocity[0] == pytest.approx([0, 0], abs=1e-12)
    # halfway between corners a long block is met exactly
    assert planned.sample([(planned.start_time[0] + planned.end_time[0]) / 2]).position[0, 1] == 0
