"""The planner's library is taken from beside the archives that the other tests use."""

from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(scope="session", autouse=True)
def planner(fmus: Path) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FEEDSIM_FMUS", str(fmus))
        yield
