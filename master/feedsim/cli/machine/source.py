"""Which machine, at which pose, with which modes: arguments that the commands of ``feedsim machine`` share."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.errors import InputError

if TYPE_CHECKING:
    from feedsim.scenario import Described, Structure
    from feedsim.structure.info import MachineInfo

Commands = argparse._SubParsersAction  # what add_subparsers() returns; argparse gives it no public name

# Exchange step where no machine file says what the control cycle is [s].
USUAL_STEP = 125e-6


def add_source(command: argparse.ArgumentParser) -> None:
    """Arguments that say which machine and which modes are meant."""
    command.add_argument(
        "machine",
        type=Path,
        metavar="MACHINE",
        help="machine file with the key structure, structure file, or a folder with a machine.yaml or structure.yaml",
    )
    command.add_argument(
        "--at",
        nargs="+",
        default=[],
        metavar="AXIS=POSITION",
        help="axis positions, e.g. X=800mm Z=100mm; axes that are not named stay at the machine's pose",
    )
    command.add_argument(
        "--cutoff", metavar="FREQUENCY", help="drop modes above, e.g. 1500Hz (default: the structure's)"
    )
    command.add_argument(
        "--static-correction",
        action="store_true",
        help="append pseudo-modes that make up for the static compliance of the dropped modes",
    )


def add_step(command: argparse.ArgumentParser) -> None:
    """The exchange step that coupling limits belong to."""
    command.add_argument(
        "--step", metavar="TIME", help="exchange step h of the coupling limit (default: the machine's control cycle)"
    )


def info(options: argparse.Namespace, described: Described, *, quiet: bool = False) -> MachineInfo:
    """The figures of a machine, its modes computed where there is a structure; warnings go to standard error.

    Raises:
        InputError: no structure for what was asked, a faulty pose, a structure that cannot be solved.
    """
    from feedsim.structure.info import info_of_table
    from feedsim.structure.modes import checked_modes

    machine = described.machine
    step = getattr(options, "step", None)
    h = _quantity("step", step, "s", "125 us") if step is not None else machine.cycles.T_c if machine else USUAL_STEP
    friction = {name: axis.friction for name, axis in machine.axes.items()} if machine else None
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
    for warning in found.warnings:
        print(f"feedsim: warning: {warning}", file=sys.stderr)
    return found


def _info_of_structure(options: argparse.Namespace, described: Described, h: float, quiet: bool) -> MachineInfo:
    from feedsim.structure.build import build
    from feedsim.structure.info import info_of_model, stale
    from feedsim.structure.modes import read_modes

    assert described.structure is not None
    cutoff = _quantity("cutoff", options.cutoff, "rad/s", "1500 Hz") if options.cutoff is not None else None
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
            "structure; runs take the table. Build it anew (feedsim machine build), or name the structure that it "
            "belongs to"
        )
    friction = {name: axis.friction for name, axis in machine.axes.items()} if machine else None
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
    """Axis -> position [m] of texts AXIS=POSITION.

    Raises:
        InputError: no such form, no length, or an axis that is named twice.
    """
    from feedsim import units

    pose: dict[str, float] = {}
    for text in texts:
        axis, equals, position = text.partition("=")
        if not equals or not axis:
            raise InputError(f"--at {text}: AXIS=POSITION is needed, e.g. X=800mm")
        if axis in pose:
            raise InputError(f"--at {text}: axis {axis} is given twice")
        try:
            pose[axis] = units.parse(position, "m", "800 mm")
        except InputError as error:
            raise InputError(f"--at {text}: {error}") from None
    return pose


def _quantity(option: str, text: str, unit: str, example: str) -> float:
    """A quantity above zero that was given as an option."""
    from feedsim import units

    try:
        value = units.parse(text, unit, example)
    except InputError as error:
        raise InputError(f"--{option} {text}: {error}") from None
    if value <= 0:
        raise InputError(f"--{option} {text}: more than zero is needed, e.g. {example}")
    return value
