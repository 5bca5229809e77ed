"""Results as a person wants them: curves as CSV, summary.json, report.html and figures/*.png."""

from feedsim.report.frf.summary import summary_line as frf_summary_line
from feedsim.report.frf.write import check_frf_writable, write_frf
from feedsim.report.machine.write import check_machine_writable, write_machine
from feedsim.report.summary import Run, summary_line
from feedsim.report.write import check_writable, write

__all__ = [
    "Run",
    "check_frf_writable",
    "check_machine_writable",
    "check_writable",
    "frf_summary_line",
    "summary_line",
    "write",
    "write_frf",
    "write_machine",
]
