"""The units against a measured axis, EMPS, whose cascade and parameters are published (emps_axis.py).

Limits: the record's own disturbances (a ripple of 2 to 4 N with the turn of the screw, a constant load that drifts by
0.2 N within the record) are in no model here. The published parameters leave 1.6 um and 2.4 N; with a friction model
that fits the axis it is 1.1 um and 1.8 N. The following error is 578 um.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numpy as np
import pytest
from emps_axis import I_P, SCENARIO, Measured, Parameters, T, closed_loop, follow, least_squares, open_loop, read

from feedsim.cli import main
from feedsim.estimation.identify.inertia import inertia
from feedsim.scenario import load
from feedsim.simulation.cosim import run

MAPPING = SCENARIO.parent / "machines" / "emps" / "columns.yaml"
PUBLISHED_RECORD = "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e"
PUBLISHED = [95.109, 203.50, 20.39, -3.165]  # M, F_v, F_C, offset


@pytest.fixture(scope="module")
def file() -> Path:
    if "FEEDSIM_EMPS" not in os.environ:
        pytest.skip("FEEDSIM_EMPS names no measured data")
    return Path(os.environ["FEEDSIM_EMPS"])


@pytest.fixture(scope="module")
def measured(file: Path) -> Measured:
    return read(file)


@pytest.fixture(scope="module")
def identified(file: Path, fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Parameters:
    """The set that identification finds in the record, by the command as documented."""
    out = tmp_path_factory.mktemp("emps")
    words = ["--columns", MAPPING, "--machine", MAPPING.parent, "--axes", "X", "--fmus", fmus, "--out", out, "--quiet"]
    assert main(["identify", "friction", str(file), *map(str, words)]) == 0
    return Parameters.identified(out / "friction.yaml")


@pytest.fixture(scope="module")
def published_record(file: Path) -> None:
    if hashlib.sha256(file.read_bytes()).hexdigest() != PUBLISHED_RECORD:
        pytest.skip("FEEDSIM_EMPS names another record than the published one")


@pytest.mark.parametrize(
    ("begin", "every", "position", "force", "drift"),
    [
        # From rest the run is the record but for rounding; a cycle's shift is 100 um. The drift in open loop is from
        # bristles that the record's begin finds deflected, or from forces between the rows that are not in the record.
        (0.0, 1, 1e-12, 1e-9, 1e-6),
        # Where the reference begins to accelerate, a spline through every other row cuts the corner by some 0.1 nm.
        (0.0, 2, 1e-9, 1e-3, 10e-6),
        # In motion, at 0.11 m/s: what the run-in leaves after SETTLING, measured as 0.02 um and 0.05 N.
        (2.25, 1, 0.1e-6, 0.1, 1e-6),
    ],
)
def test_a_run_of_the_units_is_followed(
    begin: float, every: int, position: float, force: float, drift: float, fmus: Path, tmp_path: Path
) -> None:
    """A record that stands still for 1.5 s, cut to begin in motion, or logged half as often: nothing is shifted."""
    time = T * np.arange(5500)
    reference = 0.05 * (1 - np.cos(np.pi * np.maximum(time - 1.5, 0.0)))  # m
    file = tmp_path / "reference.csv"
    rows = [f"{t!r},{x!r}" for t, x in zip(time.tolist(), reference.tolist(), strict=True)]
    file.write_text("\n".join(["time [s],X.x_s [m]", *rows, ""]), encoding="utf-8")
    trace = run(load(SCENARIO, [f"motions.1.file={file}"]), fmus=fmus).trace
    # A dwell of 1 s comes first; what begins at rest has no run-in.
    cut = slice(round(begin / T), None, every)
    x_a, M_a = trace["X.x_a"][1000:6500], trace["X.M_a"][1001:6501]
    record = Measured(reference[cut], x_a[cut], M_a[cut] / I_P, every)
    found = closed_loop(record, Parameters.published(), fmus, tmp_path)
    assert found[0] < position
    assert found[1] < force
    assert open_loop(record, Parameters.published(), fmus, tmp_path) < drift


@pytest.mark.usefixtures("published_record")
def test_record_is_read_as_its_authors_did(measured: Measured) -> None:
    """Signs, units and sampling: the same estimator gives the same axis. Filters and decimation move it by 1 %."""
    assert least_squares(measured) == pytest.approx(PUBLISHED, rel=0.02)


@pytest.mark.usefixtures("published_record")
def test_inverse_dynamics_gives_the_published_parameters(measured: Measured) -> None:
    found = inertia([measured.record]).estimates
    axis = [
        found["J"].value / I_P**2,
        found["sigma_2"].value / I_P**2,
        found["F_C"].value / I_P,
        found["M_0"].value / I_P,
    ]
    assert axis == pytest.approx(PUBLISHED, rel=0.02)


def test_inverse_dynamics_agrees_with_a_second_estimator(measured: Measured) -> None:
    """On any record of the axis: 1 % for the mass, which both tell best."""
    assert inertia([measured.record]).J.value / I_P**2 == pytest.approx(least_squares(measured)[0], rel=0.01)


@pytest.mark.usefixtures("published_record")
def test_published_parameters_follow_the_record(measured: Measured, fmus: Path, tmp_path: Path) -> None:
    position, force = closed_loop(measured, Parameters.published(), fmus, tmp_path)
    assert position <= 2.0e-6
    assert force <= 2.6


def test_identified_set_follows_the_record(
    measured: Measured, identified: Parameters, fmus: Path, tmp_path: Path
) -> None:
    position, force = closed_loop(measured, identified, fmus, tmp_path)
    assert position <= 2.0e-6
    assert force <= 2.6


def test_identified_set_moves_under_the_recorded_force_as_the_axis(
    measured: Measured, identified: Parameters, fmus: Path, tmp_path: Path
) -> None:
    """The published parameters run 5 mm off: position is the second integral of whatever force is wrong. With a load
    that drifts by 0.5 N over the record 1.2 mm were left; the record does not determine that drift."""
    assert identified.rate == 0.0
    assert open_loop(measured, identified, fmus, tmp_path) <= 2.9e-3


@pytest.mark.usefixtures("published_record")
def test_what_a_model_leaves_of_the_record_is_a_load_to_it(measured: Measured, fmus: Path, tmp_path: Path) -> None:
    """The force that the published parameters do not explain (ripple, drift), as a force on the carriage in step with
    the record: the run comes nearer to it, 0.90 um and 1.76 N of 1.58 and 2.40; with the other sign it is twice as far
    off. It is no forecast: that force is of the same record."""
    _, force = follow(measured, Parameters.published(), fmus, tmp_path)
    unexplained = measured.force - force
    position, left = closed_loop(measured, Parameters.published(), fmus, tmp_path, -unexplained)
    assert position <= 1.0e-6
    assert left <= 1.9
    position, left = closed_loop(measured, Parameters.published(), fmus, tmp_path, unexplained)
    assert position >= 3.0e-6
    assert left >= 4.5
