"""A machine whose axes have a group of their drives with other values: a compensation, cogging."""

from __future__ import annotations

from collections.abc import Mapping

from feedsim.scenario import Machine
from feedsim.uncertainty import torque_scale


def compensated(machine: Machine, axis: str, group: str, values: Mapping[str, float | bool | int]) -> Machine:
    """A machine whose axis has a group of its drive with other values."""
    own = machine.axes[axis]
    kind = type(own.drive).model_fields[group].annotation
    (model,) = [entry for entry in kind.__args__ if entry is not type(None)]  # type: ignore[union-attr]
    names = model.model_fields
    filled = {name: values.get(name, info.default) for name, info in names.items()}
    drive = own.drive.model_copy(update={group: model.model_construct(**filled)})
    return machine.model_copy(update={"axes": {**machine.axes, axis: own.model_copy(update={"drive": drive})}})


def with_groups(
    machine: Machine, of: Machine, group: str, values: Mapping[str, Mapping[str, float | bool | int]]
) -> Machine:
    """A draw of the machine `of`, or that machine, whose axes have a group of their drives with other values.

    The values are those of the control; all torques of a draw are multiplied with one factor, and so are theirs.
    """
    for axis, entry in values.items():
        scale = torque_scale(of, machine, axis)
        own = {name: scale * value if name.startswith("torque_") else value for name, value in entry.items()}
        machine = compensated(machine, axis, group, own)
    return machine
