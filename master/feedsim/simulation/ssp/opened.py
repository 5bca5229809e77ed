"""An SSP file -> scenario, program and archives that feedsim runs: the same as where the file came from."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from feedsim.files.source import confine_references
from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.outputs import TemporaryFolder
from feedsim.motions.setpoints import RecordedGeometry
from feedsim.scenario import Scenario, load
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.unpacked import readable
from feedsim.simulation.nc import MAX_POSITION_CYCLES, Program, Segment, plan
from feedsim.simulation.ssp import archive, rebuilt, setpoints, system_structure
from feedsim.simulation.ssp.export import coupling_of_one, roles_of_one, split_one
from feedsim.simulation.ssp.rebuilt import STRUCTURE, Parts, values
from feedsim.simulation.ssp.roles import roles
from feedsim.simulation.ssp.setpoints import SETPOINTS_IN_ARCHIVE, Table, read_setpoints
from feedsim.simulation.ssp.system_structure import Structure
from feedsim.structure.assembly import SAME_POSITION
from feedsim.structure.pack import MODES_IN_ARCHIVE, MOUNTS_IN_ARCHIVE

WHOLE_CYCLE_TOLERANCE = 1e-6  # of a position cycle: a stop time this little behind an instant of the grid lies on it


@dataclass(frozen=True, eq=False)
class OpenedSystem:
    """What an SSP file asks for.

    Attributes:
        path: the SSP file.
        program: the setpoints of the file's own table; its segments are the motions, where the annotation shows them.
        fmus: folder with the file's own archives.
        warnings: what a user should know.
        sources: place in that folder -> what the archive there is called in the file.
    """

    scenario: Scenario
    program: Program
    path: Path
    fmus: Path
    warnings: tuple[Finding, ...]
    sources: Mapping[str, str]

    def all_findings(self, warnings: Iterable[Finding]) -> tuple[Finding, ...]:
        """The file's own warnings and those of a run of it, which then speak of the file as well."""
        named = self.named
        return (*self.warnings, *(
            replace(finding, text=named(finding.text), place=named(finding.place), remedy=named(finding.remedy))
            for finding in warnings
        ))  # fmt: skip

    def named(self, text: str) -> str:
        """A text that speaks of the file's parts by their names in it."""
        result = text
        for place, source in self.sources.items():
            result = result.replace(str(self.fmus / place), f"{self.path}: {source}")
        return _name_file(result, self.path, self.fmus)


@contextmanager
def refusals_of(path: Path) -> Iterator[None]:
    """A block whose refusals name the file, also those of a value deep in it."""
    try:
        yield
    except InputError as error:
        if str(path) in str(error) or path.name in str(error):
            raise
        raise InputError(f"{path}: {error}", error.problems) from error


@contextmanager
def open_system(path: Path, overrides: Sequence[str] = ()) -> Iterator[OpenedSystem]:
    """Read and check an SSP; what it unpacks to is removed when the block ends.

    `overrides`: KEY=VALUE as for a scenario, for all but the motions, which the file has as setpoints.

    Raises:
        InputError: not a readable SSP, or not of the units of Fig. 2; lists what is wrong.
    """
    with (
        archive.open_files(path) as files,
        TemporaryFolder() as folder,
        ExitStack() as stack,
    ):
        with refusals_of(path):
            structure = system_structure.read_structure(files[archive.STRUCTURE], f"{path}: {archive.STRUCTURE}")
            archives = _archives(structure, files, folder, path, stack)
            result = roles_of_one(structure, archives, str(path)) or roles(structure, archives, str(path))
            table = _table(archives[result.setpoint], f"{path}: {result.setpoint}")
            given = values(structure, files, archives, result.foreign, str(path))
            coupling = coupling_of_one(result, given, str(path))
            if coupling is not None:
                archives, given = split_one(result, archives, given)
            if problems := rebuilt.missing_parameters(result, given, str(path)):
                raise InputError.of(str(path), problems)
            own = rebuilt.annotation(structure.scenario, files, str(path))
            T_c, T_pos, guessed = rebuilt.cycles(result, archives, given, table, own, structure.step, str(path))
            parts = Parts(result, archives, given, table, T_c, T_pos, coupling)
            if problems := rebuilt.faults(parts, str(path)):
                raise InputError.of(str(path), problems)
            _lay_out(folder, files, parts, own, path)
            program = _sample_setpoints(parts, structure, path)
        with confine_references(folder), _own_names(path, folder):
            scenario, program, warnings = _with_motions(parts, own, program, path, folder, overrides)
            reported = (*_warn_late_start(structure, path), *_jumps(scenario, program, path), *warnings)
            if guessed:
                cycle = units.show(T_c, "s")
                text = f"{path.name}: no drive gives its control cycle; it is {cycle}, {guessed}"
                reported += (Finding("control-cycle-assumed", "doubt", text, path.name),)
            yield OpenedSystem(scenario, program, path, folder, reported, _sources(structure, parts, folder))


def _archives(
    structure: Structure, files: archive.Files, folder: Path, path: Path, stack: ExitStack
) -> dict[str, Archive]:
    """Component -> its archive, one for each source."""
    problems: list[str] = []
    by_source: dict[str, Archive] = {}
    names: dict[str, str] = {}
    for component in structure.components:
        try:
            source = names[component.name] = archive.resolve_source(component.source, files)
        except InputError as error:
            problems.append(f"{path}: component {component.name}: its source {component.source!r} {error}")
            continue
        if source in by_source:
            continue
        unpacked = folder / "archives" / str(len(by_source)) / PurePosixPath(source).name
        try:
            files.copy(source, unpacked)
            by_source[source] = stack.enter_context(Archive(unpacked, files.allowance))
        except InputError as error:
            problems.append(str(error).replace(str(unpacked), f"{path}: {source}"))
    if not structure.components:
        problems.append(f"{path}: {archive.STRUCTURE} has no components")
    if problems:
        raise InputError.of(str(path), problems)
    return {component: by_source[source] for component, source in names.items()}


def _table(setpoint: Archive, where: str) -> Table:
    try:
        content = (setpoint.directory / SETPOINTS_IN_ARCHIVE).read_bytes()
    except OSError:
        raise InputError(f"{where}: its archive has no {SETPOINTS_IN_ARCHIVE}") from None
    return read_setpoints(content, f"{where}: {SETPOINTS_IN_ARCHIVE}")


def _lay_out(folder: Path, files: archive.Files, parts: Parts, own: Mapping[str, Any] | None, path: Path) -> None:
    """Put archives, modes, setpoints and what the annotation names where the scenario's data look for them."""
    roles = parts.roles
    for component, name in parts.places.items():
        parts.archives[component].path.replace(folder / name)
    inside = {
        rebuilt.MODES_RESOURCE: (roles.plant, MODES_IN_ARCHIVE),
        rebuilt.SETPOINTS_RESOURCE: (roles.setpoint, SETPOINTS_IN_ARCHIVE),
    }
    for name, (component, place) in inside.items():
        source = parts.archives[component].directory / place
        if not source.is_file():
            raise InputError(f"{path}: {component}: its archive has no {place}")
        with readable(f"{path}: {component}: {place} cannot be unpacked"):
            shutil.copyfile(source, folder / name)
    mounts = parts.archives[roles.plant].directory / MOUNTS_IN_ARCHIVE
    if mounts.is_file():
        with readable(f"{path}: {roles.plant}: {MOUNTS_IN_ARCHIVE} cannot be unpacked"):
            shutil.copyfile(mounts, folder / rebuilt.MOUNTS_RESOURCE)
    needed = rebuilt.named_files(own)
    if own is not None and own["machine"].get("structure") == STRUCTURE:
        needed.append(STRUCTURE)
    for name in needed:
        files.copy(name, folder / name)


def _sources(structure: Structure, parts: Parts, folder: Path) -> dict[str, str]:
    places = parts.places
    return {
        places.get(component.name, str(parts.archives[component.name].path.relative_to(folder))): component.source
        for component in structure.components
    }


def _sample_setpoints(parts: Parts, structure: Structure, path: Path) -> Program:
    """What the controllers see of the setpoints: the rows at their position cycle, from start to stop."""
    table, T_pos = parts.table, parts.T_pos
    last = float(table.time[-1]) if structure.stop is None else structure.stop - structure.start
    cycles = np.ceil(last / T_pos - WHOLE_CYCLE_TOLERANCE)
    if not 1 <= cycles <= MAX_POSITION_CYCLES:
        raise InputError(
            f"{path}: it lasts {last:.6g} s, {cycles:.6g} position cycles; allowed: 1 to {MAX_POSITION_CYCLES}"
        )
    time = np.arange(int(cycles) + 1, dtype=np.float64) * T_pos
    rows = table.rows(time, parts.T_c)
    names = parts.roles.setpoints
    return Program(
        time,
        {axis: table.x_s[name][rows] for axis, name in names.items()},
        {axis: table.n_ffw[name][rows] for axis, name in names.items()},
    )


def _with_motions(
    parts: Parts, own: Mapping[str, Any] | None, program: Program, path: Path, folder: Path, overrides: Sequence[str]
) -> tuple[Scenario, Program, tuple[Finding, ...]]:
    """The scenario, and the program with the annotation's motions as its segments, if they are those of the table."""
    warnings: list[Finding] = []
    if own is not None and "motions" in own:
        data = rebuilt.scenario_data(parts, own, path.stem, folder, motions=True)
        before = _load(data, folder, path)
        planned = _plan_motions(before, program)
        if planned is not None and setpoints.setpoints_agree(planned.x_s, program.x_s):
            scenario = _load(data, folder, path, overrides)
            changed = _plan_motions(scenario, program) if overrides else planned
            if changed is None or not (
                _equal_setpoints(changed.x_s, planned.x_s) and _equal_setpoints(changed.n_ffw, planned.n_ffw)
            ):
                raise InputError(
                    f"{path}: {', '.join(f'--set {text}' for text in overrides)}: would change the setpoints, which "
                    "the file has as a table; change the scenario and export it anew (feedsim export)"
                )
            _check_cycles(scenario, parts, path)
            scenario, lost = setpoints.evaluation(scenario, planned, program)
            if lost:
                text = f"{path.name}: ends at {program.duration:.6g} s, too early for {', '.join(lost)}: left out"
                warnings.append(Finding("evaluation-left-out", "doubt", text, path.name))
            kept = setpoints.segments(planned, program)
            return scenario, Program(program.time, program.x_s, program.n_ffw, kept), tuple(warnings)
        warnings.append(Finding(
            "setpoints-of-other-motions", "doubt",
            f"{path.name}: its setpoints are not those of the motions that it names: they run as recorded ones, and "
            "what was to be evaluated is not",
            path.name,
        ))  # fmt: skip
    scenario = _load(rebuilt.scenario_data(parts, own, path.stem, folder, motions=False), folder, path, overrides)
    _check_cycles(scenario, parts, path)
    axes = parts.roles.axes
    segment = Segment(
        kind="setpoints",
        index=0,
        start=0.0,
        end=program.duration,
        description=f"setpoints of {parts.roles.setpoint} in {path.name}",
        origin={axis: float(program.x_s[axis][0]) for axis in axes},
        target={axis: float(program.x_s[axis][-1]) for axis in axes},
        axes=tuple(axis for axis in axes if np.any(program.x_s[axis] != program.x_s[axis][0])),
        geometry=RecordedGeometry(begin=0.0, end=program.duration, first=0.0, file=path, axes=axes),
    )
    return scenario, Program(program.time, program.x_s, program.n_ffw, (segment,)), tuple(warnings)


def _warn_late_start(structure: Structure, path: Path) -> list[Finding]:
    if structure.start == 0.0:
        return []
    start = units.show(structure.start, "s")
    text = f"{path.name}: starts at {start}; results count time from there: their 0 s is its {start}"
    return [Finding("start-time-shifted", "doubt", text, path.name)]


def _jumps(scenario: Scenario, program: Program, path: Path) -> list[Finding]:
    """Warnings about axes that do not stand where their setpoints begin."""
    return [
        Finding(
            "setpoints-jump", "doubt",
            f"{path.name}: axis {axis} stands at {units.show(x_0, 'm')}, its setpoints begin at "
            f"{units.show(float(program.x_s[axis][0]), 'm')}: it jumps there at once",
            axis,
        )
        for axis, x_0 in scenario.machine.pose.items()
        if abs(float(program.x_s[axis][0]) - x_0) > SAME_POSITION
    ]  # fmt: skip


def _check_cycles(scenario: Scenario, parts: Parts, path: Path) -> None:
    if scenario.machine.cycles.T_pos != parts.T_pos or tuple(scenario.machine.axes) != parts.roles.axes:
        raise InputError(f"{path}: neither axes nor position cycle can be changed: the file has a table of setpoints")


def _load(data: Mapping[str, Any], folder: Path, path: Path, overrides: Sequence[str] = ()) -> Scenario:
    file = folder / "scenario.yaml"
    file.write_text(json.dumps(data, ensure_ascii=False, indent=1), encoding="utf-8")
    scenario = load(file, overrides)
    scenario._file, scenario._files = path, (("", path),)
    scenario._origins = {place: _name_file(where, path, folder) for place, where in scenario._origins.items()}
    return scenario


def _plan_motions(scenario: Scenario, program: Program) -> Program | None:
    """The scenario's own setpoints, from where the table begins; None where its motions cannot be driven."""
    pose = {axis: float(x_s[0]) for axis, x_s in program.x_s.items()}
    try:
        machine = scenario.machine.model_copy(update={"pose": pose})
        return plan(scenario.model_copy(update={"machine": machine}))
    except InputError:
        return None


def _equal_setpoints(some: Mapping[str, Any], others: Mapping[str, Any]) -> bool:
    return set(some) == set(others) and all(np.array_equal(some[axis], others[axis]) for axis in some)


@contextmanager
def _own_names(path: Path, folder: Path) -> Iterator[None]:
    """Let errors speak of the SSP, not of the folder that it was unpacked to."""
    try:
        yield
    except InputError as error:
        raise InputError(
            _name_file(str(error), path, folder), [_name_file(problem, path, folder) for problem in error.problems]
        ) from None


def _name_file(text: str, path: Path, folder: Path) -> str:
    text = re.sub(rf"{re.escape(str(folder / 'scenario.yaml'))}(:\d+)?", lambda _: str(path), text)
    return text.replace(str(folder / "x")[:-1], f"{path}: ")
