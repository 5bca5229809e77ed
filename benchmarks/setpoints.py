"""What it costs when an importer gives the machine its setpoints from outside: the circle and the Z move, driven by the
unit `machine` at steps of 1, 2, 5 and 10 ms, against `feedsim run`.

Setpoints are those of the run at the importer's communication points: held over the step; with the slopes of x_s and
n_ffw there (fmi2SetRealInputDerivatives); x_s alone, on a path through its last samples with a delay of two steps, the
feedforward formed inside. What is delayed is compared with the run that much earlier. The overshoot of the move is the
largest position that the unit has seen within its steps, beyond the end. Machine and motions are synthetic.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from harness import ONE_WAY, ROOT, arguments, digits, table

import numpy as np
from numpy.typing import NDArray

from feedsim import scenario
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.unit import Unit
from feedsim.simulation.cosim.whole import pack_whole

STEPS = (1, 2, 5, 10)  # position cycles, of 1 ms
SHORT_CIRCLE = (ONE_WAY, "motions.0.radius=1 mm", "evaluate=[]")
SHORT_MOVE = ("motions.0.by.Z=1 mm", "evaluate=[]")
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Way:
    """How setpoints come in: with slopes; on a path that many steps late, with the feedforward formed inside."""

    name: str
    slopes: bool = False
    late: int = 0


WAYS = (Way("held"), Way("with slopes", slopes=True), Way("path, two steps late", late=2))


def driven(
    archive: Archive, program: nc.Program, leads: Mapping[str, float], cycles: int, way: Way
) -> dict[str, Array]:
    """x_a, x_a_max and M_a of all axes at the ends of steps of that many position cycles."""
    T_pos = float(program.time[1] - program.time[0])
    step, axes = cycles * T_pos, list(leads)
    inputs = [f"{axis}.x_s" for axis in axes] + ([] if way.late else [f"{axis}.n_ffw" for axis in axes])
    values = np.column_stack([program.x_s[axis] for axis in axes] + [program.n_ffw[axis] for axis in axes])
    slopes = np.gradient(values, T_pos, axis=0)
    slopes[:, : len(axes)] = values[:, len(axes) :] * list(leads.values())
    names = [f"{axis}.{signal}" for axis in axes for signal in ("x_a", "x_a_max", "M_a")]
    unit = Unit(archive, "machine")
    try:
        unit.set_parameters({"motion.built_in": False, "setpoints.n_ffw_inside": way.late > 0})
        unit.set_parameters({"setpoints.delay": way.late * step, **dict(zip(inputs, values[0], strict=False))})
        count = (len(program.time) - 1) // cycles
        unit.enter_initialisation(0.0, (count + 1) * step)
        unit.exit_initialisation()
        given, first = unit.references(inputs), np.ones(len(inputs), dtype=np.int32)
        wanted, found = unit.references(names), np.zeros((count, len(names)))
        set_real, set_slopes, do_step, get_real = (
            unit.call(name) for name in ("set_real", "set_slopes", "do_step", "get_real")
        )
        for k in range(count):
            now = np.ascontiguousarray(values[k * cycles, : len(inputs)])
            failed = set_real(given.ctypes.data, len(inputs), now.ctypes.data) > 1
            if way.slopes:
                rates = np.ascontiguousarray(slopes[k * cycles, : len(inputs)])
                failed |= set_slopes(given.ctypes.data, len(inputs), first.ctypes.data, rates.ctypes.data) > 1
            failed |= do_step(k * step, step, 1) > 1
            failed |= get_real(wanted.ctypes.data, len(names), found[k].ctypes.data) > 1
            if failed:
                unit.fail("a step")
    finally:
        unit.close()
    return {name: found[:, i] for i, name in enumerate(names)}


def _common(found: Mapping[str, Array], run: cosim.Run, cycles: int, late: int) -> tuple[Array, Array, Array]:
    """Rows of `found` and of the run at the same instants, and the largest differences of x_a [m] and M_a [N.m]."""
    axes = list(run.scenario.machine.axes)
    rows = (np.arange(len(found[f"{axes[0]}.x_a"])) + 1 - late) * cycles
    there = rows >= 0
    most = [
        max(float(np.abs(found[name][there] - np.asarray(run.trace[name])[rows[there]]).max()) for name in names)
        for names in ([f"{axis}.x_a" for axis in axes], [f"{axis}.M_a" for axis in axes])
    ]
    return there, rows[there], np.array(most)


def radius(found: Mapping[str, Array], run: cosim.Run, there: Array, rows: Array) -> float:
    """By how much the distance from the circle's centre is off over the middle turn [m]."""

    def both(name: str) -> tuple[Array, Array]:
        return found[name][there], np.asarray(run.trace[name])[rows]

    motion = run.program.segments[0]
    turn = (motion.end - motion.start) / 3
    times = rows * float(run.program.time[1])
    middle = (times > motion.start + turn) & (times < motion.end - turn)
    radii = []
    for x, z in zip(both("X.x_a"), both("Z.x_a"), strict=True):
        centre = [(axis[middle].max() + axis[middle].min()) / 2 for axis in (both("X.x_a")[1], both("Z.x_a")[1])]
        radii.append(np.hypot(x - centre[0], z - centre[1])[middle])
    return float(np.abs(radii[0] - radii[1]).max())


def main(given: Sequence[str] | None = None) -> int:
    bench = arguments("setpoints", __doc__, given)
    runs = {
        "circle": _run("xz_circle", *(SHORT_CIRCLE if bench.short else [ONE_WAY])),
        "move": _run("z_positioning", *(SHORT_MOVE if bench.short else [])),
    }
    target = float(runs["move"].program.x_s["Z"][-1])
    machine = runs["circle"].scenario.machine
    leads = {name: axis.I_P for name, axis in machine.axes.items()}
    rows, results = [], {}
    with tempfile.TemporaryDirectory() as folder:
        packed = Path(folder) / "machine.fmu"
        pack_whole(cosim.fmus_directory() / "machine.fmu", packed, machine, trial=False)
        with Archive(packed) as archive:
            for way in WAYS:
                for cycles in STEPS:
                    figures: dict[str, float] = {}
                    for name, run in runs.items():
                        found = driven(archive, run.program, leads, cycles, way)
                        there, common, (x_a, M_a) = _common(found, run, cycles, way.late)
                        figures |= {f"{name}: x_a [m]": x_a, f"{name}: M_a [N.m]": M_a}
                        if name == "circle":
                            figures["circle: radius [m]"] = radius(found, run, there, common)
                        else:
                            figures["move: overshoot [m]"] = float(found["Z.x_a_max"].max()) - target
                    results[f"{way.name}, {cycles} ms"] = figures
                    rows.append([way.name, f"{cycles} ms"] + [
                        digits(figures[name] * (1e6 if "[m]" in name else 1.0))
                        for name in ("circle: x_a [m]", "circle: radius [m]", "circle: M_a [N.m]",
                                     "move: x_a [m]", "move: M_a [N.m]", "move: overshoot [m]")
                    ])  # fmt: skip
    header = ["setpoints", "steps", "circle: x_a off, um", "radius off in the middle turn, um", "M_a off, N.m",
              "move: x_a off, um", "M_a off, N.m", "overshoot, um"]  # fmt: skip
    bench.tell(table(header, rows), results)
    return 0


def _run(name: str, *changes: str) -> cosim.Run:
    loaded = scenario.load(ROOT / "scenarios" / f"{name}.yaml", [*changes, "recording.interval=1 ms"])
    return cosim.run(loaded, program=nc.plan(loaded))


if __name__ == "__main__":
    sys.exit(main())
