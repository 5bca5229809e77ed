"""The values that the report of a run proposes, tried in a second run that is laid over the first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

from feedsim import cosim
from feedsim.errors import InputError
from feedsim.files.source import is_ssp
from feedsim.jobs.diff import Overlay, diff
from feedsim.jobs.parameters import Archives, Argument, ControlName, FigureKinds, File, Force, Settings, job, out
from feedsim.jobs.run import RunResult, run
from feedsim.jobs.watch import NO_WATCH, Watch
from feedsim.judge import judged
from feedsim.report import run as report
from feedsim.report.changes import change_lines
from feedsim.scenario import load
from feedsim.tune import Proposal, of_run

# Figures whose change is shown, by what stands behind the last dot.
TRIED_FIGURES = ("G", "overshoot", "settling_time")
SHOWN_OF_AXES = ("peak_", "servo_mismatch")


class ProposalsResult(Overlay):
    """A run as it is, and with all proposals that have a value; one run alone where none has.

    Attributes:
        runs: the run as it is, and the one with the proposals.
        proposals: all of them. settings: those with a value, as behind ``--set``.
    """

    def __init__(self, runs: Sequence[RunResult], proposals: Sequence[Proposal]) -> None:
        super().__init__(dict(zip(("as it is", "with the proposals"), runs, strict=False)))
        self.runs, self.proposals = tuple(runs), tuple(proposals)
        self.settings = settings_of(proposals)

    @property
    def findings(self) -> Sequence[str]:
        """Those of the run as it is."""
        return self.runs[0].findings

    @property
    def lines(self) -> list[str]:
        """What the run is, what was changed, and the leading figures before and after."""
        first, *second = self.runs
        if not second:
            return [*first.lines, "nothing to try: no proposal has a value"]
        changed = [
            f"tried: {name} {first.figures[name]} -> {figure}"
            for name, figure in second[0].figures.items()
            if name in first.figures and _leading(name)
        ]
        return [*first.lines, *change_lines(self.proposals), *changed]


def settings_of(proposals: Sequence[Proposal]) -> tuple[str, ...]:
    """Those that have a value, as behind ``--set``."""
    return tuple(proposal.setting for proposal in proposals if proposal.setting)


@job("a run with the values that its report proposes")
def tune_proposals(
    scenario: Annotated[File, Argument("SCENARIO.yaml", "scenario file (docs/scenarios.md)")],
    *,
    set: Settings = None,
    fmus: Archives = None,
    out: Annotated[File | None, out("{scenario}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    control: ControlName = "",
    watch: Watch = NO_WATCH,
) -> ProposalsResult:
    """Run a scenario, and again with all values that the report of that run proposes.

    Writes the run as it is to the folder, the second one beside it to NAME_tried, and both over each other to
    NAME_overlay.

    Command line:
        feedsim example xz_circle
        feedsim tune proposals xz_circle.yaml --set machine.axes.Z.drive.T_sym="2.9 ms"

    Raises:
        InputError: as of :func:`feedsim.run`; an SSP file, whose values cannot be changed.
        SimulationError: a unit failed.
        OutputError: `out`, or a folder beside it, cannot be written.

    >>> import feedsim as fs
    >>> result = fs.tune_proposals("xz_circle.yaml", set={"machine.axes.Z.drive.T_sym": "2.9 ms"})
    >>> len(result.runs), result.settings[0].partition("=")[0]
    (2, 'machine.axes.Z.drive.T_sym')
    """
    if is_ssp(Path(scenario)):
        raise InputError(f"{scenario}: is an SSP file; values are changed in scenario files")
    folders = _folders(out)
    if folders is not None:
        report.check_writable(folders["tried"])
        Overlay.check_place(folders["overlay"])
    first = run(scenario, set=set, fmus=fmus, out=out, figures=figures, force=force, control=control, watch=watch)
    proposals = of_run(first, first.causes, first.figures, searched=True)
    runs = [first]
    if settings := settings_of(proposals):
        plan = first.scenario
        changed = load(plan.file, [*plan.overrides, *settings])
        progress = watch.of(f"{plan.name}, tried")
        archives = None if fmus is None else Path(fmus)
        runs.append(RunResult.of(judged(cosim.run(changed, fmus=archives, progress=progress))))
    result = ProposalsResult(runs, proposals)
    if folders is not None and settings:
        runs[1].save(folders["tried"], figures=figures, force=force, control=control)
        diff(str(out), folders["tried"]).save(folders["overlay"], figures=figures, force=force, control=control)
        result.place = folders["overlay"]
    return result


def _folders(out: File | None) -> Mapping[str, Path] | None:
    """The folders beside that of the first run."""
    if out is None:
        return None
    return {name: Path(out).with_name(f"{Path(out).name}_{name}") for name in ("tried", "overlay")}


def _leading(name: str) -> bool:
    prefix, _, key = name.partition(".")
    return key in TRIED_FIGURES or (key.startswith(SHOWN_OF_AXES) and "." not in key and bool(prefix))
