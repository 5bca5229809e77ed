"""How cost grows with modes and axes: the control cycle in the native loop, the plant's doStep, start-up and memory.

The machines are synthetic (machines.py), each with a plant packed for it. A cycle is the mean of a run of some 50,000,
in which all axes go to and fro. Start-up is a process's own, once the packages are imported: reading the scenario and
the modes, planning, loading and initialising every unit. Memory is the peak of such a process that then runs the
scenario. Packing is done once for a machine and told apart.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from harness import RESULTS, Contestant, Costs, arguments, digits, measure, table

import cycle
import fmpy
import machines
from fits import Line
from watched import memory

from feedsim import scenario
from feedsim.scenario import Scenario
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.system import System
from feedsim.structure import checked_modes

SERIES = {"modes": (10, 30, 93, 300, 1000, 5000), "axes": (1, 2, 3, 6, 12)}
USUAL_MODES, USUAL_AXES = 93, 3
PARTS = ("read", "plan", "system", "initialise")
NAMES = {"cycle": "control cycle, native loop", "plant": "plant's doStep"}
STARTS = 3  # rounds in which start-up is measured


@dataclass(frozen=True)
class Size:
    axes: int
    modes: int

    def __str__(self) -> str:
        return f"{self.axes} axes, {self.modes} modes"


def started(file: Path) -> dict[str, float | None]:
    """Seconds of the parts of a start-up, and of the whole, in this process; then its peak memory [MB] with a run."""
    clock = [time.perf_counter()]

    def done() -> float:
        clock.append(time.perf_counter())
        return clock[-1] - clock[-2]

    loaded = scenario.load(file)
    checked_modes(loaded.machine)
    parts: dict[str, float | None] = {"read": done()}
    program = nc.plan(loaded)
    parts["plan"] = done()
    with System(loaded.machine, cosim.fmus_directory()) as system:
        parts["system"] = done()
        system.initialise(program, stop=float(program.time[-1]))
        parts["initialise"] = done()
    parts["start-up"] = clock[-1] - clock[0]
    cosim.run(loaded, program=program)
    parts["memory"] = memory("VmHWM")
    return parts


class Measured:
    """A machine in a folder, and what is measured of it."""

    def __init__(self, folder: Path, size: Size, stepper: Path) -> None:
        self.size = size
        self.file = machines.write(folder, size.axes, size.modes)
        self.loaded: Scenario = scenario.load(self.file)
        self.program = nc.plan(self.loaded)
        self.stepper = stepper
        self.starts: list[dict[str, float]] = []

    def loop(self) -> float:
        """us per control cycle of the native loop."""
        run = cosim.run(self.loaded, program=self.program, native=True)
        return 1e6 * run.wall_time * self.loaded.machine.cycles.T_c / float(self.program.time[-1])

    def plant(self) -> float:
        """us of the plant's doStep alone, with a new torque in every step."""
        with Archive(self.file.parent / machines.PLANT) as archive:
            library = archive.directory / "binaries" / fmpy.platform / f"plant{fmpy.sharedLibraryExtension}"
            resources = (archive.directory / "resources").as_uri()
            driven, read = (archive.variables[f"{machines.NAMES[0]}.{name}"].valueReference for name in ("M_a", "n_a"))
            steps = max(50_000, 5_000_000 // self.size.modes)
            command = [self.stepper, library, "plant", archive.guid, resources, steps, driven, 0.5, read]
            told = subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout
        return float(told.split()[0]) * 1e-3

    def start(self) -> float:
        """Seconds of start-up, in a process of its own; packing takes its turn, too."""
        command = [sys.executable, __file__, "--start", str(self.file)]
        told = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        begun = time.perf_counter()
        machines.pack_machine(self.file.parent, self.size.axes)
        told["pack"] = time.perf_counter() - begun
        self.starts.append(told)
        return float(told["start-up"])

    def start_part(self, part: str) -> float:
        return median(start[part] for start in self.starts)


def measured(sizes: Sequence[Size], folder: Path, rounds: int) -> tuple[dict[Size, Measured], Costs]:
    stepper = cycle.build(RESULTS)
    found = {size: Measured(folder / str(size), size, stepper) for size in sizes}
    whats: dict[str, Callable[[Measured], float]] = {
        "cycle": Measured.loop, "plant": Measured.plant, "start-up": Measured.start,
    }  # fmt: skip
    # A size's cycle and its plant follow one another, so that the share is one of the same moments.
    contestants = [
        Contestant(f"{what}: {size}", lambda each=each, act=act: act(each), STARTS if act is Measured.start else None)
        for size, each in found.items()
        for what, act in whats.items()
    ]
    return found, measure(contestants, rounds, title="growth")


class Series:
    """Sizes that differ in one thing, and what has been measured of them: medians throughout."""

    def __init__(self, over: str, found: dict[Size, Measured], costs: Costs) -> None:
        self.over = over
        self.sizes = sizes(over)
        self.n = [getattr(size, over) for size in self.sizes]
        self.found, self.costs = found, costs

    def medians(self, what: str) -> list[float]:
        return [self.costs.median(f"{what}: {size}") for size in self.sizes]

    def lines(self) -> dict[str, Line]:
        """us by mode or axis."""
        return {what: Line.through(self.n, self.medians(what)) for what in NAMES}

    def text(self) -> str:
        rows = []
        for size, n, loop, plant in zip(self.sizes, self.n, self.medians("cycle"), self.medians("plant"), strict=True):
            of = self.found[size]
            times = (f"{digits(1e3 * of.start_part(part), 2)} ms" for part in ("start-up", *PARTS, "pack"))
            taken = "" if of.starts[0]["memory"] is None else f"{of.start_part('memory'):.0f} MB"
            rows.append([n, f"{digits(loop)} us", f"{digits(plant)} us", f"{100 * plant / loop:.0f} %", *times, taken])
        fixed = f"{USUAL_AXES} axes" if self.over == "modes" else f"{USUAL_MODES} modes"
        header = [f"{self.over} ({fixed})", "cycle", "plant's doStep", "its share", "start-up", *PARTS, "packing, once"]
        return table([*header, "memory"], rows)

    def told(self) -> str:
        one = self.over.replace("modes", "mode").replace("axes", "axis")
        rows = [
            [NAMES[what], f"{digits(line.constant)} us + {digits(1e3 * line.each)} ns per {one}",
             f"{100 * line.off:.0f} %"]
            for what, line in self.lines().items()
        ]  # fmt: skip
        return table([f"line over the {self.over}", "fitted", "off by at most"], rows)

    def plot(self, images: Path) -> None:
        from drawings import Curve, Panel, write_svg

        fixed = f"{USUAL_AXES} axes" if self.over == "modes" else f"{USUAL_MODES} modes"
        scales = ("log", "log") if self.over == "modes" else ("linear", "linear")
        loops = [Curve(name, self.n, self.medians(what)) for what, name in NAMES.items()]

        def starts(part: str) -> list[float]:
            return [1e3 * self.found[size].start_part(part) for size in self.sizes]

        shown = {"start-up": "start-up", "read": "... scenario and modes read", "system": "... units loaded"}
        begun = [Curve(name, self.n, starts(part)) for part, name in shown.items()]
        panels = [
            Panel(f"a 125 us cycle, {fixed}", self.over, "time [us]", loops, self.n, scales),
            Panel(f"start-up, {fixed}", self.over, "time [ms]", begun, self.n, scales),
        ]
        print(f"{write_svg(f'growth-{self.over}', panels, images)} written", file=sys.stderr)


def sizes(over: str) -> list[Size]:
    return [Size(USUAL_AXES, n) if over == "modes" else Size(n, USUAL_MODES) for n in SERIES[over]]


def main(words: Sequence[str] | None = None) -> int:
    bench = arguments("growth", __doc__, words, rounds=5, only=tuple(SERIES), images=True)
    if bench.short:
        SERIES.update(modes=(10, 20), axes=(1, 2))
    wanted = list(dict.fromkeys(size for over in bench.only for size in sizes(over)))
    with TemporaryDirectory(prefix="feedsim-bench-") as folder:
        found, costs = measured(wanted, Path(folder), bench.rounds)
    series = [Series(over, found, costs) for over in bench.only]
    results = {
        "costs": costs.as_json(),
        "start-up": {str(size): each.starts for size, each in found.items()},
        "lines": {each.over: {what: asdict(line) for what, line in each.lines().items()} for each in series},
    }
    bench.tell("\n\n".join(f"{each.text()}\n\n{each.told()}" for each in series), results)
    for each in series:
        each.plot(bench.images)
    return 0


if __name__ == "__main__":
    # A start-up in a process of its own, which Measured.start begins.
    if sys.argv[1:2] == ["--start"]:
        print(json.dumps(started(Path(sys.argv[2]))))
    else:
        sys.exit(main())
