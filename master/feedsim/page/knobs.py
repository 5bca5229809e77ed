"""What can be turned in a page: parameters of drives and frictions, and of motions, with their ranges.

A knob is a key of the scenario as ``--set`` takes it, and what it sets in the page: parameters of the unit `machine`,
or a field of a motion. Names, units, ranges and descriptions are those of the units' tables.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any

from feedsim import units, variables
from feedsim.cosim.roles import controller_parameters
from feedsim.errors import InputError
from feedsim.motions.circular import Circle
from feedsim.motions.move import Move
from feedsim.scenario import Friction, Machine, Scenario
from feedsim.scenario.axis_units import EFFECTS
from feedsim.scenario.machine import Axis
from feedsim.variables import Variable

# Shown where nobody chooses, of every axis that a motion moves.
DEFAULT_KNOBS = {
    "drive": ("K_v", "T_sym", "k_ffw", "K_p", "T_n"),
    "friction": ("F_S", "F_C", "W", "gamma", "sigma_0"),
}
# Of effects and corrections of the control: what the machine has of them, and this one, which every drive has.
CORRECTION = "backlash_compensation.value"
# Switches that need nothing else to be given.
SWITCHES = ("symmetry_lag", "ramp_speed_setpoint", "measuring.indirect")
SWITCHED = ("false", "true")
# What is worth trying of a parameter that is 0, by its units: a quarter of the slider's reach.
TRIED = {
    ("m", "um"): 5e-6, ("m", "nm"): 50e-9, ("m", "mm"): 0.1, ("N.m", "N.m"): 0.2, ("1", "%"): 0.01, ("1", "1"): 50e-6,
    ("rad", "deg"): math.pi / 4, ("rad", "mrad"): 1e-3, ("s", "ms"): 1e-3, ("1/m", "1/m"): 1e-4,
    ("1/m^2", "1/m^2"): 1e-3,
}  # fmt: skip
# How an effect lies and runs; how large it is, is tried.
SETTINGS = (
    "order", "phase", "period", "first", "spacing", "seed", "ramp", "way", "v_s", "v_log", "beta", "warm_power",
    "place_first", "place_spacing",
)  # fmt: skip
# Parameters that the machine's cycles and axes fix, and those that are no matter of trying.
FIXED = ("T_c", "T_pos", "I_P")
# How far a slider goes about the scenario's value; a number may be typed beyond, within the table's range.
REACH = 4.0
SHOWN_UNIT = {"1/s": "(m/min)/mm"}


@dataclass(frozen=True)
class Knob:
    """Something that can be turned; values are SI.

    Attributes:
        key: as --set takes it. group: what it belongs to, in words. name: symbol; text: what it is.
        value: of the scenario, a number or one of `choices`.
        low, high: ends of the slider; least, most: what is allowed.
        unit, shown: SI unit, unit in the page; factor: of what is shown per SI.
        sets: names of the unit's parameters, and factors from `value` to them. motion: place of a motion's field.
        without: of a machine that says nothing of it.
    """

    key: str
    group: str
    name: str
    text: str
    value: float | str
    unit: str = "1"
    shown: str = ""
    factor: float = 1.0
    low: float = 0.0
    high: float = 0.0
    least: float = -math.inf
    most: float = math.inf
    sets: tuple[tuple[str, float], ...] = ()
    motion: tuple[int | str, ...] = ()
    choices: tuple[str, ...] = field(default=())
    without: float | str = 0.0


def chosen(scenario: Scenario, wanted: Sequence[str], *, planned: bool) -> list[Knob]:
    """The knobs that fit one of the patterns (keys, with ``*``), in the scenario's order; without: the usual ones.

    planned: whether the page plans the motions, so that they can be changed.

    Raises:
        InputError: a pattern fits none; it lists what there is.
    """
    machine = scenario.machine
    known = [*(_of_motions(scenario) if planned else []), *_of_axes(machine), *_of_structure(machine)]
    if not wanted:
        moved = {axis for motion in scenario.motions for axis in motion.axes} or set(scenario.machine.axes)
        usual = {
            f"machine.axes.{axis}.{part}.{name}"
            for axis in moved
            for part, names in DEFAULT_KNOBS.items()
            for name in names
        } | {f"machine.axes.{axis}.drive.{CORRECTION}" for axis in moved}
        return [knob for knob in known if knob.motion or knob.key in usual or _is_on(knob)]
    lost = [pattern for pattern in wanted if not any(fits(knob, pattern) for knob in known)]
    if lost:
        raise InputError.of(
            "there is no such knob",
            [f"--knobs {pattern}: fits none of {', '.join(knob.key for knob in known)}" for pattern in lost],
        )
    return [knob for knob in known if any(fits(knob, pattern) for pattern in wanted)]


def fits(knob: Knob, pattern: str) -> bool:
    """Whether a pattern names a knob, by its key or by the end of its key: "Z.drive.K_v", "K_v", "motions.*"."""
    return fnmatchcase(knob.key, pattern) or fnmatchcase(knob.key, f"*.{pattern}")


def _is_on(knob: Knob) -> bool:
    """Whether a knob is an effect that the machine has: its value is not that of a machine without."""
    parts = knob.key.split(".")
    effect = any(
        part in (*EFFECTS, "geometry", "mounts", "hysteresis", "guide", "transmission", "play") for part in parts
    )
    return effect and knob.value != knob.without and (knob.choices != () or parts[-1] not in SETTINGS)


def _of_axes(machine: Machine) -> list[Knob]:
    knobs = []
    for axis, described in machine.axes.items():
        group = f"axis {axis}"
        given = controller_parameters(machine, axis)
        drive: dict[str, Any] = {**given, **{name: effect for name, effect in _effects().items() if name not in given}}
        friction = machine.shipped_friction(axis, "a page").parameters()
        structure = _at_slide(described)
        for part, values, unit in (("drive", drive, "controller"), ("friction", friction, "friction"),
                                   ("", structure, "plant/axis")):  # fmt: skip
            table = variables.parameters(unit)
            for name, value in values.items():
                whole = f"{part}.{name}".removeprefix(".")
                key, own = f"machine.axes.{axis}.{whole}", ((f"{axis}.{whole}", 1.0),)
                sets = _friction_sets(described, axis, name) if part == "friction" else own
                if name in SWITCHES:
                    knobs.append(Knob(key, group, name, table[name].short, SWITCHED[bool(value)], sets=sets,
                                      choices=SWITCHED, without=SWITCHED[0]))  # fmt: skip
                elif name in table and table[name].kind == "REAL" and name not in FIXED:
                    knobs.append(_number(key, group, name, float(value), table[name], sets))
        if machine.shipped_drive(axis, "machine.fmu").indirect:
            key, reach = f"machine.axes.{axis}.play", REACH * (described.play or TRIED["m", "um"])
            knobs.append(Knob(key, group, "play", "play between motor and slide", described.play, "m", "um", 1e6, 0.0,
                              reach, 0.0, 1.0, ((f"{axis}.play", 1.0),)))  # fmt: skip
    return knobs


def _at_slide(axis: Axis) -> dict[str, Any]:
    """Hysteresis, friction of its own at the guide, not where it is a share of the axis's friction, and the play of a
    transmission: its stiffness makes other modes, which the page cannot."""
    table = variables.parameters("plant/axis")
    result = {name: row.start for name, row in table.items() if name.partition(".")[0] in ("hysteresis", "guide")}
    wound = axis.hysteresis.parameters() if axis.hysteresis is not None else {}
    result |= {f"hysteresis.{name}": value for name, value in wound.items()}
    if axis.transmission is not None and axis.transmission.stiffness > 0:
        result["transmission.play"] = axis.transmission.play
    if axis.guide is not None and axis.guide.share is not None:
        return {name: value for name, value in result.items() if not name.startswith("guide.")}
    return result | {f"guide.{name}": value for name, value in axis.friction_at_guide.items()}


def _friction_sets(described: Axis, axis: str, name: str) -> tuple[tuple[str, float], ...]:
    """Where a parameter of an axis's friction acts: at the motor, and in part at the guide."""
    assert isinstance(described.friction, Friction)
    value = float(described.friction.parameters()[name])
    at_motor, at_guide = described.friction_at_motor, described.friction_at_guide
    shared = described.guide is not None and described.guide.share
    if not shared or value == 0:
        return ((f"{axis}.friction.{name}", 1.0),)
    result = [(f"{axis}.friction.{name}", float(at_motor[name]) / value)]
    return (*result, (f"{axis}.guide.{name}", float(at_guide[name]) / value)) if name in at_guide else tuple(result)


def _effects() -> dict[str, Any]:
    """Parameters of all effects of a drive, as they are where a machine has none."""
    table = variables.parameters("controller")
    return {name: row.start for name, row in table.items() if name.partition(".")[0] in EFFECTS}


def _of_structure(machine: Machine) -> list[Knob]:
    """Geometry of the guides, and factors of mounts that are not linear where there are any."""
    given = {name: float(row.start) for name, row in variables.parameters("plant").items()
             if name.startswith("geometry.")}  # fmt: skip
    given |= {
        name: float(value) for name, value in machine.errors.items() if name in given or name.startswith("mounts.")
    }
    table = variables.parameters("plant")
    return [
        _number(f"machine.{name}", "mounts" if name.startswith("mounts.") else "guides", name, value, table[name],
                ((name, 1.0),))
        for name, value in given.items()
    ]  # fmt: skip


def _number(key: str, group: str, name: str, value: float, table: Variable,
            sets: tuple[tuple[str, float], ...]) -> Knob:  # fmt: skip
    shown = SHOWN_UNIT.get(table.unit, table.display_unit or table.unit)
    low, high = _ends(value, table)
    return Knob(
        key, group, name, table.short, value, table.unit, shown, units.convert(1.0, table.unit, shown), low, high,
        table.minimum, table.maximum, sets, without=float(table.start),
    )  # fmt: skip


def _ends(value: float, table: Variable) -> tuple[float, float]:
    """Ends of a slider: the table's where the value is not lost between them, else some times the value."""
    size = abs(value) or abs(float(table.start)) or TRIED.get((table.unit, table.display_unit), 1.0)
    if math.isfinite(table.minimum) and table.maximum <= 2 * REACH * size:
        return table.minimum, table.maximum
    low = value / REACH if value > 0 else -REACH * size
    return max(table.minimum, low), min(table.maximum, REACH * size)


def _of_motions(scenario: Scenario) -> list[Knob]:
    knobs = []
    for i, motion in enumerate(scenario.motions):
        group = f"motion {i}: {motion.kind}"
        if isinstance(motion, Move | Circle):
            knobs.append(
                _length(i, group, ("feed",), "feed", "programmed speed along the path", motion.feed, "m/s", "mm/min")
            )
        if isinstance(motion, Circle):
            knobs.append(_length(i, group, ("radius",), "radius", "radius", motion.radius, "m", "mm"))
            knobs.append(
                Knob(f"motions.{i}.direction", group, "direction", "sense of the turns", motion.direction,
                     motion=(i, "direction"), choices=("counterclockwise", "clockwise", "both"))
            )  # fmt: skip
        if isinstance(motion, Move):
            for axis, by in motion.by.items():
                knobs.append(_length(i, group, ("by", axis), f"by {axis}", f"distance of {axis}", by, "m", "mm"))
    return knobs


def _length(
    i: int, group: str, path: tuple[str, ...], name: str, text: str, value: float, unit: str, shown: str
) -> Knob:
    ends = sorted((value / REACH, value * REACH))
    least = 0.0 if path[0] != "by" else -math.inf
    return Knob(
        f"motions.{i}.{'.'.join(path)}", group, name, text, value, unit, shown, units.convert(1.0, unit, shown),
        ends[0], ends[1], least, motion=(i, *path),
    )  # fmt: skip
