"""The scripts and styles of a page: what computes, for a worker, and what shows, for the page itself."""

from __future__ import annotations

from functools import cache
from importlib import resources

from feedsim.report.page import drawing, style

COMPUTING = (
    "packed.js", "unit.js", "plan.js", "figures.js", "algebra.js", "circle_model.js", "circle_diagnosis.js", "signs.js",
    "circle_words.js", "linear.js", "judgement.js", "bode.js", "work.js",
)  # fmt: skip
SHOWING = ("packed.js", "figures.js", "signs.js", "pictures.js", "lessons.js", "page.js")


@cache
def computing() -> str:
    """Unit, planner, figures: without anything of a browser, so that node runs it as well."""
    return "".join(text(name) for name in COMPUTING)


@cache
def worker() -> str:
    """The worker's script."""
    return '"use strict";\n' + _without_comments(computing() + text("worker.js"))


@cache
def showing() -> str:
    """The page's own script: charts of reports, and what is about knobs."""
    script = drawing() + "".join(text(name) for name in SHOWING)
    return '"use strict";\n(() => {\n' + _without_comments(script) + "})();\n"


def styles() -> str:
    """The style sheet: that of reports, and the page's own."""
    return style() + text("page.css")


def text(name: str) -> str:
    """A file of the template folder."""
    return (resources.files("feedsim.page") / "template" / name).read_text(encoding="utf-8")


def _without_comments(script: str) -> str:
    """Without the lines that are comments alone, which are for readers of the sources: pages travel by mail."""
    return "".join(line for line in script.splitlines(keepends=True) if not line.lstrip().startswith("//"))
