"""plant.fmu from outside: against closed forms, analytic responses and the matrix exponential."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from plant_unit import (
    AXES,
    FREQUENCY,
    INPUTS,
    OUTPUTS,
    POSE,
    POSITIONS,
    SHAPE,
    SPEEDS,
    TOOL,
    H,
    Modes,
    random_inputs,
    single_mode,
)
from scipy.linalg import expm

from fmi_helpers import Archive, Floats, Instance


@pytest.fixture(scope="module")
def archive(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return Archive.unpack(fmus / "plant.fmu", tmp_path_factory.mktemp("plant"))


@pytest.fixture(scope="module")
def modes(archive: Archive) -> Modes:
    return Modes.read(archive.folder / "resources" / "modes.csv")


@pytest.fixture
def unit(archive: Archive) -> Iterator[Instance]:
    with archive.instance() as instance:
        yield instance


# --- the structure ----------------------------------------------------------------------------------------------------


def test_starts_at_its_pose(unit: Instance) -> None:
    for axis, x_0 in POSE.items():
        assert unit.get(f"{axis}.x_0") == x_0
        assert unit.get(f"{axis}.x_a") == x_0
        assert unit.get(f"tcp.x_{axis}") == x_0
        assert unit.get(f"tool.x_{axis}") == 0.0
        assert unit.get(f"{axis}.n_a") == unit.get(f"{axis}.n_fr") == 0.0


@pytest.mark.parametrize(("axis", "j_tot"), [("X", 0.08592), ("Y", 0.02645), ("Z", 0.01639)])
def test_inertia_and_lead(archive: Archive, modes: Modes, axis: str, j_tot: float) -> None:
    i = AXES.index(axis)
    rigid = modes.omega == 0.0
    assert int(rigid.sum()) == 3
    with archive.instance(inputs={f"{axis}.M_a": 2.0}) as unit:
        unit.step(10.0)  # one step: the lowest mode (21 Hz, 6 %) has decayed by exp(-79)
        n, x = unit.get(f"{axis}.n_a"), unit.get(f"{axis}.x_a")
        assert unit.derivative(f"{axis}.x_a") / n == pytest.approx(0.020 / (2 * math.pi), rel=1e-6)
        unit.step(10.0, {f"{axis}.M_a": 0.0})  # coasting: everything elastic has gone
        rise = unit.get(f"{axis}.n_a")
        unit.step(1.0)
        assert rise == pytest.approx(10.0 * 2.0 / j_tot, rel=5e-4)  # four digits are printed
        assert 2.0 * 10.0 / rise == pytest.approx(1.0 / float((modes.n[rigid, i] ** 2).sum()), rel=1e-6)
        assert unit.get(f"{axis}.n_a") == pytest.approx(rise, rel=1e-9)
        travelled = unit.get(f"{axis}.x_a")
        unit.step(1.0)
        assert (unit.get(f"{axis}.x_a") - travelled) / rise == pytest.approx(0.020 / (2 * math.pi), rel=1e-6)
        assert x > POSE[axis]


@pytest.mark.parametrize(("axis", "j_inf"), [("X", 0.01514), ("Y", 0.01118), ("Z", 0.00754)])
def test_inertia_at_the_first_instant(archive: Archive, modes: Modes, axis: str, j_inf: float) -> None:
    # Before anything moves all modes accelerate: J_inf is what limits an explicit coupling.
    expected = 1.0 / float((modes.n[:, AXES.index(axis)] ** 2).sum())
    assert expected == pytest.approx(j_inf, rel=5e-4)  # printed with four digits
    with archive.instance(inputs={f"{axis}.M_a": 3.0}) as unit:
        assert 3.0 / unit.derivative(f"{axis}.n_a") == pytest.approx(expected, rel=1e-12)
        unit.step(1e-9)
        # omega h = 6e-6, and the damping takes 2 zeta omega h of that
        assert 3.0e-9 / unit.get(f"{axis}.n_a") == pytest.approx(expected, rel=1e-6)


def test_friction_and_load_act_against_the_motor(archive: Archive) -> None:
    def speed(inputs: Mapping[str, float], parameters: Mapping[str, float]) -> float:
        with archive.instance(parameters, inputs=inputs) as unit:
            unit.step(0.01)
            return unit.get("Y.n_a")

    one = speed({"Y.M_a": 1.0}, {})
    assert one > 0.0
    assert speed({"Y.M_fr": 1.0}, {}) == -one
    assert speed({}, {"Y.M_0": 1.0}) == -one
    assert speed({"Y.M_a": 5.0, "Y.M_fr": 2.0}, {"Y.M_0": 2.0}) == pytest.approx(one, rel=1e-14)


def test_load_is_tunable(archive: Archive) -> None:
    with archive.instance() as unit, archive.instance() as other:
        unit.step(0.01)
        unit.set({"Z.M_0": -3.0})
        unit.step(0.01)
        other.step(0.01)
        other.step(0.01, {"Z.M_a": 3.0})
        assert unit.get("Z.x_a") == other.get("Z.x_a")


def test_start_position_shifts_the_outputs_alone(archive: Archive) -> None:
    with archive.instance() as unit, archive.instance({"Z.x_0": -2.0}) as other:
        for instance in (unit, other):
            instance.step(0.05, {"Z.M_a": 5.0, "tool.F_X": 100.0})
        assert other.get("tool.x_Z") == unit.get("tool.x_Z") != 0.0
        assert other.get("Z.x_a") == pytest.approx(unit.get("Z.x_a") - 2.1, rel=1e-14)
        assert other.get("tcp.x_Z") == pytest.approx(unit.get("tool.x_Z") - 2.0, rel=1e-14)
        assert other.get("tcp.x_X") == unit.get("tcp.x_X") == 0.8 + unit.get("tool.x_X")


@pytest.mark.parametrize("by_slope", [False, True])
@pytest.mark.parametrize("name", [*INPUTS, *(f"{axis}.M_fr" for axis in AXES)])
def test_every_input_acts_alone(archive: Archive, modes: Modes, name: str, by_slope: bool) -> None:
    shapes = {"M_a": modes.n, "M_fr": -modes.n, "F": modes.tcp, "F_a": modes.x}
    port = name[-1] if name.startswith("tool") else name[0]
    shape = shapes[name.split(".")[1].removesuffix(f"_{port}")][:, AXES.index(port)]
    h = 1e-8  # omega h is 6e-5, and damping takes 2 zeta omega h of the speeds
    with archive.instance() as unit:
        unit.step(h, {} if by_slope else {name: 1.0}, {name: 1.0} if by_slope else {})
        gain = h**2 / 2 if by_slope else h
        assert unit.gets(SPEEDS) == pytest.approx(gain * (modes.n.T @ shape), rel=1e-4)
        rates = [unit.derivative(output) for output in TOOL]
        assert rates == pytest.approx(gain * (modes.tcp.T @ shape), rel=1e-4)


@pytest.mark.parametrize("direction", AXES)
@pytest.mark.parametrize("axis", AXES)
def test_reciprocity(archive: Archive, axis: str, direction: str) -> None:
    """A force on the tool turns a rotor at the rate at which that rotor's torque moves the tool (Maxwell, Betti)."""
    with archive.instance() as unit, archive.instance() as other:
        unit.step(0.02, {f"{axis}.M_a": 1.0})
        other.step(0.02, {f"tool.F_{direction}": 1.0})
        expected = unit.derivative(f"tool.x_{direction}")
        # sums over 93 modes in another order, of terms up to a hundred times the sum
        assert other.get(f"{axis}.n_a") == pytest.approx(expected, rel=1e-12, abs=1e-16)


@pytest.mark.parametrize("axis", AXES)
def test_a_force_on_the_slide_turns_the_rotor_as_its_torque_moves_the_slide(archive: Archive, axis: str) -> None:
    with archive.instance() as unit, archive.instance() as other:
        unit.step(0.02, {f"{axis}.M_a": 1.0})
        other.step(0.02, {f"{axis}.F_a": 1.0})
        assert other.get(f"{axis}.n_a") == pytest.approx(unit.derivative(f"{axis}.x_a"), rel=1e-12)


@pytest.mark.parametrize("axis", AXES)
def test_force_on_the_slide_and_torque_of_the_rotor_in_balance(archive: Archive, axis: str) -> None:
    """F = -M/I_P: the axis stays as a whole, but for what the drive train gives way by; the torque twists it."""
    lead = 0.020 / (2 * math.pi)
    balanced = {f"{axis}.M_a": 2.0, f"{axis}.F_a": -2.0 / lead}
    with archive.instance(inputs=balanced) as unit, archive.instance(inputs={f"{axis}.M_a": 2.0}) as free:
        for instance in (unit, free):
            instance.step(10.0)  # the lowest mode (21 Hz, 6 %) has decayed by exp(-79)
        # The table's shapes have 15 digits, and a lead of 6 of them (test_inertia_and_lead).
        assert abs(unit.get(f"{axis}.n_a")) < 1e-5 * abs(free.get(f"{axis}.n_a"))
        assert unit.get(f"{axis}.x_a") < POSE[axis], "the slide gives way backwards"


# --- accuracy ---------------------------------------------------------------------------------------------------------


def test_machine_is_the_matrix_exponential(archive: Archive, modes: Modes) -> None:
    """All 93 modes under linear inputs at every port, steps from 1 us to 20 ms, against expm() of each mode."""
    steps = [1e-6, 125e-6, 125e-6, 1e-3, 3.3e-4, 2e-2, 125e-6, 5e-3] * 3
    corners = random_inputs(len(steps), seed=1)
    ports = np.hstack([modes.n, modes.tcp, modes.x])
    state = np.zeros((len(modes.omega), 2))
    scale = np.zeros(len(OUTPUTS))
    worst = np.zeros(len(OUTPUTS))
    with archive.instance(inputs=dict(zip(INPUTS, corners[0], strict=True))) as unit:
        for k, h in enumerate(steps):
            slopes = (corners[k + 1] - corners[k]) / h
            unit.step(h, dict(zip(INPUTS, corners[k], strict=True)), dict(zip(INPUTS, slopes, strict=True)))
            for m, (omega, zeta) in enumerate(zip(modes.omega, modes.zeta, strict=True)):
                # states q, q', f and the slope of f
                a = np.array([[0, 1, 0, 0], [-(omega**2), -2 * zeta * omega, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0]])
                start = np.array([*state[m], ports[m] @ corners[k], ports[m] @ slopes])
                state[m] = (expm(a * h) @ start)[:2]
            q, v = state.T
            expected = np.concatenate([modes.n.T @ v, modes.x.T @ q + list(POSE.values()), modes.tcp.T @ q])
            moved = np.concatenate([np.abs(modes.n.T) @ np.abs(v), np.ones(3), np.abs(modes.tcp.T) @ np.abs(q)])
            scale = np.maximum(scale, moved)
            worst = np.maximum(worst, np.abs(unit.gets(OUTPUTS) - expected))
    assert (worst <= 1e-12 * scale).all(), worst / scale


def ramp_response(omega: float, zeta: float, t: Floats, force: float, slope: float) -> tuple[Floats, Floats]:
    """q and q' of a mode that starts at rest under force + slope t: particular solution plus decay."""
    linear = slope / omega**2
    constant = (force - 2 * zeta * omega * linear) / omega**2
    q_0, v_0 = -constant, -linear  # of the homogeneous part
    if zeta < 1.0:
        d = omega * math.sqrt((1 - zeta) * (1 + zeta))
        decay, c, s = np.exp(-zeta * omega * t), np.cos(d * t), np.sin(d * t) / d
    elif zeta == 1.0:
        decay, c, s, d = np.exp(-omega * t), np.ones_like(t), t, 0.0
    else:
        d = omega * math.sqrt((zeta - 1) * (zeta + 1))
        decay, c, s = np.exp(-zeta * omega * t), np.cosh(d * t), np.sinh(d * t) / d
    rest = decay * (q_0 * c + (v_0 + zeta * omega * q_0) * s)
    rate = decay * (v_0 * c - (omega**2 * q_0 + zeta * omega * v_0) * s)
    return np.asarray(constant + linear * t + rest), np.asarray(linear + rate)


@pytest.mark.parametrize("zeta", [0.0, 0.02, 0.7, 1.0, 1.5])
@pytest.mark.parametrize("h", [H, 2.7e-3])
def test_single_mode_is_its_analytic_response(archive: Archive, tmp_path: Path, zeta: float, h: float) -> None:
    path = single_mode(tmp_path / "single.csv", zeta)
    steps = 400
    force, slope = 3.0, -40.0
    t: Floats = np.asarray(np.arange(1, steps + 1) * h, dtype=np.float64)
    grid = force + slope * np.append(0.0, t)
    with archive.instance({"modes_file": str(path)}, inputs={"Z.M_a": force}) as unit:
        seen = unit.run(h, ["Z.M_a"], grid, OUTPUTS)
    b = SHAPE["n"][2]
    q, v = ramp_response(2 * math.pi * FREQUENCY, zeta, t, b * force, b * slope)
    for i, axis in enumerate(AXES):
        for name, response, shape, at in (("n_a", v, "n", 0.0), ("x_a", q, "x", POSE[axis]), ("tool", q, "tcp", 0.0)):
            column = OUTPUTS.index(f"tool.x_{axis}" if name == "tool" else f"{axis}.{name}")
            expected = SHAPE[shape][i] * response
            # Rounding of the steps (400 of them, undamped they add up) and of positions about x_0.
            assert np.abs(seen[:, column] - at - expected).max() <= 1e-12 * np.abs(expected).max() + 2e-16 * abs(at)


@pytest.mark.parametrize("h", [H, 1e-3, 0.017])
def test_split_step(archive: Archive, modes: Modes, h: float) -> None:
    first, last = random_inputs(1, seed=3)
    slopes = (last - first) / h

    def end(parts: Sequence[float]) -> Floats:
        with archive.instance() as unit:
            unit.step(3e-3, dict(zip(INPUTS, -last, strict=True)))  # some history
            done = 0.0
            for part in parts:
                values = first + slopes * done
                unit.step(part, dict(zip(INPUTS, values, strict=True)), dict(zip(INPUTS, slopes, strict=True)))
                done += part
            return np.concatenate([unit.gets(OUTPUTS), [unit.derivative(name) for name in (*SPEEDS, *POSITIONS)]])

    whole = end([h])
    for parts in ([h / 2, h / 2], [0.1 * h, 0.9 * h], [h / 4] * 4):
        assert end(parts) == pytest.approx(whole, rel=1e-12, abs=1e-12 * 1e-3)  # 1e-3: a small displacement [m]


def test_step_size_leaves_no_trace(archive: Archive) -> None:
    corners = random_inputs(20, seed=4)
    with archive.instance() as unit, archive.instance() as other:
        unit.run(H, INPUTS, corners, OUTPUTS)
        state = unit.state()
        unit.step(3e-4)
        unit.step(H * (1 + 2**-52))
        unit.restore(state)
        other.run(H, INPUTS, corners, OUTPUTS)
        unit.step(H)
        other.step(H)
        assert (unit.gets(OUTPUTS) == other.gets(OUTPUTS)).all()


def test_output_derivatives(archive: Archive) -> None:
    corners = random_inputs(8, seed=5)
    names = (*SPEEDS, *(f"{axis}.n_fr" for axis in AXES), *POSITIONS, *TOOL, *(f"tcp.x_{axis}" for axis in AXES))
    with archive.instance(inputs=dict(zip(INPUTS, corners[0], strict=True))) as unit:
        unit.run(1e-3, INPUTS, corners, OUTPUTS)
        slopes = (corners[-1] - corners[-2]) / 1e-3
        derivatives = np.array([unit.derivative(name) for name in names])
        before = unit.gets(names)
        d = 1e-8  # inputs run on as they did, so that nothing bends at the communication point
        unit.step(d, dict(zip(INPUTS, corners[-1], strict=True)), dict(zip(INPUTS, slopes, strict=True)))
        # Quotient of outputs with a rounding of 1e-16 of their size; its error of order d is 1e-8 (6000/s) n' / 2.
        quotient = (unit.gets(names) - before) / d
        rounding = 4e-16 * np.abs(before) / d
        assert (np.abs(derivatives - quotient) <= 1e-3 * np.abs(derivatives) + rounding).all()


def test_inputs_between_steps_do_not_move_derivatives(unit: Instance) -> None:
    unit.step(H, {"Z.M_a": 5.0})
    before = unit.derivative("Z.n_a")
    unit.set({"Z.M_a": 500.0})
    assert unit.derivative("Z.n_a") == before != 0.0


def test_no_feed_through(unit: Instance) -> None:
    unit.step(H, {"Z.M_a": 5.0})
    assert [unit.partial(output, known) for output in OUTPUTS for known in INPUTS] == [0.0] * 81
