"""The report of an identification of friction: friction.yaml, tables as CSV, summary.json, report.html and figures.

May use the report's core and what `feedsim.estimation.identify` found.
Start with report.py.
"""

from feedsim.report.identify.report import FILES, draw, files_of, report_of
from feedsim.report.identify.summary import (
    details,
    headline,
    rigid_line,
    table_lines,
    terminal_lines,
    terminal_warnings,
)

__all__ = [
    "FILES", "details", "draw", "files_of", "headline", "report_of", "rigid_line", "table_lines",
    "terminal_lines", "terminal_warnings",
]  # fmt: skip
