"""Logs of a run: sampling, delay, noise, rounding; made again of one simulated run. Oracles are closed forms."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim import scenario
from feedsim.files.trace import Trace, read_csv
from feedsim.foundation.errors import InputError
from feedsim.motions import Move
from feedsim.motions.constant_speed import Strokes
from feedsim.scenario import Logging
from feedsim.scenario.model import Signal
from feedsim.simulation import cosim
from feedsim.simulation.cosim import logged
from feedsim.simulation.cosim.recording import recorded_columns
from feedsim.simulation.cosim.run import logged_axes
from feedsim.simulation.judge import judge_run
from report_helpers import write_run
from scenario_helpers import MACHINE
from scenario_helpers import scenario as described

T_C = 125e-6
N = 16_001  # two seconds


def fine() -> Trace:
    """Signals at T_c: a ramp and a current that is linear in pieces, a cubic position, a held setpoint."""
    t = np.arange(N) * T_C
    random = np.random.default_rng(7)
    columns = {
        "Z.x_s": np.floor(t / 1e-3) * 1e-6,
        "Z.n_ffw": np.where((t > 0.5) & (t < 1.5), 2.0, 0.0),
        "Z.x_a": 0.1 + 1e-3 * t - 2e-3 * t**2 + 0.7e-3 * t**3,
        "Z.n_a": np.sin(2 * np.pi * 5 * t),
        "Z.i_q": np.where((t > 0.5) & (t < 1.5), 3.0, 100.0),
        "Z.i_d": random.standard_normal(N),
        "X.i_q": 4 * t,
        "X.n_ffw": np.ones(N),
    }
    units = {"Z.x_s": "m", "Z.x_a": "m", "Z.n_a": "rad/s", "Z.i_q": "A", "Z.i_d": "A", "X.i_q": "A"}
    return Trace(t, columns, units)


def log(**settings: Any) -> Trace:
    settings = {"axes": ("Z",), "signals": ("x_a", "n_a", "i_q"), **settings}
    return logged(fine(), Logging.model_validate(settings), ideal=settings.pop("ideal", ()))


# -- sampling and delay -----------------------------------------------------------------------------------------------


def test_without_disturbances_the_log_holds_the_signals_at_its_instants() -> None:
    trace, source = log(), fine()
    assert trace.time == pytest.approx(np.arange(1001) * 2e-3, abs=1e-15)
    assert trace.names == ("Z.x_a", "Z.n_a", "Z.i_q")
    assert trace.unit("Z.n_a") == "rad/s"
    for name in trace:
        np.testing.assert_array_equal(trace[name], source[name][::16])


def test_a_row_beyond_the_end_is_not_invented() -> None:
    assert log(interval=3e-3).time[-1] == pytest.approx(1.998)


@pytest.mark.parametrize("delay", [0.5e-3, 0.31e-3, 20e-6, 7.1234e-3])
def test_a_current_is_linear_between_cycles_so_its_delay_is_exact(delay: float) -> None:
    """Against linear interpolation of the pieces, which a random polygon tells from anything else."""
    trace, source = log(signals=("i_d",), delay={"i_d": delay}), fine()
    expected = np.interp(trace.time - delay, source.time, source["Z.i_d"])
    assert trace["Z.i_d"] == pytest.approx(expected, abs=1e-9)  # the slope of 1e4 A/s times rounding of 1e-14 s
    assert np.abs(trace["Z.i_d"] - log(signals=("i_d",))["Z.i_d"]).max() > 0.1
    ramp = logged(fine(), Logging.model_validate({"axes": ("X",), "signals": ("i_q",), "delay": {"i_q": delay}}))
    late = ramp.time >= delay
    assert ramp["X.i_q"][late] == pytest.approx(4 * (ramp.time[late] - delay), abs=1e-12)
    assert np.all(ramp["X.i_q"][~late] == 0)  # before the start it was as at the start


def test_delay_of_position_and_speed_is_that_of_a_cubic() -> None:
    delay = 0.3e-3 + 1 / 3 * 1e-4
    trace = log(delay={"x_a": delay, "n_a": delay})
    t = np.maximum(trace.time - delay, 0)
    x = 0.1 + 1e-3 * t - 2e-3 * t**2 + 0.7e-3 * t**3
    assert trace["Z.x_a"] == pytest.approx(x, abs=1e-16)  # exact for a cubic
    # elsewhere 3/128 (omega T_c)^4 = 5.6e-12 in the middle, and 5/128 ... of the first interval, where it looks ahead
    assert trace["Z.n_a"] == pytest.approx(np.sin(2 * np.pi * 5 * t), abs=3e-11)


def test_a_delay_of_whole_cycles_takes_the_samples_themselves() -> None:
    trace, source = log(delay={"x_a": 3 * T_C, "i_q": 4 * T_C}), fine()
    np.testing.assert_array_equal(trace["Z.x_a"][1:], source["Z.x_a"][13::16])
    np.testing.assert_array_equal(trace["Z.i_q"][1:], source["Z.i_q"][12::16])


def test_setpoints_are_held() -> None:
    trace = log(signals=("x_s",), delay={"x_s": 0.4e-3})
    expected = np.floor(np.maximum(trace.time - 0.4e-3, 0) / 1e-3 + 1e-9) * 1e-6
    assert trace["Z.x_s"] == pytest.approx(expected, abs=1e-18)


def test_an_ideal_current_holds_what_its_cycle_ends_with() -> None:
    settings = Logging.model_validate({"axes": ("Z",), "signals": ("i_d",), "delay": {"i_d": 0.3 * T_C}})
    source = fine()
    trace = logged(source, settings, ideal=["Z"])
    # 2 ms less 0.3 cycles lies in the cycle that ends at 2 ms
    np.testing.assert_array_equal(trace["Z.i_d"], source["Z.i_d"][::16])


# -- noise and rounding -----------------------------------------------------------------------------------------------


def test_noise_is_white_and_as_large_as_asked() -> None:
    quiet = log(interval=T_C)
    noisy = log(interval=T_C, noise={"i_q": "0.05 A", "n_a": "2 %", "x_a": "1 um"})
    for name, deviation in (("Z.i_q", 0.05), ("Z.n_a", 0.02 / np.sqrt(2)), ("Z.x_a", 1e-6)):
        noise = noisy[name] - quiet[name]
        # the standard deviation of N values scatters by 1/sqrt(2N) = 0.56 %, the mean by 1/sqrt(N) = 0.8 %: 4 times
        assert noise.std() == pytest.approx(deviation, rel=0.0225)
        assert abs(noise.mean()) < 0.032 * deviation
        correlation = np.correlate(noise, noise, "full")[N : N + 20] / (N * deviation**2)
        assert np.abs(correlation).max() < 0.04
        # Gaussian: kurtosis 3 within 4 sqrt(24/N)
        assert np.mean((noise / deviation) ** 4) == pytest.approx(3.0, abs=0.25)


def test_a_share_is_of_the_rms_while_the_setpoint_moves() -> None:
    """3 A while it moves, 100 A at rest: 10 % are 0.3 A."""
    noise = log(interval=T_C, noise={"i_q": "10 %"})["Z.i_q"] - fine()["Z.i_q"]
    assert noise.std() == pytest.approx(0.3, rel=0.0225)


def test_values_are_rounded_to_the_steps_after_the_noise() -> None:
    for noise in ({}, {"i_q": "0.05 A", "x_a": "100 nm"}):
        exact, stepped = log(noise=noise), log(noise=noise, quantisation={"x_a": 1e-7, "i_q": 0.25})
        for name, step in (("Z.x_a", 1e-7), ("Z.i_q", 0.25)):
            counts = stepped[name] / step
            assert counts == pytest.approx(np.round(counts), abs=1e-8)  # 1e6 counts hold 1e-10
            assert np.abs(stepped[name] - exact[name]).max() <= step / 2 * (1 + 1e-6)
    coarse = log(quantisation={"x_a": 1e-4})["Z.x_a"]
    assert len(set(coarse)) == round(np.ptp(coarse) / 1e-4) + 1


def test_the_same_seed_gives_the_same_log_and_another_one_another() -> None:
    noise = {"i_q": "5 %", "n_a": "5 %"}
    first, again, other = log(noise=noise, seed=3), log(noise=noise, seed=3), log(noise=noise, seed=4)
    for name in ("Z.i_q", "Z.n_a"):
        np.testing.assert_array_equal(first[name], again[name])
        assert abs(np.corrcoef(first[name] - fine()[name][::16], other[name] - fine()[name][::16])[0, 1]) < 0.13


def test_every_signal_has_a_random_stream_of_its_own() -> None:
    alone = log(noise={"i_q": "1 A"})
    together = log(signals=("i_d", "n_a", "i_q", "x_a"), noise={"n_a": "1 rad/s", "i_q": "1 A", "x_a": "1 m"})
    np.testing.assert_array_equal(alone["Z.i_q"], together["Z.i_q"])
    quiet = log()
    noises = [together[name] - quiet[name] for name in ("Z.n_a", "Z.i_q", "Z.x_a")]
    correlation = np.corrcoef(noises) - np.eye(3)
    assert np.abs(correlation).max() < 0.13  # 4/sqrt(1001)
    axes = {"axes": ("Z", "X"), "signals": ("i_q",), "noise": {"i_q": "1 A"}}
    both = logged(fine(), Logging.model_validate(axes))
    np.testing.assert_array_equal(both["Z.i_q"], alone["Z.i_q"])
    assert abs(np.corrcoef(both["Z.i_q"] - quiet["Z.i_q"], both["X.i_q"] - 4 * both.time)[0, 1]) < 0.13


def test_delay_comes_before_noise_and_does_not_change_it() -> None:
    noise = {"i_q": "0.1 A"}
    plain, delayed = log(noise=noise), log(noise=noise, delay={"i_q": 0.5e-3})
    still = log(delay={"i_q": 0.5e-3})
    assert delayed["Z.i_q"] - still["Z.i_q"] == pytest.approx(plain["Z.i_q"] - log()["Z.i_q"], abs=1e-13)


def test_what_cannot_be_logged_again() -> None:
    with pytest.raises(InputError, match=r"interval: 0\.0021 s is no whole multiple of the signals' cycle"):
        log(interval=2.1e-3)
    with pytest.raises(InputError, match=r"no column 'Z\.M_a'"):
        log(signals=("M_a",))


# -- files ------------------------------------------------------------------------------------------------------------

SHORT = f"""name: short
machine: {MACHINE}
motions:
  - {{kind: sine, axis: Z, moves: [{{amplitude: 50 um, frequency: 10 Hz, periods: 3}}]}}
"""


def load(tmp_path: Path, text: str, *overrides: str) -> scenario.Scenario:
    file = tmp_path / "s.yaml"
    file.write_text(text, encoding="utf-8")
    return scenario.load(file, overrides)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("interval: 2.1 ms", "logging.interval: 0.0021 s is no whole multiple of the control cycle, 0.000125 s"),
        ("interval: 2", "logging.interval: 2 has no unit; a time is expected"),
        ("axes: [Q]", "logging.axes.0: the machine has no axis 'Q'"),
        ("axes: [Z, Z]", "logging: axes: Z twice"),
        ("signals: [x_a, iq]", "logging.signals.1: 'iq' is not allowed here; did you mean 'i_q'?"),
        ("noise: {iq: 1 A}", "logging.noise.iq: unknown key; did you mean 'i_q'?"),
        ("noise: {i_q: 5 V}", "logging.noise.i_q: '5 V' is a voltage; a current is expected"),
        ("noise: {i_q: -5 %}", "logging.noise.i_q: -5 % is outside the allowed range: at least 0 %"),
        ("noise: {i_q: -1 A}", "logging.noise.i_q: -1 A is outside the allowed range: at least 0 A"),
        ("noise: {i_q: 5}", "logging.noise.i_q: 5 has no unit; a current is expected"),
        ("noise: {x_a: 5 %}", "logging.noise.x_a: '5 %' is a plain number; a length is expected"),
        ("noise: {u_q: 1 V}", "logging.noise.u_q: u_q is not logged; signals: x_s, x_a, n_a, i_q"),
        ("quantisation: {x_a: 0 nm}", "logging.quantisation.x_a: 0 nm is outside the allowed range: more than 0 m"),
        ("quantisation: {x_a: 1 A}", "logging.quantisation.x_a: '1 A' is a current; a length is expected"),
        ("delay: {i_q: -1 ms}", "logging.delay.i_q: -1 ms is outside the allowed range: at least 0 s"),
        ("delay: 1 ms", "logging.delay: '1 ms'; a group of keys is expected"),
        ("seed: -1", "logging.seed: -1 is outside the allowed range: at least 0"),
        ("sed: 1", "logging.sed: unknown key; did you mean 'seed'?"),
    ],
)
def test_mistakes_are_named_with_their_line(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        load(tmp_path, f"{SHORT}logging:\n  {line}\n")
    (problem,) = caught.value.problems
    where = 5 if message.startswith("logging: ") else 6
    assert problem.startswith(f"{tmp_path / 's.yaml'}:{where}: {message}")


def test_axes_default_to_those_that_move(tmp_path: Path) -> None:
    assert logged_axes(load(tmp_path, SHORT + "logging: {}")) == ("Z",)
    with pytest.raises(InputError, match=r"s\.yaml:5: logging: no motion moves an axis; name the axes"):
        load(tmp_path, SHORT.replace("sine, axis: Z, moves", "dwell, duration: 1 s} #") + "logging: {}")


def test_all_keys_can_be_set_from_outside(tmp_path: Path) -> None:
    settings = ["logging.noise.i_q=5 %", "logging.delay.i_q=0.5 ms", "logging.quantisation.x_a=1 nm", "logging.seed=8"]
    found = load(tmp_path, SHORT, *settings).logging
    assert found is not None
    assert found.noise.i_q == scenario.Level(0.05, relative=True)
    assert (found.delay.i_q, found.quantisation.x_a, found.seed) == (0.5e-3, 1e-9, 8)


def test_every_recorded_signal_of_an_axis_can_be_logged() -> None:
    names = {name.partition(".")[2] for name in recorded_columns(described(Move(by={"Z": 1.0}, feed=1.0)))
             if name.startswith("Z.")}  # fmt: skip
    assert set(Signal.__args__) == names


def test_a_run_leaves_its_log_and_can_be_logged_again(tmp_path: Path, fmus: Path) -> None:
    settings = "logging: {noise: {i_q: 1 %}, delay: {i_q: 0.3 ms}, quantisation: {x_a: 1 nm}, seed: 5}\n"
    loaded = load(tmp_path, SHORT + settings + "recording: {interval: 125 us}\n")
    run = judge_run(cosim.run(loaded, fmus=fmus))
    assert run.log is not None
    assert run.fine is not None
    assert run.log.names == ("Z.x_s", "Z.x_a", "Z.n_a", "Z.i_q")
    assert {name: run.log.unit(name) for name in run.log} == {
        "Z.x_s": "m", "Z.x_a": "m", "Z.n_a": "rad/s", "Z.i_q": "A"}  # fmt: skip
    # result.csv is undisturbed, and what the log was made of
    for name in run.log:
        np.testing.assert_array_equal(run.fine[name], run.trace[name])
    np.testing.assert_array_equal(run.log["Z.n_a"], run.trace["Z.n_a"][::16])
    same = logged(run)
    for name in run.log:
        np.testing.assert_array_equal(same[name], run.log[name])
    clean = logged(run, Logging(axes=("Z",), delay=scenario.Delay(i_q=0.3e-3)))
    expected = np.interp(np.maximum(clean.time - 0.3e-3, 0), run.trace.time, run.trace["Z.i_q"])
    assert clean["Z.i_q"] == pytest.approx(expected, abs=1e-12)

    write_run(run, {}, tmp_path / "out")
    written = read_csv(tmp_path / "out" / "log.csv")
    for name in run.log:
        np.testing.assert_array_equal(written[name], run.log[name])
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert "log.csv" in summary["files"]
    assert summary["scenario"]["logging"] == {
        "interval": {"value": 2e-3, "unit": "s"},
        "columns": ["Z.x_s", "Z.x_a", "Z.n_a", "Z.i_q"],
        "noise": {"i_q": {"value": 0.01, "unit": "of the RMS"}},
        "quantisation": {"x_a": {"value": 1e-9, "unit": "m"}},
        "delay": {"i_q": {"value": 0.3e-3, "unit": "s"}},
        "seed": 5,
    }
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "noise i_q 1 % of its RMS; steps x_a 1e-09 m; delay i_q 300 µs; seed 5" in text


def test_without_logging_nothing_is_logged_and_an_older_log_goes(tmp_path: Path, fmus: Path) -> None:
    first = judge_run(cosim.run(load(tmp_path, SHORT + "logging: {}"), fmus=fmus))
    write_run(first, {}, tmp_path / "out")
    assert (tmp_path / "out" / "log.csv").is_file()
    run = judge_run(cosim.run(load(tmp_path, SHORT), fmus=fmus))
    assert (run.log, run.fine) == (None, None)
    for name in run.trace:
        np.testing.assert_array_equal(run.trace[name], first.trace[name])
    with pytest.raises(InputError, match="the run has no signals at the control cycle"):
        logged(run)
    write_run(run, {}, tmp_path / "out")
    assert not (tmp_path / "out" / "log.csv").exists()


def test_strokes_through_the_whole_system_show_the_stationary_friction_in_the_log(tmp_path: Path, fmus: Path) -> None:
    """K_t i_q at constant speed is the friction torque of Eq. 7 and sigma_2 n, in both directions."""
    loaded = load(
        tmp_path,
        f"name: s\nmachine: {MACHINE}\nmotions:\n  - {{kind: constant_speed, axis: Z, jerk: 10 m/s^3,"
        " speeds: [500 mm/min, 5 m/min]}\nlogging: {}\nrecording: {variables: [Z.x_a]}\n",
    )
    run = judge_run(cosim.run(loaded, fmus=fmus))
    geometry = run.program.segments[0].geometry
    assert isinstance(geometry, Strokes)
    assert run.log is not None
    axis = loaded.machine.axes["Z"]
    friction = axis.friction
    for stroke in geometry.strokes:
        # the bed rocks at 21 Hz with 6 % damping: after 0.4 s its ringing is down to 4 %, and its mean to far less
        log = run.log.between(stroke.steady[0] + 0.4, stroke.steady[1] - 0.01)
        n = abs(stroke.speed) / axis.I_P
        stribeck = (friction.F_S - friction.F_C) * np.exp(-n / friction.v_s) + friction.F_log * np.log1p(
            n / friction.v_log
        )
        torque = np.sign(stroke.speed) * (friction.F_C + stribeck + friction.sigma_2 * n)
        assert len(log) > 250
        assert axis.drive.K_t * log["Z.i_q"].mean() == pytest.approx(torque, rel=3e-4)
        assert log["Z.n_a"].mean() == pytest.approx(stroke.speed / axis.I_P, rel=1e-4)
