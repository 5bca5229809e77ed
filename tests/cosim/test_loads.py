"""Loads over time: their means, the motion and the torque that they bring about in closed form, their work, faults."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp

from feedsim import scenario
from feedsim.cli import main
from feedsim.foundation.errors import Finding, InputError
from feedsim.scenario import Base, load_machine
from feedsim.scenario.loads import ForceTable, ToolLoad
from feedsim.simulation import cosim, judge, nc
from feedsim.simulation.cosim.loads import ActingLoad
from feedsim.simulation.cosim.schedule import REPORTED_EVERY
from feedsim.simulation.judge import JudgedRun, judge_run

Floats = NDArray[np.float64]

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
EMPS = load_machine(SCENARIOS / "machines" / "emps")  # a rigid axis: 95.109 kg, control cycle 1 ms
I_P, MASS = EMPS.axes["X"].I_P, 95.109
# Nothing holds the axis: no gain, no constant load, and the least friction that there may be, 1e-7 of the published.
FREE = [
    "machine.axes.X.drive.K_v=0 1/s", "machine.axes.X.drive.K_p=0 N.m.s/rad", "machine.axes.X.constant_load=0 N.m",
    *(f"machine.axes.X.friction.{name}=1e-9 N.m" for name in ("F_C", "F_S")),
    "machine.axes.X.friction.sigma_0=1e-6 N.m/rad", "machine.axes.X.friction.sigma_1=0 N.m.s/rad",
    "machine.axes.X.friction.sigma_2=0 N.m.s/rad",
]  # fmt: skip
DWELL = "motions=[{kind: dwell, duration: 1 s}]"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "s.yaml"
    machine = SCENARIOS / "machines" / "emps"
    path.write_text(f"name: s\nmachine: {machine}\nmotions: [{{kind: dwell, duration: 1 s}}]\n", encoding="utf-8")
    return path


def run(file: Path, fmus: Path, *overrides: str, native: bool | None = None) -> JudgedRun:
    return judge_run(cosim.run(scenario.load(file, list(overrides)), fmus=fmus, native=native))


def warnings_ahead(file: Path, fmus: Path, *overrides: str) -> tuple[Finding, ...]:
    loaded = scenario.load(file, list(overrides))
    return judge.check(loaded, nc.plan(loaded), fmus=fmus)


# --- means over control cycles


@pytest.mark.parametrize("held", [False, True])
def test_means_are_those_of_the_course(held: bool) -> None:
    """Against adaptive quadrature of the course itself, which is 0 outside of its rows: 1e-9, its own tolerance."""
    draw = np.random.default_rng(5)
    time, values = np.cumsum(draw.uniform(0.01, 0.5, 30)), draw.normal(size=30)
    table = ForceTable(time=tuple(time.tolist()), values=tuple(values.tolist()))
    load = ToolLoad(direction="X", held=held, table=table)
    edges = np.linspace(-0.2, time[-1] + 0.3, 60)

    def course(t: float) -> float:
        if not time[0] <= t < time[-1]:
            return 0.0
        row = np.flatnonzero(time <= t)[-1]
        share = 0.0 if held else (t - time[row]) / (time[row + 1] - time[row])
        return float((1 - share) * values[row] + share * values[row + 1])

    found = ActingLoad("loads.0", load, time, values).means(edges)
    for i, mean in enumerate(found):
        a, b = edges[i], edges[i + 1]
        kinks = [t for t in time if a < t < b]
        assert mean == pytest.approx(quad(course, a, b, points=kinks, limit=200)[0] / (b - a), abs=1e-9)
    assert np.count_nonzero(found == 0) > 2, "there is nothing before the first row and behind the last"


def test_a_constant_is_exactly_itself() -> None:
    load = ToolLoad(direction="X", table=ForceTable(time=(0.0, 9.0), values=(0.1, 0.1)))
    acting = ActingLoad("loads.0", load, np.array([0.0, 9.0]), np.array([0.1, 0.1]))
    assert set(acting.means(np.arange(5000) * 125e-6).tolist()) == {0.1}


# --- closed forms on a rigid axis


@pytest.mark.parametrize(
    ("kind", "factor"), [("motor, axis: X", -I_P), ("slide, axis: X", 1.0), ("tool, direction: X", 1.0)]
)
def test_a_free_axis_moves_as_newton_says(kind: str, factor: float, file: Path, fmus: Path) -> None:
    """F(t) = 100 N sin^2 over 0.5 s, in 101 rows: the position is its double integral.

    The motor's load counts against the motor, I_P times the force. The means are exact in their impulse, the speed at
    the cycles' ends therefore to rounding; the position to the second order, T_c^2/12 times the force over m.
    """
    time = np.linspace(0.1, 0.6, 101)
    force = 100 * np.sin(np.pi * (time - 0.1) / 0.5) ** 2
    unit = "N.m" if kind.startswith("motor") else "N"
    rows = ", ".join(f"{t!r} s" for t in time.tolist()), ", ".join(f"{F * factor!r} {unit}" for F in force.tolist())
    found = run(file, fmus, *FREE, f"loads=[{{kind: {kind}, table: {{time: [{rows[0]}], values: [{rows[1]}]}}}}]")
    t = found.trace.time

    def motion(t: float, state: Floats) -> Floats:
        return np.array([state[1], np.interp(t, time, force, left=0.0, right=0.0) / MASS])

    exact = solve_ivp(motion, (0, t[-1]), [0.0, 0.0], t_eval=t, rtol=1e-10, atol=1e-12, max_step=1e-3).y
    assert exact[1][-1] == pytest.approx(25 / MASS, rel=1e-6), "the impulse is half of 100 N times 0.5 s"
    # The friction left is 2.5e-6 N: 2.6e-8 m/s and 1.3e-8 m after a second.
    np.testing.assert_allclose(found.trace["X.n_a"] * I_P, exact[1], atol=5e-8)
    np.testing.assert_allclose(
        found.trace["X.x_a"] - found.trace["X.x_a"][0], exact[0], atol=2 * 1e-6 / 12 * 100 / MASS
    )
    kinetic = MASS * exact[1][-1] ** 2 / 2
    (work,) = found.loads
    assert work.given == pytest.approx(kinetic, rel=1e-4)
    assert work.taken == 0
    assert work.peak == pytest.approx(100 * factor, rel=1e-3)


@pytest.mark.parametrize("force", ["slide, axis: X", "tool, direction: X"])
def test_torque_and_force_of_the_same_size_hold_each_other(force: str, file: Path, fmus: Path) -> None:
    """Sign, unit and place of the kinds at once: F on slide or tool pushes, F I_P at the motor counts against it."""
    loads = (
        f"loads=[{{kind: {force}, table: {{time: [0 s, 0.3 s, 2 s], values: [0 N, 80 N, 10 N]}}}},"
        f"{{kind: motor, axis: X, factor: {I_P!r}, "
        "table: {time: [0 s, 0.3 s, 2 s], values: [0 N.m, 80 N.m, 10 N.m]}}]"
    )
    found = run(file, fmus, *FREE, loads)
    one = run(file, fmus, *FREE, loads.split(",{kind: motor")[0] + "]")
    assert np.ptp(one.trace["X.x_a"]) > 0.1
    assert np.ptp(found.trace["X.x_a"]) < 1e-9, "rounding, which friction alone would hold"


def test_at_rest_the_motor_carries_the_load(file: Path, fmus: Path) -> None:
    """A step of 30 N at the carriage: M_a = -30 N I_P + M_0 + M_fr, and P control gives way by the torque over its
    gains: K_p K_v (x_s - x_a)/I_P = M_a. The last 0.1 % of the creep of the bristles is left."""
    step = "loads=[{kind: tool, direction: X, held: true, table: {time: [0 s, 9 s], values: [30 N, 30 N]}}]"
    found = run(file, fmus, step, "motions=[{kind: dwell, duration: 4 s}]")
    trace, axis = found.trace, EMPS.axes["X"]
    drive = EMPS.shipped_drive("X", "the test")
    carried = -30 * I_P + axis.M_0 + trace["X.M_fr"][-1]
    assert trace["X.M_a"][-1] == pytest.approx(carried, abs=1e-6)
    sag = trace["X.x_s"][-1] - trace["X.x_a"][-1]
    assert drive.K_p * drive.K_v * sag / I_P == pytest.approx(trace["X.M_a"][-1], rel=1e-3)
    assert sag < -1e-6


def test_a_slide_that_is_pushed_bends_the_drive_train(tmp_path: Path, fmus: Path) -> None:
    """On a machine that gives way (synthetic). At rest the motor carries F I_P, wherever that acts, and the control has
    brought the scale back. At first the force moves the slide itself, the torque only what the screw hands on."""
    file = tmp_path / "s.yaml"
    machine = SCENARIOS / "machines" / "one_axis"
    file.write_text(f"name: s\nmachine: {machine}\nmotions: [{{kind: dwell, duration: 3 s}}]\n", encoding="utf-8")
    lead = load_machine(machine).axes["X"].I_P
    every = "recording.interval=125 us"
    kinds = {"slide, axis: X": "400 N", "motor, axis: X": f"{-400 * lead!r} N.m"}
    slide, motor = (
        run(
            file, fmus, every,
            f"loads=[{{kind: {kind}, held: true, table: {{time: [0.1 s, 9 s], values: [{value}, {value}]}}}}]",
        ).trace
        for kind, value in kinds.items()
    )  # fmt: skip
    for trace in (slide, motor):
        # What rings at 27 Hz and 2 % has decayed by exp(-0.02 * 170 * 2.9) = 5e-5.
        assert trace["X.M_a"][-1] == pytest.approx(-400 * lead + trace["X.M_fr"][-1], abs=1e-3)
        assert trace["X.x_a"][-1] == pytest.approx(trace["X.x_s"][-1], abs=1e-6)
    first = round(0.1 / 125e-6) + 2  # two cycles after the step
    moved = [trace["X.x_a"][first] - trace["X.x_a"][first - 2] for trace in (slide, motor)]
    # Free masses and a spring: F t^2/(2 m) at the slide itself, F t^4/24 times k/(m m') through the spring.
    assert moved[0] > 3 * abs(moved[1])
    assert moved[0] > 0


def test_the_energy_balance_closes(file: Path, fmus: Path) -> None:
    """A move under loads of every kind, over whole stretches of the loop and one cycle more or less: what the motor
    gives is what friction and loads take, and the kinetic energy. Work by the trapezoidal rule on 1 ms: 1e-3."""
    for cycles in (2 * REPORTED_EVERY - 1, 2 * REPORTED_EVERY, 2 * REPORTED_EVERY + 1):
        dwell = f"{(cycles - 2300) * 1e-3!r} s"
        found = run(
            file, fmus,
            f"motions=[{{kind: dwell, duration: 1 s}}, {{kind: move, by: {{X: 100 mm}}, feed: 6 m/min}}, "
            f"{{kind: dwell, duration: {dwell}}}]",
            "loads=[{kind: tool, direction: X, table: {time: [0.2 s, 1.2 s, 1.9 s], values: [0 N, -50 N, 20 N]}},"
            "{kind: motor, axis: X, held: true, "
            "table: {time: [1.3 s, 1.31 s, 1.6 s, 3 s], values: [5e-2 N.m, 1e-2 N.m, -2e-2 N.m, 0 N.m]}},"
            "{kind: slide, axis: X, table: {time: [0.2 s, 1.2 s, 1.9 s], values: [0 N, -40 N, 20 N]}}]",
            "machine.axes.X.constant_load=0 N.m",
        )  # fmt: skip
        trace, work = found.trace, found.loads
        n = trace["X.n_a"]
        # EMPS' ideal current loop holds the torque of a cycle, which is recorded at its end.
        motor = float(np.sum(trace["X.M_a"][1:] * (n[1:] + n[:-1]) / 2) * 1e-3)
        kinetic = MASS * I_P**2 * (n[-1] ** 2 - n[0] ** 2) / 2
        loads = sum(each.net for each in work)
        assert loads < -1
        assert found.coupling["X.friction_work"] > 1
        assert motor + loads == pytest.approx(found.coupling["X.friction_work"] + kinetic, rel=1e-3)
        # The same from what is recorded: each value acts over the cycle that follows.
        recorded = trace["X.M_0"][:-1] * (n[1:] + n[:-1]) / 2 * 1e-3
        assert work[1].net == pytest.approx(-recorded.sum(), rel=1e-12)
        forces = trace["tool.F_X"][:-1] * np.diff(trace["tool.x_X"])
        assert work[0].net == pytest.approx(forces.sum(), rel=1e-12)
        slide = trace["X.F_a"][:-1] * np.diff(trace["X.x_a"])
        assert work[2].net == pytest.approx(slide.sum(), rel=1e-12)
        assert (work[0].given, -work[0].taken) == pytest.approx((forces[forces > 0].sum(), forces[forces < 0].sum()))


def test_loads_at_one_place_add_up_to_the_constant_load(file: Path, fmus: Path) -> None:
    table = "table: {time: [0 s, 1 s], values: [1e-3 N.m, 3e-3 N.m]}"
    loads = f"loads=[{{kind: motor, axis: X, {table}}}, {{kind: motor, axis: X, factor: -2, {table}}}]"
    found = run(file, fmus, loads).trace
    np.testing.assert_allclose(
        found["X.M_0"][:-1], EMPS.axes["X"].M_0 - (1e-3 + 2e-3 * (found.time[:-1] + 0.5e-3)), rtol=1e-12
    )


# --- time of the load


def test_a_recorded_load_runs_with_the_recorded_setpoints(file: Path, fmus: Path) -> None:
    """One file for both, whose clock starts at 7 s and which begins in motion: run-in and dwell shift both alike, and
    a part of the file has the load of that part."""
    t = np.arange(7.0, 9.0, 1e-3)
    x = 20 * np.sin(2 * np.pi * (t - 7.0) / 2)
    pulse = np.where(np.abs(t - 7.9) < 1e-6, 4.0, 0.0)
    rows = [f"{a!r},{b!r},{c!r}" for a, b, c in zip(t.tolist(), x.tolist(), pulse.tolist(), strict=True)]
    record = file.parent / "record.csv"
    record.write_text("\n".join(["clock [s],q [mm],F [N]", *rows, ""]), encoding="utf-8")
    for between in ("", "between: [7.4 s, 8.5 s], "):
        found = run(
            file, fmus,
            f"motions=[{{kind: dwell, duration: 0.1 s}}, {{kind: setpoints, file: {record}, time: clock, {between}"
            "columns: {X: q}, relative: true}]",
            f"loads=[{{kind: tool, direction: X, file: {record}, time: clock, column: F, motion: 1}}]",
        )  # fmt: skip
        force, trace = found.trace["tool.F_X"], found.trace
        (acting,) = np.nonzero(np.abs(force[:-1]) > 1e-6)  # instants are rounded
        # A triangle of 4 N over two rows has means of 2 N in the two cycles about its row.
        np.testing.assert_allclose(force[acting], 2.0, rtol=1e-6)
        assert len(acting) == 2
        row = acting[1]  # the cycle that begins at the pulse
        setpoint = trace["X.x_s"][row] - trace["X.x_s"][row + 1]
        wanted = 20e-3 * (np.sin(np.pi * 0.9) - np.sin(np.pi * 0.901))
        assert setpoint == pytest.approx(wanted, rel=1e-6), "the setpoint's step there is that of the recorded instant"


def test_a_load_runs_with_another_motion_from_its_begin(file: Path, fmus: Path) -> None:
    found = run(
        file, fmus, "motions=[{kind: dwell, duration: 0.3 s}, {kind: dwell, duration: 0.5 s}]",
        "loads=[{kind: tool, direction: Y, held: true, motion: 1, table: {time: [0.1 s, 0.2 s], values: [3 N, 0 N]}}]",
    )  # fmt: skip
    acting = found.trace.time[found.trace["tool.F_Y"] == 3]
    assert (acting[0], acting[-1]) == pytest.approx((0.4, 0.499))


# --- executors and schemes


@pytest.mark.parametrize("scheme", ["extrapolated", "iterated"])
def test_the_native_loop_leaves_the_same_bits(scheme: str, tmp_path: Path, fmus: Path) -> None:
    """On the default machine, over more than a stretch of the loop."""
    file = tmp_path / "s.yaml"
    file.write_text(
        f"""name: s
machine: {SCENARIOS / "machines" / "test_centre"}
motions: [{{kind: move, by: {{Z: 4 mm}}, feed: 5000 mm/min}}, {{kind: dwell, duration: 0.3 s}}]
loads:
  - {{kind: motor, axis: Z, table: {{time: [0 s, 0.1 s, 0.4 s], values: [0 N.m, 3 N.m, -1 N.m]}}}}
  - {{kind: tool, direction: Z, held: true, table: {{time: [0.1 s, 0.2 s, 0.4 s], values: [-500 N, 300 N, 0 N]}}}}
  - {{kind: slide, axis: Z, table: {{time: [0.05 s, 0.2 s, 0.3 s], values: [-50 N, 300 N, 20 N]}}}}
coupling: {{scheme: {scheme}, substeps: 2}}
""",
        encoding="utf-8",
    )
    native, python = (run(file, fmus, native=wanted) for wanted in (True, False))
    assert native.native
    assert native.trace.time[-1] > 1.2 * REPORTED_EVERY * 125e-6
    for column in native.trace:
        np.testing.assert_array_equal(native.trace[column], python.trace[column], err_msg=column)
    assert native.loads == python.loads
    assert np.ptp(run(file, fmus, "loads=[]").trace["Z.x_a"] - native.trace["Z.x_a"]) > 1e-6


# --- what is told


def test_what_only_a_wrong_unit_or_place_explains_is_told_ahead(file: Path, fmus: Path) -> None:
    step = "loads=[{{kind: {}, held: true, table: {{time: [0.5 s, 0.6 s, 1 s], values: [0 {}, {}, 0 {}]}}}}]"
    sound = warnings_ahead(file, fmus, DWELL, step.format("tool, direction: X", "N", "30 N", "N"))
    assert sound == ()
    (big,) = warnings_ahead(file, fmus, DWELL, step.format("tool, direction: X", "N", "30 kN", "N"))
    # 30 kN I_P = 11.94 N.m over 0.13986 N.m
    assert big.code == "load-too-large"
    assert "reaches 3e+04 N, 11.94 N.m at the motor of X, 85.3 times" in big.text
    (place,) = warnings_ahead(file, fmus, DWELL, step.format("motor, axis: X", "N.m", "30 N.m", "N.m"))
    assert (place.code, place.place.rpartition(" ")[2]) == ("load-too-large", "loads.0")
    assert "reaches 30 N.m, 215 times the drive's M_max, 0.1399 N.m" in place.text
    (small,) = warnings_ahead(file, fmus, DWELL, step.format("tool, direction: X", "N", "0.03 N", "N"))
    assert small.code == "load-too-small"
    assert "1.194e-05 N.m at the motor of X, 0.0015 of the Coulomb friction F_C" in small.text
    assert warnings_ahead(file, fmus, DWELL, step.format("tool, direction: Y", "N", "30 kN", "N")) == ()


def test_a_load_that_drives_is_told_by_its_work(file: Path, fmus: Path) -> None:
    def told(force: float) -> list[Finding]:
        found = run(
            file, fmus, "motions=[{kind: dwell, duration: 1 s}, {kind: move, by: {X: 100 mm}, feed: 6 m/min}]",
            "loads=[{kind: tool, direction: X, "
            f"table: {{time: [1 s, 1.3 s, 1.6 s, 2 s], values: [0 N, {force} N, {force} N, 0 N]}}}}]",
        )  # fmt: skip
        return [finding for finding in found.warnings if finding.code == "load-drives"]

    assert told(-40) == []
    (wrong,) = told(40)
    assert (wrong.place.rpartition(" ")[2], wrong.remedy) == ("loads.0", "loads.0.factor=-1")


@pytest.fixture
def recorded(file: Path, fmus: Path) -> Path:
    """A record of the axis under a force of 60 N that resists its motion: force, setpoint, motor torque."""
    motions = "motions=[{kind: dwell, duration: 1 s}, {kind: move, by: {X: 100 mm}, feed: 6 m/min}]"
    table = "table: {time: [1.2 s, 1.4 s, 1.9 s, 2.1 s], values: [0 N, -60 N, -60 N, 0 N]}"
    found = run(file, fmus, motions, f"loads=[{{kind: slide, axis: X, {table}}}]").trace
    columns = (found.time, found["X.x_s"], found["X.F_a"], found["X.M_a"])
    rows = [",".join(map(repr, row)) for row in zip(*(column.tolist() for column in columns), strict=True)]
    path = file.parent / "record.csv"
    path.write_text("\n".join(["time [s],x [m],F [N],M [N.m]", *rows, ""]), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("kind", "unit", "factor", "fits"),
    [
        ("slide", "N", 1.0, None),
        ("slide", "N", 1.3, None),  # friction may be that wrong
        ("slide", "N", -1.0, 1.0),
        ("slide", "kN", 1e-3, None),
        ("slide", "N", 0.2, 1.0),
        ("slide", "N", -0.2, 1.0),
        ("slide", "N", 4.0, 1.0),
        ("motor", "N.m", -I_P, None),
        ("motor", "N.m", I_P, -I_P),
    ],
)
def test_the_recorded_motor_torque_tells_a_wrong_sign_and_size(
    kind: str, unit: str, factor: float, fits: float | None, recorded: Path, file: Path, fmus: Path
) -> None:
    """By the work while the load acts. The factor that fits is told, to 3 %: under another load the P control lets the
    axis move a little otherwise."""
    recorded.write_text(recorded.read_text(encoding="utf-8").replace("F [N]", f"F [{unit}]"), encoding="utf-8")
    found = run(
        file, fmus, f"motions=[{{kind: setpoints, file: {recorded}, columns: {{X: x}}}}]",
        f"loads=[{{kind: {kind}, axis: X, file: {recorded}, column: F, motor_torque: M, factor: {factor!r}}}]",
    )  # fmt: skip
    told = [finding for finding in found.warnings if finding.code == "load-contradicts-record"]
    if fits is None:
        assert told == []
        return
    (finding,) = told
    shown = fits / factor
    why = "shows little or nothing of it" if abs(shown) < 0.3 else "its sign is" if shown < 0 else "its size is wrong:"
    assert why in finding.text
    key, _, value = finding.remedy.partition("=")
    assert key == "loads.0.factor"
    assert float(value) == pytest.approx(fits, rel=0.03)


def test_a_load_at_the_start_lets_the_axis_sag(tmp_path: Path, fmus: Path) -> None:
    file = tmp_path / "s.yaml"
    file.write_text(
        f"name: s\nmachine: {SCENARIOS / 'machines' / 'test_centre'}\n"
        "motions: [{kind: move, by: {Z: 4 mm}, feed: 5000 mm/min}]\n"
        "loads: [{kind: motor, axis: Y, table: {time: [0 s, 9 s], values: [5 N.m, 5 N.m]}}]\n",
        encoding="utf-8",
    )
    (told,) = warnings_ahead(file, fmus)
    assert (told.code, told.place.rpartition(" ")[2]) == ("load-not-carried", "loads.0")
    assert "the load of 5 N.m at the motor of Y" in told.text
    assert warnings_ahead(file, fmus, "loads.0.factor=0.1") == (), "F_C of Y is 2 N.m: friction holds 0.5 N.m"


@pytest.mark.parametrize(
    ("load", "content", "message"),
    [
        ("kind: tool, direction: X", "time [s],F [N.m]\n0,1\n1,1\n",
         "F.csv:1: column 'F': unit 'N.m' is that of a torque; one of a force is expected"),
        ("kind: motor, axis: X", "time [s],F [N]\n0,1\n1,1\n",
         "F.csv:1: column 'F': unit 'N' is that of a force; one of a torque is expected"),
        ("kind: motor, axis: X", "time [s],F\n0,1\n1,1\n",
         "F.csv:1: column 'F' has no unit; write 'F [N.m]' in the header or give the unit"),
        ("kind: motor, axis: X", "time [s],G\n0,1\n1,1\n", "no column 'F'"),
        ("kind: motor, axis: X", "time [s],F [N.m]\n0,1\n1,\n", "F.csv:3"),
        ("kind: motor, axis: X", "time [s],F [N.m]\n0,1\n", "F.csv: 1 row; at least 2 are needed"),
        ("kind: motor, axis: X, motor_torque: M", "time [s],F [N.m],M [A]\n0,1,1\n1,1,1\n",
         "F.csv:1: column 'M': unit 'A' is that of a current; one of a torque is expected"),
        ("kind: tool, direction: X", "time [s],F [N]\n50,1\n60,1\n",
         "the load acts from 50 to 60 s of the run, which lasts from 0 to 1 s: it never acts"),
    ],
)  # fmt: skip
def test_files_that_are_refused(load: str, content: str, message: str, file: Path, fmus: Path) -> None:
    record = file.parent / "F.csv"
    record.write_text(content, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        warnings_ahead(file, fmus, f"loads=[{{{load}, file: {record}, column: F}}]")
    assert message in str(caught.value)
    assert "loads.0: " in str(caught.value)


def test_studies_take_the_files_of_loads_along(file: Path) -> None:
    record = file.parent / "F.csv"
    record.write_text("time [s],F [N]\n0,1\n1,1\n", encoding="utf-8")
    base = Base.read(file, [f"loads=[{{kind: tool, direction: X, file: {record}, column: F}}]"])
    assert record in base.files


def test_report_summary_and_result_have_the_loads(file: Path, fmus: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    table = "{time: [0.1 s, 0.2 s], values: [-7 N, -7 N]}"
    loads = f"loads=[{{kind: tool, direction: X, table: {table}}}]"
    assert main(["run", str(file), "--set", loads, "--fmus", str(fmus), "--out", str(out), "--quiet"]) == 0
    (load,) = json.loads((out / "summary.json").read_text(encoding="utf-8"))["loads"]
    assert load["input"] == "tool.F_X"
    assert load["largest"] == {"value": -7.0, "unit": "N"}
    assert load["work_taken"]["value"] + load["work_on_machine"]["value"] > 0
    assert "on the tool in X" in (out / "report.html").read_text(encoding="utf-8")
    assert "tool.F_X [N]" in (out / "result.csv").read_text(encoding="utf-8").partition("\n")[0]


def test_an_ssp_file_is_not_written_without_the_loads(
    file: Path, fmus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = "{time: [0.1 s, 0.2 s], values: [7 N, 7 N]}"
    file.write_text(f"{file.read_text()}loads: [{{kind: tool, direction: X, table: {table}}}]\n", encoding="utf-8")
    out = tmp_path / "s.ssp"
    assert main(["export", str(file), "--fmus", str(fmus), "--out", str(out)]) == 2
    assert f"{file}:4: loads: an SSP file holds no loads" in capsys.readouterr().err
    assert not out.exists()
    assert main(["export", str(file), "--fmus", str(fmus), "--out", str(out), "--set", "loads=[]"]) == 0
