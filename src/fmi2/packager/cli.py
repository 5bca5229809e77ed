"""Commands of the packager."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from . import build, repack, resources
from .compile import EXTRA_FLAGS
from .errors import InputError, PackagerError
from .machine import named
from .toolchain import find_compiler

_EPILOG = f"""\
environment:
  CC              the C compiler where --cc is not given, e.g. "python -m ziglang cc"
  {EXTRA_FLAGS}  further compiler flags, e.g. "-fsanitize=address,undefined -g"; use another --out with them

exit codes:
  0  done
  2  a table, a resource file, an archive or an option is wrong
  3  the C compiler is missing or failed
  4  the archive cannot be written
"""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="packager",
        description="Packs a unit of src/ into an FMI 2.0 co-simulation archive.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--axes", type=Path, help="axes.csv of the machine (plant only; default: the unit's own)")
    common.add_argument("--modes", type=Path, help="modes.csv of the machine (plant only; default: test_centre)")
    _add_machine(common)
    common.add_argument("--cc", help="C compiler, one or more words (default: $CC, cc, gcc, clang, zig)")
    packing = commands.add_parser("build", parents=[common], help="compile and pack units")
    packing.add_argument("unit", nargs="+", metavar="UNIT", help="plant, controller, friction, or a unit's folder")
    packing.add_argument("--out", type=Path, help="archive to write (default: fmus/UNIT.fmu); for one UNIT")
    packing.add_argument("--build-dir", type=Path, help="keep staged sources and library in this folder")
    describing = commands.add_parser("describe", parents=[common], help="print modelDescription.xml")
    describing.add_argument("unit", metavar="UNIT", help="plant, controller, friction, or a unit's folder")
    repacking = commands.add_parser("repack", help="pack another machine into a plant's archive; needs no compiler")
    repacking.add_argument("base", type=Path, metavar="BASE.fmu", help="archive whose binaries and sources are taken")
    repacking.add_argument("--axes", type=Path, required=True, help="axes.csv of the machine")
    repacking.add_argument("--modes", type=Path, required=True, help="modes.csv of the machine")
    _add_machine(repacking)
    repacking.add_argument("--out", type=Path, required=True, help="archive to write")
    return parser


def _add_machine(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--poses", type=Path, help="poses.bin of the machine: modes of a grid of poses (plant only)")
    parser.add_argument("--name", default="", help="name of the machine, for the description and the documentation")
    parser.add_argument("--note", default="", help="a remark that goes with the name")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit code."""
    options = _parser().parse_args(arguments)
    try:
        {"describe": _describe, "build": _build, "repack": _repack}[options.command](options)
    except PackagerError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    return 0


def _load(name: str, compiler: Sequence[str], options: argparse.Namespace) -> build.Unit:
    return build.load(
        build.unit_directory(name),
        compiler,
        axes=options.axes,
        modes=options.modes,
        poses=options.poses,
        name=options.name,
        note=options.note,
    )


def _describe(options: argparse.Namespace) -> None:
    unit = _load(options.unit, find_compiler(options.cc), options)
    _warn(unit.warnings)
    sys.stdout.buffer.write(unit.description())


def _build(options: argparse.Namespace) -> None:
    if options.out and len(options.unit) > 1:
        raise InputError(f"--out is for one unit, but {len(options.unit)} are given: {', '.join(options.unit)}")
    compiler = find_compiler(options.cc)
    for name in options.unit:
        unit = _load(name, compiler, options)
        out = options.out or build.PROJECT / "fmus" / f"{unit.table.unit}.fmu"
        result = build.build(unit, out, compiler, options.build_dir)
        _warn(result.warnings)
        glibc = f", needs glibc {result.glibc}" if result.glibc else ""
        print(f"{result.path}: {result.size / 1024:.0f} KiB, {result.platform}{glibc}, guid {result.guid}")


def _repack(options: argparse.Namespace) -> None:
    given = resources.read(options.axes, options.modes, options.poses)
    result = repack.repack(options.base, given, named(options.name, options.note), options.out)
    platforms = ", ".join(result.platforms) or "no binaries"
    trial = "" if result.tried else "; not tried, as it has no binary for this platform"
    print(f"{result.path}: {result.size / 1024:.0f} KiB, {platforms}, guid {result.guid}{trial}")


def _warn(warnings: Sequence[str]) -> None:
    for warning in dict.fromkeys(warnings):
        print(f"warning: {warning}", file=sys.stderr)
