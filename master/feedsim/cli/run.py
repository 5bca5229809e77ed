"""feedsim run, validate and ssp: one scenario, or an SSP file, made, checked, or written for other simulators."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.cli.options import CONTROL, FIGURES, FMUS, QUIET, Command, Option, out, settings
from feedsim.cli.terminal import announce, finish, progress_bar, results_in, warn
from feedsim.errors import InputError, OutputError
from feedsim.outputs import archive_with, check_file

if TYPE_CHECKING:
    from feedsim.analysis import Diagnosis, Figure
    from feedsim.cosim import Run
    from feedsim.nc import Program
    from feedsim.report.partial import Partial
    from feedsim.scenario import Scenario
    from feedsim.ssp import Exported

    # Warnings of a run -> all that is to be said: what the archives' own are called in an SSP file, and what it lacks.
    Wording = Callable[[Iterable[str]], tuple[str, ...]]

SSP_TEXT = """Write a scenario as one SSP file (System Structure and Parameterization 1.0): the plant packed with the
machine, a controller and a friction unit per axis with their parameters, the setpoints of the motion in a unit that
plays them, and the wiring; with --one, the machine as one unit with the motion inside. Other simulators run it without
anything of feedsim (docs/ssp.md); feedsim run FILE.ssp runs it here."""
SSP_EXAMPLES = """examples:
  feedsim example xz_circle z_positioning
  feedsim ssp xz_circle.yaml --out xz_circle.ssp
  feedsim ssp xz_circle.yaml --one --out one.ssp
  feedsim ssp z_positioning.yaml --set "machine.axes.Z.friction.W=0 rad" --out lugre.ssp
"""


def run(options: Namespace) -> None:
    """feedsim run."""
    from feedsim import analysis, cosim
    from feedsim.page.content import content
    from feedsim.page.html import html
    from feedsim.report import run as report

    directory: Path = options.out or Path("results") / options.scenario.stem
    with _subject(options) as (plan, program, fmus, worded, named):
        analysis.check(plan, program)  # an evaluation that cannot be made should not be found out after the run
        if options.page:
            content(plan, program, fmus=fmus)  # nor a page
        _check_trial(options, directory)
        with (
            results_in(directory, report.check_writable, report.input_paths(plan), options.overrides),
            _rows_kept(report.growing(directory)) as recorded,
        ):
            announce(plan.machine, fmus, named, plan.coupling)
            with progress_bar(options.quiet, " cycles", shortened=True) as progress:
                result = cosim.run(
                    plan, program=program, fmus=fmus, progress=progress.of(plan.name), scratch=recorded.scratch,
                    sink=recorded,
                )  # fmt: skip
            result = replace(result, warnings=worded(result.warnings))
            figures = analysis.evaluate(result)
            causes = analysis.diagnoses(result)
            page = html(result, fmus=fmus) if options.page else ""
            report.write(result, figures, directory, recorded, causes, drawn=options.figures, page=page)
    warnings = (*result.warnings, *analysis.doubts(figures, causes))
    trial = _trial(options, result, figures, causes, directory)
    finish(
        options.quiet,
        warnings,
        *report.answers(result, figures, causes),
        *trial,
        f"{plan.name}: {report.summary_line(result, figures)} -> {directory}",
    )


def _check_trial(options: Namespace, directory: Path) -> None:
    """--try: of a scenario file, with room for the second run and the overlay."""
    from feedsim.files.source import is_ssp
    from feedsim.front import tried

    if options.trial:
        if is_ssp(options.scenario):
            raise InputError(f"--try: {options.scenario} is an SSP file; values are changed in scenario files")
        tried.check_writable(directory)


def _trial(
    options: Namespace, result: Run, figures: Mapping[str, Figure], causes: Mapping[str, Diagnosis], directory: Path
) -> tuple[str, ...]:
    """What --try says."""
    from feedsim.front import tried

    if not options.trial:
        return ()
    with progress_bar(options.quiet, " cycles", shortened=True) as progress:
        named = progress.of(f"{result.scenario.name}, tried")
        return tried.tried(result, figures, causes, directory, fmus=options.fmus, progress=named).lines


@contextmanager
def _rows_kept(recorded: Partial) -> Iterator[Partial]:
    """Say where the rows are of a run that does not come to its end."""
    try:
        with recorded:
            yield recorded
    except BaseException:
        if recorded.left:
            print(f"feedsim: the rows up to {recorded.time:.9g} s are kept in {recorded.path}", file=sys.stderr)
        raise


def validate(options: Namespace) -> None:
    """feedsim validate."""
    from feedsim import analysis, cosim
    from feedsim.cli import sweep
    from feedsim.files.source import is_study

    if is_study(options.scenario):
        sweep.validate(options)
        return
    with _subject(options) as (plan, program, fmus, worded, _):
        analysis.check(plan, program)
        warnings = worded(cosim.check(plan, program, fmus=fmus))
    motions = f"{len(plan.motions)} motion{'s'[: len(plan.motions) != 1]}"
    apart = (
        " as far as no other maker's program has a say" if any(": not checked: " in each for each in warnings) else ""
    )
    finish(
        False, warnings, f"{options.scenario}: valid{apart}; {motions}, {program.time[-1]:.4g} s on {plan.machine.name}"
    )


def write_ssp(options: Namespace) -> None:
    """feedsim ssp."""
    from feedsim import scenario, ssp
    from feedsim.files.source import is_ssp
    from feedsim.report.provenance import input_paths
    from feedsim.ssp.archive import STRUCTURE as SSD

    if not is_ssp(options.out):
        raise InputError(f"--out {options.out}: an SSP file ends in .ssp; simulators tell it by that")
    if is_ssp(options.scenario):
        raise InputError(f"{options.scenario}: is an SSP file already; a scenario is expected")
    if not options.out.absolute().parent.is_dir():
        raise OutputError(f"{options.out} cannot be written: no such folder: {options.out.parent}")
    plan = scenario.load(options.scenario, [*options.overrides, *(["coupling.units=one"] if options.one else [])])
    check_file(
        options.out, [options.scenario, *input_paths(plan)], what="SSP file",
        ours=archive_with(SSD, b'generationTool="feedsim'),
    )  # fmt: skip
    done = ssp.export(plan, options.out, fmus=options.fmus)
    warn(done.warnings)
    print(
        f"{done.path}: {done.size / 1024:.0f} KiB, {_inside(done, plan.machine.cycles.T_c)}; "
        f"runs on {', '.join(done.platforms) or 'no platform'}"
    )


def _inside(done: Exported, T_c: float) -> str:
    if len(done.instances) == 1:
        return f"one instance, {done.duration:.4g} s at any step; parameters in its archive"
    return (
        f"{len(done.instances)} instances, {done.duration:.4g} s at {T_c * 1e6:.6g} us; parameters in resources/*.ssv"
    )


@contextmanager
def _subject(options: Namespace) -> Iterator[tuple[Scenario, Program, Path | None, Wording, Callable[[str], str]]]:
    """What ``run`` and ``validate`` are to look at: a scenario file, or an SSP, whose archives are its own.

    Scenario, program, folder of archives, what makes a run's warnings all that is to be said, and what makes a sentence
    speak of the file.
    """
    from feedsim import nc, scenario
    from feedsim.files.source import is_ssp, is_study

    if not is_ssp(options.scenario):
        if is_study(options.scenario):
            raise InputError(f"{options.scenario}: is a study of many runs: feedsim sweep {options.scenario}")
        loaded = scenario.load(options.scenario, options.overrides)
        yield loaded, nc.plan(loaded), options.fmus, tuple, str
        return
    if options.fmus is not None:
        raise InputError(f"--fmus {options.fmus}: {options.scenario} has its own archives; leave the option out")
    from feedsim import ssp  # not for runs of scenario files

    with ssp.opened(options.scenario, options.overrides) as found:
        yield found.scenario, found.program, found.fmus, found.told, found.named


TRUST = """An FMU is a program, and so is an SSP, which holds some: to run it is to run its libraries with your rights.
The shipped libraries are known by their bytes, wherever they lie. `feedsim run` names every other one on standard
error, with its place in the archive and its SHA-256, before it executes it. `feedsim validate` executes none of them:
it judges what the archives say of themselves, and tells what it has not checked. No text in an archive makes feedsim
read a file outside of it."""

PAGE = Option(
    "--page", "", "leave the machine as a page that computes beside the report, which links it (docs/page.md)"
)
TRY = Option(
    "--try", "", "run again with the values that the report proposes, and lay both runs over each other",
    dest="trial", action="store_true",
)  # fmt: skip
SUBJECT = (
    FMUS,
    Option("scenario", "SCENARIO", "scenario file (docs/scenarios.md), or SSP (docs/ssp.md)", type=Path),
    settings(),
)
RUN = Command(
    "run",
    "run a scenario or an SSP; write result.csv, summary.json, report.html and figures",
    run,
    (*SUBJECT, out("<name of the scenario file>"), FIGURES, PAGE, CONTROL, TRY, QUIET),
    epilog=TRUST,
)
VALIDATE = Command(
    "validate", "check a scenario, an SSP or a study, its machine and its motion without running it", validate, SUBJECT,
    epilog=TRUST,
)  # fmt: skip
SSP = Command(
    "ssp",
    "write a scenario as an SSP file, which other simulators run",
    write_ssp,
    (
        Option("scenario", "SCENARIO.yaml", "scenario file (docs/scenarios.md)", type=Path),
        Option("--out", "FILE.ssp", "the SSP file to write", type=Path, required=True),
        Option(
            "--one",
            "",
            "one component, the machine as one unit with its motion inside, for any step size; as "
            "--set coupling.units=one",
        ),
        FMUS,
        settings(),
    ),
    description=SSP_TEXT,
    epilog=SSP_EXAMPLES,
)
