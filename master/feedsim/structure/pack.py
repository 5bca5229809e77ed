"""A machine's modes, pose and grid of poses -> a plant archive of its own; and what all that is packed into archives
has in common.

No compiler is needed: the binaries of an archive do not depend on the machine. Which axes there are, where they stand
and how the structure moves is data that the archive holds in resources/.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.files.fields import FileContent
from feedsim.foundation.errors import InputError, OutputError
from feedsim.foundation.outputs import TemporaryFolder

if TYPE_CHECKING:
    from feedsim.simulation.nc import Program
    from feedsim_packager.machine_tables import MachineTables
    from feedsim_packager.resources import Resources
    from feedsim_packager.setpoints import Setpoints

AXES_IN_ARCHIVE = "resources/axes.csv"
MODES_IN_ARCHIVE = "resources/modes.csv"
POSES_IN_ARCHIVE = "resources/poses.bin"
MOUNTS_IN_ARCHIVE = "resources/mounts.csv"


@dataclass(frozen=True)
class PackedArchive:
    """A packed archive.

    Attributes:
        size: [bytes].
        guid: of the units' table and, its second half, of the machine's data.
        platforms: folders of the binaries in it, such as "linux64".
    """

    path: Path
    size: int
    guid: str
    platforms: tuple[str, ...]


def pack(
    base: Path,
    out: Path,
    *,
    modes: FileContent,
    pose: Mapping[str, float],
    poses: Path | None = None,
    mounts: Path | None = None,
    name: str = "",
    note: str = "",
    trial: bool = True,
    level: int = 9,
    terminals: bool = True,
) -> PackedArchive:
    """Pack a machine into the plant archive `base`; write it to `out`, whole or not at all.

    Args:
        modes: table of the modes at the pose, with the ports of all axes; its bytes are packed as they are.
        pose: axis -> position at the start [m]; the axes in the order that the archive shall have them.
        poses: poses.bin, the modes of a grid of poses, for a plant that follows its axes.
        mounts: mounts.csv, mounts that are not linear, at the modes' pose.
        name, note: what the archive's description and documentation say of the machine.
        trial: instantiate the packed unit once, where the base has a binary for this platform.
        level: of compression, 0 (none) to 9.
        terminals: with terminals and icons, as far as the base has them.

    Raises:
        InputError: a file is not what it should be, or the unit refuses the machine.
        OutputError: `out` cannot be written.
    """
    with translate_packager_errors():
        given = plant_tables(modes, pose, poses, mounts)
        return pack_unit(base, out, given, name=name, note=note, trial=trial, level=level, terminals=terminals)


@contextmanager
def translate_packager_errors() -> Iterator[None]:
    """The packager's errors within are InputError and OutputError of this house."""
    from feedsim_packager import errors

    try:
        yield
    except errors.OutputError as error:
        raise OutputError(str(error)) from error
    except errors.InputError as error:
        raise InputError(str(error), error.problems) from error


def plant_tables(
    modes: FileContent, pose: Mapping[str, float], poses: Path | None, mounts: Path | None = None
) -> MachineTables:
    """A machine's files as an archive holds them, checked; arguments as those of `pack`."""
    from feedsim_packager import machine_tables
    from feedsim_packager.resources import File

    return machine_tables.check(
        File("axes.csv", machine_tables.axes_csv(pose)),
        File(str(modes), modes.content or b""),
        *(File.at(path) if path is not None else None for path in (poses, mounts)),
    )


def setpoint_table(program: Program) -> Setpoints:
    """The setpoints of a program as an archive holds them, checked."""
    from feedsim_packager import setpoints
    from feedsim_packager.resources import File

    columns = {axis: (program.x_s[axis], program.n_ffw[axis]) for axis in program.x_s}
    return setpoints.check(File("setpoints.csv", setpoints.write(program.time, columns)))


def pack_unit(
    base: Path,
    out: Path,
    given: Resources,
    *,
    name: str = "",
    note: str = "",
    model: str = "",
    trial: bool = True,
    level: int = 9,
    terminals: bool = True,
) -> PackedArchive:
    """Pack the unit of the archive `base` with what is `given`; `model`: its modelName, where it is not the unit's; the
    rest as in `pack`."""
    from feedsim_packager.machine import named
    from feedsim_packager.repack import repack

    with TemporaryFolder() if trial else nullcontext() as stage:
        done = repack(
            base, given, named(name, note, model), out, trial_run=trial, level=level, stage=stage,
            with_terminals=terminals,
        )  # fmt: skip
    return PackedArchive(done.path, done.size, done.guid, done.platforms)
