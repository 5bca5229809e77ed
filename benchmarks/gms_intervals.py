"""Whether the intervals of generalised Maxwell slip hold: records of drawn axes, identified from the record alone.

Every draw takes an axis with friction of its own and four sines from pre-sliding to sliding, with white noise on the
torque. Its records are solved by the shipped law at a fortieth of the record's interval. The curve over speed, the
inertia and the delay are given, as strokes at constant speed give them; pre-sliding and the load are identified.

Part of friction_laws.py (`--intervals`), which says how to run it.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from math import exp, log, pi
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from feedsim.estimation.identify import Options, Record, identify
from feedsim.estimation.identify.parameters import estimate
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.foundation.errors import FeedsimError
from feedsim.scenario.roles import FRICTION_UNITS, GMS
from feedsim.simulation.cosim.friction_law import FrictionLaw

I_P, J, M_0 = 0.02 / (2 * pi), 0.0164, 0.2  # lead [m/rad], inertia [kg.m^2], load [N.m]
INTERVAL, FINER = 2e-3, 40  # of the record [s], steps of the law within it
SINES = ((5e-6, 10.0, 1.0), (20e-6, 5.0, 1.6), (100e-6, 2.0, 3.0), (400e-6, 1.0, 4.0))  # [m], [Hz], [s]
NOISES = (0.01, 0.05)  # rms over that of the torque
CURVE = ("F_C", "F_S", "v_s", "F_log", "sigma_2", "asymmetry")
NAMES = ("sigma_0", "sigma_1", "spread", "skew", "C", "M_0")
FAR = 3.0  # standard deviations: beyond, a value is no matter of chance


@dataclass
class Outcome:
    """Of a draw.

    off: parameter called estimated -> standard deviations between it and the truth. undetermined: the others.
    seconds: of one core. refused: why nothing was identified.
    """

    noise: float
    seed: int
    draw: int
    off: dict[str, float] = field(default_factory=dict)
    undetermined: list[str] = field(default_factory=list)
    seconds: float = 0.0
    refused: str = ""

    def __str__(self) -> str:
        shown = [f"{name} {off:+.1f}{'' if abs(off) <= NORMAL_95 else '!'}" for name, off in self.off.items()]
        shown += [f"{name} not estimated" for name in self.undetermined]
        result = f"refused: {self.refused}" if self.refused else ", ".join(shown)
        return f"{100 * self.noise:.0f} % {self.draw:>4} {self.seconds:5.1f} s  {result}"


def friction(random: np.random.Generator) -> dict[str, float]:
    """Parameters of an axis, in units of SI."""

    def between(low: float, high: float) -> float:
        return float(random.uniform(low, high))

    def over_decades(low: float, high: float) -> float:
        return exp(between(log(low), log(high)))

    F_C = between(0.8, 3.0)
    sigma_0 = F_C * over_decades(100, 400)
    return {
        "F_C": F_C, "F_S": F_C * between(1.1, 1.5), "v_s": between(0.3, 1.5), "beta": 1.0,
        "F_log": F_C * between(0.1, 0.4), "v_log": 3.0, "sigma_2": between(0.003, 0.02), "asymmetry": 0.0,
        "sigma_0": sigma_0, "sigma_1": sigma_0 * between(1e-3, 4e-3), "spread": over_decades(5, 80),
        "skew": between(-0.5, 0.8), "C": over_decades(30, 400),
    }  # fmt: skip


def records(law: FrictionLaw, values: Mapping[str, float], noise: float, random: np.random.Generator) -> list[Record]:
    """Sines of an axis with these parameters, from rest."""
    made = []
    for amplitude, frequency, stop in SINES:
        w, peak = 2 * pi * frequency, amplitude / I_P  # [rad/s], [rad]
        rows = round(stop / INTERVAL)
        t, fine = np.arange(rows + 1) * INTERVAL, np.arange(rows * FINER + 1) * INTERVAL / FINER
        rubbing = law(values, peak * w * np.sin(w * fine), INTERVAL / FINER, every=FINER)
        torque = rubbing + J * peak * w**2 * np.cos(w * t) + M_0
        torque = torque + noise * np.sqrt(np.mean(torque**2)) * random.standard_normal(len(t))
        name = f"sine of {1e6 * amplitude:.0f} um"
        made.append(Record(name, t, torque, speed=peak * w * np.sin(w * t), angle=peak * (1 - np.cos(w * t))))
    return made


def drawn(noise: float, seed: int, draw: int, fmus: Path | None) -> Outcome:
    """A draw of that number: both noises meet the same axis."""
    random = np.random.default_rng([seed, draw])
    values = friction(random)
    outcome, begun = Outcome(noise, seed, draw), time.process_time()
    known = Options(
        "Z", I_P, J=estimate("J", J, status="given"), delay=0.0, law=GMS, hold={name: values[name] for name in CURVE}
    )
    with FrictionLaw(fmus, FRICTION_UNITS[GMS]) as law:
        try:
            found = identify(records(law, values, noise, random), law, known).estimates
        except FeedsimError as error:
            outcome.refused = str(error)
        else:
            for name in NAMES:
                each, true = found[name], {**values, "M_0": M_0}[name]
                if each.status == "estimated":
                    outcome.off[name] = (each.value - true) / each.sigma
                else:
                    outcome.undetermined.append(name)
    outcome.seconds = time.process_time() - begun
    return outcome


def study(draws: int, seed: int, jobs: int, out: Path, fmus: Path | None) -> list[Outcome]:
    """All draws at all noises, a process for each job at low priority; those in `out` are not drawn again."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / "intervals.jsonl"
    done = [Outcome(**json.loads(line)) for line in path.read_text().splitlines()] if path.is_file() else []
    asked = [(noise, seed, draw) for draw in range(draws) for noise in NOISES]
    known = {(each.noise, each.seed, each.draw): each for each in done}
    with (
        path.open("a", encoding="utf-8") as lines,
        ProcessPoolExecutor(jobs, get_context("spawn"), initializer=os.nice, initargs=(5,)) as processes,
    ):
        for future in as_completed([processes.submit(drawn, *each, fmus) for each in asked if each not in known]):
            outcome = future.result()
            known[outcome.noise, outcome.seed, outcome.draw] = outcome
            print(outcome, flush=True)
            print(json.dumps(asdict(outcome)), file=lines, flush=True)
    return [known[each] for each in asked]


def table(outcomes: Sequence[Outcome]) -> str:
    """As Markdown: how many of the values called estimated have the truth in their 95 % interval."""
    lines = [
        f"| noise | axes | {' | '.join(NAMES)} | all | beyond {FAR:g} sigmas |",
        "|---" * (len(NAMES) + 4) + "|",
    ]
    for noise in dict.fromkeys(each.noise for each in outcomes):
        of = [each for each in outcomes if each.noise == noise]
        cells = []
        for names in (*((name,) for name in NAMES), NAMES):
            offs = [abs(each.off[name]) for each in of for name in names if name in each.off]
            cells.append(f"{sum(off <= NORMAL_95 for off in offs)} of {len(offs)}")
        far = sum(abs(off) > FAR for each in of for off in each.off.values())
        refused = sum(bool(each.refused) for each in of)
        axes = f"{len(of)}, {refused} refused" if refused else f"{len(of)}"
        lines.append(f"| {100 * noise:.0f} % | {axes} | {' | '.join(cells)} | {far} |")
    return "\n".join(lines)
