"""What tests of several kinds of reports look at."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from feedsim.report.chart import printed
from feedsim.report.style import finish
from kinds_helpers import Kinds


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Figures that charts are drawn as, once everything in them has its place."""
    found: list[Any] = []

    def looked_at(figure: Any, *rest: str, then: Callable[[], object], **options: Any) -> Any:
        def after() -> None:
            then()
            found.append(figure)

        return finish(figure, *rest, then=after, **options)

    monkeypatch.setattr(printed, "finish", looked_at)
    return found


@pytest.fixture(scope="session")
def kinds(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Kinds:
    """Results of all kinds, each made when it is first asked for."""
    return Kinds(tmp_path_factory.mktemp("kinds"), fmus)
