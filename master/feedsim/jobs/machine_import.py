"""A machine file out of the files of a control."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

from feedsim.analysis import FigureTable
from feedsim.files.control.archive import MAX_FILE_BYTES, MAX_INCLUDED_BYTES, Archive, scalar
from feedsim.files.control.formats import parse_file
from feedsim.files.control.reading import Reading, read_values
from feedsim.files.source import content
from feedsim.foundation.arguments import pairs, spell_argument, split_names
from feedsim.foundation.errors import InputError, no_such_file
from feedsim.jobs.parameters import (
    NO_WATCH,
    Argument,
    AssumedValues,
    CheckedUnits,
    ControlAxes,
    ControlDrives,
    File,
    Force,
    Names,
    Option,
    Watch,
    job,
    output_option,
)
from feedsim.jobs.result import Kind, Result, claim_result_folder
from feedsim.report import control_import as page
from feedsim.scenario.imported import ImportedMachine, import_reading
from feedsim.scenario.machine import Machine

KIND = Kind("machine import", page.FILES, keeps=("*.yaml", "modes.csv"), main_file=Machine.IN_FOLDER)


@dataclass(frozen=True, eq=False)
class ImportedFiles:
    """A machine file with values of a control.

    archives: the files as they are. reading: values that were taken and refused. made: the machine file.
    """

    archives: Sequence[Archive]
    reading: Reading
    made: ImportedMachine


def result_of(value: ImportedFiles, inputs: Sequence[Path]) -> Result[ImportedFiles]:
    """A machine file with values of a control, and what of these was not taken. inputs: files of both."""
    archives, reading, made = value.archives, value.reading, value.made
    return Result(
        KIND,
        value,
        lambda: page.report_of(archives, reading, made, inputs),
        figures=FigureTable(page.figures_of(archives, reading, made)),
        details=lambda: page.details(archives, reading, made, inputs),
        files=lambda: {**made.files(), page.SHEET: page.sheet(reading, made)},
        inputs=inputs,
        lines=lambda: [f"  {line}" for line in page.answers(reading, made)],
    )


@job("fill a machine file from the files of a control")
def machine_import(
    files: Annotated[
        File | Sequence[File],
        Argument(
            "FILE",
            "files of one control: archive, machine data, parameters of drives, lists, INI (docs/controls.md)",
            many=True,
        ),
    ],
    axes: ControlAxes = None,
    machine: Annotated[
        File | None, Option("MACHINE", "machine file or folder that the values are laid into (default: a draft)")
    ] = None,
    *,
    drives: ControlDrives = None,
    assume: AssumedValues = None,
    checked: CheckedUnits = (),
    name: Annotated[str | None, Option("NAME", "of the machine in a draft (default: name of the file)")] = None,
    out: Annotated[File | None, output_option("machine_{files}")] = None,
    force: Force = False,
    watch: Watch = NO_WATCH,
) -> Result[ImportedFiles]:
    r"""Fill drive, limits, filters and compensations of a machine file from the files of a control.

    A value is taken where the file has it once, where it acts, and where a public source states its unit. All others
    are named with the reason. No value is guessed.

    Command line:
        feedsim example xz_circle
        feedsim machine import archive.arc --axes X1,Y1 --out my_machine
        feedsim machine import nc.tea ps000003.tea --axes X=X1 --machine machines/test_centre --out my_machine
        feedsim machine import mill.ini --axes X,Y,Z --out my_machine

    Raises:
        InputError: a file of no known kind, no such axis, a faulty machine.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> from pathlib import Path
    >>> data = ["N32200 $MA_POSCTRL_GAIN[0,AX1]=5", "N32300 $MA_MAX_AX_ACCEL[0,AX1]=2.5"]
    >>> size = Path("mill.tea").write_text("\n".join(data))
    >>> result = fs.machine_import("mill.tea", "X=AX1", "machines/test_centre")
    >>> [(each.parameter, each.value) for each in result.made.values]
    [('drive.K_v', 83.33333333333334), ('max_acceleration', 2.5)]
    """
    paths = [Path(entry) for entry in ([files] if isinstance(files, str | Path) else files)]
    base = None if machine is None else Path(machine)
    if base is not None and not base.exists():
        raise InputError(f"{spell_argument('machine')}: {no_such_file(base)}")
    archives = read_files(paths, watch)
    reading = read_values(
        archives,
        axes_of(axes, base, archives),
        places={axis: tuple(text.split("+")) for axis, text in pairs("drives", drives).items()},
        assume=parse_assumed_values(assume),
        checked=split_names(checked),
    )
    made = import_reading(reading, base, name or paths[0].stem)
    inputs = inputs_of(archives, base)
    result = result_of(ImportedFiles(archives, reading, made), inputs)
    # All inputs have been read: what a folder held before is said to be replaced only where it will be.
    with claim_result_folder(out, KIND, watch, inputs, (), force=force):
        if out is not None:
            result.save(out, force=force)
    return result


def read_files(paths: Sequence[Path], watch: Watch) -> list[Archive]:
    """The files of a control, and those that they include. InputError: of several controls, or of none."""
    archives: list[Archive] = []
    for k, path in enumerate(paths):
        watch.progress("reading", k, len(paths))
        if path.is_dir():
            raise InputError(f"{path} is a folder; name the files in it")
        archive = parse_file(path.name, content(path, MAX_FILE_BYTES), path, partial(_read_included_file, path.parent))
        others = {id(file): file for file in archive.included.values()}
        archives += [archive, *others.values()]
    return archives


def _read_included_file(folder: Path, word: str) -> tuple[Path, bytes]:
    """Path and content of a file that an INI file in the folder names; LinuxCNC looks for it from that folder on."""
    path = folder / os.path.expanduser(word)  # noqa: PTH111 - Path's ends in an exception where there is no such user
    real = os.path.realpath(path)
    if not Path(real).is_relative_to(os.path.realpath(folder)):
        raise InputError(f"{real} is outside of the folder of the INI file, {folder}, and not read; copy it into there")
    return Path(os.path.normpath(path)), content(path, MAX_INCLUDED_BYTES)


def parse_assumed_values(given: Names) -> Mapping[str, str]:
    """Parameter -> text of --assume. InputError: no value of a control."""
    result = pairs("assume", given)
    for key, text in result.items():
        try:
            scalar(text)
        except ValueError:
            raise InputError(
                f"{spell_argument('assume')} {key}={text}: a number, TRUE, FALSE or 'H..' is needed"
            ) from None
    return result


def axes_of(given: Names, machine: Path | None, archives: Sequence[Archive]) -> dict[str, str]:
    """Machine's axis -> the control's."""
    if isinstance(given, Mapping):
        return {str(key): str(value) for key, value in given.items()}
    texts = () if given is None else split_names(given)
    if not texts and machine is not None:
        from feedsim.scenario import load_machine

        return {axis: axis for axis in load_machine(machine).axes}
    if not texts:
        has = dict.fromkeys(entry.axis for archive in archives for entry in archive.entries if entry.axis)
        names = {axis: name for archive in archives for axis, name in archive.axis_names.items()}
        shown = ", ".join(f"{axis} ({names[axis]})" if axis in names else axis for axis in [*has][:40])
        raise InputError(
            f"{spell_argument('axes')}: which axes? The files have {shown or 'lists without an axis: name one, X'}"
        )
    result: dict[str, str] = {}
    for text in texts:
        axis, equals, theirs = (part.strip() for part in text.partition("="))
        if not axis or (equals and not theirs):
            raise InputError(
                f"{spell_argument('axes')} {text}: AXIS or AXIS=NAME IN THE CONTROL is needed, such as X=X1"
            )
        if axis in result:
            raise InputError(f"{spell_argument('axes')} {text}: {axis} is named twice")
        result[axis] = theirs or axis
    return result


def inputs_of(archives: Sequence[Archive], machine: Path | None) -> list[Path]:
    """Files of the control, and that of the machine."""
    own = [] if machine is None else [machine / Machine.IN_FOLDER if machine.is_dir() else machine]
    return [*(Path(archive.path) for archive in archives), *own]
