"""A figure of a report, for its page and for print."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from feedsim.errors import InputError, OutputError
from feedsim.report.chart import Chart
from feedsim.report.chart.printed import printed
from feedsim.report.style import PALETTE, PAPER, REMARK, Drawn, said

# Files that a drawing is written as.
PICTURE_FORMATS = ("png", "svg")


@dataclass(frozen=True, repr=False)
class Picture:
    """A figure: file stem, title, caption (plain text), and what it shows: a chart, or what draws it.

    A chart is drawn by the page, and by matplotlib once a drawing is asked for; of what is no chart the page holds the
    drawing. worded: title and caption stand within the drawing of a chart.
    """

    stem: str
    title: str
    caption: str
    shows: Chart | Callable[[], Drawn]
    worded: bool = False
    remark: str = field(default_factory=lambda: REMARK.get())

    @property
    def chart(self) -> Chart | None:
        """What it shows as data; None where it is no chart."""
        return self.shows if isinstance(self.shows, Chart) else None

    @cached_property
    def drawn(self) -> Drawn:
        """The figure as matplotlib draws it."""
        with said(self.remark):
            if isinstance(self.shows, Chart):
                return printed(self.shows, self.stem, self.title, self.caption, worded=self.worded)
            return self.shows()

    @property
    def png(self) -> bytes:
        """The drawing as PNG."""
        return self.drawn.png

    @property
    def svg(self) -> str:
        """The drawing as text of an SVG."""
        return self.drawn.svg

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
            raise InputError(f"{path}: a picture is saved as {' or '.join(f'.{each}' for each in PICTURE_FORMATS)}")
        try:
            path.write_bytes(self.content(kind))
        except OSError as error:
            raise OutputError(f"{path} cannot be written: {error.strerror}") from None
        return path

    def content(self, kind: str) -> bytes:
        """What a file of one of PICTURE_FORMATS holds."""
        return self.png if kind == "png" else _standalone(self.svg).encode()

    def __repr__(self) -> str:
        return f"Picture {self.stem!r}: {self.title}"

    def _repr_png_(self) -> bytes:
        return self.png


def _standalone(svg: str) -> str:
    """An SVG as a file of its own: colours as numbers, a size, a light ground."""
    for name, colour, _ in PALETTE:
        svg = svg.replace(f"var(--{name})", colour)
    if match := re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg):
        svg = svg.replace("<svg", f'<svg width="{match[1]}pt" height="{match[2]}pt"', 1)
    end = svg.index(">") + 1
    ground = f'<rect width="100%" height="100%" fill="{PAPER}"/>'
    return f'<?xml version="1.0" encoding="utf-8"?>\n{svg[:end]}{ground}{svg[end:]}\n'
