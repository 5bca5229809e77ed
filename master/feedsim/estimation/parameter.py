"""What a fit estimates: parameters with bounds, scale and transformation, and what is known of them beforehand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, inf, isfinite, log

import numpy as np
from numpy.typing import NDArray

from feedsim.foundation.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """A free parameter. A method moves its position: (value - origin)/scale, or log(value/origin)/scale.

    Attributes:
        name: as it is handed to the model.
        start: first value; a method moves it into the bounds.
        lower, upper: bounds, may be infinite.
        scale: change that matters, > 0, of the value, or of its logarithm where log. Default: |start|, or 1 where that
            is 0; 1 where log.
        scatter: range that further starts are drawn from; default: the bounds where finite, else start -+ scale.
        log: fitted as its logarithm (lower and start must be > 0): for what is known only by its order of magnitude.
        origin: value whose position is 0; default: 0, or 1 where log. With the start as origin and the expected
            deviation as scale, the position itself is the residual of a prior.
    """

    name: str
    start: float
    lower: float = -inf
    upper: float = inf
    scale: float | None = None
    scatter: tuple[float, float] | None = None
    log: bool = False
    origin: float | None = None

    def __post_init__(self) -> None:
        if not self.lower < self.upper:
            raise InputError(f"{self.name}: the bounds {self.lower:g} .. {self.upper:g} leave no room")
        if not isfinite(self.start):
            raise InputError(f"{self.name}: the start {self.start:g} is not a number")
        if self.scale is not None and not self.scale > 0:
            raise InputError(f"{self.name}: the scale {self.scale:g} is not above 0")
        if self.log and not (self.lower > 0 and self.start > 0 and self.zero > 0):
            raise InputError(f"{self.name}: a logarithm needs a start and a lower bound above 0")

    @property
    def step(self) -> float:
        """The scale, or its default."""
        return self.scale if self.scale is not None else 1.0 if self.log else abs(self.start) or 1.0

    @property
    def zero(self) -> float:
        """The origin, or its default."""
        return self.origin if self.origin is not None else 1.0 if self.log else 0.0

    def inward(self, value: float) -> float:
        """From the value to the position."""
        return (log(value / self.zero) if self.log else value - self.zero) / self.step

    def outward(self, position: float) -> float:
        """From the position to the value, within the bounds: the way there and back rounds."""
        moved = position * self.step
        value = self.zero * exp(moved) if self.log else self.zero + moved
        return min(max(value, self.lower), self.upper)

    def slope(self, value: float) -> float:
        """d value / d position."""
        return value * self.step if self.log else self.step

    def bounds(self) -> tuple[float, float]:
        """Of the position."""
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

    @classmethod
    def join(cls, priors: Sequence[Prior]) -> Prior:
        """Independent priors as one."""
        names = tuple(name for prior in priors for name in prior.names)
        covariance = np.zeros((len(names), len(names)))
        at = 0
        for prior in priors:
            size = len(prior.names)
            covariance[at : at + size, at : at + size] = prior.covariance
            at += size
        return cls(names, np.concatenate([np.zeros(0), *(prior.values for prior in priors)]), covariance)

    def restrict(self, free: Sequence[str]) -> Prior:
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
