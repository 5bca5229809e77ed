"""The reference cases: what each unit is given, and how often its outputs are pinned. What comes out: solve_*.py."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from reference_files import HERE, Case, Table

Array = NDArray[np.float64]
STEP = 125e-6  # control cycle of the default machine, the units' default step
AXES = ("X", "Y", "Z")
CONTROLLER_OUTPUTS = ("M_a", "x_e", "n_s", "n_ref", "M_s", "i_d", "i_q", "u_d", "u_q")
MEASURED_OUTPUTS = ("x_m", "M_a", "x_e")
SPEEDS, SCALES = tuple(f"{a}.n_a" for a in AXES), tuple(f"{a}.x_a" for a in AXES)
TOOL, TCP = tuple(f"tool.x_{a}" for a in AXES), tuple(f"tcp.x_{a}" for a in AXES)


@dataclass(frozen=True)
class Pinned:
    """A case with the outputs that are pinned of it and their interval [s]."""

    case: Case
    outputs: tuple[str, ...]
    every: float


def grid(stop: float, every: float) -> Array:
    """Time from 0 to `stop`, both included."""
    return np.asarray(np.arange(round(stop / every) + 1) * every, dtype=np.float64)


def smooth_step(t: Array, begin: float, end: float) -> Array:
    """From 0 to 1 with four continuous derivatives, so that knots 1 ms apart describe it well."""
    s = np.clip((t - begin) / (end - begin), 0, 1)
    return np.asarray(s**5 * (126 + s * (-420 + s * (540 + s * (-315 + 70 * s)))))


# --- friction -------------------------------------------------------------------------------------------------------


def _friction(
    name: str, stop: float, knots: float, every: float, n_fr: Callable[[Array], Array], **parameters: float
) -> Pinned:
    t = grid(stop, knots)
    case = Case("friction", name, stop, STEP, 1e-5, {"time": t, "n_fr": np.round(n_fr(t), 12)}, parameters)
    # without the engaging model c and lambda mean nothing
    shown = ("M_fr", "z", "k") if parameters.get("W") == 0 else ("M_fr", "z", "k", "c", "lambda")
    return Pinned(case, shown, every)


def friction_cases() -> list[Pinned]:
    """Steady speeds (Eq. 7), a circle's reversals with both models, presliding loops, rapid traverse, sticking."""
    # accelerations as on the circle, 52 rad/s^2 at most: the error of a step grows with them and with the speed
    levels = ([0.0, 0.10, 0.40, 0.50, 0.80, 1.80, 2.00], [0.0, 5.0, 5.0, 0.2, 0.2, 26.0, 26.0])

    def circle(t: Array) -> Array:
        # 3000 mm/min on R 15 mm, pitch 20 mm; reversals at 0.942 and 1.885 s
        return np.asarray(5 * np.pi * np.sin(0.05 / 0.015 * t))

    def presliding(t: Array) -> Array:
        # travel of a few mrad, below F_S/sigma_0, with inner loops
        omega = 2 * np.pi * np.array([2.0, 9.0])
        return np.asarray(0.003 * omega[0] * np.sin(omega[0] * t) + 0.0006 * omega[1] * np.sin(omega[1] * t))

    def rapid(t: Array) -> Array:
        # 30 m/min at a pitch of 20 mm, there and back; 0.6 g
        speed = 50 * np.pi
        return np.asarray(
            speed * (smooth_step(t, 0.02, 0.22) - smooth_step(t, 0.30, 0.60) * 2 + smooth_step(t, 0.68, 0.88))
        )

    def stick(t: Array) -> Array:
        # a creep of 0.2 mrad, rest, a creep back by half, rest, motion, a stop and rest: the torque stays where it is
        creep = np.interp(t, [0.02, 0.03, 0.05, 0.06], [0, 2e-2 / 3, 2e-2 / 3, 0])
        back = np.interp(t, [0.15, 0.16, 0.17], [0, -1e-2, 0])
        return np.asarray(creep + back + 3 * (smooth_step(t, 0.25, 0.30) - smooth_step(t, 0.45, 0.50)))

    return [
        _friction("constant_speed", 2.0, 1e-2, 4e-3, lambda t: np.interp(t, *levels)),
        _friction("reversal", 2.0, 1e-3, 4e-3, circle),
        _friction("reversal_lugre", 1.2, 1e-3, 2e-3, circle, W=0.0, asymmetry=0.1, beta=1.5),
        _friction("presliding", 1.0, 1e-3, 2e-3, presliding),
        _friction("rapid_traverse", 1.0, 1e-3, 2e-3, rapid),
        _friction("stick", 0.7, 1e-3, 2e-3, stick),
    ]


def friction_gms_cases() -> list[Pinned]:
    """Steady speeds, a circle's reversals, presliding loops and sticking by generalised Maxwell slip."""
    found = []
    for pinned in friction_cases():
        changes = {"reversal_lugre": {"asymmetry": 0.1, "beta": 1.5, "spread": 60.0, "skew": 0.4, "C": 80.0}}
        case = pinned.case
        name = "reversal_skew" if case.name in changes else case.name
        parameters = changes.get(case.name, {})
        found.append(
            Pinned(
                replace(case, unit="friction_gms", name=name, parameters=parameters), ("M_fr", "z", "k"), pinned.every
            )
        )
    return found


# --- plant ----------------------------------------------------------------------------------------------------------


def _plant(
    name: str, inputs: Table, outputs: tuple[str, ...], stop: float = 0.5, knots: float = 1e-3, **more: object
) -> Pinned:
    table = {"time": grid(stop, knots)} | {key: np.round(values, 9) for key, values in inputs.items()}
    return Pinned(Case("plant", name, stop, STEP, 1e-11, table, **more), outputs, 2e-3)  # type: ignore[arg-type]


def plant_cases() -> list[Pinned]:
    """Torque pulses with counter-torques like friction, forces on the tool, and single motions of the structure."""
    t = grid(0.5, 1e-3)
    pulses: Table = {}
    for axis, begin, size in (("X", 0.02, 12.0), ("Y", 0.05, 8.0), ("Z", 0.01, 15.0)):
        pulses[f"{axis}.M_a"] = np.interp(t, np.cumsum([begin, 0.002, 0.01, 0.002]), [0, size, size, 0]) - np.interp(
            t, np.cumsum([begin + 0.2, 0.01, 0.01]), [0, size / 2, 0]
        )
        pulses[f"{axis}.M_fr"] = 2 * np.tanh((t - begin - 0.02) / 0.01) * smooth_step(
            t, begin, begin + 0.05
        ) + 0.1 * np.sin(2 * np.pi * 130 * t)
    forces: Table = {
        "Z.M_a": 3 * smooth_step(t, 0.1, 0.2),
        "tool.F_X": 200 * np.sin(2 * np.pi * (20 * t + 150 * t**2)),
        "tool.F_Y": np.interp(t, [0.0, 0.1, 0.101, 0.2, 0.201], [0.0, 0.0, 500.0, 500.0, 0.0]),
        "tool.F_Z": -300 * smooth_step(t, 0.05, 0.06),
    }
    # 2 ms wide, so that it reaches modes up to 500 Hz
    impulse = {
        f"{axis}.M_a": np.interp(t, [begin, begin + 1e-3, begin + 2e-3], [0, size, 0])
        for axis, begin, size in (("Z", 0.01, 20.0), ("X", 0.2, 30.0), ("Y", 0.35, -20.0))
    }
    # a constant from the start on is the same to every importer, whether it interpolates inputs or not
    step = {f"{axis}.M_a": np.full(2, size) for axis, size in (("X", 3.0), ("Y", 0.0), ("Z", -2.0))}
    step |= {"tool.F_Y": np.full(2, 100.0)}
    # bursts at the two lowest natural frequencies, each from the axis that moves in it, then ringing down
    window = smooth_step(t, 0.0, 0.05) - smooth_step(t, 0.2, 0.25)
    bursts = {
        "Z.M_a": 2 * window * np.sin(2 * np.pi * 21.0854 * t),
        "X.M_a": 2 * window * np.sin(2 * np.pi * 24.9493 * t),
    }
    # there and to rest, so gently that the structure hardly rings
    gentle = smooth_step(t, 0.0, 0.1) - 2 * smooth_step(t, 0.15, 0.25) + smooth_step(t, 0.3, 0.4)
    rigid = {"Z.M_a": 4 * gentle, "X.M_a": -6 * gentle, "Y.M_fr": 3 * gentle}
    # a table of its own, two elastic modes, one per axis Y and Z: closed forms hold (test_closed_forms.py)
    other = {"Z.M_a": np.full(2, 1.0), "Y.M_a": np.full(2, -0.5)}
    return [
        _plant("torque_pulses", pulses, SPEEDS + SCALES + TOOL),
        _plant("tool_force", forces, SCALES + TOOL + TCP, parameters={"Y.M_0": 4.5}),
        _plant("impulse", impulse, SPEEDS + SCALES + TOOL),
        _plant("step", step, SPEEDS + SCALES + TOOL, knots=0.5),
        _plant("two_modes", bursts, SPEEDS + SCALES + TOOL),
        _plant("rigid_motion", rigid, SPEEDS + SCALES + TOOL),
        _plant("other_machine", other, SPEEDS + SCALES, knots=0.5, modes=HERE / "plant" / "other_machine_modes.csv"),
    ]


# --- controller -----------------------------------------------------------------------------------------------------


def _motion(stop: float, distance: float, disturbance: float, excited: bool = False, back: bool = False) -> Table:
    """A move (and one back) whose measured values are made up, not simulated: late as neutral delays make it, and
    vibrating at the end."""
    t = grid(stop, 1e-3)
    begin, end, late, lead, start = 0.02, 0.14, 4.9e-3, 0.02 / (2 * np.pi), 0.1

    def position(time: Array) -> Array:
        there = distance * smooth_step(time, begin, end)
        return there - distance * smooth_step(time, 0.22, 0.34) if back else there

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


def _speed_step(stop: float) -> Table:
    """The speed setpoint jumps at a sample instant, and the motor comes after it as a fast drive's would."""
    t = grid(stop, STEP)
    after = np.maximum(t - 0.010, 0.0)
    n_a = np.where(after > 0, 2 * (1 - np.exp(-after / 4e-3) * (1 + after / 4e-3)), 0)
    still = np.full(len(t), 0.1)
    return {"time": t, "x_s": still, "x_a": still, "n_a": np.round(n_a, 9), "n_add": np.where(t > 0.00999, 2.0, 0.0)}


def _released(table: Table, *changes: float) -> Table:
    """The same inputs with the controller enable: true at first, the other way round from each of the times on."""
    t = np.union1d(table["time"], changes)
    switched = np.array([sum(now >= change for change in changes) % 2 == 0 for now in t], dtype=np.float64)
    more = {name: np.round(np.interp(t, table["time"], values), 12) for name, values in table.items()}
    return more | {"time": t, "release": switched}


def controller_cases() -> list[Pinned]:
    """Default cascade, limits, delays, the other settings, a step of the speed setpoint, and other steps than T_c."""
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
    # delays of no whole cycles, on both sides of one cycle, and one of the reference model
    delays = {"T_dyn": 0.31e-3, "T_sym": 7.27e-3, "T_ref": 0.29e-3, "speed_window": 3}
    late = {"T_ref": 0.29e-3, "speed_window": 3}
    # what real drives have besides, all at once; the motion is one of 4 mm about 0.1 m
    scale = {"measuring.linear": 50e-6, "periodic_error_1.amplitude": 0.2e-6, "periodic_error_1.phase": 0.5}
    scale |= {"periodic_error_3.amplitude": 2e-6, "periodic_error_3.period": 5e-3}
    scale |= {"measuring_table.first": 0.099, "measuring_table.spacing": 1e-3}
    scale |= {f"measuring_table.e_{i}": e * 1e-6 for i, e in enumerate((0, 1, 3, 2, -1, -2, 0, 0, 0, 0, 0))}
    own = {"backlash_compensation.value": 6e-6, "backlash_compensation.ramp": 5.5e-3}
    own |= {"leadscrew_compensation.first": 0.0985, "leadscrew_compensation.spacing": 2e-3}
    own |= {f"leadscrew_compensation.e_{i}": 1e-6 * i * (-1) ** i for i in range(11)}
    own |= {"leadscrew_compensation_minus.first": 0.09, "leadscrew_compensation_minus.spacing": 5e-3}
    own |= {f"leadscrew_compensation_minus.e_{i}": 5e-7 * i for i in range(11)}
    motor = {"cogging_1.amplitude": 0.4, "cogging_2.amplitude": 0.2, "cogging_2.order": 0.5, "cogging_2.phase": 1.0}
    motor |= {"ripple_1.amplitude": 0.05, "ripple_3.amplitude": -0.1, "ripple_3.order": 3, "ripple_3.phase": -0.4}
    encoder = {"measuring.indirect": 1, "encoder.eccentricity": 2e-3, "encoder.phase": 0.9}
    back = _motion(0.4, 4e-3, 10e-6, back=True)
    pulse = {"friction_pulse.amplitude": 6e-4, "friction_pulse.amplitude_min": 1e-3, "friction_pulse.time": 0.03}
    pulse |= {"friction_pulse.adaptation": 1, "friction_pulse.delay": 1.7e-3}
    pulse |= {"friction_pulse.acceleration_1": 0.02, "friction_pulse.acceleration_2": 0.05}
    pulse |= {"friction_pulse.acceleration_3": 0.9}
    torques = {"friction_table.points": 4, "friction_table.distance": 20e-6, "friction_table.delay": -1.4e-3}
    torques |= {f"friction_table.speed_{i}": v for i, v in enumerate((0.0, 2e-3, 8e-3, 20e-3))}
    torques |= {f"friction_table.torque_{i}": M for i, M in enumerate((0.5, 1.6, 1.2, 1.4))}
    ideal = {"ideal_current_loop": 1, "reference_model": 0, "filter_1.type": 0}
    move = _motion(0.4, 4e-3, 10e-6)

    def case(
        name: str,
        inputs: Table,
        parameters: Mapping[str, float] | None = None,
        outputs: tuple[str, ...] = CONTROLLER_OUTPUTS,
        step: float = STEP,
        every: float = 2e-3,
    ) -> Pinned:
        stop = round(float(inputs["time"][-1]), 9)
        return Pinned(Case("controller", name, stop, step, 1e-9, inputs, parameters or {}), outputs, every)

    return [
        case("move", move),
        case("torque_limit", move, {"M_max": 4.0}),
        case("voltage_limit", move, {"u_max": 25.0}),
        case("delays", move, delays),
        case("other_settings", _motion(0.4, -4e-3, 10e-6, True), other),
        case("speed_step", _speed_step(0.06), every=STEP),
        case("ideal_current_loop", move, ideal, ("M_a", "x_e", "n_s", "n_ref", "M_s")),
        case("measuring_errors", back, scale, MEASURED_OUTPUTS),
        case("indirect", back, encoder, MEASURED_OUTPUTS),
        case("corrections", back, own, ("M_a", "x_e")),
        case("motor_orders", back, motor, ("M_a", "i_q")),
        case("friction_pulse", back, pulse, ("M_a", "n_s")),
        case("friction_table", back, torques, ("M_a", "M_s")),
        # in motion, and back within a position cycle; for one cycle; and once more while the axis vibrates
        case("release", _released(move, 0.07, 0.0905, 0.11, 0.110125, 0.25, 0.3), late),
        case("uneven_step", _motion(0.3, 4e-3, 10e-6), None, ("M_a", "n_s"), 0.2e-3, 1e-3),
    ]


# --- setpoint -------------------------------------------------------------------------------------------------------


def setpoint_cases() -> list[Pinned]:
    """The table from its start to beyond its end, and from another start time in odd steps."""
    played = tuple(f"{axis}.{name}" for axis in AXES for name in ("x_s", "n_ffw"))
    return [
        Pinned(Case("setpoint", "table", 0.3, STEP, 1e-9, {}), (*played, "finished", "row"), 0.75e-3),
        Pinned(Case("setpoint", "late_start", 1000.3, 0.4e-3, 1e-9, {}, start=1000.0), (*played, "finished"), 2e-3),
    ]
