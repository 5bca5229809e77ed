"""What a replay of a record leaves: replay.csv, summary.json, report.html and figures.

May use the report's core and what `feedsim.replay` found.
Start with report.py.
"""

from feedsim.report.replay.report import check_writable, summary_lines, write

__all__ = ["check_writable", "summary_lines", "write"]
