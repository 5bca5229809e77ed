"""One contestant of ``peers.py`` in a process of its own: simulates the circle, times the stepping alone, leaves JSON.

A process each, as a user has it: nobody's libraries, threads or caches are in another one's way. Imports are made where
they are needed, so that the whole process is the tool's.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from importers.system import Result

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "reference")]  # the adapters of other tools, the references
AXES = ("X", "Y", "Z")
RECORD = tuple(("plant", f"{axis}.x_a") for axis in AXES)
STEP = 125e-6  # s, the control cycle
EVERY = 8  # cycles between the instants that are compared: 1 ms


@dataclass(frozen=True)
class Job:
    """What to simulate: the scenario with its overrides, the same as an SSP file, and how many cycles that is."""

    ssp: Path
    scenario: Path
    overrides: tuple[str, ...]
    cycles: int


@dataclass
class Outcome:
    """What comes out.

    Attributes:
        seconds: of the stepping. cycles: that these seconds stand for.
        x_a: axis -> positions [m] at `instants` (in cycles).
        details: what else there is to tell.
    """

    seconds: float
    cycles: int
    instants: list[int]
    x_a: dict[str, list[float]]
    details: dict[str, Any] | None = None


def _from_result(result: Result, seconds: float, cycles: int) -> Outcome:
    instants = list(range(EVERY, len(next(iter(result.values()))), EVERY))
    return Outcome(seconds, cycles, instants, {n: result["plant", f"{n}.x_a"][instants].tolist() for n in AXES})


def _last(values: Mapping[str, float], seconds: float, cycles: int, job: Job) -> Outcome:
    return Outcome(seconds, cycles, [job.cycles], {name: [float(value)] for name, value in values.items()})


# --- ours ------------------------------------------------------------------------------------------------------------


def _ours(job: Job, scheme: str, native: bool) -> Outcome:
    from feedsim import scenario
    from feedsim.simulation import cosim, nc

    loaded = scenario.load(job.scenario, (*job.overrides, f"coupling.scheme={scheme}"))
    program = nc.plan(loaded)
    run = cosim.run(loaded, program=program, native=native)
    x_a = {name: run.trace[f"{name}.x_a"][1:].tolist() for name in AXES}
    return Outcome(run.wall_time, job.cycles, [EVERY * (i + 1) for i in range(len(x_a["X"]))], x_a)


def _floor(job: Job) -> Outcome:
    from floor import build, floor

    from feedsim import scenario
    from feedsim.simulation import nc

    library = build(ROOT / "build" / "bench" / "floor")
    loaded = scenario.load(job.scenario, job.overrides)
    program = nc.plan(loaded)
    seconds, table, names = floor(library, loaded, program)
    x_a = {name: table[1:, names.index(f"{name}.x_a")].tolist() for name in AXES}
    return Outcome(seconds, job.cycles, [EVERY * (i + 1) for i in range(len(table) - 1)], x_a)


# --- other simulators ------------------------------------------------------------------------------------------------


def _ecos(job: Job) -> Outcome:
    from importers import with_ecos

    with_ecos.load()
    from ecospy import EcosLib, EcosSimulation

    with EcosSimulation(step_size=STEP, ssp_path=str(job.ssp)) as simulation:
        if not simulation.init(parameter_set=with_ecos.SSP_PARAMETERS):
            raise RuntimeError(EcosLib.get_last_error())
        begun = time.perf_counter()
        simulation.step(job.cycles)
        seconds = time.perf_counter() - begun
        return _last({n: simulation.get_real(f"plant::{n}.x_a") for n in AXES}, seconds, job.cycles, job)


def _libcosim(job: Job) -> Outcome:
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_ssp_file(str(job.ssp), round(STEP * 1e9))
    stepped = execution.step(1)  # initialises
    begun = time.perf_counter()
    stepped = stepped and execution.step(job.cycles - 2)
    seconds = time.perf_counter() - begun
    # only now somebody watches: an observer costs in every step
    observer = CosimObserver.create_last_value()
    if not (stepped and execution.add_observer(observer) and execution.step(1)):
        raise RuntimeError("libcosim could not step")
    plant = execution.slave_index_from_instance_name("plant")
    reference = {variable.name.decode(): variable.reference for variable in execution.slave_variables(plant)}
    values = observer.last_real_values(plant, [reference[f"{name}.x_a"] for name in AXES])
    return _last(dict(zip(AXES, values, strict=True)), seconds, job.cycles - 2, job)


def _fmpy(job: Job) -> Outcome:
    from fmpy.ssp import simulation

    from importers import with_fmpy
    from importers.system import Experiment

    marks: list[float] = []

    def mark(name: str) -> None:
        """Take the time at the first call of one of the runner's functions, and be out of its way from then on."""
        original = getattr(simulation, name)

        def first(*arguments: Any) -> Any:
            setattr(simulation, name, original)
            marks.append(time.perf_counter())
            return original(*arguments)

        setattr(simulation, name, first)

    mark("do_step")
    mark("free_fmu")
    experiment = Experiment(STEP, job.cycles, RECORD)
    result = with_fmpy.run_file(job.ssp, experiment, with_fmpy.parameters(job.ssp))
    return _from_result(result, marks[1] - marks[0], job.cycles)


def _on_one_core(run: Callable[[Job], Outcome], job: Job) -> Outcome:
    """Both step units on threads of their own, which short steps need not gain from."""
    import os

    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # both tools are for Linux alone
    return run(job)


# Reading values in every step costs time, so not what is timed: the whole movement, to be compared.
def _watched_ecos(job: Job) -> Outcome:
    from importers import with_ecos
    from importers.system import Experiment

    return _from_result(with_ecos.run(job.ssp, Experiment(STEP, job.cycles, RECORD)), 0.0, job.cycles)


def _watched_libcosim(job: Job) -> Outcome:
    from importers import with_libcosim
    from importers.system import Experiment

    return _from_result(with_libcosim.run(job.ssp, Experiment(STEP, job.cycles, RECORD)), 0.0, job.cycles)


# --- SciPy -----------------------------------------------------------------------------------------------------------

# Steps as long as a control cycle, if the tolerance permits; the fastest that is accurate enough counts.
SOLVERS = (
    ("RK23", 1e-4, 1e-8, 1.0),
    ("RK45", 1e-4, 1e-7, 1.0),
    ("DOP853", 1e-3, 1e-6, 1.0),
    ("LSODA", 1e-6, 1e-10, 0.2),
)
STRETCH = 4800  # cycles, 0.6 s: from rest through the first two reversals
ACCURACY = 1e-9  # m


def _solve_ivp(job: Job) -> Outcome:
    """Each solver over the first part of the circle; errors against the pinned reference of the scenario."""
    import monolithic
    import numpy as np
    import system
    from integrated import Integrated, Solver

    case = next(each for each in system.SYSTEMS if each.name == "xz_circle")
    machine = monolithic.machine()
    setpoints, reference = case.setpoints(machine), system.read(case)
    cycles, kept = min(STRETCH, job.cycles), round(case.every / machine.T_c)
    ratio = round(machine.T_pos / machine.T_c)
    expected = np.array([reference[f"{name}.x_a"] for name in AXES])
    tried: dict[str, dict[str, float]] = {}
    best: Outcome | None = None
    for solver in SOLVERS:
        body = Integrated(machine, {n: float(setpoints.x_s[n][0]) for n in AXES}, Solver(*solver))
        rows: list[list[float]] = []
        for k in range(cycles):
            j = k // ratio
            body.cycle([setpoints.x_s[n][j] for n in AXES], [setpoints.n_ffw[n][j] for n in AXES])
            if (k + 1) % kept == 0:
                rows.append(body.positions().tolist())
        error = float(np.max(np.abs(np.array(rows).T - expected[:, 1 : len(rows) + 1])))
        tried[solver[0]] = {"us": 1e6 * body.seconds / cycles, "error m": error, "calls": body.evaluations / cycles}
        if error < ACCURACY and (best is None or body.seconds < best.seconds):
            x_a = {name: [row[i] for row in rows] for i, name in enumerate(AXES)}
            best = Outcome(body.seconds, cycles, [kept * (i + 1) for i in range(len(rows))], x_a)
            best.details = {"solver": solver[0], "error m": error, "tried": tried}
    if best is None:
        raise RuntimeError(f"no solver reaches {ACCURACY} m: {tried}")
    return best


CONTESTANTS: Mapping[str, Callable[[Job], Outcome]] = {
    "floor": _floor,
    "native": lambda job: _ours(job, "extrapolated", True),
    "native-parallel": lambda job: _ours(job, "parallel", True),
    "python": lambda job: _ours(job, "extrapolated", False),
    "ecos": _ecos,
    "ecos-one-core": lambda job: _on_one_core(_ecos, job),
    "ecos-watched": _watched_ecos,
    "libcosim": _libcosim,
    "libcosim-one-core": lambda job: _on_one_core(_libcosim, job),
    "libcosim-watched": _watched_libcosim,
    "fmpy": _fmpy,
    "solve_ivp": _solve_ivp,
}


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", choices=CONTESTANTS)
    parser.add_argument("--ssp", type=Path, required=True)
    parser.add_argument("--scenario", type=Path, required=True)
    parser.add_argument("--set", dest="overrides", action="append", default=[])
    parser.add_argument("--cycles", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args(arguments)
    job = Job(given.ssp, given.scenario, tuple(given.overrides), given.cycles)
    given.out.write_text(json.dumps(asdict(CONTESTANTS[given.name](job))), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
