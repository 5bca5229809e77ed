"""What all benchmarks share: their options, contestants that take turns, paired ratios, tables.

Machines are noisy, and what another program does to one differs from minute to minute. Contestants therefore take turns
(A B C A B C), and a ratio is the median of the ratios within the rounds: neighbours in time.
``build/bench/<name>.md`` keeps the tables, ``<name>.json`` the figures with all that they depend on
(``provenance.py``).
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import provenance
from provenance import ROOT, SETTINGS, Load, command, described, machine, versions

# Small matrices: threads for linear algebra only wait for one another. The Makefile does the same. Before numpy is
# loaded, hence this module ahead of all others (pyproject.toml has ruff sort imports so).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# As users' Python does, processes keep byte code: without, each compiles all modules of the package.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

__all__ = [
    "CIRCLE",
    "ONE_WAY",
    "RESULTS",
    "ROOT",
    "SETTINGS",
    "SHORT_CIRCLE",
    "Benchmark",
    "Contestant",
    "Costs",
    "Load",
    "arguments",
    "command",
    "described",
    "digits",
    "machine",
    "measure",
    "progress",
    "table",
    "versions",
    "write_json",
    "write_text",
]  # fmt: skip
RESULTS = ROOT / "build" / "bench"

# What most contestants run, in one direction: the pinned reference is of that.
CIRCLE = ROOT / "scenarios" / "xz_circle.yaml"
ONE_WAY = "motions.0.direction=counterclockwise"
# The same in some milliseconds, for --short.
SHORT_CIRCLE = (
    "motions=[{kind: circle, plane: [X, Z], radius: 50 um, feed: 3 m/min, turns: 1}, {kind: dwell, duration: 9 ms}]",
    "evaluate=[]",
)


# --- options ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Benchmark:
    """A benchmark as its command line wants it.

    Attributes:
        name: of its files. rounds: how often contestants run. only: the cases that are wanted, in their usual order.
        short: to show in seconds that it works, on cases a fraction as long; the figures say nothing.
        folder: of <name>.md and <name>.json. images: folder of its plots.
        given: all options, those of its own among them. load: of the machine, looked at before the start.
    """

    name: str
    rounds: int
    short: bool
    only: tuple[str, ...]
    folder: Path
    images: Path
    given: argparse.Namespace
    load: Load

    @property
    def circle(self) -> tuple[str, ...]:
        """Changes of the scenario CIRCLE."""
        return SHORT_CIRCLE if self.short else (ONE_WAY,)

    def tell(self, text: str, results: Mapping[str, object], quoted: Mapping[str, str] | None = None) -> None:
        """Print `text` under what it depends on; leave it and `results` (Python's own types) in files.

        quoted: figures that pages quote within sentences, by name.
        """
        lines = [described(), *filter(None, [self.load.told()]), text.strip()]
        content = "\n\n".join(lines) + "\n"
        tables = re.findall(r"^(?:\|.*\n)+", f"{text.strip()}\n", re.MULTILINE)
        write_json(
            self.name, results, self.folder, load=self.load, rounds=self.rounds, only=list(self.only),
            pages={"short": self.short, "tables": tables, "quoted": dict(quoted or {})},
        )  # fmt: skip
        write_text(self.folder / f"{self.name}.md", content)
        print(content, end="", flush=True)


def arguments(
    name: str,
    about: str | None,
    given: Sequence[str] | None = None,
    *,
    rounds: int = 0,
    only: Sequence[str] = (),
    images: bool = False,
    more: Callable[[argparse.ArgumentParser], object] | None = None,
) -> Benchmark:
    """Read the command line of benchmark `name`, and look at the machine's load.

    Args:
        about: its docstring, shown by --help. given: words of the command line; None: this process's.
        rounds: how often contestants run unless --rounds says so; 0: it has no such option.
        only: cases that --only may choose from; all of them unless it is given. images: whether it draws plots.
        more: adds options of its own; found in `given` of what is returned.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    if rounds:
        parser.add_argument("--rounds", type=_count, metavar="N", help=f"how often each runs: {rounds}; 1 with --short")
    parser.add_argument("--short", action="store_true", help="seconds, to see that it works; no figures to quote")
    if only:
        parser.add_argument("--only", nargs="+", choices=only, default=list(only), metavar="CASE", help=", ".join(only))
    folder = RESULTS.relative_to(ROOT)
    parser.add_argument(
        "--json", type=Path, default=RESULTS, metavar="DIR", help=f"folder of {name}.json and {name}.md: {folder}"
    )
    if images:
        parser.add_argument("--images", type=Path, default=RESULTS, metavar="DIR", help=f"folder of plots: {folder}")
    if more is not None:
        more(parser)
    options = parser.parse_args(given)
    wanted = tuple(case for case in only if case in options.only)
    if rounds:
        rounds = options.rounds or (1 if options.short else rounds)
    images_folder = getattr(options, "images", RESULTS)
    return Benchmark(name, rounds, options.short, wanted, options.json, images_folder, options, Load())


def _count(text: str) -> int:
    if (value := int(text)) < 1:
        raise argparse.ArgumentTypeError(f"{text}: once at least")
    return value


# --- measuring -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Contestant:
    """Something to be measured.

    Attributes:
        run: measures itself once and returns the cost: seconds, or microseconds per cycle, the same unit for all; None
            where it could not this time.
        rounds: takes part in that many rounds, spread evenly; None: in all of them. For those that take long.
    """

    name: str
    run: Callable[[], float | None]
    rounds: int | None = None


@dataclass
class Costs:
    """Costs of every contestant by round; a round in which it has not run is missing, and one that never has, too."""

    costs: dict[str, dict[int, float]] = field(default_factory=dict)

    def values(self, name: str) -> list[float]:
        return list(self.costs[name].values())

    def median(self, name: str) -> float:
        return statistics.median(self.values(name))

    def shortest(self, name: str) -> float:
        return min(self.values(name))

    def ratios(self, name: str, baseline: str) -> list[float]:
        """Ratios within the rounds in which both have run."""
        mine, its = self.costs[name], self.costs[baseline]
        return [mine[i] / its[i] for i in mine if i in its]

    def ratio(self, name: str, baseline: str) -> float:
        """Median of the ratios within the rounds."""
        return statistics.median(self.ratios(name, baseline))

    def quartiles(self, name: str, baseline: str) -> tuple[float, float]:
        """First and third quartile of the ratios within the rounds: how far they scatter."""
        first, _, third = quartiles(self.ratios(name, baseline))
        return first, third

    def ratio_text(self, name: str, baseline: str) -> str:
        """The ratio for a table, with its quartiles where there is more than one round: "1.55 (1.52-1.61)"."""
        if not self.ratios(name, baseline):
            return ""
        shown = digits(self.ratio(name, baseline))
        if name == baseline or len(self.ratios(name, baseline)) < 2:
            return shown
        return f"{shown} ({'-'.join(digits(value) for value in self.quartiles(name, baseline))})"

    def as_json(self, baseline: str | None = None) -> dict[str, object]:
        """Per contestant: all costs, median, shortest, and ratio to `baseline` with its quartiles."""
        told: dict[str, object] = {}
        for name in self.costs:
            one = {"values": self.values(name), "median": self.median(name), "shortest": self.shortest(name)}
            if baseline is not None and self.ratios(name, baseline):
                one[f"of {baseline}"] = self.ratio(name, baseline)
                one[f"of {baseline}, quartiles"] = list(self.quartiles(name, baseline))
            told[name] = one
        return told


def quartiles(values: Sequence[float]) -> tuple[float, float, float]:
    """First quartile, median and third quartile, linear between the values, the least and the largest included."""
    if len(values) < 2:
        return values[0], values[0], values[0]
    first, second, third = statistics.quantiles(values, n=4, method="inclusive")
    return first, second, third


def measure(contestants: Sequence[Contestant], rounds: int, *, title: str = "") -> Costs:
    """Run `contestants` in turns, `rounds` times; progress goes to stderr."""
    result = Costs()
    for i in range(rounds):
        for each in contestants:
            if each.rounds is not None and not _takes_part(i, each.rounds, rounds):
                continue
            progress(f"{title or 'round'} {i + 1} of {rounds}: {each.name}")
            cost = each.run()
            if cost is not None:
                result.costs.setdefault(each.name, {})[i] = cost
    progress("")
    return result


def _takes_part(i: int, wanted: int, rounds: int) -> bool:
    """`wanted` rounds of `rounds`, evenly spread, the first one among them."""
    return wanted >= rounds or -(-i * wanted // rounds) < -(-(i + 1) * wanted // rounds)


def progress(text: str) -> None:
    """Replace the line of progress; the empty text ends it. Nothing where stderr is no terminal."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)


# --- telling ---------------------------------------------------------------------------------------------------------


def table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A markdown table. Cells: what `str` makes of them."""
    head, *body = ("| " + " | ".join(str(cell) for cell in line) + " |" for line in (header, *rows))
    return "\n".join((head, "|" + "---|" * len(header), *body))


def digits(value: float, significant: int = 3) -> str:
    """A figure with that many significant digits, without an exponent from 1e-3 to 1e5."""
    if value == 0.0 or not 1e-3 <= abs(value) < 1e5:
        return f"{value:.{significant}g}"
    rounded = float(f"{value:.{significant}g}")
    places = max(0, significant - 1 - _exponent(rounded))
    return f"{rounded:.{places}f}"


def _exponent(value: float) -> int:
    return int(f"{value:e}".partition("e")[2])


def write_json(
    name: str,
    results: Mapping[str, object],
    directory: Path = RESULTS,
    *,
    load: Load | None = None,
    rounds: int = 0,
    only: Sequence[str] = (),
    pages: Mapping[str, object] | None = None,
) -> Path:
    """Write `<name>.json` with `results` (Python's own types) and what they depend on; return its path.

    pages: tables and figures as pages show them.
    """
    content = {
        "benchmark": name,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": command(),
        "rounds": rounds or None,
        "only": list(only),
        "machine": machine(),
        "load": None if load is None else load.as_json(),
        "versions": versions(),
        "sources": provenance.sources(),
        "binaries": provenance.binaries(),
        "compiler flags": provenance.flags(),
        "environment": {key: os.environ[key] for key in SETTINGS if key in os.environ},
        "results": dict(results),
        **(pages or {}),
    }
    return write_text(directory / f"{name}.json", json.dumps(content, indent=2, allow_nan=False) + "\n")


def write_text(path: Path, content: str) -> Path:
    """Write a file whole or not at all; return its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(path.name + ".part")
    fresh.write_text(content, encoding="utf-8")
    fresh.replace(path)
    return path
