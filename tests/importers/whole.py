"""The machine as one unit, its motion inside: what every importer is to get at any step, from our own master."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim import scenario
from feedsim.files.trace import Trace
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim.whole import pack_whole
from importers.system import Component, Experiment, Floats, Result, System

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
CYCLE = 125e-6  # s
SIGNALS = ("x_a", "M_a", "M_fr")
# Short ones: what a longer one would tell besides is that more of the same is the same.
MOTIONS = {
    "z_positioning": ("motions.0.by.Z=5 mm", "motions.1.duration=0.1 s"),
    "xz_circle": ("motions.0.radius=1 mm", "motions.0.direction=counterclockwise"),
}


@dataclass(frozen=True)
class Whole:
    """A scenario packed into one unit, and the same by our own master at the control cycle.

    changes: what was set in the scenario.
    """

    archive: Path
    axes: tuple[str, ...]
    trace: Trace
    program: nc.Program
    changes: tuple[str, ...]

    @property
    def system(self) -> System:
        return System({"machine": Component(self.archive)})

    def connected(self, fmus: Path) -> System:
        """With another friction unit that listens: Maestro wants a connection."""
        parts = {"machine": Component(self.archive), "friction": Component(fmus / "friction.fmu")}
        return System(parts, ((("machine", f"{self.axes[0]}.n_a"), ("friction", "n_fr")),))

    def experiment(self, step: float) -> Experiment:
        """Over the whole motion, by steps of `step` [s]; to its end, where they meet it."""
        record = tuple(("machine", f"{axis}.{signal}") for axis in self.axes for signal in SIGNALS)
        return Experiment(step, int(float(self.trace.time[-1]) / step + 1e-6), record)

    def common(self, step: float, steps: int) -> tuple[Floats, Floats]:
        """Steps, from 0, that end at control instants, and those instants."""
        times = np.arange(steps + 1) * step
        cycles = np.round(times / CYCLE)
        met = np.flatnonzero(np.abs(times - cycles * CYCLE) < 1e-9)
        return met, cycles[met].astype(int)


def load(name: str, fmus: Path, folder: Path, *changes: str) -> Whole:
    """`changes`: in place of those that make it short."""
    made = (*(changes or MOTIONS[name]), "recording.interval=125 us")
    loaded = scenario.load(SCENARIOS / f"{name}.yaml", made)
    program = nc.plan(loaded)
    archive = folder / f"{name}.fmu"
    pack_whole(
        fmus / "machine.fmu", archive, loaded.machine, coupling=loaded.coupling, program=program, model=loaded.name
    )
    trace = cosim.run(loaded, program=program, fmus=fmus).trace
    return Whole(archive, tuple(loaded.machine.axes), trace, program, made)


def difference(result: Result, whole: Whole, step: float) -> tuple[float, int]:
    """Largest difference at common instants, relative to the largest value of each signal, and how many were told."""
    worst, told = 0.0, 0
    for (_, name), values in result.items():
        met, cycles = whole.common(step, len(values) - 1)
        known = np.isfinite(values[met])
        expected = whole.trace[name][cycles][known]
        worst = max(worst, float(np.abs(values[met][known] - expected).max() / np.abs(whole.trace[name]).max()))
        told = int(known.sum())
    return worst, told
