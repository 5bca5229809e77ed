"""A report as one page of HTML without external requests, for light and dark screens and for paper."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.cache import own_folder
from feedsim.report.chart.layout import LAYOUT
from feedsim.report.chart.model import embedded
from feedsim.report.content import TILES, Report, parted
from feedsim.report.formatting import typeset
from feedsim.report.style import PALETTE

if TYPE_CHECKING:
    from jinja2 import BytecodeCache, Environment

    from feedsim.report.run.sheet import Filled

# What computes and draws the charts and what a reader does with them, in their order.
SCRIPTS = ("chart_scale.js", "chart_draw.js", "chart_use.js")
# The folders of an absolute path to a file: findings on a page name the file, "Where the numbers come from" has paths.
PATH = re.compile(r"(?<![\w.:/\\])(?:[A-Za-z]:)?(?:[/\\][^/\\:\s'\"]+)*[/\\](?=[^/\\:\s'\"]+\.\w+\b)")


def html(report: Report, kind: str = "", folder: Path | None = None) -> str:
    """HTML text; all text of the report is escaped.

    kind: of the result, which the page names as its generator. folder: that the result is written to.
    """
    environment = _environment()
    environment.filters["base64"] = lambda content: base64.b64encode(content).decode("ascii")
    environment.filters["typeset"] = typeset
    environment.filters["kind"] = lambda part: type(part).__name__
    environment.filters["parted"] = parted
    environment.filters["named"] = lambda text: PATH.sub("", text)
    charts = report.charts
    step = report.next_step.line(folder) if report.next_step is not None else ""
    return environment.get_template("report.html.j2").render(
        report=report, palette=PALETTE, data=embedded(charts) if charts else "", script=script() if charts else "",
        policy=policy(script() if charts else ""), kind=kind, most_tiles=TILES, next=step,
    )  # fmt: skip


def sheet_html(title: str, sheets: Sequence[Filled], rule: str) -> str:
    """HTML text of acceptance sheets, for print; all text is escaped. rule: how is decided."""
    environment = _environment()
    environment.filters["typeset"] = typeset
    return environment.get_template("sheet.html.j2").render(
        title=title, sheets=sheets, rule=rule, palette=PALETTE, policy=policy("")
    )


def style() -> str:
    """The style sheet of a page."""
    return _environment().get_template("style.css.j2").render(palette=PALETTE)


def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined  # on first use: most commands write no report

    return Environment(
        loader=PackageLoader("feedsim.report", "template"),
        bytecode_cache=_compiled(),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def _compiled() -> BytecodeCache | None:
    """Templates that an earlier process has compiled, a tenth of a short run's time; None: none are kept."""
    from jinja2 import FileSystemBytecodeCache
    from jinja2.bccache import Bucket

    class Kept(FileSystemBytecodeCache):
        def dump_bytecode(self, bucket: Bucket) -> None:
            with suppress(OSError):  # a full disk keeps nobody from a report
                super().dump_bytecode(bucket)

    place = own_folder("templates", [Path(__file__)])
    return Kept(str(place)) if place is not None else None


def drawing() -> str:
    """What draws the charts of a page and what a reader does with them; it is handed the sizes of layout.py."""
    folder = resources.files("feedsim.report") / "template"
    sizes = json.dumps(LAYOUT, ensure_ascii=False, separators=(",", ":"))
    return "".join([f"const LAYOUT = {sizes};\n", *((folder / name).read_text(encoding="utf-8") for name in SCRIPTS)])


@cache
def script() -> str:
    """The only script of a page."""
    return '"use strict";\n(() => {\n' + drawing() + "})();\n"


def policy(text: str) -> str:
    """What a browser lets a page do: run this script and no other, ask nobody for anything."""
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
    allowed = f"'sha256-{digest}'" if text else "'none'"
    return f"default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src {allowed}"
