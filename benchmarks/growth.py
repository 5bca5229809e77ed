"""How cost grows: with modes and axes, that of the control cycle, the plant's doStep, start-up and memory; with the
size of what a command reads, its time and memory.

The machines are synthetic (machines.py), each with a plant packed for it. A cycle is the mean of a run of some 50,000,
in which all axes go to and fro. Start-up is a process's own, once the packages are imported: reading the scenario and
the modes, planning, loading and initialising every unit. Memory is the peak of such a process that then runs the
scenario. Packing is done once for a machine and told apart.

Commands run once for each size, in processes of their own. Their logs repeat a short one, so that they tell nothing
more by being longer. The exponent p of time ~ size^p is that of the last two sizes, start-up included.
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

from harness import RESULTS, ROOT, Contestant, Costs, arguments, digits, measure, table

import cycle
import fmpy
import machines
import numpy as np
from fits import Line, exponent
from watched import Watched, memory, watched

from feedsim import scenario
from feedsim.files.trace import Trace, write_csv
from feedsim.scenario import Scenario
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.system import System
from feedsim.structure import checked_modes

SERIES = {"modes": (10, 30, 93, 300, 1000, 5000), "axes": (1, 2, 3, 6, 12)}
COMMANDS = "commands"
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


# --- Commands over the size of what they read -------------------------------------------------------------------------


MACHINES = ROOT / "scenarios" / "machines"
SIGNALS = ("DES_POS", "ENC_POS", "CONT_DEV", "CMD_SPEED", "VEL_FFW", "TORQUE_FFW", "TORQUE", "CURRENT", "POWER", "LOAD")
CAPTURE_AXES = 6  # with ten signals each, and the counter
STROKES = ", ".join(
    f"{{kind: move, by: {{X: {way} mm}}, feed: {feed} mm/min}}"
    for way, feed in ((20, 10000), (-3, 1000), (-7, 6000), (-8, 3000), (5, 8000), (-7, 500))
)
DRIVE_LOG = (
    "{{name: log, machine: {machine}, motions: [{{kind: dwell, duration: 0.2 s}}, {strokes}], recording: {{interval: "
    "2 ms}}, logging: {{interval: 2 ms, axes: [X], signals: [x_s, x_a, x_e, n_s, n_ffw, M_a], noise: {{M_a: 2 %, x_a: "
    "0.1 um}}}}}}"
)


def write_repeated(file: Path, log: Trace, seconds: float) -> None:
    """A log that ends where it begins, as often as it takes."""
    interval = float(log.time[1] - log.time[0])
    rows = np.arange(round(seconds / interval)) % len(log.time)
    columns = {name: log[name][rows] for name in log.names}
    write_csv(file, Trace(np.asarray(interval * np.arange(len(rows)), dtype=np.float64), columns, log.units))


def logged(file: Path) -> Trace:
    log = cosim.run(scenario.load(file)).log
    assert log is not None
    return log


def capture(folder: Path, minutes: int) -> list[str]:
    """Reading alone: a capture of 61 signals every 2 ms, of which two become a CSV file."""
    names = ["CYCLE", *(f"{name}|{axis + 1}" for axis in range(CAPTURE_AXES) for name in SIGNALS)]
    listed = [{"Name": name, "Address": name, "Axis": f"A{name.rpartition('|')[2]}"} for name in names]
    rng = np.random.default_rng(1)
    rows = [json.dumps(np.round(row, 6).tolist())[1:] for row in rng.standard_normal((500, len(names) - 1))]
    file = folder / "capture.json"
    with file.open("w", encoding="utf-8") as out:
        out.write(f'{{"Header": {json.dumps({"CycleTimeMs": 2, "SignalListHFData": listed})}, "Payload": [')
        for second in range(60 * minutes):
            numbered = (f"[{500 * second + k}, {row}" for k, row in enumerate(rows))
            out.write(f'{"," if second else ""}{{"HFData": [{",".join(numbered)}]}}')
        out.write("]}")
    columns = ("time=time:s", "DES_POS|1=x:mm")
    return ["tools", "convert", str(file), *(word for each in columns for word in ("--column", each))]


def friction(folder: Path, minutes: int) -> list[str]:
    write_repeated(folder / "log.csv", logged(ROOT / "scenarios" / "identify_z_sine.yaml"), 60.0 * minutes)
    return ["identify", "friction", str(folder / "log.csv"), "--axes", "Z", "--machine", str(MACHINES / "test_centre")]


def drive_log(folder: Path, seconds: int) -> Path:
    file = folder / "log.yaml"
    file.write_text(DRIVE_LOG.format(machine=MACHINES / "one_axis", strokes=STROKES), encoding="utf-8")
    write_repeated(folder / "log.csv", logged(file), seconds)
    return folder / "log.csv"


def drive(folder: Path, seconds: int) -> list[str]:
    record = str(drive_log(folder, seconds))
    return ["identify", "drive", record, "--axes", "X", "--machine", str(MACHINES / "one_axis")]


def replay(folder: Path, seconds: int) -> list[str]:
    return ["replay", str(drive_log(folder, seconds)), "--axes", "X", "--machine", str(MACHINES / "one_axis")]


def program(folder: Path, blocks: int) -> list[str]:
    """Chords of 0.1 mm of a circle."""
    angles = 0.02 * np.arange(blocks)
    points = zip(500 + 5 * np.cos(angles), 200 + 5 * np.sin(angles), strict=True)
    lines = ["G17 G90 G94 G71", "G0 X505 Y200", "G1 F3000", *(f"G1 X{x:.4f} Y{y:.4f}" for x, y in points), "M30"]
    (folder / "part.mpf").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return ["run", str(folder / "part.mpf"), "--machine", str(MACHINES / "test_centre")]


@dataclass(frozen=True)
class Command:
    """A command, and the sizes of what it reads. write: makes that in a folder, and gives the words of the command."""

    name: str
    unit: str
    sizes: tuple[int, ...]
    write: Callable[[Path, int], list[str]]

    def measured(self, size: int) -> Watched:
        with TemporaryDirectory(prefix="feedsim-bench-") as folder:
            words = self.write(Path(folder), size)
            quiet = [] if words[0] == "tools" else ["--quiet"]
            return watched([*words, *quiet, "--out", str(Path(folder) / "out")])


READING = (
    Command("read a capture of 61 signals", "min", (1, 6, 18), capture),
    Command("identify friction, 500 Hz", "min", (1, 10, 60), friction),
    Command("identify drive, 2 ms", "s", (10, 30, 300), drive),
    Command("replay, 2 ms", "s", (10, 100, 1000), replay),
    Command("run, NC blocks", "blocks", (100, 1000, 10_000), program),
)


def commands(short: bool) -> tuple[str, dict[str, object]]:
    """Table of all commands over their sizes, and the figures."""
    rows = []
    results: dict[str, object] = {}
    for command in READING:
        if short and command.write not in (replay, program):
            continue
        sizes = (1, 2) if short else command.sizes
        runs = [command.measured(size) for size in sizes]
        power = exponent(sizes[-2:], [run.whole for run in runs[-2:]])
        for size, run in zip(sizes, runs, strict=True):
            taken = "" if run.peak is None else f"{run.peak:.0f} MB"
            last = f"{power:.2f}" if size == sizes[-1] else ""
            rows.append([command.name, f"{size} {command.unit}", f"{digits(run.whole)} s", taken, last])
        results[command.name] = {
            "sizes": list(sizes), "seconds": [run.whole for run in runs], "peak MB": [run.peak for run in runs],
            "exponent": power,
        }  # fmt: skip
    return table(["command", "size", "time", "peak memory", "exponent"], rows), results


def sizes(over: str) -> list[Size]:
    return [Size(USUAL_AXES, n) if over == "modes" else Size(n, USUAL_MODES) for n in SERIES[over]]


def main(words: Sequence[str] | None = None) -> int:
    bench = arguments("growth", __doc__, words, rounds=5, only=(*SERIES, COMMANDS), images=True)
    if bench.short:
        SERIES.update(modes=(10, 20), axes=(1, 2))
    over_sizes = [over for over in bench.only if over in SERIES]
    wanted = list(dict.fromkeys(size for over in over_sizes for size in sizes(over)))
    results: dict[str, object] = {}
    series: list[Series] = []
    if wanted:
        with TemporaryDirectory(prefix="feedsim-bench-") as folder:
            found, costs = measured(wanted, Path(folder), bench.rounds)
        series = [Series(over, found, costs) for over in over_sizes]
        results = {
            "costs": costs.as_json(),
            "start-up": {str(size): each.starts for size, each in found.items()},
            "lines": {each.over: {what: asdict(line) for what, line in each.lines().items()} for each in series},
        }
    texts = [f"{each.text()}\n\n{each.told()}" for each in series]
    if COMMANDS in bench.only:
        text, results[COMMANDS] = commands(bench.short)
        texts.append(text)
    bench.tell("\n\n".join(texts), results)
    for each in series:
        each.plot(bench.images)
    return 0


if __name__ == "__main__":
    # A start-up in a process of its own, which Measured.start begins.
    if sys.argv[1:2] == ["--start"]:
        print(json.dumps(started(Path(sys.argv[2]))))
    else:
        sys.exit(main())
