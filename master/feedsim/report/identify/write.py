"""Write the results of an identification into a directory, whole or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from feedsim.identify import Identified
from feedsim.identify.friction_file import FRICTION, friction_yaml
from feedsim.report.identify.open_loop import open_loop_csv
from feedsim.report.identify.page import page
from feedsim.report.identify.plots import pictures_of
from feedsim.report.identify.quantities import remark
from feedsim.report.identify.summary import plateaus_csv, residuals_csv, summary
from feedsim.report.provenance import software
from feedsim.report.results import REPORT, SUMMARY, check_place, write_results, write_text
from feedsim.report.style import remarked
from feedsim.report.summary import to_json

PLATEAUS, RESIDUALS, OPEN_LOOP = "plateaus.csv", "residuals.csv", "open_loop.csv"
REMARK_WIDTH, REMARK_LINES = 100, 3  # fits the narrowest figure


def check_writable(directory: Path | str, inputs: Sequence[Path] = ()) -> None:
    """Raise OutputError unless the results can be written to ``directory`` without one of ``inputs`` being lost.

    inputs: files that are read. Leaves nothing behind.
    """
    check_place(directory, (FRICTION, PLATEAUS, RESIDUALS, OPEN_LOOP, REPORT, SUMMARY), inputs)


def write(identified: Identified, directory: Path | str) -> tuple[Path, ...]:
    """Write friction.yaml, plateaus.csv, residuals.csv and open_loop.csv (where there are any), summary.json,
    report.html, figures.

    Returns the paths. Files of an earlier run are replaced. Raises OutputError.
    """
    found = identified.found
    friction = friction_yaml(identified, software())
    with remarked(remark(identified), REMARK_WIDTH, REMARK_LINES):
        pictures = pictures_of(identified)
    files = [FRICTION]
    files += [PLATEAUS] if found.stationary is not None else []
    files += [RESIDUALS] if found.dynamic is not None else []
    balance = found.balance if found.balance is not None and found.balance.drifts else None
    files += [OPEN_LOOP] if balance is not None else []
    files += [REPORT, SUMMARY]

    def fill(fresh: Path, names: Sequence[str]) -> None:
        write_text(fresh / FRICTION, friction)
        if found.stationary is not None:
            write_text(fresh / PLATEAUS, plateaus_csv(found))
        if found.dynamic is not None:
            write_text(fresh / RESIDUALS, residuals_csv(found))
        if balance is not None:
            write_text(fresh / OPEN_LOOP, open_loop_csv(balance))
        write_text(fresh / REPORT, page(identified, pictures))
        write_text(fresh / SUMMARY, to_json(summary(identified, names)))

    return write_results(directory, files, pictures, fill)
