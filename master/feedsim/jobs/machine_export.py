"""Values of a machine file written back into the files of a control."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path
from typing import Annotated, Any

from feedsim.analysis import FigureTable
from feedsim.files.control import names_of
from feedsim.files.control.archive import Archive
from feedsim.files.control.reading import Value
from feedsim.files.control.writing import WrittenFiles, change_files
from feedsim.foundation.arguments import pairs, spell_argument, split_names
from feedsim.foundation.errors import InputError
from feedsim.jobs.machine_import import axes_of, inputs_of, parse_assumed_values, read_files
from feedsim.jobs.parameters import (
    NO_WATCH,
    Argument,
    AssumedValues,
    CheckedUnits,
    ControlAxes,
    ControlDrives,
    File,
    Force,
    Option,
    Watch,
    job,
    output_option,
)
from feedsim.jobs.result import Kind, Result, claim_result_folder
from feedsim.report import control_export as page
from feedsim.scenario import load_machine
from feedsim.scenario.machine import Machine

KIND = Kind("machine export", (page.SHEET,))


@dataclass(frozen=True, eq=False)
class ExportedFiles:
    """Files of a control with values of a machine file.

    archives: the files as they were. written: files with changed values, and every difference. machine: whose values
    they are. axes: of the machine -> those of the control.
    """

    archives: Sequence[Archive]
    written: WrittenFiles
    machine: Machine
    axes: Mapping[str, str]


def result_of(value: ExportedFiles, inputs: Sequence[Path]) -> Result[ExportedFiles]:
    """Files of a control with values of a machine file, and what is to be typed. inputs: files of both."""
    written, machine, axes = value.written, value.machine, value.axes
    return Result(
        KIND,
        value,
        lambda: page.report_of(value.archives, written, machine, axes, inputs),
        figures=FigureTable(page.figures_of(written)),
        details=lambda: page.details(written, machine, axes, inputs),
        files=lambda: {**page.name_contents(written.contents), page.SHEET: page.sheet(written)},
        inputs=inputs,
        lines=lambda: [f"  {line}" for line in (*page.answers(written, axes), *page.change_lines(written))],
    )


@job("write values of a machine into files of a control")
def machine_export(
    machine: Annotated[File, Argument("MACHINE", "machine file, or a folder with a machine.yaml")],
    like: Annotated[File | Sequence[File], Option("FILE", "files of the control as it is now", several=True)],
    axes: ControlAxes = None,
    *,
    drives: ControlDrives = None,
    assume: AssumedValues = None,
    checked: CheckedUnits = (),
    out: Annotated[File | None, output_option("export_{machine}")] = None,
    force: Force = False,
    watch: Watch = NO_WATCH,
) -> Result[ExportedFiles]:
    r"""Write the values of a machine file into copies of a control's files, and a sheet of old and new values.

    The bytes of changed values differ, and no others. What cannot be written stands on the sheet, to be typed.

    Command line:
        feedsim machine export my_machine --like archive.tea --axes X=X1,Y=Y1 --out to_load
        feedsim machine export my_machine --like nc.tea ps000003.tea --axes X=X1 --drives X=PS000003 --out to_load

    Raises:
        InputError: a faulty machine, one of another control, files as of :func:`feedsim.machine_import`, a change that
            would change another value.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> from pathlib import Path
    >>> size = Path("mill.tea").write_text("N32200 $MA_POSCTRL_GAIN[0,AX1]=5 ; gain\n")
    >>> result = fs.machine_export("machines/test_centre", "mill.tea", "X=AX1")
    >>> result.written.contents["mill.tea"]
    b'N32200 $MA_POSCTRL_GAIN[0,AX1]=4 ; gain\n'
    """
    paths = [Path(entry) for entry in ([like] if isinstance(like, str | Path) else like)]
    base = Path(machine)
    own = load_machine(base)
    archives = read_files(paths, watch)
    names = [archive.name for archive in archives]
    if twice := next((name for name in names if names.count(name) > 1), ""):
        raise InputError(f"{spell_argument('like')}: two files are called {twice}; their copies stand in one folder")
    if own.control and own.control != archives[0].control:
        raise InputError(f"{base}: is of the control {own.control}, the files are of {archives[0].control}")
    chosen = axes_of(axes, base, archives)
    for axis in chosen:
        if axis not in own.axes:
            raise InputError(f"{base}: has no axis {axis!r}; it has {', '.join(own.axes)}")
        own.shipped_drive(axis, "an export to a control")
    written = change_files(
        archives,
        chosen,
        {axis: values_of(own, archives[0].control, axis) for axis in chosen},
        places={axis: tuple(text.split("+")) for axis, text in pairs("drives", drives).items()},
        assume=parse_assumed_values(assume),
        checked=split_names(checked),
    )
    inputs = inputs_of(archives, base)
    result = result_of(ExportedFiles(archives, written, own, chosen), inputs)
    # All inputs have been read: what a folder held before is said to be replaced only where it will be.
    kind = replace(KIND, may_write=(*KIND.may_write, *page.names_of_written_files(names)))
    with claim_result_folder(out, kind, watch, inputs, force=force):
        if out is not None:
            result.save(out, force=force)
    return result


def values_of(machine: Machine, control: str, axis: str) -> dict[str, Value]:
    """Our parameter -> SI value of an axis, of all that the control has a name for."""
    result: dict[str, Value] = {}
    for parameter in names_of(control):
        value = reduce(_value_inside, parameter.split("."), machine.axes[axis])
        if isinstance(value, bool | int | float | str):
            result[parameter] = float(value) if isinstance(value, int) and not isinstance(value, bool) else value
    return result


def _value_inside(value: Any, step: str) -> Any:
    if step.isdecimal() and isinstance(value, tuple):
        return value[int(step)] if int(step) < len(value) else None
    return getattr(value, step, None)
