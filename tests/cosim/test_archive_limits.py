"""Archives of more files than any simulator writes are refused before anything is unpacked."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from feedsim.foundation.errors import InputError
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.unpacked import MOST_ENTRIES


def test_entries_are_counted(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "many.fmu", "w") as package:
        for number in range(MOST_ENTRIES + 1):
            package.writestr(f"resources/{number}", "")
    with pytest.raises(InputError, match=f"it has {MOST_ENTRIES + 1} entries; allowed: up to {MOST_ENTRIES}"):
        Archive(tmp_path / "many.fmu")
