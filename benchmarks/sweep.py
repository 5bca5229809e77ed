"""What a study of many runs costs: efficiency of two workers, start-up, memory over ten thousand runs.

Run by ``make bench``; three to four minutes. Serial is the same engine in one process, which is a plain loop over the
runs. What two processes reach that know nothing of each other and of the engine is the machine's part of the loss.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import psutil
from harness import Contestant, Costs, described, digits, measure, progress, table, write_json

from feedsim.cosim import fmus_directory
from feedsim.scenario import Base, Change
from feedsim.sweep.bundle import Bundle
from feedsim.sweep.engine import Engine, open_engine
from feedsim.sweep.task import Task

ROOT = Path(__file__).resolve().parents[1]
PLOT = ROOT / "docs" / "images" / "sweep-memory.svg"
WORKERS = 2
ROUNDS = 3
MANY = 10_000
DEADLINE = 150.0  # s for those; the figure says how many were reached


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


CIRCLE = Case("circle", "xz_circle.yaml", (), 40)
SHORT = Case("short move", "z_positioning.yaml", ("motions.0.by.Z=1 mm", "motions.1.duration=0.05 s"), 400)
CASES = {case.name: case for case in (CIRCLE, SHORT)}


def main() -> int:
    if len(sys.argv) == 3:  # one of the two processes that know nothing of the engine
        return alone(CASES[sys.argv[1]], int(sys.argv[2]))
    results: dict[str, object] = {}
    rows = []
    for case in CASES.values():
        costs, startup = efficiency(case)
        serial, engine = costs.median("serial"), costs.median("engine")
        reached = 1.0 / (WORKERS * costs.ratio("engine", "serial"))
        possible = 1.0 / (WORKERS * costs.ratio("apart", "serial"))
        results[case.name] = {
            "runs": case.runs, "costs": costs.as_json("serial"), "start-up s": startup, "efficiency": reached,
            "efficiency without an engine": possible, "runs per second": case.runs / engine,
        }  # fmt: skip
        rows.append(
            [case.name, case.runs, f"{digits(serial / case.runs * 1e3)} ms", f"{digits(case.runs / serial)} /s",
             f"{digits(case.runs / engine)} /s", digits(reached, 2), digits(possible, 2), f"{digits(startup, 2)} s"]
        )  # fmt: skip
    memory = many()
    results["memory"] = memory.as_json()
    memory.plot()
    print(f"{described()}\n")
    print(table(
        ["run", "runs", "one run", "serial", f"{WORKERS} workers", "efficiency", "of two plain processes", "start-up"],
        rows,
    ))  # fmt: skip
    print()
    print(memory.told())
    write_json("sweep", results)
    return 0


def efficiency(case: Case) -> tuple[Costs, float]:
    """Seconds for all runs of a case by each contestant, and the start-up of the workers [s]."""
    bundle = case.bundle()
    begun = time.perf_counter()
    with open_engine(bundle, workers=WORKERS) as crowd, open_engine(bundle, workers=0) as here:
        startup = time.perf_counter() - begun
        for engine in (crowd, here):
            timed(engine, case, 4 * WORKERS)  # what only a first run does
        contestants = [
            Contestant("serial", lambda: timed(here, case)),
            Contestant("engine", lambda: timed(crowd, case)),
            Contestant("apart", lambda: apart(case)),
        ]
        return measure(contestants, ROUNDS, title=case.name), startup


def timed(engine: Engine, case: Case, runs: int | None = None) -> float:
    begun = time.perf_counter()
    outcomes = list(engine.map(case.tasks(runs=runs)))
    spent = time.perf_counter() - begun
    failed = [outcome.error for outcome in outcomes if outcome.error]
    if failed or len(outcomes) != (runs or case.runs):
        raise SystemExit(f"{case.name}: {len(outcomes)} outcomes, {len(failed)} failed: {failed[:1]}")
    return spent


def apart(case: Case) -> float:
    """The time of the slower of two processes with half of the runs each, which begin together."""
    command = [sys.executable, __file__, case.name]
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
    with open_engine(case.bundle(), workers=0) as engine:
        list(engine.map(case.tasks(runs=4)))
        print("ready", flush=True)
        sys.stdin.readline()
        begun = time.perf_counter()
        for _ in engine.map(case.tasks(first, WORKERS)):
            pass
        print(time.perf_counter() - begun)
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
        return {"client": self.client, **by_worker}

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

    def plot(self) -> None:
        import matplotlib as mpl

        mpl.use("svg")
        import matplotlib.pyplot as plt

        with plt.rc_context({"svg.hashsalt": "feedsim", "svg.fonttype": "path", "font.size": 9}):
            figure, axes = plt.subplots(figsize=(6.4, 3.0), layout="constrained")
            for name, curve in self.curves().items():
                axes.plot(self.runs, curve, label=name, linewidth=1.2)
            axes.set(xlabel="runs", ylabel="resident memory [MB]", xlim=(0, self.runs[-1]), ylim=(0, None))
            axes.grid(alpha=0.3)
            axes.legend()
            PLOT.parent.mkdir(exist_ok=True)
            figure.savefig(PLOT, metadata={"Date": None, "Creator": None})
            plt.close(figure)


def many() -> Memory:
    """Memory of client and workers over many short runs."""
    me, found = psutil.Process(), Memory()
    with open_engine(SHORT.bundle(), workers=WORKERS) as engine:
        children = [each for each in me.children(recursive=True) if "spawn_main" in " ".join(each.cmdline())]
        begun = looked = time.perf_counter()
        for count, _ in enumerate(engine.map(SHORT.tasks(runs=MANY)), 1):
            if time.perf_counter() - looked > 0.5 or count == MANY:
                looked = time.perf_counter()
                found.look(count, me, children)
                progress(f"memory: {count} of {MANY} runs")
                if looked - begun > DEADLINE:
                    break
        found.seconds = time.perf_counter() - begun
    progress("")
    return found


if __name__ == "__main__":
    sys.exit(main())
