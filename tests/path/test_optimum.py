"""Duration against an optimum with jerk on the same path, found by successive linear programs.

The unknown is b = (dq/dt)^2 at nodes of the path's parameter q. Speed and acceleration are linear in it. So is the jerk
over dq/dt, x''' b + 3/2 x'' b' + 1/2 x' b'', whose limit j / sqrt(b) is convex: its tangent keeps the limit. So each
linear program, with the duration linearised and b between half and twice the one before, keeps all limits at the nodes
and is not slower. What comes out may still be a local optimum.

FEEDSIM_PATH_OPTIMA=20 tries as many random programs (some minutes); three otherwise.
"""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import csr_array, diags_array, vstack

from feedsim.motions.part_program import Blending, Moves
from feedsim.motions.planner import PlannedPath, plan_moves
from path_helpers import Draft, limits_of, square

Floats = NDArray[np.float64]
COUNT = int(os.environ.get("FEEDSIM_PATH_OPTIMA", "3"))


def optimum(planned: PlannedPath, nodes: int, rounds: int = 40) -> float:
    """Shortest duration [s] along the path of a plan from rest to rest, at its limits; F is a limit of dq/dt."""
    marks = planned.end_time[:-1, None] + 0.08 * np.linspace(-1, 1, nodes // 4) ** 3
    t = np.unique(
        np.clip(np.concatenate([np.linspace(0, planned.duration, nodes), marks.ravel()]), 0, planned.duration)
    )
    t = t[np.concatenate([[True], np.diff(t) > 1e-5])]
    nodes = len(t)
    found = planned.derivatives(t)
    rate, second, third = found.parameter[:, 1], found.parameter[:, 2], found.parameter[:, 3]
    rate[[0, -1]] = 0
    h = np.diff(t)
    dq = h / 2 * (rate[1:] + rate[:-1]) - h**2 / 12 * np.diff(second)
    inner = slice(1, -1)
    r = rate[inner, None]
    x1 = found.velocity[inner] / r
    x2 = (found.acceleration[inner] - x1 * second[inner, None]) / r**2
    x3 = (found.jerk[inner] - x1 * third[inner, None] - 3 * x2 * r * second[inner, None]) / r**3
    speed, acceleration, jerk = planned.limits.of(planned.moves.axes)
    rows = planned.sample(t).row[inner]
    geometric = np.linalg.norm(x1, axis=1)

    # b at the inner nodes; 0 at both ends. Three-point differences on the uneven grid.
    m = nodes - 2
    d0, d1 = dq[:-1], dq[1:]
    first = diags_array(
        [(-d1 / (d0 * (d0 + d1)))[1:], (d1 - d0) / (d0 * d1), (d0 / (d1 * (d0 + d1)))[:-1]], offsets=[-1, 0, 1],
        shape=(m, m),
    )  # fmt: skip
    twice = diags_array(
        [(2 / (d0 * (d0 + d1)))[1:], -2 / (d0 * d1), (2 / (d1 * (d0 + d1)))[:-1]], offsets=[-1, 0, 1], shape=(m, m)
    )
    cap = np.min((speed / np.maximum(np.abs(x1), 1e-12)) ** 2, axis=1)
    cap = np.minimum(cap, (planned.moves.feed[rows] / geometric) ** 2)
    # At rest the acceleration is 0 as well: v = J t^2 / 2 at q = J t^3 / 6 is the most beside both ends.
    for node in (0, 1, 2):
        for at, q in ((node, dq[: node + 1].sum()), (m - 1 - node, dq[m - node :].sum())):
            J = np.min(jerk / np.maximum(np.abs(x1[at]), 1e-12))
            cap[at] = min(cap[at], J**2 / 4 * (6 * q / J) ** (4 / 3))
    accelerations = [csr_array(diags_array(x2[:, i]) + diags_array(x1[:, i] / 2) @ first) for i in range(len(speed))]
    jerks = [
        csr_array(diags_array(x3[:, i]) + diags_array(1.5 * x2[:, i]) @ first + diags_array(x1[:, i] / 2) @ twice)
        for i in range(len(speed))
    ]

    def duration(b: Floats) -> float:
        root = np.sqrt(np.concatenate([[0], b, [0]]))
        return float(np.sum(2 * dq / (root[1:] + root[:-1])))

    b = rate[inner] ** 2 * 0.9
    reach, best = 2.0, duration(b)
    for _ in range(rounds):
        root = np.sqrt(np.concatenate([[0], b, [0]]))
        each = -dq / (root[1:] + root[:-1]) ** 2  # d(2 dq / (r0 + r1)) / d(b) is this over r
        cost = (each[:-1] + each[1:]) / root[1:-1]
        matrices, sides = [], []
        for i in range(len(speed)):
            tangent = diags_array(0.5 * jerk[i] * b**-1.5)
            for sign in (1, -1):
                matrices += [sign * accelerations[i], sign * jerks[i] + tangent]
                sides += [np.full(m, acceleration[i]), 1.5 * jerk[i] * b**-0.5]
        # Scaled: unknowns b / b_before, rows by their limits.
        A, side = vstack(matrices) @ diags_array(b), np.concatenate(sides)
        result = linprog(
            cost * b / np.abs(cost * b).max(), A_ub=csr_array(diags_array(1 / side) @ A), b_ub=np.ones(len(side)),
            bounds=np.column_stack([np.full(m, 1 / reach), np.minimum(reach, np.maximum(cap / b, 1 / reach))]),
            method="highs",
        )  # fmt: skip
        if result.status != 0:
            reach = np.sqrt(reach)
            continue
        tried = result.x * b
        if duration(tried) > best * (1 - 1e-4):
            reach = np.sqrt(reach)
            if duration(tried) < best:
                b, best = tried, duration(tried)
            if reach < 1.05:
                break
            continue
        b, best = tried, duration(tried)
    return best


def square_diamond_circle() -> Moves:
    """In X and Z of the plane: a square of 20 mm, a diamond within it, a circle within that."""
    draft = Draft(("X", "Z"), np.zeros(2), 0.05, Blending.TOLERANCE, 10e-6)
    a = 20e-3
    for corner in ((0, a), (a, a), (a, 0), (0, 0), (0, a / 2), (a / 2, a), (a, a / 2), (a / 2, 0), (0, a / 2)):
        draft.line(*corner)
    draft.line(a / 4, a / 2)
    draft.arc((a / 2, 0, a / 2), 2 * np.pi, normal=(0, 1, 0))
    return draft.moves


def random_moves(random: np.random.Generator) -> Moves:
    """Zigzags of 2 mm, polygons, arcs of 1 to 30 mm."""
    draft = Draft(
        ("X", "Y"), np.zeros(2), 10 ** random.uniform(-1.7, -0.7), Blending.TOLERANCE, 10 ** random.uniform(-5.3, -4)
    )
    kind, heading = random.choice(["zigzag", "polygon", "arcs"]), 0.0
    for k in range(int(random.integers(4, 9))):
        p = draft.position.copy()
        if kind == "arcs":
            radius, angle = random.uniform(1e-3, 30e-3), float(random.choice([-1, 1]) * random.uniform(0.3, 3))
            out = heading + np.pi / 2 * np.sign(angle)
            draft.arc((*(p + radius * np.array([np.cos(out), np.sin(out)])), 0.0), angle)
            heading += angle + random.choice([0, 0.5])
            continue
        step = 2e-3 if kind == "zigzag" else random.uniform(5e-3, 40e-3)
        heading = (0.6 if k % 2 else -0.6) if kind == "zigzag" else random.uniform(0, 2 * np.pi)
        draft.line(*(p + step * np.array([np.cos(heading), np.sin(heading)])))
    return draft.moves


@pytest.mark.parametrize(
    ("program", "limits"),
    [
        (lambda: square(50e-3, 0.1, 5e-6), limits_of("XY", 1, 5, 20)),
        (lambda: square(50e-3, 0.1, 100e-6), limits_of("XY", 1, 5, 20)),
        (square_diamond_circle, limits_of("XZ", 0.5, 5, 150)),
    ],
    ids=["square 5 um", "square 100 um", "square, diamond, circle"],
)
def test_close_to_the_optimum(program: Callable[[], Moves], limits: object) -> None:
    planned = plan_moves(program(), limits)
    assert planned.duration <= 1.05 * optimum(planned, 300)


def test_random_programs_are_not_far_from_the_optimum() -> None:
    ratios = []
    for seed in range(COUNT):
        random = np.random.default_rng(seed)
        moves = random_moves(random)
        planned = plan_moves(moves, limits_of("XY", 0.5, random.uniform(1, 8), random.uniform(20, 200)))
        ratios.append(planned.duration / optimum(planned, 300))
    assert np.median(ratios) <= 1.15, ratios
    assert max(ratios) <= 1.5, ratios
