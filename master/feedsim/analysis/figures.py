"""A derived figure, and tables of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feedsim.files.trace.trace import suggest_name
from feedsim.foundation.errors import UnknownName
from feedsim.foundation.installation import require_module

if TYPE_CHECKING:
    import pandas

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Figure:
    """One derived number. ``value`` is NaN where the trace does not contain what the definition asks for.

    ``float(figure)`` is its value. interval: its ends of 95 %, or of the share that was asked for, in its unit; None:
    not known.

    >>> import feedsim as fs
    >>> figure = fs.run("z_positioning.yaml").figures["Z.overshoot"]
    >>> float(figure) == figure.value
    True
    >>> print(figure, "-", figure.meaning)  # doctest: +ELLIPSIS
    3.13... um - ...
    """

    value: float
    unit: str
    meaning: str
    interval: tuple[float, float] | None = None

    def __float__(self) -> float:
        return self.value

    def __str__(self) -> str:
        return f"{self.value:.4g} {self.unit}" if math.isfinite(self.value) else "not determined"


Figures = Mapping[str, Figure]


class FigureTable(dict[str, Figure]):
    """Figures by name, a table: :meth:`to_pandas`, and as notebooks show it.

    A name that is none raises UnknownName, which says which is the nearest.

    >>> FigureTable({"Z.overshoot": Figure(3.1, "um", "")})["Z.overshot"]
    Traceback (most recent call last):
    feedsim.foundation.errors.UnknownName: no figure 'Z.overshot'; did you mean 'Z.overshoot'?
    """

    def __missing__(self, name: str) -> Figure:
        raise UnknownName(f"no figure {name!r}{suggest_name(name, self)}")

    def with_intervals(self, intervals: Mapping[str, tuple[float, float]]) -> FigureTable:
        """The same with intervals of some; ends that are NaN are not known."""
        known = {name: ends for name, ends in intervals.items() if name in self and math.isfinite(ends[0])}
        return FigureTable(self | {name: replace(self[name], interval=ends) for name, ends in known.items()})

    def to_pandas(self) -> pandas.DataFrame:
        """A row per figure: value, unit, low and high end of its interval, meaning. Needs the package pandas."""
        rows = [(f.value, f.unit, *(f.interval or (math.nan, math.nan)), f.meaning) for f in self.values()]
        return require_module("pandas", "a DataFrame").DataFrame(
            rows, index=list(self), columns=["value", "unit", "low", "high", "meaning"]
        )

    def _repr_html_(self) -> str:
        rows = [
            (name, str(f), "" if f.interval is None else f"{f.interval[0]:.4g} to {f.interval[1]:.4g}", f.meaning)
            for name, f in self.items()
        ]
        cells = ["".join(f"<td style='text-align:left'>{escape(cell)}</td>" for cell in row) for row in rows]
        heads = "".join(f"<th>{head}</th>" for head in ("figure", "value", "interval", "meaning"))
        return f"<table><tr>{heads}</tr>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>"
