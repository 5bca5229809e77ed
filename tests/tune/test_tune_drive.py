"""Tuning of drives: margins and noise against the state space, knobs, matching, the search, the command."""

from __future__ import annotations

import csv
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.linalg import solve_discrete_lyapunov

from agreement_helpers import assert_numbers_agree
from command_helpers import feedsim
from feedsim.analysis.proposals import axis_lag, loop_lag
from feedsim.design.tune.circles import Pair
from feedsim.design.tune.drive import (
    CHOSEN,
    HELD_OUT_MOVES,
    SEARCHED_MOVES,
    Limits,
    _Search,
    changed_values,
    minimise_rank,
    tune_drive,
)
from feedsim.design.tune.drive_program import DriveProgram, Stop, circles_of, partner_of, stops_of
from feedsim.design.tune.knobs import Knobs, match_lag, with_drives
from feedsim.linear.judgement import Candidates, judge
from feedsim.scenario import Drive, Machine, load, load_machine
from feedsim.structure import Modes, checked_modes
from feedsim.structure.modes import parse_modes

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
Z = SCENARIOS / "z_positioning.yaml"
ONE = SCENARIOS / "one_axis.yaml"
DWELL = "[{kind: dwell, duration: 1 s}]"
EMPS = SCENARIOS / "machines" / "emps"


# --- margins: own state space, own Nyquist ---------------------------------------------------------------------------


def rigid_machine(K_p: float, T_n: float, K_v: float) -> tuple[Machine, Modes]:
    """One rigid axis with an ideal current loop, no friction at rest worth the name, T_pos = 4 T_c."""
    machine = load_machine(
        ONE.parent / "machines" / "one_axis",
        [
            "axes.X.drive.ideal_current_loop=true", "axes.X.drive.filter_1={type: off}",
            "axes.X.drive.reference_model=false", "axes.X.drive.ramp_speed_setpoint=false",
            f"axes.X.drive.K_p={K_p} N.m.s/rad", f"axes.X.drive.T_n={T_n} s", f"axes.X.drive.K_v={K_v} 1/s",
            "cycles.position=500 us",
        ],
    )  # fmt: skip
    modes = checked_modes(machine)
    rigid = modes.rigid
    return machine, Modes(
        modes.file, modes.frequency[rigid], modes.damping[rigid],
        {name: shape[rigid] for name, shape in modes.ports.items()},
    )  # fmt: skip


def speed_loop(J: float, K_p: float, T_n: float, T_c: float, z: np.ndarray) -> np.ndarray:
    """Torque held over T_c on an inertia; PI with the error of the present instant in: K_p (1 + T_c/T_n z/(z - 1))."""
    return K_p * (1 + T_c / T_n * z / (z - 1)) * T_c / J / (z - 1)


def margins_of(L: np.ndarray) -> tuple[float, float]:
    """Least factor up or down to -1 [dB], and least distance of the phase to -180 degrees where |L| is 1."""
    real = np.flatnonzero((np.signbit(L.imag[1:]) != np.signbit(L.imag[:-1])) & (L.real[1:] < 0))
    real = [*real, len(L) - 1] if L.real[-1] < 0 else [*real]  # at half the sampling rate L is real
    gain = min(abs(20 * math.log10(abs(L[k]))) for k in real)
    unit = np.flatnonzero((np.abs(L[1:]) < 1) != (np.abs(L[:-1]) < 1))
    return gain, min(abs(180 - abs(np.degrees(np.angle(L[k])))) for k in unit)


def test_modes_are_changed_behind_a_transmission(monkeypatch: pytest.MonkeyPatch) -> None:
    """A table of changed modes has those of the structure, to which the machine joins its motor, once."""
    contact = ("stiffness=200 N/um", "damping=3e4 N.s/m", "inertia=0.004 kg.m^2")
    scenario = load(Z, [f"machine.axes.Z.transmission.{each}" for each in contact])
    structure = parse_modes(scenario.machine.modes, tuple(scenario.machine.axes))
    monkeypatch.setattr(_Search, "errors", lambda *args, **named: ())
    poses = {"another": structure}
    search = _Search.begin(scenario, "Z", Limits(8.0, 40.0, 1e-5), poses, None, lambda *_: None, 10)
    changed = search.with_modes(scenario.machine, 1.1)
    table = parse_modes(changed.modes, tuple(changed.axes))
    assert table.frequency == pytest.approx(1.1 * structure.frequency, rel=1e-15)
    joined = checked_modes(changed)
    assert len(joined.frequency) == len(structure.frequency) + 1
    for name in ("pose of the machine file", "another"):
        own = search.judges[f"{name}, modes 10 % higher"].candidates.modes
        assert own.frequency == pytest.approx(joined.frequency, rel=1e-12)
        assert search.judges[name].candidates.modes.J_inf("Z") == pytest.approx(0.004, rel=1e-9)


@pytest.mark.parametrize(("K_p", "T_n", "K_v"), [(0.25, 0.02, 60.0), (1.2, 0.004, 120.0)])
def test_margins_of_a_rigid_axis_by_hand(K_p: float, T_n: float, K_v: float) -> None:
    """The speed loop as a rational function of z; the position loop as a state space over T_pos, lifted by hand."""
    machine, modes = rigid_machine(K_p, T_n, K_v)
    axis, T_c, T_pos = machine.axes["X"], machine.cycles.T_c, machine.cycles.T_pos
    J = modes.J_tot("X")
    found = Candidates(machine, modes, "X").judge(axis.drive)
    moving = {loop.kind: loop for loop in found.loops if loop.state == "moving"}

    f = np.geomspace(0.5, 0.5 / T_c, 400_000)
    gain, phase = margins_of(speed_loop(J, K_p, T_n, T_c, np.exp(2j * np.pi * f * T_c)))
    assert 20 * math.log10(moving["speed"].gain_margin) == pytest.approx(gain, abs=0.15)  # polygon of the contour
    assert moving["speed"].phase_margin == pytest.approx(phase, abs=0.5)

    # states n, x, sum of errors; over a control cycle with the speed setpoint held
    def cycle(state: np.ndarray, n_s: float) -> np.ndarray:
        n, x, total = state
        total = total + (n_s - n)
        M = K_p * (n_s - n) + K_p * T_c / T_n * total
        return np.array([n + M * T_c / J, x + axis.I_P * (n * T_c + M * T_c**2 / (2 * J)), total])

    def over(state: np.ndarray, n_s: float) -> np.ndarray:
        for _ in range(round(T_pos / T_c)):
            state = cycle(state, n_s)
        return state

    A = np.column_stack([over(unit, 0.0) for unit in np.eye(3)])
    B = over(np.zeros(3), 1.0)
    f = np.geomspace(0.5, 0.5 / T_pos, 60_000)
    z = np.exp(2j * np.pi * f * T_pos)
    x = np.linalg.solve(z[:, None, None] * np.eye(3) - A, np.broadcast_to(B[:, None], (len(z), 3, 1)))[:, 1, 0]
    gain, phase = margins_of(K_v / axis.I_P * x)
    assert 20 * math.log10(moving["position"].gain_margin) == pytest.approx(gain, abs=0.15)
    assert moving["position"].phase_margin == pytest.approx(phase, abs=0.5)


def test_torque_of_encoder_noise_by_lyapunov() -> None:
    """White noise of the angle through the closed speed loop: the covariance of its states."""
    K_p, T_n = 0.4, 0.01
    machine, modes = rigid_machine(K_p, T_n, 60.0)
    J, T_c = modes.J_tot("X"), machine.cycles.T_c
    # states: speed, sum of errors, last noise; measured speed n + (w_k - w_(k-1))/T_c
    K_i = K_p * T_c / T_n
    C = np.array([-K_p - K_i, K_i, (K_p + K_i) / T_c])  # torque of the states
    D = -(K_p + K_i) / T_c  # and of the present noise
    A = np.vstack([np.array([1.0, 0, 0]) + C * T_c / J, [-1.0, 1.0, 1 / T_c], [0.0, 0.0, 0.0]])
    B = np.array([[D * T_c / J], [-1 / T_c], [1.0]])
    P = solve_discrete_lyapunov(A, B @ B.T)
    expected = math.sqrt(float(C @ P @ C) + D**2)
    assert Candidates(machine, modes, "X").judge(machine.axes["X"].drive).noise == pytest.approx(expected, rel=5e-3)


def test_candidates_are_judged_as_machines_are() -> None:
    """What is kept of the structure changes nothing: another drive, judged alone and as a part of its machine."""
    machine = load(Z).machine
    modes = checked_modes(machine)
    candidates = Candidates(machine, modes, "Z")
    for values in ({}, {"K_p": 11.0, "T_n": 0.006, "omega_0": 1500.0}, {"K_p": 5.0, "K_v": 120.0}, {"K_p": 60.0}):
        other = with_drives(machine, {"Z": values})
        found = candidates.judge(other.axes["Z"].drive)
        expected = [loop for loop in judge(other, modes) if loop.axis == "Z"]
        assert len(found.loops) == len(expected) == 4
        for one, two in zip(found.loops, expected, strict=True):
            assert (one.kind, one.state, one.growing, one.unstable) == (two.kind, two.state, two.growing, two.unstable)
            # both are polygons along the contour, on different frequencies
            assert one.gain_margin == pytest.approx(two.gain_margin, rel=5e-3)
            assert one.phase_margin == pytest.approx(two.phase_margin, abs=0.3)


# --- knobs and matching ----------------------------------------------------------------------------------------------


def test_the_present_drive_is_a_place() -> None:
    machine = load(Z).machine
    drive = machine.axes["Z"].drive
    knobs = Knobs(drive, machine.cycles, checked_modes(machine).J_tot("Z"))
    assert [knob.name for knob in knobs.all][:6] == ["K_p", "T_n", "K_v", "omega_0", "fit", "off"]
    again = knobs.drive_at(knobs.present)
    for name in ("K_p", "T_n", "K_v", "omega_0", "D", "T_sym"):
        assert getattr(again, name) == pytest.approx(getattr(drive, name), rel=2e-3), name
    assert again.filter_1.f == pytest.approx(drive.filter_1.f, rel=1e-3)
    assert (again.M_max, again.current, again.k_ffw) == (drive.M_max, drive.current, drive.k_ffw)


def test_dependent_parameters_follow() -> None:
    machine = load(Z).machine
    J = checked_modes(machine).J_tot("Z")
    knobs = Knobs(machine.axes["Z"].drive, machine.cycles, J)
    names = [knob.name for knob in knobs.all]
    x = knobs.present
    x[names.index("K_p")] = 0.7
    x[names.index("fit")] = knobs.all[names.index("fit")].place(1.0)
    x[names.index("off")] = knobs.all[names.index("off")].place(0.0)
    drive = knobs.drive_at(x)
    assert pytest.approx(J * drive.omega_0 / (2 * drive.K_p), rel=1e-3) == drive.D
    assert drive.T_sym == pytest.approx(loop_lag(drive, machine.cycles, J), rel=1e-3)
    shown = [float(f"{value:.4g}") for value in (drive.K_p, 1e3 * drive.T_n, drive.omega_0, drive.D)]
    assert [drive.K_p, 1e3 * drive.T_n, drive.omega_0, drive.D] == pytest.approx(shown, rel=1e-12)


def test_a_drive_without_parts_lacks_their_knobs() -> None:
    machine = load_machine(EMPS)
    knobs = Knobs(machine.axes["X"].drive, machine.cycles, checked_modes(machine).J_tot("X"))
    assert [knob.name for knob in knobs.all] == ["K_p", "K_v", "new.f", "new.depth", "new.D_den"]
    assert knobs.drive_at(knobs.present).filter_1.type == "off"


def test_axes_stay_equally_late() -> None:
    machine = load(Z).machine

    def lags(own: Machine) -> list[float]:
        return [axis_lag(each.drive) for each in own.axes.values()]

    sooner = match_lag(with_drives(machine, {"Z": {"T_sym": 2e-3}}), "Z", machine)
    assert lags(sooner) == pytest.approx([4.854e-3] * 3, abs=1e-9)
    assert sooner.axes["X"] is machine.axes["X"]
    later = match_lag(with_drives(machine, {"Z": {"T_sym": 6e-3}}), "Z", machine)
    assert lags(later) == pytest.approx([6e-3] * 3, abs=1e-6)
    apart = with_drives(machine, {"X": {"T_dyn": 1e-3}})
    waits = match_lag(with_drives(apart, {"Z": {"T_sym": 7e-3}}), "Z", apart)
    assert waits.axes["X"] is apart.axes["X"]  # was not matched before either


def test_changed_values_are_listed() -> None:
    machine = load(Z).machine
    other = with_drives(machine, {"Z": {"K_v": 100.0}, "X": {"T_dyn": 1e-3}})
    found = changed_values(machine, other)
    assert [(each.machine, each.axis, each.parameter, each.old, each.new, each.unit) for each in found] == [
        ("Test centre", "X", "drive.T_dyn", 0.0, 1e-3, "s"),
        ("Test centre", "Z", "drive.K_v", pytest.approx(66.6667, rel=1e-5), 100.0, "1/s"),
    ]
    assert found[1].setting == "machine.axes.Z.drive.K_v=100.0 1/s"
    again = load(Z, [each.setting for each in found]).machine
    assert not changed_values(other, again)


# --- the search ------------------------------------------------------------------------------------------------------


def test_the_search_finds_a_constrained_least() -> None:
    """A quadratic with a long valley, the half space beyond a plane forbidden: the projection by Lagrange."""
    H, c = np.diag([1.0, 30.0, 300.0, 5.0]), np.array([0.3, 0.6, 0.7, 0.2])
    a, b = np.full(4, 0.5), 1.1

    def rank(x: np.ndarray) -> tuple[float, float]:
        return max(0.0, b - float(a @ x)), float((x - c) @ H @ (x - c))

    inverse = np.linalg.inv(H)
    expected = c + inverse @ a * (b - a @ c) / (a @ inverse @ a)
    expected = np.clip(expected, 0, 1)
    _, (violation, value) = minimise_rank(rank, np.full(4, 0.7), step=0.2, evaluations=900, seed=1)
    assert violation == 0
    free = (expected - c) @ H @ (expected - c)
    assert value == pytest.approx(free, rel=0.1, abs=0.02)


def test_the_search_is_the_same_every_time() -> None:
    def rank(x: np.ndarray) -> tuple[float, float]:
        return 0.0, float(((x - 0.4) ** 2).sum())

    one, two = (minimise_rank(rank, np.full(3, 0.9), step=0.2, evaluations=100, seed=3) for _ in range(2))
    assert np.array_equal(one[0], two[0])


# --- motions ---------------------------------------------------------------------------------------------------------


def test_errors_are_those_of_the_shipped_scenarios(fmus: Path) -> None:
    """The stop and the circle whose figures the documentation has: 3.13 um overshoot, 7.90 um glitch."""
    scenario = load(Z)
    assert partner_of(scenario, "Z") == "X"
    program = DriveProgram.of(scenario, "Z", "X", [Stop(0.1, 5 / 60)], [Pair(0.015, 0.05)])
    errors = program.errors(scenario.machine, fmus=fmus)
    assert 1e6 * errors.overshoot[0] == pytest.approx(3.13, abs=0.05)
    assert 1e3 * errors.settling[0] == pytest.approx(99, abs=3)
    assert 1e6 * errors.peak[0] == pytest.approx(7.90, rel=0.05)


def test_one_axis_reverses_on_sines(fmus: Path) -> None:
    scenario = load(ONE)
    assert partner_of(scenario, "X") == ""
    machine = scenario.machine
    circles = circles_of(machine, "X", "", [(0.015, 0.05)])
    program = DriveProgram.of(scenario, "X", "", [], circles)
    errors = program.errors(machine, fmus=fmus)
    # without friction a sine stays a sine: what is left is 100 times smaller
    free = {"F_C": 1e-6, "F_S": 1e-6, "F_log": 0.0, "sigma_0": 1e-3, "sigma_1": 0.0, "sigma_2": 0.0}
    axis = machine.axes["X"]
    own = axis.model_copy(update={"friction": axis.friction.model_copy(update=free)})
    without = program.errors(machine.model_copy(update={"axes": {"X": own}}), fmus=fmus)
    assert errors.peak[0] > 1e-6
    assert without.peak[0] < 0.03 * errors.peak[0]


def test_motions_stay_within_limits() -> None:
    machine = load(SCENARIOS / "one_axis.yaml", ["machine.axes.X.travel=[290 mm, 312 mm]"]).machine
    stops = stops_of(machine, "X", [(0.1, 0.1), (0.02, 0.1), (0.1, 9.0)])
    at = 0.3
    for stop in stops:
        at += stop.distance
        assert 0.29 <= at <= 0.312
        assert stop.feed <= machine.axes["X"].max_speed
    (circle,) = circles_of(machine, "X", "", [(0.05, 5.0)])
    assert 2 * circle.radius < 0.022
    assert circle.acceleration <= machine.axes["X"].max_acceleration


@pytest.mark.parametrize("axis", ["X", "Y"])
def test_circles_are_slower_where_the_path_asks_too_much_of_an_axis(axis: str) -> None:
    """The path of this machine may accelerate at 2.25 m/s2, its axis Y at 1.8 m/s2."""
    scenario = load(Z, [f"machine={SCENARIOS / 'machines' / 'sinumerik_840d'}", f"motions={DWELL}", "evaluate=[]"])
    partner = partner_of(scenario, axis)
    for stops, circles in (SEARCHED_MOVES, CHOSEN, HELD_OUT_MOVES):
        wanted = circles_of(scenario.machine, axis, partner, circles)
        program = DriveProgram.of(scenario, axis, partner, stops_of(scenario.machine, axis, stops), wanted)
        for asked, planned in zip(wanted, program.circles, strict=True):
            assert planned.radius == asked.radius
            assert planned.feed <= asked.feed


# --- the whole -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tuned(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command on the default machine with a short search."""
    folder = tmp_path_factory.mktemp("tuned")
    command = ("tune", "drive", Z, "--axes", "Z", "--evaluations", "20", "--control", "sinumerik", "--out", "r")
    done = feedsim(*command, fmus=fmus, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "MD32200 POSCTRL_GAIN (K_v) 4 -> " in done.stdout
    return folder


def test_peaks_and_overshoot_fall_within_margins(tuned: Path) -> None:
    figures = {
        name: figure["value"] for name, figure in json.loads((tuned / "r/summary.json").read_text())["figures"].items()
    }
    assert figures["Z.peak_reduction"] > 55
    assert figures["Z.overshoot_reduction"] > 30
    assert figures["Z.gain_margin_after"] >= 8
    assert figures["Z.phase_margin_after"] >= 40
    summary = json.loads((tuned / "r/summary.json").read_text())
    assert (summary["kind"], summary["kept"]) == ("tune-drive", "")
    # With play the axis wanders within it, whatever drives it; that is not named as wrong.
    of_machine = [row for row in summary["motions"] if not row["case"].startswith("play")]
    assert all(row["after"] <= 1.05 * row["before"] + 5e-8 for row in of_machine)
    assert not [each for each in summary["findings"] if each["severity"] == "wrong"]


def test_values_that_are_typed_have_the_margins(tuned: Path) -> None:
    """The files, loaded, judged anew with modes 10 % lower and higher."""
    changes = yaml.safe_load((tuned / "r/settings.yaml").read_text())["set"]
    by_settings = load(Z, [f"{key}={value}" for key, value in changes.items()]).machine
    by_file = load(Z, [f"machine.axes.Z.drive={tuned / 'r/drive_Z.yaml'}"]).machine
    assert by_settings.axes["Z"].drive == by_file.axes["Z"].drive
    rows = list(csv.DictReader((tuned / "r/sheet.csv").open(newline="")))
    assert {f"machine.axes.{row['axis']}.drive.{row['parameter']}" for row in rows} == {*changes}
    gain = next(row for row in rows if row["number"] == "p1460")
    assert float(gain["new"]) == pytest.approx(by_file.axes["Z"].drive.K_p, rel=1e-5)
    modes = checked_modes(by_file)
    for factor in (0.9, 1.0, 1.1):
        scaled = Modes(modes.file, factor * modes.frequency, modes.damping, modes.ports)
        own = [loop for loop in judge(by_file, scaled) if loop.axis == "Z"]
        assert not any(loop.growing for loop in own)
        assert min(20 * math.log10(loop.gain_margin) for loop in own) >= 8
        assert min(loop.phase_margin for loop in own) >= 40


@pytest.mark.extensive
def test_a_margin_that_nothing_has_keeps_the_drive(fmus: Path) -> None:
    found = tune_drive(load(ONE), "X", Limits(300.0, 80.0, 1e-5), fmus=fmus, progress=lambda *_: None, evaluations=20)
    assert found.evaluations[1] == 0
    assert re.fullmatch(
        rf"none of {found.evaluations[0]} candidates has 300 dB and 80 deg; the nearest has [0-9.]+ dB and [0-9.]+ "
        "deg; ask for less or raise evaluations", found.kept,
    )  # fmt: skip
    assert not found.changes
    assert found.machine is load(ONE).machine or not changed_values(load(ONE).machine, found.machine)


@pytest.mark.extensive
def test_a_result_follows_another_in_its_folder(fmus: Path, tmp_path: Path) -> None:
    """The drive changes, stays, stays: each time the files are of the present result, and what goes is named."""
    command = ("tune", "drive", ONE, "--axes", "X", "--evaluations", "10", "--out", "r")
    assert feedsim(*command, fmus=fmus, cwd=tmp_path).returncode == 0
    folder = tmp_path / "r"
    assert yaml.safe_load((folder / "settings.yaml").read_text())["set"]
    page = (folder / "report.html").read_text()
    assert "--set r/settings.yaml" in re.sub(r"<[^>]+>", "", page)
    assert "Motions not used for tuning" in page
    assert_numbers_agree(folder)
    again = (*command, "--gain-margin", "300")
    done = feedsim(*again, fmus=fmus, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "r: its result is of other parameters (axes=X, gain_margin=8 dB, phase_margin=40 deg," in done.stderr
    assert re.search(
        r"X: the gain margin of the present drive is [0-9.]+ dB; 300 dB are required \(--gain-margin\). [A-Z]",
        done.stderr,
    )
    assert "the phase margin of the present drive" not in done.stderr
    assert yaml.safe_load((folder / "settings.yaml").read_text())["set"] == {}
    present = load(ONE).machine.axes["X"].drive
    assert load(ONE, [f"machine.axes.X.drive={folder / 'drive_X.yaml'}"]).machine.axes["X"].drive == present
    page = (folder / "report.html").read_text()
    assert "Motions not used for tuning," not in page  # nothing has changed: no table of before and after
    assert "less peak at reversals" not in page
    assert "X.peak_before" in page
    assert "X.peak_reduction" not in page
    done = feedsim(*again, "--set", "machine.axes.X.drive.k_ffw=1", fmus=fmus, cwd=tmp_path)
    assert (done.returncode, "of other parameters (axes=X, gain_margin=300 dB," in done.stderr) == (0, True)
    done = feedsim(*again, "--set", "machine.axes.X.drive.k_ffw=1", fmus=fmus, cwd=tmp_path)
    assert (done.returncode, "of other parameters" in done.stderr) == (0, False), done.stderr
    done = feedsim(*command, "--at", "foo", fmus=fmus, cwd=tmp_path)
    assert (done.returncode, "structure" in done.stderr or "--at foo" in done.stderr) == (2, True)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--axes", "A"), "--axes A: no axis 'A'; there is X, Y, Z"),
        (("--axes", "Z", "--gain-margin", "-1"), "--gain-margin -1: more than zero is needed"),
        (("--axes", "Z", "--gain-margin", "much"), "--gain-margin much: a number of dB is needed"),
        (("--axes", "Z", "--phase-margin", "3 mm"), "--phase-margin"),
        (("--axes", "Z", "--evaluations", "3"), "--evaluations 3: at least 10 are needed"),
        (("--axes", "Z", "--at", "Z=9m"), "--at Z=9m: Z is outside of its travel"),
        (("--axes", "Z", "--at", "Q=1mm"), "--at Q=1mm: AXIS=POSITION is needed"),
        (("--axes", "Z", "--at", "Z=5deg"), "--at Z=5deg: '5deg' is an angle"),
        (("--axes", "Z", "--at", "X=1mm,Z=200mm,Z=300mm"), "--at X=1mm,Z=200mm,Z=300mm: Z is given twice"),
    ],
)
def test_bad_input(words: tuple[str, ...], message: str, fmus: Path, tmp_path: Path) -> None:
    done = feedsim("tune", "drive", Z, *words, "--out", "r", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert not (tmp_path / "r").exists()


def test_without_modes_the_gain_at_resonances_stays() -> None:
    """The gain K_p |1 + 1/(j omega T_n)| above the crossover: no candidate has 1 dB more than the present drive."""
    machine = load(Z).machine
    J = checked_modes(machine).J_tot("Z")
    present = machine.axes["Z"].drive.model_copy(update={"T_n": 0.02})
    knobs = Knobs(present, machine.cycles, J, elastic=False)
    assert not [knob.name for knob in knobs.all if knob.name.startswith(("filter", "new"))]
    random = np.random.default_rng(3)
    omega = np.geomspace(present.K_p / J, 1e4, 50)

    def gain(drive: Drive) -> np.ndarray:
        return drive.K_p * np.abs(1 + 1 / (1j * omega * drive.T_n))  # type: ignore[operator]

    drives = [knobs.drive_at(random.uniform(size=len(knobs.all))) for _ in range(200)]
    rise = np.array([20 * np.log10(gain(each) / gain(present)) for each in drives])
    assert rise.max() < 1.0 + 1e-3  # values are rounded as they are typed
    assert min(each.T_n for each in drives) < 0.9 * present.T_n  # type: ignore[type-var]
    assert all(getattr(each, name) == getattr(present, name) for each in drives for name in ("filter_1", "filter_2"))
