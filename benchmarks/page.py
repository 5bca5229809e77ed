"""Put the tables of a benchmark run into docs/performance.md, and its figures beside it into docs/benchmarks/.

``make bench`` ahead of it measures. A table stands behind a marker, ``<!-- floor 1 -->`` for the first one that
benchmarks/floor.py prints; benchmarks that have not run leave theirs as it is. Refuses tables of a busy machine.
"""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Mapping

from harness import RESULTS, ROOT

PAGE = ROOT / "docs" / "performance.md"
FIGURES = ROOT / "docs" / "benchmarks"
MARKED = re.compile(r"(<!-- (\w+) (\d+) -->\n)(?:\n(?:\|.*\n)+)?")


def tables(text: str) -> list[str]:
    """The markdown tables in a text."""
    return re.findall(r"^(?:\|.*\n)+", text, re.MULTILINE)


def filled(page: str, printed: Mapping[str, str]) -> str:
    """`export` with the tables of `printed`, benchmark -> what it has printed.

    ValueError: a marker asks for a table that the benchmark has not printed.
    """

    def table(marker: re.Match[str]) -> str:
        head, name, number = marker[1], marker[2], int(marker[3])
        if name not in printed:
            return marker[0]
        found = tables(printed[name])
        if not 1 <= number <= len(found):
            raise ValueError(f"{name} has printed {len(found)} tables, the page wants number {number}")
        return f"{head}\n{found[number - 1]}"

    return MARKED.sub(table, page)


def main() -> int:
    printed = {file.stem: file.read_text() for file in sorted(RESULTS.glob("*.md"))}
    if busy := [name for name, text in printed.items() if "Busy machine" in text]:
        print(f"measured beside other programs, run anew on an idle machine: {', '.join(busy)}", file=sys.stderr)
        return 1
    PAGE.write_text(filled(PAGE.read_text(), printed))
    FIGURES.mkdir(exist_ok=True)
    for name in printed:
        shutil.copyfile(RESULTS / f"{name}.json", FIGURES / f"{name}.json")
    print(f"{PAGE.relative_to(ROOT)}, {FIGURES.relative_to(ROOT)}: {', '.join(printed)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
