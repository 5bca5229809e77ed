"""A figure of a report, for its page and as a file of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.errors import InputError, OutputError
from feedsim.report.chart import Chart, Panel
from feedsim.report.chart.file import png, standalone
from feedsim.report.chart.svg import svg
from feedsim.report.style import REMARK

# An SVG above this size [bytes] is put into the page as PNG instead.
LARGEST_SVG = 400_000
# Files that a drawing is written as.
PICTURE_FORMATS = ("png", "svg")


@dataclass(frozen=True, repr=False)
class Picture:
    """A figure: file stem, title, caption (plain text), and what it shows: a chart, or what draws it.

    A chart is drawn by the page, and once as SVG; of what is no chart the page holds the drawing. worded: title and
    caption stand above a chart in a file of its own.
    """

    stem: str
    title: str
    caption: str
    shows: Chart | Callable[[], str]
    worded: bool = False
    remark: str = field(default_factory=lambda: REMARK.get())

    @property
    def chart(self) -> Chart | None:
        """What it shows as data; None where it is no chart."""
        return self.shows if isinstance(self.shows, Chart) else None

    @cached_property
    def svg(self) -> str:
        """The drawing as text of an SVG within a page."""
        return svg(self.shows, self.stem, self.title) if isinstance(self.shows, Chart) else self.shows()

    @property
    def is_light(self) -> bool:
        """Whether a page holds the SVG; one above LARGEST_SVG it holds as PNG."""
        return len(self.svg) <= LARGEST_SVG

    @cached_property
    def png(self) -> bytes:
        """The drawing as PNG."""
        return png(self._file)

    @property
    def _file(self) -> str:
        """The drawing as text of an SVG that is a file of its own."""
        return standalone(self.svg, self.title, self.caption if self.worded else "", self.remark)

    def first_rows(self, most: int) -> Picture:
        """The picture itself, or one of its first rows of panels where it has more than `most`."""
        if self.chart is None or len(rows := list(self.chart.rows())) <= most:
            return self
        first = [panel for row in rows[:most] for panel in row]
        return replace(self, stem=f"{self.stem}-first", shows=Chart(first, self.chart.widths))

    def save(self, path: str | Path) -> Path:
        """Write it as .png or .svg, which the name shows; returns the path. Raises InputError, OutputError."""
        path = Path(path)
        kind = path.suffix.lower().removeprefix(".")
        if kind not in PICTURE_FORMATS:
            raise InputError(f"{path}: a picture is saved as {' or '.join(f'.{name}' for name in PICTURE_FORMATS)}")
        try:
            path.write_bytes(self.content(kind))
        except OSError as error:
            raise OutputError(f"{path} cannot be written: {error.strerror}") from None
        return path

    def content(self, kind: str) -> bytes:
        """What a file of one of PICTURE_FORMATS holds."""
        return self.png if kind == "png" else self._file.encode()

    def on(self, ax: Any) -> Any:
        """Draw it on axes of matplotlib, and return them: the first panel on one, a panel on each of several.

        Axes get quantity and unit. A circle is drawn over its angle. Raises InputError: it is no chart, or has fewer
        panels.
        """
        panels = [part for part in self.chart.panels if isinstance(part, Panel)] if self.chart is not None else []
        several = list(np.ravel(ax)) if isinstance(ax, list | tuple | np.ndarray) else [ax]
        if len(panels) < len(several):
            raise InputError(f"{self.title}: has {len(panels)} panels with axes, {len(several)} are needed")
        for one, panel in zip(several, panels, strict=False):
            for curve in panel.curves:
                style = {"": "-", "dashed": "--", "dotted": ":"}[curve.dash]
                words = {"color": curve.colour, "linewidth": curve.width, "label": curve.name}
                one.plot(curve.x, curve.y, "." if curve.dots else style, **words)
            for level in panel.levels:
                (one.axvline if level.upright else one.axhline)(level.at, color="0.5", linewidth=0.8, linestyle=":")
            one.set_xscale("log" if panel.x.log else "linear")
            one.set_yscale("log" if panel.y.log else "linear")
            if panel.x.span is not None:
                one.set_xlim(*panel.x.span)
            if panel.y.span is not None:
                one.set_ylim(*panel.y.span)
            one.set_xlabel(panel.x.title)
            one.set_ylabel(panel.y.title)
            one.set_title(panel.title or self.title)
            if len({curve.name for curve in panel.curves}) > 1:
                one.legend()
        return ax

    def __repr__(self) -> str:
        return f"Picture {self.stem!r}: {self.title}"

    def _repr_png_(self) -> bytes:
        return self.png
