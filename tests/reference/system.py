"""Pinned references of the shipped scenarios, from the monolithic implementation: <scenario>_ref.csv below system/.

Thinned from the control cycle to what the scenario is about, so that a file stays below 1 MB.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import monolithic
import numpy as np
from monolithic import Machine, Setpoints
from reference_files import HERE, Table, read_table, write_bounds, write_table

FOLDER = "system"
SCENARIOS = HERE.parents[1] / "scenarios"
# 1e-13 m on a position of 1 m: a hundredth of the 2.5 us integration's own error, and of what another compiler's
# rounding does to it
DIGITS = 12


@dataclass(frozen=True)
class Scenario:
    """A scenario by its name, the variables that are pinned and their interval [s]."""

    name: str
    variables: tuple[str, ...]
    every: float

    def setpoints(self, machine: Machine) -> Setpoints:
        """As the scenario's file says, in the reference's own words."""
        if self.name == "z_positioning":
            return monolithic.move(machine, "Z", 0.100, 5.0 / 60, rest=1.2)
        return monolithic.circle(machine, radius=0.015, speed=3.0 / 60, turns=3, rest=0.3)


SYSTEMS = (
    Scenario(
        "z_positioning", ("Z.x_a", "Z.n_a", "Z.M_a", "Z.M_fr", "Z.i_q", "X.x_a", "Y.x_a", "Y.M_a", "tool.x_Z"), 1e-3
    ),
    Scenario(
        "xz_circle", ("X.x_a", "X.M_a", "X.M_fr", "Z.x_a", "Z.M_a", "Z.M_fr", "Y.x_a", "tool.x_X", "tool.x_Z"), 2e-3
    ),
)


def path_of(scenario: Scenario, root: Path = HERE) -> Path:
    """Where its reference is."""
    return root / FOLDER / f"{scenario.name}_ref.csv"


def read(scenario: Scenario, root: Path = HERE) -> Table:
    """The pinned reference."""
    return read_table(path_of(scenario, root))


def solve(scenario: Scenario) -> tuple[Table, Table]:
    """The pinned variables by the monolithic implementation, as pinned and, up to the last row, at every control cycle.

    The builds of other machines differ by rounding.
    """
    machine = monolithic.machine()
    result = monolithic.simulate(machine, scenario.setpoints(machine))
    every = round(scenario.every / machine.T_c)
    # the instants as the cycle counts them, without the digits of k T_c
    dense = {"time": np.round(result["time"], 9)} | {name: result[name] for name in scenario.variables}
    last = (len(dense["time"]) - 1) // every * every
    dense = {name: values[: last + 1] for name, values in dense.items()}
    return {name: values[::every] for name, values in dense.items()}, dense


def make(root: Path = HERE) -> Iterator[str]:
    """Write the references of all scenarios; yields what was written."""
    for scenario in SYSTEMS:
        path = path_of(scenario, root)
        path.parent.mkdir(parents=True, exist_ok=True)
        kept, dense = solve(scenario)
        write_table(path, kept, digits=DIGITS)
        every = round(kept["time"][1] / dense["time"][1])
        write_bounds(path.with_name(f"{scenario.name}_ref.bounds.csv"), dense, every, DIGITS)
        yield f"{FOLDER}/{scenario.name}"
