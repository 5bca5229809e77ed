"""The report of a study of many runs: summary.json, report.html and figures beside the study's table.

It uses the report's core and what `feedsim.sweep` found. Begin with `report`.
"""

from feedsim.report.results import discard
from feedsim.report.sweep.report import check_writable, write

__all__ = ["check_writable", "discard", "write"]
