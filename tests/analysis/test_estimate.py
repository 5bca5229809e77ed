"""The estimators on a known discrete system: y = G u + v, u = r - C y, noise v of known strength."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import freqz, lfilter

from feedsim.analysis import campaign as estimate
from feedsim.files.trace import Trace
from feedsim.foundation.errors import InputError
from feedsim.scenario import Cycles
from feedsim.simulation.cosim.excitation import multisine

Floats = NDArray[np.float64]

CYCLES = Cycles(control=1e-3, position=2e-3, interpolation=2e-3)
# A resonance at 60 Hz, damping 5 %, with a delay; the controller damps it further: largest pole of the loop 0.95.
POLE = np.exp(2 * np.pi * 60e-3 * (-0.05 + 1j))
G = ([0.0, 0.05], [1.0, -2 * POLE.real, abs(POLE) ** 2])
C = ([1.2, -1.0], [1.0, -0.3])
PAIR = [("y", "u")]


@dataclass(frozen=True)
class Loop:
    """Transfer functions of the closed loop as polynomials in 1/z."""

    loop: tuple[Floats, Floats]  # 1/(1 + G C)

    @classmethod
    def closed(cls) -> Loop:
        denominator = np.convolve(G[1], C[1])
        return cls((denominator, np.polyadd(denominator[::-1], np.convolve(G[0], C[0])[::-1])[::-1]))

    def run(self, r: Floats, v: Floats) -> tuple[Floats, Floats]:
        """u and y from excitation and noise."""
        y = lfilter(*self.loop, lfilter(*G, r) + v)
        return r - lfilter(*C, y), y


def at(polynomials: tuple[list[float], list[float]], frequency: Floats) -> NDArray[np.complex128]:
    return np.asarray(freqz(*polynomials, worN=2 * np.pi * frequency * CYCLES.T_c)[1])


def record(
    periods: int, noise: float, *, realisations: int = 1, settle: int = 4
) -> tuple[list[Trace], int, NDArray[np.int64]]:
    """Steady traces with columns r, u, y; rows per period; lines."""
    traces = []
    for seed in range(realisations):
        signal = multisine(CYCLES, 1.0, band=(5, 240), seed=seed)
        rows = len(signal.samples)
        r = np.tile(signal.samples, settle + periods)
        v = noise * np.random.default_rng(100 + seed).normal(size=len(r))
        u, y = Loop.closed().run(r, v)
        kept = slice(settle * rows, None)
        time = np.arange(periods * rows, dtype=np.float64) * CYCLES.T_c
        traces.append(Trace(time, {"r": r[kept], "u": u[kept], "y": y[kept]}, {"r": "N.m", "u": "N.m", "y": "rad/s"}))
    return traces, rows, signal.lines


@pytest.mark.parametrize("reference", ["r", "u"])
def test_without_noise_the_system_is_found_exactly(reference: str) -> None:
    traces, rows, lines = record(2, 0.0, realisations=2)
    found = estimate.periodic(traces, [*PAIR, ("u", "y")], reference=reference, rows=rows, lines=lines)
    # rounding, and what is left of the transient after 4 s: 0.95^4000
    np.testing.assert_allclose(found["y/u"], at(G, found.frequency), rtol=1e-10)
    np.testing.assert_allclose(found["u/y"], 1 / at(G, found.frequency), rtol=1e-10)
    assert found.coherence["y/u"].min() > 1 - 1e-12
    assert (found.unit("y/u"), found.unit("u/y")) == ("(rad/s)/(N.m)", "(N.m)/(rad/s)")


def test_the_period_lines_are_the_excited_ones() -> None:
    traces, rows, lines = record(1, 0.0)
    found = estimate.periodic(traces, PAIR, reference="r", rows=rows, lines=lines)
    np.testing.assert_allclose(found.frequency, np.arange(5, 241), rtol=1e-12)
    assert not found.coherence  # one block tells none


def test_drift_is_taken_out_exactly() -> None:
    """An axis that travels 20 mm/s under a response of some um: nine orders between them."""
    traces, rows, lines = record(3, 0.0)
    trace = traces[0]
    still = estimate.periodic([trace], PAIR, reference="r", rows=rows, lines=lines)
    moving = Trace(trace.time, {**trace.columns, "y": trace["y"] + 100.0 + 2e5 * trace.time}, trace.units)
    found = estimate.periodic([moving], PAIR, reference="r", rows=rows, lines=lines)
    # 6e5 with 1e-16 of rounding, against lines of about 0.01
    np.testing.assert_allclose(found["y/u"], still["y/u"], rtol=1e-7)


NOISE, BLOCKS = 0.5, 400


def theory(frequency: Floats, rows: int) -> tuple[NDArray[np.complex128], NDArray[np.complex128], Floats, Floats]:
    """G, C, power of the excitation and of the noise per line."""
    ones = np.ones(len(frequency))
    # RMS 1 over K lines: amplitude^2/2 K = 1, |R| = amplitude rows/2; noise of variance s^2 has rows s^2 per line
    return at(G, frequency), at(C, frequency), ones * rows**2 / (2 * len(frequency)), ones * rows * NOISE**2


def test_with_noise_joint_is_unbiased_and_H1_is_not() -> None:
    traces, rows, lines = record(BLOCKS, NOISE)
    joint = estimate.periodic(traces, PAIR, reference="r", rows=rows, lines=lines)
    direct = estimate.periodic(traces, PAIR, reference="u", rows=rows, lines=lines)
    g, c, excitation, noise = theory(joint.frequency, rows)
    # S_yu/S_uu with y = S (G r + v), u = S (r - C v)
    biased = (g * excitation - c.conj() * noise) / (excitation + np.abs(c) ** 2 * noise)
    # error of an estimate of m blocks: 1/H varies by the noise-to-signal ratio of y - H u = v + C H v, over m
    deviation = np.sqrt(noise * np.abs(1 + c * g) ** 2 / excitation / BLOCKS)
    error = joint["y/u"] - g
    assert np.all(np.abs(error) < 5 * deviation)
    assert abs(np.mean(error / deviation)) < 5 / np.sqrt(len(lines))  # no bias over all lines
    assert np.all(np.abs(direct["y/u"] - biased) < 5 * deviation)
    # and the bias is there: several deviations
    assert np.median(np.abs(biased - g) / deviation) > 4
    assert np.median(np.abs(direct["y/u"] - g) / deviation) > 4


def test_coherence_is_that_of_theory() -> None:
    traces, rows, lines = record(BLOCKS, NOISE)
    found = estimate.periodic(traces, [*PAIR, ("y", "r"), ("u", "r")], reference="r", rows=rows, lines=lines)
    g, c, excitation, noise = theory(found.frequency, rows)
    of_y = np.abs(g) ** 2 * excitation / (np.abs(g) ** 2 * excitation + noise)
    of_u = excitation / (excitation + np.abs(c) ** 2 * noise)
    for name, expected in (("y/r", of_y), ("u/r", of_u)):
        assert expected.min() < 0.9  # else there would be nothing to find
        # standard deviation sqrt(2) (1 - gamma^2) gamma/sqrt(m), bias (1 - gamma^2)^2/m (Bendat, Piersol, chapter 9)
        deviation = np.sqrt(2 * expected / BLOCKS) * (1 - expected)
        error = found.coherence[name] - expected - (1 - expected) ** 2 / BLOCKS
        assert np.all(np.abs(error) < 5 * deviation + 1e-3)
        assert abs(np.mean(error / deviation)) < 5 / np.sqrt(len(lines))
    np.testing.assert_array_equal(found.coherence["y/u"], np.minimum(found.coherence["y/r"], found.coherence["u/r"]))


def test_non_linearity_shows_over_realisations_not_over_periods() -> None:
    """A cube makes every period the same; other phases tell it from the response."""
    rows, traces = 0, []
    for seed in range(20):
        signal = multisine(CYCLES, 1.0, band=(5, 240), seed=seed)
        rows = len(signal.samples)
        u = np.tile(signal.samples, 2)
        traces.append(Trace(np.arange(2 * rows, dtype=np.float64) * 1e-3, {"u": u, "y": u + u**3}))
    one = estimate.periodic(traces[:1], PAIR, reference="u", rows=rows, lines=signal.lines)
    all_of_them = estimate.periodic(traces, PAIR, reference="u", rows=rows, lines=signal.lines)
    assert one.coherence["y/u"].min() > 1 - 1e-12
    assert all_of_them.coherence["y/u"].max() < 0.998
    # the best linear gain: 1 + E[u^4]/E[u^2]; the crest factor is low, E[u^4] well below that of noise (3)
    gain = 1 + np.mean([np.mean(trace["u"] ** 4) for trace in traces])
    np.testing.assert_allclose(np.mean(all_of_them["y/u"].real), gain, rtol=0.02)


def test_an_output_that_does_not_answer() -> None:
    traces, rows, lines = record(2, 0.0)
    trace = Trace(traces[0].time, {**traces[0].columns, "still": np.zeros(2 * rows)})
    found = estimate.periodic([trace], [("still", "r")], reference="r", rows=rows, lines=lines)
    assert not np.any(found["still/r"])
    with pytest.raises(InputError, match="'still' is not excited at 5 Hz"):
        estimate.periodic([trace], [("r", "still")], reference="r", rows=rows, lines=lines)


def test_periodic_refuses() -> None:
    traces, rows, lines = record(2, 0.0)
    with pytest.raises(InputError, match="whole periods of 999 rows"):
        estimate.periodic(traces, PAIR, reference="r", rows=999, lines=lines)
    with pytest.raises(InputError, match="did you mean 'y'"):
        estimate.periodic(traces, [("Y", "u")], reference="r", rows=rows, lines=lines)
    with pytest.raises(InputError, match="less than half the 1000 rows"):
        estimate.periodic(traces, PAIR, reference="r", rows=rows, lines=np.array([500]))
    uneven = traces[0].time.copy()
    uneven[7] += 1e-4
    with pytest.raises(InputError, match=r"even times; 0\.0071 s lies 0\.0001 s off"):
        estimate.periodic([Trace(uneven, traces[0].columns)], PAIR, reference="r", rows=rows, lines=lines)
