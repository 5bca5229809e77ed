"""Modes out of responses: of axes in closed form whose modes are known, with noise, and of a measured bench."""

from __future__ import annotations

import csv
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.signal import cont2discrete, lfilter

from feedsim.cli import main
from feedsim.estimation.modal.estimate import estimate_responses, period_of
from feedsim.estimation.modal.rational import Mode, RationalFit, fit_responses
from feedsim.files.trace import Trace, write_csv
from feedsim.files.trace.response import FrequencyResponse
from feedsim.files.trace.response_files import write_response
from feedsim.files.trace.trace import Array
from feedsim.scenario import load_machine
from feedsim.structure import checked_modes

MACHINE = Path(__file__).resolve().parents[2] / "scenarios" / "machines" / "one_axis"
RATE = 2000.0


def closed_form(
    frequency: Array, modes: list[tuple[float, float, float, float]], a: float = 50.0, delay: float = 4e-4
) -> dict[str, Array]:
    """Accelerations at motor and scale over the torque. modes: frequency [Hz], damping, residues over a."""
    s = 2j * np.pi * frequency
    found = {}
    for k, name in enumerate(("motor", "scale")):
        G = a * s / (s + 5.0) * (1 if k == 0 else -1)
        for f, D, *residues in modes:
            w = 2 * np.pi * f
            G = G + a * residues[k] * s**2 / (s**2 + 2 * D * w * s + w**2)
        found[name] = G * np.exp(-s * delay * (k + 1))
    return found


ONE = [(62.0, 0.02, 0.8, 0.7)]
TWO = [(41.0, 0.03, 0.4, 0.3), (118.0, 0.015, 0.9, -0.5)]


@pytest.mark.parametrize("modes", [[], ONE, TWO], ids=["rigid", "one", "two"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_modes_and_their_number_come_back(modes: list[tuple[float, float, float, float]], seed: int) -> None:
    """2 % of noise at every line: frequencies within 2 %, damping within a quarter, delays within 0.05 ms; and the
    number is that of the truth, neither less nor more. Intervals of 95 % hold the frequency."""
    rng = np.random.default_rng(seed)
    frequency = np.arange(5.0, 220.0)
    true = closed_form(frequency, modes)

    def noise() -> Array:
        return 0.02 * (rng.standard_normal(len(frequency)) + 1j * rng.standard_normal(len(frequency)))

    values = {name: each * (1 + noise()) for name, each in true.items()}
    found = fit_responses(frequency, values, {name: np.full(len(frequency), 0.02) for name in values})
    assert len(found.modes) == len(modes)
    for own, (f, D, motor, scale) in zip(found.modes, modes, strict=True):
        assert own.frequency == pytest.approx(f, rel=0.02)
        assert abs(own.frequency - f) <= 1.96 * own.frequency_sigma
        assert own.damping == pytest.approx(D, rel=0.25)
        assert own.residues["motor"] == pytest.approx(50 * motor, rel=0.1)
        assert own.residues["scale"] == pytest.approx(50 * scale, rel=0.1)
    assert found.delay["motor"] == pytest.approx(4e-4, abs=5e-5)
    assert found.delay["scale"] == pytest.approx(8e-4, abs=5e-5)
    assert found.rigid["scale"] == pytest.approx(-50.0, rel=0.05)


@pytest.mark.parametrize(
    ("further", "why"),
    [
        ((70.0, 2e-4, 0.009, 0.0), "it is 0.17 Hz wide, and the lines there are 1 Hz apart"),
        ((75.0, 0.05, 0.02, 0.0), "its ratio of inertias is 0.011, by (f_r/f_a)^2 - 1 of dip and peak 0.82"),
        ((30.0, 0.2, 0.009, 0.0), "it changes the response by 2.2 % at most"),
    ],
    ids=["narrow", "under another peak", "hidden"],
)
def test_modes_that_lines_do_not_show(further: tuple[float, float, float, float], why: str) -> None:
    """Beside a mode of 62 Hz that they do show, and which stays without a word."""
    frequency = np.arange(5.0, 220.0)
    fit = fit_responses(frequency, closed_form(frequency, ONE), {name: np.zeros(215) for name in ("motor", "scale")}, 1)
    assert fit.implausible(frequency) == []
    assert (
        len(fit_responses(frequency, {"motor": fit.response("motor", frequency)}, {"motor": np.zeros(215)}).modes) == 1
    )
    own = Mode(*further[:2], 0.0, 0.0, {"motor": 50 * further[2], "scale": 50 * further[3]})
    two = replace(
        fit, modes=tuple(sorted((*fit.modes, own), key=lambda mode: mode.frequency)), parameters=with_mode(own, fit)
    )
    ((mode, said),) = two.implausible(frequency)
    assert mode is own
    assert said.startswith(why)
    assert two.without(own) == pytest.approx(fit.parameters)


def with_mode(mode: Mode, fit: RationalFit) -> Array:
    """The parameters of a fit with one mode, and those of a second one."""
    x = fit.parameters
    poles = [*x[:3], np.log(2 * np.pi * mode.frequency), np.log(mode.damping)]
    return np.array([*poles, *x[3:6], mode.residues["motor"], *x[6:9], mode.residues["scale"]])


@pytest.mark.skipif("FEEDSIM_TWO_INERTIA" not in os.environ, reason="FEEDSIM_TWO_INERTIA names no record")
def test_few_lines_of_a_measured_bench() -> None:
    """Of 40 lines, some 5 Hz apart near 56 Hz, cross-validation takes a mode of half a hertz there besides."""
    record = loadmat(os.environ["FEEDSIM_TWO_INERTIA"])
    current, angle = (np.ravel(record[name]).astype(float) for name in ("iq_adx", "theta_mx"))
    found = estimate_responses([current], {"motor": [angle]}, 1 / 2500, period=2500)
    rows = np.unique(np.searchsorted(found.frequency, np.geomspace(11.0, 249.0, 40)))
    frequency = found.frequency[rows]
    values = {"motor": found.values["motor"][rows] * (2j * np.pi * frequency) ** 2}
    fit = fit_responses(frequency, values, {"motor": found.relative["motor"][rows]})
    assert [mode.frequency for mode in fit.modes] == pytest.approx([76.3], abs=0.5)
    assert fit.modes[0].residues["motor"] / fit.rigid["motor"] == pytest.approx(1.0, abs=0.03)
    assert all("left out: it is" in each for each in fit.refused)


def bench(count: int, periodic: bool, seed: int) -> tuple[Array, Array]:
    """Torque and motor speed of two inertias, sampled with a zero-order hold by exact discretisation: 62 Hz, 2 %."""
    rng = np.random.default_rng(seed)
    period = 2000
    if periodic:
        lines = np.zeros(period // 2 + 1, dtype=complex)
        lines[5:221] = np.exp(2j * np.pi * rng.random(216))
        u = np.tile(np.fft.irfft(lines) * period, count // period)
    else:
        u = rng.standard_normal(count)
    w, D = 2 * np.pi * 62.0, 0.02
    # Speed over torque: 50/(s + 5) + 40 s/(s^2 + 2 D w s + w^2)
    y = np.zeros(len(u))
    for num, den in (([50.0], [1.0, 5.0]), ([40.0, 0.0], [1.0, 2 * D * w, w**2])):
        b, a, _ = cont2discrete((num, den), 1 / RATE, "zoh")
        y = y + lfilter(np.ravel(b), a, u)
    return u, y + 0.01 * np.std(y) * rng.standard_normal(len(y))


@pytest.mark.parametrize("periodic", [True, False])
def test_time_signals_by_periods_and_by_segments(periodic: bool) -> None:
    """A multisine's period is found, its lines alone are used; noise without a period takes segments. Both give the
    dip and the peak of the bench, the hold of half a sample as a delay."""
    u, y = bench(40000, periodic, 1)
    assert (period_of(u) == 2000) == periodic
    found = estimate_responses([u], {"motor": [y]}, 1 / RATE)
    assert ("18 periods" in found.method) == periodic
    if periodic:
        assert found.frequency[[0, -1]] == pytest.approx([5.0, 220.0])
    within = (found.frequency >= 5) & (found.frequency <= 220)
    frequency = found.frequency[within]
    values = {"motor": found.values["motor"][within] * 2j * np.pi * frequency}
    fit = fit_responses(frequency, values, {"motor": found.relative["motor"][within]})
    assert [mode.frequency for mode in fit.modes] == pytest.approx([62.0], rel=0.01)
    assert fit.modes[0].residues["motor"] / fit.rigid["motor"] == pytest.approx(0.8, rel=0.05)
    assert fit.delay["motor"] == pytest.approx(0.5 / RATE, abs=0.1 / RATE)


def test_the_command_writes_a_table_that_machines_take(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Responses of a file, motor and scale against each other: the modes replace the machine's elastic ones, its rigid
    motion stays, and the machine runs with the table."""
    frequency = np.arange(5.0, 220.0)
    s = 2j * np.pi * frequency
    true = closed_form(frequency, ONE)
    response = FrequencyResponse(
        frequency, {"n/M": true["motor"] / s, "x/M": true["scale"] / s**2}, {"n/M": "(rad/s)/(N.m)", "x/M": "rad/(N.m)"}
    )
    write_response(tmp_path / "response.csv", response)
    words = [
        "identify-modes",
        str(tmp_path / "response.csv"),
        "--machine",
        str(MACHINE),
        "--motor",
        "n/M",
        "--scale",
        "x/M",
    ]
    assert main([*words, "--quiet", "--out", str(tmp_path / "found")]) == 0
    assert "motor and scale count against each other" in capsys.readouterr().err
    found = json.loads((tmp_path / "found" / "summary.json").read_text())
    assert [mode["frequency"]["value"] for mode in found["modes"]] == pytest.approx([62.0], rel=1e-3)
    assert found["figures"]["X.antiresonance_1"]["value"] == pytest.approx(62.0 / np.sqrt(1.8), rel=0.01)
    with (tmp_path / "found" / "modes.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["frequency [Hz]"]) for row in rows] == pytest.approx([0.0, 62.0], rel=1e-3)
    own = load_machine(MACHINE, [f"modes={tmp_path}/found/modes.csv"])
    before, after = checked_modes(load_machine(MACHINE)), checked_modes(own)
    assert after.J_tot("X") == pytest.approx(before.J_tot("X"))
    n = after.ports["n_X"]
    assert (n[1] / n[0]) ** 2 == pytest.approx(0.8, rel=0.01)
    x = after.ports["x_X"]
    # The scale's residue is against its own rigid motion, whose sign is turned.
    assert x[1] * n[1] / (x[0] * n[0]) == pytest.approx(-0.7, rel=0.01)


def test_what_is_no_axis_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A closed loop's response, a signal without a unit, a column that is not there: a sentence and status 2."""
    frequency = np.arange(5.0, 400.0, 2.0)
    s = 2j * np.pi * frequency
    loop = 1 / (1 + s / 300 + s**2 / 400**2)
    write_response(tmp_path / "loop.csv", FrequencyResponse(frequency, {"n/M": loop}, {"n/M": "(rad/s)/(N.m)"}))
    words = ["--machine", str(MACHINE), "--quiet", "--out", str(tmp_path / "out")]
    assert main(["identify", "modes", str(tmp_path / "loop.csv"), *words]) == 2
    assert "not the setpoint of a closed loop" in capsys.readouterr().err
    u, y = bench(4000, True, 1)
    write_csv(tmp_path / "log.csv", Trace(np.arange(len(u)) / RATE, {"M": u, "n": y}, {"M": "N.m"}))
    assert main(["identify", "modes", str(tmp_path / "log.csv"), "--input", "M", "--motor", "n", *words]) == 2
    assert "'n' has no unit in the file; a unit of rad, m, rad/s" in capsys.readouterr().err
    assert main(["identify", "modes", str(tmp_path / "log.csv"), "--input", "M", "--motor", "v:rad/s", *words]) == 2
    assert "v" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif("FEEDSIM_TWO_INERTIA" not in os.environ, reason="FEEDSIM_TWO_INERTIA names no record")
def test_a_measured_bench_of_two_inertias(tmp_path: Path) -> None:
    """MultisineTypeA.mat of FdiTools: 240 lines from 11 Hz. Dip and peak within 1 % of the measured lines, ratio
    within 3 %; 90 % of the lines within 0.7 dB and 6 degrees at the motor, 2.5 dB at the load. Its phase is met as
    well as neighbouring lines agree, which is 16 degrees: above 205 Hz the load hardly moves."""
    words = ["--machine", str(MACHINE), "--input", "iq_adx:A", "--motor", "theta_mx:rad", "--scale", "theta_my:rad"]
    words += ["--interval", "0.4ms", "--quiet", "--out", str(tmp_path)]
    assert main(["identify", "modes", os.environ["FEEDSIM_TWO_INERTIA"], *words]) == 0
    figures = {k: v["value"] for k, v in json.loads((tmp_path / "summary.json").read_text())["figures"].items()}
    for name in ("antiresonance_1", "resonance_1"):
        assert figures[f"X.{name}"] == pytest.approx(figures[f"X.{name}_measured"], rel=0.01)
    assert figures["X.motor_magnitude_left"] < 0.7
    assert figures["X.motor_phase_left"] < 6
    assert figures["X.scale_magnitude_left"] < 2.5
    assert figures["X.scale_phase_left"] < 0.9 * figures["X.scale_phase_scatter"]
    assert figures["X.ratio"] == pytest.approx(figures["X.ratio_measured"], rel=0.03)
    assert figures["X.inertia_ratio"] == pytest.approx(figures["X.ratio_measured"], rel=0.03)


@pytest.mark.skipif("FEEDSIM_TRACE" not in os.environ, reason="FEEDSIM_TRACE names no trace")
def test_the_response_of_a_control_from_its_time_signals() -> None:
    """The control's own spectrum of its speed loop, from the same time signals: equal up to 400 Hz. Its frequencies are
    those of 2044 samples, of which it recorded 2047."""
    from feedsim.files.trace import read_recording
    from feedsim.files.trace.response_files import read_response

    path = Path(os.environ["FEEDSIM_TRACE"])
    recording = read_recording(path)
    read = recording.read(recording.names)
    runs = {node: [read[f"axis 1 node {node} run {k}"] for k in (1, 2)] for node in (61, 62)}
    found = estimate_responses(runs[62], {"speed": runs[61]}, float(np.diff(read["time"])[0]))
    own = read_response(path)
    values = np.asarray(own[own.names[0]])
    # Line by line: the first lines are all excited.
    count = int(np.sum(found.frequency < 400))
    assert np.max(np.abs(found.frequency[:count] / own.frequency[:count] - 1)) < 2e-3
    ratio = found.values["speed"][:count] / values[:count]
    assert np.max(np.abs(20 * np.log10(np.abs(ratio)))) < 0.01
    assert np.max(np.abs(np.degrees(np.angle(ratio)))) < 0.1
