"""ecos: a system built through its Python interface, or an SSP file."""

from __future__ import annotations

import ctypes
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from importers.system import Experiment, Result, System, boolean

if TYPE_CHECKING:
    from ecospy import EcosSimulation

SSP_PARAMETERS = "parameters"  # name of the sets in `feedsim export` files; ecos applies none that it is not told of


def load() -> None:
    """Make the package `tbb` serve where the machine has no TBB of its own: ecos' library asks for libtbb.so.12.

    Raises:
        ImportError: ecos is not installed. OSError: it is, but no TBB is found.
    """
    try:
        installed = metadata.files("tbb") or []
    except metadata.PackageNotFoundError:
        installed = []
    for file in installed:
        if file.name == "libtbb.so.12":
            ctypes.CDLL(str(Path(str(file.locate())).resolve()), ctypes.RTLD_GLOBAL)
    import ecospy

    ecospy.EcosLib.set_log_level("warn")


def run(system: System | Path, experiment: Experiment) -> Result:
    """Step a system, or the SSP file of one."""
    load()
    from ecospy import EcosSimulation, EcosSimulationStructure

    if isinstance(system, Path):
        with EcosSimulation(step_size=experiment.step, ssp_path=str(system)) as simulation:
            return _step(simulation, experiment, SSP_PARAMETERS)
    with EcosSimulationStructure() as structure:
        for name, component in system.components.items():
            structure.add_model(name, component.archive)
        for source, target in system.connections:
            connect = structure.make_bool_connection if boolean(source[1]) else structure.make_real_connection
            connect("::".join(source), "::".join(target))
        start = {
            f"{name}::{variable}": value
            for name, component in system.components.items()
            for variable, value in component.start.items()
        }
        if start:
            structure.add_parameter_set("start", start)
        with EcosSimulation(step_size=experiment.step, structure=structure) as simulation:
            return _step(simulation, experiment, "start" if start else None)


def _step(simulation: EcosSimulation, experiment: Experiment, parameter_set: str | None) -> Result:
    from ecospy import EcosLib

    result: Result = {key: np.empty(experiment.steps + 1) for key in experiment.record}
    if not simulation.init(parameter_set=parameter_set):
        raise RuntimeError(EcosLib.get_last_error())
    for k in range(experiment.steps + 1):
        if k:
            simulation.step(1)
        for key, values in result.items():
            values[k] = simulation.get_real("::".join(key))
    return result
