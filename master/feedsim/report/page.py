"""A report as one page of HTML without external requests, for light and dark screens and for paper."""

from __future__ import annotations

import base64

from feedsim.report.content import Report
from feedsim.report.style import PALETTE


def html(report: Report) -> str:
    """HTML text; all text of the report is escaped."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # on first use: most commands write no report

    environment = Environment(
        loader=PackageLoader("feedsim.report", "template"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["base64"] = lambda content: base64.b64encode(content).decode("ascii")
    environment.filters["kind"] = lambda part: type(part).__name__
    return environment.get_template("report.html.j2").render(report=report, palette=PALETTE)
