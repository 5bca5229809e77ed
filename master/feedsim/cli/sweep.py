"""feedsim sweep: the runs of a study, into one table and a report."""

from __future__ import annotations

import shlex
from argparse import Namespace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from feedsim.cli.options import FIGURES, FMUS, QUIET_OPTION, Command, Option, arguments, out, settings
from feedsim.cli.terminal import announce, finish, warn, watching

if TYPE_CHECKING:
    from collections.abc import Callable

    from feedsim.scenario.study import Study
    from feedsim.sweep import Design

DESCRIPTION = """Make the runs of a study (docs/sweeps.md): a scenario of which parameters are varied over a grid, a
Latin hypercube or a Sobol sequence. Writes table.csv or table.parquet with a row per run, study.json with what it comes
from, and report.html. Runs that fail are rows with their message. A study that was interrupted or killed goes on where
it was when the same command is given again."""
EPILOG = """exit codes:
  0 done, also where some runs failed    2 bad input or usage    3 all runs failed, or all workers were lost
  4 results cannot be written    130 interrupted (143, 129: by SIGTERM, SIGHUP); the same command continues

examples:
  feedsim example friction_wear z_stop
  feedsim sweep studies/friction_wear.yaml
  feedsim sweep studies/z_stop.yaml --runs 20 --out results/try --dry-run
  feedsim sweep studies/z_stop.yaml --set "machine.axes.Z.friction.W=0 rad" --format parquet
  feedsim sweep studies/friction_wear.yaml --scheduler tcp://node1:8786
  feedsim sweep studies/z_stop.yaml --row 17
"""


def sweep(options: Namespace) -> int:
    """feedsim sweep."""
    if options.row is not None or options.dry_run:
        return _described(options)
    from feedsim.jobs.sweep import sweep

    out: Path = options.out or Path("results") / options.study.stem
    begun = perf_counter()
    with watching(options.quiet, " runs") as watch:
        try:
            result = sweep(**arguments(sweep, options) | {"out": out}, watch=watch)
        except KeyboardInterrupt:
            done = (
                f"{watch.done} of {watch.total} runs are done and kept in" if watch.total else "what is done is kept in"
            )
            watch.announce(f"interrupted; {done} {out}; the same command continues")
            return 130
    finish(
        options.quiet, result.findings, *(f"{line}; {perf_counter() - begun:.3g} s -> {out}" for line in result.lines)
    )
    return 0


def _described(options: Namespace) -> int:
    """What a study would do, or the command of one of its runs; nothing is run."""
    from feedsim.scenario.study import load_study
    from feedsim.sweep import design

    study = load_study(options.study, options.set, runs=options.runs)
    warn(study.warnings)
    planned = design(study)
    if options.row is not None:
        print(_command(study, planned, options.row, options.fmus))
        return 0
    announce(study.base.scenario.machine, options.fmus, coupling=study.base.scenario.coupling)
    return _dry_run(study, planned, options)


def _command(study: Study, planned: Design, row: int, fmus: Path | None) -> str:
    """The command that makes one run of a study: the same figures, bit for bit."""
    from feedsim.errors import InputError

    if not 0 <= row < planned.runs:
        raise InputError(f"--row {row} is outside the allowed range: from 0 to {planned.runs - 1}")
    words = ["feedsim", "run", str(study.scenario)]
    words += ["--fmus", str(fmus)] if fmus is not None else []
    for option in (*study.settings, *study.overrides, *planned.options(row)):
        words += ["--set", option]
    return shlex.join([*words, "--out", str(Path("results") / f"{study.file.stem}_{row}")])


def _dry_run(study: Study, planned: Design, options: Namespace) -> int:
    """What the study is, and how long it would take by the durations of some runs."""
    from feedsim.sweep.table import chosen
    from feedsim.sweep.trial import trial

    print(f"{study.name}: {planned.runs} runs ({study.sampling.method}) of {study.scenario}")
    for i, parameter in enumerate(planned.parameters):
        column = planned.values[:, i]
        if parameter.worded:
            values = ", ".join(choice.label for choice in parameter.choices)
        else:
            values = f"{column.min():.6g} to {column.max():.6g} {parameter.unit}".removesuffix(" 1")
        times = "factor " if parameter.factor else ""
        print(f"  {parameter.name}: {times}{values} ({', '.join(parameter.keys)})")
    result = trial(study, planned, options.fmus)
    warn(f"run {run} fails: {why}" for run, why in result.failed.items())
    names = ", ".join(chosen(result.figures, study.figures))
    print(f"  figures: {names}")
    if result.failed:
        print(f"  {len(result.failed)} of the {result.tried} runs tried fail")
    least, most = result.seconds
    which = f"run{'s'[: len(result.runs) != 1]} {', '.join(map(str, result.runs))}"
    print(
        f"  {which} took {_range(least, most, '{:.2g} s'.format)}; all together about "
        f"{_range(least * planned.runs, most * planned.runs, _duration)} on one core"
    )
    return 0


def _range(least: float, most: float, shown: Callable[[float], str]) -> str:
    low, high = shown(least), shown(most)
    return low if low == high else f"{low} to {high}"


def _duration(seconds: float) -> str:
    for unit, size in (("h", 3600), ("min", 60)):
        if seconds >= 2 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"


COMMAND = Command(
    "sweep",
    "make the many runs of a study; write a table, a report and sensitivities",
    sweep,
    (
        Option("study", "STUDY.yaml", "study file (docs/sweeps.md)", type=Path),
        out("<name of the study file>"), FIGURES,
        Option("--workers", "N", "processes (default: the cores; 0: this one alone)", type=int),
        Option("--scheduler", "ADDRESS",
               "make the runs on the Dask cluster with this scheduler, tcp://host:8786"),
        Option("--runs", "N", "in place of the study's sampling.runs", type=int),
        Option("--format", "", "of the table (default: csv)", choices=("csv", "parquet"), default="csv"),
        Option("--restart", "", "begin anew; discards the runs that DIR has"),
        Option("--dry-run", "", "say what would be done and how long it takes"),
        Option("--row", "RUN", "print the command that makes this one run by itself", type=int),
        QUIET_OPTION, FMUS, settings(),
    ),
    DESCRIPTION,
    EPILOG,
    needs=("sweep",),
    job="sweep",
)  # fmt: skip
