"""What tuning leaves: report.html, summary.json, settings.yaml and sheet.csv.

May use the report's core and tune.
Start with report.py.
"""

from feedsim.report.tune.report import (
    answers,
    check_writable,
    figures_of,
    findings,
    report_of,
    settings,
    sheet,
    summary,
)

__all__ = ["answers", "check_writable", "figures_of", "findings", "report_of", "settings", "sheet", "summary"]
