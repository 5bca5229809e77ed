"""``feedsim machine build`` and ``info``: the figures of a machine at a pose, its modes computed from its structure."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.cli.options import Command, Option, lengths, quantity
from feedsim.cli.terminal import finish, results_in, warn
from feedsim.errors import InputError
from feedsim.outputs import begins_with

if TYPE_CHECKING:
    from feedsim.scenario.described import Described
    from feedsim.scenario.structure import Structure
    from feedsim.structure.info import MachineInfo

# Exchange step where no machine file says what the control cycle is [s].
USUAL_STEP = 125e-6
USUAL_MODES = 20  # that are listed
MODES, RECORD, KIND = "modes.csv", "build.json", "machine build"


def build(options: Namespace) -> None:
    """feedsim machine build: write modes.csv and build.json."""
    from feedsim.report import results
    from feedsim.report.machine import record as machine_record
    from feedsim.report.provenance import to_json
    from feedsim.scenario.described import load_described
    from feedsim.structure.modes import write_modes

    described = load_described(options.machine)
    if described.structure is None:
        raise InputError(
            f"{options.machine}: has no key structure; modes are computed from a structure file (docs/structure.md)"
        )
    own = (MODES, RECORD) if begins_with(b'"format"')(options.out / RECORD) else ()  # of an earlier build
    inputs = [file for _, file in described.files]

    def check(out: Path, inputs: Sequence[Path]) -> None:
        results.check_place(out, (MODES, RECORD), inputs, kind=KIND, own=own)

    with results_in(options.out, check, inputs):
        found = figures(options, described, quiet=options.quiet)
        content = machine_record.record(found, described.files)

        def fill(folder: Path, names: Sequence[str]) -> None:
            write_modes(folder / MODES, found.modes)
            results.write_text(folder / RECORD, to_json(content))

        results.write_results(options.out, (MODES, RECORD), (), fill, kind=KIND, own=own)
    finish(options.quiet, (), f"{_built(found)} -> {options.out / MODES}")


def _built(found: MachineInfo) -> str:
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


def info(options: Namespace) -> None:
    """feedsim machine info: print the figures."""
    from feedsim.report.machine import record as machine_record
    from feedsim.report.provenance import to_json
    from feedsim.scenario.described import load_described

    most = _count(options.modes)
    described = load_described(options.machine)
    found = figures(options, described)
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


def figures(options: Namespace, described: Described, *, quiet: bool = False) -> MachineInfo:
    """The figures of a machine, its modes computed where there is a structure; warnings go to standard error.

    Raises:
        InputError: no structure for what was asked, a faulty pose, a structure that cannot be solved.
    """
    from feedsim.structure.info import info_of_table
    from feedsim.structure.modes import checked_modes

    machine = described.machine
    step = getattr(options, "step", None)
    h = machine.cycles.T_c if machine else USUAL_STEP
    if step is not None:
        h = quantity("step", step, "s", "125 us", positive=True)
    friction = machine.shipped_frictions if machine else None
    if described.structure is None:
        assert machine is not None
        for option in ("at", "cutoff", "static_correction"):
            if getattr(options, option):
                raise InputError(
                    f"--{option.replace('_', '-')}: {options.machine} has a table of modes alone; other modes need a "
                    "structure file (key structure, docs/structure.md)"
                )
        return info_of_table(described.name, described.note, checked_modes(machine), described.pose, h, friction)
    found = _info_of_structure(options, described, h, quiet)
    warn(found.warnings)
    return found


def _info_of_structure(options: Namespace, described: Described, h: float, quiet: bool) -> MachineInfo:
    from feedsim.structure.build import build
    from feedsim.structure.info import info_of_model
    from feedsim.structure.modes import read_modes
    from feedsim.structure.table_check import stale

    assert described.structure is not None
    wanted = options.cutoff
    cutoff = None if wanted is None else quantity("cutoff", wanted, "rad/s", "1500 Hz", positive=True)
    shown = sys.stderr.isatty() and not quiet

    def progress(text: str) -> None:
        if shown:
            print(f"  {text}", file=sys.stderr)

    pose = {**described.pose, **positions(options.at)}
    _check_complete(described.structure, pose)
    built = build(
        described.structure, pose, cutoff=cutoff, static_correction=options.static_correction, progress=progress
    )
    machine, warnings = described.machine, []
    same = pose == dict(described.pose) and cutoff is None and not options.static_correction
    building = options.machine_command == "build"
    if (
        same
        and not building
        and machine is not None
        and described.modes is not None
        and (how := stale(read_modes(described.modes, list(machine.axes)), built.solution.modes))
    ):
        warnings.append(
            f"{described.modes} is not what {machine.structure} gives at the machine's pose: {how}. Shown is the "
            "structure; runs take the table. Build it anew (feedsim machine build --force), or name the structure that "
            "it belongs to"
        )
    friction = machine.shipped_frictions if machine else None
    return info_of_model(described.name, described.note, built, h, friction, warnings)


def _check_complete(structure: Structure, pose: Mapping[str, float]) -> None:
    from feedsim.scenario.structure.geometry import GeometryStructure

    if not isinstance(structure, GeometryStructure):
        return
    if missing := [axis for axis in structure.axes if axis not in pose]:
        middle = {axis: 5e2 * sum(structure.axes[axis].travel) for axis in missing}
        example = " ".join(f"{axis}={position:.6g}mm" for axis, position in middle.items())
        raise InputError(
            f"{structure.name or 'structure'}: nothing says where axis {', '.join(missing)} stands; the structure can "
            f"be assembled at any position: give one, e.g. --at {example}"
        )


def positions(texts: Sequence[str]) -> dict[str, float]:
    """Axis -> position [m] of texts AXIS=POSITION. Raises InputError."""
    return lengths("at", texts, "POSITION", "800mm")


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
STEP = Option("--step", "TIME", "exchange step h of the coupling limit (default: the machine's control cycle)")
QUIET = Option("--quiet", "", "no progress and no summary")
BUILD = Command(
    "build",
    "compute the machine's modes from its structure; write modes.csv and build.json",
    build,
    (*SOURCE, Option("--out", "DIR", f"where {MODES} and {RECORD} go", type=Path, required=True), QUIET),
    "Compute the modes of a machine from its structure file: geometry, or matrices of a finite-element program "
    "(docs/structure.md).",
)
INFO = Command(
    "info",
    "print masses, inertias, leads, coupling limits and modes of the machine",
    info,
    (
        *SOURCE,
        STEP,
        Option("--modes", "N", f"modes to list: number or all (default: {USUAL_MODES})", default=str(USUAL_MODES)),
        Option("--json", "", "print JSON in SI units, with all modes"),
    ),
    "Masses, inertias, leads, coupling limits and modes of a machine, computed from its structure where it has one, "
    "else from its table of modes. MACHINE may be a scenario too.",
)
