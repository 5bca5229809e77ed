"""What a friction compensation leaves: curves and table as CSV, summary.json, report.html and figures/*.png.

May use the report's core, the run's report and the analyses.
Start with report.py.
"""

from feedsim.report.compensate.report import check_writable, summary_line, write

__all__ = ["check_writable", "summary_line", "write"]
