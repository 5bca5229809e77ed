"""F_C and M_0 from the position in open loop, on records of an axis that is integrated here: Runge-Kutta of the fourth
order over angle, speed and bristles (pure LuGre), under a controller that holds its torque for each millisecond."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import copysign, exp, log1p, nan, pi, sqrt
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from feedsim.estimation.identify.friction_file import drift_texts
from feedsim.estimation.identify.open_loop import balance_loads, first_deflection, first_speed, simulate_angle, substeps
from feedsim.estimation.identify.parameters import FRICTION_NAMES, NO_EFFECT
from feedsim.estimation.identify.record import Record
from feedsim.estimation.identify.result import Balance, Estimate
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.foundation.errors import InputError, SimulationError
from feedsim.simulation.cosim.friction_law import FrictionLaw

Array = NDArray[np.float64]

# Synthetic, near the default machine's Z axis, without its engaging zone. What is not named has no effect.
TRUE = {
    **NO_EFFECT,
    "sigma_0": 300.0, "sigma_1": 0.8, "sigma_2": 0.006, "F_C": 1.6, "F_S": 2.1, "v_s": 0.6, "beta": 1.0, "F_log": 0.4,
    "v_log": 3.0, "asymmetry": 0.05, "W": 0.0, "gamma": 1.0, "M_0": 0.3, "J": 0.0164,
}  # fmt: skip
H = 1e-3  # s, of the controller and of the record
FINE = 8  # steps of the integration per H
HELD = -H / 2  # delay of a torque that is held over the coming interval


def slope(n: float, z: float, torque: float) -> tuple[float, float]:
    """dn/dt and dz/dt, from the equations of the friction unit's README."""
    p, size = TRUE, abs(n)
    fall = exp(-((size / p["v_s"]) ** p["beta"]))
    side = 1 + p["asymmetry"] * copysign(1.0, n) * (n != 0)
    depth = side * (p["F_C"] + (p["F_S"] - p["F_C"]) * fall + p["F_log"] * log1p(size / p["v_log"])) / p["sigma_0"]
    dz = n - size / depth * z
    friction = p["sigma_0"] * z + p["sigma_1"] * dz + p["sigma_2"] * n
    return (torque - p["M_0"] - friction) / p["J"], dz


def step(state: tuple[float, float, float], torque: float, h: float) -> tuple[float, float, float]:
    x, n, z = state
    n_1, z_1 = slope(n, z, torque)
    n_2, z_2 = slope(n + h / 2 * n_1, z + h / 2 * z_1, torque)
    n_3, z_3 = slope(n + h / 2 * n_2, z + h / 2 * z_2, torque)
    n_4, z_4 = slope(n + h * n_3, z + h * z_3, torque)
    x += h * n + h * h / 6 * (n_1 + n_2 + n_3)
    return x, n + h / 6 * (n_1 + 2 * n_2 + 2 * n_3 + n_4), z + h / 6 * (z_1 + 2 * z_2 + 2 * z_3 + z_4)


def driven(setpoint: Callable[[float], float], duration: float) -> Record:
    """What a position controller with damping would log."""
    state = (setpoint(0.0), 0.0, 0.0)
    count = round(duration / H)
    angle, speed, torque = (np.zeros(count) for _ in range(3))
    for k in range(count):
        x, n, _ = state
        angle[k], speed[k] = x, n
        # 8 Hz, critically damped, and the load known to it
        torque[k] = TRUE["J"] * (50.0**2 * (setpoint(k * H) - x) - 100.0 * n) + TRUE["M_0"]
        for _ in range(FINE):
            state = step(state, float(torque[k]), H / FINE)
    return Record("axis", np.arange(count, dtype=np.float64) * H, torque, angle=angle, speed=speed)


def strokes(t: float) -> float:
    """Unequal moves to and fro [rad] over several seconds, smooth from rest."""
    rise = min(t / 0.4, 1.0) ** 2
    return float(
        rise * (6 * (1 - np.cos(2 * pi * 0.5 * t)) + 2 * np.sin(2 * pi * 1.3 * t) + 0.7 * np.sin(2 * pi * 2.9 * t))
    )


@pytest.fixture(scope="module")
def general() -> Record:
    return driven(strokes, 8.0)


def estimates(changes: Mapping[str, float] | None = None, relative: float = 0.01) -> dict[str, Estimate]:
    values = TRUE | {"delay": HELD} | dict(changes or {})
    return {name: Estimate(name, value, "", "", relative * abs(value)) for name, value in values.items()}


OFF = {"F_C": 1.6 * 1.04, "F_S": 2.1 + 0.04 * 1.6, "M_0": 0.24}


def found(records: Record | list[Record], law: FrictionLaw, given: Mapping[str, Estimate], **options: Any) -> Balance:
    records = [records] if isinstance(records, Record) else records
    return balance_loads(records, law, given, **options)


def assert_true(balance: Balance, relative: float) -> None:
    assert balance.reason == ""
    assert balance.applied
    for name in ("F_C", "F_S", "M_0"):
        assert balance.estimates[name].value == pytest.approx(TRUE[name], abs=relative * TRUE["F_C"])


def torque_change(balance: Balance) -> float:
    """What the step costs in the rms of the torque residual [N.m]."""
    before, after = balance.torque
    return after - before


def assert_refused(balance: Balance, given: Mapping[str, Estimate], words: str) -> None:
    assert words in balance.reason
    assert not balance.applied
    assert dict(balance.estimates) == dict(given)


# Of F_C. The free axis goes in steps of 1 ms here, and its error is of second order: 1.2e-4 from rest, 5e-4 from a
# start at 36 rad/s; test_steps_of_the_free_axis_are_all_that_is_wrong has it at finer ones.
EXACT = 1e-3


def test_finds_what_the_axis_was_made_with(general: Record, law: FrictionLaw) -> None:
    given = estimates(OFF)
    balance = found(general, law, given)
    assert_true(balance, EXACT)
    assert balance.records == ("axis",)
    before, after = balance.position
    assert after < 0.02 * before
    assert torque_change(balance) < 0 < balance.torque[1]  # nothing else is wrong: the torque gains too
    others = set(given) - {"F_C", "F_S", "M_0"}
    assert all(balance.estimates[name] is given[name] for name in others)
    for name in ("F_C", "F_S", "M_0"):
        assert balance.changes[name] == (given[name].value, balance.estimates[name].value)
    (drift,) = balance.drifts
    assert (drift.record, len(drift.time)) == ("axis", len(general))
    assert general.angle is not None
    assert np.ptp(drift.angle) == pytest.approx(np.ptp(general.angle))
    for error, rms in zip((drift.before, drift.after), balance.position, strict=True):
        assert np.sqrt(np.mean(error**2)) == pytest.approx(rms)


def test_says_how_far_both_criteria_are_apart(general: Record, law: FrictionLaw) -> None:
    sure, vague = (found(general, law, estimates(OFF, relative)).estimates["F_C"] for relative in (1e-6, 0.5))
    assert sure.sigma == pytest.approx(abs(sure.value - OFF["F_C"]) / NORMAL_95)
    assert sure.interval[1] == pytest.approx(OFF["F_C"])
    assert vague.sigma == 0.5 * OFF["F_C"]
    silent = {**estimates(OFF), "F_S": replace(estimates(OFF)["F_S"], sigma=nan, status="undetermined")}
    balance = found(general, law, silent)
    assert_true(balance, EXACT)
    assert np.isnan(balance.estimates["F_S"].sigma)


def test_static_friction_that_is_coulombs_stays_so(general: Record, law: FrictionLaw) -> None:
    given = estimates({"F_C": 1.6637, "F_S": 1.6637, "M_0": 0.24})  # F_S - F_C is 0, whatever the sums round to
    balance = found(general, law, given)
    assert balance.estimates["F_S"].value == balance.estimates["F_C"].value != 1.6637


def test_a_record_that_begins_in_motion(general: Record, law: FrictionLaw) -> None:
    assert general.speed is not None
    first = 1230
    assert abs(general.speed[first]) > 5
    assert_true(found(general.between(first, len(general)), law, estimates(OFF)), EXACT)


def test_steps_of_the_free_axis_are_all_that_is_wrong(
    general: Record, law: FrictionLaw, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = general.between(1230, len(general))
    monkeypatch.setattr("feedsim.estimation.identify.open_loop.EXPLICIT_STEP_SHARE", 0.05)
    assert_true(found(record, law, estimates(OFF)), EXACT / 9)  # three steps per interval


def test_several_records_make_one_answer(general: Record, law: FrictionLaw) -> None:
    pieces = [general.between(0, 3900), general.between(3900, 8000)]
    balance = found([*pieces, replace(general, angle=None)], law, estimates(OFF))
    assert_true(balance, EXACT)
    assert balance.records == ("axis", "axis")


def test_known_load_is_none_of_it(general: Record, law: FrictionLaw) -> None:
    load = 0.5 * np.sin(2 * pi * 0.8 * (general.time + H / 2))
    record = replace(general, torque=general.torque + load, load=load)
    # the load is drawn straight over half an interval: 0.5 N.m (2 pi 0.8 Hz)^2 H^2/8, nothing
    assert_true(found(record, law, estimates(OFF)), EXACT)


def drifting(record: Record, change: float, noise: float = 0.0, seed: int = 0) -> Record:
    """The same motion while the load changes evenly by `change` over the record [N.m], around what it was."""
    drift = change * (record.time / record.time[-1] - 0.5)
    scatter = noise * np.random.default_rng(seed).normal(size=len(record))
    return replace(record, torque=record.torque + drift + scatter)


def test_a_load_that_drifts(general: Record, law: FrictionLaw) -> None:
    """An hour's warming in a minute or less: F_C and M_0, that of the middle, are as without it; the rate is told."""
    change = 0.1 * TRUE["F_C"]
    balance = found(drifting(general, change), law, estimates(OFF))
    assert_true(balance, EXACT)
    rate = balance.load_rates["axis"]
    assert rate.value * general.time[-1] == pytest.approx(change, abs=EXACT * TRUE["F_C"])
    assert rate.unit == "N.m/s"
    with_the_load_held = found(drifting(general, change), law, estimates({"F_C": OFF["F_C"]}), hold={"M_0"})
    assert not with_the_load_held.load_rates


def test_a_drift_that_the_record_does_not_determine_is_not_used(general: Record, law: FrictionLaw) -> None:
    """Noise alone: the rate's interval includes 0. F_C and M_0 are those of a constant load, and the position shows
    what that leaves, as with the load held still."""
    record = drifting(general, 0.0, 0.12, 3)
    balance = found(record, law, estimates({**OFF, "sigma_2": 1.05 * TRUE["sigma_2"]}))
    (rate,) = balance.load_rates.values()
    low, high = rate.interval
    assert low < 0 < high
    assert (rate.status, rate.reason) == ("undetermined", "its interval includes 0: the load is taken as constant")
    (text,) = drift_texts(balance)
    assert text.startswith("a drift of M_0 is not determined, and not used: ")
    values = {name: each.value for name, each in balance.estimates.items()} | {"delay": HELD}
    assert record.angle is not None
    left = float(np.sqrt(np.mean((record.angle - simulate_angle(record, law, values)) ** 2)))
    assert balance.position[1] == pytest.approx(left, rel=1e-6)


def test_the_interval_of_a_drift_holds_it(general: Record, law: FrictionLaw) -> None:
    """Noise of the torque, and a viscous friction that is 5 % off: of six intervals of 95 % one may miss. The axis that
    sticks at another reversal than the true one lies far off."""
    change, held = 0.05 * TRUE["F_C"], 0
    for seed in range(6):
        record = drifting(general, change, 0.12, seed)
        balance = found(record, law, estimates({**OFF, "sigma_2": 1.05 * TRUE["sigma_2"]}))
        rate = next(iter(balance.load_rates.values()))
        low, high = (end * general.time[-1] for end in rate.interval)
        held += low < change < high
        assert high - low < 0.1 * TRUE["F_C"]  # and it says something
    assert held >= 5


@pytest.mark.parametrize("rows", [2, 5])
def test_delay_of_the_torque(general: Record, law: FrictionLaw, rows: int) -> None:
    late = replace(general, torque=np.concatenate([np.full(rows, general.torque[0]), general.torque[:-rows]]))
    assert_true(found(late, law, estimates({**OFF, "delay": rows * H + HELD})), EXACT)


def test_noise_of_the_torque_hardly_matters(general: Record, law: FrictionLaw) -> None:
    # 5 % of the torque's rms, white: over 8000 rows its mean is 0.0013 N.m, which is 1e-3 of F_C; three times that.
    noise = 0.12 * np.random.default_rng(1).normal(size=len(general))
    assert_true(found(replace(general, torque=general.torque + noise), law, estimates(OFF)), 3e-3)


def test_what_the_user_holds_stays(general: Record, law: FrictionLaw) -> None:
    balance = found(general, law, estimates({"M_0": 0.24}), hold=("F_C",))
    assert balance.applied
    assert balance.estimates["M_0"].value == pytest.approx(TRUE["M_0"], abs=EXACT * TRUE["F_C"])
    assert balance.estimates["F_C"].value == TRUE["F_C"]
    assert balance.estimates["F_S"].value == TRUE["F_S"]
    balance = found(general, law, estimates(OFF | {"F_S": 2.1}), hold=("F_S",))
    assert_true(balance, EXACT)
    assert balance.estimates["F_S"].value == 2.1
    given = estimates(OFF)
    assert_refused(found(general, law, given, hold=("F_C", "M_0")), given, "neither F_C nor M_0 is free")
    given |= {name: replace(given[name], status="held") for name in ("F_C", "M_0")}
    assert_refused(found(general, law, given), given, "neither F_C nor M_0 is free")


# --- where it does not apply


def test_a_second_time_nothing_is_left_to_gain(general: Record, law: FrictionLaw) -> None:
    noise = 0.12 * np.random.default_rng(1).normal(size=len(general))
    record = replace(general, torque=general.torque + noise)
    once = found(record, law, estimates(OFF)).estimates
    assert_refused(found(record, law, once), once, "does not improve")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda r: replace(r, angle=None), "axis: no position"),
        (lambda r: r.between(0, 2900), "axis: 2.9 s are too short; at least 3 s are needed"),
        (lambda r: r.between(0, 5), "axis: 0.004 s are too short"),
        (lambda r: replace(r, angle=r.angle * 1e-3, speed=r.speed * 1e-3), "20 times the way of pre-sliding"),
        (lambda r: replace(r, angle=r.angle * 0, speed=r.speed * 0), "nothing moves"),
    ],
    ids=["no position", "short", "a few rows", "pre-sliding", "rest"],
)
def test_records_that_tell_nothing(
    general: Record, law: FrictionLaw, change: Callable[[Record], Record], words: str
) -> None:
    given = estimates(OFF)
    assert_refused(found(change(general), law, given), given, words)


def test_no_records(law: FrictionLaw) -> None:
    given = estimates(OFF)
    assert_refused(found([], law, given), given, "no records")


def test_sines_are_left_to_stage_2(law: FrictionLaw) -> None:
    record = driven(lambda t: 0.8 * float(np.sin(2 * pi * 2.0 * t)), 4.0)
    given = estimates(OFF)
    assert_refused(found(record, law, given), given, "sines")
    assert not found(record, law, given).applies
    assert not found(record, law, given, hold=("F_C", "M_0")).applies
    assert found([record, replace(record, angle=None)], law, given).applies  # that one is for want of a position


def test_one_direction(law: FrictionLaw) -> None:
    record = driven(lambda t: 5 * t * min(t, 1.0) + 0.5 * float(np.sin(2 * pi * 0.7 * t)) * min(t, 1.0), 4.0)
    given = estimates(OFF)
    assert_refused(found(record, law, given), given, "one direction only")
    # What does not have to be told from the other is told.
    balance = found(record, law, estimates(OFF | {"M_0": 0.3}), hold=("M_0",))
    assert balance.estimates["F_C"].value == pytest.approx(TRUE["F_C"], rel=EXACT)


@pytest.mark.parametrize(
    ("off", "words"),
    [
        ({"F_C": 1.3, "F_S": 1.8}, "F_C would change by +23 %; more than 20 % is not believed"),
        ({"F_C": 2.1, "F_S": 2.6}, "F_C would change by -2"),
        ({"M_0": -1.5}, "M_0 would change by +1.1 times F_C; more than 1 is not believed"),
    ],
)
def test_changes_that_are_not_believed(general: Record, law: FrictionLaw, off: dict[str, float], words: str) -> None:
    given = estimates(off)
    balance = found(general, law, given)
    assert_refused(balance, given, words)
    assert balance.position[1] < 0.5 * balance.position[0]  # it was tried
    assert balance.changes["F_C"][0] == given["F_C"].value
    assert len(balance.drifts) == 1


def test_a_torque_that_grows_too_much(general: Record, law: FrictionLaw) -> None:
    """A torque channel that drifts there and back: the position asks for a load, the torque does not bear it."""
    drift = 0.06 * np.sin(2 * pi * general.time / general.time[-1])
    given = estimates()
    balance = found(replace(general, torque=general.torque + drift), law, given)
    assert_refused(balance, given, "the torque's residual would grow by ")
    assert torque_change(balance) > 0.1 * balance.torque[0]


def test_bristles_too_stiff_for_the_record(general: Record, law: FrictionLaw) -> None:
    given = estimates(OFF | {"sigma_0": 1e8})
    assert_refused(found(general, law, given), given, "sigma_0 or sigma_1 is so large")


def test_a_motion_that_is_no_number(general: Record, law: FrictionLaw, monkeypatch: pytest.MonkeyPatch) -> None:
    def runs_off(*_: Any, **__: Any) -> tuple[Array, Array]:
        raise SimulationError("no finite number at 0.5 s")

    monkeypatch.setattr(law, "free_axis", runs_off)
    given = estimates(OFF)
    assert_refused(balance_loads([general], law, given), given, "no finite number at 0.5 s")


@pytest.mark.parametrize("name", [*FRICTION_NAMES, "M_0", "J"])
def test_an_estimate_that_is_missing(general: Record, law: FrictionLaw, name: str) -> None:
    given = estimates(OFF)
    del given[name]
    with pytest.raises(InputError, match=f"no value of {name}"):
        found(general, law, given)


def test_parameters_that_the_law_refuses(general: Record, law: FrictionLaw) -> None:
    with pytest.raises(InputError, match="'beta' is out of range"):
        found(general, law, estimates(OFF | {"beta": 11.0}))


# --- how it begins


def test_first_speed() -> None:
    t = np.arange(500) * H
    angle = 3.0 + 4.0 * t - 50.0 * t**2 + 900.0 * t**3
    assert first_speed(angle, H) == pytest.approx((3.0, 4.0), rel=1e-9)
    angle[7] += 1.0  # a sample that fell out
    assert first_speed(angle, H) == pytest.approx((3.0, 4.0), rel=1e-9)
    # Rows that are far apart: nine of them.
    t = np.arange(12) * 0.01
    assert first_speed(np.sin(5 * t), 0.01)[1] == pytest.approx(5.0, rel=2e-3)  # cubic for a sine over 0.4 rad
    assert first_speed(np.full(500, 0.7), H) == pytest.approx((0.7, 0.0), abs=1e-12)
    # Noise of 10 urad on ten samples over 9 ms: 14 times as much per 9 ms for the slope of a cubic at its end.
    noise = 1e-5 * np.random.default_rng(2).normal(size=500)
    assert first_speed(noise + np.arange(500) * H, H)[1] == pytest.approx(1.0, abs=3 * 14e-5 / 9e-3)


def test_first_deflection() -> None:
    level = TRUE["F_C"] + (TRUE["F_S"] - TRUE["F_C"]) * exp(-2 / 0.6) + TRUE["F_log"] * log1p(2 / 3)
    assert first_deflection(TRUE, 2.0, -9.0) == pytest.approx(1.05 * level / 300)
    assert first_deflection(TRUE, -2.0, 9.0) == pytest.approx(-0.95 * level / 300)
    assert first_deflection(TRUE, 0.0, 1.2) == pytest.approx(1.2 / 300)
    assert first_deflection(TRUE, 1e-3, -1.2) == pytest.approx(-1.2 / 300)  # 10 urad in 10 ms is no sliding
    assert first_deflection(TRUE, 0.0, -9.0) == pytest.approx(-0.95 * 2.1 / 300)
    assert first_deflection(TRUE, 0.0, 0.0) == 0.0
    engaging = TRUE | {"W": 0.04, "gamma": 0.4}
    assert first_deflection(engaging, 0.0, 0.7) == pytest.approx(0.7 / (0.7 * 300))


def test_rest_under_a_load_does_not_begin_with_a_fall(law: FrictionLaw) -> None:
    z = first_deflection(TRUE, 0.0, 1.5 - TRUE["M_0"])
    angle, _ = law.free_axis({name: TRUE[name] for name in law.names}, 0.0164, 0.3, np.full(3000, 1.5), H, z=z)
    assert np.max(np.abs(angle)) < 1e-12


def test_substeps() -> None:
    times = 0.0164 / 0.806, sqrt(0.0164 / 300)  # s, of the damping and of the bristles
    assert substeps(TRUE, H) == 1
    assert substeps(TRUE, 10e-3) == int(np.ceil(10e-3 / (0.25 * min(times))))


# --- a measured axis


@pytest.mark.skipif("FEEDSIM_EMPS" not in os.environ, reason="FEEDSIM_EMPS names no measured data")
def test_published_parameters_of_a_measured_axis(law: FrictionLaw) -> None:
    """EMPS (A. Janot, M. Gautier, M. Brunot 2019): least-squares values of its authors, friction without F_log."""
    from scipy.io import loadmat

    content = loadmat(os.environ["FEEDSIM_EMPS"], squeeze_me=True)
    I_P = 2.5e-3 / (2 * pi)
    position, command = (np.asarray(content[name], dtype=np.float64) for name in ("qm", "vir"))
    angle, torque = position / I_P, float(content["gtau"]) * I_P * command
    record = Record("EMPS", np.arange(len(angle), dtype=np.float64) * H, torque, angle=angle)
    published = {"sigma_2": 203.5 * I_P**2, "F_C": 20.39 * I_P, "F_S": 20.39 * I_P, "M_0": -3.165 * I_P}
    rest = {"J": 95.109 * I_P**2, "sigma_0": 8e6 * I_P**2, "sigma_1": 1e3 * I_P**2, "v_s": 10.0, "F_log": 0.0}
    balance = found(record, law, estimates(published | rest | {"asymmetry": 0.0}))
    assert balance.applied
    before, after = (I_P * rms for rms in balance.position)
    # With a load that drifts it would be 2.2 mm; the interval of that drift includes 0.
    assert balance.load_rates["EMPS"].status == "undetermined"
    assert 4e-3 < before < 6e-3
    assert after < 3.4e-3
    assert abs(balance.estimates["F_C"].value / I_P - 20.39) < 1.0
    assert abs(balance.estimates["M_0"].value / I_P + 3.165) < 0.3
    assert 0 < torque_change(balance) / I_P < 0.1
