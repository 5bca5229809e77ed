"""Flat sources folder -> shared library for the platform this runs on."""

import os
import platform
import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from . import toolchain
from .errors import CompilerError

FLAGS = (
    *("-std=c99", "-O2", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off"),
    # No -Werror: a newer compiler's new warning must not keep a user from building. Tests compile with it.
    *("-Wall", "-Wextra", "-Wconversion", "-Wshadow"),
)
EXTRA_FLAGS = "FEEDSIM_CFLAGS"  # environment: e.g. "-fsanitize=address,undefined -g"

# Oldest glibc the Linux binaries shall run with. zig links against any version; gcc and clang against the host's, where
# exp, log and pow bind to GLIBC_2.29 since their re-implementation there.
OLDEST_GLIBC = "2.17"


@dataclass(frozen=True)
class Target:
    """A platform: its folder under binaries/, the library's suffix, its name for zig."""

    folder: str
    suffix: str
    zig: str


# FMI 2.0 names x86-64 folders; other processors use the tuples of FMI 3.0.
TARGETS = {
    ("Linux", "x86_64"): Target("linux64", ".so", f"x86_64-linux-gnu.{OLDEST_GLIBC}"),
    ("Linux", "aarch64"): Target("aarch64-linux", ".so", f"aarch64-linux-gnu.{OLDEST_GLIBC}"),
    ("Darwin", "x86_64"): Target("darwin64", ".dylib", "x86_64-macos"),
    ("Darwin", "arm64"): Target("aarch64-darwin", ".dylib", "aarch64-macos"),
    ("Windows", "AMD64"): Target("win64", ".dll", "x86_64-windows-gnu"),
}


@dataclass(frozen=True)
class Library:
    """A compiled unit. `instrumented` where extra flags were in use; such a library may need a runtime that only a
    program built like it has. `glibc` is the newest GLIBC_ version its symbols need, None where there is none."""

    path: str  # within the archive
    content: bytes
    instrumented: bool
    glibc: str | None


def host_target() -> Target:
    """The platform this runs on; CompilerError where FMI has no name for it."""
    host = (platform.system(), platform.machine())
    if host not in TARGETS:
        known = ", ".join(" ".join(each) for each in TARGETS)
        raise CompilerError(f"no binaries folder is known for {' '.join(host)} (known: {known})")
    return TARGETS[host]


def compile_library(
    unit: str, sources: Path, names: Sequence[str], output: Path, compiler: Sequence[str], target: Target
) -> Library:
    """Compile `names` (C files in the folder `sources`) into `output`/<unit><suffix>.

    Compiled in the folder itself, by relative names: no path of the machine gets into the library, so the same sources
    and compiler give the same bytes.
    """
    output.mkdir(parents=True, exist_ok=True)
    library = output.resolve() / f"{unit}{target.suffix}"
    extra = shlex.split(os.environ.get(EXTRA_FLAGS, ""))
    command = [*compiler, *_target_flags(compiler, target), *FLAGS, f"-ffile-prefix-map={sources.resolve()}=sources"]
    command += [*_link_flags(target, library.name, stripped=not extra), *extra]
    command += [*sorted(names), "-o", str(library), "-lm"]
    toolchain.run(command, sources)
    content = library.read_bytes()
    return Library(f"binaries/{target.folder}/{library.name}", content, bool(extra), newest_glibc(content))


def _target_flags(compiler: Sequence[str], target: Target) -> list[str]:
    named = any(part.startswith(("-target", "--target")) for part in compiler)
    return ["-target", target.zig] if toolchain.is_zig(compiler) and not named else []


def _link_flags(target: Target, name: str, stripped: bool) -> list[str]:
    flags = ["-shared"]
    if target.suffix == ".so":
        flags.append("-Wl,--build-id=none")
        if stripped:  # an instrumented library takes its runtime's symbols from the program that loads it
            flags.append("-Wl,--no-undefined")
    if target.suffix == ".dylib":
        flags.append(f"-Wl,-install_name,@rpath/{name}")
    elif stripped:
        flags.append("-s")
    return flags


def newest_glibc(library: bytes) -> str | None:
    """Newest symbol version of glibc that an ELF library asks for, e.g. "2.29": it does not load with an older one."""
    versions = {tuple(map(int, found.split(b"."))) for found in re.findall(rb"GLIBC_(\d+(?:\.\d+)+)\0", library)}
    return ".".join(map(str, max(versions))) if versions else None
