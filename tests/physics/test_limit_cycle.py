"""The swing of an axis with play in its position loop, against a second solution of structure and contact.

Between two events, a contact that opens or closes, structure, motor and contact are linear: each piece is exact by
matrix exponentials, and events are found to 2^-23 of a control cycle. Nothing of the unit's step is in it. It decides
where the describing function of a dead zone, which knows the first harmonic alone, says something else: at the speed
loop of the default axis, with a phase margin of 29 deg, it says 6.20 um for 5.09.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from plant_unit import write_modes
from scipy.linalg import expm

from feedsim import scenario
from feedsim.simulation.cosim.roles import controller_parameters
from feedsim.structure import Modes, checked_modes
from fmi_helpers import Archive

Array = NDArray[np.float64]
# After a cycle with M_a [N.m] at its start and its slope [N.m/s]: x_a [m], n_a [rad/s], way ahead of the structure [m].
Advance = Callable[[float, float], tuple[float, float, float]]

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios" / "z_positioning.yaml"
T_C, STEPS = 125e-6, 6400
X_0, KICK = 0.1, 10e-6  # position and the setpoint that sets the axis going [m]
STIFFNESS, DAMPING, PLAY, J = 200e6, 3e4, 8e-6, 0.004  # N/m, N.s/m, m, kg.m2
PARTS, HALVINGS = 4, 21  # of a cycle, of a part


def lead(modes: Modes) -> float:
    n, x = (modes.ports[port][modes.rigid] for port in ("n_Z", "x_Z"))
    return float(n @ x / (n @ n))


def pieces(modes: Modes) -> Advance:
    """Structure and motor as pieces of linear motion."""
    n, x, omega, count = modes.ports["n_Z"], modes.ports["x_Z"], 2 * np.pi * modes.frequency, len(modes.frequency)
    I_P = lead(modes)
    c, d, half = STIFFNESS * I_P**2, DAMPING * I_P**2, PLAY / 2 / I_P
    without_rotor = np.eye(count) + J * np.outer(n, n) / (1 - J * n @ n)  # inverse of 1 - J n n^T
    angle, torque, size = 2 * count, 2 * count + 2, 2 * count + 5  # q, q', motor's angle and speed, M_a, its slope, 1

    def system(side: int) -> Array:
        contact = np.zeros(size)
        if side:
            contact[:count], contact[count:angle] = -c * n, -d * n
            contact[angle], contact[angle + 1], contact[-1] = c, d, -c * half * side
        force = np.zeros((count, size))
        force[:, :count], force[:, count:angle] = -np.diag(omega**2), -np.diag(2 * modes.damping * omega)
        A = np.zeros((size, size))
        A[:count, count:angle] = np.eye(count)
        A[count:angle] = without_rotor @ (force + np.outer(n, contact))
        A[angle, angle + 1] = A[torque, torque + 1] = 1
        A[angle + 1] = -contact / J
        A[angle + 1, torque] += 1 / J
        return A

    over = {side: [expm(system(side) * T_C / PARTS / 2**k) for k in range(HALVINGS + 1)] for side in (-1, 0, 1)}
    y, side = np.zeros(size), 0
    y[-1] = 1

    def ahead(y: Array) -> float:
        return float(y[angle] - n @ y[:count])

    def holds(y: Array) -> bool:
        return abs(ahead(y)) <= half if side == 0 else (ahead(y) - side * half) * side >= 0

    def advance(M_a: float, slope: float) -> tuple[float, float, float]:
        nonlocal y, side
        y[torque], y[torque + 1] = M_a, slope
        for _ in range(PARTS):
            left = 2**HALVINGS
            while left:
                for k in range(HALVINGS + 1):
                    if (span := 2 ** (HALVINGS - k)) <= left and holds(end := over[side][k] @ y):
                        break
                else:  # the event lies in the shortest step
                    span, end = 1, over[side][HALVINGS] @ y
                    side = int(ahead(end) > half) - int(ahead(end) < -half)
                y, left = end, left - span
        return X_0 + float(x @ y[:count]), float(y[angle + 1]), ahead(y) * I_P

    return advance


def swing(way: Array) -> tuple[float, float]:
    """Amplitude of the strongest wave of the second half [m], and its frequency [Hz]."""
    way = way[len(way) // 2 :]
    time = np.arange(len(way)) * T_C
    lines = np.abs(np.fft.rfft(way - way.mean(), 8 * len(way)))
    near = np.fft.rfftfreq(8 * len(way), T_C)[lines.argmax()]

    def wave(f: float) -> tuple[float, float, float]:
        columns = np.stack([np.ones_like(time), np.sin(2 * np.pi * f * time), np.cos(2 * np.pi * f * time)], axis=1)
        (_, a, b), rest, *_ = np.linalg.lstsq(columns, way, rcond=None)
        return float(rest[0]), float(np.hypot(a, b)), f

    return min(wave(float(f)) for f in np.linspace(near - 0.5, near + 0.5, 51))[1:]


@pytest.mark.parametrize(("settings", "amplitude"), [([], 5.09e-6), (["drive.K_p=2.5 N.m.s/rad"], 5.22e-6)])
def test_the_limit_cycle_is_that_of_an_exact_solution(
    settings: list[str], amplitude: float, fmus: Path, tmp_path: Path
) -> None:
    machine = scenario.load(SCENARIO, [f"machine.axes.Z.{each}" for each in settings]).machine
    modes = checked_modes(machine)
    n, x = modes.ports["n_Z"], modes.ports["x_Z"]
    others = [[0.0, 0.0, 8, 0, 0, 0.02, 0, 0, 0, 0, 0], [0.0, 0.0, 0, 8, 0, 0, 0.02, 0, 0, 0, 0]]  # X and Y, at rest
    own = [
        [f, zeta, 0, 0, n_k, 0, 0, x_k, 0, 0, 0]
        for f, zeta, n_k, x_k in zip(modes.frequency, modes.damping, n, x, strict=True)
    ]
    table = write_modes(tmp_path / "modes.csv", [[i, *map(float, row)] for i, row in enumerate([*others, *own])])
    drive = Archive.unpack(fmus / "controller.fmu", tmp_path / "controller")

    def closed(advance: Advance) -> Array:
        """The position loop with the drive: what the motor is ahead of the structure, after every cycle."""
        x_a, n_a, way = X_0, 0.0, np.empty(STEPS)
        begin = {"x_s": X_0 + KICK, "x_a": X_0, "n_a": 0.0, "n_ffw": 0.0}
        with drive.instance(controller_parameters(machine, "Z"), inputs=begin) as control:
            for k in range(STEPS):
                control.step(T_C, {"x_s": X_0 + KICK, "x_a": x_a, "n_a": n_a})
                slope = control.derivative("M_a")
                x_a, n_a, way[k] = advance(control.get("M_a") - slope * T_C, slope)
        return way

    parameters = {"stiffness": STIFFNESS, "damping": DAMPING, "play": PLAY, "inertia": J}
    given = {f"Z.transmission.{name}": value for name, value in parameters.items()}
    plant = Archive.unpack(fmus / "plant.fmu", tmp_path / "plant")
    with plant.instance({"modes_file": str(table), "Z.x_0": X_0, **given}) as unit:

        def step(M_a: float, slope: float) -> tuple[float, float, float]:
            unit.step(T_C, {"Z.M_a": M_a}, {"Z.M_a": slope})
            x_a, n_a, way = unit.gets(["Z.x_a", "Z.n_a", "Z.transmission.way"])
            return float(x_a), float(n_a), float(way)

        simulated = swing(closed(step))
    exact = swing(closed(pieces(modes)))
    assert simulated == pytest.approx(exact, rel=1e-3)  # a wave of 20 Hz: (omega h)^2/12 is 2e-5; impacts besides
    assert simulated[0] == pytest.approx(amplitude, rel=2e-3)
