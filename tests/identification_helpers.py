"""An identification as the report and the command see it, made without identifying: the true values, with a scatter."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.estimation.identify import IdentifiedFriction, parameters
from feedsim.estimation.identify.read import Provenance
from feedsim.estimation.identify.record import Array, Record
from feedsim.estimation.identify.result import (
    Balance,
    Correlation,
    Drift,
    Dynamic,
    Estimate,
    Identification,
    Plateau,
    Stationary,
    Stretch,
)
from feedsim.files.trace import Trace
from feedsim.foundation.errors import Finding
from feedsim.scenario import load_subject
from scenario_helpers import MACHINE

I_P = 0.02 / (2 * pi)
M_0, J = 0.25, 0.0164
TRUE: dict[str, tuple[float, str, float]] = {  # value, unit, relative standard deviation
    "F_C": (1.6, "N.m", 0.0014), "F_S": (2.1, "N.m", 0.001), "v_s": (0.6, "rad/s", 0.011), "beta": (1.0, "1", np.nan),
    "F_log": (0.4, "N.m", 0.005), "v_log": (3.0, "rad/s", np.nan), "sigma_2": (0.006, "N.m.s/rad", 0.012),
    "asymmetry": (0.02, "1", 0.05), "sigma_0": (300.0, "N.m/rad", 0.003), "sigma_1": (0.8, "N.m.s/rad", 0.034),
    "W": (0.04, "rad", 0.0026), "gamma": (0.35, "1", 0.0085), "M_0": (M_0, "N.m", 0.01), "J": (J, "kg.m^2", np.nan),
    "delay": (0.5e-3, "s", 0.24),
}  # fmt: skip
STATIONARY = ("F_C", "F_S", "v_s", "beta", "F_log", "v_log", "sigma_2", "asymmetry", "M_0")
DYNAMIC = ("sigma_0", "sigma_1", "W", "gamma", "delay")


def estimates() -> dict[str, Estimate]:
    found = {
        name: Estimate(name, value, unit, f"meaning of {name}", relative * value)
        for name, (value, unit, relative) in TRUE.items()
    }
    for name, reason in (("beta", "usual value"), ("v_log", "only the ratio to F_log would be seen")):
        found[name] = replace(found[name], status="held", reason=reason)
    found |= {
        name: parameters.estimate(name, parameters.NO_EFFECT[name], status="held")
        for name in parameters.FIXED_PARAMETERS
        if name in TRUE
    }
    found["J"] = replace(found["J"], status="given", reason="of the machine's modes")
    return found


def curve(speed: Array) -> Array:
    F_C, F_S, v_s, F_log, v_log, sigma_2 = (TRUE[n][0] for n in ("F_C", "F_S", "v_s", "F_log", "v_log", "sigma_2"))
    return np.asarray(
        F_C + (F_S - F_C) * np.exp(-np.abs(speed) / v_s) + F_log * np.log1p(np.abs(speed) / v_log) + sigma_2 * speed
    )


def correlation(names: tuple[str, ...], seed: int) -> Correlation:
    random = np.random.default_rng(seed)
    root = random.normal(size=(len(names), len(names) + 3))
    covariance = root @ root.T
    spread = np.sqrt(np.diag(covariance))
    return Correlation(names, covariance / np.outer(spread, spread))


def records() -> tuple[Record, ...]:
    """Strokes at twelve speeds in both directions, and sines."""
    random = np.random.default_rng(1)
    feeds = np.geomspace(10, 20000, 12) / 60e3 / I_P
    speed = np.concatenate([np.concatenate([np.full(500, s * n), np.zeros(100)]) for n in feeds for s in (1, -1)])
    viscous, asymmetry = TRUE["sigma_2"][0] * speed, TRUE["asymmetry"][0]
    static = np.sign(speed) * curve(np.abs(speed)) - viscous
    torque = static * (1 + asymmetry * np.sign(speed)) + viscous + M_0 + 0.06 * random.normal(size=len(speed))
    plain = Record("constant.csv", np.arange(len(speed)) * 2e-3, torque, speed=speed)
    time = np.arange(3000) * 2e-3
    angle = 20e-6 / I_P * np.sin(2 * pi * 5 * time)
    sines = Record("sine.csv", time, 0.02 * random.normal(size=len(time)), angle=angle)
    return plain, sines


def stationary(found: dict[str, Estimate]) -> Stationary:
    record = records()[0]
    plateaus = []
    for k in range(24):
        rows = slice(600 * k + 50, 600 * k + 450)
        n, M = float(record.speed[rows].mean()), float(record.torque[rows].mean())  # type: ignore[index]
        plateaus.append(Plateau(record.name, record.time[rows][0], record.time[rows][-1], n, M, 0.003, 400))
    speeds = np.geomspace(plateaus[0].speed, plateaus[-2].speed, 200)
    own = {name: found[name] for name in STATIONARY}
    names = tuple(name for name in STATIONARY if own[name].status == "estimated")
    between = correlation(names, 3)
    return Stationary(
        tuple(plateaus), own, between, between.matrix, 0 * between.matrix, speeds, curve(speeds),
        0.004 * (1 + 0.3 * np.cos(speeds)),
        (float(speeds[0]), float(speeds[-1])), 0.003, 0.004,
    )  # fmt: skip


def stretch(amplitude: float, frequency: float, begin: float) -> Stretch:
    random = np.random.default_rng(int(frequency))
    time = begin + np.arange(600) * 2e-3
    angle = amplitude / I_P * np.sin(2 * pi * frequency * (time - begin))
    speed = np.gradient(angle, 2e-3)
    model = 2.0 * np.tanh(3 * angle / 0.04) + 0.3 * np.tanh(speed)
    measured = model + 0.06 * random.normal(size=len(time))
    return Stretch("sine.csv", "sine", time, angle, speed, measured, model, amplitude / I_P, frequency, 0.06)


def dynamic(found: dict[str, Estimate]) -> Dynamic:
    moves = ((5e-6, 10.0), (20e-6, 5.0), (100e-6, 2.0), (200e-6, 1.0))
    stretches = tuple(stretch(a, f, 1.5 * k) for k, (a, f) in enumerate(moves))
    own = {name: found[name] for name in DYNAMIC}
    between = correlation(DYNAMIC, 4)
    return Dynamic(
        stretches, own, between, between.matrix, 0.06, {"sigma_1": 0.011},
        advice=("sigma_1 and the delay trade against each other: add a sine of 2 um at 20 Hz",),
    )  # fmt: skip


def balance(applied: bool = True, reason: str = "") -> Balance:
    """F_C 4 % and M_0 0.01 N.m on the way to the true values: the position gains, the torque loses 2 %."""
    time = np.arange(400) * 0.02
    before = 2.0 * (time / time[-1]) ** 2
    drift = Drift("move.csv", time, 30 * np.sin(time), before, 0.1 * before)
    rms = float(np.sqrt(np.mean(before**2)))
    found = estimates()
    return Balance(
        found, applied, reason, ("move.csv",), (rms, 0.1 * rms), (0.05, 0.051),
        {"F_C": (1.6 / 0.96, 1.6), "F_S": (2.1 / 0.96, 2.1), "M_0": (0.24, 0.25)}, (drift,),
    )  # fmt: skip


def identification(**changes: Any) -> Identification:
    found = estimates()
    names = tuple(name for name, each in found.items() if each.status == "estimated")
    whole = Identification(
        "Z", I_P, found, correlation(names, 5), stationary(found), dynamic(found),
        (Finding("parameter-uncertain", "doubt", "sigma_1 is known to 6.7 % only", "sigma_1"),),
        ("add a sine of 2 um at 20 Hz",),
        {"stage 1": 0.4, "stage 2": 2.5},
        {"J": replace(found["J"], sigma=1e-4, status="estimated"), "F_C": replace(found["F_C"], value=1.9)},
    )  # fmt: skip
    return replace(whole, **changes)


def provenance(file: Path | str = "sine.csv", **changes: Any) -> Provenance:
    return replace(
        Provenance(
            Path(file), "ab" * 32, "Z", {"time": "time", "speed": "Z.n_a", "current": "Z.i_q"}, pitch=0.02,
            torque_constant=2.0,
        ),
        **changes,
    )  # fmt: skip


def identified(**changes: Any) -> IdentifiedFriction:
    sources = (provenance("constant.csv"), provenance("sine.csv"))
    whole = IdentifiedFriction(
        identification(), records(), sources, load_subject(MACHINE), {"hold": "beta=1"}, "2026-01-31"
    )
    return replace(whole, **changes)


def log_of(law: Any, axis: str, angle: Array, interval: float, noise: float = 0.0) -> Trace:
    """What a control would log of a rigid axis that follows `angle` [rad] exactly, with K_t = 2 N.m/A; sampled fourfold
    coarser."""
    speed = np.gradient(angle, interval, edge_order=2)
    parameters = {name: value for name, (value, _, _) in TRUE.items() if name not in ("M_0", "J", "delay")}
    torque = law(parameters, speed, interval) + J * np.gradient(speed, interval, edge_order=2) + M_0
    torque += noise * np.random.default_rng(7).normal(size=len(torque))
    rows = slice(None, None, 4)
    columns = {f"{axis}.x_a": 0.1 + angle[rows] * I_P, f"{axis}.n_a": speed[rows], f"{axis}.i_q": torque[rows] / 2.0}
    units = {f"{axis}.x_a": "m", f"{axis}.n_a": "rad/s", f"{axis}.i_q": "A"}
    return Trace(np.arange(len(angle))[rows] * interval, columns, units)


def strokes(speeds: Array, interval: float = 5e-4) -> Array:
    """Angle [rad] of strokes there and back at constant speeds [rad/s], with smooth starts, and rests between."""
    parts = []
    for speed in speeds:
        length = 1.0 + 0.3 / float(speed)
        for sign in (1, -1):
            ramp = 0.5 - 0.5 * np.cos(np.linspace(0, pi, round(0.15 / interval)))
            hold = np.ones(round(length / interval))
            parts += [sign * speed * np.concatenate([ramp, hold, ramp[::-1]]), np.zeros(round(0.2 / interval))]
    return np.asarray(np.cumsum(np.concatenate(parts)) * interval)


def sines(moves: tuple[tuple[float, float, int], ...], interval: float = 5e-4) -> Array:
    """Angle [rad] of faded sines (amplitude at the slide [m], frequency [Hz], periods), with rests between."""
    parts = [np.zeros(round(0.2 / interval))]
    for amplitude, frequency, periods in moves:
        turns = np.arange(round(periods / frequency / interval)) * interval * frequency
        fade = np.clip(np.minimum(turns, periods - turns), 0, 1) ** 3
        fade = fade * (10 - 15 * np.cbrt(fade) + 6 * np.cbrt(fade) ** 2)
        parts += [amplitude / I_P * fade * np.sin(2 * pi * turns), np.zeros(round(0.3 / interval))]
    return np.asarray(np.concatenate(parts))
