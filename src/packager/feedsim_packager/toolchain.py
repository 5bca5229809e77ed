"""The C compiler: which one, and how to run it."""

import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from .errors import CompilerError

CANDIDATES = ("cc", "gcc", "clang", "zig")


def find_compiler(wanted: str | None = None) -> tuple[str, ...]:
    """Return the compiler as a command, e.g. ("cc",) or ("python", "-m", "ziglang", "cc").

    In this order: `wanted`, the environment variable CC, cc, gcc, clang, zig, the Python package ziglang.
    """
    text = wanted or os.environ.get("CC", "").strip()
    if text:
        command = tuple(shlex.split(text, posix=os.name != "nt"))
        if shutil.which(command[0]) is None:
            raise CompilerError(f"the C compiler '{text}' cannot be run: no program '{command[0]}' on the search path")
        return command
    for name in CANDIDATES:
        if shutil.which(name):
            return (name, "cc") if name == "zig" else (name,)
    if importlib.util.find_spec("ziglang"):
        return (sys.executable, "-m", "ziglang", "cc")
    raise CompilerError(f"no C compiler found (looked for {', '.join(CANDIDATES)} and the Python package ziglang)")


def is_zig(command: Sequence[str]) -> bool:
    """Whether the compiler is zig, which can compile for any platform and any glibc."""
    return any(Path(part).stem in ("zig", "ziglang") for part in command)


def for_target(command: Sequence[str], target: str) -> list[str]:
    """The compiler with zig's flags for compiling for `target`; as it is where it is not zig, or names a target itself.

    zig without a target looks for the C library of this machine, asking the compilers that it finds there, which now
    and then fails on a busy machine.
    """
    named = any(part.startswith(("-target", "--target")) for part in command)
    return [*command, "-target", target] if is_zig(command) and not named else [*command]


@cache
def whole_program(command: tuple[str, ...], suffix: str) -> tuple[str, ...]:
    """Flags with which gcc looks across the files of a library with that suffix; none where that is not sure to work.
    zig is given them as one file (:func:`together`).

    Steps become a sixth faster: what the equations and the FMI call most is a few lines in another file. Every
    operation is rounded as before, so results stay the same to the last bit. Tried on two files, as some gcc are built
    without it and some linkers leave out what they cannot read.
    """
    if is_zig(command) or suffix != ".so":
        return ()
    flags, mark = ("-flto",), "reached_across_files"
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "one.c").write_text(f"int inner(int a);\nint {mark}(int a) {{\n    return inner(a);\n}}\n")
        (folder / "two.c").write_text("int inner(int a);\nint inner(int a) {\n    return a + 1;\n}\n")
        try:
            version = run([*command, "--version"], folder)
            if "Free Software Foundation" not in version:
                return ()
            link = ["-shared", "-fPIC", "-O2", *flags, "one.c", "two.c", "-s", "-o", "tried.so"]
            run([*command, *link], folder)
        except CompilerError:
            return ()
        return flags if mark.encode() in (folder / "tried.so").read_bytes() else ()


# zig makes vectors of numbers that lie side by side by chance. In drive and friction that costs more than it saves;
# modes are written as vectors (modal.c). Optimising while linking does it whatever is said, and not on every platform.
ZIG_FLAGS = ("-fno-slp-vectorize",)


def together(names: Sequence[str]) -> tuple[str, list[str]]:
    """The C files `names` as one: its text, and those that stay by themselves: what is several in one already, and
    files.c, as no names but its own go with Windows' headers, which it brings.

    A compiler then sees across files on every platform. Every operation is rounded as before.
    """
    apart = sorted(name for name in names if name == "files.c" or name.endswith("_part.c"))
    return "".join(f'#include "{name}"\n' for name in sorted(set(names) - set(apart))), apart


def run(command: Sequence[str], directory: Path) -> str:
    """Run a compiler command in `directory` and return its standard output; raises CompilerError with its messages."""
    # Messages in English. Not by LC_ALL=C: zig comes as a Python program, which could then not start from a folder with
    # a non-ASCII name.
    environment = {name: value for name, value in os.environ.items() if name != "LC_ALL"} | {"LC_MESSAGES": "C"}
    try:
        done = subprocess.run(
            command, cwd=directory, env=environment, capture_output=True, encoding="utf-8", errors="replace"
        )
    except OSError as error:
        raise CompilerError(f"cannot run {shlex.join(command[:2])}: {error.strerror}") from error
    if done.returncode:
        messages = _messages(done.stderr)
        raise CompilerError(f"{shlex.join(command)}\nfailed with exit code {done.returncode}:\n{messages}")
    return done.stdout


def _messages(text: str, limit: int = 40) -> str:
    """The compiler's lines once each (the table is included many times), errors only where there are any."""
    lines = list(dict.fromkeys(line for line in text.splitlines() if line.strip()))
    errors = [line for line in lines if re.search(r"\berror\b|undefined reference|multiple definition", line)]
    shown = errors or lines
    more = [f"... and {len(shown) - limit} more lines"] if len(shown) > limit else []
    return "\n".join(shown[:limit] + more)
