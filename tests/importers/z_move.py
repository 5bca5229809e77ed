"""The Z move as every importer runs it: eight instances, wired by hand as docs/importing.md says."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim import scenario
from feedsim.files.trace import Trace
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim.roles import controller_parameters
from feedsim.simulation.cosim.system import plant_parameters
from feedsim_packager import repack, setpoints
from feedsim_packager.machine import named
from feedsim_packager.resources import File
from importers.system import Component, Experiment, Floats, Result, System, difference

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = ROOT / "scenarios" / "z_positioning.yaml"
STEP = 125e-6  # s, the control cycle
# Every value is compared, at every control cycle: the settling after the move counts, a second of rest adds nothing.
OVERRIDES = ("recording.interval=125 us", "motions.1.duration=0.4 s")


@dataclass(frozen=True)
class Move:
    """The scenario, its planned motions, and the experiment that an importer does."""

    scenario: scenario.Scenario
    program: nc.Program
    experiment: Experiment

    @property
    def axes(self) -> tuple[str, ...]:
        return tuple(self.scenario.machine.axes)


def load() -> Move:
    """The Z move of the default machine with a short dwell."""
    loaded = scenario.load(SCENARIO, OVERRIDES)
    program = nc.plan(loaded)
    axes = tuple(loaded.machine.axes)
    steps = round(float(program.time[-1]) / STEP)
    record = tuple(("plant", f"{axis}.x_a") for axis in axes) + tuple((f"controller_{axis}", "M_a") for axis in axes)
    return Move(loaded, program, Experiment(STEP, steps, record))


def table(fmus: Path, file: Path, time: Floats, columns: dict[str, tuple[Floats, Floats]]) -> Path:
    """The archive `file`: the unit that plays a table, with these columns (x_s, n_ffw) per axis."""
    content = setpoints.write(time.tolist(), {name: (a.tolist(), b.tolist()) for name, (a, b) in columns.items()})
    given = setpoints.check(File("setpoints.csv", content))
    repack.repack(fmus / "setpoint.fmu", given, named(file.stem, ""), file)
    return file


def hand_wired(move: Move, fmus: Path, folder: Path) -> System:
    """The system as docs/importing.md describes it, instances in the order setpoint, controllers, plant, frictions."""
    machine, program, axes = move.scenario.machine, move.program, move.axes
    columns = {axis: (program.x_s[axis], program.n_ffw[axis]) for axis in axes}
    components = {"setpoint": Component(table(fmus, folder / "z_move.fmu", program.time, columns))}
    connections = []
    for axis in axes:
        control, contact = f"controller_{axis}", f"friction_{axis}"
        components[control] = Component(fmus / "controller.fmu", controller_parameters(machine, axis))
        connections += [
            (("setpoint", f"{axis}.x_s"), (control, "x_s")),
            (("setpoint", f"{axis}.n_ffw"), (control, "n_ffw")),
            (("setpoint", f"{axis}.release"), (control, "release")),
            (("plant", f"{axis}.x_a"), (control, "x_a")),
            (("plant", f"{axis}.n_a"), (control, "n_a")),
            ((control, "M_a"), ("plant", f"{axis}.M_a")),
            (("plant", f"{axis}.n_fr"), (contact, "n_fr")),
            ((contact, "M_fr"), ("plant", f"{axis}.M_fr")),
        ]
    components["plant"] = Component(fmus / "plant.fmu", plant_parameters(machine, None))
    for axis in axes:
        components[f"friction_{axis}"] = Component(fmus / "friction.fmu", machine.axes[axis].friction.parameters())
    return System(components, tuple(connections))


def own(move: Move, scheme: str, fmus: Path) -> Trace:
    """The scenario run by this project's own master."""
    loaded = scenario.load(SCENARIO, (*OVERRIDES, f"coupling.scheme={scheme}"))
    return cosim.run(loaded, program=move.program, fmus=fmus).trace


def as_result(trace: Trace, move: Move) -> Result:
    """A trace's columns under the names of the units."""
    return {
        (instance, variable): trace[variable if instance == "plant" else f"{instance.removeprefix('controller_')}.M_a"]
        for instance, variable in move.experiment.record
    }


def overshoot(result: Result, move: Move) -> float:
    """Overshoot of Z [um]."""
    return float(np.nanmax(result["plant", "Z.x_a"]) - move.program.x_s["Z"][-1]) * 1e6


def differences(a: Result, b: Result, move: Move) -> tuple[float, float]:
    """Largest difference of any axis: x_a [nm], M_a [mN.m]."""
    x = max(difference(a[key], b[key]) for key in move.experiment.record if key[1] != "M_a")
    torque = max(difference(a[key], b[key]) for key in move.experiment.record if key[1] == "M_a")
    return x * 1e9, torque * 1e3
