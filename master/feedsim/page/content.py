"""What a page holds of a scenario: module, machine, parameters, knobs, motions, what is evaluated; as JSON.

The machine is packed as for a run in one unit (:mod:`feedsim.cosim.whole`), and the page drives the same unit: there is
no wiring of its own. Motions are planned in the page where it knows them (moves, circles, dwells); setpoints of others
are carried along.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import math
from collections.abc import Mapping, Sequence
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
from feedsim.judge import check as judged_ahead
from feedsim.judge.exchange import exchange_stability
from feedsim.judge.loops import control
from feedsim.linear.judgement import SHOWS, judge, locked_modes
from feedsim.motions.circular import Circle, Circular
from feedsim.motions.dwell import Dwell
from feedsim.motions.move import Move, Straight
from feedsim.nc import Program
from feedsim.page import module, reach
from feedsim.page.knobs import Knob, chosen
from feedsim.scenario import CircleTest, Machine, Positioning, Scenario
from feedsim.scenario.coupling import SCHEMES
from feedsim.structure import Modes, checked_modes

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
        code = module.read(folder, archive.guid)
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
        *reach.sentences(machine, program, resources),
    }  # fmt: skip
    ahead = [warning for warning in judged_ahead(scenario, program, fmus=folder) if warning not in said]
    own = machine.plant is not None or machine.transmitted  # not the modes that the unit holds
    tables = {} if not own else {"table": _table(modes, machine), "pose": _table(here, machine)}
    scheme = SCHEMES[coupling.scheme]
    # Judged is all friction of an axis, wherever it acts.
    friction = {f"{name}.friction.{key}": value for name, axis in machine.axes.items()
                if axis.guide is not None and axis.guide.share
                for key, value in machine.shipped_friction(name, "a page").parameters().items()}  # fmt: skip
    return {
        "friction": friction, "reach": reach.described(machine, program, resources), "modes": tables,
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
