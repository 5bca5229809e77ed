"""A drive and a friction unit of another maker in a scenario: the motion is that of an independent calculation, and the
shipped units under other names give the bits of the shipped ones."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from feedsim import scenario
from feedsim.foundation.errors import InputError, SimulationError
from feedsim.scenario.study import load_study
from feedsim.simulation import cosim, judge
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.roles import start_value
from feedsim.simulation.judge import JudgedRun, judge_run
from foreign import acme
from foreign.conftest import Libraries
from ssp_helpers import SHORT, short_scenario

Floats = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
MOTION = """
name: another maker's axis
machine: {machine}
motions:
  - {{kind: move, by: {{X: 10 mm}}, feed: 3000 mm/min}}
  - {{kind: dwell, duration: 200 ms}}
recording: {{interval: 1 ms, variables: [X.x_s, X.n_ffw, X.x_a, X.n_a, X.M_a, X.n_s, X.torque_limited, X.M_fr]}}
"""
RPM, NMM = math.pi / 30, 1e-3
PARAMETERS = {"Kv": "38 1/s", "Tn": 0.04e3, "Coulomb": "0.0085 N.m", "Knee": 25}


@pytest.fixture
def units(libraries: Libraries, tmp_path: Path) -> Path:
    """A folder with both archives and the scenario, in which they are named relative to it."""
    acme.archive(tmp_path / "acme_drive.fmu", "drive", libraries.drive, acme.DRIVE)
    acme.archive(tmp_path / "acme_friction.fmu", "friction", libraries.friction, acme.FRICTION)
    (tmp_path / "s.yaml").write_text(MOTION.format(machine=ROOT / "scenarios" / "machines" / "emps"), encoding="utf-8")
    return tmp_path


def mapped(folder: Path, *, substeps: int = 1) -> list[str]:
    """The settings that put both units on the axis."""
    drive = {"fmu": str(folder / "acme_drive.fmu"), **acme.MAPPED_DRIVE,
             "parameters": {key: PARAMETERS[key] for key in ("Kv", "Tn")}}  # fmt: skip
    friction = {"fmu": str(folder / "acme_friction.fmu"), **acme.MAPPED_FRICTION,
                "parameters": {key: PARAMETERS[key] for key in ("Coulomb", "Knee")}}  # fmt: skip
    return [
        f"machine.axes.X.drive={drive}", f"machine.axes.X.friction={friction}", f"coupling.substeps={substeps}",
    ]  # fmt: skip


class Drive:
    """The law of drive.c in SI units: sampled, its torque held over the cycle."""

    def __init__(self) -> None:
        self.integral = 0.0

    def __call__(self, x_s: float, n_ffw: float, x: float, n: float, h: float) -> float:
        K_v, K_p, T_n, lead, limit = 38.0, 0.1 * NMM / RPM, 0.040, 2.5e-3, 0.140
        error = K_v * (x_s - x) / (lead / (2 * math.pi)) + n_ffw - n
        self.integral += K_p * error * h / T_n
        return min(max(K_p * error + self.integral, -limit), limit)


def friction(n: Floats | float) -> Any:
    """The law of friction.c in SI units."""
    return 0.0085 * np.tanh(n / (25 * RPM)) + 0.003 * NMM / RPM * n


def held(run: JudgedRun, substeps: int) -> dict[str, Floats]:
    """The motion where friction is held over an exchange step: a rigid axis under a constant torque, in closed form."""
    machine = run.scenario.machine
    axis, T_c = machine.axes["X"], machine.cycles.T_c
    J = 1 / 257.70868327312286**2
    h = T_c / substeps
    x, n, M_fr, drive = 0.0, 0.0, 0.0, Drive()
    rows: list[tuple[float, ...]] = []
    M_a = 0.0
    for x_s, n_ffw in zip(run.program.x_s["X"], run.program.n_ffw["X"], strict=True):
        rows.append((x, n, M_a, M_fr))
        M_a = drive(float(x_s), float(n_ffw), x, n, T_c)
        for _ in range(substeps):
            a = (M_a - M_fr - axis.M_0) / J
            x += axis.I_P * (n * h + a * h * h / 2)
            n += a * h
            M_fr = float(friction(n))
    columns = np.array(rows).T
    return dict(zip(("X.x_a", "X.n_a", "X.M_a", "X.M_fr"), columns, strict=True))


def exact(run: JudgedRun) -> Floats:
    """The position where friction acts at every instant, by an adaptive integration."""
    machine = run.scenario.machine
    axis, T_c, J = machine.axes["X"], machine.cycles.T_c, 1 / 257.70868327312286**2
    state, drive, found = np.zeros(2), Drive(), []
    for x_s, n_ffw in zip(run.program.x_s["X"], run.program.n_ffw["X"], strict=True):
        found.append(state[0])
        M_a = drive(float(x_s), float(n_ffw), state[0], state[1], T_c)

        def slope(_: float, y: Floats, M_a: float = M_a) -> list[float]:
            return [axis.I_P * y[1], (M_a - float(friction(y[1])) - axis.M_0) / J]

        state = solve_ivp(slope, (0, T_c), state, rtol=1e-9, atol=[1e-13, 1e-9]).y[:, -1]
    return np.array(found)


@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize("substeps", [1, 4])
def test_the_motion_is_that_of_the_two_laws(units: Path, fmus: Path, substeps: int, native: bool) -> None:
    """Rounding alone is between the two: 500 cycles of some 30 operations, each within 1.1e-16, in a loop that forgets
    within 50 ms, leave below 1e-12 of the largest value."""
    done = judge_run(
        cosim.run(scenario.load(units / "s.yaml", mapped(units, substeps=substeps)), fmus=fmus, native=native)
    )
    for name, wanted in held(done, substeps).items():
        assert np.max(np.abs(wanted)) > 0
        assert np.allclose(done.trace[name], wanted, rtol=0, atol=1e-12 * np.max(np.abs(wanted))), name


def test_the_exchange_is_of_first_order(units: Path, fmus: Path) -> None:
    """Against friction that acts at every instant: halving the exchange step halves the error."""
    errors = []
    for substeps in (4, 8, 16):
        done = judge_run(cosim.run(scenario.load(units / "s.yaml", mapped(units, substeps=substeps)), fmus=fmus))
        errors.append(float(np.max(np.abs(done.trace["X.x_a"] - exact(done)))))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 1) < 0.1), (errors, orders)


def test_what_is_recorded_and_told(units: Path, fmus: Path) -> None:
    """Columns are in SI units; what stands for no variable is no column; a run says what it cannot know, once."""
    loaded = scenario.load(units / "s.yaml", [*mapped(units), "recording.variables=null"])
    done = judge_run(cosim.run(loaded, fmus=fmus))
    own = [name for name in done.trace if name.startswith("X.")]
    assert own == [f"X.{each}" for each in ("x_s", "n_ffw", "x_a", "n_a", "M_a", "n_s", "torque_limited", "M_fr")]
    assert [done.trace.unit(f"X.{name}") for name in ("M_a", "n_s", "M_fr")] == ["N.m", "rad/s", "N.m"]
    told = {finding.code: finding.text for finding in done.warnings}
    assert len(told) == len(done.warnings), "each once"
    for code, words in (
        ("input-not-driven", "drive acme_drive.fmu: nothing drives Override (100)"),
        ("limit-not-reported", "drive acme_drive.fmu: no variable stands for voltage_limited"),
        ("slope-missing", "friction acme_friction.fmu: knows no slope of its speed nor of its torque"),
        ("exchange-not-judged", "axis X"),
        ("loop-not-judged", "axis X"),
    ):
        assert words in told[code], code
    assert done.units["controller_X"]["name"] == "acme_drive"


def test_a_limit_of_another_drive_is_told(units: Path, fmus: Path) -> None:
    settings = [*mapped(units), "machine.axes.X.drive.parameters.Limit=30", "recording.variables=[X.x_a]"]
    done = judge_run(cosim.run(scenario.load(units / "s.yaml", settings), fmus=fmus))
    assert ("torque-clipped", "X") in [(finding.code, finding.place) for finding in done.warnings]


def test_its_own_words_are_told_where_it_fails(units: Path, fmus: Path) -> None:
    """With the numbers that it leaves to the importer's logger to print."""
    loaded = scenario.load(units / "s.yaml", [*mapped(units), "machine.axes.X.drive.parameters.Override=-5"])
    with pytest.raises(SimulationError, match=r"unit controller_X, t = 0 s: step .* failed: an override of -5 % is"):
        cosim.run(loaded, fmus=fmus)


def test_an_input_that_no_signal_is_given_to_can_be_held(units: Path, fmus: Path) -> None:
    """Override is in percent: a text is converted, a number is in the unit of the archive."""
    by = {}
    for value in ("50", "'0.5'", "'50 %'"):
        settings = [*mapped(units), f"machine.axes.X.drive.parameters.Override={value}"]
        by[value] = judge_run(cosim.run(scenario.load(units / "s.yaml", settings), fmus=fmus))
        assert not any("Override" in finding.text for finding in by[value].warnings)
    assert all(np.array_equal(by["50"].trace["X.x_a"], other.trace["X.x_a"]) for other in by.values())
    assert not np.array_equal(
        by["50"].trace["X.n_a"],
        cosim.run(scenario.load(units / "s.yaml", mapped(units)), fmus=fmus).trace["X.n_a"],
    )


def test_a_text_may_have_the_unit_by_the_archives_own_name(units: Path) -> None:
    with Archive(units / "acme_drive.fmu") as archive:
        told = [start_value(archive, "Lead", text, {}) for text in (10, "10 mm/turn", "10 mm/rev")]
    assert told == pytest.approx([10, 10, 10], rel=1e-15)


def test_a_study_varies_what_another_archive_calls_its_parameter(units: Path) -> None:
    text = (units / "s.yaml").read_text(encoding="utf-8")
    settings = "".join(f"  {each.replace('=', ': ', 1)}\n" for each in mapped(units))
    (units / "s.yaml").write_text(f"{text}set:\n{settings}", encoding="utf-8")
    key = "machine.axes.X.friction.parameters.Coulomb"
    (units / "study.yaml").write_text(
        "name: s\nscenario: s.yaml\nsampling: {method: grid}\n"
        f"parameters:\n  coulomb: {{key: {key}, values: [8, 9 N.mm]}}\n",
        encoding="utf-8",
    )
    (parameter,) = load_study(units / "study.yaml").parameters
    assert [choice.label for choice in parameter.choices] == ["8", "9 N.mm"]


# --- the shipped units under other names


def other_name(name: str) -> str:
    return "unit_" + name.replace(".", "_of_").upper()


def renamed(fmus: Path, folder: Path, kind: str) -> Path:
    return acme.renamed(fmus / f"{kind}.fmu", folder / f"other_{kind}.fmu", other_name, f"other {kind}")


def settings_of(loaded: scenario.Scenario, axis: str, drive: Path | None, friction: Path | None) -> list[str]:
    """What puts renamed copies of the shipped units on an axis, with the parameters that the machine file gives it."""
    from feedsim.simulation.cosim.roles import controller_parameters

    machine = loaded.machine
    given: dict[str, tuple[Path | None, Any, dict[str, Any]]] = {
        "drive": (drive, scenario.roles.DRIVE, controller_parameters(machine, axis)),
        "friction": (friction, scenario.roles.FRICTION_ROLE, machine.shipped_friction(axis, "a test").parameters()),
    }
    return [
        f"machine.axes.{axis}.{name}=" + str({
            "fmu": str(path),
            "inputs": {signal.name: other_name(signal.name) for signal in role.inputs},
            # x_m is recorded where it is named; the shipped drive, without errors of measuring, does not show it.
            "outputs": {signal.name: other_name(signal.name) for signal in role.outputs if signal.name != "x_m"},
            "parameters": {other_name(key): value for key, value in parameters.items()},
        }).replace("True", "true").replace("False", "false")
        for name, (path, role, parameters) in given.items() if path is not None
    ]  # fmt: skip


@pytest.mark.parametrize("kinds", [("controller",), ("friction",), ("controller", "friction")])
def test_a_shipped_unit_under_other_names_gives_the_same_bits(
    fmus: Path, tmp_path: Path, kinds: tuple[str, ...]
) -> None:
    file = short_scenario(tmp_path, text=SHORT)
    plain = scenario.load(file)
    copies = {kind: renamed(fmus, tmp_path, kind) for kind in kinds}
    settings = settings_of(plain, "Z", copies.get("controller"), copies.get("friction"))
    one, other = judge_run(cosim.run(plain, fmus=fmus)), judge_run(cosim.run(scenario.load(file, settings), fmus=fmus))
    assert list(one.trace) == list(other.trace)
    for name in one.trace:
        assert one.trace.unit(name) == other.trace.unit(name)
        assert np.array_equal(one.trace[name], other.trace[name]), name
    assert one.coupling == other.coupling


@pytest.mark.parametrize("scheme", ["iterated", "jacobi_extrapolated", "gauss_seidel_friction_first", "parallel"])
def test_every_scheme_serves_a_unit_that_can_do_all(fmus: Path, tmp_path: Path, scheme: str) -> None:
    file = short_scenario(tmp_path, text=SHORT)
    settings = settings_of(scenario.load(file), "Z", None, renamed(fmus, tmp_path, "friction"))
    chosen = f"coupling.scheme={scheme}"
    one = judge_run(cosim.run(scenario.load(file, [chosen]), fmus=fmus))
    other = judge_run(cosim.run(scenario.load(file, [chosen, *settings]), fmus=fmus))
    assert all(np.array_equal(one.trace[name], other.trace[name]) for name in one.trace)


@pytest.mark.parametrize("scheme", ["iterated", "jacobi_extrapolated"])
def test_a_scheme_that_does_not_serve_is_refused_with_those_that_do(units: Path, fmus: Path, scheme: str) -> None:
    loaded = scenario.load(units / "s.yaml", [*mapped(units), f"coupling.scheme={scheme}"])
    with pytest.raises(InputError) as caught:
        judge.check(loaded, cosim_program(loaded), fmus=fmus)
    assert f"axis X: friction acme_friction.fmu: coupling scheme {scheme} does not work with it" in str(caught.value)
    assert "extrapolated, gauss_seidel, gauss_seidel_friction_first, jacobi, parallel" in str(caught.value)


def cosim_program(loaded: scenario.Scenario) -> Any:
    from feedsim.simulation import nc

    return nc.plan(loaded)
