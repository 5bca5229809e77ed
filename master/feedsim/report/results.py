"""A directory of results: files and figures, written whole or not at all."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from feedsim.files.source import json_file
from feedsim.foundation.errors import InputError, OutputError
from feedsim.foundation.outputs import (
    TemporaryFolder,
    claim_folder,
    defer_signals,
    is_replacement_allowed,
    is_same_file,
)
from feedsim.report.content import Picture, Report
from feedsim.report.page import html
from feedsim.report.provenance import sha256, software, to_json

SUMMARY, REPORT, FIGURES = "summary.json", "report.html", "figures"
SCRATCH = ".feedsim-"  # how the folder begins in which files are made
MOVES_FILE = "moves.json"  # in it: name -> from where it is moved into the directory, null: it is removed
ENVELOPE = 1  # version of what every summary.json has, whatever its kind: write_report()
# What results of feedsim 0.1 have left besides figures: their summaries do not say which files stay.
_OF_0_1 = {
    "result.csv", "log.csv", "frf.csv", "frf_measured.csv", "residuals.csv", "open_loop.csv", "plateaus.csv",
    "uncompensated.csv", "feedforward.csv", "compensation.csv", "replay.csv",
}  # fmt: skip


def check_place(
    directory: Path | str, files: Sequence[str], inputs: Sequence[Path] = (), *, kind: str, own: Sequence[str] = ()
) -> None:
    """Raise OutputError unless ``directory`` can be created, or can be written to where it is there already.

    files: names of the files that may be written besides the figures. inputs: files that are read; none of them may be
    among those, nor among the files of an earlier result that would be removed. kind: of the result; one of another
    kind stays, and so does a file that no earlier result lists (``outputs.replacing`` allows both to be replaced). own:
    names of files that only results of this kind have, listed or not. Leaves nothing behind. Meant to be called before
    a simulation, whose result would else be lost.
    """
    directory = Path(directory)
    with claim_folder(directory), _as_output_error(directory):
        _settle(directory)
        for name in (*files, FIGURES):
            if (directory / name).exists() and (directory / name).is_dir() != (name == FIGURES):
                raise OutputError(
                    f"{directory / name}: is in the way of a result {'directory' if name == FIGURES else 'file'}"
                )
        for fate, names in (("replaced", files), ("removed", _stale(directory, files))):
            for name in names:
                if (directory / name).exists() and any(is_same_file(directory / name, path) for path in inputs):
                    raise OutputError(f"{directory / name}: is an input and would be {fate}; take another directory")
        if not is_replacement_allowed():
            _check_owner(directory, files, kind, own)


def _check_owner(directory: Path, files: Sequence[str], kind: str, own: Sequence[str]) -> None:
    """OutputError where a result of another kind would be replaced, or a file that no result of feedsim lists."""
    before = _summary(directory).get("kind", kind)  # results of feedsim 0.1 do not say
    if before != kind and _listed_files(directory):
        raise OutputError(
            f"{directory}: holds a result of kind {before}, and a result of kind {kind} would replace it; take another "
            "directory, or replace it with --force"
        )
    listed = {*(_listed_files(directory) or ()), *own, *([SUMMARY] if _listed_files(directory) is not None else ())}
    for name in files:
        if name not in listed and os.path.lexists(directory / name) and not (directory / name).is_dir():
            raise OutputError(
                f"{directory / name}: exists already, and no result of feedsim in that folder lists it; take another "
                "directory, or replace it with --force"
            )


def describe_replaced_result(directory: Path, inputs: Sequence[Path], asked: Sequence[str]) -> str:
    """What is lost where a result of other parameters is replaced, in a sentence; "" where it is none.

    inputs: files that are read. asked: what was asked for besides, such as the texts of --set.
    """
    before = _summary(directory)
    try:
        files = {entry["sha256"] for entry in before["inputs"]}
        settings = before.get("settings", {}).items()
        subject: dict[str, Any] = next((before[name] for name in ("scenario", "subject") if name in before), {})
        settings_before = [*subject.get("overrides", ()), *(f"{name}={value}" for name, value in settings)]
    except (KeyError, TypeError, AttributeError):
        return ""  # none, or one whose inputs are not known
    if settings_before == [*asked] and {sha256(path) for path in inputs} <= files:
        return ""
    was = f" ({', '.join(settings_before)})" if settings_before else ""
    return f"{directory}: its result is of other parameters{was} and will be replaced; --out takes another folder"


def write_results(
    directory: Path | str,
    files: Sequence[str],
    pictures: Sequence[Picture],
    fill: Callable[[Path, Sequence[str]], None],
    grown: Mapping[str, Path] | None = None,
    drawn: Sequence[str] = ("png",),
    *,
    kind: str,
    own: Sequence[str] = (),
) -> tuple[Path, ...]:
    """Write the figures and whatever ``fill`` writes; returns the paths.

    fill: called with an empty directory, in which it makes ``files``, and with the names of all files and figures.
    grown: those of ``files`` that are there already, complete behind ``fill``, and where, on the same disk; they are
    moved from there, and back if moving fails. drawn: kinds of files that every picture is drawn as.
    Everything is made in a temporary directory in the target and moved when complete; files of an earlier result, of
    whatever kind, are replaced, those that this one has not are removed, and both are put back if moving fails. What
    the earlier result keeps stays: scenarios and machine files may name it. Raises OutputError, also where another
    process writes to the directory.
    """
    directory = Path(directory)
    with claim_folder(directory), _as_output_error(directory):
        check_place(directory, files, kind=kind, own=own)
        with TemporaryFolder(directory, prefix=SCRATCH) as scratch:
            fresh = scratch / "fresh"
            (fresh / FIGURES).mkdir(parents=True)
            figures = {f"{FIGURES}/{picture.stem}.{kind}": (picture, kind) for picture in pictures for kind in drawn}
            for name, (picture, kind) in figures.items():
                (fresh / name).write_bytes(picture.content(kind))
            names = [*figures, *files]
            fill(fresh, names)
            sources = {name: fresh / name for name in names} | dict(grown or {})
            with defer_signals():
                _move(sources, directory, _stale(directory, names), scratch)
    return tuple(directory / name for name in names)


# What a file of results holds: text, bytes, or a function of the path that makes the file there, or that returns where
# the file is already, complete and on the same disk, to be moved from there.
Content = str | bytes | Callable[[Path], Path | None]


def write_report(
    directory: Path | str,
    report: Report | None,
    details: Mapping[str, Any],
    files: Mapping[str, Content],
    drawn: Sequence[str] = (),
    *,
    kind: str,
    own: Sequence[str] = (),
    keeps: Sequence[str] = (),
) -> tuple[Path, ...]:
    """Write a report of any kind: report.html, summary.json, ``files``, and its pictures as figures/*.

    report: None: ``files`` alone. kind, own: as for :func:`check_place`. details: what summary.json has of this kind;
    around it stands what all have: kind, version, answer, next, figures, warnings, findings, software, files. keeps:
    those of ``files`` that scenarios and machine files may name; they stay when the next result takes the folder.
    drawn: kinds of files that the pictures are drawn as; the page holds what they show in any case. Whole or not at
    all, as :func:`write_results` does it. Returns the paths. Raises OutputError.
    """
    grown: dict[str, Path] = {}

    def fill(fresh: Path, names: Sequence[str]) -> None:
        for name, content in files.items():
            if isinstance(content, str):
                write_text(fresh / name, content)
            elif isinstance(content, bytes):
                (fresh / name).write_bytes(content)
            elif (already := content(fresh / name)) is not None:
                grown[name] = already
        if report is None:
            return
        write_text(fresh / REPORT, html(report, kind, Path(directory)))
        head: dict[str, Any] = {"kind": kind, "version": ENVELOPE, "answer": list(report.answer), "figures": {}}
        if report.next_step is not None and (step := report.next_step.line(Path(directory))):
            head["next"] = {"words": report.next_step.words, "command": step}
        rest = {**_finding_entries(report), "software": software(), "files": list(names), "keeps": list(keeps)}
        write_text(fresh / SUMMARY, to_json({**head, **details, "kind": kind, **rest}))

    names, pictures = ((*files,), ()) if report is None else ((*files, REPORT, SUMMARY), report.pictures)
    return write_results(directory, names, pictures, fill, grown, drawn, kind=kind, own=own)


def _finding_entries(report: Report) -> dict[str, Any]:
    """Entries of summary.json: what there is to say about the result by its severity, and of that the warnings."""
    return {
        "warnings": [finding.text for finding in report.findings if finding.severity != "note"],
        "findings": [asdict(finding) for finding in report.findings],
    }


def discard(directory: Path | str) -> None:
    """Remove the report of an earlier result in ``directory``: report.html, summary.json, and what that lists of ours.

    What the summary of a result does not list stays. Raises OutputError.
    """
    directory = Path(directory)
    with _as_output_error(directory):
        if (listed := _listed_files(directory)) is None:
            return
        for name in (*_stale(directory, ()), *(name for name in (REPORT, SUMMARY) if name in listed)):
            (directory / name).unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # not there, or not empty
            (directory / FIGURES).rmdir()


def write_text(file: Path, text: str) -> None:
    """Write text as UTF-8 with line feeds; names of files that are none are written as escapes."""
    file.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


def _settle(directory: Path) -> None:
    """Bring to its end what a process that has gone was just moving, and remove what else it has left.

    For who has claimed the directory: whatever scratch is there belongs to nobody any more.
    """
    for scratch in directory.glob(f"{SCRATCH}*"):
        try:
            moves = json_file(scratch / MOVES_FILE)
        except InputError:
            moves = {}  # it was still being filled
        for name, source in moves.items():
            if not _is_inside(name) or not _is_inside(source or name):
                continue  # nothing that we have noted
            if source is None:
                (directory / name).unlink(missing_ok=True)
            elif (directory / source).exists():  # else it has been moved
                (directory / name).parent.mkdir(exist_ok=True)
                (directory / source).replace(directory / name)
        shutil.rmtree(scratch, ignore_errors=True)


def _is_inside(name: str) -> bool:
    return not Path(name).is_absolute() and ".." not in Path(name).parts


def _stale(directory: Path, names: Sequence[str]) -> list[str]:
    """Files that the result in ``directory`` lists, does not keep, and that this one does not write."""
    before = _summary(directory)
    keeps = before.get("keeps", ())
    stay = {REPORT, SUMMARY, *names, *(keeps if isinstance(keeps, list) else ())}
    enveloped = "version" in before
    return [
        name
        for name in _listed_files(directory) or ()
        if name not in stay
        and (enveloped or name in _OF_0_1 or name.startswith(f"{FIGURES}/"))
        and _is_inside(name)
        and (directory / name).is_file()
    ]


def _listed_files(directory: Path) -> list[str] | None:
    """What the summary of an earlier run in ``directory`` lists."""
    try:
        return [name for name in _summary(directory)["files"] if isinstance(name, str)]
    except (KeyError, TypeError):
        return None  # no earlier run, or a summary of something else: nothing of it is ours to remove


def _summary(directory: Path) -> dict[str, Any]:
    """The summary of an earlier run in ``directory``; empty where there is none."""
    try:
        result = json_file(directory / SUMMARY)
    except InputError:
        return {}
    return result if isinstance(result, dict) else {}


def _move(sources: Mapping[str, Path], directory: Path, stale: Sequence[str], scratch: Path) -> None:
    """Move files into ``directory``, name -> from where, and ``stale`` ones away; on failure all are put back.

    The summary goes first and comes last: where there is one, all files are of the same result. What is to be moved is
    noted, so that the next process can bring it to its end if this one is killed.
    """
    folders = [directory / FIGURES] if not (directory / FIGURES).exists() else []
    (directory / FIGURES).mkdir(exist_ok=True)
    kept = scratch / "kept"
    (kept / FIGURES).mkdir(parents=True)
    order = sorted(sources, key=SUMMARY.__eq__)
    noted = {name: os.path.relpath(sources[name], directory) for name in order} | dict.fromkeys(stale)
    write_text(scratch / "noted", json.dumps(noted))
    (scratch / "noted").replace(scratch / MOVES_FILE)
    moves: list[tuple[Path, Path]] = []

    def move(path: Path, to: Path) -> None:
        moves.append((path, to))
        path.replace(to)

    def put_away(name: str) -> None:
        if (directory / name).exists():
            move(directory / name, kept / name)

    try:
        if SUMMARY in sources:
            put_away(SUMMARY)
        for name in stale:
            put_away(name)
        for name in order:
            put_away(name)
            move(sources[name], directory / name)
        with contextlib.suppress(OSError):  # not empty, as a rule
            (directory / FIGURES).rmdir()
    except BaseException:
        for path, to in reversed(moves):
            with contextlib.suppress(OSError):
                if not path.exists():  # else it has not been moved
                    to.replace(path)
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
