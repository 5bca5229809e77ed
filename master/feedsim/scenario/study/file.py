"""What stands in a study file, as it is written: values are read when the scenario is known, which has their units."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator, StrictBool, StrictInt, StrictStr, WithJsonSchema, field_validator

from feedsim.files.fields import File, Model, brief, fault
from feedsim.foundation import units

Method = Literal["grid", "latin_hypercube", "sobol", "sensitivity"]
Kind = Literal["uniform", "loguniform", "triangular", "normal", "lognormal"]

# What a study can look for in a figure.
WAYS = ("smallest", "largest")
MAX_PARAMETER_NAME = 60  # characters of a parameter's name, which heads a column
MOST_RUNS = 1_000_000
# Columns of the table that every study has.
RESERVED_COLUMNS = ("run", "status", "message", "warnings", "seconds")


def _check_plain_value(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise fault(f"{brief(value)} is no number and no quantity")
    return value


def _keys(value: Any) -> tuple[str, ...]:
    keys = value if isinstance(value, list) else [value]
    if not keys or not all(isinstance(key, str) and key for key in keys):
        raise fault(f"{brief(value)}; a dotted key is expected, such as motions.0.feed, or a list of them")
    if len(set(keys)) < len(keys):
        raise fault("a key stands twice in the list")
    return tuple(keys)


# A quantity as it is written: a text or a number.
_TEXT = {"type": "string", "pattern": rf"^\s*{units.NUMBER}", "examples": ["2.5 N.m", "5000 mm/min"]}
PlainValue = Annotated[Any, PlainValidator(_check_plain_value), WithJsonSchema({"anyOf": [{"type": "number"}, _TEXT]})]
# One dotted key or a list of them; becomes a tuple.
_KEY = {"type": "string", "minLength": 1, "examples": ["machine.axes.*.friction.F_C"]}
_LIST = {"type": "array", "items": _KEY, "minItems": 1, "uniqueItems": True}
Keys = Annotated[Any, PlainValidator(_keys), WithJsonSchema({"anyOf": [_KEY, _LIST]})]
Key = Annotated[StrictStr, Field(min_length=1)]


class Sampling(Model):
    """How the runs are spread over the parameters."""

    method: Method = Field(
        description="grid: every combination; latin_hypercube, sobol: spread evenly; sensitivity: for Sobol indices"
    )
    runs: Annotated[StrictInt, Field(ge=1, le=MOST_RUNS)] | None = Field(
        default=None,
        description="Number of runs; for sensitivity N, which makes N (d + 2) runs of d parameters; not for a grid",
    )
    seed: Annotated[StrictInt, Field(ge=0, lt=2**63)] | None = Field(
        default=None, description="Seed of the random numbers (default: 1); not for a grid"
    )


class ParameterEntry(Model):
    """One parameter: the key that it sets, and a distribution, a range or a list of values."""

    keys: Keys = Field(
        alias="key",
        description="Dotted key as for --set, of the scenario or its machine (machine. ...); * for all; or a list",
    )
    factor: StrictBool = Field(default=False, description="Whether what the scenario has is multiplied by the value")
    distribution: Kind | None = Field(
        default=None, description="How the values are distributed (default: uniform where there are from and to)"
    )
    low: PlainValue | None = Field(default=None, alias="from", description="Least value")
    high: PlainValue | None = Field(default=None, alias="to", description="Greatest value")
    count: Annotated[StrictInt, Field(ge=1, le=MOST_RUNS)] | None = Field(
        default=None, description="In a grid: number of values from from to to"
    )
    mean: PlainValue | None = Field(default=None, description="Mean of a normal or lognormal distribution")
    deviation: PlainValue | None = Field(default=None, description="Standard deviation of a normal or lognormal one")
    mode: PlainValue | None = Field(
        default=None, description="Most frequent value of a triangular one (default: the middle)"
    )
    choices: Annotated[tuple[Any, ...], Field(min_length=1)] | None = Field(
        default=None, alias="values", description="Values to choose from, of whatever kind the key takes"
    )


class StudyFile(Model):
    """A study file."""

    name: StrictStr = Field(description="Name in reports")
    note: StrictStr = Field(default="", description="Remark")
    scenario: File = Field(description="Scenario file that all runs start from")
    settings: dict[Key, Any] = Field(
        default={}, alias="set", description="Changes of single values by dotted key in every run, as with --set"
    )
    sampling: Sampling
    parameters: Annotated[dict[StrictStr, ParameterEntry], Field(min_length=1)] = Field(
        description="Name of a column of the table -> what is varied"
    )
    figures: Annotated[tuple[Key, ...], Field(min_length=1)] | None = Field(
        default=None, description='Names or patterns such as "XZ.glitch_*" (default: all figures)'
    )

    goal: StrictStr | None = Field(
        default=None,
        description='What is looked for: "smallest FIGURE" or "largest FIGURE"; the report names the run that has it',
        examples=["smallest XZ.G"],
    )
    explain: Key | None = Field(
        default=None, description="Figure whose scatter is to be explained; the report begins with it"
    )

    @field_validator("goal", mode="after")
    @classmethod
    def _goal(cls, goal: str | None) -> str | None:
        if goal is not None and not re.fullmatch(f"({'|'.join(WAYS)}) [^ ]+", goal):
            raise fault(f"{brief(goal)}; 'smallest FIGURE' or 'largest FIGURE' is expected, such as smallest XZ.G")
        return goal

    @field_validator("parameters", mode="after")
    @classmethod
    def _names(cls, parameters: dict[str, ParameterEntry]) -> dict[str, ParameterEntry]:
        for name in parameters:
            if name in RESERVED_COLUMNS:
                raise fault(f"{name!r} is a column of every table; call the parameter otherwise")
            if not name or len(name) > MAX_PARAMETER_NAME or not name.isprintable() or set(name) & set(" ,;[]\"'="):
                raise fault(
                    f"{brief(name)} cannot be the name of a column: 1 to {MAX_PARAMETER_NAME} characters, "
                    "no blank, comma, semicolon, quote, = or bracket"
                )
        return parameters
