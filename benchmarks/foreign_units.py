"""What it costs that units of other makers run in a worker process: the same run there and here, in turns.

The unit is another maker's friction on one axis (tests/foreign/faulty.c, which fails at a time that no run reaches).
The cost is that of the whole run without its start: of marks, of rows that go from process to process, and of looking.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from harness import ROOT, Contestant, arguments, digits, measure, table

sys.path.insert(0, str(ROOT / "tests"))
from feedsim import scenario
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim import worker
from feedsim_packager import toolchain
from foreign import acme
from foreign.test_faulty_units import ROWS

PLAN = """
name: two units of an axis
machine: {machine}
motions:
  - {{kind: move, by: {{X: 10 mm}}, feed: 3000 mm/min}}
  - {{kind: dwell, duration: {duration} s}}
recording: {{interval: 1 ms}}
set: {{machine.axes.X.friction: {friction}}}
"""
DURATION = 100.0  # s simulated


def main(words: Sequence[str] | None = None) -> int:
    bench = arguments("foreign_units", __doc__, words, rounds=7)
    with tempfile.TemporaryDirectory() as scratch:
        plan = scenario.load(_scenario(Path(scratch), 1.0 if bench.short else DURATION))
        program = nc.plan(plan)
        cycles = round(program.duration / plan.machine.cycles.T_c)
        steps = 3 * cycles  # drive, structure, friction

        def run(watched: bool) -> float:
            before, worker.WORKERS_AVAILABLE = worker.WORKERS_AVAILABLE, watched
            try:
                rows = 0

                def sink(part: object) -> None:
                    nonlocal rows
                    rows += len(part)  # type: ignore[arg-type]

                begun = time.perf_counter()
                cosim.run(plan, program=program, sink=sink)
                return time.perf_counter() - begun
            finally:
                worker.WORKERS_AVAILABLE = before

        run(True), run(False)  # the worker is started, the libraries are loaded
        contestants = [Contestant(name, lambda w=w: run(w)) for name, w in (("watched", True), ("here", False))]
        found = measure(contestants, bench.rounds)
    watched, here = found.median("watched"), found.median("here")
    cost = (watched - here) / steps
    rows = [["in this process", digits(here)], ["watched", digits(watched)]]
    text = f"{cycles} cycles of three units, {steps} steps. Watching costs {cost * 1e6:.2f} us a step.\n\n"
    bench.tell(text + table(["run", "s"], rows), {"steps": steps, "watched": watched, "here": here, "per_step": cost})
    return 0


def _scenario(folder: Path, duration: float) -> Path:
    library = folder / "friction.so"
    command = [*toolchain.find_compiler(), "-std=gnu99", "-O1", "-fPIC", "-shared", f"-I{acme.HEADERS}", "-DFAULT=0"]
    subprocess.run([*command, str(acme.HERE / "faulty.c"), "-o", str(library), "-lm"], check=True)
    acme.archive(folder / "friction.fmu", "friction", library.read_bytes(), ROWS)
    friction = json.dumps({"fmu": "friction.fmu", **acme.MAPPED_FRICTION, "parameters": {"At": 1e9}})
    file = folder / "s.yaml"
    machine = ROOT / "scenarios" / "machines" / "emps"
    file.write_text(PLAN.format(machine=machine, duration=duration, friction=friction), encoding="utf-8")
    return file


if __name__ == "__main__":
    sys.exit(main())
