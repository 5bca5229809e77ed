"""What every job returns: figures, findings, answers, a report and its files."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from feedsim.errors import InputError
from feedsim.findings import severity
from feedsim.outputs import forced, replacing
from feedsim.report.content import Report
from feedsim.report.page import html
from feedsim.report.picture import Picture
from feedsim.report.results import REPORT, SUMMARY, Content, check_place, write_report

if TYPE_CHECKING:
    from feedsim.analysis import Figure

NOTEBOOK_HEIGHT = 900  # [px] of a report in a notebook; it scrolls


class Result(ABC):
    """What a job has found. It reads its files no more: all is in memory, and :meth:`save` writes it.

    >>> import feedsim as fs
    >>> result = fs.run("z_positioning.yaml")
    >>> isinstance(result, fs.Result), result.kind
    (True, 'run')
    """

    kind: ClassVar[str]  # of the result, as summary.json has it
    main_file: ClassVar[str] = REPORT  # of its files, the one that the command names
    own: ClassVar[Sequence[str]] = ()  # names of files that only results of this kind have
    may_write: ClassVar[Sequence[str]] = ()  # names of files that one may have besides report.html and summary.json

    @property
    def keeps(self) -> Sequence[str]:
        """Those of its files that scenarios and machine files may name: the next result in the folder leaves them."""
        return ()

    @property
    @abstractmethod
    def figures(self) -> Mapping[str, Figure]:
        """Name -> derived number with unit and meaning."""

    @property
    @abstractmethod
    def findings(self) -> Sequence[str]:
        """What is to be known before the result is believed: ``Wrong``, plain text (a doubt) or ``Note``."""

    @property
    @abstractmethod
    def answers(self) -> Sequence[str]:
        """What the job was asked, answered in sentences."""

    @property
    @abstractmethod
    def lines(self) -> Sequence[str]:
        """What the command of this job prints."""

    def lines_shown(self, verbose: bool) -> Sequence[str]:
        """What the command prints; verbose: all figures, too."""
        figures = self.figures.items() if verbose else ()
        return [*self.lines, *(f"  {name} = {figure}: {figure.meaning}" for name, figure in figures)]

    def findings_shown(self, quiet: bool) -> Sequence[str]:
        """Findings that the command prints; quiet: where it prints nothing else."""
        return self.findings

    @abstractmethod
    def report(self) -> Report:
        """Content of report.html."""

    @abstractmethod
    def summary(self, names: Sequence[str]) -> Mapping[str, Any]:
        """Content of summary.json, where all files have the given names."""

    @classmethod
    def check_place(cls, folder: Path, inputs: Sequence[Path] = ()) -> None:
        """Raise OutputError unless a result of this kind can be written to `folder`. Leaves nothing behind.

        inputs: files that are read; none of them is lost.
        """
        check_place(folder, (*cls.may_write, REPORT, SUMMARY), inputs, kind=cls.kind, own=cls.own)

    def check_writable(self, folder: Path, inputs: Sequence[Path] = ()) -> None:
        """Raise OutputError unless the result can be written to `folder` and none of `inputs` is lost."""
        self.check_place(folder, inputs)

    @property
    def inputs(self) -> Sequence[Path]:
        """Files that the result rests on; saving never replaces one of them."""
        return ()

    def files(self) -> Mapping[str, Content]:
        """Name -> content of every file besides report.html, summary.json and figures."""
        return {}

    @cached_property
    def pictures(self) -> tuple[Picture, ...]:
        """All pictures of the report."""
        return tuple(self.report().pictures)

    def plot(self) -> Picture:
        """The main picture of the report. A notebook shows it; ``.save("circle.png")`` writes it. Raises InputError."""
        if not self.pictures:
            raise InputError(f"a result of kind {self.kind} has no picture")
        return self.pictures[0]

    def save(
        self, folder: str | Path, *, figures: Sequence[str] = (), force: bool = False, control: str = ""
    ) -> tuple[Path, ...]:
        """Write report.html, summary.json and all files; returns the paths.

        figures: kinds of files that the pictures are drawn as, "png" and "svg". force: files in `folder` that feedsim
        did not write may be replaced. control: parameters in the names and units of a control, "sinumerik", too. All is
        written or nothing. Raises OutputError.
        """
        with replacing(force or forced()), in_words_of(control):
            self.check_writable(Path(folder), self.inputs)
            return write_report(
                folder,
                self.report(),
                self.summary,
                self.files(),
                figures,
                kind=self.kind,
                own=self.own,
                keeps=self.keeps,
            )

    def __repr__(self) -> str:
        wrong = [text for text in self.findings if severity(text) != "note"]
        said = [f"{len(wrong)} warning{'s'[: len(wrong) != 1]}, see .findings"] if wrong else []
        return "; ".join([f"Result of {self.kind}: {', '.join(self.answers[:1]) or 'no answer'}", *said])

    def _repr_html_(self) -> str:
        page = escape(html(self.report(), self.kind), quote=True)
        return f"<iframe style='width:100%;height:{NOTEBOOK_HEIGHT}px;border:0' srcdoc=\"{page}\"></iframe>"


def in_words_of(control: str) -> AbstractContextManager[None]:
    """Reports in the names of a control; without one their code is not loaded."""
    if not control:
        return nullcontext()
    from feedsim.report.control import control_names

    return control_names(control)
