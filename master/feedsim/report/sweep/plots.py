"""All pictures of a study, in the order of the page."""

from __future__ import annotations

import re

from feedsim.report.run.summary import HEADER, is_leading
from feedsim.report.style import Picture
from feedsim.report.sweep.account import Account, Output
from feedsim.report.sweep.figure_plots import of_account
from feedsim.report.sweep.grid_plots import grid_picture
from feedsim.report.sweep.measures import measures
from feedsim.report.sweep.overview_plot import overview_picture
from feedsim.sweep.sensitivity import is_constant

MOST_FIGURES = 8  # drawn one by one; the tables hold all


def varying(account: Account) -> list[Output]:
    """Figures that are not the same in all runs."""
    return [each for each in account.outputs if len(each.known) and not is_constant(each.known)]


def drawn(account: Account) -> list[Output]:
    """Figures that are drawn one by one: those that differ from run to run, the leading ones first."""
    known = varying(account)
    leading = [each for each in known if is_leading(each.name, HEADER)]
    return [*leading, *(each for each in known if each not in leading)][:MOST_FIGURES]


def pictures_of(account: Account) -> tuple[list[Picture], list[Picture]]:
    """Pictures of the whole study, and those of single figures."""
    overview = overview_picture(account)
    found = measures(account)
    single: list[Picture] = []
    taken: set[str] = set()
    for output in drawn(account):
        stem = _stem(output.name, taken)
        over_grid = grid_picture(account, output, stem)
        single += [over_grid] if over_grid is not None else of_account(account, output, found[output.name], stem)
    return [overview] if overview is not None else [], single


def _stem(name: str, taken: set[str]) -> str:
    """A figure's name as part of a file name, different from those taken."""
    stem = re.sub(r"[^A-Za-z0-9_-]+", "-", name.replace("+", "-plus")).strip("-") or "figure"
    number = 2
    unique = stem
    while unique in taken:
        unique, number = f"{stem}-{number}", number + 1
    taken.add(unique)
    return unique
