"""``feedsim machine ...``: what is done with a machine rather than with a scenario."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.cli.machine.build import add_build
from feedsim.cli.machine.info import add_info
from feedsim.cli.machine.poses import add_poses, write_grid
from feedsim.cli.machine.show import add_show
from feedsim.cli.machine.source import Commands, positions
from feedsim.errors import InputError, OutputError

if TYPE_CHECKING:
    from feedsim.scenario import Machine


def add_commands(commands: Commands[argparse.ArgumentParser]) -> None:
    """Add `machine` with its own commands to the command line."""
    machine = commands.add_parser("machine", help="build, look at and pack a machine")
    own = machine.add_subparsers(dest="machine_command", metavar="COMMAND", required=True)
    add_build(own)
    add_info(own)
    add_show(own)
    _add_pack(own)


def _add_machine(command: argparse.ArgumentParser) -> None:
    command.add_argument("machine", type=Path, metavar="MACHINE", help="machine file, or a folder with a machine.yaml")


def _add_pose(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--at",
        nargs="+",
        default=[],
        metavar="AXIS=POSITION",
        help="axis positions, e.g. X=800mm Z=100mm; axes that are not named stay at the machine's pose",
    )


def _add_pack(own: Commands[argparse.ArgumentParser]) -> None:
    pack = own.add_parser(
        "pack",
        help="pack the machine into a plant archive; needs no compiler",
        description="Pack the machine's axes, pose and table of modes into a plant archive. The binaries are those of "
        "the base archive, for all its platforms.",
    )
    _add_machine(pack)
    _add_pose(pack)
    add_poses(pack)
    pack.add_argument("--out", type=Path, required=True, metavar="PLANT.fmu", help="archive to write")
    pack.add_argument("--name", help="name of the machine in the archive (default: the machine's)")
    pack.add_argument("--note", help="a remark that goes with the name (default: the machine's)")
    pack.add_argument(
        "--base",
        type=Path,
        metavar="PLANT.fmu",
        help="archive whose binaries are taken (default: plant.fmu in $FEEDSIM_FMUS, else in fmus/)",
    )
    pack.set_defaults(action=pack_machine)


def pack_machine(options: argparse.Namespace) -> None:
    """Pack the machine at its pose with its own table of modes, or at another pose with the modes there."""
    import tempfile

    from feedsim import cosim, scenario
    from feedsim.structure import checked_modes
    from feedsim.structure.doubt import table_doubt
    from feedsim.structure.pack import pack

    if options.out.is_dir():
        raise OutputError(f"cannot write {options.out}: Is a directory; name the archive, e.g. --out machine.fmu")
    machine = scenario.load_machine(options.machine)
    base = options.base or cosim.fmus_directory() / "plant.fmu"
    pose = pose_of(machine, options.at)
    with tempfile.TemporaryDirectory(prefix="feedsim-") as folder:
        modes = modes_at(machine, pose, Path(folder) / "modes.csv") if options.at else machine.modes
        checked_modes(machine.model_copy(update={"modes": modes}))  # what a run would refuse should not be packed
        if not options.at and (doubt := table_doubt(machine)) is not None:
            raise InputError(f"{doubt}, or let the modes be computed: --at")
        poses, follows = None, ""
        if options.poses:
            poses = Path(folder) / "poses.bin"
            follows = f"; {write_grid(machine, pose, modes, options, poses)}"
        packed = pack(
            base,
            options.out,
            modes=modes,
            pose=pose,
            poses=poses,
            name=machine.name if options.name is None else options.name,
            note=machine.note if options.note is None else options.note,
        )
    where = ", ".join(f"{axis} at {position * 1e3:.9g} mm" for axis, position in pose.items())
    platforms = ", ".join(packed.platforms) or "no binaries"
    print(f"{packed.path}: {where}{follows}; {packed.size / 1024:.0f} KiB, {platforms}, guid {packed.guid}")


def pose_of(machine: Machine, texts: Sequence[str]) -> dict[str, float]:
    """The machine's pose [m], axes in its order, with the positions that `texts` (AXIS=POSITION) change.

    Raises:
        InputError: no such axis, no length, or outside of the axis' travel.
    """
    from feedsim import units

    pose = {axis: machine.pose[axis] for axis in machine.axes}
    for axis, position in positions(texts).items():
        if axis not in pose:
            raise InputError(f"--at: the machine has no axis {axis}; axes are {', '.join(pose)}")
        low, high = machine.axes[axis].travel
        if not low <= position <= high:
            raise InputError(
                f"--at {axis}: {units.show(position, 'm')} is outside of the travel, {units.show(low, 'm')} to "
                f"{units.show(high, 'm')}"
            )
        pose[axis] = position
    return pose


def modes_at(machine: Machine, pose: Mapping[str, float], out: Path) -> Path:
    """Table of the machine's modes at `pose` [m], computed from its structure and written to `out`.

    Raises:
        InputError: the machine has no structure, its kind is known at one pose only, or it is faulty.
    """
    from feedsim.scenario import load_structure
    from feedsim.structure.build import build
    from feedsim.structure.modes import write_modes

    if machine.structure is None:
        raise InputError(
            f"{machine.name}: has no structure to compute modes from at another pose; give it the key structure, or "
            "leave --at out"
        )
    write_modes(out, build(load_structure(machine.structure), pose).solution.modes)
    return out
