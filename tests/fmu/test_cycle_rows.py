"""The control cycle as data: read as text, complete, and of words that the unit machine knows."""

import re
from pathlib import Path

import pytest

from feedsim.foundation import units
from feedsim_packager import cycle
from feedsim_packager.errors import InputError

HEADER = cycle.HEADER.read_text(encoding="utf-8")
C = (cycle.HEADER.parent / "exchange.c").read_text(encoding="utf-8")


def test_schemes_are_numbered_as_the_parameter_allows() -> None:
    numbers = [row[0] for row in cycle.read()["SCHEMES"]]
    scheme = units.table("machine")["coupling.scheme"]
    assert numbers == list(range(int(scheme.minimum), int(scheme.maximum) + 1))
    assert all(f"{number} {name}" in scheme.text for number, name, *_ in cycle.read()["SCHEMES"])


def test_the_unit_knows_every_word() -> None:
    """Columns stay words where the compiler does not see them: a row that no scheme reaches would."""
    rows = [row for name in cycle.TABLES[1:] for row in cycle.read()[name]]
    assert {f"WHEN_{row[0]}" for row in rows} == set(re.findall(r"#define (WHEN_\w+)", C))
    vectors = {f"AT_{word}" for row in rows for word in row[2:] if row[1] != "call"}
    assert set(re.findall(r"#define (AT_\w+)", C)) <= vectors


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("ROW(always, call, drives)", "ROW(always call; drives)", "CYCLE_BEGINS: not a row: ROW\\(always call; drives"),
        ("#define SPEED_GIVEN(ROW)", "#define SPEED(ROW)", "SPEED_GIVEN: no such table"),
    ],
)
def test_what_is_no_row_is_named(tmp_path: Path, old: str, new: str, words: str) -> None:
    header = tmp_path / "cycle.h"
    header.write_text(HEADER.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match=words):
        cycle.read(header)
