"""What a real axis has besides, or becomes: changes of a machine under which a tuned setting is judged, too.

A tuned value is good for the machine file that it was tuned on. Here is what the same value leaves when friction is
another one, when part of it acts at the guide, when the motor cogs, when there is play. All sizes are usual ones, no
measured ones; an axis that has an effect in its machine file keeps its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from feedsim.scenario import Drive, Friction, FrictionParameters, Machine
from feedsim.scenario.axis_units import SHARED_WITH_GUIDE, Guide, Transmission
from feedsim.structure import checked_modes
from feedsim.uncertainty import torque_scale

# --- A machine whose axes have a group of their drives with other values: a compensation, cogging ---------------------


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


STRENGTH = 0.2  # of the friction, either way
NO_FRICTION = 1e-6  # of all torques of a friction law: it has to have some
GUIDE = 0.5  # share of the friction at the guide
COGGING = 0.1  # of the Coulomb friction
ORDER = 10.0  # of the cogging per turn, where the number of pole pairs is not known
PLAY = 2e-6  # [m]
# Contact that the play of an axis measured directly lies in: the motor against a slide that stands still.
CONTACT, CONTACT_DAMPING = 300.0, 0.1  # [Hz], [1]
MOTOR_SHARE_OF_INERTIA = 0.5  # share of the motor in the inertia that answers a torque at once
# Wear takes preload away and widens the engaging zone; warm grease is half as viscous.
WORN = {"F_C": 0.7, "F_S": 0.7, "F_log": 0.7, "sigma_0": 0.7, "W": 2.0}
WARM = {"F_log": 0.5, "sigma_2": 0.5}


@dataclass(frozen=True)
class Effect:
    """A change of axes. name: of figures; words: behind "with"; of: the machine with it on an axis, or None
    where that cannot have it."""

    name: str
    words: str
    of: Callable[[Machine, str], Machine | None]

    def on(self, machine: Machine, axes: Sequence[str]) -> Machine | None:
        """The machine with the effect on those of the axes that can have it; None where none can."""
        changed = machine
        for axis in axes:
            changed = self.of(changed, axis) or changed
        return None if changed is machine else changed


def effects_of(machine: Machine, axes: Sequence[str]) -> Iterator[tuple[Effect, Machine]]:
    """Every effect that one of the axes can have, and the machine with it."""
    for effect in EFFECTS:
        changed = effect.on(machine, axes)
        if changed is not None:
            yield effect, changed


def _with(machine: Machine, axis: str, **changes: object) -> Machine:
    return machine.model_copy(update={"axes": {**machine.axes, axis: machine.axes[axis].model_copy(update=changes)}})


def _friction(factors: Mapping[str, float]) -> Callable[[Machine, str], Machine | None]:
    def of(machine: Machine, axis: str) -> Machine | None:
        friction = machine.axes[axis].friction
        if not isinstance(friction, FrictionParameters):
            return None
        own = type(friction).model_fields
        values = {name: factor * float(getattr(friction, name)) for name, factor in factors.items() if name in own}
        return _with(machine, axis, friction=friction.model_copy(update=values))

    return of


def frictionless(machine: Machine, axes: Sequence[str]) -> Machine:
    """The machine with friction of no effect on some axes, motor and guide."""
    for axis in axes:
        machine = _friction(dict.fromkeys(SHARED_WITH_GUIDE, NO_FRICTION))(machine, axis) or machine
        machine = _with(machine, axis, guide=None)
    return machine


def _guide(machine: Machine, axis: str) -> Machine | None:
    own = machine.axes[axis]
    if own.guide is not None or not isinstance(own.friction, Friction):
        return None
    return _with(machine, axis, guide=Guide.model_validate({"share": GUIDE}))


def _cogging(machine: Machine, axis: str) -> Machine | None:
    drive, friction = machine.axes[axis].drive, machine.axes[axis].friction
    if (
        not isinstance(drive, Drive)
        or not isinstance(friction, FrictionParameters)
        or getattr(drive, "cogging_1", None)
    ):
        return None
    order = 2.0 * drive.p if drive.p else ORDER
    return compensated(machine, axis, "cogging_1", {"order": order, "amplitude": COGGING * friction.F_C})


def _play(machine: Machine, axis: str) -> Machine | None:
    """Play of an axis measured at the motor shows in its position; measured directly it lies in a contact that the
    motor works against."""
    own = machine.axes[axis]
    if own.play or own.transmission is not None or not isinstance(own.drive, Drive):
        return None
    if own.drive.indirect:
        return _with(machine, axis, play=PLAY)
    if machine.plant is not None:
        return None
    inertia = MOTOR_SHARE_OF_INERTIA * checked_modes(machine).J_inf(axis)
    omega = 2 * math.pi * CONTACT
    stiffness = inertia / own.I_P**2 * omega**2
    values = {"stiffness": stiffness, "damping": 2 * CONTACT_DAMPING * stiffness / omega, "inertia": inertia}
    return _with(machine, axis, transmission=Transmission.model_validate({**values, "play": PLAY}))


_LEVEL = ("F_C", "F_S", "F_log")
EFFECTS = (
    Effect("friction+", f"the friction {100 * STRENGTH:.0f} % higher", _friction(dict.fromkeys(_LEVEL, 1 + STRENGTH))),
    Effect("friction-", f"the friction {100 * STRENGTH:.0f} % lower", _friction(dict.fromkeys(_LEVEL, 1 - STRENGTH))),
    Effect("worn", "worn axes: friction and sigma_0 30 % lower, W doubled", _friction(WORN)),
    Effect("warm", "warm grease: F_log and sigma_2 halved", _friction(WARM)),
    Effect("guide", f"{100 * GUIDE:.0f} % of the friction at the guide", _guide),
    Effect("cogging", f"cogging of {100 * COGGING:.0f} % of F_C, twice per pole pair", _cogging),
    Effect("play", f"play of {1e6 * PLAY:.0f} um", _play),
)
