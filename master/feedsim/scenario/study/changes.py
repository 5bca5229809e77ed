"""What a run sets in the scenario when every parameter has a value, as it stands behind KEY= on the command line."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from feedsim.errors import InputError
from feedsim.files.source import Source, parse
from feedsim.scenario.base import Change
from feedsim.scenario.study.study import Parameter


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
        return _quoted(meant if isinstance(meant, str) else str(written.mark(()).folder / data))
    return _quoted(meant)


def number_text(value: float, unit: str) -> str:
    """An SI value so that it reads back as the same number, bit for bit."""
    return repr(float(value)) if unit == "1" else f"{float(value)!r} {unit}"


def _quoted(value: Any) -> str:
    if isinstance(value, str):
        try:
            same = parse(value, "", Path(), lines=False).data == value
        except InputError:
            same = False
        if same:
            return value
    return json.dumps(value, ensure_ascii=False)
