"""The master: reproducible runs, failing units, selection of what is recorded, the energy residual of the coupling."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from feedsim import cosim, scenario
from feedsim.cosim.run import Run
from feedsim.errors import FeedsimError, InputError, SimulationError

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
# A short reversal of all axes at once: every unit works, every branch of the friction is passed.
SHORT = """
name: short reversal
machine: {machine}
motions:
  - {{kind: move, by: {{X: 2 mm, Y: 1 mm, Z: -1 mm}}, feed: 3000 mm/min}}
  - {{kind: move, by: {{X: -2 mm, Y: -1 mm, Z: 1 mm}}, feed: 3000 mm/min}}
"""


@pytest.fixture
def short(tmp_path: Path) -> Path:
    file = tmp_path / "short.yaml"
    file.write_text(SHORT.format(machine=SCENARIOS / "machines" / "test_centre"))
    return file


def run(file: Path, fmus: Path, *overrides: str) -> Run:
    return cosim.run(scenario.load(file, list(overrides)), fmus=fmus)


def test_two_runs_are_bit_identical(short: Path, fmus: Path) -> None:
    first, second = run(short, fmus), run(short, fmus)
    assert first.trace.columns.keys() == second.trace.columns.keys()
    for name in first.trace.columns:
        np.testing.assert_array_equal(first.trace[name], second.trace[name], err_msg=name)


def test_every_row_is_on_the_recording_grid(short: Path, fmus: Path) -> None:
    fine = run(short, fmus, "recording.interval=125 us").trace
    coarse = run(short, fmus, "recording.interval=1 ms").trace
    np.testing.assert_array_equal(coarse.time, fine.time[::8])
    np.testing.assert_array_equal(coarse["Z.x_a"], fine["Z.x_a"][::8])


def test_recording_can_be_narrowed(short: Path, fmus: Path) -> None:
    trace = run(short, fmus, "recording.variables=['Z.x_?', 'tool.*']").trace
    assert list(trace.columns) == ["Z.x_s", "Z.x_a", "Z.x_e", "tool.x_X", "tool.x_Y", "tool.x_Z"]


def test_pattern_that_matches_nothing_is_an_error(short: Path, fmus: Path) -> None:
    with pytest.raises(InputError, match=r"'Q\.\*' matches none of"):
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


@pytest.mark.parametrize("scheme", sorted(cosim.SCHEMES))
def test_every_scheme_runs_and_agrees_roughly(scheme: str, short: Path, fmus: Path) -> None:
    reference = run(short, fmus, "coupling.substeps=4").trace["X.x_a"]
    error = np.abs(run(short, fmus, f"coupling.scheme={scheme}").trace["X.x_a"] - reference).max()
    # Holding M_a costs a quarter of a micrometre on the circle, the other schemes less than 0.1 um.
    assert error < (2e-6 if scheme == "parallel" else 0.2e-6)
    assert scheme == "extrapolated" or error > 1e-10, "a scheme that changes nothing is not the scheme it claims to be"


def test_energy_residual_shrinks_with_the_step(short: Path, fmus: Path) -> None:
    """The residual of a second-order exchange falls at least with the square of the step."""
    coarse, fine = run(short, fmus).coupling, run(short, fmus, "coupling.substeps=4").coupling
    assert fine["X.residual_peak"] < coarse["X.residual_peak"] / 10
    assert coarse["X.residual_peak"] < 1e-3 * coarse["X.friction_work"]


def test_failing_unit_is_named_with_its_own_words(tmp_path: Path, short: Path, fmus: Path) -> None:
    modes = tmp_path / "broken.csv"
    modes.write_text("mode,frequency [Hz]\n0,0\n")
    with pytest.raises(FeedsimError, match=r"unit plant.*broken\.csv"):
        run(short, fmus, f"machine.modes={modes}")


def test_missing_archives_say_how_to_get_them(tmp_path: Path, short: Path) -> None:
    with pytest.raises(InputError, match=r"plant\.fmu: no such file; `make fmus`"):
        run(short, tmp_path)


def test_unstable_exchange_is_seen_in_the_residual(short: Path, fmus: Path) -> None:
    """Beyond 2 J_inf / h explicit exchange chatters; the residual is what tells (it does not overflow)."""
    try:
        coupling = run(short, fmus, "machine.axes.Z.friction.sigma_1=400 N.m.s/rad").coupling
    except SimulationError:
        return  # an overflow that a unit reports is a clear answer too
    assert coupling["Z.residual_peak"] > 1e-2 * abs(coupling["Z.friction_work"])
