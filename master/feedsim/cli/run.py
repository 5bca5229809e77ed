"""feedsim run, validate and ssp: one scenario, or an SSP file, made, checked, or written for other simulators."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import (
    CONTROL,
    FIGURES,
    FMUS,
    QUIET_OPTION,
    UNCERTAIN,
    Command,
    Option,
    arguments,
    out,
    settings,
)
from feedsim.cli.terminal import call, finish, watching
from feedsim.errors import InputError

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
    from feedsim.jobs.run import run

    out: Path = options.out or Path("results") / options.scenario.stem
    if options.trial:
        _check_trial(options.scenario, out)
    with watching(options.quiet, " cycles", shortened=True) as watch:
        result = run(**arguments(run, options) | {"out": out}, watch=watch)
        trial: tuple[str, ...] = ()
        if options.trial:
            from feedsim.jobs.tried import tried

            trial = tried(result, out, fmus=options.fmus, watch=watch).lines
    *answers, last = result.lines
    finish(options.quiet, result.findings, *answers, *trial, f"{last} -> {out}")


def _check_trial(scenario: Path, out: Path) -> None:
    """--try: of a scenario file, with room for the second run and the overlay."""
    from feedsim.files.source import is_ssp
    from feedsim.jobs.tried import check_writable

    if is_ssp(scenario):
        raise InputError(f"--try: {scenario} is an SSP file; values are changed in scenario files")
    check_writable(out)


def validate(options: Namespace) -> None:
    """feedsim validate."""
    from feedsim.jobs.validate import validate

    done = validate(**arguments(validate, options))
    finish(False, done.findings, *done.answers)


def write_ssp(options: Namespace) -> None:
    """feedsim ssp."""
    from feedsim.jobs.write_ssp import write_ssp

    made = call(write_ssp, options)
    finish(False, made.findings, f"{options.out}: {made.answers[0]}")


TRUST = """An FMU is a program, and so is an SSP, which holds some: to run it is to run its libraries with your rights.
The shipped libraries are known by their bytes, wherever they lie. `feedsim run` names every other one on standard
error, with its place in the archive and its SHA-256, before it executes it. `feedsim validate` executes none of them:
it judges what the archives say of themselves, and says what it has not checked. No text in an archive makes feedsim
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
    (*SUBJECT, out("<name of the scenario file>"), FIGURES, PAGE, CONTROL, TRY, UNCERTAIN, QUIET_OPTION),
    epilog=TRUST,
    job="run",
)
VALIDATE = Command(
    "validate", "check a scenario, an SSP or a study, its machine and its motion without running it", validate, SUBJECT,
    epilog=TRUST, job="validate",
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
    job="write_ssp",
)
