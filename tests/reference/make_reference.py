"""Make the pinned reference results of the units anew, from scipy and not from the units (`make reference`)."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import solve_controller
import solve_friction
import solve_plant
from numpy.typing import NDArray
from reference_files import HERE, Case, Table, write_inputs, write_reference

Array = NDArray[np.float64]
STEP = 125e-6  # control cycle of the default machine, the units' default step
CONTROLLER_OUTPUTS = ("M_a", "x_e", "n_s", "n_ref", "M_s", "i_d", "i_q", "u_d", "u_q")


def grid(stop: float, every: float) -> Array:
    """Time from 0 to `stop`, both included."""
    return np.asarray(np.arange(round(stop / every) + 1) * every, dtype=np.float64)


def smooth_step(t: Array, begin: float, end: float) -> Array:
    """From 0 to 1 with four continuous derivatives, so that knots 1 ms apart describe it well."""
    s = np.clip((t - begin) / (end - begin), 0, 1)
    return np.asarray(s**5 * (126 + s * (-420 + s * (540 + s * (-315 + 70 * s)))))


# --- friction -------------------------------------------------------------------------------------------------------


def _friction(name: str, stop: float, knots: float, n_fr: Callable[[Array], Array], **parameters: float) -> Case:
    t = grid(stop, knots)
    return Case("friction", name, stop, STEP, 1e-5, {"time": t, "n_fr": np.round(n_fr(t), 12)}, parameters)


def friction_cases() -> list[Case]:
    """Steady speeds (Eq. 7), a circle's reversals with and without the engaging model, loops inside presliding."""
    # accelerations as on the circle, 52 rad/s^2 at most: the error of a step grows with them and with the speed
    levels = ([0.0, 0.10, 0.40, 0.50, 0.80, 1.80, 2.00], [0.0, 5.0, 5.0, 0.2, 0.2, 26.0, 26.0])

    def circle(t: Array) -> Array:
        # 3000 mm/min on R 15 mm, pitch 20 mm; reversals at 0.942 and 1.885 s
        return np.asarray(5 * np.pi * np.sin(0.05 / 0.015 * t))

    def presliding(t: Array) -> Array:
        # travel of a few mrad, below F_S/sigma_0, with inner loops
        omega = 2 * np.pi * np.array([2.0, 9.0])
        return np.asarray(0.003 * omega[0] * np.sin(omega[0] * t) + 0.0006 * omega[1] * np.sin(omega[1] * t))

    return [
        _friction("constant_speed", 2.0, 1e-2, lambda t: np.interp(t, *levels)),
        _friction("reversal", 2.0, 1e-3, circle),
        _friction("reversal_lugre", 1.2, 1e-3, circle, W=0.0, asymmetry=0.1, beta=1.5),
        _friction("presliding", 1.0, 1e-3, presliding),
    ]


# --- plant ----------------------------------------------------------------------------------------------------------


def plant_cases() -> list[tuple[Case, tuple[str, ...]]]:
    """Torque pulses with friction-like counter-torques on all axes; forces on the tool with a constant load."""
    knots = 1e-3
    t = grid(0.5, knots)
    pulses: Table = {"time": t}
    for axis, begin, size in (("X", 0.02, 12.0), ("Y", 0.05, 8.0), ("Z", 0.01, 15.0)):
        pulses[f"{axis}.M_a"] = np.round(
            np.interp(t, np.cumsum([begin, 0.002, 0.01, 0.002]), [0, size, size, 0])
            - np.interp(t, np.cumsum([begin + 0.2, 0.01, 0.01]), [0, size / 2, 0]),
            9,
        )
        pulses[f"{axis}.M_fr"] = np.round(
            2 * np.tanh((t - begin - 0.02) / 0.01) * smooth_step(t, begin, begin + 0.05)
            + 0.1 * np.sin(2 * np.pi * 130 * t),
            9,
        )
    forces: Table = {
        "time": t,
        "Z.M_a": np.round(3 * smooth_step(t, 0.1, 0.2), 9),
        "tool.F_X": np.round(200 * np.sin(2 * np.pi * (20 * t + 150 * t**2)), 9),
        "tool.F_Y": np.interp(t, [0.0, 0.1, 0.101, 0.2, 0.201], [0.0, 0.0, 500.0, 500.0, 0.0]),
        "tool.F_Z": np.round(-300 * smooth_step(t, 0.05, 0.06), 9),
    }
    axes = ("X", "Y", "Z")
    speeds, scales = tuple(f"{a}.n_a" for a in axes), tuple(f"{a}.x_a" for a in axes)
    tool, tcp = tuple(f"tool.x_{a}" for a in axes), tuple(f"tcp.x_{a}" for a in axes)
    load = {"Y.M_0": 4.5}
    return [
        (Case("plant", "torque_pulses", 0.5, STEP, 1e-11, pulses), speeds + scales + tool),
        (Case("plant", "tool_force", 0.5, STEP, 1e-11, forces, load), scales + tool + tcp),
    ]


# --- controller -----------------------------------------------------------------------------------------------------


def _controller_inputs(stop: float, distance: float, disturbance: float, excited: bool = False) -> Table:
    """A move whose measured values are made up, not simulated: late as neutral delays make it, vibrating at the end."""
    t = grid(stop, 1e-3)
    begin, end, late, lead, start = 0.02, 0.14, 4.9e-3, 0.02 / (2 * np.pi), 0.1

    def position(time: Array) -> Array:
        return distance * smooth_step(time, begin, end)

    def measured(time: Array) -> Array:
        return position(time - late) + disturbance * np.sin(2 * np.pi * 21 * time) * smooth_step(time, 0.15, 0.2)

    def speed(path: Callable[[Array], Array]) -> Array:
        return (path(t + 1e-6) - path(t - 1e-6)) / (2e-6 * lead)

    table: Table = {
        "time": t,
        "x_s": np.round(start + position(t), 12),
        "n_ffw": np.round(speed(position), 9),
        "x_a": np.round(start + measured(t), 12),
        "n_a": np.round(speed(measured), 9),
    }
    if excited:
        table["n_add"] = np.round(0.5 * np.sin(2 * np.pi * (5 * t + 200 * t**2)), 9)
        table["M_add"] = np.round(2 * np.sin(2 * np.pi * 40 * t), 9)
    return table


def controller_cases() -> list[tuple[Case, tuple[str, ...]]]:
    """Default cascade; torque limit; the other settings; steps that are no multiple of the control cycle."""
    other = {
        "ramp_speed_setpoint": 0,
        "symmetry_lag": 1,
        "T_sym": 3.59e-3,
        "T_dyn": 0.8e-3,
        "k_ffw": 0.95,
        "filter_1.type": 2,
        "filter_1.f": 900,
        "filter_3.type": 1,
        "filter_3.f": 300,
        "filter_3.D_num": 0.2,
        "filter_3.D_den": 0.7,
        "L_d": 4e-3,
    }
    ideal = {"ideal_current_loop": 1, "reference_model": 0, "filter_1.type": 0}
    move = _controller_inputs(0.4, 4e-3, 10e-6)
    return [
        (Case("controller", "move", 0.4, STEP, 1e-9, move), CONTROLLER_OUTPUTS),
        (Case("controller", "torque_limit", 0.4, STEP, 1e-9, move, {"M_max": 4.0}), CONTROLLER_OUTPUTS),
        (
            Case("controller", "other_settings", 0.4, STEP, 1e-9, _controller_inputs(0.4, -4e-3, 10e-6, True), other),
            CONTROLLER_OUTPUTS,
        ),
        (Case("controller", "ideal_current_loop", 0.4, STEP, 1e-9, move, ideal), ("M_a", "x_e", "n_s", "n_ref", "M_s")),
        (Case("controller", "uneven_step", 0.3, 0.2e-3, 1e-9, _controller_inputs(0.3, 4e-3, 10e-6)), ("M_a", "n_s")),
    ]


def make(root: Path = HERE) -> list[str]:
    """Write all cases below `root`; return what was written."""
    done = []
    for case in friction_cases():
        case = write_inputs(case, root)
        # without the engaging model c and lambda mean nothing
        outputs: tuple[str, ...] = ("M_fr", "z", "k")
        if case.parameters.get("W") != 0:
            outputs += ("c", "lambda")
        write_reference(case, solve_friction.solve(_refined(case), 1e-3, outputs), root)
        done.append(f"friction/{case.name}")
    for case, outputs in plant_cases():
        case = write_inputs(case, root)
        write_reference(case, solve_plant.solve(case, 1e-3, outputs), root)
        done.append(f"plant/{case.name}")
    for case, outputs in controller_cases():
        case = write_inputs(case, root)
        write_reference(case, solve_controller.solve(case, 1e-3, outputs), root)
        done.append(f"controller/{case.name}")
    return done


def _refined(case: Case) -> Case:
    """The same piecewise linear inputs with a row at least every ms, where the results are wanted."""
    t = grid(case.stop, 1e-3)
    inputs = {name: np.interp(t, case.inputs["time"], values) for name, values in case.inputs.items()}
    return Case(case.unit, case.name, case.stop, case.step, case.rel_tol, inputs | {"time": t}, case.parameters)


def main() -> int:
    """Command line: no arguments."""
    for name in make():
        print(f"tests/reference/{name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
