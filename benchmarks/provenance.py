"""What figures of a benchmark depend on: machine, what else ran on it, versions, sources, binaries, settings.

Nothing here is needed to measure; all of it to know later what was measured.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

import psutil

from feedsim_packager import compile, toolchain

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("feedsim", "numpy", "scipy", "fmpy", "ecospy", "libcosimpy", "distributed", "pyarrow", "matplotlib")
SETTINGS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "FEEDSIM_FMUS", "FEEDSIM_CFLAGS", "CC")
QUIET = 0.3  # cores taken by others, of each one there is; above it a machine counts as busy
LOOK = 1.0  # s


@dataclass
class Load:
    """What others take of the machine's cores: over a second before the start, and from then on.

    Times of all programs less those of this one and its children, so that a benchmark's own work does not count, nor
    that of the benchmark before it, as it does in the load average.
    """

    before: float = field(init=False)
    average: float | None = field(init=False)  # load average over the last minute, before the start

    def __post_init__(self) -> None:
        self.average = round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None
        self.before = psutil.cpu_percent(LOOK) / 100 * (os.cpu_count() or 1)
        self._begun = self._now()

    def _now(self) -> tuple[float, float, float]:
        """Time, processor time of all, processor time of this process and its ended children [s]."""
        everybody = psutil.cpu_times()
        idle = everybody.idle + getattr(everybody, "iowait", 0.0)
        double = getattr(everybody, "guest", 0.0) + getattr(everybody, "guest_nice", 0.0)  # in user and nice already
        mine = os.times()
        own = mine.user + mine.system + mine.children_user + mine.children_system
        return mine.elapsed, sum(everybody) - idle - double, own

    def elapsed(self) -> float:
        """Since the start [s]."""
        return self._now()[0] - self._begun[0]

    def during(self) -> float:
        """Cores that others have taken on average since the start."""
        elapsed, everybody, own = (now - begun for now, begun in zip(self._now(), self._begun, strict=True))
        return max(0.0, everybody - own) / max(elapsed, 1e-3)

    def told(self) -> str:
        """A sentence where others took so much that times are not to be trusted; else empty."""
        cores, during = os.cpu_count() or 1, self.during()
        if max(self.before, during) <= QUIET * cores:
            return ""
        return (
            f"**Busy machine**: other programs took {self.before:.1f} of {cores} cores before the start and"
            f" {during:.1f} since; times are too long, ratios less so."
        )

    def as_json(self) -> dict[str, object]:
        return {
            "cores taken by others before": round(self.before, 2),
            "cores taken by others during": round(self.during(), 2),
            "load average before": self.average,
            "busy": bool(self.told()),
        }


def machine() -> dict[str, object]:
    """Processor, cores, memory [GB], operating system."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory GB": round(psutil.virtual_memory().total / 1e9, 1),
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


def _told(command: Sequence[str]) -> str:
    """First line of what a command prints; empty where it cannot run or fails."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=30, cwd=ROOT)
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


def sources() -> dict[str, object] | None:
    """Commit of the working tree and whether files under version control differ from it; None without git."""
    commit = _told(["git", "rev-parse", "HEAD"])
    if not commit:
        return None
    return {"commit": commit, "changed": bool(_told(["git", "status", "--porcelain", "--untracked-files=no"]))}


def flags() -> list[str] | None:
    """What the packager would compile units of this machine with now; None without a compiler."""
    try:
        compiler = toolchain.find_compiler()
        whole = toolchain.whole_program(compiler, compile.host_target().suffix)
    except toolchain.CompilerError:
        return None
    return [*compile.FLAGS, *whole, *shlex.split(os.environ.get(compile.EXTRA_FLAGS, ""))]


def binaries() -> dict[str, str]:
    """SHA-256 of the archives and of the native loop that runs use, by file name."""
    folder = Path(os.environ.get("FEEDSIM_FMUS", ROOT / "fmus"))
    found = sorted([*folder.glob("*.fmu"), *folder.glob("exchange.*")])
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in found if path.is_file()}


def command() -> str:
    """The command line of this process, from the folder of the repository."""
    script = Path(sys.argv[0]).resolve()
    shown = script.relative_to(ROOT).as_posix() if script.is_relative_to(ROOT) else script.name
    python = Path(sys.executable)  # a link in an environment: not resolved
    started = python.relative_to(ROOT).as_posix() if python.is_relative_to(ROOT) else "python"
    given = [
        Path(word).relative_to(ROOT).as_posix() if Path(word).is_relative_to(ROOT) else word for word in sys.argv[1:]
    ]
    return shlex.join([started, shown, *given])


def described() -> str:
    """Machine, versions, sources, date and command in one sentence, to stand above a table."""
    here, used, tree = machine(), versions(), sources()
    packages = ", ".join(f"{name} {version}" for name, version in used.items() if name not in ("compiler", "feedsim"))
    commit = "" if tree is None else f" ({str(tree['commit'])[:7]}{' with changes' if tree['changed'] else ''})"
    return (
        f"feedsim {used.get('feedsim', '?')}{commit}, {here['system']}, {here['processor']}, {here['cores']} cores,"
        f" {here['memory GB']} GB; {packages}; {used['compiler']}; {datetime.now(UTC):%Y-%m-%d}; `{command()}`."
    )
