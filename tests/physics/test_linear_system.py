"""Closed-form responses of coupled drives and structure against a simulation in time, and what follows from them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim.analysis import linear
from feedsim.analysis.linear import LinearSystem
from feedsim.foundation.errors import InputError
from feedsim.scenario import Filter, Machine
from feedsim.structure import Modes
from physics.linear_reference import Simulation
from scenario_helpers import default_machine

FREQUENCIES = np.array([0.7, 21.3, 113.0, 377.7, 731.0, 1999.3, 2917.0])
# Rounding of the simulation: its repeating state is solved for in one go, and at kilohertz positions and torques are
# down to 1e-8 of other states. (Near 4 kHz, where Tustin's filters end in zeros, they fall to 1e-12.)
ROUNDING = 1e-8


def modes() -> Modes:
    """Two coupled axes X, Z: two rigid modes, three elastic ones, one of them overdamped."""
    rng = np.random.default_rng(7)
    frequency = np.array([0.0, 0.0, 24.0, 131.0, 620.0])
    ports = {name: rng.normal(0.0, scale, 5) for name, scale in (("n_X", 1.0), ("n_Z", 2.0))}
    ports |= {name: rng.normal(0.0, 0.02, 5) for name in ("x_X", "x_Z", "tcp_X", "tcp_Y", "tcp_Z")}
    for axis, own in (("X", 0), ("Z", 1)):
        ports[f"n_{axis}"][:2], ports[f"x_{axis}"][:2] = 0.0, 0.0
        ports[f"n_{axis}"][own] = {"X": 3.4, "Z": 7.8}[axis]
        ports[f"x_{axis}"][own] = ports[f"n_{axis}"][own] * 0.02 / (2 * math.pi)
    return Modes(Path("made-up"), frequency, np.array([0.0, 0.0, 0.06, 0.02, 1.3]), ports)


def machine(**drive: Any) -> Machine:
    """X and Z of the default machine, every drive with these changes."""
    default = default_machine()
    axes = {
        name: default.axes[name].model_copy(update={"drive": default.axes[name].drive.model_copy(update=drive)})
        for name in ("X", "Z")
    }
    return default.model_copy(update={"axes": axes})


def compare(described: Machine, closed: Mapping[str, Any], inputs: tuple[str, ...], frequencies: Any) -> float:
    """Largest difference of any output, relative to the largest value that an output of its kind has in the cycle."""
    system = LinearSystem(described, modes(), closed)
    simulation = Simulation(described, modes(), dict(closed))
    transition = simulation.transition()
    found = system.at(2j * np.pi * frequencies)
    worst = 0.0
    for name in inputs:
        for i, f in enumerate(frequencies):
            rows = simulation.steady(f, name, transition)
            column = found[i, :, system.inputs.index(name)]
            largest: dict[str, float] = {}
            for row in rows:
                for output, value in row.items():
                    kind = output.partition(".")[2][:2]
                    largest[kind] = max(largest.get(kind, 0.0), abs(value))
            for output in rows[0]:
                kind = output.partition(".")[2][:2]
                difference = abs(column[system.outputs.index(output)] - simulation.component(f, rows, output))
                worst = max(worst, difference / (largest[kind] or 1.0))
    return worst


VARIANTS: dict[str, dict[str, Any]] = {
    "as shipped": {},
    "held": {"ramp_speed_setpoint": False},
    "lag": {"symmetry_lag": True},
    "short delays": {"T_dyn": 0.3e-3, "T_sym": 0.2e-3},
    "no delays": {"T_dyn": 0.0, "T_sym": 0.0},
    "no reference model": {"reference_model": False},
    "reference dead time": {"T_ref": 0.41e-3},
    "no integrator": {"speed_integrator": False},
    "ideal current loop": {"ideal_current_loop": True},
    "speed from the position": {"speed_window": 2},
    "speed from the position, P controller": {"speed_window": 1, "speed_integrator": False},
    "four filters": {
        "filter_2": Filter(type="low_pass", f=1200.0, D_den=0.7),
        "filter_3": Filter(type="second_order", f=60.0, D_num=0.4, D_den=0.2),
        "filter_4": Filter(type="band_stop", f=2500.0, D_num=0.0, D_den=0.5),
    },
}
BOTH = {"X": "position", "Z": "position"}


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_setting_against_the_simulation(variant: str) -> None:
    inputs = ("Z.n_add", "X.M_add", "Z.x_s", "X.n_ffw", "tool.F_Y")
    assert compare(machine(**VARIANTS[variant]), BOTH, inputs, FREQUENCIES) < ROUNDING


@pytest.mark.parametrize(
    ("closed", "inputs"),
    [
        ({"X": "speed", "Z": "position"}, ("X.n_add", "X.M_add", "Z.x_s", "tool.F_Z")),
        ({"X": "speed", "Z": "speed"}, ("Z.n_add", "tool.F_X")),
        ({"X": "none", "Z": "position"}, ("X.M_a", "Z.M_add", "Z.n_ffw")),
        ({"X": "none", "Z": "none"}, ("X.M_a", "Z.M_a", "tool.F_Y")),
    ],
)
@pytest.mark.parametrize("ideal", [False, True])
def test_every_closing_against_the_simulation(closed: Mapping[str, Any], inputs: tuple[str, ...], ideal: bool) -> None:
    assert compare(machine(ideal_current_loop=ideal), closed, inputs, FREQUENCIES) < ROUNDING


def test_other_cycles() -> None:
    cycles = default_machine().cycles.model_copy(update={"control": 250e-6, "position": 500e-6})
    described = machine().model_copy(update={"cycles": cycles})
    assert compare(described, BOTH, ("Z.x_s", "X.n_add"), FREQUENCIES[:6]) < ROUNDING


def test_rates_that_are_equal_leave_a_time_invariant_system() -> None:
    cycles = default_machine().cycles.model_copy(update={"position": 125e-6})
    described = machine(ramp_speed_setpoint=False).model_copy(update={"cycles": cycles})
    assert compare(described, BOTH, ("Z.x_s", "X.n_add"), FREQUENCIES) < ROUNDING


def test_a_rigid_axis_under_proportional_control() -> None:
    """J dn/dt = M held, M = K_p (n_s - n) at once: n/n_s = K_p T/J / (z - 1 + K_p T/J)."""
    J, described = 0.02, machine(ideal_current_loop=True, speed_integrator=False, filter_1=Filter())
    described = described.model_copy(update={"axes": {"Z": described.axes["Z"]}})
    one = np.array([1 / math.sqrt(J)])
    lead = described.axes["Z"].I_P
    ports = {"n_Z": one, "x_Z": lead * one} | {f"tcp_{d}": 0 * one for d in "XYZ"}
    system = LinearSystem(described, Modes(Path("rigid"), np.zeros(1), np.zeros(1), ports), "speed")
    T, K_p = described.cycles.T_c, described.axes["Z"].drive.K_p
    z = np.exp(2j * np.pi * FREQUENCIES * T)
    expected = K_p * T / J / (z - 1 + K_p * T / J)
    np.testing.assert_allclose(system.transfer(FREQUENCIES, "Z.n_a", "Z.n_add"), expected, rtol=1e-12)


# --- what follows --------------------------------------------------------------------------------------------------


def growing(described: Machine, closed: Mapping[str, str]) -> int:
    """Poles outside the unit circle, by the eigenvalues of the simulated position cycle."""
    values = np.linalg.eigvals(Simulation(described, modes(), dict(closed)).transition())
    return int(np.sum(np.abs(values) > 1 + 1e-4))


@pytest.mark.parametrize("factor", [0.5, 1.0, 3.0, 10.0, 40.0])
@pytest.mark.parametrize("name", ["K_p", "K_v"])
def test_unstable_poles_are_the_eigenvalues_outside(name: str, factor: float) -> None:
    changed = {}
    for axis, described in machine().axes.items():
        drive = described.drive
        changed[axis] = described.model_copy(
            update={"drive": drive.model_copy(update={name: factor * getattr(drive, name)})}
        )
    described = machine().model_copy(update={"axes": changed})
    assert linear.unstable_poles(LinearSystem(described, modes(), BOTH)) == growing(described, BOTH)


def changed_gain(axis: str, name: str, factor: float) -> Machine:
    described = machine()
    drive = described.axes[axis].drive
    drive = drive.model_copy(update={name: factor * getattr(drive, name)})
    return described.model_copy(
        update={"axes": described.axes | {axis: described.axes[axis].model_copy(update={"drive": drive})}}
    )


@pytest.mark.parametrize("axis", ["X", "Z"])
@pytest.mark.parametrize(("name", "closed"), [("K_p", "speed"), ("K_v", "position")])
def test_gain_margin_is_the_factor_that_the_gain_stands(axis: str, name: str, closed: Any) -> None:
    system = LinearSystem(machine(), modes(), closed)
    gain = linear.speed_gain if name == "K_p" else linear.position_gain
    highest = 3999.0 if name == "K_p" else 499.5
    found = linear.margins(
        lambda f: gain(system, axis, 2j * np.pi * f), linear.grid(modes(), 1.0, highest)
    ).gain_margin.factor
    assert math.isfinite(found)
    loops = dict.fromkeys("XZ", closed)
    values = [
        np.max(
            np.abs(np.linalg.eigvals(Simulation(changed_gain(axis, name, found * share), modes(), loops).transition()))
        )
        for share in (0.998, 1.002)
    ]
    # the position loop's integrator and, with position open, x_a itself sit on the circle
    assert values[0] < 1 + 1e-9 < values[1]


def test_excitation_of_torque_or_speed_finds_the_same_system() -> None:
    system = LinearSystem(machine(), modes(), {"X": "position", "Z": "speed"})
    by_torque = system.ratio(FREQUENCIES, "Z.n_a", "Z.M_a", "Z.M_add")
    np.testing.assert_allclose(system.ratio(FREQUENCIES, "Z.n_a", "Z.M_a", "Z.n_add"), by_torque, rtol=1e-9)
    np.testing.assert_allclose(linear.speed_controlled_system(system, "Z", FREQUENCIES), by_torque, rtol=1e-12)


def test_operating_speed_couples_the_currents() -> None:
    """At rest, decoupled, the speed of the frame does not matter to K_t i_q; running fast it does, a little."""
    still = LinearSystem(machine(), modes(), "speed")
    slow, fast = (
        LinearSystem(machine(), modes(), "speed", operating={"Z": linear.OperatingPoint(n=n)}) for n in (5.0, 300.0)
    )
    f = np.array([50.0, 200.0])
    base = linear.speed_reference(still, "Z", f)
    assert 0 < np.max(np.abs(linear.speed_reference(slow, "Z", f) / base - 1)) < 1e-3
    assert np.max(np.abs(linear.speed_reference(fast, "Z", f) / base - 1)) > 1e-3


# --- names and faults ----------------------------------------------------------------------------------------------


def test_names_and_units() -> None:
    response = LinearSystem(machine(), modes()).response(
        FREQUENCIES, ["Z.M_add", "X.x_s", "tool.F_X"], ["Z.n_a", "X.x_a", "tool.x_X", "Z.M_a"]
    )
    assert response.units["Z.n_a/Z.M_add"] == "(rad/s)/(N.m)"
    assert response.units["X.x_a/X.x_s"] == "1"
    assert response.units["tool.x_X/tool.F_X"] == "m/N"
    assert response.units["Z.M_a/tool.F_X"] == "(N.m)/N"
    assert len(response.columns) == 12


@pytest.mark.parametrize(
    ("frequency", "name", "output", "said"),
    [
        ([1.0], "W.n_add", "Z.n_a", "no input 'W.n_add'"),
        ([1.0], "Z.n_add", "Z.n_b", "no output 'Z.n_b'"),
        ([1.0], "Z.M_a", "Z.n_a", "'Z.M_a' is given by its drive"),
        ([0.0], "Z.n_add", "Z.n_a", "frequency 0 Hz; allowed are values above 0 up to 4000 Hz"),
        ([4001.0], "Z.n_add", "Z.n_a", "frequency 4001 Hz"),
        ([math.nan], "Z.n_add", "Z.n_a", "frequency nan"),
    ],
)
def test_what_is_refused(frequency: list[float], name: str, output: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        LinearSystem(machine(), modes()).response(np.array(frequency), [name], [output])


def test_inputs_of_a_drive_that_is_switched_off_are_refused() -> None:
    with pytest.raises(InputError, match=r"'Z.n_add' belongs to a drive that is switched off"):
        LinearSystem(machine(), modes(), {"Z": "none"}).transfer(FREQUENCIES, "Z.n_a", "Z.n_add")


@pytest.mark.parametrize("f", [500.0, 1000.0, 2000.0, 4000.0])
def test_mirror_frequencies_are_finite(f: float) -> None:
    assert np.isfinite(LinearSystem(machine(), modes()).at(np.array([2j * np.pi * f * (1 - 1e-9)]))).all()
    assert np.isfinite(LinearSystem(machine(), modes()).transfer(np.array([f]), "Z.n_a", "Z.x_s")).all()
