"""The units against a measured axis, EMPS, whose cascade and parameters are published (emps_axis.py).

Limits: the record's own disturbances (a ripple of 2 to 4 N with the turn of the screw, a constant load that drifts by
0.2 N within the record) are in no model here. The published parameters leave 1.6 um and 2.4 N; with a friction model
that fits the axis it is 1.1 um and 1.8 N. The following error is 578 um.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest
from emps_axis import I_P, SCENARIO, Measured, Parameters, closed_loop, least_squares, open_loop, read

from feedsim.cli import main
from feedsim.identify.inertia import inertia

pytestmark = pytest.mark.skipif("FEEDSIM_EMPS" not in os.environ, reason="FEEDSIM_EMPS names no measured data")

MAPPING = SCENARIO.parent / "machines" / "emps" / "columns.yaml"
PUBLISHED_RECORD = "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e"
PUBLISHED = [95.109, 203.50, 20.39, -3.165]  # M, F_v, F_C, offset


@pytest.fixture(scope="module")
def measured() -> Measured:
    return read(os.environ["FEEDSIM_EMPS"])


@pytest.fixture(scope="module")
def identified(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Parameters:
    """The set that identification finds in the record, by the command as documented."""
    out = tmp_path_factory.mktemp("emps")
    words = ["--columns", MAPPING, "--machine", MAPPING.parent, "--axis", "X", "--fmus", fmus, "--out", out, "--quiet"]
    assert main(["identify", os.environ["FEEDSIM_EMPS"], *map(str, words)]) == 0
    return Parameters.identified(out / "friction.yaml")


@pytest.fixture(scope="module")
def published_record() -> None:
    if hashlib.sha256(Path(os.environ["FEEDSIM_EMPS"]).read_bytes()).hexdigest() != PUBLISHED_RECORD:
        pytest.skip("FEEDSIM_EMPS names another record than the published one")


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
    """The published parameters run 5 mm off: position is the second integral of whatever force is wrong."""
    assert open_loop(measured, identified, fmus, tmp_path) <= 2.7e-3
