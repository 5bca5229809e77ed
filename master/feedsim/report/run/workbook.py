"""Acceptance sheets as an Excel workbook: numbers as numbers, whatever the decimal sign of the reader's country.

A worksheet per sheet, in the order of sheet.html; all digits of sheet.csv. Sole user of XlsxWriter.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from feedsim.extras import ask

if TYPE_CHECKING:
    from feedsim.report.run.sheet import Filled

MAX_SHEET_NAME = 31  # of a worksheet, which Excel also forbids these characters in
FORBIDDEN = re.compile(r"[\[\]:*?/\\']")
CREATED = datetime(1980, 1, 1, tzinfo=UTC)  # the same result has the same bytes
WIDTHS = (24, 44, 14, 14, 14, 14)  # of the first columns, in characters
LONGEST_TEXT = 32767  # of a cell


def needed() -> None:
    """Raise MissingPackage unless workbooks can be written."""
    ask("sheet.xlsx (sheet: {xlsx: true})", "xlsx")


def workbook(sheets: Sequence[Filled], rule: str) -> bytes:
    """Content of sheet.xlsx. rule: how a figure is judged. Raises MissingPackage without XlsxWriter."""
    needed()
    import xlsxwriter

    content = io.BytesIO()
    # A text of the user that looks like a formula or an address stays a text.
    options = {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False}
    with xlsxwriter.Workbook(content, options) as book:
        book.set_properties({"title": "Acceptance sheet", "created": CREATED, "comments": "Written by feedsim run."})
        names: set[str] = set()
        for sheet in sheets:
            _fill(book, book.add_worksheet(_name(sheet.title, names)), sheet, rule)
    return content.getvalue()


def _name(title: str, taken: set[str]) -> str:
    """Name of a worksheet, and no second one of that name; Excel ignores upper and lower case."""
    plain = FORBIDDEN.sub(" ", title).strip() or "sheet"
    name, count = plain[:MAX_SHEET_NAME], 1
    while name.casefold() in taken:
        count += 1
        end = f" ({count})"
        name = plain[: MAX_SHEET_NAME - len(end)] + end
    taken.add(name.casefold())
    return name


def _fill(book: Any, page: Any, sheet: Filled, rule: str) -> None:
    title = book.add_format({"bold": True, "font_size": 14})
    head = book.add_format({"bold": True, "bottom": 1, "text_wrap": True, "valign": "top"})
    verdict = book.add_format({"bold": True, "border": 2, "align": "center"})
    wrapped = book.add_format({"text_wrap": True, "valign": "top"})
    figure, reading = (book.add_format({"num_format": digits}) for digits in ("0.00", "0.000"))
    for column, width in enumerate(WIDTHS):
        page.set_column(column, column, width)
    page.set_paper(9)  # A4
    page.set_landscape()
    page.fit_to_pages(1, 0)
    page.set_footer("&L&F&R&P / &N")

    row = 0

    def line(*cells: object, style: Any = None) -> None:
        nonlocal row
        for column, cell in enumerate(cells):
            if isinstance(cell, str):
                page.write_string(row, column, cell[:LONGEST_TEXT], style)
            elif isinstance(cell, (int, float)) and math.isfinite(cell):
                page.write_number(row, column, cell, style)
        row += 1

    line(sheet.title, style=title)
    line(f"Acceptance sheet in the letters of {sheet.standard}")
    if sheet.verdict:
        line(sheet.verdict.upper(), style=verdict)
    row += 1
    line("Symbol", "Meaning", "Value [µm]", "Limit [µm]", "U (k = 2) [µm]", "Verdict", style=head)
    for result in sheet.results:
        page.write_string(row, 0, result.symbol)
        page.write_string(row, 1, result.meaning, wrapped)
        page.write_string(row, 5, result.verdict)
        for column, value in ((2, result.value), (3, result.limit), (4, sheet.uncertainty)):
            if math.isfinite(value):
                page.write_number(row, column, value, figure)
        row += 1
    page.merge_range(row, 0, row, len(WIDTHS) - 1, rule, wrapped)
    page.set_row(row, 45)
    row += 2
    line("Condition", "", style=head)
    for what, how in sheet.conditions:
        line(what, how, style=wrapped)
    row += 1
    line(*sheet.heads, style=head)
    for cells in sheet.numbers:
        line(*cells, style=reading)
    page.repeat_rows(0)
    line()
    line("Date", "Name, signature", style=book.add_format({"top": 1}))
