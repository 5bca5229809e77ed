"""Benches of two and three inertias in time signals whose truth is known, and lines beside their neighbours."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.signal import cont2discrete, lfilter

from feedsim.cli import main
from feedsim.estimation.modal.estimate import estimate_responses
from feedsim.estimation.modal.rational import find_minimum, fit_responses, scatter
from feedsim.files.trace import Trace, write_csv
from feedsim.files.trace.trace import Array

MACHINE = Path(__file__).resolve().parents[2] / "scenarios" / "machines" / "one_axis"
RATE, PERIOD = 2500.0, 2500
RIGID = 100.0  # (rad/s2)/(N.m): of all inertias together
FRICTION = 6.0  # [1/s]


def excitation(kind: str, rng: np.random.Generator, periods: int = 8) -> Array:
    """Torque of rms 1: a multisine of 11 to 250 Hz, a pseudo-random binary sequence that repeats, or noise."""
    if kind == "multisine":
        lines = np.zeros(PERIOD // 2 + 1, dtype=complex)
        lines[11:251] = np.exp(2j * np.pi * rng.random(240))
        u = np.tile(np.fft.irfft(lines), periods)
    elif kind == "binary":
        u = np.tile(np.repeat(rng.integers(0, 2, PERIOD // 4) - 0.5, 4), periods)
        u -= np.mean(u)
    else:
        u = rng.standard_normal(periods * PERIOD)
    return np.asarray(u / np.std(u))


def angles(u: Array, masses: Array, stiffness: Array, damping: float, delays: list[float]) -> list[Array]:
    """Angle of every inertia of a chain that the torque acts on at the first one, by the exact answer of its modes to a
    torque that is held; a delay comes in whole tenths of a sample."""
    K = np.diag(np.append(stiffness, 0.0) + np.append(0.0, stiffness)) - np.diag(stiffness, 1) - np.diag(stiffness, -1)
    square, shape = eigh(K, np.diag(masses))
    found = []
    fine = np.repeat(u, 10)
    for sensor, delay in enumerate(delays):
        y = np.zeros(len(fine))
        for k in range(len(masses)):
            w = np.sqrt(max(square[k], 0.0))
            poles = [1.0, FRICTION, 0.0] if k == 0 else [1.0, 2 * damping * w, w**2]
            b, a, _ = cont2discrete(([shape[0, k] * shape[sensor, k]], poles), 0.1 / RATE, "zoh")
            y = y + lfilter(np.ravel(b), a, fine)
        found.append(np.concatenate([np.zeros(round(10 * delay * RATE)), y])[: len(y) : 10])
    return found


def drift(count: int) -> Array:
    """An axis that creeps: a ramp, a curve and a slow wave [rad], some thousand times what an upper line moves it."""
    t = np.arange(count) / RATE
    return np.asarray(0.02 * t + 0.01 * t**2 + 1e-3 * np.sin(2 * np.pi * 0.13 * t))


@pytest.mark.parametrize("kind", ["multisine", "binary"])
def test_a_drift_of_the_angle_leaves_the_lines(kind: str) -> None:
    """A creeping angle has no part in lines of a periodic excitation: their response within 0.5 % of that without."""
    u = excitation(kind, np.random.default_rng(3))
    (y,) = angles(u, np.array([0.005, 0.005]), np.array([500.0]), 0.02, [0.0])
    found = [estimate_responses([u], {"motor": [y + d]}, 1 / RATE, period=PERIOD) for d in (0.0 * y, drift(len(y)))]
    within = (found[0].frequency < 250) & (found[0].frequency > 10)
    ratio = found[1].values["motor"][within] / found[0].values["motor"][within]
    assert np.quantile(np.abs(ratio - 1), 0.9) < 5e-3


@pytest.mark.extensive
@pytest.mark.parametrize("kind", ["multisine", "binary", "noise"])
@pytest.mark.parametrize("ratio", [0.3, 0.7, 1.05, 2.0, 4.0])
def test_two_inertias_of_any_ratio(ratio: float, kind: str) -> None:
    """Sensors with delays, steps of an encoder, noise on the current: ratio of inertias within 3 %, modes within 1 %,
    delays within 0.05 ms (half a sample is the hold), and the model meets a record with another excitation."""
    rng = np.random.default_rng(int(100 * ratio))
    motor = 1 / RIGID / (1 + ratio)
    stiffness = (2 * np.pi * 52.0) ** 2 * ratio * motor
    peak = 52.0 * np.sqrt(1 + ratio)

    def responses(kind: str) -> tuple[Array, dict[str, Array], dict[str, Array]]:
        u = excitation(kind, rng)
        own = angles(u, np.array([motor, ratio * motor]), np.array([stiffness]), 0.02, [0.12e-3, 0.32e-3])
        steps = [np.round((y + drift(len(y))) / 6e-6) * 6e-6 for y in own]
        measured = u + 0.01 * rng.standard_normal(len(u))
        result = estimate_responses([measured], {"motor": [steps[0]], "load": [-steps[1]]}, 1 / RATE,
                           period=None if kind == "noise" else PERIOD, orders={"motor": 2, "load": 2})  # fmt: skip
        used = (result.frequency > 11) & (result.frequency < 200)
        s = 2j * np.pi * result.frequency[used]
        return (
            result.frequency[used],
            {name: value[used] * s**2 for name, value in result.values.items()},
            {name: value[used] for name, value in result.relative.items()},
        )

    fit = fit_responses(*responses(kind))
    mode = min(fit.modes, key=lambda one: abs(one.frequency - peak))
    assert mode.frequency == pytest.approx(peak, rel=0.01)
    assert mode.residues["motor"] / fit.rigid["motor"] == pytest.approx(ratio, rel=0.03)
    assert fit.rigid["load"] / fit.rigid["motor"] == pytest.approx(-1.0, rel=0.05)
    hold = 0.5 / RATE
    assert fit.delay["motor"] - hold == pytest.approx(0.12e-3, abs=0.05e-3)
    frequency, values, _ = responses("multisine" if kind != "multisine" else "binary")
    off = np.log(fit.response("motor", frequency) / values["motor"])
    assert np.quantile(np.abs(off.real), 0.9) * 8.686 < 0.7
    assert np.degrees(np.quantile(np.abs(off.imag), 0.9)) < 4.0


@pytest.mark.parametrize("kind", ["multisine", "binary", "noise"])
def test_a_screw_with_three_sensors(kind: str, tmp_path: Path) -> None:
    """Motor, screw and table; the table's scale in metres, and against the motor. Dip and peak of the motor and the
    table's mode within 3 % of the truth."""
    rng = np.random.default_rng(7)
    masses, lead = np.array([0.004, 0.002, 0.003]), 10e-3 / (2 * np.pi)
    stiffness = np.array([2.0e3, 4.0e2])
    u = excitation(kind, rng, 12)
    motor, screw, table = angles(u, masses, stiffness, 0.02, [0.1e-3, 0.1e-3, 0.5e-3])
    scale = -lead * (table + drift(len(u)))
    time = np.arange(len(u)) / RATE
    columns = {"M": u, "phi": motor + drift(len(u)), "screw": screw,
               "x": np.round(scale / 1e-9) * 1e-9}  # fmt: skip
    write_csv(tmp_path / "log.csv", Trace(time, columns, {"M": "N.m", "phi": "rad", "screw": "rad", "x": "m"}))
    words = ["identify-modes", str(tmp_path / "log.csv"), "--machine", str(MACHINE), "--input", "M", "--motor", "phi"]
    words += ["--scale", "x", "--sensor", "screw", "--band", "10Hz..250Hz", "--quiet", "--out", str(tmp_path / "found")]
    assert main(words) == 0
    K = np.diag(np.append(stiffness, 0.0) + np.append(0.0, stiffness)) - np.diag(stiffness, 1) - np.diag(stiffness, -1)
    free = np.sqrt(np.maximum(eigh(K, np.diag(masses), eigvals_only=True), 0.0)) / (2 * np.pi)
    held = np.sqrt(eigh(K[1:, 1:], np.diag(masses[1:]), eigvals_only=True)) / (2 * np.pi)
    found = json.loads((tmp_path / "found" / "summary.json").read_text())
    figures = {name: each["value"] for name, each in found["figures"].items()}
    assert figures["X.antiresonance_1"] == pytest.approx(held[0], rel=0.03)
    assert figures["X.antiresonance_1_measured"] == pytest.approx(held[0], rel=0.03)
    modes = [mode["frequency"]["value"] for mode in found["modes"]]
    for frequency in free[1:][free[1:] < 240]:
        assert min(abs(one / frequency - 1) for one in modes) < 0.03


def test_a_dip_and_its_interval_without_a_model() -> None:
    """5 % of noise at lines of 1 Hz: the interval of 95 % has the dip and the peak of 40 records in nine of ten."""
    frequency = np.arange(11.0, 200.0)
    s = 2j * np.pi * frequency
    w, D = 2 * np.pi * 76.3, 0.004
    G = 100 * (1 + 1.05 * s**2 / (s**2 + 2 * D * w * s + w**2))
    dip, inside = 76.3 / np.sqrt(2.05), {"dip": 0, "peak": 0}
    for seed in range(40):
        rng = np.random.default_rng(seed)
        noisy = G * (1 + 0.05 * (rng.standard_normal(len(G)) + 1j * rng.standard_normal(len(G))))
        for name, values, true in (("dip", noisy, dip), ("peak", 1 / noisy, 76.3)):
            found, sigma = find_minimum(frequency, values, true * 1.01)
            assert found == pytest.approx(true, rel=0.01)
            inside[name] += abs(found - true) < 1.96 * sigma
    assert min(inside.values()) >= 36


def test_lines_that_show_no_dip_have_none() -> None:
    frequency = np.arange(11.0, 200.0)
    assert all(np.isnan(find_minimum(frequency, 1 + 0.01j * frequency, 80.0)))
    assert all(np.isnan(find_minimum(frequency[:5], np.ones(5, dtype=complex), 12.0)))


def test_scatter_is_that_of_the_noise() -> None:
    rng = np.random.default_rng(5)
    frequency = np.arange(11.0, 1000.0)
    noise = rng.standard_normal(len(frequency)) + 1j * rng.standard_normal(len(frequency))
    found = scatter(frequency, (50 + 0.01j * frequency) * (1 + 0.03 * noise))
    assert np.std(found.real) == pytest.approx(0.03, rel=0.1)
    assert np.std(found.imag) == pytest.approx(0.03, rel=0.1)
