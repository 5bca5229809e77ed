"""Serialised states as files between processes: continued to the last bit by the unit they belong to, refused with a
message by any other, and by all where they are damaged."""

import os
import random
import shutil
import struct
import subprocess
import sys
from pathlib import Path

from fmu.apart import apart
from fmu.binary import ERROR, OK, Slave
from fmu.continued import go_on
from fmu.unpacked import ROOT, UNITS, Archive, unpack

FIRST, MORE = 40, 60


def _elsewhere(archive: Archive, first: int, count: int, state: Path | None = None) -> tuple[list[list[float]], bytes]:
    command = [sys.executable, "-m", "fmu.continued", archive.unit, str(archive.path), str(archive.folder)]
    command += [str(first), str(count), *([str(state)] if state else [])]
    paths = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT / "tests"), str(ROOT / "src/fmi2")])}
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
    command = [sys.executable, str(ROOT / "src/fmi2/packager"), "repack", str(plant.path), "--axes"]
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
