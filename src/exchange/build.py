"""Build the native cycle loop: ``python src/exchange/build.py --out fmus``, with the compiler that builds the units.

The library goes beside the archives, where the master looks for it; which name it has there depends on the platform.
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from feedsim_packager import checkout, compile, toolchain
from feedsim_packager.errors import PackagerError

HERE = Path(__file__).resolve().parent

SOURCES = ("exchange.c",)


def build(folder: Path, compiler: Sequence[str]) -> Path:
    """Compile the library into `folder`, whole or not at all; a process that has the old one loaded keeps it."""
    folder = folder.resolve()
    target = compile.host_target()
    command = [*compiler, *compile.FLAGS, f"-I{checkout.STANDARD}"]
    if toolchain.is_zig(compiler) and not any(part.startswith(("-target", "--target")) for part in compiler):
        command += ["-target", target.zig[0]]
    command += ["-shared", *shlex.split(os.environ.get(compile.EXTRA_FLAGS, ""))]
    library = folder / f"exchange{target.suffix}"
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".exchange-") as scratch:
        fresh = Path(scratch) / library.name
        toolchain.run([*command, *SOURCES, "-o", str(fresh), "-lm"], HERE)
        fresh.replace(library)
    return library


def main() -> int:
    parser = argparse.ArgumentParser(description="Build the native cycle loop.")
    parser.add_argument("--out", type=Path, required=True, help="folder of the archives")
    parser.add_argument("--cc", help="C compiler, one or more words (default: $CC, cc, gcc, clang, zig)")
    options = parser.parse_args()
    try:
        print(build(options.out, toolchain.find_compiler(options.cc)))
    except PackagerError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
