"""What every job returns: figures, findings, answers, a report and its files."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from feedsim.files.trace.files import written_whole
from feedsim.foundation.arguments import Call, call, calling
from feedsim.foundation.errors import InputError, OutputError, severity
from feedsim.foundation.outputs import check_file, forced, replacing
from feedsim.foundation.owned import claimed
from feedsim.jobs.parameters import File, Watch
from feedsim.report.content import Picture, Report
from feedsim.report.page import html
from feedsim.report.results import REPORT, SUMMARY, Content, check_place, replaced, write_report

if TYPE_CHECKING:
    from feedsim.analysis import Figure
    from feedsim.scenario import Coupling, Machine


# --- What is said to who watches a job (jobs/parameters.py) before it begins ------------------------------------------


def announce(watch: Watch, machine: Machine, fmus: Path | None, coupling: Coupling | None = None) -> None:
    """Announce the programs that a run of the machine executes besides those of feedsim.

    coupling: of the run, where a scenario has it.
    """
    from feedsim.simulation import cosim

    for sentence in cosim.executed(machine, fmus, coupling):
        watch.announce(sentence)


def announce_archive(watch: Watch, path: Path | None, who: str) -> None:
    """The same of one archive that a user names, for the part that it plays; None: a shipped one."""
    from feedsim.simulation import cosim

    for sentence in cosim.executing(path, who) if path is not None else ():
        watch.announce(sentence)


# --- What every job returns: figures, findings, answers, a report and its files ---------------------------------------


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

    call: Call | None  # of the job that has made it; None of one made otherwise

    def __new__(cls, *_: object, **__: object) -> Self:
        made = super().__new__(cls)
        object.__setattr__(made, "call", call())
        return made

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

    def plot(self, *, ax: Any = None) -> Any:
        """The main picture of the report. A notebook shows it; ``.save("circle.png")`` writes it. Raises InputError.

        ax: axes of matplotlib, one or several, that it is drawn on, a panel on each; then they are returned.
        """
        if not self.pictures:
            raise InputError(f"a result of kind {self.kind} has no picture")
        return self.pictures[0] if ax is None else self.pictures[0].on(ax)

    def save(
        self, folder: str | Path, *, figures: Sequence[str] = (), force: bool = False, control: str = ""
    ) -> tuple[Path, ...]:
        """Write report.html, summary.json and all files; returns the paths.

        figures: kinds of files that the pictures are drawn as, "png" and "svg". force: files in `folder` that feedsim
        did not write may be replaced. control: parameters in the names and units of a control, "sinumerik", too. All is
        written or nothing. Raises OutputError.
        """
        with replacing(force or forced()), in_words_of(control), calling(self.call):
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
        with calling(self.call):
            page = escape(html(self.report(), self.kind), quote=True)
        return f"<iframe style='width:100%;height:{NOTEBOOK_HEIGHT}px;border:0' srcdoc=\"{page}\"></iframe>"


def in_words_of(control: str) -> AbstractContextManager[None]:
    """Reports in the names of a control; without one their code is not loaded."""
    if not control:
        return nullcontext()
    from feedsim.report.changes import control_names

    return control_names(control)


# --- What a job returns that makes one file for other programs: an archive, an SSP file, a page -----------------------


@dataclass(frozen=True)
class Kind:
    """A kind of such files: what messages call it, and how one of feedsim's own is known, which may be replaced."""

    name: str
    what: str
    ours: Callable[[Path], bool]
    makes_folder: bool = False

    def check_folder(self, out: File | None) -> None:
        """Raise OutputError where there is no folder for the file; None: it stays in memory."""
        if out is not None and not self.makes_folder and not Path(out).absolute().parent.is_dir():
            raise OutputError(f"{out} cannot be written: no such folder: {Path(out).parent}")

    @contextmanager
    def checked(self, out: File | None, inputs: Sequence[Path], *, force: bool) -> Iterator[Path | None]:
        """A block that makes the file `out`; None: it stays in memory.

        inputs: files that are read; none of them is replaced. force: a file that feedsim did not write may be.
        Raises OutputError: the file cannot be written there.
        """
        if out is None:
            yield None
            return
        path = Path(out)
        with replacing(force or forced()):
            self.check_folder(path)
            check_file(path, inputs, ours=self.ours, what=self.what)
            yield path


@dataclass(frozen=True, eq=False, repr=False)
class Made:
    """A file that a job has made. It is in memory, and :meth:`save` writes it.

    Attributes:
        content: of the file.
        answers: what it holds, in sentences.
        findings: what is to be known before it is used.
        figures: name -> number with unit and meaning.
        inputs: files that it rests on; saving never replaces one of them.
        name: that it has in :meth:`files`.

    >>> import feedsim as fs
    >>> made = fs.export("machines/test_centre")
    >>> isinstance(made, fs.Made), made.size == len(made.content), list(made.files())
    (True, True, ['machine.fmu'])
    """

    of: Kind
    name: str
    content: bytes
    answers: Sequence[str]
    findings: Sequence[str] = ()
    figures: Mapping[str, Figure] = field(default_factory=dict)
    inputs: Sequence[Path] = ()

    @property
    def kind(self) -> str:
        """Of the result, such as "pack"."""
        return self.of.name

    @property
    def size(self) -> int:
        """Of the file [bytes]."""
        return len(self.content)

    def files(self) -> Mapping[str, bytes]:
        """Name -> content."""
        return {self.name: self.content}

    def save(self, path: File, *, force: bool = False) -> Path:
        """Write the file, whole or not at all; returns its path. In a folder it is called as in :meth:`files`.

        force: a file may be replaced that feedsim did not write. Raises OutputError.
        """
        where = Path(path) / self.name if Path(path).is_dir() else Path(path)
        with self.of.checked(where, self.inputs, force=force):
            if self.of.makes_folder:
                with suppress(OSError):  # writing says what is wrong
                    where.absolute().parent.mkdir(parents=True, exist_ok=True)
            with written_whole(where) as file:
                file.write(self.content)
        return where

    def __repr__(self) -> str:
        return f"Result of {self.kind}: {self.answers[0]}"


# --- The folder that a job writes its result to: checked before the work begins, and claimed until it ends ------------


@contextmanager
def kept(
    out: File | None,
    check: Callable[[Path, Sequence[Path]], None],
    watch: Watch,
    inputs: Sequence[Path],
    settings: Sequence[str] = (),
    *,
    force: bool,
) -> Iterator[None]:
    """A block in which the folder `out` belongs to this job alone. None: nothing is written.

    check: of the report that will be written there. inputs, settings: files that are read, and what was asked for
    besides; where a result of other ones is replaced, the watch hears of it. force: files that feedsim did not write
    may be replaced; inputs never are.

    Raises OutputError: another process has the folder, or the result cannot be written there.
    """
    if out is None:
        yield
        return
    folder = Path(out)
    with replacing(force or forced()), claimed(folder):
        check(folder, inputs)
        if sentence := replaced(folder, inputs, settings):
            watch.note(sentence)
        yield
