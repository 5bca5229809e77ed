"""What tuning leaves: report.html, summary.json, settings.yaml and sheet.csv.

May use the report's core and tune.
Start with report.py.
"""

from feedsim.report.tune.report import (
    FILES,
    answers,
    details,
    figures_of,
    findings,
    report_of,
    settings,
    sheet,
)

__all__ = ["FILES", "answers", "details", "figures_of", "findings", "report_of", "settings", "sheet"]
