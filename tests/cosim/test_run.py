"""The master: reproducible runs, failing units, selection of what is recorded, the energy residual of the coupling."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import numpy as np
import pytest

from feedsim import scenario
from feedsim.foundation.errors import Finding, InputError, SimulationError
from feedsim.scenario.model import SCHEMES
from feedsim.simulation import cosim, judge, nc
from feedsim.simulation.cosim import unpacked
from feedsim.simulation.cosim.operations import Interpreter, do_step
from feedsim.simulation.cosim.system import System
from feedsim.simulation.cosim.unpacked import STORE
from feedsim.simulation.judge import JudgedRun, judge_run

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
# A short reversal of all axes at once: every unit works, every branch of the friction is passed.
SHORT = """
name: short reversal
machine: {machine}
motions:
  - {{kind: move, by: {{X: 2 mm, Y: 1 mm, Z: -1 mm}}, feed: 3000 mm/min}}
  - {{kind: move, by: {{X: -2 mm, Y: -1 mm, Z: 1 mm}}, feed: 3000 mm/min}}
recording: {{interval: 125 us}}
"""


@pytest.fixture
def short(tmp_path: Path) -> Path:
    file = tmp_path / "short.yaml"
    file.write_text(SHORT.format(machine=SCENARIOS / "machines" / "test_centre"))
    return file


def run(file: Path, fmus: Path, *overrides: str) -> JudgedRun:
    return judge_run(cosim.run(scenario.load(file, list(overrides)), fmus=fmus))


def test_two_runs_are_bit_identical(short: Path, fmus: Path) -> None:
    first, second = run(short, fmus), run(short, fmus)
    assert first.trace.columns.keys() == second.trace.columns.keys()
    for name in first.trace.columns:
        np.testing.assert_array_equal(first.trace[name], second.trace[name], err_msg=name)


def test_units_that_stay_open_serve_runs_as_new_ones_do(short: Path, fmus: Path) -> None:
    """Other values, effects, loads, poses, cycles, laws and one unit for all, and the first machine again."""
    changes: list[list[str]] = [
        [],
        ["machine.axes.Z.drive.K_v=3 (m/min)/mm", "machine.axes.X.friction.W=0.001 rad"],  # of which a unit warns
        ["machine.axes.X.guide.share=60 %", "machine.axes.Y.constant_load=2 N.m", "machine.pose.X=300 mm"],
        ["machine.axes.X.transmission={stiffness: 200 N/um, damping: 3e4 N.s/m, play: 8 um, inertia: 0.004 kg.m^2}"],
        ["machine.axes.Z.drive.M_max=3 N.m", "machine.cycles.position=2 ms"],
        ["machine.axes.Z.friction={law: gms, sigma_0: 300 N.m/rad, sigma_1: 0.8 N.m.s/rad, sigma_2: 0.006 N.m.s/rad, "
         "F_C: 1.6 N.m, F_S: 2 N.m, v_s: 0.6 rad/s}"],
        ["coupling.units=one"],
        [],
    ]  # fmt: skip
    with cosim.OpenUnits() as units:
        for k, overrides in enumerate(changes):
            loaded = scenario.load(short, overrides)
            fresh, again = (judge_run(cosim.run(loaded, fmus=fmus, units=one)) for one in (None, units))
            assert again.trace.columns.keys() == fresh.trace.columns.keys()
            for name in fresh.trace.columns:
                np.testing.assert_array_equal(again.trace[name], fresh.trace[name], err_msg=f"{k}: {name}")
            assert again.warnings == fresh.warnings
            assert again.coupling == fresh.coupling
            assert again.units == fresh.units
        with pytest.raises(InputError, match="refuses its parameters"):
            cosim.run(with_filter_beyond_nyquist(short), fmus=fmus, units=units)
        assert np.array_equal(cosim.run(loaded, fmus=fmus, units=units).trace["Z.x_a"], fresh.trace["Z.x_a"])


def test_every_row_is_on_the_recording_grid(short: Path, fmus: Path) -> None:
    fine = run(short, fmus, "recording.interval=125 us").trace
    coarse = run(short, fmus, "recording.interval=1 ms").trace
    np.testing.assert_array_equal(coarse.time, fine.time[::8])
    np.testing.assert_array_equal(coarse["Z.x_a"], fine["Z.x_a"][::8])


def test_recording_can_be_narrowed(short: Path, fmus: Path) -> None:
    trace = run(short, fmus, "recording.variables=['Z.x_?', 'tool.*']").trace
    assert list(trace.columns) == ["Z.x_s", "Z.x_a", "Z.x_e", "tool.x_X", "tool.x_Y", "tool.x_Z"]


def test_pattern_that_matches_nothing_is_an_error(short: Path, fmus: Path) -> None:
    with pytest.raises(InputError, match=r"recording\.variables: no column matches 'Q\.\*'"):
        run(short, fmus, "recording.variables=['Q.*']")


def test_axis_position_starts_at_the_pose(short: Path, fmus: Path) -> None:
    trace = run(short, fmus).trace
    assert [trace[f"{axis}.x_a"][0] for axis in "XYZ"] == [0.8, 0.327, 0.1]
    assert [trace[f"tcp.x_{axis}"][0] for axis in "XYZ"] == [0.8, 0.327, 0.1]


def test_weight_on_an_axis_is_carried_by_the_drive(short: Path, fmus: Path) -> None:
    """At rest the motor torque settles at the constant load plus what friction still holds."""
    trace = run(short, fmus, "machine.axes.Y.constant_load=3 N.m", "motions=[{kind: dwell, duration: 3 s}]").trace
    # The slowest mode that Y excites (33 Hz, 2 %) has decayed by exp(-0.02 * 205 * 3) = 5e-6 of the 3 N.m step.
    assert trace["Y.M_a"][-1] == pytest.approx(3.0 + trace["Y.M_fr"][-1], abs=1e-3)
    assert abs(trace["Y.M_fr"][-1]) > 0.05, "the sag must have loaded the friction, or this test shows nothing"


@pytest.mark.parametrize("scheme", sorted(SCHEMES))
def test_every_scheme_runs_and_agrees_roughly(scheme: str, short: Path, fmus: Path) -> None:
    reference = run(short, fmus, "coupling.substeps=4").trace["X.x_a"]
    error = np.abs(run(short, fmus, f"coupling.scheme={scheme}").trace["X.x_a"] - reference).max()
    # This move accelerates harder than the circle, where holding M_a costs 0.26 um and the other schemes below 0.1 um.
    assert error < (1.1e-6 if scheme == "parallel" else 0.2e-6)
    assert scheme == "extrapolated" or error > 1e-10, "a scheme that changes nothing is not the scheme it claims to be"


def test_energy_residual_shrinks_with_the_step(short: Path, fmus: Path) -> None:
    """The residual of a second-order exchange falls at least with the square of the step."""
    coarse, fine = run(short, fmus).coupling, run(short, fmus, "coupling.substeps=4").coupling
    assert fine["X.residual_peak"] < coarse["X.residual_peak"] / 10
    assert coarse["X.residual_peak"] < 1e-3 * coarse["X.friction_work"]


def test_broken_modes_are_refused_before_the_run(tmp_path: Path, short: Path, fmus: Path) -> None:
    modes = tmp_path / "broken.csv"
    modes.write_text("mode,frequency [Hz]\n0,0\n")
    with pytest.raises(InputError, match=r"broken\.csv:1: column 'damping ratio \[1\]' is missing"):
        run(short, fmus, f"machine.modes={modes}")


def with_filter_beyond_nyquist(file: Path) -> scenario.Scenario:
    """Past the checks of the scenario, as a caller from Python can."""
    loaded = scenario.load(file)
    drive = loaded.machine.axes["Z"].drive
    object.__setattr__(drive.filter_1, "f", 5000.0)
    return loaded


def test_unit_that_refuses_its_parameters_is_named(short: Path, fmus: Path) -> None:
    with pytest.raises(InputError, match=r"unit controller_Z refuses its parameters: filter_1\.f = 5000 Hz"):
        cosim.run(with_filter_beyond_nyquist(short), fmus=fmus)
    with pytest.raises(InputError, match=r"unit controller_Z refuses its parameters: filter_1\.f = 5000 Hz"):
        judge.check(with_filter_beyond_nyquist(short), nc.plan(scenario.load(short)), fmus=fmus)


def test_failed_step_names_unit_time_and_reason(short: Path, fmus: Path) -> None:
    # A torque beyond the range of numbers, reached once the axis moves.
    huge = [f"machine.axes.Z.drive.{entry}" for entry in ("K_p=1e300 N.m.s/rad", "M_max=1e308 N.m", "u_max=1e308 V")]
    with pytest.raises(
        SimulationError, match=r"unit [a-zA-Z_]+, t = [0-9.e-]+ s: step of 0\.000125 s failed: .* not finite"
    ):
        run(short, fmus, *huge, "machine.axes.Z.drive.ideal_current_loop=true")


def test_missing_archives_say_how_to_get_them(tmp_path: Path, short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"plant\.fmu: no such file; FEEDSIM_FMUS or --fmus names their folder"):
        run(short, tmp_path)
    monkeypatch.setattr(unpacked, "shipped", lambda name: tmp_path)
    with pytest.raises(InputError, match=r"plant\.fmu: no such file; `make fmus` builds the archives"):
        run(short, tmp_path)


def test_unstable_exchange_is_told(short: Path, fmus: Path) -> None:
    """Beyond 2 J_inf / h explicit exchange chatters without overflow: two warnings, one by rule, one by measurement."""
    result = run(short, fmus, "machine.axes.Z.friction.sigma_1=100 N.m.s/rad")
    assert result.coupling["Z.residual_peak"] > 1e-2 * abs(result.coupling["Z.friction_work"])
    of_z = {finding.code for finding in result.warnings if finding.place == "Z"}
    assert of_z >= {"exchange-unstable", "exchange-loses-energy"}
    assert not run(short, fmus).warnings


def test_stable_with_smaller_steps(short: Path, fmus: Path) -> None:
    """What the warning advises helps."""
    override = "machine.axes.Z.friction.sigma_1=50 N.m.s/rad"
    remedies = {finding.remedy for finding in run(short, fmus, override).warnings}
    assert remedies == {"coupling.substeps=2"}
    assert not run(short, fmus, override, *remedies).warnings


def test_active_limit_and_unit_warning_are_told(short: Path, fmus: Path) -> None:
    result = run(short, fmus, "machine.axes.Z.drive.M_max=3 N.m", "machine.axes.X.friction.W=0.001 rad")
    found = {finding.code: finding for finding in result.warnings}
    assert found["torque-clipped"].place == "Z"
    assert re.fullmatch(r"axis Z: torque limited in [0-9.]+ % of the recorded instants", found["torque-clipped"].text)
    assert found["unit-warns"].place == "friction_X"
    assert found["unit-warns"].text.startswith("friction_X: parameter 'W' is 0.001 rad; keep it well above")


def test_setpoints_in_the_trace_are_those_handed_over(short: Path, fmus: Path) -> None:
    result = run(short, fmus, "recording.interval=125 us")
    for axis in "XYZ":
        for signal, handed_over in (("x_s", result.program.x_s), ("n_ffw", result.program.n_ffw)):
            expected = np.repeat(handed_over[axis], 8)[: len(result.trace.time)]
            np.testing.assert_array_equal(result.trace[f"{axis}.{signal}"], expected)


def test_units_know_the_end_of_the_run(short: Path, fmus: Path) -> None:
    loaded = scenario.load(short)
    program = nc.plan(loaded)
    with System(loaded.machine, fmus) as system:
        system.initialise(program, stop=0.001)
        steps = Interpreter([do_step(system.plant, 0.0, 125e-6)], 125e-6)
        steps.run(0, 8)
        with pytest.raises(SimulationError, match=r"unit plant, t = 0\.001 s: step of 0\.000125 s failed: .*stop time"):
            steps.run(8, 9)


def test_what_stays_behind_is_used_again_and_goes_when_told(
    short: Path, fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unpacked archives and loaded libraries, after runs and after a failed one."""
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))

    def libraries() -> int:
        maps = Path("/proc/self/maps")
        return maps.read_text().count(str(scratch)) if maps.exists() else 0

    monkeypatch.setattr(STORE, "_contents", {})  # what other tests of this process may still use stays out of it
    run(short, fmus)
    folders, loaded = set(scratch.glob("*/feedsim-*")), libraries()
    assert len(folders) == 3
    run(short, fmus)
    with pytest.raises(InputError, match="refuses its parameters"):
        cosim.run(with_filter_beyond_nyquist(short), fmus=fmus)
    assert (set(scratch.glob("*/feedsim-*")), libraries()) == (folders, loaded)
    STORE.clear()
    assert not list(scratch.glob("*/feedsim-*"))
    assert libraries() == 0


def test_warnings_that_need_no_run_come_before_it(short: Path, fmus: Path) -> None:
    def foreseen(*overrides: str) -> tuple[Finding, ...]:
        loaded = scenario.load(short, list(overrides))
        return judge.check(loaded, nc.plan(loaded), fmus=fmus)

    assert foreseen() == ()
    (stability,) = foreseen("machine.axes.Z.friction.sigma_1=60 N.m.s/rad")
    assert (stability.code, stability.place) == ("exchange-unstable", "Z")
    assert "sigma_1 + sigma_2 = 60.01 N.m.s/rad is above 30.17" in stability.text
    (width,) = foreseen("machine.axes.X.friction.W=0.001 rad")
    assert (width.code, width.place) == ("unit-warns", "friction_X")
    assert "parameter 'W'" in width.text
    (load,) = foreseen("machine.axes.Y.constant_load=20 N.m")
    assert (load.code, load.place) == ("load-not-carried", "Y")
    assert foreseen("machine.axes.Y.constant_load=20 N.m", "motions.0={kind: dwell, duration: 1 s}") == ()
