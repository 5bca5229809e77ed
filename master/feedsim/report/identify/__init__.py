"""The report of an identification of friction: friction.yaml, tables as CSV, summary.json, report.html and figures.

May use the report's core and what `feedsim.identify` found.
Start with report.py.
"""

from feedsim.report.identify.report import check_writable, write
from feedsim.report.identify.summary import headline, rigid_line, table_lines, terminal_lines, terminal_warnings

__all__ = ["check_writable", "headline", "rigid_line", "table_lines", "terminal_lines", "terminal_warnings", "write"]
