"""A directory of results: files and figures, written whole or not at all."""

from __future__ import annotations

import contextlib
import json
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from feedsim.errors import OutputError
from feedsim.report.style import Picture

SUMMARY, REPORT, FIGURES = "summary.json", "report.html", "figures"
# What a report of any kind leaves besides report.html and summary.json, which every one replaces; the next one takes
# away what it does not write itself. Not friction.yaml: scenarios and machine files may name it.
_OWN_FILE = re.compile(
    rf"{FIGURES}/[\w-]+\.(png|svg|gif)|result\.csv|log\.csv|frf(_measured)?\.csv|(residuals|open_loop|plateaus)\.csv"
    r"|(uncompensated|feedforward|compensation)\.csv"
)


def check_place(directory: Path | str, files: Sequence[str], inputs: Sequence[Path] = ()) -> None:
    """Raise OutputError unless ``directory`` can be created, or can be written to where it is there already.

    files: names of the files that may be written besides the figures. inputs: files that are read; none of them may be
    among those, nor among the files of an earlier result that would be removed. Leaves nothing behind. Meant to be
    called before a simulation, whose result would else be lost.
    """
    directory = Path(directory)
    existing = _existing(directory)
    if not existing.is_dir():
        raise OutputError(f"{directory}: cannot be written, {existing} is a file; allowed: a directory")
    for name in (*files, FIGURES):
        if (directory / name).exists() and (directory / name).is_dir() != (name == FIGURES):
            raise OutputError(
                f"{directory / name}: is in the way of a result {'directory' if name == FIGURES else 'file'}"
            )
    for fate, names in (("replaced", files), ("removed", _stale(directory, files))):
        for name in names:
            if any(_same(directory / name, path) for path in inputs):
                raise OutputError(f"{directory / name}: is an input and would be {fate}; take another directory")
    with _as_output_error(directory), tempfile.TemporaryDirectory(prefix=".feedsim-", dir=existing):
        pass


def write_results(
    directory: Path | str,
    files: Sequence[str],
    pictures: Sequence[Picture],
    fill: Callable[[Path, Sequence[str]], None],
) -> tuple[Path, ...]:
    """Write the figures and whatever ``fill`` writes; returns the paths.

    fill: called with an empty directory, in which it makes ``files``, and with the names of all files and figures.
    Everything is made in a temporary directory beside the target and moved when complete; files of an earlier result,
    of whatever kind, are replaced, those that this one has not are removed, and both are put back if moving fails. Only
    friction.yaml of an identification stays: scenarios and machine files may name it. Raises OutputError.
    """
    directory = Path(directory)
    check_place(directory, files)
    with (
        _as_output_error(directory),
        tempfile.TemporaryDirectory(prefix=".feedsim-", dir=_existing(directory)) as scratch,
    ):
        fresh = Path(scratch) / "fresh"
        (fresh / FIGURES).mkdir(parents=True)
        for picture in pictures:
            (fresh / FIGURES / f"{picture.stem}.png").write_bytes(picture.png)
        names = [*(f"{FIGURES}/{picture.stem}.png" for picture in pictures), *files]
        fill(fresh, names)
        _move(fresh, directory, names, _stale(directory, names), Path(scratch) / "kept")
    return tuple(directory / name for name in names)


def write_text(file: Path, text: str) -> None:
    """Write text as UTF-8 with line feeds."""
    file.write_text(text, encoding="utf-8", newline="\n")


def _existing(directory: Path) -> Path:
    """``directory``, or the nearest folder above it that is there already."""
    return next(path for path in (directory.absolute(), *directory.absolute().parents) if path.exists())


def _same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except OSError:
        return False  # one of them is not there


def _stale(directory: Path, names: Sequence[str]) -> list[str]:
    """Figures and curves that the summary of an earlier run in ``directory`` lists and this run does not write."""
    try:
        listed = json.loads((directory / SUMMARY).read_text(encoding="utf-8"))["files"]
        return [
            name for name in listed if _OWN_FILE.fullmatch(name) and name not in names and (directory / name).is_file()
        ]
    except (OSError, ValueError, KeyError, TypeError):
        return []  # no earlier run, or a summary of something else: nothing of it is ours to remove


def _move(fresh: Path, directory: Path, names: Sequence[str], stale: Sequence[str], kept: Path) -> None:
    """Move ``names`` from ``fresh`` into ``directory`` and ``stale`` files away; on failure everything is put back."""
    folders = [path for path in (directory / FIGURES, directory, *directory.absolute().parents) if not path.exists()]
    (directory / FIGURES).mkdir(parents=True, exist_ok=True)
    (kept / FIGURES).mkdir(parents=True)
    done: list[str] = []
    try:
        for name in (*names, *stale):
            done.append(name)
            if (directory / name).exists():
                (directory / name).replace(kept / name)
            if name in names:
                (fresh / name).replace(directory / name)
        with contextlib.suppress(OSError):  # not empty, as a rule
            (directory / FIGURES).rmdir()
    except BaseException:
        for name in done:
            with contextlib.suppress(OSError):
                if (kept / name).exists():
                    (kept / name).replace(directory / name)
                elif name in names:
                    (directory / name).unlink(missing_ok=True)
        for path in folders:
            with contextlib.suppress(OSError):
                path.rmdir()
        raise


@contextlib.contextmanager
def _as_output_error(directory: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(f"{directory}: cannot be written: {error.strerror or error}") from error
