"""What the master knows of the units' variables: made by the packager, told when it is not there."""

import json
from pathlib import Path

import pytest

from feedsim.foundation import units
from feedsim.foundation.errors import InputError
from feedsim_packager import cli


def test_the_packager_writes_what_is_loaded(tmp_path: Path) -> None:
    written = tmp_path / "variables.json"
    assert cli.main(["variables", "--out", str(written)]) == 0
    assert json.loads(written.read_bytes()) == json.loads(units.FILE.read_bytes())


def test_a_table_that_is_missing_names_the_command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(units, "FILE", tmp_path / "none.json")
    units._read_tables.cache_clear()
    with pytest.raises(InputError, match=r"none\.json is missing; `make fmus` builds it"):
        units._read_tables()


@pytest.mark.parametrize(
    ("name", "example", "short"),
    [
        ("K_v", "4 (m/min)/mm", "position controller gain"),  # shorter in the unit that people use
        ("M_max", "80 N.m", "limit of the torque setpoint, both directions"),
        ("k_ffw", "1", "weight of the speed feedforward"),
        ("T_ref", "", "reference model"),  # starts at zero, which shows nobody anything
        ("p", "", "pole pairs"),  # no quantity
    ],
)
def test_a_row_in_words(name: str, example: str, short: str) -> None:
    row = units.table("controller")[name]
    assert (row.example, row.short) == (example, short)
