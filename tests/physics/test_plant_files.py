"""plant.fmu from outside: its state, mode tables of the user's own, and the machine data in its archive."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from plant_unit import HEADER, INPUTS, OUTPUTS, H, random_inputs, single_mode, write_modes

from fmi_helpers import Archive, Instance, Message


@pytest.fixture(scope="module")
def archive(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return Archive.unpack(fmus / "plant.fmu", tmp_path_factory.mktemp("plant"))


@pytest.fixture
def unit(archive: Archive) -> Iterator[Instance]:
    with archive.instance() as instance:
        yield instance


# --- state ------------------------------------------------------------------------------------------------------------


def test_state_replays_bit_for_bit(archive: Archive) -> None:
    corners = random_inputs(100, seed=6)
    with archive.instance() as unit:
        unit.run(H, INPUTS, corners[:51], OUTPUTS)
        state, content, time = unit.state(), unit.serialized(), unit.time
        acceleration = unit.derivative("Z.n_a")
        first = unit.run(H, INPUTS, corners[50:], OUTPUTS)
        unit.restore(state)
        assert unit.derivative("Z.n_a") == acceleration
        again = unit.run(H, INPUTS, corners[50:], OUTPUTS)
        with archive.instance() as other:
            other.restore_serialized(content, time)
            assert other.derivative("Z.n_a") == acceleration
            elsewhere = other.run(H, INPUTS, corners[50:], OUTPUTS)
    assert (again == first).all()
    assert (elsewhere == first).all()


def test_state_brings_its_mode_table(archive: Archive, tmp_path: Path) -> None:
    path = single_mode(tmp_path / "single.csv", 0.02)
    with archive.instance({"modes_file": str(path)}) as unit, archive.instance() as other:
        unit.step(1e-3, {"Z.M_a": 5.0})
        content, time = unit.serialized(), unit.time
        other.step(1e-3, {"Z.M_a": 5.0})
        assert other.get("Z.n_a") != unit.get("Z.n_a")
        other.restore_serialized(content, time)
        path.write_text("gone")  # neither instance reads it again
        for instance in (unit, other):
            instance.step(1e-3)
        unit.restore_serialized(content, time)
        unit.step(1e-3)
        assert other.get("Z.n_a") == unit.get("Z.n_a")


def test_state_of_a_changed_mode_table_is_refused(archive: Archive, tmp_path: Path) -> None:
    path = single_mode(tmp_path / "single.csv", 0.02)
    with archive.instance({"modes_file": str(path)}) as unit:
        unit.step(1e-3, {"Z.M_a": 5.0})
        content, time = unit.serialized(), unit.time
    single_mode(path, 0.03)
    with archive.instance() as other:
        with pytest.raises(FMICallException):
            other.restore_serialized(content, time)
        assert "other contents of the mode table" in other.texts(3)
        assert str(path) in other.texts(3)


@pytest.mark.parametrize("fault", ["changed", "gone", "broken"])
@pytest.mark.parametrize("own", ["archive", "own table", "own table, gone", "same table"])
def test_a_refused_state_leaves_the_instance_as_it_was(archive: Archive, tmp_path: Path, own: str, fault: str) -> None:
    path = single_mode(tmp_path / "single.csv", 0.02)
    own_path = write_modes(tmp_path / "own.csv", [RIGID, ELASTIC])
    with archive.instance({"modes_file": str(path)}) as unit:
        unit.step(1e-3, {"Z.M_a": 5.0})
        content, time = unit.serialized(), unit.time
    if own == "same table":
        single_mode(path, 0.03)
    parameters = {"archive": {}, "same table": {"modes_file": str(path)}}.get(own, {"modes_file": str(own_path)})
    with archive.instance(parameters) as target, archive.instance(parameters) as twin:
        if own == "own table, gone":
            own_path.unlink()
        match fault:
            case "changed":
                single_mode(path, 0.04)
            case "gone":
                path.unlink()
            case "broken":
                path.write_text("no table")
        for instance in (target, twin):
            instance.step(1e-3, {"Z.M_a": 5.0})
        before = target.serialized()
        with pytest.raises(FMICallException):
            target.restore_serialized(content, time)
        text = "cannot be read" if fault == "gone" and own != "same table" else "other contents of the mode table"
        assert text in target.texts(3)
        assert str(path) in target.texts(3)
        assert target.serialized() == before
        for instance in (target, twin):
            instance.time = 1e-3
            instance.step(1e-3, {"Z.M_a": 5.0}, {"Z.M_a": 100.0})
        assert (target.gets(OUTPUTS) == twin.gets(OUTPUTS)).all()
        assert target.derivative("Z.n_a") == twin.derivative("Z.n_a")


def test_a_state_that_was_refused_is_taken_when_its_table_is_back(archive: Archive, tmp_path: Path) -> None:
    path = single_mode(tmp_path / "single.csv", 0.02)
    table = path.read_bytes()
    with archive.instance({"modes_file": str(path)}) as unit, Instance(archive) as fresh:
        unit.step(1e-3, {"Z.M_a": 5.0})
        content, time = unit.serialized(), unit.time
        path.unlink()
        with pytest.raises(FMICallException):
            fresh.restore_serialized(content, time)
        path.write_bytes(table)
        fresh.restore_serialized(content, time)
        for instance in (unit, fresh):
            instance.step(1e-3)
        assert (unit.gets(OUTPUTS) == fresh.gets(OUTPUTS)).all()


def test_reset_goes_back_to_the_archive(archive: Archive, tmp_path: Path) -> None:
    path = single_mode(tmp_path / "single.csv", 0.02)
    with archive.instance({"modes_file": str(path), "Z.x_0": 4.0}) as unit, archive.instance() as other:
        unit.step(1e-3, {"Z.M_a": 5.0})
        unit.fmu.reset()
        unit.start({})
        for instance in (unit, other):
            instance.step(1e-3, {"Z.M_a": 5.0})
        assert (unit.gets(OUTPUTS) == other.gets(OUTPUTS)).all()


def test_all_memory_is_given_back(archive: Archive, tmp_path: Path) -> None:
    path = single_mode(tmp_path / "single.csv", 0.02)
    with archive.instance() as unit:
        unit.step(H)
        unit.fmu.reset()
        unit.start({"modes_file": str(path)})
        unit.step(H)
        unit.serialized()
        held = set(unit.blocks)
        unit.step(H, {"Z.M_a": 1.0}, {"Z.M_a": 1.0})
        unit.step(2 * H)
        assert unit.blocks == held  # a step allocates nothing, another step size neither
    assert not unit.blocks


def test_overflow_is_an_error_that_a_saved_state_heals(unit: Instance) -> None:
    unit.step(H, {"Z.M_a": 5.0})
    state, before = unit.state(), unit.gets(OUTPUTS)
    with pytest.raises(FMICallException):
        unit.step(1e10, {"Z.M_a": 1e300})
    assert "no finite number" in unit.texts(3)
    with pytest.raises(FMICallException):
        unit.step(H, {"Z.M_a": 5.0})  # in state 'error'
    unit.restore(state)
    assert (unit.gets(OUTPUTS) == before).all()


# --- modes_file -------------------------------------------------------------------------------------------------------

RIGID = [0, 0, 0, 1, 2, 3, 4e-3, 5e-3, 6e-3, 0, 0, 0]
ELASTIC = [1, 50, 0.02, 1, 2, 3, 4e-3, 5e-3, 6e-3, 0.1, 0.2, 0.3]


def refused(archive: Archive, modes_file: str) -> str:
    with Instance(archive) as unit, pytest.raises(FMICallException):
        unit.start({"modes_file": modes_file})
    assert not unit.blocks
    return unit.texts(3)


def test_modes_file_may_be_any_utf_8_path(archive: Archive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_modes(tmp_path / "Prüfstand 100 %" / "Modën #1.csv", [RIGID, ELASTIC])
    monkeypatch.chdir(tmp_path)
    for name in (str(path), str(path.relative_to(tmp_path))):
        with archive.instance({"modes_file": name}, inputs={"X.M_a": 1.0}) as unit:
            assert unit.derivative("X.n_a") == 2.0  # two modes of shape 1


def test_modes_file_with_columns_in_another_order(archive: Archive, tmp_path: Path) -> None:
    order = np.random.default_rng(7).permutation(len(HEADER))
    rows = [[row[i] for i in order] for row in (RIGID, ELASTIC)]
    straight = write_modes(tmp_path / "straight.csv", [RIGID, ELASTIC])
    shuffled = write_modes(tmp_path / "shuffled.csv", rows, [HEADER[i] for i in order])
    shuffled.write_bytes(b"\xef\xbb\xbf" + shuffled.read_bytes().replace(b"\n", b"\r\n"))
    seen = []
    for path in (straight, shuffled):
        with archive.instance({"modes_file": str(path)}) as unit:
            unit.step(0.01, {"Y.M_a": 2.0, "tool.F_Z": 10.0})
            seen.append(unit.gets(OUTPUTS))
    assert (seen[0] == seen[1]).all()


def changed(column: str, value: float | str) -> list[float | str]:
    row: list[float | str] = list(ELASTIC)
    row[HEADER.index(column)] = value
    return row


@pytest.mark.parametrize(
    ("rows", "header", "expected"),
    [
        pytest.param([RIGID[:-1]], HEADER[:-1], "line 1: column 'tcp_Z' is missing", id="missing column"),
        pytest.param(
            [[*RIGID, 1, 1]],
            [*HEADER, "n_B", "x_B"],
            "line 1: column 'n_B' is a port of an axis that the archive does not have; it has X, Y, Z",
            id="axis the archive does not have",
        ),
        pytest.param(
            [RIGID[:3] + RIGID[4:6] + RIGID[7:]],
            HEADER[:3] + HEADER[4:6] + HEADER[7:],
            "line 1: column 'n_X' is missing",
            id="axis the table does not have",
        ),
        pytest.param(
            [RIGID, changed("n_Y", "nan")], HEADER, "line 3: column 'n_Y': 'nan' is no finite number", id="NaN"
        ),
        pytest.param(
            [RIGID, changed("x_Z", "inf")], HEADER, "line 3: column 'x_Z': 'inf' is no finite number", id="inf"
        ),
        pytest.param([changed("n_Y", "1;5")], HEADER, "line 2: column 'n_Y': '1;5' is no finite number", id="text"),
        pytest.param(
            [RIGID, changed("frequency [Hz]", -50)],
            HEADER,
            "line 3: column 'frequency [Hz]' is -50; it must not be negative",
            id="negative frequency",
        ),
        pytest.param(
            [changed("damping ratio [1]", -0.02)],
            HEADER,
            "line 2: column 'damping ratio [1]' is -0.02; it must not be negative",
            id="negative damping",
        ),
        pytest.param(
            [changed("frequency [Hz]", 0)],
            HEADER,
            "line 2: column 'damping ratio [1]' is 0.02 at frequency 0 Hz",
            id="damped rigid mode",
        ),
        pytest.param([changed("n_Z", 0)], HEADER, "column 'n_Z' is 0 in every row", id="port without a mode"),
        pytest.param([RIGID, RIGID[:-1]], HEADER, "line 3: the row has 11 cells, the header has 12", id="short row"),
        pytest.param([], HEADER, "no mode", id="no row"),
    ],
)
def test_modes_file_faults(
    archive: Archive, tmp_path: Path, rows: list[list[float | str]], header: list[str], expected: str
) -> None:
    path = write_modes(tmp_path / "faulty.csv", rows, header)
    text = refused(archive, str(path))
    assert str(path) in text
    assert expected in text


def test_empty_modes_file(archive: Archive, tmp_path: Path) -> None:
    path = tmp_path / "empty.csv"
    path.write_bytes(b"")
    assert "the table is empty" in refused(archive, str(path))


def test_modes_file_that_cannot_be_read(archive: Archive, tmp_path: Path) -> None:
    missing = tmp_path / "missing.csv"
    assert f"'modes_file': {missing} cannot be read" in refused(archive, str(missing))
    assert "cannot be read" in refused(archive, str(tmp_path))  # a folder


# --- resources --------------------------------------------------------------------------------------------------------


def failing_instantiation(archive: Archive) -> str:
    messages: list[Message] = []
    blocks: set[int] = set()
    with pytest.raises(Exception, match=r"[Ff]ailed to instantiate"):
        Instance(archive, messages, blocks)
    assert not blocks
    return "\n".join(message.text for message in messages)


def test_without_resource_location_the_embedded_machine_is_used(archive: Archive) -> None:
    with archive.instance() as unit, Instance(archive, resources=False) as other:
        other.start({})
        for instance in (unit, other):
            instance.step(0.01, {"Y.M_a": 3.0})
        assert (unit.gets(OUTPUTS) == other.gets(OUTPUTS)).all()


def test_stale_resources_are_refused(fmus: Path, tmp_path: Path) -> None:
    stale = Archive.unpack(fmus / "plant.fmu", tmp_path / "stale")
    table = stale.folder / "resources" / "modes.csv"
    table.write_bytes(table.read_bytes().replace(b"0.06", b"0.05", 1))
    packed = 0xCBF29CE484222325  # FNV-1a 64 over axes.csv and modes.csv
    for byte in (stale.folder / "resources" / "axes.csv").read_bytes() + table.read_bytes():
        packed = (packed ^ byte) * 0x100000001B3 % 2**64
    text = failing_instantiation(stale)
    assert f"the hash is {packed:016x}" in text
    assert f"packed with hash {stale.description.guid[17:]}" in text


@pytest.mark.parametrize("name", ["axes.csv", "modes.csv"])
def test_missing_resources_are_refused(fmus: Path, tmp_path: Path, name: str) -> None:
    bare = Archive.unpack(fmus / "plant.fmu", tmp_path / "bare")
    (bare.folder / "resources" / name).unlink()
    assert f"resources/{name} cannot be read" in failing_instantiation(bare)
