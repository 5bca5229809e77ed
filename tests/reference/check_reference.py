"""Run each unit's archive over its reference cases and compare (`make check-reference`).

The unit is stepped at the case's StepSize; each step gets the value of the inputs at its start and their slope, so that
the unit sees exactly the piecewise linear inputs that the reference was computed for.

Exit code: 0 all the same, 1 something differs, 2 an archive is missing or cannot be used.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from reference_files import HERE, UNITS, Case, Table, case_names, read_case

ARCHIVES = HERE.parents[1] / "fmus"


@dataclass(frozen=True)
class Tolerance:
    """Allowed deviation: absolute [unit of the variable] plus relative to the largest magnitude of the column."""

    absolute: float
    relative: float = 0.0


TOLERANCES: dict[str, dict[str, Tolerance]] = {
    "friction": {
        # the step is of second order: 6-9 uN.m over a circle's turn at 125 us
        "M_fr": Tolerance(15e-6),
        # the same torque error through the bristle stiffness, 300 N.m/rad
        "z": Tolerance(5e-8),
        # the travelled angle is exact for a linear speed: rounding of 16,000 additions
        "c": Tolerance(1e-12),
        # c over a width of 0.04 rad
        "k": Tolerance(1e-10),
        "lambda": Tolerance(1e-10),
    },
    # exact for linear inputs: rounding of 4,000 steps against one exponential per knot, and the file's 15 digits
    "plant": {"": Tolerance(1e-15, 1e-12)},
    # the same sampled arithmetic in another order: rounding, carried on by integrators and filters
    "controller": {"": Tolerance(1e-12, 1e-10)},
}


@dataclass(frozen=True)
class Deviation:
    """Largest deviation of one variable over one case."""

    unit: str
    case: str
    variable: str
    deviation: float
    tolerance: float

    @property
    def same(self) -> bool:
        """Within the tolerance; a deviation that is not a number is none."""
        return self.deviation <= self.tolerance


class Unusable(Exception):
    """An archive that is missing, lacks a variable or reports an error."""


def simulate(archive: Path, case: Case) -> Table:
    """The unit's outputs at the reference's instants, which must be communication points."""
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
        unit.setupExperiment(startTime=0.0, stopTime=case.stop)
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


def _step(unit: FMU2Slave, variables: dict[str, Any], case: Case, inputs: list[str], outputs: list[str]) -> Table:
    steps = round(case.stop / case.step)
    t = np.arange(steps + 1) * case.step
    given = np.array([np.interp(t, case.inputs["time"], case.inputs[name]) for name in inputs])
    slopes = np.diff(given, axis=1) / case.step
    into = [variables[name].valueReference for name in inputs]
    out = [variables[name].valueReference for name in outputs]
    wanted = np.round(case.reference["time"] / case.step).astype(int)
    if np.max(np.abs(wanted * case.step - case.reference["time"])) > 1e-9:
        raise Unusable(f"case {case.name}: the reference has instants that are no multiples of the step {case.step} s")

    unit.setReal(into, given[:, 0].tolist())
    unit.exitInitializationMode()
    rows = {0: unit.getReal(out)}
    instants = set(wanted.tolist())
    first_order = [1] * len(into)
    for k in range(steps):
        unit.setReal(into, given[:, k].tolist())
        unit.setRealInputDerivatives(into, first_order, slopes[:, k].tolist())
        unit.doStep(float(t[k]), case.step)
        if k + 1 in instants:
            rows[k + 1] = unit.getReal(out)
    table = np.array([rows[k] for k in wanted])
    return {"time": case.reference["time"]} | {name: table[:, i] for i, name in enumerate(outputs)}


def compare(case: Case, result: Table) -> Iterator[Deviation]:
    """Largest deviation of every variable of the reference."""
    tolerances = TOLERANCES[case.unit]
    for name, expected in case.reference.items():
        if name == "time":
            continue
        tolerance = tolerances.get(name) or tolerances[""]
        allowed = tolerance.absolute + tolerance.relative * float(np.max(np.abs(expected)))
        # numpy's max hands a NaN on, and NaN is not within any tolerance
        yield Deviation(case.unit, case.name, name, float(np.max(np.abs(result[name] - expected))), allowed)


def check(archives: Path = ARCHIVES, root: Path = HERE) -> Iterator[Deviation]:
    """All units over all cases; raises Unusable."""
    for unit in UNITS:
        for name in case_names(unit, root):
            case = read_case(unit, name, root)
            yield from compare(case, simulate(archives / f"{unit}.fmu", case))


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(description="Compare the units' outputs with the pinned reference results.")
    parser.add_argument("--fmus", type=Path, default=ARCHIVES, metavar="DIR", help="where the archives are")
    parser.add_argument("--cases", type=Path, default=HERE, metavar="DIR", help="where the reference results are")
    options = parser.parse_args(arguments)
    print(f"{'unit':11s}{'case':20s}{'variable':10s}{'deviation':>12s}{'tolerance':>12s}")
    different = 0
    try:
        for row in check(options.fmus, options.cases):
            verdict = "" if row.same else "  differs"
            different += not row.same
            print(f"{row.unit:11s}{row.case:20s}{row.variable:10s}{row.deviation:12.2e}{row.tolerance:12.2e}{verdict}")
    except Unusable as error:
        print(f"check_reference: {error}", file=sys.stderr)
        return 2
    print("all the same" if different == 0 else f"{different} variables differ")
    return 0 if different == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
