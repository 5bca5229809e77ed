"""What a 125 us control cycle costs: each unit's doStep (measured in C), and the master loop in Python (on the circle).

Run by ``make bench``. All figures come from one run on one machine; read the ratios, not the nanoseconds.
"""

from __future__ import annotations

import os
import shlex
import statistics
import subprocess
import sys
from pathlib import Path

import fmpy
from harness import described, write_json

from feedsim import cosim, scenario
from feedsim.cosim.unit import Archive

ROOT = Path(__file__).resolve().parents[1]
STEPS = 200_000
REPETITIONS = 5
# unit -> (driven input, amplitude in SI, output read back, instances in the default machine)
CASES = {
    "plant": ("Z.M_a", 0.5, "Z.n_a", 1),
    "controller": ("x_a", 1e-6, "M_a", 3),
    "friction": ("n_fr", 15.0, "M_fr", 3),
}


def build(directory: Path) -> Path:
    """Compile the C harness with the compiler of the Makefile."""
    program = directory / "dostep"
    directory.mkdir(parents=True, exist_ok=True)
    compiler = shlex.split(os.environ.get("CC", "cc"))
    source = ROOT / "benchmarks" / "dostep.c"
    headers = ROOT / "src" / "fmi2" / "standard"
    subprocess.run([*compiler, "-O2", f"-I{headers}", str(source), "-o", str(program), "-ldl", "-lm"], check=True)
    return program


def unit_cost(program: Path, name: str) -> tuple[float, float]:
    """Median ns per step of `name`: (doStep alone, with set, set slope and get around it)."""
    driven, amplitude, read, _ = CASES[name]
    with Archive(cosim.fmus_directory() / f"{name}.fmu") as archive:
        library = archive.directory / "binaries" / fmpy.platform / f"{name}{fmpy.sharedLibraryExtension}"
        variables = archive.variables
        command = [
            str(program), str(library), name, archive.guid, (archive.directory / "resources").as_uri(), str(STEPS),
            str(variables[driven].valueReference), str(amplitude), str(variables[read].valueReference),
        ]  # fmt: skip
        runs = [
            [float(line) for line in subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()]
            for _ in range(REPETITIONS)
        ]
    return statistics.median(run[0] for run in runs), statistics.median(run[1] for run in runs)


def main() -> int:
    program = build(ROOT / "build" / "bench")
    results: dict[str, float] = {}
    print(described(), "\n")
    print("| per 125 us cycle | one doStep | with set, slope, get | instances |")
    print("|---|---|---|---|")
    for name, (*_, instances) in CASES.items():
        alone, exchanged = unit_cost(program, name)
        results[f"{name} doStep ns"], results[f"{name} exchanged ns"] = alone, exchanged
        print(f"| {name} | {alone / 1e3:.3f} us | {exchanged / 1e3:.3f} us | {instances} |")
    units = sum(results[f"{name} doStep ns"] * case[3] for name, case in CASES.items())
    circle = scenario.load(ROOT / "scenarios" / "xz_circle.yaml")
    runs = []
    for i in range(REPETITIONS):
        print(f"circle, run {i + 1} of {REPETITIONS}", end="\r", file=sys.stderr)
        runs.append(cosim.run(circle, native=False))
    simulated = float(runs[0].program.time[-1])
    cycles = simulated / circle.machine.cycles.T_c
    loop = statistics.median(run.wall_time for run in runs) / cycles * 1e9
    results.update({"units ns": units, "master loop ns": loop, "simulated s": simulated})
    results["real-time factor"] = simulated / (loop * cycles * 1e-9)
    print(f"| all units together | {units / 1e3:.3f} us | | 7 |")
    print(f"| whole master loop | {loop / 1e3:.2f} us | | |")
    print(f"\nmaster loop / units: {loop / units:.1f}")
    spent = loop * cycles * 1e-9
    print(f"circle: {simulated:.3f} s simulated in {spent:.2f} s, real-time factor {simulated / spent:.2f}")
    write_json("cycle", results)
    return 0


if __name__ == "__main__":
    sys.exit(main())
