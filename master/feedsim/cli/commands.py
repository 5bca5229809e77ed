"""What each command does. One function per command, named like it, taking the parsed options."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.errors import InputError

if TYPE_CHECKING:
    from feedsim.report.partial import Partial


def run(options: Namespace) -> None:
    from tqdm import tqdm

    from feedsim import analysis, cosim, report
    from feedsim.cli.ssp import subject

    directory: Path = options.out or Path("results") / options.scenario.stem
    with subject(options) as (plan, program, fmus, told):
        analysis.check(plan, program)  # an evaluation that cannot be made should not be found out after the run
        report.check_writable(directory, report.input_paths(plan))
        with (
            _told_of_what_is_left(report.growing(directory)) as recorded,
            tqdm(
                desc=plan.name,
                unit=" cycles",
                unit_scale=True,
                leave=False,
                disable=options.quiet or not sys.stderr.isatty(),
            ) as bar,
        ):

            def progress(done: int, total: int) -> None:
                bar.total = total
                bar.update(done - bar.n)

            result = cosim.run(
                plan, program=program, fmus=fmus, progress=progress, scratch=recorded.scratch, sink=recorded
            )
            bar.close()
            result = replace(result, warnings=told(result.warnings))
            figures = analysis.evaluate(result)
            report.write(result, figures, directory, recorded)
    _warn(result.warnings)
    if not options.quiet:
        print(f"{plan.name}: {report.summary_line(result, figures)} -> {directory}")


@contextmanager
def _told_of_what_is_left(recorded: Partial) -> Iterator[Partial]:
    """Say where the rows are of a run that does not come to its end."""
    try:
        with recorded:
            yield recorded
    except BaseException:
        if recorded.left:
            print(f"feedsim: the rows up to {recorded.time:.9g} s are kept in {recorded.path}", file=sys.stderr)
        raise


def _warn(warnings: Iterable[str]) -> None:
    for warning in warnings:
        print(f"feedsim: warning: {warning}", file=sys.stderr)


def validate(options: Namespace) -> None:
    from feedsim import analysis, cosim
    from feedsim.cli import sweep
    from feedsim.cli.ssp import subject
    from feedsim.scenario import is_study

    if is_study(options.scenario):
        sweep.validate(options)
        return

    with subject(options) as (checked, program, fmus, told):
        analysis.check(checked, program)
        _warn(told(cosim.check(checked, program, fmus=fmus)))
    motions = f"{len(checked.motions)} motion{'s'[: len(checked.motions) != 1]}"
    print(f"{options.scenario}: valid; {motions}, {program.time[-1]:.4g} s on {checked.machine.name}")


def schema(options: Namespace) -> None:
    from feedsim import scenario

    json.dump(scenario.json_schema(options.kind), sys.stdout, indent=2)
    print()


def convert(options: Namespace) -> None:
    from feedsim.trace import convert_mat

    columns = []
    for text in options.column:
        variable, equals, rest = text.partition("=")
        name, colon, unit = rest.rpartition(":")
        if not (equals and colon and variable and name and unit):
            raise InputError(f"--column {text}: VARIABLE=NAME:UNIT is needed, e.g. qg=Z.x_s:m")
        columns.append((variable, name, unit))
    convert_mat(options.file, columns, options.out)
    print(f"{options.out}: {len(columns)} columns from {options.file}")
