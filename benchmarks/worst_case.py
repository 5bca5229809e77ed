"""Worst-case time of a unit's doStep, for real-time targets: demanding cases, the operating system's share taken out.

Run by ``make worst-case``; with ``--fifo CORE`` (Linux, with the right to it) the measuring program runs on that core
with real-time priority (SCHED_FIFO), as a real-time target would have it. Figures are of one machine; the instruction
counts (where valgrind is installed) repeat exactly on any machine with the same binary.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from harness import ROOT, arguments, progress, table

import fmpy
import numpy as np
from numpy.typing import NDArray

from feedsim.simulation import cosim
from feedsim.simulation.cosim.archive import Archive

H = 125e-6  # control cycle [s]
STEPS = 8000  # 1 s
REPEATS = 200  # every step must once be left alone by the operating system
COLD = 5
SELECTED = 40  # slowest steps that are measured with cold caches and whose instructions are counted

T = np.arange(STEPS + 1) * H
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """Inputs by name (STEPS + 1,), linear between the instants; Real parameters by name. `archive` where it is not the
    unit's own."""

    unit: str
    name: str
    inputs: Mapping[str, Floats]
    parameters: Mapping[str, float] = field(default_factory=dict)
    archive: Path | None = None


@dataclass(frozen=True)
class Cost:
    """Times [ns] of one step: of all steps of all runs, and of single steps by their shortest time over the runs."""

    median: float
    percentile: float  # 99.99 %
    largest: float  # longest that was observed, operating system included
    first: float  # the first step of a new instance, which computes what the step size needs; shortest of some starts
    worst: float  # largest of the other steps' shortest times
    cold: float  # the same with cold caches
    setting: tuple[float, float]  # inputs and slopes ahead of a step: median and largest of the shortest times
    instructions: tuple[int, int] | None  # of a usual step (median of some drawn at random) and of the slowest


def _friction(amplitude: float, frequency: float) -> Case:
    """Reversals ever again, through engaging, sliding and pre-sliding."""
    return Case(
        "friction",
        f"reversals, up to {amplitude:g} rad/s",
        {"n_fr": amplitude * np.sin(2 * np.pi * frequency * T) * np.exp(-3 * T)},
    )


def _controller() -> Case:
    """A position tick every eighth step, all filters on, torque and voltage at their limits half of the time."""
    swing = np.sin(2 * np.pi * 5 * T)
    return Case(
        "controller",
        "position ticks, limits active",
        {"x_s": 0.05 * swing, "n_ffw": 500 * swing, "x_a": 0.049 * swing, "n_a": 450 * swing + 20 * np.sin(900 * T)},
        {"M_max": 20.0, "u_max": 200.0},
    )


def _plant(name: str, archive: Path | None = None, torque: float = 2.0, start: float | None = None) -> Case:
    sweep = {f"{axis}.M_a": torque * np.sin(2 * np.pi * (30 + 90 * T) * T) for axis in "XYZ"}
    tool = {f"tool.F_{axis}": 200 * np.sin(2 * np.pi * 70 * T) for axis in "XYZ"}
    if start is not None:
        sweep["Z.M_a"] = np.full(STEPS + 1, torque)
    return Case("plant", name, sweep | tool, {} if start is None else {"Z.x_0": start}, archive)


def case_of(unit: str) -> Case:
    """One demanding case of the unit; without inputs where it has none here."""
    found = {"friction": _friction(200.0, 4.0), "controller": _controller(), "plant": _plant("93 modes, one pose")}
    return found.get(unit) or Case(unit, "as it starts", {})


def with_poses(folder: Path, cells: int, fmus: Path | None = None) -> Case:
    """The default machine with a grid of poses along Z, through which Z runs; in plant.fmu of the folder `fmus`."""
    import pose_grid

    structure = pose_grid.load_structure(pose_grid.MACHINE / "structure.yaml")
    low, high = structure.axes["Z"].travel
    machine = pose_grid.load(folder, low, high, 10.0, 0.1).machine
    grid = pose_grid.pose_grid(
        structure, dict(machine.pose), [pose_grid.grid_axis("Z", low, high, (high - low) / cells)]
    )
    archive = pose_grid.packed(machine, grid, folder, fmus)
    return _plant(f"{cells} poses along Z, crossings", archive, 6.0, low)


def compile_harness(folder: Path) -> Path:
    """worst_case.c with the compiler of the Makefile."""
    folder.mkdir(parents=True, exist_ok=True)
    compiler = shlex.split(os.environ.get("CC", "cc"))
    headers = ROOT / "src" / "fmi2" / "standard"
    source = ROOT / "benchmarks" / "worst_case.c"
    program = folder / "worst_case"
    flags = ["-std=gnu99", "-O2", "-g", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", f"-I{headers}"]
    subprocess.run([*compiler, *flags, str(source), "-o", str(program), "-ldl", "-lm"], check=True)
    return program


def write_script(path: Path, case: Case, archive: Archive) -> None:
    """The case in the words of worst_case.c."""
    reference = {name: variable.valueReference for name, variable in archive.variables.items()}
    resources = archive.directory / "resources"
    lines = [f"{archive.guid} {resources.as_uri() if resources.is_dir() else '-'}", f"{H!r} {STEPS}"]
    lines.append(" ".join([str(len(case.parameters)), *(f"{reference[k]} {v!r}" for k, v in case.parameters.items())]))
    lines.append(" ".join(map(str, [len(case.inputs), *(reference[name] for name in case.inputs)])))
    lines += [" ".join(map(repr, row)) for row in np.column_stack(list(case.inputs.values()) or [T[:, None]]).tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def library(archive: Archive, unit: str) -> Path:
    """This machine's binary."""
    return archive.directory / "binaries" / fmpy.platform / f"{unit}{fmpy.sharedLibraryExtension}"


def run(
    program: Path,
    mode: str,
    binary: Path,
    script: Path,
    repeats: int,
    indices: Path | None = None,
    prefix: Sequence[str] = (),
) -> list[str]:
    """What worst_case prints, by lines. `prefix`: words of a command that runs it."""
    words = [str(program), mode, str(binary), str(script), str(repeats), *([str(indices)] if indices else [])]
    command = [*prefix, *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()


def _times(lines: list[str]) -> dict[int, float]:
    return {int(line.split()[0]): float(line.split()[1]) for line in lines[:-1]}


def _instructions(program: Path, binary: Path, script: Path, indices: Path, folder: Path) -> list[int]:
    """Instructions of each step that `indices` lists, in order, with callgrind."""
    out = folder / "callgrind"
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out / 'step'}", "--collect-atstart=no"]
    command += ["--toggle-collect=measured_step", "--dump-after=measured_step"]
    command += [str(program), "count", str(binary), str(script), "1", str(indices)]
    subprocess.run(command, check=True, capture_output=True)
    counts = {}
    for path in out.glob("step.*"):
        if match := re.search(r"^(?:totals|summary): (\d+)", path.read_text(encoding="ascii"), re.MULTILINE):
            counts[int(path.suffix[1:])] = int(match[1])
    return [counts[key] for key in sorted(counts)]


def measure(
    program: Path,
    case: Case,
    folder: Path,
    prefix: Sequence[str] = (),
    repeats: int = REPEATS,
    selected: int = SELECTED,
) -> Cost:
    """Run the case in every mode, `repeats` times from the same saved state."""
    with Archive(case.archive or cosim.fmus_directory() / f"{case.unit}.fmu") as archive:
        script, binary, marked = folder / "script.txt", library(archive, case.unit), folder / "indices.txt"
        write_script(script, case, archive)
        lines = run(program, "time", binary, script, repeats, prefix=prefix)
        times = _times(lines)
        first = min(_times(run(program, "time", binary, script, 1, prefix=prefix))[0] for _ in range(COLD))
        median, percentile, largest, *setting = map(float, lines[-1].split()[1:])
        slowest = sorted(range(1, STEPS), key=lambda k: -times[k])[:selected]
        usual = np.random.default_rng(1).choice(np.arange(1, STEPS), selected, replace=False).tolist()

        def mark(steps: list[int]) -> Path:
            marked.write_text("\n".join(map(str, sorted(set(steps)))) + "\n", encoding="ascii")
            return marked

        cold_lines = run(program, "cold", binary, script, COLD, mark(slowest + usual), prefix)
        instructions = None
        if selected == SELECTED and shutil.which("valgrind"):
            counts = [_instructions(program, binary, script, mark(steps), folder) for steps in (usual, slowest)]
            instructions = int(statistics.median(counts[0])), max(counts[0] + counts[1])
    cold = max(_times(cold_lines).values())
    return Cost(median, percentile, largest, first, times[slowest[0]], cold, (setting[0], setting[1]), instructions)


CASES: Mapping[str, Callable[[Path], Case]] = {
    "friction-reversals": lambda folder: case_of("friction"),
    "friction-presliding": lambda folder: _friction(1.0, 20.0),
    "controller": lambda folder: case_of("controller"),
    "plant": lambda folder: case_of("plant"),
    "plant-poses": lambda folder: with_poses(folder, 16),
    "setpoint": lambda folder: Case("setpoint", "its own table", {}),
}


def _options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--fifo", type=int, metavar="CORE", help="measure on this core with real-time priority")


def main(given: Sequence[str] | None = None) -> int:
    bench = arguments("worst_case", __doc__, given, rounds=REPEATS, only=tuple(CASES), more=_options)
    core = bench.given.fifo
    prefix = [] if core is None else ["taskset", "-c", str(core), "chrt", "-f", "50"]
    rows, results = [], {}
    with tempfile.TemporaryDirectory(prefix="feedsim-") as name:
        folder = Path(name)
        program = compile_harness(ROOT / "build" / "bench")
        for key in bench.only:
            if bench.short and key == "plant-poses":
                continue  # its grid takes longer than all others
            progress(key)
            case = CASES[key](folder)
            cost = measure(program, case, folder, prefix, bench.rounds, 2 if bench.short else SELECTED)
            results[key] = asdict(cost)
            times = (cost.median, cost.percentile, cost.largest, cost.worst, cost.cold, cost.first)
            setting = ", ".join(f"{time / 1e3:.2f} us" for time in cost.setting) if case.inputs else ""
            counted = ["", ""] if cost.instructions is None else [f"{count:,}" for count in cost.instructions]
            rows.append([case.unit, case.name, *(f"{time / 1e3:.2f} us" for time in times), setting, *counted])
    progress("")
    header = ["unit", "case", "all steps: median", "99.99 %", "longest observed"]
    header += ["largest of the steps' shortest times", "... with cold caches", "first step"]
    header += ["setting the inputs: median, largest", "instructions: usual", "most"]
    text = f"{STEPS} steps of 125 us, {bench.rounds} times from the same saved state.\n\n{table(header, rows)}"
    bench.tell(text, {"ns": results, "steps": STEPS, "repeats": bench.rounds, "real-time priority on core": core})
    return 0


if __name__ == "__main__":
    sys.exit(main())
