"""What a report says, as values: a kind of report fills a `Report`, `feedsim.report.page` sets it as HTML.

No text here knows how it will look: what is to be set apart is a `Span`, what hangs together a `Section`.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from feedsim.arguments import call
from feedsim.findings import ranked, severity
from feedsim.report.formatting import minus, shown
from feedsim.report.picture import Picture

if TYPE_CHECKING:
    from feedsim.analysis import Figure
    from feedsim.report.chart import Chart

# Significant digits of a tile; the table has more.
TILE_DIGITS = 3
# The first screen has this many tiles, this many words of answers and of each finding, and rows of panels; all else is
# a click away.
TILES, ANSWER_WORDS, FINDING_WORDS, LEAD_ROWS = 3, 45, 24, 2


FOLDER = "THIS_FOLDER"  # in commands of the next step: the folder that the report is written to


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


def typed(file: Path) -> str:
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
    value, unit = shown(figure)
    if unit and figure.value and sum(c.isdigit() for c in value.lstrip("−0.")) > TILE_DIGITS:
        size = math.floor(math.log10(abs(float(f"{figure.value:.{TILE_DIGITS}g}"))))
        value = minus(f"{figure.value:.{max(0, TILE_DIGITS - 1 - size)}f}")
    return f"{value} {unit}".strip()


@dataclass(frozen=True, eq=False)
class Report:
    """A report of any kind, in the order in which it is read; what is None or empty is left out.

    Attributes:
        answer: what the result is and what it means; only what is wrong stands ahead of it.
        warnings: what is wrong first (`feedsim.findings`). notes: what the numbers are worth, each once.
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
    warnings: Sequence[str] = ()
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
        said = [text for kind, text in self.findings if kind == "note"]
        notes = list(dict.fromkeys(note for note in self.notes if note))
        short = [note for note in notes[:1] if len(note.split()) <= FINDING_WORDS]
        return short, [*notes[len(short) :], *said]

    @property
    def findings(self) -> list[tuple[str, str]]:
        """Severity and text of the warnings, the gravest first."""
        return [(severity(name), str(name)) for name in ranked(self.warnings)]

    @property
    def pictures(self) -> list[Picture]:
        """All pictures, in their order."""
        return list(_pictures(self.main))


def parted(text: str, most: int = FINDING_WORDS) -> tuple[str, str]:
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
