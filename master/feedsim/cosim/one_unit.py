"""The whole machine as one unit: structure, drives and friction of all axes, packed with the scenario's motion into the
archive machine.fmu. No compiler is needed: which machine it is, is data to the unit."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

from feedsim.cosim.archive import Archive
from feedsim.cosim.roles import controller_parameters
from feedsim.cosim.schedule import SCHEMES
from feedsim.errors import InputError, OutputError
from feedsim.nc import Program
from feedsim.owned import TemporaryFolder
from feedsim.scenario import Machine
from feedsim.scenario.machine import Parameter
from feedsim.scenario.model import Coupling
from feedsim.structure.pack import POSES_IN_ARCHIVE, Packed

UNIT = "machine"  # its archive is machine.fmu


def pack_whole(
    base: Path,
    out: Path,
    machine: Machine,
    *,
    coupling: Coupling | None = None,
    program: Program | None = None,
    name: str = "",
    note: str = "",
    trial: bool = True,
    level: int = 9,
) -> Packed:
    """Pack a machine into the archive `base` of the unit `machine`; write it to `out`, whole or not at all.

    Args:
        coupling: how plant and friction are exchanged inside; default: as a scenario has it that does not say.
        program: motion that the unit holds; without, its setpoints are inputs.
        name, note: what the archive's description and documentation say of the machine.
        trial: instantiate the packed unit once, where the base has a binary for this platform.
        level: of compression, 0 (none) to 9.

    Raises:
        InputError: a role is filled by another maker's unit, a file is not what it should be, or the unit refuses.
        OutputError: `out` cannot be written.
    """
    from feedsim_packager import errors, machine_tables, setpoints, whole_machine
    from feedsim_packager.machine import named
    from feedsim_packager.repack import repack
    from feedsim_packager.resources import File

    settings = parameters(machine, coupling or Coupling(), built_in=program is not None)
    pose = {axis: machine.pose[axis] for axis in machine.axes}
    with ExitStack() as stack:
        try:
            poses = _poses(machine, stack)
            tables = machine_tables.check(
                File("axes.csv", machine_tables.axes_csv(pose)),
                File.at(machine.modes),
                File.at(poses) if poses is not None else None,
            )
            motion = None
            if program is not None:
                columns = {axis: (program.x_s[axis], program.n_ffw[axis]) for axis in machine.axes}
                motion = setpoints.check(File("setpoints.csv", setpoints.write(program.time, columns)))
            given = whole_machine.WholeMachine(
                tables, motion, {name: whole_machine.spelled(value) for name, value in settings.items()}
            )
            stage = stack.enter_context(TemporaryFolder()) if trial else None
            done = repack(base, given, named(name, note), out, trial_run=trial, level=level, stage=stage)
        except errors.OutputError as error:
            raise OutputError(str(error)) from error
        except errors.InputError as error:
            raise InputError(str(error), error.problems) from error
    return Packed(done.path, done.size, done.guid, done.platforms)


def _poses(machine: Machine, stack: ExitStack) -> Path | None:
    """The grid of poses of the machine's own plant archive, where it has one."""
    if machine.plant is None:
        return None
    file = stack.enter_context(Archive(machine.plant)).directory / POSES_IN_ARCHIVE
    return file if file.is_file() else None


def parameters(machine: Machine, coupling: Coupling, *, built_in: bool) -> Mapping[str, Parameter]:
    """Parameters of the unit by their names.

    Raises:
        InputError: lists the roles that another maker's unit fills.
    """
    if machine.foreign_units:
        raise InputError.of(
            "the machine cannot be one unit",
            [
                f"axis {axis}: its {unit.role.name} is {unit.fmu.name}, another maker's unit; one unit holds the "
                "shipped ones alone; wire the units instead: feedsim ssp"
                for axis, unit in machine.foreign_units
            ],
        )
    values: dict[str, Parameter] = {
        "coupling.scheme": list(SCHEMES).index(coupling.scheme),
        "coupling.substeps": coupling.substeps,
        "motion.built_in": built_in,
    }
    for name, axis in machine.axes.items():
        friction = machine.shipped_friction(name, f"{UNIT}.fmu").parameters()
        values |= {f"{name}.drive.{key}": value for key, value in controller_parameters(machine, name).items()}
        values |= {f"{name}.friction.{key}": value for key, value in friction.items()}
        values[f"{name}.M_0"] = axis.M_0
    return values
