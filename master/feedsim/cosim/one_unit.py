"""The whole machine as one unit: structure, drives and friction of all axes, packed with the scenario's motion into the
archive machine.fmu. No compiler is needed: which machine it is, is data to the unit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from feedsim.cosim.archive import Archive
from feedsim.cosim.roles import controller_parameters
from feedsim.errors import InputError
from feedsim.nc import Program
from feedsim.scenario import Friction, Machine
from feedsim.scenario.coupling import SCHEMES, Coupling
from feedsim.scenario.parameter_group import Parameter
from feedsim.structure.pack import POSES_IN_ARCHIVE, Packed, packaging, packed, plant_tables, setpoint_table

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
    model: str = "",
    trial: bool = True,
    terminals: bool = True,
) -> Packed:
    """Pack a machine into the archive `base` of the unit `machine`; write it to `out`, whole or not at all.

    Args:
        coupling: how plant and friction are exchanged inside; default: as a scenario has it that does not say.
        program: motion that the unit holds; without, its setpoints are inputs.
        name, note: what the archive's description and documentation say of the machine.
        model: what importers show as the model's name; default: that of the unit.
        trial: instantiate the packed unit once, where the base has a binary for this platform.
        terminals: with terminals and icons.

    Raises:
        InputError: a role is filled by another maker's unit, a file is not what it should be, or the unit refuses.
        OutputError: `out` cannot be written.
    """
    from feedsim_packager import whole_machine

    settings = parameters(machine, coupling or Coupling(), built_in=program is not None)
    pose = {axis: machine.pose[axis] for axis in machine.axes}
    with packaging(), _poses(machine) as poses:
        given = whole_machine.WholeMachine(
            plant_tables(machine.modes, pose, poses, machine.mounts_table),
            setpoint_table(program) if program is not None else None,
            {name: whole_machine.spelled(value) for name, value in settings.items()},
        )
        return packed(base, out, given, name=name, note=note, model=model, trial=trial, terminals=terminals)


def pack_tables(base: Path, out: Path, machine: Machine) -> None:
    """Pack the machine's axes and modes alone, for a run that gives the unit all else; errors as `pack_whole`."""
    from feedsim_packager import whole_machine

    pose = {axis: machine.pose[axis] for axis in machine.axes}
    with packaging(), _poses(machine) as poses:
        given = whole_machine.WholeMachine(plant_tables(machine.modes, pose, poses, machine.mounts_table), None, {})
        packed(base, out, given, name=machine.name, note=machine.note, trial=False, level=0)


@contextmanager
def _poses(machine: Machine) -> Iterator[Path | None]:
    """The grid of poses of the machine's own plant archive, where it has one."""
    if machine.plant is None:
        yield None
        return
    with Archive(machine.plant) as archive:
        file = archive.directory / POSES_IN_ARCHIVE
        yield file if file.is_file() else None


def parameters(machine: Machine, coupling: Coupling, *, built_in: bool) -> Mapping[str, Parameter]:
    """Parameters of the unit by their names.

    Raises:
        InputError: lists the roles that another unit or law fills than this one holds.
    """
    others = [
        (axis, f"its {unit.role.name} is {unit.fmu.name}, another maker's unit; one unit holds the shipped ones alone")
        for axis, unit in machine.foreign_units
    ]
    others += [
        (axis, f"its friction has the law {friction.law}; one unit holds LuGre alone")
        for axis, friction in machine.shipped_frictions.items()
        if not isinstance(friction, Friction)
    ]
    if others:
        raise InputError.of(
            "the machine cannot be one unit",
            [
                f"axis {axis}: {other}: coupling.units: separate runs it, feedsim export without --one wires it"
                for axis, other in others
            ],
        )
    values: dict[str, Parameter] = {
        "coupling.scheme": SCHEMES[coupling.scheme].number,
        "coupling.substeps": coupling.substeps,
        "motion.built_in": built_in,
    }
    for name, axis in machine.axes.items():
        at_motor = axis.friction_at_motor
        values |= {f"{name}.drive.{key}": value for key, value in controller_parameters(machine, name).items()}
        values |= {f"{name}.friction.{key}": value for key, value in at_motor.items()}
        values[f"{name}.M_0"] = axis.M_0
    return values | dict(machine.errors)
