"""``feedsim machine info``: masses, inertias, coupling limits and modes of a machine."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from feedsim.cli.machine.source import Commands, add_source, add_step, info
from feedsim.errors import InputError

if TYPE_CHECKING:
    from feedsim.structure.info import MachineInfo

USUAL_MODES = 20


def add_info(own: Commands[argparse.ArgumentParser]) -> None:
    """Add `info` to the commands of `machine`."""
    command = own.add_parser(
        "info",
        help="print masses, inertias, leads, coupling limits and modes of the machine",
        description="Masses, inertias, leads, coupling limits and modes of a machine, computed from its structure "
        "where it has one, else from its table of modes. MACHINE may be a scenario too.",
    )
    add_source(command)
    add_step(command)
    command.add_argument(
        "--modes", default=str(USUAL_MODES), metavar="N", help=f"modes to list: number or all (default: {USUAL_MODES})"
    )
    command.add_argument("--json", action="store_true", help="print JSON in SI units, with all modes")
    command.set_defaults(action=print_info)


def print_info(options: argparse.Namespace) -> None:
    """Print the figures to standard output."""
    from feedsim.report.machine import record as machine_record
    from feedsim.report.parts import to_json
    from feedsim.scenario import load_described

    most = _count(options.modes)
    described = load_described(options.machine)
    found: MachineInfo = info(options, described)
    if options.json:
        files = [*described.files, *([("modes", described.modes)] if described.modes else [])]
        print(to_json(machine_record.record(found, files)), end="")
        return
    print(machine_record.text(found, most))
    if described.gaps:
        more = f" (and {len(described.gaps) - 1} more)" if len(described.gaps) > 1 else ""
        print(f"The machine file is not complete: {described.gaps[0]}{more}")


def _count(text: str) -> int | None:
    if text == "all":
        return None
    if not text.isdecimal():
        raise InputError(f"--modes {text}: a whole number, or all, is needed")
    return int(text)
