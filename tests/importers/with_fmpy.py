"""FMPy: one unit through simulate_fmu, a system through its SSP runner."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
from fmpy import simulate_fmu
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import Parameter, ParameterSet, read_ssv

from importers.system import Component, Experiment, Floats, Result, System, boolean

SSD = "SystemStructure.ssd"
_NAMESPACES = (
    'xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" '
    'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"'
)


def run_unit(
    component: Component, inputs: Mapping[str, Floats], experiment: Experiment, folder: Path | None = None
) -> Result:
    """One unit, `inputs` (steps + 1,) held from row to row."""
    signals = np.zeros(experiment.steps + 1, dtype=[("time", np.float64), *((name, np.float64) for name in inputs)])
    signals["time"] = np.arange(experiment.steps + 1) * experiment.step
    for name, values in inputs.items():
        signals[name] = values
    table = simulate_fmu(
        str(component.archive),
        stop_time=experiment.stop,
        output_interval=experiment.step,
        start_values=dict(component.start),
        input=signals,
        output=[variable for _, variable in experiment.record],
    )
    return {key: np.asarray(table[key[1]]) for key in experiment.record}


def parameters(path: Path) -> ParameterSet:
    """All parameter sets of an SSP file as the one that simulate_ssp takes, names `instance.variable`.

    FMPy leaves the bindings of an SSP aside and takes the text of a Boolean for true, whatever it says.
    """
    merged = ParameterSet(name="all")
    with ZipFile(path) as archive:
        for name in archive.namelist():
            if not name.endswith(".ssv"):
                continue
            instance = Path(name).stem
            for parameter in read_ssv(str(path), name).parameters:
                value = parameter.value in ("true", "1") if parameter.type == "Boolean" else parameter.value
                merged.parameters.append(
                    Parameter(name=f"{instance}.{parameter.name}", type=parameter.type, value=value)
                )
    return merged


def run_file(path: Path, experiment: Experiment, parameter_set: ParameterSet | None = None) -> Result:
    """Run an SSP file."""
    rows = simulate_ssp(
        str(path),
        # The loop runs while time < stop_time, and the time is a sum.
        stop_time=(experiment.steps - 0.5) * experiment.step,
        step_size=experiment.step,
        parameter_set=parameter_set,
    )
    result: Result = {}
    for key in experiment.record:
        values = np.full(experiment.steps + 1, np.nan)
        values[1:] = rows[".".join(key)][: experiment.steps]  # a row has the time of its step's start
        result[key] = values
    return result


def run(system: System, experiment: Experiment, folder: Path) -> Result:
    """Write a bare SSP of the system into `folder` and run that."""
    path = folder / "system.ssp"
    _write(path, system, experiment)
    merged = ParameterSet(name="all")
    for name, component in system.components.items():
        for variable, value in component.start.items():
            merged.parameters.append(Parameter(name=f"{name}.{variable}", type="Real", value=value))
    return run_file(path, experiment, merged)


def _write(path: Path, system: System, experiment: Experiment) -> None:
    connectors: dict[tuple[str, str], str] = {key: "output" for key in experiment.record}
    for source, target in system.connections:
        connectors[source], connectors[target] = "output", "input"
    elements, archives = [], {component.archive for component in system.components.values()}
    for name, component in system.components.items():
        own = "".join(
            f'<ssd:Connector name="{variable}" kind="{kind}"><ssc:{"Boolean" if boolean(variable) else "Real"}/>'
            "</ssd:Connector>"
            for (instance, variable), kind in connectors.items()
            if instance == name
        )
        elements.append(
            f'<ssd:Component name="{name}" type="application/x-fmu-sharedlibrary" '
            f'source="resources/{component.archive.name}"><ssd:Connectors>{own}</ssd:Connectors></ssd:Component>'
        )
    connections = "".join(
        f'<ssd:Connection startElement="{a}" startConnector="{b}" endElement="{c}" endConnector="{d}"/>'
        for (a, b), (c, d) in system.connections
    )
    text = (
        f'<ssd:SystemStructureDescription {_NAMESPACES} version="1.0" name="system"><ssd:System name="system">'
        f"<ssd:Elements>{''.join(elements)}</ssd:Elements>"
        f"{f'<ssd:Connections>{connections}</ssd:Connections>' if connections else ''}"
        "</ssd:System></ssd:SystemStructureDescription>"
    )
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        archive.writestr(SSD, text)
        for file in sorted(archives):
            archive.write(file, f"resources/{file.name}")
