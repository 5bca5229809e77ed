"""``feedsim machine build``: modes of a machine, from its structure file."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.cli.machine.source import Commands, add_source, info
from feedsim.errors import InputError

if TYPE_CHECKING:
    from feedsim.structure.info import MachineInfo

MODES, RECORD = "modes.csv", "build.json"


def add_build(own: Commands[argparse.ArgumentParser]) -> None:
    """Add `build` to the commands of `machine`."""
    build = own.add_parser(
        "build",
        help="compute the machine's modes from its structure; write modes.csv and build.json",
        description="Compute the modes of a machine from its structure file: geometry, or matrices of a "
        "finite-element program (docs/structure.md).",
    )
    add_source(build)
    build.add_argument("--out", type=Path, required=True, metavar="DIR", help=f"where {MODES} and {RECORD} go")
    build.add_argument("--quiet", action="store_true", help="no progress and no summary")
    build.set_defaults(action=build_machine)


def build_machine(options: argparse.Namespace) -> None:
    """Write modes.csv and build.json."""
    from feedsim.report import results
    from feedsim.report.machine import record as machine_record
    from feedsim.report.parts import to_json
    from feedsim.scenario import load_described
    from feedsim.structure.modes import write_modes

    described = load_described(options.machine)
    if described.structure is None:
        raise InputError(
            f"{options.machine}: has no key structure; modes are computed from a structure file (docs/structure.md)"
        )
    results.check_place(options.out, (MODES, RECORD))
    found = info(options, described, quiet=options.quiet)
    content = machine_record.record(found, described.files)

    def fill(folder: Path, names: Sequence[str]) -> None:
        write_modes(folder / MODES, found.modes)
        results.write_text(folder / RECORD, to_json(content))

    results.write_results(options.out, (MODES, RECORD), (), fill)
    if not options.quiet:
        print(f"{summary(found)} -> {options.out / MODES}")


def summary(found: MachineInfo) -> str:
    """One line: what was built."""
    solution = found.solution
    assert solution is not None
    frequency = found.modes.frequency
    elastic = frequency[frequency > 0]
    kept = len(elastic) - solution.corrections
    lowest = ", ".join(f"{f:.4g}" for f in elastic[: min(5, kept)])
    extra = f" and {solution.corrections} pseudo-modes" if solution.corrections else ""
    return (
        f"{found.title}: {solution.shapes.shape[0]} degrees of freedom, {len(frequency) - len(elastic)} rigid and "
        f"{kept} elastic modes{extra}{f', lowest {lowest} Hz' if lowest else ''}"
    )
