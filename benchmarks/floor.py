"""What the FMI and the master cost: the circle in the native loop and in Python's, and as the one unit `machine` in
steps from outside, against the same algorithm without FMI: the units' models linked together and called directly
(``benchmarks/floor``).

Times are of the processor, not of the wall: what other programs take in between does not count. They take turns in
one process; a ratio is the median of those of neighbouring runs, with its quartiles. The floor
must leave the same bits, or it is no floor for this work.

``--instructions`` counts with valgrind what both execute in place of that, and by which part of the program.
"""

from __future__ import annotations

import bisect
import ctypes
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

from harness import CIRCLE, ONE_WAY, ROOT, Benchmark, Contestant, arguments, digits, measure, table

import numpy as np

from feedsim import scenario
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.exchange import Exchange
from feedsim.simulation.cosim.system import System
from feedsim.simulation.cosim.unit import Unit
from feedsim.simulation.cosim.whole import pack_whole
from feedsim_packager import build as packaging
from feedsim_packager import compile, toolchain

FLOOR = ROOT / "benchmarks" / "floor"
ROUNDS = 9
UNITS = ("plant", "controller", "friction")
CONTROLLER = ("M_a", "x_e", "n_s", "n_ref", "M_s", "i_d", "i_q", "u_d", "u_q", "torque_limited", "voltage_limited")
FRICTION = ("M_fr", "z", "c", "k", "lambda")
FLAGS = ("torque_limited", "voltage_limited")  # Boolean: not among what one unit is asked for
LOCALS = {"z": "friction.z", "c": "friction.c", "k": "friction.k", "lambda": "friction.lambda"}
OUTER = {"one unit, steps of 10 ms": 80, "one unit, steps of 125 us": 1}  # cycles that the importer steps at once
TOOL = ("tool.x_X", "tool.x_Y", "tool.x_Z", "tcp.x_X", "tcp.x_Y", "tcp.x_Z")


def build(directory: Path, extra: tuple[str, ...] = ()) -> ctypes.CDLL:
    """Compile the units' own sources and the loop around their equations into one library, with the units' compiler and
    flags. Each unit is whole, as the packager has it: which of its files are equations, the linker knows."""
    compiler = toolchain.find_compiler()
    command = [*compiler, *compile.FLAGS, *toolchain.whole_program(compiler, compile.host_target().suffix), *extra]
    shared = [f"-I{ROOT / 'src' / 'fmi2' / 'standard'}", f"-I{FLOOR}"]

    def objects(name: str, files: Sequence[Path], *flags: str) -> list[Path]:
        folder = directory / name
        subprocess.run([*command, *flags, *shared, "-c", *map(str, files)], cwd=folder, check=True)
        return sorted(folder.glob("*.o"))

    shutil.rmtree(directory, ignore_errors=True)
    (directory / "loop").mkdir(parents=True)
    made = objects("loop", [FLOOR / "floor.c", FLOOR / "machine.c"])
    for unit in UNITS:
        loaded = packaging.load(packaging.unit_directory(unit), compiler)
        folder = directory / unit
        folder.mkdir()
        for file, content in loaded.sources.items():
            (folder / file).write_bytes(content)
        made += objects(
            unit, [*map(Path, loaded.c_files), FLOOR / f"{unit}.c"], "-I.", f"-DFMI2_FUNCTION_PREFIX={unit}_"
        )
    library = directory / "floor.so"
    subprocess.run([*command, "-shared", *map(str, made), "-lm", "-o", str(library)], check=True)
    return ctypes.CDLL(str(library))


def floor(library: ctypes.CDLL, circle: scenario.Scenario, program: nc.Program) -> tuple[float, np.ndarray, list[str]]:
    """Seconds of the loop, the table it leaves, and the table's columns."""
    cycles = circle.machine.cycles
    ratio, every = round(cycles.T_pos / cycles.T_c), round(circle.recording.interval / cycles.T_c)
    total = (len(program.time) - 1) * ratio
    with System(circle.machine, cosim.fmus_directory()) as system:
        system.initialise(program, stop=total * cycles.T_c)
        axes = system.axes
        names = [f"{axis}.{signal}" for axis in axes for signal in (*CONTROLLER, *FRICTION)]
        names += [f"{axis}.{signal}" for axis in axes for signal in ("x_a", "n_a")] + list(TOOL)
        setpoints = np.array([np.column_stack([program.x_s[axis], program.n_ffw[axis]]) for axis in axes])
        table, energies = np.zeros((total // every + 1, len(names))), np.zeros((len(axes), 3))
        pointers = ctypes.c_void_p * len(axes)
        arguments = (
            ctypes.c_void_p(system.plant.component),
            pointers(*(control.unit.component for control in system.controllers)),
            pointers(*(contact.unit.component for contact in system.contacts)),
            ctypes.c_size_t(len(axes)), ctypes.c_long(total), ctypes.c_double(cycles.T_c), ctypes.c_long(ratio),
            ctypes.c_void_p(setpoints.ctypes.data), ctypes.c_size_t(setpoints.shape[1]), ctypes.c_long(every),
            ctypes.c_void_p(table.ctypes.data), ctypes.c_void_p(energies.ctypes.data),
        )  # fmt: skip
        library.floor_run.restype = None
        begun = time.thread_time()
        library.floor_run(*arguments)
        return time.thread_time() - begun, table, names


@contextmanager
def one_unit(circle: scenario.Scenario, program: nc.Program) -> Iterator[Archive]:
    """The circle's machine packed as one unit, with the motion inside."""
    with tempfile.TemporaryDirectory() as folder:
        packed = Path(folder) / "machine.fmu"
        pack_whole(cosim.fmus_directory() / "machine.fmu", packed, circle.machine, program=program, trial=False)
        with Archive(packed) as archive:
            yield archive


def stepped(
    library: ctypes.CDLL, archive: Archive, T_c: float, names: Sequence[str], outer: int, count: int, every: int
) -> tuple[float, np.ndarray]:
    """Seconds of `count` steps of `outer` cycles each, and a row of `names` at the start and at every `every` steps."""
    unit = Unit(archive, "machine")
    try:
        unit.enter_initialisation(0.0, 2 * count * outer * T_c)
        unit.exit_initialisation()
        references, table = unit.references(names), np.zeros((count // every + 1, len(names)))
        arguments = (
            ctypes.c_void_p(unit.address("do_step")), ctypes.c_void_p(unit.address("get_real")),
            ctypes.c_void_p(unit.component), ctypes.c_double(outer * T_c), ctypes.c_long(count), ctypes.c_long(every),
            ctypes.c_void_p(references.ctypes.data), ctypes.c_size_t(len(names)), ctypes.c_void_p(table.ctypes.data),
        )  # fmt: skip
        library.machine_steps.restype = ctypes.c_long
        begun = time.thread_time()
        failed = library.machine_steps(*arguments)
        seconds = time.thread_time() - begun
    finally:
        unit.close()
    if failed:
        raise SystemExit(f"the machine as one unit: {failed} calls have failed")
    return seconds, table


# --- which part of the program executes how many instructions ---------------------------------------------------------

COUNTING = ROOT / "build" / "bench" / "counting"
SWITCH = """#include <valgrind/callgrind.h>
void begin(void) { CALLGRIND_START_INSTRUMENTATION; }
void end(void) { CALLGRIND_STOP_INSTRUMENTATION; }
"""
SHELL = re.compile(r"fmi2|values_|run_|ready|late_finite|get_|set_")  # functions of src/fmi2, a unit's prefix aside
INTERVALS = "1 ms", "8 ms"  # of recording, which the difference is due to


def run_counted(which: str, interval: str) -> None:
    """The loop of the floor or of the master in this process, counted where valgrind executes it."""
    circle = scenario.load(CIRCLE, (ONE_WAY, f"recording.interval={interval}"))
    program, switch = nc.plan(circle), ctypes.CDLL(str(COUNTING / "switch.so"))

    def counted(work: Callable[..., None], *given: object) -> None:
        switch.begin()
        work(*given)
        switch.end()

    if which == "floor":
        library = ctypes.CDLL(str(COUNTING / "floor" / "floor.so"))
        library.floor_run.restype = None
        with patch.object(library, "floor_run", partial(counted, library.floor_run)):
            floor(library, circle, program)
    else:
        work = Exchange.run
        with patch.object(Exchange, "run", lambda *given: counted(work, *given)):
            cosim.run(circle, program=program, native=True)


def build_counted() -> None:
    """The floor, the units and the native loop as they are, with the names of their functions and files."""
    shutil.rmtree(COUNTING, ignore_errors=True)
    build(COUNTING / "floor", ("-g",))
    (COUNTING / "switch.c").write_text(SWITCH, encoding="utf-8")
    compiler = [*toolchain.find_compiler(), "-shared", "-fPIC"]
    subprocess.run([*compiler, "switch.c", "-o", "switch.so"], cwd=COUNTING, check=True)
    whole = toolchain.whole_program(toolchain.find_compiler(), compile.host_target().suffix)
    environment = os.environ | {"FEEDSIM_CFLAGS": " ".join([*whole, "-g"])}
    shutil.copytree(cosim.fmus_directory(), COUNTING / "fmus")
    fmus = COUNTING / "fmus"
    commands = [["build", unit, "--out", f"{fmus}/{unit}.fmu", "--build-dir", str(COUNTING / unit)] for unit in UNITS]
    for words in (*commands, ["exchange", "--out", str(fmus)]):
        command = [sys.executable, "-m", "feedsim_packager", *words]
        subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)


def functions_of(unit: str) -> tuple[list[int], list[str]]:
    """Where the functions of a unit's library begin, and their names."""
    suffix = compile.host_target().suffix
    library = COUNTING / f"{unit}{suffix}"
    with zipfile.ZipFile(COUNTING / "fmus" / f"{unit}.fmu") as archive:
        name = next(name for name in archive.namelist() if name.endswith(library.name))
        library.write_bytes(archive.read(name))
    listed = subprocess.run(["nm", str(library)], check=True, capture_output=True, text=True).stdout
    places = sorted((int(at, 16), name) for at, name in re.findall(r"^(\w+) [tT] (\S+)$", listed, re.MULTILINE))
    return [at for at, _ in places], [name.removeprefix(f"{unit}_") for _, name in places]


def count_instructions(which: str, interval: str) -> Counter[str]:
    """Instructions per control cycle by the part of the program that executes them."""
    output = COUNTING / f"{which}.{interval[0]}"
    code = f"import floor; floor.run_counted({which!r}, {interval!r})"
    command = [
        "valgrind",
        "--tool=callgrind",
        "--instr-atstart=no",
        "--dump-instr=yes",
        f"--callgrind-out-file={output}",
    ]
    environment = os.environ | {"FEEDSIM_FMUS": str(COUNTING / "fmus")}
    subprocess.run([*command, sys.executable, "-c", code], cwd=Path(__file__).parent, env=environment, check=True,
                   capture_output=True)  # fmt: skip
    functions = {unit: functions_of(unit) for unit in UNITS}
    names: dict[str, str] = {}  # of objects and files, which are spelled once
    at, called, instruction, counts = {"ob": "", "fl": ""}, False, 0, Counter[str]()
    for line in output.read_text(encoding="utf-8").splitlines():
        if named := re.match(r"c?(ob|fl|fi|fe)=\((\d+)\)(?: (.*))?", line):
            kind = "ob" if named[1] == "ob" else "fl"
            names.setdefault(kind + named[2], named[3] or "")
            if not line.startswith("c"):
                at[kind] = names[kind + named[2]]
        elif line.startswith("calls="):
            called = True  # what the call takes is no instruction of its caller
        elif cost := re.match(r"(0x\w+|[+-]\d+|\*) \S+(?: (\d+))?$", line):
            place = cost[1]
            instruction = int(place, 0) if place[0] == "0" else instruction + int(place.replace("*", "0"))
            if not called:
                counts[part_of(Path(at["ob"]), Path(at["fl"]), instruction, functions)] += int(cost[2] or 0)
            called = False
    return counts


def part_of(library: Path, file: Path, instruction: int, functions: dict[str, tuple[list[int], list[str]]]) -> str:
    """The part of the program that an instruction belongs to; empty for the interpreter."""
    if file.name in ("exchange.c", "vectors.h", "floor.c"):
        return "exchange"
    if library.stem in functions:
        places, names = functions[library.stem]
        inside = names[bisect.bisect(places, instruction) - 1]
        return "calls and checks of the FMI" if SHELL.match(inside) else library.stem
    if library.stem.startswith("libm."):
        return "friction"  # exponentials and logarithms
    return file.parent.name if file.parent.name in UNITS else file.stem if file.stem in UNITS else ""


def tell_instructions(bench: Benchmark) -> None:
    """A table of all parts; recording is what more rows take."""
    build_counted()
    circle = scenario.load(CIRCLE, (ONE_WAY,))
    cycles = float(nc.plan(circle).time[-1]) / circle.machine.cycles.T_c
    counts: dict[str, dict[str, float]] = {}
    for which in ("floor", "native loop"):
        often, rarely = (count_instructions(which, interval) for interval in INTERVALS)
        more = {part: 8 / 7 * (often[part] - rarely[part]) for part in often}
        counts[which] = {part: (often[part] - more[part]) / cycles for part in often if part}
        counts[which]["recording"] = sum(number for part, number in more.items() if part) / cycles
    parts = [*UNITS, "exchange", "calls and checks of the FMI", "recording"]
    rows = [[part, *(counts[which].get(part, 0.0) for which in counts)] for part in parts]
    rows.append(["all", *(sum(counts[which].values()) for which in counts)])
    shown = [[part, *(f"{number:.0f}" for number in (low, high, high - low))] for part, low, high in rows]
    header = ["instructions of a control cycle", *counts, "beyond the floor"]
    replace(bench, name="instructions").tell(table(header, shown), {"instructions per cycle": counts})


def main(given: Sequence[str] | None = None) -> int:
    bench = arguments(
        "floor", __doc__, given, rounds=ROUNDS, only=("native loop", "Python loop", *OUTER),
        more=lambda parser: parser.add_argument(
            "--instructions", action="store_true", help="of each part of the program, with valgrind; of no time"
        ),
    )  # fmt: skip
    if bench.given.instructions:
        tell_instructions(bench)
        return 0
    library = build(ROOT / "build" / "bench" / "floor")
    circle = scenario.load(CIRCLE, bench.circle)
    program = nc.plan(circle)
    simulated, T_c = float(program.time[-1]), circle.machine.cycles.T_c
    cycles, every = simulated / T_c, round(circle.recording.interval / T_c)
    names = floor(library, circle, program)[2]
    left: dict[str, np.ndarray] = {}

    def refuse(different: Sequence[str]) -> None:
        if different:
            raise SystemExit(f"the floor has computed something else: {', '.join(different)}")

    def whole() -> float:
        seconds, left["table"], _ = floor(library, circle, program)
        return 1e6 * seconds / cycles

    def looped(native: bool) -> float:
        run = cosim.run(circle, program=program, native=native)
        refuse([name for at, name in enumerate(names) if np.any(run.trace[name] != left["table"][:, at])])
        return 1e6 * run.cpu_time / cycles

    def as_one(archive: Archive, outer: int) -> float:
        wanted = {name: at for at, name in enumerate(names) if not name.endswith(FLAGS)}
        own = [f"{axis}.{LOCALS.get(signal, signal)}" for axis, _, signal in (name.partition(".") for name in wanted)]
        count, rows = int(cycles) // outer, max(outer, every)  # a row at every step, or as the floor has them
        seconds, table = stepped(library, archive, T_c, own, outer, count, rows // outer)
        rows_of_floor = left["table"][:: rows // every][: len(table)]
        refuse([name for i, (name, at) in enumerate(wanted.items()) if np.any(table[:, i] != rows_of_floor[:, at])])
        return 1e6 * seconds / (count * outer)

    with one_unit(circle, program) as archive:
        contestants = [
            Contestant("floor", whole),
            Contestant("native loop", lambda: looped(True)),
            Contestant("Python loop", lambda: looped(False), rounds=3),
            *(Contestant(name, partial(as_one, archive, outer)) for name, outer in OUTER.items()),
        ]
        wanted = [each for each in contestants if each.name in ("floor", *bench.only)]
        costs = measure(wanted, bench.rounds, title="circle")
    rows = [
        [
            name, f"{costs.median(name):.3f} us", f"{costs.shortest(name):.3f} us",
            costs.ratio_text(name, "floor"), digits(1e6 * simulated / cycles / costs.median(name)),
        ]
        for name in costs.costs
    ]  # fmt: skip
    header = ["the circle, per 125 us cycle", "median", "shortest", "of the floor (quartiles)", "real-time factor"]
    quoted = {}
    for name in costs.costs:
        first, third = costs.quartiles(name, "floor")
        quoted |= {
            name: f"{digits(costs.median(name), 2)} us",
            f"{name}, real time": digits(1e6 * simulated / cycles / costs.median(name), 2),
            f"{name} of the floor": f"{digits(first)} to {digits(third)}",
        }
    bench.tell(table(header, rows), {"us per cycle": costs.as_json("floor")}, quoted)
    return 0


if __name__ == "__main__":
    sys.exit(main())
