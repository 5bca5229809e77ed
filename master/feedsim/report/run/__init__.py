"""What a run leaves: curves as CSV, summary.json, report.html and figures/*.png.

May use the report's core, the analyses and the recorded traces.
Start with files.py, then report.py, the page; pose.py has the plant's pose.
"""

from feedsim.report.changes import action
from feedsim.report.page import PARTIAL
from feedsim.report.provenance import input_paths
from feedsim.report.run.files import FILES, details, files_of, growing_result, page_of
from feedsim.report.run.files import require_workbooks as workbook_needed
from feedsim.report.run.report import summary_line
from feedsim.report.run.sheet import in_workbook

__all__ = [
    "FILES",
    "PARTIAL",
    "action",
    "details",
    "files_of",
    "growing_result",
    "in_workbook",
    "input_paths",
    "page_of",
    "summary_line",
    "workbook_needed",
]
