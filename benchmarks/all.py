"""All benchmarks but the longest, one after the other, a process each; half an hour on two idle cores.

Goes on where one fails, says at the end which have, and then exits with 1. Tables and figures are left in
build/bench/<name>.md and <name>.json; those of an earlier run are removed first, so that none is taken for new.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from harness import RESULTS, ROOT

HERE = Path(__file__).resolve().parent
# Not here: worst_case (its own target), eigen (gigabytes), the studies of other pages (pose_grid, identification).
NAMES = ("cycle", "floor", "peers", "accuracy", "stability", "growth", "duration", "sweep", "startup", "setpoints",
         "foreign_units")  # fmt: skip
DRAWING = ("accuracy", "growth", "duration", "sweep")


def main(given: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=NAMES, default=NAMES, metavar="NAME", help=", ".join(NAMES))
    parser.add_argument("--json", type=Path, default=RESULTS, metavar="DIR", help="folder of tables and figures")
    parser.add_argument("--images", type=Path, default=RESULTS, metavar="DIR", help="folder of plots")
    wanted = parser.parse_args(given)
    folder: Path = wanted.json.resolve()
    failed = []
    for name in (name for name in NAMES if name in wanted.only):
        for suffix in (".md", ".json"):
            (folder / f"{name}{suffix}").unlink(missing_ok=True)
        command = [sys.executable, str(HERE / f"{name}.py"), "--json", str(folder)]
        if name in DRAWING:
            command += ["--images", str(wanted.images.resolve())]
        begun = time.monotonic()
        print(f"# {name}\n", flush=True)
        code = subprocess.run(command, check=False).returncode
        print(f"\n{name}: {f'exit code {code}, ' if code else ''}{time.monotonic() - begun:.0f} s\n", flush=True)
        if code:
            failed.append(name)
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    print(f"tables and figures: {folder.relative_to(ROOT) if folder.is_relative_to(ROOT) else folder}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
