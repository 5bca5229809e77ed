"""From experiment to use: the shipped scenarios run on the whole machine, their logs identified, the set put back.

Goals are those of the method: what a user can rely on at a noise of 5 % of the torque.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cramer_rao import Known, least
from numpy.typing import NDArray

from feedsim import analysis, scenario
from feedsim.analysis.compensation import compensate
from feedsim.estimation.identify import Options, identify
from feedsim.estimation.identify.parameters import curve
from feedsim.estimation.identify.record import Record
from feedsim.estimation.identify.result import Estimate, Identification
from feedsim.scenario import Delay, Friction, Level, Noise
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim.friction_law import FrictionLaw
from feedsim.structure.modes import checked_modes
from scenario_helpers import default_machine

Floats = NDArray[np.float64]
Logs = Callable[..., list[Record]]

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
MACHINE = default_machine()
MODES = checked_modes(MACHINE)
SEEDS = 20
LATE = 0.5e-3  # s
# Largest relative error allowed without noise, and at 5 % noise.
STATIONARY = {"F_C": (5e-4, 0.01), "F_S": (5e-4, 0.01), "v_s": (5e-4, 0.03), "F_log": (5e-4, 0.03)}
PRE_SLIDING = {"sigma_0": (1e-3, 0.02), "W": (1e-3, 0.03), "gamma": (1e-3, 0.03), "sigma_1": (5e-3, 0.06)}
GOALS = STATIONARY | PRE_SLIDING


@pytest.fixture(scope="module")
def runs(fmus: Path) -> dict[str, dict[str, cosim.Run]]:
    """Axis -> experiment -> run."""
    return {
        axis: {
            kind: cosim.run(scenario.load(SCENARIOS / f"identify_{axis.lower()}_{kind}.yaml"), fmus=fmus)
            for kind in ("constant", "sine")
        }
        for axis in ("Z", "X")
    }


def logs(runs: dict[str, cosim.Run], axis: str, noise: float = 0.0, delay: float = 0.0, seed: int = 0) -> list[Record]:
    """What a control would have recorded at 500 Hz; noise as a share of the RMS of the torque."""
    described = MACHINE.axes[axis]
    made = []
    for k, (kind, run) in enumerate(runs.items()):
        logging = run.scenario.logging
        assert logging is not None
        changes = {
            "noise": Noise(i_q=Level(noise, relative=True)) if noise else Noise(),
            "delay": Delay(i_q=delay) if delay else Delay(),
            "seed": 2 * seed + k,
        }
        log = cosim.logged(run, logging.model_copy(update=changes))
        torque = described.drive.K_t * log[f"{axis}.i_q"]
        angle, setpoint = (log[f"{axis}.{name}"] / described.I_P for name in ("x_a", "x_s"))
        made.append(Record(kind, log.time, torque, angle=angle, speed=log[f"{axis}.n_a"], setpoint=setpoint))
    return made


def moving_rms(record: Record) -> float:
    """Of the torque [N.m] while the setpoint moves."""
    assert record.setpoint is not None
    return float(np.sqrt(np.mean(record.torque[np.gradient(record.setpoint) != 0] ** 2)))


def found(records: list[Record], law: FrictionLaw, axis: str, delay: float | None = None) -> Identification:
    J = Estimate("J", MODES.J_tot(axis), "kg.m2", "inertia", status="given")
    return identify(records, law, Options(axis, MACHINE.axes[axis].I_P, J=J, modes=MODES, delay=delay))


def errors(result: Identification) -> dict[str, float]:
    """Relative."""
    true = MACHINE.axes[result.axis].friction.parameters()
    return {name: result.estimates[name].value / float(true[name]) - 1 for name in GOALS}


def curve_error(result: Identification) -> float:
    """Largest relative error of the friction over 10 to 20000 mm/min."""
    described = MACHINE.axes[result.axis]
    n: Floats = np.geomspace(10, 20000, 100) / 60e3 / described.I_P
    expected = curve({name: float(value) for name, value in described.friction.parameters().items()}, n)
    values = {name: each.value for name, each in result.estimates.items()}
    return float(np.max(np.abs(curve(values, n) / expected - 1)))


def friction(result: Identification) -> Friction:
    names = Friction.model_fields.keys() - {"identified"}
    return Friction(**{name: result.estimates[name].value for name in names})  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def quiet(runs: dict[str, dict[str, cosim.Run]], law: FrictionLaw) -> dict[str, Identification]:
    """Identified from logs without noise."""
    return {axis: found(logs(runs[axis], axis), law, axis) for axis in ("Z", "X")}


@pytest.fixture(scope="module")
def noisy(runs: dict[str, dict[str, cosim.Run]], law: FrictionLaw) -> list[Identification]:
    """Z axis, 5 % noise, the current logged late by an unknown delay."""
    return [found(logs(runs["Z"], "Z", 0.05, LATE, seed), law, "Z") for seed in range(SEEDS)]


@pytest.mark.parametrize("axis", ["Z", "X"])
def test_logs_without_noise_give_the_parameters(quiet: dict[str, Identification], axis: str) -> None:
    found = errors(quiet[axis])
    assert {name: value for name, value in found.items() if abs(value) > GOALS[name][0]} == {}
    assert curve_error(quiet[axis]) < 5e-4
    # 20 us: a sixth of a control cycle, what sampling at 500 Hz and the first modes leave
    assert abs(quiet[axis].estimates["delay"].value) < 20e-6


@pytest.mark.extensive
def test_every_noisy_log_gives_the_parameters(noisy: list[Identification]) -> None:
    for seed, result in enumerate(noisy):
        off = {name: value for name, value in errors(result).items() if abs(value) > GOALS[name][1]}
        assert off == {}, f"seed {seed}"
        assert curve_error(result) < 0.01, f"seed {seed}"


@pytest.mark.extensive
def test_an_unknown_delay_is_told_and_costs_sigma_1_little(
    noisy: list[Identification], runs: dict[str, dict[str, cosim.Run]], law: FrictionLaw
) -> None:
    """Uncorrected, half a millisecond costs sigma_1 12 %."""
    off = np.array([result.estimates["delay"].value - LATE for result in noisy])
    true = {name: float(value) for name, value in MACHINE.axes["Z"].friction.parameters().items()}
    values = true | {"M_0": 0.0, "J": MODES.J_tot("Z"), "delay": LATE}
    first = noisy[0].stationary
    assert first is not None
    record = logs(runs["Z"], "Z", 0.0, LATE)[1]
    known = Known(first.correlation.names, first.covariance)
    bound = least(
        law, record, values, ("sigma_0", "sigma_1", "W", "gamma", "delay"), 0.05 * moving_rms(record), [known]
    )
    # 1.3: 20 seeds tell a root mean square to 16 %; seen is 1.17
    assert np.sqrt(np.mean(off**2)) < 1.3 * bound["delay"]
    assert abs(np.mean([errors(result)["sigma_1"] for result in noisy])) < 0.02


def test_a_delay_without_noise(runs: dict[str, dict[str, cosim.Run]], law: FrictionLaw) -> None:
    result = found(logs(runs["Z"], "Z", delay=LATE), law, "Z")
    assert result.estimates["delay"].value == pytest.approx(LATE, abs=0.02e-3)
    assert abs(errors(result)["sigma_1"]) < 5e-3


def without_drift(result: Identification, name: str) -> float:
    """Standard deviation less what may have warmed: the machine does not, and stage 2 hardly tells the curve anew."""
    first = result.stationary
    assert first is not None
    variance = result.estimates[name].sigma ** 2
    if name in first.correlation.names:
        at = first.correlation.names.index(name)
        variance -= float(first.drift[at, at])
    return float(np.sqrt(variance))


@pytest.mark.extensive
def test_intervals_hold_what_they_promise(noisy: list[Identification]) -> None:
    """Scatter over the standard deviation that is said; 1.3 and 0.5: of 20 seeds the scatter itself is known to 16 %,
    and stage 1 says somewhat more than its scatter."""
    for name in GOALS:
        seen = np.std([result.estimates[name].value for result in noisy], ddof=1)
        said = np.mean([without_drift(result, name) for result in noisy])
        assert 0.5 < seen / said < 1.3, name


def test_without_the_modes_a_heavy_bed_is_taken_for_friction(
    quiet: dict[str, Identification], runs: dict[str, dict[str, cosim.Run]], law: FrictionLaw
) -> None:
    """X rocks its bed at 22 Hz: at 10 Hz it is 4 % heavier than J_tot, which costs sigma_1 6 %."""
    J = Estimate("J", MODES.J_tot("X"), "kg.m2", "inertia", status="given")
    result = identify(logs(runs["X"], "X"), law, Options("X", MACHINE.axes["X"].I_P, J=J))
    assert 0.04 < abs(errors(result)["sigma_1"]) < 0.08
    assert abs(errors(quiet["X"])["sigma_1"]) < 1e-3


def circle(frictions: dict[str, Friction], fmus: Path) -> dict[str, float]:
    loaded = scenario.load(SCENARIOS / "xz_circle.yaml")
    axes = {
        name: axis.model_copy(update={"friction": frictions.get(name, axis.friction)})
        for name, axis in loaded.machine.axes.items()
    }
    changed = loaded.model_copy(update={"machine": loaded.machine.model_copy(update={"axes": axes})})
    return {name: figure.value for name, figure in analysis.evaluate(cosim.run(changed, fmus=fmus)).items()}


@pytest.mark.extensive
def test_the_identified_set_predicts_the_circle(
    quiet: dict[str, Identification], noisy: list[Identification], fmus: Path
) -> None:
    true = circle({}, fmus)
    for sets in ({axis: friction(each) for axis, each in quiet.items()}, {"Z": friction(noisy[0])}):
        predicted = circle(sets, fmus)
        for name in ("XZ.glitch_X", "XZ.glitch_Z", "XZ.G"):
            assert predicted[name] == pytest.approx(true[name], rel=0.02), name


@pytest.mark.parametrize(("case", "reach"), [("quiet", 0.25), pytest.param("noisy", 0.6, marks=pytest.mark.extensive)])
def test_the_identified_set_compensates_the_circle(
    case: str,
    reach: float,
    quiet: dict[str, Identification],
    request: pytest.FixtureRequest,
    runs: dict[str, dict[str, cosim.Run]],
    law: FrictionLaw,
    fmus: Path,
) -> None:
    """Every quadrant below `reach` [um], from 7.9 and 4.8 um."""
    if case == "quiet":
        sets = {axis: friction(each) for axis, each in quiet.items()}
    else:
        noisy: list[Identification] = request.getfixturevalue("noisy")
        sets = {"Z": friction(noisy[0]), "X": friction(found(logs(runs["X"], "X", 0.05, LATE), law, "X"))}
    loaded = scenario.load(SCENARIOS / "xz_circle.yaml")
    done = compensate(loaded, nc.plan(loaded), frictions=sets, table=False, fmus=fmus)
    for axis in ("X", "Z"):
        assert done.figures[f"before.glitch_{axis}"].value > 4
        assert done.figures[f"after.glitch_{axis}"].value < reach
        assert done.figures[f"after.dip_{axis}"].value > -reach
