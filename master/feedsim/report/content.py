"""What a report says, as values: a kind of report fills a `Report`, `feedsim.report.page` sets it as HTML.

No text here knows how it will look: what is to be set apart is a `Span`, what hangs together a `Section`.
"""

from __future__ import annotations

import math
import shlex
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from feedsim.analysis import Figure
from feedsim.foundation.arguments import call
from feedsim.foundation.errors import Finding, InputError, OutputError, rank_findings
from feedsim.report.chart import Chart, Panel
from feedsim.report.chart.svg import png, standalone, svg
from feedsim.report.formatting import display_unit, figure_text, minus, typeset
from feedsim.report.provenance import InputFile, archives, axis_parameters, software
from feedsim.scenario import Machine

if TYPE_CHECKING:
    from feedsim.analysis import Figure
    from feedsim.report.chart import Chart


# --- A figure of a report, for its page and as a file of its own ------------------------------------------------------


# An SVG above this size [bytes] is put into the page as PNG instead.
LARGEST_SVG = 400_000
# Files that a drawing is written as.
PICTURE_FORMATS = ("png", "svg")


@dataclass(frozen=True, repr=False)
class Picture:
    """A figure: file stem, title, caption (plain text), and what it shows: a chart, or what draws it.

    A chart is drawn by the page, and once as SVG; of what is no chart the page holds the drawing. worded: title and
    caption stand above a chart in a file of its own. remark: small print there (:func:`with_remark`).
    """

    stem: str
    title: str
    caption: str
    shows: Chart | Callable[[], str]
    worded: bool = False
    remark: str = ""

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


# --- What a report says, as values: a kind of report fills a `Report`, `feedsim.report.page` sets it as HTML ----------


# Significant digits of a tile; the table has more.
TILE_DIGITS = 3
# The first screen has this many tiles, this many words of answers and of each finding, and rows of panels; all else is
# a click away.
TILES, ANSWER_WORDS, FINDING_WORDS, LEAD_ROWS = 3, 45, 24, 2


FOLDER = "THIS_FOLDER"  # in commands of the next step: the folder that the report is written to


def with_remark(pictures: Iterable[Picture], text: str, width: int = 150, lines: int = 2) -> list[Picture]:
    """The pictures with `text` in their upper right corner as files: a picture travels without its page.

    width, lines: characters of a line and lines that fit the narrowest figure; what is longer ends there.
    """
    remark = "\n".join(textwrap.wrap(text, width)[:lines])
    return [replace(picture, remark=remark) for picture in pictures]


@dataclass(frozen=True)
class Step:
    """What to do next.

    Attributes:
        words: what the command does.
        command: its name, such as "tune drive".
        arguments: of the command. Those of the call that has made this result, and that the command has, too, go along
            unless they stand here; None: left out. FOLDER in a value: where the report is written to.
        before: a command line that has to be typed first.
    """

    words: str
    command: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    before: str = ""

    def line(self, folder: Path | None) -> str:
        """The command line of a result that is written to a folder.

        "" outside of calls of jobs, and where the command needs the folder of a result that has none.
        """
        place = "" if folder is None else folder.as_posix()
        placed = {
            name: [str(entry).replace(FOLDER, place) for entry in value]
            if isinstance(value, list)
            else value.replace(FOLDER, place)
            if isinstance(value, str)
            else value
            for name, value in self.arguments.items()
        }
        present = call()
        if present is None or (folder is None and placed != self.arguments):
            return ""
        if placed.get("set"):  # which machine it is, the argument says already
            chosen = f"machine={present.arguments.get('machine')}"
            placed["set"] = [change for change in placed["set"] if change != chosen]
        line = present.typed(present, self.command, placed)
        return f"{self.before} && {line}" if line and self.before else line


@dataclass(frozen=True)
class Span:
    """A stretch of text that is set apart; a link leads to an anchor of the same page, a file to one beside it."""

    text: str
    kind: Literal["code", "muted", "alarm", "link", "file"]
    anchor: str = ""


# Plain text, or a mixture; line feeds break the line.
Text = str | Span | tuple[str | Span, ...]


def code(text: str) -> Span:
    """A name of a variable, a parameter or a figure, a command."""
    return Span(text, "code")


def command_path(file: Path) -> str:
    """A file as a command takes it: from the folder where the command is typed where it is below that."""
    if file.is_absolute() and file.is_relative_to(Path.cwd()):
        file = file.relative_to(Path.cwd())
    return shlex.quote(file.as_posix())


@dataclass(frozen=True)
class Paragraph:
    """A paragraph: usual, in muted print, or a note set apart."""

    text: Text
    kind: Literal["", "muted", "note"] = ""


@dataclass(frozen=True)
class Bullets:
    """A list."""

    items: Sequence[Text]


@dataclass(frozen=True, eq=False)
class Table:
    """A table, which scrolls where the screen is narrow.

    Attributes:
        columns: a letter each: l text, r numbers, t some words, p text that needs room, h what a row is called.
        heads: of the columns; none where the rows explain themselves.
        rows: cells; of a row with fewer than there are columns the last one takes the rest.
        note: below, in muted print.
    """

    columns: str
    heads: Sequence[str]
    rows: Sequence[Sequence[Text]]
    note: Text = ""


@dataclass(frozen=True, eq=False)
class Animation:
    """A moving picture: content of a GIF."""

    title: str
    caption: str
    gif: bytes


@dataclass(frozen=True, eq=False)
class Section:
    """Parts under a title; a section inside another one is a step lower. anchor: the title's id, for links. unfolded:
    whether the page shows it open at first."""

    title: str
    parts: Sequence[Part | None]
    anchor: str = ""
    unfolded: bool = False


Part = Paragraph | Bullets | Table | Picture | Animation | Section


@dataclass(frozen=True)
class Tile:
    """A number at the top of a page: value with unit, what it is, and its full meaning."""

    value: str
    label: str
    meaning: str

    @property
    def number_and_unit(self) -> tuple[str, str]:
        """The value taken apart, for a unit in smaller print; no unit where it is not one number with its unit."""
        number, _, unit = self.value.rpartition(" ")
        if not any(c.isdigit() for c in number) or any(c.isdigit() for c in unit.rstrip("²³")):
            return self.value, ""
        return number, unit

    @property
    def is_words(self) -> bool:
        """Whether the value is no number."""
        return self.value[-1:].isalpha() and not any(c.isdigit() for c in self.value)


def tile_value(figure: Figure) -> str:
    """Value with unit, to TILE_DIGITS digits that count, no place before the point left out."""
    value, unit = figure_text(figure)
    if unit and figure.value and sum(c.isdigit() for c in value.lstrip("−0.")) > TILE_DIGITS:
        size = math.floor(math.log10(abs(float(f"{figure.value:.{TILE_DIGITS}g}"))))
        value = minus(f"{figure.value:.{max(0, TILE_DIGITS - 1 - size)}f}")
    return f"{value} {unit}".strip()


@dataclass(frozen=True, eq=False)
class Report:
    """A report of any kind, in the order in which it is read; what is None or empty is left out.

    Attributes:
        answer: what the result is and what it means; only what is wrong stands ahead of it.
        warnings: what is wrong first (`feedsim.foundation.errors`). notes: what the numbers are worth, each once.
        tiles: leading numbers, the weightiest first: of these TILES stand on the first screen.
        action: the value to type, right below the answer.
        lead: the picture of the first screen; None: the first one of `main`. next_step: what to do, with a command.
        main: sections, tables and pictures; those with a title are folded.
        provenance: where the numbers come from: the last section, in small print.
    """

    title: str
    subtitle: str
    main: Sequence[Part | None]
    footer: Text
    provenance: Section | None = None
    answer: Sequence[str] = ()
    warnings: Sequence[Finding] = ()
    notes: Sequence[str] = ()
    tiles: Sequence[Tile] = ()
    lead: Picture | None = None
    next_step: Step | None = None
    action: str = ""

    @property
    def first_picture(self) -> Picture | None:
        """The picture of the first screen: `lead`, or the first one of `main`, its first panels where it has many."""
        if self.lead is not None:
            return self.lead
        first = next((part for part in self.main if isinstance(part, Picture)), None)
        return first and first.first_rows(LEAD_ROWS)

    @property
    def charts(self) -> dict[str, Chart]:
        """All charts of the page by their stems."""
        pictures = [*([self.first_picture] if self.first_picture else []), *self.pictures]
        return {picture.stem: picture.chart for picture in pictures if picture.chart is not None}

    @property
    def answers(self) -> tuple[list[str], list[str]]:
        """The answers of the first screen, one at least, and the others."""
        words, shown = 0, 0
        for line in self.answer:
            words += len(line.split())
            if shown and words > ANSWER_WORDS:
                break
            shown += 1
        return list(self.answer[:shown]), list(self.answer[shown:])

    @property
    def remarks(self) -> tuple[list[str], list[str]]:
        """Notes of the first screen, one that is short, and the others; notes among the findings are of the latter."""
        said = [finding.text for finding in self.findings if finding.severity == "note"]
        notes = list(dict.fromkeys(note for note in self.notes if note))
        short = [note for note in notes[:1] if len(note.split()) <= FINDING_WORDS]
        return short, [*notes[len(short) :], *said]

    @property
    def findings(self) -> list[Finding]:
        """The warnings, the gravest first."""
        return rank_findings(self.warnings)

    @property
    def pictures(self) -> list[Picture]:
        """All pictures, in their order."""
        return list(_pictures(self.main))


def split_finding(text: str, most: int = FINDING_WORDS) -> tuple[str, str]:
    """A text's beginning of `most` words or so, and the rest: parted behind a sentence or a clause where it has one."""
    words = text.split(" ")
    if len(words) <= most + most // 4:
        return text, ""
    ends = [k + 1 for k, word in enumerate(words[:most]) if word.endswith((".", ";", ":", ","))]
    cut = max((end for end in ends if end > most // 4), default=most)
    return " ".join(words[:cut]), " ".join(words[cut:])


def _pictures(parts: Sequence[Part | None]) -> Iterator[Picture]:
    for part in parts:
        if isinstance(part, Picture):
            yield part
        elif isinstance(part, Section):
            yield from _pictures(part.parts)


# --- Sections and tables that reports of several kinds have: figures, and where the numbers come from -----------------


FIGURES_ANCHOR = "figures"


def figures_section(figures: Mapping[str, Figure]) -> Section | None:
    """Every derived figure with unit and meaning."""
    if not figures:
        return None
    rows = [(code(name), *figure_text(figure), typeset(figure.meaning)) for name, figure in figures.items()]
    table = Table("lrlp", ("Figure", "Value", "Unit", "Meaning"), rows)
    return Section("Derived figures", [table], FIGURES_ANCHOR)


def figures_footer(rest: str, documents: str = "docs/figures.md") -> Text:
    """Text that leads to :func:`figures_section` and to its definitions, and goes on with ``rest``."""
    return (
        "What each figure means stands beside it in the table ",
        Span("Derived figures", "link", FIGURES_ANCHOR),
        f"; the full definitions come with the software ({documents}). {rest}",
    )


def provenance_section(
    rows: Iterable[tuple[str, str]], files: Iterable[InputFile], *further: Part | None, software_of: str = "Software"
) -> Section:
    """Where the numbers come from: what and what it is, the software, input files with their hashes, and further."""
    used = ", ".join(f"{name} {text}" for name, text in software().items())
    return Section(
        "Where the numbers come from", [pairs_table([*rows, (software_of, used)]), files_table(files), *further]
    )


def pairs_table(rows: Sequence[tuple[str, str]]) -> Table:
    """A table without heads: what, and what it is."""
    return Table("hl", (), rows)


def files_table(files: Iterable[InputFile]) -> Table:
    """Input files with their hashes."""
    rows = [(f.role, f.name, code(f.sha256 or "not readable")) for f in files]
    return Table("lll", ("Input file", "Name", "SHA-256"), rows)


def archives_table(units: Mapping[str, Mapping[str, str]]) -> Table | None:
    """The archives of a run's units (instance -> GUID and version); none without units."""
    rows = [(a.name, a.version, code(a.guid), ", ".join(a.instances)) for a in archives(units)]
    return Table("llll", ("Unit", "Version", "GUID", "Instances"), rows) if rows else None


def parameters_section(machine: Machine) -> Section:
    """Drive and friction parameters in SI: one row per parameter, one column per axis."""
    by_axis = {name: axis_parameters(axis) for name, axis in machine.axes.items()}
    keys = dict.fromkeys((g, n) for groups in by_axis.values() for g, names in groups.items() for n in names)
    rows: list[tuple[Text, ...]] = []
    for group, name in keys:
        result = [groups[group].get(name) for groups in by_axis.values()]
        unit = next(pair[1] for pair in result if pair is not None)
        values = (_value(pair[0]) if pair else "–" for pair in result)
        rows.append((group, code(name), display_unit(unit), *values))
    heads = ("Group", "Parameter", "SI unit", *by_axis)
    note = "A parameter that is not listed has the start value of its unit."
    return Section("Parameters of the axes", [Table("lll" + "r" * len(by_axis), heads, rows, note)])


def _value(value: float | int | bool | str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return minus(f"{value:.6g}") if isinstance(value, float) else str(value)
