"""Measure a machine's frequency responses on its units: axis by axis, realisation by realisation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.estimate import measured
from feedsim.cosim.excite import Measurement, measure, usual_rms
from feedsim.nc.excitation import Excitation, binary_sequence, multisine
from feedsim.scenario import Coupling, Machine
from feedsim.trace.response import FrequencyResponse

Signal = Literal["multisine", "prbs"]

FORCES = ("tool.F_X", "tool.F_Y", "tool.F_Z")
LONGEST_REGISTER, SHORTEST_REGISTER = 16, 5
FIRST_ZERO = 0.45  # the band ends at this share of the sequence's first zero: half its amplitude is left there


@dataclass(frozen=True)
class Plan:
    """How to measure.

    Attributes:
        signal: multisine, or pseudo-random binary sequence.
        inject: input of the drive, "n_add" (finds n/M, x/M and n_a/n_s) or "M_add" (finds n/M and x/M).
        rms: of the signal [N.m or rad/s]; None: one that stirs the machine well within its limits.
        band: lowest and highest frequency [Hz].
        periods: recorded of each signal.
        settle: periods ahead of those.
        realisations: signals with other phases.
        seed: of the first; the others follow it.
        friction: with the friction units.
        offset_speed: motor speed at which the excited axis moves [rad/s]; None: it stands.
        tool: measure the compliance at the tool, too.
    """

    signal: Signal = "multisine"
    inject: Literal["n_add", "M_add"] = "n_add"
    rms: float | None = None
    band: tuple[float, float] = (1.0, 1000.0)
    periods: int = 2
    settle: int = 2
    realisations: int = 1
    seed: int = 1
    friction: bool = False
    offset_speed: float | None = None
    tool: bool = True


@dataclass(frozen=True, eq=False)
class Excited:
    """What one input was excited with."""

    reference: str
    unit: str
    rms: float
    peak: float
    lines: int
    period: float  # [s]


@dataclass(frozen=True, eq=False)
class Campaign:
    """Responses measured, with coherence, and how.

    Attributes:
        excited: what every input was excited with.
        wall_time: of all measurements [s].
        simulated: time that they took on the machine [s].
        units: per instance, GUID and version of its archive.
        warnings: a sentence each.
    """

    plan: Plan
    response: FrequencyResponse
    excited: tuple[Excited, ...]
    wall_time: float
    simulated: float
    units: Mapping[str, Mapping[str, str]]
    warnings: tuple[str, ...]


Progress = Callable[[str, int, int], None]


def run_campaign(
    machine: Machine, axes: Sequence[str], plan: Plan, *, fmus: Path | None = None, progress: Progress | None = None,
    call_limit: float = Coupling().call_limit,
) -> Campaign:  # fmt: skip
    """Measure the responses of `axes`, one after the other.

    progress: called with what is being measured, cycles done and cycles in all. call_limit: time [s] after which a call
    of another maker's unit is ended.

    Raises:
        InputError: as cosim.excite.measure: an argument out of range, a limit was met.
        SimulationError: a unit failed.
    """
    columns: dict[str, NDArray[np.complex128]] = {}
    units: dict[str, str] = {}
    coherence: dict[str, NDArray[np.float64]] = {}
    instances: dict[str, Mapping[str, str]] = {}
    frequency, excited, warnings = None, [], []
    wall_time = simulated = 0.0
    for axis, inject, pairs in _inputs(machine, axes, plan):
        measurements = [
            _measure(machine, axis, inject, plan, realisation, fmus, progress, call_limit)
            for realisation in range(plan.realisations)
        ]
        frequency_response = measured(measurements, pairs)
        frequency = frequency_response.frequency
        columns |= frequency_response.columns
        units |= frequency_response.units
        coherence |= frequency_response.coherence
        first = measurements[0]
        excited.append(
            Excited(
                reference=first.reference,
                unit=first.trace.unit(first.reference),
                rms=first.excitation.rms,
                peak=max(m.excitation.peak for m in measurements),
                lines=len(first.excitation.lines),
                period=first.excitation.period,
            )
        )
        instances |= first.units
        warnings += [warning for measurement in measurements for warning in measurement.warnings]
        wall_time += sum(measurement.wall_time for measurement in measurements)
        simulated += sum(float(measurement.trace.time[-1]) for measurement in measurements)
    assert frequency is not None  # there is an axis
    return Campaign(
        plan=plan,
        response=FrequencyResponse(frequency, columns, units, coherence),
        excited=tuple(excited),
        wall_time=wall_time,
        simulated=simulated,
        units=instances,
        warnings=tuple(dict.fromkeys(warnings)),
    )


def signal_of(machine: Machine, plan: Plan, rms: float, seed: int) -> Excitation:
    """The excitation of a plan; that of a binary sequence is clocked fast enough for the band, and long enough."""
    if plan.signal == "multisine":
        return multisine(machine.cycles, rms, band=plan.band, spacing="logarithmic", seed=seed)
    T_c = machine.cycles.T_c
    hold = max(1, math.floor(FIRST_ZERO / (plan.band[1] * T_c)))
    chips = 1 / (plan.band[0] * hold * T_c)  # a period as long as that of the lowest frequency
    stages = min(max(math.ceil(math.log2(chips + 1)), SHORTEST_REGISTER), LONGEST_REGISTER)
    return binary_sequence(machine.cycles, rms, band=plan.band, stages=stages, hold=hold, seed=seed)


def _inputs(machine: Machine, axes: Sequence[str], plan: Plan) -> Iterator[tuple[str, str, list[tuple[str, str]]]]:
    """Axis, input, and the pairs of output and input that its excitation finds."""
    for axis in axes:
        pairs = [(f"{axis}.n_a", f"{axis}.M_a"), (f"{axis}.x_a", f"{axis}.M_a")]
        if plan.inject == "n_add":
            pairs.append((f"{axis}.n_a", f"{axis}.n_s"))
        yield axis, plan.inject, pairs
    if plan.tool:
        for force in FORCES:
            # the axis only says whose limits set the force, and who moves
            axis = force[-1] if force[-1] in machine.axes else axes[0]
            yield axis, force, [(force.replace("F_", "x_"), force)]


def _measure(
    machine: Machine, axis: str, inject: str, plan: Plan, realisation: int, fmus: Path | None,
    progress: Progress | None, call_limit: float,
) -> Measurement:  # fmt: skip
    rms = plan.rms if plan.rms is not None and inject == plan.inject else usual_rms(machine, axis, inject)
    what = inject if inject.startswith("tool.") else f"{axis}.{inject}"

    def tell(done: int, total: int) -> None:
        if progress is not None:
            progress(what if plan.realisations == 1 else f"{what}, realisation {realisation + 1}", done, total)

    return measure(
        machine,
        axis,
        signal_of(machine, plan, rms, plan.seed + realisation),
        inject=inject,
        friction=plan.friction,
        offset_speed=plan.offset_speed,
        periods=plan.periods,
        settle=plan.settle,
        fmus=fmus,
        progress=tell,
        call_limit=call_limit,
    )
