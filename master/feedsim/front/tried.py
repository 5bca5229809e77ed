"""Proposals of a run, tried in a second run that is laid over the first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from feedsim import analysis, cosim
from feedsim.analysis import Diagnosis, Figure
from feedsim.cosim import Run
from feedsim.cosim.loop import Progress
from feedsim.front import overlay
from feedsim.report import run as report
from feedsim.report import show
from feedsim.report.changes import change_lines
from feedsim.scenario import load
from feedsim.tune import Proposal, of_run

# Figures whose change is told, by what stands behind the last dot.
TOLD = ("G", "overshoot", "settling_time")
TOLD_OF_AXES = ("peak_", "servo_mismatch")


@dataclass(frozen=True, eq=False)
class Tried:
    """What was changed, and what it gave. proposals: all; settings: those with a value, as behind --set."""

    proposals: tuple[Proposal, ...]
    settings: tuple[str, ...]
    lines: tuple[str, ...]


def check_writable(directory: Path) -> None:
    """Raise OutputError unless the second run and the overlay can be written beside the folder of the first."""
    report.check_writable(_second(directory))
    show.check_writable(_overlaid(directory))


def tried(
    run: Run, figures: Mapping[str, Figure], causes: Mapping[str, Diagnosis], directory: Path, *,
    fmus: Path | None = None, progress: Progress | None = None,
) -> Tried:  # fmt: skip
    """Run again with all proposals that have a value; write FOLDER_tried and the overlay FOLDER_overlay.

    run, figures, causes: of the first run, which was written to `directory`. Raises as :func:`feedsim.cosim.run`, and
    OutputError.
    """
    proposals = tuple(of_run(run, causes, searched=True))
    settings = tuple(each.setting for each in proposals if each.setting)
    if not settings:
        return Tried(proposals, (), ("nothing to try: no proposal has a value",))
    scenario = run.scenario
    again = cosim.run(load(scenario.file, [*scenario.overrides, *settings]), fmus=fmus, progress=progress)
    after = analysis.evaluate(again)
    report.write(again, after, _second(directory), causes=analysis.diagnoses(again))
    overlay.show(directory, _second(directory)).save(_overlaid(directory))
    told = [
        f"tried: {name} {figures[name]} -> {figure}"
        for name, figure in after.items()
        if name in figures and _leading(name)
    ]
    return Tried(proposals, settings, (*change_lines(proposals), *told, f"-> {_overlaid(directory) / 'report.html'}"))


def _leading(name: str) -> bool:
    prefix, _, key = name.partition(".")
    return key in TOLD or (key.startswith(TOLD_OF_AXES) and "." not in key and bool(prefix))


def _second(directory: Path) -> Path:
    return directory.with_name(f"{directory.name}_tried")


def _overlaid(directory: Path) -> Path:
    return directory.with_name(f"{directory.name}_overlay")
