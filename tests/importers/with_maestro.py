"""Maestro, the INTO-CPS co-simulation engine (Java): a JSON multi-model, its CSV back.

Its jar comes from Maven, by `make test-importers`; FEEDSIM_IMPORTERS names the folder that holds it.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np

from importers.system import Experiment, Result, System

VERSION = "3.1.1"
JAR = f"maestro-{VERSION}-jar-with-dependencies.jar"
TIMEOUT = 240.0  # s; a start of Java and a type check take 10 s, a step of eight units about 0.5 ms


def jar() -> Path | None:
    """Maestro's jar, where it is installed and Java too."""
    folder = os.environ.get("FEEDSIM_IMPORTERS")
    path = Path(folder).resolve() / JAR if folder else None
    return path if path is not None and path.is_file() and shutil.which("java") else None


def multi_model(system: System, experiment: Experiment) -> dict[str, object]:
    """The multi-model: units as `{name}`, their instances as `{name}.name_i`."""
    key = {name: f"{{{name}}}.{name}_i" for name in system.components}
    connections: dict[str, list[str]] = {}
    for (source, output), (target, given) in system.connections:
        connections.setdefault(f"{key[source]}.{output}", []).append(f"{key[target]}.{given}")
    log: dict[str, list[str]] = {}
    for instance, variable in experiment.record:
        log.setdefault(key[instance], []).append(variable)
    return {
        "fmus": {f"{{{name}}}": component.archive.resolve().as_uri() for name, component in system.components.items()},
        "connections": connections,
        "parameters": {
            f"{key[name]}.{variable}": value
            for name, component in system.components.items()
            for variable, value in component.start.items()
        },
        "algorithm": {"type": "fixed-step", "size": experiment.step},
        "startTime": 0.0,
        # Half a step more, so that no rounding leaves out the last one; Maestro stops ahead of the end time.
        "endTime": experiment.stop,
        "logVariables": log,
        "loggingOn": False,
        "visible": False,
    }


def run(system: System, experiment: Experiment, folder: Path) -> Result:
    """Step a system; files go into `folder`."""
    path = jar()
    assert path is not None, "ask jar() first"
    model = folder / "multi-model.json"
    model.write_text(json.dumps(multi_model(system, experiment), indent=1))
    command = ["java", "-jar", str(path), "import", "--interpret", "-output=out", "sg1", model.name]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT)
    table = folder / "out" / "outputs.csv"
    assert table.is_file(), f"Maestro left no results:\n{(done.stdout + done.stderr)[-2000:]}"
    header, *_ = table.read_text().partition("\n")
    columns = header.split(",")
    rows = np.loadtxt(table, delimiter=",", skiprows=1)
    result: Result = {}
    for instance, variable in experiment.record:
        values = np.full(experiment.steps + 1, np.nan)
        column = rows[:, columns.index(f"{{{instance}}}.{instance}_i.{variable}")]
        values[: len(column)] = column[: experiment.steps + 1]
        result[instance, variable] = values
    return result
