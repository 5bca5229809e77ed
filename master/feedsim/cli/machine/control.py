"""``feedsim machine import`` and ``export``: machine files and the files of a control."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import QUIET_OPTION, Command, Option, out
from feedsim.cli.terminal import call, finish

IMPORT_DESCRIPTION = """Drive, limits, filters and compensations of a machine file from the files of a control. A value
is taken where the file has it once, where it acts, and where a public source states its unit. All others are named with
the reason, and so is what the machine file needs besides."""
IMPORT_EPILOG = """examples:
  feedsim example xz_circle
  feedsim machine import archive.arc --axes X1,Y1 --out my_machine
  feedsim machine import nc.tea ps000003.tea --axes X=X1 --machine machines/test_centre --out my_machine
  feedsim machine import mill.ini --axes X,Y,Z --out my_machine
"""


def import_(options: Namespace) -> None:
    """feedsim machine import."""
    from feedsim.jobs.machine_import import machine_import

    out: Path = options.out or Path("results") / f"machine_{options.files[0].stem}"
    result = call(machine_import, options, out=out)
    head = f"{', '.join(archive.name for archive in result.archives)} -> {out / 'machine.yaml'}"
    finish(options.quiet, result.findings, head, *result.lines)


EXPORT_DESCRIPTION = """Write the values of a machine file into copies of a control's files, and a sheet of old and new
values. The bytes of changed values differ, and no others. What cannot be written stands on the sheet, to be typed."""
EXPORT_EPILOG = """examples:
  feedsim machine export my_machine --like archive.tea --axes X=X1,Y=Y1 --out to_load
  feedsim machine export my_machine --like nc.tea ps000003.tea --axes X=X1 --drives X=PS000003 --out to_load
"""


def export(options: Namespace) -> None:
    """feedsim machine export."""
    from feedsim.jobs.machine_export import machine_export

    out: Path = options.out or Path("results") / f"export_{options.machine.stem}"
    result = call(machine_export, options, out=out)
    finish(options.quiet, result.findings, f"{result.machine.name} -> {out / 'sheet.csv'}", *result.lines)


FILES = Option("files", "FILE", "files of one control: archive, machine data, parameters of drives, lists, INI "
               "(docs/control_files.md)", nargs="+", type=Path)  # fmt: skip
AXES = Option(
    "--axes", "NAMES", "axes of the control, X1,Y1; with the machine's name ahead where it is another one, X=X1,Y=Y1 "
    "(default: the axes of the machine)",
)  # fmt: skip
DRIVES = Option("--drives", "AXIS=LIST", "which drive object or list is that of an axis, such as X=PS000003,Y=PS000004")
ASSUME = Option(
    "--assume", "NAME=VALUE", "value of a parameter that the files do not have, such as FFW_MODE=3; may be given "
    "several times", many=True,
)  # fmt: skip
CHECKED = Option(
    "--checked", "NUMBERS", "numbers whose unit you have checked at the control, such as MD32810,MD32000, or all",
    default="",
)  # fmt: skip

IMPORT = Command(
    "import",
    "fill a machine file from the files of a control",
    import_,
    (
        FILES, AXES,
        Option("--machine", "MACHINE", "machine file or folder that the values are laid into (default: a draft)",
               type=Path),
        DRIVES, ASSUME, CHECKED,
        Option("--name", "NAME", "of the machine in a draft (default: name of the file)"),
        out("machine_<name of the file>"), QUIET_OPTION,
    ),
    IMPORT_DESCRIPTION,
    IMPORT_EPILOG,
    job="machine_import",
)  # fmt: skip
EXPORT = Command(
    "export",
    "write values of a machine file into copies of a control's files",
    export,
    (
        Option("machine", "MACHINE", "machine file, or a folder with a machine.yaml", type=Path),
        Option("--like", "FILE", "files of the control as it is now", nargs="+", type=Path, required=True),
        AXES, DRIVES, ASSUME, CHECKED, out("export_<name of the machine's folder>"), QUIET_OPTION,
    ),
    EXPORT_DESCRIPTION,
    EXPORT_EPILOG,
    job="machine_export",
)  # fmt: skip
