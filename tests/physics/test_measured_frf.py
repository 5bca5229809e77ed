"""Frequency responses measured on the units against closed forms of the modal structure and the sampled drives.

Two oracles: the sum over the modes, each with the first-order hold that the plant has (written here, from the mode
table alone), and the closed form of the whole coupled system (feedsim.linear).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from feedsim.analysis import campaign as estimate
from feedsim.files.trace.response import FrequencyResponse
from feedsim.foundation.errors import InputError
from feedsim.linear.loops import speed_gain
from feedsim.linear.system import LinearSystem
from feedsim.scenario import load_machine
from feedsim.simulation.cosim.excitation import binary_sequence, multisine
from feedsim.simulation.cosim.excite import Measurement, measure, usual_rms
from feedsim.structure import checked_modes
from scenario_helpers import default_machine
from structure_helpers import MACHINES

Complexes = NDArray[np.complex128]
Floats = NDArray[np.float64]

Measure = Callable[..., list[Measurement]]
MACHINE = default_machine()
MODES = checked_modes(MACHINE)
CLOSED = LinearSystem(MACHINE, MODES)
T_C = MACHINE.cycles.T_c


@pytest.fixture(scope="module")
def excited(fmus: Path) -> Measure:
    """Measurements with multisines of several seeds, the usual amplitude times `share`."""

    def run(
        axis: str, inject: str, *, seeds: Sequence[int] = (0, 1), share: float = 1.0, signal: Any = None, **options: Any
    ) -> list[Measurement]:
        rms = share * usual_rms(MACHINE, axis, inject)
        signals = [multisine(MACHINE.cycles, rms, seed=seed, **(signal or {})) for seed in seeds]
        return [measure(MACHINE, axis, each, inject=inject, fmus=fmus, **options) for each in signals]

    return run


def modal_sum(frequency: Floats, rotor: str, out: str, speed: bool) -> Complexes:
    """Response to a torque or force that is linear between instants, from the discretised modes (van Loan's way)."""
    z = np.exp(2j * np.pi * frequency * T_C)
    total = np.zeros(len(frequency), dtype=np.complex128)
    for f, damping, b, c in zip(MODES.frequency, MODES.damping, MODES.ports[rotor], MODES.ports[out], strict=True):
        omega = 2 * np.pi * f
        # states q, q', u, and the slope of u over the cycle
        A = np.zeros((4, 4))
        A[0, 1] = 1
        A[1, :3] = [-(omega**2), -2 * damping * omega, b]
        A[2, 3] = 1
        over = expm(A * T_C)
        Phi, held, sloped = over[:2, :2], over[:2, 2], over[:2, 3]
        into = held[:, None] + sloped[:, None] * (z - 1) / T_C
        # (z - Phi) q = into, solved for two states by hand
        a, d = z - Phi[0, 0], z - Phi[1, 1]
        determinant = a * d - Phi[0, 1] * Phi[1, 0]
        q = (d * into[0] + Phi[0, 1] * into[1]) / determinant
        v = (Phi[1, 0] * into[0] + a * into[1]) / determinant
        total += c * (v if speed else q)
    return total


def deviation(
    found: FrequencyResponse, name: str, expected: Complexes, band: tuple[float, float]
) -> tuple[float, float]:
    """Largest deviation in dB and degrees within the band; coherence must exceed 0.99 everywhere in it."""
    inside = (found.frequency >= band[0]) & (found.frequency <= band[1])
    assert inside.sum() > 100
    assert found.coherence[name][inside].min() > 0.99
    ratio = (found[name] / expected)[inside]
    return float(np.abs(20 * np.log10(np.abs(ratio))).max()), float(np.degrees(np.abs(np.angle(ratio))).max())


# Lines 2 Hz apart up to 500 Hz, periods of 0.5 s; 4 s let the slowest modes (decay time 0.25 s) settle to 1e-7.
SPARSE = {"signal": {"band": (4, 500), "resolution": 2.0}, "settle": 8}

# What is demanded is 0.1 dB and 1 degree. What remains without friction is rounding, and the motor's products of speed
# and current, which grow with the amplitude: a thousandth of a per cent.
ROUNDING = 1e-6  # dB; degrees ten times that
MOTOR = 1e-4


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_measured_against_closed_form(excited: Measure, axis: str) -> None:
    n_M, x_M, speed = f"{axis}.n_a/{axis}.M_a", f"{axis}.x_a/{axis}.M_a", f"{axis}.n_a/{axis}.n_s"
    pairs = [(f"{axis}.n_a", f"{axis}.M_a"), (f"{axis}.x_a", f"{axis}.M_a"), (f"{axis}.n_a", f"{axis}.n_s")]
    found = estimate.estimate_responses(excited(axis, "n_add", **SPARSE), pairs)
    figures = {}
    for name, allowed in ((n_M, ROUNDING), (x_M, ROUNDING), (speed, MOTOR)):
        output, _, given = name.partition("/")
        expected = CLOSED.ratio(found.frequency, output, given, f"{axis}.n_add")
        figures[name] = deviation(found, name, expected, (5, 500))
        assert figures[name][0] < allowed
        assert figures[name][1] < 10 * allowed
    force = f"tool.F_{axis}"
    compliance = f"tool.x_{axis}/{force}"
    found = estimate.estimate_responses(excited(axis, force, seeds=(0,), **SPARSE), [(f"tool.x_{axis}", force)])
    expected = CLOSED.response(found.frequency, [force], [f"tool.x_{axis}"])[compliance]
    figures[compliance] = deviation(found, compliance, expected, (5, 500))
    assert figures[compliance][0] < ROUNDING
    assert figures[compliance][1] < 10 * ROUNDING
    print("\n" + "\n".join(f"{name}: {dB:.1e} dB, {deg:.1e} deg" for name, (dB, deg) in figures.items()))  # pytest -s


def test_open_loop_gain_is_that_of_one_axis_measured_and_the_others_held(excited: Measure) -> None:
    """The control's own way: n_a/n_s = (S/C) L/(1 + L), measured with the others under position control, gives L."""
    found = estimate.estimate_responses(excited("Z", "n_add", seeds=(0,), **SPARSE), [("Z.n_a", "Z.n_s")])
    f, reference = found.frequency, found["Z.n_a/Z.n_s"]
    s, drive = 2j * np.pi * f, CLOSED.drives[CLOSED.axes.index("Z")]
    from_measured = reference / (drive.from_setpoint(s) / drive.from_speed(s) - reference)
    gain = speed_gain(CLOSED, "Z", s)
    # where L is large, its inverse is a small difference that takes the motor's products along
    np.testing.assert_allclose(from_measured, gain, rtol=100 * MOTOR)
    every_open = speed_gain(CLOSED.closing("speed"), "Z", s)
    assert np.abs(20 * np.log10(np.abs(every_open / gain))).max() > 0.2


def test_other_axes_are_part_of_what_is_measured(excited: Measure) -> None:
    """n_Z = H_ZZ M_Z + the answers of the other drives: with their torques taken off, the modal sum alone is left."""
    measurement = excited("Z", "M_add", seeds=(0,), **SPARSE)[0]
    columns = ("Z.n_a", "Z.M_a", "X.M_a", "Y.M_a")
    found = estimate.estimate_responses([measurement], [(name, "Z.M_add") for name in columns])
    n, M_Z, M_X, M_Y = (found[f"{name}/Z.M_add"] for name in columns)
    f = found.frequency
    expected = sum(modal_sum(f, f"n_{axis}", "n_Z", True) * M for axis, M in (("Z", M_Z), ("X", M_X), ("Y", M_Y)))
    np.testing.assert_allclose(n, expected, rtol=1e-7)  # rounding
    # and they do matter: tens of per cent where the other axes' modes are
    assert np.abs(modal_sum(f, "n_Z", "n_Z", True) * M_Z / n - 1).max() > 0.1


def test_what_the_design_says_of_n_over_M(excited: Measure) -> None:
    """Figures of the default machine from its description."""
    signal = {"resolution": 0.5, "band": (0.5, 500)}
    found = {
        axis: estimate.estimate_responses(
            excited(axis, "M_add", seeds=(0,), signal=signal), [(f"{axis}.n_a", f"{axis}.M_a")]
        )
        for axis in ("X", "Z")
    }
    normed = {}
    for axis, response in found.items():
        omega = 2 * np.pi * response.frequency
        normed[axis] = np.abs(response[f"{axis}.n_a/{axis}.M_a"]) * MODES.J_tot(axis) * omega
        slow = response.frequency < 5
        np.testing.assert_allclose(normed[axis][slow], 1, atol=0.01)
    assert_peak(found["Z"].frequency, normed["Z"], 22.3, 1)
    for axis, low, high in (("Z", 119.3, 131.8), ("Z", 175.3, 188.0), ("X", 85.2, 94.8)):
        assert_peak(found[axis].frequency, normed[axis], low, -1)
        assert_peak(found[axis].frequency, normed[axis], high, 1)


def assert_peak(frequency: Floats, values: Floats, expected: float, sign: int) -> None:
    """A maximum (sign 1) or minimum (-1) within 0.5 % of the expected frequency, by a parabola through three lines."""
    near = np.flatnonzero(np.abs(frequency - expected) < 0.06 * expected)
    k = near[np.argmax(sign * values[near])]
    assert near[0] < k < near[-1]
    before, at, after = np.log(values[k - 1 : k + 2])
    found = frequency[k] + (frequency[k + 1] - frequency[k]) * 0.5 * (before - after) / (before - 2 * at + after)
    assert found == pytest.approx(expected, rel=0.005)


def test_binary_sequence_finds_the_same(fmus: Path) -> None:
    """Another signal, one period: none of the lines is the image of another, so that nothing is to be averaged."""
    signal = binary_sequence(MACHINE.cycles, usual_rms(MACHINE, "Z", "M_add"), seed=1)
    measurement = measure(MACHINE, "Z", signal, fmus=fmus)
    found = estimate.estimate_responses([measurement], [("Z.n_a", "Z.M_a"), ("Z.x_a", "Z.M_add")])
    assert (
        deviation(found, "Z.n_a/Z.M_a", CLOSED.ratio(found.frequency, "Z.n_a", "Z.M_a", "Z.M_add"), (5, 500))[0]
        < ROUNDING
    )
    expected = CLOSED.response(found.frequency, ["Z.M_add"], ["Z.x_a"])["Z.x_a/Z.M_add"]
    assert deviation(found, "Z.x_a/Z.M_add", expected, (5, 500))[0] < MOTOR


def friction_torque(frequency: Floats, axis: str, n: float) -> Complexes:
    """M_fr/n of LuGre about a steady speed, linearised; k = 1 after a long way: with g in bristle deflection,

    dz' = n g'/g dn - n/g dz,  dM = sigma_0 dz + sigma_1 dz' + sigma_2 dn
    """
    p = MACHINE.axes[axis].friction
    static = p.F_S - p.F_C
    g = (p.F_C + static * np.exp(-((n / p.v_s) ** p.beta)) + p.F_log * np.log(n / p.v_log + 1)) / p.sigma_0
    assert p.beta == 1
    slope = (-static / p.v_s * np.exp(-n / p.v_s) + p.F_log / (p.v_log + n)) / p.sigma_0
    s = 2j * np.pi * frequency
    z = slope * (n / g) / (s + n / g)
    return np.asarray((p.sigma_0 + p.sigma_1 * s) * z + p.sigma_2)


def test_moving_axis_with_friction(excited: Measure) -> None:
    """At an offset speed friction is a small damper: n/M = 1/(1/(n/M without it) + M_fr/n).

    The other axes stand, held by their bristles instead of by their drives alone: 0.05 dB below 60 Hz.
    """
    speed = 20.0
    measurements = excited(
        "Z", "n_add", share=0.25, friction=True, offset_speed=speed, signal={"band": (1, 500), "spacing": "logarithmic"}
    )
    found = estimate.estimate_responses(measurements, [("Z.n_a", "Z.M_a"), ("Z.M_fr", "Z.n_a")])
    low = found.frequency <= 60 * (1 + 1e-9)
    frequency, n_M = found.frequency[low], found["Z.n_a/Z.M_a"][low]
    frictionless = CLOSED.ratio(frequency, "Z.n_a", "Z.M_a", "Z.n_add")
    friction = friction_torque(frequency, "Z", speed)
    assert found.coherence["Z.n_a/Z.M_a"][low].min() > 0.99
    expected = 1 / (1 / frictionless + friction)
    assert np.abs(20 * np.log10(np.abs(n_M / expected))).max() < 0.1
    assert np.degrees(np.abs(np.angle(n_M / expected))).max() < 1
    # the friction unit's own small signal, which is hidden in n/M
    np.testing.assert_allclose(found["Z.M_fr/Z.n_a"][low], friction, rtol=0.02)
    for measurement in measurements:
        assert not measurement.warnings


def test_friction_at_standstill_is_warned_of(excited: Measure) -> None:
    """The bristles hold the axis: n/M reads some -50 dB at 1 Hz, where it is 20 dB without friction."""
    measurement = excited("Z", "M_add", seeds=(0,), signal={"band": (1, 400)}, friction=True)[0]
    assert "axis-held-by-friction" in [finding.code for finding in measurement.warnings]
    found = estimate.estimate_responses([measurement], [("Z.n_a", "Z.M_a")])
    assert 20 * np.log10(abs(found["Z.n_a/Z.M_a"][0])) < -25
    assert "Z.M_fr" in measurement.trace


def test_reversal_under_friction_is_warned_of(excited: Measure) -> None:
    signal = {"band": (1, 400), "resolution": 4.0}
    measurement = excited("Z", "n_add", seeds=(0,), share=3, signal=signal, friction=True, offset_speed=-0.5)[0]
    assert "axis-reverses" in [finding.code for finding in measurement.warnings]


def test_excitation_into_a_limit_is_refused(excited: Measure) -> None:
    signal = {"band": (1, 400), "resolution": 4.0}
    with pytest.raises(
        InputError, match=r"axis Z: torque limited in .* % of the instants \(M_max 80 N.m\); M_add has 80 N"
    ):
        excited("Z", "M_add", seeds=(0,), share=20, signal=signal)


def test_unsettled_response_is_warned_of(excited: Measure) -> None:
    signal = {"band": (5, 400), "resolution": 10.0}
    hasty = excited("Z", "M_add", seeds=(0,), signal=signal, settle=0)[0]
    assert "not-settled" in [finding.code for finding in hasty.warnings]
    assert excited("Z", "M_add", seeds=(0,), signal=signal, settle=30)[0].unsettled_share < 1e-6


def test_rounding_of_an_axis_that_is_not_reached_is_no_response(fmus: Path) -> None:
    """Y of this machine has no mode in common with X: what it does while X is excited is the last bit of its values."""
    machine = load_machine(MACHINES / "sinumerik_840d")
    signal = multisine(machine.cycles, 0.3, band=(5, 400), resolution=5.0)
    measurement = measure(machine, "X", signal, settle=26, periods=2, fmus=fmus)
    assert 0 < np.std(measurement.trace["Y.n_s"]) < 1e-9 * np.std(measurement.trace["X.n_s"])
    assert measurement.unsettled_share < 1e-6
    assert not measurement.warnings
    assert measure(machine, "X", signal, settle=0, periods=2, fmus=fmus).unsettled_share > 1e-3


@pytest.mark.parametrize(("speed", "middle"), [(5.0, 0.1), (-5.0, 0.1), (50.0, None)])
def test_travel_is_kept(fmus: Path, speed: float, middle: float | None) -> None:
    """The middle of the excitation lies at the pose, Z 100 mm; 4 s at 50 rad/s are 640 mm, of 685 mm that there are."""
    signal = multisine(MACHINE.cycles, 0.1, band=(5, 400), resolution=5.0)
    moving = measure(MACHINE, "Z", signal, offset_speed=speed, periods=2, settle=13, fmus=fmus)
    low, high = MACHINE.axes["Z"].travel
    x, v = moving.trace["Z.x_a"], speed * MACHINE.axes["Z"].I_P
    assert low <= x.min() < x.max() <= high
    assert x[-1] - x[0] == pytest.approx(2 * signal.period * v, rel=0.01)
    if middle is not None:
        assert (x[0] - 13 * signal.period * v + x[-1]) / 2 == pytest.approx(middle, abs=1e-4)
    else:
        assert x[0] - (14 * signal.period + 1) * v == pytest.approx(low, abs=0.05)  # it starts at the end of its travel
    found = estimate.estimate_responses([moving], [("Z.x_a", "Z.M_a")])
    expected = CLOSED.ratio(found.frequency, "Z.x_a", "Z.M_a", "Z.M_add")
    np.testing.assert_allclose(found["Z.x_a/Z.M_a"], expected, rtol=1e-4)  # the travel is taken out


def test_too_fast_and_too_far(fmus: Path) -> None:
    signal = multisine(MACHINE.cycles, 0.1, band=(5, 400), resolution=5.0)
    with pytest.raises(
        InputError, match=r"axis Z travels 3\d+\.\d mm in a measurement of 7\.\d+ s at 155 rad/s; there are 685"
    ):
        measure(MACHINE, "Z", signal, offset_speed=155.0, periods=10, settle=20, fmus=fmus)
    with pytest.raises(InputError, match=r"offset speed 160 rad/s: axis X reaches a speed of 30\.558 m/min"):
        measure(MACHINE, "X", signal, offset_speed=160.0, settle=0, fmus=fmus)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"axis": "W"}, "no axis 'W'"),
        ({"inject": "M_ad"}, "no input 'M_ad' to excite; did you mean 'M_add'"),
        ({"periods": 0}, "0 periods to be recorded; at least 1"),
        ({"periods": 1, "offset_speed": 3.0}, "at least 2 are needed while the axis moves"),
        ({"settle": -1}, "-1 periods to settle"),
        ({"offset_speed": float("inf")}, "must be finite"),
    ],
)
def test_arguments_refused(options: dict[str, Any], message: str) -> None:
    signal = multisine(MACHINE.cycles, 0.1, band=(5, 400), resolution=10.0)
    arguments: dict[str, Any] = {"axis": "Z", "excitation": signal}
    with pytest.raises(InputError, match=message):
        measure(MACHINE, **(arguments | options))
