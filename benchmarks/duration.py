"""How time and memory grow with the simulated duration: whole `feedsim run`s of a circle, each in a process of its own.

The circle of 7.5 mm radius at 3000 mm/min on the default machine (synthetic) is driven as often as the duration takes,
one turn is evaluated. Time is that of whoever waits, from the start of the process to its end with all files written;
its parts are told by the process itself (watched.py). Peak memory is the process's resident set with the pages of its
files; anonymous memory is what no file backs.

An hour: --durations 4 60 600 3600 --only 10ms-6 --rounds 1.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from harness import ROOT, Contestant, arguments, digits, measure, table

from fits import Line
from watched import Watched, watched

SCENARIO = ROOT / "scenarios" / "xz_circle.yaml"
TURN = 0.9425  # s
SIX = "[X.x_a, Z.x_a, X.x_e, Z.x_e, X.M_fr, Z.M_fr]"
# What grows with the duration, and what is told of it.
PARTS = {"whole": "whole", "loop": "cycle loop", "rows": "rows into result.csv", "plan": "planning"}


@dataclass(frozen=True)
class Case:
    """What is recorded, and the durations that are measured unless others are asked for [s]."""

    name: str
    interval: str
    variables: str | None
    durations: tuple[float, ...]


CASES = {
    "10ms-6": Case("every 10 ms, 6 variables", "10 ms", SIX, (4, 60, 180)),
    "1ms-all": Case("every 1 ms, all 66", "1 ms", None, (4, 20, 60)),
    "cycle-6": Case("every cycle, 6 variables", "125 us", SIX, (4, 20, 60)),
}


@dataclass
class Point:
    """A case with a duration, and what has been measured of it."""

    case: Case
    turns: int
    runs: list[Watched] = field(default_factory=list)
    result: float = 0.0  # size of result.csv [MB]

    @classmethod
    def of(cls, case: Case, duration: float) -> Point:
        return cls(case, max(3, round(duration / TURN)))  # the middle one of three is at constant speed

    def __str__(self) -> str:
        return f"{self.case.name}, {self.turns} turns"

    @property
    def simulated(self) -> float:
        return self.turns * TURN

    def words(self, out: Path) -> list[str]:
        motion = f"{{kind: circle, plane: [X, Z], radius: 7.5 mm, feed: 3000 mm/min, turns: {self.turns}}}"
        changes = [
            f"motions=[{motion}, {{kind: dwell, duration: 50 ms}}]", "evaluate=[{kind: circle}]",
            f"recording.interval={self.case.interval}",
        ]  # fmt: skip
        changes += [] if self.case.variables is None else [f"recording.variables={self.case.variables}"]
        words = ["run", str(SCENARIO), "--quiet", "--out", str(out)]
        return words + [word for change in changes for word in ("--set", change)]

    def run(self) -> float:
        """Seconds of a whole run."""
        with TemporaryDirectory(prefix="feedsim-bench-") as folder:
            out = Path(folder) / "out"
            self.runs.append(watched(self.words(out)))
            self.result = (out / "result.csv").stat().st_size / 1e6
        return self.runs[-1].whole

    def seconds(self, part: str) -> float:
        """Median over the runs; "whole" is one of PARTS."""
        return median(run.whole if part == "whole" else run.parts[0][part] for run in self.runs)

    def memory(self, what: str) -> float | None:
        """Median over the runs [MB], of "peak" or "anonymous"; None where the system does not tell."""
        told = [found for run in self.runs if (found := getattr(run, what)) is not None]
        return median(told) if told else None


Found = Mapping[str, Sequence[Point]]


def text(found: Found) -> str:
    header = ["recorded", "simulated", *PARTS.values(), "peak memory", "... anonymous", "result.csv"]
    rows = [
        [
            point.case.name,
            f"{point.simulated:.0f} s",
            *(f"{digits(point.seconds(part))} s" for part in PARTS),
            *("" if (taken := point.memory(what)) is None else f"{taken:.0f} MB" for what in ("peak", "anonymous")),
            f"{digits(point.result)} MB",
        ]
        for points in found.values()
        for point in points
    ]
    return table(header, rows)


def lines(points: Sequence[Point]) -> dict[str, Line]:
    """Time by simulated second; empty for a single duration."""
    if len(points) < 2:
        return {}
    x = [point.simulated for point in points]
    return {part: Line.through(x, [point.seconds(part) for point in points]) for part in PARTS}


def fitted(found: Found) -> str:
    """The lines through what `text` tells."""
    header = ["recorded", "whole, T s simulated", "off by at most"]
    header += [f"{name}, per simulated second" for part, name in PARTS.items() if part != "whole"]
    rows = []
    for case, points in found.items():
        if through := lines(points):
            whole = through["whole"]
            said = f"{digits(whole.constant)} s + {digits(1e3 * whole.each)} ms x T"
            others = (f"{digits(1e3 * line.each)} ms" for part, line in through.items() if part != "whole")
            rows.append([CASES[case].name, said, f"{100 * whole.off:.0f} %", *others])
    return table(header, rows) if rows else ""


def plot(found: Found, images: Path) -> Path:
    from drawings import Curve, Panel, write_svg

    def curves(of: Callable[[Point], float | None]) -> list[Curve]:
        return [
            Curve(CASES[case].name, [point.simulated for point in points], [of(point) or 0.0 for point in points])
            for case, points in found.items()
        ]

    linear = ("linear", "linear")  # from 0: what is flat looks flat
    time, memory = curves(lambda point: point.seconds("whole")), curves(lambda point: point.memory("peak"))
    panels = [
        Panel("whole run, start of process to files", "simulated [s]", "time [s]", time, scales=linear),
        Panel("peak resident memory", "simulated [s]", "memory [MB]", memory, scales=linear),
    ]
    return write_svg("growth-duration", panels, images)


def durations(parser: argparse.ArgumentParser) -> None:
    said = "; ".join(f"{name}: {' '.join(f'{each:g}' for each in case.durations)}" for name, case in CASES.items())
    parser.add_argument(
        "--durations", type=float, nargs="+", metavar="S", help=f"simulated durations of all cases [s] ({said})"
    )


def main(words: Sequence[str] | None = None) -> int:
    bench = arguments("duration", __doc__, words, rounds=3, only=tuple(CASES), images=True, more=durations)
    wanted = bench.given.durations or ((4.0,) if bench.short else ())
    found = {
        case: [Point.of(CASES[case], duration) for duration in wanted or CASES[case].durations] for case in bench.only
    }
    contestants = [Contestant(str(point), point.run) for points in found.values() for point in points]
    measure(contestants, bench.rounds, title="duration")
    results = {
        case: {
            "runs": [
                {
                    "simulated s": point.simulated, "whole s": [run.whole for run in point.runs],
                    "parts s": [run.parts[0] for run in point.runs], "peak MB": [run.peak for run in point.runs],
                    "anonymous MB": [run.anonymous for run in point.runs], "result.csv MB": point.result,
                }
                for point in points
            ],
            "lines": {part: asdict(line) for part, line in lines(points).items()},
        }
        for case, points in found.items()
    }  # fmt: skip
    bench.tell(f"{text(found)}\n\n{fitted(found)}", results)
    print(f"{plot(found, bench.images)} written", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
