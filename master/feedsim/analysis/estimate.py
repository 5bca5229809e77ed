"""Frequency responses and coherence from time series.

With output y, input u and, in a closed loop, the excitation r that is independent of all disturbances, cross spectra
S_ab = sum of A B* over blocks of the record (A, B: their discrete Fourier transforms):

    joint    H = S_yr / S_ur     unbiased in closed loop, since disturbances are not correlated with r
    H1       H = S_yu / S_uu     right where u is free of noise and feedback; in a loop, noise pulls it to -1/control
    coherence of a with b: gamma^2 = |S_ab|^2 / (S_aa S_bb)

Where u is r itself, both are the same. The coherence given with a joint estimate is the lower one of (y, r) and (u, r):
a response is known only where the excitation reaches both ends of it.

Periodic excitation: blocks are whole periods, the excited lines alone are evaluated, nothing leaks. Noise averages out
over periods; what non-linearity makes of the excitation is the same in every period and averages out over realisations
(other phases). Coherence needs two blocks at least; of m blocks, two unrelated signals show 1/m on average.

Sources: J. Bendat, A. Piersol, Random Data, 4th ed., Wiley 2010, chapters 5, 6 and 9 (H1, coherence, their errors);
P. Wellstead, Non-parametric methods of spectral analysis, Automatica 17 (1981) 55-69 (joint estimate); R. Pintelon,
J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., Wiley 2012, chapters 2 and 4 (periodic).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.trace import Trace
from feedsim.trace.response import FrequencyResponse, quotient_unit

if TYPE_CHECKING:
    from feedsim.cosim.excite import Measurement

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Pair = tuple[str, str]  # columns of output and input

EVEN_STEP_SHARE = 1e-6  # of a step: rounding of recorded times
LINE_ROUNDING = 1e-13  # of the largest value: lines below it are rounding, not response


def measured(measurements: Sequence[Measurement], pairs: Sequence[Pair]) -> FrequencyResponse:
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
