"""fmuloader: the functions of one unit's library as Python calls; modelDescription.xml is for others to read."""

from __future__ import annotations

import ctypes
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from fmpy import read_model_description

from importers.system import Experiment, Result, System


class _Lenient:
    """A library, with a function that nobody calls in place of each that it does not have."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library

    def __getattr__(self, name: str) -> Any:
        return getattr(self._library, name, SimpleNamespace())


def run(system: System, experiment: Experiment, folder: Path) -> Result:
    """Step a system of one unit."""
    from fmuloader.fmi2 import Fmi2Slave, Fmi2Type

    class Slave(Fmi2Slave):
        def _bind_functions(self) -> None:
            """fmuloader wants the functions for model exchange of every unit."""
            library, self._dll = self._dll, _Lenient(self._dll)
            super()._bind_functions()
            self._dll = library

    ((name, component),) = system.components.items()
    assert not component.start, "start values are those of the archive"
    description = read_model_description(str(component.archive))
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    wanted = [references[variable] for _, variable in experiment.record]
    rows = np.empty((experiment.steps + 1, len(wanted)))
    with Slave(component.archive, model_identifier=description.coSimulation.modelIdentifier) as unit:
        # Its memory functions cut addresses to 32 bits; without them a unit uses its own.
        kind, own = Fmi2Type.CO_SIMULATION, {"cannot_use_memory_management_functions": True}
        unit.instantiate(name, kind, guid=description.guid, **own)
        unit.setup_experiment(start_time=0.0)
        unit.enter_initialization_mode()
        unit.exit_initialization_mode()
        rows[0] = unit.get_real(wanted)
        for k in range(experiment.steps):
            unit.do_step(k * experiment.step, experiment.step)
            rows[k + 1] = unit.get_real(wanted)
        unit.terminate()
    return {key: rows[:, i] for i, key in enumerate(experiment.record)}
