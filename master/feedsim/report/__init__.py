"""Results as a person wants them: result.csv, summary.json, report.html and figures/*.png."""

from feedsim.report.summary import Run, summary_line
from feedsim.report.write import check_writable, write

__all__ = ["Run", "check_writable", "summary_line", "write"]
