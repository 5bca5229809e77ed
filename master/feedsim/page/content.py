"""What a page holds of a scenario: module, machine, parameters, knobs, motions, what is evaluated; as JSON.

The machine is packed as for a run in one unit (:mod:`feedsim.cosim.whole`), and the page drives the same unit: there is
no wiring of its own. Motions are planned in the page where it knows them (moves, circles, dwells); setpoints of others
are carried along.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.cosim import fmus_directory
from feedsim.cosim.archive import Archive
from feedsim.cosim.one_unit import parameters
from feedsim.cosim.plant import plant_modes
from feedsim.cosim.recording import LIMITS
from feedsim.cosim.system import plant_parameters
from feedsim.cosim.whole import open_whole
from feedsim.errors import InputError
from feedsim.estimation.interval import student
from feedsim.installation import checkout
from feedsim.judge import check as judged_ahead
from feedsim.judge.run import control, exchange_stability, left_grid
from feedsim.linear.judgement import SHOWS, judge, locked_modes
from feedsim.motions.circular import Circle, Circular
from feedsim.motions.dwell import Dwell
from feedsim.motions.move import Move, Straight
from feedsim.nc import Program
from feedsim.page.knobs import REACH, Knob, chosen
from feedsim.scenario import CircleTest, Machine, Positioning, Scenario
from feedsim.scenario.coupling import SCHEMES
from feedsim.structure import Modes, checked_modes
from feedsim.structure.pack import POSES_IN_ARCHIVE
from feedsim.structure.pose_change import LARGE_SHIFT, MIN_POSE_DISTANCE, over_axis, pose_change, warnings
from feedsim.structure.poses_file import GridAxis, read_grid

# --- The WebAssembly module of the unit `machine` (src/page): where it is, and whether it fits the archives -----------


MODULE_FILE = "machine.wasm"
SECTION = b"feedsim"
MAGIC = b"\0asm\1\0\0\0"


def read(fmus: Path, guid: str) -> bytes:
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


def reached(machine: Machine, program: Program) -> dict[str, tuple[float, float]]:
    """Positions between which an axis may move while sliders turn [m]: the program's, farther by a slider's reach."""
    result = {}
    for axis in program.x_s:
        low, high = program.reached(axis)
        pose, travel = machine.pose[axis], machine.axes[axis].travel
        ends = pose - REACH * max(pose - low, 0.0), pose + REACH * max(high - pose, 0.0)
        result[axis] = max(ends[0], travel[0]), min(ends[1], travel[1])
    return result


def described(machine: Machine, program: Program, resources: Path) -> dict[str, Any]:
    """Per axis what the page needs: "grid", first and last position of its cells; "over", modes over its positions."""
    grid = _grid(machine, resources)
    return {
        "grid": {axis.axis: list(axis.reach) for axis in grid if len(axis.centres) > 1},
        "over": dict(_over(machine, program, {axis.axis for axis in grid})), "near": MIN_POSE_DISTANCE,
        "large": LARGE_SHIFT,
    }  # fmt: skip


def sentences(machine: Machine, program: Program, resources: Path) -> list[str]:
    """What a run says of the positions that the program reaches: the page says it in place of it."""
    grid = {axis.axis: axis for axis in _grid(machine, resources)}
    ranges = {axis: program.reached(axis) for axis in program.x_s}
    outside = [name for axis in grid if axis in ranges for name in left_grid(grid[axis], ranges[axis], machine)]
    return [*outside, *warnings(pose_change(machine, {a: r for a, r in ranges.items() if a not in grid}))]


def _grid(machine: Machine, resources: Path) -> tuple[GridAxis, ...]:
    file = resources.parent / POSES_IN_ARCHIVE
    return read_grid(file, tuple(machine.axes)) if file.is_file() else ()


def _over(machine: Machine, program: Program, followed: set[str]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for axis, (low, high) in reached(machine, program).items():
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
# [1/s]: with no larger K_v does a page look closely at modes with the motors held.
MOST_K_V = 1e4
PER_AXIS = ("x_a", "n_a", "x_e", "M_a", "M_fr")
TOOL_COLUMNS = ("tcp.x_X", "tcp.x_Y", "tcp.x_Z")
# Of so many degrees of freedom and more, the page has a series for Student's quantile, as feedsim.analysis has.
SERIES_FREEDOM = 20
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
    evaluated = [item for item in scenario.evaluate if _known(item, scenario)]
    values = {**plant_parameters(machine, None), **parameters(machine, scenario.coupling, built_in=False)}
    with open_whole(machine, folder) as archive:
        code = read(folder, archive.guid)
        resources = archive.directory / "resources"
        files = {path.name: path.read_bytes() for path in sorted(resources.iterdir()) if path.is_file()}
        described = _machine(scenario, archive) | _judged(scenario, program, folder, resources)
        data = {
            "name": scenario.name, "note": machine.note, "machine_name": machine.name, "guid": archive.guid,
            "module": packed(code), "files": {name: packed(file) for name, file in files.items()},
            "machine": described,
            "parameters": [[*_reference(archive, name), value, name] for name, value in values.items()],
            "knobs": [_knob(knob, archive) for knob in knobs],
            "motions": [motion.model_dump() for motion in scenario.motions] if planned else [],
            "evaluate": [item.model_dump(include={"kind", "axis", "band", "motion", "turn"}) for item in evaluated],
            "given": None if planned else _given(scenario, program),
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


def _known(item: Any, scenario: Scenario) -> bool:
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
        "students": [student(free) for free in range(2, SERIES_FREEDOM)],
        "references": {name: _reference(archive, name) for name in names}, "longest": MAX_RUN_TIME,
    }  # fmt: skip


def _judged(scenario: Scenario, program: Program, folder: Path, resources: Path) -> dict[str, Any]:
    """What the page needs to say what it warns of: modes, and what its knobs have nothing to do with."""
    machine, coupling = scenario.machine, scenario.coupling
    modes, here = checked_modes(machine), plant_modes(machine)[0]
    omega, damping, peak = (locked_mode.tolist() for locked_mode in locked_modes(machine, modes))
    said = {
        *control(machine, judge(machine, modes), program), *exchange_stability(scenario, modes),
        *sentences(machine, program, resources),
    }  # fmt: skip
    ahead = [warning for warning in judged_ahead(scenario, program, fmus=folder) if warning not in said]
    own = machine.plant is not None or machine.transmitted or machine.mounts  # not the modes that the unit holds
    tables = {} if not own else {"table": _table(modes, machine), "pose": _table(here, machine)}
    scheme = SCHEMES[coupling.scheme]
    # Judged is all friction of an axis, wherever it acts.
    friction = {f"{name}.friction.{key}": value for name, axis in machine.axes.items()
                if axis.guide is not None and axis.guide.share
                for key, value in machine.shipped_friction(name, "a page").parameters().items()}  # fmt: skip
    return {
        "friction": friction, "reach": described(machine, program, resources), "modes": tables,
        "warnings": [str(warning) for warning in ahead],
        "locked": [list(entry) for entry in zip(omega, damping, peak, strict=True) if MOST_K_V * entry[2] > SHOWS],
        "scheme": {"name": scheme.name, "stable_share": scheme.stable_share, "substeps": coupling.substeps},
    }  # fmt: skip


def _table(modes: Modes, machine: Machine) -> dict[str, Any]:
    """Modes as the page has them from a table of its own."""
    rows = {kind: [modes.ports[f"{kind}_{axis}"].tolist() for axis in machine.axes] for kind in ("n", "x")}
    omega = (2 * np.pi * modes.frequency).tolist()
    return {"omega_0": omega, "damping": modes.damping.tolist(), "rotor": rows["n"], "scale": rows["x"]}


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


def _given(scenario: Scenario, program: Program) -> dict[str, Any]:
    """Setpoints that are carried along."""
    return {"rows": packed(rows(scenario, program).tobytes()), "segments": segments(program)}


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


def packed(file: bytes) -> str:
    """Compressed, base64; the same from the same bytes."""
    return base64.b64encode(gzip.compress(file, 9, mtime=0)).decode("ascii")
