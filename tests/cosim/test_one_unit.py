"""The whole machine as one unit against the master's own runs, which exchange the single units: bit for bit."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    calloc,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    free,
)
from fmpy.model_description import ModelDescription

from feedsim import load_scenario
from feedsim.foundation.errors import InputError
from feedsim.scenario import Scenario
from feedsim.scenario.model import SCHEMES
from feedsim.simulation.cosim.run import run
from feedsim.simulation.cosim.whole import pack_whole
from feedsim.simulation.judge import JudgedRun, judge_run
from feedsim.simulation.nc import Program, plan

ROOT = Path(__file__).resolve().parents[2]
SIGNALS = ("x_a", "n_a", "M_a", "M_fr", "x_e", "n_s", "n_ref", "M_s", "i_d", "i_q", "u_d", "u_q")
LOCALS = {"z": "friction.z", "c": "friction.c", "k": "friction.k", "lambda": "friction.lambda"}
TOOL = ("tool.x_X", "tool.x_Y", "tool.x_Z", "tcp.x_X", "tcp.x_Y", "tcp.x_Z")


@dataclass(frozen=True)
class Packed:
    """A scenario, its run by the master at the control cycle, and the same as one unit."""

    scenario: Scenario
    result: JudgedRun
    archive: Path

    @property
    def names(self) -> dict[str, str]:
        """Column of the run -> variable of the unit, of all signals that a run has."""
        axes = self.scenario.machine.axes
        own = {f"{axis}.{name}": f"{axis}.{name}" for axis in axes for name in SIGNALS}
        shown = {f"{axis}.{name}": f"{axis}.{inside}" for axis in axes for name, inside in LOCALS.items()}
        return own | shown | {name: name for name in TOOL}


def packed(folder: Path, fmus: Path, name: str, *changes: str) -> Packed:
    scenario = load_scenario(ROOT / "scenarios" / f"{name}.yaml", changes)
    cycle = scenario.machine.cycles.T_c
    scenario = load_scenario(ROOT / "scenarios" / f"{name}.yaml", [*changes, f"recording.interval={cycle!r} s"])
    program = plan(scenario)
    archive = folder / "machine.fmu"
    pack_whole(fmus / "machine.fmu", archive, scenario.machine, coupling=scenario.coupling, program=program)
    return Packed(scenario, judge_run(run(scenario, program=program, fmus=fmus)), archive)


def callbacks(said: list[str]) -> fmi2CallbackFunctions:
    def log(_environment: object, _name: bytes, _status: int, category: bytes, message: bytes) -> None:
        if category in (b"logStatusWarning", b"logStatusError"):
            said.append(message.decode())

    made = fmi2CallbackFunctions()
    made.logger = fmi2CallbackLoggerTYPE(log)
    made.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
    made.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
    return made


class Unit:
    """The packed unit, stepped call by call."""

    def __init__(self, case: Packed, folder: Path, said: list[str] | None = None) -> None:
        """said: takes the unit's warnings and errors."""
        folder = Path(fmpy.extract(str(case.archive), str(folder)))
        self.description: ModelDescription = fmpy.read_model_description(str(folder))
        self.references = {each.name: each.valueReference for each in self.description.modelVariables}
        self.slave = FMU2Slave(
            guid=self.description.guid, unzipDirectory=str(folder), instanceName="machine",
            modelIdentifier=self.description.coSimulation.modelIdentifier,
        )  # fmt: skip
        self.callbacks = callbacks(said if said is not None else [])
        self.slave.instantiate(loggingOn=said is not None, callbacks=self.callbacks)
        self.begin()
        self.names = case.names

    def begin(self) -> None:
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        self.time = 0.0

    def get(self, names: Iterable[str]) -> list[float]:
        values: list[float] = self.slave.getReal([self.references[name] for name in names])
        return values

    def set(self, values: dict[str, float]) -> None:
        self.slave.setReal([self.references[name] for name in values], list(values.values()))

    def step_to(self, time: float) -> None:
        self.slave.doStep(currentCommunicationPoint=self.time, communicationStepSize=time - self.time)
        self.time = time

    def close(self) -> None:
        self.slave.terminate()
        self.slave.freeInstance()


def assert_same(case: Packed, unit: Unit, instants: Sequence[float]) -> int:
    """Step from instant to instant; at each that is one of the run's, everything is the run's. Returns how many are."""
    cycle = case.scenario.machine.cycles.T_c
    met = 0
    for time in instants:
        unit.step_to(float(time))
        row = round(time / cycle)
        if abs(time - row * cycle) < 1e-9:
            met += 1
            expected = [float(case.result.trace[column][row]) for column in case.names]
            assert unit.get(case.names.values()) == expected, f"at {time:.9g} s"
    return met


@pytest.fixture(scope="module")
def z_move(tmp_path_factory: pytest.TempPathFactory, fmus: Path) -> Packed:
    return packed(tmp_path_factory.mktemp("z"), fmus, "z_positioning")


@pytest.fixture(scope="module")
def circle(tmp_path_factory: pytest.TempPathFactory, fmus: Path) -> Packed:
    return packed(tmp_path_factory.mktemp("circle"), fmus, "xz_circle")


@pytest.mark.parametrize("step", [125e-6, 1e-3, 10e-3, 7.3e-3])
@pytest.mark.parametrize("which", ["z_move", pytest.param("circle", marks=pytest.mark.extensive)])
def test_an_importer_gets_the_run_at_every_step(which: str, step: float, request: pytest.FixtureRequest) -> None:
    case: Packed = request.getfixturevalue(which)
    stop = float(case.result.trace.time[-1])
    found = fmpy.simulate_fmu(
        str(case.archive), stop_time=stop, step_size=step, output_interval=step, output=list(case.names.values())
    )
    cycle = case.scenario.machine.cycles.T_c
    rows = np.round(found["time"] / cycle).astype(int)
    common = (np.abs(found["time"] - rows * cycle) < 1e-9) & (rows < len(case.result.trace.time))
    assert common.sum() >= min(stop / step, stop / cycle) // 20
    for column, name in case.names.items():
        np.testing.assert_array_equal(found[name][common], case.result.trace[column][rows[common]], err_msg=column)


def random_instants(seed: int, stop: float, cycle: float) -> list[float]:
    """Steps from a nanosecond to 20 ms, in every second one back onto the grid of the cycles."""
    random = np.random.default_rng(seed)
    time, found = 0.0, []
    for on_grid in itertools.cycle((False, True)):
        time += float(10 ** random.uniform(-9, -1.7))
        time = np.ceil(time / cycle) * cycle if on_grid else time
        if time > stop:
            return found
        found.append(time)
    raise AssertionError


@pytest.mark.parametrize("seed", range(3))
def test_random_steps_change_nothing(z_move: Packed, tmp_path: Path, seed: int) -> None:
    unit = Unit(z_move, tmp_path)
    assert assert_same(z_move, unit, random_instants(seed, 2.0, 125e-6)) > 100
    unit.close()


@pytest.mark.parametrize("scheme", list(SCHEMES))
def test_every_scheme_is_the_masters(tmp_path: Path, fmus: Path, scheme: str) -> None:
    case = packed(tmp_path, fmus, "z_positioning", f"coupling.scheme={scheme}", "coupling.substeps=2")
    unit = Unit(case, tmp_path / "unit")
    assert_same(case, unit, np.arange(1, 110) * 10e-3)
    unit.close()


@pytest.mark.parametrize(
    "changes",
    [
        ("machine.axes.*.drive.ideal_current_loop=true",),
        ("machine.axes.*.drive.ramp_speed_setpoint=false", "machine.cycles.control=250 us"),
        ("machine.axes.Z.drive.speed_window=4", "machine.axes.Z.constant_load=3 N.m"),
        ("machine.axes.Z.drive.symmetry_lag=true", "machine.axes.Z.friction.asymmetry=0.1"),
    ],
)
def test_parameters_are_the_machine_files(tmp_path: Path, fmus: Path, changes: tuple[str, ...]) -> None:
    case = packed(tmp_path, fmus, "z_positioning", *changes)
    unit = Unit(case, tmp_path / "unit")
    assert_same(case, unit, np.arange(1, 100) * 10e-3)
    unit.close()


def test_another_machine_has_other_axes(tmp_path: Path, fmus: Path) -> None:
    case = packed(tmp_path, fmus, "one_axis")
    unit = Unit(case, tmp_path / "unit")
    axes = list(case.scenario.machine.axes)
    assert {name.partition(".")[0] for name in unit.references if name.endswith(".x_a")} == set(axes)
    assert_same(case, unit, np.arange(1, 30) * 10e-3)
    unit.close()


def setpoints_at(program: Program, axes: Iterable[str], i: int) -> dict[str, float]:
    values = {f"{axis}.x_s": float(program.x_s[axis][i]) for axis in axes}
    return values | {f"{axis}.n_ffw": float(program.n_ffw[axis][i]) for axis in axes}


def outside(unit: Unit, given: dict[str, float], *, delay: float = 0.0, inside: bool = False) -> None:
    """Begin anew with setpoints from outside, those `given` to begin with.

    delay: of the path that they run on. inside: the unit forms n_ffw.
    """
    unit.slave.reset()
    unit.slave.setupExperiment(startTime=0.0)
    unit.slave.enterInitializationMode()
    flags = [unit.references[name] for name in ("motion.built_in", "setpoints.n_ffw_inside")]
    unit.slave.setBoolean(flags, [False, inside])
    unit.set({"setpoints.delay": delay} | given)
    unit.slave.exitInitializationMode()
    unit.time = 0.0


def test_setpoints_from_outside_at_the_position_cycle_are_the_motion_inside(z_move: Packed, tmp_path: Path) -> None:
    machine, program = z_move.scenario.machine, z_move.result.program
    unit = Unit(z_move, tmp_path)
    outside(unit, setpoints_at(program, machine.axes, 0))
    for i in range(1000):
        unit.set(setpoints_at(program, machine.axes, i))
        assert_same(z_move, unit, [(i + 1) * machine.cycles.T_pos])
    unit.close()


@pytest.mark.parametrize("inside", [False, True])
def test_at_the_position_cycle_with_slopes_it_is_the_run(circle: Packed, tmp_path: Path, inside: bool) -> None:
    """The shipped circle at 1 ms; n_ffw handed over, and formed inside from the slope of x_s."""
    axes, program = circle.scenario.machine.axes, circle.result.program
    found = []
    unit = Unit(circle, tmp_path)
    outside(unit, setpoints_at(program, axes, 0), inside=inside)
    inputs = [unit.references[f"{axis}.x_s"] for axis in axes]
    for i in range(len(program.time) - 1):
        given = setpoints_at(program, axes, i)
        unit.set({name: value for name, value in given.items() if not (inside and "n_ffw" in name)})
        slopes = [given[f"{axis}.n_ffw"] * axes[axis].I_P for axis in axes]
        unit.slave.setRealInputDerivatives(inputs, [1] * len(inputs), slopes)
        unit.step_to((i + 1) * 1e-3)
        found.append(unit.get(f"{axis}.x_a" for axis in axes))
    unit.close()
    run = np.column_stack([circle.result.trace[f"{axis}.x_a"][8::8] for axis in axes])
    assert np.abs(np.array(found) - run[: len(found)]).max() < 1e-9


def test_a_saved_state_brings_everything_back(z_move: Packed, tmp_path: Path) -> None:
    """Inside a cycle and at its end, in memory and as bytes, into the same instance and into another one."""
    unit, other = (Unit(z_move, tmp_path / name) for name in ("one", "other"))
    for at in (0.4, 0.40003):
        unit.step_to(at)
        state = unit.slave.getFMUstate()
        content = unit.slave.serializeFMUstate(state)
        assert_same(z_move, unit, at // 0.01 * 0.01 + np.arange(1, 20) * 0.01)
        shown = unit.get(z_move.names.values())
        for again in (unit, other):
            bytes_state = again.slave.deSerializeFMUstate(content)
            again.slave.setFMUstate(bytes_state)
            again.slave.freeFMUstate(bytes_state)
            again.time = at
            assert_same(z_move, again, at // 0.01 * 0.01 + np.arange(1, 20) * 0.01)
            assert again.get(z_move.names.values()) == shown
        unit.slave.setFMUstate(state)
        unit.slave.freeFMUstate(state)
        unit.time = at
    for each in (unit, other):
        each.close()


def test_reset_begins_anew(z_move: Packed, tmp_path: Path) -> None:
    unit = Unit(z_move, tmp_path)
    unit.step_to(0.3333)
    unit.slave.reset()
    unit.begin()
    assert_same(z_move, unit, np.arange(1, 30) * 0.02)
    unit.close()


def test_inside_a_cycle_outputs_are_smooth(z_move: Packed, tmp_path: Path) -> None:
    """Sixteen points to a cycle: no jump at its ends, and the cubic is that of position and speed there."""
    unit = Unit(z_move, tmp_path)
    unit.step_to(0.2)  # Z accelerates
    times = 0.2 + np.arange(1, 33) * 125e-6 / 16
    rows = []
    for time in times:
        unit.step_to(float(time))
        rows.append(unit.get(["Z.x_a", "Z.n_a", "Z.M_a", "tool.x_Z"]))
    x, n, M, tool = np.array(rows).T
    lead = z_move.scenario.machine.axes["Z"].I_P
    # x_a moves with the rotor but for the elasticity of the feed drive, whose speed is far below a tenth of the axis's.
    np.testing.assert_allclose(np.diff(x), lead * (n[1:] + n[:-1]) / 2 * np.diff(times), rtol=0.1)
    assert np.abs(np.diff(x, 3)).max() < 1e-12
    assert np.abs(np.diff(tool, 3)).max() < 1e-12
    for start in (0, 16):  # linear from the first to the last point of a cycle
        inside = slice(start, start + 16)
        np.testing.assert_allclose(np.diff(M[inside], 2), 0, atol=1e-12)
        np.testing.assert_allclose(np.diff(n[inside], 2), 0, atol=1e-12)
    unit.close()


@pytest.mark.parametrize("step", [10e-3, 7.3e-3, 40e-6])
def test_nothing_is_missed_between_communication_points(z_move: Packed, tmp_path: Path, step: float) -> None:
    """Extremes over a step are those of the run's rows in it; the torque's at its end besides, where no row may be."""
    unit = Unit(z_move, tmp_path)
    trace, cycle = z_move.result.trace, 125e-6
    names = ["Z.x_e_min", "Z.x_e_max", "Z.M_a_min", "Z.M_a_max", "Z.M_a"]
    start = 0.1  # the axis accelerates
    unit.step_to(start)
    for k in range(1, 12):
        begin, end = start + (k - 1) * step, start + k * step
        unit.step_to(end)
        low_x, high_x, low_M, high_M, shown = unit.get(names)
        first, behind = (int(np.ceil(time / cycle - 1e-6)) for time in (begin, end))
        rows = np.arange(first, behind)
        torques = [*trace["Z.M_a"][rows], shown]
        # the torque at an instant, M_a(t_k+1) less slope x T_c, is rounded once more
        assert (low_M, high_M) == pytest.approx((min(torques), max(torques)), rel=1e-14)
        # x_e of the run's row k + 1 is that of instant k
        errors = trace["Z.x_e"][rows + 1] if len(rows) else trace["Z.x_e"][[behind]]
        assert (low_x, high_x) == (errors.min(), errors.max())
    unit.close()


def test_held_setpoints_at_long_steps_are_told(z_move: Packed, tmp_path: Path) -> None:
    said: list[str] = []
    unit = Unit(z_move, tmp_path, said)
    unit.step_to(0.01)
    assert not said  # the motion is inside
    outside(unit, setpoints_at(z_move.result.program, z_move.scenario.machine.axes, 0))
    unit.step_to(1e-3)
    assert not said  # as long as the position cycle
    inputs = [unit.references[name] for name in ("X.x_s", "Y.x_s", "Z.x_s")]
    unit.slave.setRealInputDerivatives(inputs, [1] * 3, [0.0] * 3)
    unit.step_to(11e-3)
    assert not said
    unit.step_to(21e-3)
    unit.step_to(31e-3)
    assert len(said) == 1
    assert "steps of 0.01" in said[0]
    assert "position cycle, 0.001 s" in said[0]
    unit.close()


def test_a_step_of_more_cycles_than_anybody_means_is_refused(z_move: Packed, tmp_path: Path) -> None:
    said: list[str] = []
    unit = Unit(z_move, tmp_path, said)
    with pytest.raises(FMICallException):
        unit.step_to(2e5)
    unit.slave.freeInstance()
    assert "1600000000 sample instants, T_c = 0.000125 s apart; allowed are at most 1e+09" in said[0]


def test_what_cannot_be_packed_leaves_no_file(tmp_path: Path, fmus: Path, z_move: Packed) -> None:
    machine = z_move.scenario.machine
    out = tmp_path / "out.fmu"
    with pytest.raises(InputError, match=r"missing\.fmu"):
        pack_whole(tmp_path / "missing.fmu", out, machine)
    with pytest.raises(InputError, match=r"has resources of the kind 'machine', those given are of the kind"):
        pack_whole(fmus / "plant.fmu", out, machine)
    assert not out.exists()
