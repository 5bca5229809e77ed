"""The native cycle loop (`src/exchange`) -> a shared library beside the archives, where the master looks for it."""

import os
import shlex
import tempfile
from collections.abc import Sequence
from pathlib import Path

from . import compile
from .checkout import LOOP
from .targets import Target

SOURCES = ("exchange.c",)
FUNCTIONS = frozenset({"exchange_run", "exchange_run_marked", "exchange_interface"})


def build(folder: Path, compiler: Sequence[str], target: Target | None = None) -> Path:
    """Compile the library into `folder`, whole or not at all; a process that has the old one loaded keeps it.

    target: a platform that zig compiles for, checked to run on machines other than this one; None: this machine's.

    Raises:
        CompilerError: the compiler refused the sources, or cannot make code for the platform.
    """
    folder.mkdir(parents=True, exist_ok=True)
    wanted = target or compile.host_target()
    with tempfile.TemporaryDirectory(dir=folder, prefix=".exchange-") as scratch:
        fresh = Path(scratch) / f"exchange{wanted.suffix}"
        compile.shared_library(
            "exchange", LOOP, SOURCES, fresh, compiler, wanted, FUNCTIONS, for_others=target is not None,
            extra=shlex.split(os.environ.get(compile.EXTRA_FLAGS, "")),
        )  # fmt: skip
        return fresh.replace(folder / fresh.name)
