"""Whether bands of a run hold the truth, and what a compensation found on an identified set does on the true machine.

Axis Z of the default machine, synthetic and known, is logged again and again with noise of 5 % on the current and
identified from every log. Each set gives a band of the contour of a short circle, which the contour of the true machine
lies in or not. Intervals allow for viscous friction that changes while the log is taken
(estimation/identify/stribeck.py). So the axis warms or cools by a course drawn from that; with --still it does not. A
friction compensation found on a set is judged on the true machine, beside that found on the truth.

    make band-coverage
    python benchmarks/coverage.py --logs 3 --kinds pulse,pulse_characteristic
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from identification import Case, records, simulate
from numpy.typing import NDArray

from feedsim.analysis import circularity, tasks
from feedsim.design.tune.circles import Circles, practical, size
from feedsim.design.tune.compensators import GROUP_OF_KIND, tune
from feedsim.design.uncertainty import cloud_of, curves_of, of_run
from feedsim.estimation.identify import IdentifiedFriction, Options, friction_file, identify
from feedsim.estimation.identify import stribeck as drift
from feedsim.estimation.identify.record import Record
from feedsim.estimation.identify.result import Estimate
from feedsim.scenario import Scenario, load
from feedsim.simulation import cosim
from feedsim.simulation.cosim.friction_law import FrictionLaw
from feedsim.structure.modes import checked_modes

CIRCLE = Path(__file__).resolve().parents[1] / "scenarios" / "xz_circle.yaml"
SHORT = ("motions.0.radius=5 mm",)
AXIS, PLANE = "Z", ("X", "Z")
NOISE = Case(0.05, 0.0, True)
DRAWS = 39
SOFTWARE = dict.fromkeys(("feedsim", "python", "numpy", "scipy"), "")  # versions, which nobody reads here


def quiet(*_: object) -> None:
    """No progress."""


def warmed(made: Sequence[Record], sigma_2: float, seed: int) -> list[Record]:
    """Records with viscous friction that changes: at once, evenly, or at random, by WARMS in standard deviation.

    The control keeps the speed whatever the friction, so that the torque alone differs. The plateaus come first; what
    follows them has the last value.
    """
    random = np.random.default_rng((seed, 1))
    age = np.linspace(0.0, 1.0, len(made[0].time))
    courses = (
        drift.WARMING_DEVIATION * random.normal() * (age > 0),
        drift.WARMING_DEVIATION * random.normal() * age,
        drift.WARMING_DEVIATION * np.cumsum(random.normal(size=len(age))) / np.sqrt(len(age)),
    )
    change = courses[random.integers(len(courses))]
    result = []
    for k, record in enumerate(made):
        assert record.speed is not None
        own = change if k == 0 else change[-1]
        result.append(replace(record, torque=record.torque + own * sigma_2 * record.speed))
    return result


def identified(true: Scenario, logs: int, folder: Path, *, still: bool) -> list[Path]:
    """A friction file of every log."""
    machine = true.machine
    experiment, modes, axis = simulate(AXIS), checked_modes(machine), machine.axes[AXIS]
    J = Estimate("J", modes.J_tot(AXIS), "kg.m2", "inertia", status="given")
    files = []
    for seed in range(logs):
        made = records(experiment, machine, AXIS, NOISE, seed + 100)
        if not still:
            made = warmed(made, machine.shipped_friction(AXIS, "the log").sigma_2, seed)
        with FrictionLaw() as law:
            found = identify(made, law, Options(AXIS, axis.I_P, J=J, modes=modes, delay=0.0))
        file = folder / f"friction_{seed}.yaml"
        file.write_text(friction_file.friction_yaml(IdentifiedFriction(found, tuple(made), ()), SOFTWARE))
        files.append(file)
    return files


def coverage(true: Scenario, file: Path) -> tuple[float, bool]:
    """Share of the contour of the true machine that the band of a set holds, and whether the interval of G holds G."""
    truth = cosim.run(true)
    ((_, contour),) = curves_of(truth).values()
    (task,) = tasks(true, truth.program)
    own = load(CIRCLE, [*SHORT, f"machine.axes.{AXIS}.friction={file}"])
    nominal = cosim.run(own, program=truth.program)
    found = of_run(nominal, cloud_of(own.machine), DRAWS, progress=quiet)
    (band,) = found.bands
    low, high = found.figures["XZ.G"]
    inside = (band.low <= contour) & (contour <= band.high)
    return float(inside.mean()), low <= float(circularity(truth.trace, task.turn)["G"]) <= high  # type: ignore[union-attr]


def reductions(true: Scenario, found: Scenario, kind: str) -> NDArray[np.float64]:
    """Median and least reduction [%] on the true machine of values that were found on another one."""
    values = tune(found, kind, PLANE, (AXIS,), "ratio", fmus=None, progress=quiet).found
    circles = Circles.of(true, PLANE, practical(true.machine, PLANE))
    before, after = (size(circles.errors(each))[:, 1] for each in (true.machine, values.on(true.machine, true.machine)))
    of_each = 100 * (1 - after / before)
    return np.array([np.median(of_each), of_each.min()])


def main() -> int:
    """Identify, and print a row a log."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=int, default=12)
    parser.add_argument("--still", action="store_true", help="viscous friction that does not change during a log")
    parser.add_argument("--kinds", default="", help="of compensations, such as pulse,pulse_characteristic,table")
    given = parser.parse_args()
    true = load(CIRCLE, SHORT)
    kinds = [kind for kind in given.kinds.split(",") if kind]
    if unknown := [kind for kind in kinds if kind not in GROUP_OF_KIND]:
        parser.error(f"--kinds {','.join(unknown)}: of {', '.join(GROUP_OF_KIND)}")
    with TemporaryDirectory() as folder:
        files = identified(true, given.logs, Path(folder), still=given.still)
        nominal = {kind: reductions(true, true, kind) for kind in kinds}
        for kind, (median, least) in nominal.items():
            print(f"{kind} found on the truth: median {median:.1f} %, least {least:.1f} %", flush=True)
        rows = []
        for seed, file in enumerate(files):
            rows.append(coverage(true, file))
            text = (
                f"log {seed}: {100 * rows[-1][0]:.1f} % of the contour inside, G {'inside' if rows[-1][1] else 'OUT'}"
            )
            own = load(CIRCLE, [*SHORT, f"machine.axes.{AXIS}.friction={file}"])
            for kind in kinds:
                median, least = reductions(true, own, kind)
                text += f"; {kind} median {median:.1f} %, least {least:.1f} %"
            print(text, flush=True)
        mean = np.mean([share for share, _ in rows])
        print(f"{len(rows)} logs: {100 * mean:.1f} % of the contour inside, G in {sum(of_G for _, of_G in rows)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
