"""Make the pinned reference results anew, of the units by SciPy and of the scenarios by the monolithic implementation,
and none by the units themselves (`make reference`)."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import solve_controller
import solve_friction
import solve_friction_gms
import solve_plant
import solve_setpoint
import system
from cases import STEP, Pinned, controller_cases, friction_cases, friction_gms_cases, grid, plant_cases, setpoint_cases
from reference_files import HERE, UNITS, Case, write_inputs, write_reference

SOLVERS = {
    "friction": solve_friction.solve,
    "friction_gms": solve_friction_gms.solve,
    "plant": solve_plant.solve,
    "controller": solve_controller.solve,
    "setpoint": solve_setpoint.solve,
}
CASES = {
    "friction": friction_cases,
    "friction_gms": friction_gms_cases,
    "plant": plant_cases,
    "controller": controller_cases,
    "setpoint": setpoint_cases,
}
CONTINUOUS = ("friction", "friction_gms", "plant")
ALL = (*UNITS, system.FOLDER)


def pinned(unit: str) -> list[Pinned]:
    """All cases of a unit."""
    return CASES[unit]()


def refined(case: Case, every: float) -> Case:
    """The same piecewise linear inputs with a row every `every` seconds at least."""
    if len(case.inputs["time"]) > round(case.stop / every):
        return case
    t = grid(case.stop, every)
    inputs = {name: np.interp(t, case.inputs["time"], values) for name, values in case.inputs.items()}
    return replace(case, inputs=inputs | {"time": t})


def make_case(wanted: Pinned, root: Path) -> Iterator[str]:
    """Write the files of one case; yields what they are of."""
    case = write_inputs(wanted.case, root)
    if case.modes:
        (root / case.unit / f"{case.name}_modes.csv").write_bytes(case.modes.read_bytes())
    solve = SOLVERS[case.unit]
    finer = refined(case, case.step) if case.unit in CONTINUOUS else case
    write_reference(case, solve(finer, case.step, wanted.outputs), wanted.every, root)
    yield f"{case.unit}/{case.name}"
    # a controller samples at the start of its cycles: held or linear is one to it where a step is a cycle
    if case.moving and (case.unit in CONTINUOUS or case.step != STEP):
        held = replace(finer, held=True)
        write_reference(held, solve(held, case.step, wanted.outputs), wanted.every, root)
        yield f"{case.unit}/held/{case.name}"


def make(root: Path = HERE, wanted: tuple[str, ...] = ALL) -> Iterator[str]:
    """Write all cases of the wanted units, and the scenarios with "system", below `root`; yields what was written."""
    for unit in wanted:
        if unit == system.FOLDER:
            yield from system.make(root)
            continue
        for case in pinned(unit):
            yield from make_case(case, root)


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(description="Make the pinned reference results anew.")
    parser.add_argument(
        "--out", type=Path, default=HERE, metavar="DIR", help="where to write (default: over the pinned)"
    )
    parser.add_argument("what", nargs="*", metavar="WHAT", help=f"of {', '.join(ALL)} (default: all)")
    options = parser.parse_args(arguments)
    if unknown := set(options.what) - set(ALL):
        parser.error(f"no references of {', '.join(sorted(unknown))}; there are {', '.join(ALL)}")
    for name in make(options.out, tuple(options.what) or ALL):
        print(options.out / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
