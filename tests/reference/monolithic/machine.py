"""The default machine in numbers: an independent transcription for the reference, in SI units.

All of it is synthetic. Names follow the units' parameters; ``machine()`` returns a fresh copy that a test may change.
"""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

MODES_FILE = Path(__file__).parents[3] / "scenarios" / "machines" / "test_centre" / "modes.csv"

# in the order in which the program reads them
FRICTION_KEYS = (
    *("sigma_0", "sigma_1", "sigma_2", "F_C", "F_S", "v_s"),
    *("beta", "F_log", "v_log", "asymmetry", "W", "gamma"),
)
DRIVE_KEYS = (
    *("I_P", "K_v", "k_ffw", "T_dyn", "T_sym", "K_p", "T_n", "omega_0", "D", "M_max", "f", "D_num", "D_den"),
    *("R", "L_d", "L_q", "p", "K_t", "K_p_current", "T_n_current", "u_max"),
    *("symmetry_lag", "ramp", "integrator", "reference_model", "ideal_current_loop", "emf_feedforward"),
)

# T_sym [s] with the held speed setpoint; the table below has the ramped one
T_SYM_HELD = {"X": 4.416e-3, "Y": 3.621e-3, "Z": 3.090e-3}


@dataclass
class Axis:
    """One feed axis: start position [m], constant load [N.m], friction and drive parameters by name (SI).

    contact: inertia on the motor's side [kg.m2], stiffness [N.m/rad], damping [N.m.s/rad], half of the play [rad]; of
    one axis at most; inertia 0: none.
    """

    x_0: float
    M_0: float
    friction: dict[str, float]
    drive: dict[str, float]
    contact: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)


@dataclass
class Machine:
    """Cycles [s], axes, and the mode table: frequency [Hz], damping [1], n, x (modes, axes) and tcp (modes, 3).

    mounts: (P, 6 + modes) per direction of a mount that is not linear K_lin, K_e [N/m], F_max [N], x_2 [m], K_v [N/m],
    c [N.s/m] and the mode shapes there.
    """

    T_c: float
    T_pos: float
    T_ipo: float
    jerk: float
    acceleration: float
    axes: dict[str, Axis]
    frequency: NDArray[np.float64]
    damping: NDArray[np.float64]
    n: NDArray[np.float64]
    x: NDArray[np.float64]
    tcp: NDArray[np.float64]
    mounts: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))

    def copy(self) -> Machine:
        """An independent copy."""
        return deepcopy(self)


def _axis(
    x_0: float,
    friction: tuple[float, ...],
    speed: tuple[float, ...],
    motor: tuple[float, ...],
    stop: tuple[float, ...],
    delays: tuple[float, ...],
    M_max: float,
) -> Axis:
    F_C, F_S, F_log, sigma_0, sigma_1, sigma_2 = friction
    K_p, T_n, omega_0, D = speed
    R, L, K_t = motor
    f, D_num, D_den = stop
    T_dyn, T_sym = delays
    return Axis(
        x_0=x_0,
        M_0=0.0,
        friction={
            "sigma_0": sigma_0,
            "sigma_1": sigma_1,
            "sigma_2": sigma_2,
            "F_C": F_C,
            "F_S": F_S,
            "v_s": 0.6,
            "beta": 1.0,
            "F_log": F_log,
            "v_log": 3.0,
            "asymmetry": 0.0,
            "W": 0.040,
            "gamma": 0.35,
        },
        drive={
            "I_P": 0.020 / (2 * math.pi),
            "K_v": 4 * 1000 / 60,
            "k_ffw": 1.0,
            "T_dyn": T_dyn,
            "T_sym": T_sym,
            "K_p": K_p,
            "T_n": T_n,
            "omega_0": omega_0,
            "D": D,
            "M_max": M_max,
            "f": f,
            "D_num": D_num,
            "D_den": D_den,
            "R": R,
            "L_d": L,
            "L_q": L,
            "p": 5.0,
            "K_t": K_t,
            "K_p_current": L * 2 * math.pi * 550,
            "T_n_current": L / R,
            "u_max": 350.0,
            "symmetry_lag": 0.0,
            "ramp": 1.0,
            "integrator": 1.0,
            "reference_model": 1.0,
            "ideal_current_loop": 0.0,
            "emf_feedforward": 1.0,
        },
    )


def machine(modes_file: Path = MODES_FILE) -> Machine:
    """The default machine with the ramped speed setpoint."""
    table = np.loadtxt(modes_file, delimiter=",", skiprows=1)
    return Machine(
        T_c=125e-6,
        T_pos=1e-3,
        T_ipo=2e-3,
        jerk=150.0,
        acceleration=14.4,
        axes={
            "X": _axis(
                0.800,
                (2.4, 3.1, 0.6, 450.0, 1.2, 0.010),
                (21.59, 20e-3, 747.3, 1.487),
                (0.25, 3.0e-3, 2.4),
                (455.0, 0.10, 1.0),
                (0.0, 4.854e-3),
                150.0,
            ),
            "Y": _axis(
                0.327,
                (2.0, 2.6, 0.4, 400.0, 1.0, 0.008),
                (8.310, 16e-3, 835.5, 1.330),
                (0.40, 4.5e-3, 2.2),
                (511.0, 0.08, 0.8),
                (0.796e-3, 4.058e-3),
                100.0,
            ),
            "Z": _axis(
                0.100,
                (1.6, 2.1, 0.4, 300.0, 0.8, 0.006),
                (6.180, 12e-3, 915.3, 1.214),
                (0.45, 5.0e-3, 2.0),
                (602.0, 0.08, 0.8),
                (1.326e-3, 3.528e-3),
                80.0,
            ),
        },
        frequency=table[:, 1],
        damping=table[:, 2],
        n=table[:, 3:6],
        x=table[:, 6:9],
        tcp=table[:, 9:12],
    )


def held(default: Machine) -> Machine:
    """The same machine with the held speed setpoint and its neutral symmetry delays."""
    changed = default.copy()
    for name, axis in changed.axes.items():
        axis.drive["ramp"] = 0.0
        axis.drive["T_sym"] = T_SYM_HELD[name]
    return changed


def pure_lugre(default: Machine) -> Machine:
    """The same machine without the engaging model."""
    changed = default.copy()
    for axis in changed.axes.values():
        axis.friction["W"] = 0.0
    return changed


def frictionless(default: Machine) -> Machine:
    """The same machine without any friction torque."""
    changed = default.copy()
    for axis in changed.axes.values():
        axis.friction.update(sigma_0=1e-9, sigma_1=0.0, sigma_2=0.0, F_C=1e-12, F_S=1e-12, F_log=0.0, W=0.0)
    return changed
