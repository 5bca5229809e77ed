"""What a look at frequency responses leaves: curves as CSV, summary.json, report.html and figures/*.png.

May use the report's core and the analyses.
Start with report.py.
"""

from feedsim.report.frf.bode import answers
from feedsim.report.frf.report import FILES, details, draw, files_of, report_of

__all__ = ["FILES", "answers", "details", "draw", "files_of", "report_of"]
