"""A report as one page of HTML without external requests, for light and dark screens and for paper."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import os
import re
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from importlib import resources
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Self

from feedsim.files.trace import Trace
from feedsim.files.trace.cells import header_line, lines_of
from feedsim.files.trace.trace import first_not_finite
from feedsim.foundation.errors import OutputError
from feedsim.foundation.outputs import own_folder
from feedsim.report.chart.model import LAYOUT, embed_charts
from feedsim.report.content import TILES, Report, split_finding
from feedsim.report.formatting import PALETTE, typeset

if TYPE_CHECKING:
    from jinja2 import Environment

    from feedsim.report.run.sheet import FilledSheet


# What computes and draws the charts and what a reader does with them, in their order.
SCRIPTS = ("chart_scale.js", "chart_draw.js", "chart_use.js")
# The folders of an absolute path to a file: findings on a page name the file, "Where the numbers come from" has paths.
PATH = re.compile(r"(?<![\w.:/\\])(?:[A-Za-z]:)?(?:[/\\][^/\\:\s'\"]+)*[/\\](?=[^/\\:\s'\"]+\.\w+\b)")


def html(report: Report, kind: str = "", folder: Path | None = None) -> str:
    """HTML text; all text of the report is escaped.

    kind: of the result, which the page names as its generator. folder: that the result is written to.
    """
    charts = report.charts
    step = report.next_step.line(folder) if report.next_step is not None else ""
    return _environment().get_template("report.html.j2").render(
        report=report, palette=PALETTE, data=embed_charts(charts) if charts else "", script=script() if charts else "",
        policy=policy(script() if charts else ""), kind=kind, most_tiles=TILES, next=step,
    )  # fmt: skip


def sheet_html(title: str, sheets: Sequence[FilledSheet], rule: str) -> str:
    """HTML text of acceptance sheets, for print; all text is escaped. rule: how is decided."""
    return (
        _environment()
        .get_template("sheet.html.j2")
        .render(title=title, sheets=sheets, rule=rule, palette=PALETTE, policy=policy(""))
    )


def style() -> str:
    """The style sheet of a page."""
    return _environment().get_template("style.css.j2").render(palette=PALETTE)


def _environment() -> Environment:
    return _environment_with(own_folder("templates", [Path(__file__)]))


@cache
def _environment_with(place: Path | None) -> Environment:
    """Templates, compiled once a process.

    place: of those that an earlier process has compiled, a tenth of a short run's time; None: none are kept.
    """
    from jinja2 import Environment, FileSystemBytecodeCache, PackageLoader, StrictUndefined  # most commands need none
    from jinja2.bccache import Bucket

    class Kept(FileSystemBytecodeCache):
        def dump_bytecode(self, bucket: Bucket) -> None:
            with suppress(OSError):  # a full disk keeps nobody from a report
                super().dump_bytecode(bucket)

    environment = Environment(
        loader=PackageLoader("feedsim.report", "template"),
        bytecode_cache=Kept(str(place)) if place is not None else None,
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "base64": lambda content: base64.b64encode(content).decode("ascii"),
        "typeset": typeset,
        "kind": lambda part: type(part).__name__,
        "parted": split_finding,
        "named": lambda text: PATH.sub("", text),
    }
    return environment


def drawing_script() -> str:
    """What draws the charts of a page and what a reader does with them; it is handed the sizes of layout.py."""
    folder = resources.files("feedsim.report") / "template"
    sizes = json.dumps(LAYOUT, ensure_ascii=False, separators=(",", ":"))
    return "".join([f"const LAYOUT = {sizes};\n", *((folder / name).read_text(encoding="utf-8") for name in SCRIPTS)])


@cache
def script() -> str:
    """The only script of a page."""
    return '"use strict";\n(() => {\n' + drawing_script() + "})();\n"


def policy(text: str) -> str:
    """What a browser lets a page do: run this script and no other, ask nobody for anything."""
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
    allowed = f"'sha256-{digest}'" if text else "'none'"
    return f"default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src {allowed}"


# --- The rows of a run while it goes on: what is left of it if it fails, is interrupted or is killed ------------------


PARTIAL = "result.partial.csv"
MAX_WAITING = 1  # stretches of rows that wait to be written, until who brings more waits, too


class Partial:
    """result.partial.csv in a directory: called with the rows of a run, a stretch at a time (``cosim.run(sink=...)``).

    A thread writes them: to make text of numbers takes longer than to compute them, and the cycle loop leaves the
    interpreter to it. A context: behind it the file is there if the block failed, unless there was no row, and gone if
    it ended well. That of another run is replaced with the first row, no sooner: a run that never begins takes nothing
    away.

    rows, time: what it holds so far, up to time [s].
    """

    def __init__(self, directory: Path | str, result: str) -> None:
        """result: name of the file that this is a part of, for messages."""
        self._directory, self._result = Path(directory), result
        self.path = self._directory / PARTIAL
        self.rows, self.time = 0, 0.0
        self._file: IO[bytes] | None = None
        self._writer: ThreadPoolExecutor | None = None
        self._waiting: deque[Future[None]] = deque()
        self._fault: OutputError | None = None

    def __call__(self, part: Trace) -> None:
        """Append rows. OutputError: a value is not finite, or the file cannot be written; also of rows before."""
        if self._writer is None:
            self._writer = ThreadPoolExecutor(1)
        self._waiting.append(self._writer.submit(self._append, part))
        while len(self._waiting) > MAX_WAITING or (self._waiting and self._waiting[0].done()):
            self._waiting.popleft().result()

    def catch_up(self) -> None:
        """Have all rows written. OutputError: as of a call."""
        try:
            while self._waiting:
                self._waiting.popleft().result()
        finally:
            if self._writer is not None:
                self._writer.shutdown()
                self._writer = None

    def _append(self, part: Trace) -> None:
        """In the thread. Behind a fault nothing is written: no rows are missing between others."""
        if self._fault is not None:
            raise self._fault
        try:
            self._write(part)
        except OutputError as error:
            self._fault = error
            raise

    def _write(self, part: Trace) -> None:
        for name, values in part.columns.items():
            if (row := first_not_finite(values)) is not None:
                raise OutputError(
                    f"{self._directory / self._result} is not written: {name} is {values[row]} at "
                    f"{part.time[row]:.9g} s"
                )
        try:
            if self._file is None:
                self._directory.mkdir(parents=True, exist_ok=True)
                self.path.unlink(missing_ok=True)  # of another run
                self._file = self.path.open("xb")
                self._file.write(header_line(part))
            self._file.write(lines_of([part.time, *part.columns.values()]))
            self._file.flush()
        except OSError as error:
            raise self._unusable(error) from error
        self.rows += len(part)
        self.time = float(part.time[-1])

    @property
    def scratch(self) -> Path:
        """An existing folder on the same disk, for what a run needs a file for."""
        folder = self._directory.absolute()
        return next(path for path in (folder, *folder.parents) if path.is_dir())

    @property
    def has_rows(self) -> bool:
        """Whether the file is there, with rows. OutputError: as of a call."""
        self.catch_up()
        return self.rows > 0 and self.path.exists()

    def finished(self) -> None:
        """Close the file, its bytes being on the disk. OutputError."""
        self.catch_up()
        if self._file is None:
            return
        try:
            os.fsync(self._file.fileno())
            self._file.close()
        except OSError as error:
            raise self._unusable(error) from error
        self._file = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(OutputError):  # of rows behind those that the caller has learnt of
            self.catch_up()
        with contextlib.suppress(OSError):
            if self._file is not None:
                self._file.close()
            if kind is None and self.rows:
                self.path.unlink(missing_ok=True)
                self.rows = 0  # who writes the result once more writes its rows, too

    def _unusable(self, error: OSError) -> OutputError:
        return OutputError(f"{self.path} cannot be written: {error.strerror or error}")
