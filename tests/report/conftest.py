"""What tests of several kinds of reports look at."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from feedsim.report.chart import printed
from feedsim.report.style import finish


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
