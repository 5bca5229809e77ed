"""feedsim ssp: a scenario as one SSP file for other simulators; and what run and validate need to read one."""

from __future__ import annotations

import argparse
import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.cli.options import add_fmus, add_overrides
from feedsim.errors import InputError, OutputError

if TYPE_CHECKING:
    from feedsim.nc import Program
    from feedsim.scenario import Scenario

    Told = Callable[[Iterable[str]], tuple[str, ...]]

DESCRIPTION = """Write a scenario as one SSP file (System Structure and Parameterization 1.0): the plant packed with the
machine, a controller and a friction unit per axis with their parameters, the setpoints of the motion in a unit that
plays them, and the wiring. Other simulators run it without anything of feedsim (docs/ssp.md); feedsim run FILE.ssp runs
it here."""
EPILOG = """examples:
  feedsim ssp scenarios/xz_circle.yaml --out xz_circle.ssp
  feedsim ssp scenarios/z_positioning.yaml --set "machine.axes.Z.friction.W=0 rad" --out lugre.ssp
"""


def add_command(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``ssp`` to the commands."""
    command = subparsers.add_parser(
        "ssp",
        help="write a scenario as an SSP file, which other simulators run",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("scenario", type=Path, metavar="SCENARIO.yaml", help="scenario file (docs/scenarios.md)")
    command.add_argument("--out", type=Path, required=True, metavar="FILE.ssp", help="the SSP file to write")
    add_fmus(command)
    add_overrides(command, "machine.axes.Z.friction.F_C='1.8 N.m'")
    command.set_defaults(action=write)


def write(options: Namespace) -> None:
    """feedsim ssp."""
    from feedsim import scenario, ssp

    if not scenario.is_ssp(options.out):
        raise InputError(f"--out {options.out}: an SSP file ends in .ssp; simulators tell it by that")
    if scenario.is_ssp(options.scenario):
        raise InputError(f"{options.scenario}: is an SSP file already; a scenario is expected")
    if not options.out.absolute().parent.is_dir():
        raise OutputError(f"{options.out} cannot be written: no such folder: {options.out.parent}")
    loaded = scenario.load(options.scenario, options.overrides)
    done = ssp.export(loaded, options.out, fmus=options.fmus)
    for warning in done.warnings:
        print(f"feedsim: warning: {warning}", file=sys.stderr)
    print(
        f"{done.path}: {done.size / 1024:.0f} KiB, {len(done.instances)} instances, {done.duration:.4g} s at "
        f"{loaded.machine.cycles.T_c * 1e6:.6g} us; parameters in resources/*.ssv; "
        f"runs on {', '.join(done.platforms) or 'no platform'}"
    )


@contextmanager
def subject(options: Namespace) -> Iterator[tuple[Scenario, Program, Path | None, Told]]:
    """What ``run`` and ``validate`` are to look at: a scenario file, or an SSP, whose archives are its own.

    Scenario, program, folder of archives, and what makes a run's warnings all that is to be told.
    """
    from feedsim import nc, scenario

    if not scenario.is_ssp(options.scenario):
        if scenario.is_study(options.scenario):
            raise InputError(f"{options.scenario}: is a study of many runs: feedsim sweep {options.scenario}")
        loaded = scenario.load(options.scenario, options.overrides)
        yield loaded, nc.plan(loaded), options.fmus, tuple
        return
    if options.fmus is not None:
        raise InputError(f"--fmus {options.fmus}: {options.scenario} has its own archives; leave the option out")
    from feedsim import ssp  # not for runs of scenario files

    with ssp.opened(options.scenario, options.overrides) as found:
        yield found.scenario, found.program, found.fmus, found.told
