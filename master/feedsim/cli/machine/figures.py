"""``feedsim machine build`` and ``info``: the figures of a machine at a pose, its modes computed from its structure."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import Command, Option, pairs
from feedsim.cli.terminal import call, finish, warn

POSITION = "AXIS=POSITION is needed, e.g. X=800mm"


def build(options: Namespace) -> None:
    """feedsim machine build: write modes.csv and build.json."""
    from feedsim.jobs.machine import TABLE_FILE, machine_build

    result = call(machine_build, options, at=pairs("at", options.at, POSITION))
    finish(options.quiet, result.findings, f"{result.lines[0]} -> {options.out / TABLE_FILE}")


def info(options: Namespace) -> None:
    """feedsim machine info: print the figures."""
    from feedsim.jobs.machine import machine_info

    result = call(machine_info, options, at=pairs("at", options.at, POSITION))
    warn(result.findings)
    described = result.described
    if options.json:
        print(result.json, end="")
        return
    print(*result.lines, sep="\n")
    if described.gaps:
        more = f" (and {len(described.gaps) - 1} more)" if len(described.gaps) > 1 else ""
        print(f"The machine file is not complete: {described.gaps[0]}{more}")


AT = Option("--at", "AXIS=POSITION",
            "axis positions, e.g. X=800mm Z=100mm; axes that are not named stay at the machine's pose",
            nargs="+", default=[])  # fmt: skip
SOURCE = (
    Option("machine", "MACHINE",
           "machine file with the key structure, structure file, or a folder with a machine.yaml or structure.yaml",
           type=Path),
    AT,
    Option("--cutoff", "FREQUENCY", "drop modes above, e.g. 1500Hz (default: the structure's)"),
    Option("--static-correction", "",
           "append pseudo-modes that make up for the static compliance of the dropped modes"),
)  # fmt: skip
STEP_OPTION = Option("--step", "TIME", "exchange step h of the coupling limit (default: the machine's control cycle)")
QUIET_OPTION = Option("--quiet", "", "no progress and no summary")
BUILD = Command(
    "build",
    "compute the machine's modes from its structure; write modes.csv and build.json",
    build,
    (*SOURCE, Option("--out", "DIR", "where modes.csv and build.json go", type=Path, required=True), QUIET_OPTION),
    "Compute the modes of a machine from its structure file: geometry, or matrices of a finite-element program "
    "(docs/structure.md).",
    job="machine_build",
)
INFO = Command(
    "info",
    "print masses, inertias, leads, coupling limits and modes of the machine",
    info,
    (
        *SOURCE,
        STEP_OPTION,
        Option("--modes", "N", "modes to list: number or all (default: 20)", default="20"),
        Option("--json", "", "print JSON in SI units, with all modes"),
    ),
    "Masses, inertias, leads, coupling limits and modes of a machine, computed from its structure where it has one, "
    "else from its table of modes. MACHINE may be a scenario too.",
    job="machine_info",
)
