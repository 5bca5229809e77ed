"""Results as a person wants them: curves as CSV, summary.json, report.html and figures/*.png."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from feedsim.report.provenance import input_paths
from feedsim.report.summary import Run, summary_line
from feedsim.report.write import check_writable, growing, write

if TYPE_CHECKING:
    from feedsim.report.compare.write import check_comparison_writable, write_comparison
    from feedsim.report.compensate.summary import summary_line as compensation_summary_line
    from feedsim.report.compensate.write import check_compensation_writable, write_compensation
    from feedsim.report.frf.summary import summary_line as frf_summary_line
    from feedsim.report.frf.write import check_frf_writable, write_frf
    from feedsim.report.identify.summary import headline as identification_headline
    from feedsim.report.identify.summary import rigid_line
    from feedsim.report.identify.summary import table_lines as identification_table
    from feedsim.report.identify.summary import terminal_lines as identification_lines
    from feedsim.report.identify.summary import terminal_warnings as identification_warnings
    from feedsim.report.identify.write import check_identification_writable, write_identification
    from feedsim.report.machine.write import check_machine_writable, write_machine
    from feedsim.report.sweep.write import check_sweep_writable, discard_sweep, write_sweep

__all__ = [
    "Run",
    "check_comparison_writable",
    "check_compensation_writable",
    "check_frf_writable",
    "check_identification_writable",
    "check_machine_writable",
    "check_sweep_writable",
    "check_writable",
    "compensation_summary_line",
    "discard_sweep",
    "frf_summary_line",
    "growing",
    "identification_headline",
    "identification_lines",
    "identification_table",
    "identification_warnings",
    "input_paths",
    "rigid_line",
    "summary_line",
    "write",
    "write_comparison",
    "write_compensation",
    "write_frf",
    "write_identification",
    "write_machine",
    "write_sweep",
]

# Loaded on first use: the report of a run should not wait for what identifications and responses calculate with.
_HOMES = {
    "check_comparison_writable": ("compare.write", "check_comparison_writable"),
    "check_compensation_writable": ("compensate.write", "check_compensation_writable"),
    "check_frf_writable": ("frf.write", "check_frf_writable"),
    "check_identification_writable": ("identify.write", "check_identification_writable"),
    "check_machine_writable": ("machine.write", "check_machine_writable"),
    "check_sweep_writable": ("sweep.write", "check_sweep_writable"),
    "compensation_summary_line": ("compensate.summary", "summary_line"),
    "discard_sweep": ("sweep.write", "discard_sweep"),
    "frf_summary_line": ("frf.summary", "summary_line"),
    "identification_headline": ("identify.summary", "headline"),
    "identification_lines": ("identify.summary", "terminal_lines"),
    "identification_table": ("identify.summary", "table_lines"),
    "identification_warnings": ("identify.summary", "terminal_warnings"),
    "rigid_line": ("identify.summary", "rigid_line"),
    "write_comparison": ("compare.write", "write_comparison"),
    "write_compensation": ("compensate.write", "write_compensation"),
    "write_frf": ("frf.write", "write_frf"),
    "write_identification": ("identify.write", "write_identification"),
    "write_machine": ("machine.write", "write_machine"),
    "write_sweep": ("sweep.write", "write_sweep"),
}


def __getattr__(public: str) -> Any:
    if public not in _HOMES:
        raise AttributeError(f"module 'feedsim.report' has no attribute '{public}'")
    home, attribute = _HOMES[public]
    return getattr(import_module(f"feedsim.report.{home}"), attribute)
