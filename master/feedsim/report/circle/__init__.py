"""What a recorded circle leaves: summary.json, report.html and figures/*.png: why it is not round.

May use the report's core, what the report of a run draws of circles, and the analyses.
Start with report.py.
"""

from feedsim.report.circle.report import answers, figures_of, report_of, summary

__all__ = ["answers", "figures_of", "report_of", "summary"]
