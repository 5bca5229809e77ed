"""What a study of many runs costs: efficiency of two workers, start-up, memory over some thousand runs.

Serial is the plain loop over the runs in one process, whose place stays laid out, as a worker's does. What two
processes reach that know nothing of each other and of the engine is the machine's part of the loss.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from harness import ROOT, Contestant, Costs, arguments, digits, measure, progress, table

import numpy as np
import psutil

from feedsim.design.sweep.bundle import Bundle, Workplace
from feedsim.design.sweep.design import Outcome, Task
from feedsim.design.sweep.engine import Engine, open_engine
from feedsim.scenario import Base, Change
from feedsim.simulation.cosim import fmus_directory

WORKERS = 2
MANY = 10_000
POINTS = 12  # of each curve in the plot
DEADLINE = 50.0  # s for those; the figure says how many were reached


@dataclass(frozen=True)
class Case:
    """Runs of a scenario that differ in the Coulomb friction of Z."""

    name: str
    file: str
    overrides: tuple[str, ...]
    runs: int

    def bundle(self) -> Bundle:
        base = Base.read(ROOT / "scenarios" / self.file, self.overrides)
        return Bundle.of_base(base, base.files, fmus_directory())

    def tasks(self, first: int = 0, step: int = 1, runs: int | None = None) -> Iterator[Task]:
        for run in range(first, runs or self.runs, step):
            torque = f"{1.0 + (run % 1000) * 1e-3:.17g} N.m"
            yield Task(run, (Change("machine.axes.Z.friction.F_C", torque, torque),))


CIRCLE = Case("circle", "xz_circle.yaml", ("motions.0.direction=counterclockwise",), 40)
SHORT = Case("short move", "z_positioning.yaml", ("motions.0.by.Z=1 mm", "motions.1.duration=0.05 s"), 400)
ONE = replace(SHORT, name="short move, one unit", overrides=(*SHORT.overrides, "coupling.units=one"))
CASES = {"circle": CIRCLE, "short": SHORT, "one": ONE}
MEMORY = "memory"


def main(words: Sequence[str] | None = None) -> int:
    bench = arguments("sweep", __doc__, words, rounds=3, only=(*CASES, MEMORY), images=True, more=deadline)
    results: dict[str, object] = {}
    rows = []
    for key in bench.only:
        if key not in CASES or (bench.short and key != "short"):
            continue
        case = replace(CASES[key], runs=4) if bench.short else CASES[key]
        costs, startup = efficiency(case, bench.rounds)
        serial, engine = costs.median("serial"), costs.median("engine")
        reached, possible = (
            [
                1.0 / (WORKERS * ratio)
                for ratio in (costs.ratio(name, "serial"), *reversed(costs.quartiles(name, "serial")))
            ]
            for name in ("engine", "apart")
        )
        results[case.name] = {
            "runs": case.runs, "costs": costs.as_json("serial"), "start-up s": startup,
            "efficiency, quartiles": reached, "efficiency without an engine, quartiles": possible,
            "runs per second": case.runs / engine,
        }  # fmt: skip
        rows.append(
            [case.name, case.runs, f"{digits(serial / case.runs * 1e3)} ms", f"{digits(case.runs / serial)} /s",
             f"{digits(case.runs / engine)} /s", told(reached), told(possible), f"{digits(startup, 2)} s"]
        )  # fmt: skip
    tables = []
    if rows:
        header = ["run", "runs", "one run", "serial", f"{WORKERS} workers", "efficiency", "of two plain processes"]
        tables.append(table([*header, "start-up"], rows))
    memory = many(min(bench.given.deadline, 1.0 if bench.short else DEADLINE)) if MEMORY in bench.only else None
    if memory is not None:
        results["memory"] = memory.as_json()
        tables.append(memory.told())
    bench.tell("\n\n".join(tables), results)
    if memory is not None:
        print(f"{memory.plot(bench.images)} written", file=sys.stderr)
    return 0


def deadline(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--deadline", type=float, default=DEADLINE, metavar="S",
        help=f"for the {MANY} runs whose memory is looked at [s] (default: {DEADLINE:g})",
    )  # fmt: skip


def shares(costs: Costs, name: str) -> list[float]:
    """Time of the serial loop over that of all workers together: median, first and third quartile."""
    ratios = (costs.ratio(name, "serial"), *reversed(costs.quartiles(name, "serial")))
    return [1.0 / (WORKERS * ratio) for ratio in ratios]


def told(values: Sequence[float]) -> str:
    """Median and quartiles."""
    middle, low, high = (f"{100 * value:.0f}" for value in values)
    return f"{middle} % ({low}-{high})"


def efficiency(case: Case, rounds: int) -> tuple[Costs, float]:
    """Seconds for all runs of a case by each contestant, and the start-up of the workers [s]."""
    bundle = case.bundle()
    place = bundle.open()
    begun = time.perf_counter()
    try:
        with open_engine(bundle, workers=WORKERS) as crowd:
            startup = time.perf_counter() - begun
            # What only a first run does, of the process and of its place.
            by_engine(crowd, case, 4 * WORKERS)
            in_place(place, case, 4)
            contestants = [
                Contestant("serial", lambda: in_place(place, case)),
                Contestant("engine", lambda: by_engine(crowd, case)),
                Contestant("apart", lambda: apart(case)),
            ]
            return measure(contestants, rounds, title=case.name), startup
    finally:
        place.close()


def by_engine(engine: Engine, case: Case, runs: int | None = None) -> float:
    """Seconds for the first runs of a case, None: all."""
    begun = time.perf_counter()
    outcomes = list(engine.map(case.tasks(runs=runs)))
    return checked(case, outcomes, runs or case.runs, time.perf_counter() - begun)


def in_place(place: Workplace, case: Case, runs: int | None = None) -> float:
    """The same, one after the other in this process."""
    begun = time.perf_counter()
    outcomes = [place.run(task) for task in case.tasks(runs=runs)]
    return checked(case, outcomes, runs or case.runs, time.perf_counter() - begun)


def checked(case: Case, outcomes: Sequence[Outcome], expected: int, spent: float) -> float:
    failed = [outcome.error for outcome in outcomes if outcome.error]
    if failed or len(outcomes) != expected:
        raise SystemExit(f"{case.name}: {len(outcomes)} outcomes, {len(failed)} failed: {failed[:1]}")
    return spent


def apart(case: Case) -> float:
    """The time of the slower of two processes with half of the runs each, which begin together."""
    key = next(key for key, each in CASES.items() if each.name == case.name)
    command = [sys.executable, __file__, "--apart", key]
    processes = [
        subprocess.Popen([*command, str(i)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for i in range(WORKERS)
    ]
    for process in processes:  # until all are ready
        assert process.stdout is not None
        process.stdout.readline()
    for process in processes:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    return max(float(process.communicate()[0]) for process in processes)


def alone(case: Case, first: int) -> int:
    """One of the processes of :func:`apart`."""
    place = case.bundle().open()
    try:
        in_place(place, case, 4)
        print("ready", flush=True)
        sys.stdin.readline()
        begun = time.perf_counter()
        outcomes = [place.run(task) for task in case.tasks(first, WORKERS)]
        print(checked(case, outcomes, len(range(first, case.runs, WORKERS)), time.perf_counter() - begun))
    finally:
        place.close()
    return 0


@dataclass
class Memory:
    """Resident memory [MB] of this process and of each worker after so many runs."""

    runs: list[int] = field(default_factory=list)
    client: list[float] = field(default_factory=list)
    workers: list[list[float]] = field(default_factory=list)
    seconds: float = 0.0

    def look(self, runs: int, me: psutil.Process, workers: Sequence[psutil.Process]) -> None:
        self.runs.append(runs)
        self.client.append(me.memory_info().rss / 1e6)
        self.workers.append([worker.memory_info().rss / 1e6 for worker in workers])

    def curves(self) -> dict[str, list[float]]:
        by_worker = {f"worker {i + 1}": list(curve) for i, curve in enumerate(zip(*self.workers, strict=True))}
        return {"client and scheduler": self.client, **by_worker}

    def slope(self, curve: Sequence[float]) -> float:
        """kB per 1000 runs, over the second half of the runs."""
        runs = np.array(self.runs)
        late = runs >= runs[-1] / 2
        return float(np.polyfit(runs[late], np.array(curve)[late], 1)[0] * 1e6)

    def as_json(self) -> dict[str, object]:
        return {
            "runs": self.runs, "seconds": self.seconds, "rss MB": self.curves(),
            "slope kB per 1000 runs": {name: self.slope(curve) for name, curve in self.curves().items()},
        }  # fmt: skip

    def told(self) -> str:
        tenth = int(np.searchsorted(self.runs, self.runs[-1] / 10))
        rows = [
            [name, f"{curve[tenth]:.1f} MB", f"{curve[-1]:.1f} MB", f"{max(curve):.1f} MB",
             f"{self.slope(curve):.0f} kB"]
            for name, curve in self.curves().items()
        ]  # fmt: skip
        head = ["process", f"after {self.runs[tenth]}", f"after {self.runs[-1]} runs", "peak", "growth per 1000 runs"]
        return f"{self.runs[-1]} short moves in {self.seconds:.0f} s:\n\n{table(head, rows)}"

    def plot(self, images: Path) -> Path:
        from drawings import Curve, Panel, write_svg

        # Workers lie on each other: fewer points than looks, and each curve at others, so that all markers show.
        curves, count = [], len(self.runs)
        for first, (name, curve) in enumerate(self.curves().items()):
            shown = range(min(first * count // (3 * POINTS), count - 1), count, max(1, count // POINTS))
            curves.append(Curve(name, [self.runs[i] for i in shown], [curve[i] for i in shown]))
        title = "two workers over many runs"
        return write_svg(
            "sweep-memory", [Panel(title, "runs", "resident memory [MB]", curves, scales=("linear", "linear"))], images
        )


def many(seconds: float) -> Memory:
    """Memory of client and workers over many short runs, or as many as are made in `seconds`."""
    me, found = psutil.Process(), Memory()
    with open_engine(SHORT.bundle(), workers=WORKERS) as engine:
        children = [each for each in me.children(recursive=True) if "spawn_main" in " ".join(each.cmdline())]
        begun = looked = time.perf_counter()
        for count, _ in enumerate(engine.map(SHORT.tasks(runs=MANY)), 1):
            if time.perf_counter() - looked > 0.5 or count == MANY:
                looked = time.perf_counter()
                found.look(count, me, children)
                progress(f"memory: {count} of {MANY} runs")
                if looked - begun > seconds:
                    break
        found.seconds = time.perf_counter() - begun
    progress("")
    return found


if __name__ == "__main__":
    if sys.argv[1:2] == ["--apart"]:
        sys.exit(alone(CASES[sys.argv[2]], int(sys.argv[3])))
    sys.exit(main())
