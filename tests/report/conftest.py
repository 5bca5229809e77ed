"""What tests of several kinds of reports look at."""

from __future__ import annotations

from pathlib import Path

import pytest

from kinds_helpers import Kinds


@pytest.fixture(scope="session")
def kinds(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Kinds:
    """Results of all kinds, each made when it is first asked for."""
    return Kinds(tmp_path_factory.mktemp("kinds"), fmus)
