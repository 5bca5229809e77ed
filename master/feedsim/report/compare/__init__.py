"""What comparisons of results leave: a page of HTML, JUnit XML and JSON.

It uses the report's core and what `feedsim.compare` found. Begin with `report`.
"""

from feedsim.report.compare.report import check_writable, write

__all__ = ["check_writable", "write"]
