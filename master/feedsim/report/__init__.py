"""Results as a person wants them: curves as CSV, summary.json, report.html and figures/*.png."""

from feedsim.report.compare.write import check_comparison_writable, write_comparison
from feedsim.report.compensate.summary import summary_line as compensation_summary_line
from feedsim.report.compensate.write import check_compensation_writable, write_compensation
from feedsim.report.frf.summary import summary_line as frf_summary_line
from feedsim.report.frf.write import check_frf_writable, write_frf
from feedsim.report.identify.account import Account
from feedsim.report.identify.friction import constant_load_hint
from feedsim.report.identify.open_loop import open_loop_line
from feedsim.report.identify.summary import headline as identification_headline
from feedsim.report.identify.summary import rigid_line
from feedsim.report.identify.summary import table_lines as identification_table
from feedsim.report.identify.summary import terminal_warnings as identification_warnings
from feedsim.report.identify.write import check_identification_writable, write_identification
from feedsim.report.machine.write import check_machine_writable, write_machine
from feedsim.report.provenance import input_paths
from feedsim.report.summary import Run, summary_line
from feedsim.report.write import check_writable, write

__all__ = [
    "Account",
    "Run",
    "check_comparison_writable",
    "check_compensation_writable",
    "check_frf_writable",
    "check_identification_writable",
    "check_machine_writable",
    "check_writable",
    "compensation_summary_line",
    "constant_load_hint",
    "frf_summary_line",
    "identification_headline",
    "identification_table",
    "identification_warnings",
    "input_paths",
    "open_loop_line",
    "rigid_line",
    "summary_line",
    "write",
    "write_comparison",
    "write_compensation",
    "write_frf",
    "write_identification",
    "write_machine",
]
