"""Bounded non-linear least squares with several starts: values, covariance, correlation, what sits at a bound."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite, log

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from feedsim.errors import InputError
from feedsim.identify.record import Array

Residuals = Callable[[Mapping[str, float]], Array]

# A direction of the scaled parameters that the residuals answer to this much less than to the strongest one tells
# nothing: below it lies the error of the differences that the Jacobian is made of.
SILENT = 1e-8
AT_BOUND = 1e-6  # of the scale: what counts as sitting at a bound


@dataclass(frozen=True)
class Parameter:
    """A free parameter.

    Attributes:
        name: as it is handed to the residuals.
        start: first value; is moved into the bounds.
        lower, upper: bounds, may be infinite.
        scale: change that matters, > 0; default: |start|, or 1 where that is 0. Differences are taken in it.
        scatter: range that further starts are drawn from; default: the bounds where finite, else start -+ scale.
        log: fitted as its logarithm (lower and start must be > 0): for what is known only by its order of magnitude.
    """

    name: str
    start: float
    lower: float = -inf
    upper: float = inf
    scale: float | None = None
    scatter: tuple[float, float] | None = None
    log: bool = False

    def __post_init__(self) -> None:
        if not self.lower < self.upper:
            raise InputError(f"{self.name}: the bounds {self.lower:g} .. {self.upper:g} leave no room")
        if not isfinite(self.start):
            raise InputError(f"{self.name}: the start {self.start:g} is not a number")
        if self.scale is not None and not self.scale > 0:
            raise InputError(f"{self.name}: the scale {self.scale:g} is not above 0")
        if self.log and not (self.lower > 0 and self.start > 0):
            raise InputError(f"{self.name}: a logarithm needs a start and a lower bound above 0")

    @property
    def step(self) -> float:
        """The scale that holds."""
        return self.scale if self.scale is not None else abs(self.start) or 1.0

    def inward(self, value: float) -> float:
        """From the parameter to what the solver moves."""
        return log(value) if self.log else value / self.step

    def outward(self, position: float) -> float:
        """From what the solver moves to the parameter."""
        return float(np.exp(position)) if self.log else position * self.step

    def slope(self, value: float) -> float:
        """d parameter / d position."""
        return value if self.log else self.step

    def bounds(self) -> tuple[float, float]:
        """Of what the solver moves."""
        upper = inf if self.upper == inf else self.inward(self.upper)
        return -inf if self.lower == -inf else self.inward(self.lower), upper

    def draw(self, random: np.random.Generator) -> float:
        """A further start."""
        low, high = self.scatter or (self.lower, self.upper)
        if not (isfinite(low) and isfinite(high)):
            low, high = max(self.start - self.step, self.lower), min(self.start + self.step, self.upper)
        if self.log:
            return float(np.exp(random.uniform(log(max(low, self.lower)), log(min(high, self.upper)))))
        return float(random.uniform(max(low, self.lower), min(high, self.upper)))


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known before: values (P,) of `names` with their covariance (P, P). Names that are not free are left out
    (their uncertainty then does not carry over)."""

    names: tuple[str, ...]
    values: Array
    covariance: Array

    def restricted(self, free: Sequence[str]) -> Prior:
        """Of those among `free`: the marginal distribution."""
        kept = [k for k, name in enumerate(self.names) if name in free]
        return Prior(tuple(self.names[k] for k in kept), self.values[kept], self.covariance[np.ix_(kept, kept)])

    def rows(self) -> Array:
        """(P, P) R with R covariance R^T = 1: R (x - values) are residuals of unit variance."""
        spread = np.sqrt(np.diag(self.covariance))
        if not np.all(np.isfinite(self.covariance)) or not np.all(spread > 0):
            raise InputError("prior: a covariance that is not finite, or a variance that is not above 0")
        try:
            root = np.linalg.cholesky(self.covariance / np.outer(spread, spread))
        except np.linalg.LinAlgError as error:
            raise InputError("prior: the covariance is not positive definite") from error
        return np.asarray(np.linalg.inv(root) / spread, dtype=np.float64)


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
        at_bound: parameters that sit at a bound. silent: those that the data do not tell.
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
    residuals: Residuals,
    parameters: Sequence[Parameter],
    *,
    prior: Prior | None = None,
    starts: int = 1,
    seed: int = 0,
    normalised: bool = True,
    difference: float = 1e-6,
    tolerance: float = 1e-10,
    limit: int = 100,
) -> Fit:
    """Least squares within bounds by trust-region-reflective steps, scaled by `Parameter.scale`.

    Args:
        residuals: name -> value to (N,), N the same at every call.
        prior: its rows are added to the residuals; asks for normalised ones.
        starts: how many in all; the further ones are drawn with `seed`.
        normalised: the residuals have unit variance, and the covariance is (J^T J)^-1. If not, it is multiplied by the
            residual variance.
        difference: step of the differences, of the scale (of the value where log), to one side while
            searching; the covariance comes from central ones.
        tolerance: of cost, step and gradient. limit: steps per start.

    Raises InputError: no parameters, a name twice, fewer residuals than parameters, no start arrives.
    """
    names = tuple(parameter.name for parameter in parameters)
    if not names or len(set(names)) < len(names):
        raise InputError(f"fit: the parameters {list(names)} are none, or one is there twice")
    if prior is not None and not normalised:
        raise InputError("fit: a prior asks for normalised residuals, or its weight against the data is unknown")
    problem = _Problem(residuals, tuple(parameters), prior, difference)
    random = np.random.default_rng(seed)
    made: list[tuple[Start, Array | None]] = []
    for k in range(max(starts, 1)):
        begin = np.array([p.start if k == 0 else p.draw(random) for p in parameters])
        made.append(_run(problem, begin, tolerance=tolerance, limit=limit))
    arrived = [(start.cost, position) for start, position in made if position is not None]
    if not arrived:
        raise InputError(f"fit: none of {len(made)} start(s) arrives: {made[0][0].failure}")
    cost, best = min(arrived, key=lambda pair: pair[0])
    return _conclude(problem, best, cost, tuple(start for start, _ in made), normalised)


class _Problem:
    """Residuals and their derivatives over what the solver moves."""

    def __init__(self, model: Residuals, parameters: tuple[Parameter, ...], prior: Prior | None, step: float) -> None:
        self.model, self.parameters, self.step = model, parameters, step
        self.names = tuple(parameter.name for parameter in parameters)
        low, high = zip(*(parameter.bounds() for parameter in parameters), strict=True)
        self.lower, self.upper = np.array(low), np.array(high)
        self.prior = prior.restricted(self.names) if prior is not None else None
        self.root = self.prior.rows() if self.prior is not None and self.prior.names else np.zeros((0, 0))
        self.last: tuple[Array, Array] | None = None

    def values(self, position: Array) -> dict[str, float]:
        clipped = np.clip(position, self.lower, self.upper)
        moved = {p.name: p.outward(float(x)) for p, x in zip(self.parameters, clipped, strict=True)}
        # The way there and back rounds: a model that checks its bounds must not see what lies a digit outside of them.
        return {p.name: min(max(moved[p.name], p.lower), p.upper) for p in self.parameters}

    def data(self, position: Array) -> Array:
        """(N,) the model's own residuals."""
        found = np.asarray(self.model(self.values(position)), dtype=np.float64)
        if not np.all(np.isfinite(found)):
            raise InputError("the residuals are not finite at " + _text(self.values(position)))
        return found

    def __call__(self, position: Array) -> Array:
        """(N + prior,)."""
        if self.last is not None and np.array_equal(self.last[0], position):
            return self.last[1]
        found = self.data(position)
        if self.prior is not None and len(self.root):
            values = self.values(position)
            away = np.array([values[name] for name in self.prior.names]) - self.prior.values
            found = np.concatenate([found, self.root @ away])
        self.last = (position.copy(), found)
        return found

    def jacobian(self, position: Array, central: bool) -> Array:
        """(N + prior, P) by differences that stay within the bounds."""
        here = self(position)
        columns = []
        for k in range(len(position)):
            ahead, behind = position.copy(), position.copy()
            ahead[k] = min(position[k] + self.step, self.upper[k])
            behind[k] = max(position[k] - self.step, self.lower[k])
            if not central:
                # One side is enough: the one with more room.
                if ahead[k] - position[k] >= position[k] - behind[k]:
                    behind = position
                else:
                    ahead = position
            first = here if behind is position else self(behind)
            second = here if ahead is position else self(ahead)
            columns.append((second - first) / (ahead[k] - behind[k]))
        self.last = (position.copy(), here)
        return np.column_stack(columns)


def _run(problem: _Problem, begin: Array, *, tolerance: float, limit: int) -> tuple[Start, Array | None]:
    """One start, and where it ended (None: nowhere)."""
    first = np.array(
        [p.inward(min(max(x, p.lower), p.upper)) for p, x in zip(problem.parameters, map(float, begin), strict=True)]
    )
    try:
        if len(problem(first)) < len(first):
            raise InputError(f"{len(problem(first))} residuals cannot tell {len(first)} parameters")
        found = least_squares(
            problem,
            first,
            jac=lambda position: problem.jacobian(position, central=False),
            bounds=(problem.lower, problem.upper),
            ftol=tolerance,
            xtol=tolerance,
            gtol=tolerance,
            max_nfev=limit,
        )
    except InputError as error:
        return Start(inf, str(error)), None
    position = _onto_bounds(problem, found.x)
    cost = 0.5 * float(np.sum(problem(position) ** 2))
    return Start(cost), position


def _onto_bounds(problem: _Problem, position: Array) -> Array:
    """Reflective steps stay strictly inside: what is within rounding of a bound is put onto it."""
    low, high = position - problem.lower < AT_BOUND, problem.upper - position < AT_BOUND
    return np.asarray(np.where(low, problem.lower, np.where(high, problem.upper, position)), dtype=np.float64)


def _conclude(problem: _Problem, position: Array, cost: float, starts: tuple[Start, ...], normalised: bool) -> Fit:
    """Covariance and what else belongs to a solution."""
    everything = problem.jacobian(position, central=True)
    own = len(everything) - len(problem.root)
    residuals = problem(position)[:own]
    values = np.array(list(problem.values(position).values()))
    slopes = np.array([p.slope(float(x)) for p, x in zip(problem.parameters, values, strict=True)])
    scaled, silent = inverse(everything)
    freedom = own - len(values)
    variance = float(np.sum(residuals**2) / freedom) if freedom > 0 else inf
    covariance = scaled * np.outer(slopes, slopes) * (1.0 if normalised else variance)
    edge = (position <= problem.lower) | (position >= problem.upper)
    return Fit(
        problem.names,
        values,
        covariance,
        residuals,
        everything[:own] / slopes,
        cost,
        tuple(name for name, at in zip(problem.names, edge, strict=True) if at),
        tuple(name for name, quiet in zip(problem.names, silent, strict=True) if quiet),
        starts,
    )


def inverse(jacobian: Array) -> tuple[Array, NDArray[np.bool_]]:
    """(J^T J)^-1 of a scaled Jacobian (N, P), and which parameters (P,) the rows do not tell.

    Those take part in a direction that no row answers to; their variance is inf, their covariance with others 0, and
    the others' is what it is were they held.
    """
    size = jacobian.shape[1]
    silent = np.linalg.norm(jacobian, axis=0) == 0
    while not np.all(silent):
        kept = np.flatnonzero(~silent)
        _, strength, directions = np.linalg.svd(jacobian[:, kept], full_matrices=False)
        quiet = strength <= SILENT * strength[0]
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
    found = np.eye(len(spread))
    kept = np.ix_(usable, usable)
    found[kept] = covariance[kept] / np.outer(spread[usable], spread[usable])
    np.fill_diagonal(found, 1.0)
    return found


def _text(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
