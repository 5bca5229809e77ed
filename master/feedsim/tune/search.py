"""The least of a function within a box, where some points are forbidden: an evolution strategy with ranks.

Covariance matrix adaptation (N. Hansen, The CMA evolution strategy: a tutorial, arXiv:1604.00772, equations 20 to 44).
Only ranks count. Allowed points stand before forbidden ones, those by the amount of the violation (K. Deb, An efficient
constraint handling method for genetic algorithms, Comput. Methods Appl. Mech. Engrg. 186 (2000)).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from feedsim.analysis.figures import Array

# (violation, value): violation 0 of an allowed point. Tuples are compared as they stand.
Rank = tuple[float, float]
LEAST_STEP = 0.004  # of the box: a search whose steps are shorter has come to its end


def least(
    rank: Callable[[Array], Rank], start: Array, *, step: float, evaluations: int, seed: int, population: int = 0
) -> tuple[Array, Rank]:
    """The best point of the unit cube (n,) that is met, and its rank.

    start: first mean. step: first standard deviation. The random numbers of a seed are the same in every call.
    """
    n = len(start)
    size = population or 4 + int(3 * math.log(n))
    half = size // 2
    weights = np.log(half + 0.5) - np.log(np.arange(1, half + 1))
    weights /= weights.sum()
    mass = 1 / float((weights**2).sum())
    c_c = (4 + mass / n) / (n + 4 + 2 * mass / n)
    c_s = (mass + 2) / (n + mass + 5)
    c_1 = 2 / ((n + 1.3) ** 2 + mass)
    c_mu = min(1 - c_1, 2 * (mass - 2 + 1 / mass) / ((n + 2) ** 2 + mass))
    damping = 1 + 2 * max(0.0, math.sqrt((mass - 1) / (n + 1)) - 1) + c_s
    length = math.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2))

    random = np.random.default_rng(seed)
    mean, sigma, covariance = np.array(start, dtype=np.float64), step, np.eye(n)
    path_c, path_s = np.zeros(n), np.zeros(n)
    best, best_rank, done, generation = mean.copy(), rank(mean), 1, 0
    while done + size <= evaluations and sigma * math.sqrt(float(np.diag(covariance).max())) > LEAST_STEP:
        values, vectors = np.linalg.eigh(covariance)
        root = np.sqrt(np.maximum(values, 1e-20))
        steps = random.normal(size=(size, n)) * root @ vectors.T
        points = 1 - np.abs((mean + sigma * steps) % 2 - 1)  # mirrored at the faces of the cube
        ranks = [rank(point) for point in points]
        done += size
        generation += 1
        order = sorted(range(size), key=lambda k: ranks[k])
        if ranks[order[0]] < best_rank:
            best, best_rank = points[order[0]].copy(), ranks[order[0]]
        taken = (points[order[:half]] - mean) / sigma
        move = weights @ taken
        mean = mean + sigma * move
        white = vectors @ ((vectors.T @ move) / root)
        path_s = (1 - c_s) * path_s + math.sqrt(c_s * (2 - c_s) * mass) * white
        ahead = float(np.linalg.norm(path_s)) / math.sqrt(1 - (1 - c_s) ** (2 * generation))
        moving = 1.0 if ahead < (1.4 + 2 / (n + 1)) * length else 0.0
        path_c = (1 - c_c) * path_c + moving * math.sqrt(c_c * (2 - c_c) * mass) * move
        covariance = (
            (1 - c_1 - c_mu + (1 - moving) * c_1 * c_c * (2 - c_c)) * covariance
            + c_1 * np.outer(path_c, path_c)
            + c_mu * (taken.T * weights) @ taken
        )
        sigma *= math.exp(min(1.0, c_s / damping * (float(np.linalg.norm(path_s)) / length - 1)))
    return best, best_rank
