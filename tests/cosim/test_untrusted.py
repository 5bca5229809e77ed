"""Archives that cannot be loaded here, and files made to do harm: refused with words, on any platform."""

from __future__ import annotations

import platform
import shutil
import zipfile
from pathlib import Path

import pytest

from feedsim import cli
from feedsim.foundation.errors import InputError
from feedsim.simulation.cosim import archive as archives
from feedsim.simulation.cosim import unpacked
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.friction_law import FrictionLaw
from feedsim.simulation.cosim.unit import Unit
from ssp_helpers import UNPACKED, contents, write

ROOT = Path(__file__).resolve().parents[2]
HOST = archives.folders()[0]


@pytest.fixture
def friction(fmus: Path) -> dict[str, bytes]:
    return contents(fmus / "friction.fmu")


def refusal(file: Path) -> str:
    before = Path.cwd()
    with pytest.raises(InputError) as caught, Archive(file) as archive:
        Unit(archive, "friction")
    assert str(file) in str(caught.value)
    assert UNPACKED not in str(caught.value)  # not of the folder that it was unpacked to
    assert Path.cwd() == before
    return str(caught.value)


def of_host(files: dict[str, bytes]) -> str:
    (name,) = [name for name in files if name.startswith(f"binaries/{HOST}/")]
    return name


def test_no_binary_for_this_platform(friction: dict[str, bytes], tmp_path: Path) -> None:
    library = friction.pop(of_host(friction))
    friction = {name: content for name, content in friction.items() if not name.startswith("binaries/")}
    said = refusal(write(tmp_path / "none.fmu", friction))
    assert f"no binary for this platform, {platform.system()} on {platform.machine()}" in said
    assert f"binaries/{HOST}/friction" in said
    assert "it has none at all" in said
    other = friction | {"binaries/riscv64-linux/friction.so": library, "binaries/win32/friction.dll": b""}
    assert "it has riscv64-linux, win32" in refusal(write(tmp_path / "other.fmu", other))


@pytest.mark.parametrize("junk", [b"", b"no library", b"\x7fELF"])
def test_a_binary_that_is_none(friction: dict[str, bytes], tmp_path: Path, junk: bytes) -> None:
    said = refusal(write(tmp_path / "junk.fmu", friction | {of_host(friction): junk}))
    assert f"its binary for this platform, in binaries/{HOST}, cannot be loaded" in said


def test_a_library_without_the_functions(friction: dict[str, bytes], tmp_path: Path) -> None:
    import _ctypes

    library = Path(_ctypes.__file__).read_bytes()
    assert "cannot be loaded" in refusal(write(tmp_path / "other.fmu", friction | {of_host(friction): library}))


@pytest.mark.parametrize("identifier", ["../../x", "", "a b", "friction.so", "/etc/x", "é"])
def test_an_identifier_that_is_none(friction: dict[str, bytes], tmp_path: Path, identifier: str) -> None:
    text = friction["modelDescription.xml"].decode()
    assert 'modelIdentifier="friction"' in text
    text = text.replace('modelIdentifier="friction"', f'modelIdentifier="{identifier}"')
    said = refusal(write(tmp_path / "x.fmu", friction | {"modelDescription.xml": text.encode()}))
    assert "is no C identifier" in said or "modelIdentifier" in said  # the schema refuses some


@pytest.mark.parametrize(
    ("host", "folder", "other"),
    [
        (("Linux", "x86_64"), "linux64", "x86_64-linux"),
        (("Linux", "aarch64"), "aarch64-linux", "linux64"),
        (("Darwin", "arm64"), "aarch64-darwin", "darwin64"),
        (("Darwin", "x86_64"), "darwin64", "x86_64-darwin"),
        (("Windows", "AMD64"), "win64", "x86_64-windows"),
        (("Windows", "ARM64"), "aarch64-windows", "win64"),
    ],
)
def test_the_folder_of_each_platform(
    friction: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, host: tuple[str, str], folder: str,
    other: str,
) -> None:  # fmt: skip
    """What this machine's library is called there; the packager's folder for a host is the first that is looked at."""
    from feedsim_packager import targets

    suffix = {"Windows": ".dll", "Darwin": ".dylib"}.get(host[0], ".so")
    library = friction[of_host(friction)]
    bare = {name: content for name, content in friction.items() if not name.startswith("binaries/")}
    monkeypatch.setattr(platform, "system", lambda: host[0])
    monkeypatch.setattr(platform, "machine", lambda: host[1])
    assert archives.folders() == (folder, other)
    if host in targets._HOSTS:
        assert targets.host_target().folder == folder
    for place in (folder, other):
        file = write(tmp_path / "friction.fmu", bare | {f"binaries/{place}/friction{suffix}": library})
        with Archive(file) as archive:
            Unit(archive, "friction").close()
        with FrictionLaw(tmp_path) as law:
            assert law({}, [0.0, 1.0], 1e-3).shape == (2,)
    both = {f"binaries/{place}/friction{suffix}": library for place in (folder, other)}
    with Archive(write(tmp_path / "both.fmu", bare | both)) as archive:
        assert archives.library(archive.directory, "friction", archive.platforms, "both").parent.name == folder


def test_the_command_line_says_it(
    friction: dict[str, bytes], fmus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "fmus"
    shutil.copytree(fmus, folder)
    write(folder / "friction.fmu", {name: x for name, x in friction.items() if not name.startswith("binaries/")})
    file = ROOT / "scenarios" / "z_positioning.yaml"
    assert cli.main(["run", str(file), "--fmus", str(folder), "--out", str(tmp_path / "out")]) == 2
    assert "no binary for this platform" in capsys.readouterr().err


def test_a_document_type_in_any_encoding(friction: dict[str, bytes], tmp_path: Path) -> None:
    text = friction["modelDescription.xml"].decode()
    head, _, rest = text.partition("?>")
    assert rest
    for encoding in ("utf-8", "utf-16", "utf-16-le", "utf-16-be", "iso-8859-1"):
        declared = head.replace("UTF-8", "UTF-16" if encoding.startswith("utf-16") else encoding)
        bad = f'{declared}?><!DOCTYPE x [<!ENTITY a "b">]>{rest}'.encode(encoding)
        mark = {"utf-16-le": b"\xff\xfe", "utf-16-be": b"\xfe\xff"}.get(encoding, b"")
        said = refusal(write(tmp_path / "x.fmu", friction | {"modelDescription.xml": mark + bad}))
        assert "document type declaration" in said, encoding
    comment = text.replace("?>", "?><!-- <!DOCTYPE is only a word here -->", 1)
    with Archive(write(tmp_path / "x.fmu", friction | {"modelDescription.xml": comment.encode()})):
        pass


def test_more_than_it_may_unpack_to(friction: dict[str, bytes], tmp_path: Path) -> None:
    """Zeros deflate to a thousandth; what no run needs may be as large as it likes."""
    zeros = bytes(unpacked.FREE_BYTES + 1)
    said = refusal(write(tmp_path / "bomb.fmu", friction | {"resources/zeros": zeros}))
    assert "unpacks to" in said
    with Archive(write(tmp_path / "source.fmu", friction | {"sources/zeros": zeros})) as archive:
        assert not (archive.directory / "sources").exists()


def test_entries_that_tell_a_smaller_size(friction: dict[str, bytes], tmp_path: Path) -> None:
    """The size that counts is the one that is unpacked."""
    file = write(tmp_path / "lie.fmu", friction | {"resources/zeros": bytes(1 << 20)})
    raw = file.read_bytes()
    at = raw.rindex(b"PK\x01\x02", 0, raw.rindex(b"resources/zeros"))
    file.write_bytes(raw[: at + 24] + (100).to_bytes(4, "little") + raw[at + 28 :])
    assert "not a usable FMI 2.0 archive" in refusal(file)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["resources/a", "resources/a/b"], "is in the folder 'resources/a', which is a file too"),
        (["resources/" + 300 * "x"], "has a name of more than 240 bytes"),
        (["resources/" + 130 * "ä"], "has a name of more than 240 bytes"),
        (["resources/" + 600 * "x/" + "y"], "has a name of more than 240 bytes (1024 with its folders)"),
        (["../evil"], "leads out"),
        (["resources/x", "resources/X"], "'resources/X' differs from 'resources/x' only in case or accents"),
        (["resources/x/a", "Resources/X/A"], "differs from 'resources/x/a' only in case"),
        (["resources/\u00e9", "resources/e\u0301"], "only in case or accents"),
        (["resources/a", "resources/A/b"], "is in the folder 'resources/a', which is a file too"),
        (["resources/./a"], "has a part that is empty or '.'"),
        (["./a"], "has a part that is empty or '.'"),
        (["resources//a"], "has a part that is empty or '.'"),
        (["resources/CON"], "has a part, 'CON', that is a device on Windows"),
        (["resources/nul.csv"], "a device on Windows"),
        (["aux /a"], "has a part that ends in a dot or a space, 'aux '"),
        (["resources/com1 .txt"], "a device on Windows"),
        (["resources/a."], "ends in a dot or a space, 'a.'"),
        (["resources/a /b"], "ends in a dot or a space, 'a '"),
        (["resources/.../b"], "ends in a dot or a space"),
        (["resources\\..\\..\\evil"], "leads out"),
        (["\\\\server\\evil"], "leads out"),
        (["C:\\evil"], "leads out"),
        (["resources\\a", "resources/a"], "is there twice"),
        (["resources\\a", "resources/A"], "only in case"),
        (["resources\\\\a"], "has a part that is empty or '.'"),
    ],
)
def test_names_that_no_disk_takes(friction: dict[str, bytes], tmp_path: Path, names: list[str], words: str) -> None:
    assert words in refusal(write(tmp_path / "x.fmu", friction | dict.fromkeys(names, b"")))


def test_names_that_every_disk_takes(friction: dict[str, bytes], tmp_path: Path) -> None:
    """Dots and spaces inside, names that only begin as a device's, folders as entries of their own."""
    names = ["a b.csv", ".hidden", "a..b", "console.txt", "com10", "auxiliary/x", "X/a", "X/b", "stra\u00dfe", "empty/"]
    with Archive(write(tmp_path / "x.fmu", friction | {f"resources/{name}": b"" for name in names})) as archive:
        assert sum(path.is_file() for path in (archive.directory / "resources").rglob("*")) >= len(names) - 1


def test_backslashes_separate(friction: dict[str, bytes], tmp_path: Path) -> None:
    """Throughout, folders as entries of their own included."""
    written = {name.replace("/", "\\"): content for name, content in friction.items()} | {"resources\\empty\\": b""}
    with Archive(write(tmp_path / "x.fmu", written)) as archive:
        Unit(archive, "friction").close()
        assert (archive.directory / of_host(friction)).is_file()


def test_a_method_of_another_kind(friction: dict[str, bytes], tmp_path: Path) -> None:
    file = write(tmp_path / "x.fmu", friction)
    with zipfile.ZipFile(file, "a", zipfile.ZIP_LZMA) as package:
        package.writestr("resources/x", b"x")
    assert "neither stored nor deflated" in refusal(file)


def test_many_faults_are_not_all_told(friction: dict[str, bytes], tmp_path: Path) -> None:
    said = refusal(write(tmp_path / "x.fmu", friction | {f"../{i}": b"" for i in range(1000)}))
    assert "980 more like these" in said
    assert len(said) < 10_000
