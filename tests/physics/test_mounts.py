"""Levelling mounts that are not linear, in the plant and in runs: against a second implementation, energy, order.

The reference integrates friction of the mounts as a differential equation, together with structure, drives and friction
of the axes, by Runge-Kutta in steps of 2.5 us (tests/reference/monolithic).
"""

from __future__ import annotations

import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray
from plant_unit import AXES, H

import feedsim
from feedsim import scenario
from feedsim.files.fields import FileContent
from feedsim.foundation.errors import InputError
from feedsim.simulation import cosim
from feedsim.simulation.cosim import Run
from feedsim.structure.modes import checked_modes, with_mounts
from feedsim.structure.mounts import friction_cycle, read_mounts, viscous_cycle
from feedsim.structure.pack import pack
from fmi_helpers import Archive, Instance, Message
from reference import monolithic

Array = NDArray[np.float64]
SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
DEFAULT = SCENARIOS / "machines" / "test_centre"
SPRINGS = "        stiffness: [45 N/um, 65 N/um, 45 N/um]\n"
RUBBER = (
    "        friction: {F_max: [400 N, 600 N, 400 N], x_2: [20 um, 20 um, 20 um]}\n"
    "        viscous: {K_v: [5 N/um, 5 N/um, 5 N/um], c: [4e4 N.s/m, 4e4 N.s/m, 4e4 N.s/m]}\n"
)
LINEAR = "        elastic: [45 N/um, 65 N/um, 45 N/um]\n"
LOW_DAMPING = "  steps: [{below: 30 Hz, ratio: 6 %}]             # the machine rocks on its mounts, which damp more\n"
STOP = "[{kind: move, by: {Z: 100 mm}, feed: 5000 mm/min}, {kind: dwell, duration: 0.3 s}]"
CIRCLE = "[{kind: circle, plane: [X, Z], radius: 15 mm, feed: 3000 mm/min, turns: 1}, {kind: dwell, duration: 0.1 s}]"


def machine_with(
    folder: Path, mounts: str, *, damping: str = "ratio: 2 %", cutoff: str = "1000 Hz", springs: str = SPRINGS
) -> Path:
    """The default machine with other mounts, built anew; its folder."""
    place = shutil.copytree(DEFAULT, folder / "machine")
    text = (place / "structure.yaml").read_text(encoding="utf-8").replace(LOW_DAMPING, "")
    text = text.replace("ratio: 2 %\n", f"{damping}\n").replace("cutoff: 1000 Hz", f"cutoff: {cutoff}")
    assert SPRINGS in text
    (place / "structure.yaml").write_text(text.replace(SPRINGS, springs + mounts), encoding="utf-8")
    built = feedsim.machine_build(place / "structure.yaml", at={"X": "800 mm", "Y": "327 mm", "Z": "100 mm"})
    built.save(folder / "built")
    for name in ("modes.csv", "mounts.csv"):
        if (folder / "built" / name).is_file():
            shutil.copy(folder / "built" / name, place / name)
    if mounts:
        file = place / "machine.yaml"
        file.write_text(file.read_text(encoding="utf-8") + "\nmounts: {table: mounts.csv}\n", encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def rubber(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machine_with(tmp_path_factory.mktemp("rubber"), RUBBER)


def run(machine: Path, fmus: Path, motions: str, *overrides: str) -> Run:
    file = machine.parent / "scenario.yaml"
    file.write_text(f"name: mounts\nmachine: machine\nmotions: {motions}\n", encoding="utf-8")
    return cosim.run(scenario.load(file, ["recording.interval=125 us", *overrides]), fmus=fmus)


def reference(run: Run, machine: Path, step: float = 2.5e-6) -> dict[str, Array]:
    model = monolithic.machine(machine / "modes.csv")
    columns = range(1, 7 + len(model.frequency))
    model.mounts = np.loadtxt(machine / "mounts.csv", delimiter=",", skiprows=1, usecols=columns, ndmin=2)
    program = run.program
    setpoints = monolithic.Setpoints(program.x_s, program.n_ffw, duration=float(program.time[-1]))
    return monolithic.simulate(model, setpoints, duration=float(run.trace.time[-1]), step=step)


@pytest.mark.parametrize(
    ("motions", "jerk"),
    [
        (STOP, 150),
        pytest.param(STOP, 500, marks=pytest.mark.extensive),
        pytest.param(CIRCLE, 150, marks=pytest.mark.extensive),
    ],
)
def test_runs_agree_with_a_program_of_their_own(rubber: Path, fmus: Path, motions: str, jerk: int) -> None:
    """Within 2 nm at the control cycle, and of second order: what is left is the exchange with friction."""
    runs = [run(rubber, fmus, motions, f"machine.path.jerk={jerk} m/s^3", f"coupling.substeps={n}") for n in (1, 2)]
    expected = reference(runs[0], rubber)
    errors = [max(np.abs(each.trace[f"{a}.x_a"] - expected[f"{a}.x_a"]).max() for a in AXES) for each in runs]
    print(f"\njerk {jerk}: {np.array(errors) * 1e9} nm")  # shown by pytest -s
    assert errors[0] < 2e-9
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.35)
    looks = slice(4, None, 4)  # the energy is that of the last look
    own, other = runs[0].trace["mounts.E"][looks], expected["mounts.E"][looks]
    np.testing.assert_allclose(own, other, atol=2e-3 * np.abs(other).max())


def test_one_unit_leaves_the_same_bits(rubber: Path, fmus: Path) -> None:
    separate, one = (run(rubber, fmus, STOP, f"coupling.units={units}") for units in ("separate", "one"))
    for name in separate.trace:
        assert np.array_equal(separate.trace[name], one.trace[name]), name


def test_mounts_that_are_springs_leave_the_bits(tmp_path: Path, fmus: Path) -> None:
    springs, off = machine_with(tmp_path / "a", ""), machine_with(tmp_path / "b", LINEAR)
    first, second = run(springs, fmus, STOP), run(off, fmus, STOP)
    for name in first.trace:
        assert np.array_equal(first.trace[name], second.trace[name]), name


def test_a_stop_says_what_its_mounts_make(rubber: Path, fmus: Path, tmp_path: Path) -> None:
    """Against the structure built anew on mounts a thousand times as stiff."""
    file = rubber.parent / "stop.yaml"
    file.write_text(
        f"name: stop\nmachine: machine\nmotions: {STOP}\nevaluate: [{{kind: positioning, axis: Z, band: 1 um}}]\n",
        encoding="utf-8",
    )
    figures = feedsim.run(file, fmus=fmus).figures
    stiff = machine_with(tmp_path, "", springs=SPRINGS.replace("45", "45000").replace("65", "65000"))
    clamped = feedsim.run(file, fmus=fmus, set={"machine.modes": stiff / "modes.csv", "machine.mounts": None,
                                                "machine.structure": None}).figures  # fmt: skip
    assert "Z.settling_of_mounts" not in clamped
    held = figures["Z.settling_time"].value - figures["Z.settling_of_mounts"].value
    assert held == pytest.approx(clamped["Z.settling_time"].value, abs=3)
    assert figures["Z.settling_of_mounts"].value > 10


def test_factors_reach_the_plant(rubber: Path, fmus: Path) -> None:
    whole = run(rubber, fmus, STOP)
    softer = run(rubber, fmus, STOP, "machine.mounts.F_max=50 %")
    assert np.abs(whole.trace["Z.x_a"] - softer.trace["Z.x_a"]).max() > 0.1e-6


# --- the plant alone --------------------------------------------------------------------------------------------------


def plant(machine: Path, fmus: Path, folder: Path) -> Archive:
    pose = {"X": 0.8, "Y": 0.327, "Z": 0.1}
    out = folder / "plant.fmu"
    pack(
        fmus / "plant.fmu", out, modes=FileContent.read(machine / "modes.csv"), pose=pose, mounts=machine / "mounts.csv"
    )
    return Archive.unpack(out, folder / "plant")


def modal_state(unit: Instance, modes: int, ports: int) -> tuple[Array, Array]:
    """q and v of the unit's state: behind its head two places, of which one counts, and two blocks of the mounts."""
    data = unit.serialized()
    size = -(-modes // 4) * 4
    place, block = 9 + 2 * size + (3 + 8 + 8) * 3 + 8, size + 9 * ports
    begin = len(data) - 8 * 2 * (place + block)
    (counts,) = struct.unpack_from("<Q", data, begin - 8)
    numbers = np.frombuffer(data[begin:], dtype=np.float64)[counts * place : (counts + 1) * place]
    return numbers[9 : 9 + modes], numbers[9 + size : 9 + size + modes]


def test_energy_is_in_the_structure_or_in_the_mounts(fmus: Path, tmp_path: Path) -> None:
    """A structure without damping, pushed and left alone: kinetic and elastic energy and what the mounts have taken."""
    machine = machine_with(tmp_path, RUBBER, damping="ratio: 0 %", cutoff="60 Hz")
    table = np.loadtxt(machine / "modes.csv", delimiter=",", skiprows=1)
    omega, sums, taken = 2 * np.pi * table[:, 1], [], []
    with plant(machine, fmus, tmp_path).instance() as unit:
        unit.set({"Z.M_a": 8.0, "X.M_a": -5.0})
        for k in range(8000):
            if k == 160:
                unit.set({"Z.M_a": 0.0, "X.M_a": 0.0})
            unit.step(H)
            if k >= 160 and k % 400 == 399:
                q, v = modal_state(unit, len(omega), 18)
                taken.append(unit.get("mounts.E"))
                sums.append((v @ v + (omega * q) @ (omega * q)) / 2 + taken[-1])
    assert np.ptp(taken) > 1e-5 * sums[0]  # or it would say nothing
    assert np.ptp(sums) < 1e-9 * sums[0]


def test_states_are_saved_restored_and_reset(rubber: Path, fmus: Path, tmp_path: Path) -> None:
    names = ("Z.x_a", "X.n_a", "mounts.E", "mounts.x_max")

    def push(unit: Instance, first: int, last: int) -> list[float]:
        rows: list[float] = []
        for k in range(first, last):
            unit.step(H, {"Z.M_a": 20.0 * np.sin(0.02 * k)})
            rows += unit.gets(names).tolist()
        return rows

    archive = plant(rubber, fmus, tmp_path)
    with archive.instance() as unit:
        push(unit, 0, 1001)  # between two looks
        saved, text = unit.state(), unit.serialized()
        first = push(unit, 1001, 1400)
        unit.restore(saved)
        assert push(unit, 1001, 1400) == first
        unit.restore_serialized(text, saved[1])
        assert push(unit, 1001, 1400) == first
        unit.fmu.reset()
        unit.start({})
        push(unit, 0, 1001)
        assert push(unit, 1001, 1400) == first
    with archive.instance() as other:
        other.restore_serialized(text, saved[1])
        assert push(other, 1001, 1400) == first


def test_output_derivatives_have_the_mounts(rubber: Path, fmus: Path, tmp_path: Path) -> None:
    """dn_a/dt against the quotient over a short step behind it, during which the mounts' force is held."""
    with plant(rubber, fmus, tmp_path).instance() as unit:
        for k in range(401):
            unit.step(H, {"Z.M_a": 20.0 * np.sin(0.02 * k)})
        n, rate, state = unit.get("Z.n_a"), unit.derivative("Z.n_a"), unit.state()
        unit.step(1e-7)
        assert (unit.get("Z.n_a") - n) / 1e-7 == pytest.approx(rate, rel=1e-4)
        unit.restore(state)


def test_steps_that_are_too_long_are_refused(rubber: Path, fmus: Path, tmp_path: Path) -> None:
    with plant(rubber, fmus, tmp_path).instance() as unit:
        with pytest.raises(FMICallException):
            unit.step(5e-3)
        assert "too long for them" in unit.texts(3)


def test_other_modes_than_the_mounts_have_are_refused(rubber: Path, fmus: Path, tmp_path: Path) -> None:
    archive = plant(rubber, fmus, tmp_path)
    messages: list[Message] = []
    unit = Instance(archive, messages)
    with unit, pytest.raises(FMICallException):
        unit.start({"modes_file": str(rubber / "modes.csv")})
    assert "leave modes_file empty" in "\n".join(message.text for message in messages)


# --- the linear view --------------------------------------------------------------------------------------------------


def test_friction_cycle_has_its_closed_form() -> None:
    stiffness, loss = friction_cycle(np.array([1000.0]), np.array([20e-6]), np.array([30e-6]))
    assert stiffness[0] == pytest.approx(500 / 30e-6, rel=1e-9)
    assert loss[0] == pytest.approx(0.0211249 / (np.pi * 30e-6**2), rel=1e-5)
    assert friction_cycle(np.array([1000.0]), np.array([20e-6]), np.zeros(1)) == (
        pytest.approx([1000 / 20e-6], rel=1e-6),
        pytest.approx([0.0]),
    )


def test_describing_function_is_that_of_a_complex_matrix(rubber: Path) -> None:
    """Lowest modes at an amplitude against the quadratic eigenproblem with the mounts' complex stiffness."""
    machine = scenario.load_machine(rubber)
    base = checked_modes(machine.model_copy(update={"mounts": None}))
    table = read_mounts(rubber / "mounts.csv", len(base.frequency))
    amplitude = 15e-6
    seen = with_mounts(base, table, table.element, amplitude)
    K_lin, K_e, F_max, x_2, K_v, c = table.element.T
    stiff, loss = friction_cycle(F_max, x_2, np.full(len(K_lin), amplitude))
    elastic = base.frequency > 0
    omega, b = 2 * np.pi * base.frequency[elastic], table.shapes[:, elastic]
    for k in range(3):
        w = 2 * np.pi * seen.frequency[elastic][k]
        for _ in range(20):
            K, D = viscous_cycle(K_v, c, w)
            added = K_e + stiff + K - K_lin + 1j * (loss + D)
            drag = 1j * 2 * base.damping[elastic] * omega * w
            values = np.linalg.eigvals(np.diag(omega**2 + drag) + b.T @ (added[:, None] * b))
            square = np.sort_complex(values)[k]
            w = np.sqrt(square.real)
        assert seen.frequency[elastic][k] == pytest.approx(w / (2 * np.pi), rel=3e-3)
        assert seen.damping[elastic][k] == pytest.approx(square.imag / square.real / 2, rel=0.05)


def test_at_rest_the_modes_are_those_of_the_table(tmp_path: Path) -> None:
    place = machine_with(tmp_path, RUBBER.splitlines()[0] + "\n")
    machine = scenario.load_machine(place)
    without = checked_modes(machine.model_copy(update={"mounts": None}))
    assert np.array_equal(checked_modes(machine).frequency, without.frequency)


def test_damping_that_counts_twice_is_said(tmp_path: Path) -> None:
    place = machine_with(tmp_path, RUBBER, damping="ratio: 2 %\n  steps: [{below: 30 Hz, ratio: 6 %}]")
    built = feedsim.machine_build(place / "structure.yaml", at={"X": "800 mm", "Y": "327 mm", "Z": "100 mm"})
    assert any(f.code == "damping-counted-twice" and "21." in f.text for f in built.findings)
    low = machine_with(tmp_path / "low", RUBBER)
    quiet = feedsim.machine_build(low / "structure.yaml", at={"X": "800 mm", "Y": "327 mm", "Z": "100 mm"})
    assert "damping-counted-twice" not in [finding.code for finding in quiet.findings]


def test_frf_says_how_it_has_the_mounts(rubber: Path) -> None:
    at_rest = feedsim.frf(rubber, "Z", measure=False, full_model=False)
    swinging = feedsim.frf(rubber, "Z", measure=False, full_model=False, mount_amplitude="20 um")
    for result, state in ((at_rest, "at rest"), (swinging, "20 um")):
        assert any(f.code == "mounts-linearised" and state in f.text for f in result.findings)
    peaks = [float(abs(each["Z.n_a/Z.M_a"][each.frequency < 25]).max()) for each in (at_rest, swinging)]
    assert peaks[1] < peaks[0]
    with pytest.raises(InputError, match="no mounts that are not linear"):
        feedsim.frf(DEFAULT, "Z", measure=False, full_model=False, mount_amplitude="20 um")


# --- files ------------------------------------------------------------------------------------------------------------


def test_friction_stiffer_than_the_mount_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="more than the mount's 45 N/um"):
        machine_with(tmp_path, "        friction: {F_max: [1000 N, 600 N, 400 N], x_2: [20 um, 20 um, 20 um]}\n")


def test_a_table_of_other_modes_is_refused(rubber: Path, tmp_path: Path) -> None:
    place = Path(shutil.copytree(rubber, tmp_path / "machine"))
    rows = (place / "mounts.csv").read_text(encoding="utf-8").splitlines()
    (place / "mounts.csv").write_text("\n".join(row.rpartition(",")[0] for row in rows) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"modes\.csv has 93"):
        checked_modes(scenario.load_machine(place))


def test_ssp_carries_the_mounts(rubber: Path, fmus: Path) -> None:
    file = rubber.parent / "scenario.yaml"
    file.write_text(f"name: mounts\nmachine: machine\nmotions: {STOP}\n", encoding="utf-8")
    changed = {"machine.mounts.c": "50 %"}
    made = feedsim.export(file, kind="ssp", fmus=fmus, set=changed)
    (rubber.parent / "wired.ssp").write_bytes(made.content)
    own, other = feedsim.run(file, fmus=fmus, set=changed), feedsim.run(rubber.parent / "wired.ssp")
    assert np.array_equal(own["Z.x_a"], other["Z.x_a"])
    assert not np.array_equal(own["Z.x_a"], feedsim.run(file, fmus=fmus)["Z.x_a"])
