"""Importers in Rust, each stepping one unit: the program fmi-sim, and the crate fmu-runner by a program of ours.

Cargo builds both, by `make test-importers`; FEEDSIM_IMPORTERS names the folder that holds them.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np

from importers.system import Experiment, Floats, Result, System

VERSIONS = {"fmi-sim": "0.7.0", "fmu-runner": "0.4.4"}
PROGRAMS = {"fmi-sim": "fmi-sim", "fmu-runner": "fmu-runner-program"}
TIMEOUT = 240.0  # s


def program(name: str) -> Path | None:
    """The program of that importer, where it is installed."""
    folder = os.environ.get("FEEDSIM_IMPORTERS")
    found = shutil.which(PROGRAMS[name], path=str(Path(folder).resolve() / "cargo" / "bin")) if folder else None
    return Path(found) if found else None


def _only(system: System) -> Path:
    (component,) = system.components.values()
    assert not component.start, "start values are those of the archive"
    return component.archive


def _call(name: str, *words: str, folder: Path) -> str:
    path = program(name)
    assert path is not None, "ask program() first"
    done = subprocess.run([path, *words], cwd=folder, capture_output=True, text=True, timeout=TIMEOUT)
    assert done.returncode == 0, f"{name} ends with {done.returncode}:\n{(done.stdout + done.stderr)[-2000:]}"
    return done.stdout


def _result(experiment: Experiment, rows: Floats) -> Result:
    """`rows` (steps + 1, signals), in the order of the record."""
    assert rows.shape == (experiment.steps + 1, len(experiment.record))
    return {key: rows[:, i] for i, key in enumerate(experiment.record)}


def run_sim(system: System, experiment: Experiment, folder: Path) -> Result:
    """fmi-sim writes every output of the unit."""
    table = folder / "fmi-sim.csv"
    words = ["--model", str(_only(system)), "-o", str(table), "co-simulation"]
    words += ["--step", repr(experiment.step), "--output-interval", repr(experiment.step)]
    _call("fmi-sim", *words, "-n", "0", "-f", repr(experiment.stop), folder=folder)
    header, *lines = table.read_text().splitlines()
    columns = [header.split(",").index(name) for _, name in experiment.record]
    rows = np.array([[float(line.split(",")[column]) for column in columns] for line in lines])
    return _result(experiment, rows)


def run_runner(system: System, experiment: Experiment, folder: Path) -> Result:
    """fmu-runner by the program in `rust/`."""
    names = [name for _, name in experiment.record]
    output = _call(
        "fmu-runner", str(_only(system)), repr(experiment.step), str(experiment.steps), *names, folder=folder
    )
    return _result(experiment, np.loadtxt(output.splitlines(), delimiter=",", ndmin=2))
