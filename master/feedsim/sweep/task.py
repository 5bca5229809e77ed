"""A run of a study as it is given to a worker, and what comes back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from feedsim.scenario import Change


@dataclass(frozen=True)
class Task:
    """A run to be made.

    Attributes:
        run: its number in the study, from 0.
        changes: what is set in the study's scenario.
    """

    run: int
    changes: tuple[Change, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """What came of a run.

    Attributes:
        run: number of its :class:`Task`.
        figures: name -> (SI value, unit); NaN where a figure could not be determined. None where the run failed.
        error: why it failed; None where it did not.
        seconds: time that it took the worker [s].
        warnings: what a user should know before believing the figures.
    """

    run: int
    figures: Mapping[str, tuple[float, str]] | None
    error: str | None = None
    seconds: float = 0.0
    warnings: tuple[str, ...] = ()
