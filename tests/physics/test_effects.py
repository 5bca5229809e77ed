"""What real machines have besides, switched on in the whole machine: each shows what its closed form says."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from plant_unit import write_modes

from feedsim import scenario
from feedsim.analysis.compensation import compensate
from feedsim.analysis.evaluate import evaluate
from feedsim.foundation.errors import InputError
from feedsim.simulation import cosim
from feedsim.simulation.judge import JudgedRun, judge_run
from feedsim.simulation.nc import plan
from fmi_helpers import Archive

Array = NDArray[np.float64]
SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
Z = "machine.axes.Z.drive"
PITCH, AXES = 0.020, ("X", "Z")
T_C = 125e-6

Driven = Callable[..., JudgedRun]


@pytest.fixture(scope="module")
def moved(fmus: Path) -> Driven:
    """Z over 100 mm at 5000 mm/min, recorded at every control cycle."""

    @cache
    def run(*overrides: str) -> JudgedRun:
        path = SCENARIOS / "z_positioning.yaml"
        return judge_run(cosim.run(scenario.load(path, ["recording.interval=125 us", *overrides]), fmus=fmus))

    return run


def order_of(values: Array, angle: Array, order: float) -> complex:
    """Complex amplitude of exp(i order angle) in values, by least squares beside a straight line; angle [rad]."""
    columns = [np.ones_like(angle), angle, np.sin(order * angle), np.cos(order * angle)]
    a, b = np.linalg.lstsq(np.stack(columns, axis=1), values, rcond=None)[0][2:]
    return complex(a, b)


def turned(run: JudgedRun, axis: str) -> Array:
    """Angle of the motor since the start [rad], speed linear between the rows."""
    n = run.trace[f"{axis}.n_a"]
    return np.concatenate([[0.0], np.cumsum(np.diff(run.trace.time) * (n[1:] + n[:-1]) / 2)])


def test_cogging_has_its_order_and_amplitude(moved: Driven) -> None:
    """Torque less K_t i_q: the motor's own share is gone, the rest is A sin(k phi + psi) over the motor's angle."""
    run = moved(f"{Z}.cogging_1.order=7", f"{Z}.cogging_1.amplitude=0.4 N.m", f"{Z}.cogging_1.phase=30 deg")
    cruise = (run.trace.time > 0.5) & (run.trace.time < 1.1)
    rest = run.trace["Z.M_a"] - run.scenario.machine.axes["Z"].drive.K_t * run.trace["Z.i_q"]
    found = order_of(rest[cruise], turned(run, "Z")[cruise], 7)
    # the angle ahead is extrapolated: off by a cycle's change of slope, some 1e-6 of a turn
    assert abs(found) == pytest.approx(0.4, rel=1e-6)
    assert np.angle(found, deg=True) == pytest.approx(30, abs=1e-4)
    left = rest - 0.4 * np.sin(7 * turned(run, "Z") + np.pi / 6)
    assert np.max(np.abs(left[cruise])) < 1e-5  # and it is nothing else
    # and it moves the axis: seven waves a turn in the speed, none without it
    speed = order_of(run.trace["Z.n_a"][cruise], turned(run, "Z")[cruise], 7)
    assert abs(speed) > 20 * abs(order_of(moved().trace["Z.n_a"][cruise], turned(moved(), "Z")[cruise], 7))


def test_ripple_goes_with_the_torque(moved: Driven) -> None:
    run = moved(f"{Z}.ripple_2.order=4", f"{Z}.ripple_2.amplitude=5 %")
    motor = run.scenario.machine.axes["Z"].drive.K_t * run.trace["Z.i_q"]
    angle = turned(run, "Z")
    # phi at the end of a cycle as the last slope foretells it: 1e-4 of the torque while the axis jerks
    np.testing.assert_allclose(run.trace["Z.M_a"], motor * (1 + 0.05 * np.sin(4 * angle)), rtol=0, atol=2e-3)


def test_waves_too_fast_for_the_control_are_told(moved: Driven) -> None:
    run = moved(f"{Z}.cogging_1.order=400", f"{Z}.cogging_1.amplitude=0.1 N.m")
    (told,) = (finding for finding in run.warnings if finding.code == "unit-warns")
    assert "fifth of the sampling rate" in told.text
    assert "order 400" in told.text
    assert not any(finding.code == "unit-warns" for finding in moved(f"{Z}.cogging_1.amplitude=0.1 N.m").warnings)


def test_pitch_error_of_a_micrometre_is_one(moved: Driven) -> None:
    """The loop holds what it measures, so the slide has the error with the sign reversed."""
    run = moved(f"{Z}.periodic_error_3.amplitude=1 um", f"{Z}.measuring.linear=30 um/m")
    x_a, x_m = run.trace["Z.x_a"], run.trace["Z.x_m"]
    start = x_a[0]
    error = 30e-6 * (x_a - start) + 1e-6 * (np.sin(2 * np.pi * x_a / PITCH) - np.sin(2 * np.pi * start / PITCH))
    np.testing.assert_allclose(x_m, x_a + error, rtol=0, atol=1e-15)  # of the same instant
    at_rest = run.trace.time > 2.2
    travelled = 0.1 * (1 if x_a[-1] > start else -1)
    assert x_a[at_rest].mean() - start == pytest.approx(travelled * (1 - 30e-6), abs=1e-8)


def test_indirect_measuring_does_not_see_the_wind_up(moved: Driven) -> None:
    """The measured position is the motor's angle; the scale differs by what the structure gives way."""
    run = moved(f"{Z}.measuring.indirect=true")
    lead = run.scenario.machine.axes["Z"].I_P
    angle = turned(run, "Z")
    np.testing.assert_allclose(run.trace["Z.x_m"], run.trace["Z.x_a"][0] + lead * angle, rtol=0, atol=1e-13)
    apart = run.trace["Z.x_a"] - run.trace["Z.x_m"]
    assert 1e-6 < np.max(np.abs(apart)) < 2e-3
    assert run.trace["Z.x_m"][-1] == pytest.approx(run.trace["Z.x_s"][-1], abs=1e-7)


def test_noise_is_that_of_its_seed(moved: Driven) -> None:
    noisy = [f"{Z}.measuring.noise=50 nm", f"{Z}.measuring.seed=3"]
    run, other = moved(*noisy), moved(noisy[0], f"{Z}.measuring.seed=4")
    noise = run.trace["Z.x_m"] - run.trace["Z.x_a"]
    assert np.std(noise) == pytest.approx(50e-9, rel=0.03)  # of 20000 samples: 0.5 %
    assert np.array_equal(run.trace["Z.x_m"], moved(*noisy, "coupling.units=one").trace["Z.x_m"])
    assert abs(np.corrcoef(noise, other.trace["Z.x_m"] - other.trace["Z.x_a"])[0, 1]) < 0.05


def test_resolution_rounds_what_is_measured(moved: Driven) -> None:
    x_m = moved(f"{Z}.measuring.resolution=0.5 um").trace["Z.x_m"][1:]
    np.testing.assert_allclose(x_m / 0.5e-6, np.round(x_m / 0.5e-6), rtol=0, atol=1e-7)


def test_backlash_compensation_moves_the_slide_by_half_of_it(moved: Driven) -> None:
    """The slide ends b/2 further in the direction of its last motion than it does without."""
    run = moved(f"{Z}.backlash_compensation.value=8 um", f"{Z}.backlash_compensation.ramp=20 ms")
    side = np.sign(run.trace["Z.x_s"][-1] - run.trace["Z.x_s"][0])
    apart = run.trace["Z.x_a"][-1] - moved().trace["Z.x_a"][-1]
    assert apart == pytest.approx(side * 4e-6, abs=5e-9)  # the creep that friction leaves 1 s after the end


def test_leadscrew_compensation_takes_off_an_error_of_the_scale(moved: Driven) -> None:
    """A scale that is 2 um too short at the target, and the table that says so."""
    error = [f"{Z}.measuring_table.first=0 mm", f"{Z}.measuring_table.spacing=50 mm"]
    error += [f"{Z}.measuring_table.e_{i}={2 * i} um" for i in range(11)]
    table = [each.replace("measuring_table", "leadscrew_compensation") for each in error]
    bare, without, corrected = moved(), moved(*error), moved(*error, *table)
    goal = bare.trace["Z.x_a"][-1]
    assert abs(without.trace["Z.x_a"][-1] - goal) == pytest.approx(4e-6, abs=5e-9)
    # the table is absolute, the scale's error counts from the start at 100 mm, where the table says 4 um
    assert corrected.trace["Z.x_a"][-1] - goal == pytest.approx(4e-6, abs=5e-9)


@pytest.mark.parametrize(
    "changes",
    [
        (f"{Z}.cogging_1.amplitude=0.4 N.m", f"{Z}.ripple_1.amplitude=2 %"),
        (
            f"{Z}.measuring.indirect=true",
            f"{Z}.periodic_error_1.amplitude=0.1 um",
            f"{Z}.encoder.eccentricity=0.1 mrad",
        ),
        (f"{Z}.backlash_compensation.value=8 um",),
    ],
)
def test_one_unit_gives_the_same_bits(moved: Driven, changes: tuple[str, ...]) -> None:
    apart, one = moved(*changes), moved(*changes, "coupling.units=one")
    assert apart.trace.names == one.trace.names
    for name in apart.trace.names:
        assert np.array_equal(apart.trace[name], one.trace[name]), name


@pytest.fixture(scope="module")
def circle(fmus: Path) -> Driven:
    """A circle of X and Z, recorded at every control cycle."""

    @cache
    def run(*overrides: str) -> JudgedRun:
        path = SCENARIOS / "xz_circle.yaml"
        return judge_run(cosim.run(scenario.load(path, ["recording.interval=125 us", *overrides]), fmus=fmus))

    return run


def ways(run: JudgedRun) -> dict[str, Array]:
    """Ways of the slides since the start [m]."""
    return {axis: run.trace[f"{axis}.x_a"] - run.trace[f"{axis}.x_a"][0] for axis in ("X", "Y", "Z")}


def test_play_is_lost_where_the_motor_measures(circle: Driven) -> None:
    """Between motor and slide stands half the play, before and behind a reversal on either side: b from one to the
    other. All forces and the motors are those of the machine without."""
    play = [f"machine.axes.{axis}.play=8 um" for axis in AXES]
    indirect = [f"machine.axes.{axis}.drive.measuring.indirect=true" for axis in AXES]
    without, run = circle(*indirect), circle(*indirect, *play)
    for axis in AXES:
        assert np.array_equal(run.trace[f"{axis}.M_a"], without.trace[f"{axis}.M_a"])
        apart = run.trace[f"{axis}.x_a"] - without.trace[f"{axis}.x_a"]
        steady = (run.trace.time > 3) & (np.abs(run.trace[f"{axis}.n_a"]) > 8)  # rad/s: away from the reversals
        expected = -4e-6 * np.sign(run.trace[f"{axis}.n_a"][steady])
        # the operator takes off b/2 to the last bit of 1 m
        np.testing.assert_allclose(apart[steady], expected, rtol=0, atol=3e-16)
        assert np.max(np.abs(apart)) <= 4e-6 + 3e-16
    # the tool goes with the slides
    tool = run.trace["tool.x_Z"] - without.trace["tool.x_Z"]
    np.testing.assert_allclose(tool, run.trace["Z.x_a"] - without.trace["Z.x_a"], rtol=0, atol=3e-16)


def test_hysteresis_is_wound_up_behind_a_reversal(circle: Driven) -> None:
    """h from one side to the other, over 2 w of way; forces and motors are those of the machine without."""
    settings = [f"machine.axes.{axis}.hysteresis.{each}" for axis in AXES for each in ("value=6 um", "way=100 um")]
    indirect = [f"machine.axes.{axis}.drive.measuring.indirect=true" for axis in AXES]
    without, run = circle(*indirect), circle(*indirect, *settings)
    for axis in AXES:
        assert np.array_equal(run.trace[f"{axis}.M_a"], without.trace[f"{axis}.M_a"])
        x, apart = without.trace[f"{axis}.x_a"], run.trace[f"{axis}.x_a"] - without.trace[f"{axis}.x_a"]
        wound = 0.0
        for k in range(1, len(x)):  # the operator, written down once more
            wound = min(max(wound + x[k] - x[k - 1], -100e-6), 100e-6)
            assert abs(apart[k] + 3e-6 * wound / 100e-6) < 1e-12  # sums of 25000 roundings
        assert np.ptp(apart) == pytest.approx(6e-6, abs=1e-12)


def test_angles_act_by_arms_at_the_tool(circle: Driven) -> None:
    settings = {"E_BX_first": "40e-6 1/m", "E_CX_second": "2e-4 1/m^2", "arm_Z": "200 mm", "arm_Y": "-0.1 m"}
    bare, run = circle(), circle(*(f"machine.geometry.{name}={value}" for name, value in settings.items()))
    s = ways(run)["X"]
    b, c = 40e-6 * s, 2e-4 * s**2
    for direction, error in {"X": b * 0.2 - c * -0.1, "Y": 0.0 * s, "Z": 0.0 * s}.items():
        added = run.trace[f"tool.x_{direction}"] - bare.trace[f"tool.x_{direction}"]
        np.testing.assert_allclose(added, error, rtol=0, atol=3e-16)


def test_geometry_acts_at_the_tool_alone(circle: Driven) -> None:
    settings = {"squareness_XZ": "50 um/m", "E_ZZ": "20 um/m", "E_ZX_second": "2e-3 1/m", "E_YX_third": "0.1 1/m^2"}
    bare, run = circle(), circle(*(f"machine.geometry.{name}={value}" for name, value in settings.items()))
    for name in ("X.x_a", "Z.x_a", "X.M_a", "Z.M_a", "X.M_fr"):
        assert np.array_equal(run.trace[name], bare.trace[name]), name
    s = ways(run)
    expected = {"X": 50e-6 * s["Z"], "Y": 0.1 * s["X"] ** 3, "Z": 20e-6 * s["Z"] + 2e-3 * s["X"] ** 2}
    for direction, error in expected.items():
        for point in ("tool", "tcp"):
            added = run.trace[f"{point}.x_{direction}"] - bare.trace[f"{point}.x_{direction}"]
            np.testing.assert_allclose(added, error, rtol=0, atol=3e-16)  # the last bit of 1 m


def test_one_unit_has_play_and_geometry(circle: Driven) -> None:
    changes = ("machine.axes.X.play=8 um", "machine.geometry.squareness_XZ=50 um/m", "machine.geometry.E_XX=1e-5")
    apart, one = circle(*changes), circle(*changes, "coupling.units=one")
    for name in apart.trace.names:
        assert np.array_equal(apart.trace[name], one.trace[name]), name


def guided(share: str) -> list[str]:
    return [f"machine.axes.{axis}.guide.share={share}" for axis in AXES]


def test_guide_friction_at_constant_speed_is_force_times_lead(fmus: Path, tmp_path: Path) -> None:
    """A motor torque M alone, until the speed v is constant: M = F I_P with F = F_C + sigma_2 v, to rounding.

    Of rigid axes, as the digits of the machine's table let other axes drift; the viscous part is strong, so that the
    speed has settled after a second."""
    torque, lead = 8.0, PITCH / (2 * np.pi)
    rigid = 8.0 * np.eye(3)
    rows = [[i, 0, 0, *rigid[i], *(lead * rigid[i]), *(lead * rigid[i])] for i in range(3)]
    table = write_modes(tmp_path / "modes.csv", rows)
    law = {"F_C": 900.0, "F_S": 1100.0, "sigma_2": 4e4, "sigma_0": 3e7, "sigma_1": 8e4, "v_s": 1e-4}
    archive = Archive.unpack(fmus / "plant.fmu", tmp_path / "plant")
    own = {f"Z.guide.{name}": value for name, value in law.items()} | {"modes_file": str(table)}
    with archive.instance(own, inputs={"Z.M_a": torque}) as plant:
        for _ in range(16000):
            plant.step(T_C)
        n, F, work = (plant.get(f"Z.{name}") for name in ("n_a", "guide.F_fr", "guide.E_fr"))
        plant.step(T_C)
        assert plant.get("Z.guide.E_fr") - work == pytest.approx(F * n * lead * T_C, rel=1e-6)  # of a long sum
    assert F * lead == pytest.approx(torque, rel=1e-9)
    assert pytest.approx(900 + 4e4 * n * lead, rel=1e-9) == F


def test_a_share_at_the_guide_leaves_the_sum(moved: Driven) -> None:
    """Moved from motor to guide, friction is what it was wherever motor and slide have the same speed."""
    bare, shared = moved(), moved("machine.axes.Z.guide.share=60 %")
    assert "Z.guide.F_fr" not in bare.trace.names
    cruise = (bare.trace.time > 0.9) & (bare.trace.time < 1.1)
    lead = bare.scenario.machine.axes["Z"].I_P
    whole = bare.trace["Z.M_fr"][cruise]
    # the controllers are still settling: the speeds of the two runs differ by 1e-8 of it, 0.1 % of which is seen here
    np.testing.assert_allclose(shared.trace["Z.M_fr"][cruise], 0.4 * whole, rtol=1e-6)
    np.testing.assert_allclose(shared.trace["Z.guide.F_fr"][cruise] * lead, 0.6 * whole, rtol=1e-6)
    np.testing.assert_allclose(shared.trace["Z.M_a"][cruise], bare.trace["Z.M_a"][cruise], rtol=3e-6)


def test_all_friction_at_the_guide_is_more_at_scale_and_tool(circle: Driven) -> None:
    """What another code gave for the reversals of X on this circle: +20 % at the scale, +36 % at the tool."""
    bare, run = (evaluate(each) for each in (circle(), circle(*guided("100 %"))))
    for point, more in (("", 1.20), ("tool.", 1.36)):
        assert run[f"XZ.{point}glitch_X"].value / bare[f"XZ.{point}glitch_X"].value == pytest.approx(more, abs=0.04)


# X and Z: largest peaks [um] that the model of all friction at the motor leaves, by another code
@pytest.mark.parametrize(("share", "left"), [("30 %", (0.58, 0.70)), ("60 %", (1.11, 1.28))])
def test_compensation_leaves_what_is_at_the_guide(share: str, left: tuple[float, float], fmus: Path) -> None:
    described = scenario.load(SCENARIOS / "xz_circle.yaml", guided(share))
    done = compensate(described, plan(described), table=False, fmus=fmus)
    peaks = [done.figures[f"after.glitch_{axis}"].value for axis in AXES]
    assert peaks == pytest.approx(left, rel=0.10)


def test_one_unit_has_friction_at_the_guide(circle: Driven) -> None:
    changes = (
        *guided("30 %"), "machine.axes.X.guide.place_first=790 mm", "machine.axes.X.guide.place_spacing=10 mm",
        "machine.axes.X.guide.place_1=40 %", "machine.axes.Z.guide.warm_time=10 s",
        "machine.axes.Z.hysteresis.value=3 um",
    )  # fmt: skip
    apart, one = circle(*changes), circle(*changes, "coupling.units=one")
    assert "X.guide.F_fr" in apart.trace.names
    for name in apart.trace.names:
        assert np.array_equal(apart.trace[name], one.trace[name]), name


def test_effects_go_to_other_processes() -> None:
    settings = [
        "machine.axes.X.hysteresis.value=3 um", "machine.axes.X.guide.share=30 %",
        "machine.geometry.squareness_XZ=1e-5",
        "machine.axes.X.drive.cogging_1.amplitude=0.1 N.m",
    ]  # fmt: skip
    described = scenario.load(SCENARIOS / "xz_circle.yaml", settings)
    assert pickle.loads(pickle.dumps(described)) == described


def test_faults_of_guides_are_refused() -> None:
    path = SCENARIOS / "z_positioning.yaml"
    with pytest.raises(InputError, match="share goes together with no parameter of its own; sigma_2"):
        scenario.load(path, ["machine.axes.Z.guide.share=30 %", "machine.axes.Z.guide.sigma_2=100 N.s/m"])
    with pytest.raises(InputError, match="smaller than F_C"):
        scenario.load(path, ["machine.axes.Z.guide.F_C=200 N", "machine.axes.Z.guide.F_S=100 N"])
