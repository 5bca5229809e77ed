"""How long people wait: commands from the start of their process to its end, and where the time of a run goes.

Commands take turns; a time is the wall time of the process, Python's own start included. The parts of a run are those
of processes that make it three times: the first has libraries to load, archives to unpack and poses to solve, the later
ones find them there (feedsim.cosim.unpacked).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from harness import ROOT, Contestant, described, digits, measure, table, write_json

CIRCLE = ROOT / "scenarios" / "xz_circle.yaml"
# A short move: what a study makes thousands of. 1 mm in Z and a rest.
SHORT = f"""name: short move
machine: {(ROOT / "scenarios" / "machines" / "test_centre").as_posix()}
motions:
  - {{kind: move, by: {{Z: 1 mm}}, feed: 3000 mm/min}}
  - {{kind: dwell, duration: 150 ms}}
recording: {{interval: 1 ms}}
evaluate:
  - {{kind: positioning, axis: Z, band: 1 um}}
"""
RUNS = 3  # in one process
PARTS = {
    "libraries": "loading numpy, scipy, pydantic, FMPy and feedsim",
    "read": "scenario and machine files, checked",
    "plan": "motion: path, profile, interpolation",
    "open": "archives unpacked, units instantiated, parameterised and wired",
    "initialise": "units initialised",
    "loop": "cycle loop",
    "rest": "pose, trace, warnings",
    "evaluate": "derived figures",
    "report": "figures, result.csv, summary.json, report.html",
}


def waited(words: Sequence[str]) -> Callable[[], float]:
    """A command to be measured: seconds from its start to its end."""

    def run() -> float:
        begun = time.perf_counter()
        done = subprocess.run(words, capture_output=True, text=True)
        taken = time.perf_counter() - begun
        if done.returncode != 0:
            raise SystemExit(f"{' '.join(words)}: {done.stderr.strip()}")
        return taken

    return run


def parts(file: Path, directory: Path) -> list[dict[str, float]]:
    """Seconds of every part, of RUNS runs in this process. The report is written for the first alone."""
    begun = time.perf_counter()
    from feedsim import analysis, cosim, nc, report, scenario
    from feedsim.cosim.system import System

    found: list[dict[str, float]] = []
    spent: dict[str, float] = {"libraries": time.perf_counter() - begun}

    def timed(part: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def wrapper(*arguments: Any, **named: Any) -> Any:
            begun = time.perf_counter()
            try:
                return call(*arguments, **named)
            finally:
                spent[part] = time.perf_counter() - begun

        return wrapper

    System.__init__ = timed("open", System.__init__)  # type: ignore[method-assign]
    System.initialise = timed("initialise", System.initialise)  # type: ignore[method-assign]
    for i in range(RUNS):
        loaded = timed("read", scenario.load)(file)
        program = timed("plan", nc.plan)(loaded)
        run = timed("rest", cosim.run)(loaded, program=program)
        spent["loop"] = run.wall_time
        spent["rest"] -= spent["open"] + spent["initialise"] + spent["loop"]
        figures = timed("evaluate", analysis.evaluate)(run)
        if i == 0:
            timed("report", report.write)(run, figures, directory)
        found.append(dict(spent))
        spent.clear()
    return found


def runs(file: Path, times: int) -> list[dict[str, float]]:
    """Seconds of every part by run, medians of `times` processes."""
    with TemporaryDirectory(prefix="feedsim-bench-") as folder:
        words = [sys.executable, __file__, "--parts", str(file), "--out", folder]
        told = [json.loads(subprocess.run(words, check=True, capture_output=True).stdout) for _ in range(times)]
    return [{part: median(each[i][part] for each in told) for part in told[0][i]} for i in range(RUNS)]


def parts_table(title: str, found: list[dict[str, float]]) -> str:
    heads = ("first run", "second", "third")[: len(found)]
    rows: list[list[object]] = [
        [f"{part}: {what}", *(digits(1e3 * run[part]) + " ms" if part in run else "" for run in found)]
        for part, what in PARTS.items()
    ]
    rows.append(["**all**", *(f"**{digits(1e3 * sum(run.values()))} ms**" for run in found)])
    return table([title, *heads], rows)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("--rounds", type=int, default=7, help="how often every command runs (default: 7)")
    options.add_argument("--parts", type=Path, help=argparse.SUPPRESS)  # in a process of its own
    options.add_argument("--out", type=Path, help=argparse.SUPPRESS)
    chosen = options.parse_args()
    if chosen.parts is not None:
        json.dump(parts(chosen.parts, chosen.out), sys.stdout)
        return
    program = [sys.executable, "-c", "from feedsim.cli import entry; entry()"]
    with TemporaryDirectory(prefix="feedsim-bench-") as folder:
        out = ["--quiet", "--out", f"{folder}/out"]
        commands = {
            "an empty Python program": [sys.executable, "-c", ""],
            "`import feedsim`": [sys.executable, "-c", "import feedsim"],
            "`feedsim --version`": [*program, "--version"],
            "`feedsim --help`": [*program, "--help"],
            "`feedsim validate scenarios/xz_circle.yaml`": [*program, "validate", str(CIRCLE)],
            "`feedsim run scenarios/xz_circle.yaml`": [*program, "run", str(CIRCLE), *out],
        }
        costs = measure(
            [Contestant(name, waited(words)) for name, words in commands.items()], chosen.rounds, title="start-up"
        )
        short = Path(folder) / "short.yaml"
        short.write_text(SHORT, encoding="utf-8")
        circle, move = runs(CIRCLE, min(chosen.rounds, 5)), runs(short, min(chosen.rounds, 5))
    print(f"{described()}\n")
    rows = [[name, f"{digits(costs.median(name))} s", f"{digits(costs.shortest(name))} s"] for name in commands]
    print(table(["command", "median", "shortest"], rows), end="\n\n")
    print(parts_table("X-Z circle", circle), end="\n\n")
    print(parts_table("move of 1 mm", move))
    path = write_json("startup", {"commands": costs.as_json(), "X-Z circle": circle, "short move": move})
    print(f"\n{path.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
