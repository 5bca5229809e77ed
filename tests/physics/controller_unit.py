"""controller.fmu from outside, and the same steps taken by the plain-Python reference."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from controller_reference import DEFAULTS, Cycle, Inputs, drive
from fmpy import calloc, extract, free, read_model_description
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)

INPUTS = tuple(field.name for field in fields(Inputs) if field.name != "release")
LINEAR = ("M_a", "i_d", "i_q")  # outputs that run linearly over a control cycle
SAMPLED = ("x_e", "n_s", "n_ref", "M_s", "u_d", "u_q")  # outputs that belong to the last sample instant
FLAGS = ("torque_limited", "voltage_limited")


class Archive:
    """An unpacked controller.fmu; makes instances."""

    def __init__(self, path: Path) -> None:
        self.description = read_model_description(path)
        self.folder = extract(path)
        self.by_name = {variable.name: variable for variable in self.description.modelVariables}

    def close(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)

    def instance(self) -> Instance:
        return Instance(self)


class Instance:
    """One instance, by variable names. `messages` collects what it logs."""

    def __init__(self, archive: Archive) -> None:
        self.archive = archive
        self.messages: list[str] = []
        self.fmu = FMU2Slave(
            guid=archive.description.guid,
            unzipDirectory=archive.folder,
            modelIdentifier=archive.description.coSimulation.modelIdentifier,
            instanceName="drive",
        )
        self._callbacks = fmi2CallbackFunctions()  # ctypes needs them to stay alive
        self._callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
        self._callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self._callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        self.fmu.instantiate(callbacks=self._callbacks)
        self.inputs = self.references(INPUTS)
        self.reals = self.references((*LINEAR, *SAMPLED))
        self.flags = self.references(FLAGS)
        self.linear = self.references(LINEAR)

    def _log(self, environment: object, name: bytes, status: int, category: bytes, text: bytes) -> None:
        self.messages.append(text.decode())

    def references(self, names: Iterable[str]) -> list[int]:
        return [self.archive.by_name[name].valueReference for name in names]

    def start(
        self, parameters: Mapping[str, float], inputs: Mapping[str, float] | None = None, time: float = 0.0
    ) -> None:
        """From instantiated to step mode."""
        setters: dict[str, tuple[Callable[[list[int], list[Any]], None], Callable[[float], Any]]] = {
            "Real": (self.fmu.setReal, float),
            "Integer": (self.fmu.setInteger, int),
            "Boolean": (self.fmu.setBoolean, bool),
        }
        for name, value in parameters.items():
            setter, kind = setters[self.archive.by_name[name].type]
            setter(self.references([name]), [kind(value)])
        self.fmu.setupExperiment(startTime=time)
        self.fmu.enterInitializationMode()
        if inputs:
            self.set(inputs)
        self.fmu.exitInitializationMode()

    def set(self, values: Mapping[str, float]) -> None:
        self.fmu.setReal(self.references(values), list(values.values()))

    def enable(self, release: bool) -> None:
        self.fmu.setBoolean(self.references(["release"]), [release])

    def get(self, name: str) -> float:
        return float(self.fmu.getReal(self.references([name]))[0])

    def step(self, t: float, h: float, values: Sequence[float], slopes: Sequence[float] | None = None) -> None:
        self.fmu.setReal(self.inputs, values)
        if slopes is not None:
            self.fmu.setRealInputDerivatives(self.inputs, [1] * len(INPUTS), slopes)
        self.fmu.doStep(t, h)

    def outputs(self) -> list[float]:
        """LINEAR, their slopes, SAMPLED, FLAGS."""
        reals = self.fmu.getReal(self.reals)
        slopes = self.fmu.getRealOutputDerivatives(self.linear, [1] * len(LINEAR))
        flags = [float(flag != 0) for flag in self.fmu.getBoolean(self.flags)]
        return [*reals[:3], *slopes, *reals[3:], *flags]

    def close(self) -> None:
        self.fmu.freeInstance()


COLUMNS = (*LINEAR, *(f"d{name}/dt" for name in LINEAR), *SAMPLED, *FLAGS)


@dataclass(frozen=True)
class Signals:
    """Smooth inputs: per input a line and three sines, row order INPUTS. Shapes (6,), (6,), (6, 3) three times."""

    offset: np.ndarray
    slope: np.ndarray
    amplitude: np.ndarray
    omega: np.ndarray
    phase: np.ndarray

    def value(self, t: float) -> list[float]:
        waves = self.amplitude * np.sin(self.omega * t + self.phase)
        return list(self.offset + self.slope * t + waves.sum(axis=1))

    def derivative(self, t: float) -> list[float]:
        waves = self.amplitude * self.omega * np.cos(self.omega * t + self.phase)
        return list(self.slope + waves.sum(axis=1))


def random_signals(seed: int, size: float = 1.0, waves: bool = True) -> Signals:
    """Inputs of a drive at work: positions about 0.1 m with some 10 um between setpoint and scale, speeds of some
    10 rad/s that differ by some rad/s, excitation. `size` scales everything but the positions' offset."""
    rng = np.random.default_rng(seed)
    scale = size * np.array([2e-5, 3.0, 2e-5, 3.0, 1.0, 2.0])
    amplitude = scale[:, None] * rng.uniform(0.2, 1.0, (6, 3)) * (1.0 if waves else 0.0)
    slope = scale * rng.uniform(-5.0, 5.0, 6)
    offset = np.array([0.1, 26.0 * size, 0.1, 26.0 * size, 0.0, 0.0]) + scale * rng.uniform(-1.0, 1.0, 6)
    return Signals(offset, slope, amplitude, rng.uniform(20.0, 1500.0, (6, 3)), rng.uniform(0.0, 6.3, (6, 3)))


def compare(
    archive: Archive,
    parameters: Mapping[str, float],
    signals: Signals,
    steps: Iterable[Fraction],
    *,
    with_slopes: bool = True,
    start_time: float = 0.0,
    released: Callable[[int], bool] = lambda step: True,
) -> tuple[np.ndarray, np.ndarray]:
    """Take `steps` [T_c] with the unit and with the reference; return what both show at their ends, (steps, COLUMNS).

    At an instant t_k the drive sees value(t) + slope(t) (t_k - t) of the communication point t ahead of it; the
    reference gets those very numbers. Positions in time are fractions of T_c, so that no rounding decides where an
    instant belongs. `released`: number of a step -> controller enable in it.
    """
    p = {**DEFAULTS, **parameters}
    T_c = p["T_c"]
    reference = drive(p)
    cycle: Cycle = next(reference)
    unit = archive.instance()
    try:
        unit.start(parameters, dict(zip(INPUTS, signals.value(0.0), strict=True)), start_time)
        at = Fraction(0)
        instant = 0
        seen, expected = [], []
        for number, step in enumerate(steps):
            release = released(number)
            unit.enable(release)
            t = float(at) * T_c
            values = signals.value(t)
            slopes = signals.derivative(t) if with_slopes else [0.0] * len(INPUTS)
            unit.step(start_time + t, float(step) * T_c, values, slopes if with_slopes else None)
            while instant < at + step:
                ahead = float(instant - at) * T_c
                given = (v + s * ahead for v, s in zip(values, slopes, strict=True))
                cycle = reference.send(Inputs(*given, release=release))
                instant += 1
            at += step
            share = float(at - (instant - 1))
            ends = [getattr(cycle, name) for name in LINEAR]
            seen.append(unit.outputs())
            expected.append(
                [
                    *(left + share * (right - left) for left, right in ends),
                    *((right - left) / T_c for left, right in ends),
                    *(getattr(cycle, name) for name in SAMPLED),
                    *(float(getattr(cycle, name)) for name in FLAGS),
                ]
            )
    finally:
        unit.close()
    return np.array(seen), np.array(expected)
