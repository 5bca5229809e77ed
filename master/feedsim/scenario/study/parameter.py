"""The entries of a study's `parameters`, read with what the scenario shows of their keys: dimension, allowed range."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import erfc, inf, log, log1p, sqrt
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from feedsim.files import checked
from feedsim.files.checked import describe, dotted_key, quantity_of, reading_context
from feedsim.files.fields import Quantity
from feedsim.files.source import Mark, Place, Source, value_at
from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError
from feedsim.scenario.base import Base, Change, data_files
from feedsim.scenario.model import Scenario
from feedsim.scenario.study.file import Kind, ParameterEntry
from feedsim.scenario.study.study import Choice, Distribution, Parameter, as_text, number_text

# --- Which numbers a distribution, a range or a grid needs, and what is wrong with those that are given ---------------


# Kind -> what it needs, what it may have.
KEYS_OF_KIND: dict[Kind, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "uniform": (("from", "to"), ()),
    "loguniform": (("from", "to"), ()),
    "triangular": (("from", "to"), ("mode",)),
    "normal": (("mean", "deviation"), ("from", "to")),
    "lognormal": (("mean", "deviation"), ("from", "to")),
}
# Deviations from the mean beyond which nothing is left: doubles cannot represent the tail's probability any more.
MAX_DEVIATIONS = 8.0

Problem = tuple[Place, str]


def numbers(
    entry: ParameterEntry, values: Mapping[str, float], grid: bool, whole: bool
) -> tuple[Distribution | None, list[Problem]]:
    """The distribution, or what is wrong: the key of the entry and a message.

    values: SI values of the entry's numbers, by key. grid, whole: the kind of study and of key that they are for.
    """
    if entry.distribution is None and not values:
        what = "values, or from, to and count" if grid else "values, or a distribution, or from and to"
        return None, [((), f"nothing is said of its values: {what}")]
    kind: Kind = entry.distribution or ("uniform" if not {"mean", "deviation"} & set(values) else "normal")
    needed, optional = KEYS_OF_KIND[kind]
    problems: list[Problem] = [((), f"{kind}: missing key {key!r}") for key in needed if key not in values]
    problems += [
        ((key,), f"not of a {kind} distribution: it has {', '.join((*needed, *optional))}")
        for key in values
        if key not in needed and key not in optional
    ]
    problems += [*_for_the_study(kind, entry.count, grid, whole)]
    if problems:
        return None, problems
    count = entry.count
    if grid and whole and count is None:
        count = max(2, round(values["to"] - values["from"]) + 1)
    result = Distribution(
        kind, values.get("from"), values.get("to"), values.get("mean"), values.get("deviation"), values.get("mode"),
        count,
    )  # fmt: skip
    problems = _contradictions(result)
    if whole and not problems:
        problems = _not_whole(result)
    return (None, problems) if problems else (result, [])


def _for_the_study(kind: Kind, count: int | None, grid: bool, whole: bool) -> list[Problem]:
    if whole and kind != "uniform":
        return [(("distribution",), "of whole numbers only uniform")]
    if not grid:
        return [(("count",), "only in a grid; elsewhere sampling.runs says how many")] if count else []
    if kind not in ("uniform", "loguniform"):
        return [(("distribution",), "in a grid: uniform (even steps) or loguniform (even ratios), or values: [...]")]
    if count is None and not whole:
        return [((), "missing key 'count': how many values a grid takes from from to to")]
    if count == 1:
        return [(("count",), "1 value between two limits; at least 2, or values: [...]")]
    return []


def _contradictions(distribution: Distribution) -> list[Problem]:
    low, high, mean, deviation = distribution.low, distribution.high, distribution.mean, distribution.deviation
    problems: list[Problem] = []
    if low is not None and high is not None and not low < high:
        problems.append((("to",), f"{high:.9g} is not more than from, {low:.9g} (in SI)"))
    elif (
        low is not None
        and low <= 0
        and (distribution.kind == "loguniform" or (distribution.kind == "lognormal" and low < 0))
    ):
        least = "more than" if distribution.kind == "loguniform" else "at least"
        problems.append((("from",), f"{low:.9g}; of a {distribution.kind} distribution {least} 0"))
    elif (
        distribution.mode is not None and low is not None and high is not None and not low <= distribution.mode <= high
    ):
        problems.append((("mode",), f"{distribution.mode:.9g} is not between from and to (in SI)"))
    if mean is None or deviation is None:
        return problems
    if deviation <= 0:
        problems.append((("deviation",), f"{deviation:.9g} is outside the allowed range: more than 0"))
    elif distribution.kind == "lognormal" and mean <= 0:
        problems.append((("mean",), f"{mean:.9g}; that of a lognormal distribution is more than 0"))
    elif low is not None and low > mean + MAX_DEVIATIONS * deviation:
        problems.append((("from",), "more than 8 deviations above the mean: nothing is left of the distribution"))
    elif high is not None and high < mean - MAX_DEVIATIONS * deviation:
        problems.append((("to",), "more than 8 deviations below the mean: nothing is left of the distribution"))
    elif distribution.kind == "lognormal" and high is not None and high <= 0:
        problems.append((("to",), "nothing is left of the distribution: a lognormal one is above 0"))
    return problems


def _not_whole(distribution: Distribution) -> list[Problem]:
    assert distribution.low is not None
    assert distribution.high is not None
    for key, value in (("from", distribution.low), ("to", distribution.high)):
        if not value.is_integer():
            return [((key,), f"{value:.9g} is no whole number")]
    if distribution.count is not None and (distribution.high - distribution.low) % (distribution.count - 1):
        between = f"{distribution.low:.0f} to {distribution.high:.0f}"
        return [(("count",), f"{distribution.count} even steps from {between} are no whole numbers")]
    return []


def probability_outside(distribution: Distribution, low: float, high: float) -> float:
    """Probability that a normal or lognormal distribution, as it is cut, is below `low` or above `high`.

    0 for distributions of other kinds: their limits themselves are checked.
    """
    if distribution.mean is None or distribution.deviation is None:
        return 0.0
    lognormal = distribution.kind == "lognormal"
    deviation = sqrt(log1p((distribution.deviation / distribution.mean) ** 2)) if lognormal else distribution.deviation
    mean = log(distribution.mean) - deviation**2 / 2 if lognormal else distribution.mean

    def distance(value: float) -> float:
        """From the mean, in deviations times the root of two."""
        if lognormal:
            value = log(value) if value > 0 else -inf
        return (value - mean) / (deviation * sqrt(2))

    def below(value: float) -> float:
        return erfc(-distance(value)) / 2

    def above(value: float) -> float:
        return erfc(distance(value)) / 2

    least, most = distribution.support
    all_of_it = 1 - below(least) - above(most)
    out = max(0.0, below(low) - below(least)) + max(0.0, above(high) - above(most))
    return min(1.0, out / all_of_it) if all_of_it > 0 else 0.0


@dataclass(frozen=True)
class Target:
    """A place that a key reaches: what is allowed there."""

    place: Place
    annotation: Any
    quantity: Quantity | None
    whole: bool


class Reader:
    """Reads one entry after the other; `faults`, `warnings` and the data `files` of the choices add up."""

    def __init__(self, source: Source, base: Base, grid: bool) -> None:
        """`source`: the study's tree; `base`: its scenario; `grid`: whether the runs are a grid."""
        self.source, self.base, self.grid = source, base, grid
        self.faults: list[str] = []
        self.warnings: list[Finding] = []
        self.files: list[Path] = []
        self.targets: dict[str, list[Target]] = {}
        self.factors: set[str] = set()  # names of parameters that multiply

    def read(self, name: str, entry: ParameterEntry) -> Parameter | None:
        """The parameter; None where something is wrong with it."""
        before = len(self.faults)
        try:
            parameter = self._read(name, entry)
        except _FaultReported:
            return None
        except InputError as error:
            self.faults += error.problems
            return None
        return parameter if len(self.faults) == before else None

    def _read(self, name: str, entry: ParameterEntry) -> Parameter:
        targets = self.targets[name] = list(self._find_targets(name, entry))
        if entry.factor:
            self.factors.add(name)
            return self._factor(name, entry, targets)
        if entry.choices is not None:
            return self._choices(name, entry, targets)
        for target in targets:
            if target.quantity is None and not target.whole:
                raise self._fault(
                    name, ("key",), f"{dotted_key(target.place)} takes no number; list what it takes: values: [...]"
                )
        whole = targets[0].whole
        unit = self._common_unit(name, targets)
        own = Quantity("1") if whole else Quantity(unit, example=targets[0].quantity.example)  # type: ignore[union-attr]
        distribution = self._distribution(name, entry, own, whole)
        for target in targets:
            self._check_range(name, entry, target, distribution, 1.0)
        return Parameter(name, entry.keys, unit, whole=whole, distribution=distribution)

    def _find_targets(self, name: str, entry: ParameterEntry) -> Iterator[Target]:
        seen = set()
        for i, key in enumerate(entry.keys):
            here = self._at(name, "key", *([i] if len(entry.keys) > 1 else []))
            where = f"{self.source.mark(here).where}: {dotted_key(here)}"
            scratch = self.base.settled.source.copy()
            result = list(checked.places(scratch, Scenario, key, Mark(where, Path())))
            if not result:
                raise InputError(f"{where}: {key} reaches nothing in {self.base.draft.path}")
            for place in result:
                if place not in seen:
                    seen.add(place)
                    parent = checked.expected_annotation(Scenario, scratch.data, place[:-1])
                    annotation = checked.child(parent, place[-1])
                    if place[-1] in _WORDS and checked.keys(parent) is not None:
                        raise InputError(f"{where}: {dotted_key(place)} is only shown; it changes no run")
                    if checked.keys(parent) is None and place[-1] not in value_at(
                        self.base.settled.source.data, place[:-1]
                    ):
                        raise InputError(f"{where}: {dotted_key(place[:-1])} has no {place[-1]!r}")
                    yield Target(place, annotation, quantity_of(annotation), _is_whole(annotation))

    def _common_unit(self, name: str, targets: list[Target]) -> str:
        """SI unit that all targets share."""
        result = ["1" if target.quantity is None else target.quantity.unit for target in targets]
        for target, unit in zip(targets, result, strict=True):
            if units.unit(unit).dimension != units.unit(result[0]).dimension or target.whole != targets[0].whole:
                first, other = dotted_key(targets[0].place), dotted_key(target.place)
                kinds = [
                    "a whole number" if t.whole else units.article(t.quantity.kind) if t.quantity else "no number"
                    for t in (targets[0], target)
                ]
                raise self._fault(name, ("key",), f"{first} is {kinds[0]}, {other} is {kinds[1]}")
        return result[0]

    def _distribution(self, name: str, entry: ParameterEntry, quantity: Quantity, whole: bool) -> Distribution:
        def read(key: str, value: Any) -> float:
            try:
                return quantity.read(value)
            except PydanticCustomError as error:
                raise self._fault(name, (key,), error.message()) from None

        written = {
            "from": entry.low, "to": entry.high, "mean": entry.mean, "deviation": entry.deviation, "mode": entry.mode,
        }  # fmt: skip
        values: dict[str, float] = {}
        for key, value in written.items():
            if value is not None:
                try:
                    values[key] = read(key, value)
                except InputError as error:
                    self.faults += error.problems
        if len(values) < sum(value is not None for value in written.values()):
            raise _FaultReported
        distribution, problems = numbers(entry, values, self.grid, whole)
        self.faults += [describe(self.source, self._at(name, *key), message) for key, message in problems]
        if distribution is None:
            raise _FaultReported
        return distribution

    def _factor(self, name: str, entry: ParameterEntry, targets: list[Target]) -> Parameter:
        origins = []
        for target in targets:
            key = dotted_key(target.place)
            if target.quantity is None:
                raise self._fault(name, ("factor",), f"{key} is no quantity, so that it cannot be multiplied")
            value = _value(self.base.scenario, target.place)
            if value is None:
                raise self._fault(name, ("factor",), f"the scenario has no {key} that could be multiplied")
            origins.append((key, value, target.quantity.unit))
        if entry.choices is None:
            distribution = self._distribution(name, entry, Quantity("1"), False)
            for target, (_, value, _) in zip(targets, origins, strict=True):
                self._check_range(name, entry, target, distribution, value)
            return Parameter(name, entry.keys, "1", True, False, distribution, (), tuple(origins))
        self._no_numbers(name, entry)
        choices = []
        for i, value in enumerate(entry.choices):
            try:
                number = Quantity("1").read(value)
            except PydanticCustomError as error:
                raise self._fault(name, ("values", i), error.message()) from None
            choices.append(Choice(f"{number!r}", number, f"{number!r}", number))
            for target, (_, origin, _) in zip(targets, origins, strict=True):
                self._check_one(name, ("values", i), target, number, origin, f"{value}")
        return Parameter(name, entry.keys, "1", True, False, None, tuple(choices), tuple(origins))

    def _choices(self, name: str, entry: ParameterEntry, targets: list[Target]) -> Parameter:
        self._no_numbers(name, entry)
        assert entry.choices is not None
        read = [self._choice(name, i, entry, targets) for i in range(len(entry.choices))]
        choices = [choice for choice in read if choice is not None]
        labels = [choice.label for choice in choices]
        for i, label in enumerate(labels):
            if label in labels[:i]:
                self.faults.append(describe(self.source, self._at(name, "values", i), f"{label} stands there twice"))
        numeric = all(choice.number is not None for choice in choices)
        unit = self._common_unit(name, targets) if numeric else ""
        return Parameter(name, entry.keys, unit, choices=tuple(choices), whole=numeric and targets[0].whole)

    def _choice(self, name: str, i: int, entry: ParameterEntry, targets: list[Target]) -> Choice | None:
        """A value, tried by itself in the scenario."""
        here = self._at(name, "values", i)
        marks = {place[len(here) :]: mark for place, mark in self.source.marks.items() if place[: len(here)] == here}
        value = Source(entry.choices[i] if entry.choices else None, marks)
        meant = self._read_value(entry.keys, value, targets)
        if meant is _WRONG:
            return None
        text = as_text(value, meant)
        number = None
        if all(target.quantity for target in targets) and not isinstance(value.data, (dict, list, type(None))):
            number = targets[0].quantity.read(value.data)  # type: ignore[union-attr]
        elif all(target.whole for target in targets):
            number = float(value.data)
        if number is not None and targets[0].quantity is not None:
            text = number_text(number, targets[0].quantity.unit)
            meant = number if targets[0].quantity.unit == "1" else text
        label = value.data if isinstance(value.data, str) else text
        return Choice(" ".join(label.split()), number, text, meant)

    def _read_value(self, keys: tuple[str, ...], value: Source, targets: list[Target]) -> Any:
        """The plain value with the files that it names in it; faults are reported with the lines of the study."""
        draft = self.base.draft.copy() if keys == ("machine",) else self.base.settled.copy()
        draft.apply((key, value) for key in keys)
        if keys == ("machine",):
            draft.settle()
        problems = draft.faults
        if not problems and not all(
            _accepts_value(target, value_at(draft.source.data, target.place), draft.source) for target in targets
        ):
            try:
                draft.scenario()
            except InputError as error:
                problems = [*error.problems]
        if problems:
            self.faults += problems
            return _WRONG
        self.files += [file for target in targets for file in data_files(draft.source, target.place)]
        return value_at(draft.source.data, targets[0].place)

    def _check_range(
        self, name: str, entry: ParameterEntry, target: Target, distribution: Distribution, times: float
    ) -> None:
        for key, bound, written in (("from", distribution.low, entry.low), ("to", distribution.high, entry.high)):
            if bound is not None and target.quantity is not None:
                self._check_one(name, (key,), target, bound, times, f"{written}")
            elif bound is not None and not _accepts_value(target, int(bound), self.base.settled.source):
                self._explain_fault(name, (key,), [Change(dotted_key(target.place), f"{bound:.0f}", int(bound))])
        if target.quantity is not None and times != 0.0:
            self._doubt_range(name, target, target.quantity, distribution, times)

    def _doubt_range(
        self, name: str, target: Target, quantity: Quantity, distribution: Distribution, times: float
    ) -> None:
        """Warn of a distribution that is not cut and leads out of the allowed range."""
        low, high = sorted((max(quantity.minimum, quantity.above) / times, quantity.maximum / times))
        share = probability_outside(distribution, low, high)
        if share >= NEGLIGIBLE_PROBABILITY:
            remedy = "Cut it with from and to"
            text = describe(
                self.source,
                self._at(name),
                f"{100 * share:.2g} % of the distribution are outside the allowed range of {dotted_key(target.place)}, "
                f"{quantity.range}; such runs fail. {remedy}",
            )
            self.warnings.append(Finding("distribution-out-of-range", "doubt", text, name, remedy))

    def _check_one(self, name: str, key: Place, target: Target, value: float, times: float, written: str) -> None:
        quantity = target.quantity
        assert quantity is not None
        number = value * times
        if not quantity.minimum <= number <= quantity.maximum or number <= quantity.above:
            shown = written if times == 1.0 else f"{written} times {units.show(times, quantity.unit)}"
            message = f"{shown} is outside the allowed range of {dotted_key(target.place)}: {quantity.range}"
            self.faults.append(describe(self.source, self._at(name, *key), message))

    def _explain_fault(self, name: str, key: Place, made: list[Change]) -> None:
        """Say why the scenario does not take a value."""
        try:
            self.base.with_changes(made)
        except InputError as error:
            reported = [problem.partition(": ")[2] for problem in error.problems]
            self.faults += [describe(self.source, self._at(name, *key), problem) for problem in reported]

    def _no_numbers(self, name: str, entry: ParameterEntry) -> None:
        given = {
            "distribution": entry.distribution, "from": entry.low, "to": entry.high, "count": entry.count,
            "mean": entry.mean, "deviation": entry.deviation, "mode": entry.mode,
        }  # fmt: skip
        for key, value in given.items():
            if value is not None:
                self.faults.append(describe(self.source, self._at(name, key), "not beside values"))

    def _at(self, name: str, *key: str | int) -> Place:
        return ("parameters", name, *key)

    def _fault(self, name: str, key: Place, message: str) -> InputError:
        return InputError(describe(self.source, self._at(name, *key), message))


_WRONG = object()
_WORDS = ("name", "note")  # keys that are there to be read
NEGLIGIBLE_PROBABILITY = 1e-6  # share of a distribution that no study meets


class _FaultReported(Exception):
    """What is wrong is among the faults already."""


def _accepts_value(target: Target, data: Any, source: Source) -> bool:
    """Whether a value can stand at a place, whatever stands beside it."""
    try:
        TypeAdapter(target.annotation).validate_python(data, context=reading_context(Scenario, source.data))
    except ValidationError:
        return False
    return True


def _is_whole(annotation: Any) -> bool:
    if get_origin(annotation) is Annotated:
        return _is_whole(get_args(annotation)[0])
    options = [part for part in get_args(annotation) if part is not NoneType]
    return annotation is int or (len(options) == 1 and _is_whole(options[0]))


def _value(model: Any, place: Place) -> float | None:
    """What a checked scenario has at a place of its file."""
    for key in place:
        if isinstance(model, BaseModel):
            names = type(model).model_fields
            model = getattr(model, next(name for name, info in names.items() if (info.alias or name) == key))
        elif isinstance(model, dict):
            model = model.get(key)
        else:
            model = model[key]
        if model is None:
            return None
    return float(model)
