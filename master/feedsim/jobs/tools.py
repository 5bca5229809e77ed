"""What belongs to a terminal: the documentation in a browser, completion in a shell."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, get_args, overload

from feedsim.files import trace
from feedsim.foundation.arguments import spell_argument, split_names
from feedsim.foundation.errors import InputError
from feedsim.foundation.outputs import TemporaryFolder, check_file, content_check
from feedsim.jobs.examples import Example, copy, examples
from feedsim.jobs.parameters import Argument, File, Force, Option, job, out_file
from feedsim.jobs.result import Made, MadeKind
from feedsim.scenario.schema import Kind as FileKind
from feedsim.scenario.schema import json_schema


@job("open the documentation", needs=())
def docs(
    path: Annotated[bool, Option("", "print the path of its first page, and open nothing")] = False,
) -> str:
    """Open the documentation of this installation in a browser.

    Raises:
        InputError: this installation has none.
    """
    from feedsim.foundation.installation import documentation

    page = documentation()
    if page is None:
        raise InputError("this installation has no documentation: a release's wheel brings it, `make docs` builds it")
    if not path:
        import webbrowser

        webbrowser.open(page.as_uri())
    return str(page)


@job("print the completion for bash, zsh or fish", needs=())
def completion(shell: Annotated[str, Argument("", "the shell", choices=("bash", "zsh", "fish"))]) -> str:
    """Print a script that completes commands, options and choices.

    In ~/.bashrc, or in ~/.zshrc behind compinit: eval "$(feedsim tools completion bash)", or zsh. For fish, once:
    feedsim tools completion fish > ~/.config/fish/completions/feedsim.fish
    """
    from argcomplete.shell_integration import shellcode

    return str(shellcode(["feedsim"], shell=shell)).rstrip("\n")


# --- A recording as a CSV trace with units in its header --------------------------------------------------------------


@job("turn a record of any kind into a CSV trace", needs=())
def convert(
    file: Annotated[File, Argument("FILE", "CSV, MAT, or another record (docs/traces.md)")],
    out: Annotated[File | None, out_file("FILE.csv", "the table to write")] = None,
    *,
    column: Annotated[
        str | Sequence[str],
        Option("VARIABLE=NAME:UNIT", "one column; the first must be time; none: all", many=True),
    ] = (),
    force: Force = False,
) -> Made:
    """Turn a recording into a CSV trace: all of its signals, or some of its columns, over its time.

    Command line:
        feedsim tools convert record.mat --column t=time:s --column qg=Z.x_s:m -o reference.csv

    Raises:
        InputError: a faulty file, a text of another form, a variable that is not there, a value that is not finite.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> made = fs.convert("log.csv", column="time=time:s, Z.x_a=Z.x_a:mm")
    >>> made.content.splitlines()[0]
    b'time [s],Z.x_a [mm]'
    """
    path = Path(file)
    columns = [_column(text) for text in split_names(column)]
    if out is not None:
        check_file(Path(out), [path], ours=lambda there: True)  # an input is refused before it is read
    with TemporaryFolder() as folder:
        recording = trace.read_recording(path)
        written = trace.convert(recording, columns, folder / "converted.csv")
        content = (folder / "converted.csv").read_bytes()
    kind = MadeKind("convert", "table", content_check(content))
    answer = f"{len(written.columns) + 1} columns from {path}"
    made = Made(kind, f"{path.stem}.csv", content, [answer], recording.notes, inputs=[path])
    if out is not None:
        made.save(out, force=force)
    return made


def _column(text: str) -> tuple[str, str, str]:
    """VARIABLE=NAME:UNIT in its parts."""
    variable, equals, rest = text.partition("=")
    name, colon, unit = rest.rpartition(":")
    if not (equals and colon and variable and name and unit):
        raise InputError(f"{spell_argument('column')} {text}: VARIABLE=NAME:UNIT is needed, e.g. qg=Z.x_s:m")
    return variable, name, unit


# --- What files must look like, for editors ---------------------------------------------------------------------------


@job("print the JSON Schema of a kind of file, for editors", needs=())
def schema(
    kind: Annotated[
        FileKind, Argument("", "", choices=("scenario", "machine", "structure", "columns", "tolerances", "study"))
    ] = "scenario",
) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of files that people write.

    Raises InputError: there is no such kind.

    >>> import feedsim as fs
    >>> fs.schema("study")["title"]
    'feedsim study file'
    """
    if kind not in get_args(FileKind):
        raise InputError(f"{spell_argument('kind')} is {kind!r}; allowed: {', '.join(get_args(FileKind))}")
    return json_schema(kind)


# --- Examples that come along: which there are, and copies of them ----------------------------------------------------


@overload
def example() -> list[Example]: ...


@overload
def example(names: str | Iterable[str], to: str | Path | None = None) -> list[Path]: ...


@overload
def example(*, to: str | Path) -> list[Path]: ...


@job("list or copy scenarios, studies and machines to begin with", needs=())
def example(
    names: Annotated[
        str | Iterable[str] | None,
        Argument(
            "NAME",
            "what to copy, with the files that it names; without a name all are listed",
            many=True,
            complete="jobs.examples:names",
        ),
    ] = None,
    to: Annotated[
        str | Path | None, Option("DIR", "folder to copy into (default: the working folder); all, without a name")
    ] = None,
) -> list[Path] | list[Example]:
    """Copy examples into the folder `to`, with all files that they name; returns the files written, or the list.

    Without a name all are listed; with a folder and no name all are copied, to where the documentation has them.
    The machines are synthetic, but for emps and sinumerik_840d, which were measured. Nothing is overwritten.

    >>> import feedsim as fs
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     len(fs.example("xz_circle", folder))
    7
    >>> "z_stop" in [each.name for each in fs.example()]
    True

    Raises:
        InputError: there is no such example.
        OutputError: a file is there with another content, or cannot be written. Nothing is written then.
    """
    if not names and to is None:
        return examples()
    return copy(names or [entry.name for entry in examples()], to or ".")
