"""The report of a study of many runs: summary.json, report.html and figures beside the study's table.

May use the report's core and what `feedsim.sweep` found.
Start with report.py.
"""

from feedsim.report.results import discard
from feedsim.report.sweep.report import question, write

__all__ = ["discard", "question", "write"]
