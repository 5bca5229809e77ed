"""Programs as texts, and what they command, in mm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from feedsim.motions.part_program import Moves
from feedsim.motions.part_program.reading import interpret


def read(
    text: str,
    *,
    dialect: str = "sinumerik",
    files: Mapping[str, str] | None = None,
    axes: Sequence[str] = "XYZ",
    start: Sequence[float] | None = None,
    offsets: Mapping[str, Mapping[str, float]] | None = None,
    skip: bool = False,
) -> Moves:
    """Of a program with its subprograms (name -> text); start and offsets in mm."""

    def find(name: str) -> tuple[str, str] | None:
        return (f"{name}.SPF", files[name]) if files and name in files else None

    return interpret(
        "main.mpf", text, find, axes=axes, start=start or [0.0] * len(axes), dialect=dialect, offsets=offsets or {},
        tolerance=0.1, skip=skip,
    )  # fmt: skip


def ends(text: str, **given: object) -> list[list[float]]:
    """Ends of the rows [mm], to 1e-9 mm."""
    return np.round(read(text, **given).end * 1e3, 9).tolist()  # type: ignore[arg-type,no-any-return]
