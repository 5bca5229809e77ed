"""A wired system as data, and what every importer's adapter takes and gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Value = float | int | bool | str


RELEASE, FINISHED = "release", "finished"  # of the variables that are connected, those that are Boolean


def boolean(variable: str) -> bool:
    """Whether a connected variable is Boolean; all others are Real."""
    return variable.rpartition(".")[2] in (RELEASE, FINISHED)


@dataclass(frozen=True)
class Component:
    """An instance: `archive` is its .fmu, `start` its parameters and start values by variable name."""

    archive: Path
    start: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True)
class System:
    """Instances by name, in the order in which an importer meets them, and connections (from, to), each end
    (instance, variable)."""

    components: Mapping[str, Component]
    connections: tuple[tuple[tuple[str, str], tuple[str, str]], ...] = ()

    def sources(self, instance: str) -> dict[str, tuple[str, str]]:
        """Connected inputs of `instance` -> what drives them."""
        return {target[1]: source for source, target in self.connections if target[0] == instance}

    def without(self, name: str) -> System:
        """The same system without the connections to inputs of that name."""
        return System(self.components, tuple(each for each in self.connections if each[1][1] != name))

    def reordered(self, *names: str) -> System:
        """The same system with its instances in another order."""
        assert sorted(names) == sorted(self.components)
        return System({name: self.components[name] for name in names}, self.connections)


@dataclass(frozen=True)
class Experiment:
    """`steps` steps of `step` [s] from t = 0; `record` are the variables to bring back."""

    step: float
    steps: int
    record: tuple[tuple[str, str], ...]

    @property
    def stop(self) -> float:
        return self.step * self.steps


Result = dict[tuple[str, str], Floats]
"""Variable -> (steps + 1,) values at k * step, the initial ones first; NaN where an importer does not tell."""


def difference(a: Floats, b: Floats) -> float:
    """Largest difference, where both tell."""
    assert a.shape == b.shape
    both = np.isfinite(a) & np.isfinite(b)
    assert both.sum() > 0.9 * len(a), "most of a record is missing"
    return float(np.max(np.abs(a - b)[both]))
