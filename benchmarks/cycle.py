"""What a 125 us control cycle costs: each unit's doStep (measured in C), the master's loops (on the circle), effects.

Units and loops take turns. Read the ratios, not the nanoseconds.
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from harness import CIRCLE, ROOT, Contestant, Costs, arguments, digits, measure, table

import fmpy
import numpy as np

import feedsim
from feedsim import scenario
from feedsim.files.trace import Trace
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim.archive import Archive

DEFAULT = ROOT / "scenarios" / "machines" / "test_centre"
STEPS = 200_000
ROUNDS = 5
LOOPS = {"native loop": True, "Python loop": False}
MOUNTED = "four mounts that are not linear"
CONTACT = "stiffness: 200 N/um, damping: 3e4 N.s/m, inertia: 0.004 kg.m^2"
# Effect of one axis -> settings of the circle's scenario.
EFFECTS = {
    "friction at a guide": ("machine.axes.X.guide.share=60 %",),
    "transmission": (f"machine.axes.X.transmission={{{CONTACT}}}",),
    "transmission with play": (f"machine.axes.X.transmission={{{CONTACT}, play: 8 um}}",),
}
SPRINGS = "      - nodes: [B0.0, B0.4, B0.8, B2.0, B2.4, B2.8]\n"
RUBBER = """\
      - {nodes: [B0.4, B2.4], offset: [0 mm, -450 mm, 0 mm], stiffness: [45 N/um, 65 N/um, 45 N/um]}
      - nodes: [B0.0, B0.8, B2.0, B2.8]
        friction: {F_max: [400 N, 600 N, 400 N], x_2: [20 um, 20 um, 20 um]}
        viscous: {K_v: [5 N/um, 5 N/um, 5 N/um], c: [4e4 N.s/m, 4e4 N.s/m, 4e4 N.s/m]}
"""
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


def unit_cost(program: Path, name: str, steps: int = STEPS) -> tuple[float, float]:
    """us per step of `name`: (doStep alone, with set, set slope and get around it)."""
    driven, amplitude, read, _ = CASES[name]
    with Archive(cosim.fmus_directory() / f"{name}.fmu") as archive:
        library = archive.directory / "binaries" / fmpy.platform / f"{name}{fmpy.sharedLibraryExtension}"
        variables = archive.variables
        command = [
            str(program), str(library), name, archive.guid, (archive.directory / "resources").as_uri(), str(steps),
            str(variables[driven].valueReference), str(amplitude), str(variables[read].valueReference),
        ]  # fmt: skip
        printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    alone, exchanged = (1e-3 * float(line) for line in printed.split())
    return alone, exchanged


def mounted(directory: Path) -> Path:
    """The default machine with four mounts that are not linear, as a folder."""
    place = directory / "mounted"
    shutil.copytree(DEFAULT, place, dirs_exist_ok=True)
    text = (DEFAULT / "structure.yaml").read_text(encoding="utf-8")
    assert SPRINGS in text
    (place / "structure.yaml").write_text(text.replace(SPRINGS, RUBBER), encoding="utf-8")
    built = feedsim.machine_build(place / "structure.yaml", at={"X": "800 mm", "Y": "327 mm", "Z": "100 mm"})
    built.save(directory / "built", force=True)
    for name in ("modes.csv", "mounts.csv"):
        shutil.copy(directory / "built" / name, place / name)
    machine = (DEFAULT / "machine.yaml").read_text(encoding="utf-8")
    (place / "machine.yaml").write_text(f"{machine}\nmounts: {{table: mounts.csv}}\n", encoding="utf-8")
    return place


def main(given: Sequence[str] | None = None) -> int:
    bench = arguments("cycle", __doc__, given, rounds=ROUNDS, only=(*CASES, *LOOPS, *EFFECTS, MOUNTED), more=_beside)
    program = build(ROOT / "build" / "bench")
    circle = scenario.load(CIRCLE, bench.circle)
    planned = nc.plan(circle)
    simulated = float(planned.time[-1])
    cycles = simulated / circle.machine.cycles.T_c
    traces: dict[str, Trace] = {}
    exchanged = Costs()  # filled while the units are measured
    left = dict.fromkeys(CASES, 0)

    def stepped(name: str) -> float:
        alone, around = unit_cost(program, name, STEPS // 100 if bench.short else STEPS)
        exchanged.costs.setdefault(name, {})[left[name]] = around
        left[name] += 1
        return alone

    def looped(native: bool, fmus: Path | None = None) -> float:
        run = cosim.run(circle, program=planned, native=native, fmus=fmus)
        first = traces.setdefault("first", run.trace)
        if different := [name for name in first if not np.array_equal(first[name], run.trace[name], equal_nan=True)]:
            raise SystemExit(f"the loops have computed different things: {', '.join(different)}")
        return 1e6 * run.cpu_time / cycles

    contestants = [Contestant(name, lambda name=name: stepped(name)) for name in CASES]  # type: ignore[misc]
    contestants += [Contestant(name, lambda native=native: looped(native)) for name, native in LOOPS.items()]  # type: ignore[misc]
    settings = {name: (*EFFECTS[name], *bench.circle) for name in EFFECTS if name in bench.only}
    if MOUNTED in bench.only:
        settings[MOUNTED] = (f"machine={mounted(program.parent)}", *bench.circle)
    changed = {name: scenario.load(CIRCLE, given) for name, given in settings.items()}

    def affected(name: str) -> float:
        return 1e6 * cosim.run(changed[name], program=plans[name]).cpu_time / cycles

    plans = {name: nc.plan(one) for name, one in changed.items()}
    contestants += [Contestant(name, lambda name=name: affected(name)) for name in changed]  # type: ignore[misc]
    chosen = [each for each in contestants if each.name in bench.only]
    others = {f"native loop, {folder}": folder for folder in bench.given.beside}
    chosen += [Contestant(name, lambda folder=folder: looped(True, folder)) for name, folder in others.items()]  # type: ignore[misc]
    costs = measure(chosen, bench.rounds, title="cycle, round")
    rows: list[list[object]] = [
        [name, f"{costs.median(name):.3f} us", f"{exchanged.median(name):.3f} us", CASES[name][3], ""]
        for name in CASES
        if name in costs.costs
    ]
    if all(name in costs.costs for name in CASES):
        per_round = [sum(costs.costs[name][i] * CASES[name][3] for name in CASES) for i in range(bench.rounds)]
        costs.costs["units"] = dict(enumerate(per_round))
        rows.append(["all units together", f"{costs.median('units'):.3f} us", "", 7, "1.00"])
        for name in LOOPS:
            if name in costs.costs:
                told = [f"the whole {name}", "", f"{digits(costs.median(name))} us", 7, costs.ratio_text(name, "units")]
                rows.append(list(told))
    rows += [[name, "", f"{digits(costs.median(name))} us", 7, ""] for name in others]
    header = ["per 125 us cycle", "doStep alone", "with set, slope and get", "instances", "of all units (quartiles)"]
    tables = [table(header, rows)]
    if "native loop" in costs.costs and (besides := [*others, *changed]):
        header = ["the circle with", "over a cycle without (quartiles)"]
        steps = {name: one.coupling.steps(one.machine) for name, one in changed.items()}
        shares = [
            [f"{name}, {steps[name]} exchange steps" if steps.get(name, 1) > 1 else name,
             costs.ratio_text(name, "native loop")]
            for name in besides
        ]  # fmt: skip
        tables.append(table(header, shares))
    baseline = "units" if "units" in costs.costs else None
    bench.tell("\n\n".join(tables), {"us": costs.as_json(baseline), "us, set, slope and get": exchanged.as_json()})
    return 0


def _beside(parser: argparse.ArgumentParser) -> None:
    told = "the native loop with the archives in DIR, too, such as build/fmus-all (made by zig)"
    parser.add_argument("--beside", type=Path, nargs="+", default=[], metavar="DIR", help=told)


if __name__ == "__main__":
    sys.exit(main())
