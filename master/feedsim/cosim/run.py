"""Run a scenario on the units: plan the motion, build the system, exchange at the control cycle, record."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim.cosim import wiring
from feedsim.cosim.schedule import SCHEMES, Cycle
from feedsim.cosim.system import System
from feedsim.cosim.unit import Floats, Log
from feedsim.errors import InputError
from feedsim.nc import Program, plan
from feedsim.scenario import Scenario
from feedsim.structure import Modes, checked_modes
from feedsim.trace import Trace, matching

Progress = Callable[[int, int], None]

CONTROLLER_SIGNALS = (
    "M_a", "x_e", "n_s", "n_ref", "M_s", "i_d", "i_q", "u_d", "u_q", "torque_limited", "voltage_limited",
)  # fmt: skip
FRICTION_SIGNALS = ("M_fr", "z", "c", "k", "lambda")
PLANT_SIGNALS = ("x_a", "n_a")
# Of the friction work, and J (an axis at rest has no work to speak of). On the default machine the first-order schemes
# lose up to 4e-5 of it, the second-order ones 2e-7; chatter loses 1e-3 and more.
TRUSTED_SHARE, TRUSTED_ENERGY = 3e-4, 1e-3
TOOL_SIGNALS = ("tool.x_X", "tool.x_Y", "tool.x_Z", "tcp.x_X", "tcp.x_Y", "tcp.x_Z")


@dataclass(frozen=True)
class Run:
    """What a run leaves behind.

    Attributes:
        trace: recorded signals, columns "X.x_a" ... in SI units.
        coupling: per axis, interface energy residual [J], its peak, and the friction work [J] to hold it against.
        wall_time: duration of the cycle loop [s].
        units: per instance, GUID and version of its archive.
        warnings: what the units warned of.
    """

    scenario: Scenario
    program: Program
    trace: Trace
    coupling: Mapping[str, float]
    wall_time: float
    units: Mapping[str, Mapping[str, str]]
    warnings: tuple[str, ...]


def fmus_directory() -> Path:
    """Folder of the built archives: FEEDSIM_FMUS, else `fmus/` of the checkout this package runs from."""
    named = os.environ.get("FEEDSIM_FMUS")
    return Path(named) if named else Path(__file__).resolve().parents[3] / "fmus"


def run(
    scenario: Scenario,
    *,
    program: Program | None = None,
    fmus: Path | None = None,
    progress: Progress | None = None,
) -> Run:
    """Run `scenario` and return its trace.

    Args:
        program: the scenario's planned motions, where they are at hand already.
        fmus: folder with plant.fmu, controller.fmu, friction.fmu; default :func:`fmus_directory`.
        progress: called now and then with (cycles done, cycles in all).

    Raises:
        InputError: the motion violates a limit, the archives do not fit the machine.
        SimulationError: a unit failed; the message names the unit, the time and the unit's reason.
    """
    program = program or plan(scenario)
    recorded = recorded_columns(scenario)
    modes = checked_modes(scenario.machine)
    cycles = scenario.machine.cycles
    ratio = round(cycles.T_pos / cycles.T_c)
    every = round(scenario.recording.interval / cycles.T_c)
    total = (len(program.time) - 1) * ratio
    with System(scenario.machine, fmus or fmus_directory()) as system:
        cycle = Cycle(system, SCHEMES[scenario.coupling.scheme], cycles.T_c, scenario.coupling.substeps)
        logs = _logs(system, total // every + 1)
        system.initialise(program, stop=total * cycles.T_c)
        begun = time.perf_counter()
        with np.errstate(over="ignore", invalid="ignore"):  # the unit that meets an overflow reports it
            for k in range(total):
                if k % ratio == 0:
                    system.set_setpoints(program, k // ratio)
                if k % every == 0:
                    for log in logs.values():
                        log.record(k // every)
                cycle.run(k)
                if progress is not None and (k + 1) % 512 == 0:
                    progress(k + 1, total)
        if total % every == 0:
            for log in logs.values():
                log.record(total // every)
        if progress is not None:
            progress(total, total)
        wall_time = time.perf_counter() - begun
        return Run(
            scenario=scenario,
            program=program,
            trace=_trace(scenario, system, program, logs, every, ratio).select(recorded),
            coupling=_coupling(system, cycle),
            wall_time=wall_time,
            units={
                name: {"guid": unit.archive.guid, "version": unit.archive.version}
                for name, unit in system.units.items()
            },
            warnings=(
                *system.warnings,
                *_stability_warnings(scenario, modes, cycle),
                *_coupling_warnings(scenario, system, cycle),
                *_limit_warnings(system, logs),
            ),
        )


def check(scenario: Scenario, program: Program, *, fmus: Path | None = None) -> None:
    """Let the units judge their parameters, without a step.

    Raises:
        InputError: what :func:`run` would refuse before its first step.
    """
    recorded_columns(scenario)
    checked_modes(scenario.machine)
    with System(scenario.machine, fmus or fmus_directory()) as system:
        system.initialise(program, stop=float(program.time[-1]))


def recorded_columns(scenario: Scenario) -> list[str]:
    """Columns of the trace that a run of `scenario` will leave.

    Raises:
        InputError: an entry of recording.variables matches none.
    """
    names = [
        f"{axis}.{signal}"
        for axis in scenario.machine.axes
        for signal in (*wiring.SETPOINT_UNITS, *PLANT_SIGNALS, *CONTROLLER_SIGNALS, *FRICTION_SIGNALS)
    ]
    names += TOOL_SIGNALS
    if scenario.recording.variables is None:
        return names
    try:
        return matching(names, scenario.recording.variables)
    except InputError as error:
        raise InputError(f"{scenario.file}: recording.variables: {error}") from None


def _logs(system: System, rows: int) -> dict[str, Log]:
    plant = [f"{axis}.{signal}" for axis in system.axes for signal in PLANT_SIGNALS] + list(TOOL_SIGNALS)
    logs = {wiring.PLANT: Log(system.plant, plant, rows)}
    for axis in system.axes:
        for name, signals in ((wiring.controller(axis), CONTROLLER_SIGNALS), (wiring.friction(axis), FRICTION_SIGNALS)):
            logs[name] = Log(system.units[name], signals, rows)
    return logs


def _trace(
    scenario: Scenario, system: System, program: Program, logs: Mapping[str, Log], every: int, ratio: int
) -> Trace:
    plant = logs[wiring.PLANT]
    cycle = np.arange(len(plant.reals)) * every
    position_cycle = cycle // ratio
    columns: dict[str, Floats] = {}
    units: dict[str, str] = {}
    for axis in system.axes:
        for setpoint, values in (("x_s", program.x_s), ("n_ffw", program.n_ffw)):
            columns[f"{axis}.{setpoint}"] = values[axis][position_cycle]
            units[f"{axis}.{setpoint}"] = wiring.SETPOINT_UNITS[setpoint]
        for signal in PLANT_SIGNALS:
            columns[f"{axis}.{signal}"] = plant.columns()[f"{axis}.{signal}"]
            units[f"{axis}.{signal}"] = plant.unit.archive.unit_of(f"{axis}.{signal}")
        for name in (wiring.controller(axis), wiring.friction(axis)):
            for signal, column in logs[name].columns().items():
                columns[f"{axis}.{signal}"] = column
                units[f"{axis}.{signal}"] = logs[name].unit.archive.unit_of(signal)
    for signal in TOOL_SIGNALS:
        columns[signal] = plant.columns()[signal]
        units[signal] = plant.unit.archive.unit_of(signal)
    time = np.asarray(cycle * scenario.machine.cycles.T_c, dtype=np.float64)
    return Trace(time=time, columns=columns, units=units)


def _coupling(system: System, cycle: Cycle) -> dict[str, float]:
    coupling: dict[str, float] = {}
    for i, axis in enumerate(system.axes):
        coupling[f"{axis}.residual"] = float(cycle.residual[i])
        coupling[f"{axis}.residual_peak"] = float(cycle.residual_peak[i])
        coupling[f"{axis}.friction_work"] = float(cycle.dissipated[i])
    return coupling


def _stability_warnings(scenario: Scenario, modes: Modes, cycle: Cycle) -> list[str]:
    """Explicit exchange needs a friction slope well below 2 J_inf/h (Kuebler and Schiehlen's zero-stability)."""
    warnings = []
    for name, axis in scenario.machine.axes.items():
        slope, bound = axis.friction.sigma_1 + axis.friction.sigma_2, 2 * modes.J_inf(name) / cycle.step
        if slope > cycle.scheme.stable_share * bound:
            warnings.append(
                f"axis {name}: sigma_1 + sigma_2 = {slope:.4g} N.m.s/rad is above "
                f"{cycle.scheme.stable_share * bound:.4g}, where scheme {cycle.scheme.name} was found to become "
                f"unstable ({cycle.scheme.stable_share:g} of 2 J_inf/h); use more coupling.substeps"
            )
    return warnings


def _limit_warnings(system: System, logs: Mapping[str, Log]) -> list[str]:
    return [
        f"axis {axis}: {flag.replace('_', ' ')} in {100 * share:.2g} % of the recorded instants"
        for axis in system.axes
        for flag in ("torque_limited", "voltage_limited")
        if (share := float(np.mean(logs[wiring.controller(axis)].columns()[flag]))) > 0
    ]


def _coupling_warnings(scenario: Scenario, system: System, cycle: Cycle) -> list[str]:
    return [
        f"axis {axis}: the exchange between plant and friction has lost {residual:.3g} J against {work:.3g} J of "
        f"friction work (scheme {cycle.scheme.name}, exchange step {cycle.step * 1e6:.6g} us): it is unstable or too "
        f"coarse, and the result is not to be trusted; try coupling.substeps above {scenario.coupling.substeps}"
        for axis, residual, work in zip(system.axes, cycle.residual_peak, np.abs(cycle.dissipated), strict=True)
        if residual > max(TRUSTED_SHARE * work, TRUSTED_ENERGY)
    ]
