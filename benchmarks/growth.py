"""How cost grows with modes and axes: the control cycle in the native loop, the plant's doStep, start-up and memory.

The machines are synthetic (``machines.py``). Start-up is a process's own, once the packages are imported: reading the
scenario and the modes, planning, packing the plant where its axes are other than the general archive's, loading and
initialising every unit. Memory is the peak of such a process that then runs the scenario. With ``--images DIR`` the
plots go there.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import cycle
import fmpy
import machines
from drawings import Curve, Panel, slope, write_svg
from harness import RESULTS, Contestant, Costs, described, digits, measure, table, write_json

from feedsim import cosim, nc, scenario
from feedsim.cosim.system import System
from feedsim.cosim.unit import Archive
from feedsim.scenario import Scenario
from feedsim.structure import checked_modes
from feedsim.structure.pack import pack

MODES = (10, 30, 93, 300, 1000, 5000)
AXES = (1, 2, 3, 6, 12)
USUAL_MODES, USUAL_AXES = 93, 3
# Slopes belong to the part where what grows outweighs what stays: fitted from here on.
FITTED_FROM = {"modes": 300, "axes": 3}
NAMES = {"cycle": "control cycle, native loop", "plant": "plant's doStep", "start-up": "start-up"}
PARTS = ("read", "plan", "system", "initialise")


@dataclass(frozen=True)
class Size:
    axes: int
    modes: int

    def __str__(self) -> str:
        return f"{self.axes} axes, {self.modes} modes"


def started(file: Path) -> dict[str, float]:
    """Seconds of the parts of a start-up, and of the whole, in this process; then its peak memory [MB] with a run."""
    clock = [time.perf_counter()]

    def done() -> float:
        clock.append(time.perf_counter())
        return clock[-1] - clock[-2]

    loaded = scenario.load(file)
    checked_modes(loaded.machine)
    parts = {"read": done()}
    program = nc.plan(loaded)
    parts["plan"] = done()
    with System(loaded.machine, cosim.fmus_directory()) as system:
        parts["system"] = done()
        system.initialise(program, stop=float(program.time[-1]))
        parts["initialise"] = done()
    parts["start-up"] = clock[-1] - clock[0]
    cosim.run(loaded, program=program)
    parts["memory"] = peak_memory()
    return parts


def peak_memory() -> float:
    """Of this process [MB]. A process's resource usage would begin with its parent's."""
    for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
        if line.startswith("VmHWM:"):
            return float(line.split()[1]) / 1024
    raise RuntimeError("/proc/self/status tells no VmHWM: memory is measured on Linux only")


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
        machine, own = self.loaded.machine, self.file.parent / "own.fmu"
        if not own.exists():  # the stepping program sets no parameters: the modes must lie in the archive
            pack(cosim.fmus_directory() / "plant.fmu", own, modes=machine.modes, pose=machine.pose, level=1)
        with Archive(own) as archive:
            library = archive.directory / "binaries" / fmpy.platform / f"plant{fmpy.sharedLibraryExtension}"
            resources = (archive.directory / "resources").as_uri()
            driven, read = (archive.variables[f"{machines.NAMES[0]}.{name}"].valueReference for name in ("M_a", "n_a"))
            steps = max(4000, 2_000_000 // self.size.modes)
            command = [self.stepper, library, "plant", archive.guid, resources, steps, driven, 0.5, read]
            told = subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout
        return float(told.split()[0]) * 1e-3

    def start(self) -> float:
        """Seconds of start-up, in a process of its own."""
        command = [sys.executable, __file__, "--start", str(self.file)]
        told = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        self.starts.append(told)
        return float(told["start-up"])

    def shortest(self, part: str) -> float:
        return min(start[part] for start in self.starts)


def measured(sizes: Sequence[Size], folder: Path, rounds: int) -> tuple[dict[Size, Measured], Costs]:
    stepper = cycle.build(RESULTS)
    found = {size: Measured(folder / str(size), size, stepper) for size in sizes}
    whats: dict[str, Callable[[Measured], float]] = {
        "cycle": Measured.loop, "plant": Measured.plant, "start-up": Measured.start,
    }  # fmt: skip
    # A size's cycle and its plant follow one another, so that the share is one of the same moment.
    contestants = [
        Contestant(
            f"{what}: {size}",
            lambda each=each, act=act: act(each),
            max(3, rounds // 2) if act is Measured.start else None,
        )
        for size, each in found.items()
        for what, act in whats.items()
    ]
    costs = measure(contestants, rounds, title="growth")
    return found, costs


def text(over: str, sizes: Sequence[Size], found: dict[Size, Measured], costs: Costs) -> str:
    rows = [
        [
            getattr(size, over),
            f"{digits(costs.shortest(f'cycle: {size}'))} us",
            f"{digits(costs.shortest(f'plant: {size}'))} us",
            f"{100 * costs.ratio(f'plant: {size}', f'cycle: {size}'):.0f} %",
            f"{digits(1e3 * costs.shortest(f'start-up: {size}'), 2)} ms",
            *(f"{digits(1e3 * found[size].shortest(part), 2)}" for part in PARTS),
            f"{digits(found[size].shortest('memory'))} MB",
        ]
        for size in sizes
    ]
    header = [over, "cycle", "plant's doStep", "its share", "start-up", *PARTS, "memory"]
    return table(header, rows)


def slopes(over: str, sizes: Sequence[Size], costs: Costs) -> dict[str, float]:
    """Exponents of growth, from FITTED_FROM on."""
    fitted = [size for size in sizes if getattr(size, over) >= FITTED_FROM[over]]
    x = [getattr(size, over) for size in fitted]
    return {what: slope(x, [costs.shortest(f"{what}: {size}") for size in fitted]) for what in NAMES}


def plot(over: str, sizes: Sequence[Size], found: dict[Size, Measured], costs: Costs, images: Path) -> None:
    x = [getattr(size, over) for size in sizes]
    exponents = slopes(over, sizes, costs)
    curves = {
        what: Curve(f"{name}: slope {exponents[what]:.2f}", x, [costs.shortest(f"{what}: {size}") for size in sizes])
        for what, name in NAMES.items()
    }
    fixed = f"{USUAL_AXES} axes" if over == "modes" else f"{USUAL_MODES} modes"
    start = [
        curves["start-up"],
        Curve("... initialising the units", x, [found[size].shortest("initialise") for size in sizes]),
    ]
    panels = [
        Panel(f"a 125 us cycle, {fixed}", over, "time [us]", [curves["cycle"], curves["plant"]], x),
        Panel(f"start-up, {fixed}", over, "time [s]", start, x),
    ]
    print(f"{write_svg(f'growth-{over}', panels, images)} written", file=sys.stderr)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=7, help="of time measurement (default: 7)")
    parser.add_argument("--images", type=Path, default=RESULTS, metavar="DIR", help="folder of the plots")
    parser.add_argument("--start", type=Path, metavar="SCENARIO", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.start is not None:
        print(json.dumps(started(options.start)))
        return 0
    series = {
        "modes": [Size(USUAL_AXES, count) for count in MODES],
        "axes": [Size(count, USUAL_MODES) for count in AXES],
    }
    sizes = list(dict.fromkeys(size for each in series.values() for size in each))
    with TemporaryDirectory() as folder:
        found, costs = measured(sizes, Path(folder), options.rounds)
        print(described())
        for over, own in series.items():
            exponents = slopes(over, own, costs)
            told = ", ".join(f"{what} {value:.2f}" for what, value in exponents.items())
            print(f"\n{text(over, own, found, costs)}\n\nslopes from {FITTED_FROM[over]} {over} on: {told}")
            plot(over, own, found, costs, options.images)
        write_json(
            "growth",
            {
                "costs": costs.as_json(),
                "start-up": {str(size): each.starts for size, each in found.items()},
                "slopes": {over: slopes(over, own, costs) for over, own in series.items()},
            },
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
