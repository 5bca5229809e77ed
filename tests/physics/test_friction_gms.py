"""friction_gms.fmu from outside: against scipy, closed forms, its function over whole records, and as an FMI unit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from friction_reference import Motion, line, sine
from gms_reference import Z_AXIS, elements, solved

from feedsim.simulation.cosim.friction_law import FrictionLaw
from fmi_helpers import Archive, Instance

H = 2.0**-13  # s, near the control cycle; a power of two: see test_friction_law.exact
SETS = [
    pytest.param(Z_AXIS, id="Z"),
    pytest.param(Z_AXIS | {"asymmetry": 0.2, "beta": 2.0, "spread": 80.0, "skew": 0.5, "C": 60.0}, id="skew"),
    pytest.param(Z_AXIS | {"spread": 1.0, "sigma_1": 0.0}, id="one element"),
]


@pytest.fixture(scope="module")
def law(fmus: Path) -> Iterator[FrictionLaw]:
    with FrictionLaw(fmus, "friction_gms") as law:
        yield law


@pytest.fixture(scope="module")
def archive(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return Archive.unpack(fmus / "friction_gms.fmu", tmp_path_factory.mktemp("friction_gms"))


@pytest.mark.parametrize("p", SETS)
@pytest.mark.parametrize("motion", [sine(0.5, 2.3, 0.0, 0.6), line(-1.0, 3.7, 0.6)], ids=["sine", "line"])
def test_solves_the_equations(law: FrictionLaw, p: dict[str, float], motion: Motion) -> None:
    times = np.arange(1, 601) * 1e-3
    n = np.array([motion.speed(t) for t in np.append(0.0, times)])
    expected = solved(p, motion, times)
    fine = np.array([motion.speed(t) for t in np.arange(600 * 64 + 1) * (1e-3 / 64)])
    # second order: 1e-3/64 s, chords of the sine
    assert np.abs(law(p, fine, 1e-3 / 64, every=64)[1:] - expected).max() < 1e-7
    assert np.abs(law(p, n, 1e-3)[1:] - expected).max() < 3e-4


@pytest.mark.parametrize("p", SETS)
def test_steps_are_of_second_order(law: FrictionLaw, p: dict[str, float]) -> None:
    motion = sine(0.5, 2.3, 0.0, 0.6)
    times = np.arange(1, 61) * 1e-2
    expected = solved(p, motion, times)
    errors = []
    for parts in (20, 80, 320):
        n = np.array([motion.speed(t) for t in np.arange(60 * parts + 1) * (1e-2 / parts)])
        errors.append(np.sqrt(np.mean((law(p, n, 1e-2 / parts, every=parts)[1:] - expected) ** 2)))
    assert np.log2(errors[0] / errors[2]) / 4 == pytest.approx(2.0, abs=0.2), errors


# --- the unit


def test_equals_the_unit_to_the_last_bit(law: FrictionLaw, archive: Archive) -> None:
    t = np.arange(4001) * H
    n = np.round(2 * (np.sin(44 * t) + 0.4 * np.sin(145 * t + 1.0)) * 2.0**30) / 2.0**30
    n[2000:2050], n[-200:] = 0.0, 120.0
    for name, start in law.start_values.items():
        parameters = {name: start * 0.95 if start else 0.1}
        with archive.instance(parameters, inputs={"n_fr": n[0]}) as unit:
            first = unit.gets(["M_fr", "z"])
            stepped = np.vstack([first, unit.run(H, ["n_fr"], n, ["M_fr", "z"])])
        seen = law.states(parameters, n, H)
        np.testing.assert_array_equal(np.column_stack(seen[:2]), stepped, err_msg=name)
        assert not seen[2].any()
        assert not np.array_equal(seen[0], law({}, n, H)), name


def test_start_values_are_those_of_the_z_axis(law: FrictionLaw) -> None:
    assert law.start_values == Z_AXIS


def test_static_below_coulomb_is_refused(archive: Archive) -> None:
    with Instance(archive) as unit:
        with pytest.raises(FMICallException):
            unit.start({"F_S": 1.25, "F_C": 1.5})
        assert "'F_S' is 1.25 N.m and 'F_C' is 1.5 N.m" in unit.texts(3)


def test_overflow_is_an_error_that_keeps_the_state(archive: Archive) -> None:
    with archive.instance({"sigma_2": 1e9}) as unit:
        unit.step(H, {"n_fr": 1.0})
        state, torque_before = unit.state(), unit.get("M_fr")
        with pytest.raises(FMICallException):
            unit.step(H, {"n_fr": 1e300}, {"n_fr": 1e303})
        assert "M_fr would be no finite number" in unit.texts(3)
        unit.restore(state)
        assert unit.get("M_fr") == torque_before


def test_state_replays_bit_for_bit(archive: Archive) -> None:
    grid = 2 * np.sin(31 * np.arange(401) * H + 0.1)
    outputs = ["M_fr", "z", "k"]
    with archive.instance({"spread": 50.0}, inputs={"n_fr": grid[0]}) as unit:
        unit.run(H, ["n_fr"], grid[:201], outputs)
        state, content, time = unit.state(), unit.serialized(), unit.time
        first = unit.run(H, ["n_fr"], grid[200:], outputs)
        unit.restore(state)
        again = unit.run(H, ["n_fr"], grid[200:], outputs)
        with archive.instance() as other:  # of other parameters: those of the state count
            other.restore_serialized(content, time)
            elsewhere = other.run(H, ["n_fr"], grid[200:], outputs)
    assert (again == first).all()
    assert (elsewhere == first).all()


def test_partial_derivative(archive: Archive) -> None:
    with archive.instance() as unit:
        assert unit.partial("M_fr", "n_fr") == pytest.approx(0.806, rel=1e-14)
        for n, slope in ((0.4, 0.0), (-0.2, 900.0), (5.0, -2000.0)):
            unit.step(1e-3, {"n_fr": n}, {"n_fr": slope})
            state, end, d = unit.state(), n + slope * 1e-3, 1e-6
            seen, torques = unit.partial("M_fr", "n_fr"), []
            for side in (d, -d):  # a step so short that no element moves
                unit.restore(state)
                unit.step(1e-12, {"n_fr": end + side})
                torques.append(unit.get("M_fr"))
            unit.restore(state)
            assert seen == pytest.approx((torques[0] - torques[1]) / (2 * d), rel=1e-4)


def test_free_axis_rests_where_elements_bear_the_torque(law: FrictionLaw) -> None:
    """At rest under 1 N.m, a virgin contact is deflected by where its elements bear that."""
    torques = np.minimum(np.arange(24000) * 5e-5, 1.0)
    angle, speed = law.free_axis({}, 0.0164, 0.0, torques, H, substeps=4)
    k, alpha = elements(Z_AXIS)
    x = np.linspace(0, 0.02, 200001)
    borne = np.minimum(k[:, None] * x, alpha[:, None] * 2.1).sum(axis=0)
    assert abs(speed[-1]) < 1e-3
    # a little further by the swing of the axis on its springs
    assert x[np.searchsorted(borne, 1.0)] == pytest.approx(angle[-1], rel=0.02)
