"""Write the results of a run into a directory, whole or not at all."""

from __future__ import annotations

import contextlib
import json
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from feedsim.analysis import Figure, PositioningTask, tasks
from feedsim.errors import OutputError
from feedsim.report.circle_plots import contour_picture, torque_picture
from feedsim.report.overview_plots import overview_picture
from feedsim.report.page import page
from feedsim.report.stop_plots import positioning_picture
from feedsim.report.style import Picture
from feedsim.report.summary import Run, summary, to_json
from feedsim.trace import write_csv

RESULT, SUMMARY, REPORT, FIGURES = "result.csv", "summary.json", "report.html", "figures"
_FIGURE_FILE = re.compile(rf"{FIGURES}/[\w-]+\.png")


def check_writable(directory: Path | str) -> None:
    """Raise OutputError unless ``directory`` can be created, or can be written to where it is there already.

    Leaves nothing behind. Meant to be called before a simulation, whose result would else be lost.
    """
    directory = Path(directory)
    existing = _existing(directory)
    if not existing.is_dir():
        raise OutputError(f"{directory}: cannot be written, {existing} is a file; allowed: a directory")
    for name in (RESULT, SUMMARY, REPORT, FIGURES):
        if (directory / name).exists() and (directory / name).is_dir() != (name == FIGURES):
            raise OutputError(
                f"{directory / name}: is in the way of a result {'directory' if name == FIGURES else 'file'}"
            )
    with _as_output_error(directory), tempfile.TemporaryDirectory(prefix=".feedsim-", dir=existing):
        pass


def write(run: Run, figures: Mapping[str, Figure], directory: Path | str) -> tuple[Path, ...]:
    """Write result.csv, summary.json, report.html and figures/*.png of ``run``; returns their paths.

    figures: as from ``analysis.evaluate``. Everything is made in a temporary directory beside the target and moved when
    complete; files of an earlier run are replaced, and put back if moving fails. Raises OutputError.
    """
    directory = Path(directory)
    check_writable(directory)
    with (
        _as_output_error(directory),
        tempfile.TemporaryDirectory(prefix=".feedsim-", dir=_existing(directory)) as scratch,
    ):
        fresh = Path(scratch) / "fresh"
        (fresh / FIGURES).mkdir(parents=True)
        write_csv(fresh / RESULT, run.trace)
        pictures = draw(run, figures)
        for picture in pictures:
            (fresh / FIGURES / f"{picture.stem}.png").write_bytes(picture.png)
        names = [*(f"{FIGURES}/{picture.stem}.png" for picture in pictures), RESULT, REPORT, SUMMARY]
        texts = {REPORT: page(run, figures, pictures), SUMMARY: to_json(summary(run, figures, names))}
        for name, text in texts.items():
            (fresh / name).write_text(text, encoding="utf-8", newline="\n")
        _move(fresh, directory, names, _stale(directory, names), Path(scratch) / "kept")
    return tuple(directory / name for name in names)


def draw(run: Run, figures: Mapping[str, Figure]) -> list[Picture]:
    """The figures of a report: those of every evaluation, and an overview of the axes that none of them shows."""
    signs = {name: axis.display_sign for name, axis in run.scenario.machine.axes.items()}
    pictures: list[Picture] = []
    covered: set[str] = set()
    for task in tasks(run.scenario, run.program):
        stem = task.prefix.replace("#", "-")
        own = {
            name.removeprefix(f"{task.prefix}."): f for name, f in figures.items() if name.startswith(f"{task.prefix}.")
        }
        if not own:
            continue
        if isinstance(task, PositioningTask):
            axis = task.approach.axis
            pictures.append(
                positioning_picture(
                    run.trace, task.approach, own, f"positioning-{stem}", band=task.band, torque_sign=signs[axis]
                )
            )
            covered.add(axis)
        else:
            pictures.append(contour_picture(run.trace, task.turn, own, f"contour-{stem}"))
            torques = torque_picture(run.trace, task.turn, signs, f"torque-{stem}")
            pictures += [torques] if torques is not None else []
            covered |= set(task.turn.axes)
    moving = [axis for axis, x in run.program.x_s.items() if x.min() < x.max() and axis not in covered]
    overview = overview_picture(run.trace, moving, signs, "overview")
    return [*pictures, overview] if overview is not None else pictures


def _existing(directory: Path) -> Path:
    """``directory``, or the nearest folder above it that is there already."""
    return next(path for path in (directory.absolute(), *directory.absolute().parents) if path.exists())


def _stale(directory: Path, names: Sequence[str]) -> list[str]:
    """Figures that the summary of an earlier run in ``directory`` lists and this run does not write."""
    try:
        listed = json.loads((directory / SUMMARY).read_text(encoding="utf-8"))["files"]
        return [
            name
            for name in listed
            if _FIGURE_FILE.fullmatch(name) and name not in names and (directory / name).is_file()
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
