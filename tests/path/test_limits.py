"""No axis exceeds its speed, acceleration or jerk, and no corner its tolerance, in programs and machines at random.

FEEDSIM_PATH_PROGRAMS=1000 tries as many (some minutes).
"""

from __future__ import annotations

import os

import numpy as np
import pytest
from numpy.typing import NDArray

from feedsim.motions.part_program import Blending, Motion, Moves
from feedsim.motions.planner import Limits, PlannedPath, plan_moves
from path_helpers import Draft, limits_of

Floats = NDArray[np.float64]

COUNT = int(os.environ.get("FEEDSIM_PATH_PROGRAMS", "40"))
GROUPS = 4
WAYS = ("polygon", "arcs", "zigzag", "curve", "mixed")


def random_limits(random: np.random.Generator, axes: str) -> Limits:
    n = len(axes)
    return limits_of(
        axes, random.uniform(0.05, 1.0, n), 10 ** random.uniform(-0.3, 1, n), 10 ** random.uniform(0.7, 2.7, n),
        T_ipo=float(random.choice([1e-3, 2e-3, 4e-3])),
    )  # fmt: skip


def random_program(random: np.random.Generator, blendings: tuple[Blending, ...]) -> Moves:
    axes = "XY" if random.random() < 0.4 else "XYZ"
    draft = Draft(tuple(axes), random.uniform(-0.1, 0.1, len(axes)))
    way = str(random.choice(WAYS))
    size = 10 ** random.uniform(-4, -1) if way == "polygon" else 10 ** random.uniform(-4, -2)
    heading = random.uniform(0, 2 * np.pi)
    draft.jerk_limited = random.random() < 0.9
    for k in range(int(random.integers(5, 60))):
        if k % 7 == 0:
            draft.feed = 10 ** random.uniform(-2.5, -0.3)
            draft.blending = Blending(int(random.choice(blendings)))
            draft.tolerance = (
                10 ** random.uniform(-6.5, -3.5) if draft.blending == Blending.TOLERANCE
                else 10 ** random.uniform(-5, -3) if draft.blending == Blending.DISTANCE else np.nan
            )  # fmt: skip
            if random.random() < 0.05:
                draft.dwell(float(random.uniform(0, 0.02)))
        p = draft.position.copy()
        kind = way if way != "mixed" else str(random.choice(WAYS[:4]))
        if kind == "arcs":
            angle = float(random.choice([-1, 1]) * 10 ** random.uniform(-1.5, 0.9))
            radius = size * random.uniform(0.2, 3)
            # now tangentially, now at random
            out = heading + (np.pi / 2 * np.sign(angle) if random.random() < 0.5 else random.uniform(0, 2 * np.pi))
            centre = np.array([*p[:2], p[2] if len(axes) > 2 else 0.0])
            centre[:2] += radius * np.array([np.cos(out), np.sin(out)])
            rise = radius * random.uniform(-0.5, 0.5) if len(axes) > 2 and random.random() < 0.3 else 0.0
            draft.arc(centre, angle, rise=rise)
            heading = out + angle + np.pi / 2 * np.sign(angle) + np.pi
            continue
        turn = {"polygon": random.uniform(-np.pi, np.pi), "zigzag": random.choice([-1, 1]) * random.uniform(1, 3),
                "curve": random.normal(0, 0.1)}[kind]  # fmt: skip
        heading += turn
        step = size * (random.uniform(0.2, 3) if kind != "curve" else random.uniform(0.5, 1.2))
        p[:2] += step * np.array([np.cos(heading), np.sin(heading)])
        if len(axes) > 2:
            p[2] += step * random.normal(0, 0.3)
        (draft.rapid if random.random() < 0.05 else draft.line)(*p)
    return draft.moves


def dense_instants(planned: PlannedPath, random: np.random.Generator, count: int = 4000) -> Floats:
    """All over the motion, and about every end of rows and sections."""
    t = [np.linspace(0, planned.duration, count), random.uniform(0, planned.duration, count // 4)]
    marks = np.concatenate([planned.start_time, planned.end_time, planned.sections.begin])
    t += [marks + shift for shift in (-1e-5, -1e-6, 0, 1e-6, 1e-5)]
    return np.sort(np.clip(np.concatenate(t), 0, planned.duration))


def distance_to_row(moves: Moves, row: int, x: Floats) -> Floats:
    """Distances of points x (T, A) from the line or arc of a row: the best of 129 places on it, then halved steps."""
    begin, end = (moves.end[row - 1] if row else moves.start), moves.end[row]

    def place(u: Floats) -> Floats:
        straight = begin + u[..., None] * (end - begin)
        if moves.motion[row] != Motion.ARC:
            return straight
        n, c, angle = moves.normal[row], moves.centre[row], moves.angle[row]
        at = [moves.axes.index(name) if name in moves.axes else -1 for name in "XYZ"]
        r = np.array([begin[k] if k >= 0 else 0.0 for k in at]) - c
        phi = u[..., None] * angle
        circle = r * (np.cos(phi) - 1) + np.cross(n, r) * np.sin(phi)
        full = r * (np.cos(angle) - 1) + np.cross(n, r) * np.sin(angle)
        for space, k in enumerate(at):
            if k >= 0:
                straight[..., k] += circle[..., space] - u * full[space]
        return straight

    u = np.linspace(0, 1, 129)
    nearest = u[np.linalg.norm(x[:, None] - place(u), axis=2).argmin(axis=1)]
    result = np.full(len(x), np.inf)
    turn = 2 * np.pi / moves.angle[row] if moves.motion[row] == Motion.ARC else 1.0
    for beside in (-turn, 0.0, turn) if turn < 1 else (0.0,):  # a helix may be nearest a turn away
        best, step = np.clip(nearest + beside, 0, 1), 1 / 128
        for _ in range(28):
            step /= 2
            tried = np.clip(np.stack([best - step, best, best + step]), 0, 1)
            best = np.take_along_axis(tried, np.linalg.norm(x - place(tried), axis=2).argmin(axis=0)[None], axis=0)[0]
        result = np.minimum(result, np.linalg.norm(x - place(best), axis=1))
    return result


def largest_use(planned: PlannedPath, t: Floats) -> tuple[float, float, float]:
    """Largest shares of the limits of speed, acceleration and jerk that an axis takes at instants t."""
    found = planned.derivatives(t)
    speed, acceleration, jerk = planned.limits.of(planned.moves.axes)
    inside = found.to_end > 1e-9
    soft = planned.moves.jerk_limited[planned.sample(t).row]
    inside_a = inside if np.isin(planned.moves.blending, (1, 2)).any() else np.ones_like(inside)
    return (
        float(np.abs(found.velocity / speed).max()),
        float(np.abs(found.acceleration / acceleration)[inside_a].max(initial=0)),
        float(np.abs(found.jerk / jerk)[inside & soft].max(initial=0)),
    )


@pytest.mark.parametrize("group", [0, *(pytest.param(k, marks=pytest.mark.extensive) for k in range(1, GROUPS))])
def test_random_programs_keep_every_limit(group: int) -> None:
    for seed in range(group, COUNT, GROUPS):
        random = np.random.default_rng(seed)
        blendings = tuple(Blending) if seed % 4 else (Blending.TOLERANCE,)
        moves = random_program(random, blendings)
        planned = plan_moves(moves, random_limits(random, "".join(moves.axes)))
        t = dense_instants(planned, random)
        assert max(largest_use(planned, t)) <= 1 + 1e-9, seed
        sampled = planned.sample(t)
        assert np.all(np.diff(sampled.s) >= -1e-12), seed
        assert np.allclose(sampled.position[-1], moves.end[-1], rtol=0, atol=1e-12), seed
        for row in np.unique(sampled.row):
            at = np.flatnonzero(sampled.row == row)
            at = at[:: max(1, len(at) // 16)]
            near = [k for k in range(max(row - 1, 0), min(row + 2, len(moves))) if moves.motion[k] != Motion.DWELL]
            off = np.min([distance_to_row(moves, k, sampled.position[at]) for k in near], axis=0).max()
            corners = [moves.blending[row], *([moves.blending[row - 1]] if row else [])]
            if Blending.DISTANCE not in corners:
                within = max(
                    (moves.tolerance[k] for k in (row - 1, row) if k >= 0 and moves.blending[k] == Blending.TOLERANCE),
                    default=0.0,
                )
                assert off <= within * (1 + 1e-6) + 1e-9, (seed, row)


def test_derivatives_are_those_of_the_positions() -> None:
    """Third differences of positions are means of the jerk, whatever the planner says of it."""
    random = np.random.default_rng(5)
    for _ in range(8):
        moves = random_program(random, (Blending.TOLERANCE, Blending.EXACT_STOP))
        limits = random_limits(random, "".join(moves.axes))
        planned = plan_moves(moves, limits)
        h = 1e-3
        t = np.arange(-5 * h, planned.duration + 5 * h, h)
        x = planned.sample(t).position
        speed, acceleration, jerk = limits.of(moves.axes)
        for order, limit in ((1, speed), (2, acceleration), (3, jerk)):
            if order == 3 and not moves.jerk_limited.all():
                continue
            noise = 2**order * 5e-15 / h**order  # rounding of the positions
            assert (np.abs(np.diff(x, order, axis=0)) / h**order - limit).max() <= noise
        if moves.jerk_limited.all():
            half = planned.derivatives(t[:-1] + h / 2).velocity
            assert np.abs(np.diff(x, axis=0) / h - half).max() <= 1.01 * h**2 / 24 * jerk.max() + 1e-11
