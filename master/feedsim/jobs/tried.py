"""Proposals of a run, tried in a second run that is laid over the first."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from feedsim import cosim
from feedsim.jobs.run import RunResult
from feedsim.jobs.show import Overlay, show
from feedsim.jobs.watch import NO_WATCH, Watch
from feedsim.judge import judged
from feedsim.report import run as report
from feedsim.report.changes import change_lines
from feedsim.scenario import load
from feedsim.tune import Proposal, of_run

# Figures whose change is shown, by what stands behind the last dot.
TRIED_FIGURES = ("G", "overshoot", "settling_time")
SHOWN_OF_AXES = ("peak_", "servo_mismatch")


@dataclass(frozen=True, eq=False)
class Tried:
    """What was changed, and what it gave. proposals: all; settings: those with a value, as behind --set."""

    proposals: tuple[Proposal, ...]
    settings: tuple[str, ...]
    lines: tuple[str, ...]


def check_writable(directory: Path) -> None:
    """Raise OutputError unless the second run and the overlay can be written beside the folder of the first."""
    report.check_writable(_second(directory))
    Overlay.check_place(_overlaid(directory))


def tried(run: RunResult, directory: Path, *, fmus: Path | None = None, watch: Watch = NO_WATCH) -> Tried:
    """Run again with all proposals that have a value; write FOLDER_tried and the overlay FOLDER_overlay.

    run: the first one, which was written to `directory`. Raises as :func:`feedsim.cosim.run`, and OutputError.
    """
    proposals = tuple(of_run(run, run.causes, searched=True))
    settings = tuple(proposal.setting for proposal in proposals if proposal.setting)
    if not settings:
        return Tried(proposals, (), ("nothing to try: no proposal has a value",))
    scenario = run.scenario
    changed = load(scenario.file, [*scenario.overrides, *settings])
    again = RunResult.of(judged(cosim.run(changed, fmus=fmus, progress=watch.of(f"{scenario.name}, tried"))))
    again.save(_second(directory))
    show(directory, _second(directory)).save(_overlaid(directory))
    changed_figures = [
        f"tried: {name} {run.figures[name]} -> {figure}"
        for name, figure in again.figures.items()
        if name in run.figures and _leading(name)
    ]
    return Tried(
        proposals, settings, (*change_lines(proposals), *changed_figures, f"-> {_overlaid(directory) / 'report.html'}")
    )


def _leading(name: str) -> bool:
    prefix, _, key = name.partition(".")
    return key in TRIED_FIGURES or (key.startswith(SHOWN_OF_AXES) and "." not in key and bool(prefix))


def _second(directory: Path) -> Path:
    return directory.with_name(f"{directory.name}_tried")


def _overlaid(directory: Path) -> Path:
    return directory.with_name(f"{directory.name}_overlay")
