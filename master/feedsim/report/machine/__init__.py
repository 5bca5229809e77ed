"""A machine's structure: its figures, pictures of it and of its modes, the page that holds them.

It uses the report's core and what `feedsim.structure` found. Begin with `report`.
"""

from feedsim.report.machine.report import check_writable, write

__all__ = ["check_writable", "write"]
