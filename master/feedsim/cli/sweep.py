"""feedsim sweep: the runs of a study, into one table and a report."""

from __future__ import annotations

import argparse
import shlex
import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from feedsim.cli.options import add_fmus, add_overrides

if TYPE_CHECKING:
    from collections.abc import Callable

    from feedsim.scenario import Study
    from feedsim.sweep import Design
    from feedsim.sweep.study import Progress

DESCRIPTION = """Make the runs of a study (docs/sweeps.md): a scenario of which parameters are varied over a grid, a
Latin hypercube or a Sobol sequence. Writes table.csv or table.parquet with a row per run, study.json with what it comes
from, and report.html. Runs that fail are rows with their message. A study that was interrupted or killed goes on where
it was when the same command is given again."""
EPILOG = """exit codes:
  0 done, also where some runs failed    2 bad input or usage    3 all runs failed, or all workers were lost
  4 results cannot be written    130 interrupted (143, 129: by SIGTERM, SIGHUP); the same command continues

examples:
  feedsim sweep scenarios/studies/friction_wear.yaml
  feedsim sweep scenarios/studies/z_stop.yaml --runs 20 --out results/try --dry-run
  feedsim sweep scenarios/studies/z_stop.yaml --set "machine.axes.Z.friction.W=0 rad" --format parquet
  feedsim sweep scenarios/studies/friction_wear.yaml --scheduler tcp://node1:8786
  feedsim sweep scenarios/studies/z_stop.yaml --row 17
"""


def add_command(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``sweep`` to the commands."""
    command = subparsers.add_parser(
        "sweep",
        help="make the many runs of a study; write a table, a report and sensitivities",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("study", type=Path, metavar="STUDY.yaml", help="study file (docs/sweeps.md)")
    command.add_argument(
        "--out", type=_directory, metavar="DIR", help="where the results go (default: results/<name of the study file>)"
    )
    command.add_argument("--workers", type=int, metavar="N", help="processes (default: the cores; 0: this one alone)")
    command.add_argument(
        "--scheduler", metavar="ADDRESS", help="make the runs on the Dask cluster with this scheduler, tcp://host:8786"
    )
    command.add_argument("--runs", type=int, metavar="N", help="in place of the study's sampling.runs")
    command.add_argument("--format", choices=("csv", "parquet"), default="csv", help="of the table (default: csv)")
    command.add_argument("--restart", action="store_true", help="begin anew; discards the runs that DIR has")
    command.add_argument("--dry-run", action="store_true", help="tell what would be done and how long it takes")
    command.add_argument("--row", type=int, metavar="RUN", help="print the command that makes this one run by itself")
    command.add_argument("--quiet", action="store_true", help="no progress bar and no summary")
    add_fmus(command)
    add_overrides(command, "machine.axes.Z.friction.F_C='1.8 N.m'")
    command.set_defaults(action=sweep)


def _directory(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("a directory is needed, not an empty text; '.' is the working directory")
    return Path(text)


def sweep(options: Namespace) -> int:
    """feedsim sweep."""
    from feedsim import report
    from feedsim.scenario import load_study
    from feedsim.sweep import design
    from feedsim.sweep.study import AllFailed, run

    study = load_study(options.study, options.overrides, runs=options.runs)
    for warning in study.warnings:
        print(f"feedsim: warning: {warning}", file=sys.stderr)
    planned = design(study)
    if options.row is not None:
        print(_command(study, planned, options.row, options.fmus))
        return 0
    if options.dry_run:
        return _dry_run(study, planned, options)
    directory: Path = options.out or Path("results") / options.study.stem
    report.check_sweep_writable(directory, [study.file, study.scenario, *study.files])
    begun = perf_counter()
    last: list[Progress] = []
    try:
        with _bar(study.name, options.quiet) as tell:

            def progress(now: Progress) -> None:
                last[:] = [now]
                tell(now)

            table = run(
                study,
                directory,
                workers=options.workers,
                scheduler=options.scheduler,
                fmus=options.fmus,
                progress=progress,
                restart=options.restart,
                format=options.format,
                command=sys.argv,
                say=None if options.quiet else lambda text: print(f"feedsim: {text}", file=sys.stderr),
                discard=lambda: report.discard_sweep(directory),
            )
    except AllFailed as error:
        report.write_sweep(error.table, study, planned, directory)  # which groups failures by what they have in common
        raise
    except KeyboardInterrupt:
        done = f"{last[0].done} of {last[0].total} runs are done and kept in" if last else "what is done is kept in"
        print(f"feedsim: interrupted; {done} {directory}; the same command continues", file=sys.stderr)
        return 130
    report.write_sweep(table, study, planned, directory)
    if not options.quiet:
        print(_summary(study, last[0], perf_counter() - begun, directory))
    return 0


def _summary(study: Study, last: Progress, seconds: float, directory: Path) -> str:
    failed = f", {last.failed} of them failed (their messages are in the table)" if last.failed else ""
    resumed = f", {last.resumed} of them before" if last.resumed else ""
    return f"{study.name}: {last.total} runs{resumed}{failed}; {seconds:.3g} s -> {directory}"


@contextmanager
def _bar(name: str, quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """A progress bar with rate and time left; what was done before does not count for the rate."""
    from tqdm import tqdm

    with tqdm(desc=name, unit=" runs", leave=False, disable=quiet or not sys.stderr.isatty()) as bar:

        def tell(now: Progress) -> None:
            if bar.total is None:
                bar.reset(now.total)
                bar.initial = bar.n = now.resumed
                bar.refresh()
            if now.failed:
                bar.set_postfix_str(f"{now.failed} failed", refresh=False)
            bar.update(now.done - bar.n)

        yield tell


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
            told = ", ".join(choice.label for choice in parameter.choices)
        else:
            told = f"{column.min():.6g} to {column.max():.6g} {parameter.unit}".removesuffix(" 1")
        times = "factor " if parameter.factor else ""
        print(f"  {parameter.name}: {times}{told} ({', '.join(parameter.keys)})")
    found = trial(study, planned, options.fmus)
    for run, why in found.failed.items():
        print(f"feedsim: warning: run {run} fails: {why}", file=sys.stderr)
    names = ", ".join(chosen(found.figures, study.figures))
    print(f"  figures: {names}")
    if found.failed:
        print(f"  {len(found.failed)} of the {found.tried} runs tried fail")
    least, most = found.seconds
    which = f"run{'s'[: len(found.runs) != 1]} {', '.join(map(str, found.runs))}"
    print(
        f"  {which} took {_range(least, most, '{:.2g} s'.format)}; all together about "
        f"{_range(least * planned.runs, most * planned.runs, _duration)} on one core"
    )
    return 0


def _range(least: float, most: float, shown: Callable[[float], str]) -> str:
    low, high = shown(least), shown(most)
    return low if low == high else f"{low} to {high}"


def validate(options: Namespace) -> None:
    """feedsim validate of a study: it, its scenario, and a run from the middle, without a step."""
    from feedsim.scenario import load_study
    from feedsim.sweep import design
    from feedsim.sweep.trial import check

    study = load_study(options.scenario, options.overrides)
    planned = design(study)
    run, warnings, failed = check(study, planned, options.fmus)
    told = [f"run {other} is refused, run {run} is not: {why}" for other, why in failed.items()]
    for warning in (*study.warnings, *told, *warnings):
        print(f"feedsim: warning: {warning}", file=sys.stderr)
    print(f"{options.scenario}: valid; {planned.runs} runs of {study.scenario}")


def _duration(seconds: float) -> str:
    for unit, size in (("h", 3600), ("min", 60)):
        if seconds >= 2 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"
