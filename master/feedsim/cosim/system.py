"""The units of the paper's Fig. 2, instantiated, parameterised, wired through shared buffers and initialised."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from feedsim.cosim import wiring
from feedsim.cosim.plant import axes_of, open_plant
from feedsim.cosim.unit import Archive, Floats, Port, Unit
from feedsim.nc import Program
from feedsim.scenario import Axis, Machine


@dataclass(frozen=True)
class Control:
    """A drive controller with its ports."""

    unit: Unit
    setpoint: Port  # x_s, n_ffw
    measured: Port  # x_a, n_a
    torque: Port  # M_a


@dataclass(frozen=True)
class Contact:
    """A friction unit with its ports."""

    unit: Unit
    speed: Port  # n_fr
    torque: Port  # M_fr


class System:
    """All units of a machine (a context manager that frees them).

    Without friction there are no friction units, and M_fr stays 0: a LuGre model cannot be parameterised away.

    Shared buffers, one entry per axis in the machine's order; an exchange step runs from its start to its end:

    ======================= ==============================================================================
    M_a_start, M_a_end      motor torque at the ends of the control cycle, M_a_slope in between
    M_a                     motor torque at the start of the exchange step
    M_fr, M_fr_slope        friction torque at the start of the exchange step and the slope of the last one
    n_start, n_end          speed at the friction contact at the ends of the exchange step
    n, n_slope              what the friction units are told of it
    measured                x_a and n_a of every axis at the end of the exchange step
    ======================= ==============================================================================
    """

    def __init__(self, machine: Machine, fmus: Path, *, friction: bool = True) -> None:
        self.axes = tuple(machine.axes)
        self.friction = friction
        self._open: list[Archive | Unit] = []
        try:
            self._build(machine, fmus)
        except BaseException:
            self.close()
            raise

    def _build(self, machine: Machine, fmus: Path) -> None:
        plant = open_plant(machine, fmus)
        archives = {"plant": plant.archive}
        self._open.append(plant.archive)
        for name in ("controller", "friction") if self.friction else ("controller",):
            archives[name] = Archive(fmus / f"{name}.fmu")
            self._open.append(archives[name])
        self.archives = archives
        instances = {wiring.PLANT: archives["plant"]}
        for axis in self.axes:
            instances[wiring.controller(axis)] = archives["controller"]
            if self.friction:
                instances[wiring.friction(axis)] = archives["friction"]
        wiring.check(wiring.figure_2(self.axes, with_friction=self.friction), instances)
        self.units = {name: self._instantiate(archive, name) for name, archive in instances.items()}
        self.plant = self.units[wiring.PLANT]
        self.plant_axes, self.plant_modes_file = axes_of(plant.archive), plant.modes_file

        self.plant.set_parameters(plant_parameters(machine, plant.modes_file))
        for axis, described in machine.axes.items():
            self.units[wiring.controller(axis)].set_parameters(controller_parameters(machine, described))
            self.units[wiring.controller(axis)].set_parameters({wiring.RELEASE: True})
            if self.friction:
                self.units[wiring.friction(axis)].set_parameters(described.friction.parameters())
        self._share_buffers()

    def _instantiate(self, archive: Archive, name: str) -> Unit:
        unit = Unit(archive, name)
        self._open.append(unit)
        return unit

    def _share_buffers(self) -> None:
        axes, count = self.axes, len(self.axes)

        def buffer() -> Floats:
            return np.zeros(count)

        self.M_a_start, self.M_a_end = buffer(), buffer()
        self.n_start, self.n, self.n_slope, self.n_slope_last = (buffer() for _ in range(4))
        # What the plant takes and gives lies together, for one call each.
        inputs, slopes, outputs = np.zeros(2 * count), np.zeros(2 * count), np.zeros(3 * count)
        self.M_a, self.M_a_slope = inputs[:count], slopes[:count]
        self.M_fr, self.M_fr_slope = inputs[count:], slopes[count:]
        self.n_end, self.measured = outputs[:count], outputs[count:]

        plant = self.plant
        torques, frictions = [f"{axis}.M_a" for axis in axes], [f"{axis}.M_fr" for axis in axes]
        contacts = [f"{axis}.n_fr" for axis in axes]
        measured = [f"{axis}.{y}" for axis in axes for y in ("x_a", "n_a")]
        self.plant_torque = Port(plant, torques, self.M_a, self.M_a_slope)
        self.plant_inputs = Port(plant, [*torques, *frictions], inputs, slopes)
        self.plant_outputs = Port(plant, [*contacts, *measured], outputs)
        self.controllers: list[Control] = []
        self.contacts: list[Contact] = []
        for i, axis in enumerate(axes):
            own = slice(i, i + 1)
            control = self.units[wiring.controller(axis)]
            self.controllers.append(
                Control(
                    unit=control,
                    setpoint=Port(control, ["x_s", "n_ffw"]),
                    measured=Port(control, ["x_a", "n_a"], self.measured[2 * i : 2 * i + 2]),
                    torque=Port(control, ["M_a"], self.M_a_end[own], self.M_a_slope[own]),
                )
            )
            if not self.friction:
                continue
            contact = self.units[wiring.friction(axis)]
            self.contacts.append(
                Contact(
                    unit=contact,
                    speed=Port(contact, ["n_fr"], self.n[own], self.n_slope[own]),
                    torque=Port(contact, ["M_fr"], self.M_fr[own], self.M_fr_slope[own]),
                )
            )

    def initialise(self, program: Program, stop: float) -> None:
        """Initialise every unit at t = 0 and bring the buffers to the initial outputs. The run ends at `stop` [s]."""
        for unit in self.units.values():
            unit.enter_initialisation(0.0, stop)
            unit.check_parameters()
        self.plant_outputs.get()
        self.n_start[:] = self.n[:] = self.n_end
        for contact in self.contacts:
            contact.speed.set()
            contact.torque.get()
        self.set_setpoints(program, 0)
        for control in self.controllers:
            control.measured.set()
            control.torque.get()
        self.M_a[:] = self.M_a_end
        self.plant_inputs.set()
        for unit in self.units.values():
            unit.exit_initialisation()

    def set_setpoints(self, program: Program, i: int) -> None:
        """Hand over the setpoints of position cycle i."""
        for axis, control in zip(self.axes, self.controllers, strict=True):
            control.setpoint.values[0] = program.x_s[axis][i]
            control.setpoint.values[1] = program.n_ffw[axis][i]
            control.setpoint.set()

    @property
    def warnings(self) -> list[str]:
        return [warning for unit in self.units.values() for warning in unit.warnings]

    def close(self) -> None:
        for part in reversed(self._open):
            part.close()
        self._open.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def plant_parameters(machine: Machine, modes_file: Path | None) -> dict[str, float | int | bool | str]:
    """Parameters of the plant unit by FMU name. `modes_file` None: the modes of the archive count."""
    parameters: dict[str, float | int | bool | str] = {}
    if modes_file is not None:
        parameters["modes_file"] = str(modes_file)
    for name, axis in machine.axes.items():
        parameters[f"{name}.x_0"] = machine.pose[name]
        parameters[f"{name}.M_0"] = axis.M_0
    return parameters


def controller_parameters(machine: Machine, axis: Axis) -> dict[str, float | int | bool | str]:
    """Parameters of an axis's controller by FMU name."""
    cycles = {"T_c": machine.cycles.T_c, "T_pos": machine.cycles.T_pos, "I_P": axis.I_P}
    return {**axis.drive.parameters(), **cycles}
