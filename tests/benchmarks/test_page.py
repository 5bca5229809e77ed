"""Tables of benchmarks find their places in the page."""

from __future__ import annotations

import re

import page
import pytest

PRINTED = "Machine.\n\n| a |\n|---|\n| 1 |\n\nText.\n\n| b |\n|---|\n| 2 |\n"


def test_tables_find_their_markers_again_and_again() -> None:
    empty = "# P\n\n<!-- floor 2 -->\n\nAfter.\n\n<!-- other 1 -->\n\n| kept |\n|---|\n"
    full = page.filled(empty, {"floor": PRINTED})
    assert full == "# P\n\n<!-- floor 2 -->\n\n| b |\n|---|\n| 2 |\n\nAfter.\n\n<!-- other 1 -->\n\n| kept |\n|---|\n"
    assert page.filled(full, {"floor": PRINTED}) == full
    assert "| 3 |" in page.filled(full, {"floor": PRINTED.replace("| 2 |", "| 3 |")})


def test_missing_table_is_an_error() -> None:
    with pytest.raises(ValueError, match="floor has printed 2 tables, the page wants number 3"):
        page.filled("<!-- floor 3 -->\n", {"floor": PRINTED})


def test_every_marker_of_the_page_has_its_table() -> None:
    text = page.PAGE.read_text()
    markers = [f"{name} {number}" for _, name, number in page.MARKED.findall(text)]
    assert len(markers) > 10
    assert len(set(markers)) == len(markers)
    for marker in markers:
        assert re.search(rf"<!-- {marker} -->\n\n\|", text), f"no table behind {marker}"
