"""Logs of feed axes whose parameters are known, with the imperfections that customers' logs have.

The axes are drawn at random and simulated by axis.c, which shares no code with the units: a log tells identification
nothing that it was built on. A log is files as a control leaves them, a mapping, and the truth. Every number is
synthetic; a log is the same wherever it is made (the seed is its name).
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import tempfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import combinations
from math import inf, pi
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
CYCLE, FINE = 1e-3, 1e-3 / 16  # position cycle and rows of axis.c [s]
PITCHES = (5.0, 10.0, 12.0, 16.0, 20.0, 25.0)  # mm
TOP, RPM = 20000.0, 3000.0  # highest speeds [mm/min], [1/min]
# Amplitude [um], frequency [Hz], periods: what docs/identification.md asks for, in 14 s.
SINES = ((200.0, 1.0, 4), (100.0, 2.0, 6), (20.0, 5.0, 12), (5.0, 10.0, 24), (500.0, 5.0, 8))


@dataclass(frozen=True)
class Flaw:
    """An imperfection of a log.

    Attributes:
        words: one of them in a warning names the cause.
        against: names of flaws that it does not go together with.
        wrong: nothing of such a log may be offered as a result.
    """

    words: tuple[str, ...]
    against: tuple[str, ...] = ()
    wrong: bool = False


FLAWS: Mapping[str, Flaw] = {
    "position_only_1um": Flaw(("resolution", "steps of", "digits", "delay")),
    "no_slow_speeds": Flaw(("slow", "mm/min", "extrapolat", "lowest speed", "low speeds")),
    "strokes_only": Flaw(("sine", "small moves", "pre-sliding", "reversal"), ("sines_only",)),
    "sines_only": Flaw(("constant speed", "plateau", "strokes"), ("no_slow_speeds", "one_way")),
    "clipped": Flaw(("clip", "cut off", "flat top", "saturat")),
    "warms_5": Flaw(("warm", "drift", "temperature", "repeat"), ("warms_30",)),
    "warms_30": Flaw(("warm", "drift", "temperature", "repeat")),
    "one_way": Flaw(("one direction", "both directions", "one way"), ("no_slow_speeds",)),
    "wrong_time": Flaw(("unit", "time", "interval"), ("wrong_length",), wrong=True),
    "wrong_length": Flaw(("unit", "length", "pitch"), wrong=True),
}


@dataclass(frozen=True, eq=False)
class Log:
    """A log as files, and what is true of its axis.

    Attributes:
        name: of flaws and number; seed of all that is drawn.
        flaws: names of FLAWS.
        words: what was drawn, to be read by people.
        files: the traces; mapping: of their columns.
        inertia: what a user says of it [kg.m2]; None: nothing. delay: the same [s].
        truth: name -> value in SI, seen by the motor.
    """

    name: str
    flaws: tuple[str, ...]
    words: str
    files: tuple[Path, ...]
    mapping: Path
    inertia: float | None
    delay: float | None
    truth: Mapping[str, float]


@dataclass(frozen=True)
class Axis:
    """Axis and drive, in the order of axis.c."""

    J: float
    F_C: float
    F_S: float
    v_s: float
    F_log: float
    v_log: float
    sigma_0: float
    sigma_1: float
    sigma_2: float
    W: float
    gamma: float
    M_0: float
    warm: float
    begun: float
    span: float
    K_v: float
    K_p: float
    T_n: float
    lag: float
    limit: float
    pitch: float = field(default=20.0)  # mm; not of axis.c, which counts in angles

    @property
    def numbers(self) -> list[str]:
        """Arguments of the program."""
        return [repr(value) for value in list(vars(self).values())[:-1]]


@dataclass(frozen=True)
class Sampling:
    """How a log is taken."""

    interval: float  # s
    resolution: float  # of the position [m]
    noise: float  # of the torque, as a share of its RMS without the weight
    delay: float  # of the torque [s]
    speed: bool  # whether the motor's speed is logged


@cache
def program() -> Path:
    """axis.c, compiled."""
    compiler = shlex.split(os.environ.get("CC", "cc"))
    folder = ROOT / "build" / "benchmarks"
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder) as work:
        made = Path(work) / "axis"
        subprocess.run([*compiler, "-O2", "-std=c99", "-o", made, ROOT / "benchmarks" / "axis.c", "-lm"], check=True)
        shutil.move(made, folder / "axis")
    return folder / "axis"


def driven(axis: Axis, setpoints: Floats) -> tuple[Floats, Floats, Floats]:
    """Angle [rad], speed [rad/s] and motor torque [N.m] every FINE seconds; setpoints: [rad] at every CYCLE."""
    done = subprocess.run(
        [program(), *axis.numbers], input=np.ascontiguousarray(setpoints).tobytes(), capture_output=True, check=True
    )
    rows = np.frombuffer(done.stdout, dtype=np.float64).reshape(-1, 3)
    return rows[:, 0], rows[:, 1], rows[:, 2]


def strokes(speeds: Sequence[tuple[float, float]], acceleration: float, rise: float, least: float) -> Floats:
    """Setpoint [m] at every CYCLE of strokes there and back: (speed there, speed back) in m/s, both positive.

    acceleration [m/s2], smoothed over `rise` [s]; least: travel at constant speed [m], over 0.6 s and more.
    """
    parts = [np.zeros(300)]
    for pair in speeds:
        length = max(least, (0.6 if pair[0] == pair[1] else 0.4) * max(pair))  # what the faster way needs
        for side, speed in zip((1.0, -1.0), pair, strict=True):
            ramp = max(round(speed / acceleration / CYCLE), 1)
            up = np.arange(1, ramp + 1) / ramp
            # Both ways are as long: the axis comes back.
            hold = max(round((length - speed * ramp * CYCLE) / speed / CYCLE), 100)
            parts.append(side * speed * np.concatenate([up, np.ones(hold), up[::-1], np.zeros(250)]))
    speed_ = np.concatenate(parts)
    window = np.ones(max(round(rise / CYCLE), 1))
    return np.cumsum(np.convolve(speed_, window / len(window))) * CYCLE


def sines(moves: Sequence[tuple[float, float, int]]) -> Floats:
    """Setpoint [m] at every CYCLE of (amplitude [um], frequency [Hz], periods); the first and last swells and ebbs."""
    parts = [np.zeros(300)]
    for amplitude, frequency, periods in moves:
        t = np.arange(round(periods / frequency / CYCLE)) * CYCLE
        swell = np.minimum(np.minimum(t, t[-1] - t) * frequency, 1.0)
        parts += [1e-6 * amplitude * swell * np.sin(2 * pi * frequency * t), np.zeros(200)]
    return np.concatenate(parts)


def drawn_axis(rng: np.random.Generator, weight: bool) -> Axis:
    """An axis with its drive."""

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    pitch = float(rng.choice(PITCHES))
    I_P = 1e-3 * pitch / (2 * pi)
    J = between(0.004, 0.1)
    F_C = between(0.6, 4.0)
    F_S = F_C * rng.uniform(1.15, 1.5)
    deflection = between(10e-6, 30e-6) / I_P  # at break-away [rad]
    sigma_0 = F_S / deflection
    return Axis(
        J=J,
        F_C=F_C,
        F_S=F_S,
        v_s=between(1e-3, 4e-3) / I_P,
        F_log=F_C * rng.uniform(0.1, 0.35),
        v_log=3.0,
        sigma_0=sigma_0,
        sigma_1=sigma_0 * between(1.5e-3, 4e-3),
        sigma_2=F_C * between(0.1, 0.6) / (1e-3 * TOP / 60 / I_P),
        W=deflection * rng.uniform(4.0, 7.0),
        gamma=rng.uniform(0.3, 0.6),
        M_0=F_C * rng.uniform(0.5, 4.0) * float(rng.choice((-1.0, 1.0))) if weight else 0.0,
        warm=0.0,
        begun=0.0,
        span=60.0,
        K_v=rng.uniform(1.5, 4.0) / 60e-3,
        K_p=J * 2 * pi * rng.uniform(30, 60),
        T_n=rng.uniform(0.01, 0.02),
        lag=rng.uniform(0.25e-3, 0.6e-3),
        limit=inf,
        pitch=pitch,
    )


def made(name: str, flaws: Sequence[str], folder: Path) -> Log:
    """The log of that name, whose files are written to the folder."""
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    folder.mkdir(parents=True, exist_ok=True)
    weight = "one_way" in flaws or bool(rng.random() < 0.4)
    axis = drawn_axis(rng, weight)
    sampling = Sampling(
        interval=float(rng.choice((1e-3, 2e-3, 4e-3), p=(0.3, 0.5, 0.2))),
        resolution=float(rng.choice((10e-9, 100e-9, 1e-6), p=(0.4, 0.4, 0.2))),
        noise=float(rng.choice((0.0, 0.005, 0.02, 0.05), p=(0.2, 0.3, 0.3, 0.2))),
        delay=float(rng.choice((0.0, rng.uniform(0, 1e-3)))),
        speed=bool(rng.random() < 0.6),
    )
    say_inertia, say_delay = rng.random() < 0.5, rng.random() < 0.3
    if "position_only_1um" in flaws:
        sampling, say_delay = replace(sampling, resolution=1e-6, speed=False), False
    elif not flaws:
        # A good log: what docs/identification.md asks for.
        fine = min(sampling.resolution, 100e-9)
        sampling = replace(sampling, resolution=fine, speed=True, interval=min(sampling.interval, 2e-3))
    moves = _moves(rng, flaws, axis)
    files = max(sum(len(each) for each in moves) * CYCLE, 1.0)
    if "warms_5" in flaws or "warms_30" in flaws:
        axis = replace(axis, warm=0.05 if "warms_5" in flaws else 0.30)
    rows, begun = [], 0.0
    for setpoint in moves:
        own = replace(axis, begun=begun, span=files)
        begun += len(setpoint) * CYCLE
        rows.append(_sampled(rng, own, setpoint, sampling))
    if "clipped" in flaws:
        # What the log's range or the drive's display cuts off; the axis itself got all of it.
        largest = max(float(np.max(np.abs(each["torque"]))) for each in rows)
        friction = axis.F_C + abs(axis.M_0)
        level = friction + rng.uniform(0.02, 0.6) * max(largest - friction, 0.0)
        rows = [each | {"torque": np.clip(each["torque"], -level, level)} for each in rows]
    units = {"t": "s", "x": "mm", "n": "rpm", "s": "mm"}
    _wrong(rng, flaws, units)
    paths = tuple(_written(folder / f"{name}_{k}.csv", each, units, sampling) for k, each in enumerate(rows))
    mapping = folder / f"{name}.yaml"
    mapping.write_text(_mapping(axis, sampling), encoding="utf-8")
    truth = {key: getattr(axis, key) for key in ("F_C", "F_S", "v_s", "F_log", "sigma_2", "sigma_0", "sigma_1")}
    truth |= {"W": axis.W, "gamma": axis.gamma, "asymmetry": 0.0, "M_0": axis.M_0, "J": axis.J}
    words = (
        f"{1e3 * sampling.interval:g} ms, {1e9 * sampling.resolution:g} nm, noise {100 * sampling.noise:g} %, "
        f"delay {1e3 * sampling.delay:.2g} ms{' said' if say_delay else ''}, "
        f"{'speed' if sampling.speed else 'position only'}"
        f"{', inertia said' if say_inertia else ''}{', weight' if weight else ''}, pitch {axis.pitch:g} mm, "
        f"units {' '.join(units.values())}, {files:.0f} s"
    )
    return Log(
        name,
        tuple(flaws),
        words,
        paths,
        mapping,
        axis.J if say_inertia else None,
        sampling.delay if say_delay else None,
        truth | {"delay": sampling.delay},
    )


def _moves(rng: np.random.Generator, flaws: Sequence[str], axis: Axis) -> list[Floats]:
    """Setpoints [m] of the files, one after the other."""
    top = min(TOP, RPM * axis.pitch) / 60e3  # m/s
    acceleration, rise = rng.uniform(1.0, 3.0), rng.uniform(0.04, 0.1)
    moves = []
    if "one_way" in flaws:
        # Up fast, down slowly: the strokes of a vertical axis, a file each; a few slow ones both ways.
        for _ in range(3):
            fast = [(speed, 5.83e-3 * rng.uniform(1.0, 3.0)) for speed in rng.uniform(0.4, 1.0, 2) * top]
            moves.append(strokes(fast, acceleration, rise, 0.02))
    elif "sines_only" not in flaws:
        lowest = 500.0 if "no_slow_speeds" in flaws else 10.0
        speeds = np.geomspace(lowest / 60e3, top, 10)
        moves.append(strokes([(speed, speed) for speed in speeds], acceleration, rise, 0.4e-3))
    if "strokes_only" not in flaws and ("one_way" not in flaws or rng.random() < 0.5):
        moves.append(sines(SINES))
    return moves


def _sampled(rng: np.random.Generator, axis: Axis, setpoint: Floats, sampling: Sampling) -> dict[str, Floats]:
    """What a control logs of a motion: time [s], position and setpoint [m], speed [rad/s], torque [N.m]."""
    I_P = 1e-3 * axis.pitch / (2 * pi)
    angle, speed, torque = driven(axis, setpoint / I_P)
    fine = np.arange(len(angle)) * FINE
    count = int((fine[-1] - 2e-3) / sampling.interval)
    t = np.arange(count) * sampling.interval + 2e-3  # a delay reaches back to no row
    late = np.interp(t - sampling.delay, fine, torque)
    size = float(np.std(torque - axis.M_0))
    step = 60 / 2**20  # rpm: of a usual encoder's speed
    rows = np.rint(t / FINE).astype(int)
    return {
        "t": np.arange(count) * sampling.interval,
        "x": np.rint(angle[rows] * I_P / sampling.resolution) * sampling.resolution,
        "s": np.interp(t, np.arange(len(setpoint)) * CYCLE, setpoint),
        "n": np.rint(speed[rows] / step) * step,
        "torque": late + sampling.noise * size * rng.standard_normal(count),
    }


# Values per SI unit.
FACTORS: Mapping[str, float] = {"s": 1.0, "ms": 1e3, "us": 1e6, "m": 1.0, "mm": 1e3, "um": 1e6}


def _wrong(rng: np.random.Generator, flaws: Sequence[str], units: dict[str, str]) -> None:
    """Draw the unit that the header says: `said` in place of the one that the values are in."""
    if "wrong_time" in flaws:
        units["t"] = str(rng.choice(("s<ms", "s<us", "ms<s")))
    if "wrong_length" in flaws:
        units["x"] = units["s"] = str(rng.choice(("m<mm", "mm<m", "mm<um", "um<mm")))


def _written(path: Path, rows: Mapping[str, Floats], units: Mapping[str, str], sampling: Sampling) -> Path:
    """The CSV file: header and values, in the units said."""
    names = {"t": "t", "x": "actual position", "s": "position setpoint", "n": "actual speed", "torque": "actual torque"}
    chosen = ["t", "x", "s", *(["n"] if sampling.speed else []), "torque"]
    header, columns = [], []
    for key in chosen:
        said, _, real = (units.get(key) or "N.m").partition("<")
        factor = FACTORS[real or said] if key in ("t", "x", "s") else 30 / pi if key == "n" else 1.0
        header.append(f"{names[key]} [{said}]")
        columns.append(rows[key] * factor)
    np.savetxt(path, np.column_stack(columns), "%.10g", ",", header=",".join(header), comments="")
    return path


def _mapping(axis: Axis, sampling: Sampling) -> str:
    lines = ["axis: Z", "time: {column: t}", "position: {column: actual position}"]
    lines += ["speed: {column: actual speed}"] if sampling.speed else []
    lines += ["torque: {column: actual torque}", "setpoint: {column: position setpoint}", f"pitch: {axis.pitch:g} mm"]
    return "\n".join(lines) + "\n"


def names(total: int = 320) -> list[tuple[str, tuple[str, ...]]]:
    """Name and flaws of every log: good ones, each flaw alone, and pairs."""
    pairs = [
        pair
        for pair in combinations(FLAWS, 2)
        if pair[1] not in FLAWS[pair[0]].against and pair[0] not in FLAWS[pair[1]].against
    ]
    kinds: list[tuple[tuple[str, ...], int]] = [((), 40)]
    kinds += [((flaw,), 12) for flaw in FLAWS]
    wrong = [pair for pair in pairs if any(FLAWS[flaw].wrong for flaw in pair)]
    kinds += [(pair, 2) for pair in wrong]
    others = [pair for pair in pairs if pair not in wrong]
    each, more = divmod(total - sum(count for _, count in kinds), len(others))
    kinds += [(pair, each + (k < more)) for k, pair in enumerate(others)]
    return [
        ("+".join(flaws) + f"-{k}" if flaws else f"good-{k}", flaws) for flaws, count in kinds for k in range(count)
    ]
