"""The machine as one unit with an importer that does not do what everybody does: nothing connected, points a little
behind a control instant, saved states that somebody made up."""

from __future__ import annotations

import itertools
import re
import struct
from collections.abc import Iterator
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from cosim.test_one_unit import ROOT, Packed, Unit, outside, packed
from feedsim import load_scenario
from feedsim.simulation.cosim.whole import pack_whole
from feedsim_packager.variables import fnv1a_64

T_C = 125e-6
POSE = {"X": 0.8, "Y": 0.327, "Z": 0.1}


@pytest.fixture(scope="module")
def z_move(tmp_path_factory: pytest.TempPathFactory, fmus: Path) -> Packed:
    return packed(tmp_path_factory.mktemp("z"), fmus, "z_positioning")


@pytest.fixture
def machine(tmp_path: Path, fmus: Path, z_move: Packed) -> Packed:
    """The default machine with its setpoints as inputs."""
    archive = tmp_path / "inputs.fmu"
    pack_whole(fmus / "machine.fmu", archive, z_move.scenario.machine)
    return Packed(z_move.scenario, z_move.result, archive)


# --- setpoints that nobody gives


def test_setpoints_that_are_not_connected_hold_the_pose(machine: Packed, tmp_path: Path) -> None:
    described = fmpy.read_model_description(str(machine.archive))
    starts = {each.name: each.start for each in described.modelVariables}
    assert {axis: float(starts[f"{axis}.x_s"]) for axis in POSE} == POSE
    said: list[str] = []
    unit = Unit(machine, tmp_path / "unit", said)
    for k in range(1, 101):
        unit.step_to(k * 1e-3)
        # at rest but for the rounding of a position
        assert unit.get(f"{axis}.x_a" for axis in POSE) == pytest.approx(list(POSE.values()), abs=1e-9)
    assert not said
    unit.close()


def test_another_pose_is_where_its_setpoints_begin(tmp_path: Path, fmus: Path) -> None:
    scenario = load_scenario(ROOT / "scenarios/z_positioning.yaml", ["machine.pose.Z=0.25 m"])
    pack_whole(fmus / "machine.fmu", tmp_path / "other.fmu", scenario.machine)
    described = fmpy.read_model_description(str(tmp_path / "other.fmu"))
    starts = {each.name: each.start for each in described.modelVariables}
    assert float(starts["Z.x_s"]) == float(starts["Z.x_0"]) == scenario.machine.pose["Z"]


def far(z_move: Packed, axis: str) -> float:
    """Distance whose speed setpoint times the speed controller's gain is the torque limit [m]."""
    drive = z_move.scenario.machine.axes[axis]
    return float(drive.drive.M_max / (drive.drive.K_p * drive.drive.K_v) * drive.I_P)


def test_first_setpoints_far_from_the_axes_are_told_once(machine: Packed, tmp_path: Path) -> None:
    said: list[str] = []
    unit = Unit(machine, tmp_path / "unit", said)
    outside(unit, {"X.x_s": 0.0, "Z.x_s": 0.0})
    for k in range(1, 20):
        unit.step_to(k * 1e-4)
    assert len(said) == 1
    for told in ("'X.x_s' is 0 m and the axis stands at 0.8 m", "'Z.x_s' is 0 m and the axis stands at 0.1 m"):
        assert told in said[0]
    assert "Y" not in said[0]
    unit.close()


@pytest.mark.parametrize(("share", "told"), [(0.9, 0), (1.1, 1)])
def test_far_is_what_takes_the_drive_to_its_torque_limit(
    machine: Packed, z_move: Packed, tmp_path: Path, share: float, told: int
) -> None:
    said: list[str] = []
    unit = Unit(machine, tmp_path / "unit", said)
    outside(unit, {"Z.x_s": POSE["Z"] + share * far(z_move, "Z")})
    unit.step_to(1e-3)
    assert len(said) == told
    unit.close()


def test_an_axis_without_release_is_not_told_of(machine: Packed, tmp_path: Path) -> None:
    said: list[str] = []
    unit = Unit(machine, tmp_path / "unit", said)
    outside(unit, {"Z.x_s": 0.0})
    unit.slave.setBoolean([unit.references["Z.release"]], [False])
    unit.step_to(1e-3)
    assert not said
    unit.close()


def test_setpoints_far_at_a_later_release_are_told_once(machine: Packed, tmp_path: Path) -> None:
    """A control that goes on while the drive is off. The axis stands: what it coasts is nothing to 50 mm."""
    said: list[str] = []
    unit = Unit(machine, tmp_path / "unit", said)
    outside(unit, {})
    release = [unit.references["Z.release"]]
    unit.slave.setBoolean(release, [False])
    unit.step_to(1e-3)
    unit.set({"Z.x_s": 0.15})
    unit.step_to(2e-3)
    assert not said
    unit.slave.setBoolean(release, [True])
    unit.step_to(3e-3)
    (told,) = said
    assert "released: 'Z.x_s' is 0.15 m and the axis stands at 0.1" in told
    for k, value in enumerate([False, True, False, True]):
        unit.slave.setBoolean(release, [value])
        unit.set({"Z.x_s": 0.0})
        unit.step_to((4 + k) * 1e-3)
    assert len(said) == 1
    unit.close()


def test_setpoints_that_wait_for_the_release_are_not_told_of(machine: Packed, tmp_path: Path) -> None:
    said: list[str] = []
    unit = Unit(machine, tmp_path / "unit", said)
    outside(unit, {})
    release = [unit.references["Z.release"]]
    for k, value in enumerate([False, True, False, True]):
        unit.slave.setBoolean(release, [value])
        unit.step_to((1 + k) * 1e-3)
    assert not said
    unit.close()


def test_a_motion_inside_that_went_on_is_told_of_at_the_release(z_move: Packed, tmp_path: Path) -> None:
    said: list[str] = []
    unit = Unit(z_move, tmp_path / "unit", said)
    release = [unit.references["Z.release"]]
    unit.slave.setBoolean(release, [False])
    unit.step_to(1.5)  # the move is over
    unit.slave.setBoolean(release, [True])
    unit.step_to(1.51)
    (told,) = said
    where = re.search(r"released: 'Z\.motion\.x_s' is (\S+) m and the axis stands at (\S+) m", told)
    assert where is not None
    assert [float(where[1]), float(where[2])] == pytest.approx([0.2, 0.1], abs=1e-6)
    unit.close()


def test_a_new_initialisation_is_told_of_again(machine: Packed, tmp_path: Path) -> None:
    said: list[str] = []
    unit = Unit(machine, tmp_path / "unit", said)
    for again in (1, 2):
        outside(unit, {"Z.x_s": 0.0})
        unit.step_to(1e-3)
        assert len(said) == again
    unit.close()


# --- the setpoint in use


def test_the_setpoint_in_use_is_shown_wherever_it_comes_from(z_move: Packed, tmp_path: Path) -> None:
    unit = Unit(z_move, tmp_path)
    unit.step_to(0.3)
    motion = unit.get(["Z.motion.x_s", "Z.motion.n_ffw"])
    row = round(0.3 / z_move.scenario.machine.cycles.T_pos)
    assert motion[0] == z_move.result.program.x_s["Z"][row]
    outside(unit, {"Z.x_s": 0.1})
    unit.set({"Z.x_s": 0.1001, "Z.n_ffw": 0.25})
    unit.step_to(1e-3)
    assert unit.get(["Z.motion.x_s", "Z.motion.n_ffw"]) == [0.1001, 0.25]
    unit.close()


# --- extremes of the position


@pytest.mark.parametrize("step", [10e-3, 7.3e-3, 40e-6])
def test_extremes_of_the_position_are_those_of_the_run(z_move: Packed, tmp_path: Path, step: float) -> None:
    unit = Unit(z_move, tmp_path)
    column = z_move.result.trace["Z.x_a"]
    peak = float(z_move.result.trace.time[int(np.argmax(column))])
    start = np.floor(peak / step - 6) * step
    unit.step_to(float(start))
    largest = 0.0
    for k in range(1, 13):
        begin, end = start + (k - 1) * step, start + k * step
        unit.step_to(float(end))
        low, high, shown = unit.get(["Z.x_a_min", "Z.x_a_max", "Z.x_a"])
        first, behind = (int(np.ceil(time / T_C - 1e-6)) for time in (begin, end))
        positions = [*column[first:behind], shown]
        assert (low, high) == (min(positions), max(positions))
        largest = max(largest, high)
    assert largest >= column.max()
    unit.close()


def test_the_overshoot_is_seen_at_any_step(z_move: Packed, tmp_path: Path) -> None:
    found = fmpy.simulate_fmu(
        str(z_move.archive), stop_time=2.0, step_size=10e-3, output_interval=10e-3, output=["Z.x_a", "Z.x_a_max"]
    )
    assert found["Z.x_a_max"].max() == z_move.result.trace["Z.x_a"].max() > found["Z.x_a"].max()


# --- points a little behind a control instant


@pytest.mark.parametrize("behind", [1e-9, 0.2e-6, 0.7e-6, 1.24e-6])
def test_a_point_a_little_behind_an_instant_shows_that_point(z_move: Packed, tmp_path: Path, behind: float) -> None:
    """While the axis moves at speed: what the cubic of the next cycle has there, which a finer step shows."""
    at = 0.2
    one, other = (Unit(z_move, tmp_path / name) for name in ("one", "other"))
    one.step_to(at + behind)
    other.step_to(at)
    other.step_to(at + behind)  # a step of its own: the cycle that begins at the instant is worked in it
    x, n, M, tool = one.get(["Z.x_a", "Z.n_a", "Z.M_a", "tool.x_Z"])
    x_fine, n_fine, M_fine, tool_fine = other.get(["Z.x_a", "Z.n_a", "Z.M_a", "tool.x_Z"])
    assert abs(n_fine * z_move.scenario.machine.axes["Z"].I_P) > 0.02  # m/s: at rest nothing would be seen
    # a few units in the last place of a position of 0.1 m; 1.24 us are 50 nm of way
    assert x == pytest.approx(x_fine, rel=0, abs=1e-15)
    assert tool == pytest.approx(tool_fine, rel=0, abs=1e-15)
    # These are linear over a cycle: the bend at the instant, as the run's rows about it have it.
    for name, shown, fine in (("Z.n_a", n, n_fine), ("Z.M_a", M, M_fine)):
        before, now, then = z_move.result.trace[name][round(at / T_C) - 1 :][:3]
        assert fine - shown == pytest.approx((then - 2 * now + before) * behind / T_C, rel=1e-6, abs=1e-12)
    # and on both go to the same bits
    for unit in (one, other):
        unit.step_to(at + 1e-3)
    assert one.get(z_move.names.values()) == other.get(z_move.names.values())
    for unit in (one, other):
        unit.close()


def test_a_state_a_little_behind_an_instant_goes_on(z_move: Packed, tmp_path: Path) -> None:
    unit = Unit(z_move, tmp_path)
    unit.step_to(0.2 + 1e-6)
    shown = unit.get(z_move.names.values())
    image = unit.slave.serializeFMUstate(unit.slave.getFMUstate())
    unit.step_to(0.21)
    expected = unit.get(z_move.names.values())
    unit.slave.setFMUstate(unit.slave.deSerializeFMUstate(image))
    unit.time = 0.2 + 1e-6
    assert unit.get(z_move.names.values()) == shown
    unit.step_to(0.21)
    assert unit.get(z_move.names.values()) == expected
    unit.close()


# --- states that nobody saved

HEADING, CHECKSUM, SIZES = 88, 80, 56  # of a serialised state, as src/fmi2/state.h has them
START_TIME, TIME = HEADING, HEADING + 16  # of the shell's header


class Forged:
    """A serialised state of the unit, to be changed and signed anew."""

    def __init__(self, unit: Unit) -> None:
        state = unit.slave.getFMUstate()
        self.image = bytearray(unit.slave.serializeFMUstate(state))
        unit.slave.freeFMUstate(state)
        self.model = HEADING + struct.unpack_from("<Q", self.image, SIZES + 8)[0]
        self.unit = unit

    def put(self, form: str, at: int, value: float) -> None:
        struct.pack_into(form, self.image, at, value)

    def drives(self) -> Iterator[int]:
        """Where the counts of the drives lie: instants and their place in the position cycle."""
        (cycle,) = struct.unpack_from("<q", self.image, self.model)
        counts = struct.pack("<qq", cycle, cycle % 8)
        at = self.image.find(counts, self.model + 8)
        while at >= 0:
            yield at
            at = self.image.find(counts, at + 1)

    def restore(self) -> None:
        struct.pack_into("<Q", self.image, CHECKSUM, int(fnv1a_64(bytes(self.image[HEADING:])), 16))
        self.unit.slave.setFMUstate(self.unit.slave.deSerializeFMUstate(bytes(self.image)))


def _cycles(forged: Forged) -> None:
    forged.put("<q", forged.model, 0)


def _time(forged: Forged) -> None:
    forged.put("<d", TIME, 200.0)


def _back(forged: Forged) -> None:
    forged.put("<d", TIME, 0.01)


def _start(forged: Forged) -> None:
    forged.put("<d", START_TIME, -100.0)


def _drive(forged: Forged) -> None:
    at = list(forged.drives())
    assert len(at) == 3
    forged.put("<q", at[1], 0)


def _place(forged: Forged) -> None:
    forged.put("<q", next(forged.drives()) + 8, 7)


def _share(forged: Forged) -> None:
    forged.put("<d", forged.model + 16, 0.5)


@pytest.mark.parametrize(
    ("forge", "told"),
    [
        (_cycles, "it has 0 sample instants, T_c = 0.000125 s apart, behind it since 0 s, and stands at 0.0501 s"),
        (_time, "it has 401 sample instants, T_c = 0.000125 s apart, behind it since 0 s, and stands at 200 s"),
        (_back, "stands at 0.01 s"),
        (_start, "behind it since -100 s"),
        (_drive, "Y.drive: the state contradicts itself: it has 0 sample instants"),
        (_place, "X.drive: the state contradicts itself: behind 401 sample instants it is in cycle 7 of 8"),
        (_share, "the share of the last cycle that its clock has behind it is 0.5, its clock says 0.79999"),
    ],
)
def test_a_state_whose_counts_contradict_its_clock_is_refused(
    z_move: Packed, tmp_path: Path, forge: object, told: str
) -> None:
    said: list[str] = []
    unit = Unit(z_move, tmp_path, said)
    unit.step_to(0.0501)
    forged = Forged(unit)
    shown = unit.get(z_move.names.values())
    forged.restore()  # as it was saved
    assert not said
    forge(forged)  # type: ignore[operator]
    with pytest.raises(FMICallException):
        forged.restore()
    assert told in said[-1]
    assert unit.get(z_move.names.values()) == shown
    unit.close()


def test_samples_of_setpoints_lie_ahead_of_the_clock(machine: Packed, tmp_path: Path) -> None:
    said: list[str] = []
    unit = Unit(machine, tmp_path / "unit", said)
    outside(unit, {}, delay=8e-3)
    for k in range(1, 20):
        unit.step_to(k * 4e-3)
    forged = Forged(unit)
    forged.restore()
    sample_t = forged.model + 8 * (3 + 6 + 1)  # cycle, end, share; tool, its speed; sampled
    assert struct.unpack_from("<d", forged.image, sample_t)[0] == pytest.approx(18 * 4e-3)
    forged.put("<d", sample_t, 0.5)
    with pytest.raises(FMICallException):
        forged.restore()
    assert "samples of setpoints" in said[-1]
    unit.close()


def test_states_at_all_times_are_accepted(z_move: Packed, tmp_path: Path) -> None:
    """Steps of any size from a start anywhere: what was saved is never taken for forged."""
    for start, seed in itertools.product((0.0, -3.3, 1e4), range(2)):
        random = np.random.default_rng(seed)
        unit = Unit(z_move, tmp_path / f"{start}-{seed}")
        unit.slave.reset()
        unit.slave.setupExperiment(startTime=start)
        unit.slave.enterInitializationMode()
        unit.slave.exitInitializationMode()
        unit.time = start
        for k in range(300):
            size = float(10 ** random.uniform(-9, -3))
            near = random.uniform(-2e-6, 2e-6) * (k % 4 == 1)
            on_grid = start + np.ceil((unit.time + size - start) / T_C) * T_C + near
            unit.step_to(float(on_grid) if k % 2 and on_grid > unit.time else unit.time + size)
            state = unit.slave.getFMUstate()
            unit.slave.setFMUstate(unit.slave.deSerializeFMUstate(unit.slave.serializeFMUstate(state)))
            unit.slave.freeFMUstate(state)
        unit.close()
