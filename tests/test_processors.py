"""What `make test-processors` runs is there: it is the last step of CI, where a file that moved would show too late."""

from __future__ import annotations

from pathlib import Path

import pytest

from processors import run

TESTS = Path(__file__).resolve().parent


@pytest.mark.parametrize("name", sorted({*run.REFERENCES, *run.CORE, *run.ALL}))
def test_its_files_are_there(name: str) -> None:
    assert (TESTS / name).exists()
