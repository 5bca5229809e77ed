"""A machine as far as its files describe it: its structure must be had before the rest of the machine is complete."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import ConfigDict, Field, StrictStr

from feedsim.errors import InputError
from feedsim.fields import AxisName, File, Model, Quantity
from feedsim.files.checked import check, fetch, read_group
from feedsim.files.problems import dotted, in_order
from feedsim.files.source import Place, Source
from feedsim.scenario.load import load
from feedsim.scenario.machine import Machine
from feedsim.scenario.structure import Structure
from feedsim.scenario.structure.geometry import GeometryStructure
from feedsim.scenario.structure.load import STRUCTURE_FILE, load_structure
from feedsim.scenario.structure.matrices import FiniteElements

# Lengths that are typed twice are the same where they differ by less [m].
SAME_LENGTH = 1e-9


class _Beginning(Model):
    """Of a machine file that is not complete: its structure and the pose. Other keys stay unread."""

    model_config = ConfigDict(extra="ignore")

    name: StrictStr = Field(default="", description="Name in reports")
    note: StrictStr = Field(default="", description="Remark shown wherever the machine's numbers are shown")
    structure: File | None = Field(default=None, description="Structure file to compute the modes from")
    pose: dict[AxisName, Annotated[float, Quantity("m", example="800 mm")]] = Field(
        default={}, description="Axis positions at the start, to which the modes belong"
    )


@dataclass(frozen=True, eq=False)
class Described:
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


def load_described(path: str | Path) -> Described:
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
        return _alone(path)
    if "machine" in source.data:
        return _of_scenario(path)
    return _of_machine(path, source)


def _alone(path: Path) -> Described:
    structure = load_structure(path)
    pose = structure.pose if isinstance(structure, FiniteElements) else {}
    name = structure.name or path.stem
    return Described(name, structure.note, structure, None, None, dict(pose), (("structure", path),), ())


def _of_scenario(path: Path) -> Described:
    """Without a look for contradictions: a scenario may change single values of its machine on purpose."""
    scenario = load(path)
    machine = scenario.machine
    files = [(place or "scenario", file) for place, file in scenario.files]
    structure = None
    if machine.structure is not None:
        structure = load_structure(machine.structure)
        files.append(("structure", machine.structure))
    return Described(
        machine.name, machine.note, structure, machine, machine.modes, dict(machine.pose), tuple(files), ()
    )


def _of_machine(path: Path, source: Source) -> Described:
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
        return Described(machine.name, machine.note, None, machine, modes, dict(machine.pose), files, ())
    file = machine.structure
    structure = load_structure(file)
    if problems := list(_contradictions(source, machine, structure, file)):
        raise InputError.of(f"{path}: contradicts its structure", problems)
    machine = machine.model_copy(update={"modes": table} if table is not None else {})
    machine._directory = path.parent
    files = (("machine", path), ("structure", file))
    return Described(machine.name, machine.note, structure, machine, modes, dict(machine.pose), files, ())


def _incomplete(path: Path, modes: Path | None, gaps: list[str]) -> Described:
    """Of a machine file that is not complete the structure and the pose, which then must be right."""
    source, faults = read_group(path), list[str]()
    source.data = {key: value for key, value in source.data.items() if key in _Beginning.model_fields}
    fetch(source, _Beginning, (), faults)
    beginning = check(source, _Beginning, faults)
    if beginning is None or faults or beginning.structure is None:
        raise InputError.of(str(path), in_order(faults) or gaps)
    structure = load_structure(beginning.structure)
    return Described(
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
            f"{source.mark(place).where}: {dotted(place)}: {here}; "
            f"{other.mark(there_place).where}: {dotted(there_place)}: {there}"
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
