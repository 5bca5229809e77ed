"""Write the report on a study into its directory, whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feedsim.report.results import REPORT, SUMMARY, check_place, write_results, write_text
from feedsim.report.style import remarked
from feedsim.report.summary import to_json
from feedsim.report.sweep.account import Account
from feedsim.report.sweep.page import page
from feedsim.report.sweep.plots import pictures_of
from feedsim.report.sweep.summary import summary
from feedsim.sweep.table import RECORD

if TYPE_CHECKING:
    from feedsim.scenario import Study
    from feedsim.sweep.design import Design
    from feedsim.sweep.table import Table

REMARK_WIDTH, REMARK_LINES = 95, 2  # fits the narrowest figure


def check_writable(directory: Path | str, inputs: Sequence[Path] = ()) -> None:
    """Raise OutputError unless the report can be written to ``directory`` without one of ``inputs`` being lost.

    inputs: files that are read. Leaves nothing behind.
    """
    check_place(directory, (REPORT, SUMMARY), inputs)


def write(table: Table, study: Study, design: Design, directory: Path | str) -> tuple[Path, ...]:
    """Write report.html, summary.json and figures/*.png beside the table; returns their paths.

    The table may be that of an unfinished study. The table's own files are left as they are. Raises OutputError.
    """
    account = Account(table, study, design, _record(Path(directory)))
    machine = study.base.scenario.machine
    remark = f"{study.name}. {machine.name}. {machine.note}".strip()
    with remarked(remark, REMARK_WIDTH, REMARK_LINES):
        whole, single = pictures_of(account)

    def fill(fresh: Path, names: Sequence[str]) -> None:
        write_text(fresh / REPORT, page(account, whole, single))
        write_text(fresh / SUMMARY, to_json(summary(account, names)))

    return write_results(directory, (REPORT, SUMMARY), [*whole, *single], fill)


def _record(directory: Path) -> dict[str, Any]:
    """study.json beside the table, as far as it can be read: without it the page tells less."""
    try:
        content = json.loads((directory / RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}
