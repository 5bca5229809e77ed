"""One scenario, run, with its figures, causes and pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from feedsim import analysis, scenario
from feedsim.analysis.proposals import Proposal, of_run
from feedsim.files.source import is_ssp, is_study
from feedsim.files.trace import Array
from feedsim.foundation.arguments import Changes, settings, spell_argument
from feedsim.foundation.errors import Finding, InputError
from feedsim.jobs.parameters import (
    NO_WATCH,
    Archives,
    Argument,
    ControlName,
    Draws,
    FigureKinds,
    File,
    Force,
    MachineChoice,
    Option,
    Settings,
    Watch,
    job,
    output_option,
)
from feedsim.jobs.result import Kind, Result, claim_result_folder
from feedsim.report import run as report
from feedsim.report.page import Partial
from feedsim.scenario import Scenario
from feedsim.simulation import cosim, nc
from feedsim.simulation.judge import JudgedRun, judge_run
from feedsim.simulation.nc import Program

if TYPE_CHECKING:
    import pandas

    from feedsim.design.uncertainty import Cloud, Uncertainty


# --- What a job runs: a scenario file, an SSP file with archives of its own, or a scenario that is loaded -------------


def load(file: File, set: Changes = None) -> Scenario:
    """A scenario file, checked, with changes such as ``{"machine.axes.Z.friction.F_C": "1.8 N.m"}``. Raises InputError.

    >>> import feedsim as fs
    >>> fs.load("xz_circle.yaml", {"motions.0.radius": "20 mm"}).motions[0].radius
    0.02
    """
    return scenario.load(file, settings(set))


def on_machine(machine: File | None, changes: Changes) -> list[str]:
    """Changes with the machine ahead that is chosen for a scenario or an NC program."""
    return [*([f"machine={machine}"] if machine is not None else []), *settings(changes)]


@dataclass(frozen=True, eq=False)
class OpenedRun:
    """A scenario with its planned motions, ready to be run.

    fmus: folder of the archives; None: those that come along. warnings: what makes of a run's warnings all that is to
    be said: what the archives' own are called in an SSP file, and what that lacks. named: makes a sentence on archives
    speak of the file. changes: as texts.
    """

    plan: Scenario
    program: Program
    fmus: Path | None
    changes: list[str]
    warnings: Callable[[Iterable[Finding]], tuple[Finding, ...]] = tuple
    named: Callable[[str], str] = str


@contextmanager
def open_run(given: File | Scenario, changes: Changes = None, fmus: File | None = None) -> Iterator[OpenedRun]:
    """Read and plan what is given; the archives of an SSP file are there as long as the block lasts.

    Raises InputError: a faulty file, a study, changes of a scenario that is loaded, archives beside those of an SSP.
    """
    texts = settings(changes)
    archives = None if fmus is None else Path(fmus)
    if isinstance(given, Scenario):
        if texts:
            raise InputError(
                f"{spell_argument('set')}: changes are for a file; a scenario that is loaded has its own (feedsim.load)"
            )
        yield OpenedRun(given, nc.plan(given), archives, texts)
        return
    file = Path(given)
    if not is_ssp(file):
        if is_study(file):
            raise InputError(f"{file}: is a study of many runs: feedsim sweep {file}")
        plan = scenario.load(file, texts)
        yield OpenedRun(plan, nc.plan(plan), archives, texts)
        return
    if archives is not None:
        raise InputError(f"{spell_argument('fmus')} {fmus}: {file} has its own archives; leave the option out")
    from feedsim.simulation import ssp  # not for runs of scenario files

    with ssp.open_system(file, texts) as result:
        yield OpenedRun(result.scenario, result.program, result.fmus, texts, result.all_findings, result.named)


# --- One scenario, run, with its figures, causes and pictures ---------------------------------------------------------


KIND = Kind("run", report.FILES, own=lambda folder: (report.PARTIAL,))


@dataclass(frozen=True, repr=False)
class EvaluatedRun(JudgedRun):
    """What a run leaves behind, with its figures and why they are so: computed when they are first asked for.

    page: the machine as a page that computes, where the job was asked for it. uncertainty: intervals of the figures by
    draws of identified values, where it was asked for them.
    """

    page: str = ""
    uncertainty: Uncertainty | None = None

    @classmethod
    def of(cls, run: JudgedRun, page: str = "", uncertainty: Uncertainty | None = None) -> EvaluatedRun:
        """A run, as it is."""
        judged_run = {field.name: getattr(run, field.name) for field in fields(JudgedRun)}
        return cls(**judged_run, page=page, uncertainty=uncertainty)

    @cached_property
    def figures(self) -> analysis.FigureTable:
        """Name -> figure, such as "XZ.G", as the scenario's `evaluate` asks for them."""
        figures = analysis.FigureTable(analysis.evaluate(self, self._tasks))
        return figures if self.uncertainty is None else figures.with_intervals(self.uncertainty.figures)

    @cached_property
    def causes(self) -> Mapping[str, analysis.Diagnosis]:
        """Prefix of a circle's figures -> why it is not round."""
        return analysis.diagnoses(self, self._tasks)

    @cached_property
    def changes(self) -> Sequence[Proposal]:
        """What to change, from what to what, the first one first; none of a run that is wrong."""
        return of_run(self, self.causes, self.figures)

    @cached_property
    def _tasks(self) -> Sequence[analysis.Task]:
        return analysis.tasks(self.scenario, self.program)

    @property
    def time(self) -> Array:
        """Instants [s] of the recorded signals."""
        return self.trace.time

    def __getitem__(self, name: str) -> Array:
        """A recorded signal in SI units, such as ``result["Z.x_a"]``."""
        return self.trace[name]

    def to_pandas(self) -> pandas.DataFrame:
        """All recorded signals over time [s]; their units are in ``.attrs["units"]``. Needs the package pandas."""
        return self.trace.to_pandas()


def result_of(run: EvaluatedRun, recorded: Partial | None = None) -> Result[EvaluatedRun]:
    """A run: what circles, stops and positioning cycles are, why, and what to do.

    recorded: its rows, where they are in the folder already that it is written to.
    """
    return Result(
        KIND,
        run,
        lambda: report.page_of(
            run, run.figures, run.causes, run.changes, page=bool(run.page), uncertainty=run.uncertainty
        ),
        figures=lambda: run.figures,
        details=lambda: report.details(run, run.figures, run.causes, run.changes, run.uncertainty),
        files=partial(report.files_of, run, run.page, recorded, run.uncertainty),
        inputs=report.input_paths(run.scenario),
        rows=lambda: [f"{run.scenario.name}: {report.summary_line(run, run.figures)}"],
    )


@job("run a scenario or an SSP file; figures, causes, report")
def run(
    scenario: Annotated[
        File | Scenario,
        Argument("SCENARIO", "scenario file (docs/scenarios.md), NC program (docs/programs.md), or SSP (docs/ssp.md)"),
    ],
    *,
    machine: MachineChoice = None,
    set: Settings = None,
    page: Annotated[
        bool, Option("", "leave the machine as a page that computes beside the report, which links it (docs/page.md)")
    ] = False,
    friction_share: Annotated[
        bool,
        Option(
            "",
            "of NC programs: a second run nearly without friction, for its share of the deviation (default: yes)",
        ),
    ] = True,
    uncertain: Draws = 0,
    fmus: Archives = None,
    out: Annotated[File | None, output_option("{scenario}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    control: ControlName = "",
    watch: Watch = NO_WATCH,
) -> Result[EvaluatedRun]:
    """Run a scenario.

    An FMU is a program, and so is an SSP, which holds some: to run it is to run its libraries with your rights.
    Libraries other than the shipped ones are named on standard error, with their place and SHA-256, before they are
    executed. No text in an archive makes feedsim read a file outside of it.

    Raises:
        InputError: a faulty file, a motion that violates a limit, an evaluation that cannot be made, no identified
            values to draw.
        SimulationError: a unit failed; where `out` is given the rows up to there are kept.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> stiff = fs.run("z_positioning.yaml", set={"machine.axes.Z.drive.K_v": "5 (m/min)/mm"})
    >>> stiff.figures["Z.settling_time"].unit
    'ms'
    """
    with open_run(scenario, on_machine(machine, set), fmus) as subject:
        analysis.check(subject.plan, subject.program)  # an evaluation that cannot be made is refused before the run
        if report.in_workbook(subject.plan):
            report.workbook_needed()
        cloud = None
        if uncertain:
            from feedsim.design.uncertainty import check_count, cloud_of

            check_count(uncertain)
            cloud = cloud_of(subject.plan.machine)
        if page:
            from feedsim.report.live_page.content import content

            content(subject.plan, subject.program, fmus=subject.fmus)  # and so is a page
        inputs = report.input_paths(subject.plan)
        with claim_result_folder(out, KIND, watch, inputs, subject.changes, force=force):
            recorded = None if out is None else report.growing_result(out)
            for sentence in cosim.describe_programs(subject.plan.machine, subject.fmus, subject.plan.coupling):
                watch.announce(subject.named(sentence))
            if out is None or recorded is None:
                done = _run(subject, None, page, friction_share, watch)
                return result_of(_with_draws(done, subject, cloud, uncertain, watch))
            with _announce_partial_rows(recorded, watch):
                done = _run(subject, recorded, page, friction_share, watch)
                result = result_of(_with_draws(done, subject, cloud, uncertain, watch), recorded)
                result.save(out, figures=figures, force=force, control=control)
    return result


def _run(subject: OpenedRun, recorded: Partial | None, page: bool, friction_share: bool, watch: Watch) -> EvaluatedRun:
    raw = cosim.run(
        subject.plan,
        program=subject.program,
        fmus=subject.fmus,
        progress=watch.of(subject.plan.name),
        scratch=recorded.scratch if recorded is not None else None,
        sink=recorded,
    )
    if recorded is not None:
        recorded.catch_up()  # what follows may work in processes, which no thread may be beside
    if friction_share and analysis.evaluates_contours(subject.plan, subject.program):
        raw = analysis.with_frictionless(raw, subject.fmus, watch.of(f"{subject.plan.name} nearly without friction"))
    if analysis.evaluates_stops(subject.plan, subject.program):
        raw = analysis.with_clamped(raw, subject.fmus, watch.of(f"{subject.plan.name} on mounts that hold still"))
    done = judge_run(raw)
    done = replace(done, warnings=subject.warnings(done.warnings))
    if not page:
        return EvaluatedRun.of(done)
    from feedsim.report.live_page.html import html

    return EvaluatedRun.of(done, html(done, fmus=subject.fmus))


def _with_draws(
    result: EvaluatedRun, subject: OpenedRun, cloud: Cloud | None, count: int, watch: Watch
) -> EvaluatedRun:
    """The run with what identification leaves open, where that is asked for."""
    if cloud is None:
        return result
    from feedsim.design.uncertainty import of_run as uncertainty_of_run

    return replace(
        result, uncertainty=uncertainty_of_run(result, cloud, count, fmus=subject.fmus, progress=watch.progress)
    )


@contextmanager
def _announce_partial_rows(recorded: Partial, watch: Watch) -> Iterator[None]:
    """Say where the rows are of a run that does not come to its end."""
    try:
        with recorded:
            yield
    except BaseException:
        if recorded.has_rows:
            watch.announce(f"the rows up to {recorded.time:.9g} s are kept in {recorded.path}")
        raise
