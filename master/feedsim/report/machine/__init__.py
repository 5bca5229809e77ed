"""A machine's structure: its figures, pictures of it and of its modes, the page that holds them.

It uses the report's core and what `feedsim.structure` found. Begin with `write`.
"""

from feedsim.report.machine.write import check_writable, write

__all__ = ["check_writable", "write"]
