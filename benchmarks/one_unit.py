"""What the machine as one unit saves in other people's simulators, against its units wired there.

The X-Z circle, one turn and back to rest, in each importer from the call to the results: loading, stepping, and reading
three signals per axis at each step. Wired units take steps of the control cycle, and the one unit any. What it gives is
compared with a run by the master, to the last bit, before its time counts.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from harness import ROOT, Contestant, arguments, digits, measure, table

sys.path.insert(0, str(ROOT / "tests"))  # the adapters of the importers

from fmpy import simulate_fmu

from feedsim import scenario
from feedsim.simulation import nc
from feedsim.simulation.cosim import fmus_directory
from importers import whole, z_move
from importers.registry import IMPORTERS, Importer
from importers.system import Experiment, Result, System

STEPS = (125e-6, 1e-3, 10e-3)  # s, of the one unit
ROUNDS = 3
CIRCLE = ("motions.0.direction=counterclockwise",)
SHORT = (*CIRCLE, "motions.0.radius=1 mm")
NAMES = {importer.label.replace("`", "").replace(" ", "-"): importer for importer in IMPORTERS}


@dataclass(frozen=True)
class Way:
    """A system in an importer."""

    importer: Importer
    system: System
    experiment: Experiment
    expected: whole.Whole | None  # of the one unit

    def run(self, folder: Path) -> float:
        """Seconds. RuntimeError: what comes out is something else."""
        begun = time.perf_counter()
        one = self.expected is not None
        result = simulated(self) if one and self.importer.name == "FMPy" else self._in_importer(folder)
        seconds = time.perf_counter() - begun
        if self.expected is not None:
            worst, _ = whole.difference(result, self.expected, self.experiment.step)
            if worst:
                raise RuntimeError(f"{self.importer.label}: off by {worst} of the largest value")
        return seconds

    def _in_importer(self, folder: Path) -> Result:
        return self.importer.run(self.system, self.experiment, folder)


def simulated(way: Way) -> Result:
    """FMPy has a function of its own for one unit."""
    do, (component,) = way.experiment, way.system.components.values()
    names = [name for _, name in do.record]
    found = simulate_fmu(
        str(component.archive), stop_time=do.stop, step_size=do.step, output_interval=do.step, output=names
    )
    return {("machine", name): found[name] for name in names}


def main(words: Sequence[str] | None = None) -> int:
    bench = arguments("one_unit", __doc__, words, rounds=ROUNDS, only=(*NAMES,))
    rows, results = [], dict[str, object]()
    with TemporaryDirectory() as folder:
        ways = prepared(Path(folder), SHORT if bench.short else CIRCLE)
        for label in bench.only[: 1 if bench.short else None]:
            importer = NAMES[label]
            if reason := importer.missing():
                print(f"{importer.label} left out: {reason}", file=sys.stderr)
                continue
            made = ways(importer)
            costs = measure(
                [Contestant(name, lambda way=way: way.run(scratch(Path(folder)))) for name, way in made.items()],  # type: ignore[misc]
                bench.rounds, title=importer.label,
            )  # fmt: skip
            wired, last = next(iter(made)), f"{STEPS[-1] * 1e3:g} ms"
            factors = sorted(1 / ratio for ratio in costs.ratios(last, wired))
            rows.append(
                [f"{importer.name} {importer.version()} {importer.how}".strip()]
                + [f"{digits(costs.median(name))} s" for name in made]
                + [f"{digits(1 / costs.ratio(last, wired), 2)} ({digits(factors[0], 2)}-{digits(factors[-1], 2)})"]
            )
            results[importer.label] = costs.as_json(wired)
    header = ["importer", "units wired, 125 us", *(f"one unit, {step * 1e3:g} ms" for step in STEPS)]
    bench.tell(table([*header, f"wired / one at {STEPS[-1] * 1e3:g} ms"], rows), results)
    return 0


def scratch(folder: Path) -> Path:
    """A folder for the files of one run."""
    made = folder / f"{time.monotonic_ns()}"
    made.mkdir()
    return made


def prepared(folder: Path, changes: tuple[str, ...]) -> Callable[[Importer], dict[str, Way]]:
    """What an importer is to run, by name; the wired units first."""
    fmus = fmus_directory()
    one = whole.load("xz_circle", fmus, folder, *changes)
    loaded = scenario.load(whole.SCENARIOS / "xz_circle.yaml", changes)
    program = nc.plan(loaded)
    steps = round(program.duration / whole.CYCLE)
    signals = [("plant", f"{axis}.x_a") for axis in one.axes] + [(f"controller_{axis}", "M_a") for axis in one.axes]
    signals += [(f"friction_{axis}", "M_fr") for axis in one.axes]
    move = z_move.Move(loaded, program, Experiment(whole.CYCLE, steps, tuple(signals)))
    wired = z_move.hand_wired(move, fmus, folder)

    def of(importer: Importer) -> dict[str, Way]:
        system = one.connected(fmus) if importer.name == "Maestro" else one.system
        ways = {"wired": Way(importer, wired, move.experiment, None)}
        return ways | {f"{step * 1e3:g} ms": Way(importer, system, one.experiment(step), one) for step in STEPS}

    return of


if __name__ == "__main__":
    sys.exit(main())
