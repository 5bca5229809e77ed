"""What a page holds of a scenario: module, machine, parameters, knobs, motions, what is evaluated; as JSON.

The machine is packed as for a run in one unit (:mod:`feedsim.simulation.cosim.whole`), and the page drives the same
unit: there is no wiring of its own. Motions are planned in the page where it knows them (moves, circles, dwells);
setpoints of others are carried along.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.installation import checkout
from feedsim.foundation.units import Variable
from feedsim.linear.judgement import judge
from feedsim.motions.circular import Circle, Circular
from feedsim.motions.dwell import Dwell
from feedsim.motions.move import Move, Straight
from feedsim.scenario import CircleTest, Friction, Machine, Positioning, Scenario
from feedsim.scenario.axis_units import EFFECTS
from feedsim.scenario.machine import Axis
from feedsim.scenario.model import SCHEMES
from feedsim.simulation.cosim import fmus_directory
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.recording import LIMITS
from feedsim.simulation.cosim.roles import controller_parameters
from feedsim.simulation.cosim.system import plant_parameters
from feedsim.simulation.cosim.whole import open_whole, parameters
from feedsim.simulation.judge import check as judged_ahead
from feedsim.simulation.judge import exchange_stability, warn_control_loops, warn_outside_grid
from feedsim.simulation.nc import Program
from feedsim.structure import checked_modes
from feedsim.structure.pack import POSES_IN_ARCHIVE
from feedsim.structure.pose_change import LARGE_SHIFT, MIN_POSE_DISTANCE, over_axis, pose_change, warnings
from feedsim.structure.poses import GridAxis, read_grid

# --- What can be turned in a page: parameters of drives and frictions, and of motions, with their ranges --------------
# A knob is a key of the scenario as ``--set`` takes it, and what it sets in the page: parameters of the unit `machine`,
# or a field of a motion. Names, units, ranges and descriptions are those of the units' tables.


# Shown where nobody chooses, of every axis that a motion moves.
DEFAULT_KNOBS = {
    "drive": ("K_v", "T_sym", "k_ffw", "K_p", "T_n"),
    "friction": ("F_S", "F_C", "W", "gamma", "sigma_0"),
}
# Of effects and corrections of the control: what the machine has of them, and this one, which every drive has.
CORRECTION = "backlash_compensation.value"
# Switches that need nothing else to be given.
SWITCHES = ("symmetry_lag", "ramp_speed_setpoint", "measuring.indirect")
SWITCH_VALUES = ("false", "true")
# What is worth trying of a parameter that is 0, by its units: a quarter of the slider's reach.
TRIAL_VALUES = {
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
FIXED_PARAMETERS = ("T_c", "T_pos", "I_P")
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
    lost = [pattern for pattern in wanted if not any(matches_knob(knob, pattern) for knob in known)]
    if lost:
        raise InputError.of(
            "there is no such knob",
            [f"--knobs {pattern}: fits none of {', '.join(knob.key for knob in known)}" for pattern in lost],
        )
    return [knob for knob in known if any(matches_knob(knob, pattern) for pattern in wanted)]


def matches_knob(knob: Knob, pattern: str) -> bool:
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
            table = units.parameters(unit)
            for name, value in values.items():
                whole = f"{part}.{name}".removeprefix(".")
                key, own = f"machine.axes.{axis}.{whole}", ((f"{axis}.{whole}", 1.0),)
                sets = _friction_sets(described, axis, name) if part == "friction" else own
                if name in SWITCHES:
                    knobs.append(Knob(key, group, name, table[name].short, SWITCH_VALUES[bool(value)], sets=sets,
                                      choices=SWITCH_VALUES, without=SWITCH_VALUES[0]))  # fmt: skip
                elif name in table and table[name].kind == "REAL" and name not in FIXED_PARAMETERS:
                    knobs.append(_number(key, group, name, float(value), table[name], sets))
        if machine.shipped_drive(axis, "machine.fmu").indirect:
            key, reach = f"machine.axes.{axis}.play", REACH * (described.play or TRIAL_VALUES["m", "um"])
            knobs.append(Knob(key, group, "play", "play between motor and slide", described.play, "m", "um", 1e6, 0.0,
                              reach, 0.0, 1.0, ((f"{axis}.play", 1.0),)))  # fmt: skip
    return knobs


def _at_slide(axis: Axis) -> dict[str, Any]:
    """Hysteresis, friction of its own at the guide, not where it is a share of the axis's friction, and the play of a
    transmission: its stiffness makes other modes, which the page cannot."""
    table = units.parameters("plant/axis")
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
    table = units.parameters("controller")
    return {name: row.start for name, row in table.items() if name.partition(".")[0] in EFFECTS}


def _of_structure(machine: Machine) -> list[Knob]:
    """Geometry of the guides, and factors of mounts that are not linear where there are any."""
    given = {name: float(row.start) for name, row in units.parameters("plant").items()
             if name.startswith("geometry.")}  # fmt: skip
    given |= {
        name: float(value) for name, value in machine.errors.items() if name in given or name.startswith("mounts.")
    }
    table = units.parameters("plant")
    return [
        _number(f"machine.{name}", "mounts" if name.startswith("mounts.") else "guides", name, value, table[name],
                ((name, 1.0),))
        for name, value in given.items()
    ]  # fmt: skip


def _number(key: str, group: str, name: str, value: float, table: Variable,
            sets: tuple[tuple[str, float], ...]) -> Knob:  # fmt: skip
    shown = SHOWN_UNIT.get(table.unit, table.display_unit or table.unit)
    low, high = _slider_ends(value, table)
    return Knob(
        key, group, name, table.short, value, table.unit, shown, units.convert(1.0, table.unit, shown), low, high,
        table.minimum, table.maximum, sets, without=float(table.start),
    )  # fmt: skip


def _slider_ends(value: float, table: Variable) -> tuple[float, float]:
    """Ends of a slider: the table's where the value is not lost between them, else some times the value."""
    size = abs(value) or abs(float(table.start)) or TRIAL_VALUES.get((table.unit, table.display_unit), 1.0)
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
                _length_knob(
                    i, group, ("feed",), "feed", "programmed speed along the path", motion.feed, "m/s", "mm/min"
                )
            )
        if isinstance(motion, Circle):
            knobs.append(_length_knob(i, group, ("radius",), "radius", "radius", motion.radius, "m", "mm"))
            knobs.append(
                Knob(f"motions.{i}.direction", group, "direction", "sense of the turns", motion.direction,
                     motion=(i, "direction"), choices=("counterclockwise", "clockwise", "both"))
            )  # fmt: skip
        if isinstance(motion, Move):
            for axis, by in motion.by.items():
                knobs.append(_length_knob(i, group, ("by", axis), f"by {axis}", f"distance of {axis}", by, "m", "mm"))
    return knobs


def _length_knob(
    i: int, group: str, path: tuple[str, ...], name: str, text: str, value: float, unit: str, shown: str
) -> Knob:
    ends = sorted((value / REACH, value * REACH))
    least = 0.0 if path[0] != "by" else -math.inf
    return Knob(
        f"motions.{i}.{'.'.join(path)}", group, name, text, value, unit, shown, units.convert(1.0, unit, shown),
        ends[0], ends[1], least, motion=(i, *path),
    )  # fmt: skip


# --- What a page holds of a scenario: module, machine, parameters, knobs, motions, what is evaluated; as JSON ---------


# --- The WebAssembly module of the unit `machine` (src/page): where it is, and whether it fits the archives -----------


MODULE_FILE = "machine.wasm"
SECTION = b"feedsim"
MAGIC = b"\0asm\1\0\0\0"


def read_page_module(fmus: Path, guid: str) -> bytes:
    """The module beside the archives in the folder `fmus`, for the unit with this GUID.

    Raises:
        InputError: it is missing, no module, or built from another table of variables.
    """
    path = fmus / MODULE_FILE
    mend = "`make page-module` builds it" if checkout() else "a wheel of feedsim brings it along: install it anew"
    if not path.is_file():
        raise InputError(f"{path}: there is no module of the machine for pages; {mend}")
    content = path.read_bytes()
    table = _section(content).get("table")
    if table is None:
        raise InputError(f"{path}: is no WebAssembly module that feedsim made; {mend}")
    if table != guid.partition("-")[0]:
        raise InputError(
            f"{path}: was built for a machine.fmu whose table of variables has the hash {table}, the archive's is "
            f"{guid.partition('-')[0]}: one of them is of other sources; {mend}"
        )
    return content


def _section(content: bytes) -> dict[str, str]:
    """What the custom section `feedsim` says; empty where there is none."""
    if not content.startswith(MAGIC):
        return {}
    at = len(MAGIC)
    while at < len(content):
        kind, at = content[at], at + 1
        size, at = _length(content, at)
        if kind == 0:
            length, begin = _length(content, at)
            if content[begin : begin + length] == SECTION:
                result: dict[str, str] = json.loads(content[begin + length : at + size])
                return result
        at += size
    return {}


def _length(content: bytes, at: int) -> tuple[int, int]:
    """An unsigned LEB128 number, and where the next byte is."""
    value = shift = 0
    while at < len(content):
        byte, at = content[at], at + 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            break
    return value, at


# --- What a page needs to say how far a motion leaves the pose of its plant, or the grid of poses, as a run says it ---
# How the modes change there takes the structure, which a page has not: their frequencies at some positions of every
# axis
# are carried along, and the page takes cubics through them.


# Distance of positions at which modes are carried along [m]: up to some times what the program reaches, and beyond.
# Between close ones a cubic is right to some 1e-5 of a frequency.
CLOSE_DISTANCE, WIDE_DISTANCE, REACH_FACTOR = 0.02, 0.06, 1.6
# Where no mode changes by more than this share of what is worth a warning as far as sliders reach, none are carried.
NEGLIGIBLE_CHANGE = 0.5


def reached_positions(machine: Machine, program: Program) -> dict[str, tuple[float, float]]:
    """Positions between which an axis may move while sliders turn [m]: the program's, farther by a slider's reach."""
    result = {}
    for axis in program.x_s:
        low, high = program.reached(axis)
        pose, travel = machine.pose[axis], machine.axes[axis].travel
        ends = pose - REACH * max(pose - low, 0.0), pose + REACH * max(high - pose, 0.0)
        result[axis] = max(ends[0], travel[0]), min(ends[1], travel[1])
    return result


def describe_grid(machine: Machine, program: Program, resources: Path) -> dict[str, Any]:
    """Per axis what the page needs: "grid", first and last position of its cells; "over", modes over its positions."""
    grid = _grid(machine, resources)
    return {
        "grid": {axis.axis: list(axis.reach) for axis in grid if len(axis.centres) > 1},
        "over": dict(_modes_over_axes(machine, program, {axis.axis for axis in grid})), "near": MIN_POSE_DISTANCE,
        "large": LARGE_SHIFT,
    }  # fmt: skip


def pose_findings(machine: Machine, program: Program, resources: Path) -> list[Finding]:
    """What a run says of the positions that the program reaches: the page says it in place of it."""
    grid = {axis.axis: axis for axis in _grid(machine, resources)}
    ranges = {axis: program.reached(axis) for axis in program.x_s}
    outside = [
        finding for axis in grid if axis in ranges for finding in warn_outside_grid(grid[axis], ranges[axis], machine)
    ]
    return [*outside, *warnings(pose_change(machine, {a: r for a, r in ranges.items() if a not in grid}))]


def _grid(machine: Machine, resources: Path) -> tuple[GridAxis, ...]:
    file = resources.parent / POSES_IN_ARCHIVE
    return read_grid(file, tuple(machine.axes)) if file.is_file() else ()


def _modes_over_axes(machine: Machine, program: Program, followed: set[str]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for axis, (low, high) in reached_positions(machine, program).items():
        pose = machine.pose[axis]
        if axis in followed or max(pose - low, high - pose) <= MIN_POSE_DISTANCE:
            continue
        ends = over_axis(machine, axis, [low, high])
        if ends is None:
            continue
        if ends.largest < NEGLIGIBLE_CHANGE * LARGE_SHIFT:
            yield axis, {"low": low, "high": high}
            continue
        here = program.reached(axis)
        sides = (pose - low, pose - here[0], -1), (high - pose, here[1] - pose, 1)
        positions = sorted({pose, *(pose + sense * at for far, near, sense in sides for at in _steps(far, near))})
        table = over_axis(machine, axis, positions)
        assert table is not None
        words = [moving.partition(",")[0] for moving in table.moving]
        rounded = [[float(f"{f:.9g}") for f in row] for row in table.there.tolist()]
        frequency = table.frequency.tolist()
        yield axis, {"low": low, "high": high, "position": [round(x, 4) for x in positions], "there": rounded,
                     "frequency": frequency, "moving": words}  # fmt: skip


def _steps(far: float, near: float) -> list[float]:
    """Distances from the pose on one side [m], up to `far`; close together up to REACH_FACTOR times `near`."""
    if far <= MIN_POSE_DISTANCE:
        return []
    close = min(REACH_FACTOR * max(near, 0.0), far)
    count, wide = max(math.ceil(close / CLOSE_DISTANCE), 1), math.ceil((far - close) / WIDE_DISTANCE)
    return [
        *(k * close / count for k in range(1, count + 1)),
        *(close + k * (far - close) / wide for k in range(1, wide + 1)),
    ]


# Longer runs take a phone more than a second or two at every turn of a knob.
MAX_RUN_TIME = 60.0  # s
MOST_CYCLES = 1_000_000
PER_AXIS = ("x_a", "n_a", "x_e", "M_a", "M_fr")
TOOL_COLUMNS = ("tcp.x_X", "tcp.x_Y", "tcp.x_Z")
TYPE_LETTERS = {"Real": "r", "Integer": "i", "Boolean": "b"}


@dataclass(frozen=True)
class Content:
    """data: for the page, JSON. left_out: what the page does not show, a sentence each. sha256: of the module."""

    data: dict[str, Any]
    left_out: tuple[str, ...]
    sha256: str


def content(scenario: Scenario, program: Program, wanted: Sequence[str] = (), fmus: Path | None = None) -> Content:
    """What a page of `scenario` with its planned `program` holds.

    Raises:
        InputError: the machine cannot be one unit, loads act, the program is too long, there is no module.
    """
    check(scenario, program)
    machine, folder = scenario.machine, fmus or fmus_directory()
    planned = all(isinstance(motion, Move | Circle | Dwell) for motion in scenario.motions)
    knobs = chosen(scenario, wanted, planned=planned)
    evaluated = [item for item in scenario.evaluate if _is_computable(item, scenario)]
    values = {**plant_parameters(machine, False), **parameters(machine, scenario.coupling, built_in=False)}
    with open_whole(machine, folder) as archive:
        code = read_page_module(folder, archive.guid)
        resources = archive.directory / "resources"
        files = {path.name: path.read_bytes() for path in sorted(resources.iterdir()) if path.is_file()}
        described = _machine(scenario, archive) | _judgement_content(scenario, program, folder, resources)
        data = {
            "name": scenario.name, "note": machine.note, "machine_name": machine.name, "guid": archive.guid,
            "module": pack_bytes(code), "files": {name: pack_bytes(file) for name, file in files.items()},
            "machine": described,
            "parameters": [[*_reference(archive, name), value, name] for name, value in values.items()],
            "knobs": [_knob(knob, archive) for knob in knobs],
            "motions": [motion.model_dump() for motion in scenario.motions] if planned else [],
            "evaluate": [item.model_dump(include={"kind", "axis", "band", "motion", "turn"}) for item in evaluated],
            "given": None if planned else _setpoint_content(scenario, program),
        }  # fmt: skip
    left_out = [f"evaluate: {item.kind} is not shown in a page" for item in scenario.evaluate if item not in evaluated]
    if not planned:
        others = dict.fromkeys(m.kind for m in scenario.motions if not isinstance(m, Move | Circle | Dwell))
        left_out.append(f"motions of the kind {', '.join(others)} are planned ahead and cannot be turned in the page")
    return Content(data, tuple(left_out), hashlib.sha256(code).hexdigest())


def check(scenario: Scenario, program: Program) -> None:
    """Raise InputError, with every reason for which there is no page of a scenario."""
    cycles = program.duration / scenario.machine.cycles.T_c
    problems = [
        f"{scenario.at('loads', i)}: the load {load.words} does not go into a page: --set loads=[] leaves it out"
        for i, load in enumerate(scenario.loads)
    ]
    if program.duration > MAX_RUN_TIME or cycles > MOST_CYCLES:
        problems.append(
            f"{scenario.file}: the motions last {program.duration:.4g} s, {cycles:.3g} control cycles; a page computes "
            f"them at every turn of a knob: allowed are {MAX_RUN_TIME:g} s and {MOST_CYCLES:.0e} cycles"
        )
    if problems:
        raise InputError.of(f"{scenario.file}: there is no page of it", problems)


def _is_computable(item: Any, scenario: Scenario) -> bool:
    if isinstance(item, CircleTest):
        return any(isinstance(motion, Circle) for motion in scenario.motions) and item.plane is None
    return isinstance(item, Positioning)


def _machine(scenario: Scenario, archive: Archive) -> dict[str, Any]:
    """Axes, cycles, limits, and where signals are in the unit."""
    machine = scenario.machine
    axes = list(machine.axes)
    signals = [*(f"{axis}.{name}" for axis in axes for name in PER_AXIS), *TOOL_COLUMNS]
    names = [*signals, *(f"{axis}.{flag}" for axis in axes for flag in LIMITS), "coupling.friction",
             *(f"{axis}.{name}" for axis in axes for name in ("M_0", "drive.K_v"))]  # fmt: skip
    cycles = machine.cycles
    return {
        "axes": axes, "pose": {axis: machine.pose[axis] for axis in axes},
        "cycles": {"T_c": cycles.T_c, "T_pos": cycles.T_pos, "T_ipo": cycles.T_ipo},
        "path": {"acceleration": machine.path.acceleration, "jerk": machine.path.jerk},
        "limits": {name: {"travel": list(axis.travel), "speed": axis.max_speed, "acceleration": axis.max_acceleration}
                   for name, axis in machine.axes.items()},
        "I_P": {name: axis.I_P for name, axis in machine.axes.items()},
        "signs": {name: axis.display_sign for name, axis in machine.axes.items()},
        "feeds": [_reference(archive, f"{axis}.{name}")[0] for axis in axes for name in ("x_s", "n_ffw")],
        "every": round(scenario.recording.interval / cycles.T_c), "signals": signals, "flags": list(LIMITS),
        "references": {name: _reference(archive, name) for name in names}, "longest": MAX_RUN_TIME,
    }  # fmt: skip


def _judgement_content(scenario: Scenario, program: Program, folder: Path, resources: Path) -> dict[str, Any]:
    """What the page needs to say what it warns of, and what its knobs have nothing to do with."""
    machine, coupling = scenario.machine, scenario.coupling
    modes = checked_modes(machine)
    said = {
        *warn_control_loops(machine, judge(machine, modes), program), *exchange_stability(scenario, modes),
        *pose_findings(machine, program, resources),
    }  # fmt: skip
    ahead = [warning for warning in judged_ahead(scenario, program, fmus=folder) if warning not in said]
    scheme, step = SCHEMES[coupling.scheme], machine.cycles.T_c / coupling.steps(machine)
    bounds = {name: scheme.stable_share * 2 * modes.J_inf(name) / step for name in machine.axes}
    # Judged is all friction of an axis, wherever it acts.
    friction = {f"{name}.friction.{key}": value for name, axis in machine.axes.items()
                if axis.guide is not None and axis.guide.share
                for key, value in machine.shipped_friction(name, "a page").parameters().items()}  # fmt: skip
    return {
        "friction": friction, "reach": describe_grid(machine, program, resources),
        "warnings": [str(warning) for warning in ahead],
        "scheme": {"name": scheme.name, "stable_share": scheme.stable_share, "bounds": bounds},
    }  # fmt: skip


def _reference(archive: Archive, name: str) -> list[Any]:
    variable = archive.variables[name]
    return [int(variable.valueReference), TYPE_LETTERS[str(variable.type)]]


def _knob(knob: Knob, archive: Archive) -> dict[str, Any]:
    bounds = {name: value for name, value in (("least", knob.least), ("most", knob.most)) if math.isfinite(value)}
    return {
        "key": knob.key, "group": knob.group, "name": knob.name, "text": knob.text, "value": knob.value,
        "unit": knob.unit, "shown": knob.shown, "factor": knob.factor, "low": knob.low, "high": knob.high, **bounds,
        "sets": [[*_reference(archive, name), name, factor] for name, factor in knob.sets], "motion": list(knob.motion),
        "choices": list(knob.choices),
    }  # fmt: skip


def _setpoint_content(scenario: Scenario, program: Program) -> dict[str, Any]:
    """Setpoints that are carried along."""
    return {"rows": pack_bytes(rows(scenario, program).tobytes()), "segments": segments(program)}


def rows(scenario: Scenario, program: Program) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(N, 2 A): x_s [m] and n_ffw [rad/s] of every axis at T_pos."""
    pairs = [(program.x_s[axis], program.n_ffw[axis]) for axis in scenario.machine.axes]
    return np.ascontiguousarray(np.stack([column for pair in pairs for column in pair], axis=1), dtype="<f8")


def segments(program: Program) -> list[dict[str, Any]]:
    """The motions as the page's planner describes them."""
    result: list[dict[str, Any]] = []
    for segment in program.segments:
        geometry = segment.geometry
        circles: list[Mapping[str, Any]] = []
        if isinstance(geometry, Circular) and segment.kind == "circle":
            circles = [_circle(circular) for circular in (geometry, geometry.back) if circular is not None]
        steady = geometry.steady if isinstance(geometry, Straight) else None
        result.append(
            {
                "kind": segment.kind,
                "index": segment.index,
                "start": segment.start,
                "end": segment.end,
                "origin": dict(segment.origin),
                "target": dict(segment.target),
                "axes": list(segment.axes),
                "steady": None if steady is None else list(steady),
                "circles": circles,
            }
        )
    return result


def _circle(circle: Circular) -> dict[str, Any]:
    return {
        "axes": list(circle.axes), "centre": list(circle.centre), "radius": circle.radius, "sense": circle.sense,
        "turns": [list(turn) for turn in circle.turns], "turn_time": circle.turn_time,
        "steady": None if circle.steady is None else list(circle.steady),
    }  # fmt: skip


def pack_bytes(file: bytes) -> str:
    """Compressed, base64; the same from the same bytes."""
    return base64.b64encode(gzip.compress(file, 9, mtime=0)).decode("ascii")
