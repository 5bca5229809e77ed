"""Commands of the packager."""

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from . import archive, build, checkout, declared, kinds, native, repack, table, targets, web
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

_UNIT_HELP = "plant, controller, friction, friction_gms, setpoint, machine, or a unit's folder"

_NO_TERMINALS = "leave terminals and icons out, for importers with FMI Library 3, which refuses those of FMI 2.0 units"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="feedsim_packager",
        description="Packs a unit of src/ into an FMI 2.0 co-simulation archive.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    common = argparse.ArgumentParser(add_help=False)
    _add_resources(common)
    common.add_argument("--cc", help="C compiler, one or more words (default: $CC, cc, gcc, clang, zig)")
    packing = commands.add_parser("build", parents=[common], help="compile and pack units")
    packing.add_argument("unit", nargs="+", metavar="UNIT", help=_UNIT_HELP)
    packing.add_argument("--out", type=Path, help="archive to write (default: fmus/UNIT.fmu); for one UNIT")
    packing.add_argument(
        "--platforms",
        help=f"platforms to compile for, of {', '.join(targets.ALL)}, separated by commas, or all; more than this "
        "machine's own need zig. Checked to run on machines other than this one (default: this machine's, unchecked)",
    )
    packing.add_argument("--no-terminals", action="store_true", help=_NO_TERMINALS)
    packing.add_argument("--build-dir", type=Path, help="keep staged sources and library in this folder")
    describing = commands.add_parser("describe", parents=[common], help="print modelDescription.xml")
    describing.add_argument("unit", metavar="UNIT", help=_UNIT_HELP)
    declaring = commands.add_parser("variables", help="write the tables of all units as one JSON file")
    declaring.add_argument("--cc", help="C compiler, one or more words (default: $CC, cc, gcc, clang, zig)")
    declaring.add_argument("--out", type=Path, required=True, help="file to write")
    for name, what in (("exchange", "native cycle loop"), ("planner", "path planner")):
        library = commands.add_parser(name, help=f"compile the master's {what}")
        library.add_argument("--cc", help="C compiler, one or more words (default: $CC, cc, gcc, clang, zig)")
        library.add_argument(
            "--platform", choices=targets.ALL, help="compile for this platform (default: this machine)"
        )
        library.add_argument("--out", type=Path, required=True, help="folder of the archives")
    paging = commands.add_parser("web", help="compile the unit machine as a WebAssembly module for pages")
    paging.add_argument("--cc", help="compiler for WebAssembly, one or more words (default: clang, zig)")
    paging.add_argument("--out", type=Path, required=True, help="module to write")
    repacking = commands.add_parser("repack", help="pack another machine or motion into an archive; needs no compiler")
    repacking.add_argument("base", type=Path, metavar="BASE.fmu", help="archive whose binaries and sources are taken")
    _add_resources(repacking)
    repacking.add_argument("--no-terminals", action="store_true", help=_NO_TERMINALS)
    repacking.add_argument("--out", type=Path, required=True, help="archive to write")
    return parser


def _add_resources(parser: argparse.ArgumentParser) -> None:
    takers: dict[str, list[str]] = {}
    for kind_name, kind in kinds.KINDS.items():
        for name in kind.options:
            takers.setdefault(name, []).append(kind_name)
    for name, kind_names in takers.items():
        option, named = (
            kinds.KINDS[kind_names[0]].options[name],
            " or ".join(f"'{kind_name}'" for kind_name in kind_names),
        )
        parser.add_argument(
            f"--{name}", type=Path, help=f"{option.help}; only for a unit with resources of the kind {named}"
        )
    parser.add_argument("--name", default="", help="name of the machine or motion, for description and documentation")
    parser.add_argument("--note", default="", help="a remark that goes with the name")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit code."""
    options = _parser().parse_args(arguments)
    try:
        if options.command != "repack":
            checkout.check_there(options.command)
        {
            "describe": _describe, "build": _build, "variables": _variables, "exchange": _library, "planner": _library,
            "web": _web, "repack": _repack,
        }[options.command](options)  # fmt: skip
    except PackagerError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    return 0


def _load(name: str, compiler: Sequence[str], options: argparse.Namespace) -> build.Unit:
    return build.load(
        build.unit_directory(name),
        compiler,
        name=options.name,
        note=options.note,
        **_given(options),
    )


def _given(options: argparse.Namespace) -> dict[str, Path]:
    """The resource files that were given, by the names of their options."""
    files = {name: getattr(options, name) for kind in kinds.KINDS.values() for name in kind.options}
    return {name: path for name, path in files.items() if path is not None}


def _describe(options: argparse.Namespace) -> None:
    unit = _load(options.unit, find_compiler(options.cc), options)
    _warn(unit.warnings)
    sys.stdout.buffer.write(unit.description())


def _variables(options: argparse.Namespace) -> None:
    compiler = find_compiler(options.cc)
    tables = [table.read(path, (checkout.SHELL, checkout.STANDARD), compiler) for path in checkout.unit_folders()]
    archive.write(options.out, declared.dump(tables))
    print(f"{options.out}: tables of {', '.join(entry.unit for entry in tables)}")


def _library(options: argparse.Namespace) -> None:
    target = None if options.platform is None else targets.ALL[options.platform]
    print(native.build(options.command, options.out, find_compiler(options.cc), target))


def _web(options: argparse.Namespace) -> None:
    path = web.make(options.out, shlex.split(options.cc) if options.cc else None)
    print(f"{path}: {path.stat().st_size / 1024:.0f} KiB")


def _build(options: argparse.Namespace) -> None:
    if options.out and len(options.unit) > 1:
        raise InputError(f"--out is for one unit, but {len(options.unit)} are given: {', '.join(options.unit)}")
    platforms = None if options.platforms is None else targets.named(options.platforms)
    compiler = find_compiler(options.cc)
    if platforms and len(platforms) > 1:
        print(
            f"compiling for {', '.join(target.folder for target in platforms)}; what a platform's C library needs, zig "
            "compiles when it is first used: up to some minutes, once",
            file=sys.stderr,
        )
    for name in options.unit:
        unit = _load(name, compiler, options)
        out = options.out or checkout.PROJECT / "fmus" / f"{unit.table.unit}.fmu"
        result = build.build(
            unit, out, compiler, options.build_dir, targets=platforms, progress=_tell if platforms else None,
            with_terminals=not options.no_terminals,
        )  # fmt: skip
        _warn(result.warnings)
        glibc = f", needs glibc {result.glibc}" if result.glibc else ""
        listed = ", ".join(result.platforms)
        print(f"{result.path}: {result.size / 1024:.0f} KiB, {listed}{glibc}, guid {result.guid}")


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _repack(options: argparse.Namespace) -> None:
    given = kinds.from_files(_given(options))
    result = repack.repack(
        options.base, given, named(options.name, options.note), options.out, with_terminals=not options.no_terminals
    )
    platforms = ", ".join(result.platforms) or "no binaries"
    trial = "" if result.tried else "; not tried, as it has no binary for this platform"
    print(f"{result.path}: {result.size / 1024:.0f} KiB, {platforms}, guid {result.guid}{trial}")


def _warn(warnings: Sequence[str]) -> None:
    for warning in dict.fromkeys(warnings):
        print(f"warning: {warning}", file=sys.stderr)
