"""Flat sources folder -> shared library for a platform, checked for what importers there need."""

import os
import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from . import portable, toolchain, universal
from .errors import CompilerError
from .targets import Target, host_target

__all__ = ["EXTRA_FLAGS", "FLAGS", "Library", "compile_library", "host_target", "newest_glibc"]

FLAGS = (
    *("-std=c99", "-O2", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off"),
    # No -Werror: a newer compiler's new warning must not keep a user from building. Tests compile with it.
    *("-Wall", "-Wextra", "-Wconversion", "-Wshadow"),
)
EXTRA_FLAGS = "FEEDSIM_CFLAGS"  # environment: e.g. "-fsanitize=address,undefined -g"


@dataclass(frozen=True)
class Library:
    """A compiled unit. `instrumented` where extra flags were in use; such a library may need a runtime that only a
    program built like it has. `glibc` is the newest GLIBC_ version its symbols need, None where there is none."""

    path: str  # within the archive
    content: bytes
    instrumented: bool
    glibc: str | None


def compile_library(
    unit: str,
    sources: Path,
    names: Sequence[str],
    output: Path,
    compiler: Sequence[str],
    target: Target,
    *,
    for_others: bool = False,
) -> Library:
    """Compile `names` (C files in the folder `sources`) into `output`/<unit><suffix>.

    Compiled in the folder itself, by relative names: no path of the machine gets into the library, so the same sources
    and compiler give the same bytes. `for_others`: the library shall run on machines other than this one, and is
    refused where it would not (`portable.problems`).

    Raises:
        CompilerError: the compiler refused the sources or cannot make code for `target`, or the library lacks a
            function of the FMI.
    """
    library = output / f"{unit}{target.suffix}"
    extra = shlex.split(os.environ.get(EXTRA_FLAGS, ""))
    functions, own = portable.fmi_functions(), portable.own_functions(unit, sources)
    content = shared_library(
        unit, sources, names, library, compiler, target, functions, own=own, for_others=for_others, extra=extra
    )
    return Library(f"binaries/{target.folder}/{library.name}", content, bool(extra), newest_glibc(content))


def shared_library(
    what: str,
    sources: Path,
    names: Sequence[str],
    library: Path,
    compiler: Sequence[str],
    target: Target,
    functions: frozenset[str],
    *,
    own: frozenset[str] = frozenset(),
    for_others: bool = False,
    extra: Sequence[str] = (),
) -> bytes:
    """Compile `names` in the folder `sources` into the file `library`, with a part for each processor of `target`.

    It must export `functions`, and may export its `own` besides; with `extra` flags (instruments) nobody looks.

    Raises:
        CompilerError: as for :func:`compile_library`; the message begins with `what` it is.
    """
    output = library.parent.resolve()
    output.mkdir(parents=True, exist_ok=True)
    if not toolchain.is_zig(compiler) and target != host_target():
        raise CompilerError(
            f"{what}, {target.folder}: {shlex.join(compiler)} compiles for this machine alone; zig compiles for all "
            "(make fmus-all, or --cc 'python -m ziglang cc')"
        )
    parts = []
    for processor in target.zig:
        part = output / processor / library.name if len(target.zig) > 1 else output / library.name
        part.parent.mkdir(exist_ok=True)
        command = [*toolchain.for_target(compiler, processor), *FLAGS]
        command += [f"-ffile-prefix-map={sources.resolve()}=sources", f"-I{portable.HEADER.parent}"]
        command += [*_link_flags(compiler, target, library.name, stripped=not extra)]
        command += extra or toolchain.whole_program(tuple(compiler), target.suffix)
        if toolchain.is_zig(compiler) and not extra:
            text, apart = toolchain.together(names)
            whole = part.with_suffix(".whole.c")
            whole.write_text(text, encoding="utf-8")
            command += [*toolchain.ZIG_FLAGS, "-I.", str(whole), *apart]
        else:
            command += sorted(names)
        command += ["-o", str(part), "-lm"]
        toolchain.run(command, sources)
        parts.append(part.read_bytes())
    content = universal.join(parts) if len(parts) > 1 else parts[0]
    if len(parts) > 1:
        library.write_bytes(content)
    if not extra:
        machine = [str(sources.resolve()), str(output)]
        if Path.home().parent != Path.home():  # where compilers keep what they have compiled
            machine.append(f"{Path.home()}{os.sep}")
        if problems := portable.problems(
            content, target, functions=functions, own=own, for_others=for_others, machine=machine
        ):
            raise CompilerError("\n  ".join((f"{what}, {target.folder}: no library that others can use", *problems)))
    return content


def _link_flags(compiler: Sequence[str], target: Target, name: str, stripped: bool) -> list[str]:
    flags = ["-shared"]
    if target.suffix == ".so":
        flags.append("-Wl,--build-id=none")
        if stripped:  # an instrumented library takes its runtime's symbols from the program that loads it
            flags.append("-Wl,--no-undefined")
    if target.suffix == ".dylib":
        flags.append(f"-Wl,-install_name,@rpath/{name}")
    # Apple's linker takes no -s and needs none: it names object files in a library only where they were made with -g.
    if stripped and (target.suffix != ".dylib" or toolchain.is_zig(compiler)):
        flags.append("-s")
    return flags


def newest_glibc(library: bytes) -> str | None:
    """Newest symbol version of glibc that an ELF library asks for, e.g. "2.29": it does not load with an older one."""
    versions = {tuple(map(int, entry.split(b"."))) for entry in re.findall(rb"GLIBC_(\d+(?:\.\d+)+)\0", library)}
    return ".".join(map(str, max(versions))) if versions else None
