"""Step a unit's archive through a reference case, with nothing but FMPy.

The unit is stepped at the case's StepSize; each step gets the value of the inputs at its start and their slope, so that
the unit sees exactly the piecewise linear inputs that the reference was computed for; or the value alone (held inputs).
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from reference_files import Case, Table, booleans


class Unusable(Exception):
    """An archive that is missing, lacks a variable or reports an error."""


def simulate(archive: Path, case: Case) -> Table:
    """The unit's outputs at every communication point, the reference's instants among them; raises Unusable."""
    if not archive.is_file():
        raise Unusable(f"{archive}: no such archive (make fmus builds it)")
    try:
        with tempfile.TemporaryDirectory() as directory:
            return _simulate(archive, case, directory)
    except Unusable:
        raise
    except Exception as error:  # whatever fmpy or the unit raises, the archive cannot be used
        raise Unusable(f"{archive.name}, case {case.name}: {error}") from error


def _simulate(archive: Path, case: Case, directory: str) -> Table:
    fmpy.extract(str(archive), directory)
    description = fmpy.read_model_description(str(archive))
    variables = {variable.name: variable for variable in description.modelVariables}
    inputs = [name for name in case.inputs if name != "time"]
    outputs = [name for name in case.reference if name != "time"]
    unknown = [name for name in (*inputs, *outputs, *case.parameters) if name not in variables]
    if unknown:
        raise Unusable(f"{archive.name}, case {case.name}: no variable {', '.join(unknown)}")
    unit = FMU2Slave(
        guid=description.guid,
        unzipDirectory=directory,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName=case.name,
    )
    unit.instantiate()
    try:
        unit.setupExperiment(startTime=case.start, stopTime=case.stop)
        _set_parameters(unit, variables, case)
        unit.enterInitializationMode()
        return _step(unit, variables, case, inputs, outputs)
    finally:
        unit.terminate()
        unit.freeInstance()


def _set_parameters(unit: FMU2Slave, variables: dict[str, Any], case: Case) -> None:
    for name, value in case.parameters.items():
        reference = [variables[name].valueReference]
        match variables[name].type:
            case "Real":
                unit.setReal(reference, [value])
            case "Integer":
                unit.setInteger(reference, [round(value)])
            case "Boolean":
                unit.setBoolean(reference, [bool(value)])
    if case.modes:
        unit.setString([variables["modes_file"].valueReference], [str(case.modes)])


def _check_instants(case: Case) -> None:
    """Every row of the reference is at a communication point."""
    elapsed = case.reference["time"] - case.start
    if np.max(np.abs(np.round(elapsed / case.step) * case.step - elapsed)) > 1e-9:
        raise Unusable(f"case {case.name}: the reference has instants that are no multiples of the step {case.step} s")


def _step(unit: FMU2Slave, variables: dict[str, Any], case: Case, inputs: list[str], outputs: list[str]) -> Table:
    steps = round((case.stop - case.start) / case.step)
    t = case.start + np.arange(steps + 1) * case.step
    flags = [name for name in inputs if variables[name].type == "Boolean"]
    inputs = [name for name in inputs if name not in flags]
    switched = np.array([booleans(case.inputs, name, t) for name in flags]).reshape(-1, len(t))
    switch = [variables[name].valueReference for name in flags]
    given = np.array([np.interp(t, case.inputs["time"], case.inputs[name]) for name in inputs]).reshape(-1, len(t))
    slopes = np.diff(given, axis=1) / case.step
    into = [variables[name].valueReference for name in inputs]
    _check_instants(case)

    def outputs_now() -> list[float]:
        """Real outputs in one call, the others one by one."""
        values: dict[str, float] = {}
        real = [name for name in outputs if variables[name].type == "Real"]
        values |= zip(real, unit.getReal([variables[name].valueReference for name in real]), strict=True)
        for name in outputs:
            if name not in values:
                get = unit.getBoolean if variables[name].type == "Boolean" else unit.getInteger
                values[name] = float(get([variables[name].valueReference])[0])
        return [values[name] for name in outputs]

    unit.setReal(into, given[:, 0].tolist())
    unit.setBoolean(switch, [bool(value) for value in switched[:, 0]])
    unit.exitInitializationMode()
    rows = [outputs_now()]
    first_order = [1] * len(into)
    for k in range(steps):
        unit.setReal(into, given[:, k].tolist())
        unit.setBoolean(switch, [bool(value) for value in switched[:, k]])
        if into and not case.held:
            unit.setRealInputDerivatives(into, first_order, slopes[:, k].tolist())
        unit.doStep(float(t[k]), case.step)
        rows.append(outputs_now())
    table = np.array(rows)
    return {"time": t} | {name: table[:, i] for i, name in enumerate(outputs)}
