"""How time and memory grow with the simulated duration: whole `feedsim run`s of a circle, each in a process of its own.

The circle of 7.5 mm radius at 3000 mm/min on the default machine (synthetic) is driven as often as the duration takes,
one turn is evaluated. Peak memory is the process's resident set with the pages of its files; anonymous memory, which
no file backs, is looked at while the run reports its progress, and when it has ended. With ``--images DIR`` the plot
goes there; ``--hour`` runs an hour, too, which takes minutes and writes gigabytes.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from drawings import Curve, Panel, slope, write_svg
from harness import RESULTS, described, digits, progress, table, write_json

ROOT = Path(__file__).resolve().parents[1]
SCENARIO = ROOT / "scenarios" / "xz_circle.yaml"
TURN = 0.9425  # s
SIX = "[X.x_a, Z.x_a, X.x_e, Z.x_e, X.M_fr, Z.M_fr]"
DURATIONS = (1, 10, 60, 600)
HOUR = 3600
# Slopes belong to the part where what grows outweighs what stays.
FITTED_FROM = 10
PARTS = ("plan", "loop", "whole")


@dataclass(frozen=True)
class Case:
    """What is recorded; `most`: longest duration [s] that is measured without ``--hour``."""

    name: str
    interval: str
    variables: str | None
    most: float


CASES = (
    Case("every 10 ms, 6 variables", "10 ms", SIX, 600),
    Case("every 1 ms, 6 variables", "1 ms", SIX, 600),
    Case("every 1 ms, all 66", "1 ms", None, 60),
    Case("every cycle, 6 variables", "125 us", SIX, 60),
)


def settings(case: Case, turns: int) -> list[str]:
    motion = f"{{kind: circle, plane: [X, Z], radius: 7.5 mm, feed: 3000 mm/min, turns: {turns}}}"
    variables = [] if case.variables is None else [f"recording.variables={case.variables}"]
    return [
        f"motions=[{motion}, {{kind: dwell, duration: 50 ms}}]", "evaluate=[{kind: circle}]",
        f"recording.interval={case.interval}", *variables,
    ]  # fmt: skip


def anonymous() -> float:
    """Memory of this process that no file backs, as it is now [MB]; 0 where the system does not tell."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return 0.0
    return next((float(line.split()[1]) / 1024 for line in lines if line.startswith("RssAnon")), 0.0)


def one(case: Case, turns: int, folder: Path) -> dict[str, float]:
    """A run as the command makes it, in this process: times [s], memory [MB], size of its result [MB]."""
    begun = time.perf_counter()
    from feedsim import analysis, cosim, nc, report, scenario

    loaded = scenario.load(SCENARIO, settings(case, turns))
    planning = time.perf_counter()
    program = nc.plan(loaded, scratch=folder)
    planned = time.perf_counter() - planning
    highest = 0.0

    def look(done: int, total: int) -> None:
        nonlocal highest
        if done % (64 * 2048) == 0 or done == total:
            highest = max(highest, anonymous())

    with report.growing(folder / "out") as recorded:
        run = cosim.run(loaded, program=program, progress=look, scratch=folder, sink=recorded)
        report.write(run, analysis.evaluate(run), folder / "out", recorded)
    return {
        "simulated": program.duration,
        "plan": planned,
        "loop": run.wall_time,
        "whole": time.perf_counter() - begun,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "anonymous": max(highest, anonymous()),
        "result": (folder / "out" / "result.csv").stat().st_size / 1e6,
        "rows": len(run.trace),
    }


def measured(case: Case, duration: float) -> dict[str, float]:
    """The same in a process of its own."""
    with TemporaryDirectory() as folder:
        words = [
            sys.executable, __file__, "--one", str(CASES.index(case)), str(max(1, round(duration / TURN))), folder,
        ]  # fmt: skip
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{case.name}, {duration} s: {done.stderr}")
    found: dict[str, float] = json.loads(done.stdout)
    return found


Found = dict[Case, dict[float, dict[str, float]]]


def rows(found: Found) -> list[list[str]]:
    return [
        [
            case.name,
            f"{duration:g} s",
            *(f"{digits(each[part])} s" for part in PARTS),
            f"{digits(1e3 * each['loop'] / each['simulated'])} ms",
            f"{digits(each['memory'])} MB",
            f"{digits(each['anonymous'])} MB",
            f"{digits(each['result'])} MB",
        ]
        for case, durations in found.items()
        for duration, each in durations.items()
    ]


def slopes(found: Found) -> dict[str, dict[str, float]]:
    """Exponents of growth with the duration, from FITTED_FROM on."""
    fitted: dict[str, dict[str, float]] = {}
    for case, durations in found.items():
        kept = {duration: each for duration, each in durations.items() if duration >= FITTED_FROM}
        x = [each["simulated"] for each in kept.values()]
        quantities = (*PARTS, "memory", "anonymous")
        fitted[case.name] = {what: slope(x, [each[what] for each in kept.values()]) for what in quantities}
    return fitted


def plot(found: Found, images: Path) -> Path:
    exponents = slopes(found)

    def curves(what: str) -> list[Curve]:
        return [
            Curve(
                f"{case.name}: slope {exponents[case.name][what]:.2f}",
                [each["simulated"] for each in durations.values()],
                [each[what] for each in durations.values()],
            )
            for case, durations in found.items()
        ]

    panels = [
        Panel("whole run, start of the process to files", "simulated [s]", "time [s]", curves("whole")),
        Panel("peak resident memory", "simulated [s]", "memory [MB]", curves("memory")),
    ]
    return write_svg("growth-duration", panels, images)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hour", action="store_true", help="measure an hour, and what takes long, too")
    parser.add_argument("--images", type=Path, default=RESULTS, metavar="DIR", help="folder of the plot")
    parser.add_argument("--one", nargs=3, metavar=("CASE", "TURNS", "FOLDER"), help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.one:
        case, turns, folder = options.one
        print(json.dumps(one(CASES[int(case)], int(turns), Path(folder))))
        return 0
    durations: tuple[float, ...] = (*DURATIONS, HOUR) if options.hour else DURATIONS
    found: Found = {case: {} for case in CASES}
    for case in CASES:
        for duration in durations:
            if options.hour or duration <= case.most:
                progress(f"{case.name}: {duration:g} s")
                found[case][duration] = measured(case, duration)
    header = [
        "recorded",
        "simulated",
        *PARTS,
        "loop per simulated second",
        "peak memory",
        "... anonymous",
        "result.csv",
    ]
    print(f"{described()}\n\n{table(header, rows(found))}\n")
    exponents = slopes(found)
    for name, each in exponents.items():
        print(f"slopes from {FITTED_FROM} s on, {name}: " + ", ".join(f"{k} {v:.2f}" for k, v in each.items()))
    print(f"{plot(found, options.images)} written", file=sys.stderr)
    results: dict[str, Any] = {
        "runs": {case.name: {f"{d:g} s": each for d, each in durations.items()} for case, durations in found.items()},
        "slopes": exponents,
    }
    write_json("duration", results)
    return 0


if __name__ == "__main__":
    sys.exit(main())
