"""Rigid body, delays and elastic modes in measured frequency responses.

Every response is that of an acceleration to the torque (or current) at the motor:

    G_c(s) = e^(-s tau_c) (a_c s/(s + c) + sum_k b_ck s^2/(s^2 + 2 D_k w_k s + w_k^2))

Poles are common to all outputs: c is viscous friction over inertia, a_c = 1/J for the motor, b_ck the product of the
mass-normalised mode shape at motor and output (D. Ewins, Modal Testing, 2nd ed., 2000, ch. 2). Least squares of the
logarithm of model over measurement, magnitude and phase alike, each line with its own standard deviation and with what
a linear model of a machine with friction is not better than. Modes are added one after the other, each where it takes
away most; their number is that which predicts lines best that the fit has not seen (cross-validation).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import log, nan, pi, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize_scalar

from feedsim.estimation.modal.measured import MeasuredResponses
from feedsim.files.trace.response import Complexes
from feedsim.files.trace.trace import Array
from feedsim.foundation.errors import Finding, InputError
from feedsim.structure.modes import TOOL_PORTS, Modes

Lines = NDArray[np.int64]

MODEL = 0.05  # 0.4 dB and 3 degrees: what a linear model of an axis with friction is not better than
FOLDS = 5
FINAL = 1e-12  # of the cost: the last fit ends there
MIN_IMPROVEMENT_SHARE = 0.05  # share of the predicted residual that a further mode has to take away
MOST_MODES = 5
LEAST_LINES = 20
TRIAL_FREQUENCIES = 80  # frequencies at which a further mode is tried
TRIED_DAMPING = (0.01, 0.04)
LOW_D, HIGH_D = 1e-4, 0.7
MAX_DELAY = 5e-3  # [s] of a delay
# Share of a mode's frequency within which its peak is: friction alone makes one at low frequencies.
PEAK_DISTANCE = 0.25
EXTREME_POINTS = 20000  # of a response whose dips and peaks are looked for
# A residue may differ from dip and peak by this factor: other modes and damping move them. What changes a response by
# less than this share, and has neither, is what a linear model of an axis lacks.
RATIO_FACTOR, LEAST_EFFECT = 3.0, 0.1


@dataclass(frozen=True)
class Mode:
    """frequency [Hz], damping ratio [1], with standard deviations; shares: output -> b_ck/|a_motor| [of its unit]."""

    frequency: float
    damping: float
    frequency_sigma: float
    damping_sigma: float
    residues: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class RationalFit:
    """A fit.

    Attributes:
        outputs: names, the motor first. rigid: output -> a_c. delay: output -> tau_c [s]. friction: c [1/s].
        modes: by frequency. parameters: (P,) of the model.
        predicted: number of modes -> rms of the residual, in its standard deviations, of lines that a fit had not seen.
        rigid_sigma: output -> standard deviation of a_c.
        refused: sentences on modes that cross-validation took and the lines do not show.
    """

    outputs: tuple[str, ...]
    rigid: Mapping[str, float]
    rigid_sigma: Mapping[str, float]
    delay: Mapping[str, float]
    friction: float
    modes: tuple[Mode, ...]
    parameters: Array
    predicted: Mapping[int, float]
    refused: tuple[str, ...] = ()

    def without(self, mode: Mode) -> Array:
        """(P',) the parameters less those of a mode."""
        shape = _Shape(len(self.outputs), len(self.modes))
        k = int(np.argmin(np.abs(np.exp(self.parameters[1 : 1 + 2 * shape.modes : 2]) / (2 * pi) - mode.frequency)))
        own = [shape.of_output(self.parameters, c) for c in range(shape.outputs)]
        poles = np.delete(self.parameters[: 1 + 2 * shape.modes], [1 + 2 * k, 2 + 2 * k])
        return np.concatenate([poles, *(np.delete(values, 2 + k) for values in own)])

    def implausible(self, frequency: Array) -> list[tuple[Mode, str]]:
        """Modes that lines at `frequency` (N,) [Hz] do not show, and why; the least one first.

        A mode is seen where lines lie within its half-power width or between its dip and its peak. Between those two it
        has r = (f_r/f_a)^2 - 1, with light damping its residue over that of all that is softer. Dip and peak that say
        something else are those of another mode, or of a damping that makes up for what is no mode.
        """
        motor, softer = self.outputs[0], self.rigid[self.outputs[0]]
        fine = np.geomspace(float(frequency[0]), float(frequency[-1]), EXTREME_POINTS)
        height = np.log(np.abs(self.response(motor, fine)))
        peaks, dips = extremes(fine, height), extremes(fine, -height)
        result: list[tuple[float, Mode, str]] = []
        for mode in self.modes:
            f, share = mode.frequency, mode.residues[motor] / softer
            softer += mode.residues[motor]
            at = min(max(int(np.searchsorted(frequency, f)), 1), len(frequency) - 1)
            apart = float(frequency[at] - frequency[at - 1])
            width = max(2 * mode.damping * f, f - f / sqrt(1 + max(share, 0.0)))
            own = [peak for peak in peaks if abs(peak / f - 1) < PEAK_DISTANCE]
            pairs = [(peak / dip) ** 2 - 1 for peak in own for dip in dips if dip < peak]
            why = ""
            if width < apart:
                why = f"it is {width:.2g} Hz wide, and the lines there are {apart:.2g} Hz apart"
            elif pairs and not any(share / RATIO_FACTOR < pair < share * RATIO_FACTOR for pair in pairs):
                near = min(pairs, key=lambda pair: abs(log(pair / max(share, 1e-9))))
                why = f"its ratio of inertias is {share:.2g}, by (f_r/f_a)^2 - 1 of dip and peak {near:.2g}"
            elif not pairs and share < 2 * mode.damping * LEAST_EFFECT:
                why = f"it changes the response by {50 * share / mode.damping:.2g} % at most"
            if why:
                result.append((share, mode, why))
        return [(mode, why) for _, mode, why in sorted(result, key=lambda entry: entry[0])]

    def response(self, output: str, frequency: Array) -> Complexes:
        """(N,) acceleration over the input."""
        shape = _Shape(len(self.outputs), len(self.modes))
        row = shape.model(self.parameters, np.asarray(2j * pi * frequency))[self.outputs.index(output)]
        return np.asarray(row, dtype=np.complex128)

    def dips(self, output: str, low: float, high: float) -> list[float]:
        """Antiresonances [Hz]: least magnitudes between two frequencies."""
        frequency = np.geomspace(low, high, EXTREME_POINTS)
        return extremes(frequency, -np.log(np.abs(self.response(output, frequency))))


def extremes(frequency: Array, height: Array) -> list[float]:
    """Frequencies of the local maxima of `height` [Hz]."""
    top = np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])) + 1
    return [float(frequency[k]) for k in top]


@dataclass(frozen=True)
class _Shape:
    """The order of parameters: ln c, (ln w, ln D) per mode, then per output tau, a, b of every mode."""

    outputs: int
    modes: int

    def model(self, x: Array, s: Complexes) -> Complexes:
        """(C, N)"""
        basis = self.basis(x, s)
        rows = []
        for k in range(self.outputs):
            own = self.of_output(x, k)
            rows.append(np.exp(-s * own[0]) * (basis @ own[1:]))
        return np.array(rows)

    def basis(self, x: Array, s: Complexes) -> Complexes:
        """(N, 1 + modes)"""
        w, D = np.exp(x[1 : 1 + 2 * self.modes : 2]), np.exp(x[2 : 2 + 2 * self.modes : 2])
        columns = [s / (s + np.exp(x[0]))]
        columns += [s**2 / (s**2 + 2 * d * one * s + one**2) for one, d in zip(w, D, strict=True)]
        return np.array(columns).T

    def slopes(self, x: Array, s: Complexes) -> Complexes:
        """(C, N, P) derivative of the logarithm of the model."""
        c, basis = np.exp(x[0]), self.basis(x, s)
        w, D = np.exp(x[1 : 1 + 2 * self.modes : 2]), np.exp(x[2 : 2 + 2 * self.modes : 2])
        shapes = [-s * c / (s + c) ** 2]
        for one, d in zip(w, D, strict=True):
            below = s**2 + 2 * d * one * s + one**2
            shapes += [-(s**2) * (2 * d * one * s + 2 * one**2) / below**2, -(s**2) * 2 * d * one * s / below**2]
        values = np.zeros((self.outputs, len(s), len(x)), dtype=np.complex128)
        for k in range(self.outputs):
            own = self.of_output(x, k)
            G = basis @ own[1:]
            G = np.where(np.abs(G) > 1e-300, G, 1e-300)
            first = 1 + 2 * self.modes + k * (2 + self.modes)
            values[k, :, 0] = own[1] * shapes[0] / G
            for m in range(self.modes):
                values[k, :, 1 + 2 * m] = own[2 + m] * shapes[1 + 2 * m] / G
                values[k, :, 2 + 2 * m] = own[2 + m] * shapes[2 + 2 * m] / G
            values[k, :, first] = -s
            values[k, :, first + 1 : first + 2 + self.modes] = basis / G[:, None]
        return values

    def of_output(self, x: Array, k: int) -> Array:
        first = 1 + 2 * self.modes + k * (2 + self.modes)
        return x[first : first + 2 + self.modes]

    def without_residues(self, poles: Array, delays: Array, s: Complexes, G: Complexes, weight: Array) -> Array:
        """Parameters with the residues by linear least squares of the relative error."""
        basis = self.basis(poles, s)
        result = [poles]
        for k in range(self.outputs):
            A = basis * (np.exp(-s * delays[k]) * weight[k] / np.abs(G[k]))[:, None]
            y = G[k] * weight[k] / np.abs(G[k])
            x = np.linalg.lstsq(np.vstack([A.real, A.imag]), np.concatenate([y.real, y.imag]), rcond=None)[0]
            result += [delays[k : k + 1], x]
        return np.concatenate(result)


def fit_responses(
    frequency: Array, values: Mapping[str, Complexes], relative: Mapping[str, Array], modes: int | None = None
) -> RationalFit:
    """Fit responses.

    Args:
        frequency: (N,) [Hz]. values: output -> (N,) acceleration over the input, the motor first. relative: output ->
            (N,) relative standard deviations. modes: how many; None: as many as predict best.

    Raises InputError: too few lines; a response that is zero.
    """
    if len(frequency) < LEAST_LINES:
        raise InputError(f"{len(frequency)} lines of a frequency response; at least {LEAST_LINES} are needed")
    names = tuple(values)
    G = np.array([values[name] for name in names])
    if not np.all(np.abs(G) > 0):
        raise InputError("a frequency response is 0 at a line: which has no logarithm; leave the line out (--band)")
    weight = 1 / np.hypot(np.array([relative[name] for name in names]), MODEL)
    problem = _Lines(np.asarray(2j * pi * frequency, dtype=np.complex128), G, weight)
    every = np.arange(len(frequency), dtype=np.int64)
    chain = _chain(problem, every, MOST_MODES if modes is None else modes)
    predicted: dict[int, float] = {}
    if modes is None:
        remaining = np.zeros((len(chain), FOLDS))
        for fold in range(FOLDS):
            out = every[fold::FOLDS]
            seen = np.setdiff1d(every, out)
            for count, begin in enumerate(chain):
                x = problem.solve_from(_Shape(len(names), count), begin, seen)
                remaining[count, fold] = np.mean(problem.residual(_Shape(len(names), count), x, out) ** 2)
        predicted = {count: float(np.sqrt(np.mean(row))) for count, row in enumerate(remaining)}
        count = 0
        for more in range(1, len(chain)):
            gained = predicted[more] < (1 - MIN_IMPROVEMENT_SHARE) ** (more - count) * predicted[count]
            if gained and _physical(_Shape(len(names), more), chain[more]):
                count = more
    else:
        count = len(chain) - 1
    ended = problem.solve_from(_Shape(len(names), count), chain[count], every, FINAL)
    fit, refused = _rational_fit(names, problem, ended, count, predicted), []
    while modes is None and (said := fit.implausible(frequency)):
        mode, why = said[0]
        refused.append(f"a mode of {mode.frequency:.4g} Hz is left out: {why}")
        rest = tuple(other for other in fit.modes if other is not mode)
        begin = fit.without(mode)
        ended = problem.solve_from(_Shape(len(names), len(rest)), begin, every, FINAL)
        fit = _rational_fit(names, problem, ended, len(rest), predicted)
    return replace(fit, refused=tuple(refused))


@dataclass(frozen=True, eq=False)
class _Lines:
    s: Complexes
    G: Complexes
    weight: Array

    def residual(self, shape: _Shape, x: Array, lines: Lines) -> Array:
        """(2 C K,) logarithm of model over measurement, in standard deviations."""
        ratio = shape.model(x, self.s[lines]) / self.G[:, lines]
        r = np.log(np.where(np.abs(ratio) > 1e-12, ratio, 1e-12)) * self.weight[:, lines]
        return np.concatenate([r.real.ravel(), r.imag.ravel()])

    def jacobian(self, shape: _Shape, x: Array, lines: Lines) -> Array:
        """(2 C K, P) of the residual."""
        J = shape.slopes(x, self.s[lines]) * self.weight[:, lines, None]
        J = J.reshape(-1, len(x))
        return np.concatenate([J.real, J.imag])

    def solve_from(self, shape: _Shape, begin: Array, lines: Lines, tolerance: float = 1e-6) -> Array:
        """The least squares from `begin`."""
        low, high = self.bounds(shape)
        scale = np.maximum(np.abs(begin), 1e-3)
        scale[: 1 + 2 * shape.modes] = 1.0
        for k in range(shape.outputs):
            scale[1 + 2 * shape.modes + k * (2 + shape.modes)] = 1e-3
        inside = np.clip(begin, low + 1e-9, high - 1e-9)
        result = least_squares(
            lambda x: self.residual(shape, x, lines), inside, lambda x: self.jacobian(shape, x, lines),
            bounds=(low, high), x_scale=scale, xtol=1e-10, ftol=tolerance, max_nfev=60,
        )  # fmt: skip
        return np.asarray(result.x)

    def bounds(self, shape: _Shape) -> tuple[Array, Array]:
        first, last = float(np.abs(self.s[0])), float(np.abs(self.s[-1]))
        own = [(-MAX_DELAY, MAX_DELAY), *[(-np.inf, np.inf)] * (1 + shape.modes)]
        ends = [(np.log(1e-3 * first), np.log(10 * first))]
        ends += [(np.log(first), np.log(last)), (np.log(LOW_D), np.log(HIGH_D))] * shape.modes
        ends += own * shape.outputs
        low, high = zip(*ends, strict=True)
        return np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)


def _chain(problem: _Lines, lines: Lines, most: int) -> list[Array]:
    """Fits with 0, 1, ... modes, each begun at the one before and a mode where it takes away most."""
    outputs = len(problem.G)
    first = float(np.abs(problem.s[0]))
    s, G, weight = problem.s[lines], problem.G[:, lines], problem.weight[:, lines]
    shape = _Shape(outputs, 0)
    begin = shape.without_residues(np.array([np.log(0.3 * first)]), np.zeros(outputs), s, G, weight)
    result = [problem.solve_from(shape, begin, lines)]
    grid = np.geomspace(1.1 * first, 0.95 * float(np.abs(problem.s[-1])), TRIAL_FREQUENCIES)
    for count in range(1, most + 1):
        before, last = shape, result[-1]
        shape = _Shape(outputs, count)
        delays = np.array([before.of_output(last, k)[0] for k in range(outputs)])
        tried = []
        for w in grid:
            for D in TRIED_DAMPING:
                poles = np.concatenate([last[: 1 + 2 * before.modes], [np.log(w), np.log(D)]])
                x = shape.without_residues(poles, delays, s, G, weight)
                off = (shape.model(x, s) - G) / np.abs(G) * weight
                tried.append((float(np.sum(np.abs(off) ** 2)), x))
        tried.sort(key=lambda entry: entry[0])
        ends = [problem.solve_from(shape, x, lines) for _, x in (tried[0], tried[len(TRIED_DAMPING) * 4])]
        costs = [float(np.sum(problem.residual(shape, x, lines) ** 2)) for x in ends]
        result.append(ends[int(np.argmin(costs))])
    return result


def _physical(shape: _Shape, x: Array) -> bool:
    """Whether all modes may be those of a structure: damped, with the motor, which is pushed where it is measured, and
    no two within their half-power widths, which are one mode that the model does not quite meet."""
    w, D = np.exp(x[1 : 1 + 2 * shape.modes : 2]), np.exp(x[2 : 2 + 2 * shape.modes : 2])
    order = np.argsort(w)
    w, D = w[order], D[order]
    motor = shape.of_output(x, 0)
    return bool(
        np.all(np.diff(w) > (D * w)[1:] + (D * w)[:-1]) and np.all(D > 1.1 * LOW_D) and np.all(motor[2:] * motor[1] > 0)
    )


def _rational_fit(
    names: tuple[str, ...], problem: _Lines, x: Array, count: int, predicted: Mapping[int, float]
) -> RationalFit:
    shape = _Shape(len(names), count)
    lines = np.arange(len(problem.s), dtype=np.int64)
    r = problem.residual(shape, x, lines)
    J = problem.jacobian(shape, x, lines)
    scale = np.linalg.norm(J, axis=0) + 1e-300
    inverse = np.linalg.pinv((J / scale).T @ (J / scale), hermitian=True)
    # Residuals may be smaller than the error of a linear model, which then sets the intervals.
    variance = max(float(r @ r) / max(len(r) - len(x), 1), 1.0)
    sigma = np.sqrt(np.maximum(np.diag(inverse) * variance, 0.0)) / scale
    modes = []
    for k in range(count):
        f, D = float(np.exp(x[1 + 2 * k])) / (2 * pi), float(np.exp(x[2 + 2 * k]))
        residues = {name: float(shape.of_output(x, c)[2 + k]) for c, name in enumerate(names)}
        modes.append(Mode(f, D, f * float(sigma[1 + 2 * k]), D * float(sigma[2 + 2 * k]), residues))
    own = {name: shape.of_output(x, c) for c, name in enumerate(names)}
    own_sigma = {name: shape.of_output(sigma, c) for c, name in enumerate(names)}
    return RationalFit(
        names,
        {name: float(values[1]) for name, values in own.items()},
        {name: float(values[1]) for name, values in own_sigma.items()},
        {name: float(values[0]) for name, values in own.items()},
        float(np.exp(x[0])),
        tuple(sorted(modes, key=lambda mode: mode.frequency)),
        x,
        predicted,
    )


# --- Lines of a measured response beside their neighbours, without a model of the axis --------------------------------
# A parabola through a line and its neighbours, complex and over the frequency, by least squares (local polynomial
# method:
# R. Pintelon, J. Schoukens, System Identification, 2nd ed., 2012, ch. 7). What it leaves is noise, and distortion
# that
# repeats with the excitation, which no scatter over periods shows. Its least magnitude is an antiresonance; that of
# the
# reciprocal response a resonance.


LINES = 9  # of a parabola: a line and four neighbours to either side
COLUMNS = 3  # of a parabola
EXTREME_DISTANCE = 0.07  # share of a frequency within which lines show a dip or a peak there
INNER_SHARE = 0.8  # of the lines' range in which it has to be


def scatter(frequency: Array, values: Complexes) -> Complexes:
    """(N,) what lines differ by from their neighbours, over their magnitude: the real part is along the response, the
    imaginary part across it. Scaled so that its variance is that of one line.

    frequency: (N,) [Hz], increasing, 9 or more. values: (N,) not 0.
    """
    count, half = len(frequency), LINES // 2
    result = np.zeros(count, dtype=np.complex128)
    for k in range(count):
        first = min(max(k - half, 0), count - LINES)
        rows = slice(first, first + LINES)
        V = _powers(frequency[rows], frequency[k])
        basis = np.linalg.qr(V)[0]
        own = values[rows] - basis @ (basis.T @ values[rows])
        result[k] = own[k - first] / values[k]
    return np.asarray(result * np.sqrt(LINES / (LINES - COLUMNS)), dtype=np.complex128)


def find_minimum(frequency: Array, values: Complexes, at: float) -> tuple[float, float]:
    """The frequency near `at` at which a response is least, and its standard deviation [Hz]; nan where the lines do not
    show one. Of a resonance, `values` are those of the reciprocal response."""
    nothing = float("nan"), float("nan")
    rows = np.flatnonzero(np.abs(frequency / at - 1) < EXTREME_DISTANCE)
    if len(rows) < LINES:
        first = int(np.clip(np.searchsorted(frequency, at) - LINES // 2, 0, max(len(frequency) - LINES, 0)))
        rows = np.arange(first, min(first + LINES, len(frequency)))
    if len(rows) < LINES:
        return nothing
    V = _powers(frequency[rows], at)
    c = np.linalg.lstsq(V, values[rows], rcond=None)[0]
    remaining = values[rows] - V @ c
    variance = float(np.sum(np.abs(remaining) ** 2)) / (2 * (len(rows) - COLUMNS))
    low, high = INNER_SHARE * (frequency[rows[[0, -1]]] - at)
    d = float(minimize_scalar(lambda d: abs(np.polyval(c, d)), bounds=(low, high), method="bounded").x)
    if min(d - low, high - d) < 1e-3 * (high - low):
        return nothing
    row = np.vander([d], COLUMNS)[0]
    sigma = np.sqrt(row @ np.linalg.inv(V.T @ V) @ row * variance) / abs(np.polyval(np.polyder(c), d))
    return at + d, float(sigma)


def _powers(frequency: Array, at: float) -> Array:
    """(K, 3)"""
    return np.vander(frequency - at, COLUMNS)


# --- Modes of an axis out of measured responses, and what they are to the table of modes of a machine -----------------
# The machine's rigid motion stays: shapes of the modes are relative to it, so that neither the torque constant nor
# the
# unit of the input matters. With a_c and b_ck of the fit (rational.py) and the rigid mode n_0, x_0 of the axis,
#     n_k = n_0 sqrt(b_motor,k / a_motor)          x_k = (x_0 / n_0) (b_scale,k / a_scale) (a_motor / b_motor,k) n_k


MOTOR, SCALE = "motor", "scale"
NOTEWORTHY_DIFFERENCE = 0.1  # share by which inertia and lead may differ from the machine's without a word
MAX_DEVIATIONS = 3.0, 30.0  # dB and degrees that 90 % of the motor's lines have to be within
JUDGED_LINES_SHARE = 0.9  # share of the lines that a fit is judged by


@dataclass(frozen=True, eq=False)
class AxisModes:
    """What was found.

    measured, fit: in SI, accelerations over the input. own: output -> (N,) the machine's response at the lines.
    table: the machine's modes with those of the axis in place of all elastic ones; None where a mode cannot be placed.
    deviations: output -> dB and degrees that 90 % of the lines are within. scatter: the same about their neighbours.
    dips, peaks: of the motor [Hz]: of the fit, measured without it, and the standard deviation of that (nan where the
    measurement has none there).
    """

    axis: str
    measured: MeasuredResponses
    fit: RationalFit
    own: Mapping[str, Complexes]
    table: Modes
    deviations: Mapping[str, tuple[float, float]]
    scatter: Mapping[str, tuple[float, float]]
    dips: tuple[tuple[float, float, float], ...]
    peaks: tuple[tuple[float, float, float], ...]
    warnings: tuple[Finding, ...]
    notes: tuple[Finding, ...]

    @property
    def ratios(self) -> tuple[float, float, float] | None:
        """(peak/dip)^2 - 1 of the first mode, with light damping the inertia behind it over that of the motor: of the
        fit, measured, and the standard deviation of that; None without dip and peak."""
        first = self.fit.modes[0].frequency if self.fit.modes else nan
        peak = min(self.peaks, key=lambda peak: abs(peak[0] - first), default=None)
        dips = [dip for dip in self.dips if peak is not None and dip[0] < peak[0]]
        if peak is None or not dips:
            return None
        dip = dips[-1]
        square = (peak[1] / dip[1]) ** 2
        return (peak[0] / dip[0]) ** 2 - 1, square - 1, 2 * square * float(np.hypot(peak[2] / peak[1], dip[2] / dip[1]))

    @property
    def inertia_ratio(self) -> float | None:
        """Residue of the first mode over that of rigid motion at the motor: of two inertias, the further one over that
        of the motor, whatever their damping."""
        fit = self.fit
        return fit.modes[0].residues[MOTOR] / fit.rigid[MOTOR] if fit.modes else None


def identify_modes(measured: MeasuredResponses, machine_modes: Modes, axis: str, modes: int | None = None) -> AxisModes:
    """Fit the responses of an axis. modes: how many; None: by cross-validation. InputError: what `fit_responses`
    refuses."""
    fit = fit_responses(measured.frequency, measured.values, measured.relative, modes)
    frequency = measured.frequency
    remaining = {
        name: _difference_limits(np.log(fit.response(name, frequency) / values))
        for name, values in measured.values.items()
    }
    decibel, degrees = remaining[MOTOR]
    if decibel > MAX_DEVIATIONS[0] or degrees > MAX_DEVIATIONS[1]:
        raise InputError(
            f"axis {axis}: a rigid body with up to {MOST_MODES} modes and a delay meets 90 % of the lines within "
            f"{decibel:.2g} dB and {degrees:.2g} degrees only; {MAX_DEVIATIONS[0]:g} dB and {MAX_DEVIATIONS[1]:g} "
            "degrees are allowed. Is "
            "the input the torque or current at the motor, and not the setpoint of a closed loop? Else choose lines "
            "(--band)"
        )
    low, high = float(frequency[0]), float(frequency[-1])
    motor = measured.values[MOTOR]
    fine = np.geomspace(low, high, EXTREME_POINTS)
    model = np.log(np.abs(fit.response(MOTOR, fine)))
    dips = tuple((f, *find_minimum(frequency, motor, f)) for f in extremes(fine, -model))
    peaks = tuple(
        (f, *find_minimum(frequency, 1 / motor, f))
        for f in extremes(fine, model)
        if any(abs(f / mode.frequency - 1) < PEAK_DISTANCE for mode in fit.modes)
    )
    warnings, notes = _compare_with_machine(measured, machine_modes, axis, fit)
    return AxisModes(
        axis, measured, fit, responses_of(machine_modes, axis, measured), _table(machine_modes, axis, fit),
        remaining, {name: _difference_limits(scatter(frequency, values)) for name, values in measured.values.items()},
        dips, peaks, tuple(warnings), tuple(notes),
    )  # fmt: skip


def responses_of(modes: Modes, axis: str, measured: MeasuredResponses) -> dict[str, Complexes]:
    """Output -> (N,) acceleration over the motor torque, by a table of modes; without friction and delay."""
    s = 2j * np.pi * measured.frequency
    w = 2 * np.pi * modes.frequency
    shape = s[:, None] ** 2 / (s[:, None] ** 2 + 2 * modes.damping * w * s[:, None] + w**2)
    n = modes.ports[f"n_{axis}"]
    at = {MOTOR: n, SCALE: modes.ports[f"x_{axis}"]}
    # A sensor of another place is compared with the motor.
    result = {name: np.asarray(shape @ (n * at.get(name, n)), dtype=np.complex128) for name in measured.values}
    # Where the scale turns, it is compared as an angle.
    lead = _lead(modes, axis)
    if SCALE in result and not measured.linear[SCALE]:
        result[SCALE] = result[SCALE] / lead
    return result


def _lead(modes: Modes, axis: str) -> float:
    """Travel of the scale per radian of the rotor in rigid motion [m/rad]."""
    n, x = modes.ports[f"n_{axis}"][modes.rigid], modes.ports[f"x_{axis}"][modes.rigid]
    return float(n @ x / (n @ n))


def _difference_limits(logarithm: Complexes) -> tuple[float, float]:
    """dB and degrees that 90 % of differences of logarithms are within."""
    parts = 20 / np.log(10) * logarithm.real, np.degrees(logarithm.imag)
    decibel, degrees = (float(np.quantile(np.abs(part), JUDGED_LINES_SHARE)) for part in parts)
    return decibel, degrees


def _compare_with_machine(
    measured: MeasuredResponses, modes: Modes, axis: str, fit: RationalFit
) -> tuple[list[Finding], list[Finding]]:
    """Warnings and notes: senses, units, delays."""
    warnings: list[Finding] = []
    # Notes of the file count as notes here, whatever they weigh elsewhere.
    notes = [replace(note, severity="note") for note in measured.notes]
    notes += [Finding("mode-left-out", "note", f"axis {axis}: {why}", axis) for why in fit.refused]
    for mode, why in fit.implausible(measured.frequency):  # of a number that was given
        text = f"axis {axis}: the mode of {mode.frequency:.4g} Hz is doubtful: {why}"
        warnings.append(Finding("mode-doubtful", "doubt", text, axis))
    if fit.rigid[MOTOR] < 0:
        text = f"axis {axis}: the motor counts against its torque; its sign is turned"
        notes.append(Finding("sign-turned", "note", text, axis))
    if SCALE in fit.rigid and fit.rigid[SCALE] * fit.rigid[MOTOR] < 0:
        text = f"axis {axis}: motor and scale count against each other; the scale's sign is turned"
        notes.append(Finding("sign-turned", "note", text, axis))
    if measured.input_unit == "N.m":
        J, own = 1 / abs(fit.rigid[MOTOR]), modes.J_tot(axis)
        if abs(J / own - 1) > NOTEWORTHY_DIFFERENCE:
            warnings.append(Finding(
                "inertia-contradicted", "doubt",
                f"axis {axis}: the response has an inertia of {J:.4g} kg.m2, the machine one of {own:.4g} kg.m2; the "
                "modes are written relative to the machine's",
                axis,
            ))  # fmt: skip
    if SCALE in fit.rigid:
        lead = abs(fit.rigid[SCALE] / fit.rigid[MOTOR])
        usual = abs(_lead(modes, axis)) if measured.linear[SCALE] else 1.0
        if abs(lead / usual - 1) > NOTEWORTHY_DIFFERENCE:
            unit = "m/rad" if measured.linear[SCALE] else "rad/rad"
            warnings.append(Finding(
                "scale-factor-unexpected", "doubt",
                f"axis {axis}: the scale moves by {lead:.4g} {unit} of the motor at low frequencies, where "
                f"{usual:.4g} {unit} are expected: its unit, or a gear",
                axis,
            ))  # fmt: skip
    return warnings, notes


def _table(modes: Modes, axis: str, fit: RationalFit) -> Modes:
    """The machine's rigid modes, and those of the axis; other axes are rigid in it."""
    rigid = modes.rigid
    n_0 = 1 / sqrt(modes.J_tot(axis))
    x_0 = _lead(modes, axis) * n_0
    ports = {name: list(map(float, column[rigid])) for name, column in modes.ports.items()}
    frequency, damping = [0.0] * int(np.sum(rigid)), [0.0] * int(np.sum(rigid))
    for mode in fit.modes:
        share = mode.residues[MOTOR] / fit.rigid[MOTOR]
        if not share > 0:
            continue
        n = n_0 * sqrt(share)
        # Without a scale the mode is between motor and slide, which moves as orthogonality to the rigid motion asks.
        x_share = mode.residues[SCALE] / fit.rigid[SCALE] / share if SCALE in fit.rigid else -1.0 / share
        x = x_0 / n_0 * x_share * n
        frequency.append(mode.frequency)
        damping.append(mode.damping)
        moved = {f"n_{axis}": n, f"x_{axis}": x, **({f"tcp_{axis}": x} if f"tcp_{axis}" in TOOL_PORTS else {})}
        for name, column in ports.items():
            column.append(moved.get(name, 0.0))
    return Modes(
        Path("modes.csv"), np.array(frequency), np.array(damping), {name: np.array(c) for name, c in ports.items()}
    )
