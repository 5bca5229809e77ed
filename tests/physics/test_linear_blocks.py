"""The linear system's blocks alone: structure against scipy's hold equivalents, drive against the drive in time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import bilinear, cont2discrete, freqz

from feedsim.linear.plant import LinearDrive, ModalPlant, OperatingPoint, zero_order_hold
from feedsim.scenario import Filter
from physics import controller_reference
from scenario_helpers import default_machine

T = 125e-6
F = np.array([0.3, 5.0, 77.0, 410.0, 1234.5, 3999.0])
S = 2j * np.pi * F

# damping ratios about and beyond the critical one, where the two poles meet
SHAPES = [
    (3.0, 0.02), (25.0, 0.06), (910.0, 0.02), (2500.0, 0.02), (40.0, 0.0), (40.0, 1.0), (40.0, 1.00005),
    (40.0, 0.99995), (40.0, 1.0002), (40.0, 3.0), (900.0, 1.0), (900.0, 20.0), (0.5, 0.5),
]  # fmt: skip


def one_mode(frequency: float, damping: float) -> ModalPlant:
    one = np.ones((1, 1))
    return ModalPlant(np.array([2 * np.pi * frequency]), np.array([damping]), one, one, np.zeros((1, 3)))


def equivalent(frequency: float, damping: float, method: str) -> tuple[NDArray[Any], NDArray[Any]]:
    """Displacement and speed by scipy's hold equivalents."""
    w = 2 * np.pi * frequency
    # time in cycles keeps the matrices' entries near 1
    A = np.array([[0.0, 1.0], [-((w * T) ** 2), -2 * damping * w * T]])
    A, B, C, D, _ = cont2discrete((A, np.array([[0.0], [T]]), np.diag([T, 1.0]), np.zeros((2, 1))), 1.0, method)
    z = np.exp(S * T)
    y = np.array([(C @ np.linalg.solve(each * np.eye(2) - A, B) + D)[:, 0] for each in z])
    return y[:, 0], y[:, 1]


@pytest.mark.parametrize(("frequency", "damping"), [*SHAPES, (0.0, 0.0)])
@pytest.mark.parametrize(("hold", "method"), [("linear", "foh"), ("held", "zoh")])
def test_modes_are_hold_equivalents(frequency: float, damping: float, hold: Any, method: str) -> None:
    q, v = one_mode(frequency, damping).modal(S, T, hold)
    expected_q, expected_v = equivalent(frequency, damping, method)
    # scipy's way loses 1e-16 over (omega T)^2 = 6e-8 at the lowest frequency, and as much again in the numerator
    np.testing.assert_allclose(q[:, 0], expected_q, rtol=3e-8)
    np.testing.assert_allclose(v[:, 0], expected_v, rtol=3e-8)


@pytest.mark.parametrize("step", [1e-6, 125e-6, 2e-3, 20e-3])
@pytest.mark.parametrize("omega", [0.0, 30.0, 3000.0])
@pytest.mark.parametrize("inductances", [(5e-3, 5e-3), (0.8e-3, 20e-3)])
def test_the_held_motor_is_the_matrix_exponential(step: float, omega: float, inductances: tuple[float, float]) -> None:
    """Of a norm up to 1500. Doubling loses a bit a time, so that 1e-12 is left of what both begin with."""
    L_d, L_q = inductances
    A = np.array([[-2.0 / L_d, omega * L_q / L_d], [-omega * L_d / L_q, -2.0 / L_q]])
    both = expm(np.block([[A, np.eye(2)], [np.zeros((2, 4))]]) * step)
    Phi, Gamma = zero_order_hold(A, step)
    assert np.abs(Phi - both[:2, :2]).max() <= 1e-12
    assert np.abs(Gamma - both[:2, 2:]).max() <= 1e-12 * step
    assert np.array_equal(zero_order_hold(np.zeros((2, 2)), step)[1], step * np.eye(2))


def images(frequency: float, damping: float) -> NDArray[Any]:
    """The linear hold as a sum over all images of a sinusoid sampled and joined by lines: sinc^2 each."""
    total = np.zeros(len(F), dtype=complex)
    for k in range(-20000, 20001):
        s = S + 2j * np.pi * k / T
        w = 2 * np.pi * frequency
        total += np.sinc((F + k / T) * T) ** 2 / (s * s + 2 * damping * w * s + w * w)
    return total


@pytest.mark.parametrize(("frequency", "damping"), [(0.0, 0.0), (25.0, 0.06), (910.0, 0.02), (40.0, 1.0)])
def test_linear_hold_is_the_sum_over_its_images(frequency: float, damping: float) -> None:
    q, _ = one_mode(frequency, damping).modal(S, T, "linear")
    # the terms fall with the fourth power of k; rounding of the reference at the lowest frequency is 1e-16/(omega T)^2
    np.testing.assert_allclose(q[:, 0], images(frequency, damping), rtol=1e-9)


def test_sampling_vanishes_at_low_frequency() -> None:
    plant = one_mode(25.0, 0.06)
    low = S[:1]
    continuous = plant.modal(low, T, "continuous")
    for hold in ("linear", "held"):
        q, v = plant.modal(low, T, hold)  # type: ignore[arg-type]
        delay = 1 if hold == "linear" else np.exp(-low * T / 2)
        np.testing.assert_allclose(q[:, 0], continuous[0][:, 0] * delay, rtol=1e-7)  # (omega T)^2/6
        # the steps of a held input leave a ripple of T^2/12 of its slope in the speed: (omega_0 T)^2/12
        np.testing.assert_allclose(v[:, 0], continuous[1][:, 0] * delay, rtol=1e-7 if hold == "linear" else 5e-5)


# --- the drive ------------------------------------------------------------------------------------------------------


def drive(operating: OperatingPoint | None = None, **changes: Any) -> LinearDrive:
    machine = default_machine()
    axis = machine.axes["Z"]
    return LinearDrive(axis.drive.model_copy(update=changes), machine.cycles, axis.I_P, operating or OperatingPoint())


@pytest.mark.parametrize("kind", ["band_stop", "low_pass"])
def test_filters_are_scipys(kind: Any) -> None:
    w = 2 * np.pi * 700.0
    numerator = [w * w] if kind == "low_pass" else [1, 2 * 0.07 * w, w * w]
    b, a = bilinear(numerator, [1, 2 * 0.6 * w, w * w], w / math.tan(w * T / 2) / 2)
    _, expected = freqz(b, a, worN=2 * np.pi * F * T)
    found = drive(filter_1=Filter(type=kind, f=700.0, D_num=0.07, D_den=0.6)).filters(S)
    np.testing.assert_allclose(found, expected, rtol=1e-8)  # freqz evaluates polynomials that cancel at low frequency


def test_reference_model_is_tustin_and_delays_by_2_D_over_omega_0() -> None:
    d = drive(T_ref=0.3e-3)
    b, a = bilinear([915.3**2], [1, 2 * 1.214 * 915.3, 915.3**2], 1 / T)
    _, pt2 = freqz(b, a, worN=2 * np.pi * F * T)
    dead = 0.6 * np.exp(-S * 2 * T) + 0.4 * np.exp(-S * 3 * T)  # 2.4 cycles
    np.testing.assert_allclose(d.reference_model(S), pt2 * dead, rtol=1e-8)
    low = np.array([2j * np.pi * 1e-3])
    assert -np.angle(d.reference_model(low))[0] / (2 * np.pi * 1e-3) == pytest.approx(2 * 1.214 / 915.3 + 0.3e-3)


# --- the drive against its own equations in time, motor included -----------------------------------------------------

ROWS = 4000  # 0.5 s: the start, a jump to the load, has died out; whole periods of every tone in the second half
# Tones that excite each input, all at once: the drive is linear.
TONES = {"n_add": (16.0, 1000.0), "M_add": (240.0, 3000.0), "n_a": (72.0, 1800.0)}
AMPLITUDE = 1e-4  # the motor's equations hold products of deviations: 1e-4 of this, at sums of the tones
SETTINGS: dict[str, dict[str, Any]] = {
    "as shipped": {},
    "salient": {"L_d": 0.003},
    "no resistance": {"R": 0.0},
    "ideal": {"ideal_current_loop": True},
}


def simulated(changes: dict[str, Any], at: OperatingPoint) -> NDArray[np.float64]:
    """(ROWS,) M_a per AMPLITUDE of all tones, position loop open, P controller."""
    p = controller_reference.DEFAULTS | {key: float(value) for key, value in changes.items()}
    p |= {"K_v": 0.0, "k_ffw": 0.0, "M_max": 1e9, "u_max": 1e9, "speed_integrator": 0.0}
    run = controller_reference.drive(p)
    next(run)
    t = np.arange(ROWS) * T
    waves = {name: sum(np.sin(2 * np.pi * f * t) for f in tones) * AMPLITUDE for name, tones in TONES.items()}
    rest = {"n_add": at.n, "n_a": at.n, "M_add": at.M}
    return (
        np.array(
            [
                run.send(
                    controller_reference.Inputs(**{name: rest[name] + wave[k] for name, wave in waves.items()})
                ).M_a[0]
                for k in range(ROWS)
            ]
        )
        / AMPLITUDE
    )


def phasor(values: NDArray[np.float64], f: float) -> complex:
    """Of the sine at f [Hz] in the second half of the rows."""
    t = np.arange(ROWS) * T
    return complex(np.mean((2j * np.exp(-2j * np.pi * f * t) * values)[ROWS // 2 :]))


@pytest.mark.parametrize("setting", SETTINGS)
@pytest.mark.parametrize("at", [OperatingPoint(), OperatingPoint(n=200.0, M=15.0)], ids=["still", "moving"])
def test_torque_of_the_drive(setting: str, at: OperatingPoint) -> None:
    if setting == "no resistance" and at.n:
        pytest.skip("without resistance an electrical rotation does not settle within the simulation")
    changes = SETTINGS[setting]
    linear = drive(at, speed_integrator=False, **changes)
    torque = simulated(changes, at)
    for name, tones in TONES.items():
        for f in tones:
            s = np.array([2j * np.pi * f])
            E, G_n = linear.torque(s)
            expected = {"n_add": E * linear.from_setpoint(s), "M_add": E, "n_a": -E * linear.from_speed(s) - G_n}[name]
            assert phasor(torque, f) == pytest.approx(complex(expected[0]), rel=1e-6), f"{name} at {f:g} Hz"


def test_setpoints_of_the_position_controller() -> None:
    """n_s at the ticks, by the drive in time, against delay, gain and ramp: x_s, n_ffw and x_a each alone."""
    f, amplitude = 72.0, 1e-5
    t = np.arange(ROWS) * T
    wave = amplitude * np.sin(2 * np.pi * f * t)
    s = np.array([2j * np.pi * f])
    for changes in ({}, {"ramp_speed_setpoint": False}, {"symmetry_lag": True}, {"T_dyn": 0.3e-3, "T_sym": 0.2e-3}):
        linear = drive(**changes)
        expected = {
            "x_s": linear.position_gain * linear.setpoint_delay(s),
            "n_ffw": linear.feedforward(s),
            "x_a": -linear.position_gain * np.ones(1),
        }
        for name, value in expected.items():
            run = controller_reference.drive(
                controller_reference.DEFAULTS
                | {key: float(each) for key, each in changes.items()}
                | {"ideal_current_loop": 1.0}
            )
            next(run)
            n_s = np.array([run.send(controller_reference.Inputs(**{name: each})).n_s for each in wave])
            assert phasor(n_s, f) / amplitude == pytest.approx(complex((value * linear.ramp(s))[0]), rel=1e-9)
