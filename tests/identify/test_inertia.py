"""Inertia from accelerating parts, and the record of a measured axis against its published parameters."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from feedsim.estimation.identify.inertia import inertia
from feedsim.estimation.identify.record import Record
from feedsim.foundation.errors import InputError
from identify_records import TRUE, J, constant_speeds

RIGID = {**TRUE, "F_S": 1.6, "F_log": 0.0, "sigma_2": 0.02, "W": 0.0, "M_0": -0.3}
# M. Janot, M. Gautier, M. Brunot, Workshop on Nonlinear System Identification Benchmarks, 2019: kg, N.s/m, N, N.
PUBLISHED = {"J": 95.109, "sigma_2": 203.50, "F_C": 20.39, "M_0": -3.165}


@pytest.fixture(scope="module")
def rigid() -> Record:
    return constant_speeds(RIGID, [5.0, 20.0, 60.0, 100.0], [0.5] * 4, ringing=0.0)


@pytest.mark.parametrize("angle", [False, True], ids=["speed", "angle"])
def test_a_rigid_axis_with_coulomb_and_viscous_friction_is_exact(rigid: Record, angle: bool) -> None:
    record = Record("x", rigid.time, rigid.torque, rigid.angle if angle else None, None if angle else rigid.speed)
    found = inertia([record])
    # What is left: the bristles of the record, which take 5 mrad after each start.
    for name, truth in (("J", J), ("sigma_2", 0.02), ("F_C", 1.6), ("M_0", -0.3)):
        assert found.estimates[name].value == pytest.approx(truth, rel=2e-3), name
    assert found.warnings == ()


def test_scatter_is_the_standard_deviation(rigid: Record) -> None:
    values, sigmas = [], []
    for seed in range(40):
        noise = np.random.default_rng(seed).standard_normal(len(rigid) + 1)
        coloured = 0.2 * (noise[1:] + 0.8 * noise[:-1])
        found = inertia([Record("x", rigid.time, rigid.torque + coloured, None, rigid.speed)])
        values.append([estimate.value for estimate in found.estimates.values()])
        sigmas.append([estimate.sigma for estimate in found.estimates.values()])
    # 40 draws: 11 % of their own; few moves: the standard deviation itself is known to about 20 %.
    ratio = np.std(values, axis=0) / np.mean(sigmas, axis=0)
    assert np.all(ratio < 1.5)
    assert np.all(ratio > 0.5)


def test_stribeck_friction_and_ring_down_leave_the_inertia_within_its_confidence() -> None:
    found = inertia([constant_speeds()])
    assert found.J.value == pytest.approx(J, rel=0.01)
    assert abs(found.J.value - J) < 3 * found.J.sigma


def test_coarse_positions_lengthen_the_low_pass(rigid: Record) -> None:
    assert rigid.angle is not None
    coarse = np.round(rigid.angle / 0.02) * 0.02
    found = inertia([Record("x", rigid.time, rigid.torque, coarse)])
    assert found.window > inertia([rigid]).window
    assert found.J.value == pytest.approx(J, rel=0.02)


def test_known_load_and_several_records(rigid: Record) -> None:
    pulses = np.where(np.sin(rigid.time) > 0, 0.5, 0.0)
    loaded = Record("x", rigid.time, rigid.torque + pulses, None, rigid.speed, load=pulses)
    assert inertia([loaded]).J.value == pytest.approx(
        inertia([Record("x", rigid.time, rigid.torque, None, rigid.speed)]).J.value
    )
    assert inertia([loaded, rigid]).rows == 2 * inertia([rigid]).rows


def test_refusals(rigid: Record) -> None:
    still = Record("still", rigid.time, rigid.torque, None, np.zeros(len(rigid)))
    with pytest.raises(InputError, match="still: the axis does not move"):
        inertia([still])
    steady = Record("steady", rigid.time, np.full(len(rigid), 2.0), None, np.full(len(rigid), 5.0))
    with pytest.raises(InputError, match="neither accelerates nor changes its speed"):
        inertia([steady])
    wrong = Record("wrong", rigid.time, -rigid.torque, None, rigid.speed)
    with pytest.raises(InputError, match="signs of torque and motion"):
        inertia([wrong])


def test_one_direction_takes_the_load_for_friction() -> None:
    record = constant_speeds(RIGID, [20.0, 60.0, 100.0], [0.5] * 3, ringing=0.0, both=False)
    found = inertia([record])
    assert found.estimates["M_0"].status == "undetermined"
    assert "one-direction-only" in [finding.code for finding in found.warnings]
    assert found.J.value == pytest.approx(J, rel=5e-3)


@pytest.fixture(scope="module")
def emps() -> Record:
    path = os.environ.get("FEEDSIM_EMPS")
    if not path or not Path(path).is_file():
        pytest.skip("FEEDSIM_EMPS names no copy of DATA_EMPS.mat")
    data = {name: np.ravel(values) for name, values in loadmat(path).items() if not name.startswith("__")}
    time = np.linspace(data["t"][0], data["t"][-1], len(data["t"]))
    # With a lead of 1 m/rad, forces are torques and masses inertias.
    return Record("EMPS", time, data["vir"] * data["gtau"][0], data["qm"])


def test_measured_axis_has_the_published_parameters(emps: Record) -> None:
    found = inertia([emps])
    for name, value in PUBLISHED.items():
        assert found.estimates[name].value == pytest.approx(value, rel=0.02), name
    # Half the record serves as well for what does not drift (the offset does: -3.09 and -3.34 N).
    half = len(emps) // 2
    for part in (emps.between(0, half), emps.between(half, len(emps))):
        part_found = inertia([part])
        for name in ("J", "sigma_2", "F_C"):
            assert part_found.estimates[name].value == pytest.approx(PUBLISHED[name], rel=0.02), name
