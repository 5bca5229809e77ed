"""Put what benchmarks have measured into the pages: tables and figures of docs/benchmarks/*.json, none typed by hand.

``make bench`` measures and calls it: it takes the files of build/bench over into docs/benchmarks, and fills the pages
from there. In a page

    <!-- floor 1 -->                                 ahead of a table: the first one that benchmarks/floor.py prints
    <!--floor: native loop-->0.98 us<!--/-->         a figure that it quotes, within a sentence
    <!-- measured -->                                ahead of a table: which file is of what version, date and machine

A benchmark whose file is missing has no table; a figure of it is an error.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from harness import RESULTS, ROOT, table

FIGURES = ROOT / "docs" / "benchmarks"
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
TABLE = re.compile(r"(<!-- (\w+) (\d+) -->\n)(?:\n(?:\|.*\n)+)?")
QUOTED = re.compile(r"(<!--(\w+): ([^>]+)-->)[^<]*(<!--/-->)")
MEASURED = re.compile(r"(<!-- measured -->\n)(?:\n(?:\|.*\n)+)?")


def read(folder: Path = FIGURES) -> dict[str, dict[str, Any]]:
    """What each benchmark has left, by its name."""
    return {file.stem: json.loads(file.read_text(encoding="utf-8")) for file in sorted(folder.glob("*.json"))}


def filled(page: str, files: Mapping[str, Mapping[str, Any]]) -> str:
    """`page` with the tables and figures of `files`.

    ValueError: a table that a benchmark has not printed, or a figure that it does not quote.
    """

    def printed(marker: re.Match[str]) -> str:
        head, name, number = marker[1], marker[2], int(marker[3])
        if name not in files:
            return head
        tables = files[name]["tables"]
        if not 1 <= number <= len(tables):
            raise ValueError(f"{name} has printed {len(tables)} tables, the page wants number {number}")
        return f"{head}\n{tables[number - 1]}"

    def quoted(marker: re.Match[str]) -> str:
        figures = files.get(marker[2], {}).get("quoted", {})
        if marker[3] not in figures:
            raise ValueError(f"{marker[2]} quotes {', '.join(figures) or 'nothing'}; the page wants {marker[3]!r}")
        return f"{marker[1]}{figures[marker[3]]}{marker[4]}"

    page = MEASURED.sub(lambda marker: f"{marker[1]}\n{measured(files)}\n" if files else marker[1], page)
    return QUOTED.sub(quoted, TABLE.sub(printed, page))


def measured(files: Mapping[str, Mapping[str, Any]]) -> str:
    """Which file is of what."""
    rows = []
    for name, file in files.items():
        sources = file["sources"] or {"commit": "unknown", "changed": False}
        commit = str(sources["commit"])[:8] + (" with changes" if sources["changed"] else "")
        machine = f"{file['machine']['processor']}, {file['machine']['cores']} cores"
        busy = "beside other programs" if (file["load"] or {}).get("busy") else "alone"
        rows.append([name, file["date"][:10], file["versions"]["feedsim"], commit, machine, busy])
    return table(["file", "date", "version", "commit", "machine", "measured"], rows)


def main() -> int:
    fresh = read(RESULTS)
    if short := [name for name, file in fresh.items() if file.get("short", True)]:
        print(f"no figures to quote, as they are of --short or an older harness: {', '.join(short)}", file=sys.stderr)
        fresh = {name: file for name, file in fresh.items() if name not in short}
    FIGURES.mkdir(exist_ok=True)
    for name in fresh:
        (FIGURES / f"{name}.json").write_bytes((RESULTS / f"{name}.json").read_bytes())
    files = read()
    for page in PAGES:
        before = page.read_text(encoding="utf-8")
        after = filled(before, files)
        if after != before:
            page.write_text(after, encoding="utf-8")
            print(f"{page.relative_to(ROOT)}: figures are new")
    print(f"{FIGURES.relative_to(ROOT)}: {', '.join(fresh) or 'nothing'} taken over")
    return 0


if __name__ == "__main__":
    sys.exit(main())
