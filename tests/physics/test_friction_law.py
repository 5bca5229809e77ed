"""The friction law as a function (feedsim.simulation.cosim.friction_law): against the unit behind the FMI, and against
scipy."""

from __future__ import annotations

import math
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from friction_reference import X_AXIS, Z_AXIS, level, line, sine, solved, torque
from scipy.integrate import solve_ivp

from feedsim.estimation.identify.parameters import torque as constant_speed_torque
from feedsim.foundation import units
from feedsim.foundation.errors import InputError, SimulationError
from feedsim.simulation.cosim.friction_law import FrictionLaw
from fmi_helpers import Archive, Floats

H = 2.0**-13  # s, near the control cycle; a power of two, see `exact`


@pytest.fixture(scope="module")
def archive(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return Archive.unpack(fmus / "friction.fmu", tmp_path_factory.mktemp("friction"))


def exact(speeds: Floats) -> Floats:
    """To multiples of 2^-30: their differences, slopes over H and n + slope h are then free of roundings, so that the
    unit, which is given slopes, sees the very speeds that the function is given."""
    return np.asarray(np.round(speeds * 2.0**30) / 2.0**30, dtype=np.float64)


def speeds(count: int = 6000, amplitude: float = 2.0) -> Floats:
    """Reversals at several slopes, standstill, rapid traverse."""
    t = np.arange(count + 1) * H
    n = amplitude * (np.sin(2 * np.pi * 7.0 * t) + 0.4 * np.sin(2 * np.pi * 23.0 * t + 1.0))
    n[count // 2 : count // 2 + 50] = 0.0
    n[-200:] = 120.0
    return exact(n)


@pytest.mark.parametrize("name", units.parameters("friction"))
def test_identification_knows_what_acts_at_constant_speed(law: FrictionLaw, name: str) -> None:
    """Its curve over speed is Eq. 7 a second time: whichever parameter differs, the law settles at it."""
    start = law.start_values
    parameters = start | {name: 1.1 * start[name] or 0.1}
    for n in (-120.0, -0.5, 0.5, 3.0, 120.0):
        # 2 rad: the zone of 0.04 rad is left behind, and bristles bent by 0.01 rad forget where they began
        steps = math.ceil(2 / abs(n) / H)
        settled = law(parameters, np.full(steps + 1, n), H)[-1]
        assert constant_speed_torque({**parameters, "M_0": 0.0}, np.array([n]))[0] == pytest.approx(settled, rel=1e-12)


@pytest.mark.parametrize(
    "parameters",
    [
        pytest.param({}, id="start values"),
        pytest.param(X_AXIS, id="X"),
        pytest.param({"W": 0.0, "beta": 2.0}, id="pure LuGre"),
        pytest.param({"asymmetry": 0.3, "gamma": 0.0, "F_log": 0.0, "beta": 0.7}, id="asymmetric"),
    ],
)
def test_equals_the_unit_to_the_last_bit(law: FrictionLaw, archive: Archive, parameters: dict[str, float]) -> None:
    n = speeds()
    with archive.instance(parameters, inputs={"n_fr": n[0]}) as unit:
        first = unit.gets(["M_fr", "z", "c"])
        stepped = np.vstack([first, unit.run(H, ["n_fr"], n, ["M_fr", "z", "c"])])
    seen = law.states(parameters, n, H)
    np.testing.assert_array_equal(np.column_stack(seen), stepped)
    np.testing.assert_array_equal(law(parameters, n, H), stepped[:, 0])


def test_each_parameter_is_taken_for_what_it_is(law: FrictionLaw, archive: Archive) -> None:
    n = speeds(2000)
    usual = law({}, n, H)
    for name, start in law.start_values.items():
        changed = {name: start * 0.9 if start else 0.1}
        with archive.instance(changed, inputs={"n_fr": n[0]}) as unit:
            stepped = unit.run(H, ["n_fr"], n, ["M_fr"])[:, 0]
        seen = law(changed, n, H)
        np.testing.assert_array_equal(seen[1:], stepped)
        assert not np.array_equal(seen, usual), name


def test_start_values_are_the_units(law: FrictionLaw) -> None:
    rows = units.parameters("friction")
    assert [*law.start_values.items()] == [(name, row.start) for name, row in rows.items()]
    assert law.start_values.items() >= Z_AXIS.items()
    assert law.names == tuple(rows)


SETS = [Z_AXIS, X_AXIS | {"asymmetry": 0.2, "beta": 2.0}, Z_AXIS | {"W": 0.0}]


@pytest.mark.parametrize("parameters", SETS)
def test_solves_the_equations_along_a_sine(law: FrictionLaw, parameters: dict[str, float]) -> None:
    motion, h, count = sine(0.5, 2.3, 0.4, 0.6), 1e-4, 6000
    times = np.arange(1, count + 1) * h
    n = np.array([motion.speed(t) for t in np.append(0.0, times)])
    expected = solved(parameters, motion, times)
    # Chords of this sine lie 0.9e-7 rad/s inside of it on the average (n'' h^2/12); z gathers that for some 40 ms (g/n)
    # and passes it on with sigma_0: 1 uN.m. The steps' own error is below that.
    assert np.abs(law(parameters, n, h)[1:] - expected).max() < 1e-6
    # order 2 of both: every fourth speed, 16 times the error; the band leaves room for terms of order 3
    coarse = np.abs(law(parameters, n[::4], 4 * h)[1:] - expected[3::4]).max()
    fine = np.abs(law(parameters, n, h)[1:] - expected).max()
    assert 15 < coarse / fine < 17


@pytest.mark.parametrize("parameters", SETS)
def test_substeps_converge_to_the_solution(law: FrictionLaw, parameters: dict[str, float]) -> None:
    # A speed in a straight line through standstill: nothing lies between it and its chords. Order 2 in the substeps,
    # down to errors that are far below those of the steps and not yet those of the reference, 1e-12 of 3 N.m.
    motion = line(-1.0, 3.7, 0.6)
    times = np.arange(1, 61) * 0.01
    n = np.array([motion.speed(t) for t in np.append(0.0, times)])
    expected = solved(parameters, motion, times)
    errors = [np.abs(law(parameters, n, 0.01, substeps=m)[1:] - expected).max() for m in (4, 32, 256)]
    assert errors[0] < 2e-4
    assert errors[0] / errors[1] == pytest.approx(64, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(64, rel=0.05)


def test_substeps_are_steps_of_a_finer_grid(law: FrictionLaw) -> None:
    n = speeds(800)
    fine = np.interp(np.arange(4 * 800 + 1) / 4, np.arange(801), n)  # quarters of exact speeds are exact
    np.testing.assert_array_equal(law({}, n, H, substeps=4), law({}, fine, H / 4)[::4])


@pytest.mark.parametrize("every", [1, 3, 800, 801])
def test_every(law: FrictionLaw, every: int) -> None:
    n = speeds(800)
    some, all_ = law.states({}, n, H, every=every), law.states({}, n, H)
    for a, b in zip(some, all_, strict=True):
        np.testing.assert_array_equal(a, b[::every])


def test_continues_from_a_state(law: FrictionLaw) -> None:
    n = speeds(900)
    whole = law.states({}, n, H)
    until = 431
    z, c = (float(values[until]) for values in whole[1:])
    rest = law.states({}, n[until:], H, z=z, c=c)
    for a, b in zip(rest, whole, strict=True):
        np.testing.assert_array_equal(a, b[until:])


def test_views_and_lists_are_speeds_too(law: FrictionLaw) -> None:
    n = speeds(100)
    np.testing.assert_array_equal(law({}, n[::-2], H), law({}, n[::-2].tolist(), H))
    assert law({}, [0.0], H).tolist() == [0.0]


def test_threads_do_not_meet(law: FrictionLaw) -> None:
    n = speeds(20000)
    sets = [{"sigma_0": 200.0 + 10 * i, "W": 0.01 * (i % 5)} for i in range(32)]
    one_by_one = [law(each, n, H) for each in sets]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda each: law(each, n, H), sets))
    for a, b in zip(one_by_one, together, strict=True):
        np.testing.assert_array_equal(a, b)


def test_sets_side_by_side_have_the_same_bits(law: FrictionLaw) -> None:
    """Those that share the shape of the torque over speed, and those that do not."""
    n = speeds(5000)
    sets = [{name: value * (1 + 1e-6)} for name, value in law.start_values.items() if value != 0] + [{}, {"F_log": 0.0}]
    z, c = np.linspace(-3e-3, 3e-3, len(sets)), np.linspace(-0.01, 0.01, len(sets))
    together = law.torques(sets, n, H, z=z, c=c, substeps=2, every=3)
    for k, each in enumerate(sets):
        np.testing.assert_array_equal(together[k], law(each, n, H, z=z[k], c=c[k], substeps=2, every=3))
    with pytest.raises(InputError, match="F_C"):
        law.torques([{}, {"F_C": 3.0, "F_S": 2.0}], n, H, z=[0, 0], c=[0, 0])


# --- the free axis

J, M_0 = 0.0164, 0.3  # synthetic, like the default machine's Z axis


def reached(p: dict[str, float], torques: Floats, h: float, n: float, z: float) -> tuple[Floats, Floats]:
    """Angle and speed by DOP853 at 1e-11, interval by interval, and within one from stop of c to stop of c."""

    def rate(_: float, state: Floats, torque_held: float) -> list[float]:
        _, n, z, c = state
        inside = abs(c) < p["W"] / 2 or c * n < 0
        bounded = min(max(c, -p["W"] / 2), p["W"] / 2)
        return [
            n,
            (torque_held - M_0 - torque(p, z, bounded, n)) / J,
            n - abs(n) / level(p, n) * z,
            n if inside else 0.0,
        ]

    state = np.array([0.0, n, z, 0.0])
    states = [state]
    for held in torques:
        solution = solve_ivp(rate, (0.0, h), state, method="DOP853", rtol=1e-11, atol=1e-13, args=(held,), max_step=h)
        assert solution.success
        state = solution.y[:, -1].copy()
        state[3] = min(max(state[3], -p["W"] / 2), p["W"] / 2)
        states.append(state)
    return np.array(states)[:, 0], np.array(states)[:, 1]


@pytest.mark.parametrize("parameters", SETS)
def test_free_axis_solves_the_equations(law: FrictionLaw, parameters: dict[str, float]) -> None:
    # Sliding both ways, break-away, and a torque below it, at which the axis comes to rest.
    h, k = 2e-3, np.arange(200)
    torques = np.where(k < 140, 7.5 * np.sin(0.09 * k) + 1.5 * np.sin(0.31 * k), 0.9)
    angle, speed = reached(parameters, torques, h, 2.0, 1e-3)
    assert speed.max() > 5 > -5 > speed.min()
    assert abs(speed[-1]) < 0.15
    errors = []
    for substeps in (2, 512):
        seen = law.free_axis(parameters, J, M_0, torques, h, n=2.0, z=1e-3, substeps=substeps)
        errors.append((np.abs(seen[0] - angle).max(), np.abs(seen[1] - speed).max()))
    (coarse, _), (fine, fine_speed) = errors
    # Second order. Where the reversals lie within their steps changes the factor, by 2 or 3, which is an eighth of an
    # order over 256 times the substeps.
    assert np.log(coarse / fine) / np.log(256) == pytest.approx(2.0, abs=0.15)
    assert fine < 1e-7
    assert fine_speed < 1e-5


def test_free_axis_begins_at_what_it_is_given(law: FrictionLaw) -> None:
    angle, speed = law.free_axis({}, J, M_0, [], H, n=3.0)
    assert (angle.tolist(), speed.tolist()) == ([0.0], [3.0])
    held = law.free_axis({"W": 0.0}, J, M_0, np.full(400, 1.0), H, z=0.7 / 300.0)  # bristles that bear the torque
    assert np.abs(held).max() < 1e-12
    torques = 3 * np.sin(np.arange(300) * 0.1)
    np.testing.assert_array_equal(
        law.free_axis({}, J, 0.25, torques[::-2], H), law.free_axis({}, J, 0.25, torques[::-2].tolist(), H)
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"parameters": {"beta": 11.0}}, "'beta' is out of range: 11"),
        ({"parameters": {"F_S": 1.5}}, "'F_S' is 1.5 N.m and 'F_C' is 1.6 N.m"),
        ({"parameters": {"sigma_3": 1.0}}, "no parameter 'sigma_3'"),
        ({"M_a": [[1.0, 2.0]]}, "torques: shape (1, 2)"),
        ({"J": 0.0}, "inertia: 0.0 kg.m2; it must be finite and greater than 0"),
        ({"J": math.nan}, "inertia: nan"),
        ({"h": -1.0}, "time between torques: -1.0 s"),
        ({"substeps": 0}, "substeps = 0; it must be at least 1"),
    ],
)
def test_free_axis_refuses(law: FrictionLaw, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as raised:
        law.free_axis(**{"parameters": {}, "J": J, "M_0": M_0, "M_a": [1.0, 2.0], "h": H} | changes)
    assert words in str(raised.value)
    law.free_axis({}, J, M_0, [1.0], H)  # and nothing is left of it


def test_free_axis_that_is_no_number_says_when(law: FrictionLaw) -> None:
    with pytest.raises(SimulationError, match=r"no finite number at 0\.3 s"):
        law.free_axis({}, J, M_0, [0.0, 1.0, math.inf, 1.0], 0.1, substeps=100)
    with pytest.raises(SimulationError, match=r"no finite number at 0 s"):
        law.free_axis({}, J, M_0, [0.0], 0.1, n=math.nan)


# --- refusals


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"sigma_0": -1.0}, "'sigma_0' is out of range: -1 N.m/rad, allowed is at least"),
        ({"beta": 11.0}, "'beta' is out of range: 11"),
        ({"F_C": math.nan}, "'F_C' is not finite"),
        ({"v_s": math.inf}, "'v_s' is not finite"),
        ({"F_S": 1.5}, "'F_S' is 1.5 N.m and 'F_C' is 1.6 N.m; the static friction torque F_S must not be below"),
        ({"sigma_3": 1.0}, "no parameter 'sigma_3'; there are sigma_0, "),
        ({"n_fr": 1.0}, "no parameter 'n_fr'"),
        ({"F_C": "1.6"}, "'F_C' is '1.6'; a number is needed"),
    ],
)
def test_parameters_are_refused_in_the_units_words(law: FrictionLaw, parameters: dict[str, float], words: str) -> None:
    with pytest.raises(InputError) as raised:
        law(parameters, speeds(10), H)
    assert words in str(raised.value)
    law({}, speeds(10), H)  # and nothing is left of it


@pytest.mark.parametrize(
    ("n", "options", "words"),
    [
        ([], {"h": H}, "shape (0,)"),
        ([[1.0, 2.0]], {"h": H}, "shape (1, 2)"),
        ([1.0, 2.0], {"h": 0.0}, "0.0 s; it must be finite and greater than 0"),
        ([1.0, 2.0], {"h": math.nan}, "nan s"),
        ([1.0, 2.0], {"h": H, "substeps": 0}, "substeps = 0"),
        ([1.0, 2.0], {"h": H, "every": 0}, "every = 0"),
    ],
)
def test_arguments_out_of_range(law: FrictionLaw, n: list[float], options: dict[str, float], words: str) -> None:
    with pytest.raises(InputError) as raised:
        law({}, n, **options)  # type: ignore[arg-type]
    assert words in str(raised.value)


def test_a_torque_that_is_no_number_says_when(law: FrictionLaw) -> None:
    with pytest.raises(SimulationError, match=r"no finite number at 0\.2 s"):
        law({}, [0.0, 1.0, math.inf, 1.0], 0.1)
    with pytest.raises(SimulationError, match=r"no finite number at 0 s"):
        law({}, [0.0, 1.0], 0.1, z=math.nan)


def test_a_library_without_the_function(fmus: Path, tmp_path: Path) -> None:
    shutil.copy(fmus / "controller.fmu", tmp_path / "friction.fmu")  # a sound unit that has none
    with pytest.raises(InputError, match=r"friction\.fmu: its library has no function friction_responses; .*make fmus"):
        FrictionLaw(tmp_path)


def test_no_archive(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        FrictionLaw(tmp_path)


def test_closed(fmus: Path) -> None:
    law = FrictionLaw(fmus)
    law.close()
    law.close()
    with pytest.raises(ValueError, match="closed"):
        law({}, [0.0, 1.0], H)
    with pytest.raises(ValueError, match="closed"):
        law.free_axis({}, J, M_0, [0.0, 1.0], H)
