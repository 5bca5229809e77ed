"""Libraries for other platforms: reading what is in them, joining them, refusing those that would not run elsewhere."""

import os
import re
import shutil
import struct
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
import setuptools

from feedsim_packager import binary, compile, portable, targets, universal
from feedsim_packager.errors import CompilerError, InputError
from fmu.unpacked import PLATFORM, Archive

# --- universal files

X86_64, ARM64 = 0x01000007, 0x0100000C


def thin(cputype: int, body: bytes = b"", subtype: int = 0) -> bytes:
    """The head of a Mach-O library and what follows."""
    return struct.pack("<Iii", 0xFEEDFACF, cputype, subtype) + body


def test_a_universal_file_is_a_table_and_the_libraries_as_they_are() -> None:
    slices = [thin(X86_64, b"x" * 5000, 3), thin(ARM64, b"a" * 100)]
    joined = universal.join(slices)
    assert universal.split(joined) == slices
    # read by hand: cputype, cpusubtype, offset, size, exponent of the alignment
    assert struct.unpack_from(">II", joined) == (0xCAFEBABE, 2)
    assert struct.unpack_from(">5I", joined, 8) == (X86_64, 3, 4096, 5012, 12)
    assert struct.unpack_from(">5I", joined, 28) == (ARM64, 0, 16384, 112, 14)
    assert len(joined) == 16384 + 112
    assert set(joined[48:4096]) == {0}


def test_what_is_no_library_is_not_joined() -> None:
    for slices in ([], [thin(X86_64), thin(X86_64)], [b"\x7fELF" + bytes(60)], [thin(7)], [b"short"]):
        with pytest.raises(ValueError, match=r"Mach-O|per processor"):
            universal.join(slices)
    joined = universal.join([thin(X86_64), thin(ARM64)])
    for damaged in (joined[:-1], joined[:20], b"\xca\xfe\xba\xbf" + joined[4:], b""):
        with pytest.raises(ValueError, match="universal file"):
            universal.split(damaged)


# --- reading libraries


@pytest.mark.skipif(PLATFORM.suffix != ".so" or not shutil.which("nm"), reason="needs nm")
def test_elf_is_read_as_nm_reads_it(archive: Archive) -> None:
    (found,) = binary.read(archive.library.read_bytes())
    listed = {}
    for kind in ("--defined-only", "--undefined-only"):
        command = ["nm", "-D", "-P", kind, str(archive.library)]
        lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
        listed[kind] = {line.split("@")[0].split()[0] for line in lines if line.split()[1] != "w"}
    assert found.exported == listed["--defined-only"]
    assert found.imported == listed["--undefined-only"]
    assert set(found.libraries) <= {"libc.so.6", "libm.so.6"}


@pytest.mark.skipif(PLATFORM.suffix != ".so", reason="needs the names that glibc has")
def test_a_unit_asks_for_nothing_but_the_c_library_and_its_mathematics(archive: Archive) -> None:
    """Functions of C99 (and the two names under which compilers call them), none that starts a thread, takes a lock,
    asks for the time or talks to anybody; files and memory are for instantiation and initialisation."""
    memory = {"calloc", "free"}
    files = {"fopen", "fclose", "fread", "feof", "ferror"}
    texts = {"strlen", "strcmp", "strncmp", "strchr", "strstr", "strspn", "strcspn", "strcpy", "strncpy", "strcat"}
    texts |= {"memchr", "memcmp", "bcmp", "memcpy", "memmove", "memset", "snprintf", "vsnprintf", "strtod", "strtol"}
    texts |= {"localeconv", "__ctype_b_loc", "__vsnprintf_chk", "__snprintf_chk", "stpcpy"}
    mathematics = {"exp", "expm1", "pow", "log", "log1p", "sin", "cos", "sincos", "tan", "sqrt", "hypot", "fabs"}
    mathematics |= {"floor", "ceil", "fmod", "fmin", "fmax", "round", "lround", "llround", "remainder"}
    (found,) = binary.read(archive.library.read_bytes())
    assert found.imported <= memory | files | texts | mathematics


def test_pe_is_read() -> None:
    """A launcher that setuptools brings along: a real program of Windows, without exports."""
    launcher = Path(setuptools.__file__).parent / "cli-64.exe"
    if not launcher.is_file():
        pytest.skip("setuptools has no launcher for Windows any more")
    (found,) = binary.read(launcher.read_bytes())
    assert (found.format, found.processor, found.exported) == ("PE", "x86_64", frozenset())
    assert "kernel32.dll" in {name.lower() for name in found.libraries}
    assert {"GetModuleFileNameA", "GetStdHandle"} & found.imported


def dylib(exported: str = "_fmi2DoStep", *, signed: bool = True, minimum: int = 11 << 16) -> bytes:
    """A library with one exported and one undefined symbol, put together by <mach-o/loader.h>."""

    def with_name(command: int, name: bytes) -> bytes:
        padded = name + bytes(8 - len(name) % 8)
        return struct.pack("<6I", command, 24 + len(padded), 24, 2, 0, 0) + padded

    label = exported.encode() + b"\0"
    leaf = b"\x02\x00\x20" + b"\x00"  # a value of 2 bytes (flags, address), no children
    trie = b"\x00\x01" + label + bytes([len(label) + 3]) + leaf
    strings = b"\0_exp\0"
    symbol = struct.pack("<IBBHQ", 1, 0x01, 0, 0, 0)  # undefined, external
    local = struct.pack("<IBBHQ", 1, 0x0E, 1, 0, 0)  # defined, not external
    commands = [with_name(0x0D, b"@rpath/unit.dylib"), with_name(0x0C, b"/usr/lib/libSystem.B.dylib")]
    size = sum(map(len, commands)) + 24 + 16 + 24 + (16 if signed else 0)
    at = 32 + size
    commands.append(struct.pack("<6I", 0x02, 24, at, 2, at + 32, len(strings)))
    commands.append(struct.pack("<4I", 0x80000033, 16, at + 32 + len(strings), len(trie)))
    commands.append(struct.pack("<6I", 0x32, 24, 1, minimum, 0, 0))
    if signed:
        commands.append(struct.pack("<4I", 0x1D, 16, at + 32 + len(strings) + len(trie), 0))
    head = struct.pack("<8I", 0xFEEDFACF, ARM64, 0, 6, len(commands), size, 0, 0)
    return head + b"".join(commands) + symbol + local + strings + trie


def test_macho_is_read() -> None:
    (found,) = binary.read(dylib())
    assert found.exported == {"fmi2DoStep"}
    assert found.imported == {"exp"}
    assert (found.name, found.libraries) == ("@rpath/unit.dylib", ("/usr/lib/libSystem.B.dylib",))
    assert (found.processor, found.oldest_system, found.signed) == ("aarch64", "11.0", True)
    assert not binary.read(dylib(signed=False))[0].signed
    with pytest.raises(binary.Unreadable):
        binary.read(dylib()[:100])


def test_damaged_libraries_are_told_not_crashed_on(archive: Archive) -> None:
    content = archive.library.read_bytes()
    for damaged in (
        b"",
        b"MZ",
        b"\x7fELF",
        content[:64],
        content[: len(content) // 2],
        b"\x7fELF\x01\x01" + content[6:],
    ):
        assert "damaged" in portable.problems(damaged, PLATFORM)[0]


# --- what is refused


def test_functions_that_must_be_there() -> None:
    names = portable.fmi_functions()
    assert len(names) == 34
    assert {"fmi2GetTypesPlatform", "fmi2GetDirectionalDerivative", "fmi2DoStep", "fmi2GetStringStatus"} <= names
    assert not names & {"fmi2NewDiscreteStates", "fmi2GetNominalsOfContinuousStates"}  # of model exchange


GOOD = binary.Binary(
    *("ELF", "x86_64", portable.fmi_functions(), frozenset({"exp"}), ("libm.so.6", "libc.so.6")),
    versions=frozenset({"GLIBC_2.2.5", "GLIBC_2.17"}),
)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({}, None),
        ({"exported": GOOD.exported | {"unit_own"}}, None),
        ({"exported": GOOD.exported | {"unit_other"}}, "exports more than .*: unit_other"),
        ({"exported": GOOD.exported - {"fmi2Reset", "fmi2DoStep"}}, "does not export fmi2DoStep, fmi2Reset"),
        ({"versions": frozenset({"GLIBC_2.2.5", "GLIBC_2.29"})}, r"needs GLIBC_2\.29, where 2\.17"),
        ({"versions": frozenset({"GLIBC_2.18"})}, r"needs GLIBC_2\.18"),
        ({"versions": frozenset({"GLIBC_PRIVATE"})}, "needs GLIBC_PRIVATE"),
        ({"libraries": ("libc.so.6", "libgcc_s.so.1")}, r"no part of the system: libgcc_s\.so\.1"),
        ({"processor": "aarch64"}, "is ELF for aarch64; needed is ELF for x86_64"),
        ({"format": "PE", "libraries": ("KERNEL32.dll",)}, "is PE for x86_64"),
    ],
)
def test_problems_are_told(monkeypatch: pytest.MonkeyPatch, change: dict[str, object], told: str | None) -> None:
    monkeypatch.setattr(binary, "read", lambda content: (replace(GOOD, **change),))
    found = portable.problems(b"", targets.LINUX64, own=frozenset({"unit_own"}))
    assert len(found) == (0 if told is None else 1)
    assert told is None or re.search(told, found[0]), found


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({}, None),
        ({"signed": False}, "not signed"),
        ({"oldest_system": "13.0"}, r"needs macOS 13\.0; allowed is 11\.0"),
        ({"libraries": ("/opt/lib/libomp.dylib",)}, "libomp"),
    ],
)
def test_problems_of_libraries_for_macos(
    monkeypatch: pytest.MonkeyPatch, change: dict[str, object], told: str | None
) -> None:
    good = replace(
        GOOD,
        format="Mach-O",
        processor="aarch64",
        libraries=("/usr/lib/libSystem.B.dylib",),
        versions=frozenset(),
        oldest_system="11.0",
        signed=True,
    )
    monkeypatch.setattr(binary, "read", lambda content: (replace(good, **change),))
    found = portable.problems(b"", targets.AARCH64_DARWIN)
    assert len(found) == (0 if told is None else 1)
    assert told is None or re.search(told, found[0]), found


def test_paths_of_this_machine_are_found(archive: Archive) -> None:
    content = archive.library.read_bytes()
    assert portable.problems(content + b"/home/somebody/x.o\0", PLATFORM, for_others=False, machine=["/home/some"])
    assert not portable.problems(content, PLATFORM, for_others=False, machine=["/home/some"])


def test_own_functions_are_those_that_headers_declare(archive: Archive) -> None:
    found = portable.own_functions(archive.unit, archive.folder / "sources")
    unit, laws = archive.unit, ("friction", "friction_gms")
    assert found == ({f"{unit}_responses", f"{unit}_free_axis"} if unit in laws else set())
    assert found <= binary.read(archive.library.read_bytes())[0].exported


# --- choosing platforms


def test_platforms_are_chosen_by_name() -> None:
    assert [target.folder for target in targets.named(" win64, linux64,win64")] == ["win64", "linux64"]
    assert [target.folder for target in targets.named("all")] == [
        *("linux64", "win64", "darwin64", "aarch64-linux", "aarch64-darwin")
    ]
    for text in ("", "linux32", "linux64,all"):
        with pytest.raises(InputError, match=r"known: linux64, win64, .* or all"):
            targets.named(text)


def test_other_platforms_take_zig(tmp_path: Path) -> None:
    (tmp_path / "unit.c").write_text("int unit;\n", encoding="ascii")
    other = targets.WIN64 if os.name != "nt" else targets.LINUX64
    with pytest.raises(CompilerError, match=r"unit, \w+: gcc compiles for this machine alone; zig"):
        compile.compile_library("unit", tmp_path, ["unit.c"], tmp_path / "out", ["gcc"], other)
