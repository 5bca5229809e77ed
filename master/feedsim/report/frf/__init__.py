"""What a look at frequency responses leaves: curves as CSV, summary.json, report.html and figures/*.png.

May use the report's core and the analyses.
Start with report.py.
"""

from feedsim.report.frf.bode import answers
from feedsim.report.frf.report import FILES, draw, files_of, report_of, summary

__all__ = ["FILES", "answers", "draw", "files_of", "report_of", "summary"]
