"""The scripts of a page: what computes, for a worker, and what shows, for the page itself."""

from __future__ import annotations

from functools import cache
from importlib import resources

COMPUTING = ("unit.js", "plan.js", "figures.js", "bode.js", "work.js")


@cache
def computing() -> str:
    """Unit, planner, figures: without anything of a browser, so that node runs it as well."""
    return "".join(_text(name) for name in COMPUTING)


@cache
def worker() -> str:
    """The worker's script."""
    return '"use strict";\n' + computing() + _text("worker.js")


def _text(name: str) -> str:
    return (resources.files("feedsim.page") / "template" / name).read_text(encoding="utf-8")
