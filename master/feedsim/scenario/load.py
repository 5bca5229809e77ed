"""Scenario file -> Scenario: read, fetch the files it names, apply changes, check; every problem with its line."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import ConfigDict, Field, StrictStr

from feedsim.files.checked import (
    apply,
    as_text,
    check,
    check_tree,
    describe,
    dotted_key,
    entries,
    fetch,
    in_order,
    options,
    read_group,
    spread,
)
from feedsim.files.control import Name, find_name
from feedsim.files.fields import AxisName, File, FileContent, Model, Quantity, brief
from feedsim.files.source import Mark, Place, Source, is_program, places, read_yaml
from feedsim.foundation.arguments import spell_argument
from feedsim.foundation.errors import InputError, no_such_file
from feedsim.scenario.axis_units import Friction, FrictionParameters, GmsFriction
from feedsim.scenario.machine import Machine
from feedsim.scenario.model import Scenario, contradictions
from feedsim.scenario.roles import GMS
from feedsim.scenario.structure import FiniteElements, GeometryStructure, Structure
from feedsim.scenario.structure_checks import STRUCTURE_FILE, load_structure

# --- Keys and values of a control in scenario and machine files: MD32200: 4 in place of K_v: 4 (m/min)/mm -------------


def translate_change(key: str, value: Source) -> tuple[str, Source]:
    """A change by a control's number as one by our name; any other as it is.

    "machine.axes.Z.drive.MD32200", "Z.MD32200" and "MD32200" (all axes) mean the same parameter. InputError: the
    number's unit is not confirmed, or the value is no number.
    """
    prefix, _, number = key.rpartition(".")
    name = find_name(number)
    if name is None:
        return key, value
    where = prefix.removesuffix(".drive")
    if name.parameter.startswith("cycles."):
        where = "machine"
    elif "axes" not in where.split("."):
        where = f"machine.axes.{where or '*'}"
    text = _text(name, value.data, f"{value.mark(()).where}: ")
    return f"{where}.{name.parameter}", Source(text, {(): value.mark(())})


def translate(source: Source, axes: Place, faults: list[str]) -> None:
    """Replace a control's numbers below the axes (a place of the tree) by our names, in axes and in their drives."""
    groups: Any = source.data
    for key in axes:
        groups = groups.get(key) if isinstance(groups, dict) else None
    for axis, group in groups.items() if isinstance(groups, dict) else ():
        for place in ((*axes, axis), (*axes, axis, "drive")):
            inner = group if place[-1] == axis else group.get("drive") if isinstance(group, dict) else None
            for key in [*inner] if isinstance(inner, dict) else ():
                if (name := find_name(key)) is not None:
                    _rename(source, (*axes, axis), (*place, key), name, faults)


def _rename(source: Source, axis: Place, place: Place, name: Name, faults: list[str]) -> None:
    mark = source.mark(place)
    parent: Any = source.data
    for key in place[:-1]:
        parent = parent[key]
    value = parent.pop(place[-1])
    source.forget(place)
    at = axis
    group: Any = source.data
    for key in axis:
        group = group[key]
    *way, last = name.parameter.split(".")
    for step in way:
        at = (*at, step)
        if not isinstance(group.get(step), dict):
            if step in group:
                faults.append(describe(source, at, f"has no {name.number} inside"))
                return
            group[step] = {}
            source.marks[at] = mark
        group = group[step]
    if last in group:
        faults.append(f"{mark.where}: {name.number} is {name.parameter}, which is given as well; give one of them")
        return
    try:
        group[last] = _text(name, value, f"{mark.where}: ")
    except InputError as error:
        faults += error.problems
        group[last] = value
    source.marks[(*at, last)] = mark


def _text(name: Name, value: Any, where: str) -> Any:
    """The value in SI as our files have it."""
    ours = name.parameter.rpartition(".")[2]
    if not name.confirmed:
        raise InputError(
            f"{where}{name.number} is {ours}, but its unit is not confirmed by a public source ({name.source}); "
            f"give {ours} with its unit"
        )
    if name.codes:
        known = {code: ours for code, ours in name.codes}
        if isinstance(value, bool) or value not in known:
            raise InputError(f"{where}{name.number} is {brief(value)}; of {', '.join(map(str, known))}")
        return known[value]
    if not name.si and name.unit != "1" and value in (0, 1, False, True):
        return bool(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(
            f"{where}{name.number} is {brief(value)}; a number in the control's unit, {name.unit}, is expected"
        )
    return value if not name.si else f"{name.ours(value)!r} {name.si}"


# --- Scenario file -> Scenario: read, fetch the files it names, apply changes, check; every problem with its line -----


Setting = tuple[str, Source]  # dotted key, value


def load(path: str | Path, overrides: Sequence[str] = ()) -> Scenario:
    """Read and check a scenario file.

    `overrides` are KEY=VALUE texts as behind `--set`: dotted keys, values as in the file; or names of files with a
    group `set`. They count after the scenario's own `set` group. File names in them are relative to the working folder,
    those in a file relative to it.

    Raises InputError that lists every problem with file and line.

    >>> import feedsim as fs
    >>> fs.load_scenario("xz_circle.yaml", ["motions.0.radius=20 mm"]).motions[0].radius
    0.02
    """
    draft = draft_scenario(Path(path), overrides)
    draft.settle()
    return draft.scenario()


load_scenario = load  # its name in `import feedsim`


@dataclass
class Draft:
    """A scenario before it is checked: the tree of its files and what is changed in it.

    Attributes:
        path: scenario file.
        source: the tree, with the files it names; changed by `settle` and `apply`.
        own: settings of the file's `set` group, which come first.
        outside: settings from outside, the machine not among them; they count after the file's own.
        overrides: the settings from outside as KEY=VALUE.
        faults: what is wrong so far.
        changed: places that were set, with what has set them.
    """

    path: Path
    source: Source
    own: tuple[Setting, ...]
    outside: tuple[Setting, ...]
    overrides: tuple[str, ...]
    faults: list[str]
    changed: list[tuple[Place, str]] = field(default_factory=list)

    def copy(self) -> Draft:
        """One that can be changed without changing this one."""
        return replace(self, source=self.source.copy(), faults=[*self.faults], changed=[*self.changed])

    def settle(self) -> None:
        """Apply the file's own settings and those from outside."""
        self.apply((*self.own, *self.outside))

    def apply(self, settings: Iterable[Setting]) -> None:
        """Apply further settings."""
        for key, value in settings:
            with _collect_faults(self.faults):
                key, value = translate_change(key, value)
                for place in apply(self.source, Scenario, key, value):
                    self.changed.append((place, value.mark(()).where))
                    fetch(self.source, Scenario, place, self.faults)

    def scenario(self) -> Scenario:
        """Check what there is. InputError lists every problem with file and line."""
        source, faults = self.source, [*self.faults]
        scenario = check(source, Scenario, faults)
        if scenario is not None:
            faults += [describe(source, place, message) for place, message in contradictions(scenario)]
        if faults or scenario is None:
            raise InputError.of(str(self.path), in_order(faults))
        scenario._file = self.path
        scenario._overrides = self.overrides
        scenario._origins = {place: mark.where for place, mark in source.marks.items()}
        scenario._changes = tuple(self.changed)
        scenario._settings = tuple(f"{key}={as_text(value.data)}" for key, value in self.own)
        scenario._files = tuple(_files(source, self.path))
        scenario.machine._directory = source.mark(("machine",)).folder
        return scenario


def draft_scenario(path: Path, overrides: Sequence[str] = (), settings: Sequence[Setting] = ()) -> Draft:
    """Read a scenario file and the files it names; nothing is set yet but the machine.

    `settings` come from outside too, before the `overrides`. InputError: the scenario file itself cannot be read.
    """
    source = _of_program(path) if is_program(path) else read_group(path)
    _spell_out_programs(source)
    faults: list[str] = []
    outside = [*settings]
    given: list[str] = []
    for text in overrides:
        with _collect_faults(faults):
            given += spread([text])
            outside += options(text, Path())
    # A machine chosen from outside comes first: the scenario's own settings then meet that machine.
    for key, value in outside:
        if key == "machine":
            source.put(("machine",), value)
    if is_program(path) and "machine" not in source.data:
        raise InputError(
            f"{path}: an NC program needs a machine: {spell_argument('machine')} MACHINE, a machine file or its folder"
        )
    own = tuple(_own_settings(source, faults))
    fetch(source, Scenario, (), faults)
    translate(source, ("machine", "axes"), faults)
    others = tuple((key, value) for key, value in outside if key != "machine")
    texts = (*(f"{key}={as_text(value.data)}" for key, value in settings), *given)
    return Draft(path, source, own, others, texts, faults)


def _of_program(path: Path) -> Source:
    """The scenario of an NC program that is run by itself: one motion, its contour evaluated."""
    if not path.is_file():
        raise InputError(no_such_file(str(path)))
    data = {
        "name": path.stem,
        "motions": [{"kind": "program", "file": path.name}],
        "evaluate": [{"kind": "contour"}],
    }
    return Source(data, {place: Mark(str(path), path.parent) for place in places(data)})


def _spell_out_programs(source: Source) -> None:
    """A motion {program: part.mpf} is one of kind program with that file."""
    motions = source.data.get("motions") if isinstance(source.data, dict) else None
    for i, motion in enumerate(motions if isinstance(motions, list) else ()):
        if isinstance(motion, dict) and "program" in motion and "kind" not in motion and "file" not in motion:
            mark = source.mark(("motions", i, "program"))
            source.forget(("motions", i, "program"))
            motion |= {"kind": "program", "file": motion.pop("program")}
            source.marks |= {("motions", i, key): mark for key in ("kind", "file")}


def load_machine(path: str | Path, overrides: Sequence[str] = ()) -> Machine:
    """Read and check a machine: a machine file, or a folder with a machine.yaml.

    `overrides` as for load(), with the keys of the machine; "machine.axes.Z..." is the same as "axes.Z...". Raises
    InputError like load().

    >>> import feedsim as fs
    >>> fs.load_machine("machines/test_centre", ["axes.Z.friction.F_C=1.8 N.m"]).axes["Z"].friction.F_C
    1.8
    """
    path = Path(path)
    path = path / Machine.IN_FOLDER if path.is_dir() else path
    source = read_group(path)
    faults: list[str] = []
    fetch(source, Machine, (), faults)
    translate(source, ("axes",), faults)
    for text in overrides:
        with _collect_faults(faults):
            for given in options(text, Path()):
                key, value = translate_change(*given)
                for place in apply(source, Machine, key.removeprefix("machine."), value):
                    fetch(source, Machine, place, faults)
    machine = check(source, Machine, faults)
    if faults or machine is None:
        raise InputError.of(str(path), in_order(faults))
    machine._files = tuple(_files(source, path))
    machine._directory = path.parent
    return machine


def read_friction(path: str | Path) -> FrictionParameters:
    """Read a file with the friction of one axis, as identification leaves it. Raises InputError like load()."""
    source = read_group(Path(path))
    return check_tree(source, GmsFriction if source.data.get("law") == GMS else Friction, path)


@dataclass(frozen=True, eq=False)
class Subject:
    """A machine, and where it comes from.

    Attributes:
        kind: "scenario" or "machine".
        name: of the scenario or the machine.
        file: that was named.
        notes: remarks to be shown wherever the numbers are.
        settings: what the scenario itself sets, as KEY=VALUE.
        overrides: what was set from outside, as KEY=VALUE.
        files: what was read, each with what it is.
        scenario: None where a machine was named.
    """

    machine: Machine
    kind: str
    name: str
    file: Path
    notes: tuple[str, ...]
    settings: tuple[str, ...]
    overrides: tuple[str, ...]
    files: tuple[tuple[str, Path], ...]
    scenario: Scenario | None = None


def load_subject(path: str | Path, overrides: Sequence[str] = ()) -> Subject:
    """Read a scenario file, a machine file, or a folder with a machine.yaml; which of them is known by its keys.

    `overrides` as for load(); for a machine, with or without "machine." ahead. Raises InputError like load().
    """
    path = Path(path)
    settings: tuple[str, ...]
    scenario = None
    if path.is_dir() or _is_machine(path):
        machine = load_machine(path, overrides)
        file = path / Machine.IN_FOLDER if path.is_dir() else path
        files = tuple((place or "machine", named) for place, named in machine.files)
        name, kind, notes, settings = machine.name, "machine", [machine.note], ()
    else:
        scenario = load(path, overrides)
        machine, file = scenario.machine, scenario.file
        files = tuple((place or "scenario", named) for place, named in scenario.files)
        name, kind, notes, settings = scenario.name, "scenario", [machine.note, scenario.note], scenario.settings
    kept = tuple(note for note in notes if note)
    files = (*files, ("modes", machine.modes.file))
    if machine.mounts is not None:
        files = (*files, ("mounts", machine.mounts.table))
    return Subject(machine, kind, name, file, kept, settings, tuple(spread(overrides)), files, scenario)


def _is_machine(path: Path) -> bool:
    if is_program(path):
        return False
    data = read_yaml(path).data
    return isinstance(data, dict) and "axes" in data and "machine" not in data


def _files(source: Source, path: Path) -> Iterator[tuple[str, Path]]:
    """The scenario file and every other one that values come from, with the place nearest to the root."""
    seen = {str(path)}
    yield "", path
    for place, mark in sorted(source.marks.items(), key=lambda item: len(item[0])):
        file, colon, line = mark.where.rpartition(":")
        if colon and line.isdecimal() and not file.startswith("--set ") and file not in seen:
            seen.add(file)
            yield ".".join(str(key) for key in place), Path(file)


def _own_settings(source: Source, faults: list[str]) -> Iterator[tuple[str, Source]]:
    """Take the `set` group out of the tree."""
    settings = source.data.get("set")
    place: Place = ("set",)
    if settings is not None and not isinstance(settings, dict):
        faults.append(describe(source, place, f"a group of KEY: VALUE is expected, not {brief(settings)}"))
    elif settings:
        yield from entries(source, "set")
    source.data.pop("set", None)
    source.forget(place)


@contextmanager
def _collect_faults(faults: list[str]) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        faults += error.problems


# --- A machine as far as its files describe it: its structure must be had before the rest of the machine is
#     complete


# Lengths that are typed twice are the same where they differ by less [m].
SAME_LENGTH = 1e-9


class _MachineBeginning(Model):
    """Of a machine file that is not complete: its structure and the pose. Other keys stay unread."""

    model_config = ConfigDict(extra="ignore")

    name: StrictStr = Field(default="", description="Name in reports")
    note: StrictStr = Field(default="", description="Remark shown wherever the machine's numbers are shown")
    structure: File | None = Field(default=None, description="Structure file to compute the modes from")
    pose: dict[AxisName, Annotated[float, Quantity("m", example="800 mm")]] = Field(
        default={}, description="Axis positions at the start, to which the modes belong"
    )


@dataclass(frozen=True, eq=False)
class MachineDescription:
    """What there is of a machine.

    Attributes:
        structure: None where the machine has a table of modes alone.
        machine: None where there is a structure file alone, or the machine file is not complete.
        modes: table of modes; None where there is none (yet).
        pose: axis -> position [m]; empty where the files give none.
        files: what was read, each with what it is; the table of modes is not among them.
        gaps: what the machine file lacks, or is wrong in it, if that does not concern the structure.
    """

    name: str
    note: str
    structure: Structure | None
    machine: Machine | None
    modes: Path | None
    pose: Mapping[str, float]
    files: tuple[tuple[str, Path], ...]
    gaps: tuple[str, ...]


def load_described(path: str | Path) -> MachineDescription:
    """Read a machine file, a structure file, a folder with either, or a scenario's machine.

    A machine file need not be complete, nor its table of modes be there, if it names a structure.

    Raises:
        InputError: neither is there; what is there is wrong; machine and structure contradict one another.
    """
    path = Path(path)
    if path.is_dir():
        paths = [path / name for name in (Machine.IN_FOLDER, STRUCTURE_FILE) if (path / name).is_file()]
        if not paths:
            raise InputError(f"{path}: no {Machine.IN_FOLDER} and no {STRUCTURE_FILE} in this folder")
        path = paths[0]
    source = read_group(path)
    if "kind" in source.data or path.name == STRUCTURE_FILE:
        return _describe_structure(path)
    if "machine" in source.data:
        return _of_scenario(path)
    return _of_machine(path, source)


def _describe_structure(path: Path) -> MachineDescription:
    structure = load_structure(path)
    pose = structure.pose if isinstance(structure, FiniteElements) else {}
    name = structure.name or path.stem
    return MachineDescription(name, structure.note, structure, None, None, dict(pose), (("structure", path),), ())


def _of_scenario(path: Path) -> MachineDescription:
    """Without a look for contradictions: a scenario may change single values of its machine on purpose."""
    scenario = load(path)
    machine = scenario.machine
    files = [(place or "scenario", file) for place, file in scenario.files]
    structure = None
    if machine.structure is not None:
        structure = load_structure(machine.structure)
        files.append(("structure", machine.structure))
    return MachineDescription(
        machine.name, machine.note, structure, machine, machine.modes.file, dict(machine.pose), tuple(files), ()
    )


def _of_machine(path: Path, source: Source) -> MachineDescription:
    # A table that is yet to be built is no fault of the file: any file that is there stands in for it.
    data = source.data
    table = path.parent / data["modes"] if isinstance(data.get("modes"), str) and data["modes"] else None
    there = table is not None and table.is_file()
    if not there and isinstance(data.get("modes", ""), str):
        data["modes"] = path.name
    faults: list[str] = []
    fetch(source, Machine, (), faults)
    machine = check(source, Machine, faults)
    faults = in_order(faults)
    modes = table if there else None
    if machine is None or faults:
        return _incomplete(path, modes, faults)
    if machine.structure is None:
        if modes is None:
            missing = f"no such file: {table}" if table else "missing"
            raise InputError(
                f"{path}: modes: {missing}; and there is no key structure, from whose file it could be computed"
            )
        files: tuple[tuple[str, Path], ...] = (("machine", path),)
        return MachineDescription(machine.name, machine.note, None, machine, modes, dict(machine.pose), files, ())
    file = machine.structure
    structure = load_structure(file)
    if problems := list(_contradictions(source, machine, structure, file)):
        raise InputError.of(f"{path}: contradicts its structure", problems)
    machine = machine.model_copy(update={"modes": FileContent.read(table)} if table is not None else {})
    machine._directory = path.parent
    files = (("machine", path), ("structure", file))
    return MachineDescription(machine.name, machine.note, structure, machine, modes, dict(machine.pose), files, ())


def _incomplete(path: Path, modes: Path | None, gaps: list[str]) -> MachineDescription:
    """Of a machine file that is not complete the structure and the pose, which then must be right."""
    source, faults = read_group(path), list[str]()
    source.data = {key: value for key, value in source.data.items() if key in _MachineBeginning.model_fields}
    fetch(source, _MachineBeginning, (), faults)
    beginning = check(source, _MachineBeginning, faults)
    if beginning is None or faults or beginning.structure is None:
        raise InputError.of(str(path), in_order(faults) or gaps)
    structure = load_structure(beginning.structure)
    return MachineDescription(
        name=beginning.name or structure.name or path.stem,
        note=beginning.note or structure.note,
        structure=structure,
        machine=None,
        modes=modes,
        pose=dict(beginning.pose),
        files=(("machine", path), ("structure", beginning.structure)),
        gaps=tuple(gaps),
    )


def _contradictions(source: Source, machine: Machine, structure: Structure, file: Path) -> Iterator[str]:
    """What machine file and structure file both say, and do not say alike; both places are named."""
    other = read_group(file)

    def both(place: Place, here: str, there_place: Place, there: str) -> str:
        return (
            f"{source.mark(place).where}: {dotted_key(place)}: {here}; "
            f"{other.mark(there_place).where}: {dotted_key(there_place)}: {there}"
        )

    axes = tuple(structure.axes) if isinstance(structure, (GeometryStructure, FiniteElements)) else ()
    if tuple(machine.axes) != axes:
        same = sorted(machine.axes) == sorted(axes)
        what = "another order" if same else "other axes"
        yield both(("axes",), ", ".join(machine.axes), ("axes",), f"{', '.join(axes) or 'none'} ({what})")
    if not isinstance(structure, GeometryStructure):
        return
    for name, axis in machine.axes.items():
        theirs = structure.axes.get(name)
        if theirs is None:
            continue
        if abs(axis.pitch - theirs.drive.pitch) > SAME_LENGTH:
            yield both(
                ("axes", name, "pitch"), _mm(axis.pitch), ("axes", name, "drive", "pitch"), _mm(theirs.drive.pitch)
            )
        if any(abs(a - b) > SAME_LENGTH for a, b in zip(axis.travel, theirs.travel, strict=True)):
            place = ("axes", name, "travel")
            yield both(place, _mm(*axis.travel), place, _mm(*theirs.travel))


def _mm(*lengths: float) -> str:
    return " to ".join(f"{1e3 * length:.9g}" for length in lengths) + " mm"
