"""Serialised states as files between processes: continued to the last bit by the unit they belong to, refused with a
message by any other, and by all where they are damaged. Bytes that somebody makes up under a checksum that fits:
tests/fuzz."""

import ctypes
import math
import os
import random
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from fmu.apart import apart
from fmu.binary import ERROR, OK, Slave, of, reals, references
from fmu.continued import go_on
from fmu.unpacked import ROOT, UNITS, Archive, unpack

FIRST, MORE = 40, 60


def _elsewhere(archive: Archive, first: int, count: int, state: Path | None = None) -> tuple[list[list[float]], bytes]:
    command = [sys.executable, "-m", "fmu.continued", archive.unit, str(archive.path), str(archive.folder)]
    command += [str(first), str(count), *([str(state)] if state else [])]
    paths = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT / "tests"), str(ROOT / "src/packager")])}
    done = subprocess.run(command, capture_output=True, text=True, env=paths)
    assert done.returncode == 0, done.stderr
    rows = [[float.fromhex(each) for each in line.split()] for line in done.stdout.splitlines()]
    return rows, bytes.fromhex(done.stderr)


def test_one_process_saves_another_goes_on(archive: Archive, tmp_path: Path) -> None:
    slave = Slave(archive).initialized()
    expected = go_on(slave, 0, FIRST + MORE)
    end = slave.state()
    slave.free()
    begun, image = _elsewhere(archive, 0, FIRST)
    (tmp_path / "state").write_bytes(image)
    continued, final = _elsewhere(archive, FIRST, MORE, tmp_path / "state")
    assert [*begun, *continued] == expected
    assert final == end
    # and in an instance that has a life of its own behind it
    slave = Slave(archive).initialized(start=5.0)
    slave.step(5.0, 1e-3)
    assert slave.restore(image) == OK
    assert go_on(slave, FIRST, MORE) == expected[FIRST:]
    slave.free()


class Keeper:
    """An instance in the middle of its life that must not be hurt by what it refuses."""

    def __init__(self, archive: Archive) -> None:
        self.slave = Slave(archive).initialized()
        go_on(self.slave, 0, FIRST)
        self.image = self.slave.state()
        self.expected = go_on(self.slave, FIRST, 5)
        assert self.slave.restore(self.image) == OK

    def refuses(self, image: bytes, *texts: str) -> None:
        self.slave.messages.clear()
        assert self.slave.restore(image) == ERROR
        (message,) = self.slave.messages
        assert message.status == ERROR
        assert all(text in message.text for text in texts), message.text

    def is_unharmed(self) -> None:
        assert self.slave.state() == self.image
        assert go_on(self.slave, FIRST, 5) == self.expected
        assert self.slave.restore(self.image) == OK


@apart
def test_states_of_other_units_are_refused(archive: Archive, fmus: Path, tmp_path: Path) -> None:
    keeper = Keeper(archive)
    for unit in UNITS:
        if unit == archive.unit:
            continue
        other = Slave(unpack(unit, fmus, tmp_path / unit)).initialized()
        image = other.state()
        other.free()
        keeper.refuses(image, "the state belongs to GUID", archive.guid)
    keeper.is_unharmed()


@apart
def test_states_of_other_resources_are_refused(plant: Archive, tmp_path: Path) -> None:
    """The same binary with another machine: its own modes at twice the frequency."""
    resources = plant.folder / "resources"
    lines = (resources / "modes.csv").read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines[1:]]
    stiffer = [",".join([row[0], repr(2 * float(row[1])), *row[2:]]) for row in rows]
    shutil.copy(resources / "axes.csv", tmp_path / "axes.csv")
    (tmp_path / "modes.csv").write_text("\n".join([lines[0], *stiffer]) + "\n", encoding="utf-8")
    out = tmp_path / "packed" / "plant.fmu"
    command = [sys.executable, "-m", "feedsim_packager", "repack", str(plant.path), "--axes"]
    command += [str(tmp_path / "axes.csv"), "--modes", str(tmp_path / "modes.csv"), "--name", "stiffer"]
    done = subprocess.run([*command, "--out", str(out)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    packed = unpack("plant", out.parent, tmp_path / "unpacked")
    other = Slave(packed).initialized()
    keeper = Keeper(plant)
    keeper.refuses(other.state(), "the state belongs to GUID", packed.guid, plant.guid)
    keeper.is_unharmed()
    other.free()


# The heading, told here a second time on purpose: a state that an older version wrote must not be taken for a new one.
MAGIC, FORMAT, ORDER, GUID, SIZES, CHECKSUM, HEADING = 0, 8, 12, 16, 56, 80, 88


@apart
def test_other_versions_and_machines_are_told_apart(archive: Archive) -> None:
    keeper = Keeper(archive)
    image = keeper.image
    assert image[:8] == b"FEEDSIM\0"
    (version,) = struct.unpack_from("<I", image, FORMAT)
    for other in (0, version + 1, 2**32 - 1):
        changed = image[:FORMAT] + struct.pack("<I", other) + image[ORDER:]
        keeper.refuses(changed, f"format version {other}", f"expected is {version}")
    keeper.refuses(image[:ORDER] + image[ORDER:GUID][::-1] + image[GUID:], "another byte order")
    keeper.refuses(b"PK\3\4 some" + image[8:], "not a saved state")
    keeper.is_unharmed()


@apart
def test_what_is_cut_short_is_refused(archive: Archive) -> None:
    keeper = Keeper(archive)
    lengths = sorted({*range(HEADING + 8), *range(0, len(keeper.image), 97), len(keeper.image) - 1})
    for length in lengths:
        keeper.refuses(keeper.image[:length])
    keeper.is_unharmed()
    longer = keeper.image + b"what follows in a file"
    assert keeper.slave.restore(longer) == OK  # an importer's buffer may be larger
    keeper.is_unharmed()


@apart
def test_a_flipped_bit_is_found(archive: Archive) -> None:
    """Any in the heading, and many behind it."""
    keeper = Keeper(archive)
    rng = random.Random(archive.unit)
    places = [(at, bit) for at in range(HEADING) for bit in range(8)]
    places += [(rng.randrange(HEADING, len(keeper.image)), rng.randrange(8)) for _ in range(2000)]
    for at, bit in places:
        changed = bytearray(keeper.image)
        changed[at] ^= 1 << bit
        keeper.refuses(bytes(changed))
    keeper.is_unharmed()


# Behind the heading: what the shell keeps, then variables and slopes, then (at `model`) the model's own state.
START, STOP, TIME, PHASE, STALE, LAST_STEP = (HEADING + at for at in (0, 8, 16, 32, 36, 44))


def _model(image: bytes) -> int:
    """Where the model's state begins."""
    (fixed,) = struct.unpack_from("<Q", image, SIZES + 8)
    return HEADING + int(fixed)


def _signed(image: bytes) -> bytes:
    """With the checksum of its contents: FNV-1a of 64 bits."""
    found = 0xCBF29CE484222325
    for byte in image[HEADING:]:
        found = (found ^ byte) * 0x100000001B3 % 2**64
    return image[:CHECKSUM] + struct.pack("<Q", found) + image[HEADING:]


def _with(image: bytes, at: int, layout: str, value: float) -> bytes:
    changed = bytearray(image)
    struct.pack_into(layout, changed, at, value)
    return _signed(bytes(changed))


@apart
def test_the_checksum_is_known_here(archive: Archive) -> None:
    """Else the tests below would only see that a wrong one is found."""
    keeper = Keeper(archive)
    assert _signed(keeper.image[:CHECKSUM] + bytes(8) + keeper.image[HEADING:]) == keeper.image


@apart
def test_what_no_life_leads_to_is_refused(archive: Archive) -> None:
    keeper = Keeper(archive)
    image = keeper.image
    for at, layout, value, text in (
        (PHASE, "<I", 5, "in phase 5 of 5"),
        (STALE, "<I", 1, "initialised (phase 2), but without initial values"),
        (LAST_STEP, "<I", 77, "no step ends with status 77"),
        (START, "<d", math.nan, "started at nan s"),
        (TIME, "<d", -math.inf, "stands at -inf s"),
        (STOP, "<d", math.nan, "stops at nan s"),
    ):
        keeper.refuses(_with(image, at, layout, value), text)
    keeper.is_unharmed()


@pytest.fixture(scope="module")
def controller(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return unpack("controller", fmus, tmp_path_factory.mktemp("controller"))


# Offsets in the controller's state: struct DriveState.
@pytest.mark.parametrize(
    ("at", "layout", "text", "end"),
    [
        (0, "<q", "sample instant", 2**53),
        (8, "<q", "cycle within T_pos", 8),
        (128, "<i", "place in the delay line of x_s", 7),  # (1.326 + 3.528) ms / 1 ms: 3 to 6 cycles ago
        (132, "<i", "place in the delay line of n_ffw", 4),
        (168, "<i", "place in the delay line of T_ref", 1),
        (176, "<i", "place in the delay line of speed_window", 1),
    ],
)
@apart
def test_counts_of_the_controller_are_refused_beyond_their_range(
    controller: Archive, at: int, layout: str, text: str, end: int
) -> None:
    keeper = Keeper(controller)
    bits = 8 * struct.calcsize(layout)
    for value in (-1, end, 2 ** (bits - 1) - 1, -(2 ** (bits - 1))):
        image = _with(keeper.image, _model(keeper.image) + at, layout, value)
        keeper.refuses(image, f"the state is out of range: {text} is {float(value):.0f}; allowed is 0 to {end - 1}")
    keeper.is_unharmed()
    last = _with(keeper.image, _model(keeper.image) + at, layout, end - 1)
    if layout == "<q":  # in range, but not what the clock says, or the count of the instants
        keeper.refuses(last, "the state contradicts itself", "sample instants")
        return
    assert keeper.slave.restore(last) == OK
    go_on(keeper.slave, FIRST, 20)


@apart
def test_counts_belong_to_the_parameters_of_the_state(controller: Archive) -> None:
    """Not to those of the instance that it is handed to."""
    keeper = Keeper(controller)
    T_dyn = of(controller, "parameter")["T_dyn"]
    slow = Slave(controller).set_up()
    slow.set([T_dyn], [0.1])
    slow.must("fmi2ExitInitializationMode")
    go_on(slow, 0, FIRST)
    image = slow.state()
    expected = go_on(slow, FIRST, MORE)
    (place,) = struct.unpack_from("<i", image, _model(image) + 128)
    assert place > 90  # the shorter line of the other instance has 7
    assert keeper.slave.restore(image) == OK
    assert go_on(keeper.slave, FIRST, MORE) == expected
    assert keeper.slave.restore(keeper.image) == OK
    keeper.refuses(_with(image, _model(image) + 128, "<i", place + 20), "place in the delay line of x_s")
    keeper.is_unharmed()
    slow.free()


@apart
def test_a_cell_that_is_not_there_is_refused(plant: Archive) -> None:
    keeper = Keeper(plant)
    for cell in (1, 2**31, 2**64 - 1):
        image = _with(keeper.image, _model(keeper.image) + 8, "<Q", cell)
        keeper.refuses(image, f"cell {float(cell):.0f} of the poses; allowed is less than 1")
    keeper.is_unharmed()


@apart
def test_outputs_left_for_later_need_the_parameters_they_belong_to(plant: Archive, tmp_path: Path) -> None:
    """A state that its own table belies is refused, and the table of the instance is gone by then: what the steps have
    left to be computed when it is read would be read past the end of the state."""
    header, *modes = (plant.folder / "resources" / "modes.csv").read_text(encoding="utf-8").splitlines(True)
    small, large = tmp_path / "small.csv", tmp_path / "large.csv"
    small.write_text("".join([header, *modes[:20]]), encoding="utf-8")
    large.write_text("".join([header, *modes[:20] * 3000]), encoding="utf-8")  # beyond what is mapped

    def stepped(file: Path) -> Slave:
        slave = Slave(plant)
        name = (ctypes.c_char_p * 1)(str(file).encode())
        slave.must("fmi2SetString", references([of(plant, "parameter", "String")["modes_file"]]), 1, name)
        slave.initialized().set([of(plant, "input")["X.M_a"]], [1.0])
        slave.step(0.0, 1e-4)
        return slave

    other = stepped(large)
    image = other.state()
    other.free()
    size, fixed, state = struct.unpack_from("<3Q", image, SIZES)
    forged = bytearray(image[:size] + bytes(16))
    struct.pack_into("<3Q", forged, SIZES, size + 16, fixed, state + 16)
    slave = stepped(small)
    small.unlink()
    assert slave.restore(_signed(bytes(forged))) == ERROR
    outputs = of(plant, "output")
    assert math.isfinite(slave.get([outputs["X.x_a"]])[0])
    for _ in range(2):
        found = reals([0.0])
        assert slave.call("fmi2GetReal", references([outputs["tool.x_X"]]), 1, found) == ERROR
        assert "output 'tool.x_X' cannot be computed: the present parameters were refused" in slave.last
    assert slave.call("fmi2GetFMUstate", ctypes.byref(ctypes.c_void_p())) == ERROR
    slave.must("fmi2Reset")
