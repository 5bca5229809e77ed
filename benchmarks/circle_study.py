"""How well causes put into machines come out of the diagnosis of their circles, on circles that no rule was set on.

Machine, plane, radius, feed and cause follow from a seed. The machines are synthetic: the default one in its three
planes, and the two of compensation_study.py. Every other circle has no cause. The response of the axes is no cause:
what the linear system makes of scale and servo mismatch is their true value there. The frequency responses of that
system and the simulation are two codes (tests/physics/test_frequency_responses.py compares them).

    make circle-study                             40 circles
    python benchmarks/circle_study.py --seed 7    others
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from compensation_study import scenarios

from feedsim import scenario
from feedsim.analysis import Diagnosis, contour
from feedsim.analysis.circle import CircleUnderTest, TurnedPath, diagnose, term_name
from feedsim.analysis.evaluate import FIGURE_UNITS, CircleTask, diagnose_turns, tasks
from feedsim.files.trace import Trace
from feedsim.foundation.errors import FeedsimError
from feedsim.simulation import cosim, nc

MACHINES = (("default", "XZ"), ("default", "XY"), ("default", "YZ"), ("linear", "XZ"), ("gantry", "XZ"))
RADII, FEEDS = (8.0, 120.0), (0.5, 15.0)  # drawn evenly in their logarithms [mm], [m/min]
LONGEST_TURN = 20.0  # [s]
ACCELERATION_SHARE = 0.4  # of the smallest limit of the axes, at most, on the circle
INVENTED = 0.5e-6  # a cause that is not there counts from this in the radius on [m]
CAUSES = (
    "play", "hysteresis", "backlash compensation", "scale", "squareness", "servo", "pitch", "encoder", "cogging",
    "guide",
)  # fmt: skip


@dataclass(frozen=True)
class Drawn:
    """A circle and its cause. feed [m/min], radius [mm]; true: term -> value in SI, of the terms that have one."""

    machine: str
    plane: str
    radius: float
    feed: float
    cause: str
    settings: tuple[str, ...]
    true: dict[str, float]
    at_tool: bool = False


def put_in(rng: np.random.Generator, cause: str, plane: str, machine: scenario.Machine) -> Drawn:
    """Settings of a cause of random size on a random axis of the plane."""
    axis = plane[int(rng.integers(2))]
    pitch, torque = 2 * math.pi * machine.axes[axis].I_P, machine.axes[axis].friction.F_C
    sign, other = (1, plane[1]) if axis == plane[0] else (-1, plane[0])
    own, indirect = f"machine.axes.{axis}", tuple(f"machine.axes.{a}.drive.measuring.indirect=true" for a in plane)
    size = float(rng.uniform(2, 10))
    settings: tuple[str, ...] = ()
    true: dict[str, float] = {}
    match cause:
        case "play":
            settings, true = (f"{own}.play={size} um", *indirect), {f"lost_motion {axis}": size * 1e-6}
        case "hysteresis":
            settings = (f"{own}.hysteresis.value={size} um", f"{own}.hysteresis.way=50 um", *indirect)
            true = {f"lost_motion {axis}": size * 1e-6}
        case "backlash compensation":
            settings = (f"{own}.drive.backlash_compensation.value={size} um",)
            true = {f"lost_motion {axis}": -size * 1e-6}
        case "scale":
            settings, true = (f"{own}.drive.measuring.linear={10 * size} um/m",), {"scale": -sign * size * 1e-5}
        case "squareness":
            settings, true = (
                (f"machine.geometry.squareness_{''.join(sorted(plane))}={10 * size} um/m",),
                {"squareness": size * 1e-5},
            )
        case "servo":
            settings = (f"{own}.drive.k_ffw=0.99", f"machine.axes.{other}.drive.k_ffw=1")
        case "pitch":
            settings = tuple(
                f"{own}.drive.periodic_error_1.{part}"
                for part in (f"period={pitch} m", f"amplitude={size / 3} um", f"phase={rng.uniform(0, 360)} deg")
            )
            true = {f"pitch {axis}": size / 3 * 1e-6}
        case "encoder":
            angle = size / 3 * 1e-6 / (pitch / (2 * math.pi))
            settings, true = (
                (f"{own}.drive.encoder.eccentricity={angle} rad", *indirect),
                {f"pitch {axis}": size / 3 * 1e-6},
            )
        case "cogging":
            order, amplitude = int(rng.integers(4, 25)), float(rng.uniform(0.05, 0.2)) * torque
            settings = tuple(
                f"{own}.drive.cogging_1.{part}" for part in (f"order={order}", f"amplitude={amplitude} N.m")
            )
            true = {f"cogging {axis} {order}": amplitude}
        case "guide":
            settings = (f"{own}.guide.share={10 * size} %",)
    return Drawn("", plane, 0.0, 0.0, cause, settings, true, cause == "squareness")


def draw(rng: np.random.Generator, files: dict[str, Path], cause: str) -> tuple[Drawn, scenario.Scenario]:
    """A circle that the machine can drive."""
    while True:
        machine, plane = MACHINES[int(rng.integers(len(MACHINES)))]
        radius = float(np.exp(rng.uniform(*np.log(RADII))))
        feed = float(np.exp(rng.uniform(*np.log(FEEDS))))
        plain = scenario.load(files[machine])
        axes = [plain.machine.axes[axis] for axis in plane]
        speed, R = feed / 60, radius / 1e3
        limit = min(axis.max_acceleration for axis in axes)
        if 2 * math.pi * R / speed > LONGEST_TURN or speed**2 / R > ACCELERATION_SHARE * limit:
            continue
        drawn = put_in(rng, cause, plane, plain.machine)
        motion = [
            f"motions.0.plane=[{plane[0]}, {plane[1]}]", f"motions.0.radius={radius} mm",
            f"motions.0.feed={feed} m/min", "motions.0.direction=both", "motions.0.turns=3",
            "evaluate=[{kind: circle, turn: 2}]", "recording.interval=1 ms",
        ]  # fmt: skip
        try:
            loaded = scenario.load(files[machine], [*motion, *drawn.settings])
            nc.plan(loaded)
        except FeedsimError:
            continue
        return Drawn(machine, plane, radius, feed, cause, drawn.settings, drawn.true, drawn.at_tool), loaded


def diagnosis(drawn: Drawn, task: CircleTask, trace: Trace) -> Diagnosis | None:
    """What a run's report says; at the tool where the cause acts there."""
    columns = tuple(f"tcp.x_{axis}" for axis in task.turn.axes) if drawn.at_tool else None
    response = None if drawn.at_tool else task.response
    return diagnose_turns(trace, task.turns, task.pitch, task.gain, task.drag, columns, False, response, task.following)


@dataclass(frozen=True)
class Ballbar:
    """What an instrument adds. pivot: its place off the centre [m]; axle: of the angle, as multiples of its cosine and
    sine [rad]; apart: mean radius counterclockwise less that clockwise [m]; form: order -> amplitude [m], phase [rad],
    and how it acts in the other direction, 1 or -1; step: of the radius [m]; timed: there is a column of time."""

    pivot: tuple[float, float]
    axle: tuple[float, float]
    apart: float
    form: dict[int, tuple[float, float, int]]
    step: float
    timed: bool

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Ballbar:
        """One of each fault in about half of the instruments."""
        axle, phase = rng.uniform(0, 9e-3) * (rng.random() < 0.6), rng.uniform(0, 2 * math.pi)
        form = {
            int(order): (float(rng.uniform(0.1e-6, 1.0e-6)), float(rng.uniform(0, 6)), int(rng.choice([1, 1, -1])))
            for order in rng.choice(np.arange(5, 13), 2, replace=False)
        }
        return cls(
            (float(rng.uniform(-30e-6, 30e-6)), float(rng.uniform(-30e-6, 30e-6))),
            (axle * math.cos(phase), axle * math.sin(phase)),
            float(rng.uniform(-5e-6, 5e-6)) * bool(rng.random() < 0.6),
            form if rng.random() < 0.5 else {},
            float(rng.choice([0.0, 0.1e-6, 1e-6], p=[0.3, 0.5, 0.2])),
            bool(rng.random() < 0.5),
        )

    def recorded(self, angle: np.ndarray, deviation: np.ndarray, radius: float, sense: int) -> TurnedPath:
        """A turn of the machine at constant speed, by its angle (N,) [rad] and deviation (N,) [m]."""
        x, y = (
            (radius + deviation) * np.cos(angle) - self.pivot[0],
            (radius + deviation) * np.sin(angle) - self.pivot[1],
        )
        seen = np.arctan2(y, x)
        off = np.hypot(x, y) - radius + sense * self.apart / 2
        for order, (amplitude, phase, back) in self.form.items():
            off += (1 if sense > 0 else back) * amplitude * np.cos(order * seen + phase)
        written = seen + self.axle[0] * np.cos(seen) + self.axle[1] * np.sin(seen)
        if self.step:
            off = np.round(off / self.step) * self.step
        clock = np.arange(len(angle)) * (2 * math.pi / len(angle)) if self.timed else None
        return TurnedPath((written + math.pi) % (2 * math.pi) - math.pi, off, sense, None, clock)


def by_ballbar(drawn: Drawn, task: CircleTask, trace: Trace, instrument: Ballbar) -> Diagnosis:
    """What a report of the recorded circle says; nothing is known of the machine but its pitches."""
    turn = task.turn
    columns = tuple(f"tcp.x_{axis}" for axis in turn.axes) if drawn.at_tool else None
    measured = [(contour(trace, each, columns), each.sense) for each in task.turns]
    paths = [instrument.recorded(each.angle, each.deviation, turn.radius, sense) for each, sense in measured]
    speed = 2 * math.pi * turn.radius / (turn.end - turn.begin)
    return diagnose(CircleUnderTest(turn.axes, turn.radius, speed, task.pitch, recorded=True), paths, centred=True)


def judged(
    task: CircleTask, drawn: Drawn, found: Diagnosis, instrument: Ballbar | None = None
) -> tuple[dict[str, bool], list[str]]:
    """Term -> whether its true value is in its interval; causes that are named and are not there."""
    R, speed = task.turn.radius, found.circle.speed
    true = {f"{key} {axis}": 0.0 for key in ("lost_motion", "pitch") for axis in task.turn.axes} | {"squareness": 0.0}
    if not drawn.at_tool:  # the response of the axes is that of the scales
        first, second = (task.gain[axis] for axis in task.turn.axes)
        true |= {"scale": abs(first) - abs(second), "servo": float(np.angle(second / first)) * R / speed}
    for key, value in drawn.true.items():
        true[key] = true.get(key, 0.0) + value
    if instrument is not None:
        true |= {f"straightness {axis}": 0.0 for axis in task.turn.axes}
        true |= {"third": 0.0, "drift": 0.0, "centres": 0.0, "radii": instrument.apart}
    terms = {f"{term.key} {term.axis} {term.order or ''}".strip(): term for term in found.terms}
    within = {key: abs(terms[key].value - value) <= terms[key].half for key, value in true.items() if key in terms}
    radial = {"scale": R / 2, "squareness": R / 2, "servo": speed / 2}
    invented = []
    for key, term in terms.items():
        if term.key in ("peaks", "rest", "radius", "offset") or not term.shows or within.get(key) or key in drawn.true:
            continue
        if drawn.at_tool and term.key in ("scale", "servo"):
            continue  # the structure between scale and tool gives way
        off = term.value - true.get(key, 0.0)
        if (term.size if term.key == "cogging" else abs(off) * radial.get(term.key, 1.0)) > INVENTED:
            factor, unit = FIGURE_UNITS[term.unit]
            invented.append(f"{term_name(term)} {factor * off:.3g} +- {factor * term.half:.2g} {unit}")
    return within, invented


def main() -> int:
    """Drive and diagnose the circles, and print what was missed and the sums."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=281128)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--ballbar", action="store_true", help="circles as an instrument records them")
    given = parser.parse_args()
    rng, hit, all_, put = np.random.default_rng(given.seed), Counter[str](), Counter[str](), [0, 0, 0]
    asked, instruments = 0, np.random.default_rng(given.seed + 1)
    with TemporaryDirectory() as folder:
        files = dict(scenarios(Path(folder), ["default", "linear", "gantry"]))
        for number in range(given.count):
            cause = "none" if number % 2 else CAUSES[number // 2 % len(CAUSES)]
            drawn, loaded = draw(rng, files, cause)
            run = cosim.run(loaded)
            (task,) = (each for each in tasks(run.scenario, run.program) if isinstance(each, CircleTask))
            instrument = Ballbar.drawn(instruments) if given.ballbar else None
            if instrument is not None:
                found: Diagnosis | None = by_ballbar(drawn, task, run.trace, instrument)
            else:
                found = diagnosis(drawn, task, run.trace)
            if found is None:
                continue
            within, invented = judged(task, drawn, found, instrument)
            hit.update(key.split()[0] for key, inside in within.items() if inside)
            all_.update(key.split()[0] for key in within)
            put[0] += sum(within.get(key, False) for key in drawn.true)
            put[1] += len(drawn.true)
            put[2] += len(invented)
            missed = [key for key, inside in within.items() if not inside]
            asked += sum(key.split()[1] in found.left_out for key in drawn.true if key not in within)
            missed += [f"{key} (not named)" for key in drawn.true if key not in within]
            if missed or invented:
                where = f"{instrument}, " if instrument else ""
                where += (
                    f"{drawn.machine} {drawn.plane}, R {drawn.radius:.0f} mm, {drawn.feed:.1f} m/min, {drawn.cause}"
                )
                print(f"{where}: outside: {', '.join(missed) or 'none'}; not there: {', '.join(invented) or 'none'}")
    print(", ".join(f"{key} {hit[key]} of {all_[key]}" for key in all_))
    print(
        f"all terms {sum(hit.values())} of {sum(all_.values())}; causes put in {put[0]} of {put[1]}, {asked} more ask "
        f"for a larger circle; invented {put[2]}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
