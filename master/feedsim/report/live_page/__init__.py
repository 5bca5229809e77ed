"""A machine in one page: the compiled unit `machine`, its data and knobs, and what draws and computes in a browser.

May use analysis, cosim and report.
Start with `content.py`, what a page holds; `html.py` puts it together, and `template/` is what runs in a browser.
"""

from feedsim.report.live_page.html import write

__all__ = ["write"]
