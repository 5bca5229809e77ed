"""Bounded non-linear least squares with several starts: values, covariance, correlation, what sits at a bound."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from feedsim.estimation.least_squares import LeastSquares, Model
from feedsim.estimation.parameter import Array, Parameter, Prior
from feedsim.foundation.errors import InputError

# A direction of the scaled parameters that the residuals answer to this much less than to the strongest one determines
# nothing: below it lies the error of the differences that the Jacobian is made of.
SINGULAR_RATIO = 1e-8
AT_BOUND = 1e-6  # of the scale: what counts as sitting at a bound
# Of a model that jumps, in positions: the first secant, and the widest one. Slopes over a standard deviation count.
FIRST_SECANT, WIDEST_SECANT, SECANTS = 1e-2, 0.1, 3
JUMP_RATIO = 2.0  # of one side's slope over the other's: what lies between is a jump


@dataclass(frozen=True, eq=False)
class Start:
    """How one start did: half the sum of squares where it ended.
    failure: why it was given up; empty where it arrived."""

    cost: float
    failure: str = ""


@dataclass(frozen=True, eq=False)
class Fit:
    """The best of the starts.

    Attributes:
        names, values (P,): the parameters.
        covariance: (P, P), linearised; as if there were no bounds. A parameter that the residuals do not answer to has
            the variance inf and no covariance with others.
        residuals: (N,) at the solution, without the prior's rows. jacobian: (N, P), likewise.
        cost: half the sum of squares, prior included.
        at_bound: parameters that sit at a bound. silent: those that the data do not determine.
        starts: in the order they were made; the first is the one given.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    residuals: Array
    jacobian: Array
    cost: float
    at_bound: tuple[str, ...]
    silent: tuple[str, ...]
    starts: tuple[Start, ...]

    def __getitem__(self, name: str) -> float:
        """Value of a parameter."""
        return float(self.values[self.names.index(name)])

    def mapping(self) -> dict[str, float]:
        """Name -> value."""
        return dict(zip(self.names, map(float, self.values), strict=True))

    @cached_property
    def sigma(self) -> dict[str, float]:
        """Name -> standard deviation."""
        return dict(zip(self.names, map(float, np.sqrt(np.diag(self.covariance))), strict=True))


def fit(
    residuals: Model,
    parameters: Sequence[Parameter],
    *,
    prior: Prior | None = None,
    prepare: Callable[[Sequence[Mapping[str, float]]], None] = lambda sets: None,
    starts: int = 1,
    seed: int = 0,
    normalised: bool = True,
    difference: float = 1e-6,
    jumps: bool = False,
    tolerance: float = 1e-10,
    limit: int = 100,
) -> Fit:
    """Least squares within bounds by trust-region-reflective steps, scaled by `Parameter.scale`.

    Args:
        residuals: name -> value to (N,), N the same at every call.
        prior: its rows are added to the residuals; asks for normalised ones.
        prepare: hears which values the residuals are asked for next, one set after the other.
        starts: how many in all; the further ones are drawn with `seed`.
        normalised: the residuals have unit variance, and the covariance is (J^T J)^-1. If not, it is multiplied by the
            residual variance.
        difference: step of the differences, of the scale (of the value where log), to one side while
            searching; the covariance comes from central ones.
        jumps: the model jumps in places. The covariance then comes from secants over the standard deviations: a slope
            across a jump would promise a value as exact as the difference is small.
        tolerance: of cost, step and gradient. limit: steps per start.

    Raises InputError: no parameters, a name twice, fewer residuals than parameters, no start arrives.
    """
    names = tuple(parameter.name for parameter in parameters)
    if not names or len(set(names)) < len(names):
        raise InputError(f"fit: the parameters {list(names)} are none, or one is there twice")
    if prior is not None and not normalised:
        raise InputError("fit: a prior asks for normalised residuals, or its weight against the data is unknown")
    problem, beside = _with_prior(residuals, tuple(parameters), prior, difference)

    def apply(of: Callable[[Array], Array], positions: Sequence[Array]) -> Iterable[Array]:
        prepare([problem.values(x) for x in positions])
        return map(of, positions)

    problem.apply = apply
    whole = _AllResiduals(problem)
    random = np.random.default_rng(seed)
    made: list[tuple[Start, Array | None]] = []
    for k in range(max(starts, 1)):
        begin = np.array([p.start if k == 0 else p.draw(random) for p in parameters])
        made.append(_run(whole, begin, tolerance=tolerance, limit=limit))
    arrived = [(start.cost, position) for start, position in made if position is not None]
    if not arrived:
        raise InputError(f"fit: none of {len(made)} start(s) arrives: {made[0][0].failure}")
    cost, best = min(arrived, key=lambda pair: pair[0])
    return _conclude(whole, best, beside, cost, tuple(start for start, _ in made), normalised, jumps)


def _with_prior(
    model: Model, parameters: Sequence[Parameter], prior: Prior | None, difference: float
) -> tuple[LeastSquares, int]:
    """The problem, and how many residuals the prior adds."""
    names = [parameter.name for parameter in parameters]
    known = prior.restrict(names) if prior is not None else None
    if known is None or not known.names:
        return LeastSquares(model, parameters, difference), 0
    root = known.rows()
    free = [parameters[names.index(name)] for name in known.names]
    places = [names.index(name) for name in known.names]

    def beside(x: Array) -> Array:
        values = np.array([p.outward(float(x[k])) for p, k in zip(free, places, strict=True)])
        return np.asarray(root @ (values - known.values))

    return LeastSquares(model, parameters, difference, beside), len(root)


class _AllResiduals:
    """All residuals over positions; the last ones are kept, for the Jacobian asks for them again."""

    def __init__(self, problem: LeastSquares) -> None:
        self.problem = problem
        self.last: tuple[Array, Array] | None = None

    def __call__(self, x: Array) -> Array:
        """(N + M,)"""
        if self.last is not None and np.array_equal(self.last[0], x):
            return self.last[1]
        residuals = self.problem.weighted(x, self.problem.errors(x))
        self.last = (x.copy(), residuals)
        return residuals

    def jacobian(self, x: Array, central: bool = False) -> Array:
        """(N + M, P)"""
        here = self(x)
        slopes = self.problem.differences(self, x, here, range(len(x)), central)
        self.last = (x.copy(), here)
        return slopes


def _run(whole: _AllResiduals, begin: Array, *, tolerance: float, limit: int) -> tuple[Start, Array | None]:
    """One start, and the position where it ended (None: nowhere)."""
    problem = whole.problem
    first = problem.position(dict(zip(problem.names, map(float, begin), strict=True)))
    try:
        if len(whole(first)) < len(first):
            raise InputError(f"{len(whole(first))} residuals cannot determine {len(first)} parameters")
        end = least_squares(
            whole,
            first,
            jac=whole.jacobian,
            bounds=(problem.low, problem.high),
            ftol=tolerance,
            xtol=tolerance,
            gtol=tolerance,
            max_nfev=limit,
        )
    except InputError as error:
        return Start(inf, str(error)), None
    position = _onto_bounds(problem, end.x)
    cost = 0.5 * float(np.sum(whole(position) ** 2))
    return Start(cost), position


def _onto_bounds(problem: LeastSquares, position: Array) -> Array:
    """Reflective steps stay strictly inside: what is within rounding of a bound is put onto it."""
    low, high = position - problem.low < AT_BOUND, problem.high - position < AT_BOUND
    return np.asarray(np.where(low, problem.low, np.where(high, problem.high, position)), dtype=np.float64)


def _conclude(
    whole: _AllResiduals,
    position: Array,
    beside: int,
    cost: float,
    starts: tuple[Start, ...],
    normalised: bool,
    jumps: bool,
) -> Fit:
    """Covariance and what else belongs to a solution. beside: residuals of the prior."""
    problem = whole.problem
    jacobian = _secants(whole, position) if jumps else whole.jacobian(position, central=True)
    own = len(jacobian) - beside
    residuals = whole(position)[:own]
    values = np.array(list(problem.values(position).values()))
    slopes = np.array([p.slope(float(x)) for p, x in zip(problem.parameters, values, strict=True)])
    scaled, silent = inverse(jacobian)
    freedom = own - len(values)
    variance = float(np.sum(residuals**2) / freedom) if freedom > 0 else inf
    covariance = scaled * np.outer(slopes, slopes) * (1.0 if normalised else variance)
    edge = (position <= problem.low) | (position >= problem.high)
    return Fit(
        problem.names,
        values,
        covariance,
        residuals,
        jacobian[:own] / slopes,
        cost,
        tuple(name for name, at in zip(problem.names, edge, strict=True) if at),
        tuple(name for name, quiet in zip(problem.names, silent, strict=True) if quiet),
        starts,
    )


def _secants(whole: _AllResiduals, position: Array) -> Array:
    """(N + M, P) slopes over as many positions as a standard deviation: the mean of both sides, but for a jump on one,
    which rules out what lies beyond it and determines nothing on the other."""
    problem, here = whole.problem, whole(position)
    jacobian, steps = np.empty((len(here), len(position))), np.full(len(position), FIRST_SECANT)
    for _ in range(SECANTS):
        for k, step in enumerate(steps):
            slopes = []
            for end in (max(position[k] - step, problem.low[k]), min(position[k] + step, problem.high[k])):
                if end != position[k]:
                    there = position.copy()
                    there[k] = end
                    slopes.append((whole(there) - here) / (end - position[k]))
            least, most = min(slopes, key=np.linalg.norm), max(slopes, key=np.linalg.norm)
            jump = np.linalg.norm(most) > JUMP_RATIO * np.linalg.norm(least)
            jacobian[:, k] = least if jump else (least + most) / 2
        steps = np.clip(np.sqrt(np.diag(inverse(jacobian)[0])), problem.steps, WIDEST_SECANT)
    whole(position)
    return jacobian


def inverse(jacobian: Array) -> tuple[Array, NDArray[np.bool_]]:
    """(J^T J)^-1 of a scaled Jacobian (N, P), and which parameters (P,) the rows do not determine.

    Those take part in a direction that no row answers to; their variance is inf, their covariance with others 0, and
    the others' is what it is were they held.
    """
    size = jacobian.shape[1]
    silent = np.linalg.norm(jacobian, axis=0) == 0
    while not np.all(silent):
        kept = np.flatnonzero(~silent)
        _, strength, directions = np.linalg.svd(jacobian[:, kept], full_matrices=False)
        quiet = strength <= SINGULAR_RATIO * strength[0]
        if not np.any(quiet) and len(strength) == len(kept):
            break
        # The parameter that leads the quietest direction is given up, then the rest is looked at anew. Of those that
        # lead alike it is the first: rounding, and with it the processor, does not choose.
        lead = np.abs(directions[-1])
        silent[kept[np.argmax(lead >= (1 - 1e-6) * lead.max())]] = True
    covariance = np.zeros((size, size))
    covariance[silent, silent] = inf
    if not np.all(silent):
        covariance[np.ix_(kept, kept)] = (directions.T / strength**2) @ directions
    return covariance, silent


def correlation(covariance: Array) -> Array:
    """(P, P) correlation of a covariance; 0 beside what has no finite variance."""
    spread = np.sqrt(np.diag(covariance))
    usable = np.isfinite(spread) & (spread > 0)
    values = np.eye(len(spread))
    kept = np.ix_(usable, usable)
    values[kept] = covariance[kept] / np.outer(spread[usable], spread[usable])
    np.fill_diagonal(values, 1.0)
    return values
