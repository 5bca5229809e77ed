"""Measure a machine's frequency responses on its units: axis by axis, realisation by realisation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from feedsim.files.trace import Trace
from feedsim.files.trace.response import FrequencyResponse, quotient_unit
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.installation import fmus_directory
from feedsim.foundation.parallel import in_parallel
from feedsim.scenario import Coupling, Machine
from feedsim.simulation.cosim.exchange import any_foreign
from feedsim.simulation.cosim.excitation import Excitation, binary_sequence, multisine
from feedsim.simulation.cosim.excite import Measurement, measure, usual_rms

# --- Frequency responses and coherence from time series ---------------------------------------------------------------
# With output y, input u and, in a closed loop, the excitation r that is independent of all disturbances, cross
# spectra
# S_ab = sum of A B* over blocks of the record (A, B: their discrete Fourier transforms):
#     joint    H = S_yr / S_ur     unbiased in closed loop, since disturbances are not correlated with r
#     H1       H = S_yu / S_uu     right where u is free of noise and feedback; in a loop, noise pulls it to
#   -1/control
#     coherence of a with b: gamma^2 = |S_ab|^2 / (S_aa S_bb)
# Where u is r itself, both are the same. The coherence given with a joint estimate is the lower one of (y, r) and (u,
# r):
# a response is known only where the excitation reaches both ends of it.
# Periodic excitation: blocks are whole periods, the excited lines alone are evaluated, nothing leaks. Noise averages
# out
# over periods; what non-linearity makes of the excitation is the same in every period and averages out over
# realisations
# (other phases). Coherence needs two blocks at least; of m blocks, two unrelated signals show 1/m on average.
# Sources: J. Bendat, A. Piersol, Random Data, 4th ed., Wiley 2010, chapters 5, 6 and 9 (H1, coherence, their errors);
# P. Wellstead, Non-parametric methods of spectral analysis, Automatica 17 (1981) 55-69 (joint estimate); R. Pintelon,
# J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., Wiley 2012, chapters 2 and 4 (periodic).


Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Pair = tuple[str, str]  # columns of output and input

EVEN_STEP_SHARE = 1e-6  # of a step: rounding of recorded times
LINE_ROUNDING = 1e-13  # of the largest value: lines below it are rounding, not response


def estimate_responses(measurements: Sequence[Measurement], pairs: Sequence[Pair]) -> FrequencyResponse:
    """Responses from one or several measurements of one machine with excitations of the same lines.

    Raises:
        InputError: as :func:`periodic`, and measurements that do not go together.
    """
    if not measurements:
        raise InputError("no measurement to estimate a frequency response from")
    first = measurements[0]
    for other in measurements[1:]:
        if other.reference != first.reference:
            raise InputError(f"measurements excited at {first.reference} and at {other.reference} cannot be averaged")
        if len(other.excitation.samples) != len(first.excitation.samples) or not np.array_equal(
            other.excitation.lines, first.excitation.lines
        ):
            raise InputError("measurements with other excited lines cannot be averaged")
    return periodic(
        [measurement.trace for measurement in measurements],
        pairs,
        reference=first.reference,
        rows=len(first.excitation.samples),
        lines=first.excitation.lines,
    )


def periodic(
    traces: Sequence[Trace], pairs: Sequence[Pair], *, reference: str, rows: int, lines: NDArray[np.int64]
) -> FrequencyResponse:
    """Responses at the excited lines of a periodic, steady record.

    Args:
        traces: realisations, each of whole periods at an even step.
        pairs: output and input columns; the response is called "output/input".
        reference: column of the excitation; the input itself makes the joint estimate H1.
        rows: of a period.
        lines: (K,) excited harmonics of the period, ascending.

    A trace's linear drift, such as the travel at an offset speed, is taken out: the change from the first period to the
    last determines it exactly. It needs two periods.

    Raises:
        InputError: a column is missing, a trace holds no whole number of periods, lines beyond half the sampling rate,
            an input that is not excited.
    """
    if not traces or not pairs:
        raise InputError("no trace or no pair of columns to estimate a frequency response from")
    step = _step(traces[0])
    for trace in traces:
        if rows < 2 or len(trace) < rows or len(trace) % rows:
            raise InputError(f"a trace of {len(trace)} rows does not hold whole periods of {rows} rows")
        if abs(_step(trace) - step) > EVEN_STEP_SHARE * step:
            raise InputError(f"traces with steps of {step:.9g} s and {_step(trace):.9g} s cannot be averaged")
    if not lines.size or lines[0] < 1 or 2 * lines[-1] >= rows or np.any(np.diff(lines) <= 0):
        raise InputError(f"excited lines must increase, from 1 on to less than half the {rows} rows of a period")
    names = dict.fromkeys((reference, *(name for pair in pairs for name in pair)))
    # (blocks, K) of every column
    spectra = {name: np.vstack([_spectra(trace[name], rows, lines) for trace in traces]) for name in names}
    loud = {name: max(float(np.max(np.abs(trace[name]))) for trace in traces) for name in names}
    frequency = lines / (rows * step)
    for name in dict.fromkeys((reference, *(pair[1] for pair in pairs))):
        strength = np.sqrt(np.mean(np.abs(spectra[name]) ** 2, axis=0))
        if np.any(weak := strength <= LINE_ROUNDING * loud[name]):
            silent = frequency[np.flatnonzero(weak)[0]]
            raise InputError(f"column {name!r} is not excited at {silent:.6g} Hz; there is no response to it")

    def cross(a: str, b: str) -> Complexes:
        return np.asarray(np.sum(spectra[a] * spectra[b].conj(), axis=0))

    columns, units, coherence = {}, {}, {}
    for output, input in pairs:
        name = f"{output}/{input}"
        with np.errstate(divide="ignore", invalid="ignore"):
            columns[name] = cross(output, reference) / cross(input, reference)
        units[name] = quotient_unit(traces[0].unit(output), traces[0].unit(input))
        if not np.all(np.isfinite(columns[name])):
            silent = frequency[np.flatnonzero(~np.isfinite(columns[name]))[0]]
            raise InputError(f"column {input!r} is not excited at {silent:.6g} Hz; there is no response to it")
        if len(spectra[reference]) > 1:
            ends = dict.fromkeys(end for end in (output, input) if end != reference)
            coherence[name] = np.ones(len(frequency))
            for end in ends:
                coherence[name] = np.minimum(coherence[name], _coherence(cross, end, reference))
    return FrequencyResponse(frequency, columns, units, coherence)


def _coherence(cross: Callable[[str, str], Complexes], a: str, b: str) -> Floats:
    power = cross(a, a).real * cross(b, b).real
    shared = np.abs(cross(a, b)) ** 2
    # a silent output has no power to share: its response, 0, is known
    return np.asarray(np.minimum(np.divide(shared, power, out=np.ones_like(power), where=power > 0), 1.0))


def _spectra(values: Floats, rows: int, lines: NDArray[np.int64]) -> Complexes:
    """(periods, K) spectra of a column's periods, without its mean and drift."""
    periods = values.reshape(-1, rows)
    periods = periods - periods[0].mean()  # what is left keeps its digits
    if len(periods) > 1:
        drift = (periods[-1].mean() - periods[0].mean()) / ((len(periods) - 1) * rows)  # per row
        periods = periods - drift * np.arange(periods.size, dtype=np.float64).reshape(periods.shape)
    return np.asarray(np.fft.rfft(periods, axis=1)[:, lines])


def _step(trace: Trace) -> float:
    """Step of a trace at even times [s].

    Raises:
        InputError: too few rows, or times that are not even.
    """
    if len(trace) < 2:
        raise InputError(f"a trace of {len(trace)} rows has no frequency response")
    step = float(trace.time[-1] - trace.time[0]) / (len(trace) - 1)
    grid = trace.time[0] + step * np.arange(len(trace))
    off = np.abs(trace.time - grid)
    if (worst := int(np.argmax(off))) and off[worst] > EVEN_STEP_SHARE * step + 4 * np.spacing(abs(trace.time[-1])):
        raise InputError(
            f"a frequency response needs even times; {trace.time[worst]:.9g} s lies {off[worst]:.3g} s off the grid of "
            f"{step:.9g} s"
        )
    return step


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
class ExcitedInput:
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
        warnings: those of the measurements.
    """

    plan: Plan
    response: FrequencyResponse
    excited: tuple[ExcitedInput, ...]
    wall_time: float
    simulated: float
    units: Mapping[str, Mapping[str, str]]
    warnings: tuple[Finding, ...]


Progress = Callable[[str, int, int], None]
PER_TASK = 1000  # steps of a progress bar that one measurement takes


def run_campaign(
    machine: Machine, axes: Sequence[str], plan: Plan, *, fmus: Path | None = None, progress: Progress | None = None,
    call_limit: float = Coupling().call_limit,
) -> Campaign:  # fmt: skip
    """Measure the responses of `axes`, as many at once as there are cores; with units of other makers one by one.

    progress: called with what is done, how far, and how far in all. call_limit: time [s] after which a call of another
    maker's unit is ended.

    Raises:
        InputError: as cosim.excite.measure: an argument out of range, a limit was met.
        SimulationError: a unit failed.
    """
    columns: dict[str, NDArray[np.complex128]] = {}
    units: dict[str, str] = {}
    coherence: dict[str, NDArray[np.float64]] = {}
    instances: dict[str, Mapping[str, str]] = {}
    frequency, excited, warnings = None, [], list[Finding]()
    wall_time = simulated = 0.0
    inputs = list(_inputs(machine, axes, plan))
    tasks = [
        partial(_measure, machine, axis, inject, plan, realisation, fmus, call_limit)
        for axis, inject, _ in inputs
        for realisation in range(plan.realisations)
    ]
    reached: dict[str, float] = {}

    def say(what: str, done: int, total: int) -> None:
        """Of one of them; people see one bar of all, which run at once."""
        reached[what] = done / total
        if progress is not None:
            progress("measurement on the units", round(PER_TASK * sum(reached.values())), PER_TASK * len(tasks))

    foreign = any_foreign(machine, fmus or fmus_directory())
    done = iter([task(say) for task in tasks] if foreign else in_parallel(tasks, say))
    for _, _, pairs in inputs:
        measurements = [next(done) for _ in range(plan.realisations)]
        frequency_response = estimate_responses(measurements, pairs)
        frequency = frequency_response.frequency
        columns |= frequency_response.columns
        units |= frequency_response.units
        coherence |= frequency_response.coherence
        first = measurements[0]
        excited.append(
            ExcitedInput(
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
    machine: Machine, axis: str, inject: str, plan: Plan, realisation: int, fmus: Path | None, call_limit: float,
    progress: Callable[..., None],
) -> Measurement:  # fmt: skip
    rms = plan.rms if plan.rms is not None and inject == plan.inject else usual_rms(machine, axis, inject)
    what = inject if inject.startswith("tool.") else f"{axis}.{inject}"

    def tell(done: int, total: int) -> None:
        progress(f"{what} {realisation}", done, total)

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
