"""What every job returns: figures, findings, answers, a report and its files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from fnmatch import fnmatch
from functools import cache
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

from feedsim.files.trace.files import written_whole
from feedsim.foundation.arguments import Call, call, call_context
from feedsim.foundation.errors import Finding, InputError, OutputError
from feedsim.foundation.outputs import allow_replacement, check_file, claim_folder, is_replacement_allowed
from feedsim.jobs.parameters import File, Watch
from feedsim.report.content import Picture, Report
from feedsim.report.page import html
from feedsim.report.provenance import figures_part
from feedsim.report.results import REPORT, SUMMARY, Content, check_place, describe_replaced_result, write_report

if TYPE_CHECKING:
    from feedsim.analysis import Figure, Figures
    from feedsim.scenario import Coupling, Machine

T = TypeVar("T")
V = TypeVar("V")


# --- What is said to who watches a job (jobs/parameters.py) before it begins ------------------------------------------


def announce_programs(watch: Watch, machine: Machine, fmus: Path | None, coupling: Coupling | None = None) -> None:
    """Announce the programs that a run of the machine executes besides those of feedsim.

    coupling: of the run, where a scenario has it.
    """
    from feedsim.simulation import cosim

    for sentence in cosim.describe_programs(machine, fmus, coupling):
        watch.announce(sentence)


def announce_archive(watch: Watch, path: Path | None, who: str) -> None:
    """The same of one archive that a user names, for the part that it plays; None: a shipped one."""
    from feedsim.simulation import cosim

    for sentence in cosim.describe_archive_programs(path, who) if path is not None else ():
        watch.announce(sentence)


# --- A kind of result, and what every job returns ---------------------------------------------------------------------


NOTEBOOK_HEIGHT = 900  # [px] of a report in a notebook; it scrolls


@dataclass(frozen=True)
class Kind:
    """A kind of result: its name, and what has to be known of its files before there is a result.

    Attributes:
        name: as summary.json has it.
        may_write: names of files that one may have besides report.html and summary.json.
        keeps: patterns of names of files that scenarios and machine files may name: the next result in the folder
            leaves them.
        own: of a folder, names of files in it that only results of this kind have, listed by a summary or not.
        main_file: of its files, the one that the command names.
        drawn: kinds of files that its pictures are drawn as where nothing else is asked for.
        reported: whether report.html and summary.json go along.
    """

    name: str
    may_write: Sequence[str] = ()
    keeps: Sequence[str] = ()
    own: Callable[[Path], Sequence[str]] = lambda folder: ()
    main_file: str = REPORT
    drawn: Sequence[str] = ()
    reported: bool = True

    def check_place(self, folder: Path, inputs: Sequence[Path] = (), files: Iterable[str] = ()) -> None:
        """Raise OutputError unless a result of this kind can be written to `folder`. Leaves nothing behind.

        inputs: files that are read; none of them is lost. files: names of further files that it has.
        """
        names = dict.fromkeys((*self.may_write, *files, *((REPORT, SUMMARY) if self.reported else ())))
        check_place(folder, list(names), inputs, kind=self.name, own=self.own(folder))


class LazyField(Generic[T]):
    """A field of a data class that is given as a value, or as a function that is called when it is first asked for.

    default: the function of the object where neither is given.
    """

    def __init__(self, default: Callable[[Any], T]) -> None:
        self._default_function = default

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __set__(self, owner: object, value: T | Callable[[], T]) -> None:
        vars(owner)[self._name] = value

    def __get__(self, owner: object | None, kind: type) -> T:
        if owner is None:  # the data class asks for the default
            return cast("T", self._default_function)
        value = vars(owner)[self._name]
        if callable(value):
            value = vars(owner)[self._name] = value(owner) if value is self._default_function else value()
        return cast("T", value)


@dataclass(frozen=True, eq=False, repr=False)
class Result(Generic[V]):
    """What a job has found: a value to compute with, and what is to be said of it. :meth:`save` writes both.

    What the value has, the result has: ``result.trace`` is ``result.value.trace``, ``result["Z.x_a"]`` is
    ``result.value["Z.x_a"]``. It reads its files no more: all is in memory.

    A kind of result is a function that makes this of a value. What takes longer it gives as functions without
    arguments, which are called when somebody asks. Terminal, page, summary.json and notebooks read the same fields, and
    what is said in the report: answers, warnings, what to type, what to do next.

    Attributes:
        value: what was found.
        report: a function: content of report.html.
        figures: name -> derived number with unit and meaning, and its interval where that is known.
        details: what summary.json has besides, as JSON has it.
        files: a function: name -> content of every file besides report.html, summary.json and figures.
        inputs: files that the result rests on; saving never replaces one of them.
        answers: what the job was asked, answered in sentences.
        findings: what is to be known before the result is believed.
        rows: what the command prints behind the answers.
        lines: what it prints: answers, what to type, rows, where nothing else is given. all_lines: with --verbose.
        in_lines: findings that these lines have already; the command prints them where it prints no lines.
        place: the folder that it was written to, where that is not the one that the job was given.

    >>> import feedsim as fs
    >>> result = fs.run("z_positioning.yaml")
    >>> isinstance(result, fs.Result), result.kind
    (True, 'run')
    >>> float(result["Z.x_a"][-1].round(6)), result.trace.unit("Z.x_a")
    (0.2, 'm')
    """

    _kind: Kind
    value: V
    report: Callable[[], Report]
    figures: LazyField[Figures] = LazyField(lambda _: {})
    details: LazyField[Mapping[str, Any]] = LazyField(lambda _: {})
    files: Callable[[], Mapping[str, Content]] = dict
    inputs: LazyField[Sequence[Path]] = LazyField(lambda _: ())
    answers: LazyField[Sequence[str]] = LazyField(lambda self: self.report().answer)
    findings: LazyField[tuple[Finding, ...]] = LazyField(lambda self: tuple(self.report().warnings))
    rows: LazyField[Sequence[str]] = LazyField(lambda _: ())
    lines: LazyField[Sequence[str]] = LazyField(lambda self: self._answers_and_rows())
    all_lines: LazyField[Sequence[str]] = LazyField(lambda self: self._lines_and_figures())
    in_lines: LazyField[Sequence[Finding]] = LazyField(lambda _: ())
    place: Path | None = None
    _call: Call | None = field(default_factory=call)

    def __post_init__(self) -> None:
        made = self.report

        def report() -> Report:
            with call_context(self._call):
                return made()

        object.__setattr__(self, "_made", report)
        object.__setattr__(self, "report", cache(report))

    @property
    def kind(self) -> str:
        """Of the result, such as "run"."""
        return self._kind.name

    def _answers_and_rows(self) -> list[str]:
        first, *others = [*self.answers] or [""]
        return [*filter(None, (first, self.report().action)), *others, *self.rows]

    def _lines_and_figures(self) -> list[str]:
        return [*self.lines, *(f"  {name} = {figure}: {figure.meaning}" for name, figure in self.figures.items())]

    @property
    def next_command(self) -> str:
        """What to do next, as it is typed; "" where there is nothing, or the command needs the folder of the result."""
        step = self.report().next_step
        with call_context(self._call):
            return "" if step is None else step.line(self.place)

    @property
    def pictures(self) -> Sequence[Picture]:
        """All pictures of the report."""
        return self.report().pictures

    def plot(self, *signals: str, ax: Any = None) -> Any:
        """The main picture of the report. A notebook shows it; ``.save("circle.png")`` writes it. Raises InputError.

        signals: of its trace, over time, in place of that: ``result.plot("Z.x_a", "Z.M_fr")``, also "Z.*". ax: axes of
        matplotlib, one or several, that it is drawn on, a panel on each; then they are returned.
        """
        if self.pictures and not signals:
            picture = self.pictures[0]
        elif hasattr(self.value, "trace"):
            from feedsim.report.run.axis_plots import signals_picture

            picture = signals_picture(self.value.trace.select(signals or ("*.x_a",)), self.report().title)
        else:
            raise InputError(f"a result of kind {self.kind} has no {'signals' if signals else 'picture'}")
        return picture if ax is None else picture.on(ax)

    def save(
        self,
        folder: str | Path,
        *,
        figures: Sequence[str] | None = None,
        force: bool = False,
        control: str = "",
    ) -> tuple[Path, ...]:
        """Write report.html, summary.json and all files; returns the paths.

        figures: kinds of files that the pictures are drawn as, "png" and "svg". force: files in `folder` that feedsim
        did not write may be replaced. control: parameters in the names and units of a control, "sinumerik", too. All is
        written or nothing. Raises OutputError.
        """
        kind = self._kind
        with allow_replacement(force or is_replacement_allowed()), in_words_of(control), call_context(self._call):
            files = self.files()
            kind.check_place(Path(folder), self.inputs, files)
            return write_report(
                folder,
                (self._made() if control else self.report()) if kind.reported else None,
                {"figures": figures_part(self.figures), **self.details},
                files,
                kind.drawn if figures is None else figures,
                kind=kind.name,
                own=kind.own(Path(folder)),
                keeps=[name for name in files if any(fnmatch(name, pattern) for pattern in kind.keeps)],
            )

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or "value" not in vars(self):
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        return getattr(self.value, name)

    def __getitem__(self, name: Any) -> Any:
        return self.value[name]  # type: ignore[index]

    def __iter__(self) -> Iterator[Any]:
        return iter(self.value)  # type: ignore[call-overload, no-any-return]

    def __len__(self) -> int:
        return len(self.value)  # type: ignore[arg-type]

    def __bool__(self) -> bool:
        return True

    def __dir__(self) -> list[str]:
        return sorted({name for name in (*super().__dir__(), *dir(self.value)) if not name.startswith("_")})

    def __repr__(self) -> str:
        wrong = [finding for finding in self.findings if finding.severity != "note"]
        said = [f"{len(wrong)} warning{'s'[: len(wrong) != 1]}, see .findings"] if wrong else []
        return "; ".join([f"Result of {self.kind}: {', '.join(self.answers[:1]) or 'no answer'}", *said])

    def _repr_html_(self) -> str:
        with call_context(self._call):
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
class MadeKind:
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
        with allow_replacement(force or is_replacement_allowed()):
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

    of: MadeKind
    name: str
    content: bytes
    answers: Sequence[str]
    findings: tuple[Finding, ...] = ()
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
def claim_result_folder(
    out: File | None,
    kind: Kind,
    watch: Watch,
    inputs: Sequence[Path],
    settings: Sequence[str] = (),
    *,
    force: bool,
) -> Iterator[None]:
    """A block in which the folder `out` belongs to this job alone. None: nothing is written.

    kind: of the result that will be written there. inputs, settings: files that are read, and what was asked for
    besides; where a result of other ones is replaced, the watch hears of it. force: files that feedsim did not write
    may be replaced; inputs never are.

    Raises OutputError: another process has the folder, or the result cannot be written there.
    """
    if out is None:
        yield
        return
    folder = Path(out)
    with allow_replacement(force or is_replacement_allowed()), claim_folder(folder):
        kind.check_place(folder, inputs)
        if sentence := describe_replaced_result(folder, inputs, settings):
            watch.note(sentence)
        yield
