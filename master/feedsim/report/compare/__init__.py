"""What comparisons of results leave: a page of HTML, JUnit XML and JSON.

May use the report's core and what `feedsim.compare` found.
Start with report.py.
"""

from feedsim.report.compare.report import check_writable, write

__all__ = ["check_writable", "write"]
