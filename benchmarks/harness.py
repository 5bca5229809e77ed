"""What all benchmarks share: contestants that take turns, paired ratios, markdown tables, a JSON file per benchmark.

Machines are noisy, and what another program does to one differs from minute to minute. Contestants therefore take turns
(A B C A B C), and a ratio is the median of the ratios within the rounds: neighbours in time.
``build/bench/<name>.json`` keeps the figures with all that they depend on.
"""

from __future__ import annotations

import json
import os
import platform
import shlex
import statistics
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

from feedsim_packager import toolchain

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "build" / "bench"
PACKAGES = ("feedsim", "numpy", "scipy", "fmpy", "ecospy", "libcosimpy", "distributed", "pyarrow", "matplotlib")
SETTINGS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "FEEDSIM_FMUS", "CC")


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

    def as_json(self, baseline: str | None = None) -> dict[str, object]:
        """Per contestant: all costs, median, shortest, and ratio to `baseline`."""
        return {
            name: {"values": self.values(name), "median": self.median(name), "shortest": self.shortest(name)}
            | ({} if baseline is None else {f"of {baseline}": self.ratio(name, baseline)})
            for name in self.costs
        }


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


def machine() -> dict[str, object]:
    """Processor, cores, memory [GB], operating system."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory GB": _memory(),
        "system": platform.platform(),
        "architecture": platform.machine(),
    }


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines():
            key, _, value = line.partition(":")
            if key.strip() == "model name":
                return value.strip()
    if sys.platform == "darwin":
        return _told(["sysctl", "-n", "machdep.cpu.brand_string"]) or platform.processor()
    return platform.processor() or platform.machine()


def _memory() -> float | None:
    try:
        return round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1)
    except (AttributeError, OSError, ValueError):  # not on Windows
        return None


def _told(command: Sequence[str]) -> str:
    """First line of what a command prints; empty where it cannot run."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=30)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return next(iter(done.stdout.splitlines()), "").strip() if done.returncode == 0 else ""


def versions() -> dict[str, str]:
    """Python, compiler, and the packages of PACKAGES that are installed."""
    found = {"Python": platform.python_version()}
    try:
        found["compiler"] = _told([*toolchain.find_compiler(), "--version"]) or "unknown"
    except toolchain.CompilerError:
        found["compiler"] = "none"
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found


def command() -> str:
    """The command line of this process, from the folder of the repository."""
    script = Path(sys.argv[0]).resolve()
    shown = script.relative_to(ROOT).as_posix() if script.is_relative_to(ROOT) else script.name
    return shlex.join(["python", shown, *sys.argv[1:]])


def described() -> str:
    """Machine, versions, date and command in one sentence, to stand above a table."""
    here, used = machine(), versions()
    packages = ", ".join(f"{name} {version}" for name, version in used.items() if name not in ("compiler", "feedsim"))
    return (
        f"feedsim {used.get('feedsim', '?')}, {here['system']}, {here['processor']}, {here['cores']} cores,"
        f" {here['memory GB']} GB; {packages}; {used['compiler']}; {datetime.now(UTC):%Y-%m-%d}; `{command()}`."
    )


def write_json(name: str, results: Mapping[str, object], directory: Path = RESULTS) -> Path:
    """Write `<name>.json` with `results` (Python's own types) and what they depend on; return its path."""
    content = {
        "benchmark": name,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": command(),
        "machine": machine() | {"load": _load()},
        "versions": versions(),
        "environment": {key: os.environ[key] for key in SETTINGS if key in os.environ},
        "results": dict(results),
    }
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / f"{name}.json"
    fresh = path.with_suffix(".json.part")
    fresh.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    fresh.replace(path)
    return path


def _load() -> list[float] | None:
    """Programs that wanted a core over the last 1, 5 and 15 minutes: tells a busy machine."""
    try:
        return [round(value, 2) for value in os.getloadavg()]
    except (AttributeError, OSError):
        return None
