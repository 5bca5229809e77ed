"""A figure of a report, for its page and as a file of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from feedsim.errors import InputError, OutputError
from feedsim.report.chart import Chart
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

    def __repr__(self) -> str:
        return f"Picture {self.stem!r}: {self.title}"

    def _repr_png_(self) -> bytes:
        return self.png
