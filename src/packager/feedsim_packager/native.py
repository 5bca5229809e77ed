"""The libraries of C that the master calls -> shared libraries beside the archives, where it looks for them."""

import os
import shlex
import tempfile
from collections.abc import Sequence
from pathlib import Path

from . import compile
from .checkout import SOURCES
from .targets import Target

# Library, named as its folder in src -> its C files and what it must export.
LIBRARIES = {
    "exchange": (("exchange.c",), frozenset({"exchange_run", "exchange_run_marked", "exchange_interface"})),
    "planner": (
        ("corner.c", "element.c", "nearest.c", "path.c", "planner.c", "speed.c", "spline.c"),
        frozenset({
            "planner_interface", "planner_create", "planner_destroy", "planner_advance", "planner_duration",
            "planner_sections", "planner_section", "planner_sample", "planner_nearest",
        }),
    ),
}  # fmt: skip


def build(name: str, folder: Path, compiler: Sequence[str], target: Target | None = None) -> Path:
    """Compile a library into `folder`, whole or not at all; a process that has the old one loaded keeps it.

    target: a platform that zig compiles for, checked to run on machines other than this one; None: this machine's.

    Raises:
        CompilerError: the compiler refused the sources, or cannot make code for the platform.
    """
    folder.mkdir(parents=True, exist_ok=True)
    wanted = target or compile.host_target()
    files, functions = LIBRARIES[name]
    with tempfile.TemporaryDirectory(dir=folder, prefix=f".{name}-") as scratch:
        fresh = Path(scratch) / f"{name}{wanted.ending}"
        compile.shared_library(
            name, SOURCES / name, files, fresh, compiler, wanted, functions, for_others=target is not None,
            extra=shlex.split(os.environ.get(compile.EXTRA_FLAGS, "")),
        )  # fmt: skip
        return fresh.replace(folder / fresh.name)
