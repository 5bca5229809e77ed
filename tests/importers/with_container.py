"""fmucontainer of the FMU Manipulation Toolbox: the system becomes one FMU, which FMPy steps."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.operations import Interpreter, do_step
from feedsim.simulation.cosim.unit import Port, Unit
from importers.system import Experiment, Result, System

OUT = "recorded."  # a container calls its links `instance.variable` already


def build(system: System, experiment: Experiment, folder: Path, *, sequential: bool = False) -> Path:
    """One FMU of the system's units, in `folder`. Recorded variables are its outputs `recorded.instance.variable`."""
    from fmu_manipulation_toolbox.assembly import AssemblyNode

    path = folder / "container.fmu"
    nothing_by_itself = {"auto_link": False, "auto_input": False, "auto_output": False}
    node = AssemblyNode(path.name, step_size=experiment.step, sequential=sequential, **nothing_by_itself)
    for name, component in system.components.items():
        node.add_fmu(f"{name}.fmu", str(component.archive.resolve()))
    for source, target in system.connections:
        node.add_link(f"{source[0]}.fmu", source[1], f"{target[0]}.fmu", target[1])
    for name, component in system.components.items():
        for variable, value in component.start.items():
            node.add_start_value(f"{name}.fmu", variable, str(value).lower() if isinstance(value, bool) else str(value))
    for instance, variable in experiment.record:
        node.add_output(f"{instance}.fmu", variable, f"{OUT}{instance}.{variable}")
    node.make_fmu(folder)
    return path


def run(system: System, experiment: Experiment, folder: Path, *, sequential: bool = False) -> Result:
    """Step a system; files go into `folder`."""
    result: Result = {key: np.empty(experiment.steps + 1) for key in experiment.record}
    with Archive(build(system, experiment, folder, sequential=sequential)) as archive:
        unit = Unit(archive, "container")
        try:
            unit.enter_initialisation(0.0, experiment.stop)
            unit.exit_initialisation()
            port = Port(unit, [OUT + ".".join(key) for key in experiment.record])
            steps = Interpreter([do_step(unit, 0.0, experiment.step)], experiment.step)
            for k in range(experiment.steps + 1):
                if k:
                    steps.run(k - 1, k)
                port.get()
                for key, value in zip(experiment.record, port.values, strict=True):
                    result[key][k] = value
        finally:
            unit.close()
    return result
