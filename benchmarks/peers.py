"""The three-axis circle in this project's master and in other simulators: what a 125 us control cycle costs in each.

What is not installed is left out, with the reason; the native loop always takes part. All get the same SSP file and
step. What a contestant computes is checked first: figures of wrong results are refused. Only the stepping is timed,
once in a process of each contestant's own (``peers_contestants.py``), and the other simulators record as little as
they can.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from harness import CIRCLE, ONE_WAY, ROOT, SHORT_CIRCLE, Contestant, Costs, arguments, digits, measure, progress, table

import numpy as np
from peers_contestants import AXES, STEP, Outcome

from feedsim import scenario
from feedsim.simulation import nc, ssp

REFERENCE = ROOT / "tests" / "reference" / "system" / "xz_circle_ref.csv"
ROUNDS = 5
TIMEOUT = 300.0  # s, a process; the slowest takes 12 s on an idle machine

# x_a [m]. The same bits, or for tools that count time otherwise the rounding that tests/importers allow as well.
SAME, ROUNDED = 0.0, 1e-14
# FMPy's first step has zeros on every input, drives are released a cycle late: 4e-13 on a motion that begins at once,
# 3e-15 on the circle. A lag or another order makes more than 1e-7 (tests/importers).
LATE = 1e-12
PINNED = 1e-9  # of the default scheme and of SciPy against the pinned reference


@dataclass(frozen=True)
class Entry:
    """A row of the table.

    Attributes:
        key: its name in peers_contestants.py. watched: the one there that tells the whole movement, if not this one.
        steps: its order of stepping. records: what it keeps of the motion while it is timed.
        like: key of the contestant whose x_a it must have, within `within` [m]; "reference": the pinned one.
        units: how many it steps: those of the SSP file are one more, which plays the setpoints.
        rounds: as in harness.Contestant.
        asked: how many times as long as the native loop it should take at least; the floor: its inverse at most.
    """

    key: str
    label: str
    steps: str
    records: str
    like: str
    within: float
    units: str = "8, setpoint.fmu among them"
    rounds: int | None = None
    asked: float | None = None
    watched: str = ""


RECORDED, UNITS = "60 signals every 1 ms", "7"  # of ours
OTHERS = "nothing"
ENTRIES = (
    Entry("native", "native loop", "default scheme", RECORDED, "reference", PINNED, UNITS),
    Entry("floor", "floor: no FMI", "default scheme", RECORDED, "native", SAME, "7, linked together", asked=1.25),
    Entry("python", "Python loop", "default scheme", RECORDED, "native", SAME, UNITS, rounds=2),
    Entry("native-parallel", "native loop", "parallel", RECORDED, "", SAME, UNITS),
    Entry("ecos", "ecos", "parallel", OTHERS, "native-parallel", ROUNDED, asked=3, watched="ecos-watched"),
    Entry("ecos-one-core", "ecos, on one core", "parallel", OTHERS, "native-parallel", ROUNDED, asked=3),
    Entry(
        "libcosim", "libcosim", "parallel", OTHERS, "native-parallel", ROUNDED, asked=20, watched="libcosim-watched"
    ),
    Entry("libcosim-one-core", "libcosim, on one core", "parallel", OTHERS, "native-parallel", ROUNDED, asked=20),
    Entry(
        "fmpy", "FMPy's SSP runner", "parallel", "all connectors every cycle (always)", "native-parallel", LATE,
        rounds=2, asked=50,
    ),
    Entry(
        "solve_ivp", "SciPy's solve_ivp", "one system", "x_a every 2 ms", "reference", PINNED,
        "none, no controllers", rounds=1,
    ),
)  # fmt: skip
NATIVE = "native"


@dataclass
class Bench:
    """Runs contestants in processes of their own and keeps what they tell.

    Attributes:
        told: key -> what its last process left. left_out: key -> why.
    """

    file: Path
    overrides: tuple[str, ...]
    cycles: int
    folder: Path
    told: dict[str, Outcome] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)

    def run(self, key: str) -> Outcome | None:
        """One process; None, and a reason in `left_out`, where it fails."""
        out = self.folder / "outcome.json"
        command = [
            sys.executable, str(ROOT / "benchmarks" / "peers_contestants.py"), key, "--ssp", str(self.file),
            "--scenario", str(CIRCLE), "--cycles", str(self.cycles), "--out", str(out),
            *(part for each in self.overrides for part in ("--set", each)),
        ]  # fmt: skip
        out.unlink(missing_ok=True)
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, cwd=self.folder)
        except subprocess.TimeoutExpired:
            self.left_out[key] = f"not done within {TIMEOUT:.0f} s"
            return None
        if done.returncode != 0 or not out.is_file():
            lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
            self.left_out[key] = lines[-1] if lines else f"exit code {done.returncode}"
            return None
        told = Outcome(**json.loads(out.read_text(encoding="utf-8")))
        self.told[key] = told
        return told

    def cost(self, entry: Entry) -> float | None:
        """Microseconds per cycle; None where it fails."""
        told = self.run(entry.key)
        return None if told is None else 1e6 * told.seconds / told.cycles


# --- what is computed ------------------------------------------------------------------------------------------------


def _difference(a: Outcome, b: Outcome) -> float:
    """Largest difference of x_a of any axis [m] at the instants that both tell."""
    at = {instant: i for i, instant in enumerate(b.instants)}
    common = [(i, at[instant]) for i, instant in enumerate(a.instants) if instant in at]
    if not common:
        raise SystemExit("peers: no instant in common")
    return max(abs(a.x_a[name][i] - b.x_a[name][j]) for name in AXES for i, j in common)


def _pinned() -> Outcome:
    """The scenario's pinned reference as a contestant would tell it."""
    with REFERENCE.open(encoding="ascii") as stream:
        names = [name.strip('"') for name in stream.readline().strip().split(",")]
        columns = dict(zip(names, np.loadtxt(stream, delimiter=",").T, strict=True))
    instants = np.rint(columns["time"] / STEP).astype(int).tolist()
    return Outcome(0.0, 0, instants, {name: columns[f"{name}.x_a"].tolist() for name in AXES})


def check(bench: Bench, entries: Sequence[Entry], known: Mapping[str, Outcome]) -> dict[str, float]:
    """Run each contestant once; how far x_a [m] is from what it must be. Ends the program where that is too far."""
    differs: dict[str, float] = {}
    expected = dict(known)
    for entry in entries:
        progress(f"checking {entry.label}")
        told = bench.run(entry.key)
        movement = bench.run(entry.watched) if told is not None and entry.watched else told
        if told is None or movement is None:
            bench.left_out.setdefault(entry.key, bench.left_out.get(entry.watched, ""))
            continue
        expected[entry.key] = told
        if entry.like in expected:
            found = max(_difference(movement, expected[entry.like]), _difference(told, expected[entry.like]))
            differs[entry.key] = found
            if not found <= entry.within:
                raise SystemExit(f"peers: {entry.label}: x_a is {found:g} m off, {entry.within:g} m are allowed")
    progress("")
    return differs


# --- what is told ----------------------------------------------------------------------------------------------------


def _times(costs: Costs, entry: Entry) -> float:
    """How many times as long as the native loop, by pairs."""
    return costs.ratio(entry.key, NATIVE)


def _verdict(costs: Costs, entry: Entry) -> tuple[str, str]:
    if entry.asked is None or entry.key not in costs.costs:
        return "", ""
    if entry.key == "floor":
        reached = costs.ratio(NATIVE, "floor")
        word = "yes" if reached <= entry.asked else "within 1.5" if reached <= 1.5 else "no"
        return f"native <= {entry.asked:g} x floor", f"{digits(reached)}: {word}"
    reached = _times(costs, entry)
    return f">= {entry.asked:g} x native", f"{digits(reached)}: {'yes' if reached >= entry.asked else 'no'}"


def _of(costs: Costs, entry: Entry, baseline: str) -> str:
    return costs.ratio_text(entry.key, baseline) if baseline in costs.costs else ""


def told(bench: Bench, entries: Sequence[Entry], costs: Costs, differs: Mapping[str, float]) -> str:
    """The tables in markdown."""
    rows: list[list[str]] = []
    for entry in entries:
        if entry.key not in costs.costs:
            continue
        asked, reached = _verdict(costs, entry)
        rows.append([
            entry.label, entry.steps,
            f"{digits(costs.median(entry.key))} us", f"{digits(costs.shortest(entry.key))} us",
            _of(costs, entry, NATIVE), _of(costs, entry, "native-parallel"), asked, reached,
        ])  # fmt: skip
    header = ["the circle, per 125 us cycle", "steps", "median", "shortest", "of native (quartiles)"]
    lines = [table([*header, "of native, parallel (quartiles)", "asked", "reached"], rows), ""]
    how = ["", "steps", "units", "cycles", "records", "x_a at the most"]
    lines += [table(how, _how(bench, costs, entries, differs)), ""]
    if "solve_ivp" in costs.costs:
        details = bench.told["solve_ivp"].details or {}
        tried = ", ".join(
            f"{name} {digits(each['us'])} us at {digits(1e9 * each['error m'])} nm"
            for name, each in details["tried"].items()
        )
        lines += [
            f"solve_ivp: {details['solver']}, the fastest below 1 nm; without the controllers. Tried: {tried}.",
            "",
        ]
    lines += [
        f"Left out: {entry.label}, {bench.left_out[entry.key]}." for entry in entries if entry.key in bench.left_out
    ]
    return "\n".join(lines).strip()


def _how(bench: Bench, costs: Costs, entries: Sequence[Entry], differs: Mapping[str, float]) -> list[list[str]]:
    """Rows: how each was run and how it was found right."""
    named = {"reference": "the pinned reference", "native-parallel": "our `parallel`", NATIVE: "the native loop"}
    rows = []
    for entry in entries:
        if entry.key in costs.costs:
            off = differs.get(entry.key)
            shown = "" if off is None else "same bits as" if off == 0.0 else f"{digits(1e9 * off)} nm from"
            cycles, right = str(bench.told[entry.key].cycles), f"{shown} {named[entry.like]}" if shown else ""
            rows.append([entry.label, entry.steps, entry.units, cycles, entry.records, right])
    return rows


def _options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--set", dest="overrides", action="append", default=[], help="KEY=VALUE, as in feedsim run")


def main(given: Sequence[str] | None = None) -> int:
    options = arguments("peers", __doc__, given, rounds=ROUNDS, only=[entry.key for entry in ENTRIES], more=_options)
    overrides = [*options.given.overrides, *(SHORT_CIRCLE if options.short else ())]
    loaded = scenario.load(CIRCLE, [ONE_WAY, *overrides])
    cycles = round(float(nc.plan(loaded).time[-1]) / STEP)
    wanted = [entry for entry in ENTRIES if entry.key in (*options.only, NATIVE, "native-parallel")]
    if overrides:  # the reference is of the circle as it is
        wanted = [entry for entry in wanted if entry.key != "solve_ivp"]
    with tempfile.TemporaryDirectory(prefix="feedsim-bench-") as name:
        file = Path(name) / "circle.ssp"
        ssp.export(loaded, file)
        bench = Bench(file, (ONE_WAY, *overrides), cycles, Path(name))
        differs = check(bench, wanted, {} if overrides else {"reference": _pinned()})
        running = [entry for entry in wanted if entry.key not in bench.left_out]
        contestants = [
            Contestant(entry.key, lambda entry=entry: bench.cost(entry), entry.rounds)  # type: ignore[misc]
            for entry in running
        ]
        costs = measure(contestants, options.rounds, title="circle, round")
    results = {
        "cycles": cycles,
        "us per cycle": costs.as_json(NATIVE if NATIVE in costs.costs else None),
        "x_a differs m": differs,
        "left out": bench.left_out,
        "solve_ivp": bench.told["solve_ivp"].details if "solve_ivp" in bench.told else None,
    }
    options.tell(told(bench, wanted, costs, differs), results)
    return 0


if __name__ == "__main__":
    sys.exit(main())
