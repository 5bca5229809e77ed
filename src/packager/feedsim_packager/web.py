"""The unit `machine` as a WebAssembly module for pages: its own sources, driven by `src/page`.

Compiled by clang where it has a C library for WebAssembly (WASI), else by zig, which brings one along.
"""

import importlib.util
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from . import archive, build, portable, toolchain
from .checkout import SOURCES
from .errors import CompilerError

UNIT = "machine"
FILE = "machine.wasm"  # beside the archives
PAGE = SOURCES / "page"
SECTION = "feedsim"  # of the module: what it was made from
# -O3 takes 4 % less of a cycle, and 20 kB more of every page.
FLAGS = (
    *("-std=c99", "-Os", "-flto", "-msimd128", "-ffp-contract=off", "-fno-slp-vectorize"),
    *("-Wall", "-Wextra", "-mexec-model=reactor", "-s"),
)
# The stack comes first, so that it cannot grow into data; 256 KiB is a fourth of what native threads have.
CLANG_LINK = ("-Wl,--stack-first", "-Wl,-z,stack-size=262144", "-Wl,--lto-O3")


def find_compiler() -> tuple[str, ...]:
    """clang where it compiles for WebAssembly, else the Python package ziglang. CompilerError: there is neither."""
    for name in ("clang", *(f"clang-{n}" for n in range(20, 13, -1))):
        if shutil.which(name) and _works((name, "--target=wasm32-wasi")):
            return (name, "--target=wasm32-wasi")
    if importlib.util.find_spec("ziglang"):
        return (sys.executable, "-m", "ziglang", "cc", "-target", "wasm32-wasi")
    raise CompilerError(
        "no compiler for WebAssembly: neither clang with lld and wasi-libc nor the Python package ziglang "
        "(requirements-zig.lock)"
    )


def _works(command: Sequence[str]) -> bool:
    """Whether a compiler links a program with the C library."""
    with tempfile.TemporaryDirectory() as scratch:
        source = Path(scratch) / "tried.c"
        source.write_text('#include <math.h>\n#include <stdio.h>\nint main(void) { return printf("%g", exp(1.0)); }\n')
        tried = [*command, str(source), "-o", f"{scratch}/tried.wasm", "-lm"]
        return subprocess.run(tried, capture_output=True, check=False).returncode == 0


def make(out: Path, compiler: Sequence[str] | None = None) -> Path:
    """Compile the module and write it to `out`, whole or not at all.

    compiler: for WebAssembly; default: that of :func:`find_compiler`.

    Raises:
        CompilerError: there is none, or it refuses the sources.
    """
    wasm = tuple(compiler or find_compiler())
    unit = build.load(build.unit_directory(UNIT), toolchain.find_compiler())
    own = {path.name: path.read_bytes() for path in sorted(PAGE.glob("*.c"))}
    sources = {name: text for name, text in unit.sources.items() if name.endswith((".c", ".h", ".def"))} | own
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name, text in sources.items():
            (folder / name).write_bytes(text)
        names = sorted(name for name in sources if name.endswith(".c"))
        command = [*wasm, *FLAGS, "-I.", f"-I{portable.HEADER.parent}"]
        if toolchain.is_zig(wasm):
            listed, apart = toolchain.together([name for name in names if name not in own])
            (folder / "whole.c").write_text(listed, encoding="utf-8")
            command += ["whole.c", *apart, *own]
        else:
            command += [*CLANG_LINK, *names]
        toolchain.run([*command, "-o", "module.wasm", "-lm"], folder)
        archive.write(out, (folder / "module.wasm").read_bytes() + _section(unit.guid.partition("-")[0]))
    return out


def _section(table: str) -> bytes:
    """A custom section: hash of the table of variables, the first half of the unit's GUID."""
    content = _sized(SECTION.encode()) + json.dumps({"table": table}).encode()
    return b"\0" + _sized(content)


def _sized(content: bytes) -> bytes:
    """With its length ahead, LEB128."""
    length, head = len(content), bytearray()
    while True:
        head.append(length & 0x7F | (0x80 if length > 0x7F else 0))
        length >>= 7
        if not length:
            return bytes(head) + content
