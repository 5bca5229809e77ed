"""Play with contact between motor and structure: joined where it is stiff, hunting as describing functions say."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2Error
from numpy.typing import NDArray
from plant_unit import write_modes
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from feedsim import scenario
from feedsim.foundation.errors import InputError
from feedsim.linear.judgement import judge
from feedsim.simulation import cosim
from feedsim.simulation.cosim import Run
from feedsim.structure import Modes, checked_modes
from feedsim.structure.modes import join_motors
from fmi_helpers import Archive, Instance
from reference import monolithic

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios" / "z_positioning.yaml"
Z = "machine.axes.Z"
T_C = 125e-6
FREE = [f"{Z}.friction.{each}" for each in ("F_C=1e-3 N.m", "F_S=1e-3 N.m", "F_log=0 N.m", "sigma_2=0 N.m.s/rad")]


def contact(stiffness: float, damping: float, play: float = 0.0) -> list[str]:
    """Settings of Z: stiffness [N/m], damping [N.s/m], play [m]."""
    values = (f"stiffness={stiffness!r} N/m", f"damping={damping!r} N.s/m", f"play={play!r} m", "inertia=0.004 kg.m^2")
    return [f"{Z}.transmission.{each}" for each in values]


def run(fmus: Path, *settings: str) -> Run:
    return cosim.run(scenario.load(SCENARIO, ["recording.interval=125 us", *settings]), fmus=fmus)


def test_two_masses_have_their_frequency() -> None:
    J, rest, c = 0.004, 0.01, 900.0
    whole = np.array([1 / np.sqrt(J + rest)])
    one = Modes(Path("modes.csv"), np.zeros(1), np.zeros(1), {"n_A": whole, "x_A": 0.003 * whole})
    found = join_motors(one, (("A", c, 0.3, J),))
    omega = np.sqrt(c * (1 / J + 1 / rest))
    np.testing.assert_allclose(2 * np.pi * found.frequency, [0, omega], rtol=1e-12)
    assert found.damping[1] == pytest.approx(0.3 * omega / (2 * c), rel=1e-12)
    assert found.J_inf("A") == pytest.approx(J, rel=1e-12)
    assert found.J_tot("A") == pytest.approx(J + rest, rel=1e-12)


def test_a_stiff_contact_leaves_the_structure_as_it_is(fmus: Path) -> None:
    """1e11 N/m gives 0.1 nm to the 10 N that a um asks for; the axis goes as without, slides with friction, too."""
    for guide in ([], [f"{Z}.guide.share=60 %"]):
        joined_run, own = run(fmus, *contact(1e11, 1e6), *guide), run(fmus, *guide)
        apart = joined_run.trace["Z.x_a"] - own.trace["Z.x_a"]
        assert np.max(np.abs(apart)) < 1e-7
        assert np.max(np.abs(joined_run.trace["Z.transmission.way"])) < 1e-6
    modes = checked_modes(own.scenario.machine)
    with_contact = checked_modes(joined_run.scenario.machine)
    few = len(modes.frequency) // 2
    np.testing.assert_allclose(with_contact.frequency[:few], modes.frequency[:few], rtol=1e-3)


@pytest.mark.parametrize(
    ("stiffness", "damping", "changes"),
    [(200e6, 3e4, ["drive.K_p=2.5 N.m.s/rad"]), (400e6, 5e4, ["drive.K_p=4 N.m.s/rad", "drive.K_v=3 (m/min)/mm"])],
)
def test_a_directly_measured_axis_hunts_as_describing_functions_say(
    stiffness: float, damping: float, changes: list[str], fmus: Path
) -> None:
    """The dead zone of half the play D lets a swing of amplitude A have a share N of its stiffness:

    N = 1 - 2/pi (asin(D/A) + D/A sqrt(1 - (D/A)^2))

    (Gelb, Vander Velde, Multiple-Input Describing Functions, 1968). It stays where the linear loop is marginal with
    that share; the linear loop knows nothing of play. Waves three times as fast, left out, are a fifth of it here.
    """
    settings = [*FREE, *(f"{Z}.{each}" for each in changes)]

    def grows(share: float) -> bool:
        machine = scenario.load(SCENARIO, [*settings, *contact(share * stiffness, share * damping)]).machine
        loops = judge(machine, checked_modes(machine))
        return any(each.growing for each in loops if each.axis == "Z" and each.state == "moving")

    low, high = 1e-3, 1.0
    assert grows(low)
    assert not grows(high)
    while high > 1.002 * low:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if grows(middle) else (low, middle)
    D = 4e-6
    foretold = brentq(
        lambda A: 1 - 2 / np.pi * (np.arcsin(D / A) + D / A * np.sqrt(1 - (D / A) ** 2)) - low, 1.0001 * D, 100 * D
    )
    trace = run(fmus, *settings, *contact(stiffness, damping, 2 * D), "motions.1.duration=2 s").trace
    last = trace.time > trace.time[-1] - 0.5
    time, way = trace.time[last], trace["Z.transmission.way"][last]

    def swing(f: float) -> tuple[float, float]:
        waves = np.stack([np.ones_like(time), np.sin(2 * np.pi * f * time), np.cos(2 * np.pi * f * time)], axis=1)
        (_, a, b), rest, *_ = np.linalg.lstsq(waves, way, rcond=None)
        return float(rest[0]), float(np.hypot(a, b))

    near = np.fft.rfftfreq(8 * len(way), T_C)[np.abs(np.fft.rfft(way - way.mean(), 8 * len(way))).argmax()]
    f = min(np.linspace(near - 0.5, near + 0.5, 51), key=lambda f: swing(f)[0])
    assert swing(f)[1] == pytest.approx(foretold, rel=0.1)
    assert np.ptp(trace["Z.x_a"][last]) > 2 * D  # and the scale sees it


@pytest.mark.parametrize(("stiffness", "steps"), [(200e6, 2), (1000e6, 5)])
def test_runs_agree_with_a_program_of_their_own(stiffness: float, steps: int, fmus: Path) -> None:
    """Within 2 nm, drive, friction and impacts included, by as many exchange steps as the contact asks for."""
    short = ["motions.0.by={Z: 10 mm}", "motions.1.duration=0.1 s"]
    found = run(fmus, *contact(stiffness, 3e4, 8e-6), *short)
    assert found.scenario.coupling.steps(found.scenario.machine) == steps
    machine, program = monolithic.machine(), found.program
    lead = machine.axes["Z"].drive["I_P"]
    machine.axes["Z"].contact = (0.004, stiffness * lead**2, 3e4 * lead**2, 4e-6 / lead)
    setpoints = monolithic.Setpoints(program.x_s, program.n_ffw, duration=float(program.time[-1]))
    expected = monolithic.simulate(machine, setpoints, duration=float(found.trace.time[-1]), step=T_C / 50)
    error = np.max(np.abs(found.trace["Z.x_a"] - expected["Z.x_a"]))
    print(f"\n{stiffness:g} N/m: {error * 1e9} nm")  # shown by pytest -s
    assert error < 2e-9


@pytest.mark.parametrize(
    ("settings", "steps"),
    [
        ([], 1), (contact(20e6, 3e4, 8e-6), 1), (contact(1000e6, 3e4), 1), (contact(1000e6, 3e4, 8e-6), 5),
        ([*contact(1000e6, 3e4, 8e-6), "coupling.substeps=1"], 1),
        ([*contact(1000e6, 3e4, 8e-6), "coupling.substeps=7"], 7),
        ([*contact(1000e6, 3e4, 8e-6), "coupling.units=one"], 1), (contact(1e20, 0.0, 8e-6), 1000),
    ],
)  # fmt: skip
def test_exchange_steps_are_what_a_contact_with_play_asks_for(settings: list[str], steps: int) -> None:
    """sqrt(k/J) I_P T_c = 0.199 rad at 1000 N/um; what is given counts."""
    loaded = scenario.load(SCENARIO, settings)
    assert loaded.coupling.steps(loaded.machine) == steps


# --- The unit by itself, against an independent solution --------------------------------------------------------------

# Z as a whole, a mode of 130 Hz and one of 640 Hz; X and Y stand.
FREQUENCY, SHAPE, SCALE = np.array([0.0, 130.0, 640.0]), np.array([7.8, 6.0, 5.0]), np.array([0.0248, 0.004, -0.003])
DAMPING, INERTIA = np.array([0.0, 0.02, 0.02]), 0.004
LEAD = SCALE[0] / SHAPE[0]  # m/rad
INSTANTS = 801  # at k T_c
TORQUE = np.sin(np.outer(np.arange(INSTANTS) * T_C, 2 * np.pi * np.array([15, 47]))) @ [3.0, 1.5]


def solved(stiffness: float, damping: float, play: float) -> NDArray[np.float64]:
    """x_a and way of the contact at k T_c, k from 1 [m], shape (INSTANTS - 1, 2).

    The torque runs linearly between its instants. Structure without the motor, motor and contact are one system of
    differential equations; it is solved piece by piece, from one change of contact to the next.
    """
    omega, half = 2 * np.pi * FREQUENCY, play / 2 / LEAD
    c, d = stiffness * LEAD**2, damping * LEAD**2
    mobility = np.linalg.inv(np.eye(3) - INERTIA * np.outer(SHAPE, SHAPE))
    y, side, found = np.zeros(8), 0 if play > 0 else 1, []  # y: q, dq/dt, angle and speed of the motor

    def delta(y: NDArray[np.float64]) -> float:
        return float(y[6] - SHAPE @ y[:3])

    def rate(t: float, y: NDArray[np.float64], k: int, side: int) -> NDArray[np.float64]:
        C = c * (delta(y) - side * half) + d * (y[7] - SHAPE @ y[3:6]) if side else 0.0
        u = TORQUE[k] + (TORQUE[k + 1] - TORQUE[k]) * t / T_C
        forces = SHAPE * C - omega * (omega * y[:3] + 2 * DAMPING * y[3:6])
        return np.concatenate([y[3:6], mobility @ forces, [y[7], (u - C) / INERTIA]])

    def passes(sign: int, upwards: int) -> Callable[..., float]:
        def event(t: float, y: NDArray[np.float64], *_: int) -> float:
            return sign * delta(y) - half

        event.terminal, event.direction = True, upwards  # type: ignore[attr-defined]
        return event

    for k in range(INSTANTS - 1):
        t = 0.0
        while t < T_C:
            events = [] if not play else [passes(side, -1)] if side else [passes(1, 1), passes(-1, 1)]
            piece = solve_ivp(
                rate, (t, T_C), y, "DOP853", rtol=1e-11, atol=1e-15, events=events or None, args=(k, side)
            )
            t, y = float(piece.t[-1]), piece.y[:, -1]
            if piece.status == 1:
                side = 0 if side else 1 if len(piece.t_events[0]) else -1
        found.append([SCALE @ y[:3], delta(y) * LEAD])
    return np.array(found)


@pytest.fixture(scope="module")
def plant(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return Archive.unpack(fmus / "plant.fmu", tmp_path_factory.mktemp("contact") / "plant")


def joined_unit(plant: Archive, stiffness: float, damping: float, play: float) -> Instance:
    still = [[i + 3, 0, 0, *(8.0 * (j == i) for j in range(3)), *(0.02 * (j == i) for j in range(3)), 0, 0, 0]
             for i in range(2)]  # fmt: skip
    modes = zip(FREQUENCY, DAMPING, SHAPE, SCALE, strict=True)
    rows = [[i, f, zeta, 0, 0, n, 0, 0, x, 0, 0, x] for i, (f, zeta, n, x) in enumerate(modes)]
    table = write_modes(plant.folder.parent / "modes.csv", [*rows, *still])
    own = {"stiffness": stiffness, "damping": damping, "play": play, "inertia": INERTIA}
    own_values: dict[str, float | str] = {f"Z.transmission.{key}": value for key, value in own.items()}
    return plant.instance({"modes_file": str(table), "Z.x_0": 0.0, **own_values})


def stepped(unit: Instance, parts: int = 1) -> NDArray[np.float64]:
    """What :func:`solved` gives, by steps of T_c/parts."""
    fine = np.interp(np.arange((INSTANTS - 1) * parts + 1) / parts, np.arange(INSTANTS), TORQUE)
    return unit.run(T_C / parts, ["Z.M_a"], fine, ["Z.x_a", "Z.transmission.way"])[parts - 1 :: parts]


@pytest.mark.parametrize("stiffness", [20e6, 200e6, 1000e6])
def test_the_contact_moves_as_an_independent_solver_says(stiffness: float, plant: Archive) -> None:
    """At 125 us, across the play and back, with impacts on both sides: 0.03, 0.02 and 0.32 nm."""
    expected = solved(stiffness, 3e4, 8e-6)
    assert min(np.count_nonzero(side * expected[:, 1] > 4e-6) for side in (1, -1)) > 50
    with joined_unit(plant, stiffness, 3e4, 8e-6) as unit:
        assert np.max(np.abs(stepped(unit) - expected)) < 0.5e-9


@pytest.mark.parametrize(
    ("stiffness", "damping", "play", "order", "within"),
    [(1000e6, 3e4, 0.0, 4, 0.1), (200e6, 0.0, 8e-6, 4, 0.25), (200e6, 3e4, 8e-6, 3, 0.5)],
    ids=["closed", "play", "play and damping"],  # a damped contact begins with a jump of its force
)
def test_its_order(stiffness: float, damping: float, play: float, order: int, within: float, plant: Archive) -> None:
    expected, off = solved(stiffness, damping, play), []
    for parts in (1, 2, 4, 8):
        with joined_unit(plant, stiffness, damping, play) as unit:
            off.append(np.max(np.abs(stepped(unit, parts) - expected)))
    assert np.log2(off[0] / off[-1]) / 3 == pytest.approx(order, abs=within), off


def test_long_steps_are_cut(plant: Archive) -> None:
    """A swing of 2220 1/s turns by 2.2 rad in 1 ms: cut into eight, which are those of 125 us."""
    found = []
    for h in (1e-3, T_C):
        with joined_unit(plant, 1000e6, 3e4, 8e-6) as unit:
            torque = np.interp(np.arange(0, 0.1 + h / 2, h), np.arange(INSTANTS) * T_C, TORQUE)
            every = round(1e-3 / h)
            corners = torque[::every]
            fine = np.interp(np.arange(len(torque)) / every, np.arange(len(corners)), corners)
            found.append(unit.run(h, ["Z.M_a"], fine, ["Z.x_a", "Z.transmission.way"])[every - 1 :: every])
    np.testing.assert_allclose(found[0], found[1], rtol=0, atol=1e-15)


def test_steps_may_be_cut_anywhere(plant: Archive) -> None:
    """And saved there, and carried on by another instance, to the same bits."""
    cuts = np.unique(np.concatenate([np.arange(INSTANTS) * T_C, np.random.default_rng(1).uniform(0, 0.1, 500)]))
    rows, names = [], ("Z.x_a", "Z.transmission.way", "Z.transmission.heat")
    torque = np.interp(cuts, np.arange(INSTANTS) * T_C, TORQUE)
    with joined_unit(plant, 200e6, 3e4, 8e-6) as unit, joined_unit(plant, 200e6, 3e4, 8e-6) as other:
        for k, h in enumerate(np.diff(cuts)):
            slope = (torque[k + 1] - torque[k]) / h
            if k == 600:
                other.restore_serialized(unit.serialized(), unit.time)
            for each in (unit, other)[: 1 if k < 600 else 2]:
                each.step(h, {"Z.M_a": torque[k]}, {"Z.M_a": slope})
            rows.append(unit.gets(names))
        np.testing.assert_array_equal(other.gets(names), rows[-1])
        assert other.serialized() == unit.serialized()
    at_instants = np.searchsorted(cuts, np.arange(1, INSTANTS) * T_C) - 1
    with joined_unit(plant, 200e6, 3e4, 8e-6) as unit:
        assert np.max(np.abs(np.array(rows)[at_instants, :2] - stepped(unit))) < 0.1e-9


def test_a_contact_that_is_too_fast_is_refused(plant: Archive) -> None:
    with joined_unit(plant, 1e18, 0.0, 8e-6) as unit:
        with pytest.raises(FMICallException):
            unit.step(T_C)
        message = unit.texts(fmi2Error)
    for part in ("'Z.transmission'", "a step of 0.000125 s", "stiffness of 1e+18 N/m", " Hz", "allowed are 1000"):
        assert part in message, message


def test_one_unit_gives_the_same_bits(fmus: Path) -> None:
    changes = [*contact(200e6, 3e4, 5e-6), f"{Z}.guide.share=30 %", "motions.1.duration=0.1 s"]
    own, one = run(fmus, *changes, "coupling.substeps=1"), run(fmus, *changes, "coupling.units=one")
    for name in ("Z.x_a", "Z.n_a", "Z.transmission.F", "Z.transmission.way"):
        assert np.array_equal(own.trace[name], one.trace[name]), name


def test_a_step_that_does_not_settle_fails(fmus: Path, tmp_path: Path) -> None:
    """Two motors on one mass, each with 0.6 of its inertia: the rest would be less than none."""
    shapes = [8.0, 8.0, 0.0], [0.0, 0.0, 8.0]
    rows = [[i, 0, 0, *n, *(0.003 * each for each in n), *(0.003 * each for each in n)] for i, n in enumerate(shapes)]
    table = write_modes(tmp_path / "modes.csv", rows)
    archive = Archive.unpack(fmus / "plant.fmu", tmp_path / "plant")
    own: dict[str, float | str] = {"modes_file": str(table)}
    for axis in "XY":
        own |= {f"{axis}.transmission.stiffness": 2e8, f"{axis}.transmission.inertia": 0.6 / 8**2}
    with archive.instance(own, inputs={"X.M_a": 3.0}) as plant:
        with pytest.raises(FMICallException):
            plant.step(T_C)
        assert "do not settle over this step of 0.000125 s" in plant.texts(fmi2Error)


def test_faults_are_refused(fmus: Path) -> None:
    with pytest.raises(InputError, match=r"below 0\.95 of the inertia"):
        run(fmus, *contact(200e6, 0.0), f"{Z}.transmission.inertia=0.01 kg.m^2")
    with pytest.raises(InputError, match="stiffness is missing"):
        run(fmus, f"{Z}.transmission.play=8 um")
