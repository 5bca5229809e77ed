"""How long people wait: commands from the start of their process to its end, and where the time of a run goes.

Commands take turns; a time is the wall time of the process, Python's own start included. The parts of a run are those
of ``feedsim run`` itself (watched.py), made three times by one process: the first has libraries to load, archives to
unpack and poses to solve, the later ones find them there (feedsim.simulation.cosim.unpacked).
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from harness import ROOT, Contestant, arguments, digits, measure, progress, table

from watched import watched

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
FEEDSIM = ["-c", "from feedsim.cli import entry; entry()"]
RUNS = 3  # in one process
PROCESSES = 5  # at the most
PARTS = {
    "libraries": "loaded",
    "read": "files, checked",
    "plan": "motion",
    "open": "archives, units",
    "initialise": "units",
    "loop": "cycles",
    "rows": "result.csv, beyond the loop",
    "pose": "modes over the motion",
    "trace": "energies, warnings",
    "evaluate": "figures, diagnosis",
    "report": "summary.json, report.html",
    "rest": "arguments, checks",
}
PYTHON = "Python: its start and end, its standard library"  # in the file; a page has less room


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


def runs(file: Path, times: int) -> list[dict[str, float]]:
    """Seconds of every part of ``feedsim run`` by run, medians of `times` processes that make it RUNS times each."""
    told: list[list[dict[str, float]]] = []
    for i in range(times):
        progress(f"parts of {file.name} {i + 1} of {times}")
        with TemporaryDirectory(prefix="feedsim-bench-") as folder:
            one = watched(["run", str(file), "--quiet", "--out", f"{folder}/out"], RUNS)
        one.parts[0][PYTHON] = one.whole - sum(sum(run.values()) for run in one.parts)
        told.append(one.parts)
    progress("")
    return [{part: median(each[i].get(part, 0.0) for each in told) for part in told[0][i]} for i in range(RUNS)]


def parts_table(title: str, found: list[dict[str, float]]) -> str:
    named = {PYTHON: "Python"} | {part: f"{part}: {what}" for part, what in PARTS.items()}
    ends = found[:: max(len(found) - 1, 1)]
    rows: list[list[object]] = [
        [name, *(digits(1e3 * run[part]) + " ms" if part in run else "" for run in ends)]
        for part, name in named.items()
    ]
    rows.append(["**all**", *(f"**{digits(1e3 * sum(run.values()))} ms**" for run in ends)])
    return table([title, *("first run", f"run {len(found)}")[: len(ends)]], rows)


COMMANDS = {
    "python": ("an empty Python program", ["-c", ""]),
    "import": ("`import feedsim`", ["-c", "import feedsim"]),
    "version": ("`feedsim --version`", [*FEEDSIM, "--version"]),
    "help": ("`feedsim --help`", [*FEEDSIM, "--help"]),
    "validate": ("`feedsim check scenarios/xz_circle.yaml`", [*FEEDSIM, "check", str(CIRCLE)]),
    "run": ("`feedsim run scenarios/xz_circle.yaml`", [*FEEDSIM, "run", str(CIRCLE), "--quiet", "--out"]),
    "drawn": (
        "the same with `--figures png,svg`",
        [*FEEDSIM, "run", str(CIRCLE), "--quiet", "--figures", "png,svg", "--out"],
    ),
    "frf": (
        "`feedsim frf scenarios/xz_circle.yaml --no-measure`",
        [*FEEDSIM, "frf", str(CIRCLE), "--no-measure", "--quiet", "--out"],
    ),
}
SHOWN_SHORT = ("python", "import", "version", "short")
WRITING = ("run", "drawn", "frf")  # which take a folder for what they write
FILES = {"circle": "X-Z circle", "short": "move of 1 mm"}  # whose parts are told


def main(words: Sequence[str] | None = None) -> int:
    bench = arguments("startup", __doc__, words, rounds=7, only=(*COMMANDS, *FILES))
    results: dict[str, object] = {}
    tables: list[str] = []
    chosen = [each for each in bench.only if not bench.short or each in SHOWN_SHORT]
    with TemporaryDirectory(prefix="feedsim-bench-") as folder:
        short = Path(folder) / "short.yaml"
        short.write_text(SHORT, encoding="utf-8")
        contestants = [
            Contestant(name, waited([sys.executable, *words, *([f"{folder}/{each}"] if each in WRITING else [])]))
            for each, (name, words) in COMMANDS.items()
            if each in chosen
        ]
        if contestants:
            costs = measure(contestants, bench.rounds, title="start-up")
            results["commands"] = costs.as_json()
            rows = [
                [name, f"{digits(costs.median(name))} s", f"{digits(costs.shortest(name))} s"] for name in costs.costs
            ]
            tables.append(table(["command", "median", "shortest"], rows))
        for each, file in zip(FILES, (CIRCLE, short), strict=True):
            if each in chosen:
                found = runs(file, min(bench.rounds, PROCESSES))
                results[FILES[each]] = found
                tables.append(parts_table(FILES[each], found))
    bench.tell("\n\n".join(tables), results)
    return 0


if __name__ == "__main__":
    sys.exit(main())
