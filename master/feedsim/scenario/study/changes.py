"""What a run sets in the scenario when every parameter has a value."""

from __future__ import annotations

from collections.abc import Sequence

from feedsim.scenario.base import Change
from feedsim.scenario.study.study import Parameter
from feedsim.scenario.study.values import number_text


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
