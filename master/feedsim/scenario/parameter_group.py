"""Parameters of a unit in groups, as machine files have them; groups that follow from the unit's table alone.

May use: fields, variables. Start reading at effects().
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import Field, StrictBool, StrictInt, create_model

from feedsim import variables
from feedsim.fields import Model, parameter

Parameter = float | int | bool | str
_KINDS: dict[str, Any] = {"REAL": float, "INTEGER": StrictInt, "BOOLEAN": StrictBool}


class ParameterGroup(Model):
    """A group of parameters of an FMI unit, in the unit's names."""

    def parameters(self) -> dict[str, Parameter]:
        """FMU parameter name -> SI value. What is not given (and not needed) is left to the unit's start value."""
        values: dict[str, Parameter] = {}
        for name in type(self).model_fields:
            value = getattr(self, name)
            if isinstance(value, ParameterGroup):
                values |= {f"{name}.{key}": part for key, part in value.parameters().items()}
            elif value is not None:
                values[name] = value
        return values


def effects(unit: str, groups: Mapping[str, str]) -> type[ParameterGroup]:
    """A model whose fields are groups of parameters of `unit`, name -> description: each with all that the unit's table
    declares of it, at its start value where a file does not give it. A group that is not given is None."""
    fields: dict[str, Any] = {
        name: (group(unit, name, text) | None, Field(default=None, description=text)) for name, text in groups.items()
    }
    globals()["Effects"] = create_model("Effects", __base__=ParameterGroup, __module__=__name__, **fields)
    model: type[ParameterGroup] = globals()["Effects"]
    return model


def group(unit: str, name: str, text: str) -> Any:
    """A model of one group of parameters of `unit`, as :func:`effects` has them."""
    rows = {
        key.removeprefix(f"{name}."): row
        for key, row in variables.parameters(unit).items()
        if key.startswith(f"{name}.")
    }
    fields: dict[str, Any] = {
        key: (_KINDS[row.kind], parameter(row, bool(row.start) if row.kind == "BOOLEAN" else row.start))
        for key, row in rows.items()
    }
    title = name.title().replace("_", "")
    # A scenario is sent to other processes, where a class is looked up by its name.
    globals()[title] = create_model(title, __base__=ParameterGroup, __module__=__name__, __doc__=f"{text}.", **fields)
    return globals()[title]
