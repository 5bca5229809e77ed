"""Write the results of a run into a directory, whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from feedsim.analysis import Figure, PositioningTask, tasks
from feedsim.report.circle_plots import contour_picture, torque_picture
from feedsim.report.overview_plots import overview_picture
from feedsim.report.page import page
from feedsim.report.partial import PARTIAL, Partial
from feedsim.report.parts import to_json
from feedsim.report.results import REPORT, SUMMARY, check_place, write_results, write_text
from feedsim.report.stop_plots import positioning_picture
from feedsim.report.style import Picture
from feedsim.report.summary import Run, summary
from feedsim.trace import write_csv

RESULT, LOG = "result.csv", "log.csv"
FILES = (RESULT, REPORT, SUMMARY)


def check_writable(directory: Path | str, inputs: Sequence[Path] = ()) -> None:
    """Raise OutputError unless a run's results can be written to ``directory`` without one of ``inputs`` being lost.

    inputs: files that are read. Leaves nothing behind.
    """
    check_place(directory, (*FILES, LOG, PARTIAL), inputs)


def growing(directory: Path | str) -> Partial:
    """What takes a run's rows while it goes on, for :func:`write`."""
    return Partial(directory, RESULT)


def write(
    run: Run, figures: Mapping[str, Figure], directory: Path | str, recorded: Partial | None = None
) -> tuple[Path, ...]:
    """Write result.csv, summary.json, report.html, figures/*.png and log.csv, if there is one; returns their paths.

    figures: as from ``analysis.evaluate``. recorded: the run's rows where they have been written already, in the same
    directory; the file becomes result.csv, or stays as it is where the results cannot be written. Files of an earlier
    run are replaced. Raises OutputError.
    """
    if recorded is not None and not recorded.left:
        recorded = None
    pictures = draw(run, figures)

    def fill(fresh: Path, names: Sequence[str]) -> None:
        if recorded is None:
            write_csv(fresh / RESULT, run.trace)
        if run.log is not None:
            write_csv(fresh / LOG, run.log)
        write_text(fresh / REPORT, page(run, figures, pictures))
        write_text(fresh / SUMMARY, to_json(summary(run, figures, names)))
        if recorded is not None:
            recorded.finished()

    files = FILES if run.log is None else (RESULT, LOG, REPORT, SUMMARY)
    return write_results(directory, files, pictures, fill, {} if recorded is None else {RESULT: recorded.path})


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
    reached = {axis: run.program.reached(axis) for axis in run.program.x_s if axis not in covered}
    moving = [axis for axis, (low, high) in reached.items() if low < high]
    overview = overview_picture(run.trace, moving, signs, "overview")
    return [*pictures, overview] if overview is not None else pictures
