"""What a friction compensation leaves: curves and table as CSV, summary.json, report.html and figures/*.png.

May use the report's core, the run's report and the analyses.
Start with report.py.
"""

from feedsim.report.compensate.report import (
    FEEDFORWARD,
    FILES,
    RESULT,
    TABLE,
    UNCOMPENSATED,
    answers,
    report_of,
    summary,
    summary_line,
    table_csv,
)

__all__ = [
    "FEEDFORWARD", "FILES", "RESULT", "TABLE", "UNCOMPENSATED", "answers", "report_of", "summary", "summary_line",
    "table_csv",
]  # fmt: skip
