"""What of a drive is tuned: parameters that are free, and those that follow from them.

Free: K_p, T_n, K_v, omega_0, fit = K_p/(J omega_0/(2 D)), which is 1 where the reference model is what the speed loop
does with its P part alone; T_sym against the lag of the speed loop; frequency and dampings of the current setpoint
filters. A drive without a part lacks its parameters; switches stay as they are. Of a drive without filters one band
stop is free, which may turn out to be off.

Of a machine without elastic modes K_p stays at most as it is, and so do the filters. Above its crossover a speed loop
has the gain K_p times filters times structure. A real structure resonates there, and the present drive is known to bear
that: its loop gain is below 1 at every resonance. With K_p no larger, a resonance that nobody has measured keeps its
margin. T_n may fall as far as the gain of the speed controller at the crossover K_p/J rises by UNMEASURED.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from feedsim.analysis.figures import Array
from feedsim.analysis.proposals import MIN_RESET_TIME, NEUTRAL, NEUTRAL_SHARE, axis_lag, loop_lag, model_gain
from feedsim.design.uncertainty import torque_scale
from feedsim.foundation.units import convert, parameters
from feedsim.scenario import Cycles, Drive, Filter, Friction, FrictionParameters, Machine
from feedsim.scenario.axis_units import SHARED_WITH_GUIDE, Guide, Transmission
from feedsim.structure import checked_modes

DIGITS = 4  # of values that a person types
FILTERS = ("filter_1", "filter_2", "filter_3", "filter_4")
# Ranges as multiples of the present value.
RANGES = {"K_p": (0.25, 6.0), "T_n": (0.1, 2.5), "K_v": (0.33, 3.0), "omega_0": (0.4, 5.0)}
FIT = (0.5, 1.6)
SYMMETRY = 0.25  # of the larger of neutral and present T_sym, either side
NOTCH = {"f": (0.6, 1.7), "D_num": (0.3, 4.0), "D_den": (0.3, 2.0)}
LEAST_DAMPING, MOST_DAMPING = 0.02, 1.5
NEW_NOTCH = (0.05, 0.8)  # its frequency, in shares of half the sampling rate
UNMEASURED_GAIN_RISE = 1.0  # [dB] by which the gain at resonances may rise that nobody has measured
SHALLOW_DAMPING_RATIO = 0.9  # D_num/D_den above which a new band stop is left off


@dataclass(frozen=True)
class Knob:
    """A free parameter with its range; on a logarithmic scale or on a straight one."""

    name: str
    low: float
    high: float
    log: bool = True

    def value(self, x: float) -> float:
        """Of a place x from 0 to 1."""
        if self.log:
            return float(self.low * (self.high / self.low) ** x)
        return self.low + (self.high - self.low) * x

    def place(self, value: float) -> float:
        """Of a value, 0 to 1."""
        share = (
            math.log(value / self.low) / math.log(self.high / self.low)
            if self.log
            else (value - self.low) / (self.high - self.low)
        )
        return min(max(share, 0.0), 1.0)


@dataclass(frozen=True, eq=False)
class Knobs:
    """The free parameters of a drive. J: inertia that a slow torque accelerates [kg.m2]. elastic: modes are known."""

    drive: Drive
    cycles: Cycles
    J: float
    elastic: bool = True

    @cached_property
    def all(self) -> tuple[Knob, ...]:
        """In the order of places."""
        d = self.drive
        names = ["K_p", *(["T_n"] if d.speed_integrator else []), "K_v"]
        fit = self._fit(d)
        knobs = [self._knob_with_range(name) for name in names if getattr(d, name)]
        if fit is not None:
            knobs += [self._knob_with_range("omega_0"), Knob("fit", min(FIT[0], 0.9 * fit), max(FIT[1], 1.1 * fit))]
        if d.k_ffw > 0 and math.isfinite(self._neutral(d)):
            off, width = self._lag_difference(d), SYMMETRY * max(self._neutral(d), d.T_sym)
            if width > 0:
                knobs.append(Knob("off", min(-width, 1.1 * off), max(width, 1.1 * off), log=False))
        if not self.elastic:
            return tuple(knobs)
        highest = 0.5 / self.cycles.T_c
        for name in self._filters:
            entry = getattr(d, name)
            for part, (low, high) in NOTCH.items():
                value = getattr(entry, part)
                if value is None or (part == "D_num" and entry.type == "low_pass") or value <= 0:
                    continue
                top = 0.95 * highest if part == "f" else MOST_DAMPING
                bottom = 0.0 if part == "f" else LEAST_DAMPING
                knobs.append(
                    Knob(f"{name}.{part}", min(max(low * value, bottom), value), max(min(high * value, top), value))
                )
        if not self._filters:
            knobs += [
                Knob("new.f", NEW_NOTCH[0] * highest, NEW_NOTCH[1] * highest),
                Knob("new.depth", 0.05, 1.0),
                Knob("new.D_den", 0.2, 1.0),
            ]
        return tuple(knobs)

    @property
    def present(self) -> Array:
        """Places (n,) of the drive as it is."""
        values = self._values(self.drive)
        return np.array([knob.place(values[knob.name]) for knob in self.all])

    def drive_at(self, x: Array) -> Drive:
        """The drive at places (n,), its values rounded as a person types them."""
        d = self.drive
        at = {knob.name: knob.value(float(place)) for knob, place in zip(self.all, x, strict=True)}
        new: dict[str, object] = {
            name: round_value(name, at[name]) for name in ("K_p", "T_n", "K_v", "omega_0") if name in at
        }
        if "fit" in at:
            K_p, omega_0 = (float(new.get(name, getattr(d, name))) for name in ("K_p", "omega_0"))  # type: ignore[arg-type]
            new["D"] = round_value("D", self.J * omega_0 / (2 * K_p) * at["fit"])
        for name in self._filters if self.elastic else ():
            own = {
                part: round_value(f"filter_1.{part}", at[f"{name}.{part}"]) for part in NOTCH if f"{name}.{part}" in at
            }
            new[name] = getattr(d, name).model_copy(update=own)
        if "new.f" in at and at["new.depth"] < SHALLOW_DAMPING_RATIO:
            shape = {"f": at["new.f"], "D_num": at["new.depth"] * at["new.D_den"], "D_den": at["new.D_den"]}
            rounded = {part: round_value(f"filter_1.{part}", value) for part, value in shape.items()}
            new["filter_1"] = Filter(type="band_stop", f=rounded["f"], D_num=rounded["D_num"], D_den=rounded["D_den"])
        changed = d.model_copy(update=new)
        if "off" in at:
            T_sym = max(0.0, self._neutral(changed) + at["off"])
            changed = changed.model_copy(update={"T_sym": round_value("T_sym", T_sym)})
        return changed

    @property
    def _filters(self) -> tuple[str, ...]:
        return tuple(name for name in FILTERS if getattr(self.drive, name).type != "off")

    def _knob_with_range(self, name: str) -> Knob:
        low, high = RANGES[name]
        value = float(getattr(self.drive, name))
        least = min(MIN_RESET_TIME, value) if name == "T_n" else 0.0
        if not self.elastic:
            high = 1.0 if name == "K_p" else high
            least = max(least, self._least_T_n()) if name == "T_n" else least
        return Knob(name, max(low * value, least), high * value)

    def _least_T_n(self) -> float:
        """T_n [s] at which |1 + 1/(j omega T_n)| at omega = K_p/J is UNMEASURED above the present one."""
        d = self.drive
        assert d.T_n is not None
        omega = d.K_p / self.J
        square = 1 + 1 / (omega * d.T_n) ** 2
        return 1 / (omega * math.sqrt(10 ** (UNMEASURED_GAIN_RISE / 10) * square - 1))

    def _values(self, d: Drive) -> dict[str, float]:
        values = {name: float(getattr(d, name)) for name in RANGES if getattr(d, name)}
        fit = self._fit(d)
        if fit is not None:
            values["fit"] = fit
        values["off"] = self._lag_difference(d)
        for name in self._filters:
            values |= {f"{name}.{part}": float(getattr(getattr(d, name), part) or 0.0) for part in NOTCH}
        if not self._filters:
            values |= {"new.f": 0.5 / self.cycles.T_c * math.sqrt(NEW_NOTCH[0] * NEW_NOTCH[1]), "new.depth": 1.0}
            values["new.D_den"] = 0.5
        return values

    def _fit(self, d: Drive) -> float | None:
        gain = model_gain(d, self.J)
        return None if gain is None or d.K_p <= 0 else d.K_p / gain

    def _neutral(self, d: Drive) -> float:
        return loop_lag(d, self.cycles, self.J)

    def _lag_difference(self, d: Drive) -> float:
        return d.T_sym - self._neutral(d)


def round_value(name: str, value: float) -> float:
    """A value [SI] of a drive's parameter, rounded to DIGITS in the unit in which it is shown."""
    row = parameters("controller")[name]
    shown = float(f"{convert(value, row.unit, row.display_unit):.{DIGITS}g}")
    return float(f"{convert(shown, row.display_unit, row.unit):.12g}")


def match_lag(machine: Machine, axis: str, before: Machine) -> Machine:
    """The machine with T_dyn such that `axis` is as late as the slowest other axis.

    before: the machine as it was. Where the axis has become the slowest itself, those axes wait for it that were as
    late as it was. Foreign drives and axes without position control are left out.
    """
    lags = {name: axis_lag(machine.shipped_drive(name, "matching")) for name in machine.axes}
    others = {name: lag for name, lag in lags.items() if name != axis and math.isfinite(lag)}
    if not others or not math.isfinite(lags[axis]):
        return machine
    own = machine.shipped_drive(axis, "matching")
    bare = lags[axis] - own.T_dyn
    was = axis_lag(before.shipped_drive(axis, "matching"))
    target = max(bare, *others.values())
    changes = {axis: target - bare}
    for name, lag in others.items():
        if abs(lag - was) <= max(NEUTRAL, NEUTRAL_SHARE * was) and target - lag > NEUTRAL:
            changes[name] = machine.shipped_drive(name, "matching").T_dyn + target - lag
    return with_drives(machine, {name: {"T_dyn": round_value("T_dyn", T_dyn)} for name, T_dyn in changes.items()})


def with_drives(machine: Machine, values: Mapping[str, Mapping[str, object]]) -> Machine:
    """A machine with other values of its drives: axis -> parameter -> SI."""
    axes = {
        name: machine.axes[name].model_copy(
            update={"drive": machine.shipped_drive(name, "tuning").model_copy(update=dict(own))}
        )
        for name, own in values.items()
    }
    return machine.model_copy(update={"axes": {**machine.axes, **axes}})


# --- What a real axis has besides, or becomes: changes of a machine under which a tuned setting is judged, too --------
# A tuned value is good for the machine file that it was tuned on. Here is what the same value leaves when friction is
# another one, when part of it acts at the guide, when the motor cogs, when there is play. All sizes are usual ones, no
# measured ones; an axis that has an effect in its machine file keeps its own.


# --- A machine whose axes have a group of their drives with other values: a compensation, cogging ---------------------


def set_compensation(machine: Machine, axis: str, group: str, values: Mapping[str, float | bool | int]) -> Machine:
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
        machine = set_compensation(machine, axis, group, own)
    return machine


STRENGTH = 0.2  # of the friction, either way
NO_FRICTION = 1e-6  # of all torques of a friction law: it has to have some
GUIDE = 0.5  # share of the friction at the guide
COGGING_TORQUE_SHARE = 0.1  # of the Coulomb friction
ORDER = 10.0  # of the cogging per turn, where the number of pole pairs is not known
PLAY_WIDTH = 2e-6  # [m]
# Contact that the play of an axis measured directly lies in: the motor against a slide that stands still.
CONTACT, CONTACT_DAMPING = 300.0, 0.1  # [Hz], [1]
MOTOR_SHARE_OF_INERTIA = 0.5  # share of the motor in the inertia that answers a torque at once
# Wear takes preload away and widens the engaging zone; warm grease is half as viscous.
WEAR_FACTORS = {"F_C": 0.7, "F_S": 0.7, "F_log": 0.7, "sigma_0": 0.7, "W": 2.0}
WARMTH_FACTORS = {"F_log": 0.5, "sigma_2": 0.5}


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


def _change_axis(machine: Machine, axis: str, **changes: object) -> Machine:
    return machine.model_copy(update={"axes": {**machine.axes, axis: machine.axes[axis].model_copy(update=changes)}})


def _friction(factors: Mapping[str, float]) -> Callable[[Machine, str], Machine | None]:
    def of(machine: Machine, axis: str) -> Machine | None:
        friction = machine.axes[axis].friction
        if not isinstance(friction, FrictionParameters):
            return None
        own = type(friction).model_fields
        values = {name: factor * float(getattr(friction, name)) for name, factor in factors.items() if name in own}
        return _change_axis(machine, axis, friction=friction.model_copy(update=values))

    return of


def frictionless(machine: Machine, axes: Sequence[str]) -> Machine:
    """The machine with friction of no effect on some axes, motor and guide."""
    for axis in axes:
        machine = _friction(dict.fromkeys(SHARED_WITH_GUIDE, NO_FRICTION))(machine, axis) or machine
        machine = _change_axis(machine, axis, guide=None)
    return machine


def _guide(machine: Machine, axis: str) -> Machine | None:
    own = machine.axes[axis]
    if own.guide is not None or not isinstance(own.friction, Friction):
        return None
    return _change_axis(machine, axis, guide=Guide.model_validate({"share": GUIDE}))


def _add_cogging(machine: Machine, axis: str) -> Machine | None:
    drive, friction = machine.axes[axis].drive, machine.axes[axis].friction
    if (
        not isinstance(drive, Drive)
        or not isinstance(friction, FrictionParameters)
        or getattr(drive, "cogging_1", None)
    ):
        return None
    order = 2.0 * drive.p if drive.p else ORDER
    return set_compensation(
        machine, axis, "cogging_1", {"order": order, "amplitude": COGGING_TORQUE_SHARE * friction.F_C}
    )


def _add_play(machine: Machine, axis: str) -> Machine | None:
    """Play of an axis measured at the motor shows in its position; measured directly it lies in a contact that the
    motor works against."""
    own = machine.axes[axis]
    if own.play or own.transmission is not None or not isinstance(own.drive, Drive):
        return None
    if own.drive.indirect:
        return _change_axis(machine, axis, play=PLAY_WIDTH)
    if machine.plant is not None:
        return None
    inertia = MOTOR_SHARE_OF_INERTIA * checked_modes(machine).J_inf(axis)
    omega = 2 * math.pi * CONTACT
    stiffness = inertia / own.I_P**2 * omega**2
    values = {"stiffness": stiffness, "damping": 2 * CONTACT_DAMPING * stiffness / omega, "inertia": inertia}
    return _change_axis(machine, axis, transmission=Transmission.model_validate({**values, "play": PLAY_WIDTH}))


_LEVEL = ("F_C", "F_S", "F_log")
EFFECTS = (
    Effect("friction+", f"the friction {100 * STRENGTH:.0f} % higher", _friction(dict.fromkeys(_LEVEL, 1 + STRENGTH))),
    Effect("friction-", f"the friction {100 * STRENGTH:.0f} % lower", _friction(dict.fromkeys(_LEVEL, 1 - STRENGTH))),
    Effect("worn", "worn axes: friction and sigma_0 30 % lower, W doubled", _friction(WEAR_FACTORS)),
    Effect("warm", "warm grease: F_log and sigma_2 halved", _friction(WARMTH_FACTORS)),
    Effect("guide", f"{100 * GUIDE:.0f} % of the friction at the guide", _guide),
    Effect("cogging", f"cogging of {100 * COGGING_TORQUE_SHARE:.0f} % of F_C, twice per pole pair", _add_cogging),
    Effect("play", f"play of {1e6 * PLAY_WIDTH:.0f} um", _add_play),
)
