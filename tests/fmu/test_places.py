"""Where an importer unpacks to and what it says about it: any name, any spelling, read-only, under any locale."""

import ctypes
import functools
import locale
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

import fmpy
import pytest

import fmi_helpers
from fmu.apart import apart
from fmu.binary import ERROR, Slave, of
from fmu.continued import go_on
from fmu.unpacked import RESOURCES, Archive

FOLDERS = (
    "plain",
    "with spaces in it",
    "Größenverhältnis Ä ß",
    "工具机 テスト",
    "100 % done, 5% more %zz %",
    "a#b#c",
    "q?x=1&y=2;z",
    "quote'and\"double",
    "deep/er/" * 20 + "end",
)


def _encoded(path: Path) -> str:
    return quote(str(path))


def _as_is(path: Path) -> str:
    return str(path)


SPELLINGS: dict[str, Callable[[Path], str]] = {
    "file:///, encoded": lambda path: f"file://{_encoded(path)}",
    "file:/, encoded": lambda path: f"file:{_encoded(path)}",
    "file://localhost/, encoded": lambda path: f"file://localhost{_encoded(path)}",
    "FILE:///, all encoded": lambda path: (
        "FILE://" + "".join(f"%{byte:02x}" if byte != 47 else "/" for byte in os.fsencode(path))
    ),
    "file:///, as it is": lambda path: f"file://{_as_is(path)}",
    "file:/, as it is": lambda path: f"file:{_as_is(path)}",
    "path": _as_is,
    "file:///, encoded, closed": lambda path: f"file://{_encoded(path)}/",
    "path, closed": lambda path: f"{_as_is(path)}//",
}


@functools.cache
def _expected(archive: Archive) -> list[list[float]]:
    slave = Slave(archive).initialized()
    rows = go_on(slave, 0, 10)
    slave.free()
    return rows


def _alive(slave: Slave) -> None:
    """It is an instance, and of the right resources: those of the archive, not what was compiled in."""
    assert slave.component, slave.last
    assert slave.messages == [] or all(message.status == 0 for message in slave.messages)
    slave.initialized()
    assert go_on(slave, 0, 10) == _expected(slave.archive)
    slave.free()


def _move(archive: Archive, folder: Path) -> Path:
    """Library and resources in a place of that name; answers with the library."""
    if os.name == "nt" and set(str(folder)) & set('?"*<>|'):
        pytest.skip("no such name on Windows")
    (folder / "resources").mkdir(parents=True)
    if (archive.folder / "resources").is_dir():
        shutil.copytree(archive.folder / "resources", folder / "resources", dirs_exist_ok=True)
    return Path(shutil.copy(archive.library, folder))


@pytest.mark.parametrize("name", FOLDERS, ids=lambda name: name[:12])
@apart
def test_folders_of_any_name_in_any_spelling(archive: Archive, name: str, tmp_path: Path) -> None:
    library = _move(archive, tmp_path / name)
    for spelling, write in SPELLINGS.items():
        location = write(tmp_path / name / "resources").encode()
        slave = Slave(archive, location=location, library=library)
        assert slave.component, f"{spelling}: {slave.last}"
        _alive(slave)


@apart
def test_relative_locations_are_those_of_the_current_folder(archive: Archive, tmp_path: Path) -> None:
    library = _move(archive, tmp_path / "here")
    os.chdir(tmp_path)
    for location in (b"here/resources", b"file:here/resources", b"./here/../here/resources/", b"file:./here/resources"):
        _alive(Slave(archive, location=location, library=library))


@apart
def test_places_that_are_none(archive: Archive, tmp_path: Path) -> None:
    """A unit that needs its resources says which file it misses and where; the others do not mind."""
    needs = archive.unit in ("plant", "setpoint", "machine")
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("no folder\n")
    for place in ("nowhere at all", "empty", "file", "x" * 1000):
        slave = Slave(archive, location=(tmp_path / place).as_uri().encode())
        assert (slave.component is None) == needs
        if needs:
            assert ".csv" in slave.last
            assert place[:200].partition("%")[0] in slave.last
        else:
            slave.free()
    for location in (None, b""):
        arguments = {"location": location} if location is None else {"location": b"file:"}
        slave = Slave(archive, **arguments)  # what is compiled in
        assert slave.component, slave.last
        slave.free()
    for location in (b"http://example.org/resources", b"fmu://", b"jar:file:/a.jar!/resources"):
        slave = Slave(archive, location=location, logging=True)
        assert any("names no file" in each.text for each in slave.messages) or slave.component is None
        if slave.component:
            slave.free()


@apart
def test_through_an_importer(archive: Archive, tmp_path: Path) -> None:
    """FMPy unpacks to a folder of that name and runs the archive from there."""
    folder = tmp_path / "Ünpacked 100 % of 中文 #1"
    folder.mkdir()
    fmpy.extract(str(archive.path), unzipdir=str(folder))
    result = fmpy.simulate_fmu(str(folder), stop_time=0.01, step_size=125e-6, output_interval=1e-3)
    assert len(result) == 11


# --- read-only

CAPABILITIES = 0x20080522  # _LINUX_CAPABILITY_VERSION_3
OVERRIDING = (1 << 1) | (1 << 2) | (1 << 3)  # CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH, CAP_FOWNER


def _heed_permissions() -> None:
    """Give up what lets root write where nobody may; this process does not get it back."""
    libc = ctypes.CDLL(None)
    head = (ctypes.c_uint32 * 2)(CAPABILITIES, 0)
    data = (ctypes.c_uint32 * 6)()
    if libc.capget(head, data) == 0:
        for part in (0, 1):
            data[part] &= ~OVERRIDING
        libc.capset(head, data)


def _writable(folder: Path) -> bool:
    try:
        (folder / "probe").write_text("")
    except OSError:
        return False
    return True


@apart
def test_read_only_folders(archive: Archive, tmp_path: Path) -> None:
    """The folder of the archive and the current one, and the one for temporary files."""
    if not hasattr(ctypes.CDLL(None), "capset") and os.geteuid() == 0:
        pytest.skip("root cannot give up writing here")
    folder = tmp_path / "unpacked"
    library = _move(archive, folder)
    before = sorted(path.relative_to(folder) for path in folder.rglob("*"))
    for path in (folder, *folder.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    os.environ["TMPDIR"] = str(folder)
    os.chdir(folder)
    _heed_permissions()
    try:
        if _writable(folder):
            pytest.skip("this process writes into read-only folders whatever it does")
        _alive(Slave(archive, location=(folder / "resources").as_uri().encode(), library=library, logging=True))
        assert sorted(path.relative_to(folder) for path in folder.rglob("*")) == before
    finally:
        for path in (folder, folder / "resources"):
            path.chmod(0o755)


@apart
def test_files_that_may_not_be_read(plant: Archive, tmp_path: Path) -> None:
    library = _move(plant, tmp_path / "unpacked")
    resources = tmp_path / "unpacked" / "resources"
    (resources / "modes.csv").chmod(0)
    _heed_permissions()
    if os.access(resources / "modes.csv", os.R_OK, effective_ids=os.access in os.supports_effective_ids):
        pytest.skip("this process reads whatever it likes")
    slave = Slave(plant, location=resources.as_uri().encode(), library=library)
    assert slave.component is None
    assert str(resources / "modes.csv") in slave.last


# --- locale


def _decimal_comma(folder: Path) -> str:
    """Set a locale that writes 0,5 for this process: an installed one, else one made for the test."""
    for name in ("de_DE.UTF-8", "de_DE.utf8", "de_DE", "fr_FR.UTF-8", "German_Germany"):
        try:
            return locale.setlocale(locale.LC_ALL, name)
        except locale.Error:
            continue
    if not shutil.which("localedef"):
        pytest.skip("no locale with a decimal comma is installed, and localedef is not there to make one")
    made = folder / "xx_XX.UTF-8"
    source = folder / "xx_XX"
    parts = {  # as little as a locale can have: numbers are all that counts here
        "LC_NUMERIC": 'decimal_point ","\nthousands_sep "."\ngrouping 3;3\n',
        **{part: 'copy "POSIX"\n' for part in ("LC_CTYPE", "LC_COLLATE", "LC_MONETARY", "LC_TIME", "LC_MESSAGES")},
    }
    source.write_text("".join(f"{name}\n{text}END {name}\n" for name, text in parts.items()))
    command = ["localedef", "-c", "-f", "UTF-8", "-i", str(source), str(made)]
    subprocess.run(command, capture_output=True, check=False)
    os.environ["LOCPATH"] = str(folder)
    try:
        return locale.setlocale(locale.LC_NUMERIC, made.name)
    except locale.Error:
        pytest.skip("no locale with a decimal comma can be made")


@apart
def test_a_decimal_comma(archive: Archive, tmp_path: Path) -> None:
    point = Slave(archive).initialized()
    go_on(point, 0, 10)
    expected = point.state()
    _decimal_comma(tmp_path)
    assert locale.localeconv()["decimal_point"] == ","
    libc = ctypes.CDLL(None)
    text = ctypes.create_string_buffer(16)
    libc.snprintf(text, 16, b"%.1f", ctypes.c_double(0.5))
    assert text.value == b"0,5", "the C library shall write a comma here"
    slave = Slave(archive).initialized()  # reads its tables, the archive's numbers among them
    go_on(slave, 0, 10)
    assert slave.state() == expected
    assert slave.call("fmi2DoStep", 0.5, 0.25, 1) == ERROR
    assert "(t = 0.5 s, h = 0.25 s): the communication point is 0.5 s" in slave.last
    assert "," not in slave.last.replace(" s, h =", "").replace("0.5 s, but", "")
    slave.get(list(of(archive, "output").values()))
    slave.free()
    point.free()


OF_OTHERS = "of files that are not embedded in this unit; the importer must give the resource location"


@pytest.mark.parametrize("unit", RESOURCES)
@pytest.mark.parametrize(
    ("location", "said"),
    [
        (False, [OF_OTHERS, "it gave none"]),
        ("", [OF_OTHERS, "it gave none"]),
        ("http://host/archive/resources", [OF_OTHERS, "it gave http://host/archive/resources"]),
        ("jar:file:/a.fmu!/resources", [OF_OTHERS, "it gave jar:file:/a.fmu!/resources"]),
        ("file:///nowhere/a", ["/nowhere/a/", "location 'file:///nowhere/a' must be the folder resources"]),
        ("file://host/resources", ["//host/resources/", "location 'file://host/resources' must be the folder"]),
        ("nowhere", ["nowhere/", "location 'nowhere' must be the folder resources of the unpacked archive"]),
    ],
)  # fmt: skip
def test_a_machine_that_is_not_embedded_asks_for_the_location(
    unit: str, location: str | bool, said: list[str], fmus: Path, tmp_path: Path
) -> None:
    """The shipped binary under the GUID of other resources, as in an archive with another machine or motion."""
    other = fmi_helpers.Archive.unpack(fmus / f"{unit}.fmu", tmp_path / unit)
    other.description.guid = other.description.guid[:17] + 16 * "0"
    messages: list[fmi_helpers.Message] = []
    with pytest.raises(RuntimeError, match="failed to instantiate"):
        fmi_helpers.Instance(other, messages, resources=location)
    refusal = messages[-1].text
    assert all(part in refusal for part in said), refusal
    assert "anew" not in refusal  # the archive is sound
