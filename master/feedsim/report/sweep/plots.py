"""All pictures of a study in the order of the page, and the first of them: which parameter moves which figure."""

from __future__ import annotations

import re

import numpy as np

from feedsim.report.chart import Chart, Grid
from feedsim.report.picture import Picture
from feedsim.report.run.report import HEADER, is_leading
from feedsim.report.sweep.account import NOTHING, RANK, TOTAL, Account, Output, measures
from feedsim.report.sweep.figure_plots import grid_picture, of_account
from feedsim.sweep.sensitivity import is_constant

MOST_FIGURES = 8  # drawn one by one; the tables hold all
MOST_ROWS, MOST_COLUMNS = 30, 20  # of the overview


def varying(account: Account) -> list[Output]:
    """Figures that are not the same in all runs."""
    return [output for output in account.outputs if len(output.known) and not is_constant(output.known)]


def drawn(account: Account) -> list[Output]:
    """Figures that are drawn one by one: those that differ from run to run, the leading ones first."""
    known = varying(account)
    leading = [output for output in known if is_leading(output.name, HEADER)]
    return [*leading, *(output for output in known if output not in leading)][:MOST_FIGURES]


def pictures_of(account: Account) -> tuple[list[Picture], list[Picture]]:
    """Pictures of the whole study, and those of single figures."""
    overview = overview_picture(account)
    result = measures(account)
    single: list[Picture] = []
    taken: set[str] = set()
    for output in drawn(account):
        stem = _stem(output.name, taken)
        over_grid = grid_picture(account, output, stem)
        single += [over_grid] if over_grid is not None else of_account(account, output, result[output.name], stem)
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


def overview_picture(account: Account) -> Picture | None:
    """The matrix in colours and numbers; None where there is nothing to compare."""
    result = [measure for measure in measures(account).values() if measure.known]
    result = [measure for measure in result if measure.kind == result[0].kind][:MOST_ROWS]
    if not result or len(account.inputs) < 2:
        return None
    ranks = sorted(range(len(account.inputs)), key=lambda k: -max(measure.size(k) for measure in result))
    columns = sorted(ranks[:MOST_COLUMNS])
    left_out = len(account.inputs) - len(columns)
    more = f" {left_out} parameters that move no figure more are left out." if left_out else ""
    values = np.array([[float(measure.values[k]) for k in columns] for measure in result])
    bold = np.array([[measure.significant(k) for k in columns] for measure in result])
    if result[0].kind == TOTAL:
        values = np.where(np.abs(values) < NOTHING, np.nan, values)
    names, figures = [account.inputs[k].name for k in columns], [measure.figure for measure in result]
    span = (-1.0, 1.0) if result[0].kind == RANK else (0.0, 1.0)
    chart = Chart([Grid("", names, figures, values, span, 2, bold)])
    title = "Which parameter moves which figure"
    return Picture("sensitivities", title, result[0].caption + more, chart, worded=True)
