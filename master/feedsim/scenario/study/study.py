"""A study: a scenario, the parameters that are varied from run to run, and how the runs are spread over them; and what
a run sets in the scenario, as it stands behind KEY= on the command line."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any

from feedsim.files.source import Source, parse
from feedsim.foundation.errors import Finding, InputError
from feedsim.scenario.base import Base, Change
from feedsim.scenario.study.file import Kind, Method


@dataclass(frozen=True)
class Distribution:
    """Of a number, in its SI unit. What a kind does not need is None.

    The `low` and `high` of a normal or lognormal one cut it.

    Attributes:
        low, high: least and greatest value.
        mean, deviation: of the normal distribution; of a lognormal one those of the quantity, not of its logarithm,
            both before it is cut.
        mode: most frequent value of a triangular one.
        count: number of values in a grid.
    """

    kind: Kind
    low: float | None = None
    high: float | None = None
    mean: float | None = None
    deviation: float | None = None
    mode: float | None = None
    count: int | None = None

    @property
    def support(self) -> tuple[float, float]:
        """Least and greatest value that can occur."""
        least = 0.0 if self.kind == "lognormal" else -inf
        return (least if self.low is None else self.low, inf if self.high is None else self.high)


@dataclass(frozen=True)
class Choice:
    """One of the values that a parameter takes.

    Attributes:
        label: as the table shows it.
        number: SI value; None where it is no number.
        text: as it stands behind KEY= on the command line.
        data: plain value, with the YAML files that it names in place of their names.
    """

    label: str
    number: float | None
    text: str
    data: Any


@dataclass(frozen=True)
class Parameter:
    """What is varied.

    Attributes:
        name: of its column.
        keys: dotted keys that it sets, all to the same value.
        unit: SI unit of its values; "" where they are words.
        factor: whether it multiplies what the scenario has.
        whole: whether its values are whole numbers.
        distribution: of its values; None where there are `choices`.
        choices: values that it takes.
        origins: of a factor: every key that it sets, without *, the value there and its unit.
    """

    name: str
    keys: tuple[str, ...]
    unit: str
    factor: bool = False
    whole: bool = False
    distribution: Distribution | None = None
    choices: tuple[Choice, ...] = ()
    origins: tuple[tuple[str, float, str], ...] = ()

    @property
    def worded(self) -> bool:
        """Whether its values are words and no numbers."""
        return any(choice.number is None for choice in self.choices)

    @property
    def places(self) -> int:
        """Number of its values in a grid."""
        return len(self.choices) if self.distribution is None else self.distribution.count or 1

    @property
    def middle(self) -> float:
        """A value from the middle, as a design has it."""
        result = self.distribution
        if result is None:
            number = self.choices[len(self.choices) // 2].number
            return float(len(self.choices) // 2) if self.worded or number is None else number
        low, high = result.support
        if result.mean is not None:
            return min(max(result.mean, low), high)
        return low + (high - low) // 2 if self.whole else low + (high - low) / 2

    @property
    def label(self) -> str:
        """Head of its column: "X.F_C [N.m]"."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


@dataclass(frozen=True)
class Sampling:
    """How the runs are spread; `runs` is 0 for a grid, and N of a sensitivity study."""

    method: Method
    runs: int
    seed: int


@dataclass(frozen=True, eq=False)
class Study:
    """A study that is checked.

    Attributes:
        file: study file.
        base: the scenario, with what the study sets in every run.
        settings: what the study sets in every run, as KEY=VALUE with file names relative to the working folder.
        figures: patterns of the figures wanted; None: all.
        goal: "smallest" or "largest", and the figure. explain: a figure; "" where none is asked about.
        files: files of data that runs may read, each once.
        overrides: what was set from outside, as KEY=VALUE.
        warnings: what a user should know before the runs are made.
    """

    name: str
    note: str
    file: Path
    base: Base
    sampling: Sampling
    parameters: tuple[Parameter, ...]
    settings: tuple[str, ...] = ()
    figures: tuple[str, ...] | None = None
    goal: tuple[str, str] | None = None
    explain: str = ""
    files: tuple[Path, ...] = ()
    overrides: tuple[str, ...] = ()
    warnings: tuple[Finding, ...] = ()
    written: Mapping[str, Any] = field(default_factory=dict)  # the file as it stands, to be shown

    @property
    def scenario(self) -> Path:
        """Scenario file."""
        return self.base.draft.path


def changes_of(parameters: Sequence[Parameter], values: Sequence[float]) -> tuple[Change, ...]:
    """What is set by parameters with these values: SI, or where they are words, the number of the choice.

    Parameters that multiply the same place multiply one another.
    """
    made: list[Change] = []
    factors: dict[str, tuple[float, str]] = {}
    for parameter, value in zip(parameters, values, strict=True):
        for key, origin, unit in parameter.origins:
            factors[key] = (factors.get(key, (origin, unit))[0] * value, unit)
        if not parameter.factor:
            made += _plain_changes(parameter, value)
    made += [_number_change(key, value, unit) for key, (value, unit) in factors.items()]
    return tuple(made)


def _plain_changes(parameter: Parameter, value: float) -> list[Change]:
    if parameter.worded:
        choice = parameter.choices[int(value)]
        return [Change(key, choice.text, choice.data) for key in parameter.keys]
    if parameter.whole:
        return [Change(key, str(int(value)), int(value)) for key in parameter.keys]
    return [_number_change(key, value, parameter.unit) for key in parameter.keys]


def _number_change(key: str, value: float, unit: str) -> Change:
    text = number_text(value, unit)
    return Change(key, text, value if unit == "1" else text)


def as_text(written: Source, meant: Any) -> str:
    """A value that means `meant`: the same, or with the files that it names read or relative to the working folder."""
    data = written.data
    if meant != data and isinstance(data, str):
        return _quote_value(meant if isinstance(meant, str) else str(written.mark(()).folder / data))
    return _quote_value(meant)


def number_text(value: float, unit: str) -> str:
    """An SI value so that it reads back as the same number, bit for bit."""
    return repr(float(value)) if unit == "1" else f"{float(value)!r} {unit}"


def _quote_value(value: Any) -> str:
    if isinstance(value, str):
        try:
            same = parse(value, "", Path(), lines=False).data == value
        except InputError:
            same = False
        if same:
            return value
    return json.dumps(value, ensure_ascii=False)
