"""Scenario file -> Scenario: read, fetch the files it names, apply changes, check; every problem with its line."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from feedsim.arguments import spelt
from feedsim.errors import InputError, no_such_file
from feedsim.fields import brief
from feedsim.files import changes
from feedsim.files.checked import check, checked, fetch, read_group
from feedsim.files.problems import describe, in_order
from feedsim.files.source import Mark, Place, Source, is_program, places, read
from feedsim.scenario.axis_units import Friction, FrictionParameters, GmsFriction
from feedsim.scenario.control_keys import translate, translated
from feedsim.scenario.machine import Machine
from feedsim.scenario.model import Scenario, contradictions
from feedsim.scenario.roles import GMS

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
    draft = drafted(Path(path), overrides)
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
            with _collecting(self.faults):
                key, value = translated(key, value)
                for place in changes.apply(self.source, Scenario, key, value):
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
        scenario._settings = tuple(f"{key}={changes.as_text(value.data)}" for key, value in self.own)
        scenario._files = tuple(_files(source, self.path))
        scenario.machine._directory = source.mark(("machine",)).folder
        return scenario


def drafted(path: Path, overrides: Sequence[str] = (), settings: Sequence[Setting] = ()) -> Draft:
    """Read a scenario file and the files it names; nothing is set yet but the machine.

    `settings` come from outside too, before the `overrides`. InputError: the scenario file itself cannot be read.
    """
    source = _of_program(path) if is_program(path) else read_group(path)
    _spell_out_programs(source)
    faults: list[str] = []
    outside = [*settings]
    given: list[str] = []
    for text in overrides:
        with _collecting(faults):
            given += changes.spread([text])
            outside += changes.options(text, Path())
    # A machine chosen from outside comes first: the scenario's own settings then meet that machine.
    for key, value in outside:
        if key == "machine":
            source.put(("machine",), value)
    if is_program(path) and "machine" not in source.data:
        raise InputError(
            f"{path}: an NC program needs a machine: {spelt('machine')} MACHINE, a machine file or its folder"
        )
    own = tuple(_own_settings(source, faults))
    fetch(source, Scenario, (), faults)
    translate(source, ("machine", "axes"), faults)
    others = tuple((key, value) for key, value in outside if key != "machine")
    texts = (*(f"{key}={changes.as_text(value.data)}" for key, value in settings), *given)
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
        with _collecting(faults):
            for given in changes.options(text, Path()):
                key, value = translated(*given)
                for place in changes.apply(source, Machine, key.removeprefix("machine."), value):
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
    return checked(source, GmsFriction if source.data.get("law") == GMS else Friction, path)


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
    files = (*files, ("modes", machine.modes))
    if machine.mounts is not None:
        files = (*files, ("mounts", machine.mounts.table))
    return Subject(machine, kind, name, file, kept, settings, tuple(changes.spread(overrides)), files, scenario)


def _is_machine(path: Path) -> bool:
    if is_program(path):
        return False
    data = read(path).data
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
        yield from changes.entries(source, "set")
    source.data.pop("set", None)
    source.forget(place)


@contextmanager
def _collecting(faults: list[str]) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        faults += error.problems
