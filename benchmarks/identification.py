"""How far identification can be trusted: Monte Carlo over noisy logs of simulated experiments.

Run by ``make identification-accuracy`` (some ten minutes). The experiments of scenarios/identify_*.yaml run once on the
whole machine and are then logged again and again, with other noise. The default machine, whose numbers are synthetic
and known. Writes table.md; what it shows is explained in docs/trust.md.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim import scenario
from feedsim.estimation.identify import Options, identify
from feedsim.estimation.identify.parameters import curve
from feedsim.estimation.identify.record import Record
from feedsim.estimation.identify.result import Estimate
from feedsim.files.trace import Trace
from feedsim.scenario import Delay, Level, Machine, Noise
from feedsim.simulation import cosim
from feedsim.simulation.cosim.friction_law import FrictionLaw
from feedsim.structure.modes import checked_modes

Floats = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
NAMES = ("F_C", "F_S", "v_s", "F_log", "sigma_2", "sigma_0", "W", "gamma", "sigma_1")
SPEEDS = np.geomspace(10.0, 20000.0, 200) / 60e3  # m/s: where the curve is judged


@dataclass(frozen=True)
class Case:
    """Noise as a share of the torque's RMS, delay of the current [s], and whether the delay is known."""

    noise: float
    delay: float
    known: bool

    @property
    def text(self) -> str:
        known = "known" if self.known else "estimated"
        return f"{100 * self.noise:g} % noise, delay {1e3 * self.delay:g} ms {known}"


CASES = (
    Case(0.0, 0.0, True),
    Case(0.01, 0.0, True),
    Case(0.05, 0.0, True),
    Case(0.0, 0.5e-3, False),
    Case(0.05, 0.5e-3, False),
)


@dataclass(frozen=True, eq=False)
class Experiment:
    """Signals of the constant speeds and of the sines at the control cycle, and how a control logs them."""

    fine: dict[str, Trace]
    logging: dict[str, scenario.Logging]


def simulate(axis: str) -> Experiment:
    """Both experiments of an axis."""
    fine, logging = {}, {}
    for kind in ("constant", "sine"):
        loaded = scenario.load(ROOT / "scenarios" / f"identify_{axis.lower()}_{kind}.yaml")
        run = cosim.run(loaded)
        assert run.fine is not None
        assert loaded.logging is not None
        fine[kind], logging[kind] = run.fine, loaded.logging
    return Experiment(fine, logging)


def records(experiment: Experiment, machine: Machine, axis: str, case: Case, seed: int) -> list[Record]:
    """What a control would have logged."""
    made = []
    for k, (kind, fine) in enumerate(experiment.fine.items()):
        changes = {
            "noise": Noise(i_q=Level(case.noise, relative=True)) if case.noise else Noise(),
            "delay": Delay(i_q=case.delay) if case.delay else Delay(),
            "seed": 2 * seed + k,
        }
        log = cosim.logged(fine, experiment.logging[kind].model_copy(update=changes))
        described = machine.axes[axis]
        made.append(
            Record(
                kind,
                log.time,
                described.drive.K_t * log[f"{axis}.i_q"],
                angle=log[f"{axis}.x_a"] / described.I_P,
                speed=log[f"{axis}.n_a"],
                setpoint=log[f"{axis}.x_s"] / described.I_P,
            )
        )
    return made


def errors(experiment: Experiment, machine: Machine, axis: str, case: Case, seed: int) -> Floats:
    """(parameters + 3, 2): errors [%] of the parameters, of the worst speed of the curve, and of the delay [ms], with
    the standard deviations that identification says; the last row is its wall time [s]."""
    modes = checked_modes(machine)
    described = machine.axes[axis]
    J = Estimate("J", modes.J_tot(axis), "kg.m2", "inertia", status="given")
    options = Options(axis, described.I_P, J=J, modes=modes, delay=case.delay if case.known else None)
    begun = time.perf_counter()
    with FrictionLaw() as law:
        found = identify(records(experiment, machine, axis, case, seed), law, options)
    taken = time.perf_counter() - begun
    true = described.friction.parameters()
    rows = []
    for name in NAMES:
        estimate, value = found.estimates[name], float(true[name])
        rows.append((100 * (estimate.value / value - 1), 100 * estimate.sigma / value))
    values = {name: each.value for name, each in found.estimates.items()}
    n = SPEEDS / described.I_P
    expected = curve({name: float(value) for name, value in true.items()}, n)
    rows.append((100 * float(np.max(np.abs(curve(values, n) / expected - 1))), np.nan))
    delay = found.estimates["delay"]
    rows.append((1e3 * (delay.value - case.delay), 1e3 * delay.sigma))
    rows.append((taken, np.nan))
    return np.array(rows)


_shared: dict[str, Experiment] = {}


Plain = dict[str, tuple[Floats, dict[str, Floats], dict[str, str]]]  # traces as what another process can be sent


def _share(axis: str, fine: Plain, logging: dict[str, scenario.Logging]) -> None:
    _shared[axis] = Experiment({kind: Trace(*parts) for kind, parts in fine.items()}, logging)


def _one(axis: str, case: Case, seed: int) -> Floats:
    machine = scenario.load_machine(ROOT / "scenarios" / "machines" / "test_centre")
    return errors(_shared[axis], machine, axis, case, seed)


def table(axis: str, cases: Sequence[Case], seeds: int, workers: int) -> list[str]:
    """Lines of a Markdown table."""
    experiment = simulate(axis)
    columns = [*NAMES, "curve", "delay [ms]"]
    lines = [f"| {axis}, errors in % | | " + " | ".join(columns) + " | s |", "|---" * (len(columns) + 3) + "|"]
    fine: Plain = {kind: (t.time, dict(t.columns), dict(t.units)) for kind, t in experiment.fine.items()}
    share = (axis, fine, experiment.logging)
    with ProcessPoolExecutor(workers, initializer=_share, initargs=share) as pool:
        for case in cases:
            count = seeds if case.noise else 1
            tasks = [pool.submit(_one, axis, case, seed) for seed in range(count)]
            found = np.array([task.result() for task in tasks])
            error, told = found[:, :-1, 0], found[:, :-1, 1]
            shown = {"largest": np.max(np.abs(error), axis=0)}
            if count > 1:
                shown["rms"] = np.sqrt(np.mean(error**2, axis=0))
                shown["mean"] = np.mean(error, axis=0)
                shown["reported"] = np.sqrt(np.mean(told**2, axis=0))
                shown["scatter/reported"] = np.std(error, axis=0, ddof=1) / shown["reported"]
            for label, row in shown.items():
                cells = " | ".join("-" if not np.isfinite(value) else f"{value:.2g}" for value in row)
                seconds = f"{np.median(found[:, -1, 0]):.1f}" if label == "largest" else ""
                lines.append(f"| {case.text} | {label} | {cells} | {seconds} |")
                print(lines[-1], flush=True)
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--axes", default="Z,X", help="default: Z,X")
    parser.add_argument("--seeds", type=int, default=24, help="logs per noise level (default: 24)")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (default: one per core)")
    parser.add_argument("--out", type=Path, default=Path("build/identification"), help="folder of table.md")
    options = parser.parse_args()
    lines: list[str] = []
    for axis in options.axes.split(","):
        lines += [*table(axis, CASES, options.seeds, options.workers), ""]
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "table.md").write_text("\n".join(lines), encoding="utf-8")
    print(f"{options.out / 'table.md'}")


if __name__ == "__main__":
    main()
