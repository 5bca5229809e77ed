"""Whether bands of a run hold the truth, and what a compensation found on an identified set does on the true machine.

Axis Z of the default machine, synthetic and known, is logged again and again with noise of 5 % on the current and
identified from every log. Each set gives a band of the contour of a short circle, which the contour of the true machine
lies in or not. A friction compensation found on a set is judged on the true machine, beside that found on the truth.

    make band-coverage
    python benchmarks/coverage.py --logs 3 --kinds pulse,pulse_characteristic
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from identification import Case, records, simulate
from numpy.typing import NDArray

from feedsim import cosim
from feedsim.analysis import circularity, tasks
from feedsim.cosim.friction_law import FrictionLaw
from feedsim.identify import Identified, Options, friction_file, identify
from feedsim.identify.result import Estimate
from feedsim.scenario import Scenario, load
from feedsim.structure.modes import checked_modes
from feedsim.tune.circles import Circles, practical, size
from feedsim.tune.compensation import tune
from feedsim.tune.compensators import GROUP_OF_KIND
from feedsim.uncertainty import cloud_of, of_run
from feedsim.uncertainty.runs import curves_of

CIRCLE = Path(__file__).resolve().parents[1] / "scenarios" / "xz_circle.yaml"
SHORT = ("motions.0.radius=5 mm",)
AXIS, PLANE = "Z", ("X", "Z")
NOISE = Case(0.05, 0.0, True)
DRAWS = 39
SOFTWARE = dict.fromkeys(("feedsim", "python", "numpy", "scipy"), "")  # versions, which nobody reads here


def quiet(*_: object) -> None:
    """No progress."""


def identified(true: Scenario, logs: int, folder: Path) -> list[Path]:
    """A friction file of every log."""
    machine = true.machine
    experiment, modes, axis = simulate(AXIS), checked_modes(machine), machine.axes[AXIS]
    J = Estimate("J", modes.J_tot(AXIS), "kg.m2", "inertia", status="given")
    files = []
    for seed in range(logs):
        made = records(experiment, machine, AXIS, NOISE, seed + 100)
        with FrictionLaw() as law:
            found = identify(made, law, Options(AXIS, axis.I_P, J=J, modes=modes, delay=0.0))
        file = folder / f"friction_{seed}.yaml"
        file.write_text(friction_file.friction_yaml(Identified(found, tuple(made), ()), SOFTWARE))
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
    parser.add_argument("--logs", type=int, default=20)
    parser.add_argument("--kinds", default="", help="of compensations, such as pulse,pulse_characteristic,table")
    given = parser.parse_args()
    true = load(CIRCLE, SHORT)
    kinds = [kind for kind in given.kinds.split(",") if kind]
    if unknown := [kind for kind in kinds if kind not in GROUP_OF_KIND]:
        parser.error(f"--kinds {','.join(unknown)}: of {', '.join(GROUP_OF_KIND)}")
    with TemporaryDirectory() as folder:
        files = identified(true, given.logs, Path(folder))
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
