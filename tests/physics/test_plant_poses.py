"""plant.fmu with a grid of poses: against a machine whose springs change, and what a crossing must not do."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from plant_unit import AXES, INPUTS, OUTPUTS, H, write_modes
from poses_machine import DOFS, LEAD, ROTOR, Grid, GridAxis, archive, cell, grid, mass
from poses_reference import Reference

from fmi_helpers import Archive, Floats, Instance, Message

MONITORS = ("pose.E_kin_lost", "pose.E_el_lost", "pose.held", "pose.jump_n_a", "pose.jump_x_a", "pose.jump_tool")
X_0 = (0.1, 0.3, 0.05)
FINE = GridAxis(0, np.arange(0.0, 0.6, 0.02))

# T^T T = 1 within this: products of bases that a solver made orthonormal to some units in the last place
ORTHONORMAL = 4e-15

Assemble = Callable[[Grid | bytes | None], Archive]


@pytest.fixture
def assemble(fmus: Path, tmp_path: Path) -> Assemble:
    count = itertools.count()
    return lambda poses: archive(
        fmus / "plant.fmu",
        tmp_path / f"plant{next(count)}",
        poses,
        poses.cells[0] if isinstance(poses, Grid) else cell(X_0, seed=0),
    )


def start(x_0: tuple[float, float, float] = X_0) -> dict[str, float | int | bool | str]:
    return {f"{axis}.x_0": x for axis, x in zip(AXES, x_0, strict=True)}


def crossings(unit: Instance) -> int:
    return int(unit.fmu.getInteger(unit.references(["pose.crossings"]))[0])


def cell_of(unit: Instance) -> int:
    return int(unit.fmu.getInteger(unit.references(["pose.cell"]))[0])


def there_and_back(steps: int, distances: Mapping[str, float], seed: int) -> Floats:
    """Corner values of inputs (steps + 1, INPUTS) that drive axes by distances [m] and back, about; with noise."""
    times = np.arange(steps + 1) / steps
    signs = np.where((times < 0.25) | (times >= 0.75), 1.0, -1.0)
    random = np.random.default_rng(seed)
    noise = np.hstack([random.uniform(-1.0, 1.0, (steps + 1, count)) for count in (6, 3)])
    values = noise * ([0.5] * 3 + [200.0] * 6)
    for axis, distance in distances.items():
        rotor = ROTOR[AXES.index(axis)]
        acceleration = distance / (steps * H / 4) ** 2
        values[:, AXES.index(axis)] += mass()[rotor, rotor] * acceleration / LEAD * signs
    return values


def kinetic_energy(outputs: Floats) -> float:
    """The largest [J] that an axis as a whole had: outputs (steps, OUTPUTS)."""
    return float(np.max(np.diag(mass())[ROTOR] * outputs[:, :3] ** 2) / 2)


def check(unit: Instance, reference: Reference, values: Floats, tolerance: float = 1e-10) -> Floats:
    """Both through the same inputs, steps of H; the outputs of the reference (steps, OUTPUTS)."""
    expected = np.empty((len(values) - 1, len(OUTPUTS)))
    found = np.empty_like(expected)
    for k in range(len(expected)):
        expected[k] = reference.step(H, values[k], values[k + 1])
        found[k] = unit.run(H, INPUTS, values[k : k + 2], OUTPUTS)[0]
        assert cell_of(unit) == reference.cell, f"after step {k}"
    # An output's scale is its largest value. Both sides round in every step, the reference in its expm as well.
    assert (np.abs(found - expected).max(axis=0) <= tolerance * np.abs(expected).max(axis=0)).all()
    assert crossings(unit) == reference.crossings
    return expected


# --- against the machine whose springs change -------------------------------------------------------------------------


def test_full_bases_are_the_time_varying_machine(assemble: Assemble) -> None:
    poses = grid(FINE)
    reference = Reference(poses, X_0)
    with assemble(poses).instance(start()) as unit:
        expected = check(unit, reference, there_and_back(3000, {"X": 0.15}, seed=1))
        most = kinetic_energy(expected)
        assert reference.crossings > 10
        assert min(reference.place) >= 0
        kinetic, elastic, held, jump_n_a, jump_x_a, jump_tool = unit.gets(MONITORS)
    assert abs(kinetic) < ORTHONORMAL * reference.crossings * most
    assert elastic == pytest.approx(reference.elastic_lost, rel=1e-6)
    assert abs(elastic) > 1e-6
    assert max(held, jump_x_a, jump_tool) < 1e-14  # the ports are the same, and so is the displacement
    assert jump_n_a < 1e-12  # of some 10 rad/s


def test_two_grid_axes(assemble: Assemble) -> None:
    x, z = GridAxis(0, np.array([0.0, 0.09, 0.13, 0.2]), 1e-4), GridAxis(2, np.arange(-0.2, 0.4, 0.03), 0.0)
    for axes in ((x, z), (z, x)):
        poses = grid(*axes)
        reference = Reference(poses, X_0)
        with assemble(poses).instance(start()) as unit:
            check(unit, reference, there_and_back(2000, {"X": 0.12, "Z": -0.15}, seed=2))
        assert reference.crossings > 10
        assert all(len(axis.centres) > 1 for axis in axes)


@pytest.mark.parametrize("x", [-1.0, 0.05, 0.3, 0.31, 5.0])
def test_starts_in_the_cell_of_x_0(assemble: Assemble, x: float) -> None:
    poses = grid(FINE)
    x_0 = (x, 0.3, 0.05)
    reference = Reference(poses, x_0)
    with assemble(poses).instance(start(x_0)) as unit:
        assert cell_of(unit) == reference.cell
        assert (unit.gets(OUTPUTS) == [0, 0, 0, *x_0, 0, 0, 0]).all()
        check(unit, reference, there_and_back(200, {"X": 0.03}, seed=3))


def test_a_boundary_belongs_to_the_cell_below(assemble: Assemble) -> None:
    poses = grid(GridAxis(0, np.array([0.0, 1.0, 2.0])))
    built = assemble(poses)
    for x, expected in ((0.5, 0), (np.nextafter(0.5, 1), 1), (1.5, 1), (np.nextafter(1.5, 2), 2)):
        with built.instance(start((x, 0.3, 0.05))) as unit:
            assert cell_of(unit) == expected


def test_many_cells_in_one_step(assemble: Assemble) -> None:
    """And coefficients of every cell for every step size, in any order."""
    poses = grid(GridAxis(0, np.arange(0.0, 0.6, 0.002)))
    reference = Reference(poses, X_0)
    random = np.random.default_rng(4)
    most = 0
    with assemble(poses).instance(start()) as unit:
        before = np.zeros(len(INPUTS))
        for k in range(40):
            h = float(random.choice([1e-3, 5e-3, 1.25e-2]))
            after = np.array([60.0 if k < 20 else -60.0, *random.uniform(-1, 1, 2), *random.uniform(-100, 100, 6)])
            passed = reference.crossings
            expected = reference.step(h, before, after)
            unit.step(h, dict(zip(INPUTS, before, strict=True)), dict(zip(INPUTS, (after - before) / h, strict=True)))
            # A step of 12.5 ms is 30 us of the reference's scale 1/|A|: its expm is good to 1e-10.
            scale = np.array([100.0] * 3 + [1.0] * 3 + [0.1] * 3)
            assert (np.abs(unit.gets(OUTPUTS) - expected) <= 1e-9 * scale).all()
            assert cell_of(unit) == reference.cell
            most = max(most, reference.crossings - passed)
            before = after
        assert crossings(unit) == reference.crossings
    assert most >= 5


@pytest.mark.parametrize("modes", [(9,), (10, 7, 12, 8)])
def test_truncated_bases(assemble: Assemble, modes: tuple[int, ...]) -> None:
    poses = grid(FINE, modes=modes)
    reference = Reference(poses, X_0, full=False)
    values = there_and_back(2000, {"X": 0.1}, seed=5)
    lost = 0.0
    with assemble(poses).instance(start()) as unit:
        for part in (values[k : k + 201] for k in range(0, 2000, 200)):
            check(unit, reference, part)
            assert unit.get("pose.E_kin_lost") >= lost - 1e-13  # never gained, but for the rounding of some 100 J
            lost = unit.get("pose.E_kin_lost")
        found = unit.gets(MONITORS)
    expected = [reference.kinetic_lost, reference.elastic_lost, reference.held, reference.jump_n_a]
    assert found[:4] == pytest.approx(expected, rel=1e-6)
    assert found[5] == pytest.approx(reference.jump_tool, rel=1e-6)
    assert lost > 1e-12
    assert found[2] > 1e-9  # would jump by nanometres
    assert found[4] < 1e-15  # and does not: rounding of 0.1 m


# --- what a crossing must not do --------------------------------------------------------------------------------------


def test_other_bases_of_the_same_springs_change_nothing(assemble: Assemble) -> None:
    """Over the same boundaries forty times: T^T T = 1, so that no step of it is seen."""
    many, one = grid(FINE, same_springs=True), grid(GridAxis(0, np.array([0.1])), same_springs=True)
    one = Grid(one.axes, many.positions[:1], many.cells[:1])
    turns = there_and_back(800, {"X": 0.1}, seed=6)
    values = np.vstack([turns[:-1]] * 20)
    with assemble(many).instance(start()) as unit, assemble(one).instance(start()) as other:
        found, expected = (each.run(H, INPUTS, values, OUTPUTS) for each in (unit, other))
        assert crossings(unit) > 150
        assert crossings(other) == cell_of(other) == 0
        # 16000 steps and 200 crossings round at 1e-16 of their terms each
        assert (np.abs(found - expected).max(axis=0) <= 1e-11 * np.abs(expected).max(axis=0)).all()
        assert np.abs(unit.gets(MONITORS)[:2]).max() < ORTHONORMAL * crossings(unit) * kinetic_energy(expected)


def test_resting_on_a_boundary_does_not_chatter(assemble: Assemble) -> None:
    boundary, amplitude, omega = float(FINE.boundaries[5]), 1.5e-5, 2 * np.pi * 8.0
    steps = 8000
    wave = np.zeros((steps + 1, len(INPUTS)))
    # Of the mass as a whole, which swings about x_0 + amplitude; the bed's mode at 19.5 Hz adds a little.
    torque = amplitude * omega**2 * mass()[ROTOR[0], ROTOR[0]] / LEAD
    wave[:, 0] = torque * np.cos(omega * H * np.arange(steps + 1))
    counts = []
    for hysteresis in (0.0, 4e-5):
        poses = grid(GridAxis(0, FINE.centres, hysteresis))
        with assemble(poses).instance(start((boundary - amplitude, 0.3, 0.05))) as unit:
            positions = unit.run(H, INPUTS, wave, ["X.x_a"])[:, 0]
            counts.append(crossings(unit))
        assert 1e-5 < np.abs(positions - boundary).max() < 2e-5  # half the hysteresis
    assert counts[0] >= 15
    assert counts[1] <= 1


def test_outputs_and_derivatives_are_those_of_the_new_cell(assemble: Assemble) -> None:
    poses = grid(FINE, modes=(8,))
    names = [name for name in OUTPUTS]
    with assemble(poses).instance(start()) as unit:
        inputs = {"X.M_a": 8.0}
        while crossings(unit) == 0:
            unit.step(H, inputs)
        derivatives = np.array([unit.derivative(name) for name in names])
        before = unit.gets(names)
        d = 1e-8
        unit.step(d, inputs)
        quotient = (unit.gets(names) - before) / d
        rounding = 4e-16 * np.abs(before) / d
        # an error of order d, 1e-8 (1400/s) n' / 2, and the rounding of the outputs, 1e-16 of their size
        assert (np.abs(derivatives - quotient) <= 1e-3 * np.abs(derivatives) + rounding).all()


# --- state ------------------------------------------------------------------------------------------------------------


def test_state_replays_bit_for_bit_over_crossings(assemble: Assemble) -> None:
    poses = grid(FINE, GridAxis(2, np.arange(0.0, 0.2, 0.03)), modes=(9, 12, 7))
    values = there_and_back(1200, {"X": 0.15, "Z": 0.1}, seed=7)
    built = assemble(poses)
    names = (*OUTPUTS, *MONITORS)

    def all_of(unit: Instance) -> tuple[bytes, bytes]:
        return unit.run(H, INPUTS, values[400:], names).tobytes(), unit.serialized()

    with built.instance(start()) as unit, built.instance() as other:
        unit.run(H, INPUTS, values[:401], OUTPUTS)
        state, content, time, passed = unit.state(), unit.serialized(), unit.time, crossings(unit)
        derivatives = [unit.derivative(name) for name in OUTPUTS]
        first = all_of(unit)
        assert crossings(unit) > passed + 5
        unit.restore(state)
        assert cell_of(unit) != 0
        assert [unit.derivative(name) for name in OUTPUTS] == derivatives
        assert all_of(unit) == first
        other.run(2 * H, INPUTS, values[:100], OUTPUTS)  # another step size, other cells
        other.restore_serialized(content, time)
        assert [other.derivative(name) for name in OUTPUTS] == derivatives
        assert all_of(other) == first
        other.fmu.reset()
        other.start(start())
        other.run(H, INPUTS, values[:401], OUTPUTS)
        assert other.serialized() == content


def test_modes_file_is_one_pose(assemble: Assemble, tmp_path: Path) -> None:
    poses = grid(FINE)
    built = assemble(poses)
    path = write_modes(tmp_path / "own.csv", [])
    path.write_bytes((built.folder / "resources" / "modes.csv").read_bytes())
    values = there_and_back(1000, {"X": 0.1}, seed=8)
    parameters = {**start(), "modes_file": str(path)}
    with (
        built.instance(parameters) as unit,
        assemble(None).instance(parameters) as other,
        built.instance(start()) as third,
    ):
        found, expected = (each.run(H, INPUTS, values, OUTPUTS) for each in (unit, other))
        assert (found == expected).all()
        assert crossings(unit) == cell_of(unit) == 0
        third.run(H, INPUTS, values, OUTPUTS)
        assert crossings(third) > 0
        third.restore_serialized(unit.serialized(), unit.time)
        assert (third.gets(OUTPUTS) == unit.gets(OUTPUTS)).all()
        for each in (third, unit):
            each.step(H, {"X.M_a": 1.0})
        assert (third.gets(OUTPUTS) == unit.gets(OUTPUTS)).all()


def test_one_cell_is_its_mode_table(assemble: Assemble) -> None:
    one = grid(GridAxis(0, np.array([0.1])))
    values = there_and_back(400, {"X": 0.1}, seed=9)
    with assemble(one).instance(start()) as unit, assemble(None).instance(start()) as other:
        other.fmu.reset()
        other.start(start())
        found = unit.run(H, INPUTS, values, OUTPUTS)
        expected = Reference(one, X_0)
        for k in range(400):
            last = expected.step(H, values[k], values[k + 1])
        assert found[-1] == pytest.approx(last, rel=1e-9, abs=1e-12)


def test_crossings_allocate_nothing_and_all_memory_is_given_back(assemble: Assemble) -> None:
    with assemble(grid(FINE)).instance(start()) as unit:
        unit.step(H, {"X.M_a": 8.0})
        held = set(unit.blocks)
        while crossings(unit) < 3:
            unit.step(1e-3)
        unit.step(H)
        assert unit.blocks == held
    assert not unit.blocks


def test_overflow_at_a_crossing_is_an_error(assemble: Assemble) -> None:
    with assemble(grid(FINE)).instance(start()) as unit:
        unit.step(H, {"X.M_a": 5.0})
        state = unit.state()
        with pytest.raises(FMICallException):
            unit.step(1.0, {"X.M_a": 1e200})
        assert "not finite" in unit.texts(3) or "no finite number" in unit.texts(3)
        unit.restore(state)
        unit.step(H, {"X.M_a": 5.0})


# --- the file ---------------------------------------------------------------------------------------------------------


def failing(built: Archive, resources: bool = True) -> str:
    messages: list[Message] = []
    blocks: set[int] = set()
    with pytest.raises(Exception, match=r"[Ff]ailed to instantiate"):
        Instance(built, messages, blocks, resources)
    assert not blocks
    return "\n".join(message.text for message in messages)


def test_missing_poses_are_refused(assemble: Assemble) -> None:
    built = assemble(grid(FINE))
    (built.folder / "resources" / "poses.bin").unlink()
    text = failing(built)
    assert "(no poses.bin)" in text
    assert f"packed with hash {built.description.guid[17:]}" in text


def test_changed_poses_are_refused(assemble: Assemble) -> None:
    built = assemble(grid(FINE))
    path = built.folder / "resources" / "poses.bin"
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    assert "and poses.bin: the hash is" in failing(built)


def test_surplus_poses_are_refused(assemble: Assemble) -> None:
    built = assemble(None)
    (built.folder / "resources" / "poses.bin").write_bytes(grid(FINE).content())
    assert "and poses.bin: the hash is" in failing(built)


def test_poses_without_resource_location_are_refused(assemble: Assemble) -> None:
    text = failing(assemble(grid(FINE)), resources=False)
    assert "(no poses.bin): the hash is" in text


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        pytest.param(b"", "resources/poses.bin: the file does not begin with FSPOSES1", id="empty"),
        pytest.param(grid(FINE).content()[:-8], "resources/poses.bin, byte ", id="cut off"),
        pytest.param(grid(FINE).content() + bytes(8), "1 numbers too many", id="too long"),
        pytest.param(
            grid(GridAxis(0, np.array([0.0, 1.0]), -1e-3)).content(), "the hysteresis is -0.001 m", id="hysteresis"
        ),
    ],
)
def test_faulty_poses_are_refused(assemble: Assemble, content: bytes, expected: str) -> None:
    assert expected in failing(assemble(content))


def test_full_basis_is_full() -> None:
    assert len(cell(X_0, seed=0).omega) == DOFS
