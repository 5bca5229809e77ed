"""A scenario, an SSP or a study, checked without a step of it."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from feedsim import analysis
from feedsim.files.source import is_study
from feedsim.foundation.arguments import spell_argument
from feedsim.foundation.errors import Finding, InputError
from feedsim.jobs.parameters import NO_WATCH, Archives, Argument, File, MachineChoice, Option, Settings, Watch, job
from feedsim.jobs.result import announce_programs
from feedsim.jobs.run import on_machine, open_run
from feedsim.scenario import Scenario
from feedsim.simulation import judge

if TYPE_CHECKING:
    from feedsim.design.sweep import Design
    from feedsim.scenario.study import Study


@dataclass(frozen=True)
class CheckReport:
    """What can be said of a valid scenario or study before it is run. A faulty one raises InputError instead.

    Attributes:
        answers: that it is valid, and what it holds.
        findings: what a user should know before running it.
    """

    answers: Sequence[str]
    findings: tuple[Finding, ...] = ()
    kind: ClassVar[str] = "check"

    def __repr__(self) -> str:
        wrong = [finding for finding in self.findings if finding.severity != "note"]
        warned = [f"{len(wrong)} warning{'s'[: len(wrong) != 1]}, see .findings"] if wrong else []
        return "; ".join([*self.answers, *warned])


@job("check a scenario, SSP or study without running it")
def check(
    scenario: Annotated[
        File | Scenario,
        Argument(
            "SCENARIO",
            "scenario file (docs/scenarios.md), NC program (docs/programs.md), SSP (docs/ssp.md) or study "
            "(docs/sweeps.md)",
        ),
    ],
    *,
    machine: MachineChoice = None,
    set: Settings = None,
    runs: Annotated[int | None, Option("N", "of a study: in place of its sampling.runs")] = None,
    trial: Annotated[bool, Option("", "of a study: make some runs, which show how long all will take")] = False,
    row: Annotated[int | None, Option("RUN", "of a study: print the command that makes this one run by itself")] = None,
    fmus: Archives = None,
    watch: Watch = NO_WATCH,
) -> CheckReport:
    """Check a scenario, an SSP or a study, its machine and its motion without running it.

    The shipped units judge their parameters. No program of another maker is executed; a finding says what is therefore
    not checked.

    Command line:
        feedsim example xz_circle z_stop
        feedsim check xz_circle.yaml
        feedsim check studies/z_stop.yaml --trial
        feedsim check studies/z_stop.yaml --row 17

    Raises:
        InputError: lists what is wrong, with file and line.

    >>> import feedsim as fs
    >>> fs.check("xz_circle.yaml")
    xz_circle.yaml: valid; 2 motions, 11.98 s on Test centre
    """
    changes = on_machine(machine, set)
    if not isinstance(scenario, Scenario) and is_study(Path(scenario)):
        return _study(Path(scenario), changes, runs, trial, row, None if fmus is None else Path(fmus), watch)
    for name, value in (("runs", runs), ("trial", "" if trial else None), ("row", row)):
        if value is not None:
            raise InputError(f"{f'{spell_argument(name)} {value}'.strip()}: is for a study; {scenario} is none")
    with open_run(scenario, changes, fmus) as subject:
        plan, program = subject.plan, subject.program
        analysis.check(plan, program)
        warnings = (*subject.warnings(judge.check(plan, program, fmus=subject.fmus)), *analysis.program_notes(program))
    shown = plan.name if isinstance(scenario, Scenario) else scenario
    motions = f"{len(plan.motions)} motion{'s'[: len(plan.motions) != 1]}"
    apart = (
        " as far as no other maker's program has a say"
        if any(warning.code == "unit-not-checked" for warning in warnings)
        else ""
    )
    return CheckReport([f"{shown}: valid{apart}; {motions}, {program.time[-1]:.4g} s on {plan.machine.name}"], warnings)


def _study(
    file: Path, changes: list[str], runs: int | None, trial: bool, row: int | None, fmus: Path | None, watch: Watch
) -> CheckReport:
    """A study, its scenario, and a run from the middle; with `trial` some that are made; or the command of one run."""
    from feedsim.design.sweep import design
    from feedsim.design.sweep import trial as trials
    from feedsim.scenario.study import load_study

    if trial and row is not None:
        raise InputError(
            f"{spell_argument('trial')} and {spell_argument('row')} {row}: one of them; a row is not made, but named"
        )
    study = load_study(file, changes, runs=runs)
    planned = design(study)
    if row is not None:
        return CheckReport([_command(study, planned, row, fmus)], study.warnings)
    head = f"{file}: valid; {planned.runs} runs of {study.scenario}"
    if trial:
        announce_programs(watch, study.base.scenario.machine, fmus, study.base.scenario.coupling)
        tried = _trial(study, planned, fmus)
        return CheckReport([head, *tried.answers], (*study.warnings, *tried.findings))
    run, warnings, failed = trials.check(study, planned, fmus)
    refused = [
        Finding("run-refused", "doubt", f"run {other} is refused, run {run} is not: {why}", f"run {other}")
        for other, why in failed.items()
    ]
    return CheckReport([head], (*study.warnings, *refused, *warnings))


def _command(study: Study, planned: Design, row: int, fmus: Path | None) -> str:
    """The command that makes one run of a study: the same figures, bit for bit."""
    if not 0 <= row < planned.runs:
        raise InputError(f"{spell_argument('row')} {row} is outside the allowed range: from 0 to {planned.runs - 1}")
    words = ["feedsim", "run", str(study.scenario)]
    words += ["--fmus", str(fmus)] if fmus is not None else []
    for option in (*study.settings, *study.overrides, *planned.options(row)):
        words += ["--set", option]
    return shlex.join([*words, "--out", str(Path("results") / f"{study.file.stem}_{row}")])


def _trial(study: Study, planned: Design, fmus: Path | None) -> CheckReport:
    """What the study is, and how long it would take by the durations of some runs."""
    from feedsim.design.sweep.table import chosen
    from feedsim.design.sweep.trial import trial

    lines = [f"{study.name}: {planned.runs} runs ({study.sampling.method}) of {study.scenario}"]
    for i, parameter in enumerate(planned.parameters):
        column = planned.values[:, i]
        if parameter.worded:
            values = ", ".join(choice.label for choice in parameter.choices)
        else:
            values = f"{column.min():.6g} to {column.max():.6g} {parameter.unit}".removesuffix(" 1")
        times = "factor " if parameter.factor else ""
        lines.append(f"  {parameter.name}: {times}{values} ({', '.join(parameter.keys)})")
    result = trial(study, planned, fmus)
    lines.append(f"  figures: {', '.join(chosen(result.figures, study.figures))}")
    if result.failed:
        lines.append(f"  {len(result.failed)} of the {result.tried} runs tried fail")
    least, most = result.seconds
    which = f"run{'s'[: len(result.runs) != 1]} {', '.join(map(str, result.runs))}"
    lines.append(
        f"  {which} took {_range(least, most, '{:.2g} s'.format)}; all together about "
        f"{_range(least * planned.runs, most * planned.runs, _duration)} on one core"
    )
    fails = (
        Finding("run-fails", "doubt", f"run {run} fails: {why}", f"run {run}") for run, why in result.failed.items()
    )
    return CheckReport(lines, tuple(fails))


def _range(least: float, most: float, shown: Callable[[float], str]) -> str:
    low, high = shown(least), shown(most)
    return low if low == high else f"{low} to {high}"


def _duration(seconds: float) -> str:
    for unit, size in (("h", 3600), ("min", 60)):
        if seconds >= 2 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"
